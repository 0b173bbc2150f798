//! Curved faces: cylinders, cones, spheres, tori and other surfaces of revolution that a mesh
//! stands for, and smooth surface of free form.
//!
//! The vertices of a tessellated surface lie on it, its facets inside of it: shapes are fitted to
//! the vertices. All these have an axis of revolution; a sphere has any. What is smooth and none of
//! them is of free form ([`free`]).

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{FaceSource, Residual};

mod describe;
mod find;
mod fit;
mod free;
mod grow;
mod judge;
mod net;
mod profile;
mod seed;
mod trim;

pub(super) use describe::arcs;
pub(super) use find::{Curves, curved_faces, given_faces, rounding};
pub(super) use fit::{Kind, Profile, Surface};
pub(super) use free::free_faces;
pub(super) use seed::{cone_by_circles, cylinder_along, outer, smallest_direction, sphere_through};

/// A line in the part frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// A point of it \[m\].
    pub origin: DVec3,
    /// Unit vector along it.
    pub direction: DVec3,
}

impl Axis {
    /// Distance of `point` from the line \[m\].
    pub fn distance(&self, point: DVec3) -> f64 {
        (point - self.foot(point)).length()
    }

    /// How far `point` lies along the line from its origin \[m\].
    pub fn along(&self, point: DVec3) -> f64 {
        (point - self.origin).dot(self.direction)
    }

    /// The point of the line nearest to `point` \[m\].
    pub fn foot(&self, point: DVec3) -> DVec3 {
        self.origin + self.direction * self.along(point)
    }
}

/// What a curved face is. `along`: the least and greatest place of the face along the direction of
/// its axis, from the axis' origin \[m\]; for a cone from its apex.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum Shape {
    /// A circular cylinder or a strip of one.
    Cylinder {
        /// Its axis.
        axis: Axis,
        /// Its radius \[m\].
        radius: f64,
        /// Extent along the axis \[m\].
        along: [f64; 2],
        /// Arc that the face covers \[rad\]; 2 pi when it closes.
        turn: f64,
    },
    /// A circular cone.
    Cone {
        /// Where its straight lines meet \[m\].
        apex: DVec3,
        /// Unit vector from the apex into the cone.
        axis: DVec3,
        /// Angle between the axis and the surface \[rad\].
        half_angle: f64,
        /// Extent along the axis from the apex \[m\].
        along: [f64; 2],
    },
    /// A sphere or a piece of one.
    Sphere {
        /// Its centre \[m\].
        centre: DVec3,
        /// Its radius \[m\].
        radius: f64,
    },
    /// A torus or a piece of one, such as a rounded edge of a disc.
    Torus {
        /// Its axis; the origin is the centre.
        axis: Axis,
        /// Radius of the circle on which the tube's centres lie \[m\].
        major: f64,
        /// Radius of the tube \[m\].
        minor: f64,
    },
    /// Another surface of revolution.
    Revolution {
        /// Its axis.
        axis: Axis,
        /// Extent along the axis \[m\].
        along: [f64; 2],
    },
    /// Smooth surface of any other form.
    Freeform,
}

impl Shape {
    /// The axis of revolution; `None` for a sphere, which has any through its centre, and for free
    /// form, which has none.
    pub fn axis(&self) -> Option<Axis> {
        match *self {
            Shape::Cylinder { axis, .. }
            | Shape::Torus { axis, .. }
            | Shape::Revolution { axis, .. } => Some(axis),
            Shape::Cone { apex, axis, .. } => Some(Axis { origin: apex, direction: axis }),
            Shape::Sphere { .. } | Shape::Freeform => None,
        }
    }

    /// Name of the kind, as users read it.
    pub fn name(&self) -> &'static str {
        match self {
            Shape::Cylinder { .. } => "cylinder",
            Shape::Cone { .. } => "cone",
            Shape::Sphere { .. } => "sphere",
            Shape::Torus { .. } => "torus",
            Shape::Revolution { .. } => "revolution",
            Shape::Freeform => "freeform",
        }
    }
}

/// One curved face of the part.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CurvedFace {
    /// Stable number; they continue those of the planar faces: the number of planar faces plus the
    /// index in [`super::Part::curved`].
    pub id: u32,
    /// The surface that its vertices lie on.
    pub shape: Shape,
    /// Whether the material lies on the inner side, as in a shaft or ball; false for a bore or a
    /// hollow. For a torus the inner side is that of the tube. Of free form: whether most of it bulges
    /// outwards.
    pub outside: bool,
    /// Greatest distance of its vertices in the mesh from the shape \[m\]; 0 for free form.
    pub residual: f64,
    /// Facets that a whole turn would have at the width of this face's facets. `None` where that is
    /// not known.
    pub facets: Option<f64>,
    /// Where the shape comes from.
    pub source: FaceSource,
    /// Of a fitted face: how far the corners lay off it.
    pub fit: Option<Residual>,
    /// Area of its triangles [m^2].
    pub area: f64,
    /// Area centroid of its triangles \[m\], not a point of the surface.
    pub centroid: DVec3,
    /// Indices of its triangles in the mesh.
    pub triangles: Vec<u32>,
    /// Number of the shell (connected surface) that the face lies on.
    pub shell: u32,
    /// False for the walls of an internal void, or of a body wholly inside another: no finger gets
    /// there.
    pub reachable: bool,
}

/// Facets to the turn up to which a face may as well be meant as facets.
const DOUBTFUL: f64 = 16.5;
/// Distance of two axes that count as one, as a share of the smaller radius: the residual up to
/// which vertices are taken for points of a shape.
const SAME_AXIS: f64 = 1e-3;

impl CurvedFace {
    /// Whether so few facets (up to 16) make its turn that it may be meant as facets: an octagonal
    /// bar, or a coarse cylinder.
    pub fn is_doubtful(&self) -> bool {
        self.source == FaceSource::Mesh && self.facets.is_some_and(|facets| facets < DOUBTFUL)
    }

    /// Whether both are surfaces of revolution about one axis, within their residuals and a
    /// thousandth of the smaller radius: a jaw that turned the part about it would not notice. Two
    /// spheres are only when they are concentric; free form never.
    pub fn is_coaxial(&self, other: &CurvedFace) -> bool {
        if [self, other].iter().any(|face| face.shape == Shape::Freeform) {
            return false;
        }
        let tolerance = self.residual
            + other.residual
            + SAME_AXIS * self.shape.radius().min(other.shape.radius());
        let on = |axis: Axis, shape: &Shape| {
            shape.ends().iter().all(|&end| axis.distance(end) <= tolerance)
        };
        match (self.shape.axis(), other.shape.axis()) {
            (Some(a), Some(b)) => {
                let parallel = a.direction.cross(b.direction).length();
                // A short face says little about its direction: the longer one's axis is taken to
                // the ends of the shorter.
                let (long, short) = if self.shape.length() >= other.shape.length() {
                    (a, &other.shape)
                } else {
                    (b, &self.shape)
                };
                parallel < 0.1 && on(long, short)
            }
            (Some(axis), None) => on(axis, &other.shape),
            (None, Some(axis)) => on(axis, &self.shape),
            (None, None) => self.shape.ends()[0].distance(other.shape.ends()[0]) <= tolerance,
        }
    }

    /// Whether both lie on one cylinder or one sphere, with the material on the same side: two
    /// patches of one shaft or ball.
    pub fn is_same_surface(&self, other: &CurvedFace) -> bool {
        let alike = match (&self.shape, &other.shape) {
            (Shape::Cylinder { radius: a, .. }, Shape::Cylinder { radius: b, .. })
            | (Shape::Sphere { radius: a, .. }, Shape::Sphere { radius: b, .. }) => {
                (a - b).abs() <= self.residual + other.residual + SAME_AXIS * a.min(*b)
            }
            _ => false,
        };
        alike && self.outside == other.outside && self.is_coaxial(other)
    }
}

impl Shape {
    /// Kind and surface; the profile of a revolution is not known. `None` for free form.
    pub(super) fn surface(&self) -> Option<(Kind, Surface)> {
        let line = |axis, radius, slope| Surface { axis, profile: Profile::Line { radius, slope } };
        let circle =
            |axis, major, minor| Surface { axis, profile: Profile::Circle { major, minor } };
        Some(match *self {
            Shape::Cylinder { axis, radius, .. } => (Kind::Cylinder, line(axis, radius, 0.0)),
            Shape::Cone { apex, axis, half_angle, along } => {
                let middle = (along[0] + along[1]) / 2.0;
                let origin = apex + axis * middle;
                let axis = Axis { origin, direction: axis };
                (Kind::Cone, line(axis, middle * half_angle.tan(), half_angle))
            }
            Shape::Sphere { centre, radius } => {
                let axis = Axis { origin: centre, direction: DVec3::Z };
                (Kind::Sphere, circle(axis, 0.0, radius))
            }
            Shape::Torus { axis, major, minor } => (Kind::Torus, circle(axis, major, minor)),
            Shape::Revolution { axis, .. } => (Kind::Revolution, line(axis, 0.0, 0.0)),
            Shape::Freeform => return None,
        })
    }

    /// The radius that lengths are compared with \[m\].
    fn radius(&self) -> f64 {
        match *self {
            Shape::Cylinder { radius, .. } | Shape::Sphere { radius, .. } => radius,
            Shape::Torus { major, minor, .. } => major + minor,
            Shape::Cone { half_angle, along, .. } => along[1] * half_angle.tan(),
            Shape::Revolution { along, .. } => along[1] - along[0],
            Shape::Freeform => 0.0,
        }
    }

    /// Extent along the axis \[m\].
    fn length(&self) -> f64 {
        match *self {
            Shape::Cylinder { along, .. }
            | Shape::Cone { along, .. }
            | Shape::Revolution { along, .. } => along[1] - along[0],
            Shape::Torus { minor, .. } => minor,
            Shape::Sphere { .. } | Shape::Freeform => 0.0,
        }
    }

    /// Points on the axis between which the face lies; the centre of a sphere or torus.
    fn ends(&self) -> Vec<DVec3> {
        match *self {
            Shape::Cylinder { axis, along, .. } | Shape::Revolution { axis, along } => {
                along.iter().map(|place| axis.origin + axis.direction * *place).collect()
            }
            Shape::Cone { apex, axis, along, .. } => {
                along.iter().map(|place| apex + axis * *place).collect()
            }
            Shape::Sphere { centre, .. } => vec![centre],
            Shape::Torus { axis, .. } => vec![axis.origin],
            Shape::Freeform => Vec::new(),
        }
    }
}

/// Numbers of the faces in groups that share an axis (spheres: with any face whose axis passes
/// through the centre), each sorted, in the order of their first faces. Faces alone are groups of
/// one.
pub(super) fn coaxial_groups(faces: &[CurvedFace]) -> Vec<Vec<u32>> {
    let mut groups: Vec<Vec<&CurvedFace>> = Vec::new();
    for face in faces {
        // The first member of a group stands for it, and is the largest.
        match groups.iter_mut().find(|group| group[0].is_coaxial(face)) {
            Some(group) => group.push(face),
            None => groups.push(vec![face]),
        }
    }
    groups.into_iter().map(|group| group.into_iter().map(|face| face.id).collect()).collect()
}

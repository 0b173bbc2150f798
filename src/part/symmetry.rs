//! Turns that map a part to itself.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{Axis, Part, Shape};
use crate::model::Frame;

/// Faces across the axis may lean by this \[rad\].
const LEVEL: f64 = 1e-3;
/// Share of the surface that may belong to no face.
const LOOSE: f64 = 1e-6;

/// The turns, by any angle, that map a part to itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum Symmetry {
    /// Round about one axis: shafts, discs, rings, cones.
    Axis {
        /// The axis; its origin is the point nearest to the middle of the part's box.
        axis: Axis,
    },
    /// Round about every axis through a point: balls.
    Point {
        /// The point \[m\].
        centre: DVec3,
    },
}

impl Symmetry {
    /// The same where `frame` puts the part.
    pub fn moved(&self, frame: &Frame) -> Self {
        match *self {
            Self::Axis { axis: Axis { origin, direction } } => Self::Axis {
                axis: Axis { origin: frame.point(origin), direction: frame.rotation * direction },
            },
            Self::Point { centre } => Self::Point { centre: frame.point(centre) },
        }
    }
}

impl Part {
    /// The turns that map the part to itself as its faces say: every curved face is round about one
    /// axis, every plane lies across it, and nothing is left of the surface. `None`: there is no
    /// such axis, the surface is open, or faces have so few facets that they may be meant as such.
    pub fn symmetry(&self) -> Option<Symmetry> {
        let total: f64 = self.triangle_areas().sum();
        let faces: f64 = self.faces.iter().map(|face| face.area).sum();
        let curved: f64 = self.curved.iter().map(|face| face.area).sum();
        if !self.health.watertight
            || (total - faces - curved).abs() > LOOSE * total
            || self.curved.iter().any(|face| face.is_doubtful() || face.shape == Shape::Freeform)
        {
            return None;
        }
        // By falling area: the largest says best where the axis lies.
        let Some(first) = self.curved.iter().find(|face| face.shape.axis().is_some()) else {
            let [ball, others @ ..] = &self.curved[..] else { return None };
            let Shape::Sphere { centre, .. } = ball.shape else { return None };
            let concentric = others.iter().all(|other| ball.is_coaxial(other));
            return (concentric && self.faces.is_empty()).then_some(Symmetry::Point { centre });
        };
        let axis = first.shape.axis()?;
        let across = |normal: DVec3| normal.cross(axis.direction).length() < LEVEL;
        let round = self.curved.iter().all(|face| first.is_coaxial(face))
            && self.faces.iter().all(|face| across(face.normal));
        let (low, high) = self.mesh.bounding_box();
        let origin = axis.foot(0.5 * (low + high));
        round.then_some(Symmetry::Axis { axis: Axis { origin, ..axis } })
    }

    /// Areas of the mesh's triangles [m^2].
    fn triangle_areas(&self) -> impl Iterator<Item = f64> {
        (0..self.mesh.triangles.len() as u32).map(|triangle| {
            let [a, b, c] = self.mesh.corners(triangle);
            0.5 * (b - a).cross(c - a).length()
        })
    }
}

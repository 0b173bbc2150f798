//! A contact pair made ready for solving: scaled to its size, in a frame at its middle.

use glam::{DVec2, DVec3};

use crate::contact::{Loops, PlaneWrench, Twist, moments};
use crate::geometry::hull::{convex_hull, support};
use crate::model::{Contact, Grip, Pressure, Slip, Wrench};

use super::{curved, pressure};

/// Both contact areas in units of `length`, about `origin`; all that a contact decides for every
/// load on it. Both areas lie in the pads' plane and are pressed by the pads' tilt alone; an area on
/// a face with a shape of its own would have its height above that plane beside it here.
#[derive(Debug, Clone)]
pub struct Pads {
    /// The areas I and II, scaled.
    pub areas: [Loops; 2],
    /// Their moments ([`moments`]), scaled.
    pub moments: [[f64; 6]; 2],
    /// Their convex hulls, counter-clockwise, scaled.
    pub hulls: [Vec<DVec2>; 2],
    /// Outward normals of the edges of `conv A_I - conv A_II` with the supports of the two terms in
    /// that direction, scaled.
    pub supports: Vec<(DVec2, [f64; 2])>,
    /// Whether the areas are the same to [`ROUNDING`].
    pub congruent: bool,
    /// Width of the narrower area, that of the bar with the same least second moment, scaled: at most
    /// 1, as of a square.
    pub width: f64,
    /// Middle of the areas in the grip frame \[m\]: the scaled frame's origin.
    pub origin: DVec2,
    /// Square root of the mean area \[m\]: the scaled frame's unit.
    pub length: f64,
}

impl Pads {
    /// `None` when an area is empty.
    pub fn new(contact: &Contact) -> Option<Self> {
        let raw = [&contact.face_i, &contact.face_ii].map(|patch| moments(&Loops::new(patch)));
        if raw.iter().any(|m| !(m[0] > 0.0 && m[0].is_finite())) {
            return None;
        }
        let area = raw[0][0] + raw[1][0];
        let origin = DVec2::new(raw[0][1] + raw[1][1], raw[0][2] + raw[1][2]) / area;
        let length = (area / 2.0).sqrt();
        let areas = [&contact.face_i, &contact.face_ii]
            .map(|patch| Loops::mapped(patch, |point| (point - origin) / length));
        let moments = [moments(&areas[0]), moments(&areas[1])];
        let hulls = [convex_hull(areas[0].points()), convex_hull(areas[1].points())];
        let normals = |hull: &[DVec2], sign: f64| -> Vec<DVec2> {
            let edge = |i: usize| hull[(i + 1) % hull.len()] - hull[i];
            (0..hull.len()).map(|i| sign * -edge(i).perp().normalize_or_zero()).collect()
        };
        let all = normals(&hulls[0], 1.0)
            .into_iter()
            .chain(normals(&hulls[1], -1.0))
            .filter(|e| *e != DVec2::ZERO);
        let supports = all.map(|e| (e, [support(&hulls[0], e), support(&hulls[1], -e)])).collect();
        let congruent = congruent(&areas, ROUNDING);
        let width = moments.iter().map(width).fold(1.0, f64::min);
        Some(Self { areas, moments, hulls, supports, congruent, width, origin, length })
    }

    /// The load in units of `force` \[N\] and of this contact's length, its moment about the scaled
    /// frame's origin; `distance` \[m\] is negative for a grip from inside.
    pub fn load(&self, distance: f64, force: f64, wrench: &Wrench) -> Load {
        let origin = DVec3::new(self.origin.x, self.origin.y, 0.0);
        let f = wrench.force / force;
        let m = (wrench.moment - origin.cross(wrench.force)) / (force * self.length);
        let in_plane = nalgebra::Vector3::new(f.x, f.y, m.z);
        let size = in_plane.norm();
        let direction = if size > 0.0 { in_plane / size } else { nalgebra::Vector3::zeros() };
        Load {
            direction: direction.into(),
            size,
            normal: [1.0 + f.z / 2.0, 1.0 - f.z / 2.0],
            moment: [m.x, m.y],
            half_distance: distance / self.length / 2.0,
        }
    }

    /// Greatest pressure on either face at a squeeze with `force` \[N\] and no load \[Pa\]; `None`
    /// where the pads would turn the part.
    pub fn greatest_pressure(&self, force: f64) -> Option<f64> {
        let q = pressure::solve(self, [1.0; 2], DVec2::ZERO, None, &mut Loops::default())?;
        let of = |k: usize| {
            let [p0, p1, p2] = pressure::face_pressure(&q, k);
            let points = self.areas[k].points().iter();
            points.map(|x| p0 + p1 * x.x + p2 * x.y).fold(0.0, f64::max)
        };
        Some(of(0).max(of(1)) * force / (self.length * self.length))
    }

    /// Pressure planes in SI about the grip origin from scaled coefficients `(a_i0, a_ii0, a1,
    /// a2)`.
    pub fn pressure(&self, q: [f64; 4], force: f64) -> Pressure {
        let unit = force / (self.length * self.length);
        let (a1, a2) = (q[2] * unit / self.length, q[3] * unit / self.length);
        let shift = a1 * self.origin.x + a2 * self.origin.y;
        Pressure { a_i0: q[0] * unit - shift, a_ii0: q[1] * unit + shift, a1, a2 }
    }

    /// The slip in SI about the grip origin from a scaled twist.
    pub fn slip(&self, twist: Twist) -> Slip {
        let (u, omega) = (DVec2::new(twist.u1, twist.u2), twist.omega);
        if omega.abs() <= TRANSLATION * u.length() {
            let direction = u.normalize_or_zero();
            return Slip::Translation { direction: direction.to_array() };
        }
        let c = self.origin + DVec2::new(-u.y, u.x) / omega * self.length;
        Slip::Rotation { c: c.to_array(), sense: if omega > 0.0 { 1 } else { -1 } }
    }

    /// A twist about the grip origin, SI up to scale, in the scaled frame.
    pub fn scaled_twist(&self, Twist { u1, u2, omega }: Twist) -> Twist {
        Twist {
            u1: u1 - omega * self.origin.y,
            u2: u2 + omega * self.origin.x,
            omega: omega * self.length,
        }
    }
}

/// Width of the bar with the least second moment of the area with these [`moments`].
fn width(&[area, x, y, xx, xy, yy]: &[f64; 6]) -> f64 {
    let (a, b, c) = (xx - x * x / area, xy - x * y / area, yy - y * y / area);
    let least = (a + c) / 2.0 - ((a - c) / 2.0).hypot(b);
    (12.0 * least.max(0.0) / area).sqrt()
}

/// Greatest pressure on either face of a grip at a squeeze with `force` \[N\] and no load \[Pa\]: of
/// rigid pads on planes, of the pads' layers on what is not plane. `None` without contact, or where
/// the pads would turn the part.
pub fn squeeze_pressure(grip: &Grip, force: f64) -> Option<f64> {
    match &grip.surfaces {
        Some(surfaces) => {
            let faces = curved::Pads::new(surfaces).ok()?.squeezed(force)?;
            Some(faces.iter().map(|face| face.greatest_pressure).fold(0.0, f64::max))
        }
        None => Pads::new(&grip.contact)?.greatest_pressure(force),
    }
}

/// Tolerance of [`congruent`] for areas that differ by rounding: one stands for both in f64.
pub const ROUNDING: f64 = 1e-12;

/// Tolerance of [`congruent`] for what is summed in f32 and for parts from files with
/// single-precision coordinates: the answer changes by less than a tenth of the tolerance of the
/// bounds.
pub const SINGLE_PRECISION: f64 = 2e-6;

/// Whether both areas have the same edges, each loop perhaps begun at another point, to within
/// `tolerance` over the perimeter of an area of one: a change of the area by no more than that
/// share.
pub fn congruent([a, b]: &[Loops; 2], tolerance: f64) -> bool {
    if a.len() != b.len() {
        return false;
    }
    let perimeter: f64 = a.edges().map(|(from, to)| from.distance(to)).sum();
    let near = tolerance * moments(a)[0] / perimeter;
    let same = |(a, b): (DVec2, DVec2), (c, d): (DVec2, DVec2)| {
        a.distance(c) <= near && b.distance(d) <= near
    };
    // Mostly the areas list their points in the same order: look there first.
    a.edges()
        .zip(b.edges())
        .all(|(edge, other)| same(edge, other) || b.edges().any(|any| same(edge, any)))
}

/// Angular over linear velocity, in pad lengths, below which a slip is called a translation:
/// rounding of the load's moment alone moves the slip centre this far out.
const TRANSLATION: f64 = 1e-14;

/// A scaled load: forces in units of the gripping force, lengths in the pads' length.
#[derive(Debug, Clone, Copy)]
pub struct Load {
    /// `(F1, F2, M3)` at the length 1, or zero.
    pub direction: PlaneWrench,
    /// Norm of `(F1, F2, M3)`.
    pub size: f64,
    /// Normal forces `N_I`, `N_II` of equations (8)(9).
    pub normal: [f64; 2],
    /// `(M1, M2)`.
    pub moment: [f64; 2],
    /// `d/2`, negative for a grip from inside.
    pub half_distance: f64,
}

impl Load {
    /// `(F1, F2, M3)`.
    pub fn in_plane(&self) -> PlaneWrench {
        let PlaneWrench { f1, f2, m3 } = self.direction;
        PlaneWrench { f1: f1 * self.size, f2: f2 * self.size, m3: m3 * self.size }
    }

    /// The contact moment `(X1, X2)` that the load asks for without friction coupling.
    pub fn contact_moment(&self) -> DVec2 {
        DVec2::new(-self.moment[1], self.moment[0])
    }
}

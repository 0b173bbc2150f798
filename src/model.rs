//! Plain data shared by every floor: polygons, wrenches, pressures, slips, scores, grips. SI units,
//! no mathematics.
//!
//! Grip frame: origin midway between the jaws; `x3` is the closing axis; `x1` is the approach axis
//! (palm towards fingertips); `x2 = x3 x x1`. Face I lies at `x3 = +d/2` (the jaw pushes the body
//! along `-x3`), face II at `x3 = -d/2`.

mod surface;

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, ErrorKind, Result};

pub use surface::{Gap, Piece, Surfaces};

/// A closed loop of points \[m\]; the last point joins the first.
pub type Ring = Vec<DVec2>;

/// A plane polygon with holes \[m\]. Outer ring counter-clockwise, holes clockwise once normalised
/// ([`crate::geometry::polygon`]); readers accept either sense.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Polygon {
    /// Outer boundary.
    pub outer: Ring,
    /// Boundaries of the holes.
    #[serde(default)]
    pub holes: Vec<Ring>,
}

/// One contact area: disjoint polygons in the pad plane `(x1, x2)` \[m\].
pub type Patch = Vec<Polygon>;

/// The two contact areas of a grip, both in the grip frame's `(x1, x2)`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Contact area on face I (at `x3 = +d/2`).
    #[serde(rename = "A_I")]
    pub face_i: Patch,
    /// Contact area on face II (at `x3 = -d/2`).
    #[serde(rename = "A_II")]
    pub face_ii: Patch,
}

/// Largest coordinate or length of a file or an option \[m\]: to rounding a tenth of a micrometre is
/// lost beyond.
pub(crate) const LARGEST_LENGTH: f64 = 1e9;
/// Largest coordinate or distance that the mechanics take \[m\], whose equations know no scale:
/// lengths enter in the fourth power, and that must stay a number.
pub(crate) const LARGEST_SCALE: f64 = 1e60;
/// Smallest extent of a contact area that is taken \[m\]: its fourth power leaves room above the
/// smallest of numbers.
const SMALLEST_EXTENT: f64 = 1e-30;

impl Contact {
    /// Refuses coordinates that numbers of double precision cannot work with; `place` names the
    /// contact.
    pub(crate) fn check(&self, place: &str) -> Result<()> {
        for (name, patch) in [("A_I", &self.face_i), ("A_II", &self.face_ii)] {
            let rings =
                || patch.iter().flat_map(|polygon| polygon.holes.iter().chain([&polygon.outer]));
            check_area(rings, || format!("{place}{name}"))?;
        }
        Ok(())
    }
}

/// [`Contact::check`] for the rings of one area; `place` names it.
pub(crate) fn check_area<'a, I: Iterator<Item = &'a Ring>>(
    rings: impl Fn() -> I,
    place: impl Fn() -> String,
) -> Result<()> {
    let bad = |problem: String, remedy: &str| {
        Err(Error::new(ErrorKind::Geometry, place(), problem, remedy))
    };
    let mut extent = 0.0_f64;
    for point in rings().flatten() {
        if !point.is_finite() || point.abs().max_element() > LARGEST_SCALE {
            return bad(
                format!("has the point ({:?}, {:?})", point.x, point.y),
                "give finite coordinates of at most 1e60 m",
            );
        }
    }
    for ring in rings() {
        let Some(&first) = ring.first() else { continue };
        extent = ring.iter().map(|x| (*x - first).abs().max_element()).fold(extent, f64::max);
    }
    if extent > 0.0 && extent < SMALLEST_EXTENT {
        return bad(
            format!("measures {extent:e} m"),
            "give an area of at least 1e-30 m in one direction",
        );
    }
    Ok(())
}

/// A force \[N\] and a moment [N m] ON the body. The frame and the point of the moment are the
/// holder's to state; in mechanics it is the grip frame and its origin.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Force \[N\].
    pub force: DVec3,
    /// Moment [N m].
    pub moment: DVec3,
}

/// One load of a run: an external wrench on the body about the centre of mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LoadCase {
    /// What it is, e.g. `gravity -z`.
    pub name: String,
    /// Force and moment in the part frame, moment about the centre of mass.
    pub wrench: Wrench,
}

/// Pressure planes of equations (1)(2): `p_I = a_i0 + a1 x1 + a2 x2`, `p_II = a_ii0 - a1 x1 - a2
/// x2`, both `max(0, .)` where a pad separates (19)(20).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Pressure {
    /// Value of `p_I` at the origin \[Pa\].
    #[serde(rename = "aI0")]
    pub a_i0: f64,
    /// Value of `p_II` at the origin \[Pa\].
    #[serde(rename = "aII0")]
    pub a_ii0: f64,
    /// Slope along `x1` [Pa/m].
    pub a1: f64,
    /// Slope along `x2` [Pa/m].
    pub a2: f64,
}

/// The incipient motion of the body in the grip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Slip {
    /// Rotation about `x3` through `c` \[m\]; `sense` is +1 (the paper's) or -1 (there a negative
    /// mu).
    Rotation {
        /// Slip centre in `(x1, x2)` \[m\].
        c: [f64; 2],
        /// Sense of rotation about `+x3`.
        sense: i8,
    },
    /// Pure translation: unit velocity of the body in `(x1, x2)`.
    Translation {
        /// Unit velocity.
        direction: [f64; 2],
    },
    /// No load in the pad plane: nothing slips at any friction.
    None,
    /// Rotation about an axis in the pad plane, beside others: a part that is round about it on
    /// both faces ([`crate::mechanics::curved`]).
    Spin {
        /// Angular velocity about `x1`, `x2`, `x3`.
        omega: [f64; 3],
        /// Velocity along `x1`, `x2` of the point midway between the faces, in metres where
        /// `omega` is in radians.
        velocity: [f64; 2],
        /// The face that does not slip, if one does not: the part rolls on it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rolls_on: Option<Face>,
    },
}

impl Slip {
    /// Share of the motion below which its turning is not worth telling.
    const LEAST_TURN: f64 = 0.02;

    /// Whether all points within `reach` \[m\] of the grip's middle move alike but for two percent:
    /// the part slides, though no limit state of a round part is without a trace of a turn.
    pub fn slides(&self, reach: f64) -> bool {
        match self {
            Self::Translation { .. } => true,
            Self::None => false,
            Self::Rotation { c: [x, y], .. } => reach < Self::LEAST_TURN * x.hypot(*y),
            Self::Spin { omega: [o1, o2, o3], velocity: [u1, u2], .. } => {
                let rate = o1.hypot(*o2).hypot(*o3);
                rate * reach < Self::LEAST_TURN * u1.hypot(*u2)
            }
        }
    }
}

/// One of the two faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Face {
    /// At `x3 = +d/2`.
    I,
    /// At `x3 = -d/2`.
    II,
}

/// What the solver found out about a grip under a load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Status {
    /// A limit state exists; no other was found.
    Ok,
    /// A limit state exists with part of the pads separated, and the caller asked to discard such
    /// grips.
    Separating,
    /// A limit state was found, but another one exists or could not be excluded.
    Ambiguous,
    /// No limit state exists: the contact twists out.
    TwistedOut,
    /// `|F3| >= 2 Fn`: one pad carries no normal force.
    NoNormalForce,
    /// A contact area is empty.
    NoContact,
    /// The iteration ended above its residual target; the numbers are the best found.
    NotConverged,
}

impl Status {
    /// Whether `mu_s` is a usable number for ranking.
    pub fn holds(self) -> bool {
        matches!(self, Self::Ok | Self::Ambiguous)
    }
}

/// Lower and upper bound on `mu_s` for the found pressure (MECHANICS: the slip problem is convex).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// `(w.v)/D(v)` of the best twist tried.
    pub lower: f64,
    /// From the supports of the tried twists; infinite where none encloses the load, null in JSON.
    #[serde(with = "null_is_infinite")]
    pub upper: f64,
}

/// The answer for one contact pair and one wrench.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// What kind of answer this is.
    pub status: Status,
    /// Smallest friction coefficient that holds; `None` when no limit state exists.
    pub mu_s: Option<f64>,
    /// Incipient motion at `mu_s`.
    pub slip: Option<Slip>,
    /// Pressure planes at the limit state.
    pub pressure: Option<Pressure>,
    /// Area of face I still in contact [m^2].
    #[serde(rename = "contact_area_I")]
    pub contact_area_i: f64,
    /// Area of face II still in contact [m^2].
    #[serde(rename = "contact_area_II")]
    pub contact_area_ii: f64,
    /// Largest of the seven equilibrium equations' residuals, forces over Fn and moments over Fn
    /// sqrt(A).
    #[serde(with = "null_is_infinite")]
    pub residual: f64,
    /// Certificate on `mu_s` for the found pressure.
    pub bounds: Option<Bounds>,
    /// Evaluations of the contact integrals spent.
    pub evaluations: u32,
}

/// A rigid frame: `point_in_outer = rotation * point_in_inner + origin`. Columns of `rotation` are
/// the inner axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Orthonormal, right-handed.
    pub rotation: DMat3,
    /// Origin of the inner frame in the outer one \[m\].
    pub origin: DVec3,
}

impl Frame {
    /// The identity.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, origin: DVec3::ZERO };

    /// A point of the inner frame in the outer one.
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.origin
    }

    /// A point of the outer frame in the inner one.
    pub fn point_inverse(&self, point: DVec3) -> DVec3 {
        self.rotation.transpose() * (point - self.origin)
    }

    /// `self` after `inner`: the frame of `inner`'s inside in `self`'s outside.
    #[must_use]
    pub fn compose(&self, inner: &Self) -> Self {
        Self { rotation: self.rotation * inner.rotation, origin: self.point(inner.origin) }
    }

    /// The inverse frame.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, origin: -(rotation * self.origin) }
    }
}

/// A candidate grip on a part, free of interference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Grip {
    /// Number of the candidate, stable for the same input and settings.
    pub id: u64,
    /// Grip frame in the part frame.
    pub part_from_grip: Frame,
    /// Distance between the two faces, `d` \[m\].
    pub width: f64,
    /// Face of the part under pad I ([`crate::part::PlanarFace::id`],
    /// [`crate::part::CurvedFace::id`]).
    pub face_i: u32,
    /// Face of the part under pad II.
    pub face_ii: u32,
    /// Angle of the approach axis about the closing axis, from the face pair's reference direction
    /// \[rad\].
    pub angle: f64,
    /// Contact areas in the grip frame; shared by grips whose areas are the same in the pad frame.
    /// Of [`Grip::surfaces`] what is pressed without a load.
    pub contact: Arc<Contact>,
    /// What the pads touch, where it is not plane: all of the part's surface that the pads' layers
    /// reach; shared as the areas are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surfaces: Option<Arc<Surfaces>>,
    /// The jaws open against the faces from inside (a slot): face I then lies at `x3 = -width/2`,
    /// still pushed along `-x3`, and the `d` of the mechanics is `-width`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub inside: bool,
    /// The grip with the same pose and the jaws exchanged, when that one is the representative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flip_of: Option<u64>,
}

/// A candidate that is no grip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Negative {
    /// Number of the candidate, as [`Grip::id`].
    pub id: u64,
    /// Grip frame in the part frame.
    pub part_from_grip: Frame,
    /// Distance between the two faces \[m\].
    pub width: f64,
    /// Planar face of the part under pad I.
    pub face_i: u32,
    /// Planar face of the part under pad II.
    pub face_ii: u32,
    /// As [`Grip::angle`] \[rad\].
    pub angle: f64,
    /// As [`Grip::inside`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub inside: bool,
    /// Why it is none, as in the counts of rejections: `part_interference:fingertip`,
    /// `twisted_out`, ..
    pub reason: String,
}

impl Negative {
    /// A grip that does not hold, for this reason.
    pub fn new(grip: &Grip, reason: String) -> Self {
        Self {
            id: grip.id,
            part_from_grip: grip.part_from_grip,
            width: grip.width,
            face_i: grip.face_i,
            face_ii: grip.face_ii,
            angle: grip.angle,
            inside: grip.inside,
            reason,
        }
    }

    /// The grip that it would be, without its contact.
    pub fn grip(&self) -> Grip {
        Grip {
            id: self.id,
            part_from_grip: self.part_from_grip,
            width: self.width,
            face_i: self.face_i,
            face_ii: self.face_ii,
            angle: self.angle,
            contact: Arc::default(),
            surfaces: None,
            inside: self.inside,
            flip_of: None,
        }
    }
}

/// A candidate that is no grip, and what it lacks.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Miss {
    /// The candidate and the reason. Two faces that lie outside the stroke make no candidate: of
    /// them the id is 0 and names nothing.
    pub pose: Negative,
    /// What it lacks, where a number says it: how deep a body lies in what stops it, how far a
    /// width or a place is beyond its limit \[m\]; how far an approach lies outside the cone
    /// \[rad\]; which share of the contact area asked for is missing, or, of one that does not hold,
    /// which share of the load that it loses, the one that tilts it most, is not held (0..1).
    pub by: Option<f64>,
    /// Where a body meets what stops it, part frame \[m\].
    pub place: Option<DVec3>,
}

impl Miss {
    /// From its parts.
    pub fn new(pose: Negative, by: Option<f64>, place: Option<DVec3>) -> Self {
        Self { pose, by, place }
    }
}

/// JSON has no infinity and no nan: both are written as null, and null is read as infinity.
pub(crate) mod null_is_infinite {
    use serde::{Deserialize, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
    pub(crate) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() {
            serializer.serialize_f64(*value)
        } else {
            serializer.serialize_none()
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}

impl Grip {
    /// Height of face I over face II along `x3`, the `d` of the mechanics \[m\]: the width, negative
    /// for an inside grip.
    pub fn distance(&self) -> f64 {
        if self.inside { -self.width } else { self.width }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_with_a_trace_of_a_turn_is_a_slide() {
        let spin = |o1: f64, u: [f64; 2]| Slip::Spin {
            omega: [o1, 0.0, 0.0],
            velocity: u,
            rolls_on: None,
        };
        let about = |x: f64| Slip::Rotation { c: [x, 0.0], sense: 1 };
        // A cylinder of 20 mm pulled along its axis, and one that rolls.
        assert!(spin(-0.0018, [-1.0, -0.175]).slides(0.01));
        assert!(!spin(1.0, [0.0, 0.01]).slides(0.01));
        assert!(about(2e3).slides(0.02) && !about(0.03).slides(0.02));
        assert!(Slip::Translation { direction: [1.0, 0.0] }.slides(0.01));
        assert!(!Slip::None.slides(0.01));
    }
}

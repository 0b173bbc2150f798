//! The gripper file: stroke, force, pads, finger and palm bodies, frames; and the shipped
//! catalogue.

pub mod catalogue;
pub mod check;
pub mod drawing;
pub mod file;
mod import;
pub mod layer;
mod mesh;
mod travel;

use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::geometry::{patch_area, ring_area};
use crate::model::{Contact, Frame, Grip, Ring};

pub use catalogue::find;
pub use check::check;
pub use file::{parse, read};
pub use import::{Imported, import};
pub use layer::Layer;
pub use travel::{Travel, TravelRow};

/// A two-finger gripper in SI units, in the grip frame (x1 approach, x3 closing; origin midway
/// between the pads).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gripper {
    /// Display name.
    pub name: String,
    /// Smallest and largest distance of the pads \[m\].
    pub stroke: [f64; 2],
    /// Smallest and largest gripping force of one jaw \[N\].
    pub force: [f64; 2],
    /// Largest mass that it may carry \[kg\], where stated: a load whose force exceeds its weight is
    /// not carried.
    #[serde(default)]
    pub payload: Option<f64>,
    /// Largest moments of a load about `x1`, `x2`, `x3` at the pads, both jaws together [N m], where
    /// stated.
    #[serde(default)]
    pub moment: Option<[f64; 3]>,
    /// Pad outline in `(x1, x2)`, counter-clockwise, convex \[m\]; the same on both jaws but for
    /// `pad_ii`.
    pub pad: Ring,
    /// Outline of jaw II's pad, where it has another one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pad_ii: Option<Ring>,
    /// Friction coefficient of the pad material, where stated.
    pub pad_friction: Option<f64>,
    /// Rubber thickness \[m\], where stated.
    pub pad_thickness: Option<f64>,
    /// Young's modulus of the rubber \[Pa\], where stated.
    #[serde(default)]
    pub pad_modulus: Option<f64>,
    /// Poisson's ratio of the rubber, where stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pad_poisson: Option<f64>,
    /// Pressure per compression of the layer [Pa/m], where stated: [`Gripper::layer`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pad_stiffness: Option<f64>,
    /// Distance from the pad face to the finger's outer gripping face \[m\], where the gripper can
    /// grip from inside, opening into a slot; that face has the pad's outline.
    #[serde(default)]
    pub outer_pad: Option<f64>,
    /// Bodies that move with the finger at `x3 > 0`, placed for pads touching at zero width: the
    /// pad face lies at `x3 = 0` and the body at `x3 >= 0`. The other finger's bodies are these
    /// turned by 180 degrees about `x1`, but for `fingers_ii`.
    pub fingers: Vec<Body>,
    /// Bodies of the finger at `x3 < 0` before that turn, where they are others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingers_ii: Option<Vec<Body>>,
    /// Which jaws move against the palm.
    #[serde(default, skip_serializing_if = "Moving::is_both")]
    pub moving: Moving,
    /// How the pads of moving jaws go along the approach while they move.
    #[serde(default)]
    pub travel: Travel,
    /// Bodies fixed to the palm, placed for pads touching at zero width; [`Gripper::palm_at`]
    /// gives those of a grip.
    pub palm: Vec<Body>,
    /// Flange frame (robot mounting) in the grip frame with the pads touching, where stated; that
    /// of a grip is [`Gripper::palm_place`] of it.
    pub grip_from_flange: Option<Frame>,
    /// Tool frame in the grip frame, where it is not the usual one (z approach, y closing, origin
    /// between the pads); fixed to the palm as the flange is.
    #[serde(default)]
    pub grip_from_tool: Option<Frame>,
    /// Where each dimension comes from, by its name in the file, e.g. `pad.friction` or
    /// `finger.fingertip`.
    #[serde(default)]
    pub sources: BTreeMap<String, Source>,
}

/// Where a dimension comes from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// In words.
    pub text: String,
    /// Whether it was taken from the maker's or another named document; else it is an estimate.
    pub verified: bool,
}

/// A solid of the gripper.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Name for messages, e.g. `fingertip`.
    pub name: String,
    /// Its shape, in the frame below.
    pub shape: Shape,
    /// Body frame in the grip frame.
    pub grip_from_body: Frame,
}

/// Shapes of gripper bodies, all convex.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Shape {
    /// Box with these half sizes \[m\].
    Box {
        /// Half sizes along the body axes \[m\].
        half: DVec3,
    },
    /// Cylinder about the body's z axis.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Half height \[m\].
        half_height: f64,
    },
    /// Convex hull of points.
    Hull {
        /// At least four points, not in one plane \[m\].
        points: Vec<DVec3>,
    },
}

impl Shape {
    /// The point of the shape farthest along `direction`, in the body frame.
    pub fn support_point(&self, direction: DVec3) -> DVec3 {
        match self {
            Self::Box { half } => half.copysign(direction),
            Self::Cylinder { radius, half_height } => {
                let flat = direction.truncate().normalize_or_zero() * *radius;
                flat.extend(half_height.copysign(direction.z))
            }
            Self::Hull { points } => points
                .iter()
                .copied()
                .max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)))
                .unwrap_or(DVec3::ZERO),
        }
    }
}

impl Body {
    /// The point of the body farthest along `direction`, both in the grip frame.
    pub fn support_point(&self, direction: DVec3) -> DVec3 {
        let direction = self.grip_from_body.rotation.transpose() * direction;
        self.grip_from_body.point(self.shape.support_point(direction))
    }

    /// Smallest and largest coordinates in the grip frame \[m\].
    pub fn bounds(&self) -> [DVec3; 2] {
        let reach = |sign: f64| {
            DVec3::from_array(DVec3::AXES.map(|axis| self.support_point(axis * sign).dot(axis)))
        };
        [reach(-1.0), reach(1.0)]
    }

    /// The body under a rigid map of the grip frame.
    #[must_use]
    pub fn moved(&self, map: &Frame) -> Self {
        Self {
            name: self.name.clone(),
            shape: self.shape.clone(),
            grip_from_body: map.compose(&self.grip_from_body),
        }
    }
}

/// Which jaws of a gripper move; another one is fixed to the palm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum Moving {
    /// Both, by the same way.
    #[default]
    #[serde(rename = "both")]
    Both,
    /// The one at `x3 > 0` alone.
    I,
    /// The one at `x3 < 0` alone.
    II,
}

impl Moving {
    fn is_both(&self) -> bool {
        *self == Self::Both
    }
}

/// One of the two jaws of a gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Jaw {
    /// The one at `x3 > 0`.
    I,
    /// The one at `x3 < 0`.
    II,
}

impl Jaw {
    /// Both, I first.
    pub const BOTH: [Self; 2] = [Self::I, Self::II];

    /// `1` for the jaw at `x3 > 0`, `-1` for the other.
    pub fn side(self) -> f64 {
        match self {
            Self::I => 1.0,
            Self::II => -1.0,
        }
    }

    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::I => Self::II,
            Self::II => Self::I,
        }
    }

    /// `I` or `II`.
    pub fn name(self) -> &'static str {
        match self {
            Self::I => "I",
            Self::II => "II",
        }
    }

    /// The jaw's frame in the grip frame with its pad face `offset` \[m\] from the middle plane.
    pub fn at(self, offset: f64) -> Frame {
        let rotation = match self {
            Self::I => DMat3::IDENTITY,
            Self::II => half_turn(),
        };
        Frame { rotation, origin: DVec3::Z * self.side() * offset }
    }
}

/// Which way round a gripper is put at a pose whose closing axis leaves both open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Jaws {
    /// Jaw I on the positive side of the closing axis.
    #[default]
    Straight,
    /// Jaws exchanged: half a turn about the approach axis.
    Exchanged,
}

impl Jaws {
    /// Both ways.
    pub const BOTH: [Self; 2] = [Self::Straight, Self::Exchanged];

    /// The sides of a site that face I and II of the pose lie on.
    pub(crate) fn sides(self) -> [usize; 2] {
        match self {
            Self::Straight => [0, 1],
            Self::Exchanged => [1, 0],
        }
    }

    /// The turn of the gripper within the pose.
    pub fn turn(self) -> DMat3 {
        match self {
            Self::Straight => DMat3::IDENTITY,
            Self::Exchanged => half_turn(),
        }
    }
}

impl Gripper {
    /// The bodies of a jaw's finger as `fingers` describes them: those of jaw II before their half
    /// turn.
    pub fn bodies(&self, jaw: Jaw) -> &[Body] {
        match (jaw, &self.fingers_ii) {
            (Jaw::II, Some(bodies)) => bodies,
            _ => &self.fingers,
        }
    }

    /// The bodies of a finger, with the pads `gap` apart \[m\].
    pub fn finger(&self, jaw: Jaw, gap: f64) -> Vec<Body> {
        let map = self.jaw_at(jaw, gap, 0.0);
        self.bodies(jaw).iter().map(|body| body.moved(&map)).collect()
    }

    /// Outlines of the pads of jaw I and II in the `(x1, x2)` of a grip with the pads `gap` apart
    /// \[m\]. A jaw that runs along an arc alone shifts its pad against the other one.
    pub fn pads(&self, gap: f64) -> [Ring; 2] {
        Jaw::BOTH.map(|jaw| {
            let shift = self.jaw_at(jaw, gap, 0.0).origin.x;
            let pad = match (jaw, &self.pad_ii) {
                (Jaw::II, Some(pad)) => pad,
                _ => &self.pad,
            };
            if shift == 0.0 {
                pad.clone()
            } else {
                pad.iter().map(|&point| point + DVec2::X * shift).collect()
            }
        })
    }

    /// Sizes of the pads of jaw I and II along `x1` and `x2` \[m\].
    pub fn pad_sizes(&self) -> [DVec2; 2] {
        [&self.pad, self.pad_ii.as_ref().unwrap_or(&self.pad)]
            .map(|pad| crate::geometry::Bounds2::of(pad).size())
    }

    /// How far the pads reach from the grip axis at most \[m\].
    pub fn pad_reach(&self) -> f64 {
        let pads = self.stroke.map(|gap| self.pads(gap));
        pads.iter().flatten().flatten().map(|point| point.length()).fold(0.0, f64::max)
    }

    /// Whether a jaw moves against the palm.
    pub fn moves(&self, jaw: Jaw) -> bool {
        matches!(
            (self.moving, jaw),
            (Moving::Both, _) | (Moving::I, Jaw::I) | (Moving::II, Jaw::II)
        )
    }

    /// The way of a jaw \[m\] where the pads go apart by twice `opening`: a jaw that moves alone
    /// goes all of it.
    pub fn way(&self, jaw: Jaw, opening: f64) -> f64 {
        match (self.moving, self.moves(jaw)) {
            (Moving::Both, _) => opening,
            (_, true) => 2.0 * opening,
            (_, false) => 0.0,
        }
    }

    /// Distance of the pads when a moving jaw has `out` to go to a grip with the pads `gap` apart.
    fn gap_before(&self, gap: f64, out: f64) -> f64 {
        if self.moving.is_both() { 2.0 * (gap / 2.0 + out) } else { gap + out }
    }

    /// Advance of a jaw's pad with the pads `gap` apart \[m\].
    fn advance(&self, jaw: Jaw, gap: f64) -> f64 {
        if self.moves(jaw) { self.travel.advance(gap) } else { 0.0 }
    }

    /// Where the middle between the pads lies along the approach with the pads `gap` apart \[m\].
    fn middle(&self, gap: f64) -> f64 {
        f64::midpoint(self.advance(Jaw::I, gap), self.advance(Jaw::II, gap))
    }

    /// Where the palm, and what is fixed to it, stands in the grip frame with the pads `gap` apart
    /// \[m\], seen from where the gripper file places it.
    pub fn palm_place(&self, gap: f64) -> Frame {
        let aside = match self.moving {
            Moving::Both => 0.0,
            Moving::I => -gap / 2.0,
            Moving::II => gap / 2.0,
        };
        let origin = DVec3::new(-self.middle(gap), 0.0, aside);
        Frame { rotation: DMat3::IDENTITY, origin }
    }

    /// The bodies of the palm in the grip frame with the pads `gap` apart \[m\].
    pub fn palm_at(&self, gap: f64) -> Vec<Body> {
        let place = self.palm_place(gap);
        self.palm.iter().map(|body| body.moved(&place)).collect()
    }

    /// A jaw's frame in the frame of a grip with the pads `gap` apart \[m\], its own pad standing
    /// `out` \[m\] further out than in the grip (before it has closed, say).
    pub fn jaw_at(&self, jaw: Jaw, gap: f64, out: f64) -> Frame {
        let mut place = jaw.at(gap / 2.0 + out);
        place.origin.x = self.advance(jaw, self.gap_before(gap, out)) - self.middle(gap);
        place
    }

    /// Share of the pad that touches, on the face where it is less.
    pub fn pad_share(&self, contact: &Contact) -> f64 {
        let other = self.pad_ii.as_ref().unwrap_or(&self.pad);
        let one = patch_area(&contact.face_i) / ring_area(&self.pad);
        one.min(patch_area(&contact.face_ii) / ring_area(other))
    }

    /// How far a jaw leaves the straight way between two places `out` of a grip with the pads `gap`
    /// apart, along the approach, at most \[m\].
    pub fn bulge(&self, jaw: Jaw, gap: f64, [from, to]: [f64; 2]) -> f64 {
        if self.moves(jaw) {
            self.travel.bulge(self.gap_before(gap, from), self.gap_before(gap, to))
        } else {
            0.0
        }
    }

    /// Distance of the pads in a grip \[m\]: the faces' own, or less by the fingers where these
    /// spread into a slot.
    pub fn jaw_gap(&self, grip: &Grip) -> f64 {
        self.gap_on(grip.width, grip.inside)
    }

    /// [`Gripper::jaw_gap`] on faces `width` apart \[m\].
    pub(crate) fn gap_on(&self, width: f64, inside: bool) -> f64 {
        if inside { width - 2.0 * self.outer_pad.unwrap_or(0.0) } else { width }
    }

    /// Distance of the pads before they close on a grip \[m\], each jaw having `opening` to go or as
    /// much as the stroke leaves.
    pub fn opened_gap(&self, grip: &Grip, opening: f64) -> f64 {
        self.opened(self.jaw_gap(grip), grip.inside, opening)
    }

    /// [`Gripper::opened_gap`] of a grip with the pads `gap` apart \[m\].
    pub fn opened(&self, gap: f64, inside: bool, opening: f64) -> f64 {
        let [least, most] = self.stroke;
        if inside {
            (gap - 2.0 * opening).max(least).min(gap)
        } else {
            (gap + 2.0 * opening).min(most).max(gap)
        }
    }

    /// Whether exchanging the jaws (half a turn about the approach axis) changes nothing but the
    /// names: the jaws are alike and both move, the pad is mirror-symmetric in `x2`, and the half
    /// turn maps the set of palm bodies to itself.
    pub fn is_symmetric(&self) -> bool {
        if !self.moving.is_both() || !self.has_like_pads() || self.fingers_ii.is_some() {
            return false;
        }
        let close = 1e-9;
        let turn = Frame { rotation: half_turn(), origin: DVec3::ZERO };
        let has_twin = |body: &Body| {
            let [min, max] = body.moved(&turn).bounds();
            self.palm.iter().any(|other| {
                let [other_min, other_max] = other.bounds();
                std::mem::discriminant(&other.shape) == std::mem::discriminant(&body.shape)
                    && min.abs_diff_eq(other_min, close)
                    && max.abs_diff_eq(other_max, close)
                    && !matches!(other.shape, Shape::Hull { .. })
            })
        };
        self.palm.iter().all(has_twin)
    }

    /// Whether exchanging the jaws leaves what the pads touch as it is: they are alike and
    /// mirror-symmetric in `x2`.
    pub fn has_like_pads(&self) -> bool {
        let mirrored = |point: &DVec2| {
            self.pad.iter().any(|other| other.distance(DVec2::new(point.x, -point.y)) < 1e-9)
        };
        self.pad_ii.is_none() && self.pad.iter().all(mirrored)
    }
}

/// Half a turn about the approach axis: exchanges the jaws.
pub fn half_turn() -> DMat3 {
    DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))
}

/// A rectangle of the given sizes along `(x1, x2)`, centred.
pub fn rectangle(size: DVec2) -> Ring {
    let half = size / 2.0;
    vec![
        DVec2::new(-half.x, -half.y),
        DVec2::new(half.x, -half.y),
        half,
        DVec2::new(-half.x, half.y),
    ]
}

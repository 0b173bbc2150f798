//! The gripper file: stroke, force, pads, finger and palm bodies, frames; and the shipped
//! catalogue.

pub mod catalogue;
pub mod check;
pub mod drawing;
pub mod file;
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
    /// Pad outline in `(x1, x2)`, counter-clockwise, convex \[m\]; the same on both jaws.
    pub pad: Ring,
    /// Friction coefficient of the pad material, where stated.
    pub pad_friction: Option<f64>,
    /// Rubber thickness \[m\], where stated.
    pub pad_thickness: Option<f64>,
    /// Young's modulus of the rubber \[Pa\], where stated.
    #[serde(default)]
    pub pad_modulus: Option<f64>,
    /// Distance from the pad face to the finger's outer gripping face \[m\], where the gripper can
    /// grip from inside, opening into a slot; that face has the pad's outline.
    #[serde(default)]
    pub outer_pad: Option<f64>,
    /// Bodies that move with the finger at `x3 > 0`, placed for pads touching at zero width: the
    /// pad face lies at `x3 = 0` and the body at `x3 >= 0`. The other finger's bodies are these
    /// turned by 180 degrees about `x1`.
    pub fingers: Vec<Body>,
    /// How the pads move along the approach while the jaws move.
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

/// One of the two jaws of a gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
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

    /// The turn of the gripper within the pose.
    pub fn turn(self) -> DMat3 {
        match self {
            Self::Straight => DMat3::IDENTITY,
            Self::Exchanged => half_turn(),
        }
    }
}

impl Gripper {
    /// The bodies of a finger, with the pads `width` apart \[m\].
    pub fn finger(&self, jaw: Jaw, width: f64) -> Vec<Body> {
        let map = jaw.at(width / 2.0);
        self.fingers.iter().map(|body| body.moved(&map)).collect()
    }

    /// Where the palm, and what is fixed to it, stands in the grip frame with the pads `gap` apart
    /// \[m\], seen from where the gripper file places it.
    pub fn palm_place(&self, gap: f64) -> Frame {
        Frame { rotation: DMat3::IDENTITY, origin: DVec3::NEG_X * self.travel.advance(gap) }
    }

    /// The bodies of the palm in the grip frame with the pads `gap` apart \[m\].
    pub fn palm_at(&self, gap: f64) -> Vec<Body> {
        let place = self.palm_place(gap);
        self.palm.iter().map(|body| body.moved(&place)).collect()
    }

    /// A jaw's frame in the frame of a grip with the pads `gap` apart \[m\], with its own pad at
    /// `offset` from the middle plane \[m\]: before it has closed, say.
    pub fn jaw_at(&self, jaw: Jaw, gap: f64, offset: f64) -> Frame {
        let mut place = jaw.at(offset);
        place.origin.x = self.travel.advance(2.0 * offset) - self.travel.advance(gap);
        place
    }

    /// Share of the pad that touches, on the face where it is less.
    pub fn pad_share(&self, contact: &Contact) -> f64 {
        let area = patch_area(&contact.face_i).min(patch_area(&contact.face_ii));
        area / ring_area(&self.pad)
    }

    /// Distance of the pads in a grip \[m\]: the faces' own, or less by the fingers where these
    /// spread into a slot.
    pub fn jaw_gap(&self, grip: &Grip) -> f64 {
        if grip.inside { grip.width - 2.0 * self.outer_pad.unwrap_or(0.0) } else { grip.width }
    }

    /// Distance of the pads before they close on a grip \[m\], each jaw having `opening` to go or as
    /// much as the stroke leaves.
    pub fn opened_gap(&self, grip: &Grip, opening: f64) -> f64 {
        let (gap, [least, most]) = (self.jaw_gap(grip), self.stroke);
        if grip.inside {
            (gap - 2.0 * opening).max(least).min(gap)
        } else {
            (gap + 2.0 * opening).min(most).max(gap)
        }
    }

    /// Whether exchanging the jaws (half a turn about the approach axis) changes nothing but the
    /// names: the pad is mirror-symmetric in `x2`, and the half turn maps the set of palm bodies to
    /// itself.
    pub fn is_symmetric(&self) -> bool {
        let close = 1e-9;
        let mirrored = |point: &DVec2| {
            self.pad.iter().any(|other| other.distance(DVec2::new(point.x, -point.y)) < close)
        };
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
        self.pad.iter().all(mirrored) && self.palm.iter().all(has_twin)
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

//! The gripper file: stroke, force, pads, finger and palm bodies, frames; and the shipped catalogue.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::model::{Frame, Ring};

/// A two-finger gripper in SI units, in the grip frame (x1 approach, x3 closing; origin midway between the pads).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gripper {
    /// Display name.
    pub name: String,
    /// Smallest and largest distance of the pads [m].
    pub stroke: [f64; 2],
    /// Smallest and largest gripping force [N].
    pub force: [f64; 2],
    /// Pad outline in `(x1, x2)`, counter-clockwise, convex [m]; the same on both jaws.
    pub pad: Ring,
    /// Friction coefficient of the pad material, where stated.
    pub pad_friction: Option<f64>,
    /// Rubber thickness [m], where stated.
    pub pad_thickness: Option<f64>,
    /// Bodies that move with the finger at `x3 > 0`, placed for pads touching at zero width: the pad face lies at
    /// `x3 = 0` and the body at `x3 >= 0`. The other finger's bodies are these turned by 180 degrees about `x1`.
    pub fingers: Vec<Body>,
    /// Bodies fixed to the palm.
    pub palm: Vec<Body>,
    /// Flange frame (robot mounting) in the grip frame, where stated.
    pub grip_from_flange: Option<Frame>,
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

/// Shapes of gripper bodies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Shape {
    /// Box with these half sizes [m].
    Box {
        /// Half sizes along the body axes [m].
        half: DVec3,
    },
    /// Cylinder about the body's z axis.
    Cylinder {
        /// Radius [m].
        radius: f64,
        /// Half height [m].
        half_height: f64,
    },
}

/// A rectangle of the given sizes along `(x1, x2)`, centred.
pub fn rectangle(size: DVec2) -> Ring {
    let half = size / 2.0;
    vec![DVec2::new(-half.x, -half.y), DVec2::new(half.x, -half.y), half, DVec2::new(-half.x, half.y)]
}

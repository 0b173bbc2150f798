//! What surrounds the part: the ground it stands on and boxes to stay out of.

use glam::DVec3;

use super::options::{Cone, Ground, ProposeOptions};
use crate::clash::Sweep;
use crate::model::Frame;

/// The surroundings, with unit vectors.
#[derive(Debug, Clone)]
pub(super) struct Environment {
    cone: Option<Cone>,
    ground: Option<Ground>,
    keep_out: Vec<[DVec3; 2]>,
}

impl Environment {
    pub(super) fn new(options: &ProposeOptions) -> Self {
        Self {
            cone: options.approach_cone.map(|cone| Cone { axis: cone.axis.normalize(), ..cone }),
            ground: options
                .ground
                .map(|ground| Ground { normal: ground.normal.normalize(), ..ground }),
            keep_out: options.keep_out.clone(),
        }
    }

    /// Whether nothing depends on the position.
    pub(super) fn is_empty(&self) -> bool {
        self.ground.is_none() && self.keep_out.is_empty()
    }

    /// Whether the approach direction (part frame) is allowed.
    pub(super) fn allows(&self, approach: DVec3) -> bool {
        self.cone.is_none_or(|cone| cone.axis.angle_between(approach) <= cone.half_angle + 1e-9)
    }

    /// Lowest height of each sweep over the ground, for a grip origin at height zero.
    pub(super) fn depths(&self, sweeps: &[Sweep], part_from_grip: &Frame) -> Vec<f64> {
        let Some(ground) = self.ground else { return Vec::new() };
        let down = part_from_grip.rotation.transpose() * -ground.normal;
        sweeps.iter().map(|sweep| -sweep.support_point(down).dot(down)).collect()
    }

    /// The first sweep below the ground, for a grip origin at `origin`.
    pub(super) fn grounded(&self, depths: &[f64], origin: DVec3) -> Option<usize> {
        let ground = self.ground?;
        let height = ground.normal.dot(origin) - ground.offset;
        depths.iter().position(|depth| height + depth < 0.0)
    }

    /// The first sweep in a keep-out box, and the box's number.
    pub(super) fn kept_out(
        &self,
        sweeps: &[Sweep],
        part_from_grip: &Frame,
    ) -> Option<(usize, usize)> {
        self.keep_out.iter().enumerate().find_map(|(number, [low, high])| {
            sweeps
                .iter()
                .position(|sweep| sweep.meets_box(part_from_grip, *low, *high))
                .map(|sweep| (sweep, number))
        })
    }
}

//! Which distances of two surfaces the jaws reach.

use super::options::{ProposeOptions, Rejection};
use crate::gripper::Gripper;
use crate::part::PairKind;

/// Rounding of a width against the stroke \[m\].
const ROUNDING: f64 = 1e-9;

/// The widths between the pads, or between the outer pads, \[m\].
pub(super) struct Stroke {
    reach: [f64; 2],
    /// Those that leave the least opening.
    opened: [f64; 2],
}

impl Stroke {
    /// From outside or from inside.
    pub(super) fn new(kind: PairKind, gripper: &Gripper, options: &ProposeOptions) -> Self {
        let open = 2.0 * options.min_opening;
        match kind {
            PairKind::External => {
                let [least, most] = gripper.stroke;
                Self { reach: gripper.stroke, opened: [least, most - open] }
            }
            PairKind::Internal => {
                let outer = 2.0 * gripper.outer_pad.unwrap_or(0.0);
                let [least, most] = gripper.stroke.map(|gap| gap + outer);
                Self { reach: [least, most], opened: [least + open, most] }
            }
        }
    }

    /// Whether the jaws reach a width and can open beyond it.
    ///
    /// # Errors
    /// Why not.
    pub(super) fn check(&self, width: f64) -> Result<(), Rejection> {
        let within =
            |[least, most]: [f64; 2]| (least - ROUNDING..=most + ROUNDING).contains(&width);
        if !within(self.reach) {
            Err(Rejection::Stroke)
        } else if !within(self.opened) {
            Err(Rejection::OpeningTooSmall)
        } else {
            Ok(())
        }
    }

    /// How far a width lies beyond the stroke \[m\]; negative within.
    pub(super) fn beyond(&self, width: f64) -> f64 {
        (self.reach[0] - width).max(width - self.reach[1])
    }
}

//! What a gripper may carry whatever the friction of its pads: payload, and moments at the pads; and
//! the pressure that a part may be held with.

use crate::gripper::Gripper;
use crate::mechanics::squeeze_pressure;
use crate::model::{Grip, LoadCase, Wrench};
use crate::units::STANDARD_GRAVITY;

/// Loads may exceed a limit by this share: rounding.
const ROUNDING: f64 = 1e-9;

/// Limits of a gripper's load, where it states them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Largest force of a load \[N\]: the weight of the payload.
    pub force: Option<f64>,
    /// Largest moment of a load about the grip axes, at the pads [N m].
    pub moment: Option<[f64; 3]>,
    /// Greatest pressure of the squeeze alone that does not mark the part \[Pa\].
    pub pressure: Option<f64>,
}

impl From<&Gripper> for Limits {
    fn from(gripper: &Gripper) -> Self {
        Self {
            force: gripper.payload.map(|payload| payload * STANDARD_GRAVITY),
            moment: gripper.moment,
            pressure: None,
        }
    }
}

impl Limits {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The limit that one of these loads (in the grip frame, about its origin) exceeds, named with
    /// its number as rejections are: `over_payload:5_kg`, `over_moment:x2_3_Nm`.
    pub fn exceeded(&self, wrenches: &[Wrench]) -> Option<String> {
        let over = |value: f64, limit: f64| value > limit * (1.0 + ROUNDING);
        if let Some(force) = self.force
            && wrenches.iter().any(|wrench| over(wrench.force.length(), force))
        {
            return Some(format!("over_payload:{}_kg", short(force / STANDARD_GRAVITY)));
        }
        let moment = self.moment?;
        let axis = (0..3).find(|&axis| {
            wrenches.iter().any(|wrench| over(wrench.moment[axis].abs(), moment[axis]))
        })?;
        Some(format!("over_moment:x{}_{}_Nm", axis + 1, short(moment[axis])))
    }

    /// Whether a grip squeezed with `force` \[N\] presses harder than the part bears, named with the
    /// limit: `over_pressure:2_MPa`.
    pub fn marks(&self, grip: &Grip, force: f64) -> Option<String> {
        let limit = self.pressure?;
        let pressed = squeeze_pressure(grip, force)?;
        (pressed > limit * (1.0 + ROUNDING))
            .then(|| format!("over_pressure:{}_MPa", short(limit / 1e6)))
    }

    /// A warning where a load is over the payload, in any grip.
    pub fn doubt(&self, loads: &[LoadCase], gripper: &Gripper) -> Option<String> {
        let limit = self.force?;
        let size = |load: &LoadCase| load.wrench.force.length();
        let worst = loads.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
        (size(worst) > limit * (1.0 + ROUNDING)).then(|| {
            format!(
                "the load '{}' of {:.1} N is over the payload of {}, {} kg ({:.1} N): no grip is \
                 left",
                worst.name,
                size(worst),
                gripper.name,
                short(limit / STANDARD_GRAVITY),
                limit
            )
        })
    }
}

/// A number to six digits.
fn short(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_load_over_a_limit_is_named_with_the_number() {
        let limits = Limits {
            force: Some(5.0 * STANDARD_GRAVITY),
            moment: Some([5.0, 4.0, 3.0]),
            pressure: None,
        };
        let wrench = |force: f64, moment: [f64; 3]| Wrench {
            force: DVec3::new(0.0, -force, 0.0),
            moment: DVec3::from_array(moment),
        };
        let told = |wrench: Wrench| limits.exceeded(&[Wrench::default(), wrench]);
        assert_eq!(told(wrench(49.0, [5.0, -4.0, 3.0])), None);
        assert_eq!(told(wrench(5.0 * STANDARD_GRAVITY, [0.0; 3])), None, "just the payload");
        assert_eq!(told(wrench(49.1, [0.0; 3])).unwrap(), "over_payload:5_kg");
        assert_eq!(told(wrench(1.0, [0.0, -4.1, 3.1])).unwrap(), "over_moment:x2_4_Nm");
        assert_eq!(Limits::default().exceeded(&[wrench(1e9, [1e9; 3])]), None);
    }
}

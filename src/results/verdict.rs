//! Whether the pads hold a grip: the one place that decides it, for tables, pages, exports and the
//! choice in a scene.

use serde::{Deserialize, Serialize};

/// Friction needed and friction there may differ by this share and count as equal: answers agree
/// to it across backends, and a verdict shall not depend on which of them ran.
const ROUNDING: f64 = 1e-9;

/// What the pads give, and what is asked of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PadFriction {
    /// Friction coefficient of the pads; `None` where nobody states one.
    pub value: Option<f64>,
    /// Factor by which it must exceed the friction needed.
    pub safety: f64,
}

impl Default for PadFriction {
    /// Not stated; a safety of 1.
    fn default() -> Self {
        Self { value: None, safety: 1.0 }
    }
}

/// Whether a grip holds its worst load. The margin is the pads' friction over that needed, `mu_s`
/// times the safety asked for; infinite where none is needed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// The pads have the friction.
    Holds {
        /// At least 1, but for rounding.
        margin: f64,
    },
    /// They have not, or there is no friction that would do (margin 0).
    Slips {
        /// Below 1.
        margin: f64,
    },
    /// The friction of the pads is not known.
    Unknown,
}

impl Verdict {
    /// `holds`, `slips` or `unknown`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds { .. } => "holds",
            Self::Slips { .. } => "slips",
            Self::Unknown => "unknown",
        }
    }

    /// Whether it holds; `None` where that is not known.
    pub fn holds(self) -> Option<bool> {
        match self {
            Self::Holds { .. } => Some(true),
            Self::Slips { .. } => Some(false),
            Self::Unknown => None,
        }
    }
}

impl PadFriction {
    /// Whether a grip whose worst load needs the friction `mu_s` holds; `None`: no friction holds
    /// that load.
    pub fn verdict(self, mu_s: Option<f64>) -> Verdict {
        let Some(mu_s) = mu_s else { return Verdict::Slips { margin: 0.0 } };
        let Some(friction) = self.value else { return Verdict::Unknown };
        let needed = mu_s * self.safety;
        let margin = if needed == 0.0 { f64::INFINITY } else { friction / needed };
        if needed <= friction * (1.0 + ROUNDING) {
            Verdict::Holds { margin }
        } else {
            Verdict::Slips { margin }
        }
    }

    /// A quality in 0..1 that rises with the margin `m`, `m/(1 + m)`: 1/2 where the grip just holds,
    /// less where it slips, 0 where no friction holds. Pads whose friction is not known are taken
    /// for ones with a friction of 1.
    pub fn quality(self, mu_s: Option<f64>) -> f64 {
        let known = Self { value: self.value.or(Some(1.0)), ..self };
        match known.verdict(mu_s) {
            Verdict::Holds { margin } => 1.0 / (1.0 + 1.0 / margin),
            // Rounding above may have gone the other way.
            Verdict::Slips { margin } => (margin / (1.0 + margin)).min(0.5),
            Verdict::Unknown => 0.0,
        }
    }

    /// The friction that may be used: that of the pads over the safety.
    pub fn usable(self) -> Option<f64> {
        self.value.map(|friction| friction / self.safety)
    }
}

/// Where a gripping force lies between the least and the largest that a gripper has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ForceRange {
    /// Less than its least: it presses harder than needed.
    Below,
    /// Within what it has.
    Within,
    /// More than it has.
    Above,
}

impl ForceRange {
    /// Where `force` lies between `least` and `most` \[N\].
    pub fn of(force: f64, [least, most]: [f64; 2]) -> Self {
        if force > most * (1.0 + ROUNDING) {
            Self::Above
        } else if force < least * (1.0 - ROUNDING) {
            Self::Below
        } else {
            Self::Within
        }
    }

    /// `below`, `within` or `above`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Below => "below",
            Self::Within => "within",
            Self::Above => "above",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grip_holds_where_the_friction_needed_times_the_safety_is_there() {
        let pads = |value, safety| PadFriction { value, safety };
        let holds = |value, safety, mu_s| pads(value, safety).verdict(mu_s).holds();
        assert_eq!(holds(Some(0.2), 1.0, Some(0.2)), Some(true));
        assert_eq!(holds(Some(0.2), 1.0, Some(0.2 * (1.0 + 1e-12))), Some(true), "rounding");
        assert_eq!(holds(Some(0.2), 1.0, Some(0.2001)), Some(false));
        assert_eq!(holds(Some(0.2), 2.0, Some(0.1)), Some(true));
        assert_eq!(holds(Some(0.2), 2.0, Some(0.11)), Some(false));
        assert_eq!(holds(Some(0.0), 1.0, Some(0.0)), Some(true), "nothing is needed");
        assert_eq!(holds(Some(9.0), 1.0, None), Some(false), "no friction holds");
        assert_eq!(holds(None, 1.0, Some(0.1)), None);
        assert_eq!(holds(None, 1.0, None), Some(false));
        let Verdict::Slips { margin } = pads(Some(0.2), 2.0).verdict(Some(0.4)) else { panic!() };
        assert!((margin - 0.25).abs() < 1e-15);
    }

    #[test]
    fn quality_rises_with_the_margin_and_is_at_most_a_half_for_one_that_slips() {
        let pads = PadFriction { value: Some(0.3), safety: 1.5 };
        assert_eq!(pads.quality(Some(0.0)), 1.0);
        assert!((pads.quality(Some(0.2)) - 0.5).abs() < 1e-15);
        assert_eq!(pads.quality(None), 0.0);
        let mut before = 1.0;
        for step in 1..400 {
            let mu_s = 0.001 * f64::from(step);
            let quality = pads.quality(Some(mu_s));
            assert!(quality < before);
            assert!(pads.verdict(Some(mu_s)).holds() == Some(true) || quality <= 0.5, "{mu_s}");
            before = quality;
        }
        let unknown = PadFriction::default();
        assert!((unknown.quality(Some(0.25)) - 0.8).abs() < 1e-15);
        assert_eq!(PadFriction { value: Some(0.0), safety: 1.0 }.quality(Some(0.1)), 0.0);
    }

    #[test]
    fn a_force_lies_within_the_grippers_range_or_not() {
        let range = |force| ForceRange::of(force, [20.0, 140.0]);
        assert_eq!(range(357.0), ForceRange::Above);
        assert_eq!(range(19.9), ForceRange::Below);
        assert!([20.0, 80.0, 140.0].into_iter().all(|force| range(force) == ForceRange::Within));
    }
}

//! How the pads move along the approach while the jaws move: parallel jaws do not, pads on cranks
//! run along an arc, and any other linkage is given as a table.

use serde::{Deserialize, Serialize};

/// The way of the pads as a function of their distance.
///
/// The advance is the pads' way along the approach axis away from the palm, counted from where they
/// stand when they touch: there the gripper's bodies and frames are described.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
#[non_exhaustive]
pub enum Travel {
    /// None along the approach.
    #[default]
    Parallel,
    /// Each pad is carried by a crank and stays parallel to the other.
    Arc {
        /// Length of the crank \[m\].
        crank: f64,
        /// Angle of the crank from the approach axis when the pads touch, outwards positive \[rad\].
        angle: f64,
        /// The robot model's joint at the smallest and the largest distance of the pads \[rad\],
        /// where stated; it turns as the crank does.
        joint: Option<[f64; 2]>,
        /// Of one jaw alone: it goes all of the pads' distance, not half of it.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        alone: bool,
    },
    /// Measured or computed, by rising distance of the pads; straight lines between.
    Table {
        /// At least two.
        rows: Vec<TravelRow>,
    },
}

/// A row of a [`Travel::Table`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TravelRow {
    /// Distance of the pads \[m\].
    pub width: f64,
    /// Advance of the pads \[m\].
    pub advance: f64,
    /// The robot model's joint [rad or m], where stated.
    pub joint: Option<f64>,
}

impl Travel {
    /// Advance of the pads when they are `width` apart \[m\].
    pub fn advance(&self, width: f64) -> f64 {
        match self {
            Self::Parallel => 0.0,
            Self::Arc { crank, angle, .. } => crank * (self.turned(width).cos() - angle.cos()),
            Self::Table { rows } => {
                interpolated(rows, width, |row| Some(row.advance)).unwrap_or(0.0)
            }
        }
    }

    /// The robot model's joint when the pads are `width` apart [rad or m], of a gripper with this
    /// stroke; `None` where the file does not say.
    pub fn joint(&self, width: f64, stroke: [f64; 2]) -> Option<f64> {
        match self {
            Self::Parallel => None,
            Self::Arc { joint, .. } => {
                let [least, most] = stroke.map(|width| self.turned(width));
                let share = (self.turned(width) - least) / (most - least);
                joint.map(|[closed, opened]| closed + share * (opened - closed))
            }
            Self::Table { rows } => interpolated(rows, width, |row| row.joint),
        }
    }

    /// How far the pads leave the straight line between two of their positions along the approach,
    /// at most \[m\].
    pub fn bulge(&self, from: f64, to: f64) -> f64 {
        let (start, end) = (self.advance(from), self.advance(to));
        match self {
            Self::Parallel => 0.0,
            // An arc leaves its chord most where it runs parallel to it, at mid angle.
            Self::Arc { crank, .. } => {
                let [a, b] = [from, to].map(|width| self.turned(width));
                let chord = crank * (a - b).abs();
                // The sagitta is across the chord; along the approach it is longer by the slope.
                let sagitta = crank * (1.0 - ((a - b) / 2.0).cos());
                let slope = f64::midpoint(a, b).cos().abs().max(1e-3);
                (sagitta / slope).min(chord)
            }
            Self::Table { rows } => {
                let (low, high) = (from.min(to), from.max(to));
                let between = rows.iter().filter(|row| row.width > low && row.width < high);
                between
                    .map(|row| {
                        let line = start + (end - start) * (row.width - from) / (to - from);
                        (row.advance - line).abs()
                    })
                    .fold(0.0, f64::max)
            }
        }
    }

    /// Angle of the crank when the pads are `width` apart; zero without one.
    fn turned(&self, width: f64) -> f64 {
        match self {
            Self::Arc { crank, angle, alone, .. } => {
                let way = if *alone { width } else { width / 2.0 };
                (angle.sin() + way / crank).clamp(-1.0, 1.0).asin()
            }
            _ => 0.0,
        }
    }
}

/// On the straight line between two rows, at the ends that of the outermost two.
fn interpolated(
    rows: &[TravelRow],
    width: f64,
    value: impl Fn(&TravelRow) -> Option<f64>,
) -> Option<f64> {
    let next = rows.partition_point(|row| row.width < width).clamp(1, rows.len().max(2) - 1);
    let [a, b] = [rows.get(next - 1)?, rows.get(next)?];
    let share = (width - a.width) / (b.width - a.width);
    Some(value(a)? + share * (value(b)? - value(a)?))
}

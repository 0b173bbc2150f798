//! What a grip is worth when the gripper does not stand exactly where it was sent.
//!
//! Each grip is displaced in its pad plane by a fixed set of shifts and turns, its pads are clipped
//! anew with the faces, and all loads are solved again. The displacements fill the box `+-shift,
//! +-shift, +-turn` evenly: an additive recurrence with the root of `x^4 = x + 1` (Roberts 2018),
//! the same points for every grip and every run.

use glam::DVec2;
use rayon::prelude::*;

use super::Assessor;
use crate::error::Result;
use crate::model::Grip;
use crate::propose::{Displacement, Proposer};
use crate::results::{PoseNoise, RankedGrip};

/// How far the pose may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Largest shift along each of the pad plane's axes, either way \[m\].
    pub shift: f64,
    /// Largest turn about the closing axis, either way \[rad\].
    pub turn: f64,
    /// Displaced poses per grip, at least one.
    pub samples: u32,
}

/// The real root of `x^4 = x + 1` above one.
const ROOT: f64 = 1.220_744_084_605_759_5;

impl Noise {
    /// The displacements tried, the same for every grip.
    pub fn displacements(&self) -> Vec<Displacement> {
        let step = [1.0 / ROOT, 1.0 / (ROOT * ROOT), 1.0 / (ROOT * ROOT * ROOT)];
        let point =
            |index: u32| step.map(|step| 2.0 * (0.5 + step * f64::from(index + 1)).fract() - 1.0);
        let displacement = |[x, y, turn]: [f64; 3]| Displacement {
            shift: self.shift * DVec2::new(x, y),
            turn: self.turn * turn,
        };
        (0..self.samples).map(|index| displacement(point(index))).collect()
    }

    /// Fills in [`RankedGrip::pose_noise`] of `grips`, which come from the same part and gripper as
    /// `proposer`. The answer does not depend on the number of threads.
    ///
    /// # Errors
    /// As [`Proposer::displaced`] and [`Assessor::assess`].
    pub fn assess(
        &self,
        proposer: &Proposer<'_>,
        assessor: &Assessor<'_>,
        grips: &mut [&mut RankedGrip],
    ) -> Result<()> {
        let by = self.displacements();
        let displaced: Vec<Vec<Grip>> = grips
            .par_iter()
            .map(|ranked| proposer.displaced(&ranked.grip, &by))
            .collect::<Result<_>>()?;
        let scored = assessor.assess(displaced.into_iter().flatten().collect())?;
        for (ranked, scored) in grips.iter_mut().zip(scored.chunks(by.len().max(1))) {
            ranked.pose_noise = Some(summary(scored));
        }
        Ok(())
    }
}

fn summary(scored: &[RankedGrip]) -> PoseNoise {
    let mut values: Vec<f64> = scored
        .iter()
        .map(|ranked| {
            ranked.worst.mu_s.filter(|_| ranked.worst.status.holds()).unwrap_or(f64::INFINITY)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    // The smallest value that 95 of 100 do not exceed; a lost pose exceeds all.
    let at = |share: f64| {
        values
            .get(((share * values.len() as f64).ceil() as usize).saturating_sub(1))
            .copied()
            .filter(|mu| mu.is_finite())
    };
    PoseNoise {
        samples: values.len() as u32,
        lost: values.iter().filter(|mu| mu.is_infinite()).count() as u32,
        mu_s_95: at(0.95),
        mu_s_worst: at(1.0),
    }
}

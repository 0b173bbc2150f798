//! The best grips so far, chunk after chunk.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::rank::{self, Ranking, Weights};
use crate::results::RankedGrip;

/// Among the rejections of a run: grips left unsolved because their bounds put them behind the best
/// ones kept.
pub const OUTRANKED: &str = "outranked";

/// Scores closer than this share may tie in the ranking ([`rank::TIE`], neighbour by neighbour).
const CLOSE: f64 = 1e-6;

/// Collects scored grips chunk by chunk, keeping the best.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Collector {
    kept: Vec<RankedGrip>,
    /// Number of kept grips at which the next cut is worth it.
    full: usize,
    ranked: u64,
    rejections: BTreeMap<String, u64>,
}

impl Collector {
    /// Takes a chunk; afterwards at most `2 keep` grips, those that tie with them, and the chunk
    /// are held.
    pub fn add(&mut self, grips: Vec<RankedGrip>, keep: usize, weights: Weights) {
        for mut grip in grips {
            match grip.worst.mu_s.filter(|_| grip.worst.status.holds()) {
                Some(mu) => {
                    let score = weights.score(mu, grip.alpha);
                    grip.score = score.is_finite().then_some(score);
                    self.ranked += 1;
                    self.kept.push(grip);
                }
                None => {
                    *self.rejections.entry(rank::status_name(grip.worst.status)).or_default() += 1
                }
            }
        }
        if self.kept.len() > keep.saturating_mul(2).max(self.full) {
            let value = |grip: &RankedGrip| grip.score.unwrap_or(f64::INFINITY);
            self.kept.sort_by(|a, b| value(b).total_cmp(&value(a)).then(a.grip.id.cmp(&b.grip.id)));
            // Those that tie with the last one stay: the ranking orders them by other things, and
            // all of them must be there.
            let last = self.kept.get(keep.max(1) - 1).map_or(f64::NEG_INFINITY, value);
            let least = if last.is_finite() { last - CLOSE * last.abs() } else { last };
            self.kept.truncate(self.kept.partition_point(|grip| value(grip) >= least));
            self.full = 2 * self.kept.len();
        }
    }

    /// Counts grips of a chunk that were left unsolved because they cannot be among the best.
    pub fn outrank(&mut self, grips: u64) {
        if grips > 0 {
            *self.rejections.entry(OUTRANKED.to_owned()).or_default() += grips;
        }
    }

    /// Scores of the best grips so far, infinite where no friction is needed.
    pub fn scores(&self) -> impl Iterator<Item = f64> {
        self.kept.iter().map(|grip| grip.score.unwrap_or(f64::INFINITY))
    }

    /// Grips ranked so far.
    pub fn ranked(&self) -> u64 {
        self.ranked
    }

    /// The final order with counts; `size` is the diagonal of the part's bounding box \[m\].
    pub fn finish(self, centre_of_mass: DVec3, size: f64, options: &rank::Options) -> Ranking {
        let mut ranking = rank::rank(self.kept, centre_of_mass, size, options);
        for (reason, count) in self.rejections {
            *ranking.rejections.entry(reason).or_default() += count;
        }
        ranking.ranked = self.ranked - ranking.rejections.get("duplicate").copied().unwrap_or(0);
        ranking
    }
}

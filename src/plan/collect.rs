//! The best grips so far, chunk after chunk.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::model::Negative;
use crate::propose::scatter;
use crate::rank::{self, Ranking, Weights};
use crate::results::{PadFriction, RankedGrip};

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
    /// Of these, those that do not slip.
    holding: u64,
    rejections: BTreeMap<String, u64>,
    /// Grips that do not hold kept for each reason, at most.
    #[serde(default)]
    sample: usize,
    /// A sample of these by reason, by their [`scatter`] numbers.
    #[serde(default)]
    lost: BTreeMap<String, Vec<Negative>>,
}

impl Collector {
    /// One that also keeps some grips that do not hold: `sample` for each reason at most, the same
    /// ones in whatever chunks they come.
    pub fn sampling(sample: usize) -> Self {
        Self { sample, ..Self::default() }
    }

    /// Takes a chunk; afterwards at most `2 keep` grips, those that tie with them, and the chunk
    /// are held. Grips that slip fall first.
    pub fn add(
        &mut self,
        grips: Vec<RankedGrip>,
        keep: usize,
        weights: Weights,
        pads: PadFriction,
    ) {
        for mut grip in grips {
            match grip.worst.mu_s.filter(|_| grip.worst.status.holds()) {
                Some(mu) => {
                    let score = weights.score(mu, grip.alpha);
                    grip.score = score.is_finite().then_some(score);
                    grip.holds = pads.verdict(Some(mu)).holds();
                    self.ranked += 1;
                    self.holding += u64::from(!rank::slips(&grip));
                    self.kept.push(grip);
                }
                None => {
                    let reason = rank::status_name(grip.worst.status);
                    *self.rejections.entry(reason.clone()).or_default() += 1;
                    self.lose(&grip, reason);
                }
            }
        }
        if self.kept.len() > keep.saturating_mul(2).max(self.full) {
            self.kept.sort_by(|a, b| merit(b).total_cmp(&merit(a)).then(a.grip.id.cmp(&b.grip.id)));
            // Those that tie with the last one stay: the ranking orders them by other things, and
            // all of them must be there.
            let last = self.kept.get(keep.max(1) - 1).map_or(f64::NEG_INFINITY, merit);
            let least = if last.is_finite() { last - CLOSE * last.abs() } else { last };
            self.kept.truncate(self.kept.partition_point(|grip| merit(grip) >= least));
            self.full = 2 * self.kept.len();
        }
    }

    /// Takes what another one has found among other candidates of the same run.
    pub fn gather(&mut self, other: Self) {
        self.kept.extend(other.kept);
        self.ranked += other.ranked;
        self.holding += other.holding;
        other.rejections.into_iter().for_each(|(reason, count)| self.reject(reason, count));
        for (reason, poses) in other.lost {
            let lost = self.lost.entry(reason).or_default();
            lost.extend(poses);
            lost.sort_by_key(|pose| scatter(pose.id));
            lost.truncate(self.sample);
        }
    }

    /// Keeps a grip that does not hold if it belongs to the sample.
    fn lose(&mut self, grip: &RankedGrip, reason: String) {
        if self.sample == 0 {
            return;
        }
        let lost = self.lost.entry(reason.clone()).or_default();
        let key = scatter(grip.grip.id);
        let place = lost.partition_point(|known| scatter(known.id) < key);
        if place < self.sample {
            lost.insert(place, Negative::new(&grip.grip, reason));
            lost.truncate(self.sample);
        }
    }

    /// The sample of the grips that do not hold, by reason.
    pub fn take_lost(&mut self) -> BTreeMap<String, Vec<Negative>> {
        std::mem::take(&mut self.lost)
    }

    /// Whether no grip that was added has a limit state.
    pub fn is_empty(&self) -> bool {
        self.ranked == 0
    }

    /// Counts grips of a chunk that were left unsolved because they cannot be among the best.
    pub fn outrank(&mut self, grips: u64) {
        if grips > 0 {
            *self.rejections.entry(OUTRANKED.to_owned()).or_default() += grips;
        }
    }

    /// Counts grips that were left out for a reason.
    pub fn reject(&mut self, reason: String, grips: u64) {
        *self.rejections.entry(reason).or_default() += grips;
    }

    /// Merits of the best grips so far, see [`rank::merit`]; infinite where no friction is needed.
    pub fn merits(&self) -> impl Iterator<Item = f64> {
        self.kept.iter().map(merit)
    }

    /// Grips ranked so far.
    pub fn ranked(&self) -> u64 {
        self.ranked
    }

    /// The final order with counts; `size` is the diagonal of the part's bounding box \[m\].
    pub fn finish(self, centre_of_mass: DVec3, size: f64, options: &rank::Options) -> Ranking {
        let held = self.kept.iter().filter(|grip| !rank::slips(grip)).count() as u64;
        let mut ranking = rank::rank(self.kept, centre_of_mass, size, options);
        // Beside those kept, the ones that fell behind them.
        ranking.holding += self.holding - held;
        for (reason, count) in self.rejections {
            *ranking.rejections.entry(reason).or_default() += count;
        }
        ranking.ranked = self.ranked - ranking.rejections.get("duplicate").copied().unwrap_or(0);
        ranking
    }
}

fn merit(grip: &RankedGrip) -> f64 {
    rank::merit(grip.score.unwrap_or(f64::INFINITY), rank::slips(grip))
}

//! The main job: from a part, a gripper and loads to a ranked list of grips.
//!
//! Candidates flow through in chunks: proposed, scored under every load, measured; only the best
//! [`Settings::keep`] stay.

pub mod checkpoint;
pub mod noise;

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::backend::{Backend, Batch, Best, Polish, Problem, ScoreOptions, Scored, SeedSet};
use crate::error::Result;
use crate::geometry::patch_area;
use crate::load::wrench_in_grip;
use crate::mechanics::twist_out::{self, TwistOut};
use crate::mechanics::{Options, Pads, Search, inverse, refused};
use crate::model::{Grip, Patch, Status, Wrench};
use crate::part::MassProperties;
use crate::rank::{self, Ranking, Weights};
use crate::results::{LoadCase, LoadScore, RankedGrip};

/// What decides the answer, beside part, gripper and loads.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Gripping force [N].
    pub force: f64,
    /// Weights of the score.
    pub weights: Weights,
    /// Position uncertainty of the part along the pads while closing [m], for alpha.
    pub delta: f64,
    /// Pad friction while closing, for alpha.
    pub mu_c: f64,
    /// Pad friction, for safety and the force needed.
    pub pad_friction: Option<f64>,
    /// How loads are solved.
    pub score: ScoreOptions,
}

/// Scores grips of one part under one set of loads.
#[derive(Debug)]
pub struct Assessor<'a> {
    /// The loads, part frame, about the centre of mass.
    pub loads: &'a [LoadCase],
    /// The part's mass properties.
    pub mass: MassProperties,
    /// Settings.
    pub settings: &'a Settings,
    /// Where the seeds are computed.
    pub backend: &'a Backend,
    /// The twists tried.
    pub seeds: &'a SeedSet,
}

/// Loads of one call of the backend: bounds the memory whatever the number of grips and loads.
const LOADS_AT_ONCE: usize = 1 << 20;
/// The same where the answer of every load is kept for a while, some 250 bytes each.
const ANSWERS_AT_ONCE: usize = 1 << 17;

impl Assessor<'_> {
    /// Scores every grip under its worst load, in order. The answers depend neither on the number
    /// of threads nor on the backend.
    ///
    /// # Errors
    /// As [`Backend::score`].
    pub fn assess(&self, grips: Vec<Grip>) -> Result<Vec<RankedGrip>> {
        self.assess_blocks(grips, None)
    }

    /// As [`Assessor::assess`], but without the grips whose bounds show that they cannot be among
    /// the `best`, the merits so far. The weight `k1` must not be negative.
    ///
    /// # Errors
    /// As [`Backend::score_best`].
    pub fn assess_best(&self, grips: Vec<Grip>, best: &mut Best) -> Result<Vec<RankedGrip>> {
        self.assess_blocks(grips, Some(best))
    }

    fn assess_blocks(
        &self,
        grips: Vec<Grip>,
        mut best: Option<&mut Best>,
    ) -> Result<Vec<RankedGrip>> {
        let mut ranked = Vec::with_capacity(grips.len());
        let mut grips = grips.into_iter().peekable();
        while grips.peek().is_some() {
            let block: Vec<Grip> =
                grips.by_ref().take((LOADS_AT_ONCE / self.loads.len().max(1)).max(1)).collect();
            ranked.extend(self.assess_block(block, best.as_deref_mut())?);
        }
        Ok(ranked)
    }

    fn assess_block(&self, grips: Vec<Grip>, best: Option<&mut Best>) -> Result<Vec<RankedGrip>> {
        let wrenches: Vec<Vec<Wrench>> = grips.par_iter().map(|grip| self.wrenches(grip)).collect();
        let batch = Batch {
            problems: grips
                .iter()
                .zip(&wrenches)
                .map(|(grip, wrenches)| self.problem(grip, wrenches))
                .collect(),
        };
        let scored = match best {
            None => self.backend.score(&batch, self.seeds, &self.settings.score)?,
            Some(best) => {
                let alphas: Vec<f64> = grips
                    .par_iter()
                    .map(|grip| self.alpha(grip, &TwistOut::new(&grip.contact)).0)
                    .collect();
                let merit = |index: usize, mu: f64| self.settings.weights.score(mu, alphas[index]);
                self.backend.score_best(&batch, self.seeds, &self.settings.score, best, &merit)?
            }
        };
        let jobs = grips
            .into_par_iter()
            .zip(wrenches.par_iter())
            .zip(scored)
            .filter(|(_, scored)| !scored.outranked);
        Ok(jobs.map(|((grip, wrenches), scored)| self.measure(grip, wrenches, &scored)).collect())
    }

    /// The loads as a grip sees them.
    fn wrenches(&self, grip: &Grip) -> Vec<Wrench> {
        self.loads
            .iter()
            .map(|load| {
                wrench_in_grip(&load.wrench, self.mass.centre_of_mass, &grip.part_from_grip)
            })
            .collect()
    }

    fn problem<'a>(&self, grip: &'a Grip, wrenches: &'a [Wrench]) -> Problem<'a> {
        Problem {
            contact: &grip.contact,
            distance: grip.distance(),
            force: self.settings.force,
            wrenches,
        }
    }

    /// Alpha [rad] and the least lever [m].
    ///
    /// The width counts for grips from inside too: jaws that push outwards right a part up to `asin
    /// w/d`, which is more than `atan w/d`.
    fn alpha(&self, grip: &Grip, lever: &TwistOut) -> (f64, f64) {
        let least = lever.least_lever().map_or(0.0, |lever| lever.width);
        (twist_out::alpha(grip.width, least, self.settings.delta, self.settings.mu_c), least)
    }

    /// A grip's numbers from its worst load; what takes more solving is left to
    /// [`Assessor::finish`].
    fn measure(&self, grip: Grip, wrenches: &[Wrench], scored: &Scored) -> RankedGrip {
        let (load, score) = scored.worst.unwrap_or((0, refused(Status::NoContact, 0)));
        let wrench = wrenches.get(load).copied().unwrap_or_default();
        let lever = TwistOut::new(&grip.contact);
        let (alpha, least) = self.alpha(&grip, &lever);
        let share = |left: f64, patch: &Patch| left / patch_area(patch);
        let contact_share = share(score.contact_area_i, &grip.contact.face_i)
            .min(share(score.contact_area_ii, &grip.contact.face_ii));
        RankedGrip {
            rank: 0,
            score: None,
            alpha,
            delta_d: twist_out::delta_d(grip.width, least),
            contact_share,
            twist_margin: lever.margin(self.settings.force, &wrench),
            safety: self
                .settings
                .pad_friction
                .zip(score.mu_s)
                .filter(|(_, mu)| *mu > 0.0)
                .map(|(friction, mu)| friction / mu),
            force_needed: None,
            load_multiple: None,
            earlier: None,
            pose_noise: None,
            worst: LoadScore {
                load: load as u32,
                wrench,
                status: score.status,
                mu_s: score.mu_s,
                slip: score.slip,
                pressure: score.pressure,
                bounds: score.bounds,
                residual: score.residual,
            },
            merged: Vec::new(),
            mu_by_load: scored.all.iter().map(|score| score.mu_s).collect(),
            grip,
        }
    }

    /// Solves every load exactly for the grips that do not have all of them yet, and keeps each
    /// load's `mu_s`. Nothing else changes.
    ///
    /// # Errors
    /// As [`Backend::score`].
    pub fn solve_every_load(&self, grips: &mut [&mut RankedGrip]) -> Result<()> {
        let options = ScoreOptions { polish: Polish::All, ..self.settings.score };
        let mut open: Vec<&mut &mut RankedGrip> =
            grips.iter_mut().filter(|ranked| ranked.mu_by_load.len() != self.loads.len()).collect();
        for block in open.chunks_mut((ANSWERS_AT_ONCE / self.loads.len().max(1)).max(1)) {
            let wrenches: Vec<Vec<Wrench>> =
                block.par_iter().map(|ranked| self.wrenches(&ranked.grip)).collect();
            let problems = block
                .iter()
                .zip(&wrenches)
                .map(|(ranked, wrenches)| self.problem(&ranked.grip, wrenches));
            let scored = self.backend.score(
                &Batch { problems: problems.collect() },
                self.seeds,
                &options,
            )?;
            for (ranked, scored) in block.iter_mut().zip(scored) {
                ranked.mu_by_load = scored.all.iter().map(|score| score.mu_s).collect();
            }
        }
        Ok(())
    }

    /// Adds what only the grips of the final list need: the gripping force needed and the largest
    /// multiple under the worst load.
    pub fn finish(&self, grips: &mut [RankedGrip]) {
        let Some(friction) = self.settings.pad_friction else { return };
        // For thousands of grips only limit states on the branch from d = 0 count, which errs
        // towards more force.
        let options = Options {
            separation: self.settings.score.separation,
            search: Search::Off,
            ..Options::default()
        };
        grips.par_iter_mut().for_each(|ranked| {
            let grip = &ranked.grip;
            let Some(pads) = Pads::new(&grip.contact) else { return };
            ranked.force_needed = inverse::force_needed(
                &pads,
                grip.distance(),
                &ranked.worst.wrench,
                friction,
                &options,
            );
            let multiple = ranked.force_needed.map_or(0.0, |needed| self.settings.force / needed);
            ranked.load_multiple = multiple.is_finite().then_some(multiple);
        });
    }
}

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

    /// The final order with counts; `size` is the diagonal of the part's bounding box [m].
    pub fn finish(self, centre_of_mass: DVec3, size: f64, options: &rank::Options) -> Ranking {
        let mut ranking = rank::rank(self.kept, centre_of_mass, size, options);
        for (reason, count) in self.rejections {
            *ranking.rejections.entry(reason).or_default() += count;
        }
        ranking.ranked = self.ranked - ranking.rejections.get("duplicate").copied().unwrap_or(0);
        ranking
    }
}

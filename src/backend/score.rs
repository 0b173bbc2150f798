//! From seeds to final answers: the bounds decide which loads can be the worst, and only those are
//! solved in f64.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::job::{Backend, Survivors};
use super::prepare::Contacts;
use super::problem::{Batch, F32_TOLERANCE, Problem, Seed, SeedStatus};
use super::screen::Wanted;
use super::seeds::SeedSet;
use super::watch::Watch;
use super::worst::{Ended, Work};
use crate::contact::{PlaneWrench, Twist};
use crate::error::Result;
use crate::mechanics::twist_out::TwistOut;
use crate::mechanics::{Options, Pads, Search, refused, solve_pads};
use crate::model::{Score, Status, Wrench};
use crate::request::{Polish, Refiner, Separation};

/// Values of `mu_s` that differ by less than this share count as equal, and the first load is taken
/// as the worst: answers from different seeds agree better than this.
pub(crate) const TIE: f64 = 1e-9;

/// Loads seeded at a time, which bounds the memory whatever the size of the batch.
pub(super) const BLOCK: usize = 1 << 19;

/// Loads of a grip that a race solves before it looks for one that is not held.
const HARD: usize = 16;

/// How [`Backend::score`] works.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ScoreOptions {
    /// Which loads are solved; [`Polish::Top`] is as [`Polish::Worst`] here, and
    /// [`Backend::score_best`] leaves grips out.
    pub polish: Polish,
    /// What to do with grips that separate.
    pub separation: Separation,
    /// Minimiser of the exact solver.
    pub refiner: Refiner,
}

impl ScoreOptions {
    /// Loads that the exact answers are found among. Estimates are Newton's; and where a pad that lifts
    /// ends a grip, each such load is to be seen.
    pub(super) fn wanted(&self) -> Wanted {
        match (self.separation, self.refiner) {
            (Separation::Solve, Refiner::Newton) => Wanted::Estimated,
            _ => Wanted::Worst,
        }
    }
}

/// The answer for one grip.
#[derive(Debug, Clone, PartialEq)]
pub struct Scored {
    /// Index of the worst load and its answer. Of loads without a usable `mu_s` the one with the
    /// least margin against twisting out ([`TwistOut::margin`]); else the load with the largest
    /// `mu_s`. The first of those that tie. `None` without loads, and for a grip that is
    /// `outranked`.
    pub worst: Option<(usize, Score)>,
    /// Answers of all loads under [`Polish::All`], mostly without [`Score::bounds`]; else empty.
    pub all: Vec<Score>,
    /// Loads for which the seven equations were solved.
    pub solved: usize,
    /// Loads that were only compared with the worst: their slip problem alone was solved, or the
    /// equations to an error bound that kept them below it.
    pub compared: usize,
    /// Not solved to the end: it cannot be among the best ([`Backend::score_best`]).
    pub outranked: bool,
}

impl Backend {
    /// Scores every grip under all its loads. The answers agree to 1e-9 whichever backend computed
    /// the seeds, and do not depend on the number of threads.
    ///
    /// # Errors
    /// As [`Backend::seed`].
    pub fn score(
        &self,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        options: &ScoreOptions,
    ) -> Result<Vec<Scored>> {
        let scored = Watch::none(|watch| self.score_watched(batch, seeds, options, watch))?;
        Ok(scored.into_iter().flatten().collect())
    }

    /// As [`Backend::score`], as far as `watch` does not stop it: `None` for the other grips.
    pub(crate) fn score_watched(
        &self,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        options: &ScoreOptions,
        watch: &Watch<'_>,
    ) -> Result<Vec<Option<Scored>>> {
        let wanted = if options.polish == Polish::All { Wanted::All } else { options.wanted() };
        self.by_blocks((BLOCK, wanted), batch, seeds, |Block { range, contacts, survivors }| {
            cases(&contacts, &batch.problems[range], &survivors, options)
                .into_par_iter()
                .map(|case| watch.scored(|| case.score(None)))
                .collect()
        })
    }

    /// What is left of each grip's loads to be asked about: those that are not soon seen to be held by
    /// `friction`, in some limit state. Loads that are `known` are not looked at.
    ///
    /// # Errors
    /// As [`Backend::seed`].
    pub(crate) fn exceeding(
        &self,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        options: &ScoreOptions,
        friction: f64,
        known: &[&[usize]],
    ) -> Result<Vec<Exceeding>> {
        self.by_blocks((BLOCK, Wanted::Worst), batch, seeds, |block| {
            let Block { range, contacts, survivors } = block;
            let known = &known[range.clone()];
            cases(&contacts, &batch.problems[range], &survivors, options)
                .into_par_iter()
                .zip(known)
                .map(|(case, known)| case.exceeding(friction, known))
                .collect()
        })
    }

    /// Seeds one block of the batch, of `most` loads or one problem, after another. While a block is
    /// seeded, the one before is solved.
    pub(super) fn by_blocks<T: Send>(
        &self,
        (most, wanted): (usize, Wanted),
        batch: &Batch<'_>,
        seeds: &SeedSet,
        mut solve: impl FnMut(Block) -> Vec<T> + Send,
    ) -> Result<Vec<T>> {
        let mut solve = |block: Block| {
            let start = std::time::Instant::now();
            let scored = solve(block);
            self.solved_since(start);
            scored
        };
        let mut scored = Vec::with_capacity(batch.problems.len());
        let mut waiting: Option<Block> = None;
        for range in blocks(&batch.problems, most) {
            let part = Batch { problems: batch.problems[range.clone()].to_vec() };
            let seed = || -> Result<Block> {
                let contacts = Contacts::new(&part.problems)?;
                let survivors = self.survivors_on(&contacts, &part, seeds, wanted)?;
                Ok(Block { range, contacts, survivors })
            };
            let (block, before) = rayon::join(seed, || waiting.take().map(&mut solve));
            scored.extend(before.into_iter().flatten());
            waiting = Some(block?);
        }
        scored.extend(waiting.into_iter().flat_map(solve));
        Ok(scored)
    }
}

/// Some consecutive problems of a batch, seeded.
pub(super) struct Block {
    /// Their places in the batch.
    pub(super) range: Range<usize>,
    /// Their contacts.
    pub(super) contacts: Contacts,
    /// Their loads that can be the worst, with their seeds.
    pub(super) survivors: Survivors,
}

/// Cuts the problems so that each block has at most `most` loads (or one problem).
fn blocks(problems: &[Problem<'_>], most: usize) -> Vec<Range<usize>> {
    let (mut blocks, mut start, mut loads) = (Vec::new(), 0, 0);
    for (index, problem) in problems.iter().enumerate() {
        if index > start && loads + problem.wrenches.len() > most {
            blocks.push(start..index);
            (start, loads) = (index, 0);
        }
        loads += problem.wrenches.len();
    }
    if start < problems.len() {
        blocks.push(start..problems.len());
    }
    blocks
}

/// Each problem with its contact and its part of the `seeds`.
pub(super) fn cases<'a>(
    contacts: &'a Contacts,
    problems: &'a [Problem<'a>],
    survivors: &'a Survivors,
    options: &'a ScoreOptions,
) -> Vec<Case<'a>> {
    let ready = problems.iter().zip(&contacts.slots).zip(survivors.by_problem());
    ready
        .map(|((problem, &slot), (loads, seeds))| Case {
            problem,
            pads: contacts.ready[slot].pads.as_ref(),
            loads,
            seeds,
            options,
        })
        .collect()
}

/// Loads of a grip that are not soon seen to be held by a friction.
#[derive(Debug, Default)]
pub(crate) struct Exceeding {
    /// Loads that are not, the nearest to twisting out first.
    pub(crate) loads: Vec<usize>,
    /// Whether others were not looked at.
    pub(crate) others: bool,
}

/// One grip with the seeds of its loads that can be the worst. In what follows a load goes by its
/// place among these; only the answer has its number among all.
#[derive(Clone, Copy)]
pub(super) struct Case<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) pads: Option<&'a Pads>,
    /// The loads' numbers, rising.
    loads: &'a [u32],
    pub(super) seeds: &'a [Seed],
    pub(super) options: &'a ScoreOptions,
}

impl Case<'_> {
    pub(super) fn wrench(&self, load: usize) -> Wrench {
        self.problem.wrench(self.loads[load] as usize)
    }

    /// The answer with the load's number among all.
    pub(super) fn numbered(&self, (load, score): (usize, Score)) -> (usize, Score) {
        (self.loads[load] as usize, score)
    }

    /// Nothing less than this is the `mu_s` of the grip's worst load, if all its loads are held.
    pub(super) fn lower(&self) -> f64 {
        (0..self.seeds.len()).map(|load| self.lower_of(load)).fold(0.0, f64::max)
    }

    /// The seed's lower bound; without one, what holds for every pressure: no point of a face moves
    /// faster than its fastest vertex, so `D(v)` is at most `sum N_k max |v|`.
    fn lower_of(&self, load: usize) -> f64 {
        let seed = &self.seeds[load];
        let (SeedStatus::Unbounded, Some(pads)) = (seed.status, self.pads) else {
            return seed.lower;
        };
        let load = pads.load(self.problem.distance, self.problem.force, &self.wrench(load));
        let bound = |v: Twist| {
            let speed = |x: &DVec2| v.velocity(*x).length_squared();
            let fastest = |k: usize| pads.hulls[k].iter().map(speed).fold(0.0, f64::max).sqrt();
            load.direction.power(v) / (load.normal[0] * fastest(0) + load.normal[1] * fastest(1))
        };
        let PlaneWrench { f1, f2, .. } = load.direction;
        let slide = bound(Twist { u1: f1, u2: f2, omega: 0.0 });
        let turn = bound(pads.scaled_twist(seed.twist));
        // Less than rounding leaves of either; not a number where nothing moves.
        slide.max(turn).max(0.0) * load.size * (1.0 - F32_TOLERANCE)
    }

    /// The grip's worst load. With `beaten`, which says whether a grip is out of the race whose
    /// `mu_s` is at least this much, it ends without an answer as soon as that is so.
    pub(super) fn score(&self, beaten: Option<&(dyn Fn(f64) -> bool + Sync)>) -> Scored {
        if self.options.polish == Polish::All {
            return self.score_all();
        }
        let out = |mu: f64| beaten.is_some_and(|beaten| beaten(mu));
        if beaten.is_some() && out(self.lower()) {
            return Work::new(self).outranked();
        }
        let has_bounds = |load: &usize| self.has_bounds(*load);
        let (bounded, open): (Vec<usize>, Vec<usize>) = (0..self.seeds.len()).partition(has_bounds);
        let known = bounded.iter().map(|&load| self.seeds[load].lower).fold(0.0, f64::max);
        let look = |open: &[usize], leader: Option<usize>, most: usize| {
            let mut work = Work::new(self);
            work.at_least(known);
            work.at_most(most);
            let ended = work.without_bounds(open, leader, &out);
            match ended.and_then(|()| work.with_bounds(&bounded, &out)) {
                Ok(()) => Ok(work.worst()),
                Err(Ended::Outranked) => Ok(work.outranked()),
                Err(Ended::Refused | Ended::Hard) => Err(Box::new(work.refused())),
            }
        };
        // The one that seems to ask for most comes before them all: few of the others reach it.
        let estimate = |load: usize| self.seeds[load].estimate;
        let leader = open.iter().copied().max_by(|&a, &b| estimate(a).total_cmp(&estimate(b)));
        // Where a race has to solve many, loads near to twisting out are likely to end it. Which of them
        // refuses the grip shall hang neither on that nor on the leader, and one that seems to, alone, may
        // be held beside another's state.
        let most = if beaten.is_some() { HARD } else { usize::MAX };
        let turn = || self.in_turn(&open, false);
        look(&self.in_turn(&open, beaten.is_some()), leader, most)
            .or_else(|_| Work::new(self).first_refused(&turn()).ok_or(()))
            .or_else(|()| look(&turn(), None, usize::MAX))
            .unwrap_or_else(|refused| *refused)
    }

    fn has_bounds(&self, load: usize) -> bool {
        matches!(
            self.seeds[load].status,
            SeedStatus::Bounded | SeedStatus::Coupled | SeedStatus::Estimated
        )
    }

    /// As [`Backend::exceeding`].
    fn exceeding(&self, friction: f64, known: &[usize]) -> Exceeding {
        let asked =
            (0..self.seeds.len()).filter(|&load| !known.contains(&(self.loads[load] as usize)));
        let (bounded, open): (Vec<usize>, Vec<usize>) =
            asked.partition(|&load| self.has_bounds(load));
        // Loads left out by a bound are below the greatest of these.
        let lower = self.seeds.iter().map(|seed| seed.lower).fold(0.0, f64::max);
        let found = Work::new(self).exceeding(friction, &self.in_turn(&open, false), &bounded);
        let loads = found.into_iter().map(|load| self.loads[load] as usize).collect();
        Exceeding { loads, others: lower > friction }
    }

    /// Every load solved exactly.
    fn score_all(&self) -> Scored {
        let all: Vec<Score> = (0..self.seeds.len())
            .into_par_iter()
            .with_min_len(8)
            .map(|load| self.solve(load))
            .collect();
        let answers: Vec<(usize, Score)> = all.iter().copied().enumerate().collect();
        let worst = self.settle(self.worst(&answers)).map(|worst| self.numbered(worst));
        Scored { worst, solved: all.len(), compared: 0, all, outranked: false }
    }

    /// Loads without bounds in the order in which they are compared. One that has no limit state
    /// is the worst, whatever the others are (a load with bounds has one): the nearest to twisting
    /// out comes first. In a race the most demanding does.
    fn in_turn(&self, open: &[usize], race: bool) -> Vec<usize> {
        let urgency: Vec<f64> = if race {
            open.iter().map(|&load| -self.seeds[load].estimate).collect()
        } else {
            self.margins(open)
        };
        let mut order: Vec<usize> = (0..open.len()).collect();
        order.sort_by(|&a, &b| urgency[a].total_cmp(&urgency[b]).then(a.cmp(&b)));
        order.into_iter().map(|place| open[place]).collect()
    }

    /// Margin against twisting out of each of the `loads`.
    fn margins(&self, loads: &[usize]) -> Vec<f64> {
        if loads.is_empty() {
            return Vec::new();
        }
        let lever = TwistOut::new(self.problem.contact);
        loads.iter().map(|&load| lever.margin(self.problem.force, &self.wrench(load))).collect()
    }

    pub(super) fn options(&self, load: usize, search: Search) -> Options {
        let seed = &self.seeds[load];
        let searched = matches!(
            seed.status,
            SeedStatus::Bounded
                | SeedStatus::Coupled
                | SeedStatus::Unbounded
                | SeedStatus::Estimated
        );
        Options {
            separation: self.options.separation,
            refiner: self.options.refiner,
            seed: searched.then_some(seed.twist),
            search,
        }
    }

    fn full(&self, load: usize, search: Search) -> Score {
        let options = self.options(load, search);
        match self.pads {
            Some(pads) => solve_pads(
                pads,
                self.problem.distance,
                self.problem.force,
                &self.wrench(load),
                &options,
            ),
            None => refused(Status::NoContact, 0),
        }
    }

    /// Further solutions are looked for where a load seems to have none, and for the worst one in
    /// the end.
    pub(super) fn solve(&self, load: usize) -> Score {
        let score = self.full(load, Search::Off);
        if usable(&score).is_some() { score } else { self.full(load, Search::WhereNeeded) }
    }

    pub(super) fn settle(&self, worst: Option<(usize, Score)>) -> Option<(usize, Score)> {
        worst.map(|(load, score)| {
            (
                load,
                if usable(&score).is_some() { self.full(load, Search::WhereNeeded) } else { score },
            )
        })
    }

    /// The worst of some loads' answers, which come by rising load index.
    pub(super) fn worst(&self, answers: &[(usize, Score)]) -> Option<(usize, Score)> {
        let refused: Vec<usize> = answers
            .iter()
            .filter(|(_, score)| usable(score).is_none())
            .map(|&(load, _)| load)
            .collect();
        let least = self
            .margins(&refused)
            .into_iter()
            .zip(&refused)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1)));
        if let Some((_, worst)) = least {
            return answers.iter().find(|(load, _)| load == worst).copied();
        }
        let largest = answers.iter().filter_map(|(_, score)| usable(score)).fold(0.0, f64::max);
        answers
            .iter()
            .find(|(_, score)| usable(score).is_some_and(|mu| mu >= largest * (1.0 - TIE)))
            .copied()
    }
}

/// `mu_s` when the load is held.
pub(super) fn usable(score: &Score) -> Option<f64> {
    score.mu_s.filter(|_| score.status.holds())
}

//! From seeds to final answers: the bounds decide which loads can be the worst, and only those are
//! solved in f64.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::job::Backend;
use super::prepare::Contacts;
use super::problem::{Batch, F32_TOLERANCE, Problem, Seed, SeedStatus};
use super::seeds::SeedSet;
use crate::contact::{Field, PlaneWrench, Twist};
use crate::error::Result;
use crate::mechanics::slip;
use crate::mechanics::twist_out::TwistOut;
use crate::mechanics::{
    Comparison, Load, Neighbour, Options, Pads, Search, below, refused, solve_next, solve_pads,
};
use crate::model::{Score, Status};
use crate::request::{Polish, Refiner, Separation};

/// Values of `mu_s` that differ by less than this share count as equal, and the first load is taken
/// as the worst: answers from different seeds agree better than this.
pub(crate) const TIE: f64 = 1e-9;

/// Loads seeded at a time, which bounds the memory whatever the size of the batch.
pub(super) const BLOCK: usize = 1 << 19;

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
        self.by_blocks(BLOCK, batch, seeds, |Block { range, contacts, seeds }| {
            cases(&contacts, &batch.problems[range], &seeds, options)
                .into_par_iter()
                .map(|case| case.score(None))
                .collect()
        })
    }

    /// Seeds one block of the batch, of `most` loads or one problem, after another. While a block is
    /// seeded, the one before is solved.
    pub(super) fn by_blocks(
        &self,
        most: usize,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        mut solve: impl FnMut(Block) -> Vec<Scored> + Send,
    ) -> Result<Vec<Scored>> {
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
                let seeds = self.seed_on(&contacts, &part, seeds)?;
                Ok(Block { range, contacts, seeds })
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
    /// The seeds of all their loads, one problem after the other.
    pub(super) seeds: Vec<Seed>,
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
    seeds: &'a [Seed],
    options: &'a ScoreOptions,
) -> Vec<Case<'a>> {
    let mut rest = seeds;
    let ready = problems.iter().zip(&contacts.slots).map(|(problem, &slot)| {
        let (seeds, others) = rest.split_at(problem.wrenches.len());
        rest = others;
        Case { problem, pads: contacts.ready[slot].pads.as_ref(), seeds, options }
    });
    ready.collect()
}

/// One grip with the seeds of its loads.
#[derive(Clone, Copy)]
pub(super) struct Case<'a> {
    problem: &'a Problem<'a>,
    pads: Option<&'a Pads>,
    seeds: &'a [Seed],
    options: &'a ScoreOptions,
}

impl Case<'_> {
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
        let load =
            pads.load(self.problem.distance, self.problem.force, &self.problem.wrenches[load]);
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
        let mut work =
            Work { case: self, solved: Vec::new(), compared: 0, neighbours: Neighbours::default() };
        let out = |mu: f64| beaten.is_some_and(|beaten| beaten(mu));
        if beaten.is_some() && out(self.lower()) {
            return work.outranked();
        }
        let has_bounds = |load: &usize| {
            matches!(self.seeds[*load].status, SeedStatus::Bounded | SeedStatus::Coupled)
        };
        let (bounded, open): (Vec<usize>, Vec<usize>) = (0..self.seeds.len()).partition(has_bounds);
        let open = self.in_turn(open, beaten.is_some());
        let floor = bounded.iter().map(|&load| self.seeds[load].lower).fold(0.0, f64::max);
        let ended = match work.without_bounds(&open, floor, &out) {
            Ok(largest) => work.with_bounds(bounded, largest, &out),
            Err(ended) => Err(ended),
        };
        match ended {
            Ok(()) => work.worst(),
            Err(Ended::Outranked) => work.outranked(),
            Err(Ended::Refused) => work.refused(),
        }
    }

    /// Every load solved exactly.
    fn score_all(&self) -> Scored {
        let all: Vec<Score> = (0..self.seeds.len())
            .into_par_iter()
            .with_min_len(8)
            .map(|load| self.solve(load))
            .collect();
        let answers: Vec<(usize, Score)> = all.iter().copied().enumerate().collect();
        let worst = self.settle(self.worst(&answers));
        Scored { worst, solved: all.len(), compared: 0, all, outranked: false }
    }

    /// Loads without bounds in the order in which they are compared. One that has no limit state
    /// is the worst, whatever the others are (a load with bounds has one): the nearest to twisting
    /// out comes first. In a race the most demanding does.
    fn in_turn(&self, open: Vec<usize>, race: bool) -> Vec<usize> {
        let urgency: Vec<f64> = if race {
            open.iter().map(|&load| -self.seeds[load].estimate).collect()
        } else {
            self.margins(&open)
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
        loads
            .iter()
            .map(|&load| lever.margin(self.problem.force, &self.problem.wrenches[load]))
            .collect()
    }

    fn options(&self, load: usize, search: Search) -> Options {
        let seed = &self.seeds[load];
        let searched = matches!(
            seed.status,
            SeedStatus::Bounded | SeedStatus::Coupled | SeedStatus::Unbounded
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
                &self.problem.wrenches[load],
                &options,
            ),
            None => refused(Status::NoContact, 0),
        }
    }

    /// Further solutions are looked for where a load seems to have none, and for the worst one in
    /// the end.
    fn solve(&self, load: usize) -> Score {
        let score = self.full(load, Search::Off);
        if usable(&score).is_some() { score } else { self.full(load, Search::WhereNeeded) }
    }

    fn settle(&self, worst: Option<(usize, Score)>) -> Option<(usize, Score)> {
        worst.map(|(load, score)| {
            (
                load,
                if usable(&score).is_some() { self.full(load, Search::WhereNeeded) } else { score },
            )
        })
    }

    /// The worst of some loads' answers, which come by rising load index.
    fn worst(&self, answers: &[(usize, Score)]) -> Option<(usize, Score)> {
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

/// What has been solved of a grip so far.
struct Work<'a> {
    case: &'a Case<'a>,
    solved: Vec<(usize, Score)>,
    compared: usize,
    neighbours: Neighbours,
}

/// What one more load came to.
enum Compared {
    /// Its `mu_s` is less than the value asked about.
    Below,
    /// Its `mu_s`.
    Solved(f64),
    /// It is not held.
    Refused,
}

/// Why a grip's loads are not all looked at.
enum Ended {
    /// The grip is out of the race.
    Outranked,
    /// The load solved last has no limit state.
    Refused,
}

/// States found of some loads, for the next ones to begin at. No more than [`MOST`] and none much
/// like another, so that finding the nearest does not grow with the number of loads.
#[derive(Default)]
struct Neighbours {
    /// Per coordinate of a load's place, the loads'.
    places: [Vec<f32>; 6],
    states: Vec<Neighbour>,
    /// Squares of distances, while the nearest is looked for.
    apart: Vec<f32>,
}

/// States kept of one grip.
const MOST: usize = 256;
/// Square of the distance in units of the gripping force from which on a load's state is kept.
const UNLIKE: f32 = 0.05 * 0.05;
/// Square of the distance up to which a state helps.
const LIKE: f32 = 0.5 * 0.5;

impl Neighbours {
    /// The nearest state, with the square of its distance.
    fn nearest(&mut self, place: &[f32; 6]) -> Option<(f32, &Neighbour)> {
        self.apart.clear();
        self.apart.resize(self.states.len(), 0.0);
        for (all, x) in self.places.iter().zip(place) {
            for (apart, other) in self.apart.iter_mut().zip(all) {
                *apart += (x - other) * (x - other);
            }
        }
        let least = self.apart.iter().fold(f32::INFINITY, |least, &apart| least.min(apart));
        let index = self.apart.iter().position(|&apart| apart == least)?;
        Some((least, &self.states[index]))
    }

    fn add(&mut self, place: [f32; 6], state: Neighbour) {
        for (all, x) in self.places.iter_mut().zip(place) {
            all.push(x);
        }
        self.states.push(state);
    }
}

/// Where a load is among others.
fn place(load: &Load) -> [f32; 6] {
    let PlaneWrench { f1, f2, m3 } = load.direction;
    [f1, f2, m3, load.moment[0], load.moment[1], load.normal[0]].map(|x| x as f32)
}

impl Work<'_> {
    /// Compares loads without bounds one by one. The largest `mu_s` among those solved; the others
    /// have less than this or than `floor`, which a load with bounds reaches.
    fn without_bounds(
        &mut self,
        open: &[usize],
        mut floor: f64,
        out: &dyn Fn(f64) -> bool,
    ) -> std::result::Result<f64, Ended> {
        let mut largest: f64 = 0.0;
        // The one that seems to ask for most comes before them all: few of the others reach it.
        let estimate = |load: usize| self.case.seeds[load].estimate;
        let leader = open.iter().copied().max_by(|&a, &b| estimate(a).total_cmp(&estimate(b)));
        let leader = leader.filter(|&load| match self.compare(load, 0.0) {
            Compared::Solved(mu) => {
                largest = mu;
                true
            }
            // Its turn comes.
            _ => {
                self.solved.clear();
                false
            }
        });
        for &load in open {
            if out(largest) {
                return Err(Ended::Outranked);
            }
            floor = floor.max(largest);
            if leader != Some(load) {
                match self.compare(load, floor * (1.0 - 2.0 * TIE)) {
                    Compared::Below => {}
                    Compared::Solved(mu) => largest = largest.max(mu),
                    Compared::Refused => return Err(Ended::Refused),
                }
            }
        }
        if out(largest) { Err(Ended::Outranked) } else { Ok(largest) }
    }

    /// Solves loads with bounds by falling upper bound, until none can reach the `largest` found.
    /// For congruent faces the slip problem alone decides `mu_s`: the seven equations are solved
    /// for the worst of them only.
    fn with_bounds(
        &mut self,
        mut bounded: Vec<usize>,
        mut largest: f64,
        out: &dyn Fn(f64) -> bool,
    ) -> std::result::Result<(), Ended> {
        let case = self.case;
        let floor = bounded.iter().map(|&load| case.seeds[load].lower).fold(largest, f64::max);
        bounded.retain(|&load| case.seeds[load].upper >= floor);
        bounded
            .sort_by(|&a, &b| case.seeds[b].upper.total_cmp(&case.seeds[a].upper).then(a.cmp(&b)));
        let mut slips: Vec<(usize, f64)> = Vec::new();
        // Ties with the largest are solved too, so that the first of them is found.
        // Congruent to rounding, not only to the single precision of the part's file.
        let exact = case.pads.is_some_and(|pads| pads.congruent);
        let margin = if exact { 2.0 * TIE } else { F32_TOLERANCE };
        for load in bounded {
            if case.seeds[load].upper < largest * (1.0 - margin) {
                break;
            }
            if let (SeedStatus::Bounded, Some(pads)) = (case.seeds[load].status, case.pads) {
                let mu = slip_only(pads, case.problem, load, case.seeds[load].twist);
                largest = largest.max(mu);
                slips.push((load, mu));
            } else {
                match self.compare(load, largest * (1.0 - 2.0 * TIE)) {
                    Compared::Below => {}
                    Compared::Solved(mu) => largest = largest.max(mu),
                    Compared::Refused => largest = f64::INFINITY,
                }
            }
        }
        self.compared += slips.len();
        if out(largest * (1.0 - margin)) {
            return Err(Ended::Outranked);
        }
        slips.retain(|&(_, mu)| mu >= largest * (1.0 - margin));
        slips.sort_unstable_by_key(|&(load, _)| load);
        for (load, mu) in slips {
            let score = self.solve(load);
            // The first of those that tie is the answer.
            if exact
                && usable(&score).is_some_and(|found| {
                    (found - mu).abs() <= TIE * mu && found >= largest * (1.0 - TIE)
                })
            {
                break;
            }
        }
        Ok(())
    }

    /// Whether a load's `mu_s` is below a value, or what it is.
    fn compare(&mut self, load: usize, value: f64) -> Compared {
        let case = self.case;
        let (Some(pads), Refiner::Newton) = (case.pads, case.options.refiner) else {
            return self.answer(load, case.solve(load));
        };
        let (problem, options) = (case.problem, case.options(load, Search::Off));
        let scaled = pads.load(problem.distance, problem.force, &problem.wrenches[load]);
        let here = place(&scaled);
        let nearest = self.neighbours.nearest(&here);
        let apart = nearest.map_or(f32::INFINITY, |(apart, _)| apart);
        let near = nearest.map(|(_, state)| state).filter(|_| apart < LIKE);
        let keep = |neighbours: &mut Neighbours, state: Neighbour| {
            if apart > UNLIKE && neighbours.states.len() < MOST {
                neighbours.add(here, state);
            }
        };
        match below(pads, problem.force, &scaled, &options, near, value) {
            Some(Comparison::Below(state)) => {
                self.compared += 1;
                keep(&mut self.neighbours, state);
                return Compared::Below;
            }
            Some(Comparison::Solved(score, state)) if usable(&score).is_some() => {
                keep(&mut self.neighbours, state);
                return self.answer(load, score);
            }
            _ => {}
        }
        let mut start = near.map(Neighbour::start);
        let wrench = &problem.wrenches[load];
        let score = solve_next(pads, problem.distance, problem.force, wrench, &options, &mut start);
        if usable(&score).is_none() {
            return self.answer(load, case.solve(load));
        }
        if let Some(start) = start {
            keep(&mut self.neighbours, Neighbour::at(pads, &scaled, start));
        }
        self.answer(load, score)
    }

    fn answer(&mut self, load: usize, score: Score) -> Compared {
        self.solved.push((load, score));
        usable(&score).map_or(Compared::Refused, Compared::Solved)
    }

    fn solve(&mut self, load: usize) -> Score {
        let score = self.case.solve(load);
        self.solved.push((load, score));
        score
    }

    fn end(self, worst: Option<(usize, Score)>, outranked: bool) -> Scored {
        Scored {
            worst,
            all: Vec::new(),
            solved: self.solved.len(),
            compared: self.compared,
            outranked,
        }
    }

    fn outranked(self) -> Scored {
        self.end(None, true)
    }

    /// The load solved last has no limit state.
    fn refused(self) -> Scored {
        let last = self.solved.last().copied();
        self.end(last, false)
    }

    fn worst(mut self) -> Scored {
        self.solved.sort_by_key(|(load, _)| *load);
        let worst = self.case.settle(self.case.worst(&self.solved));
        self.end(worst, false)
    }
}

/// `mu_s` of congruent faces in full contact: their summed pressure is constant.
fn slip_only(pads: &Pads, problem: &Problem<'_>, load: usize, seed: Twist) -> f64 {
    let load = pads.load(problem.distance, problem.force, &problem.wrenches[load]);
    let field = Field { area: &pads.areas[0], p: [2.0 / pads.moments[0][0], 0.0, 0.0] };
    slip::solve(&[field], load.direction, Some(pads.scaled_twist(seed)), Refiner::Newton).mu
        * load.size
}

/// `mu_s` when the load is held.
pub(super) fn usable(score: &Score) -> Option<f64> {
    score.mu_s.filter(|_| score.status.holds())
}

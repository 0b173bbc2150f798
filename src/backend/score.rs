//! From seeds to final answers: the bounds decide which loads can be the worst, and only those are solved in f64.

use std::collections::HashMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::{Backend, Batch, F32_TOLERANCE, Problem, Seed, SeedSet, SeedStatus};
use crate::error::Result;
use crate::mechanics::slip::{self, Field};
use crate::mechanics::{Options, Pads, Refiner, Search, Separation, refused, solve_pads};
use crate::model::{Contact, Score, Status};

/// Values of `mu_s` that differ by less than this share count as equal, and the first load is taken as the worst:
/// answers from different seeds agree better than this.
pub(crate) const TIE: f64 = 1e-9;

/// Loads seeded at a time, which bounds the memory whatever the size of the batch.
const BLOCK: usize = 1 << 19;

/// Which loads are solved exactly.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Polish {
    /// Those that can be a grip's worst one.
    #[default]
    Worst,
    /// All of them.
    All,
}

/// How [`Backend::score`] works.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ScoreOptions {
    /// Which loads are solved.
    pub polish: Polish,
    /// What to do with grips that separate.
    pub separation: Separation,
    /// Minimiser of the exact solver.
    pub refiner: Refiner,
}

/// The answer for one grip.
#[derive(Debug, Clone, PartialEq)]
pub struct Scored {
    /// Index of the worst load and its answer: the first load without a usable `mu_s`, else the largest `mu_s`; `None`
    /// without loads.
    pub worst: Option<(usize, Score)>,
    /// Answers of all loads under [`Polish::All`], else empty.
    pub all: Vec<Score>,
    /// Loads for which the seven equations were solved.
    pub solved: usize,
    /// Loads for which the slip problem alone was solved, to tell which is the worst.
    pub compared: usize,
}

impl Backend {
    /// Scores every grip under all its loads. The answers agree to 1e-9 whichever backend computed the seeds, and do
    /// not depend on the number of threads.
    ///
    /// # Errors
    /// As [`Backend::seed`].
    pub fn score(&self, batch: &Batch<'_>, seeds: &SeedSet, options: &ScoreOptions) -> Result<Vec<Scored>> {
        let mut scored = Vec::with_capacity(batch.problems.len());
        let mut waiting: Option<(&[Problem<'_>], Vec<Seed>)> = None;
        for block in blocks(&batch.problems) {
            let batch = Batch { problems: block.to_vec() };
            // While a block is seeded, the one before is solved.
            let (found, before) = rayon::join(|| self.seed(&batch, seeds), || waiting.take().map(|(block, seeds)| solve_block(block, &seeds, options)));
            scored.extend(before.into_iter().flatten());
            waiting = Some((block, found?));
        }
        if let Some((block, seeds)) = waiting {
            scored.extend(solve_block(block, &seeds, options));
        }
        Ok(scored)
    }
}

/// Cuts the problems so that each block has at most [`BLOCK`] loads (or one problem).
fn blocks<'a, 'b>(problems: &'a [Problem<'b>]) -> Vec<&'a [Problem<'b>]> {
    let (mut blocks, mut start, mut loads) = (Vec::new(), 0, 0);
    for (index, problem) in problems.iter().enumerate() {
        if index > start && loads + problem.wrenches.len() > BLOCK {
            blocks.push(&problems[start..index]);
            (start, loads) = (index, 0);
        }
        loads += problem.wrenches.len();
    }
    if start < problems.len() {
        blocks.push(&problems[start..]);
    }
    blocks
}

fn solve_block(problems: &[Problem<'_>], seeds: &[Seed], options: &ScoreOptions) -> Vec<Scored> {
    let mut index_of: HashMap<*const Contact, usize> = HashMap::new();
    let mut distinct: Vec<&Contact> = Vec::new();
    let mut jobs = Vec::with_capacity(problems.len());
    let mut rest = seeds;
    for problem in problems {
        let slot = *index_of.entry(Arc::as_ptr(problem.contact)).or_insert_with(|| {
            distinct.push(problem.contact);
            distinct.len() - 1
        });
        let (mine, others) = rest.split_at(problem.wrenches.len());
        jobs.push((problem, slot, mine));
        rest = others;
    }
    let pads: Vec<Option<Pads>> = distinct.into_par_iter().map(Pads::new).collect();
    jobs.into_par_iter().map(|(problem, slot, seeds)| score_one(problem, pads[slot].as_ref(), seeds, options)).collect()
}

fn score_one(problem: &Problem<'_>, pads: Option<&Pads>, seeds: &[Seed], options: &ScoreOptions) -> Scored {
    let full = |load: usize, search: Search| {
        let seed = matches!(seeds[load].status, SeedStatus::Bounded | SeedStatus::Coupled | SeedStatus::Unbounded).then_some(seeds[load].twist);
        let options = Options { separation: options.separation, refiner: options.refiner, seed, search };
        match pads {
            Some(pads) => solve_pads(pads, problem.distance, problem.force, &problem.wrenches[load], &options),
            None => refused(Status::NoContact, 0),
        }
    };
    // Further solutions are looked for where a load seems to have none, and for the worst one in the end.
    let solve = |load: usize| {
        let score = full(load, Search::Off);
        if usable(&score).is_some() { score } else { full(load, Search::WhereNeeded) }
    };
    let settle =
        |worst: Option<(usize, Score)>| worst.map(|(load, score)| (load, if usable(&score).is_some() { full(load, Search::WhereNeeded) } else { score }));
    if options.polish == Polish::All {
        let all: Vec<Score> = (0..seeds.len()).into_par_iter().with_min_len(8).map(solve).collect();
        return Scored { worst: settle(worst(all.iter().copied().enumerate())), solved: all.len(), compared: 0, all };
    }
    // Loads without bounds are solved in order. One that has no limit state is the worst, whatever the others are:
    // a load with bounds has one.
    let mut solved: Vec<(usize, Score)> = Vec::new();
    let mut largest: f64 = 0.0;
    let mut bounded: Vec<usize> = Vec::with_capacity(seeds.len());
    for load in 0..seeds.len() {
        if matches!(seeds[load].status, SeedStatus::Bounded | SeedStatus::Coupled) {
            bounded.push(load);
            continue;
        }
        let score = solve(load);
        solved.push((load, score));
        match usable(&score) {
            Some(mu) => largest = largest.max(mu),
            None => return Scored { worst: Some((load, score)), all: Vec::new(), solved: solved.len(), compared: 0 },
        }
    }
    // Then the others by falling upper bound, until none can reach the largest found. For congruent faces the slip
    // problem alone decides `mu_s`: the seven equations are solved for the worst of them only.
    let floor = bounded.iter().map(|&load| seeds[load].lower).fold(largest, f64::max);
    bounded.retain(|&load| seeds[load].upper >= floor);
    bounded.sort_by(|&a, &b| seeds[b].upper.total_cmp(&seeds[a].upper).then(a.cmp(&b)));
    let mut slips: Vec<(usize, f64)> = Vec::new();
    // Ties with the largest are solved too, so that the first of them is found.
    // Congruent to rounding, not only to the single precision of the part's file.
    let exact = pads.is_some_and(|pads| pads.congruent);
    let margin = if exact { 2.0 * TIE } else { F32_TOLERANCE };
    for load in bounded {
        if seeds[load].upper < largest * (1.0 - margin) {
            break;
        }
        if let (SeedStatus::Bounded, Some(pads)) = (seeds[load].status, pads) {
            let mu = slip_only(pads, problem, load, seeds[load].twist);
            largest = largest.max(mu);
            slips.push((load, mu));
        } else {
            let score = solve(load);
            largest = largest.max(usable(&score).unwrap_or(f64::INFINITY));
            solved.push((load, score));
        }
    }
    let compared = slips.len();
    slips.retain(|&(_, mu)| mu >= largest * (1.0 - margin));
    slips.sort_unstable_by_key(|&(load, _)| load);
    for (load, mu) in slips {
        let score = solve(load);
        solved.push((load, score));
        // The first of those that tie is the answer.
        if exact && usable(&score).is_some_and(|found| (found - mu).abs() <= TIE * mu && found >= largest * (1.0 - TIE)) {
            break;
        }
    }
    solved.sort_by_key(|(load, _)| *load);
    Scored { solved: solved.len(), compared, worst: settle(worst(solved.into_iter())), all: Vec::new() }
}

/// `mu_s` of congruent faces in full contact: their summed pressure is constant.
fn slip_only(pads: &Pads, problem: &Problem<'_>, load: usize, seed: [f64; 3]) -> f64 {
    let load = pads.load(problem.distance, problem.force, &problem.wrenches[load]);
    let field = Field { area: &pads.areas[0], p: [2.0 / pads.moments[0][0], 0.0, 0.0] };
    slip::solve(&[field], load.direction, Some(pads.scaled_twist(seed)), Refiner::Newton).mu * load.size
}

/// `mu_s` when the load is held.
fn usable(score: &Score) -> Option<f64> {
    score.mu_s.filter(|_| score.status.holds())
}

/// The worst of some answers given by rising load index: the first without a usable `mu_s`, else the largest `mu_s`;
/// of those within [`TIE`] of the largest the first.
pub fn worst(scores: impl Iterator<Item = (usize, Score)> + Clone) -> Option<(usize, Score)> {
    if let Some(refused) = scores.clone().find(|(_, score)| usable(score).is_none()) {
        return Some(refused);
    }
    let largest = scores.clone().filter_map(|(_, score)| usable(&score)).fold(0.0, f64::max);
    scores.clone().find(|(_, score)| usable(score).is_some_and(|mu| mu >= largest * (1.0 - TIE)))
}

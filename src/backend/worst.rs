//! The worst load of one grip, found with as few loads solved as bounds allow: loads without bounds
//! get some from Newton's first steps, and only those that can be the worst are solved.

use std::collections::HashMap;

use super::problem::{F32_TOLERANCE, SeedStatus};
use super::score::{Case, Scored, TIE, usable};
use crate::contact::{Field, PlaneWrench, Twist};
use crate::mechanics::{
    Comparer, Comparison, Load, Neighbour, Pads, Question, Search, abreast, slip, solve_next,
};
use crate::model::Score;
use crate::request::Refiner;

/// What has been solved of a grip so far.
pub(super) struct Work<'a> {
    case: &'a Case<'a>,
    solved: Vec<(usize, Score)>,
    compared: usize,
    neighbours: Neighbours,
    comparer: Option<Comparer<'a>>,
    open: Open,
}

/// What is known of the largest `mu_s` before the loads that can have it are solved.
#[derive(Default)]
struct Open {
    /// It is at least this.
    floor: f64,
    /// The largest that was solved.
    largest: f64,
    /// Loads to be solved unless another one's is larger, with what theirs is at most.
    loads: Vec<(usize, f64)>,
}

impl Open {
    /// A load whose `mu_s` is less than this is not the worst, and does not tie with it.
    fn value(&self) -> f64 {
        self.floor.max(self.largest) * (1.0 - 2.0 * TIE)
    }
}

/// Bounds on a load's `mu_s` need not be closer together than this share: those of the loads that
/// follow the worst lie farther apart.
const SHARP: f64 = 2e-4;

/// Loads with bounds from which on closer ones are made of several at a time.
const MANY: usize = 3;

/// What one more load came to.
enum Compared {
    /// Its `mu_s` is less than the value asked about.
    Below,
    /// Its `mu_s` is at least the one and at most the other.
    Between([f64; 2]),
    /// Its `mu_s`.
    Solved(f64),
    /// It is not held.
    Refused,
}

/// Why a grip's loads are not all looked at.
pub(super) enum Ended {
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
const MOST: usize = 128;
/// Square of the distance in units of the gripping force from which on a load's state is kept.
const UNLIKE: f32 = 0.05 * 0.05;
/// Square of the distance up to which a state helps.
const LIKE: f32 = 0.5 * 0.5;

impl Neighbours {
    /// The index of the nearest state, with the square of its distance.
    fn nearest(&mut self, place: &[f32; 6]) -> Option<(f32, usize)> {
        self.apart.clear();
        self.apart.resize(self.states.len(), 0.0);
        for (all, x) in self.places.iter().zip(place) {
            for (apart, other) in self.apart.iter_mut().zip(all) {
                *apart += (x - other) * (x - other);
            }
        }
        let least = self.apart.iter().fold(f32::INFINITY, |least, &apart| least.min(apart));
        // Eight at a time, without a way out between them.
        let has = |some: &[f32]| some.iter().fold(false, |has, &apart| has | (apart == least));
        let first = 8 * self.apart.chunks(8).position(has)?;
        let within = self.apart[first..].iter().position(|&apart| apart == least)?;
        Some((least, first + within))
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

impl<'a> Work<'a> {
    /// On a grip of which nothing is known yet.
    pub(super) fn new(case: &'a Case<'a>) -> Self {
        Self {
            case,
            solved: Vec::new(),
            compared: 0,
            neighbours: Neighbours::default(),
            comparer: case.pads.map(|pads| Comparer::new(pads, case.problem.force)),
            open: Open::default(),
        }
    }
}

impl Work<'_> {
    /// Takes it that some load's `mu_s` is at least this.
    pub(super) fn at_least(&mut self, mu: f64) {
        self.open.floor = self.open.floor.max(mu);
    }

    /// Compares loads without bounds one by one, and solves those that can be the worst.
    pub(super) fn without_bounds(
        &mut self,
        loads: &[usize],
        out: &dyn Fn(f64) -> bool,
    ) -> std::result::Result<(), Ended> {
        // The one that seems to ask for most comes before them all: few of the others reach it.
        let estimate = |load: usize| self.case.seeds[load].estimate;
        let leader = loads.iter().copied().max_by(|&a, &b| estimate(a).total_cmp(&estimate(b)));
        let leader = leader.filter(|&load| {
            let solved = self.compare(load, Question { value: 0.0, sharp: 0.0 });
            if let Compared::Solved(mu) = solved {
                self.open.largest = mu;
                return true;
            }
            // Its turn comes.
            self.solved.clear();
            false
        });
        for &load in loads {
            if out(self.open.value()) {
                return Err(Ended::Outranked);
            }
            if leader != Some(load) {
                self.look(load)?;
            }
        }
        self.solve_open()?;
        if out(self.open.largest) { Err(Ended::Outranked) } else { Ok(()) }
    }

    /// Compares a load with what is known of the worst one.
    fn look(&mut self, load: usize) -> std::result::Result<(), Ended> {
        match self.compare(load, Question { value: self.open.value(), sharp: SHARP }) {
            Compared::Below => {}
            Compared::Between([least, most]) => {
                self.open.floor = self.open.floor.max(least);
                self.open.loads.push((load, most));
            }
            Compared::Solved(mu) => self.open.largest = self.open.largest.max(mu),
            Compared::Refused => return Err(Ended::Refused),
        }
        Ok(())
    }

    /// Solves those of the loads left open that can be the worst.
    fn solve_open(&mut self) -> std::result::Result<(), Ended> {
        let mut loads = std::mem::take(&mut self.open.loads);
        loads.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        for (load, most) in loads {
            let value = self.open.value();
            if most < value {
                break;
            }
            self.compared -= 1;
            match self.compare(load, Question { value, sharp: 0.0 }) {
                Compared::Below | Compared::Between(_) => {}
                Compared::Solved(mu) => self.open.largest = self.open.largest.max(mu),
                Compared::Refused => return Err(Ended::Refused),
            }
        }
        Ok(())
    }

    /// Solves loads with bounds by falling upper bound, until none can reach the largest found.
    /// For congruent faces the slip problem alone decides `mu_s`: the seven equations are solved
    /// for the worst of them only.
    pub(super) fn with_bounds(
        &mut self,
        mut bounded: Vec<usize>,
        out: &dyn Fn(f64) -> bool,
    ) -> std::result::Result<(), Ended> {
        let case = self.case;
        let floor = self.open.floor.max(self.open.largest);
        bounded.retain(|&load| case.seeds[load].upper >= floor);
        let close = self.close_bounds(&bounded);
        let upper = |load: usize| {
            close.get(&load).copied().unwrap_or(f64::INFINITY).min(case.seeds[load].upper)
        };
        let (all, value) = (bounded.len(), self.open.value());
        bounded.retain(|&load| upper(load) >= value);
        self.compared += all - bounded.len();
        bounded.sort_by(|&a, &b| upper(b).total_cmp(&upper(a)).then(a.cmp(&b)));
        let mut slips: Vec<(usize, f64)> = Vec::new();
        // Ties with the largest are solved too, so that the first of them is found.
        // Congruent to rounding, not only to the single precision of the part's file.
        let exact = case.pads.is_some_and(|pads| pads.congruent);
        let margin = if exact { 2.0 * TIE } else { F32_TOLERANCE };
        let mut largest = self.open.largest;
        for load in bounded {
            if upper(load) < largest * (1.0 - margin) {
                break;
            }
            if let (SeedStatus::Bounded, Some(pads)) = (case.seeds[load].status, case.pads) {
                let mu = slip_only(pads, case, load);
                largest = largest.max(mu);
                slips.push((load, mu));
            } else if let Some(&most) = close.get(&load) {
                self.compared += 1;
                self.open.loads.push((load, most));
            } else if self.look(load).is_err() {
                // No other load is farther from being held.
                largest = f64::INFINITY;
            } else {
                largest = largest.max(self.open.floor).max(self.open.largest);
            }
        }
        if largest.is_finite() && self.solve_open().is_err() {
            largest = f64::INFINITY;
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

    /// What the `mu_s` of loads on different faces is at most, by Newton's steps on several of them
    /// side by side, where that succeeds; the largest is then known to be at least some value. On
    /// congruent faces the slip alone costs no more.
    fn close_bounds(&mut self, bounded: &[usize]) -> HashMap<usize, f64> {
        let case = self.case;
        let (Some(pads), Refiner::Newton) = (case.pads, case.options.refiner) else {
            return HashMap::new();
        };
        let coupled = |load: &&usize| case.seeds[**load].status == SeedStatus::Coupled;
        let coupled: Vec<usize> = bounded.iter().filter(coupled).copied().collect();
        if coupled.len() < MANY {
            return HashMap::new();
        }
        let ready = |&load: &usize| {
            let scaled = pads.load(case.problem.distance, case.problem.force, &case.wrench(load));
            (scaled, pads.scaled_twist(case.seeds[load].twist))
        };
        let loads: Vec<(Load, Twist)> = coupled.iter().map(ready).collect();
        let found = coupled.into_iter().zip(abreast::bounds(pads, &loads));
        let known = found.filter_map(|(load, bounds)| Some((load, bounds?)));
        known
            .map(|(load, [least, most])| {
                self.open.floor = self.open.floor.max(least);
                (load, most)
            })
            .collect()
    }

    /// What is asked about a load's `mu_s`, or what it is.
    fn compare(&mut self, load: usize, question: Question) -> Compared {
        let case = self.case;
        let (Some(pads), Some(comparer), Refiner::Newton) =
            (case.pads, &mut self.comparer, case.options.refiner)
        else {
            return self.answer(load, case.solve(load));
        };
        let (problem, options) = (case.problem, case.options(load, Search::Off));
        let scaled = pads.load(problem.distance, problem.force, &case.wrench(load));
        let here = place(&scaled);
        let nearest = self.neighbours.nearest(&here);
        let apart = nearest.map_or(f32::INFINITY, |(apart, _)| apart);
        let near =
            nearest.filter(|_| apart < LIKE).map(|(_, index)| &self.neighbours.states[index]);
        let unlike = apart > UNLIKE && self.neighbours.states.len() < MOST;
        match comparer.compare(&scaled, &options, near, question) {
            Some(Comparison::Between(bounds)) => {
                self.compared += 1;
                if unlike && let Some(state) = comparer.reached() {
                    self.neighbours.add(here, state);
                }
                let below = bounds[1] < question.value;
                return if below { Compared::Below } else { Compared::Between(bounds) };
            }
            Some(Comparison::Solved(score)) if usable(&score).is_some() => {
                if unlike && let Some(state) = comparer.reached() {
                    self.neighbours.add(here, state);
                }
                return self.answer(load, score);
            }
            _ => {}
        }
        let mut start = near.map(Neighbour::start);
        let wrench = &case.wrench(load);
        let score = solve_next(pads, problem.distance, problem.force, wrench, &options, &mut start);
        if usable(&score).is_none() {
            return self.answer(load, case.solve(load));
        }
        if unlike && let Some(state) = start.and_then(|start| Neighbour::at(pads, &scaled, start)) {
            self.neighbours.add(here, state);
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
            worst: worst.map(|worst| self.case.numbered(worst)),
            all: Vec::new(),
            solved: self.solved.len(),
            compared: self.compared,
            outranked,
        }
    }

    pub(super) fn outranked(self) -> Scored {
        self.end(None, true)
    }

    /// The load solved last has no limit state.
    pub(super) fn refused(self) -> Scored {
        let last = self.solved.last().copied();
        self.end(last, false)
    }

    pub(super) fn worst(mut self) -> Scored {
        self.solved.sort_by_key(|(load, _)| *load);
        let worst = self.case.settle(self.case.worst(&self.solved));
        self.end(worst, false)
    }
}

/// `mu_s` of congruent faces in full contact: their summed pressure is constant.
fn slip_only(pads: &Pads, case: &Case<'_>, load: usize) -> f64 {
    let (problem, seed) = (case.problem, case.seeds[load].twist);
    let load = pads.load(problem.distance, problem.force, &case.wrench(load));
    let field = Field { area: &pads.areas[0], p: [2.0 / pads.moments[0][0], 0.0, 0.0] };
    slip::solve(&[field], load.direction, Some(pads.scaled_twist(seed)), Refiner::Newton).mu
        * load.size
}

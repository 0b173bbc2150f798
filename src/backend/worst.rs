//! The worst load of one grip, found with as few loads solved as bounds allow: loads without bounds
//! get some from Newton's first steps, and only those that can be the worst are solved.

use std::collections::HashMap;

use super::neighbours::{LIKE, Neighbours, place};
use super::problem::{F32_TOLERANCE, SeedStatus};
use super::score::{Case, Scored, TIE, usable};
use crate::contact::{ABREAST, Field, Twist};
use crate::mechanics::{
    Comparer, Comparison, Load, Neighbour, Pads, Question, Search, abreast, nearby, slip,
    solve_next,
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
    /// Loads that are not seen to be held by the friction `open.floor`, where these are wanted.
    wanted: Option<Vec<usize>>,
    /// Loads solved at which it ends.
    most: usize,
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

/// Loads that wait until several can be compared at once.
#[derive(Default)]
struct Waiting {
    scaled: Vec<Load>,
    more: Vec<One>,
}

impl Waiting {
    fn len(&self) -> usize {
        self.more.len()
    }
}

/// One of them.
struct One {
    load: usize,
    here: [f32; 6],
    /// How far the state of the nearest load is, and which it is.
    apart: f32,
    near: usize,
}

/// Loads whose turn has come, but that are not settled.
#[derive(Default)]
struct Queue {
    waiting: Waiting,
    /// Those of which nothing was found out at first.
    again: Vec<usize>,
}

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
    /// More loads had to be solved than are wont to be.
    Hard,
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
            wanted: None,
            most: usize::MAX,
        }
    }
}

impl Work<'_> {
    /// Ends once this many loads had to be solved.
    pub(super) fn at_most(&mut self, loads: usize) {
        self.most = loads;
    }

    /// Takes it that some load's `mu_s` is at least this.
    pub(super) fn at_least(&mut self, mu: f64) {
        self.open.floor = self.open.floor.max(mu);
    }

    /// Compares loads without bounds one by one, the `leader` before all others, and solves those that
    /// can be the worst.
    pub(super) fn without_bounds(
        &mut self,
        loads: &[usize],
        leader: Option<usize>,
        out: &dyn Fn(f64) -> bool,
    ) -> std::result::Result<(), Ended> {
        if let Some(leader) = leader {
            match self.compare(leader, Question::of(0.0, 0.0)) {
                Compared::Solved(mu) => self.open.largest = mu,
                _ => return Err(Ended::Refused),
            }
        }
        self.through(loads, leader, out, &mut Queue::default())?;
        self.solve_open()?;
        if out(self.open.largest) { Err(Ended::Outranked) } else { Ok(()) }
    }

    /// Of the loads without a limit state the one whose turn comes first, if there are any: of those
    /// before it it is enough to see that they are held.
    pub(super) fn first_refused(mut self, loads: &[usize]) -> Option<Scored> {
        self.at_least(f64::INFINITY);
        let mut queue = Queue::default();
        let Err(Ended::Refused) = self.through(loads, None, &|_| false, &mut queue) else {
            return None;
        };
        self.refused_before(loads, &queue);
        Some(self.refused())
    }

    /// Looks at loads in their turn, several at a time where the states of loads like them are known.
    fn through(
        &mut self,
        loads: &[usize],
        leader: Option<usize>,
        out: &dyn Fn(f64) -> bool,
        queue: &mut Queue,
    ) -> std::result::Result<(), Ended> {
        for &load in loads {
            if out(self.open.value()) {
                return Err(Ended::Outranked);
            }
            if self.solved.len() >= self.most {
                return Err(Ended::Hard);
            }
            if leader == Some(load) {
                continue;
            }
            let known = self.beside(load, &mut queue.waiting);
            if !known || queue.waiting.len() == ABREAST {
                self.look_at(queue, false)?;
            }
            if !known {
                self.look(load)?;
            }
            if queue.again.len() >= ABREAST {
                self.look_again(queue)?;
            }
        }
        self.look_at(queue, false)?;
        self.look_again(queue)
    }

    /// A load and the state of one like it to those that wait; whether there is such a state.
    fn beside(&self, load: usize, waiting: &mut Waiting) -> bool {
        let (case, Some(pads)) = (self.case, self.case.pads) else { return false };
        let scaled = pads.load(case.problem.distance, case.problem.force, &case.wrench(load));
        let here = place(&scaled);
        let near = self.neighbours.nearest(&here).filter(|&(apart, _)| apart < LIKE);
        if let Some((apart, near)) = near {
            waiting.scaled.push(scaled);
            waiting.more.push(One { load, here, apart, near });
        }
        near.is_some()
    }

    /// Loads that did not succeed at first, beside the states found in the meantime.
    fn look_again(&mut self, queue: &mut Queue) -> std::result::Result<(), Ended> {
        let again = std::mem::take(&mut queue.again);
        for (count, &load) in again.iter().enumerate() {
            self.beside(load, &mut queue.waiting);
            if queue.waiting.len() == ABREAST || count + 1 == again.len() {
                let ended = self.look_at(queue, true);
                if ended.is_err() {
                    queue.again.extend(&again[count + 1..]);
                    return ended;
                }
            }
        }
        Ok(())
    }

    /// Compares the loads that wait with what is known of the worst one.
    fn look_at(&mut self, queue: &mut Queue, patient: bool) -> std::result::Result<(), Ended> {
        let Waiting { scaled, more } = &mut queue.waiting;
        let question = self.question();
        let mut found = [None; ABREAST];
        // One or two go faster one by one.
        if let (Some(comparer), [first, _, _, ..]) = (&mut self.comparer, &more[..]) {
            let near = |i: usize| &self.neighbours.states[more[i].near];
            let options = self.case.options(first.load, Search::Off);
            found = comparer.several(scaled, near, &options, (question, patient));
        }
        let mut alone = Vec::new();
        for (i, One { load, here, apart, .. }) in more.drain(..).enumerate() {
            let Some([least, most]) = found[i] else {
                alone.push(load);
                continue;
            };
            self.compared += 1;
            if most >= question.value {
                self.keep(load, [least, most]);
            }
            // The states of those before it may be like it.
            let now = || self.neighbours.nearest(&here).map_or(f32::INFINITY, |(apart, _)| apart);
            if self.neighbours.lacks(apart)
                && self.neighbours.lacks(now())
                && let Some(comparer) = &mut self.comparer
                && let Some(state) = comparer.reached_by(i)
            {
                self.neighbours.add(here, state);
            }
        }
        scaled.clear();
        if !patient {
            queue.again.append(&mut alone);
            return Ok(());
        }
        for (count, &load) in alone.iter().enumerate() {
            if let Err(ended) = self.look(load) {
                queue.again.extend(&alone[count + 1..]);
                return Err(ended);
            }
        }
        Ok(())
    }

    /// Of the loads without a limit state the one whose turn comes first is the answer: those of the
    /// queue that were passed over come before the one found.
    fn refused_before(&mut self, loads: &[usize], queue: &Queue) {
        let Some(found) = self.solved.pop() else { return };
        let waits = |load: usize| {
            queue.again.contains(&load) || queue.waiting.more.iter().any(|one| one.load == load)
        };
        for &load in loads.iter().take_while(|&&load| load != found.0) {
            if waits(load) && self.look(load).is_err() {
                return;
            }
        }
        self.solved.push(found);
    }

    /// Whether a load can be the worst; where only those that are not held are wanted any state that
    /// holds it will do.
    fn question(&self) -> Question {
        let mut question = Question::of(self.open.value(), SHARP);
        if self.wanted.is_some() {
            question.coupling = f64::INFINITY;
        }
        question
    }

    /// Compares a load with what is known of the worst one.
    fn look(&mut self, load: usize) -> std::result::Result<(), Ended> {
        match self.compare(load, self.question()) {
            Compared::Below => {}
            Compared::Between(bounds) => self.keep(load, bounds),
            Compared::Solved(mu) => self.found(load, mu),
            Compared::Refused => return self.refuse(load),
        }
        Ok(())
    }

    /// A load that is not held ends the search, but where all of those are wanted.
    fn refuse(&mut self, load: usize) -> std::result::Result<(), Ended> {
        if self.wanted.is_none() {
            return Err(Ended::Refused);
        }
        self.want(load);
        Ok(())
    }

    fn want(&mut self, load: usize) {
        self.wanted.get_or_insert_default().push(load);
    }

    /// A load whose `mu_s` is at least the one and at most the other is to be solved, perhaps.
    fn keep(&mut self, load: usize, [least, most]: [f64; 2]) {
        if self.wanted.is_none() {
            self.open.floor = self.open.floor.max(least);
        } else if least > self.open.floor {
            return self.want(load);
        }
        self.open.loads.push((load, most));
    }

    /// A load's `mu_s`.
    fn found(&mut self, load: usize, mu: f64) {
        if self.wanted.is_none() {
            self.open.largest = self.open.largest.max(mu);
        } else if mu > self.open.floor {
            self.want(load);
        }
    }

    /// Loads that are not soon seen to be held by `friction`: see [`super::Backend::exceeding`].
    pub(super) fn exceeding(
        mut self,
        friction: f64,
        open: &[usize],
        bounded: &[usize],
    ) -> Vec<usize> {
        self.at_least(friction);
        self.wanted = Some(Vec::new());
        let value = friction * (1.0 - F32_TOLERANCE);
        let mut looked = self.through(open, None, &|_| false, &mut Queue::default());
        for &load in bounded {
            let (case, seed) = (self.case, &self.case.seeds[load]);
            let known = seed.status == SeedStatus::Bounded;
            let slips = |pads| !known || slip_only(pads, case, load) > value;
            if seed.upper > value && case.pads.is_none_or(slips) {
                looked = looked.and_then(|()| self.look(load));
            }
        }
        let looked = looked.and_then(|()| self.solve_open());
        debug_assert!(looked.is_ok(), "nothing ends it");
        self.wanted.unwrap_or_default()
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
            match self.compare(load, Question { sharp: 0.0, ..self.question() }) {
                Compared::Below | Compared::Between(_) => {}
                Compared::Solved(mu) => self.found(load, mu),
                Compared::Refused => self.refuse(load)?,
            }
        }
        Ok(())
    }

    /// Solves loads with bounds by falling upper bound, until none can reach the largest found.
    /// For congruent faces the slip problem alone decides `mu_s`: the seven equations are solved
    /// for the worst of them only.
    pub(super) fn with_bounds(
        &mut self,
        bounded: &[usize],
        out: &dyn Fn(f64) -> bool,
    ) -> std::result::Result<(), Ended> {
        let case = self.case;
        let floor = self.open.floor.max(self.open.largest);
        let reaches = |load: &usize| case.seeds[*load].upper >= floor;
        let mut bounded: Vec<usize> = bounded.iter().copied().filter(reaches).collect();
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
        let unlike = self.neighbours.lacks(apart);
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
        let answer = if self.wanted.is_some() {
            let Some(mu) = nearby(pads, &scaled, &options, &mut start) else {
                return Compared::Refused;
            };
            Compared::Solved(mu)
        } else {
            let (distance, force, wrench) = (problem.distance, problem.force, case.wrench(load));
            let score = solve_next(pads, distance, force, &wrench, &options, &mut start);
            if usable(&score).is_none() {
                return self.answer(load, case.solve(load));
            }
            self.answer(load, score)
        };
        if unlike && let Some(state) = start.and_then(|start| Neighbour::at(pads, &scaled, start)) {
            self.neighbours.add(here, state);
        }
        answer
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

//! Grips on what is not plane: on the processor, the loads that can be the worst solved to the end.
//!
//! The seed stage knows the twists of planes only. Here a load begins at the state of another one
//! ([`Screen`]), and those that stay below the worst are left before their solution. Where loads cannot
//! be compared all are solved, those first that may be the worst.

use rayon::prelude::*;

use super::score::{Exceeding, Scored, TIE, usable};
use super::top::{Beaten, Best, race};
use super::watch::Watch;
use crate::mechanics::curved::{Compared, Pads, Screen};
use crate::mechanics::refused;
use crate::model::{Score, Status, Wrench};
use crate::request::Polish;

/// A grip on surfaces and its loads.
#[derive(Debug, Clone, Copy)]
pub struct CurvedProblem<'a> {
    /// The surfaces made ready; `None` where there is no contact.
    pub pads: Option<&'a Pads>,
    /// Height of face I over face II \[m\], negative from inside.
    pub distance: f64,
    /// Gripping force \[N\].
    pub force: f64,
    /// Loads in the grip frame about its origin.
    pub wrenches: &'a [Wrench],
}

/// The worst load of each grip, in order; under [`Polish::All`] all of them. The answers do not
/// depend on the number of threads.
pub fn score_curved(problems: &[CurvedProblem<'_>], polish: Polish) -> Vec<Scored> {
    problems.par_iter().map(|problem| problem.polished(polish)).collect()
}

/// As [`super::Backend::exceeding`], all loads but the `known` ones looked at.
pub(crate) fn exceeding_curved(
    problems: &[CurvedProblem<'_>],
    friction: f64,
    known: &[&[usize]],
) -> Vec<Exceeding> {
    let exceeding =
        |(problem, known): (&CurvedProblem<'_>, &&[usize])| problem.exceeding(friction, known);
    problems.par_iter().zip(known).map(exceeding).collect()
}

/// As [`score_curved`], as far as `watch` does not stop it: `None` for the other grips. With `best`
/// those that cannot be among them are outranked under their worst loads, as
/// [`super::Backend::score_best`] has it; `merit` as there.
pub(crate) fn score_curved_watched(
    problems: &[CurvedProblem<'_>],
    polish: Polish,
    best: Option<&mut Best>,
    merit: &(dyn Fn(usize, f64) -> f64 + Sync),
    watch: &Watch<'_>,
) -> Vec<Option<Scored>> {
    let Some(best) = best else {
        let polished = |problem: &CurvedProblem<'_>| watch.scored(|| problem.polished(polish));
        return problems.par_iter().map(polished).collect();
    };
    let promise = |(index, problem): (usize, &CurvedProblem<'_>)| merit(index, problem.about());
    let promise = problems.par_iter().enumerate().map(promise).collect();
    let score =
        |index: usize, beaten: &Beaten<'_>| watch.scored(|| problems[index].score(Some(beaten)));
    race(promise, best, merit, &score)
}

/// Loads looked at so far.
#[derive(Default)]
struct Seen {
    /// Held, with their `mu_s` but for rounding.
    near: Vec<(usize, f64)>,
    /// Solved, but for other limit states of those in `first`.
    solved: Vec<(usize, Score)>,
    first: Vec<usize>,
    compared: usize,
}

impl Seen {
    fn outranked(self) -> Scored {
        let (solved, compared) = (self.solved.len(), self.compared);
        Scored { worst: None, all: Vec::new(), solved, compared, outranked: true }
    }
}

impl CurvedProblem<'_> {
    /// About the `mu_s` of the worst load, for the order of grips.
    fn about(&self) -> f64 {
        let lever = self.lever();
        self.wrenches.iter().map(|wrench| self.roughly(wrench, lever)).fold(0.0, f64::max)
    }

    /// Lever of friction that turns about the closing axis, about \[m\].
    fn lever(&self) -> f64 {
        self.pads.map_or(f64::INFINITY, |pads| 0.5 * pads.reach())
    }

    /// About the `mu_s` of a load.
    fn roughly(&self, wrench: &Wrench, lever: f64) -> f64 {
        let slide = wrench.force.x.hypot(wrench.force.y);
        slide.hypot(wrench.moment.z / lever) / (2.0 * self.force - wrench.force.z.abs())
    }

    fn solve(&self, load: usize) -> Score {
        self.solve_by(load, Pads::score)
    }

    fn solve_by(&self, load: usize, by: fn(&Pads, f64, f64, &Wrench) -> Score) -> Score {
        match self.pads {
            Some(pads) => by(pads, self.distance, self.force, &self.wrenches[load]),
            None => refused(Status::NoContact, 0),
        }
    }

    fn polished(&self, polish: Polish) -> Scored {
        if polish == Polish::All { self.score_all() } else { self.score(None) }
    }

    fn score_all(&self) -> Scored {
        let all: Vec<Score> = (0..self.wrenches.len())
            .into_par_iter()
            .with_min_len(8)
            .map(|load| self.solve(load))
            .collect();
        let worst = worst(all.iter().copied().enumerate());
        Scored { worst, solved: all.len(), all, compared: 0, outranked: false }
    }

    /// The worst load from few solutions, or from all where loads cannot be compared. `beaten`: whether a
    /// grip of at least this `mu_s` need not be solved to the end.
    fn score(&self, beaten: Option<&Beaten<'_>>) -> Scored {
        let Self { pads, distance, force, wrenches } = *self;
        self.compared(pads.and_then(|pads| pads.screen(distance, force, wrenches)), beaten)
    }

    fn compared(&self, mut screen: Option<Screen<'_>>, beaten: Option<&Beaten<'_>>) -> Scored {
        let order = self.by_estimate(screen.as_ref());
        let (mut seen, mut largest) = (Seen::default(), 0.0);
        for (place, &load) in order.iter().enumerate() {
            match self.held(&mut screen, load, largest * (1.0 - 2.0 * TIE), &mut seen) {
                Some(mu) => {
                    largest = f64::max(largest, mu);
                    if beaten.is_some_and(|beaten| beaten(largest)) {
                        return seen.outranked();
                    }
                }
                None => return self.first_refused(&mut screen, &order[place..], seen),
            }
        }
        // The first of those that tie is the answer.
        seen.near.retain(|&(_, mu)| mu >= largest * (1.0 - 2.0 * TIE));
        seen.near.sort_by_key(|&(load, _)| load);
        for (load, mu) in std::mem::take(&mut seen.near) {
            let score = self.solve(load);
            seen.solved.push((load, score));
            let found = usable(&score).filter(|found| (found - mu).abs() <= TIE * mu);
            let Some(found) = found else { return self.compared(None, beaten) };
            if found >= largest * (1.0 - TIE) {
                break;
            }
        }
        seen.solved.sort_by_key(|&(load, _)| load);
        let Seen { solved, compared, first, .. } = seen;
        let whole = |(load, score)| {
            let score = if first.contains(&load) { self.solve(load) } else { score };
            (load, score)
        };
        let worst = worst(solved.iter().copied()).map(whole);
        Scored { worst, all: Vec::new(), solved: solved.len(), compared, outranked: false }
    }

    fn exceeding(&self, friction: f64, known: &[usize]) -> Exceeding {
        let Self { pads, distance, force, wrenches } = *self;
        let screen = pads.and_then(|pads| pads.screen(distance, force, wrenches));
        let mut screen = screen.map(Screen::by_any_state);
        let mut found = Exceeding::default();
        for load in self.by_estimate(screen.as_ref()) {
            if known.contains(&load) {
                continue;
            }
            let held = match self.compare(&mut screen, load, friction) {
                Compared::Below => true,
                Compared::At(mu) => mu <= friction,
                Compared::Open => false,
            };
            if !held {
                found.loads.push(load);
            }
        }
        found
    }

    /// Loads, the one first that seems to ask for most.
    fn by_estimate(&self, screen: Option<&Screen<'_>>) -> Vec<usize> {
        let lever = self.lever();
        let estimate = |wrench: &Wrench| match screen {
            Some(screen) => screen.estimate(wrench),
            None => self.roughly(wrench, lever),
        };
        let estimates: Vec<f64> = self.wrenches.iter().map(estimate).collect();
        let mut order: Vec<usize> = (0..self.wrenches.len()).collect();
        order.sort_by(|&a, &b| estimates[b].total_cmp(&estimates[a]).then(a.cmp(&b)));
        order
    }

    fn compare(&self, screen: &mut Option<Screen<'_>>, load: usize, value: f64) -> Compared {
        match screen {
            Some(screen) => screen.compare(&self.wrenches[load], value),
            None => Compared::Open,
        }
    }

    /// At least the `mu_s` of a load that is held, or no more than `value`.
    fn held(
        &self,
        screen: &mut Option<Screen<'_>>,
        load: usize,
        value: f64,
        seen: &mut Seen,
    ) -> Option<f64> {
        match self.compare(screen, load, value) {
            Compared::Below => {
                seen.compared += 1;
                Some(0.0)
            }
            Compared::At(mu) => {
                seen.compared += 1;
                seen.near.push((load, mu));
                Some(mu)
            }
            Compared::Open => {
                let score = self.solve_by(load, Pads::score_first);
                seen.first.push(load);
                seen.solved.push((load, score));
                usable(&score)
            }
        }
    }

    /// The answer where the first load of `rest` is not held: it, or one before it by number.
    fn first_refused(
        &self,
        screen: &mut Option<Screen<'_>>,
        rest: &[usize],
        mut seen: Seen,
    ) -> Scored {
        let mut open: Vec<usize> = rest[1..].iter().copied().filter(|&x| x < rest[0]).collect();
        open.sort_unstable();
        open.into_iter().find(|&load| self.held(screen, load, 0.0, &mut seen).is_none());
        let worst = seen.solved.last().copied();
        let Seen { solved, compared, .. } = seen;
        let refused = solved.iter().filter(|(_, score)| usable(score).is_none());
        let worst = refused.min_by_key(|(load, _)| *load).copied().or(worst);
        Scored { worst, all: Vec::new(), solved: solved.len(), compared, outranked: false }
    }
}

/// Of loads by rising number: the first that is not held, else the first of the largest `mu_s`.
fn worst(scores: impl Iterator<Item = (usize, Score)>) -> Option<(usize, Score)> {
    let mut worst: Option<(usize, Score)> = None;
    for (load, score) in scores {
        let Some(mu) = usable(&score) else { return Some((load, score)) };
        let known = worst.as_ref().and_then(|(_, known)| usable(known));
        if known.is_none_or(|known| mu > known * (1.0 + TIE)) {
            worst = Some((load, score));
        }
    }
    worst
}

//! The gripping force that a grip needs: that of the one of all its loads that needs most.
//!
//! The load that is the worst at the plan's force need not be it: with less force one that hardly
//! counted can lift a pad and twist the part out. So the forces of likely loads are found first, and
//! all loads are looked at with the greatest of them; where some are not soon seen to be held, theirs
//! are taken, until none is left. A load held with some force and with the plan's counts as held with
//! all between.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::assess::{Assessor, LOADS_AT_ONCE, Surfaced};
use crate::backend::{Batch, CurvedProblem, Exceeding, Problem, ScoreOptions, exceeding_curved};
use crate::error::Result;
use crate::mechanics::twist_out::TwistOut;
use crate::mechanics::{Options, Pads, Search, curved, inverse, solve_pads};
use crate::model::Wrench;
use crate::results::{PadFriction, RankedGrip};

/// Share of the force by which more is tried than what a load needs.
const MORE: f64 = 1e-6;
/// Time between two looks at whether to stop.
const BLOCK: Duration = Duration::from_secs(1);
/// A load that twists out at this share of the force, were it not for friction, is likely to need more.
const LIKELY: f64 = 0.7;

/// A grip whose force is looked for.
struct Open<'a> {
    /// Which of the list it is.
    index: usize,
    ranked: &'a RankedGrip,
    on: On<'a>,
    /// What the loads looked at so far need \[N\].
    force: f64,
    /// Loads whose own force is known: they are held with every larger one.
    known: Vec<usize>,
    /// The loads that are still to be looked at; `None`: all but those known.
    asked: Option<Vec<usize>>,
}

/// A contact made ready.
enum On<'a> {
    Planes(Box<Pads>),
    Surfaces(&'a curved::Pads),
}

/// What a look at the loads has come to.
enum Looked {
    /// The force, if there is one that holds them all.
    Done(Option<f64>),
    /// They are to be looked at again.
    Again,
}

impl Assessor<'_> {
    /// As [`Self::finish`], those of the ids `first` before the `others`, if they are wanted, and these until
    /// `stop` becomes true; how many of them are left. `told`: how many are done.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub(super) fn finish_until(
        &self,
        grips: &mut [RankedGrip],
        (first, others): (&[u64], bool),
        stop: &AtomicBool,
        told: &mut dyn FnMut(usize),
    ) -> Result<usize> {
        let first: FxHashSet<u64> = first.iter().copied().collect();
        let mut open: Vec<&mut RankedGrip> = grips.iter_mut().collect();
        open.sort_by_key(|ranked| !first.contains(&ranked.grip.id));
        if !others {
            open.truncate(first.len());
        }
        let (mut done, mut left, mut size) = (0, 0, first.len().max(1));
        while done < open.len() {
            let stopped = || done > 0 && stop.load(Ordering::Relaxed);
            if stopped() {
                return Ok(left + open.len() - done);
            }
            told(done);
            let begun = Instant::now();
            let end = open.len().min(done + size);
            left += self.finish_block(&mut open[done..end], &stopped)?;
            let share = BLOCK.as_secs_f64() / begun.elapsed().as_secs_f64().max(1e-9);
            size = ((end - done) as f64 * share.clamp(0.25, 4.0)).ceil() as usize;
            done = end;
        }
        Ok(left)
    }

    /// Adds what only the grips of the final list need: the gripping force at which the friction with
    /// the safety asked for just holds every load, and the largest multiple of the loads; of contacts
    /// that are not plane also what each face carries under the worst load.
    ///
    /// The force of the worst load is as [`inverse`] and [`curved::force_needed`] have it. Of the other
    /// loads only those limit states count that a load comes to as it grows, which errs towards more.
    ///
    /// # Errors
    /// As [`crate::backend::Backend::score`].
    pub fn finish(&self, grips: &mut [RankedGrip]) -> Result<()> {
        let left = self.finish_block(&mut grips.iter_mut().collect::<Vec<_>>(), &|| false)?;
        debug_assert!(left == 0, "nothing stops it");
        Ok(())
    }

    /// How many are left once it is `stopped`.
    fn finish_block(
        &self,
        grips: &mut [&mut RankedGrip],
        stopped: &(dyn Fn() -> bool + Sync),
    ) -> Result<usize> {
        let force = self.settings.force;
        let ready = Surfaced::new(grips.iter().map(|ranked| &ranked.grip), force);
        grips.par_iter_mut().with_max_len(1).for_each(|ranked| {
            let (distance, wrench) = (ranked.grip.distance(), &ranked.worst.wrench);
            if let Some(ready) = ready.of(&ranked.grip) {
                let answer = ready.pads.solve_again(distance, force, wrench, ranked.worst.status);
                (ranked.faces, ranked.notes) = (answer.faces, answer.notes);
            }
        });
        let PadFriction { value: Some(friction), safety } = self.settings.pads else {
            return Ok(0);
        };
        let needed = self.forces_needed(grips, &ready, friction / safety, stopped)?;
        let plain = match safety {
            1.0 => needed.clone(),
            _ => self.forces_needed(grips, &ready, friction, stopped)?,
        };
        let mut left = 0;
        for ((ranked, needed), plain) in grips.iter_mut().zip(needed).zip(plain) {
            let (Some(needed), Some(plain)) = (needed, plain) else {
                left += 1;
                continue;
            };
            ranked.force_needed = needed;
            let multiple = plain.map_or(0.0, |needed| force / needed);
            ranked.load_multiple = multiple.is_finite().then_some(multiple);
        }
        Ok(left)
    }

    /// The force \[N\] of each grip, `None` where none holds all loads; of those looked at before it is
    /// `stopped`.
    fn forces_needed(
        &self,
        grips: &[&mut RankedGrip],
        ready: &Surfaced,
        friction: f64,
        stopped: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Option<Option<f64>>>> {
        let mut found = vec![None; grips.len()];
        let begun: Vec<Option<Option<Open<'_>>>> = (grips.par_iter().enumerate().with_max_len(1))
            .map(|(index, ranked)| (!stopped()).then(|| self.begun(index, ranked, ready, friction)))
            .collect();
        let mut open = Vec::new();
        for (index, begun) in begun.into_iter().enumerate() {
            match begun {
                None => {}
                Some(None) => found[index] = Some(None),
                // Without any load.
                Some(Some(begun)) if begun.force == 0.0 => found[index] = Some(Some(0.0)),
                Some(Some(begun)) => open.push(begun),
            }
        }
        let most = (LOADS_AT_ONCE / self.loads.len().max(1)).max(1);
        while !open.is_empty() {
            let mut left = Vec::new();
            let mut rest = open.into_iter().peekable();
            while rest.peek().is_some() && !stopped() {
                let block: Vec<Open<'_>> = rest.by_ref().take(most).collect();
                let exceeding = self.exceeding(&block, friction)?;
                let looked: Vec<(Open<'_>, Looked)> = block
                    .into_par_iter()
                    .with_max_len(1)
                    .zip(exceeding)
                    .map(|(mut open, exceeding)| {
                        let looked = self.follow(&mut open, exceeding, friction);
                        (open, looked)
                    })
                    .collect();
                for (open, looked) in looked {
                    match looked {
                        Looked::Done(force) => found[open.index] = Some(force),
                        Looked::Again => left.push(open),
                    }
                }
            }
            open = left;
        }
        Ok(found)
    }

    /// Begins at the force that the worst load needs, or the one that would be the first to twist out if
    /// it were not for friction; `None` where one of them is held by no force.
    fn begun<'a>(
        &self,
        index: usize,
        ranked: &'a RankedGrip,
        ready: &'a Surfaced,
        friction: f64,
    ) -> Option<Open<'a>> {
        let on = match &ranked.grip.surfaces {
            Some(_) => On::Surfaces(&ready.of(&ranked.grip)?.pads),
            None => On::Planes(Box::new(Pads::new(&ranked.grip.contact)?)),
        };
        let worst = ranked.worst.load as usize;
        let mut open = Open { index, ranked, on, force: 0.0, known: vec![worst], asked: None };
        open.force = self.own(&open, &ranked.worst.wrench, friction, Search::WhereNeeded)?;
        if open.force == 0.0 {
            // Nothing along the pads: a load may still pull or tilt.
            for load in (0..self.loads.len()).filter(|load| *load != worst) {
                self.take(&mut open, load, friction)?;
            }
        } else if let On::Planes(_) = open.on {
            let lever = TwistOut::new(&ranked.grip.contact);
            let wrenches = self.wrenches(&ranked.grip);
            let forces: Vec<f64> = wrenches.iter().map(|wrench| lever.force(wrench)).collect();
            let first = (0..forces.len()).max_by(|&a, &b| forces[a].total_cmp(&forces[b]));
            let likely = |load: &usize| *load != worst && forces[*load] > LIKELY * open.force;
            if let Some(load) = first.filter(likely) {
                self.take(&mut open, load, friction)?;
            }
        }
        Some(open)
    }

    /// Takes the force of a load into account; `None` where it is held by none.
    fn take(&self, open: &mut Open<'_>, load: usize, friction: f64) -> Option<()> {
        let wrench = self.wrench(&open.ranked.grip, &self.loads[load]);
        let planned = self.settings.force;
        let grown =
            self.own(open, &wrench, friction, Search::Off).filter(|force| *force <= planned);
        // Every load has been looked at with the plan's force: what holds it there may be another state.
        let force = match grown {
            Some(force) => force,
            None => self.own(open, &wrench, friction, Search::WhereNeeded)?,
        };
        open.force = open.force.max(force);
        open.known.push(load);
        Some(())
    }

    /// The force that one load needs.
    fn own(&self, open: &Open<'_>, wrench: &Wrench, friction: f64, search: Search) -> Option<f64> {
        let distance = open.ranked.grip.distance();
        match &open.on {
            On::Planes(pads) => {
                let options = self.options(search);
                inverse::force_needed(pads, distance, wrench, friction, &options)
            }
            On::Surfaces(pads) => {
                curved::force_needed(pads, distance, wrench, friction, self.settings.force)
            }
        }
    }

    fn options(&self, search: Search) -> Options {
        let ScoreOptions { separation, refiner, .. } = self.settings.score;
        Options { separation, refiner, search, ..Options::default() }
    }

    /// What is left of the loads asked about of each grip.
    fn exceeding(&self, block: &[Open<'_>], friction: f64) -> Result<Vec<Exceeding>> {
        let in_part = self.in_part();
        // All loads of a grip on planes are made from those on the part.
        let seen = |open: &Open<'_>| match (&open.on, &open.asked) {
            (On::Planes(_), None) => Vec::new(),
            (On::Surfaces(_), None) => self.wrenches(&open.ranked.grip),
            (_, Some(asked)) => {
                let of = |&load: &usize| self.wrench(&open.ranked.grip, &self.loads[load]);
                asked.iter().map(of).collect()
            }
        };
        let wrenches: Vec<Vec<Wrench>> = block.par_iter().map(seen).collect();
        let (mut plane, mut curved) = (Vec::new(), Vec::new());
        let mut known: [Vec<&[usize]>; 2] = Default::default();
        for (open, wrenches) in block.iter().zip(&wrenches) {
            let (grip, force) = (&open.ranked.grip, open.force * (1.0 + MORE));
            let not_asked = if open.asked.is_none() { &open.known[..] } else { &[] };
            match open.on {
                On::Planes(_) => {
                    let all = self.problem(grip, &in_part);
                    plane.push(match open.asked {
                        None => Problem { force, ..all },
                        Some(_) => Problem { force, wrenches, pose: None, ..all },
                    });
                    known[0].push(not_asked);
                }
                On::Surfaces(pads) => {
                    let (pads, distance) = (Some(pads), grip.distance());
                    curved.push(CurvedProblem { pads, distance, force, wrenches });
                    known[1].push(not_asked);
                }
            }
        }
        let (batch, score) = (Batch { problems: plane }, &self.settings.score);
        let plane = self.backend.exceeding(&batch, self.seeds, score, friction, &known[0])?;
        let curved = exceeding_curved(&curved, friction, &known[1]);
        let (mut plane, mut curved) = (plane.into_iter(), curved.into_iter());
        let of = |open: &Open<'_>| {
            let next = match open.on {
                On::Planes(_) => plane.next(),
                On::Surfaces(_) => curved.next(),
            };
            let mut found = next.unwrap_or_default();
            if let Some(asked) = &open.asked {
                found.loads.iter_mut().for_each(|load| *load = asked[*load]);
            }
            found
        };
        Ok(block.iter().map(of).collect())
    }

    /// Takes the forces of the loads that are left. Where one needs more, the others are to be looked at
    /// with that first: most are soon seen to be held then.
    fn follow(&self, open: &mut Open<'_>, left: Exceeding, friction: f64) -> Looked {
        let before = open.force;
        let mut loads = left.loads.into_iter();
        for (place, load) in loads.by_ref().enumerate() {
            if place > 0 && self.holds(open, load, friction) {
                continue;
            }
            if self.take(open, load, friction).is_none() {
                return Looked::Done(None);
            }
            if open.force > before * (1.0 + MORE) {
                break;
            }
        }
        let rest: Vec<usize> = loads.collect();
        if !left.others || open.force <= before * (1.0 + MORE) {
            open.asked = Some(rest);
        } else if let Some(asked) = &mut open.asked {
            asked.retain(|load| !open.known.contains(load));
        }
        match &open.asked {
            Some(asked) if asked.is_empty() => Looked::Done(Some(open.force)),
            _ => Looked::Again,
        }
    }

    /// Whether a load is held with the force found so far.
    fn holds(&self, open: &Open<'_>, load: usize, friction: f64) -> bool {
        let wrench = self.wrench(&open.ranked.grip, &self.loads[load]);
        let (distance, force) = (open.ranked.grip.distance(), open.force * (1.0 + MORE));
        let score = match &open.on {
            On::Planes(pads) => {
                solve_pads(pads, distance, force, &wrench, &self.options(Search::Off))
            }
            On::Surfaces(pads) => pads.score_first(distance, force, &wrench),
        };
        score.status.holds() && score.mu_s.is_some_and(|mu| mu <= friction)
    }
}

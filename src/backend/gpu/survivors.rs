//! A batch on the graphics processor: chunk after chunk goes there, and the loads that come back get
//! their seeds; what the device leaves open the processor does.

use std::collections::HashMap;
use std::sync::OnceLock;
use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::super::cpu::Found;
use super::super::layout::{BITS, FoundRecord, KINDS, OPEN, OutcomeRecord, SeedRecord, UNWRITTEN};
use super::super::prepare::{Contacts, not_searched};
use super::super::problem::{Batch, Problem, check_grip, check_load};
use super::super::screen::{Screen, Wanted, can_be_worst, without_contact};
use super::super::seeds::SeedSet;
use super::chunk::{Maker, Piece, Plan, Spread, is_ordinary, largest, plans};
use super::{Answer, Gpu};
use crate::error::{Error, Result};
use crate::model::Wrench;

/// Grips that one task looks at, at least: a few entries each.
const TASK: usize = 16;

/// Loads of a piece with their seeds; some load's `mu_s` is at least the number.
pub(super) type Kept = (Found, f64);

impl Gpu {
    /// As [`super::super::screen::survivors`].
    pub(in super::super) fn survivors(
        &self,
        contacts: &Contacts,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        wanted: Wanted,
    ) -> Result<Vec<Found>> {
        let job = Job { gpu: self, contacts, problems: &batch.problems, seeds, wanted };
        let (users, aside) = job.sorted()?;
        let plans = plans(contacts, job.problems, users, (self.limits(), seeds.len()));
        let mut by_problem: Vec<Kept> = vec![(Found::new(), 0.0); job.problems.len()];
        let mut add = |problem: usize, (found, floor): Kept| {
            let (all, most) = &mut by_problem[problem];
            all.extend(found);
            *most = most.max(floor);
        };
        let (mut maker, mut rest) = (Maker::default(), plans.into_iter());
        let next = || {
            let plan = rest.next()?;
            let made = (contacts, job.problems);
            Some((maker.chunk(made, &plan, (seeds.len(), wanted)), plan))
        };
        self.run(seeds, next, |answer, plan| {
            for (problem, kept) in job.kept(answer, &plan)? {
                add(problem, kept);
            }
            Ok(())
        })?;
        let by_hand: Vec<(usize, Kept)> = aside
            .into_par_iter()
            .map(|index| Ok((index, job.aside(index)?)))
            .collect::<Result<_>>()?;
        by_hand.into_iter().for_each(|(problem, kept)| add(problem, kept));
        for (found, floor) in &mut by_problem {
            if wanted != Wanted::All {
                found.retain(|(_, seed)| can_be_worst(seed, *floor));
            }
            found.sort_unstable_by_key(|(load, _)| *load);
        }
        Ok(by_problem.into_iter().map(|(found, _)| found).collect())
    }
}

/// What tests ask of single steps.
#[cfg(test)]
impl Gpu {
    /// What becomes of an answer to a plan.
    pub(super) fn kept_of(
        &self,
        contacts: &Contacts,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        (answer, plan): (Answer, &Plan),
    ) -> Result<Vec<(usize, Kept)>> {
        let (problems, wanted) = (batch.problems.as_slice(), Wanted::Worst);
        Job { gpu: self, contacts, problems, seeds, wanted }.kept(Some(answer), plan)
    }
}

/// Problems that share a contact.
type Users = Vec<(usize, Vec<usize>)>;

struct Job<'a> {
    gpu: &'a Gpu,
    contacts: &'a Contacts,
    problems: &'a [Problem<'a>],
    seeds: &'a SeedSet,
    wanted: Wanted,
}

impl<'a> Job<'a> {
    /// The problems for the device, by contact, and those for the processor.
    fn sorted(&self) -> Result<(Users, Vec<usize>)> {
        // Each list is looked at once.
        let mut lists: HashMap<(*const Wrench, usize), [f64; 2]> = HashMap::new();
        let (mut aside, mut users) = (Vec::new(), vec![Vec::new(); self.contacts.ready.len()]);
        for (index, (problem, &slot)) in self.problems.iter().zip(&self.contacts.slots).enumerate()
        {
            check_grip(problem, index)?;
            let wrenches = problem.wrenches;
            let key = (wrenches.as_ptr(), wrenches.len());
            let most = match lists.get(&key) {
                Some(most) => *most,
                None => {
                    wrenches.iter().enumerate().try_for_each(|load| check_load(load, index))?;
                    *lists.entry(key).or_insert_with(|| largest(wrenches))
                }
            };
            match &self.contacts.ready[slot].records {
                Some(records) if is_ordinary(records, problem, most) => users[slot].push(index),
                _ => aside.push(index),
            }
        }
        let users = users.into_iter().enumerate().filter(|(_, users)| !users.is_empty());
        Ok((users.collect(), aside))
    }

    /// A problem that is not for the device.
    fn aside(&self, index: usize) -> Result<Kept> {
        let problem = &self.problems[index];
        let Some(records) = &self.contacts.ready[self.contacts.slots[index]].records else {
            return Ok((without_contact(problem, index)?, 0.0));
        };
        let piece = Piece { problem: index, first: 0, count: problem.wrenches.len() };
        self.on_processor(&Screen::new(records, self.seeds), piece)
    }

    fn on_processor(&self, screen: &Screen<'_>, piece: Piece) -> Result<Kept> {
        let Piece { problem: index, first, count } = piece;
        let problem = &self.problems[index];
        let spread = Spread::new(problem.wrenches.len());
        match self.wanted {
            Wanted::All => Ok((screen.searched.found(problem, index, spread.loads(&piece))?, 0.0)),
            _ if spread.is_plain() || count == problem.wrenches.len() => {
                screen.survivors(problem, index, first..first + count)
            }
            _ => {
                let wrenches: Vec<Wrench> =
                    spread.loads(&piece).map(|load| problem.wrenches[load]).collect();
                let some = Problem { wrenches: &wrenches, ..*problem };
                let (mut found, floor) = screen.survivors(&some, index, 0..count)?;
                for (load, _) in &mut found {
                    *load = spread.load(first + *load as usize) as u32;
                }
                Ok((found, floor))
            }
        }
    }

    /// The loads of a chunk that are wanted, by problem; without an answer the processor finds them.
    fn kept(&self, answer: Option<Answer>, plan: &Plan) -> Result<Vec<(usize, Kept)>> {
        let pieces: Vec<(usize, Piece)> = (0..)
            .zip(plan)
            .flat_map(|(place, (_, pieces))| pieces.iter().map(move |&piece| (place, piece)))
            .collect();
        // Made where a grip asks for it.
        let screens: Vec<OnceLock<Screen<'a>>> = plan.iter().map(|_| OnceLock::new()).collect();
        let screen = |place: usize| {
            let records = self.contacts.ready[plan[place].0].records.as_ref();
            let made = |records| screens[place].get_or_init(|| Screen::new(records, self.seeds));
            records.map(made).ok_or_else(|| Error::device("a chunk has a contact without records"))
        };
        let Some(Answer { outcomes, mut entries }) = answer else {
            let alone = |&(place, piece): &(usize, Piece)| {
                Ok((piece.problem, self.on_processor(screen(place)?, piece)?))
            };
            return pieces.par_iter().map(alone).collect();
        };
        // In which order the device found them says nothing.
        entries.par_sort_unstable_by_key(|entry| (entry.grip, entry.load));
        let of_grip = |grip: u32| {
            let end = entries.partition_point(|entry| entry.grip <= grip);
            &entries[entries.partition_point(|entry| entry.grip < grip)..end]
        };
        if outcomes.len() != pieces.len() {
            return Err(Error::device(format!("only {} answers came back", outcomes.len())));
        }
        (0..pieces.len() as u32)
            .into_par_iter()
            .with_min_len(TASK)
            .map(|grip| {
                let (place, piece) = pieces[grip as usize];
                let (outcome, entries) = (outcomes[grip as usize], of_grip(grip));
                if outcome.entries == UNWRITTEN {
                    return Err(Error::device(format!(
                        "grip {} came back without an answer: the kernel did not write it",
                        piece.problem
                    )));
                }
                let kept = if outcome.entries as usize == entries.len() + 1 {
                    self.seeds_of(piece, outcome, entries, &|| screen(place))?
                } else {
                    self.gpu.crowded.fetch_add(1, Ordering::Relaxed);
                    self.on_processor(screen(place)?, piece)?
                };
                Ok((piece.problem, kept))
            })
            .collect()
    }

    /// The seeds that the device found, and those of the loads that it left open.
    fn seeds_of<'s>(
        &self,
        piece: Piece,
        outcome: OutcomeRecord,
        entries: &[FoundRecord],
        screen: &dyn Fn() -> Result<&'s Screen<'a>>,
    ) -> Result<Kept>
    where
        'a: 's,
    {
        let (mut found, mut open) = (Found::with_capacity(entries.len()), Vec::<usize>::new());
        let Some(records) = &self.contacts.ready[self.contacts.slots[piece.problem]].records else {
            return Ok((found, 0.0));
        };
        let problem = &self.problems[piece.problem];
        let spread = Spread::new(problem.wrenches.len());
        for entry in entries {
            let first = piece.first + entry.load as usize;
            if entry.kind == OPEN {
                let bit = |bit: &usize| entry.words[bit / 32] >> (bit % 32) & 1 == 1;
                open.extend((0..BITS).filter(bit).map(|bit| spread.load(first + bit)));
            } else {
                found.push((spread.load(first) as u32, records.answer(&seed(entry), 1.0)?));
            }
        }
        // Most often there is nothing to search for (no load in the pads' plane), and the contact need
        // not be made ready here too.
        open.retain(|&load| match records.load(problem, &problem.wrench(load)) {
            Ok(_) => true,
            Err(status) => {
                found.push((load as u32, not_searched(status)));
                false
            }
        });
        if !open.is_empty() {
            let open = open.into_iter();
            found.extend(screen()?.searched.found(problem, piece.problem, open)?);
        }
        Ok((found, f64::from(outcome.floor)))
    }
}

/// The seed of an entry, with bounds on `mu_s`.
pub(super) fn seed(entry: &FoundRecord) -> SeedRecord {
    let [x, y, z, lower] = entry.words.map(f32::from_bits);
    SeedRecord {
        twist: [x, y, z],
        lower,
        upper: entry.upper,
        status: entry.kind % KINDS,
        best: entry.kind / KINDS,
        padding: 0,
    }
}

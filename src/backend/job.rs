//! The seed stage: a batch cut into chunks, the chunks to records and their answers back.

use rayon::prelude::*;

use super::cpu;
#[cfg(feature = "gpu")]
use super::gpu::Gpu;
use super::layout::{LoadRecord, SeedRecord};
use super::prepare::{Chunk, Contacts, Records, basis_length, not_searched};
use super::problem::{Batch, Seed, SeedStatus, check};
use super::seeds::SeedSet;
use crate::error::{Error, Result};

/// Where seeds are computed.
#[derive(Debug)]
pub enum Backend {
    /// The processor, on rayon's threads.
    Cpu,
    /// A graphics processor.
    #[cfg(feature = "gpu")]
    Gpu(Box<Gpu>),
}

/// Most loads, contacts, edges and basis vectors of one chunk.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) loads: usize,
    pub(crate) contacts: usize,
    pub(crate) edges: usize,
    pub(crate) basis: usize,
}

impl Limits {
    /// On the processor a chunk is one task: small enough for the second-level cache, large enough
    /// that computing a contact's basis anew for each is lost in it.
    const CPU: Self = Self { loads: 1 << 13, contacts: 64, edges: 1 << 14, basis: 1 << 18 };
}

/// Consecutive loads of one problem, and the places of their answers.
pub(super) struct Piece<'b> {
    problem: usize,
    first: usize,
    answers: &'b mut [Seed],
    /// Factor from the unit wrench per load; zero where there is nothing to search.
    scales: Vec<f64>,
}

/// What goes into one chunk: contacts (as indices) with their pieces.
pub(super) type Plan<'b> = Vec<(usize, Vec<Piece<'b>>)>;

impl Backend {
    /// `cpu`, or the adapter's name and driver.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => "cpu".to_owned(),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.name(),
        }
    }

    /// Notes on a running clock ([`Gpu::start_clock`]) how long exact answers took.
    #[cfg(feature = "gpu")]
    pub(super) fn solved_since(&self, start: std::time::Instant) {
        if let Self::Gpu(gpu) = self {
            gpu.polished_since(start);
        }
    }

    /// Without a graphics processor there is no clock.
    #[cfg(not(feature = "gpu"))]
    pub(super) fn solved_since(&self, _: std::time::Instant) {}

    /// Seeds of all loads of all problems, in order. Equal input gives equal output on one backend,
    /// whatever the number of threads, and however the batch is cut or permuted.
    ///
    /// # Errors
    /// A bad value for numbers that are not finite or a gripping force that is not positive;
    /// A device error when the GPU fails.
    pub fn seed(&self, batch: &Batch<'_>, seeds: &SeedSet) -> Result<Vec<Seed>> {
        self.seed_on(&Contacts::new(&batch.problems)?, batch, seeds)
    }

    /// [`Backend::seed`] with the batch's contacts made ready before.
    pub(super) fn seed_on(
        &self,
        contacts: &Contacts,
        batch: &Batch<'_>,
        seeds: &SeedSet,
    ) -> Result<Vec<Seed>> {
        let job = Job::new(contacts, batch, seeds)?;
        let mut answers = vec![not_searched(SeedStatus::NoContact); job.loads];
        match self {
            Self::Cpu => {
                // One small chunk per task: its records stay in the cache between the steps.
                job.plans(Limits::CPU, &mut answers).into_par_iter().try_for_each(|mut plan| {
                    let chunk = job.build(&mut plan);
                    job.scatter(&cpu::run(&chunk, seeds), plan)
                })?;
            }
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => {
                let mut plans = job.plans(gpu.limits(), &mut answers).into_iter();
                let next = || {
                    plans.by_ref().find_map(|mut plan| {
                        let chunk = job.build(&mut plan);
                        (!chunk.loads.is_empty()).then_some((chunk, plan))
                    })
                };
                gpu.run(seeds, next, |records, plan| job.scatter(&records, plan))?;
            }
        }
        Ok(answers)
    }
}

/// A batch, its distinct contacts and the places of its answers.
pub(super) struct Job<'a> {
    batch: &'a Batch<'a>,
    seeds: &'a SeedSet,
    /// Number of answers.
    pub(super) loads: usize,
    pub(super) contacts: &'a Contacts,
    /// Problems of each distinct contact.
    problems: Vec<Vec<usize>>,
}

impl<'a> Job<'a> {
    pub(super) fn new(
        contacts: &'a Contacts,
        batch: &'a Batch<'a>,
        seeds: &'a SeedSet,
    ) -> Result<Self> {
        let mut loads = 0;
        let mut problems: Vec<Vec<usize>> = vec![Vec::new(); contacts.ready.len()];
        for (index, (problem, &slot)) in batch.problems.iter().zip(&contacts.slots).enumerate() {
            check(problem, index)?;
            loads += problem.wrenches.len();
            problems[slot].push(index);
        }
        Ok(Self { batch, seeds, loads, contacts, problems })
    }

    fn records(&self, contact: usize) -> Option<&'a Records> {
        self.contacts.ready[contact].records.as_ref()
    }

    /// Cuts the job into chunks within `limits`, each with its places among the `answers`. A
    /// contact with many loads is cut too.
    pub(super) fn plans<'b>(&self, limits: Limits, mut answers: &'b mut [Seed]) -> Vec<Plan<'b>> {
        let mut places: Vec<&'b mut [Seed]> = Vec::with_capacity(self.batch.problems.len());
        for problem in &self.batch.problems {
            let (mine, others) = answers.split_at_mut(problem.wrenches.len());
            places.push(mine);
            answers = others;
        }
        let (mut plans, mut plan): (Vec<Plan<'b>>, Plan<'b>) = (Vec::new(), Vec::new());
        let (mut loads, mut edges, mut basis) = (0, 0, 0);
        for (contact, users) in self.problems.iter().enumerate() {
            let Some(records) = self.records(contact) else { continue };
            let (own_edges, own_basis) =
                (records.edges.len(), basis_length(&records.header, self.seeds.len()));
            if !plan.is_empty()
                && (plan.len() + 1 > limits.contacts
                    || edges + own_edges > limits.edges
                    || basis + own_basis > limits.basis)
            {
                plans.push(std::mem::take(&mut plan));
                (loads, edges, basis) = (0, 0, 0);
            }
            let mut pieces = Vec::new();
            for &problem in users {
                let mut rest = std::mem::take(&mut places[problem]);
                let mut first = 0;
                while !rest.is_empty() {
                    let count = rest.len().min(limits.loads - loads);
                    let (answers, others) = rest.split_at_mut(count);
                    pieces.push(Piece { problem, first, answers, scales: Vec::new() });
                    rest = others;
                    first += count;
                    loads += count;
                    if loads == limits.loads {
                        plan.push((contact, std::mem::take(&mut pieces)));
                        plans.push(std::mem::take(&mut plan));
                        (loads, edges, basis) = (0, 0, 0);
                    }
                }
            }
            if !pieces.is_empty() {
                plan.push((contact, pieces));
                edges += own_edges;
                basis += own_basis;
            }
        }
        if !plan.is_empty() {
            plans.push(plan);
        }
        plans
    }

    /// The records of a plan; answers of loads that need no search are written at once.
    pub(super) fn build(&self, plan: &mut Plan<'_>) -> Chunk {
        let mut pieces: Vec<(usize, &mut Piece<'_>)> = plan
            .iter_mut()
            .flat_map(|(contact, pieces)| pieces.iter_mut().map(|piece| (*contact, piece)))
            .collect();
        let records: Vec<Vec<LoadRecord>> = pieces
            .par_iter_mut()
            .with_min_len(16)
            .map(|(contact, piece)| {
                let Some(contact) = self.records(*contact) else { return Vec::new() };
                let problem = &self.batch.problems[piece.problem];
                let mut records = Vec::with_capacity(piece.answers.len());
                piece.scales = Vec::with_capacity(piece.answers.len());
                for (wrench, answer) in
                    problem.wrenches[piece.first..].iter().zip(piece.answers.iter_mut())
                {
                    match contact.load(problem, &problem.seen(wrench)) {
                        Ok((record, scale)) => {
                            records.push(record);
                            piece.scales.push(scale);
                        }
                        Err(status) => {
                            *answer = not_searched(status);
                            piece.scales.push(0.0);
                        }
                    }
                }
                records
            })
            .collect();
        let mut chunk = Chunk::default();
        let mut records = records.into_iter();
        for (contact, pieces) in plan.iter() {
            let Some(contact) = self.records(*contact) else { continue };
            chunk.push(contact, records.by_ref().take(pieces.len()), self.seeds.len());
        }
        chunk
    }

    /// Turns a chunk's records into answers.
    pub(super) fn scatter(&self, records: &[SeedRecord], plan: Plan<'_>) -> Result<()> {
        let mut rest = records;
        let mut jobs = Vec::new();
        for (contact, pieces) in plan {
            for piece in pieces {
                let count = piece.scales.iter().filter(|&&scale| scale > 0.0).count();
                let Some((mine, others)) = rest.split_at_checked(count) else {
                    return Err(Error::device(format!("only {} answers came back", records.len())));
                };
                jobs.push((contact, piece, mine));
                rest = others;
            }
        }
        jobs.into_par_iter().with_min_len(16).try_for_each(|(contact, piece, records)| {
            let Some(contact) = self.records(contact) else { return Ok(()) };
            let searched =
                piece.answers.iter_mut().zip(&piece.scales).filter(|(_, scale)| **scale > 0.0);
            for ((answer, scale), record) in searched.zip(records) {
                *answer = contact.answer(record, *scale)?;
            }
            Ok(())
        })
    }
}

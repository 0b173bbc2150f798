//! The seed stage on processor or GPU: for every load the best slip twist of a fixed set, with
//! bounds on `mu_s`.
//!
//! The gradient of the dissipation at a twist depends on the contact polygons alone, linearly in
//! the pressure. It is computed once per distinct contact and twist (nine numbers per face); what
//! is left per load is a small product and a maximum. The supports of the triangles round the best
//! twist give an upper bound: `w` is a combination of three gradients, and the sum of its
//! coefficients' magnitudes bounds `mu_s`, because `D` is a norm.
//!
//! Where the bounds hold: congruent faces in full contact, whose summed pressure is constant, so
//! that neither `M1, M2, F3` nor the distance of the faces matters; and different faces in full
//! contact whose friction coupling is weak, the bounds being widened by all that it can do.
//! Elsewhere the seeds come from the pressure without friction coupling, and there are no bounds.

mod choice;
mod cpu;
mod fan;
#[cfg(feature = "gpu")]
mod gpu;
#[doc(hidden)]
pub mod layout;
mod prepare;
mod score;
mod search;
mod seeds;
mod table;
mod top;

use std::collections::HashMap;
use std::sync::Arc;

use rayon::prelude::*;

#[cfg(feature = "gpu")]
pub use gpu::{
    ADAPTER_VARIABLE, AdapterSummary, ChunkSpans, Deviation, DeviceSpans, Gpu, KernelCheck, Span,
    Timeline, list as list_adapters,
};

pub use crate::request::{Choice, Polish};
pub use choice::{Selection, select};
pub use score::{ScoreOptions, Scored};
pub use seeds::{NEGATED, RING, SeedSet};
pub use top::Best;

use crate::error::{Error, Result};
use crate::model::{Contact, LARGEST_LENGTH, Wrench};
use layout::SeedRecord;
use prepare::{Chunk, Prepared, not_searched};

/// Relative widening of both bounds: ten times the largest error of the 32-bit kernels seen in
/// tests (processor and software Vulkan; Vulkan allows a logarithm 5e-7 off).
pub const F32_TOLERANCE: f64 = 2e-5;

/// One grip: its contact and the loads on it.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// Contact areas in the grip frame. Problems that share the `Arc` share the work that depends
    /// on it alone.
    pub contact: &'a Arc<Contact>,
    /// Height of face I over face II [m], the `d` of the mechanics: negative for grips from inside
    /// ([`crate::model::Grip::distance`]).
    pub distance: f64,
    /// Gripping force [N].
    pub force: f64,
    /// Wrenches on the body in the grip frame, moments about its origin.
    pub wrenches: &'a [Wrench],
}

/// Grips to seed in one call.
#[derive(Debug, Clone, Default)]
pub struct Batch<'a> {
    /// In the order of the answers.
    pub problems: Vec<Problem<'a>>,
}

/// What kind of seed a load got.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SeedStatus {
    /// Congruent faces in full contact: a twist and bounds on `mu_s`, which depends on the in-plane
    /// load alone.
    Bounded,
    /// Different faces in full contact: a twist, and bounds on `mu_s` that allow for all that the
    /// friction coupling can do.
    Coupled,
    /// A twist; no bounds.
    Unbounded,
    /// No force in the pad plane and no moment about the closing axis.
    NoLoad,
    /// A contact area is empty.
    NoContact,
    /// `|F3| >= 2 Fn`.
    NoNormalForce,
}

/// Where to start solving for one load, and what is known of the answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seed {
    /// What kind of seed this is.
    pub status: SeedStatus,
    /// Twist `(u1, u2, omega)` of the body about the grip origin, in the sense that the load
    /// drives: [m/s, m/s, rad/s] up to a positive factor. Zero where nothing was searched.
    pub twist: [f64; 3],
    /// `mu_s` is at least this (0 without bounds).
    pub lower: f64,
    /// `mu_s` is at most this (infinite without bounds).
    pub upper: f64,
    /// `mu_s` is about this: the best twist's value for the pressure without friction coupling,
    /// shortened to full contact. Not a bound; zero where nothing was searched.
    pub estimate: f64,
}

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
struct Piece<'b> {
    problem: usize,
    first: usize,
    answers: &'b mut [Seed],
    /// Factor from the unit wrench per load; zero where there is nothing to search.
    scales: Vec<f64>,
}

/// What goes into one chunk: contacts (as indices) with their pieces.
type Plan<'b> = Vec<(usize, Vec<Piece<'b>>)>;

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
    fn solved_since(&self, start: std::time::Instant) {
        match self {
            Self::Cpu => {}
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.polished_since(start),
        }
    }

    /// Seeds of all loads of all problems, in order. Equal input gives equal output on one backend,
    /// whatever the number of threads, and however the batch is cut or permuted.
    ///
    /// # Errors
    /// A bad value for numbers that are not finite or a gripping force that is not positive;
    /// A device error when the GPU fails.
    pub fn seed(&self, batch: &Batch<'_>, seeds: &SeedSet) -> Result<Vec<Seed>> {
        let job = Job::new(batch, seeds)?;
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
struct Job<'a> {
    batch: &'a Batch<'a>,
    seeds: &'a SeedSet,
    /// Number of answers.
    loads: usize,
    /// Distinct contacts in the order of first use; `None` has no area.
    prepared: Vec<Option<Prepared>>,
    /// Problems of each distinct contact.
    problems: Vec<Vec<usize>>,
}

impl<'a> Job<'a> {
    fn new(batch: &'a Batch<'a>, seeds: &'a SeedSet) -> Result<Self> {
        let mut loads = 0;
        let mut index_of: HashMap<*const Contact, usize> = HashMap::new();
        let mut problems: Vec<Vec<usize>> = Vec::new();
        for (index, problem) in batch.problems.iter().enumerate() {
            check(problem, index)?;
            loads += problem.wrenches.len();
            let slot = *index_of.entry(Arc::as_ptr(problem.contact)).or_insert(problems.len());
            if slot == problems.len() {
                problems.push(Vec::new());
            }
            problems[slot].push(index);
        }
        let prepared = problems
            .par_iter()
            .map(|users| {
                Prepared::new(
                    batch.problems[users[0]].contact,
                    &format!("contact of grip {}", users[0]),
                )
            })
            .collect::<Result<_>>()?;
        Ok(Self { batch, seeds, loads, prepared, problems })
    }

    /// Cuts the job into chunks within `limits`, each with its places among the `answers`. A
    /// contact with many loads is cut too.
    fn plans<'b>(&self, limits: Limits, mut answers: &'b mut [Seed]) -> Vec<Plan<'b>> {
        let mut places: Vec<&'b mut [Seed]> = Vec::with_capacity(self.batch.problems.len());
        for problem in &self.batch.problems {
            let (mine, others) = answers.split_at_mut(problem.wrenches.len());
            places.push(mine);
            answers = others;
        }
        let (mut plans, mut plan): (Vec<Plan<'b>>, Plan<'b>) = (Vec::new(), Vec::new());
        let (mut loads, mut edges, mut basis) = (0, 0, 0);
        for (contact, users) in self.problems.iter().enumerate() {
            let Some(prepared) = &self.prepared[contact] else { continue };
            let (own_edges, own_basis) =
                (prepared.edges.len(), prepare::basis_length(&prepared.header, self.seeds.len()));
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
    fn build(&self, plan: &mut Plan<'_>) -> Chunk {
        let mut pieces: Vec<(usize, &mut Piece<'_>)> = plan
            .iter_mut()
            .flat_map(|(contact, pieces)| pieces.iter_mut().map(|piece| (*contact, piece)))
            .collect();
        let records: Vec<Vec<layout::LoadRecord>> = pieces
            .par_iter_mut()
            .with_min_len(16)
            .map(|(contact, piece)| {
                let Some(prepared) = &self.prepared[*contact] else { return Vec::new() };
                let problem = &self.batch.problems[piece.problem];
                let mut records = Vec::with_capacity(piece.answers.len());
                piece.scales = Vec::with_capacity(piece.answers.len());
                for (wrench, answer) in
                    problem.wrenches[piece.first..].iter().zip(piece.answers.iter_mut())
                {
                    match prepared.load(problem, wrench) {
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
            let Some(prepared) = &self.prepared[*contact] else { continue };
            chunk.push(prepared, records.by_ref().take(pieces.len()), self.seeds.len());
        }
        chunk
    }

    /// Turns a chunk's records into answers.
    fn scatter(&self, records: &[SeedRecord], plan: Plan<'_>) -> Result<()> {
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
            let Some(prepared) = &self.prepared[contact] else { return Ok(()) };
            let searched =
                piece.answers.iter_mut().zip(&piece.scales).filter(|(_, scale)| **scale > 0.0);
            for ((answer, scale), record) in searched.zip(records) {
                *answer = prepared.answer(record, *scale)?;
            }
            Ok(())
        })
    }
}

/// Refuses numbers that are not finite.
fn check(problem: &Problem<'_>, index: usize) -> Result<()> {
    let place = || format!("grip {index}");
    if !(problem.force.is_finite() && problem.force > 0.0) {
        return Err(Error::input(
            place(),
            format!("gripping force {} N", problem.force),
            "give a positive force",
        ));
    }
    if problem.distance.is_nan() || problem.distance.abs() > LARGEST_LENGTH {
        return Err(Error::input(
            place(),
            format!("distance between the faces {} m", problem.distance),
            "give a distance of at most 1e9 m",
        ));
    }
    for (load, wrench) in problem.wrenches.iter().enumerate() {
        if !(wrench.force.is_finite() && wrench.moment.is_finite()) {
            return Err(Error::input(
                place(),
                format!("load {load} is not finite: {wrench:?}"),
                "give finite forces and moments",
            ));
        }
    }
    Ok(())
}

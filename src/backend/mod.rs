//! The seed stage on processor or GPU: for every load the best slip twist of a fixed set, with bounds on `mu_s`.
//!
//! The gradient of the dissipation at a twist depends on the contact polygons alone, linearly in the pressure. It is
//! computed once per distinct contact and twist ([`layout::BASIS`] numbers per face); what is left per load is a small
//! product and a maximum. The supports of the triangles round the best twist give an upper bound: `w` is a combination
//! of three gradients, and the sum of its coefficients' magnitudes bounds `mu_s`, because `D` is a norm.
//!
//! Where the bounds hold: congruent faces in full contact, whose summed pressure is constant, so that neither
//! `M1, M2, F3` nor the distance of the faces matters. Elsewhere the seeds come from the pressure without friction
//! coupling, and there are no bounds.

mod cpu;
mod fan;
pub mod layout;
mod prepare;
mod search;
mod seeds;

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

pub use seeds::{NEGATED, RING, SeedSet};

use crate::error::{Error, Result};
use crate::model::{Contact, Wrench};
use layout::{BOUNDED, SeedRecord, UNBOUNDED};
use prepare::{Chunk, Prepared, not_searched};

/// Relative widening of both bounds: ten times the largest error of the 32-bit kernels seen in tests (processor and
/// software Vulkan; Vulkan allows a logarithm 5e-7 off).
pub const F32_TOLERANCE: f64 = 2e-5;

/// One grip: its contact and the loads on it.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// Contact areas in the grip frame. Problems that share the `Arc` share the work that depends on it alone.
    pub contact: &'a Arc<Contact>,
    /// Distance between the faces [m].
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
    /// A twist and bounds on `mu_s`.
    Bounded,
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
    /// Twist `(u1, u2, omega)` of the body about the grip origin, in the sense that the load drives: [m/s, m/s, rad/s]
    /// up to a positive factor. Zero where nothing was searched.
    pub twist: [f64; 3],
    /// `mu_s` is at least this (0 without bounds).
    pub lower: f64,
    /// `mu_s` is at most this (infinite without bounds).
    pub upper: f64,
}

/// Where seeds are computed.
#[derive(Debug)]
pub enum Backend {
    /// The processor, on rayon's threads.
    Cpu,
}

/// Most loads, contacts and basis numbers of one chunk.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) loads: usize,
    pub(crate) contacts: usize,
    pub(crate) edges: usize,
    pub(crate) basis: usize,
}

impl Limits {
    /// On the processor a chunk only bounds memory: 8 MiB of loads, as much of records.
    const CPU: Self = Self { loads: 1 << 18, contacts: 1 << 14, edges: 1 << 20, basis: usize::MAX };
}

/// Consecutive loads of one problem.
#[derive(Debug, Clone)]
struct Piece {
    problem: usize,
    loads: Range<usize>,
}

/// What goes into one chunk: contacts (as indices) with their pieces.
type Plan = Vec<(usize, Vec<Piece>)>;

/// Where a chunk's records go: index of the answer and factor from the unit wrench, per load.
#[derive(Debug, Default)]
struct Targets {
    contact: Vec<usize>,
    answer: Vec<usize>,
    scale: Vec<f64>,
}

impl Backend {
    /// Seeds of all loads of all problems, in order. Equal input gives equal output on one backend, whatever the number
    /// of threads, and however the batch is cut or permuted.
    ///
    /// # Errors
    /// [`Error::Input`] for numbers that are not finite or a gripping force that is not positive; [`Error::Backend`]
    /// when the GPU fails.
    pub fn seed(&self, batch: &Batch<'_>, seeds: &SeedSet) -> Result<Vec<Seed>> {
        let job = Job::new(batch, seeds)?;
        let mut answers = vec![not_searched(SeedStatus::NoContact); job.loads];
        match self {
            Self::Cpu => {
                for plan in job.plans(Limits::CPU) {
                    let (chunk, targets) = job.build(&plan, &mut answers);
                    job.scatter(&cpu::run(&chunk, seeds), &targets, &mut answers)?;
                }
            }
        }
        Ok(answers)
    }
}

/// A batch, its distinct contacts and the places of its answers.
struct Job<'a> {
    batch: &'a Batch<'a>,
    seeds: &'a SeedSet,
    /// First answer of each problem.
    first: Vec<usize>,
    /// Number of answers.
    loads: usize,
    /// Distinct contacts in the order of first use; `None` has no area.
    prepared: Vec<Option<Prepared>>,
    /// Problems of each distinct contact.
    problems: Vec<Vec<usize>>,
}

impl<'a> Job<'a> {
    fn new(batch: &'a Batch<'a>, seeds: &'a SeedSet) -> Result<Self> {
        let mut first = Vec::with_capacity(batch.problems.len());
        let mut loads = 0;
        let mut index_of: HashMap<*const Contact, usize> = HashMap::new();
        let mut problems: Vec<Vec<usize>> = Vec::new();
        for (index, problem) in batch.problems.iter().enumerate() {
            check(problem, index)?;
            first.push(loads);
            loads += problem.wrenches.len();
            let slot = *index_of.entry(Arc::as_ptr(problem.contact)).or_insert(problems.len());
            if slot == problems.len() {
                problems.push(Vec::new());
            }
            problems[slot].push(index);
        }
        let prepared = problems
            .par_iter()
            .map(|users| Prepared::new(batch.problems[users[0]].contact, &format!("contact of grip {}", users[0])))
            .collect::<Result<_>>()?;
        Ok(Self { batch, seeds, first, loads, prepared, problems })
    }

    /// Cuts the job into chunks within `limits`. A contact with many loads is cut too.
    fn plans(&self, limits: Limits) -> Vec<Plan> {
        let (mut plans, mut plan): (Vec<Plan>, Plan) = (Vec::new(), Vec::new());
        let (mut loads, mut edges, mut basis) = (0, 0, 0);
        for (contact, users) in self.problems.iter().enumerate() {
            let Some(prepared) = &self.prepared[contact] else { continue };
            let (own_edges, own_basis) = (prepared.edges.len(), prepare::basis_length(&prepared.header, self.seeds.len()));
            let mut pieces = Vec::new();
            let full = |plan: &Plan, edges: usize, basis: usize| {
                plan.len() + 1 > limits.contacts || edges + own_edges > limits.edges || basis + own_basis > limits.basis
            };
            if full(&plan, edges, basis) && !plan.is_empty() {
                plans.push(std::mem::take(&mut plan));
                (loads, edges, basis) = (0, 0, 0);
            }
            for &problem in users {
                let total = self.batch.problems[problem].wrenches.len();
                let mut start = 0;
                while start < total {
                    let end = total.min(start + (limits.loads - loads));
                    pieces.push(Piece { problem, loads: start..end });
                    loads += end - start;
                    start = end;
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
    fn build(&self, plan: &Plan, answers: &mut [Seed]) -> (Chunk, Targets) {
        type Scaled = Vec<std::result::Result<(layout::LoadRecord, f64), SeedStatus>>;
        let (mut chunk, mut targets) = (Chunk::default(), Targets::default());
        for (contact, pieces) in plan {
            let Some(prepared) = &self.prepared[*contact] else { continue };
            let scaled: Vec<Scaled> = pieces
                .par_iter()
                .with_min_len(64)
                .map(|piece| {
                    let problem = &self.batch.problems[piece.problem];
                    problem.wrenches[piece.loads.clone()].iter().map(|wrench| prepared.load(problem, wrench)).collect()
                })
                .collect();
            let mut records = Vec::with_capacity(scaled.iter().map(Vec::len).sum());
            for (piece, loads) in pieces.iter().zip(scaled) {
                let first = self.first[piece.problem] + piece.loads.start;
                for (offset, load) in loads.into_iter().enumerate() {
                    match load {
                        Ok((record, scale)) => {
                            records.push(record);
                            targets.contact.push(*contact);
                            targets.answer.push(first + offset);
                            targets.scale.push(scale);
                        }
                        Err(status) => answers[first + offset] = not_searched(status),
                    }
                }
            }
            if !records.is_empty() {
                chunk.push(prepared, records, self.seeds.len());
            }
        }
        (chunk, targets)
    }

    /// Turns a chunk's records into answers.
    fn scatter(&self, records: &[SeedRecord], targets: &Targets, answers: &mut [Seed]) -> Result<()> {
        if records.len() != targets.answer.len() {
            return Err(Error::Backend(format!("{} loads were sent and {} answers came back", targets.answer.len(), records.len())));
        }
        for (index, record) in records.iter().enumerate() {
            let Some(prepared) = &self.prepared[targets.contact[index]] else { continue };
            let status = match record.status {
                BOUNDED => SeedStatus::Bounded,
                UNBOUNDED => SeedStatus::Unbounded,
                other => return Err(Error::Backend(format!("load {index} of a chunk came back with status {other}: the kernel did not write it"))),
            };
            let (scale, bounded) = (targets.scale[index], status == SeedStatus::Bounded);
            answers[targets.answer[index]] = Seed {
                status,
                twist: prepared.twist(record.twist),
                lower: if bounded { scale * f64::from(record.lower) * (1.0 - F32_TOLERANCE) } else { 0.0 },
                upper: if bounded { scale * f64::from(record.upper) * (1.0 + F32_TOLERANCE) } else { f64::INFINITY },
            };
        }
        Ok(())
    }
}

/// Refuses numbers that are not finite.
fn check(problem: &Problem<'_>, index: usize) -> Result<()> {
    let place = || format!("grip {index}");
    if !(problem.force.is_finite() && problem.force > 0.0) {
        return Err(Error::input(place(), format!("gripping force {} N", problem.force), "give a positive force"));
    }
    if !(problem.distance.is_finite() && problem.distance >= 0.0) {
        return Err(Error::input(place(), format!("distance between the faces {} m", problem.distance), "give a distance of zero or more"));
    }
    for (load, wrench) in problem.wrenches.iter().enumerate() {
        if !(wrench.force.is_finite() && wrench.moment.is_finite()) {
            return Err(Error::input(place(), format!("load {load} is not finite: {wrench:?}"), "give finite forces and moments"));
        }
    }
    Ok(())
}

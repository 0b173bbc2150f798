//! How far the kernels' single precision is from the processor's twin of them and from double
//! precision, on whatever adapter is open.

pub(super) mod estimates;

use std::sync::Arc;

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};

use super::super::lanes::Loads;
use super::super::layout::{
    BITS, CaseRecord, ContactHeader, EdgeRecord, FoundRecord, GripRecord, LEAST_DISSIPATION,
    LoadRecord, OPEN, OutcomeRecord, SeedRecord,
};
use super::super::prepare::{Contacts, Records};
use super::super::screen::Wanted;
use super::super::search::Field as SearchField;
use super::super::seeds::{NEGATED, RING};
use super::super::table::{Table, contact_basis};
use super::super::{Batch, Pose, Problem};
use super::chunk::{Chunk, Maker, plans};
use super::survivors::seed;
use super::{Answer, ChunkSpans, Failure, Gpu, State, map, newton, twin};
use crate::backend::{F32_TOLERANCE, SeedSet};
use crate::contact::{Field, Loops, Twist, friction};
use crate::error::{Error, Result};
use crate::geometry::polygon::rings_moments;
use crate::model::{Contact, Frame, Patch, Polygon, Wrench};
use estimates::{Estimates, LiftingGrip};

/// Largest differences of one number of a kernel.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Deviation {
    /// `fill_basis`, `screen` or `newton`.
    pub kernel: &'static str,
    /// Which number, and relative to what.
    pub number: &'static str,
    /// How many were compared.
    pub count: usize,
    /// Largest difference from the processor's kernel in single precision.
    pub from_twin: f64,
    /// Largest difference from the closed forms in double precision; `None` where there are none.
    pub from_exact: Option<f64>,
    /// The same of the processor's kernel.
    pub twin_from_exact: Option<f64>,
}

/// What [`Gpu::check_kernels`] found.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct KernelCheck {
    /// Number by number.
    pub deviations: Vec<Deviation>,
    /// Loads on which adapter and processor took different twists of equal value.
    pub other_twist: usize,
    /// Loads that got bounds on one of them only: a hair inside or outside full contact.
    pub other_status: usize,
    /// Largest error of a load that is made in single precision, over the bound that is stated.
    pub load_error: f64,
    /// Loads searched.
    pub loads: usize,
    /// Loads with bounds.
    pub bounded: usize,
    /// The tolerance that widens every bound.
    pub tolerance: f64,
    /// Largest difference of a bound from double precision, on adapter or processor.
    pub largest: f64,
    /// Loads without bounds of which Newton's method was tried.
    pub open: usize,
    /// Those of them with an estimate.
    pub estimated: usize,
    /// Loads with an estimate on one of adapter and processor only: a hair from having none.
    pub other_estimate: usize,
    /// Largest error of an estimate, over the margin that is stated.
    pub estimate_error: f64,
}

impl KernelCheck {
    /// Whether the tolerance covers every difference of a bound that was seen, and what is stated of
    /// the error of every load and estimate holds.
    pub fn tolerance_holds(&self) -> bool {
        self.largest <= self.tolerance && self.load_error <= 1.0 && self.estimate_error <= 1.0
    }
}

/// The largest of some differences; one that is not a number counts as infinite.
#[derive(Debug, Clone, Copy, Default)]
struct Most {
    count: usize,
    from_twin: f64,
    from_exact: f64,
    twin_from_exact: f64,
}

impl Most {
    fn add(&mut self, found: f32, twin: f32, exact: f64, scale: f64) {
        let apart = |a: f64, b: f64| {
            let apart = (a - b).abs() / scale;
            if apart.is_nan() { f64::INFINITY } else { apart }
        };
        let (found, twin) = (f64::from(found), f64::from(twin));
        self.count += 1;
        self.from_twin = self.from_twin.max(apart(found, twin));
        self.from_exact = self.from_exact.max(apart(found, exact));
        self.twin_from_exact = self.twin_from_exact.max(apart(twin, exact));
    }

    fn of(self, kernel: &'static str, number: &'static str, exact: bool) -> Deviation {
        Deviation {
            kernel,
            number,
            count: self.count,
            from_twin: self.from_twin,
            from_exact: exact.then_some(self.from_exact),
            twin_from_exact: exact.then_some(self.twin_from_exact),
        }
    }
}

/// A contact in double precision in the kernels' scaled frame.
struct Exact {
    faces: usize,
    area: [f64; 2],
    centroid: [DVec2; 2],
    compliance: DMat2,
    /// `[face][twist]`: rows of the weights `1, x1, x2`.
    basis: [Vec<[[f64; 3]; 3]>; 2],
}

impl Exact {
    fn new(contact: &Contact, prepared: &Records, seeds: &SeedSet) -> Self {
        let loops = [&contact.face_i, &contact.face_ii]
            .map(|patch| Loops::mapped(patch, |point| (point - prepared.origin) / prepared.unit));
        let moments = [0, 1].map(|k: usize| rings_moments(&loops[k].rings().collect::<Vec<_>>()));
        let basis = [0, 1].map(|k: usize| {
            let one = |v: &[f32; 4]| {
                let twist = Twist::from([v[0], v[1], v[2]].map(f64::from));
                friction(Field { area: &loops[k], p: [1.0, 0.0, 0.0] }, twist).g
            };
            seeds.twists().iter().map(one).collect()
        });
        Self {
            faces: prepared.header.faces as usize,
            area: [moments[0].area, moments[1].area],
            centroid: [moments[0].centroid, moments[1].centroid],
            compliance: (moments[0].second + moments[1].second).inverse(),
            basis,
        }
    }

    /// Gradients of the dissipation at every twist, for the pressure in full contact.
    fn gradients(&self, f3: f64, m1: f64, m2: f64) -> Vec<DVec3> {
        let normal = [1.0 + 0.5 * f3, 1.0 - 0.5 * f3];
        let mean = [normal[0] / self.area[0], normal[1] / self.area[1]];
        let row = |face: usize, k: usize, weight: usize| DVec3::from(self.basis[face][k][weight]);
        let twists = 0..self.basis[0].len();
        if self.faces == 1 {
            return twists.map(|k| (mean[0] + mean[1]) * row(0, k, 0)).collect();
        }
        let [ci, cii] = self.centroid;
        let slope = self.compliance * (DVec2::new(-m2, m1) - normal[0] * ci + normal[1] * cii);
        let (at_i, at_ii) = (mean[0] - slope.dot(ci), mean[1] + slope.dot(cii));
        let less = |k: usize, weight: usize| row(0, k, weight) - row(1, k, weight);
        twists
            .map(|k| {
                at_i * row(0, k, 0)
                    + at_ii * row(1, k, 0)
                    + slope.x * less(k, 1)
                    + slope.y * less(k, 2)
            })
            .collect()
    }
}

/// The largest value of a unit wrench over the twists.
fn lower(w: DVec3, gradients: &[DVec3], seeds: &SeedSet) -> f64 {
    let value = |(v, g): (&[f32; 4], &DVec3)| {
        let v = DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]));
        w.dot(v).abs() / v.dot(*g).max(f64::from(LEAST_DISSIPATION))
    };
    seeds.twists().iter().zip(gradients).map(value).fold(0.0, f64::max)
}

/// The bound from the triangles round the twist `best`.
fn upper(w: DVec3, gradients: &[DVec3], seeds: &SeedSet, best: usize) -> f64 {
    let support = |entry: u32| {
        let sign = if entry & NEGATED != 0 { -1.0 } else { 1.0 };
        sign * gradients[(entry & !NEGATED) as usize]
    };
    let (ga, ring) = (gradients[best], seeds.rings()[best]);
    let total = |i: usize| {
        let (gb, gc) = (support(ring[i]), support(ring[(i + 1) % RING]));
        let det = ga.dot(gb.cross(gc));
        let parts = [w.dot(gb.cross(gc)), ga.cross(w).dot(gc), ga.cross(w).dot(gb)];
        let sum: f64 = parts.iter().map(|x| x.abs()).sum();
        if det.abs() > 1e-12 { sum / det.abs() } else { f64::INFINITY }
    };
    (0..RING).map(total).fold(f64::INFINITY, f64::min)
}

/// A small generator, so that the contacts are the same everywhere.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0))
    }

    /// A grip somewhere on a part of some decimetres.
    pub(super) fn pose(&mut self) -> Pose {
        let axis = (self.vector() + DVec3::new(0.0, 0.0, 1e-3)).normalize();
        let rotation = DMat3::from_quat(DQuat::from_axis_angle(axis, self.within(-3.0, 3.0)));
        Pose {
            centre_of_mass: self.vector() * 0.1,
            part_from_grip: Frame { rotation, origin: self.vector() * 0.1 },
        }
    }

    /// A star-shaped polygon.
    fn patch(&mut self) -> Patch {
        let corners = 3 + self.within(0.0, 8.0) as usize;
        let (centre, turn, flat) = (
            DVec2::new(self.within(-0.02, 0.02), self.within(-0.02, 0.02)),
            self.within(0.0, 1.0),
            self.within(0.3, 1.0),
        );
        let ring = (0..corners).map(|i| {
            let angle =
                (i as f64 + turn + self.within(-0.2, 0.2)) / corners as f64 * std::f64::consts::TAU;
            let size = 0.02 * self.within(0.5, 1.0);
            centre + DVec2::from_angle(angle) * size * DVec2::new(1.0, flat)
        });
        vec![Polygon { outer: ring.collect(), holes: Vec::new() }]
    }

    /// Congruent faces, or those of a pad that hangs over an edge.
    pub(super) fn contact(&mut self, same: bool) -> Contact {
        let face_i = self.patch();
        let cut = self.within(0.6, 1.0);
        let face_ii = if same {
            face_i.clone()
        } else {
            let shrunk = |p: &DVec2| *p * DVec2::new(cut, 1.0);
            let outer = face_i[0].outer.iter().map(shrunk).collect();
            vec![Polygon { outer, holes: Vec::new() }]
        };
        Contact { face_i, face_ii }
    }
}

/// A contact, where it is on the part, and what acts on that.
type RandomGrip = (Arc<Contact>, Pose, Vec<Wrench>);

/// Contacts under a hundred loads each; every second one with different faces.
fn random_grips(contacts: usize) -> Vec<RandomGrip> {
    let mut random = Random(31);
    let wrench = |random: &mut Random| {
        let size = 40.0 * 10_f64.powf(random.within(-2.5, -0.8));
        Wrench { force: random.vector() * size, moment: random.vector() * size * 0.01 }
    };
    (0..contacts)
        .map(|i| {
            let contact = Arc::new(random.contact(i % 2 == 0));
            let mut pose = random.pose();
            // Within some lengths of the pad, or few loads leave it in full contact.
            pose.part_from_grip.origin = pose.centre_of_mass + random.vector() * 0.02;
            (contact, pose, (0..100).map(|_| wrench(&mut random)).collect())
        })
        .collect()
}

/// Loads on each contact on which estimates are looked at: each takes a chunk of a few.
const LIFTING: usize = 40;

/// What the twins say of a chunk.
pub(super) fn twins(chunk: &Chunk, seeds: &SeedSet) -> Answer {
    let cases = cases(chunk);
    let (mut outcomes, mut entries) = (Vec::new(), Vec::new());
    for (header, index) in chunk.contacts.iter().zip(0..) {
        let edges = edges(chunk, header);
        let table = Table::new(header, edges, seeds);
        let field = SearchField { header, edges, table: &table, rings: seeds.rings() };
        for grip in chunk.grips.iter().zip(0..).filter(|(grip, _)| grip.contact == index) {
            let mut windows = Vec::new();
            let bounded = twin::screen(&field, grip, &cases, (&mut windows, &mut entries));
            let open = (windows.as_slice(), bounded.floor);
            let all = newton::newton(&field, grip, &cases, open, &mut entries);
            outcomes.push(OutcomeRecord { entries: bounded.entries + all.entries, ..all });
        }
    }
    Answer { outcomes, entries }
}

/// The listed loads of a chunk.
fn cases(chunk: &Chunk) -> Vec<CaseRecord> {
    chunk.lists.iter().flat_map(|list| list.records.iter().copied()).collect()
}

/// A contact's edges, face by face.
fn edges<'c>(chunk: &'c Chunk, header: &ContactHeader) -> [&'c [EdgeRecord]; 2] {
    let face = |a: u32, b: u32| &chunk.edges[a as usize..b as usize];
    [face(header.edges_i, header.edges_ii), face(header.edges_ii, header.edges_end)]
}

/// The seeds of a grip's loads among the entries; `None` where a load was left to the processor.
pub(super) fn by_load(
    entries: &[FoundRecord],
    grip: u32,
) -> std::collections::BTreeMap<u32, Option<SeedRecord>> {
    let mut all = std::collections::BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.grip == grip) {
        if entry.kind == OPEN {
            let bit = |bit: &u32| entry.words[*bit as usize / 32] >> (bit % 32) & 1 == 1;
            all.extend((0..BITS as u32).filter(bit).map(|bit| (entry.load + bit, None)));
        } else {
            all.insert(entry.load, Some(seed(entry)));
        }
    }
    all
}

/// Largest deviations so far.
#[derive(Default)]
struct Compared {
    /// Dissipation, and gradients of weight 1 and of weights x1 and x2.
    basis: [Most; 3],
    /// Lower bound, upper bound, interpolated twist.
    bounds: [Most; 3],
    other_twist: usize,
    other_status: usize,
    load_error: f64,
    loads: usize,
    bounded: usize,
}

/// A load as both kernels make it.
struct Made {
    load: LoadRecord,
    /// Share by which its bounds are widened.
    share: f32,
}

impl Made {
    fn new(field: &SearchField<'_>, grip: &GripRecord, listed: &CaseRecord) -> Self {
        let load = twin::make_load(grip, listed);
        let planes = field.planes(&Loads::new(&[load]));
        let error = twin::load_error(grip, listed);
        Self { share: twin::doubt(field, &load, (&planes, 0), error, 0.0), load }
    }
}

impl Compared {
    /// The integrals of one contact: of the device (`found`) and the processor (`twin`).
    fn basis(&mut self, exact: &Exact, twin: &[f32], found: &[f32], seeds: &SeedSet) {
        for (place, (&twin, &found)) in twin.iter().zip(found).enumerate() {
            let (k, weight, part) = (place / 12 % seeds.len(), place / 4 % 3, place % 4);
            let on = place / 12 / seeds.len();
            let g = exact.basis[on][k];
            let v = &seeds.twists()[k];
            let (value, scale) = if part < 3 {
                (g[weight][part], exact.area[on])
            } else {
                ((0..3).map(|m| f64::from(v[m]) * g[weight][m]).sum(), exact.area[on])
            };
            let most = match (weight, part) {
                (0, 3) => &mut self.basis[0],
                (0, _) => &mut self.basis[1],
                _ => &mut self.basis[2],
            };
            let scale = if (weight, part) == (0, 3) { value } else { scale };
            most.add(found, twin, value, scale);
        }
    }

    /// The error of a load that was made in single precision.
    fn made(&mut self, found: &LoadRecord, exact: &LoadRecord, error: f32) {
        let numbers = |load: &LoadRecord| {
            let [x, y, z] = load.wrench.map(|x| f64::from(x) * f64::from(load.scale));
            [x, y, z, f64::from(load.f3), f64::from(load.m1), f64::from(load.m2)]
        };
        let apart = numbers(found).into_iter().zip(numbers(exact)).map(|(a, b)| (a - b).abs());
        self.load_error = apart.fold(self.load_error, |most, x| most.max(x / f64::from(error)));
    }

    /// The seed of one load: of the device and the processor.
    fn load(
        &mut self,
        exact: &Exact,
        made: &Made,
        [found, twin]: [Option<SeedRecord>; 2],
        seeds: &SeedSet,
    ) {
        self.loads += 1;
        self.other_status += usize::from(found.is_some() != twin.is_some());
        let (Some(found), Some(twin)) = (found, twin) else { return };
        let same = found.best == twin.best;
        self.other_twist += usize::from(!same);
        self.bounded += 1;
        let load = made.load;
        let [f3, m1, m2] = [load.f3, load.m1, load.m2].map(f64::from);
        let gradients = exact.gradients(f3, m1, m2);
        let w = DVec3::from(load.wrench.map(f64::from));
        // The bounds of that load, not widened for what it is off.
        let (scale, share) = (f64::from(load.scale), f64::from(made.share));
        let value = scale * (1.0 - share) * lower(w, &gradients, seeds);
        self.bounds[0].add(found.lower, twin.lower, value, value);
        let value = scale * (1.0 + share) * upper(w, &gradients, seeds, found.best as usize);
        if same {
            self.bounds[1].add(found.upper, twin.upper, value, value);
            for m in 0..3 {
                self.bounds[2].add(found.twist[m], twin.twist[m], 0.0, 1.0);
            }
        } else {
            self.bounds[1].add(found.upper, found.upper, value, value);
        }
    }

    fn check(&self, estimates: &Estimates) -> KernelCheck {
        let Self { basis, bounds, .. } = self;
        let largest = bounds[..2]
            .iter()
            .map(|most| most.from_exact.max(most.twin_from_exact))
            .fold(0.0, f64::max);
        let deviations = vec![
            basis[0].of("fill_basis", "dissipation, relative", true),
            basis[1].of("fill_basis", "weight 1, of the area", true),
            basis[2].of("fill_basis", "weights x1 and x2, of the area", true),
            bounds[0].of("screen", "lower bound, relative", true),
            bounds[1].of("screen", "upper bound, relative", true),
            bounds[2].of("screen", "interpolated twist, absolute", false),
            estimates.value.of("newton", "estimate, relative", true),
            estimates.margin.of("newton", "its margin, of the estimate", false),
        ];
        KernelCheck {
            deviations,
            other_twist: self.other_twist,
            other_status: self.other_status,
            load_error: self.load_error,
            loads: self.loads,
            bounded: self.bounded,
            tolerance: F32_TOLERANCE,
            largest,
            open: estimates.open,
            estimated: estimates.estimated,
            other_estimate: estimates.by_one,
            estimate_error: estimates.of_margin,
        }
    }
}

impl Gpu {
    /// Runs the kernels on random contacts (half of them with different faces, at no distance so
    /// that friction does not couple, for double precision has no twin of that) and compares every
    /// number with the processor's kernels and with the closed forms in double precision; and
    /// Newton's method on other contacts, under loads that mostly lift a pad, with the exact solution.
    ///
    /// # Errors
    /// [`crate::error::ErrorKind::Device`] when the device fails or leaves a record unwritten.
    pub fn check_kernels(&self, seeds: &SeedSet, contacts: usize) -> Result<KernelCheck> {
        let grips = random_grips(contacts);
        let problems = grips.iter().map(|(contact, pose, wrenches)| Problem {
            contact,
            distance: 0.0,
            force: 40.0,
            wrenches,
            pose: Some(*pose),
        });
        let batch = Batch { problems: problems.collect() };
        let made = Contacts::new(&batch.problems)?;
        let users = (0..batch.problems.len()).map(|index| (made.slots[index], vec![index]));
        let limits = (self.limits(), seeds.len());
        let mut compared = Compared::default();
        for plan in plans(&made, &batch.problems, users.collect(), limits) {
            let with = (seeds.len(), Wanted::All);
            let chunk = Maker::default().chunk((&made, &batch.problems), &plan, with);
            let (answer, found) = self.answer_and_basis(&chunk, seeds)?;
            let (twin, listed) = (twins(&chunk, seeds), cases(&chunk));
            for ((header, index), (slot, pieces)) in chunk.contacts.iter().zip(0..).zip(&plan) {
                let Some(prepared) = &made.ready[*slot].records else { continue };
                let problem = &batch.problems[pieces[0].problem];
                let exact = Exact::new(problem.contact, prepared, seeds);
                let edges = edges(&chunk, header);
                let basis = contact_basis(header, edges, seeds.twists()).concat();
                compared.basis(&exact, &basis, &found[header.basis as usize * 4..], seeds);
                let table = Table::new(header, edges, seeds);
                let field = SearchField { header, edges, table: &table, rings: seeds.rings() };
                for (grip, number) in
                    chunk.grips.iter().zip(0..).filter(|(grip, _)| grip.contact == index)
                {
                    let [found, twin] =
                        [&answer, &twin].map(|answer| by_load(&answer.entries, number));
                    for load in 0..grip.count {
                        let listed = &listed[(grip.first + load) as usize];
                        let made = Made::new(&field, grip, listed);
                        let wrench = problem.wrench(load as usize);
                        if let Ok((exact, _)) = prepared.load(problem, &wrench) {
                            compared.made(&made.load, &exact, twin::load_error(grip, listed));
                        }
                        let of = |all: &std::collections::BTreeMap<u32, Option<SeedRecord>>| {
                            all.get(&load).copied().flatten()
                        };
                        compared.load(&exact, &made, [of(&found), of(&twin)], seeds);
                    }
                }
            }
        }
        Ok(compared.check(&self.estimates(seeds, contacts)?))
    }

    /// The estimates of loads without bounds, on so many contacts.
    fn estimates(&self, seeds: &SeedSet, contacts: usize) -> Result<Estimates> {
        let grips = Random(101).lifting_grips(contacts, LIFTING);
        let problems: Vec<Problem<'_>> = grips.iter().map(LiftingGrip::problem).collect();
        let made = Contacts::new(&problems)?;
        let mut estimates = Estimates::default();
        for (chunk, plan) in estimates::chunks(&made, &problems, (self.limits(), seeds)) {
            let found = self.answer_and_basis(&chunk, seeds)?.0;
            let twin = twins(&chunk, seeds);
            let pieces =
                plan.iter().flat_map(|(slot, pieces)| pieces.iter().map(move |p| (slot, p)));
            for ((slot, piece), number) in pieces.zip(0..) {
                let Some(pads) = &made.ready[*slot].pads else { continue };
                let both = [&found, &twin].map(|answer| answer.entries.as_slice());
                estimates.add(pads, &problems[piece.problem], both, number);
            }
        }
        Ok(estimates)
    }

    /// What came of a chunk, and the basis that the first kernel left.
    fn answer_and_basis(&self, chunk: &Chunk, seeds: &SeedSet) -> Result<(Answer, Vec<f32>)> {
        let mut state = State::default();
        let ticket = self.submit(&mut state, 0, chunk, seeds, std::time::Instant::now())?;
        let answer = self.collect(&ticket, &mut ChunkSpans::default())?;
        let fault = |why: String| Error::from(Failure::Fault(why));
        let Some(basis) = &state.slots[0].basis else {
            return Err(fault("the basis was not kept".to_owned()));
        };
        let bytes = (chunk.basis * size_of::<[f32; 4]>()) as u64;
        let readback = self.buffer(
            "basis readback",
            bytes,
            wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        );
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(basis, 0, &readback, 0, bytes);
        let submission = self.queue.submit([encoder.finish()]);
        self.wait(&submission, &map(&readback, wgpu::MapMode::Read))?;
        let view = readback.get_mapped_range(..).map_err(|error| fault(error.to_string()))?;
        Ok((answer, bytemuck::pod_collect_to_vec(&view)))
    }
}

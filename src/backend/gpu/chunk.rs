//! A batch cut into chunks: contacts, lists of loads, and grips as poses.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::super::layout::{
    BASIS, BITS, CORRECTIONS, CaseRecord, ContactHeader, ESTIMATES, EVERY, EdgeRecord, GROUP,
    GripRecord, MODES, OUT_OF_RANGE, PRESSURE_STEPS, WINDOW,
};
use super::super::prepare::{Contacts, RANGE, Records};
use super::super::problem::Problem;
use super::super::screen::Wanted;
use crate::model::Wrench;

/// Most loads that one workgroup walks over: those of a grip with more are shared by several.
const PIECE: usize = 1 << 13;

/// Steps of loops that one invocation takes at most: a workgroup shall not hold up the others, and
/// Mesa's llvmpipe breaks loops off after 65,535 in all.
const STEPS: usize = 60_000;

/// Steps of one load besides.
const STEPS_A_LOAD: usize = 64;

/// Walks round the contact for one load at most: those of the search, those of the pressure, and three
/// steps of each edge for every evaluation of the equations.
const WALKS: usize = 8 + PRESSURE_STEPS as usize + 3 * CORRECTIONS as usize;

/// Most loads for one workgroup, from the steps of each: the twists, and walks along the edges of both
/// faces.
fn most_loads(twists: usize, edges: usize) -> usize {
    (STEPS / (twists + WALKS * edges + STEPS_A_LOAD)).max(1) * GROUP
}

/// Factors between the list and a grip beyond which its loads are the processor's: products of three
/// of them are numbers of f32, and so are their squares.
const LARGEST_FACTOR: f64 = 1e9;

/// How far the axes of a pose may be from orthonormal.
const ORTHONORMAL: f64 = 1e-9;

/// Most of what one chunk holds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) loads: usize,
    pub(crate) grips: usize,
    pub(crate) contacts: usize,
    pub(crate) edges: usize,
    /// Vectors of four numbers.
    pub(crate) basis: usize,
    /// Listed loads.
    pub(crate) cases: usize,
    /// Entries that come back.
    pub(crate) entries: usize,
}

/// Loads of one problem: these places in their [`Spread`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub(super) problem: usize,
    pub(super) first: usize,
    pub(super) count: usize,
}

/// The order in which many loads lie on the device. Neighbours in a list mostly are alike, and loads
/// are compared window by window: in this order every window has some of all kinds, so that the best
/// lower bound is found in the first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    count: usize,
    step: usize,
}

impl Spread {
    pub(super) fn new(count: usize) -> Self {
        let coprime = |step: &usize| {
            let (mut a, mut b) = (*step, count);
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a == 1
        };
        // By the golden ratio: no window comes near the places of another one.
        let from = (count as f64 * 0.618_033_988_75) as usize;
        let step = if count <= WINDOW { 1 } else { (from..).find(coprime).unwrap_or(1) };
        Self { count, step }
    }

    /// The load at a place.
    pub(super) fn load(self, place: usize) -> usize {
        (place as u128 * self.step as u128 % self.count as u128) as usize
    }

    /// The loads at the places of a piece.
    pub(super) fn loads(self, piece: &Piece) -> impl Iterator<Item = usize> {
        (piece.first..piece.first + piece.count).map(move |place| self.load(place))
    }

    /// Whether the loads lie in their own order.
    pub(super) fn is_plain(self) -> bool {
        self.step == 1
    }
}

/// The wrenches of a problem, and which of their places.
type Key = (*const Wrench, usize, usize, usize);

fn key(problem: &Problem<'_>, piece: &Piece) -> Key {
    (problem.wrenches.as_ptr(), problem.wrenches.len(), piece.first, piece.count)
}

/// What goes into one chunk: contacts (as indices) with their pieces.
pub(super) type Plan = Vec<(usize, Vec<Piece>)>;

/// Loads as the device reads them.
#[derive(Debug, PartialEq)]
pub(super) struct List {
    /// What the records' forces \[N\] and moments \[N m\] are divided by: powers of two, so that no
    /// digit of a load depends on the others.
    units: [f64; 2],
    pub(super) records: Vec<CaseRecord>,
}

/// Above every rounding of a size.
const UP: f64 = 1.0 + 1e-6;

impl List {
    fn new(problem: &Problem<'_>, piece: &Piece) -> Self {
        let spread = Spread::new(problem.wrenches.len());
        let wrenches: Vec<Wrench> =
            spread.loads(piece).map(|load| problem.wrenches[load]).collect();
        let units = largest(&wrenches).map(|most| {
            let power = if most > 0.0 { most.log2().ceil().clamp(-900.0, 900.0) } else { 0.0 };
            2.0_f64.powi(power as i32)
        });
        let record = |wrench: &Wrench| {
            let (force, moment) = (wrench.force / units[0], wrench.moment / units[1]);
            CaseRecord {
                force: force.as_vec3().to_array(),
                force_size: (force.length() * UP) as f32,
                moment: moment.as_vec3().to_array(),
                moment_size: (moment.length() * UP) as f32,
            }
        };
        Self { units, records: wrenches.iter().map(record).collect() }
    }
}

/// What the kernels work on in one go.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chunk {
    pub(super) contacts: Vec<ContactHeader>,
    pub(super) edges: Vec<EdgeRecord>,
    /// One behind the other.
    pub(super) lists: Vec<Arc<List>>,
    pub(super) grips: Vec<GripRecord>,
    /// Length of the basis array in vectors of four numbers.
    pub(super) basis: usize,
    pub(super) loads: usize,
    /// Entries that say which loads are open, [`BITS`] of a grip in each.
    pub(super) windows: usize,
    /// Whether every load comes back.
    pub(super) every: bool,
}

/// Vectors that the basis of a contact takes.
fn basis_length(header: &ContactHeader, twists: usize) -> usize {
    header.faces as usize * BASIS * twists
}

/// The largest component of some loads' forces \[N\] and of their moments \[N m\].
pub(super) fn largest(wrenches: &[Wrench]) -> [f64; 2] {
    let most = |of: fn(&Wrench) -> DVec3| {
        wrenches.iter().map(|wrench| of(wrench).abs().max_element()).fold(0.0, f64::max)
    };
    [most(|wrench| wrench.force), most(|wrench| wrench.moment)]
}

/// Whether single precision can make the loads of a problem, the [`largest`] of which are these: all
/// numbers lie within its range.
pub(super) fn is_ordinary(records: &Records, problem: &Problem<'_>, largest: [f64; 2]) -> bool {
    let axes = problem.pose.map_or(DMat3::IDENTITY, |pose| pose.part_from_grip.rotation);
    let apart = axes.transpose() * axes - DMat3::IDENTITY;
    let factors = [
        2.0 * largest[0] / problem.force,
        2.0 * largest[1] / (problem.force * records.unit),
        lever(records, problem).abs().max_element(),
    ];
    factors.iter().all(|x| *x <= LARGEST_FACTOR)
        && apart.to_cols_array().iter().all(|x| x.abs() <= ORTHONORMAL)
}

/// [`GripRecord::lever`].
fn lever(records: &Records, problem: &Problem<'_>) -> DVec3 {
    let origin = records.origin.extend(0.0);
    let from_origin = problem.pose.map_or(-origin, |pose| {
        let frame = pose.part_from_grip;
        pose.centre_of_mass - (frame.origin + frame.rotation * origin)
    });
    from_origin / records.unit
}

/// Cuts problems, given by contact, into chunks within the `limits`.
pub(super) fn plans(
    contacts: &Contacts,
    problems: &[Problem<'_>],
    users: Vec<(usize, Vec<usize>)>,
    (limits, twists): (Limits, usize),
) -> Vec<Plan> {
    let (mut plans, mut plan): (Vec<Plan>, Plan) = (Vec::new(), Plan::new());
    let mut used = Used::default();
    for (slot, users) in users {
        let Some(records) = &contacts.ready[slot].records else { continue };
        let own = [records.edges.len(), basis_length(&records.header, twists)];
        let both = if records.header.faces == 1 { 2 } else { 1 } * records.edges.len();
        let most = most_loads(twists, both).min(PIECE);
        let within = limits.loads.min(limits.cases).min(most);
        let mut fresh = true;
        for problem in users {
            let all = problems[problem].wrenches.len();
            let mut first = 0;
            while first < all {
                let count = within.min(all - first);
                let piece = Piece { problem, first, count };
                let key = key(&problems[problem], &piece);
                if !used.takes(key, own, fresh, limits) {
                    plans.push(std::mem::take(&mut plan));
                    (used, fresh) = (Used::default(), true);
                    continue;
                }
                used.add(key, own, fresh);
                if fresh {
                    plan.push((slot, Vec::new()));
                    fresh = false;
                }
                if let Some((_, pieces)) = plan.last_mut() {
                    pieces.push(piece);
                }
                first += count;
            }
        }
    }
    if !plan.is_empty() {
        plans.push(plan);
    }
    plans
}

/// What a chunk holds so far.
#[derive(Default)]
struct Used {
    loads: usize,
    grips: usize,
    contacts: usize,
    edges: usize,
    basis: usize,
    cases: usize,
    lists: HashSet<Key>,
}

impl Used {
    /// Whether there is room for one more; an empty chunk takes any.
    fn takes(&self, key: Key, own: [usize; 2], fresh: bool, limits: Limits) -> bool {
        let cases = if self.lists.contains(&key) { 0 } else { key.3 };
        self.grips == 0
            || self.loads + key.3 <= limits.loads
                && self.grips < limits.grips
                && self.cases + cases <= limits.cases
                && (!fresh
                    || self.contacts < limits.contacts
                        && self.edges + own[0] <= limits.edges
                        && self.basis + own[1] <= limits.basis)
    }

    fn add(&mut self, key: Key, own: [usize; 2], fresh: bool) {
        self.loads += key.3;
        self.grips += 1;
        if self.lists.insert(key) {
            self.cases += key.3;
        }
        if fresh {
            self.contacts += 1;
            self.edges += own[0];
            self.basis += own[1];
        }
    }
}

/// Makes chunks; keeps the lists of the one before, which most often are those of the next.
#[derive(Default)]
pub(super) struct Maker {
    known: HashMap<Key, Arc<List>>,
}

impl Maker {
    pub(super) fn chunk(
        &mut self,
        (contacts, problems): (&Contacts, &[Problem<'_>]),
        plan: &Plan,
        (twists, wanted): (usize, Wanted),
    ) -> Chunk {
        let mut chunk = Chunk { every: wanted == Wanted::All, ..Chunk::default() };
        let mode = match wanted {
            Wanted::All => EVERY,
            Wanted::Worst => 0,
            Wanted::Estimated => ESTIMATES,
        };
        let before = std::mem::take(&mut self.known);
        // Where the chunk's lists begin.
        let mut places: HashMap<Key, u32> = HashMap::new();
        let mut cases = 0;
        for (slot, pieces) in plan {
            let Some(records) = &contacts.ready[*slot].records else { continue };
            for piece in pieces {
                let problem = &problems[piece.problem];
                let key = key(problem, piece);
                let list = self.known.entry(key).or_insert_with(|| {
                    before.get(&key).cloned().unwrap_or_else(|| Arc::new(List::new(problem, piece)))
                });
                let first = *places.entry(key).or_insert_with(|| {
                    chunk.lists.push(Arc::clone(list));
                    cases += piece.count as u32;
                    cases - piece.count as u32
                });
                let contact = chunk.contacts.len() as u32;
                let mut record = grip(records, problem, list.units);
                (record.contact, record.first) = (contact, first);
                record.count = piece.count as u32;
                record.wanted = mode + MODES * chunk.windows as u32;
                chunk.windows += piece.count.div_ceil(BITS);
                chunk.grips.push(record);
                chunk.loads += piece.count;
            }
            let first_edge = chunk.edges.len() as u32;
            let mut header = records.header;
            header.edges_i += first_edge;
            header.edges_ii += first_edge;
            header.edges_end += first_edge;
            header.basis = chunk.basis as u32;
            chunk.edges.extend_from_slice(&records.edges);
            chunk.basis += basis_length(&header, twists);
            chunk.contacts.push(header);
        }
        chunk
    }
}

/// The record of a grip, without what depends on its place in the chunk.
fn grip(records: &Records, problem: &Problem<'_>, units: [f64; 2]) -> GripRecord {
    let axes = problem.pose.map_or(DMat3::IDENTITY, |pose| pose.part_from_grip.rotation);
    let [row_1, row_2, row_3] =
        [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| axis.as_vec3().to_array());
    let lever = lever(records, problem);
    let distance = problem.distance / records.unit;
    GripRecord {
        row_1,
        force: (units[0] / problem.force) as f32,
        row_2,
        moment: (units[1] / (problem.force * records.unit)) as f32,
        row_3,
        distance: if distance.abs() <= RANGE { distance as f32 } else { OUT_OF_RANGE },
        lever: lever.as_vec3().to_array(),
        arm: (lever.length() * UP) as f32,
        ..GripRecord::default()
    }
}

//! The kernels on the processor: contacts in parallel, loads in lanes. Answers depend on neither.

use rayon::prelude::*;

use super::fan::basis;
use super::layout::{BASIS, ContactHeader, GroupRecord, LoadRecord, SeedRecord};
use super::prepare::{Chunk, basis_length};
use super::search::{Field, Planes};
use super::seeds::SeedSet;

/// Loads searched side by side: what the compiler turns into vector instructions.
const LANES: usize = 16;

/// Seeds of every load of the chunk, in its order.
pub(crate) fn run(chunk: &Chunk, seeds: &SeedSet) -> Vec<SeedRecord> {
    let mut records = vec![SeedRecord::default(); chunk.loads.len()];
    // Groups are in the order of contacts: cut them, and the records, contact by contact.
    let mut jobs = Vec::with_capacity(chunk.contacts.len());
    let (mut groups, mut rest) = (chunk.groups.as_slice(), records.as_mut_slice());
    for (index, header) in chunk.contacts.iter().enumerate() {
        let (mine, others) = groups.split_at(groups.partition_point(|group| group.contact as usize <= index));
        let (out, remaining) = rest.split_at_mut(mine.iter().map(|group| group.count as usize).sum());
        (groups, rest) = (others, remaining);
        jobs.push((header, mine, out));
    }
    jobs.into_par_iter().for_each(|(header, groups, mut out)| {
        let basis = contact_basis(chunk, header, seeds);
        let field = Field { header, edges: &chunk.edges, basis: &basis, twists: seeds.twists(), rings: seeds.rings() };
        let table = Table::new(&field);
        let mut slices = Vec::with_capacity(groups.len());
        for group in groups {
            let (slice, remaining) = out.split_at_mut(group.count as usize);
            slices.push((group, slice));
            out = remaining;
        }
        slices.into_par_iter().with_min_len(16).for_each(|(group, out)| table.search(&field, chunk, group, out));
    });
    records
}

/// The gradient basis of one contact at every twist: `[face][component][twist]`.
pub(crate) fn contact_basis(chunk: &Chunk, header: &ContactHeader, seeds: &SeedSet) -> Vec<f32> {
    let count = seeds.len();
    let mut out = vec![0.0; basis_length(header, count)];
    for face in 0..header.faces as usize {
        let edges = if face == 0 { header.edges_i..header.edges_ii } else { header.edges_ii..header.edges_end };
        let edges = &chunk.edges[edges.start as usize..edges.end as usize];
        for (k, v) in seeds.twists().iter().enumerate() {
            let g = basis(edges, header.radius, [v[0], v[1], v[2]]);
            for (component, value) in g.iter().enumerate() {
                out[(face * BASIS + component) * count + k] = *value;
            }
        }
    }
    out
}

/// What the search of one contact reads for every load and twist.
enum Table {
    /// Congruent faces: the twist over its dissipation; the pressure plays no part.
    Congruent(Vec<[f32; 3]>),
    /// The twist, and the dissipation's parts for unit `at_i`, `at_ii`, `slope`.
    General(Vec<([f32; 3], [f32; 4])>),
}

impl Table {
    fn new(field: &Field<'_>) -> Self {
        let count = field.twists.len();
        let part = |face: usize, weight: usize, k: usize| {
            let at = |m: usize| field.basis[(face * BASIS + 3 * weight + m) * count + k];
            let v = field.twists[k];
            v[0] * at(0) + v[1] * at(1) + v[2] * at(2)
        };
        let twist = |k: usize| [0, 1, 2].map(|m| field.twists[k][m]);
        if field.header.faces == 1 {
            let mean = 2.0 / field.header.area_i;
            return Self::Congruent((0..count).map(|k| twist(k).map(|x| x / (mean * part(0, 0, k)))).collect());
        }
        let parts = |k: usize| [part(0, 0, k), part(1, 0, k), part(0, 1, k) - part(1, 1, k), part(0, 2, k) - part(1, 2, k)];
        Self::General((0..count).map(|k| (twist(k), parts(k))).collect())
    }

    fn search(&self, field: &Field<'_>, chunk: &Chunk, group: &GroupRecord, out: &mut [SeedRecord]) {
        let loads = &chunk.loads[group.first as usize..(group.first + group.count) as usize];
        for (loads, out) in loads.chunks(LANES).zip(out.chunks_mut(LANES)) {
            let planes: Vec<Planes> = loads.iter().map(|load| field.planes(load)).collect();
            let (best, value) = match self {
                Self::Congruent(normals) => best_congruent(normals, loads),
                Self::General(parts) => best_general(parts, loads, &planes),
            };
            for (lane, record) in out.iter_mut().enumerate() {
                *record = field.finish(&loads[lane], planes[lane], best[lane], value[lane]);
            }
        }
    }
}

fn lanes(loads: &[LoadRecord], of: impl Fn(&LoadRecord) -> f32) -> [f32; LANES] {
    std::array::from_fn(|lane| loads.get(lane).map_or(0.0, &of))
}

fn best_congruent(normals: &[[f32; 3]], loads: &[LoadRecord]) -> ([u32; LANES], [f32; LANES]) {
    let [w1, w2, w3] = [0, 1, 2].map(|m| lanes(loads, |load| load.wrench[m]));
    let (mut best, mut value) = ([0_u32; LANES], [-1.0_f32; LANES]);
    for (k, n) in normals.iter().enumerate() {
        for lane in 0..LANES {
            let mu = (w1[lane] * n[0] + w2[lane] * n[1] + w3[lane] * n[2]).abs();
            let better = mu > value[lane];
            best[lane] = if better { k as u32 } else { best[lane] };
            value[lane] = if better { mu } else { value[lane] };
        }
    }
    (best, value)
}

fn best_general(parts: &[([f32; 3], [f32; 4])], loads: &[LoadRecord], planes: &[Planes]) -> ([u32; LANES], [f32; LANES]) {
    let [w1, w2, w3] = [0, 1, 2].map(|m| lanes(loads, |load| load.wrench[m]));
    let plane = |of: fn(&Planes) -> f32| -> [f32; LANES] { std::array::from_fn(|lane| planes.get(lane).map_or(1.0, of)) };
    let [p1, p2, p3, p4] = [plane(|p| p.at_i), plane(|p| p.at_ii), plane(|p| p.slope[0]), plane(|p| p.slope[1])];
    let (mut best, mut value) = ([0_u32; LANES], [-1.0_f32; LANES]);
    for (k, (v, d)) in parts.iter().enumerate() {
        for lane in 0..LANES {
            let power = (w1[lane] * v[0] + w2[lane] * v[1] + w3[lane] * v[2]).abs();
            let mu = power / (p1[lane] * d[0] + p2[lane] * d[1] + p3[lane] * d[2] + p4[lane] * d[3]);
            let better = mu > value[lane];
            best[lane] = if better { k as u32 } else { best[lane] };
            value[lane] = if better { mu } else { value[lane] };
        }
    }
    (best, value)
}

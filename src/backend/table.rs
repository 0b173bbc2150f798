//! What the processor's search reads of one contact for every load, laid out for it: a view of the
//! gradient basis.

use super::fan::fill_basis;
use super::layout::{ContactHeader, EdgeRecord};
use super::search::{gradient, sign_of};
use super::seeds::{NEGATED, RING, SeedSet};
use crate::contact::widest;

/// Places of a ring: its [`RING`] twists, the first again, and the twist in the middle.
pub(crate) const SLOTS: usize = RING + 2;

/// Numbers of [`Table::corner`].
pub(crate) const CORNER: usize = 12;

/// Numbers per twist of [`Table::parts`].
const PARTS: usize = 8;

/// Basis of one contact, arranged for the search.
#[derive(Debug)]
pub(crate) struct Table {
    /// Numbers of a ring's supports.
    ring_length: usize,
    parts: Vec<f32>,
    rings: Vec<f32>,
    corners: Vec<f32>,
}

impl Table {
    /// The basis of the contact with these `edges` (face I's, face II's) at every twist.
    pub(crate) fn new(header: &ContactHeader, edges: [&[EdgeRecord]; 2], seeds: &SeedSet) -> Self {
        let count = seeds.len();
        let basis = contact_basis(header, edges, seeds.twists());
        let at = |face: usize, k: usize, weight: usize| gradient(&basis, count, face, weight, k);
        let congruent = header.faces == 1;
        // Gradients for a unit of each number that the pressure has: those of faces in common, or
        // at_i, at_ii, slope.
        let gradients = |k: usize| -> [[f32; 4]; 4] {
            if congruent {
                return [at(0, k, 0), [0.0; 4], [0.0; 4], [0.0; 4]];
            }
            let less = |weight: usize| {
                let (i, ii) = (at(0, k, weight), at(1, k, weight));
                [i[0] - ii[0], i[1] - ii[1], i[2] - ii[2], i[3] - ii[3]]
            };
            [at(0, k, 0), at(1, k, 0), less(1), less(2)]
        };
        let pressures = if congruent { 1 } else { 4 };
        let ring_length = pressures * 3 * SLOTS;
        let mean = 2.0 / header.area_i;
        let mut table = Self {
            ring_length,
            parts: Vec::with_capacity(count * PARTS),
            rings: vec![0.0; count * ring_length],
            corners: vec![0.0; count * CORNER],
        };
        for (k, v) in seeds.twists().iter().enumerate() {
            let g = gradients(k);
            if congruent {
                let d = mean * g[0][3];
                table.parts.extend([v[0] / d, v[1] / d, v[2] / d, 0.0, 0.0, 0.0, 0.0, 0.0]);
            } else {
                table.parts.extend([v[0], v[1], v[2], g[0][3], g[1][3], g[2][3], g[3][3], 0.0]);
            }
            let (one, x1, x2) = (at(0, k, 0), at(0, k, 1), at(0, k, 2));
            table.corners[k * CORNER..k * CORNER + 9]
                .copy_from_slice(&[v[0], v[1], v[2], one[0], one[1], x1[0], x1[1], x2[0], x2[1]]);
            let ring = &mut table.rings[k * ring_length..(k + 1) * ring_length];
            let around = &seeds.rings()[k];
            for slot in 0..SLOTS {
                let entry = if slot == SLOTS - 1 { k as u32 } else { around[slot % RING] };
                let sign = sign_of(entry);
                let g = gradients((entry & !NEGATED) as usize);
                for pressure in 0..pressures {
                    for m in 0..3 {
                        ring[(pressure * 3 + m) * SLOTS + slot] = sign * g[pressure][m];
                    }
                }
            }
        }
        table
    }

    /// For each twist what gives its value. Congruent faces: the twist over its dissipation (3).
    /// Otherwise: the twist (3), and the dissipation for a unit of `at_i`, `at_ii`, `slope` (4).
    #[inline(always)]
    pub(crate) fn parts(&self) -> impl Iterator<Item = &[f32; PARTS]> {
        self.parts.as_chunks().0.iter()
    }

    /// Supports of the ring of a twist: `[pressure][component][slot]`.
    #[inline(always)]
    pub(crate) fn ring(&self, twist: usize) -> &[f32] {
        &self.rings[twist * self.ring_length..(twist + 1) * self.ring_length]
    }

    /// A twist (3) and the first two components of its gradients on face I for the weights `1, x1,
    /// x2` (6).
    #[inline(always)]
    pub(crate) fn corner(&self, twist: usize) -> &[f32] {
        &self.corners[twist * CORNER..(twist + 1) * CORNER]
    }
}

widest! {
    /// [`fill_basis`]; both ways to compile it do the same operations in the same order.
    pub(crate) fn contact_basis(header: &ContactHeader, edges: [&[EdgeRecord]; 2], twists: &[[f32; 4]]) -> Vec<[f32; 4]> = fill_basis
}

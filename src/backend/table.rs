//! What the processor's search reads of one contact for every load, laid out for it: a view of the
//! gradient basis.

use std::sync::OnceLock;

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
pub(crate) const PARTS: usize = 8;

/// Basis of one contact, arranged for the search.
#[derive(Debug)]
pub(crate) struct Table<'a> {
    seeds: &'a SeedSet,
    /// Whether face II is as face I.
    congruent: bool,
    /// Of [`contact_basis`].
    basis: Vec<[f32; 4]>,
    parts: Vec<[f32; PARTS]>,
    /// Made where a load asks for them: most twists are the best one of none that can be the worst.
    rings: Vec<OnceLock<Box<[f32]>>>,
}

impl<'a> Table<'a> {
    /// The basis of the contact with these `edges` (face I's, face II's) at every twist.
    pub(crate) fn new(
        header: &ContactHeader,
        edges: [&[EdgeRecord]; 2],
        seeds: &'a SeedSet,
    ) -> Self {
        let count = seeds.len();
        let mut table = Self {
            seeds,
            congruent: header.faces == 1,
            basis: contact_basis(header, edges, seeds.twists()),
            parts: Vec::with_capacity(count),
            rings: Vec::new(),
        };
        table.rings.resize_with(count, OnceLock::new);
        let mean = 2.0 / header.area_i;
        for (k, v) in seeds.twists().iter().enumerate() {
            table.parts.push(if table.congruent {
                let d = mean * table.at(0, k, 0)[3];
                [v[0] / d, v[1] / d, v[2] / d, 0.0, 0.0, 0.0, 0.0, 0.0]
            } else {
                let d = |pressure: usize| table.gradient(pressure, k)[3];
                [v[0], v[1], v[2], d(0), d(1), d(2), d(3), 0.0]
            });
        }
        table
    }

    #[inline(always)]
    fn at(&self, face: usize, twist: usize, weight: usize) -> [f32; 4] {
        gradient(&self.basis, self.seeds.len(), face, weight, twist)
    }

    /// Numbers that the pressure has: that of faces in common, or `at_i, at_ii, slope`.
    fn pressures(&self) -> usize {
        if self.congruent { 1 } else { 4 }
    }

    /// Gradient for a unit of one of the numbers that the pressure has.
    #[inline(always)]
    fn gradient(&self, pressure: usize, twist: usize) -> [f32; 4] {
        match pressure {
            0 | 1 => self.at(pressure, twist, 0),
            _ => {
                let (i, ii) = (self.at(0, twist, pressure - 1), self.at(1, twist, pressure - 1));
                [i[0] - ii[0], i[1] - ii[1], i[2] - ii[2], i[3] - ii[3]]
            }
        }
    }

    /// For each twist what gives its value. Congruent faces: the twist over its dissipation (3).
    /// Otherwise: the twist (3), and the dissipation for a unit of `at_i`, `at_ii`, `slope` (4).
    #[inline(always)]
    pub(crate) fn parts(&self) -> &[[f32; PARTS]] {
        &self.parts
    }

    /// Support of a twist under a pressure.
    #[inline(always)]
    pub(crate) fn support<const PRESSURES: usize>(
        &self,
        twist: usize,
        pressures: [f32; PRESSURES],
    ) -> [f32; 3] {
        let mut g = [0.0_f32; 3];
        for (of, pressure) in pressures.into_iter().enumerate() {
            let support = self.gradient(of, twist);
            for m in 0..3 {
                g[m] += pressure * support[m];
            }
        }
        g
    }

    /// Supports of the ring of a twist: `[pressure][component][slot]`.
    #[inline(always)]
    pub(crate) fn ring(&self, twist: usize) -> &[f32] {
        self.rings[twist].get_or_init(|| self.supports_round(twist))
    }

    #[cold]
    fn supports_round(&self, twist: usize) -> Box<[f32]> {
        let around = &self.seeds.rings()[twist];
        let mut ring = vec![0.0; self.pressures() * 3 * SLOTS].into_boxed_slice();
        for slot in 0..SLOTS {
            let entry = if slot == SLOTS - 1 { twist as u32 } else { around[slot % RING] };
            let sign = sign_of(entry);
            for pressure in 0..self.pressures() {
                let g = self.gradient(pressure, (entry & !NEGATED) as usize);
                for m in 0..3 {
                    ring[(pressure * 3 + m) * SLOTS + slot] = sign * g[m];
                }
            }
        }
        ring
    }

    /// A twist (3) and the first two components of its gradients on face I for the weights `1, x1,
    /// x2` (6).
    #[inline(always)]
    pub(crate) fn corner(&self, twist: usize) -> [f32; CORNER] {
        let v = &self.seeds.twists()[twist];
        let (one, x1, x2) = (self.at(0, twist, 0), self.at(0, twist, 1), self.at(0, twist, 2));
        [v[0], v[1], v[2], one[0], one[1], x1[0], x1[1], x2[0], x2[1], 0.0, 0.0, 0.0]
    }
}

widest! {
    /// [`fill_basis`]; both ways to compile it do the same operations in the same order.
    pub(crate) fn contact_basis(header: &ContactHeader, edges: [&[EdgeRecord]; 2], twists: &[[f32; 4]]) -> Vec<[f32; 4]> = fill_basis
}

//! What the processor's search reads of one contact for every load, laid out for it: a view of the
//! gradient basis.

use super::fan::{basis_far, basis_near, is_near};
use super::layout::{BASIS, ContactHeader, EdgeRecord};
use super::seeds::{NEGATED, RING, SeedSet};

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
        let basis = contact_basis(header, edges, seeds);
        let at = |face: usize, k: usize, weight: usize| {
            let first = ((face * count + k) * 3 + weight) * 4;
            [basis[first], basis[first + 1], basis[first + 2], basis[first + 3]]
        };
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
                let sign = if entry & NEGATED != 0 { -1.0 } else { 1.0 };
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

/// The gradient basis of one contact at every twist, as the GPU's kernel writes it:
/// `[face][twist][weight]`, and in each the components `g1, g2, torque` and their product with the
/// twist.
pub(crate) fn contact_basis(
    header: &ContactHeader,
    edges: [&[EdgeRecord]; 2],
    seeds: &SeedSet,
) -> Vec<f32> {
    let mut out = Vec::with_capacity(header.faces as usize * seeds.len() * BASIS * 4);
    let mut push = |v: &[f32; 4], g: [f32; 9]| {
        for g in g.as_chunks::<3>().0 {
            out.extend([g[0], g[1], g[2], v[0] * g[0] + v[1] * g[1] + v[2] * g[2]]);
        }
    };
    // Twists come by falling rotation: the near ones first.
    let twists = seeds.twists();
    let (near, far) =
        twists.split_at(twists.partition_point(|v| is_near(header.radius, [v[0], v[1], v[2]])));
    for edges in &edges[..header.faces as usize] {
        for v in near {
            push(v, basis_near(edges, [v[0], v[1], v[2]]));
        }
        for some in far.chunks(FAR_LANES) {
            let v =
                [0, 1, 2].map(|m| std::array::from_fn(|lane| some[lane.min(some.len() - 1)][m]));
            let g = far_widest(edges, &v);
            for (lane, v) in some.iter().enumerate() {
                push(v, g.map(|g| g[lane]));
            }
        }
    }
    out
}

/// Far twists integrated side by side.
const FAR_LANES: usize = 8;

/// [`basis_far`] with the widest vectors that the processor has; the same operations in the same
/// order.
fn far_widest(edges: &[EdgeRecord], v: &[[f32; FAR_LANES]; 3]) -> [[f32; FAR_LANES]; 9] {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        #[allow(
            unsafe_code,
            reason = "twice the speed of the baseline's vectors; the feature was just detected"
        )]
        // SAFETY: the function needs AVX2, which this processor has.
        return unsafe { far_avx2(edges, v) };
    }
    basis_far(edges, v)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn far_avx2(edges: &[EdgeRecord], v: &[[f32; FAR_LANES]; 3]) -> [[f32; FAR_LANES]; 9] {
    basis_far(edges, v)
}

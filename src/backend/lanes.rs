//! Loads side by side, and what the shading language has built in, written so that loops over lanes
//! stay vector code.

use super::layout::LoadRecord;

/// Loads searched side by side.
pub(crate) const LANES: usize = 16;

/// A number of each load.
pub(crate) type Lanes = [f32; LANES];

/// [`LoadRecord`]s side by side; the places beyond the last hold no load.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loads {
    pub(crate) wrench: [Lanes; 3],
    pub(crate) scale: Lanes,
    pub(crate) f3: Lanes,
    pub(crate) m1: Lanes,
    pub(crate) m2: Lanes,
    pub(crate) distance: Lanes,
}

impl Loads {
    #[inline(always)]
    pub(crate) fn new(loads: &[LoadRecord]) -> Self {
        let zero = [0.0; LANES];
        let mut all =
            Self { wrench: [zero; 3], scale: zero, f3: zero, m1: zero, m2: zero, distance: zero };
        for (lane, load) in loads.iter().enumerate().take(LANES) {
            for m in 0..3 {
                all.wrench[m][lane] = load.wrench[m];
            }
            all.scale[lane] = load.scale;
            all.f3[lane] = load.f3;
            all.m1[lane] = load.m1;
            all.m2[lane] = load.m2;
            all.distance[lane] = load.distance;
        }
        all
    }

    /// Some of the loads in `blocks`, by their places there.
    #[inline(always)]
    pub(crate) fn gathered(blocks: &[Self], places: &[u32]) -> Self {
        let mut all = Self::new(&[]);
        for (lane, &place) in places.iter().enumerate().take(LANES) {
            let (block, from) = (&blocks[place as usize / LANES], place as usize % LANES);
            for m in 0..3 {
                all.wrench[m][lane] = block.wrench[m][from];
            }
            all.scale[lane] = block.scale[from];
            all.f3[lane] = block.f3[from];
            all.m1[lane] = block.m1[from];
            all.m2[lane] = block.m2[from];
            all.distance[lane] = block.distance[from];
        }
        all
    }
}

#[inline(always)]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(crate) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// `a` where `first`, else `b`; by masks, because a choice becomes a store under a condition, which
/// is slow.
#[inline(always)]
pub(crate) fn pick(first: bool, a: u32, b: u32) -> u32 {
    let mask = 0_u32.wrapping_sub(u32::from(first));
    (a & mask) | (b & !mask)
}

#[inline(always)]
pub(crate) fn pick_number(first: bool, a: f32, b: f32) -> f32 {
    f32::from_bits(pick(first, a.to_bits(), b.to_bits()))
}

#[inline(always)]
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

//! Triangles that are one flat piece of surface, cut up.
//!
//! How finely a program cuts a flat piece says nothing of the part. Planes therefore grow by flat
//! patches, not by triangles: from the largest to the smallest, and each is taken as a whole or not.

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::Mesh;
use super::given::GivenFaces;
use super::order::counted;
use super::regions::{Flatness, Sums, is_flat, twice_normal};
use super::repair::Repaired;
use super::topology::NONE;
use crate::geometry::UnionFind;

/// Sine of the angle between triangles below which they are level.
const LEVEL: f64 = 1e-6;
/// What rounding of the corners may add to it at most: 0.3 degrees.
const MOST: f64 = 5e-3;
/// Square of the sine of the angle, 30 degrees, from which on neighbours meet at an edge of the part,
/// however sharp: there rounding would decide which is sharper.
const EDGE: f64 = 0.25;
/// Factor above the largest area from which its steps of two are counted, so that rounding does not
/// part equal areas at a step.
const EQUAL: f64 = 1.001;
/// Triangles from which on what a patch adds up to is kept.
const MANY: usize = 8;

/// The mesh's triangles in flat patches.
pub(super) struct Patches {
    /// Triangles in order of patches.
    order: Vec<u32>,
    /// Where each patch begins in it, and the end of the last one.
    begins: Vec<u32>,
    /// Patch of each triangle.
    of: Vec<u32>,
    /// What the triangles of larger patches add up to.
    sums: FxHashMap<u32, Sums>,
}

impl Patches {
    /// Joins neighbours that are level up to the rounding of their corners, where all of what they
    /// join is as flat as `flatness` asks. None crosses the border of a face that the file states.
    pub(super) fn new(part: &Repaired, given: &GivenFaces, flatness: Flatness) -> Self {
        let count = part.mesh.triangles.len();
        let level = level(part, given);
        let mut sets = UnionFind::new(count);
        for (half, _) in level.iter().enumerate().filter(|entry| *entry.1) {
            sets.join(half / 3, part.edges.twin[half] as usize / 3);
        }
        drop(level);
        // The triangles of each set one after the other, the sets by their first ones.
        let roots: Vec<u32> = (0..count).map(|triangle| sets.root(triangle) as u32).collect();
        let mut members = vec![0_u32; count];
        let places = counted(roots.iter().map(|&root| root as usize), count);
        for (&place, triangle) in places.iter().zip(0..) {
            members[place as usize] = triangle;
        }
        drop(places);
        let mut patches = Self {
            order: Vec::with_capacity(count),
            begins: vec![0],
            of: vec![0; count],
            sums: FxHashMap::default(),
        };
        let same = |a: &u32, b: &u32| roots[*a as usize] == roots[*b as usize];
        for triangles in members.chunk_by(same) {
            if let [_] = triangles {
                patches.add(triangles);
                continue;
            }
            let sums = Sums::of(&part.mesh, triangles);
            if is_flat(part, triangles, &sums, flatness) {
                if triangles.len() >= MANY {
                    patches.sums.insert(patches.begins.len() as u32 - 1, sums);
                }
                patches.add(triangles);
            } else {
                // A gentle bend, cut finely.
                triangles.chunks(1).for_each(|triangle| patches.add(triangle));
            }
        }
        patches
    }

    fn add(&mut self, triangles: &[u32]) {
        let number = self.begins.len() as u32 - 1;
        triangles.iter().for_each(|&triangle| self.of[triangle as usize] = number);
        self.order.extend(triangles);
        self.begins.push(self.order.len() as u32);
    }

    /// Adds a patch to the sums of a region.
    pub(super) fn add_to(&self, sums: &mut Sums, mesh: &Mesh, patch: u32) {
        match self.sums.get(&patch) {
            Some(own) => sums.join(own),
            None => sums.add_all(mesh, self.triangles(patch)),
        }
    }

    /// The patch of a triangle.
    pub(super) fn of(&self, triangle: u32) -> u32 {
        self.of[triangle as usize]
    }

    /// The triangles of a patch.
    pub(super) fn triangles(&self, patch: u32) -> &[u32] {
        let at = |index: u32| self.begins[index as usize] as usize;
        &self.order[at(patch)..at(patch + 1)]
    }

    /// Patches by falling area, in steps of a factor of two from the largest; within a step the one
    /// that bends least against its neighbours first, so that a plane that runs out into a bend is
    /// found from its middle; of equals the one with the lowest corners.
    pub(super) fn seeds(&self, part: &Repaired) -> Vec<u32> {
        // Those of a patch depend on its border alone, wherever it is cut.
        let vectors: Vec<DVec3> = (0..self.begins.len() as u32 - 1)
            .into_par_iter()
            .map(|patch| {
                if let Some(sums) = self.sums.get(&patch) {
                    return 2.0 * sums.vector;
                }
                let triangles = self.triangles(patch).iter();
                triangles.map(|&triangle| twice_normal(part.mesh.corners(triangle))).sum()
            })
            .collect();
        let largest = vectors.iter().map(|vector| vector.length_squared()).fold(0.0, f64::max);
        let scale = 1.0 / (EQUAL * largest.sqrt()).max(f64::MIN_POSITIVE);
        let mut keys: Vec<(u16, u32, [u32; 3], u32)> = vectors
            .par_iter()
            .zip(0..vectors.len() as u32)
            .map(|(vector, patch)| {
                let mut bend: f64 = 0.0;
                let mut lowest = [NONE; 3];
                for &triangle in self.triangles(patch) {
                    for corner in 0..3 {
                        let twin = part.edges.twin[3 * triangle as usize + corner];
                        let other = if twin == NONE { NONE } else { self.of[twin as usize / 3] };
                        if other == patch {
                            continue;
                        }
                        let ends = part.mesh.triangles[triangle as usize];
                        for end in [ends[corner], ends[(corner + 1) % 3]] {
                            insert(&mut lowest, end);
                        }
                        if other != NONE {
                            let other = vectors[other as usize];
                            let across = vector.cross(other).length_squared();
                            let lengths = vector.length_squared() * other.length_squared();
                            bend = bend.max(across / lengths.max(f64::MIN_POSITIVE)).min(EDGE);
                            if vector.dot(other) < 0.0 {
                                bend = EDGE;
                            }
                        }
                    }
                }
                // Exponent of a 32-bit number and 12 bits of its mantissa: numbers above zero
                // compare as their bits do. Below the floor it is rounding.
                let bend = if bend > LEVEL * LEVEL { (bend as f32).to_bits() >> 11 } else { 0 };
                (area_step(*vector * scale), bend, lowest, patch)
            })
            .collect();
        keys.par_sort_unstable();
        keys.into_iter().map(|key| key.3).collect()
    }
}

/// Step of a factor of two of a triangle's area, falling, by the vector of twice that length.
pub(super) fn area_step(twice_normal: DVec3) -> u16 {
    // Exponent of the squared area; half of it is that of the area.
    (0x7ff - ((twice_normal.length_squared().to_bits() >> 52) as u16 & 0x7ff)) / 2
}

/// Keeps the lowest numbers, rising and each once.
fn insert(lowest: &mut [u32; 3], number: u32) {
    if lowest.contains(&number) || number > lowest[2] {
        return;
    }
    lowest[2] = number;
    lowest.sort_unstable();
}

/// Whether the triangles on both sides of each half-edge are level: told at the first half of an edge.
fn level(part: &Repaired, given: &GivenFaces) -> Vec<bool> {
    let count = part.mesh.triangles.len() as u32;
    // The unit normal, and how far rounding of the corners tilts it.
    let normals: Vec<Option<(DVec3, f64)>> = (0..count)
        .into_par_iter()
        .map(|triangle| {
            let corners = part.mesh.corners(triangle);
            let [a, b, c] = corners;
            let cross = twice_normal(corners);
            let [ab, bc, ca] = [b - a, c - b, a - c].map(|edge| edge.length_squared());
            let length = cross.length();
            let tilt = 2.0 * part.noise * ab.max(bc).max(ca).sqrt() / length;
            (tilt < MOST).then(|| (cross / length, tilt))
        })
        .collect();
    part.edges
        .twin
        .par_iter()
        .enumerate()
        .map(|(half, &twin)| {
            let triangle = half / 3;
            if twin == NONE
                || (twin as usize) < half
                || given.of(triangle as u32) != given.of(twin / 3)
            {
                return false;
            }
            match (normals[triangle], normals[twin as usize / 3]) {
                (Some((normal, tilt)), Some((other, more))) => {
                    normal.dot(other) > 0.0
                        && normal.cross(other).length() < LEVEL + (tilt + more).min(MOST)
                }
                _ => false,
            }
        })
        .collect()
}

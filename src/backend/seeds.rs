//! The fixed set of twists at which the seed stage evaluates every load: vertices of a geodesic
//! sphere.
//!
//! A twist `(u1, u2, omega)` and its negative have the same dissipation, so one of each antipodal
//! pair is kept. The poles are rotations about the origin of the scaled pad frame, the equator are
//! translations. Twists are ordered by falling `omega`: neighbours in the array have slip centres
//! at similar distances, so a kernel's near and far branches diverge in few places.

use std::collections::HashMap;

use crate::error::{Error, Result};
use crate::geometry::sphere;

/// Set in a [`SeedSet`] ring entry when the neighbour is the negative of the stored twist.
pub const NEGATED: u32 = 1 << 31;

/// Neighbours of a vertex; the twelve vertices of the icosahedron have five, the last entry then
/// repeats the first.
pub const RING: usize = 6;

/// Twists spread over half of the twist sphere, with their neighbours.
#[derive(Debug, Clone, PartialEq)]
pub struct SeedSet {
    frequency: u32,
    twists: Vec<[f32; 4]>,
    rings: Vec<[u32; RING]>,
    /// The set of half the frequency within this one, where there is one: each of its twists with
    /// its ring, by the indices of this set.
    half: Vec<(u32, [u32; RING])>,
}

impl SeedSet {
    /// Largest frequency accepted: 20,481 twists.
    pub const MAX_FREQUENCY: u32 = 64;

    /// The default's frequency. 81 twists: with interpolated seeds and support bounds, finer sets
    /// cost more in the search than they save in the polish (`benches/RESULTS.md`).
    pub const DEFAULT_FREQUENCY: u32 = 4;

    /// The set with every edge of the icosahedron divided into `frequency` parts: `5 frequency^2 +
    /// 1` twists.
    ///
    /// # Errors
    /// A bad value when `frequency` is not in `1..=64`.
    pub fn new(frequency: u32) -> Result<Self> {
        if !(1..=Self::MAX_FREQUENCY).contains(&frequency) {
            return Err(Error::input(
                "seed set",
                format!("frequency {frequency} is not in 1..={}", Self::MAX_FREQUENCY),
                "use 4 (81 twists) or 8 (321 twists)",
            ));
        }
        Ok(Self::build(frequency))
    }

    /// The smallest set with at least `count` twists.
    ///
    /// # Errors
    /// A bad value when `count` is zero or above 20,481.
    pub fn with_at_least(count: usize) -> Result<Self> {
        let largest = 5 * (Self::MAX_FREQUENCY as usize).pow(2) + 1;
        match (1..=Self::MAX_FREQUENCY).find(|&f| 5 * (f as usize).pow(2) + 1 >= count) {
            Some(frequency) if count > 0 => Ok(Self::build(frequency)),
            _ => Err(Error::input(
                "seed set",
                format!("{count} twists asked for"),
                format!("ask for 1 to {largest} twists"),
            )),
        }
    }

    /// Number of twists.
    pub fn len(&self) -> usize {
        self.twists.len()
    }

    /// Never true: the smallest set has six twists.
    pub fn is_empty(&self) -> bool {
        self.twists.is_empty()
    }

    /// Parts into which each edge of the icosahedron is divided.
    pub fn frequency(&self) -> u32 {
        self.frequency
    }

    /// Unit twists `(u1, u2, omega, 0)` in scaled coordinates, `omega` falling.
    pub fn twists(&self) -> &[[f32; 4]] {
        &self.twists
    }

    /// For each twist its neighbours in cyclic order: index into [`Self::twists`], with [`NEGATED`]
    /// set where the neighbour is the stored twist's negative. Triangles of the sphere at twist `k`
    /// are `(k, ring[i], ring[i + 1])`.
    pub fn rings(&self) -> &[[u32; RING]] {
        &self.rings
    }

    /// The set of half the frequency, a quarter as many twists: index and ring of each in this set.
    /// Empty for an odd frequency.
    pub(super) fn half(&self) -> &[(u32, [u32; RING])] {
        &self.half
    }

    fn build(frequency: u32) -> Self {
        let (points, triangles) = geodesic_sphere(frequency);
        let index_of: HashMap<[i64; 3], usize> =
            points.iter().enumerate().map(|(i, &p)| (key(p), i)).collect();
        let mut kept: Vec<usize> =
            (0..points.len()).filter(|&i| is_representative(points[i])).collect();
        kept.sort_by(|&a, &b| points[b][2].total_cmp(&points[a][2]).then(a.cmp(&b)));
        // Where each vertex of the whole sphere is found among the kept ones.
        let mut entry = vec![0_u32; points.len()];
        for (position, &vertex) in kept.iter().enumerate() {
            entry[vertex] = position as u32;
            if let Some(&opposite) = index_of.get(&key(points[vertex].map(|x| -x))) {
                entry[opposite] = position as u32 | NEGATED;
            }
        }
        let followers = followers(points.len(), &triangles);
        let rings: Vec<_> = kept
            .iter()
            .map(|&vertex| ring(&followers[vertex]).map(|neighbour| entry[neighbour]))
            .collect();
        let half = if frequency.is_multiple_of(2) {
            within(frequency / 2, |point| index_of.get(&key(point)).map(|&i| entry[i]))
        } else {
            Vec::new()
        };
        let twists = kept
            .iter()
            .map(|&vertex| points[vertex].map(|x| x as f32))
            .map(|[x, y, z]| [x, y, z, 0.0])
            .collect();
        Self { frequency, twists, rings, half }
    }
}

impl Default for SeedSet {
    fn default() -> Self {
        Self::build(Self::DEFAULT_FREQUENCY)
    }
}

/// One of `p` and `-p`: that with positive `omega`, on the equator that with positive `u2`, then
/// `u1`.
fn is_representative([x, y, z]: [f64; 3]) -> bool {
    z > 0.0 || z == 0.0 && (y > 0.0 || y == 0.0 && x > 0.0)
}

/// The twists and rings of the set with this frequency by the entries that its points have in
/// another one; nothing if one of them is not found there.
fn within(frequency: u32, entry: impl Fn([f64; 3]) -> Option<u32>) -> Vec<(u32, [u32; RING])> {
    let (points, triangles) = geodesic_sphere(frequency);
    let Some(entries) = points.iter().map(|&point| entry(point)).collect::<Option<Vec<u32>>>()
    else {
        return Vec::new();
    };
    let followers = followers(points.len(), &triangles);
    let ours = (0..points.len()).filter(|&vertex| entries[vertex] & NEGATED == 0);
    ours.map(|vertex| {
        (entries[vertex], ring(&followers[vertex]).map(|neighbour| entries[neighbour]))
    })
    .collect()
}

/// The pairs (neighbour, next neighbour) of each of so many vertices, counter-clockwise.
fn followers(vertices: usize, triangles: &[[usize; 3]]) -> Vec<Vec<(usize, usize)>> {
    // For vertex a of triangle (a, b, c): b is followed by c in the ring of a.
    let mut followers: Vec<Vec<(usize, usize)>> = vec![Vec::new(); vertices];
    for &[a, b, c] in triangles {
        followers[a].push((b, c));
        followers[b].push((c, a));
        followers[c].push((a, b));
    }
    followers
}

/// Neighbours in cyclic order from the pairs (neighbour, next neighbour).
fn ring(followers: &[(usize, usize)]) -> [usize; RING] {
    let mut ring = [followers[0].0; RING];
    for i in 1..RING {
        let previous = ring[i - 1];
        ring[i] = followers.iter().find(|pair| pair.0 == previous).map_or(previous, |pair| pair.1);
    }
    ring
}

/// Coordinates rounded to 1e-6: equal for the copies of one vertex (they differ by rounding,
/// ~1e-16), different for neighbours (at least 0.01 apart up to the largest frequency).
fn key(p: [f64; 3]) -> [i64; 3] {
    p.map(|x| (x * 1e6).round() as i64)
}

/// Vertices and outward triangles of the geodesic sphere. A coordinate that is zero but for rounding
/// becomes zero: translations shall be exactly that.
fn geodesic_sphere(frequency: u32) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let (points, triangles) = sphere::geodesic(frequency as usize);
    let clean = |x: f64| if x.abs() < 1e-12 { 0.0 } else { x };
    (points.iter().map(|point| point.to_array().map(clean)).collect(), triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frequency_has_its_count_units_and_closed_rings() {
        for frequency in [1, 2, 3, 4, 5, 7, 8, 12, 16, 31, 64] {
            let set = SeedSet::new(frequency).unwrap();
            assert_eq!(set.len(), 5 * (frequency as usize).pow(2) + 1, "frequency {frequency}");
            assert!(set.twists().is_sorted_by(|a, b| a[2] >= b[2]));
            let mut corners = 0;
            for (k, ring) in set.rings().iter().enumerate() {
                let twist = |e: u32| {
                    set.twists()[(e & !NEGATED) as usize]
                        .map(|x| if e & NEGATED != 0 { -x } else { x })
                };
                let here = set.twists()[k];
                assert!((here.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-6);
                let valence = if ring[5] == ring[0] { 5 } else { 6 };
                corners += usize::from(valence == 5);
                for i in 0..valence {
                    let (a, b) = (twist(ring[i]), twist(ring[(i + 1) % valence]));
                    let volume = here[0] * (a[1] * b[2] - a[2] * b[1])
                        + here[1] * (a[2] * b[0] - a[0] * b[2])
                        + here[2] * (a[0] * b[1] - a[1] * b[0]);
                    assert!(
                        volume > 0.0,
                        "frequency {frequency}, twist {k}: ring not counter-clockwise"
                    );
                }
            }
            assert_eq!(corners, 6, "half of the icosahedron's corners");
        }
    }

    #[test]
    fn even_frequencies_hold_the_pure_rotation_and_translations() {
        for frequency in [2, 4, 8] {
            let set = SeedSet::new(frequency).unwrap();
            assert_eq!(set.twists()[0], [0.0, 0.0, 1.0, 0.0]);
            assert!(set.twists().iter().filter(|v| v[2] == 0.0).count() >= 2 * frequency as usize);
        }
    }

    #[test]
    fn a_set_of_even_frequency_holds_that_of_half_of_it() {
        for frequency in [2, 4, 8, 12, 64] {
            let set = SeedSet::new(frequency).unwrap();
            let half = SeedSet::new(frequency / 2).unwrap();
            let twist = |entry: u32| {
                let sign = if entry & NEGATED != 0 { -1.0 } else { 1.0 };
                glam::Vec4::from(set.twists()[(entry & !NEGATED) as usize]) * sign
            };
            assert_eq!(set.half().len(), half.len(), "frequency {frequency}");
            for (k, ring) in set.half() {
                let is = |twist: glam::Vec4| {
                    move |other: &[f32; 4]| glam::Vec4::from(*other).distance(twist) < 1e-6
                };
                let place = half.twists().iter().position(is(twist(*k))).unwrap();
                for neighbour in half.rings()[place] {
                    let other = glam::Vec4::from(half.twists()[(neighbour & !NEGATED) as usize]);
                    let other = if neighbour & NEGATED != 0 { -other } else { other };
                    assert!(ring.iter().any(|&entry| twist(entry).distance(other) < 1e-6));
                }
            }
        }
        assert!(SeedSet::new(3).unwrap().half().is_empty());
    }

    #[test]
    fn sizes_out_of_range_are_refused() {
        assert!(SeedSet::new(0).is_err() && SeedSet::new(65).is_err());
        assert!(SeedSet::with_at_least(0).is_err() && SeedSet::with_at_least(20_482).is_err());
        assert_eq!(SeedSet::with_at_least(100).unwrap().len(), 126);
    }
}

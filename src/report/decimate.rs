//! Fewer triangles for display: edge collapses by quadric error (Garland and Heckbert 1997), in
//! f64.
//!
//! A vertex only ever moves onto a neighbour, so corners of the part stay where they are and a
//! refined planar face collapses at no error. Each pass takes the cheapest collapses whose
//! neighbourhoods do not touch; a collapse that would turn a triangle over or pinch the surface is
//! refused. Nothing here feeds the mechanics.

use glam::DVec3;
use rayon::prelude::*;

/// Smallest cosine between a triangle's normal before and after a collapse; keeps the surface from
/// folding.
const FLIP_COSINE: f64 = 0.25;
/// Weight of the planes that hold open boundaries in place, over the weight of the surface.
const BOUNDARY_WEIGHT: f64 = 10.0;
/// Share of the squared edge length added to a collapse's cost: of many free collapses the shortest
/// come first, which keeps the triangles of a plane compact.
const LENGTH_WEIGHT: f64 = 1e-7;
/// More passes than a reduction by a factor of a million takes.
const MAX_PASSES: usize = 80;

/// Squared distances to weighted planes, summed: `p^T A p + 2 b.p + c`.
#[derive(Clone, Copy, Default)]
struct Quadric {
    a: [f64; 6],
    b: DVec3,
    c: f64,
}

impl Quadric {
    fn plane(normal: DVec3, point: DVec3, weight: f64) -> Self {
        let (n, offset) = (normal, -normal.dot(point));
        let a = [n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z]
            .map(|value| weight * value);
        Self { a, b: n * (weight * offset), c: weight * offset * offset }
    }

    fn add(&mut self, other: &Self) {
        for (into, value) in self.a.iter_mut().zip(other.a) {
            *into += value;
        }
        self.b += other.b;
        self.c += other.c;
    }

    fn at(&self, p: DVec3) -> f64 {
        let a = &self.a;
        let quadratic = p.x * (a[0] * p.x + 2.0 * (a[1] * p.y + a[2] * p.z))
            + p.y * (a[3] * p.y + 2.0 * a[4] * p.z)
            + p.z * a[5] * p.z;
        (quadratic + 2.0 * self.b.dot(p) + self.c).max(0.0)
    }
}

/// Triangles of each vertex, as ranges of one array.
struct Stars {
    start: Vec<u32>,
    triangle: Vec<u32>,
}

impl Stars {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let mut start = vec![0u32; vertices + 1];
        for &corner in triangles.iter().flatten() {
            start[corner as usize + 1] += 1;
        }
        for i in 0..vertices {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut triangle = vec![0u32; triangles.len() * 3];
        for (t, corners) in triangles.iter().enumerate() {
            for &corner in corners {
                triangle[next[corner as usize] as usize] = t as u32;
                next[corner as usize] += 1;
            }
        }
        Self { start, triangle }
    }

    fn of(&self, vertex: u32) -> &[u32] {
        &self.triangle
            [self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize]
    }
}

/// Triangles over the same vertices, at most about `budget` of them where the surface allows it.
/// Indices must be in range and coordinates finite; the order of the result depends on the input
/// only.
pub(super) fn decimate(vertices: &[DVec3], triangles: &[[u32; 3]], budget: usize) -> Vec<[u32; 3]> {
    let (low, high) = vertices
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
    let size = (high - low).max_element();
    if triangles.len() <= budget || size.is_nan() || size <= 0.0 {
        return triangles.to_vec();
    }
    // Unit size about the middle: quadrics then lose no digits to the position of the part.
    let points: Vec<DVec3> = vertices.iter().map(|&v| (v - (low + high) / 2.0) / size).collect();
    let mut live: Vec<[u32; 3]> = triangles
        .iter()
        .copied()
        .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .collect();
    let mut quadrics = quadrics(&points, &live);
    let mut marks = Marks { epoch: 0, seen: vec![0; points.len()] };
    for _ in 0..MAX_PASSES {
        if live.len() <= budget || !pass(&points, &mut quadrics, &mut live, budget, &mut marks) {
            break;
        }
    }
    live
}

fn cross(points: &[DVec3], t: [u32; 3]) -> DVec3 {
    let [a, b, c] = t.map(|i| points[i as usize]);
    (b - a).cross(c - a)
}

/// Surface planes weighted by area, and planes square to the surface along open boundaries.
fn quadrics(points: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Quadric> {
    let mut quadrics = vec![Quadric::default(); points.len()];
    let mut edges: Vec<(u32, u32, u32)> = Vec::with_capacity(triangles.len() * 3);
    for (index, &t) in triangles.iter().enumerate() {
        let normal = cross(points, t);
        let twice_area = normal.length();
        if twice_area > 0.0 {
            let plane =
                Quadric::plane(normal / twice_area, points[t[0] as usize], twice_area / 2.0);
            t.iter().for_each(|&v| quadrics[v as usize].add(&plane));
        }
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), index as u32));
        }
    }
    edges.par_sort_unstable();
    for run in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|run| run.len() == 1) {
        let (a, b, t) = run[0];
        let along = points[b as usize] - points[a as usize];
        let side = along.cross(cross(points, triangles[t as usize])).normalize_or_zero();
        let plane =
            Quadric::plane(side, points[a as usize], BOUNDARY_WEIGHT * along.length_squared());
        quadrics[a as usize].add(&plane);
        quadrics[b as usize].add(&plane);
    }
    quadrics
}

/// A reusable set of vertices.
struct Marks {
    epoch: u32,
    seen: Vec<u32>,
}

impl Marks {
    fn clear(&mut self) {
        self.epoch += 1;
    }

    /// Adds a vertex; true when it is new.
    fn add(&mut self, vertex: u32) -> bool {
        let slot = &mut self.seen[vertex as usize];
        std::mem::replace(slot, self.epoch) != self.epoch
    }

    fn has(&self, vertex: u32) -> bool {
        self.seen[vertex as usize] == self.epoch
    }
}

/// One round of collapses; false when none was possible.
fn pass(
    points: &[DVec3],
    quadrics: &mut [Quadric],
    live: &mut Vec<[u32; 3]>,
    budget: usize,
    marks: &mut Marks,
) -> bool {
    let stars = Stars::new(points.len(), live);
    let cheapest = |v0: u32| {
        // The next corner of each triangle: every neighbour once, but for one at an open boundary.
        let neighbours = stars.of(v0).iter().map(|&t| {
            let t = live[t as usize];
            if t[0] == v0 {
                t[1]
            } else if t[1] == v0 {
                t[2]
            } else {
                t[0]
            }
        });
        let cost = |v1: u32| {
            let (p0, p1) = (points[v0 as usize], points[v1 as usize]);
            let length = p0.distance_squared(p1);
            quadrics[v0 as usize].at(p1)
                + quadrics[v1 as usize].at(p1)
                + LENGTH_WEIGHT * length * length
        };
        neighbours
            .map(|v1| (cost(v1), v0, v1))
            .filter(|candidate| candidate.0.is_finite())
            .min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut candidates: Vec<(f64, u32, u32)> =
        (0..points.len() as u32).into_par_iter().filter_map(cheapest).collect();
    candidates.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // Costly collapses wait until the cheap ones, which this pass's neighbours still block, have
    // had their turn.
    let wanted = live.len() - budget;
    let limit = candidates
        .get((wanted / 2).max(candidates.len() / 4))
        .map_or(f64::INFINITY, |candidate| candidate.0);
    let mut locked = vec![false; points.len()];
    let mut removed = 0;
    for &(cost, v0, v1) in &candidates {
        if removed >= wanted || (cost > limit && removed > 0) {
            break;
        }
        let star = stars.of(v0);
        // Triangles that died in this pass have locked corners only: the first test keeps away from
        // them.
        let blocked = locked[v0 as usize]
            || locked[v1 as usize]
            || star.iter().any(|&t| live[t as usize].iter().any(|&v| locked[v as usize]));
        if blocked || !allowed(points, live, &stars, v0, v1, marks) {
            continue;
        }
        for &t in star {
            let corners = &mut live[t as usize];
            corners.iter().for_each(|&v| locked[v as usize] = true);
            if corners.contains(&v1) {
                *corners = [u32::MAX; 3];
                removed += 1;
            } else {
                corners.iter_mut().filter(|v| **v == v0).for_each(|v| *v = v1);
            }
        }
        let moved = quadrics[v0 as usize];
        quadrics[v1 as usize].add(&moved);
    }
    live.retain(|t| t[0] != u32::MAX);
    removed > 0
}

/// Whether `v0` may move onto `v1`: no triangle turns over or vanishes, and the surface is not
/// pinched.
fn allowed(
    points: &[DVec3],
    live: &[[u32; 3]],
    stars: &Stars,
    v0: u32,
    v1: u32,
    marks: &mut Marks,
) -> bool {
    let mut dying = 0;
    for &t in stars.of(v0) {
        let corners = live[t as usize];
        if corners.contains(&v1) {
            dying += 1;
            continue;
        }
        let moved = corners.map(|v| if v == v0 { v1 } else { v });
        let (before, after) = (cross(points, corners), cross(points, moved));
        let longest = (0..3)
            .map(|k| {
                points[moved[k] as usize].distance_squared(points[moved[(k + 1) % 3] as usize])
            })
            .fold(0.0, f64::max);
        if after.length() <= 1e-9 * longest
            || before.dot(after) < FLIP_COSINE * before.length() * after.length()
        {
            return false;
        }
    }
    // Link condition: the two vertices share exactly the tips of the triangles that vanish.
    marks.clear();
    stars.of(v0).iter().flat_map(|&t| &live[t as usize]).for_each(|&v| {
        marks.add(v);
    });
    let mut shared: Vec<u32> = stars
        .of(v1)
        .iter()
        .flat_map(|&t| live[t as usize])
        .filter(|&v| v != v0 && v != v1 && marks.has(v))
        .collect();
    shared.sort_unstable();
    shared.dedup();
    (1..=2).contains(&dying) && shared.len() == dying
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of `n` squares along each edge of each face, as one closed surface.
    fn gridded_box(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut index = std::collections::BTreeMap::new();
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            for side in [0, n] {
                let mut at = |u: u32, v: u32| {
                    let mut key = [0; 3];
                    (key[axis], key[(axis + 1) % 3], key[(axis + 2) % 3]) = (side, u, v);
                    *index.entry(key).or_insert_with(|| {
                        vertices.push(
                            DVec3::new(f64::from(key[0]), f64::from(key[1]), f64::from(key[2]))
                                / f64::from(n),
                        );
                        vertices.len() as u32 - 1
                    })
                };
                for (u, v) in (0..n * n).map(|i| (i % n, i / n)) {
                    let [a, b, c, d] = [at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)];
                    triangles.extend(if side == n {
                        [[a, b, c], [a, c, d]]
                    } else {
                        [[a, c, b], [a, d, c]]
                    });
                }
            }
        }
        (vertices, triangles)
    }

    fn volume_and_area(vertices: &[DVec3], triangles: &[[u32; 3]]) -> (f64, f64) {
        let volume = triangles
            .iter()
            .map(|t| t.map(|i| vertices[i as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        (volume, triangles.iter().map(|&t| cross(vertices, t).length() / 2.0).sum())
    }

    #[test]
    fn a_refined_box_keeps_its_shape_exactly() {
        let (vertices, triangles) = gridded_box(40);
        let few = decimate(&vertices, &triangles, 300);
        assert!(few.len() <= 300, "{} triangles of {}", few.len(), triangles.len());
        let (volume, area) = volume_and_area(&vertices, &few);
        assert!(
            (volume - 1.0).abs() < 1e-12 && (area - 6.0).abs() < 1e-12,
            "volume {volume}, area {area}"
        );
    }

    #[test]
    fn a_sphere_loses_little() {
        let (mut vertices, triangles) = gridded_box(60);
        vertices.iter_mut().for_each(|v| *v = (*v - 0.5).normalize());
        let few = decimate(&vertices, &triangles, 4000);
        assert!(few.len() <= 4000, "{}", few.len());
        let (volume, area) = volume_and_area(&vertices, &few);
        let sphere = 4.0 / 3.0 * std::f64::consts::PI;
        assert!(
            (volume / sphere - 1.0).abs() < 5e-3 && (area / (3.0 * sphere) - 1.0).abs() < 5e-3,
            "volume {volume}, area {area}"
        );
    }

    #[test]
    fn small_meshes_pass_unchanged_and_nothing_panics_on_flat_or_empty_ones() {
        let (vertices, triangles) = gridded_box(2);
        assert_eq!(decimate(&vertices, &triangles, 48), triangles);
        assert!(decimate(&[], &[], 0).is_empty());
        assert_eq!(decimate(&[DVec3::ONE; 3], &[[0, 1, 2]], 0).len(), 1);
    }
}

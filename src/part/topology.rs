//! Which triangles meet at which edges.
//!
//! Half-edge `3 t + k` runs from corner `k` of triangle `t` to corner `k + 1`.

use rustc_hash::FxHashSet;

use super::Mesh;

/// No half-edge: the edge is open or tangled.
pub(super) const NONE: u32 = u32::MAX;

/// Start and end vertex of a half-edge.
#[inline]
pub(super) fn ends(triangles: &[[u32; 3]], half: u32) -> (u32, u32) {
    let triangle = &triangles[(half / 3) as usize];
    let corner = (half % 3) as usize;
    (triangle[corner], triangle[(corner + 1) % 3])
}

/// The half-edge after `half` in its triangle.
#[inline]
pub(super) fn next(half: u32) -> u32 {
    if half % 3 == 2 { half - 2 } else { half + 1 }
}

/// Neighbours across edges.
#[derive(Debug, Default)]
pub(super) struct Edges {
    /// Per half-edge its neighbour across the edge, else [`NONE`]. At an edge of two the neighbours
    /// may run the same way (windings disagree).
    pub twin: Vec<u32>,
    /// Half-edges that are alone on their edge.
    pub open: Vec<u32>,
    /// One half-edge of each edge with more than two.
    pub tangled: Vec<u32>,
    /// Half-edges of those edges where bodies could not be told apart: they have no neighbour.
    pub unpaired: Vec<u32>,
}

impl Edges {
    /// Corners of some of the `triangles` that have others beside them.
    pub(super) fn rim(
        &self,
        triangles: &[[u32; 3]],
        some: impl Iterator<Item = u32>,
        is_one: impl Fn(u32) -> bool,
    ) -> FxHashSet<u32> {
        let mut rim = FxHashSet::default();
        for half in some.flat_map(|triangle| 3 * triangle..3 * triangle + 3) {
            let twin = self.twin[half as usize];
            if twin == NONE || !is_one(twin / 3) {
                let (from, to) = ends(triangles, half);
                rim.extend([from, to]);
            }
        }
        rim
    }
}

/// Finds the neighbours by sorting the half-edges by their lower vertex (counting sort), then
/// within a vertex.
pub(super) fn edges(mesh: &Mesh) -> Edges {
    let triangles = &mesh.triangles;
    let halves = triangles.len() * 3;
    let mut starts = vec![0_u32; mesh.vertices.len() + 1];
    for triangle in triangles {
        let [a, b, c] = *triangle;
        starts[a.min(b) as usize] += 1;
        starts[b.min(c) as usize] += 1;
        starts[c.min(a) as usize] += 1;
    }
    let mut sum = 0;
    for start in &mut starts {
        sum += std::mem::replace(start, sum);
    }
    let mut entries = vec![(0_u32, 0_u32); halves]; // (upper vertex, half-edge)
    for (index, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = *triangle;
        for (k, (from, to)) in [(a, b), (b, c), (c, a)].into_iter().enumerate() {
            let slot = &mut starts[from.min(to) as usize];
            entries[*slot as usize] = (from.max(to), (index * 3 + k) as u32);
            *slot += 1;
        }
    }
    let mut found = Edges { twin: vec![NONE; halves], ..Edges::default() };
    let mut begin = 0;
    for &end in &starts[..mesh.vertices.len()] {
        let end = end as usize; // after the scatter each start has become its bucket's end
        let bucket = &mut entries[begin..end];
        bucket.sort_unstable();
        let mut rest: &[(u32, u32)] = bucket;
        while let Some(&(upper, half)) = rest.first() {
            let count = rest.iter().take_while(|entry| entry.0 == upper).count();
            match count {
                1 => found.open.push(half),
                2 => {
                    found.twin[half as usize] = rest[1].1;
                    found.twin[rest[1].1 as usize] = half;
                }
                _ => {
                    found.tangled.push(half);
                    pair_around(mesh, &rest[..count], &mut found);
                }
            }
            rest = &rest[count..];
        }
        begin = end;
    }
    found
}

/// Pairs the half-edges of an edge that bounds several bodies: going round the edge, each that runs
/// up bounds the material before it, and so does the one before it, which must run down. Otherwise
/// all stay unpaired.
fn pair_around(mesh: &Mesh, group: &[(u32, u32)], found: &mut Edges) {
    let (upper, first) = group[0];
    let (from, to) = ends(&mesh.triangles, first);
    let base = mesh.vertices[from.min(to) as usize];
    let axis = (mesh.vertices[upper as usize] - base).normalize_or_zero();
    let (u, v) = axis.any_orthonormal_pair();
    // any_orthonormal_pair gives u x v = axis, so angles grow counter-clockwise about it.
    let mut round: Vec<(f64, u32, bool)> = group
        .iter()
        .map(|&(_, half)| {
            let apex = mesh.vertices
                [mesh.triangles[(half / 3) as usize][((half + 2) % 3) as usize] as usize]
                - base;
            let up = ends(&mesh.triangles, half).1 == upper;
            (apex.dot(v).atan2(apex.dot(u)), half, up)
        })
        .collect();
    round.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let count = round.len();
    if (0..count).all(|index| round[index].2 != round[(index + 1) % count].2) {
        for index in (0..count).filter(|&index| round[index].2) {
            let (up, down) = (round[index].1, round[(index + count - 1) % count].1);
            found.twin[up as usize] = down;
            found.twin[down as usize] = up;
        }
    } else {
        found.unpaired.extend(group.iter().map(|entry| entry.1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn corners() -> Vec<DVec3> {
        vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE]
    }

    #[test]
    fn a_tetrahedron_is_closed() {
        let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let edges = edges(&Mesh { vertices: corners(), triangles: triangles.to_vec() });
        assert!(edges.open.is_empty() && edges.tangled.is_empty());
        for half in 0..12 {
            let (from, to) = ends(&triangles, half);
            assert_eq!(ends(&triangles, edges.twin[half as usize]), (to, from));
        }
    }

    #[test]
    fn open_and_tangled_edges_are_listed() {
        let edges =
            edges(&Mesh { vertices: corners(), triangles: vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]] });
        assert_eq!((edges.open.len(), edges.tangled.len(), edges.unpaired.len()), (6, 1, 3));
    }

    #[test]
    fn cubes_that_share_an_edge_stay_apart() {
        use crate::part::tests::cuboid;
        let (mut vertices, mut triangles) = cuboid(DVec3::ZERO, DVec3::ONE);
        let (more, others) = cuboid(DVec3::new(1.0, 1.0, 0.0), DVec3::new(2.0, 2.0, 1.0));
        triangles.extend(others.iter().map(|triangle| triangle.map(|vertex| vertex + 8)));
        vertices.extend(more);
        let part = crate::part::Part::from_triangles("cubes", &vertices, &triangles).unwrap();
        assert_eq!(
            (part.health.tangled_edges, part.health.shells, part.health.watertight),
            (1, 2, true)
        );
        assert_eq!(part.faces.len(), 12);
    }
}

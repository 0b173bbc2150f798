//! Which triangles meet at which edges.
//!
//! Half-edge `3 t + k` runs from corner `k` of triangle `t` to corner `k + 1`.

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
    /// Per half-edge the other half-edge of an edge with exactly two, else [`NONE`]. The two may run the same way
    /// (windings disagree).
    pub twin: Vec<u32>,
    /// Half-edges that are alone on their edge.
    pub open: Vec<u32>,
    /// One half-edge of each edge with more than two.
    pub tangled: Vec<u32>,
    /// How many of the edges counted in `tangled` have not as many half-edges one way as the other.
    pub unbalanced: usize,
}

/// Finds the neighbours by sorting the half-edges by their lower vertex (counting sort), then within a vertex.
pub(super) fn edges(vertex_count: usize, triangles: &[[u32; 3]]) -> Edges {
    let halves = triangles.len() * 3;
    let mut starts = vec![0_u32; vertex_count + 1];
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
    for &end in &starts[..vertex_count] {
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
                    let up = rest[..count].iter().filter(|entry| ends(triangles, entry.1).1 == upper).count();
                    found.unbalanced += usize::from(2 * up != count);
                }
            }
            rest = &rest[count..];
        }
        begin = end;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tetrahedron_is_closed() {
        let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let edges = edges(4, &triangles);
        assert!(edges.open.is_empty() && edges.tangled.is_empty());
        for half in 0..12 {
            let (from, to) = ends(&triangles, half);
            assert_eq!(ends(&triangles, edges.twin[half as usize]), (to, from));
        }
    }

    #[test]
    fn open_and_tangled_edges_are_listed() {
        let edges = edges(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        assert_eq!((edges.open.len(), edges.tangled.len(), edges.unbalanced), (6, 1, 1));
    }
}

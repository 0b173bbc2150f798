//! Recognition sees one order of the triangles of a mesh, whatever their order in the file.
//!
//! Growth over a surface goes from triangle to triangle, sums are added up in some order, and the
//! first of equals is taken in many places: were that order the file's, the same part exported twice
//! would have two answers. So triangles are sorted before anything looks at them ([`sort`]), and get
//! their places of the file back when it is known what they are ([`restore`]).

use std::cmp::Ordering;

use glam::DVec3;
use rayon::slice::ParallelSliceMut;

use super::repair::Repaired;
use super::topology::NONE;
use super::weld::Soup;

/// Where vertices and triangles stood in the file.
#[derive(Debug, Default)]
pub(super) struct Places {
    /// Number in the file of each vertex.
    pub vertices: Vec<u32>,
    /// Three times the number in the file of each triangle, or of the one that it is a piece of, and
    /// the number in that one of its first corner.
    pub triangles: Vec<u32>,
}

/// By x, then y, then z. Coordinates are finite, and zero has no sign.
fn by_place(a: DVec3, b: DVec3) -> Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
}

/// Steps along each axis of the curve through all places: 2^21, three of which fit 64 bits.
const STEPS: f64 = (1 << 21) as f64;

/// Spreads the lowest 21 bits to every third one.
fn spread(x: u64) -> u64 {
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Where each item stands once they are sorted by keys below `keys`, those of one key in their order.
pub(super) fn counted(items: impl Iterator<Item = usize> + Clone, keys: usize) -> Vec<u32> {
    let mut next = vec![0_u32; keys + 1];
    items.clone().for_each(|key| next[key + 1] += 1);
    for key in 1..next.len() {
        next[key] += next[key - 1];
    }
    let place = |key: usize| {
        next[key] += 1;
        next[key] - 1
    };
    items.map(place).collect()
}

/// Sorts vertices along a curve that fills the part's box (Morton's), on which near ones stay near
/// in memory, and triangles by their vertices, the lowest one first in each. The same triangles in
/// another order, with another corner first, or with their vertices numbered otherwise, give the
/// same mesh.
pub(super) fn sort(soup: &mut Soup) {
    let points = &soup.vertices;
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &point in points {
        (low, high) = (low.min(point), high.max(point));
    }
    let scale = (STEPS - 1.0) / (high - low).max_element().max(f64::MIN_POSITIVE);
    let key = |point: DVec3| {
        let [x, y, z] = ((point - low) * scale).to_array().map(|steps| spread(steps as u64));
        x | y << 1 | z << 2
    };
    let mut order: Vec<(u64, u32)> = points.iter().map(|&point| key(point)).zip(0..).collect();
    order.par_sort_unstable_by(|a, b| {
        let places = || by_place(points[a.1 as usize], points[b.1 as usize]);
        a.0.cmp(&b.0).then_with(places)
    });
    let mut rank = vec![0_u32; points.len()];
    for (&(_, vertex), number) in order.iter().zip(0..) {
        rank[vertex as usize] = number;
    }
    soup.vertices = order.iter().map(|entry| points[entry.1 as usize]).collect();
    for triangle in &mut soup.triangles {
        *triangle = triangle.map(|vertex| rank[vertex as usize]);
    }
    // By the lowest vertex first: few triangles share one.
    let lowest = soup.triangles.iter().map(|&[a, b, c]| a.min(b).min(c) as usize);
    let places = counted(lowest, rank.len());
    let mut sorted = vec![([0_u32; 3], 0_u32); soup.triangles.len()];
    for ((triangle, number), &place) in soup.triangles.iter().zip(0_u32..).zip(&places) {
        let mut triangle = *triangle;
        let lowest = (0..3).min_by_key(|&corner| triangle[corner]).unwrap_or(0);
        triangle.rotate_left(lowest);
        // Fits: MAX_TRIANGLES leaves room for half-edges.
        sorted[place as usize] = (triangle, 3 * number + lowest as u32);
    }
    let shared = |a: &([u32; 3], u32), b: &([u32; 3], u32)| a.0[0] == b.0[0];
    sorted.chunk_by_mut(shared).for_each(<[_]>::sort_unstable);
    for (triangle, entry) in soup.triangles.iter_mut().zip(&sorted) {
        *triangle = entry.0;
    }
    soup.given.set_places(Places {
        vertices: order.into_iter().map(|entry| entry.1).collect(),
        triangles: sorted.into_iter().map(|entry| entry.1).collect(),
    });
}

/// Gives vertices and triangles the order of the file again, pieces of one triangle one after the
/// other. Returns the new number of each triangle. Of the edges only the neighbours follow.
pub(super) fn restore(part: &mut Repaired) -> Vec<u32> {
    let Places { vertices, triangles } = part.given.take_places();
    let mut points = vec![DVec3::ZERO; vertices.len()];
    for (&point, &vertex) in part.mesh.vertices.iter().zip(&vertices) {
        points[vertex as usize] = point;
    }
    part.mesh.vertices = points;
    let of_file = triangles.iter().map(|&origin| origin as usize / 3);
    let number = counted(of_file.clone(), of_file.max().map_or(0, |last| last + 1));
    let half_of = |half: u32| {
        let triangle = (half / 3) as usize;
        3 * number[triangle] + (half % 3 + triangles[triangle] % 3) % 3
    };
    let mut mesh = vec![[0_u32; 3]; triangles.len()];
    let mut twin = vec![NONE; 3 * triangles.len()];
    let mut shell_of = vec![0_u32; triangles.len()];
    for (index, &triangle) in part.mesh.triangles.iter().enumerate() {
        let place = number[index] as usize;
        mesh[place] = triangle.map(|vertex| vertices[vertex as usize]);
        mesh[place].rotate_right(triangles[index] as usize % 3);
        shell_of[place] = part.shell_of[index];
    }
    for (&other, half) in part.edges.twin.iter().zip(0..) {
        if other != NONE {
            twin[half_of(half) as usize] = half_of(other);
        }
    }
    (part.mesh.triangles, part.edges.twin, part.shell_of) = (mesh, twin, shell_of);
    number_shells(part);
    part.measure_again();
    number
}

/// Numbers the shells by their first triangles.
fn number_shells(part: &mut Repaired) {
    let mut numbers = vec![NONE; part.shells.len()];
    let mut shells = Vec::with_capacity(part.shells.len());
    for shell in &mut part.shell_of {
        let number = &mut numbers[*shell as usize];
        if *number == NONE {
            *number = shells.len() as u32;
            shells.push(part.shells[*shell as usize].clone());
        }
        *shell = *number;
    }
    part.shells = shells;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::Part;
    use crate::part::tests::cuboid;

    #[test]
    fn a_clean_mesh_keeps_its_order() {
        let (vertices, mut triangles) = cuboid(DVec3::new(-1.0, -2.0, 0.5), DVec3::ONE);
        triangles.reverse();
        triangles.iter_mut().enumerate().for_each(|(index, t)| t.rotate_left(index % 3));
        let part = Part::from_triangles("box", &vertices, &triangles).unwrap();
        let corners = |index: usize| triangles[index].map(|vertex| vertices[vertex as usize]);
        assert_eq!(part.mesh.triangles.len(), triangles.len());
        for index in 0..triangles.len() {
            assert_eq!(part.mesh.corners(index as u32), corners(index), "{index}");
        }
    }
}

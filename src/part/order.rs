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

/// Sorts vertices by place and triangles by their vertices, the lowest one first in each. The same
/// triangles in another order, with another corner first, or with their vertices numbered
/// otherwise, give the same mesh.
pub(super) fn sort(soup: &mut Soup) {
    let mut vertices: Vec<(DVec3, u32)> = soup.vertices.iter().copied().zip(0..).collect();
    vertices.par_sort_unstable_by(|a, b| by_place(a.0, b.0));
    let mut rank = vec![0_u32; vertices.len()];
    for (&(_, vertex), number) in vertices.iter().zip(0..) {
        rank[vertex as usize] = number;
    }
    soup.vertices.clear();
    soup.vertices.extend(vertices.iter().map(|entry| entry.0));
    let mut sorted: Vec<([u32; 3], u32)> = soup
        .triangles
        .iter()
        .zip(0_u32..)
        .map(|(triangle, number)| {
            let mut triangle = triangle.map(|vertex| rank[vertex as usize]);
            let lowest = (0..3).min_by_key(|&corner| triangle[corner]).unwrap_or(0);
            triangle.rotate_left(lowest);
            // Fits: MAX_TRIANGLES leaves room for half-edges.
            (triangle, 3 * number + lowest as u32)
        })
        .collect();
    sorted.par_sort_unstable();
    for (triangle, entry) in soup.triangles.iter_mut().zip(&sorted) {
        *triangle = entry.0;
    }
    soup.given.set_places(Places {
        vertices: vertices.into_iter().map(|entry| entry.1).collect(),
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
    // A counting sort by the triangle of the file.
    let mut next = vec![0_u32; triangles.iter().max().map_or(0, |&last| last as usize / 3 + 2)];
    for &origin in &triangles {
        next[origin as usize / 3 + 1] += 1;
    }
    for index in 1..next.len() {
        next[index] += next[index - 1];
    }
    let mut number = vec![0_u32; triangles.len()];
    for (number, &origin) in number.iter_mut().zip(&triangles) {
        let slot = &mut next[origin as usize / 3];
        *number = *slot;
        *slot += 1;
    }
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

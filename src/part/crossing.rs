//! Shells that pass through each other: bodies that overlap, so that volume is counted twice and
//! walls lie inside.

use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use robust::{Coord3D, orient3d};
use rustc_hash::FxHashMap;

use super::Mesh;
use super::orient::Shell;

/// Most triangles of shells with overlapping boxes that are compared; beyond it the search costs
/// more than it tells.
const LIMIT: usize = 300_000;

/// What was found.
#[derive(Debug, PartialEq)]
pub(super) enum Crossing {
    /// No two shells cross.
    None,
    /// This many pairs of shells cross; the place of one crossing \[m\].
    Found(usize, DVec3),
    /// Too many triangles to compare.
    Unchecked,
}

/// Looks for shells that cross by more than `tolerance` \[m\]. A shell that crosses itself is not
/// looked for.
pub(super) fn crossing(
    mesh: &Mesh,
    shell_of: &[u32],
    shells: &[Shell],
    tolerance: f64,
) -> Crossing {
    if shells.len() < 2 {
        return Crossing::None;
    }
    let boxes: Vec<Aabb> = shells.iter().map(|shell| Aabb::new(shell.low, shell.high)).collect();
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let involved: Vec<bool> = (0..shells.len())
        .map(|shell| tree.intersect_aabb(&boxes[shell]).nth(1).is_some())
        .collect();
    let triangles: Vec<u32> = (0..shell_of.len() as u32)
        .filter(|&triangle| involved[shell_of[triangle as usize] as usize])
        .collect();
    if triangles.is_empty() {
        return Crossing::None;
    }
    if triangles.len() > LIMIT {
        return Crossing::Unchecked;
    }
    let boxes: Vec<Aabb> = triangles
        .iter()
        .map(|&triangle| {
            let [a, b, c] = mesh.corners(triangle);
            Aabb::new(a.min(b).min(c), a.max(b).max(c))
        })
        .collect();
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let mut found: FxHashMap<(u32, u32), DVec3> = FxHashMap::default();
    for (index, &triangle) in triangles.iter().enumerate() {
        let shell = shell_of[triangle as usize];
        let corners = mesh.corners(triangle);
        for leaf in tree.intersect_aabb(&boxes[index]) {
            let other = shell_of[triangles[leaf as usize] as usize];
            // Each pair of shells is met from both sides: every edge is tried against every
            // triangle of the other.
            let pair = (shell.min(other), shell.max(other));
            if shell == other || found.contains_key(&pair) {
                continue;
            }
            if let Some(place) = pierces(corners, mesh.corners(triangles[leaf as usize]), tolerance)
            {
                found.insert(pair, place);
            }
        }
    }
    let first = found.iter().min_by_key(|(pair, _)| **pair).map(|(_, &place)| place);
    first.map_or(Crossing::None, |place| Crossing::Found(found.len(), place))
}

/// Where an edge of the first triangle goes through the inside of the second one, by more than
/// `tolerance` on either side.
fn pierces(edges: [DVec3; 3], [a, b, c]: [DVec3; 3], tolerance: f64) -> Option<DVec3> {
    let side = |p: DVec3, q: DVec3, r: DVec3, s: DVec3| {
        let coord = |v: DVec3| Coord3D { x: v.x, y: v.y, z: v.z };
        orient3d(coord(p), coord(q), coord(r), coord(s))
    };
    let normal = (b - a).cross(c - a).normalize_or_zero();
    (0..3).find_map(|k| {
        let (p, q) = (edges[k], edges[(k + 1) % 3]);
        let (above, below) = (normal.dot(p - a), normal.dot(q - a));
        if above * below >= 0.0 || above.abs().min(below.abs()) <= tolerance {
            return None;
        }
        let turns = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
        (turns.iter().all(|&turn| turn > 0.0) || turns.iter().all(|&turn| turn < 0.0))
            .then(|| p + (q - p) * (above / (above - below)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::Part;
    use crate::part::tests::cuboid;

    #[test]
    fn overlapping_boxes_cross_and_touching_ones_do_not() {
        let (mut vertices, triangles) = cuboid(DVec3::ZERO, DVec3::ONE);
        let mut both = triangles.clone();
        both.extend(triangles.iter().map(|triangle| triangle.map(|vertex| vertex + 8)));
        for (shift, crosses) in [
            (DVec3::new(0.5, 0.4, 0.3), true),
            (DVec3::new(1.0, 0.2, 0.3), false),
            (DVec3::new(2.0, 0.0, 0.0), false),
        ] {
            vertices.truncate(8);
            vertices.extend(cuboid(shift, shift + DVec3::ONE).0);
            let part = Part::from_triangles("boxes", &vertices, &both).unwrap();
            assert_eq!(part.health.crossing_shells, usize::from(crosses), "{shift}");
        }
    }
}

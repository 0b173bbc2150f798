//! Areas of a site: faces seen along the closing axis, and stretches of them.

use glam::{DMat3, DVec2};

use crate::geometry::UnionFind;
use crate::geometry::polygon::{self, Bounds2, rings};
use crate::model::{Patch, Polygon};
use crate::part::PlanarFace;

/// Faces projected along the closing axis into the axes' `(x, y)`, normalised.
pub(super) fn project<'a>(
    faces: impl Iterator<Item = &'a PlanarFace>,
    axes_from_part: &DMat3,
) -> Patch {
    let mut patch = Patch::new();
    for face in faces {
        let place = |&point: &DVec2| {
            (*axes_from_part * face.part_from_face.point(point.extend(0.0))).truncate()
        };
        for shape in &face.polygons {
            let mut polygon = Polygon {
                outer: shape.outer.iter().map(place).collect(),
                holes: shape.holes.iter().map(|hole| hole.iter().map(place).collect()).collect(),
            };
            polygon::normalise(&mut polygon);
            patch.push(polygon);
        }
    }
    patch
}

pub(super) fn to_site(shape: &Polygon, origin: DVec2, turn: f64) -> Polygon {
    let turn = DVec2::from_angle(-turn);
    let ring = |ring: &Vec<DVec2>| ring.iter().map(|&point| turn.rotate(point - origin)).collect();
    Polygon { outer: ring(&shape.outer), holes: shape.holes.iter().map(ring).collect() }
}

/// Whether two patches have the same rings, whatever point each starts at.
pub(super) fn same_shape(a: &[Polygon], b: &[Polygon], tolerance: f64) -> bool {
    let same_ring = |a: &[DVec2], b: &[DVec2]| {
        let start = b.iter().position(|point| point.distance(a[0]) <= tolerance);
        a.len() == b.len()
            && start.is_some_and(|start| {
                (0..a.len())
                    .all(|index| a[index].distance(b[(start + index) % b.len()]) <= tolerance)
            })
    };
    let (rings_a, rings_b): (Vec<&[DVec2]>, Vec<&[DVec2]>) =
        (a.iter().flat_map(rings).collect(), b.iter().flat_map(rings).collect());
    let mut free = vec![true; rings_b.len()];
    rings_a.len() == rings_b.len()
        && rings_a.iter().all(|ring| {
            let found =
                (0..rings_b.len()).find(|&index| free[index] && same_ring(ring, rings_b[index]));
            found.is_some_and(|index| std::mem::replace(&mut free[index], false))
        })
}

/// Splits a patch where its pieces are farther apart than `gap`, so that no pad touches two of
/// them.
pub(super) fn stretches(patch: Patch, gap: f64) -> Vec<Patch> {
    let mut boxes: Vec<(Bounds2, usize)> = patch
        .iter()
        .enumerate()
        .map(|(index, polygon)| (Bounds2::of(&polygon.outer).grown(gap / 2.0), index))
        .collect();
    boxes.sort_by(|a, b| a.0.min.x.total_cmp(&b.0.min.x).then(a.1.cmp(&b.1)));
    let mut sets = UnionFind::new(patch.len());
    for (position, (bounds, index)) in boxes.iter().enumerate() {
        for (other, other_index) in
            boxes[position + 1..].iter().take_while(|(other, _)| other.min.x <= bounds.max.x)
        {
            if bounds.meets(*other) {
                sets.join(*index, *other_index);
            }
        }
    }
    let mut stretches: Vec<(usize, Patch)> = Vec::new();
    for (index, polygon) in patch.into_iter().enumerate() {
        let root = sets.root(index);
        match stretches.iter_mut().find(|(known, _)| *known == root) {
            Some((_, patch)) => patch.push(polygon),
            None => stretches.push((root, vec![polygon])),
        }
    }
    stretches.into_iter().map(|(_, patch)| patch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::rectangle;

    fn shape(ring: Vec<DVec2>) -> Polygon {
        Polygon { outer: ring, holes: Vec::new() }
    }

    #[test]
    fn far_pieces_become_sites_of_their_own() {
        let at = |x: f64| {
            shape(rectangle(DVec2::ONE).iter().map(|&point| point + DVec2::X * x).collect())
        };
        let split = stretches(vec![at(0.0), at(10.0), at(1.5), at(11.0)], 1.0);
        assert_eq!(split.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2]);
        assert!(stretches(Vec::new(), 1.0).is_empty());
    }
}

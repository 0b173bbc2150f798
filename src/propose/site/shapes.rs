//! Areas of a site: faces seen along the closing axis, and stretches of them.

use glam::{DMat3, DVec2};

use crate::geometry::overlay::{self, SLIVER};
use crate::geometry::polygon::{self, Bounds2, rings};
use crate::geometry::{UnionFind, clip_convex, is_convex, ring_area};
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

/// The area of two patches in common, where a ring begins left open: by clipping where each is one convex
/// shape.
pub(super) fn common(a: &[Polygon], b: &[Polygon]) -> Patch {
    let convex =
        |patch: &[Polygon]| matches!(patch, [one] if one.holes.is_empty() && is_convex(&one.outer));
    if !convex(a) || !convex(b) {
        return overlay::intersect(a, b);
    }
    let outer = clip_convex(&a[0].outer, &b[0].outer);
    let size = Bounds2::of(&outer).size().max_element();
    let is_sliver = ring_area(&outer) <= SLIVER * size * size;
    if is_sliver { Patch::new() } else { vec![Polygon { outer, holes: Vec::new() }] }
}

/// Closed ways along the edges that an odd number of triangles have: the area that these cover, an odd
/// number of times, is what such ways enclose so.
pub(super) fn outlines(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<Vec<u32>> {
    let mut edges: Vec<(u32, u32)> = triangles
        .flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    edges.sort_unstable();
    let odd = edges.chunk_by(|one, other| one == other).filter(|same| same.len() % 2 == 1);
    let odd: Vec<(u32, u32)> = odd.map(|same| same[0]).collect();
    // From either end, each with its number; an even number of them meet at every corner.
    let both = |(number, &(a, b)): (usize, &(u32, u32))| [(a, b, number), (b, a, number)];
    let mut ways: Vec<(u32, u32, usize)> = odd.iter().enumerate().flat_map(both).collect();
    ways.sort_unstable();
    let mut is_gone = vec![false; odd.len()];
    let mut rings = Vec::new();
    for (number, &(start, mut to)) in odd.iter().enumerate() {
        if std::mem::replace(&mut is_gone[number], true) {
            continue;
        }
        let mut ring = vec![start];
        while to != start {
            ring.push(to);
            let on = &ways[ways.partition_point(|way| way.0 < to)..];
            let Some(way) = on.iter().take_while(|way| way.0 == to).find(|way| !is_gone[way.2])
            else {
                break;
            };
            is_gone[way.2] = true;
            to = way.1;
        }
        rings.push(ring);
    }
    rings
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

    /// The area of triangles is that within the edges which an odd number of them have.
    #[test]
    fn outlines_of_triangles_enclose_what_these_cover() {
        // A net of 6 x 5 corners; some of its triangles, touching in corners too, some turned round.
        let place = |corner: u32| {
            DVec2::new(f64::from(corner % 6), f64::from(corner / 6) + 0.1 * f64::from(corner % 4))
        };
        for seed in 0..200_u32 {
            let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12345);
            let mut random = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                state >> 16
            };
            let mut triangles: Vec<[u32; 3]> = Vec::new();
            for corner in (0..24).filter(|corner| corner % 6 < 5) {
                let halves = [[corner, corner + 1, corner + 7], [corner, corner + 7, corner + 6]];
                for mut half in halves {
                    if random() % 3 > 0 {
                        half.rotate_left(random() as usize % 3);
                        if random() % 5 == 0 {
                            half.reverse();
                        }
                        triangles.push(half);
                    }
                }
            }
            let rings = |rings: Vec<Vec<u32>>| -> Vec<Vec<DVec2>> {
                rings
                    .iter()
                    .map(|ring| ring.iter().map(|&corner| place(corner)).collect())
                    .collect()
            };
            let own = rings(triangles.iter().map(|corners| corners.to_vec()).collect());
            let around = rings(outlines(triangles.iter().copied()));
            let [wanted, found] = [own, around].map(|rings| overlay::even_odd(&rings));
            let area = polygon::patch_area(&wanted);
            assert!((polygon::patch_area(&found) - area).abs() < 1e-9, "{seed}");
            let common = polygon::patch_area(&overlay::intersect(&wanted, &found));
            assert!((common - area).abs() < 1e-5, "{seed}: {common} {area}");
        }
    }

    #[test]
    fn convex_shapes_have_in_common_what_the_library_says() {
        let turned = |angle: f64, by: DVec2| {
            let ring = rectangle(DVec2::new(2.0, 1.0));
            shape(ring.iter().map(|&point| DVec2::from_angle(angle).rotate(point) + by).collect())
        };
        let a = [turned(0.0, DVec2::ZERO)];
        for k in 0..100 {
            let by = DVec2::from_angle(f64::from(k)) * (0.02 * f64::from(k));
            let b = [turned(0.1 * f64::from(k), by)];
            let wanted = polygon::patch_area(&overlay::intersect(&a, &b));
            assert!((polygon::patch_area(&common(&a, &b)) - wanted).abs() < 1e-9, "{k}");
        }
        // A corner that only just comes in is none.
        assert!(common(&a, &[turned(0.0, DVec2::new(2.0 - 1e-8, 0.0))]).is_empty());
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

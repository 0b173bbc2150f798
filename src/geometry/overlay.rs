//! Boolean operations that give proper polygons, by the library `i_overlay` (sweep on a 64-bit
//! integer grid).
//!
//! The grid is scaled to the input: a resolution of better than 1e-15 of its size, finer than the
//! rounding of the input. Results are normalised; pieces narrower than the rounding (zero-area
//! slivers of nearly coincident edges) are left out.

use glam::DVec2;
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::simplify::SimplifyShape;
use i_overlay::float::single::SingleFloatOverlay;

use crate::geometry::polygon::{ring_area, rings};
use crate::model::{Patch, Polygon, Ring};

type Contour = Vec<[f64; 2]>;

/// Pieces of an intersection or union with less area than this share of their bounding square are
/// rounding, not shape: pads lie flush with edges whose coordinates carry the 6e-8 of 32-bit files.
pub(crate) const SLIVER: f64 = 1e-6;
/// The same where shapes are only put in order, which must not lose a true sliver: the grid's own
/// rounding.
const SLIVER_INPUT: f64 = 1e-13;

/// Intersection of two patches.
pub fn intersect(a: &[Polygon], b: &[Polygon]) -> Patch {
    overlay(a, b, OverlayRule::Intersect)
}

/// Union of two patches.
pub fn union(a: &[Polygon], b: &[Polygon]) -> Patch {
    overlay(a, b, OverlayRule::Union)
}

/// Intersection of a ring (a pad) with a patch.
pub fn intersect_convex(pad: &[DVec2], patch: &[Polygon]) -> Patch {
    intersect(&[Polygon { outer: pad.to_vec(), holes: Vec::new() }], patch)
}

/// The region that the rings enclose an odd number of times, as proper polygons: repairs arbitrary
/// input (any sense, self-crossing, nested). Rings with non-finite points or fewer than three
/// points count as nothing, and so does input whose size is beyond the range of numbers.
pub fn even_odd(input: &[Ring]) -> Patch {
    let rings: Vec<&[DVec2]> =
        input.iter().map(Vec::as_slice).filter(|ring| usable(ring)).collect();
    let Some(grid) = Grid::of(&rings) else { return Patch::new() };
    grid.collect(grid.contours(&rings).simplify_shape_as::<i64>(FillRule::EvenOdd), SLIVER_INPUT)
}

fn overlay(a: &[Polygon], b: &[Polygon], rule: OverlayRule) -> Patch {
    let flat = |patch| -> Vec<&[DVec2]> {
        <[Polygon]>::iter(patch).flat_map(rings).filter(|ring| usable(ring)).collect()
    };
    let (a, b) = (flat(a), flat(b));
    let Some(grid) = Grid::of(&[a.as_slice(), b.as_slice()].concat()) else { return Patch::new() };
    grid.collect(
        grid.contours(&a).overlay_as::<i64>(&grid.contours(&b), rule, FillRule::EvenOdd),
        SLIVER,
    )
}

fn usable(ring: &[DVec2]) -> bool {
    ring.len() >= 3 && ring.iter().all(|point| point.is_finite())
}

/// Maps the input to the unit square and back: the library refuses coordinates that its grid cannot
/// hold.
struct Grid {
    centre: DVec2,
    /// A power of two, so that scaling does not round.
    scale: f64,
}

impl Grid {
    /// `None` when there is nothing to work on, or its size is zero or beyond the range of numbers.
    fn of(rings: &[&[DVec2]]) -> Option<Self> {
        let bounds = crate::geometry::Bounds2::of(rings.iter().copied().flatten());
        let size = bounds.size().max_element();
        let scale = size.log2().ceil().exp2();
        let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
        (size > 0.0 && scale.is_normal() && (1.0 / scale).is_normal() && reach < f64::MAX / 4.0)
            .then(|| Self { centre: bounds.centre(), scale })
    }

    fn contours(&self, rings: &[&[DVec2]]) -> Vec<Contour> {
        rings
            .iter()
            .map(|ring| {
                ring.iter().map(|&point| ((point - self.centre) / self.scale).to_array()).collect()
            })
            .collect()
    }

    fn collect(&self, shapes: Vec<Vec<Contour>>, sliver: f64) -> Patch {
        let solid = |ring: &Ring| {
            let size = crate::geometry::Bounds2::of(ring).size().max_element();
            ring.len() >= 3 && ring_area(ring).abs() > sliver * size * size
        };
        let mut patch = Patch::with_capacity(shapes.len());
        for shape in shapes {
            let mut loops = shape
                .into_iter()
                .map(|contour| contour.into_iter().map(DVec2::from_array).collect::<Ring>());
            let Some(outer) = loops.next().filter(solid) else { continue };
            let mut polygon = Polygon { outer, holes: loops.filter(solid).collect() };
            crate::geometry::polygon::normalise(&mut polygon);
            for ring in std::iter::once(&mut polygon.outer).chain(&mut polygon.holes) {
                for point in ring.iter_mut() {
                    *point = *point * self.scale + self.centre;
                }
            }
            patch.push(polygon);
        }
        patch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{clip_ring_convex, patch_area};
    use crate::gripper::rectangle;
    use proptest::prelude::*;

    fn shifted(ring: &[DVec2], by: DVec2) -> Ring {
        ring.iter().map(|&point| point + by).collect()
    }

    #[test]
    fn pad_over_a_hole_keeps_the_hole() {
        let plate = [Polygon {
            outer: rectangle(DVec2::splat(10.0)),
            holes: vec![rectangle(DVec2::splat(1.0)).into_iter().rev().collect()],
        }];
        let contact = intersect_convex(&rectangle(DVec2::splat(2.0)), &plate);
        assert_eq!((contact.len(), contact[0].holes.len()), (1, 1));
        assert!((patch_area(&contact) - 3.0).abs() < 1e-12);
        let half =
            intersect_convex(&shifted(&rectangle(DVec2::splat(1.0)), DVec2::new(0.5, 0.0)), &plate);
        assert!((patch_area(&half) - 0.5).abs() < 1e-12 && half[0].holes.is_empty());
        assert!(
            intersect_convex(&shifted(&rectangle(DVec2::ONE), DVec2::splat(50.0)), &plate)
                .is_empty()
        );
    }

    #[test]
    fn slivers_of_flush_edges_are_left_out() {
        let plate = [Polygon { outer: rectangle(DVec2::splat(2.0)), holes: Vec::new() }];
        let beside = shifted(&rectangle(DVec2::splat(2.0)), DVec2::new(2.0 - 1e-8, 0.0));
        assert!(intersect_convex(&beside, &plate).is_empty());
    }

    #[test]
    fn even_odd_mends_any_rings() {
        let outer: Ring = rectangle(DVec2::splat(4.0)).into_iter().rev().collect();
        let patch = even_odd(&[
            rectangle(DVec2::splat(2.0)),
            outer,
            vec![DVec2::NAN; 5],
            vec![DVec2::ZERO],
        ]);
        assert_eq!(patch.len(), 1);
        assert!((patch_area(&patch) - 12.0).abs() < 1e-12);
        let bow =
            vec![DVec2::ZERO, DVec2::new(1.0, 1.0), DVec2::new(1.0, 0.0), DVec2::new(0.0, 1.0)];
        let mended = even_odd(&[bow]);
        assert_eq!(mended.len(), 2);
        assert!((patch_area(&mended) - 0.5).abs() < 1e-12);
        assert!(even_odd(&[]).is_empty());
    }

    /// A star-shaped ring: radii in order of angle, so it is simple, and concave where the radii
    /// vary.
    fn star() -> impl Strategy<Value = Ring> {
        proptest::collection::vec(0.2..1.5f64, 3..24).prop_map(|radii| {
            let step = std::f64::consts::TAU / radii.len() as f64;
            radii
                .iter()
                .enumerate()
                .map(|(index, radius)| DVec2::from_angle(index as f64 * step) * *radius)
                .collect()
        })
    }

    proptest! {
        #[test]
        fn clipping_agrees_with_scan_lines(ring in star(), angle in 0.0..6.3f64, x in -1.0..1.0f64, y in -1.0..1.0f64, size in 0.1..3.0f64) {
            let pad: Ring = rectangle(DVec2::new(size, 1.0)).iter().map(|p| DVec2::from_angle(angle).rotate(*p) + DVec2::new(x, y)).collect();
            let clipped = ring_area(&clip_ring_convex(&ring, &pad));
            let proper = patch_area(&intersect_convex(&pad, &[Polygon { outer: ring.clone(), holes: Vec::new() }]));
            prop_assert!((clipped - proper).abs() < 1e-6 * size, "{clipped} {proper}");
            prop_assert!((clipped - scan_area(&ring, &pad)).abs() < 2e-5, "{clipped} {}", scan_area(&ring, &pad));
        }
    }

    proptest! {
        /// Collinear, repeated, tiny, huge and non-finite points: an answer, never a panic.
        #[test]
        fn degenerate_rings_do_no_harm(points in proptest::collection::vec((0..4_i32, 0..3_i32), 0..12), scale in -300.0..300.0f64, odd in 0..6_usize) {
            let mut ring: Ring = points.iter().map(|&(x, y)| DVec2::new(f64::from(x), f64::from(y)) * 10_f64.powf(scale)).collect();
            if let Some(point) = ring.get_mut(odd) {
                point.x = [f64::NAN, f64::INFINITY, 0.0, -0.0, f64::MAX, f64::MIN_POSITIVE][odd];
            }
            let polygon = [Polygon { outer: ring.clone(), holes: vec![ring.clone()] }];
            for patch in [even_odd(&[ring.clone(), ring.clone()]), intersect(&polygon, &polygon), union(&polygon, &polygon)] {
                for polygon in &patch {
                    let area = ring_area(&polygon.outer);
                    prop_assert!(polygon.outer.len() >= 3 && (area.is_nan() || area >= 0.0), "{area}");
                }
            }
        }
    }

    /// Independent area of the intersection: lengths of the overlap of both rings' intervals on
    /// horizontal lines, by the midpoint rule between the heights of all vertices, where the
    /// lengths are smooth.
    fn scan_area(a: &[DVec2], b: &[DVec2]) -> f64 {
        let mut heights: Vec<f64> = a.iter().chain(b).map(|point| point.y).collect();
        heights.sort_by(f64::total_cmp);
        let crossings = |ring: &[DVec2], y: f64| {
            let mut xs: Vec<f64> = ring
                .iter()
                .zip(ring.iter().cycle().skip(1))
                .filter(|(p, q)| (p.y > y) != (q.y > y))
                .map(|(p, q)| p.x + (q.x - p.x) * (y - p.y) / (q.y - p.y))
                .collect();
            xs.sort_by(f64::total_cmp);
            xs
        };
        let mut area = 0.0;
        for slab in heights.windows(2) {
            let steps = 200;
            let step = (slab[1] - slab[0]) / f64::from(steps);
            for index in 0..steps {
                let y = slab[0] + (f64::from(index) + 0.5) * step;
                let (xa, xb) = (crossings(a, y), crossings(b, y));
                for ia in xa.chunks_exact(2) {
                    for ib in xb.chunks_exact(2) {
                        area += (ia[1].min(ib[1]) - ia[0].max(ib[0])).max(0.0) * step;
                    }
                }
            }
        }
        area
    }
}

//! Clipping rings by half-planes and convex polygons (Sutherland and Hodgman 1974).
//!
//! A concave ring that falls apart comes back as one ring whose pieces are joined by pairs of
//! opposite edges along the clip line. Such a ring is exact for every integral over the region;
//! where separate, proper polygons are wanted use [`crate::geometry::overlay`].

use glam::{DVec2, DVec3};

use super::polygon::{Bounds2, straightened};
use crate::model::Ring;

/// The points with `normal . x + offset >= 0`: also the form in which a pressure plane is not
/// negative. The normal need not be a unit vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfPlane {
    /// Points into the half-plane.
    pub normal: DVec2,
    /// Value at the origin.
    pub offset: f64,
}

impl HalfPlane {
    /// `normal . point + offset`.
    #[inline]
    pub fn value(&self, point: DVec2) -> f64 {
        self.normal.dot(point) + self.offset
    }

    /// The half-plane at the left of the directed line from `a` to `b`.
    #[inline]
    pub fn left_of(a: DVec2, b: DVec2) -> Self {
        let normal = (b - a).perp();
        Self { normal, offset: -normal.dot(a) }
    }

    /// Whether it keeps all of a box of this middle and half size, or nothing, beyond rounding; `None` where
    /// it may cut it. A side of no length has no value, and cuts nothing.
    fn keeps(&self, middle: DVec2, half_size: DVec2) -> Option<bool> {
        let (value, most) = (self.value(middle), self.normal.abs().dot(half_size) * BOX);
        match () {
            () if value >= most => Some(true),
            () if value < -most => Some(false),
            () => None,
        }
    }
}

/// The part of a plane ring in space with `sign * point[axis] <= limit`; `sign` is 1 or -1. New
/// corners lie on the limit.
pub fn clip_ring_axis(ring: &[DVec3], axis: usize, sign: f64, limit: f64) -> Vec<DVec3> {
    let value = |point: DVec3| limit - sign * point[axis];
    let mut clipped = Vec::with_capacity(ring.len() + 1);
    for (index, &a) in ring.iter().enumerate() {
        let b = ring[(index + 1) % ring.len()];
        if value(a) >= 0.0 {
            clipped.push(a);
        }
        if (value(a) >= 0.0) != (value(b) >= 0.0) {
            let mut point = a + (b - a) * (value(a) / (value(a) - value(b)));
            point[axis] = sign * limit;
            clipped.push(point);
        }
    }
    clipped
}

/// The part of `ring` inside `half`, in the ring's own sense; empty when nothing is left.
pub fn clip_ring_half_plane(ring: &[DVec2], half: &HalfPlane) -> Ring {
    let mut clipped = Vec::with_capacity(ring.len() + 2);
    clip_ring_half_plane_into(ring, half, &mut clipped);
    clipped
}

/// [`clip_ring_half_plane`] into a buffer, which is cleared first. Every crossing is computed from
/// the inner end, so that an edge shared by two rings gives both the same point whichever way it
/// runs.
pub fn clip_ring_half_plane_into(ring: &[DVec2], half: &HalfPlane, clipped: &mut Ring) {
    clipped.clear();
    let Some(&last) = ring.last() else { return };
    let (mut a, mut value_a) = (last, half.value(last));
    for &b in ring {
        let value_b = half.value(b);
        if (value_a >= 0.0) != (value_b >= 0.0) {
            let (inner, outer, value_inner, value_outer) =
                if value_a >= 0.0 { (a, b, value_a, value_b) } else { (b, a, value_b, value_a) };
            clipped.push(inner + (outer - inner) * (value_inner / (value_inner - value_outer)));
        }
        if value_b >= 0.0 {
            clipped.push(b);
        }
        (a, value_a) = (b, value_b);
    }
    if clipped.len() < 3 {
        clipped.clear();
    }
}

/// Signed rings (outer counter-clockwise, holes clockwise) clipped by a half-plane; empty rings are
/// left out.
pub fn clip_rings_half_plane(rings: &[Ring], half: &HalfPlane) -> Vec<Ring> {
    rings
        .iter()
        .map(|ring| clip_ring_half_plane(ring, half))
        .filter(|ring| !ring.is_empty())
        .collect()
}

/// The part of `ring` inside the convex counter-clockwise polygon `convex`, in the ring's own
/// sense.
pub fn clip_ring_convex(ring: &[DVec2], convex: &[DVec2]) -> Ring {
    let bounds = Bounds2::of(ring);
    let (middle, size) = (bounds.centre(), 0.5 * bounds.size());
    let (mut current, mut next) = (Ring::new(), Ring::new());
    let mut is_whole = true;
    for (&a, &b) in convex.iter().zip(convex.iter().cycle().skip(1)) {
        let half = HalfPlane::left_of(a, b);
        // A side that leaves the ring's box as it is leaves the ring.
        match half.keeps(middle, size) {
            Some(true) => continue,
            Some(false) => return Ring::new(),
            None => {}
        }
        next.reserve(ring.len() + convex.len());
        let from = if is_whole { ring } else { &current };
        clip_ring_half_plane_into(from, &half, &mut next);
        std::mem::swap(&mut current, &mut next);
        is_whole = false;
    }
    if is_whole { ring.to_vec() } else { current }
}

/// The part of a convex counter-clockwise polygon inside another one: of the many sides of an outline
/// the few that may cut.
pub(crate) fn clip_convex(ring: &[DVec2], convex: &[DVec2]) -> Ring {
    let (mut current, mut next) = (ring.to_vec(), Vec::with_capacity(ring.len() + 8));
    let bounds = Bounds2::of(ring);
    let (middle, size) = (bounds.centre(), 0.5 * bounds.size());
    let Some(&last) = convex.last() else { return Ring::new() };
    let (mut a, mut is_whole) = (last, true);
    for &b in convex {
        let half = HalfPlane::left_of(a, b);
        a = b;
        match half.keeps(middle, size) {
            Some(true) => continue,
            Some(false) => return Ring::new(),
            None => {}
        }
        clip_ring_half_plane_into(&current, &half, &mut next);
        std::mem::swap(&mut current, &mut next);
        is_whole = false;
    }
    // A corner on a side is met twice.
    if is_whole { current } else { straightened(&current) }
}

/// Whether a box lies within a convex counter-clockwise polygon beyond rounding.
pub(crate) fn is_within(bounds: Bounds2, convex: &[DVec2]) -> bool {
    let (middle, size) = (bounds.centre(), 0.5 * bounds.size());
    let mut sides = convex.iter().zip(convex.iter().cycle().skip(1));
    sides.all(|(&a, &b)| HalfPlane::left_of(a, b).keeps(middle, size) == Some(true))
}

/// Size of a box beyond which no rounding lets a side cut it.
const BOX: f64 = 1.0 + 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ring_area;
    use crate::gripper::rectangle;

    #[test]
    fn half_of_a_square() {
        let square = rectangle(DVec2::splat(2.0));
        let half = HalfPlane { normal: DVec2::new(-3.0, 0.0), offset: 0.0 };
        let clipped = clip_ring_half_plane(&square, &half);
        assert_eq!(ring_area(&clipped), 2.0);
        assert!(
            clip_ring_half_plane(&square, &HalfPlane { normal: DVec2::X, offset: -1.5 }).is_empty()
        );
        assert_eq!(
            clip_ring_half_plane(&square, &HalfPlane { normal: DVec2::X, offset: 1.0 }),
            square
        );
        assert!(clip_ring_half_plane(&[], &half).is_empty());
    }

    /// As by every side, one after the other.
    #[test]
    fn convex_outlines_clip_each_other() {
        let circle = |count: u32, half: DVec2, middle: DVec2| -> Ring {
            let step = std::f64::consts::TAU / f64::from(count);
            (0..count).map(|k| middle + half * DVec2::from_angle(step * f64::from(k))).collect()
        };
        let mut areas = [0; 3];
        for k in 0..400_u32 {
            let part = |n: u32| (f64::from(k * n) * 0.618_034).fract();
            let ring = circle(48, DVec2::new(0.2 + part(1), 0.2 + part(2)), DVec2::ZERO);
            let middle = 3.0 * DVec2::new(part(3) - 0.5, part(5) - 0.5);
            let other = circle(3 + k % 30, DVec2::splat(0.1 + 1.5 * part(7)), middle);
            let [found, wanted] = [clip_convex(&ring, &other), clip_ring_convex(&ring, &other)]
                .map(|x| ring_area(&x));
            assert!((found - wanted).abs() < 1e-9, "{k}: {found} {wanted}");
            areas[if found == 0.0 {
                0
            } else {
                1 + usize::from(found > 0.999 * ring_area(&ring))
            }] += 1;
        }
        assert!(areas.iter().all(|count| *count > 20), "{areas:?}");
        // Sides on sides.
        let square = rectangle(DVec2::ONE);
        assert_eq!(ring_area(&clip_convex(&square, &square)), 1.0);
        assert!(clip_convex(&square, &[]).is_empty());
    }

    #[test]
    fn a_clockwise_ring_stays_clockwise() {
        let mut hole = rectangle(DVec2::splat(2.0));
        hole.reverse();
        assert_eq!(
            ring_area(&clip_ring_half_plane(&hole, &HalfPlane { normal: DVec2::Y, offset: 0.5 })),
            -3.0
        );
    }

    #[test]
    fn a_comb_falls_apart_with_the_right_area() {
        // three teeth of width 1 and height 2 on a bar of height 1
        let points = [
            (0., 0.),
            (5., 0.),
            (5., 3.),
            (4., 3.),
            (4., 1.),
            (3., 1.),
            (3., 3.),
            (2., 3.),
            (2., 1.),
            (1., 1.),
            (1., 3.),
            (0., 3.),
        ];
        let comb: Ring = points.iter().map(|&(x, y)| DVec2::new(x, y)).collect();
        let window: Ring = [(-1., 2.), (9., 2.), (9., 9.), (-1., 9.)]
            .iter()
            .map(|&(x, y)| DVec2::new(x, y))
            .collect();
        assert_eq!(ring_area(&clip_ring_convex(&comb, &window)), 3.0);
    }
}

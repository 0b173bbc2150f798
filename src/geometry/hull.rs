//! Convex hulls and support functions.

use glam::DVec2;
use robust::{Coord, orient2d};

use crate::model::Ring;

/// Twice the signed area of the triangle, with an exact sign.
pub(crate) fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coordinate = |point: DVec2| Coord { x: point.x, y: point.y };
    orient2d(coordinate(a), coordinate(b), coordinate(c))
}

/// Convex hull, counter-clockwise, without collinear points (Andrew's monotone chain with exact
/// predicates). Fewer than three points come back when all points are collinear.
pub fn convex_hull(points: &[DVec2]) -> Ring {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let mut hull: Ring = Vec::with_capacity(sorted.len() + 1);
    for pass in 0..2 {
        let floor = hull.len() + 1;
        let extend = |hull: &mut Ring, point: DVec2| {
            while hull.len() > floor
                && orient(hull[hull.len() - 2], hull[hull.len() - 1], point) <= 0.0
            {
                hull.pop();
            }
            hull.push(point);
        };
        if pass == 0 {
            sorted.iter().for_each(|&point| extend(&mut hull, point));
        } else {
            // The last point of the lower chain starts the upper one.
            sorted.iter().rev().for_each(|&point| extend(&mut hull, point));
        }
        hull.pop();
    }
    hull
}

/// Support function `max over points of direction . x`; negative infinity for no points.
pub fn support(points: &[DVec2], direction: DVec2) -> f64 {
    points.iter().map(|point| direction.dot(*point)).fold(f64::NEG_INFINITY, f64::max)
}

/// Whether a counter-clockwise ring is convex (collinear points allowed), has area and winds once.
pub fn is_convex(ring: &[DVec2]) -> bool {
    if ring.len() < 3 {
        return false;
    }
    // Turning left all the way, the edges pass from below to above once for each full turn.
    let (mut a, mut b) = (ring[ring.len() - 2], ring[ring.len() - 1]);
    let mut rises = 0;
    for &c in ring {
        let turn = orient(a, b, c);
        if turn < 0.0 {
            return false;
        }
        if turn == 0.0 {
            return winds_once(ring);
        }
        rises += u32::from(b.y < a.y && c.y >= b.y);
        (a, b) = (b, c);
    }
    rises == 1
}

/// The same by the sum of all turns: edges along one line may lead back.
fn winds_once(ring: &[DVec2]) -> bool {
    let next = |index: usize| ring[index % ring.len()];
    let mut turns = 0.0;
    for index in 0..ring.len() {
        let (a, b, c) = (next(index), next(index + 1), next(index + 2));
        if orient(a, b, c) < 0.0 {
            return false;
        }
        turns += (b - a).angle_to(c - b);
    }
    (turns - std::f64::consts::TAU).abs() < 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ring_area;
    use crate::gripper::rectangle;

    #[test]
    fn hull_of_a_grid_is_its_square() {
        let points: Vec<DVec2> =
            (0..25).map(|index| DVec2::new(f64::from(index % 5), f64::from(index / 5))).collect();
        let hull = convex_hull(&points);
        assert_eq!(hull.len(), 4);
        assert_eq!(ring_area(&hull), 16.0);
        assert!(is_convex(&hull));
        assert_eq!(support(&hull, DVec2::new(1.0, 1.0)), 8.0);
    }

    #[test]
    fn degenerate_hulls() {
        assert!(convex_hull(&[]).is_empty());
        assert_eq!(convex_hull(&[DVec2::ONE, DVec2::ONE]).len(), 1);
        let line: Vec<DVec2> = (0..9).map(|index| DVec2::splat(f64::from(index))).collect();
        assert_eq!(convex_hull(&line), vec![DVec2::ZERO, DVec2::splat(8.0)]);
    }

    #[test]
    fn convexity() {
        assert!(is_convex(&rectangle(DVec2::ONE)));
        let mut clockwise = rectangle(DVec2::ONE);
        clockwise.reverse();
        assert!(!is_convex(&clockwise));
        // a pentagram turns left everywhere but winds twice
        let star: Vec<DVec2> =
            (0..5).map(|k| DVec2::from_angle(f64::from(k) * 0.8 * std::f64::consts::PI)).collect();
        assert!(!is_convex(&star));
    }
}

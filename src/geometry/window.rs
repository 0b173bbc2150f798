//! A simple ring within a convex one, by following its boundary in and out (Weiler and Atherton 1977,
//! for a convex window): the cost is that of one look at each edge.

use glam::DVec2;

use super::clip::HalfPlane;
use super::polygon::{Bounds2, ring_contains};
use crate::model::Ring;

/// What of a ring lies in the window between two crossings of its outline.
struct Chain {
    /// Points from entry to exit.
    points: Ring,
    /// Place of entry and exit along the window: number of the side, and the share of it before.
    entry: f64,
    exit: f64,
}

/// The parts of a simple counter-clockwise ring within a convex counter-clockwise one; `None` where
/// rounding hides how their outlines cross.
pub(crate) fn within_window(ring: &[DVec2], window: &[DVec2]) -> Option<Vec<Ring>> {
    let bounds = Bounds2::of(window);
    if ring.len() < 3 || window.len() < 3 {
        return Some(Vec::new());
    }
    let next = |index: usize| ring[if index + 1 == ring.len() { 0 } else { index + 1 }];
    let sides: Vec<HalfPlane> = (0..window.len())
        .map(|side| HalfPlane::left_of(window[before(side, window)], window[side]))
        .collect();
    let parts: Vec<Option<Inside>> =
        ring.iter().enumerate().map(|(index, &a)| inside(a, next(index), &sides, bounds)).collect();
    let enters = |part: &Option<Inside>| part.as_ref().is_some_and(|part| part.from > 0.0);
    let Some(first) = parts.iter().position(enters) else {
        let whole = |part: &Option<Inside>| part.as_ref().is_some_and(|part| part.to >= 1.0);
        return match () {
            () if parts.iter().all(whole) => Some(vec![ring.to_vec()]),
            () if parts.iter().any(Option::is_some) => None,
            // Its middle: a corner may lie on the ring.
            () if ring_contains(ring, middle(window)) => Some(vec![window.to_vec()]),
            () => Some(Vec::new()),
        };
    };
    // The ring once, from an entry on.
    let mut chains: Vec<Chain> = Vec::new();
    let mut is_open = false;
    for index in (first..ring.len()).chain(0..first) {
        let (a, b) = (ring[index], next(index));
        let Some(Inside { from, to, sides }) = parts[index] else {
            if is_open {
                return None;
            }
            continue;
        };
        // An edge either goes on where the last one ended, or comes in.
        if is_open == (from > 0.0) {
            return None;
        }
        if from > 0.0 {
            let point = crossing(b, a, window, sides[0]);
            let mut points = Ring::with_capacity(ring.len() + window.len().min(4));
            points.push(point);
            let entry = along(window, sides[0], point);
            chains.push(Chain { points, entry, exit: f64::NAN });
        }
        let chain = chains.last_mut()?;
        is_open = to >= 1.0;
        if is_open {
            chain.points.push(b);
        } else {
            let point = crossing(a, b, window, sides[1]);
            chain.points.push(point);
            chain.exit = along(window, sides[1], point);
        }
    }
    if is_open { None } else { joined(chains, window) }
}

fn middle(window: &[DVec2]) -> DVec2 {
    window.iter().sum::<DVec2>() / window.len() as f64
}

/// The part of an edge within a window, as shares of its length, and the sides that end it.
#[derive(Debug, Clone, Copy)]
struct Inside {
    from: f64,
    to: f64,
    sides: [usize; 2],
}

/// By the sides one after the other (Cyrus and Beck 1978).
#[inline]
fn inside(a: DVec2, b: DVec2, window: &[HalfPlane], bounds: Bounds2) -> Option<Inside> {
    if a.min(b).cmpgt(bounds.max).any() || a.max(b).cmplt(bounds.min).any() {
        return None;
    }
    let mut found = Inside { from: 0.0, to: 1.0, sides: [0; 2] };
    for (side, half) in window.iter().enumerate() {
        let (value_a, value_b) = (half.value(a), half.value(b));
        let (a_is_in, b_is_in) = (value_a >= 0.0, value_b >= 0.0);
        if a_is_in != b_is_in {
            let t = value_a / (value_a - value_b);
            if a_is_in && t < found.to {
                (found.to, found.sides[1]) = (t, side);
            } else if b_is_in && t > found.from {
                (found.from, found.sides[0]) = (t, side);
            }
        } else if !a_is_in {
            return None;
        }
    }
    (found.from < found.to).then_some(found)
}

/// Where an edge crosses a side, computed from its inner end: an edge of two rings gives both the same
/// point.
fn crossing(inner: DVec2, outer: DVec2, window: &[DVec2], side: usize) -> DVec2 {
    let half = HalfPlane::left_of(window[before(side, window)], window[side]);
    let (value, other) = (half.value(inner), half.value(outer));
    inner + (outer - inner) * (value / (value - other))
}

fn before(side: usize, window: &[DVec2]) -> usize {
    if side == 0 { window.len() - 1 } else { side - 1 }
}

/// Place of a point along a side, which ends at the corner of its number.
fn along(window: &[DVec2], side: usize, point: DVec2) -> f64 {
    let (a, b) = (window[before(side, window)], window[side]);
    let share = (point - a).dot(b - a) / (b - a).length_squared();
    side as f64 + share.clamp(0.0, 1.0 - f64::EPSILON)
}

/// Closes chains along the window: from each exit counter-clockwise to the next entry.
fn joined(mut chains: Vec<Chain>, window: &[DVec2]) -> Option<Vec<Ring>> {
    let count = window.len() as f64;
    let mut taken = vec![false; chains.len()];
    let mut rings = Vec::new();
    for start in 0..chains.len() {
        if taken[start] {
            continue;
        }
        let mut ring = Ring::new();
        let mut at = start;
        loop {
            if taken[at] {
                return None;
            }
            taken[at] = true;
            match ring.is_empty() {
                true => ring = std::mem::take(&mut chains[at].points),
                false => ring.extend(&chains[at].points),
            }
            let exit = chains[at].exit;
            let ahead = |chain: &Chain| (chain.entry - exit).rem_euclid(count);
            let (next, way) = chains
                .iter()
                .map(ahead)
                .enumerate()
                .min_by(|(_, one), (_, other)| one.total_cmp(other))?;
            // Where both are one place it is not known which comes first.
            if way == 0.0 || !way.is_finite() {
                return None;
            }
            let corners = (exit + way).floor() - exit.floor();
            for step in 0..corners as usize {
                ring.push(window[(exit as usize + step) % window.len()]);
            }
            at = next;
            if at == start {
                break;
            }
        }
        rings.push(ring);
    }
    Some(rings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{intersect_convex, patch_area, ring_area};
    use crate::model::Polygon;
    use proptest::prelude::*;

    fn star(radii: &[f64], middle: DVec2) -> Ring {
        let step = std::f64::consts::TAU / radii.len() as f64;
        let corner =
            |(k, radius): (usize, &f64)| middle + *radius * DVec2::from_angle(step * k as f64);
        radii.iter().enumerate().map(corner).collect()
    }

    fn polygon(outer: &[DVec2]) -> Polygon {
        Polygon { outer: outer.to_vec(), holes: Vec::new() }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// As the boolean operation of the library, piece by piece.
        #[test]
        fn it_is_what_the_library_finds(
            radii in proptest::collection::vec(0.2..1.5f64, 3..24),
            corners in 3..40_usize,
            size in 0.1..2.0f64,
            x in -1.5..1.5f64,
            y in -1.5..1.5f64,
        ) {
            let (ring, window) = (star(&radii, DVec2::ZERO), star(&vec![size; corners], DVec2::new(x, y)));
            let found = within_window(&ring, &window).unwrap();
            let wanted = intersect_convex(&window, &[polygon(&ring)]);
            let areas = |rings: Vec<f64>| {
                let mut areas: Vec<f64> = rings.into_iter().filter(|area| *area > 1e-6).collect();
                areas.sort_by(f64::total_cmp);
                areas
            };
            let one = areas(found.iter().map(|ring| ring_area(ring)).collect());
            let other = areas(wanted.iter().map(|one| patch_area(std::slice::from_ref(one))).collect());
            prop_assert_eq!(one.len(), other.len());
            for (a, b) in one.iter().zip(&other) {
                prop_assert!((a - b).abs() < 1e-9, "{} {}", a, b);
            }
            for ring in &found {
                let bounds = Bounds2::of(ring);
                prop_assert!(bounds.size().max_element() <= 2.0 * size + 1e-9);
            }
        }
    }

    #[test]
    fn a_comb_falls_into_its_teeth() {
        let comb: Ring = [
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
        ]
        .map(|(x, y)| DVec2::new(x, y))
        .to_vec();
        let window = [(-1., 2.), (9., 2.), (9., 9.), (-1., 9.)].map(|(x, y)| DVec2::new(x, y));
        let found = within_window(&comb, &window).unwrap();
        assert_eq!(found.iter().map(|ring| ring_area(ring)).collect::<Vec<_>>(), [1.0; 3]);
        // All of it, all of the window, and neither.
        let large = [(-1., -1.), (9., -1.), (9., 9.), (-1., 9.)].map(|(x, y)| DVec2::new(x, y));
        assert_eq!(within_window(&comb, &large).unwrap(), std::slice::from_ref(&comb));
        let small = [(0.2, 0.2), (0.8, 0.2), (0.5, 0.8)].map(|(x, y)| DVec2::new(x, y));
        assert_eq!(within_window(&comb, &small).unwrap(), [small.to_vec()]);
        // An edge along a side of it, a hair inside or outside of the ring.
        for off in [0.0, 1e-17, -1e-17] {
            let flush = [(0.2, off), (0.8, off), (0.8, 0.8), (0.2, 0.8)];
            let found = within_window(&comb, &flush.map(|(x, y)| DVec2::new(x, y)));
            let area = found.map(|rings| rings.iter().map(|ring| ring_area(ring)).sum::<f64>());
            assert!(area.is_none_or(|area| (area - 0.48).abs() < 1e-12), "{area:?}");
        }
        let beside = [(1.2, 1.2), (1.8, 1.2), (1.5, 1.8)].map(|(x, y)| DVec2::new(x, y));
        assert!(within_window(&comb, &beside).unwrap().is_empty());
    }
}

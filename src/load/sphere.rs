//! Directions spread over the sphere or over a cone, the same on every run.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Largest angle between neighbouring directions of [`cone`] [rad].
pub const CONE_STEP: f64 = 10.0 * PI / 180.0;

/// The six axis directions, `-z` first.
pub fn axes() -> [DVec3; 6] {
    [DVec3::NEG_Z, DVec3::Z, DVec3::NEG_X, DVec3::X, DVec3::NEG_Y, DVec3::Y]
}

/// `count` near-uniform unit vectors.
///
/// Where `count` is 20 f^2 (20, 80, 180, 320, 500, ...) they are the facet normals of an
/// icosahedron divided f-fold and blown up to the sphere, where it is 10 f^2 + 2 (12, 42, 92, 162,
/// ...) its vertices, 6 the axes; both sets hold `-v` with every `v`. Any other number gives a
/// Fibonacci spiral.
pub fn directions(count: usize) -> Vec<DVec3> {
    let frequency = |count: usize, facets: usize| {
        let square = count / facets;
        let root = square.isqrt();
        (count.is_multiple_of(facets) && root * root == square && root > 0).then_some(root)
    };
    if count == 6 {
        return axes().to_vec();
    }
    if let Some(f) = frequency(count, 20) {
        return geodesic_facets(f)
            .into_iter()
            .map(|[a, b, c]| (b - a).cross(c - a).normalize())
            .collect();
    }
    if let Some(f) = count.checked_sub(2).and_then(|count| frequency(count, 10)) {
        return geodesic_vertices(f);
    }
    fibonacci(count)
}

/// Directions within `half_angle` of the unit vector `axis`: the axis and rings about it, the last
/// on the rim, neighbours at most [`CONE_STEP`] apart. A zero (or negative, or nan) angle gives the
/// axis alone.
pub fn cone(axis: DVec3, half_angle: f64) -> Vec<DVec3> {
    let half_angle = half_angle.min(PI);
    let mut found = vec![axis];
    let rings = (half_angle / CONE_STEP - 1e-9).ceil().max(0.0) as usize;
    let (side, other) = axis.any_orthonormal_pair();
    for ring in 1..=rings {
        let (sin, cos) = (half_angle * ring as f64 / rings as f64).sin_cos();
        if sin < 1e-9 {
            // The ring at pi is one direction.
            found.push(axis * cos.signum());
            continue;
        }
        let steps = ((TAU * sin / CONE_STEP).ceil() as usize).max(6);
        for step in 0..steps {
            let (sin_turn, cos_turn) = (TAU * step as f64 / steps as f64).sin_cos();
            found.push(axis * cos + (side * cos_turn + other * sin_turn) * sin);
        }
    }
    found
}

/// Equal areas along the axis, golden-angle turns about it (Vogel 1979 carried to the sphere).
fn fibonacci(count: usize) -> Vec<DVec3> {
    let golden_turn = TAU * (2.0 - f64::midpoint(1.0, 5.0_f64.sqrt()));
    (0..count)
        .map(|index| {
            let z = 1.0 - (2 * index + 1) as f64 / count as f64;
            let radius = (1.0 - z * z).sqrt();
            // Reduced before the sine, or the turn loses digits at large indices.
            let (sin, cos) = (golden_turn * index as f64).rem_euclid(TAU).sin_cos();
            DVec3::new(radius * cos, radius * sin, z)
        })
        .collect()
}

/// Corners and facets of the icosahedron, counter-clockwise from outside.
fn icosahedron() -> ([DVec3; 12], [[usize; 3]; 20]) {
    let g = f64::midpoint(1.0, 5.0_f64.sqrt());
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let facets = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    (corners.map(|corner| DVec3::from_array(corner).normalize()), facets)
}

/// The point of facet `(a, b, c)` at integer barycentric coordinates `(f - i - j, i, j)`, on the
/// sphere.
fn on_sphere([a, b, c]: [DVec3; 3], f: usize, i: usize, j: usize) -> DVec3 {
    (a * (f - i - j) as f64 + b * i as f64 + c * j as f64).normalize()
}

/// The 20 f^2 facets of the icosahedron divided f-fold, corners on the sphere.
fn geodesic_facets(f: usize) -> Vec<[DVec3; 3]> {
    let (corners, facets) = icosahedron();
    let mut found = Vec::with_capacity(20 * f * f);
    for facet in facets {
        let facet = facet.map(|corner| corners[corner]);
        let at = |i, j| on_sphere(facet, f, i, j);
        for i in 0..f {
            for j in 0..f - i {
                found.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < f {
                    found.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    found
}

/// The 10 f^2 + 2 vertices of the icosahedron divided f-fold: corners, then points inside edges,
/// then inside facets.
fn geodesic_vertices(f: usize) -> Vec<DVec3> {
    let (corners, facets) = icosahedron();
    let mut found = corners.to_vec();
    for [a, b, c] in facets {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            // Each edge belongs to two facets, which run along it in opposite senses.
            if from < to {
                found.extend((1..f).map(|i| {
                    (corners[from] * (f - i) as f64 + corners[to] * i as f64).normalize()
                }));
            }
        }
    }
    for facet in facets {
        let facet = facet.map(|corner| corners[corner]);
        for i in 1..f {
            found.extend((1..f - i).map(|j| on_sphere(facet, f, i, j)));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_count_gives_that_many_distinct_unit_vectors_without_a_bias() {
        for count in [1, 2, 3, 6, 7, 12, 20, 42, 80, 92, 100, 162, 180, 500, 642] {
            let found = directions(count);
            assert_eq!(found.len(), count);
            let mut nearest: f64 = 4.0;
            for (index, a) in found.iter().enumerate() {
                assert!((a.length() - 1.0).abs() < 1e-15, "{count}: {a}");
                for b in &found[..index] {
                    nearest = nearest.min(a.distance(*b));
                }
            }
            // Neighbours of a uniform set lie about sqrt(4 pi / n) apart.
            if count > 7 {
                assert!(nearest > 0.6 * (4.0 * PI / count as f64).sqrt(), "{count}: {nearest}");
                let mean = found.iter().sum::<DVec3>() / count as f64;
                assert!(mean.length() < 0.05, "{count}: {mean}");
            }
        }
    }

    #[test]
    fn no_direction_is_far_from_a_member() {
        for count in [92, 100, 500] {
            let found = directions(count);
            let worst = fibonacci(20_000)
                .iter()
                .map(|probe| found.iter().map(|member| member.dot(*probe)).fold(-1.0, f64::max))
                .fold(1.0, f64::min);
            assert!(
                worst.acos() < 1.3 * (4.0 * PI / count as f64).sqrt(),
                "{count}: {}",
                worst.acos()
            );
            if count == crate::load::ACCELERATION_DIRECTIONS {
                // The number that ACCELERATION_DIRECTIONS documents.
                assert!(
                    worst > 0.97 && worst.acos().to_degrees() < 14.0,
                    "{}",
                    worst.acos().to_degrees()
                );
            }
        }
    }

    #[test]
    fn geodesic_sets_hold_the_opposite_of_every_member() {
        for count in [12, 20, 42, 80, 92, 500] {
            let found = directions(count);
            assert!(
                found.iter().all(|a| found.iter().any(|b| (*a + *b).length() < 1e-14)),
                "{count}"
            );
        }
    }

    #[test]
    fn facet_normals_point_outwards() {
        assert!(
            geodesic_facets(3)
                .iter()
                .all(|[a, b, c]| (*b - *a).cross(*c - *a).dot(*a + *b + *c) > 0.0)
        );
    }

    #[test]
    fn a_cone_holds_its_axis_and_its_rim_and_nothing_outside() {
        for degrees in [0.0, 5.0, 10.0, 33.0, 90.0, 150.0, 180.0_f64] {
            let axis = DVec3::new(0.48, -0.6, 0.64);
            let half_angle = degrees.to_radians();
            let found = cone(axis, half_angle);
            assert_eq!(found[0], axis);
            let widest = found
                .iter()
                .map(|direction| axis.dot(*direction).clamp(-1.0, 1.0).acos())
                .fold(0.0, f64::max);
            assert!((widest - half_angle).abs() < 1e-7, "{degrees}: {widest}");
        }
        assert_eq!(cone(DVec3::Z, 0.0).len(), 1);
    }
}

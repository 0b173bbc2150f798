//! Directions spread over the sphere or over a cone, the same on every run.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Largest angle between neighbouring directions of [`cone`] \[rad\].
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
        let (points, triangles) = geodesic(f);
        let normal = |corners: [usize; 3]| {
            let [a, b, c] = corners.map(|corner| points[corner]);
            (b - a).cross(c - a).normalize()
        };
        return triangles.into_iter().map(normal).collect();
    }
    if let Some(f) = count.checked_sub(2).and_then(|count| frequency(count, 10)) {
        return geodesic(f).0;
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

/// The icosahedron with each edge divided into `f` parts and blown up to the sphere (class I):
/// `10 f^2 + 2` unit vectors (corners, then points inside edges, then inside facets) and `20 f^2`
/// triangles of them, counter-clockwise from outside.
pub fn geodesic(f: usize) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let (corners, facets) = icosahedron();
    let mut points = corners.to_vec();
    // First point inside each edge, from its lower to its higher corner.
    let mut inside_edge = [[0; 12]; 12];
    for [a, b, c] in facets {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            // Each edge belongs to two facets, which run along it in opposite senses.
            if from < to {
                inside_edge[from][to] = points.len();
                points.extend((1..f).map(|i| {
                    (corners[from] * (f - i) as f64 + corners[to] * i as f64).normalize()
                }));
            }
        }
    }
    let mut triangles = Vec::with_capacity(20 * f * f);
    for facet in facets {
        let [a, b, c] = facet.map(|corner| corners[corner]);
        let first = points.len();
        for i in 1..f {
            points.extend(
                (1..f - i)
                    .map(|j| (a * (f - i - j) as f64 + b * i as f64 + c * j as f64).normalize()),
            );
        }
        let along = |from: usize, to: usize, steps: usize| match steps {
            0 => from,
            _ if steps == f => to,
            _ if from < to => inside_edge[from][to] + steps - 1,
            _ => inside_edge[to][from] + (f - steps) - 1,
        };
        // The point at integer barycentric coordinates `(f - i - j, i, j)`.
        let at = |i: usize, j: usize| {
            let [a, b, c] = facet;
            if j == 0 {
                along(a, b, i)
            } else if i == 0 {
                along(a, c, j)
            } else if i + j == f {
                along(b, c, j)
            } else {
                // Rows before this one hold f - 2, f - 3, ... points.
                first + (i - 1) * (f - 1) - i * (i - 1) / 2 + j - 1
            }
        };
        for i in 0..f {
            for j in 0..f - i {
                triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < f {
                    triangles.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    (points, triangles)
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
    fn geodesic_triangles_cover_the_sphere_once_and_face_outwards() {
        for f in [1, 2, 3, 4, 7] {
            let (points, triangles) = geodesic(f);
            assert_eq!((points.len(), triangles.len()), (10 * f * f + 2, 20 * f * f), "{f}");
            let mut edges = std::collections::HashSet::new();
            for corners in &triangles {
                let [a, b, c] = corners.map(|corner| points[corner]);
                assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "{f}: {corners:?}");
                // Neighbours on the sphere, so that an index out of place would be seen.
                let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                // An edge of the icosahedron, 1.0515, seen through the middle of a facet, which lies at
                // 0.7947 of the radius, is 1.3232 long.
                assert!(longest < 1.3233 / f as f64, "{f}: {longest}");
                for (from, to) in [(0, 1), (1, 2), (2, 0)] {
                    assert!(edges.insert((corners[from], corners[to])), "{f}: {corners:?}");
                }
            }
            assert!(edges.iter().all(|&(from, to)| edges.contains(&(to, from))), "{f}");
        }
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

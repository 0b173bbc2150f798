//! Polygons of indexed formats cut into triangles.

use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

/// Largest polygon that is cut by ears, which takes time with the square of its corners; beyond it
/// a fan must do.
const MOST_EARS: usize = 5_000;

/// Cuts a polygon in space into triangles (numbers of its corners). A convex one becomes a fan,
/// another one is cut ear by ear in the plane that fits it. One that crosses itself still gives
/// triangles, for the repair to judge.
pub(super) fn triangulate(points: &[DVec3], mut emit: impl FnMut([usize; 3])) {
    let count = points.len();
    let fan = |emit: &mut dyn FnMut([usize; 3])| {
        (1..count.saturating_sub(1)).for_each(|k| emit([0, k, k + 1]))
    };
    if count <= 3 || count > MOST_EARS {
        return fan(&mut emit);
    }
    // Newell's normal: twice the vector area, whatever corner comes first.
    let normal: DVec3 = (0..count)
        .map(|k| (points[k] - points[0]).cross(points[(k + 1) % count] - points[0]))
        .sum();
    let Some(normal) = normal.try_normalize() else { return fan(&mut emit) };
    let (x, y) = normal.any_orthonormal_pair();
    let flat: Vec<DVec2> = points
        .iter()
        .map(|&point| DVec2::new((point - points[0]).dot(x), (point - points[0]).dot(y)))
        .collect();
    let turn = |a: usize, b: usize, c: usize| {
        let coord = |k: usize| Coord { x: flat[k].x, y: flat[k].y };
        orient2d(coord(a), coord(b), coord(c))
    };
    let mut left: Vec<usize> = (0..count).collect();
    let corner = |left: &[usize], k: usize| {
        (left[(k + left.len() - 1) % left.len()], left[k], left[(k + 1) % left.len()])
    };
    if (0..count).all(|k| turn((k + count - 1) % count, k, (k + 1) % count) >= 0.0) {
        return fan(&mut emit);
    }
    while left.len() > 3 {
        let ear = (0..left.len()).find(|&k| {
            let (a, b, c) = corner(&left, k);
            turn(a, b, c) > 0.0
                && left.iter().all(|&p| {
                    p == a
                        || p == b
                        || p == c
                        || turn(a, b, p) < 0.0
                        || turn(b, c, p) < 0.0
                        || turn(c, a, p) < 0.0
                })
        });
        // No ear: what is left has no area or crosses itself. Cutting any corner ends the search.
        let k = ear.unwrap_or(0);
        let (a, b, c) = corner(&left, k);
        emit([a, b, c]);
        left.remove(k);
    }
    emit([left[0], left[1], left[2]]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[DVec3]) -> (usize, f64, f64) {
        let (mut count, mut sum, mut vector) = (0, 0.0, DVec3::ZERO);
        triangulate(points, |[a, b, c]| {
            let cross = (points[b] - points[a]).cross(points[c] - points[a]) / 2.0;
            count += 1;
            sum += cross.length();
            vector += cross;
        });
        (count, sum, vector.length())
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        let at = |x: f64, y: f64| DVec3::new(x, y, 0.3 * x - 0.2 * y);
        let scale = (1.0_f64 + 0.09 + 0.04).sqrt();
        let arrow = [at(0.0, 0.0), at(4.0, -2.0), at(1.0, 0.0), at(4.0, 2.0)]; // a fan from the tip would be wrong from the notch's other side
        for turn in 0..4 {
            let mut points = arrow;
            points.rotate_left(turn);
            let (count, sum, vector) = area(&points);
            assert_eq!(count, 2);
            assert!(
                (sum - 2.0 * scale).abs() < 1e-12 && (vector - sum).abs() < 1e-12,
                "{turn}: {sum} {vector}"
            );
        }
        let comb: Vec<DVec3> = [
            (0, 0),
            (7, 0),
            (7, 3),
            (6, 3),
            (6, 1),
            (4, 1),
            (4, 3),
            (3, 3),
            (3, 1),
            (1, 1),
            (1, 3),
            (0, 3),
        ]
        .map(|(x, y)| at(f64::from(x), f64::from(y)))
        .to_vec();
        let (count, sum, vector) = area(&comb);
        assert_eq!(count, 10);
        assert!(
            (sum - 13.0 * scale).abs() < 1e-12 && (vector - sum).abs() < 1e-12,
            "{sum} {vector}"
        );
    }

    #[test]
    fn any_points_give_triangles() {
        assert_eq!(area(&[]).0, 0);
        assert_eq!(area(&[DVec3::ZERO; 2]).0, 0);
        assert_eq!(area(&[DVec3::ONE; 6]).0, 4);
        let bow = [
            DVec3::ZERO,
            DVec3::new(1.0, 1.0, 0.0),
            DVec3::new(2.0, 0.0, 0.0),
            DVec3::new(2.0, 1.0, 0.0),
            DVec3::new(0.0, 1.0, 0.0),
        ];
        assert_eq!(area(&bow).0, 3);
    }
}

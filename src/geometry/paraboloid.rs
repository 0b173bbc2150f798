//! Surfaces of second order through points, by least squares.

use glam::{DMat2, DVec2, DVec3};
use nalgebra::{Matrix6, Vector6};

/// Coefficients that the points do not determine (relative eigenvalue) are zero.
const UNDETERMINED: f64 = 1e-10;

/// Pivot over the greatest sum from which on all six are determined.
const CLEAR: f64 = 1e-5;

/// A height `z = height + slope . x + x . bend x / 2` over a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Paraboloid {
    /// At the origin \[m\].
    pub(crate) height: f64,
    /// There.
    pub(crate) slope: DVec2,
    /// Second derivatives, symmetric [1/m].
    pub(crate) bend: DMat2,
}

impl Paraboloid {
    /// The one nearest to points by weighted least squares in their `z`, each with its weight. What
    /// the points leave open, as the bend along two rows of points, is zero. `None`: fewer than
    /// three points, or all at one place.
    pub(crate) fn fit(points: impl Iterator<Item = (DVec3, f64)> + Clone) -> Option<Self> {
        let ([height, x, y, xx, xy, yy], size) = solve(points, 1.0)?;
        let square = size * size;
        let bend = [DVec2::new(xx, xy), DVec2::new(xy, yy)].map(|column| column / square);
        let bend = DMat2::from_cols(bend[0], bend[1]);
        Some(Self { height, slope: DVec2::new(x, y) / size, bend })
    }

    /// The plane nearest to points, likewise.
    pub(crate) fn flat(points: impl Iterator<Item = (DVec3, f64)> + Clone) -> Option<Self> {
        let ([height, x, y, ..], size) = solve(points, 0.0)?;
        Some(Self { height, slope: DVec2::new(x, y) / size, bend: DMat2::ZERO })
    }

    /// Root mean square distance of points from it, along `z` \[m\].
    pub(crate) fn off(&self, points: impl Iterator<Item = DVec3>) -> f64 {
        let (mut squares, mut count) = (0.0, 0.0);
        for point in points {
            squares += (point.z - self.at(point.truncate())).powi(2);
            count += 1.0;
        }
        (squares / f64::max(count, 1.0)).sqrt()
    }

    /// Its height over a point of the plane \[m\].
    pub(crate) fn at(&self, x: DVec2) -> f64 {
        self.height + self.slope.dot(x) + 0.5 * x.dot(self.bend * x)
    }

    /// Its least and greatest bend [1/m], with the unit direction of the least.
    pub(crate) fn principal(&self) -> ([f64; 2], DVec2) {
        principal(self.bend)
    }
}

/// Least and greatest eigenvalue of a symmetric matrix, with the unit direction of the least.
pub(crate) fn principal(matrix: DMat2) -> ([f64; 2], DVec2) {
    let (a, b, c) = (matrix.x_axis.x, matrix.x_axis.y, matrix.y_axis.y);
    let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
    let apart = half.hypot(b);
    // The greatest lies at half the angle of (half, b).
    ([mean - apart, mean + apart], DVec2::from_angle(0.5 * b.atan2(half)).perp())
}

/// Coefficients of weighted least squares in `z` over places in units of the greatest distance from
/// the origin, which is told too. `curved`: 1, or 0 for a plane.
fn solve(
    points: impl Iterator<Item = (DVec3, f64)> + Clone,
    curved: f64,
) -> Option<([f64; 6], f64)> {
    let size = points.clone().map(|(point, _)| point.truncate().length()).fold(0.0, f64::max);
    if points.clone().count() < 3 || size <= 0.0 {
        return None;
    }
    let (mut sums, mut right) = ([[0.0; 6]; 6], [0.0; 6]);
    for (point, weight) in points {
        let x = point.truncate() / size;
        let bend = curved * DVec3::new(0.5 * x.x * x.x, x.x * x.y, 0.5 * x.y * x.y);
        let row = [1.0, x.x, x.y, bend.x, bend.y, bend.z];
        for i in 0..6 {
            let weighted = weight * row[i];
            (0..=i).for_each(|j| sums[i][j] += weighted * row[j]);
            right[i] += weighted * point.z;
        }
    }
    if let Some(found) = solve_definite(&sums, right) {
        return Some((found, size));
    }
    let matrix = Matrix6::from_fn(|i, j| sums[i.max(j)][i.min(j)]);
    let right = Vector6::from(right);
    let eigen = matrix.symmetric_eigen();
    let most = eigen.eigenvalues.amax();
    let determined = |value: f64| if value > UNDETERMINED * most { 1.0 / value } else { 0.0 };
    let inverse = Matrix6::from_diagonal(&eigen.eigenvalues.map(determined));
    let found = eigen.eigenvectors * inverse * eigen.eigenvectors.transpose() * right;
    Some((found.into(), size))
}

/// The solution of a symmetric system by its lower half (Cholesky); `None` unless it is so far from
/// singular that rounding hardly tells.
fn solve_definite(lower: &[[f64; 6]; 6], mut right: [f64; 6]) -> Option<[f64; 6]> {
    let mut factor = [[0.0; 6]; 6];
    let most = (0..6).map(|i| lower[i][i]).fold(0.0, f64::max);
    for i in 0..6 {
        for j in 0..i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            factor[i][j] = (lower[i][j] - known) / factor[j][j];
        }
        let known: f64 = (0..i).map(|k| factor[i][k] * factor[i][k]).sum();
        let pivot = lower[i][i] - known;
        // A row of points, and what is not asked for, has none.
        if pivot.is_nan() || pivot <= CLEAR * most {
            return None;
        }
        factor[i][i] = pivot.sqrt();
    }
    for i in 0..6 {
        let known: f64 = (0..i).map(|k| factor[i][k] * right[k]).sum();
        right[i] = (right[i] - known) / factor[i][i];
    }
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|k| factor[k][i] * right[k]).sum();
        right[i] = (right[i] - known) / factor[i][i];
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_paraboloid_is_found_again() {
        let truth = Paraboloid {
            height: 0.3e-3,
            slope: DVec2::new(0.02, -0.01),
            bend: DMat2::from_cols(DVec2::new(30.0, 7.0), DVec2::new(7.0, 55.0)),
        };
        let points: Vec<(DVec3, f64)> = (0..40)
            .map(|k| DVec2::from_angle(2.4 * f64::from(k)) * 1e-4 * f64::from(k))
            .map(|x| (x.extend(truth.at(x)), 1.0 + x.x))
            .collect();
        let found = Paraboloid::fit(points.iter().copied()).unwrap();
        assert!((found.height - truth.height).abs() < 1e-12);
        assert!((found.slope - truth.slope).length() < 1e-9);
        for column in 0..2 {
            assert!((found.bend.col(column) - truth.bend.col(column)).length() < 1e-6);
        }
        let ([low, high], axis) = found.principal();
        assert!((low + high - 85.0).abs() < 1e-6 && (low * high - (1650.0 - 49.0)).abs() < 1e-4);
        assert!((truth.bend * axis - low * axis).length() < 1e-6);
    }

    /// What points determine well is what the system's eigenvalues say.
    #[test]
    fn both_ways_to_solve_agree() {
        let points = (0..25).map(|k| {
            let x = DVec2::from_angle(2.4 * f64::from(k)) * 0.2 * f64::from(k).sqrt();
            (x.extend((3.0 * x.x).sin() + x.y * x.y), 1.0 + 0.1 * x.y)
        });
        let (found, size) = solve(points.clone(), 1.0).unwrap();
        let (mut matrix, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for (point, weight) in points {
            let x = point.truncate() / size;
            let row = Vector6::new(1.0, x.x, x.y, 0.5 * x.x * x.x, x.x * x.y, 0.5 * x.y * x.y);
            matrix += weight * row * row.transpose();
            right += weight * point.z * row;
        }
        let wanted = matrix.try_inverse().unwrap() * right;
        assert!((Vector6::from(found) - wanted).amax() < 1e-12, "{found:?} {wanted}");
        // A row of points determines three.
        let mut lower = [[0.0; 6]; 6];
        (0..6).for_each(|i| lower[i][i] = if i < 3 { 1.0 } else { 1e-7 });
        assert_eq!(solve_definite(&lower, [1.0; 6]), None);
    }

    #[test]
    fn two_rows_of_points_leave_the_bend_along_them_zero() {
        let points: Vec<(DVec3, f64)> = (0..10)
            .map(|k| DVec2::new(1e-3 * f64::from(k / 2 - 2), 5e-3 * f64::from(k % 2)))
            .map(|x| (x.extend(-50.0 * x.x * x.x), 1.0))
            .collect();
        let found = Paraboloid::fit(points.iter().copied()).unwrap();
        let ([low, high], axis) = found.principal();
        assert!(
            (low + 100.0).abs() < 1e-6 && high.abs() < 1e-6 && axis.y.abs() < 1e-6,
            "{found:?}"
        );
        assert!(Paraboloid::fit(points[..2].iter().copied()).is_none());
    }
}

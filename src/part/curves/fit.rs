//! Surfaces of revolution with a straight or circular profile, and their fit to points.

use glam::DVec3;
use nalgebra::{SMatrix, SVector};

use super::Axis;

/// Profile of a surface of revolution in the plane of the place `s` along the axis (from its
/// origin) and the distance `r` from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::part) enum Profile {
    /// `r = radius + s tan(slope)`: a cylinder where the slope is zero, else a cone.
    Line {
        /// Distance from the axis at its origin \[m\].
        radius: f64,
        /// Angle to the axis \[rad\].
        slope: f64,
    },
    /// A circle about `s = 0`, `r = major`: a sphere where that is zero, else a torus.
    Circle {
        /// Distance of the centre from the axis \[m\].
        major: f64,
        /// Radius \[m\].
        minor: f64,
    },
}

/// Which parameters a fit may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::part) enum Kind {
    Cylinder,
    Cone,
    Sphere,
    Torus,
    /// With any profile: not fitted.
    Revolution,
}

/// Axis across (two), axis along, turn of the axis (two), first and second of the profile.
type Parameters = SVector<f64, 7>;

impl Kind {
    fn is_free(self) -> [bool; 7] {
        match self {
            Kind::Cylinder => [true, true, false, true, true, true, false],
            Kind::Cone => [true, true, false, true, true, true, true],
            Kind::Sphere => [true, true, true, false, false, false, true],
            Kind::Torus => [true; 7],
            Kind::Revolution => [false; 7],
        }
    }

    /// Number of parameters.
    pub(in crate::part) fn freedoms(self) -> usize {
        self.is_free().iter().filter(|free| **free).count()
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::part) struct Surface {
    pub axis: Axis,
    pub profile: Profile,
}

/// Most steps of a fit; exact data need three to six.
const STEPS: usize = 40;
/// Angle of a cone to its axis, at most \[rad\]: 89.8 degrees.
const FLATTEST: f64 = 1.567;
/// Most points that a fit looks at: more make it no better.
const MOST_POINTS: usize = 600;

impl Surface {
    /// Place along the axis, distance from it, unit vector away from it.
    fn place(&self, point: DVec3) -> (f64, f64, DVec3) {
        let relative = point - self.axis.origin;
        let s = relative.dot(self.axis.direction);
        let across = relative - self.axis.direction * s;
        let r = across.length();
        let away = if r > 0.0 { across / r } else { self.axis.direction.any_orthonormal_vector() };
        (s, r, away)
    }

    /// Signed distance and its derivatives by `r` and `s`.
    fn level(&self, s: f64, r: f64) -> (f64, f64, f64) {
        match self.profile {
            Profile::Line { radius, slope } => {
                let (sin, cos) = slope.sin_cos();
                ((r - radius) * cos - s * sin, cos, -sin)
            }
            Profile::Circle { major, minor } => {
                let across = r - major;
                let length = (across * across + s * s).sqrt().max(f64::MIN_POSITIVE);
                (length - minor, across / length, s / length)
            }
        }
    }

    /// Distance from the surface \[m\], positive on the side away from the axis or the tube.
    pub(in crate::part) fn distance(&self, point: DVec3) -> f64 {
        let (s, r, _) = self.place(point);
        self.level(s, r).0
    }

    /// Distance and unit normal of the surface of equal distance through `point`.
    pub(in crate::part) fn distance_and_normal(&self, point: DVec3) -> (f64, DVec3) {
        let (s, r, away) = self.place(point);
        let (distance, by_r, by_s) = self.level(s, r);
        (distance, away * by_r + self.axis.direction * by_s)
    }

    /// The radius that residuals are compared with \[m\]: of a cylinder, of a cone at the axis'
    /// origin, of a sphere or of a tube.
    pub(in crate::part) fn radius(&self) -> f64 {
        match self.profile {
            Profile::Line { radius, .. } => radius.abs(),
            Profile::Circle { minor, .. } => minor,
        }
    }

    /// The greatest radius about the axis: of a sphere, or of a torus outside \[m\].
    pub(in crate::part) fn reach(&self) -> f64 {
        match self.profile {
            Profile::Line { radius, .. } => radius.abs(),
            Profile::Circle { major, minor } => major + minor,
        }
    }

    /// The same surface with all lengths times `scale`.
    pub(in crate::part) fn scaled(mut self, scale: f64) -> Self {
        self.axis.origin *= scale;
        match &mut self.profile {
            Profile::Line { radius, .. } => *radius *= scale,
            Profile::Circle { major, minor } => (*major, *minor) = (*major * scale, *minor * scale),
        }
        self
    }

    /// Greatest distance of `points` \[m\].
    pub(super) fn residual(&self, points: &[DVec3]) -> f64 {
        points.iter().map(|&point| self.distance(point).abs()).fold(0.0, f64::max)
    }

    /// The surface of this `kind` nearest to `points` (least squares), starting from `self`.
    /// `None` when it runs away.
    pub(in crate::part) fn fitted(mut self, kind: Kind, points: &[DVec3]) -> Option<Surface> {
        let stride = points.len().div_ceil(MOST_POINTS).max(1);
        // Not every second point, say: that may be one of two rings.
        let jitter = |k: usize| (k.wrapping_mul(0x9e37_79b9) >> 16) % stride;
        let sample: Vec<DVec3> = (0..points.len().div_ceil(stride))
            .filter_map(|k| points.get(k * stride + jitter(k)).copied())
            .collect();
        let count = sample.len() as f64;
        let mean = sample.iter().sum::<DVec3>() / count;
        let size = (sample.iter().map(|p| p.distance_squared(mean)).sum::<f64>() / count).sqrt();
        if kind == Kind::Cylinder || kind == Kind::Cone {
            self.move_origin(self.axis.along(mean));
        }
        let free = kind.is_free();
        // Lengths in units of the points' size, so that angles and lengths are alike.
        let scale = [size, size, size, 1.0, 1.0, size, if kind == Kind::Cone { 1.0 } else { size }];
        let mut damping = 1e-6;
        let (mut normal, mut gradient, mut cost) = self.system(&sample, &free, &scale);
        for _ in 0..STEPS {
            let mut damped = normal;
            for k in 0..7 {
                damped[(k, k)] += damping * (normal[(k, k)] + 1e-12 * normal.trace());
            }
            let step = damped.cholesky()?.solve(&-gradient);
            let moved = self.moved(&step.component_mul(&Parameters::from(scale)))?;
            let (next_normal, next_gradient, next_cost) = moved.system(&sample, &free, &scale);
            if next_cost <= cost {
                let gain = cost - next_cost;
                (self, normal, gradient, cost) = (moved, next_normal, next_gradient, next_cost);
                damping = (damping / 10.0).max(1e-12);
                if gain <= 1e-9 * cost || step.norm() < 1e-13 {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e6 || step.norm() < 1e-13 {
                    break;
                }
            }
        }
        let sound = match self.profile {
            Profile::Line { radius, slope } => radius > 0.0 && slope.abs() < FLATTEST,
            Profile::Circle { major, minor } => major >= 0.0 && minor > 0.0,
        };
        (sound && self.axis.origin.is_finite() && cost.is_finite()).then_some(self)
    }

    /// The cylinder nearest to points near `self`.
    pub(super) fn as_cylinder(self, points: &[DVec3]) -> Option<Surface> {
        let Profile::Line { radius, .. } = self.profile else { return None };
        Surface { profile: Profile::Line { radius, slope: 0.0 }, ..self }
            .fitted(Kind::Cylinder, points)
    }

    /// Moves the origin along the axis; the surface stays.
    pub(super) fn move_origin(&mut self, by: f64) {
        self.axis.origin += self.axis.direction * by;
        if let Profile::Line { radius, slope } = &mut self.profile {
            *radius += by * slope.tan();
        }
    }

    /// Normal matrix, gradient and sum of the squared distances, parameters scaled.
    fn system(
        &self,
        points: &[DVec3],
        free: &[bool; 7],
        scale: &[f64; 7],
    ) -> (SMatrix<f64, 7, 7>, Parameters, f64) {
        let (u, v) = self.axis.direction.any_orthonormal_pair();
        let mut normal = SMatrix::<f64, 7, 7>::zeros();
        let mut gradient = Parameters::zeros();
        let mut cost = 0.0;
        for &point in points {
            let (s, r, away) = self.place(point);
            let (distance, by_r, by_s) = self.level(s, r);
            let (eu, ev) = (away.dot(u), away.dot(v));
            let tilt = by_s * r - by_r * s;
            let profile = match self.profile {
                Profile::Line { radius, slope } => {
                    let (sin, cos) = slope.sin_cos();
                    [-cos, -(r - radius) * sin - s * cos]
                }
                Profile::Circle { .. } => [-by_r, -1.0],
            };
            let row = [-by_r * eu, -by_r * ev, -by_s, tilt * eu, tilt * ev, profile[0], profile[1]];
            let mut scaled = Parameters::zeros();
            for k in 0..7 {
                scaled[k] = row[k] * scale[k];
            }
            for column in 0..7 {
                for row in column..7 {
                    normal[(row, column)] += scaled[row] * scaled[column];
                }
            }
            gradient += scaled * distance;
            cost += distance * distance;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        for k in (0..7).filter(|&k| !free[k]) {
            normal.column_mut(k).fill(0.0);
            normal.row_mut(k).fill(0.0);
            normal[(k, k)] = 1.0;
            gradient[k] = 0.0;
        }
        (normal, gradient, cost)
    }

    fn moved(&self, step: &Parameters) -> Option<Surface> {
        let Axis { origin, direction } = self.axis;
        let (u, v) = direction.any_orthonormal_pair();
        let axis = Axis {
            origin: origin + u * step[0] + v * step[1] + direction * step[2],
            direction: (direction + u * step[3] + v * step[4]).try_normalize()?,
        };
        let profile = match self.profile {
            Profile::Line { radius, slope } => {
                Profile::Line { radius: radius + step[5], slope: slope + step[6] }
            }
            Profile::Circle { major, minor } => {
                Profile::Circle { major: major + step[5], minor: minor + step[6] }
            }
        };
        Some(Surface { axis, profile })
    }
}

/// Centre and radius of the circle through points of a plane that are given by two coordinates, by
/// Kasa's linear least squares; exact for points of a circle.
pub(super) fn circle(points: impl Iterator<Item = (f64, f64)> + Clone) -> Option<(f64, f64, f64)> {
    let (mut count, mut x0, mut y0) = (0.0, 0.0, 0.0);
    for (x, y) in points.clone() {
        count += 1.0;
        x0 += x;
        y0 += y;
    }
    (x0, y0) = (x0 / count, y0 / count);
    let (mut xx, mut xy, mut yy, mut zx, mut zy, mut z) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (x, y) in points {
        let (x, y) = (x - x0, y - y0);
        let square = x * x + y * y;
        xx += x * x;
        xy += x * y;
        yy += y * y;
        zx += square * x;
        zy += square * y;
        z += square;
    }
    let determinant = xx * yy - xy * xy;
    if determinant <= 1e-14 * (xx + yy) * (xx + yy) || !determinant.is_finite() {
        return None;
    }
    let x = (zx * yy - zy * xy) / (2.0 * determinant);
    let y = (zy * xx - zx * xy) / (2.0 * determinant);
    Some((x0 + x, y0 + y, (z / count + x * x + y * y).sqrt()))
}

//! The slip problem for a given pressure: `mu_s = max over v of (w.v)/D(v)` with `D(v) = sum int p |v| dA`.
//!
//! `D` is a norm of the twist, convex and twice differentiable, so the incipient motion and `mu_s` are unique up to
//! scale. The solver minimises `D^2/2 - w.v`; at the minimum `w = D grad D`, which are equations (3), (4) and the
//! moment equation about the origin, and `mu_s = D`.

use glam::DVec2;
use nalgebra::{Matrix3, Vector3};

use crate::contact::{Friction, Loops, friction, moments};
use crate::model::Bounds;

use super::shanno;

/// An area with its pressure `p0 + p1 x1 + p2 x2`, not negative on the area.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// The area.
    pub area: &'a Loops,
    /// The pressure coefficients.
    pub p: [f64; 3],
}

/// `D`, its gradient and its Hessian at a twist.
#[derive(Debug, Clone, Copy)]
pub struct Dissipation {
    /// `sum int p |v| dA`.
    pub value: f64,
    /// Gradient.
    pub gradient: Vector3<f64>,
    /// Hessian.
    pub hessian: Matrix3<f64>,
}

/// Sum over the fields at twist `v`.
pub fn dissipation(fields: &[Field<'_>], v: Vector3<f64>) -> Dissipation {
    let mut gradient = Vector3::zeros();
    let mut hessian = Matrix3::zeros();
    for field in fields {
        let Friction { g, hessian: h } = friction(field.area, [v.x, v.y, v.z], field.p);
        for m in 0..3 {
            gradient += field.p[m] * Vector3::from(g[m]);
        }
        hessian += Matrix3::from_fn(|i, j| h[i][j]);
    }
    Dissipation { value: gradient.dot(&v), gradient, hessian }
}

/// The solution of the slip problem.
#[derive(Debug, Clone, Copy)]
pub struct Solution {
    /// Twist scaled so that `w = D grad D`.
    pub twist: Vector3<f64>,
    /// Smallest friction coefficient.
    pub mu: f64,
    /// Largest component of `D grad D - w` over `|w|`.
    pub residual: f64,
    /// Evaluations of the integrals.
    pub evaluations: u32,
    /// Iterations of the minimiser.
    pub iterations: u32,
}

/// Which minimiser refines a solution.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Refiner {
    /// Damped Newton with the analytic Hessian or Jacobian.
    #[default]
    Newton,
    /// Shanno's conjugate-direction method (the paper's reference [17]), in variables scaled by the Hessian or Jacobian
    /// at the start.
    Shanno,
}

/// Below this residual, relative to the load, a solution is at rounding level.
const CONVERGED: f64 = 2e-15;

/// A twist from the ellipsoid approximation of the limit surface: the start where no seed is known.
pub fn ellipsoid_start(fields: &[Field<'_>], w: Vector3<f64>) -> Vector3<f64> {
    let (mut load, mut first, mut polar, mut area) = (0.0, DVec2::ZERO, 0.0, 0.0);
    for Field { area: loops, p } in fields {
        let m = moments(loops);
        load += p[0] * m[0] + p[1] * m[1] + p[2] * m[2];
        first += DVec2::new(p[0] * m[1] + p[1] * m[3] + p[2] * m[4], p[0] * m[2] + p[1] * m[4] + p[2] * m[5]);
        let middle = DVec2::new(m[1], m[2]) / m[0];
        polar += m[3] + m[5] - m[0] * middle.length_squared();
        area += m[0];
    }
    let centre = first / load;
    let radius_squared = 0.85 * polar / area;
    let force = DVec2::new(w.x, w.y);
    let omega = (w.z - centre.perp_dot(force)) / radius_squared;
    Vector3::new(w.x + omega * centre.y, w.y - omega * centre.x, omega)
}

/// Solves the slip problem for the in-plane load `w = (F1, F2, M3)`, not zero, from `start` or, without one, from the
/// ellipsoid approximation.
pub fn solve(fields: &[Field<'_>], w: Vector3<f64>, start: Option<Vector3<f64>>, refiner: Refiner) -> Solution {
    let start = start.filter(|v| w.dot(v) > 0.0).unwrap_or_else(|| ellipsoid_start(fields, w));
    let start = start / start.norm();
    let first = dissipation(fields, start);
    // The exact minimum along the ray of the start.
    let scale = w.dot(&start) / (first.value * first.value);
    let at_start = Dissipation { value: first.value * scale, gradient: first.gradient, hessian: first.hessian / scale };
    match refiner {
        Refiner::Newton => newton(fields, w, start * scale, at_start),
        Refiner::Shanno => conjugate(fields, w, start * scale, at_start),
    }
}

fn newton(fields: &[Field<'_>], w: Vector3<f64>, mut v: Vector3<f64>, mut at: Dissipation) -> Solution {
    let scale = w.amax();
    let mut evaluations = 1;
    let mut iterations = 0;
    let mut error = at.value * at.gradient - w;
    while error.amax() > CONVERGED * scale && iterations < 60 {
        iterations += 1;
        let matrix = at.gradient * at.gradient.transpose() + at.value * at.hessian;
        let step = -newton_step(matrix, error);
        let slope = error.dot(&step);
        let value = at.value * at.value / 2.0 - w.dot(&v);
        let mut t = 1.0;
        let mut improved = false;
        for _ in 0..40 {
            let tried = v + t * step;
            let next = dissipation(fields, tried);
            evaluations += 1;
            let next_error = next.value * next.gradient - w;
            // Near the minimum the value no longer resolves the step, the gradient does.
            let descends = next.value * next.value / 2.0 - w.dot(&tried) <= value + 1e-4 * t * slope;
            if (descends && next.value.is_finite()) || next_error.norm() < 0.5 * error.norm() {
                improved = next_error.norm() < error.norm() || (descends && error.amax() > 1e-9 * scale);
                if improved {
                    (v, at, error) = (tried, next, next_error);
                }
                break;
            }
            t *= 0.4;
        }
        if !improved {
            break;
        }
    }
    Solution { twist: v, mu: at.value, residual: error.amax() / scale, evaluations, iterations }
}

/// Solves with the (semi-definite) matrix, lifted off singularity where the area is a line or a point.
fn newton_step(matrix: Matrix3<f64>, rhs: Vector3<f64>) -> Vector3<f64> {
    let mut lift = 0.0;
    let trace = matrix.trace();
    for _ in 0..8 {
        if let Some(factor) = (matrix + Matrix3::identity() * (lift * trace)).cholesky() {
            return factor.solve(&rhs);
        }
        lift = if lift == 0.0 { 1e-15 } else { lift * 100.0 };
    }
    rhs / trace
}

/// Shanno's method on the same convex function, in variables in which its Hessian at the start is the identity.
fn conjugate(fields: &[Field<'_>], w: Vector3<f64>, start: Vector3<f64>, at: Dissipation) -> Solution {
    let matrix = at.gradient * at.gradient.transpose() + at.value * at.hessian;
    let back = matrix.cholesky().and_then(|factor| factor.l().transpose().try_inverse()).unwrap_or_else(Matrix3::identity);
    let scale = w.amax();
    let options = shanno::Options { gradient_tolerance: 1e-13 * (back.transpose() * w).norm(), max_evaluations: 400, ..Default::default() };
    let run = shanno::minimise([0.0; 3], &options, |y: &[f64; 3]| {
        let v = start + back * Vector3::from(*y);
        let at = dissipation(fields, v);
        let gradient = back.transpose() * (at.value * at.gradient - w);
        (at.value * at.value / 2.0 - w.dot(&v), gradient.into())
    });
    let twist = start + back * Vector3::from(run.x);
    let end = dissipation(fields, twist);
    let residual = (end.value * end.gradient - w).amax() / scale;
    Solution { twist, mu: end.value, residual, evaluations: run.evaluations + 2, iterations: run.iterations }
}

/// Relative size of the twist's turns from which the upper bound is made; the bound's gap is about its square.
const CERTIFICATE_TURN: f64 = 1e-5;

/// Lower and upper bound on `mu_s` for this pressure, from the twist `v` and three twists around it.
///
/// Lower: `(w.v)/D(v)`. Upper: the gradients of `D` are points of the limit surface's supports, so if
/// `w = sum alpha_k grad D(v_k)` with `alpha_k >= 0`, then `mu_s <= sum alpha_k`; infinite where the three do not
/// enclose the load.
pub fn certificate(fields: &[Field<'_>], w: Vector3<f64>, v: Vector3<f64>) -> Bounds {
    let lower = w.dot(&v) / dissipation(fields, v).value;
    let axis = v.iamin();
    let mut helper = Vector3::zeros();
    helper[axis] = 1.0;
    let b1 = v.cross(&helper).normalize() * v.norm();
    let b2 = v.cross(&b1) / v.norm();
    let mut upper = f64::INFINITY;
    for turn in [CERTIFICATE_TURN, 1e2 * CERTIFICATE_TURN] {
        let supports = Matrix3::from_columns(&[0.0, 1.0, 2.0].map(|k| {
            let (s, c) = (std::f64::consts::TAU * k / 3.0).sin_cos();
            dissipation(fields, v + turn * (c * b1 + s * b2)).gradient
        }));
        if let Some(alpha) = supports.lu().solve(&w)
            && alpha.iter().all(|&a| a >= 0.0)
        {
            upper = upper.min(alpha.sum());
            break;
        }
    }
    Bounds { lower, upper: upper.max(lower) }
}

//! The slip problem for a given pressure: `mu_s = max over v of (w.v)/D(v)` with `D(v) = sum int p
//! |v| dA`.
//!
//! `D` is a norm of the twist, convex and twice differentiable, so the incipient motion and `mu_s`
//! are unique up to scale. The solver minimises `D^2/2 - w.v`; at the minimum `w = D grad D`, which
//! are equations (3), (4) and the moment equation about the origin, and `mu_s = D`.

use glam::DVec2;
use nalgebra::{Matrix3, Vector3};

use crate::contact::{Field, Friction, Loops, PlaneWrench, Twist, friction, moments};
use crate::model::Bounds;
use crate::request::Refiner;

use super::pads::Pads;
use super::pressure::{face_pressure, first_moment, separates};
use super::shanno;

/// Both areas as the pressure `q` leaves them in contact, with it; a face that is pressed all over
/// is not cut.
pub fn pressed_fields<'a>(
    pads: &'a Pads,
    q: &[f64; 4],
    scratch: &'a mut [Loops; 2],
) -> [Field<'a>; 2] {
    let p = [face_pressure(q, 0), face_pressure(q, 1)];
    let parted = [0, 1].map(|k| separates(&pads.areas[k], p[k]));
    for k in 0..2 {
        if parted[k] {
            pads.areas[k].clip_into(p[k], &mut scratch[k]);
        }
    }
    let scratch = &*scratch;
    [0, 1].map(|k| Field { area: if parted[k] { &scratch[k] } else { &pads.areas[k] }, p: p[k] })
}

/// `D`, its gradient and its Hessian at a twist.
#[derive(Debug, Clone, Copy)]
struct Dissipation {
    /// `sum int p |v| dA`.
    value: f64,
    gradient: Vector3<f64>,
    hessian: Matrix3<f64>,
}

/// The wrench that the friction gives with `mu = 1` against the twist `v`.
pub fn friction_wrench(fields: &[Field<'_>], v: Twist) -> PlaneWrench {
    dissipation(fields, v.into()).gradient.into()
}

/// Sum over the fields at twist `v`.
fn dissipation(fields: &[Field<'_>], v: Vector3<f64>) -> Dissipation {
    let mut gradient = Vector3::zeros();
    let mut hessian = Matrix3::zeros();
    for field in fields {
        let Friction { g, hessian: h } = friction(*field, v.into());
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
    pub twist: Twist,
    /// Smallest friction coefficient.
    pub mu: f64,
    /// Largest component of `D grad D - w` over that of `w`. The last step is not evaluated where
    /// the rate of convergence tells what is left; then this is what it tells.
    pub residual: f64,
    /// Evaluations of the integrals.
    pub evaluations: u32,
    /// Iterations of the minimiser.
    pub iterations: u32,
}

/// Below this residual, relative to the load, a solution is at rounding level.
const CONVERGED: f64 = 2e-15;

/// Below this residual one more Newton step, taken without an evaluation after it, leaves no error
/// in `mu` that can be seen: `mu` follows to third order, and the convergence is quadratic.
const LAST_STEP: f64 = 1e-6;

/// Residual that the rate of convergence must promise for that step.
const PROMISED: f64 = 1e-12;

/// A twist from an ellipsoid as the limit surface, its radius for the mix of force and moment at
/// hand: the start where no seed is known.
fn ellipsoid_start(fields: &[Field<'_>], w: Vector3<f64>) -> Vector3<f64> {
    let (mut normal, mut first) = (0.0, DVec2::ZERO);
    let (mut q11, mut q12, mut q22, mut area) = (0.0, 0.0, 0.0, 0.0);
    for Field { area: loops, p } in fields {
        let m = moments(loops);
        normal += p[0] * m[0] + p[1] * m[1] + p[2] * m[2];
        first += first_moment(&m, *p);
        let middle = DVec2::new(m[1], m[2]) / m[0];
        q11 += m[3] - middle.x * m[1];
        q12 += m[4] - middle.x * m[2];
        q22 += m[5] - middle.y * m[2];
        area += m[0];
    }
    let centre = first / normal;
    let force = DVec2::new(w.x, w.y);
    let moment = w.z - centre.perp_dot(force);
    // What resists a rotation is the mean distance, and near a translation the mean square of the
    // extent along it.
    let turning = MEAN_DISTANCE * (q11 + q22) / area;
    let size = force.length_squared();
    let share = size / (size + moment * moment / turning);
    let along = if size > 0.0 {
        (q11 * force.x * force.x + 2.0 * q12 * force.x * force.y + q22 * force.y * force.y)
            / (size * area)
    } else {
        0.0
    };
    let radius_squared = turning + share * share * (along - turning);
    let omega = moment / radius_squared;
    Vector3::new(w.x + omega * centre.y, w.y - omega * centre.x, omega)
}

/// Square of the mean distance from the centroid over the mean square distance: 8/9 for a disc, 3/4
/// for a thin bar.
const MEAN_DISTANCE: f64 = 0.85;

/// Solves the slip problem for the in-plane load `w`, not zero, from `start` or, without one, from
/// the ellipsoid approximation.
pub fn solve(
    fields: &[Field<'_>],
    w: PlaneWrench,
    start: Option<Twist>,
    refiner: Refiner,
) -> Solution {
    let w = w.into();
    let (start, at_start) = begin(fields, w, start);
    match refiner {
        Refiner::Newton => newton(fields, w, start, at_start),
        Refiner::Shanno => conjugate(fields, w, start, at_start),
    }
}

/// A twist near that of [`solve`], for one evaluation: the start and one Newton step.
pub fn approach(fields: &[Field<'_>], w: PlaneWrench, start: Option<Twist>) -> Twist {
    let w = w.into();
    let (start, at) = begin(fields, w, start);
    let matrix = at.gradient * at.gradient.transpose() + at.value * at.hessian;
    (start - newton_step(matrix, at.value * at.gradient - w)).into()
}

/// The minimum of `D^2/2 - w.v` along the ray of the start, and `D` there.
fn begin(
    fields: &[Field<'_>],
    w: Vector3<f64>,
    start: Option<Twist>,
) -> (Vector3<f64>, Dissipation) {
    let start = start
        .map(Vector3::from)
        .filter(|v| w.dot(v) > 0.0)
        .unwrap_or_else(|| ellipsoid_start(fields, w));
    let start = start / start.norm();
    let first = dissipation(fields, start);
    let scale = w.dot(&start) / (first.value * first.value);
    (
        start * scale,
        Dissipation {
            value: first.value * scale,
            gradient: first.gradient,
            hessian: first.hessian / scale,
        },
    )
}

fn newton(
    fields: &[Field<'_>],
    w: Vector3<f64>,
    mut v: Vector3<f64>,
    mut at: Dissipation,
) -> Solution {
    let scale = w.amax();
    let mut evaluations = 1;
    let mut iterations = 0;
    let mut error = at.value * at.gradient - w;
    let mut before = f64::INFINITY;
    while error.amax() > CONVERGED * scale && iterations < 60 {
        iterations += 1;
        let matrix = at.gradient * at.gradient.transpose() + at.value * at.hessian;
        let step = -newton_step(matrix, error);
        let slope = error.dot(&step);
        let value = at.value * at.value / 2.0 - w.dot(&v);
        let size = error.amax() / scale;
        let promised = size * (size / before).powi(2);
        if size < LAST_STEP && promised < PROMISED {
            // At the minimum the function is -mu^2/2; the step takes it half the slope down.
            let mu = (-2.0 * value - slope).sqrt();
            let twist = (v + step).into();
            return Solution { twist, mu, residual: promised, evaluations, iterations };
        }
        before = size;
        let mut t = 1.0;
        let mut improved = false;
        for _ in 0..40 {
            let tried = v + t * step;
            let next = dissipation(fields, tried);
            evaluations += 1;
            let next_error = next.value * next.gradient - w;
            // Near the minimum the value no longer resolves the step, the gradient does.
            let descends =
                next.value * next.value / 2.0 - w.dot(&tried) <= value + 1e-4 * t * slope;
            if (descends && next.value.is_finite()) || next_error.norm() < 0.5 * error.norm() {
                improved =
                    next_error.norm() < error.norm() || (descends && error.amax() > 1e-9 * scale);
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
    let residual = error.amax() / scale;
    Solution { twist: v.into(), mu: at.value, residual, evaluations, iterations }
}

/// Solves with the (semi-definite) matrix, lifted off singularity where the area is a line or a
/// point.
fn newton_step(matrix: Matrix3<f64>, rhs: Vector3<f64>) -> Vector3<f64> {
    let mut lift = 0.0;
    let trace = matrix.trace();
    for _ in 0..8 {
        if let Some(step) = solve_definite(&matrix, lift * trace, &rhs) {
            return step;
        }
        lift = if lift == 0.0 { 1e-15 } else { lift * 100.0 };
    }
    rhs / trace
}

/// Solves with `matrix + lift I` by `L D L^T`; `None` unless it is positive definite.
fn solve_definite(matrix: &Matrix3<f64>, lift: f64, rhs: &Vector3<f64>) -> Option<Vector3<f64>> {
    let m = |i: usize, j: usize| matrix[(i, j)];
    let d1 = m(0, 0) + lift;
    let (l21, l31) = (m(1, 0) / d1, m(2, 0) / d1);
    let d2 = m(1, 1) + lift - l21 * m(1, 0);
    let l32 = (m(2, 1) - l31 * m(1, 0)) / d2;
    let d3 = m(2, 2) + lift - l31 * m(2, 0) - l32 * l32 * d2;
    if !(d1 > 0.0 && d2 > 0.0 && d3 > 0.0) {
        return None;
    }
    let y1 = rhs.x;
    let y2 = rhs.y - l21 * y1;
    let y3 = rhs.z - l31 * y1 - l32 * y2;
    let x3 = y3 / d3;
    let x2 = y2 / d2 - l32 * x3;
    Some(Vector3::new(y1 / d1 - l21 * x2 - l31 * x3, x2, x3))
}

/// Shanno's method on the same convex function, in variables in which its Hessian at the start is
/// the identity.
fn conjugate(
    fields: &[Field<'_>],
    w: Vector3<f64>,
    start: Vector3<f64>,
    at: Dissipation,
) -> Solution {
    let matrix = at.gradient * at.gradient.transpose() + at.value * at.hessian;
    let back = matrix
        .cholesky()
        .and_then(|factor| factor.l().transpose().try_inverse())
        .unwrap_or_else(Matrix3::identity);
    let scale = w.amax();
    let options = shanno::Options {
        gradient_tolerance: 1e-13 * (back.transpose() * w).norm(),
        max_evaluations: 400,
        ..Default::default()
    };
    let run = shanno::minimise([0.0; 3], &options, |y: &[f64; 3]| {
        let v = start + back * Vector3::from(*y);
        let at = dissipation(fields, v);
        let gradient = back.transpose() * (at.value * at.gradient - w);
        (at.value * at.value / 2.0 - w.dot(&v), gradient.into())
    });
    let twist = start + back * Vector3::from(run.x);
    let end = dissipation(fields, twist);
    let residual = (end.value * end.gradient - w).amax() / scale;
    Solution {
        twist: twist.into(),
        mu: end.value,
        residual,
        evaluations: run.evaluations + 2,
        iterations: run.iterations,
    }
}

/// A wrench that the friction can give with `mu = 1`, and where the pressure acts.
#[derive(Debug, Clone, Copy)]
pub struct Support {
    /// The wrench: the gradient of the dissipation at a twist.
    pub gradient: PlaneWrench,
    /// Normal force of both faces together.
    pub normal: f64,
    /// The point where it acts.
    pub centre: DVec2,
}

/// Moment of a support about the pressure's centre, over the normal force and in lengths of the
/// scaled frame, from which on it serves for the certificate. Below, the slip is nearly a
/// translation and a rotation is evaluated beside it.
const CERTIFYING_MOMENT: f64 = 1e-2;

/// Lower and upper bound on `mu_s` for a pressure, from the twist `v` and the `support` there;
/// `rotation` gives the gradient of the dissipation at another twist.
///
/// Lower: `(w.v)/D(v)`, `D = v . gradient`. Upper: the wrenches that unit friction can give are a
/// convex set, symmetric about zero, and the support is one of them. What `w` has beyond `lower`
/// times the support is next to nothing at a solution; it is made up of two more, that of a
/// translation and the support again or that of a rotation. The sizes of the coefficients add up.
pub fn certificate(
    w: PlaneWrench,
    v: Twist,
    support: &Support,
    rotation: impl FnOnce(Twist) -> PlaneWrench,
) -> Bounds {
    let Support { gradient, normal, centre } = *support;
    let lower = w.power(v) / gradient.power(v);
    let (w, gradient) = (Vector3::from(w), Vector3::from(gradient));
    // The moment about the pressure's centre, which translations leave alone.
    let about = |g: &Vector3<f64>| g.z - centre.perp_dot(DVec2::new(g.x, g.y));
    let turning = if about(&gradient).abs() < CERTIFYING_MOMENT * normal {
        rotation(Twist::about(centre)).into()
    } else {
        gradient
    };
    let left = w - lower * gradient;
    let third = about(&left) / about(&turning);
    let rest = left - third * turning;
    let upper = lower + third.abs() + rest.x.hypot(rest.y) / normal;
    Bounds { lower, upper: if upper >= lower { upper } else { f64::INFINITY } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Polygon;

    fn area() -> Loops {
        let outer = [(-1.0, -0.6), (0.9, -0.8), (0.7, 0.5), (0.1, 0.2), (-0.8, 0.9)]
            .map(|(x, y)| DVec2::new(x, y))
            .to_vec();
        Loops::new(&[Polygon { outer, holes: Vec::new() }])
    }

    fn support(field: &Field<'_>, v: Vector3<f64>) -> Support {
        let m = moments(field.area);
        let normal = field.p[0] * m[0] + field.p[1] * m[1] + field.p[2] * m[2];
        Support {
            gradient: dissipation(&[*field], v).gradient.into(),
            normal,
            centre: first_moment(&m, field.p) / normal,
        }
    }

    /// Loads of all kinds, the last ones near and at a translation.
    fn loads(field: &Field<'_>) -> Vec<Vector3<f64>> {
        let centre = support(field, Vector3::x()).centre;
        let push =
            |lever: f64| Vector3::new(0.6, -0.8, centre.perp_dot(DVec2::new(0.6, -0.8)) + lever);
        let turning = (0..40).map(|i| {
            Vector3::new(
                (0.7 * f64::from(i)).sin(),
                (1.3 * f64::from(i)).cos(),
                (0.4 * f64::from(i)).sin(),
            )
        });
        turning.chain([1e-2, 1e-5, -1e-9, 0.0].map(push)).collect()
    }

    #[test]
    fn the_certificate_holds_at_any_twist_and_is_tight_at_the_solution() {
        let area = area();
        let field = Field { area: &area, p: [1.0, 0.4, -0.3] };
        let rotation = |v| friction_wrench(&[field], v);
        for w in loads(&field) {
            let exact = solve(&[field], w.into(), None, Refiner::Newton);
            let twist = Vector3::from(exact.twist);
            let tight = certificate(w.into(), exact.twist, &support(&field, twist), rotation);
            assert!(
                (tight.lower / exact.mu - 1.0).abs() < 1e-13
                    && (tight.upper / exact.mu - 1.0).abs() < 1e-11,
                "{w:?} {exact:?} {tight:?}"
            );
            for turn in [1e-3, 0.1, 0.5] {
                let v = twist + turn * twist.norm() * Vector3::new(0.5, 0.7, -0.5);
                let Bounds { lower, upper } =
                    certificate(w.into(), v.into(), &support(&field, v), rotation);
                assert!(
                    lower <= exact.mu * (1.0 + 1e-13) && exact.mu <= upper * (1.0 + 1e-13),
                    "{w:?} {turn}: {lower} {} {upper}",
                    exact.mu
                );
            }
        }
    }

    #[test]
    fn the_step_without_an_evaluation_leaves_no_error() {
        let area = area();
        let field = Field { area: &area, p: [1.0, 0.4, -0.3] };
        for w in loads(&field) {
            let found = solve(&[field], w.into(), None, Refiner::Newton);
            let twist = Vector3::from(found.twist);
            let at = dissipation(&[field], twist);
            let residual = (at.value * at.gradient - w).amax() / w.amax();
            assert!(
                residual < 1e-11 && (at.value / found.mu - 1.0).abs() < 1e-11,
                "{w:?} {found:?} {residual:e}"
            );
            // The maximum of (w.v)/D(v) is flat: the value is right to the square of the twist's
            // error.
            assert!((w.dot(&twist) / at.value / found.mu - 1.0).abs() < 1e-14, "{w:?} {found:?}");
        }
    }
}

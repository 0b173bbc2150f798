//! The paper's own method (its section 4): one error figure `E` of equations (17)(18) in six
//! unknowns, brought to zero by Shanno's conjugate directions from several starts, with separation
//! by clipping and solving again (3.6).
//!
//! It is here for comparison and is not the default: `E = 0` does not imply the seven equations.
//! Each term couples two neighbouring equations, `e_i = (g_i h_(i+1) - g_(i+1) h_i)^2`, so where an
//! inner pair `(g_i, h_i)` vanishes the chain is cut, and points that satisfy neither half with the
//! same `mu_s` are zeros too. A load along an axis does that. Every end point is therefore checked
//! against all seven equations, and a false zero is called one.
//!
//! DEVIATION, misprints of the text corrected: `mu` in both friction terms of (6); `h4 = -(S_I +
//! S_II)`; `h5 = C_I + C_II`; `g1 = M1 - int_I p x2 + int_II p x2` with `h1 = -(d/2)(C_I - C_II)`;
//! `g2 = M2 + int_I p x1 - int_II p x1` with `h2 = -(d/2)(S_I - S_II)`. The gradient of `E` is
//! analytic.

use crate::contact::{Field, Loops, friction, moments};
use crate::error::Result;
use crate::model::{Contact, Score, Slip, Status, Wrench};

use crate::mechanics::pads::{Load, Pads};
use crate::mechanics::pressure::{face_pressure, separates};
use crate::mechanics::shanno::{self, StopReason};

/// The six unknowns: `c1, c2` in pad lengths, then `a_I0, a_II0, a1, a2` in gripping force per pad
/// area (and length).
pub type Unknowns = [f64; 6];

/// Settings of the method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The `k_i` of (18), for the error terms in scaled units (lengths over the pads' length,
    /// forces over `Fn`).
    pub weights: [f64; 6],
    /// Number of starts: the middle of the pads, then points on a circle of one pad length about
    /// it.
    pub starts: usize,
    /// Evaluations of `E` with its gradient allowed to each start.
    pub max_evaluations: u32,
    /// Run every start even when an earlier one has passed the check.
    pub all_starts: bool,
}

impl Default for Options {
    /// Unit weights, which the paper found satisfactory; six starts.
    fn default() -> Self {
        Self { weights: [1.0; 6], starts: 6, max_evaluations: 4000, all_starts: false }
    }
}

/// `E` below this counts as zero. In scaled units: each weighted term is then below 1e-5 of the
/// gripping force.
pub const ZERO: f64 = 1e-10;
/// Residual of the seven equations (forces over `Fn`, moments over `Fn` times the pads' length)
/// that passes the check.
pub const CHECK: f64 = 1e-6;
/// Slip centres farther out than this many pad lengths are taken to be on their way to infinity
/// (paper, section 4).
const RUNS_AWAY: f64 = 1e3;
/// A minimisation that stalls (no lower point, or no evaluations left) with the slip centre beyond
/// this is tried there too.
const STALLED_OUT: f64 = 30.0;
/// Where such a slip centre is fixed. The moment left over falls with this distance, the rounding
/// of `E` grows with it.
const FIXED_AT: f64 = 1e8;
/// Rounds of clipping and solving again. Most loads take 4 to 8.
const ROUNDS: u32 = 60;

/// How a start ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All seven equations hold to [`CHECK`].
    Solved,
    /// `E` is zero to [`ZERO`] and the seven equations do not hold.
    FalseZero,
    /// `E` did not become zero.
    NotZero,
    /// Clipping left nothing of an area.
    LostContact,
}

/// One start of the method and where it ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// End point, scaled.
    pub x: Unknowns,
    /// Friction coefficient by (12), the one quotient whose denominator never vanishes; negative
    /// for the other sense.
    pub mu: f64,
    /// `E` at the end.
    pub error: f64,
    /// Largest residual of the seven equations, scaled.
    pub residual: f64,
    /// What the two say.
    pub outcome: Outcome,
    /// Evaluations of `E` with its gradient.
    pub evaluations: u32,
    /// Directions searched.
    pub iterations: u32,
    /// Rounds of clipping and solving.
    pub rounds: u32,
    /// Whether the slip centre was fixed far away.
    pub far: bool,
    /// Why the last minimisation stopped.
    pub stop: StopReason,
}

/// What the method gives for one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// The starts that were run, in order.
    pub runs: Vec<Run>,
    /// The answer that the paper's rule takes, which does not look further than `E = 0`: index of
    /// the first such run.
    pub published: Option<usize>,
    /// The answer after the check: index of the first run that solves the equations.
    pub checked: Option<usize>,
    /// The checked answer, or the run of the smallest residual with [`Status::NotConverged`].
    pub score: Score,
}

/// The paper's method on one case; arguments as [`crate::mechanics::solve`].
///
/// # Errors
/// As [`crate::mechanics::solve`]: numbers that are not finite, a force that is not positive.
pub fn solve(
    contact: &Contact,
    distance: f64,
    force: f64,
    wrench: &Wrench,
    options: &Options,
) -> Result<Report> {
    crate::mechanics::check(contact, distance, force, wrench)?;
    let refused = |status| Report {
        runs: vec![],
        published: None,
        checked: None,
        score: crate::mechanics::refused(status, 0),
    };
    let Some(pads) = Pads::new(contact) else { return Ok(refused(Status::NoContact)) };
    let load = pads.load(distance, force, wrench);
    if load.normal.iter().any(|&n| n <= 0.0) {
        return Ok(refused(Status::NoNormalForce));
    }
    let mut runs: Vec<Run> = Vec::new();
    for k in 0..options.starts {
        runs.push(run(&pads, &load, start(&pads, &load, k, options.starts), options));
        if !options.all_starts && runs[k].outcome == Outcome::Solved {
            break;
        }
    }
    let published = runs.iter().position(|run| run.error <= ZERO);
    let checked = runs.iter().position(|run| run.outcome == Outcome::Solved);
    let best = checked
        .or_else(|| (0..runs.len()).min_by(|&a, &b| runs[a].residual.total_cmp(&runs[b].residual)));
    let evaluations = runs.iter().map(|run| run.evaluations).sum();
    let score = match best {
        Some(k) => score(&pads, force, &load, &runs[k], evaluations),
        None => crate::mechanics::refused(Status::NotConverged, 0),
    };
    Ok(Report { runs, published, checked, score })
}

/// The `k`-th start: uniform pressure, slip centre in the middle of the pads or on a circle about
/// it.
fn start(pads: &Pads, load: &Load, k: usize, starts: usize) -> Unknowns {
    let mut x = [
        0.0,
        0.0,
        load.normal[0] / pads.moments[0][0],
        load.normal[1] / pads.moments[1][0],
        0.0,
        0.0,
    ];
    if k > 0 {
        // Half a step off the axes, where symmetric pads have stationary points of E.
        let (s, c) = (std::f64::consts::TAU * (k as f64 - 0.5) / (starts - 1) as f64).sin_cos();
        (x[0], x[1]) = (c, s);
    }
    x
}

/// One start: minimise, clip, minimise again, until the contact stays what it is.
fn run(pads: &Pads, load: &Load, start: Unknowns, options: &Options) -> Run {
    let mut areas = pads.areas.clone();
    let mut run = Run {
        x: start,
        mu: 0.0,
        error: f64::INFINITY,
        residual: f64::INFINITY,
        outcome: Outcome::NotZero,
        evaluations: 0,
        iterations: 0,
        rounds: 0,
        far: false,
        stop: StopReason::NotFinite,
    };
    loop {
        run.rounds += 1;
        let problem = Problem::new(&areas, load, options.weights);
        stage(&problem, &mut run, options);
        let q = [run.x[2], run.x[3], run.x[4], run.x[5]];
        let mut next = [Loops::default(), Loops::default()];
        for k in 0..2 {
            pads.areas[k].clip_into(face_pressure(&q, k), &mut next[k]);
        }
        let settled = (0..2).all(|k| agrees(&areas[k], &next[k]));
        if next.iter().any(|area| moments(area)[0] <= 0.0) {
            run.outcome = Outcome::LostContact;
            return run;
        }
        areas = next;
        if settled || run.rounds >= ROUNDS || run.evaluations >= options.max_evaluations {
            break;
        }
    }
    let terms = Problem::new(&areas, load, options.weights).terms(&run.x);
    run.mu = terms.g[2] / terms.h[2];
    run.residual = terms.residual(&run.x, load, run.mu);
    run.outcome = match (run.residual <= CHECK, run.error <= ZERO) {
        (true, _) => Outcome::Solved,
        (false, true) => Outcome::FalseZero,
        (false, false) => Outcome::NotZero,
    };
    run
}

/// Whether two stages of clipping give the same contact, to rounding.
fn agrees(a: &Loops, b: &Loops) -> bool {
    let (a, b) = (moments(a), moments(b));
    a.iter().zip(&b).all(|(x, y)| (x - y).abs() <= 1e-13 * a[0].max(b[0]))
}

/// One minimisation of `E` on fixed areas from `run.x`, by the rule for slip centres that run away.
fn stage(problem: &Problem<'_>, run: &mut Run, options: &Options) {
    let settings = |used: u32| shanno::Options {
        gradient_tolerance: 1e-16,
        value_target: 1e-30,
        max_evaluations: options.max_evaluations.saturating_sub(used).max(1),
    };
    let force = problem.force[0].hypot(problem.force[1]);
    let mut out = run.far;
    if !run.far {
        let away = |x: &Unknowns| force > 0.0 && x[0].hypot(x[1]) > RUNS_AWAY;
        let found =
            shanno::minimise_until(run.x, &settings(run.evaluations), |x| problem.error(x), away);
        run.evaluations += found.evaluations;
        run.iterations += found.iterations;
        (run.x, run.error, run.stop) = (found.x, found.value, found.reason);
        run.far = found.reason == StopReason::Caller;
        let stalled = matches!(found.reason, StopReason::LineSearch | StopReason::EvaluationLimit);
        out = run.far || (stalled && force > 0.0 && found.x[0].hypot(found.x[1]) > STALLED_OUT);
    }
    if out {
        // Perpendicular to the force, on the side where the rotation of the paper's sense carries
        // the body along it.
        let fixed = [-problem.force[1] / force * FIXED_AT, problem.force[0] / force * FIXED_AT];
        let whole = |y: &[f64; 4]| [fixed[0], fixed[1], y[0], y[1], y[2], y[3]];
        let from = [run.x[2], run.x[3], run.x[4], run.x[5]];
        let found = shanno::minimise(from, &settings(run.evaluations), |y| {
            let (value, gradient) = problem.error(&whole(y));
            (value, [gradient[2], gradient[3], gradient[4], gradient[5]])
        });
        run.evaluations += found.evaluations;
        run.iterations += found.iterations;
        if run.far || found.value < run.error {
            (run.x, run.error, run.stop, run.far) =
                (whole(&found.x), found.value, found.reason, true);
        }
    }
}

/// `E` on given areas.
struct Problem<'a> {
    areas: &'a [Loops; 2],
    moments: [[f64; 6]; 2],
    force: [f64; 3],
    moment: [f64; 3],
    half_distance: f64,
    weights: [f64; 6],
}

/// `g_1 ... g_7` and `h_1 ... h_7` of (10)-(16) with their derivatives in the six unknowns.
struct Terms {
    g: [f64; 7],
    h: [f64; 7],
    dg: [[f64; 6]; 7],
    dh: [[f64; 6]; 7],
}

impl<'a> Problem<'a> {
    fn new(areas: &'a [Loops; 2], load: &Load, weights: [f64; 6]) -> Self {
        let in_plane = load.in_plane();
        Self {
            areas,
            moments: areas.each_ref().map(moments),
            force: [in_plane.f1, in_plane.f2, load.normal[0] - load.normal[1]],
            moment: [load.moment[0], load.moment[1], in_plane.m3],
            half_distance: load.half_distance,
            weights,
        }
    }

    fn terms(&self, x: &Unknowns) -> Terms {
        let [c1, c2, ..] = *x;
        let q = [x[2], x[3], x[4], x[5]];
        let [f1, f2, f3] = self.force;
        let mut t = Terms { g: [0.0; 7], h: [0.0; 7], dg: [[0.0; 6]; 7], dh: [[0.0; 6]; 7] };
        (t.g[0], t.g[1]) = (self.moment[0], self.moment[1]);
        t.g[2] = self.moment[2] + f1 * c2 - f2 * c1;
        (t.dg[2][0], t.dg[2][1]) = (-f2, f1);
        (t.g[3], t.g[4], t.g[5], t.g[6]) = (f1, f2, f3, 2.0);
        for k in 0..2 {
            let sign = if k == 0 { 1.0 } else { -1.0 };
            let p = face_pressure(&q, k);
            // Integrals of the unit slip velocity (-sin, cos) and of its moment about the origin.
            let integrals = friction(Field { area: &self.areas[k], p }, [c2, -c1, 1.0].into());
            let along = integrals.gradient(p);
            // Values and derivatives of C = int p cos, S = int p sin, R = int p r.
            let (c, s) = (along[1], -along[0]);
            let r = along[2] - c1 * c - c2 * s;
            let mut dc = [0.0; 6];
            let mut ds = [0.0; 6];
            let mut dr = [0.0; 6];
            let hessian = integrals.hessian;
            (dc[0], dc[1]) = (-hessian[1][1], hessian[1][0]);
            (ds[0], ds[1]) = (hessian[0][1], -hessian[0][0]);
            (dr[0], dr[1]) = (-c, -s);
            for (column, by, m) in [(2 + k, 1.0, 0), (4, sign, 1), (5, sign, 2)] {
                let [gx, gy, gz] = integrals.g[m];
                dc[column] = by * gy;
                ds[column] = -by * gx;
                dr[column] = by * (gz - c1 * gy + c2 * gx);
            }
            let half = sign * self.half_distance;
            t.h[0] -= half * c;
            t.h[1] -= half * s;
            t.h[2] += r;
            t.h[3] -= s;
            t.h[4] += c;
            for i in 0..6 {
                t.dh[0][i] -= half * dc[i];
                t.dh[1][i] -= half * ds[i];
                t.dh[2][i] += dr[i];
                t.dh[3][i] -= ds[i];
                t.dh[4][i] += dc[i];
            }
            // Normal force and its moments.
            let m = &self.moments[k];
            t.h[5] += sign * (p[0] * m[0] + p[1] * m[1] + p[2] * m[2]);
            t.h[6] += p[0] * m[0] + p[1] * m[1] + p[2] * m[2];
            t.g[0] -= sign * (p[0] * m[2] + p[1] * m[4] + p[2] * m[5]);
            t.g[1] += sign * (p[0] * m[1] + p[1] * m[3] + p[2] * m[4]);
            for (column, by, n, x1, x2) in [
                (2 + k, 1.0, m[0], m[1], m[2]),
                (4, sign, m[1], m[3], m[4]),
                (5, sign, m[2], m[4], m[5]),
            ] {
                t.dh[5][column] += sign * by * n;
                t.dh[6][column] += by * n;
                t.dg[0][column] -= sign * by * x2;
                t.dg[1][column] += sign * by * x1;
            }
        }
        t
    }

    /// `E` of (18) and its gradient.
    fn error(&self, x: &Unknowns) -> (f64, Unknowns) {
        let t = self.terms(x);
        let mut value = 0.0;
        let mut gradient = [0.0; 6];
        let mut add = |weight: f64, e: f64, de: &dyn Fn(usize) -> f64| {
            value += weight * e * e;
            for (i, slope) in gradient.iter_mut().enumerate() {
                *slope += 2.0 * weight * e * de(i);
            }
        };
        for i in 0..4 {
            let e = t.g[i] * t.h[i + 1] - t.g[i + 1] * t.h[i];
            add(self.weights[i], e, &|j| {
                t.dg[i][j] * t.h[i + 1] + t.g[i] * t.dh[i + 1][j]
                    - t.dg[i + 1][j] * t.h[i]
                    - t.g[i + 1] * t.dh[i][j]
            });
        }
        for i in 4..6 {
            add(self.weights[i], t.g[i + 1] - t.h[i + 1], &|j| t.dg[i + 1][j] - t.dh[i + 1][j]);
        }
        (value, gradient)
    }
}

impl Terms {
    /// Largest residual of (3)-(9) with this `mu`, the moment (5) taken about the origin.
    fn residual(&self, x: &Unknowns, load: &Load, mu: f64) -> f64 {
        let off = |i: usize| self.g[i] - mu * self.h[i];
        let (r3, r4) = (off(3), off(4));
        // About the slip centre (5) grows with its distance; the forces' share of it is taken out
        // again.
        let about_origin = off(2) - r3 * x[1] + r4 * x[0];
        let normal = [
            0.5 * (self.h[6] + self.h[5]) - load.normal[0],
            0.5 * (self.h[6] - self.h[5]) - load.normal[1],
        ];
        let all = [off(0), off(1), about_origin, r3, r4, normal[0], normal[1]];
        all.into_iter()
            .fold(0.0, |most: f64, r| if r.is_nan() { f64::INFINITY } else { most.max(r.abs()) })
    }
}

/// Largest residual of the seven equations at a scaled state on the whole areas, with `mu` of
/// either sign.
pub(super) fn residual(pads: &Pads, load: &Load, x: &Unknowns, mu: f64) -> f64 {
    Problem::new(&pads.areas, load, [1.0; 6]).terms(x).residual(x, load, mu)
}

fn score(pads: &Pads, force: f64, load: &Load, run: &Run, evaluations: u32) -> Score {
    let q = [run.x[2], run.x[3], run.x[4], run.x[5]];
    let area = |k: usize| {
        let p = face_pressure(&q, k);
        if !separates(&pads.areas[k], p) {
            return pads.moments[k][0];
        }
        let mut clipped = Loops::default();
        pads.areas[k].clip_into(p, &mut clipped);
        moments(&clipped)[0]
    };
    let sense = if run.mu < 0.0 { -1.0 } else { 1.0 };
    let slip = if load.size == 0.0 {
        Slip::None
    } else if run.far {
        Slip::Translation {
            direction: (sense * glam::DVec2::new(load.direction.f1, load.direction.f2))
                .normalize_or_zero()
                .to_array(),
        }
    } else {
        pads.slip((sense * nalgebra::Vector3::new(run.x[1], -run.x[0], 1.0)).into())
    };
    let unit = pads.length * pads.length;
    Score {
        status: if run.outcome == Outcome::Solved { Status::Ok } else { Status::NotConverged },
        mu_s: run.mu.is_finite().then_some(run.mu.abs()),
        slip: Some(slip),
        pressure: Some(pads.pressure(q, force)),
        contact_area_i: area(0) * unit,
        contact_area_ii: area(1) * unit,
        residual: run.residual,
        bounds: None,
        evaluations,
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::model::Polygon;

    fn square(side: f64) -> Contact {
        let h = side / 2.0;
        let face = vec![Polygon {
            outer: vec![DVec2::new(-h, -h), DVec2::new(h, -h), DVec2::new(h, h), DVec2::new(-h, h)],
            holes: vec![],
        }];
        Contact { face_i: face.clone(), face_ii: face }
    }

    fn wrench(f: [f64; 3], m: [f64; 3]) -> Wrench {
        Wrench { force: DVec3::from_array(f), moment: DVec3::from_array(m) }
    }

    #[test]
    fn the_gradient_of_the_error_figure_is_its_derivative() {
        let mut contact = square(1.0);
        contact.face_ii[0].outer[0] = DVec2::new(-0.7, -0.6);
        let pads = Pads::new(&contact).unwrap();
        let load = pads.load(0.8, 10.0, &wrench([1.0, -2.0, 3.0], [0.4, -0.6, 0.9]));
        let problem = Problem::new(&pads.areas, &load, [1.0, 0.5, 2.0, 1.5, 0.7, 1.1]);
        for x in [[0.1, -0.2, 1.1, 0.9, 0.2, -0.1], [3.0, 8.0, 0.7, 1.3, -0.4, 0.3]] {
            let (_, gradient) = problem.error(&x);
            for i in 0..6 {
                let at = |step: f64| {
                    let mut moved = x;
                    moved[i] += step;
                    problem.error(&moved).0
                };
                let step = 1e-4;
                let want = (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step)))
                    / (12.0 * step);
                assert!(
                    (gradient[i] - want).abs() < 1e-8 * (1.0 + want.abs()),
                    "{i}: {} {want}",
                    gradient[i]
                );
            }
        }
    }

    #[test]
    fn solves_a_load_off_the_axes() {
        let contact = square(0.02);
        let load = wrench([4.0, 12.0, 0.0], [0.0, 0.0, 0.1]);
        let report = solve(&contact, 0.04, 50.0, &load, &Options::default()).unwrap();
        let want = crate::mechanics::solve(
            &contact,
            0.04,
            50.0,
            &load,
            &crate::mechanics::Options::default(),
        )
        .unwrap();
        assert_eq!(report.score.status, Status::Ok, "{report:?}");
        assert!((report.score.mu_s.unwrap() / want.mu_s.unwrap() - 1.0).abs() < 1e-6, "{report:?}");
    }

    #[test]
    fn calls_a_false_zero_by_its_name() {
        // Gravity along an axis: F1 = 0 and, at any slip centre on the axis, h4 = 0.
        let contact = square(0.02);
        let load = wrench([0.0, -4.905, 0.0], [0.0, 0.0, -0.14715]);
        let options = Options { all_starts: true, ..Options::default() };
        let report = solve(&contact, 0.01, 50.0, &load, &options).unwrap();
        assert!(report.runs.iter().any(|run| run.outcome == Outcome::FalseZero), "{report:?}");
        for run in &report.runs {
            assert_eq!(
                run.outcome == Outcome::Solved,
                (run.mu.abs() - 0.201_192_597_992_577_85).abs() < 1e-5,
                "{run:?}"
            );
        }
    }

    #[test]
    fn a_slip_centre_that_runs_away_is_fixed_far_out() {
        let report = solve(
            &square(0.02),
            0.05,
            50.0,
            &wrench([3.0, -4.0, 0.0], [0.0; 3]),
            &Options::default(),
        )
        .unwrap();
        let Some(Slip::Translation { direction }) = report.score.slip else { panic!("{report:?}") };
        assert!((report.score.mu_s.unwrap() - 0.05).abs() < 1e-7, "{report:?}");
        assert!((direction[0] - 0.6).abs() < 1e-6 && (direction[1] + 0.8).abs() < 1e-6);
    }

    #[test]
    fn refuses_what_the_equations_refuse() {
        let none = solve(
            &square(0.02),
            0.05,
            50.0,
            &wrench([1.0, 0.0, 200.0], [0.0; 3]),
            &Options::default(),
        )
        .unwrap();
        assert_eq!(none.score.status, Status::NoNormalForce);
        let out = solve(
            &square(0.02),
            0.001,
            50.0,
            &wrench([1.0, 2.0, 0.0], [1.5, 0.0, 0.1]),
            &Options::default(),
        )
        .unwrap();
        assert_eq!(out.score.status, Status::NotConverged);
        assert!(
            solve(
                &square(0.02),
                0.05,
                f64::NAN,
                &wrench([1.0, 0.0, 0.0], [0.0; 3]),
                &Options::default()
            )
            .is_err()
        );
    }
}

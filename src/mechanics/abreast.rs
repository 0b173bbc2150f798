//! Bounds on the `mu_s` of several loads on one contact side by side: Newton's steps on the seven
//! equations by the closed forms, with the error bound of [`super::compare`].
//!
//! The equations fall into blocks: the slip's three rows are definite in the twist, the normal
//! forces' rows give the offsets, and two unknowns are left. Where a pressure falls below zero the
//! areas are cut for each load by itself, and what is left is integrated side by side again. Nothing
//! is answered from here: what may be the worst is solved.

mod definite;

use crate::contact::{ABREAST, Abreast, Cuts, Twist, cut_frictions, frictions, widest};

use definite::{Definite, dot};

use super::compare::{CONTRACTION, Question, WITHIN};
use super::equilibrium::{Integrals, Vector7};
use super::pads::{Load, Pads};
use super::pressure::stiffness_rows;

/// What is asked about loads of which only the seeds know something: bounds close enough to leave
/// out most of them.
const CLOSE: Question = Question::of(0.0, 1e-3);
/// Corrections after the first.
const CORRECTIONS: usize = 2;
/// The same beside a state of a load like it.
const CORRECTIONS_BESIDE: usize = 3;
/// The same with steps that are cut, and what is left of one then.
const CORRECTIONS_PATIENT: usize = 7;
const SHORTER: f64 = 0.3;
/// Farthest slip centre, in radii of the scaled pads, at which the closed forms are good enough here.
const FARTHEST: f64 = 30.0;
/// Change of the pressure over the pads' radius, in its mean on what is left of an area, from which on
/// they are not; and the least share of an area that must be left.
const STEEPEST: f64 = 20.0;
const LEAST_LEFT: f64 = 0.01;
/// Share by which bounds are widened for their rounding: that of the closed forms out there.
const ROUNDING: f64 = 1e-9;

const ZERO: Abreast = [0.0; ABREAST];

/// Bounds on the `mu_s` of each load, from a twist near its slip (scaled); `None` where they are not
/// found.
pub(crate) fn bounds(pads: &Pads, loads: &[(Load, Twist)]) -> Vec<Option<[f64; 2]>> {
    let mut found = Vec::with_capacity(loads.len());
    let mut work = Abreasts::default();
    for some in loads.chunks(ABREAST) {
        let (mut all, mut v) = (Loads::default(), [ZERO; 3]);
        for i in 0..ABREAST {
            let (load, twist) = &some[i.min(some.len() - 1)];
            all.put(i, load);
            (v[0][i], v[1][i], v[2][i]) = (twist.u1, twist.u2, twist.omega);
        }
        from_twists(pads, &all, &v, &mut work);
        found.extend((0..some.len()).map(|i| work.bounds(i)));
    }
    found
}

/// Where a load begins: beside the state of another one.
pub(super) struct Beside<'a> {
    pub(super) load: &'a Load,
    pub(super) z: &'a Vector7,
    /// What the equations leave over there, and Newton's first step.
    pub(super) residual: Vector7,
    pub(super) step: Vector7,
}

/// Bounds on the `mu_s` of `count` loads, up to [`ABREAST`], that answer the question, into `work`.
/// `patient`: steps that lead up are cut, and there are more of them.
pub(super) fn beside<'a>(
    pads: &Pads,
    count: usize,
    beside: impl Fn(usize) -> Beside<'a>,
    question: Question,
    patient: bool,
    work: &mut Abreasts,
) {
    let mut loads = Loads::default();
    let mut begin = Begin { v: [ZERO; 3], q: [ZERO; 4], error: ZERO, step: [ZERO; 7] };
    for i in 0..count {
        let one = beside(i);
        loads.put(i, one.load);
        begin.put(i, &one);
    }
    for i in count..ABREAST {
        loads.copy(i);
        begin.copy(i);
    }
    from_states(pads, &loads, &begin, question, patient, work);
}

/// [`Load`]s side by side.
#[derive(Default)]
struct Loads {
    w: [Abreast; 3],
    size: Abreast,
    normal: [Abreast; 2],
    moment: [Abreast; 2],
    half_distance: Abreast,
}

impl Loads {
    fn put(&mut self, i: usize, load: &Load) {
        self.w[0][i] = load.direction.f1;
        self.w[1][i] = load.direction.f2;
        self.w[2][i] = load.direction.m3;
        for k in 0..2 {
            (self.normal[k][i], self.moment[k][i]) = (load.normal[k], load.moment[k]);
        }
        (self.size[i], self.half_distance[i]) = (load.size, load.half_distance);
    }

    /// The first one in another place.
    fn copy(&mut self, i: usize) {
        let [w1, w2, w3] = &mut self.w;
        let ([n1, n2], [m1, m2]) = (&mut self.normal, &mut self.moment);
        for numbers in [w1, w2, w3, n1, n2, m1, m2, &mut self.size, &mut self.half_distance] {
            numbers[i] = numbers[0];
        }
    }
}

/// The seven equations at a state of each load.
#[derive(Default)]
struct Equations {
    /// Twist and pressure.
    v: [Abreast; 3],
    q: [Abreast; 4],
    /// Moments of what is left of the areas.
    moments: [[Abreast; 6]; 2],
    residual: [Abreast; 7],
    /// Sum of the gradients, and face I's less face II's.
    g: [Abreast; 3],
    difference: [Abreast; 3],
    /// Dissipation: `mu` over the load's size.
    d: Abreast,
    /// Hessians likewise.
    sum: [Abreast; 6],
    less: [Abreast; 6],
    /// What each face's gradient changes for a unit of the pressure's weights.
    by_weight: [[[Abreast; 3]; 3]; 2],
    /// Whether the closed forms are good enough.
    good: [bool; ABREAST],
}

/// Where the entry `(i, j)` of a symmetric matrix lies.
const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// What Newton's method begins with.
struct Begin {
    v: [Abreast; 3],
    q: [Abreast; 4],
    /// Length of the residuals.
    error: Abreast,
    step: [Abreast; 7],
}

impl Begin {
    fn put(&mut self, i: usize, beside: &Beside<'_>) {
        for m in 0..3 {
            self.v[m][i] = beside.z[m];
        }
        for m in 0..4 {
            self.q[m][i] = beside.z[3 + m];
        }
        for m in 0..7 {
            self.step[m][i] = beside.step[m];
        }
        self.error[i] = beside.residual.norm();
    }

    fn copy(&mut self, i: usize) {
        for numbers in self.v.iter_mut().chain(&mut self.q).chain(&mut self.step) {
            numbers[i] = numbers[0];
        }
        self.error[i] = self.error[0];
    }
}

/// Bounds side by side, with the states at which they were found.
#[derive(Default)]
pub(super) struct Abreasts {
    /// Larger than `high` where there are none.
    low: Abreast,
    high: Abreast,
    at: Equations,
    cuts: [Cuts; 2],
}

impl Abreasts {
    /// What the `mu_s` of a load lies between.
    pub(super) fn bounds(&self, i: usize) -> Option<[f64; 2]> {
        (self.low[i] <= self.high[i]).then_some([self.low[i], self.high[i]])
    }

    /// The integrals where that was found.
    pub(super) fn integrals(&self, i: usize) -> Integrals {
        self.at.integrals(i)
    }
}

impl Equations {
    /// Puts twists `v` and pressures `q` in.
    #[inline(always)]
    fn put(&mut self, pads: &Pads, loads: &Loads, cuts: &mut [Cuts; 2]) {
        (self.g, self.difference) = ([ZERO; 3], [ZERO; 3]);
        (self.sum, self.less) = ([ZERO; 6], [ZERO; 6]);
        self.good = [true; ABREAST];
        for face in 0..2 {
            self.add_face(pads, face, &mut cuts[face]);
        }
        self.residuals(loads);
    }

    /// The pressure's numbers of a face.
    #[inline(always)]
    fn pressure(&self, face: usize) -> [Abreast; 3] {
        let mut p = [self.q[face], self.q[2], self.q[3]];
        if face == 1 {
            for i in 0..ABREAST {
                (p[1][i], p[2][i]) = (-p[1][i], -p[2][i]);
            }
        }
        p
    }

    #[inline(always)]
    fn add_face(&mut self, pads: &Pads, face: usize, cuts: &mut Cuts) {
        let (area, p) = (&pads.areas[face], self.pressure(face));
        let mut lowest = [f64::INFINITY; ABREAST];
        for x in &pads.hulls[face] {
            for i in 0..ABREAST {
                let here = p[0][i] + p[1][i] * x.x + p[2][i] * x.y;
                lowest[i] = if here < lowest[i] { here } else { lowest[i] };
            }
        }
        let mut whole = true;
        for lowest in lowest {
            whole &= lowest >= 0.0;
        }
        let found = if whole {
            for m in 0..6 {
                self.moments[face][m] = [pads.moments[face][m]; ABREAST];
            }
            frictions(area, &self.v, &p)
        } else {
            cuts.cut(area, &p);
            cut_frictions(cuts, &self.v, &p, &mut self.moments[face])
        };
        let sign = if face == 0 { 1.0 } else { -1.0 };
        let m = &self.moments[face];
        for i in 0..ABREAST {
            for n in 0..3 {
                let (g, p) = (&found.g, &p);
                let gradient = p[0][i] * g[0][n][i] + p[1][i] * g[1][n][i] + p[2][i] * g[2][n][i];
                self.g[n][i] += gradient;
                self.difference[n][i] += sign * gradient;
            }
            for n in 0..6 {
                self.sum[n][i] += found.hessian[n][i];
                self.less[n][i] += sign * found.hessian[n][i];
            }
            // A cut that is thin beside the pressure's slope loses too much.
            let carried = p[0][i] * m[0][i] + p[1][i] * m[1][i] + p[2][i] * m[2][i];
            let slope = (p[1][i] * p[1][i] + p[2][i] * p[2][i]).sqrt() * area.radius();
            let left = m[0][i] >= LEAST_LEFT * pads.moments[face][0];
            let flat = slope * m[0][i] <= STEEPEST * carried;
            self.good[i] &= (lowest[i] >= 0.0) | (left & flat);
        }
        self.by_weight[face] = found.g;
    }

    #[inline(always)]
    fn stiffness(&self, i: usize) -> [[f64; 4]; 4] {
        let mut moments = [[0.0; 6]; 2];
        for face in 0..2 {
            for m in 0..6 {
                moments[face][m] = self.moments[face][m][i];
            }
        }
        stiffness_rows(&moments)
    }

    #[inline(always)]
    fn residuals(&mut self, loads: &Loads) {
        for i in 0..ABREAST {
            let k = self.stiffness(i);
            let g = [self.g[0][i], self.g[1][i], self.g[2][i]];
            let d = g[0] * self.v[0][i] + g[1] * self.v[1][i] + g[2] * self.v[2][i];
            let q = [self.q[0][i], self.q[1][i], self.q[2][i], self.q[3][i]];
            let carried = |row: usize| {
                k[row][0] * q[0] + k[row][1] * q[1] + k[row][2] * q[2] + k[row][3] * q[3]
            };
            let lever = loads.half_distance[i] * loads.size[i];
            self.d[i] = d;
            for m in 0..3 {
                self.residual[m][i] = loads.w[m][i] - d * g[m];
            }
            self.residual[3][i] = loads.normal[0][i] - carried(0);
            self.residual[4][i] = loads.normal[1][i] - carried(1);
            self.residual[5][i] =
                loads.moment[0][i] + lever * d * self.difference[1][i] - carried(3);
            self.residual[6][i] =
                loads.moment[1][i] - lever * d * self.difference[0][i] + carried(2);
        }
    }

    /// The start scaled to the minimum along its ray.
    #[inline(always)]
    fn scaled(&mut self, loads: &Loads) {
        for i in 0..ABREAST {
            let power = loads.w[0][i] * self.v[0][i]
                + loads.w[1][i] * self.v[1][i]
                + loads.w[2][i] * self.v[2][i];
            let scale = power / (self.d[i] * self.d[i]);
            for m in 0..3 {
                self.v[m][i] *= scale;
            }
            for m in 0..6 {
                self.sum[m][i] /= scale;
                self.less[m][i] /= scale;
            }
        }
        self.residuals(loads);
    }

    /// Newton's step.
    #[inline(always)]
    fn step(&self, loads: &Loads) -> [Abreast; 7] {
        let mut step = [ZERO; 7];
        for i in 0..ABREAST {
            let k = self.stiffness(i);
            let r = |row: usize| self.residual[row][i];
            let (g, d) = ([self.g[0][i], self.g[1][i], self.g[2][i]], self.d[i]);
            // The slip's rows: `a dv = right`, for each unit of what is on the right.
            let a = |m: usize, n: usize| g[m] * g[n] + d * self.sum[AT[m][n]][i];
            let slip = Definite::new([a(0, 0), a(1, 0), a(2, 0), a(1, 1), a(2, 1), a(2, 2)]);
            let lever = loads.half_distance[i] * loads.size[i];
            // The slip's rows by the pressure; those of the moments by twist and pressure.
            let (x, y) = (self.difference[0][i], self.difference[1][i]);
            let (mut c, mut row_v, mut row_q) = ([[0.0; 3]; 4], [[0.0; 3]; 2], [[0.0; 4]; 2]);
            for m in 0..3 {
                row_v[0][m] = lever * (g[m] * y + d * self.less[AT[1][m]][i]);
                row_v[1][m] = -lever * (g[m] * x + d * self.less[AT[0][m]][i]);
            }
            let [one, other] = &self.by_weight;
            for j in 0..4 {
                // Face I's less face II's has the other sign for face II alone; face II's slopes have
                // the other sign themselves.
                let (mut by, mut less) = ([0.0; 3], [0.0; 3]);
                for m in 0..3 {
                    (by[m], less[m]) = match j {
                        0 => (one[0][m][i], one[0][m][i]),
                        1 => (other[0][m][i], -other[0][m][i]),
                        _ => {
                            let (a, b) = (one[j - 1][m][i], other[j - 1][m][i]);
                            (a - b, a + b)
                        }
                    };
                }
                let dd = by[0] * self.v[0][i] + by[1] * self.v[1][i] + by[2] * self.v[2][i];
                for m in 0..3 {
                    c[j][m] = -(dd * g[m] + d * by[m]);
                }
                row_q[0][j] = lever * (dd * y + d * less[1]) - k[3][j];
                row_q[1][j] = -lever * (dd * x + d * less[0]) + k[2][j];
            }
            // Offsets by what the normal forces lack and by the slopes.
            let base = [r(3) / k[0][0], r(4) / k[1][1]];
            let by_slope = [
                [-k[0][2] / k[0][0], -k[0][3] / k[0][0]],
                [-k[1][2] / k[1][1], -k[1][3] / k[1][1]],
            ];
            let mut right = [[0.0; 3]; 3];
            for m in 0..3 {
                right[0][m] = r(m) + c[0][m] * base[0] + c[1][m] * base[1];
                for s in 0..2 {
                    right[1 + s][m] =
                        c[2 + s][m] + c[0][m] * by_slope[0][s] + c[1][m] * by_slope[1][s];
                }
            }
            let known = slip.solve(right[0]);
            let turned = [slip.solve(right[1]), slip.solve(right[2])];
            let entry = |row: usize, s: usize| {
                dot(row_v[row], turned[s])
                    + row_q[row][2 + s]
                    + row_q[row][0] * by_slope[0][s]
                    + row_q[row][1] * by_slope[1][s]
            };
            let right = |row: usize| {
                -r(5 + row)
                    - dot(row_v[row], known)
                    - row_q[row][0] * base[0]
                    - row_q[row][1] * base[1]
            };
            let (m11, m12, m21, m22) = (entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1));
            let (inverse, b1, b2) = (1.0 / (m11 * m22 - m12 * m21), right(0), right(1));
            let tilt = [(b1 * m22 - m12 * b2) * inverse, (m11 * b2 - b1 * m21) * inverse];
            for m in 0..3 {
                step[m][i] = known[m] + turned[0][m] * tilt[0] + turned[1][m] * tilt[1];
            }
            for face in 0..2 {
                step[3 + face][i] =
                    base[face] + by_slope[face][0] * tilt[0] + by_slope[face][1] * tilt[1];
                step[5 + face][i] = tilt[face];
            }
        }
        step
    }

    /// As [`super::compare`] measures what a step can change of the dissipation.
    #[inline(always)]
    fn change(&self, pads: &Pads, step: &[Abreast; 7], radius: f64) -> Abreast {
        let areas = [pads.moments[0][0], pads.moments[1][0]];
        let mut change = ZERO;
        for i in 0..ABREAST {
            let fastest = |x: f64, y: f64, z: f64| (x * x + y * y).sqrt() + z.abs() * radius;
            let speed = fastest(step[0][i], step[1][i], step[2][i]);
            let here = fastest(self.v[0][i], self.v[1][i], self.v[2][i]);
            let tilt = (step[5][i] * step[5][i] + step[6][i] * step[6][i]).sqrt() * radius;
            let pressure =
                areas[0] * (step[3][i].abs() + tilt) + areas[1] * (step[4][i].abs() + tilt);
            let q = [self.q[0][i], self.q[1][i], self.q[2][i], self.q[3][i]];
            let [one, other] = &self.moments;
            let normal = one[0][i] * q[0]
                + other[0][i] * q[1]
                + (one[1][i] - other[1][i]) * q[2]
                + (one[2][i] - other[2][i]) * q[3];
            change[i] = normal * speed + pressure * (here + speed);
        }
        change
    }

    /// Whether both pads are pressed and slip, with the slip centre near enough.
    #[inline(always)]
    fn pressed(&self, radius: f64) -> [bool; ABREAST] {
        let mut pressed = self.good;
        for i in 0..ABREAST {
            let across = self.v[0][i] * self.v[0][i] + self.v[1][i] * self.v[1][i];
            let reach = FARTHEST * radius * self.v[2][i];
            let areas = (self.moments[0][0][i] > 0.0) & (self.moments[1][0][i] > 0.0);
            pressed[i] &= areas & (across <= reach * reach) & (self.d[i] > 0.0);
        }
        pressed
    }

    /// The integrals at one of the states.
    fn integrals(&self, i: usize) -> Integrals {
        let mut at = Integrals::default();
        for m in 0..7 {
            at.z[m] = if m < 3 { self.v[m][i] } else { self.q[m - 3][i] };
        }
        for (face, sign) in [(0, 1.0), (1, -1.0)] {
            for m in 0..3 {
                at.gradients[face][m] = 0.5 * (self.g[m][i] + sign * self.difference[m][i]);
                for n in 0..3 {
                    let (sum, less) = (self.sum[AT[m][n]][i], self.less[AT[m][n]][i]);
                    at.hessians[face][(m, n)] = 0.5 * (sum + sign * less);
                    // Face II's slopes have the other sign.
                    let sign = if m == 0 { 1.0 } else { sign };
                    at.by_pressure[face][m][n] = sign * self.by_weight[face][m][n][i];
                }
            }
            for m in 0..6 {
                at.moments[face][m] = self.moments[face][m][i];
            }
        }
        at
    }
}

/// The pressure without coupling, on the whole areas.
#[inline(always)]
fn without_coupling(pads: &Pads, loads: &Loads) -> [Abreast; 4] {
    let k = stiffness_rows(&pads.moments);
    let (a1, a2) = (k[0][2] / k[0][0], k[0][3] / k[0][0]);
    let (b1, b2) = (k[1][2] / k[1][1], k[1][3] / k[1][1]);
    let s11 = k[2][2] - a1 * k[0][2] - b1 * k[1][2];
    let s12 = k[2][3] - a1 * k[0][3] - b1 * k[1][3];
    let s22 = k[3][3] - a2 * k[0][3] - b2 * k[1][3];
    let inverse = 1.0 / (s11 * s22 - s12 * s12);
    let mut q = [ZERO; 4];
    for i in 0..ABREAST {
        let (n1, n2) = (loads.normal[0][i], loads.normal[1][i]);
        let x1 = -loads.moment[1][i] - a1 * n1 - b1 * n2;
        let x2 = loads.moment[0][i] - a2 * n1 - b2 * n2;
        let (t1, t2) = ((x1 * s22 - s12 * x2) * inverse, (s11 * x2 - x1 * s12) * inverse);
        q[0][i] = n1 / k[0][0] - a1 * t1 - a2 * t2;
        q[1][i] = n2 / k[1][1] - b1 * t1 - b2 * t2;
        (q[2][i], q[3][i]) = (t1, t2);
    }
    q
}

widest! {
    /// Bounds from twists near the loads' slips.
    fn from_twists(pads: &Pads, loads: &Loads, v: &[Abreast; 3], work: &mut Abreasts) -> () = from_twists_of
}

#[inline(always)]
fn from_twists_of(pads: &Pads, loads: &Loads, v: &[Abreast; 3], work: &mut Abreasts) {
    let at = &mut work.at;
    (at.v, at.q) = (*v, without_coupling(pads, loads));
    at.put(pads, loads, &mut work.cuts);
    at.scaled(loads);
    let (step, error) = (at.step(loads), lengths(&at.residual));
    let begin = Begin { v: at.v, q: at.q, error, step };
    newton(pads, loads, &begin, CLOSE, (CORRECTIONS, false), work);
}

widest! {
    /// Bounds from states of loads like them.
    fn from_states(pads: &Pads, loads: &Loads, begin: &Begin, question: Question, patient: bool, work: &mut Abreasts) -> () = from_states_of
}

#[inline(always)]
fn from_states_of(
    pads: &Pads,
    loads: &Loads,
    begin: &Begin,
    question: Question,
    patient: bool,
    work: &mut Abreasts,
) {
    let corrections = if patient { CORRECTIONS_PATIENT } else { CORRECTIONS_BESIDE };
    newton(pads, loads, begin, question, (corrections, patient), work);
}

/// Newton's steps until each load's bounds answer the question, or no more are worth it; `cut`: those
/// that lead up are cut.
#[inline(always)]
fn newton(
    pads: &Pads,
    loads: &Loads,
    begin: &Begin,
    Question { value, sharp, coupling }: Question,
    (corrections, cut): (usize, bool),
    work: &mut Abreasts,
) {
    let reach = |k: usize| pads.areas[k].middle().length() + pads.areas[k].radius();
    let radius = reach(0).max(reach(1));
    let (mut v, mut q, mut step, mut error) = (begin.v, begin.q, begin.step, begin.error);
    let (mut known, mut done) = ([true; ABREAST], [false; ABREAST]);
    (work.low, work.high) = ([f64::INFINITY; ABREAST], ZERO);
    let at = &mut work.at;
    for _ in 0..corrections {
        for i in 0..ABREAST {
            for m in 0..3 {
                at.v[m][i] = v[m][i] + step[m][i];
            }
            for m in 0..4 {
                at.q[m][i] = q[m][i] + step[3 + m][i];
            }
        }
        at.put(pads, loads, &mut work.cuts);
        let correction = at.step(loads);
        let before = at.change(pads, &step, radius);
        let after = at.change(pads, &correction, radius);
        let pressed = at.pressed(radius);
        let left = lengths(&at.residual);
        let mut open = false;
        for i in 0..ABREAST {
            let falls = pressed[i] & (left[i] <= 0.9 * error[i]);
            known[i] &= done[i] | falls | cut;
            let contracts = falls & (after[i] <= CONTRACTION * before[i]);
            let least = (at.d[i] - WITHIN * after[i]) * loads.size[i] * (1.0 - ROUNDING);
            let most = (at.d[i] + WITHIN * after[i]) * loads.size[i] * (1.0 + ROUNDING);
            let weak = most * 2.0 * loads.half_distance[i].abs() <= coupling;
            let good = known[i] & contracts & weak;
            if !done[i] {
                work.low[i] = if good { least } else { f64::INFINITY };
                work.high[i] = if good { most } else { 0.0 };
                done[i] = good & ((most < value) | (most - least <= sharp * most));
                open |= known[i] & !done[i];
            }
            // What is done stays where it is.
            let (here, share) = if done[i] {
                (1.0, 0.0)
            } else if falls {
                (1.0, 1.0)
            } else {
                (0.0, 0.0)
            };
            for m in 0..3 {
                v[m][i] += here * step[m][i];
            }
            for m in 0..4 {
                q[m][i] += here * step[3 + m][i];
            }
            for m in 0..7 {
                step[m][i] = share * correction[m][i] + (1.0 - here) * SHORTER * step[m][i];
            }
            error[i] = if falls { left[i] } else { error[i] };
        }
        if !open {
            break;
        }
    }
}

#[inline(always)]
fn lengths(residual: &[Abreast; 7]) -> Abreast {
    let mut squares = ZERO;
    for r in residual {
        for i in 0..ABREAST {
            squares[i] += r[i] * r[i];
        }
    }
    for square in &mut squares {
        *square = square.sqrt();
    }
    squares
}

#[cfg(test)]
mod tests;

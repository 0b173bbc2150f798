//! Bounds on the `mu_s` of several loads side by side, where both pads stay wholly pressed: Newton's
//! steps on the seven equations by the closed forms, with the error bound of [`super::compare`].
//!
//! Without cutting, the integrals of all loads run over the same edges, and the equations fall into
//! blocks: the slip's three rows are definite in the twist, the normal forces' rows give the offsets,
//! and two unknowns are left. Nothing is answered from here: what may be the worst is solved.

use crate::contact::{ABREAST, Abreast, Frictions, Twist, frictions, widest};

use super::branch::COUPLING_SEARCH;
use super::compare::{CONTRACTION, WITHIN};
use super::pads::{Load, Pads};
use super::pressure::stiffness_rows;

/// Share apart at which bounds are close enough to leave out most loads.
const CLOSE: f64 = 1e-3;
/// Corrections after the first.
const CORRECTIONS: usize = 2;
/// Farthest slip centre, in radii of the scaled pads, at which the closed forms are good enough here.
const FARTHEST: f64 = 30.0;
/// Share by which bounds are widened for their rounding: that of the closed forms out there.
const ROUNDING: f64 = 1e-9;

const ZERO: Abreast = [0.0; ABREAST];

/// Bounds on the `mu_s` of each load, from a twist near its slip (scaled); `None` where they are not
/// found, or a pad may lift.
pub(crate) fn bounds(pads: &Pads, loads: &[(Load, Twist)]) -> Vec<Option<[f64; 2]>> {
    let known = |[least, most]: [f64; 2]| (least <= most).then_some([least, most]);
    let of = |loads: &[(Load, Twist)]| {
        let found = some_bounds(pads, &Loads::new(loads));
        (0..loads.len()).map(move |i| known([found[0][i], found[1][i]])).collect::<Vec<_>>()
    };
    loads.chunks(ABREAST).flat_map(of).collect()
}

/// [`Load`]s side by side with their first twists; unused places hold the first load.
struct Loads {
    w: [Abreast; 3],
    size: Abreast,
    normal: [Abreast; 2],
    moment: [Abreast; 2],
    half_distance: Abreast,
    start: [Abreast; 3],
}

impl Loads {
    fn new(loads: &[(Load, Twist)]) -> Self {
        let mut all = Self {
            w: [ZERO; 3],
            size: ZERO,
            normal: [ZERO; 2],
            moment: [ZERO; 2],
            half_distance: ZERO,
            start: [ZERO; 3],
        };
        for i in 0..ABREAST {
            let Some((load, twist)) = loads.get(i).or_else(|| loads.first()) else { break };
            let w = [load.direction.f1, load.direction.f2, load.direction.m3];
            let v = twist.to_array();
            for m in 0..3 {
                (all.w[m][i], all.start[m][i]) = (w[m], v[m]);
            }
            for k in 0..2 {
                (all.normal[k][i], all.moment[k][i]) = (load.normal[k], load.moment[k]);
            }
            (all.size[i], all.half_distance[i]) = (load.size, load.half_distance);
        }
        all
    }
}

/// The seven equations at a state of each load.
struct Equations {
    /// Twist and pressure.
    v: [Abreast; 3],
    q: [Abreast; 4],
    residual: [Abreast; 7],
    /// Sum of the gradients, and face I's less face II's.
    g: [Abreast; 3],
    difference: [Abreast; 3],
    /// Dissipation: `mu` over the load's size.
    d: Abreast,
    /// Hessians likewise.
    sum: [Abreast; 6],
    less: [Abreast; 6],
    /// What the gradients change for a unit of each of the pressure's numbers: sum and difference.
    by_pressure: [[[Abreast; 3]; 4]; 2],
}

/// Where the entry `(i, j)` of a symmetric matrix lies.
const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

impl Equations {
    #[inline(always)]
    fn at(pads: &Pads, loads: &Loads, v: [Abreast; 3], q: [Abreast; 4]) -> Self {
        let mut minus = [ZERO; 2];
        for i in 0..ABREAST {
            (minus[0][i], minus[1][i]) = (-q[2][i], -q[3][i]);
        }
        let pressures = [[q[0], q[2], q[3]], [q[1], minus[0], minus[1]]];
        let one = frictions(&pads.areas[0], &v, &pressures[0]);
        let other = frictions(&pads.areas[1], &v, &pressures[1]);
        let mut at = Self {
            v,
            q,
            residual: [ZERO; 7],
            g: [ZERO; 3],
            difference: [ZERO; 3],
            d: ZERO,
            sum: [ZERO; 6],
            less: [ZERO; 6],
            by_pressure: [[[ZERO; 3]; 4]; 2],
        };
        at.gradients([&one, &other], &pressures);
        at.residuals(pads, loads);
        at
    }

    #[inline(always)]
    fn gradients(&mut self, faces: [&Frictions; 2], pressures: &[[Abreast; 3]; 2]) {
        let [one, other] = faces;
        for i in 0..ABREAST {
            for m in 0..3 {
                let (mut a, mut b) = (0.0, 0.0);
                for k in 0..3 {
                    a += pressures[0][k][i] * one.g[k][m][i];
                    b += pressures[1][k][i] * other.g[k][m][i];
                }
                self.g[m][i] = a + b;
                self.difference[m][i] = a - b;
                let [sum, less] = &mut self.by_pressure;
                (sum[0][m][i], less[0][m][i]) = (one.g[0][m][i], one.g[0][m][i]);
                (sum[1][m][i], less[1][m][i]) = (other.g[0][m][i], -other.g[0][m][i]);
                for k in 1..3 {
                    // Face II's slopes have the other sign.
                    sum[1 + k][m][i] = one.g[k][m][i] - other.g[k][m][i];
                    less[1 + k][m][i] = one.g[k][m][i] + other.g[k][m][i];
                }
            }
            for m in 0..6 {
                self.sum[m][i] = one.hessian[m][i] + other.hessian[m][i];
                self.less[m][i] = one.hessian[m][i] - other.hessian[m][i];
            }
        }
    }

    #[inline(always)]
    fn residuals(&mut self, pads: &Pads, loads: &Loads) {
        let k = stiffness_rows(&pads.moments);
        for i in 0..ABREAST {
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
    fn scaled(&mut self, pads: &Pads, loads: &Loads) {
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
        self.residuals(pads, loads);
    }

    /// Newton's step.
    #[inline(always)]
    fn step(&self, pads: &Pads, loads: &Loads) -> [Abreast; 7] {
        let k = stiffness_rows(&pads.moments);
        let mut step = [ZERO; 7];
        for i in 0..ABREAST {
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
            for j in 0..4 {
                let [sum, less] = &self.by_pressure;
                let by = [sum[j][0][i], sum[j][1][i], sum[j][2][i]];
                let dd = by[0] * self.v[0][i] + by[1] * self.v[1][i] + by[2] * self.v[2][i];
                for m in 0..3 {
                    c[j][m] = -(dd * g[m] + d * by[m]);
                }
                row_q[0][j] = lever * (dd * y + d * less[j][1][i]) - k[3][j];
                row_q[1][j] = -lever * (dd * x + d * less[j][0][i]) + k[2][j];
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
        let k = stiffness_rows(&pads.moments);
        let mut change = ZERO;
        for i in 0..ABREAST {
            let fastest = |x: f64, y: f64, z: f64| (x * x + y * y).sqrt() + z.abs() * radius;
            let speed = fastest(step[0][i], step[1][i], step[2][i]);
            let here = fastest(self.v[0][i], self.v[1][i], self.v[2][i]);
            let tilt = (step[5][i] * step[5][i] + step[6][i] * step[6][i]).sqrt() * radius;
            let pressure =
                k[0][0] * (step[3][i].abs() + tilt) + k[1][1] * (step[4][i].abs() + tilt);
            let q = [self.q[0][i], self.q[1][i], self.q[2][i], self.q[3][i]];
            let normal = k[0][0] * q[0]
                + k[1][1] * q[1]
                + (k[0][2] + k[1][2]) * q[2]
                + (k[0][3] + k[1][3]) * q[3];
            change[i] = normal * speed + pressure * (here + speed);
        }
        change
    }

    /// Whether no pressure falls below zero within [`WITHIN`] times the step, and the slip centre is
    /// near enough.
    #[inline(always)]
    fn pressed(&self, pads: &Pads, step: &[Abreast; 7], radius: f64) -> [bool; ABREAST] {
        let mut pressed = [true; ABREAST];
        for (face, sign) in [(0, 1.0), (1, -1.0)] {
            for x in &pads.hulls[face] {
                let (x, y) = (sign * x.x, sign * x.y);
                for i in 0..ABREAST {
                    let here = self.q[face][i] + self.q[2][i] * x + self.q[3][i] * y;
                    let less = step[3 + face][i] + step[5][i] * x + step[6][i] * y;
                    pressed[i] &= here >= WITHIN * less.abs();
                }
            }
        }
        for i in 0..ABREAST {
            let across = self.v[0][i] * self.v[0][i] + self.v[1][i] * self.v[1][i];
            let reach = FARTHEST * radius * self.v[2][i];
            pressed[i] &= (across <= reach * reach) & (self.d[i] > 0.0);
        }
        pressed
    }
}

/// A definite matrix, taken apart: `L D L^T`.
struct Definite {
    d: [f64; 3],
    l21: f64,
    l31: f64,
    l32: f64,
}

impl Definite {
    /// From its entries 11, 21, 31, 22, 32, 33.
    #[inline(always)]
    fn new([a11, a21, a31, a22, a32, a33]: [f64; 6]) -> Self {
        let (l21, l31) = (a21 / a11, a31 / a11);
        let d2 = a22 - l21 * a21;
        let e32 = a32 - l31 * a21;
        let l32 = e32 / d2;
        Self { d: [a11, d2, a33 - l31 * a31 - l32 * e32], l21, l31, l32 }
    }

    #[inline(always)]
    fn solve(&self, b: [f64; 3]) -> [f64; 3] {
        let y2 = b[1] - self.l21 * b[0];
        let y3 = b[2] - self.l31 * b[0] - self.l32 * y2;
        let x3 = y3 / self.d[2];
        let x2 = y2 / self.d[1] - self.l32 * x3;
        [b[0] / self.d[0] - self.l21 * x2 - self.l31 * x3, x2, x3]
    }
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
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
    /// Bounds of loads side by side; the lower one is larger where there are none.
    fn some_bounds(pads: &Pads, loads: &Loads) -> [Abreast; 2] = some_bounds_of
}

#[inline(always)]
fn some_bounds_of(pads: &Pads, loads: &Loads) -> [Abreast; 2] {
    let reach = |k: usize| pads.areas[k].middle().length() + pads.areas[k].radius();
    let radius = reach(0).max(reach(1));
    let mut at = Equations::at(pads, loads, loads.start, without_coupling(pads, loads));
    at.scaled(pads, loads);
    let mut step = at.step(pads, loads);
    let mut known = [true; ABREAST];
    let (mut low, mut high) = ([f64::INFINITY; ABREAST], [0.0; ABREAST]);
    for _ in 0..CORRECTIONS {
        let (mut v, mut q) = (at.v, at.q);
        for i in 0..ABREAST {
            for m in 0..3 {
                v[m][i] += step[m][i];
            }
            for m in 0..4 {
                q[m][i] += step[3 + m][i];
            }
        }
        let next = Equations::at(pads, loads, v, q);
        let correction = next.step(pads, loads);
        let before = next.change(pads, &step, radius);
        let after = next.change(pads, &correction, radius);
        let pressed = next.pressed(pads, &correction, radius);
        for i in 0..ABREAST {
            let falls = norm(&next.residual, i) <= 0.9 * norm(&at.residual, i);
            known[i] &= pressed[i] & falls;
            let contracts = after[i] <= CONTRACTION * before[i];
            let least = (next.d[i] - WITHIN * after[i]) * loads.size[i] * (1.0 - ROUNDING);
            let most = (next.d[i] + WITHIN * after[i]) * loads.size[i] * (1.0 + ROUNDING);
            let weak = most * 2.0 * loads.half_distance[i].abs() <= COUPLING_SEARCH;
            let good = known[i] & contracts & weak;
            low[i] = if good { least } else { f64::INFINITY };
            high[i] = if good { most } else { 0.0 };
        }
        let close = |i: usize| low[i] <= high[i] && high[i] - low[i] <= CLOSE * high[i];
        if (0..ABREAST).all(|i| close(i) || !known[i]) {
            break;
        }
        (at, step) = (next, correction);
    }
    [low, high]
}

#[inline(always)]
fn norm(residual: &[Abreast; 7], i: usize) -> f64 {
    residual.iter().map(|r| r[i] * r[i]).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::{Options, solve_pads};
    use crate::model::{Contact, Polygon, Slip, Status, Wrench};
    use glam::{DVec2, DVec3};

    fn octagon(turn: f64, size: impl Fn(usize) -> f64) -> Vec<Polygon> {
        let corner =
            |i: usize| size(i) * DVec2::from_angle(turn + std::f64::consts::FRAC_PI_4 * i as f64);
        vec![Polygon { outer: (0..8).map(corner).collect(), holes: Vec::new() }]
    }

    /// The solution of each load lies within its bounds, where it has some, from starts far away.
    #[test]
    fn solutions_lie_within_the_bounds() {
        let contact = Contact {
            face_i: octagon(0.1, |i| 0.01 + 0.001 * (i % 3) as f64),
            face_ii: octagon(0.4, |i| 0.011 - 0.0013 * (i % 2) as f64),
        };
        let (pads, force, distance) = (Pads::new(&contact).unwrap(), 40.0, 0.02);
        let wrench = |i: usize| {
            let t = 0.37 * i as f64;
            Wrench {
                force: 8.0 * DVec3::new(t.cos(), (1.7 * t).sin(), 0.4 * (2.3 * t).sin()),
                moment: DVec3::new(0.02 * t.sin(), 0.02 * (0.6 * t).cos(), 0.08 * (2.0 * t).sin()),
            }
        };
        let mut given = Vec::new();
        let mut exact = Vec::new();
        for i in 0..61 {
            let score = solve_pads(&pads, distance, force, &wrench(i), &Options::default());
            assert_eq!(score.status, Status::Ok);
            // Away from the solution: by the load alone.
            let load = pads.load(distance, force, &wrench(i));
            let w = load.direction;
            given.push((load, Twist { u1: w.f1, u2: w.f2, omega: 3.0 * w.m3 }));
            exact.push((score.mu_s.unwrap(), score.bounds.unwrap()));
        }
        let found = bounds(&pads, &given);
        let mut close = 0;
        for (found, (mu, certain)) in found.iter().zip(&exact) {
            let Some([least, most]) = found else { continue };
            assert!(*least <= certain.upper && certain.lower <= *most, "{found:?} {mu}");
            close += usize::from(most - least <= 0.05 * mu);
        }
        // Newton's method contracts at once from a third of these far starts.
        assert!(close > 20, "{close} of 61 loads have close bounds");
    }
    /// Loads that lift a pad somewhere have no bounds here, however near the start; those that press
    /// both wholly have.
    #[test]
    fn a_load_that_lifts_a_pad_has_no_bounds() {
        let contact = Contact {
            face_i: octagon(0.1, |i| 0.01 + 0.001 * (i % 3) as f64),
            face_ii: octagon(0.4, |i| 0.011 - 0.0013 * (i % 2) as f64),
        };
        let (pads, force, distance) = (Pads::new(&contact).unwrap(), 40.0, 0.02);
        let areas =
            [&contact.face_i, &contact.face_ii].map(|face| crate::geometry::patch_area(face));
        let (mut lifted, mut bounded) = (0, 0);
        for i in 0..80 {
            let t = 0.37 * i as f64;
            let size = 0.01 * (1 + i % 40) as f64;
            let wrench = Wrench {
                force: 4.0 * DVec3::new(t.cos(), (1.7 * t).sin(), 0.0),
                moment: DVec3::new(size * t.sin(), size * t.cos(), 0.05),
            };
            let score = solve_pads(&pads, distance, force, &wrench, &Options::default());
            let Some(Slip::Rotation { c, sense }) = score.slip else { continue };
            let load = pads.load(distance, force, &wrench);
            // At the solution itself.
            let turn = Twist::about((DVec2::from(c) - pads.origin) / pads.length);
            let sense = f64::from(sense);
            let twist = Twist { u1: sense * turn.u1, u2: sense * turn.u2, omega: sense };
            let found = bounds(&pads, &[(load, twist)])[0];
            let left = [score.contact_area_i, score.contact_area_ii];
            if left.iter().zip(areas).any(|(left, whole)| *left < whole * (1.0 - 1e-6)) {
                assert_eq!(found, None, "{left:?} of {areas:?}");
                lifted += 1;
            } else {
                bounded += usize::from(found.is_some());
            }
        }
        assert!(lifted > 20 && bounded > 5, "{lifted} lift, {bounded} have bounds");
    }
}

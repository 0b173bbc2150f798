//! The seven equations (3)-(9) together: pressure and slip coupled by the friction forces' lever
//! `d/2`, with separation.
//!
//! Unknowns, in the pads' scale: the twist `v` (three, its length carries `mu`) and `q = (a_i0,
//! a_ii0, a1, a2)`. Residuals: `w - D grad D` (three), the two normal forces, the two out-of-plane
//! moments. The Jacobian is analytic; a zero-pressure line that moves adds nothing to it because
//! the pressure is zero there.

use glam::{DMat2, DVec2};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::contact::{Field, Loops, Twist, friction, moments};
use crate::request::Refiner;

use super::pads::{Load, Pads};
use super::pressure::{self, face_pressure, separates};
use super::shanno;
use super::slip::{self, Support};

pub(super) type Vector7 = SVector<f64, 7>;
pub(super) type Matrix7 = SMatrix<f64, 7, 7>;

/// A state of the seven unknowns and what the equations say of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct State {
    /// Twist, then pressure coefficients.
    pub z: Vector7,
    /// Residuals of the seven equations, forces in units of `Fn`, moments of `Fn` times the pads'
    /// length; the first three over the load's size.
    pub residual: Vector7,
    /// `mu` over the load's size.
    pub mu_over_size: f64,
    /// Moments of the areas left in contact, scaled: see [`crate::contact::moments`].
    pub moments: [[f64; 6]; 2],
    /// What the friction can do at this twist.
    pub friction: Support,
}

impl State {
    /// Pressure coefficients.
    pub(crate) fn q(&self) -> [f64; 4] {
        [self.z[3], self.z[4], self.z[5], self.z[6]]
    }

    /// Twist.
    pub(crate) fn twist(&self) -> Twist {
        twist_of(&self.z)
    }
}

/// The seven unknowns from their two parts.
pub(super) fn unknowns(v: Twist, q: [f64; 4]) -> Vector7 {
    Vector7::from([v.u1, v.u2, v.omega, q[0], q[1], q[2], q[3]])
}

fn twist_of(z: &Vector7) -> Twist {
    [z[0], z[1], z[2]].into()
}

/// A point of the map of contact moments ([`super::states`]).
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    /// Contact moment.
    pub(super) x: DVec2,
    /// What (6)(7) leave over.
    pub(super) g: DVec2,
    /// Derivative of `g`.
    pub(super) slope: DMat2,
    pub(super) z: Vector7,
}

/// The friction and pressure integrals at a state: what the equations of any load on the contact
/// are made of.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Integrals {
    pub(super) z: Vector7,
    /// Of the dissipation, per face.
    pub(super) gradients: [Vector3<f64>; 2],
    pub(super) hessians: [Matrix3<f64>; 2],
    /// `d gradient_k / d q_j` for `j` = own offset, a1, a2.
    pub(super) by_pressure: [[Vector3<f64>; 3]; 2],
    pub(super) moments: [[f64; 6]; 2],
}

/// Solves one contact pair under one load; keeps its scratch memory and counts its work.
pub(crate) struct Solver<'a> {
    pub(super) pads: &'a Pads,
    pub(super) load: Load,
    pub(super) refiner: Refiner,
    pub(super) scratch: [Loops; 2],
    /// Evaluations of the friction integrals so far.
    pub evaluations: u32,
    /// Newton steps so far.
    pub iterations: u32,
}

/// Residual at which a state counts as a solution, but for rounding.
pub(crate) const TOLERANCE: f64 = 1e-11;

impl<'a> Solver<'a> {
    /// A solver for `load` with a non-zero in-plane part.
    pub(crate) fn new(pads: &'a Pads, load: Load, refiner: Refiner) -> Self {
        Self {
            pads,
            load,
            refiner,
            scratch: [Loops::default(), Loops::default()],
            evaluations: 0,
            iterations: 0,
        }
    }

    /// Residuals and, if wanted, the Jacobian at `z`, the coupling scaled by `coupling` (1: the
    /// real one).
    pub(super) fn evaluate(
        &mut self,
        z: &Vector7,
        coupling: f64,
        jacobian: Option<&mut Matrix7>,
    ) -> State {
        let integrals = self.integrate(z);
        self.equations(&integrals, coupling, jacobian)
    }

    pub(super) fn integrate(&mut self, z: &Vector7) -> Integrals {
        self.evaluations += 1;
        let q = [z[3], z[4], z[5], z[6]];
        let mut at = Integrals { z: *z, ..Integrals::default() };
        for k in 0..2 {
            let p = face_pressure(&q, k);
            let area = if separates(&self.pads.areas[k], p) {
                self.pads.areas[k].clip_into(p, &mut self.scratch[k]);
                at.moments[k] = moments(&self.scratch[k]);
                &self.scratch[k]
            } else {
                at.moments[k] = self.pads.moments[k];
                &self.pads.areas[k]
            };
            let f = friction(Field { area, p }, twist_of(z));
            let sign = if k == 0 { 1.0 } else { -1.0 };
            at.by_pressure[k] =
                [Vector3::from(f.g[0]), sign * Vector3::from(f.g[1]), sign * Vector3::from(f.g[2])];
            at.gradients[k] = Vector3::from(f.gradient(p));
            at.hessians[k] = Matrix3::from_fn(|i, j| f.hessian[i][j]);
        }
        at
    }

    /// [`Solver::evaluate`] from the integrals, which may be those of another load's state.
    pub(super) fn equations(
        &self,
        at: &Integrals,
        coupling: f64,
        jacobian: Option<&mut Matrix7>,
    ) -> State {
        let Integrals { z, gradients, hessians, by_pressure, moments: m } = at;
        let v = Vector3::new(z[0], z[1], z[2]);
        let q = [z[3], z[4], z[5], z[6]];
        let g = gradients[0] + gradients[1];
        let d = g.dot(&v);
        let lever = coupling * self.load.half_distance * self.load.size;
        let k = pressure::stiffness(m);
        let carried = k * nalgebra::Vector4::new(q[0], q[1], q[2], q[3]);
        let difference = gradients[0] - gradients[1];
        let slip = Vector3::from(self.load.direction) - d * g;
        let [m1, m2] = self.load.moment;
        let residual = Vector7::from([
            slip.x,
            slip.y,
            slip.z,
            self.load.normal[0] - carried[0],
            self.load.normal[1] - carried[1],
            m1 + lever * d * difference.y - carried[3],
            m2 - lever * d * difference.x + carried[2],
        ]);
        if let Some(jacobian) = jacobian {
            let h = hessians[0] + hessians[1];
            let dh = hessians[0] - hessians[1];
            let by_v = -(g * g.transpose() + d * h);
            jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&by_v);
            let lever_row = |i: usize, dd: f64, ddifference: f64| {
                lever * (dd * difference[i] + d * ddifference)
            };
            for j in 0..3 {
                jacobian[(3, j)] = 0.0;
                jacobian[(4, j)] = 0.0;
                jacobian[(5, j)] = lever_row(1, g[j], dh[(1, j)]);
                jacobian[(6, j)] = -lever_row(0, g[j], dh[(0, j)]);
            }
            for j in 0..4 {
                let (sum, minus) = match j {
                    0 => (by_pressure[0][0], by_pressure[0][0]),
                    1 => (by_pressure[1][0], -by_pressure[1][0]),
                    _ => (
                        by_pressure[0][j - 1] + by_pressure[1][j - 1],
                        by_pressure[0][j - 1] - by_pressure[1][j - 1],
                    ),
                };
                let dd = sum.dot(&v);
                let column = -(dd * g + d * sum);
                for i in 0..3 {
                    jacobian[(i, 3 + j)] = column[i];
                }
                jacobian[(3, 3 + j)] = -k[(0, j)];
                jacobian[(4, 3 + j)] = -k[(1, j)];
                jacobian[(5, 3 + j)] = lever_row(1, dd, minus.y) - k[(3, j)];
                jacobian[(6, 3 + j)] = -lever_row(0, dd, minus.x) + k[(2, j)];
            }
        }
        let (first_i, first_ii) = (
            pressure::first_moment(&m[0], face_pressure(&q, 0)),
            pressure::first_moment(&m[1], face_pressure(&q, 1)),
        );
        let normal = carried[0] + carried[1];
        let friction =
            Support { gradient: g.into(), normal, centre: (first_i + first_ii) / normal };
        State { z: *z, residual, mu_over_size: d, moments: *m, friction }
    }

    /// Damped semi-smooth Newton from `z`; `None` when it does not come below [`TOLERANCE`] in
    /// `most` steps.
    pub(super) fn newton(&mut self, z: Vector7, coupling: f64, most: u32) -> Option<State> {
        let mut jacobians = [Matrix7::zeros(), Matrix7::zeros()];
        let mut current = 0;
        let mut at = self.evaluate(&z, coupling, Some(&mut jacobians[0]));
        for _ in 0..most {
            let error = at.residual.amax();
            if !error.is_finite() {
                return None;
            }
            if error < ROUNDING {
                break;
            }
            self.iterations += 1;
            let step = -solve_newton(&jacobians[current], &at.residual)?;
            let mut t = 1.0;
            let mut next = None;
            for _ in 0..8 {
                let tried =
                    self.evaluate(&(at.z + t * step), coupling, Some(&mut jacobians[1 - current]));
                let pressed = tried.moments.iter().all(|m| m[0] > 0.0);
                if pressed && tried.residual.norm() <= (1.0 - 0.1 * t) * at.residual.norm() {
                    next = Some(tried);
                    break;
                }
                if error < TOLERANCE {
                    break; // at rounding level: no step improves it
                }
                t *= 0.4;
            }
            let Some(tried) = next else { break };
            (at, current) = (tried, 1 - current);
        }
        (at.residual.amax() < self.tolerance(&at) && at.mu_over_size > 0.0).then_some(at)
    }

    /// [`TOLERANCE`], or what rounding the pressure's coefficients leaves where that is more: on a
    /// contact of relative width `e` the pressure is `e` times as large as the coefficients that it
    /// is the difference of.
    fn tolerance(&self, at: &State) -> f64 {
        let q = at.q();
        let coefficients = |k: usize| q[k].abs() + q[2].hypot(q[3]) * self.pads.areas[k].radius();
        let rounding = (0..2).map(|k| coefficients(k) * at.moments[k][0]).sum::<f64>();
        TOLERANCE.max(
            8.0 * f64::EPSILON
                * rounding
                * (1.0 + self.load.half_distance.abs() * self.load.size * at.mu_over_size),
        )
    }

    /// Shanno's method on half the squared residual, in variables scaled by the Jacobian at the
    /// start of each round.
    pub(super) fn conjugate(&mut self, z: Vector7) -> Option<State> {
        let mut jacobian = Matrix7::zeros();
        let mut at = self.evaluate(&z, 1.0, Some(&mut jacobian));
        for _ in 0..CONJUGATE_ROUNDS {
            if at.residual.amax() < 1e-14 {
                break;
            }
            let back = jacobian.try_inverse()?;
            let (origin, before) = (at.z, at.residual.norm());
            let options = shanno::Options {
                gradient_tolerance: 0.0,
                value_target: 0.5e-28,
                max_evaluations: 60,
            };
            let run = shanno::minimise([0.0; 7], &options, |y: &[f64; 7]| {
                let mut jacobian = Matrix7::zeros();
                let state =
                    self.evaluate(&(origin + back * Vector7::from(*y)), 1.0, Some(&mut jacobian));
                let gradient = (jacobian * back).transpose() * state.residual;
                (0.5 * state.residual.norm_squared(), gradient.into())
            });
            self.iterations += run.iterations;
            at = self.evaluate(&(origin + back * Vector7::from(run.x)), 1.0, Some(&mut jacobian));
            if at.residual.norm() > 0.5 * before {
                break;
            }
        }
        let pressed = at.moments.iter().all(|m| m[0] > 0.0);
        (pressed && at.residual.amax() < self.tolerance(&at) && at.mu_over_size > 0.0).then_some(at)
    }

    /// A state from the contact moment `target` (see [`pressure::reach`]): its pressure, and the
    /// slip under it.
    pub(crate) fn state_at(&mut self, target: DVec2, seed: Option<Twist>) -> Option<Vector7> {
        self.state_from(target, seed, None).or_else(|| {
            let q = pressure::solve_near_rim(
                self.pads,
                self.load.normal,
                target,
                &mut self.scratch[0],
            )?;
            self.state_from(target, seed, Some(q))
        })
    }

    /// As [`Solver::state_at`], from the pressure and slip of the state `near`.
    pub(crate) fn state_near(&mut self, target: DVec2, near: Option<&Vector7>) -> Option<Vector7> {
        self.state_from(target, near.map(twist_of), near.map(|z| [z[3], z[4], z[5], z[6]]))
    }

    fn state_from(
        &mut self,
        target: DVec2,
        seed: Option<Twist>,
        start: Option<[f64; 4]>,
    ) -> Option<Vector7> {
        let q = pressure::solve(self.pads, self.load.normal, target, start, &mut self.scratch[0])?;
        let fields = slip::pressed_fields(self.pads, &q, &mut self.scratch);
        let slip = slip::solve(&fields, self.load.direction, seed, self.refiner);
        self.evaluations += slip.evaluations;
        self.iterations += slip.iterations;
        let v = slip.twist;
        Some(unknowns(v, q))
    }

    /// The point of the map whose pressure and slip are those of `z`; `None` where they do not fit
    /// each other.
    pub(super) fn node(&mut self, z: &Vector7) -> Option<Node> {
        let mut jacobian = Matrix7::zeros();
        let state = self.evaluate(z, 1.0, Some(&mut jacobian));
        if state.residual.fixed_rows::<5>(0).amax() > LOOSE {
            return None;
        }
        let g = DVec2::new(state.residual[6], -state.residual[5]);
        // Moving along the states of given contact moment: the first five equations stay, X moves.
        let stiffness = pressure::stiffness(&state.moments);
        let carried = stiffness * nalgebra::Vector4::from(state.q());
        let mut along = jacobian;
        along.fixed_view_mut::<2, 7>(5, 0).fill(0.0);
        along.fixed_view_mut::<2, 4>(5, 3).copy_from(&stiffness.fixed_view::<2, 4>(2, 0));
        let mut unit = SMatrix::<f64, 7, 2>::zeros();
        unit[(5, 0)] = 1.0;
        unit[(6, 1)] = 1.0;
        let moved = along.lu().solve(&unit)?;
        let change = jacobian.fixed_view::<2, 7>(5, 0) * moved;
        let slope = DMat2::from_cols(
            DVec2::new(change[(1, 0)], -change[(0, 0)]),
            DVec2::new(change[(1, 1)], -change[(0, 1)]),
        );
        (g.is_finite() && slope.is_finite()).then_some(Node {
            x: DVec2::new(carried[2], carried[3]),
            g,
            slope,
            z: *z,
        })
    }
}

/// Residual of the slip's equations up to which a point of the map is drawn; the states themselves
/// are solved in full.
const LOOSE: f64 = 1e-4;
/// Residual at rounding level: no further step is taken.
const ROUNDING: f64 = 1e-14;

/// Solves `jacobian x = rhs`; `None` where it is singular. The rows of the normal forces know the
/// pressure alone and give the offsets from its slopes, so that five unknowns are left for
/// elimination with pivoting.
pub(super) fn solve_newton(jacobian: &Matrix7, rhs: &Vector7) -> Option<Vector7> {
    let j = |row: usize, column: usize| jacobian[(row, column)];
    // offset_k = base_k + slope_k . (a1, a2)
    let offset = [(3, 3), (4, 4)].map(|(row, column)| {
        let inverse = 1.0 / j(row, column);
        [rhs[row] * inverse, -j(row, 5) * inverse, -j(row, 6) * inverse]
    });
    let mut rows: [[f64; 6]; 5] = [0, 1, 2, 5, 6].map(|row| {
        let fill = |k: usize| j(row, 3) * offset[0][k] + j(row, 4) * offset[1][k];
        [
            j(row, 0),
            j(row, 1),
            j(row, 2),
            j(row, 5) + fill(1),
            j(row, 6) + fill(2),
            rhs[row] - fill(0),
        ]
    });
    for step in 0..5 {
        let mut pivot = step;
        for row in step + 1..5 {
            if rows[row][step].abs() >= rows[pivot][step].abs() {
                pivot = row;
            }
        }
        rows.swap(step, pivot);
        let lead = rows[step];
        if lead[step] == 0.0 {
            return None;
        }
        let inverse = 1.0 / lead[step];
        for row in &mut rows[step + 1..] {
            let factor = row[step] * inverse;
            for column in step + 1..6 {
                row[column] -= factor * lead[column];
            }
        }
    }
    let mut x = [0.0; 5];
    for i in (0..5).rev() {
        let known: f64 = (i + 1..5).map(|k| rows[i][k] * x[k]).sum();
        x[i] = (rows[i][5] - known) / rows[i][i];
    }
    let at = |[base, by1, by2]: [f64; 3]| base + by1 * x[3] + by2 * x[4];
    Some(Vector7::from([x[0], x[1], x[2], at(offset[0]), at(offset[1]), x[3], x[4]]))
}

/// Rounds of [`Solver::conjugate`], each with a fresh scaling.
const CONJUGATE_ROUNDS: u32 = 8;

/// Whether two states are the same solution.
pub(crate) fn same(a: &State, b: &State) -> bool {
    let tilt = (a.z.fixed_rows::<4>(3) - b.z.fixed_rows::<4>(3)).norm();
    (a.mu_over_size / b.mu_over_size - 1.0).abs() < 1e-6
        && tilt < 1e-5 * (1.0 + a.z.fixed_rows::<4>(3).norm())
}

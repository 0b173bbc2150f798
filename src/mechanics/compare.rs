//! Whether a load's `mu_s` stays below a value, for less than its solution: from the state of a load
//! like it, no further than an error bound asks for.
//!
//! The integrals at a state serve every load, so Newton's first step from another load's state costs
//! none. Two corrections `s_0`, `s_1` one after the other tell how the Jacobian changes on the way:
//! where `|s_1| <= |s_0| / 4`, Kantorovich's quantity `h` is at most a half as far as the steps show
//! it, and the solution lies within `2 |s_1|` of where `s_1` was found. Sizes are measured by what a
//! correction can change of the dissipation, and so of `mu_s`, at most: `D` is a norm of the twist
//! and linear in the pressure.

use nalgebra::{Matrix3, SMatrix, Vector2, Vector3, Vector4};

use super::abreast::{self, Abreasts, Beside};
use super::branch::{COUPLING_SEARCH, strong};
use super::equilibrium::{Integrals, Matrix7, Solver, State, Vector7, solve_newton, unknowns};
use super::pads::{Load, Pads};
use super::pressure;
use super::slip;
use super::solve::{Options, Search, Start, finish};
use crate::contact::{ABREAST, Twist};
use crate::model::Score;
use crate::request::{Refiner, Separation};

/// A state of a contact near the limit state of some load.
#[derive(Debug, Clone)]
pub(crate) struct Neighbour {
    z: Vector7,
    first: FirstStep,
}

impl Neighbour {
    /// The state of a load where another one's solution begins.
    pub(crate) fn at(pads: &Pads, load: &Load, start: Start) -> Option<Self> {
        let mut solver = Solver::new(pads, *load, Refiner::Newton);
        let integrals = solver.integrate(&start.0);
        Self::new(&mut solver, &integrals)
    }

    /// `None` where the equations are singular.
    fn new(solver: &mut Solver<'_>, integrals: &Integrals) -> Option<Self> {
        let first = FirstStep::new(solver, integrals)?;
        Some(Self { z: integrals.z, first })
    }

    /// For [`super::solve_next`].
    pub(crate) fn start(&self) -> Start {
        Start(self.z)
    }
}

/// Newton's first step from a state, for whatever load: all of the equations' solution that does
/// not depend on it. Of the load's part in the Jacobian only the lever of the friction, half the
/// distance times the load's size, is left, in the two rows of the moments.
#[derive(Debug, Clone)]
struct FirstStep {
    /// Residuals without a load, and those of the moments' rows for each unit of lever.
    residual: Vector7,
    by_lever: Vector2<f64>,
    /// Inverse of the slip's rows by the twist, and times what these rows have by the pressure.
    turn: Matrix3<f64>,
    turn_pressure: SMatrix<f64, 3, 4>,
    /// One over what the normal forces' rows have by their own offset, and the offsets' change by
    /// the slopes.
    offset: [f64; 2],
    slope: [[f64; 2]; 2],
    /// Rows of the moments once the twist is put in: by the slip's right-hand sides and by the
    /// pressure for each unit of lever, and by the pressure without it.
    lever_slip: SMatrix<f64, 2, 3>,
    lever_pressure: SMatrix<f64, 2, 4>,
    pressure: SMatrix<f64, 2, 4>,
}

impl FirstStep {
    fn new(solver: &mut Solver<'_>, at: &Integrals) -> Option<Self> {
        let load = solver.load;
        // No load, and a lever of one where the coupling counts.
        solver.load = Load {
            direction: Default::default(),
            size: 1.0,
            normal: [0.0; 2],
            moment: [0.0; 2],
            half_distance: 1.0,
        };
        let (mut without, mut with) = (Matrix7::zeros(), Matrix7::zeros());
        let residual = solver.equations(at, 0.0, Some(&mut without)).residual;
        let coupled = solver.equations(at, 1.0, Some(&mut with)).residual;
        solver.load = load;
        let turn = without.fixed_view::<3, 3>(0, 0).try_inverse()?;
        let by_pressure = without.fixed_view::<3, 4>(0, 3);
        let lever = with.fixed_view::<2, 7>(5, 0) - without.fixed_view::<2, 7>(5, 0);
        let lever_slip = lever.fixed_view::<2, 3>(0, 0) * turn;
        let offset = [without[(3, 3)], without[(4, 4)]].map(|x| 1.0 / x);
        Some(Self {
            residual,
            by_lever: coupled.fixed_rows::<2>(5) - residual.fixed_rows::<2>(5),
            turn_pressure: turn * by_pressure,
            turn,
            slope: [0, 1].map(|k| [5, 6].map(|column| -without[(3 + k, column)] * offset[k])),
            offset,
            lever_pressure: lever.fixed_view::<2, 4>(0, 3) - lever_slip * by_pressure,
            lever_slip,
            pressure: without.fixed_view::<2, 4>(5, 3).into_owned(),
        })
    }

    /// The residuals under a load, and the step. Not finite where the equations are singular.
    fn of(&self, load: &Load) -> (Vector7, Vector7) {
        let lever = load.half_distance * load.size;
        let mut residual = self.residual;
        let wanted = [
            load.direction.f1,
            load.direction.f2,
            load.direction.m3,
            load.normal[0],
            load.normal[1],
            load.moment[0] + lever * self.by_lever[0],
            load.moment[1] + lever * self.by_lever[1],
        ];
        for (r, wanted) in residual.iter_mut().zip(wanted) {
            *r += wanted;
        }
        let slip = -Vector3::new(residual[0], residual[1], residual[2]);
        let base = [-residual[3] * self.offset[0], -residual[4] * self.offset[1]];
        let rows = lever * self.lever_pressure + self.pressure;
        let turned = lever * (self.lever_slip * slip);
        let row = |r: usize| {
            let by = |column: usize| {
                rows[(r, 2 + column)]
                    + rows[(r, 0)] * self.slope[0][column]
                    + rows[(r, 1)] * self.slope[1][column]
            };
            let known = turned[r] + rows[(r, 0)] * base[0] + rows[(r, 1)] * base[1];
            [by(0), by(1), -residual[5 + r] - known]
        };
        let ([a, b, e], [c, d, f]) = (row(0), row(1));
        let inverse = 1.0 / (a * d - b * c);
        let tilt = [(e * d - b * f) * inverse, (a * f - e * c) * inverse];
        let along = |k: usize| base[k] + self.slope[k][0] * tilt[0] + self.slope[k][1] * tilt[1];
        let offset = [along(0), along(1)];
        let q = Vector4::new(offset[0], offset[1], tilt[0], tilt[1]);
        let v = self.turn * slip - self.turn_pressure * q;
        (residual, Vector7::from([v.x, v.y, v.z, q.x, q.y, q.z, q.w]))
    }
}

/// How much is to be found out about a load's `mu_s`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Question {
    /// Whether it is less than this.
    pub(crate) value: f64,
    /// If not, between which bounds it lies: this share apart. Zero: what it is.
    pub(crate) sharp: f64,
    /// Strength of the coupling up to which a state that is found counts: beyond [`COUPLING_SEARCH`] it
    /// need not be the one on the branch from `d = 0`, the limit state asked for.
    pub(crate) coupling: f64,
}

impl Question {
    /// About the state on the branch from `d = 0`.
    pub(crate) const fn of(value: f64, sharp: f64) -> Self {
        Self { value, sharp, coupling: COUPLING_SEARCH }
    }
}

/// What [`Comparer::compare`] found out about a load.
#[derive(Debug, Clone)]
pub(crate) enum Comparison {
    /// Its limit state is the only one near and its `mu_s` lies between these: below the value asked
    /// about, or as close together as asked for.
    Between([f64; 2]),
    /// Its answer, as [`super::solve_next`] gives it.
    Solved(Score),
}

/// Ratio of two corrections up to which Newton's method converges for certain.
pub(super) const CONTRACTION: f64 = 0.25;
/// Growth of the last correction that bounds the way to the solution.
pub(super) const WITHIN: f64 = 2.0;
/// Corrections after the first.
const CORRECTIONS: u32 = 6;

/// Compares loads on one contact.
pub(crate) struct Comparer<'a> {
    /// Gripping force \[N\].
    force: f64,
    solver: Solver<'a>,
    /// Where the last load was left, or somewhere near.
    reached: Integrals,
    abreast: Box<Abreasts>,
}

impl<'a> Comparer<'a> {
    /// For loads on these pads at this gripping force \[N\].
    pub(crate) fn new(pads: &'a Pads, force: f64) -> Self {
        let none = Load {
            direction: Default::default(),
            size: 0.0,
            normal: [1.0; 2],
            moment: [0.0; 2],
            half_distance: 0.0,
        };
        let solver = Solver::new(pads, none, Refiner::Newton);
        Self { force, solver, reached: Integrals::default(), abreast: Box::default() }
    }

    /// The state near the last load's on which something was found out.
    pub(crate) fn reached(&mut self) -> Option<Neighbour> {
        Neighbour::new(&mut self.solver, &self.reached)
    }

    /// As [`Comparer::compare`] of several loads side by side, up to [`ABREAST`], each beside the state
    /// of another one, as far as bounds answer the question. `None` for those that are to be compared
    /// by themselves. `patient`: with more work, for those that did not succeed at first.
    pub(crate) fn several<'n>(
        &mut self,
        loads: &[Load],
        near: impl Fn(usize) -> &'n Neighbour,
        options: &Options,
        (question, patient): (Question, bool),
    ) -> [Option<[f64; 2]>; ABREAST] {
        let mut found = [None; ABREAST];
        let count = loads.len().min(ABREAST);
        // A pad that lifts ends the grip: that is for the solution to say.
        let ends = options.separation == Separation::Discard;
        if options.refiner != Refiner::Newton || ends || count == 0 {
            return found;
        }
        let first = |i: usize| {
            let (load, near) = (&loads[i], near(i));
            let (residual, step) = near.first.of(load);
            Beside { load, z: &near.z, residual, step }
        };
        abreast::beside(self.solver.pads, count, first, question, patient, &mut self.abreast);
        for (i, load) in loads.iter().enumerate().take(count) {
            let asked = load.size > 0.0 && load.normal[0] > 0.0 && load.normal[1] > 0.0;
            found[i] = self.abreast.bounds(i).filter(|_| asked);
        }
        found
    }

    /// The state at which one of several loads was left.
    pub(crate) fn reached_by(&mut self, one: usize) -> Option<Neighbour> {
        let integrals = self.abreast.integrals(one);
        Neighbour::new(&mut self.solver, &integrals)
    }

    /// What is asked about the `mu_s` of a load, which must have an in-plane part and press both
    /// pads, from the state `near` or else from the pressure without coupling. `None` where that does
    /// not succeed: the load is then to be solved.
    pub(crate) fn compare(
        &mut self,
        load: &Load,
        options: &Options,
        near: Option<&Neighbour>,
        question: Question,
    ) -> Option<Comparison> {
        if options.refiner != Refiner::Newton || load.size == 0.0 {
            return None;
        }
        if load.normal.iter().any(|&n| n <= 0.0) {
            return None;
        }
        let solver = &mut self.solver;
        (solver.load, solver.evaluations) = (*load, 0);
        // A pad that lifts ends the grip: that is for the solution to say.
        let question = match options.separation {
            Separation::Discard => Question::of(0.0, 0.0),
            Separation::Solve => question,
        };
        let seed = options.seed.map(|twist| solver.pads.scaled_twist(twist));
        let found = near.and_then(|near| {
            let (residual, step) = near.first.of(load);
            let known = step.iter().all(|x| x.is_finite());
            known.then(|| solver.approach(near.z, residual, step, question, &mut self.reached))?
        });
        // From a state far away Newton's method may get lost.
        let found = found.or_else(|| {
            let start = solver.without_coupling(seed)?;
            let mut jacobian = Matrix7::zeros();
            let at = solver.equations(&start, 1.0, Some(&mut jacobian));
            let step = -solve_newton(&jacobian, &at.residual)?;
            solver.approach(at.z, at.residual, step, question, &mut self.reached)
        });
        let (state, bounds) = found?;
        Some(match state {
            None => Comparison::Between(bounds),
            Some(state) => {
                let options = &Options { search: Search::Off, ..*options };
                let (pads, evaluations) = (solver.pads, solver.evaluations);
                let score = finish(pads, self.force, load, &state, true, evaluations, options);
                Comparison::Solved(score)
            }
        })
    }
}

impl Solver<'_> {
    /// Integrals at the pressure without coupling and a rough slip under it.
    fn without_coupling(&mut self, seed: Option<Twist>) -> Option<Integrals> {
        let (normal, target) = (self.load.normal, self.load.contact_moment());
        let q = pressure::solve(self.pads, normal, target, None, &mut self.scratch[0])?;
        let fields = slip::pressed_fields(self.pads, &q, &mut self.scratch);
        let v = slip::approach(&fields, self.load.direction, seed);
        self.evaluations += 1;
        Some(self.integrate(&unknowns(v, q)))
    }

    /// Newton's method from `z`, where the equations leave `residual`, and its first `step` until
    /// bounds on `mu_s` answer the question, or else to the limit state; with the integrals
    /// `reached`.
    fn approach(
        &mut self,
        mut z: Vector7,
        mut residual: Vector7,
        mut step: Vector7,
        Question { value, sharp, coupling }: Question,
        reached: &mut Integrals,
    ) -> Option<(Option<State>, [f64; 2])> {
        let mut jacobian = Matrix7::zeros();
        for _ in 0..CORRECTIONS {
            *reached = self.integrate(&(z + step));
            let next = self.equations(reached, 1.0, Some(&mut jacobian));
            let pressed = next.moments.iter().all(|m| m[0] > 0.0) && next.mu_over_size > 0.0;
            let falls = next.residual.norm() <= 0.9 * residual.norm();
            if !(pressed && falls) {
                return None;
            }
            let correction = -solve_newton(&jacobian, &next.residual)?;
            let (before, after) = (self.change(&next, &step), self.change(&next, &correction));
            (z, residual) = (next.z, next.residual);
            if after <= CONTRACTION * before {
                let [least, most] =
                    [-WITHIN, WITHIN].map(|by| (next.mu_over_size + by * after) * self.load.size);
                let weak = most * 2.0 * self.load.half_distance.abs() <= coupling;
                let sharp_enough = sharp > 0.0 && most - least <= sharp * most;
                if weak && (most < value || sharp_enough) {
                    return Some((None, [least, most]));
                }
                if sharp == 0.0 && next.mu_over_size * self.load.size >= value {
                    step = correction;
                    break;
                }
            }
            step = correction;
        }
        let found = self.newton(z + step, 1.0, 6)?;
        let mu = found.mu_over_size * self.load.size;
        let strong = mu * 2.0 * self.load.half_distance.abs() > coupling
            || mu >= value && strong(&found, &self.load);
        (!strong).then_some((Some(found), [mu; 2]))
    }

    /// What a change of twist and pressure can change of the dissipation, at most: no point of the
    /// contact moves faster than the fastest of the circle round it, and where a pad lifts the
    /// pressure changes by less than its plane.
    fn change(&self, at: &State, step: &Vector7) -> f64 {
        let reach = |k: usize| self.pads.areas[k].middle().length() + self.pads.areas[k].radius();
        let radius = reach(0).max(reach(1));
        let length = |x: f64, y: f64| (x * x + y * y).sqrt();
        let fastest = |z: &Vector7| length(z[0], z[1]) + z[2].abs() * radius;
        let tilt = length(step[5], step[6]) * radius;
        let pressure: f64 =
            (0..2).map(|k| self.pads.moments[k][0] * (step[3 + k].abs() + tilt)).sum();
        let speed = fastest(step);
        at.friction.normal * speed + pressure * (fastest(&at.z) + speed)
    }
}

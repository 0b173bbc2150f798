//! Whether a load's `mu_s` stays below a value, for less than its solution: from the state of a load
//! like it, no further than an error bound asks for.
//!
//! The integrals at a state serve every load, so Newton's first step from another load's state costs
//! none. Two corrections `s_0`, `s_1` one after the other tell how the Jacobian changes on the way:
//! where `|s_1| <= |s_0| / 4`, Kantorovich's quantity `h` is at most a half as far as the steps show
//! it, and the solution lies within `2 |s_1|` of where `s_1` was found. Sizes are measured by what a
//! correction can change of the dissipation, and so of `mu_s`, at most: `D` is a norm of the twist
//! and linear in the pressure.

use super::branch::{COUPLING_SEARCH, strong};
use super::equilibrium::{Integrals, Matrix7, Solver, State, Vector7, solve_newton, unknowns};
use super::pads::{Load, Pads};
use super::pressure;
use super::slip;
use super::solve::{Options, Search, Start, finish};
use crate::contact::{Loops, Twist};
use crate::model::Score;
use crate::request::{Refiner, Separation};

/// A state of a contact near the limit state of some load.
#[derive(Debug, Clone)]
pub(crate) struct Neighbour(Integrals);

impl Neighbour {
    /// The state of a load where another one's solution begins.
    pub(crate) fn at(pads: &Pads, load: &Load, start: Start) -> Self {
        Self(Solver::new(pads, *load, Refiner::Newton).integrate(&start.0))
    }

    /// For [`super::solve_next`].
    pub(crate) fn start(&self) -> Start {
        Start(self.0.z)
    }
}

/// How much is to be found out about a load's `mu_s`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Question {
    /// Whether it is less than this.
    pub(crate) value: f64,
    /// If not, between which bounds it lies: this share apart. Zero: what it is.
    pub(crate) sharp: f64,
}

/// What [`Comparer::compare`] found out about a load.
#[derive(Debug, Clone)]
pub(crate) enum Comparison {
    /// Its limit state is the only one near and its `mu_s` lies between these: below the value asked
    /// about, or as close together as asked for.
    Between([f64; 2], Neighbour),
    /// Its answer, as [`super::solve_next`] gives it.
    Solved(Score, Neighbour),
}

/// Ratio of two corrections up to which Newton's method converges for certain.
const CONTRACTION: f64 = 0.25;
/// Growth of the last correction that bounds the way to the solution.
const WITHIN: f64 = 2.0;
/// Corrections after the first.
const CORRECTIONS: u32 = 6;

/// Compares loads on one contact.
#[derive(Debug)]
pub(crate) struct Comparer<'a> {
    pads: &'a Pads,
    /// Gripping force \[N\].
    force: f64,
    scratch: [Loops; 2],
}

impl<'a> Comparer<'a> {
    /// For loads on these pads at this gripping force \[N\].
    pub(crate) fn new(pads: &'a Pads, force: f64) -> Self {
        Self { pads, force, scratch: Default::default() }
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
        let mut solver = Solver::new(self.pads, *load, Refiner::Newton);
        solver.scratch = std::mem::take(&mut self.scratch);
        // A pad that lifts ends the grip: that is for the solution to say.
        let question = match options.separation {
            Separation::Discard => Question { value: 0.0, sharp: 0.0 },
            Separation::Solve => question,
        };
        let seed = options.seed.map(|twist| self.pads.scaled_twist(twist));
        let found = near.and_then(|Neighbour(near)| solver.approach(near, question));
        // From a state far away Newton's method may get lost.
        let found = found.or_else(|| {
            let start = solver.without_coupling(seed)?;
            solver.approach(&start, question)
        });
        let evaluations = solver.evaluations;
        self.scratch = solver.scratch;
        let (state, bounds, integrals) = found?;
        let near = Neighbour(integrals);
        Some(match state {
            None => Comparison::Between(bounds, near),
            Some(state) => {
                let options = &Options { search: Search::Off, ..*options };
                let score = finish(self.pads, self.force, load, &state, true, evaluations, options);
                Comparison::Solved(score, near)
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

    /// Newton's method from `start` until bounds on `mu_s` answer the question, or else to the limit
    /// state; with the integrals reached.
    fn approach(
        &mut self,
        start: &Integrals,
        Question { value, sharp }: Question,
    ) -> Option<(Option<State>, [f64; 2], Integrals)> {
        let mut jacobian = Matrix7::zeros();
        let mut at = self.equations(start, 1.0, Some(&mut jacobian));
        let mut step = -solve_newton(&jacobian, &at.residual)?;
        let mut integrals = *start;
        for _ in 0..CORRECTIONS {
            integrals = self.integrate(&(at.z + step));
            let next = self.equations(&integrals, 1.0, Some(&mut jacobian));
            let pressed = next.moments.iter().all(|m| m[0] > 0.0) && next.mu_over_size > 0.0;
            let falls = next.residual.norm() <= 0.9 * at.residual.norm();
            if !(pressed && falls) {
                return None;
            }
            let correction = -solve_newton(&jacobian, &next.residual)?;
            let (before, after) = (self.change(&next, &step), self.change(&next, &correction));
            if after <= CONTRACTION * before {
                let [least, most] =
                    [-WITHIN, WITHIN].map(|by| (next.mu_over_size + by * after) * self.load.size);
                let weak = most * 2.0 * self.load.half_distance.abs() <= COUPLING_SEARCH;
                let sharp_enough = sharp > 0.0 && most - least <= sharp * most;
                if weak && (most < value || sharp_enough) {
                    return Some((None, [least, most], integrals));
                }
                if sharp == 0.0 && next.mu_over_size * self.load.size >= value {
                    (at, step) = (next, correction);
                    break;
                }
            }
            (at, step) = (next, correction);
        }
        let found = self.newton(at.z + step, 1.0, 6)?;
        let mu = found.mu_over_size * self.load.size;
        (!strong(&found, &self.load)).then_some((Some(found), [mu; 2], integrals))
    }

    /// What a change of twist and pressure can change of the dissipation, at most: no point of the
    /// contact moves faster than the fastest of the circle round it, and where a pad lifts the
    /// pressure changes by less than its plane.
    fn change(&self, at: &State, step: &Vector7) -> f64 {
        let reach = |k: usize| self.pads.areas[k].middle().length() + self.pads.areas[k].radius();
        let radius = reach(0).max(reach(1));
        let fastest = |z: &Vector7| z[0].hypot(z[1]) + z[2].abs() * radius;
        let tilt = step[5].hypot(step[6]) * radius;
        let pressure: f64 =
            (0..2).map(|k| self.pads.moments[k][0] * (step[3 + k].abs() + tilt)).sum();
        let speed = fastest(step);
        at.friction.normal * speed + pressure * (fastest(&at.z) + speed)
    }
}

//! A load that grows on one contact: its limit state followed from a small load up to the one that
//! asks for a given friction, or to the end of the branch.
//!
//! Loads are in units `k` of the gripping force. At a solved state the equations tell how the state
//! and `mu_s` go on with the load, so that each step begins at a good guess; a step is kept when what
//! the two ends say of the way between them agrees, and is cut otherwise. Where `mu_s` comes up to
//! the friction, the load is solved for together with the state.

use std::ops::ControlFlow;

use super::branch::{FOLLOW_STEP, strong};
use super::equilibrium::{Matrix7, Solver, State, TOLERANCE, Vector7, solve_newton};
use super::pads::{Load, Pads};
use super::pressure::{self, face_pressure, separates};
use super::solve::Start;
use crate::model::Wrench;
use crate::request::{Refiner, Separation};

/// How the growth of a load ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End {
    /// At this load `mu_s` comes up to the friction.
    Slips(f64),
    /// No step leads on from this load, which is held: the pads twist out, pull off, or another
    /// limit state takes over.
    Stops(f64),
    /// The load is held up to [`MOST`].
    Never,
}

/// Largest load in units of the gripping force.
pub(super) const MOST: f64 = 1e9;
/// Relative difference at which `mu_s` counts as the friction.
pub(super) const EQUAL: f64 = 1e-10;
/// Shortest step, as a share of the load.
const SHORTEST: f64 = 1e-6;
/// Most steps.
const STEPS: usize = 200;
/// Residual at which a state on the way is close enough.
const CLOSE: f64 = 1e-8;
/// Newton's steps to a state on the way; each must halve the residual.
const CORRECTIONS: usize = 5;
/// Newton's steps to the load that asks for the friction.
const SOLVES: usize = 8;
/// Share of the way to the contact's end that a step leaves.
const LEAVE: f64 = 0.25;
/// How far the change of `mu_s` over a step may be from what the slopes at its ends say, as a share
/// of the friction.
const BENT: f64 = 0.02;
/// Share of the friction from which on the load that asks for all of it is solved for at once.
const NEAR: f64 = 0.9;
/// What is left of a step that fails, and growth of one that does not.
const CUT: f64 = 0.3;
const GROW: f64 = 3.0;
/// Places between the ends of a step at which the cubic through them is looked at.
const PLACES: u32 = 8;

/// A load that grows on a contact.
pub(super) struct Growth<'a> {
    solver: Solver<'a>,
    /// The load for `k = 1`.
    unit: Load,
    friction: f64,
    separation: Separation,
}

/// A state on the way.
struct Point {
    k: f64,
    state: State,
    /// Of the state by `k`.
    slope: Vector7,
    mu: f64,
    /// Of `mu` by `k`.
    rise: f64,
}

impl<'a> Growth<'a> {
    /// `size` is the force \[N\] whose `k`-th part squeezes the pads.
    pub(super) fn new(
        pads: &'a Pads,
        distance: f64,
        size: f64,
        wrench: &Wrench,
        friction: f64,
        separation: Separation,
    ) -> Self {
        let unit = pads.load(distance, size, wrench);
        Self { solver: Solver::new(pads, unit, Refiner::Newton), unit, friction, separation }
    }

    /// Follows the load from the state `start` at `k`, where it is held.
    pub(super) fn end(&mut self, k: f64, Start(start): Start) -> End {
        let Some(mut at) = self.point(k, start) else { return End::Stops(k) };
        let mut longest = f64::INFINITY;
        for _ in 0..STEPS {
            let mut step = self.longest(&at).min(longest);
            let next = loop {
                if step < SHORTEST * at.k {
                    return End::Stops(at.k);
                }
                match self.step(&at, step) {
                    Some(ControlFlow::Break(k)) => return End::Slips(k),
                    Some(ControlFlow::Continue(next)) => break next,
                    None => step *= CUT,
                }
                longest = step;
            };
            longest *= GROW;
            at = next;
            if at.k > MOST {
                return End::Never;
            }
        }
        End::Stops(at.k)
    }

    fn load(&self, k: f64) -> Load {
        let [one, two] = self.unit.normal;
        let [m1, m2] = self.unit.moment;
        Load {
            size: k * self.unit.size,
            normal: [1.0 + k * (one - 1.0), 1.0 + k * (two - 1.0)],
            moment: [k * m1, k * m2],
            ..self.unit
        }
    }

    /// The longest step worth trying: to where the slope of `mu` leads to the friction, but not too
    /// near to where a pad is pulled off or the contact twists out.
    fn longest(&self, at: &Point) -> f64 {
        let Point { k, state, .. } = at;
        let Load { normal, half_distance, .. } = self.load(*k);
        let by_k = [0, 1].map(|face| self.unit.normal[face] - 1.0);
        let to_friction =
            if at.rise > 0.0 { (self.friction - at.mu) / at.rise } else { f64::INFINITY };
        // Beyond the friction by a little, so that it lies within the step.
        let mut step = (1.01 * to_friction).clamp(1e-3 * k, 2.0 * MOST);
        for face in 0..2 {
            if by_k[face] < 0.0 {
                step = step.min((1.0 - LEAVE) * normal[face] / -by_k[face]);
            }
        }
        let x = pressure::carried(&state.moments, &state.q());
        let moved = pressure::stiffness(&state.moments) * at.slope.fixed_rows::<4>(3);
        let moved = glam::DVec2::new(moved[2], moved[3]);
        let room = pressure::reach(self.solver.pads, normal, x);
        for &(e, [i, ii]) in &self.solver.pads.supports {
            let left = normal[0] * i + normal[1] * ii - e.dot(x);
            let change = by_k[0] * i + by_k[1] * ii - e.dot(moved);
            if change < 0.0 {
                step = step.min((left - LEAVE * room) / -change);
            }
        }
        // Where the coupling may become strong, no longer than what is certain to stay on the branch.
        if self.friction * 2.0 * half_distance.abs() > super::COUPLING_SEARCH {
            step = step.min(0.5 * FOLLOW_STEP / moved.length());
        }
        step
    }

    /// A step from a state to the next, or to the load that slips; `None` where it does not lead to
    /// one for certain.
    fn step(&mut self, at: &Point, step: f64) -> Option<ControlFlow<f64, Point>> {
        let next = self.point(at.k + step, at.state.z + step * at.slope)?;
        let whole = |point: &Point| {
            let q = point.state.q();
            (0..2).all(|k| !separates(&self.solver.pads.areas[k], face_pressure(&q, k)))
        };
        if self.separation == Separation::Discard && !whole(&next) {
            return None;
        }
        let kept = |face: usize| next.state.moments[face][0] / at.state.moments[face][0];
        let like = (0..2).all(|face| (0.1..10.0).contains(&kept(face)));
        let bent = next.mu - at.mu - 0.5 * step * (at.rise + next.rise);
        if !(like && bent.abs() <= BENT * self.friction && self.on_branch(at, &next)) {
            return None;
        }
        if let Some((k, z)) = self.within(at, &next) {
            return self.slips(k, z, [at.k, next.k]).map(ControlFlow::Break);
        }
        if next.mu > NEAR * self.friction && next.rise > 0.0 {
            let on = (self.friction - next.mu) / next.rise;
            let k = next.k + on;
            if on < step
                && let Some(k) = self.slips(k, next.state.z + on * next.slope, [next.k, k + on])
            {
                return Some(ControlFlow::Break(k));
            }
        }
        Some(ControlFlow::Continue(next))
    }

    /// Where the coupling is strong: whether the next state is on the same side of any turning
    /// point.
    fn on_branch(&mut self, at: &Point, next: &Point) -> bool {
        self.solver.load = self.load(next.k);
        if !strong(&next.state, &self.solver.load) {
            return true;
        }
        let before = pressure::carried(&at.state.moments, &at.state.q());
        self.solver.node(&next.state.z).is_some_and(|node| {
            node.x.distance(before) <= FOLLOW_STEP && node.slope.determinant() > 0.0
        })
    }

    /// The first place between two states where the cubic through them comes up to the friction,
    /// with the state there.
    fn within(&self, at: &Point, next: &Point) -> Option<(f64, Vector7)> {
        let step = next.k - at.k;
        let mix = |t: f64| {
            let s = 1.0 - t;
            [s * s * (1.0 + 2.0 * t), t * s * s * step, t * t * (3.0 - 2.0 * t), -t * t * s * step]
        };
        let mu = |t: f64| {
            let [a, b, c, d] = mix(t);
            a * at.mu + b * at.rise + c * next.mu + d * next.rise
        };
        let place = |i: u32| f64::from(i) / f64::from(PLACES);
        let first = (1..=PLACES).find(|&i| mu(place(i)) >= self.friction)?;
        let (mut low, mut high) = (place(first - 1), place(first));
        for _ in 0..30 {
            let t = 0.5 * (low + high);
            if mu(t) < self.friction { low = t } else { high = t }
        }
        let [a, b, c, d] = mix(high);
        let z = a * at.state.z + b * at.slope + c * next.state.z + d * next.slope;
        Some((at.k + high * step, z))
    }

    /// Newton's method from a guess at the load `k`.
    fn point(&mut self, k: f64, z: Vector7) -> Option<Point> {
        self.solver.load = self.load(k);
        if self.solver.load.normal.iter().any(|&n| n <= 0.0) {
            return None;
        }
        let mut jacobian = Matrix7::zeros();
        let mut state = self.solver.evaluate(&z, 1.0, Some(&mut jacobian));
        for _ in 0..CORRECTIONS {
            if state.residual.amax() < CLOSE {
                break;
            }
            let z = state.z - solve_newton(&jacobian, &state.residual)?;
            let next = self.solver.evaluate(&z, 1.0, Some(&mut jacobian));
            let falls = next.residual.norm() <= 0.5 * state.residual.norm();
            if !falls {
                return None;
            }
            state = next;
        }
        let pressed = state.moments.iter().all(|m| m[0] > 0.0);
        if !(pressed && state.mu_over_size > 0.0 && state.residual.amax() < CLOSE) {
            return None;
        }
        let slope = -solve_newton(&jacobian, &self.by_load(&state, k))?;
        let mu = state.mu_over_size * self.solver.load.size;
        let rise = mu / k + Self::by_twist(&state, &slope) * self.solver.load.size;
        Some(Point { k, state, slope, mu, rise })
    }

    /// The load near `k` at which `mu_s` is the friction, solved for together with the state.
    fn slips(&mut self, mut k: f64, mut z: Vector7, within: [f64; 2]) -> Option<f64> {
        let mut jacobian = Matrix7::zeros();
        for _ in 0..SOLVES {
            self.solver.load = self.load(k);
            let size = self.solver.load.size;
            let state = self.solver.evaluate(&z, 1.0, Some(&mut jacobian));
            let excess = state.mu_over_size * size - self.friction;
            if excess.abs() <= EQUAL * self.friction && state.residual.amax() < TOLERANCE {
                return (state.moments.iter().all(|m| m[0] > 0.0)).then_some(k);
            }
            let correction = -solve_newton(&jacobian, &state.residual)?;
            let slope = -solve_newton(&jacobian, &self.by_load(&state, k))?;
            // With `v` times the slip's residual the dissipation follows the pressure too.
            let left: f64 = (0..3).map(|i| z[i] * state.residual[i]).sum();
            let corrected = Self::by_twist(&state, &correction) + 0.5 * left / state.mu_over_size;
            let rise = state.mu_over_size * self.unit.size + Self::by_twist(&state, &slope) * size;
            let on = -(excess + corrected * size) / rise;
            k += on;
            z = state.z + correction + on * slope;
            if !(within[0]..=within[1]).contains(&k) {
                return None;
            }
        }
        None
    }

    /// How the residuals follow `k` at a state.
    fn by_load(&self, state: &State, k: f64) -> Vector7 {
        let x = pressure::carried(&state.moments, &state.q());
        let r = &state.residual;
        let [one, two] = self.unit.normal;
        // The moments' part is all of (6)(7) but what the pressure carries, in proportion to `k`.
        Vector7::from([0.0, 0.0, 0.0, one - 1.0, two - 1.0, (r[5] + x.y) / k, (r[6] - x.x) / k])
    }

    /// Change of the dissipation along a change of the state that leaves `D grad D` as it is: half of
    /// it comes with the twist, and the pressure takes the other half back.
    fn by_twist(state: &State, change: &Vector7) -> f64 {
        let twist = [change[0], change[1], change[2]].into();
        0.5 * state.friction.gradient.power(twist)
    }
}

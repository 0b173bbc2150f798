//! The limit state on the branch that starts without coupling, at `d = 0`.

use glam::{DMat2, DVec2};

use super::equilibrium::{Node, Solver, State, Vector7, same, unknowns};
use super::pads::{Load, Pads};
use super::pressure::{self, face_pressure, separates};
use super::slip;
use crate::contact::{Field, Twist};
use crate::geometry::principal;
use crate::model::Wrench;
use crate::request::Refiner;

/// Strength of the coupling, `mu |d| / sqrt(A)`, above which other solutions are looked for. Below
/// it none was ever seen (0 of 1408 random cases with different areas on the two faces); at 1-2
/// they are 0.65 % of such cases, at 4-8 23 %.
pub const COUPLING_SEARCH: f64 = 1.0;

/// Strength of the coupling above which another limit state may lie close to one in which a pad
/// separates (seen down to 0.08).
const COUPLING_FOLD: f64 = 0.03;

fn coupling(state: &State, load: &Load) -> f64 {
    state.mu_over_size * load.size * 2.0 * load.half_distance.abs()
}

/// Whether there may be other limit states than this one.
pub(super) fn strong(state: &State, load: &Load) -> bool {
    coupling(state, load) > COUPLING_SEARCH
}

/// Width of a contact ([`Pads::width`]) below which it counts as narrow: that of a bar sixteen times as
/// long as wide. Such contacts were seen with limit states far from each other at couplings down to
/// 0.03 of the width. Of contacts up to eight times as long, which are common, searches would cost a
/// fifth of a plan, and showed one more in 480 bars.
const NARROW: f64 = 0.25;

/// Strength of the coupling above which a narrow contact may have other limit states, in its widths.
const COUPLING_NARROW: f64 = 0.02;

/// Whether there may be other limit states anywhere because the contact is narrow.
pub(super) fn narrow(state: &State, pads: &Pads, load: &Load) -> bool {
    pads.width < NARROW && coupling(state, load) > COUPLING_NARROW * pads.width
}

/// Strength of the coupling above which there may be other limit states anywhere than one in which a
/// pad separates, on any contact and on slender ones: that of a bar twelve times as long as wide. Some
/// were seen at 0.95, on faces of two pieces, of which the first state had 22 and 40 % and the other 0.5
/// and 1.3 %; and at 0.13 on bars of 14:1, of which the first had 52 and 69 %.
const COUPLING_PARTED: [f64; 2] = [0.5, 0.1];
const SLENDER: f64 = 0.289;

/// Whether there may be other limit states anywhere than this one, in which a pad separates.
pub(super) fn far_apart(state: &State, pads: &Pads, load: &Load) -> bool {
    coupling(state, load) > COUPLING_PARTED[usize::from(pads.width < SLENDER)]
}

/// Whether the map may fold close to this state.
pub(super) fn folded(state: &State, pads: &Pads, load: &Load) -> bool {
    coupling(state, load) > COUPLING_FOLD
        && (0..2).any(|k| separates(&pads.areas[k], face_pressure(&state.q(), k)))
}

/// Share of a pad's contact below which other limit states may lie anywhere, not only beside this one
/// (they were seen where 0.3 % was left, at a coupling of 0.6, and on arms of 10:1 where 3.7 % was, at
/// 0.2).
const HARDLY: f64 = 0.1;

/// Whether one of the pads has lost nearly all of its contact.
pub(super) fn hardly_touching(state: &State, pads: &Pads) -> bool {
    (0..2).any(|k| state.moments[k][0] < HARDLY * pads.moments[k][0])
}

/// Steps down a valley at most, the share of the value by which a step counts as slow, the fall, as a
/// share of the steepest that there can be, up to which there is none, the ways along folds at most, and
/// the value that is left to Newton's method.
const VALLEY_MOST: usize = 60;
const VALLEY_SLOW: f64 = 1e-3;
const VALLEY_FLAT: f64 = 1e-3;
const VALLEY_FOLDS: usize = 3;
const VALLEY_FLOOR: f64 = 1e-7;
/// Longest step of [`Solver::deflated`], of force times the pads' length.
const DEFLATED_STEP: f64 = 0.1;

impl Solver<'_> {
    /// Newton's method on all seven equations from the pressure `q` without coupling and a rough
    /// slip under it. Where the coupling is so weak that there is one solution, it is the one on the
    /// branch from `d = 0`, whichever way it was reached.
    fn direct(&mut self, q: [f64; 4], seed: Option<Twist>) -> Option<State> {
        let p = [face_pressure(&q, 0), face_pressure(&q, 1)];
        let parted = [0, 1].map(|k| separates(&self.pads.areas[k], p[k]));
        let w = self.load.direction;
        let v = if self.pads.congruent && parted == [false; 2] {
            // The summed pressure is constant: the slip does not depend on the rest.
            let level = [p[0][0] + p[1][0], 0.0, 0.0];
            let slip = slip::solve(
                &[Field { area: &self.pads.areas[0], p: level }],
                w,
                seed,
                Refiner::Newton,
            );
            self.evaluations += slip.evaluations;
            self.iterations += slip.iterations;
            slip.twist
        } else {
            let fields = slip::pressed_fields(self.pads, &q, &mut self.scratch);
            self.evaluations += 1;
            slip::approach(&fields, w, seed)
        };
        self.newton(unknowns(v, q), 1.0, 12)
    }

    /// A limit state near `z`, that of another load, or else near the pressure without coupling: where the
    /// coupling is strong it need not be the one on the branch from `d = 0`.
    pub(super) fn nearby(&mut self, z: Option<&Vector7>, seed: Option<Twist>) -> Option<State> {
        let near = z.and_then(|z| self.newton(*z, 1.0, 6));
        near.or_else(|| {
            let q = self.uncoupled()?;
            self.direct(q, seed)
        })
    }

    /// The pressure without coupling; `None` at the rim, where [`Solver::state_at`] knows the way.
    fn uncoupled(&mut self) -> Option<[f64; 4]> {
        let (normal, moment) = (self.load.normal, self.load.contact_moment());
        pressure::solve(self.pads, normal, moment, None, &mut self.scratch[0])
    }

    /// The solution on the branch that starts at `d = 0` without coupling; `None` when that branch
    /// does not exist, or ends before the real `d`.
    pub(crate) fn branch(&mut self, seed: Option<Twist>) -> Option<State> {
        if self.refiner == Refiner::Newton {
            let state = self.uncoupled().and_then(|q| self.direct(q, seed));
            if let Some(state) = state.filter(|state| !strong(state, &self.load)) {
                return Some(state);
            }
        }
        if self.refiner == Refiner::Newton {
            return self.followed(seed);
        }
        let start = self.state_at(self.load.contact_moment(), seed)?;
        let direct = self.conjugate(start).filter(|state| !strong(state, &self.load));
        direct.or_else(|| {
            let followed = self.follow(start)?;
            Some(self.conjugate(followed.z).unwrap_or(followed))
        })
    }

    /// [`Solver::branch`] step by step, where several limit states are known.
    pub(super) fn followed(&mut self, seed: Option<Twist>) -> Option<State> {
        let start = self.state_at(self.load.contact_moment(), seed)?;
        self.follow(start)
    }

    /// The solution close to `z`, that of another load, by Newton's method from there; where the
    /// coupling is so strong that there may be others, only a short way off and on the same side of
    /// any turning point.
    pub(super) fn next_to(&mut self, z: &Vector7) -> Option<State> {
        let found = self.newton(*z, 1.0, 6)?;
        if strong(&found, &self.load) {
            let to = self.node(&found.z)?;
            let q = [z[3], z[4], z[5], z[6]];
            let x = pressure::carried(
                &pressure::pressed_moments(self.pads, &q, &mut self.scratch[0]),
                &q,
            );
            if to.x.distance(x) > FOLLOW_STEP / 2.0 || to.slope.determinant() <= 0.0 {
                return None;
            }
        }
        Some(found)
    }

    /// Follows the branch from coupling 0 to 1, in the plane of contact moments where even the last
    /// of a contact has room: along its tangent, then Newton's method, in steps short enough that
    /// each ends close to where the tangent led. `None` where the branch turns back or ends.
    pub(crate) fn follow(&mut self, start: Vector7) -> Option<State> {
        let mut at = self.newton(start, 0.0, 25)?;
        let (mut reached, mut step) = (if self.load.half_distance == 0.0 { 1.0 } else { 0.0 }, 1.0);
        let mut left_before: Option<(f64, f64)> = None;
        for _ in 0..FOLLOW_MOST {
            if reached == 1.0 {
                return Some(at);
            }
            let here = self.node(&at.z)?;
            // `g` is linear in the coupling, `x - x_0` without it.
            let friction = here.g - (here.x - self.load.contact_moment());
            let slope = Self::slope_at(&here, reached);
            let tangent = -(slope.inverse() * friction);
            let room = pressure::reach(self.pads, self.load.normal, here.x);
            if let Some((before, then)) = left_before
                && room < FOLLOW_LEAVES
                && reached + FOLLOW_FORETOLD * room * (reached - then) / (before - room).max(0.0)
                    < 1.0
            {
                return None;
            }
            left_before = Some((room, reached));
            loop {
                let next = f64::min(1.0, reached + step);
                let moved = (next - reached) * tangent;
                let left = pressure::reach(self.pads, self.load.normal, here.x + moved);
                let short = moved.length() <= FOLLOW_STEP && left >= FOLLOW_SHARE * room;
                let found = if short { self.onwards(&at, here.x + moved, next) } else { None };
                let close = |node: &Node| {
                    (node.x - here.x - moved).length() <= (0.3 * moved.length()).max(FOLLOW_KINK)
                };
                match found {
                    Some((found, node))
                        if close(&node) && Self::slope_at(&node, next).determinant() > 0.0 =>
                    {
                        (at, reached) = (found, next);
                        step *= 2.0;
                        break;
                    }
                    _ => step /= 2.0,
                }
                if step < FOLLOW_LEAST {
                    return None;
                }
            }
        }
        None
    }

    /// The solution at a coupling near the contact moment `x`, found from the solution `at`, and
    /// its point of the map: Newton's method on the map until what is left is small beside the room
    /// there, then on all seven equations.
    fn onwards(&mut self, at: &State, mut x: DVec2, coupling: f64) -> Option<(State, Node)> {
        let (mut z, mut before) = (at.z, f64::INFINITY);
        loop {
            z = self.state_near(x, Some(&z))?;
            let node = self.node(&z)?;
            let left = coupling * node.g + (1.0 - coupling) * (node.x - self.load.contact_moment());
            let (size, room) = (left.length(), pressure::reach(self.pads, self.load.normal, x));
            if size <= FOLLOW_CLOSE * room
                && let Some(found) = self.newton(z, coupling, 8)
            {
                let node = self.node(&found.z)?;
                return Some((found, node));
            }
            let step = Self::slope_at(&node, coupling).inverse() * left;
            if size > 0.5 * before || size == 0.0 || !step.is_finite() {
                return None;
            }
            (x, before) = (x - step, size);
        }
    }

    /// Another limit state beside `state`, where the map folds between the two: looked for both ways
    /// in the direction in which the map is flattest.
    pub(super) fn partner(&mut self, state: &State) -> Option<State> {
        let here = self.node(&state.z)?;
        let (flat, stretch) = flattest(here.slope);
        let across = here.slope * flat;
        let across = if stretch > 0.0 { across / stretch } else { flat.perp() };
        let room = pressure::reach(self.pads, self.load.normal, here.x).max(0.0);
        for way in [flat, -flat] {
            let rising = across.dot(here.slope * way);
            let mut near = here;
            let (mut before, mut highest) = (0.0, 0.0_f64);
            for share in PARTNER_SHARES {
                let h = share * room;
                let z = self.state_near(here.x + h * way, Some(&near.z));
                let Some(node) = z.and_then(|z| self.node(&z)) else { break };
                let value = across.dot(node.g) * rising.signum();
                // Risen from here, and lower again: a zero may be near, or between the last point
                // and this one.
                let fallen = value < highest;
                highest = highest.max(value);
                if fallen {
                    let last = across.dot(near.g) * rising.signum();
                    let crossing = before + (h - before) * (last / (last - value)).clamp(0.1, 0.9);
                    let between = self.state_near(here.x + crossing * way, Some(&near.z));
                    let between = between.and_then(|z| self.node(&z));
                    let found = [between, Some(node)]
                        .into_iter()
                        .flatten()
                        .find_map(|at| self.settle_at(at).filter(|other| !same(state, other)));
                    if found.is_some() {
                        return found;
                    }
                    if value < 0.0 {
                        break;
                    }
                }
                (near, before) = (node, h);
            }
        }
        None
    }

    /// The limit state near a point of the map: by Newton's method on the map, then on all seven
    /// equations.
    pub(super) fn settle_at(&mut self, at: Node) -> Option<State> {
        let z = self.descend(at).z;
        self.newton(z, 1.0, 15)
    }

    /// Newton's method on the map.
    fn descend(&mut self, mut at: Node) -> Node {
        for _ in 0..SETTLE_MOST {
            if at.g.length() < SETTLED {
                break;
            }
            let step = at.slope.inverse() * at.g;
            let next = [1.0, 0.4, 0.15, 0.05].into_iter().find_map(|t| {
                let z = self.state_near(at.x - t * step, Some(&at.z))?;
                self.node(&z).filter(|next| next.g.length() < at.g.length())
            });
            let Some(next) = next else { break };
            at = next;
        }
        at
    }

    /// Where the map's length is least beside a point, by Levenberg's and Marquardt's method. Where
    /// that ends at a fold the way goes on along it to both sides, if that leads down.
    pub(super) fn floor(&mut self, mut at: Node) -> Node {
        let mut damping = 1e-3;
        let mut folds = 0;
        for _ in 0..VALLEY_MOST {
            let value = at.g.length();
            if value < VALLEY_FLOOR {
                break;
            }
            let transposed = at.slope.transpose();
            let (normal, downhill) = (transposed * at.slope, transposed * at.g);
            let trace = normal.x_axis.x + normal.y_axis.y;
            // No way leads down: at the floor, or at a fold.
            let flat =
                downhill.length_squared() < VALLEY_FLAT * VALLEY_FLAT * trace * value * value;
            let next = (!flat && damping < 1e6).then(|| {
                let level = DMat2::from_diagonal(DVec2::splat(damping * trace));
                self.beside(&at, at.x - (normal + level).inverse() * downhill)
            });
            let (next, much) = match next.flatten().filter(|next| next.g.length() < value) {
                Some(next) => {
                    damping *= 0.2;
                    (Some(next), next.g.length() < (1.0 - VALLEY_SLOW) * value)
                }
                None if flat || damping >= 1e6 => (None, false),
                None => {
                    damping *= 8.0;
                    continue;
                }
            };
            let here = next.unwrap_or(at);
            if much {
                at = here;
                continue;
            }
            folds += 1;
            let Some(along) = (folds <= VALLEY_FOLDS).then(|| self.along_fold(&here)).flatten()
            else {
                return here;
            };
            (at, damping) = (along, 1e-3);
        }
        at
    }

    /// A lower point on the line through `at` along which the map changes least.
    fn along_fold(&mut self, at: &Node) -> Option<Node> {
        let (flat, _) = flattest(at.slope);
        let mut best = None;
        let mut least = at.g.length();
        for way in [0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4] {
            for side in [way, -way] {
                if let Some(next) = self.beside(at, at.x + side * flat)
                    && next.g.length() < least
                {
                    (least, best) = (next.g.length(), Some(next));
                }
            }
        }
        best
    }

    /// Another limit state than `known` in the same valley of the map: Newton's method from both
    /// sides, with steps bent away from what is known (deflation: those for the map over the
    /// squared distance).
    pub(super) fn deflated(&mut self, known: &State) -> Option<State> {
        let here = self.node(&known.z)?;
        let (flat, _) = flattest(here.slope);
        for start in [1e-3, -1e-3, 0.01, -0.01, 0.05, -0.05] {
            let Some(mut at) = self.beside(&here, here.x + start * flat) else { continue };
            for _ in 0..VALLEY_MOST {
                if at.g.length() < SETTLED {
                    break;
                }
                let step = -at.slope.inverse() * at.g;
                let away = at.x - here.x;
                // Of the factor 1 + 1 / |away|^2.
                let falls =
                    -2.0 * away.dot(step) / (away.length_squared() * (1.0 + away.length_squared()));
                let bent = step / (1.0 - falls);
                let bent = bent.clamp_length_max(DEFLATED_STEP);
                let Some(next) =
                    [1.0, 0.3, 0.1].iter().find_map(|t| self.beside(&at, at.x + t * bent))
                else {
                    break;
                };
                at = next;
            }
            let found = self.newton(at.z, 1.0, 15).filter(|found| !same(known, found));
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// The point of the map at the contact moment `x`, from one whose pressure and slip are close.
    pub(super) fn beside(&mut self, near: &Node, x: DVec2) -> Option<Node> {
        let z = self.state_near(x, Some(&near.z))?;
        self.node(&z)
    }

    /// Derivative of `g` at a coupling. Its determinant is positive where the branch starts and
    /// changes its sign at a turning point; another limit state that a long step has led to most
    /// often has the other sign, too.
    fn slope_at(node: &Node, coupling: f64) -> DMat2 {
        DMat2::IDENTITY + coupling * (node.slope - DMat2::IDENTITY)
    }
}

/// The limit state that a load reaches when it grows from a small part of itself, in steps short
/// enough that Newton's method leads from each to the next, with the evaluations spent. It is there
/// for loads close to twisting out, whose last bit of contact no mesh resolves.
pub(super) fn by_load(
    pads: &Pads,
    distance: f64,
    force: f64,
    wrench: &Wrench,
    refiner: Refiner,
) -> (Option<State>, u32) {
    let mut evaluations = 0;
    let solver = |share: f64| {
        let part = Wrench { force: share * wrench.force, moment: share * wrench.moment };
        Solver::new(pads, pads.load(distance, force, &part), refiner)
    };
    let mut at = None;
    let mut reached = 0.0;
    for share in [0.9, 0.7, 0.5, 0.25, 0.1] {
        let mut begin = solver(share);
        at = begin.branch(None);
        evaluations += begin.evaluations;
        if at.is_some() {
            reached = share;
            break;
        }
    }
    let Some(mut at) = at else { return (None, evaluations) };
    let mut step = 0.5 * (1.0 - reached);
    for _ in 0..GROW_MOST {
        let next = f64::min(1.0, reached + step);
        let mut onwards = solver(next);
        let found = onwards.newton(at.z, 1.0, 8);
        evaluations += onwards.evaluations;
        // A jump to another state, or over the end of this one, is no step.
        let near = |state: &State| {
            let ratio = state.moments.iter().zip(&at.moments).map(|(new, old)| new[0] / old[0]);
            ratio.into_iter().all(|ratio| (0.2..5.0).contains(&ratio))
        };
        match found.filter(near) {
            Some(state) if next == 1.0 => return (Some(state), evaluations),
            Some(state) => {
                (at, reached) = (state, next);
                step *= 1.5;
            }
            None => step /= 3.0,
        }
        if step < GROW_LEAST {
            break;
        }
    }
    (None, evaluations)
}

/// The unit vector that a linear map stretches least, and by how much.
fn flattest(slope: DMat2) -> (DVec2, f64) {
    let (_, flat) = principal(slope.transpose() * slope);
    (flat, (slope * flat).length())
}

/// Where [`Solver::partner`] looks, as shares of the way to the rim (along it
/// there is more room).
const PARTNER_SHARES: [f64; 11] = [1e-3, 4e-3, 0.015, 0.05, 0.15, 0.4, 0.8, 1.6, 4.0, 10.0, 30.0];

/// Most steps of [`Solver::descend`], and the value at which they end.
const SETTLE_MOST: usize = 12;
const SETTLED: f64 = 1e-7;

/// Most steps of [`by_load`], and the shortest one.
const GROW_MOST: usize = 60;
const GROW_LEAST: f64 = 1e-6;

/// Longest step of [`Solver::follow`] in contact moment, of force times the pads' length.
pub(super) const FOLLOW_STEP: f64 = 0.25;
/// Shortest step in coupling, and most steps.
const FOLLOW_LEAST: f64 = 1e-9;
const FOLLOW_MOST: usize = 1000;
/// Share that a step leaves of the way to the region's rim, where no contact is left.
const FOLLOW_SHARE: f64 = 0.25;
/// Distance from the rim below which the map hardly changes up to it, so that a branch that comes up to
/// the rim leaves the region where it is foretold to, and how much farther it may go than foretold.
const FOLLOW_LEAVES: f64 = 1e-3;
const FOLLOW_FORETOLD: f64 = 4.0;
/// What [`Solver::follow`] leaves to Newton's method on all equations, as a share of the way to the
/// rim.
const FOLLOW_CLOSE: f64 = 1e-3;
/// How far from the tangent's end a step may lead, however short it is: where a pad begins to
/// separate the branch turns sharply.
const FOLLOW_KINK: f64 = 1e-3;

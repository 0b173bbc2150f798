//! Tilt, pressure and slip together: equations (6)(7) for the rotations that the pressure resists.
//!
//! For a given tilt the normal forces fix the pressure on each face and the slip problem the
//! friction, so that the moments about the resisted axes are functions of the tilt alone: two, one
//! or none.

use glam::DVec2;
use nalgebra::{Vector2, Vector3, Vector5};

use super::face::{Carried, Face, Moved, Pressed};
use super::joint::{Joint, Mode, Near, Place, Reached};
use super::slip::{self, Slipping, Space};
use crate::model::Wrench;

/// What is asked: both faces, their distance, normal forces, and the load.
#[derive(Clone)]
pub(super) struct Problem<'a> {
    /// Whether a part of the faces turns with the body when it tilts, and another one rolls.
    pub(super) rolls: bool,
    /// Share by which it counts that what turns is pushed along the pads then, and that what rolls carries
    /// its pressure along: all or none, but on the way to a solution.
    pub(super) moves: f64,
    pub(super) faces: [&'a Face; 2],
    pub(super) distance: f64,
    pub(super) normal: [f64; 2],
    pub(super) wrench: Wrench,
    pub(super) space: Space,
    /// Axes of the rotations that the pressure resists.
    pub(super) held: Vec<DVec2>,
    /// Moment per angle about each of them beside that of the pressure: of round faces that roll.
    pub(super) rolling: Vec<f64>,
    /// Angle about each of them that changes the compression by itself.
    pub(super) units: Vec<f64>,
    /// Width of the pressure across each of them.
    pub(super) widths: Vec<f64>,
    /// Moment by which the residuals are measured: normal force times the pressure's width.
    pub(super) moment: f64,
}

/// A tilt with its pressure and slip.
#[derive(Clone)]
pub(super) struct State<'a> {
    /// Angles about the held axes, in their units.
    pub(super) angles: Vec<f64>,
    pub(super) faces: [Pressed<'a>; 2],
    /// None where only the pressure was asked for.
    pub(super) slip: Option<Slipping>,
    /// What (6)(7) leave over about the held axes, over [`Problem::moment`].
    pub(super) residual: Vec<f64>,
}

impl State<'_> {
    /// What it needs; none where that was not asked for.
    pub(super) fn friction(&self) -> f64 {
        self.slip.map_or(0.0, |slip| slip.mu)
    }

    pub(super) fn error(&self) -> f64 {
        self.residual.iter().map(|r| r * r).sum::<f64>().sqrt()
    }
}

/// Residual at which a state is a solution, but for rounding.
const SOLVED: f64 = 1e-9;
/// Residual at which Newton's method is content; its last step has mostly gone far beyond.
const ENOUGH: f64 = 1e-13;
/// Newton steps at most.
const STEPS: u32 = 40;
/// First step of a branch on which what the tilt moves grows.
const FIRST: f64 = 0.25;
/// Points of the scan over the tilt: along a line, and rays by rings in the plane.
const LINE: usize = 48;
const RAYS: usize = 16;
const RINGS: usize = 7;
/// Tilt \[rad\] beyond which nothing is looked for: the equations are those of small angles.
const FARTHEST: f64 = 1.0;

impl<'a> Problem<'a> {
    /// `(a1, a2)` for angles in their units: compression is `delta - h +- a . x`.
    pub(super) fn tilt(&self, angles: &[f64]) -> DVec2 {
        let turn: DVec2 =
            self.held.iter().zip(&self.units).zip(angles).map(|((e, u), x)| *u * *x * *e).sum();
        DVec2::new(-turn.y, turn.x)
    }

    /// The angles in their units for `(a1, a2)`: what turns about other axes is left out.
    pub(super) fn angles(&self, tilt: DVec2) -> Vec<f64> {
        let turn = DVec2::new(tilt.y, -tilt.x);
        self.held.iter().zip(&self.units).map(|(e, u)| e.dot(turn) / u).collect()
    }

    /// The load along the space's motions: what comes from outside and what the pressure brings, whose
    /// moment in the pad plane with that from outside is `moment`.
    pub(super) fn along(&self, faces: [&Pressed<'_>; 2], moment: DVec2) -> Vector5<f64> {
        let Wrench { force, moment: outer } = self.wrench;
        let (tilted, _) = self.moved_of(faces);
        let push = tilted.xy() - Vector2::from((faces[0].slope + faces[1].slope).to_array());
        let turn = tilted.z + faces[0].turn + faces[1].turn;
        let mut w = Vector5::new(force.x + push.x, force.y + push.y, outer.z + turn, 0.0, 0.0);
        for (i, e) in self.space.spins.iter().enumerate() {
            w[3 + i] = e.dot(moment);
        }
        // What is left of a cancellation is no load.
        let size = (self.normal[0] + self.normal[1])
            .max(force.length())
            .max(outer.length() / self.distance.abs());
        let (length, lever) = (slip::length(faces), self.distance.abs());
        let rounding = 4.0 * f64::EPSILON * size;
        let scales = [1.0, 1.0, length, lever, lever];
        for (load, scale) in w.iter_mut().zip(scales) {
            if load.abs() <= rounding * scale {
                *load = 0.0;
            }
        }
        w
    }

    /// What pressures bring, linear in what they carry: force along the pads and moment about the
    /// closing axis, and the moment in the pad plane.
    pub(super) fn brought(&self, one: &Carried, two: &Carried) -> (Vector3<f64>, DVec2) {
        let half = 0.5 * self.distance;
        let lever = |c: &Carried| DVec2::new(c[1] - half * c[3], c[2] - half * c[4]);
        let slide = Vector3::new(-one[3] - two[3], -one[4] - two[4], one[5] + two[5]);
        (slide, (lever(one) - lever(two)).perp())
    }

    /// The force along the pads with the moment about the closing axis, and the moment in the pad plane,
    /// that the tilt brings by what it moves, if that counts.
    pub(super) fn moved(&self, moved: &Moved) -> (Vector3<f64>, DVec2) {
        if self.moves == 0.0 {
            return (Vector3::zeros(), DVec2::ZERO);
        }
        let [rest, rolled] = [3, 5].map(|i| DVec2::new(moved[i], moved[i + 1]));
        // The pads press where the surface is highest then: its centre of curvature goes with the body.
        let mut moment = (rolled - 0.5 * self.distance * rest).perp();
        for (e, rolling) in self.held.iter().zip(&self.rolling) {
            // There it is in the stiffness.
            if *rolling != 0.0 {
                moment -= e.dot(moment) * *e;
            }
        }
        (self.moves * moved.xyz(), self.moves * moment)
    }

    /// The same of both faces.
    pub(super) fn moved_of(&self, faces: [&Pressed<'_>; 2]) -> (Vector3<f64>, DVec2) {
        self.moved(&(faces[0].moved + faces[1].moved))
    }

    /// The moment in the pad plane that the pressure leaves over.
    pub(super) fn moment_beyond(&self, faces: [&Pressed<'_>; 2]) -> DVec2 {
        let (_, moment) = self.brought(&faces[0].carried(), &faces[1].carried());
        let (_, rolled) = self.moved_of(faces);
        self.wrench.moment.truncate() + moment + rolled
    }

    /// The state at a tilt. `coupling`: share of the friction's lever `d/2` that counts; zero needs
    /// no slip.
    pub(super) fn at(
        &self,
        angles: &[f64],
        coupling: f64,
        near: Option<&State<'_>>,
    ) -> Option<State<'a>> {
        let tilt = self.tilt(angles);
        let start = |k: usize| near.map(|state| state.faces[k].delta);
        let one = self.faces[0].carry(self.normal[0], tilt, start(0))?;
        let two = self.faces[1].carry(self.normal[1], tilt, start(1))?;
        let half = 0.5 * self.distance;
        let moment = self.moment_beyond([&one, &two]);
        let faces = [&one, &two];
        let (slip, left) = if coupling == 0.0 {
            (None, moment)
        } else {
            let w = self.along(faces, moment);
            let near = near.and_then(|state| state.slip).map(|slip| (slip.zeta, slip.rolls_on));
            let slip = slip::solve(&self.space, faces, self.distance, w, near)?;
            let couple = slip.shares[0] - slip.shares[1];
            (Some(slip), moment + coupling * half * DVec2::new(couple.y, -couple.x))
        };
        let residual = (0..self.held.len())
            .map(|i| {
                let back = self.rolling[i] * self.units[i] * angles[i];
                (self.held[i].dot(left) - back) / self.moment
            })
            .collect();
        Some(State { angles: angles.to_vec(), faces: [one, two], slip, residual })
    }

    /// Newton's method on the tilt, from a state.
    pub(super) fn newton(&self, start: State<'a>, coupling: f64) -> Option<State<'a>> {
        let n = self.held.len();
        let mut state = start;
        let mut stuck = 0;
        for _ in 0..STEPS {
            if n == 0 || state.error() <= ENOUGH {
                break;
            }
            let Some(step) = self.step(&state, coupling) else { break };
            if step.iter().any(|x| !x.is_finite()) {
                break;
            }
            // A step of many times the compression is cut: the pressure is another one there.
            let longest = step.iter().map(|x| x.abs()).fold(0.0, f64::max);
            let reach = 2.0 * (1.0 + state.angles.iter().map(|x| x.abs()).fold(0.0, f64::max));
            let mut t = (reach / longest).min(1.0);
            let mut next = None;
            for _ in 0..16 {
                let angles: Vec<f64> =
                    state.angles.iter().zip(&step).map(|(a, s)| a + t * s).collect();
                if let Some(tried) = self.at(&angles, coupling, Some(&state))
                    && tried.error() < (1.0 - 1e-4 * t) * state.error()
                {
                    next = Some(tried);
                    break;
                }
                t *= 0.5;
            }
            match next {
                Some(next) => {
                    stuck = if next.error() > 0.5 * state.error() { stuck + 1 } else { 0 };
                    state = next;
                }
                None => break,
            }
            if stuck > 8 {
                break;
            }
        }
        (state.error() <= SOLVED).then_some(state)
    }

    /// Newton's step of the tilt.
    fn step(&self, state: &State<'a>, coupling: f64) -> Option<Vec<f64>> {
        let faces = [&state.faces[0], &state.faces[1]];
        let joint = Joint::new(self, &Near::new(faces)).coupled(coupling);
        let mut place = Place::new(faces);
        place.angles[..state.angles.len()].copy_from_slice(&state.angles);
        let mut mu = 1.0;
        if let Some(slip) = state.slip.as_ref().filter(|slip| slip.mu > 0.0) {
            let w = self.along(faces, self.moment_beyond(faces));
            place.mode = slip.rolls_on.map_or(Mode::Slips, Mode::Rolls);
            (place.motion, mu) = (joint.motion(slip, &w), slip.mu);
        }
        let step = joint.turn(&place, mu, &state.residual)?;
        Some(step[..self.held.len()].to_vec())
    }

    /// The state next to that without friction's lever, all unknowns at once, from the `pressed`
    /// faces without tilt; `None` where that does not succeed.
    pub(super) fn direct(&self, pressed: [&Pressed<'_>; 2]) -> Option<State<'a>> {
        if self.held.is_empty() {
            return None;
        }
        let joint = Joint::new(self, &Near::new(pressed));
        let solved = |place: &Place| match joint.newton(place, 0.0)? {
            Reached::Solution(found) => Some(found),
            Reached::Below(..) => None,
        };
        let start = Place::new(pressed);
        let still = solved(&start)?;
        let Place { angles, delta, .. } = still.place;
        let faces = still.pressed(self.normal);
        let faces = [&faces[0], &faces[1]];
        let w = self.along(faces, self.moment_beyond(faces));
        let slip = slip::solve(&self.space, faces, self.distance, w, None)?;
        if slip.mu == 0.0 {
            return None;
        }
        let mode = slip.rolls_on.map_or(Mode::Slips, Mode::Rolls);
        let found = solved(&Place { mode, motion: joint.motion(&slip, &w), angles, delta })?;
        let Place { motion, angles, .. } = found.place;
        let angles = angles[..self.held.len()].to_vec();
        let zeta = if mode == Mode::Slips { motion } else { slip.zeta };
        let slip = Some(Slipping { zeta, ..slip });
        let faces = found.pressed(self.normal);
        let near = State { angles, faces, slip, residual: Vec::new() };
        let state = self.at(&near.angles, 1.0, Some(&near))?;
        if state.error() <= ENOUGH { Some(state) } else { self.newton(state, 1.0) }
    }

    /// The state on the branch from `d = 0`: friction's lever grows from nothing, and with it what the tilt
    /// moves.
    pub(super) fn branch(&self) -> Option<State<'a>> {
        let still = vec![0.0; self.held.len()];
        let grown = |share: f64| Problem { moves: share * self.moves, ..self.clone() };
        let none = grown(0.0);
        let mut state = none.newton(none.at(&still, 0.0, None)?, 0.0)?;
        let (mut done, mut step) = (0.0, if self.moves > 0.0 { FIRST } else { 1.0 });
        while done < 1.0 {
            let next: f64 = f64::min(done + step, 1.0);
            let problem = grown(next);
            let moved = problem
                .at(&state.angles, next, Some(&state))
                .and_then(|start| problem.newton(start, next));
            match moved {
                Some(found) => (state, done) = (found, next),
                None if step > 0.02 => step *= 0.25,
                None => return None,
            }
        }
        Some(state)
    }

    /// Other states: Newton's method from the lowest places of a scan over all tilts; `known` is
    /// among the answers. The second value: whether anything could be evaluated at all.
    pub(super) fn scan(&self, known: Option<State<'a>>) -> (Vec<State<'a>>, bool) {
        let mut found: Vec<State<'a>> = known.into_iter().collect();
        let mut any = !found.is_empty();
        let stretch = |rho: f64| 3.0 * rho / (1.0 - rho);
        let is_near = |angles: &[f64]| self.tilt(angles).length() <= FARTHEST;
        let mut take = |state: State<'a>| {
            if !is_near(&state.angles) {
                return;
            }
            let same = |other: &State<'a>| {
                let size = 1.0 + state.angles.iter().map(|x| x.abs()).fold(0.0, f64::max);
                state.angles.iter().zip(&other.angles).all(|(a, b)| (a - b).abs() < 1e-5 * size)
            };
            if !found.iter().any(same) {
                found.push(state);
            }
        };
        if self.held.len() == 1 {
            let mut before: Option<State<'a>> = None;
            for i in 0..=2 * LINE {
                let rho = (i as f64 / LINE as f64 - 1.0) * 0.97;
                let angle = stretch(rho.abs()).copysign(rho);
                if !is_near(&[angle]) {
                    continue;
                }
                let here = self.at(&[angle], 1.0, before.as_ref());
                any |= here.is_some();
                if let (Some(one), Some(two)) = (&before, &here)
                    && one.residual[0] * two.residual[0] <= 0.0
                    && let Some(state) = self.between(one.clone(), two.clone())
                {
                    take(state);
                }
                before = here;
            }
        } else if self.held.len() == 2 {
            let middle = self.at(&[0.0; 2], 1.0, None);
            let rays: Vec<Vec<Option<State<'a>>>> = (0..RAYS)
                .map(|ray| {
                    let e = DVec2::from_angle(std::f64::consts::TAU * ray as f64 / RAYS as f64);
                    let mut nodes = vec![middle.clone()];
                    for ring in 1..=RINGS {
                        let x = stretch(0.95 * ring as f64 / RINGS as f64) * e;
                        if !is_near(&[x.x, x.y]) {
                            break;
                        }
                        nodes.push(self.at(&[x.x, x.y], 1.0, nodes[ring - 1].as_ref()));
                    }
                    nodes
                })
                .collect();
            any |= rays.iter().flatten().any(Option::is_some);
            // From other places Newton's method ends where it does from these.
            for node in lowest(&rays) {
                if let Some(state) = self.newton(node.clone(), 1.0) {
                    take(state);
                }
            }
        }
        let mu = |state: &State<'_>| state.slip.map_or(f64::INFINITY, |slip| slip.mu);
        found.sort_by(|a, b| mu(a).total_cmp(&mu(b)));
        (found, any)
    }

    /// A zero between two tilts of different sign.
    fn between(&self, mut one: State<'a>, mut two: State<'a>) -> Option<State<'a>> {
        for _ in 0..60 {
            if let Some(state) = self.newton(one.clone(), 1.0)
                && state.angles[0] >= one.angles[0].min(two.angles[0])
                && state.angles[0] <= one.angles[0].max(two.angles[0])
            {
                return Some(state);
            }
            let middle = self.at(&[0.5 * (one.angles[0] + two.angles[0])], 1.0, Some(&one))?;
            if middle.residual[0] * one.residual[0] > 0.0 { one = middle } else { two = middle }
        }
        None
    }
}

/// Of rays of nodes with a common first one, those whose error is no greater than their neighbours'.
fn lowest<'s, 'a>(rays: &'s [Vec<Option<State<'a>>>]) -> Vec<&'s State<'a>> {
    let error = |ray: usize, ring: usize| {
        rays[ray % rays.len()].get(ring)?.as_ref().map(|state| state.error())
    };
    let mut lowest = Vec::new();
    for (ray, nodes) in rays.iter().enumerate() {
        for (ring, state) in nodes.iter().enumerate() {
            let Some(state) = state else { continue };
            let beside: Vec<Option<f64>> = match ring {
                0 if ray > 0 => continue,
                0 => (0..rays.len()).map(|other| error(other, 1)).collect(),
                _ => vec![
                    error(ray, ring - 1),
                    error(ray, ring + 1),
                    error(ray + 1, ring),
                    error(ray + rays.len() - 1, ring),
                ],
            };
            if beside.into_iter().flatten().all(|other| other >= state.error()) {
                lowest.push(state);
            }
        }
    }
    lowest
}

//! The limit state of one load: which rotations are free, tilt and slip there, and what to know beside.

use glam::DVec2;
use nalgebra::Vector5;

use super::equilibrium::{Problem, State};
use super::face::{Face, Pressed};
use super::slip::{self, Slipping, Space};
use super::space::{Kind, Rotation};
use super::{Answer, FaceAnswer, LARGE_TILT, Note, Pads, SoftLimit};
use crate::mechanics::{COUPLING_SEARCH, refused};
use crate::model::{Face as Side, Score, Slip, Status, Wrench};

/// Share of `mu_s` by which what the tilt moves changes it from which on it is told: where it is left out,
/// and where it counts.
const TOLD: [f64; 2] = [1e-3, 1e-2];

/// Push across the axis of a part that can spin, over the normal forces, from which
/// [`Note::OverEdge`] is given.
const OVER_EDGE: f64 = 1e-3;

/// A case with what is known of it before any slip.
pub(super) struct Case<'a, 'c> {
    pub(super) faces: &'a [Face; 2],
    /// Without tilt.
    pub(super) pressed: [&'c Pressed<'a>; 2],
    pub(super) distance: f64,
    pub(super) normal: [f64; 2],
    pub(super) wrench: &'c Wrench,
    pub(super) rotations: [Rotation; 2],
    pub(super) asked: Asked,
    /// Where to look for the limit state, and nowhere else.
    pub(super) near: Option<&'c Limit<'a>>,
}

/// What a case came to.
pub(super) struct Limit<'a> {
    problem: Problem<'a>,
    status: Status,
    state: Option<State<'a>>,
    notes: Vec<Note>,
}

/// What is to be found besides the first limit state.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked {
    /// Further limit states where there may be some: that decides only whether the status is
    /// ambiguous, and what is found where the first way leads nowhere.
    pub(super) others: bool,
    /// What to know of the answer.
    pub(super) notes: bool,
    /// That what the tilt moves counts.
    pub(super) moves: bool,
}

impl Asked {
    pub(super) const ALL: Self = Self { others: true, notes: true, moves: false };
    pub(super) const SCORE: Self = Self { others: true, notes: false, moves: true };
    pub(super) const FIRST: Self = Self { others: false, notes: false, moves: true };
}

/// Lever of a stiffness over the distance of the faces below which it is none.
pub(super) const NO_LEVER: f64 = 1e-6;
/// Lever of the normal force by which a face falls short of the other's axis, over the distance of the pads,
/// from which on it is told: rounding of a file and fits to its corners make less.
const ROLLS: f64 = 1e-3;
/// Difference in what two pieces feel of a tilt that is rounding.
const FELT: f64 = 1e-9;

impl<'a> Case<'a, '_> {
    pub(super) fn solve(&self) -> Answer {
        self.finish(self.limit())
    }

    /// With the rotations free that are free in any case, and those that turn out to be.
    pub(super) fn limit(&self) -> Limit<'a> {
        let force = 0.5 * (self.normal[0] + self.normal[1]);
        let none = NO_LEVER * force * self.distance.abs();
        let mut notes = Vec::new();
        let mut free = self.rotations.map(|rotation| match rotation.kind {
            Kind::Free => true,
            Kind::Facets(facets) => {
                if facets < 16.5 {
                    notes.push(Note::FacetedOrRound { facets });
                }
                true
            }
            Kind::Nearly(stiffness) => {
                if stiffness < -ROLLS * force * self.distance.abs() {
                    notes.push(Note::Unstable { stiffness });
                }
                stiffness <= none
            }
            Kind::Held => false,
        });
        loop {
            let problem = self.problem(free);
            let (status, state) = match self.near {
                Some(near) => match near.next(&problem, self.pressed) {
                    Some(state) => (Status::Ok, Some(state)),
                    None => (Status::TwistedOut, None),
                },
                None => find(&problem, self.pressed, self.asked.others),
            };
            // A round part that turns by more than the layers give is free to turn.
            let mut settles = None;
            for i in 0..2 {
                let Rotation { axis, kind: Kind::Nearly(stiffness) } = self.rotations[i] else {
                    continue;
                };
                if free[i] {
                    continue;
                }
                let angle = match &state {
                    Some(state) => {
                        let tilt = problem.tilt(&state.angles);
                        axis.dot(DVec2::new(tilt.y, -tilt.x)).abs()
                    }
                    None => axis.dot(problem.moment_beyond(self.pressed)).abs() / stiffness,
                };
                let give = 0.5 * (self.pressed[0].compression() + self.pressed[1].compression());
                if 0.5 * self.distance.abs() * angle > give {
                    settles = Some((i, angle));
                }
            }
            match settles {
                Some((i, angle)) => {
                    free[i] = true;
                    notes.push(Note::SettlesBy { angle });
                }
                None => {
                    if self.asked.notes && problem.rolls {
                        notes.extend(self.told(&problem, &state));
                    }
                    return Limit { problem, status, state, notes };
                }
            }
        }
    }

    /// What comes of the tilt if what it moves counts, or does not, other than in the problem: told where
    /// that changes much.
    fn told(&self, problem: &Problem<'a>, state: &Option<State<'a>>) -> Option<Note> {
        let counts = problem.moves > 0.0;
        let other = Problem { moves: 1.0 - problem.moves, ..problem.clone() };
        let there = find(&other, self.pressed, false).1;
        let mu = |state: &Option<State<'_>>| Some(state.as_ref()?.slip?.mu);
        let (mine, theirs) = (mu(state), mu(&there));
        let share = TOLD[usize::from(counts)];
        if match (mine, theirs) {
            (Some(a), Some(b)) => (a - b).abs() <= share * a.max(b),
            (None, None) => true,
            _ => false,
        } {
            return None;
        }
        let tilted = if counts { state } else { &there };
        let force = tilted
            .as_ref()
            .map_or([0.0; 2], |state| (state.faces[0].moved + state.faces[1].moved).xy().into());
        Some(if counts {
            Note::TiltPushesMuch { force, without: theirs }
        } else {
            Note::TiltPushes { force, mu_s: theirs }
        })
    }

    pub(super) fn problem(&self, free: [bool; 2]) -> Problem<'a> {
        let axes = |wanted: bool| -> Vec<DVec2> {
            (0..2).filter(|&i| free[i] == wanted).map(|i| self.rotations[i].axis).collect()
        };
        let held = axes(false);
        let rolling = (0..2)
            .filter(|&i| !free[i])
            .map(|i| match self.rotations[i].kind {
                Kind::Nearly(stiffness) => stiffness,
                _ => 0.0,
            })
            .collect();
        let widths: Vec<f64> = held
            .iter()
            .map(|e| {
                let width = self.pressed.map(|face| {
                    let [low, high] = face.extent_along(e.perp());
                    high - low
                });
                width[0].max(width[1])
            })
            .collect();
        let give = self.pressed[0].compression().max(self.pressed[1].compression());
        let units = widths.iter().map(|width| 2.0 * give / width).collect();
        let length = slip::length(self.pressed);
        let fields = || self.faces.iter().flat_map(|face| &face.fields);
        // Where all of both faces turns with the body, or none, what it moves cancels.
        let rolls = held.iter().any(|e| {
            let felt = fields().map(|field| field.felt(e.perp()).length());
            let (least, most) = felt.fold((1.0, 0.0), |(a, b): (f64, f64), f| (a.min(f), b.max(f)));
            most - least > FELT
        });
        Problem {
            rolls,
            moves: if rolls && self.asked.moves { 1.0 } else { 0.0 },
            faces: [&self.faces[0], &self.faces[1]],
            distance: self.distance,
            normal: self.normal,
            wrench: *self.wrench,
            space: Space { spins: axes(true) },
            held,
            rolling,
            units,
            widths,
            moment: (self.normal[0] + self.normal[1]) * length,
        }
    }

    fn finish(&self, limit: Limit<'_>) -> Answer {
        let Limit { ref problem, status, ref state, mut notes } = limit;
        let dimensions = problem.space.dimensions() as u8;
        let (Some(state), Some(slipping)) = (state, state.as_ref().and_then(|s| s.slip)) else {
            let mut answer = no_answer(status);
            (answer.dimensions, answer.notes) = (dimensions, notes);
            return answer;
        };
        let tilt = problem.tilt(&state.angles);
        if self.asked.notes {
            self.note(problem, state, &mut notes);
        }
        let motion = motion(&problem.space, &slipping);
        Answer {
            score: Score {
                status,
                mu_s: Some(slipping.mu),
                slip: Some(describe(&motion, &slipping)),
                pressure: None,
                contact_area_i: state.faces[0].area,
                contact_area_ii: state.faces[1].area,
                residual: state.error(),
                bounds: Some(slipping.bounds),
                evaluations: slipping.evaluations,
            },
            dimensions,
            motion: Some(motion),
            tilt: Some([tilt.x + 0.0, tilt.y + 0.0]),
            faces: Some([0, 1].map(|k| face_answer(&state.faces[k], &slipping, k))),
            notes,
        }
    }

    /// Notes on a limit state.
    fn note(&self, problem: &Problem<'_>, state: &State<'_>, notes: &mut Vec<Note>) {
        let tilt = problem.tilt(&state.angles);
        let give = 0.5 * (self.pressed[0].compression() + self.pressed[1].compression());
        let angle = tilt.length();
        let slip = 0.5 * self.distance.abs() * angle;
        if slip > give {
            notes.push(Note::TiltsFirst { angle, slip });
        }
        for axis in &problem.space.spins {
            let push = -axis.perp().dot(state.faces[0].slope + state.faces[1].slope);
            if push.abs() > OVER_EDGE * (self.normal[0] + self.normal[1]) {
                notes.push(Note::OverEdge { force: push });
            }
        }
    }

    /// Notes on pads too soft for the theory.
    pub(super) fn softness(&self, pads: &Pads, answer: &Answer) -> Vec<Note> {
        let mut notes = Vec::new();
        for (k, face) in [Side::I, Side::II].into_iter().enumerate() {
            if answer.faces.is_none() {
                continue;
            }
            let pressed = self.pressed[k];
            let delta = pressed.compression();
            let mut note = |limit, value| notes.push(Note::TooSoft { face, limit, value });
            if let Some(layer) = pads.layer
                && delta > layer / 3.0
            {
                note(SoftLimit::Compression, delta / layer);
            }
            let Some(radius) = pads.radii[k] else { continue };
            // The half width that a round piece of this compression has.
            let half = (2.0 * radius * delta).sqrt();
            if half > 0.4 * radius {
                note(SoftLimit::Width, half / radius);
            }
            if let Some(layer) = pads.layer
                && half < layer
            {
                note(SoftLimit::Thickness, half / layer);
            }
        }
        notes
    }
}

impl<'a> Limit<'a> {
    /// The limit state of nearly the same problem that is next to this one; where other rotations are free,
    /// that on the branch from `d = 0`.
    fn next(&self, problem: &Problem<'a>, pressed: [&Pressed<'_>; 2]) -> Option<State<'a>> {
        if self.problem.held.len() != problem.held.len() {
            return first(problem, pressed);
        }
        let state = self.state.as_ref()?;
        let angles = problem.angles(self.problem.tilt(&state.angles));
        problem.newton(problem.at(&angles, 1.0, Some(state))?, 1.0)
    }

    /// `mu_s`; `None` where there is no limit state.
    pub(super) fn mu(&self) -> Option<f64> {
        Some(self.state.as_ref()?.slip?.mu)
    }
}

/// Whether the part tilts so far that what it moves may hold it in another limit state than that on the
/// branch from `d = 0`.
pub(super) fn tilts_far(problem: &Problem<'_>, angles: &[f64]) -> bool {
    problem.moves > 0.0 && problem.tilt(angles).length() > LARGE_TILT
}

/// Whether friction's lever is so long that there may be further limit states.
pub(super) fn strong(problem: &Problem<'_>, mu: f64) -> bool {
    let width = problem.widths.iter().copied().fold(f64::INFINITY, f64::min);
    mu * problem.distance.abs() > COUPLING_SEARCH * width
}

/// The limit state on the branch from `d = 0`.
fn first<'a>(problem: &Problem<'a>, pressed: [&Pressed<'_>; 2]) -> Option<State<'a>> {
    let is_near = |state: &State<'_>| {
        !strong(problem, state.friction()) && !tilts_far(problem, &state.angles)
    };
    problem.direct(pressed).filter(is_near).or_else(|| problem.branch())
}

/// The limit state of a problem, and its status.
fn find<'a>(
    problem: &Problem<'a>,
    pressed: [&Pressed<'_>; 2],
    search: bool,
) -> (Status, Option<State<'a>>) {
    let strong = |state: &State<'_>| strong(problem, state.friction());
    match first(problem, pressed) {
        Some(state) if problem.held.is_empty() || !search || !strong(&state) => {
            (Status::Ok, Some(state))
        }
        branch => {
            let (states, any) = problem.scan(branch.clone());
            match (states.len(), branch) {
                (0, _) if any => (Status::TwistedOut, None),
                (0, _) => (Status::NotConverged, None),
                (1, _) => (Status::Ok, states.into_iter().next()),
                (_, Some(state)) => (Status::Ambiguous, Some(state)),
                (_, None) => (Status::Ambiguous, states.into_iter().next()),
            }
        }
    }
}

pub(super) fn no_answer(status: Status) -> Answer {
    Answer {
        score: refused(status, 0),
        dimensions: 3,
        motion: None,
        tilt: None,
        faces: None,
        notes: Vec::new(),
    }
}

/// `(u1, u2, omega3, omega1, omega2)`, the largest part 1.
fn motion(space: &Space, slipping: &Slipping) -> [f64; 5] {
    let zeta: &Vector5<f64> = &slipping.zeta;
    let spin: DVec2 = space.spins.iter().enumerate().map(|(i, e)| zeta[3 + i] * *e).sum();
    let parts = [zeta[0], zeta[1], zeta[2], spin.x, spin.y];
    let most = parts.iter().map(|x| x.abs()).fold(0.0, f64::max);
    parts.map(|x| if most > 0.0 { x / most } else { 0.0 })
}

/// Share of the spin below which a motion counts as none.
const NO_SPIN: f64 = 1e-9;

fn describe(motion: &[f64; 5], slipping: &Slipping) -> Slip {
    let [u1, u2, omega, s1, s2] = *motion;
    if slipping.mu == 0.0 || motion.iter().all(|x| *x == 0.0) {
        return Slip::None;
    }
    if s1.hypot(s2) > NO_SPIN {
        let rolls_on = slipping.rolls_on.map(|k| if k == 0 { Side::I } else { Side::II });
        return Slip::Spin { omega: [s1, s2, omega], velocity: [u1, u2], rolls_on };
    }
    if omega.abs() > NO_SPIN * u1.hypot(u2) {
        return Slip::Rotation {
            c: [-u2 / omega + 0.0, u1 / omega + 0.0],
            sense: if omega > 0.0 { 1 } else { -1 },
        };
    }
    let speed = u1.hypot(u2);
    Slip::Translation { direction: [u1 / speed, u2 / speed] }
}

fn face_answer(face: &Pressed<'_>, slipping: &Slipping, k: usize) -> FaceAnswer {
    FaceAnswer {
        load: face.load,
        delta: face.delta,
        area: face.area,
        mean_pressure: face.load / face.area,
        greatest_pressure: face.greatest(),
        compression: face.compression(),
        extent: face.extent().map(|x| x.to_array()),
        share: slipping.shares[k].into(),
    }
}

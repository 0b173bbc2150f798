//! Contacts that are curved, drafted or stepped: pieces of surface with gaps under soft flat pads.
//!
//! The pressure is `k (delta - h + tilt)` where that is positive; it acts along the surface's
//! normal, so that a slope of the gap moves its lever (`xi = x - (d/2) grad h` in (6)(7)) and
//! pushes along the pad (`-p grad h` in (3)(4)). A part that is round about an axis on both faces
//! can spin about it, which friction alone resists: the slip problem then has four or five
//! dimensions. `docs/curved.md` says what is solved and what is neglected.

mod equilibrium;
mod face;
mod floor;
mod inverse;
mod joint;
mod note;
mod screen;
mod slip;
mod space;
mod turning;

use std::sync::OnceLock;

use glam::DVec2;
use nalgebra::Vector5;
use serde::{Deserialize, Serialize};

use crate::contact::quadric::Quadratic;
use crate::contact::surface::{Field, Piece, Surfaces};
use crate::error::{Error, Result};
use crate::model::{Face as Side, Score, Slip, Status, Wrench, check_area};

use super::{COUPLING_SEARCH, refused};
use equilibrium::{Problem, Push, State};
use face::{Face, Pressed};
pub use inverse::force_needed;
pub use note::{Note, SoftLimit};
pub use screen::{Compared, Screen};
use slip::{Slipping, Space};
use space::{Kind, Rotation};

/// What one face carries at the limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FaceAnswer {
    /// Normal force \[N\].
    pub load: f64,
    /// Compression of the layer at the origin of the pad plane \[m\].
    pub delta: f64,
    /// Pressed area [m^2].
    pub area: f64,
    /// Mean pressure \[Pa\].
    pub mean_pressure: f64,
    /// Greatest pressure \[Pa\].
    pub greatest_pressure: f64,
    /// Greatest compression of the layer \[m\].
    #[serde(default)]
    pub compression: f64,
    /// Smallest box around what is pressed: its lower and upper corner in `(x1, x2)` \[m\].
    pub extent: [[f64; 2]; 2],
    /// What the face carries by friction: force along `x1`, `x2` \[N\] and moment about `x3` [N m].
    pub share: [f64; 3],
}

/// Change of `mu_s` from which [`Note::TiltPushes`] is given.
const TILTING_PUSH: f64 = 1e-3;

/// Rise of `mu_s`, as a share and by itself, from which the push of tilted planes is counted.
const COUNTS: (f64, f64) = (0.01, 1e-4);

/// Factor on what the push raises `mu_s` by at the tilt without it, that covers what it changes of it.
const SURELY: f64 = 2.0;

/// Solutions at most until that push and the tilt agree, and the share of the normal forces at which
/// they do.
const PUSHES: u32 = 40;
const AGREED: f64 = 1e-12;

/// Push across the axis of a part that can spin, over the normal forces, from which
/// [`Note::OverEdge`] is given.
const OVER_EDGE: f64 = 1e-3;

/// The answer for one contact of [`Surfaces`] and one load.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// Status, `mu_s`, certificate, as for planes; there are no pressure planes.
    #[serde(flatten)]
    pub score: Score,
    /// Dimensions of the slip problem: 3, 4 or 5.
    pub dimensions: u8,
    /// Incipient motion `(u1, u2, omega3, omega1, omega2)` of the point midway between the faces,
    /// the largest part 1 in m/s and rad/s.
    pub motion: Option<[f64; 5]>,
    /// Tilt of the body `(a1, a2)` \[rad\]: compression is `delta - h + a . x` on face I and `delta -
    /// h - a . x` on face II.
    pub tilt: Option<[f64; 2]>,
    /// Both faces.
    pub faces: Option<[FaceAnswer; 2]>,
    /// What to know beside.
    pub notes: Vec<Note>,
}

/// Smallest friction coefficient that holds `wrench` (about the grip origin) in a grip on these
/// surfaces, squeezed with `force` \[N\]. `distance` \[m\] is the height of face I's pad plane over
/// that of face II, negative for a grip from inside.
///
/// # Errors
/// When a number is not finite, `force` or a stiffness is not positive, or a gap is not a surface.
/// A hard case is a [`Status`].
pub fn solve(surfaces: &Surfaces, distance: f64, force: f64, wrench: &Wrench) -> Result<Answer> {
    check(surfaces, distance, force, wrench)?;
    Ok(Pads::ready(surfaces).solve(distance, force, wrench))
}

/// Both faces of a contact made ready for many loads.
#[derive(Debug, Clone)]
pub struct Pads {
    faces: [Face; 2],
    /// Smallest radius of the round pieces of each face, and the layer's thickness, for notes.
    radii: [Option<f64>; 2],
    layer: Option<f64>,
    /// Of the squeeze that was asked for first: its force, the distance, and what it says.
    squeezed: OnceLock<(f64, f64, [Rotation; 2])>,
}

/// A face pressed without a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Squeezed {
    /// Compression of the layer at the origin of the pad plane: pieces are pressed where their gap
    /// is less \[m\].
    pub delta: f64,
    /// Pressed area [m^2].
    pub area: f64,
    /// Mean pressure \[Pa\].
    pub mean_pressure: f64,
    /// Greatest pressure \[Pa\].
    pub greatest_pressure: f64,
}

impl Pads {
    /// From the pieces of both faces.
    ///
    /// # Errors
    /// As [`solve`].
    pub fn new(surfaces: &Surfaces) -> Result<Self> {
        check(surfaces, 0.0, 1.0, &Wrench::default())?;
        Ok(Self::ready(surfaces))
    }

    fn ready(surfaces: &Surfaces) -> Self {
        let pieces: [&[Piece]; 2] = [&surfaces.face_i, &surfaces.face_ii];
        let radius = |pieces: &[Piece]| {
            pieces.iter().filter_map(|piece| piece.gap.radius()).map(f64::abs).reduce(f64::min)
        };
        Self {
            faces: [
                Face::new(pieces[0], surfaces.stiffness[0], 1.0),
                Face::new(pieces[1], surfaces.stiffness[1], -1.0),
            ],
            radii: pieces.map(radius),
            layer: surfaces.layer,
            squeezed: OnceLock::new(),
        }
    }

    /// [`space::rotations`] under a squeeze with `force` \[N\] that presses the faces like this.
    fn rotations(&self, pressed: &[Pressed<'_>; 2], distance: f64, force: f64) -> [Rotation; 2] {
        let found = || space::rotations([&pressed[0], &pressed[1]], distance);
        let &(known_force, known_distance, known) =
            self.squeezed.get_or_init(|| (force, distance, found()));
        if known_force == force && known_distance == distance { known } else { found() }
    }

    /// Whether each face is one piece of a cylinder or a sphere: what is free under one squeeze is so
    /// under all.
    fn plainly_round(&self) -> bool {
        let round = |field: &Field| {
            let Quadratic { g, l, .. } = field.gap;
            g == DVec2::ZERO && l != DVec2::ZERO && (l.x == 0.0 || l.y == 0.0 || l.x == l.y)
        };
        self.faces.iter().all(|face| matches!(&face.fields[..], [field] if round(field)))
    }

    /// Distance of the farthest corner of the pieces from the grip origin \[m\].
    pub fn reach(&self) -> f64 {
        self.faces[0].reach().max(self.faces[1].reach())
    }

    /// As [`solve`]; numbers must be finite and `force` positive.
    pub fn solve(&self, distance: f64, force: f64, wrench: &Wrench) -> Answer {
        self.answer(distance, force, wrench, Asked::ALL)
    }

    /// As [`Self::solve`] with the push of tilted planes where that raises `mu_s` by over a hundredth,
    /// as grips are ranked: the theory of [`solve`] leaves it out.
    pub fn solve_pushed(&self, distance: f64, force: f64, wrench: &Wrench) -> Answer {
        self.answer(distance, force, wrench, Asked { push: true, ..Asked::ALL })
    }

    /// As [`Self::solve_pushed`] for a load whose status is known: where that is `ok` there is no other limit
    /// state to look for.
    pub(crate) fn solve_again(
        &self,
        distance: f64,
        force: f64,
        wrench: &Wrench,
        status: Status,
    ) -> Answer {
        self.answer(
            distance,
            force,
            wrench,
            Asked { others: status != Status::Ok, notes: true, push: true },
        )
    }

    /// As [`Self::solve_pushed`] without notes.
    pub fn score(&self, distance: f64, force: f64, wrench: &Wrench) -> Score {
        self.answer(distance, force, wrench, Asked::SCORE).score
    }

    fn answer(&self, distance: f64, force: f64, wrench: &Wrench, asked: Asked) -> Answer {
        if self.faces.iter().any(|face| face.fields.is_empty()) {
            return no_answer(Status::NoContact);
        }
        let normal = [force + 0.5 * wrench.force.z, force - 0.5 * wrench.force.z];
        if normal.iter().any(|n| *n <= 0.0) {
            return no_answer(Status::NoNormalForce);
        }
        let pressed = [0, 1].map(|k| self.faces[k].carry(normal[k], DVec2::ZERO, None));
        let [Some(one), Some(two)] = &pressed else { return no_answer(Status::NotConverged) };
        let rotations = space::rotations([one, two], distance);
        let faces = &self.faces;
        let case = Case { faces, pressed: [one, two], distance, normal, wrench, rotations, asked };
        let mut answer = case.solve();
        if asked.notes {
            answer.notes.extend(case.softness(self, &answer));
        }
        answer
    }

    /// Both faces squeezed with `force` \[N\] without a load; `None` without contact.
    pub fn squeezed(&self, force: f64) -> Option<[Squeezed; 2]> {
        let squeezed = |face: &Face| {
            let (delta, regions) = face.squeezed(force)?;
            let area = regions.iter().map(|region| region.area_and_load().0).sum::<f64>();
            Some(Squeezed {
                delta,
                area,
                mean_pressure: force / area,
                greatest_pressure: face.greatest(&regions),
            })
        };
        Some([squeezed(&self.faces[0])?, squeezed(&self.faces[1])?])
    }

    /// Compressions at the pads' planes \[m\], as [`Self::squeezed`] tells.
    pub(crate) fn deltas(&self, force: f64) -> Option<[f64; 2]> {
        let [one, two] = &self.faces;
        let first = one.squeeze(force)?;
        // Under pads alike on a part that is the same on both sides.
        let is_same = one.fields == two.fields && one.stiffness == two.stiffness;
        Some([first, if is_same { first } else { two.squeeze(force)? }])
    }

    /// Greatest compression of either face at compressions `deltas` of the pads' planes \[m\].
    pub(crate) fn compressed(&self, deltas: [f64; 2]) -> f64 {
        self.faces[0].compressed(deltas[0]).max(self.faces[1].compressed(deltas[1]))
    }

    /// Compressions at the pads' planes \[m\] under a squeeze with `force` \[N\], looked for from `near`
    /// on; `None` without contact.
    pub(crate) fn compressions(&self, force: f64, near: [f64; 2]) -> Option<[f64; 2]> {
        let [one, two] = &self.faces;
        Some([one.compression(force, near[0])?, two.compression(force, near[1])?])
    }

    /// Axes in the pad plane about which the part can turn without any change of the pressure, at a
    /// squeeze with `force` \[N\]: none, one or two unit vectors.
    pub fn free_axes(&self, distance: f64, force: f64) -> Vec<DVec2> {
        let pressed = [0, 1].map(|k| self.faces[k].carry(force, DVec2::ZERO, None));
        let [Some(one), Some(two)] = pressed else { return Vec::new() };
        let free = |rotation: &Rotation| matches!(rotation.kind, Kind::Free | Kind::Facets(_));
        let rotations = self.rotations(&[one, two], distance, force);
        rotations.iter().filter(|rotation| free(rotation)).map(|rotation| rotation.axis).collect()
    }
}

/// A case with what is known of it before any slip.
struct Case<'a, 'c> {
    faces: &'a [Face; 2],
    /// Without tilt.
    pressed: [&'c Pressed<'a>; 2],
    distance: f64,
    normal: [f64; 2],
    wrench: &'c Wrench,
    rotations: [Rotation; 2],
    asked: Asked,
}

/// What is to be found besides the first limit state.
#[derive(Debug, Clone, Copy)]
struct Asked {
    /// Further limit states where there may be some: that decides only whether the status is
    /// ambiguous, and what is found where the first way leads nowhere.
    others: bool,
    /// What to know of the answer.
    notes: bool,
    /// What the push of tilted planes adds, where that counts.
    push: bool,
}

impl Asked {
    const ALL: Self = Self { others: true, notes: true, push: false };
    const SCORE: Self = Self { others: true, notes: false, push: true };
    const FIRST: Self = Self { others: false, notes: false, push: true };
}

/// Lever of a stiffness over the distance of the faces below which it is none.
const NO_LEVER: f64 = 1e-6;
/// Difference in what two pieces feel of a tilt that is rounding.
const FELT: f64 = 1e-9;

impl<'a> Case<'a, '_> {
    /// With the rotations free that are free in any case, and those that turn out to be.
    fn solve(&self) -> Answer {
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
                if stiffness < -none {
                    notes.push(Note::Unstable { stiffness });
                }
                stiffness <= none
            }
            Kind::Held => false,
        });
        loop {
            let problem = self.problem(free);
            let (status, state) = find(&problem, self.pressed, self.asked.others);
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
                    let (status, state) = match self.pushed(&problem, status, &state) {
                        Some((status, state, note)) => {
                            notes.push(note);
                            (status, state)
                        }
                        None => (status, state),
                    };
                    return self.finish(&problem, status, state, notes);
                }
            }
        }
    }

    /// The state with the push of tilted planes, where that counts.
    fn pushed(
        &self,
        problem: &Problem<'a>,
        status: Status,
        state: &Option<State<'a>>,
    ) -> Option<(Status, Option<State<'a>>, Note)> {
        let state = state.as_ref().filter(|_| self.asked.push && status.holds())?;
        let without = state.slip?.mu;
        // First for the pressure as it is.
        let (force, first) = problem.with_tilting_planes(state, TILTING_PUSH)?;
        if !counts(without + SURELY * (first.mu - without), without) {
            return None;
        }
        let mut pushed = problem.clone();
        let close = AGREED * (self.normal[0] + self.normal[1]);
        let (mut push, mut near) = (Push::new(force), state.clone());
        for _ in 0..PUSHES {
            let force = push.force;
            pushed.wrench.force = problem.wrench.force + force.extend(0.0);
            let note = Note::TiltPushesMuch { force: force.to_array(), without };
            let again = pushed.at(&near.angles, 1.0, Some(&near));
            let again = again.and_then(|start| pushed.newton(start, 1.0));
            near = match again {
                Some(found) => found,
                None => match find(&pushed, self.pressed, false) {
                    (_, Some(found)) => found,
                    (status, None) => return Some((status, None, note)),
                },
            };
            if push.is_found(pushed.push([&near.faces[0], &near.faces[1]]), close) {
                let mu = near.slip?.mu;
                if !counts(mu, without) {
                    return None;
                }
                // Other limit states are looked for with the push that was found.
                let (status, found) = if self.asked.others && strong(&pushed, mu) {
                    find(&pushed, self.pressed, true)
                } else {
                    (status, Some(near))
                };
                return Some((status, found, note));
            }
        }
        let note = Note::TiltPushesMuch { force: push.force.to_array(), without };
        Some((Status::NotConverged, None, note))
    }

    fn problem(&self, free: [bool; 2]) -> Problem<'a> {
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
        // Where all of both faces turns with the body, or none, the pushes cancel.
        let pushes = held.iter().any(|e| {
            let felt = fields().map(|field| field.felt(e.perp()).length());
            let (least, most) = felt.fold((1.0, 0.0), |(a, b): (f64, f64), f| (a.min(f), b.max(f)));
            most - least > FELT
        });
        Problem {
            pushes,
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

    fn finish(
        &self,
        problem: &Problem<'_>,
        status: Status,
        state: Option<State<'_>>,
        mut notes: Vec<Note>,
    ) -> Answer {
        let dimensions = problem.space.dimensions() as u8;
        let (Some(state), Some(slipping)) = (&state, state.as_ref().and_then(|s| s.slip)) else {
            let mut answer = no_answer(status);
            (answer.dimensions, answer.notes) = (dimensions, notes);
            return answer;
        };
        let tilt = problem.tilt(&state.angles);
        if self.asked.notes {
            self.note(problem, state, &slipping, &mut notes);
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
    fn note(
        &self,
        problem: &Problem<'_>,
        state: &State<'_>,
        slipping: &Slipping,
        notes: &mut Vec<Note>,
    ) {
        let tilt = problem.tilt(&state.angles);
        let give = 0.5 * (self.pressed[0].compression() + self.pressed[1].compression());
        let angle = tilt.length();
        let slip = 0.5 * self.distance.abs() * angle;
        if slip > give {
            notes.push(Note::TiltsFirst { angle, slip });
        }
        if !notes.iter().any(|note| matches!(note, Note::TiltPushesMuch { .. }))
            && let Some((force, pushed)) = problem.with_tilting_planes(state, TILTING_PUSH)
            && (pushed.mu - slipping.mu).abs() > TILTING_PUSH * slipping.mu
        {
            notes.push(Note::TiltPushes { force: force.to_array(), mu_s: pushed.mu });
        }
        for axis in &problem.space.spins {
            let push = -axis.perp().dot(state.faces[0].slope + state.faces[1].slope);
            if push.abs() > OVER_EDGE * (self.normal[0] + self.normal[1]) {
                notes.push(Note::OverEdge { force: push });
            }
        }
    }

    /// Notes on pads too soft for the theory.
    fn softness(&self, pads: &Pads, answer: &Answer) -> Vec<Note> {
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

/// Whether a push of tilted planes that raises `mu_s` so is counted.
fn counts(mu: f64, without: f64) -> bool {
    mu - without > (COUNTS.0 * without).max(COUNTS.1)
}

/// Whether friction's lever is so long that there may be further limit states.
fn strong(problem: &Problem<'_>, mu: f64) -> bool {
    let width = problem.widths.iter().copied().fold(f64::INFINITY, f64::min);
    mu * problem.distance.abs() > COUPLING_SEARCH * width
}

/// The limit state of a problem, and its status.
fn find<'a>(
    problem: &Problem<'a>,
    pressed: [&Pressed<'_>; 2],
    search: bool,
) -> (Status, Option<State<'a>>) {
    let strong = |state: &State<'_>| strong(problem, state.slip.map_or(0.0, |slip| slip.mu));
    let direct = problem.direct(pressed).filter(|state| !strong(state));
    match direct.or_else(|| problem.branch()) {
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

fn no_answer(status: Status) -> Answer {
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

fn check(surfaces: &Surfaces, distance: f64, force: f64, wrench: &Wrench) -> Result<()> {
    super::solve::check_numbers(distance, force, wrench)?;
    for (name, pieces) in [("A_I", &surfaces.face_i), ("A_II", &surfaces.face_ii)] {
        let rings = || pieces.iter().flat_map(|piece| piece.holes.iter().chain([&piece.outer]));
        check_area(rings, || name.to_owned())?;
        for (index, piece) in pieces.iter().enumerate() {
            if let Some(fault) = piece.gap.fault() {
                return Err(Error::input(
                    format!("{name}[{index}].gap"),
                    format!("has {fault}"),
                    "give finite lengths [m], radii that are not zero, axes that are not zero",
                ));
            }
        }
    }
    let [one, two] = surfaces.stiffness;
    if !(one.is_finite() && one > 0.0 && two.is_finite() && two > 0.0) {
        return Err(Error::input(
            "k",
            format!("is [{one}, {two}]"),
            "give the pads' stiffness on face I and II, finite and positive [Pa/m]",
        ));
    }
    if let Some(layer) = surfaces.layer
        && !(layer.is_finite() && layer > 0.0)
    {
        return Err(Error::input(
            "layer",
            format!("is {layer}"),
            "give the thickness of the pads' layer, finite and positive [m]",
        ));
    }
    Ok(())
}

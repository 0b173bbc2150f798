//! Which of many loads on one contact can be the worst, for a small part of their solutions.
//!
//! Each load begins at the state of one solved before: the motion that moves it most, the tilt and
//! compressions of the one pressed most like it. A few steps of Newton's method on all unknowns give
//! its `mu_s`, or show, by how fast the steps shrink, that it stays below that of another load.

use glam::DVec2;

use super::equilibrium::Problem;
use super::face::Pressed;
use super::floor::Floors;
use super::joint::{Found, Joint, Mode, Near, Place, Reached};
use super::limit::{Asked, Case, NO_LEVER, strong, tilts_far};
use super::space::{self, Kind, Rotation};
use super::{Pads, slip};
use crate::model::Wrench;

/// What is known of a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Compared {
    /// It is held, and its `mu_s` is less than the value asked for.
    Below,
    /// It is held with this `mu_s`, but for rounding.
    At(f64),
    /// Nothing: it is to be solved.
    Open,
}

/// Compares loads on one contact.
pub struct Screen<'a> {
    problem: Problem<'a>,
    /// Squeezed without a load.
    pressed: [Pressed<'a>; 2],
    force: f64,
    near: Near,
    /// Of the rotations held by the faces' roundness alone: which of the problem's held ones it is, and its
    /// stiffness by the pull.
    rolling: Vec<(usize, Stiffness)>,
    /// Of many loads.
    floors: Option<Floors>,
    /// Whether any limit state will do, not only that on the branch from `d = 0`.
    any: bool,
    /// States found so far.
    known: Vec<Known>,
}

/// The state of a load.
struct Known {
    /// What tells how the load presses.
    presses: [f64; 3],
    place: Place,
}

/// The state of the load that presses most like one.
fn nearest<'a>(known: &'a [Known], here: &[f64; 3]) -> Option<&'a Known> {
    let apart = |other: &Known| -> f64 {
        other.presses.iter().zip(here).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    known.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))
}

/// The stiffness of a rotation that the faces' roundness alone holds, by the pull: a polynomial through some
/// values, as Newton has it.
struct Stiffness {
    pulls: Vec<f64>,
    differences: Vec<f64>,
}

/// Two rotations' stiffnesses under a pull \[N\].
type Look = (f64, [Option<f64>; 2]);

impl Stiffness {
    /// That of rotation `i` from looks at no pull and the extreme ones, and others where these are not on a
    /// line; `None` where it is another curve.
    fn by_pull(
        i: usize,
        looks: &[Look],
        look: &dyn Fn(f64) -> Option<Look>,
        force: f64,
    ) -> Option<Self> {
        let point = |(pull, stiffness): Look| Some((pull, stiffness[i]?));
        let mut points: Vec<(f64, f64)> =
            looks.iter().copied().map(point).collect::<Option<_>>()?;
        let ends: Vec<f64> = points[1..].iter().map(|point| point.0).collect();
        let here = points[0].1;
        let fits = |curve: &Self, (pull, there): (f64, f64)| {
            (curve.at(pull) - there).abs() <= FITS * here.abs() * pull.abs() / force
        };
        let (last, rest) = points.split_last()?;
        let line = Self::through(rest);
        if rest.is_empty() || rest.len() == 2 && fits(&line, *last) {
            return Some(Self::through(&points));
        }
        for share in SHARES {
            let more: Vec<(f64, f64)> =
                ends.iter().map(|end| point(look(share * end)?)).collect::<Option<_>>()?;
            let curve = Self::through(&points);
            if more.iter().all(|point| fits(&curve, *point)) {
                return Some(curve);
            }
            points.extend(more);
        }
        None
    }

    fn through(points: &[(f64, f64)]) -> Self {
        let (pulls, mut differences): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        for order in 1..pulls.len() {
            for k in (order..pulls.len()).rev() {
                let rise = differences[k] - differences[k - 1];
                differences[k] = rise / (pulls[k] - pulls[k - order]);
            }
        }
        Self { pulls, differences }
    }

    fn at(&self, pull: f64) -> f64 {
        let terms = self.pulls.iter().zip(&self.differences).rev();
        terms.fold(0.0, |sum, (at, difference)| sum * (pull - at) + difference)
    }
}

/// Shares of the extreme pulls at which a stiffness is looked at.
const SHARES: [f64; 3] = [0.5, 0.75, 0.25];
/// Loads from which on floors are worth their pressing.
const MANY: usize = 16;
/// States kept.
const MOST: usize = 64;
/// Share of the limit of a strong coupling from which on a load is solved.
const WEAK: f64 = 0.8;
/// Sine of the angle between two axes that are one.
const SAME_AXIS: f64 = 1e-6;
/// Share of a stiffness, times that of the pull in the force, by which a curve through some of its values
/// may differ from another one.
const FITS: f64 = 1e-7;
/// Share of the layers' give, squeezed without a load, from which on a part may settle.
const SETTLES: f64 = 0.4;
/// Share of a bound that covers rounding.
const ROUNDING: f64 = 1e-9;
/// Share of the limit of a strong coupling up to which friction hardly moves the pressure, and the
/// growth of a bound that covers what it does: its lever moves the middle of pressure by less than a
/// twentieth of the contact's width.
const HARDLY: f64 = 0.1;
const GROWN: f64 = 2.0;

impl Pads {
    /// For the comparison of some loads; `None` where the part may settle or twist in a way that each
    /// load decides by itself. Numbers must be finite and `force` positive.
    pub fn screen(&self, distance: f64, force: f64, wrenches: &[Wrench]) -> Option<Screen<'_>> {
        if self.faces.iter().any(|face| face.fields.is_empty()) {
            return None;
        }
        let squeeze = |pull: f64| {
            let one = self.faces[0].carry(force + 0.5 * pull, DVec2::ZERO, None)?;
            Some([one, self.faces[1].carry(force - 0.5 * pull, DVec2::ZERO, None)?])
        };
        let none = NO_LEVER * force * distance.abs();
        let free = |rotations: [Rotation; 2]| {
            rotations.map(|rotation| match rotation.kind {
                Kind::Free | Kind::Facets(_) => true,
                Kind::Held => false,
                // As good as one axis, or rolling out: free under any load.
                Kind::Nearly(stiffness) => stiffness <= none,
            })
        };
        let pressed = squeeze(0.0)?;
        let rotations = self.rotations(&pressed, distance, force);
        let is_free = free(rotations);
        // The same rotations are free however much one pad is pulled off.
        let pulls = wrenches.iter().map(|wrench| wrench.force.z).filter(|z| z.abs() < 2.0 * force);
        let (low, high) = pulls.fold((0.0, 0.0), |(a, b): (f64, f64), z| (a.min(z), b.max(z)));
        let on_axis = rotations.iter().any(|rotation| rotation.kind == Kind::Free);
        let nearly = rotations.iter().any(|rotation| matches!(rotation.kind, Kind::Nearly(_)));
        let always = on_axis && !nearly && self.plainly_round();
        // The stiffnesses of what the roundness alone holds.
        let stiffness = |rotations: &[Rotation; 2]| {
            [0, 1].map(|i| match rotations[i].kind {
                Kind::Nearly(stiffness) if !is_free[i] => Some(stiffness),
                _ => None,
            })
        };
        let look = |pull: f64| {
            let [one, two] = squeeze(pull)?;
            let others = space::rotations([&one, &two], distance);
            let other_free = free(others);
            let same = (0..2).all(|i| {
                let apart = rotations[i].axis.perp_dot(others[i].axis).abs();
                let any_axis = is_free[0] == is_free[1] && (is_free[0] || !nearly);
                is_free[i] == other_free[i] && (any_axis || apart < SAME_AXIS)
            });
            same.then(|| (pull, stiffness(&others)))
        };
        let mut looks = vec![(0.0, stiffness(&rotations))];
        for pull in [low, high].into_iter().filter(|pull| !always && pull.abs() > 1e-9 * force) {
            looks.push(look(pull)?);
        }
        let mut rolling = Vec::new();
        for (place, i) in (0..2).filter(|&i| !is_free[i]).enumerate() {
            if looks.iter().all(|(_, stiffness)| stiffness[i].is_none()) {
                continue;
            }
            rolling.push((place, Stiffness::by_pull(i, &looks, &look, force)?));
        }
        let faces = [&pressed[0], &pressed[1]];
        let normal = [force; 2];
        let wrench = &Wrench::default();
        let case = Case {
            faces: &self.faces,
            pressed: faces,
            distance,
            normal,
            wrench,
            rotations,
            asked: Asked::SCORE,
            near: None,
        };
        let problem = case.problem(is_free);
        let pull = f64::max(-low, high);
        let floors =
            if wrenches.len() >= MANY { Floors::new(&problem, faces, force, pull) } else { None };
        let (near, known) = (Near::new(faces), Vec::new());
        Some(Screen { problem, force, near, rolling, floors, any: false, known, pressed })
    }
}

impl Screen<'_> {
    /// Where it is only asked whether a load is held: by any limit state.
    pub fn by_any_state(self) -> Self {
        Self { any: true, ..self }
    }

    /// About the `mu_s` of a load, for the order in which loads are compared.
    pub fn estimate(&self, wrench: &Wrench) -> f64 {
        let (force, moment) = (wrench.force.truncate(), wrench.moment.truncate());
        let spins = self.problem.space.spins.iter();
        let spun: f64 = spins.map(|e| e.dot(moment).powi(2)).sum();
        let lever = 0.5 * self.problem.distance;
        let turned = wrench.moment.z / self.near.length;
        // The pad pressed less slips first.
        let pressed = self.force - 0.5 * wrench.force.z.abs();
        (force.length_squared() + turned * turned + spun / (lever * lever)).sqrt() / pressed
    }

    /// Compares the `mu_s` of a load with `value`; zero asks for its `mu_s`.
    pub fn compare(&mut self, wrench: &Wrench, value: f64) -> Compared {
        let normal = [self.force + 0.5 * wrench.force.z, self.force - 0.5 * wrench.force.z];
        if normal.iter().any(|n| *n <= 0.0) {
            return Compared::Open;
        }
        (self.problem.normal, self.problem.wrench) = (normal, *wrench);
        for (held, stiffness) in &self.rolling {
            self.problem.rolling[*held] = stiffness.at(wrench.force.z);
        }
        if let Some(floors) = &self.floors {
            let counts = self.any || !strong(&self.problem, value / WEAK);
            if counts && floors.below(&self.problem, value).is_some() {
                return Compared::Below;
            }
            if let Some(mu) = floors.rolls(&self.problem) {
                return Compared::At(mu);
            }
        }
        let Some((compared, place, _)) = self.reach_settled(value) else { return Compared::Open };
        self.keep(place);
        compared
    }

    /// As [`Self::reach`], if that does not depend on what the load decides by itself.
    fn reach_settled(&self, value: f64) -> Option<(Compared, Place, f64)> {
        let (compared, place, most) = self.reach(value)?;
        let others =
            || strong(&self.problem, most / WEAK) || tilts_far(&self.problem, &place.angles);
        let open = !self.any && others() || self.may_settle(&place);
        (!open).then_some((compared, place, most))
    }

    fn keep(&mut self, place: Place) {
        if self.known.len() < MOST {
            self.known.push(Known { presses: self.presses(), place });
        }
    }

    /// Whether the part may turn by more than the layers give about an axis that the faces' roundness
    /// alone holds: then it is free, which is for the solution to say.
    fn may_settle(&self, place: &Place) -> bool {
        let give = self.pressed.iter().map(|face| 0.5 * face.compression()).sum::<f64>();
        let tilt = self.problem.tilt(&place.angles);
        self.rolling.iter().any(|(held, _)| {
            let angle = self.problem.held[*held].dot(DVec2::new(tilt.y, -tilt.x)).abs();
            0.5 * self.problem.distance.abs() * angle > SETTLES * give
        })
    }

    /// What tells how a load presses.
    fn presses(&self) -> [f64; 3] {
        let moment = self.problem.wrench.moment.truncate() / self.near.length;
        [self.problem.wrench.force.z, moment.x, moment.y]
    }

    /// Where the pressure resists no rotation it follows from the normal forces alone.
    fn untilted(&self, value: f64) -> Option<(Compared, Place, f64)> {
        let Problem { faces, normal, distance, space, .. } = &self.problem;
        let mut place = self.nearest();
        let [one, two] =
            [0, 1].map(|k| faces[k].carry(normal[k], DVec2::ZERO, Some(place.delta[k])));
        let (one, two) = (one?, two?);
        place.delta = [one.delta, two.delta];
        let faces = [&one, &two];
        let w = self.problem.along(faces, self.problem.moment_beyond(faces));
        if value > 0.0 {
            let enough = slip::enough(space, faces, *distance, w)?;
            if enough * (1.0 + ROUNDING) < value {
                return Some((Compared::Below, place, enough));
            }
        }
        // From the motion that the load moves most.
        let moved = self.known.iter().filter(|known| known.place.mode != Mode::Off);
        let moved = moved.map(|Known { place, .. }| (w.dot(&place.motion), place));
        let start = moved.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, place)| {
            let on = if let Mode::Rolls(k) = place.mode { Some(k) } else { None };
            (place.motion, on)
        });
        let slip = slip::solve(space, faces, *distance, w, start)?;
        let power = w.dot(&slip.zeta);
        if slip.mu > 0.0 && power > 0.0 {
            place.mode = slip.rolls_on.map_or(Mode::Slips, Mode::Rolls);
            place.motion = slip.zeta * (slip.mu / power);
        }
        Some((Compared::At(slip.mu), place, slip.mu))
    }

    fn reach(&self, value: f64) -> Option<(Compared, Place, f64)> {
        if self.problem.held.is_empty() {
            return self.untilted(value);
        }
        let joint = Joint::new(&self.problem, &self.near);
        let start = self.start(&joint);
        if let Some(answer) = self.rolls(&joint, &start) {
            return Some(answer);
        }
        if start.mode == Mode::Slips
            && let Some(reached) = joint.newton(&start, value)
        {
            return Some(told(reached));
        }
        // From the pressure alone.
        let off = Place { mode: Mode::Off, ..start };
        let Reached::Solution(still) = joint.newton(&off, 0.0)? else { return None };
        let place = still.place;
        let faces = still.pressed(self.problem.normal);
        let faces = [&faces[0], &faces[1]];
        let w = self.problem.along(faces, self.problem.moment_beyond(faces));
        // So little friction hardly moves the pressure.
        let enough = GROWN * slip::enough(&self.problem.space, faces, self.problem.distance, w)?;
        if enough < value && !strong(&self.problem, enough / HARDLY) {
            return Some((Compared::Below, place, enough));
        }
        let slip = slip::solve(&self.problem.space, faces, self.problem.distance, w, None)?;
        let mode = slip.rolls_on.map_or(Mode::Slips, Mode::Rolls);
        let place = Place { mode, motion: joint.motion(&slip, &w), ..place };
        let reached = joint.newton(&place, value)?;
        if mode == Mode::Slips { Some(told(reached)) } else { self.rests(reached) }
    }

    /// The state of the load that presses most like this one.
    fn nearest(&self) -> Place {
        nearest(&self.known, &self.presses())
            .map_or_else(|| Place::new([&self.pressed[0], &self.pressed[1]]), |known| known.place)
    }

    /// The state to begin at, from those of other loads.
    fn start(&self, joint: &Joint<'_, '_>) -> Place {
        let mut start = self.nearest();
        let slips = self.known.iter().filter(|known| known.place.mode == Mode::Slips);
        let moved = slips.map(|Known { place, .. }| (joint.power(&place.motion), place.motion));
        let most = moved.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        start.mode = Mode::Off;
        if let Some((power, motion)) = most.filter(|(power, _)| *power != 0.0) {
            (start.mode, start.motion) = (Mode::Slips, motion * power.signum());
        }
        start
    }

    /// The body rolls on one face, if that is the answer.
    fn rolls(&self, joint: &Joint<'_, '_>, start: &Place) -> Option<(Compared, Place, f64)> {
        if self.problem.space.spins.is_empty() {
            return None;
        }
        (0..2)
            .filter(|&k| joint.may_roll(k))
            .find_map(|k| self.rests(joint.newton(&Place { mode: Mode::Rolls(k), ..*start }, 0.0)?))
    }

    /// A body that rolls, if the face at rest bears what it must.
    fn rests(&self, reached: Reached<'_>) -> Option<(Compared, Place, f64)> {
        let Reached::Solution(found) = reached else { return None };
        let Found { place, mu, resting, .. } = *found;
        let Mode::Rolls(k) = place.mode else { return None };
        let faces = found.pressed(self.problem.normal);
        let rests = slip::rests([&faces[0], &faces[1]], k, &resting, mu);
        rests.then_some((Compared::At(mu), place, mu))
    }
}

fn told(reached: Reached<'_>) -> (Compared, Place, f64) {
    match reached {
        Reached::Solution(found) => (Compared::At(found.mu), found.place, found.mu),
        Reached::Below(place, most) => (Compared::Below, place, most),
    }
}

#[cfg(test)]
mod tests;

//! Tilt, compressions and slip at once, by Newton's method with the derivatives of all integrals.
//!
//! Unknowns: the motion in the slip space, the angles about the axes that the pressure resists, and
//! the compressions of both layers, seven in all. Where a pressure ends it is zero, so that the
//! moving edge adds nothing to a derivative.

use glam::DVec2;
use nalgebra::{Matrix3x5, SMatrix, SVector, Vector3, Vector5};

use super::equilibrium::Problem;
use super::face::{Carried, Moved, Pressed, Trial};
use super::slip::{self, Slipping};

type Vector7 = SVector<f64, 7>;
type Matrix7 = SMatrix<f64, 7, 7>;

/// How friction acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Not at all: the pressure alone holds the load.
    Off,
    /// The body rolls on this face and slides on the other.
    Rolls(usize),
    /// Both faces slip.
    Slips,
}

/// A state to begin at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) mode: Mode,
    /// The motion at which the dissipation is the sum of the normal forces.
    pub(super) motion: Vector5<f64>,
    /// Angles about the held axes, in their units.
    pub(super) angles: [f64; 2],
    /// Compressions \[m\].
    pub(super) delta: [f64; 2],
}

impl Place {
    /// Faces without tilt, friction left out.
    pub(super) fn new(pressed: [&Pressed<'_>; 2]) -> Self {
        let delta = pressed.map(|face| face.delta);
        Self { mode: Mode::Off, motion: Vector5::zeros(), angles: [0.0; 2], delta }
    }
}

/// A solution.
#[derive(Debug)]
pub(super) struct Found<'a> {
    pub(super) place: Place,
    pub(super) mu: f64,
    trials: [Trial<'a>; 2],
    tilt: DVec2,
    /// Where the body rolls, what the face at rest bears.
    pub(super) resting: Vector3<f64>,
}

/// Whether Newton's method came to the solution.
#[derive(Debug)]
pub(super) enum Reached<'a> {
    Solution(Box<Found<'a>>),
    /// It is known that `mu` stays below the value asked for, and below which; a place near the
    /// solution.
    Below(Place, f64),
}

/// What is known of faces that are pressed about as the solution presses them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    /// Units of length and of compression \[m\].
    pub(super) length: f64,
    give: f64,
    carried: [Carried; 2],
}

impl Near {
    pub(super) fn new(faces: [&Pressed<'_>; 2]) -> Self {
        Self {
            length: slip::length(faces),
            give: faces[0].compression().max(faces[1].compression()),
            carried: faces.map(Pressed::carried),
        }
    }
}

/// The equations of one problem in their own units.
pub(super) struct Joint<'p, 'a> {
    problem: &'p Problem<'a>,
    /// `B_k`, and the same from motions in units.
    basis: [Matrix3x5<f64>; 2],
    scaled: [Matrix3x5<f64>; 2],
    units: Vector5<f64>,
    active: usize,
    normal: f64,
    /// Unit of compression \[m\].
    give: f64,
    /// Tilt per unit of angle about each held axis.
    tilts: [DVec2; 2],
    /// Distance of the pads' points from the origin \[m\].
    reach: f64,
    /// Share of the friction's lever `d/2` that counts.
    coupling: f64,
    /// About the load along the motions, in units: with the pressure of the faces given.
    about: Vector5<f64>,
}

/// The equations at some values of the unknowns.
struct At<'a> {
    residual: Vector7,
    jacobian: Matrix7,
    trials: [Trial<'a>; 2],
    tilt: DVec2,
    mu: f64,
    /// The load along the motions in units.
    w: Vector5<f64>,
    resting: Vector3<f64>,
}

/// What friction does, and how that changes with the unknowns.
struct Friction {
    /// Difference of the forces on the faces, along the pads, and its derivatives.
    couple: DVec2,
    by: [DVec2; 7],
    mu: f64,
    resting: Vector3<f64>,
}

/// Newton steps at most, and halvings of one.
const STEPS: u32 = 30;
const HALVINGS: u32 = 5;
/// Residual at which Newton's method is content, and the largest that rounding may leave.
const SOLVED: f64 = 1e-14;
const ROUNDING: f64 = 1e-10;
/// Friction that a face at rest may ask for over that of the sliding one, roughly, for a try.
const MAY_ROLL: f64 = 1.1;
/// Ratio of two corrections up to which Newton's method converges for certain, and the growth of
/// the last one that bounds the way to the solution.
const CONTRACTION: f64 = 0.25;
const WITHIN: f64 = 2.0;

impl<'p, 'a> Joint<'p, 'a> {
    /// `near`: of faces without tilt, or of a state nearby.
    pub(super) fn new(problem: &'p Problem<'a>, near: &Near) -> Self {
        let (space, distance) = (&problem.space, problem.distance);
        let Near { length, give, carried: [one, two] } = near;
        let spin = 2.0 / distance.abs();
        let units = Vector5::new(1.0, 1.0, length.recip(), spin, spin);
        let basis = [0, 1].map(|k| space.basis(k, distance));
        let mut tilts = [DVec2::ZERO; 2];
        for (tilt, (e, unit)) in tilts.iter_mut().zip(problem.held.iter().zip(&problem.units)) {
            *tilt = *unit * e.perp();
        }
        let across = nalgebra::Matrix5::from_diagonal(&units);
        let mut joint = Self {
            problem,
            scaled: basis.map(|basis| basis * across),
            basis,
            units,
            active: space.dimensions(),
            normal: problem.normal[0] + problem.normal[1],
            give: *give,
            tilts,
            reach: problem.faces[0].reach().max(problem.faces[1].reach()),
            coupling: 1.0,
            about: Vector5::zeros(),
        };
        joint.about = joint.outer().0 + joint.effect(one, two).0;
        joint
    }

    /// The same with a share of the friction's lever.
    pub(super) fn coupled(self, coupling: f64) -> Self {
        Self { coupling, ..self }
    }

    /// Newton's step of the angles where compressions and motion follow them, from a place at which
    /// these are solved: `mu` there, and what the moments leave over.
    pub(super) fn turn(&self, place: &Place, mu: f64, residual: &[f64]) -> Option<[f64; 2]> {
        let mut x = Vector7::zeros();
        (x[5], x[6]) = (place.delta[0] / self.give, place.delta[1] / self.give);
        let mut right = Vector7::zeros();
        for i in 0..self.held() {
            x[self.active + i] = place.angles[i];
            right[self.active + i] = residual[i];
        }
        if place.mode == Mode::Slips {
            // Its length there is such that the dissipation's gradient times mu is the load.
            x.rows_mut(0, self.active).copy_from(&self.scaled(&place.motion).rows(0, self.active));
        }
        let step = -self.at(&x, place.mode, mu)?.jacobian.lu().solve(&right)?;
        let mut turn = [0.0; 2];
        turn.iter_mut().zip(step.iter().skip(self.active)).for_each(|(to, x)| *to = *x);
        Some(turn)
    }

    fn held(&self) -> usize {
        self.problem.held.len()
    }

    fn tilt(&self, x: &Vector7) -> DVec2 {
        (0..self.held()).map(|i| x[self.active + i] * self.tilts[i]).sum()
    }

    /// What pressures mean for the load along the motions, in units, and for the moment in the pad
    /// plane; linear in what they carry.
    fn effect(&self, one: &Carried, two: &Carried) -> (Vector5<f64>, DVec2) {
        let (slide, moment) = self.problem.brought(one, two);
        (self.along(slide, moment), moment)
    }

    /// What a load means along the motions, in units: its force and turn along the pads, and its
    /// moment in their plane.
    fn along(&self, slide: Vector3<f64>, moment: DVec2) -> Vector5<f64> {
        let mut w = Vector5::new(slide.x, slide.y, slide.z, 0.0, 0.0);
        for (i, e) in self.problem.space.spins.iter().enumerate() {
            w[3 + i] = e.dot(moment);
        }
        w.component_mul(&self.units) / self.normal
    }

    /// The load from outside.
    fn outer(&self) -> (Vector5<f64>, DVec2) {
        let wrench = &self.problem.wrench;
        let (f, m) = (wrench.force, wrench.moment);
        let moment = DVec2::new(m.x, m.y);
        (self.along(Vector3::new(f.x, f.y, m.z), moment), moment)
    }

    /// About the power of the load over the normal forces, for a motion of a [`Place`].
    pub(super) fn power(&self, motion: &Vector5<f64>) -> f64 {
        self.about.dot(&self.scaled(motion))
    }

    /// Whether the body can roll on face `k`, about: the other one's slide asks for the more friction.
    pub(super) fn may_roll(&self, k: usize) -> bool {
        let none = [(Vector5::zeros(), DVec2::ZERO); 7];
        let Friction { mu, resting, .. } = self.still(Mode::Rolls(k), &self.about, &none);
        resting.x.hypot(resting.y) <= MAY_ROLL * mu * self.problem.normal[k]
    }

    /// A motion in units.
    fn scaled(&self, motion: &Vector5<f64>) -> Vector5<f64> {
        motion.component_div(&self.units)
    }

    /// The motion of a slip under the load `w` at the length that [`Place`] has.
    pub(super) fn motion(&self, slip: &Slipping, w: &Vector5<f64>) -> Vector5<f64> {
        slip.zeta * (slip.mu * self.normal / w.dot(&slip.zeta))
    }

    fn at(&self, x: &Vector7, mode: Mode, size: f64) -> Option<At<'a>> {
        let (n, tilt) = (self.held(), self.tilt(x));
        let directions = &self.tilts[..n];
        let trials =
            [0, 1].map(|k| self.problem.faces[k].trial(x[5 + k] * self.give, tilt, directions));
        if trials.iter().any(|trial| trial.carried[0].is_nan() || trial.carried[0] <= 0.0) {
            return None;
        }
        let none = Carried::zeros();
        let ((w, moment), (outer, asked)) =
            (self.effect(&trials[0].carried, &trials[1].carried), self.outer());
        let (mut w, mut moment) = (w + outer, moment + asked);
        // Derivatives by the angles and the compressions.
        let mut by = [(Vector5::zeros(), DVec2::ZERO); 7];
        for i in 0..n {
            by[self.active + i] = self.effect(&trials[0].by[1 + i], &trials[1].by[1 + i]);
        }
        by[5] = self.effect(&(self.give * trials[0].by[0]), &none);
        by[6] = self.effect(&none, &(self.give * trials[1].by[0]));
        if self.problem.moves > 0.0 {
            let add = |to: (&mut Vector5<f64>, &mut DVec2), moved: Moved| {
                let (slide, moment) = self.problem.moved(&moved);
                *to.0 += self.along(slide, moment);
                *to.1 += moment;
            };
            let [one, two] = &trials;
            add((&mut w, &mut moment), one.moved + two.moved);
            for i in 0..n {
                let (w, moment) = &mut by[self.active + i];
                add((w, moment), one.moved_by[1 + i] + two.moved_by[1 + i]);
            }
            for (k, trial) in trials.iter().enumerate() {
                let (w, moment) = &mut by[5 + k];
                add((w, moment), self.give * trial.moved_by[0]);
            }
        }
        let (mut residual, mut jacobian) = (Vector7::zeros(), Matrix7::zeros());
        let friction = match mode {
            Mode::Slips => self.slips(x, &trials, size, (&w, &by), (&mut residual, &mut jacobian)),
            _ => {
                (0..self.active).for_each(|i| jacobian[(i, i)] = 1.0);
                self.still(mode, &w, &by)
            }
        };
        let lever = 0.5 * self.coupling * self.problem.distance;
        let turned = |couple: DVec2| lever * DVec2::new(couple.y, -couple.x);
        let left = moment + turned(friction.couple);
        for i in 0..n {
            let (row, e) = (self.active + i, self.problem.held[i]);
            let back = self.problem.rolling[i] * self.problem.units[i];
            let scale = self.problem.moment.recip();
            residual[row] = scale * (e.dot(left) - back * x[row]);
            for j in 0..7 {
                jacobian[(row, j)] = scale * e.dot(by[j].1 + turned(friction.by[j]));
            }
            jacobian[(row, row)] -= scale * back;
        }
        for k in 0..2 {
            residual[5 + k] = (trials[k].carried[0] - self.problem.normal[k]) / self.normal;
            jacobian[(5 + k, 5 + k)] = self.give * trials[k].by[0][0] / self.normal;
            for i in 0..n {
                jacobian[(5 + k, self.active + i)] = trials[k].by[1 + i][0] / self.normal;
            }
        }
        let Friction { mu, resting, .. } = friction;
        Some(At { residual, jacobian, trials, tilt, mu, w, resting })
    }

    /// No face dissipates by more than its share of a slide.
    fn still(&self, mode: Mode, w: &Vector5<f64>, by: &[(Vector5<f64>, DVec2); 7]) -> Friction {
        let Mode::Rolls(k) = mode else {
            let (couple, by, resting) = (DVec2::ZERO, [DVec2::ZERO; 7], Vector3::zeros());
            return Friction { couple, by, mu: 0.0, resting };
        };
        let (other, distance) = (1 - k, self.problem.distance);
        // The sliding face bears what the motions about the face at rest ask for.
        let slid = |w: &Vector5<f64>| -> (DVec2, DVec2) {
            let w = w.component_div(&self.units) * self.normal;
            let mut force = DVec2::ZERO;
            for i in 0..self.problem.space.spins.len() {
                let column = self.basis[k].column(3 + i);
                let mut motion = Vector5::zeros();
                motion[3 + i] = 1.0;
                for j in 0..3 {
                    motion[j] = -column[j];
                }
                let slide = self.basis[other] * motion;
                let slide = DVec2::new(slide.x, slide.y);
                force += w.dot(&motion) / (distance * distance) * slide;
            }
            (force, DVec2::new(w[0], w[1]))
        };
        let couple = |w: &Vector5<f64>| {
            let (force, all) = slid(w);
            if other == 0 { 2.0 * force - all } else { all - 2.0 * force }
        };
        let (force, all) = slid(w);
        let rest = all - force;
        Friction {
            couple: couple(w),
            by: by.map(|(w, _)| couple(&w)),
            mu: force.length() / self.problem.normal[other],
            // The moment is added when it is known where the sliding face is pressed.
            resting: Vector3::new(rest.x, rest.y, w[2] / self.units[2] * self.normal),
        }
    }

    /// Both faces slip: the equations along the motions, and the friction's couple.
    fn slips(
        &self,
        x: &Vector7,
        trials: &[Trial<'a>; 2],
        size: f64,
        (w, by): (&Vector5<f64>, &[(Vector5<f64>, DVec2); 7]),
        (residual, jacobian): (&mut Vector7, &mut Matrix7),
    ) -> Friction {
        let n = self.held();
        let mut z = Vector5::zeros();
        z.rows_mut(0, self.active).copy_from(&x.rows(0, self.active));
        let (mut value, mut gradient) = (0.0, Vector5::zeros());
        let mut hessian = nalgebra::Matrix5::zeros();
        // Of the difference of both faces' forces.
        let (mut apart, mut apart_z) = (Vector3::zeros(), Matrix3x5::zeros());
        let (mut gradient_by, mut apart_by) = ([Vector5::zeros(); 7], [Vector3::zeros(); 7]);
        for k in 0..2 {
            let (basis, sign) = (&self.scaled[k], if k == 0 { 1.0 } else { -1.0 });
            let (found, rows) = trials[k].dissipation(&(basis * z), &self.tilts[..n]);
            value += found.value / self.normal;
            gradient += basis.tr_mul(&found.gradient) / self.normal;
            let bent: Matrix3x5<f64> = found.hessian * basis;
            hessian += basis.tr_mul(&bent) / self.normal;
            apart += sign * found.gradient;
            apart_z += sign * bent;
            for (j, row) in [(5 + k, self.give * rows[0])]
                .into_iter()
                .chain((0..n).map(|i| (self.active + i, rows[1 + i])))
            {
                gradient_by[j] += basis.tr_mul(&row) / self.normal;
                apart_by[j] += sign * row;
            }
        }
        let along = value * gradient - w / size;
        let bend = gradient * gradient.transpose() + value * hessian;
        let mut couple_by = [DVec2::ZERO; 7];
        for i in 0..self.active {
            residual[i] = along[i];
            for j in 0..self.active {
                jacobian[(i, j)] = bend[(i, j)];
            }
            let column = size * (gradient[i] * apart + value * apart_z.column(i));
            couple_by[i] = DVec2::new(column.x, column.y);
        }
        for j in self.active..7 {
            let grown = z.dot(&gradient_by[j]);
            let column = grown * gradient + value * gradient_by[j] - by[j].0 / size;
            for i in 0..self.active {
                jacobian[(i, j)] = column[i];
            }
            let column = size * (grown * apart + value * apart_by[j]);
            couple_by[j] = DVec2::new(column.x, column.y);
        }
        Friction {
            couple: size * value * DVec2::new(apart.x, apart.y),
            by: couple_by,
            mu: w.dot(&z) / value,
            resting: Vector3::zeros(),
        }
    }

    /// Newton's method from a place. With a value it ends as soon as it is known that `mu` is less.
    pub(super) fn newton(&self, place: &Place, below: f64) -> Option<Reached<'a>> {
        let mut x = Vector7::zeros();
        for i in 0..self.held() {
            x[self.active + i] = place.angles[i];
        }
        (x[5], x[6]) = (place.delta[0] / self.give, place.delta[1] / self.give);
        let mut size = 1.0;
        if place.mode == Mode::Slips {
            let (w, z) = (&self.about, self.scaled(&place.motion));
            size = w.amax();
            let length = w.dot(&z) / size;
            if !(size > 0.0 && length > 0.0) {
                return None;
            }
            for i in 0..self.active {
                x[i] = length * z[i];
            }
        }
        let mode = place.mode;
        let mut at = self.at(&x, mode, size)?;
        let mut before = f64::INFINITY;
        for _ in 0..STEPS {
            let error = at.residual.norm();
            if !error.is_finite() {
                return None;
            }
            if error <= SOLVED {
                break;
            }
            let step = -at.jacobian.lu().solve(&at.residual)?;
            let mut change = f64::INFINITY;
            if below > 0.0 && mode == Mode::Slips {
                change = self.change(&x, &at, &step);
                let most = at.mu + WITHIN * change * size;
                if change <= CONTRACTION * before && most < below {
                    return Some(Reached::Below(
                        self.place(&(x + step), mode, (&at.w, size))?,
                        most,
                    ));
                }
            }
            let mut t = 1.0;
            let mut next = None;
            for _ in 0..HALVINGS {
                let moved = x + t * step;
                if let Some(tried) = self.at(&moved, mode, size)
                    && tried.residual.norm() <= (1.0 - 0.1 * t) * error
                {
                    next = Some((moved, tried));
                    break;
                }
                if error <= ROUNDING {
                    break;
                }
                t *= 0.5;
            }
            let Some((moved, tried)) = next else {
                // Rounding keeps it from falling further.
                if error <= ROUNDING {
                    break;
                }
                return None;
            };
            before = if t == 1.0 { change } else { f64::INFINITY };
            (x, at) = (moved, tried);
        }
        if at.residual.norm() > ROUNDING {
            return None;
        }
        let place = self.place(&x, mode, (&at.w, size))?;
        let At { trials, tilt, mu, mut resting, .. } = at;
        if let Mode::Rolls(k) = mode {
            let other = &trials[1 - k];
            let (force, all) = (DVec2::new(resting.x, resting.y), self.asked_force(&trials));
            resting.z -= other.centre().perp_dot(all - force);
        }
        Some(Reached::Solution(Box::new(Found { place, mu, trials, tilt, resting })))
    }

    /// The force along the pads that friction bears.
    fn asked_force(&self, trials: &[Trial<'_>; 2]) -> DVec2 {
        let [one, two] = trials;
        let slope = one.carried + two.carried;
        let (push, _) = self.problem.moved(&(one.moved + two.moved));
        let brought = DVec2::new(push.x - slope[3], push.y - slope[4]);
        self.problem.wrench.force.truncate() + brought
    }

    /// The unknowns as a place. At the solution the square of the dissipation is the load's power.
    fn place(&self, x: &Vector7, mode: Mode, (w, size): (&Vector5<f64>, f64)) -> Option<Place> {
        let (mut z, mut angles) = (Vector5::zeros(), [0.0; 2]);
        if mode == Mode::Slips {
            z.rows_mut(0, self.active).copy_from(&x.rows(0, self.active));
            z /= (w.dot(&z) / size).sqrt();
        }
        for i in 0..self.held() {
            angles[i] = x[self.active + i];
        }
        let delta = [x[5] * self.give, x[6] * self.give];
        z.iter().chain(x).all(|x| x.is_finite()).then(|| Place {
            mode,
            motion: z.component_mul(&self.units),
            angles,
            delta,
        })
    }

    /// What a step can change of the dissipation in units, at most: no point of the contact moves
    /// faster than the fastest within reach, and the pressure changes by no more than the step of
    /// the compression does.
    fn change(&self, x: &Vector7, at: &At<'_>, step: &Vector7) -> f64 {
        let fastest = |x: &Vector7, k: usize| {
            let mut z = Vector5::zeros();
            z.rows_mut(0, self.active).copy_from(&x.rows(0, self.active));
            let v = self.scaled[k] * z;
            v.x.hypot(v.y) + v.z.abs() * self.reach
        };
        let tilt = self.tilt(step).length() * self.reach;
        let of_face = |k: usize| {
            let pressure = at.trials[k].by[0][0] * (step[5 + k].abs() * self.give + tilt);
            let (now, more) = (fastest(x, k), fastest(step, k));
            self.problem.normal[k] * more + pressure * (now + more)
        };
        (of_face(0) + of_face(1)) / self.normal
    }
}

impl<'a> Found<'a> {
    /// Both faces as they are pressed.
    pub(super) fn pressed(self, normal: [f64; 2]) -> [Pressed<'a>; 2] {
        let (delta, tilt) = (self.place.delta, self.tilt);
        let [one, two] = self.trials;
        [one.pressed(delta[0], tilt, normal[0]), two.pressed(delta[1], tilt, normal[1])]
    }
}

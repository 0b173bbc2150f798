//! The slip problem in three to five dimensions for a given pressure: planar twists of the two
//! faces that follow from one motion `zeta = (u1, u2, omega3, spins)`.
//!
//! `mu_s = max w . zeta / D(zeta)`, `D = sum_k D_k(B_k zeta)`, as for planes; but `D` has a crease
//! where a face is at rest, and there the answer often lies: the body rolls on the less loaded
//! face. Those two candidates are tested first; elsewhere Newton's method has a smooth function.

use std::cell::{Cell, OnceCell};

use glam::DVec2;
use nalgebra::{Matrix3, Matrix3x5, Matrix5, Vector3, Vector5};

use super::face::Pressed;
use crate::model::Bounds;

/// The motions without resistance but friction.
#[derive(Debug, Clone, Default)]
pub(super) struct Space {
    /// Unit vectors in the pad plane about which the body can spin: none, one or two.
    pub(super) spins: Vec<DVec2>,
}

impl Space {
    /// Three to five.
    pub(super) fn dimensions(&self) -> usize {
        3 + self.spins.len()
    }

    /// `B_k`: the planar twist of face `k` from `zeta`, for faces `distance` apart.
    pub(super) fn basis(&self, k: usize, distance: f64) -> Matrix3x5<f64> {
        let lever = if k == 0 { 0.5 * distance } else { -0.5 * distance };
        let mut basis = Matrix3x5::identity();
        for (i, e) in self.spins.iter().enumerate() {
            basis[(0, 3 + i)] = lever * e.y;
            basis[(1, 3 + i)] = -lever * e.x;
        }
        for i in self.dimensions()..5 {
            basis.column_mut(i).fill(0.0);
        }
        basis
    }
}

/// The answer of the slip problem.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slipping {
    pub(super) mu: f64,
    /// The motion, of any length.
    pub(super) zeta: Vector5<f64>,
    /// Load on each face: force along the pad and moment about the closing axis.
    pub(super) shares: [Vector3<f64>; 2],
    /// The face at rest, on which the body rolls.
    pub(super) rolls_on: Option<usize>,
    /// Lower and upper bound.
    pub(super) bounds: Bounds,
    /// Evaluations of the integrals.
    pub(super) evaluations: u32,
}

/// Dissipation of both faces with its derivatives in `zeta`.
struct Both {
    value: f64,
    gradient: Vector5<f64>,
    hessian: Matrix5<f64>,
    faces: [Vector3<f64>; 2],
}

/// The problem in its own units: force over the normal forces, lengths over the contact's.
struct Problem<'a, 'b> {
    faces: [&'a Pressed<'b>; 2],
    basis: [Matrix3x5<f64>; 2],
    active: usize,
    /// What a unit of each coordinate is.
    units: Vector5<f64>,
    /// Sum of the normal forces that count.
    normal: f64,
    evaluations: Cell<u32>,
}

/// Newton steps at most.
const STEPS: u32 = 60;
/// What is added to the second derivatives, over their sum, until a step succeeds.
const LIFTS: [f64; 5] = [1e-15, 1e-12, 1e-9, 1e-6, 1e-3];
/// Halvings of a step at most, from which length on one is short, and how many in a row may be: along
/// a crease they get ever shorter.
const HALVINGS: u32 = 8;
const SHORT: f64 = 0.1;
const HASTY: u32 = 2;
const PATIENT: u32 = 8;
/// Residual from which on a step has to make it smaller; before, the merit.
const NEAR: f64 = 1e-6;
/// Residual at which Newton's method is content; `mu` is right to its square.
const ENOUGH: f64 = 1e-14;
/// Residual below which rounding keeps a full step from making it smaller: no shorter one would.
const ROUNDED: f64 = 1e-12;
/// Share of the sliding face's friction below which the other face counts as at rest: at a tie both
/// may slip.
const AT_REST: f64 = 1.0 - 1e-9;
/// The same where only `mu` is asked for.
const ALIKE: f64 = 1.0 + 1e-10;
/// The same where Newton's method finds nothing at once, and where it finds nothing, so near the tie.
const EVEN: f64 = 1.0 + 1e-12;
const TIED: f64 = 1.0 + 1e-6;

/// Share of `mu` by which bounds may be apart where the residual is not small, of a hasty search and of a
/// patient one.
const CLOSE: f64 = 1e-10;
const APART: f64 = 1e-6;
/// How near its bounds must be for an answer found from a neighbour's without a look at the creases.
const SURE: f64 = 1e-12;

/// Solves for the load `w` along the space; the faces are `distance` apart. `start`: motion and face at
/// rest for nearly the same pressure and load.
pub(super) fn solve(
    space: &Space,
    faces: [&Pressed<'_>; 2],
    distance: f64,
    w: Vector5<f64>,
    start: Option<(Vector5<f64>, Option<usize>)>,
) -> Option<Slipping> {
    let problem = Problem::new(space, faces, distance);
    if w.amax() == 0.0 {
        let bounds = Bounds { lower: 0.0, upper: 0.0 };
        let shares = [Vector3::zeros(); 2];
        let zeta = Vector5::zeros();
        return Some(Slipping { mu: 0.0, zeta, shares, rolls_on: None, bounds, evaluations: 0 });
    }
    let (zeta, near) = (start.as_ref().map(|(zeta, _)| zeta), start.map(|(_, rolls_on)| rolls_on));
    // Newton's method from the neighbour's motion.
    let mut moving = None;
    match near {
        Some(None) => {
            moving = problem.interior(&w, zeta, HASTY);
            let sure = |answer: &Slipping| answer.bounds.upper <= answer.mu * (1.0 + SURE);
            if let Some(answer) = moving.filter(sure) {
                return Some(problem.counted(answer));
            }
        }
        Some(Some(k)) => {
            let rolling = problem.rolling(space, k, distance, &w);
            if let Some(rolling) = rolling.filter(|rolling| problem.rests(rolling)) {
                return Some(problem.counted(rolling.answer));
            }
        }
        None => {}
    }
    let candidates = [0, 1].map(|k| problem.rolling(space, k, distance, &w));
    if let Some(rolling) = candidates.iter().flatten().find(|rolling| problem.rests(rolling)) {
        return Some(problem.counted(rolling.answer));
    }
    // A neighbour that rolls moves along a crease: no way leads off it.
    if near.is_none_or(|rolls_on| rolls_on.is_some()) {
        moving = problem.interior(&w, None, HASTY);
    }
    let tied =
        |within: f64| candidates.iter().flatten().find_map(|rolling| problem.tied(rolling, within));
    moving
        .or_else(|| {
            let start = problem.off_crease(&w, &candidates)?;
            problem.interior(&w, Some(&start), PATIENT)
        })
        .or_else(|| tied(EVEN))
        .or_else(|| problem.interior(&w, None, PATIENT))
        .or_else(|| tied(TIED))
        .map(|answer| problem.counted(answer))
}

/// Whether face `k` bears `load` at rest while the other slides at the friction `mu`: whether it
/// needs no more alone, ties among them.
pub(super) fn rests(faces: [&Pressed<'_>; 2], k: usize, load: &Vector3<f64>, mu: f64) -> bool {
    let problem = Problem::new(&Space::default(), faces, 1.0);
    problem.bears(k, load, mu * ALIKE, || problem.slips_alone(k, load))
}

/// The body rolls on face `k`: the other face, of normal force `load` and `first = int p x`, slides
/// along the pad. `basis` as [`Space::basis`] has it, with so many spins.
pub(super) fn rolling(
    basis: &[Matrix3x5<f64>; 2],
    spins: usize,
    k: usize,
    w: &Vector5<f64>,
    (load, first): (f64, DVec2),
) -> Option<Slipping> {
    let mut zeta = Vector5::zeros();
    for i in 0..spins {
        // The spin about this axis with face k at rest.
        let column = basis[k].column(3 + i);
        let mut at_rest = Vector5::zeros();
        at_rest[3 + i] = 1.0;
        for j in 0..3 {
            at_rest[j] = -column[j];
        }
        zeta += w.dot(&at_rest) * at_rest;
    }
    let slide = basis[1 - k] * zeta;
    let along = DVec2::new(slide.x, slide.y);
    let speed = along.length();
    if speed == 0.0 {
        return None;
    }
    let mu = w.dot(&zeta) / (load * speed);
    let e = along / speed;
    let sliding = mu * Vector3::new(load * e.x, load * e.y, first.perp_dot(e));
    let resting = Vector3::new(w[0], w[1], w[2]) - sliding;
    let mut shares = [sliding, resting];
    if k == 0 {
        shares.reverse();
    }
    let bounds = Bounds { lower: mu, upper: mu };
    Some(Slipping { mu, zeta, shares, rolls_on: Some(k), bounds, evaluations: 0 })
}

/// What the friction of a face bears for certain, over `mu`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bearing {
    /// Force in any direction through the middle of pressure \[N\].
    load: f64,
    /// That middle \[m\].
    pub(super) centre: DVec2,
    /// Force \[N\] and moment about the middle [N m] of a turn about it.
    side: DVec2,
    pub(super) turn: f64,
}

impl Bearing {
    pub(super) fn of(face: &Pressed<'_>) -> Self {
        let centre = face.centre();
        let turn = face.support(&Vector3::new(centre.y, -centre.x, 1.0));
        let side = DVec2::new(turn.x, turn.y);
        Self { load: face.load, centre, side, turn: turn.z - centre.perp_dot(side) }
    }

    /// A friction at which the face bears a force along the pad and a moment about the closing axis.
    pub(super) fn bears(&self, load: &Vector3<f64>) -> f64 {
        let force = DVec2::new(load.x, load.y);
        self.asks(force, (load.z - self.centre.perp_dot(force)) / self.turn)
    }

    /// A friction at which it bears a force through the middle of pressure and `turned` times what a
    /// turn about it does, the turn's own force among the first.
    pub(super) fn asks(&self, force: DVec2, turned: f64) -> f64 {
        (force - turned * self.side).length() / self.load + turned.abs()
    }

    /// What changes of a force \[N\] and of `turned` by no more than these can ask for.
    pub(super) fn asks_at_most(&self, force: f64, turned: f64) -> f64 {
        (force + turned * self.side.length()) / self.load + turned
    }
}

/// What holds the load `w` for certain: an upper bound of `mu` from a few supports.
pub(super) fn enough(
    space: &Space,
    faces: [&Pressed<'_>; 2],
    distance: f64,
    w: Vector5<f64>,
) -> Option<f64> {
    let problem = Problem::new(space, faces, distance);
    let w = w.component_mul(&problem.units) / problem.normal;
    problem.made_up(&w)
}

/// Root mean square distance of the pressure from its middle on both faces, but for a constant.
pub(super) fn length(faces: [&Pressed<'_>; 2]) -> f64 {
    let spread = faces.iter().map(|face| face.spread() * face.load).sum::<f64>();
    (spread / faces.iter().map(|face| face.load).sum::<f64>()).sqrt()
}

impl<'a, 'b> Problem<'a, 'b> {
    fn new(space: &Space, faces: [&'a Pressed<'b>; 2], distance: f64) -> Self {
        let reach = 2.0 / distance.abs();
        Self {
            faces,
            basis: [space.basis(0, distance), space.basis(1, distance)],
            active: space.dimensions(),
            units: Vector5::new(1.0, 1.0, 1.0 / length(faces), reach, reach),
            normal: faces[0].load + faces[1].load,
            evaluations: Cell::new(0),
        }
    }

    fn both(&self, z: &Vector5<f64>) -> Both {
        self.evaluations.set(self.evaluations.get() + 1);
        let mut sum = Both {
            value: 0.0,
            gradient: Vector5::zeros(),
            hessian: Matrix5::zeros(),
            faces: [Vector3::zeros(); 2],
        };
        let units = Matrix5::from_diagonal(&self.units);
        for k in 0..2 {
            let basis = self.basis[k] * units;
            let found = self.faces[k].dissipation(&(basis * z));
            sum.value += found.value / self.normal;
            sum.gradient += basis.tr_mul(&found.gradient) / self.normal;
            sum.hessian += basis.tr_mul(&(found.hessian * basis)) / self.normal;
            sum.faces[k] = found.gradient;
        }
        sum
    }

    /// Newton's method on `D^2/2 - w . z` where the function is smooth. At the end the length of
    /// `z` is `mu` in these units.
    fn interior(
        &self,
        w: &Vector5<f64>,
        start: Option<&Vector5<f64>>,
        patience: u32,
    ) -> Option<Slipping> {
        let w = w.component_mul(&self.units) / self.normal;
        let size = w.amax();
        let w = w / size;
        let mut z = start
            .map(|zeta| zeta.component_div(&self.units))
            .filter(|z| z.dot(&w) > 0.0 && z.iter().all(|x| x.is_finite()))
            .unwrap_or_else(|| self.ellipsoid(&w));
        // The best length along z: D^2 = w . z.
        let found = self.both(&z);
        let along = w.dot(&z) / (found.value * found.value);
        if !(along.is_finite() && along > 0.0) {
            return None;
        }
        z *= along;
        let mut at = Both {
            value: found.value * along,
            gradient: found.gradient,
            hessian: found.hessian / along,
            faces: found.faces,
        };
        let residual = |at: &Both| at.value * at.gradient - w;
        let merit = |at: &Both, z: &Vector5<f64>| 0.5 * at.value * at.value - w.dot(z);
        let mut error = residual(&at);
        let mut short = 0;
        for _ in 0..STEPS {
            if error.amax() <= ENOUGH || short == patience {
                break;
            }
            let mut matrix = at.gradient * at.gradient.transpose() + at.value * at.hessian;
            let trace = matrix.trace();
            for i in self.active..5 {
                matrix[(i, i)] = 1.0;
            }
            let mut moved = false;
            let (lifts, halvings) =
                if error.amax() <= ROUNDED { (1, 1) } else { (LIFTS.len(), HALVINGS) };
            for lift in &LIFTS[..lifts] {
                let lifted = matrix + *lift * trace * Matrix5::identity();
                let Some(factor) = lifted.cholesky() else { continue };
                let step = -factor.solve(&error);
                let slope = error.dot(&step);
                let here = merit(&at, &z);
                let mut t = 1.0;
                for _ in 0..halvings {
                    let tried = z + t * step;
                    let there = self.both(&tried);
                    let left = residual(&there);
                    // Near the answer rounding hides how the merit falls.
                    let is_better = if error.amax() > NEAR {
                        merit(&there, &tried) < here + 1e-4 * t * slope
                    } else {
                        left.amax() < 0.9 * error.amax()
                    };
                    if is_better {
                        short = if t < SHORT { short + 1 } else { 0 };
                        (z, at, error, moved) = (tried, there, left, true);
                        break;
                    }
                    t *= 0.5;
                }
                if moved {
                    break;
                }
            }
            if !moved {
                break;
            }
        }
        let lower = w.dot(&z) / at.value;
        let mu = lower * size;
        let upper = size * self.upper(&w, lower, &at, &error)?;
        // A twist that is not the best, e.g. caught at a crease: one found in haste is looked at again.
        let wide = if patience == HASTY { CLOSE } else { APART };
        if error.amax() > 1e-8 && upper > mu * (1.0 + wide) {
            return None;
        }
        Some(Slipping {
            mu,
            zeta: z.component_mul(&self.units),
            shares: at.faces.map(|share| mu * share),
            rolls_on: None,
            bounds: Bounds { lower: mu, upper: upper.max(mu) },
            evaluations: self.evaluations.get(),
        })
    }

    /// A twist from the ellipsoid of each face: the pressure's moments in place of its norm.
    fn ellipsoid(&self, w: &Vector5<f64>) -> Vector5<f64> {
        let mut matrix = Matrix5::zeros();
        let units = Matrix5::from_diagonal(&self.units);
        for k in 0..2 {
            let face = self.faces[k];
            let (n, c) = (face.load, face.centre());
            let polar = n * (face.spread() + c.length_squared());
            let inertia = Matrix3::new(
                n,
                0.0,
                -n * c.y, //
                0.0,
                n,
                n * c.x, //
                -n * c.y,
                n * c.x,
                polar,
            );
            let basis = self.basis[k] * units;
            matrix += basis.tr_mul(&(inertia * basis)) / self.normal;
        }
        for i in self.active..5 {
            matrix[(i, i)] = 1.0;
        }
        matrix.cholesky().map_or(*w, |factor| factor.solve(w))
    }

    /// Upper bound from the supports: what `w` has beyond `lower` times the support at the answer
    /// is made up of the supports of other motions; the sizes of the coefficients add up.
    fn upper(&self, w: &Vector5<f64>, lower: f64, at: &Both, error: &Vector5<f64>) -> Option<f64> {
        let left = w - lower * at.gradient;
        if left.amax() <= 4.0 * f64::EPSILON && error.amax() <= 1e-14 {
            return Some(lower + 5.0 * left.amax());
        }
        Some(lower + self.made_up(&left)?)
    }

    /// Sizes of the coefficients with which supports make up a load in units.
    fn made_up(&self, load: &Vector5<f64>) -> Option<f64> {
        // About the middle of pressure, so that a turn's support is a moment.
        let loads = self.faces[0].load + self.faces[1].load;
        let centre = (self.faces[0].first + self.faces[1].first) / loads;
        let mut supports = Matrix5::identity();
        for i in 0..self.active {
            let mut z = Vector5::zeros();
            z[i] = 1.0;
            if i == 2 {
                let turn = self.units[2];
                (z[0], z[1]) = (centre.y * turn, -centre.x * turn);
                self.evaluations.set(self.evaluations.get() + 1);
            }
            supports.set_column(i, &self.support(&z));
        }
        let coefficients = supports.lu().solve(load)?;
        Some(coefficients.iter().map(|c| c.abs()).sum())
    }

    /// The gradient of the dissipation alone.
    fn support(&self, z: &Vector5<f64>) -> Vector5<f64> {
        let zeta = z.component_mul(&self.units);
        let faces =
            [0, 1].map(|k| self.basis[k].tr_mul(&self.faces[k].support(&(self.basis[k] * zeta))));
        (faces[0] + faces[1]).component_mul(&self.units) / self.normal
    }

    /// Whether face `k` alone bears `load` at the friction `mu`: first by a bound, then by what it needs
    /// `alone`.
    fn bears(
        &self,
        k: usize,
        load: &Vector3<f64>,
        mu: f64,
        alone: impl FnOnce() -> Option<(f64, Vector5<f64>)>,
    ) -> bool {
        let face = self.faces[k];
        if load.x.hypot(load.y) > mu * face.load {
            return false;
        }
        self.evaluations.set(self.evaluations.get() + 1);
        if Bearing::of(face).bears(load) <= mu {
            return true;
        }
        alone().is_some_and(|(alone, _)| alone <= mu)
    }

    fn rests(&self, rolling: &Rolling) -> bool {
        let mu = rolling.answer.mu * AT_REST;
        self.bears(rolling.on, rolling.borne(), mu, || self.alone(rolling))
    }

    /// A candidate whose face at rest needs no more friction alone than `within` times its answer.
    fn tied(&self, rolling: &Rolling, within: f64) -> Option<Slipping> {
        let answer = rolling.answer;
        let (alone, _) = self.alone(rolling)?;
        let bounds = Bounds { lower: answer.mu, upper: answer.mu.max(alone) };
        (alone <= within * answer.mu).then_some(Slipping { bounds, ..answer })
    }

    /// [`rolling`] on face `k`: the answer if `k` carries the rest of the load at no more friction
    /// ([`Self::rests`]).
    fn rolling(&self, space: &Space, k: usize, distance: f64, w: &Vector5<f64>) -> Option<Rolling> {
        let other = self.faces[1 - k];
        if distance == 0.0 {
            return None;
        }
        let answer = rolling(&self.basis, space.spins.len(), k, w, (other.load, other.first))?;
        Some(Rolling::new(answer, k))
    }

    /// The friction that the face at rest needs for what it bears, and its motion if it moved.
    fn alone(&self, rolling: &Rolling) -> Option<(f64, Vector5<f64>)> {
        *rolling.alone.get_or_init(|| self.slips_alone(rolling.on, rolling.borne()))
    }

    /// The friction that face `k` alone needs for a load, and its motion.
    fn slips_alone(&self, k: usize, load: &Vector3<f64>) -> Option<(f64, Vector5<f64>)> {
        if load.amax() <= 1e-15 * self.normal {
            return Some((0.0, Vector5::zeros()));
        }
        let one = Problem {
            faces: [self.faces[k]; 2],
            basis: [Space::default().basis(k, 0.0), Matrix3x5::zeros()],
            active: 3,
            units: self.units,
            normal: self.faces[k].load,
            evaluations: Cell::new(0),
        };
        let w = Vector5::new(load.x, load.y, load.z, 0.0, 0.0);
        let answer = one.interior(&w, None, PATIENT).map(|slip| (slip.bounds.upper, slip.zeta));
        self.evaluations.set(self.evaluations.get() + one.evaluations.get());
        answer
    }

    /// A motion that does better than rolling on either face. Where Newton's method has run into a
    /// crease that is not the answer, it cannot come back to it from here.
    fn off_crease(
        &self,
        w: &Vector5<f64>,
        candidates: &[Option<Rolling>; 2],
    ) -> Option<Vector5<f64>> {
        let best =
            candidates.iter().flatten().max_by(|a, b| a.answer.mu.total_cmp(&b.answer.mu))?;
        let gain = |zeta: &Vector5<f64>| {
            w.dot(zeta) / (self.normal * self.both(&zeta.component_div(&self.units)).value)
        };
        // The face at rest is moved as it would move by itself.
        let (_, lifted) = self.alone(best)?;
        let zeta = best.answer.zeta;
        let size = |zeta: &Vector5<f64>| zeta.component_div(&self.units).norm();
        let ratio = size(&zeta) / size(&lifted);
        (0..25)
            .map(|i| zeta + ratio * 0.25_f64.powi(i) * 4.0 * lifted)
            .map(|zeta| (gain(&zeta), zeta))
            .filter(|(gain, _)| *gain > best.answer.mu)
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, zeta)| zeta)
    }

    fn counted(&self, answer: Slipping) -> Slipping {
        Slipping { evaluations: self.evaluations.get(), ..answer }
    }
}

/// A candidate: the body rolls on one face.
#[derive(Debug)]
struct Rolling {
    answer: Slipping,
    /// The face at rest.
    on: usize,
    /// [`Problem::alone`].
    alone: OnceCell<Option<(f64, Vector5<f64>)>>,
}

impl Rolling {
    fn new(answer: Slipping, on: usize) -> Self {
        Self { answer, on, alone: OnceCell::new() }
    }

    /// What the face at rest bears.
    fn borne(&self) -> &Vector3<f64> {
        &self.answer.shares[self.on]
    }
}

//! Grips of one part under one set of loads, from pose to numbers.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::backend::{
    Backend, Batch, Best, CurvedProblem, Pose, Problem, ScoreOptions, Scored, SeedSet, Watch,
    score_curved, score_curved_watched,
};
use crate::error::{Error, Result};
use crate::geometry::patch_area;
use crate::gripper::Gripper;
use crate::load::wrench_in_grip;
use crate::mechanics::twist_out::{self, FreeTwistOut, TwistOut};
use crate::mechanics::{curved, refused};
use crate::model::{Grip, LoadCase, Patch, Status, Surfaces, Wrench};
use crate::part::MassProperties;
use crate::rank::{self, Weights};
use crate::request::{Polish, Request};
use crate::results::{LoadScore, PadFriction, RankedGrip};

use super::limits::Limits;

/// What decides the answer, beside part, gripper and loads.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Gripping force \[N\].
    pub force: f64,
    /// Weights of the score.
    pub weights: Weights,
    /// Position uncertainty of the part along the pads while closing \[m\], for alpha.
    pub delta: f64,
    /// Pad friction while closing, for alpha.
    pub mu_c: f64,
    /// Friction of the pads and the safety asked for, for what holds and the force needed.
    pub pads: PadFriction,
    /// What the gripper may carry.
    pub limits: Limits,
    /// How loads are solved.
    pub score: ScoreOptions,
}

setters!(Settings {
    with_force: force: f64,
    with_weights: weights: Weights,
    with_delta: delta: f64,
    with_mu_c: mu_c: f64,
    with_pads: pads: PadFriction,
    with_limits: limits: Limits,
    with_score: score: ScoreOptions,
});

impl Settings {
    /// This gripping force \[N\], a pad friction that is not known, and defaults.
    pub fn of_force(force: f64) -> Self {
        Self {
            force,
            weights: Weights::default(),
            delta: 0.0,
            mu_c: 0.0,
            pads: PadFriction::default(),
            limits: Limits::default(),
            score: ScoreOptions::default(),
        }
    }

    /// The same with this friction of the pads.
    #[must_use]
    pub fn with_pad_friction(mut self, friction: Option<f64>) -> Self {
        self.pads.value = friction;
        self
    }

    /// What orders a grip with this `mu_s` and alpha, see [`rank::merit`].
    fn merit(&self, mu: f64, alpha: f64) -> f64 {
        let slips = self.pads.verdict(Some(mu)).holds() == Some(false);
        rank::merit(self.weights.score(mu, alpha), slips)
    }

    /// Those of a request with this gripper. Only the worst loads are solved: the others of grips
    /// that are kept come after the ranking.
    ///
    /// # Errors
    /// When the gripper does not have the force asked for.
    pub fn new(request: &Request, gripper: &Gripper) -> Result<Self> {
        let scoring = &request.scoring;
        Ok(Self {
            force: force(request, gripper)?,
            weights: Weights { k1: scoring.k1, k2: scoring.k2 },
            delta: scoring.position_error.0,
            mu_c: scoring.closing_friction,
            pads: PadFriction {
                value: scoring.pad_friction.or(gripper.pad_friction),
                safety: scoring.safety,
            },
            limits: Limits {
                pressure: scoring.max_pressure.map(|pressure| pressure.0),
                ..Limits::from(gripper)
            },
            score: ScoreOptions {
                polish: Polish::Worst,
                separation: scoring.separation,
                refiner: scoring.refiner,
            },
        })
    }
}

/// The gripping force \[N\]: the one asked for, or the gripper's largest.
fn force(request: &Request, gripper: &Gripper) -> Result<f64> {
    let [least, most] = gripper.force;
    let Some(force) = request.force.map(|force| force.0) else { return Ok(most) };
    let wrong = |problem: String, remedy: String| {
        Err(Error::input("force", problem, remedy).with_options(&["force"]))
    };
    if force.is_nan() || force <= 0.0 {
        return wrong(format!("is {force} N"), "give a force above zero".to_owned());
    }
    if force < least * (1.0 - 1e-9) || force > most * (1.0 + 1e-9) {
        return wrong(
            format!("{force} N is outside what {} can do", gripper.name),
            format!("give {least} N to {most} N"),
        );
    }
    Ok(force)
}

/// Scores grips of one part under one set of loads.
#[derive(Debug)]
pub struct Assessor<'a> {
    /// The loads, part frame, about the centre of mass.
    pub loads: &'a [LoadCase],
    /// The part's mass properties.
    pub mass: MassProperties,
    /// Settings.
    pub settings: &'a Settings,
    /// Where the seeds are computed.
    pub backend: &'a Backend,
    /// The twists tried.
    pub seeds: &'a SeedSet,
}

/// What a call that may be stopped has come to.
#[derive(Debug)]
pub(super) struct AssessedGrips {
    /// In order, those that can be among the best.
    pub(super) ranked: Vec<RankedGrip>,
    /// How many were left unscored.
    pub(super) left: usize,
}

/// Loads of one call of the backend: bounds the memory whatever the number of grips and loads.
pub(super) const LOADS_AT_ONCE: usize = 1 << 20;
/// The same where the answer of every load is kept for a while, some 250 bytes each.
const ANSWERS_AT_ONCE: usize = 1 << 17;
/// The same of grips on planes, whose loads are not copied: so many that a graphics processor seldom
/// waits while the last block of a call is solved.
const PLANE_LOADS_AT_ONCE: usize = 1 << 23;

impl AssessedGrips {
    /// Takes along grips with their answers: those left unscored are counted, those out of the race dropped.
    fn take<T: Send>(
        &mut self,
        grips: impl IndexedParallelIterator<Item = T>,
        scored: Vec<Option<Scored>>,
        measure: impl Fn(T, &Scored) -> RankedGrip + Sync + Send,
    ) {
        self.left += scored.iter().filter(|scored| scored.is_none()).count();
        self.ranked.par_extend(grips.zip(scored).filter_map(|(grip, scored)| {
            let scored = scored.filter(|scored| !scored.outranked)?;
            Some(measure(grip, &scored))
        }));
    }
}

impl Assessor<'_> {
    /// The grips without those under a load that the gripper may not carry, and how many fell to
    /// which limit.
    pub fn carried(&self, mut grips: Vec<Grip>) -> (Vec<Grip>, BTreeMap<String, u64>) {
        let mut over = BTreeMap::new();
        if !self.settings.limits.is_empty() {
            let reasons: Vec<Option<String>> =
                grips.par_iter().map(|grip| self.over(grip)).collect();
            let mut of_grip = reasons.iter();
            grips.retain(|_| of_grip.next().is_some_and(Option::is_none));
            reasons.into_iter().flatten().for_each(|reason| *over.entry(reason).or_default() += 1);
        }
        (grips, over)
    }

    /// The limit of the gripper that a load exceeds in this grip, as rejections name it.
    pub(super) fn over(&self, grip: &Grip) -> Option<String> {
        let limits = &self.settings.limits;
        if limits.is_empty() {
            return None;
        }
        let exceeded = limits.exceeded(&self.wrenches(grip));
        exceeded.or_else(|| limits.marks(grip, self.settings.force))
    }

    /// Scores every grip under its worst load, in order. The answers depend neither on the number
    /// of threads nor on the backend.
    ///
    /// # Errors
    /// As [`Backend::score`].
    pub fn assess(&self, grips: Vec<Grip>) -> Result<Vec<RankedGrip>> {
        Ok(Watch::none(|watch| self.assess_watched(grips, None, watch))?.ranked)
    }

    /// As [`Assessor::assess`] until `watch` stops it. With `best`, the merits so far, without the grips
    /// whose bounds show that they cannot be among them; the weight `k1` must then not be negative.
    ///
    /// # Errors
    /// As [`Backend::score`].
    pub(super) fn assess_watched(
        &self,
        grips: Vec<Grip>,
        mut best: Option<&mut Best>,
        watch: &Watch<'_>,
    ) -> Result<AssessedGrips> {
        let most = |loads: usize| (loads / self.loads.len().max(1)).max(1);
        let mut done = AssessedGrips { ranked: Vec::with_capacity(grips.len()), left: 0 };
        let mut grips = grips.into_iter().peekable();
        while let Some(first) = grips.peek() {
            // Those on planes and the others by turns: mostly all of one kind.
            let curved = first.surfaces.is_some();
            let most = most(if curved { LOADS_AT_ONCE } else { PLANE_LOADS_AT_ONCE });
            let mut block = Vec::new();
            while block.len() < most
                && let Some(grip) = grips.next_if(|grip| grip.surfaces.is_some() == curved)
            {
                block.push(grip);
            }
            if watch.is_stopped() {
                done.left += block.len();
                continue;
            }
            let best = best.as_deref_mut();
            if curved {
                self.assess_curved(block, best, watch, &mut done);
            } else {
                self.assess_plane(block, best, watch, &mut done)?;
            }
        }
        Ok(done)
    }

    fn assess_plane(
        &self,
        grips: Vec<Grip>,
        best: Option<&mut Best>,
        watch: &Watch<'_>,
        done: &mut AssessedGrips,
    ) -> Result<()> {
        let score = &self.settings.score;
        let wrenches = self.in_part();
        let batch =
            Batch { problems: grips.iter().map(|grip| self.problem(grip, &wrenches)).collect() };
        let scored = match best {
            None => self.backend.score_watched(&batch, self.seeds, score, watch)?,
            Some(best) => {
                let alphas: Vec<f64> = grips
                    .par_iter()
                    .map(|grip| self.alpha(grip, least(&TwistOut::new(&grip.contact))))
                    .collect();
                let merit = |index: usize, mu: f64| self.settings.merit(mu, alphas[index]);
                let race = (best, &merit as &(dyn Fn(usize, f64) -> f64 + Sync));
                self.backend.score_best_watched(&batch, self.seeds, score, race, watch)?
            }
        };
        done.take(grips.into_par_iter(), scored, |grip, scored| {
            let lever = TwistOut::new(&grip.contact);
            let margin = |wrench: &Wrench| lever.margin(self.settings.force, wrench);
            self.measure(grip, scored, least(&lever), &margin)
        });
        Ok(())
    }

    fn assess_curved(
        &self,
        grips: Vec<Grip>,
        best: Option<&mut Best>,
        watch: &Watch<'_>,
        done: &mut AssessedGrips,
    ) {
        let ready = Surfaced::new(grips.iter(), self.settings.force);
        let wrenches: Vec<Vec<Wrench>> = grips.par_iter().map(|grip| self.wrenches(grip)).collect();
        let problems: Vec<CurvedProblem<'_>> = grips
            .iter()
            .zip(&wrenches)
            .map(|(grip, wrenches)| self.curved_problem(grip, &ready, wrenches))
            .collect();
        let lever = |grip: &Grip| {
            let free = ready.of(grip).map_or_else(Vec::new, |ready| ready.free.clone());
            FreeTwistOut::new(&grip.contact, free)
        };
        let levers: Vec<FreeTwistOut> = grips.par_iter().map(lever).collect();
        let least = |lever: &FreeTwistOut| lever.least_lever().unwrap_or(0.0);
        let merit = |index: usize, mu: f64| {
            self.settings.merit(mu, self.alpha(&grips[index], least(&levers[index])))
        };
        let polish = self.settings.score.polish;
        let scored = score_curved_watched(&problems, polish, best, &merit, watch);
        done.take(grips.into_par_iter().zip(levers), scored, |(grip, lever), scored| {
            let margin = |wrench: &Wrench| lever.margin(self.settings.force, wrench);
            self.measure(grip, scored, least(&lever), &margin)
        });
    }

    fn curved_problem<'a>(
        &self,
        grip: &Grip,
        ready: &'a Surfaced,
        wrenches: &'a [Wrench],
    ) -> CurvedProblem<'a> {
        CurvedProblem {
            pads: ready.of(grip).map(|ready| &ready.pads),
            distance: grip.distance(),
            force: self.settings.force,
            wrenches,
        }
    }

    /// The loads as a grip sees them.
    pub(super) fn wrenches(&self, grip: &Grip) -> Vec<Wrench> {
        self.loads.iter().map(|load| self.wrench(grip, load)).collect()
    }

    pub(super) fn wrench(&self, grip: &Grip, load: &LoadCase) -> Wrench {
        wrench_in_grip(&load.wrench, self.mass.centre_of_mass, &grip.part_from_grip)
    }

    /// The loads as they are on the part, for all grips.
    pub(super) fn in_part(&self) -> Vec<Wrench> {
        self.loads.iter().map(|load| load.wrench).collect()
    }

    pub(super) fn problem<'a>(&self, grip: &'a Grip, wrenches: &'a [Wrench]) -> Problem<'a> {
        Problem {
            contact: &grip.contact,
            distance: grip.distance(),
            force: self.settings.force,
            wrenches,
            pose: Some(Pose {
                centre_of_mass: self.mass.centre_of_mass,
                part_from_grip: grip.part_from_grip,
            }),
        }
    }

    /// Alpha \[rad\] for the least lever \[m\].
    ///
    /// The width counts for grips from inside too: jaws that push outwards right a part up to `asin
    /// w/d`, which is more than `atan w/d`.
    fn alpha(&self, grip: &Grip, least: f64) -> f64 {
        twist_out::alpha(grip.width, least, self.settings.delta, self.settings.mu_c)
    }

    /// A grip's numbers from its worst load; what takes more solving is left to
    /// [`Assessor::finish`]. `margin`: against twisting out under a load.
    fn measure(
        &self,
        grip: Grip,
        scored: &Scored,
        least: f64,
        margin: &dyn Fn(&Wrench) -> f64,
    ) -> RankedGrip {
        let (load, score) = scored.worst.unwrap_or((0, refused(Status::NoContact, 0)));
        let wrench =
            self.loads.get(load).map_or_else(Wrench::default, |load| self.wrench(&grip, load));
        // Under a pull on one pad a round face is pressed more than without a load on the other.
        let share = |left: f64, patch: &Patch| (left / patch_area(patch)).min(1.0);
        let contact_share = share(score.contact_area_i, &grip.contact.face_i)
            .min(share(score.contact_area_ii, &grip.contact.face_ii));
        let worst = LoadScore {
            load: load as u32,
            wrench,
            status: score.status,
            mu_s: score.mu_s,
            slip: score.slip,
            pressure: score.pressure,
            bounds: score.bounds,
            residual: score.residual,
        };
        let needed = self.settings.pads.value.zip(score.mu_s).filter(|(_, mu)| *mu > 0.0);
        RankedGrip {
            alpha: self.alpha(&grip, least),
            delta_d: twist_out::delta_d(grip.width, least),
            contact_share,
            twist_margin: margin(&wrench),
            safety: needed.map(|(friction, mu)| friction / mu),
            mu_by_load: scored.all.iter().map(|score| score.mu_s).collect(),
            ..RankedGrip::new(grip, worst)
        }
    }

    /// Solves every load exactly for the grips that do not have all of them yet, and keeps each
    /// load's `mu_s`. Nothing else changes.
    ///
    /// # Errors
    /// As [`Backend::score`].
    pub fn solve_every_load(&self, grips: &mut [&mut RankedGrip]) -> Result<()> {
        let options = ScoreOptions { polish: Polish::All, ..self.settings.score };
        let mut open: Vec<&mut &mut RankedGrip> =
            grips.iter_mut().filter(|ranked| ranked.mu_by_load.len() != self.loads.len()).collect();
        for block in open.chunks_mut((ANSWERS_AT_ONCE / self.loads.len().max(1)).max(1)) {
            let in_part = self.in_part();
            let plane = block.iter().filter(|ranked| ranked.grip.surfaces.is_none());
            let problems = plane.map(|ranked| self.problem(&ranked.grip, &in_part));
            let batch = Batch { problems: problems.collect() };
            let ready = Surfaced::new(block.iter().map(|ranked| &ranked.grip), self.settings.force);
            let curved: Vec<&Grip> = block
                .iter()
                .map(|ranked| &ranked.grip)
                .filter(|grip| grip.surfaces.is_some())
                .collect();
            let wrenches: Vec<Vec<Wrench>> =
                curved.par_iter().map(|grip| self.wrenches(grip)).collect();
            let problems: Vec<CurvedProblem<'_>> = curved
                .iter()
                .zip(&wrenches)
                .map(|(grip, wrenches)| self.curved_problem(grip, &ready, wrenches))
                .collect();
            let mut curved = score_curved(&problems, Polish::All).into_iter();
            let mut plane = self.backend.score(&batch, self.seeds, &options)?.into_iter();
            for ranked in block.iter_mut() {
                let one = if ranked.grip.surfaces.is_some() { curved.next() } else { plane.next() };
                let all = one.map_or_else(Vec::new, |scored| scored.all);
                ranked.mu_by_load = all.iter().map(|score| score.mu_s).collect();
            }
        }
        Ok(())
    }
}

/// The least lever of a contact, zero without one \[m\].
fn least(lever: &TwistOut) -> f64 {
    lever.least_lever().map_or(0.0, |lever| lever.width)
}

/// Surfaces of some grips made ready, each once.
pub(super) struct Surfaced(FxHashMap<usize, Ready>);

/// A contact that is not plane.
pub(super) struct Ready {
    pub(super) pads: curved::Pads,
    /// Axes about which the part can turn in it.
    free: Vec<DVec2>,
}

impl Surfaced {
    pub(super) fn new<'a>(grips: impl Iterator<Item = &'a Grip>, force: f64) -> Self {
        let mut found: FxHashMap<usize, (&Surfaces, f64)> = FxHashMap::default();
        for grip in grips {
            if let Some(surfaces) = &grip.surfaces {
                found.insert(Self::key(surfaces), (surfaces, grip.distance()));
            }
        }
        let ready = found.into_par_iter().filter_map(|(key, (surfaces, distance))| {
            let pads = curved::Pads::new(surfaces).ok()?;
            let free = pads.free_axes(distance, force);
            Some((key, Ready { pads, free }))
        });
        Self(ready.collect())
    }

    /// Grips that share surfaces lie on one site: their faces are equally far apart.
    fn key(surfaces: &Arc<Surfaces>) -> usize {
        Arc::as_ptr(surfaces) as usize
    }

    pub(super) fn of(&self, grip: &Grip) -> Option<&Ready> {
        self.0.get(&Self::key(grip.surfaces.as_ref()?))
    }
}

//! The main job: from a part, a gripper and loads to a ranked list of grips.
//!
//! Candidates flow through in chunks: proposed, scored under every load, measured; only the best [`Settings::keep`] stay.

use rayon::prelude::*;

use crate::load::wrench_in_grip;
use crate::mechanics::{Options, Pads, Refiner, Separation, inverse, refused, solve_pads, twist_out};
use crate::model::{Grip, Score, Status};
use crate::part::MassProperties;
use crate::rank::{self, Weights};
use crate::results::{LoadCase, LoadScore, RankedGrip};

/// What decides the answer, beside part, gripper and loads.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Gripping force [N].
    pub force: f64,
    /// Weights of the score.
    pub weights: Weights,
    /// Position uncertainty of the part along the pads while closing [m], for alpha.
    pub delta: f64,
    /// Pad friction while closing, for alpha.
    pub mu_c: f64,
    /// Pad friction for safety and the force needed; `None`: the gripper's, if it states one.
    pub pad_friction: Option<f64>,
    /// What to do with grips that separate.
    pub separation: Separation,
    /// Minimiser that polishes the final answers.
    pub refiner: Refiner,
    /// Whether to keep `mu_s` of every load.
    pub all_loads: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            force: 50.0,
            weights: Weights::default(),
            delta: 0.0,
            mu_c: 0.0,
            pad_friction: None,
            separation: Separation::Solve,
            refiner: Refiner::Newton,
            all_loads: false,
        }
    }
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
}

impl Assessor<'_> {
    /// Scores every grip under its worst load, in order. The answers do not depend on the number of threads.
    pub fn assess(&self, grips: Vec<Grip>) -> Vec<RankedGrip> {
        grips.into_par_iter().map(|grip| self.assess_one(grip)).collect()
    }

    fn assess_one(&self, grip: Grip) -> RankedGrip {
        let options = Options { separation: self.settings.separation, refiner: self.settings.refiner, ..Options::default() };
        let pads = Pads::new(&grip.contact);
        let scores: Vec<(crate::model::Wrench, Score)> = self
            .loads
            .iter()
            .map(|load| {
                let wrench = wrench_in_grip(&load.wrench, self.mass.centre_of_mass, &grip.part_from_grip);
                let score = match &pads {
                    Some(pads) => solve_pads(pads, grip.width, self.settings.force, &wrench, &options),
                    None => refused(Status::NoContact, 0),
                };
                (wrench, score)
            })
            .collect();
        let worst = worst(scores.iter().map(|(_, score)| score));
        let (wrench, score) = scores[worst];
        let mu_by_load = if self.settings.all_loads { scores.iter().map(|(_, score)| score.mu_s).collect() } else { Vec::new() };
        self.measure(grip, worst as u32, wrench, &score, pads.as_ref(), mu_by_load)
    }

    /// The rest of a grip's numbers from its worst load.
    fn measure(&self, grip: Grip, load: u32, wrench: crate::model::Wrench, score: &Score, pads: Option<&Pads>, mu_by_load: Vec<Option<f64>>) -> RankedGrip {
        let lever = twist_out::TwistOut::new(&grip.contact);
        let least = lever.least_lever().map_or(0.0, |lever| lever.width);
        let nominal = pads.map(|pads| [0, 1].map(|k| pads.moments[k][0] * pads.length * pads.length));
        let contact_share = nominal.map_or(0.0, |[i, ii]| (score.contact_area_i / i).min(score.contact_area_ii / ii));
        let friction = self.settings.pad_friction;
        let options = Options { separation: self.settings.separation, ..Options::default() };
        let force_needed = friction
            .zip(pads)
            .filter(|_| score.status.holds())
            .and_then(|(friction, pads)| inverse::force_needed(pads, grip.width, &wrench, friction, &options));
        RankedGrip {
            rank: 0,
            score: None,
            alpha: twist_out::alpha(grip.width, least, self.settings.delta, self.settings.mu_c),
            delta_d: twist_out::delta_d(grip.width, least),
            contact_share,
            twist_margin: lever.margin(self.settings.force, &wrench),
            safety: friction.zip(score.mu_s).filter(|(_, mu)| *mu > 0.0).map(|(friction, mu)| friction / mu),
            force_needed,
            worst: LoadScore {
                load,
                wrench,
                status: score.status,
                mu_s: score.mu_s,
                slip: score.slip,
                pressure: score.pressure,
                bounds: score.bounds,
                residual: score.residual,
            },
            mu_by_load,
            grip,
        }
    }
}

/// Index of the worst score: one without a usable `mu_s` first, then the largest `mu_s`; scores within [`rank::TIE`] of
/// each other count as equal and the first of them is taken.
pub fn worst<'a>(scores: impl Iterator<Item = &'a Score>) -> usize {
    let mut worst: Option<(usize, Option<f64>)> = None;
    for (index, score) in scores.enumerate() {
        let mu = score.mu_s.filter(|_| score.status.holds());
        let worse = match (worst, mu) {
            (None, _) | (Some((_, Some(_))), None) => true,
            (Some((_, Some(known))), Some(mu)) => mu > known * (1.0 + rank::TIE),
            (Some((_, None)), _) => false,
        };
        if worse {
            worst = Some((index, mu));
        }
    }
    worst.map_or(0, |(index, _)| index)
}

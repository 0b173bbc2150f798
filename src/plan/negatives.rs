//! A sample of the candidates that are no grips, as training and test data want both kinds.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::Plan;
use super::outside::of_run;
use crate::error::Result;
use crate::load::wrench_in_grip;
use crate::mechanics::inverse::load_multiple;
use crate::mechanics::twist_out::TwistOut;
use crate::mechanics::{Options, Pads, solve_pads};
use crate::model::{LoadCase, Miss, Negative, Wrench};
use crate::part::Part;
use crate::propose::Proposer;
use crate::results::GripSet;

/// Rejected candidates of each reason that a page shows, at most.
const SHOWN: usize = 60;
/// Grips that do not hold of each reason that are looked at where none holds.
const TOLD: usize = 20;
/// Loads among which the one is sought that a grip loses, those that tilt the part most.
const TRIED: usize = 12;
/// Friction of pads of which none is stated: the most that a gripper file may state.
const MOST_FRICTION: f64 = 10.0;
/// A pose found again on its faces is off by rounding only \[rad\].
const SAME: f64 = 1e-6;

impl Plan {
    /// Grips that do not hold to keep of each reason, for the result file and for the page.
    pub(super) fn sample(&self) -> usize {
        let page = if self.request.output.report.is_some() { SHOWN } else { TOLD };
        self.request.selection.negatives.max(page)
    }

    /// How much of the load is held at best where every place loses it, in words; of those that
    /// `lost` has.
    pub(super) fn nearest_lost(
        &self,
        proposer: &Proposer<'_>,
        lost: &BTreeMap<String, Vec<Negative>>,
    ) -> Option<String> {
        let poses: Vec<&Negative> =
            lost.values().flat_map(|list| list.iter().take(SHOWN)).collect();
        let misses = self.judge(proposer).lost(&poses);
        let best = misses.iter().filter_map(|miss| miss.by).min_by(f64::total_cmp)?;
        Some(format!(
            "the best of {} places looked at holds {:.0} % of the load that is the first to tilt or pull \
             the part out, at {} N per jaw",
            poses.len(),
            (1.0 - best) * 100.0,
            self.settings.force
        ))
    }

    fn judge<'a>(&'a self, proposer: &'a Proposer<'a>) -> Judge<'a> {
        Judge {
            proposer,
            loads: &self.loads,
            centre_of_mass: self.mass.centre_of_mass,
            force: self.settings.force,
            friction: self.settings.pads.value,
        }
    }

    /// The rejected candidates that the page shows, where the request asks for one. `lost`: grips
    /// that do not hold, by reason.
    pub(super) fn misses(
        &self,
        proposer: &Proposer<'_>,
        lost: &BTreeMap<String, Vec<Negative>>,
    ) -> Vec<Miss> {
        if self.request.output.report.is_none() {
            return Vec::new();
        }
        let mut misses = proposer.misses(SHOWN);
        let lost: Vec<&Negative> = lost.values().flat_map(|list| list.iter().take(SHOWN)).collect();
        misses.extend(self.judge(proposer).lost(&lost));
        misses
    }

    /// As many candidates that are no grips as the request asks for, in the order of their ids.
    /// `lost`: grips that do not hold, by reason.
    pub(super) fn negatives(
        &self,
        proposer: &Proposer<'_>,
        mut lost: BTreeMap<String, Vec<Negative>>,
    ) -> Vec<Negative> {
        let count = self.request.selection.negatives;
        if count == 0 {
            return Vec::new();
        }
        // The page may have asked for more of them.
        lost.values_mut().for_each(|list| list.truncate(count));
        for pose in proposer.rejected(count) {
            lost.entry(pose.reason.clone()).or_default().push(pose);
        }
        let mut chosen = share(lost.into_values().collect(), count);
        chosen.sort_by_key(|pose| pose.id);
        chosen
    }
}

/// Rejected candidates of the run that made a set, as a page shows them. `part` must be the part
/// of the set. Of grips that do not hold only those that the set keeps are among them.
///
/// # Errors
/// When the set's gripper is none, or the run's options do not fit the part, or name a scene that
/// cannot be read.
pub fn near_misses(set: &GripSet, part: &Part) -> Result<Vec<Miss>> {
    let (part, gripper, options) = of_run(set, part)?;
    let proposer = Proposer::new(&part, &gripper, &options)?;
    let mut misses = proposer.misses(SHOWN);
    let proposed: Vec<String> = misses.iter().map(|miss| miss.pose.reason.clone()).collect();
    let others: Vec<&Negative> =
        set.negatives.iter().filter(|pose| !proposed.contains(&pose.reason)).collect();
    let judge = Judge {
        proposer: &proposer,
        loads: &set.loads,
        centre_of_mass: set.part.mass.centre_of_mass,
        force: set.provenance.resolved.force.0,
        friction: set.pads().value,
    };
    misses.extend(judge.lost(&others));
    Ok(misses)
}

/// What decides whether a grip holds.
struct Judge<'a> {
    proposer: &'a Proposer<'a>,
    loads: &'a [LoadCase],
    centre_of_mass: DVec3,
    force: f64,
    friction: Option<f64>,
}

impl Judge<'_> {
    /// Grips that do not hold.
    fn lost(&self, poses: &[&Negative]) -> Vec<Miss> {
        let miss = |pose: &&Negative| Miss::new((*pose).clone(), self.not_held(pose), None);
        poses.par_iter().map(miss).collect()
    }

    /// The share of a load that a grip does not hold, of the load that tilts the part most among
    /// those that are lost. Of contacts that are not plane nobody asks: the answer takes long.
    fn not_held(&self, pose: &Negative) -> Option<f64> {
        let fit = self.proposer.fit(&pose.part_from_grip, SAME).ok()?;
        let grip = self.proposer.grip_at(&fit, pose.id);
        if grip.surfaces.is_some() {
            return None;
        }
        let (pads, lever) = (Pads::new(&grip.contact)?, TwistOut::new(&grip.contact));
        let wrench = |load: &LoadCase| {
            wrench_in_grip(&load.wrench, self.centre_of_mass, &grip.part_from_grip)
        };
        let mut wrenches: Vec<(f64, Wrench)> = self
            .loads
            .iter()
            .map(wrench)
            .map(|wrench| (lever.margin(self.force, &wrench), wrench))
            .collect();
        wrenches.sort_by(|a, b| a.0.total_cmp(&b.0));
        let options = Options::default();
        // Friction may hold a load that tilts the part more.
        let is_lost = |wrench: &&Wrench| {
            !solve_pads(&pads, grip.distance(), self.force, wrench, &options).status.holds()
        };
        let worst = wrenches.iter().map(|(_, wrench)| wrench).take(TRIED).find(is_lost)?;
        let friction = self.friction.filter(|value| *value > 0.0).unwrap_or(MOST_FRICTION);
        let held = load_multiple(&pads, grip.distance(), self.force, worst, friction, &options);
        Some((1.0 - held).max(0.0))
    }
}

/// The first ones of each list, `count` in all, as evenly as the lengths of the lists allow.
fn share(mut lists: Vec<Vec<Negative>>, mut count: usize) -> Vec<Negative> {
    lists.sort_by_key(Vec::len);
    let mut chosen = Vec::new();
    let mut left = lists.len();
    for mut list in lists {
        list.truncate(count / left);
        (count, left) = (count - list.len(), left - 1);
        chosen.append(&mut list);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Frame;

    #[test]
    fn rare_reasons_leave_their_share_to_the_others() {
        let list = |reason: &str, count: u64| {
            let pose = |id| Negative {
                id,
                part_from_grip: Frame::IDENTITY,
                width: 0.01,
                face_i: 0,
                face_ii: 1,
                angle: 0.0,
                inside: false,
                reason: reason.to_owned(),
            };
            (0..count).map(pose).collect::<Vec<_>>()
        };
        let lists = || vec![list("often", 100), list("rare", 2), list("some", 30)];
        let counts = |count: usize| {
            let chosen = share(lists(), count);
            ["rare", "some", "often"]
                .map(|reason| chosen.iter().filter(|pose| pose.reason == reason).count())
        };
        assert_eq!(counts(30), [2, 14, 14]);
        assert_eq!(counts(31), [2, 14, 15]);
        assert_eq!(counts(1000), [2, 30, 100]);
        assert_eq!(counts(0), [0, 0, 0]);
        assert!(share(Vec::new(), 10).is_empty());
    }
}

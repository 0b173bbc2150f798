//! A sample of the candidates that are no grips, as training and test data want both kinds.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Plan;
use super::outside::of_run;
use crate::error::Result;
use crate::model::{Miss, Negative};
use crate::part::Part;
use crate::propose::Proposer;
use crate::results::GripSet;

/// Rejected candidates of each reason that a page shows, at most.
const SHOWN: usize = 60;

impl Plan {
    /// Grips that do not hold to keep of each reason, for the result file and for the page.
    pub(super) fn sample(&self) -> usize {
        let page = if self.request.output.report.is_some() { SHOWN } else { 0 };
        self.request.selection.negatives.max(page)
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
        let lost = lost.values().flat_map(|list| list.iter().take(SHOWN));
        misses.extend(lost.map(|pose| lost_grip(pose, self.mass.centre_of_mass)));
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
    let mut misses = Proposer::new(&part, &gripper, &options)?.misses(SHOWN);
    let proposed: Vec<String> = misses.iter().map(|miss| miss.pose.reason.clone()).collect();
    let others = set.negatives.iter().filter(|pose| !proposed.contains(&pose.reason));
    misses.extend(others.map(|pose| lost_grip(pose, set.part.mass.centre_of_mass)));
    Ok(misses)
}

/// A grip that does not hold.
fn lost_grip(pose: &Negative, centre_of_mass: DVec3) -> Miss {
    let away = pose.part_from_grip.origin.distance(centre_of_mass);
    Miss::new(pose.clone(), Some(away), None)
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

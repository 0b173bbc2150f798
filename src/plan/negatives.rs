//! A sample of the candidates that are no grips, as training and test data want both kinds.

use std::collections::BTreeMap;

use super::Plan;
use crate::model::Negative;
use crate::propose::Proposer;

impl Plan {
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
        for pose in proposer.rejected(count) {
            lost.entry(pose.reason.clone()).or_default().push(pose);
        }
        let mut chosen = share(lost.into_values().collect(), count);
        chosen.sort_by_key(|pose| pose.id);
        chosen
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

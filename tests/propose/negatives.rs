//! The sample of candidates that are no grips.

use std::collections::{BTreeMap, BTreeSet};

use gripfast::gripper::{self, Gripper};
use gripfast::model::{Grip, Negative};
use gripfast::part::{Part, ReadOptions};
use gripfast::propose::{ProposeOptions, Proposer};

fn part(name: &str) -> Part {
    let path = crate::support::root().join("data/parts").join(name);
    Part::read(&path, &ReadOptions::default()).unwrap()
}

/// Few candidates.
fn options() -> ProposeOptions {
    ProposeOptions::default().with_spacing(Some(0.008)).with_angle_step(45_f64.to_radians())
}

fn grips(part: &Part, gripper: &Gripper, options: &ProposeOptions) -> Vec<Grip> {
    let proposer = Proposer::new(part, gripper, options).unwrap();
    proposer.flat_map(|chunk| chunk.grips).collect()
}

fn by_reason(poses: &[Negative]) -> BTreeMap<&str, u64> {
    let mut counts = BTreeMap::new();
    poses.iter().for_each(|pose| *counts.entry(pose.reason.as_str()).or_default() += 1);
    counts
}

#[test]
fn all_of_them_are_what_the_run_counts_and_what_a_look_at_each_says() {
    let franka = gripper::find("franka-hand").unwrap();
    // Not symmetric: each pose is tried with exchanged jaws as well.
    let mut lopsided = franka.clone();
    lopsided.palm.push(lopsided.palm[0].clone());
    let last = lopsided.palm.last_mut().unwrap();
    last.grip_from_body.origin.y += 0.07;
    last.name = "camera".into();
    assert!(franka.is_symmetric() && !lopsided.is_symmetric());
    for name in ["l_bracket.stl", "pocket_plate.stl", "t_slot_bar.stl"] {
        for gripper in [&franka, &lopsided] {
            let part = part(name);
            let mut proposer = Proposer::new(&part, gripper, &options()).unwrap();
            let before = proposer.rejected(1_000_000);
            let kept: BTreeSet<u64> =
                proposer.by_ref().flat_map(|chunk| chunk.grips).map(|grip| grip.id).collect();
            let all = proposer.rejected(1_000_000);
            assert_eq!(before, all, "the stream changes nothing");
            let counted: BTreeMap<&str, u64> = (proposer.tally().rejections.iter())
                .filter(|(reason, _)| !reason.starts_with("face_pair"))
                .map(|(reason, count)| (reason.as_str(), *count))
                .collect();
            assert_eq!(by_reason(&all), counted, "{name}");
            let ids: BTreeSet<u64> = all.iter().map(|pose| pose.id).collect();
            assert_eq!(ids.len(), all.len());
            assert!(ids.is_disjoint(&kept));
            for pose in all.iter().step_by(7) {
                let explained =
                    proposer.explain_pose(pose.face_i, pose.face_ii, &pose.part_from_grip).unwrap();
                assert_eq!(explained.rejection.unwrap().name(), pose.reason, "{name} {}", pose.id);
                assert!(
                    explained
                        .part_from_grip
                        .rotation
                        .abs_diff_eq(pose.part_from_grip.rotation, 1e-9)
                );
            }
        }
    }
}

/// Without bodies nothing collides: what did is a grip there, of the same number and pose. The
/// places besides the grid depend on the bodies, and have numbers after it.
#[test]
fn a_pose_that_collides_has_the_number_that_it_would_have_as_a_grip() {
    let part = part("l_bracket.stl");
    let gripper = gripper::find("franka-hand").unwrap();
    let bare = Gripper { fingers: Vec::new(), palm: Vec::new(), ..gripper.clone() };
    let free: BTreeMap<u64, Grip> =
        grips(&part, &bare, &options()).into_iter().map(|grip| (grip.id, grip)).collect();
    let proposer = Proposer::new(&part, &gripper, &options()).unwrap();
    let sites = proposer.sites();
    let grid: usize = sites.iter().map(|site| site.positions.len() * site.angles.len()).sum();
    let rejected = proposer.rejected(1_000_000);
    let hit = rejected.iter().filter(|pose| {
        pose.id < grid as u64
            && (pose.reason.starts_with("part_interference")
                || pose.reason.starts_with("approach_blocked"))
    });
    let mut count = 0;
    for pose in hit {
        let grip = &free[&pose.id];
        assert_eq!((grip.part_from_grip, grip.width), (pose.part_from_grip, pose.width));
        assert_eq!(
            (grip.face_i, grip.face_ii, grip.angle),
            (pose.face_i, pose.face_ii, pose.angle)
        );
        count += 1;
    }
    assert!(count > 100, "{count}");
}

#[test]
fn a_sample_is_a_part_of_all_and_the_same_on_any_number_of_threads() {
    let part = part("l_bracket.stl");
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let proposer = Proposer::new(&part, &gripper, &options()).unwrap();
    let all = proposer.rejected(1_000_000);
    let few = proposer.rejected(5);
    assert!(by_reason(&few).values().all(|&count| count <= 5));
    assert_eq!(by_reason(&few).len(), by_reason(&all).len(), "every reason has some");
    assert!(few.iter().all(|pose| all.contains(pose)));
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| proposer.rejected(5)), few);
    }
}

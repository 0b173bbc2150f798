//! The sample of candidates that are no grips.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use gripfast::gripper::{self, Gripper};
use gripfast::model::{Grip, Negative};
use gripfast::part::{Part, ReadOptions};
use gripfast::propose::{Cone, Ground, ProposeOptions, Proposer};

use crate::options::cuboid;

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

/// A tall box under a housing: how deep the housing would sit in it follows from the dimensions.
#[test]
fn a_miss_says_how_deep_a_body_sits_and_where() {
    let gripper = gripper::find("generic").unwrap();
    let (side, tall) = (0.02, 0.2);
    let part = cuboid(side, side, tall);
    let proposer = Proposer::new(&part, &gripper, &options()).unwrap();
    let misses = proposer.misses(100);
    let candidates: Vec<Negative> = misses.iter().map(|miss| miss.pose.clone()).collect();
    let pair = candidates.iter().filter(|pose| pose.reason.starts_with("face_pair")).count();
    assert_eq!(pair, 1, "the box is longer than the stroke");
    assert_eq!(&candidates[pair..], proposer.rejected(100), "the same sample, measured");
    let [housing] = &gripper.palm[..] else { panic!("one palm body") };
    let bounds = housing.bounds();
    let front = bounds.iter().fold(f64::NEG_INFINITY, |most, x| most.max(x.x));
    let half = bounds.iter().fold(0.0_f64, |most, x| most.max(x.y));
    let mut compared = 0;
    for miss in misses.iter().filter(|miss| miss.pose.reason == "part_interference:housing") {
        let frame = &miss.pose.part_from_grip;
        let along = frame.rotation.x_axis;
        if along.z.abs() < 0.999 {
            continue;
        }
        // From the box's end that the gripper comes from to the housing's front.
        let end = if along.z < 0.0 { tall - frame.origin.z } else { frame.origin.z };
        let middle = DVec3::new(side / 2.0, side / 2.0, frame.origin.z);
        let offset = (frame.origin - middle).dot(frame.rotation.y_axis).abs();
        let expected = (end + front).min(half + side / 2.0 - offset);
        let by = miss.by.unwrap();
        assert!((by - expected).abs() < 2e-5, "{by} {expected}");
        let place = miss.place.unwrap();
        let deep = (place - frame.origin).dot(along);
        assert!(deep < front && deep > -end - 1e-9, "{deep}: between the end and the front");
        assert!(place.cmpge(DVec3::splat(-1e-9)).all() && place.z <= tall + 1e-9);
        compared += 1;
    }
    assert!(compared > 20, "{compared}");
}

/// What other limits are missed by, against the limits.
#[test]
fn a_miss_says_what_it_lacks() {
    let part = part("l_bracket.stl");
    let franka = gripper::find("franka-hand").unwrap();
    let ground = Ground { normal: DVec3::Z, offset: 0.03 };
    let cone = Cone { axis: DVec3::NEG_Z, half_angle: 1.0 };
    let limits = options()
        .with_ground(Some(ground))
        .with_approach_cone(Some(cone))
        .with_max_offset(Some(0.02));
    let proposer = Proposer::new(&part, &franka, &limits).unwrap();
    let centre = part.mass_properties(1.0).centre_of_mass;
    let mut seen = BTreeMap::<String, usize>::new();
    for miss in proposer.misses(40) {
        let Negative { part_from_grip: frame, reason, face_i, face_ii, .. } = &miss.pose;
        let kind = reason.split(':').next().unwrap().to_owned();
        *seen.entry(kind.clone()).or_default() += 1;
        let by = miss.by.unwrap();
        match kind.as_str() {
            "approach_outside_cone" => {
                let angle = (-frame.rotation.x_axis.z).acos();
                assert!((by - (angle - 1.0)).abs() < 1e-9, "{by} {angle}");
            }
            "too_far_from_centre_of_mass" => {
                assert!((by - (frame.origin.distance(centre) - 0.02)).abs() < 1e-12);
            }
            "ground" => {
                let place = miss.place.unwrap();
                assert!(place.z < 0.03 && by >= 0.03 - place.z - 1e-12, "{place} {by}");
            }
            "contact_too_small" => {
                assert!(by > 0.0 && by <= 1.0);
                // A floor lower by that share would let it pass.
                let lower = limits.min_contact * (1.0 - by) * (1.0 - 1e-6);
                let relaxed = limits.clone().with_min_contact(lower).with_min_pad_share(0.0);
                let relaxed = Proposer::new(&part, &franka, &relaxed).unwrap();
                let explained = relaxed.explain_pose(*face_i, *face_ii, frame).unwrap();
                let contact = &explained.checks.iter().filter(|c| c.name.starts_with("contact"));
                assert!(contact.clone().all(|check| check.passed) || by == 1.0, "{explained:?}");
            }
            _ => {}
        }
    }
    for kind in
        ["approach_outside_cone", "too_far_from_centre_of_mass", "ground", "contact_too_small"]
    {
        assert!(seen.get(kind).is_some_and(|count| *count > 3), "{kind} in {seen:?}");
    }
}

/// Bodies along the axes: a box moved by what is told is free of them along one of its axes, and by
/// less along none.
#[test]
fn a_miss_says_how_far_a_body_is_in_a_box_to_keep_out_of() {
    let part = cuboid(0.02, 0.03, 0.04);
    let gripper = gripper::find("generic").unwrap();
    let wall = [DVec3::new(-0.05, -0.2, 0.05), DVec3::new(0.012, 0.2, 0.3)];
    let kept_out = |wall: [DVec3; 2]| {
        let options = ProposeOptions::default()
            .with_spacing(Some(0.008))
            .with_angle_step(90_f64.to_radians())
            .with_keep_out(vec![wall]);
        Proposer::new(&part, &gripper, &options).unwrap()
    };
    let mut compared = 0;
    for miss in kept_out(wall).misses(25) {
        if !miss.pose.reason.starts_with("keep_out:") {
            continue;
        }
        let free = |by: f64| {
            DVec3::AXES.iter().flat_map(|&axis| [axis, -axis]).any(|away| {
                let moved = kept_out(wall.map(|corner| corner + away * by));
                let Negative { face_i, face_ii, part_from_grip, .. } = &miss.pose;
                let explained = moved.explain_pose(*face_i, *face_ii, part_from_grip).unwrap();
                explained.checks.iter().any(|check| check.name.contains("keep-out") && check.passed)
            })
        };
        let (by, place) = (miss.by.unwrap(), miss.place.unwrap());
        assert!(free(by + 1e-6) && !free(by - 1e-6), "{miss:?}");
        assert!(place.cmpge(wall[0]).all() && place.cmple(wall[1]).all(), "{place}");
        compared += 1;
    }
    assert!(compared > 20, "{compared}");
}

/// The pair of faces that comes nearest to the stroke, gripped in the middle of what they share.
#[test]
fn the_faces_nearest_to_the_stroke_are_told() {
    let gripper = gripper::find("generic").unwrap();
    let part = cuboid(0.2, 0.3, 0.4);
    let misses = Proposer::new(&part, &gripper, &options()).unwrap().misses(5);
    let [miss] = &misses[..] else { panic!("{misses:?}") };
    assert_eq!(miss.pose.reason, "face_pair_outside_stroke");
    assert!((miss.pose.width - 0.2).abs() < 1e-9 && (miss.by.unwrap() - 0.1).abs() < 1e-9);
    let frame = &miss.pose.part_from_grip;
    assert!(frame.origin.abs_diff_eq(DVec3::new(0.1, 0.15, 0.2), 1e-9), "{frame:?}");
    assert!((frame.rotation.z_axis.x.abs() - 1.0).abs() < 1e-12);
    assert!((frame.rotation.determinant() - 1.0).abs() < 1e-12);
}

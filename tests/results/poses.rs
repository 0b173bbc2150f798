//! Poses from outside: what the exports write is read back as the same grips, and each pose that is
//! none is told why.

use std::sync::atomic::AtomicBool;

use glam::{DMat3, DVec3};
use gripfast::export::{self, Convention, Dialect, Format, Options, Origin, Stated};
use gripfast::load::wrench_in_grip;
use gripfast::mechanics;
use gripfast::model::{Frame, Wrench};
use gripfast::plan::{Plan, Standing, near_misses};
use gripfast::poses::{self, Pose};
use gripfast::propose::{Misfit, Rejection};
use gripfast::request::{Choice, Request};
use gripfast::results::{GripSet, RankedGrip};
use gripfast::units::{Angle, Density, Length, Mass};

const TILT: f64 = 0.05;
/// Grips that are exported and read back.
const TOP: usize = 30;

fn plan(gripper: &str) -> Plan {
    let part = crate::support::root().join("data/parts/l_bracket.stl");
    let mut request = Request::new(part, gripper);
    request.density = Some(Density(7850.0));
    request.candidates.spacing = Some(Length(0.012));
    request.candidates.angle_step = Angle(90_f64.to_radians());
    request.scoring.backend = Choice::Cpu;
    Plan::new(request).unwrap()
}

fn found(plan: &Plan) -> GripSet {
    plan.run(&mut (), &AtomicBool::new(false)).unwrap().set
}

#[test]
fn exports_read_back_are_the_same_grips() {
    let folder = tempfile::tempdir().unwrap();
    // One gripper whose flange moves with the width, and one that is the same both ways round.
    for gripper in ["robotiq-2f85", "generic"] {
        let plan = plan(gripper);
        let set = found(&plan);
        assert!(set.grips.len() > 50);
        for (format, _, endings) in Format::ALL {
            // Those that are written only.
            let unread = matches!(format, Format::Glb | Format::Usd | Format::Intrinsic);
            if unread || export::check(format).is_err() {
                continue;
            }
            for origin in [None, Some(Origin::Stated(Stated::Flange)), Some(Origin::Behind(0.07))] {
                let options = Options::default().with_origin(origin).with_top(Some(TOP));
                let path = folder.path().join(format!("grips{}", endings[0]));
                export::write(&set, format, &path, &options, None).unwrap();
                // What the file states about its frame is enough.
                let list = poses::read(&path, &poses::Options::default(), plan.gripper()).unwrap();
                assert_eq!(list.len(), TOP, "{format:?}");
                let named = |(pose, ranked): (&Pose, &RankedGrip)| {
                    pose.name.trim_start_matches("grasp_") == ranked.grip.id.to_string()
                };
                // ACRONYM's readers take poses by their places.
                let all = list.iter().zip(&set.grips).all(named);
                assert!(all || format == Format::Acronym, "{format:?}: {}", list[0].name);
                let assessed = plan.assess(&list, TILT).unwrap();
                for (pose, ranked) in assessed.poses.iter().zip(&set.grips) {
                    assert!(pose.is_grip(), "{format:?} {origin:?}: {pose:?}");
                    let again = pose.ranked.as_ref().unwrap();
                    let apart = again
                        .grip
                        .part_from_grip
                        .origin
                        .distance(ranked.grip.part_from_grip.origin);
                    assert!(apart < 1e-9, "{format:?} {origin:?}: {apart}");
                    let [one, two] = [again, ranked].map(|grip| grip.worst.mu_s.unwrap());
                    assert!((one / two - 1.0).abs() < 1e-6, "{format:?}: {one} {two}");
                }
                assert_eq!(assessed.set.summary.ranked, TOP as u64, "{format:?}");
            }
        }
    }
}

/// Taught poses come as robots show them: millimetres, and angles of the maker.
#[test]
fn poses_of_every_robot_are_read_and_another_unit_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan("robotiq-2f85");
    let set = found(&plan);
    for (dialect, name) in Dialect::ALL {
        let options = Options::default().with_dialect(dialect).with_top(Some(TOP));
        let path = folder.path().join("taught.csv");
        export::write(&set, Format::Robot, &path, &options, None).unwrap();
        let list = poses::read(&path, &poses::Options::default(), plan.gripper()).unwrap();
        assert_eq!(poses::doubt(&list, plan.part()), None);
        let assessed = plan.assess(&list, TILT).unwrap();
        for (pose, ranked) in assessed.poses.iter().zip(&set.grips) {
            let again = pose.ranked.as_ref().unwrap();
            let [one, two] = [again, ranked].map(|one| one.grip.part_from_grip.origin);
            assert!(one.distance(two) < 1e-9 && pose.is_grip(), "{name}: {pose:?}");
        }
        // Millimetres in columns that promise metres.
        let text = std::fs::read_to_string(&path).unwrap();
        let wrong = folder.path().join("wrong.csv");
        std::fs::write(&wrong, text.replace("x_mm,y_mm,z_mm", "x_m,y_m,z_m")).unwrap();
        let list = poses::read(&wrong, &poses::Options::default(), plan.gripper()).unwrap();
        let doubt = poses::doubt(&list, plan.part()).unwrap();
        assert!(doubt.contains("x_mm"), "{doubt}");
    }
}

#[test]
fn a_pose_off_by_little_is_righted_and_one_off_by_much_is_told_why() {
    let plan = plan("generic");
    let set = found(&plan);
    let best = &set.grips[0];
    let off = |turn: f64, shift: f64| {
        let by = Frame { rotation: DMat3::from_rotation_x(turn), origin: DVec3::Z * shift };
        Pose::of_grip("taught", best.grip.part_from_grip.compose(&by))
    };
    let poses = [off(0.02, 0.0012), off(0.3, 0.0), off(0.0, 0.04)];
    let assessed = plan.assess(&poses, TILT).unwrap().poses;
    let fit = assessed[0].fit.unwrap();
    assert!((fit.turned - 0.02).abs() < 1e-9 && (fit.shifted - 0.0012).abs() < 1e-9, "{fit:?}");
    let mu_s = |index: usize| assessed[index].ranked.as_ref().and_then(|one| one.worst.mu_s);
    assert!((mu_s(0).unwrap() / best.worst.mu_s.unwrap() - 1.0).abs() < 0.05);
    let Err(Misfit::Tilted(Some(angle))) = assessed[1].fit else { panic!("{:?}", assessed[1]) };
    assert!((angle - 0.3).abs() < 1e-6, "{angle}");
    assert_eq!(assessed[2].fit, Err(Misfit::Beside));
    assert!(assessed[1].ranked.is_none() && !assessed[1].is_free());
    // Turned about the closing axis until the fingers meet the part: scored, but not free.
    let met = (1..24)
        .map(|step| {
            let turn = DMat3::from_rotation_z(f64::from(step) * 15_f64.to_radians());
            let by = Frame { rotation: turn, origin: DVec3::ZERO };
            Pose::of_grip("turned", best.grip.part_from_grip.compose(&by))
        })
        .collect::<Vec<_>>();
    let assessed = plan.assess(&met, TILT).unwrap();
    let blocked = assessed.poses.iter().find(|pose| {
        let rejection = pose.explanation.as_ref().and_then(|one| one.rejection.as_ref());
        matches!(
            rejection,
            Some(Rejection::PartInterference { .. } | Rejection::ApproachBlocked { .. })
        )
    });
    assert!(blocked.is_some_and(|pose| pose.ranked.is_some() && !pose.is_grip()));
    let counted: u64 = assessed.set.summary.rejections.values().sum();
    assert_eq!(counted + assessed.set.summary.ranked, met.len() as u64);
}

#[test]
fn a_pose_is_told_its_rank_or_why_it_has_none() {
    let plan = plan("robotiq-2f85");
    let set = found(&plan);
    let some = &set.grips[7];
    let (assessed, standing) = plan.place(&some.grip.part_from_grip, TILT).unwrap();
    assert!(assessed.is_grip());
    let Some((Standing::Found { rank, id }, all)) = standing else { panic!("{standing:?}") };
    assert_eq!((rank, id, all), (some.rank, some.grip.id, set.summary.ranked));
    let last = set.grips.last().unwrap();
    let (_, standing) = plan.place(&last.grip.part_from_grip, TILT).unwrap();
    let Some((Standing::Found { rank, .. }, _)) = standing else { panic!("{standing:?}") };
    assert_eq!(rank, last.rank);
    // A little beside it nothing was tried.
    let mut beside = some.grip.part_from_grip;
    beside.origin += beside.rotation.y_axis * 0.0007;
    let (_, standing) = plan.place(&beside, TILT).unwrap();
    let Some((Standing::NotTried { rank, nearest, .. }, _)) = standing else {
        panic!("{standing:?}")
    };
    let (_, _, apart) = nearest.unwrap();
    assert!(rank >= 1 && apart <= 0.0007 + 1e-9, "{rank} {apart}");
    // One that is not free has no rank.
    let mut high = some.grip.part_from_grip;
    high.origin += high.rotation.x_axis * 0.5;
    assert_eq!(plan.place(&high, TILT).unwrap().1, None);
}

#[test]
fn files_that_hold_no_poses_are_refused_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan("generic");
    let read = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        poses::read(&path, &poses::Options::default(), plan.gripper()).unwrap_err().to_string()
    };
    let head = "x_m,y_m,z_m,qx,qy,qz,qw\n";
    assert!(read("a.csv", "x_m,y_m\n0,0\n").contains("no column z_m"));
    assert!(read("b.csv", &format!("{head}0,0,0,0,0,0,2\n")).contains("b.csv:2"));
    assert!(read("c.csv", &format!("{head}0,0,abc,0,0,0,1\n")).contains("'abc' in z_m"));
    assert!(read("d.isaac_grasp.yaml", "format: [").contains("d.isaac_grasp.yaml"));
    assert!(read("e.graspgen.json", "{}").contains("grasps"));
    assert!(read("f.npz", "PK").contains("f.npz"));
    assert!(read("g.npy", "\u{93}NUMPY").contains("g.npy"));
    if cfg!(feature = "parquet") {
        assert!(read("j.parquet", "PAR1").contains("j.parquet"));
        assert!(read("k.parquet", &format!("PAR1{}PAR1", "x".repeat(200))).contains("k.parquet"));
    }
    let message = read("h.glb", "glTF");
    assert!(message.contains("not read from this format"), "{message}");
    // A frame that the gripper does not state.
    let options =
        poses::Options { convention: Some(Convention::Stated(Stated::Tool)), ..Default::default() };
    let path = folder.path().join("i.csv");
    std::fs::write(&path, format!("{head}0,0,0,0,0,0,1\n")).unwrap();
    let list = poses::read(&path, &options, plan.gripper()).unwrap();
    let message = plan.assess(&list, TILT).unwrap_err().to_string();
    assert!(message.contains("states no tool"), "{message}");
}

/// A load too heavy for the pads: told by the share of it that is held, which bisection over the
/// load's size finds too.
#[test]
fn what_twists_out_is_told_by_the_share_of_the_load_that_is_held() {
    let root = crate::support::root();
    let mut request = Request::new(root.join("data/parts/t_slot_bar.stl"), "franka-hand");
    request.mass = Some(Mass(6.0));
    request.candidates.spacing = Some(Length(0.02));
    request.candidates.angle_step = Angle(90_f64.to_radians());
    request.scoring.backend = Choice::Cpu;
    request.selection.negatives = 40;
    let plan = Plan::new(request).unwrap();
    let set = found(&plan);
    let misses = near_misses(&set, plan.part()).unwrap();
    let lost: Vec<_> = misses.iter().filter(|miss| miss.pose.reason == "twisted_out").collect();
    assert!(lost.len() > 5, "{}", lost.len());
    let friction = plan.gripper().pad_friction.unwrap();
    let force = set.provenance.resolved.force.0;
    for miss in lost.into_iter().step_by(3) {
        let pose = Pose::of_grip("lost", miss.pose.part_from_grip);
        let assessed = plan.assess(&[pose], TILT).unwrap();
        let ranked = assessed.poses[0].ranked.clone().unwrap();
        let word = assessed.poses[0].verdict(&assessed.set);
        assert!(word.starts_with("twisted out: the worst load is held to "), "{word}");
        let held = |wrench: &Wrench, share: f64| {
            let scaled = Wrench { force: wrench.force * share, moment: wrench.moment * share };
            let options = mechanics::Options::default();
            let grip = &ranked.grip;
            let score = mechanics::solve(&grip.contact, grip.width, force, &scaled, &options);
            let score = score.unwrap();
            score.status.holds() && score.mu_s.is_some_and(|mu| mu <= friction)
        };
        let shares = plan.loads().iter().map(|load| {
            let centre = plan.mass().centre_of_mass;
            let wrench = wrench_in_grip(&load.wrench, centre, &ranked.grip.part_from_grip);
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..20 {
                let middle = f64::midpoint(low, high);
                if held(&wrench, middle) { low = middle } else { high = middle }
            }
            low
        });
        let told = 1.0 - miss.by.unwrap();
        let shares: Vec<f64> = shares.collect();
        let near = |share: &f64| (share - told).abs() < 1e-3;
        assert!(told < 1.0 && shares.iter().any(near), "{told}: {shares:?}");
    }
}

//! Load cases from the flag: exact values, counts, invariance, refusals.

use glam::{DMat3, DQuat, DVec3};
use gripfast::geometry::sphere;
use gripfast::load::{ACCELERATION_DIRECTIONS, LoadSet, inertial_wrench, wrench_in_grip};
use gripfast::model::{Frame, Wrench};
use gripfast::part::MassProperties;
use gripfast::results::LoadCase;
use proptest::prelude::*;

const G: f64 = 9.80665;

fn mass() -> MassProperties {
    MassProperties {
        volume: 1e-4,
        mass: 0.5,
        centre_of_mass: DVec3::new(0.01, -0.02, 0.03),
        inertia: DMat3::from_diagonal(DVec3::new(1e-4, 2e-4, 3e-4)),
    }
}

fn cases(text: &str) -> Vec<LoadCase> {
    LoadSet::parse("--loads", text).unwrap().cases(&mass()).unwrap()
}

fn refusal(text: &str) -> String {
    LoadSet::parse("--loads", text).and_then(|set| set.cases(&mass())).unwrap_err().to_string()
}

#[test]
fn gravity_is_the_weight_along_the_six_axes() {
    let found = cases("gravity");
    assert_eq!(
        found.iter().map(|case| case.name.as_str()).collect::<Vec<_>>(),
        ["-z", "+z", "-x", "+x", "-y", "+y"].map(|axis| format!("gravity {axis}"))
    );
    assert!(found.iter().all(|case| (case.wrench.force.length() - 0.5 * G).abs() < 1e-15
        && case.wrench.moment == DVec3::ZERO));
    assert_eq!(found[0].wrench.force, DVec3::new(0.0, 0.0, -0.5 * G));
}

#[test]
fn gravity_in_stated_directions() {
    assert_eq!(
        cases("gravity:-z,gravity:+x").iter().map(|case| case.wrench.force).collect::<Vec<_>>(),
        [DVec3::NEG_Z * 0.5 * G, DVec3::X * 0.5 * G]
    );
    assert!(
        (cases("gravity:3/0/-4")[0].wrench.force - DVec3::new(0.6, 0.0, -0.8) * 0.5 * G).length()
            < 1e-15
    );
    assert!((cases("gravity:1e-300/0/0")[0].wrench.force - DVec3::X * 0.5 * G).length() < 1e-15);
    assert_eq!(cases("gravity:80").len(), 80);
}

#[test]
fn the_ball_is_directed_at_the_object_and_balanced() {
    for count in [20, 42, 100, 500] {
        let found = cases(&format!("ball:{count}"));
        assert_eq!(found.len(), count);
        assert!(found.iter().all(|case| (case.wrench.force.length() - 1.0).abs() < 1e-15
            && case.wrench.moment == DVec3::ZERO));
        // The force of a facet is minus its outward normal.
        assert_eq!(found[0].wrench.force, -sphere::directions(count)[0]);
    }
    let found = cases("ball:500:10N+moments:200Nmm");
    assert_eq!(found.len(), 1000);
    assert!(found[..500].iter().all(|case| (case.wrench.force.length() - 10.0).abs() < 1e-14
        && case.wrench.moment == DVec3::ZERO));
    assert!(found[500..].iter().all(|case| (case.wrench.moment.length() - 0.2).abs() < 1e-15
        && case.wrench.force == DVec3::ZERO));
    assert_eq!(cases("ball:12+moments").len(), 24);
}

#[test]
fn acceleration_adds_to_gravity_in_the_worst_direction() {
    let set = LoadSet::parse("--loads", "gravity:-z").unwrap().with_acceleration(2.0 * G);
    let found = set.cases(&mass()).unwrap();
    assert_eq!(found.len(), ACCELERATION_DIRECTIONS + 1);
    let largest = found.iter().map(|case| case.wrench.force.length()).fold(0.0, f64::max);
    assert!((largest - 0.5 * 3.0 * G).abs() < 1e-12, "{largest}");
    assert!(
        (found[0].wrench.force - DVec3::new(0.0, 0.0, -1.5 * G)).length() < 1e-12,
        "accelerating upwards comes first"
    );
    // Every case is weight plus a force of exactly m a.
    assert!(
        found
            .iter()
            .all(|case| ((case.wrench.force - DVec3::NEG_Z * 0.5 * G).length() - G).abs() < 1e-12)
    );
    assert_eq!(
        LoadSet::default().with_acceleration(1.0).cases(&mass()).unwrap().len(),
        6 * (ACCELERATION_DIRECTIONS + 1)
    );
}

#[test]
fn a_gravity_cone_stays_within_its_angle() {
    let found = cases("gravity-cone:-z:20deg");
    assert_eq!(found[0].wrench.force, DVec3::NEG_Z * (0.5 * G));
    assert!(found.len() > 12);
    let steepest = found
        .iter()
        .map(|case| case.wrench.force.normalize().dot(DVec3::NEG_Z))
        .fold(1.0, f64::min);
    assert!((steepest - 20_f64.to_radians().cos()).abs() < 1e-12);
    assert_eq!(cases("gravity-cone:1/1/0:0deg").len(), 1);
}

#[test]
fn the_same_flag_gives_the_same_cases() {
    assert_eq!(
        cases("gravity-cone:+x:35deg,ball:77+moments"),
        cases("gravity-cone:+x:35deg,ball:77+moments")
    );
}

#[test]
fn refusals_name_what_was_written() {
    for bad in [
        "",
        "gravity,",
        "gravity:",
        "gravity:w",
        "gravity:--z",
        "gravity:0/0/0",
        "gravity:1/2",
        "gravity:1/2/3/4",
        "gravity:nan/0/1",
        "gravity:0",
        "gravity-cone",
        "gravity-cone:-z",
        "gravity-cone:-z:20",
        "gravity-cone:-z:-5deg",
        "gravity-cone:-z:400deg",
        "ball",
        "ball:",
        "ball:0",
        "ball:-3",
        "ball:1e3",
        "ball:99999999999999999999",
        "ball:500:10",
        "ball:500:-1N",
        "ball:500:10N+moments:3N",
        "ball:500+momentsx",
        "cube:3",
        "file.txt",
    ] {
        assert!(refusal(bad).contains("--loads"), "{bad}");
    }
    assert!(refusal("cube:3").contains("ball:N"), "the message lists what is possible");
    assert!(refusal("nowhere.csv").contains("nowhere.csv"));
    let set = LoadSet::parse("--loads", "ball:10").unwrap().with_acceleration(1.0);
    assert!(set.cases(&mass()).unwrap_err().to_string().contains("gravity"));
    let set = LoadSet::parse("--loads", "ball:10,gravity").unwrap().with_acceleration(f64::NAN);
    assert!(set.cases(&mass()).is_err());
}

#[test]
fn gravity_without_a_mass_is_refused_and_a_ball_is_not() {
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let part = MassProperties { mass: wrong, ..mass() };
        let error = LoadSet::default().cases(&part).unwrap_err();
        assert_eq!(error.options(), ["mass", "density"], "{wrong}");
        assert_eq!(LoadSet::parse("--loads", "ball:10").unwrap().cases(&part).unwrap().len(), 10);
    }
}

#[test]
fn a_weight_beside_the_grip_makes_its_lever_arm() {
    let wrench = Wrench { force: DVec3::new(0.0, 0.0, -2.0), moment: DVec3::ZERO };
    let part_from_grip = Frame {
        rotation: DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y),
        origin: DVec3::new(0.1, 0.2, 0.3),
    };
    let found = wrench_in_grip(&wrench, DVec3::new(0.4, 0.2, 0.3), &part_from_grip);
    // Part: arm (.3, 0, 0) x (0, 0, -2) = (0, .6, 0); part z, x, y are grip x1, x2, x3.
    assert!((found.force - DVec3::new(-2.0, 0.0, 0.0)).length() < 1e-15);
    assert!((found.moment - DVec3::new(0.0, 0.0, 0.6)).length() < 1e-15);
}

#[test]
fn a_spinning_body_has_the_gyroscopic_moment_and_a_principal_axis_none() {
    let part = mass();
    let still = inertial_wrench(&part, DVec3::ZERO, DVec3::ZERO, DVec3::X * 7.0, DVec3::ZERO);
    assert_eq!((still.force, still.moment), (DVec3::ZERO, DVec3::ZERO));
    let spun =
        inertial_wrench(&part, DVec3::ZERO, DVec3::ZERO, DVec3::new(2.0, 3.0, 5.0), DVec3::ZERO);
    // -(w x I w) with I = diag(1, 2, 3) 1e-4.
    assert!((spun.moment - DVec3::new(-15e-4, 20e-4, -6e-4)).length() < 1e-17);
}

fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
}

fn frame() -> impl Strategy<Value = Frame> {
    (vector(), vector()).prop_map(|(turn, origin)| Frame {
        rotation: DMat3::from_quat(DQuat::from_scaled_axis(turn * 3.0)),
        origin,
    })
}

proptest! {
    /// Power of any twist is the same in both frames: the wrench is the same physical one.
    #[test]
    fn a_wrench_does_the_same_work_in_the_grip_frame(force in vector(), moment in vector(), com in vector(), grip in frame(), velocity in vector(), omega in vector()) {
        let found = wrench_in_grip(&Wrench { force, moment }, com, &grip);
        // Velocity of the body's point at the grip origin, from that at the centre of mass.
        let at_origin = velocity + omega.cross(grip.origin - com);
        let power = force.dot(velocity) + moment.dot(omega);
        let in_grip = found.force.dot(grip.rotation.transpose() * at_origin) + found.moment.dot(grip.rotation.transpose() * omega);
        prop_assert!((power - in_grip).abs() < 2e-12);
    }

    /// Turning part and grip together changes nothing in the grip frame.
    #[test]
    fn grip_wrenches_do_not_depend_on_the_part_frame(force in vector(), moment in vector(), com in vector(), grip in frame(), moved in frame()) {
        let before = wrench_in_grip(&Wrench { force, moment }, com, &grip);
        let after = wrench_in_grip(&Wrench { force: moved.rotation * force, moment: moved.rotation * moment }, moved.point(com), &moved.compose(&grip));
        prop_assert!((before.force - after.force).length() < 1e-13);
        prop_assert!((before.moment - after.moment).length() < 1e-12);
    }
}

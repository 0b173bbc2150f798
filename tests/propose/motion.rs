//! How pads move with their distance: arcs, tables, and the catalogue's linkages against the joints of
//! public robot models.

use gripfast::gripper::{Travel, TravelRow, find};

fn arc() -> Travel {
    Travel::Arc { crank: 0.0571, angle: -0.0948, joint: Some([0.8133, 0.0117]), alone: false }
}

#[test]
fn an_arc_is_a_circle_about_the_cranks_pivot() {
    let travel = arc();
    let pivot = |width: f64| {
        let across = width / 2.0 + 0.0571 * (-0.0948_f64).sin();
        let along = travel.advance(width) + 0.0571 * (-0.0948_f64).cos();
        across.hypot(along)
    };
    for width in [0.0, 0.005, 0.03, 0.06, 0.085] {
        assert!((pivot(width) - 0.0571).abs() < 1e-15, "{width}");
    }
    assert_eq!((travel.advance(0.0), Travel::Parallel.advance(0.05)), (0.0, 0.0));
    let stroke = [0.0, 0.085];
    assert!((travel.joint(0.0, stroke).unwrap() - 0.8133).abs() < 1e-12);
    assert!((travel.joint(0.085, stroke).unwrap() - 0.0117).abs() < 1e-12);
    // The joint turns with the crank: not on a straight line over the width.
    let half = travel.joint(0.0425, stroke).unwrap();
    assert!((half - (0.8133 + 0.0117) / 2.0).abs() > 0.01, "{half}");
}

#[test]
fn a_table_is_followed_by_straight_lines() {
    let row =
        |width: f64, advance: f64, joint: f64| TravelRow { width, advance, joint: Some(joint) };
    let rows = vec![row(0.0, 0.0, 1.0), row(0.02, 0.002, 0.6), row(0.06, -0.01, 0.0)];
    let travel = Travel::Table { rows };
    for (width, advance, joint) in
        [(0.0, 0.0, 1.0), (0.01, 0.001, 0.8), (0.04, -0.004, 0.3), (0.07, -0.013, -0.15)]
    {
        assert!((travel.advance(width) - advance).abs() < 1e-15, "{width}");
        assert!((travel.joint(width, [0.0, 0.06]).unwrap() - joint).abs() < 1e-12, "{width}");
    }
    assert!((travel.bulge(0.0, 0.06) - (0.002 + 0.01 / 3.0)).abs() < 1e-15);
}

#[test]
fn the_bulge_bounds_what_lies_beside_the_chord() {
    let travel = arc();
    for (from, to) in [(0.0, 0.01), (0.0, 0.085), (0.05, 0.06), (0.08, 0.03), (0.04, 0.04)] {
        let (start, end) = (travel.advance(from), travel.advance(to));
        let bulge = travel.bulge(from, to);
        for step in 0..=50 {
            let share = f64::from(step) / 50.0;
            let off = travel.advance(from + share * (to - from)) - (start + share * (end - start));
            assert!(off.abs() <= bulge + 1e-12, "{from} {to}: {off} {bulge}");
        }
        assert!(bulge <= 0.6 * (from - to).abs(), "{from} {to}: {bulge}");
    }
}

/// Width, height above the base and joint of a pad on a crank, from the joints of the public
/// robot models [mm, rad].
struct Linkage {
    gripper: &'static str,
    /// Of the crank: beside the axis, above the base.
    pivot: [f64; 2],
    /// From the pivot to the crank's end with the joint at zero: outwards, along the approach.
    crank: [f64; 2],
    /// From the crank's end to the pad's face.
    pad: [f64; 2],
    /// A larger joint moves the pads outwards (`1`) or inwards (`-1`).
    sense: f64,
    /// The joint with touching and with open pads.
    joint: [f64; 2],
}

#[test]
fn pads_on_cranks_follow_the_public_models() {
    let linkages = [
        Linkage {
            gripper: "robotiq-2f85",
            pivot: [30.6011, 54.904],
            crank: [31.5 + 6.1, -4.1 + 47.1],
            pad: [-22.0203 - 6.35 / 2.0, 32.42],
            sense: -1.0,
            joint: [0.813, 0.012],
        },
        Linkage {
            gripper: "robotiq-2f140",
            pivot: [30.601, 54.905],
            crank: [64.637, 76.303],
            pad: [-27.2203 - 7.5 / 2.0, 45.7554],
            sense: -1.0,
            joint: [0.699, 0.0],
        },
        Linkage {
            gripper: "onrobot-rg2",
            pivot: [17.0, 47.34 + 76.0],
            crank: [-2.5, 54.943],
            pad: [-14.5 - 4.45, 36.5 + 1.4],
            sense: 1.0,
            joint: [0.081, 1.2227],
        },
    ];
    for Linkage { gripper: name, pivot, crank, pad, sense, joint } in linkages {
        let gripper = find(name).unwrap();
        let flange = |gap: f64| {
            let place = gripper.palm_place(gap);
            -place.point(gripper.grip_from_flange.unwrap().origin).x
        };
        for step in 0..=40 {
            let q = joint[0] + (joint[1] - joint[0]) * f64::from(step) / 40.0;
            let (sin, cos) = (sense * q).sin_cos();
            // Turned outwards by the joint; the pad stays parallel.
            let out = pivot[0] + crank[0] * cos + crank[1] * sin + pad[0];
            let along = pivot[1] + crank[1] * cos - crank[0] * sin + pad[1];
            let (width, height) = (2e-3 * out, 1e-3 * along);
            assert!((flange(width) - height).abs() < 2.5e-4, "{name}, {q}: {width} {height}");
            let found = gripper.travel.joint(width, gripper.stroke).unwrap();
            assert!((found - q).abs() < 1e-3, "{name}: {found} {q}");
        }
    }
}

#[test]
fn the_flange_of_a_2f85_comes_nearer_as_the_jaws_open() {
    let gripper = find("robotiq-2f85").unwrap();
    let nearer = |from: f64, to: f64| {
        let at = |gap: f64| gripper.palm_place(gap * 1e-3).origin.x;
        (at(to) - at(from)) * 1e3
    };
    assert!((nearer(5.0, 80.0) - 11.6).abs() < 0.1, "{}", nearer(5.0, 80.0));
    for (width, expected) in [(60.0, 5.3), (80.0, 11.5), (85.0, 13.5)] {
        assert!((nearer(0.0, width) - expected).abs() < 0.1, "{width}: {}", nearer(0.0, width));
    }
}

//! Jaws that differ from each other, and jaws of which one is fixed.

use glam::{DMat3, DVec2, DVec3};
use gripfast::geometry::{Bounds2, patch_area};
use gripfast::gripper::{self, Gripper, Jaw, Moving};
use gripfast::model::{Frame, Grip};
use gripfast::part::Part;
use gripfast::propose::{ProposeOptions, Proposer};

/// A vice: jaw II is a part of the palm, jaw I comes down on it.
const VICE: &str = r#"
    name = "vice"
    stroke = ["0mm", "60mm"]
    force = ["10N", "100N"]
    [pad]
    rectangle = ["20mm", "16mm"]
    II = { rectangle = ["30mm", "24mm"] }
    [[finger]]
    name = "moving jaw"
    jaw = "I"
    box = ["24mm", "16mm", "8mm"]
    at = ["0mm", "0mm", "4mm"]
    [[finger]]
    name = "fixed jaw"
    jaw = "II"
    box = ["40mm", "24mm", "12mm"]
    at = ["-2mm", "0mm", "-6mm"]
    [[palm]]
    name = "body"
    box = ["40mm", "40mm", "120mm"]
    at = ["-50mm", "0mm", "40mm"]
    [motion]
    moves = "I"
    [flange]
    origin = ["-70mm", "0mm", "20mm"]
"#;

fn vice() -> Gripper {
    gripper::parse(VICE, "vice").unwrap()
}

fn block(size: DVec3) -> Part {
    let vertices: Vec<DVec3> = (0..8)
        .map(|corner| {
            let bit = |shift: u32| f64::from(corner >> shift & 1);
            size * DVec3::new(bit(0) - 0.5, bit(1) - 0.5, bit(2) - 0.5)
        })
        .collect();
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> =
        faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Part::from_triangles("block", &vertices, &triangles).unwrap()
}

#[test]
fn a_fixed_jaw_stays_where_the_palm_is() {
    let vice = vice();
    assert_eq!((vice.moving, vice.is_symmetric()), (Moving::I, false));
    for gap in [0.0, 0.01, 0.047] {
        // Seen from the palm, as it stands in the file.
        let palm_from_grip = vice.palm_place(gap).inverse();
        let place = |jaw: Jaw| palm_from_grip.compose(&vice.jaw_at(jaw, gap, 0.0)).origin;
        assert!(place(Jaw::II).length() < 1e-15, "{gap}");
        assert!((place(Jaw::I) - DVec3::Z * gap).length() < 1e-15, "{gap}");
        let flange = vice.palm_place(gap).point(vice.grip_from_flange.unwrap().origin);
        assert!((flange - DVec3::new(-0.07, 0.0, 0.02 - gap / 2.0)).length() < 1e-15);
        // The bodies lie as the file says: jaw II below its pad.
        let [low, high] = vice.finger(Jaw::II, gap)[0].bounds();
        assert!((high - DVec3::new(0.018, 0.012, -gap / 2.0)).length() < 1e-15, "{high}");
        assert!((low - DVec3::new(-0.022, -0.012, -gap / 2.0 - 0.012)).length() < 1e-15);
        assert!((vice.finger(Jaw::I, gap)[0].bounds()[0].z - gap / 2.0).abs() < 1e-15);
    }
    assert_eq!([vice.way(Jaw::I, 0.005), vice.way(Jaw::II, 0.005)], [0.01, 0.0]);
}

#[test]
fn each_face_is_touched_by_its_own_pad() {
    let (part, vice) = (block(DVec3::new(0.1, 0.08, 0.02)), vice());
    let options = ProposeOptions::default().with_spacing(Some(0.01));
    let grips: Vec<Grip> =
        Proposer::new(&part, &vice, &options).unwrap().flat_map(|chunk| chunk.grips).collect();
    let across = |grip: &&Grip| (grip.width - 0.02).abs() < 1e-9;
    let inner = |grip: &&Grip| {
        let middle = grip.part_from_grip.origin;
        middle.x.abs() < 0.025 && middle.y.abs() < 0.015
    };
    let whole: Vec<&Grip> = grips.iter().filter(across).filter(inner).collect();
    assert!(whole.len() > 20, "{}", whole.len());
    for grip in &whole {
        let areas = [&grip.contact.face_i, &grip.contact.face_ii].map(|patch| patch_area(patch));
        assert!((areas[0] - 0.02 * 0.016).abs() < 1e-12, "{areas:?}");
        assert!((areas[1] - 0.03 * 0.024).abs() < 1e-12, "{areas:?}");
        // Jaw I, with the smaller pad, stands on the side of face I.
        let normal = part.faces[grip.face_i as usize].normal;
        assert!(normal.dot(grip.part_from_grip.rotation.z_axis) > 0.999);
    }
    // Both ways round are grips of their own: with other pads they hold differently. Where the pads
    // are alike, one stands for the other.
    assert!(grips.iter().all(|grip| grip.flip_of.is_none()));
    let alike =
        gripper::parse(&VICE.replace("\"30mm\", \"24mm\"]", "\"20mm\", \"16mm\"]"), "alike");
    let alike = alike.unwrap();
    let alike: Vec<Grip> =
        Proposer::new(&part, &alike, &options).unwrap().flat_map(|chunk| chunk.grips).collect();
    let flips = alike.iter().filter(|grip| grip.flip_of == Some(grip.id - 1)).count();
    assert!(2 * flips == alike.len() && flips > 20, "{flips} of {}", alike.len());
    assert!(whole.iter().any(|grip| grip.part_from_grip.rotation.z_axis.z > 0.0));
    assert!(whole.iter().any(|grip| grip.part_from_grip.rotation.z_axis.z < 0.0));
    // At an edge both are cut at the same line of the part.
    let proposer = Proposer::new(&part, &vice, &options).unwrap();
    for grip in grips.iter().filter(across).take(400) {
        let explained =
            proposer.explain_pose(grip.face_i, grip.face_ii, &grip.part_from_grip).unwrap();
        assert_eq!(explained.rejection, None);
        for (patch, size) in [
            (&grip.contact.face_i, DVec2::new(0.02, 0.016)),
            (&grip.contact.face_ii, DVec2::new(0.03, 0.024)),
        ] {
            let points = patch.iter().flat_map(|polygon| &polygon.outer);
            for &point in points.clone() {
                let there = grip.part_from_grip.point(point.extend(0.0));
                assert!(there.x.abs() < 0.05 + 1e-9 && there.y.abs() < 0.04 + 1e-9);
            }
            let bounds = Bounds2::of(points);
            assert!(bounds.size().cmple(size + 1e-9).all());
        }
    }
}

#[test]
fn the_palm_stands_aside_of_a_fixed_jaw() {
    // The body reaches 100 mm to the side of the moving jaw and 20 mm behind the fixed one: a wall
    // beside the block stands in the way of one of the two ways round only.
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    let mut add = |low: DVec3, high: DVec3| {
        let base = vertices.len() as u32;
        for corner in 0..8_u32 {
            let pick = |bit: u32, a: f64, b: f64| if corner >> bit & 1 == 0 { a } else { b };
            vertices.push(DVec3::new(
                pick(0, low.x, high.x),
                pick(1, low.y, high.y),
                pick(2, low.z, high.z),
            ));
        }
        for [a, b, c, d] in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            triangles.push([a, b, c].map(|corner| corner + base));
            triangles.push([a, c, d].map(|corner| corner + base));
        }
    };
    add(DVec3::new(-0.03, -0.01, 0.0), DVec3::new(0.03, 0.01, 0.04));
    add(DVec3::new(-0.03, 0.05, -0.02), DVec3::new(0.03, 0.06, 0.12));
    let part = Part::from_triangles("block and wall", &vertices, &triangles).unwrap();
    let options = ProposeOptions::default()
        .with_approach_cone(Some(gripfast::propose::Cone { axis: DVec3::NEG_Z, half_angle: 0.01 }));
    let grips: Vec<Grip> = Proposer::new(&part, &vice(), &options)
        .unwrap()
        .flat_map(|chunk| chunk.grips)
        .filter(|grip| (grip.width - 0.02).abs() < 1e-9)
        .collect();
    assert!(!grips.is_empty());
    for grip in grips {
        // Jaw I, and with it the body, on the side away from the wall.
        assert!(grip.part_from_grip.rotation.z_axis.y < -0.999, "{:?}", grip.part_from_grip);
    }
}

#[test]
fn a_jaw_on_a_crank_alone_shifts_its_pad() {
    let text = VICE.replace(
        "moves = \"I\"",
        "moves = \"I\"\narc = { crank = \"100mm\", angle = \"0deg\", joint = [\"0deg\", \"40deg\"] }",
    );
    let arm = gripper::parse(&text, "arm").unwrap();
    for gap in [0.0, 0.02, 0.06] {
        // All of the distance is the one crank's.
        let turn = (gap / 0.1_f64).asin();
        let expected = DVec3::new(0.1 * turn.cos() - 0.1, 0.0, gap);
        let palm_from_grip = arm.palm_place(gap).inverse();
        let place = |jaw: Jaw| palm_from_grip.compose(&arm.jaw_at(jaw, gap, 0.0)).origin;
        assert!((place(Jaw::I) - expected).length() < 1e-15, "{}", place(Jaw::I));
        assert!(place(Jaw::II).length() < 1e-15);
        // The grip's origin lies midway between the pads' middles.
        let [one, two] = arm.pads(gap).map(|pad| Bounds2::of(&pad).centre());
        assert!((one + two).length() < 1e-15 && (one.x - two.x - expected.x).abs() < 1e-15);
    }
    let half = arm.travel.joint(0.03, arm.stroke).unwrap();
    assert!((half - 40_f64.to_radians() * 0.3_f64.asin() / 0.6_f64.asin()).abs() < 1e-12);
    // Before it closes it stands where the crank has it with open pads.
    let before = arm.jaw_at(Jaw::I, 0.02, 0.01).origin - arm.jaw_at(Jaw::I, 0.02, 0.0).origin;
    let fall = 0.1 * ((0.3_f64.asin()).cos() - (0.2_f64.asin()).cos());
    assert!((before - DVec3::new(fall, 0.0, 0.01)).length() < 1e-15, "{before}");
}

#[test]
fn a_gripper_with_one_jaw_is_told_from_one_without_fingers() {
    let text = "name = \"asym\"\nstroke = [\"0mm\", \"60mm\"]\nforce = [\"10N\", \"100N\"]\n[pad]\n\
                rectangle = [\"20mm\", \"20mm\"]\n[[finger]]\nname = \"tip\"\njaw = \"I\"\n\
                box = [\"24mm\", \"22mm\", \"10mm\"]\nat = [\"0mm\", \"0mm\", \"5mm\"]\n";
    let asym = gripper::parse(text, "asym").unwrap();
    assert_eq!((asym.bodies(Jaw::I).len(), asym.bodies(Jaw::II).len()), (1, 0));
    let warnings = gripper::check(&asym).join("\n");
    assert!(warnings.contains("no finger body of jaw II"), "{warnings}");
    // What both jaws have keeps its two forms alike.
    let both = gripper::parse(&text.replace("jaw = \"I\"\n", ""), "both").unwrap();
    assert!(both.fingers_ii.is_none() && both.is_symmetric());
    // The same body on both jaws, each described by itself.
    let twice = format!(
        "{text}[[finger]]\nname = \"tip\"\njaw = \"II\"\nbox = [\"24mm\", \"22mm\", \"10mm\"]\n\
         at = [\"0mm\", \"0mm\", \"-5mm\"]\n"
    );
    let twice = gripper::parse(&twice, "twice").unwrap();
    for gap in [0.0, 0.03] {
        let [one, two] = [&both, &twice].map(|gripper| gripper.finger(Jaw::II, gap)[0].bounds());
        assert!((one[0] - two[0]).length() < 1e-15 && (one[1] - two[1]).length() < 1e-15);
    }
    for (key, word) in [
        ("moving = \"one\"", "moves = \"I\""),
        ("fixed = \"II\"", "moves = \"I\""),
        ("jaws = 1", "[pad.II]"),
    ] {
        let message = gripper::parse(&text.replace("[pad]", &format!("{key}\n[pad]")), "g");
        let message = message.unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
    }
    let palm =
        format!("{text}[[palm]]\nname = \"p\"\njaw = \"I\"\nbox = [\"1mm\", \"1mm\", \"1mm\"]\n");
    assert!(gripper::parse(&palm, "g").unwrap_err().to_string().contains("names a jaw"));
}

#[test]
fn a_result_keeps_the_jaws_apart() {
    let vice = vice();
    let text = serde_json::to_string(&vice).unwrap();
    assert_eq!(serde_json::from_str::<Gripper>(&text).unwrap(), vice);
    // A plain gripper is written as before.
    let plain = serde_json::to_value(gripper::find("generic").unwrap()).unwrap();
    for key in ["moving", "fingers_ii", "pad_ii"] {
        assert!(plain.get(key).is_none(), "{key}");
    }
    let frame = Frame { rotation: DMat3::IDENTITY, origin: DVec3::ZERO };
    assert_eq!(vice.palm_place(0.0), frame);
}

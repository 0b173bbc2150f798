use super::*;
use crate::gripper::{Jaw, Moving, Travel, parse};

fn imported(text: &str, jaws: [&str; 2]) -> (crate::gripper::Gripper, Imported) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.urdf");
    std::fs::write(&path, text).unwrap();
    let found = import(&path, jaws, None).unwrap();
    (parse(&found.text, "imported").unwrap(), found)
}

fn link(name: &str, size: [f64; 3], at: [f64; 3]) -> String {
    let list = |v: [f64; 3]| v.map(|x| x.to_string()).join(" ");
    format!(
        "<link name=\"{name}\"><collision><origin xyz=\"{}\" rpy=\"0 0 0\"/><geometry><box size=\"{}\"/></geometry></collision></link>\n",
        list(at),
        list(size)
    )
}

fn joint(
    name: &str,
    kind: &str,
    parent: &str,
    child: &str,
    at: [f64; 3],
    axis: &str,
    rest: &str,
) -> String {
    let at = at.map(|x| x.to_string()).join(" ");
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{at}\" rpy=\"0 0 0\"/><axis xyz=\"{axis}\"/>{rest}</joint>\n"
    )
}

#[test]
fn a_parallel_hand_with_a_mount_and_a_mimic() {
    let limit = "<limit lower=\"0\" upper=\"0.04\" effort=\"70\" velocity=\"1\"/>";
    let text = format!(
        "<robot name=\"hand\">{}{}{}{}{}{}{}</robot>",
        "<link name=\"mount\"/>",
        link("palm", [0.06, 0.2, 0.06], [0.0, 0.0, 0.03]),
        link("left", [0.018, 0.01, 0.05], [0.0, 0.005, 0.025]),
        link("right", [0.018, 0.01, 0.05], [0.0, -0.005, 0.025]),
        joint("fix", "fixed", "mount", "palm", [0.0, 0.0, 0.01], "1 0 0", ""),
        joint("finger", "prismatic", "palm", "left", [0.0, 0.0, 0.06], "0 1 0", limit),
        joint(
            "other",
            "prismatic",
            "palm",
            "right",
            [0.0, 0.0, 0.06],
            "0 -1 0",
            &format!("{limit}<mimic joint=\"finger\" multiplier=\"1\" offset=\"0\"/>")
        ),
    );
    let (gripper, found) = imported(&text, ["left", "right"]);
    assert_eq!(gripper.stroke, [0.0, 0.08]);
    assert_eq!((gripper.moving, gripper.is_symmetric()), (Moving::Both, true));
    let [pad, _] = gripper.pad_sizes();
    assert!((pad - DVec2::new(0.05, 0.018)).length() < 1e-9, "{pad}");
    // The finger reaches from its pad 10 mm outwards; the palm ends 25 mm behind the pads' middle.
    let [low, high] = gripper.bodies(Jaw::I)[0].bounds();
    assert!((low - DVec3::new(-0.025, -0.009, 0.0)).length() < 1e-9, "{low}");
    assert!((high - DVec3::new(0.025, 0.009, 0.01)).length() < 1e-9, "{high}");
    let [low, high] = gripper.palm[0].bounds();
    assert!((high.x + 0.025).abs() < 1e-9 && (low.x + 0.085).abs() < 1e-9);
    assert!((high.z - 0.1).abs() < 1e-9 && (high.y - 0.03).abs() < 1e-9);
    let flange = gripper.grip_from_flange.unwrap();
    assert!((flange.origin - DVec3::new(-0.095, 0.0, 0.0)).length() < 1e-9, "{}", flange.origin);
    assert!((flange.rotation.z_axis - DVec3::X).length() < 1e-9);
    assert!((gripper.travel.joint(0.03, gripper.stroke).unwrap() - 0.015).abs() < 1e-9);
    assert_eq!(gripper.force[1], 70.0);
    for key in ["force", "pad.size", "flange", "finger.left", "palm.palm"] {
        assert!(!gripper.sources[key].verified, "{key}");
    }
    assert!(found.notes.iter().any(|note| note.contains("pad.friction")), "{:?}", found.notes);
}

#[test]
fn cranks_give_a_table_that_follows_them() {
    // Cranks of 57.12 mm from -5.43 degrees, each pad kept parallel by a second joint.
    let (crank, angle) = (0.05712_f64, (-5.43_f64).to_radians());
    let limit = "<limit lower=\"0\" upper=\"0.8\" effort=\"5\" velocity=\"1\"/>";
    let mut text = String::from("<robot name=\"linkage\">");
    text += &link("base", [0.07, 0.07, 0.05], [0.0, 0.0, 0.0]);
    for (side, sign) in [("l", 1.0), ("r", -1.0)] {
        let (arm, tip) = (format!("arm_{side}"), format!("tip_{side}"));
        text += &link(&arm, [0.01, 0.006, 0.05], [0.0, 0.0, 0.03]);
        text += &link(&tip, [0.02, 0.006, 0.03], [0.0, sign * 0.003, 0.015]);
        // A positive joint opens: about -x for the one at +y.
        let axis = if sign > 0.0 { "-1 0 0" } else { "1 0 0" };
        let master = format!("drive_{side}");
        let mimic = if side == "r" { "<mimic joint=\"drive_l\"/>" } else { "" };
        let out = crank * angle.sin();
        text += &joint(
            &master,
            "revolute",
            "base",
            &arm,
            [0.0, -sign * out, 0.06],
            axis,
            &format!("{limit}{mimic}"),
        );
        let back = if sign > 0.0 { "1 0 0" } else { "-1 0 0" };
        text += &joint(
            &format!("level_{side}"),
            "revolute",
            &arm,
            &tip,
            [0.0, sign * crank * angle.sin(), crank * angle.cos()],
            back,
            &format!("{limit}<mimic joint=\"drive_l\" multiplier=\"1\"/>"),
        );
    }
    text += "</robot>";
    let (gripper, _) = imported(&text, ["tip_l", "tip_r"]);
    assert!(matches!(gripper.travel, Travel::Table { .. }) && gripper.is_symmetric());
    let exact = Travel::Arc { crank, angle, joint: None, alone: false };
    let most = 2.0 * crank * ((angle + 0.8).sin() - angle.sin());
    assert!((gripper.stroke[1] - most).abs() < 1e-6, "{:?} {most}", gripper.stroke);
    for step in 0..=100 {
        let gap = most * f64::from(step) / 100.0;
        let off = gripper.travel.advance(gap) - exact.advance(gap);
        assert!(off.abs() < 5e-5, "{gap}: {off}");
        let turn = (angle.sin() + gap / 2.0 / crank).asin() - angle;
        let joint = gripper.travel.joint(gap, gripper.stroke).unwrap();
        assert!((joint - turn).abs() < 1.5e-3, "{gap}: {joint} {turn}");
    }
    // The arms are boxes round all their positions.
    let arm = gripper.palm.iter().find(|body| body.name == "arm_l").unwrap();
    assert!(arm.bounds()[1].z > crank * 0.7 * (angle + 0.8).sin());
}

/// A jaw that is welded to the wrist, and one that moves beside it.
fn arm(kind: &str, axis: &str, limit: &str) -> String {
    format!(
        "<robot name=\"arm\">{}{}{}{}{}</robot>",
        link("wrist", [0.05, 0.05, 0.04], [0.0, 0.0, 0.02]),
        link("fixed", [0.02, 0.01, 0.06], [0.0, -0.005, 0.03]),
        link("moving", [0.015, 0.008, 0.06], [0.0, 0.004, 0.03]),
        joint("weld", "fixed", "wrist", "fixed", [0.0, 0.0, 0.04], "1 0 0", ""),
        joint("drive", kind, "wrist", "moving", [0.0, 0.0, 0.04], axis, limit),
    )
}

/// Why a model is refused.
fn refusal(text: &str, jaws: [&str; 2]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.urdf");
    std::fs::write(&path, text).unwrap();
    import(&path, jaws, None).unwrap_err().to_string()
}

#[test]
fn a_fixed_jaw_is_told() {
    let limit = "<limit lower=\"0\" upper=\"0.05\" effort=\"0\" velocity=\"1\"/>";
    let text = arm("prismatic", "0 1 0", limit);
    let (gripper, found) = imported(&text, ["moving", "fixed"]);
    assert_eq!((gripper.moving, gripper.stroke), (Moving::I, [0.0, 0.05]));
    assert!(gripper.pad_ii.is_some() && gripper.fingers_ii.is_some());
    assert!(found.notes.iter().any(|note| note.contains("force is not in the model")));
    let palm: Vec<&str> = gripper.palm.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(palm, ["wrist"], "a fixed jaw is a finger only");
    // The other way round the other jaw moves.
    assert_eq!(imported(&text, ["fixed", "moving"]).0.moving, Moving::II);
    for (jaws, word) in [
        (["moving", "hand"], "use one of: wrist, fixed, moving"),
        (["fixed", "wrist"], "no joint moves"),
    ] {
        let message = refusal(&text, jaws);
        assert!(message.contains(word), "{message}");
    }
    assert!(refusal("no model", ["a", "b"]).contains("no URDF"));
}

/// A finger whose pad is a link of its own, as in most models: what carries it belongs to the finger,
/// and not to the palm, where it would stop every grip.
#[test]
fn what_carries_the_pad_is_finger() {
    let limit = "<limit lower=\"0\" upper=\"0.03\" effort=\"40\" velocity=\"1\"/>";
    let mimic = format!("{limit}<mimic joint=\"slide_l\" multiplier=\"-1\"/>");
    let mut text =
        format!("<robot name=\"pads\">{}", link("palm", [0.05, 0.12, 0.04], [0.0, 0.0, 0.02]));
    // The mimic comes before the joint that it follows.
    for (side, sign, rest) in [("r", -1.0, &mimic), ("l", 1.0, &limit.to_owned())] {
        let [finger, pad] = ["finger", "pad"].map(|name| format!("{name}_{side}"));
        text += &link(&finger, [0.02, 0.01, 0.06], [0.0, sign * 0.009, 0.01]);
        text += &link(&pad, [0.016, 0.004, 0.02], [0.0, sign * 0.002, 0.0]);
        let slide = format!("slide_{side}");
        text += &joint(&slide, "prismatic", "palm", &finger, [0.0, 0.0, 0.07], "0 1 0", rest);
        let glue = format!("glue_{side}");
        text += &joint(&glue, "fixed", &finger, &pad, [0.0, 0.0, 0.03], "1 0 0", "");
    }
    text += "</robot>";
    let (gripper, _) = imported(&text, ["pad_l", "pad_r"]);
    assert!(gripper.is_symmetric() && gripper.stroke == [0.0, 0.06]);
    let [pad, _] = gripper.pad_sizes();
    assert!((pad - DVec2::new(0.02, 0.016)).length() < 1e-9, "{pad}");
    let names = |bodies: &[crate::gripper::Body]| -> Vec<String> {
        bodies.iter().map(|body| body.name.clone()).collect()
    };
    assert_eq!(names(gripper.bodies(Jaw::I)), ["pad_l", "finger_l"]);
    assert_eq!(names(&gripper.palm), ["palm"]);
    // 4 to 14 mm behind the pad's face, 20 mm below to 10 mm above its middle.
    let [low, high] = gripper.bodies(Jaw::I)[1].bounds();
    assert!((low - DVec3::new(-0.05, -0.01, 0.004)).length() < 1e-9, "{low}");
    assert!((high - DVec3::new(0.01, 0.01, 0.014)).length() < 1e-9, "{high}");
}

/// A jaw on a hinge, its pad beside the hinge: whether the named link lies on the hinge or at the pad,
/// the pad turns, and the gripper is refused rather than described as parallel.
#[test]
fn a_pad_that_swings_is_refused_wherever_its_link_lies() {
    let limit = "<limit lower=\"-0.2\" upper=\"2\" effort=\"5\" velocity=\"1\"/>";
    let text = arm("revolute", "-1 0 0", limit).replace(
        "</robot>",
        &format!(
            "{}{}</robot>",
            link("tip", [0.015, 0.008, 0.02], [0.0, 0.004, 0.0]),
            joint("glue", "fixed", "moving", "tip", [0.0, 0.0, 0.06], "1 0 0", "")
        ),
    );
    for jaws in [["tip", "fixed"], ["fixed", "tip"], ["moving", "fixed"]] {
        let message = refusal(&text, jaws);
        assert!(message.contains("turns by 126 deg as joint 'drive'"), "{message}");
        assert!(message.contains("`gripfast gripper new`"), "{message}");
    }
    // More than a turn: first and last state look alike.
    let around = limit.replace("-0.2", "0").replace("\"2\"", "\"6.283185307179586\"");
    let message = refusal(&arm("revolute", "-1 0 0", &around), ["moving", "fixed"]);
    assert!(message.contains("turns by 180 deg"), "{message}");
}

#[test]
fn a_hinge_without_limits_is_refused() {
    for limit in ["", "<limit effort=\"5\" velocity=\"1\"/>"] {
        let message = refusal(&arm("continuous", "-1 0 0", limit), ["moving", "fixed"]);
        assert!(message.contains("'drive' has no limits"), "{message}");
        assert!(message.contains("lower and upper"), "{message}");
    }
}

/// A crank beside a fixed jaw, the pad kept level by a joint that follows with an offset.
#[test]
fn an_offset_of_a_mimic_moves_the_pad_along_its_arc() {
    let (crank, start, turn) = (0.05_f64, 0.3_f64, 0.6_f64);
    let limit = |low: f64, high: f64| {
        format!("<limit lower=\"{low}\" upper=\"{high}\" effort=\"5\" velocity=\"1\"/>")
    };
    let model = |level: &str| {
        format!(
            "<robot name=\"arm\">{}{}{}{}{}{}{}</robot>",
            link("wrist", [0.05, 0.05, 0.04], [0.0, 0.0, 0.02]),
            link("fixed", [0.02, 0.01, 0.06], [0.0, -0.005, 0.07]),
            link("rod", [0.01, 0.004, 0.04], [0.0, 0.0, 0.02]),
            link("tip", [0.015, 0.008, 0.03], [0.0, 0.004, 0.0]),
            joint("weld", "fixed", "wrist", "fixed", [0.0, 0.0, 0.04], "1 0 0", ""),
            // A positive angle leans the rod towards +y; the pad touches the fixed jaw at `start`.
            joint(
                "drive",
                "revolute",
                "wrist",
                "rod",
                [0.0, -crank * start.sin(), 0.04],
                "-1 0 0",
                &limit(start, start + turn)
            ),
            joint("level", "revolute", "rod", "tip", [0.0, 0.0, crank], "1 0 0", level),
        )
    };
    let level = limit(0.0, 1.0) + "<mimic joint=\"drive\" multiplier=\"1\" offset=\"0\"/>";
    let (gripper, found) = imported(&model(&level), ["tip", "fixed"]);
    assert_eq!(gripper.moving, Moving::I);
    let gap = |t: f64| crank * ((start + t).sin() - start.sin());
    assert!((gripper.stroke[1] - gap(turn)).abs() < 1e-6, "{:?}", gripper.stroke);
    for step in 0..=20 {
        let t = turn * f64::from(step) / 20.0;
        let exact = crank * ((start + t).cos() - start.cos());
        let advance = gripper.travel.advance(gap(t));
        assert!((advance - exact).abs() < 5e-5, "{t}: {advance} {exact}");
    }
    assert!(gripper.sources["motion"].verified, "{:?}", found.notes);
    // The pad leans by 0.3 rad at every width: parallel to itself, and taken as it stands.
    let leaning = level.replace("offset=\"0\"", "offset=\"0.3\"");
    let (leant, found) = imported(&model(&leaning), ["tip", "fixed"]);
    assert!(!leant.sources["motion"].verified, "beyond its limit of 1: {:?}", found.notes);
    assert!(found.notes.iter().any(|note| note.contains("'level' leaves its own limits")));
    // Nothing faces the fixed jaw: an axis of the palm is a guess.
    assert!(found.notes.iter().any(|note| note.contains("no flat faces")), "{:?}", found.notes);
    let corner = 0.015 * 0.3_f64.sin();
    assert!((leant.stroke[1] - gap(turn) + corner).abs() < 1e-6, "{:?}", leant.stroke);
    // The hand drawn askew in its palm: the pads show where it closes, no axis does.
    let askew =
        model(&level).replacen("0 0 0.04\" rpy=\"0 0 0", "0 0 0.04\" rpy=\"0.2 0 0", 1).replace(
            &format!("{} 0.04\" rpy=\"0 0 0", -crank * start.sin()),
            &format!(
                "{} {}\" rpy=\"0.2 0 0",
                -crank * start.sin() * 0.2_f64.cos(),
                0.04 - crank * start.sin() * 0.2_f64.sin()
            ),
        );
    assert_eq!(askew.matches("rpy=\"0.2 0 0").count(), 2, "{askew}");
    let (askew, found) = imported(&askew, ["tip", "fixed"]);
    assert!((askew.stroke[1] - gap(turn)).abs() < 1e-6, "{:?}", askew.stroke);
    assert!(askew.sources["motion"].verified, "{:?}", found.notes);
    // Half as much does not keep it level.
    let half = level.replace("multiplier=\"1\"", "multiplier=\"0.5\"");
    let message = refusal(&model(&half), ["tip", "fixed"]);
    assert!(message.contains("'tip' turns by 17 deg"), "{message}");
}

/// A jaw on a slanted slide beside a fixed one: the pads close along their normal and shift.
#[test]
fn a_slanted_slide_closes_along_the_pads_normal() {
    let limit = "<limit lower=\"0\" upper=\"0.05\" effort=\"20\" velocity=\"1\"/>";
    let (gripper, found) = imported(&arm("prismatic", "0 0.8 0.6", limit), ["moving", "fixed"]);
    assert!((gripper.stroke[1] - 0.04).abs() < 1e-9, "{:?}", gripper.stroke);
    assert!((gripper.travel.advance(0.02) - 0.015).abs() < 1e-9);
    assert!(gripper.sources["motion"].verified, "{:?}", found.notes);
}

#[test]
fn two_drives_are_marked() {
    let limit = "<limit lower=\"0\" upper=\"0.03\" effort=\"40\" velocity=\"1\"/>";
    let text = format!(
        "<robot name=\"pair\">{}{}{}{}{}</robot>",
        link("palm", [0.05, 0.12, 0.04], [0.0, 0.0, 0.02]),
        link("left", [0.018, 0.01, 0.05], [0.0, 0.005, 0.025]),
        link("right", [0.018, 0.01, 0.05], [0.0, -0.005, 0.025]),
        joint("a", "prismatic", "palm", "left", [0.0, 0.0, 0.05], "0 1 0", limit),
        joint("b", "prismatic", "palm", "right", [0.0, 0.0, 0.05], "0 -1 0", limit),
    );
    let (gripper, found) = imported(&text, ["left", "right"]);
    assert_eq!(gripper.stroke, [0.0, 0.06]);
    assert!(!gripper.sources["motion"].verified && !gripper.sources["stroke"].verified);
    assert!(found.notes.iter().any(|note| note.contains("'a' and 'b' both drive")));
}

#[test]
fn a_jaw_that_turns_on_the_spot_is_told() {
    let limit = "<limit lower=\"0\" upper=\"1\" effort=\"5\" velocity=\"1\"/>";
    let text = arm("revolute", "-1 0 0", limit);
    let message = refusal(&text, ["moving", "fixed"]);
    assert!(message.contains("'moving' turns by 57 deg"), "{message}");
}

//! The catalogue's 2F-85, and a gripper imported from its public robot model, against that model as
//! an independent reader of URDF files places it. Both come from PyPI: see
//! `tests/readers/requirements.txt`. The 2F-140 and the RG2, whose models no package carries, are
//! held to recorded joints in `tests/propose/motion.rs`.

use std::path::Path;

use glam::DVec3;
use gripfast::gripper::{self, Gripper};

use super::export_readers::read;

/// Half of the model's pad box along the closing axis \[m\]: the frames lie in its middle.
const HALF_PAD: f64 = 6.35e-3 / 2.0;
const LINKS: [&str; 2] = ["left_inner_finger_pad", "right_inner_finger_pad"];

/// Joint value, distance of the pads, and height of their middle above the base.
struct State {
    joint: f64,
    gap: f64,
    height: f64,
}

/// The model over its joint's range, and its file.
fn model() -> Option<(Vec<State>, String)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("asked.json");
    let values: Vec<f64> = (0..=40).map(|step| 0.8 * f64::from(step) / 40.0).collect();
    let asked = serde_json::json!({
        "model": "robotiq_2f_85", "joint": "finger_joint", "base": "base_link", "links": LINKS,
        "values": values,
    });
    std::fs::write(&path, asked.to_string()).unwrap();
    let found = read("read_urdf.py", "airo_models, yourdfpy", &path)?;
    let point = |value: &serde_json::Value| {
        DVec3::from_array([0, 1, 2].map(|axis| value[axis].as_f64().unwrap()))
    };
    let places = found["places"].as_array().unwrap();
    assert_eq!(places.len(), values.len());
    let states = values.into_iter().zip(places).map(|(joint, pads)| {
        let [one, other] = [point(&pads[0]), point(&pads[1])];
        State { joint, gap: one.distance(other) - 2.0 * HALF_PAD, height: ((one + other) / 2.0).z }
    });
    Some((states.collect(), found["file"].as_str().unwrap().to_owned()))
}

/// Distance of the pads' middle from the flange.
fn reach(gripper: &Gripper, gap: f64) -> f64 {
    let flange = gripper.grip_from_flange.unwrap();
    -gripper.palm_place(gap).point(flange.origin).x
}

#[test]
fn the_2f85_follows_its_public_model() {
    let Some((states, _)) = model() else { return };
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let mut seen = 0;
    for State { joint, gap, height } in states {
        if !(0.0..=gripper.stroke[1]).contains(&gap) {
            continue;
        }
        seen += 1;
        let off = reach(&gripper, gap) - height;
        assert!(off.abs() < 0.5e-3, "at {gap} m the pads stand {off} m off the model's");
        let found = gripper.travel.joint(gap, gripper.stroke).unwrap();
        assert!((found - joint).abs() < 2e-3, "at {gap} m: joint {found}, not {joint}");
    }
    assert!(seen > 35, "{seen}");
}

#[test]
fn a_gripper_imported_from_the_model_follows_it_too() {
    let Some((states, file)) = model() else { return };
    let found = gripper::import(Path::new(&file), LINKS, Some("imported")).unwrap();
    let imported = gripper::parse(&found.text, "imported").unwrap();
    for State { joint, gap, height } in states {
        let off = reach(&imported, gap) - height;
        assert!(off.abs() < 0.1e-3, "at {gap} m the pads stand {off} m off the model's");
        let found = imported.travel.joint(gap, imported.stroke).unwrap();
        assert!((found - joint).abs() < 2e-3, "at {gap} m: joint {found}, not {joint}");
    }
    let [pad, _] = imported.pad_sizes();
    assert!((pad - glam::DVec2::new(0.0375, 0.022)).length() < 1e-6, "{pad}");
    assert!(imported.is_symmetric() && imported.sources.values().any(|source| !source.verified));
}

//! The catalogue's linkages, and a gripper imported from a model, against public robot models as an
//! independent reader of URDF files places them: the 2F-85 from PyPI, the others from
//! `tests/readers/models`; see `tests/readers/requirements.txt`.

use std::path::Path;

use glam::{DMat3, DVec3};
use gripfast::export::{self, Format, Joint, Options, Origin, Stated};
use gripfast::gripper::{self, Gripper, Jaw, Travel};
use gripfast::model::Frame;
use serde_json::{Value, json};

use super::export_readers::read;
use crate::support::grips;

/// Places over the stroke.
const STEPS: u32 = 40;

/// A model and how it names things.
struct Model {
    gripper: &'static str,
    /// In `tests/readers/models`; none: of the package.
    file: Option<&'static str>,
    links: [&'static str; 2],
}

const MODELS: [Model; 3] = [
    Model {
        gripper: "robotiq-2f85",
        file: None,
        links: ["left_inner_finger_pad", "right_inner_finger_pad"],
    },
    Model {
        gripper: "robotiq-2f140",
        file: Some("robotiq_2f_140.urdf"),
        links: ["left_inner_finger_pad", "right_inner_finger_pad"],
    },
    Model {
        gripper: "onrobot-rg2",
        file: Some("onrobot_rg2.urdf"),
        links: ["left_finger_tip_link", "right_finger_tip_link"],
    },
];

/// Both pads of a model in its base's frame.
struct State {
    /// Distance of their inner faces.
    gap: f64,
    /// Between their middles.
    middle: DVec3,
}

impl Model {
    /// The pads at each value of the joint, and the model's file; `None` where the reader cannot run
    /// and need not.
    fn states(&self, values: &[f64]) -> Option<(Vec<State>, String)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("asked.json");
        let file = self.file.map(|file| {
            crate::support::root().join("tests/readers/models").join(file).display().to_string()
        });
        let asked = json!({
            "file": file, "model": "robotiq_2f_85", "joint": "finger_joint", "base": "base_link",
            "links": self.links, "values": values,
        });
        std::fs::write(&path, asked.to_string()).unwrap();
        let found = read("read_urdf.py", "airo_models, yourdfpy", &path)?;
        let point = |value: &Value| -> DVec3 { serde_json::from_value(value.clone()).unwrap() };
        let places = found["places"].as_array().unwrap();
        assert_eq!(places.len(), values.len());
        let states = places.iter().map(|pads| {
            let [one, other] = [0, 1].map(|jaw: usize| -> Vec<DVec3> {
                pads[jaw].as_array().unwrap().iter().map(point).collect()
            });
            let closing = (one[0] - other[0]).normalize();
            let near = |corners: &[DVec3], way: DVec3| {
                corners.iter().map(|corner| corner.dot(way)).fold(f64::INFINITY, f64::min)
            };
            let gap = near(&one[1..], closing) + near(&other[1..], -closing);
            State { gap, middle: (one[0] + other[0]) / 2.0 }
        });
        Some((states.collect(), found["file"].as_str().unwrap().to_owned()))
    }
}

/// How far the pads of the model, mounted at the flange that an export states and with its joint as
/// the export states it, are from where the grip has them, at most over the stroke: their middle, and
/// their distance.
fn off(model: &Model, gripper: &Gripper, joint: Joint) -> Option<[f64; 2]> {
    let [least, most] = gripper.stroke;
    let mut set = grips::grip_set(0);
    set.gripper = serde_json::to_value(gripper).unwrap();
    set.grips = (0..=STEPS)
        .map(|step| {
            let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.1 * f64::from(step));
            let pose = Frame { rotation: turn, origin: DVec3::new(0.1, -0.2, 0.003) };
            let mut grip = grips::grip(u64::from(step), pose, 0.1);
            grip.grip.width = least + (most - least) * f64::from(step) / f64::from(STEPS);
            grip
        })
        .collect();
    let options = Options::default()
        .with_origin(Some(Origin::Stated(Stated::Flange)))
        .with_joints(vec![joint]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grips.isaac_grasp.yaml");
    export::write(&set, Format::IsaacGrasp, &path, &options, None).unwrap();
    let found = read("read_isaac_grasp.py", "yaml", &path)?;
    let rows = found["grips"].as_array().unwrap();
    assert_eq!(rows.len(), set.grips.len());
    // The reader gives the joint where others have the width.
    let joints: Vec<f64> = rows.iter().map(|row| row["width"].as_f64().unwrap()).collect();
    let (states, _) = model.states(&joints)?;
    let mut worst = [0.0_f64; 2];
    for ((row, state), grip) in rows.iter().zip(states).zip(&set.grips) {
        let vector = |value: &Value| -> DVec3 { serde_json::from_value(value.clone()).unwrap() };
        let rows = [0, 1, 2].map(|axis: usize| vector(&row["rotation"][axis]));
        let seen = DVec3::from_array(rows.map(|row| row.dot(state.middle)));
        let place = vector(&row["position"]) + seen;
        worst[0] = worst[0].max(place.distance(grip.grip.part_from_grip.origin));
        worst[1] = worst[1].max((state.gap - grip.grip.width).abs());
    }
    Some(worst)
}

#[test]
fn linkages_of_the_catalogue_follow_their_public_models() {
    for model in MODELS {
        let name = model.gripper;
        let gripper = gripper::find(name).unwrap();
        let joint = Joint::parse("joint", "finger_joint:motion").unwrap();
        let Some([middle, gap]) = off(&model, &gripper, joint) else { return };
        eprintln!("{name}: pads {:.3} mm, gap {:.3} mm off", middle * 1e3, gap * 1e3);
        assert!(middle < 0.5e-3, "{name}: pads {middle} m off");
        assert!(gap < 0.5e-3, "{name}: distance of the pads {gap} m off");
    }
}

/// The comparison sees a gripper without its arc, a joint on a straight line, and pads that lie
/// half a millimetre off.
#[test]
fn the_comparison_sees_what_is_wrong() {
    for model in MODELS {
        let name = model.gripper;
        let mut gripper = gripper::find(name).unwrap();
        let [least, most] = gripper.stroke;
        let [closed, opened] = gripper.stroke.map(|gap| gripper.travel.joint(gap, gripper.stroke));
        let scale = (opened.unwrap() - closed.unwrap()) / (most - least);
        let offset = closed.unwrap() - scale * least;
        let straight = Joint::parse("joint", &format!("finger_joint:{scale}:{offset}")).unwrap();
        let Some([_, gap]) = off(&model, &gripper, straight.clone()) else { return };
        assert!(gap > 1e-3, "{name}: a straight line is {gap} m off");
        let mut moved = gripper.clone();
        moved.grip_from_flange.as_mut().unwrap().origin.x -= 0.9e-3;
        let motion = Joint::parse("joint", "finger_joint:motion").unwrap();
        let [middle, _] = off(&model, &moved, motion).unwrap();
        assert!(middle > 0.5e-3, "{name}: {middle}");
        gripper.travel = Travel::Parallel;
        let [middle, _] = off(&model, &gripper, straight).unwrap();
        assert!(middle > 5e-3, "{name}: without its arc {middle} m off");
    }
}

#[test]
fn a_gripper_imported_from_the_model_follows_it_too() {
    let values: Vec<f64> = (0..=40).map(|step| 0.8 * f64::from(step) / 40.0).collect();
    let Some((states, file)) = MODELS[0].states(&values) else { return };
    let found = gripper::import(Path::new(&file), MODELS[0].links, Some("imported")).unwrap();
    let imported = gripper::parse(&found.text, "imported").unwrap();
    for (State { gap, middle }, joint) in states.into_iter().zip(values) {
        let flange = imported.grip_from_flange.unwrap();
        let off = -imported.palm_place(gap).point(flange.origin).x - middle.z;
        assert!(off.abs() < 0.1e-3, "at {gap} m the pads stand {off} m off the model's");
        let found = imported.travel.joint(gap, imported.stroke).unwrap();
        assert!((found - joint).abs() < 2e-3, "at {gap} m: joint {found}, not {joint}");
    }
    let [pad, _] = imported.pad_sizes();
    assert!((pad - glam::DVec2::new(0.0375, 0.022)).length() < 1e-6, "{pad}");
    // The inner finger carries the pad: a finger body, not one of the palm that stops every grip.
    let finger = imported.bodies(Jaw::I).iter().find(|body| body.name == "left_inner_finger");
    let [low, high] = finger.unwrap().bounds();
    assert!(low.z > 0.0 && low.x > -0.04 && high.x < 0.04, "{low} {high}");
    assert!(imported.palm.iter().all(|body| !body.name.contains("inner_finger")));
    assert!(imported.is_symmetric() && imported.sources.values().any(|source| !source.verified));
}

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

/// What an export says of one grip.
struct Stands {
    /// The joint of the gripper.
    joint: f64,
    /// Where the flange is.
    place: DVec3,
    turn: [DVec3; 3],
    /// Where the grip has the pads' middle, and their distance.
    middle: DVec3,
    width: f64,
}

impl Stands {
    /// How far the pads of a model, mounted at the flange and with its joint at the export's value, are from
    /// where the grip has them: their middle, and their distance.
    fn off(&self, state: &State) -> [f64; 2] {
        let seen = DVec3::from_array(self.turn.map(|row| row.dot(state.middle)));
        let place = self.place + seen;
        [place.distance(self.middle), (state.gap - self.width).abs()]
    }
}

/// Grips over the stroke as an export states them for the flange and the gripper's joint.
fn exported(gripper: &Gripper, joint: Joint) -> Option<Vec<Stands>> {
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
    let vector = |value: &Value| -> DVec3 { serde_json::from_value(value.clone()).unwrap() };
    let stands = rows.iter().zip(&set.grips).map(|(row, grip)| Stands {
        // The reader gives the joint where others have the width.
        joint: row["width"].as_f64().unwrap(),
        place: vector(&row["position"]),
        turn: [0, 1, 2].map(|axis: usize| vector(&row["rotation"][axis])),
        middle: grip.grip.part_from_grip.origin,
        width: grip.grip.width,
    });
    Some(stands.collect())
}

/// What [`Stands::off`] says, at most over the stroke, of grippers with their joints; the model is read
/// once for all.
fn off<const N: usize>(model: &Model, cases: [(&Gripper, &Joint); N]) -> Option<[[f64; 2]; N]> {
    let mut sets = Vec::new();
    for (gripper, joint) in cases {
        sets.push(exported(gripper, joint.clone())?);
    }
    let joints: Vec<f64> = sets.iter().flatten().map(|stands| stands.joint).collect();
    let (states, _) = model.states(&joints)?;
    let mut states = states.iter();
    let mut worst = [[0.0_f64; 2]; N];
    for (worst, set) in worst.iter_mut().zip(&sets) {
        for (stands, state) in set.iter().zip(states.by_ref()) {
            let off = stands.off(state);
            *worst = [0, 1].map(|k| worst[k].max(off[k]));
        }
    }
    assert!(states.next().is_none());
    Some(worst)
}

/// The catalogue's linkages follow their public models, and the comparison sees a gripper without its
/// arc, a joint on a straight line, and pads that lie half a millimetre off.
#[test]
fn linkages_of_the_catalogue_follow_their_public_models() {
    for model in MODELS {
        let name = model.gripper;
        let gripper = gripper::find(name).unwrap();
        let [least, most] = gripper.stroke;
        let [closed, opened] = gripper.stroke.map(|gap| gripper.travel.joint(gap, gripper.stroke));
        let scale = (opened.unwrap() - closed.unwrap()) / (most - least);
        let offset = closed.unwrap() - scale * least;
        let straight = Joint::parse("joint", &format!("finger_joint:{scale}:{offset}")).unwrap();
        let motion = Joint::parse("joint", "finger_joint:motion").unwrap();
        let (mut moved, mut no_arc) = (gripper.clone(), gripper.clone());
        moved.grip_from_flange.as_mut().unwrap().origin.x -= 0.9e-3;
        no_arc.travel = Travel::Parallel;
        let cases =
            [(&gripper, &motion), (&gripper, &straight), (&moved, &motion), (&no_arc, &straight)];
        let Some([[middle, gap], line, moved, no_arc]) = off(&model, cases) else { return };
        eprintln!("{name}: pads {:.3} mm, gap {:.3} mm off", middle * 1e3, gap * 1e3);
        assert!(middle < 0.5e-3, "{name}: pads {middle} m off");
        assert!(gap < 0.5e-3, "{name}: distance of the pads {gap} m off");
        assert!(line[1] > 1e-3, "{name}: a straight line is {} m off", line[1]);
        assert!(moved[0] > 0.5e-3, "{name}: {} m", moved[0]);
        assert!(no_arc[0] > 5e-3, "{name}: without its arc {} m off", no_arc[0]);
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

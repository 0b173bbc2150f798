//! A made-up result set: a 60 x 40 x 20 mm box gripped across its 20 mm, with every field filled.

#![allow(dead_code, reason = "each suite uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DQuat, DVec2, DVec3};
use gripfast::gripper::{Body, Gripper, Shape, rectangle};
use gripfast::model::{Bounds, Contact, Frame, Grip, Polygon, Pressure, Slip, Status, Wrench};
use gripfast::part::MassProperties;
use gripfast::request::Request;
use gripfast::results::{
    GripSet, LoadCase, LoadScore, PartSummary, Provenance, RankedGrip, Resolved, Summary,
};
use gripfast::units::{Force, Length, Mass};

/// 20 x 10 mm pads, 40 mm fingers, a palm, 85 mm stroke.
pub(crate) fn gripper() -> Gripper {
    let boxed = |name: &str, half: DVec3, origin: DVec3| Body {
        name: name.into(),
        shape: Shape::Box { half },
        grip_from_body: Frame { rotation: DMat3::IDENTITY, origin },
    };
    let value = serde_json::json!({
        "name": "test gripper",
        "stroke": [0.0, 0.085],
        "force": [20.0, 100.0],
        "pad": rectangle(DVec2::new(0.02, 0.01)),
        "pad_friction": 0.6,
        "pad_thickness": null,
        "fingers": [boxed("finger", DVec3::new(0.025, 0.008, 0.004), DVec3::new(-0.015, 0.0, 0.004))],
        "palm": [boxed("palm", DVec3::new(0.02, 0.03, 0.06), DVec3::new(-0.06, 0.0, 0.0))],
        "grip_from_flange": Frame { rotation: DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X), origin: DVec3::new(-0.1, 0.0, 0.0) },
    });
    serde_json::from_value(value).unwrap()
}

/// A grip with this id, pose and `mu_s`; everything else follows from the id.
pub(crate) fn grip(id: u64, part_from_grip: Frame, mu_s: f64) -> RankedGrip {
    let square = |half: f64| Polygon { outer: rectangle(DVec2::splat(2.0 * half)), holes: vec![] };
    let hole = vec![DVec2::new(0.001, 0.001), DVec2::new(0.001, 0.002), DVec2::new(0.002, 0.001)];
    let contact = Contact {
        face_i: vec![Polygon { holes: vec![hole], ..square(0.005) }],
        face_ii: vec![square(0.004)],
    };
    let mut ranked = RankedGrip::new(
        Grip {
            id,
            part_from_grip,
            width: 0.02 + 1e-4 * id as f64,
            face_i: 0,
            face_ii: 1,
            angle: 0.1 * id as f64,
            contact: Arc::new(contact),
            surfaces: None,
            inside: false,
            flip_of: None,
        },
        LoadScore {
            load: u32::try_from(id % 2).unwrap(),
            wrench: Wrench {
                force: DVec3::new(1.0, -2.0, 0.5),
                moment: DVec3::new(0.01, 0.02, -0.03),
            },
            status: Status::Ok,
            mu_s: Some(mu_s),
            slip: Some(if id.is_multiple_of(3) {
                Slip::Translation { direction: [0.6, -0.8] }
            } else {
                Slip::Rotation { c: [0.01, -0.002], sense: -1 }
            }),
            pressure: Some(Pressure { a_i0: 1e5, a_ii0: 2e5, a1: -3e6, a2: 4e6 }),
            bounds: Some(Bounds {
                lower: mu_s,
                upper: if id.is_multiple_of(2) { f64::INFINITY } else { mu_s * 1.001 },
            }),
            residual: 1e-13,
        },
    );
    ranked.holds = Some(mu_s <= 0.6);
    ranked.alpha = 0.25;
    ranked.delta_d = 0.001;
    ranked.contact_share = 0.9;
    ranked.twist_margin = 0.8;
    ranked.safety = Some(0.6 / mu_s);
    ranked.force_needed = Some(100.0 * mu_s / 0.6);
    ranked.load_multiple = Some(0.6 / mu_s);
    ranked.mu_by_load = vec![Some(mu_s), None];
    ranked
}

/// `count` grips with various poses, ranked, `mu_s` 0.05, 0.10, ...
pub(crate) fn grip_set(count: u64) -> GripSet {
    let grips: Vec<RankedGrip> = (0..count)
        .map(|index| {
            let turn = DQuat::from_scaled_axis(DVec3::new(
                0.3 * index as f64,
                1.0 - 0.2 * index as f64,
                0.5,
            ));
            let pose = Frame {
                rotation: DMat3::from_quat(turn),
                origin: DVec3::new(0.001 * index as f64, -0.002, 0.01),
            };
            let mut grip = grip(index + 7, pose, 0.05 * (index + 1) as f64);
            grip.rank = index + 1;
            grip.score = Some(1.0 / grip.worst.mu_s.unwrap() + grip.alpha);
            grip
        })
        .collect();
    let mass = 0.1296;
    let inertia = DMat3::from_diagonal(
        DVec3::new(
            0.04_f64.powi(2) + 0.02_f64.powi(2),
            0.06_f64.powi(2) + 0.02_f64.powi(2),
            0.06_f64.powi(2) + 0.04_f64.powi(2),
        ) * (mass / 12.0),
    );
    let mut set = GripSet::new(
        provenance(),
        PartSummary {
            file: "box.stl".into(),
            unit_m: 0.001,
            triangles: 12,
            bbox_min: DVec3::new(-0.03, -0.02, -0.01),
            bbox_max: DVec3::new(0.03, 0.02, 0.01),
            mass: MassProperties {
                volume: 4.8e-5,
                mass,
                centre_of_mass: DVec3::new(0.001, 0.002, 0.003),
                inertia,
            },
            symmetry: None,
        },
        serde_json::to_value(gripper()).unwrap(),
        vec![
            LoadCase {
                name: "gravity -z".into(),
                wrench: Wrench { force: DVec3::new(0.0, 0.0, -1.27), moment: DVec3::ZERO },
            },
            LoadCase {
                name: "gravity, \"+z\"".into(),
                wrench: Wrench { force: DVec3::new(0.0, 0.0, 1.27), moment: DVec3::ZERO },
            },
        ],
    );
    set.summary = Summary {
        pairs: 3,
        candidates: 100,
        ranked: count,
        holding: Some(count.min(12)),
        rejections: BTreeMap::from([("twisted_out".to_owned(), 5)]),
        comparison: None,
    };
    set.grips = grips;
    set
}

fn provenance() -> Provenance {
    let mut resolved = Resolved::default();
    resolved.force = Force(80.0);
    resolved.spacing = Length(0.004);
    resolved.pad_friction = Some(0.6);
    resolved.seeds = 81;
    resolved.keep = 10_000;
    let mut request = Request::new("box.stl", "test \"gripper\"");
    request.mass = Some(Mass(0.1296));
    request.candidates.opening = Length(0.005);
    let mut provenance = Provenance::new(request, resolved);
    provenance.gripfast = "0.0.0".into();
    provenance.command =
        vec!["gripfast".into(), "plan".into(), "a \"quoted\"\nname: #1.stl".into()];
    provenance.warnings = vec!["the surface is \"open\"".into()];
    provenance
}

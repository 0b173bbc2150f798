//! GraspGen's grasp dataset JSON (its `GRASP_DATASET_FORMAT` page), with width and friction beside
//! the poses.

use std::io::Write;

use serde::Serialize;

use super::{View, matrix};

#[derive(Serialize)]
struct File<'a> {
    object: Object<'a>,
    grasps: Grasps,
    gripfast: Notes<'a>,
}

#[derive(Serialize)]
struct Object<'a> {
    file: &'a str,
    scale: f64,
}

#[derive(Serialize)]
struct Grasps {
    transforms: Vec<[[f64; 4]; 4]>,
    object_in_gripper: Vec<bool>,
    width: Vec<f64>,
    min_friction: Vec<Option<f64>>,
    id: Vec<u64>,
}

#[derive(Serialize)]
struct Notes<'a> {
    tool_frame: String,
    gripper: Option<&'a str>,
    version: &'a str,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    warnings: &'a [String],
}

pub(super) fn write(view: &View<'_>, writer: &mut impl Write) -> std::io::Result<()> {
    let grips = view.grips();
    // The candidates that are no grips come after the grips.
    let negatives = &view.set.negatives;
    let file = File {
        object: Object { file: &view.set.part.file, scale: view.set.part.unit_m },
        grasps: Grasps {
            transforms: grips
                .iter()
                .map(|grip| view.pose(grip))
                .chain(negatives.iter().map(|pose| view.negative_pose(pose)))
                .map(|frame| matrix(&frame))
                .collect(),
            object_in_gripper: grips
                .iter()
                .map(|grip| view.holds(grip))
                .chain(negatives.iter().map(|_| false))
                .collect(),
            width: grips
                .iter()
                .map(|grip| view.gap(grip))
                .chain(negatives.iter().map(|pose| view.gap_at(&pose.grip())))
                .collect(),
            min_friction: grips
                .iter()
                .map(|grip| grip.worst.mu_s)
                .chain(negatives.iter().map(|_| None))
                .collect(),
            id: grips
                .iter()
                .map(|grip| grip.grip.id)
                .chain(negatives.iter().map(|pose| pose.id))
                .collect(),
        },
        gripfast: Notes {
            tool_frame: view.tool_frame(),
            gripper: view.gripper.as_ref().map(|gripper| gripper.name.as_str()),
            version: &view.set.provenance.gripfast,
            warnings: &view.set.provenance.warnings,
        },
    };
    serde_json::to_writer(&mut *writer, &file)?;
    writer.write_all(b"\n")
}

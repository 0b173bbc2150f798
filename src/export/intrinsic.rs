//! `intrinsic_proto.grasping.ManualGraspAnnotations` of Intrinsic's SDK (`grasp_annotations.proto`)
//! as JSON, in the fields' own names: poses in the object frame, z the approach, y the opening.

use std::io::Write;

use glam::DQuat;
use serde::Serialize;

use super::View;
use super::table::positive;

#[derive(Serialize)]
struct Annotations {
    annotations: Vec<Annotation>,
}

#[derive(Serialize)]
struct Annotation {
    ref_t_annotation: Pose,
    num_rotations: u32,
    score: f64,
}

#[derive(Serialize)]
struct Pose {
    position: Xyz,
    orientation: Xyzw,
}

#[derive(Serialize)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Serialize)]
struct Xyzw {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

pub(super) fn write(view: &View<'_>, writer: &mut impl Write) -> std::io::Result<()> {
    // Half a turn about the approach is the same grip where the gripper is the same with exchanged
    // jaws and the list does not hold both already.
    let flips = view.set.provenance.request.candidates.flips;
    let symmetric = view.gripper.as_ref().is_some_and(crate::gripper::Gripper::is_symmetric);
    let num_rotations = if symmetric && !flips && view.turns_about_the_tool_axis() { 2 } else { 1 };
    let annotations = view.grips().iter().map(|grip| {
        let pose = view.pose(grip);
        let [x, y, z] = pose.origin.to_array();
        let position = Xyz { x, y, z };
        let [x, y, z, w] = positive(DQuat::from_mat3(&pose.rotation)).to_array();
        Annotation {
            ref_t_annotation: Pose { position, orientation: Xyzw { x, y, z, w } },
            num_rotations,
            score: view.quality(grip),
        }
    });
    let file = Annotations { annotations: annotations.collect() };
    serde_json::to_writer_pretty(&mut *writer, &file)?;
    writer.write_all(b"\n")
}

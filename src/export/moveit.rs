//! A list of `moveit_msgs/Grasp` messages as YAML, headers as in ROS 2.

use std::io::Write;

use glam::{DQuat, DVec3};

use super::View;
use super::table::positive;
use super::yaml::{number, string};

/// Share of the approach and retreat that must be free: half of them.
const LEAST_SHARE: f64 = 0.5;

pub(super) fn write(view: &View<'_>, writer: &mut impl Write) -> std::io::Result<()> {
    let frame = string(&view.options.part_frame);
    let force = view.set.provenance.resolved.force.0;
    let header = format!("{{stamp: {{sec: 0, nanosec: 0}}, frame_id: {frame}}}");
    let names =
        view.options.joints.iter().map(|joint| string(&joint.name)).collect::<Vec<_>>().join(", ");
    let posture = |width: f64, effort: Option<f64>| {
        let positions = view
            .options
            .joints
            .iter()
            .map(|joint| number(joint.position(width, view.gripper.as_ref())))
            .collect::<Vec<_>>()
            .join(", ");
        let efforts = effort
            .map(|effort| vec![number(effort); view.options.joints.len()].join(", "))
            .unwrap_or_default();
        format!(
            "    header: {header}\n    joint_names: [{names}]\n    points:\n    - {{positions: [{positions}], velocities: [], accelerations: [], effort: [{efforts}], time_from_start: {{sec: 0, nanosec: 0}}}}"
        )
    };
    let translation = |direction: DVec3| {
        let [x, y, z] = direction.to_array().map(number);
        let (desired, least) =
            (number(view.options.approach), number(view.options.approach * LEAST_SHARE));
        format!(
            "    direction: {{header: {header}, vector: {{x: {x}, y: {y}, z: {z}}}}}\n    desired_distance: {desired}\n    min_distance: {least}"
        )
    };
    writeln!(writer, "# moveit_msgs/Grasp, best first. Poses in metres in the frame of the part.")?;
    writeln!(writer, "# Tool frame: {}", view.tool_frame())?;
    for warning in view.warnings() {
        writeln!(writer, "# Warning: {warning}")?;
    }
    let grips = view.grips();
    if grips.is_empty() {
        return writeln!(writer, "[]");
    }
    for grip in grips {
        let pose = view.pose(grip);
        let [x, y, z] = pose.origin.to_array().map(number);
        let [qx, qy, qz, qw] = positive(DQuat::from_mat3(&pose.rotation)).to_array().map(number);
        let approach = grip.grip.part_from_grip.rotation.x_axis;
        writeln!(writer, "- id: {}", string(&grip.grip.id.to_string()))?;
        writeln!(writer, "  pre_grasp_posture:\n{}", posture(view.opened(grip), None))?;
        writeln!(
            writer,
            "  grasp_posture:\n{}",
            posture(view.gap(grip), (force > 0.0).then_some(force))
        )?;
        writeln!(
            writer,
            "  grasp_pose:\n    header: {header}\n    pose:\n      position: {{x: {x}, y: {y}, z: {z}}}"
        )?;
        writeln!(writer, "      orientation: {{x: {qx}, y: {qy}, z: {qz}, w: {qw}}}")?;
        writeln!(writer, "  grasp_quality: {}", number(view.quality(grip)))?;
        writeln!(writer, "  pre_grasp_approach:\n{}", translation(approach))?;
        writeln!(writer, "  post_grasp_retreat:\n{}", translation(-approach))?;
        writeln!(writer, "  post_place_retreat:\n{}", translation(-approach))?;
        writeln!(writer, "  max_contact_force: {}\n  allowed_touch_objects: []", number(force))?;
    }
    Ok(())
}

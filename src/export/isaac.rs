//! NVIDIA Isaac's `isaac_grasp` YAML, format version 1.0 (Isaac Sim's Grasp Editor and Isaac ROS
//! documentation).

use std::io::Write;

use glam::DQuat;

use super::View;
use super::table::positive;
use super::yaml::{number, string};

pub(super) fn write(view: &View<'_>, writer: &mut impl Write) -> std::io::Result<()> {
    let gripper = view.gripper.as_ref().map_or("gripper", |gripper| gripper.name.as_str());
    // The version stays a number: the importer subtracts 1.0 from it.
    writeln!(writer, "format: isaac_grasp\nformat_version: 1.0\n")?;
    writeln!(
        writer,
        "# position: metres; orientation: unit quaternion; both of the gripper frame in the part frame."
    )?;
    writeln!(writer, "# gripper frame: {}", view.tool_frame())?;
    for warning in view.warnings() {
        writeln!(writer, "# warning: {warning}")?;
    }
    writeln!(
        writer,
        "object_frame: {}\ngripper_frame: {}\n",
        string(&view.options.part_frame),
        string(gripper)
    )?;
    let grips = view.grips();
    writeln!(writer, "grasps:{}", if grips.is_empty() { " {}" } else { "" })?;
    for grip in grips {
        let pose = view.pose(grip);
        let [x, y, z] = pose.origin.to_array().map(number);
        let [qx, qy, qz, qw] = positive(DQuat::from_mat3(&pose.rotation)).to_array().map(number);
        writeln!(writer, "  {}:", string(&format!("grasp_{}", grip.grip.id)))?;
        writeln!(writer, "    confidence: {}", number(view.quality(grip)))?;
        writeln!(writer, "    position: [{x}, {y}, {z}]")?;
        writeln!(writer, "    orientation: {{w: {qw}, xyz: [{qx}, {qy}, {qz}]}}")?;
        for (name, width) in
            [("cspace_position", view.gap(grip)), ("pregrasp_cspace_position", view.opened(grip))]
        {
            writeln!(writer, "    {name}:")?;
            for joint in &view.options.joints {
                writeln!(
                    writer,
                    "      {}: {}",
                    string(&joint.name),
                    number(joint.position(width, view.gripper.as_ref()))
                )?;
            }
        }
    }
    Ok(())
}

//! ACRONYM's HDF5 layout, with our own numbers in a group beside the simulator's.

use std::io::Write;

use super::View;

#[cfg(feature = "hdf5")]
pub(super) fn write(view: &View<'_>, writer: &mut impl Write) -> std::io::Result<()> {
    use hdf5_pure::{AttrValue, FileBuilder};

    let grips = view.grips();
    let negatives = &view.set.negatives;
    let count = (grips.len() + negatives.len()) as u64;
    let part = &view.set.part;
    // The candidates that are no grips come after the grips; numbers of grips are nan there.
    let column = |value: &dyn Fn(&crate::results::RankedGrip) -> f64| {
        grips.iter().map(value).chain(negatives.iter().map(|_| f64::NAN)).collect::<Vec<f64>>()
    };
    let known = |of_grips: &dyn Fn(&crate::results::RankedGrip) -> f64,
                 of_others: &dyn Fn(&crate::model::Negative) -> f64| {
        grips.iter().map(of_grips).chain(negatives.iter().map(of_others)).collect::<Vec<f64>>()
    };
    let mut file = FileBuilder::new();

    let mut object = file.create_group("object");
    object
        .create_dataset("file")
        .with_strings(&[part.file.as_str()])
        .map_err(std::io::Error::other)?
        .with_shape(&[]);
    for (name, value) in [
        ("scale", part.unit_m),
        ("mass", part.mass.mass),
        ("volume", part.mass.volume),
        ("density", part.mass.mass / part.mass.volume),
    ] {
        object.create_dataset(name).with_f64_data(&[value]).with_shape(&[]);
    }
    object.create_dataset("com").with_f64_data(&part.mass.centre_of_mass.to_array());
    // Symmetric, so the order of rows and columns does not matter.
    object
        .create_dataset("inertia")
        .with_f64_data(&part.mass.inertia.to_cols_array())
        .with_shape(&[3, 3]);
    file.add_group(object.finish());

    if let Some(gripper) = &view.gripper {
        let mut group = file.create_group("gripper");
        group
            .create_dataset("type")
            .with_strings(&[gripper.name.as_str()])
            .map_err(std::io::Error::other)?
            .with_shape(&[]);
        group
            .create_dataset("configuration")
            .with_f64_data(&known(&|grip| view.opened(grip), &|pose| view.opened_at(&pose.grip())));
        file.add_group(group.finish());
    }

    let mut grasps = file.create_group("grasps");
    let transforms: Vec<f64> = grips
        .iter()
        .map(|grip| view.pose(grip))
        .chain(negatives.iter().map(|pose| view.negative_pose(pose)))
        .flat_map(|frame| super::matrix(&frame).into_iter().flatten())
        .collect();
    let warnings: Vec<String> = view.warnings().collect();
    grasps
        .create_dataset("transforms")
        .with_f64_data(&transforms)
        .with_shape(&[count, 4, 4])
        .set_attr("tool_frame", AttrValue::String(view.tool_frame()))
        .set_attr("warnings", AttrValue::String(warnings.join("\n")));
    let mut qualities = grasps.create_group("qualities");
    let mut flex = qualities.create_group("flex");
    let held: Vec<i64> = grips
        .iter()
        .map(|grip| i64::from(view.holds(grip)))
        .chain(negatives.iter().map(|_| 0))
        .collect();
    flex.create_dataset("object_in_gripper").with_i64_data(&held).set_attr(
        "source",
        AttrValue::String("computed: mu_s x safety <= pad friction; not simulated".into()),
    );
    qualities.add_group(flex.finish());
    let mut own = qualities.create_group("gripfast");
    own.create_dataset("min_friction")
        .with_f64_data(&column(&|grip| grip.worst.mu_s.unwrap_or(f64::NAN)));
    own.create_dataset("score").with_f64_data(&column(&|grip| grip.score.unwrap_or(f64::INFINITY)));
    own.create_dataset("width").with_f64_data(&known(&|grip| grip.grip.width, &|pose| pose.width));
    own.create_dataset("contact_share").with_f64_data(&column(&|grip| grip.contact_share));
    own.create_dataset("alpha").with_f64_data(&column(&|grip| grip.alpha));
    own.create_dataset("id").with_u64_data(&{
        let ids = grips.iter().map(|grip| grip.grip.id);
        ids.chain(negatives.iter().map(|pose| pose.id)).collect::<Vec<_>>()
    });
    if !negatives.is_empty() {
        // Empty for grips.
        let reasons = grips.iter().map(|_| "").chain(negatives.iter().map(|pose| &*pose.reason));
        own.create_dataset("reason")
            .with_strings(&reasons.collect::<Vec<_>>())
            .map_err(std::io::Error::other)?
            .with_shape(&[count]);
    }
    qualities.add_group(own.finish());
    grasps.add_group(qualities.finish());
    file.add_group(grasps.finish());
    writer.write_all(&file.finish().map_err(std::io::Error::other)?)
}

#[cfg(not(feature = "hdf5"))]
pub(super) fn write(_view: &View<'_>, _writer: &mut impl Write) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

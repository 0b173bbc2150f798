//! Poses of a gripper from files of other programs: the formats that [`crate::export`] writes, read
//! back with the frames that they hold.

mod formats;

use std::path::Path;

use crate::error::{Error, Result};
use crate::export::{Convention, Format, Origin, Stated};
use crate::file::guarded;
use crate::gripper::Gripper;
use crate::model::Frame;
use crate::part::Part;

/// Poses farther away than so many sizes of the part and so many metres hardly belong to it.
const FAR: [f64; 2] = [5.0, 1.0];

/// A pose of the gripper on the part.
#[derive(Debug, Clone, PartialEq)]
pub struct Pose {
    /// The name or number that it has in its file.
    pub name: String,
    /// Tool frame in the part frame.
    pub part_from_tool: Frame,
    /// Axes of the tool frame.
    pub convention: Convention,
    /// Origin of the tool frame.
    pub origin: Origin,
    /// Distance of the pads \[m\], where the file states it.
    pub gap: Option<f64>,
}

impl Pose {
    /// A pose given by its grip frame in the part frame.
    pub fn of_grip(name: &str, part_from_grip: Frame) -> Self {
        // The standard axes are those of the grip, renamed.
        let convention = Convention::Standard;
        let rotation = convention.rotation(None).unwrap_or_default();
        let part_from_tool = part_from_grip.compose(&Frame { rotation, origin: glam::DVec3::ZERO });
        Self { name: name.to_owned(), part_from_tool, convention, origin: Origin::Pads, gap: None }
    }
}

/// How poses are read; what is absent is what exports of the format hold.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Format; by the ending of the file when absent.
    pub format: Option<Format>,
    /// Axes of the tool frame.
    pub convention: Option<Convention>,
    /// Origin of the tool frame.
    pub origin: Option<Origin>,
}

/// What a file says of a pose.
struct Raw {
    name: String,
    frame: Frame,
    gap: Option<f64>,
}

/// Reads the poses of a file, in its order.
///
/// # Errors
/// When the file cannot be read, is not of its format, or holds a pose that is none; the message
/// names the place.
pub fn read(path: &Path, options: &Options, gripper: &Gripper) -> Result<Vec<Pose>> {
    let format = match options.format {
        Some(format) => format,
        // Rows alone, which we do not write.
        None if path.extension().is_some_and(|ending| ending == "npy") => Format::GraspNet,
        None => Format::from_path(path)?,
    };
    let place = path.display().to_string();
    let bytes = || crate::file::read(path);
    let found = match format {
        Format::Json | Format::JsonLines => return formats::native(&place, &bytes()?),
        Format::Csv | Format::Robot => formats::csv(&place, &bytes()?),
        Format::Parquet => guarded(&place, || formats::parquet(&place, path)),
        Format::IsaacGrasp => formats::isaac(&place, &bytes()?),
        Format::MoveIt => formats::moveit(&place, &bytes()?),
        Format::GraspGen => formats::graspgen(&place, &bytes()?),
        Format::GraspNet => formats::graspnet(&place, bytes()?),
        Format::Acronym => {
            let bytes = bytes()?;
            guarded(&place, || formats::acronym(&place, bytes))
        }
        Format::Glb | Format::Usd | Format::Intrinsic => {
            return Err(Error::input(
                place,
                "poses are not read from this format",
                "give CSV (also of a robot), Parquet, isaac_grasp, moveit, graspgen, graspnet, acronym, \
                 or a result file",
            ));
        }
    };
    let (raw, stated) = found?;
    // What the user says, what the file says, what the format usually holds.
    let (axes, from) = stated.as_deref().and_then(stated_frame).unzip();
    let convention = options.convention.or(axes).unwrap_or_else(|| format.convention());
    let origin = options.origin.or(from).unwrap_or_else(|| format.origin(Some(gripper)));
    let pose = |raw: Raw| Pose {
        name: raw.name,
        part_from_tool: raw.frame,
        convention,
        origin,
        gap: raw.gap,
    };
    Ok(raw.into_iter().map(pose).collect())
}

/// A warning where most poses lie so far from the part that their unit or frame is another one.
pub fn doubt(poses: &[Pose], part: &Part) -> Option<String> {
    let (low, high) = part.mesh.bounding_box();
    let (middle, size) = ((low + high) / 2.0, (high - low).length());
    let mut far: Vec<f64> =
        poses.iter().map(|pose| pose.part_from_tool.origin.distance(middle)).collect();
    far.sort_by(f64::total_cmp);
    let typical = *far.get(far.len() / 2)?;
    (typical > FAR[0] * size + FAR[1]).then(|| {
        format!(
            "the poses lie {typical:.1} m away from a part that measures {size:.3} m: lengths are \
             read in metres (in millimetres where a table's columns are named x_mm, y_mm, z_mm), in \
             the part's frame"
        )
    })
}

/// Every convention that an export can have.
fn conventions() -> impl Iterator<Item = Convention> {
    let stated = [Stated::Flange, Stated::Tool].map(Convention::Stated);
    Convention::ALL.into_iter().map(|known| known.0).chain(stated)
}

/// The frame that an export states in words, if it is one of ours.
fn stated_frame(text: &str) -> Option<(Convention, Origin)> {
    let (axes, origin) = text.split_once(", origin ")?;
    let convention = conventions().find(|known| known.axes() == axes)?;
    let stated = ["pads", "flange", "tool"]
        .into_iter()
        .filter_map(|name| Origin::parse("origin", name).ok())
        .find(|known| known.to_string() == origin);
    let behind = || {
        let distance = origin.strip_suffix(" mm behind the pads")?.parse::<f64>().ok()?;
        Some(Origin::Behind(distance * 1e-3))
    };
    Some((convention, stated.or_else(behind)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_an_export_are_understood() {
        for convention in conventions() {
            for origin in ["pads", "flange", "tool", "103.4mm"] {
                let origin = Origin::parse("origin", origin).unwrap();
                let text = format!("{}, origin {origin}", convention.axes());
                let (axes, from) = stated_frame(&text).unwrap();
                assert_eq!((axes.axes(), from), (convention.axes(), origin), "{text}");
            }
        }
        assert_eq!(stated_frame("x approach"), None);
    }
}

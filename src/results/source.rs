//! The part and the gripper that a result is about.

use std::path::{Path, PathBuf};

use super::GripSet;
use crate::error::{Error, Result};
use crate::gripper::Gripper;
use crate::part::{Part, ReadOptions};
use crate::units::Unit;

/// Corners of the bounding box may differ by this share of its diagonal.
const SAME_BOX: f64 = 1e-6;

impl GripSet {
    /// The gripper of the set.
    ///
    /// # Errors
    /// When the set holds none.
    pub fn read_gripper(&self) -> Result<Gripper> {
        serde_json::from_value(self.gripper.clone()).map_err(|error| {
            Error::input(
                "gripper in the result file",
                format!("cannot be read: {error}"),
                "write the result again with `gripfast plan`",
            )
        })
    }

    /// Where the part's file is: where the set names it, or else beside `result`, the file of the
    /// set; `None` where neither exists.
    pub fn part_file(&self, result: &Path) -> Option<PathBuf> {
        let named = PathBuf::from(&self.part.file);
        let beside = result.parent().map(|folder| folder.join(&named));
        let moved = named.file_name().map(|name| result.with_file_name(name));
        [Some(named), beside, moved].into_iter().flatten().find(|path| path.is_file())
    }

    /// Reads the part of the set from `path`, in its unit and with its centre of mass.
    ///
    /// # Errors
    /// As [`Part::read`]; when it is another part.
    pub fn read_part(&self, path: &Path) -> Result<Part> {
        let summary = &self.part;
        let options =
            ReadOptions::from(&self.provenance.request).with_unit(Unit::of_metres(summary.unit_m));
        let mut part = Part::read(path, &options)?;
        let (low, high) = part.mesh.bounding_box();
        let tolerance = SAME_BOX * (summary.bbox_max - summary.bbox_min).length();
        let off = (low - summary.bbox_min).abs().max((high - summary.bbox_max).abs()).max_element();
        if off.is_nan() || off > tolerance {
            let [size, expected] =
                [high - low, summary.bbox_max - summary.bbox_min].map(|size| size * 1e3);
            return Err(Error::input(
                path.display().to_string(),
                format!(
                    "is not the part of this result: its size is {size:.2} mm, or it lies \
                     elsewhere; the result's is {expected:.2} mm"
                ),
                "give the file that was planned on",
            ));
        }
        part.set_centre_of_mass(summary.mass.centre_of_mass);
        Ok(part)
    }
}

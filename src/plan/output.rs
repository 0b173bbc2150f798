//! Where the answer goes: result file, page, and the loads that a page shows.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{Assessor, Plan, Settings};
use crate::backend::{Backend, ScoreOptions, SeedSet};
use crate::error::{Error, Result};
use crate::export::{self, Format};
use crate::gripper::Gripper;
use crate::model::Miss;
use crate::report;
use crate::request::Polish;
use crate::results::{GripSet, RankedGrip};

/// The best grips of a list, for which a page shows the friction over all loads.
pub const WHOLE: usize = 20;

/// Grippers drawn into a GLB file where nobody says how many: more hide the part.
pub const GLB_TOP: usize = 10;

impl Plan {
    /// Writes a set under the names that the request gives to result file and page.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn save(&self, set: &GripSet) -> Result<Vec<PathBuf>> {
        let page = self.request.output.report.is_some();
        let misses = if page { super::near_misses(set, &self.part)? } else { Vec::new() };
        self.write(set, true, &misses)
    }

    /// Writes result file and page where the request names them, or beside these names when the
    /// run is not complete; the names. `misses` are for the page.
    pub(super) fn write(
        &self,
        set: &GripSet,
        complete: bool,
        misses: &[Miss],
    ) -> Result<Vec<PathBuf>> {
        let name = |path: &PathBuf| if complete { path.clone() } else { interrupted(path) };
        let output = self.request.output.output.as_ref().map(name);
        let page = self.request.output.report.as_ref().map(name);
        let mesh = Some(&self.part.mesh);
        if let (Some(path), Some(format)) = (&output, self.format) {
            match format {
                Format::Json => set.write(path)?,
                Format::JsonLines => set.write_lines(path)?,
                _ => {
                    let options = export::Options {
                        top: (format == Format::Glb).then_some(GLB_TOP),
                        ..export::Options::default()
                    };
                    export::write(set, format, path, &options, mesh)?;
                }
            }
        }
        if let Some(path) = &page {
            report::write(set, mesh, misses, path)?;
        }
        Ok(output.into_iter().chain(page).collect())
    }
}

/// Where an interrupted run writes what belongs under `path`: `grips.interrupted.json` for
/// `grips.json`. A pipe or device keeps its name.
fn interrupted(path: &Path) -> PathBuf {
    if std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_file()) {
        return path.to_path_buf();
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (stem, ending) = match name.split_once('.') {
        Some((stem, ending)) if !stem.is_empty() => (stem, format!(".{ending}")),
        _ => (name.as_ref(), String::new()),
    };
    path.with_file_name(format!("{stem}.interrupted{ending}"))
}

/// Refuses a file whose folder is not there now rather than after the search; `place` names it.
pub(super) fn folder(path: &Path, place: String, option: &'static str) -> Result<()> {
    crate::file::folder_of(path, &place).map_err(|error| error.with_options(&[option]))
}

/// The format of a result file by its ending, refused now rather than after the search.
pub(super) fn format(path: &Path) -> Result<Format> {
    let place = || format!("result file {}", path.display());
    if path.as_os_str() == "-" {
        return Err(Error::input(
            "result file -",
            "the table goes to standard output",
            "ask for JSON to have the result there, without a file",
        )
        .with_options(&["json"]));
    }
    folder(path, place(), "output")?;
    if path.extension().is_none() {
        return Ok(Format::Json);
    }
    let format = Format::from_path(path).map_err(|_| {
        let endings: Vec<&str> = Format::ALL.iter().flat_map(|known| known.2).copied().collect();
        Error::input(
            place(),
            "the file's ending names no format",
            format!("use one of {}", endings.join(", ")),
        )
        .with_options(&["output"])
    })?;
    export::check(format)?;
    Ok(format)
}

/// The gripper as the result file carries it.
pub(super) fn gripper_json(gripper: &Gripper) -> Result<Value> {
    serde_json::to_value(gripper).map_err(|error| {
        Error::input(&gripper.name, format!("cannot be written: {error}"), "correct the gripper")
    })
}

/// Solves all loads of the best `count` grips of a set for a page, as they were solved for the
/// result.
///
/// # Errors
/// As [`Backend::score`].
pub fn solve_every_load(set: &mut GripSet, count: usize) -> Result<()> {
    let scoring = &set.provenance.request.scoring;
    let settings = Settings::of_force(set.provenance.resolved.force.0).with_score(ScoreOptions {
        polish: Polish::All,
        separation: scoring.separation,
        refiner: scoring.refiner,
    });
    let seeds = SeedSet::default();
    let assessor = Assessor {
        loads: &set.loads,
        mass: set.part.mass,
        settings: &settings,
        backend: &Backend::Cpu,
        seeds: &seeds,
    };
    assessor
        .solve_every_load(&mut set.grips.iter_mut().take(count).collect::<Vec<&mut RankedGrip>>())
}

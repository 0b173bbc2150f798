//! Every option of the main job as plain data: what flags, files, results and other programs
//! share.
//!
//! A [`Request`] has one field for each flag of `gripfast plan`, of the same name, and its defaults
//! stand here and nowhere else. Quantities are texts with a unit in TOML and JSON (`"2mm"`) and
//! read back bit for bit; a number without a unit is refused. Nothing is computed here:
//! [`crate::plan::Plan`] runs a request.
//!
//! ```
//! use gripfast::request::Request;
//! use gripfast::units::{Length, Mass};
//!
//! let mut request = Request::new("bracket.stl", "robotiq-2f85");
//! request.mass = Some(Mass(0.35));
//! request.candidates.spacing = Some(Length(0.004));
//! let text = request.to_toml();
//! assert!(text.contains("mass = \"350g\"") && text.contains("spacing = \"4mm\""));
//! assert_eq!(Request::from_toml("request.toml", &text)?, request);
//! # Ok::<(), gripfast::error::Error>(())
//! ```

mod text;
mod words;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize};

use crate::error::{Error, Result};
use crate::file;
use crate::units::{
    Acceleration, Angle, Density, Force, Length, Mass, Memory, Pressure, Time, Unit,
};

pub use text::{Cone, EarlierWeights, Ground, InertiaMatrix, PoseError, Position, Region};
pub use words::{Choice, Polish, Refiner, Separation, Side};

/// The main job: which part, gripper and loads, and how to rank.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Request {
    /// Part file: STL, OBJ, PLY, OFF, 3MF, glTF, STEP.
    pub part: PathBuf,
    /// Unit of the part file's numbers; absent: the file's own, else millimetres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Most memory that reading the part may take; absent: see
    /// [`crate::memory::default_limit`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_memory: Option<Memory>,
    /// Whether a glTF file may name buffers outside of its own folder.
    pub outside_buffers: bool,
    /// Whether every facet of the part is meant as a plane: none is taken for a curved face.
    pub faceted: bool,
    /// Distance within which planes and round faces are fitted to a noisy part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fit: Option<Length>,
    /// Gripper of the catalogue, or a gripper file.
    pub gripper: String,
    /// Mass of the part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<Mass>,
    /// Density of the part's material, instead of the mass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<Density>,
    /// Centre of mass in the part frame, of an assembly say; absent: that of a uniform solid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com: Option<Position>,
    /// Inertia about the centre of mass, part axes; absent: that of a uniform solid of this mass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia: Option<InertiaMatrix>,
    /// Gripping force of one jaw; absent: the gripper's largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<Force>,
    /// Sources of load cases, see [`crate::load::LoadSet::parse`]; a text in which commas join them
    /// is read too.
    #[serde(deserialize_with = "list_or_text")]
    pub loads: Vec<String>,
    /// Acceleration in any direction on top of gravity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel: Option<Acceleration>,
    /// Which grips are proposed.
    pub candidates: Candidates,
    /// How they are scored.
    pub scoring: Scoring,
    /// Which of them are kept and shown, and what is added to these.
    pub selection: Selection,
    /// Where the answer goes.
    pub output: Output,
}

/// Which grips are proposed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Candidates {
    /// Step of the position grid; absent: a fifth of the pad's shorter side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing: Option<Length>,
    /// Step of the approach angle.
    pub angle_step: Angle,
    /// Approach along and across the edges of the gripped faces as well.
    pub edge_angles: bool,
    /// Close on curved faces, and on opposite planes that are not parallel; absent: where no
    /// candidate between parallel plane faces is free of interference, or where that makes no more
    /// than 20,000 candidates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curved: Option<bool>,
    /// Smallest contact area on either face, as a share of the most that a pad can touch there: the
    /// area in which the two faces overlap, or that of a pad over the middle of its bounds, at the
    /// grip's angle, whichever is smaller.
    pub min_contact: f64,
    /// Smallest contact area on either face, as a share of the pad's area.
    pub min_pad_share: f64,
    /// Largest distance of the grip from the centre of mass.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_offset: Option<Length>,
    /// Only approaches within this cone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub approach: Option<Cone>,
    /// The gripper must stay above this plane.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground: Option<Ground>,
    /// Boxes that the gripper must not enter.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub keep_out: Vec<Region>,
    /// Scene file: what stands around the part, in its frame or the world's, and what the robot can
    /// do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<PathBuf>,
    /// Only these faces, plane and curved ones, may be touched, and those of `faces_in`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<Vec<u32>>,
    /// Only planar faces that lie wholly in one of these boxes may be touched, and those of
    /// `faces`; no box: no such limit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faces_in: Vec<Region>,
    /// Grips that close on the part from outside, that open in a slot or bore, or both.
    pub grips: Side,
    /// List each grip with exchanged jaws as well.
    pub flips: bool,
    /// Way by which each jaw opens beyond contact for the approach; less where the stroke ends.
    pub opening: Length,
    /// Way by which each jaw must at least be able to open beyond contact.
    pub min_opening: Length,
    /// Distance kept between gripper and part, but for the pads.
    pub clearance: Length,
    /// Length of the straight approach that must be clear of ground and keep-out boxes; of the part
    /// it must be clear all the way.
    pub approach_distance: Length,
}

/// How grips are scored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Scoring {
    /// Where slip twists are searched.
    pub backend: Choice,
    /// Graphics adapter, by its number or part of its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adapter: Option<String>,
    /// Slip twists tried for each load before the exact solver, at least.
    pub seeds: usize,
    /// Weight of `1/mu_s` in the score.
    pub k1: f64,
    /// Weight of alpha [1/rad] in the score.
    pub k2: f64,
    /// Friction coefficient of the pads, for the safety and the force needed; absent: the
    /// gripper's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pad_friction: Option<f64>,
    /// Safety factor: a grip holds where `mu_s` times this is at most the pads' friction.
    pub safety: f64,
    /// Greatest pressure that does not mark the part, of the squeeze without a load on either face;
    /// absent: any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_pressure: Option<Pressure>,
    /// Uncertainty of the part's position along the pads, for alpha.
    pub position_error: Length,
    /// Pad friction while closing, for alpha.
    pub closing_friction: f64,
    /// What becomes of grips whose pads separate under a load.
    pub separation: Separation,
    /// Which loads are solved exactly.
    pub polish: Polish,
    /// Minimiser of the exact solver.
    pub refiner: Refiner,
    /// Threads; absent: one for each core.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<usize>,
}

/// Which grips are kept and shown, and what is added to these.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Selection {
    /// Grips to show.
    pub top: usize,
    /// Show grips that differ in place, face pair and approach.
    pub diverse: bool,
    /// List one of the grips that a symmetry of the part maps to each other, for all of them.
    pub merge_symmetric: bool,
    /// Show also grips that a turn about the axis of a round part maps to one shown.
    pub every_turn: bool,
    /// Only the candidates with these numbers are scored; absent: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ids: Option<Vec<u64>>,
    /// Best grips to keep; absent: see [`Request::kept`]. With `diverse`, that many of these that
    /// differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep: Option<usize>,
    /// Try each shown grip at poses off by up to this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_noise: Option<PoseError>,
    /// Displaced poses for each grip, spread evenly.
    pub noise_samples: u32,
    /// Beside the score the evaluation function of the earlier method, with these weights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compare: Option<EarlierWeights>,
    /// Candidates that are no grips to keep as a sample, shared among the reasons as evenly as their
    /// counts allow.
    pub negatives: usize,
}

/// Where the answer goes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Output {
    /// Result file; its ending says the format.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<PathBuf>,
    /// Self-contained page to look at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<PathBuf>,
    /// The result as JSON instead of the table (the program only).
    pub json: bool,
    /// No progress bar and no notes (the program only).
    pub quiet: bool,
    /// Start a long run without a question (the program only).
    pub yes: bool,
    /// Resume the unfinished run whose state lies beside the result file; start at the first
    /// candidate when there is none.
    pub resume: bool,
    /// Time between two states written beside the result file; zero: after every chunk.
    pub checkpoint: Time,
}

impl Default for Request {
    /// No part and no gripper: see [`Request::new`].
    fn default() -> Self {
        Self {
            part: PathBuf::new(),
            unit: None,
            max_memory: None,
            outside_buffers: false,
            faceted: false,
            fit: None,
            gripper: String::new(),
            mass: None,
            density: None,
            com: None,
            inertia: None,
            force: None,
            loads: vec!["gravity".to_owned()],
            accel: None,
            candidates: Candidates::default(),
            scoring: Scoring::default(),
            selection: Selection::default(),
            output: Output::default(),
        }
    }
}

impl Default for Candidates {
    fn default() -> Self {
        Self {
            spacing: None,
            angle_step: Angle(15_f64.to_radians()),
            edge_angles: true,
            curved: None,
            min_contact: 0.25,
            min_pad_share: 0.02,
            max_offset: None,
            approach: None,
            ground: None,
            keep_out: Vec::new(),
            scene: None,
            faces: None,
            faces_in: Vec::new(),
            grips: Side::Outside,
            flips: false,
            opening: Length(5e-3),
            min_opening: Length(0.05e-3),
            clearance: Length(0.0),
            approach_distance: Length(0.1),
        }
    }
}

impl Default for Scoring {
    fn default() -> Self {
        Self {
            backend: Choice::Auto,
            adapter: None,
            seeds: 81,
            k1: 1.0,
            k2: 1.0,
            pad_friction: None,
            safety: 1.0,
            max_pressure: None,
            position_error: Length(0.0),
            closing_friction: 0.0,
            separation: Separation::Solve,
            polish: Polish::Auto,
            refiner: Refiner::Newton,
            threads: None,
        }
    }
}

impl Default for Selection {
    fn default() -> Self {
        Self {
            top: 10,
            diverse: false,
            merge_symmetric: false,
            every_turn: false,
            ids: None,
            keep: None,
            pose_noise: None,
            noise_samples: 64,
            compare: None,
            negatives: 0,
        }
    }
}

impl Default for Output {
    fn default() -> Self {
        Self {
            output: None,
            report: None,
            json: false,
            quiet: false,
            yes: false,
            resume: false,
            checkpoint: Time(30.0),
        }
    }
}

/// Grips kept where the request does not say how many.
pub(crate) const KEEP: usize = 10_000;
/// Most displaced poses for each grip.
const MOST_SAMPLES: u32 = 1_000_000;
/// Most poses that are no grips in a result.
const MOST_NEGATIVES: usize = 1_000_000;

impl Request {
    /// A request for this part and gripper with the default of every other option. Most loads need
    /// [`Request::mass`] or [`Request::density`] too.
    pub fn new(part: impl Into<PathBuf>, gripper: impl Into<String>) -> Self {
        Self { part: part.into(), gripper: gripper.into(), ..Self::default() }
    }

    /// How many of the best grips are kept. A choice of grips that differ needs more than it shows,
    /// and so does a list in which one stands for many.
    pub fn kept(&self) -> usize {
        let Selection { top, diverse, merge_symmetric, keep, .. } = self.selection;
        let few = self.scoring.polish == Polish::Top && !diverse && !merge_symmetric;
        let choice = if diverse { KEEP } else { 0 };
        keep.unwrap_or(if few { 0 } else { KEEP }).max(top).max(choice).max(1)
    }

    /// Whether what is shown needs none but the first grips: no file, no choice among all, no
    /// number of grips to keep.
    pub(crate) fn wants_first_only(&self) -> bool {
        let Selection { diverse, merge_symmetric, keep, compare, .. } = &self.selection;
        let chosen = *diverse || *merge_symmetric || keep.is_some() || compare.is_some();
        !self.writes() && !chosen && self.scoring.k1 >= 0.0
    }

    /// Whether more is written than the grips to show.
    pub(crate) fn writes(&self) -> bool {
        let Output { output, report, json, .. } = &self.output;
        output.is_some() || report.is_some() || *json
    }

    /// Reads a stored request: JSON where the file's name ends in `.json`, else TOML. Paths in it
    /// are relative to the working folder, as on the command line.
    ///
    /// # Errors
    /// When the file cannot be read or is no request, naming line and field.
    pub fn read(path: &Path) -> Result<Self> {
        let text = file::read_text(path)?;
        let place = path.display().to_string();
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            serde_json::from_str(&text).map_err(|error| {
                wrong(format!("{place}:{}:{}", error.line(), error.column()), error.to_string())
            })
        } else {
            Self::from_toml(&place, &text)
        }
    }

    /// Parses a request in TOML; `place` is the file for messages.
    ///
    /// # Errors
    /// When the text is no request, naming line and field.
    pub fn from_toml(place: &str, text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|error| {
            let line = error
                .span()
                .map(|span| 1 + text[..span.start.min(text.len())].matches('\n').count());
            let place = line.map_or(place.to_owned(), |line| format!("{place}:{line}"));
            wrong(place, error.message().to_owned())
        })
    }

    /// The request as TOML, which [`Request::from_toml`] reads back.
    pub fn to_toml(&self) -> String {
        // Strings, numbers and lists of them can always be written.
        toml::to_string(self).unwrap_or_default()
    }

    /// Refuses values that no part and no gripper could make right. The place of an error is the
    /// field's name.
    ///
    /// # Errors
    /// When a number is not finite or outside its range, or two options contradict each other.
    pub fn check(&self) -> Result<()> {
        let Scoring { k1, k2, position_error, closing_friction, pad_friction, polish, .. } =
            self.scoring;
        finite("k1", k1)?;
        finite("k2", k2)?;
        not_negative("position_error", position_error.0)?;
        not_negative("closing_friction", closing_friction)?;
        if let Some(friction) = pad_friction {
            not_negative("pad_friction", friction)?;
        }
        let safety = self.scoring.safety;
        if !(safety.is_finite() && safety > 0.0) {
            return Err(Error::input("safety", format!("is {safety}"), "give a number above zero")
                .with_options(&["safety"]));
        }
        if let Some(pressure) = self.scoring.max_pressure
            && (pressure.0.is_nan() || pressure.0 <= 0.0)
        {
            let remedy = "give a pressure above zero, e.g. 2MPa";
            return Err(Error::input("max_pressure", format!("is {pressure}"), remedy)
                .with_options(&["max_pressure"]));
        }
        if let Some(inertia) = self.inertia {
            inertia.check()?;
        }
        if polish == Polish::Top && k1 < 0.0 {
            return Err(Error::input(
                "polish",
                "'top' needs a score that falls with mu_s, and k1 is negative",
                "use 'worst'",
            )
            .with_options(&["polish", "k1"]));
        }
        if self.mass.is_some() && self.density.is_some() {
            return Err(Error::input("mass", "is given beside a density", "give one of them")
                .with_options(&["mass", "density"]));
        }
        if let Some(memory) = self.max_memory
            && (memory.0.is_nan() || memory.0 <= 0.0)
        {
            return Err(Error::input(
                "max_memory",
                format!("is {memory}"),
                "give a size above zero",
            )
            .with_options(&["max_memory"]));
        }
        if self.scoring.threads == Some(0) {
            return Err(Error::input("threads", "is 0", "give one or more, or none for all cores")
                .with_options(&["threads"]));
        }
        self.selection.check()?;
        let checkpoint = self.output.checkpoint;
        if !(0.0..=1e9).contains(&checkpoint.0) {
            return Err(Error::input(
                "checkpoint",
                format!("'{checkpoint}' is no time to wait"),
                "give zero (after every chunk) or more, e.g. 30s",
            )
            .with_options(&["checkpoint"]));
        }
        Ok(())
    }
}

impl Selection {
    fn check(&self) -> Result<()> {
        if let Some(noise) = self.pose_noise
            && !(noise.shift.0 >= 0.0
                && noise.turn.0 >= 0.0
                && (noise.shift.0 + noise.turn.0).is_finite())
        {
            return Err(Error::input(
                "pose_noise",
                format!("'{noise}' is negative"),
                "give how far the pose may be off either way, zero or more",
            )
            .with_options(&["pose_noise"]));
        }
        if !(1..=MOST_SAMPLES).contains(&self.noise_samples) {
            return Err(Error::input(
                "noise_samples",
                format!("is {}", self.noise_samples),
                format!("give 1 to {MOST_SAMPLES}"),
            )
            .with_options(&["noise_samples"]));
        }
        if self.negatives > MOST_NEGATIVES {
            return Err(Error::input(
                "negatives",
                format!("is {}", self.negatives),
                format!("give at most {MOST_NEGATIVES}"),
            )
            .with_options(&["negatives"]));
        }
        if let Some(EarlierWeights { k1, k2, k3, epsilon }) = self.compare {
            for weight in [k1, k2, k3] {
                not_negative("compare", weight)?;
            }
            if !(epsilon > 0.0 && epsilon.is_finite()) {
                return Err(Error::input(
                    "compare",
                    format!("EPSILON is {epsilon} m"),
                    "give a length above zero: a grip at the centre of mass is divided by it",
                )
                .with_options(&["compare"]));
            }
        }
        Ok(())
    }
}

fn finite(field: &'static str, value: f64) -> Result<()> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(Error::input(field, format!("is {value}"), "give a finite number")
            .with_options(&[field]))
    }
}

fn not_negative(field: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(Error::input(field, format!("is {value}"), "give a number, zero or more")
            .with_options(&[field]))
    }
}

fn wrong(place: String, problem: String) -> Error {
    Error::format(
        place,
        format!("not a request: {problem}"),
        "write one with the option print_request and change that",
    )
    .with_options(&["print_request"])
}

/// A list of texts, or one text whose parts commas join.
fn list_or_text<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "a list of texts, or one text with commas")]
    enum Either {
        List(Vec<String>),
        Text(String),
    }
    Ok(match Either::deserialize(deserializer)? {
        Either::List(list) => list,
        Either::Text(text) => text.split(',').map(|part| part.trim().to_owned()).collect(),
    })
}

#[cfg(test)]
mod tests;

//! Reading and writing of the native file: JSON, or JSON Lines (the set without its grips on the
//! first line, then a grip a line).

use std::io::Write;
use std::path::Path;

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::{FORMAT, GripSet, LoadCase, PartSummary, Provenance, RankedGrip, Summary, VERSION};
use crate::error::{Error, Result};
use crate::model::{Frame, Negative};

/// Largest departure of a pose from a rotation that is taken for rounding.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// What tells a result file, and of what version, when the rest cannot be read.
#[derive(Deserialize)]
struct Marks {
    format: Option<String>,
    version: Option<u64>,
}

/// [`GripSet`] less its grips, borrowed.
#[derive(Serialize)]
struct Head<'a> {
    format: &'a str,
    version: u32,
    provenance: &'a Provenance,
    part: &'a PartSummary,
    gripper: &'a serde_json::Value,
    loads: &'a [LoadCase],
    summary: &'a Summary,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    negatives: &'a [Negative],
}

impl GripSet {
    /// A set without grips and counts. `gripper` is a [`crate::gripper::Gripper`] as JSON.
    pub fn new(
        provenance: Provenance,
        part: PartSummary,
        gripper: serde_json::Value,
        loads: Vec<LoadCase>,
    ) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            provenance,
            part,
            gripper,
            loads,
            summary: Summary::default(),
            negatives: Vec::new(),
            grips: Vec::new(),
        }
    }

    /// Reads a native result file, JSON or JSON Lines.
    ///
    /// # Errors
    /// When the file cannot be read, is no result file or of another version, breaks off, or holds
    /// a grip that cannot be (a pose that is no rotation, a load that is not in the list), naming
    /// line or grip.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = crate::file::read(path)?;
        Self::parse(&path.display().to_string(), &bytes)
    }

    /// Parses the content of a native result file; `place` is the file for messages.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(place: &str, bytes: &[u8]) -> Result<Self> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if bytes.iter().all(u8::is_ascii_whitespace) {
            return Err(Error::input(
                place,
                "the file is empty",
                "give a result file written by `gripfast plan -o`",
            ));
        }
        let first_line = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
        let set = match serde_json::from_slice::<Self>(&bytes[..first_line]) {
            Ok(head) => head.with_lines(place, &bytes[first_line..])?,
            Err(_) => match old_set(place, &bytes[..first_line])? {
                Some(head) => head.with_lines(place, &bytes[first_line..])?,
                None => match serde_json::from_slice(bytes) {
                    Ok(set) => set,
                    Err(error) => {
                        old_set(place, bytes)?.ok_or_else(|| explain(place, bytes, &error))?
                    }
                },
            },
        };
        set.check(place)?;
        Ok(set)
    }

    /// Appends the grips of a JSON Lines file after its first line.
    fn with_lines(mut self, place: &str, rest: &[u8]) -> Result<Self> {
        for (index, line) in rest.split(|byte| *byte == b'\n').enumerate() {
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            // The piece before the first newline is the end of line 1.
            let grip = serde_json::from_slice(line).map_err(|error| {
                Error::input(
                    format!("{place}:{}", index + 1),
                    format!("not a grip: {error}"),
                    "the file is cut off or was changed by hand; write it again",
                )
            })?;
            self.grips.push(grip);
        }
        Ok(self)
    }

    /// Refuses what no run writes.
    fn check(&self, place: &str) -> Result<()> {
        check_marks(place, Some(&self.format), Some(self.version.into()))?;
        let mut ids = std::collections::HashSet::new();
        for (index, ranked) in self.grips.iter().enumerate() {
            let wrong = |problem: String| {
                Error::input(
                    format!("{place}, grips[{index}] (id {})", ranked.grip.id),
                    problem,
                    "write the file again with `gripfast plan`",
                )
            };
            if !is_pose(&ranked.grip.part_from_grip) {
                return Err(wrong("part_from_grip is not a rotation and an origin".into()));
            }
            if !(ranked.grip.width.is_finite() && ranked.grip.width >= 0.0) {
                return Err(wrong(format!("a width of {} m", ranked.grip.width)));
            }
            if !ids.insert(ranked.grip.id) {
                return Err(wrong("another grip has this id".into()));
            }
            if let Some(mu) = ranked.worst.mu_s.filter(|mu| !(0.0..=f64::MAX).contains(mu)) {
                return Err(wrong(format!("a friction coefficient of {mu}")));
            }
            ranked.grip.contact.check(&format!("{place}, grips[{index}], contact "))?;
            if ranked.worst.load as usize >= self.loads.len() {
                return Err(wrong(format!(
                    "its worst load is number {}, but the file has {} loads",
                    ranked.worst.load,
                    self.loads.len()
                )));
            }
            if !(ranked.mu_by_load.is_empty() || ranked.mu_by_load.len() == self.loads.len()) {
                return Err(wrong(format!(
                    "mu_by_load has {} values for {} loads",
                    ranked.mu_by_load.len(),
                    self.loads.len()
                )));
            }
        }
        match self.negatives.iter().find(|pose| !is_pose(&pose.part_from_grip)) {
            None => Ok(()),
            Some(pose) => Err(Error::input(
                format!("{place}, negatives (id {})", pose.id),
                "part_from_grip is not a rotation and an origin",
                "write the file again with `gripfast plan`",
            )),
        }
    }

    /// Writes native JSON, a line per grip, whole or not at all.
    ///
    /// # Errors
    /// When a grip's pose or contact is not finite (nothing is written), or the file cannot be
    /// written.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.check_finite()?;
        crate::file::write(path, |writer| self.write_json(writer))
    }

    /// Writes JSON Lines, whole or not at all: the set without grips, then one grip a line.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn write_lines(&self, path: &Path) -> Result<()> {
        self.check_finite()?;
        crate::file::write(path, |writer| self.write_json_lines(writer))
    }

    /// The native JSON to any writer.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn write_json(&self, writer: &mut impl Write) -> std::io::Result<()> {
        let head = self.head();
        writeln!(writer, "{{\n\"format\": \"{}\",\n\"version\": {},", head.format, head.version)?;
        field(writer, "provenance", head.provenance)?;
        field(writer, "part", head.part)?;
        field(writer, "gripper", head.gripper)?;
        field(writer, "loads", &head.loads)?;
        field(writer, "summary", head.summary)?;
        if !head.negatives.is_empty() {
            field(writer, "negatives", &head.negatives)?;
        }
        writer.write_all(b"\"grips\": [")?;
        for (index, grip) in self.grips.iter().enumerate() {
            writer.write_all(if index == 0 { b"\n" } else { b",\n" })?;
            serde_json::to_writer(&mut *writer, grip)?;
        }
        writer.write_all(b"\n]\n}\n")
    }

    /// The JSON Lines form to any writer.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn write_json_lines(&self, writer: &mut impl Write) -> std::io::Result<()> {
        #[derive(Serialize)]
        struct FirstLine<'a> {
            #[serde(flatten)]
            head: Head<'a>,
            grips: [(); 0],
        }
        serde_json::to_writer(&mut *writer, &FirstLine { head: self.head(), grips: [] })?;
        writer.write_all(b"\n")?;
        for grip in &self.grips {
            serde_json::to_writer(&mut *writer, grip)?;
            writer.write_all(b"\n")?;
        }
        Ok(())
    }

    fn head(&self) -> Head<'_> {
        Head {
            format: &self.format,
            version: self.version,
            provenance: &self.provenance,
            part: &self.part,
            gripper: &self.gripper,
            loads: &self.loads,
            summary: &self.summary,
            negatives: &self.negatives,
        }
    }

    /// A null in a pose could be written but never read.
    fn check_finite(&self) -> Result<()> {
        let finite = |ranked: &RankedGrip| {
            let grip = &ranked.grip;
            let rings = grip
                .contact
                .face_i
                .iter()
                .chain(&grip.contact.face_ii)
                .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes));
            let wrench = ranked.worst.wrench;
            grip.part_from_grip.rotation.is_finite()
                && [grip.part_from_grip.origin, wrench.force, wrench.moment]
                    .iter()
                    .all(|vector| vector.is_finite())
                && [
                    grip.width,
                    grip.angle,
                    ranked.alpha,
                    ranked.delta_d,
                    ranked.contact_share,
                    ranked.twist_margin,
                ]
                .iter()
                .all(|value| value.is_finite())
                && ranked.worst.pressure.is_none_or(|p| {
                    [p.a_i0, p.a_ii0, p.a1, p.a2].iter().all(|value| value.is_finite())
                })
                && rings.flatten().all(|point| point.is_finite())
        };
        let mass = &self.part.mass;
        let part = [
            self.part.bbox_min,
            self.part.bbox_max,
            mass.centre_of_mass,
            DVec3::new(self.part.unit_m, mass.volume, mass.mass),
        ];
        if !(part.iter().all(|vector| vector.is_finite()) && mass.inertia.is_finite()) {
            return Err(Error::input(
                "result",
                "the part's size or mass properties are not finite",
                "check the mesh with `gripfast part`",
            ));
        }
        match self.grips.iter().find(|grip| !finite(grip)) {
            None => Ok(()),
            Some(ranked) => Err(Error::input(
                "result",
                format!("grip {} holds a number that is not finite", ranked.grip.id),
                "this is a fault of the program; please report it with the part",
            )),
        }
    }
}

/// Whether a frame is a rotation, up to rounding, and an origin.
fn is_pose(frame: &Frame) -> bool {
    let drift = frame.rotation * frame.rotation.transpose() - DMat3::IDENTITY;
    drift.to_cols_array().iter().all(|entry| entry.abs() <= ROTATION_TOLERANCE)
        && frame.rotation.determinant() > 0.0
        && frame.origin.is_finite()
}

fn field(writer: &mut impl Write, name: &str, value: &impl Serialize) -> std::io::Result<()> {
    write!(writer, "\"{name}\": ")?;
    serde_json::to_writer(&mut *writer, value)?;
    writer.write_all(b",\n")
}

/// A whole set of version 1, or the first line of one, in this version; `None` where the text is
/// neither.
fn old_set(place: &str, text: &[u8]) -> Result<Option<GripSet>> {
    match serde_json::from_slice::<Marks>(text) {
        Ok(Marks { format: Some(format), version: Some(1) }) if format == FORMAT => {}
        _ => return Ok(None),
    }
    let Ok(value) = serde_json::from_slice(text) else { return Ok(None) };
    let value = super::version1::upgrade(place, value)?;
    serde_json::from_value(value).map(Some).map_err(|error| {
        Error::input(
            place,
            format!("not a result file: {error}"),
            "write the file again with `gripfast plan`",
        )
    })
}

/// Why the content is no result of this version.
fn explain(place: &str, bytes: &[u8], error: &serde_json::Error) -> Error {
    // The marks first: of a file of another kind or version nothing else in it matters.
    if let Ok(marks) = serde_json::from_slice::<Marks>(bytes)
        && let Err(error) = check_marks(place, marks.format.as_deref(), marks.version)
    {
        return error;
    }
    let remedy = if error.is_eof() {
        "the file is cut off; write it again"
    } else {
        "give a result file written by `gripfast plan -o`"
    };
    Error::input(
        format!("{place}:{}:{}", error.line(), error.column()),
        format!("not a result file: {error}"),
        remedy,
    )
}

fn check_marks(place: &str, format: Option<&str>, version: Option<u64>) -> Result<()> {
    if format != Some(FORMAT) {
        let found = format.map_or_else(
            || "no format is named in it".to_owned(),
            |format| format!("its format is '{format}'"),
        );
        return Err(Error::input(
            place,
            format!("not a gripfast result file: {found}"),
            "give a result file written by `gripfast plan -o`",
        ));
    }
    match version {
        Some(version) if version == u64::from(VERSION) => Ok(()),
        Some(version) if version > u64::from(VERSION) => Err(Error::input(
            place,
            format!("version {version} of the result format; this program reads version {VERSION}"),
            "use a newer gripfast",
        )),
        _ => Err(Error::input(
            place,
            format!("the result format's version is missing or older than {VERSION}"),
            "write the file again with `gripfast plan`",
        )),
    }
}

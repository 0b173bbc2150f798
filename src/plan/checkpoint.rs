//! The state of an unfinished run in a file, from which a later run resumes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use flate2::Crc;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::Collector;
use crate::error::{Error, ErrorKind, Result};
use crate::gripper::Gripper;
use crate::part::{MassProperties, Part};
use crate::propose::{Progress, ProposeOptions};
use crate::results::LoadCase;

/// Marks the file of an unfinished run.
const FORMAT: &str = "gripfast-unfinished";
/// Version of the layout of [`Checkpoint`].
const VERSION: u32 = 3;

/// All that a run has found after some chunk, and what it was asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint<'a> {
    format: Cow<'a, str>,
    version: u32,
    /// What decides the answer, by name: [`inputs`].
    pub inputs: Cow<'a, BTreeMap<String, Value>>,
    /// Where the seeds were computed: the only thing that may change on the way.
    pub backend: Cow<'a, str>,
    /// Where the next chunk starts.
    pub progress: Cow<'a, Progress>,
    /// The best grips so far, and the counts.
    pub collector: Cow<'a, Collector>,
}

impl<'a> Checkpoint<'a> {
    /// The state of a run, borrowed.
    pub fn new(
        inputs: &'a BTreeMap<String, Value>,
        backend: &'a str,
        progress: &'a Progress,
        collector: &'a Collector,
    ) -> Self {
        Self {
            format: FORMAT.into(),
            version: VERSION,
            inputs: Cow::Borrowed(inputs),
            backend: backend.into(),
            progress: Cow::Borrowed(progress),
            collector: Cow::Borrowed(collector),
        }
    }

    /// The state as the content of a file.
    ///
    /// # Errors
    /// When it cannot be put in JSON.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let mut bytes = serde_json::to_vec(self).map_err(|error| {
            Error::io(Path::new("state"), "write", std::io::Error::other(error))
        })?;
        let sum = checksum(&bytes);
        bytes.push(b'\n');
        bytes.extend_from_slice(sum.as_bytes());
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// Writes the state, whole or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let state = self.to_bytes()?;
        crate::file::write(path, |writer| writer.write_all(&state))
    }

    /// Reads a state and makes sure that it answers the question that is asked now.
    ///
    /// # Errors
    /// When the file cannot be read or is no state of this version, or the inputs differ; the
    /// message names those that do.
    pub fn read(path: &Path, inputs: &BTreeMap<String, Value>) -> Result<Checkpoint<'static>> {
        Self::parse(&path.display().to_string(), &crate::file::read(path)?, inputs)
    }

    /// As [`Checkpoint::read`], from the content of the file that `place` names.
    ///
    /// # Errors
    /// As [`Checkpoint::read`].
    pub fn parse(
        place: &str,
        bytes: &[u8],
        inputs: &BTreeMap<String, Value>,
    ) -> Result<Checkpoint<'static>> {
        let remedy = "start from the beginning, without resuming";
        let wrong =
            |problem: String| Error::format(place, problem, remedy).with_options(&["resume"]);
        #[derive(Deserialize)]
        struct Marks {
            format: String,
            version: u32,
        }
        // The state on the first line, its checksum on the second.
        let mut lines = bytes.splitn(2, |&byte| byte == b'\n');
        let (state, sum) = (lines.next().unwrap_or_default(), lines.next());
        let marks: Marks = serde_json::from_slice(state)
            .map_err(|error| wrong(format!("is no unfinished run: {error}")))?;
        if (marks.format.as_str(), marks.version) != (FORMAT, VERSION) {
            return Err(wrong(format!(
                "is '{}', version {}, not an unfinished run of version {VERSION}",
                marks.format, marks.version
            )));
        }
        let sum = sum.and_then(|line| std::str::from_utf8(line).ok()).map(str::trim);
        if sum != Some(checksum(state).as_str()) {
            return Err(wrong("was changed or cut off: its checksum is another".to_owned()));
        }
        let read: Checkpoint<'static> = serde_json::from_slice(state)
            .map_err(|error| wrong(format!("cannot be read: {error}")))?;
        let differences = differences(&read.inputs, inputs);
        if differences.is_empty() {
            return Ok(read);
        }
        let problem =
            format!("belongs to another question; these differ: {}", differences.join("; "));
        Err(Error::new(
            ErrorKind::Mismatch,
            place,
            problem,
            "resume with the options of the unfinished run, or start from the beginning",
        )
        .with_options(&["resume"]))
    }
}

/// Checksum of a state: an edit or a torn copy is found by it.
fn checksum(state: &[u8]) -> String {
    let mut sum = Crc::new();
    sum.update(state);
    format!("checksum {:08x} of {} bytes", sum.sum(), state.len())
}

/// Everything that decides which grips are found and how they are ranked, by name. `settings` are
/// those that no other argument holds. Mesh and loads stand as checksums.
pub fn inputs(
    part: &Part,
    mass: &MassProperties,
    gripper: &Gripper,
    loads: &[LoadCase],
    options: &ProposeOptions,
    settings: BTreeMap<String, Value>,
) -> BTreeMap<String, Value> {
    let mut all = settings;
    if let Ok(Value::Object(options)) = serde_json::to_value(options) {
        all.extend(options);
    }
    let mut mesh = Crc::new();
    mesh.update(bytemuck::cast_slice(&part.mesh.vertices));
    mesh.update(bytemuck::cast_slice(&part.mesh.triangles));
    let mut cases = Crc::new();
    for load in loads {
        cases.update(load.name.as_bytes());
        cases.update(bytemuck::cast_slice(&[load.wrench.force, load.wrench.moment]));
    }
    all.extend([
        ("gripfast version".to_owned(), env!("CARGO_PKG_VERSION").into()),
        (
            "part".to_owned(),
            json!(format!("{} triangles, checksum {:08x}", part.mesh.triangles.len(), mesh.sum())),
        ),
        ("mass".to_owned(), json!(mass)),
        ("gripper".to_owned(), json!(gripper)),
        ("loads".to_owned(), json!(format!("{} cases, checksum {:08x}", loads.len(), cases.sum()))),
    ]);
    all
}

/// The names of what differs, with both values where they are short.
fn differences(there: &BTreeMap<String, Value>, here: &BTreeMap<String, Value>) -> Vec<String> {
    let names: std::collections::BTreeSet<&String> = there.keys().chain(here.keys()).collect();
    let differs = names.into_iter().filter(|name| there.get(*name) != here.get(*name));
    let text = |value: Option<&Value>| {
        value.map_or("nothing".to_owned(), |value| {
            value.as_str().map_or_else(|| value.to_string(), str::to_owned)
        })
    };
    let describe = |name: &String| {
        let (there, here) = (text(there.get(name)), text(here.get(name)));
        if there.len().max(here.len()) > 60 {
            name.clone()
        } else {
            format!("{name} ({there} there, {here} here)")
        }
    };
    differs.map(describe).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_is_named() {
        let map = |values: &[(&str, Value)]| {
            values
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value.clone()))
                .collect::<BTreeMap<_, _>>()
        };
        let there = map(&[
            ("k1", json!(1.0)),
            ("part", json!("12 triangles")),
            ("old", json!(null)),
            ("gripper", json!("x".repeat(100))),
        ]);
        let here = map(&[
            ("k1", json!(2.0)),
            ("part", json!("12 triangles")),
            ("new", json!(true)),
            ("gripper", json!("y")),
        ]);
        assert!(differences(&there, &there).is_empty());
        assert_eq!(
            differences(&there, &here),
            [
                "gripper",
                "k1 (1.0 there, 2.0 here)",
                "new (nothing there, true here)",
                "old (null there, nothing here)"
            ]
        );
    }
}

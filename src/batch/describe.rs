//! Which jobs there are: parts x grippers x load sets.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::TOP;
use crate::error::{Error, ErrorKind, Result};
use crate::part;
use crate::request::Request;

/// One of the parts, grippers or load sets: the fields of a request that it sets, over those that
/// all jobs share.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Name in results and messages.
    pub name: String,
    /// Fields of [`Request`], as in a request file.
    pub fields: Table,
}

impl Variant {
    /// A variant that sets one field.
    pub fn new(name: impl Into<String>, field: &str, value: impl Into<Value>) -> Self {
        let fields = Table::from_iter([(field.to_owned(), value.into())]);
        Self { name: name.into(), fields }
    }
}

/// What a batch is made of.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Batch {
    /// The options that all jobs share; its part and gripper do not count.
    pub request: Request,
    /// The parts, in the order of their jobs.
    pub parts: Vec<Variant>,
    /// The grippers.
    pub grippers: Vec<Variant>,
    /// The load sets; none: the loads of the shared request.
    pub loads: Vec<Variant>,
    /// Grips kept of each job; absent: what the shared request shows where that is not its default,
    /// else [`TOP`].
    pub top: Option<usize>,
}

/// One part with one gripper under one load set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Job {
    /// Its number, from 0: all jobs of a gripper follow each other, part by part.
    pub number: usize,
    /// Name of the part.
    pub part: String,
    /// Name of the gripper.
    pub gripper: String,
    /// Name of the load set.
    pub loads: String,
    /// What to plan.
    pub request: Request,
}

impl Job {
    /// Part, gripper and load set in one text.
    pub fn id(&self) -> String {
        format!("{} / {} / {}", self.part, self.gripper, self.loads)
    }
}

/// The file of a batch as it is written.
#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[derive(Default)]
struct Written {
    parts: Vec<PathBuf>,
    grippers: Vec<String>,
    request: Table,
    part: Vec<Table>,
    gripper: Vec<Table>,
    loads: Vec<Table>,
    top: Option<usize>,
}

impl Batch {
    /// Reads the file of a batch. Paths in it are relative to the working folder, as in a request.
    ///
    /// # Errors
    /// When it cannot be read or says what no batch can be, naming line or entry.
    pub fn read(path: &Path) -> Result<Self> {
        let text = crate::file::read_text(path)?;
        Self::from_toml(&path.display().to_string(), &text)
    }

    /// Parses the file of a batch; `place` is the file for messages.
    ///
    /// # Errors
    /// As [`Batch::read`].
    pub fn from_toml(place: &str, text: &str) -> Result<Self> {
        let written = toml::from_str(text).map_err(|error| {
            let line = error
                .span()
                .map(|span| 1 + text[..span.start.min(text.len())].matches('\n').count());
            let place = line.map_or(place.to_owned(), |line| format!("{place}:{line}"));
            wrong(place, error.message().to_owned())
        })?;
        Self::written(place, written)
    }

    /// As [`Batch::from_toml`], from JSON with the same members.
    ///
    /// # Errors
    /// As [`Batch::read`].
    pub fn from_json(place: &str, text: &str) -> Result<Self> {
        let written = serde_json::from_str(text)
            .map_err(|error| wrong(place.to_owned(), error.to_string()))?;
        Self::written(place, written)
    }

    fn written(place: &str, written: Written) -> Result<Self> {
        let mut batch =
            Self { request: request(written.request, place)?, top: written.top, ..Self::default() };
        batch.add_parts(&written.parts)?;
        batch.grippers = written.grippers.iter().map(|name| gripper(name)).collect();
        let entries = [
            ("part", written.part, &mut batch.parts),
            ("gripper", written.gripper, &mut batch.grippers),
        ];
        for (field, tables, variants) in entries {
            for (index, mut fields) in tables.into_iter().enumerate() {
                let at = format!("{place}, {field} {}", index + 1);
                let Some(Value::String(value)) = fields.get(field).cloned() else {
                    return Err(wrong(at, format!("'{field}' is missing")));
                };
                let own = if field == "part" { file_name(Path::new(&value)) } else { stem(&value) };
                let name = take_name(&mut fields, &at)?.unwrap_or(own);
                variants.push(Variant { name, fields });
            }
        }
        for (index, mut fields) in written.loads.into_iter().enumerate() {
            let at = format!("{place}, loads {}", index + 1);
            let name = take_name(&mut fields, &at)?;
            let name = match name {
                Some(name) => name,
                None => load_name(&overlay(&batch.request, &[&fields], &at)?),
            };
            batch.loads.push(Variant { name, fields });
        }
        Ok(batch)
    }

    /// Adds part files, and those in folders and the folders below, in the order of their names. A
    /// part of a folder is named by its way from there, any other by its file.
    ///
    /// # Errors
    /// When a folder cannot be read or holds no part, or a file is not there.
    pub fn add_parts(&mut self, paths: &[PathBuf]) -> Result<()> {
        for path in paths {
            let meta = std::fs::metadata(path).map_err(|error| Error::io(path, "read", error))?;
            if !meta.is_dir() {
                self.parts.push(part_variant(file_name(path), path)?);
                continue;
            }
            let mut files = Vec::new();
            walk(path, &mut files)?;
            if files.is_empty() {
                return Err(Error::new(
                    ErrorKind::NotFound,
                    path.display().to_string(),
                    "there is no part file in this folder",
                    format!("the endings of parts are {}", part::KNOWN_SUFFIXES),
                ));
            }
            for file in files {
                let below = file.strip_prefix(path).unwrap_or(&file);
                let name = below.iter().map(|step| step.to_string_lossy());
                let name = name.collect::<Vec<_>>().join("/");
                self.parts.push(part_variant(name, &file)?);
            }
        }
        Ok(())
    }

    /// Adds grippers of the catalogue or gripper files.
    pub fn add_grippers(&mut self, names: &[String]) {
        self.grippers.extend(names.iter().map(|name| gripper(name)));
    }

    /// Adds load sets, each a text of sources as in [`Request::loads`].
    pub fn add_loads(&mut self, sets: &[String]) {
        let variant = |set: &String| {
            let list = set.split(',').map(|source| Value::from(source.trim())).collect();
            Variant::new(set.clone(), "loads", Value::Array(list))
        };
        self.loads.extend(sets.iter().map(variant));
    }

    /// All jobs, in the order of their numbers.
    ///
    /// # Errors
    /// When there is no part or gripper, two of a kind have the same name, or the fields of an entry
    /// are not those of a request.
    pub fn jobs(&self) -> Result<Vec<Job>> {
        let mut base = self.request.clone();
        base.output = crate::request::Output::default();
        let shown = base.selection.top;
        let few = shown == Request::default().selection.top;
        base.selection.top = self.top.unwrap_or(if few { TOP } else { shown });
        // Rows name their family instead.
        base.selection.every_turn = true;
        // Those beyond need no more work than it takes to see that.
        if !base.selection.diverse && !base.selection.merge_symmetric {
            base.selection.keep.get_or_insert(base.selection.top);
        }
        let own = [Variant { name: load_name(&base), fields: Table::new() }];
        let loads = if self.loads.is_empty() { &own[..] } else { &self.loads };
        let parts = distinct(&self.parts, "part")?;
        let grippers = distinct(&self.grippers, "gripper")?;
        let load_names = distinct(loads, "loads")?;
        let mut jobs = Vec::with_capacity(parts.len() * grippers.len() * loads.len());
        for (gripper, gripper_name) in self.grippers.iter().zip(&grippers) {
            for (part, part_name) in self.parts.iter().zip(&parts) {
                for (load, load_name) in loads.iter().zip(&load_names) {
                    let mut job = Job {
                        number: jobs.len(),
                        part: part_name.clone(),
                        gripper: gripper_name.clone(),
                        loads: load_name.clone(),
                        request: Request::default(),
                    };
                    let layers = [&part.fields, &gripper.fields, &load.fields];
                    job.request = overlay(&base, &layers, &job.id())?;
                    job.request.check()?;
                    jobs.push(job);
                }
            }
        }
        Ok(jobs)
    }
}

fn wrong(place: String, problem: String) -> Error {
    let remedy = "a batch has the lists parts and grippers, the table request, and the tables part, \
                  gripper and loads, one for each";
    Error::format(place, format!("not a batch: {problem}"), remedy)
}

/// The names of variants, or why they cannot be told apart.
fn distinct(variants: &[Variant], what: &str) -> Result<Vec<String>> {
    if variants.is_empty() {
        let remedy = if what == "part" { "name files or folders" } else { "name one or more" };
        return Err(Error::input(what, "there is none", remedy).with_options(&[]));
    }
    let mut counts = BTreeMap::<&str, usize>::new();
    variants.iter().for_each(|variant| *counts.entry(&variant.name).or_default() += 1);
    // Files of one name in several folders: by their whole paths.
    let name = |variant: &Variant| match variant.fields.get(what) {
        Some(Value::String(path)) if counts[variant.name.as_str()] > 1 => path.clone(),
        _ => variant.name.clone(),
    };
    let names: Vec<String> = variants.iter().map(name).collect();
    let mut seen = BTreeSet::new();
    match names.iter().find(|name| !seen.insert(name.as_str())) {
        None => Ok(names),
        Some(name) => Err(Error::input(
            format!("{what} '{name}'"),
            "is there twice",
            "leave one out, or give each a name of its own",
        )),
    }
}

/// The shared request with the fields of some variants over it.
fn overlay(base: &Request, layers: &[&Table], place: &str) -> Result<Request> {
    let wrong = |error: toml::ser::Error| Error::format(place, error.to_string(), "");
    let mut fields = Table::try_from(base).map_err(wrong)?;
    for layer in layers {
        // One takes the place of the other.
        for (given, other) in [("mass", "density"), ("density", "mass")] {
            if layer.contains_key(given) {
                fields.remove(other);
            }
        }
        merge(&mut fields, layer);
    }
    request(fields, place)
}

/// Sets the fields of `over`, those of its tables one by one.
fn merge(fields: &mut Table, over: &Table) {
    for (name, value) in over {
        match (fields.get_mut(name), value) {
            (Some(Value::Table(inner)), Value::Table(over)) => merge(inner, over),
            _ => drop(fields.insert(name.clone(), value.clone())),
        }
    }
}

fn request(fields: Table, place: &str) -> Result<Request> {
    fields.try_into().map_err(|error: toml::de::Error| {
        Error::format(
            place,
            format!("not the fields of a request: {}", error.message()),
            "a request written by the option print_request shows all of them",
        )
        .with_options(&["print_request"])
    })
}

fn take_name(fields: &mut Table, place: &str) -> Result<Option<String>> {
    match fields.remove("name") {
        None => Ok(None),
        Some(Value::String(name)) if !name.trim().is_empty() => Ok(Some(name)),
        Some(name) => {
            Err(Error::format(place, format!("the name {name} is no text"), "give a name"))
        }
    }
}

fn part_variant(name: String, path: &Path) -> Result<Variant> {
    let Some(text) = path.to_str() else {
        let problem = "the name of the file is no text in UTF-8";
        return Err(Error::input(path.display().to_string(), problem, "rename it"));
    };
    Ok(Variant::new(name, "part", text))
}

fn gripper(name: &str) -> Variant {
    Variant::new(stem(name), "gripper", name)
}

/// A gripper of the catalogue by its name, a gripper file by its own without the ending.
fn stem(name: &str) -> String {
    let path = Path::new(name);
    match path.extension() {
        Some(_) => path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        None => file_name(path),
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The loads of a request in words.
fn load_name(request: &Request) -> String {
    let mut name = request.loads.join(",");
    if let Some(accel) = request.accel {
        name += &format!(" accel {accel}");
    }
    name
}

/// Part files in a folder and the folders below, in the order of their names; hidden ones not.
fn walk(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |error| Error::io(folder, "read", error);
    let mut entries: Vec<_> = std::fs::read_dir(folder)
        .and_then(Iterator::collect::<std::io::Result<_>>)
        .map_err(failed)?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        // A link to a folder could lead back here.
        if entry.file_type().map_err(failed)?.is_dir() {
            walk(&path, files)?;
        } else if part::is_part(&path) && path.is_file() {
            files.push(path);
        }
    }
    Ok(())
}

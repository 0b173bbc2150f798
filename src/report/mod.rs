//! The page that people look at: one HTML file with the part, the grips and a viewer, which loads
//! nothing from anywhere.
//!
//! The viewer's sources are in `viewer/`; `page.html` beside this file is built from them and
//! committed, so that building this crate needs no Node. A test proves that it is current.

pub mod contact_svg;

mod areas;
mod decimate;
mod display;
mod obstacles;
mod payload;
mod states;

use std::io::Write;
use std::path::Path;

use crate::error::{Error, Result};
use crate::file;
use crate::model::Miss;
use crate::part::Mesh;
use crate::results::GripSet;
use payload::Payload;

/// The page without data, as `viewer/build.mjs` wrote it.
pub const TEMPLATE: &str = include_str!("page.html");
/// Stands in [`TEMPLATE`] for the header.
const HEADER_MARK: &str = "@@gripfast-header@@";
/// Stands in [`TEMPLATE`] for the columns.
const DATA_MARK: &str = "@@gripfast-data@@";

/// The page for `set`. Without a mesh the part is drawn as its bounding box, and the page says so.
/// `misses` are rejected candidates to show ([`crate::plan::near_misses`]); there may be none.
///
/// # Errors
/// A mismatch when `set` contradicts itself (a grip under a load that is not listed).
pub fn render(set: &GripSet, mesh: Option<&Mesh>, misses: &[Miss]) -> Result<String> {
    let payload = Payload::new(set, mesh, misses)?;
    let damaged = || {
        Error::input(
            "report",
            "the page template of this build is damaged",
            "rebuild it: see viewer/README.md",
        )
    };
    let (before, rest) = TEMPLATE.split_once(HEADER_MARK).ok_or_else(damaged)?;
    let (between, after) = rest.split_once(DATA_MARK).ok_or_else(damaged)?;
    Ok([before, &payload.header, between, &payload.data, after].concat())
}

/// Writes the page of [`render`] to `path`: whole or not at all.
///
/// # Errors
/// As [`render`]; a file error when the file cannot be written.
pub fn write(set: &GripSet, mesh: Option<&Mesh>, misses: &[Miss], path: &Path) -> Result<()> {
    let page = render(set, mesh, misses)?;
    file::write(path, |writer| writer.write_all(page.as_bytes()))
}

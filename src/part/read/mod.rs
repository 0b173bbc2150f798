//! Mesh files: the format is chosen by the suffix, the bytes are checked against it.

mod gltf;
mod obj;
mod off;
mod ply;
mod polygon;
#[cfg(feature = "step")]
mod step;
mod stl;
mod threemf;

use std::cell::Cell;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::rc::Rc;

use glam::{DAffine3, DVec3};

use super::ReadOptions;
use super::weld::{MAX_TRIANGLES, Soup, Welder};
use crate::error::{Error, ErrorKind, Result};
use crate::file::guarded;
use crate::memory::Budget;

#[cfg(feature = "step")]
pub use step::{StepProcess, serve_step};

/// Suffixes that are read, for messages.
pub(crate) const KNOWN: &str = if cfg!(feature = "step") {
    "stl, obj, ply, off, 3mf, gltf, glb, step (each also as .gz)"
} else {
    "stl, obj, ply, off, 3mf, gltf, glb (each also as .gz)"
};

/// Whether a file's name says that it is a part: one that some build of this library reads.
pub(crate) fn is_part(path: &Path) -> bool {
    let known = ["stl", "obj", "ply", "off", "3mf", "gltf", "glb", "step", "stp"];
    known.contains(&suffix(path).0.as_str())
}

/// Reads the triangles of `path` in the file's own unit.
///
/// # Errors
/// As [`super::Part::read`].
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Soup> {
    let place = path.display().to_string();
    let (suffix, zipped) = suffix(path);
    let step = matches!(suffix.as_str(), "step" | "stp");
    if matches!(suffix.as_str(), "iges" | "igs" | "brep") {
        let remedy = if cfg!(feature = "step") {
            "export STEP or a mesh (STL, 3MF) from the CAD system: this build reads both"
        } else {
            "export a mesh (STL, 3MF) from the CAD system"
        };
        let problem = format!("'.{suffix}' holds exact surfaces in a format that is not read");
        return Err(Error::new(ErrorKind::Unsupported, place, problem, remedy));
    }
    if step && !cfg!(feature = "step") {
        return Err(Error::new(
            ErrorKind::Unsupported,
            place,
            format!(
                "'.{suffix}' holds exact surfaces, not triangles; this build has no CAD kernel to tessellate them"
            ),
            "convert it first, for example with the PyPI package cascadio: \
             python3 -c \"import cascadio; cascadio.step_to_glb('part.step', 'part.glb', tol_linear=0.01)\", or export STL from the CAD system, \
             or build gripfast with the feature `step` (needs Open CASCADE: Debian's libocct-data-exchange-dev)",
        ));
    }
    // Asked before it is opened: opening a pipe waits for its writer.
    let meta = std::fs::metadata(path).map_err(|source| Error::io(path, "read", source))?;
    if !meta.is_file() {
        let what = if meta.is_dir() { "a folder" } else { "a device, pipe or socket, not a file" };
        return Err(Error::format(place, format!("is {what}"), "name a mesh file"));
    }
    let file = File::open(path).map_err(|source| Error::io(path, "read", source))?;
    let size = (!zipped).then_some(meta.len());
    let budget = Budget::new(options.max_memory);
    budget.room(&place, meta.len())?;
    let reader: Box<dyn Read> = if zipped {
        Box::new(flate2::read::MultiGzDecoder::new(BufReader::new(file)))
    } else {
        Box::new(file)
    };
    let passed = Rc::new(Cell::new(false));
    let reader = Limited { inner: reader, left: budget.limit(), passed: Rc::clone(&passed) };
    let mut source = Source {
        place: place.clone(),
        path,
        size,
        reader: BufReader::with_capacity(1 << 18, reader),
        budget,
        options,
    };
    let soup = guarded(&place, || read_as(&suffix, &mut source));
    // Some libraries do not pass on why a stream failed.
    if passed.get() {
        return Err(source.budget.exceeded(&place, source.budget.limit()));
    }
    let soup = soup?;
    if soup.read == 0 {
        return Err(Error::new(
            ErrorKind::Geometry,
            place,
            "holds no triangle",
            "export the part as a surface mesh",
        ));
    }
    Ok(soup)
}

/// Reads the format that `suffix` names.
fn read_as(suffix: &str, source: &mut Source<'_>) -> Result<Soup> {
    if source.peek()?.is_empty() {
        return Err(source.bad("the file is empty", "export the part again"));
    }
    match suffix {
        "stl" => stl::read(source),
        "obj" => obj::read(source),
        "ply" => ply::read(source),
        "off" => off::read(source),
        "3mf" => threemf::read(source),
        "gltf" | "glb" => gltf::read(source),
        #[cfg(feature = "step")]
        "step" | "stp" => step::read(source),
        "" => Err(source
            .bad(
                "the file name has no suffix to tell its format",
                &format!("name it with one of: {KNOWN}"),
            )
            .with_kind(ErrorKind::Unsupported)),
        _ => Err(source
            .bad(
                format!("unknown mesh format '.{suffix}'"),
                &format!("convert it to one of: {KNOWN}"),
            )
            .with_kind(ErrorKind::Unsupported)),
    }
}

/// A stream that fails when it holds more than it may: a small compressed file can stand for a
/// huge one.
struct Limited<R> {
    inner: R,
    left: u64,
    /// Set when it held more.
    passed: Rc<Cell<bool>>,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.left == 0 && !buffer.is_empty() {
            if self.inner.read(&mut [0])? == 0 {
                return Ok(0);
            }
            self.passed.set(true);
            return Err(std::io::Error::other("holds more than the memory allowed"));
        }
        let most = buffer.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
        let count = self.inner.read(&mut buffer[..most])?;
        self.left -= count as u64;
        Ok(count)
    }
}

/// File name without folder, `.gz` and format suffix.
pub(super) fn stem(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let lower = name.to_ascii_lowercase();
    let cut = lower
        .strip_suffix(".gz")
        .unwrap_or(&lower)
        .rfind('.')
        .filter(|&dot| dot > 0)
        .unwrap_or(name.len());
    name[..cut].to_string()
}

/// Format suffix in lower case, and whether `.gz` follows it.
fn suffix(path: &Path) -> (String, bool) {
    let name = path
        .file_name()
        .map(|name| name.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let (name, zipped) =
        name.strip_suffix(".gz").map_or((name.as_str(), false), |inner| (inner, true));
    (name.rsplit_once('.').map_or(String::new(), |(_, suffix)| suffix.to_string()), zipped)
}

/// An opened file with what is known about it.
struct Source<'a> {
    /// File name for messages.
    place: String,
    path: &'a Path,
    /// Bytes in all, unknown for a compressed file.
    size: Option<u64>,
    reader: BufReader<Limited<Box<dyn Read>>>,
    /// Memory that the triangles and what is kept beside them may take.
    budget: Budget,
    options: &'a ReadOptions,
}

/// Memory that a triangle takes until the part is made \[bytes\]: 140 measured at the peak with a
/// million of them, and a margin.
const TRIANGLE_BYTES: u64 = 256;
/// Longest line of a text format \[bytes\].
const LONGEST_LINE: u64 = 1 << 24;

impl Source<'_> {
    /// The bytes at hand without consuming them; empty at the end of the file.
    fn peek(&mut self) -> Result<&[u8]> {
        if let Err(fault) = self.reader.fill_buf() {
            return Err(self.fault(fault));
        }
        Ok(self.reader.buffer())
    }

    /// The whole file.
    fn bytes(&mut self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.reader.read_to_end(&mut bytes).map_err(|fault| self.fault(fault))?;
        self.hold(bytes.len() as u64)?;
        Ok(bytes)
    }

    /// The next line with its end into `line`; false at the end of the file. `number` is the
    /// line's, for the message.
    fn line(&mut self, line: &mut Vec<u8>, number: usize) -> Result<bool> {
        line.clear();
        let outcome = (&mut self.reader).take(LONGEST_LINE).read_until(b'\n', line);
        outcome.map_err(|fault| self.fault(fault))?;
        if line.len() as u64 == LONGEST_LINE {
            return Err(self
                .bad_at(
                    format!("line {number}"),
                    format!("is longer than {} MiB", LONGEST_LINE >> 20),
                    "export or copy the file again",
                )
                .with_kind(ErrorKind::Limit));
        }
        Ok(!line.is_empty())
    }

    /// Takes memory that is kept until the part is made.
    fn hold(&self, bytes: u64) -> Result<()> {
        self.budget.hold(&self.place, bytes)
    }

    /// Checks that `count` triangles fit.
    fn room_for(&self, count: u64) -> Result<()> {
        self.budget.room(&self.place, count.saturating_mul(TRIANGLE_BYTES))
    }

    /// A damaged or unreadable stream: a decompression fault is bad input, anything else the
    /// system's.
    fn fault(&self, source: std::io::Error) -> Error {
        use std::io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
        match source.kind() {
            InvalidData | InvalidInput | UnexpectedEof => {
                self.bad(format!("the data are damaged: {source}"), "export or copy the file again")
            }
            _ => Error::io(self.path, "read", source),
        }
    }

    /// Bad input in this file as a whole.
    fn bad(&self, problem: impl Into<String>, remedy: &str) -> Error {
        Error::format(self.place.clone(), problem, remedy)
    }

    /// Bad input at `where_` (line, triangle, vertex) of this file.
    fn bad_at(
        &self,
        where_: impl std::fmt::Display,
        problem: impl Into<String>,
        remedy: &str,
    ) -> Error {
        Error::format(format!("{}, {where_}", self.place), problem, remedy)
    }

    /// Refuses more triangles than can be indexed or than fit.
    fn check_count(&self, welder: &Welder) -> Result<()> {
        if welder.count() > MAX_TRIANGLES {
            return Err(self
                .bad(format!("more than {MAX_TRIANGLES} triangles"), "decimate the mesh")
                .with_kind(ErrorKind::Limit));
        }
        self.room_for(welder.count() as u64)
    }

    /// Adds polygon `number` (from 1) of an indexed format, cut into triangles. Points and lines
    /// bound no material.
    fn polygon(
        &self,
        welder: &mut Welder,
        vertices: &[DVec3],
        corners: &[u32],
        number: usize,
    ) -> Result<()> {
        let corner = |index: u32| {
            vertices
                .get(index as usize)
                .copied()
                .ok_or_else(|| self.no_vertex(index, vertices.len(), number))
        };
        match *corners {
            [a, b, c] => welder.triangle([corner(a)?, corner(b)?, corner(c)?]),
            _ => {
                let points =
                    corners.iter().map(|&index| corner(index)).collect::<Result<Vec<DVec3>>>()?;
                polygon::triangulate(&points, |triangle| {
                    welder.triangle(triangle.map(|k| points[k]))
                });
            }
        }
        self.check_count(welder)
    }

    /// Adds triangle `number` (from 1) of an indexed mesh that is placed in the part.
    fn placed_triangle(
        &self,
        welder: &mut Welder,
        vertices: &[DVec3],
        corners: [u32; 3],
        place: DAffine3,
        number: usize,
    ) -> Result<()> {
        let mut points = [DVec3::ZERO; 3];
        for (point, index) in points.iter_mut().zip(corners) {
            let vertex = *vertices
                .get(index as usize)
                .ok_or_else(|| self.no_vertex(index, vertices.len(), number))?;
            *point = self.finite(place.transform_point3(vertex), index as usize + 1)?;
        }
        welder.triangle(points);
        self.check_count(welder)
    }

    /// Face `number` refers to vertex `index`, which is not there.
    fn no_vertex(&self, index: u32, count: usize, number: usize) -> Error {
        self.bad_at(
            format!("face {number}"),
            format!("refers to vertex {index} (counted from 0), but there are {count}"),
            "repair the file or export it again",
        )
    }

    /// Checks that vertex `number` (from 1) is finite.
    fn finite(&self, position: DVec3, number: usize) -> Result<DVec3> {
        if position.is_finite() {
            Ok(position)
        } else {
            Err(self.bad_at(
                format!("vertex {number}"),
                format!("coordinates {position} are not finite"),
                "repair the file or export it again",
            ))
        }
    }
}

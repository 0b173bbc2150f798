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

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use glam::DVec3;

use super::weld::{MAX_TRIANGLES, Soup, Welder};
use crate::error::{Error, ErrorKind, Result};

/// Suffixes that are read, for messages.
const KNOWN: &str = if cfg!(feature = "step") {
    "stl, obj, ply, off, 3mf, gltf, glb, step (each also as .gz)"
} else {
    "stl, obj, ply, off, 3mf, gltf, glb (each also as .gz)"
};

/// Reads the triangles of `path` in the file's own unit.
///
/// # Errors
/// As [`super::Part::read`].
pub(super) fn read(path: &Path) -> Result<Soup> {
    let place = path.display().to_string();
    let (suffix, zipped) = suffix(path);
    let step = matches!(suffix.as_str(), "step" | "stp");
    if (step && !cfg!(feature = "step")) || matches!(suffix.as_str(), "iges" | "igs" | "brep") {
        let build = if step {
            ", or build gripfast with the feature `step` (needs Open CASCADE: Debian's libocct-data-exchange-dev)"
        } else {
            ""
        };
        return Err(Error::new(
            ErrorKind::Unsupported,
            place,
            format!(
                "'.{suffix}' holds exact surfaces, not triangles; this build has no CAD kernel to tessellate them"
            ),
            format!(
                "convert it first, for example with the PyPI package cascadio: \
                 python3 -c \"import cascadio; cascadio.step_to_glb('part.step', 'part.glb', tol_linear=0.01)\", or export STL from the CAD system{build}"
            ),
        ));
    }
    let file = File::open(path).map_err(|source| Error::io(path, "read", source))?;
    let meta = file.metadata().map_err(|source| Error::io(path, "read", source))?;
    if meta.is_dir() {
        return Err(Error::format(place, "is a folder", "name a mesh file"));
    }
    let size = (!zipped).then_some(meta.len());
    let reader: Box<dyn Read> = if zipped {
        Box::new(flate2::read::MultiGzDecoder::new(BufReader::new(file)))
    } else {
        Box::new(file)
    };
    let mut source =
        Source { place, path, size, reader: BufReader::with_capacity(1 << 18, reader) };
    if source.peek()?.is_empty() {
        return Err(Error::format(source.place, "the file is empty", "export the part again"));
    }
    let soup = match suffix.as_str() {
        "stl" => stl::read(&mut source)?,
        "obj" => obj::read(&mut source)?,
        "ply" => ply::read(&mut source)?,
        "off" => off::read(&mut source)?,
        "3mf" => threemf::read(&mut source)?,
        "gltf" | "glb" => gltf::read(&mut source)?,
        #[cfg(feature = "step")]
        "step" | "stp" => step::read(&mut source)?,
        "" => {
            return Err(Error::new(
                ErrorKind::Unsupported,
                source.place,
                "the file name has no suffix to tell its format",
                format!("name it with one of: {KNOWN}"),
            ));
        }
        _ => {
            return Err(Error::new(
                ErrorKind::Unsupported,
                source.place,
                format!("unknown mesh format '.{suffix}'"),
                format!("convert it to one of: {KNOWN}"),
            ));
        }
    };
    if soup.read == 0 {
        return Err(Error::new(
            ErrorKind::Geometry,
            source.place,
            "holds no triangle",
            "export the part as a surface mesh",
        ));
    }
    Ok(soup)
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
    reader: BufReader<Box<dyn Read>>,
}

impl Source<'_> {
    /// The bytes at hand without consuming them; empty at the end of the file.
    fn peek(&mut self) -> Result<&[u8]> {
        if let Err(fault) = self.reader.fill_buf() {
            return Err(self.fault(fault));
        }
        Ok(self.reader.buffer())
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

    /// Refuses more triangles than can be indexed.
    fn check_count(&self, welder: &Welder) -> Result<()> {
        if welder.count() > MAX_TRIANGLES {
            return Err(self
                .bad(format!("more than {MAX_TRIANGLES} triangles"), "decimate the mesh")
                .with_kind(ErrorKind::Limit));
        }
        Ok(())
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
            vertices.get(index as usize).copied().ok_or_else(|| {
                let problem = format!(
                    "refers to vertex {index} (counted from 0), but there are {}",
                    vertices.len()
                );
                self.bad_at(format!("face {number}"), problem, "repair the file or export it again")
            })
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

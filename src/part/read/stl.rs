//! STL: binary records by `stl_io`; the text form here, because the library stops at the first
//! `endsolid`, refuses upper case and cannot say the line of a fault.

use std::io::{BufRead, Read, Seek, SeekFrom};

use glam::DVec3;

use super::Source;
use crate::error::{ErrorKind, Result};
use crate::part::weld::{Soup, Welder};

/// Bytes before the first record of the binary form: a free header and the count.
const HEADER: usize = 84;
/// Bytes of a record: normal, three corners, attribute.
const RECORD: u64 = 50;

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let size = source.size;
    let start = source.peek()?;
    let start = &start[..start.len().min(1024)];
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let is_solid = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // Binary files from some systems begin with `solid` too, but text has no control bytes, and the
    // size tells exactly.
    let is_text = !start.iter().any(|&byte| byte < 9 || (14..32).contains(&byte));
    let exact = start.len() >= HEADER
        && size == Some(HEADER as u64 + RECORD * u64::from(stated_count(start)));
    if is_solid && is_text && !exact {
        ascii(source)
    } else if is_text && !exact {
        Err(source.bad(
            "is a text file, but does not begin with 'solid': not an STL file",
            "export the part as STL again",
        ))
    } else {
        binary(source)
    }
}

fn stated_count(start: &[u8]) -> u32 {
    start
        .get(80..84)
        .map_or(0, |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}

fn binary(source: &mut Source<'_>) -> Result<Soup> {
    let start = source.peek()?;
    if start.len() < HEADER {
        let length = start.len();
        return Err(source.bad(
            format!("{length} bytes are no STL file (a binary one has at least {HEADER})"),
            "export the part again",
        ));
    }
    let count = stated_count(start);
    let mut warnings = Vec::new();
    if let Some(size) = source.size {
        let held = (size - HEADER as u64) / RECORD;
        let remedy =
            "the export or the copy was cut short, or the file is no STL: export the part again";
        if held < u64::from(count) {
            return Err(source.bad(
                format!(
                    "states {count} triangles but ends within triangle {} (byte {size})",
                    held + 1
                ),
                remedy,
            ));
        }
        if count == 0 && held > 0 {
            return Err(source.bad(format!("states 0 triangles but holds data for {held}"), remedy));
        }
        let rest = size - HEADER as u64 - RECORD * u64::from(count);
        if rest > 0 {
            warnings.push(format!("{rest} bytes after the last stated triangle were ignored"));
        }
    }
    source.room_for(u64::from(count))?;
    let mut welder = Welder::default();
    let fault = {
        let mut records = Rewind::new(&mut source.reader);
        // The count is only a claim: nothing is reserved for it, the records are streamed.
        match stl_io::create_stl_reader(&mut records) {
            Err(fault) => Some(Fault::Read(fault)),
            Ok(mut triangles) => loop {
                match triangles.next() {
                    None => break None,
                    Some(Err(fault)) => break Some(Fault::Read(fault)),
                    Some(Ok(triangle)) => {
                        let corners = triangle.vertices.map(|vertex| {
                            DVec3::new(
                                f64::from(vertex.0[0]),
                                f64::from(vertex.0[1]),
                                f64::from(vertex.0[2]),
                            )
                        });
                        if let Some(&corner) = corners.iter().find(|corner| !corner.is_finite()) {
                            break Some(Fault::NotFinite(corner));
                        }
                        if welder.count() >= crate::part::weld::MAX_TRIANGLES {
                            break Some(Fault::TooMany);
                        }
                        welder.triangle(corners);
                    }
                }
            },
        }
    };
    let triangle = welder.count() + 1;
    match fault {
        None => Ok(welder.finish(None, warnings)),
        Some(Fault::NotFinite(corner)) => {
            let byte = HEADER as u64 + RECORD * (triangle as u64 - 1);
            Err(source.bad_at(
                format!("triangle {triangle} (byte {byte})"),
                format!("corner {corner} is not finite"),
                "repair the mesh or export it again",
            ))
        }
        Some(Fault::TooMany) => Err(source
            .bad(format!("more than {} triangles", triangle - 1), "decimate the mesh")
            .with_kind(ErrorKind::Limit)),
        Some(Fault::Read(fault)) if fault.kind() == std::io::ErrorKind::UnexpectedEof => {
            Err(source.bad(
                format!("states {count} triangles but ends within triangle {triangle}"),
                "export or copy the file again",
            ))
        }
        Some(Fault::Read(fault)) => Err(source.fault(fault)),
    }
}

enum Fault {
    Read(std::io::Error),
    NotFinite(DVec3),
    TooMany,
}

/// Gives `stl_io` the stream with a line end as first header byte, so that it never takes a binary
/// file whose header begins with `solid` for text, and with the rewind that its look at the first
/// line needs.
struct Rewind<'a, R> {
    inner: &'a mut R,
    /// First bytes, kept for the rewind.
    head: [u8; HEADER],
    /// Valid bytes of `head`, and how many of them were handed out.
    filled: usize,
    position: usize,
}

impl<'a, R: BufRead> Rewind<'a, R> {
    fn new(inner: &'a mut R) -> Self {
        Self { inner, head: [0; HEADER], filled: 0, position: 0 }
    }
}

impl<R: BufRead> Read for Rewind<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.filled == 0 {
            while self.filled < HEADER {
                match self.inner.read(&mut self.head[self.filled..])? {
                    0 => break,
                    count => self.filled += count,
                }
            }
            self.head[0] = b'\n';
        }
        if self.position < self.filled {
            let count = buffer.len().min(self.filled - self.position);
            buffer[..count].copy_from_slice(&self.head[self.position..self.position + count]);
            self.position += count;
            return Ok(count);
        }
        self.inner.read(buffer)
    }
}

impl<R> Seek for Rewind<'_, R> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        match to {
            SeekFrom::Start(0) if self.position <= HEADER => {
                self.position = 0;
                Ok(0)
            }
            _ => Err(std::io::ErrorKind::Unsupported.into()),
        }
    }
}

/// The text form: any number of solids, any case, LF or CRLF; normals are not used.
fn ascii(source: &mut Source<'_>) -> Result<Soup> {
    const REMEDY: &str = "repair the line or export the part again";
    let mut welder = Welder::default();
    let mut line = Vec::with_capacity(128);
    let mut corners = [DVec3::ZERO; 3];
    let mut filled = None; // corners seen in the open loop
    let mut number = 0_usize;
    loop {
        if !source.line(&mut line, number + 1)? {
            break;
        }
        number += 1;
        let place = || format!("line {number}");
        let text = String::from_utf8_lossy(&line);
        let mut words = text.trim_start_matches('\u{feff}').split_ascii_whitespace();
        let Some(keyword) = words.next() else { continue };
        match keyword.to_ascii_lowercase().as_str() {
            "vertex" => {
                let mut values = [0.0; 3];
                for value in &mut values {
                    let word = words.next().ok_or_else(|| {
                        source.bad_at(place(), "a vertex needs three numbers", REMEDY)
                    })?;
                    *value = number_of(word).ok_or_else(|| {
                        source.bad_at(
                            place(),
                            format!("'{}' is not a number", shorten(word)),
                            REMEDY,
                        )
                    })?;
                    if !value.is_finite() {
                        return Err(source.bad_at(
                            place(),
                            format!("coordinate '{}' is not finite", shorten(word)),
                            REMEDY,
                        ));
                    }
                }
                if words.next().is_some() {
                    return Err(source.bad_at(
                        place(),
                        "a vertex of more than three numbers",
                        REMEDY,
                    ));
                }
                let count: &mut usize = filled.as_mut().ok_or_else(|| {
                    source.bad_at(place(), "'vertex' outside of 'outer loop'", REMEDY)
                })?;
                *corners.get_mut(*count).ok_or_else(|| {
                    source.bad_at(place(), "more than three vertices in a facet", REMEDY)
                })? = DVec3::from_array(values);
                *count += 1;
            }
            "outer" => filled = Some(0),
            "endloop" => {
                if filled.take() != Some(3) {
                    return Err(source.bad_at(
                        place(),
                        "a facet with fewer than three vertices",
                        REMEDY,
                    ));
                }
                source.check_count(&welder)?;
                welder.triangle(corners);
            }
            "solid" | "facet" | "endfacet" | "endsolid" | "color" => {}
            _ => {
                return Err(source.bad_at(
                    place(),
                    format!("'{}' is no word of the STL format", shorten(keyword)),
                    REMEDY,
                ));
            }
        }
    }
    if filled.is_some() {
        return Err(source.bad_at(
            format!("line {number}"),
            "the file ends within a facet",
            "the file was cut short: export or copy it again",
        ));
    }
    Ok(welder.finish(None, Vec::new()))
}

/// A coordinate. Nine significant digits or fewer are a 32-bit value as writers print it: it is
/// rounded back, so that the text and the binary form of a mesh are the same mesh.
fn number_of(word: &str) -> Option<f64> {
    let value: f64 = word.parse().ok()?;
    let mantissa = word.split(['e', 'E']).next().unwrap_or(word);
    let digits = mantissa
        .trim_start_matches(['+', '-', '0', '.'])
        .bytes()
        .filter(u8::is_ascii_digit)
        .count();
    Some(if digits <= 9 { f64::from(value as f32) } else { value })
}

/// The first characters of a word from the file, for a message.
fn shorten(word: &str) -> String {
    word.chars().take(24).collect()
}

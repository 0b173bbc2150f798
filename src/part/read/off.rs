//! OFF in its text form. The format is a dozen lines to read, and no maintained library reads it.

use glam::DVec3;

use super::Source;
use crate::error::Result;
use crate::part::weld::{Soup, Welder};

const REMEDY: &str = "repair the line or export the part again";

/// Lines without comments and blanks, with their numbers.
struct Lines<'a, 'b> {
    source: &'a mut Source<'b>,
    number: usize,
    /// The line as read, and without comment.
    bytes: Vec<u8>,
    line: String,
}

impl Lines<'_, '_> {
    /// The next line that says something; `what` is what was expected there.
    fn next(&mut self, what: &str) -> Result<&str> {
        loop {
            if !self.source.line(&mut self.bytes, self.number + 1)? {
                return Err(self.source.bad_at(
                    format!("line {}", self.number),
                    format!("the file ends where {what} should follow"),
                    "export or copy it again",
                ));
            }
            self.number += 1;
            self.line = String::from_utf8_lossy(&self.bytes)
                .split('#')
                .next()
                .unwrap_or_default()
                .trim()
                .to_string();
            if !self.line.is_empty() {
                return Ok(&self.line);
            }
        }
    }

    fn bad(&self, problem: String) -> crate::error::Error {
        self.source.bad_at(format!("line {}", self.number), problem, REMEDY)
    }

    /// The first `count` numbers of the current line.
    fn numbers<T: std::str::FromStr>(&self, count: usize) -> Result<Vec<T>> {
        let words = self.line.split_ascii_whitespace();
        let numbers: Vec<T> = words.take(count).map_while(|word| word.parse().ok()).collect();
        if numbers.len() == count {
            Ok(numbers)
        } else {
            Err(self.bad(format!(
                "'{}' does not begin with {count} numbers",
                self.line.chars().take(40).collect::<String>()
            )))
        }
    }
}

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let mut lines = Lines { source, number: 0, bytes: Vec::new(), line: String::new() };
    let header = lines.next("'OFF'")?.to_string();
    let mut words = header.split_ascii_whitespace();
    let keyword = words.next().unwrap_or_default().trim_start_matches('\u{feff}');
    // COFF, NOFF, STOFF and their mixtures carry more numbers after the coordinates; four and n
    // dimensions are no solids.
    let known = keyword
        .strip_suffix("OFF")
        .is_some_and(|prefix| prefix.chars().all(|letter| "STCN".contains(letter)));
    if !known || words.clone().any(|word| word.eq_ignore_ascii_case("binary")) {
        return Err(lines.source.bad(
            "is no OFF text file in three dimensions",
            "export the part as OFF text, or as STL",
        ));
    }
    if words.next().is_some() {
        lines.line = header.trim_start_matches('\u{feff}')[keyword.len()..].trim().to_string(); // the counts stand on the same line
    } else {
        lines.next("the counts of vertices and faces")?;
    }
    let counts: Vec<usize> = lines.numbers(2)?;
    let mut vertices = Vec::new(); // the count is only a claim: nothing is reserved for it
    for number in 1..=counts[0] {
        lines.next("a vertex")?;
        lines.source.hold(size_of::<DVec3>() as u64)?;
        let position: Vec<f64> = lines.numbers(3)?;
        vertices.push(lines.source.finite(DVec3::from_slice(&position), number)?);
    }
    let mut welder = Welder::default();
    for number in 1..=counts[1] {
        lines.next("a face")?;
        let corners: usize = lines.numbers::<usize>(1)?[0];
        let corners: Vec<u32> = lines.numbers(corners.saturating_add(1).min(lines.line.len()))?;
        lines.source.polygon(&mut welder, &vertices, &corners[1..], number)?;
    }
    let mut warnings = Vec::new();
    if lines.next("").is_ok() {
        warnings.push(format!(
            "line {} and what follows were ignored: the file states {} faces",
            lines.number, counts[1]
        ));
    }
    Ok(welder.finish(None, warnings))
}

//! What the program says: every text passes here, so that no character from a file reaches the
//! terminal as a command, and a closed pipe or a full disk is an error instead of a panic.

use std::io::{StdoutLock, Write};

use gripfast::text::shown_lines;

/// Standard output for text; data formats are written without it.
pub(crate) fn output() -> Shown<StdoutLock<'static>> {
    Shown { inner: std::io::stdout().lock(), rest: Vec::new() }
}

/// Standard output for an answer as text, or as data that is written as it is.
pub(crate) fn answer(data: bool) -> Box<dyn Write> {
    if data { Box::new(std::io::stdout().lock()) } else { Box::new(output()) }
}

/// Signs in a line of the terminal that standard output goes to, where it is one. Some terminals
/// report no width, or one in which nothing can be read.
pub(crate) fn width() -> Option<usize> {
    /// Narrower ones are not believed, and this is taken instead.
    const BELIEVED: [usize; 2] = [40, 80];
    let width = usize::from(comfy_table::Table::new().width()?);
    Some(if width < BELIEVED[0] { BELIEVED[1] } else { width })
}

/// A line on standard error. Where that cannot be written there is no one to tell.
pub(crate) fn say(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", shown_lines(text));
}

/// Writes text with its hidden characters by their numbers.
pub(crate) struct Shown<W: Write> {
    inner: W,
    /// The start of a character whose end has not come yet.
    rest: Vec<u8>,
}

impl<W: Write> Write for Shown<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.rest.extend_from_slice(bytes);
        let valid = match std::str::from_utf8(&self.rest) {
            Ok(text) => text.len(),
            Err(error) if error.error_len().is_none() => error.valid_up_to(),
            Err(_) => return Err(std::io::ErrorKind::InvalidData.into()),
        };
        let text: Vec<u8> = self.rest.drain(..valid).collect();
        // Valid up to there.
        let text = String::from_utf8_lossy(&text);
        self.inner.write_all(shown_lines(&text).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_shown_also_when_a_character_comes_in_pieces() {
        let mut output = Shown { inner: Vec::new(), rest: Vec::new() };
        output.write_all(b"a\x1b[31m \xe2\x80").unwrap();
        output.write_all(b"\xaeb\n").unwrap();
        assert_eq!(String::from_utf8(output.inner).unwrap(), "a\\u{1b}[31m \\u{202e}b\n");
    }
}

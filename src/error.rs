//! The library's error type: bad input and outside failures, never a hard grip (that is a
//! [`crate::model::Status`]).

use std::path::{Path, PathBuf};

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What can go wrong outside the mechanics. Each message names the place and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Input that is not what it should be: a file, a field in it, or a flag.
    #[error("{place}: {problem}{}{remedy}", if .remedy.is_empty() { "" } else { "\n  remedy: " })]
    Input {
        /// File, line, field or flag.
        place: String,
        /// What is wrong, with the value found.
        problem: String,
        /// What to do about it (may be empty).
        remedy: String,
    },
    /// The operating system refused a file operation.
    #[error("{}: cannot {action}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// `read`, `write`, ...
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The requested compute backend is not there or failed.
    #[error("backend: {0}")]
    Backend(String),
}

impl Error {
    /// Bad input at `place`.
    pub fn input(
        place: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Input { place: place.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// A failed file operation.
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), action, source }
    }
}

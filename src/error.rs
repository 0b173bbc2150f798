//! The library's error type: bad input and outside failures, never a hard grip (that is a
//! [`crate::model::Status`]).

use std::path::Path;

use crate::text::{shown, shown_lines};

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What an [`Error`] is about, for programs: one match instead of a look into the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The operating system refused a file operation.
    File,
    /// The content of a file or text is not what its format asks for: damaged, cut short, a word
    /// where a number belongs.
    Format,
    /// Readable geometry that cannot be worked with: a part without volume, a pad without area.
    Geometry,
    /// A value out of its range, or none of those accepted.
    Value,
    /// Valid, but this build or version does not do it.
    Unsupported,
    /// Something named is not there: a file, gripper, grip, column.
    NotFound,
    /// Two inputs that do not belong together: a checkpoint of another part, a grip under a load
    /// that is not listed.
    Mismatch,
    /// A limit of memory, time or number is exceeded.
    Limit,
    /// Another run holds the output.
    Busy,
    /// The graphics processor is not there or failed.
    Device,
    /// Stopped by the caller.
    Cancelled,
}

impl ErrorKind {
    /// Its name in files and for other languages, in snake case.
    pub fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Format => "format",
            Self::Geometry => "geometry",
            Self::Value => "value",
            Self::Unsupported => "unsupported",
            Self::NotFound => "not_found",
            Self::Mismatch => "mismatch",
            Self::Limit => "limit",
            Self::Busy => "busy",
            Self::Device => "device",
            Self::Cancelled => "cancelled",
        }
    }
}

/// What can go wrong outside the mechanics: the kind, the place, the problem and the remedy, in
/// words of the domain.
///
/// Options of the main job are named as in the request ([`Error::options`]); how a command line or
/// another language spells them is for that end to add.
#[derive(Debug)]
pub struct Error {
    kind: ErrorKind,
    place: String,
    problem: String,
    remedy: String,
    options: Vec<&'static str>,
    source: Option<Box<std::io::Error>>,
}

impl Error {
    /// An error of this kind at `place` (file, line, field or option; may be empty), with the
    /// problem, naming the value found, and the remedy (may be empty).
    pub fn new(
        kind: ErrorKind,
        place: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            kind,
            place: place.into(),
            problem: problem.into(),
            remedy: remedy.into(),
            options: Vec::new(),
            source: None,
        }
    }

    /// A bad value at `place`: [`ErrorKind::Value`].
    pub fn input(
        place: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::new(ErrorKind::Value, place, problem, remedy)
    }

    /// Content that is not what its format asks for: [`ErrorKind::Format`].
    pub fn format(
        place: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::new(ErrorKind::Format, place, problem, remedy)
    }

    /// A failed file operation, `action` being `read`, `write`, ..: [`ErrorKind::NotFound`] when
    /// the file is not there, else [`ErrorKind::File`].
    pub fn io(path: &Path, action: &str, source: std::io::Error) -> Self {
        use std::io::ErrorKind as Io;
        let (kind, remedy) = match source.kind() {
            Io::NotFound => (ErrorKind::NotFound, "check the name and the folder"),
            Io::PermissionDenied => (ErrorKind::File, "check who may use the file and its folder"),
            Io::StorageFull => (ErrorKind::File, "free some space, or write elsewhere"),
            _ => (ErrorKind::File, ""),
        };
        let problem = format!("cannot {action}: {source}");
        Self {
            source: Some(Box::new(source)),
            ..Self::new(kind, path.display().to_string(), problem, remedy)
        }
    }

    /// A graphics processor that is not there or failed: [`ErrorKind::Device`].
    pub fn device(problem: impl Into<String>) -> Self {
        Self::new(ErrorKind::Device, "backend", problem, "")
    }

    /// The same error as another kind.
    #[must_use]
    pub fn with_kind(mut self, kind: ErrorKind) -> Self {
        self.kind = kind;
        self
    }

    /// The same error about these options of the request, by the names of its fields.
    #[must_use]
    pub fn with_options(mut self, options: &[&'static str]) -> Self {
        self.options = options.to_vec();
        self
    }

    /// What the error is about.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// File, line, field or option; may be empty.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// What is wrong, with the value found.
    pub fn problem(&self) -> &str {
        &self.problem
    }

    /// What to do about it; may be empty.
    pub fn remedy(&self) -> &str {
        &self.remedy
    }

    /// The options of the request that cause or cure it, by the names of its fields.
    pub fn options(&self) -> &[&'static str] {
        &self.options
    }
}

impl std::fmt::Display for Error {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if !self.place.is_empty() {
            write!(formatter, "{}: ", shown(&self.place))?;
        }
        formatter.write_str(&shown_lines(&self.problem))?;
        if !self.remedy.is_empty() {
            write!(formatter, "\n  remedy: {}", shown_lines(&self.remedy))?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.as_deref().map(|source| source as _)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_shows_place_problem_and_remedy() {
        let error = Error::input("unit", "unknown unit 'x'", "use mm").with_options(&["unit"]);
        assert_eq!(error.to_string(), "unit: unknown unit 'x'\n  remedy: use mm");
        assert_eq!((error.kind(), error.options()), (ErrorKind::Value, ["unit"].as_slice()));
        assert_eq!(Error::device("lost").to_string(), "backend: lost");
        assert_eq!(Error::new(ErrorKind::Limit, "", "too much", "").to_string(), "too much");
    }

    #[test]
    fn a_file_that_is_not_there_is_not_found_and_keeps_its_cause() {
        let path = Path::new("no/such/file");
        let error = Error::io(path, "read", std::fs::read(path).unwrap_err());
        assert_eq!(error.kind(), ErrorKind::NotFound);
        assert!(error.to_string().starts_with("no/such/file: cannot read: "));
        assert_eq!(error.remedy(), "check the name and the folder");
        let source = std::error::Error::source(&error).unwrap();
        assert!(source.downcast_ref::<std::io::Error>().is_some());
        let denied = std::io::ErrorKind::PermissionDenied.into();
        assert_eq!(Error::io(path, "read", denied).kind(), ErrorKind::File);
    }
}

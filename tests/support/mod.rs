//! Shared by the test suites: where reference data lies and how a missing one is said.

#![allow(dead_code, reason = "each suite uses a part of it")]

use std::path::PathBuf;

/// A file of the reference data beside the checkout; `None`, said aloud, when it is not there.
pub(crate) fn reference(path: &str) -> Option<PathBuf> {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path);
    if file.exists() {
        return Some(file);
    }
    // Written to the terminal, not through the test harness's capture, so that a skip is always
    // seen.
    use std::io::Write;
    let _ =
        writeln!(std::io::stderr(), "SKIPPED: reference data '{path}' is not beside this checkout");
    None
}

/// A line on the terminal that the test harness does not hold back.
pub(crate) fn say(line: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{line}");
}

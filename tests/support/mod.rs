//! Shared by the test suites: where reference data lies and how a missing one is said.

#![allow(dead_code, reason = "each suite uses a part of it")]

use std::path::{Path, PathBuf};

pub(crate) mod block;
pub(crate) mod grips;
pub(crate) mod lathe;
pub(crate) mod random;
pub(crate) mod report;

/// The root of the checkout, from whichever package the suite belongs to.
pub(crate) fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let above = here.parent().unwrap_or(here);
    if here.join("data").is_dir() { here.into() } else { above.into() }
}

/// A file of the reference data, beside the checkout or in the folder that GRIPFAST_REFERENCE names;
/// `None`, said aloud, when it is not there.
pub(crate) fn reference(path: &str) -> Option<PathBuf> {
    let named = std::env::var_os("GRIPFAST_REFERENCE").map(PathBuf::from);
    let file = named.unwrap_or_else(|| root().join("../shared")).join(path);
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

/// A command line with more flags, each in the place of the one of the same name: a flag given twice
/// is an error.
pub(crate) fn with_flags<'a>(base: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    let name = |word: &str| word.split('=').next().unwrap_or_default().to_owned();
    let given: Vec<String> =
        more.iter().filter(|word| word.starts_with("--")).map(|word| name(word)).collect();
    let mut line = Vec::new();
    let mut words = base.iter().peekable();
    while let Some(word) = words.next() {
        if given.contains(&name(word)) {
            // Its value goes with it.
            let _ = words.next_if(|value| !value.starts_with('-'));
        } else {
            line.push(*word);
        }
    }
    line.extend(more);
    line
}

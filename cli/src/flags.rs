//! The library names options of a request; here they get the names that the command line has for
//! them.

use gripfast::error::Error;
use gripfast::units::Quantity;

/// An error in full for the terminal: with its causes, less those already named, and with the flags
/// that set the options it is about.
pub(crate) fn message(error: &anyhow::Error) -> String {
    let mut text =
        error.chain().skip(1).map(ToString::to_string).fold(error.to_string(), |text, cause| {
            if text.contains(&cause) { text } else { format!("{text}: {cause}") }
        });
    let options = error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<Error>())
        .flat_map(|error| error.options());
    let flags: Vec<String> =
        options.map(|option| flag(option)).filter(|flag| !text.contains(flag)).collect();
    if !flags.is_empty() {
        text += &format!("\n  set by: {}", flags.join(", "));
    }
    text
}

/// A warning of the library with the flag that answers it.
pub(crate) fn warning(text: &str) -> String {
    let between = |before: &str, after: &str| {
        let value = text.split_once(before)?.1;
        Some(value.split_once(after)?.0)
    };
    if let Some(unit) = between("; the unit ", " would give") {
        return format!("{text} ({} {unit})", flag("unit"));
    }
    match between("fit planes and round faces to corners within ", " mm") {
        Some(tolerance) => format!("{text} ({} {tolerance}mm)", flag("fit")),
        None => text.to_string(),
    }
}

/// The bytes that `--max-memory` states.
pub(crate) fn memory(text: &str) -> gripfast::error::Result<u64> {
    let bytes = Quantity::Memory.parse("--max-memory", text)?;
    if bytes < 1.0 {
        return Err(Error::input("--max-memory", format!("is {text}"), "give a size above zero"));
    }
    Ok(bytes as u64)
}

/// The flag of an option.
fn flag(option: &str) -> String {
    format!("--{}", option.replace('_', "-"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn an_error_names_the_flags_that_set_its_options_once() {
        let error = || Error::input("unit", "unknown", "").with_options(&["unit", "angle_step"]);
        assert_eq!(message(&error().into()), "unit: unknown\n  set by: --unit, --angle-step");
        let outer = Err::<(), _>(error()).context("--unit x").unwrap_err();
        assert_eq!(message(&outer), "--unit x: unit: unknown\n  set by: --angle-step");
        assert_eq!(message(&anyhow::anyhow!("plain")), "plain");
    }

    #[test]
    fn a_warning_of_the_unit_names_the_flag() {
        let text = "implausible size: 1 mm; the unit m would give 1000 mm";
        assert_eq!(warning(text), format!("{text} (--unit m)"));
        assert_eq!(warning("other"), "other");
    }
}

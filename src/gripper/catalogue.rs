//! The shipped grippers, and finding one by name or file.

use std::path::Path;

use super::{Gripper, parse, read};
use crate::error::{Error, ErrorKind, Result};

/// Short name and text of each shipped gripper file (`data/grippers/`).
pub const CATALOGUE: &[(&str, &str)] = &[
    ("robotiq-2f85", include_str!("../../data/grippers/robotiq-2f85.toml")),
    ("robotiq-2f140", include_str!("../../data/grippers/robotiq-2f140.toml")),
    ("robotiq-hande", include_str!("../../data/grippers/robotiq-hande.toml")),
    ("franka-hand", include_str!("../../data/grippers/franka-hand.toml")),
    ("onrobot-rg2", include_str!("../../data/grippers/onrobot-rg2.toml")),
    ("wsg50-110", include_str!("../../data/grippers/wsg50-110.toml")),
    ("generic", include_str!("../../data/grippers/generic.toml")),
];

/// The text of the gripper file behind a shipped name or a path.
///
/// # Errors
/// As [`find`], without the parsing.
pub fn text(name_or_path: &str) -> Result<String> {
    match shipped(name_or_path) {
        Some((_, text)) => Ok((*text).to_string()),
        None if is_file(name_or_path) => {
            let path = Path::new(name_or_path);
            crate::file::read_text(path)
        }
        None => Err(unknown(name_or_path)),
    }
}

/// The gripper of a shipped name (case, dashes, blanks and underscores do not matter; a part of the
/// name is enough when only one matches) or of a gripper file.
///
/// # Errors
/// When the name is unknown (the message names the closest one) or the file is unreadable or wrong.
pub fn find(name_or_path: &str) -> Result<Gripper> {
    if looks_like_path(name_or_path) {
        return read(Path::new(name_or_path));
    }
    match shipped(name_or_path) {
        Some((name, text)) => parse(text, &format!("shipped gripper {name}")),
        None if is_file(name_or_path) => read(Path::new(name_or_path)),
        None => Err(unknown(name_or_path)),
    }
}

fn looks_like_path(name: &str) -> bool {
    name.contains(['/', '\\']) || name.to_ascii_lowercase().ends_with(".toml")
}

fn is_file(name: &str) -> bool {
    Path::new(name).is_file()
}

fn shipped(name: &str) -> Option<&'static (&'static str, &'static str)> {
    if looks_like_path(name) {
        return None;
    }
    let wanted = key(name);
    if wanted.is_empty() {
        return None;
    }
    let entries =
        || CATALOGUE.iter().map(|entry| (key(entry.0), key(&display_name(entry.1)), entry));
    if let Some(found) = entries().find(|(short, long, _)| *short == wanted || *long == wanted) {
        return Some(found.2);
    }
    let mut partial =
        entries().filter(|(short, long, _)| short.contains(&wanted) || long.contains(&wanted));
    let first = partial.next()?;
    partial.next().is_none().then_some(first.2)
}

/// The `name` line of a shipped file (their form is fixed by a test).
fn display_name(text: &str) -> String {
    text.lines()
        .find_map(|line| line.strip_prefix("name = "))
        .unwrap_or_default()
        .trim_matches('"')
        .to_string()
}

fn key(name: &str) -> String {
    name.chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|letter| letter.to_ascii_lowercase())
        .collect()
}

fn unknown(name: &str) -> Error {
    let wanted = key(name);
    let close = CATALOGUE
        .iter()
        .flat_map(|(short, text)| {
            [
                (edits(&wanted, &key(short)), short),
                (edits(&wanted, &key(&display_name(text))), short),
            ]
        })
        .min()
        .filter(|(distance, short)| *distance <= 1 + short.len() / 3)
        .map_or(String::new(), |(_, short)| format!("did you mean '{short}'? "));
    let file = format!("{name}.toml");
    let close = if is_file(&file) { format!("did you mean '{file}'? ") } else { close };
    let names: Vec<&str> = CATALOGUE.iter().map(|entry| entry.0).collect();
    Error::new(
        ErrorKind::NotFound,
        format!("gripper '{name}'"),
        "no shipped gripper and no file of this name",
        format!("{close}Shipped: {}; or give a gripper file (.toml)", names.join(", ")),
    )
    .with_options(&["gripper"])
}

/// Levenshtein distance.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &to) in b.iter().enumerate() {
            let substitute = diagonal + usize::from(from != to);
            diagonal = row[j + 1];
            row[j + 1] = substitute.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_of_words() {
        assert_eq!((edits("kitten", "sitting"), edits("", "abc"), edits("abc", "abc")), (3, 3, 0));
    }

    #[test]
    fn names_are_forgiving_and_wrong_ones_get_a_hint() {
        for name in [
            "robotiq-2f85",
            "Robotiq 2F-85",
            "ROBOTIQ_2F_85",
            "2f85",
            "franka",
            "Hand-E",
            "rg2",
            "wsg50",
            "generic",
        ] {
            assert!(find(name).is_ok(), "{name}");
        }
        let message = find("robotic-2f85").unwrap_err().to_string();
        assert!(message.contains("did you mean 'robotiq-2f85'"), "{message}");
        // two fit: not a guess
        assert!(find("robotiq").unwrap_err().to_string().contains("robotiq-hande"));
        for name in ["", "--", "nosuch.toml", "/no/such", "xyzzy quux"] {
            assert!(find(name).is_err(), "{name}");
        }
    }

    #[test]
    fn every_shipped_file_is_a_gripper_with_sources() {
        for (short, text) in CATALOGUE {
            let gripper = find(short).unwrap();
            assert_eq!(gripper.name, display_name(text));
            let mut wanted = vec!["stroke".to_string(), "force".into(), "pad.size".into()];
            wanted.extend(gripper.fingers.iter().map(|body| format!("finger.{}", body.name)));
            wanted.extend(gripper.palm.iter().map(|body| format!("palm.{}", body.name)));
            wanted.extend(gripper.pad_friction.map(|_| "pad.friction".into()));
            wanted.extend(gripper.pad_thickness.map(|_| "pad.thickness".into()));
            wanted.extend(gripper.pad_modulus.map(|_| "pad.modulus".into()));
            wanted.extend(gripper.grip_from_flange.map(|_| "flange".into()));
            if gripper.travel != crate::gripper::Travel::Parallel {
                wanted.push("motion".into());
            }
            for field in wanted {
                assert!(gripper.sources.contains_key(&field), "{short}: no source for {field}");
            }
            assert!(gripper.is_symmetric(), "{short}");
            // Only what no source states may be warned of in a shipped file.
            for warning in crate::gripper::check(&gripper) {
                assert!(
                    warning.contains("not stated") || warning.contains("unverified"),
                    "{short}: {warning}"
                );
            }
        }
    }
}

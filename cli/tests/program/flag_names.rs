//! Flags are named by the command line only: the library speaks of options.

use std::path::{Path, PathBuf};

use crate::support::root;

#[test]
fn no_message_of_the_library_names_a_flag() {
    for path in sources(&root().join("src")) {
        let name = path.strip_prefix(root()).unwrap().display().to_string();
        let text = std::fs::read_to_string(&path).unwrap();
        let found: Vec<String> =
            literals(&text).into_iter().filter(|literal| names_a_flag(literal)).collect();
        assert!(found.is_empty(), "{name}: {found:?}");
    }
}

#[test]
fn every_option_that_an_error_names_is_a_flag() {
    let help: String = ["plan", "part", "score", "export", "why"]
        .map(|command| {
            let output = assert_cmd::Command::cargo_bin("gripfast")
                .unwrap()
                .args([command, "--help"])
                .output()
                .unwrap();
            String::from_utf8(output.stdout).unwrap()
        })
        .concat();
    let mut options = Vec::new();
    for path in sources(&root().join("src")).iter().filter(|path| !path.ends_with("error.rs")) {
        let text = std::fs::read_to_string(path).unwrap();
        for rest in text.split("with_options(&[").skip(1) {
            let list = rest.split(']').next().unwrap();
            options.extend(literals(list));
        }
    }
    assert!(options.len() > 4, "{options:?}");
    for option in options {
        let flag = format!("--{}", option.replace('_', "-"));
        let known = help.split(|sign: char| !(sign.is_alphanumeric() || sign == '-'));
        assert!(known.into_iter().any(|word| word == flag), "{option}: no flag {flag}");
    }
}

#[test]
fn literals_are_told_from_comments_and_tests() {
    let text = "// \"--a\"\nlet x = \"--b\\\"\"; /* \"--c\" */ let y = '\"'; let z = r#\"--d\"#;\n\
                fn f<'a>(x: &'a str) {}\n#[cfg(test)]\nmod tests { \"--e\" }";
    assert_eq!(literals(text), ["--b\\\"", "--d"]);
    assert!(names_a_flag("use --unit mm") && names_a_flag("--unit"));
    assert!(!names_a_flag("a -- b") && !names_a_flag("a--b") && !names_a_flag("---"));
}

/// Whether a word begins with two dashes and a letter.
fn names_a_flag(text: &str) -> bool {
    // How to build the program with more formats: flags of another command.
    let text = text.replace("cargo build --release --features full", "");
    text.match_indices("--").any(|(at, _)| {
        let before = text[..at].chars().next_back();
        let after = text[at + 2..].chars().next();
        !before.is_some_and(|sign| sign.is_alphanumeric() || sign == '-')
            && after.is_some_and(|sign| sign.is_ascii_lowercase())
    })
}

/// The string literals of a source file, as written, outside of comments and of the tests at its
/// end.
fn literals(text: &str) -> Vec<String> {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let signs: Vec<char> = text.chars().collect();
    let starts = |at: usize, word: &str| {
        word.chars().enumerate().all(|(k, sign)| signs.get(at + k) == Some(&sign))
    };
    let mut found = Vec::new();
    let mut at = 0;
    while at < signs.len() {
        if starts(at, "//") {
            while at < signs.len() && signs[at] != '\n' {
                at += 1;
            }
        } else if starts(at, "/*") {
            while at < signs.len() && !starts(at, "*/") {
                at += 1;
            }
        } else if starts(at, "'\"'") || starts(at, "'\\\"'") {
            at += 3;
        } else if starts(at, "r\"") || starts(at, "r#\"") {
            let end = if signs[at + 1] == '#' { "\"#" } else { "\"" };
            at += 1 + end.len();
            let start = at;
            while at < signs.len() && !starts(at, end) {
                at += 1;
            }
            found.push(signs[start..at].iter().collect());
            at += end.len() - 1;
        } else if signs[at] == '"' {
            at += 1;
            let start = at;
            while at < signs.len() && signs[at] != '"' {
                at += if signs[at] == '\\' { 2 } else { 1 };
            }
            found.push(signs[start..at.min(signs.len())].iter().collect());
        }
        at += 1;
    }
    found
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

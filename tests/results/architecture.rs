//! The import table of `ARCHITECTURE.md` against the paths in `src/`, and the links of the pages.
//!
//! A room is a module right under the crate's root. Every path from one room into another stands in
//! the table, every entry of the table is used, and each room imports only from rooms above it.
//! Paths in comments, texts and items under `#[cfg(test)]` do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Room to the rooms that it imports.
type Arrows = BTreeMap<String, BTreeSet<String>>;

/// Rust code without comments and the contents of texts and characters.
fn bare(code: &str) -> String {
    let chars: Vec<char> = code.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let (mut out, mut i) = (String::new(), 0);
    while i < chars.len() {
        if at(i) == '/' && at(i + 1) == '/' {
            while i < chars.len() && at(i) != '\n' {
                i += 1;
            }
        } else if at(i) == '/' && at(i + 1) == '*' {
            i += 2;
            while i < chars.len() && !(at(i) == '*' && at(i + 1) == '/') {
                i += 1;
            }
            i += 2;
        } else if let Some(hashes) = raw_text(&chars, i) {
            // r"..", r#".."#: ends at a quote with as many hashes.
            i += hashes + 2;
            while i < chars.len() && !(at(i) == '"' && (1..=hashes).all(|k| at(i + k) == '#')) {
                i += 1;
            }
            i += hashes + 1;
        } else if at(i) == '"' {
            i += 1;
            while i < chars.len() && at(i) != '"' {
                i += if at(i) == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if at(i) == '\'' && at(i + 1) == '\\' {
            i += 3;
            while i < chars.len() && at(i) != '\'' {
                i += 1;
            }
            i += 1;
        } else if at(i) == '\'' && at(i + 2) == '\'' {
            i += 3;
        } else {
            out.push(at(i));
            i += 1;
        }
    }
    out
}

/// Number of hashes of the raw text that begins at `i`.
fn raw_text(chars: &[char], i: usize) -> Option<usize> {
    let word = |c: char| c.is_alphanumeric() || c == '_';
    if chars[i] != 'r' || i > 0 && word(chars[i - 1]) && chars[i - 1] != 'b' {
        return None;
    }
    let hashes = chars[i + 1..].iter().take_while(|&&c| c == '#').count();
    (chars.get(i + 1 + hashes) == Some(&'"')).then_some(hashes)
}

/// Bare code without the items under `#[cfg(test)]`, and the modules of other files among them.
fn without_tests(code: &str) -> (String, Vec<String>) {
    let (mut out, mut modules, mut rest) = (String::new(), Vec::new(), code);
    while let Some(start) = rest.find("#[cfg(") {
        let end = start + rest[start..].find(']').unwrap();
        let condition = &rest[start..end];
        let tested = condition.contains("test") && !condition.contains("not(test");
        out += &rest[..start];
        rest = &rest[end + 1..];
        if !tested {
            continue;
        }
        let stop = rest.find(['{', ';']).unwrap();
        if rest[stop..].starts_with(';') {
            if let Some((_, name)) = rest[..stop].split_once("mod ") {
                modules.push(name.trim().to_owned());
            }
            rest = &rest[stop + 1..];
            continue;
        }
        let mut depth = 0;
        let close = rest[stop..].char_indices().find(|&(_, c)| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            depth == 0
        });
        rest = &rest[stop + close.unwrap().0 + 1..];
    }
    (out + rest, modules)
}

/// The rooms that bare code of a module `depth` below the crate's root names.
fn named(code: &str, depth: usize) -> BTreeSet<String> {
    let root = format!("{}::", vec!["super"; depth].join("::"));
    let mut rooms = BTreeSet::new();
    for prefix in ["crate::", &root] {
        for (start, _) in code.match_indices(prefix) {
            let before = code[..start].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || "_:$".contains(c)) {
                continue;
            }
            let rest = code[start + prefix.len()..].trim_start();
            let Some(group) = rest.strip_prefix('{') else {
                rooms.insert(first_word(rest));
                continue;
            };
            // `crate::{a::b, c::{d, e}}`: the first word of each entry of the outer braces.
            let (mut depth, mut fresh) = (1, true);
            for (i, c) in group.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 1 => fresh = true,
                    c if fresh && !c.is_whitespace() => {
                        rooms.insert(first_word(&group[i..]));
                        fresh = false;
                    }
                    _ => {}
                }
                if depth == 0 {
                    break;
                }
            }
        }
    }
    rooms
}

fn first_word(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

fn files(folder: &Path, ending: &str, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let skipped = path.file_name().is_some_and(|name| {
            name == "node_modules" || name == "target" || name.to_string_lossy().starts_with('.')
        });
        if path.is_dir() && !skipped {
            files(&path, ending, out);
        } else if path.extension().is_some_and(|found| found == ending) {
            out.push(path);
        }
    }
}

/// What the rooms of `src/` import from each other.
fn arrows() -> Arrows {
    let src = crate::support::root().join("src");
    let mut paths = Vec::new();
    files(&src, "rs", &mut paths);
    let (mut read, mut tests) = (Vec::new(), BTreeSet::new());
    for path in paths {
        let (code, modules) = without_tests(&bare(&std::fs::read_to_string(&path).unwrap()));
        let folder = match path.file_stem().unwrap().to_str().unwrap() {
            "mod" | "lib" => path.parent().unwrap().to_path_buf(),
            _ => path.with_extension(""),
        };
        for module in modules {
            tests.insert(folder.join(&module).with_extension("rs"));
            tests.insert(folder.join(module).join("mod.rs"));
        }
        read.push((path, code));
    }
    let mut arrows = Arrows::new();
    for (path, code) in read {
        let inside = path.strip_prefix(&src).unwrap();
        let mut parts: Vec<_> = inside
            .with_extension("")
            .iter()
            .map(|part| part.to_str().unwrap().to_owned())
            .collect();
        if parts.last().unwrap() == "mod" {
            parts.pop();
        }
        // And the modules within those.
        let within = |test: &PathBuf| path == *test || path.starts_with(test.with_extension(""));
        if parts[0] == "lib" || tests.iter().any(within) {
            continue;
        }
        let room = parts[0].clone();
        let mut found = named(&code, parts.len());
        found.remove(&room);
        arrows.entry(room).or_default().extend(found);
    }
    let rooms: BTreeSet<String> = arrows.keys().cloned().collect();
    for found in arrows.values_mut() {
        found.retain(|name| rooms.contains(name)); // macros and the crate's own items are no rooms
    }
    arrows
}

/// The rows of the table whose header begins with these two columns.
fn table(text: &str, header: [&str; 2]) -> Vec<(String, Vec<String>)> {
    let cells = |line: &str| -> Vec<String> {
        line.trim_matches('|').split('|').map(|cell| cell.trim().replace('`', "")).collect()
    };
    let mut lines = text.lines().skip_while(|line| {
        let found = cells(line);
        !line.starts_with('|') || found.len() < 2 || found[..2] != header
    });
    assert!(lines.next().is_some(), "ARCHITECTURE.md has no table `{}`", header.join(" | "));
    lines
        .skip(1)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            let row = cells(line);
            let list = row[1].split(',').map(|name| name.trim().to_owned());
            (row[0].clone(), list.filter(|name| !name.is_empty()).collect())
        })
        .collect()
}

#[test]
fn rooms_import_what_the_table_says() {
    let path = crate::support::root().join("ARCHITECTURE.md");
    let text = std::fs::read_to_string(path).unwrap();
    let rows = table(&text, ["room", "may import"]);
    let order: Vec<&str> = rows.iter().map(|row| row.0.as_str()).collect();
    let mut wrong = Vec::new();
    let mut stated = Arrows::new();
    for (place, (room, imports)) in rows.iter().enumerate() {
        for other in imports {
            match order.iter().position(|name| name == other) {
                Some(at) if at < place => {}
                Some(_) => wrong.push(format!("{room} may import {other}, which is not above it")),
                None => wrong.push(format!("{room} may import {other}, which is no room")),
            }
        }
        stated.entry(room.clone()).or_default().extend(imports.iter().cloned());
    }
    let found = arrows();
    for room in found.keys().chain(stated.keys()).collect::<BTreeSet<_>>() {
        let none = BTreeSet::new();
        let (uses, says) = (found.get(room), stated.get(room));
        if uses.is_none() || says.is_none() {
            wrong.push(format!("{room}: a room of src/ and a row of the table are not both there"));
        }
        let (uses, says) = (uses.unwrap_or(&none), says.unwrap_or(&none));
        let more = uses.difference(says).map(|other| format!("{room} imports {other}: not stated"));
        wrong.extend(more);
        let less = says.difference(uses).map(|other| format!("{room} does not import {other}"));
        wrong.extend(less);
    }
    assert!(wrong.is_empty(), "ARCHITECTURE.md and src/ differ:\n{}", wrong.join("\n"));
}

#[test]
fn paths_are_found_and_tests_are_not() {
    let code = bare(
        r##"//! [`crate::comment`]
use crate::{geometry::{Ring, clip}, model::Grip};
use crate::error::Error; /* crate::block */
use super::super::upward::Thing;
use super::sibling;
fn f<'a>(x: &'a str) -> char { let _ = "crate::text \" crate::text"; crate::part::read(x); '"' }
const R: &str = r#"crate::raw " "#;
pub(crate) fn g() { other_crate::not_ours(); let c = '\''; crate::after::it() }
#[cfg(test)]
mod tests { use crate::only_in_tests; fn h() { { crate::nested::x() } } }
#[cfg(test)]
mod outside;
#[cfg(not(test))]
fn i() { crate::kept::j() }
"##,
    );
    let (code, modules) = without_tests(&code);
    let rooms: Vec<String> = named(&code, 2).into_iter().collect();
    assert_eq!(rooms, ["after", "error", "geometry", "kept", "model", "part", "upward"]);
    assert_eq!(modules, ["outside"]);
}

#[test]
fn the_table_is_read() {
    let text = "a\n\n| room | may import |\n|---|---|\n| `one` | |\n| `two` | `one`, error |\n\nb";
    let rows = table(text, ["room", "may import"]);
    assert_eq!(rows[0], ("one".to_owned(), vec![]));
    assert_eq!(rows[1], ("two".to_owned(), vec!["one".to_owned(), "error".to_owned()]));
}

#[test]
fn links_between_pages_lead_somewhere() {
    let root = crate::support::root();
    let mut pages = Vec::new();
    files(&root, "md", &mut pages);
    assert!(pages.len() > 10, "{pages:?}");
    let mut wrong = Vec::new();
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        for (start, _) in text.match_indices("](") {
            let target = text[start + 2..].split(')').next().unwrap();
            let (path, heading) = target.split_once('#').unwrap_or((target, ""));
            if path.contains("://") {
                continue;
            }
            let file =
                if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            if !file.exists() || !heading.is_empty() && !headings(&file).contains(heading) {
                wrong.push(format!("{}: {target}", page.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "links that lead nowhere:\n{}", wrong.join("\n"));
}

/// The names by which links reach the headings of a page.
fn headings(page: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(page).unwrap();
    let lines = text.lines().filter(|line| line.starts_with('#'));
    lines
        .map(|line| {
            let words = line.trim_start_matches('#').trim().to_lowercase();
            let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            kept.map(|c| if c == ' ' { '-' } else { c }).collect()
        })
        .collect()
}

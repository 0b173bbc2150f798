//! The commands in the documentation, run: each `$ gripfast ..` of a fenced block prints what the
//! page says it prints.
//!
//! A page's commands run in their order in one folder that holds a copy of `data/`; blocks whose
//! fence names a file (```` ```toml cell.toml ````) are written there first. In the text shown, a
//! line `...` stands for any lines left out, and `# exits with N` after a command for its exit
//! code. Numbers may differ by one in their last digit; times and sizes of files by anything; the
//! line that names the backend is left out. Drawings in `docs/images` are compared too.
//! `GRIPFAST_DOCS=write` rewrites pages and drawings with what the program makes.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};

/// The pages that show commands.
fn pages() -> Vec<String> {
    let root = crate::support::root();
    let mut pages: Vec<String> = std::fs::read_dir(root.join("docs"))
        .unwrap()
        .map(|entry| format!("docs/{}", entry.unwrap().file_name().to_string_lossy()))
        .filter(|page| page.ends_with(".md"))
        .collect();
    pages.push("README.md".to_owned());
    pages.sort();
    pages.retain(|page| {
        let text = std::fs::read_to_string(root.join(page)).unwrap();
        text.lines().any(|line| line.starts_with("$ gripfast "))
    });
    assert!(pages.len() >= 9, "{pages:?}");
    pages
}

/// A command of a page and the output shown under it.
struct Step {
    /// Line of the command in the page, from 0.
    line: usize,
    words: Vec<String>,
    exit: i32,
    /// Lines of the output shown: from, to (not included).
    shown: (usize, usize),
}

/// What a page does: files to write, commands to run, in order.
enum Act {
    Write(String, String),
    Run(Step),
}

fn acts(page: &[&str]) -> Vec<Act> {
    let mut acts = Vec::new();
    let mut at = 0;
    while at < page.len() {
        let Some(info) = page[at].strip_prefix("```") else {
            at += 1;
            continue;
        };
        let end = (at + 1..page.len())
            .find(|&i| page[i] == "```")
            .unwrap_or_else(|| panic!("line {}: the block does not end", at + 1));
        if let Some(name) = info.split_whitespace().nth(1) {
            acts.push(Act::Write(name.to_owned(), page[at + 1..end].join("\n") + "\n"));
        }
        let starts: Vec<usize> =
            (at + 1..end).filter(|&i| page[i].starts_with("$ gripfast ")).collect();
        for (k, &line) in starts.iter().enumerate() {
            let mut text = page[line]["$ gripfast ".len()..].to_owned();
            let mut first = line + 1;
            while text.ends_with('\\') {
                text.pop();
                text += page[first];
                first += 1;
            }
            let (command, exit) =
                text.split_once("# exits with ").map_or((text.as_str(), 0), |(command, code)| {
                    (command, code.trim().parse().unwrap())
                });
            // Blank lines round the output are the page's own.
            let mut last = starts.get(k + 1).copied().unwrap_or(end);
            while first < last && page[first].is_empty() {
                first += 1;
            }
            while first < last && page[last - 1].is_empty() {
                last -= 1;
            }
            let words = command.split_whitespace().map(str::to_owned).collect();
            acts.push(Act::Run(Step { line, words, exit, shown: (first, last) }));
        }
        at = end + 1;
    }
    acts
}

/// What the program writes to standard output and standard error, in the order of writing, and its
/// exit code.
fn run(words: &[String], folder: &Path) -> (Vec<String>, i32) {
    let path = folder.join("output-of-the-command");
    let file = File::create(&path).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_gripfast"));
    // Without it the software Vulkan driver complains on standard error.
    command
        .env("XDG_RUNTIME_DIR", folder)
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stderr(file.try_clone().unwrap())
        .stdout(file);
    let status = command.status().unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    // Which backend there is, and how long it takes, say more of the machine than of the command: the pages
    // leave it out.
    let of_machine = |line: &str| {
        line.starts_with("backend ")
            || line.contains(" candidates, ") && line.ends_with(" left")
            || line.ends_with(" grips have their forces")
    };
    let lines = text.trim_matches('\n').lines().filter(|line| !of_machine(line));
    (lines.map(|line| line.trim_end().to_owned()).collect(), status.code().unwrap())
}

fn number(word: &str) -> Option<(f64, i32)> {
    let value = word.parse().ok()?;
    Some((value, word.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32)))
}

/// Whether a line printed is the line shown.
fn same(shown: &str, printed: &str) -> bool {
    let words = |line: &str| -> Vec<String> {
        line.split(|c: char| c.is_whitespace() || "(),:;|".contains(c))
            .filter(|word| !word.is_empty())
            .map(str::to_owned)
            .collect()
    };
    let (a, b) = (words(shown), words(printed));
    let free = |k: usize| matches!(a.get(k + 1).map(String::as_str), Some("ms" | "s" | "MB"));
    a.len() == b.len()
        && a.iter().zip(&b).enumerate().all(|(k, (x, y))| match (number(x), number(y)) {
            (Some(_), Some(_)) if free(k) => true,
            (Some((x, dx)), Some((y, dy))) => {
                dx == dy && (x - y).abs() <= if dx == 0 { 0.0 } else { 1.01 * 10_f64.powi(-dx) }
            }
            _ => x == y,
        })
}

/// The first line shown that the program did not print there.
fn differs(shown: &[&str], printed: &[String]) -> Option<String> {
    let shown: Vec<&str> = shown.iter().map(|line| line.trim_end()).collect();
    let mut parts = shown.split(|line| *line == "...").peekable();
    let mut rest = printed;
    let mut first = true;
    while let Some(part) = parts.next() {
        let fits = |at: usize| {
            at + part.len() <= rest.len()
                && part.iter().zip(&rest[at..]).all(|(shown, printed)| same(shown, printed))
        };
        let last = parts.peek().is_none();
        let places = match (first, last) {
            (true, true) if part.len() != rest.len() => 0..0,
            (true, _) => 0..1,
            (false, true) => rest.len().saturating_sub(part.len())..rest.len() + 1,
            (false, false) => 0..rest.len() + 1,
        };
        let Some(at) = places.clone().find(|&at| fits(at)) else {
            let culprit = if first {
                part.iter().zip(rest).position(|(shown, printed)| !same(shown, printed))
            } else {
                None
            };
            return Some(culprit.map_or_else(
                || format!("not printed as shown:\n{}", part.join("\n")),
                |k| format!("shown   {}\nprinted {}", part[k], rest[k]),
            ));
        };
        rest = &rest[at + part.len()..];
        first = false;
    }
    None
}

/// What to show instead: as many lines before and after `...` as were shown.
fn anew(shown: &[&str], printed: &[String]) -> Vec<String> {
    let Some(gap) = shown.iter().position(|line| line.trim_end() == "...") else {
        return printed.to_vec();
    };
    let after = shown.len() - gap - 1;
    if gap + after >= printed.len() {
        return printed.to_vec();
    }
    [&printed[..gap], &["...".to_owned()], &printed[printed.len() - after..]].concat()
}

/// A drawing's text without its numbers, and the numbers.
fn skeleton(svg: &str) -> (String, Vec<f64>) {
    let (mut rest, mut text, mut numbers) = (svg, String::new(), Vec::new());
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let tail = &rest[start..];
        let end = tail.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(tail.len());
        let Ok(value) = tail[..end].parse() else { break };
        text += &rest[..start];
        numbers.push(value);
        rest = &tail[end..];
    }
    (text + rest, numbers)
}

/// Whether two drawings differ by no more than a last digit of a place or a step of a colour.
fn same_drawing(a: &str, b: &str) -> bool {
    let ((text_a, a), (text_b, b)) = (skeleton(a), skeleton(b));
    text_a == text_b
        && a.len() == b.len()
        && a.iter().zip(&b).all(|(x, y)| {
            (x - y).abs() <= 1.01 * if *x < 256.0 && x.fract() == 0.0 { 1.0 } else { 0.1 }
        })
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let (path, target) = {
            let entry = entry.unwrap();
            (entry.path(), to.join(entry.file_name()))
        };
        if path.is_dir() {
            copy(&path, &target)
        } else {
            std::fs::copy(&path, &target).map(|_| ()).unwrap()
        }
    }
}

#[test]
fn pages_show_what_the_program_prints() {
    let root = crate::support::root();
    let write = std::env::var("GRIPFAST_DOCS").as_deref() == Ok("write");
    let mut wrong = Vec::new();
    for page in pages() {
        let text = std::fs::read_to_string(root.join(&page)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let folder = tempfile::tempdir().unwrap();
        copy(&root.join("data"), &folder.path().join("data"));
        let (mut out, mut copied, mut commands) = (Vec::<String>::new(), 0, 0);
        for act in acts(&lines) {
            let step = match act {
                Act::Write(name, content) => {
                    std::fs::write(folder.path().join(name), content).unwrap();
                    continue;
                }
                Act::Run(step) => step,
            };
            commands += 1;
            let (printed, exit) = run(&step.words, folder.path());
            let shown = &lines[step.shown.0..step.shown.1];
            let problem = if exit == step.exit {
                differs(shown, &printed)
            } else {
                Some(format!("exit code {exit}, not {}\n{}", step.exit, printed.join("\n")))
            };
            out.extend(lines[copied..step.shown.0].iter().map(|&line| line.to_owned()));
            out.extend(if problem.is_some() {
                anew(shown, &printed)
            } else {
                shown.iter().map(|&line| line.to_owned()).collect()
            });
            copied = step.shown.1;
            wrong.extend(problem.map(|problem| {
                format!("{page}:{}: gripfast {}\n{problem}", step.line + 1, step.words.join(" "))
            }));
        }
        assert!(commands > 0, "{page} shows no command");
        for entry in std::fs::read_dir(root.join("docs/images")).unwrap() {
            let kept = entry.unwrap().path();
            let made = folder.path().join(kept.file_name().unwrap());
            if !made.exists() {
                continue;
            }
            let read = |path: &Path| std::fs::read_to_string(path).unwrap();
            if !same_drawing(&read(&kept), &read(&made)) {
                wrong.push(format!(
                    "{page}: {} is not what the page's commands draw",
                    kept.display()
                ));
                if write {
                    std::fs::copy(&made, &kept).unwrap();
                }
            }
        }
        out.extend(lines[copied..].iter().map(|&line| line.to_owned()));
        if write {
            std::fs::write(root.join(&page), out.join("\n") + "\n").unwrap();
        }
    }
    assert!(
        write || wrong.is_empty(),
        "{}\n\nGRIPFAST_DOCS=write cargo test -p gripfast-cli --test program docs_commands  rewrites the pages",
        wrong.join("\n\n")
    );
}

#[test]
fn every_subcommand_has_examples_a_manual_page_and_completions() {
    let folder = tempfile::tempdir().unwrap();
    let words = |text: &str| -> Vec<String> { text.split(' ').map(str::to_owned).collect() };
    assert_eq!(run(&words("man pages"), folder.path()).1, 0);
    let pages: Vec<_> = std::fs::read_dir(folder.path().join("pages"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    assert!(pages.len() >= 18, "{pages:?}");
    for page in &pages {
        assert!(
            std::fs::read_to_string(page).unwrap().contains("EXAMPLES"),
            "{} shows no example",
            page.display()
        );
    }
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (script, exit) = run(&words(&format!("completions {shell}")), folder.path());
        assert!(exit == 0 && script.iter().any(|line| line.contains("report")), "{shell}");
    }
}

#[test]
fn the_comparison_can_fail() {
    let printed: Vec<String> = ["read", "size 60.0 x 40.0", "rank 1  mu_s 0.02294", "took 3.20 ms"]
        .map(String::from)
        .to_vec();
    let good = ["read", "size 60.0 x 40.0", "rank 1 mu_s 0.02295", "took 9.99 ms"];
    assert_eq!(differs(&good, &printed), None);
    assert_eq!(differs(&["...", "rank 1 mu_s 0.02294", "took 1 ms"], &printed), None);
    assert!(
        differs(&["wrote", "..."], &printed).is_some()
            && differs(&["read", "..."], &printed).is_none()
    );
    for (line, text) in [
        (1, "size 60.0 x 40.2"),
        (1, "size 60 x 40"),
        (2, "rank 2 mu_s 0.02294"),
        (2, "rank 1 mu_s 0.02296"),
        (3, "took 3.20 s"),
    ] {
        let mut bad = good;
        bad[line] = text;
        assert!(differs(&bad, &printed).is_some(), "{text}");
    }
    assert!(
        same_drawing("<path d=\"M12.5 3h4\"/>", "<path d=\"M12.6 3h4\"/>")
            && !same_drawing("<path d=\"M12.5 3\"/>", "<path d=\"M12.9 3\"/>")
    );
    assert!(!same_drawing("<a/>", "<b/>") && !same_drawing("<a x=\"1.5\"/>", "<a x=\"1.5\"/><a/>"));
    assert!(
        differs(&good[..3], &printed).is_some() && differs(&["...", "took"], &printed).is_some()
    );
}

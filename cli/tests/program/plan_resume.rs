//! `gripfast plan` killed, interrupted and resumed.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use gripfast::results::GripSet;

/// Several chunks and some seconds of one thread.
const PLAN: [&str; 19] = [
    "plan",
    "data/parts/t_slot_bar.stl",
    "--gripper",
    "generic",
    "--mass",
    "100g",
    "--loads",
    "gravity,ball:60:5N",
    "--angle-step",
    "30deg",
    "--spacing",
    "2mm",
    "--backend",
    "cpu",
    "--threads",
    "1",
    "--keep",
    "150",
    "--compare",
];

fn command(file: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gripfast"));
    command
        .current_dir(crate::support::root())
        .args(crate::support::with_flags(&PLAN, more))
        .arg("-o")
        .arg(file)
        .stdin(Stdio::null());
    command
}

fn run(file: &Path, more: &[&str]) -> Output {
    command(file, more).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn partial(file: &Path) -> PathBuf {
    file.with_extension("json.partial")
}

/// A run that has written its first state.
fn started(file: &Path) -> Child {
    let child = command(file, &["--checkpoint", "0s", "-q"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let since = Instant::now();
    while !partial(file).exists() {
        assert!(since.elapsed() < Duration::from_secs(60), "no state was written");
        std::thread::sleep(Duration::from_millis(1));
    }
    child
}

/// The bytes of a result from its part on: all but the provenance.
fn answer(file: &Path) -> String {
    let text = std::fs::read_to_string(file).unwrap();
    text[text.find("\n\"part\":").unwrap()..].to_owned()
}

fn candidates_before(stderr: &str) -> u64 {
    let line = stderr
        .lines()
        .find(|line| line.starts_with("resuming from"))
        .unwrap_or_else(|| panic!("{stderr}"));
    line.split(": ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn a_killed_run_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, file) = (folder.path().join("whole.json"), folder.path().join("grips.json"));
    let output = run(&whole, &["--checkpoint", "0s"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(!partial(&whole).exists(), "removed at the end");

    let mut child = started(&file);
    child.kill().unwrap();
    assert_eq!(child.wait().unwrap().code(), None, "it was killed");
    assert!(!file.exists() && partial(&file).exists());

    // Another question is refused, by the names of what differs, and costs nothing.
    for (more, names) in [
        (&["--mass", "200g"][..], &["loads", "mass"][..]),
        (&["--keep", "151"], &["keep (150 there, 151 here)"]),
        (&["--gripper", "robotiq-2f85"], &["gripper", "force_n"]),
        (&["--ground=-z:-1m"], &["ground"]),
        (&["--polish", "all"], &["polish (worst there, all here)"]),
    ] {
        let output = run(&file, &[&["--resume"], more].concat());
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{more:?}: {err}");
        assert!(
            err.contains("grips.json.partial") && names.iter().all(|name| err.contains(name)),
            "{more:?}: {err}"
        );
    }

    // Killed again, further on; with another number of threads it ends as if nothing had been.
    let mut child = command(&file, &["--resume", "--checkpoint", "0s", "-q"])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let (before, since) = (std::fs::read(partial(&file)).unwrap(), Instant::now());
    while std::fs::read(partial(&file)).is_ok_and(|now| now == before) {
        assert!(since.elapsed() < Duration::from_secs(60), "no state was written");
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let output = run(&file, &["--resume", "--threads", "2"]);
    let err = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{err}");
    let set = GripSet::read(&file).unwrap();
    let before = candidates_before(&err);
    assert!(
        before > 0 && before < set.summary.candidates,
        "{before} of {}",
        set.summary.candidates
    );
    assert_eq!(answer(&file), answer(&whole));
    assert!(!partial(&file).exists());
    // A kill in the middle of writing a state may leave the temporary file, and nothing else.
    let names = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert_eq!(names.filter(|name| !name.starts_with(".gripfast-")).count(), 2);
}

#[test]
fn an_interrupted_run_ranks_what_it_has_and_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("grips.json");
    let child = started(&file);
    let second = run(&file, &[]);
    assert_eq!(second.status.code(), Some(2));
    assert!(text(&second.stderr).contains("another run is writing it"));
    assert!(
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success()
    );
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(!file.exists());
    let beside = folder.path().join("grips.interrupted.json");
    let some = GripSet::read(&beside).unwrap();
    assert!(!some.provenance.complete);
    assert!(partial(&file).exists());
    let state = std::fs::read_to_string(partial(&file)).unwrap();
    let edited = state.replacen("\"mu_s\":0.", "\"mu_s\":0.000001", 1);
    assert_ne!(state, edited);
    std::fs::write(partial(&file), edited).unwrap();
    let output = run(&file, &["--resume"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("checksum"), "{}", text(&output.stderr));
    std::fs::write(partial(&file), state).unwrap();
    let output = run(&file, &["--resume"]);
    let err = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{err}");
    // A chunk that was stopped on the way is looked at once more.
    let (before, cut) = (candidates_before(&err), some.summary.rejections.get("interrupted"));
    match cut {
        Some(_) => assert!(before < some.summary.candidates, "{before}"),
        None => assert_eq!(before, some.summary.candidates),
    }
    let all = GripSet::read(&file).unwrap();
    assert!(all.provenance.complete);
    assert!(
        all.summary.candidates > some.summary.candidates
            && all.summary.ranked >= some.summary.ranked
    );
    assert!(!partial(&file).exists());
    // Finished, it is not computed again.
    let (bytes, before) = (std::fs::read(&file).unwrap(), Instant::now());
    let output = run(&file, &["--resume"]);
    let err = text(&output.stderr);
    assert!(err.contains("holds this run, finished"), "{:?}: {err}", before.elapsed());
    assert_eq!(output.status.code(), Some(0), "{err}");
    assert_eq!(std::fs::read(&file).unwrap(), bytes);
}

#[test]
fn a_terminated_run_leaves_an_older_result() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("grips.json");
    std::fs::write(&file, "older").unwrap();
    let child = started(&file);
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "older");
}

#[test]
fn what_is_no_state_is_refused_and_none_is_no_fault() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("grips.json");
    let quick = ["--spacing", "10mm", "--angle-step", "90deg", "--resume"];
    for bad in [
        "",
        "{",
        "{\"format\":\"gripfast-unfinished\",\"version\":9}",
        "{\"format\":\"gripfast-unfinished\",\"version\":1}",
        "solid box",
    ] {
        std::fs::write(partial(&file), bad).unwrap();
        let output = run(&file, &quick);
        let err = text(&output.stderr);
        assert!(
            output.status.code() == Some(2)
                && err.contains("grips.json.partial")
                && err.contains("set by: --resume"),
            "{bad}: {err}"
        );
    }
    std::fs::remove_file(partial(&file)).unwrap();
    let output = run(&file, &quick);
    assert!(
        output.status.code() == Some(0) && text(&output.stderr).contains("nothing to resume from"),
        "{}",
        text(&output.stderr)
    );
    // Left from another run and not asked for: said, then overwritten or removed.
    std::fs::write(partial(&file), "{").unwrap();
    let output = run(&file, &quick[..4]);
    assert!(
        output.status.code() == Some(0) && text(&output.stderr).contains("will be overwritten"),
        "{}",
        text(&output.stderr)
    );
    assert!(!partial(&file).exists());
}

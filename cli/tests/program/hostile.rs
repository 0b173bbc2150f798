//! Damaged and malicious input: the exit code of bad input, a message that says where, and nothing
//! that a terminal would obey.

use std::path::Path;
use std::time::Duration;

use crate::support::reference;

struct Answer {
    code: Option<i32>,
    output: String,
    errors: String,
}

/// Runs the program, which must end in time.
fn run(arguments: &[&str]) -> Answer {
    let output = assert_cmd::Command::cargo_bin("gripfast")
        .unwrap()
        .args(arguments)
        .timeout(Duration::from_secs(60))
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    Answer {
        code: output.status.code(),
        output: text(&output.stdout),
        errors: text(&output.stderr),
    }
}

/// Bad input that says all of `says` and shows no hidden character.
fn refused(arguments: &[&str], says: &[&str]) {
    let answer = run(arguments);
    assert_eq!(answer.code, Some(2), "{arguments:?}: {} {}", answer.output, answer.errors);
    for text in says {
        assert!(answer.errors.contains(text), "{arguments:?}: {}", answer.errors);
    }
    plain(&answer);
}

fn plain(answer: &Answer) {
    for text in [&answer.output, &answer.errors] {
        let hidden = |sign: char| (sign.is_control() && sign != '\n') || sign == '\u{202e}';
        assert!(!text.contains(hidden), "{text:?}");
    }
}

fn sample(name: &str) -> Option<String> {
    Some(reference(&format!("trials/hostile/{name}"))?.display().to_string())
}

#[test]
fn hostile_parts_end_with_an_error() {
    for (name, says) in [
        ("c12.3mf", &["vertex", "'1o'"][..]),
        ("t_13.3mf", &["12 finite numbers"]),
        ("pos_index.gltf", &["pos_index.gltf", "remedy"]),
        ("mult.3mf", &["memory", "--max-memory"]),
        ("esc.off", &["line 4", "\\u{1b}"]),
    ] {
        let Some(path) = sample(name) else { return };
        refused(&["part", &path], says);
    }
}

#[test]
fn coordinates_beyond_numbers_are_refused() {
    let Some(path) = sample("score_1e308.json") else { return };
    refused(&["solve", &path], &["1.000e308", "1e9 m"]);
    refused(&["score", &path], &["1.000e308", "1e9 m"]);
}

#[test]
fn a_gripper_that_talks_to_the_terminal_is_shown_as_text() {
    let Some(path) = sample("evil.toml") else { return };
    let folder = tempfile::tempdir().unwrap();
    let svg = folder.path().join("gripper.svg");
    for arguments in [
        vec!["gripper", "check", &path, "--svg", svg.to_str().unwrap()],
        vec!["gripper", "show", &path],
    ] {
        let answer = run(&arguments);
        assert_eq!(answer.code, Some(0), "{}", answer.errors);
        plain(&answer);
    }
    let svg = std::fs::read_to_string(svg).unwrap();
    assert!(!svg.contains("</script>") && !svg.contains(['\u{7}', '\u{202e}']));
}

const HEXAGON: &str = "data/parts/hex_nut.stl";

/// A short plan with these loads.
fn plan_with(loads: &str, more: &[&str]) -> Answer {
    let part = crate::support::root().join(HEXAGON).display().to_string();
    let arguments = [
        "plan",
        &part,
        "--gripper",
        "generic",
        "--mass",
        "20g",
        "--spacing",
        "9mm",
        "--angle-step",
        "90deg",
        "--loads",
        loads,
    ];
    run(&crate::support::with_flags(&arguments, more))
}

#[test]
fn names_of_loads_are_shown_as_text() {
    let (Some(escapes), Some(formulas)) = (sample("esc.csv"), sample("evil.csv")) else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    for loads in [&escapes, &formulas] {
        let (grips, page) = (file("grips.json"), file("page.html"));
        let answer = plan_with(loads, &["-o", &grips, "--report", &page]);
        assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.errors);
        plain(&answer);
        let html = std::fs::read_to_string(&page).unwrap();
        assert!(!html.contains("<img src=x") && !html.contains('\u{1b}'));
        let id = serde_json::from_slice::<serde_json::Value>(&std::fs::read(&grips).unwrap());
        let id = id.unwrap()["grips"][0]["id"].to_string();
        plain(&run(&["why", &grips, &id]));
        for format in ["isaac_grasp", "moveit"] {
            let yaml = file("grips.yaml");
            assert_eq!(run(&["export", &grips, "--format", format, "-o", &yaml]).code, Some(0));
            assert!(!std::fs::read_to_string(&yaml).unwrap().contains('\u{1b}'));
        }
    }
}

#[test]
fn a_table_for_a_spreadsheet_has_no_formula() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    let (loads, grips) = (file("loads.csv"), file("grips.json"));
    std::fs::write(&loads, "name,fx[N],fy[N],fz[N]\n=cmd|' /C calc'!A0,0,9,0\n").unwrap();
    assert!(matches!(plan_with(&loads, &["-o", &grips]).code, Some(0 | 1)));
    let cells = |more: &[&str]| {
        let mut arguments = vec!["export", &grips, "--format", "csv", "-o", "-"];
        arguments.extend(more);
        run(&arguments).output
    };
    assert!(cells(&[]).contains(",=cmd|' /C calc'!A0,"));
    let safe = cells(&["--spreadsheet"]);
    assert!(safe.contains(",'=cmd|' /C calc'!A0,") && !safe.contains(",=cmd"), "{safe}");
}

#[test]
fn a_long_run_is_not_started_by_accident() {
    let started = std::time::Instant::now();
    let answer = plan_with("ball:20000", &["--spacing", "0.03mm", "--angle-step", "1deg"]);
    assert_eq!(answer.code, Some(2), "{}", answer.errors);
    assert!(
        answer.errors.contains("hours") && answer.errors.contains("--yes"),
        "{}",
        answer.errors
    );
    assert!(started.elapsed() < Duration::from_secs(50));
    let many = plan_with("gravity", &["--threads", "100000"]);
    assert!(many.errors.contains("warning: 100000 threads"), "{}", many.errors);
    assert!(matches!(many.code, Some(0 | 1)));
}

#[test]
fn the_memory_allowed_is_a_flag() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tetrahedron.off");
    std::fs::write(
        &path,
        "OFF\n4 4 0\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n",
    )
    .unwrap();
    let path = path.to_str().unwrap();
    refused(&["part", path, "--max-memory", "500B"], &["500 B", "set by: --max-memory"]);
    refused(&["part", path, "--max-memory", "0B"], &["--max-memory"]);
    assert_eq!(run(&["part", path, "--max-memory", "1MB"]).code, Some(1)); // no pair of faces
}

#[test]
fn a_case_with_a_distance_in_millimetres_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case.json");
    let write = |d: &str| {
        let area = r#"[{"outer":[[-0.01,-0.01],[0.01,-0.01],[0.01,0.01],[-0.01,0.01]]}]"#;
        let text =
            format!(r#"{{"A_I":{area},"A_II":{area},{d},"Fn":100,"F":[1,0,0],"M":[0,0,0.1]}}"#);
        std::fs::write(&path, text).unwrap();
    };
    let name = path.to_str().unwrap();
    write(r#""d":20"#);
    refused(&["solve", name], &["d is 20 m"]);
    write(r#""d":0.02,"m":[0,0,9]"#);
    refused(&["solve", name], &["key 'm'", "'M'"]);
    write(r#""d":1e400"#);
    refused(&["solve", name], &["case.json", "out of range"]);
    write(r#""d":0.02,"note":"a case""#);
    assert_eq!(run(&["solve", name]).code, Some(0));
}

#[cfg(unix)]
#[test]
fn devices_are_no_input() {
    for arguments in [
        &["solve", "/dev/zero"][..],
        &["gripper", "check", "/dev/zero"],
        &["plan", "/dev/zero", "--gripper", "generic", "--mass", "1kg"],
    ] {
        let answer = run(arguments);
        assert_eq!(answer.code, Some(2), "{arguments:?}: {}", answer.errors);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_and_a_closed_pipe_are_no_panic() {
    use std::process::{Command, Stdio};
    let program = assert_cmd::cargo::cargo_bin("gripfast");
    let full = || std::fs::File::options().write(true).open("/dev/full").unwrap();
    for arguments in [&["gripper", "list"][..], &["gripper", "show", "generic"]] {
        let output =
            Command::new(&program).args(arguments).stdout(full()).stderr(Stdio::piped()).output();
        let output = output.unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(String::from_utf8_lossy(&output.stderr).starts_with("error: "));
        let mut child = Command::new(&program)
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
        assert!(output.stderr.is_empty());
    }
    assert!(Path::new("/dev/full").exists());
}

#[cfg(feature = "step")]
#[test]
fn a_crash_of_the_cad_kernel_is_an_error_that_names_file_and_stage() {
    let Some(path) = sample("segv.step") else { return };
    refused(&["part", &path], &["segv.step", "the CAD kernel crashed while"]);
    let Some(good) = reference("parts/gen") else { return };
    let good = std::fs::read_dir(good).unwrap().map(|entry| entry.unwrap().path());
    let good =
        good.into_iter().find(|path| path.extension().is_some_and(|suffix| suffix == "step"));
    let good = good.unwrap().display().to_string();
    let answer = run(&["part", &good]);
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.errors);
    assert!(answer.output.contains("planar faces"), "{}", answer.output);
    assert!(answer.output.contains("as the file states them"), "{}", answer.output);
    refused(&["part", &good, "--max-memory", "1MB"], &["remedy"]);
    // Started under a limit of its own (a batch system, a container), lower than the one allowed.
    let program = assert_cmd::cargo::cargo_bin("gripfast").display().to_string();
    let line = format!("ulimit -v 8000000; exec '{program}' part '{good}' --max-memory 12GB");
    let output = std::process::Command::new("sh").args(["-c", &line]).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{errors}");
}

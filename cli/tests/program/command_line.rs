//! The program as a user runs it.

use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use gripfast::results::GripSet;

fn gripfast(arguments: &[&str]) -> Output {
    Command::cargo_bin("gripfast")
        .unwrap()
        .current_dir(crate::support::root())
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn plan(part: &str, more: &[&str]) -> (Output, Option<GripSet>) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("grips.json");
    let mut arguments = vec!["plan", part, "--backend", "cpu", "-q", "-o", file.to_str().unwrap()];
    arguments.extend(more);
    let output = gripfast(&arguments);
    let set = file.exists().then(|| GripSet::read(&file).unwrap());
    (output, set)
}

#[test]
fn plan_on_the_shipped_bracket_gives_grips_that_hold_it() {
    let (output, set) = plan(
        "data/parts/l_bracket.stl",
        &[
            "--gripper",
            "robotiq-2f85",
            "--mass",
            "350g",
            "--angle-step",
            "45deg",
            "--spacing",
            "8mm",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let set = set.unwrap();
    assert!(set.grips.len() > 20 && set.summary.ranked >= set.grips.len() as u64);
    assert!(text(&output.stdout).contains("mu_s"));
    // What is counted adds up.
    let rejected: u64 = set
        .summary
        .rejections
        .iter()
        .filter(|(reason, _)| !reason.starts_with("face_pair"))
        .map(|(_, count)| count)
        .sum();
    assert_eq!(set.summary.candidates, set.summary.ranked + rejected);
    for pair in set.grips.windows(2) {
        assert!(pair[0].score.unwrap() >= pair[1].score.unwrap() * (1.0 - 1e-9), "best first");
    }
    for grip in &set.grips {
        let mu = grip.worst.mu_s.unwrap();
        // The two pads carry at most 2 Fn mu; the weight alone needs that much in some direction.
        assert!(mu >= 0.35 * 9.80665 / (2.0 * 235.0) * 0.999_999, "{mu}");
        assert!(grip.worst.residual < 1e-10);
        assert!(grip.worst.bounds.unwrap().upper >= mu * (1.0 - 1e-12));
        let frame = grip.grip.part_from_grip.rotation;
        assert!((frame.determinant() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_answer_depends_neither_on_threads_nor_on_seeds() {
    let settings = [
        "--gripper",
        "generic",
        "--mass",
        "100g",
        "--loads",
        "gravity,ball:60:5N",
        "--angle-step",
        "90deg",
        "--spacing",
        "6mm",
    ];
    let run = |more: &[&str]| {
        plan("data/parts/t_slot_bar.stl", &[&settings[..], more].concat()).1.unwrap()
    };
    let one = run(&["--threads", "1"]);
    let two = run(&["--threads", "2"]);
    assert_eq!(one.grips, two.grips);
    let all = run(&["--polish", "all", "--seeds", "200"]);
    assert_eq!(one.grips.len(), all.grips.len());
    for (a, b) in one.grips.iter().zip(&all.grips) {
        assert_eq!((a.grip.id, a.worst.load), (b.grip.id, b.worst.load));
        let (x, y) = (a.worst.mu_s.unwrap(), b.worst.mu_s.unwrap());
        assert!((x - y).abs() <= 1e-9 * y, "{x} {y}");
    }
}

#[test]
fn every_real_part_ends_with_a_list_or_a_clear_reason() {
    let Some(folder) = crate::support::reference("parts") else { return };
    let mut parts: Vec<PathBuf> = ["parts", "gen"]
        .iter()
        .flat_map(|sub| std::fs::read_dir(folder.join(sub)).unwrap())
        .map(|entry| entry.unwrap().path())
        .collect();
    let mesh = |path: &PathBuf| {
        path.extension().is_some_and(|suffix| {
            ["stl", "obj", "3mf", "step"]
                .contains(&suffix.to_string_lossy().to_lowercase().as_str())
        })
    };
    parts.retain(mesh);
    parts.sort();
    assert!(parts.len() > 20);
    for part in parts {
        let name = part.display().to_string();
        let unit =
            if part.metadata().unwrap().len() > 0 && is_in_metres(&part) { "m" } else { "mm" };
        let more = [
            "--gripper",
            "generic",
            "--density",
            "2700kg/m3",
            "--angle-step",
            "90deg",
            "--spacing",
            "10mm",
            "--keep",
            "50",
            "--unit",
            unit,
        ];
        let (output, _) = plan(&name, &more);
        let (code, out, err) = (output.status.code(), text(&output.stdout), text(&output.stderr));
        assert!(!err.contains("panicked") && matches!(code, Some(0..=2)), "{name}: {code:?} {err}");
        match code {
            Some(0) => assert!(out.contains("rank"), "{name}: {out}"),
            Some(1) => assert!(out.contains("no grip holds this part"), "{name}: {out}"),
            _ => assert!(err.contains("error: ") && err.contains("remedy"), "{name}: {err}"),
        }
    }
}

/// Files of the robot simulators are in metres; they do not say so.
fn is_in_metres(part: &Path) -> bool {
    let name = part.file_name().unwrap().to_string_lossy().into_owned();
    ["ariac", "erd", "isaac", "robotiq", "o2ac__shaft"].iter().any(|start| name.starts_with(start))
}

#[test]
fn bad_input_names_the_place_and_the_remedy() {
    let base = ["plan", "data/parts/hex_nut.stl", "--gripper", "generic"];
    for (more, needle) in [
        (vec![], "--mass"),
        (vec!["--mass", "350"], "no unit"),
        (vec!["--mass=-3g"], "above zero"),
        (vec!["--mass", "20g", "--force", "1e9N"], "outside what"),
        (vec!["--mass", "20g", "--loads", "bell:3"], "bell"),
        (vec!["--mass", "20g", "--loads", "nowhere.csv"], "nowhere.csv"),
        (vec!["--mass", "20g", "--spacing", "0mm"], "spacing"),
        (
            vec!["--mass", "20g", "--backend", "gpu", "--adapter", "no such adapter"],
            "no such adapter",
        ),
    ] {
        let output = gripfast(&[&base[..], &more].concat());
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{more:?}: {err}");
        assert!(err.contains(needle) && !err.contains("panicked"), "{more:?}: {err}");
    }
    let output = gripfast(&["plan", "nothing.stl", "--gripper", "generic", "--mass", "1kg"]);
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("nothing.stl"));
    let output =
        gripfast(&["plan", "data/parts/hex_nut.stl", "--gripper", "robotic-2f85", "--mass", "1kg"]);
    assert!(
        output.status.code() == Some(2) && text(&output.stderr).to_lowercase().contains("robotiq"),
        "suggests the near name"
    );
}

#[test]
fn solve_answers_in_order_as_json_lines() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cases.json");
    let square = r#"[{"outer":[[-0.01,-0.01],[0.01,-0.01],[0.01,0.01],[-0.01,0.01]],"holes":[]}]"#;
    let case = |m3: f64| {
        format!(
            r#"{{"A_I":{square},"A_II":{square},"d":0.02,"Fn":50,"F":[0,0,0],"M":[0,0,{m3}],"note":"ignored"}}"#
        )
    };
    std::fs::write(&file, format!(r#"{{"cases":[{},{}]}}"#, case(0.2), case(-0.1))).unwrap();
    let output = gripfast(&["solve", file.to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let lines: Vec<serde_json::Value> =
        text(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 2);
    let exact = 0.2 / (2.0 * 50.0 * 0.02 * 0.382_597_858_232_106_346);
    assert!((lines[0]["mu_s"].as_f64().unwrap() / exact - 1.0).abs() < 1e-12);
    assert_eq!(lines[1]["slip"]["sense"], -1);
    for key in [
        "status",
        "mu_s",
        "slip",
        "pressure",
        "contact_area_I",
        "contact_area_II",
        "residual",
        "bounds",
    ] {
        assert!(!lines[0][key].is_null(), "{key}");
    }
    std::fs::write(&file, "{\"A_I\": 3}").unwrap();
    let output = gripfast(&["solve", file.to_str().unwrap()]);
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("cases.json"));
}

#[test]
fn why_explains_a_grip_and_a_rejected_pose() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("grips.json");
    let path = file.to_str().unwrap();
    let base = [
        "plan",
        "data/parts/l_bracket.stl",
        "--gripper",
        "robotiq-2f85",
        "--mass",
        "350g",
        "--backend",
        "cpu",
        "-q",
    ];
    let output = gripfast(
        &[&base[..], &["--angle-step", "90deg", "--spacing", "10mm", "-o", path]].concat(),
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let id = GripSet::read(&file).unwrap().grips[0].grip.id.to_string();
    let output = gripfast(&["why", path, &id]);
    let out = text(&output.stdout);
    assert!(
        output.status.success()
            && out.contains("free of interference")
            && out.contains("certified"),
        "{out}{}",
        text(&output.stderr)
    );
    let output = gripfast(&[&base[..], &["--why", "500mm,0mm,0deg,0"]].concat());
    assert!(
        output.status.code() == Some(1) && text(&output.stdout).contains("rejected"),
        "{}",
        text(&output.stdout)
    );
    assert_eq!(gripfast(&["why", path, "99999999"]).status.code(), Some(2));
}

#[test]
fn what_is_missing_is_told_with_where_it_comes_from() {
    for (arguments, word) in [
        (&["plan", "data/parts/hex_nut.stl"][..], "gripfast gripper list"),
        (&["pick", "grips.json"][..], "a scene file says"),
    ] {
        let output = gripfast(arguments);
        let told = text(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(word), "{told}");
    }
}

#[test]
fn the_version_names_what_the_build_has() {
    let said = |flag: &str| String::from_utf8(gripfast(&[flag]).stdout).unwrap();
    let version = concat!("gripfast ", env!("CARGO_PKG_VERSION"));
    assert_eq!(said("-V").trim_end(), version);
    let long = said("--version");
    assert!(long.starts_with(version), "{long}");
    for (name, has) in [
        ("gpu", cfg!(feature = "gpu")),
        ("parquet", cfg!(feature = "parquet")),
        ("hdf5", cfg!(feature = "hdf5")),
        ("step", cfg!(feature = "step")),
    ] {
        let line = long.lines().find(|line| line.split(' ').any(|word| word == name));
        let begin = if has { "features: " } else { "not in this build: " };
        assert!(line.is_some_and(|line| line.starts_with(begin)), "{name}: {long}");
    }
}

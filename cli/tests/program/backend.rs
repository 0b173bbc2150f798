//! `gripfast score`, `bench` and `devices` from outside.

use assert_cmd::Command;
use serde_json::{Value, json};

fn gripfast(arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("gripfast").unwrap();
    command
        .args(arguments)
        .env_remove("GRIPFAST_ADAPTER")
        .env_remove("WGPU_ADAPTER_NAME")
        .current_dir(std::env::temp_dir());
    command
}

/// Standard output and error of a run that must end with `code`.
fn run(arguments: &[&str], input: &str, code: i32) -> (String, String) {
    let output = gripfast(arguments).write_stdin(input).assert().code(code).get_output().clone();
    (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn pair(shift: f64) -> Value {
    let square = |x: f64| json!([{ "outer": [[x - 0.01, -0.01], [x + 0.01, -0.01], [x + 0.01, 0.01], [x - 0.01, 0.01]] }]);
    json!({ "A_I": square(0.0), "A_II": square(shift), "d": 0.02, "Fn": 50.0, "F": [5.0, 0.0, 0.0], "M": [0.0, 0.0, 0.2] })
}

#[test]
fn score_gives_what_solve_gives() {
    let Some(path) = crate::support::reference("cases/reference.json") else { return };
    let path = path.canonicalize().unwrap();
    let path = path.to_str().unwrap();
    let (scored, _) = run(&["score", path, "--backend", "cpu", "--quiet"], "", 0);
    let (solved, _) = run(&["solve", path, "--json"], "", 0);
    let (scored, solved) = (lines(&scored), lines(&solved));
    assert_eq!(scored.len(), solved.len());
    for (a, b) in scored.iter().zip(&solved) {
        assert_eq!(
            (&a["id"], &a["status"], &a["load"]),
            (&b["id"], &b["status"], &json!(0)),
            "{a} {b}"
        );
        match (a["mu_s"].as_f64(), b["mu_s"].as_f64()) {
            (Some(x), Some(y)) => assert!((x - y).abs() <= 1e-12 * y.abs(), "{a} {b}"),
            (x, y) => assert_eq!(x, y),
        }
    }
}

#[test]
fn json_lines_lists_and_own_loads_give_the_same_answers() {
    let (a, mut b) = (pair(0.0), pair(0.004));
    let json_lines = format!("{a}\n\n{b}\n");
    let (from_lines, summary) = run(&["score", "-", "--backend", "cpu"], &json_lines, 0);
    assert!(
        summary.contains("backend cpu: asked for") && summary.contains("2 grips, 2 loads"),
        "{summary}"
    );
    assert_eq!(
        from_lines,
        run(&["score", "-", "--backend", "cpu"], &json!([a, b]).to_string(), 0).0
    );
    assert_eq!(
        from_lines,
        run(&["score", "-", "--backend", "cpu"], &json!({ "cases": [a, b] }).to_string(), 0).0
    );
    assert_eq!(from_lines, run(&["score", "-"], &json_lines, 0).0.as_str());
    b["loads"] = json!([{ "F": [1.0, 0.0, 0.0] }, { "F": [5.0, 0.0, 0.0], "M": [0.0, 0.0, 0.2] }]);
    let own =
        lines(&run(&["score", "-", "--backend", "cpu", "--polish", "all"], &b.to_string(), 0).0);
    assert_eq!(own[0]["load"], 1);
    assert_eq!(own[0]["mu_s"], lines(&from_lines)[1]["mu_s"]);
    assert_eq!(own[0]["mu_by_load"].as_array().unwrap().len(), 2);
}

#[test]
fn common_loads_replace_the_pairs_own() {
    let pairs = format!("{}\n{}\n", pair(0.0), pair(0.0));
    let (text, _) = run(&["score", "-", "--backend", "cpu", "--loads", "ball:50"], &pairs, 0);
    let found = lines(&text);
    assert!(found[0]["load_name"].as_str().unwrap().contains("ball"), "{text}");
    assert_eq!(found[0]["mu_s"], found[1]["mu_s"]);
    // Unit forces at the middle of the pads: the worst is a pure slide at F/(2 Fn).
    let mu = found[0]["mu_s"].as_f64().unwrap();
    assert!((0.0099..=0.01).contains(&mu), "{mu}");
    let folder = tempfile::tempdir().unwrap();
    let (loads, out) = (folder.path().join("loads.csv"), folder.path().join("out.jsonl"));
    std::fs::write(
        &loads,
        "fx [N],fy [N],fz [N],mx [Nm],my [Nm],mz [Nm]\n5,0,0,0,0,0.2\n1,0,0,0,0,0\n",
    )
    .unwrap();
    run(
        &[
            "score",
            "-",
            "--backend",
            "cpu",
            "--loads",
            loads.to_str().unwrap(),
            "-o",
            out.to_str().unwrap(),
        ],
        &pairs,
        0,
    );
    let from_file = lines(&std::fs::read_to_string(&out).unwrap());
    assert_eq!((from_file.len(), &from_file[0]["load"]), (2, &json!(0)));
    let (refused, why) = run(&["score", "-", "--backend", "cpu", "--loads", "gravity"], &pairs, 2);
    assert!(refused.is_empty() && why.contains("mass"), "{why}");
}

#[test]
fn bad_input_is_named_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.jsonl");
    let mut unfit = pair(0.0);
    unfit["Fn"] = json!(-1.0);
    for (input, word) in [
        (String::new(), "empty"),
        ("not json".to_owned(), "JSON"),
        (format!("{}\nbroken\n", pair(0.0)), "line 2"),
        (format!("{}\n{}\n", pair(0.0), json!({ "A_I": [] })), "line 2"),
        (unfit.to_string(), "gripping force"),
        (json!({ "A_I": [], "A_II": [], "d": 1, "Fn": 1, "loads": 3 }).to_string(), "loads"),
        ("7".to_owned(), "neither"),
    ] {
        let (_, why) =
            run(&["score", "-", "--backend", "cpu", "-o", out.to_str().unwrap()], &input, 2);
        assert!(why.contains(word), "{why}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{word}");
    }
    let (_, why) = run(&["score", "no_such_file.json"], "", 2);
    assert!(why.contains("no_such_file.json"), "{why}");
    // Nothing held is exit code 1.
    let nothing = json!({ "A_I": [], "A_II": [], "d": 1, "Fn": 1, "F": [1, 0, 0], "M": [0, 0, 0] });
    assert!(
        run(&["score", "-", "--backend", "cpu"], &nothing.to_string(), 1).0.contains("no_contact")
    );
}

#[test]
fn a_missing_gpu_is_an_error_and_auto_says_why_not() {
    // An interface that no machine has together with these tests.
    let none = if cfg!(target_os = "macos") { "vulkan" } else { "metal" };
    let case = pair(0.0).to_string();
    let with = |arguments: &[&str]| {
        let mut command = gripfast(arguments);
        command.env("WGPU_BACKEND", none).write_stdin(case.clone());
        command
    };
    let output = with(&["score", "-", "--backend", "gpu"]).assert().code(2).get_output().clone();
    assert!(String::from_utf8(output.stderr).unwrap().contains("GPU") || output.stdout.is_empty());
    let output = with(&["score", "-"]).assert().code(0).get_output().clone();
    assert!(String::from_utf8(output.stderr).unwrap().contains("backend cpu: auto"));
    for arguments in
        [["score", "-", "--adapter", "no such adapter"], ["score", "-", "--backend", "tpu"]]
    {
        with(&arguments).assert().code(2);
    }
    with(&["score", "-", "--backend", "cpu", "--adapter", "0"]).assert().code(2);
}

#[test]
fn devices_and_bench_write_json() {
    let output = gripfast(&["devices", "--json"]).assert().get_output().clone();
    let devices: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(if devices.is_empty() { 1 } else { 0 }));
    for device in &devices {
        assert!(
            device["name"].is_string() && device["max_binding"].as_u64().unwrap() > 0,
            "{device}"
        );
        assert!(device["kind"] != "software" || device["counts_as_gpu"] == false, "{device}");
    }
    let mut arguments = vec![
        "bench",
        "--json",
        "--seconds",
        "0.001",
        "--grips",
        "40",
        "--loads",
        "50",
        "--seeds",
        "21",
    ];
    if devices.is_empty() {
        crate::support::say("SKIPPED: no graphics adapter, bench runs on the processor alone");
    } else {
        arguments.extend(["--adapter", "0"]);
    }
    let report: Value = serde_json::from_str(&run(&arguments, "", 0).0).unwrap();
    assert_eq!(report["agreed"], true, "{report}");
    let results = report["results"].as_array().unwrap();
    assert_eq!(results.len(), 7 * if devices.is_empty() { 1 } else { 2 });
    assert!(results.iter().all(|row| row["loads_per_second"].as_f64().unwrap() > 0.0), "{report}");
    // A grip takes a pose up and few of its loads down, on an adapter only.
    for row in results.iter().filter(|row| row["workload"] != "solve_all") {
        let bytes = ["bytes_up_per_grip", "bytes_down_per_grip"].map(|key| row[key].as_f64());
        assert_eq!(bytes[0].is_some(), row["backend"] != "cpu", "{row}");
        assert!(bytes.iter().flatten().all(|bytes| (8.0..1600.0).contains(bytes)), "{row}");
    }
}

/// `benches/device.sh` in seconds, with this build's program and without the test binary.
#[cfg(target_os = "linux")]
fn device_script(out: &std::path::Path, seconds: &str, adapter: &str, lose: &str) -> (i32, String) {
    let script = crate::support::root().join("benches/device.sh");
    let output = std::process::Command::new("bash")
        .arg(script)
        .args(["--seconds", seconds, adapter])
        .env("OUT", out)
        .env("GRIPFAST", assert_cmd::cargo::cargo_bin("gripfast"))
        .env("SUITE", "")
        .env("LOSE", lose)
        .env_remove("GRIPFAST_ADAPTER")
        .env_remove("WGPU_ADAPTER_NAME")
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code().unwrap(), String::from_utf8_lossy(&said).into_owned())
}

#[cfg(target_os = "linux")]
fn entry(out: &std::path::Path) -> (Value, String) {
    let file = std::fs::File::open(out.join("entry.json")).unwrap();
    (serde_json::from_reader(file).unwrap(), std::fs::read_to_string(out.join("entry.md")).unwrap())
}

#[cfg(target_os = "linux")]
#[test]
fn the_device_script_measures_an_adapter_and_says_what_it_had_no_time_for() {
    let folder = tempfile::tempdir().unwrap();
    let output = gripfast(&["devices", "--json"]).assert().get_output().clone();
    let devices: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let Some(device) = devices.first() else {
        crate::support::say("SKIPPED: no graphics adapter for the device script");
        return;
    };
    let name = device["name"].as_str().unwrap();
    let (code, said) = device_script(folder.path(), "25", name, "");
    // Cut off or whole, by how busy the machine is; never for another reason.
    assert!(code == 0 || code == 1 && !said.contains("FAILED"), "{code}: {said}");
    if said.contains("check: cut off") || said.contains("sweep: cut off") {
        crate::support::say("SKIPPED: the machine is too busy for the device script's short run");
        return;
    }
    let (entry, text) = entry(folder.path());
    let adapter = entry["adapter"].as_str().unwrap();
    assert!(adapter.starts_with(name), "{adapter}");
    assert_eq!(entry["software_adapter"], device["kind"] == "software");
    assert!(text.starts_with("## ") && text.contains(adapter), "{text}");
    let check = &entry["parts"]["check"];
    assert!(check["passed"] == true && check["kernels"][0][1]["largest"].as_f64().unwrap() > 0.0);
    let rows = entry["parts"]["sweep"]["rows"].as_array().unwrap();
    assert!(rows.len() >= 3 && rows.iter().any(|row| row["on"] == "adapter"), "{rows:?}");
    for row in rows {
        let measured = row["loads_per_second"].as_f64().unwrap() > 0.0;
        assert!(measured || row["left_out"].is_string(), "{row}");
        assert!(!row["left_out"].as_str().unwrap_or_default().starts_with("DIFFERS"), "{row}");
    }
    let names: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    assert!(names.iter().all(|name| !name.starts_with('.')), "{names:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn the_device_script_says_what_is_wrong_and_runs_what_it_can() {
    let folder = tempfile::tempdir().unwrap();
    let (code, said) = device_script(folder.path(), "8", "no such adapter", "");
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("no adapter is called `no such adapter`"), "{said}");
    let (found, text) = entry(folder.path());
    assert!(text.contains("no adapter is called"), "{text}");
    assert!(found["parts"]["sweep"]["rows"].as_array().is_some_and(|rows| !rows.is_empty()));
    let output = gripfast(&["devices", "--json"]).assert().get_output().clone();
    let devices: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let Some(device) = devices.first() else { return };
    // A device that goes in the sweep: the part says so, the others run.
    let (code, said) = device_script(folder.path(), "12", device["name"].as_str().unwrap(), "2");
    assert_eq!(code, 1, "{said}");
    if said.contains("check: cut off") || said.contains("sweep: cut off") {
        crate::support::say("SKIPPED: the machine is too busy for the device script's short run");
        return;
    }
    assert!(said.contains("the graphics processor was lost"), "{said}");
    let (found, _) = entry(folder.path());
    assert!(found["parts"]["sweep"]["failure"].as_str().unwrap().contains("lost"), "{found}");
    assert_eq!(found["parts"]["check"]["passed"], true);
    // No folder to write to.
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let (code, said) = device_script(&file, "5", "0", "");
    assert!(code == 2 && said.contains("output folder"), "{said}");
}

/// `--polish top` prints the table of `--polish worst` and says how many grips it left out.
#[test]
fn polish_top_gives_the_same_best_grips() {
    let bracket = crate::support::root().join("data/parts/l_bracket.stl");
    let bracket = bracket.to_str().unwrap();
    let plan = |more: &[&str]| {
        let common = [
            "plan",
            bracket,
            "--gripper",
            "robotiq-2f85",
            "--mass",
            "350g",
            "--backend",
            "cpu",
            "--loads",
            "ball:60",
            "--spacing",
            "6mm",
            "--json",
            "-q",
        ];
        let arguments: Vec<&str> = common.iter().chain(more).copied().collect();
        let set: Value = serde_json::from_str(&run(&arguments, "", 0).0).unwrap();
        set
    };
    let numbers =
        |set: &Value| set["grips"].as_array().unwrap().iter().take(7).cloned().collect::<Vec<_>>();
    let whole = plan(&["--top", "7"]);
    let held = whole["grips"].as_array().unwrap().len() as u64;
    for threads in ["1", "3"] {
        let best = plan(&["--top", "7", "--polish", "top", "--threads", threads]);
        assert_eq!(numbers(&best), numbers(&whole));
        assert_eq!(best["grips"].as_array().unwrap().len(), 7);
        let (solved, left) = (
            best["summary"]["ranked"].as_u64().unwrap(),
            best["summary"]["rejections"]["outranked"].as_u64().unwrap(),
        );
        assert!(solved + left == held && left > held / 2, "{solved} and {left} of {held}");
    }
    // Enough kept for a choice of grips that differ, and a word in the table.
    let common = [
        "plan",
        bracket,
        "--gripper",
        "robotiq-2f85",
        "--mass",
        "350g",
        "--backend",
        "cpu",
        "--loads",
        "ball:60",
        "--spacing",
        "4mm",
        "-q",
    ];
    let with = |more: &[&'static str]| [common.as_slice(), more].concat();
    assert_eq!(
        run(&with(&["--diverse", "--polish", "top"]), "", 0).0,
        run(&with(&["--diverse"]), "", 0).0
    );
    assert!(run(&with(&["--polish", "top"]), "", 0).0.contains("more were not solved"));
    assert!(
        run(&with(&["--polish", "top", "--k1=-1"]), "", 2)
            .1
            .contains("use 'worst'\n  set by: --polish, --k1")
    );
}

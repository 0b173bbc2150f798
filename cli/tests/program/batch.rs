//! `gripfast batch`: killed, resumed, with bad parts, and against `plan`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gripfast::results::GripSet;
use serde_json::Value;

/// What makes a job quick.
const COARSE: [&str; 10] = [
    "--spacing",
    "8mm",
    "--angle-step",
    "45deg",
    "--loads",
    "gravity",
    "--backend",
    "cpu",
    "--density",
    "2700kg/m3",
];

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gripfast"));
    command.current_dir(crate::support::root()).arg("batch").args(arguments).stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The data sets in a folder: every file with its content, but for the manifest.
fn data(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn walk(folder: &Path, root: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, root, found);
            } else {
                let name = path.strip_prefix(root).unwrap().to_owned();
                // Times, and the order in which jobs ended.
                if name != Path::new("manifest.jsonl") && name != Path::new("shards.jsonl") {
                    found.insert(name, std::fs::read(path).unwrap());
                }
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(folder, folder, &mut found);
    found
}

fn lines(path: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The last word of the manifest on each job.
fn manifest(folder: &Path) -> BTreeMap<String, Value> {
    let name = |entry: &Value| {
        ["part", "gripper", "loads"].map(|field| entry[field].as_str().unwrap()).join(" / ")
    };
    lines(&folder.join("manifest.jsonl")).into_iter().map(|entry| (name(&entry), entry)).collect()
}

#[test]
fn one_bad_part_stops_nothing_and_every_job_says_what_became_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let (parts, out) = (folder.path().join("parts"), folder.path().join("out"));
    std::fs::create_dir_all(parts.join("sub")).unwrap();
    let data_parts = crate::support::root().join("data/parts");
    std::fs::copy(data_parts.join("hex_nut.stl"), parts.join("nut.stl")).unwrap();
    std::fs::copy(data_parts.join("shaft_key.stl"), parts.join("sub/key.STL")).unwrap();
    std::fs::write(parts.join("broken.stl"), "solid broken\nfacet normal 0 0\n").unwrap();
    std::fs::write(parts.join("nothing.obj"), "").unwrap();
    std::fs::write(parts.join("notes.txt"), "no part").unwrap();
    // A tetrahedron has no two opposite faces.
    std::fs::write(
        parts.join("tetra.off"),
        "OFF\n4 4 0\n0 0 0\n20 0 0\n0 20 0\n0 0 20\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
    )
    .unwrap();
    let (parts, out_text) = (parts.to_str().unwrap(), out.to_str().unwrap());
    let base: Vec<&str> = [
        &[parts, "--gripper", "generic", "--gripper", "franka-hand", "-o", out_text][..],
        &COARSE,
        &["--top-k", "7", "--negatives", "12"],
    ]
    .concat();
    let output = run(&base);
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{stdout}{stderr}");
    assert!(stdout.contains("10 jobs: 4 with grips, 2 without, 4 failed"), "{stdout}");
    assert!(stdout.contains("broken.stl / generic / gravity: "), "{stdout}");
    assert_eq!(stderr.lines().filter(|line| line.starts_with('[')).count(), 10, "{stderr}");

    let entries = manifest(&out);
    assert_eq!(entries.len(), 10);
    let mut fewer = 0;
    for (id, entry) in &entries {
        let outcome = match id.split('.').next().unwrap() {
            "nut" | "sub/key" => "grips",
            "tetra" => "empty",
            _ => "failed",
        };
        assert_eq!(entry["outcome"], outcome, "{id}");
        assert!(entry["seconds"].as_f64().unwrap() > 0.0 && entry["gripfast"].is_string());
        assert_eq!(entry["request"]["density"], "2700kg/m3");
        match outcome {
            "failed" => {
                let error = &entry["error"];
                assert!(error["problem"].as_str().unwrap().len() > 5, "{error}");
                assert!(error["place"].as_str().unwrap().contains("parts"), "{error}");
                let kind = error["kind"].as_str().unwrap();
                assert!(["format", "geometry"].contains(&kind), "{id}: {error}");
            }
            "empty" => {
                assert!(entry["reason"].as_str().unwrap().contains("opposite faces"), "{entry}");
                assert_eq!(entry["health"]["watertight"], true);
            }
            _ => {
                assert_eq!(entry["health"]["watertight"], true);
                assert_eq!(entry["health"]["warnings"], serde_json::json!([]));
                assert_eq!(entry["grips"], 7);
                // As many as were asked for, where so many candidates fell.
                let negatives = entry["negatives"].as_u64().unwrap();
                assert!((1..=12).contains(&negatives), "{id}: {negatives}");
                fewer += usize::from(negatives < 12);
                assert!(entry["best_mu_s"].as_f64().unwrap() > 0.0);
            }
        }
    }

    assert!(fewer <= 2, "{fewer}");

    // The rows are the grips of `plan`, number for number.
    let file = folder.path().join("plan.json");
    let planned = Command::new(env!("CARGO_BIN_EXE_gripfast"))
        .current_dir(crate::support::root())
        .args(["plan", &format!("{parts}/nut.stl"), "--gripper", "generic", "-q", "-o"])
        .arg(&file)
        .args(COARSE)
        .args(["--negatives", "12"])
        .output()
        .unwrap();
    assert_eq!(planned.status.code(), Some(0), "{}", text(&planned.stderr));
    let set = GripSet::read(&file).unwrap();
    let of_nut = |rows: Vec<Value>| -> Vec<Value> {
        rows.into_iter().filter(|row| row["part"] == "nut.stl").collect()
    };
    let rows = of_nut(lines(&out.join("grips.jsonl/gripper=generic/00000.jsonl")));
    assert_eq!(rows.len(), 7);
    for (row, grip) in rows.iter().zip(&set.grips) {
        let Value::Object(grip) = serde_json::to_value(grip).unwrap() else { panic!() };
        for (field, value) in grip {
            assert_eq!(row[&field], value, "{field}");
        }
        assert_eq!((&row["gripper"], &row["loads"]), (&"generic".into(), &"gravity".into()));
        assert!(row["load_name"].as_str().unwrap().starts_with("gravity"));
        // The symmetries of the nut: the best grips are one family.
        assert!(rows.iter().any(|other| other["id"] == row["family"]));
    }
    assert!(rows.iter().skip(1).any(|row| row["family"] == rows[0]["id"]));
    let negatives = of_nut(lines(&out.join("negatives.jsonl/gripper=generic/00000.jsonl")));
    assert_eq!(negatives.len(), set.negatives.len());
    for (row, negative) in negatives.iter().zip(&set.negatives) {
        assert_eq!(row["id"], negative.id);
        assert!(set.summary.rejections.contains_key(row["reason"].as_str().unwrap()), "{row}");
    }
    assert_eq!(
        out.join("grips.parquet/gripper=franka-hand/00000.parquet").exists(),
        cfg!(feature = "parquet")
    );

    // Policies, and failed jobs are tried again: now one part is mended.
    let again = |more: &[&str]| run(&[&base[..], &["--resume", "-q"], more].concat());
    assert_eq!(again(&["--fail-on", "none"]).status.code(), Some(0));
    std::fs::copy(data_parts.join("hex_nut.stl"), format!("{parts}/broken.stl")).unwrap();
    std::fs::copy(data_parts.join("hex_nut.stl"), format!("{parts}/nothing.obj")).unwrap();
    assert_eq!(again(&[]).status.code(), Some(2), "an STL under the name of an OBJ");
    std::fs::write(
        format!("{parts}/nothing.obj"),
        "v 0 0 0\nv 20 0 0\nv 0 20 0\nv 0 0 20\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    )
    .unwrap();
    let output = again(&["--fail-on", "empty"]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stdout));
    assert_eq!(again(&[]).status.code(), Some(0));
    let rows = lines(&out.join("grips.jsonl/gripper=generic/00000.jsonl"));
    assert_eq!(rows.iter().filter(|row| row["part"] == "broken.stl").count(), 7);
    assert!(!out.join("work").exists(), "nothing is left over");

    // Another batch does not mix with this one.
    let output = run(&base);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--resume"), "{}", text(&output.stderr));
    let other: Vec<&str> = base
        .iter()
        .map(|word| if *word == "7" { "8" } else { *word })
        .chain(["--resume"])
        .collect();
    let output = run(&other);
    assert!(text(&output.stderr).contains("options"), "{}", text(&output.stderr));
    let output = again(&["--gripper", "robotiq-2f85"]);
    let stderr = text(&output.stderr);
    assert!(stderr.contains("grippers (2") && stderr.contains("here"), "{stderr}");
}

/// Jobs of about a tenth of a second and more.
fn many(out: &Path, more: &[&str]) -> Command {
    let parts = ["hex_nut", "l_bracket", "pocket_plate", "shaft_key", "t_slot_bar"];
    let parts = parts.map(|name| format!("data/parts/{name}.stl"));
    let mut command = command(&["-o", out.to_str().unwrap(), "-q"]);
    command
        .args(parts)
        .args(["--gripper", "generic", "--gripper", "robotiq-2f85", "--density", "2700kg/m3"])
        .args(["--loads", "gravity", "--loads", "ball:20:5N", "--spacing", "6mm"])
        .args(["--angle-step", "45deg", "--backend", "cpu", "--negatives", "9", "--top-k", "20"])
        .args(more)
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

#[test]
fn killed_at_any_moment_and_resumed_it_comes_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, out) = (folder.path().join("whole"), folder.path().join("out"));
    let begun = std::time::Instant::now();
    let output = many(&whole, &["--jobs", "1"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let time = begun.elapsed();
    let expected = data(&whole);
    assert!(expected.keys().any(|name| name.starts_with("negatives.jsonl")), "{expected:?}");

    // Moments over a good part of what is left; each run is another one.
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
    let kills: u64 = std::env::var("GRIPFAST_KILLS").map_or(6, |text| text.parse().unwrap());
    let mut killed = 0;
    for kill in 0..kills {
        let random = gripfast::propose::scatter(now ^ kill) as f64 / u64::MAX as f64;
        let moment = time.mul_f64(random * 2.0 / kills as f64) + Duration::from_millis(5);
        let jobs = ["1", "2"][kill as usize % 2];
        let split = ["1", "3"][kill as usize / 2 % 2];
        let mut child =
            many(&out, &["--resume", "--jobs", jobs, "--split", split]).spawn().unwrap();
        std::thread::sleep(moment);
        child.kill().unwrap();
        killed += usize::from(child.wait().unwrap().code().is_none());
    }
    assert!(killed > 0);
    // What a kill in the middle of a file leaves of it.
    let sets = out.join("grips.jsonl/gripper=generic");
    std::fs::create_dir_all(&sets).unwrap();
    for folder in [&out, &sets] {
        std::fs::write(folder.join(".gripfast-AbC123"), "half").unwrap();
    }
    let output = many(&out, &["--resume"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(data(&out), expected);
    assert_eq!(manifest(&out).len(), 20);

    // In shares from the beginning, nothing else to be seen of it.
    let shares = folder.path().join("shares");
    let output = many(&shares, &["--split", "5"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(data(&shares), expected);
    let all = |folder: &Path| manifest(folder).into_values().map(|entry| entry["checksum"].clone());
    assert!(all(&shares).eq(all(&whole)), "the results with their counts are the same bytes");
    let output = many(&shares, &["--resume", "--split", "0"]).output().unwrap();
    assert!(text(&output.stderr).contains("--split: is 0"), "{}", text(&output.stderr));

    // A data file that was damaged is made again, the others are left alone.
    let name = "grips.jsonl/gripper=generic/00000.jsonl";
    let other = out.join("grips.jsonl/gripper=robotiq-2f85/00000.jsonl");
    let before = std::fs::metadata(&other).unwrap().modified().unwrap();
    let mut damaged = std::fs::read(out.join(name)).unwrap();
    damaged[1000] ^= 4;
    std::fs::write(out.join(name), damaged).unwrap();
    let output = many(&out, &["--resume"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(data(&out), expected);
    assert_eq!(std::fs::metadata(&other).unwrap().modified().unwrap(), before);
}

#[test]
fn a_file_of_jobs_says_what_each_part_and_gripper_has_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let (jobs, out) = (folder.path().join("jobs.toml"), folder.path().join("out"));
    std::fs::write(
        &jobs,
        r#"
grippers = ["generic"]
parts = ["data/parts/hex_nut.stl"]
top = 10

[request]
density = "7850kg/m3"
[request.candidates]
spacing = "8mm"
angle_step = "90deg"
[request.scoring]
backend = "cpu"

[[part]]
part = "data/parts/shaft_key.stl"
name = "key"
mass = "11g"

[[gripper]]
gripper = "robotiq-2f85"
name = "gentle"
force = "20N"

[[loads]]
name = "hold"
loads = ["gravity:-z"]

[[loads]]
loads = ["gravity"]
accel = "1g"
candidates = { angle_step = "45deg" }
"#,
    )
    .unwrap();
    let output = run(&[jobs.to_str().unwrap(), "-o", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let entries = manifest(&out);
    assert_eq!(entries.len(), 8, "{:?}", entries.keys());
    assert!(entries.values().all(|entry| entry["grips"] == 10));
    let of = |id: &str| &entries[id]["request"];
    let key = of("key / gentle / gravity accel 1g");
    assert_eq!((&key["mass"], &key["force"]), (&"11g".into(), &"20N".into()));
    assert!(key.get("density").is_none());
    assert_eq!(key["candidates"]["angle_step"], "45deg");
    assert_eq!(key["candidates"]["spacing"], "8mm");
    let nut = of("hex_nut.stl / generic / hold");
    assert_eq!(nut["density"], "7850kg/m3");
    assert_eq!(nut["candidates"]["angle_step"], "90deg");
    assert_eq!(entries["key / gentle / hold"]["resolved"]["force"], "20N");

    for (line, problem) in [
        ("[[part]]\nname = \"x\"\n", "'part' is missing"),
        (
            "grippers = [\"generic\"]\nparts = [\"data/parts\"]\n[[loads]]\nname = \"x\"\nload = 3\n",
            "unknown field `load`",
        ),
        ("[request]\nmass = 3\n", "unit"),
        ("grippers = []\nparts = [\"data/parts\"]\n", "--gripper"),
        ("grippers = [\"generic\"]\nparts = [\"nowhere\"]\n", "nowhere"),
        ("grippers = [\"generic\", \"generic\"]\nparts = [\"data/parts\"]\n", "twice"),
        ("grippers = [\"nonsense\"]\nparts = [\"data/parts\"]\n", "nonsense"),
        ("colour = 3\n", "colour"),
    ] {
        std::fs::write(&jobs, line).unwrap();
        let other = folder.path().join("other");
        let output = run(&[jobs.to_str().unwrap(), "-o", other.to_str().unwrap()]);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{line}: {stderr}");
        assert!(stderr.contains(problem), "{line}: {stderr}");
    }
}

//! Every format read back by an independent reader (tests/readers/*.py) and compared, pose by pose.
//!
//! The readers need Python with the packages of tests/readers/requirements.txt: from
//! `GRIPFAST_PYTHON`, `.venv` beside Cargo.toml, or `python3`. Without them a test says SKIPPED;
//! with `GRIPFAST_READERS=require` it fails.

use crate::support::grips;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{LazyLock, Mutex};

use glam::{DMat3, DVec3};
use gripfast::export::{self, Convention, Dialect, Format, Joint, Options, Origin, Stated};
use gripfast::part::Mesh;
use gripfast::results::GripSet;
use serde_json::Value;

/// The Python to use, or why there is none, by package: importing some takes seconds.
static PYTHONS: LazyLock<Mutex<BTreeMap<String, Result<PathBuf, String>>>> =
    LazyLock::new(Mutex::default);

/// The Python to use, or why there is none.
fn find_python(package: &str) -> Result<PathBuf, String> {
    let local = crate::support::root().join(if cfg!(windows) {
        ".venv/Scripts/python.exe"
    } else {
        ".venv/bin/python"
    });
    let python = match std::env::var_os("GRIPFAST_PYTHON") {
        Some(path) => path.into(),
        None if local.exists() => local,
        None => PathBuf::from("python3"),
    };
    match Command::new(&python).args(["-c", &format!("import {package}")]).output() {
        Ok(output) if output.status.success() => Ok(python),
        Ok(_) => Err(format!("{} has no package {package}", python.display())),
        Err(error) => Err(format!("{}: {error}", python.display())),
    }
}

/// The Python for a reader; `None` when it cannot run and need not.
fn python(reader: &str, package: &str) -> Option<PathBuf> {
    // Another test's failure says nothing about what was found.
    let mut known = PYTHONS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let found = known.entry(package.to_owned()).or_insert_with(|| find_python(package)).clone();
    drop(known);
    match found {
        Ok(python) => Some(python),
        Err(reason) => {
            assert!(
                std::env::var_os("GRIPFAST_READERS").is_none_or(|value| value != "require"),
                "{reader}: {reason}"
            );
            // Past the capture of the test harness: a skip must be seen.
            let _ = writeln!(
                std::io::stderr(),
                "SKIPPED {reader}: {reason}; see tests/readers/requirements.txt"
            );
            None
        }
    }
}

/// Runs a reader on a file; `None` when it cannot run and need not.
pub(crate) fn read(reader: &str, package: &str, path: &Path) -> Option<Value> {
    let python = python(reader, package)?;
    let script = crate::support::root().join("tests/readers").join(reader);
    let output = Command::new(python)
        .arg(script)
        .arg(path)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(output.status.success(), "{reader}: {}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// Exports, reads back, and compares the poses of the tool frame with those worked out here.
fn round_trip(
    set: &GripSet,
    format: Format,
    name: &str,
    reader: (&str, &str),
    options: &Options,
    tolerance: f64,
) -> Option<Value> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    export::write(set, format, &path, options, Some(&box_mesh())).unwrap();
    let found = read(reader.0, reader.1, &path)?;
    compare(&found, set, format, name, options, tolerance);
    Some(found)
}

fn compare(
    found: &Value,
    set: &GripSet,
    format: Format,
    name: &str,
    options: &Options,
    tolerance: f64,
) {
    let rows = found["grips"].as_array().unwrap();
    assert_eq!(rows.len(), set.grips.len(), "{name}");
    for (row, grip) in rows.iter().zip(&set.grips) {
        assert_eq!(row["id"], grip.grip.id, "{name}");
        let (rotation, origin) = expected(
            grip.grip.part_from_grip.rotation,
            grip.grip.part_from_grip.origin,
            options,
            format,
        );
        for axis in 0..3 {
            let value = row["position"][axis].as_f64().unwrap();
            assert!(
                (value - origin[axis]).abs() <= tolerance,
                "{name}: position {axis}: {value} is not {}",
                origin[axis]
            );
            for column in 0..3 {
                let value = row["rotation"][axis][column].as_f64().unwrap();
                let wanted = rotation.col(column)[axis];
                assert!(
                    (value - wanted).abs() <= tolerance * 10.0,
                    "{name}: rotation {axis},{column}: {value} is not {wanted}"
                );
            }
        }
        let width = row["width"].as_f64().unwrap();
        assert!((width - grip.grip.width).abs() <= tolerance, "{name}: width {width}");
        if let Some(mu_s) = row["mu_s"].as_f64() {
            assert_eq!(Some(mu_s), grip.worst.mu_s, "{name}");
        }
    }
}

#[test]
fn the_comparison_sees_one_changed_number() {
    let set = grips::grip_set(3);
    let options = Options::default();
    let rows: Vec<Value> = set
        .grips
        .iter()
        .map(|grip| {
            let (rotation, origin) = expected(grip.grip.part_from_grip.rotation, grip.grip.part_from_grip.origin, &options, Format::Csv);
            let rows: Vec<_> = (0..3).map(|row| rotation.row(row).to_array()).collect();
            serde_json::json!({"id": grip.grip.id, "position": origin, "rotation": rows, "width": grip.grip.width, "mu_s": grip.worst.mu_s})
        })
        .collect();
    let good = serde_json::json!({"grips": rows});
    compare(&good, &set, Format::Csv, "x", &options, 1e-15);
    for (pointer, value) in [
        ("/grips/1/position/2", 0.0101),
        ("/grips/2/rotation/0/1", 0.5),
        ("/grips/0/width", 0.03),
        ("/grips/0/id", 8.0),
        ("/grips/1/mu_s", 0.4),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(pointer).unwrap() = serde_json::json!(value);
        assert!(
            std::panic::catch_unwind(|| compare(&bad, &set, Format::Csv, "x", &options, 1e-15))
                .is_err(),
            "{pointer}"
        );
    }
    let mut short = good;
    short["grips"].as_array_mut().unwrap().pop();
    assert!(
        std::panic::catch_unwind(|| compare(&short, &set, Format::Csv, "x", &options, 1e-15))
            .is_err()
    );
}

/// The tool frame, axis by axis: x1 (column 0) approaches, x3 (column 2) closes.
fn expected(grip: DMat3, origin: DVec3, options: &Options, format: Format) -> (DMat3, DVec3) {
    let (approach, closing) = (grip.col(0), grip.col(2));
    let behind = match (options.origin, format) {
        (Some(Origin::Behind(distance)), _) => distance,
        (Some(Origin::Stated(_)), _) | (None, Format::MoveIt) => 0.1,
        (Some(Origin::Pads), _) | (None, _) => 0.0,
    };
    let rotation = match (format, options.convention) {
        (Format::Json | Format::JsonLines, _) => return (grip, origin),
        (_, Some(Convention::GraspGen)) | (Format::GraspGen | Format::Acronym, None) => {
            DMat3::from_cols(closing, approach.cross(closing), approach)
        }
        (_, Some(Convention::GraspNet | Convention::DexNet)) | (Format::GraspNet, None) => {
            DMat3::from_cols(approach, closing, approach.cross(closing))
        }
        _ => DMat3::from_cols(closing.cross(approach), closing, approach),
    };
    (rotation, origin - approach * behind)
}

/// 60 x 40 x 20 mm.
fn box_mesh() -> Mesh {
    let vertices = (0..8)
        .map(|corner: u8| {
            DVec3::new(
                [-0.03, 0.03][usize::from(corner & 1)],
                [-0.02, 0.02][usize::from(corner >> 1 & 1)],
                [-0.01, 0.01][usize::from(corner >> 2)],
            )
        })
        .collect();
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        vertices,
        triangles: faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

#[test]
fn native_json_and_json_lines() {
    let set = grips::grip_set(5);
    for (format, name) in [(Format::Json, "grips.json"), (Format::JsonLines, "grips.jsonl")] {
        round_trip(&set, format, name, ("read_json.py", "json"), &Options::default(), 0.0);
    }
}

#[test]
fn csv() {
    let set = grips::grip_set(5);
    for convention in Convention::ALL {
        let options = Options::default().with_convention(Some(convention.0));
        let Some(found) =
            round_trip(&set, Format::Csv, "grips.csv", ("read_csv.py", "csv"), &options, 1e-15)
        else {
            return;
        };
        assert_eq!(found["load_names"][1], "gravity -z");
        assert_eq!(found["load_names"][0], "gravity, \"+z\"");
        assert_eq!(
            found["frames"][0],
            format!("{}, origin midway between the pads", convention.0.axes())
        );
    }
}

#[cfg(feature = "parquet")]
#[test]
fn parquet() {
    let set = grips::grip_set(5);
    let options = Options::default().with_origin(Some(Origin::Behind(0.05)));
    let Some(found) = round_trip(
        &set,
        Format::Parquet,
        "grips.parquet",
        ("read_parquet.py", "pyarrow"),
        &options,
        1e-15,
    ) else {
        return;
    };
    assert_eq!(found["load_names"][0], "gravity, \"+z\"");
    assert_eq!(found["frames"][0], "z approach, y closing, origin 50 mm behind the pads");
    // An infinite bound is a null, in no other way.
    assert!(found["mu_upper"][1].is_null() && found["mu_upper"][0].is_f64());
    let table = export::table(&set, &options).unwrap();
    assert_eq!(found["columns"].as_array().unwrap().len(), table.columns.len());
    round_trip(
        &grips::grip_set(0),
        Format::Parquet,
        "none.parquet",
        ("read_parquet.py", "pyarrow"),
        &options,
        0.0,
    );
}

#[test]
fn isaac_grasp() {
    let set = grips::grip_set(5);
    let options = Options::default()
        .with_joints(vec![Joint { name: "joint: \"1\"".into(), ..Joint::default() }])
        .with_origin(Some(Origin::Stated(Stated::Flange)));
    let Some(found) = round_trip(
        &set,
        Format::IsaacGrasp,
        "grips.yaml",
        ("read_isaac_grasp.py", "yaml"),
        &options,
        1e-15,
    ) else {
        return;
    };
    assert_eq!(found["joints"][0], "joint: \"1\"");
    // Each jaw opens by the 5 mm of the plan.
    for (opened, grip) in numbers(&found["opened"]).iter().zip(&set.grips) {
        assert!((opened - grip.grip.width - 0.01).abs() < 1e-15, "{opened}");
    }
    assert_eq!(found["frames"], serde_json::json!(["part", "test gripper"]));
    let quality = numbers(&found["quality"]);
    assert!(quality.is_sorted_by(|a, b| a > b) && quality[0] <= 1.0 && quality[4] > 0.0);
    round_trip(
        &grips::grip_set(0),
        Format::IsaacGrasp,
        "none.yaml",
        ("read_isaac_grasp.py", "yaml"),
        &options,
        0.0,
    );
}

#[test]
fn moveit() {
    let mut set = grips::grip_set(5);
    set.grips[4].grip.part_from_grip.rotation = DMat3::IDENTITY;
    let options = Options::default().with_opening(Some(0.05));
    let Some(found) =
        round_trip(&set, Format::MoveIt, "grips.yaml", ("read_moveit.py", "yaml"), &options, 1e-15)
    else {
        return;
    };
    assert_eq!(numbers(&found["opened"]), vec![0.05; 5]);
    assert_eq!(numbers(&found["forces"][0]), [80.0, 80.0]);
    for (approach, grip) in found["approaches"].as_array().unwrap().iter().zip(&set.grips) {
        assert_eq!(numbers(approach), grip.grip.part_from_grip.rotation.x_axis.to_array());
    }
}

#[test]
fn graspgen() {
    let set = grips::grip_set(5);
    let options = Options::default().with_pad_friction(Some(0.1));
    let Some(found) = round_trip(
        &set,
        Format::GraspGen,
        "grips.json",
        ("read_graspgen.py", "numpy"),
        &options,
        1e-15,
    ) else {
        return;
    };
    assert_eq!(found["held"], serde_json::json!([true, true, false, false, false]));
    assert_eq!(found["object"], serde_json::json!({"file": "box.stl", "scale": 0.001}));
}

#[test]
fn graspnet() {
    let mut set = grips::grip_set(5);
    set.grips[4].worst.mu_s = Some(0.0);
    for convention in [None, Some(Convention::GraspGen)] {
        let options = Options::default().with_convention(convention);
        let Some(found) = round_trip(
            &set,
            Format::GraspNet,
            "grips.npz",
            ("read_graspnet.py", "numpy"),
            &options,
            1e-15,
        ) else {
            return;
        };
        assert_eq!(numbers(&found["height"]), vec![0.01; 5]);
        assert_eq!(numbers(&found["depth"]), vec![0.01; 5]);
        assert_eq!(numbers(&found["object"]), vec![-1.0; 5]);
        let axes = convention.unwrap_or(Convention::GraspNet).axes();
        assert_eq!(found["frame"], format!("{axes}, origin midway between the pads"));
        assert!((found["api"][0].as_f64().unwrap() - 1.05).abs() < 1e-15);
        round_trip(
            &grips::grip_set(0),
            Format::GraspNet,
            "none.npz",
            ("read_graspnet.py", "numpy"),
            &options,
            0.0,
        );
    }
}

#[cfg(feature = "hdf5")]
#[test]
fn acronym() {
    let set = grips::grip_set(5);
    let Some(found) = round_trip(
        &set,
        Format::Acronym,
        "grips.h5",
        ("read_acronym.py", "h5py"),
        &Options::default(),
        1e-15,
    ) else {
        return;
    };
    assert_eq!(found["held"], serde_json::json!([true, true, true, true, true]));
    assert_eq!(found["object"], serde_json::json!({"file": "box.stl", "scale": 0.001}));
    assert_eq!(numbers(&found["com"]), [0.001, 0.002, 0.003]);
    assert_eq!(found["mass"], 0.1296);
    assert_eq!(found["inertia"][1][1], set.part.mass.inertia.y_axis.y);
    assert_eq!(found["frame"], "z approach, x closing, origin midway between the pads");
    round_trip(
        &grips::grip_set(0),
        Format::Acronym,
        "none.h5",
        ("read_acronym.py", "h5py"),
        &Options::default(),
        0.0,
    );
}

#[test]
fn glb() {
    let set = grips::grip_set(5);
    // Poses are full doubles in `extras`, single in the nodes; the meshes are f32.
    let Some(found) = round_trip(
        &set,
        Format::Glb,
        "grips.glb",
        ("read_glb.py", "trimesh"),
        &Options::default(),
        2e-8,
    ) else {
        return;
    };
    assert!(numbers(&found["rounded"]).iter().all(|&by| by < 6e-8), "half a last place of 1");
    assert_eq!(found["watertight"], true);
    assert!((found["volume"].as_f64().unwrap() - 4.8e-5).abs() < 1e-11);
    for (gap, grip) in found["gaps"].as_array().unwrap().iter().zip(&set.grips) {
        let gap = numbers(gap);
        assert!(
            (gap[0] - grip.grip.width / 2.0).abs() < 2e-8
                && (gap[1] + grip.grip.width / 2.0).abs() < 2e-8,
            "{gap:?}"
        );
    }
    // Fingers reach from 40 mm behind the grip axis to 10 mm before it, outside of the pads.
    for finger in found["fingers"].as_array().unwrap() {
        let (low, high) = (numbers(&finger[0]), numbers(&finger[1]));
        assert!((low[2] + 0.04).abs() < 1e-7 && (high[2] - 0.01).abs() < 1e-7, "{low:?} {high:?}");
        assert!(low[1] > 0.0 || high[1] < 0.0);
    }
}

#[test]
fn usd() {
    let set = grips::grip_set(12);
    for options in
        [Options::default(), Options::default().with_convention(Some(Convention::GraspGen))]
    {
        let Some(found) =
            round_trip(&set, Format::Usd, "grips.usda", ("read_usd.py", "pxr"), &options, 1e-15)
        else {
            return;
        };
        assert!((found["volume"].as_f64().unwrap() - 4.8e-5).abs() < 1e-11);
        assert_eq!(
            (&found["part"], &found["names"][1]),
            (&"box.stl".into(), &"grasp_identifier_01".into())
        );
        for (line, grip) in found["lines"].as_array().unwrap().iter().zip(&set.grips) {
            let [low, high] = [0, 1].map(|end: usize| DVec3::from_slice(&numbers(&line[end])));
            let frame = &grip.grip.part_from_grip;
            // Along the closing axis, through the middle of the grip, from beyond face to beyond face.
            assert!(((low + high) / 2.0 - frame.origin).length() < 1e-8, "points are f32");
            let along = (high - low).dot(frame.rotation.z_axis);
            assert!((along - (high - low).length()).abs() < 1e-8 && along > grip.grip.width);
        }
    }
}

#[test]
fn intrinsic() {
    // Its messages hold no ids: the reader numbers the grips.
    let mut set = grips::grip_set(5);
    for (place, grip) in set.grips.iter_mut().enumerate() {
        grip.grip.id = place as u64;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grips.intrinsic.json");
    let options = Options::default();
    export::write(&set, Format::Intrinsic, &path, &options, None).unwrap();
    let Some(mut found) = read("read_intrinsic.py", "google.protobuf", &path) else { return };
    for (row, grip) in found["grips"].as_array_mut().unwrap().iter_mut().zip(&set.grips) {
        row["width"] = grip.grip.width.into();
    }
    compare(&found, &set, Format::Intrinsic, "intrinsic", &options, 1e-15);
    let scores = numbers(&found["scores"]);
    assert!(scores.windows(2).all(|pair| pair[0] > pair[1]) && scores[0] <= 1.0, "{scores:?}");
    let rotations = numbers(&found["rotations"]);
    assert!(rotations.iter().all(|&turns| turns == 1.0 || turns == 2.0), "{rotations:?}");
    // Away from the axis of the approach half a turn is another place.
    let options = options.with_convention(Some(Convention::GraspNet));
    export::write(&set, Format::Intrinsic, &path, &options, None).unwrap();
    let found = read("read_intrinsic.py", "google.protobuf", &path).unwrap();
    assert_eq!(numbers(&found["rotations"]), [1.0; 5]);
}

#[test]
fn robot() {
    let set = grips::grip_set(7);
    for (dialect, name) in Dialect::ALL {
        let options =
            Options::default().with_dialect(dialect).with_origin(Some(Origin::Behind(0.05)));
        let reader = ("read_robot.py", "numpy");
        let Some(found) =
            round_trip(&set, Format::Robot, "grips.robot.csv", reader, &options, 1e-14)
        else {
            return;
        };
        assert_eq!(found["part"][0], "box.stl", "{name}");
        let columns = found["columns"].as_array().unwrap();
        assert_eq!(columns[5], dialect.columns()[0]);
    }
}

#[test]
fn files_for_many_parts_name_part_gripper_and_frame() {
    let set = grips::grip_set(2);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, format: Format| {
        let path = folder.path().join(name);
        export::write(&set, format, &path, &Options::default(), None).unwrap();
        path
    };
    let csv = std::fs::read_to_string(write("grips.csv", Format::Csv)).unwrap();
    let name = set.gripper["name"].as_str().unwrap().replace('"', "\"\"");
    assert!(csv.lines().nth(1).unwrap().contains("box.stl") && csv.contains(&name), "{csv}");
    let npz = write("grips.npz", Format::GraspNet);
    let Some(python) = python("names of the parts", "numpy") else { return };
    let code = "import numpy, sys; d = numpy.load(sys.argv[1]); print(d['part_file'], d['poses'].shape, d['tool_frame'], d['gripper_name'])";
    let output = Command::new(python).args(["-c", code]).arg(npz).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.starts_with("box.stl (2, 4, 4) x approach, y closing")
            && text.contains(set.gripper["name"].as_str().unwrap()),
        "{text} {}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[cfg(feature = "hdf5")]
#[test]
fn candidates_that_are_no_grips_are_failures_of_the_label_formats() {
    let mut set = grips::grip_set(3);
    for id in [50, 51] {
        let mut pose = set.grips[1].grip.clone();
        (pose.id, pose.width) = (id, 0.03);
        pose.part_from_grip.origin.x += 0.01;
        set.negatives.push(gripfast::model::Negative::new(&pose, format!("reason {id}")));
    }
    let folder = tempfile::tempdir().unwrap();
    for (format, file, reader, package) in [
        (Format::Acronym, "grips.h5", "read_acronym.py", "h5py"),
        (Format::GraspGen, "grips.graspgen.json", "read_graspgen.py", "json"),
    ] {
        let path = folder.path().join(file);
        export::write(&set, format, &path, &Options::default(), None).unwrap();
        let Some(found) = read(reader, package, &path) else { return };
        let ids: Vec<u64> = found["grips"]
            .as_array()
            .unwrap()
            .iter()
            .map(|row| row["id"].as_u64().unwrap())
            .collect();
        assert_eq!(ids, [7, 8, 9, 50, 51], "{file}");
        assert_eq!(found["held"], serde_json::json!([true, true, true, false, false]), "{file}");
        let x = numbers(&found["grips"][3]["position"])[0];
        assert!((x - set.negatives[0].part_from_grip.origin.x).abs() < 1e-15);
    }
}

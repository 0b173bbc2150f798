//! `gripfast export` as a user calls it.

use crate::support::grips;
use std::path::Path;

use assert_cmd::Command;
use gripfast::export::Format;
use gripfast::results::GripSet;

fn export(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("gripfast")
        .unwrap()
        .current_dir(folder)
        .arg("export")
        .args(arguments)
        .output()
        .unwrap();
    (
        output.status.code().unwrap(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

/// A folder with a result of four grips and the part it names.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    grips::grip_set(4).write(&folder.path().join("grips.json")).unwrap();
    let mut stl = "solid box\n".to_owned();
    let corner =
        |index: usize| [[-30, 30][index & 1], [-20, 20][index >> 1 & 1], [-10, 10][index >> 2]];
    for [a, b, c, d] in
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    {
        for triangle in [[a, b, c], [a, c, d]] {
            stl += "facet normal 0 0 0\nouter loop\n";
            for index in triangle {
                let [x, y, z] = corner(index);
                stl += &format!("vertex {x} {y} {z}\n");
            }
            stl += "endloop\nendfacet\n";
        }
    }
    std::fs::write(folder.path().join("box.stl"), stl + "endsolid box\n").unwrap();
    folder
}

#[test]
fn the_ending_chooses_the_format() {
    let folder = folder();
    let built = |format: &str| {
        (format != "parquet" || cfg!(feature = "parquet"))
            && (format != "acronym" || cfg!(feature = "hdf5"))
    };
    for (_, name, endings) in Format::ALL {
        for ending in endings {
            let file = format!("out{ending}");
            let (code, _, stderr) = export(folder.path(), &["grips.json", "-o", &file]);
            assert_eq!(code, if built(name) { 0 } else { 2 }, "{file}: {stderr}");
            assert_eq!(folder.path().join(&file).exists(), built(name), "{file}");
            if !built(name) {
                assert!(stderr.contains("--features"), "{stderr}");
            }
        }
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("out.csv")).unwrap().lines().count(), 5);
    let set = GripSet::read(&folder.path().join("out.jsonl")).unwrap();
    assert_eq!(set, grips::grip_set(4));
}

#[test]
fn standard_output_and_a_choice_of_the_best() {
    let folder = folder();
    let (code, stdout, _) = export(
        folder.path(),
        &["grips.json", "--format", "csv", "-o", "-", "--top", "2", "--convention", "graspgen"],
    );
    assert_eq!(code, 0);
    assert_eq!(stdout.lines().count(), 3);
    assert!(
        stdout.contains("\"z approach, x closing, origin midway between the pads\""),
        "{stdout}"
    );
    let (code, stdout, _) = export(
        folder.path(),
        &[
            "grips.json",
            "--format",
            "moveit",
            "-o",
            "-",
            "--joint",
            "finger:-9.41:0.8",
            "--approach-distance",
            "0.2m",
        ],
    );
    assert_eq!(code, 0);
    assert!(
        stdout.contains("joint_names: [\"finger\"]") && stdout.contains("desired_distance: 0.2\n"),
        "{stdout}"
    );
}

#[test]
fn refusals_leave_no_file() {
    let folder = folder();
    std::fs::write(folder.path().join("broken.json"), "{\"format\": \"gripfast-grips\"").unwrap();
    for (arguments, word) in [
        (&["grips.json", "-o", "out.yaml"][..], "isaac_grasp"),
        (&["grips.json", "-o", "out"], "--format"),
        (&["grips.json", "-o", "-"], "--format"),
        (&["grips.json", "-o", "out.csv", "--format", "excel"], "excel"),
        (&["grips.json", "-o", "out.csv", "--convention", "y"], "graspnet (x approach, y closing)"),
        (&["grips.json", "-o", "out.csv", "--origin", "10"], "flange"),
        (&["grips.json", "-o", "out.csv", "--opened-gap=-3mm"], "--opened-gap"),
        (&["grips.json", "-o", "out.csv", "--opened-gap", "3"], "unit"),
        (&["grips.json", "-o", "out.csv", "--joint", "a:b"], "NAME:SCALE:OFFSET"),
        (&["grips.json", "-o", "out.csv", "--pad-friction=-1"], "--pad-friction"),
        (&["grips.json", "-o", "no/folder/out.csv"], "out.csv"),
        (&["grips.json", "-o", "out.glb", "--part", "gone.stl"], "gone.stl"),
        (&["broken.json", "-o", "out.csv"], "broken.json:1"),
        (&["box.stl", "-o", "out.csv"], "box.stl:1"),
        (&["gone.json", "-o", "out.csv"], "gone.json"),
    ] {
        let (code, _, stderr) = export(folder.path(), arguments);
        assert_eq!(code, 2, "{arguments:?}: {stderr}");
        assert!(stderr.contains(word), "{arguments:?}: {stderr}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn a_gripper_without_a_flange_is_told_so() {
    let folder = folder();
    let mut set = grips::grip_set(1);
    set.gripper["grip_from_flange"] = serde_json::Value::Null;
    set.write(&folder.path().join("grips.json")).unwrap();
    let (code, _, stderr) =
        export(folder.path(), &["grips.json", "-o", "out.csv", "--origin", "flange"]);
    assert!(code == 2 && stderr.contains("no flange"), "{stderr}");
    set.gripper = serde_json::json!({"name": "other"});
    set.write(&folder.path().join("grips.json")).unwrap();
    // The table needs no gripper, a drawing does.
    assert_eq!(export(folder.path(), &["grips.json", "-o", "out.csv"]).0, 0);
    let (code, _, stderr) = export(folder.path(), &["grips.json", "-o", "out.glb"]);
    assert!(code == 2 && stderr.contains("gripper"), "{stderr}");
}

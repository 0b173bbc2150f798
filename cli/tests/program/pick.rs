//! `gripfast pick` as a user calls it, and the scene file.

use crate::support::grips;
use std::path::Path;

use assert_cmd::Command;
use glam::{DMat3, DVec3};
use gripfast::model::Frame;
use gripfast::pick::{Opening, Reach, Retreat, Scene, Solid};

const SCENE: &str = r#"
[part]
position = ["400mm", "0mm", "20mm"]
rpy = ["0deg", "0deg", "90deg"]

[gripper]
opening = "full"
clearance = "1mm"
approach = "80mm"
retreat = "5cm"
retreat_direction = [0, 0, 2]
cone = { axis = [0, 0, -3], angle = "45deg" }

[robot]
base = ["1m", "0mm", "0mm"]
reach = ["0.1m", "850mm"]

[[obstacle]]
name = "table"
plane = [0, 0, 5]
position = ["0mm", "0mm", "-30mm"]

[[obstacle]]
mesh = "bin.obj"
unit = "cm"
quaternion = [0, 0, 0, 1]

[[obstacle]]
name = "post"
box = ["40mm", "20mm", "600mm"]
position = ["200mm", "300mm", "300mm"]
"#;

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

fn folder(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let down = DMat3::from_cols(DVec3::NEG_Z, DVec3::X, DVec3::NEG_Y);
    let mut set = grips::grip_set(0);
    for id in 0..30 {
        let mut grip = grips::grip(
            id,
            Frame { rotation: down, origin: DVec3::new(0.0, 0.01 * id as f64, 0.0) },
            0.1 + 0.01 * id as f64,
        );
        grip.grip.width = 0.02;
        grip.rank = id + 1;
        set.grips.push(grip);
    }
    set.write(&folder.path().join("grips.json")).unwrap();
    std::fs::write(folder.path().join("bin.obj"), OBJ).unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

fn pick(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("gripfast")
        .unwrap()
        .current_dir(folder)
        .args(["pick", "grips.json", "--scene", "scene.toml"])
        .args(arguments)
        .output()
        .unwrap();
    (
        output.status.code().unwrap(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn every_field_of_a_scene_is_read() {
    let folder = folder(SCENE);
    let scene = Scene::read(&folder.path().join("scene.toml")).unwrap();
    assert!((scene.world_from_part.point(DVec3::X) - DVec3::new(0.4, 1.0, 0.02)).length() < 1e-15);
    assert_eq!((scene.opening, scene.clearance, scene.approach), (Opening::Full, 0.001, 0.08));
    assert_eq!(scene.retreat, Retreat::Along(DVec3::new(0.0, 0.0, 0.05)));
    assert_eq!(scene.cone, Some((DVec3::NEG_Z, std::f64::consts::FRAC_PI_4)));
    assert_eq!(scene.reach, Some(Reach { base: DVec3::X, least: 0.1, most: 0.85 }));
    assert_eq!(
        scene.obstacles.iter().map(|obstacle| obstacle.name.as_str()).collect::<Vec<_>>(),
        ["table", "obstacle 2", "post"]
    );
    assert_eq!(scene.obstacles[0].world_from_obstacle.rotation.z_axis, DVec3::Z);
    assert!(
        matches!(&scene.obstacles[1].solid, Solid::Mesh { mesh, closed: true } if mesh.bounding_box().1 == DVec3::splat(0.01))
    );
    assert_eq!(scene.obstacles[2].solid, Solid::Box { half: DVec3::new(0.02, 0.01, 0.3) });
    assert_eq!(Scene::parse("x", "", Path::new("")).unwrap(), Scene::default());
}

#[test]
fn a_scene_that_is_wrong_names_its_place() {
    for (text, word) in [
        ("[part\n", "scene.toml:1"),
        ("[part]\n\nposition = [1, 2, 3]\n", "scene.toml:3"),
        ("[part]\nposition = [\"1\", \"2mm\", \"3mm\"]\n", "part, position"),
        ("[part]\nposition = [\"nanm\", \"2mm\", \"3mm\"]\n", "part, position"),
        ("[part]\nquaternion = [0, 0, 0, 2]\n", "part, quaternion"),
        ("[part]\nquaternion = [0, 0, 0, nan]\n", "part, quaternion"),
        ("[part]\nquaternion = [0, 0, 0, 1]\nrpy = [\"0deg\", \"0deg\", \"0deg\"]\n", "both"),
        ("[part]\ncolour = \"red\"\n", "scene.toml:2"),
        ("[gripper]\nopening = \"wide\"\n", "gripper.opening"),
        ("[gripper]\nclearance = \"-1mm\"\n", "negative"),
        ("[gripper]\nretreat_direction = [0, 0, 0]\n", "retreat_direction"),
        ("[gripper]\ncone = { axis = [0, 0, inf], angle = \"3deg\" }\n", "cone.axis"),
        ("[robot]\nbase = [\"0mm\", \"0mm\", \"0mm\"]\nreach = [\"2m\", \"1m\"]\n", "robot.reach"),
        ("[[obstacle]]\nname = \"nothing\"\n", "obstacle 'nothing'"),
        ("[[obstacle]]\nbox = [\"1m\", \"1m\", \"1m\"]\nplane = [0, 0, 1]\n", "one shape"),
        ("[[obstacle]]\nbox = [\"1m\", \"0m\", \"1m\"]\n", "positive"),
        ("[[obstacle]]\nbox = [\"1m\", \"1m\", \"1m\"]\nunit = \"mm\"\n", "meshes only"),
        ("[[obstacle]]\nplane = [0, 0, 1]\nrpy = [\"0deg\", \"0deg\", \"0deg\"]\n", "normal"),
        ("[[obstacle]]\nmesh = \"gone.stl\"\n", "gone.stl"),
        ("[[obstacle]]\nmesh = \"bin.obj\"\nunit = \"mile\"\n", "mile"),
    ] {
        let folder = folder(text);
        let (code, _, stderr) = pick(folder.path(), &[]);
        assert_eq!(code, 2, "{text}: {stderr}");
        assert!(stderr.contains(word), "{text}: {stderr}");
    }
}

#[test]
fn the_first_free_grip_is_printed_with_the_reasons_before_it() {
    // A box over the first 20 grips' places: grip k stands at y = k cm, its palm reaches 60 mm to
    // either side.
    let folder = folder(
        "[part]\nposition = [\"0.5m\", \"0m\", \"0m\"]\n[[obstacle]]\nname = \"shelf\"\nbox = [\"300mm\", \"100mm\", \"20mm\"]\nposition = [\"500mm\", \"0mm\", \"50mm\"]\n",
    );
    let (code, stdout, stderr) =
        pick(folder.path(), &["--json", "--origin", "flange", "--convention", "graspgen"]);
    assert_eq!(code, 0, "{stderr}");
    let found: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    // The palm's edge touches the shelf's at y = 50 mm for the grip at 110 mm.
    let first = found["chosen"]["id"].as_u64().unwrap();
    assert!(first == 11 || first == 12, "{first}");
    assert_eq!(found["passed"].as_array().unwrap().len() as u64, first);
    assert_eq!(found["counts"]["collision with 'shelf'"], first);
    assert!(found["passed"][0]["reason"].as_str().unwrap().contains("meets 'shelf' in the grip"));
    let position: Vec<f64> = found["chosen"]["world_from_tool"]["position"]
        .as_array()
        .unwrap()
        .iter()
        .map(|value| value.as_f64().unwrap())
        .collect();
    assert!(
        (DVec3::from_slice(&position) - DVec3::new(0.5, 0.01 * first as f64, 0.1)).length() < 1e-12,
        "{position:?}"
    );
    assert_eq!(found["chosen"]["approach_direction"], serde_json::json!([0.0, 0.0, -1.0]));
    assert_eq!(found["chosen"]["tool_frame"], "z approach, x closing, origin at the flange");
    assert_eq!(found["chosen"]["free_turn"], serde_json::Value::Null);
    assert!((found["chosen"]["opened_m"].as_f64().unwrap() - 0.03).abs() < 1e-12);

    let (code, stdout, _) = pick(folder.path(), &[]);
    assert_eq!(code, 0);
    assert!(
        stdout.contains("passed over: rank 1, id 0: finger of jaw I meets 'shelf' in the grip")
            && stdout.contains(&format!("free: rank {}, id {first}", first + 1)),
        "{stdout}"
    );
    assert!(stdout.contains("collision with 'shelf'") && stdout.contains("looked at"), "{stdout}");
}

#[test]
fn no_free_grip_is_exit_code_one() {
    let folder = folder("[gripper]\ncone = { axis = [1, 0, 0], angle = \"10deg\" }\n");
    let (code, stdout, _) = pick(folder.path(), &[]);
    assert_eq!(code, 1);
    assert!(
        stdout.contains("no grip of 30 is free")
            && stdout.contains("approach 90.0 deg off the cone's axis"),
        "{stdout}"
    );
    let (code, stdout, _) = pick(folder.path(), &["--json"]);
    let found: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert!(
        code == 1 && found["chosen"].is_null() && found["passed"].as_array().unwrap().len() == 30
    );
}

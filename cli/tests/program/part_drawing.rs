//! The drawing of `gripfast part --plot`: the faces that each view shows carry their numbers.

use glam::DVec3;
use gripfast::part::{Part, ReadOptions, drawing};

/// Numbers of each view, in the order front, right side, top.
fn numbers(svg: &str) -> Vec<Vec<u32>> {
    let view = |view: &str| {
        let mut found: Vec<u32> = view
            .lines()
            .filter_map(|line| line.strip_prefix("<text class=\"number\""))
            .map(|line| line.split(['>', '<']).nth(1).unwrap().parse().unwrap())
            .collect();
        found.sort_unstable();
        found
    };
    svg.split("<g>").skip(1).map(view).collect()
}

fn shipped(name: &str) -> Part {
    let path = crate::support::root().join("data/parts").join(name);
    Part::read(&path, &ReadOptions::default()).unwrap()
}

fn looking(part: &Part, eye: DVec3) -> Vec<u32> {
    part.faces.iter().filter(|face| face.normal.dot(eye) > 0.999).map(|face| face.id).collect()
}

#[test]
fn a_box_shows_one_face_in_each_view() {
    let part = shipped("shaft_key.stl");
    let views = numbers(&drawing::svg(&part));
    assert_eq!(
        views,
        [looking(&part, DVec3::NEG_Y), looking(&part, DVec3::X), looking(&part, DVec3::Z)]
    );
    assert!(views.iter().all(|view| view.len() == 1));
}

#[test]
fn pocket_floors_are_numbered_and_hidden_faces_are_not() {
    let part = shipped("pocket_plate.stl");
    let views = numbers(&drawing::svg(&part));
    // The top and both pocket floors from above; the pockets' walls are hidden from the side, where
    // only the outer side shows.
    assert_eq!(views[2], looking(&part, DVec3::Z));
    assert_eq!(views[2].len(), 3);
    assert_eq!((views[0].len(), views[1].len()), (1, 1));
    assert!(looking(&part, DVec3::NEG_Y).len() > 1 && looking(&part, DVec3::X).len() > 1);
}

#[test]
fn a_shaft_carries_the_number_of_its_cylinder() {
    let count = 32;
    let ring = |z: f64| {
        (0..count).map(move |k| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
            DVec3::new(0.01 * angle.cos(), 0.01 * angle.sin(), z)
        })
    };
    let vertices: Vec<DVec3> = ring(0.0).chain(ring(0.05)).collect();
    let mut triangles = Vec::new();
    for k in 0..count as u32 {
        let (next, up) = ((k + 1) % count as u32, count as u32);
        triangles.extend([[k, next, up + next], [k, up + next, up + k]]);
    }
    for k in 1..count as u32 - 1 {
        triangles.extend([[0, k + 1, k], [count as u32, count as u32 + k, count as u32 + k + 1]]);
    }
    let part = Part::from_triangles("shaft", &vertices, &triangles).unwrap();
    let svg = drawing::svg(&part);
    // From the front and from the side, not from above.
    assert_eq!(svg.matches("class=\"number round\"").count(), 2);
    assert!(svg.contains(">2</text>") && svg.contains("1 curved</text>"));
    assert!(svg.contains("class=\"curved round\""));
}

#[test]
fn the_command_writes_it() {
    let scratch = tempfile::tempdir().unwrap();
    let part = crate::support::root().join("data/parts/spur_gear.stl");
    let run = |more: &[&str]| {
        assert_cmd::Command::new(env!("CARGO_BIN_EXE_gripfast"))
            .current_dir(scratch.path())
            .arg("part")
            .arg(&part)
            .args(more)
            .assert()
    };
    run(&["--plot", "gear.svg"]).success();
    let svg = std::fs::read_to_string(scratch.path().join("gear.svg")).unwrap();
    assert!(
        svg.starts_with("<svg ")
            && svg.trim_end().ends_with("</svg>")
            && svg.contains("spur_gear")
            && svg.contains("class=\"curved\"")
    );
    run(&["--plot", "no/such/folder/gear.svg"]).code(2);
}

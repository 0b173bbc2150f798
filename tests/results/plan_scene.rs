//! Planning in a scene: the grips are those that the choice at run time calls free there.

use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;

use gripfast::pick::{Picker, Reason};
use gripfast::plan::{Outcome, Plan};
use gripfast::propose::{ProposeOptions, Proposer};
use gripfast::request::{Choice, Request};
use gripfast::scene::{Reference, Scene};
use gripfast::units::{Angle, Density, Length};

/// A bracket on a table, turned and moved, with a post beside it, a fixture that holds its foot, and
/// a bar over it.
const CELL: &str = r#"
    [part]
    position = ["400mm", "30mm", "5mm"]
    rpy = ["0deg", "0deg", "35deg"]
    [gripper]
    clearance = "1mm"
    [[obstacle]]
    name = "table"
    plane = [0, 0, 1]
    [[obstacle]]
    name = "post"
    box = ["20mm", "30mm", "200mm"]
    position = ["470mm", "90mm", "100mm"]
    rpy = ["0deg", "0deg", "20deg"]
    [[obstacle]]
    name = "fixture"
    frame = "part"
    mesh = "fixture.stl"
    [[obstacle]]
    name = "bar"
    frame = "part"
    box = ["200mm", "8mm", "8mm"]
    position = ["30mm", "20mm", "120mm"]
"#;

/// A closed box of these corners as text.
fn stl(low: [f64; 3], high: [f64; 3]) -> String {
    let corner = |k: usize| {
        let pick = |axis: usize| if k >> axis & 1 == 0 { low[axis] } else { high[axis] };
        format!("vertex {} {} {}\n", pick(0), pick(1), pick(2))
    };
    let mut text = String::from("solid box\n");
    for [a, b, c, d] in
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    {
        for [a, b, c] in [[a, b, c], [a, c, d]] {
            text += &format!(
                "facet normal 0 0 0\nouter loop\n{}{}{}endloop\nendfacet\n",
                corner(a),
                corner(b),
                corner(c)
            );
        }
    }
    text + "endsolid box\n"
}

fn request(gripper: &str) -> Request {
    let part = crate::support::root().join("data/parts/l_bracket.stl");
    let mut request = Request::new(part, gripper);
    request.density = Some(Density(7850.0));
    request.candidates.spacing = Some(Length(0.008));
    request.candidates.angle_step = Angle(45_f64.to_radians());
    request.scoring.backend = Choice::Cpu;
    request
}

fn run(request: Request) -> Outcome {
    Plan::new(request).unwrap().run(&mut (), &AtomicBool::new(false)).unwrap()
}

#[test]
fn planned_grips_are_those_that_pick_calls_free() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cell.toml");
    std::fs::write(&file, CELL).unwrap();
    std::fs::write(folder.path().join("fixture.stl"), stl([40.0, -30.0, -5.0], [70.0, -5.0, 12.0]))
        .unwrap();
    let scene = Scene::read(&file).unwrap();
    assert_eq!(scene.obstacles[2].frame, Reference::Part);
    for gripper in ["robotiq-2f85", "generic"] {
        let plain = Plan::new(request(gripper)).unwrap();
        let options = ProposeOptions::from(&plain.request().candidates);
        let proposer = Proposer::new(plain.part(), plain.gripper(), &options).unwrap();
        let grid: usize =
            proposer.sites().iter().map(|site| site.positions.len() * site.angles.len()).sum();
        let all = plain.run(&mut (), &AtomicBool::new(false)).unwrap().set;
        let mut asked = request(gripper);
        asked.candidates.scene = Some(file.clone());
        let found = run(asked).set;
        // Places beside the walls of the scene come after those of the grid.
        let of_grid = |id: &u64| *id < grid as u64;
        let found_ids: BTreeSet<u64> =
            found.grips.iter().map(|ranked| ranked.grip.id).filter(of_grid).collect();
        let picker = Picker::new(&all, &scene).unwrap();
        let mut stopped = BTreeSet::new();
        let mut free = BTreeSet::new();
        for (index, ranked) in all.grips.iter().enumerate() {
            match picker.check(index, &scene.world_from_part) {
                None => drop(free.insert(ranked.grip.id)),
                Some(reason) => {
                    let Reason::Collision { obstacle, .. } = reason else { panic!("{reason:?}") };
                    stopped.insert(obstacle);
                }
            }
        }
        let free: BTreeSet<u64> = free.into_iter().filter(of_grid).collect();
        assert_eq!(found_ids, free, "{gripper}");
        assert!(!free.is_empty() && free.len() < all.grips.len() / 2, "{gripper}: {}", free.len());
        assert!(stopped.len() >= 3, "{gripper}: {stopped:?}");
        let by_name = found.summary.rejections.keys().filter(|name| name.starts_with("scene:"));
        assert!(by_name.count() >= 3, "{gripper}: {:?}", found.summary.rejections);
        // What was planned in the scene is free there, also beside the walls.
        let picker = Picker::new(&found, &scene).unwrap();
        for index in 0..found.grips.len() {
            assert_eq!(picker.check(index, &scene.world_from_part), None, "{gripper}");
        }
    }
}

#[test]
fn an_obstacle_of_the_part_goes_with_it() {
    let text = "[part]\nposition = [\"1m\", \"0m\", \"0m\"]\n[[obstacle]]\nname = \"lid\"\n\
                frame = \"part\"\nplane = [0, 0, -1]\nposition = [\"0mm\", \"0mm\", \"55mm\"]\n";
    let scene = Scene::parse("cell", text, std::path::Path::new("")).unwrap();
    let set = run(request("generic")).set;
    let picker = Picker::new(&set, &scene).unwrap();
    let mut there = scene.world_from_part;
    let before = picker.pick(&there);
    there.origin.z += 0.3;
    there.rotation = glam::DMat3::from_rotation_x(0.7);
    // Nothing above 55 mm of the part, wherever it lies.
    assert_eq!(picker.pick(&there), before);
    assert!(before.chosen.is_some_and(|index| index > 0));
}

#[test]
fn a_plate_on_the_scenes_table_is_gripped_as_on_the_ground() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plate.stl"), stl([0.0; 3], [60.0, 60.0, 5.0])).unwrap();
    std::fs::write(
        folder.path().join("cell.toml"),
        "[[obstacle]]\nname = \"table\"\nplane = [0, 0, 1]\n",
    )
    .unwrap();
    let mut asked = request("robotiq-2f85");
    asked.part = folder.path().join("plate.stl");
    asked.candidates.spacing = None;
    asked.candidates.approach = Some("-z:2deg".parse().unwrap());
    asked.candidates.scene = Some(folder.path().join("cell.toml"));
    let in_scene = run(asked.clone()).set;
    assert!(in_scene.summary.ranked > 20, "{:?}", in_scene.summary);
    assert!(in_scene.summary.rejections.contains_key("scene:table"));
    asked.candidates.scene = None;
    asked.candidates.ground = Some("+z:0mm".parse().unwrap());
    assert_eq!(run(asked).set.summary.ranked, in_scene.summary.ranked);
}

#[test]
fn a_scene_file_that_cannot_be_used_names_place_and_option() {
    let mut asked = request("generic");
    asked.candidates.scene = Some("no/such/cell.toml".into());
    let error = Plan::new(asked).unwrap_err();
    assert_eq!(error.options(), ["scene"]);
    assert!(error.to_string().contains("no/such/cell.toml"), "{error}");
}

//! The `gripper` subcommand from outside.

use assert_cmd::Command;

fn gripfast(args: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_gripfast")).args(args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn list_names_every_shipped_gripper() {
    let (code, out, _) = gripfast(&["gripper", "list"]);
    assert_eq!(code, 0);
    for name in [
        "robotiq-2f85",
        "robotiq-2f140",
        "robotiq-hande",
        "franka-hand",
        "onrobot-rg2",
        "wsg50-110",
        "generic",
    ] {
        assert!(out.contains(name), "{name}: {out}");
    }
}

#[test]
fn check_prints_sources_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    let svg = folder.path().join("out.svg");
    let (code, out, _) =
        gripfast(&["gripper", "check", "Robotiq 2F-85", "--svg", svg.to_str().unwrap()]);
    assert_eq!(code, 0);
    assert!(out.contains("UNVERIFIED") && out.contains("0 .. 85 mm"), "{out}");
    let drawing = std::fs::read_to_string(&svg).unwrap();
    assert!(
        drawing.starts_with("<svg")
            && drawing.trim_end().ends_with("</svg>")
            && drawing.contains("stroke 85")
    );
    assert!(!drawing.contains("NaN") && !drawing.contains("inf"));
}

#[test]
fn show_gives_a_file_that_checks() {
    let folder = tempfile::tempdir().unwrap();
    let (_, text, _) = gripfast(&["gripper", "show", "generic"]);
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, text).unwrap();
    let (code, out, error) = gripfast(&["gripper", "check", path.to_str().unwrap()]);
    assert_eq!(code, 0, "{error}");
    assert!(out.contains("Generic parallel gripper"));
}

#[test]
fn check_says_that_the_flange_lies_to_the_side() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    let text = gripfast::gripper::catalogue::text("generic").unwrap();
    let [before, after] = [r#"["-132mm", "0mm", "0mm"]"#, r#"["-132mm", "60mm", "-2.5mm"]"#];
    assert!(text.contains(before), "{text}");
    std::fs::write(&path, text.replace(before, after)).unwrap();
    let (code, out, error) = gripfast(&["gripper", "check", path.to_str().unwrap()]);
    assert_eq!(code, 0, "{error}");
    let place = "132 mm behind the pads' middle, 60 mm along x2, -2.5 mm along x3";
    assert!(out.contains(place), "{out}");
}

#[test]
fn bad_files_are_refused_with_place_and_remedy() {
    let good = gripfast::gripper::catalogue::text("generic").unwrap();
    let cases: &[(&str, &str, &str)] = &[
        ("stroke = [\"0mm\", \"100mm\"]", "stroke = [\"0mm\", \"100\"]", "has no unit"),
        ("stroke = [\"0mm\", \"100mm\"]", "stroke = [\"100mm\", \"0mm\"]", "smallest value"),
        ("force = [\"10N\", \"150N\"]", "forse = [\"10N\", \"150N\"]", "unknown field"),
        ("force = [\"10N\", \"150N\"]", "", "missing field"),
        ("force = [\"10N\", \"150N\"]", "force = [\"nanN\", \"1N\"]", "not a finite value"),
        ("rectangle = [\"20mm\", \"20mm\"]", "rectangle = [\"20mm\", \"0mm\"]", "no area"),
        (
            "rectangle = [\"20mm\", \"20mm\"]",
            "polygon = [[\"0mm\",\"0mm\"],[\"1mm\",\"1mm\"],[\"1mm\",\"0mm\"],[\"0mm\",\"1mm\"]]",
            "not a convex",
        ),
        ("friction = 0.5", "friction = -1", "between 0 and 10"),
        ("friction = 0.5", "friction = nan", "between 0 and 10"),
        ("thickness = \"2mm\"", "thickness = \"-2mm\"", "above zero"),
        (
            "box = [\"24mm\", \"22mm\", \"10mm\"]",
            "box = [\"24mm\", \"22mm\", \"-10mm\"]",
            "no volume",
        ),
        ("box = [\"24mm\", \"22mm\", \"10mm\"]", "", "exactly one of"),
        (
            "box = [\"24mm\", \"22mm\", \"10mm\"]",
            "hull = [[\"0mm\",\"0mm\",\"0mm\"],[\"1mm\",\"0mm\",\"0mm\"],[\"0mm\",\"1mm\",\"0mm\"],[\"1mm\",\"1mm\",\"0mm\"]]",
            "no volume",
        ),
        ("name = \"finger\" ", "name = \"fingertip\" ", "used twice"),
        ("\"palm.housing\" = ", "\"palm.house\" = ", "names no dimension"),
        ("[source]\nstroke", "[source\nstroke", ""),
        (
            "origin = [\"-132mm\", \"0mm\", \"0mm\"]",
            "origin = [\"-132mm\", \"0mm\", \"0mm\"]\nz = [0.0, 0.0, 0.0]",
            "parallel or zero",
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (index, (from, to, expected)) in cases.iter().enumerate() {
        assert!(good.contains(from), "{from}");
        let path = folder.path().join(format!("bad{index}.toml"));
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let (code, _, error) = gripfast(&["gripper", "check", path.to_str().unwrap()]);
        assert_eq!(code, 2, "{to}: {error}");
        assert!(
            error.contains(expected) && error.contains("bad") && error.contains("remedy"),
            "{to}: {error}"
        );
    }
    std::fs::write(folder.path().join("binary.toml"), [0xff, 0xfe, 0x00]).unwrap();
    assert_eq!(
        gripfast(&["gripper", "check", folder.path().join("binary.toml").to_str().unwrap()]).0,
        2
    );
    assert_eq!(gripfast(&["gripper", "check", "/no/such.toml"]).0, 2);
    assert!(
        gripfast(&["gripper", "check", "frankahands"]).2.contains("did you mean 'franka-hand'")
    );
}

#[test]
fn shapes_other_than_boxes_are_read_and_drawn() {
    let text = r#"
        name = "round & slanted"
        stroke = ["5mm", "40mm"]
        force = ["1N", "9N"]
        pad = { polygon = [["-5mm", "-4mm"], ["5mm", "-4mm"], ["6mm", "0mm"], ["5mm", "4mm"], ["-5mm", "4mm"]] }
        [[finger]]
        name = "pin"
        cylinder = { radius = "4mm", length = "30mm", axis = "x1" }
        at = ["-9mm", "0mm", "4mm"]
        [[finger]]
        name = "wedge"
        hull = [["0mm", "0mm", "0mm"], ["-10mm", "5mm", "0mm"], ["-10mm", "-5mm", "0mm"], ["-10mm", "0mm", "8mm"]]
        [[palm]]
        name = "bar"
        box = ["10mm", "10mm", "60mm"]
        at = ["-40mm", "0mm", "0mm"]
        rotate = { axis = "x1", angle = "45deg" }
    "#;
    let gripper = gripfast::gripper::parse(text, "t").unwrap();
    let [min, max] = gripper.fingers[0].bounds();
    assert!(
        (min - glam::DVec3::new(-0.024, -0.004, 0.0)).length() < 1e-12
            && (max.x - 0.006).abs() < 1e-12
    );
    let drawing = gripfast::gripper::drawing::svg(&gripper);
    assert!(drawing.contains("round &amp; slanted") && !drawing.contains("NaN"));
    assert!(
        gripfast::gripper::check(&gripper)
            .iter()
            .any(|warning| warning.contains("friction is not stated"))
    );
}

#[test]
fn new_says_how_a_name_of_two_words_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    let (code, _, error) = gripfast(&["gripper", "new", path.to_str().unwrap()]);
    assert!(code == 2 && error.contains("--name \"Bench gripper\""), "{error}");
}

//! What a newcomer types, and what the program answers.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

fn gripfast(folder: &Path, line: &str) -> Output {
    let words = line.split_whitespace();
    Command::cargo_bin("gripfast").unwrap().current_dir(folder).args(words).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn bracket() -> String {
    crate::support::root().join("data/parts/l_bracket.stl").display().to_string()
}

/// The bracket in a file whose numbers are so many times those in millimetres.
fn bracket_times(factor: f32, path: &Path) {
    let mut bytes = std::fs::read(bracket()).unwrap();
    for triangle in bytes[84..].chunks_exact_mut(50) {
        for number in triangle[12..48].chunks_exact_mut(4) {
            let value = f32::from_le_bytes([number[0], number[1], number[2], number[3]]);
            number.copy_from_slice(&(value * factor).to_le_bytes());
        }
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_part_smaller_than_the_pads_is_said_to_be_in_another_unit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let end =
        "-g robotiq-2f85 --density 7850kg/m3 --backend cpu --spacing 8mm --angle-step 45deg -q";
    for (name, factor, unit) in [("inch.stl", 1.0 / 25.4, "in"), ("cm.stl", 0.1, "cm")] {
        bracket_times(factor, &at.join(name));
        let output = gripfast(at, &format!("plan {name} {end}"));
        let out = text(&output.stdout);
        assert_eq!(output.status.code(), Some(1), "{out}");
        assert!(out.contains("smaller than the pads") && out.contains(&format!("--unit {unit}")));
        let output = gripfast(at, &format!("plan {name} --unit {unit} {end}"));
        let out = text(&output.stdout);
        assert!(output.status.code() == Some(0) && !out.contains("smaller"), "{out}");
    }
}

#[test]
fn mistakes_get_advice() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let part = bracket();
    let plan = format!("plan {part} --backend cpu --spacing 10mm --angle-step 90deg --accel 1g");
    let new = "gripper new bench.toml --name Bench --stroke 2mm,60mm --force 15N,120N --pad 24x16mm \
               --finger 63mm,16mm,14mm --palm 70mm,90mm,90mm --throat 37mm";
    let output = gripfast(at, new);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    std::fs::write(at.join("one.toml"), "[obstacle]\nname = \"table\"\nplane = [0, 0, 1]\n")
        .unwrap();
    std::fs::write(at.join("two.toml"), "[[obstacle]]\nname = \"a\"\nbox = [80, 20, 25]\n")
        .unwrap();
    let grips = gripfast(at, &format!("{plan} -g bench.toml --mass 200g -q -o grips.json"));
    assert_eq!(grips.status.code(), Some(0), "{}", text(&grips.stderr));
    let first = gripfast::results::GripSet::read(&at.join("grips.json")).unwrap().grips[0].grip.id;
    assert!(first > 1, "a rank and an id are told apart");
    for (line, advice) in [
        (format!("{plan} -g bench --mass 200g"), "did you mean 'bench.toml'".to_owned()),
        (format!("{plan} -g generic --mass 350 g"), "as one word: 350g".to_owned()),
        (format!("{plan} -g generic --mass 1kg --scene one.toml"), "[[obstacle]]".to_owned()),
        (format!("{plan} -g generic --mass 1kg --scene two.toml"), "with its unit".to_owned()),
        ("why grips.json 1".to_owned(), format!("that of rank 1 is {first}")),
        ("why grips.json 999999".to_owned(), "see the ids".to_owned()),
        (
            "export grips.json --format kuka -o x".to_owned(),
            "dialect of the format robot".to_owned(),
        ),
        ("export grips.json --format isaac -o x".to_owned(), "mean 'isaac_grasp'".to_owned()),
    ] {
        let output = gripfast(at, &line);
        let err = text(&output.stderr);
        assert!(output.status.code() == Some(2) && err.contains(&advice), "{line}: {err}");
    }
    let output = gripfast(at, "export grips.json -o one.csv --top 1");
    assert!(text(&output.stderr).contains("one.csv: 1 grip,"), "{}", text(&output.stderr));
    // A value that stands in the project's file is not sought on the command line.
    std::fs::write(at.join("gripfast.toml"), "[plan]\nmass = 350\n").unwrap();
    for (more, from_file) in [("", true), ("--mass 3", false)] {
        let output = gripfast(at, &format!("{plan} -g generic {more}"));
        let err = text(&output.stderr);
        assert!(output.status.code() == Some(2) && err.contains("has no unit"), "{err}");
        assert_eq!(err.contains("stands in gripfast.toml"), from_file, "{err}");
    }
}

#[test]
fn a_drawing_is_asked_for_by_one_name_of_two() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (line, files) in [
        (format!("part {}", bracket()), ["a.svg", "b.svg"]),
        ("gripper check generic".to_owned(), ["c.svg", "d.svg"]),
    ] {
        let [svg, plot] = ["--svg", "--plot"].map(|flag| {
            let file = if flag == "--svg" { files[0] } else { files[1] };
            let output = gripfast(at, &format!("{line} {flag} {file}"));
            assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
            std::fs::read_to_string(at.join(file)).unwrap()
        });
        assert!(svg.starts_with("<svg") && svg == plot);
    }
}

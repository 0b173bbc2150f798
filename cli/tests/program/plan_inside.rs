//! Grips from inside, from the command line to the result file: scored with the distance of the
//! faces negative.

use std::path::Path;

use gripfast::load::wrench_in_grip;
use gripfast::mechanics::{self, Options};
use gripfast::model::{Score, Status};
use gripfast::results::{GripSet, RankedGrip};

fn plan(folder: &Path, name: &str, more: &[&str]) -> GripSet {
    let out = folder.join(name);
    let part = crate::support::root().join("data/parts/pocket_plate.stl");
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_gripfast"))
        .current_dir(folder)
        .arg("plan")
        .arg(part)
        .args(crate::support::with_flags(
            &[
                "--gripper",
                "generic",
                "--mass",
                "300g",
                "--angle-step",
                "45deg",
                "--backend",
                "cpu",
                "--quiet",
            ],
            more,
        ))
        .arg("-o")
        .arg(&out)
        .assert()
        .success();
    GripSet::read(&out).unwrap()
}

/// Answers of the exact solver for all loads of a grip, at the distance given.
fn answers(set: &GripSet, ranked: &RankedGrip, distance: f64, force: f64) -> Vec<Score> {
    let pose = &ranked.grip.part_from_grip;
    let solve = |wrench| {
        mechanics::solve(&ranked.grip.contact, distance, force, &wrench, &Options::default())
            .unwrap()
    };
    set.loads
        .iter()
        .map(|load| solve(wrench_in_grip(&load.wrench, set.part.mass.centre_of_mass, pose)))
        .collect()
}

#[test]
fn scores_are_those_of_the_exact_solver_at_minus_the_width() {
    let scratch = tempfile::tempdir().unwrap();
    // A weak grip under a strong load: pads separate, so that the distance of the faces counts.
    let set = plan(
        scratch.path(),
        "inside.json",
        &[
            "--grips",
            "inside",
            "--mass",
            "600g",
            "--loads",
            "gravity:26",
            "--force",
            "30N",
            "--spacing",
            "1mm",
        ],
    );
    assert!(set.grips.len() >= 40, "{}", set.grips.len());
    let mut told_apart = 0;
    for ranked in set.grips.iter().step_by(1 + set.grips.len() / 40) {
        assert!(ranked.grip.inside);
        let width = ranked.grip.width * 1e3;
        assert!(
            [44.0, 52.0, 36.0].iter().any(|pocket| (width - pocket).abs() < 1e-3),
            "{width} mm is the width of no pocket and no window"
        );
        let found = answers(&set, ranked, -ranked.grip.width, 30.0);
        assert!(found.iter().all(|score| score.status.holds()));
        let largest = found.iter().filter_map(|score| score.mu_s).fold(0.0, f64::max);
        let mu = ranked.worst.mu_s.unwrap();
        assert!(
            (mu - largest).abs() <= 1e-9 * largest,
            "grip {}: {mu}, the exact solver finds {largest}",
            ranked.grip.id
        );
        let outside = answers(&set, ranked, ranked.grip.width, 30.0)[ranked.worst.load as usize];
        told_apart += usize::from(
            outside.status == Status::TwistedOut
                || outside.mu_s.is_none_or(|other| (other / mu - 1.0).abs() > 1e-6),
        );
    }
    assert!(
        told_apart >= 5,
        "the sign of the distance matters for {told_apart} of the grips looked at"
    );
}

#[test]
fn both_sides_together_are_the_two_apart() {
    let scratch = tempfile::tempdir().unwrap();
    let count = |side: &str| {
        let set =
            plan(scratch.path(), &format!("{side}.json"), &["--grips", side, "--spacing", "8mm"]);
        (
            set.summary.candidates,
            set.grips.iter().filter(|grip| grip.grip.inside).count(),
            set.grips.iter().filter(|grip| !grip.grip.inside).count(),
        )
    };
    let (inside, outside, both) = (count("inside"), count("outside"), count("both"));
    assert!(inside.1 > 0 && inside.2 == 0 && outside.1 == 0 && outside.2 > 0);
    assert_eq!(both, (inside.0 + outside.0, inside.1, outside.2));
}

#[test]
fn a_grip_from_inside_is_explained_and_exported_as_such() {
    let scratch = tempfile::tempdir().unwrap();
    let set = plan(scratch.path(), "grips.json", &["--grips", "inside"]);
    let run = |arguments: &[&str]| {
        let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_gripfast"))
            .current_dir(scratch.path())
            .args(arguments)
            .assert()
            .success();
        String::from_utf8(output.get_output().stdout.clone()).unwrap()
    };
    let id = set.grips[0].grip.id.to_string();
    let why = run(&["why", "grips.json", &id]);
    assert!(why.contains("free of interference") && why.contains("rank 1 of"), "{why}");
    run(&["export", "grips.json", "--format", "csv", "-o", "grips.csv"]);
    let table = std::fs::read_to_string(scratch.path().join("grips.csv")).unwrap();
    assert!(table.lines().skip(1).all(|line| line.contains("inside")));
    run(&["report", "grips.json", "-o", "page.html"]);
}

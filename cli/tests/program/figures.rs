//! The numbers behind the paper's figures, and the files that `gripfast figures` writes.

use std::path::Path;
use std::process::Command;

use gripfast::lab::figures::studies::{self, Trend};

#[test]
fn figure_5_shapes() {
    let rows = studies::figure_5().unwrap();
    let ratio = |shape: &str, parameter: f64| {
        rows.iter()
            .find(|row| row.shape == shape && (row.parameter - parameter).abs() < 1e-9)
            .unwrap()
            .ratio
    };
    for (hole, want) in [
        (0.2, 0.968),
        (0.3, 0.935),
        (0.4, 0.897),
        (0.5, 0.857),
        (0.6, 0.816),
        (0.75, 0.757),
        (0.9, 0.701),
    ] {
        assert!(
            (ratio("hollow", hole) - want).abs() < 6e-4,
            "hole {hole}: {}",
            ratio("hollow", hole)
        );
        // Exact: the mean radius of a hollow square is (1 - k^3)/(1 - k^2) times the square's.
        let exact = (1.0 - hole * hole) / (1.0 - hole * hole * hole);
        assert!((ratio("hollow", hole) / exact - 1.0).abs() < 1e-11);
    }
    for (arm, want) in [
        (0.8, 1.029),
        (0.6, 1.102),
        (0.5, 1.153),
        (0.4, 1.214),
        (1.0 / 3.0, 1.260),
        (0.25, 1.322),
        (0.2, 1.362),
        (0.1, 1.447),
    ] {
        assert!((ratio("cross", arm) - want).abs() < 6e-4, "arm {arm}: {}", ratio("cross", arm));
    }
    assert!((rows[0].mu_s - 0.261_371_039_717_985_4).abs() < 1e-12);
}

#[test]
fn figure_6_bar() {
    let rows = studies::figure_6().unwrap();
    for (mm, new, old) in [
        (0.0, 0.049_05, 0.0),
        (1.0, 0.049_76, 0.006_41),
        (5.0, 0.062_01, 0.032_05),
        (10.0, 0.085_36, 0.064_10),
        (20.0, 0.140_93, 0.128_20),
        (50.0, 0.325_98, 0.320_51),
        (100.0, 0.643_78, 0.641_01),
    ] {
        let row = rows.iter().find(|row| (1e3 * row.distance - mm).abs() < 1e-6).unwrap();
        assert!((row.new - new).abs() < 6e-6 && (row.old - old).abs() < 6e-6, "{mm}: {row:?}");
    }
    assert!(rows.iter().all(|row| row.new > row.old));
    // Exact values for unit squares: mu 2 Fn / W at D = 0.5 and 1 sides.
    for (mm, want) in [(10.0, 1.740_168_179_453), (20.0, 2.873_173_680_110)] {
        let row = rows.iter().find(|row| (1e3 * row.distance - mm).abs() < 1e-6).unwrap();
        assert!((row.new * 100.0 / 4.905 / want - 1.0).abs() < 1e-11, "{mm}");
    }
}

#[test]
fn figure_4_line_turns() {
    let rows = studies::figure_4().unwrap();
    assert_eq!(rows.len(), 18);
    let angles: Vec<f64> = rows.iter().map(|row| row.angle.to_degrees()).collect();
    assert!((angles[0] - 0.87).abs() < 5e-3 && (angles[17] - 50.1).abs() < 5e-2, "{angles:?}");
    assert!(angles.windows(2).all(|pair| pair[1] > pair[0]));
}

#[test]
fn distance_between_the_faces() {
    let sweeps = studies::distance_sweeps().unwrap();
    assert_eq!(sweeps.len(), 108);
    for sweep in &sweeps {
        assert_eq!(sweep.points.len(), 26, "{sweep:?}");
        assert!(sweep.residual < 1e-10 && sweep.ambiguous == 0, "{sweep:?}");
        if sweep.points.iter().all(|point| point[2] > 1.0 - 1e-12) {
            assert_eq!(sweep.trend, Trend::Constant, "{sweep:?}");
        }
    }
    let count = |trend: Trend| sweeps.iter().filter(|sweep| sweep.trend == trend).count();
    assert_eq!(
        [Trend::Constant, Trend::Up, Trend::Down, Trend::Mixed].map(count),
        [39, 25, 12, 32]
    );
}

#[test]
fn contact_falls_with_the_moment() {
    let sweeps = studies::separation_sweeps().unwrap();
    assert_eq!(sweeps.len(), 30);
    for sweep in &sweeps {
        assert!(sweep.points.windows(2).all(|pair| pair[1].1 <= pair[0].1 + 1e-12), "{sweep:?}");
        assert!(sweep.points.iter().all(|point| point.2 < 1000), "{sweep:?}");
        for &(share, left, rounds) in &sweep.points {
            if sweep.shape == "square" && sweep.direction == 0.0 {
                let want = f64::min(1.0, 1.5 * (1.0 - share));
                assert!((left - want).abs() < 1e-9, "{share}: {left}");
                assert!(
                    !(0.4..=0.8).contains(&share) || (5..=9).contains(&rounds),
                    "{share}: {rounds}"
                );
            }
        }
    }
}

/// The table of prisms as it was found with other code, to the five digits given there.
#[test]
fn prisms_become_no_cylinder_by_refinement() {
    let t = f64::NAN;
    let known: [(f64, [f64; 6]); 6] = [
        (0.3, [0.0, t, t, t, t, t]),
        (0.03, [0.0, 0.0, 0.0, 0.0, 0.0, t]),
        (0.42426, [0.3, t, t, t, t, t]),
        (0.3, [0.15, 0.15, t, t, t, t]),
        (0.3, [0.28281, 0.29413, 0.29820, 0.29947, 0.29985, 0.29999]),
        (0.24271, [0.14141, 0.14641, t, t, t, t]),
    ];
    let rows = gripfast::lab::figures::prism::rows().unwrap();
    assert_eq!(rows.len(), known.len());
    for (row, (cylinder, prisms)) in rows.iter().zip(known) {
        // The cylinder's contact is a little wider than the line that the values are of.
        assert!((row.cylinder - cylinder).abs() < 2e-5, "{}: {}", row.load, row.cylinder);
        for (found, known) in row.prisms.iter().zip(prisms) {
            match found {
                Some(mu) => assert!((mu - known).abs() < 6e-6, "{}: {mu} {known}", row.load),
                None => assert!(known.is_nan(), "{}: {known}", row.load),
            }
        }
    }
}

fn figures(folder: &Path) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_gripfast"))
        .args(["figures", "-o"])
        .arg(folder)
        .output()
        .unwrap()
}

/// Every table in `docs/figures` is what the program writes today (to 1e-6, for other machines'
/// last digits).
#[test]
fn the_figures_in_the_documentation_are_current() {
    let folder = tempfile::tempdir().unwrap();
    let output = figures(folder.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("figure6.csv"));
    let docs = crate::support::root().join("docs/figures");
    for name in ["separation", "figure4", "figure5", "figure6", "distance"] {
        let read = |folder: &Path, suffix: &str| {
            std::fs::read_to_string(folder.join(name).with_extension(suffix)).unwrap()
        };
        for folder in [folder.path(), &docs] {
            let drawing = read(folder, "svg");
            assert!(
                drawing.starts_with("<svg")
                    && drawing.trim_end().ends_with("</svg>")
                    && !drawing.contains("NaN"),
                "{name}"
            );
        }
        let (new, old) = (read(folder.path(), "csv"), read(&docs, "csv"));
        assert_eq!(new.lines().count(), old.lines().count(), "{name}");
        for (new, old) in new.lines().zip(old.lines()) {
            assert_eq!(new.split(',').count(), old.split(',').count(), "{name}");
            for (a, b) in new.split(',').zip(old.split(',')) {
                let same = match (a.parse::<f64>(), b.parse::<f64>()) {
                    (Ok(a), Ok(b)) => (a - b).abs() <= 1e-6 * (1.0 + b.abs()),
                    _ => a == b,
                };
                assert!(same, "{name}: {new} | {old}: run `gripfast figures -o docs/figures`");
            }
        }
    }
}

#[test]
fn a_folder_that_cannot_be_made_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let output = figures(&file);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("file"), "{output:?}");
}

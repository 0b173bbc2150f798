//! The paper's own method over the reference cases: how often it is right, how often it only
//! believes so.

use std::time::{Duration, Instant};

use glam::{DMat2, DVec2, DVec3};
use gripfast::lab::paper::{self, Outcome};
use gripfast::mechanics::{self, Options};
use gripfast::model::{Contact, Polygon, Wrench};
use serde_json::Value;

struct Case {
    id: String,
    contact: Contact,
    distance: f64,
    force: f64,
    load: Wrench,
    /// `None`: there is no solution.
    mu: Option<f64>,
}

fn reference() -> Option<Vec<Case>> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/cases/reference.json");
    let Ok(text) = std::fs::read_to_string(path) else {
        println!("SKIPPED: {path} is not here");
        return None;
    };
    let file: Value = serde_json::from_str(&text).unwrap();
    let case = |case: &Value| {
        let vector = |name: &str| serde_json::from_value(case[name].clone()).unwrap();
        Case {
            id: case["id"].as_str().unwrap().to_owned(),
            contact: serde_json::from_value(
                serde_json::json!({"A_I": case["A_I"], "A_II": case["A_II"]}),
            )
            .unwrap(),
            distance: case["d"].as_f64().unwrap(),
            force: case["Fn"].as_f64().unwrap(),
            load: Wrench { force: vector("F"), moment: vector("M") },
            mu: case["expected"]["solution"]["mu_s"].as_f64(),
        }
    };
    Some(file["cases"].as_array().unwrap().iter().map(case).collect())
}

/// The same case seen in a frame turned about the closing axis: physically nothing has changed.
fn turned(case: &Case, angle: f64) -> Case {
    let turn = DMat2::from_angle(angle);
    let vector = |v: DVec3| (turn * DVec2::new(v.x, v.y)).extend(v.z);
    let ring = |ring: &Vec<DVec2>| ring.iter().map(|&x| turn * x).collect();
    let patch = |patch: &Vec<Polygon>| {
        patch
            .iter()
            .map(|p| Polygon { outer: ring(&p.outer), holes: p.holes.iter().map(ring).collect() })
            .collect()
    };
    Case {
        id: case.id.clone(),
        contact: Contact {
            face_i: patch(&case.contact.face_i),
            face_ii: patch(&case.contact.face_ii),
        },
        load: Wrench { force: vector(case.load.force), moment: vector(case.load.moment) },
        ..*case
    }
}

#[derive(Default)]
struct Count {
    right: u32,
    false_zero: u32,
    not_zero: u32,
    lost: u32,
    /// Answers that pass the method's own check and are wrong all the same: must not happen.
    wrong: u32,
    cases_published: u32,
    cases_checked: u32,
    evaluations: u64,
    time: Duration,
    default_evaluations: Vec<u32>,
    default_right: u32,
    default_time: Duration,
}

fn median(values: &mut [u32]) -> u32 {
    values.sort_unstable();
    values[values.len() / 2]
}

fn measure(cases: &[Case]) -> Count {
    let mut count = Count::default();
    for case in cases {
        let options = paper::Options { all_starts: true, ..paper::Options::default() };
        let Some(mu) = case.mu else {
            let report =
                paper::solve(&case.contact, case.distance, case.force, &case.load, &options)
                    .unwrap();
            assert!(
                report.checked.is_none() && !report.score.status.holds(),
                "{}: {report:?}",
                case.id
            );
            let zeros = report.runs.iter().filter(|run| run.outcome == Outcome::FalseZero).count();
            println!(
                "{:22} no solution: {zeros} false zeros of {} starts",
                case.id,
                report.runs.len()
            );
            continue;
        };
        let begin = Instant::now();
        let report =
            paper::solve(&case.contact, case.distance, case.force, &case.load, &options).unwrap();
        count.time += begin.elapsed();
        let begin = Instant::now();
        let score = mechanics::solve(
            &case.contact,
            case.distance,
            case.force,
            &case.load,
            &Options::default(),
        )
        .unwrap();
        count.default_time += begin.elapsed();
        count.default_evaluations.push(score.evaluations);
        count.default_right +=
            u32::from(score.mu_s.is_some_and(|found| (found / mu - 1.0).abs() < 1e-8));
        let near = |found: f64| (found.abs() / mu - 1.0).abs() < 1e-4;
        let mut line = String::new();
        for run in &report.runs {
            count.evaluations += u64::from(run.evaluations);
            match run.outcome {
                Outcome::Solved if near(run.mu) => count.right += 1,
                Outcome::Solved => count.wrong += 1,
                Outcome::FalseZero => count.false_zero += 1,
                Outcome::NotZero => count.not_zero += 1,
                Outcome::LostContact => count.lost += 1,
            }
            line += &format!(
                " {:?}({:.4} E={:.0e} r={:.0e} n={} rounds={}{})",
                run.outcome,
                run.mu,
                run.error,
                run.residual,
                run.evaluations,
                run.rounds,
                if run.far { " far" } else { "" }
            );
        }
        count.cases_published +=
            u32::from(report.published.is_some_and(|k| near(report.runs[k].mu)));
        count.cases_checked += u32::from(report.checked.is_some_and(|k| near(report.runs[k].mu)));
        println!("{:22} {mu:.4}:{line}", case.id);
    }
    count
}

/// Pads of different shapes off each other's middle, generic wrenches: nothing is symmetric and
/// nothing separates.
fn generic(wanted: usize) -> Vec<Case> {
    let mut state = 12_345_u64;
    let mut random = move || {
        // Knuth's MMIX constants; the upper bits are good enough to spread cases.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        2.0 * ((state >> 11) as f64 / (1u64 << 53) as f64) - 1.0
    };
    let mut cases = Vec::new();
    while cases.len() < wanted {
        let mut triangle = || {
            let corner = |angle: f64, r: f64| 0.01 * (1.0 + 0.4 * r) * DVec2::from_angle(angle);
            (0..4)
                .map(|k| {
                    corner(f64::from(k) * std::f64::consts::FRAC_PI_2 + 0.5 * random(), random())
                })
                .collect::<Vec<_>>()
        };
        let contact = Contact {
            face_i: vec![Polygon { outer: triangle(), holes: vec![] }],
            face_ii: vec![Polygon { outer: triangle(), holes: vec![] }],
        };
        let load = Wrench {
            force: 5.0 * DVec3::new(random(), random(), random()),
            moment: 0.05 * DVec3::new(random(), random(), random()),
        };
        let (distance, force) = (0.02 * (1.1 + random()), 50.0);
        let score =
            mechanics::solve(&contact, distance, force, &load, &Options::default()).unwrap();
        let areas = [&contact.face_i, &contact.face_ii]
            .map(|face| gripfast::geometry::polygon::patch_area(face));
        let full = score.contact_area_i > 0.999_999 * areas[0]
            && score.contact_area_ii > 0.999_999 * areas[1];
        if score.status == gripfast::model::Status::Ok && full {
            cases.push(Case {
                id: format!("generic_{}", cases.len()),
                contact,
                distance,
                force,
                load,
                mu: score.mu_s,
            });
        }
    }
    cases
}

fn print(title: &str, cases: &[Case]) -> Count {
    let solvable = cases.iter().filter(|case| case.mu.is_some()).count() as u32;
    let mut count = measure(cases);
    let runs = count.right + count.wrong + count.false_zero + count.not_zero + count.lost;
    println!(
        "{title}: {runs} runs: right {}, false zero {}, not zero {}, contact lost {}, wrong {}",
        count.right, count.false_zero, count.not_zero, count.lost, count.wrong
    );
    println!(
        "  of {solvable} cases right: as published {}, after the check {}, default method {}",
        count.cases_published, count.cases_checked, count.default_right
    );
    println!("  paper's method: {} evaluations, {:?}", count.evaluations, count.time);
    let total: u32 = count.default_evaluations.iter().sum();
    println!(
        "  default method: {total} evaluations, median {}, {:?}",
        median(&mut count.default_evaluations),
        count.default_time
    );
    assert_eq!(count.default_right, solvable);
    assert_eq!(count.wrong, 0);
    count
}

#[test]
fn the_papers_method_over_the_reference_cases() {
    let Some(cases) = reference() else { return };
    let count = print("as they stand", &cases);
    // Loads along the axes: mostly false zeros, every one recognised.
    assert!(
        count.false_zero > 3 * count.right && count.right >= 15,
        "{} {}",
        count.false_zero,
        count.right
    );
    let turned: Vec<Case> = cases.iter().map(|case| turned(case, 0.4)).collect();
    let count = print("seen in a frame turned by 0.4 rad", &turned);
    assert!(count.right >= 30, "{}", count.right);
}

#[test]
fn the_papers_method_under_generic_loads() {
    let count = print("generic", &generic(100));
    assert!(count.right >= 60, "{}", count.right);
}

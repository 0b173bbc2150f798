//! Every reference case: contact pairs and wrenches whose solutions were found without any closed
//! form.

use gripfast::mechanics::{Options, Refiner, solve};
use gripfast::model::{Contact, Slip, Status, Wrench};
use serde_json::Value;

fn vector(value: &Value) -> glam::DVec3 {
    serde_json::from_value(value.clone()).unwrap()
}

#[test]
fn all_reference_cases_by_newton() {
    all_reference_cases(Refiner::Newton);
}

#[test]
fn all_reference_cases_by_shanno() {
    all_reference_cases(Refiner::Shanno);
}

fn all_reference_cases(refiner: Refiner) {
    let Some(file) = crate::support::reference("cases/reference.json") else { return };
    let all: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    let mut failures = Vec::new();
    let mut evaluations = Vec::new();
    for case in all["cases"].as_array().unwrap() {
        let id = case["id"].as_str().unwrap();
        let contact: Contact =
            serde_json::from_value(serde_json::json!({"A_I": case["A_I"], "A_II": case["A_II"]}))
                .unwrap();
        let wrench = Wrench { force: vector(&case["F"]), moment: vector(&case["M"]) };
        let score = solve(
            &contact,
            case["d"].as_f64().unwrap(),
            case["Fn"].as_f64().unwrap(),
            &wrench,
            &Options { refiner, ..Options::default() },
        )
        .unwrap();
        let expected = &case["expected"];
        println!(
            "{id:28} {:?} mu {:?} evaluations {} residual {:.1e} bounds {:?}",
            score.status, score.mu_s, score.evaluations, score.residual, score.bounds
        );
        if expected["status"] == "no_solution" {
            if score.status.holds() {
                failures.push(format!("{id}: should be refused, is {score:?}"));
            }
            continue;
        }
        let want = &expected["solution"];
        let number = |name: &str| want[name].as_f64().unwrap();
        let (Status::Ok, Some(mu), Some(slip), Some(pressure)) =
            (score.status, score.mu_s, score.slip, score.pressure)
        else {
            failures.push(format!("{id}: {score:?}"));
            continue;
        };
        evaluations.push(score.evaluations);
        let estimate = want["rel_err_estimate"]
            .as_f64()
            .or(expected["rel_err_estimate"].as_f64())
            .unwrap_or(1e-12);
        let tolerance = f64::max(1e-9, estimate);
        if (mu / number("mu_s") - 1.0).abs() > tolerance && number("mu_s") != 0.0 {
            failures.push(format!(
                "{id}: mu {mu} wanted {} ({:.1e})",
                number("mu_s"),
                mu / number("mu_s") - 1.0
            ));
        }
        let length =
            case["nominal_area_I"].as_f64().unwrap_or_else(|| number("contact_area_I")).sqrt();
        match (slip, want["slip"]["type"].as_str().unwrap()) {
            (Slip::Rotation { c, sense }, "rotation") => {
                let wanted: [f64; 2] = serde_json::from_value(want["slip"]["c"].clone()).unwrap();
                let error = (c[0] - wanted[0]).hypot(c[1] - wanted[1]);
                let reach = length.max(wanted[0].hypot(wanted[1]));
                if error > 1e-7 * reach
                    || i64::from(sense) != want["slip"]["sense"].as_i64().unwrap()
                {
                    failures.push(format!("{id}: slip {slip:?} wanted {}", want["slip"]));
                }
            }
            (Slip::Translation { direction }, "translation") => {
                let wanted: [f64; 2] =
                    serde_json::from_value(want["slip"]["direction"].clone()).unwrap();
                if (direction[0] - wanted[0]).hypot(direction[1] - wanted[1]) > 1e-7 {
                    failures.push(format!("{id}: slip {slip:?} wanted {}", want["slip"]));
                }
            }
            (Slip::None, "none") => {}
            _ => failures.push(format!("{id}: slip {slip:?} wanted {}", want["slip"])),
        }
        let scale = number("aI0").abs().max(number("aII0").abs())
            + length * number("a1").hypot(number("a2"));
        for (name, got, unit) in [
            ("aI0", pressure.a_i0, 1.0),
            ("aII0", pressure.a_ii0, 1.0),
            ("a1", pressure.a1, length),
            ("a2", pressure.a2, length),
        ] {
            if (got - number(name)).abs() * unit > 1e-7 * scale {
                failures.push(format!("{id}: {name} {got} wanted {}", number(name)));
            }
        }
        for (name, got) in
            [("contact_area_I", score.contact_area_i), ("contact_area_II", score.contact_area_ii)]
        {
            if (got / number(name) - 1.0).abs() > 1e-7 {
                failures.push(format!("{id}: {name} {got} wanted {}", number(name)));
            }
        }
        let bounds = score.bounds.unwrap();
        if !(bounds.lower <= mu * (1.0 + 1e-12) && mu <= bounds.upper * (1.0 + 1e-12))
            || score.residual > 1e-10
        {
            failures.push(format!("{id}: certificate {bounds:?} residual {:e}", score.residual));
        }
    }
    evaluations.sort_unstable();
    println!(
        "evaluations: median {} most {}",
        evaluations[evaluations.len() / 2],
        evaluations[evaluations.len() - 1]
    );
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
    assert!(refiner == Refiner::Shanno || evaluations[evaluations.len() / 2] <= 50);
}

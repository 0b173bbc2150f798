//! The earlier method against reference values found by quadrature.

use gripfast::lab::earlier::centroid;
use gripfast::model::{Contact, Wrench};
use serde_json::Value;

#[test]
fn friction_by_the_earlier_method_on_the_reference_cases() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/cases/reference.json");
    let Ok(text) = std::fs::read_to_string(path) else {
        println!("SKIPPED: {path} is not here");
        return;
    };
    let file: Value = serde_json::from_str(&text).unwrap();
    let mut compared = 0;
    for case in file["cases"].as_array().unwrap() {
        let Some(want) = case["expected"]["mu_old_centroid"].as_f64() else { continue };
        let contact: Contact =
            serde_json::from_value(serde_json::json!({"A_I": case["A_I"], "A_II": case["A_II"]}))
                .unwrap();
        let vector = |name: &str| serde_json::from_value(case[name].clone()).unwrap();
        let load = Wrench { force: vector("F"), moment: vector("M") };
        let got = centroid(&contact).unwrap().mu_s(case["Fn"].as_f64().unwrap(), &load);
        assert!((got - want).abs() <= 1e-12 * want.max(1e-3), "{}: {got} {want}", case["id"]);
        compared += 1;
    }
    assert!(compared >= 30, "{compared}");
}

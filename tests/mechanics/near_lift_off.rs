//! Loads close to lifting a pad off, in which limit states hide: close to each other, or on the last
//! of a contact.

use gripfast::case;
use gripfast::mechanics::{self, Options};
use gripfast::model::Status;

use crate::support::reference;

fn only_case(name: &str) -> Option<case::Case> {
    let path = reference(&format!("trials/limit-states/{name}.json"))?;
    Some(case::read(&path).unwrap().remove(0))
}

/// A second limit state was found by other means: the answer is not called the only one, and the
/// list has both.
#[test]
fn a_second_state_is_seen() {
    for (name, second) in [
        ("h205-1980", 3.4031),
        ("h202-1396", 3.4625),
        ("h200-2480", 0.185383),
        ("m102-4155", 2.9904),
    ] {
        let Some(case) = only_case(name) else { return };
        let (contact, d, force, wrench) = (&case.contact, case.distance, case.force, &case.wrench);
        let options = Options::default();
        let answer = mechanics::solve(contact, d, force, wrench, &options).unwrap();
        assert_eq!(answer.status, Status::Ambiguous, "{name}: {answer:?}");
        let all = mechanics::limit_states(contact, d, force, wrench, &options).unwrap();
        let found: Vec<f64> = all.iter().filter_map(|score| score.mu_s).collect();
        let near = |mu: &f64| (mu / second - 1.0).abs() < 3e-5;
        assert!(found.len() > 1 && found.iter().any(near), "{name}: {found:?}");
    }
}

/// A limit state was found with fifty digits: the load is not refused.
#[test]
fn a_state_on_the_last_of_a_contact_is_found() {
    for name in ["m109-3798", "m105-943", "m107-2001", "m100-2857"] {
        let Some(case) = only_case(name) else { return };
        let options = Options::default();
        let answer =
            mechanics::solve(&case.contact, case.distance, case.force, &case.wrench, &options)
                .unwrap();
        assert!(answer.mu_s.is_some_and(|mu| mu > 0.0), "{name}: {answer:?}");
        assert!(answer.status.holds() && answer.residual < 1e-9, "{name}: {answer:?}");
    }
}

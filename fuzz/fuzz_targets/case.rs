//! Contact pairs and the solver.
#![no_main]

use gripfast::mechanics::{Options, solve};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(value) = serde_json::from_slice(data) else { return };
    if let Ok(case) = gripfast::case::parse("fuzz", value) {
        let options = Options::default();
        let _ = solve(&case.contact, case.distance, case.force, &case.wrench, &options);
    }
});

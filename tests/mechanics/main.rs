//! The mechanics: exact values, invariances, reference cases, random cases against a second derivation.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod brute;
mod curved;
mod curved_points;
mod earlier_method;
mod exact;
mod exact_motion;
mod invariances;
mod named;
mod near_lift_off;
mod paper_method;
mod random;
mod reference_cases;
#[path = "../support/mod.rs"]
mod support;

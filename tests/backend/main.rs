//! Both backends under one suite.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod suite;
#[path = "../support/mod.rs"]
mod support;
mod worst;

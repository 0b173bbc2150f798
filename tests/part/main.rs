//! Part files: every format, against truth.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod formats;
mod hostile;
#[cfg(feature = "step")]
mod step;
#[path = "../support/mod.rs"]
mod support;
mod truth;

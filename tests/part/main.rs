//! Part files: every format, against truth.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod curved;
mod cut;
mod faceted;
mod fit;
mod formats;
mod freeform;
mod hostile;
mod no_curve;
mod order;
mod solids;
#[cfg(feature = "step")]
mod step;
#[cfg(feature = "step")]
mod step_faces;
#[cfg(feature = "step")]
mod step_solids;
#[path = "../support/mod.rs"]
mod support;
mod trimmed;
mod truth;

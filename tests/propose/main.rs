//! Proposals: what is proposed, what is rejected and why.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod beside;
mod bodies;
mod curved;
mod freeform;
mod interference;
mod leaning;
mod motion;
mod negatives;
mod options;
mod order;
mod parts;
mod places;
mod round;
#[path = "../support/mod.rs"]
mod support;
mod unequal;

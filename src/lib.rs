//! Finds and ranks every two-finger grip on a CAD part by the smallest friction coefficient that holds it.
//!
//! A file imports only from modules above it in this list.

pub mod backend;
pub mod case;
pub mod contact;
pub mod error;
pub mod export;
pub mod file;
pub mod geometry;
pub mod gripper;
pub mod load;
pub mod mechanics;
pub mod model;
pub mod part;
pub mod propose;
pub mod rank;
pub mod report;
pub mod results;
pub mod units;

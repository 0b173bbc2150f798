//! Finds and ranks every two-finger grip on a CAD part by the smallest friction coefficient that
//! holds it.
//!
//! `ARCHITECTURE.md` shows the pipeline and which module may import which. Start at [`plan`] for
//! the whole job, at [`mechanics::solve`] for one contact pair.

pub mod backend;
pub mod case;
pub(crate) mod clash;
pub mod contact;
pub mod error;
pub mod export;
pub mod file;
pub mod geometry;
pub mod gripper;
pub mod lab;
pub mod load;
pub mod mechanics;
pub mod memory;
pub mod model;
pub mod part;
pub mod pick;
pub mod plan;
pub mod propose;
pub mod rank;
pub mod report;
pub mod request;
pub mod results;
pub(crate) mod svg;
pub mod text;
pub mod units;

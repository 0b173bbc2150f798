//! The program as a user runs it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod backend;
mod batch;
mod command_line;
mod docs_commands;
mod export;
mod faults;
mod figures;
mod first_steps;
mod flag_names;
mod gripper;
mod hostile;
mod part_dirty;
mod part_drawing;
mod pick;
mod plan_inside;
mod plan_more;
#[cfg(unix)]
mod plan_resume;
mod report_page;
mod request;
#[path = "../../../tests/support/mod.rs"]
mod support;
mod verdict;

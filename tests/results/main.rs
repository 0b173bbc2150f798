//! Around the ranking: loads in, results out, picking, the page in a browser.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod architecture;
mod export_frames;
mod export_native;
mod export_readers;
mod load_cases;
mod load_files;
mod pick_rank;
mod pick_scene;
mod plan_library;
mod plan_scene;
mod plan_shares;
mod poses;
mod report_browser;
mod robot_models;
#[path = "../support/mod.rs"]
mod support;

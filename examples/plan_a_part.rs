//! Plans a shipped part, watches the run and prints the best grips.
//!
//! `cargo run --release --example plan_a_part`

use std::sync::atomic::AtomicBool;

use gripfast::error::Result;
use gripfast::plan::{Observer, Plan, Progress};
use gripfast::request::Request;
use gripfast::units::{Acceleration, Length, Mass};

/// Prints how far the run has come.
struct Watch;

impl Observer for Watch {
    fn progress(&mut self, progress: Progress) {
        let Progress { done, total, grips, .. } = progress;
        println!("{done} of {total} candidates looked at, {grips} grips");
    }

    fn warning(&mut self, text: &str) {
        println!("warning: {text}");
    }
}

fn main() -> Result<()> {
    let part = concat!(env!("CARGO_MANIFEST_DIR"), "/data/parts/l_bracket.stl");
    let mut request = Request::new(part, "robotiq-2f85");
    request.mass = Some(Mass(0.35));
    request.accel = Some("2g".parse::<Acceleration>()?); // numbers are SI, texts carry their unit
    request.candidates.spacing = Some(Length(0.006));
    request.selection.top = 5;
    request.selection.diverse = true;

    let plan = Plan::new(request)?;
    let outcome = plan.run(&mut Watch, &AtomicBool::new(false))?;
    for ranked in outcome.shown() {
        let place = ranked.grip.part_from_grip.origin * 1e3;
        println!(
            "rank {}: mu_s {:.4} under '{}', at ({:.1}, {:.1}, {:.1}) mm",
            ranked.rank,
            ranked.worst.mu_s.unwrap_or_default(),
            outcome.set.loads[ranked.worst.load as usize].name,
            place.x,
            place.y,
            place.z
        );
    }
    Ok(())
}

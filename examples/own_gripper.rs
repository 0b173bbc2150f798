//! Describes a gripper, checks the description and plans with it.
//!
//! `cargo run --release --example own_gripper`

use std::sync::atomic::AtomicBool;

use gripfast::error::Result;
use gripfast::gripper;
use gripfast::plan::Plan;
use gripfast::request::Request;
use gripfast::units::{Density, Length};

/// The gripper file; docs/gripper-file.md has every field.
const GRIPPER: &str = r#"
name = "Bench gripper"
stroke = ["0mm", "60mm"]
force = ["5N", "60N"]

[pad]
rectangle = ["15mm", "10mm"]     # along the approach, across
friction = 0.6

[[finger]]                       # of the finger at +x3, jaws closed: the pad face is x3 = 0
name = "finger"
box = ["50mm", "12mm", "8mm"]
at = ["-17.5mm", "0mm", "4mm"]

[[palm]]
name = "body"
box = ["60mm", "50mm", "100mm"]
at = ["-75mm", "0mm", "0mm"]

[source]
"pad.size" = "measured"
"#;

fn main() -> Result<()> {
    let bench = gripper::parse(GRIPPER, "the bench gripper")?;
    for line in gripper::check(&bench) {
        println!("to look at: {line}");
    }
    let part = concat!(env!("CARGO_MANIFEST_DIR"), "/data/parts/hex_nut.stl");
    let mut request = Request::new(part, &bench.name);
    request.density = Some(Density(7850.0));
    request.candidates.spacing = Some(Length(0.003));
    let plan = Plan::builder(request).gripper(bench).build()?;
    let set = plan.run(&mut (), &AtomicBool::new(false))?.set;
    println!("{} of {} candidates hold", set.summary.ranked, set.summary.candidates);
    for (reason, count) in &set.summary.rejections {
        println!("{count:6} {}", reason.replace('_', " "));
    }
    Ok(())
}

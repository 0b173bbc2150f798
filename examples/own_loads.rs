//! Plans a part under loads of one's own: a drilling thrust and its torque, besides the weight.
//!
//! `cargo run --release --example own_loads`

use std::sync::atomic::AtomicBool;

use glam::DVec3;
use gripfast::error::Result;
use gripfast::model::Wrench;
use gripfast::part::{Part, ReadOptions};
use gripfast::plan::Plan;
use gripfast::request::Request;
use gripfast::results::LoadCase;
use gripfast::units::{Length, Mass, STANDARD_GRAVITY};

fn main() -> Result<()> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/data/parts/pocket_plate.stl");
    let part = Part::read(file.as_ref(), &ReadOptions::default())?;
    let mass = 0.3;
    let centre = part.mass_properties(1.0).centre_of_mass;
    let weight = DVec3::new(0.0, 0.0, -mass * STANDARD_GRAVITY);

    // Wrenches act on the part, in its frame, the moment about its centre of mass.
    let drilled_at = |hole: DVec3| {
        let thrust = DVec3::new(0.0, 0.0, -15.0);
        let torque = DVec3::new(0.0, 0.0, 0.2);
        Wrench { force: weight + thrust, moment: (hole - centre).cross(thrust) + torque }
    };
    let hole = centre + DVec3::new(0.01, 0.01, 0.0);
    let loads = vec![
        LoadCase { name: "weight".into(), wrench: Wrench { force: weight, ..Wrench::default() } },
        LoadCase { name: "drilling".into(), wrench: drilled_at(hole) },
    ];

    let mut request = Request::new(file, "generic");
    request.mass = Some(Mass(mass));
    request.candidates.spacing = Some(Length(0.008));
    let plan = Plan::builder(request).part(part).loads(loads).build()?;
    let outcome = plan.run(&mut (), &AtomicBool::new(false))?;
    println!("{} grips hold", outcome.set.holding().unwrap_or_default());
    if let Some(best) = outcome.set.grips.first() {
        println!(
            "the best needs a friction of {:.3} under '{}' and {:.1} N with its own pads",
            best.worst.mu_s.unwrap_or_default(),
            outcome.set.loads[best.worst.load as usize].name,
            best.force_needed.unwrap_or_default()
        );
    }
    Ok(())
}

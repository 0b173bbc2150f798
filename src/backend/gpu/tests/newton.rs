//! Estimates of loads without bounds: against double precision, and the kernel against its twin.

use super::super::check::estimates::{self, Estimates, LiftingGrip};
use super::*;

/// Limits of no device.
const LIMITS: Limits = Limits {
    loads: 1 << 14,
    grips: 1 << 14,
    contacts: 1 << 14,
    edges: 1 << 16,
    basis: 1 << 20,
    cases: 1 << 14,
    entries: 1 << 16,
};

/// The twin alone, which runs everywhere. GRIPFAST_LONG=100 tries four million loads.
#[test]
fn estimates_are_within_their_margin() {
    let times = std::env::var("GRIPFAST_LONG").ok().and_then(|text| text.parse::<u64>().ok());
    let (seeds, mut all) = (SeedSet::default(), Estimates::default());
    for round in 0..times.unwrap_or(1) {
        let grips = Random(101 + round).lifting_grips(400, 100);
        let problems: Vec<Problem<'_>> = grips.iter().map(LiftingGrip::problem).collect();
        let made = Contacts::new(&problems).unwrap();
        for (chunk, plan) in estimates::chunks(&made, &problems, (LIMITS, &seeds)) {
            let twin = twins(&chunk, &seeds).entries;
            let pieces = plan.iter().flat_map(|(slot, all)| all.iter().map(move |one| (slot, one)));
            for ((slot, piece), number) in pieces.zip(0..) {
                let pads = made.ready[*slot].pads.as_ref().unwrap();
                all.add(pads, &problems[piece.problem], [&twin, &twin], number);
            }
        }
    }
    all.margins.sort_by(f64::total_cmp);
    let margin = |share: f64| all.margins[(share * (all.margins.len() - 1) as f64) as usize];
    let [half, most] = [0.5, 0.9].map(margin);
    all.margins.clear();
    println!("margins {half:.1e}, {most:.1e}; {all:?}");
    assert!(all.of_margin > 0.01 && all.of_margin < 0.3, "{all:?}");
    // Nine tenths of those that are meant to have one, and most of them lift a pad.
    assert!(all.estimated * 10 > (all.open - all.refused - all.hard) * 9, "{all:?}");
    assert!(all.lifted * 2 > all.estimated && all.open > 10_000, "{all:?}");
    assert!(half < 1e-3, "{half}");
}

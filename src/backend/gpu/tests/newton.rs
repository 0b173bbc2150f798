//! Estimates of loads without bounds: against double precision, and the kernel against its twin.

use super::super::check::estimates::{self, Estimates, LiftingGrip};
use super::*;
use crate::backend::layout::{BITS, ESTIMATED, KINDS, OPEN};
use crate::load::{LoadSet, LoadSource};
use crate::mechanics::{Options, Search, solve_pads};
use crate::part::{Part, ReadOptions};
use crate::propose::{ProposeOptions, Proposer};

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

/// Loads of some grips of a part, those that are open before Newton's method and after it, those that come
/// back with an estimate, and of the ones still open those that have a limit state.
fn open_loads(part: &Part, gripper: &str, force: f64, loads: &LoadSet) -> [usize; 5] {
    let gripper = crate::gripper::find(gripper).unwrap();
    let options = ProposeOptions::default().with_spacing(Some(0.006));
    let all: Vec<_> =
        Proposer::new(part, &gripper, &options).unwrap().flat_map(|chunk| chunk.grips).collect();
    let step = (all.len() / 25).max(1);
    let mass = part.mass_properties(7850.0);
    let list: Vec<Wrench> = loads.cases(&mass).unwrap().iter().map(|load| load.wrench).collect();
    let problem = |grip| {
        let grip: &crate::model::Grip = grip;
        let centre_of_mass = mass.centre_of_mass;
        Problem {
            contact: &grip.contact,
            distance: grip.distance(),
            force: force * 9.81 * mass.mass,
            wrenches: &list,
            pose: Some(Pose { centre_of_mass, part_from_grip: grip.part_from_grip }),
        }
    };
    let problems: Vec<Problem<'_>> = all.iter().step_by(step).map(problem).collect();
    let made = Contacts::new(&problems).unwrap();
    let seeds = SeedSet::default();
    let users = (0..problems.len()).map(|index| (made.slots[index], vec![index])).collect();
    let mut count = [problems.len() * list.len(), 0, 0, 0, 0];
    let options = Options { search: Search::Off, ..Options::default() };
    for plan in plans(&made, &problems, users, (LIMITS, seeds.len())) {
        for (wanted, at) in [(Wanted::Worst, 1), (Wanted::Estimated, 2)] {
            let with = (seeds.len(), wanted);
            let chunk = Maker::default().chunk((&made, &problems), &plan, with);
            let pieces: Vec<_> = plan.iter().flat_map(|(_, pieces)| pieces).collect();
            for entry in twins(&chunk, &seeds).entries {
                count[3] += usize::from(entry.kind % KINDS == ESTIMATED);
                let (index, problem) = (pieces[entry.grip as usize].problem, &problems);
                let (problem, pads) = (&problem[index], &made.ready[made.slots[index]].pads);
                let bit = |bit: &usize| entry.words[bit / 32] >> (bit % 32) & 1 == 1;
                for load in (0..BITS).filter(|at| entry.kind == OPEN && bit(at)) {
                    count[at] += 1;
                    let wrench = problem.wrench(entry.load as usize + load);
                    let pads = pads.as_ref().unwrap();
                    let (distance, force) = (problem.distance, problem.force);
                    let held = at == 2
                        && solve_pads(pads, distance, force, &wrench, &options).mu_s.is_some();
                    count[4] += usize::from(held);
                }
            }
        }
    }
    count
}

/// On grips of parts, from pads pressed all over to pads about to be torn off: loads that the device
/// leaves to the processor are few where they can be held.
#[test]
fn few_loads_of_a_part_are_left_open() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("data/parts");
    let mut sums = [[0; 5]; 4];
    for (name, gripper) in [
        ("l_bracket.stl", "robotiq-2f85"),
        ("pocket_plate.stl", "generic"),
        ("spur_gear.stl", "robotiq-hande"),
        ("t_slot_bar.stl", "wsg50-110"),
    ] {
        let part = Part::read(&folder.join(name), &ReadOptions::default()).unwrap();
        let weight = 9.81 * part.mass_properties(7850.0).mass;
        let ball = LoadSource::Ball { directions: 300, force: 2.0 * weight, moment: None };
        let loads = LoadSet::new(vec![ball]);
        for (force, sum) in [200.0, 50.0, 12.0, 4.0].into_iter().zip(&mut sums) {
            let count = open_loads(&part, gripper, force, &loads);
            println!(
                "{name}, {force} times the weight: {count:?} of loads, open, left, estimated, held"
            );
            sum.iter_mut().zip(count).for_each(|(sum, count)| *sum += count);
        }
    }
    println!("{sums:?}");
    for [loads, open, left, estimated, _] in &sums[..3] {
        assert!(left * 10 <= *open && estimated * 20 <= *loads, "{sums:?}");
    }
    assert!(sums[2][1] * 4 > sums[2][0], "{sums:?}");
}

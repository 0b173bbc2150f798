//! The main job on a shipped part, on one thread and on all: candidates proposed and checked, and
//! the whole plan from the file to the ranked list. `cargo bench --bench plan`

#![allow(clippy::unwrap_used, reason = "a bench stops by panicking")]
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use std::path::PathBuf;
use std::time::Duration;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use gripfast::backend::{Backend, SeedSet};
use gripfast::gripper::{self, Gripper};
use gripfast::load::LoadSet;
use gripfast::part::{Part, ReadOptions};
use gripfast::plan::{Assessor, Collector, Settings};
use gripfast::propose::{ProposeOptions, Proposer};
use gripfast::rank::{self, Weights};
use gripfast::units::STANDARD_GRAVITY;

fn read() -> Part {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("data/parts/l_bracket.stl");
    Part::read(&file, &ReadOptions::default()).unwrap()
}

/// What `gripfast plan l_bracket.stl --mass 350g` does, but for printing; the number of grips
/// ranked.
fn plan(gripper: &Gripper, loads: &LoadSet, seeds: &SeedSet) -> u64 {
    let part = read();
    let mass = part.mass_properties(0.35 / part.mass_properties(1.0).volume);
    let cases = loads.cases(&mass).unwrap();
    let weights = Weights { k1: 1.0, k2: 1.0 };
    let settings = Settings::of_force(gripper.force[1])
        .with_weights(weights)
        .with_pad_friction(gripper.pad_friction);
    let assessor =
        Assessor { loads: &cases, mass, settings: &settings, backend: &Backend::Cpu, seeds };
    let mut collector = Collector::default();
    for chunk in Proposer::new(&part, gripper, &ProposeOptions::default()).unwrap() {
        collector.add(assessor.assess(chunk.grips).unwrap(), 10_000, weights, settings.pads);
    }
    let (low, high) = part.mesh.bounding_box();
    let mut ranking = collector.finish(
        mass.centre_of_mass,
        (high - low).length(),
        &rank::Options::default()
            .with_weights(weights)
            .with_pads(settings.pads)
            .with_top(Some(10_000)),
    );
    assessor.finish(&mut ranking.grips).unwrap();
    ranking.ranked
}

fn l_bracket(criterion: &mut Criterion) {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let part = read();
    let propose = || {
        let mut proposer = Proposer::new(&part, &gripper, &ProposeOptions::default()).unwrap();
        let grips: usize = proposer.by_ref().map(|chunk| chunk.grips.len()).sum();
        (proposer.tally().candidates, grips)
    };
    let gravity = LoadSet::default().with_acceleration(2.0 * STANDARD_GRAVITY);
    let ball = LoadSet::parse("ball", "ball:500").unwrap();
    let seeds = SeedSet::default();
    let mut group = criterion.benchmark_group("l_bracket.stl, robotiq-2f85");
    group
        .sample_size(10)
        .sampling_mode(SamplingMode::Flat)
        .measurement_time(Duration::from_secs(5))
        .warm_up_time(Duration::from_secs(1));
    let all = rayon::current_num_threads();
    for threads in if all > 1 { vec![1, all] } else { vec![1] } {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (candidates, _) = pool.install(propose);
        group.throughput(Throughput::Elements(candidates));
        group.bench_function(format!("candidates, {threads} thread(s)"), |bench| {
            pool.install(|| bench.iter(propose))
        });
        for (name, loads) in [("gravity + 2g", &gravity), ("ball:500", &ball)] {
            let ranked = pool.install(|| plan(&gripper, loads, &seeds));
            group.throughput(Throughput::Elements(ranked));
            group.bench_function(format!("plan, {name}, {threads} thread(s)"), |bench| {
                pool.install(|| bench.iter(|| plan(&gripper, loads, &seeds)))
            });
        }
    }
    group.finish();
}

criterion_group!(benches, l_bracket);
criterion_main!(benches);

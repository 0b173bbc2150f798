//! Mutated input over every reader, the solver and clipping: an error or an answer, never a panic,
//! two seconds or a gigabyte.
//!
//! Runs a few seconds; `GRIPFAST_FUZZ_SECONDS` sets another time, `GRIPFAST_FUZZ_SEED` another
//! start. A case that breaks the rule is written to the temporary folder and named; it becomes a
//! test of the reader.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod mutate;
mod seeds;
#[path = "../support/mod.rs"]
mod support;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use gripfast::geometry::overlay;
use gripfast::gripper::file;
use gripfast::mechanics::{Options, solve};
use gripfast::part::{Part, ReadOptions};
use gripfast::pick::Scene;

use support::random::Random;

/// Longest that one input may take.
const HANG: Duration = Duration::from_secs(2);
/// Memory that reading a part may take [bytes]; far below the gigabyte of the rule.
const MEMORY: u64 = 64 << 20;

/// A kind of input: the name of its file, good examples, and what reads it.
struct Target {
    name: &'static str,
    seeds: Vec<Vec<u8>>,
    read: fn(&Path, &[u8]),
    /// Made of the mutated bytes before they are written.
    wrap: fn(Vec<u8>) -> Vec<u8>,
}

fn part(path: &Path, _: &[u8]) {
    let options = ReadOptions::default().with_max_memory(Some(MEMORY));
    if let Ok(part) = Part::read(path, &options) {
        let mass = part.mass_properties(1.0);
        assert!(mass.volume.is_finite() && mass.centre_of_mass.is_finite());
        let all = part.mesh.triangles.iter().flatten();
        assert!(all.into_iter().all(|&vertex| (vertex as usize) < part.mesh.vertices.len()));
        part.pairs(0.0, 1.0);
    }
}

fn case(path: &Path, _: &[u8]) {
    for case in gripfast::case::read(path).into_iter().flatten() {
        overlay::intersect(&case.contact.face_i, &case.contact.face_ii);
        let options = Options::default();
        let score = solve(&case.contact, case.distance, case.force, &case.wrench, &options);
        if let Ok(score) = score {
            assert!(score.mu_s.is_none_or(|mu| mu >= 0.0), "{score:?}");
        }
    }
}

fn gripper(_: &Path, bytes: &[u8]) {
    if let Ok(gripper) = file::parse(&String::from_utf8_lossy(bytes), "fuzz") {
        gripfast::gripper::check(&gripper);
        gripfast::gripper::drawing::svg(&gripper);
    }
}

fn scene(path: &Path, bytes: &[u8]) {
    let folder = path.parent().unwrap();
    let _ = Scene::parse("fuzz", &String::from_utf8_lossy(bytes), folder);
}

fn targets() -> Vec<Target> {
    let plain = |name, seeds, read| Target { name, seeds, read, wrap: |bytes| bytes };
    vec![
        plain("a.stl", vec![seeds::stl_text(), seeds::stl_binary()], part),
        plain("a.obj", vec![seeds::obj()], part),
        plain("a.off", vec![seeds::off()], part),
        plain("a.ply", vec![seeds::ply_text(), seeds::ply_binary()], part),
        plain("a.gltf", vec![seeds::gltf()], part),
        plain("a.glb", vec![seeds::glb()], part),
        plain("a.3mf", vec![seeds::package(seeds::model())], part),
        Target { name: "b.3mf", seeds: vec![seeds::model()], read: part, wrap: seeds::package },
        plain("a.off.gz", vec![seeds::zipped(seeds::off())], part),
        Target { name: "b.off.gz", seeds: vec![seeds::off()], read: part, wrap: seeds::zipped },
        plain("a.json", vec![seeds::case()], case),
        plain("gripper.toml", vec![seeds::gripper()], gripper),
        plain("scene.toml", vec![seeds::scene()], scene),
    ]
}

#[test]
fn mutated_input_gives_an_error_or_an_answer() {
    let seconds = std::env::var("GRIPFAST_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok());
    let seed = std::env::var("GRIPFAST_FUZZ_SEED").ok().and_then(|text| text.parse().ok());
    let end = Instant::now() + Duration::from_secs(seconds.unwrap_or(5));
    let folder = tempfile::tempdir().unwrap();
    let targets = targets();
    for target in &targets {
        for seed in &target.seeds {
            run(target, &(target.wrap)(seed.clone()), folder.path());
        }
    }
    let mut random = Random::new(seed.unwrap_or(1));
    let mut count = 0_u64;
    while Instant::now() < end {
        for target in &targets {
            let seed = &target.seeds[random.below(target.seeds.len())];
            let bytes = mutate::mutated(seed.clone(), &mut random);
            run(target, &(target.wrap)(bytes), folder.path());
            count += 1;
        }
    }
    println!("{count} executions");
    assert!(count > 0);
    #[cfg(target_os = "linux")]
    {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
        let kilobytes: u64 = peak.trim().trim_end_matches("kB").trim().parse().unwrap();
        assert!(kilobytes < 1 << 20, "{kilobytes} kB at the peak");
    }
}

/// One execution; a breach of the rule fails the test and keeps the input.
fn run(target: &Target, bytes: &[u8], folder: &Path) {
    let path = folder.join(target.name);
    std::fs::write(&path, bytes).unwrap();
    let broken = |what: &str| -> ! {
        let kept = std::env::temp_dir().join(format!("gripfast-fuzz-{}", target.name));
        std::fs::write(&kept, bytes).unwrap();
        panic!("{what}: {}", kept.display());
    };
    // A busy machine may hold up one execution, hardly the same one three times.
    for attempt in 1..=3 {
        let start = Instant::now();
        if catch_unwind(AssertUnwindSafe(|| (target.read)(&path, bytes))).is_err() {
            broken("panicked");
        }
        if start.elapsed() < HANG {
            return;
        }
        if attempt == 3 {
            broken("took more than two seconds");
        }
    }
}

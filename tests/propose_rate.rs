//! Candidates per second against the number of triangles, on one thread and on all; measured by hand:
//! `cargo test --release --test propose_rate -- --ignored --nocapture`

#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use std::path::PathBuf;
use std::time::Instant;

use glam::DVec3;
use gripfast::gripper;
use gripfast::part::{Part, ReadOptions};
use gripfast::propose::{ProposeOptions, Proposer};

fn refined(part: &Part, times: u32) -> Part {
    let mut triangles: Vec<[DVec3; 3]> = (0..part.mesh.triangles.len() as u32).map(|index| part.mesh.corners(index)).collect();
    let round = |point: DVec3| (point * 1e3).as_vec3().as_dvec3() * 1e-3;
    for _ in 0..times {
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0].map(round);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let vertices: Vec<DVec3> = triangles.iter().flatten().copied().collect();
    let indices: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
    Part::from_triangles("refined", &vertices, &indices).unwrap()
}

fn measure(label: &str, part: &Part, name: &str, spacing: f64) {
    let gripper = gripper::find(name).unwrap();
    let options = ProposeOptions { spacing: Some(spacing), ..ProposeOptions::default() };
    let start = Instant::now();
    let mut proposer = Proposer::new(part, &gripper, &options).unwrap();
    let made = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let grips: usize = proposer.by_ref().map(|chunk| chunk.grips.len()).sum();
    let seconds = start.elapsed().as_secs_f64();
    let candidates = proposer.tally().candidates;
    println!(
        "{label:<28} {name:<13} {:>8} triangles: set-up {made:>7.3} s, {candidates:>8} candidates, {grips:>7} grips in {seconds:>7.3} s: {:>9.0}/s",
        part.mesh.triangles.len(),
        candidates as f64 / seconds
    );
}

#[test]
#[ignore = "a measurement; run by hand"]
fn rate() {
    let path = |file: &str| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/parts").join(file);
    if !path("parts/trimesh__plate_holes.STL").is_file() {
        eprintln!("SKIPPED: the reference parts are not there");
        return;
    }
    let read = |file: &str| Part::read(&path(file), &ReadOptions::default()).unwrap();
    let most: u32 = std::env::var("GRIPFAST_REFINE").ok().and_then(|text| text.parse().ok()).unwrap_or(4);
    let plate = read("parts/trimesh__plate_holes.STL");
    let gear = read("gen/gen_spurgear_m2_z24.stl");
    let slot = read("gen/gen_vslot_20x20_100.stl");
    let parts: Vec<(String, Part)> = (0..=most).map(|times| (format!("plate, split {times} times"), refined(&plate, times))).collect();
    if let Ok(file) = std::env::var("GRIPFAST_PART") {
        let start = Instant::now();
        let part = Part::read(file.as_ref(), &ReadOptions::default()).unwrap();
        println!("read in {:.3} s, {} faces", start.elapsed().as_secs_f64(), part.faces.len());
        return measure(&file, &part, "generic", 2e-3);
    }
    for threads in [1, rayon::current_num_threads()] {
        println!("{threads} thread(s)");
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            for (label, part) in &parts {
                measure(label, part, "generic", 2e-3);
            }
            for name in ["generic", "robotiq-2f85", "franka"] {
                measure("plate", &plate, name, 2e-3);
                measure("gear", &gear, name, 1e-3);
                measure("V-slot bar", &slot, name, 1e-3);
            }
        });
    }
}

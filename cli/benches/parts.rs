//! Reading, proposing and memory against the number of triangles: `cargo bench --bench parts`.
//!
//! Shipped parts are refined as a finer export of the same part would be, straight into a file, so
//! that the bench itself needs no memory to speak of. `GRIPFAST_TRIANGLES=400000` stops earlier,
//! `GRIPFAST_PART=FILE.stl` takes another part. Times are those of one thread (processor time where
//! the system tells it), so that other work on the machine disturbs little.

#![allow(clippy::unwrap_used, reason = "a bench stops by panicking")]

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};
use gripfast::gripper;
use gripfast::part::{Part, ReadOptions};
use gripfast::propose::{ProposeOptions, Proposer};

/// Seconds of processor time of this thread so far; `None` where /proc does not tell.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

/// Seconds that `work` takes on this thread, without its preparation: the mean over half a second
/// or one run. The system counts processor time by the tick, so that short work is not resolved one
/// by one, but many together are.
fn seconds<P, T>(prepare: impl Fn() -> P, work: impl Fn(P) -> T) -> (f64, T) {
    let begin = Instant::now();
    let (mut spent, mut runs) = (0.0, 0);
    loop {
        let prepared = prepare();
        let (start, processor) = (Instant::now(), processor_seconds());
        let result = work(prepared);
        let wall = start.elapsed().as_secs_f64();
        spent += processor.zip(processor_seconds()).map_or(wall, |(before, after)| after - before);
        runs += 1;
        if begin.elapsed() > Duration::from_millis(500) {
            return (spent / f64::from(runs), result);
        }
    }
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/parts").join(name)
}

/// Writes the part with every triangle split in four, `times` over, at its edges' middles, as
/// binary STL.
fn refined(name: &str, times: u32, path: &Path) -> usize {
    fn split(triangle: [Vec3; 3], times: u32, out: &mut impl Write) {
        let [a, b, c] = triangle;
        if times == 0 {
            let numbers = [Vec3::ZERO, a, b, c].map(|vector| vector.to_array());
            out.write_all(bytemuck::bytes_of(&numbers)).unwrap();
            return out.write_all(&[0, 0]).unwrap();
        }
        let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            split(part, times - 1, out);
        }
    }
    let part = Part::read(&shipped(name), &ReadOptions::default()).unwrap();
    let count = part.mesh.triangles.len() << (2 * times);
    let mut out = BufWriter::new(std::fs::File::create(path).unwrap());
    out.write_all(&[b' '; 80]).unwrap();
    out.write_all(&u32::try_from(count).unwrap().to_le_bytes()).unwrap();
    for index in 0..part.mesh.triangles.len() as u32 {
        split(
            part.mesh.corners(index).map(|corner: DVec3| (corner * 1e3).as_vec3()),
            times,
            &mut out,
        );
    }
    out.flush().unwrap();
    count
}

/// Proposes all grips: seconds to set up, seconds to propose, candidates, grips.
fn propose(part: &Part, name: &str, spacing: f64) -> (f64, f64, u64, u64) {
    let gripper = gripper::find(name).unwrap();
    let options = ProposeOptions::default().with_spacing(Some(spacing));
    let prepare = || Proposer::new(part, &gripper, &options).unwrap();
    let (set_up, _) = seconds(|| (), |()| prepare().candidates());
    let (proposing, (candidates, grips)) = seconds(prepare, |mut proposer| {
        proposer.by_ref().for_each(drop);
        (proposer.tally().candidates, proposer.tally().grips)
    });
    (set_up, proposing, candidates, grips)
}

/// Peak memory [MB] and seconds of a whole run of the program; `None` where /proc does not tell.
fn whole_program(arguments: &[&str]) -> (f64, Option<f64>) {
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_gripfast"))
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap();
    let mut peak = None;
    while child.try_wait().unwrap().is_none() {
        if let Ok(text) = std::fs::read_to_string(format!("/proc/{}/status", child.id())) {
            let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            peak = line
                .and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok())
                .map(|kilobytes| kilobytes / 1e3)
                .or(peak);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    (start.elapsed().as_secs_f64(), peak)
}

fn main() {
    let most: usize = std::env::var("GRIPFAST_TRIANGLES")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(6_000_000);
    let folder = tempfile::tempdir().unwrap();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();

    println!(
        "one thread; candidates: position grid of 2 mm (gear 1 mm), angles every 15 degrees and along the edges, generic gripper"
    );
    println!(
        "part                 triangles   read, weld, faces   set-up    candidates    grips   proposed and checked"
    );
    let other = std::env::var("GRIPFAST_PART");
    let shipped_parts =
        [("pocket_plate.stl", 2e-3), ("spur_gear.stl", 1e-3), ("t_slot_bar.stl", 1e-3)];
    for (name, spacing) in
        other.as_deref().map_or(shipped_parts.to_vec(), |file| vec![(file, 2e-3)])
    {
        let mut first: Option<(u64, f64)> = None;
        for times in 0.. {
            let path = folder.path().join("part.stl");
            let coarse =
                Part::read(&shipped(name), &ReadOptions::default()).unwrap().mesh.triangles.len();
            if coarse << (2 * times) > most {
                break;
            }
            let count = refined(name, times, &path);
            let (reading, part) = one.install(|| {
                seconds(|| (), |()| Part::read(&path, &ReadOptions::default()).unwrap())
            });
            assert_eq!(part.mesh.triangles.len(), count);
            let (set_up, proposing, candidates, grips) =
                one.install(|| propose(&part, "generic", spacing));
            let rate = candidates as f64 / proposing;
            let (known, coarse_rate) = *first.get_or_insert((candidates, rate));
            assert_eq!(
                candidates, known,
                "the same part, more finely meshed, has the same candidates"
            );
            println!(
                "{name:<18} {count:>11} {reading:>10.4} s {:>6.2} M/s {set_up:>7.3} s {candidates:>11} {grips:>8} {rate:>12.0}/s {:>6.2}",
                count as f64 / reading / 1e6,
                rate / coarse_rate
            );
        }
    }

    if other.is_ok() {
        return;
    }
    println!("\nparts as shipped, one thread, 1 mm");
    for name in
        ["pocket_plate.stl", "l_bracket.stl", "hex_nut.stl", "spur_gear.stl", "t_slot_bar.stl"]
    {
        let part = Part::read(&shipped(name), &ReadOptions::default()).unwrap();
        for gripper in ["generic", "robotiq-2f85", "franka"] {
            let (_, proposing, candidates, grips) = one.install(|| propose(&part, gripper, 1e-3));
            println!(
                "{name:<18} {gripper:<14} {candidates:>10} candidates {grips:>8} grips {:>12.0}/s",
                candidates as f64 / proposing
            );
        }
    }

    println!("\nthe whole program, all threads: gripfast plan with one load, a million candidates");
    let path = folder.path().join("part.stl");
    for times in [0, 4, 5, 6, 7] {
        let count = refined("t_slot_bar.stl", times, &path);
        if count > most {
            break;
        }
        let file = path.display().to_string();
        let arguments = [
            "plan",
            &file,
            "--gripper",
            "generic",
            "--mass",
            "300g",
            "--loads",
            "gravity:-z",
            "--spacing",
            "0.5mm",
            "--quiet",
        ];
        let (wall, peak) = whole_program(&arguments);
        println!(
            "{count:>9} triangles: {wall:>7.1} s, peak {} MB",
            peak.map_or("?".into(), |peak| format!("{peak:.0}"))
        );
    }
}

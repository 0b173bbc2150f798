//! Proposals on curved faces, the search for their sites included, beside those between planes:
//! `cargo bench --bench propose`.
//!
//! One thread, processor time where the system tells it. `GRIPFAST_PARTS=a.stl:b.stl` takes other
//! parts, `GRIPFAST_SPACING=0.001` another grid than that of the gripper \[m\].

#![allow(clippy::unwrap_used, reason = "a bench stops by panicking")]

use std::path::Path;
use std::time::{Duration, Instant};

use glam::{DVec2, DVec3};
use gripfast::gripper;
use gripfast::part::{Part, ReadOptions};
use gripfast::propose::{ProposeOptions, Proposer};

#[path = "../tests/support/lathe.rs"]
mod lathe;

/// Time over which runs of one part are averaged; the better of two such averages counts.
const TIME: Duration = Duration::from_millis(400);

/// Seconds of processor time of this thread so far; `None` where /proc does not tell.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

/// Seconds that `work` takes on this thread, the mean of many runs.
fn seconds<T>(work: &impl Fn() -> T) -> (f64, T) {
    let (begin, processor) = (Instant::now(), processor_seconds());
    for runs in 1.. {
        let result = work();
        if begin.elapsed() > TIME {
            let wall = begin.elapsed().as_secs_f64();
            let spent = processor.zip(processor_seconds()).map_or(wall, |(a, b)| b - a);
            return (spent / f64::from(runs), result);
        }
    }
    unreachable!("the time comes to an end")
}

/// A closed surface over turns and places along it from 0 to 1, in rows.
fn turned(rows: u32, ends: [DVec3; 2], at: impl Fn(f64, f64) -> DVec3) -> Part {
    let along = |row: f64| row / f64::from(rows - 1);
    let (vertices, triangles) = lathe::lathe(64, rows, ends, |turn, row| at(turn, along(row)));
    Part::from_triangles("part", &vertices, &triangles).unwrap()
}

fn ellipsoid(half: DVec3) -> Part {
    turned(41, [DVec3::NEG_Z * half.z, DVec3::Z * half.z], move |turn, along| {
        let (sine, cosine) = (3.0 * (along - 0.5)).sin_cos();
        half * DVec3::new(cosine * turn.cos(), cosine * turn.sin(), sine)
    })
}

/// Straight from end to end, or bent outwards.
fn round(radii: [f64; 2], bulge: f64) -> Part {
    let rows = 2 + 30 * u32::from(bulge > 0.0);
    turned(rows, [DVec3::ZERO, DVec3::Z * 0.06], move |turn, along| {
        let radius = radii[0] + (radii[1] - radii[0]) * along + bulge * along * (1.0 - along);
        DVec3::new(radius * turn.cos(), radius * turn.sin(), 0.06 * along)
    })
}

fn prism(at: impl Fn(f64) -> DVec2) -> Part {
    turned(2, [DVec3::ZERO, DVec3::Z * 0.05], |turn, along| at(turn).extend(0.05 * along))
}

/// `|x/a|^n + |y/b|^n = 1`.
fn superellipse(exponent: f64) -> Part {
    let power = |x: f64| x.abs().powf(2.0 / exponent).copysign(x);
    prism(move |turn| DVec2::new(0.020 * power(turn.cos()), 0.014 * power(turn.sin())))
}

/// With the support function `R + e cos 3t`: as wide in every direction.
fn lobed() -> Part {
    prism(|turn| {
        let (height, slope) = (0.015 + 0.0008 * (3.0 * turn).cos(), -0.0024 * (3.0 * turn).sin());
        let normal = DVec2::from_angle(turn);
        normal * height + normal.perp() * slope
    })
}

fn bottle() -> Part {
    turned(61, [DVec3::ZERO, DVec3::Z * 0.12], |turn, along| {
        let t = ((0.12 * along - 0.070) / 0.025).clamp(0.0, 1.0);
        let wide = DVec2::new(0.030 * turn.cos(), 0.018 * turn.sin());
        (wide * (1.0 - 0.6 * t * t * (3.0 - 2.0 * t))).extend(0.12 * along)
    })
}

fn parts() -> Vec<(String, Part)> {
    let read = |file: &Path| Part::read(file, &ReadOptions::default()).unwrap();
    if let Ok(files) = std::env::var("GRIPFAST_PARTS") {
        return files.split(':').map(|file| (file.to_owned(), read(Path::new(file)))).collect();
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/parts");
    let parts = [
        ("L bracket, planes", read(&folder.join("l_bracket.stl"))),
        ("pocket plate, planes", read(&folder.join("pocket_plate.stl"))),
        ("cylinder", round([0.015, 0.015], 0.0)),
        ("frustum", round([0.016, 0.014], 0.0)),
        ("barrel", round([0.012, 0.012], 0.02)),
        ("ball", ellipsoid(DVec3::splat(0.02))),
        ("egg", ellipsoid(DVec3::new(0.014, 0.014, 0.020))),
        ("ellipsoid", ellipsoid(DVec3::new(0.010, 0.015, 0.022))),
        ("lobed prism", lobed()),
        ("superellipse prism", superellipse(3.0)),
        ("oval bottle", bottle()),
    ];
    parts.map(|(name, part)| (name.to_owned(), part)).into()
}

fn rates() {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let asked = std::env::var("GRIPFAST_SPACING").ok().map(|text| text.parse().unwrap());
    println!("robotiq-2f85, one thread");
    for (name, part) in parts() {
        for spacing in asked.map_or(vec![None, Some(1e-3)], |spacing| vec![Some(spacing)]) {
            let options = ProposeOptions::default().with_spacing(spacing).with_curved(Some(true));
            let run = || {
                let mut proposer = Proposer::new(&part, &gripper, &options).unwrap();
                proposer.by_ref().for_each(drop);
                (proposer.tally().candidates, proposer.tally().grips)
            };
            let (sites, _) = seconds(&|| {
                Proposer::new(&part, &gripper, &options).map(|proposer| proposer.candidates())
            });
            let (one, (candidates, grips)) = seconds(&run);
            let spent = one.min(seconds(&run).0);
            let grid = spacing.map_or("default".into(), |spacing| format!("{} mm", 1e3 * spacing));
            let per = 1e6 / candidates.max(1) as f64;
            println!(
                "{name:<24} {grid:<8} {candidates:>8} candidates {grips:>8} grips {:>8.2} us a candidate, sites {:>8.2} us, {:>8.2} ms",
                per * spent,
                per * sites,
                1e3 * sites
            );
        }
    }
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(rates);
}

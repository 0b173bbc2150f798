//! `gripfast bench`: how fast this machine scores, and whether its backends agree.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args as ClapArgs;
use glam::{DVec2, DVec3};
use gripfast::backend::{
    Backend, Batch, Choice, Polish, Problem, ScoreOptions, Scored, Seed, SeedSet, SeedStatus,
};
use gripfast::load::sphere;
use gripfast::model::{Contact, Polygon, Wrench};
use serde_json::json;

use super::backend::{self, BackendArgs};

/// Measures seed evaluations, exact solves and scored grips per second, and checks the GPU against
/// the processor.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast bench\n  gripfast bench --backend gpu --json\n  gripfast bench --backend cpu --seconds 3 --seeds 321\n\n\
Times include upload and readback. Each workload runs once to warm up, then until the time is over. A software adapter is checked, its times mean nothing."
)]
pub(crate) struct Args {
    #[command(flatten)]
    backend: BackendArgs,
    /// Loads on each grip: unit forces spread over the sphere.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..))]
    loads: u32,
    /// Grips of each workload; those that solve many loads exactly take a twentieth.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..))]
    grips: u32,
    /// Seconds for each workload.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    seconds: f64,
    /// Threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Largest relative difference between bounds of two backends: each is widened by half of it.
const BOUND_TOLERANCE: f64 = 2.0 * gripfast::backend::F32_TOLERANCE;

/// Largest relative difference between final answers of two backends.
const ANSWER_TOLERANCE: f64 = 1e-9;

/// Grips that are scored, and what is done with them.
struct Workload {
    name: &'static str,
    what: &'static str,
    contacts: Vec<Arc<Contact>>,
    wrenches: Vec<Vec<Wrench>>,
    distance: f64,
    force: f64,
    task: Task,
}

#[derive(Clone, Copy, PartialEq)]
enum Task {
    Seed,
    Score(Polish),
}

impl Workload {
    fn batch(&self) -> Batch<'_> {
        let pairs = self.contacts.iter().zip(&self.wrenches);
        Batch {
            problems: pairs
                .map(|(contact, wrenches)| Problem {
                    contact,
                    distance: self.distance,
                    force: self.force,
                    wrenches,
                })
                .collect(),
        }
    }

    fn loads(&self) -> usize {
        self.wrenches.iter().map(Vec::len).sum()
    }
}

/// What one workload came to on one backend.
struct Measured {
    seconds: f64,
    runs: u32,
    seeds: Vec<Seed>,
    scored: Vec<Scored>,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    anyhow::ensure!(
        args.seconds.is_finite() && args.seconds > 0.0,
        "--seconds {}: give a positive number",
        args.seconds
    );
    backend::use_threads(args.threads)?;
    let selection = args.backend.select()?;
    let set = args.backend.seed_set()?;
    let backends: Vec<Backend> = match selection.backend {
        Backend::Cpu => vec![Backend::Cpu],
        // The processor first: the GPU is checked against it.
        #[allow(
            unreachable_patterns,
            reason = "the only backend of a build without the feature `gpu`"
        )]
        other => vec![Backend::Cpu, other],
    };
    let software = is_software(&backends);
    if args.backend.backend != Choice::Cpu {
        eprintln!("backend {}", selection.reason);
    }
    let mut rows = Vec::new();
    let mut agreed = true;
    for workload in workloads(args.grips as usize, args.loads as usize) {
        let mut first: Option<Measured> = None;
        for backend in &backends {
            let measured =
                measure(backend, &workload, &set, Duration::from_secs_f64(args.seconds))?;
            let check = first.as_ref().map(|first| compare(first, &measured));
            agreed &= check.as_ref().is_none_or(|check| check.is_ok());
            let solved: usize = measured.scored.iter().map(|scored| scored.solved).sum();
            let per_second =
                |count: usize| count as f64 * f64::from(measured.runs) / measured.seconds;
            rows.push(json!({
                "workload": workload.name,
                "what": workload.what,
                "backend": backend.name(),
                "grips": workload.contacts.len(),
                "loads": workload.loads(),
                "seeds": set.len(),
                "runs": measured.runs,
                "seconds": measured.seconds,
                "grips_per_second": per_second(workload.contacts.len()),
                "loads_per_second": per_second(workload.loads()),
                "seed_evaluations_per_second": if matches!(workload.task, Task::Score(Polish::All)) { None } else { Some(per_second(workload.loads() * set.len())) },
                "exact_solves_per_second": if workload.task == Task::Seed { None } else { Some(per_second(solved)) },
                "agrees_with_cpu": check.as_ref().map(|check| check.is_ok()),
                "difference": check.as_ref().map(|check| match check { Ok(most) => json!(most), Err(why) => json!(why) }),
            }));
            if first.is_none() {
                first = Some(measured);
            }
        }
    }
    let mut out = std::io::stdout().lock();
    let threads = rayon::current_num_threads();
    if args.json {
        let report = json!({ "gripfast": env!("CARGO_PKG_VERSION"), "threads": threads, "software_adapter": software, "reason": selection.reason, "agreed": agreed, "results": rows });
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        let mut table = comfy_table::Table::new();
        table.load_style(comfy_table::presets::NOTHING).set_header([
            "workload",
            "backend",
            "grips/s",
            "loads/s",
            "seed evaluations/s",
            "exact solves/s",
            "agrees",
        ]);
        for row in &rows {
            let number = |key: &str| {
                row[key].as_f64().map_or_else(String::new, |value| format!("{value:.3e}"))
            };
            let agrees = match (&row["agrees_with_cpu"], &row["difference"]) {
                (serde_json::Value::Bool(true), most) => {
                    format!("to {:.0e}", most.as_f64().unwrap_or(0.0))
                }
                (serde_json::Value::Bool(false), why) => format!("NO: {why}"),
                _ => String::new(),
            };
            let text = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
            table.add_row([
                text("what"),
                text("backend"),
                number("grips_per_second"),
                number("loads_per_second"),
                number("seed_evaluations_per_second"),
                number("exact_solves_per_second"),
                agrees,
            ]);
        }
        writeln!(out, "{}", table.to_string().trim_end())?;
        writeln!(out, "{threads} threads, {} twists", set.len())?;
        if software {
            writeln!(
                out,
                "the adapter is software: its answers are checked, its times mean nothing"
            )?;
        }
    }
    anyhow::ensure!(agreed, "the backends disagree");
    Ok(ExitCode::SUCCESS)
}

#[cfg(feature = "gpu")]
fn is_software(backends: &[Backend]) -> bool {
    backends.iter().any(|backend| matches!(backend, Backend::Gpu(gpu) if gpu.is_software()))
}

#[cfg(not(feature = "gpu"))]
fn is_software(_: &[Backend]) -> bool {
    false
}

/// Runs once to warm up, then until `least` has passed. Both backends return when the answers are
/// in memory.
fn measure(
    backend: &Backend,
    workload: &Workload,
    set: &SeedSet,
    least: Duration,
) -> anyhow::Result<Measured> {
    let batch = workload.batch();
    let once = || -> anyhow::Result<(Vec<Seed>, Vec<Scored>)> {
        Ok(match workload.task {
            Task::Seed => (backend.seed(&batch, set)?, Vec::new()),
            Task::Score(polish) => (
                Vec::new(),
                backend.score(&batch, set, &ScoreOptions { polish, ..ScoreOptions::default() })?,
            ),
        })
    };
    let (seeds, scored) = once()?;
    let (started, mut runs) = (Instant::now(), 0);
    while runs == 0 || started.elapsed() < least {
        std::hint::black_box(once()?);
        runs += 1;
    }
    Ok(Measured { seconds: started.elapsed().as_secs_f64(), runs, seeds, scored })
}

/// Largest relative difference, or what differs beyond the tolerance.
fn compare(a: &Measured, b: &Measured) -> Result<f64, String> {
    if a.seeds.len() != b.seeds.len() || a.scored.len() != b.scored.len() {
        return Err("different numbers of answers".to_owned());
    }
    let relative = |x: f64, y: f64| if x == y { 0.0 } else { (x - y).abs() / x.abs().max(y.abs()) };
    let mut most: f64 = 0.0;
    for (i, (x, y)) in a.seeds.iter().zip(&b.seeds).enumerate() {
        if x.status == SeedStatus::Bounded && y.status == SeedStatus::Bounded {
            most = most.max(relative(x.lower, y.lower));
        }
        if most.is_nan() || most > BOUND_TOLERANCE {
            return Err(format!("load {i}: {x:?} and {y:?}"));
        }
    }
    for (i, (x, y)) in a.scored.iter().zip(&b.scored).enumerate() {
        let (Some((load_x, x)), Some((load_y, y))) = (x.worst, y.worst) else { continue };
        let difference = x.mu_s.zip(y.mu_s).map_or(0.0, |(x, y)| relative(x, y));
        if load_x != load_y
            || x.status != y.status
            || difference.is_nan()
            || difference > ANSWER_TOLERANCE
        {
            return Err(format!(
                "grip {i}: load {load_x} {:?} and load {load_y} {:?}",
                x.mu_s, y.mu_s
            ));
        }
        most = most.max(difference);
    }
    Ok(most)
}

/// A rectangle's corners; `cut` takes one corner off, as the edge of a face does.
fn pad(centre: DVec2, cut: f64) -> Polygon {
    let (a, b) = (0.011, 0.01);
    let mut outer = vec![
        DVec2::new(-a, -b),
        DVec2::new(a, -b),
        DVec2::new(a, b - cut),
        DVec2::new(a - cut, b),
        DVec2::new(-a, b),
    ];
    if cut == 0.0 {
        outer.remove(3);
    }
    Polygon { outer: outer.into_iter().map(|point| centre + point).collect(), holes: Vec::new() }
}

fn workloads(grips: usize, loads: usize) -> Vec<Workload> {
    let directions = sphere::directions(loads);
    let ball = |point: DVec3| -> Vec<Wrench> {
        directions.iter().map(|&force| Wrench { force, moment: point.cross(force) }).collect()
    };
    // Grips spread over a part: the centre of mass lies elsewhere in each.
    let point = |i: usize| {
        DVec3::new(
            0.02 * (i as f64 * 0.618).fract(),
            0.02 * (i as f64 * 0.755).fract(),
            0.004 * (i as f64 * 0.57).fract(),
        )
    };
    let shared = |count: usize| {
        let face = vec![pad(DVec2::ZERO, 0.0)];
        let contact = Arc::new(Contact { face_i: face.clone(), face_ii: face });
        vec![contact; count]
    };
    let own = |count: usize, same: bool| -> Vec<Arc<Contact>> {
        let cut = |i: usize| 0.001 + 0.006 * (i as f64 * 0.618).fract();
        (0..count)
            .map(|i| {
                Arc::new(Contact {
                    face_i: vec![pad(DVec2::ZERO, cut(i))],
                    face_ii: vec![pad(DVec2::ZERO, cut(if same { i } else { i + 1 }))],
                })
            })
            .collect()
    };
    let workload = |name, what, contacts: Vec<Arc<Contact>>, task| {
        let wrenches = (0..contacts.len()).map(|i| ball(point(i))).collect();
        Workload { name, what, contacts, wrenches, distance: 0.03, force: 40.0, task }
    };
    vec![
        workload("seed_shared", "seeds, pads wholly on the faces", shared(grips), Task::Seed),
        workload("seed_own", "seeds, a contact for each grip", own(grips, true), Task::Seed),
        workload(
            "seed_different",
            "seeds, different areas on the faces",
            own(grips, false),
            Task::Seed,
        ),
        workload(
            "score_shared",
            "worst load, pads wholly on the faces",
            shared(grips),
            Task::Score(Polish::Worst),
        ),
        workload(
            "score_own",
            "worst load, a contact for each grip",
            own(grips, true),
            Task::Score(Polish::Worst),
        ),
        workload(
            "score_different",
            "worst load, different areas",
            own((grips / 20).max(1), false),
            Task::Score(Polish::Worst),
        ),
        workload(
            "solve_all",
            "every load exactly, pads wholly on the faces",
            shared((grips / 20).max(1)),
            Task::Score(Polish::All),
        ),
    ]
}

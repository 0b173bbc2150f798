//! `gripfast bench`: how fast this machine scores, and whether its backends agree. Its subcommands
//! are the parts of `benches/device.sh`.

mod check;
mod commands;
mod entry;
mod known;
mod sweep;
mod workloads;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Args as ClapArgs, Subcommand};
use gripfast::backend::{Backend, Choice, Polish, ScoreOptions, Scored, Seed, SeedSet};
use serde_json::json;

use super::backend::{self, BackendArgs};
use workloads::{Contacts, Workload, same_answers, same_seeds};

/// Measures seed evaluations, exact solves and scored grips per second, and checks the GPU against
/// the processor.
#[derive(Debug, ClapArgs)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "EXAMPLES:\n  gripfast bench\n  gripfast bench --backend gpu --json\n  gripfast bench --backend cpu --seconds 3 --seeds 321\n\n\
The subcommands measure an adapter thoroughly; `bash benches/device.sh` runs them all and writes what they find.\n\n\
Times include upload and readback. Each workload runs once to warm up, then until the time is over. A software adapter is checked, its times mean nothing."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    part: Option<Part>,
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

/// A part of `benches/device.sh`.
#[derive(Debug, Subcommand)]
enum Part {
    Check(check::Args),
    Sweep(sweep::Args),
    Commands(commands::Args),
    Entry(entry::Args),
}

/// Where a part of `benches/device.sh` puts what it finds.
#[derive(Debug, ClapArgs)]
struct Output {
    /// Folder for the part's Markdown and JSON; without it the Markdown goes to standard output.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

impl Output {
    /// Writes both files whole, or the Markdown to standard output at the `end`.
    fn write(
        &self,
        name: &str,
        markdown: &str,
        data: &impl serde::Serialize,
        end: bool,
    ) -> anyhow::Result<()> {
        let Some(folder) = &self.out else {
            if end {
                write!(std::io::stdout().lock(), "{markdown}")?;
            }
            return Ok(());
        };
        write_both(folder, name, markdown, data)
    }
}

/// `NAME.json` and `NAME.md` in a folder.
fn write_both(
    folder: &Path,
    name: &str,
    markdown: &str,
    data: &impl serde::Serialize,
) -> anyhow::Result<()> {
    gripfast::file::write(&folder.join(format!("{name}.json")), |writer| {
        serde_json::to_writer_pretty(&mut *writer, data)?;
        writeln!(writer)
    })?;
    gripfast::file::write(&folder.join(format!("{name}.md")), |writer| {
        writer.write_all(markdown.as_bytes())
    })?;
    Ok(())
}

/// A workload of the quick bench.
struct Row {
    name: &'static str,
    what: &'static str,
    workload: Workload,
    task: Task,
}

#[derive(Clone, Copy, PartialEq)]
enum Task {
    Seed,
    Score(Polish),
}

/// What one workload came to on one backend.
struct Measured {
    seconds: f64,
    runs: u32,
    seeds: Vec<Seed>,
    scored: Vec<Scored>,
    traffic: Option<Traffic>,
}

/// What goes to a graphics processor and comes back, per grip.
struct Traffic {
    bytes_up: f64,
    bytes_down: f64,
    /// Loads that can be the worst, and windows of loads left to the processor.
    entries: f64,
    /// Seconds of the processor: records made, answers fetched and spread.
    host: f64,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.part {
        Some(Part::Check(args)) => check::run(args),
        Some(Part::Sweep(args)) => sweep::run(args),
        Some(Part::Commands(args)) => commands::run(args),
        Some(Part::Entry(args)) => entry::run(args),
        None => quick(&args),
    }
}

/// Throughput of each workload on the processor and the chosen adapter, checked against each other.
fn quick(args: &Args) -> anyhow::Result<ExitCode> {
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
    for row in workloads(args.grips as usize, args.loads as usize) {
        let mut first: Option<Measured> = None;
        for backend in &backends {
            let measured = measure(backend, &row, &set, Duration::from_secs_f64(args.seconds))?;
            let check = first.as_ref().map(|first| compare(first, &measured));
            agreed &= check.as_ref().is_none_or(|check| check.is_ok());
            rows.push(figures(&row, backend, &measured, check.as_ref(), set.len()));
            if first.is_none() {
                first = Some(measured);
            }
        }
    }
    let mut out = crate::terminal::answer(args.json);
    let threads = rayon::current_num_threads();
    if args.json {
        let report = json!({ "gripfast": env!("CARGO_PKG_VERSION"), "threads": threads, "software_adapter": software, "reason": selection.reason, "agreed": agreed, "results": rows });
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        writeln!(out, "{}", table(&rows).to_string().trim_end())?;
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

/// What a workload came to, as JSON.
fn figures(
    row: &Row,
    backend: &Backend,
    measured: &Measured,
    check: Option<&Result<f64, String>>,
    seeds: usize,
) -> serde_json::Value {
    let solved: usize = measured.scored.iter().map(|scored| scored.solved).sum();
    let compared: usize = measured.scored.iter().map(|scored| scored.compared).sum();
    let grips = row.workload.contacts.len();
    let per_grip = |count: usize| (row.task != Task::Seed).then(|| count as f64 / grips as f64);
    let per_second = |count: usize| count as f64 * f64::from(measured.runs) / measured.seconds;
    let all = matches!(row.task, Task::Score(Polish::All));
    let loads = row.workload.loads();
    json!({
        "workload": row.name,
        "what": row.what,
        "backend": backend.name(),
        "grips": grips,
        "loads": loads,
        "seeds": seeds,
        "runs": measured.runs,
        "seconds": measured.seconds,
        "grips_per_second": per_second(grips),
        "loads_per_second": per_second(loads),
        "seed_evaluations_per_second": (!all).then(|| per_second(loads * seeds)),
        "exact_solves_per_second": (row.task != Task::Seed).then(|| per_second(solved)),
        "exact_solves_per_grip": per_grip(solved),
        "compared_per_grip": per_grip(compared),
        "bytes_up_per_grip": measured.traffic.as_ref().map(|traffic| traffic.bytes_up),
        "bytes_down_per_grip": measured.traffic.as_ref().map(|traffic| traffic.bytes_down),
        "host_seconds_per_grip": measured.traffic.as_ref().map(|traffic| traffic.host),
        "entries_per_grip": measured.traffic.as_ref().map(|traffic| traffic.entries),
        "agrees_with_cpu": check.map(|check| check.is_ok()),
        "difference": check.map(|check| match check { Ok(most) => json!(most), Err(why) => json!(why) }),
    })
}

fn table(rows: &[serde_json::Value]) -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::NOTHING).set_header([
        "workload",
        "backend",
        "grips/s",
        "loads/s",
        "seed evaluations/s",
        "exact solves/s",
        "solved/grip",
        "compared/grip",
        "bytes/grip up, down",
        "agrees",
    ]);
    for row in rows {
        let number =
            |key: &str| row[key].as_f64().map_or_else(String::new, |value| format!("{value:.3e}"));
        let agrees = match (&row["agrees_with_cpu"], &row["difference"]) {
            (serde_json::Value::Bool(true), most) => {
                format!("to {:.0e}", most.as_f64().unwrap_or(0.0))
            }
            (serde_json::Value::Bool(false), why) => format!("NO: {why}"),
            _ => String::new(),
        };
        let share =
            |key: &str| row[key].as_f64().map_or_else(String::new, |value| format!("{value:.1}"));
        let text = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
        table.add_row([
            text("what"),
            text("backend"),
            number("grips_per_second"),
            number("loads_per_second"),
            number("seed_evaluations_per_second"),
            number("exact_solves_per_second"),
            share("exact_solves_per_grip"),
            share("compared_per_grip"),
            row["bytes_up_per_grip"].as_f64().map_or_else(String::new, |up| {
                format!("{up:.0}, {:.0}", row["bytes_down_per_grip"].as_f64().unwrap_or(0.0))
            }),
            agrees,
        ]);
    }
    table
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
    row: &Row,
    set: &SeedSet,
    least: Duration,
) -> anyhow::Result<Measured> {
    let batch = row.workload.batch();
    let once = || -> anyhow::Result<(Vec<Seed>, Vec<Scored>)> {
        Ok(match row.task {
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
        if row.task == Task::Seed {
            // What scoring takes of the seeds; all of them, above, are compared.
            std::hint::black_box(backend.survivors_for(&batch, set, &ScoreOptions::default())?);
        } else {
            std::hint::black_box(once()?);
        }
        runs += 1;
    }
    let seconds = started.elapsed().as_secs_f64();
    let traffic = traffic(backend, row, set)?;
    Ok(Measured { seconds, runs, seeds, scored, traffic })
}

/// By the clock of one more run, with the list of loads on the device as it is for all chunks but the
/// first.
#[cfg(feature = "gpu")]
fn traffic(backend: &Backend, row: &Row, set: &SeedSet) -> anyhow::Result<Option<Traffic>> {
    let Backend::Gpu(gpu) = backend else { return Ok(None) };
    if matches!(row.task, Task::Score(Polish::All)) {
        return Ok(None);
    }
    gpu.start_clock()?;
    backend.survivors_for(&row.workload.batch(), set, &ScoreOptions::default())?;
    let chunks = gpu.stop_clock().unwrap_or_default().chunks;
    let grips = row.workload.contacts.len().max(1) as f64;
    // Not what sending takes: a software adapter holds it up.
    let steps = chunks.iter().flat_map(|chunk| [chunk.make, chunk.fetch, chunk.spread]);
    Ok(Some(Traffic {
        host: steps.map(|span| span.seconds()).sum::<f64>() / grips,
        bytes_up: chunks.iter().map(|chunk| chunk.bytes_up).sum::<u64>() as f64 / grips,
        bytes_down: chunks.iter().map(|chunk| chunk.bytes_down).sum::<u64>() as f64 / grips,
        entries: chunks.iter().map(|chunk| chunk.entries).sum::<usize>() as f64 / grips,
    }))
}

#[cfg(not(feature = "gpu"))]
fn traffic(_: &Backend, _: &Row, _: &SeedSet) -> anyhow::Result<Option<Traffic>> {
    Ok(None)
}

/// Largest relative difference, or what differs beyond the tolerance.
fn compare(a: &Measured, b: &Measured) -> Result<f64, String> {
    Ok(same_seeds(&a.seeds, &b.seeds)?.max(same_answers(&a.scored, &b.scored)?))
}

fn workloads(grips: usize, loads: usize) -> Vec<Row> {
    let few = (grips / 20).max(1);
    let row = |name, what, kind, grips, task| Row {
        name,
        what,
        workload: Workload::new(kind, grips, loads),
        task,
    };
    use Contacts::{Different, Own, Shared};
    let worst = Task::Score(Polish::Worst);
    vec![
        row("seed_shared", "seeds, pads wholly on the faces", Shared, grips, Task::Seed),
        row("seed_own", "seeds, a contact for each grip", Own, grips, Task::Seed),
        row("seed_different", "seeds, different areas on the faces", Different, grips, Task::Seed),
        row("score_shared", "worst load, pads wholly on the faces", Shared, grips, worst),
        row("score_own", "worst load, a contact for each grip", Own, grips, worst),
        row("score_different", "worst load, different areas", Different, few, worst),
        row(
            "solve_all",
            "every load exactly, pads wholly on the faces",
            Shared,
            few,
            Task::Score(Polish::All),
        ),
    ]
}

//! `gripfast bench check`: whether an adapter gives right answers, and how far its single precision
//! is from double precision.

#[cfg(feature = "gpu")]
use std::fmt::Write as _;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args as ClapArgs;

use super::Output;

/// Checks an adapter: its kernels number by number against the processor's and against double
/// precision, batches of 0 to 100,000 loads, repeated and permuted, and the loss of the device.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast bench check\n  gripfast bench check --adapter llvmpipe --out results"
)]
pub(crate) struct Args {
    /// Graphics adapter, by its number or part of its name [default: GRIPFAST_ADAPTER, or the first
    /// that counts as a GPU].
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// Seconds that it may take, about.
    #[arg(long, value_name = "S", default_value_t = 45.0)]
    seconds: f64,
    #[command(flatten)]
    output: Output,
}

/// One thing that was tried.
#[cfg(feature = "gpu")]
#[derive(Debug, serde::Serialize)]
struct Item {
    name: String,
    passed: bool,
    detail: String,
}

#[cfg(not(feature = "gpu"))]
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let _ = (args.adapter, args.seconds, args.output.out, Instant::now());
    anyhow::bail!("this build has no GPU support (cargo feature `gpu`)")
}

#[cfg(feature = "gpu")]
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    use gripfast::backend::{Gpu, KernelCheck, SeedSet};
    let start = Instant::now();
    let adapter = args.adapter.as_deref();
    let gpu = Gpu::open(adapter, true)?;
    let mut report = Report {
        adapter: gpu.name(),
        software_adapter: gpu.is_software(),
        kernels: Vec::new(),
        items: Vec::new(),
        passed: true,
        complete: false,
    };
    // Few contacts first: their time tells how many are affordable.
    let few = Instant::now();
    gpu.check_kernels(&SeedSet::default(), 4)?;
    let each = few.elapsed().as_secs_f64() / 4.0;
    for (frequency, share) in [(4, 0.15), (8, 0.3)] {
        let set = SeedSet::new(frequency)?;
        let cost = each * set.len() as f64 / SeedSet::default().len() as f64;
        let contacts = (share * args.seconds / cost).clamp(4.0, 2000.0) as usize;
        let check: KernelCheck = gpu.check_kernels(&set, contacts)?;
        report.item(
            format!("kernels, {} twists, {contacts} contacts", set.len()),
            if check.tolerance_holds() && check.bounded > 0 {
                Ok(format!(
                    "bounds {:.1e} from double precision at most; tolerance {:.0e}; loads off by \
{:.2} of the stated error at most, {} estimates of {} loads without bounds by {:.2} of theirs",
                    check.largest,
                    check.tolerance,
                    check.load_error,
                    check.estimated,
                    check.open,
                    check.estimate_error
                ))
            } else {
                Err(format!(
                    "bounds {:.1e} from double precision, tolerance {:.0e}; loads off by {:.2} of \
the stated error, estimates by {:.2} of theirs: F32_TOLERANCE, LOAD_ROUNDING or ROUNDING is too \
small for this adapter",
                    check.largest, check.tolerance, check.load_error, check.estimate_error
                ))
            },
        );
        report.kernels.push((set.len(), check));
        args.output.write("check", &report.markdown(), &report, false)?;
    }
    report.item(
        "batches of 0 to 100,000 loads, twice, permuted".to_owned(),
        batches(gpu, &start, args.seconds),
    );
    args.output.write("check", &report.markdown(), &report, false)?;
    for strict in [false, true] {
        let name = if strict { "loss of the device, gpu" } else { "loss of the device, auto" };
        report.item(name.to_owned(), loss(adapter, strict));
    }
    report.complete = true;
    args.output.write("check", &report.markdown(), &report, true)?;
    anyhow::ensure!(report.passed, "the adapter {} failed: see the report", report.adapter);
    Ok(ExitCode::SUCCESS)
}

#[cfg(feature = "gpu")]
#[derive(Debug, serde::Serialize)]
struct Report {
    adapter: String,
    software_adapter: bool,
    /// Number of twists, and what was found with them.
    kernels: Vec<(usize, gripfast::backend::KernelCheck)>,
    items: Vec<Item>,
    passed: bool,
    complete: bool,
}

#[cfg(feature = "gpu")]
impl Report {
    fn item(&mut self, name: String, outcome: Result<String, String>) {
        let passed = outcome.is_ok();
        self.passed &= passed;
        let detail = outcome.unwrap_or_else(|why| why);
        eprintln!("{}: {name}: {detail}", if passed { "passed" } else { "FAILED" });
        self.items.push(Item { name, passed, detail });
    }

    fn markdown(&self) -> String {
        let mut text = format!("Checked on {}\n\n| what | | |\n|---|---|---|\n", self.adapter);
        for item in &self.items {
            let word = if item.passed { "passed" } else { "**FAILED**" };
            let _ = writeln!(text, "| {} | {word} | {} |", item.name, item.detail);
        }
        text += "\n| kernel | number | compared | from the processor's | from double precision | \
the processor's from it |\n|---|---|---|---|---|---|\n";
        let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:.1e}"));
        for (twists, check) in &self.kernels {
            for row in &check.deviations {
                let _ = writeln!(
                    text,
                    "| {}, {twists} twists | {} | {} | {:.1e} | {} | {} |",
                    row.kernel,
                    row.number,
                    row.count,
                    row.from_twin,
                    number(row.from_exact),
                    number(row.twin_from_exact)
                );
            }
            let _ = writeln!(
                text,
                "| screen, {twists} twists | another twist of equal value; another status | {}; {} \
of {} | | | |",
                check.other_twist, check.other_status, check.loads
            );
            let _ = writeln!(
                text,
                "| newton, {twists} twists | an estimate on one of both only | {} of {} | | | |",
                check.other_estimate, check.open
            );
        }
        if !self.complete {
            text += "\nCut off: there is more to check.\n";
        }
        text
    }
}

/// Batches of many sizes give what the processor gives, the same bytes twice, and permuted answers
/// for a permuted batch.
#[cfg(feature = "gpu")]
fn batches(gpu: gripfast::backend::Gpu, start: &Instant, seconds: f64) -> Result<String, String> {
    use super::workloads::{Contacts, Workload, same_seeds};
    use gripfast::backend::{Backend, Batch, Seed, SeedSet};
    let backend = Backend::Gpu(Box::new(gpu));
    let set = SeedSet::new(2).map_err(|error| error.to_string())?;
    let run = |backend: &Backend, batch: &Batch<'_>| {
        backend.seed(batch, &set).map_err(|error| error.to_string())
    };
    let bits = |seeds: &[Seed]| -> Vec<[u64; 6]> {
        let numbers = |s: &Seed| {
            [s.twist.u1, s.twist.u2, s.twist.omega, s.lower, s.upper, s.estimate].map(f64::to_bits)
        };
        seeds.iter().map(numbers).collect()
    };
    let (mut most, mut tried, mut left_out) = (0.0_f64, 0, 0);
    for kind in Contacts::ALL {
        let sizes = [(0, 5), (1, 1), (1, 63), (1, 64), (65, 1), (7, 143), (1, 100_000), (500, 200)];
        for (grips, loads) in sizes {
            if start.elapsed().as_secs_f64() > seconds {
                left_out += 1;
                continue;
            }
            let what =
                |why: String| format!("{grips} grips of {loads} loads, {}: {why}", kind.name());
            let workload = Workload::new(kind, grips, loads);
            let batch = workload.batch();
            let found = run(&backend, &batch)?;
            most = most.max(same_seeds(&run(&Backend::Cpu, &batch)?, &found).map_err(what)?);
            if bits(&found) != bits(&run(&backend, &batch)?) {
                return Err(what("other bytes the second time".to_owned()));
            }
            let backward = Batch { problems: batch.problems.iter().rev().copied().collect() };
            let permuted = run(&backend, &backward)?;
            let expected: Vec<Seed> =
                found.chunks(loads).rev().flat_map(<[Seed]>::to_vec).collect();
            if bits(&permuted) != bits(&expected) {
                return Err(what("another order gives other answers".to_owned()));
            }
            tried += 1;
        }
    }
    let more = if left_out > 0 { format!("; {left_out} more had no time") } else { String::new() };
    Ok(format!("{tried} batches, lower bounds {most:.1e} from the processor's at most{more}"))
}

/// A device that is lost in mid-batch: its chunks are computed on the processor, or it is an error.
#[cfg(feature = "gpu")]
fn loss(adapter: Option<&str>, strict: bool) -> Result<String, String> {
    use super::workloads::{Contacts, Workload, same_answers};
    use gripfast::backend::{Backend, Gpu, ScoreOptions, SeedSet};
    let words = |error: gripfast::error::Error| error.to_string();
    let mut gpu = Gpu::open(adapter, strict).map_err(words)?;
    gpu.lose_before(3, 1000);
    let backend = Backend::Gpu(Box::new(gpu));
    let workload = Workload::new(Contacts::Own, 30, 150);
    let (set, options) = (SeedSet::default(), ScoreOptions::default());
    let found = backend.score(&workload.batch(), &set, &options);
    match (strict, found) {
        (true, Err(error)) if error.to_string().contains("lost") => {
            Ok(format!("an error: {error}"))
        }
        (true, Err(error)) => Err(format!("an error that does not say so: {error}")),
        (true, Ok(_)) => Err("no error".to_owned()),
        (false, Err(error)) => Err(error.to_string()),
        (false, Ok(found)) => {
            let expected = Backend::Cpu.score(&workload.batch(), &set, &options).map_err(words)?;
            let most = same_answers(&expected, &found)?;
            let Backend::Gpu(gpu) = &backend else { return Err("the backend changed".to_owned()) };
            match gpu.chunks_redone() {
                0 => Err("no chunk was redone".to_owned()),
                redone => Ok(format!(
                    "{redone} chunks of 5 computed on the processor, answers {most:.0e} apart"
                )),
            }
        }
    }
}

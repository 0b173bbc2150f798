//! `gripfast batch`: many parts, grippers and load sets.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args as ClapArgs, ValueEnum};
use gripfast::batch::{self, Batch, Counts, Entry, Outcome, Report, Watch, Workers};
use gripfast::error::Error;
use gripfast::request::Request;
use indicatif::{ProgressBar, ProgressStyle};

use crate::plan::{Interrupt, JobArgs};
use crate::terminal;

/// Plans many parts with many grippers under many load sets; what is finished is never lost.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast batch parts/ --gripper robotiq-2f85 --gripper franka-hand --density 2700kg/m3 -o out/\n  \
gripfast batch jobs.toml -o out/ --resume\n  \
gripfast batch a.stl b.obj --gripper generic --mass 200g --loads gravity --loads ball:80:5N --top-k 20 --negatives 100 -o out/\n\n\
FOLDER (docs/batches.md has all fields):\n  manifest.jsonl            a line for each job: outcome, reason, warnings, mesh health, time, versions\n  \
grips.jsonl/gripper=G/    grips of all parts, a line each; negatives.jsonl/ with --negatives\n  \
grips.parquet/gripper=G/  the same as a table (full build)\n\n\
Interrupted, killed or out of power: the same command with --resume does what is missing and comes to the same bytes.\n\n\
EXIT CODES:\n  0  done    1  some job found no grip (--fail-on empty)    2  some job failed (--fail-on bad or empty), bad input or usage"
)]
pub(crate) struct Args {
    /// Part files, folders with part files, or one file that says all jobs (TOML).
    #[arg(required = true, value_name = "JOBS.toml|DIR|PART")]
    inputs: Vec<PathBuf>,
    /// Gripper from the catalogue, or a gripper file; may be repeated.
    #[arg(long, short)]
    gripper: Vec<String>,
    /// A load set, as the loads of `plan`; may be repeated.
    #[arg(long, value_name = "LOADS")]
    loads: Vec<String>,
    /// Folder for the results; made when it is not there.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Does what is missing in the folder.
    #[arg(long)]
    resume: bool,
    /// Jobs at a time [default: one for each core]; changes nothing in the results.
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Shares into which the candidates of each job are cut, to keep all cores busy with one large part;
    /// changes nothing in the results [default: 1].
    #[arg(long, value_name = "N")]
    split: Option<usize>,
    /// Best grips to keep of each job [default: 100].
    #[arg(long, value_name = "K")]
    top_k: Option<usize>,
    /// What makes the exit code: nothing, bad parts (2), or also jobs without a grip (1).
    #[arg(long, value_enum, default_value_t = FailOn::Bad)]
    fail_on: FailOn,
    /// A stored request with the options that all jobs share; flags beside it override it.
    #[arg(long, value_name = "FILE")]
    request: Option<PathBuf>,
    /// No progress bar and no line for each job; the report is printed all the same.
    #[arg(long, short)]
    quiet: bool,

    #[command(flatten)]
    job: JobArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FailOn {
    None,
    Bad,
    Empty,
}

/// Runs the subcommand.
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let Args {
        inputs,
        gripper,
        loads,
        output,
        resume,
        jobs,
        split,
        top_k,
        fail_on,
        request,
        quiet,
        job,
    } = args;
    for (flag, number) in [("--jobs", jobs), ("--split", split), ("--top-k", top_k)] {
        if number == Some(0) {
            anyhow::bail!(Error::input(flag, "is 0", "give one or more"));
        }
    }
    let mut batch = batch(&inputs)?;
    if let Some(path) = &request {
        batch.request = Request::read(path)?;
    }
    job.single()?;
    job.give(&mut batch.request)?;
    batch.top = top_k.or(batch.top);
    if !gripper.is_empty() {
        batch.grippers.clear();
        batch.add_grippers(&gripper);
    }
    if !loads.is_empty() {
        batch.loads.clear();
        batch.add_loads(&loads);
    }
    if batch.grippers.is_empty() {
        anyhow::bail!(Error::input(
            "--gripper",
            "there is none",
            "name one or more; `gripfast gripper list` has those that come with the program",
        ));
    }
    let jobs_to_do = batch.jobs()?;
    let interrupt = Interrupt::watched()?;
    let mut shown = Shown::new(quiet, jobs_to_do.len());
    let workers = Workers { jobs, split, ..Workers::default() };
    let report = batch::run(&jobs_to_do, &output, resume, workers, &mut shown, &interrupt.stop);
    shown.bar.finish_and_clear();
    let report = report?;
    say(&report, &output);
    Ok(match interrupt.code() {
        Some(code) if report.open > 0 => {
            terminal::say("interrupted: the same command with --resume does the rest");
            ExitCode::from(code)
        }
        _ if fail_on != FailOn::None && report.failed > 0 => ExitCode::from(2),
        _ if fail_on == FailOn::Empty && report.empty > 0 => ExitCode::from(1),
        _ => ExitCode::SUCCESS,
    })
}

/// The batch that the inputs describe.
fn batch(inputs: &[PathBuf]) -> anyhow::Result<Batch> {
    let is_file =
        |path: &PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
    match inputs {
        [file] if is_file(file) => Ok(Batch::read(file)?),
        _ => {
            if let Some(file) = inputs.iter().find(|path| is_file(path)) {
                anyhow::bail!(Error::input(
                    file.display().to_string(),
                    "is a file of jobs beside other inputs",
                    "give it alone; it can list parts and folders",
                ));
            }
            let mut batch = Batch::default();
            batch.add_parts(inputs)?;
            Ok(batch)
        }
    }
}

/// A batch as its user sees it.
struct Shown {
    quiet: bool,
    bar: ProgressBar,
}

impl Shown {
    fn new(quiet: bool, jobs: usize) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Self { quiet, bar: ProgressBar::hidden() };
        }
        let bar = ProgressBar::new(jobs as u64);
        let style = "{bar:32} {human_pos}/{human_len} jobs  {per_sec}  {eta} left";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        Self { quiet, bar }
    }
}

impl Watch for Shown {
    fn job(&mut self, entry: &Entry, counts: Counts) {
        self.bar.set_position(counts.ended as u64);
        if self.quiet {
            return;
        }
        let id = format!("{} / {} / {}", entry.part, entry.gripper, entry.loads);
        let text = match (&entry.outcome, &entry.error) {
            (Outcome::Grips, _) => {
                let best = entry.best_mu_s.map_or(String::new(), |mu| format!(", best {mu:.5}"));
                format!("{} grips{best}", entry.grips)
            }
            (Outcome::Empty, _) => {
                format!("no grip: {}", entry.reason.as_deref().unwrap_or_default())
            }
            (Outcome::Failed, Some(error)) => format!("failed: {}", error.problem),
            (Outcome::Failed, None) => "failed".to_owned(),
        };
        let line =
            format!("[{}/{}] {id}: {text}, {:.1} s", counts.ended, counts.jobs, entry.seconds);
        self.bar.suspend(|| terminal::say(&line));
    }
}

/// What came of the batch, to standard output.
fn say(report: &Report, folder: &std::path::Path) {
    use std::io::Write;
    let mut out = terminal::output();
    let mut lines = vec![format!(
        "{} jobs: {} with grips, {} without, {} failed{}",
        report.jobs,
        report.grips,
        report.empty,
        report.failed,
        if report.open > 0 { format!(", {} not done", report.open) } else { String::new() }
    )];
    for (title, count, named) in [
        ("without a grip", report.empty, report.empty_jobs.clone()),
        (
            "failed",
            report.failed,
            report
                .failed_jobs
                .iter()
                .map(|(id, error)| {
                    let place = &error.place;
                    let at = if place.is_empty() { String::new() } else { format!("{place}: ") };
                    (id.clone(), format!("{at}{}", error.problem))
                })
                .collect(),
        ),
    ] {
        if count > 0 {
            lines.push(format!("{title}:"));
            lines.extend(named.iter().map(|(id, why)| format!("  {id}: {why}")));
            if count > named.len() {
                lines.push(format!("  ... and {} more, see manifest.jsonl", count - named.len()));
            }
        }
    }
    let parquet = cfg!(feature = "parquet");
    let sets =
        ["manifest.jsonl", "grips.jsonl", "grips.parquet", "negatives.jsonl", "negatives.parquet"];
    let made: Vec<&str> = sets.into_iter().filter(|set| folder.join(set).exists()).collect();
    lines.push(format!("in {}: {}", folder.display(), made.join(", ")));
    if !parquet {
        lines.push(
            "this build has no Parquet: `cargo build --release --features full` makes one that has"
                .to_owned(),
        );
    }
    for line in lines {
        // A reader that has gone is no failure of the batch.
        let _ = writeln!(out, "{line}");
    }
}

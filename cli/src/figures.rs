//! `gripfast figures`: the paper's figures, computed again.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args as ClapArgs;
use gripfast::error::Error;
use gripfast::{file, lab};

/// Draws the figures of the paper on which the mechanics is based, computed again, as SVG with their
/// numbers as CSV.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast figures\n  gripfast figures -o docs/figures\n  gripfast figures --benchmark -o bench\n\n\
figure4    the line of separation turns with the moment about the closing axis\n\
figure5    square, hollow squares and crosses under a moment about the closing axis\n\
figure6    a bar gripped off its centre of mass: true slip centre against the centroid\n\
distance   mu_s against the distance between the faces (section 5.1)\n\
separation contact left under an out-of-plane moment (section 3.6)"
)]
pub(crate) struct Args {
    /// Folder to write to; made when it is not there.
    #[arg(short = 'o', long = "output", value_name = "DIR", default_value = "figures")]
    output: PathBuf,
    /// Writes the benchmark for simulators instead: ten grips with geometry, load and the exact
    /// answer as JSON, benchmark.json in the folder.
    #[arg(long)]
    benchmark: bool,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(&args.output)
        .map_err(|error| Error::io(&args.output, "make the folder", error))?;
    let mut out = crate::terminal::output();
    if args.benchmark {
        let benchmark = lab::benchmark::benchmark()?;
        let path = args.output.join("benchmark.json");
        let text = serde_json::to_string_pretty(&benchmark)?;
        file::write(&path, |writer| writeln!(writer, "{text}"))?;
        for case in &benchmark.cases {
            let solved = case.solved.map_or("none".to_owned(), |mu| format!("{mu:.9}"));
            writeln!(out, "{:15} exact {:.9}  solved {solved}  {}", case.id, case.mu_s, case.text)?;
        }
        writeln!(out, "{}", path.display())?;
        return Ok(ExitCode::SUCCESS);
    }
    for figure in lab::figures::all()? {
        let drawing = args.output.join(figure.name).with_extension("svg");
        file::write(&drawing, |writer| writer.write_all(figure.svg.as_bytes()))?;
        let table = drawing.with_extension("csv");
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.write_record(&figure.columns)?;
        for row in &figure.rows {
            csv.write_record(row)?;
        }
        let bytes = csv.into_inner().context("table")?;
        file::write(&table, |writer| writer.write_all(&bytes))?;
        writeln!(
            out,
            "{}\n  {}\n  {}  {}",
            figure.title,
            figure.finding,
            drawing.display(),
            table.display()
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

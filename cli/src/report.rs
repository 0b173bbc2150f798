//! `gripfast report`: a result file as a page to look at.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::Args as ClapArgs;
use gripfast::error::Error;
use gripfast::part::{Part, ReadOptions, Unit};
use gripfast::plan::{WHOLE, solve_every_load};
use gripfast::report;
use gripfast::results::{GripSet, PartSummary};

use crate::choice::ChoiceArgs;

/// Corners of the bounding box may differ by this share of its diagonal from the result's.
const SAME_BOX: f64 = 1e-6;

/// Writes a result file as one HTML page with the part in three dimensions, which needs no network.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast report grips.json\n  gripfast report grips.json --part bracket.stl -o bracket.html\n  gripfast report grips.json --diverse --top 8 -o eight.html\n\n\
Without --part the part file that the result names is used: as written there, or else beside the result file.\n\
When neither exists, the part is drawn as its bounding box.\n\n\
The friction over all loads is shown for the best 20 grips, and for others whose loads the result keeps (plan --polish all)."
)]
pub(crate) struct Args {
    /// Result file of `gripfast plan -o`, JSON or JSON Lines.
    grips: PathBuf,
    /// The part file, when it is no longer where the result names it.
    #[arg(long, value_name = "FILE")]
    part: Option<PathBuf>,
    #[command(flatten)]
    choice: ChoiceArgs,
    /// Page to write. Default: the result file's name with .html.
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let mut set = GripSet::read(&args.grips)?;
    args.choice.filter().apply(&mut set)?;
    let output = args.output.unwrap_or_else(|| args.grips.with_extension("html"));
    if output == args.grips {
        return Err(Error::input(
            "-o",
            format!("'{}' is the result file itself", output.display()),
            "give another name",
        )
        .into());
    }
    let part = match args.part.as_deref() {
        Some(path) => Some(read_part(path, &set.part)?),
        None => recorded_part(&args.grips, &set.part),
    };
    if let Err(error) = solve_every_load(&mut set, WHOLE) {
        crate::terminal::say(&format!("warning: {error}\n  the page shows the worst loads only"));
    }
    report::write(&set, part.as_ref().map(|part| &part.mesh), &output)?;
    let size = std::fs::metadata(&output)
        .with_context(|| format!("cannot read back {}", output.display()))?
        .len();
    crate::terminal::say(&format!(
        "{}: {} grips, {:.1} MB",
        output.display(),
        set.grips.len(),
        size as f64 / 1e6
    ));
    Ok(ExitCode::SUCCESS)
}

/// The part that the result names; says why when it cannot be had.
fn recorded_part(grips: &Path, summary: &PartSummary) -> Option<Part> {
    let recorded = Path::new(&summary.file);
    let beside = recorded.file_name().map(|name| grips.with_file_name(name));
    let Some(path) =
        [Some(recorded.to_path_buf()), beside].into_iter().flatten().find(|path| path.is_file())
    else {
        crate::terminal::say(&format!(
            "warning: {}: not found; the part is drawn as its bounding box (--part FILE names it)",
            summary.file
        ));
        return None;
    };
    read_part(&path, summary)
        .inspect_err(|error| {
            crate::terminal::say(&format!(
                "warning: {error}\n  the part is drawn as its bounding box"
            ))
        })
        .ok()
}

/// Reads the part and makes sure that it is the one of the result.
fn read_part(path: &Path, summary: &PartSummary) -> gripfast::error::Result<Part> {
    let unit = Unit::ALL.into_iter().find(|unit| unit.metres() == summary.unit_m);
    let part = Part::read(path, &ReadOptions::default().with_unit(unit))?;
    let (low, high) = part.mesh.bounding_box();
    let tolerance = SAME_BOX * (summary.bbox_max - summary.bbox_min).length();
    let off = (low - summary.bbox_min).abs().max((high - summary.bbox_max).abs()).max_element();
    if off.is_nan() || off > tolerance {
        let size = (high - low) * 1e3;
        let expected = (summary.bbox_max - summary.bbox_min) * 1e3;
        let problem = format!(
            "is not the part of this result: its size is {size:.2} mm, or it lies elsewhere; the result's is {expected:.2} mm"
        );
        return Err(Error::input(
            path.display().to_string(),
            problem,
            "give the file that was planned on",
        ));
    }
    Ok(part)
}

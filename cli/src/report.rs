//! `gripfast report`: a result file as a page to look at.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::Args as ClapArgs;
use gripfast::error::Error;
use gripfast::part::Part;
use gripfast::plan::{WHOLE, near_misses, solve_every_load};
use gripfast::report;
use gripfast::results::GripSet;
use gripfast::text::counted;

use crate::choice::ChoiceArgs;

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
        Some(path) => Some(set.read_part(path)?),
        None => recorded_part(&args.grips, &set),
    };
    if let Err(error) = solve_every_load(&mut set, WHOLE) {
        crate::terminal::say(&format!("warning: {error}\n  the page shows the worst loads only"));
    }
    let misses = part.as_ref().map_or(Ok(Vec::new()), |part| near_misses(&set, part));
    let misses = misses.unwrap_or_else(|error| {
        crate::terminal::say(&format!("warning: {error}\n  the page shows no rejected candidates"));
        Vec::new()
    });
    report::write(&set, part.as_ref().map(|part| &part.mesh), &misses, &output)?;
    let size = std::fs::metadata(&output)
        .with_context(|| format!("cannot read back {}", output.display()))?
        .len();
    crate::terminal::say(&format!(
        "{}: {}, {:.1} MB",
        output.display(),
        counted(set.grips.len() as u64, "grip"),
        size as f64 / 1e6
    ));
    Ok(ExitCode::SUCCESS)
}

/// The part that the result names; says why when it cannot be had.
fn recorded_part(grips: &Path, set: &GripSet) -> Option<Part> {
    let Some(path) = set.part_file(grips) else {
        crate::terminal::say(&format!(
            "warning: {}: not found; the part is drawn as its bounding box (--part FILE names it)",
            set.part.file
        ));
        return None;
    };
    set.read_part(&path)
        .inspect_err(|error| {
            crate::terminal::say(&format!(
                "warning: {error}\n  the part is drawn as its bounding box"
            ))
        })
        .ok()
}

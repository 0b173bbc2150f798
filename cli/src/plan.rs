//! `gripfast plan`: from a part to ranked grips.

mod flags;
mod table;
mod watch;

use std::io::Write;
use std::process::ExitCode;

use gripfast::plan::{Observer, Outcome, Plan};

use super::why;
use crate::terminal;
use watch::Watch;

pub(crate) use flags::{Args, with_defaults};

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (why, print) = (args.why(), args.print_request);
    let request = args.request()?;
    if print {
        write!(terminal::output(), "{}", request.to_toml())?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut watch = Watch::new(request.output.quiet);
    let plan = Plan::builder(request).command(std::env::args().collect()).build()?;
    if let Some(text) = &why {
        plan.warnings().iter().for_each(|text| watch.warning(text));
        return explain(&plan, text);
    }
    let interrupt = watch::Interrupt::watched()?;
    let outcome = plan.run(&mut watch, &interrupt.stop);
    watch.end();
    let outcome = outcome?;
    print_answer(&plan, &outcome)?;
    notes(&plan, &outcome);
    Ok(match interrupt.code() {
        Some(code) if !outcome.set.provenance.complete => ExitCode::from(code),
        _ if outcome.set.grips.is_empty() => ExitCode::from(1),
        _ => ExitCode::SUCCESS,
    })
}

/// Why the pose of `--why` is a grip, or is not.
fn explain(plan: &Plan, text: &str) -> anyhow::Result<ExitCode> {
    let (position, angle, site) = why::pose(text)?;
    let explanation = plan.explain(site, position, angle)?;
    why::print(&mut std::io::stdout().lock(), &explanation)?;
    Ok(if explanation.rejection.is_none() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn print_answer(plan: &Plan, outcome: &Outcome) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    if plan.request().output.json {
        outcome.set.write_json(&mut out)?;
        writeln!(out)?;
        return Ok(());
    }
    drop(out);
    table::print(&mut terminal::output(), &outcome.set, &outcome.shown(), plan.gripper())
}

/// What became of the files, and of an interrupted run.
fn notes(plan: &Plan, outcome: &Outcome) {
    let output = &plan.request().output;
    if output.quiet {
        return;
    }
    if !outcome.set.provenance.complete {
        terminal::say("interrupted: the ranking covers the candidates looked at so far");
    }
    if let Some(file) = &outcome.checkpoint {
        let file = file.display();
        terminal::say(&format!("wrote {file}: the same command with --resume resumes the run"));
    }
    for path in &outcome.written {
        terminal::say(&format!("wrote {}", path.display()));
    }
}

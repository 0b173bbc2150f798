//! `gripfast plan`: from a part to ranked grips.

mod flags;
mod layout;
mod several;
mod summary;
mod table;
mod watch;

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use gripfast::error::Error;
use gripfast::export::{self, Format};
use gripfast::plan::{Ahead, Observer, Outcome, Plan};
use gripfast::poses::Pose;

use super::why;
use crate::terminal;
use watch::Watch;

pub(crate) use flags::{Args, JobArgs, id, share, with_defaults};
pub(crate) use watch::Interrupt;

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (why, print) = (args.why(), args.print_request);
    let variants = args.variants()?;
    if variants.len() > 1 {
        if why.is_some() || print {
            let flag = if print { "--print-request" } else { "--why" };
            let problem = "is about one gripper, mass, force and friction, and several are given";
            return Err(Error::input(flag, problem, "give one of each").into());
        }
        return several::run(&args.request()?, &variants);
    }
    let request = args.request()?;
    if print {
        write!(terminal::output(), "{}", request.to_toml())?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut watch = Watch::new(request.output.quiet);
    let mut builder = Plan::builder(request).command(std::env::args().collect());
    if why.is_none() {
        builder = builder.first_only();
    }
    let plan = builder.build()?;
    if let Some(text) = &why {
        plan.warnings().iter().for_each(|text| watch.warning(text));
        return explain(&plan, text);
    }
    if !plan.request().output.yes && !agreed(&plan.ahead()?)? {
        return Ok(ExitCode::from(2));
    }
    let interrupt = Interrupt::watched()?;
    watch.hold(&interrupt);
    let outcome = plan.run(&mut watch, &interrupt.stop);
    watch.end();
    let outcome = outcome?;
    print_answer(&plan, &outcome)?;
    notes(&plan, &outcome);
    let output = &plan.request().output;
    let watched = std::io::stdout().is_terminal() && std::io::stderr().is_terminal();
    if watched && !output.quiet && !output.json {
        // An interrupted run wrote its result under another name.
        let written = output.output.as_ref().and(outcome.written.first());
        let best = outcome.set.grips.first().map(|best| best.grip.id);
        terminal::say(&hint(best, written.map(PathBuf::as_path)));
    }
    Ok(match interrupt.code() {
        Some(code) if !outcome.set.provenance.complete => ExitCode::from(code),
        _ if outcome.set.any_holds() => ExitCode::SUCCESS,
        _ => ExitCode::from(1),
    })
}

/// Runs that seem longer than this are asked about \[s\].
const LONG: f64 = 3600.0;

/// Whether to start: short runs start without a question.
///
/// # Errors
/// When a long run is ahead and there is no terminal to ask on.
fn agreed(ahead: &Ahead) -> anyhow::Result<bool> {
    if ahead.seconds <= LONG {
        return Ok(true);
    }
    let hours = ahead.seconds / 3600.0;
    let work = format!(
        "{} candidates under {} loads take some {hours:.0} hours on {} threads",
        ahead.candidates, ahead.loads, ahead.threads
    );
    if !(std::io::stdin().is_terminal() && std::io::stderr().is_terminal()) {
        anyhow::bail!(
            "{work}\n  remedy: start with fewer loads, a coarser --spacing or --angle-step, or \
             some --faces; or start it all the same with --yes"
        );
    }
    terminal::say(&format!(
        "{work}, and a result of up to {:.0} MB; start? [y/N]",
        ahead.bytes / 1e6
    ));
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).context("the answer")?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}

/// Why the pose of `--why` is a grip, or is not.
fn explain(plan: &Plan, text: &str) -> anyhow::Result<ExitCode> {
    /// What closing jaws right of a pose in part coordinates: as `assess` has it.
    const TILT: f64 = 3.0;
    let pose = match why::pose(text)? {
        why::Asked::OnPart(pose) => pose,
        why::Asked::OnFaces { position, angle, pair } => {
            let (face_i, face_ii) = pair.faces(plan.part())?;
            let explanation = plan.explain(plan.site_of(face_i, face_ii)?, position, angle)?;
            if explanation.rejection.is_some() {
                why::print(&mut terminal::output(), &explanation)?;
                return Ok(ExitCode::from(1));
            }
            explanation.part_from_grip
        }
    };
    let tilt = TILT.to_radians();
    let (assessed, standing) = if plan.ahead()?.seconds > LONG && !plan.request().output.yes {
        terminal::say(
            "its rank is not told: finding all grips would take more than an hour (--yes does it)",
        );
        let mut poses = plan.assess(&[Pose::of_grip("pose", pose)], tilt)?.poses;
        (poses.remove(0), None)
    } else {
        plan.place(&pose, tilt)?
    };
    why::print_standing(&mut terminal::output(), &assessed, standing)?;
    Ok(if assessed.is_free() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn print_answer(plan: &Plan, outcome: &Outcome) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    if plan.request().output.json {
        outcome.set.write_json(&mut out)?;
        writeln!(out)?;
        return Ok(());
    }
    drop(out);
    let (mut out, width) = (terminal::output(), layout::width());
    table::print(&mut out, &outcome.set, &outcome.shown(), plan.gripper(), width)
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
        let frame = Format::from_path(path)
            .and_then(|format| export::tool_frame(&outcome.set, format, &Default::default()));
        let frame =
            frame.ok().flatten().map_or(String::new(), |frame| format!(", tool frame {frame}"));
        terminal::say(&format!("wrote {}{frame}", path.display()));
    }
}

/// The commands to run next.
fn hint(best: Option<u64>, written: Option<&Path>) -> String {
    let Some(best) = best else {
        return "next: --report page.html shows the reasons and what would help".to_owned();
    };
    match written.filter(|file| file.extension().is_none_or(|ending| ending == "json")) {
        Some(file) => {
            let file = file.display();
            format!(
                "next: gripfast why {file} {best}; gripfast report {file}; gripfast export {file} -o \
                 grips.csv; gripfast pick {file} --scene cell.toml"
            )
        }
        None => "next: -o grips.json keeps the grips for `gripfast why`, `report`, `export` and \
                 `pick`; --report page.html shows them"
            .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commands_to_run_next_name_the_file_that_was_written() {
        let after = hint(Some(7), Some(Path::new("grips.interrupted.json")));
        assert!(after.contains("gripfast why grips.interrupted.json 7;"), "{after}");
        for none in [None, Some(Path::new("grips.csv"))] {
            assert!(hint(Some(7), none).contains("-o grips.json keeps"), "{none:?}");
        }
    }
}

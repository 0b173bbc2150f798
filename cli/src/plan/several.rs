//! Several grippers side by side: the same request planned with each.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gripfast::error::Error;
use gripfast::plan::{Outcome, Plan};
use gripfast::request::Request;
use gripfast::results::RankedGrip;

use super::layout::{self, Column, number, width, words, wrapped};
use super::watch::{Interrupt, Watch};
use super::{agreed, notes, table};
use crate::terminal;

/// Plans with each gripper, prints their best grips in one table, and writes the files of each under
/// a name of its own: `grips.robotiq-2f85.json` for `grips.json`.
pub(super) fn run(request: &Request, grippers: &[String]) -> anyhow::Result<ExitCode> {
    let tags = tags(grippers)?;
    if request.output.json {
        return Err(Error::input(
            "--json",
            "prints one result, and several grippers are given",
            "give one gripper, or -o FILE for a file of each",
        )
        .into());
    }
    let interrupt = Interrupt::watched()?;
    let mut outcomes: Vec<(Plan, Outcome)> = Vec::new();
    for (gripper, tag) in grippers.iter().zip(&tags) {
        let mut request = request.clone();
        request.gripper.clone_from(gripper);
        for path in [&mut request.output.output, &mut request.output.report].into_iter().flatten() {
            *path = tagged(path, tag);
        }
        let mut watch = Watch::new(request.output.quiet);
        let plan = Plan::builder(request.clone()).command(std::env::args().collect()).build()?;
        if !request.output.yes && !agreed(&plan.ahead()?)? {
            return Ok(ExitCode::from(2));
        }
        let outcome = plan.run(&mut watch, &interrupt.stop);
        watch.end();
        outcomes.push((plan, outcome?));
        if interrupt.code().is_some() {
            break;
        }
    }
    print(&outcomes)?;
    outcomes.iter().for_each(|(plan, outcome)| notes(plan, outcome));
    Ok(match interrupt.code() {
        Some(code) => ExitCode::from(code),
        None if outcomes.iter().any(|(_, outcome)| outcome.set.any_holds()) => ExitCode::SUCCESS,
        None => ExitCode::from(1),
    })
}

fn print(outcomes: &[(Plan, Outcome)]) -> anyhow::Result<()> {
    let (mut out, width) = (terminal::output(), width());
    for (plan, outcome) in outcomes {
        writeln!(out, "{}: {}", plan.gripper().name, table::verdict(&outcome.set))?;
    }
    let found = |(_, outcome): &&(Plan, Outcome)| !outcome.set.grips.is_empty();
    let (mut columns, mut rows) = (Vec::new(), Vec::new());
    for (plan, outcome) in outcomes.iter().filter(found) {
        columns = columns_of(plan, outcome);
        rows.push(layout::row(&columns, &outcome.set.grips[0]));
    }
    if rows.is_empty() {
        return Ok(());
    }
    let (table, left_out) = layout::table(&columns, &rows, width);
    writeln!(out, "\nthe best grip of each:\n{table}")?;
    if !left_out.is_empty() {
        writeln!(out, "Left out to fit {width} columns: {}.", left_out.join(", "))?;
    }
    let text = "force N: gripping force per jaw with which it just holds; + more than the gripper \
                has, - less than its least. pad: share of the pad that touches; left: share of that \
                contact left under the worst load.";
    writeln!(out, "\n{}", wrapped(text, width))?;
    Ok(())
}

fn columns_of<'a>(plan: &'a Plan, outcome: &'a Outcome) -> Vec<Column<'a>> {
    let (set, gripper) = (&outcome.set, plan.gripper());
    let mut columns = vec![
        words("gripper", 0, |_: &RankedGrip| gripper.name.clone()),
        words("verdict", 0, |grip| set.verdict(grip).name().to_owned()),
        number("id", 0, |grip| grip.grip.id.to_string()),
    ];
    columns.extend(table::measures(set, gripper));
    columns.push(number("width mm", 2, |grip| format!("{:.2}", grip.grip.width * 1e3)));
    columns
}

/// A short name of each gripper, for files.
fn tags(grippers: &[String]) -> anyhow::Result<Vec<String>> {
    let mut tags: Vec<String> = Vec::with_capacity(grippers.len());
    for gripper in grippers {
        let name = Path::new(gripper).file_name().unwrap_or_default().to_string_lossy();
        let tag = name.strip_suffix(".toml").unwrap_or(&name).to_owned();
        if tags.contains(&tag) {
            return Err(Error::input(
                "--gripper",
                format!("'{tag}' is given twice"),
                "give each gripper once, files under names of their own",
            )
            .into());
        }
        tags.push(tag);
    }
    Ok(tags)
}

/// A file's name with the gripper's before its ending.
fn tagged(path: &Path, tag: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(match name.split_once('.') {
        Some((stem, ending)) if !stem.is_empty() => format!("{stem}.{tag}.{ending}"),
        _ => format!("{name}.{tag}"),
    })
}

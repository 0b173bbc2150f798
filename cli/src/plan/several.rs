//! Several grippers, masses, forces or pads side by side: the same request planned with each.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gripfast::error::Error;
use gripfast::plan::{Outcome, Plan};
use gripfast::request::Request;
use gripfast::results::RankedGrip;
use gripfast::units::{Force, Mass, decimal};

use super::layout::{self, Column, number, width, words, wrapped};
use super::watch::{Interrupt, Watch};
use super::{agreed, notes, summary, table};
use crate::terminal;

/// One of the plans that are compared.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Variant {
    gripper: Option<String>,
    mass: Option<Mass>,
    force: Option<Force>,
    pad_friction: Option<f64>,
    /// What tells it from the others, for the names of files.
    tag: String,
    /// The same beside the gripper's name.
    label: String,
}

/// Every gripper with every mass of the part, every force and every friction of the pads.
///
/// # Errors
/// When one is given twice.
pub(super) fn variants(
    grippers: &[String],
    masses: &[Mass],
    forces: &[Force],
    frictions: &[f64],
) -> gripfast::error::Result<Vec<Variant>> {
    let mut variants: Vec<Variant> = Vec::new();
    let counts = [grippers.len(), masses.len(), forces.len(), frictions.len()];
    // The last one turns fastest.
    for number in 0..counts.map(|count| count.max(1)).iter().product() {
        let mut rest: usize = number;
        let mut place = [0; 4];
        for (place, count) in place.iter_mut().zip(counts).rev() {
            (*place, rest) = (rest % count.max(1), rest / count.max(1));
        }
        let (gripper, mass) = (grippers.get(place[0]), masses.get(place[1]).copied());
        let (force, pad_friction) =
            (forces.get(place[2]).copied(), frictions.get(place[3]).copied());
        let mut words = Vec::new();
        if let Some(gripper) = gripper.filter(|_| grippers.len() > 1) {
            let name = Path::new(gripper).file_name().unwrap_or_default().to_string_lossy();
            words.push(name.strip_suffix(".toml").unwrap_or(&name).to_owned());
        }
        let mut label = String::new();
        if let Some(mass) = mass.filter(|_| masses.len() > 1) {
            words.push(format!("{}kg", mass.0));
            label += &format!(", {}", weighed(mass));
        }
        if let Some(force) = force.filter(|_| forces.len() > 1) {
            words.push(format!("{}N", force.0));
            label += &format!(", {} N", force.0);
        }
        if let Some(friction) = pad_friction.filter(|_| frictions.len() > 1) {
            words.push(format!("mu{friction}"));
            label += &format!(", pads {friction}");
        }
        let tag = words.join("-");
        if variants.iter().any(|variant| variant.tag == tag) {
            let flags = ["--gripper", "--mass", "--force", "--pad-friction"];
            let flag = flags[counts.iter().position(|count| *count > 1).unwrap_or(0)];
            let remedy =
                "give each gripper, mass, force and friction once, files under names of their own";
            return Err(Error::input(flag, format!("'{tag}' is given twice"), remedy));
        }
        variants.push(Variant { gripper: gripper.cloned(), mass, force, pad_friction, tag, label });
    }
    Ok(variants)
}

/// A mass in grams, or in kilograms from one on.
fn weighed(mass: Mass) -> String {
    match mass.0 {
        0.0..1.0 => format!("{} g", decimal(mass.0 * 1e3, 3)),
        kilograms => format!("{} kg", decimal(kilograms, 3)),
    }
}

/// Plans each variant, prints their best grips in one table, and writes the files of each under a
/// name of its own: `grips.robotiq-2f85.json` for `grips.json`.
pub(super) fn run(request: &Request, variants: &[Variant]) -> anyhow::Result<ExitCode> {
    if request.output.json {
        return Err(Error::input(
            "--json",
            "prints one result, and several plans are asked for",
            "give one gripper, mass, force and friction, or -o FILE for a file of each",
        )
        .into());
    }
    let interrupt = Interrupt::watched()?;
    let mut outcomes: Vec<Compared> = Vec::new();
    let mut watch = Watch::new(request.output.quiet);
    for variant in variants {
        let mut request = request.clone();
        if let Some(gripper) = &variant.gripper {
            request.gripper.clone_from(gripper);
        }
        request.mass = variant.mass.or(request.mass);
        request.force = variant.force.or(request.force);
        let scoring = &mut request.scoring;
        scoring.pad_friction = variant.pad_friction.or(scoring.pad_friction);
        for path in [&mut request.output.output, &mut request.output.report].into_iter().flatten() {
            *path = tagged(path, &variant.tag);
        }
        // The table has the best grip of each.
        let builder = Plan::builder(request.clone()).command(std::env::args().collect());
        let plan = builder.first_only().build()?;
        let name = format!("{}{}", plan.gripper().name, variant.label);
        watch.about(&name);
        if !request.output.yes && !agreed(&plan.ahead()?)? {
            return Ok(ExitCode::from(2));
        }
        watch.hold(&interrupt);
        let outcome = plan.run(&mut watch, &interrupt.stop);
        watch.end();
        outcomes.push(Compared { name, plan, outcome: outcome? });
        if interrupt.code().is_some() {
            break;
        }
    }
    print(&outcomes)?;
    outcomes.iter().for_each(|compared| notes(&compared.plan, &compared.outcome));
    Ok(match interrupt.code() {
        Some(code) => ExitCode::from(code),
        None if outcomes.iter().any(|compared| compared.outcome.set.any_holds()) => {
            ExitCode::SUCCESS
        }
        None => ExitCode::from(1),
    })
}

/// A plan that was run.
struct Compared {
    name: String,
    plan: Plan,
    outcome: Outcome,
}

fn print(outcomes: &[Compared]) -> anyhow::Result<()> {
    let (mut out, width) = (terminal::output(), width());
    if let Some(compared) = outcomes.first() {
        let set = &compared.outcome.set;
        let mass = |compared: &Compared| compared.outcome.set.part.mass.mass;
        let same = outcomes.iter().all(|other| mass(other) == mass(compared));
        writeln!(out, "{}", if same { summary::part(set) } else { summary::solid(set) })?;
    }
    for Compared { name, outcome, .. } in outcomes {
        let unsolved =
            summary::unsolved(&outcome.set).map_or(String::new(), |text| format!("; {text}"));
        writeln!(out, "{name}: {}{unsolved}", summary::verdict(&outcome.set))?;
        if !outcome.set.any_holds()
            && let Some(reasons) = summary::reasons(&outcome.set)
        {
            writeln!(out, "  rejected: {reasons}")?;
        }
    }
    let found = |compared: &&Compared| !compared.outcome.set.grips.is_empty();
    let (mut columns, mut rows) = (Vec::new(), Vec::new());
    for compared in outcomes.iter().filter(found) {
        columns = columns_of(compared);
        rows.push(layout::row(&columns, &compared.outcome.set.grips[0]));
    }
    if rows.is_empty() {
        return Ok(());
    }
    let (table, left_out) = layout::table(&columns, &rows, width);
    writeln!(out, "\nthe best grip of each:\n{table}")?;
    if !left_out.is_empty() {
        writeln!(out, "Left out to fit {width} columns: {}.", left_out.join(", "))?;
    }
    let usable = summary::usable(outcomes[0].outcome.set.pads().safety);
    let text = format!(
        "force N: gripping force per jaw with which it {usable} under every load; + more than the \
         gripper has, - less than its least. pad: share of the pad that touches; left: share of that contact left under \
         the worst load."
    );
    writeln!(out, "\n{}", wrapped(&text, width))?;
    Ok(())
}

fn columns_of(compared: &Compared) -> Vec<Column<'_>> {
    let Compared { name, plan, outcome } = compared;
    let (set, gripper) = (&outcome.set, plan.gripper());
    let mut columns = vec![
        words("gripper", 0, |_: &RankedGrip| name.clone()),
        words("verdict", 0, |grip| set.verdict(grip).name().to_owned()),
        number("id", 0, |grip| grip.grip.id.to_string()),
    ];
    columns.extend(table::measures(set, gripper));
    columns.push(number("width mm", 2, |grip| format!("{:.2}", grip.grip.width * 1e3)));
    columns
}

/// A file's name with this before its ending.
fn tagged(path: &Path, tag: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(match name.split_once('.') {
        Some((stem, ending)) if !stem.is_empty() => format!("{stem}.{tag}.{ending}"),
        _ => format!("{name}.{tag}"),
    })
}

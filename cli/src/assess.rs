//! `gripfast assess`: poses from outside, scored as the grips of a plan are.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args as ClapArgs;
use comfy_table::{CellAlignment, Table, presets};
use gripfast::export::{Convention, Format, Origin};
use gripfast::plan::{Assessed, Plan};
use gripfast::poses;
use gripfast::results::GripSet;
use gripfast::units::Quantity;
use serde_json::json;

use crate::{plan, terminal};

/// Poses that the table lists; the rest is counted.
const LISTED: usize = 50;

/// Assesses poses from outside: taught ones, or those of another program. For each one: the faces
/// that it grips, whether it is free, and the friction that holds it.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast assess bracket.stl --poses taught.csv --gripper robotiq-2f85 --mass 350g\n  \
gripfast assess bracket.stl --poses grasps.h5 --origin 103.4mm --gripper franka-hand --mass 350g --accel 2g -o good.json\n  \
gripfast assess bracket.stl --poses lab.isaac_grasp.yaml --origin flange --gripper generic --mass 350g --json\n\n\
FILES: CSV or Parquet (columns x_m, y_m, z_m or x_mm, y_mm, z_mm; qx, qy, qz, qw or the angles of a robot; id), isaac_grasp, moveit, graspgen, graspnet (.npz, .npy), acronym, or a \
result file of gripfast. Axes and origin are those that exports of the format hold (docs/formats.md), or as the file itself or \
--convention and --origin say. Everything else is asked as of `gripfast plan`.\n\nEXIT CODES:\n  0  at least one pose is a grip    1  none is    2  bad input or usage"
)]
pub(crate) struct AssessArgs {
    /// File of poses.
    #[arg(long, value_name = "FILE")]
    poses: PathBuf,
    /// Format of that file; by its ending when not given.
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// Axes of its poses: standard, moveit (z approach, y closing), graspgen (z, x), graspnet, dexnet
    /// (x, y), flange or tool (as the gripper file states them).
    #[arg(long, value_name = "NAME")]
    convention: Option<String>,
    /// Origin of its poses: pads (midway between them), flange, tool, or a distance behind the pads.
    #[arg(long, value_name = "ORIGIN")]
    origin: Option<String>,
    /// Largest angle by which a pose may be off the faces' normal: closing jaws right it.
    #[arg(long, value_name = "ANGLE", default_value = "3deg")]
    tilt: String,
    #[command(flatten)]
    plan: plan::Args,
}

/// Runs the subcommand.
pub(crate) fn run(args: AssessArgs) -> anyhow::Result<ExitCode> {
    let options = poses::Options {
        format: args.format.as_deref().map(|name| Format::parse("--format", name)).transpose()?,
        convention: args
            .convention
            .as_deref()
            .map(|name| Convention::parse("--convention", name))
            .transpose()?,
        origin: args.origin.as_deref().map(|text| Origin::parse("--origin", text)).transpose()?,
    };
    let turn = Quantity::Angle.parse("--tilt", &args.tilt)?;
    args.plan.single()?;
    let request = args.plan.request()?;
    let (as_json, quiet) = (request.output.json, request.output.quiet);
    let output = request.output.output.clone();
    let plan = Plan::builder(request).command(std::env::args().collect()).build()?;
    for text in plan.warnings() {
        terminal::say(&format!("warning: {}", crate::flags::warning(text)));
    }
    let list = poses::read(&args.poses, &options, plan.gripper())?;
    if let Some(text) = poses::doubt(&list, plan.part()) {
        terminal::say(&format!("warning: {text}"));
    }
    let assessment = plan.assess(&list, turn)?;
    if as_json {
        let mut out = std::io::stdout().lock();
        let rows: Vec<_> =
            assessment.poses.iter().map(|pose| pose.to_json(&assessment.set)).collect();
        serde_json::to_writer(
            &mut out,
            &json!({"poses": rows, "grips": assessment.set.grips.len()}),
        )?;
        writeln!(out)?;
    } else {
        print(&mut terminal::output(), &assessment.poses, &assessment.set)?;
        let strange = assessment.poses.iter().all(|pose| pose.fit.is_err());
        if let Some(one) = list.first().filter(|_| strange && !quiet) {
            terminal::say(&format!(
                "no pose has faces between its pads: the poses were read with {}, origin {} \
                 (--convention, --origin)",
                one.convention.axes(),
                one.origin
            ));
        }
    }
    if let Some(path) = &output {
        plan.save(&assessment.set)?;
        if !quiet {
            terminal::say(&format!("wrote {}", path.display()));
        }
    }
    Ok(if assessment.set.any_holds() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn print(out: &mut impl Write, poses: &[Assessed], set: &GripSet) -> anyhow::Result<()> {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header([
        "pose",
        "verdict",
        "mu_s",
        "safety",
        "faces",
        "width mm",
        "contact mm2",
        "left",
        "off mm",
        "off deg",
    ]);
    for pose in poses.iter().take(LISTED) {
        let ranked = pose.ranked.as_ref();
        let number = |value: Option<f64>, digits: usize| {
            value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
        };
        let mu_s = ranked.and_then(|ranked| ranked.worst.mu_s);
        let areas = ranked.map_or("-".to_owned(), |ranked| {
            let contact = &ranked.grip.contact;
            let [one, two] = [&contact.face_i, &contact.face_ii]
                .map(|patch| gripfast::geometry::patch_area(patch) * 1e6);
            format!("{one:.1} | {two:.1}")
        });
        let explanation = pose.explanation.as_ref();
        table.add_row([
            pose.name.clone(),
            pose.verdict(set),
            number(mu_s, 5),
            number(ranked.and_then(|ranked| ranked.safety), 2),
            explanation.map_or("-".to_owned(), |one| format!("{} | {}", one.face_i, one.face_ii)),
            number(explanation.map(|one| one.width * 1e3), 2),
            areas,
            ranked.map_or("-".to_owned(), |one| format!("{:.0} %", one.contact_share * 100.0)),
            number(pose.fit.ok().map(|fit| fit.shifted * 1e3), 2),
            number(pose.fit.ok().map(|fit| fit.turned.to_degrees()), 2),
        ]);
    }
    for column in [2, 3, 5, 7, 8, 9] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    writeln!(out, "{}", table.trim_fmt())?;
    if poses.len() > LISTED {
        writeln!(out, "... and {} more (--json lists all)", poses.len() - LISTED)?;
    }
    let mut counts: std::collections::BTreeMap<String, usize> = Default::default();
    for pose in poses {
        // Without the numbers.
        let word = pose.verdict(set);
        let word = word.split(": the ").next().unwrap_or_default().to_owned();
        *counts.entry(word).or_default() += 1;
    }
    let counts: Vec<String> =
        counts.iter().map(|(word, count)| format!("{count} {word}")).collect();
    writeln!(out, "\n{} poses: {}", poses.len(), counts.join(", "))?;
    writeln!(
        out,
        "off: how far the pose was from pads flat on the faces with these midway; closing jaws right it."
    )?;
    Ok(())
}

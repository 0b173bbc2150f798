//! `gripfast pick`: the first grip that is free in a scene.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args as ClapArgs;
use gripfast::export::{Convention, Origin, tool_in_grip};
use gripfast::model::Frame;
use gripfast::pick::{Picker, Scene};
use gripfast::results::{GripSet, quaternion_xyzw};
use serde_json::json;

use crate::flags::warning;
use crate::terminal::say;

/// Passed-over grips that are listed in words; the rest is counted.
const LISTED: usize = 10;

/// Picks the first grip of a ranked list that is free in a scene, and says why the ones before it
/// are not.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast pick grips.json --scene cell.toml\n  gripfast pick grips.json --scene cell.toml --json --convention moveit --origin flange\n\n\
SCENE FILE (docs/formats.md has all fields):\n  [part]\n  position = [\"400mm\", \"0mm\", \"20mm\"]\n  rpy = [\"0deg\", \"0deg\", \"90deg\"]\n  [[obstacle]]\n  name = \"table\"\n  plane = [0, 0, 1]\n  \
[[obstacle]]\n  name = \"bin\"\n  mesh = \"bin.stl\"\n\nEXIT CODES:\n  0  a grip is free    1  none is    2  bad input or usage"
)]
pub(crate) struct Args {
    /// Result file written by `gripfast plan -o`, JSON or JSON Lines.
    grips: PathBuf,
    /// Scene file: the part's pose, obstacles, limits of the robot.
    #[arg(long, value_name = "FILE")]
    scene: PathBuf,
    /// Take grips too that slip with the friction of the pads; they are passed over otherwise.
    #[arg(long)]
    allow_slip: bool,
    /// Print JSON, with the reason for every grip passed over.
    #[arg(long)]
    json: bool,
    /// Axes of the tool frame: standard, moveit (z approach, y closing), graspgen (z, x), graspnet,
    /// dexnet (x, y), flange or tool (as the gripper file states them).
    #[arg(long, value_name = "NAME", default_value = "standard")]
    convention: String,
    /// Origin of the tool frame: pads (midway between them), flange, tool, or a distance behind the
    /// pads.
    #[arg(long, value_name = "ORIGIN", default_value = "pads")]
    origin: String,
}

/// Runs the subcommand.
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let convention = Convention::parse("--convention", &args.convention)?;
    let origin = Origin::parse("--origin", &args.origin)?;
    let set = GripSet::read(&args.grips)?;
    let scene = Scene::read(&args.scene)?;
    let picker = Picker::new(&set, &scene)?.allow_slip(args.allow_slip);
    let warnings = &set.provenance.warnings;
    warnings.iter().for_each(|text| say(&format!("warning: {}", warning(text))));
    // Refused before the search where the gripper does not state the frame.
    tool_in_grip(convention, origin, Some(picker.gripper()), 0.0)?;
    let started = Instant::now();
    let pick = picker.pick(&scene.world_from_part);
    let seconds = started.elapsed().as_secs_f64();

    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    for reason in &pick.passed {
        *counts.entry(picker.category(reason)).or_default() += 1;
    }
    let chosen = pick.chosen.map(|index| &set.grips[index]);
    let pose = chosen.map(|grip| -> anyhow::Result<Frame> {
        let gap = picker.gripper().jaw_gap(&grip.grip);
        let tool = tool_in_grip(convention, origin, Some(picker.gripper()), gap)?;
        Ok(scene.world_from_part.compose(&grip.grip.part_from_grip).compose(&tool))
    });
    let pose = pose.transpose()?;
    let tool_frame = format!("{}, origin {origin}", convention.axes());
    let free_turn = set.part.symmetry.map(|symmetry| symmetry.moved(&scene.world_from_part));
    let mut out = crate::terminal::answer(args.json);
    if args.json {
        let passed: Vec<_> = pick
            .passed
            .iter()
            .zip(&set.grips)
            .map(|(reason, grip)| json!({"rank": grip.rank, "id": grip.grip.id, "reason": picker.describe(reason)}))
            .collect();
        let chosen = chosen.zip(pose).map(|(grip, pose)| {
            let approach = scene.world_from_part.rotation * grip.grip.part_from_grip.rotation.x_axis;
            json!({
                "rank": grip.rank,
                "id": grip.grip.id,
                "mu_s": grip.worst.mu_s,
                "score": grip.score,
                "verdict": set.verdict(grip).name(),
                "width_m": grip.grip.width,
                "opened_m": picker.opened(&grip.grip),
                "world_from_tool": {"position": pose.origin, "quaternion_xyzw": quaternion_xyzw(pose.rotation)},
                "approach_from": pose.origin - approach * scene.approach,
                "approach_direction": approach,
                "tool_frame": tool_frame,
                "free_turn": free_turn,
            })
        });
        serde_json::to_writer(
            &mut out,
            &json!({"chosen": chosen, "passed": passed, "counts": counts, "grips": set.grips.len(), "warnings": warnings, "seconds": seconds}),
        )?;
        writeln!(out)?;
    } else {
        for (reason, grip) in pick.passed.iter().zip(&set.grips).take(LISTED) {
            writeln!(
                out,
                "passed over: rank {}, id {}: {}",
                grip.rank,
                grip.grip.id,
                picker.describe(reason)
            )?;
        }
        if pick.passed.len() > LISTED {
            writeln!(out, "passed over: {} in all:", pick.passed.len())?;
            for (category, count) in &counts {
                writeln!(out, "  {count:8}  {category}")?;
            }
        }
        match chosen.zip(pose) {
            None => {
                let slips = match counts.contains_key("slips") {
                    true => " and holds (--allow-slip takes those that slip too)",
                    false => "",
                };
                writeln!(out, "no grip of {} is free{slips}", set.grips.len())?;
                if set.grips.iter().any(|grip| !grip.merged.is_empty()) {
                    writeln!(
                        out,
                        "their turned and mirrored copies were left out of the result: a plan without \
                         --merge-symmetric has them"
                    )?;
                }
            }
            Some((grip, pose)) => {
                // Rounded first: no negative zeros.
                let tidy = |value: f64, step: f64| (value * step).round() / step + 0.0;
                let [x, y, z] = (pose.origin * 1e3).to_array().map(|value| tidy(value, 1e3));
                let [qx, qy, qz, qw] = quaternion_xyzw(pose.rotation).map(|value| tidy(value, 1e6));
                let slips = match set.verdict(grip).holds() {
                    Some(false) => ", but it slips",
                    _ => "",
                };
                writeln!(out, "free: rank {}, id {}{slips}", grip.rank, grip.grip.id)?;
                if let Some(mu_s) = grip.worst.mu_s {
                    let pads = set.pads().value.map(|pads| format!(", the pads have {pads}"));
                    let pads = pads.unwrap_or_default();
                    writeln!(out, "  smallest friction that holds  {mu_s:.4}{pads}")?;
                }
                writeln!(
                    out,
                    "  pads                          {:.2} mm apart, opened to {:.2} mm",
                    grip.grip.width * 1e3,
                    picker.opened(&grip.grip) * 1e3
                )?;
                writeln!(out, "  tool in the world             x {x:.3}  y {y:.3}  z {z:.3} mm")?;
                writeln!(out, "  orientation (qx qy qz qw)     {qx:.6} {qy:.6} {qz:.6} {qw:.6}")?;
                writeln!(out, "  tool frame                    {tool_frame}")?;
                if let Some(about) = free_turn.as_ref().and_then(crate::part::about) {
                    writeln!(out, "  a turn maps grips to grips    about {about} of the world")?;
                }
            }
        }
        writeln!(
            out,
            "looked at {} of {} grips in {:.2} ms",
            pick.passed.len() + usize::from(chosen.is_some()),
            set.grips.len(),
            seconds * 1e3
        )?;
    }
    Ok(if chosen.is_some() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

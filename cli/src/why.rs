//! `gripfast why`: why one pose is a grip, or is not.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args as ClapArgs;
use gripfast::error::{Error, Result};
use gripfast::gripper::Gripper;
use gripfast::part::{Part, ReadOptions, Unit};
use gripfast::propose::{Explanation, ProposeOptions, Proposer};
use gripfast::results::{ForceRange, GripSet, RankedGrip};
use gripfast::units::Quantity;

/// Explains one grip of a result file: every test with body and place, and what its score is made
/// of.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast why grips.json 962\n  gripfast why grips.json 962 --part bracket.stl\n\n\
For a pose that is not in the list use `gripfast plan .. --why X,Y,ANGLE,SITE`."
)]
pub(crate) struct Args {
    /// Result file of `gripfast plan`.
    grips: PathBuf,
    /// Number (id) of the grip.
    id: u64,
    /// Part file [default: the one named in the result file].
    #[arg(long)]
    part: Option<PathBuf>,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let set = GripSet::read(&args.grips)?;
    let file = args.grips.display().to_string();
    let Some(ranked) = set.grips.iter().find(|ranked| ranked.grip.id == args.id) else {
        return Err(Error::input(
            &file,
            format!("holds no grip {}", args.id),
            "see the ids in `gripfast plan`'s table, or explain a pose with `gripfast plan --why`",
        )
        .into());
    };
    let gripper: Gripper = serde_json::from_value(set.gripper.clone())
        .map_err(|error| Error::input(&file, format!("gripper: {error}"), "make the file again"))?;
    let path = args.part.unwrap_or_else(|| PathBuf::from(&set.part.file));
    let unit = Unit::ALL.into_iter().find(|unit| unit.metres() == set.part.unit_m);
    let mut part = Part::read(&path, &ReadOptions::default().with_unit(unit))?;
    part.set_centre_of_mass(set.part.mass.centre_of_mass);
    let options = ProposeOptions::read(&set.provenance.request.candidates)?;
    let proposer = Proposer::new(&part, &gripper, &options)?;
    let explanation = proposer.explain_pose(
        ranked.grip.face_i,
        ranked.grip.face_ii,
        &ranked.grip.part_from_grip,
    )?;
    let mut out = crate::terminal::output();
    print(&mut out, &explanation)?;
    let worst = &ranked.worst;
    writeln!(
        out,
        "rank {} of {}: score {}",
        ranked.rank,
        set.summary.ranked,
        ranked.score.map_or("-".into(), |score| format!("{score:.4}"))
    )?;
    writeln!(
        out,
        "worst load: {}",
        set.loads.get(worst.load as usize).map_or("?", |load| load.name.as_str())
    )?;
    // Rounded first: no negative zeros.
    let tidy = |values: glam::DVec3, step: f64| {
        (values * step).round().to_array().map(|value| value / step + 0.0)
    };
    let [f, m] = [tidy(worst.wrench.force, 1e4), tidy(worst.wrench.moment, 1e5)];
    writeln!(
        out,
        "  in the grip frame: F ({:.4}, {:.4}, {:.4}) N, M ({:.5}, {:.5}, {:.5}) N m",
        f[0], f[1], f[2], m[0], m[1], m[2]
    )?;
    if let (Some(mu), Some(bounds)) = (worst.mu_s, worst.bounds) {
        writeln!(
            out,
            "  mu_s {mu:.9}, certified between {:.9} and {:.9} for its pressure, residual {:.1e}",
            bounds.lower, bounds.upper, worst.residual
        )?;
    }
    writeln!(
        out,
        "  contact left {:.1} %, twist-out margin {:.3}, alpha {:.2} deg, Delta_d {:.3} mm",
        ranked.contact_share * 100.0,
        ranked.twist_margin,
        ranked.alpha.to_degrees(),
        ranked.delta_d * 1e3
    )?;
    limits(&mut out, ranked, &set)?;
    Ok(ExitCode::SUCCESS)
}

/// How much more it holds, and what was asked for besides.
fn limits(out: &mut impl Write, ranked: &RankedGrip, set: &GripSet) -> std::io::Result<()> {
    if let (Some(safety), Some(needed), Some(multiple)) =
        (ranked.safety, ranked.force_needed, ranked.load_multiple)
    {
        let friction = set.provenance.resolved.pad_friction;
        let friction = friction.map_or(String::new(), |friction| format!(" {friction}"));
        let asked = match set.pads().safety {
            1.0 => String::new(),
            safety => format!(" for a safety of {safety}"),
        };
        let range = match set.force_range(ranked) {
            Some(ForceRange::Above) => " (more than the gripper has)",
            Some(ForceRange::Below) => " (less than its least)",
            _ => "",
        };
        writeln!(
            out,
            "  {} with the pads' friction{friction}: safety {safety:.2}, gripping force needed{asked} {needed:.2} N per jaw{range}, held up to {multiple:.2} times this load",
            set.verdict(ranked).name()
        )?;
    }
    if let Some(noise) = ranked.pose_noise {
        let mu = |value: Option<f64>| value.map_or("lost".to_owned(), |mu| format!("{mu:.5}"));
        writeln!(
            out,
            "  pose uncertain: of {} displaced poses {} are lost; mu_s of 95 % at most {}, of all {}",
            noise.samples,
            noise.lost,
            mu(noise.mu_s_95),
            mu(noise.mu_s_worst)
        )?;
    }
    if let (Some(earlier), Some(comparison)) = (&ranked.earlier, &set.summary.comparison) {
        let [x, y] = earlier.slip_centre.map(|value| value * 1e3);
        writeln!(
            out,
            "  earlier method: evaluation {:.4}, place {} of {}, mu_s {:.5} about the centroid ({x:.2}, {y:.2}) mm",
            earlier.evaluation, earlier.place, comparison.grips, earlier.mu_s
        )?;
    }
    Ok(())
}

/// The pose of `plan --why X,Y,ANGLE,SITE`, e.g. `3mm,-2mm,30deg,0`.
pub(crate) fn pose(text: &str) -> Result<(glam::DVec2, f64, usize)> {
    let flag = "--why";
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [x, y, angle, site] = parts[..] else {
        return Err(Error::input(
            flag,
            format!("'{text}' is not four values"),
            "give X,Y,ANGLE,SITE, e.g. 3mm,-2mm,30deg,0 (position and angle in the plane of the face pair)",
        ));
    };
    let site = site.parse().map_err(|_| {
        Error::input(flag, format!("'{site}' is no site number"), "count sites (face pairs) from 0")
    })?;
    let length = |text: &str| Quantity::Length.parse(flag, text);
    Ok((glam::DVec2::new(length(x)?, length(y)?), Quantity::Angle.parse(flag, angle)?, site))
}

/// Every test of an explanation, one a line.
pub(crate) fn print(out: &mut impl Write, explanation: &Explanation) -> anyhow::Result<()> {
    let o = explanation.part_from_grip.origin * 1e3;
    writeln!(
        out,
        "pose at ({:.3}, {:.3}, {:.3}) mm on face pair {}, width {:.3} mm",
        o.x,
        o.y,
        o.z,
        explanation.site,
        explanation.width * 1e3
    )?;
    for check in &explanation.checks {
        writeln!(
            out,
            "  {} {:28} {}",
            if check.passed { "ok  " } else { "FAIL" },
            check.name,
            check.detail
        )?;
    }
    match (&explanation.rejection, explanation.place) {
        (Some(reason), Some(at)) => writeln!(
            out,
            "rejected: {} at ({:.3}, {:.3}, {:.3}) mm",
            reason.name().replace('_', " "),
            at.x * 1e3,
            at.y * 1e3,
            at.z * 1e3
        )?,
        (Some(reason), None) => writeln!(out, "rejected: {}", reason.name().replace('_', " "))?,
        (None, _) => writeln!(out, "free of interference")?,
    }
    Ok(())
}

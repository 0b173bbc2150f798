//! `gripfast why`: why one pose is a grip, or is not.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args as ClapArgs;
use glam::{DMat3, DVec3};
use gripfast::error::{Error, Result};
use gripfast::export::Convention;
use gripfast::model::{Frame, Slip};
use gripfast::part::Part;
use gripfast::plan::{self, Assessed, Standing};
use gripfast::propose::{Explanation, Misfit};
use gripfast::request::Cone;
use gripfast::results::{ForceRange, GripSet, RankedGrip};
use gripfast::units::Quantity;

/// Explains one grip of a result file: every test with body and place, and what its score is made
/// of.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast why grips.json 962\n  gripfast why grips.json 962 --part bracket.stl\n\n\
For a pose that is not in the list use `gripfast plan .. --why X,Y,Z:APPROACH:CLOSING`."
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
        let remedy = match set.grips.iter().find(|ranked| ranked.rank == args.id) {
            Some(ranked) => format!("give the id: that of rank {} is {}", args.id, ranked.grip.id),
            None => {
                "see the ids in `gripfast plan`'s table, or explain a pose with `gripfast plan \
                     --why`"
                    .to_owned()
            }
        };
        return Err(
            Error::input(&file, format!("holds no grip with the id {}", args.id), remedy).into()
        );
    };
    let part = crate::export::read_part(&set, &args.grips, args.part.as_deref())?;
    let explanation = plan::explain(&set, ranked, &part)?;
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
    surface(&mut out, ranked)?;
    limits(&mut out, ranked, &set)?;
    Ok(ExitCode::SUCCESS)
}

/// What the pads touch of faces that are not plane.
fn surface(out: &mut impl Write, ranked: &RankedGrip) -> std::io::Result<()> {
    let mm = 1e3;
    for (name, face) in ["I", "II"].into_iter().zip(ranked.faces.iter().flatten()) {
        let [low, high] = face.extent;
        writeln!(
            out,
            "  face {name}: {:.2} mm2 pressed, {:.2} x {:.2} mm, pressure {:.3} MPa, up to {:.3} MPa, \
             layer compressed by {:.3} mm",
            face.area * mm * mm,
            (high[0] - low[0]) * mm,
            (high[1] - low[1]) * mm,
            face.mean_pressure * 1e-6,
            face.greatest_pressure * 1e-6,
            face.compression * mm
        )?;
    }
    if let Some(Slip::Spin { .. }) = ranked.worst.slip
        && ranked.slides()
    {
        writeln!(out, "  about to slide along the pads, all but without turning")?;
    } else if let Some(Slip::Spin { rolls_on, .. }) = ranked.worst.slip {
        let how = rolls_on.map_or("spins, both faces slip".to_owned(), |face| {
            format!("rolls on face {face:?} and slips on the other")
        });
        writeln!(out, "  about to turn about its own axis: it {how}")?;
    }
    let mut notes: Vec<String> = ranked.notes.iter().map(ToString::to_string).collect();
    // One that holds about two axes reads the same of both.
    notes.dedup();
    for note in notes {
        writeln!(out, "  note: {note}")?;
    }
    Ok(())
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

/// The pose that `plan --why` asks about.
pub(crate) enum Asked {
    /// Position and angle in the plane of a face pair.
    OnFaces {
        /// In the pair's plane \[m\].
        position: glam::DVec2,
        /// Approach angle \[rad\].
        angle: f64,
        /// The pair.
        pair: Pair,
    },
    /// The grip frame in the part frame.
    OnPart(Frame),
}

/// A face pair by its place in the list of `gripfast part`, or by the numbers of its faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pair {
    Number(usize),
    Faces(u32, u32),
}

impl Pair {
    /// The numbers of its faces.
    pub(crate) fn faces(self, part: &Part) -> Result<(u32, u32)> {
        let number = match self {
            Self::Faces(one, other) => return Ok((one, other)),
            Self::Number(number) => number,
        };
        let mut pairs = part.pairs(0.0, f64::INFINITY);
        pairs.extend(part.internal_pairs(0.0, f64::INFINITY));
        let pair = pairs.get(number).ok_or_else(|| {
            Error::input(
                "--why",
                format!("there is no pair {number}, the part has {}", pairs.len()),
                "count from 0 in the list of `gripfast part --internal`, or name the faces, e.g. 2|3",
            )
        })?;
        Ok((pair.face_i, pair.face_ii))
    }
}

/// The pose of `plan --why`: `3mm,-2mm,30deg,0` (X,Y,ANGLE,PAIR), `30mm,20mm,18mm:-z:+x` (place of
/// the grip's middle, approach and closing direction in the part frame) or
/// `30mm,20mm,18mm,0,0.7071,0,0.7071` (place and quaternion of the tool frame).
pub(crate) fn pose(text: &str) -> Result<Asked> {
    let flag = "--why";
    let remedy = "give X,Y,ANGLE,PAIR, e.g. 3mm,-2mm,30deg,0 (place and angle in the plane of a pair \
                  of `gripfast part`, or of faces: 2|3); or in part coordinates X,Y,Z:APPROACH:CLOSING, \
                  e.g. 30mm,20mm,18mm:-z:+x, or X,Y,Z,QX,QY,QZ,QW (tool frame with z approach, y closing)";
    let wrong = || Error::input(flag, format!("'{text}' is no pose"), remedy);
    let length = |text: &str| Quantity::Length.parse(flag, text);
    let place = |texts: &[&str]| -> Result<DVec3> {
        let [x, y, z] = texts else { return Err(wrong()) };
        Ok(DVec3::new(length(x)?, length(y)?, length(z)?))
    };
    let split = |text: &'_ str| -> Vec<String> {
        text.split(',').map(|piece| piece.trim().to_owned()).collect()
    };
    if let [origin, approach, closing] = text.split(':').collect::<Vec<_>>()[..] {
        let origin = split(origin);
        let origin = place(&origin.iter().map(String::as_str).collect::<Vec<_>>())?;
        // A cone's axis is written in the same way.
        let axis = |text: &str| format!("{text}:0deg").parse::<Cone>().map(|cone| cone.axis);
        let (approach, closing) = (axis(approach)?.normalize(), axis(closing)?);
        let Some(closing) = (closing - approach * approach.dot(closing)).try_normalize() else {
            return Err(Error::input(flag, "approach and closing direction are parallel", remedy));
        };
        let rotation = DMat3::from_cols(approach, closing.cross(approach), closing);
        return Ok(Asked::OnPart(Frame { rotation, origin }));
    }
    let pieces = split(text);
    let parts: Vec<&str> = pieces.iter().map(String::as_str).collect();
    match parts[..] {
        [x, y, angle, pair] => {
            let number = |text: &str| text.trim().parse::<u32>().map_err(|_| wrong());
            let pair = match pair.split_once(['|', '-', '/']) {
                Some((one, other)) => Pair::Faces(number(one)?, number(other)?),
                None => Pair::Number(number(pair)? as usize),
            };
            let position = glam::DVec2::new(length(x)?, length(y)?);
            Ok(Asked::OnFaces { position, angle: Quantity::Angle.parse(flag, angle)?, pair })
        }
        [x, y, z, ref quaternion @ ..] if quaternion.len() == 4 => {
            let mut xyzw = [0.0; 4];
            for (value, text) in xyzw.iter_mut().zip(quaternion) {
                *value = text.parse::<f64>().map_err(|_| wrong())?;
            }
            let turn = glam::DQuat::from_array(xyzw);
            if !matches!((turn.length() - 1.0).abs(), 0.0..=1e-3) {
                let problem = format!("a quaternion of length {}", turn.length());
                return Err(Error::input(flag, problem, "give a unit quaternion"));
            }
            let tool =
                Frame { rotation: DMat3::from_quat(turn.normalize()), origin: place(&[x, y, z])? };
            let axes = Convention::Standard.rotation(None)?;
            Ok(Asked::OnPart(
                tool.compose(&Frame { rotation: axes.transpose(), origin: DVec3::ZERO }),
            ))
        }
        _ => Err(wrong()),
    }
}

/// Every test of an explanation, one a line.
pub(crate) fn print(out: &mut impl Write, explanation: &Explanation) -> anyhow::Result<()> {
    let o = explanation.part_from_grip.origin * 1e3;
    writeln!(
        out,
        "pose at ({:.3}, {:.3}, {:.3}) mm on faces {} | {}, width {:.3} mm",
        o.x,
        o.y,
        o.z,
        explanation.face_i,
        explanation.face_ii,
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

/// How a pose fits faces, and where it stands among the grips found.
pub(crate) fn print_standing(
    out: &mut impl Write,
    assessed: &Assessed,
    standing: Option<(Standing, u64)>,
) -> anyhow::Result<()> {
    match &assessed.fit {
        Err(Misfit::Tilted(Some(angle))) => {
            writeln!(
                out,
                "grips no faces: the closing axis is {:.2} deg off the nearest normal of a pair within the stroke",
                angle.to_degrees()
            )?;
        }
        Err(Misfit::Beside) => {
            writeln!(out, "grips no faces: none stand between the opened pads there")?;
        }
        Err(_) => writeln!(out, "grips no faces: no pair lies within the stroke")?,
        Ok(fit) if fit.turned > 1e-6 || fit.shifted > 1e-6 => writeln!(
            out,
            "the pose was {:.3} mm along the closing axis and {:.3} deg off; closing jaws right it:",
            fit.shifted * 1e3,
            fit.turned.to_degrees()
        )?,
        Ok(_) => {}
    }
    if let Some(explanation) = &assessed.explanation {
        print(out, explanation)?;
    }
    if let Some(over) = &assessed.over {
        writeln!(out, "rejected: {}", over.replace('_', " "))?;
    }
    let Some(ranked) = &assessed.ranked else { return Ok(()) };
    let friction = match ranked.worst.mu_s {
        Some(mu_s) if ranked.worst.status.holds() => format!("mu_s {mu_s:.5}"),
        _ => format!("no friction holds it: {:?}", ranked.worst.status).to_lowercase(),
    };
    match standing {
        None => writeln!(out, "{friction}")?,
        Some((Standing::Found { rank, id }, all)) => {
            writeln!(out, "{friction}; rank {rank} of {all}, grip {id}")?;
        }
        Some((Standing::NotTried { rank, beyond, nearest }, all)) => {
            let more = if beyond { " or more, beyond the grips kept" } else { "" };
            writeln!(
                out,
                "{friction}; not among the {all} found: it would have rank {rank}{more}"
            )?;
            match nearest {
                Some((rank, id, apart)) => writeln!(
                    out,
                    "its place was not tried; the nearest grip on these faces, {id} of rank {rank}, lies {:.3} mm away (a finer grid tries more)",
                    apart * 1e3
                )?,
                None => writeln!(out, "no grip on these faces is among those kept")?,
            }
        }
        Some(_) => writeln!(out, "{friction}")?,
    }
    Ok(())
}

//! `gripfast solve`: one contact pair at a time, with everything visible.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args as ClapArgs, ValueEnum};
use gripfast::case::{self, Case};
use gripfast::contact::surface::Surfaces;
use gripfast::lab::{earlier, paper};
use gripfast::mechanics::{self, Options, Pads, curved, inverse};
use gripfast::model::{Score, Slip, Status};
use gripfast::report::contact_svg;
use gripfast::request::{Refiner, Separation};

/// Scores contact pairs: the smallest friction coefficient that holds each one's load.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast solve case.json\n  gripfast solve case.json --json\n  gripfast solve case.json --explain --pad-friction 0.5\n  gripfast solve case.json --plot case.svg\n  gripfast solve case.json --method paper --explain\n\n\
A case is {\"A_I\":[{\"outer\":[[x,y],..],\"holes\":[]}],\"A_II\":[..],\"d\":..,\"Fn\":..,\"F\":[..],\"M\":[..]} in metres and newtons,\n\
the load on the body about the point midway between the faces. A file may hold one case, a list, {\"cases\":[..]} or JSON Lines.\n\
Faces that are curved, drafted or stepped: docs/curved.md."
)]
pub(crate) struct Args {
    /// Case file; `-` for standard input.
    case: PathBuf,
    /// One JSON object per case on standard output.
    #[arg(long)]
    json: bool,
    /// Also the iterations, the certificate and what each number means.
    #[arg(long)]
    explain: bool,
    /// Also draws the contact pair as SVG: pads, pressure, separation line, slip centre, friction
    /// directions.
    #[arg(long, alias = "svg", value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Pads that separate under the load: solve with the contact left, or discard as the paper
    /// does.
    #[arg(long, value_parser = words!(Separation), default_value_t)]
    separation: Separation,
    /// Minimiser that polishes the solution.
    #[arg(long, value_parser = words!(Refiner), default_value_t)]
    refiner: Refiner,
    /// How to solve: our method, the paper's error function, or the earlier method with the slip
    /// centre at the centroid.
    #[arg(long, value_enum, default_value = "gripfast")]
    method: Method,
    /// Friction coefficient of the pads: also tells the force needed and the load multiple held.
    #[arg(long, value_name = "MU")]
    pad_friction: Option<f64>,
    /// Safety factor on the pad friction for the force needed.
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    safety: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Convex slip problem and coupled equilibrium, certified.
    Gripfast,
    /// E of equations (17)(18), minimised by Shanno's method from several starts, checked.
    Paper,
    /// Slip centre at the centroid, uniform pressure (the paper's section 2).
    Centroid,
}

/// Answers of the questions asked the other way round.
#[derive(serde::Serialize)]
struct Inverse {
    force_needed: Option<f64>,
    /// `None`: any multiple is held.
    load_multiple: Option<f64>,
}

#[derive(serde::Serialize)]
struct Answer<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<&'a str>,
    #[serde(flatten)]
    score: Score,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    inverse: Option<Inverse>,
}

/// The same for faces as they are.
#[derive(serde::Serialize)]
struct CurvedAnswer<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<&'a str>,
    #[serde(flatten)]
    answer: &'a curved::Answer,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    if let Some(mu) = args.pad_friction
        && !(mu.is_finite() && mu > 0.0)
    {
        anyhow::bail!("--pad-friction {mu}: give a positive number");
    }
    if !(args.safety.is_finite() && args.safety > 0.0) {
        anyhow::bail!("--safety {}: give a positive number", args.safety);
    }
    let options =
        Options { separation: args.separation, refiner: args.refiner, ..Options::default() };
    let mut out = crate::terminal::answer(args.json);
    let cases = case::read(&args.case)?;
    let mut any = false;
    for (index, case) in cases.iter().enumerate() {
        let place = || case.id.clone().unwrap_or_else(|| format!("case {}", index + 1));
        let (contact, distance, force, wrench) =
            (&case.contact, case.distance, case.force, &case.wrench);
        if let Some(surfaces) = &case.surfaces {
            let answer = curved_answer(&args, case, surfaces).map_err(|error| {
                anyhow::anyhow!("{}: {}: {error}", args.case.display(), place())
            })?;
            any |= answer.score.status.holds();
            if let Some(path) = &args.plot {
                plot(path, &place(), cases.len() > 1, case, &answer.score)?;
            }
            if args.json {
                let line = CurvedAnswer { id: case.id.as_deref(), answer: &answer };
                writeln!(out, "{}", serde_json::to_string(&line)?)?;
            } else {
                if cases.len() > 1 {
                    writeln!(out, "{}{}", if index > 0 { "\n" } else { "" }, place())?;
                }
                print_curved(&mut out, &answer, args.explain)?;
            }
            continue;
        }
        let answer = match args.method {
            Method::Gripfast => mechanics::solve(contact, distance, force, wrench, &options)
                .map(|score| (score, None)),
            Method::Paper => {
                let all_starts =
                    paper::Options { all_starts: args.explain, ..paper::Options::default() };
                paper::solve(contact, distance, force, wrench, &all_starts)
                    .map(|report| (report.score, Some(report)))
            }
            Method::Centroid => {
                earlier::solve(contact, distance, force, wrench).map(|score| (score, None))
            }
        };
        let (score, report) = answer
            .map_err(|error| anyhow::anyhow!("{}: {}: {error}", args.case.display(), place()))?;
        any |= score.status.holds();
        if let Some(path) = &args.plot {
            plot(path, &place(), cases.len() > 1, case, &score)?;
        }
        let inverse = args.pad_friction.and_then(|friction| {
            let pads = Pads::new(&case.contact)?;
            let multiple = inverse::load_multiple(
                &pads,
                case.distance,
                case.force,
                &case.wrench,
                friction,
                &options,
            );
            Some(Inverse {
                force_needed: inverse::force_needed(
                    &pads,
                    case.distance,
                    &case.wrench,
                    friction / args.safety,
                    &options,
                ),
                load_multiple: multiple.is_finite().then_some(multiple),
            })
        });
        if args.json {
            writeln!(
                out,
                "{}",
                serde_json::to_string(&Answer { id: case.id.as_deref(), score, inverse })?
            )?;
        } else {
            if cases.len() > 1 {
                writeln!(out, "{}{}", if index > 0 { "\n" } else { "" }, place())?;
            }
            print(&mut out, case, &score, inverse.as_ref(), &args)?;
            if let Some(report) = report.filter(|_| args.explain) {
                print_runs(&mut out, &report)?;
            }
        }
    }
    Ok(if any { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Draws one case; among several the name of each is added to the file's.
fn plot(path: &Path, name: &str, many: bool, case: &Case, score: &Score) -> anyhow::Result<()> {
    let path = if many {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        // A name from the file is no way to other folders.
        let name = gripfast::text::shown(name).replace(['/', '\\', ':'], "_");
        path.with_file_name(format!("{stem}-{name}.svg"))
    } else {
        path.to_path_buf()
    };
    let svg = contact_svg::draw(name, &case.contact, score);
    Ok(gripfast::file::write(&path, |writer| writer.write_all(svg.as_bytes()))?)
}

/// The answer for faces as they are.
fn curved_answer(args: &Args, case: &Case, surfaces: &Surfaces) -> anyhow::Result<curved::Answer> {
    let unknown = match args.method {
        Method::Gripfast => None,
        Method::Paper => Some("--method paper"),
        Method::Centroid => Some("--method centroid"),
    };
    if let Some(method) = unknown {
        anyhow::bail!(
            "{method} knows plane faces only, and this case gives its faces as they are: \
             leave --method out"
        );
    }
    if args.pad_friction.is_some() {
        anyhow::bail!(
            "--pad-friction asks for force and load multiple, which are known for plane faces \
             only: leave it out"
        );
    }
    Ok(curved::solve(surfaces, case.distance, case.force, &case.wrench)?)
}

/// The part of a curved answer that users read.
fn print_curved(
    out: &mut impl Write,
    answer: &curved::Answer,
    explain: bool,
) -> anyhow::Result<()> {
    let score = &answer.score;
    match score.mu_s {
        Some(mu) => {
            writeln!(
                out,
                "smallest friction coefficient that holds  {mu:.6}{}",
                note(score.status)
            )?;
        }
        None => writeln!(out, "no answer: {}", reason(score.status))?,
    }
    if let Some(slip) = score.slip {
        print_slip(out, as_good_as(slip, score))?;
    }
    let mm = 1e3;
    if let Some(faces) = answer.faces {
        for (name, face) in ["I", "II"].into_iter().zip(&faces) {
            let [low, high] = face.extent;
            writeln!(
                out,
                "contact on face {name:<3}                       {:.4} mm2, {:.3} mm along x1, \
                 {:.3} mm along x2",
                face.area * mm * mm,
                (high[0] - low[0]) * mm,
                (high[1] - low[1]) * mm
            )?;
            writeln!(
                out,
                "pressure on face {name:<3}                      mean {:.4} MPa, greatest {:.4} MPa",
                face.mean_pressure * 1e-6,
                face.greatest_pressure * 1e-6
            )?;
        }
        if explain {
            for (name, face) in ["I", "II"].into_iter().zip(&faces) {
                let [low, high] = face.extent;
                writeln!(
                    out,
                    "half width on face {name:<3}                    {:.6} mm across x1, \
                     compression at the origin {:.6} mm",
                    0.5 * (high[1] - low[1]) * mm,
                    face.delta * mm
                )?;
                writeln!(
                    out,
                    "load on face {name:<3}                          {:.4} N normal; by friction \
                     ({:.4}, {:.4}) N and {:.6} N m",
                    face.load,
                    face.share[0] + 0.0,
                    face.share[1] + 0.0,
                    face.share[2] + 0.0
                )?;
            }
        }
    }
    if let Some([a1, a2]) = answer.tilt.filter(|_| explain) {
        writeln!(
            out,
            "tilt of the part                          {a1:.3e} along x1, {a2:.3e} along x2 [rad]"
        )?;
    }
    for note in &answer.notes {
        writeln!(out, "note: {note}")?;
    }
    if explain {
        writeln!(
            out,
            "dimensions of the slip problem            {}{}",
            answer.dimensions,
            match answer.dimensions {
                4 => ": the part can spin about an axis in the pad plane",
                5 => ": the part can spin about any axis in the pad plane",
                _ => "",
            }
        )?;
        if let Some(bounds) = score.bounds {
            writeln!(
                out,
                "certificate for this pressure             {:.15} <= mu_s <= {:.15}",
                bounds.lower, bounds.upper
            )?;
        }
        writeln!(
            out,
            "largest residual of the tilt's equations  {:.2e}  (over Fn times the contact's size)",
            score.residual
        )?;
    }
    Ok(())
}

/// A turn about a centre beyond a million sizes of the contact is a slide: rounding alone turns it.
fn as_good_as(slip: Slip, score: &Score) -> Slip {
    let far = 1e6 * score.contact_area_i.max(score.contact_area_ii).sqrt();
    match slip {
        Slip::Rotation { c: [x, y], sense } if x.hypot(y) > far => {
            let (size, sense) = (x.hypot(y), f64::from(sense));
            Slip::Translation { direction: [sense * y / size, -sense * x / size] }
        }
        slip => slip,
    }
}

/// The incipient motion in words.
fn print_slip(out: &mut impl Write, slip: Slip) -> anyhow::Result<()> {
    let mm = 1e3;
    match slip {
        Slip::Rotation { c, sense } => {
            let turn = if sense > 0 { "counter-clockwise" } else { "clockwise" };
            // Rounded first: no negative zeros.
            let [x, y] = c.map(|value| (value * mm * 1e4).round() / 1e4 + 0.0);
            writeln!(
                out,
                "about to turn                             {turn} about ({x:.4}, {y:.4}) mm"
            )?;
        }
        Slip::Translation { direction } => writeln!(
            out,
            "about to slide                            along ({:.4}, {:.4})",
            direction[0], direction[1]
        )?,
        Slip::Spin { omega, velocity, rolls_on } => {
            let [o1, o2, o3] = omega.map(|value| (value * 1e4).round() / 1e4 + 0.0);
            let [u1, u2] = velocity.map(|value| (value * mm * 1e4).round() / 1e4 + 0.0);
            let how = match rolls_on {
                Some(face) => format!("rolls on face {face:?}"),
                None => "spins, both faces slip".into(),
            };
            writeln!(
                out,
                "about to spin                             {how}: omega ({o1:.4}, {o2:.4}, \
                 {o3:.4}) with ({u1:.4}, {u2:.4}) mm along the pads per rad"
            )?;
        }
        Slip::None => writeln!(
            out,
            "nothing slips                             the load has no part in the pad plane"
        )?,
    }
    Ok(())
}

fn print(
    out: &mut impl Write,
    case: &Case,
    score: &Score,
    inverse: Option<&Inverse>,
    args: &Args,
) -> anyhow::Result<()> {
    let mm = 1e3;
    match score.mu_s {
        Some(mu) => writeln!(
            out,
            "smallest friction coefficient that holds  {mu:.6}{}",
            note(score.status)
        )?,
        None => writeln!(out, "no answer: {}", reason(score.status))?,
    }
    if let Some(slip) = score.slip {
        print_slip(out, as_good_as(slip, score))?;
    }
    if let Some(p) = score.pressure {
        let per_mm = 1e-3;
        writeln!(
            out,
            "pressure on face I  [Pa, x in mm]         {:.6e} {:+.6e} x1 {:+.6e} x2",
            p.a_i0,
            p.a1 * per_mm,
            p.a2 * per_mm
        )?;
        writeln!(
            out,
            "pressure on face II [Pa, x in mm]         {:.6e} {:+.6e} x1 {:+.6e} x2",
            p.a_ii0,
            0.0 - p.a1 * per_mm,
            0.0 - p.a2 * per_mm
        )?;
        let area = |patch: &[gripfast::model::Polygon]| gripfast::geometry::patch_area(patch);
        let share = |left: f64, patch: &[gripfast::model::Polygon]| 100.0 * left / area(patch);
        writeln!(
            out,
            "contact left                              I {:.4} mm2 ({:.2} %), II {:.4} mm2 ({:.2} %)",
            score.contact_area_i * mm * mm,
            share(score.contact_area_i, &case.contact.face_i),
            score.contact_area_ii * mm * mm,
            share(score.contact_area_ii, &case.contact.face_ii)
        )?;
    }
    if let Some(inverse) = inverse {
        match inverse.force_needed {
            Some(force) => writeln!(
                out,
                "gripping force needed                     {force:.4} N (pad friction {}, safety {})",
                args.pad_friction.unwrap_or_default(),
                args.safety
            )?,
            None => writeln!(
                out,
                "gripping force needed                     none is enough at this pad friction"
            )?,
        }
        let multiple = inverse
            .load_multiple
            .map_or("any: there is no load".into(), |multiple| format!("{multiple:.4}"));
        writeln!(out, "load multiple held                        {multiple}")?;
    }
    if args.explain {
        let solver = match (args.method, args.refiner) {
            (Method::Paper, _) => "the paper's method, all starts",
            (Method::Centroid, _) => "centroid method",
            (_, Refiner::Newton) => "refiner newton",
            (_, Refiner::Shanno) => "refiner shanno",
        };
        if let Some(bounds) = score.bounds {
            writeln!(
                out,
                "certificate for this pressure             {:.15} <= mu_s <= {:.15}",
                bounds.lower, bounds.upper
            )?;
        }
        writeln!(
            out,
            "largest residual of the seven equations   {:.2e}  (forces over Fn, moments over Fn sqrt(A))",
            score.residual
        )?;
        writeln!(
            out,
            "evaluations of the integrals              {}  ({solver})",
            score.evaluations
        )?;
    }
    Ok(())
}

/// What each start of the paper's method came to.
fn print_runs(out: &mut impl Write, report: &paper::Report) -> anyhow::Result<()> {
    for (index, run) in report.runs.iter().enumerate() {
        let taken =
            if report.published == Some(index) { "  <- taken by the paper's rule" } else { "" };
        writeln!(
            out,
            "start {}: {:?}, mu {:.9}, E {:.1e}, residual {:.1e}, {} evaluations{taken}",
            index + 1,
            run.outcome,
            run.mu,
            run.error,
            run.residual,
            run.evaluations
        )?;
    }
    Ok(())
}

fn note(status: Status) -> &'static str {
    match status {
        Status::Ambiguous => {
            "   (ambiguous: another limit state exists; this is the one on the branch from d = 0, or the smallest)"
        }
        Status::Separating => "   (discarded: the pads separate)",
        Status::NotConverged => "   (NOT a solution: the seven equations do not hold)",
        _ => "",
    }
}

fn reason(status: Status) -> &'static str {
    match status {
        Status::TwistedOut => "no slip limit exists for this load: the contact twists out",
        Status::NoNormalForce => "the load pulls one pad off: |F3| is not below 2 Fn",
        Status::NoContact => "a contact area is empty",
        Status::NotConverged => "the method did not reach a solution of the seven equations",
        _ => "the solver found no solution",
    }
}

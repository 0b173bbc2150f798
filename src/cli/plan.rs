//! `gripfast plan`: from a part to ranked grips.

use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use clap::{Args as ClapArgs, ValueEnum};
use comfy_table::{CellAlignment, Table, presets};
use gripfast::backend::{Best, Polish, ScoreOptions};
use gripfast::error::{Error, Result};
use gripfast::gripper::{self, Gripper};
use gripfast::load::LoadSet;
use gripfast::model::{Slip, Status};
use gripfast::part::{MassProperties, Part, ReadOptions, Unit};
use gripfast::plan::{Assessor, Collector, Settings};
use gripfast::propose::{ProposeOptions, Proposer};
use gripfast::rank::{self, Weights};

use gripfast::report;
use gripfast::results::{self, GripSet, PartSummary, Provenance, RankedGrip, Summary};
use gripfast::units::Quantity;
use indicatif::{ProgressBar, ProgressStyle};

use super::backend::{self, BackendArgs};
use super::candidates::CandidateArgs;
use super::solve::{RefinerArg, SeparationArg};
use super::why;

/// Finds and ranks the grips on a part.
#[derive(Debug, ClapArgs)]
#[command(after_help = "EXAMPLES:\n  gripfast plan bracket.stl --gripper robotiq-2f85 --mass 350g\n  \
gripfast plan bracket.stl --gripper my-gripper.toml --density 2700kg/m3 --force 80N --accel 2g -o grips.json\n  \
gripfast plan bracket.stl --gripper franka-hand --mass 350g --loads ball:500 --top 20 --diverse --report bracket.html\n\n\
`gripfast gripper list` names the grippers that come with the program.")]
pub(crate) struct Args {
    /// Part file: STL, OBJ, PLY, ...
    part: PathBuf,
    /// Gripper from the catalogue, or a gripper file.
    #[arg(long, short)]
    gripper: String,
    /// Mass of the part, e.g. 350g.
    #[arg(long, conflicts_with = "density")]
    mass: Option<String>,
    /// Density of the part's material, e.g. 2700kg/m3.
    #[arg(long)]
    density: Option<String>,
    /// Gripping force, e.g. 80N [default: the gripper's largest].
    #[arg(long)]
    force: Option<String>,
    /// Unit of the part file's numbers [default: the file's own, else mm].
    #[arg(long)]
    unit: Option<Unit>,
    /// Acceleration in any direction on top of gravity, e.g. 2g.
    #[arg(long)]
    accel: Option<String>,
    /// Loads: gravity, gravity:-z, gravity:N, gravity-cone:-z:30deg, ball:N, ball:N:10N, FILE.csv, joined by commas.
    #[arg(long, default_value = "gravity")]
    loads: String,

    #[command(flatten, next_help_heading = "Candidates")]
    candidates: CandidateArgs,

    #[command(flatten, next_help_heading = "Scoring")]
    backend: BackendArgs,
    /// Weight of 1/mu_s in the score.
    #[arg(long, default_value_t = 1.0, help_heading = "Scoring")]
    k1: f64,
    /// Weight of alpha [1/rad] in the score.
    #[arg(long, default_value_t = 1.0, help_heading = "Scoring")]
    k2: f64,
    /// Friction coefficient of the pads, for safety and the force needed [default: the gripper's].
    #[arg(long, value_name = "MU", help_heading = "Scoring")]
    pad_friction: Option<f64>,
    /// Uncertainty of the part's position along the pads, for alpha.
    #[arg(long, default_value = "0mm", help_heading = "Scoring")]
    position_error: String,
    /// Pad friction while closing, for alpha.
    #[arg(long, default_value_t = 0.0, value_name = "MU", help_heading = "Scoring")]
    closing_friction: f64,
    /// Pads that separate under a load: solve with the contact left, or discard the grip as the paper does.
    #[arg(long, value_enum, default_value = "solve", help_heading = "Scoring")]
    separation: SeparationArg,
    /// What gets the final f64 solution: the loads that can be a grip's worst; the same, and only for grips that can be among the best ones kept; or all loads (kept in the result).
    #[arg(long, value_enum, default_value = "worst", help_heading = "Scoring")]
    polish: PolishArg,
    /// Minimiser that polishes the final answers.
    #[arg(long, value_enum, default_value = "newton", help_heading = "Scoring")]
    refiner: RefinerArg,
    /// Threads [default: all cores].
    #[arg(long, help_heading = "Scoring")]
    threads: Option<usize>,

    /// Grips to print.
    #[arg(long, default_value_t = 10, help_heading = "Output")]
    top: usize,
    /// Print grips that differ in place, face pair and approach.
    #[arg(long, help_heading = "Output")]
    diverse: bool,
    /// Best grips to keep in the result file [default: 10000; with --polish top as many as --top prints].
    #[arg(long, value_name = "N", help_heading = "Output")]
    keep: Option<usize>,
    /// Result file (JSON).
    #[arg(long, short, help_heading = "Output")]
    output: Option<PathBuf>,
    /// Self-contained page to look at.
    #[arg(long, value_name = "FILE.html", help_heading = "Output")]
    report: Option<PathBuf>,
    /// The result as JSON on standard output instead of the table.
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Explains one pose instead of planning: position and approach angle in the plane of a face pair, and its number.
    #[arg(long, value_name = "X,Y,ANGLE,SITE", allow_hyphen_values = true, help_heading = "Output")]
    why: Option<String>,
    /// No progress bar and no notes.
    #[arg(long, short, help_heading = "Output")]
    quiet: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PolishArg {
    Worst,
    Top,
    All,
}

/// Grips kept in the result file where `--keep` is not given.
const KEEP: usize = 10_000;

impl Args {
    /// How many of the best grips are kept. A choice of grips that differ needs more than it shows.
    fn kept(&self) -> usize {
        let few = self.polish == PolishArg::Top && !self.diverse;
        self.keep.unwrap_or(if few { 0 } else { KEEP }).max(self.top).max(1)
    }
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    backend::use_threads(args.threads)?;
    let note = |text: &str| {
        if !args.quiet {
            eprintln!("{text}");
        }
    };
    let gripper = gripper::find(&args.gripper)?;
    let propose = args.candidates.options()?;
    let force = match &args.force {
        Some(text) => Quantity::Force.parse("--force", text)?,
        None => gripper.force[1],
    };
    check_force(force, &gripper)?;
    let loads = LoadSet::parse("--loads", &args.loads)?;
    let loads = match &args.accel {
        Some(text) => loads.with_acceleration(Quantity::Acceleration.parse("--accel", text)?),
        None => loads,
    };
    let settings = Settings {
        force,
        weights: Weights { k1: finite("--k1", args.k1)?, k2: finite("--k2", args.k2)? },
        delta: Quantity::Length.parse("--position-error", &args.position_error)?,
        mu_c: not_negative("--closing-friction", args.closing_friction)?,
        pad_friction: args.pad_friction.map(|mu| not_negative("--pad-friction", mu)).transpose()?.or(gripper.pad_friction),
        score: ScoreOptions {
            polish: if args.polish == PolishArg::All { Polish::All } else { Polish::Worst },
            separation: args.separation.into(),
            refiner: args.refiner.into(),
        },
    };
    if args.polish == PolishArg::Top && settings.weights.k1 < 0.0 {
        return Err(Error::input("--polish top", "needs a score that falls with mu_s, and --k1 is negative", "use --polish worst").into());
    }
    let seeds = args.backend.seed_set()?;

    let part = Part::read(&args.part, &ReadOptions { unit: args.unit })?;
    for line in part.health.warnings.iter() {
        note(&format!("warning: {line}"));
    }
    if !part.health.watertight {
        note("warning: the surface is not watertight: volume, centre of mass and inertia are estimates (see `gripfast part`)");
    }
    let mass = mass(&args, &part)?;
    let cases = loads.cases(&mass)?;
    let selection = args.backend.select()?;
    note(&format!("backend {}", selection.reason));

    let mut proposer = Proposer::new(&part, &gripper, &propose)?;
    if let Some(text) = &args.why {
        let (position, angle, site) = why::pose(text)?;
        let explanation = proposer.explain(site, position, angle, false)?;
        why::print(&mut std::io::stdout().lock(), &explanation)?;
        return Ok(if explanation.rejection.is_none() { ExitCode::SUCCESS } else { ExitCode::from(1) });
    }
    let stop = stop_on_interrupt();
    let bar = progress(proposer.candidates(), args.quiet);
    let best = (args.polish == PolishArg::Top).then(|| Mutex::new(Best::new(args.kept())));
    let assessor = Assessor { loads: &cases, mass, settings: &settings, backend: &selection.backend, seeds: &seeds, best };
    let mut collector = Collector::default();
    let (mut complete, mut outranked) = (true, 0);
    for chunk in proposer.by_ref() {
        let proposed = chunk.grips.len();
        let assessed = assessor.assess(chunk.grips)?;
        outranked += (proposed - assessed.len()) as u64;
        collector.add(assessed, args.kept(), settings.weights);
        bar.inc(chunk.candidates);
        bar.set_message(format!("{} grips", collector.ranked()));
        if stop.load(Ordering::Relaxed) {
            complete = false;
            break;
        }
    }
    bar.finish_and_clear();
    if !complete {
        note("interrupted: the ranking covers the candidates looked at so far");
    }

    let (low, high) = part.mesh.bounding_box();
    let ranking = collector.finish(
        mass.centre_of_mass,
        (high - low).length(),
        &rank::Options { weights: settings.weights, keep_flips: args.candidates.flips(), top: Some(args.kept()), ..rank::Options::default() },
    );
    let mut rejections = proposer.tally().rejections.clone();
    for (reason, count) in &ranking.rejections {
        *rejections.entry(reason.clone()).or_default() += count;
    }
    if outranked > 0 {
        rejections.insert(OUTRANKED.to_owned(), outranked);
    }
    let mut grips = ranking.grips;
    assessor.finish(&mut grips);
    let set = GripSet {
        format: results::FORMAT.into(),
        version: results::VERSION,
        provenance: Provenance {
            gripfast: env!("CARGO_PKG_VERSION").into(),
            command: std::env::args().collect(),
            backend: selection.backend.name(),
            settings: describe(&settings, &args, &propose, &gripper, seeds.len(), complete),
        },
        part: PartSummary {
            file: args.part.display().to_string(),
            unit_m: part.unit_m,
            triangles: part.mesh.triangles.len(),
            bbox_min: low,
            bbox_max: high,
            mass,
        },
        gripper: serde_json::to_value(&gripper)?,
        loads: cases,
        summary: Summary { pairs: proposer.tally().pairs, candidates: proposer.tally().candidates, ranked: ranking.ranked, rejections },
        grips,
    };
    if let Some(path) = &args.output {
        set.write(path)?;
    }
    if let Some(path) = &args.report {
        report::write(&set, Some(&part.mesh), path)?;
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        set.write_json(&mut out)?;
        writeln!(out)?;
    } else {
        print(&mut out, &set, &args, &gripper, force)?;
    }
    for path in args.output.iter().chain(&args.report) {
        note(&format!("wrote {}", path.display()));
    }
    Ok(if set.grips.is_empty() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn finite(flag: &str, value: f64) -> Result<f64> {
    if value.is_finite() { Ok(value) } else { Err(Error::input(flag, format!("is {value}"), "give a finite number")) }
}

fn not_negative(flag: &str, value: f64) -> Result<f64> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(Error::input(flag, format!("is {value}"), "give a number, zero or more")) }
}

fn check_force(force: f64, gripper: &Gripper) -> Result<()> {
    let [least, most] = gripper.force;
    if force <= 0.0 {
        return Err(Error::input("--force", format!("is {force} N"), "give a force above zero"));
    }
    if force < least * (1.0 - 1e-9) || force > most * (1.0 + 1e-9) {
        return Err(Error::input("--force", format!("{force} N is outside what {} can do", gripper.name), format!("give {least} N to {most} N")));
    }
    Ok(())
}

/// Mass properties at the mass or density asked for.
fn mass(args: &Args, part: &Part) -> Result<MassProperties> {
    match (&args.mass, &args.density) {
        (Some(text), _) => {
            let mass = Quantity::Mass.parse("--mass", text)?;
            let unit = part.mass_properties(1.0);
            if mass <= 0.0 {
                return Err(Error::input("--mass", format!("is {mass} kg"), "give a mass above zero"));
            }
            if unit.volume.is_nan() || unit.volume <= 0.0 {
                return Err(Error::input(
                    part.file.display().to_string(),
                    "the surface encloses no volume",
                    "repair the mesh: without a volume there is no centre of mass",
                ));
            }
            Ok(part.mass_properties(mass / unit.volume))
        }
        (None, Some(text)) => Ok(part.mass_properties(Quantity::Density.parse("--density", text)?)),
        (None, None) if args.loads.split(',').all(|source| source.trim().starts_with("ball")) => Ok(part.mass_properties(1000.0)),
        (None, None) => Err(Error::input(
            "--mass",
            "the part's mass is not known",
            "give --mass 350g, or --density 2700kg/m3 (aluminium), 7850kg/m3 (steel), 1200kg/m3 (plastic)",
        )),
    }
}

/// Set when the user asks to stop: the run ends after the chunk in flight with what it has.
fn stop_on_interrupt() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    // A second handler in one process is refused; then an interrupt just ends the program, which is all right too.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    stop
}

/// A bar with rate and time left; hidden when asked for or when nobody watches.
fn progress(total: u64, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template("{bar:32} {human_pos}/{human_len} candidates  {per_sec}  {eta} left  {msg}") {
        bar.set_style(style);
    }
    bar
}

fn describe(
    settings: &Settings,
    args: &Args,
    propose: &ProposeOptions,
    gripper: &Gripper,
    seeds: usize,
    complete: bool,
) -> BTreeMap<String, serde_json::Value> {
    let mut all: BTreeMap<String, serde_json::Value> =
        CandidateArgs::settings(propose, gripper).into_iter().map(|(name, value)| (name.to_string(), value)).collect();
    all.extend([
        ("force_n".to_string(), settings.force.into()),
        ("k1".to_string(), settings.weights.k1.into()),
        ("k2".to_string(), settings.weights.k2.into()),
        ("position_error_m".to_string(), settings.delta.into()),
        ("closing_friction".to_string(), settings.mu_c.into()),
        ("pad_friction".to_string(), settings.pad_friction.into()),
        ("separation".to_string(), format!("{:?}", settings.score.separation).to_lowercase().into()),
        ("refiner".to_string(), format!("{:?}", settings.score.refiner).to_lowercase().into()),
        ("polish".to_string(), format!("{:?}", args.polish).to_lowercase().into()),
        ("seeds".to_string(), seeds.into()),
        ("complete".to_string(), complete.into()),
    ]);
    all
}

/// Among the rejections in the summary: grips left unsolved because they cannot be among the best ones asked for.
const OUTRANKED: &str = "outranked";

/// The table a user reads.
fn print(out: &mut impl Write, set: &GripSet, args: &Args, gripper: &Gripper, force: f64) -> anyhow::Result<()> {
    let mass = &set.part.mass;
    let size = (set.part.bbox_max - set.part.bbox_min) * 1e3;
    writeln!(
        out,
        "{}: {:.1} x {:.1} x {:.1} mm, {} triangles, {:.4} kg, centre of mass ({:.2}, {:.2}, {:.2}) mm",
        set.part.file,
        size.x,
        size.y,
        size.z,
        set.part.triangles,
        mass.mass,
        mass.centre_of_mass.x * 1e3,
        mass.centre_of_mass.y * 1e3,
        mass.centre_of_mass.z * 1e3
    )?;
    writeln!(
        out,
        "{} at {force} N, {} loads, {} face pairs, {} candidates, {} grips hold",
        gripper.name,
        set.loads.len(),
        set.summary.pairs,
        set.summary.candidates,
        set.summary.ranked
    )?;
    if let Some(outranked) = set.summary.rejections.get(OUTRANKED) {
        writeln!(out, "{outranked} more were not solved: their bounds put them behind the best {}", args.kept())?;
    }
    let mut reasons: Vec<_> = set.summary.rejections.iter().filter(|(reason, _)| *reason != OUTRANKED).collect();
    if !reasons.is_empty() {
        reasons.sort_by(|a, b| b.1.cmp(a.1));
        writeln!(out, "rejected: {}", reasons.iter().map(|(reason, count)| format!("{count} {}", reason.replace('_', " "))).collect::<Vec<_>>().join(", "))?;
    }
    if set.grips.is_empty() {
        writeln!(out, "\nno grip holds this part: see the reasons above")?;
        if set.summary.pairs == 0 {
            writeln!(out, "no two opposite planar faces lie within the stroke of {:.1} to {:.1} mm", gripper.stroke[0] * 1e3, gripper.stroke[1] * 1e3)?;
        }
        return Ok(());
    }
    let diagonal = (set.part.bbox_max - set.part.bbox_min).length();
    let shown: Vec<&RankedGrip> = if args.diverse { rank::choose_diverse(&set.grips, args.top, diagonal) } else { set.grips.iter().take(args.top).collect() };
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(["rank", "id", "mu_s", "safety", "force needed", "worst load", "slip centre mm", "contact", "alpha", "score", "width mm", "position mm"]);
    for grip in shown {
        table.add_row(row(grip, set));
    }
    for column in [0, 1, 2, 3, 4, 7, 8, 9, 10] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    writeln!(out, "\n{table}")?;
    writeln!(
        out,
        "\nmu_s: smallest friction coefficient that holds the worst load. Slip centre from the grip's middle in the pad plane.\nPosition of the grip's middle in the part frame."
    )?;
    Ok(())
}

fn row(grip: &RankedGrip, set: &GripSet) -> Vec<String> {
    let worst = &grip.worst;
    let option = |value: Option<f64>, digits: usize| value.map_or_else(|| "-".to_string(), |value| format!("{value:.digits$}"));
    let slip = match worst.slip {
        Some(Slip::Rotation { c, .. }) => tuple(&[c[0] * 1e3, c[1] * 1e3]),
        Some(Slip::Translation { .. }) => "slides".into(),
        _ => "-".into(),
    };
    let o = grip.grip.part_from_grip.origin * 1e3;
    let mark = if worst.status == Status::Ambiguous { "?" } else { "" };
    vec![
        grip.rank.to_string(),
        grip.grip.id.to_string(),
        format!("{}{mark}", option(worst.mu_s, 5)),
        option(grip.safety, 2),
        grip.force_needed.map_or_else(|| "-".into(), |force| format!("{force:.2} N")),
        set.loads[worst.load as usize].name.clone(),
        slip,
        format!("{:.0} %", grip.contact_share * 100.0),
        format!("{:.1} deg", grip.alpha.to_degrees()),
        option(grip.score, 3),
        format!("{:.2}", grip.grip.width * 1e3),
        tuple(&o.to_array()),
    ]
}

/// Numbers to two places in brackets, without negative zeros.
fn tuple(numbers: &[f64]) -> String {
    let text = numbers.iter().map(|x| format!("{x:.2}")).map(|x| if x == "-0.00" { "0.00".into() } else { x }).collect::<Vec<_>>();
    format!("({})", text.join(", "))
}

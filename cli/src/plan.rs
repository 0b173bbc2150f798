//! `gripfast plan`: from a part to ranked grips.

mod flags;
mod search;
mod table;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args as ClapArgs;
use gripfast::backend::ScoreOptions;
use gripfast::error::Error;
use gripfast::export::{self, Format};
use gripfast::gripper::{self, Jaws};
use gripfast::lab::compare;
use gripfast::load::LoadSet;
use gripfast::part::{Part, ReadOptions, Unit};
use gripfast::plan::{Assessor, Settings, checkpoint};
use gripfast::propose::Proposer;
use gripfast::rank::{self, Weights};

use gripfast::report;
use gripfast::request::{Polish, Refiner, Separation};
use gripfast::results::{self, GripSet, PartSummary, Provenance, RankedGrip, Summary};
use gripfast::units::Quantity;

use super::backend::{self, BackendArgs};
use super::candidates::CandidateArgs;
use super::export::GLB_TOP;
use super::report::WHOLE;
use super::why;
use flags::{check_force, finite, not_negative};
use search::{Partial, Search};

/// Finds and ranks the grips on a part.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast plan bracket.stl --gripper robotiq-2f85 --mass 350g\n  \
gripfast plan bracket.stl --gripper my-gripper.toml --density 2700kg/m3 --force 80N --accel 2g -o grips.json\n  \
gripfast plan bracket.stl --gripper franka-hand --mass 350g --loads ball:500 --top 20 --diverse --report bracket.html\n  \
gripfast plan bracket.stl --gripper franka-hand --mass 350g --pose-noise 1mm,2deg --compare\n  \
gripfast plan housing.stl --gripper wsg50-110 --mass 2kg --spacing 0.5mm --loads ball:500 -o housing.parquet --resume\n  \
for part in *.stl; do gripfast plan \"$part\" --gripper generic --density 2700kg/m3 -q -o \"${part%.stl}.json\" >\"${part%.stl}.txt\"; done\n\n\
A run with -o keeps its state in FILE.partial and removes it at the end: after an interrupt, a kill or a power cut the same \
command with --resume goes on from there, to the same result.\n\n\
`gripfast gripper list` names the grippers that come with the program."
)]
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
    /// Loads: gravity, gravity:-z, gravity:N, gravity-cone:-z:30deg, ball:N, ball:N:10N, FILE.csv,
    /// joined by commas.
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
    /// Friction coefficient of the pads [default: the gripper's], for the safety, the force needed
    /// and the multiple of the worst load, all of it with its moments, that is held. Another load
    /// may end at a smaller multiple, where it twists the contact out.
    #[arg(long, value_name = "MU", help_heading = "Scoring")]
    pad_friction: Option<f64>,
    /// Uncertainty of the part's position along the pads, for alpha.
    #[arg(long, default_value = "0mm", help_heading = "Scoring")]
    position_error: String,
    /// Pad friction while closing, for alpha.
    #[arg(long, default_value_t = 0.0, value_name = "MU", help_heading = "Scoring")]
    closing_friction: f64,
    /// Pads that separate under a load: solve with the contact left, or discard the grip as the
    /// paper does.
    #[arg(long, value_parser = words!(Separation), default_value_t, help_heading = "Scoring")]
    separation: Separation,
    /// What gets the final f64 solution: the loads that can be a grip's worst; the same, and only
    /// for grips that can be among the best ones kept; or all loads (kept in the result).
    #[arg(long, value_parser = words!(Polish), default_value_t, help_heading = "Scoring")]
    polish: Polish,
    /// Minimiser that polishes the final answers.
    #[arg(long, value_parser = words!(Refiner), default_value_t, help_heading = "Scoring")]
    refiner: Refiner,
    /// Threads [default: all cores].
    #[arg(long, help_heading = "Scoring")]
    threads: Option<usize>,

    /// Grips to print.
    #[arg(long, default_value_t = 10, help_heading = "Output")]
    top: usize,
    /// Print grips that differ in place, face pair and approach.
    #[arg(long, help_heading = "Output")]
    diverse: bool,
    /// Lists one of the grips that a symmetry of the part maps to each other, for all of them.
    #[arg(long, help_heading = "Output")]
    merge_symmetric: bool,
    /// Best grips to keep in the result file [default: 10000; with --polish top as many as --top
    /// prints].
    #[arg(long, value_name = "N", help_heading = "Output")]
    keep: Option<usize>,
    /// Result file; its ending says the format: .json (read by the other subcommands), .jsonl,
    /// .csv, .parquet, .npz, ... as `export`.
    #[arg(long, short, value_name = "FILE", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Self-contained page to look at; for its picture of the friction over all loads these are
    /// solved for the best 20 grips and the first 20 printed (and kept in the result file).
    #[arg(long, value_name = "FILE.html", help_heading = "Output")]
    report: Option<PathBuf>,
    /// The result as JSON on standard output instead of the table.
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Explains one pose instead of planning: position and approach angle in the plane of a face
    /// pair, and its number.
    #[arg(
        long,
        value_name = "X,Y,ANGLE,SITE",
        allow_hyphen_values = true,
        help_heading = "Output"
    )]
    why: Option<String>,
    /// Goes on with the unfinished run whose state lies beside the result file; starts anew when
    /// there is none.
    #[arg(long, requires = "output", help_heading = "Long runs")]
    resume: bool,
    /// Time between two states written to FILE.partial; 0s: after every chunk.
    #[arg(long, value_name = "TIME", default_value = "30s", help_heading = "Long runs")]
    checkpoint: String,

    /// Tries each printed grip at poses off by up to this along both axes of the pad plane and
    /// about the closing axis, e.g. 1mm,2deg: mu_s that 95 % of them hold with, the worst, and how
    /// many are lost (no contact, twisted out). Interference is not tested again.
    #[arg(long, value_name = "LENGTH,ANGLE", help_heading = "More about each grip")]
    pose_noise: Option<String>,
    /// Displaced poses per grip for --pose-noise, spread evenly.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 64,
        requires = "pose_noise",
        help_heading = "More about each grip"
    )]
    noise_samples: u32,
    /// Beside the score the evaluation function of the earlier method, (K1 Delta_d + K2 tau_s/(mu_s
    /// N))/(D + EPSILON) + K3 alpha [default: 1,1,1,1mm], for all grips kept; rank correlation, and
    /// the grips whose place differs most.
    #[arg(long, value_name = "K1,K2,K3,EPSILON", num_args = 0..=1, require_equals = true, default_missing_value = "", help_heading = "More about each grip")]
    compare: Option<String>,

    /// No progress bar and no notes.
    #[arg(long, short, help_heading = "Output")]
    quiet: bool,
}

/// Grips kept in the result file where `--keep` is not given.
const KEEP: usize = 10_000;

impl Args {
    /// How many of the best grips are kept. A choice of grips that differ needs more than it shows,
    /// and so does a list in which one stands for many.
    fn kept(&self) -> usize {
        let few = self.polish == Polish::Top && !self.diverse && !self.merge_symmetric;
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
        pad_friction: args
            .pad_friction
            .map(|mu| not_negative("--pad-friction", mu))
            .transpose()?
            .or(gripper.pad_friction),
        score: ScoreOptions {
            // The other loads of grips that are kept come after the ranking.
            polish: Polish::Worst,
            separation: args.separation,
            refiner: args.refiner,
        },
    };
    if args.polish == Polish::Top && settings.weights.k1 < 0.0 {
        return Err(Error::input(
            "--polish top",
            "needs a score that falls with mu_s, and --k1 is negative",
            "use --polish worst",
        )
        .into());
    }
    let seeds = args.backend.seed_set()?;
    let format = args.output.as_deref().map(flags::output_format).transpose()?;
    let noise = flags::noise(&args)?;
    let earlier = args.compare.as_deref().map(flags::earlier_weights).transpose()?;
    let every = flags::interval(&args.checkpoint)?;

    let part = Part::read(&args.part, &ReadOptions { unit: args.unit, ..Default::default() })?;
    for line in part.health.warnings.iter() {
        note(&format!("warning: {}", crate::flags::warning(line)));
    }
    if !part.health.watertight {
        note(
            "warning: the surface is not watertight: volume, centre of mass and inertia are estimates (see `gripfast part`)",
        );
    }
    let mass = flags::mass(&args, &part)?;
    let cases = loads.cases(&mass)?;
    let selection = args.backend.select()?;
    note(&format!("backend {}", selection.reason));

    let mut proposer = Proposer::new(&part, &gripper, &propose)?;
    if let Some(text) = &args.why {
        let (position, angle, site) = why::pose(text)?;
        let explanation = proposer.explain(site, position, angle, Jaws::Straight)?;
        why::print(&mut std::io::stdout().lock(), &explanation)?;
        return Ok(if explanation.rejection.is_none() {
            ExitCode::SUCCESS
        } else {
            ExitCode::from(1)
        });
    }
    let keep = args.kept();
    let assessor = Assessor {
        loads: &cases,
        mass,
        settings: &settings,
        backend: &selection.backend,
        seeds: &seeds,
    };
    let mut described = describe(&settings, &args, seeds.len());
    described.insert("keep".into(), keep.into());
    let partial = args.output.as_deref().and_then(Partial::beside).map(|path| Partial {
        path,
        every,
        inputs: checkpoint::inputs(&part, &mass, &gripper, &cases, &propose, described.clone()),
    });
    if args.resume && partial.is_none() {
        return Err(Error::input(
            "--resume",
            "the result does not go to a regular file",
            "give a file after -o",
        )
        .into());
    }
    let found = Search {
        assessor: &assessor,
        keep,
        race: args.polish == Polish::Top,
        partial: partial.as_ref(),
        quiet: args.quiet,
    }
    .run(&mut proposer, args.resume)?;

    let (low, high) = part.mesh.bounding_box();
    let ranking = found.collector.finish(
        mass.centre_of_mass,
        (high - low).length(),
        &rank::Options {
            weights: settings.weights,
            keep_flips: args.candidates.flips(),
            merge_duplicates: args.merge_symmetric,
            top: Some(keep),
            ..rank::Options::default()
        },
    );
    let mut rejections = proposer.tally().rejections.clone();
    for (reason, count) in &ranking.rejections {
        *rejections.entry(reason.clone()).or_default() += count;
    }
    let mut grips = ranking.grips;
    assessor.finish(&mut grips);
    let comparison =
        earlier.map(|weights| compare::compare(&mut grips, mass.centre_of_mass, force, &weights));
    let shown: Vec<u64> = if args.diverse {
        rank::choose_diverse(&grips, args.top, (high - low).length())
            .into_iter()
            .map(|ranked| ranked.grip.id)
            .collect()
    } else {
        grips.iter().take(args.top).map(|ranked| ranked.grip.id).collect()
    };
    if let Some(noise) = noise {
        let mut chosen: Vec<&mut RankedGrip> =
            grips.iter_mut().filter(|ranked| shown.contains(&ranked.grip.id)).collect();
        noise.assess(&proposer, &assessor, &mut chosen)?;
        described.extend([
            ("pose_noise_m".into(), noise.shift.into()),
            ("pose_noise_rad".into(), noise.turn.into()),
            ("noise_samples".into(), noise.samples.into()),
        ]);
    }
    let every = args.polish == Polish::All;
    if every || args.report.is_some() {
        let printed = &shown[..shown.len().min(WHOLE)];
        let chosen = grips
            .iter_mut()
            .enumerate()
            .filter(|(place, ranked)| every || *place < WHOLE || printed.contains(&ranked.grip.id));
        assessor.solve_every_load(
            &mut chosen.map(|(_, ranked)| ranked).collect::<Vec<&mut RankedGrip>>(),
        )?;
    }
    described.extend(
        CandidateArgs::settings(&propose, &gripper)
            .into_iter()
            .map(|(name, value)| (name.to_owned(), value)),
    );
    described.insert("complete".into(), found.complete.into());
    let set = GripSet {
        format: results::FORMAT.into(),
        version: results::VERSION,
        provenance: Provenance {
            gripfast: env!("CARGO_PKG_VERSION").into(),
            command: std::env::args().collect(),
            backend: found.backend,
            settings: described,
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
        summary: Summary {
            pairs: proposer.tally().pairs,
            candidates: proposer.tally().candidates,
            ranked: ranking.ranked,
            rejections,
            comparison,
        },
        grips,
    };
    if let (Some(path), Some(format)) = (&args.output, format) {
        match format {
            Format::Json => set.write(path)?,
            Format::JsonLines => set.write_lines(path)?,
            _ => {
                let options = export::Options {
                    top: (format == Format::Glb).then_some(GLB_TOP),
                    pad_friction: settings.pad_friction,
                    ..export::Options::default()
                };
                export::write(&set, format, path, &options, Some(&part.mesh))?;
            }
        }
    }
    if let Some(partial) = partial.filter(|_| found.complete) {
        partial.remove()?;
    }
    if let Some(path) = &args.report {
        report::write(&set, Some(&part.mesh), path)?;
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        set.write_json(&mut out)?;
        writeln!(out)?;
    } else {
        let shown: Vec<&RankedGrip> =
            set.grips.iter().filter(|ranked| shown.contains(&ranked.grip.id)).collect();
        table::print(&mut out, &set, &shown, &gripper, force)?;
    }
    for path in args.output.iter().chain(&args.report) {
        note(&format!("wrote {}", path.display()));
    }
    Ok(if set.grips.is_empty() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// The settings that decide the answer, but for the candidates'.
fn describe(settings: &Settings, args: &Args, seeds: usize) -> BTreeMap<String, serde_json::Value> {
    BTreeMap::from([
        ("force_n".to_string(), settings.force.into()),
        ("k1".to_string(), settings.weights.k1.into()),
        ("k2".to_string(), settings.weights.k2.into()),
        ("position_error_m".to_string(), settings.delta.into()),
        ("closing_friction".to_string(), settings.mu_c.into()),
        ("pad_friction".to_string(), settings.pad_friction.into()),
        (
            "separation".to_string(),
            format!("{:?}", settings.score.separation).to_lowercase().into(),
        ),
        ("refiner".to_string(), format!("{:?}", settings.score.refiner).to_lowercase().into()),
        ("polish".to_string(), format!("{:?}", args.polish).to_lowercase().into()),
        ("seeds".to_string(), seeds.into()),
    ])
}

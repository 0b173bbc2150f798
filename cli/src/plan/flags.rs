//! The flags of `plan`: one for each field of a [`Request`], of the same name.

use std::path::PathBuf;

use clap::{Args as ClapArgs, Command};
use gripfast::error::Error;
use gripfast::request::{
    Choice, Cone, EarlierWeights, Ground, InertiaMatrix, Polish, PoseError, Position, Refiner,
    Region, Request, Separation, Side,
};
use gripfast::units::{
    Acceleration, Angle, Density, Force, Length, Mass, Memory, Pressure, Time, Unit,
};
use serde_json::{Map, Value};

use super::several::{self, Variant};

/// Finds and ranks the grips (grasps) on a part.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast plan bracket.stl --gripper robotiq-2f85 --mass 350g\n  \
gripfast plan bracket.stl --gripper my-gripper.toml --density 2700kg/m3 --force 80N --accel 2g -o grips.json\n  \
gripfast plan bracket.stl --gripper franka-hand --mass 350g --loads ball:500 --top 20 --diverse --report bracket.html\n  \
gripfast plan bracket.stl --gripper franka-hand --mass 350g --pose-noise 1mm,2deg --compare\n  \
gripfast plan bracket.stl -g robotiq-2f85 -g onrobot-rg2 --mass 350g --safety 2 -o grips.json\n  \
gripfast plan bracket.stl -g robotiq-2f85 --force 40N --force 80N --pad-friction 0.3 --pad-friction 0.5 --mass 350g\n  \
gripfast plan housing.stl --gripper wsg50-110 --mass 2kg --spacing 0.5mm --loads ball:500 -o housing.parquet --resume\n  \
gripfast plan bracket.stl --gripper generic --mass 350g --print-request > bracket.toml; gripfast plan --request bracket.toml --force 40N\n  \
for part in *.stl; do gripfast plan \"$part\" --gripper generic --density 2700kg/m3 -q -o \"${part%.stl}.json\" >\"${part%.stl}.txt\"; done\n\n\
A run with -o keeps its state in FILE.partial and removes it at the end: after an interrupt, a kill or a power cut the same \
command with --resume resumes it and comes to the same result.\n\n\
`gripfast gripper list` names the grippers that come with the program."
)]
pub(crate) struct Args {
    /// Part file: STL, OBJ, PLY, ...
    #[arg(required_unless_present = "request")]
    part: Option<PathBuf>,
    /// Gripper from the catalogue, or a gripper file. Given several times, each is planned with and
    /// shown beside the others.
    #[arg(long, short, required_unless_present = "request")]
    gripper: Vec<String>,
    /// Loads: gravity, gravity:-z, gravity:N, gravity-cone:-z:30deg, ball:N, ball:N:10N, FILE.csv,
    /// joined by commas.
    #[arg(long)]
    loads: Option<String>,
    /// A stored request (TOML, or JSON where the name ends in .json); flags beside it override it.
    #[arg(long, value_name = "FILE")]
    request: Option<PathBuf>,
    /// Prints the request that these flags make, as TOML, and ends.
    #[arg(long)]
    pub(super) print_request: bool,

    #[command(flatten)]
    job: JobArgs,
    #[command(flatten, next_help_heading = "Output")]
    output: OutputArgs,
    #[command(flatten, next_help_heading = "Long runs")]
    long: LongArgs,
}

/// The flags of a job, whatever its part, gripper and loads are.
#[derive(Debug, ClapArgs)]
pub(crate) struct JobArgs {
    /// Mass of the part, e.g. 350g. `plan` compares several, each given with its own --mass.
    #[arg(long, conflicts_with = "density")]
    mass: Vec<Mass>,
    /// Density of the part's material, e.g. 2700kg/m3.
    #[arg(long)]
    density: Option<Density>,
    /// Centre of mass in the part frame, for an assembly, e.g. 10mm,0mm,5mm [default: that of a
    /// uniform solid].
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    com: Option<Position>,
    /// Inertia about the centre of mass, for an assembly: XX,YY,ZZ,XY,YZ,ZX (elements of the matrix)
    /// in kgm2, kgmm2, gcm2 or gmm2 [default: that of a uniform solid]. Trajectories use it.
    #[arg(long, value_name = "INERTIA", allow_hyphen_values = true)]
    inertia: Option<InertiaMatrix>,
    /// Gripping force of one jaw, not the sum of both, e.g. 80N [default: the gripper's largest].
    /// `plan` compares several, each given with its own --force.
    #[arg(long)]
    force: Vec<Force>,
    /// Unit of the part file's numbers [default: the file's own, else mm].
    #[arg(long)]
    unit: Option<Unit>,
    /// Most memory that reading the part may take, e.g. 2GB [default: half of the machine's].
    #[arg(long, value_name = "SIZE")]
    max_memory: Option<Memory>,
    /// A glTF file may name buffers outside of its own folder.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    outside_buffers: Option<bool>,
    /// Every facet of the part is meant as a plane: none is taken for a curved face.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    faceted: Option<bool>,
    /// For noisy and scanned parts: fits planes and round faces to corners within this distance, some
    /// three times the noise, e.g. 0.2mm.
    #[arg(long, value_name = "LENGTH")]
    fit: Option<Length>,
    /// Acceleration in any direction on top of gravity, e.g. 2g.
    #[arg(long)]
    accel: Option<Acceleration>,

    #[command(flatten, next_help_heading = "Candidates")]
    candidates: CandidateArgs,
    #[command(flatten, next_help_heading = "Scoring")]
    scoring: ScoringArgs,
    #[command(flatten, next_help_heading = "Choice")]
    choice: ChoiceArgs,
    #[command(flatten, next_help_heading = "More about each grip")]
    more: MoreArgs,
}

#[derive(Debug, ClapArgs)]
struct CandidateArgs {
    /// Step of the position grid [default: a fifth of the pad's shorter side].
    #[arg(long, value_name = "LENGTH")]
    spacing: Option<Length>,
    /// Step of the approach angle.
    #[arg(long, value_name = "ANGLE")]
    angle_step: Option<Angle>,
    /// Approach along and across the edges of the gripped faces as well.
    #[arg(long, value_name = "true|false", hide_possible_values = true)]
    edge_angles: Option<bool>,
    /// Closes on curved faces, and on opposite planes that are not parallel, as well. Such a grip
    /// takes longer than one between parallel planes [default: where no candidate between such
    /// planes is free of interference, or where that makes no more than 20000 candidates].
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    curved: Option<bool>,
    /// Smallest contact area on either face, as a share of the most that the face pair allows (pad
    /// or overlap).
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_contact: Option<f64>,
    /// Smallest contact area on either face, as a share of the pad's area.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_pad_share: Option<f64>,
    /// Largest distance of the grip from the centre of mass.
    #[arg(long, value_name = "LENGTH")]
    max_offset: Option<Length>,
    /// Only approaches within a cone, e.g. -z:45deg or 0/0/-1:45deg (part frame).
    #[arg(long, value_name = "DIR:ANGLE", allow_hyphen_values = true)]
    approach: Option<Cone>,
    /// The gripper must stay above this plane, e.g. +z:0mm (normal and height, part frame).
    #[arg(long, value_name = "DIR:HEIGHT", allow_hyphen_values = true)]
    ground: Option<Ground>,
    /// Box that the gripper must not enter: x,y,z:x,y,z with units, e.g. 0mm,0mm,0mm:10mm,20mm,5mm;
    /// may be repeated.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    keep_out: Vec<Region>,
    /// Scene file: obstacles in the world's or the part's frame, the part's pose, limits of the
    /// robot; the one that `gripfast pick` reads.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Only these faces, plane and curved ones, e.g. 0,1,4 (see `gripfast part`).
    #[arg(long, value_delimiter = ',', value_name = "FACES")]
    faces: Option<Vec<u32>>,
    /// Only planar faces that lie wholly in this box, and those of --faces: x,y,z:x,y,z with units;
    /// may be repeated.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    faces_in: Vec<Region>,
    /// Grips that close on the part from outside, that open in a slot or bore (needs a gripper with
    /// outer pads), or both.
    #[arg(long, value_parser = words!(Side), value_name = "SIDE")]
    grips: Option<Side>,
    /// List each grip with exchanged jaws as well.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    flips: Option<bool>,
    /// Way by which each jaw opens beyond contact for the approach.
    #[arg(long, value_name = "LENGTH")]
    opening: Option<Length>,
    /// Way by which each jaw must at least be able to open; else a face pair is outside the stroke.
    #[arg(long, value_name = "LENGTH")]
    min_opening: Option<Length>,
    /// Distance kept between gripper and part, but for the pads.
    #[arg(long, value_name = "LENGTH")]
    clearance: Option<Length>,
    /// Length of the straight approach that must be clear of ground and keep-out boxes; of the part
    /// it is clear all the way.
    #[arg(long, value_name = "LENGTH")]
    approach_distance: Option<Length>,
}

#[derive(Debug, ClapArgs)]
struct ScoringArgs {
    /// Where slip twists are searched: auto, cpu or gpu. gpu without a graphics processor is an
    /// error; the answers agree to 1e-9, in the same order.
    #[arg(long, value_parser = words!(Choice), value_name = "auto|cpu|gpu", hide_possible_values = true)]
    backend: Option<Choice>,
    /// Graphics adapter, by its number or part of its name as `gripfast devices` lists them
    /// [default: GRIPFAST_ADAPTER].
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// Slip twists tried for each load before the exact solver, at least.
    #[arg(long, value_name = "N")]
    seeds: Option<usize>,
    /// Weight of 1/mu_s in the score.
    #[arg(long)]
    k1: Option<f64>,
    /// Weight of alpha [1/rad] in the score.
    #[arg(long)]
    k2: Option<f64>,
    /// Friction coefficient of the pads [default: the gripper's], for what holds, the force needed
    /// and the multiple of all loads, with their moments, that is held. `plan` compares several, each
    /// given with its own --pad-friction.
    #[arg(long, value_name = "MU")]
    pad_friction: Vec<f64>,
    /// Safety factor: a grip holds where mu_s times this is at most the pads' friction.
    #[arg(long, value_name = "FACTOR")]
    safety: Option<f64>,
    /// Greatest pressure that does not mark the part, e.g. 2MPa: grips whose squeeze alone, without
    /// a load, presses harder anywhere on either face are rejected. On plane faces it is that of
    /// rigid pads, on curved and drafted ones that of the pads' layers.
    #[arg(long, value_name = "PRESSURE")]
    max_pressure: Option<Pressure>,
    /// Uncertainty of the part's position along the pads, for alpha.
    #[arg(long, value_name = "LENGTH")]
    position_error: Option<Length>,
    /// Pad friction while closing, for alpha.
    #[arg(long, value_name = "MU")]
    closing_friction: Option<f64>,
    /// Pads that separate under a load: solve with the contact that remains, or discard the grip as
    /// the paper does.
    #[arg(long, value_parser = words!(Separation))]
    separation: Option<Separation>,
    /// What gets the final f64 solution: the loads that can be a grip's worst; the same, and only
    /// for grips that can be among the best ones kept; or all loads (kept in the result). Auto: top
    /// where the table is all that is asked for, else worst.
    #[arg(long, value_parser = words!(Polish))]
    polish: Option<Polish>,
    /// Minimiser that polishes the final answers.
    #[arg(long, value_parser = words!(Refiner))]
    refiner: Option<Refiner>,
    /// Threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
}

#[derive(Debug, ClapArgs)]
struct ChoiceArgs {
    /// Choose grips that differ in place, face pair and approach.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    diverse: Option<bool>,
    /// Lists one of the grips that a symmetry of the part maps to each other, for all of them.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    merge_symmetric: Option<bool>,
    /// Prints also grips that a turn about the axis of a round part maps to one printed.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    every_turn: Option<bool>,
    /// Only the candidates with these ids, e.g. 3,17 from an earlier table of the same search. On curved
    /// faces another force makes another search: what is pressed there depends on it.
    #[arg(long, value_delimiter = ',', value_name = "IDS", value_parser = id)]
    ids: Option<Vec<u64>>,
}

#[derive(Debug, ClapArgs)]
struct OutputArgs {
    /// Grips to print; 0 prints what became of the candidates only.
    #[arg(long, value_name = "N")]
    top: Option<usize>,
    /// Best grips to keep in the result file, and with --diverse that many that differ [default:
    /// 10000; with --polish top as many as --top prints].
    #[arg(long, value_name = "N")]
    keep: Option<usize>,
    /// Result file; its ending says the format: .json (read by the other subcommands), .jsonl,
    /// .csv, .parquet, .npz, ... as `export`.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Self-contained page to look at; for its picture of the friction over all loads these are
    /// solved for the best 20 grips and the first 20 printed (and kept in the result file).
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// The result as JSON on standard output instead of the table.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    json: Option<bool>,
    /// Explains one pose instead of planning, and tells where it stands among the grips found:
    /// X,Y,Z:APPROACH:CLOSING in part coordinates, e.g. 30mm,20mm,18mm:-z:+x; or
    /// X,Y,Z,QX,QY,QZ,QW of the tool frame; or X,Y,ANGLE,PAIR, place and approach angle in the plane
    /// of a pair of `gripfast part` (its place in the list, or its faces, 2|3).
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    why: Option<String>,
    /// No progress bar and no notes; warnings are printed all the same.
    #[arg(long, short, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    quiet: Option<bool>,
}

#[derive(Debug, ClapArgs)]
struct LongArgs {
    /// Starts a run of more than an hour without a question; without a terminal to ask on such a
    /// run is refused unless this is given.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    yes: Option<bool>,
    /// Resumes the unfinished run whose state lies beside the result file; starts at the first
    /// candidate when there is none.
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "true|false", hide_possible_values = true)]
    resume: Option<bool>,
    /// Time between two states written to FILE.partial; 0s: after every chunk.
    #[arg(long, value_name = "TIME")]
    checkpoint: Option<Time>,
}

#[derive(Debug, ClapArgs)]
struct MoreArgs {
    /// Tries each printed grip at poses off by up to this along both axes of the pad plane and
    /// about the closing axis, e.g. 1mm,2deg: mu_s that 95 % of them hold with, the worst, and how
    /// many are lost (no contact, twisted out). Interference is not tested again.
    #[arg(long, value_name = "LENGTH,ANGLE")]
    pose_noise: Option<PoseError>,
    /// Displaced poses per grip for --pose-noise, spread evenly.
    #[arg(long, value_name = "N")]
    noise_samples: Option<u32>,
    /// Beside the score the evaluation function of the earlier method, (K1 Delta_d + K2 tau_s/(mu_s
    /// N))/(D + EPSILON) + K3 alpha [1,1,1,1mm without a value], for all grips kept; rank
    /// correlation, and the grips whose place differs most.
    #[arg(long, value_name = "K1,K2,K3,EPSILON", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    compare: Option<EarlierWeights>,
    /// Keeps this many candidates that are no grips in the result, shared among the reasons as
    /// evenly as their counts allow: negatives for training and tests.
    #[arg(long, value_name = "N")]
    negatives: Option<usize>,
}

/// The number of a grip.
pub(crate) fn id(text: &str) -> Result<u64, String> {
    let wrong = |_| "give numbers (ids) of grips as the table lists them, e.g. 3,17".to_owned();
    text.trim().parse().map_err(wrong)
}

/// A share as a number or in percent.
pub(crate) fn share(text: &str) -> Result<f64, String> {
    let (number, factor) =
        text.trim().strip_suffix('%').map_or((text, 1.0), |number| (number, 100.0));
    match number.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value / factor),
        _ => Err("give a number such as 0.5, or 50%".to_owned()),
    }
}

/// Sets the fields of a group for which a flag was given.
macro_rules! give {
    ($flags:expr => $group:expr; $($field:ident),+ $(,)?) => {
        $(if let Some(value) = $flags.$field {
            $group.$field = value.into();
        })+
    };
}

impl Args {
    /// The pose of `--why`.
    pub(super) fn why(&self) -> Option<String> {
        self.output.why.clone()
    }

    /// What is compared: every gripper given, with every mass of the part, every force and every
    /// friction of the pads.
    pub(super) fn variants(&self) -> gripfast::error::Result<Vec<Variant>> {
        let job = &self.job;
        several::variants(&self.gripper, &job.mass, &job.force, &job.scoring.pad_friction)
    }

    /// Makes sure that nothing is given several times, which only `plan` compares.
    pub(crate) fn single(&self) -> gripfast::error::Result<()> {
        if self.gripper.len() > 1 {
            return Err(given_several_times("--gripper"));
        }
        self.job.single()
    }

    /// The request that the flags make, but for what is given several times, over the stored one
    /// where there is one.
    pub(crate) fn request(self) -> gripfast::error::Result<Request> {
        let mut request = match &self.request {
            Some(path) => Request::read(path)?,
            None => Request::default(),
        };
        if let Some(loads) = &self.loads {
            request.loads = loads.split(',').map(|source| source.trim().to_owned()).collect();
        }
        give!(self => request; part);
        if let [gripper] = &self.gripper[..] {
            request.gripper.clone_from(gripper);
        }
        self.job.give(&mut request)?;
        let (flags, long) = (self.output, self.long);
        give!(flags => request.selection; top, keep);
        give!(flags => request.output; output, report, json, quiet);
        give!(long => request.output; yes, resume, checkpoint);
        if request.output.resume && request.output.output.is_none() {
            return Err(Error::input(
                "--resume",
                "needs the result file whose run it resumes",
                "add --output FILE",
            ));
        }
        Ok(request)
    }
}

fn given_several_times(flag: &str) -> Error {
    Error::input(flag, "is given several times", "give it once; `gripfast plan` compares several")
}

impl JobArgs {
    /// Makes sure that nothing is given several times, which only `plan` compares.
    pub(crate) fn single(&self) -> gripfast::error::Result<()> {
        match (self.mass.len(), self.force.len(), self.scoring.pad_friction.len()) {
            (2.., _, _) => Err(given_several_times("--mass")),
            (_, 2.., _) => Err(given_several_times("--force")),
            (_, _, 2..) => Err(given_several_times("--pad-friction")),
            _ => Ok(()),
        }
    }

    /// Sets the fields of a request for which a flag was given once.
    pub(crate) fn give(self, request: &mut Request) -> gripfast::error::Result<()> {
        // One takes the place of the other.
        if !self.mass.is_empty() || self.density.is_some() {
            (request.mass, request.density) = (None, None);
        }
        if let [mass] = self.mass[..] {
            request.mass = Some(mass);
        }
        give!(self => request;
            density, com, inertia, unit, max_memory, outside_buffers, faceted, fit, accel);
        if let [force] = self.force[..] {
            request.force = Some(force);
        }
        let (flags, group) = (self.candidates, &mut request.candidates);
        give!(flags => group;
            spacing, angle_step, edge_angles, curved, min_contact, min_pad_share, max_offset, approach,
            ground, scene, faces, grips, flips, opening, min_opening, clearance, approach_distance);
        for (given, regions) in
            [(flags.keep_out, &mut group.keep_out), (flags.faces_in, &mut group.faces_in)]
        {
            if !given.is_empty() {
                *regions = given;
            }
        }
        let (flags, group) = (self.scoring, &mut request.scoring);
        give!(flags => group;
            backend, adapter, seeds, k1, k2, safety, max_pressure, position_error,
            closing_friction, separation, polish, refiner, threads);
        if let [friction] = flags.pad_friction[..] {
            group.pad_friction = Some(friction);
        }
        let (choice, more, group) = (self.choice, self.more, &mut request.selection);
        give!(choice => group; diverse, merge_symmetric, every_turn, ids);
        give!(more => group; pose_noise, noise_samples, compare, negatives);
        if more.noise_samples.is_some() && group.pose_noise.is_none() {
            return Err(Error::input("--noise-samples", "needs --pose-noise", "add that flag"));
        }
        Ok(())
    }
}

/// The fields of a request in one list, less those that are absent.
fn fields(request: &Request) -> Map<String, Value> {
    let mut fields = Map::new();
    if let Ok(Value::Object(groups)) = serde_json::to_value(request) {
        for (name, value) in groups {
            match value {
                Value::Object(group) => fields.extend(group),
                value => drop(fields.insert(name, value)),
            }
        }
    }
    fields
}

/// Help that states the defaults, which stand in the request.
pub(crate) fn with_defaults(command: Command) -> Command {
    let defaults = fields(&Request::default());
    let with = |plan: Command| {
        plan.mut_args(|argument| {
            let text = match defaults.get(argument.get_id().as_str()) {
                Some(Value::String(text)) => text.clone(),
                Some(Value::Number(number)) => number.to_string(),
                Some(Value::Bool(true)) => "true".to_owned(),
                Some(Value::Array(list)) => {
                    list.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(",")
                }
                _ => String::new(),
            };
            match argument.get_help().map(ToString::to_string) {
                Some(help) if !text.is_empty() => {
                    argument.help(format!("{help} [default: {text}]"))
                }
                _ => argument,
            }
        })
    };
    ["plan", "assess", "batch"]
        .into_iter()
        .fold(command, |command, name| command.mut_subcommand(name, with))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, FromArgMatches};

    /// Every flag that is a field, with a value that is not its default.
    const LINE: &str = "gripfast plan part.stl --gripper my.toml --mass 350g --force 40N --unit in --max-memory 2GB --outside-buffers \
        --faceted --fit 0.2mm \
        --accel 2g --loads gravity,ball:3 --spacing 2mm --angle-step 7deg --edge-angles false --curved \
        --min-contact 0.3 --min-pad-share 0.1 --max-offset 9mm --approach -z:45deg --ground +z:1mm \
        --keep-out 0mm,0mm,0mm:1mm,1mm,1mm --scene cell.toml --faces 0,2 --faces-in 0mm,0mm,0mm:1mm,1mm,1mm \
        --grips both --flips --opening 4mm --min-opening 1mm --clearance 1mm \
        --approach-distance 80mm --backend cpu --adapter 0 --seeds 200 --k1 2 --k2 3 \
        --pad-friction 0.7 --safety 2 --max-pressure 2MPa --com 1mm,2mm,3mm \
        --inertia 3gmm2,3gmm2,3gmm2,0gmm2,0gmm2,0gmm2 --ids 3,17 --position-error 1mm --closing-friction 0.1 --separation discard \
        --polish all --refiner shanno --threads 2 --top 3 --diverse --merge-symmetric --every-turn --keep 77 \
        -o out.json --report out.html --json -q --yes --resume --checkpoint 9s --pose-noise 1mm,2deg \
        --noise-samples 9 --compare=1,2,3,4mm --negatives 20";

    fn args(line: &str) -> Args {
        let command = crate::Cli::command();
        let matches = command.try_get_matches_from(line.split_whitespace()).unwrap();
        Args::from_arg_matches(matches.subcommand_matches("plan").unwrap()).unwrap()
    }

    #[test]
    fn every_flag_is_a_field_of_the_request_and_every_field_a_flag() {
        let request = args(LINE).request().unwrap();
        let mut set = fields(&request);
        // Given instead of the mass.
        set.insert("density".to_owned(), Value::Null);
        let command = crate::Cli::command();
        let plan = command.find_subcommand("plan").unwrap();
        let only_here = ["help", "version", "why", "request", "print_request"];
        let mut flags: Vec<&str> = plan
            .get_arguments()
            .map(|argument| argument.get_id().as_str())
            .filter(|flag| !only_here.contains(flag))
            .collect();
        flags.sort_unstable();
        let mut names: Vec<&str> = set.keys().map(String::as_str).collect();
        names.sort_unstable();
        assert_eq!(flags, names);
        let defaults = fields(&Request::default());
        for (name, value) in &set {
            assert_ne!(defaults.get(name), Some(value), "{name} is set by its flag");
        }
    }

    #[test]
    fn flags_beside_a_stored_request_override_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("request.toml");
        let stored = args(LINE).request().unwrap();
        std::fs::write(&file, stored.to_toml()).unwrap();
        let over = |flags: &str| {
            args(&format!("gripfast plan --request {} {flags}", file.display())).request().unwrap()
        };
        assert_eq!(over(""), stored);
        let changed = over("--density 7850kg/m3 --diverse=false --spacing 3mm --loads gravity");
        assert_eq!((changed.mass, changed.density), (None, Some(Density(7850.0))));
        assert!(!changed.selection.diverse);
        assert_eq!(changed.candidates.spacing, Some(Length(0.003)));
        assert_eq!(changed.loads, ["gravity"]);
        assert_eq!(changed.scoring, stored.scoring);
    }

    #[test]
    fn help_states_the_defaults_of_the_request() {
        let mut command = with_defaults(crate::Cli::command());
        let plan = command.find_subcommand_mut("plan").unwrap();
        let help = plan.render_long_help().to_string();
        for default in ["15deg", "0.25", "5mm", "0.1m", "81", "solve", "30s", "64", "gravity"] {
            assert!(help.contains(&format!("[default: {default}]")), "{default}: {help}");
        }
    }
}

//! `gripfast export`: a result file in the format of another program.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args as ClapArgs;
use gripfast::export::{self, Convention, Dialect, Format, Joint, Options, Origin};
use gripfast::part::Part;
use gripfast::plan::GLB_TOP;
use gripfast::results::{GripSet, PadFriction};
use gripfast::text::counted;
use gripfast::units::Quantity;

use crate::choice::ChoiceArgs;

/// Writes a result file in the format of another program.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast export grips.json -o grips.csv\n  gripfast export grips.json -o grips.npz --top 1000\n  \
gripfast export a.json b.json -o all.csv --holding --diverse --top 20\n  \
gripfast export grips.json --format isaac_grasp -o grips.yaml --joint panda_finger_joint1:0.5 --origin 103.4mm\n  \
gripfast export grips.json --format moveit -o -\n\nFORMATS (docs/formats.md describes each field):\n  \
json, jsonl   native          csv, parquet  a table\n  isaac_grasp   YAML            graspgen      JSON\n  moveit        YAML            graspnet      .npz\n  acronym       HDF5            glb           part with grippers, to look at\n  usd           OpenUSD text    intrinsic     JSON\n  robot         mm and the angles of --dialect"
)]
pub(crate) struct Args {
    /// Result file written by `gripfast plan -o`, JSON or JSON Lines. Several go into one table (csv,
    /// parquet).
    #[arg(required = true)]
    grips: Vec<PathBuf>,
    /// Format; by the ending of -o when not given.
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// File to write; `-` is standard output.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Axes of the tool frame: standard, moveit (z approach, y closing), graspgen (z, x), graspnet,
    /// dexnet (x, y), flange or tool (as the gripper file states them). The format's own when not
    /// given.
    #[arg(long, value_name = "NAME")]
    convention: Option<String>,
    /// Origin of the tool frame: pads (midway between them), flange, tool, or a distance behind the
    /// pads. When not given: flange for moveit where the gripper states one, else pads.
    #[arg(long, value_name = "ORIGIN")]
    origin: Option<String>,
    #[command(flatten)]
    choice: ChoiceArgs,
    /// Distance of the pads before closing; as planned when not given.
    #[arg(long, value_name = "LENGTH")]
    opened_gap: Option<String>,
    /// A joint of the gripper as NAME:SCALE:OFFSET, position = SCALE x distance of the pads in
    /// metres + OFFSET (isaac_grasp, moveit). Give it once for each joint.
    #[arg(long, value_name = "JOINT", allow_hyphen_values = true)]
    joint: Vec<String>,
    /// Friction of the pads on the part, for what holds and how well; the result's when not given.
    #[arg(long, value_name = "MU")]
    pad_friction: Option<f64>,
    /// Safety factor on that friction; the result's when not given.
    #[arg(long, value_name = "FACTOR")]
    safety: Option<f64>,
    /// Straight way of approach and retreat (moveit).
    #[arg(long, value_name = "LENGTH", default_value = "100mm")]
    approach_distance: String,
    /// Name of the part's frame (isaac_grasp, moveit).
    #[arg(long, value_name = "NAME", default_value = "part")]
    part_frame: String,
    /// For a spreadsheet (csv): texts that begin like a formula (=, +, -, @) get an apostrophe
    /// first, so that a name from a file is never calculated.
    #[arg(long)]
    spreadsheet: bool,
    /// Angles of the robot: ur (rotation vector), kuka (A, B, C), abb (quaternion) or fanuc (W, P, R)
    /// (robot).
    #[arg(long, value_name = "NAME", default_value = "ur")]
    dialect: String,
    /// The part's mesh (glb, usd); the file named in the result when not given.
    #[arg(long, value_name = "FILE")]
    part: Option<PathBuf>,
}

/// Runs the subcommand.
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let to_stdout = args.output.as_os_str() == "-";
    let format = match &args.format {
        Some(name) => Format::parse("--format", name)?,
        None if to_stdout => anyhow::bail!(gripfast::error::Error::input(
            "-o -",
            "standard output has no ending that names a format",
            "add --format"
        )),
        None => Format::from_path(&args.output)?,
    };
    let length = |place: &str, text: &str| -> anyhow::Result<f64> {
        let value = Quantity::Length.parse(place, text)?;
        if value < 0.0 {
            anyhow::bail!(gripfast::error::Error::input(
                place,
                format!("'{text}' is negative"),
                "give a length of zero or more"
            ));
        }
        Ok(value)
    };
    if let Some(friction) = args.pad_friction
        && !(friction.is_finite() && friction >= 0.0)
    {
        anyhow::bail!(gripfast::error::Error::input(
            "--pad-friction",
            format!("{friction} is no friction coefficient"),
            "give a number of zero or more"
        ));
    }
    if let Some(safety) = args.safety
        && !(safety.is_finite() && safety > 0.0)
    {
        anyhow::bail!(gripfast::error::Error::input(
            "--safety",
            format!("{safety} is no safety factor"),
            "give a number above zero"
        ));
    }
    let joints = args
        .joint
        .iter()
        .map(|text| Joint::parse("--joint", text))
        .collect::<Result<Vec<_>, _>>()?;
    let options = Options::default()
        .with_convention(
            args.convention
                .as_deref()
                .map(|name| Convention::parse("--convention", name))
                .transpose()?,
        )
        .with_origin(
            args.origin.as_deref().map(|text| Origin::parse("--origin", text)).transpose()?,
        )
        .with_top((format == Format::Glb && args.choice.top.is_none()).then_some(GLB_TOP))
        .with_opening(
            args.opened_gap.as_deref().map(|text| length("--opened-gap", text)).transpose()?,
        )
        .with_joints(if joints.is_empty() { vec![Joint::default()] } else { joints })
        .with_pad_friction(args.pad_friction)
        .with_safety(args.safety)
        .with_approach(length("--approach-distance", &args.approach_distance)?)
        .with_part_frame(args.part_frame.clone())
        .with_spreadsheet(args.spreadsheet)
        .with_dialect(Dialect::parse("--dialect", &args.dialect)?);
    let mut filter = args.choice.filter();
    let mut sets = Vec::with_capacity(args.grips.len());
    for file in &args.grips {
        let mut set = GripSet::read(file)?;
        let PadFriction { value, safety } = set.pads();
        filter.pads = Some(PadFriction {
            value: args.pad_friction.or(value),
            safety: args.safety.unwrap_or(safety),
        });
        filter.apply(&mut set)?;
        sets.push(set);
    }
    write(&args, &sets, format, &options)?;
    let most = options.top.unwrap_or(usize::MAX);
    let count: usize = sets.iter().map(|set| set.grips.len().min(most)).sum();
    if count == 0 {
        crate::terminal::say(
            "warning: no grip is written: the results hold none, or none that the choice (--ids, \
             --faces, --approach, --min-pad-share, --holding, --top) lets through",
        );
    }
    if !to_stdout {
        let frame = match sets.first() {
            Some(set) => export::tool_frame(set, format, &options)?,
            None => None,
        };
        let frame = frame.map_or("grip frames".to_owned(), |frame| format!("tool frame {frame}"));
        crate::terminal::say(&format!(
            "{}: {}, {frame}",
            args.output.display(),
            counted(count as u64, "grip")
        ));
    }
    Ok(ExitCode::from(u8::from(count == 0)))
}

/// Writes one result, or a table of several.
fn write(args: &Args, sets: &[GripSet], format: Format, options: &Options) -> anyhow::Result<()> {
    let to_stdout = args.output.as_os_str() == "-";
    let mut output = std::io::stdout();
    let ([set], [file]) = (sets, &args.grips[..]) else {
        if to_stdout {
            export::write_tables_to(sets, format, &mut output, options)?;
            return Ok(output.flush()?);
        }
        return Ok(export::write_tables(sets, format, &args.output, options)?);
    };
    let part =
        if format.draws() { Some(read_part(set, file, args.part.as_deref())?) } else { None };
    let mesh = part.as_ref().map(|part| &part.mesh);
    if to_stdout {
        export::write_to(set, format, &mut output, options, mesh)?;
        return Ok(output.flush()?);
    }
    Ok(export::write(set, format, &args.output, options, mesh)?)
}

/// The part of a result: the file given, or the one named in it, from the working folder or beside
/// the result file.
pub(crate) fn read_part(
    set: &GripSet,
    result: &Path,
    given: Option<&Path>,
) -> anyhow::Result<Part> {
    let path = given.map(Path::to_path_buf).or_else(|| set.part_file(result)).ok_or_else(|| {
        gripfast::error::Error::input(
            result.display().to_string(),
            format!("the part '{}' that it names is not there", set.part.file),
            "give its place with --part FILE",
        )
    })?;
    Ok(set.read_part(&path)?)
}

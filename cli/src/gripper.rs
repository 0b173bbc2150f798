//! `gripfast gripper`: the shipped grippers, and a look at one.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args as ClapArgs, Subcommand};
use comfy_table::{ColumnConstraint, ContentArrangement, Table, presets};
use gripfast::file;
use gripfast::geometry::Bounds2;
use gripfast::gripper::{
    self, Body, Gripper, Jaw, Moving, Shape, Travel, catalogue, check, drawing,
};
use gripfast::text::shown;

use crate::terminal;

/// Lists, prints and checks grippers.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast gripper list\n  gripfast gripper show generic > my-gripper.toml\n  \
gripfast gripper check my-gripper.toml --svg my-gripper.svg\n\nThe file is described in docs/gripper-file.md."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Lists the shipped grippers.
    #[command(after_help = "EXAMPLES:\n  gripfast gripper list")]
    List,
    /// Prints the file of a gripper, e.g. as a start for your own.
    #[command(after_help = "EXAMPLES:\n  gripfast gripper show generic > my-gripper.toml")]
    Show {
        /// Shipped name or gripper file.
        gripper: String,
    },
    /// Reads a gripper, prints its dimensions with their sources, and warns of what is doubtful.
    #[command(
        after_help = "EXAMPLES:\n  gripfast gripper check robotiq-2f85\n  gripfast gripper check my-gripper.toml --svg my-gripper.svg"
    )]
    Check {
        /// Shipped name or gripper file.
        gripper: String,
        /// Draw it with its dimensions into this SVG file.
        #[arg(long, alias = "plot", value_name = "FILE")]
        svg: Option<PathBuf>,
    },
    /// Makes a gripper file from a robot model (URDF): stroke and motion from its joints, boxes round
    /// its links. What a model cannot say is marked as unverified.
    #[command(
        after_help = "EXAMPLES:\n  gripfast gripper import hand.urdf --jaw left_finger_pad --jaw right_finger_pad -o hand.toml\n\n\
Name the two links that touch the part. Expand xacro files first."
    )]
    Import {
        /// Robot model.
        file: PathBuf,
        /// Link that touches the part; twice, the first becomes jaw I.
        #[arg(long, value_name = "LINK", required = true)]
        jaw: Vec<String>,
        /// Gripper file to write; standard output when not given.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Name of the gripper [default: the model's].
        #[arg(long)]
        name: Option<String>,
        /// Draw it with its dimensions into this SVG file.
        #[arg(long, alias = "plot", value_name = "FILE")]
        svg: Option<PathBuf>,
    },
    /// Makes a gripper file: asks for the dimensions on a terminal, or takes them as flags.
    #[command(after_help = "EXAMPLES:\n  gripfast gripper new bench.toml\n  \
gripfast gripper new bench.toml --name Bench --stroke 2mm,60mm --force 15N,120N --pad 24mm,16mm --finger 63mm,16mm,14mm --palm 70mm,90mm,90mm --throat 37mm")]
    New(Box<crate::gripper_new::NewArgs>),
}

/// Runs the subcommand.
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.action {
        Action::List => list()?,
        Action::Import { file, jaw, output, name, svg } => {
            import(&file, &jaw, output.as_deref(), name.as_deref(), svg.as_deref())?;
        }
        Action::New(args) => crate::gripper_new::run(*args)?,
        Action::Show { gripper } => {
            write!(terminal::output(), "{}", catalogue::text(&gripper)?)?;
        }
        Action::Check { gripper, svg } => {
            let gripper = gripper::find(&gripper)?;
            let mut out = terminal::output();
            writeln!(out, "{}", describe(&gripper))?;
            if let Some(path) = svg {
                draw(&gripper, &path)?;
                writeln!(out, "drawing: {}", path.display())?;
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the drawing of a gripper.
pub(crate) fn draw(gripper: &Gripper, path: &Path) -> anyhow::Result<()> {
    Ok(file::write(path, |writer| writer.write_all(drawing::svg(gripper).as_bytes()))?)
}

fn import(
    path: &Path,
    jaws: &[String],
    output: Option<&Path>,
    name: Option<&str>,
    svg: Option<&Path>,
) -> anyhow::Result<()> {
    let [one, other] = jaws else {
        anyhow::bail!(gripfast::error::Error::input(
            "--jaw",
            format!("{} links are named", jaws.len()),
            "name the two that touch the part: --jaw A --jaw B"
        ));
    };
    let found = gripper::import(path, [one, other], name)?;
    match output {
        Some(output) => {
            file::write(output, |writer| writer.write_all(found.text.as_bytes()))?;
            terminal::say(&format!("wrote {}", output.display()));
        }
        None => write!(terminal::output(), "{}", found.text)?,
    }
    for note in &found.notes {
        terminal::say(&format!("to look at: {note}"));
    }
    let gripper = gripper::parse(&found.text, "the imported gripper")?;
    for warning in gripper::check(&gripper) {
        terminal::say(&format!("warning: {warning}"));
    }
    if let Some(path) = svg {
        draw(&gripper, path)?;
        terminal::say(&format!("drawing: {}", path.display()));
    }
    Ok(())
}

fn list() -> anyhow::Result<()> {
    let mut table = new_table(&[
        "gripper",
        "name",
        "stroke",
        "force per jaw",
        "pad x1 x x2",
        "friction",
        "unverified",
    ]);
    for (short, _) in catalogue::CATALOGUE {
        let gripper = gripper::find(short)?;
        let pad = Bounds2::of(&gripper.pad).size() * 1e3;
        let unverified = gripper.sources.values().filter(|source| !source.verified).count();
        table.add_row([
            (*short).to_string(),
            gripper.name.clone(),
            range(gripper.stroke, 1e3, "mm"),
            range(gripper.force, 1.0, "N"),
            format!("{} x {} mm", short_number(pad.x), short_number(pad.y)),
            gripper.pad_friction.map_or("-".into(), |friction| friction.to_string()),
            format!("{unverified} of {}", gripper.sources.len()),
        ]);
    }
    writeln!(
        terminal::output(),
        "{table}\n`gripfast gripper check NAME` says where each value comes from; unverified ones are \
         estimates."
    )?;
    Ok(())
}

pub(crate) fn describe(gripper: &Gripper) -> String {
    let mut table = new_table(&["dimension", "value", "source"]);
    let mut row = |key: String, value: String| {
        let source = gripper.sources.get(&key).map_or("no source given".to_string(), |source| {
            if source.verified {
                source.text.clone()
            } else {
                format!("UNVERIFIED: {}", source.text)
            }
        });
        table.add_row([key, value, source].map(|text| shown(&text).into_owned()));
    };
    row("stroke".into(), range(gripper.stroke, 1e3, "mm"));
    row("force".into(), range(gripper.force, 1.0, "N per jaw"));
    if let Some(payload) = gripper.payload {
        row("payload".into(), format!("{} kg", short_number(payload)));
    }
    if let Some(moment) = gripper.moment {
        row("moment".into(), format!("{} Nm (x1, x2, x3)", moment.map(short_number).join(", ")));
    }
    let [pad, other] = gripper.pad_sizes().map(|size| {
        format!("{} x {} mm (x1, x2)", short_number(size.x * 1e3), short_number(size.y * 1e3))
    });
    row(
        "pad.size".into(),
        match gripper.pad_ii {
            None => pad,
            Some(_) => format!("jaw I: {pad}; jaw II: {other}"),
        },
    );
    if let Some(value) = gripper.pad_thickness {
        row("pad.thickness".into(), format!("{} mm", short_number(value * 1e3)));
    }
    if let Some(value) = gripper.pad_modulus {
        row("pad.modulus".into(), format!("{} MPa", short_number(value * 1e-6)));
    }
    row(
        "pad.friction".into(),
        gripper.pad_friction.map_or("not stated".into(), |value| value.to_string()),
    );
    if gripper.moving != Moving::Both || gripper.travel != Travel::Parallel {
        row("motion".into(), motion_text(gripper));
    }
    let alike = gripper.fingers_ii.is_none();
    for &jaw in if alike { &Jaw::BOTH[..1] } else { &Jaw::BOTH } {
        let of = if alike { String::new() } else { format!("jaw {}: ", jaw.name()) };
        for body in gripper.bodies(jaw) {
            // As it lies in the file.
            let lies = if alike { body.clone() } else { body.moved(&jaw.at(0.0)) };
            row(format!("finger.{}", body.name), format!("{of}{}", body_text(&lies)));
        }
    }
    for body in &gripper.palm {
        row(format!("palm.{}", body.name), body_text(body));
    }
    if let Some(frame) = gripper.grip_from_flange {
        row("flange".into(), place_text(frame.origin.to_array()));
    }
    let throat = check::throat(gripper).map_or(String::new(), |throat| {
        format!("\nthroat (pad's rear edge to palm): {} mm", short_number(throat * 1e3))
    });
    let warnings: Vec<String> =
        gripper::check(gripper).iter().map(|warning| format!("\nwarning: {warning}")).collect();
    format!("{}\n{table}{throat}{}", shown(&gripper.name), warnings.concat())
}

/// Which jaws move, and how far their pads leave the straight way.
fn motion_text(gripper: &Gripper) -> String {
    let moving = match gripper.moving {
        Moving::Both => "both jaws",
        Moving::I => "jaw I, jaw II is fixed to the palm",
        Moving::II => "jaw II, jaw I is fixed to the palm",
    };
    let way = match &gripper.travel {
        Travel::Arc { crank, angle, .. } => format!(
            ", on a crank of {} mm from {} deg",
            short_number(crank * 1e3),
            short_number(angle.to_degrees())
        ),
        Travel::Table { rows } => format!(", by a table of {} rows", rows.len()),
        _ => return moving.to_owned(),
    };
    let advance = gripper.stroke.map(|gap| gripper.travel.advance(gap) * 1e3);
    format!(
        "{moving}{way}: the pads lie {} mm nearer to the palm when open",
        short_number(advance[0] - advance[1])
    )
}

/// Where the origin of a frame lies, with its offsets to the side.
fn place_text([behind, across, closing]: [f64; 3]) -> String {
    let mut text = format!("{} mm behind the pads' middle", short_number(-behind * 1e3));
    for (axis, offset) in [("x2", across), ("x3", closing)] {
        let offset = short_number(offset * 1e3);
        if offset != "0" {
            text += &format!(", {offset} mm along {axis}");
        }
    }
    text
}

fn body_text(body: &Body) -> String {
    let [min, max] = body.bounds().map(|corner| corner * 1e3);
    let kind = match body.shape {
        Shape::Box { .. } => "box",
        Shape::Cylinder { .. } => "cylinder",
        Shape::Hull { .. } => "hull",
    };
    let span = |axis: usize| format!("{}..{}", short_number(min[axis]), short_number(max[axis]));
    format!("{kind}, x1 {}, x2 {}, x3 {} mm", span(0), span(1), span(2))
}

fn range(values: [f64; 2], factor: f64, unit: &str) -> String {
    format!("{} .. {} {unit}", short_number(values[0] * factor), short_number(values[1] * factor))
}

fn short_number(value: f64) -> String {
    gripfast::units::decimal(value, 3)
}

fn new_table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(header.to_vec());
    if let Some(width) = terminal::width() {
        table.set_width(width.try_into().unwrap_or(u16::MAX));
    }
    // What may have to be typed is not broken.
    if let Some(first) = table.column_mut(0) {
        first.set_constraint(ColumnConstraint::ContentWidth);
    }
    table
}

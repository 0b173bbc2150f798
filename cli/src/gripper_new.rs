//! `gripfast gripper new`: a gripper file from a few dimensions, asked for or given as flags.

use std::io::{BufRead, IsTerminal, Write};
use std::path::PathBuf;

use anyhow::Context;
use clap::Args as ClapArgs;
use gripfast::error::Error;
use gripfast::file;
use gripfast::gripper;
use gripfast::units::Quantity;

use crate::gripper::{describe, draw};
use crate::terminal;

/// The dimensions of a gripper whose jaws are boxes. What is not given is asked for on a terminal.
#[derive(Debug, ClapArgs)]
pub(crate) struct NewArgs {
    /// Gripper file to write; its drawing goes beside it (.svg).
    file: PathBuf,
    /// Name, for tables and pages.
    #[arg(long)]
    name: Option<String>,
    /// Smallest and largest distance of the pads, e.g. 2mm,60mm.
    #[arg(long, value_name = "LEAST,MOST")]
    stroke: Option<String>,
    /// Smallest and largest force of one jaw, e.g. 15N,120N.
    #[arg(long, value_name = "LEAST,MOST")]
    force: Option<String>,
    /// Size of the pads along the finger and across, e.g. 24mm,16mm.
    #[arg(long, value_name = "ALONG,ACROSS")]
    pad: Option<String>,
    /// Size of a finger from its tip backwards, across, and along the closing axis, e.g.
    /// 63mm,16mm,14mm; its tip is flush with the pad's.
    #[arg(long, value_name = "LENGTH,WIDTH,DEPTH")]
    finger: Option<String>,
    /// Free length from the pads' rear edge to the palm, e.g. 37mm.
    #[arg(long, value_name = "LENGTH")]
    throat: Option<String>,
    /// Size of the palm backwards, across, and along the closing axis, e.g. 70mm,90mm,90mm; the
    /// robot's flange is taken to be its rear.
    #[arg(long, value_name = "LENGTH,WIDTH,DEPTH")]
    palm: Option<String>,
    /// Friction of the pads on the part, e.g. 0.5.
    #[arg(long)]
    friction: Option<f64>,
    /// Jaw that moves alone where the other one is fixed: I or II.
    #[arg(long, value_name = "both|I|II", default_value = "both", value_parser = ["both", "I", "II"])]
    moves: String,
    /// Overwrite the file.
    #[arg(long)]
    overwrite: bool,
}

/// A dimension: its flag, a question, and an example.
type Question = (&'static str, &'static str, &'static str);

const NAME: Question = ("--name", "name of the gripper", "Bench gripper");
const STROKE: Question = ("--stroke", "smallest and largest distance of the pads", "2mm,60mm");
const FORCE: Question = ("--force", "smallest and largest force of one jaw", "15N,120N");
const PAD: Question = ("--pad", "size of the pads along the finger and across", "24mm,16mm");
const FINGER: Question = (
    "--finger",
    "size of a finger: backwards from its tip, across, along the closing axis",
    "63mm,16mm,14mm",
);
const THROAT: Question = ("--throat", "free length from the pads' rear edge to the palm", "37mm");
const PALM: Question =
    ("--palm", "size of the palm: backwards, across, along the closing axis", "70mm,90mm,90mm");

/// Asks on a terminal.
struct Asker {
    input: Option<std::io::StdinLock<'static>>,
}

impl Asker {
    fn new() -> Self {
        let input = std::io::stdin();
        Self { input: input.is_terminal().then(|| input.lock()) }
    }

    /// The answer to a question, where the flag does not give it.
    fn text(
        &mut self,
        given: Option<String>,
        (flag, question, example): Question,
    ) -> anyhow::Result<String> {
        if let Some(text) = given {
            return Ok(text);
        }
        let Some(input) = &mut self.input else {
            anyhow::bail!(Error::input(
                flag,
                format!("{question}: not given, and there is no terminal to ask on"),
                format!("give it, e.g. {flag} {}", quoted(example))
            ));
        };
        terminal::say(&format!("{question}, e.g. {example}:"));
        let mut line = String::new();
        input.read_line(&mut line).context("the answer")?;
        Ok(line.trim().to_owned())
    }

    /// The friction of the pads, which may stay open.
    fn friction(&mut self) -> anyhow::Result<Option<f64>> {
        let Some(input) = &mut self.input else { return Ok(None) };
        terminal::say("friction of the pads on the part, e.g. 0.5 (nothing: not known):");
        let mut line = String::new();
        input.read_line(&mut line).context("the answer")?;
        match line.trim() {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| {
                let remedy = "give a number without a unit, e.g. 0.5";
                Error::input("--friction", format!("'{text}' is no number"), remedy).into()
            }),
        }
    }

    /// So many values of a quantity.
    fn values<const N: usize>(
        &mut self,
        given: Option<String>,
        question: Question,
        quantity: Quantity,
    ) -> anyhow::Result<[f64; N]> {
        let text = self.text(given, question)?;
        let (flag, _, example) = question;
        let pieces: Vec<&str> = text.split(',').map(str::trim).collect();
        let values: Vec<f64> = pieces
            .iter()
            .map(|piece| quantity.parse(flag, piece))
            .collect::<gripfast::error::Result<_>>()?;
        let values: [f64; N] = values.try_into().map_err(|_| {
            Error::input(
                flag,
                format!("'{text}' is not {N} values"),
                format!("give e.g. {example}"),
            )
        })?;
        if values.iter().any(|value| *value < 0.0) {
            anyhow::bail!(Error::input(
                flag,
                format!("'{text}' is negative"),
                format!("give e.g. {example}")
            ));
        }
        Ok(values)
    }
}

/// A value as a shell takes it for one word.
fn quoted(text: &str) -> String {
    if text.contains(' ') { format!("\"{text}\"") } else { text.to_owned() }
}

/// Runs the subcommand.
pub(crate) fn run(args: NewArgs) -> anyhow::Result<()> {
    if args.file.exists() && !args.overwrite {
        anyhow::bail!(Error::input(
            args.file.display().to_string(),
            "is there already",
            "give another name, or --overwrite"
        ));
    }
    let mut asker = Asker::new();
    let name = asker.text(args.name, NAME)?;
    let stroke = asker.values::<2>(args.stroke, STROKE, Quantity::Length)?;
    let force = asker.values::<2>(args.force, FORCE, Quantity::Force)?;
    let pad = asker.values::<2>(args.pad, PAD, Quantity::Length)?;
    let finger = asker.values::<3>(args.finger, FINGER, Quantity::Length)?;
    let [throat] = asker.values::<1>(args.throat, THROAT, Quantity::Length)?;
    let palm = asker.values::<3>(args.palm, PALM, Quantity::Length)?;
    let friction = args.friction.map_or_else(|| asker.friction(), |friction| Ok(Some(friction)))?;
    let mm = |value: f64| format!("{}mm", gripfast::units::decimal(value * 1e3, 4));
    // The finger's tip is flush with the pad's front edge.
    let finger_at = pad[0] / 2.0 - finger[0] / 2.0;
    let front = -pad[0] / 2.0 - throat;
    let friction = match friction {
        Some(friction) => {
            format!("friction = {friction}                      # of the pads on the part\n")
        }
        None => {
            "# friction = 0.5                    # of the pads on the part: measure it\n".to_owned()
        }
    };
    let motion = match args.moves.as_str() {
        "both" => String::new(),
        jaw => format!(
            "\n[motion]\nmoves = \"{jaw}\"                         # the other jaw is fixed to the palm\n"
        ),
    };
    let text = format!(
        "# {name}, made by `gripfast gripper new`. docs/gripper-file.md describes every key.\n\
         # Axes: x1 approach (palm towards fingertips), x3 closing, x2 across; origin midway between the pads, at the pad centre.\n\
         # Finger bodies are those of the finger at +x3, placed for closed jaws: the pad face is x3 = 0, the body lies above it.\n\n\
         name = {}\n\
         stroke = [\"{}\", \"{}\"]           # smallest and largest distance of the pads\n\
         force = [\"{}N\", \"{}N\"]              # of one jaw: half of a data sheet's sum of both\n\n\
         [pad]\n\
         rectangle = [\"{}\", \"{}\"]        # along x1, along x2\n\
         {friction}\n\
         [[finger]]\n\
         name = \"finger\"\n\
         box = [\"{}\", \"{}\", \"{}\"]      # along x1, x2, x3; split it up where a slimmer tip reaches farther\n\
         at = [\"{}\", \"0mm\", \"{}\"]\n\n\
         [[palm]]\n\
         name = \"palm\"\n\
         box = [\"{}\", \"{}\", \"{}\"]\n\
         at = [\"{}\", \"0mm\", \"0mm\"]\n{motion}\n\
         [flange]                            # the robot's mounting face: the rear of the palm; correct it\n\
         origin = [\"{}\", \"0mm\", \"0mm\"]\n\n\
         [unverified]\n\
         stroke = \"as given to `gripper new`\"\n\
         force = \"as given to `gripper new`\"\n\
         \"pad.size\" = \"as given to `gripper new`\"\n\
         \"finger.finger\" = \"one box, as given to `gripper new`\"\n\
         \"palm.palm\" = \"one box, as given to `gripper new`\"\n\
         flange = \"taken for the rear of the palm\"\n",
        serde_json::Value::from(name.as_str()),
        mm(stroke[0]),
        mm(stroke[1]),
        force[0],
        force[1],
        mm(pad[0]),
        mm(pad[1]),
        mm(finger[0]),
        mm(finger[1]),
        mm(finger[2]),
        mm(finger_at),
        mm(finger[2] / 2.0),
        mm(palm[0]),
        mm(palm[1]),
        mm(palm[2]),
        mm(front - palm[0] / 2.0),
        mm(front - palm[0]),
    );
    let gripper = gripper::parse(&text, &args.file.display().to_string())?;
    file::write(&args.file, |writer| writer.write_all(text.as_bytes()))?;
    let drawing = args.file.with_extension("svg");
    draw(&gripper, &drawing)?;
    let mut out = terminal::output();
    writeln!(out, "{}", describe(&gripper))?;
    writeln!(out, "wrote {}", args.file.display())?;
    writeln!(out, "drawing: {}", drawing.display())?;
    Ok(())
}

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
const FORCE: Question =
    ("--force", "smallest and largest force of one jaw (half of a sum of both)", "15N,120N");
const PAD: Question = ("--pad", "size of the pads along the finger and across", "24mm,16mm");
const FINGER: Question = (
    "--finger",
    "size of a finger: backwards from its tip, across, along the closing axis",
    "63mm,16mm,14mm",
);
const THROAT: Question = ("--throat", "free length from the pads' rear edge to the palm", "37mm");
const PALM: Question =
    ("--palm", "size of the palm: backwards, across, along the closing axis", "70mm,90mm,90mm");
const FRICTION: Question =
    ("--friction", "friction of the pads on the part (nothing: not known)", "0.5");

/// Asks on a terminal.
struct Asker {
    input: Option<Box<dyn BufRead>>,
}

impl Asker {
    fn new() -> Self {
        let input = std::io::stdin();
        Self { input: input.is_terminal().then(|| Box::new(input.lock()) as Box<dyn BufRead>) }
    }

    /// What `read` makes of the flag's value or, where there is none, of an answer: one that is wrong
    /// is told and asked for again.
    fn ask<T>(
        &mut self,
        given: Option<String>,
        (flag, question, example): Question,
        read: impl Fn(&str) -> gripfast::error::Result<T>,
    ) -> anyhow::Result<T> {
        if let Some(text) = given {
            return Ok(read(&text)?);
        }
        let Some(input) = &mut self.input else {
            anyhow::bail!(Error::input(
                flag,
                format!("{question}: not given, and there is no terminal to ask on"),
                format!("give it, e.g. {flag} {}", quoted(example))
            ));
        };
        loop {
            terminal::say(&format!("{question}, e.g. {example}:"));
            let mut line = String::new();
            if input.read_line(&mut line).context("the answer")? == 0 {
                anyhow::bail!(Error::input(
                    flag,
                    format!("{question}: the input ended before an answer"),
                    format!("answer, or give it, e.g. {flag} {}", quoted(example))
                ));
            }
            match read(line.trim()) {
                Ok(answer) => return Ok(answer),
                Err(error) => terminal::say(&format!("{error:#}")),
            }
        }
    }

    fn name(&mut self, given: Option<String>) -> anyhow::Result<String> {
        self.ask(given, NAME, |text| match text {
            "" => Err(Error::input(NAME.0, "is empty", "give a name")),
            text => Ok(text.to_owned()),
        })
    }

    /// The friction of the pads, which may stay open.
    fn friction(&mut self, given: Option<f64>) -> anyhow::Result<Option<f64>> {
        if given.is_some() || self.input.is_none() {
            return Ok(given);
        }
        self.ask(None, FRICTION, |text| match text {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| {
                let remedy = "give a number without a unit, e.g. 0.5";
                Error::input(FRICTION.0, format!("'{text}' is no number"), remedy)
            }),
        })
    }

    /// So many values of a quantity.
    fn values<const N: usize>(
        &mut self,
        given: Option<String>,
        question: Question,
        quantity: Quantity,
    ) -> anyhow::Result<[f64; N]> {
        self.ask(given, question, |text| values(text, question, quantity))
    }

    /// The ends of a range.
    fn range(
        &mut self,
        given: Option<String>,
        question: Question,
        quantity: Quantity,
    ) -> anyhow::Result<[f64; 2]> {
        self.ask(given, question, |text| {
            let [least, most] = values(text, question, quantity)?;
            if least < most {
                return Ok([least, most]);
            }
            Err(Error::input(
                question.0,
                format!("'{text}' does not rise"),
                format!("give the smallest value first, e.g. {}", question.2),
            ))
        })
    }
}

/// The pieces of a list as people write one: `24mm,16mm`, `24 x 16 mm`, `0 to 60mm`. The unit of the
/// last piece is that of those before it that have none.
fn pieces(text: &str) -> Vec<String> {
    let text = text.replace(['x', '\u{d7}', ';'], ",").replace("to", ",").replace("..", ",");
    let pieces: Vec<&str> = text.split(',').map(str::trim).collect();
    let last = pieces.last().copied().unwrap_or_default();
    let bare = |piece: &str| piece.trim_end().parse::<f64>().is_ok();
    let ends = (0..=last.len()).rev().filter(|end| last.is_char_boundary(*end));
    let unit = ends.map(|end| last.split_at(end)).find(|(number, _)| bare(number));
    let unit = unit.map_or("", |(_, unit)| unit);
    let whole = |piece: &&str| match bare(piece) {
        true => format!("{piece}{unit}"),
        false => (*piece).to_owned(),
    };
    pieces.iter().map(whole).collect()
}

/// So many values of a quantity, none of them negative.
fn values<const N: usize>(
    text: &str,
    (flag, _, example): Question,
    quantity: Quantity,
) -> gripfast::error::Result<[f64; N]> {
    let wrong = |what: String| Error::input(flag, what, format!("give e.g. {example}"));
    if text.is_empty() {
        return Err(wrong("no answer; the example is not taken by itself".to_owned()));
    }
    let values = pieces(text).into_iter().map(|piece| quantity.parse(flag, &piece));
    let values: Vec<f64> = values.collect::<gripfast::error::Result<_>>()?;
    let values: [f64; N] =
        values.try_into().map_err(|_| wrong(format!("'{text}' is not {N} values")))?;
    if values.iter().any(|value| *value < 0.0) {
        return Err(wrong(format!("'{text}' is negative")));
    }
    Ok(values)
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
    if asker.input.is_some() && args.name.is_none() {
        terminal::say(
            "Lengths and forces with their units, several joined by commas; Ctrl-C ends.",
        );
    }
    let name = asker.name(args.name)?;
    let stroke = asker.range(args.stroke, STROKE, Quantity::Length)?;
    let force = asker.range(args.force, FORCE, Quantity::Force)?;
    let pad = asker.values::<2>(args.pad, PAD, Quantity::Length)?;
    let finger = asker.values::<3>(args.finger, FINGER, Quantity::Length)?;
    let [throat] = asker.values::<1>(args.throat, THROAT, Quantity::Length)?;
    let palm = asker.values::<3>(args.palm, PALM, Quantity::Length)?;
    let friction = asker.friction(args.friction)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_answer_is_asked_for_again() {
        let lines = "\nBench\n0,60\n\n60mm,2mm\n2mm\n-2mm,60mm\n2mm, 60mm\nhigh\n\n";
        let mut asker = Asker { input: Some(Box::new(lines.as_bytes())) };
        assert_eq!(asker.name(None).unwrap(), "Bench");
        let stroke = asker.range(None, STROKE, Quantity::Length).unwrap();
        assert!((stroke[0] - 0.002).abs() < 1e-12 && (stroke[1] - 0.06).abs() < 1e-12);
        assert_eq!(asker.friction(None).unwrap(), None);
        let ended = asker.values::<3>(None, PALM, Quantity::Length).unwrap_err().to_string();
        assert!(ended.contains("ended before an answer"), "{ended}");
        for text in [
            "24mm,16mm",
            "24 x 16 mm",
            "24mm x 16mm",
            "24,16mm",
            "24 to 16mm",
            "24000e-3 x 16000e-3mm",
            "2.4\u{d7}1.6cm",
        ] {
            let [a, b] = values(text, PAD, Quantity::Length).unwrap();
            assert!((a - 0.024).abs() < 1e-12 && (b - 0.016).abs() < 1e-12, "{text}: {a} {b}");
        }
        for text in ["24,16", "24mm,16", "24mm 16mm", "24mm", "x", "24mm,"] {
            assert!(values::<2>(text, PAD, Quantity::Length).is_err(), "{text}");
        }
        let bare = values::<2>("24, 160", PAD, Quantity::Length).unwrap_err().to_string();
        assert!(bare.contains("'24' has no unit"), "{bare}");
        // What is given as a flag is refused at once.
        let wrong = asker.range(Some("60mm,2mm".to_owned()), STROKE, Quantity::Length).unwrap_err();
        assert!(wrong.to_string().contains("does not rise"), "{wrong}");
    }
}

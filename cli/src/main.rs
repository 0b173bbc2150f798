//! The `gripfast` program: flags to options, options to calls of the library, answers to text. Thin.

/// Parses one of an enum's words, or of some of them, as a flag's value.
macro_rules! words {
    ($name:ty) => {
        words!($name, <$name>::WORDS)
    };
    ($name:ty, $words:expr) => {
        clap::builder::TypedValueParser::try_map(
            clap::builder::PossibleValuesParser::new($words),
            |text| text.parse::<$name>(),
        )
    };
}

mod assess;
mod backend;
mod batch;
mod bench;
mod choice;
mod defaults;
mod devices;
mod export;
mod figures;
mod flags;
mod gripper;
mod gripper_new;
mod part;
mod pick;
mod plan;
mod report;
mod score;
mod shell;
mod solve;
mod terminal;
mod why;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use gripfast::units::Quantity;

/// Finds and ranks every two-finger grip (grasp) on a CAD part by the smallest friction coefficient
/// that holds it.
#[derive(Debug, Parser)]
#[command(name = "gripfast", version, about, propagate_version = true)]
#[command(
    after_help = "EXAMPLES:\n  gripfast plan bracket.stl --gripper robotiq-2f85 --mass 350g --accel 2g -o grips.json --report bracket.html\n  \
gripfast why grips.json 962\n  gripfast export grips.json -o grips.csv\n  gripfast pick grips.json --scene cell.toml\n\nEXIT CODES:\n  0  done    1  done, but nothing found    2  bad input, bad usage or a failed run\n\n\
PROJECT DEFAULTS:\n  A file gripfast.toml in the current folder sets flags, one table for each subcommand, e.g.\n    [plan]\n    gripper = \"robotiq-2f85\"\n    mass = \"350g\""
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Plan(Box<plan::Args>),
    Assess(Box<assess::AssessArgs>),
    Batch(Box<batch::Args>),
    Part(part::Args),
    Solve(solve::Args),
    Why(why::Args),
    Score(score::Args),
    Devices(devices::Args),
    Bench(bench::Args),
    Report(report::Args),
    Gripper(gripper::Args),
    Figures(figures::Args),
    Export(Box<export::Args>),
    Pick(pick::Args),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
    /// Reads STEP files for another process of this program.
    #[cfg(feature = "step")]
    #[command(name = STEP_KERNEL, hide = true)]
    StepKernel {
        memory: u64,
        seconds: u64,
    },
}

/// The hidden subcommand in which the CAD kernel runs.
#[cfg(feature = "step")]
const STEP_KERNEL: &str = "step-kernel";

fn main() -> ExitCode {
    quiet_vulkan();
    #[cfg(feature = "step")]
    step_apart();
    run()
}

/// The command line, with help that states the defaults.
fn command() -> clap::Command {
    plan::with_defaults(Cli::command()).long_version(version())
}

/// Version, what this build has, and for which machine it was made.
fn version() -> &'static str {
    let features = [
        ("gpu", cfg!(feature = "gpu")),
        ("parquet", cfg!(feature = "parquet")),
        ("hdf5", cfg!(feature = "hdf5")),
        ("step", cfg!(feature = "step")),
    ];
    let list = |built: bool| {
        let names = features.iter().filter(|(_, has)| *has == built).map(|(name, _)| *name);
        Some(names.collect::<Vec<_>>().join(" ")).filter(|names| !names.is_empty())
    };
    let mut text = env!("CARGO_PKG_VERSION").to_owned();
    text += &format!("\nfeatures: {}", list(true).unwrap_or_else(|| "none".to_owned()));
    if let Some(names) = list(false) {
        text += &format!("\nnot in this build: {names}");
    }
    text += &format!("\nfor: {} {}", std::env::consts::ARCH, std::env::consts::OS);
    text.leak()
}

/// Parses the command line, or says what is wrong with it and ends.
fn parse(line: Vec<OsString>) -> Cli {
    let mut command = command();
    let matches =
        command.try_get_matches_from_mut(&line).unwrap_or_else(|error| plain(error, &line).exit());
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
}

/// An error of the command line with advice that helps: a value that begins with a dash is joined to
/// its flag, a file is no subcommand, and a gripper or a scene comes from somewhere.
fn plain(mut error: clap::Error, line: &[OsString]) -> clap::Error {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let text = |error: &clap::Error, kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    let advice = match error.kind() {
        ErrorKind::UnknownArgument => {
            let argument = text(&error, ContextKind::InvalidArg);
            let value = argument.strip_prefix('-').is_some_and(|rest| {
                rest.starts_with(|sign: char| sign.is_ascii_digit() || sign == '.')
            });
            error.remove(ContextKind::Suggested);
            match (value, apart(&argument, line)) {
                (true, _) => joined(&argument, line),
                (false, Some(text)) => format!("write a number and its unit as one word: {text}"),
                (false, None) => return error,
            }
        }
        ErrorKind::ValueValidation | ErrorKind::InvalidValue => {
            let flag = text(&error, ContextKind::InvalidArg);
            let start = format!("{}=", flag.split(' ').next().unwrap_or_default());
            let stands = |word: &OsString| word.to_string_lossy().starts_with(&start);
            if !line.iter().any(stands) || std::env::args_os().any(|word| stands(&word)) {
                return error;
            }
            format!("this value stands in {}", defaults::FILE)
        }
        ErrorKind::InvalidSubcommand
            if Path::new(&text(&error, ContextKind::InvalidSubcommand)).exists() =>
        {
            error.remove(ContextKind::Suggested);
            error.remove(ContextKind::SuggestedSubcommand);
            "say what to do with this file, e.g. gripfast plan PART --gripper generic --mass 350g, \
             or gripfast part PART"
                .to_owned()
        }
        ErrorKind::MissingRequiredArgument => {
            let missing = match error.get(ContextKind::InvalidArg) {
                Some(ContextValue::Strings(missing)) => missing.as_slice(),
                _ => &[],
            };
            let lacks = |flag: &str| missing.iter().any(|text| text.starts_with(flag));
            if lacks("--gripper") {
                "gripfast gripper list names the grippers that come with it, e.g. --gripper generic; \
                 gripfast gripper new FILE describes your own"
                    .to_owned()
            } else if lacks("--scene") {
                "a scene file says where the part lies and what stands around it: see docs/formats.md"
                    .to_owned()
            } else {
                return error;
            }
        }
        _ => return error,
    };
    let advice = clap::builder::StyledStr::from(advice);
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![advice]));
    error
}

/// A number and a unit that stand apart on the command line, as one word; `unit` is the second.
fn apart(unit: &str, line: &[OsString]) -> Option<String> {
    let known = Quantity::ALL.iter().any(|kind| kind.units().iter().any(|known| known.0 == unit));
    let words: Vec<_> = line.iter().map(|word| word.to_string_lossy()).collect();
    let pair = words.windows(2).find(|pair| pair[1] == unit && pair[0].parse::<f64>().is_ok())?;
    known.then(|| format!("{}{unit}", pair[0]))
}

/// How the value that was taken for the flag `argument` is joined to the flag before it.
fn joined(argument: &str, line: &[OsString]) -> String {
    let words: Vec<_> = line.iter().map(|word| word.to_string_lossy()).collect();
    let own = words.windows(2).find(|pair| {
        pair[0].starts_with("--") && !pair[0].contains('=') && pair[1].starts_with(argument)
    });
    let example = own.map_or("--mass=-350g".to_owned(), |pair| format!("{}={}", pair[0], pair[1]));
    format!("join a value that begins with a dash to its flag, e.g. {example}")
}

/// Parses the command line and runs the subcommand.
fn run() -> ExitCode {
    let outcome =
        defaults::apply(&command(), std::env::args_os().collect(), Path::new(defaults::FILE))
            .and_then(|line| match parse(line).command {
                Command::Part(args) => part::run(args),
                Command::Plan(args) => plan::run(*args),
                Command::Assess(args) => assess::run(*args),
                Command::Batch(args) => batch::run(*args),
                Command::Solve(args) => solve::run(args),
                Command::Why(args) => why::run(args),
                Command::Score(args) => score::run(args),
                Command::Devices(args) => devices::run(args),
                Command::Bench(args) => bench::run(args),
                Command::Report(args) => report::run(args),
                Command::Gripper(args) => gripper::run(args),
                Command::Figures(args) => figures::run(args),
                Command::Export(args) => export::run(*args),
                Command::Pick(args) => pick::run(args),
                Command::Completions(args) => shell::completions(args),
                Command::Man(args) => shell::man(args),
                #[cfg(feature = "step")]
                Command::StepKernel { memory, seconds } => step_kernel(memory, seconds),
            });
    match outcome {
        Ok(code) => code,
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::say(&format!("error: {}", flags::message(&error)));
            ExitCode::from(2)
        }
    }
}

/// STEP files are read in a process of their own: a fault of the CAD kernel is an error there.
#[cfg(feature = "step")]
fn step_apart() {
    /// Processor time for one file \[s\]; the largest files of our collection take some ten.
    const SECONDS: u64 = 600;
    if let Ok(program) = std::env::current_exe() {
        let arguments = vec![STEP_KERNEL.to_string()];
        gripfast::part::StepProcess { program, arguments, seconds: SECONDS }.install();
    }
}

#[cfg(feature = "step")]
fn step_kernel(memory: u64, seconds: u64) -> anyhow::Result<ExitCode> {
    let (input, output) = (std::io::stdin().lock(), std::io::stdout().lock());
    gripfast::part::serve_step(memory, seconds, input, output)?;
    Ok(ExitCode::SUCCESS)
}

/// Whether the reader of our output has gone (`gripfast .. | head`): no failure of ours.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let kind = |cause: &(dyn std::error::Error + 'static)| {
        let plain = cause.downcast_ref::<std::io::Error>().map(std::io::Error::kind);
        plain.or_else(|| cause.downcast_ref::<serde_json::Error>()?.io_error_kind())
    };
    error.chain().any(|cause| kind(cause) == Some(std::io::ErrorKind::BrokenPipe))
}

/// Without a desktop, Mesa's Vulkan layer that asks the display server for the preferred adapter
/// prints an error for every look at the adapters. gripfast ranks them itself, so the layer is
/// switched off there.
fn quiet_vulkan() {
    let absent = |name: &str| std::env::var_os(name).is_none();
    if cfg!(all(feature = "gpu", target_os = "linux"))
        && absent("XDG_RUNTIME_DIR")
        && absent("NODEVICE_SELECT")
    {
        #[allow(
            unsafe_code,
            reason = "the first statement of the program: no other thread reads the environment"
        )]
        unsafe {
            std::env::set_var("NODEVICE_SELECT", "1");
        }
    }
}

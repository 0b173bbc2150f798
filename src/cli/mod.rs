//! The command line: flags to options, options to calls of the library, answers to text. Thin.

mod gripper;
mod solve;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Finds and ranks every two-finger grip on a CAD part by the smallest friction coefficient that holds it.
#[derive(Debug, Parser)]
#[command(name = "gripfast", version, about, propagate_version = true)]
#[command(after_help = "EXIT CODES:\n  0  done    1  done, but nothing found    2  bad input, bad usage or a failed run")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Gripper(gripper::Args),
    Solve(solve::Args),
}

/// Parses the command line and runs the subcommand.
pub(crate) fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Gripper(args) => gripper::run(args),
        Command::Solve(args) => solve::run(args),
    };
    match outcome {
        Ok(code) => code,
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Whether the reader of our output has gone (`gripfast .. | head`): no failure of ours.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().filter_map(|cause| cause.downcast_ref::<std::io::Error>()).any(|cause| cause.kind() == std::io::ErrorKind::BrokenPipe)
}

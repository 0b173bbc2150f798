//! The command line: flags to options, options to calls of the library, answers to text. Thin.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Finds and ranks every two-finger grip on a CAD part by the smallest friction coefficient that holds it.
#[derive(Debug, Parser)]
#[command(name = "gripfast", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Prints the version and what this build can do.
    Version,
}

/// Parses the command line and runs the subcommand.
pub(crate) fn main() -> ExitCode {
    let outcome: anyhow::Result<ExitCode> = match Cli::parse().command {
        Command::Version => {
            println!("gripfast {}", env!("CARGO_PKG_VERSION"));
            Ok(ExitCode::SUCCESS)
        }
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

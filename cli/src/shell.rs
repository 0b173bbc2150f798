//! `gripfast completions` and `gripfast man`: for the shell and the manual.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args as ClapArgs;

/// Prints a shell's completion script.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast completions bash > ~/.local/share/bash-completion/completions/gripfast\n  gripfast completions zsh > ~/.zfunc/_gripfast"
)]
pub(crate) struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

/// Writes the manual pages, one for each subcommand.
#[derive(Debug, ClapArgs)]
#[command(after_help = "EXAMPLES:\n  gripfast man ~/.local/share/man/man1 && man gripfast")]
pub(crate) struct ManArgs {
    /// Folder to write into.
    folder: PathBuf,
}

pub(crate) fn completions(args: CompletionsArgs) -> anyhow::Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut super::command(), "gripfast", &mut script);
    std::io::stdout().write_all(&script)?;
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn man(args: ManArgs) -> anyhow::Result<ExitCode> {
    let failed = |error: std::io::Error| {
        gripfast::error::Error::io(&args.folder, "write manual pages into", error)
    };
    std::fs::create_dir_all(&args.folder).map_err(failed)?;
    clap_mangen::generate_to(super::command(), &args.folder).map_err(failed)?;
    writeln!(std::io::stdout(), "manual pages written to {}", args.folder.display())?;
    Ok(ExitCode::SUCCESS)
}

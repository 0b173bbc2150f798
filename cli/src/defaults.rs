//! `gripfast.toml`: a project's own defaults, one table for each subcommand, keys named as the
//! flags.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Context, bail};
use clap::Command;

/// Name of the file, looked for in the current folder.
pub(crate) const FILE: &str = "gripfast.toml";

/// The command line with the file's flags put right after the subcommand, less those that the user
/// gives.
pub(crate) fn apply(
    command: &Command,
    arguments: Vec<OsString>,
    file: &Path,
) -> anyhow::Result<Vec<OsString>> {
    let text = match std::fs::read_to_string(file) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(arguments),
        Err(error) => {
            return Err(error).with_context(|| format!("{}: cannot read", file.display()));
        }
    };
    let table: toml::Table =
        text.parse().map_err(|error| anyhow::anyhow!("{}: {error}", file.display()))?;
    for name in table.keys() {
        if command.find_subcommand(name).is_none() {
            let known: Vec<_> = command.get_subcommands().map(Command::get_name).collect();
            bail!(
                "{}: [{name}] is no subcommand; use one of: {}",
                file.display(),
                known.join(", ")
            );
        }
    }
    let Some(place) = arguments
        .iter()
        .skip(1)
        .position(|argument| !argument.to_string_lossy().starts_with('-'))
        .map(|index| index + 1)
    else {
        return Ok(arguments);
    };
    let name = arguments[place].to_string_lossy().into_owned();
    // A stored request is whole: the project's defaults would change it.
    if arguments[place + 1..].iter().any(|argument| {
        let text = argument.to_string_lossy();
        text == "--request" || text.starts_with("--request=")
    }) {
        return Ok(arguments);
    }
    let (Some(subcommand), Some(defaults)) = (command.find_subcommand(&name), table.get(&name))
    else {
        return Ok(arguments);
    };
    let Some(defaults) = defaults.as_table() else {
        bail!("{}: [{name}] is not a table", file.display())
    };
    let given = given(command, &arguments);
    let mut flags = Vec::new();
    for (key, value) in defaults {
        let at = || format!("{}: [{name}] {key}", file.display());
        let Some(flag) = subcommand.get_arguments().find(|flag| flag.get_long() == Some(key))
        else {
            bail!("{}: `{name}` has no flag --{key}; see `gripfast {name} --help`", at());
        };
        if given.iter().any(|id| id == flag.get_id().as_str()) {
            continue;
        }
        // A list gives the flag once for each of its values.
        for value in value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice) {
            match value {
                toml::Value::Boolean(true) => flags.push(format!("--{key}")),
                toml::Value::Boolean(false) => {}
                toml::Value::String(text) => flags.push(format!("--{key}={text}")),
                toml::Value::Integer(number) => flags.push(format!("--{key}={number}")),
                toml::Value::Float(number) => flags.push(format!("--{key}={number}")),
                _ => bail!("{}: give a text, a number, true, false, or a list of these", at()),
            }
        }
    }
    let mut out = arguments;
    out.splice(place + 1..place + 1, flags.into_iter().map(OsString::from));
    Ok(out)
}

/// The flags that stand on a command line, by their ids; of one that is wrong, those before the
/// mistake.
fn given(command: &Command, line: &[OsString]) -> Vec<String> {
    let parsed = command.clone().ignore_errors(true).try_get_matches_from(line);
    let Ok(matches) = parsed else { return Vec::new() };
    let Some((_, matches)) = matches.subcommand() else { return Vec::new() };
    let typed = |id: &&clap::Id| {
        matches.value_source(id.as_str()) == Some(clap::parser::ValueSource::CommandLine)
    };
    matches.ids().filter(typed).map(ToString::to_string).collect()
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn applied(text: &str, line: &str) -> anyhow::Result<Vec<String>> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join(FILE);
        std::fs::write(&file, text)?;
        let line = line.split(' ').map(OsString::from).collect();
        Ok(apply(&super::super::Cli::command(), line, &file)?
            .into_iter()
            .map(|part| part.to_string_lossy().into_owned())
            .collect())
    }

    #[test]
    fn flags_of_the_file_stand_before_those_of_the_user() {
        let got =
            applied("[solve]\njson = true\nsafety = 2\n", "gripfast solve case.json --safety 3")
                .unwrap();
        assert_eq!(got, ["gripfast", "solve", "--json", "case.json", "--safety", "3"]);
        use clap::Parser;
        assert!(super::super::Cli::try_parse_from(got).is_ok());
        // A short name is the same flag, also where it stands several times in the file.
        let got =
            applied("[plan]\ngripper = [\"a\", \"b\"]\nmass = \"1kg\"\n", "gripfast plan x -gc");
        assert_eq!(got.unwrap(), ["gripfast", "plan", "--mass=1kg", "x", "-gc"]);
    }

    #[test]
    fn a_flag_given_twice_is_refused() {
        use clap::Parser;
        for line in [
            "gripfast plan x -g a --com 1mm,0mm,0mm --com 2mm,0mm,0mm",
            "gripfast plan x -g a --mass 1kg --spacing 1mm --spacing 2mm",
            "gripfast export g.json -o a.csv -o b.csv",
        ] {
            let error = super::super::Cli::try_parse_from(line.split(' ')).unwrap_err();
            assert!(error.to_string().contains("multiple times"), "{error}");
        }
    }

    #[test]
    fn a_list_repeats_its_flag() {
        let got = applied("[plan]\nkeep-out = [\"a\", \"b\"]\n", "gripfast plan x").unwrap();
        assert_eq!(got, ["gripfast", "plan", "--keep-out=a", "--keep-out=b", "x"]);
        assert!(
            applied("[plan]\nkeep-out = [[1]]\n", "gripfast plan x")
                .unwrap_err()
                .to_string()
                .contains("keep-out")
        );
    }

    #[test]
    fn unknown_keys_are_refused_by_name() {
        assert!(
            applied("[solve]\nfrce = 1\n", "gripfast solve x")
                .unwrap_err()
                .to_string()
                .contains("frce")
        );
        assert!(
            applied("[slove]\n", "gripfast solve x").unwrap_err().to_string().contains("slove")
        );
    }
}

//! `gripfast bench entry`: what the parts of `benches/device.sh` found, as one dated entry for
//! `benches/RESULTS.md`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args as ClapArgs;
use serde_json::{Value, json};

use super::write_both;

/// Puts what the other parts wrote into a folder together as `entry.md` and `entry.json`; parts
/// that are not there are said to be missing.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast bench entry --out target/device --date 2026-11-26 --commit 1a2b3c4"
)]
pub(crate) struct Args {
    /// Folder that the parts wrote to.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Day of the run.
    #[arg(long)]
    date: String,
    /// Commit that the program was built from.
    #[arg(long, default_value = "unknown")]
    commit: String,
    /// How a part ended, as NAME=WORDS; repeated.
    #[arg(long, value_name = "NAME=WORDS")]
    ended: Vec<String>,
}

/// Titles of the parts, in order.
const PARTS: [(&str, &str); 5] = [
    ("devices", "The adapter"),
    ("check", "Kernels and batches"),
    ("suite", "The test suite of both backends"),
    ("sweep", "Rates"),
    ("commands", "Whole commands"),
];

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let read = |name: &str| std::fs::read_to_string(args.out.join(name)).ok();
    let data = |name: &str| -> Value {
        read(&format!("{name}.json"))
            .and_then(|text| serde_json::from_str(&text).ok())
            .unwrap_or(Value::Null)
    };
    let parts: Vec<(&str, Value)> = ["devices", "check", "sweep", "commands"]
        .map(|name| (name, data(name)))
        .into_iter()
        .collect();
    let adapter = parts
        .iter()
        .find_map(|(_, value)| value["adapter"].as_str())
        .unwrap_or("no adapter")
        .to_owned();
    let software = parts.iter().any(|(_, value)| value["software_adapter"] == true);
    let machine = Machine::here();
    let suite = read("suite.log").map(|log| suite(&log));
    let ended: Vec<(&str, &str)> =
        args.ended.iter().filter_map(|text| text.split_once('=')).collect();
    let mut text = format!("## {}, {adapter}, {}\n\n", args.date, machine.words());
    if software {
        text += "**The adapter is software: this entry shows that everything runs and gives right \
answers. Its times say nothing about speed.**\n\n";
    }
    let _ = writeln!(
        text,
        "gripfast {}, commit {}; `bash benches/device.sh`.",
        env!("CARGO_PKG_VERSION"),
        args.commit
    );
    for (name, title) in PARTS {
        let _ = write!(text, "\n### {title}\n\n");
        if let Some((_, words)) = ended.iter().find(|(part, _)| *part == name) {
            let _ = write!(text, "Ended: {words}.\n\n");
        }
        let body = match name {
            "devices" => devices(&parts[0].1, &adapter),
            "suite" => suite.as_ref().map(|suite| suite.markdown()),
            _ => read(&format!("{name}.md")),
        };
        text += body.as_deref().unwrap_or("Not run.\n");
    }
    let whole = json!({
        "date": args.date,
        "commit": args.commit,
        "gripfast": env!("CARGO_PKG_VERSION"),
        "adapter": adapter,
        "software_adapter": software,
        "machine": machine,
        "ended": ended.iter().map(|(part, words)| json!({ "part": part, "words": words })).collect::<Vec<_>>(),
        "suite": suite,
        "parts": parts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect::<serde_json::Map<_, _>>(),
    });
    write_both(&args.out, "entry", &text, &whole)?;
    Ok(ExitCode::SUCCESS)
}

/// The adapters as a table, that which was measured in bold.
fn devices(list: &Value, measured: &str) -> Option<String> {
    let list = list.as_array()?;
    let mut text = String::from(
        "| | type | interface, driver | largest binding | workgroup | subgroup | timestamps |\n\
|---|---|---|---|---|---|---|\n",
    );
    for one in list {
        let word = |key: &str| one[key].as_str().unwrap_or_default();
        let number = |key: &str| one[key].as_u64().unwrap_or(0);
        let bold = if measured.starts_with(word("name")) { "**" } else { "" };
        let times = match (one["timestamp_period"].as_f64(), &one["timestamps_of_copies"]) {
            (Some(period), Value::Bool(true)) => format!("{period} ns, copies too"),
            (Some(period), _) => format!("{period} ns, kernels only"),
            (None, _) => "none".to_owned(),
        };
        let _ = writeln!(
            text,
            "| {bold}{}{bold} | {} | {}, {} | {} MiB | {} lanes, {} KiB | {} to {}{} | {times} |",
            word("name"),
            word("kind"),
            word("api"),
            word("driver"),
            number("max_binding") >> 20,
            number("max_invocations"),
            number("workgroup_memory") >> 10,
            one["subgroup"][0],
            one["subgroup"][1],
            if one["subgroup_operations"] == true { ", exchange" } else { "" },
        );
    }
    Some(text)
}

/// What a test binary said.
#[derive(Debug, PartialEq, serde::Serialize)]
struct Suite {
    passed: Vec<String>,
    failed: Vec<String>,
    /// Lines that say what was skipped, and what the suite measured.
    said: Vec<String>,
    /// Whether it came to its end.
    complete: bool,
}

/// Reads the log of a test binary.
fn suite(log: &str) -> Suite {
    let mut found = Suite { passed: vec![], failed: vec![], said: vec![], complete: false };
    for line in log.lines() {
        let test = line.strip_prefix("test ").and_then(|rest| rest.split_once(" ... "));
        match test {
            Some((name, "ok")) => found.passed.push(name.to_owned()),
            Some((name, "FAILED")) => found.failed.push(name.to_owned()),
            _ => {}
        }
        found.complete |= line.starts_with("test result:");
        if line.contains("SKIPPED") && !found.said.iter().any(|said| said == line) {
            found.said.push(line.to_owned());
        }
    }
    found
}

impl Suite {
    fn markdown(&self) -> String {
        let mut text = format!("{} tests passed, {} failed", self.passed.len(), self.failed.len());
        text += if self.complete { ".\n" } else { "; cut off before the end.\n" };
        for name in &self.failed {
            let _ = writeln!(text, "- **FAILED**: {name}");
        }
        for line in &self.said {
            let _ = writeln!(text, "- {line}");
        }
        text
    }
}

/// The machine, as far as /proc tells.
#[derive(Debug, serde::Serialize)]
struct Machine {
    processor: String,
    cores: usize,
    memory_gib: Option<f64>,
    system: String,
}

impl Machine {
    fn here() -> Self {
        let read = |path: &str| std::fs::read_to_string(Path::new(path)).unwrap_or_default();
        let line = |text: &str, key: &str| {
            let line = text.lines().find(|line| line.starts_with(key))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        };
        let memory = line(&read("/proc/meminfo"), "MemTotal").and_then(|text| {
            let kibibytes: f64 = text.split_whitespace().next()?.parse().ok()?;
            Some((kibibytes / f64::from(1 << 20) * 10.0).round() / 10.0)
        });
        let release = read("/proc/sys/kernel/osrelease");
        Self {
            processor: line(&read("/proc/cpuinfo"), "model name")
                .unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_gib: memory,
            system: format!("{} {}", std::env::consts::OS, release.trim()),
        }
    }

    fn words(&self) -> String {
        let memory = self.memory_gib.map_or_else(String::new, |gib| format!(", {gib} GiB"));
        format!("{} cores of {}{memory}, {}", self.cores, self.processor, self.system)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_of_a_test_binary_is_read() {
        let log = "running 3 tests\ntest cpu::batch_sizes ... ok\nSKIPPED: no data\n\
SKIPPED: no data\ntest gpu::batch_sizes ... FAILED\n\ntest result: FAILED. 1 passed";
        let found = suite(log);
        assert_eq!(
            (found.passed.len(), found.failed.as_slice()),
            (1, &["gpu::batch_sizes".to_owned()][..])
        );
        assert_eq!(found.said, ["SKIPPED: no data"]);
        assert!(found.complete && !suite("test cpu::a ... ok\n").complete);
        assert!(found.markdown().contains("**FAILED**: gpu::batch_sizes"));
    }
}

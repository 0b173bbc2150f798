//! `gripfast bench commands`: whole runs of `gripfast plan` on processor and adapter, compared.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args as ClapArgs;
use gripfast::backend::{Backend, Choice, select};
use gripfast::part::{Part, ReadOptions};
use serde::Serialize;
use serde_json::Value;

use super::Output;
use super::workloads::ANSWER_TOLERANCE;

/// Times whole plans on the processor and on the adapter and compares the result files: the
/// README's, a dense one on a shipped part, one on a refined part of a million triangles.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast bench commands\n  gripfast bench commands --adapter llvmpipe --parts data/parts --seconds 60 --out results\n\n\
The spacing of the dense plans comes from the time that coarse ones take."
)]
pub(crate) struct Args {
    /// cpu: without an adapter.
    #[arg(long, default_value = "gpu", value_name = "auto|cpu|gpu")]
    backend: Choice,
    /// Graphics adapter, by its number or part of its name [default: GRIPFAST_ADAPTER, or the first
    /// that counts as a GPU].
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// Folder of the shipped parts.
    #[arg(long, value_name = "FOLDER", default_value = "data/parts")]
    parts: PathBuf,
    /// Triangles of the refined part, at least.
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    triangles: usize,
    /// Seconds that it may take, about.
    #[arg(long, value_name = "S", default_value_t = 150.0)]
    seconds: f64,
    #[command(flatten)]
    output: Output,
}

/// A plan on one or both backends.
#[derive(Debug, Serialize)]
struct Row {
    what: String,
    command: String,
    triangles: Option<usize>,
    candidates: Option<u64>,
    grips: Option<usize>,
    cpu_seconds: Option<f64>,
    gpu_seconds: Option<f64>,
    /// Largest relative difference of a number that ranks; `None` when not compared.
    difference: Option<f64>,
    /// What went wrong, or why it was left out.
    problem: Option<String>,
    failed: bool,
}

#[derive(Debug, Serialize)]
struct Report {
    adapter: Option<String>,
    software_adapter: bool,
    rows: Vec<Row>,
    complete: bool,
}

struct Runner<'a> {
    args: &'a Args,
    gpu: bool,
    folder: tempfile::TempDir,
    start: Instant,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let selection = select(args.backend, args.adapter.as_deref())?;
    let mut report =
        Report { adapter: None, software_adapter: false, rows: Vec::new(), complete: false };
    #[cfg(feature = "gpu")]
    if let Backend::Gpu(gpu) = &selection.backend {
        report.adapter = Some(gpu.name());
        report.software_adapter = gpu.is_software();
    }
    let gpu = !matches!(selection.backend, Backend::Cpu);
    drop(selection);
    let folder = tempfile::tempdir().context("a folder for the results of the plans")?;
    let runner = Runner { args: &args, gpu, folder, start: Instant::now() };
    // The plans run in another folder.
    let parts = args.parts.canonicalize().with_context(|| {
        format!(
            "{}: no such folder; name that of the shipped parts with --parts",
            args.parts.display()
        )
    })?;
    let bracket = parts.join("l_bracket.stl");
    let readme =
        ["--gripper", "robotiq-2f85", "--mass", "350g", "--accel", "2g"].map(str::to_owned);
    let mut failed = false;
    let mut note = |row: Row, report: &mut Report| -> anyhow::Result<()> {
        failed |= row.failed;
        report.rows.push(row);
        args.output.write("commands", &report.markdown(), report, false)
    };
    let readme = runner.plan("README's plan", &bracket, &readme);
    note(readme, &mut report)?;
    let dense: Vec<String> = ["--gripper", "robotiq-2f85", "--mass", "350g", "--loads", "ball:500"]
        .map(str::to_owned)
        .into();
    for row in runner.dense("dense plan, shipped part", &bracket, &dense, 0.5) {
        note(row, &mut report)?;
    }
    let fine = runner.folder.path().join("refined.stl");
    let bar = parts.join("t_slot_bar.stl");
    let triangles = refine(&bar, args.triangles, &fine)?;
    let large: Vec<String> =
        ["--gripper", "generic", "--density", "2700kg/m3", "--loads", "ball:500:5N"]
            .map(str::to_owned)
            .into();
    for mut row in runner.dense("dense plan, refined part", &fine, &large, 1.0) {
        row.triangles = Some(triangles);
        note(row, &mut report)?;
    }
    report.complete = true;
    args.output.write("commands", &report.markdown(), &report, true)?;
    anyhow::ensure!(!failed, "a plan failed or the backends disagree: see the report");
    Ok(ExitCode::SUCCESS)
}

impl Runner<'_> {
    fn rest(&self) -> f64 {
        self.args.seconds - self.start.elapsed().as_secs_f64()
    }

    /// A coarse plan, then one as dense as `share` of the rest of the time allows.
    fn dense(&self, what: &str, part: &Path, flags: &[String], share: f64) -> Vec<Row> {
        let coarse = 8.0;
        let with = |spacing: f64| {
            let more = ["--spacing".to_owned(), format!("{spacing:.2}mm")];
            [flags, &more].concat()
        };
        let time = |row: &Row| row.cpu_seconds.unwrap_or(0.0).max(row.gpu_seconds.unwrap_or(0.0));
        let first = self.plan(&format!("{what}, coarse"), part, &with(coarse));
        let seconds = time(&first);
        let runs = if self.gpu { 2.0 } else { 1.0 };
        let target = 0.6 * share * self.rest() / runs;
        let mut rows = vec![first];
        if rows[0].failed || seconds == 0.0 {
            return rows;
        }
        // Candidates grow with the square of the grid; half of it at a time, to see what is fixed.
        let mut spacing = coarse;
        while seconds > 0.0 && spacing > 0.25 {
            let (known, last) = (time(&rows[rows.len() - 1]), spacing);
            spacing = (last * (known / target).sqrt()).clamp(0.2, last);
            spacing = spacing.max(last / 4.0);
            if spacing > 0.8 * last || self.rest() < 4.0 * known {
                break;
            }
            let row = self.plan(what, part, &with(spacing));
            let failed = row.failed;
            rows.push(row);
            if failed {
                break;
            }
        }
        rows
    }

    /// The plan on the processor and then on the adapter.
    fn plan(&self, what: &str, part: &Path, flags: &[String]) -> Row {
        let name = part.file_name().map(|name| name.to_string_lossy().into_owned());
        let mut row = Row {
            what: what.to_owned(),
            command: format!("gripfast plan {} {}", name.unwrap_or_default(), flags.join(" ")),
            triangles: None,
            candidates: None,
            grips: None,
            cpu_seconds: None,
            gpu_seconds: None,
            difference: None,
            problem: None,
            failed: false,
        };
        if self.rest() < 1.0 {
            row.problem = Some("no time".to_owned());
            return row;
        }
        let outcome = self.both(&mut row, part, flags);
        if let Err(error) = outcome {
            row.failed = !error.to_string().starts_with(NO_TIME);
            row.problem = Some(error.to_string().replace('\n', " "));
        }
        row
    }

    fn both(&self, row: &mut Row, part: &Path, flags: &[String]) -> anyhow::Result<()> {
        let on_cpu = self.folder.path().join("cpu.json");
        row.cpu_seconds = Some(self.once(part, flags, "cpu", &on_cpu)?);
        let expected = read(&on_cpu)?;
        row.candidates = expected["summary"]["candidates"].as_u64();
        row.grips = expected["grips"].as_array().map(Vec::len);
        if self.gpu {
            let on_gpu = self.folder.path().join("gpu.json");
            row.gpu_seconds = Some(self.once(part, flags, "gpu", &on_gpu)?);
            row.difference = Some(same(&expected, &read(&on_gpu)?)?);
        }
        Ok(())
    }

    /// One run of the program; its seconds.
    fn once(
        &self,
        part: &Path,
        flags: &[String],
        backend: &str,
        out: &Path,
    ) -> anyhow::Result<f64> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("plan").arg(part).args(flags).args(["--backend", backend, "-q", "-o"]).arg(out);
        if let (Some(adapter), "gpu") = (&self.args.adapter, backend) {
            command.args(["--adapter", adapter]);
        }
        if backend == "cpu" {
            command.env_remove("GRIPFAST_ADAPTER").env_remove("WGPU_ADAPTER_NAME");
        }
        let errors = self.folder.path().join("errors.txt");
        // No gripfast.toml of the current folder.
        command
            .current_dir(self.folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(&errors)?);
        let begin = Instant::now();
        let mut child = command.spawn()?;
        let limit = self.rest();
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break status;
            }
            if begin.elapsed().as_secs_f64() > limit {
                child.kill()?;
                child.wait()?;
                anyhow::bail!("{NO_TIME} {backend}: stopped after {limit:.0} s");
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let seconds = begin.elapsed().as_secs_f64();
        let said = std::fs::read_to_string(&errors).unwrap_or_default();
        anyhow::ensure!(status.success(), "{backend}: {status}: {}", said.trim());
        Ok(seconds)
    }
}

/// Begins the word on a run that was stopped because the time was over.
const NO_TIME: &str = "no time:";

fn read(path: &Path) -> anyhow::Result<Value> {
    let file = std::fs::File::open(path).with_context(|| format!("{}", path.display()))?;
    Ok(serde_json::from_reader(std::io::BufReader::new(file))?)
}

/// Numbers of a grip that two backends must agree on, as paths in the result file.
const NUMBERS: [&str; 4] = ["/worst/mu_s", "/score", "/force_needed", "/load_multiple"];

/// Largest relative difference between the grips of two results, which must be in the same order.
fn same(a: &Value, b: &Value) -> anyhow::Result<f64> {
    let grips = |value: &Value| value["grips"].as_array().cloned().unwrap_or_default();
    let (a, b) = (grips(a), grips(b));
    anyhow::ensure!(
        a.len() == b.len(),
        "{} grips on the processor, {} on the adapter",
        a.len(),
        b.len()
    );
    anyhow::ensure!(!a.is_empty(), "no grip to compare");
    let (mut most, mut compared) = (0.0_f64, 0_usize);
    for (place, (a, b)) in a.iter().zip(&b).enumerate() {
        let place = place + 1;
        for key in ["/id", "/worst/load", "/worst/status"] {
            let (x, y) = (a.pointer(key), b.pointer(key));
            anyhow::ensure!(
                x == y,
                "rank {place}: {key} is {x:?} on the processor, {y:?} on the adapter"
            );
        }
        for key in NUMBERS {
            let (x, y) = (a.pointer(key), b.pointer(key));
            let (Some(x), Some(y)) = (x.and_then(Value::as_f64), y.and_then(Value::as_f64)) else {
                anyhow::ensure!(
                    x == y,
                    "rank {place}: {key} is {x:?} on the processor, {y:?} on the adapter"
                );
                continue;
            };
            compared += 1;
            let apart = if x == y { 0.0 } else { (x - y).abs() / x.abs().max(y.abs()) };
            anyhow::ensure!(
                apart <= ANSWER_TOLERANCE,
                "rank {place}: {key} is {x} on the processor, {y} on the adapter"
            );
            most = most.max(apart);
        }
    }
    anyhow::ensure!(compared >= a.len(), "the result files have no numbers to compare");
    Ok(most)
}

/// Writes the part with every triangle split in four, as often as `least` triangles need, as binary
/// STL in millimetres. Gives the number of triangles.
fn refine(part: &Path, least: usize, path: &Path) -> anyhow::Result<usize> {
    fn split(corners: [glam::Vec3; 3], times: u32, out: &mut impl Write) -> std::io::Result<()> {
        let [a, b, c] = corners;
        if times == 0 {
            out.write_all(&[0; 12])?;
            for number in [a, b, c].iter().flat_map(|corner| corner.to_array()) {
                out.write_all(&number.to_le_bytes())?;
            }
            return out.write_all(&[0, 0]);
        }
        let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            split(part, times - 1, out)?;
        }
        Ok(())
    }
    let mesh = Part::read(part, &ReadOptions::default())?.mesh;
    let mut times = 0;
    while mesh.triangles.len() << (2 * times) < least {
        times += 1;
    }
    let count = mesh.triangles.len() << (2 * times);
    let header = u32::try_from(count).context("too many triangles for an STL file")?;
    gripfast::file::write(path, |out| {
        out.write_all(&[b' '; 80])?;
        out.write_all(&header.to_le_bytes())?;
        (0..mesh.triangles.len() as u32).try_for_each(|index| {
            split(mesh.corners(index).map(|corner| (corner * 1e3).as_vec3()), times, out)
        })
    })?;
    Ok(count)
}

impl Report {
    fn markdown(&self) -> String {
        let mut text = String::from("Whole commands by the clock");
        if self.software_adapter {
            text += "; **the adapter is software: its figures say nothing about speed**";
        }
        text += ".\n\n| what | command | triangles | candidates | grips kept | cpu | gpu | cpu over \
gpu | apart |\n|---|---|---|---|---|---|---|---|---|\n";
        for row in &self.rows {
            let seconds = |s: Option<f64>| s.map_or_else(String::new, |s| format!("{s:.2} s"));
            let count = |n: Option<u64>| n.map_or_else(String::new, |n| n.to_string());
            let ratio = row.cpu_seconds.zip(row.gpu_seconds).map(|(cpu, gpu)| cpu / gpu);
            let apart = match (&row.problem, row.difference) {
                (Some(why), _) if row.failed => format!("**FAILED**: {why}"),
                (Some(why), _) => why.clone(),
                (None, Some(most)) => format!("{most:.0e}, same order"),
                (None, None) => String::new(),
            };
            let _ = writeln!(
                text,
                "| {} | `{}` | {} | {} | {} | {} | {} | {} | {apart} |",
                row.what,
                row.command,
                count(row.triangles.map(|n| n as u64)),
                count(row.candidates),
                count(row.grips.map(|n| n as u64)),
                seconds(row.cpu_seconds),
                seconds(row.gpu_seconds),
                ratio.map_or_else(String::new, |ratio| format!("{ratio:.2}")),
            );
        }
        if !self.complete {
            text += "\nCut off: there is more to run.\n";
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn results_are_compared_number_by_number_and_in_order() {
        let grip = |id: u64, mu: f64| json!({ "id": id, "score": 1.0 / mu, "worst": { "load": 3, "status": "ok", "mu_s": mu } });
        let set = |grips: &[Value]| json!({ "grips": grips });
        let right = set(&[grip(7, 0.1), grip(3, 0.2)]);
        assert_eq!(same(&right, &right).unwrap(), 0.0);
        let close = set(&[grip(7, 0.1 * (1.0 + 1e-11)), grip(3, 0.2)]);
        assert!((5e-12..2e-11).contains(&same(&right, &close).unwrap()));
        for wrong in [
            set(&[grip(7, 0.1 * (1.0 + 1e-8)), grip(3, 0.2)]),
            set(&[grip(3, 0.2), grip(7, 0.1)]),
            set(&[grip(7, 0.1)]),
            json!({ "grips": [{ "id": 7 }, { "id": 3 }] }),
        ] {
            assert!(same(&right, &wrong).is_err(), "{wrong}");
        }
        assert!(same(&set(&[]), &set(&[])).is_err());
    }

    #[test]
    fn a_refined_part_keeps_its_surface() {
        let folder = tempfile::tempdir().unwrap();
        let (coarse, fine) = (
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/parts/hex_nut.stl"),
            folder.path().join("fine.stl"),
        );
        let before = Part::read(&coarse, &ReadOptions::default()).unwrap();
        let count = refine(&coarse, 4 * before.mesh.triangles.len(), &fine).unwrap();
        assert_eq!(count, 4 * before.mesh.triangles.len());
        let after = Part::read(&fine, &ReadOptions::default()).unwrap();
        assert_eq!(after.mesh.triangles.len(), count);
        let area = |part: &Part| -> f64 {
            (0..part.mesh.triangles.len() as u32)
                .map(|index| {
                    let [a, b, c] = part.mesh.corners(index);
                    (b - a).cross(c - a).length() / 2.0
                })
                .sum()
        };
        assert!((area(&after) / area(&before) - 1.0).abs() < 1e-5);
    }
}

//! `gripfast score`: many given contact pairs under many loads, one line of JSON per grip.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use glam::{DMat3, DVec3};
use gripfast::backend::{
    Backend, Batch, CurvedProblem, Pose, Problem, ScoreOptions, Scored, SeedSet, score_curved,
};
use gripfast::error::Error;
use gripfast::load::{LoadSet, wrench_in_grip};
use gripfast::mechanics::curved;
use gripfast::model::{Contact, Score, Wrench};
use gripfast::part::MassProperties;
use gripfast::request::{Polish, Refiner, Separation};
use gripfast::results::{FORMAT, GripSet};
use gripfast::units::Quantity;
use serde_json::Value;

use super::backend::{self, BackendArgs};

/// Scores many contact pairs under many loads: the worst load of each and the friction coefficient
/// it needs.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast score pairs.jsonl --loads ball:500 > scores.jsonl\n  gripfast score pairs.json --loads wrenches.csv --polish all -o scores.jsonl\n  gripfast score grips.json --loads gravity,ball:200\n\n\
GRIPS is a list of contact pairs as `gripfast solve` reads them (JSON or JSON Lines; JSON Lines are read as they come, so the file may be\n\
larger than memory), or a result file of `gripfast plan`. A contact pair may carry \"loads\":[{\"F\":[..],\"M\":[..]},..] of its own instead of F and M.\n\n\
--loads are meant in the grip frame about its origin for contact pairs, in the part frame about the centre of mass for a result file."
)]
pub(crate) struct Args {
    /// Contact pairs or a result file; `-` for standard input.
    grips: PathBuf,
    /// Loads on every grip: a CSV or JSON list of wrenches, `ball:N` and what else `plan` takes.
    /// Default: the file's own.
    #[arg(long, value_name = "FILE|SET")]
    loads: Option<String>,
    /// Gripping force, e.g. 80N. Default: the file's own.
    #[arg(long, value_name = "FORCE")]
    force: Option<String>,
    /// Which loads are solved exactly: those that can be the worst, or all (then `mu_by_load` is in
    /// the output).
    #[arg(long, value_parser = words!(Polish, ["worst", "all"]), default_value_t)]
    polish: Polish,
    /// Pads that separate under a load: solve with the contact left, or discard as the paper does.
    #[arg(long, value_parser = words!(Separation), default_value_t)]
    separation: Separation,
    /// Minimiser that polishes the solution.
    #[arg(long, value_parser = words!(Refiner), default_value_t)]
    refiner: Refiner,
    #[command(flatten)]
    backend: BackendArgs,
    /// Output file, written whole or not at all. Default: standard output.
    #[arg(short, long, value_name = "FILE.jsonl")]
    output: Option<PathBuf>,
    /// Threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// No summary on standard error.
    #[arg(long, short)]
    quiet: bool,
}

/// Grips scored at a time, fewer when they have many loads: what bounds the memory.
const BLOCK_GRIPS: usize = 4096;
const BLOCK_LOADS: usize = 1 << 20;

/// A grip to score.
struct Entry {
    id: Option<Value>,
    contact: Arc<Contact>,
    /// What is touched, where it is not plane.
    surfaces: Option<curved::Pads>,
    distance: f64,
    force: f64,
    wrenches: Wrenches,
}

enum Wrenches {
    Own(Vec<Wrench>),
    /// Those on the part, which all grips of a result share.
    OnPart(Arc<[Wrench]>, Pose),
    Common,
}

/// One line of the answer.
#[derive(serde::Serialize)]
struct Line<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<&'a Value>,
    /// Place of the grip in the input, from 0.
    index: u64,
    /// The worst load, from 0.
    load: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    load_name: Option<&'a str>,
    #[serde(flatten)]
    score: Score,
    /// Loads solved exactly.
    solved: usize,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    mu_by_load: Vec<Option<f64>>,
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let threads = backend::pool(args.threads)?;
    let selection = args.backend.select()?;
    let seeds = args.backend.seed_set()?;
    let force =
        args.force.as_deref().map(|text| Quantity::Force.parse("--force", text)).transpose()?;
    let name = args.grips.display().to_string();
    let mut input: Box<dyn BufRead> = if args.grips == Path::new("-") {
        Box::new(BufReader::new(std::io::stdin().lock()))
    } else {
        Box::new(BufReader::new(
            File::open(&args.grips).map_err(|error| Error::io(&args.grips, "read", error))?,
        ))
    };
    let source = Source::open(&mut *input, &name)?;
    let (source, mass) = match source {
        Source::Result(set) => {
            let mass = set.part.mass;
            (Source::Result(set), mass)
        }
        // Loads in the grip frame: as if the centre of mass were the grip's origin. What needs a
        // mass is refused.
        other => (
            other,
            MassProperties {
                volume: 0.0,
                mass: f64::NAN,
                centre_of_mass: DVec3::ZERO,
                inertia: DMat3::ZERO,
            },
        ),
    };
    let common = args
        .loads
        .as_deref()
        .map(|text| LoadSet::parse("--loads", text)?.cases(&mass))
        .transpose()?;
    let (names, common): (Vec<String>, Vec<Wrench>) =
        common.unwrap_or_default().into_iter().map(|case| (case.name, case.wrench)).unzip();
    let options =
        ScoreOptions { polish: args.polish, separation: args.separation, refiner: args.refiner };
    let job = Job {
        threads: &threads,
        backend: &selection.backend,
        seeds: &seeds,
        options,
        names: &names,
        common: &common,
        given: args.loads.is_some(),
        force,
        name: &name,
    };
    if !args.quiet {
        crate::terminal::say(&format!("backend {}", selection.reason));
    }
    let started = Instant::now();
    let mut counts = Counts::default();
    match &args.output {
        Some(path) => {
            // The closure's own error type is that of the operating system; ours is kept beside it.
            let mut failure = None;
            let written = gripfast::file::write(path, |writer| {
                job.run(source, writer, &mut counts).map_err(|error| {
                    let text = error.to_string();
                    failure = Some(error);
                    std::io::Error::other(text)
                })
            });
            if let Some(error) = failure {
                return Err(error);
            }
            written?;
        }
        None => {
            let mut out = BufWriter::new(std::io::stdout().lock());
            job.run(source, &mut out, &mut counts)?;
            out.flush()?;
        }
    }
    if !args.quiet {
        let seconds = started.elapsed().as_secs_f64();
        crate::terminal::say(&format!(
            "{} grips, {} loads, {} slip problems and {} equilibria solved, {} held; {seconds:.2} s, {:.0} grips/s",
            counts.grips,
            counts.loads,
            counts.compared,
            counts.solved,
            counts.held,
            counts.grips as f64 / seconds
        ));
    }
    Ok(if counts.held > 0 { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

#[derive(Default)]
struct Counts {
    grips: u64,
    loads: u64,
    solved: u64,
    compared: u64,
    held: u64,
}

/// Where grips come from.
enum Source<'a> {
    /// One contact pair per line.
    Lines { first: Value, rest: &'a mut dyn BufRead },
    /// All at once.
    List(Vec<Value>),
    /// A result file.
    Result(Box<GripSet>),
}

impl<'a> Source<'a> {
    fn open(input: &'a mut dyn BufRead, name: &str) -> anyhow::Result<Self> {
        let mut first = String::new();
        while first.trim().is_empty() {
            first.clear();
            if input.read_line(&mut first).with_context(|| format!("{name}: cannot read"))? == 0 {
                bail!("{name}: the file is empty");
            }
        }
        if let Ok(value) = serde_json::from_str::<Value>(&first)
            && value.get("A_I").is_some()
        {
            return Ok(Self::Lines { first: value, rest: input });
        }
        let mut text = first.into_bytes();
        input.read_to_end(&mut text).with_context(|| format!("{name}: cannot read"))?;
        if let Ok(set) = GripSet::parse(name, &text) {
            return Ok(Self::Result(Box::new(set)));
        }
        let value: Value = serde_json::from_slice(&text).map_err(|error| {
            Error::input(
                name,
                format!("is not JSON: {error}"),
                "give contact pairs as JSON or JSON Lines",
            )
        })?;
        Ok(match value {
            Value::Object(mut object) => match object.remove("cases") {
                Some(Value::Array(list)) => Self::List(list),
                _ if object.get("format").and_then(Value::as_str) == Some(FORMAT) => {
                    // Says what is wrong with it.
                    GripSet::parse(name, &text)?;
                    Self::List(Vec::new())
                }
                _ => Self::List(vec![Value::Object(object)]),
            },
            Value::Array(list) => Self::List(list),
            _ => bail!("{name}: holds neither contact pairs nor a result"),
        })
    }
}

struct Job<'a> {
    threads: &'a rayon::ThreadPool,
    backend: &'a Backend,
    seeds: &'a SeedSet,
    options: ScoreOptions,
    names: &'a [String],
    common: &'a [Wrench],
    /// Whether `--loads` was given.
    given: bool,
    force: Option<f64>,
    name: &'a str,
}

impl Job<'_> {
    fn run(
        &self,
        source: Source<'_>,
        out: &mut impl Write,
        counts: &mut Counts,
    ) -> anyhow::Result<()> {
        let mut block = Block::default();
        let mut take = |entry: Entry, out: &mut dyn Write| -> anyhow::Result<()> {
            block.loads += self.wrenches(&entry).len();
            block.entries.push(entry);
            if block.entries.len() >= BLOCK_GRIPS || block.loads >= BLOCK_LOADS {
                self.score(&mut block, out, counts)?;
            }
            Ok(())
        };
        match source {
            Source::Lines { first, rest } => {
                let mut contacts = HashMap::new();
                take(self.entry(&format!("{}: line 1", self.name), first, &mut contacts)?, out)?;
                for (index, line) in rest.lines().enumerate() {
                    let place = format!("{}: line {}", self.name, index + 2);
                    let line = line.with_context(|| place.clone())?;
                    if line.trim().is_empty() {
                        continue;
                    }
                    let value = serde_json::from_str(&line).map_err(|error| {
                        Error::input(
                            &place,
                            format!("is not JSON: {error}"),
                            "give one contact pair per line",
                        )
                    })?;
                    if contacts.len() >= BLOCK_GRIPS {
                        contacts.clear();
                    }
                    take(self.entry(&place, value, &mut contacts)?, out)?;
                }
            }
            Source::List(list) => {
                let mut contacts = HashMap::new();
                for (index, value) in list.into_iter().enumerate() {
                    take(
                        self.entry(&format!("{}: [{index}]", self.name), value, &mut contacts)?,
                        out,
                    )?;
                }
            }
            Source::Result(set) => {
                let force = self.force.unwrap_or(set.provenance.resolved.force.0);
                let own = set.loads.iter().map(|load| load.wrench);
                let loads: Arc<[Wrench]> =
                    if self.given { self.common.into() } else { own.collect() };
                let centre_of_mass = set.part.mass.centre_of_mass;
                for ranked in set.grips {
                    let grip = ranked.grip;
                    let pose = Pose { centre_of_mass, part_from_grip: grip.part_from_grip };
                    let wrenches = if grip.surfaces.is_none() {
                        Wrenches::OnPart(Arc::clone(&loads), pose)
                    } else {
                        let seen = |wrench: &Wrench| {
                            wrench_in_grip(wrench, centre_of_mass, &grip.part_from_grip)
                        };
                        Wrenches::Own(loads.iter().map(seen).collect())
                    };
                    let (id, distance) = (Some(grip.id.into()), grip.distance());
                    let entry = Entry {
                        id,
                        contact: grip.contact,
                        surfaces: grip
                            .surfaces
                            .map(|found| curved::Pads::new(&found))
                            .transpose()?,
                        distance,
                        force,
                        wrenches,
                    };
                    take(entry, out)?;
                }
            }
        }
        self.score(&mut block, out, counts)
    }

    /// A contact pair as a file states it. Pairs with equal contacts share them, and so the work on
    /// them.
    fn entry(
        &self,
        place: &str,
        mut value: Value,
        contacts: &mut HashMap<Vec<u64>, Arc<Contact>>,
    ) -> anyhow::Result<Entry> {
        let mut own = None;
        let mut id = None;
        if let Value::Object(object) = &mut value {
            own = object.remove("loads");
            id = object.remove("id");
            if self.given || own.is_some() {
                for key in ["F", "M"] {
                    object.insert(key.to_owned(), serde_json::json!([0.0, 0.0, 0.0]));
                }
            }
            if let Some(force) = self.force {
                object.insert("Fn".to_owned(), force.into());
            }
        }
        let case = gripfast::case::parse(place, value)?;
        let wrenches = match own {
            _ if self.given => Wrenches::Common,
            Some(Value::Array(list)) => Wrenches::Own(
                list.into_iter().map(|item| wrench(place, item)).collect::<Result<_, _>>()?,
            ),
            Some(_) => bail!("{place}: \"loads\" is not a list"),
            None => Wrenches::Own(vec![case.wrench]),
        };
        let surfaces = case.surfaces.map(|found| curved::Pads::new(&found)).transpose()?;
        let contact = Arc::clone(
            contacts.entry(key(&case.contact)).or_insert_with(|| Arc::new(case.contact)),
        );
        let (distance, force) = (case.distance, case.force);
        Ok(Entry { id, contact, surfaces, distance, force, wrenches })
    }

    fn wrenches<'e>(&'e self, entry: &'e Entry) -> &'e [Wrench] {
        match &entry.wrenches {
            Wrenches::Own(own) => own,
            Wrenches::OnPart(shared, _) => shared,
            Wrenches::Common => self.common,
        }
    }

    fn score(
        &self,
        block: &mut Block,
        out: &mut dyn Write,
        counts: &mut Counts,
    ) -> anyhow::Result<()> {
        let entries = std::mem::take(&mut block.entries);
        block.loads = 0;
        let plane = entries.iter().filter(|entry| entry.surfaces.is_none());
        let problems = plane.map(|entry| Problem {
            contact: &entry.contact,
            distance: entry.distance,
            force: entry.force,
            wrenches: self.wrenches(entry),
            pose: match &entry.wrenches {
                Wrenches::OnPart(_, pose) => Some(*pose),
                _ => None,
            },
        });
        let batch = Batch { problems: problems.collect() };
        let curved: Vec<CurvedProblem<'_>> = entries
            .iter()
            .filter(|entry| entry.surfaces.is_some())
            .map(|entry| CurvedProblem {
                pads: entry.surfaces.as_ref(),
                distance: entry.distance,
                force: entry.force,
                wrenches: self.wrenches(entry),
            })
            .collect();
        let (plane, curved) = self.threads.install(|| {
            (
                self.backend.score(&batch, self.seeds, &self.options),
                score_curved(&curved, self.options.polish),
            )
        });
        let plane = plane.with_context(|| format!("{}: grips from {}", self.name, counts.grips))?;
        let (mut plane, mut curved) = (plane.into_iter(), curved.into_iter());
        let scored = entries.iter().filter_map(|entry| {
            if entry.surfaces.is_some() { curved.next() } else { plane.next() }
        });
        for (entry, Scored { worst, all, solved, compared, .. }) in entries.iter().zip(scored) {
            let index = counts.grips;
            counts.grips += 1;
            counts.solved += solved as u64;
            counts.compared += compared as u64;
            counts.loads += self.wrenches(entry).len() as u64;
            let Some((load, score)) = worst else { continue };
            counts.held += u64::from(score.status.holds());
            let load_name =
                matches!(entry.wrenches, Wrenches::Common).then(|| self.names[load].as_str());
            let mu_by_load = all.iter().map(|score| score.mu_s).collect();
            serde_json::to_writer(
                &mut *out,
                &Line { id: entry.id.as_ref(), index, load, load_name, score, solved, mu_by_load },
            )?;
            out.write_all(b"\n")?;
        }
        Ok(())
    }
}

#[derive(Default)]
struct Block {
    entries: Vec<Entry>,
    loads: usize,
}

fn wrench(place: &str, value: Value) -> Result<Wrench, Error> {
    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Raw {
        #[serde(rename = "F")]
        force: DVec3,
        #[serde(rename = "M", default)]
        moment: DVec3,
    }
    let raw: Raw = serde_json::from_value(value).map_err(|error| {
        Error::input(
            place,
            format!("\"loads\": {error}"),
            "a load is {\"F\":[f1,f2,f3],\"M\":[m1,m2,m3]}",
        )
    })?;
    Ok(Wrench { force: raw.force, moment: raw.moment })
}

/// All coordinates and ring lengths of a contact: equal keys mean equal contacts.
fn key(contact: &Contact) -> Vec<u64> {
    let mut key = Vec::new();
    for patch in [&contact.face_i, &contact.face_ii] {
        key.push(patch.len() as u64);
        for polygon in patch {
            key.push(polygon.holes.len() as u64);
            for ring in std::iter::once(&polygon.outer).chain(&polygon.holes) {
                key.push(ring.len() as u64);
                key.extend(ring.iter().flat_map(|point| [point.x.to_bits(), point.y.to_bits()]));
            }
        }
    }
    key
}

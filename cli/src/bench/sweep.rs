//! `gripfast bench sweep`: rates over twists, loads and kinds of contact, on one core, on all cores
//! and on the adapter, with the time of each step.

mod table;

use std::collections::HashMap;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args as ClapArgs;
use gripfast::backend::{Backend, Batch, Choice, ScoreOptions, Scored, Seed, SeedSet, select};
use serde::Serialize;

use super::Output;
use super::known::{self, Limits};
use super::workloads::{Contacts, Workload, same_answers, same_seeds};

/// Measures rates over twists, loads and kinds of contact, on one core, all cores and the adapter,
/// step by step.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast bench sweep\n  gripfast bench sweep --adapter llvmpipe --seconds 60 --out results\n  gripfast bench sweep --backend cpu\n\n\
The sizes of the batches come from the rates: each cell of the table has its share of the time."
)]
pub(crate) struct Args {
    /// cpu: without an adapter.
    #[arg(long, default_value = "gpu", value_name = "auto|cpu|gpu")]
    backend: Choice,
    /// Graphics adapter, by its number or part of its name [default: GRIPFAST_ADAPTER, or the first
    /// that counts as a GPU].
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// Seconds that it may take, about.
    #[arg(long, value_name = "S", default_value_t = 150.0)]
    seconds: f64,
    /// Arithmetic limit of the adapter [TFLOP/s, single precision], where it is not known.
    #[arg(long, value_name = "TFLOPS")]
    tflops: Option<f64>,
    /// Limit of its memory [GB/s], where it is not known.
    #[arg(long, value_name = "GB/S")]
    bandwidth: Option<f64>,
    /// Rehearses the loss of the device: it goes before this chunk.
    #[arg(long, value_name = "N", hide = true)]
    lose_before: Option<u64>,
    #[command(flatten)]
    output: Output,
}

const TWISTS: [usize; 2] = [81, 1000];
const LOADS: [usize; 4] = [80, 500, 5_000, 50_000];

/// Most loads of one batch: what its wrenches and answers take stays below half a gigabyte.
const MOST_LOADS: usize = 1 << 21;

/// What one run of a batch took on the adapter, step by step \[s\]. The device works while the
/// processor does, so that the sum is more than the whole.
#[derive(Debug, Clone, Default, Serialize)]
struct Steps {
    /// Whole call.
    whole: f64,
    chunks: usize,
    /// Bytes to the device and back, and entries that came, per grip.
    bytes_up: f64,
    bytes_down: f64,
    entries: f64,
    make: f64,
    send: f64,
    upload: Option<f64>,
    basis: Option<f64>,
    search: Option<f64>,
    newton: Option<f64>,
    readback: Option<f64>,
    wait: f64,
    fetch: f64,
    spread: f64,
}

/// Grips scored to the end.
#[derive(Debug, Clone, Serialize)]
struct Scoring {
    grips: usize,
    seconds: f64,
    grips_per_second: f64,
    /// Seven-equation solves and slip problems.
    solved: usize,
    compared: usize,
    /// Time beyond that of the seeds of the same batch.
    beyond_seeds: f64,
    /// Time of the exact answers, where the adapter's clock ran.
    polish: Option<f64>,
    /// Share of the kernels' time in which the processor worked on exact answers of a block before.
    hidden: Option<f64>,
}

/// How far the screen is from the adapter's limits.
#[derive(Debug, Clone, Serialize)]
struct Share {
    /// Of the whole call, in kernels.
    kernels: f64,
    /// Of the arithmetic limit, while the search runs.
    arithmetic: Option<f64>,
    /// Of the memory limit, while the search runs.
    memory: Option<f64>,
}

/// One cell of the table on one backend.
#[derive(Debug, Clone, Serialize)]
struct Row {
    twists: usize,
    loads: usize,
    contacts: &'static str,
    on: &'static str,
    grips: usize,
    runs: usize,
    seconds_per_run: f64,
    loads_per_second: f64,
    evaluations_per_second: f64,
    scoring: Option<Scoring>,
    steps: Option<Steps>,
    share: Option<Share>,
    over_one_core: Option<f64>,
    over_all_cores: Option<f64>,
    /// Largest relative difference from the processor: bounds, answers.
    difference: Option<[f64; 2]>,
    /// What was left out, and why.
    left_out: Option<String>,
}

#[derive(Debug, Serialize)]
struct Report {
    gripfast: &'static str,
    adapter: Option<String>,
    software_adapter: bool,
    timestamps: bool,
    threads: usize,
    limits: Option<Limits>,
    rows: Vec<Row>,
    complete: bool,
    /// Why it ended early.
    failure: Option<String>,
}

/// Where a cell is measured.
struct Place {
    name: &'static str,
    backend: Backend,
    pool: Option<rayon::ThreadPool>,
}

impl Place {
    fn seed(&self, batch: &Batch<'_>, set: &SeedSet) -> anyhow::Result<Vec<Seed>> {
        let run = || self.backend.seed(batch, set);
        Ok(self.pool.as_ref().map_or_else(run, |pool| pool.install(run))?)
    }

    /// What scoring takes of the seeds.
    fn survivors(&self, batch: &Batch<'_>, set: &SeedSet) -> anyhow::Result<()> {
        let run = || self.backend.survivors_for(batch, set, &ScoreOptions::default());
        std::hint::black_box(self.pool.as_ref().map_or_else(run, |pool| pool.install(run))?);
        Ok(())
    }

    fn score(&self, batch: &Batch<'_>, set: &SeedSet) -> anyhow::Result<Vec<Scored>> {
        let run = || self.backend.score(batch, set, &ScoreOptions::default());
        Ok(self.pool.as_ref().map_or_else(run, |pool| pool.install(run))?)
    }
}

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let selection = select(args.backend, args.adapter.as_deref())?;
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    #[cfg_attr(not(feature = "gpu"), expect(unused_mut, reason = "an adapter may join"))]
    let mut places = vec![
        Place { name: "one core", backend: Backend::Cpu, pool: Some(one) },
        Place { name: "all cores", backend: Backend::Cpu, pool: None },
    ];
    let mut report = Report {
        gripfast: env!("CARGO_PKG_VERSION"),
        adapter: None,
        software_adapter: false,
        timestamps: false,
        threads: rayon::current_num_threads(),
        limits: None,
        rows: Vec::new(),
        complete: false,
        failure: None,
    };
    #[cfg(feature = "gpu")]
    if let Backend::Gpu(mut gpu) = selection.backend {
        if let Some(before) = args.lose_before {
            gpu.lose_before(before, usize::MAX);
        }
        report.adapter = Some(gpu.name());
        report.software_adapter = gpu.is_software();
        report.timestamps = gpu.has_timestamps();
        report.limits = known::limits(&gpu.name(), args.tflops, args.bandwidth);
        places.push(Place { name: "adapter", backend: Backend::Gpu(gpu), pool: None });
    }
    #[cfg(not(feature = "gpu"))]
    let _ = (selection.backend, args.lose_before, args.tflops, args.bandwidth, known::limits);
    let mut cells = Vec::new();
    for twists in TWISTS {
        for loads in LOADS {
            cells.extend(Contacts::ALL.map(|contacts| (twists, loads, contacts)));
        }
    }
    let mut history = History::default();
    let mut left = cells.len() * places.len();
    for (twists, loads, contacts) in cells {
        let set = SeedSet::with_at_least(twists)?;
        let first = report.rows.len();
        // A cell has a rate on every place or on none.
        if start.elapsed().as_secs_f64() >= args.seconds {
            break;
        }
        for place in &places {
            let rest = args.seconds - start.elapsed().as_secs_f64();
            let cell = Cell { set: &set, loads, contacts, place, limits: report.limits };
            let outcome = cell.measure((rest / left as f64).max(0.0), &mut history);
            left -= 1;
            match outcome {
                Ok(row) => report.rows.push(row),
                Err(error) => {
                    report.failure = Some(format!(
                        "{}, {twists} twists, {loads} loads, {} contacts: {error}",
                        place.name,
                        contacts.name()
                    ));
                    args.output.write("sweep", &report.markdown(), &report, true)?;
                    return Err(error);
                }
            }
        }
        let mut rates = report.rows[first..].iter().map(|row| row.loads_per_second);
        let (one, all) = (rates.next(), rates.next());
        for row in &mut report.rows[first..] {
            let over = |rate: Option<f64>| {
                rate.filter(|&rate| rate > 0.0 && row.runs > 0)
                    .map(|rate| row.loads_per_second / rate)
            };
            (row.over_one_core, row.over_all_cores) = (over(one), over(all));
        }
        args.output.write("sweep", &report.markdown(), &report, false)?;
    }
    report.complete = left == 0;
    args.output.write("sweep", &report.markdown(), &report, true)?;
    let apart = report
        .rows
        .iter()
        .find(|row| row.left_out.as_ref().is_some_and(|why| why.starts_with("DIFFERS")));
    if let Some(row) = apart {
        anyhow::bail!(
            "the backends disagree at {} twists, {} loads, {} contacts: {}",
            row.twists,
            row.loads,
            row.contacts,
            row.left_out.as_deref().unwrap_or_default()
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Loads and seconds of one grip that was measured before on the same place, with the same twists
/// and kind of contact: its seeds, and its scoring.
#[derive(Default)]
struct History(HashMap<Measured, [Option<(usize, f64)>; 2]>);

/// Place, twists and kind of contact of a measurement.
type Measured = (&'static str, usize, &'static str);

struct Cell<'a> {
    set: &'a SeedSet,
    loads: usize,
    contacts: Contacts,
    place: &'a Place,
    limits: Option<Limits>,
}

impl Cell<'_> {
    fn workload(&self, grips: usize) -> Workload {
        Workload::new(self.contacts, grips, self.loads)
    }

    /// Measures within about `seconds`; what would take far longer is left out.
    fn measure(&self, seconds: f64, history: &mut History) -> anyhow::Result<Row> {
        let mut row = Row {
            twists: self.set.len(),
            loads: self.loads,
            contacts: self.contacts.name(),
            on: self.place.name,
            grips: 0,
            runs: 0,
            seconds_per_run: 0.0,
            loads_per_second: 0.0,
            evaluations_per_second: 0.0,
            scoring: None,
            steps: None,
            share: None,
            over_one_core: None,
            over_all_cores: None,
            difference: None,
            left_out: None,
        };
        let key = (self.place.name, self.set.len(), self.contacts.name());
        let known = history.0.entry(key).or_default();
        // The dearest contacts cost with the square of the number of loads.
        let expected = |known: Option<(usize, f64)>, power: i32| {
            known.map_or(0.0, |(loads, time)| time * (self.loads as f64 / loads as f64).powi(power))
        };
        let most = 3.0 * seconds + 0.5;
        let time = expected(known[0], 1);
        if time > most {
            row.left_out = Some(format!("seeds of one grip would take {time:.1} s"));
            return Ok(row);
        }
        let (one_grip, time) = self.seeds(&mut row, 0.5 * seconds)?;
        known[0] = Some((self.loads, time));
        let time = expected(known[1], 2);
        if time > most {
            row.left_out = Some(format!("scoring one grip could take {time:.1} s"));
        } else {
            known[1] = Some((self.loads, self.scoring(&mut row, &one_grip, 0.3 * seconds)?));
        }
        Ok(row)
    }

    /// Rates of the seeds, of those loads that can be the worst. Gives the seeds of one grip and the seconds that they took.
    fn seeds(&self, row: &mut Row, seconds: f64) -> anyhow::Result<(Vec<Seed>, f64)> {
        let start = Instant::now();
        let over = || start.elapsed().as_secs_f64();
        let mut grips = 1;
        let (mut one_grip, mut one_time) = (Vec::new(), 0.0);
        loop {
            let workload = self.workload(grips);
            let batch = workload.batch();
            // Twice for a single grip: the first call compiles or allocates.
            if grips == 1 {
                one_grip = self.place.seed(&batch, self.set)?;
                self.place.survivors(&batch, self.set)?;
            }
            let begin = Instant::now();
            self.place.survivors(&batch, self.set)?;
            let once = begin.elapsed().as_secs_f64();
            if grips == 1 {
                one_time = once;
            }
            let more = (grips * 8).min(MOST_LOADS / self.loads);
            if once < 0.1 * seconds && over() < 0.4 * seconds && more > grips {
                grips = more;
                continue;
            }
            let begin = Instant::now();
            let mut runs = 0;
            while runs == 0 || over() < 0.8 * seconds {
                self.place.survivors(&batch, self.set)?;
                runs += 1;
            }
            let each = begin.elapsed().as_secs_f64() / runs as f64;
            let rate = workload.loads() as f64 / each;
            (row.grips, row.runs, row.seconds_per_run) = (grips, runs, each);
            (row.loads_per_second, row.evaluations_per_second) =
                (rate, rate * self.set.len() as f64);
            self.steps(row, &workload)?;
            return Ok((one_grip, one_time));
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn steps(&self, _: &mut Row, _: &Workload) -> anyhow::Result<()> {
        let _ = (self.limits, known::EVALUATION, known::LOAD, known::BASIS_EDGE);
        let _ = (known::GRIP_BYTES, known::ENTRY_BYTES);
        let _ =
            (known::BASIS_BYTES, known::LOAD_BYTES, self.contacts.edges(), self.contacts.faces());
        Ok(())
    }

    /// One more run with the adapter's clock.
    #[cfg(feature = "gpu")]
    fn steps(&self, row: &mut Row, workload: &Workload) -> anyhow::Result<()> {
        let Backend::Gpu(gpu) = &self.place.backend else { return Ok(()) };
        gpu.start_clock()?;
        let begin = Instant::now();
        self.place.survivors(&workload.batch(), self.set)?;
        let whole = begin.elapsed().as_secs_f64();
        let chunks = gpu.stop_clock().unwrap_or_default().chunks;
        let device = |span: &dyn Fn(
            gripfast::backend::DeviceSpans,
        ) -> Option<gripfast::backend::Span>|
         -> Option<f64> {
            chunks.iter().map(|chunk| Some(span(chunk.device?)?.seconds())).sum()
        };
        let sum =
            |span: &dyn Fn(&gripfast::backend::ChunkSpans) -> gripfast::backend::Span| -> f64 {
                chunks.iter().map(|chunk| span(chunk).seconds()).sum()
            };
        let per_grip = |number: &dyn Fn(&gripfast::backend::ChunkSpans) -> f64| -> f64 {
            chunks.iter().map(number).sum::<f64>() / row.grips.max(1) as f64
        };
        let steps = Steps {
            whole,
            chunks: chunks.len(),
            bytes_up: per_grip(&|chunk| chunk.bytes_up as f64),
            bytes_down: per_grip(&|chunk| chunk.bytes_down as f64),
            entries: per_grip(&|chunk| chunk.entries as f64),
            make: sum(&|chunk| chunk.make),
            send: sum(&|chunk| chunk.send),
            upload: device(&|device| device.upload),
            basis: device(&|device| Some(device.basis)),
            search: device(&|device| Some(device.search)),
            newton: device(&|device| Some(device.newton)),
            readback: device(&|device| device.readback),
            wait: sum(&|chunk| chunk.wait),
            fetch: sum(&|chunk| chunk.fetch),
            spread: sum(&|chunk| chunk.spread),
        };
        if let (Some(basis), Some(search)) = (steps.basis, steps.search) {
            let faces = self.contacts.faces();
            let (loads, twists) = (workload.loads() as f64, self.set.len() as f64);
            let distinct = if self.contacts == Contacts::Shared { 1 } else { row.grips };
            let evaluation = known::EVALUATION[faces - 1] * twists + known::LOAD[faces - 1];
            let grips = row.grips as f64;
            let bytes = known::LOAD_BYTES * loads
                + (known::GRIP_BYTES + known::ENTRY_BYTES * steps.entries) * grips
                + known::BASIS_BYTES * twists * (distinct * faces) as f64;
            let edges = (distinct * faces * self.contacts.edges()) as f64;
            let work = evaluation * loads + known::BASIS_EDGE * edges * twists;
            row.share = Some(Share {
                kernels: (basis + search + steps.newton.unwrap_or(0.0)) / whole,
                arithmetic: self.limits.map(|most| work / (basis + search) / most.lanes),
                memory: self.limits.map(|most| bytes / search / most.memory),
            });
        }
        row.steps = Some(steps);
        Ok(())
    }

    /// Rate of scored grips, and the comparison with the processor on one grip. Gives the seconds
    /// of one grip.
    fn scoring(&self, row: &mut Row, seeds: &[Seed], seconds: f64) -> anyhow::Result<f64> {
        let start = Instant::now();
        let workload = self.workload(1);
        let begin = Instant::now();
        let scored = self.place.score(&workload.batch(), self.set)?;
        let one = begin.elapsed().as_secs_f64();
        if self.place.name == "adapter" {
            let bounds = same_seeds(&Backend::Cpu.seed(&workload.batch(), self.set)?, seeds);
            let expected =
                Backend::Cpu.score(&workload.batch(), self.set, &ScoreOptions::default())?;
            match (bounds, same_answers(&expected, &scored)) {
                (Ok(bounds), Ok(answers)) => row.difference = Some([bounds, answers]),
                (bounds, answers) => {
                    let why = bounds.err().or(answers.err()).unwrap_or_default();
                    row.left_out = Some(format!("DIFFERS: {why}"));
                }
            }
        }
        let most = row.grips.max(1);
        let grips = ((0.3 * seconds / one.max(1e-9)) as usize).clamp(1, most);
        let workload = self.workload(grips);
        let batch = workload.batch();
        let begin = Instant::now();
        self.place.survivors(&batch, self.set)?;
        let seeds_only = begin.elapsed().as_secs_f64();
        self.start_clock()?;
        let (mut runs, mut spent) = (0, 0.0);
        let (mut solved, mut compared) = (0, 0);
        while runs == 0 || start.elapsed().as_secs_f64() + spent / f64::from(runs) < seconds {
            let begin = Instant::now();
            let scored = self.place.score(&batch, self.set)?;
            spent += begin.elapsed().as_secs_f64();
            runs += 1;
            solved = scored.iter().map(|scored| scored.solved).sum();
            compared = scored.iter().map(|scored| scored.compared).sum();
        }
        let [polish, hidden] = self.stop_clock();
        let polish = polish.map(|polish| polish / f64::from(runs));
        let each = spent / f64::from(runs);
        row.scoring = Some(Scoring {
            grips,
            seconds: each,
            grips_per_second: grips as f64 / each,
            solved,
            compared,
            beyond_seeds: each - seeds_only,
            polish,
            hidden,
        });
        Ok(one)
    }

    #[cfg(feature = "gpu")]
    fn start_clock(&self) -> anyhow::Result<()> {
        if let Backend::Gpu(gpu) = &self.place.backend {
            gpu.start_clock()?;
        }
        Ok(())
    }

    /// Seconds of exact answers since the clock was started, and the share of the kernels' time that both
    /// have in common.
    #[cfg(feature = "gpu")]
    fn stop_clock(&self) -> [Option<f64>; 2] {
        let Backend::Gpu(gpu) = &self.place.backend else { return [None; 2] };
        let Some(timeline) = gpu.stop_clock() else { return [None; 2] };
        let polish = timeline.polish.iter().map(|span| span.seconds()).sum();
        let kernels = timeline.chunks.iter().filter_map(|chunk| chunk.device);
        let (mut whole, mut common) = (0.0, 0.0);
        for span in kernels.flat_map(|device| [device.basis, device.search, device.newton]) {
            whole += span.seconds();
            common += timeline.polish.iter().map(|polish| span.common(*polish)).sum::<f64>();
        }
        [Some(polish), (whole > 0.0).then(|| common / whole)]
    }

    #[cfg(not(feature = "gpu"))]
    fn start_clock(&self) -> anyhow::Result<()> {
        Ok(())
    }

    #[cfg(not(feature = "gpu"))]
    fn stop_clock(&self) -> [Option<f64>; 2] {
        [None; 2]
    }
}

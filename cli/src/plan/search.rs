//! The long part of `plan`: chunk after chunk, with a file to go on from.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use gripfast::backend::Best;
use gripfast::error::{Error, Result};
use gripfast::plan::checkpoint::Checkpoint;
use gripfast::plan::{Assessor, Collector};
use gripfast::propose::{Progress, Proposer};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value;

/// A checkpoint costs at most one part in this many of the time.
const LEAST_PAUSE: u32 = 20;

/// The file beside the output that holds an unfinished run.
pub(super) struct Partial {
    pub(super) path: PathBuf,
    /// Time between two states.
    pub(super) every: Duration,
    /// What the run was asked, see [`gripfast::plan::checkpoint::inputs`].
    pub(super) inputs: BTreeMap<String, Value>,
}

impl Partial {
    /// `FILE.partial` for the output `FILE`; `None` where that is no regular file, such as a pipe.
    pub(super) fn beside(output: &Path) -> Option<PathBuf> {
        if std::fs::metadata(output).is_ok_and(|metadata| !metadata.is_file()) {
            return None;
        }
        let mut name = output.as_os_str().to_owned();
        name.push(".partial");
        Some(name.into())
    }

    /// Removes the file of a run that is finished.
    pub(super) fn remove(&self) -> Result<()> {
        match std::fs::remove_file(&self.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(Error::io(&self.path, "remove", error))
            }
            _ => Ok(()),
        }
    }
}

/// What came of the search.
pub(super) struct Found {
    pub(super) collector: Collector,
    /// Whether every candidate was looked at.
    pub(super) complete: bool,
    /// Where the seeds were computed, in the order of use.
    pub(super) backend: String,
}

/// A search that may be interrupted.
pub(super) struct Search<'a> {
    pub(super) assessor: &'a Assessor<'a>,
    /// Best grips to keep.
    pub(super) keep: usize,
    /// Whether grips that cannot be among them are left unsolved.
    pub(super) race: bool,
    pub(super) partial: Option<&'a Partial>,
    pub(super) quiet: bool,
}

impl Search<'_> {
    /// Looks at all candidates; with `resume` at those that the unfinished run has left, if there
    /// is one.
    pub(super) fn run(&self, proposer: &mut Proposer<'_>, resume: bool) -> anyhow::Result<Found> {
        let mut found = Found {
            collector: Collector::default(),
            complete: true,
            backend: self.assessor.backend.name(),
        };
        let mut best = self.race.then(|| Best::new(self.keep));
        let total = proposer.candidates();
        if let Some(partial) = self.partial {
            let file = partial.path.display();
            match (resume, partial.path.exists()) {
                (true, true) => {
                    let checkpoint = Checkpoint::read(&partial.path, &partial.inputs)?;
                    proposer.resume(&checkpoint.progress)?;
                    self.note(&format!("going on from {file}: {} of {total} candidates were looked at", checkpoint.progress.candidates()));
                    if *checkpoint.backend != *found.backend {
                        found.backend = format!("{}, then {}", checkpoint.backend, found.backend);
                    }
                    found.collector = checkpoint.collector.into_owned();
                    if let Some(best) = &mut best {
                        found.collector.scores().for_each(|score| best.insert(score));
                    }
                }
                (true, false) => self.note(&format!("nothing to go on from ({file} is not there): starting at the first candidate")),
                (false, true) => self.note(&format!("warning: {file} holds an unfinished run and will be overwritten; --resume goes on from it")),
                (false, false) => {}
            }
        }
        let stop = stop_on_interrupt();
        let bar = progress_bar(total, self.quiet);
        let mut done = proposer.progress();
        bar.set_position(done.candidates());
        bar.reset_eta();
        let (mut saved, mut pause) =
            (Instant::now(), self.partial.map_or(Duration::MAX, |partial| partial.every));
        while let Some(chunk) = proposer.next() {
            let proposed = chunk.grips.len();
            let scored = match &mut best {
                Some(best) => self.assessor.assess_best(chunk.grips, best),
                None => self.assessor.assess(chunk.grips),
            };
            let scored = match scored {
                Ok(scored) => scored,
                Err(error) => {
                    bar.finish_and_clear();
                    // The chunk that failed is the first of a run that goes on.
                    if done.candidates() > 0 {
                        self.save(&done, &found);
                    }
                    return Err(error.into());
                }
            };
            found.collector.outrank((proposed - scored.len()) as u64);
            found.collector.add(scored, self.keep, self.assessor.settings.weights);
            done = proposer.progress();
            bar.set_position(done.candidates());
            bar.set_message(format!("{} grips", found.collector.ranked()));
            if stop.load(Ordering::Relaxed) {
                found.complete = done.candidates() == total;
                break;
            }
            if saved.elapsed() >= pause {
                let before = Instant::now();
                self.save(&done, &found);
                saved = Instant::now();
                pause = pause.max(LEAST_PAUSE * (saved - before));
            }
        }
        bar.finish_and_clear();
        if !found.complete {
            self.note("interrupted: the ranking covers the candidates looked at so far");
            if let (true, Some(partial)) = (self.save(&done, &found), self.partial) {
                self.note(&format!(
                    "wrote {}: the same command with --resume goes on from it",
                    partial.path.display()
                ));
            }
        }
        Ok(found)
    }

    /// Writes the state. A failure costs the state, not the run.
    fn save(&self, done: &Progress, found: &Found) -> bool {
        let Some(partial) = self.partial else { return false };
        let written = Checkpoint::new(&partial.inputs, &found.backend, done, &found.collector)
            .write(&partial.path);
        if let Err(error) = &written {
            self.note(&format!("warning: this run cannot be resumed: {error}"));
        }
        written.is_ok()
    }

    fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("{text}");
        }
    }
}

/// Set when the user asks to stop: the run ends after the chunk in flight with what it has.
fn stop_on_interrupt() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    // A second handler in one process is refused; then an interrupt just ends the program, which is
    // all right too.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    stop
}

/// A bar with rate and time left; hidden when asked for or when nobody watches.
fn progress_bar(total: u64, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template(
        "{bar:32} {human_pos}/{human_len} candidates  {per_sec}  {eta} left  {msg}",
    ) {
        bar.set_style(style);
    }
    bar
}

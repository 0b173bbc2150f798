//! The long part of a plan: chunk after chunk, with a file from which it can be resumed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::assess::AssessedGrips;
use super::checkpoint::{self, Checkpoint};
use super::{Assessor, Collector, Observer, Plan, Progress, Settings};
use crate::backend::{Best, Watch};
use crate::error::{Error, Result};
use crate::model::Grip;
use crate::propose::{self, Proposer};

/// Among the rejections: free candidates that are not among the numbers asked for.
const NOT_CHOSEN: &str = "not_chosen";
/// Among the rejections: grips that are another one with the jaws exchanged.
const FLIP: &str = "flip";
/// Among the rejections: grips that an interrupt has left unscored.
const INTERRUPTED: &str = "interrupted";

/// A checkpoint costs at most one part in this many of the time.
const LEAST_PAUSE: u32 = 20;

/// The file beside the result that holds an unfinished run.
pub(super) struct Partial {
    pub(super) path: PathBuf,
    /// Time between two states.
    every: Duration,
    /// What the run was asked, see [`checkpoint::inputs`].
    inputs: BTreeMap<String, Value>,
}

impl Partial {
    /// `FILE.partial` for the result `FILE`; `None` where that is no regular file, such as a pipe.
    fn beside(output: &Path) -> Option<PathBuf> {
        if std::fs::metadata(output).is_ok_and(|metadata| !metadata.is_file()) {
            return None;
        }
        let mut name = output.as_os_str().to_owned();
        name.push(".partial");
        Some(name.into())
    }

    /// Whether there is an unfinished run.
    pub(super) fn is_there(&self) -> bool {
        self.path.exists()
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

impl Plan {
    /// Where the state goes; nowhere without a result file.
    pub(super) fn partial(&self) -> Result<Option<Partial>> {
        let output = &self.request.output;
        let path = output.output.as_deref().and_then(Partial::beside);
        if output.resume && path.is_none() {
            return Err(Error::input(
                "resume",
                "the result does not go to a regular file",
                "name a result file",
            )
            .with_options(&["resume", "output"]));
        }
        Ok(path.map(|path| Partial {
            path,
            every: Duration::from_secs_f64(output.checkpoint.0),
            inputs: self.inputs(),
        }))
    }

    /// Everything that decides which grips are found and how they are ranked.
    pub(super) fn inputs(&self) -> BTreeMap<String, Value> {
        checkpoint::inputs(
            &self.part,
            &self.mass,
            &self.gripper,
            &self.loads,
            &self.propose,
            self.decisive(),
        )
    }

    /// The settings that decide which grips are kept, by name, less those of part, loads and
    /// candidates.
    fn decisive(&self) -> BTreeMap<String, Value> {
        let (settings, scoring) = (&self.settings, &self.request.scoring);
        BTreeMap::from(
            [
                ("force_n", json!(settings.force)),
                ("k1", json!(scoring.k1)),
                ("k2", json!(scoring.k2)),
                ("position_error_m", json!(settings.delta)),
                ("closing_friction", json!(settings.mu_c)),
                ("pad_friction", json!(settings.pads.value)),
                ("safety", json!(settings.pads.safety)),
                ("separation", json!(scoring.separation)),
                ("refiner", json!(scoring.refiner)),
                ("polish", json!(scoring.polish)),
                ("seeds", json!(self.seeds.len())),
                ("keep", json!(self.keep())),
                ("ids", json!(self.request.selection.ids)),
                ("negatives", json!(self.request.selection.negatives)),
            ]
            .map(|(name, value)| (name.to_owned(), value)),
        )
    }
}

/// What came of the search.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) collector: Collector,
    /// Whether every candidate was looked at.
    pub(super) complete: bool,
    /// Where the seeds were computed, in the order of use.
    pub(super) backend: String,
    /// Where the state lies, when it is not complete.
    pub(super) checkpoint: Option<PathBuf>,
}

/// A search that may be interrupted.
pub(super) struct Search<'a> {
    pub(super) assessor: &'a Assessor<'a>,
    /// Best grips to keep.
    pub(super) keep: usize,
    /// Whether grips that cannot be among them are left unsolved.
    pub(super) race: bool,
    /// Only these candidates are scored.
    pub(super) ids: Option<&'a [u64]>,
    /// Whether grips that are another one with the jaws exchanged are scored too.
    pub(super) flips: bool,
    /// Grips that do not hold to keep for each reason.
    pub(super) sample: usize,
    pub(super) partial: Option<&'a Partial>,
    pub(super) resume: bool,
}

/// When the next state is due.
struct Clock {
    saved: Instant,
    pause: Duration,
}

impl Search<'_> {
    /// Looks at all candidates, or at those that the unfinished run has left.
    pub(super) fn run(
        &self,
        proposer: &mut Proposer<'_>,
        observer: &mut dyn Observer,
        stop: &AtomicBool,
    ) -> Result<Found> {
        let mut found = Found {
            collector: Collector::sampling(self.sample),
            complete: true,
            backend: self.assessor.backend.name(),
            checkpoint: None,
        };
        let mut best = self.race.then(|| Best::new(self.keep));
        let total = proposer.candidates();
        if let Some(partial) = self.partial {
            self.take_up(partial, proposer, observer, &mut found)?;
            if let Some(best) = &mut best {
                found.collector.merits().for_each(|merit| best.insert(merit));
            }
        }
        let progress = |done: &propose::Progress, found: &Found| Progress {
            done: done.candidates(),
            total,
            grips: found.collector.ranked(),
        };
        let mut done = proposer.progress();
        observer.progress(progress(&done, &found));
        let pause = self.partial.map_or(Duration::MAX, |partial| partial.every);
        let mut clock = Clock { saved: Instant::now(), pause };
        while let Some(chunk) = proposer.next() {
            let (grips, left_out) = self.chosen(chunk.grips);
            let proposed = grips.len();
            let mut told = done.candidates();
            let mut tell = |scored: usize| {
                // As far into the chunk as grips of it are scored.
                let part = chunk.candidates as u128 * scored as u128 / proposed.max(1) as u128;
                let known = progress(&done, &found);
                let now = known.done + part as u64;
                if told < now && now < known.done + chunk.candidates {
                    told = now;
                    observer.progress(Progress { done: now, ..known });
                }
            };
            let watch = Watch::new(stop, &mut tell);
            let scored = self.assessor.assess_watched(grips, best.as_mut(), &watch);
            let AssessedGrips { ranked: scored, left } = match scored {
                Ok(scored) => scored,
                Err(error) => {
                    // The chunk that failed is the first of a run that resumes this one.
                    if done.candidates() > 0 {
                        self.save(&done, &found, observer);
                    }
                    return Err(error);
                }
            };
            if left > 0 {
                // So is one that was stopped on the way; what it has found still counts here.
                found.complete = false;
                found.checkpoint = self.save(&done, &found, observer);
                found.collector.reject(INTERRUPTED.to_owned(), left as u64);
            }
            observer.grips(&scored);
            found.collector.outrank((proposed - left - scored.len()) as u64);
            left_out.into_iter().for_each(|(reason, n)| found.collector.reject(reason, n));
            let Settings { weights, pads, .. } = *self.assessor.settings;
            found.collector.add(scored, self.keep, weights, pads);
            done = proposer.progress();
            observer.progress(progress(&done, &found));
            if left > 0 {
                return Ok(found);
            }
            if stop.load(Ordering::Relaxed) {
                found.complete = done.candidates() == total;
                break;
            }
            if clock.saved.elapsed() >= clock.pause {
                let before = Instant::now();
                self.save(&done, &found, observer);
                clock.saved = Instant::now();
                clock.pause = clock.pause.max(LEAST_PAUSE * (clock.saved - before));
            }
        }
        if !found.complete {
            found.checkpoint = self.save(&done, &found, observer);
        }
        Ok(found)
    }

    /// The grips to score, and the reasons for which the others fell.
    fn chosen(&self, mut grips: Vec<Grip>) -> (Vec<Grip>, BTreeMap<String, u64>) {
        let all = grips.len();
        if let Some(ids) = self.ids {
            grips.retain(|grip| ids.contains(&grip.id));
        }
        let others = (all - grips.len()) as u64;
        if !self.flips {
            grips.retain(|grip| grip.flip_of.is_none());
        }
        let flips = all as u64 - others - grips.len() as u64;
        let (grips, mut left_out) = self.assessor.carried(grips);
        for (reason, count) in [(NOT_CHOSEN, others), (FLIP, flips)] {
            if count > 0 {
                left_out.insert(reason.to_owned(), count);
            }
        }
        (grips, left_out)
    }

    /// Resumes the unfinished run, where that is asked for and there is one.
    fn take_up(
        &self,
        partial: &Partial,
        proposer: &mut Proposer<'_>,
        observer: &mut dyn Observer,
        found: &mut Found,
    ) -> Result<()> {
        let file = partial.path.display();
        match (self.resume, partial.path.exists()) {
            (true, true) => {
                let checkpoint = Checkpoint::read(&partial.path, &partial.inputs)?;
                proposer.resume(&checkpoint.progress)?;
                let (done, total) = (checkpoint.progress.candidates(), proposer.candidates());
                observer.note(&format!(
                    "resuming from {file}: {done} of {total} candidates were looked at"
                ));
                if *checkpoint.backend != *found.backend {
                    found.backend = format!("{}, then {}", checkpoint.backend, found.backend);
                }
                found.collector = checkpoint.collector.into_owned();
            }
            (true, false) => observer.note(&format!(
                "nothing to resume from ({file} is not there): starting at the first candidate"
            )),
            (false, true) => observer.warning(&format!(
                "{file} holds an unfinished run and will be overwritten; it can be resumed instead"
            )),
            (false, false) => {}
        }
        Ok(())
    }

    /// Writes the state; the file where that worked. A failure costs the state, not the run.
    fn save(
        &self,
        done: &propose::Progress,
        found: &Found,
        observer: &mut dyn Observer,
    ) -> Option<PathBuf> {
        let partial = self.partial?;
        let written = Checkpoint::new(&partial.inputs, &found.backend, done, &found.collector)
            .write(&partial.path);
        match written {
            Ok(()) => {
                observer.checkpoint(&partial.path);
                Some(partial.path.clone())
            }
            Err(error) => {
                observer.warning(&format!("this run cannot be resumed: {error}"));
                None
            }
        }
    }
}

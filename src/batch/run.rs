//! All jobs of a batch on this machine.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;
use std::time::Duration;

use super::Job;
use super::job::{Entry, Finished, run_job};
use super::split::Split;
use super::store::{Counts, Report, Store};
use crate::error::Result;
use crate::part::{Part, ReadOptions};
use crate::request::Request;

/// How the work is shared out. It changes nothing in the results.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Workers {
    /// Jobs at a time; absent: one for each core.
    pub jobs: Option<usize>,
    /// Threads of each job whose request does not say; absent: the cores shared out.
    pub threads: Option<usize>,
    /// Shares into which the candidates of each job are cut, each done by itself; absent: one.
    pub split: Option<usize>,
}

/// Sees a batch while it goes.
pub trait Watch {
    /// A job has come to its end.
    fn job(&mut self, _entry: &Entry, _counts: Counts) {}

    /// Called between jobs and several times a second; `true` stops the batch.
    fn stopped(&mut self) -> bool {
        false
    }
}

impl Watch for () {}

/// How long to wait for a job before asking whether to stop.
const PATIENCE: Duration = Duration::from_millis(100);

/// The part that a worker read last: the next job is often about the same one.
#[derive(Default)]
struct Shelf(Option<(PathBuf, ReadOptions, Part)>);

impl Shelf {
    /// The part of a request; `None` where it cannot be read, which the job then says.
    fn part(&mut self, request: &Request) -> Option<Part> {
        let options = ReadOptions::from(request);
        match &self.0 {
            Some((path, with, part)) if *path == request.part && *with == options => {
                Some(part.clone())
            }
            _ => {
                self.0 = None;
                let part = Part::read(&request.part, &options).ok()?;
                self.0 = Some((request.part.clone(), options, part.clone()));
                Some(part)
            }
        }
    }
}

/// Does the jobs that are not finished yet and keeps what comes of them in `folder`, see [`Store`].
/// When `stop` becomes true, the jobs in flight end unfinished and are left for later.
///
/// # Errors
/// As [`Store::open`] and [`Store::record`]; a job that fails is no error.
pub fn run(
    jobs: &[Job],
    folder: &Path,
    resume: bool,
    workers: Workers,
    watch: &mut dyn Watch,
    stop: &AtomicBool,
) -> Result<Report> {
    let mut store = Store::open(jobs, folder, resume)?;
    let files = store.split(workers.split.unwrap_or(1));
    let mut pending = store.pending();
    // Those of one part together: it is read once for all of them.
    pending.sort_by_key(|&job| (&jobs[job].request.part, job));
    let splits: Vec<Split> = pending.iter().map(|_| Split::default()).collect();
    let units = pending.len() * files.of;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let count = workers.jobs.unwrap_or(cores).clamp(1, units.max(1));
    let threads = Some(workers.threads.unwrap_or((cores / count).max(1)));
    let next = AtomicUsize::new(0);
    let work = |unit: usize, shelf: &mut Shelf| {
        let (place, share) = (unit / files.of, unit % files.of);
        let job = &jobs[pending[place]];
        // A fault while the part is read is the job's, which reads it again.
        let mut part = || {
            let read = AssertUnwindSafe(|| shelf.part(&job.request));
            if units > 1 { catch_unwind(read).ok().flatten() } else { None }
        };
        if files.of == 1 {
            run_job(job, part(), threads, stop)
        } else {
            splits[place].run(job, share, &files, &mut part, (threads, stop))
        }
    };
    let outcome = std::thread::scope(|scope| {
        let (send, receive) = sync_channel::<Finished>(count);
        for _ in 0..count {
            let (send, next, work) = (send.clone(), &next, &work);
            scope.spawn(move || {
                let mut shelf = Shelf::default();
                while !stop.load(Ordering::Relaxed) {
                    let unit = next.fetch_add(1, Ordering::Relaxed);
                    if unit >= units {
                        return;
                    }
                    let Some(finished) = work(unit, &mut shelf) else { continue };
                    if send.send(finished).is_err() {
                        return;
                    }
                }
            });
        }
        drop(send);
        let outcome = take(&mut store, &receive, watch, stop);
        // After an error nobody takes what the others still bring.
        if outcome.is_err() {
            stop.store(true, Ordering::Relaxed);
        }
        drop(receive);
        outcome
    });
    outcome?;
    store.finish()
}

/// Keeps what the workers bring until they have ended.
fn take(
    store: &mut Store,
    receive: &std::sync::mpsc::Receiver<Finished>,
    watch: &mut dyn Watch,
    stop: &AtomicBool,
) -> Result<()> {
    use std::sync::mpsc::RecvTimeoutError;
    loop {
        match receive.recv_timeout(PATIENCE) {
            Ok(finished) => {
                store.record(&finished)?;
                watch.job(&finished.entry, store.counts());
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
        if watch.stopped() {
            stop.store(true, Ordering::Relaxed);
        }
    }
}

//! Long work away from Python: other threads run, progress comes back, an interrupt stops it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use gripfast::plan::{Observer, Progress};
use pyo3::prelude::*;

use crate::errors;

/// How long to wait for news before asking Python whether it was interrupted.
const PATIENCE: Duration = Duration::from_millis(50);

/// What work says while it goes.
pub(crate) enum News {
    /// Candidates looked at, of how many, and grips so far.
    Progress(u64, u64, u64),
    Note(String),
    Warning(String),
    /// A job of a batch: its entry as JSON, jobs that have ended, jobs in all.
    Job(String, usize, usize),
}

/// Sends what a run says to the thread that asked for it.
pub(crate) struct Teller(pub(crate) Sender<News>);

impl Teller {
    pub(crate) fn tell(&self, news: News) {
        // Where nobody listens any more there is no one to tell.
        let _ = self.0.send(news);
    }
}

impl Observer for Teller {
    fn progress(&mut self, progress: Progress) {
        self.tell(News::Progress(progress.done, progress.total, progress.grips));
    }

    fn note(&mut self, text: &str) {
        self.tell(News::Note(text.to_owned()));
    }

    fn warning(&mut self, text: &str) {
        self.tell(News::Warning(text.to_owned()));
    }
}

/// Does `work` on a thread of its own while Python's other threads run, and calls `listener` with
/// its news: `(kind, ...)`. An exception of the listener, or an interrupt, stops the work and is
/// raised when it has ended.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    listener: Option<&Py<PyAny>>,
    work: impl FnOnce(Teller, &AtomicBool) -> T + Send,
) -> PyResult<T> {
    let (send, receive) = channel();
    py.detach(move || {
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let handle = scope.spawn(|| work(Teller(send), &stop));
            let mut failure = None;
            loop {
                let news = match receive.recv_timeout(PATIENCE) {
                    Ok(news) => Some(news),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if failure.is_some() {
                    continue;
                }
                let heard = Python::attach(|py| {
                    if let (Some(listener), Some(news)) = (listener, news) {
                        call(py, listener, news)?;
                    }
                    py.check_signals()
                });
                if let Err(error) = heard {
                    stop.store(true, Ordering::Relaxed);
                    failure = Some(error);
                }
            }
            match (handle.join(), failure) {
                (_, Some(failure)) => Err(failure),
                (Ok(value), None) => Ok(value),
                (Err(panic), None) => Err(errors::fault(panic.as_ref())),
            }
        })
    })
}

fn call(py: Python<'_>, listener: &Py<PyAny>, news: News) -> PyResult<()> {
    match news {
        News::Progress(done, total, grips) => {
            listener.call1(py, ("progress", done, total, grips))?;
        }
        News::Note(text) => drop(listener.call1(py, ("note", text))?),
        News::Warning(text) => drop(listener.call1(py, ("warning", text))?),
        News::Job(entry, ended, jobs) => drop(listener.call1(py, ("job", entry, ended, jobs))?),
    }
    Ok(())
}

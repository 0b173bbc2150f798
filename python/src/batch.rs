//! Batches: jobs as JSON, so that they travel to other machines, and the folder that keeps what
//! comes of them.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use gripfast::batch::{self, Batch, Counts, Entry, Finished, Job, Report, Watch, Workers};
use gripfast::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::{OrRaise, from_json, json};
use crate::parts::Part;
use crate::watch::{News, Teller, watched};

/// The jobs of a batch: what the file of a batch says, as JSON, over the shared request. One JSON
/// text for each.
#[pyfunction]
pub(crate) fn batch_jobs(description: &str) -> PyResult<Vec<String>> {
    let batch = Batch::from_json("batch", description).or_raise()?;
    batch.jobs().or_raise()?.iter().map(json).collect()
}

fn jobs(texts: &[String]) -> PyResult<Vec<Job>> {
    texts.iter().map(|text| from_json("job", text)).collect()
}

struct Tell(Teller);

impl Watch for Tell {
    fn job(&mut self, entry: &Entry, counts: Counts) {
        let text = serde_json::to_string(entry).unwrap_or_default();
        self.0.tell(News::Job(text, counts.ended, counts.jobs));
    }
}

/// Does all jobs here; what came of them, as JSON.
#[pyfunction]
#[pyo3(signature = (texts, folder, resume=false, workers=(None, None, None), listener=None))]
pub(crate) fn batch_run(
    py: Python<'_>,
    texts: Vec<String>,
    folder: PathBuf,
    resume: bool,
    workers: (Option<usize>, Option<usize>, Option<usize>),
    listener: Option<Py<PyAny>>,
) -> PyResult<String> {
    let jobs = jobs(&texts)?;
    let (at_once, threads, split) = workers;
    let workers = Workers { jobs: at_once, threads, split };
    let report = watched(py, listener.as_ref(), move |teller, stop| {
        batch::run(&jobs, &folder, resume, workers, &mut Tell(teller), stop)
    })?;
    json(&report.or_raise()?)
}

/// Does one job, on a part in memory where it is given: its entry as JSON, and its result.
#[pyfunction]
#[pyo3(signature = (text, part=None, threads=None))]
pub(crate) fn run_job<'py>(
    py: Python<'py>,
    text: &str,
    part: Option<&Part>,
    threads: Option<usize>,
) -> PyResult<(String, Bound<'py, PyBytes>)> {
    let job: Job = from_json("job", text)?;
    let part = part.map(|part| (*part.inner).clone());
    let finished =
        watched(py, None, move |_, stop: &AtomicBool| batch::run_job(&job, part, threads, stop))?;
    let Some(Finished { entry, content }) = finished else { return Err(stopped()).or_raise() };
    Ok((json(&entry)?, PyBytes::new(py, &content)))
}

/// Does a share of a job's candidates: its entry as JSON where the job failed, and what the share has
/// found.
#[pyfunction]
#[pyo3(signature = (text, share, part=None, threads=None))]
pub(crate) fn run_share<'py>(
    py: Python<'py>,
    text: &str,
    share: [usize; 2],
    part: Option<&Part>,
    threads: Option<usize>,
) -> PyResult<(Option<String>, Bound<'py, PyBytes>)> {
    let job: Job = from_json("job", text)?;
    let part = part.map(|part| (*part.inner).clone());
    let done = watched(py, None, move |_, stop: &AtomicBool| {
        batch::run_share(&job, share, part, threads, stop)
    })?;
    match done {
        Some(Ok(state)) => Ok((None, PyBytes::new(py, &state))),
        Some(Err(finished)) => Ok((Some(json(&finished.entry)?), PyBytes::new(py, &[]))),
        None => Err(stopped()).or_raise(),
    }
}

/// Puts together what the shares of a job have found: its entry as JSON, and its result.
#[pyfunction]
#[pyo3(signature = (text, shares, part=None, threads=None))]
pub(crate) fn gather_job<'py>(
    py: Python<'py>,
    text: &str,
    shares: Vec<Vec<u8>>,
    part: Option<&Part>,
    threads: Option<usize>,
) -> PyResult<(String, Bound<'py, PyBytes>)> {
    let job: Job = from_json("job", text)?;
    let part = part.map(|part| (*part.inner).clone());
    let finished = py.detach(|| batch::gather_job(&job, &shares, part, threads));
    let Some(Finished { entry, content }) = finished else { return Err(stopped()).or_raise() };
    Ok((json(&entry)?, PyBytes::new(py, &content)))
}

/// Only an interrupt stops a job, which is raised before.
fn stopped() -> Error {
    Error::new(gripfast::error::ErrorKind::Cancelled, "job", "was stopped", "")
}

/// The entry, as JSON, of a job that never came back.
#[pyfunction]
pub(crate) fn lost_job(text: &str, problem: &str) -> PyResult<String> {
    json(&batch::lost_job(&from_json("job", text)?, problem).entry)
}

/// The folder of a batch, open.
#[pyclass(frozen, module = "gripfast._gripfast")]
pub(crate) struct Store {
    inner: Mutex<Option<batch::Store>>,
}

impl Store {
    /// Works on the store without Python's lock: who waits for the one must not hold the other.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut batch::Store) -> gripfast::error::Result<T> + Send,
    ) -> PyResult<T> {
        let done = py.detach(|| {
            let mut inner = self.inner.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let store = inner.as_mut().ok_or_else(|| {
                Error::input("batch", "its folder is closed", "open it again to resume")
            })?;
            work(store)
        });
        done.or_raise()
    }
}

#[pymethods]
impl Store {
    #[new]
    #[pyo3(signature = (texts, folder, resume=false))]
    fn open(py: Python<'_>, texts: Vec<String>, folder: PathBuf, resume: bool) -> PyResult<Self> {
        let jobs = jobs(&texts)?;
        let store = py.detach(|| batch::Store::open(&jobs, &folder, resume)).or_raise()?;
        Ok(Self { inner: Mutex::new(Some(store)) })
    }

    /// Numbers of the jobs that are to be done.
    fn pending(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.with(py, |store| Ok(store.pending()))
    }

    /// Jobs that have ended, and jobs in all.
    fn counts(&self, py: Python<'_>) -> PyResult<(usize, usize)> {
        let Counts { jobs, ended, .. } = self.with(py, |store| Ok(store.counts()))?;
        Ok((ended, jobs))
    }

    /// What an earlier run has left of a share of a job.
    fn share<'py>(
        &self,
        py: Python<'py>,
        job: usize,
        share: [usize; 2],
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let state = self.with(py, |store| Ok(store.share(job, share)))?;
        Ok(state.map(|state| PyBytes::new(py, &state)))
    }

    /// Keeps what a share of a job has found until the job is recorded.
    fn record_share(
        &self,
        py: Python<'_>,
        job: usize,
        share: [usize; 2],
        state: &[u8],
    ) -> PyResult<()> {
        self.with(py, |store| store.record_share(job, share, state))
    }

    /// Keeps what came of a job.
    fn record(&self, py: Python<'_>, entry: &str, content: &[u8]) -> PyResult<()> {
        let finished = Finished { entry: from_json("entry", entry)?, content: content.to_vec() };
        self.with(py, |store| store.record(&finished))
    }

    /// Writes what is left to be written and closes the folder; what came of the batch, as JSON.
    fn finish(&self, py: Python<'_>) -> PyResult<String> {
        let report = py.detach(|| {
            let mut inner = self.inner.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            inner.take().map_or_else(|| Ok(Report::default()), batch::Store::finish)
        });
        json(&report.or_raise()?)
    }
}

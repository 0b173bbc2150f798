//! The folder of a batch: what is finished stays finished, whenever the run ends.
//!
//! A job's result goes to `work/`, then its line to `manifest.jsonl`, which is forced to the disk.
//! When all jobs of a shard have ended, their rows go to the data sets, whole or not at all, then
//! its line to `shards.jsonl`, and the results in `work/` are removed. Every line and every file has
//! its checksum: what a kill or a power cut has left behind half is not taken for finished, and is
//! done again.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Job;
use super::job::{Entry, Failure, Finished, Outcome};
use super::ledger::{Ledger, checksum};
use super::shard::{self, Written};
use super::split::ShareFiles;
use crate::error::{Error, ErrorKind, Result};
use crate::file::Lock;
use crate::gripper;

const FORMAT: &str = "gripfast-batch";
const VERSION: u32 = 1;
const MANIFEST: &str = "manifest.jsonl";
const SHARDS: &str = "shards.jsonl";
const DESCRIPTION: &str = "batch.json";
const WORK: &str = "work";

/// Jobs of one gripper whose rows share the files of a shard.
const SHARD: usize = 64;

/// Failures and empty jobs named in the report, at most.
const NAMED: usize = 20;

/// Which batch a folder holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Description {
    format: String,
    version: u32,
    /// Program version.
    gripfast: String,
    /// How many jobs.
    jobs: usize,
    /// Checksums of what decides the jobs, with the number of each.
    inputs: BTreeMap<String, String>,
    /// The grippers by their names, whole.
    grippers: BTreeMap<String, Value>,
}

/// A shard whose files are written.
#[derive(Debug, Serialize, Deserialize)]
struct Sealed {
    shard: usize,
    files: Vec<Written>,
}

/// What has become of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Open,
    Ended(Outcome),
}

/// How far a batch has come.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Jobs in all.
    pub jobs: usize,
    /// Jobs that have ended, those of earlier runs included.
    pub ended: usize,
    /// Jobs that were finished before this run began.
    pub before: usize,
}

/// What came of a batch.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Jobs in all.
    pub jobs: usize,
    /// Jobs with grips.
    pub grips: usize,
    /// Jobs without.
    pub empty: usize,
    /// Jobs that failed.
    pub failed: usize,
    /// Jobs that were not done, because the run was stopped.
    pub open: usize,
    /// Some of the empty ones: job and reason.
    pub empty_jobs: Vec<(String, String)>,
    /// Some of the failed ones: job and error.
    pub failed_jobs: Vec<(String, Failure)>,
}

/// The folder of a batch, open.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    manifest: Ledger,
    shards: Ledger,
    /// Part, gripper and load set, by job.
    names: Vec<[String; 3]>,
    /// By job.
    states: Vec<State>,
    /// Size and checksum of the result in `work/`, by job.
    results: Vec<(u64, u32)>,
    /// Whether the files of a shard are written and complete.
    sealed: Vec<bool>,
    groups: Vec<Group>,
    before: usize,
    report: Report,
    parquet: bool,
    shares: ShareFiles,
    _lock: Lock,
}

/// A shard: jobs of one gripper that follow each other.
#[derive(Debug)]
struct Group {
    gripper: String,
    /// Its number among those of the gripper.
    number: usize,
    jobs: std::ops::Range<usize>,
    /// Whether negatives are asked for.
    negatives: bool,
    /// Jobs that have not ended.
    open: usize,
}

impl Store {
    /// Opens the folder of `jobs`: a new one, or with `resume` one in which some may be finished.
    ///
    /// # Errors
    /// When the jobs are not all of a batch in their order, another run works on it, it holds another batch or one that was not to be resumed, a
    /// gripper cannot be read, or it cannot be written.
    pub fn open(jobs: &[Job], folder: &Path, resume: bool) -> Result<Self> {
        if let Some((place, job)) =
            jobs.iter().enumerate().find(|(place, job)| job.number != *place)
        {
            return Err(Error::input(
                format!("job {place}"),
                format!("has number {}", job.number),
                "give all jobs of a batch, in the order in which the batch lists them",
            ));
        }
        let failed = |error| Error::io(folder, "make the folder", error);
        std::fs::create_dir_all(folder.join(WORK)).map_err(failed)?;
        let lock = Lock::take(&folder.join(MANIFEST))?;
        shard::sweep(folder);
        let description = Description::of(jobs)?;
        let old = folder.join(DESCRIPTION);
        let known = old.exists();
        if known {
            if !resume {
                return Err(Error::input(
                    folder.display().to_string(),
                    "there is a batch in it",
                    "resume it, or name another folder",
                )
                .with_options(&["resume"]));
            }
            description.check(&old)?;
        } else {
            crate::file::write(&old, |writer| {
                serde_json::to_writer_pretty(&mut *writer, &description)?;
                writer.write_all(b"\n")
            })?;
        }
        let groups = groups(jobs);
        let mut states = vec![State::Open; jobs.len()];
        let mut results = vec![(0, 0); jobs.len()];
        let mut report = Report { jobs: jobs.len(), ..Report::default() };
        let mut entries: BTreeMap<usize, Told> = BTreeMap::new();
        let (manifest, _) = Ledger::open(folder.join(MANIFEST), |entry: Entry| {
            if let Some(state) = states.get_mut(entry.job) {
                *state = State::Ended(entry.outcome);
                results[entry.job] = (entry.bytes, entry.checksum);
                entries.insert(entry.job, Told::of(&entry));
            }
        })?;
        let mut sealed = vec![false; groups.len()];
        let (shards, _) = Ledger::open(folder.join(SHARDS), |line: Sealed| {
            if let Some(sealed) = sealed.get_mut(line.shard) {
                *sealed = line.files.iter().all(|file| file.is_there(folder));
            }
        })?;
        let mut store = Self {
            folder: folder.to_owned(),
            manifest,
            shards,
            names: jobs
                .iter()
                .map(|job| [&job.part, &job.gripper, &job.loads].map(Clone::clone))
                .collect(),
            states,
            results,
            sealed,
            groups,
            before: 0,
            report: Report::default(),
            parquet: cfg!(feature = "parquet"),
            shares: ShareFiles::new(&folder.join(WORK), 1),
            _lock: lock,
        };
        store.forget();
        for (job, told) in entries {
            if store.states[job] != State::Open {
                told.count(&mut report);
            }
        }
        store.report = report;
        store.before = store.states.iter().filter(|state| **state != State::Open).count();
        Ok(store)
    }

    /// Takes back what the manifest says of jobs whose results are not there, and of those that
    /// failed: they are done again.
    fn forget(&mut self) {
        for index in 0..self.groups.len() {
            let jobs = self.groups[index].jobs.clone();
            for job in jobs.clone() {
                let kept = match self.states[job] {
                    State::Open => continue,
                    State::Ended(Outcome::Failed) => false,
                    State::Ended(_) => self.sealed[index] || self.result(job).is_some(),
                };
                if !kept {
                    self.states[job] = State::Open;
                }
            }
            self.groups[index].open = jobs.filter(|job| self.states[*job] == State::Open).count();
            // Its files miss the rows of jobs that are open.
            self.sealed[index] &= self.groups[index].open == 0;
        }
    }

    /// Numbers of the jobs that are to be done, in their order.
    pub fn pending(&self) -> Vec<usize> {
        (0..self.states.len()).filter(|job| self.states[*job] == State::Open).collect()
    }

    /// How far the batch has come.
    pub fn counts(&self) -> Counts {
        let ended = self.states.iter().filter(|state| **state != State::Open).count();
        Counts { jobs: self.states.len(), ended, before: self.before }
    }

    /// Cuts jobs into this many shares from now on.
    pub(super) fn split(&mut self, of: usize) -> ShareFiles {
        self.shares.of = of.max(1);
        self.shares.clone()
    }

    /// What [`super::run_share`] gave for share `number` of `of` shares of a job, where an earlier run
    /// has left it here.
    pub fn share(&mut self, job: usize, [number, of]: [usize; 2]) -> Option<Vec<u8>> {
        self.split(of).read(job, number)
    }

    /// Keeps what [`super::run_share`] gave until the job is recorded.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn record_share(
        &mut self,
        job: usize,
        [number, of]: [usize; 2],
        state: &[u8],
    ) -> Result<()> {
        let written = self.split(of).write(job, number, state);
        written.map_err(|error| Error::io(&self.folder.join(WORK), "write to", error))
    }

    /// Keeps what came of a job.
    ///
    /// # Errors
    /// When it is none of the pending ones, or the folder cannot be written.
    pub fn record(&mut self, finished: &Finished) -> Result<()> {
        let Finished { entry, content } = finished;
        let job = entry.job;
        if self.states.get(job) != Some(&State::Open) {
            let problem = "is not among the jobs that are to be done";
            return Err(Error::input(format!("job {job}"), problem, "record each job once"));
        }
        if entry.outcome != Outcome::Failed {
            let path = self.work(job);
            std::fs::write(&path, content).map_err(|error| Error::io(&path, "write", error))?;
        }
        self.manifest.append(entry)?;
        self.shares.remove(job);
        self.states[job] = State::Ended(entry.outcome);
        self.results[job] = (content.len() as u64, checksum(content));
        Told::of(entry).count(&mut self.report);
        let group = self.groups.partition_point(|group| group.jobs.end <= job);
        self.groups[group].open -= 1;
        if self.groups[group].open == 0 {
            self.write_shard(group)?;
        }
        Ok(())
    }

    /// Writes what is left to be written, and says what came of the batch.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn finish(mut self) -> Result<Report> {
        for group in 0..self.groups.len() {
            if self.groups[group].open == 0 && !self.sealed[group] {
                self.write_shard(group)?;
            }
        }
        self.report.open = self.report.jobs - self.counts().ended;
        // Left where some job failed: its shard is written again when that is mended.
        if self.report.open + self.report.failed == 0 {
            let _ = std::fs::remove_dir_all(self.folder.join(WORK));
        }
        Ok(self.report)
    }

    /// The ledger of the jobs.
    pub fn manifest(&self) -> &Path {
        self.manifest.path()
    }

    fn work(&self, job: usize) -> PathBuf {
        self.folder.join(WORK).join(format!("{job:07}.jsonl"))
    }

    /// The result of a job, where it is there and whole.
    fn result(&self, job: usize) -> Option<Vec<u8>> {
        let content = std::fs::read(self.work(job)).ok()?;
        ((content.len() as u64, checksum(&content)) == self.results[job]).then_some(content)
    }

    /// Writes the rows of a shard whose jobs have all ended.
    fn write_shard(&mut self, index: usize) -> Result<()> {
        let group = &self.groups[index];
        let mut shard = shard::Rows::new(group.negatives);
        let mut complete = true;
        for job in group.jobs.clone() {
            match self.states[job] {
                State::Ended(Outcome::Failed) | State::Open => complete = false,
                State::Ended(_) => {
                    let place = self.work(job);
                    let content = self.result(job).ok_or_else(|| {
                        Error::format(
                            place.display().to_string(),
                            "the result of a job is gone or was changed",
                            "resume the batch: the job is done again",
                        )
                        .with_options(&["resume"])
                    })?;
                    let names = self.names[job].each_ref().map(String::as_str);
                    shard.add(names, &place.display().to_string(), &content)?;
                }
            }
        }
        let files = shard.write(&self.folder, &group.gripper, group.number, self.parquet)?;
        if complete {
            self.shards.append(&Sealed { shard: index, files })?;
            self.sealed[index] = true;
            for job in self.groups[index].jobs.clone() {
                let _ = std::fs::remove_file(self.work(job));
            }
        }
        Ok(())
    }
}

/// What the report needs of an entry.
struct Told {
    id: String,
    outcome: Outcome,
    reason: Option<String>,
    error: Option<Failure>,
}

impl Told {
    fn of(entry: &Entry) -> Self {
        Self {
            id: format!("{} / {} / {}", entry.part, entry.gripper, entry.loads),
            outcome: entry.outcome,
            reason: entry.reason.clone(),
            error: entry.error.clone(),
        }
    }

    fn count(self, report: &mut Report) {
        match (self.outcome, self.reason, self.error) {
            (Outcome::Grips, ..) => report.grips += 1,
            (Outcome::Empty, reason, _) => {
                report.empty += 1;
                if report.empty_jobs.len() < NAMED {
                    report.empty_jobs.push((self.id, reason.unwrap_or_default()));
                }
            }
            (Outcome::Failed, _, error) => {
                report.failed += 1;
                if let Some(error) = error
                    && report.failed_jobs.len() < NAMED
                {
                    report.failed_jobs.push((self.id, error));
                }
            }
        }
    }
}

impl Description {
    fn of(jobs: &[Job]) -> Result<Self> {
        let mut grippers = BTreeMap::new();
        let mut lists: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        let mut requests = flate2::Crc::new();
        for job in jobs {
            if !grippers.contains_key(&job.gripper) {
                let gripper = gripper::find(&job.request.gripper)?;
                let value = serde_json::to_value(gripper).unwrap_or_default();
                grippers.insert(job.gripper.clone(), value);
            }
            for (what, name) in
                [("parts", &job.part), ("grippers", &job.gripper), ("load sets", &job.loads)]
            {
                lists.entry(what).or_default().push(name);
            }
            requests.update(job.request.to_toml().as_bytes());
        }
        let mut inputs = BTreeMap::new();
        for (what, mut names) in lists {
            names.sort_unstable();
            names.dedup();
            let sum = checksum(names.join("\n").as_bytes());
            inputs.insert(what.to_owned(), format!("{}, checksum {sum:08x}", names.len()));
        }
        let bodies = serde_json::to_vec(&grippers).unwrap_or_default();
        let sum = checksum(&bodies);
        inputs.insert("gripper files".to_owned(), format!("checksum {sum:08x}"));
        inputs.insert("options".to_owned(), format!("checksum {:08x}", requests.sum()));
        Ok(Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            gripfast: env!("CARGO_PKG_VERSION").to_owned(),
            jobs: jobs.len(),
            inputs,
            grippers,
        })
    }

    /// Refuses to resume another batch.
    fn check(&self, path: &Path) -> Result<()> {
        let place = path.display().to_string();
        let there: Self = serde_json::from_slice(&crate::file::read(path)?).map_err(|error| {
            let remedy = "name another folder";
            Error::format(&place, format!("is no description of a batch: {error}"), remedy)
        })?;
        let mut differ: Vec<String> = Vec::new();
        if (&there.format, there.version) != (&self.format, self.version) {
            differ.push("the version of the format".to_owned());
        }
        if there.gripfast != self.gripfast {
            differ.push(format!("gripfast ({} there, {} here)", there.gripfast, self.gripfast));
        }
        for (what, here) in &self.inputs {
            let there = there.inputs.get(what).map_or("nothing", String::as_str);
            if there != here {
                differ.push(format!("{what} ({there} there, {here} here)"));
            }
        }
        // The options hold the names of the others.
        if differ.len() > 1 {
            differ.retain(|what| !what.starts_with("options "));
        }
        if differ.is_empty() {
            return Ok(());
        }
        Err(Error::new(
            ErrorKind::Mismatch,
            place,
            format!("belongs to another batch; these differ: {}", differ.join("; ")),
            "resume with what the batch was begun with, or name another folder",
        )
        .with_options(&["resume"]))
    }
}

/// The shards: jobs of one gripper that follow each other.
fn groups(jobs: &[Job]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for of_gripper in jobs.chunk_by(|a, b| a.gripper == b.gripper) {
        for (number, chunk) in of_gripper.chunks(SHARD).enumerate() {
            let first = chunk[0].number;
            groups.push(Group {
                gripper: chunk[0].gripper.clone(),
                number,
                jobs: first..first + chunk.len(),
                negatives: chunk.iter().any(|job| job.request.selection.negatives > 0),
                open: chunk.len(),
            });
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Request;

    #[test]
    fn jobs_out_of_their_order_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let job = |number: usize| Job {
            number,
            part: "part".to_owned(),
            gripper: "generic".to_owned(),
            loads: "loads".to_owned(),
            request: Request { gripper: "generic".into(), ..Request::default() },
        };
        let open = |jobs: &[Job]| Store::open(jobs, &folder.path().join("out"), false);
        let error = open(&[job(0), job(2)]).unwrap_err().to_string();
        assert!(error.contains("job 1: has number 2"), "{error}");
        assert!(!folder.path().join("out").exists(), "nothing is made");
        assert_eq!(open(&[job(0), job(1)]).unwrap().pending(), [0, 1]);
    }
}

//! One job: from its request to what came of it.

use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::AtomicBool;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Job;
use super::ledger::checksum;
use crate::error::{Error, Result};
use crate::part::Part;
use crate::plan::{self, Observer, Plan};
use crate::request::Request;
use crate::results::{GripSet, PartSummary, Resolved};

/// Rejections named where no grip is found.
const NAMED_REASONS: usize = 3;

/// How a job ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// There are grips.
    Grips,
    /// No grip holds, or there is none.
    Empty,
    /// The part, or an option, is bad; or the run failed.
    Failed,
}

/// An error as the manifest holds it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Name of its [`crate::error::ErrorKind`]; `panic` for a fault of the program, `lost` for a job
    /// whose process or machine was lost.
    pub kind: String,
    /// File, line, field or option; may be empty.
    pub place: String,
    /// What is wrong.
    pub problem: String,
    /// What to do about it; may be empty.
    pub remedy: String,
}

/// What the manifest says of a job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Entry {
    /// Number of the job.
    pub job: usize,
    /// Name of its part.
    pub part: String,
    /// Name of its gripper.
    pub gripper: String,
    /// Name of its load set.
    pub loads: String,
    /// How it ended.
    pub outcome: Outcome,
    /// Why there is no grip, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<Failure>,
    /// Grips kept.
    pub grips: u64,
    /// Candidates that are no grips, kept.
    pub negatives: u64,
    /// Grips that were ranked.
    pub ranked: u64,
    /// Of these, those that hold; absent where the pads' friction is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holding: Option<u64>,
    /// Candidates looked at.
    pub candidates: u64,
    /// Rejected candidates by reason.
    pub rejections: BTreeMap<String, u64>,
    /// Smallest friction coefficient that holds in the best grip.
    pub best_mu_s: Option<f64>,
    /// What a user should know before relying on the numbers.
    pub warnings: Vec<String>,
    /// Findings and repairs of the mesh, [`crate::part::Health`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub health: Option<Value>,
    /// Size and mass properties of the part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub summary: Option<PartSummary>,
    /// What was used where the request leaves the choice to the gripper or a rule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolved: Option<Resolved>,
    /// Where the seeds were computed.
    pub backend: String,
    /// Program version.
    pub gripfast: String,
    /// When it began, in seconds since 1970.
    pub started: f64,
    /// How long it took \[s\].
    pub seconds: f64,
    /// What was asked for, whole.
    pub request: Request,
    /// Size of the result \[bytes\].
    pub bytes: u64,
    /// Its CRC-32.
    pub checksum: u32,
}

impl Entry {
    /// That of a job that failed and said nothing.
    fn of(job: &Job, begin: SystemTime) -> Self {
        Self {
            job: job.number,
            part: job.part.clone(),
            gripper: job.gripper.clone(),
            loads: job.loads.clone(),
            outcome: Outcome::Failed,
            reason: None,
            error: None,
            grips: 0,
            negatives: 0,
            ranked: 0,
            holding: None,
            candidates: 0,
            rejections: BTreeMap::new(),
            best_mu_s: None,
            warnings: Vec::new(),
            health: None,
            summary: None,
            resolved: None,
            backend: String::new(),
            gripfast: env!("CARGO_PKG_VERSION").to_owned(),
            started: begin.duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64()),
            seconds: 0.0,
            request: job.request.clone(),
            bytes: 0,
            checksum: 0,
        }
    }
}

/// A job that has come to its end, as it travels from where it ran to the store.
#[derive(Debug, Clone, PartialEq)]
pub struct Finished {
    /// What the manifest will say.
    pub entry: Entry,
    /// The result, native JSON Lines; empty where the job failed.
    pub content: Vec<u8>,
}

/// Keeps what a run says.
#[derive(Default)]
struct Heard {
    notes: Vec<String>,
    warnings: Vec<String>,
}

impl Observer for Heard {
    fn note(&mut self, text: &str) {
        if !text.starts_with("backend ") {
            self.notes.push(text.to_owned());
        }
    }

    fn warning(&mut self, text: &str) {
        self.warnings.push(text.to_owned());
    }
}

/// Does a job on `threads` threads (all cores without a number), on `part` where that is in memory
/// already; `None` when it was stopped. An error, even a fault of the program, is an outcome.
pub fn run_job(
    job: &Job,
    part: Option<Part>,
    threads: Option<usize>,
    stop: &AtomicBool,
) -> Option<Finished> {
    finished(job, |heard| {
        let plan = plan(job, part, threads)?;
        planned(job, &plan, plan.run(heard, stop)?)
    })
}

/// What has come of a share of a job: its state for [`gather_job`], or, where it failed, the whole job.
pub type ShareOutcome = std::result::Result<Vec<u8>, Box<Finished>>;

/// Does the share `number`, from 0, of `of` shares of a job's candidates, otherwise as [`run_job`].
pub fn run_share(
    job: &Job,
    [number, of]: [usize; 2],
    part: Option<Part>,
    threads: Option<usize>,
    stop: &AtomicBool,
) -> Option<ShareOutcome> {
    let mut state = None;
    let failed = finished(job, |_| {
        state = plan(job, part, threads)?.run_share(number, of, stop)?;
        Ok(None)
    });
    match (failed, state) {
        (Some(failed), _) => Some(Err(Box::new(failed))),
        (None, state) => state.map(Ok),
    }
}

/// Puts together what all shares of a job have found, in the order of their numbers: what [`run_job`]
/// gives, byte for byte.
pub fn gather_job(
    job: &Job,
    shares: &[Vec<u8>],
    part: Option<Part>,
    threads: Option<usize>,
) -> Option<Finished> {
    finished(job, |heard| {
        let plan = plan(job, part, threads)?;
        planned(job, &plan, plan.gather(shares, heard)?)
    })
}

/// The end of a job: what `work` came to, or how it failed, a fault of the program included; `None`
/// where it came to nothing.
fn finished(
    job: &Job,
    work: impl FnOnce(&mut Heard) -> Result<Option<Planned>>,
) -> Option<Finished> {
    let (begin, clock) = (SystemTime::now(), Instant::now());
    let mut heard = Heard::default();
    let ended = catch_unwind(AssertUnwindSafe(|| work(&mut heard)));
    let mut entry = Entry::of(job, begin);
    let mut content = Vec::new();
    match ended {
        Ok(Ok(None)) => return None,
        Ok(Ok(Some(planned))) => {
            content = planned.content;
            fill(&mut entry, &planned.set, planned.health, &heard.notes);
        }
        Ok(Err(error)) => entry.error = Some(failure(&error)),
        Err(panic) => entry.error = Some(fault(panic.as_ref())),
    }
    entry.warnings = heard.warnings;
    entry.bytes = content.len() as u64;
    entry.checksum = checksum(&content);
    entry.seconds = clock.elapsed().as_secs_f64();
    Some(Finished { entry, content })
}

/// What to keep of a job that never came back, for this reason: its process or machine was lost.
pub fn lost_job(job: &Job, problem: &str) -> Finished {
    let mut entry = Entry::of(job, SystemTime::now());
    entry.error = Some(Failure {
        kind: "lost".to_owned(),
        place: String::new(),
        problem: problem.to_owned(),
        remedy: "resume the batch: the job is done again".to_owned(),
    });
    Finished { entry, content: Vec::new() }
}

struct Planned {
    set: GripSet,
    health: Option<Value>,
    content: Vec<u8>,
}

fn plan(job: &Job, part: Option<Part>, threads: Option<usize>) -> Result<Plan> {
    let mut request = job.request.clone();
    request.scoring.threads = request.scoring.threads.or(threads);
    let mut builder = Plan::builder(request);
    if let Some(part) = part {
        builder = builder.part(part);
    }
    builder.build()
}

/// What a run came to; `None` where it was stopped.
fn planned(job: &Job, plan: &Plan, outcome: plan::Outcome) -> Result<Option<Planned>> {
    let mut set = outcome.set;
    if !set.provenance.complete {
        return Ok(None);
    }
    set.grips.retain(|ranked| outcome.shown.contains(&ranked.grip.id));
    // Where the work was done must not show in the result.
    set.provenance.request = job.request.clone();
    let mut content = Vec::new();
    set.write_json_lines(&mut content)
        .map_err(|error| Error::io(&job.request.part, "write the result of", error))?;
    Ok(Some(Planned { set, health: serde_json::to_value(&plan.part().health).ok(), content }))
}

/// What the manifest says of a job that ran to its end.
fn fill(entry: &mut Entry, set: &GripSet, health: Option<Value>, notes: &[String]) {
    entry.outcome = if set.any_holds() { Outcome::Grips } else { Outcome::Empty };
    entry.grips = set.grips.len() as u64;
    entry.negatives = set.negatives.len() as u64;
    entry.ranked = set.summary.ranked;
    entry.holding = set.summary.holding;
    entry.candidates = set.summary.candidates;
    entry.rejections.clone_from(&set.summary.rejections);
    entry.best_mu_s = set.grips.first().and_then(|best| best.worst.mu_s);
    entry.health = health;
    entry.summary = Some(set.part.clone());
    entry.resolved = Some(set.provenance.resolved);
    entry.backend.clone_from(&set.provenance.backend);
    if entry.outcome == Outcome::Empty && !set.grips.is_empty() {
        let best = entry.best_mu_s.map_or(String::new(), |mu| format!(": the best needs {mu:.4}"));
        entry.reason = Some(format!("no grip holds with the pads' friction and safety{best}"));
    } else if entry.outcome == Outcome::Empty {
        let mut reasons: Vec<_> = entry.rejections.iter().collect();
        reasons.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        let counts = reasons.iter().take(NAMED_REASONS);
        let counts = counts.map(|(reason, count)| format!("{count} {reason}"));
        let counts = counts.collect::<Vec<_>>().join(", ");
        entry.reason = Some(match (notes, counts.as_str()) {
            ([], "") => "no two opposite faces".to_owned(),
            ([], counts) => format!("rejected: {counts}"),
            (notes, "") => notes.join("; "),
            (notes, counts) => format!("rejected: {counts}; {}", notes.join("; ")),
        });
    }
}

fn failure(error: &Error) -> Failure {
    Failure {
        kind: error.kind().name().to_owned(),
        place: error.place().to_owned(),
        problem: error.problem().to_owned(),
        remedy: error.remedy().to_owned(),
    }
}

/// A panic is a fault of the program, and costs its own job only.
fn fault(panic: &(dyn Any + Send)) -> Failure {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    Failure {
        kind: "panic".to_owned(),
        place: String::new(),
        problem: format!("a fault of the program: {text}"),
        remedy: "please report it with the part".to_owned(),
    }
}

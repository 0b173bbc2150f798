//! The work that lies ahead, told before it starts.

use crate::error::Result;
use crate::propose::Proposer;

use super::Plan;

/// How much a run has to do.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Ahead {
    /// Candidates to look at.
    pub candidates: u64,
    /// Loads on each grip.
    pub loads: u64,
    /// Threads that share the work.
    pub threads: u64,
    /// Time that it takes, roughly: a third to three times this \[s\].
    pub seconds: f64,
    /// Size of the result file at most, roughly \[bytes\].
    pub bytes: f64,
}

/// Processor time for one candidate and for one load of a grip \[s\], as measured on parts of all
/// kinds with one core.
const CANDIDATE: f64 = 15e-6;
const LOAD: f64 = 1.5e-6;
/// More for a grip on curved faces, and for one of its loads \[s\].
const CURVED: f64 = 1e-3;
const CURVED_LOAD: f64 = 20e-6;
/// Share of the candidates that are grips.
const GRIPS: f64 = 0.5;
/// Bytes of one grip in a result file, and of one load of it.
const GRIP_BYTES: f64 = 2e3;
const LOAD_BYTES: f64 = 20.0;

impl Plan {
    /// The work of [`Plan::run`] when it starts at the first candidate.
    ///
    /// # Errors
    /// As [`Proposer::new`].
    pub fn ahead(&self) -> Result<Ahead> {
        let propose = || Proposer::new(&self.part, &self.gripper, &self.propose);
        let proposer = self.threads.install(propose)?;
        let (candidates, curved) = (proposer.candidates(), proposer.curved_candidates());
        let (loads, threads) = (self.loads.len() as u64, self.threads.current_num_threads() as u64);
        let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
        let work = candidates as f64 * (CANDIDATE + GRIPS * LOAD * loads as f64)
            + curved as f64 * GRIPS * (CURVED + CURVED_LOAD * loads as f64);
        let kept = (self.keep() as f64).min(candidates as f64);
        let listed = match self.request.scoring.polish {
            crate::request::Polish::All => loads as f64,
            _ => 0.0,
        };
        Ok(Ahead {
            candidates,
            loads,
            threads,
            seconds: work / threads.min(cores) as f64,
            bytes: kept * (GRIP_BYTES + LOAD_BYTES * listed),
        })
    }
}

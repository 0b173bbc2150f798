//! Jobs cut into shares of their candidates: which are done, and the files that keep them until the
//! whole job is.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::Job;
use super::job::{Finished, gather_job, run_share};
use super::ledger::checksum;
use crate::part::Part;

/// The files of the shares, in the folder for what is under way.
#[derive(Debug, Clone)]
pub(super) struct ShareFiles {
    folder: PathBuf,
    /// Shares of a job.
    pub(super) of: usize,
}

impl ShareFiles {
    pub(super) fn new(folder: &Path, of: usize) -> Self {
        Self { folder: folder.to_owned(), of }
    }

    fn path(&self, job: usize, share: usize) -> PathBuf {
        self.folder.join(format!("{job:07}.{share}-of-{}", self.of))
    }

    /// The share, where it is there and whole.
    pub(super) fn read(&self, job: usize, share: usize) -> Option<Vec<u8>> {
        let mut bytes = std::fs::read(self.path(job, share)).ok()?;
        let sum = bytes.split_off(bytes.len().checked_sub(size_of::<u32>())?);
        (sum == checksum(&bytes).to_le_bytes()).then_some(bytes)
    }

    /// Keeps a share. A failure costs it when the run is resumed, not the run.
    pub(super) fn write(&self, job: usize, share: usize, state: &[u8]) -> std::io::Result<()> {
        let mut bytes = state.to_vec();
        bytes.extend_from_slice(&checksum(state).to_le_bytes());
        std::fs::write(self.path(job, share), bytes)
    }

    /// Removes those of a job.
    pub(super) fn remove(&self, job: usize) {
        (0..self.of).for_each(|share| drop(std::fs::remove_file(self.path(job, share))));
    }
}

/// A job of which several workers do shares.
#[derive(Debug, Default)]
pub(super) struct Split {
    done: AtomicUsize,
    /// Failed or stopped: the other shares are of no use now.
    given_up: AtomicBool,
}

impl Split {
    /// Does a share; who does the last one puts them together, and has the end of the job.
    pub(super) fn run(
        &self,
        job: &Job,
        share: usize,
        files: &ShareFiles,
        part: &mut dyn FnMut() -> Option<Part>,
        (threads, stop): (Option<usize>, &AtomicBool),
    ) -> Option<Finished> {
        if self.given_up.load(Ordering::Relaxed) {
            return None;
        }
        let failed = |finished: Box<Finished>| {
            (!self.given_up.swap(true, Ordering::Relaxed)).then_some(*finished)
        };
        if files.read(job.number, share).is_none() {
            match run_share(job, [share, files.of], part(), threads, stop) {
                None => {
                    self.given_up.store(true, Ordering::Relaxed);
                    return None;
                }
                Some(Err(finished)) => return failed(finished),
                Some(Ok(state)) => {
                    if let Err(error) = files.write(job.number, share, &state) {
                        let problem = format!("its share {share} cannot be kept: {error}");
                        return failed(Box::new(super::lost_job(job, &problem)));
                    }
                }
            }
        }
        if self.done.fetch_add(1, Ordering::AcqRel) + 1 < files.of {
            return None;
        }
        let shares: Option<Vec<Vec<u8>>> =
            (0..files.of).map(|share| files.read(job.number, share)).collect();
        match shares {
            Some(shares) => gather_job(job, &shares, part(), threads),
            None => failed(Box::new(super::lost_job(job, "a share of it is gone or was changed"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_that_is_cut_or_changed_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let files = ShareFiles::new(folder.path(), 3);
        files.write(7, 1, b"state").unwrap();
        assert_eq!(files.read(7, 1).unwrap(), b"state");
        assert_eq!((files.read(7, 0), files.read(8, 1)), (None, None));
        let path = files.path(7, 1);
        let whole = std::fs::read(&path).unwrap();
        for bad in [&whole[..3], &whole[..whole.len() - 1], b"State1234"] {
            std::fs::write(&path, bad).unwrap();
            assert_eq!(files.read(7, 1), None);
        }
        files.remove(7);
        assert!(!path.exists());
    }
}

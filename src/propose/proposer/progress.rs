//! How far a run has come, so that another one can go on from there.

use serde::{Deserialize, Serialize};

use super::{Cursor, Proposer, Tally};
use crate::error::{Error, ErrorKind, Result};

/// Where the next chunk starts and what was counted so far. It fits the same part, gripper and
/// options only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    next: Cursor,
    corners: f64,
    tally: Tally,
}

impl Progress {
    /// Candidates looked at so far.
    pub fn candidates(&self) -> u64 {
        self.tally.candidates
    }
}

impl Proposer<'_> {
    /// How far this run has come: after the last chunk taken.
    pub fn progress(&self) -> Progress {
        Progress { next: self.next, corners: self.corners, tally: self.tally.clone() }
    }

    /// Takes over what the shares of a run have counted, as if this one had looked at all of its
    /// candidates.
    ///
    /// # Errors
    /// When they are not the shares of this run, or not all of them.
    pub fn gather<'p>(&mut self, shares: impl IntoIterator<Item = &'p Progress>) -> Result<()> {
        let before = self.tally.clone();
        for Progress { tally, .. } in shares {
            self.tally.candidates += tally.candidates;
            self.tally.grips += tally.grips;
            for (reason, count) in &tally.rejections {
                // What is known before the first candidate stands in every share.
                let known = before.rejections.get(reason).copied().unwrap_or(0);
                let counted = self.tally.rejections.entry(reason.clone()).or_default();
                *counted += count.saturating_sub(known);
            }
        }
        if self.tally.candidates != self.candidates() {
            let problem =
                format!("hold {} of {} candidates", self.tally.candidates, self.candidates());
            let remedy = "give every share of one run once";
            return Err(Error::new(ErrorKind::Mismatch, "shares", problem, remedy));
        }
        Ok(())
    }

    /// Goes on where a run with the same part, gripper and options had come to: the chunks that
    /// follow are the same as there.
    ///
    /// # Errors
    /// When there is no such place among the candidates.
    pub fn resume(&mut self, progress: &Progress) -> Result<()> {
        let Progress { next, corners, tally } = progress;
        let there = match self.sites.get(next.site) {
            Some(site) => {
                next.angle <= site.angles.len()
                    && (next.position == 0
                        || next.angle < site.angles.len()
                            && next.position <= site.places(next.places, next.angle).len())
            }
            None => next.site == self.sites.len(),
        };
        if !(there
            && corners.is_finite()
            && *corners >= 1.0
            && tally.candidates <= self.candidates())
        {
            let problem = format!(
                "the place at which it stopped (face pair {}, angle {}, position {}) is not there",
                next.site, next.angle, next.position
            );
            return Err(Error::new(
                ErrorKind::Mismatch,
                "unfinished run",
                problem,
                "start from the beginning",
            )
            .with_options(&["resume"]));
        }
        (self.next, self.corners, self.tally) = (*next, *corners, tally.clone());
        Ok(())
    }
}

//! A run in shares: each looks at some of the candidates, on whatever machine, and one puts together
//! what they have found.

use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

use super::checkpoint::Checkpoint;
use super::search::Found;
use super::{Collector, Observer, Outcome, Plan};
use crate::error::{Error, Result};
use crate::propose::Proposer;
use crate::request::Polish;

impl Plan {
    /// Looks at the share `number`, from 0, of `of` shares of the candidates, and gives what it has
    /// found, for [`Plan::gather`]; `None` when it was stopped.
    ///
    /// # Errors
    /// As [`Plan::run`], and when grips are to be left unsolved (polish `top`): which ones hangs on
    /// the shares before.
    pub fn run_share(
        &self,
        number: usize,
        of: usize,
        stop: &AtomicBool,
    ) -> Result<Option<Vec<u8>>> {
        if number >= of {
            let problem = format!("there is no share {number} of {of}");
            return Err(Error::input("split", problem, "count shares from 0"));
        }
        self.check_shares()?;
        self.threads.install(|| {
            let selection = self.select_backend()?;
            let assessor = self.assessor(&selection.backend);
            let mut proposer = Proposer::new(&self.part, &self.gripper, &self.propose)?;
            proposer.take_share(number, of);
            let found = self.search(&assessor, None).run(&mut proposer, &mut (), stop)?;
            if !found.complete {
                return Ok(None);
            }
            let (inputs, progress) = (self.inputs(), proposer.progress());
            let state = Checkpoint::new(&inputs, &found.backend, &progress, &found.collector);
            state.to_bytes().map(Some)
        })
    }

    /// Puts together what all shares of this plan have found, in the order of their numbers: the
    /// outcome is that of [`Plan::run`].
    ///
    /// # Errors
    /// As [`Plan::run_share`], and when they are not all the shares of this plan.
    pub fn gather(&self, shares: &[Vec<u8>], observer: &mut dyn Observer) -> Result<Outcome> {
        self.check_shares()?;
        self.threads.install(|| {
            self.warnings.iter().for_each(|text| observer.warning(text));
            let selection = self.select_backend()?;
            let assessor = self.assessor(&selection.backend);
            let mut proposer = Proposer::new(&self.part, &self.gripper, &self.propose)?;
            let inputs = self.inputs();
            let mut collector = Collector::sampling(self.sample());
            let (mut backends, mut progress) = (Vec::<String>::new(), Vec::new());
            for (number, bytes) in shares.iter().enumerate() {
                let state = Checkpoint::parse(&format!("share {number}"), bytes, &inputs)?;
                collector.gather(state.collector.into_owned());
                progress.push(state.progress);
                if !backends.iter().any(|known| *known == *state.backend) {
                    backends.push(state.backend.into_owned());
                }
            }
            proposer.gather(progress.iter().map(Cow::as_ref))?;
            let backend = backends.join(", ");
            let found = Found { collector, complete: true, backend, checkpoint: None };
            self.conclude(&proposer, &assessor, found, observer, &AtomicBool::new(false))
        })
    }

    fn check_shares(&self) -> Result<()> {
        if self.request.scoring.polish != Polish::Top {
            return Ok(());
        }
        Err(Error::input(
            "polish",
            "'top' leaves grips unsolved by what came before them, which a share does not know",
            "choose auto, worst or all, or do not split",
        )
        .with_options(&["polish"]))
    }
}

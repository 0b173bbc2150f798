//! Where seeds are computed, and what comes of it.

#[cfg(feature = "gpu")]
use super::gpu::Gpu;
use super::prepare::Contacts;
use super::problem::{Batch, Seed};
use super::score::ScoreOptions;
use super::screen::{self, Wanted};
use super::seeds::SeedSet;
use crate::error::Result;

/// Where seeds are computed.
#[derive(Debug)]
pub enum Backend {
    /// The processor, on rayon's threads.
    Cpu,
    /// A graphics processor.
    #[cfg(feature = "gpu")]
    Gpu(Box<Gpu>),
}

/// Loads of some problems with their seeds, one problem after the other.
#[derive(Debug, Default)]
pub(super) struct Survivors {
    /// Which load of its problem each is; rising within a problem.
    pub(super) loads: Vec<u32>,
    /// Its seed.
    pub(super) seeds: Vec<Seed>,
    /// End of each problem's.
    ends: Vec<usize>,
}

impl Survivors {
    /// The loads of each problem with their seeds.
    pub(super) fn by_problem(&self) -> impl Iterator<Item = (&[u32], &[Seed])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| (&self.loads[start..end], &self.seeds[start..end]))
    }
}

impl Backend {
    /// `cpu`, or the adapter's name and driver.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => "cpu".to_owned(),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.name(),
        }
    }

    /// Notes on a running clock ([`Gpu::start_clock`]) how long exact answers took.
    #[cfg(feature = "gpu")]
    pub(super) fn solved_since(&self, start: std::time::Instant) {
        if let Self::Gpu(gpu) = self {
            gpu.polished_since(start);
        }
    }

    /// Without a graphics processor there is no clock.
    #[cfg(not(feature = "gpu"))]
    pub(super) fn solved_since(&self, _: std::time::Instant) {}

    /// Seeds of all loads of all problems, in order. Equal input gives equal output on one backend,
    /// whatever the number of threads, and however the batch is cut or permuted.
    ///
    /// On a graphics processor loads are made in single precision and their bounds widened for that,
    /// by a share of at most 5e-4; the seeds of loads without bounds are the processor's: estimates are
    /// for [`Backend::score`] alone.
    ///
    /// # Errors
    /// A bad value for numbers that are not finite or a gripping force that is not positive;
    /// A device error when the GPU fails.
    pub fn seed(&self, batch: &Batch<'_>, seeds: &SeedSet) -> Result<Vec<Seed>> {
        let contacts = Contacts::new(&batch.problems)?;
        Ok(self.survivors_on(&contacts, batch, seeds, Wanted::All)?.seeds)
    }

    /// The loads of each grip that can be the one with the largest `mu_s`, in their order, with
    /// their seeds as [`Backend::seed`] gives them. The others are left out by a bound.
    ///
    /// # Errors
    /// As [`Backend::seed`].
    pub fn survivors(&self, batch: &Batch<'_>, seeds: &SeedSet) -> Result<Vec<Vec<(usize, Seed)>>> {
        self.survivors_wanted(batch, seeds, Wanted::Worst)
    }

    /// The loads among which [`Backend::score`] looks for the worst one of each grip, where not all are
    /// solved: as [`Backend::survivors`], and on a graphics processor without those that an estimate
    /// leaves out, the others with theirs ([`super::SeedStatus::Estimated`]).
    ///
    /// # Errors
    /// As [`Backend::seed`].
    pub fn survivors_for(
        &self,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        options: &ScoreOptions,
    ) -> Result<Vec<Vec<(usize, Seed)>>> {
        self.survivors_wanted(batch, seeds, options.wanted())
    }

    fn survivors_wanted(
        &self,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        wanted: Wanted,
    ) -> Result<Vec<Vec<(usize, Seed)>>> {
        let contacts = Contacts::new(&batch.problems)?;
        let found = self.survivors_on(&contacts, batch, seeds, wanted)?;
        let pairs = |(loads, seeds): (&[u32], &[Seed])| {
            loads.iter().map(|&load| load as usize).zip(seeds.iter().copied()).collect()
        };
        Ok(found.by_problem().map(pairs).collect())
    }

    /// The loads that are wanted, with the batch's contacts made ready before.
    pub(super) fn survivors_on(
        &self,
        contacts: &Contacts,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        wanted: Wanted,
    ) -> Result<Survivors> {
        let by_problem = match self {
            Self::Cpu => screen::survivors(contacts, batch, seeds, wanted)?,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.survivors(contacts, batch, seeds, wanted)?,
        };
        let mut survivors = Survivors::default();
        for found in by_problem {
            for (load, seed) in found {
                survivors.loads.push(load);
                survivors.seeds.push(seed);
            }
            survivors.ends.push(survivors.loads.len());
        }
        Ok(survivors)
    }
}

//! The flags that choose where seeds are computed, shared by the subcommands that score.

use clap::Args as ClapArgs;
use gripfast::backend::{Choice, SeedSet, Selection, select};
use gripfast::request::Scoring;

#[derive(Debug, ClapArgs)]
pub(crate) struct BackendArgs {
    /// Where slip twists are searched: auto, cpu or gpu. gpu without a graphics processor is an
    /// error; the answers agree to 1e-9, in the same order.
    #[arg(long, default_value = "auto", value_name = "auto|cpu|gpu")]
    pub(crate) backend: Choice,
    /// Graphics adapter, by its number or part of its name as `gripfast devices` lists them
    /// [default: GRIPFAST_ADAPTER].
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) adapter: Option<String>,
    /// Slip twists tried for each load before the exact solver, at least.
    #[arg(long, value_name = "N", default_value_t = Scoring::default().seeds)]
    pub(crate) seeds: usize,
}

/// Limits the processor to so many threads; all cores without a number.
pub(crate) fn use_threads(threads: Option<usize>) -> anyhow::Result<()> {
    if let Some(threads) = threads.map(sensible) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    }
    Ok(())
}

/// A number of threads that the machine can use; said when it is less than asked for.
fn sensible(threads: usize) -> usize {
    let most = gripfast::plan::most_threads();
    if threads > most {
        crate::terminal::say(&format!(
            "warning: {threads} threads are more than this machine can use: {most} run"
        ));
    }
    threads.min(most)
}

/// So many threads of its own; one for each core without a number.
pub(crate) fn pool(threads: Option<usize>) -> anyhow::Result<rayon::ThreadPool> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads.map_or(0, sensible)).build()?)
}

impl BackendArgs {
    /// Opens the backend.
    pub(crate) fn select(&self) -> anyhow::Result<Selection> {
        Ok(select(self.backend, self.adapter.as_deref())?)
    }

    /// The set of twists.
    pub(crate) fn seed_set(&self) -> anyhow::Result<SeedSet> {
        Ok(SeedSet::with_at_least(self.seeds)?)
    }
}

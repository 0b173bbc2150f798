//! Many parts, grippers and load sets: each combination is a job, and each job is a
//! [`crate::request::Request`].
//!
//! [`Batch`] says which jobs there are; [`run_job`] does one of them, wherever; [`Store`] keeps what
//! came of them in a folder, so that nothing finished is lost or done twice; [`run`] does all of
//! them here. One bad part never stops the others. A large job can be cut into shares of its
//! candidates ([`run_share`], [`gather_job`]), which changes nothing in its result.
//!
//! ```
//! use gripfast::batch::{self, Batch, Workers};
//!
//! let jobs = r#"
//!     parts = ["data/parts/hex_nut.stl", "data/parts/shaft_key.stl"]
//!     grippers = ["generic"]
//!
//!     [request]
//!     density = "7850kg/m3"
//!     [request.candidates]
//!     spacing = "8mm"
//!     angle_step = "90deg"
//! "#;
//! let folder = tempfile::tempdir().expect("a folder for temporary files");
//! let batch = Batch::from_toml("jobs", jobs)?;
//! let jobs = batch.jobs()?;
//! let report = batch::run(&jobs, folder.path(), false, Workers::default(), &mut (), &false.into())?;
//! assert_eq!((report.grips, report.failed), (2, 0));
//! # Ok::<(), gripfast::error::Error>(())
//! ```

mod describe;
mod job;
mod ledger;
mod run;
mod shard;
mod split;
mod store;

pub use describe::{Batch, Job, Variant};
pub use job::{
    Entry, Failure, Finished, Outcome, ShareOutcome, gather_job, lost_job, run_job, run_share,
};
pub use run::{Watch, Workers, run};
pub use store::{Counts, Report, Store};

/// Grips kept of each job where nobody says how many.
pub const TOP: usize = 100;

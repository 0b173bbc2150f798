//! The seed stage on processor or GPU: for every load the best slip twist of a fixed set, with
//! bounds on `mu_s`.
//!
//! The gradient of the dissipation at a twist depends on the contact polygons alone, linearly in
//! the pressure. It is computed once per distinct contact and twist (nine numbers per face); what
//! is left per load is a small product and a maximum. The supports of the triangles round the best
//! twist give an upper bound: `w` is a combination of three gradients, and the sum of its
//! coefficients' magnitudes bounds `mu_s`, because `D` is a norm.
//!
//! Where the bounds hold: congruent faces in full contact, whose summed pressure is constant, so
//! that neither `M1, M2, F3` nor the distance of the faces matters; and different faces in full
//! contact whose friction coupling is weak, the bounds being widened by all that it can do.
//! Elsewhere the seeds come from the pressure without friction coupling, and there are no bounds;
//! which of those loads can be the worst is told by a few of Newton's steps on the seven equations,
//! whose contraction bounds what they leave: on the processor in double precision, on a GPU in single
//! precision, with a margin for its rounding.

mod choice;
mod cpu;
mod curved;
mod fan;
#[cfg(feature = "gpu")]
mod gpu;
mod job;
mod lanes;
#[doc(hidden)]
pub mod layout;
mod neighbours;
mod prepare;
mod problem;
mod score;
mod screen;
mod search;
mod seeds;
mod table;
mod top;
#[cfg(test)]
mod twins;
mod watch;
mod worst;

#[cfg(feature = "gpu")]
pub use gpu::{
    ADAPTER_VARIABLE, AdapterSummary, ChunkSpans, Deviation, DeviceSpans, Gpu, KernelCheck, Span,
    Timeline, list as list_adapters,
};

pub use crate::request::{Choice, Polish};
pub use choice::{Selection, select};
pub use curved::{CurvedProblem, score_curved};
pub(crate) use curved::{exceeding_curved, score_curved_watched};
pub use job::Backend;
pub use problem::{Batch, F32_TOLERANCE, LOAD_TOLERANCE, Pose, Problem, Seed, SeedStatus};
pub(crate) use score::Exceeding;
pub use score::{ScoreOptions, Scored};
pub use seeds::{NEGATED, RING, SeedSet};
pub use top::Best;
pub use watch::Watch;

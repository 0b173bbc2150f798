//! Collision of a gripper with what is around it, for the two that need it: proposals and the
//! choice at run time.
//!
//! A [`Sweep`] is the space that a body takes while the jaws close, on the approach or on the
//! retreat. Proposals take [`sweeps`] of a [`Motion`] and test many positions of them against the
//! part's [`Tree`]; the choice takes the [`Volumes`] of a [`Course`], guesses with [`Nearby`] and
//! proves with a [`MeshObstacle`].

mod nearby;
mod obstacle;
mod sweep;
mod tree;

pub(crate) use nearby::Nearby;
pub(crate) use obstacle::{Course, MeshObstacle, Room, Volumes};
pub use sweep::Phase;
pub(crate) use sweep::{Motion, Sweep, sweeps};
pub(crate) use tree::{Topology, Tree};

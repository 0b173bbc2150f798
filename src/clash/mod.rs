//! Collision of a gripper with what is around it, for the two that need it: proposals and the
//! choice at run time.
//!
//! A [`Sweep`] is the space that a body takes while the jaws close, on the approach or on the
//! retreat. Proposals take [`sweeps`] of a [`Motion`] and test many positions of them against the
//! part's [`Tree`]. Against a scene, a [`Cell`] takes the [`Volumes`] of a [`Course`], guesses with
//! points nearby and proves with trees.

mod cell;
mod nearby;
mod obstacle;
mod sweep;
mod tree;

pub(crate) use cell::Cell;
pub use cell::Reason;
pub(crate) use obstacle::{Course, Room, Volumes};
pub use sweep::Phase;
pub(crate) use sweep::{Motion, Sweep, sweeps};
pub(crate) use tree::{Topology, Tree};

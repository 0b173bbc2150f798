//! One contact pair, one wrench, one answer: the smallest friction coefficient that holds.
//!
//! [`solve`] answers one case; [`Pads`] keeps what a contact determines for many loads.

pub(crate) mod abreast;
mod branch;
mod compare;
pub mod curved;
pub(crate) mod equilibrium;
mod growth;
pub mod inverse;
pub mod pads;
pub(crate) mod pressure;
pub(crate) mod shanno;
#[doc(hidden)] // the convex problem alone: the seeds' tests and a bench look at it
pub mod slip;
mod solve;
pub(crate) mod states;
mod turns;
pub mod twist_out;

pub use crate::request::{Refiner, Separation};
pub use branch::COUPLING_SEARCH;
pub(crate) use compare::{Comparer, Comparison, Neighbour, Question};
pub use pads::{Load, Pads, squeeze_pressure};
pub use solve::{Options, Search, Start, limit_states, refused, solve, solve_next, solve_pads};
pub(crate) use solve::{check, nearby};

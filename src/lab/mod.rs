//! The methods that the program is compared with, and the paper's figures.
//!
//! [`paper`] is the paper's own method, [`earlier`] the one that it improves on, [`compare`] puts
//! the earlier order beside the ranking, [`figures`] draws what the paper shows, and
//! [`benchmark`] has grips with exact answers for simulators. Nothing outside
//! the command line imports from here.

pub mod benchmark;
pub mod compare;
pub mod earlier;
pub mod figures;
pub mod paper;

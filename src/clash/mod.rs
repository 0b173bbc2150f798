//! Collision of a gripper with what is around it, for the two that need it: proposals and the
//! choice at run time.
//!
//! [`sweep`] says what space a body takes while the jaws close and approach, [`tree`] finds the
//! triangles near a box, [`nearby`] guesses from surface points, [`obstacle`] puts them together.

pub(crate) mod nearby;
pub(crate) mod obstacle;
pub(crate) mod sweep;
pub(crate) mod tree;

//! To be written.
pub mod shanno;

//! To be written.
pub mod contact_svg;

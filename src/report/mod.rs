//! To be written.
pub mod contact_svg;
pub mod figures;

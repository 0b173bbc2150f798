//! From a part and a gripper to candidate grips free of interference, with a reason for every
//! rejection.
//!
//! Antiparallel face pairs within the stroke become sites; each site gets a grid of positions and a
//! set of approach angles; each candidate is clipped to its contact polygons and tested for
//! interference of fingers and palm with the part, in the grip, while the jaws close, and along the
//! straight approach. Candidates flow in chunks, so that memory stays bounded whatever their
//! number; their order and numbers depend on the input and the options alone.

mod displace;
mod environment;
mod explain;
mod fit;
mod interference;
mod miss;
mod options;
mod patch;
mod proposer;
mod sample;
mod site;
mod stroke;
mod work;

pub use displace::Displacement;
pub use explain::{Check, Explanation, SiteInfo};
pub use fit::{Fit, Misfit};
pub use options::{Cone, Ground, ProposeOptions, Rejection};
pub use proposer::{Chunk, Progress, Proposer, Tally};
pub use sample::scatter;

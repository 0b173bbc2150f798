//! The result file: everything a run found, with its provenance. Native JSON; other formats are made from it.
//!
//! [`GripSet::read`], [`GripSet::write`] and [`GripSet::write_lines`] are its only doors. Numbers that are not finite are null.

mod file;

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::model::{Bounds, Grip, Pressure, Slip, Status, Wrench};
use crate::part::MassProperties;

/// Marks a native result file.
pub const FORMAT: &str = "gripfast-grips";
/// Version of the layout of [`GripSet`].
pub const VERSION: u32 = 1;

/// A ranked list of grips on one part with one gripper under one set of loads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GripSet {
    /// Always [`FORMAT`].
    pub format: String,
    /// Always [`VERSION`] in files this version writes.
    pub version: u32,
    /// Where the numbers come from.
    pub provenance: Provenance,
    /// The part.
    pub part: PartSummary,
    /// The gripper, whole: [`crate::gripper::Gripper`] as JSON, in SI units.
    pub gripper: serde_json::Value,
    /// The load cases, in the order of the load indices used below.
    pub loads: Vec<LoadCase>,
    /// What was proposed, and why the others fell.
    pub summary: Summary,
    /// Best first.
    pub grips: Vec<RankedGrip>,
}

/// How a result was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Program version.
    pub gripfast: String,
    /// The command line.
    pub command: Vec<String>,
    /// `cpu`, or the GPU adapter's name and driver.
    pub backend: String,
    /// The settings that decide the answer, by name, in SI units.
    pub settings: BTreeMap<String, serde_json::Value>,
}

/// The part as the result file carries it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartSummary {
    /// File it was read from.
    pub file: String,
    /// Unit of the file's numbers in metres.
    pub unit_m: f64,
    /// Triangles after repair.
    pub triangles: usize,
    /// Smallest corner of the bounding box [m].
    pub bbox_min: DVec3,
    /// Largest corner of the bounding box [m].
    pub bbox_max: DVec3,
    /// Mass, centre of mass, inertia.
    pub mass: MassProperties,
}

/// One load: an external wrench on the body about the centre of mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LoadCase {
    /// What it is, e.g. `gravity -z`.
    pub name: String,
    /// Force and moment in the part frame, moment about the centre of mass.
    pub wrench: Wrench,
}

/// Counts of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Antiparallel face pairs within the stroke.
    pub pairs: u64,
    /// Candidates proposed.
    pub candidates: u64,
    /// Grips left in the ranking.
    pub ranked: u64,
    /// Rejected candidates by reason.
    pub rejections: BTreeMap<String, u64>,
}

/// A grip with its score, worst load and rank.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RankedGrip {
    /// 1 is the best.
    pub rank: u64,
    /// The grip: pose, width, faces, contact polygons.
    #[serde(flatten)]
    pub grip: Grip,
    /// `k1/mu_s + k2 alpha`, larger is better; `mu_s = 0` gives infinity, written as null.
    pub score: Option<f64>,
    /// Answer under the worst load.
    pub worst: LoadScore,
    /// Angle by which the part may be tilted before the closing jaws no longer right it [rad].
    pub alpha: f64,
    /// Opening of the jaws needed to twist the part out [m].
    pub delta_d: f64,
    /// Smaller of the two contact areas left over its nominal area, at the worst load (0..1).
    pub contact_share: f64,
    /// `1 - |M|/(Fn w)` in the direction of the worst load's out-of-plane moment.
    pub twist_margin: f64,
    /// Pad friction over `mu_s`; `None` when the gripper states no pad friction or `mu_s = 0`.
    pub safety: Option<f64>,
    /// Gripping force at which `mu_s` of the worst load equals the pad friction [N].
    pub force_needed: Option<f64>,
    /// Ids of the grips left out because a symmetry of the part maps them to this one, where they were merged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub merged: Vec<u64>,
    /// `mu_s` of every load in the order of [`GripSet::loads`], when asked for; a load without limit state is null.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mu_by_load: Vec<Option<f64>>,
}

/// The answer under one load.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LoadScore {
    /// Index into [`GripSet::loads`].
    pub load: u32,
    /// The wrench in the grip frame about its origin.
    pub wrench: Wrench,
    /// See [`Status`].
    pub status: Status,
    /// Smallest friction coefficient that holds this load.
    pub mu_s: Option<f64>,
    /// Incipient motion.
    pub slip: Option<Slip>,
    /// Pressure planes.
    pub pressure: Option<Pressure>,
    /// Certificate.
    pub bounds: Option<Bounds>,
    /// Largest scaled residual of the seven equations.
    #[serde(with = "crate::model::null_is_infinite")]
    pub residual: f64,
}

/// A rotation as a quaternion `[x, y, z, w]` of a proper rotation matrix.
pub fn quaternion_xyzw(rotation: DMat3) -> [f64; 4] {
    glam::DQuat::from_mat3(&rotation).normalize().to_array()
}

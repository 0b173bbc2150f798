//! The result file: everything a run found, with its provenance. Native JSON; other formats are
//! made from it.
//!
//! [`GripSet::read`], [`GripSet::write`] and [`GripSet::write_lines`] are its only doors. Numbers
//! that are not finite are null.

mod file;
mod source;
mod verdict;
mod version1;

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::mechanics::curved::{FaceAnswer, Note};
use crate::model::{Bounds, Grip, Negative, Pressure, Slip, Status, Wrench};
use crate::part::{MassProperties, Symmetry};
use crate::request::Request;
use crate::units::{Force, Length};

pub use crate::model::LoadCase;
pub use verdict::{ForceRange, PadFriction, Verdict};

/// Marks a native result file.
pub const FORMAT: &str = "gripfast-grips";
/// Version of the layout of [`GripSet`].
pub const VERSION: u32 = 2;

/// A ranked list of grips on one part with one gripper under one set of loads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
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
    /// A sample of the candidates that are no grips, when asked for, in the order of their ids.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub negatives: Vec<Negative>,
    /// Best first: those that hold, then those that slip.
    pub grips: Vec<RankedGrip>,
}

/// How a result was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Provenance {
    /// Program version.
    pub gripfast: String,
    /// The command line; empty where a program called the library.
    pub command: Vec<String>,
    /// `cpu`, or the GPU adapter's name and driver.
    pub backend: String,
    /// What was asked for, whole. Of a file of version 1 `loads` is empty, because it did not say;
    /// the load cases themselves are [`GripSet::loads`].
    pub request: Request,
    /// What was used where the request leaves the choice to the gripper or a rule.
    pub resolved: Resolved,
    /// Whether every candidate was looked at; else the run was interrupted.
    pub complete: bool,
    /// What a user should know of the part before relying on the numbers.
    pub warnings: Vec<String>,
}

impl Provenance {
    /// That of a complete run on the processor by this version.
    pub fn new(request: Request, resolved: Resolved) -> Self {
        Self {
            gripfast: env!("CARGO_PKG_VERSION").to_owned(),
            command: Vec::new(),
            backend: "cpu".to_owned(),
            request,
            resolved,
            complete: true,
            warnings: Vec::new(),
        }
    }
}

/// The values of options whose default depends on the gripper or on other options.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Resolved {
    /// Gripping force.
    pub force: Force,
    /// Step of the position grid.
    pub spacing: Length,
    /// Friction coefficient of the pads; `None` where neither request nor gripper states one.
    pub pad_friction: Option<f64>,
    /// Factor by which it must exceed `mu_s` for a grip to hold.
    #[serde(default = "one")]
    pub safety: f64,
    /// Slip twists tried for each load.
    pub seeds: usize,
    /// Best grips kept, at most.
    pub keep: usize,
    /// Pressure per compression of the pads' layers [Pa/m], for faces that are not plane:
    /// [`crate::gripper::Gripper::layer`]; of a file that does not say zero.
    #[serde(default)]
    pub pad_stiffness: f64,
}

impl Default for Resolved {
    /// Nothing but a safety of 1.
    fn default() -> Self {
        let (force, spacing) = (Force::default(), Length::default());
        let (pad_friction, safety) = (None, one());
        Self { force, spacing, pad_friction, safety, seeds: 0, keep: 0, pad_stiffness: 0.0 }
    }
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
    /// Smallest corner of the bounding box \[m\].
    pub bbox_min: DVec3,
    /// Largest corner of the bounding box \[m\].
    pub bbox_max: DVec3,
    /// Mass, centre of mass, inertia.
    pub mass: MassProperties,
    /// The turns that map the part to itself, where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symmetry: Option<Symmetry>,
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
    /// Of these, those that hold; `None` where the friction of the pads is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holding: Option<u64>,
    /// Rejected candidates by reason.
    pub rejections: BTreeMap<String, u64>,
    /// Against the earlier evaluation function, when asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
}

/// How the ranking agrees with that of the earlier evaluation function
/// `(k1 Delta_d + k2 tau_s/(mu_s N))/(D + epsilon) + k3 alpha` (the paper's section 2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Grips compared: those of the list.
    pub grips: u64,
    /// Weight of `Delta_d`.
    pub k1: f64,
    /// Weight of the mean radius `tau_s/(mu_s N)`.
    pub k2: f64,
    /// Weight of alpha [1/rad].
    pub k3: f64,
    /// Added to the distance from the centre of mass \[m\].
    pub epsilon_m: f64,
    /// Spearman's rank correlation; `None` where one of the orders has no two different places.
    pub spearman: Option<f64>,
    /// Kendall's tau-b; `None` as above.
    pub kendall_tau_b: Option<f64>,
    /// Grips that gain most places over the earlier order, most first; one for all that tie in
    /// both.
    pub risen: Vec<u64>,
    /// Grips that lose most places, most first.
    pub fallen: Vec<u64>,
}

/// What the earlier method (slip centre at the centroid, uniform pressure) says of a grip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EarlierScore {
    /// The earlier evaluation function, larger is better.
    pub evaluation: f64,
    /// Place by it among the grips of the list, 1 is the best; grips that tie share the mean of
    /// their places.
    pub place: f64,
    /// Its friction coefficient under [`RankedGrip::worst`]'s load.
    pub mu_s: f64,
    /// Its slip centre, the centroid of the contact, in `(x1, x2)` \[m\].
    pub slip_centre: [f64; 2],
    /// Distance of the slip centre from the centre of mass in the pad plane \[m\], the function's
    /// `D`.
    pub distance: f64,
}

/// What a grip becomes when the gripper stands a little off its pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseNoise {
    /// Displaced poses tried.
    pub samples: u32,
    /// Of these, how many do not hold: no contact on a face, twisted out, a pad pulled off.
    pub lost: u32,
    /// 95 of 100 poses hold with this friction coefficient or less; `None` when more are lost.
    pub mu_s_95: Option<f64>,
    /// Largest `mu_s` of all; `None` when any is lost.
    pub mu_s_worst: Option<f64>,
}

/// A grip with its score, worst load and rank.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RankedGrip {
    /// 1 is the best.
    pub rank: u64,
    /// The grip: pose, width, faces, contact polygons.
    #[serde(flatten)]
    pub grip: Grip,
    /// `k1/mu_s + k2 alpha`, larger is better; `mu_s = 0` gives infinity, written as null.
    pub score: Option<f64>,
    /// Whether the pads hold it, see [`PadFriction::verdict`]; `None` where their friction is not
    /// known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holds: Option<bool>,
    /// Answer under the worst load.
    pub worst: LoadScore,
    /// Angle by which the part may be tilted before the closing jaws no longer right it \[rad\].
    pub alpha: f64,
    /// Opening of the jaws needed to twist the part out \[m\].
    pub delta_d: f64,
    /// Smaller of the two contact areas left over its nominal area, at the worst load (0..1).
    pub contact_share: f64,
    /// `1 - |M|/(Fn w)` in the direction of the worst load's out-of-plane moment.
    pub twist_margin: f64,
    /// Pad friction over `mu_s`; `None` when the gripper states no pad friction or `mu_s = 0`.
    pub safety: Option<f64>,
    /// Gripping force of one jaw at which the pad friction over the safety just holds every load \[N\].
    /// With less force than the plan's the load that needs it is often another than the worst one, most
    /// of all where a pad lifts. See [`crate::plan::Assessor::finish`].
    pub force_needed: Option<f64>,
    /// Of a contact that is not plane: what each face carries under the worst load.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faces: Option<[FaceAnswer; 2]>,
    /// Of a contact that is not plane: what to know beside the numbers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<Note>,
    /// Ids of the grips left out because a symmetry of the part maps them to this one, where they
    /// were merged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub merged: Vec<u64>,
    /// Largest multiple of all loads that the pad friction holds together with every smaller one;
    /// `None` without a pad friction, or without a load.
    #[serde(default)]
    pub load_multiple: Option<f64>,
    /// By the earlier method, when asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub earlier: Option<EarlierScore>,
    /// Under an uncertain pose, when asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_noise: Option<PoseNoise>,
    /// `mu_s` of every load in the order of [`GripSet::loads`], when asked for; a load without
    /// limit state is null.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mu_by_load: Vec<Option<f64>>,
}

impl RankedGrip {
    /// A grip and its answer under its worst load; everything else is zero, or not there.
    pub fn new(grip: Grip, worst: LoadScore) -> Self {
        Self {
            rank: 0,
            grip,
            score: None,
            holds: None,
            worst,
            alpha: 0.0,
            delta_d: 0.0,
            contact_share: 0.0,
            twist_margin: 0.0,
            safety: None,
            force_needed: None,
            faces: None,
            notes: Vec::new(),
            merged: Vec::new(),
            load_multiple: None,
            earlier: None,
            pose_noise: None,
            mu_by_load: Vec::new(),
        }
    }
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

/// The safety where nobody asks for one.
fn one() -> f64 {
    1.0
}

impl RankedGrip {
    /// Whether the part all but slides under the worst load: see [`Slip::slides`].
    pub fn slides(&self) -> bool {
        let faces = self.faces.iter().flatten().flat_map(|face| face.extent);
        let reach = faces.map(|[x, y]| x.hypot(y)).fold(self.grip.width / 2.0, f64::max);
        self.worst.slip.is_some_and(|slip| slip.slides(reach))
    }

    /// Friction needed under the worst load; `None` where no limit state holds it.
    pub fn friction_needed(&self) -> Option<f64> {
        self.worst.mu_s.filter(|_| self.worst.status.holds())
    }
}

impl GripSet {
    /// What the pads of this result give, and what is asked of them.
    pub fn pads(&self) -> PadFriction {
        let Resolved { pad_friction: value, safety, .. } = self.provenance.resolved;
        PadFriction { value, safety }
    }

    /// Whether the pads hold a grip of this set.
    pub fn verdict(&self, ranked: &RankedGrip) -> Verdict {
        self.pads().verdict(ranked.friction_needed())
    }

    /// How many of the ranked grips hold, [`Summary::holding`]; of a file that does not say, how
    /// many of those in it. `None` where the friction of the pads is not known.
    pub fn holding(&self) -> Option<u64> {
        self.pads().value?;
        let holds = |ranked: &&RankedGrip| self.verdict(ranked).holds() == Some(true);
        Some(self.summary.holding.unwrap_or_else(|| self.grips.iter().filter(holds).count() as u64))
    }

    /// Whether there is something to grip with: a grip that holds, or one at all where the friction
    /// of the pads is not known.
    pub fn any_holds(&self) -> bool {
        self.grips.iter().any(|ranked| self.verdict(ranked).holds() != Some(false))
    }

    /// Least and largest gripping force of the gripper \[N\]; `None` where it does not say.
    pub fn gripper_force(&self) -> Option<[f64; 2]> {
        serde_json::from_value(self.gripper.get("force")?.clone()).ok()
    }

    /// Where the force that a grip needs lies in what the gripper has.
    pub fn force_range(&self, ranked: &RankedGrip) -> Option<ForceRange> {
        Some(ForceRange::of(ranked.force_needed?, self.gripper_force()?))
    }
}

/// A rotation as a quaternion `[x, y, z, w]` of a proper rotation matrix.
pub fn quaternion_xyzw(rotation: DMat3) -> [f64; 4] {
    glam::DQuat::from_mat3(&rotation).normalize().to_array()
}

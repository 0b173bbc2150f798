//! What to propose, and the reasons for which a candidate falls.

use std::sync::Arc;

use glam::DVec3;
use serde::{Serialize, Serializer};

use crate::error::{Error, Result};
use crate::gripper::Gripper;
use crate::model::Frame;
use crate::request::{Candidates, Region, Side};
use crate::scene::Scene;

pub use crate::request::{Cone, Ground};

/// What to propose: from a request, or the default with what differs.
///
/// ```
/// use gripfast::propose::ProposeOptions;
/// let options = ProposeOptions::default().with_spacing(Some(0.004)).with_flips(true);
/// assert_eq!(options.spacing, Some(0.004));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ProposeOptions {
    /// Step of the position grid \[m\]; `None`: a fifth of the (smaller) pad's shorter side.
    pub spacing: Option<f64>,
    /// Step of the approach angle \[rad\].
    pub angle_step: f64,
    /// Approach along and across the edges of the gripped faces as well.
    pub edge_angles: bool,
    /// Propose grips on curved faces, and on opposite planes that are not parallel; `None`: where no
    /// candidate between parallel plane faces is free of interference, or where that makes no more
    /// than 20,000 candidates.
    pub curved: Option<bool>,
    /// Smallest contact area on either face, as a share of the most that a pad can touch there: the
    /// area in which the two faces overlap, or that of a pad over the middle of its bounds, at the
    /// grip's angle, whichever is smaller. Of curved faces what is pressed without a load counts.
    pub min_contact: f64,
    /// Smallest contact area on either face, as a share of the pad's area; not asked of curved faces.
    pub min_pad_share: f64,
    /// Largest distance of the grip origin from the centre of mass \[m\].
    pub max_offset: Option<f64>,
    /// Only approaches within a cone.
    pub approach_cone: Option<Cone>,
    /// Boxes in the part frame that the gripper must not enter: smallest and largest corner \[m\].
    pub keep_out: Vec<[DVec3; 2]>,
    /// The gripper must stay above this plane.
    pub ground: Option<Ground>,
    /// Only these faces, plane and curved ones, may be touched, and those of `faces_in`.
    pub faces: Option<Vec<u32>>,
    /// Only planar faces that lie wholly in one of these boxes may be touched (part frame, smallest
    /// and largest corner \[m\]), and those of `faces`; no box: no such limit.
    pub faces_in: Vec<[DVec3; 2]>,
    /// Propose grips that close on faces from outside.
    pub outside: bool,
    /// Propose grips that open into a slot; needs a gripper with outer pads.
    pub inside: bool,
    /// List the same pose with exchanged jaws as a grip of its own, marked with what it is a flip
    /// of.
    pub flips: bool,
    /// Way by which each jaw is opened for the approach beyond contact \[m\]; less where the stroke
    /// ends.
    pub opening: f64,
    /// Way by which each jaw must at least be openable beyond contact \[m\].
    pub min_opening: f64,
    /// Distance kept between gripper and part, but for the pads \[m\].
    pub clearance: f64,
    /// Length of the straight approach that must be clear of ground and keep-out boxes \[m\]; of the
    /// part it must be clear all the way.
    pub approach: f64,
    /// What else the gripper must be free of, and where the robot can go.
    #[serde(serialize_with = "checksum")]
    pub scene: Option<Arc<Scene>>,
    /// Candidates per chunk, about.
    pub chunk: usize,
    /// Gripping force, by which pads are pressed into what is not plane \[N\]; `None`: the gripper's
    /// largest.
    pub force: Option<f64>,
    /// Poses of grip frames in the part frame for which there are grips, too, where those of the grid lie
    /// beside them: a row across a taper, a closing direction across a round face.
    #[serde(skip)]
    pub poses: Vec<Frame>,
}

setters!(ProposeOptions {
    with_spacing: spacing: Option<f64>,
    with_angle_step: angle_step: f64,
    with_edge_angles: edge_angles: bool,
    with_curved: curved: Option<bool>,
    with_min_contact: min_contact: f64,
    with_min_pad_share: min_pad_share: f64,
    with_max_offset: max_offset: Option<f64>,
    with_approach_cone: approach_cone: Option<Cone>,
    with_keep_out: keep_out: Vec<[DVec3; 2]>,
    with_ground: ground: Option<Ground>,
    with_faces: faces: Option<Vec<u32>>,
    with_faces_in: faces_in: Vec<[DVec3; 2]>,
    with_outside: outside: bool,
    with_inside: inside: bool,
    with_flips: flips: bool,
    with_opening: opening: f64,
    with_min_opening: min_opening: f64,
    with_clearance: clearance: f64,
    with_approach: approach: f64,
    with_scene: scene: Option<Arc<Scene>>,
    with_chunk: chunk: usize,
    with_force: force: Option<f64>,
    with_poses: poses: Vec<Frame>,
});

/// A scene's meshes are too long to be written down.
fn checksum<S: Serializer>(
    scene: &Option<Arc<Scene>>,
    to: S,
) -> std::result::Result<S::Ok, S::Error> {
    scene.as_ref().map(|scene| scene.checksum()).serialize(to)
}

impl ProposeOptions {
    /// The force of one jaw \[N\]: the gripper's largest where none is stated.
    pub(super) fn force_on(&self, gripper: &Gripper) -> f64 {
        self.force.unwrap_or(gripper.force[1])
    }

    /// Those of a request, with the scene that it names.
    ///
    /// # Errors
    /// As [`Scene::read`].
    pub fn read(candidates: &Candidates) -> Result<Self> {
        let scene = candidates.scene.as_deref().map(Scene::read).transpose()?;
        Ok(Self { scene: scene.map(Arc::new), ..Self::from(candidates) })
    }
}

impl Default for ProposeOptions {
    /// Those of a request that says nothing.
    fn default() -> Self {
        Self::from(&Candidates::default())
    }
}

impl From<&Candidates> for ProposeOptions {
    /// Without the scene's file: see [`ProposeOptions::read`].
    fn from(candidates: &Candidates) -> Self {
        let corners = |regions: &[Region]| {
            regions.iter().map(|region| [region.low, region.high]).collect::<Vec<_>>()
        };
        Self {
            spacing: candidates.spacing.map(|spacing| spacing.0),
            angle_step: candidates.angle_step.0,
            edge_angles: candidates.edge_angles,
            curved: candidates.curved,
            min_contact: candidates.min_contact,
            min_pad_share: candidates.min_pad_share,
            max_offset: candidates.max_offset.map(|offset| offset.0),
            approach_cone: candidates.approach,
            keep_out: corners(&candidates.keep_out),
            ground: candidates.ground,
            faces: candidates.faces.clone(),
            faces_in: corners(&candidates.faces_in),
            outside: candidates.grips != Side::Inside,
            inside: candidates.grips != Side::Outside,
            flips: candidates.flips,
            opening: candidates.opening.0,
            min_opening: candidates.min_opening.0,
            clearance: candidates.clearance.0,
            approach: candidates.approach_distance.0,
            scene: None,
            chunk: 65_536,
            force: None,
            poses: Vec::new(),
        }
    }
}

impl ProposeOptions {
    /// Step of the position grid \[m\].
    pub fn spacing(&self, gripper: &Gripper) -> f64 {
        let [one, two] = gripper.pad_sizes();
        self.spacing.unwrap_or_else(|| one.min(two).min_element() / 5.0)
    }

    /// # Errors
    /// When a value is not finite or out of its range.
    pub(super) fn validate(&self) -> Result<()> {
        let positive = |name: &str, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(Error::input(name, format!("is {value}"), "give a finite value above zero"))
            }
        };
        let not_negative = |name: &str, value: f64| {
            if value >= 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(Error::input(name, format!("is {value}"), "give a finite value, zero or more"))
            }
        };
        if let Some(spacing) = self.spacing {
            positive("spacing", spacing)?;
        }
        positive("angle step", self.angle_step)?;
        if self.angle_step < 1e-4 {
            return Err(Error::input(
                "angle step",
                format!("is {} rad", self.angle_step),
                "give at least 0.01 degrees",
            ));
        }
        for (name, share) in [
            ("smallest contact", self.min_contact),
            ("smallest share of the pad", self.min_pad_share),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return Err(Error::input(name, format!("is {share}"), "give a share, 0 to 1"));
            }
        }
        if let Some(offset) = self.max_offset {
            not_negative("largest distance from the centre of mass", offset)?;
        }
        if let Some(cone) = self.approach_cone {
            not_negative("approach cone", cone.half_angle)?;
            positive("approach cone axis", cone.axis.length())?;
        }
        if let Some(ground) = self.ground {
            positive("ground normal", ground.normal.length())?;
            not_negative("ground offset", ground.offset.abs())?;
        }
        for (name, boxes) in [("keep-out box", &self.keep_out), ("box of faces", &self.faces_in)] {
            for [low, high] in boxes {
                if !low.is_finite() || !high.is_finite() || !low.cmple(*high).all() {
                    return Err(Error::input(
                        name,
                        format!("from {low} to {high} m"),
                        "give its smallest, then its largest coordinates",
                    ));
                }
            }
        }
        if !self.outside && !self.inside {
            return Err(Error::input(
                "grips",
                "neither outside nor inside ones are asked for",
                "ask for one of them or both",
            ));
        }
        if let Some(force) = self.force {
            positive("force", force)?;
        }
        not_negative("opening", self.opening)?;
        not_negative("smallest opening", self.min_opening)?;
        not_negative("clearance", self.clearance)?;
        not_negative("approach", self.approach)
    }
}

/// Why a candidate is no grip.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Rejection {
    /// Counts face pairs, not candidates: their distance is outside the stroke.
    Stroke,
    /// Counts face pairs, not candidates: a face is not among the chosen ones.
    FaceNotChosen,
    /// The approach direction lies outside the cone.
    ApproachOutsideCone,
    /// The grip origin is too far from the centre of mass.
    TooFarFromCentreOfMass,
    /// Counts face pairs, not candidates: the stroke does not leave the least opening for them.
    OpeningTooSmall,
    /// Counts face pairs, not candidates: round faces on two axes, farther apart than their radii.
    /// The part rolls out of the grip.
    RollsApart,
    /// Counts face pairs, not candidates: planes or a cone that lean against the pads by more than
    /// the pads' layers take up at the gripping force.
    LeansTooMuch,
    /// Counts bores, not candidates: the pads are too wide to go in and lie along the wall.
    PadTooWide,
    /// Counts face pairs, not candidates: the part stands in the way wherever pads may lie on round
    /// faces.
    OutOfReach,
    /// Counts face pairs, not candidates: they lean, and overlap by less than a tenth of a pad or of
    /// the part's largest plane: strips of a freely curved surface, flanks of teeth.
    PairTooSmall,
    /// The contact area on a face is below [`ProposeOptions::min_contact`].
    ContactTooSmall,
    /// The contact area on a face is below [`ProposeOptions::min_pad_share`].
    PadShareTooSmall,
    /// A body would go below the ground.
    Ground {
        /// Its name.
        body: String,
    },
    /// A body would enter a keep-out box.
    KeepOut {
        /// Its name.
        body: String,
    },
    /// A body meets the part in the grip or while the jaws close.
    PartInterference {
        /// Its name.
        body: String,
    },
    /// A body meets the part on the way there.
    ApproachBlocked {
        /// Its name.
        body: String,
    },
    /// The scene is in the way.
    Scene {
        /// Name of the obstacle, or of the robot's limit.
        name: String,
    },
}

impl Rejection {
    /// Name for summaries: snake case, the body after a colon.
    pub fn name(&self) -> String {
        let with =
            |kind: &str, body: &str| format!("{kind}:{}", body.replace(char::is_whitespace, "_"));
        match self {
            Self::Stroke => "face_pair_outside_stroke".into(),
            Self::FaceNotChosen => "face_pair_not_chosen".into(),
            Self::ApproachOutsideCone => "approach_outside_cone".into(),
            Self::TooFarFromCentreOfMass => "too_far_from_centre_of_mass".into(),
            Self::OpeningTooSmall => "face_pair_opening_too_small".into(),
            Self::RollsApart => "face_pair_rolls_apart".into(),
            Self::LeansTooMuch => "face_pair_leans_too_much".into(),
            Self::PadTooWide => "bore_too_narrow_for_pads".into(),
            Self::OutOfReach => "face_pair_out_of_reach".into(),
            Self::PairTooSmall => "face_pair_too_small".into(),
            Self::ContactTooSmall => "contact_too_small".into(),
            Self::PadShareTooSmall => "pad_share_too_small".into(),
            Self::Ground { body } => with("ground", body),
            Self::KeepOut { body } => with("keep_out", body),
            Self::PartInterference { body } => with("part_interference", body),
            Self::ApproachBlocked { body } => with("approach_blocked", body),
            Self::Scene { name } => with("scene", name),
        }
    }
}

//! Files of version 1, whose settings were numbers by name: read where they say all that this
//! version needs.

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use super::{Provenance, Resolved};
use crate::error::{Error, Result};
use crate::request::{
    Cone, EarlierWeights, Ground, Polish, PoseError, Refiner, Region, Request, Separation, Side,
};
use crate::units::{Angle, Force, Length, Mass, Unit};

/// What version 1 called settings. All that its program wrote is needed; what it wrote only on
/// request may be missing.
#[derive(Deserialize)]
struct Settings {
    force_n: f64,
    k1: f64,
    k2: f64,
    position_error_m: f64,
    closing_friction: f64,
    pad_friction: Option<f64>,
    separation: Separation,
    refiner: Refiner,
    polish: Polish,
    seeds: usize,
    keep: usize,
    complete: bool,
    spacing_m: f64,
    angle_step_rad: f64,
    min_contact_share: f64,
    max_offset_m: Option<f64>,
    opening_m: f64,
    clearance_m: f64,
    flips: bool,
    outside: bool,
    inside: bool,
    approach_cone: Option<OldCone>,
    ground: Option<OldGround>,
    keep_out_m: Vec<[DVec3; 2]>,
    faces: Option<Vec<u32>>,
    faces_in_m: Vec<[DVec3; 2]>,
    pose_noise_m: Option<f64>,
    pose_noise_rad: Option<f64>,
    noise_samples: Option<u32>,
}

#[derive(Deserialize)]
struct OldCone {
    axis: DVec3,
    half_angle_rad: f64,
}

#[derive(Deserialize)]
struct OldGround {
    normal: DVec3,
    height_m: f64,
}

/// What of the other fields the provenance of today holds.
#[derive(Deserialize)]
struct Old {
    provenance: OldProvenance,
    part: OldPart,
    gripper: OldGripper,
    summary: OldSummary,
}

#[derive(Deserialize)]
struct OldProvenance {
    gripfast: String,
    command: Vec<String>,
    backend: String,
    settings: Settings,
}

#[derive(Deserialize)]
struct OldPart {
    file: String,
    unit_m: f64,
    mass: OldMass,
}

#[derive(Deserialize)]
struct OldMass {
    mass: f64,
}

#[derive(Deserialize)]
struct OldGripper {
    name: String,
}

#[derive(Deserialize)]
struct OldSummary {
    comparison: Option<OldComparison>,
}

#[derive(Deserialize)]
struct OldComparison {
    k1: f64,
    k2: f64,
    k3: f64,
    epsilon_m: f64,
}

/// A set of version 1 as one of this version.
///
/// # Errors
/// When it lacks something that this version needs.
pub(super) fn upgrade(place: &str, mut set: Value) -> Result<Value> {
    let wrong = |error: serde_json::Error| {
        Error::format(
            place,
            format!("a result of version 1 that does not say enough: {error}"),
            "write the file again with `gripfast plan`",
        )
    };
    let provenance = Old::deserialize(&set).map_err(wrong)?.provenance();
    set["provenance"] = serde_json::to_value(provenance).map_err(wrong)?;
    set["version"] = super::VERSION.into();
    Ok(set)
}

impl Old {
    fn provenance(self) -> Provenance {
        let OldProvenance { gripfast, command, backend, settings } = self.provenance;
        let mut request = Request::new(self.part.file, self.gripper.name);
        request.unit = Unit::of_metres(self.part.unit_m);
        request.mass = Some(Mass(self.part.mass.mass));
        request.force = Some(Force(settings.force_n));
        request.loads.clear();
        settings.candidates(&mut request);
        let scoring = &mut request.scoring;
        scoring.k1 = settings.k1;
        scoring.k2 = settings.k2;
        scoring.position_error = Length(settings.position_error_m);
        scoring.closing_friction = settings.closing_friction;
        scoring.pad_friction = settings.pad_friction;
        scoring.separation = settings.separation;
        scoring.refiner = settings.refiner;
        scoring.polish = settings.polish;
        scoring.seeds = settings.seeds;
        let selection = &mut request.selection;
        selection.keep = Some(settings.keep);
        selection.pose_noise = settings
            .pose_noise_m
            .zip(settings.pose_noise_rad)
            .map(|(shift, turn)| PoseError { shift: Length(shift), turn: Angle(turn) });
        selection.noise_samples = settings.noise_samples.unwrap_or(selection.noise_samples);
        selection.compare =
            self.summary.comparison.map(|OldComparison { k1, k2, k3, epsilon_m }| EarlierWeights {
                k1,
                k2,
                k3,
                epsilon: epsilon_m,
            });
        let resolved = Resolved {
            pad_stiffness: 0.0,
            force: Force(settings.force_n),
            spacing: Length(settings.spacing_m),
            pad_friction: settings.pad_friction,
            safety: 1.0,
            seeds: settings.seeds,
            keep: settings.keep,
        };
        let complete = settings.complete;
        Provenance { gripfast, command, backend, complete, ..Provenance::new(request, resolved) }
    }
}

impl Settings {
    /// The options of the candidates.
    fn candidates(&self, request: &mut Request) {
        let regions = |boxes: &[[DVec3; 2]]| {
            boxes.iter().map(|&[low, high]| Region { low, high }).collect::<Vec<_>>()
        };
        let candidates = &mut request.candidates;
        // These had no flag; what ran stood in the program.
        candidates.edge_angles = true;
        candidates.min_pad_share = 0.02;
        candidates.min_opening = Length(0.25e-3);
        candidates.approach_distance = Length(0.1);
        candidates.spacing = Some(Length(self.spacing_m));
        candidates.angle_step = Angle(self.angle_step_rad);
        candidates.min_contact = self.min_contact_share;
        candidates.max_offset = self.max_offset_m.map(Length);
        candidates.opening = Length(self.opening_m);
        candidates.clearance = Length(self.clearance_m);
        candidates.flips = self.flips;
        candidates.grips = match (self.outside, self.inside) {
            (true, true) => Side::Both,
            (false, true) => Side::Inside,
            _ => Side::Outside,
        };
        candidates.approach = self
            .approach_cone
            .as_ref()
            .map(|cone| Cone { axis: cone.axis, half_angle: cone.half_angle_rad });
        candidates.ground = self
            .ground
            .as_ref()
            .map(|ground| Ground { normal: ground.normal, offset: ground.height_m });
        candidates.keep_out = regions(&self.keep_out_m);
        candidates.faces.clone_from(&self.faces);
        candidates.faces_in = regions(&self.faces_in_m);
    }
}

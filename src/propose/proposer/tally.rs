//! What came of the candidates so far.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::super::options::{ProposeOptions, Rejection};
use super::super::site;
use super::super::stroke::Stroke;
use crate::gripper::Gripper;

/// Widths of face pairs outside the stroke that are told apart \[m\], and how many are kept.
const SAME_WIDTH: f64 = 1e-5;
const MOST_WIDTHS: usize = 5;
/// Angles of faces to the pads that are told apart \[rad\].
const SAME_LEAN: f64 = 1e-4;

/// Counts of a run so far.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Antiparallel face pairs within the stroke.
    pub pairs: u64,
    /// Candidates looked at.
    pub candidates: u64,
    /// Grips free of interference among them (flips not counted).
    pub grips: u64,
    /// Rejections by [`Rejection::name`].
    pub rejections: BTreeMap<String, u64>,
    /// Widths of the face pairs outside the stroke, the nearest to it first, at most five \[m\].
    #[serde(default)]
    pub widths_outside: Vec<f64>,
    /// Angles to the pads of opposite planes and cones that the pads do not take, the least first,
    /// at most five \[rad\].
    #[serde(default)]
    pub leaning: Vec<f64>,
    /// With an approach cone: smallest angle between its axis and an approach among all candidates
    /// \[rad\].
    #[serde(default)]
    pub nearest_approach: Option<f64>,
    /// Curved or drafted faces are left out, because they make very many candidates beside those
    /// between planes, of which some are free of interference, and were not asked for.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub curved_left_out: bool,
}

impl Tally {
    /// What the limits behind rejections were up against, one sentence each: widths outside the
    /// stroke, the least opening and pad share, the nearest approach outside the cone.
    pub fn remarks(&self, gripper: &Gripper, options: &ProposeOptions) -> Vec<String> {
        let count = |reason: Rejection| self.rejections.get(&reason.name()).copied().unwrap_or(0);
        let mut remarks = Vec::new();
        if self.pairs == 0 && !self.widths_outside.is_empty() {
            let widths: Vec<String> =
                self.widths_outside.iter().map(|width| format!("{:.2}", width * 1e3)).collect();
            remarks.push(format!(
                "opposite faces are {} mm apart; the jaws of {} go from {:.2} to {:.2} mm",
                widths.join(", "),
                gripper.name,
                gripper.stroke[0] * 1e3,
                gripper.stroke[1] * 1e3
            ));
        }
        if self.curved_left_out {
            remarks.push(format!(
                "curved faces make more than {} candidates: they are tried when the option curved is \
                 set, which takes longer than planes do",
                site::MOST_CANDIDATES
            ));
        }
        if count(Rejection::OpeningTooSmall) > 0 {
            remarks.push(format!(
                "face pairs so near the end of the stroke that a jaw opens by less than the least \
                 opening of {:.3} mm: {}",
                options.min_opening * 1e3,
                count(Rejection::OpeningTooSmall)
            ));
        }
        if !self.leaning.is_empty() {
            let angles: Vec<String> =
                self.leaning.iter().map(|angle| format!("{:.2}", angle.to_degrees())).collect();
            remarks.push(format!(
                "opposite faces lean by {} deg against the pads; those of {} take planes of up to \
                 {:.2} deg at {} N, cones and narrow faces of less; less force lets them lean more",
                angles.join(", "),
                gripper.name,
                site::steepest(gripper, options).to_degrees(),
                options.force_on(gripper)
            ));
        }
        if count(Rejection::PadTooWide) > 0 {
            remarks.push(format!(
                "bores whose radius is less than 2.5 times half the width of the pads, which touch \
                 the wall with their edges only: {}",
                count(Rejection::PadTooWide)
            ));
        }
        if count(Rejection::PadShareTooSmall) > 0 {
            remarks.push(format!(
                "places at which less than the least share of the pad touches, {:.2} %: {}",
                options.min_pad_share * 100.0,
                count(Rejection::PadShareTooSmall)
            ));
        }
        if let (Some(cone), Some(nearest)) = (options.approach_cone, self.nearest_approach)
            && nearest > cone.half_angle
        {
            remarks.push(format!(
                "no approach lies in the cone of {:.1} deg: the nearest is {:.2} deg from its axis",
                cone.half_angle.to_degrees(),
                nearest.to_degrees()
            ));
        }
        remarks
    }

    /// Takes the angles that the pads do not take \[rad\].
    pub(super) fn note_leans(&mut self, leans: Vec<f64>) {
        self.leaning = leans;
        self.leaning.sort_by(f64::total_cmp);
        self.leaning.dedup_by(|a, b| (*a - *b).abs() < SAME_LEAN);
        self.leaning.truncate(MOST_WIDTHS);
    }

    pub(super) fn note_width(&mut self, width: f64, stroke: &Stroke) {
        if self.widths_outside.iter().any(|known| (known - width).abs() < SAME_WIDTH) {
            return;
        }
        let beyond = stroke.beyond(width);
        let place = self.widths_outside.partition_point(|known| stroke.beyond(*known) <= beyond);
        self.widths_outside.insert(place, width);
        self.widths_outside.truncate(MOST_WIDTHS);
    }
}

//! How near rejected candidates came to being grips: what each lacks, and where it meets what stops
//! it.

use glam::{DVec2, DVec3};

use super::explain::clipped;
use super::options::Rejection;
use super::patch::{Scratch, Touch};
use super::proposer::{Item, Prepared, Proposer};
use super::stroke::Stroke;
use super::work::{self, Pads};
use crate::clash::Tree;
use crate::geometry::polygon::{Bounds2, bounds};
use crate::gripper::Jaws;
use crate::model::{Frame, Miss, Negative};
use crate::part::{PairKind, PlanarFace};

/// Triangles that may be sorted into trees for it, one tree for each closing direction: of large
/// parts fewer directions are looked at.
const SORTED: usize = 4_000_000;
/// Sine of the angle between closing axis and vertical below which no approach from above is
/// drawn.
const UPRIGHT: f64 = 0.1;

impl Proposer<'_> {
    /// Rejected candidates with what each lacks, `most` for each reason at most; before them the
    /// two faces that come nearest to the stroke of all outside it. As for
    /// [`Proposer::rejected`], they are chosen pseudo-randomly, and depend on the input and the
    /// options only.
    pub fn misses(&self, most: usize) -> Vec<Miss> {
        let directions = (SORTED / self.part.mesh.triangles.len().max(1)).max(1);
        let mut misses: Vec<Miss> = self.outside_stroke().into_iter().collect();
        misses.extend(self.sampled(most, Some(directions)));
        misses
    }

    /// The faces nearest to the stroke from outside, gripped in their middle, from above where that
    /// is possible.
    fn outside_stroke(&self) -> Option<Miss> {
        let pair = self.outside.as_ref()?;
        let [face, other] = [pair.face_i, pair.face_ii].map(|id| &self.part.faces[id as usize]);
        let x3 = face.normal;
        let down = DVec3::NEG_Z - x3 * DVec3::NEG_Z.dot(x3);
        let upright = down.length() > UPRIGHT;
        let x1 = if upright { down.normalize() } else { face.part_from_face.rotation.x_axis };
        let inside = pair.kind == PairKind::Internal;
        let out = if inside { 0.5 } else { -0.5 };
        let beyond = Stroke::new(pair.kind, self.gripper, &self.options).beyond(pair.width);
        let pose = Negative {
            id: 0,
            part_from_grip: Frame {
                rotation: glam::DMat3::from_cols(x1, x3.cross(x1), x3),
                origin: middle(face, other) + x3 * (out * pair.width),
            },
            width: pair.width,
            face_i: pair.face_i,
            face_ii: pair.face_ii,
            angle: 0.0,
            inside,
            reason: Rejection::Stroke.name(),
        };
        Some(Miss::new(pose, Some(beyond), None))
    }

    /// What the candidate of an item with one position lacks, and where a body meets what stops it.
    pub(super) fn lack(
        &self,
        item: &Item,
        prepared: &Prepared<'_>,
        tree: &Tree,
        jaws: Jaws,
        reason: &Rejection,
    ) -> (Option<f64>, Option<DVec3>) {
        let site = prepared.site;
        let angle = site.angles[item.angle];
        let position = site.places(item.places, item.angle)[item.positions.start];
        let frame = work::frame(site, position, angle);
        match reason {
            Rejection::ApproachOutsideCone => {
                (self.environment.outside_cone(frame.rotation.x_axis), None)
            }
            Rejection::TooFarFromCentreOfMass => {
                let centre = self.part.mass_properties(1.0).centre_of_mass;
                let distance = frame.origin.distance(centre);
                (self.options.max_offset.map(|most| distance - most), None)
            }
            Rejection::ContactTooSmall | Rejection::PadShareTooSmall => {
                (Some(self.missing_contact(prepared, position, angle, jaws)), None)
            }
            Rejection::Ground { .. } => {
                let sweeps = &prepared.outer_sweeps[jaws as usize];
                self.environment.below(sweeps, &frame).unzip()
            }
            Rejection::KeepOut { .. } => {
                let sweeps = &prepared.outer_sweeps[jaws as usize];
                self.environment.kept_out_by(sweeps, &frame).unzip()
            }
            Rejection::PartInterference { .. } | Rejection::ApproachBlocked { .. } => {
                self.depth(prepared, tree, (position, angle), jaws, &frame)
            }
            _ => (None, None),
        }
    }

    /// Share of the contact area asked for that is missing, on the face where it is more.
    fn missing_contact(
        &self,
        prepared: &Prepared<'_>,
        position: DVec2,
        angle: f64,
        jaws: Jaws,
    ) -> f64 {
        let pads = Pads::new(prepared.site.pads(self.gripper, jaws), angle);
        let missing = [0, 1].map(|side: usize| {
            let patch = &prepared.patches[side.min(prepared.patches.len() - 1)];
            let pad = &pads.turned[side];
            let area = match patch.touch(pad, position, &mut Scratch::default()) {
                Touch::Empty => 0.0,
                Touch::Whole => pad.area(),
                Touch::Part(area) => area,
            };
            let [share, pad_share] = self.contact_floor(prepared.site, pad);
            let floor = share.max(pad_share);
            if floor > 0.0 { 1.0 - (area / floor).min(1.0) } else { 0.0 }
        });
        missing[0].max(missing[1])
    }

    /// How far the gripper would have to move along `x1` or `x2` so that no body's box meets what it
    /// meets now, and the middle of what the first body meets.
    fn depth(
        &self,
        prepared: &Prepared<'_>,
        tree: &Tree,
        (position, angle): (DVec2, f64),
        jaws: Jaws,
        frame: &Frame,
    ) -> (Option<f64>, Option<DVec3>) {
        let view = self.view(prepared.site, tree, angle);
        let place = self.place(prepared.site, &view, position);
        let (mut deepest, mut at) = (None, None);
        for sweep in &prepared.sweeps[jaws as usize] {
            let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            view.each_met(sweep, place, &mut |_, corners| {
                for point in clipped(sweep, corners) {
                    (low, high) = (low.min(point), high.max(point));
                }
            });
            if low.x > high.x {
                continue;
            }
            let out = (high - sweep.low).min(sweep.high - low).truncate().min_element();
            deepest = Some(f64::max(deepest.unwrap_or(0.0), out));
            at = at.or_else(|| Some(frame.point((low + high) / 2.0)));
        }
        (deepest, at)
    }
}

/// The middle of what two faces have in common, by their bounds, on the first one, part frame.
fn middle(face: &PlanarFace, other: &PlanarFace) -> DVec3 {
    let seen = face.part_from_face.inverse().compose(&other.part_from_face);
    let own = bounds(&face.polygons);
    let points = other.polygons.iter().flat_map(|polygon| &polygon.outer);
    let others: Vec<DVec2> = points.map(|point| seen.point(point.extend(0.0)).truncate()).collect();
    let others = Bounds2::of(&others);
    let common = Bounds2 { min: own.min.max(others.min), max: own.max.min(others.max) };
    face.part_from_face.point(common.centre().extend(0.0))
}

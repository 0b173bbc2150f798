//! Why one pose is a grip, or is not: every test, with body and place.

use glam::{DVec2, DVec3};

use super::options::Rejection;
use super::patch::{Scratch, Touch};
use super::proposer::{Prepared, Proposer};
use super::site;
use super::site::Site;
use super::work::{self, Pads};
use crate::clash::{Phase, Sweep};
use crate::error::{Error, Result};
use crate::geometry::clip_ring_axis;
use crate::gripper::Jaws;
use crate::model::{Contact, Frame};
use crate::part::PairKind;

/// Closing directions that differ by less are one \[rad\].
const SAME_CLOSING: f64 = 1e-6;

/// Way that an angle of a radian off those of a row counts for \[m\].
const SAME_ROW: f64 = 1e-5;

/// A stretch of two facing planes as users see it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SiteInfo {
    /// Number of the site: its place in [`Proposer::sites`].
    pub site: usize,
    /// Gripped faces on side I.
    pub faces_i: Vec<u32>,
    /// Gripped faces on side II.
    pub faces_ii: Vec<u32>,
    /// Distance of the planes \[m\].
    pub width: f64,
    /// Gripped from outside or from inside.
    pub kind: PairKind,
    /// How deep finger bodies may lie in the gripped planes without counting as interference \[m\]:
    /// what the planes' tilt and roughness take, which the pads take up.
    pub touch: f64,
    /// Site frame in the part frame: `z` is the closing axis, positions lie in `(x, y)`, angles
    /// count from `x`.
    pub part_from_site: Frame,
    /// Grip origins tried at every angle, in the site's `(x, y)` \[m\].
    pub positions: Vec<DVec2>,
    /// Approach angles \[rad\].
    pub angles: Vec<f64>,
    /// Grip origins tried at one angle only: pads flush with an edge, just clear of the ground, ...
    pub special: Vec<Vec<DVec2>>,
}

/// One test of a pose.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Check {
    /// What was tested.
    pub name: String,
    /// Whether the pose passed.
    pub passed: bool,
    /// Numbers, body and place in words.
    pub detail: String,
}

/// The full verdict on a pose.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Explanation {
    /// The site it belongs to.
    pub site: usize,
    /// Planar face of the part under pad I.
    pub face_i: u32,
    /// Planar face of the part under pad II.
    pub face_ii: u32,
    /// Grip frame in the part frame.
    pub part_from_grip: Frame,
    /// Distance of the faces \[m\].
    pub width: f64,
    /// Contact areas in the grip frame.
    pub contact: Contact,
    /// Every test, in order; later ones are made even when an earlier one failed.
    pub checks: Vec<Check>,
    /// The reason that counts: that of the first failed test.
    pub rejection: Option<Rejection>,
    /// Where a body meets the part, part frame \[m\].
    pub place: Option<DVec3>,
}

impl Proposer<'_> {
    /// The sites, in the order of their candidates.
    pub fn sites(&self) -> Vec<SiteInfo> {
        let info = |(index, site): (usize, &Site)| SiteInfo {
            site: index,
            faces_i: site.faces[0].clone(),
            faces_ii: site.faces[1].clone(),
            width: site.width,
            kind: site.kind,
            touch: site.rise,
            part_from_site: site.part_from_site,
            positions: site.positions.clone(),
            angles: site.angles.clone(),
            special: site.special.clone(),
        };
        self.sites.iter().enumerate().map(info).collect()
    }

    /// Explains the grip with frame `part_from_grip` on two faces, e.g. one of a result file.
    ///
    /// # Errors
    /// When no site holds these faces, or the frame's closing axis is not theirs.
    pub fn explain_pose(
        &self,
        face_i: u32,
        face_ii: u32,
        part_from_grip: &Frame,
    ) -> Result<Explanation> {
        let (index, local) = self.site_of(face_i, face_ii, part_from_grip)?;
        self.explain(
            index,
            local.origin.truncate(),
            local.rotation.x_axis.truncate().to_angle(),
            site::jaws(&local),
        )
    }

    /// The nearest site with these faces, and the grip frame in its frame.
    pub(super) fn site_of(
        &self,
        face_i: u32,
        face_ii: u32,
        part_from_grip: &Frame,
    ) -> Result<(usize, Frame)> {
        let place = || format!("faces {face_i} and {face_ii}");
        let holds = |site: &Site| {
            let has = |side: usize, face: u32| site.faces[side].contains(&face);
            // Round faces are gripped in many directions.
            let closing = part_from_grip.rotation.z_axis;
            let along = closing.cross(site.part_from_site.rotation.z_axis).length() < SAME_CLOSING;
            ((has(0, face_i) && has(1, face_ii)) || (has(0, face_ii) && has(1, face_i)))
                && (!site.is_round() || along)
        };
        let local = |site: &Site| site.part_from_site.point_inverse(part_from_grip.origin);
        let nearest = self.sites.iter().enumerate().filter(|(_, site)| holds(site)).min_by(
            |(_, a), (_, b)| {
                let outside = |site: &Site| {
                    let point = local(site).truncate();
                    let turned =
                        site.part_from_site.rotation.transpose() * part_from_grip.rotation.x_axis;
                    let [_, turned] = site.off_row(point, turned.truncate().to_angle());
                    (point - point.clamp(site.bounds.min, site.bounds.max)).length()
                        + SAME_ROW * turned
                };
                outside(a).total_cmp(&outside(b))
            },
        );
        let Some((index, site)) = nearest else {
            return Err(Error::input(
                place(),
                "are no pair that this gripper can grip on this part",
                "take the faces and the gripper from the run that made the grip",
            ));
        };
        let site_from_grip = site.part_from_site.inverse().compose(part_from_grip);
        if site_from_grip.rotation.z_axis.z.abs() < 1.0 - 1e-6 {
            return Err(Error::input(
                place(),
                "the closing axis of the frame is not their normal",
                "take frame and faces from one grip",
            ));
        }
        Ok((index, site_from_grip))
    }

    /// Explains the pose at `position` \[m\] of a site's plane, approaching at `angle` \[rad\].
    ///
    /// # Errors
    /// When there is no such site or the numbers are not finite.
    pub fn explain(
        &self,
        site: usize,
        position: DVec2,
        angle: f64,
        jaws: Jaws,
    ) -> Result<Explanation> {
        let Some(found) = self.sites.get(site) else {
            return Err(Error::input(
                format!("site {site}"),
                format!("the part has {} sites for this gripper", self.sites.len()),
                "count from 0",
            ));
        };
        if !position.is_finite() || !angle.is_finite() {
            return Err(Error::input(
                "position and angle",
                format!("{position}, {angle}"),
                "give finite values",
            ));
        }
        // A symmetric gripper looks the same with exchanged jaws.
        let turned = if self.symmetric { Jaws::Straight } else { jaws };
        let prepared = self.prepare(found);
        let mut verdict = Verdict { checks: Vec::new(), rejection: None, place: None };
        let mut frame = work::frame(found, position, angle);
        self.explain_place(&frame, &mut verdict);
        self.explain_contact(&prepared, position, angle, jaws, &mut verdict);
        let (mut scratch, mut known) = (Default::default(), Default::default());
        let posture = (position, angle, jaws);
        let touched = self.contact_at(found, &prepared.patches, posture, &mut scratch, &mut known);
        self.explain_environment(&prepared, &frame, turned, &mut verdict);
        self.explain_interference(&prepared, position, angle, turned, &frame, &mut verdict);
        frame.rotation *= jaws.turn();
        self.explain_scene(&prepared, &frame, &mut verdict);
        let Verdict { checks, rejection, place } = verdict;
        let mut faces = [0, 1].map(|side| found.face_at(side, self.part, position));
        if jaws == Jaws::Exchanged {
            faces.reverse();
        }
        Ok(Explanation {
            site,
            face_i: faces[0],
            face_ii: faces[1],
            part_from_grip: frame,
            width: found.width,
            contact: (*touched.contact).clone(),
            checks,
            rejection,
            place,
        })
    }

    fn explain_place(&self, frame: &Frame, verdict: &mut Verdict) {
        if self.options.approach_cone.is_some() {
            let direction = work::approach(frame);
            let passed = self.environment.allows(direction);
            verdict.add(
                "approach direction",
                passed,
                format!("({:.3}, {:.3}, {:.3})", direction.x, direction.y, direction.z),
                || Rejection::ApproachOutsideCone,
            );
        }
        if let Some(most) = self.options.max_offset {
            let distance = frame.origin.distance(self.part.mass_properties(1.0).centre_of_mass);
            let detail = format!("{:.2} mm, at most {:.2} mm", distance * 1e3, most * 1e3);
            verdict.add("distance from the centre of mass", distance <= most, detail, || {
                Rejection::TooFarFromCentreOfMass
            });
        }
    }

    /// The areas of both contacts, face I of the grip first.
    fn explain_contact(
        &self,
        prepared: &Prepared<'_>,
        position: DVec2,
        angle: f64,
        jaws: Jaws,
        verdict: &mut Verdict,
    ) {
        let pads = Pads::new(prepared.site.pads(self.gripper, jaws), angle);
        let sides = jaws.sides();
        let beside = self.pressed_beside(prepared.site, &pads, position, angle);
        let areas = sides.map(|side| {
            if let Some(areas) = beside {
                return areas[side];
            }
            let mut scratch = Scratch::default();
            let patch = &prepared.patches[side.min(prepared.patches.len() - 1)];
            let pad = &pads.turned[side];
            match patch.touch(pad, position, &mut scratch) {
                Touch::Empty => 0.0,
                Touch::Whole => pad.area(),
                Touch::Part(area) => area,
            }
        });
        let floors = sides.map(|side| self.contact_floor(prepared.site, &pads.turned[side]));
        let reason = || {
            if areas.iter().zip(floors).all(|(&area, [share, _])| area > 0.0 && area >= share) {
                Rejection::PadShareTooSmall
            } else {
                Rejection::ContactTooSmall
            }
        };
        for (place, name) in ["contact on face I", "contact on face II"].into_iter().enumerate() {
            let (area, [share, pad_share]) = (areas[place], floors[place]);
            let detail = format!(
                "{:.2} mm^2, {:.1} % of the pad; at least {:.2} mm^2 by the share of the most that \
                 can touch, {:.2} mm^2 by that of the pad",
                area * 1e6,
                area / pads.turned[sides[place]].area() * 100.0,
                share * 1e6,
                pad_share * 1e6
            );
            verdict.add(name, area > 0.0 && area >= share.max(pad_share), detail, reason);
        }
    }

    fn explain_environment(
        &self,
        prepared: &Prepared<'_>,
        frame: &Frame,
        jaws: Jaws,
        verdict: &mut Verdict,
    ) {
        let sweeps = &prepared.outer_sweeps[jaws as usize];
        if self.options.ground.is_some() {
            let depths = self.environment.depths(sweeps, frame);
            let hit = self.environment.grounded(&depths, frame.origin);
            let detail = hit.map_or("above it".to_string(), |sweep| {
                format!("{} would go below it", title(&sweeps[sweep]))
            });
            verdict.add("ground", hit.is_none(), detail, || Rejection::Ground {
                body: hit.map_or(String::new(), |sweep| sweeps[sweep].body.clone()),
            });
        }
        if !self.options.keep_out.is_empty() {
            let hit = self.environment.kept_out(sweeps, frame);
            let detail = hit.map_or("outside all".to_string(), |(sweep, number)| {
                format!("{} would enter box {number}", title(&sweeps[sweep]))
            });
            verdict.add("keep-out boxes", hit.is_none(), detail, || Rejection::KeepOut {
                body: hit.map_or(String::new(), |(sweep, _)| sweeps[sweep].body.clone()),
            });
        }
    }

    fn explain_interference(
        &self,
        prepared: &Prepared<'_>,
        position: DVec2,
        angle: f64,
        jaws: Jaws,
        frame: &Frame,
        verdict: &mut Verdict,
    ) {
        let site = prepared.site;
        let kept = self.tree.as_ref().filter(|(direction, _)| *direction == site.direction);
        let tree = kept.map_or_else(
            || std::sync::Arc::new(self.new_tree(site.direction)),
            |(_, tree)| std::sync::Arc::clone(tree),
        );
        let view = self.view(site, &tree, angle);
        let place = self.place(site, &view, position);
        for sweep in &prepared.sweeps[jaws as usize] {
            let when = match (sweep.phase, sweep.jaw.is_empty()) {
                (Phase::Grip, false) => "in the grip and while closing",
                (Phase::Grip, true) => "in the grip",
                (Phase::Approach | Phase::Retreat, _) => "on the approach",
            };
            let met = view.first_met(sweep, place);
            let at = met.map(|(_, corners)| frame.point(common_point(sweep, corners)));
            let detail = match (met, at) {
                (Some((triangle, _)), Some(at)) => {
                    let at = at * 1e3;
                    format!(
                        "meets the part at ({:.2}, {:.2}, {:.2}) mm, triangle {triangle}",
                        at.x, at.y, at.z
                    )
                }
                _ => "free".to_string(),
            };
            verdict.place = verdict.place.or(at);
            verdict.add(&format!("{} {when}", title(sweep)), met.is_none(), detail, || {
                work::reason(sweep)
            });
        }
    }
}

impl Proposer<'_> {
    fn explain_scene(&self, prepared: &Prepared<'_>, frame: &Frame, verdict: &mut Verdict) {
        let Some(way) = &prepared.way else { return };
        let stopped =
            self.environment.stopped(self.gripper, way, frame, &mut crate::clash::Room::default());
        let detail = stopped.as_ref().map_or("free".to_owned(), |(_, text)| text.clone());
        verdict.add("scene", stopped.is_none(), detail, || Rejection::Scene {
            name: stopped.as_ref().map_or(String::new(), |(name, _)| name.clone()),
        });
    }
}

struct Verdict {
    checks: Vec<Check>,
    rejection: Option<Rejection>,
    place: Option<DVec3>,
}

impl Verdict {
    fn add(
        &mut self,
        name: &str,
        passed: bool,
        detail: String,
        reason: impl FnOnce() -> Rejection,
    ) {
        if !passed && self.rejection.is_none() {
            self.rejection = Some(reason());
        }
        self.checks.push(Check { name: name.to_string(), passed, detail });
    }
}

fn title(sweep: &Sweep) -> String {
    if sweep.jaw.is_empty() {
        format!("palm body '{}'", sweep.body)
    } else {
        format!("finger {} body '{}'", sweep.jaw, sweep.body)
    }
}

/// A point of the triangle within the sweep's box: the middle of what the box cuts out of it.
fn common_point(sweep: &Sweep, corners: [DVec3; 3]) -> DVec3 {
    let ring = clipped(sweep, corners);
    ring.iter().sum::<DVec3>() / ring.len() as f64
}

/// What the sweep's box cuts out of the triangle: corners of a polygon, at least one.
pub(super) fn clipped(sweep: &Sweep, corners: [DVec3; 3]) -> Vec<DVec3> {
    let mut ring = corners.to_vec();
    for axis in 0..3 {
        for (sign, limit) in [(1.0, sweep.high[axis]), (-1.0, -sweep.low[axis])] {
            let next = clip_ring_axis(&ring, axis, sign, limit);
            if !next.is_empty() {
                ring = next;
            }
        }
    }
    ring
}

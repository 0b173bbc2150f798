//! One work item: all positions of a stretch of a site at one angle.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;

use super::interference::View;
use super::options::Rejection;
use super::patch::{PatchIndex, Scratch, Touch, TurnedPad};
use super::proposer::{Item, Prepared, Proposer};
use super::site::{Relief, Site};
use crate::clash::{Phase, Room, Sweep, Tree};
use crate::contact::surface;
use crate::geometry::{clip_ring_convex, patch_area, polygon, ring_area};
use crate::gripper::{Jaws, half_turn, rectangle};
use crate::model::{Contact, Frame, Gap, Grip, Patch, Piece, Polygon, Ring, Surfaces};
use crate::part::PairKind;

/// What came of an item.
#[derive(Debug, Default)]
pub(super) struct Outcome {
    pub(super) grips: Vec<Grip>,
    pub(super) candidates: u64,
    pub(super) rejections: Vec<(Rejection, u64)>,
}

/// Buffers of one thread.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    scratch: [Scratch; 2],
    places: Vec<DVec2>,
    alive: Vec<u32>,
    whole: Vec<[bool; 2]>,
    blocked: Vec<bool>,
}

/// Contacts of one item by their rounded coordinates: a pad moved along a straight edge keeps its
/// contact.
#[derive(Debug, Default)]
pub(super) struct Known {
    contacts: FxHashMap<Vec<i64>, Touched>,
    /// The coordinates asked for.
    key: Vec<i64>,
}

impl Known {
    /// The contact of `key`, which is made if it is new.
    fn or_insert(&mut self, made: impl FnOnce() -> Touched) -> Touched {
        if let Some(known) = self.contacts.get(&self.key) {
            return known.clone();
        }
        let made = made();
        self.contacts.insert(self.key.clone(), made.clone());
        made
    }
}

/// What the pads of a grip touch: areas and, where it is not plane, the surface.
#[derive(Debug, Clone)]
pub(super) struct Touched {
    pub(super) contact: Arc<Contact>,
    pub(super) surfaces: Option<Arc<Surfaces>>,
}

impl From<Arc<Contact>> for Touched {
    fn from(contact: Arc<Contact>) -> Self {
        Self { contact, surfaces: None }
    }
}

/// Contacts with more corners than this hardly ever repeat; looking for them would cost more than
/// it saves.
const SHARED_CORNERS: usize = 40;
/// Contacts with coordinates this near, as a share of the pad's size, are one contact.
const SAME_CONTACT: f64 = 1e-10;

/// The grip frame at `place` of the site's plane, approaching at `angle`.
pub(super) fn frame(site: &Site, place: DVec2, angle: f64) -> Frame {
    let turn = Frame { rotation: glam::DMat3::from_rotation_z(angle), origin: place.extend(0.0) };
    site.part_from_site.compose(&turn)
}

/// A pad outline after half a turn about the approach axis.
pub(super) fn mirrored(pad: &[DVec2]) -> Ring {
    pad.iter().rev().map(|point| DVec2::new(point.x, -point.y)).collect()
}

/// The pads over side I and II of a site in one posture, in the grip frame before the half turn.
#[derive(Debug)]
pub(super) struct Pads {
    pub(super) outlines: [Ring; 2],
    pub(super) turned: [TurnedPad; 2],
    /// Whether both are the same.
    alike: bool,
}

impl Pads {
    pub(super) fn new(outlines: [Ring; 2], angle: f64) -> Self {
        let turned = [0, 1].map(|side: usize| TurnedPad::new(&outlines[side], angle));
        Self { alike: outlines[0] == outlines[1], outlines, turned }
    }

    /// The sides to look at, each with the index of its patch: one stands for both where pads and
    /// faces are the same.
    pub(super) fn sides(&self, patches: &[PatchIndex]) -> impl Iterator<Item = (usize, usize)> {
        let (count, last) = (patches.len(), patches.len().saturating_sub(1));
        (0..if self.alike { count } else { 2 }).map(move |side| (side, side.min(last)))
    }
}

/// The reason for which a sweep that meets the part rejects a candidate.
pub(super) fn reason(sweep: &Sweep) -> Rejection {
    let body = sweep.body.clone();
    match sweep.phase {
        Phase::Grip => Rejection::PartInterference { body },
        // The part moves with the jaws on the retreat: proposals have none.
        Phase::Approach | Phase::Retreat => Rejection::ApproachBlocked { body },
    }
}

impl Proposer<'_> {
    pub(super) fn evaluate(
        &self,
        item: &Item,
        prepared: &Prepared<'_>,
        tree: &Tree,
        buffers: &mut Buffers,
    ) -> Outcome {
        let mut outcome = Outcome::default();
        let mut known = Known::default();
        // Numbers of the poses already taken, for the flips of an unsymmetric gripper.
        let mut taken: FxHashMap<u64, ()> = FxHashMap::default();
        for &jaws in self.orientations() {
            outcome.candidates += item.positions.len() as u64;
            self.survivors(item, prepared, tree, jaws, buffers, &mut outcome);
            let site = prepared.site;
            let (angle, places) = (site.angles[item.angle], site.places(item.places, item.angle));
            let pads = Pads::new(site.pads(self.gripper, jaws), angle);
            let floors = jaws.sides().map(|side| self.contact_floor(site, &pads.turned[side]));
            let alive = std::mem::take(&mut buffers.alive);
            for &index in &alive {
                let place = places[item.positions.start + index as usize];
                let Touched { contact, surfaces } = self.contact(
                    site,
                    &prepared.patches,
                    &pads,
                    place,
                    angle,
                    jaws,
                    buffers.whole[index as usize],
                    &mut buffers.scratch,
                    &mut known,
                );
                if let Some(reason) = self.too_little(site, &contact, floors) {
                    outcome.rejections.push((reason, 1));
                    continue;
                }
                let mut grip = Grip {
                    id: item.id + u64::from(index) * self.stride(),
                    part_from_grip: frame(site, place, angle),
                    width: site.width,
                    face_i: site.face_at(0, self.part, place),
                    face_ii: site.face_at(1, self.part, place),
                    angle,
                    contact,
                    surfaces,
                    inside: site.kind == PairKind::Internal,
                    flip_of: None,
                };
                if jaws == Jaws::Exchanged {
                    turn(&mut grip);
                    // Other pads touch another area: such a grip holds differently.
                    let same = self.gripper.has_like_pads() && taken.contains_key(&(grip.id));
                    grip.flip_of = same.then_some(grip.id);
                    grip.id += 1;
                } else if self.options.flips && self.symmetric {
                    let mut flip = grip.clone();
                    turn(&mut flip);
                    let touched = self.mirrored(&grip, &mut known);
                    (flip.contact, flip.surfaces) = (touched.contact, touched.surfaces);
                    flip.flip_of = Some(grip.id);
                    flip.id += 1;
                    outcome.grips.push(grip);
                    grip = flip;
                } else if !self.symmetric {
                    taken.insert(grip.id, ());
                }
                outcome.grips.push(grip);
            }
            buffers.alive = alive;
        }
        outcome.grips.sort_by_key(|grip| grip.id);
        outcome
    }

    /// Leaves in `buffers.alive` the item's positions without a reason against them, and counts the
    /// others.
    pub(super) fn survivors(
        &self,
        item: &Item,
        prepared: &Prepared<'_>,
        tree: &Tree,
        jaws: Jaws,
        buffers: &mut Buffers,
        outcome: &mut Outcome,
    ) {
        let site = prepared.site;
        let angle = site.angles[item.angle];
        let positions = &site.places(item.places, item.angle)[item.positions.clone()];
        let mut reject = |reason: Rejection, count: usize| {
            if count > 0 {
                outcome.rejections.push((reason, count as u64));
            }
        };
        buffers.alive.clear();
        let origin_frame = frame(site, DVec2::ZERO, angle);
        if !self.environment.allows(origin_frame.rotation.x_axis) {
            reject(Rejection::ApproachOutsideCone, positions.len());
            return;
        }
        buffers.alive.extend(0..positions.len() as u32);
        let keep = |alive: &mut Vec<u32>, test: &mut dyn FnMut(u32) -> bool| {
            let before = alive.len();
            alive.retain(|&index| test(index));
            before - alive.len()
        };

        if let Some(most) = self.options.max_offset {
            let centre = self.part.mass_properties(1.0).centre_of_mass;
            let lost = keep(&mut buffers.alive, &mut |index| {
                site.part_from_site.point(positions[index as usize].extend(0.0)).distance(centre)
                    <= most
            });
            reject(Rejection::TooFarFromCentreOfMass, lost);
        }

        let pads = Pads::new(site.pads(self.gripper, jaws), angle);
        let floors = [0, 1].map(|side: usize| self.contact_floor(site, &pads.turned[side]));
        buffers.whole.clear();
        buffers.whole.resize(positions.len(), [true; 2]);
        let (scratch, whole) = (&mut buffers.scratch, &mut buffers.whole);
        let mut small_on_pad = 0;
        let lost = keep(&mut buffers.alive, &mut |index| {
            let mut small = false;
            for (side, patch) in pads.sides(&prepared.patches) {
                let (patch, place) = (&prepared.patches[patch], positions[index as usize]);
                match patch.touch(&pads.turned[side], place, &mut scratch[side]) {
                    Touch::Empty => return false,
                    Touch::Whole => {}
                    Touch::Part(area) => {
                        whole[index as usize][side] = false;
                        if area < floors[side][0] {
                            return false;
                        }
                        small |= area < floors[side][1];
                    }
                }
            }
            small_on_pad += usize::from(small);
            !small
        });
        reject(Rejection::ContactTooSmall, lost - small_on_pad);
        reject(Rejection::PadShareTooSmall, small_on_pad);

        if !self.environment.is_empty() {
            let sweeps = &prepared.outer_sweeps[jaws as usize];
            let depths = self.environment.depths(sweeps, &origin_frame);
            let mut lost: Vec<(Rejection, usize)> = Vec::new();
            let mut note =
                |reason: Rejection| match lost.iter_mut().find(|(known, _)| *known == reason) {
                    Some((_, count)) => *count += 1,
                    None => lost.push((reason, 1)),
                };
            keep(&mut buffers.alive, &mut |index| {
                let grip = frame(site, positions[index as usize], angle);
                if let Some(sweep) = self.environment.grounded(&depths, grip.origin) {
                    note(Rejection::Ground { body: sweeps[sweep].body.clone() });
                    return false;
                }
                if let Some((sweep, _)) = self.environment.kept_out(sweeps, &grip) {
                    note(Rejection::KeepOut { body: sweeps[sweep].body.clone() });
                    return false;
                }
                true
            });
            lost.into_iter().for_each(|(reason, count)| reject(reason, count));
        }

        let view = self.view(site, tree, angle);
        buffers.places.clear();
        buffers.places.extend(positions.iter().map(|&position| self.place(site, &view, position)));
        buffers.blocked.clear();
        buffers.blocked.resize(positions.len(), false);
        for sweep in &prepared.sweeps[jaws as usize] {
            if buffers.alive.is_empty() {
                return;
            }
            view.test(sweep, &buffers.places, &mut buffers.alive, &mut buffers.blocked);
            let blocked = &buffers.blocked;
            let lost = keep(&mut buffers.alive, &mut |index| !blocked[index as usize]);
            reject(reason(sweep), lost);
        }
        buffers.alive.sort_unstable();
        self.leave_free_in_scene(item, prepared, jaws, buffers, outcome);
    }

    /// Leaves in `buffers.alive` what is free in the scene too.
    fn leave_free_in_scene(
        &self,
        item: &Item,
        prepared: &Prepared<'_>,
        jaws: Jaws,
        buffers: &mut Buffers,
        outcome: &mut Outcome,
    ) {
        let Some(way) = &prepared.way else { return };
        let site = prepared.site;
        let angle = site.angles[item.angle];
        let positions = &site.places(item.places, item.angle)[item.positions.clone()];
        // What it remembers of the last collision decides which of several is named: it stays
        // within the item, so that reasons do not depend on the number of threads.
        let mut room = Room::default();
        let mut lost: std::collections::BTreeMap<String, u64> = Default::default();
        buffers.alive.retain(|&index| {
            let mut pose = frame(site, positions[index as usize], angle);
            pose.rotation *= jaws.turn();
            match self.environment.stopped(self.gripper, way, &pose, &mut room) {
                None => true,
                Some((name, _)) => {
                    *lost.entry(name).or_default() += 1;
                    false
                }
            }
        });
        let rejections = lost.into_iter().map(|(name, count)| (Rejection::Scene { name }, count));
        outcome.rejections.extend(rejections);
    }

    /// Smallest contact areas at a site [m^2] by `min_contact` and by `min_pad_share`; reached up to
    /// rounding is enough.
    pub(super) fn contact_floor(&self, site: &Site, pad: &TurnedPad) -> [f64; 2] {
        // No more of the pad than its overlap with the faces' bounds, middle over middle.
        let bounds = rectangle(site.extent);
        let most = ring_area(&clip_ring_convex(&pad.centred(), &bounds)).min(site.most);
        // Round faces touch little of a pad by their nature.
        let pad_share = if site.is_round() { 0.0 } else { self.options.min_pad_share };
        [self.options.min_contact * most, pad_share * pad.area()].map(|floor| floor * (1.0 - 1e-9))
    }

    /// Why planes and what is pressed beside them are no contact, which is known once it is solved: too
    /// little of them, or nothing where the pads rest on a land of another pair.
    fn too_little(
        &self,
        site: &Site,
        contact: &Contact,
        floors: [[f64; 2]; 2],
    ) -> Option<Rejection> {
        site.beside()?;
        let areas = [&contact.face_i, &contact.face_ii].map(|face| patch_area(face));
        let below = |floor: usize| (0..2).any(|k| areas[k] <= 0.0 || areas[k] < floors[k][floor]);
        match (below(0), below(1)) {
            (true, _) => Some(Rejection::ContactTooSmall),
            (false, true) => Some(Rejection::PadShareTooSmall),
            (false, false) => None,
        }
    }

    /// Areas that are pressed on either side of a place on planes and what lies beside them [m^2].
    pub(super) fn pressed_beside(
        &self,
        site: &Site,
        pads: &Pads,
        place: DVec2,
        angle: f64,
    ) -> Option<[f64; 2]> {
        let relief = site.beside()?;
        let rings = [0, 1].map(|side: usize| pads.turned[side].ring());
        let surfaces = relief.touched(rings, place, angle, Jaws::Straight);
        let contact = relief.plain(&surfaces);
        let contact = contact.unwrap_or_else(|| relief.outlines(&surfaces, Jaws::Straight));
        Some([&contact.face_i, &contact.face_ii].map(|face| patch_area(face)))
    }

    /// The part in the grip axes of a site at an angle.
    pub(super) fn view<'t>(&self, site: &Site, tree: &'t Tree, angle: f64) -> View<'t> {
        View::new(tree, DVec2::from_angle(site.turn + angle), site.origin.z)
    }

    /// A position of a site in the view's grip axes.
    pub(super) fn place(&self, site: &Site, view: &View<'_>, position: DVec2) -> DVec2 {
        view.turned(site.origin.truncate() + DVec2::from_angle(site.turn).rotate(position))
    }

    #[expect(clippy::too_many_arguments, reason = "one call; a struct would only rename them")]
    pub(super) fn contact(
        &self,
        site: &Site,
        patches: &[PatchIndex],
        pads: &Pads,
        place: DVec2,
        angle: f64,
        jaws: Jaws,
        whole: [bool; 2],
        scratch: &mut [Scratch; 2],
        known: &mut Known,
    ) -> Touched {
        if let Some(relief) = &site.relief {
            let rings = [0, 1].map(|side: usize| pads.turned[side].ring());
            return self.pressed(relief, relief.touched(rings, place, angle, jaws), jaws, known);
        }
        if pads.alike && pads.sides(patches).all(|(side, _)| whole[side]) {
            return Arc::clone(&self.whole).into();
        }
        let mut touched = pads.sides(patches).map(|(side, patch)| -> Patch {
            let (patch, pad) = (&patches[patch], &pads.turned[side]);
            match patch.touch(pad, place, &mut scratch[side]) {
                Touch::Empty => Patch::new(),
                Touch::Whole => {
                    vec![Polygon { outer: pads.outlines[side].clone(), holes: Vec::new() }]
                }
                Touch::Part(_) => patch.outline(pad, place, &mut scratch[side], angle),
            }
        });
        let face_i = touched.next().unwrap_or_default();
        let face_ii = touched.next().unwrap_or_else(|| face_i.clone());
        let contact = Contact { face_i, face_ii };
        let contact = match jaws {
            Jaws::Straight => contact,
            Jaws::Exchanged => mirror(&contact),
        };
        self.shared(contact, known)
    }

    /// The contact with exchanged jaws.
    fn mirrored(&self, grip: &Grip, known: &mut Known) -> Touched {
        if let Some(surfaces) = &grip.surfaces {
            let contact = Arc::new(mirror(&grip.contact));
            return Touched { contact, surfaces: Some(Arc::new(surface::mirrored(surfaces))) };
        }
        if Arc::ptr_eq(&grip.contact, &self.whole) {
            Arc::clone(&self.whole).into()
        } else {
            self.shared(mirror(&grip.contact), known)
        }
    }

    /// Coordinates closer than this are one, for what is shared \[m\].
    fn same(&self) -> f64 {
        SAME_CONTACT * self.reach
    }

    fn shared(&self, contact: Contact, known: &mut Known) -> Touched {
        let step = self.same();
        let rings =
            || [&contact.face_i, &contact.face_ii].into_iter().flatten().flat_map(polygon::rings);
        if rings().map(<[DVec2]>::len).sum::<usize>() > SHARED_CORNERS {
            return Arc::new(contact).into();
        }
        let key = &mut known.key;
        key.clear();
        for patch in [&contact.face_i, &contact.face_ii] {
            for ring in patch.iter().flat_map(polygon::rings) {
                push(key, step, ring);
            }
            key.push(i64::MIN);
        }
        known.or_insert(|| Arc::new(contact).into())
    }

    /// What is pressed of the surfaces under the pads.
    fn pressed(
        &self,
        relief: &Relief,
        surfaces: Surfaces,
        jaws: Jaws,
        known: &mut Known,
    ) -> Touched {
        let touched = |surfaces: Surfaces| Touched {
            contact: Arc::new(relief.outlines(&surfaces, jaws)),
            surfaces: Some(Arc::new(surfaces)),
        };
        if let Some(contact) = relief.plain(&surfaces) {
            return self.shared(contact, known);
        }
        let mut pieces = surfaces.face_i.iter().chain(&surfaces.face_ii);
        // About one point every place has a contact of its own.
        if pieces.any(|piece| matches!(piece.gap, Gap::Sphere { .. } | Gap::Barrel { .. })) {
            return touched(surfaces);
        }
        let step = self.same();
        let key = &mut known.key;
        key.clear();
        for piece in surfaces.face_i.iter().chain([&Piece::default()]).chain(&surfaces.face_ii) {
            push(key, step, &piece.outer);
            piece.holes.iter().for_each(|hole| push(key, step, hole));
            let numbers = surface::numbers(&piece.gap);
            key.extend(numbers.map(|x| rounded(x / step)));
            key.push(i64::MIN);
        }
        known.or_insert(|| touched(surfaces))
    }
}

/// Adds a ring's rounded coordinates to a key.
fn push(key: &mut Vec<i64>, step: f64, ring: &[DVec2]) {
    key.extend(ring.iter().flat_map(|x| [rounded(x.x / step), rounded(x.y / step)]));
    key.push(i64::MAX);
}

/// To the nearest whole number, as `round` has it where halves do not matter: that is a call on processors
/// without an instruction for it.
fn rounded(x: f64) -> i64 {
    (x + 0.5_f64.copysign(x)) as i64
}

/// Exchanges the jaws of a grip: half a turn about the approach axis.
fn turn(grip: &mut Grip) {
    grip.part_from_grip.rotation *= half_turn();
    std::mem::swap(&mut grip.face_i, &mut grip.face_ii);
}

/// A contact seen after half a turn about the approach axis.
fn mirror(contact: &Contact) -> Contact {
    let map = glam::DAffine2::from_mat2(glam::DMat2::from_diagonal(DVec2::new(1.0, -1.0)));
    let patch = |patch: &Patch| patch.iter().map(|shape| polygon::transform(shape, &map)).collect();
    Contact { face_i: patch(&contact.face_ii), face_ii: patch(&contact.face_i) }
}

/// Unit approach direction of a grip in the part frame.
pub(super) fn approach(frame: &Frame) -> DVec3 {
    frame.rotation.x_axis
}

//! Sites on surfaces that lean against flat pads, see [`super::tapers`].
//!
//! How far apart such pads stand depends on where they touch. Places at which that is the same make
//! a row along the surface, and each row is a site of its own, for the approach angles at which the
//! pads reach as far.

use glam::DVec2;

use super::relief::Relief;
use super::round::{Outcomes, Round};
use super::shapes::{common, to_site};
use super::survey::{Survey, Surveys};
use super::tapers::{STEEPEST, Surface, Taper, WIDEST};
use super::{Finder, SAME_PLANE, Site, axes};
use crate::error::Result;
use crate::geometry::polygon::{self, Bounds2};
use crate::geometry::{HalfPlane, clip_ring_half_plane, support};
use crate::gripper::{Gripper, Jaw, Layer};
use crate::mechanics::curved::Pads;
use crate::model::{Frame, Patch, Piece, Polygon, Ring, Surfaces};
use crate::part::{FacePair, PairKind, PlanarFace};
use crate::propose::options::{ProposeOptions, Rejection};
use crate::propose::stroke::Stroke;

/// Share of a layer by which it is compressed at most to take a lean: beyond it is no bed of springs.
pub(super) const LAYER_SHARE: f64 = 1.0 / 3.0;
/// Reaches of a pad that differ by less are one \[m\].
const SAME_REACH: f64 = 1e-9;
/// Rows nearer to each other than this are one \[m\].
const SAME_ROW: f64 = 1e-7;
/// Cosine of the angle by which closing jaws right a pose, and more: 10 degrees.
pub(super) const RIGHTED: f64 = 0.985;
/// A direction that lies this far out of the pads' plane has no angle in it (cosine).
const ALONG: f64 = 1e-3;

/// Approach angles at which the pads reach as far along `y`, from the rows' direction \[rad\].
struct Posture {
    angles: Vec<f64>,
    /// How far the pads reach down and up, and the fingers.
    reach: [f64; 2],
    fingers: [f64; 2],
    /// The same to either side, along the rows.
    aside: f64,
    fingers_aside: f64,
    /// Their outlines at the first angle.
    pads: [Ring; 2],
}

/// Sine of the angle between two planes below which their push towards the thick end is left out: it
/// asks for half of it as friction, less than 0.0005.
pub(super) const LEANS: f64 = 1e-3;

impl<'a> Finder<'a> {
    /// The sites on surfaces that lean.
    pub(super) fn leaning(&mut self, round: &mut Round) -> Result<Vec<Site>> {
        let (mut tapers, too_small) = self.drafted();
        round.add(Rejection::PairTooSmall, too_small);
        if self.options.outside {
            self.cones(PairKind::External, &mut tapers);
        }
        if self.options.inside {
            self.bores(&mut tapers);
            self.cones(PairKind::Internal, &mut tapers);
        }
        let mut sites = Vec::new();
        if tapers.is_empty() {
            return Ok(sites);
        }
        let loose = self.loose();
        let mut seen = Outcomes::default();
        for taper in &tapers {
            let survey = Survey::new(self.part, &loose, axes(self.directions[taper.direction]));
            let first = sites.len();
            let reason = self.rows(taper, &survey, &mut sites);
            sites[first..].iter().for_each(|site| self.budget.take(site));
            if self.budget.is_spent() {
                round.left_out = true;
                return Ok(Vec::new());
            }
            match reason {
                Some(Rejection::Stroke) => {
                    let [one, two] = taper.heights_at(taper.bounds.centre().y);
                    round.widths.push((one - two).abs());
                }
                Some(Rejection::LeansTooMuch) => round.leans.push(taper.angle()),
                _ => {}
            }
            let [a, b] = [0, 1].map(|side: usize| taper.sides[side][0]);
            seen.add(a, b, reason);
        }
        round.count(seen);
        Ok(sites)
    }

    /// The rows of places of pairs that count as parallel, where they lean so much that the push
    /// towards the thick end is felt; `None` where they do not, are small, or no row comes of them.
    pub(super) fn lean(
        &mut self,
        pairs: &[&FacePair],
        surveys: &mut Surveys<'a>,
    ) -> Option<Vec<Site>> {
        let face = |id: u32| &self.part.faces[id as usize];
        let both = |pair: &&FacePair| [face(pair.face_i), face(pair.face_ii)];
        let pairs: Vec<[&PlanarFace; 2]> = pairs.iter().map(both).collect();
        let [a, b] = pairs[0];
        if a.normal.cross(b.normal).length() < LEANS {
            return None;
        }
        let (area, taper) = self.wedge(&pairs)?;
        if area < self.smallest {
            return None;
        }
        let survey = surveys.of(self, taper.direction)?;
        let mut sites = Vec::new();
        self.rows(&taper, survey, &mut sites);
        (!sites.is_empty()).then_some(sites)
    }

    /// How far jaws leave a straight line along the approach while they open, see [`Gripper::bulge`].
    fn bulge(&self, kind: PairKind, width: f64, from: f64) -> f64 {
        let (gripper, opening) = (self.gripper, self.options.opening);
        let is_inside = kind == PairKind::Internal;
        let gap = gripper.gap_on(width, is_inside);
        let sense = if is_inside { -1.0 } else { 1.0 };
        let bulge = |jaw: Jaw| {
            let outs = [from, gripper.way(jaw, opening).max(from)];
            gripper.bulge(jaw, gap, outs.map(|out| sense * out))
        };
        Jaw::BOTH.into_iter().map(bulge).fold(0.0, f64::max)
    }

    /// Places along `y`, between two, of the poses for which rows are asked for.
    fn rows_at(&self, taper: &Taper, [low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
        let closing = self.directions[taper.direction];
        let poses = self.options.poses.iter();
        let poses = poses.filter(move |pose| pose.rotation.z_axis.dot(closing).abs() > RIGHTED);
        let place = move |pose: &Frame| taper.uphill.dot((axes(closing) * pose.origin).truncate());
        poses.map(place).filter(move |y| (low..=high).contains(y))
    }

    /// Adds the rows of places on two surfaces; the reason where there are none.
    fn rows(&self, taper: &Taper, survey: &Survey<'_>, sites: &mut Vec<Site>) -> Option<Rejection> {
        let mut reason = None;
        let mut any = false;
        let spacing = self.options.spacing(self.gripper);
        let com = axes(self.directions[taper.direction]) * self.centre_of_mass;
        let com = taper.uphill.dot(com.truncate());
        for posture in self.postures(taper) {
            let Bounds2 { min, max } = taper.bounds;
            let rows = match taper.surface {
                Surface::Bore => vec![0.5 * (min.y + max.y)],
                // As far as a pad leaves as much of itself uncovered as it covers.
                _ => {
                    let beyond = posture.reach[0] + posture.reach[1] - (max.y - min.y);
                    let beyond = 0.5 * beyond.max(0.0);
                    let mut rows = steps([min.y, max.y], beyond, spacing, com);
                    for y in self.rows_at(taper, [min.y - beyond, max.y + beyond]) {
                        if !rows.iter().any(|row| (row - y).abs() < SAME_ROW) {
                            rows.push(y);
                        }
                    }
                    rows
                }
            };
            for y in rows {
                match self.row(taper, &posture, y, survey) {
                    Ok(site) => {
                        any = true;
                        sites.extend(site);
                    }
                    Err(found) => reason = reason.or(Some(found)),
                }
            }
        }
        reason.filter(|_| !any)
    }

    /// Approaches along and across the rows, and towards the middle of the cone asked for.
    fn postures(&self, taper: &Taper) -> Vec<Posture> {
        let [one, two] = taper.heights_at(taper.bounds.centre().y);
        let is_inside = taper.kind == PairKind::Internal;
        let gap = self.gripper.gap_on(if is_inside { two - one } else { one - two }, is_inside);
        let [least, most] = self.gripper.stroke;
        let mut pads = self.gripper.pads(gap.clamp(least, most));
        if taper.kind == PairKind::Internal {
            pads.reverse();
        }
        let mut angles: Vec<f64> =
            (0..4).map(|k| std::f64::consts::FRAC_PI_2 * f64::from(k)).collect();
        if let Some(cone) = self.options.approach_cone {
            let axis = axes(self.directions[taper.direction]) * cone.axis.normalize();
            if axis.truncate().length() > ALONG {
                let angle = (axis.truncate().to_angle() - taper.level().to_angle())
                    .rem_euclid(std::f64::consts::TAU);
                let near =
                    |known: &f64| (angle - known + 1e-3).rem_euclid(std::f64::consts::TAU) < 2e-3;
                if !angles.iter().any(near) {
                    angles.push(angle);
                }
            }
        }
        let bodies: Vec<DVec2> = Jaw::BOTH
            .iter()
            .flat_map(|&jaw| self.gripper.bodies(jaw))
            .flat_map(|body| {
                let [low, high] = body.bounds();
                [
                    low.truncate(),
                    high.truncate(),
                    DVec2::new(low.x, high.y),
                    DVec2::new(high.x, low.y),
                ]
            })
            .flat_map(|corner| [corner, DVec2::new(corner.x, -corner.y)])
            .collect();
        let mut postures: Vec<Posture> = Vec::new();
        for angle in angles {
            let turn = DVec2::from_angle(angle);
            let turned = |ring: &Ring| -> Ring { ring.iter().map(|x| turn.rotate(*x)).collect() };
            // With exchanged jaws the pads are mirrored.
            let mirrored = |ring: &Ring| super::super::work::mirrored(ring);
            let rings = pads.iter().cloned().chain(pads.iter().map(mirrored));
            let (mut reach, mut aside) = ([0.0_f64; 2], 0.0_f64);
            let sideways = |ring: &Ring| support(ring, DVec2::X).max(support(ring, DVec2::NEG_X));
            for ring in rings.map(|ring| turned(&ring)) {
                reach[0] = reach[0].max(support(&ring, DVec2::NEG_Y));
                reach[1] = reach[1].max(support(&ring, DVec2::Y));
                aside = aside.max(sideways(&ring));
            }
            let around = turned(&bodies);
            let fingers = [DVec2::NEG_Y, DVec2::Y].map(|way| support(&around, way));
            let fingers_aside = sideways(&around);
            let alike = |a: f64, b: f64| (a - b).abs() < SAME_REACH;
            let hollow = taper.surface.is_hollow();
            let same = |known: &&mut Posture| {
                (0..2).all(|k| alike(known.reach[k], reach[k]))
                    && (0..2).all(|k| alike(known.fingers[k], fingers[k]))
                    && (!hollow || alike(known.aside, aside))
                    && (!hollow || alike(known.fingers_aside, fingers_aside))
            };
            match postures.iter_mut().find(same) {
                Some(posture) => posture.angles.push(angle),
                None => postures.push(Posture {
                    angles: vec![angle],
                    reach,
                    fingers,
                    aside,
                    fingers_aside,
                    pads: pads.each_ref().map(turned),
                }),
            }
        }
        postures
    }

    /// The site of the row at `y`; none where nothing is touched.
    fn row(
        &self,
        taper: &Taper,
        posture: &Posture,
        y: f64,
        survey: &Survey<'_>,
    ) -> std::result::Result<Option<Site>, Rejection> {
        let [below, above] = posture.reach;
        let Bounds2 { min, max } = taper.bounds;
        let top = if taper.surface == Surface::Bore { y } else { (y + above).min(max.y) };
        let heights = taper.heights_at(top);
        let width = (heights[0] - heights[1]).abs();
        // How far the pads, and fingers wider than these, stand off the planes at the heights.
        let beyond = taper.slope * (posture.fingers[1] - above).max(0.0);
        let hollow = |half: f64, fingers: f64| {
            let radius = 0.5 * width;
            if half > WIDEST * radius {
                return Err(Rejection::PadTooWide);
            }
            let sags = [half, fingers.clamp(half, radius)];
            Ok(sags.map(|half| radius - (radius * radius - half * half).sqrt()))
        };
        let [sag, off] = match taper.surface {
            // Rows lie along the bore,
            Surface::Bore => hollow(below.max(above), posture.fingers[0].max(posture.fingers[1]))?,
            // or across it.
            Surface::TaperedBore => {
                let [sag, off] = hollow(posture.aside, posture.fingers_aside)?;
                [sag, off + beyond]
            }
            Surface::Plane | Surface::Cone => [0.0, beyond],
        };
        Stroke::new(taper.kind, self.gripper, self.options).check(width)?;
        let layer = self.gripper.layer();
        let Some(deltas) = self.takes(taper, posture, (y, top), layer)? else { return Ok(None) };
        // In a bore the layers give as much as that beside the pads too. What is beyond a pad on a taper, a
        // link of metal perhaps, must not be there before the pad is pressed.
        let most = match taper.surface {
            Surface::Bore | Surface::TaperedBore => sag + LAYER_SHARE * layer.reach(),
            Surface::Plane | Surface::Cone => deltas[0].min(deltas[1]),
        };
        let off = off.min(most) + taper.chords;
        // The way of a jaw along the approach, which counts as if it had not opened yet.
        let off = off + taper.slope * self.bulge(taper.kind, width, off);
        let level = taper.level();
        let reach = self.reach;
        let window = |low: DVec2, high: DVec2| -> Ring {
            [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
                .map(|x| level * x.x + taper.uphill * x.y)
                .to_vec()
        };
        let around = window(
            DVec2::new(min.x - 2.0 * reach, y - 2.0 * reach),
            DVec2::new(max.x + 2.0 * reach, y + 2.0 * reach),
        );
        let depth = layer.reach() + sag;
        let depths = [depth, depth + 4.0 * reach * taper.slope];
        let pieces = survey.pieces(heights, depths, Bounds2::of(&around));
        let relief = Relief::pressed_by(pieces, layer, self.options.force_on(self.gripper), deltas);
        let high = if taper.surface == Surface::Bore { y + above } else { top };
        let under =
            window(DVec2::new(min.x - self.size, y - below), DVec2::new(max.x + self.size, high));
        let overlap = common(&relief.pressed[0], &relief.pressed[1]);
        let overlap = common(&[Polygon { outer: under, holes: Vec::new() }], &overlap);
        let middle = level * taper.bounds.centre().x + taper.uphill * y;
        let local: Patch =
            overlap.iter().map(|shape| to_site(shape, middle, level.to_angle())).collect();
        Ok((!local.is_empty())
            .then(|| self.site_of_row(taper, posture, (middle, heights, off), local, &relief)))
    }

    fn site_of_row(
        &self,
        taper: &Taper,
        posture: &Posture,
        (middle, heights, off): (DVec2, [f64; 2], f64),
        local: Patch,
        relief: &Relief,
    ) -> Site {
        let axes_from_part = axes(self.directions[taper.direction]);
        let turn = taper.level().to_angle();
        let origin = middle.extend(0.5 * (heights[0] + heights[1]));
        let [one, two] = self.gripper.pad_sizes();
        let bounds = polygon::bounds(&local);
        let beyond = (one.max(two).max_element() - bounds.size().x).max(0.0) / 2.0;
        let com = axes_from_part * self.centre_of_mass;
        let com = taper.level().dot(com.truncate() - middle);
        let along = [bounds.min.x, bounds.max.x];
        let places = match taper.surface {
            // Off the middle one edge of a pad would touch alone.
            Surface::TaperedBore => vec![0.0],
            _ => steps(along, beyond, self.options.spacing(self.gripper), com),
        };
        let positions: Vec<DVec2> = places.into_iter().map(|x| DVec2::new(x, 0.0)).collect();
        Site {
            kind: taper.kind,
            part_from_site: Frame {
                rotation: axes_from_part.transpose() * glam::DMat3::from_rotation_z(turn),
                origin: axes_from_part.transpose() * origin,
            },
            width: (heights[0] - heights[1]).abs(),
            direction: taper.direction,
            origin,
            turn,
            faces: taper.sides.clone(),
            touched: taper.sides.clone(),
            rise: SAME_PLANE * self.size + off,
            flush: SAME_PLANE * self.size,
            most: polygon::patch_area(&local),
            extent: bounds.size(),
            bounds: Bounds2::of(&positions),
            positions,
            special: vec![Vec::new(); posture.angles.len()],
            angles: posture.angles.clone(),
            relief: Some(relief.moved(middle, turn)),
            row: true,
        }
    }

    /// The layers' compressions under pads of a posture at `y` that touch at `top`, where they take
    /// the lean; none where the pads touch nothing.
    fn takes(
        &self,
        taper: &Taper,
        posture: &Posture,
        (y, top): (f64, f64),
        layer: Layer,
    ) -> std::result::Result<Option<[f64; 2]>, Rejection> {
        let force = self.options.force_on(self.gripper);
        let pads = |lean: f64| -> Option<Pads> {
            let under = |pad: &Ring| -> Vec<Piece> {
                let mut outer = pad.clone();
                for (sense, end) in [(1.0, taper.bounds.max.y), (-1.0, taper.bounds.min.y)] {
                    let half =
                        HalfPlane { normal: DVec2::NEG_Y * sense, offset: sense * (end - y) };
                    outer = clip_ring_half_plane(&outer, &half);
                }
                vec![Piece { outer, holes: Vec::new(), gap: taper.gap(y, top, lean) }]
            };
            let [face_i, face_ii] = posture.pads.each_ref().map(under);
            let stiffness = [layer.stiffness; 2];
            Pads::new(&Surfaces { face_i, face_ii, stiffness, layer: None }).ok()
        };
        let Some(leaning) = pads(1.0) else { return Ok(None) };
        let Some(deltas) = leaning.deltas(force) else { return Ok(None) };
        let limit = LAYER_SHARE * layer.reach();
        let compression = leaning.compressed(deltas);
        // Twice what it would be without: then all of the pad touches.
        let even = || {
            let pads = pads(0.0)?;
            Some(pads.compressed(pads.deltas(force)?))
        };
        if compression > limit && even().is_some_and(|even| compression > 2.0 * even) {
            return Err(Rejection::LeansTooMuch);
        }
        Ok(Some(deltas))
    }
}

/// Places a step apart about the middle of a stretch, up to `beyond` its ends, and the one nearest
/// to `also`.
fn steps([low, high]: [f64; 2], beyond: f64, step: f64, also: f64) -> Vec<f64> {
    let middle = 0.5 * (low + high);
    // Rounding must not cost the outermost ones.
    let half = ((0.5 * (high - low) + beyond) / step + 1e-6).floor() as i64;
    let mut places: Vec<f64> = (-half..=half).map(|k| middle + step * k as f64).collect();
    let also = also.clamp(low, high);
    if !places.iter().any(|place| (place - also).abs() < 1e-4 * step) {
        places.push(also);
    }
    places
}

/// The greatest angle of two opposite planes to the pads that the pads take \[rad\]: the layers are
/// compressed by no more than a third, or touch all over.
pub(in crate::propose) fn steepest(gripper: &Gripper, options: &ProposeOptions) -> f64 {
    let layer = gripper.layer();
    let force = options.force_on(gripper);
    let [one, two] = gripper.pad_sizes();
    let size = one.min(two);
    let even = force / (layer.stiffness * size.x * size.y);
    let limit = (LAYER_SHARE * layer.reach()).max(2.0 * even);
    // Up the slope and along it.
    let slope = |up: f64, along: f64| {
        // A strip at the upper edge carries the force, or all of the pad does.
        let strip = limit * limit * layer.stiffness * along / (2.0 * force);
        if strip * up >= 2.0 * even { strip } else { 2.0 * (limit - even) / up }
    };
    slope(size.x, size.y).max(slope(size.y, size.x)).atan().min(STEEPEST)
}

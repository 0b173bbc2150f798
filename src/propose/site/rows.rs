//! Sites on surfaces that lean against flat pads: opposite planes that are not parallel, outside
//! cones, and bores, whose walls curve towards a pad.
//!
//! How far apart such pads stand depends on where they touch. Places at which that is the same make
//! a row along the surface, and each row is a site of its own, for the approach angles at which the
//! pads reach as far.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rustc_hash::FxHashSet;

use super::relief::{Relief, Surveyor};
use super::round::{Round, STROKE};
use super::shapes::{project, to_site};
use super::{Finder, SAME_PLANE, Site, axes};
use crate::error::Result;
use crate::geometry::polygon::{self, Bounds2};
use crate::geometry::{HalfPlane, clip_ring_half_plane, intersect_convex, overlay, support};
use crate::gripper::{Gripper, Jaw, Layer};
use crate::mechanics::curved::{Pads, Squeezed};
use crate::model::{Frame, Gap, Patch, Piece, Ring, Surfaces};
use crate::part::{ANTIPARALLEL, CurvedFace, PairKind, PlanarFace, Shape};
use crate::propose::options::{ProposeOptions, Rejection};

/// Angle of either surface to the pads up to which two are opposite each other \[rad\].
const STEEPEST: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Share of a layer by which it is compressed at most to take a lean: beyond it is no bed of springs.
const LAYER_SHARE: f64 = 1.0 / 3.0;
/// Half width of a pad over the radius of a bore up to which it may go in: as for the half width of
/// a contact, the flat formula is 1.6 % off there.
const WIDEST: f64 = 0.4;
/// Pairs of planes looked at, the largest ones.
const MOST_PAIRS: usize = 200;
/// Reaches of a pad that differ by less are one \[m\].
const SAME_REACH: f64 = 1e-9;
/// A direction that lies this far out of the pads' plane has no angle in it (cosine).
const ALONG: f64 = 1e-3;

/// What leans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Surface {
    Plane,
    Cone,
    Bore,
}

/// Two surfaces opposite each other that do not lie in the pads' planes. Places are `(x, y)` along
/// the rows and up the slope, to where a pad touches first.
#[derive(Debug)]
struct Taper {
    kind: PairKind,
    surface: Surface,
    /// Index of the closing direction.
    direction: usize,
    sides: [Vec<u32>; 2],
    /// Unit vector along `y` in the direction's axes.
    uphill: DVec2,
    /// Rise of side I along `y`; side II falls as much.
    slope: f64,
    /// Heights of both at `y = 0`.
    heights: [f64; 2],
    /// Where both are.
    bounds: Bounds2,
    /// How far the chords of a mesh stand out from the surface that they are meant for.
    chords: f64,
}

/// Approach angles at which the pads reach as far along `y`, from the rows' direction \[rad\].
struct Posture {
    angles: Vec<f64>,
    /// How far the pads reach down and up, and the fingers.
    reach: [f64; 2],
    fingers: [f64; 2],
    /// Their outlines at the first angle.
    pads: [Ring; 2],
}

impl Taper {
    /// Unit vector along the rows.
    fn level(&self) -> DVec2 {
        -self.uphill.perp()
    }

    fn heights_at(&self, y: f64) -> [f64; 2] {
        let [one, two] = self.heights;
        [one + self.slope * y, two - self.slope * y]
    }

    /// Gap of either side behind planes that touch it at `top` or, in a bore, at its crest, seen
    /// from `y`.
    fn gap(&self, y: f64, top: f64, lean: f64) -> Gap {
        let [one, two] = self.heights_at(top);
        let (radius, height) = (0.5 * (one - two).abs(), lean * self.slope * (top - y));
        match self.surface {
            Surface::Plane => Gap::Plane { height, slope: DVec2::new(0.0, -lean * self.slope) },
            Surface::Cone => Gap::Cone {
                radius,
                slope: -lean * self.slope,
                axis: DVec2::Y,
                at: DVec2::ZERO,
                height,
            },
            Surface::Bore if lean == 0.0 => Gap::default(),
            Surface::Bore => {
                Gap::Cylinder { radius: -radius, axis: DVec2::X, at: DVec2::ZERO, height: 0.0 }
            }
        }
    }

    /// Angle of either side to the pads \[rad\].
    fn angle(&self) -> f64 {
        self.slope.atan()
    }
}

impl Finder<'_> {
    /// The sites on surfaces that lean.
    pub(super) fn leaning(&mut self, round: &mut Round) -> Result<Vec<Site>> {
        let mut tapers = self.drafted();
        if self.options.outside {
            self.cones(&mut tapers);
        }
        if self.options.inside {
            self.bores(&mut tapers);
        }
        let mut sites = Vec::new();
        if tapers.is_empty() {
            return Ok(sites);
        }
        let loose = self.loose();
        let mut seen: BTreeMap<(u32, u32), Option<Rejection>> = BTreeMap::new();
        for taper in &tapers {
            let reason = self.rows(taper, &loose, &mut sites);
            match reason {
                Some(Rejection::Stroke) => {
                    let [one, two] = taper.heights_at(taper.bounds.centre().y);
                    round.widths.push((one - two).abs());
                }
                Some(Rejection::LeansTooMuch) => round.leans.push(taper.angle()),
                _ => {}
            }
            let [a, b] = [0, 1].map(|side: usize| taper.sides[side][0]);
            // One of its directions is enough for a pair.
            let known = seen.entry((a.min(b), a.max(b))).or_insert_with(|| reason.clone());
            if reason.is_none() {
                *known = None;
            }
        }
        round.count(seen);
        Ok(sites)
    }

    /// Pairs of planes that are opposite each other and not parallel.
    fn drafted(&mut self) -> Vec<Taper> {
        // Facets of what may be round are none.
        let round: FxHashSet<u32> =
            self.part.curved.iter().flat_map(|face| &face.triangles).copied().collect();
        let is_facet = |face: &PlanarFace| face.triangles.iter().all(|one| round.contains(one));
        let faces: Vec<&PlanarFace> = self
            .part
            .faces
            .iter()
            .filter(|face| face.reachable && self.may_touch(face.id) && !is_facet(face))
            .collect();
        let (most, least) = (ANTIPARALLEL.cos(), (2.0 * STEEPEST).cos());
        let mut groups: BTreeMap<(usize, usize), Vec<[&PlanarFace; 2]>> = BTreeMap::new();
        for (index, a) in faces.iter().enumerate() {
            for b in &faces[index + 1..] {
                if (least..most).contains(&-a.normal.dot(b.normal)) {
                    let [one, two] = [a, b].map(|face| self.planes.of[face.id as usize]);
                    groups.entry((one.min(two), one.max(two))).or_default().push([a, b]);
                }
            }
        }
        let mut found: Vec<(f64, Taper)> =
            groups.values().filter_map(|pairs| self.wedge(pairs)).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.sides.cmp(&b.1.sides)));
        found.into_iter().take(MOST_PAIRS).map(|(_, taper)| taper).collect()
    }

    /// Pairs in two planes as one, and the area in which they are opposite each other [m^2].
    fn wedge(&mut self, pairs: &[[&PlanarFace; 2]]) -> Option<(f64, Taper)> {
        let [a, b] = pairs[0];
        let closing = upright((a.normal - b.normal).normalize());
        let mut sides: [Vec<u32>; 2] = Default::default();
        for face in pairs.iter().flatten() {
            sides[usize::from(face.normal.dot(closing) < 0.0)].push(face.id);
        }
        for side in &mut sides {
            side.sort_unstable();
            side.dedup();
        }
        let axes_from_part = axes(closing);
        let faces = [0, 1].map(|side: usize| {
            let faces = sides[side].iter().map(|&id| &self.part.faces[id as usize]);
            project(faces, &axes_from_part)
        });
        let overlap = overlay::intersect(&faces[0], &faces[1]);
        let area = polygon::patch_area(&overlap);
        if area <= 1e-9 * self.size * self.size {
            return None;
        }
        let plane = |side: usize| {
            let face = &self.part.faces[sides[side][0] as usize];
            (axes_from_part * face.normal, face.offset)
        };
        let [(one, offset_i), (two, offset_ii)] = [plane(0), plane(1)];
        let slope = one.truncate() / one.z;
        let (uphill, slope) = (-slope.normalize(), slope.length());
        let mut taper = Taper {
            kind: PairKind::External,
            surface: Surface::Plane,
            direction: 0,
            sides,
            uphill,
            slope,
            heights: [offset_i / one.z, offset_ii / two.z],
            bounds: Bounds2::EMPTY,
            chords: 0.0,
        };
        let level = taper.level();
        let along = |point: &DVec2| DVec2::new(level.dot(*point), uphill.dot(*point));
        let corners: Vec<DVec2> =
            overlap.iter().flat_map(polygon::rings).flatten().map(along).collect();
        taper.bounds = Bounds2::of(&corners);
        let [above, below] = taper.heights_at(along(&polygon::patch_moments(&overlap).centroid).y);
        let wanted = if above > below { self.options.outside } else { self.options.inside };
        if above < below {
            taper.kind = PairKind::Internal;
        }
        if !wanted {
            return None;
        }
        taper.direction = self.direction(closing);
        Some((area, taper))
    }

    /// Outside cones, in directions all round.
    fn cones(&mut self, tapers: &mut Vec<Taper>) {
        let part = self.part;
        let ids: Vec<u32> = self.round_faces().map(|face| face.id).collect();
        for face in ids.into_iter().filter_map(|id| part.curved_face(id)) {
            let Shape::Cone { apex, axis, half_angle, along } = face.shape else { continue };
            if half_angle >= STEEPEST {
                continue;
            }
            for closing in self.closings_about(axis) {
                let met = [1.0, -1.0].map(|sign| self.has_line(face, apex, axis, sign * closing));
                if met != [true; 2] {
                    continue;
                }
                let direction = self.direction(closing);
                let axes_from_part = axes(self.directions[direction]);
                let apex = axes_from_part * apex;
                let uphill = (axes_from_part * axis).truncate().normalize();
                let (slope, y) = (half_angle.tan(), uphill.dot(apex.truncate()));
                let x = (-uphill.perp()).dot(apex.truncate());
                let [least, most] = along.map(|along| DVec2::new(x, y + along));
                tapers.push(Taper {
                    kind: PairKind::External,
                    surface: Surface::Cone,
                    direction,
                    sides: [vec![face.id], vec![face.id]],
                    uphill,
                    slope,
                    heights: [apex.z - slope * y, apex.z + slope * y],
                    bounds: Bounds2 { min: least, max: most },
                    chords: 0.0,
                });
            }
        }
    }

    /// Bores from inside, in directions all round.
    fn bores(&mut self, tapers: &mut Vec<Taper>) {
        let mut bores: Vec<Vec<&CurvedFace>> = Vec::new();
        for face in &self.part.curved {
            let is_bore = matches!(face.shape, Shape::Cylinder { .. }) && !face.outside;
            if !is_bore || !face.reachable || !self.may_touch(face.id) {
                continue;
            }
            match bores.iter_mut().find(|bore| bore[0].is_same_surface(face)) {
                Some(bore) => bore.push(face),
                None => bores.push(vec![face]),
            }
        }
        for bore in bores {
            let Shape::Cylinder { axis, radius, .. } = bore[0].shape else { continue };
            let ends: Vec<f64> = bore
                .iter()
                .filter_map(|face| match face.shape {
                    Shape::Cylinder { axis: own, along, .. } => {
                        Some(along.map(|along| axis.along(own.origin + own.direction * along)))
                    }
                    _ => None,
                })
                .flatten()
                .collect();
            let [low, high] = [f64::min, f64::max]
                .map(|pick: fn(f64, f64) -> f64| ends.iter().copied().reduce(pick).unwrap_or(0.0));
            for closing in self.closings_about(axis.direction) {
                let side = |sign: f64| -> Vec<u32> {
                    let towards = sign * closing;
                    let faces = bore.iter();
                    let faces = faces
                        .filter(|face| self.has_line(face, axis.origin, axis.direction, towards));
                    faces.map(|face| face.id).collect()
                };
                // Jaw I pushes against the wall that faces the closing direction.
                let sides = [side(-1.0), side(1.0)];
                if sides.iter().any(Vec::is_empty) {
                    continue;
                }
                let direction = self.direction(closing);
                let axes_from_part = axes(self.directions[direction]);
                let level = (axes_from_part * axis.direction).truncate().normalize();
                let centre = axes_from_part * axis.origin;
                let middle =
                    DVec2::new(level.dot(centre.truncate()), level.perp_dot(centre.truncate()));
                let wall = WIDEST * radius;
                let facets =
                    bore.iter().filter_map(|face| face.facets).fold(f64::INFINITY, f64::min);
                tapers.push(Taper {
                    kind: PairKind::Internal,
                    surface: Surface::Bore,
                    direction,
                    sides,
                    uphill: level.perp(),
                    slope: 0.0,
                    heights: [centre.z - radius, centre.z + radius],
                    bounds: Bounds2 {
                        min: middle + DVec2::new(low, -wall),
                        max: middle + DVec2::new(high, wall),
                    },
                    chords: radius * (1.0 - (std::f64::consts::PI / facets).cos()),
                });
            }
        }
    }

    /// Whether a face about an axis has the line of its surface that lies `towards` that side.
    fn has_line(&self, face: &CurvedFace, origin: DVec3, axis: DVec3, towards: DVec3) -> bool {
        let across = axis.cross(towards);
        face.triangles.iter().any(|&triangle| {
            let corners = self.part.mesh.corners(triangle).map(|corner| corner - origin);
            let slack = 1e-3 * corners[0].reject_from(axis).length();
            let along = corners.map(|corner| corner.dot(across));
            corners.iter().all(|corner| corner.dot(towards) > 0.0)
                && along.iter().any(|y| *y >= -slack)
                && along.iter().any(|y| *y <= slack)
        })
    }

    /// Adds the rows of places on two surfaces; the reason where there are none.
    fn rows(&self, taper: &Taper, loose: &[u32], sites: &mut Vec<Site>) -> Option<Rejection> {
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
                    steps([min.y, max.y], 0.5 * beyond.max(0.0), spacing, com)
                }
            };
            for y in rows {
                match self.row(taper, &posture, y, loose) {
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
        let gap = match taper.kind {
            PairKind::External => one - two,
            PairKind::Internal => two - one - 2.0 * self.gripper.outer_pad.unwrap_or(0.0),
        };
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
            let mut reach = [0.0_f64; 2];
            for ring in rings.map(|ring| turned(&ring)) {
                reach[0] = reach[0].max(support(&ring, DVec2::NEG_Y));
                reach[1] = reach[1].max(support(&ring, DVec2::Y));
            }
            let around = turned(&bodies);
            let fingers = [DVec2::NEG_Y, DVec2::Y].map(|way| support(&around, way));
            let same = |known: &&mut Posture| {
                (0..2).all(|k| (known.reach[k] - reach[k]).abs() < SAME_REACH)
                    && (0..2).all(|k| (known.fingers[k] - fingers[k]).abs() < SAME_REACH)
            };
            match postures.iter_mut().find(same) {
                Some(posture) => posture.angles.push(angle),
                None => postures.push(Posture {
                    angles: vec![angle],
                    reach,
                    fingers,
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
        loose: &[u32],
    ) -> std::result::Result<Option<Site>, Rejection> {
        let [below, above] = posture.reach;
        let Bounds2 { min, max } = taper.bounds;
        let top = if taper.surface == Surface::Bore { y } else { (y + above).min(max.y) };
        let heights = taper.heights_at(top);
        let width = (heights[0] - heights[1]).abs();
        // How far the pads, and fingers wider than these, stand off the planes at the heights.
        let [sag, off] = match taper.surface {
            Surface::Bore => {
                let (half, radius) = (below.max(above), 0.5 * width);
                if half > WIDEST * radius {
                    return Err(Rejection::PadTooWide);
                }
                let fingers = posture.fingers[0].max(posture.fingers[1]).clamp(half, radius);
                [half, fingers].map(|half| radius - (radius * radius - half * half).sqrt())
            }
            _ => [0.0, taper.slope * (posture.fingers[1] - above).max(0.0)],
        };
        self.within_stroke(taper.kind, width)?;
        let layer = self.gripper.layer();
        // The layers give as much as that beside the pads too.
        let off = off.min(sag + LAYER_SHARE * layer.reach()) + taper.chords;
        let Some(deltas) = self.takes(taper, posture, (y, top), layer)? else { return Ok(None) };
        let axes_from_part = axes(self.directions[taper.direction]);
        let level = taper.level();
        let reach = self.gripper.pad_reach();
        let window = |low: DVec2, high: DVec2| -> Ring {
            [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
                .map(|x| level * x.x + taper.uphill * x.y)
                .to_vec()
        };
        let around = window(
            DVec2::new(min.x - 2.0 * reach, y - 2.0 * reach),
            DVec2::new(max.x + 2.0 * reach, y + 2.0 * reach),
        );
        let pieces = [0, 1].map(|side: usize| {
            let surveyor = Surveyor {
                part: self.part,
                loose,
                axes_from_part,
                height: heights[side],
                side: [1.0, -1.0][side],
                reach: layer.reach() + sag,
                above: layer.reach() + sag + 4.0 * reach * taper.slope,
                region: Bounds2::of(&around),
            };
            surveyor.pieces()
        });
        let relief = Relief::pressed_by(pieces, layer, self.force(), deltas);
        let high = if taper.surface == Surface::Bore { y + above } else { top };
        let under =
            window(DVec2::new(min.x - self.size, y - below), DVec2::new(max.x + self.size, high));
        let overlap = overlay::intersect(&relief.pressed[0], &relief.pressed[1]);
        let overlap = intersect_convex(&under, &overlap);
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
        let positions: Vec<DVec2> = steps(along, beyond, self.options.spacing(self.gripper), com)
            .into_iter()
            .map(|x| DVec2::new(x, 0.0))
            .collect();
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
            overlap: polygon::patch_area(&local),
            extent: bounds.size(),
            bounds: Bounds2::of(&positions),
            positions,
            special: vec![Vec::new(); posture.angles.len()],
            angles: posture.angles.clone(),
            relief: Some(relief.moved(middle, turn)),
            row: true,
        }
    }

    fn force(&self) -> f64 {
        self.options.force.unwrap_or(self.gripper.force[1])
    }

    fn within_stroke(&self, kind: PairKind, width: f64) -> std::result::Result<(), Rejection> {
        let more = match kind {
            PairKind::External => 0.0,
            PairKind::Internal => 2.0 * self.gripper.outer_pad.unwrap_or(0.0),
        };
        let [least, most] = self.gripper.stroke.map(|gap| gap + more);
        let open = 2.0 * self.options.min_opening;
        let [low, high] = match kind {
            PairKind::External => [least, most - open],
            PairKind::Internal => [least + open, most],
        };
        if !(least - STROKE..=most + STROKE).contains(&width) {
            Err(Rejection::Stroke)
        } else if !(low - STROKE..=high + STROKE).contains(&width) {
            Err(Rejection::OpeningTooSmall)
        } else {
            Ok(())
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
        let squeezed = |lean: f64| -> Option<[Squeezed; 2]> {
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
            let surfaces =
                Surfaces { face_i, face_ii, stiffness: [layer.stiffness; 2], layer: None };
            Pads::new(&surfaces).ok()?.squeezed(self.force())
        };
        let Some(found) = squeezed(1.0) else { return Ok(None) };
        let greatest = |faces: &[Squeezed; 2]| {
            faces.iter().map(|face| face.greatest_pressure).fold(0.0, f64::max) / layer.stiffness
        };
        let compression = greatest(&found);
        // Twice what it would be without: then all of the pad touches.
        if compression > LAYER_SHARE * layer.reach()
            && squeezed(0.0).is_some_and(|even| compression > 2.0 * greatest(&even))
        {
            return Err(Rejection::LeansTooMuch);
        }
        Ok(Some(found.map(|face| face.delta)))
    }
}

/// Of two opposite directions the one with its greatest component positive.
pub(super) fn upright(direction: DVec3) -> DVec3 {
    if direction[direction.abs().max_position()] < 0.0 { -direction } else { direction }
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
    let force = options.force.unwrap_or(gripper.force[1]);
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

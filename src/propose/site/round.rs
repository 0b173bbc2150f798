//! Sites on curved faces: closing directions in which crests of the part lie opposite each other,
//! or opposite a plane.
//!
//! A crest is where a flat pad touches first: a line on a cylinder, a point on a sphere or a barrel.
//! Directions come from the axes of round faces, in steps all round, from the normals of planes
//! across such an axis, and from a geodesic set about spheres.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::relief::Relief;
use super::rows::RIGHTED;
use super::shapes::{project, stretches};
use super::skyline::Skyline;
use super::survey::{LEVEL, Survey, is_free};
use super::tapers::upright;
use super::tori::is_flat;
use super::{Base, Finder, SAME_PLANE, Site, axes, lie};
use crate::error::Result;
use crate::geometry::overlay;
use crate::geometry::polygon::{self, Bounds2};
use crate::geometry::sphere::directions;
use crate::model::Piece;
use crate::part::{CurvedFace, PairKind, Shape};
use crate::propose::options::Rejection;
use crate::propose::stroke::Stroke;

/// Axes whose directions differ by less are one \[rad\].
const SAME_AXIS: f64 = 3e-4;
/// Closing directions that differ by less are one \[rad\].
const SAME_CLOSING: f64 = 1e-3;
/// At most this many planes across one axis give directions, the largest ones.
pub(super) const MOST_PLANES: usize = 24;
/// Edge of the icosahedron seen from its middle \[rad\].
const ICOSAHEDRON: f64 = 1.1071;
/// Divisions of its edge at most.
const MOST_DIVISIONS: usize = 8;
/// Places along a crest at which it is looked at from above.
const PLACES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Share of the distance of two crests by which their radii may fall short of it: on one axis they
/// are the same.
const ON_ONE_AXIS: f64 = 2e-3;

/// What came of the pairs of curved faces.
#[derive(Debug, Default)]
pub(in crate::propose) struct Round {
    /// Pairs with sites.
    pub(in crate::propose) pairs: u64,
    /// Pairs without, by reason, and their widths outside of the stroke.
    pub(in crate::propose) rejections: Vec<(Rejection, u64)>,
    pub(in crate::propose) widths: Vec<f64>,
    /// Angles to the pads that these do not take \[rad\].
    pub(in crate::propose) leans: Vec<f64>,
    /// There are so many places that none was tried.
    pub(in crate::propose) left_out: bool,
}

/// How many places on curved faces are tried beside those between planes, unless they are asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    looks: usize,
    candidates: usize,
}

/// Closing directions and pairs of crests that are looked at, each for up to a millisecond.
const MOST_LOOKS: usize = 1_500;
/// Candidates on curved faces, or on drafted ones.
pub(in crate::propose) const MOST_CANDIDATES: usize = 20_000;

impl Budget {
    pub(super) const NONE: Self = Self { looks: usize::MAX, candidates: usize::MAX };
    pub(super) const FEW: Self = Self { looks: MOST_LOOKS, candidates: MOST_CANDIDATES };

    pub(super) fn look(&mut self) {
        self.looks = self.looks.saturating_sub(1);
    }

    /// Takes what a site asks for.
    pub(super) fn take(&mut self, site: &Site) {
        self.candidates = self.candidates.saturating_sub(site.candidates());
    }

    pub(super) fn is_spent(&self) -> bool {
        self.looks == 0 || self.candidates == 0
    }
}

/// What came of pairs of faces: nothing, or the reason for which there is no site.
#[derive(Default)]
pub(super) struct Outcomes(BTreeMap<(u32, u32), Option<Rejection>>);

impl Outcomes {
    /// Of a pair in one closing direction: one with sites is enough.
    pub(super) fn add(&mut self, a: u32, b: u32, outcome: Option<Rejection>) {
        let found = outcome.is_none();
        let known = self.0.entry((a.min(b), a.max(b))).or_insert(outcome);
        if found {
            *known = None;
        }
    }
}

impl Round {
    /// Adds what came of pairs.
    pub(super) fn count(&mut self, pairs: Outcomes) {
        for outcome in pairs.0.into_values() {
            match outcome {
                None => self.pairs += 1,
                Some(reason) => self.add(reason, 1),
            }
        }
    }

    /// Adds pairs without sites.
    pub(super) fn add(&mut self, reason: Rejection, pairs: u64) {
        match self.rejections.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += pairs,
            None if pairs > 0 => self.rejections.push((reason, pairs)),
            None => {}
        }
    }
}

/// A place where a flat pad touches the part first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crest {
    pub(super) face: u32,
    /// Along the closing direction.
    pub(super) height: f64,
    /// Across the crest; infinite on a plane.
    pub(super) radius: f64,
    /// Around it, in the direction's axes.
    pub(super) bounds: Bounds2,
    /// Its ends in the axes of the upright direction.
    pub(super) ends: [DVec3; 2],
}

impl Finder<'_> {
    /// The sites on curved faces.
    pub(super) fn round(&mut self) -> Result<(Vec<Site>, Round)> {
        let mut sites = Vec::new();
        let mut seen = Outcomes::default();
        let mut widths = Vec::new();
        if !self.options.outside || self.round_faces().next().is_none() {
            return Ok((sites, Round::default()));
        }
        let loose = self.loose();
        for closing in self.closings() {
            self.budget.look();
            let mut skyline = None;
            let [above, below] =
                [1.0, -1.0].map(|side| levels(self.crests(side * closing), SAME_PLANE * self.size));
            let mut survey = None;
            for (top, bottom) in above.iter().flat_map(|top| below.iter().map(move |b| (top, b))) {
                let outcome = match self.facing(closing, top, bottom) {
                    Ok(None) => None,
                    Ok(Some(_)) if self.is_buried(closing, [top, bottom], &mut skyline) => {
                        Some(Some(Rejection::OutOfReach))
                    }
                    Ok(Some(boxes)) => {
                        self.budget.look();
                        let direction = self.direction(closing);
                        let survey = survey.get_or_insert_with(|| {
                            Survey::new(self.part, &loose, axes(self.directions[direction]))
                        });
                        let first = sites.len();
                        let found =
                            self.round_sites(direction, [top, bottom], boxes, survey, &mut sites)?;
                        sites[first..].iter().for_each(|site| self.budget.take(site));
                        found
                    }
                    Err(reason) => Some(Some(reason)),
                };
                if self.budget.is_spent() {
                    return Ok((Vec::new(), Round { left_out: true, ..Round::default() }));
                }
                let key = |level: &[Crest]| level.iter().map(|crest| crest.face).min();
                let (Some(outcome), Some(a), Some(b)) = (outcome, key(top), key(bottom)) else {
                    continue;
                };
                if matches!(outcome, Some(Rejection::Stroke)) {
                    widths.push(top[0].height + bottom[0].height);
                }
                seen.add(a, b, outcome);
            }
        }
        let mut round = Round { widths, ..Round::default() };
        round.count(seen);
        Ok((sites, round))
    }

    /// Half of the shorter side of the pads where these are two rectangles alike \[m\].
    pub(super) fn half_pad(&self) -> Option<f64> {
        let [one, two] = self.gripper.pads(self.gripper.stroke[1]);
        (one == two && one.len() == 4).then(|| 0.5 * self.gripper.pad_sizes()[0].min_element())
    }

    /// Whether the part stands in the pads' way wherever they cover a crest of two levels. `skyline`:
    /// that of the direction, once it was needed.
    pub(super) fn is_buried(
        &self,
        closing: DVec3,
        [top, bottom]: [&[Crest]; 2],
        skyline: &mut Option<Skyline>,
    ) -> bool {
        let Some(half) = self.half_pad() else { return false };
        let slack = 2.0 * SAME_PLANE * self.size;
        let heights = [top[0].height + slack, -bottom[0].height - slack];
        let vertices = &self.part.mesh.vertices;
        let stands_out = |vertex: &DVec3| {
            let height = closing.dot(*vertex);
            height > heights[0] || height < heights[1]
        };
        if !vertices.iter().any(stands_out) {
            return false;
        }
        let skyline = skyline.get_or_insert_with(|| Skyline::new(vertices, &axes(closing), half));
        let is_round = |level: &[Crest]| level.iter().all(|crest| crest.radius.is_finite());
        let level = if is_round(top) { top } else { bottom };
        is_round(level)
            && level.iter().all(|crest| {
                let [from, to] = crest.ends.map(DVec3::truncate);
                PLACES.iter().all(|&t| skyline.buries(from.lerp(to, t), heights))
            })
    }

    /// Triangles of no face, and of free form.
    pub(super) fn loose(&self) -> Vec<u32> {
        let mut taken = vec![false; self.part.mesh.triangles.len()];
        let plane = self.part.faces.iter().map(|face| &face.triangles);
        let curved = self.part.curved.iter().filter(|face| !is_free(face));
        let curved = curved.map(|face| &face.triangles);
        plane.chain(curved).flatten().for_each(|&triangle| taken[triangle as usize] = true);
        (0..taken.len() as u32).filter(|&triangle| !taken[triangle as usize]).collect()
    }

    pub(super) fn may_touch(&self, id: u32) -> bool {
        self.chosen.is_none_or(|chosen| chosen.get(id as usize).is_some_and(|chosen| *chosen))
    }

    /// Faces about an axis or point with a crest that pads may touch.
    pub(super) fn round_faces(&self) -> impl Iterator<Item = &CurvedFace> {
        let faces = self.part.curved.iter().filter(|face| !is_free(face));
        faces.filter(|face| face.outside && face.reachable && self.may_touch(face.id))
    }

    /// Closing directions to try, one of each two opposite ones, in a stable order.
    fn closings(&self) -> Vec<DVec3> {
        let mut found = Vec::new();
        for axis in self.round_axes() {
            self.add_closings(axis, &mut found);
        }
        for face in self.round_faces() {
            if let Shape::Torus { axis, major, .. } = face.shape
                && major > 0.0
            {
                add(axis.direction, &mut found);
            }
        }
        let is_sphere = |face: &CurvedFace| matches!(face.shape, Shape::Sphere { .. });
        if self.round_faces().any(is_sphere) {
            self.options.poses.iter().for_each(|pose| add(pose.rotation.z_axis, &mut found));
            self.facing_spheres().into_iter().for_each(|direction| add(direction, &mut found));
            let divisions = (ICOSAHEDRON / self.options.angle_step).round() as usize;
            let divisions = divisions.clamp(1, MOST_DIVISIONS);
            let evenly = directions(10 * divisions * divisions + 2);
            evenly.into_iter().for_each(|direction| add(direction, &mut found));
            if let Some(axis) = self.cone() {
                let (first, second) = axis.any_orthonormal_pair();
                for index in 0..2 * divisions {
                    let turn = std::f64::consts::PI * index as f64 / (2 * divisions) as f64;
                    add(first * turn.cos() + second * turn.sin(), &mut found);
                }
            }
        }
        found
    }

    /// Directions in which a sphere stands opposite a plane, another sphere or a cylinder, which a step
    /// of directions may miss: a cap shows few of them.
    fn facing_spheres(&self) -> Vec<DVec3> {
        let spheres: Vec<(&CurvedFace, DVec3, f64)> = self
            .round_faces()
            .filter_map(|face| match face.shape {
                Shape::Sphere { centre, radius } => Some((face, centre, radius)),
                _ => None,
            })
            .take(MOST_PLANES)
            .collect();
        let planes = self.part.faces.iter().filter(|face| face.reachable);
        let planes: Vec<DVec3> = planes.take(MOST_PLANES).map(|face| face.normal).collect();
        let mut found = Vec::new();
        for (index, &(face, centre, radius)) in spheres.iter().enumerate() {
            let mut take = |direction: DVec3| {
                if [1.0, -1.0].iter().any(|s| self.has_crest(face, s * direction, centre, radius)) {
                    found.push(direction);
                }
            };
            planes.iter().for_each(|normal| take(*normal));
            let others = spheres[..index].iter();
            others.filter_map(|other| (centre - other.1).try_normalize()).for_each(&mut take);
            for other in self.round_faces().take(MOST_PLANES) {
                if let Shape::Cylinder { axis, .. } = other.shape
                    && let Some(across) = (centre - axis.foot(centre)).try_normalize()
                {
                    take(across);
                }
            }
        }
        found
    }

    /// Closing directions across an axis.
    pub(super) fn closings_about(&self, axis: DVec3) -> Vec<DVec3> {
        let mut found = Vec::new();
        self.add_closings(axis, &mut found);
        found
    }

    /// Middle of the cone of approaches asked for.
    fn cone(&self) -> Option<DVec3> {
        self.options.approach_cone.map(|cone| cone.axis.normalize())
    }

    fn add_closings(&self, axis: DVec3, found: &mut Vec<DVec3>) {
        let mut planes: Vec<_> = self
            .part
            .faces
            .iter()
            .filter(|face| face.reachable && face.normal.dot(axis).abs() < LEVEL)
            .collect();
        planes.truncate(MOST_PLANES);
        // Across the axis: from the largest plane along it, or one of the part's own axes.
        let own = DVec3::AXES[axis.abs().min_position()];
        let first = planes.first().map_or(own, |face| face.normal);
        let first = (first - axis * axis.dot(first)).normalize();
        let second = axis.cross(first);
        if let Some(across) = self.cone().and_then(|cone| cone.cross(axis).try_normalize()) {
            add(across, found);
        }
        let count = (std::f64::consts::PI / self.options.angle_step).round().max(1.0) as usize;
        for index in 0..count {
            let turn = DVec2::from_angle(std::f64::consts::PI * index as f64 / count as f64);
            add(first * turn.x + second * turn.y, found);
        }
        planes.iter().for_each(|face| add(face.normal, found));
        for pose in &self.options.poses {
            let across = pose.rotation.z_axis.reject_from(axis);
            if across.length() > RIGHTED {
                add(across.normalize(), found);
            }
        }
    }

    /// Axes of faces that are round about one, the largest first.
    fn round_axes(&self) -> Vec<DVec3> {
        let mut axes: Vec<(DVec3, f64)> = Vec::new();
        for face in self.round_faces() {
            let (Shape::Cylinder { axis, .. } | Shape::Torus { axis, .. }) = &face.shape else {
                continue;
            };
            let same =
                |(known, _): &&mut (DVec3, f64)| known.cross(axis.direction).length() < SAME_AXIS;
            match axes.iter_mut().find(same) {
                Some((_, area)) => *area += face.area,
                None => axes.push((axis.direction, face.area)),
            }
        }
        axes.sort_by(|a, b| b.1.total_cmp(&a.1));
        axes.into_iter().map(|(axis, _)| axis).collect()
    }

    /// The crests that face a direction.
    pub(super) fn crests(&self, closing: DVec3) -> Vec<Crest> {
        let (axes_from_part, upright_axes) = (axes(closing), axes(upright(closing)));
        let place = |point: DVec3| (axes_from_part * point).truncate();
        let mut crests = Vec::new();
        for face in &self.part.faces {
            let aligned = face.normal.cross(closing).length() < LEVEL;
            if face.reachable
                && aligned
                && face.normal.dot(closing) > 0.0
                && self.may_touch(face.id)
                && self.part.round_of(face).is_none()
            {
                let bounds = polygon::bounds(&project(std::iter::once(face), &axes_from_part));
                let (height, ends) = (closing.dot(face.centroid), [DVec3::ZERO; 2]);
                let radius = f64::INFINITY;
                crests.push(Crest { face: face.id, height, radius, bounds, ends });
            }
        }
        for face in self.round_faces() {
            let level = |direction: DVec3| direction.dot(closing).abs() < LEVEL;
            let (middle, radius, ends) = match &face.shape {
                Shape::Cylinder { axis, radius, along, .. } if level(axis.direction) => {
                    let ends = along.map(|along| axis.origin + axis.direction * along);
                    (0.5 * (ends[0] + ends[1]), *radius, ends)
                }
                Shape::Sphere { centre, radius } => (*centre, *radius, [*centre; 2]),
                Shape::Torus { axis, major, minor } if level(axis.direction) => {
                    (axis.origin, major + minor, [axis.origin; 2])
                }
                &Shape::Torus { axis, major, minor } if is_flat(axis.direction, major, closing) => {
                    let height = closing.dot(axis.origin) + minor;
                    for ends in self.arcs(face, closing, (axis.origin, [major, minor])) {
                        let bounds = Bounds2::of(&ends.map(place));
                        let ends = ends.map(|end| upright_axes * (end + minor * closing));
                        crests.push(Crest { face: face.id, height, radius: minor, bounds, ends });
                    }
                    continue;
                }
                _ => continue,
            };
            if self.has_crest(face, closing, middle, radius) {
                let bounds = Bounds2::of(&ends.map(place));
                let height = closing.dot(middle) + radius;
                let ends = ends.map(|end| upright_axes * (end + radius * closing));
                crests.push(Crest { face: face.id, height, radius, bounds, ends });
            }
        }
        crests
    }

    /// Whether the face, which may be a part of a full round, reaches its crest.
    fn has_crest(&self, face: &CurvedFace, closing: DVec3, middle: DVec3, radius: f64) -> bool {
        let across = match &face.shape {
            Shape::Cylinder { axis, .. } => axis.direction.cross(closing),
            _ => DVec3::ZERO,
        };
        let slack = 1e-3 * radius;
        face.triangles.iter().any(|&triangle| {
            let [a, b, c] = self.part.mesh.corners(triangle);
            let corners = [a - middle, b - middle, c - middle];
            let [x, y, z] = corners;
            let height = x.dot(closing).max(y.dot(closing)).max(z.dot(closing));
            if height < 0.5 * radius {
                return false;
            }
            if across == DVec3::ZERO {
                return height > 0.97 * radius;
            }
            let sides = |test: fn(f64, f64) -> bool| {
                corners.iter().any(|corner| test(corner.dot(across), slack))
            };
            sides(|y, slack| y >= -slack) && sides(|y, slack| y <= slack)
        })
    }

    /// Where two levels of crests are to be looked at, in the direction's axes: their boxes. `None`:
    /// they do not face each other.
    fn facing(
        &self,
        closing: DVec3,
        top: &[Crest],
        bottom: &[Crest],
    ) -> std::result::Result<Option<[Bounds2; 2]>, Rejection> {
        let width = top[0].height + bottom[0].height;
        let flat = |level: &[Crest]| level.iter().any(|crest| crest.radius.is_infinite());
        let reach = self.reach;
        let around = |level: &[Crest], flip: bool| {
            let bounds = level.iter().map(|crest| crest.bounds);
            let bounds = bounds.fold(Bounds2::EMPTY, Bounds2::union);
            // The axes of the opposite direction.
            if flip { self.flipped(bounds, closing) } else { bounds }
        };
        let boxes = [around(top, false), around(bottom, true)];
        if width <= 0.0
            || flat(top) && flat(bottom)
            || !boxes[0].grown(reach).meets(boxes[1].grown(reach))
        {
            return Ok(None);
        }
        Stroke::new(PairKind::External, self.gripper, self.options).check(width)?;
        let radius = |level: &[Crest]| level.iter().map(|crest| crest.radius).fold(0.0, f64::max);
        if radius(top) + radius(bottom) < width * (1.0 - ON_ONE_AXIS) {
            return Err(Rejection::RollsApart);
        }
        Ok(Some(boxes))
    }

    /// Adds the sites of two levels of crests. `None`: pads touch nothing there; else the reason
    /// for which there is no site, if so.
    #[allow(clippy::option_option, reason = "told apart by the caller at once")]
    fn round_sites(
        &mut self,
        direction: usize,
        [top, bottom]: [&[Crest]; 2],
        boxes: [Bounds2; 2],
        survey: &Survey<'_>,
        sites: &mut Vec<Site>,
    ) -> Result<Option<Option<Rejection>>> {
        let heights = [top[0].height, -bottom[0].height];
        let reach = self.reach;
        let common =
            Bounds2 { min: boxes[0].min.max(boxes[1].min), max: boxes[0].max.min(boxes[1].max) };
        let region = Bounds2 {
            min: common.min.min(common.max) - 2.0 * reach,
            max: common.max.max(common.min) + 2.0 * reach,
        };
        let layer = self.gripper.layer();
        let pieces = survey.pieces(heights, [layer.reach(); 2], region);
        let sides = [top, bottom].map(|level| {
            let mut faces: Vec<u32> = level.iter().map(|crest| crest.face).collect();
            faces.sort_unstable();
            faces.dedup();
            faces
        });
        let rise = SAME_PLANE * self.size;
        // The middle of crests that are not in line, as of the legs of a bent tube, lies on none of them.
        let on_crests = top.iter().map(|crest| crest.bounds.centre());
        for place in std::iter::once(common.centre()).chain(on_crests.filter(|_| top.len() > 1)) {
            let (sides, pieces) = (sides.clone(), pieces.clone());
            let at = (heights, place);
            if self.pressed_sites(direction, sides, at, pieces, (rise, None), sites)? {
                return Ok(Some(None));
            }
        }
        Ok(None)
    }

    /// Adds the sites of pieces of surface under pads over `place` with their planes at `heights`;
    /// whether there are any. `rise`: see [`Site::rise`]; `main`: angle of the sites' `x`, by their
    /// edges where there is none.
    pub(super) fn pressed_sites(
        &self,
        direction: usize,
        sides: [Vec<u32>; 2],
        (heights, place): ([f64; 2], DVec2),
        pieces: [Vec<Piece>; 2],
        (rise, main): (f64, Option<f64>),
        sites: &mut Vec<Site>,
    ) -> Result<bool> {
        let (layer, force) = (self.gripper.layer(), self.options.force_on(self.gripper));
        let pads = self.gripper.pads(heights[0] - heights[1]);
        let Some(relief) = Relief::new(pieces, layer, force, &pads, place) else {
            return Ok(false);
        };
        let overlap = overlay::intersect(&relief.pressed[0], &relief.pressed[1]);
        let mut any = false;
        for overlap in stretches(overlap, 2.0 * self.reach) {
            let (turn, middle) = lie(&overlap, main);
            let (kind, sides) = (PairKind::External, &sides);
            let base = Base { kind, direction, sides, overlap, turn, middle, heights, rise };
            sites.push(self.site(base, Some(relief.clone()))?);
            any = true;
        }
        Ok(any)
    }

    /// Bounds in the axes of the opposite direction as bounds in those of `closing`.
    pub(super) fn flipped(&self, bounds: Bounds2, closing: DVec3) -> Bounds2 {
        let map = axes(closing) * axes(-closing).transpose();
        let corners = [bounds.min, bounds.max, DVec2::new(bounds.min.x, bounds.max.y)];
        Bounds2::of(&corners.map(|corner| (map * corner.extend(0.0)).truncate()))
    }
}

/// Adds a direction, unless it or its opposite is there.
fn add(direction: DVec3, found: &mut Vec<DVec3>) {
    let direction = upright(direction);
    if !found.iter().any(|known| known.cross(direction).length() < SAME_CLOSING) {
        found.push(direction);
    }
}

/// Crests by levels: those at one height together, the highest first.
fn levels(mut crests: Vec<Crest>, tolerance: f64) -> Vec<Vec<Crest>> {
    crests.sort_by(|a, b| b.height.total_cmp(&a.height).then(a.face.cmp(&b.face)));
    let mut levels: Vec<Vec<Crest>> = Vec::new();
    for crest in crests {
        match levels.last_mut() {
            Some(level) if level[0].height - crest.height <= tolerance => level.push(crest),
            _ => levels.push(vec![crest]),
        }
    }
    levels
}

//! What of the part's surface faces the pads' planes of one closing direction, as pieces with gaps.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::rc::Rc;

use glam::{DMat3, DVec2, DVec3};
use rustc_hash::FxHashMap;

use super::shapes::{outlines, project};
use super::tori::{OFF_ARC, OFF_RIM, is_flat, sectors};
use super::{Finder, axes};
use crate::contact::surface::cut;
use crate::geometry::polygon::{Bounds2, straightened};
use crate::geometry::{
    HalfPlane, UnionFind, clip_ring_half_plane, even_odd, intersect_convex, is_convex, ring_area,
};
use crate::model::{Gap, Patch, Piece, Polygon, Ring};
use crate::part::{CurvedFace, Part, PlanarFace, Shape};

/// Surface that leans more against the pads' plane (cosine of the angle) is no place for a pad.
pub(super) const FACING: f64 = 0.85;
/// Slope below which a plane counts as the pads' own.
const FLAT: f64 = 1e-7;
/// Facets whose slopes and heights \[m\] differ by less lie in one plane: rounding, no more than 1e-9 of
/// a compression.
const SAME_SLOPE: f64 = 1e-12;
const SAME_HEIGHT: f64 = 1e-14;
/// Sine of the angle between a curved face's axis and the pads' plane up to which the face is taken
/// as it is: 10 um on 20 mm. Beyond, and what has no such axis, it is taken facet by facet.
pub(super) const LEVEL: f64 = 5e-4;
/// The part of a radius to either side of a crest within which the parabola stands for the circle.
const PARABOLA: f64 = 0.9;
/// Gap of a round face over that of the parabola for it, at most.
const DEEPER: f64 = 1.5;
/// Share of the reach that is added to boxes against rounding.
const SLACK: f64 = 1e-3;
/// Corners of the window around what a pad may touch of a sphere.
const WINDOW: usize = 32;
/// The part's surface in the axes of one closing direction, for one look after the other.
pub(super) struct Survey<'a> {
    part: &'a Part,
    axes_from_part: DMat3,
    /// Corners of the part in the axes, where most of them are looked at; else none.
    points: Vec<DVec3>,
    /// Boxes around plane faces and curved ones, and the triangles of no face with theirs.
    planes: Vec<Span>,
    curved: Vec<Span>,
    loose: Vec<(Span, u32)>,
    is_left_out: fn(&CurvedFace) -> bool,
    /// Areas of triangles, the last ones first.
    areas: RefCell<Vec<(Vec<u32>, Rc<Patch>)>>,
}

/// Areas of triangles that a survey keeps: both sides of some faces.
const MOST_AREAS: usize = 8;

/// A box around a piece of surface: across the closing direction, and along it.
#[derive(Debug, Clone, Copy)]
struct Span {
    across: Bounds2,
    along: [f64; 2],
}

impl Span {
    fn of(points: impl Iterator<Item = DVec3>) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for point in points {
            (low, high) = (low.min(point), high.max(point));
        }
        Self::between(low, high)
    }

    /// Around triangles given by their corners.
    fn around(triangles: impl Iterator<Item = [DVec3; 3]>) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for [a, b, c] in triangles {
            (low, high) = (low.min(a.min(b).min(c)), high.max(a.max(b).max(c)));
        }
        Self::between(low, high)
    }

    fn between(low: DVec3, high: DVec3) -> Self {
        let across = Bounds2 { min: low.truncate(), max: high.truncate() };
        Self { across, along: [low.z, high.z] }
    }
}

impl<'a> Survey<'a> {
    /// `loose`: triangles of no face, and of free form.
    pub(super) fn new(part: &'a Part, loose: &[u32], axes_from_part: DMat3) -> Self {
        Self::without(part, loose, axes_from_part, is_free)
    }

    /// Without some curved faces, whose triangles are among the `loose` ones as far as they count.
    pub(super) fn without(
        part: &'a Part,
        loose: &[u32],
        axes_from_part: DMat3,
        is_left_out: fn(&CurvedFace) -> bool,
    ) -> Self {
        let curved = || part.curved.iter().filter(|face| !is_left_out(face));
        let looks = loose.len() + curved().map(|face| face.triangles.len()).sum::<usize>();
        let vertices = &part.mesh.vertices;
        let points = match 3 * looks >= vertices.len() {
            true => vertices.iter().map(|&vertex| axes_from_part * vertex).collect(),
            false => Vec::new(),
        };
        let corners = |&triangle: &u32| corners(part, &axes_from_part, &points, triangle);
        let plane = |face: &PlanarFace| {
            // As a facet of a round face it is there once.
            if part.round_of(face).is_some_and(|round| !is_left_out(round)) {
                return Span { across: Bounds2::EMPTY, along: [0.0; 2] };
            }
            let outlines = face.polygons.iter().flat_map(|polygon| &polygon.outer);
            Span::of(outlines.map(|at| axes_from_part * face.part_from_face.point(at.extend(0.0))))
        };
        let span = |face: &CurvedFace| Span::around(face.triangles.iter().map(corners));
        let (planes, curved) =
            (part.faces.iter().map(plane).collect(), curved().map(span).collect());
        let loose = loose.iter().map(|id| (Span::around([corners(id)].into_iter()), *id)).collect();
        Self {
            part,
            axes_from_part,
            points,
            planes,
            curved,
            is_left_out,
            loose,
            areas: RefCell::default(),
        }
    }

    /// The area of some triangles seen along the closing direction, of many rows the same ones.
    fn area(&self, triangles: Vec<u32>) -> Rc<Patch> {
        let mut areas = self.areas.borrow_mut();
        if let Some((_, known)) = areas.iter().find(|(of, _)| *of == triangles) {
            return Rc::clone(known);
        }
        // Edges between two of them bound nothing.
        let mesh = &self.part.mesh;
        let corners = triangles.iter().map(|&triangle| mesh.triangles[triangle as usize]);
        let place = |corner: &u32| self.place(*corner).truncate();
        let rings: Vec<Ring> =
            outlines(corners).iter().map(|ring| ring.iter().map(place).collect()).collect();
        let mut area = even_odd(&rings);
        area.iter_mut().for_each(|shape| shape.outer = straightened(&shape.outer));
        let area = Rc::new(area);
        areas.truncate(MOST_AREAS - 1);
        areas.insert(0, (triangles, Rc::clone(&area)));
        area
    }

    /// A corner of the mesh in the axes.
    fn place(&self, corner: u32) -> DVec3 {
        match &self.points[..] {
            [] => self.axes_from_part * self.part.mesh.vertices[corner as usize],
            points => points[corner as usize],
        }
    }

    #[inline]
    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        corners(self.part, &self.axes_from_part, &self.points, triangle)
    }

    /// What faces each pad's plane within a region: up to a gap of `reach`, and no higher than `above`
    /// \[m\].
    pub(super) fn pieces(
        &self,
        heights: [f64; 2],
        [reach, above]: [f64; 2],
        region: Bounds2,
    ) -> [Vec<Piece>; 2] {
        [(heights[0], 1.0), (heights[1], -1.0)].map(|(height, side)| {
            Look { survey: self, height, side, reach, above, region }.pieces()
        })
    }

    /// The part of some triangles within a convex window, seen from a `side` as in [`Look`], as
    /// pieces of a surface.
    pub(super) fn outlined(
        &self,
        triangles: &[u32],
        window: &[DVec2],
        gap: Gap,
        side: f64,
    ) -> Vec<Piece> {
        let region = Bounds2::of(window);
        let look = Look { survey: self, height: 0.0, side, reach: 0.0, above: 0.0, region };
        let mut pieces = Vec::new();
        look.outline(triangles, f64::INFINITY, &[(window.to_vec(), gap)], &mut pieces);
        pieces
    }
}

/// Looks along some closing directions, each made once.
#[derive(Default)]
pub(super) struct Surveys<'a> {
    loose: Option<Vec<u32>>,
    known: FxHashMap<usize, Survey<'a>>,
}

impl<'a> Surveys<'a> {
    /// The one along a direction; `None` where only planes are to be gripped.
    pub(super) fn of(&mut self, finder: &Finder<'a>, direction: usize) -> Option<&Survey<'a>> {
        if finder.options.curved == Some(false) {
            return None;
        }
        let loose = self.loose.get_or_insert_with(|| finder.loose());
        let axes = axes(finder.directions[direction]);
        Some(self.known.entry(direction).or_insert_with(|| Survey::new(finder.part, loose, axes)))
    }
}

/// Whether a face is of free form.
pub(super) fn is_free(face: &CurvedFace) -> bool {
    face.shape == Shape::Freeform
}

/// Corners of a triangle in the axes; `points`: all of the part's, or none.
#[inline]
fn corners(part: &Part, axes_from_part: &DMat3, points: &[DVec3], triangle: u32) -> [DVec3; 3] {
    if points.is_empty() {
        let [a, b, c] = part.mesh.corners(triangle);
        return [*axes_from_part * a, *axes_from_part * b, *axes_from_part * c];
    }
    let [a, b, c] = part.mesh.triangles[triangle as usize];
    [points[a as usize], points[b as usize], points[c as usize]]
}

/// Looks for the surface that faces one pad's plane.
struct Look<'a> {
    survey: &'a Survey<'a>,
    /// Height of the pad's plane in the axes.
    height: f64,
    /// 1 for the pad above, facing `-z`; -1 for the one below.
    side: f64,
    /// Largest gap that counts \[m\].
    reach: f64,
    /// How far above the pad's plane what counts may rise \[m\]: more is on the pad's other side.
    above: f64,
    /// Where pads get to.
    region: Bounds2,
}

impl Look<'_> {
    /// All pieces.
    fn pieces(&self) -> Vec<Piece> {
        let mut pieces = Vec::new();
        let Survey { part, planes, curved, loose, is_left_out, .. } = self.survey;
        for (index, _) in planes.iter().enumerate().filter(|(_, span)| self.meets(span)) {
            self.plane(index, &mut pieces);
        }
        let near = loose.iter().filter(|(span, _)| self.meets(span));
        let mut facets: Vec<u32> = near.map(|(_, id)| *id).collect();
        let faces = part.curved.iter().filter(|face| !is_left_out(face));
        for (face, _) in faces.zip(curved).filter(|(_, span)| self.meets(span)) {
            if !self.curved(face, &mut pieces) {
                facets.extend(&face.triangles);
            }
        }
        pieces.retain(|piece| largest(piece) > -self.above);
        let facets = facets.into_iter().filter_map(|id| Some((id, self.facet(id)?)));
        self.join(facets.filter(|(_, piece)| largest(piece) > -self.above).collect(), &mut pieces);
        pieces
    }

    /// Whether anything in a box can count.
    fn meets(&self, span: &Span) -> bool {
        let [low, high] = span.along.map(|z| self.side * (self.height - z));
        // A curved face between the corners of its facets.
        let slack = 0.1 * (high - low).abs() + SLACK * self.reach;
        low.min(high) <= self.reach + slack
            && low.max(high) > -self.above - slack
            && span.across.grown(slack).meets(self.region)
    }

    /// The region as a ring, cut where a plane gap exceeds the reach.
    fn window(&self, height: f64, slope: DVec2) -> Ring {
        let Bounds2 { min, max } = self.region;
        let ring = vec![min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)];
        let within = HalfPlane { normal: -slope, offset: self.reach - height };
        if slope == DVec2::ZERO { ring } else { clip_ring_half_plane(&ring, &within) }
    }

    /// The gap of a plane through `point` with the normal `normal`, both in the axes.
    fn plane_gap(&self, point: DVec3, normal: DVec3) -> Option<(f64, DVec2)> {
        if normal.z * self.side < FACING {
            return None;
        }
        let slope = self.side * normal.truncate() / normal.z;
        let gap = self.side * (self.height - point.z);
        let slope = if slope.length() < FLAT { DVec2::ZERO } else { slope };
        Some((gap - slope.dot(point.truncate()), slope))
    }

    fn plane(&self, index: usize, pieces: &mut Vec<Piece>) {
        let face = &self.survey.part.faces[index];
        let (point, normal) =
            (self.survey.axes_from_part * face.centroid, self.survey.axes_from_part * face.normal);
        let Some((height, slope)) = self.plane_gap(point, normal) else { return };
        if slope == DVec2::ZERO && height > self.reach {
            return;
        }
        let window = self.window(height, slope);
        let outlines = project(std::iter::once(face), &self.survey.axes_from_part);
        let gap = Gap::Plane { height, slope };
        for Polygon { outer, holes } in intersect_convex(&window, &outlines) {
            pieces.push(Piece { outer, holes, gap });
        }
    }

    fn facet(&self, triangle: u32) -> Option<Piece> {
        let corners = self.survey.corners(triangle);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).try_normalize()?;
        let nearest = corners
            .iter()
            .map(|corner| self.side * (self.height - corner.z))
            .fold(f64::INFINITY, f64::min);
        let mut outer: Ring = corners.map(DVec3::truncate).to_vec();
        if nearest > self.reach || !Bounds2::of(&outer).meets(self.region) {
            return None;
        }
        let (height, slope) = self.plane_gap(a, normal)?;
        if self.side < 0.0 {
            outer.reverse();
        }
        Some(Piece { outer, holes: Vec::new(), gap: Gap::Plane { height, slope } })
    }

    /// Adds facets; those beside each other in one plane, as along a prism, are one piece if that is
    /// convex.
    fn join(&self, facets: Vec<(u32, Piece)>, pieces: &mut Vec<Piece>) {
        let triangles = &self.survey.part.mesh.triangles;
        let mut sets = UnionFind::new(facets.len());
        let mut seen: FxHashMap<(u32, u32), usize> = FxHashMap::default();
        for (index, (triangle, piece)) in facets.iter().enumerate() {
            let [a, b, c] = triangles[*triangle as usize];
            for (a, b) in [(a, b), (b, c), (c, a)] {
                let other = *seen.entry((a.min(b), a.max(b))).or_insert(index);
                if other != index && is_one_plane(&facets[sets.root(other)].1.gap, &piece.gap) {
                    sets.join(other, index);
                }
            }
        }
        let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for index in 0..facets.len() {
            members.entry(sets.root(index)).or_default().push(index);
        }
        for (first, members) in members {
            if let [_, _, ..] = members[..] {
                let corners = members.iter().map(|&index| triangles[facets[index].0 as usize]);
                let rings = outlines(corners);
                if let [ring] = &rings[..] {
                    let place = |corner: &u32| self.survey.place(*corner).truncate();
                    let mut outer: Ring = ring.iter().map(place).collect();
                    if ring_area(&outer) < 0.0 {
                        outer.reverse();
                    }
                    let outer = straightened(&outer);
                    if is_convex(&outer) {
                        let gap = facets[first].1.gap;
                        pieces.push(Piece { outer, holes: Vec::new(), gap });
                        continue;
                    }
                }
            }
            pieces.extend(members.iter().map(|&index| facets[index].1.clone()));
        }
    }

    /// Takes a curved face as it is; `false` where it has to be taken by its facets.
    fn curved(&self, face: &CurvedFace, pieces: &mut Vec<Piece>) -> bool {
        let place = |point: DVec3| self.survey.axes_from_part * point;
        let level = |direction: DVec3| {
            let direction = place(direction);
            (direction.z.abs() < LEVEL).then(|| direction.truncate().normalize())
        };
        // How far the plane is from the crest, whose centre is `radius` behind it.
        let height = |centre: DVec3, radius: f64| {
            let outward = if face.outside { radius } else { -radius };
            self.side * (self.height - centre.z) - outward
        };
        let half = |radius: f64, height: f64| {
            (2.0 * radius * (self.reach - height)).sqrt().min(PARABOLA * radius)
        };
        let size = self.region.size().length();
        match face.shape {
            Shape::Cylinder { axis, radius, along, .. } => {
                let Some(direction) = level(axis.direction) else { return false };
                let middle = axis.origin + axis.direction * (0.5 * (along[0] + along[1]));
                let centre = place(middle);
                let height = height(centre, radius);
                let across = match face.outside {
                    true if height >= self.reach => return true,
                    true => half(radius, height),
                    false => 0.7 * radius,
                };
                let at = centre.truncate();
                let at = at + direction * direction.dot(self.region.centre() - at);
                let corner = |x: f64, y: f64| at + x * size * direction + y * direction.perp();
                let window = [(-1.0, -across), (1.0, -across), (1.0, across), (-1.0, across)]
                    .map(|(x, y)| corner(x, y));
                let radius = if face.outside { radius } else { -radius };
                let gap = Gap::Cylinder { radius, axis: direction, at, height };
                self.within(face, vec![(window.to_vec(), gap)], pieces);
                true
            }
            Shape::Cone { apex, axis, half_angle, along } => {
                let Some(direction) = level(axis) else { return false };
                let (apex, slope) = (place(apex), half_angle.tan());
                let sense = if face.outside { 1.0 } else { -1.0 };
                // Where the plane meets it, or at the end that comes nearest.
                let behind = self.side * (self.height - apex.z);
                let radius = (sense * behind).clamp(slope * along[0], slope * along[1]);
                if radius <= 0.0 {
                    return false;
                }
                let height = behind - sense * radius;
                if height < self.reach || !face.outside {
                    let at = apex.truncate() + direction * (radius / slope);
                    let across = if face.outside { half(radius, height) } else { 0.7 * radius };
                    let length = along[1] - along[0];
                    let corner = |x: f64, y: f64| {
                        apex.truncate() + (along[0] + x * length) * direction + y * direction.perp()
                    };
                    let window = [(0.0, -across), (1.0, -across), (1.0, across), (0.0, across)]
                        .map(|(x, y)| corner(x, y));
                    let (radius, slope) = (sense * radius, -sense * slope);
                    let gap = Gap::Cone { radius, slope, axis: direction, at, height };
                    self.within(face, vec![(window.to_vec(), gap)], pieces);
                }
                true
            }
            Shape::Sphere { centre, radius } if face.outside => {
                let centre = place(centre);
                let height = height(centre, radius);
                if height < self.reach {
                    let at = centre.truncate();
                    let window = ellipse(at, DVec2::X, [half(radius, height); 2]);
                    let gap = Gap::Sphere { radius, at, height };
                    self.within(face, vec![(window, gap)], pieces);
                }
                true
            }
            Shape::Torus { axis, major, minor } if face.outside => {
                let centre = place(axis.origin);
                if is_flat(place(axis.direction), major, DVec3::Z) {
                    let height = height(centre, minor);
                    if height < self.reach {
                        let is_level = |piece: &Piece| {
                            let Gap::Plane { height: there, slope } = piece.gap else {
                                return false;
                            };
                            slope == DVec2::ZERO && (there - height).abs() < SLACK * self.reach
                        };
                        let off = if pieces.iter().any(is_level) { OFF_RIM } else { OFF_ARC };
                        let off = off * (2.0 * minor * self.reach).sqrt();
                        let (at, round) = (centre.truncate(), [major, half(minor, height), off]);
                        let sectors = sectors(at, round, (minor, height), self.region);
                        self.within(face, sectors, pieces);
                    }
                    return true;
                }
                let Some(direction) = level(axis.direction) else { return false };
                let radius = major + minor;
                let height = height(centre, radius);
                if height < self.reach {
                    let at = centre.truncate();
                    let window =
                        ellipse(at, direction, [half(minor, height), half(radius, height)]);
                    let gap = Gap::Barrel { radius, meridian: minor, axis: direction, at, height };
                    self.within(face, vec![(window, gap)], pieces);
                }
                true
            }
            _ => false,
        }
    }

    /// The parts of a curved face within windows, each with its gap.
    fn within(&self, face: &CurvedFace, windows: Vec<(Ring, Gap)>, pieces: &mut Vec<Piece>) {
        // What lies behind, as the far wall of a hole, is under the pad too, and seen from there.
        self.outline(&face.triangles, DEEPER * self.reach, &windows, pieces);
    }

    /// The parts of some triangles within windows, up to a gap of `deepest` \[m\].
    fn outline(
        &self,
        triangles: &[u32],
        deepest: f64,
        windows: &[(Ring, Gap)],
        pieces: &mut Vec<Piece>,
    ) {
        let within = windows.iter().map(|(window, _)| Bounds2::of(window));
        let within = within.fold(Bounds2::EMPTY, Bounds2::union);
        if !within.meets(self.region) {
            return;
        }
        let mut seen: Vec<u32> = Vec::new();
        for &triangle in triangles {
            let [a, b, c] = self.survey.corners(triangle);
            // Most end at the first of these.
            let nearest = match self.side > 0.0 {
                true => self.height - a.z.max(b.z).max(c.z),
                false => a.z.min(b.z).min(c.z) - self.height,
            };
            if nearest > deepest {
                continue;
            }
            let [a, b, c] = [a, b, c].map(DVec3::truncate);
            if (b - a).perp_dot(c - a) * self.side <= 0.0 {
                continue;
            }
            if (Bounds2 { min: a.min(b).min(c), max: a.max(b).max(c) }).meets(within) {
                seen.push(triangle);
            }
        }
        for Polygon { outer, holes } in self.survey.area(seen).iter() {
            for &(ref window, gap) in windows {
                let area = Piece { outer: outer.clone(), holes: holes.clone(), gap };
                for Polygon { outer, holes } in cut(&area, window) {
                    let holes = holes.iter().map(|hole| straightened(hole)).collect();
                    pieces.push(Piece { outer: straightened(&outer), holes, gap });
                }
            }
        }
    }
}

/// Whether two facets lie in one plane.
fn is_one_plane(one: &Gap, other: &Gap) -> bool {
    match (one, other) {
        (Gap::Plane { height, slope }, Gap::Plane { height: h, slope: s }) => {
            slope.distance(*s) < SAME_SLOPE && (height - h).abs() < SAME_HEIGHT
        }
        _ => false,
    }
}

/// Largest gap of a plane piece, of others the one at the crest \[m\].
fn largest(piece: &Piece) -> f64 {
    match piece.gap {
        Gap::Plane { height, slope } => {
            let gaps = piece.outer.iter().map(|x| height + slope.dot(*x));
            gaps.fold(f64::NEG_INFINITY, f64::max)
        }
        Gap::Cylinder { height, .. }
        | Gap::Sphere { height, .. }
        | Gap::Barrel { height, .. }
        | Gap::Cone { height, .. } => height,
    }
}

/// A ring about an ellipse.
pub(super) fn ellipse(at: DVec2, axis: DVec2, half: [f64; 2]) -> Ring {
    let step = TAU / WINDOW as f64;
    let corner = |index: usize| {
        let e = DVec2::from_angle(step * index as f64) / (0.5 * step).cos();
        at + half[0] * e.x * axis + half[1] * e.y * axis.perp()
    };
    (0..WINDOW).map(corner).collect()
}

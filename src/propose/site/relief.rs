//! What the pads of a site touch where it is not plane: all of the part's surface within reach of
//! the pads' layers, as pieces with gaps.

use glam::{DAffine2, DMat3, DVec2, DVec3};

use super::places::Edge;
use super::shapes::{project, to_site};
use crate::contact::surface::{cut, mapped, pressed, spot};
use crate::geometry::polygon::{self, Bounds2};
use crate::geometry::{HalfPlane, clip_ring_half_plane, even_odd, intersect_convex};
use crate::gripper::{Jaws, Layer};
use crate::mechanics::curved::Pads;
use crate::model::{Contact, Gap, Patch, Piece, Polygon, Ring, Surfaces};
use crate::part::{CurvedFace, Part, PlanarFace, Shape};
use crate::propose::options::ProposeOptions;

/// Surface that leans more against the pads' plane (cosine of the angle) is no place for a pad.
pub(super) const FACING: f64 = 0.85;
/// Slope below which a plane counts as the pads' own.
const FLAT: f64 = 1e-7;
/// Sine of the angle between a curved face's axis and the pads' plane up to which the face is taken
/// as it is: 10 um on 20 mm. Beyond, and what has no such axis, it is taken facet by facet.
pub(super) const LEVEL: f64 = 5e-4;
/// The part of a radius to either side of a crest within which the parabola stands for the circle.
const PARABOLA: f64 = 0.9;
/// Share of the reach that is added to boxes against rounding.
const SLACK: f64 = 1e-3;
/// Corners of the window around what a pad may touch of a sphere.
const WINDOW: usize = 32;
/// Step of the approach angle about a point contact, at least \[rad\].
const POINT_STEP: f64 = 45.0 * std::f64::consts::PI / 180.0;

/// What the pads of a site touch.
#[derive(Debug, Clone)]
pub(in crate::propose) struct Relief {
    /// Pieces on side I and II in the site's `(x, y)`; gaps are those behind the site's planes.
    pub(super) pieces: [Vec<Piece>; 2],
    /// What is pressed on either side by pads as far as they press one piece over its middle: the
    /// measure of a contact before it is solved.
    pub(in crate::propose) pressed: [Patch; 2],
    layer: Layer,
    force: f64,
    /// Compressions at the planes of these pads \[m\], near which those of others are looked for.
    deltas: [f64; 2],
}

impl Relief {
    /// With the pressure of a pad over `place`; `None` where it presses nothing on one side.
    pub(super) fn new(
        pieces: [Vec<Piece>; 2],
        layer: Layer,
        force: f64,
        pads: &[Ring; 2],
        place: DVec2,
    ) -> Option<Self> {
        let deltas = [0.0; 2];
        let relief = Self { pieces, pressed: Default::default(), layer, force, deltas };
        let rings = pads.each_ref().map(|pad| moved_ring(pad, place));
        let under = relief.under(
            [&rings[0], &rings[1]],
            &DAffine2::from_translation(-place),
            Jaws::Straight,
        );
        let deltas = Pads::new(&under).ok()?.deltas(force)?;
        Some(Self::pressed_by(relief.pieces, layer, force, deltas))
    }

    /// With the pressure of pads whose layers are compressed by `deltas` at the pads' planes.
    pub(super) fn pressed_by(
        pieces: [Vec<Piece>; 2],
        layer: Layer,
        force: f64,
        deltas: [f64; 2],
    ) -> Self {
        let pressed = [0, 1].map(|side: usize| {
            pieces[side].iter().flat_map(|piece| pressed(piece, deltas[side])).collect()
        });
        Self { pieces, pressed, layer, force, deltas }
    }

    /// As seen from another origin and turn.
    pub(super) fn moved(&self, origin: DVec2, turn: f64) -> Self {
        let map = DAffine2::from_angle(-turn) * DAffine2::from_translation(-origin);
        let pieces = [0, 1].map(|side: usize| {
            let pieces = self.pieces[side].iter();
            pieces.map(|piece| moved(&piece.polygon(), &piece.gap, &map)).collect()
        });
        let pressed = [0, 1].map(|side: usize| {
            self.pressed[side].iter().map(|polygon| to_site(polygon, origin, turn)).collect()
        });
        Self { pieces, pressed, ..self.clone() }
    }

    /// What lies under pads with the outlines `rings` in the site's plane, as seen from the grip:
    /// `grip_from_site`, before the jaws are exchanged.
    fn under(&self, rings: [&[DVec2]; 2], grip_from_site: &DAffine2, jaws: Jaws) -> Surfaces {
        let map = match jaws {
            Jaws::Straight => *grip_from_site,
            Jaws::Exchanged => DAffine2::from_scale(DVec2::new(1.0, -1.0)) * *grip_from_site,
        };
        let under = |side: usize| -> Vec<Piece> {
            let pieces = self.pieces[side].iter();
            pieces
                .flat_map(|piece| {
                    let polygons = cut(piece, rings[side]);
                    polygons.into_iter().map(|polygon| moved(&polygon, &piece.gap, &map))
                })
                .collect()
        };
        let (face_i, face_ii) = match jaws {
            Jaws::Straight => (under(0), under(1)),
            Jaws::Exchanged => (under(1), under(0)),
        };
        let layer = (self.layer.thickness > 0.0).then_some(self.layer.thickness);
        Surfaces { face_i, face_ii, stiffness: [self.layer.stiffness; 2], layer }
    }

    /// What pads with the outlines `rings` (turned by `angle`, about the grip origin) touch at
    /// `place`, in the grip frame, and what of it is pressed without a load.
    pub(in crate::propose) fn touched(
        &self,
        rings: [&[DVec2]; 2],
        place: DVec2,
        angle: f64,
        jaws: Jaws,
    ) -> Surfaces {
        let rings = rings.map(|ring| moved_ring(ring, place));
        let map = DAffine2::from_angle(-angle) * DAffine2::from_translation(-place);
        self.under([&rings[0], &rings[1]], &map, jaws)
    }

    /// The outlines of what is pressed without a load of surfaces [`touched`](Self::touched); empty
    /// where nothing is.
    pub(in crate::propose) fn outlines(&self, surfaces: &Surfaces, jaws: Jaws) -> Contact {
        let near = match jaws {
            Jaws::Straight => self.deltas,
            Jaws::Exchanged => [self.deltas[1], self.deltas[0]],
        };
        let whole = |pieces: &[Piece], stiffness: f64| match pieces {
            [piece] => spot(piece, stiffness, self.force),
            _ => None,
        };
        let [k_i, k_ii] = surfaces.stiffness;
        let whole = (whole(&surfaces.face_i, k_i), whole(&surfaces.face_ii, k_ii));
        let deltas = match whole {
            (Some(one), Some(two)) => Some([one, two]),
            _ => Pads::new(surfaces).ok().and_then(|pads| pads.compressions(self.force, near)),
        };
        let Some([one, two]) = deltas else { return Contact::default() };
        let outline = |pieces: &[Piece], delta: f64| -> Patch {
            pieces.iter().flat_map(|piece| pressed(piece, delta)).collect()
        };
        Contact { face_i: outline(&surfaces.face_i, one), face_ii: outline(&surfaces.face_ii, two) }
    }

    /// Directions of the crests, in the site's `(x, y)`.
    fn crests(&self) -> impl Iterator<Item = DVec2> + '_ {
        self.pieces.iter().flatten().filter_map(|piece| match piece.gap {
            Gap::Cylinder { axis, .. } | Gap::Barrel { axis, .. } | Gap::Cone { axis, .. } => {
                Some(axis)
            }
            Gap::Plane { .. } | Gap::Sphere { .. } => None,
        })
    }

    /// Whether an edge of what is pressed is no edge of the part: along a crest.
    pub(super) fn runs_along(&self, edge: &Edge) -> bool {
        self.crests().any(|axis| edge.normal.dot(axis).abs() < 0.5 * axis.length())
    }

    /// Approach angles: along and across a crest; about a point all round; and towards the middle
    /// of the cone asked for (its axis in the site's frame).
    pub(super) fn angles(&self, options: &ProposeOptions, cone: Option<DVec3>) -> Vec<f64> {
        let turn = std::f64::consts::TAU;
        let (first, count) = match self.crests().next() {
            Some(axis) => {
                let first = axis.to_angle().rem_euclid(turn / 4.0);
                // Rounding must not move it to the other end of the interval.
                (if first > turn / 4.0 - 1e-6 { 0.0 } else { first }, 4)
            }
            None => {
                let step = options.angle_step.max(POINT_STEP);
                (0.0, (turn / step).round().max(1.0) as usize)
            }
        };
        let step = turn / count as f64;
        let mut angles: Vec<f64> = (0..count).map(|index| first + step * index as f64).collect();
        if let Some(towards) = cone.and_then(|axis| axis.truncate().try_normalize()) {
            let angle = towards.to_angle().rem_euclid(turn);
            let near = |known: &f64| {
                let apart = (angle - known).rem_euclid(turn);
                apart.min(turn - apart) < 2e-3
            };
            if !angles.iter().any(near) {
                angles.push(angle);
            }
        }
        angles
    }
}

fn moved_ring(ring: &[DVec2], by: DVec2) -> Ring {
    ring.iter().map(|&point| point + by).collect()
}

fn moved(polygon: &Polygon, gap: &Gap, map: &DAffine2) -> Piece {
    let Polygon { outer, holes } = polygon::transform(polygon, map);
    Piece { outer, holes, gap: mapped(gap, map) }
}

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
}

/// A box around a piece of surface: across the closing direction, and along it.
#[derive(Debug, Clone, Copy)]
struct Span {
    across: Bounds2,
    along: [f64; 2],
}

impl Span {
    fn of(points: impl Iterator<Item = DVec3>) -> Self {
        let none = Self { across: Bounds2::EMPTY, along: [f64::INFINITY, f64::NEG_INFINITY] };
        points.fold(none, |Self { across, along: [low, high] }, point| {
            let at = point.truncate();
            Self {
                across: across.union(Bounds2 { min: at, max: at }),
                along: [low.min(point.z), high.max(point.z)],
            }
        })
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
            let outlines = face.polygons.iter().flat_map(|polygon| &polygon.outer);
            Span::of(outlines.map(|at| axes_from_part * face.part_from_face.point(at.extend(0.0))))
        };
        let span = |face: &CurvedFace| Span::of(face.triangles.iter().flat_map(corners));
        let (planes, curved) =
            (part.faces.iter().map(plane).collect(), curved().map(span).collect());
        let loose = loose.iter().map(|id| (Span::of(corners(id).into_iter()), *id)).collect();
        Self { part, axes_from_part, points, planes, curved, is_left_out, loose }
    }

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
        look.outline(triangles, window, gap, &mut pieces);
        pieces
    }
}

/// Whether a face is of free form.
pub(super) fn is_free(face: &CurvedFace) -> bool {
    face.shape == Shape::Freeform
}

/// Corners of a triangle in the axes; `points`: all of the part's, or none.
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
        for triangle in facets {
            self.facet(triangle, &mut pieces);
        }
        pieces.retain(|piece| largest(piece) > -self.above);
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

    fn facet(&self, triangle: u32, pieces: &mut Vec<Piece>) {
        let corners = self.survey.corners(triangle);
        let [a, b, c] = corners;
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { return };
        let nearest = corners
            .iter()
            .map(|corner| self.side * (self.height - corner.z))
            .fold(f64::INFINITY, f64::min);
        let mut outer: Ring = corners.map(DVec3::truncate).to_vec();
        if nearest > self.reach || !Bounds2::of(&outer).meets(self.region) {
            return;
        }
        let Some((height, slope)) = self.plane_gap(a, normal) else { return };
        if self.side < 0.0 {
            outer.reverse();
        }
        pieces.push(Piece { outer, holes: Vec::new(), gap: Gap::Plane { height, slope } });
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
                self.outline(&face.triangles, &window, gap, pieces);
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
                    self.outline(&face.triangles, &window, gap, pieces);
                }
                true
            }
            Shape::Sphere { centre, radius } if face.outside => {
                let centre = place(centre);
                let height = height(centre, radius);
                if height < self.reach {
                    let at = centre.truncate();
                    let window = ellipse(at, DVec2::X, [half(radius, height); 2]);
                    self.outline(
                        &face.triangles,
                        &window,
                        Gap::Sphere { radius, at, height },
                        pieces,
                    );
                }
                true
            }
            Shape::Torus { axis, major, minor } if face.outside => {
                let Some(direction) = level(axis.direction) else { return false };
                let centre = place(axis.origin);
                let radius = major + minor;
                let height = height(centre, radius);
                if height < self.reach {
                    let at = centre.truncate();
                    let window =
                        ellipse(at, direction, [half(minor, height), half(radius, height)]);
                    let gap = Gap::Barrel { radius, meridian: minor, axis: direction, at, height };
                    self.outline(&face.triangles, &window, gap, pieces);
                }
                true
            }
            _ => false,
        }
    }

    /// The part of some triangles within a window.
    fn outline(&self, triangles: &[u32], window: &[DVec2], gap: Gap, pieces: &mut Vec<Piece>) {
        let within = Bounds2::of(window);
        if !within.meets(self.region) {
            return;
        }
        let mut rings: Vec<Ring> = Vec::new();
        for &triangle in triangles {
            let corners = self.survey.corners(triangle);
            let [a, b, c] = corners;
            if (b - a).cross(c - a).z * self.side <= 0.0 {
                continue;
            }
            let ring = corners.map(DVec3::truncate);
            if Bounds2::of(&ring).meets(within) {
                rings.push(ring.to_vec());
            }
        }
        for Polygon { outer, holes } in intersect_convex(window, &even_odd(&rings)) {
            pieces.push(Piece { outer, holes, gap });
        }
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
    let step = std::f64::consts::TAU / WINDOW as f64;
    let corner = |index: usize| {
        let e = DVec2::from_angle(step * index as f64) / (0.5 * step).cos();
        at + half[0] * e.x * axis + half[1] * e.y * axis.perp()
    };
    (0..WINDOW).map(corner).collect()
}

//! Surfaces that lean against flat pads: opposite planes that are not parallel, cones, and bores,
//! straight or tapered, whose walls curve towards a pad.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rustc_hash::FxHashSet;

use super::shapes::project;
use super::{Finder, axes};
use crate::geometry::overlay;
use crate::geometry::polygon::{self, Bounds2};
use crate::gripper::Gripper;
use crate::model::Gap;
use crate::part::{ANTIPARALLEL, CurvedFace, PairKind, Part, PlanarFace, Shape};
use crate::propose::options::ProposeOptions;

/// Angle of either surface to the pads up to which two are opposite each other \[rad\].
pub(super) const STEEPEST: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Half width of a pad over the radius of a bore up to which it may go in: as for the half width of
/// a contact, the flat formula is 1.6 % off there.
pub(super) const WIDEST: f64 = 0.4;
/// Pairs of planes looked at, the largest ones.
const MOST_PAIRS: usize = 200;
/// Overlap of two leaning planes over the area of a pad, or of the part's largest plane if that is
/// smaller, from which on they are tried. Flanks of teeth and strips of freely curved surfaces have
/// 1 to 3 %, drafted walls more than 20 %.
const LEAST_OVERLAP: f64 = 0.1;
/// Area of a plane over the smallest side of the part's box below which it says nothing of how large the
/// part's walls are: noise has broken them.
const LEAST_PLANE: f64 = 0.05;
/// Planes that are looked at only to count what is too small.
const MOST_COUNTED: usize = 3000;

/// What leans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Surface {
    Plane,
    Cone,
    Bore,
    TaperedBore,
}

impl Surface {
    /// Whether the walls curve towards the pads, which touch with their edges.
    pub(super) fn is_hollow(self) -> bool {
        matches!(self, Surface::Bore | Surface::TaperedBore)
    }
}

/// Two surfaces opposite each other that do not lie in the pads' planes. Places are `(x, y)` along
/// the rows and up the slope, to where a pad touches first.
#[derive(Debug)]
pub(super) struct Taper {
    pub(super) kind: PairKind,
    pub(super) surface: Surface,
    /// Index of the closing direction.
    pub(super) direction: usize,
    pub(super) sides: [Vec<u32>; 2],
    /// Unit vector along `y` in the direction's axes.
    pub(super) uphill: DVec2,
    /// Rise of side I along `y`; side II falls as much.
    pub(super) slope: f64,
    /// Heights of both at `y = 0`.
    pub(super) heights: [f64; 2],
    /// Where both are.
    pub(super) bounds: Bounds2,
    /// How far the chords of a mesh stand out from the surface that they are meant for.
    pub(super) chords: f64,
}

impl Taper {
    /// Unit vector along the rows.
    pub(super) fn level(&self) -> DVec2 {
        -self.uphill.perp()
    }

    pub(super) fn heights_at(&self, y: f64) -> [f64; 2] {
        let [one, two] = self.heights;
        [one + self.slope * y, two - self.slope * y]
    }

    /// Gap of either side behind planes that touch it at `top` or, in a bore, at its crest, seen
    /// from `y`.
    pub(super) fn gap(&self, y: f64, top: f64, lean: f64) -> Gap {
        let [one, two] = self.heights_at(top);
        let (radius, height) = (0.5 * (one - two).abs(), lean * self.slope * (top - y));
        match self.surface {
            Surface::Plane => Gap::Plane { height, slope: DVec2::new(0.0, -lean * self.slope) },
            Surface::Bore | Surface::TaperedBore if lean == 0.0 => Gap::default(),
            Surface::Cone | Surface::TaperedBore => Gap::Cone {
                radius: if self.surface.is_hollow() { -radius } else { radius },
                slope: -lean * self.slope,
                axis: DVec2::Y,
                at: DVec2::ZERO,
                height,
            },
            Surface::Bore => {
                Gap::Cylinder { radius: -radius, axis: DVec2::X, at: DVec2::ZERO, height: 0.0 }
            }
        }
    }

    /// Angle of either side to the pads \[rad\].
    pub(super) fn angle(&self) -> f64 {
        self.slope.atan()
    }
}

/// A disc about a face.
struct Disc {
    middle: DVec3,
    radius: f64,
}

impl Disc {
    fn about(face: &PlanarFace) -> Self {
        let middle = face.centroid;
        let corners = face.polygons.iter().flat_map(|polygon| &polygon.outer);
        let radius = corners
            .map(|corner| face.part_from_face.point(corner.extend(0.0)).distance(middle))
            .fold(0.0, f64::max);
        Self { middle, radius }
    }

    /// Whether both can meet when moved along `way`.
    fn meets(&self, other: &Self, way: DVec3) -> bool {
        let between = other.middle - self.middle;
        let reach = self.radius + other.radius;
        between.cross(way).length_squared() <= reach * reach * way.length_squared()
    }
}

/// Overlap of leaning planes below which they are none for pads [m^2]; any that is asked for by its number
/// will do.
pub(super) fn smallest(part: &Part, gripper: &Gripper, options: &ProposeOptions) -> f64 {
    if options.faces.is_some() {
        return 0.0;
    }
    let planes = part.faces.iter().filter(|face| face.reachable);
    let (low, high) = part.mesh.bounding_box();
    let size = high - low;
    let side = size.element_product() / size.max_element();
    let largest = planes.map(|face| face.area).fold(LEAST_PLANE * side, f64::max);
    let pads = gripper.pad_sizes().map(DVec2::element_product);
    LEAST_OVERLAP * largest.min(pads[0]).min(pads[1])
}

impl Finder<'_> {
    /// Pairs of planes that are opposite each other and not parallel; and how many were too small.
    pub(super) fn drafted(&mut self) -> (Vec<Taper>, u64) {
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
        let floor = self.smallest;
        let mut areas: BTreeMap<usize, f64> = BTreeMap::new();
        for face in &faces {
            *areas.entry(self.planes.of[face.id as usize]).or_default() += face.area;
        }
        let plane = |face: &PlanarFace| self.planes.of[face.id as usize];
        let is_large = |face: &&PlanarFace| areas[&plane(face)] >= floor;
        let (large, small): (Vec<&PlanarFace>, Vec<&PlanarFace>) =
            faces.into_iter().partition(is_large);
        let leans =
            |a: &PlanarFace, b: &PlanarFace| (least..most).contains(&-a.normal.dot(b.normal));
        let planes = |[a, b]: [&PlanarFace; 2]| {
            let [one, two] = [plane(a), plane(b)];
            (one.min(two), one.max(two))
        };
        let large: Vec<(&PlanarFace, Disc)> =
            large.into_iter().map(|face| (face, Disc::about(face))).collect();
        let leaning = || {
            large.iter().enumerate().flat_map(|(index, a)| {
                large[index + 1..].iter().filter(|b| leans(a.0, b.0)).map(move |b| [a, b])
            })
        };
        // Of tens of thousands of facets many millions lean, and hardly any two meet.
        let meeting: FxHashSet<(usize, usize)> = leaning()
            .filter(|[a, b]| a.1.meets(&b.1, a.0.normal - b.0.normal))
            .map(|[a, b]| planes([a.0, b.0]))
            .collect();
        let mut groups: BTreeMap<(usize, usize), Vec<[&PlanarFace; 2]>> = BTreeMap::new();
        let mut too_small = 0;
        for [(a, _), (b, _)] in leaning() {
            if meeting.contains(&planes([a, b])) {
                groups.entry(planes([a, b])).or_default().push([a, b]);
            }
        }
        // Told as far as it can be counted in no time.
        for (index, a) in small.iter().enumerate().take(MOST_COUNTED) {
            let others =
                large.iter().map(|(face, _)| face).chain(&small[index + 1..]).take(MOST_COUNTED);
            too_small += others.filter(|b| leans(a, b)).count() as u64;
        }
        let mut found: Vec<(f64, Taper)> = Vec::new();
        for pairs in groups.values() {
            let most: f64 = pairs.iter().map(|[a, b]| a.area.min(b.area)).sum();
            if most < floor {
                too_small += 1;
                continue;
            }
            match self.wedge(pairs) {
                Some((area, taper)) if area >= floor => found.push((area, taper)),
                Some(_) => too_small += 1,
                None => {}
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.sides.cmp(&b.1.sides)));
        (found.into_iter().take(MOST_PAIRS).map(|(_, taper)| taper).collect(), too_small)
    }

    /// Pairs in two planes as one, and the area in which they are opposite each other [m^2].
    pub(super) fn wedge(&mut self, pairs: &[[&PlanarFace; 2]]) -> Option<(f64, Taper)> {
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

    /// Cones, in directions all round: from outside, or tapered bores from inside.
    pub(super) fn cones(&mut self, kind: PairKind, tapers: &mut Vec<Taper>) {
        let part = self.part;
        let outside = kind == PairKind::External;
        for face in part.curved.iter().filter(|face| face.outside == outside && face.reachable) {
            let Shape::Cone { apex, axis, half_angle, along } = face.shape else { continue };
            if !self.may_touch(face.id) {
                continue;
            }
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
                // Uphill is where a body grows thicker, and a bore narrower.
                let widening = (axes_from_part * axis).truncate().normalize();
                let sense = if outside { 1.0 } else { -1.0 };
                let uphill = sense * widening;
                let (slope, y) = (half_angle.tan(), uphill.dot(apex.truncate()));
                let x = (-uphill.perp()).dot(apex.truncate());
                let ends = along.map(|along| DVec2::new(x, y + sense * along));
                let chords = match face.facets {
                    Some(facets) if !outside => {
                        along[1] * slope * (1.0 - (std::f64::consts::PI / facets).cos())
                    }
                    _ => 0.0,
                };
                tapers.push(Taper {
                    kind,
                    surface: if outside { Surface::Cone } else { Surface::TaperedBore },
                    direction,
                    sides: [vec![face.id], vec![face.id]],
                    uphill,
                    slope,
                    heights: [apex.z - slope * y, apex.z + slope * y],
                    bounds: Bounds2 { min: ends[0].min(ends[1]), max: ends[0].max(ends[1]) },
                    chords,
                });
            }
        }
    }

    /// Bores from inside, in directions all round.
    pub(super) fn bores(&mut self, tapers: &mut Vec<Taper>) {
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
}

/// Of two opposite directions the one with its greatest component positive.
pub(super) fn upright(direction: DVec3) -> DVec3 {
    if direction[direction.abs().max_position()] < 0.0 { -direction } else { direction }
}

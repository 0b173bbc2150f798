//! Contacts as they are: pieces of surface under a pad, each with its gap above the pad plane.

use std::sync::LazyLock;

use glam::{DAffine2, DMat2, DVec2};

use super::quadric::{Quadratic, Region, area_and_load};
use crate::geometry::{
    Bounds2, clip_convex, clip_ring_convex, intersect_convex, is_convex, is_within, ring_area,
    transform, within_window,
};
use crate::model::{Patch, Polygon, Ring};

pub use crate::model::{Gap, Piece, Surfaces};

/// The gap as seen after the motion `map` of the pad plane, a turn, shift or mirror image. A point
/// of a crest is the one nearest to the new origin.
pub(crate) fn mapped(gap: &Gap, map: &DAffine2) -> Gap {
    let turn: DMat2 = map.matrix2;
    match *gap {
        Gap::Plane { height, slope } => {
            let slope = turn * slope;
            Gap::Plane { height: height - slope.dot(map.translation), slope }
        }
        Gap::Cylinder { radius, axis, at, height } => {
            let (axis, at) = (turn * axis, map.transform_point2(at));
            let at = at - axis * (axis.dot(at) / axis.length_squared());
            Gap::Cylinder { radius, axis, at, height }
        }
        Gap::Sphere { radius, at, height } => {
            Gap::Sphere { radius, at: map.transform_point2(at), height }
        }
        Gap::Barrel { radius, meridian, axis, at, height } => Gap::Barrel {
            radius,
            meridian,
            axis: turn * axis,
            at: map.transform_point2(at),
            height,
        },
        Gap::Cone { radius, slope, axis, at, height } => {
            Gap::Cone { radius, slope, axis: turn * axis, at: map.transform_point2(at), height }
        }
    }
}

/// A piece made ready: in the surface's own axes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Field {
    /// Origin of the surface's axes in the pad plane.
    pub(crate) origin: DVec2,
    /// Their first axis.
    pub(crate) axis: DVec2,
    pub(crate) rings: Vec<Ring>,
    /// The gap in these axes.
    pub(crate) gap: Quadratic,
}

/// Extent of a polygon over the radius up to which it is plane: it rises by 13 um over a metre.
const NEARLY_PLANE: f64 = 1e-4;

/// The gap without the curvatures that do not show over the polygon. A tilt rolls a curve on its pad
/// and presses a plane: a radius that only rounding tells from none must not decide.
fn flattened(mut gap: Quadratic, rings: &[Ring]) -> Quadratic {
    for axis in 0..2 {
        let places = || rings.iter().flatten().map(|x| x[axis]);
        let low = places().fold(f64::INFINITY, f64::min);
        let high = places().fold(f64::NEG_INFINITY, f64::max);
        let (bend, middle) = (gap.l[axis], 0.5 * (low + high));
        if bend != 0.0 && (bend * (high - low)).abs() < NEARLY_PLANE {
            gap.c -= 0.5 * bend * middle * middle;
            gap.g[axis] += bend * middle;
            gap.l[axis] = 0.0;
        }
    }
    gap
}

impl Field {
    pub(crate) fn new(piece: &Piece) -> Self {
        let middle = piece.outer.iter().sum::<DVec2>() / piece.outer.len().max(1) as f64;
        let round =
            |l1: f64, l2: f64, c: f64| Quadratic { c, g: DVec2::ZERO, l: DVec2::new(l1, l2) };
        let (origin, axis, gap) = match piece.gap {
            Gap::Plane { height, slope } => (
                middle,
                DVec2::X,
                Quadratic { c: height + slope.dot(middle), g: slope, l: DVec2::ZERO },
            ),
            Gap::Cylinder { radius, axis, at, height } => {
                (at, axis, round(0.0, radius.recip(), height))
            }
            Gap::Sphere { radius, at, height } => {
                (at, DVec2::X, round(radius.recip(), radius.recip(), height))
            }
            Gap::Barrel { radius, meridian, axis, at, height } => {
                (at, axis, round(meridian.recip(), radius.recip(), height))
            }
            Gap::Cone { radius, slope, axis, at, height } => {
                let gap = round(0.0, radius.recip(), height);
                (at, axis, Quadratic { g: DVec2::new(slope, 0.0), ..gap })
            }
        };
        let axis = axis.normalize();
        // Along the axis of a cylinder any origin serves: the nearest to the polygon; so on a cone,
        // by the slope.
        let along = match piece.gap {
            Gap::Cylinder { .. } | Gap::Cone { .. } => axis.dot(middle - origin),
            _ => 0.0,
        };
        let origin = origin + axis * along;
        let gap = Quadratic { c: gap.c + gap.g.x * along, ..gap };
        let mut rings = Vec::new();
        for (ring, sense) in
            std::iter::once((&piece.outer, 1.0)).chain(piece.holes.iter().map(|hole| (hole, -1.0)))
        {
            if ring.len() < 3 {
                continue;
            }
            let mut local: Ring = ring
                .iter()
                .map(|x| DVec2::new(axis.dot(*x - origin), axis.perp_dot(*x - origin)))
                .collect();
            let area: f64 = (1..local.len() - 1)
                .map(|i| (local[i] - local[0]).perp_dot(local[i + 1] - local[0]))
                .sum();
            if area * sense < 0.0 {
                local.reverse();
            }
            rings.push(local);
        }
        let gap = flattened(gap, &rings);
        Self { origin, axis, rings, gap }
    }

    /// A vector of the pad plane in the surface's axes.
    pub(crate) fn inward(&self, x: DVec2) -> DVec2 {
        DVec2::new(self.axis.dot(x), self.axis.perp_dot(x))
    }

    /// A vector in the surface's axes in the pad plane.
    pub(crate) fn outward(&self, x: DVec2) -> DVec2 {
        x.x * self.axis + x.y * self.axis.perp()
    }

    /// Slope of the gap at a place of the surface's axes, in the pad plane.
    pub(crate) fn slope(&self, x: DVec2) -> DVec2 {
        self.outward(self.gap.slope(x))
    }

    /// What a pressure carries from its integrals over `1`, `x1`, `x2` and `x x grad gap` in the
    /// surface's axes: force, `int p x`, `int p grad gap` and the moment of the push against the
    /// slope, in the pad plane.
    pub(crate) fn carried(&self, [load, one, two, turn]: &[f64; 4]) -> [f64; 6] {
        let (load, first) = (*load, DVec2::new(*one, *two));
        let slope = self.outward(self.gap.g * load + self.gap.l * first);
        let first = self.origin * load + self.outward(first);
        [load, first.x, first.y, slope.x, slope.y, -self.origin.perp_dot(slope) - turn]
    }

    /// The part of a tilt, in the pad plane, that turns the surface and not only rolls it: none
    /// across a curve.
    pub(crate) fn felt(&self, tilt: DVec2) -> DVec2 {
        let tilt = self.inward(tilt);
        let along = |l: f64, t: f64| if l == 0.0 { t } else { 0.0 };
        self.outward(DVec2::new(along(self.gap.l.x, tilt.x), along(self.gap.l.y, tilt.y)))
    }

    /// How the highest line or point of a surface moves on it when it rolls by a tilt, in the pad plane
    /// \[m\]: by its radius times the part of the tilt across a curve.
    pub(crate) fn rolled(&self, tilt: DVec2) -> DVec2 {
        let tilt = self.inward(tilt);
        let across = |l: f64, t: f64| if l == 0.0 { 0.0 } else { t / l };
        self.outward(DVec2::new(across(self.gap.l.x, tilt.x), across(self.gap.l.y, tilt.y)))
    }

    /// The part with compression `u = delta - gap + tilt . x > 0`. On a curve the tilt acts where
    /// the surface is highest; that the contact rolls away from there is left out.
    pub(crate) fn pressed(&self, delta: f64, tilt: DVec2) -> Region {
        Region::new(&self.rings, self.compression(delta, tilt))
    }

    /// Area of that part, and the integral of the compression over it.
    pub(crate) fn area_and_load(&self, delta: f64, tilt: DVec2) -> (f64, f64) {
        area_and_load(&self.rings, &self.compression(delta, tilt))
    }

    fn compression(&self, delta: f64, tilt: DVec2) -> Quadratic {
        Quadratic {
            c: delta + tilt.dot(self.origin) - self.gap.c,
            g: self.inward(self.felt(tilt)) - self.gap.g,
            l: -self.gap.l,
        }
    }

    /// Greatest compression without tilt at one of the pad's plane \[m\].
    pub(crate) fn greatest(&self, delta: f64) -> f64 {
        self.compression(delta, DVec2::ZERO).greatest(&self.rings)
    }

    /// Smallest gap less tilt over the polygon's corners and the axes' origin: about where contact
    /// begins.
    pub(crate) fn nearest(&self, tilt: DVec2) -> f64 {
        let felt = self.felt(tilt);
        let value =
            |x: DVec2| self.gap.value(x) - tilt.dot(self.origin) - felt.dot(self.outward(x));
        let corners = self.rings.iter().flatten().map(|x| value(*x));
        corners.fold(value(DVec2::ZERO), f64::min)
    }

    /// Slopes of the gap at the polygon's corners, in the pad plane: the steepest is among them.
    pub(crate) fn slopes(&self) -> impl Iterator<Item = DVec2> {
        self.rings.iter().flatten().map(|x| self.slope(*x))
    }

    /// Corners of the polygon in the pad plane.
    pub(crate) fn corners(&self) -> impl Iterator<Item = DVec2> {
        self.rings.iter().flatten().map(|x| self.origin + self.outward(*x))
    }

    /// Area of the polygon [m^2].
    pub(crate) fn area(&self) -> f64 {
        let ring_area = |ring: &Ring| -> f64 {
            (1..ring.len() - 1)
                .map(|i| 0.5 * (ring[i] - ring[0]).perp_dot(ring[i + 1] - ring[0]))
                .sum()
        };
        self.rings.iter().map(ring_area).sum()
    }
}

/// The surfaces seen after half a turn about `x1`, which exchanges the faces.
pub(crate) fn mirrored(surfaces: &Surfaces) -> Surfaces {
    let map = DAffine2::from_scale(DVec2::new(1.0, -1.0));
    let pieces = |pieces: &[Piece]| -> Vec<Piece> {
        pieces
            .iter()
            .map(|piece| {
                let Polygon { outer, holes } = transform(&piece.polygon(), &map);
                Piece { outer, holes, gap: mapped(&piece.gap, &map) }
            })
            .collect()
    };
    let [one, two] = surfaces.stiffness;
    Surfaces {
        face_i: pieces(&surfaces.face_ii),
        face_ii: pieces(&surfaces.face_i),
        stiffness: [two, one],
        layer: surfaces.layer,
    }
}

/// The numbers of a gap, of equal gaps the same.
pub(crate) fn numbers(gap: &Gap) -> [f64; 8] {
    let (kind, a, b, axis, at, height) = match *gap {
        Gap::Plane { height, slope } => (0.0, 0.0, 0.0, slope, DVec2::ZERO, height),
        Gap::Cylinder { radius, axis, at, height } => (1.0, radius, 0.0, axis, at, height),
        Gap::Sphere { radius, at, height } => (2.0, radius, 0.0, DVec2::ZERO, at, height),
        Gap::Barrel { radius, meridian, axis, at, height } => {
            (3.0, radius, meridian, axis, at, height)
        }
        Gap::Cone { radius, slope, axis, at, height } => (4.0, radius, slope, axis, at, height),
    };
    [kind, a, b, axis.x, axis.y, at.x, at.y, height]
}

/// A whole ellipse about the crest of one piece: all that is pressed of a pad's pieces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    /// Compression at the pad plane \[m\].
    pub(crate) delta: f64,
    at: DVec2,
    /// Its first axis.
    axis: DVec2,
    half: [f64; 2],
}

impl Spot {
    /// What a force \[N\] presses on a layer of this stiffness [Pa/m]: `N = pi k sqrt(R_1 R_2) (delta -
    /// h)^2`. `None` where it is another shape, the outline cuts it or another piece is pressed as well.
    pub(crate) fn of(pieces: &[Piece], stiffness: f64, force: f64) -> Option<Self> {
        let is_round =
            |piece: &&Piece| matches!(piece.gap, Gap::Sphere { .. } | Gap::Barrel { .. });
        let round = pieces.iter().find(is_round)?;
        let spot = whole_spot(round, stiffness, force)?;
        let is_clear = |piece: &Piece| std::ptr::eq(piece, round) || is_behind(piece, spot.delta);
        pieces.iter().all(is_clear).then_some(spot)
    }

    /// Its outline, as [`pressed`] has it.
    pub(crate) fn outline(&self) -> Polygon {
        let mut outer = ellipse(self.at, self.axis, self.half).to_vec();
        begin(&mut outer);
        Polygon { outer, holes: Vec::new() }
    }
}

/// Whether a piece is a plane that a layer compressed by `delta` does not reach.
pub(crate) fn is_behind(piece: &Piece, delta: f64) -> bool {
    match piece.gap {
        Gap::Plane { height, slope } => piece.outer.iter().all(|x| height + slope.dot(*x) >= delta),
        _ => false,
    }
}

fn whole_spot(piece: &Piece, stiffness: f64, force: f64) -> Option<Spot> {
    let (radii, axis, at, height) = match piece.gap {
        Gap::Sphere { radius, at, height } => ([radius; 2], DVec2::X, at, height),
        Gap::Barrel { radius, meridian, axis, at, height } => {
            ([meridian, radius], axis.normalize(), at, height)
        }
        _ => return None,
    };
    if !piece.holes.is_empty() || radii.iter().any(|radius| *radius <= 0.0) {
        return None;
    }
    let deep = (force / (std::f64::consts::PI * stiffness * (radii[0] * radii[1]).sqrt())).sqrt();
    let half = radii.map(|radius| (2.0 * radius * deep).sqrt());
    // In units of the half axes the ellipse is the circle of radius one, its polygon a little more.
    let place = |x: DVec2| {
        let way = x - at;
        DVec2::new(axis.dot(way) / half[0], axis.perp_dot(way) / half[1])
    };
    let outer = CIRCLE[0].length_squared();
    // How often the outline goes round it: passes of the negative first axis.
    let mut turns = 0;
    let mut from = place(*piece.outer.last()?);
    for corner in &piece.outer {
        let to = place(*corner);
        let edge = to - from;
        let along =
            (-from.dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        if (from + along * edge).length_squared() < outer {
            return None;
        }
        let turn = from.perp_dot(to);
        turns += i32::from(from.y >= 0.0 && to.y < 0.0 && turn > 0.0);
        turns -= i32::from(from.y < 0.0 && to.y >= 0.0 && turn < 0.0);
        from = to;
    }
    (turns != 0).then_some(Spot { delta: height + deep, at, axis, half })
}

/// Sides of the polygon in place of an ellipse, of equal area.
const SIDES: usize = 48;
/// Its corners, of a circle of radius one: a little outside of it.
static CIRCLE: LazyLock<[DVec2; SIDES]> = LazyLock::new(|| {
    let step = std::f64::consts::TAU / SIDES as f64;
    let grown = (step / step.sin()).sqrt();
    std::array::from_fn(|k| grown * DVec2::from_angle(step * k as f64))
});

fn ellipse(at: DVec2, axis: DVec2, half: [f64; 2]) -> [DVec2; SIDES] {
    CIRCLE.each_ref().map(|e| at + half[0] * e.x * axis + half[1] * e.y * axis.perp())
}

/// The part of a piece whose gap is less than `delta`: what a layer compressed so far presses.
/// Ellipses are polygons of the same area, so that this is for pictures and first estimates.
pub(crate) fn pressed(piece: &Piece, delta: f64) -> Patch {
    let bounds = Bounds2::of(&piece.outer);
    let size = bounds.size().length();
    if size.is_nan() || size <= 0.0 {
        return Patch::new();
    }
    let middle = bounds.centre();
    let along = |axis: DVec2, at: DVec2, low: f64, high: f64| -> [DVec2; 4] {
        // A stretch across `axis` through `at`, as long as the piece.
        let at = at + axis * axis.dot(middle - at);
        let corner = |x: f64, y: f64| at + size * x * axis + y * axis.perp();
        [corner(-1.0, low), corner(1.0, low), corner(1.0, high), corner(-1.0, high)]
    };
    let mut patch = Patch::new();
    let shape = Shape::of(piece);
    let mut within =
        |window: &[DVec2]| shape.cut(piece, window, &mut |polygon| patch.push(polygon));
    match piece.gap {
        Gap::Plane { height, slope } if slope == DVec2::ZERO => {
            return if height < delta { vec![piece.polygon()] } else { Patch::new() };
        }
        Gap::Plane { height, slope } => {
            // How far uphill of the middle the gap is `delta`.
            let left = (delta - height - slope.dot(middle)) / slope.length();
            if left <= -size {
                return Patch::new();
            }
            within(&along(slope.normalize().perp(), middle, -left.min(size), size));
        }
        Gap::Cylinder { radius, axis, at, height } => {
            let half = (2.0 * radius * (delta - height)).max(0.0).sqrt();
            let axis = axis.normalize();
            match radius > 0.0 {
                true if height < delta => within(&along(axis, at, -half, half)),
                true => return Patch::new(),
                false if height < delta => return vec![piece.polygon()],
                false => {
                    let far = half + 2.0 * size + at.distance(middle);
                    within(&along(axis, at, half, far));
                    within(&along(axis, at, -far, -half));
                }
            }
        }
        Gap::Sphere { at, height, .. } | Gap::Barrel { at, height, .. } => {
            let (radii, axis) = match piece.gap {
                Gap::Barrel { radius, meridian, axis, .. } => ([meridian, radius], axis),
                _ => ([piece.gap.radius().unwrap_or(1.0); 2], DVec2::X),
            };
            if radii.iter().any(|radius| *radius < 0.0) {
                return hollow(piece, delta);
            }
            if height >= delta {
                return Patch::new();
            }
            let half = radii.map(|radius| (2.0 * radius * (delta - height)).sqrt());
            within(&ellipse(at, axis.normalize(), half));
        }
        Gap::Cone { radius, slope, axis, at, height } => {
            if slope == 0.0 {
                let gap = Gap::Cylinder { radius, axis, at, height };
                return pressed(&Piece { gap, ..piece.clone() }, delta);
            }
            if radius < 0.0 {
                return hollow(piece, delta);
            }
            // Uphill of a parabola whose top lies where the crest's gap is `delta`.
            let downhill = axis.normalize() * slope.signum();
            let top = at + downhill * ((delta - height) / slope.abs());
            let deep = downhill.dot(top - middle) + size;
            if deep <= 0.0 {
                return Patch::new();
            }
            let half = (2.0 * radius * slope.abs() * deep).sqrt();
            let corner = |k: usize| {
                let y = half * (2.0 * k as f64 / SIDES as f64 - 1.0);
                top - downhill * (deep * (y / half).powi(2)) + downhill.perp() * y
            };
            within(&std::array::from_fn::<_, { SIDES + 1 }, _>(corner));
        }
    }
    patch
}

/// All of a hollow piece, unless it lies behind what a layer compressed by `delta` presses.
fn hollow(piece: &Piece, delta: f64) -> Patch {
    let reached = Field::new(piece).nearest(DVec2::ZERO) < delta;
    if reached { vec![piece.polygon()] } else { Patch::new() }
}

/// Sides of a window up to which convex rings are clipped by one after the other.
const FEW_SIDES: usize = 8;

/// Lets a ring begin where [`intersect_convex`] would: before its leftmost corner.
fn begin(ring: &mut Ring) {
    // Of two at one place along the first axis but for rounding, the lower one.
    let left = ring.iter().map(|x| x.x).fold(f64::INFINITY, f64::min);
    let same = left + 1e-12 * Bounds2::of(&*ring).size().max_element();
    let leftmost = (0..ring.len())
        .filter(|&index| ring[index].x <= same)
        .min_by(|&a, &b| ring[a].y.total_cmp(&ring[b].y));
    if let Some(leftmost) = leftmost {
        let before = (leftmost + ring.len() - 1) % ring.len();
        ring.rotate_left(before);
    }
}

/// What the outline of a piece that is cut again and again says once and for all.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    bounds: Bounds2,
    is_convex: bool,
}

impl Shape {
    pub(crate) fn of(piece: &Piece) -> Self {
        let is_convex = piece.holes.is_empty() && is_convex(&piece.outer);
        Self { bounds: Bounds2::of(&piece.outer), is_convex }
    }

    /// Gives the parts of its piece's outline within a convex counter-clockwise ring.
    pub(crate) fn cut(&self, piece: &Piece, window: &[DVec2], give: &mut impl FnMut(Polygon)) {
        if !self.bounds.meets(Bounds2::of(window)) {
            return;
        }
        let mut part = |outer: Ring| {
            let size = Bounds2::of(&outer).size().max_element();
            if outer.len() >= 3 && ring_area(&outer) > 1e-9 * size * size {
                give(Polygon { outer, holes: Vec::new() });
            }
        };
        if self.is_convex {
            return part(match window.len() <= FEW_SIDES {
                true => clip_ring_convex(&piece.outer, window),
                false => clip_convex(window, &piece.outer),
            });
        }
        if piece.holes.is_empty() && is_within(self.bounds, window) {
            let mut ring = piece.outer.clone();
            begin(&mut ring);
            return part(ring);
        }
        if piece.holes.is_empty()
            && let Some(rings) = within_window(&piece.outer, window)
        {
            return rings.into_iter().for_each(|mut ring| {
                begin(&mut ring);
                part(ring);
            });
        }
        intersect_convex(window, &[piece.polygon()]).into_iter().for_each(give);
    }
}

/// The outline of a piece within a convex counter-clockwise ring.
pub(crate) fn cut(piece: &Piece, window: &[DVec2]) -> Patch {
    let mut patch = Patch::new();
    Shape::of(piece).cut(piece, window, &mut |polygon| patch.push(polygon));
    patch
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::curved::Pads;

    /// What the solver finds for whole spots; a spot that its outline cuts is none.
    #[test]
    fn a_whole_spot_is_compressed_as_the_equations_say() {
        let (stiffness, force) = (8e10, 150.0);
        let square = |half: f64| -> Ring {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| DVec2::new(0.002 + half * x, -0.001 + half * y))
                .to_vec()
        };
        let at = DVec2::new(0.0025, -0.0005);
        let gaps = [
            Gap::Sphere { radius: 0.02, at, height: 3e-5 },
            Gap::Barrel {
                radius: 0.03,
                meridian: 0.012,
                axis: DVec2::new(0.6, 0.8),
                at,
                height: -2e-5,
            },
        ];
        let piece = |gap: Gap, half: f64| Piece { outer: square(half), holes: Vec::new(), gap };
        for gap in gaps {
            let whole = piece(gap, 0.006);
            let surfaces = Surfaces {
                face_i: vec![whole.clone()],
                face_ii: vec![whole.clone()],
                stiffness: [stiffness; 2],
                layer: None,
            };
            let found = Pads::new(&surfaces).unwrap().squeezed(force).unwrap()[0].delta;
            let spot = |pieces: &[Piece]| Spot::of(pieces, stiffness, force);
            let one = spot(std::slice::from_ref(&whole)).unwrap();
            let delta = one.delta;
            assert!((delta / found - 1.0).abs() < 1e-9, "{delta:e} {found:e}");
            let outline = pressed(&whole, delta);
            let area = |patch: &Polygon| ring_area(&patch.outer);
            assert!((area(&outline[0]) / area(&one.outline()) - 1.0).abs() < 1e-9);
            assert!(spot(&[piece(gap, 0.0011)]).is_none());
            let beside = Piece { outer: square(0.0002), ..whole.clone() };
            assert!(spot(&[beside]).is_none());
            // A plane beside it that the layer does not reach, or does.
            let plane = |height: f64| {
                let gap = Gap::Plane { height, slope: DVec2::ZERO };
                Piece { gap, ..piece(gap, 0.003) }
            };
            assert!(spot(&[plane(1.01 * delta), whole.clone()]).is_some());
            assert!(spot(&[plane(0.99 * delta), whole.clone()]).is_none());
        }
    }
}

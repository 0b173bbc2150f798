//! Places opposite each other: the ends of lines that are normal to two surfaces.
//!
//! From pairs of corners that nearly are, Newton's method on the direction finds the pairs that are: the
//! place at which a surface faces a direction moves by its radii as the direction turns.

use glam::{DMat2, DMat3, DVec2, DVec3};
use rustc_hash::FxHashSet;

use super::Finder;
use super::net::{Facing, Net, Normals, square};
use super::round::MOST_PLANES;
use super::tapers::upright;
use crate::geometry::polygon::outer;
use crate::geometry::principal;
use crate::part::Shape;

/// Corners from which pairs are looked for, spread by area.
const CORNERS: usize = 1_500;
/// Cosine of the angle by which the normals of two corners may miss each other: 12 degrees, more
/// than what such corners of a ball are apart.
const OPPOSITE: f64 = 0.978;
/// How far two corners may lie beside each other across the direction, in widths and reaches of a
/// pad.
const BESIDE: f64 = 0.5;
/// Pairs kept of each corner, the nearest.
const NEAREST: usize = 3;
/// Steps of Newton's method, the longest \[rad\], and the shortest.
const STEPS: u32 = 40;
const LONGEST: f64 = 0.15;
const SHORTEST: f64 = 1e-6;
/// Most steps after which corners take turns again, and how near two directions are one then.
const PERIODS: usize = 4;
const SAME: f64 = 1e-15;
/// A last step this short still is an answer \[rad\]: corners in turn, each with a fit of its own.
const SETTLED: f64 = 3e-3;
/// Share of the width by which the radii of two crests may differ from it for the direction to be
/// open: a part of constant width.
const CONSTANT: f64 = 0.05;
/// Share of the width by which two crests may lie beside each other there.
const ASIDE: f64 = 0.03;
/// One side of a grip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End {
    /// Near a corner of the net.
    Free(u32),
    /// A planar face.
    Plane(u32),
    /// A curved face that is not of free form, by its index.
    Round(usize),
}

/// Two ends and the direction along which they are opposite each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    pub(super) ends: [End; 2],
    /// Unit and upright, from the second to the first.
    pub(super) closing: DVec3,
    pub(super) places: [Facing; 2],
    pub(super) width: f64,
    /// By how much they are not, as a share of the width.
    pub(super) off: f64,
}

impl Finder<'_> {
    /// Pairs of places opposite each other, the best first.
    pub(super) fn pairs(&self, net: &mut Net) -> Vec<Pair> {
        let reach = self.reach;
        let corners = net.sample(CORNERS);
        let normals = Normals::new(&corners, net);
        let mut starts: Vec<([End; 2], DVec3)> = Vec::new();
        for &a in &corners {
            let (point, normal) = (net.points[a as usize], net.normals[a as usize]);
            let mut near: Vec<(f64, u32, DVec3)> = Vec::new();
            for b in normals.near(-normal) {
                let other = net.normals[b as usize];
                if -normal.dot(other) < OPPOSITE {
                    continue;
                }
                let closing = (normal - other).normalize();
                let between = point - net.points[b as usize];
                let width = between.dot(closing);
                let beside = (between - width * closing).length();
                if width > 0.0 && beside < BESIDE * (width + reach) {
                    let miss = beside / width + normal.cross(other).length();
                    near.push((miss, b, closing));
                }
            }
            if near.is_empty() || !net.is_convex(a) {
                continue;
            }
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // Each pair from one of its corners.
            let near = near.into_iter().filter(|(_, b, _)| net.is_convex(*b)).take(NEAREST);
            let near = near.filter(|(_, b, _)| a < *b || *b == a);
            starts.extend(near.map(|(_, b, closing)| ([End::Free(a), End::Free(b)], closing)));
        }
        for (end, of) in self.others() {
            let mut taken: FxHashSet<u32> = FxHashSet::default();
            for &a in &corners {
                let normal = net.normals[a as usize];
                let Some(closing) = of(net.points[a as usize], normal) else { continue };
                if normal.dot(closing) >= OPPOSITE
                    && net.is_convex(a)
                    && taken.insert(net.walk(a, closing))
                {
                    starts.push(([End::Free(a), end], closing));
                }
            }
        }
        let mut found: Vec<Pair> = starts
            .into_iter()
            .filter_map(|(ends, closing)| self.settle(ends, closing, net))
            .collect();
        // Those that only just are come last; then in the order of the corners.
        found.sort_by_key(|pair| (pair.off * 200.0).round() as i64);
        found
    }

    /// Planes and round faces that a crest of free form may be opposite to, each with the direction
    /// in which a place would have to face.
    #[allow(clippy::type_complexity, reason = "one list for one loop")]
    fn others(&self) -> Vec<(End, Box<dyn Fn(DVec3, DVec3) -> Option<DVec3> + '_>)> {
        let mut found: Vec<(End, Box<dyn Fn(DVec3, DVec3) -> Option<DVec3> + '_>)> = Vec::new();
        let planes = self.part.faces.iter();
        let planes = planes.filter(|face| face.reachable && self.may_touch(face.id));
        for face in planes.take(MOST_PLANES) {
            let opposite = |point: DVec3, _: DVec3| {
                (point.dot(face.normal) < face.offset).then_some(-face.normal)
            };
            found.push((End::Plane(face.id), Box::new(opposite)));
        }
        for face in self.round_faces() {
            let index = face.id as usize - self.part.faces.len();
            match face.shape {
                Shape::Cylinder { axis, .. } => {
                    let opposite =
                        move |point: DVec3, _: DVec3| (point - axis.foot(point)).try_normalize();
                    found.push((End::Round(index), Box::new(opposite)));
                }
                Shape::Sphere { centre, .. } => {
                    let opposite = move |point: DVec3, _: DVec3| (point - centre).try_normalize();
                    found.push((End::Round(index), Box::new(opposite)));
                }
                _ => {}
            }
        }
        found
    }

    /// The place of an end that faces a direction.
    fn facing_end(
        &self,
        end: &mut End,
        direction: DVec3,
        width: f64,
        net: &mut Net,
    ) -> Option<Facing> {
        let tangents = |normal: DVec3| {
            let (u, v) = normal.any_orthonormal_pair();
            [u, v].map(|e| Some((e, e.dot(normal - direction))))
        };
        let ball = |radius: f64| (DMat3::IDENTITY - square(direction)) * radius;
        match end {
            End::Free(corner) => {
                *corner = net.walk(*corner, direction);
                net.facing(*corner, direction, width)
            }
            End::Plane(face) => {
                let face = &self.part.faces[*face as usize];
                let straight = tangents(face.normal);
                Some(Facing { point: face.centroid, radii: DMat3::ZERO, straight })
            }
            End::Round(index) => match self.part.curved[*index].shape {
                Shape::Cylinder { axis, radius, along, .. } => {
                    let a = axis.direction;
                    let outwards = direction.reject_from_normalized(a).try_normalize()?;
                    let middle = axis.origin + a * (0.5 * (along[0] + along[1]));
                    Some(Facing {
                        point: middle + outwards * radius,
                        radii: ball(radius) - square(a) * radius,
                        straight: [Some((a, -a.dot(direction))), None],
                    })
                }
                Shape::Sphere { centre, radius } => Some(Facing {
                    point: centre + direction * radius,
                    radii: ball(radius),
                    straight: [None; 2],
                }),
                _ => None,
            },
        }
    }

    /// The direction near `closing` along which two ends are opposite each other.
    fn settle(&self, mut ends: [End; 2], mut closing: DVec3, net: &mut Net) -> Option<Pair> {
        let mut width = match ends {
            [End::Free(a), End::Free(b)] => {
                (net.points[a as usize] - net.points[b as usize]).dot(closing)
            }
            _ => self.size,
        };
        let mut step = 0;
        let mut before = [(ends, closing, width); PERIODS];
        while step < STEPS {
            // Where corners take turns the last step is one of those before.
            let state = (ends, closing, width);
            let again = |&period: &usize| {
                let known = before[(step as usize + PERIODS - period) % PERIODS];
                known.0 == ends && known.1.distance(closing) < SAME && known.2 == width
            };
            let periods = 2..=PERIODS.min(step as usize);
            if let Some(period) = periods.clone().find(again) {
                let left = (STEPS - 1 - step) as usize % period;
                if left > 0 {
                    let known = step as usize - period + left;
                    (ends, closing, width) = before[known % PERIODS];
                }
                step = STEPS - 1;
            } else {
                before[step as usize % PERIODS] = state;
            }
            let [one, two] = &mut ends;
            let places = [
                self.facing_end(one, closing, width, net)?,
                self.facing_end(two, -closing, width, net)?,
            ];
            let between = places[0].point - places[1].point;
            width = between.dot(closing);
            if width <= 0.0 {
                return None;
            }
            let (u, v) = closing.any_orthonormal_pair();
            let flat = |x: DVec3| DVec2::new(u.dot(x), v.dot(x));
            let mut held = DMat2::ZERO;
            let mut pull = DVec2::ZERO;
            for (place, sense) in places.iter().zip([1.0, -1.0]) {
                for (along, lacks) in place.straight.iter().flatten() {
                    let e = flat(*along);
                    held += outer(e, e);
                    pull += sense * e * *lacks;
                }
            }
            let radii = places[0].radii + places[1].radii;
            let [x, y] = [u, v].map(|e| flat(radii * e));
            let give = DMat2::from_cols(x, y) - DMat2::IDENTITY * width;
            let (turn, off) = turn(held, pull, give, flat(between), width);
            let size = turn.length();
            let turned = turn.clamp_length_max(LONGEST);
            let is_last = size < SHORTEST || step + 1 == STEPS;
            if is_last {
                let off = off / width;
                let mut pair =
                    Pair { ends, closing: self.snapped(&ends, closing), places, width, off };
                if upright(pair.closing) != pair.closing {
                    pair.closing = -pair.closing;
                    pair.ends.reverse();
                    pair.places.reverse();
                }
                return (size < SETTLED && off < ASIDE).then_some(pair);
            }
            closing = (closing + u * turned.x + v * turned.y).normalize();
            step += 1;
        }
        None
    }

    /// A direction that is to be exactly that of a plane, or across an axis.
    fn snapped(&self, ends: &[End; 2], closing: DVec3) -> DVec3 {
        match ends[1] {
            End::Plane(face) => -self.part.faces[face as usize].normal,
            End::Round(index) => match self.part.curved[index].shape.axis() {
                Some(axis) => closing.reject_from_normalized(axis.direction).normalize(),
                None => closing,
            },
            End::Free(_) => closing,
        }
    }
}

/// By how much a direction turns to bring two ends opposite each other: where they are straight
/// (`held`), until it faces them (`pull`), elsewhere by Newton's step; and how far apart the ends
/// stay where a turn changes nothing.
fn turn(held: DMat2, pull: DVec2, give: DMat2, between: DVec2, width: f64) -> (DVec2, f64) {
    let ([low, high], first) = principal(held);
    let mut turn = DVec2::ZERO;
    let mut off = 0.0_f64;
    let mut newton = |e: DVec2, give: f64| {
        if give.abs() < CONSTANT * width {
            off = off.hypot(e.dot(between));
            return DVec2::ZERO;
        }
        -e * (e.dot(between) / give)
    };
    if high < HELD {
        let ([low, high], first) = principal(give);
        turn += newton(first, low) + newton(first.perp(), high);
        return (turn, off);
    }
    for (value, e) in [(low, first), (high, first.perp())] {
        turn += if value < HELD { newton(e, e.dot(give * e)) } else { e * (e.dot(pull) / value) };
    }
    (turn, off)
}

/// Square of the cosine to a straight direction below which none is held.
const HELD: f64 = 0.1;

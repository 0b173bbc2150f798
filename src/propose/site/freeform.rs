//! Sites on faces of free form, and on surfaces of revolution of any profile: closing directions along
//! which a crest of one lies opposite a crest of another, of a round face, or a plane.
//!
//! Two places are opposite each other where the line between them is normal to both surfaces. From
//! pairs of corners that nearly are, Newton's method on the direction finds the pairs that are: the
//! place at which a surface faces a direction moves by its radii as the direction turns.

use glam::{DMat2, DMat3, DVec2, DVec3};
use rustc_hash::FxHashSet;

use super::crest::{Crests, FreeCrest, Pad, compression, half};
use super::net::{Facing, Net, Normals, square};
use super::relief::{Survey, ellipse, is_free};
use super::round::{Crest, MOST_PLANES, Outcomes, Round};
use super::tapers::upright;
use super::{Finder, SAME_PLANE, Site, axes};
use crate::error::Result;
use crate::geometry::polygon::{Bounds2, outer};
use crate::geometry::principal;
use crate::mechanics::curved::Pads;
use crate::model::{Gap, Piece, Ring, Surfaces};
use crate::part::{CurvedFace, PairKind, Shape};
use crate::propose::options::Rejection;
use crate::propose::stroke::Stroke;

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
/// Share of the width by which the radii of two crests may fall short of it: fits are no better.
const ROLLS: f64 = 0.05;
/// Compressions behind a crest up to which what lies beside it counts: a load presses one pad by half
/// as much again, and tilts it by as much.
const DEPTH: f64 = 4.0;
/// Directions of one pair of faces, as a share of the step asked for, below which two are one.
const SAME_STEP: f64 = 0.6;
/// Pairs of crests looked at, at most, and triangles looked at for them.
const MOST_PAIRS: usize = 400;
const MOST_TRIANGLES: usize = 60_000_000;

/// One side of a grip.
#[derive(Debug, Clone, Copy, PartialEq)]
enum End {
    /// Near a corner of the net.
    Free(u32),
    /// A planar face.
    Plane(u32),
    /// A curved face that is not of free form, by its index.
    Round(usize),
}

/// Two ends and the direction along which they are opposite each other.
#[derive(Debug, Clone, Copy)]
struct Pair {
    ends: [End; 2],
    /// Unit and upright, from the second to the first.
    closing: DVec3,
    places: [Facing; 2],
    width: f64,
    /// By how much they are not, as a share of the width.
    off: f64,
}

/// What was found of one pair of crests.
struct Known {
    faces: [u32; 2],
    closing: DVec3,
    axes_from_part: DMat3,
    /// In these axes, those of the direction.
    boxes: [Bounds2; 2],
}

/// Whether crests of a face are looked for here: it is of free form, or has a profile that is known
/// by its triangles only.
fn has_form(face: &CurvedFace) -> bool {
    is_free(face) || face.outside && matches!(face.shape, Shape::Revolution { .. })
}

impl Finder<'_> {
    /// The sites on faces of free form.
    pub(super) fn free(&mut self, round: &mut Round) -> Result<Vec<Site>> {
        let wanted =
            |face: &&CurvedFace| has_form(face) && face.reachable && self.may_touch(face.id);
        if !self.options.outside || !self.part.curved.iter().any(|face| wanted(&face)) {
            return Ok(Vec::new());
        }
        let mut net = Net::new(&self.part.mesh, self.part.curved.iter().filter(wanted));
        let pairs = self.pairs(&mut net);
        let mut loose = self.loose();
        let of_revolution = self.part.curved.iter().filter(|face| has_form(face) && !is_free(face));
        loose.extend(of_revolution.flat_map(|face| &face.triangles));
        let triangles = self.part.mesh.triangles.len().max(1);
        let most = (MOST_TRIANGLES / triangles).clamp(MOST_PAIRS / 16, MOST_PAIRS);
        let mut sites = Vec::new();
        let mut seen = Outcomes::default();
        let mut known: Vec<Known> = Vec::new();
        let mut tried = 0;
        let near = (SAME_STEP * self.options.angle_step).sin();
        for pair in &pairs {
            let is_known = |known: &Known| self.is_known(known, pair, near, &net);
            if tried == most || known.iter().any(is_known) {
                continue;
            }
            tried += 1;
            self.budget.look();
            let first = sites.len();
            let faces = pair.ends.map(|end| self.face_of(end, &net));
            let axes_from_part = axes(pair.closing);
            let mut boxes = pair.places.map(|place| {
                let at = (axes_from_part * place.point).truncate();
                Bounds2 { min: at, max: at }
            });
            let outcome = match self.crests_of(pair, &net) {
                Err(reason) => Some(Some(reason)),
                Ok(None) => None,
                Ok(Some(crests)) => {
                    boxes = crests.each_ref().map(|crest| crest.bounds);
                    self.opposite(pair, &crests, &loose, &mut sites)?
                }
            };
            known.push(Known { faces, closing: pair.closing, axes_from_part, boxes });
            sites[first..].iter().for_each(|site| self.budget.take(site));
            if self.budget.is_spent() {
                round.left_out = true;
                return Ok(Vec::new());
            }
            if matches!(outcome, Some(Some(Rejection::Stroke))) {
                round.widths.push(pair.width);
            }
            if let Some(outcome) = outcome {
                seen.add(faces[0], faces[1], outcome);
            }
        }
        round.count(seen);
        Ok(sites)
    }

    fn face_of(&self, end: End, net: &Net) -> u32 {
        match end {
            End::Free(corner) => net.faces[corner as usize],
            End::Plane(face) => face,
            End::Round(index) => self.part.curved[index].id,
        }
    }

    /// Whether a pair of crests is one that was looked at; `near`: the sine of the angle up to which
    /// two directions are one.
    fn is_known(&self, known: &Known, pair: &Pair, near: f64, net: &Net) -> bool {
        let reach = self.reach;
        let faces = pair.ends.map(|end| self.face_of(end, net));
        // Near the border between upright and not.
        let swapped = known.closing.dot(pair.closing) < 0.0;
        let [one, two] = if swapped { [1, 0] } else { [0, 1] };
        if [faces[one], faces[two]] != known.faces {
            return false;
        }
        if known.closing.cross(pair.closing).length() > near {
            return false;
        }
        [one, two].iter().zip(known.boxes).all(|(&end, bounds)| {
            let at = (known.axes_from_part * pair.places[end].point).truncate();
            let at = Bounds2 { min: at, max: at };
            matches!(pair.ends[end], End::Plane(_)) || bounds.grown(0.5 * reach).meets(at)
        })
    }

    /// Pairs of places opposite each other, the best first.
    fn pairs(&self, net: &mut Net) -> Vec<Pair> {
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

    /// The crests of a pair in the axes of its upright direction, the upper one first; `None` where
    /// there are none, or they do not face each other.
    fn crests_of(
        &self,
        pair: &Pair,
        net: &Net,
    ) -> std::result::Result<Option<[FreeCrest; 2]>, Rejection> {
        let axes_from_part = axes(pair.closing);
        let mesh = &self.part.mesh;
        // All corners together where most of them are looked at.
        let points = match 4 * net.points.len() >= mesh.vertices.len() {
            true => mesh.vertices.iter().map(|&vertex| axes_from_part * vertex).collect(),
            false => Vec::new(),
        };
        let crests = Crests { mesh, net, axes_from_part, points, pad: self.pad() };
        let mut found = Vec::new();
        for (index, side) in [1.0, -1.0].into_iter().enumerate() {
            let crest = match pair.ends[index] {
                End::Free(corner) => {
                    let id = net.faces[corner as usize];
                    let Some(face) = self.part.curved_face(id) else { return Ok(None) };
                    crests.find(face, corner, &pair.places[index], side)
                }
                end => self.other_crest(end, side * pair.closing, side, net),
            };
            let Some(crest) = crest else { return Ok(None) };
            found.push(crest);
        }
        let Ok([top, bottom]) = <[FreeCrest; 2]>::try_from(found) else { return Ok(None) };
        let width = top.height + bottom.height;
        let reach = self.reach;
        if width <= 0.0 || !top.bounds.grown(reach).meets(bottom.bounds.grown(reach)) {
            return Ok(None);
        }
        Stroke::new(PairKind::External, self.gripper, self.options).check(width)?;
        let most = 1e3 * width;
        let give = top.tensor(most) + bottom.tensor(most);
        if principal(give).0[0] < width * (1.0 - ROLLS) {
            return Err(Rejection::RollsApart);
        }
        Ok(Some([top, bottom]))
    }

    /// The crest of a plane or round face.
    fn other_crest(&self, end: End, towards: DVec3, side: f64, net: &Net) -> Option<FreeCrest> {
        let id = self.face_of(end, net);
        let crest = self.crests(towards).into_iter().find(|crest| crest.face == id)?;
        let (radii, axis) = match end {
            End::Round(index) => match self.part.curved[index].shape {
                Shape::Cylinder { axis, radius, .. } => {
                    let along = (axes(upright(towards)) * axis.direction).truncate();
                    ([radius, f64::INFINITY], along.normalize())
                }
                _ => ([crest.radius; 2], DVec2::X),
            },
            _ => ([f64::INFINITY; 2], DVec2::X),
        };
        let closing = side * towards;
        let bounds = if side < 0.0 { self.flipped(crest.bounds, closing) } else { crest.bounds };
        Some(FreeCrest {
            face: id,
            height: crest.height,
            above: 0.0,
            bounds,
            ends: crest.ends.map(DVec3::truncate),
            radii,
            axis,
            delta: compression(radii, self.pad()).max(self.flat_compression(end)),
            smooth: None,
        })
    }

    /// Compression of the layer by a plane alone \[m\], which may be smaller than a pad.
    fn flat_compression(&self, end: End) -> f64 {
        let End::Plane(index) = end else { return 0.0 };
        let Pad { layer, force, .. } = self.pad();
        (force / (layer.stiffness * self.part.faces[index as usize].area)).min(layer.reach())
    }

    /// Whether a squeeze on these surfaces turns the part out of the grip: radii of crests do not tell
    /// where a flat is smaller than what is pressed.
    fn rolls_apart(&self, pieces: &[Vec<Piece>; 2], width: f64) -> bool {
        let [face_i, face_ii] = pieces.clone();
        let stiffness = [self.gripper.layer().stiffness; 2];
        let surfaces = Surfaces { face_i, face_ii, stiffness, layer: None };
        let force = self.options.force_on(self.gripper);
        let resists =
            Pads::new(&surfaces).ok().and_then(|pads| pads.turning_stiffness(width, force));
        resists.is_some_and(|stiffness| stiffness < -ROLLS * force * width)
    }

    fn pad(&self) -> Pad {
        Pad {
            layer: self.gripper.layer(),
            force: self.options.force_on(self.gripper),
            reach: self.reach,
        }
    }

    /// Adds the sites of two crests, as [`Finder::round_sites`].
    #[allow(clippy::option_option, reason = "told apart by the caller at once")]
    fn opposite(
        &mut self,
        pair: &Pair,
        [top, bottom]: &[FreeCrest; 2],
        loose: &[u32],
        sites: &mut Vec<Site>,
    ) -> Result<Option<Option<Rejection>>> {
        let closing = pair.closing;
        let levels = [top, bottom].map(|crest| {
            let ends = crest.ends.map(|end| end.extend(0.0));
            let FreeCrest { face, height, bounds, radii: [radius, _], .. } = *crest;
            [Crest { face, height, radius, bounds, ends }]
        });
        if self.is_buried(closing, [&levels[0], &levels[1]], &mut None) {
            return Ok(Some(Some(Rejection::OutOfReach)));
        }
        let direction = self.direction(closing);
        let heights = [top.height, -bottom.height];
        let reach = self.reach;
        let common = Bounds2 {
            min: top.bounds.min.max(bottom.bounds.min),
            max: top.bounds.max.min(bottom.bounds.max),
        };
        let region = Bounds2 {
            min: common.min.min(common.max) - 2.0 * reach,
            max: common.max.max(common.min) + 2.0 * reach,
        };
        let taken: FxHashSet<u32> = [top, bottom]
            .iter()
            .filter_map(|crest| crest.smooth.as_ref())
            .flat_map(|smooth| smooth.triangles.iter().copied())
            .collect();
        let facets: Vec<u32> =
            loose.iter().copied().filter(|triangle| !taken.contains(triangle)).collect();
        let axes_from_part = axes(self.directions[direction]);
        let survey = Survey::without(self.part, &facets, axes_from_part, has_form);
        let depth = self.gripper.layer().reach().min(DEPTH * top.delta.max(bottom.delta));
        let found = survey.pieces(heights, [depth; 2], region);
        let mut smooth = [(top, 1.0), (bottom, -1.0)].map(|(crest, side)| {
            crest.smooth.as_ref().map_or(Vec::new(), |smooth| {
                let window = window(&smooth.gap, smooth.level, region);
                survey.outlined(&smooth.triangles, &window, smooth.gap, side)
            })
        });
        for (pieces, others) in smooth.iter_mut().zip(found) {
            pieces.extend(others);
        }
        let pieces: [Vec<Piece>; 2] = smooth;
        if self.rolls_apart(&pieces, heights[0] - heights[1]) {
            return Ok(Some(Some(Rejection::RollsApart)));
        }
        let sides = [vec![top.face], vec![bottom.face]];
        let rise = SAME_PLANE * self.size + top.above.max(bottom.above);
        let place = common.centre();
        // The places lie along the crest, however the part lies.
        let turn = crest_axis(&pieces).map(|axis| {
            let quarter = std::f64::consts::FRAC_PI_2;
            let turn = axis.to_angle().rem_euclid(quarter);
            if turn > 0.5 * quarter + 1e-6 { turn - quarter } else { turn }
        });
        let pads = (heights, place);
        let any = self.pressed_sites(direction, sides, pads, pieces, (rise, turn), sites)?;
        Ok(any.then_some(None))
    }
}

/// Direction of the first crest that has one.
fn crest_axis(pieces: &[Vec<Piece>; 2]) -> Option<DVec2> {
    pieces.iter().flatten().find_map(|piece| match piece.gap {
        Gap::Cylinder { axis, .. } | Gap::Barrel { axis, .. } => Some(axis),
        _ => None,
    })
}

/// What of the pads' plane a gap stands for.
fn window(gap: &Gap, level: f64, region: Bounds2) -> Ring {
    let size = region.size().length();
    match *gap {
        Gap::Barrel { radius, meridian, axis, at, .. } => {
            ellipse(at, axis, [half(meridian, level), half(radius, level)])
        }
        Gap::Cylinder { radius, axis, at, .. } => {
            let across = half(radius, level);
            let at = at + axis * axis.dot(region.centre() - at);
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| at + axis * (x * size) + axis.perp() * (y * across))
                .to_vec()
        }
        _ => {
            let Bounds2 { min, max } = region;
            vec![min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)]
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

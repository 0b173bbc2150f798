//! Whether facets that lie on a surface were made from it.

use std::f64::consts::TAU;

use glam::DVec3;

use super::Axis;
use super::fit::{Kind, Profile};
use super::grow::{Exactness, Found, Growth};

/// Facets to the turn of a cylinder or cone, at least.
const FEWEST: f64 = 7.5;
/// Cosine of the half angle of the flattest cone that is not a whole ring: 78 degrees. A flatter one is
/// hard to tell from any dome.
const FLATTEST_ARC: f64 = 0.2;
/// Angle between facets above which they may as well be flats \[rad\]: 25.5 degrees, 14 to the turn.
pub(super) const COARSE: f64 = 0.445;
/// Turn below which a face shows too little of its curvature \[rad\]: 26 degrees.
const LEAST_TURN: f64 = 0.45;
/// ... of a torus, about its tube and about its axis: 17 and 10 degrees.
const LEAST_TORUS: [f64; 2] = [0.3, 0.17];
/// Turn \[rad\] above which nothing but a circle fits a circle within the tolerances (an involute
/// or an ellipse leaves it by more): 100 degrees; 60 where the residual is a small one.
const SURE: [f64; 2] = [1.75, 1.05];
/// Residual as a share of the sag below which even a short arc is one.
const SURELY: f64 = 0.005;
/// Distance from the best circle, as a share of the arc's height, at which the corners of a short arc
/// of another curve lie (an involute's, over 26 degrees), and the logarithm of how unlikely it must be
/// that all lie as near to it by chance as they do.
const ELSEWHERE: f64 = 0.1;
const UNLIKELY: f64 = 7.0;
/// Points that show noise.
const MANY: usize = 30;
/// Share of the part's diagonal up to which flats of a bent sheet and facets of an arc look alike:
/// sag.
const ARC: f64 = 0.01;
/// Sag as a multiple of that of a chord across a typical facet from which on a facet is too deep.
const DEEP: f64 = 8.0;
/// Large facets of a whole ball, and of a part of one, at least: a cube with chamfers has 26.
const BALL: [usize; 2] = [40, 60];
/// Area of the caps about large facets of a ball over their own, at most: squares 1.6, triangles 2.4.
const COMPACT: f64 = 6.0;
/// Corners, area over the middle one of all facets, and half width over the radius, from which on a facet
/// of a ball is the end of something turned.
const END: (usize, f64, f64) = (8, 1.5, 0.25);
/// Length over width that half of the surface of a ball does not pass: triangles of a twisted net with
/// twice as many steps along as around have some three.
const STRIP: f64 = 3.5;
/// Side of a square as a share of the diagonal: three facets alone count when smaller.
const SMALL: f64 = 0.02;

/// What the facets of a surface say of how it was cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// Typical angle between neighbouring facets \[rad\].
    pub step: f64,
    /// Facets to a turn.
    pub facets: f64,
    /// Arc covered about the axis \[rad\]; 0 for a sphere.
    pub turn: f64,
}

/// Borders of the members of a surface.
#[derive(Default)]
struct Edge {
    /// Sums over borders within: length, length times bend, length times bend squared (signed).
    bend: f64,
    square: f64,
    least: f64,
    most: f64,
    /// Mean length of those that are bent.
    length: f64,
    count: f64,
    /// Length of borders to others, of those to facets that carry on in much the same way, and of
    /// those that meet a tangent face.
    outer: f64,
    runs_on: f64,
    tangent: f64,
    /// Corners that have members on all sides: a belt has none.
    inner: usize,
}

impl Growth<'_> {
    fn edge(&mut self, found: &Found) -> Edge {
        self.mark(&found.members);
        let net = self.net;
        let mut edge = Edge { least: f64::INFINITY, ..Edge::default() };
        for &facet in &found.members {
            for border in net.borders.of(facet as usize) {
                if !self.is_marked(border.other) || !net.is_smooth(facet, border.other) {
                    continue;
                }
                let bend = net.bend(facet, border.other);
                edge.bend += border.length * bend;
                edge.square += border.length * bend * bend.abs();
                if bend.abs() > 3e-4 {
                    edge.least = edge.least.min(bend.abs());
                    edge.most = edge.most.max(bend.abs());
                    edge.length += border.length;
                    edge.count += 1.0;
                }
            }
        }
        edge.inner = self.inner(found);
        let step = edge.square / edge.bend;
        for &facet in &found.members {
            for border in net.borders.of(facet as usize) {
                let other = border.other;
                if self.is_marked(other) {
                    continue;
                }
                edge.outer += border.length;
                if !net.is_smooth(facet, other) {
                    continue;
                }
                let bend = net.bend(facet, other) / edge.bend.signum();
                if (0.3 * step..0.7 * step).contains(&bend) {
                    edge.tangent += border.length;
                }
                let widths = net.area(facet) / net.area(other);
                let miss = net
                    .corners(other)
                    .map(|vertex| found.surface.distance(net.point(vertex)).abs())
                    .fold(0.0, f64::max);
                if (0.5 * step..2.0 * step).contains(&bend)
                    && (0.4..2.5).contains(&widths)
                    && miss < net.floor + 0.35 * found.sag
                    && !match found.kind {
                        Kind::Cylinder => self.is_cut(found, other),
                        Kind::Sphere => self.is_cut_rim(found, other),
                        _ => false,
                    }
                {
                    edge.runs_on += border.length;
                }
            }
        }
        edge
    }

    /// Number of corners that have marked facets on all sides.
    fn inner(&self, found: &Found) -> usize {
        let net = self.net;
        let triangles = found.members.iter().flat_map(|&facet| net.triangles(facet)).copied();
        let is_one = |triangle: u32| self.is_marked(net.regions.of[triangle as usize]);
        let rim = net.part.edges.rim(&net.part.mesh.triangles, triangles, is_one);
        let outer = rim.iter().filter(|&&vertex| net.is_corner(vertex)).count();
        found.points.len().saturating_sub(outer)
    }

    /// Whether the surface is what the facets were made from, and how they cut it.
    pub(super) fn judge(&mut self, found: &Found, exactness: Exactness) -> Option<Cut> {
        let edge = self.edge(found);
        let step = edge.square / edge.bend;
        if !(step > 1e-5 && edge.count > 0.0) {
            return None;
        }
        let mean = edge.length / edge.count;
        let coarse = step > COARSE;
        if coarse && !self.is_even(found, &edge) {
            return None;
        }
        let diagonal = self.net.part.diagonal;
        let reach = found.surface.reach();
        let chord = |step: f64| reach * (1.0 - (step / 2.0).cos());
        let (turn, facets, runs_on, is_steep, chord) = match found.surface.profile {
            Profile::Line { slope, .. } => {
                // The normals of a cone turn by less than the facets.
                let about = 2.0 * ((step / 2.0).sin() / slope.cos()).min(1.0).asin();
                let turn = turn(found, about);
                let (is_steep, chord) =
                    (slope.cos() > FLATTEST_ARC || turn == TAU, chord(about) * slope.cos());
                (turn, TAU / about, edge.runs_on > 0.5 * mean, is_steep, chord)
            }
            Profile::Circle { .. } => {
                (0.0, TAU / step, edge.runs_on > 0.3 * edge.outer, true, chord(step))
            }
        };
        // Facets as long as a belt of a sphere is wide touch it at their ends only.
        let is_deep = found.sag > DEEP * chord + self.net.floor;
        let is_sound = match found.kind {
            Kind::Cylinder | Kind::Cone | Kind::Sphere | Kind::Torus if is_deep => false,
            Kind::Cylinder | Kind::Cone | Kind::Revolution => {
                let strips = turn * facets / TAU;
                let short = strips < 4.7 || turn < 2.09;
                let small = || {
                    let most = (SMALL * diagonal).powi(2);
                    found.members.iter().all(|&facet| self.net.area(facet) < most)
                };
                strips > 2.7
                    && facets > FEWEST
                    && is_steep
                    && turn > LEAST_TURN
                    && !(short && found.sag > ARC * diagonal)
                    && (strips > 3.5 || edge.tangent > 0.5 * mean || small())
                    && !(runs_on && turn < SURE[0])
                    && (turn > SURE[1]
                        || (found.residual < self.net.floor + SURELY * found.sag
                            || self.is_random(found))
                            && is_no_chance(found, turn, strips))
            }
            Kind::Sphere => {
                let area: f64 = found.members.iter().map(|&facet| self.net.area(facet)).sum();
                found.members.len() >= if coarse { 16 } else { 8 }
                    && edge.inner >= 2
                    && area > 0.1 * found.surface.radius().powi(2)
                    && (found.sag < ARC * diagonal || found.members.len() >= 16)
                    && !runs_on
                    && self.is_ball(found, &edge, area)
            }
            Kind::Torus => {
                let [tube, about] = torus_turns(found, step);
                edge.inner >= 4
                    && tube > LEAST_TORUS[0]
                    && about > LEAST_TORUS[1]
                    && found.members.len() >= if coarse { 40 } else { 9 }
                    && found.sag < 2.0 * ARC * diagonal
                    && !runs_on
            }
        };
        let is_true = match exactness {
            Exactness::Exact => true,
            Exactness::Noisy => {
                (found.kind == Kind::Cylinder && turn == TAU) || self.is_random(found)
            }
        };
        (is_sound && is_true).then_some(Cut { step, facets, turn })
    }

    /// Sag \[m\] and area [m^2] of each facet.
    fn sags(&self, found: &Found) -> impl Iterator<Item = (f64, f64)> {
        let net = self.net;
        let sag = |facet| net.sag(&found.surface, facet, found.sign, f64::INFINITY, f64::INFINITY);
        found.members.iter().filter_map(move |&facet| Some((sag(facet)?, net.area(facet))))
    }

    /// Whether coarse facets are alike: a square bar with chamfers also has its corners on a circle.
    fn is_even(&self, found: &Found, edge: &Edge) -> bool {
        let doubly = matches!(found.kind, Kind::Torus | Kind::Sphere);
        let (least, most) = self
            .sags(found)
            .fold((f64::INFINITY, 0.0_f64), |(low, high), sag| (low.min(sag.0), high.max(sag.0)));
        doubly
            || (edge.most < 1.03 * edge.least && most - least < 0.06 * most + 2.0 * self.net.floor)
    }

    /// Whether facets on a sphere are alike, and where they are large as wide as long: on a chamfered
    /// cylinder or cube, too, all corners may lie on a sphere. `area` of all \[m^2\].
    fn is_ball(&self, found: &Found, edge: &Edge, area: f64) -> bool {
        let radius = found.surface.radius();
        let mut sags: Vec<(f64, f64)> = self.sags(found).collect();
        sags.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(middle), Some(last)) = (sags.get(sags.len() / 2), sags.last()) else {
            return false;
        };
        if last.0 > DEEP * middle.0 + self.net.floor || self.has_flat_or_strips(found) {
            return false;
        }
        // Half the angle that most of the surface's facets take up.
        let most = middle_by_area(sags.iter().copied(), area).unwrap_or(last.0);
        let half = (1.0 - most / radius).clamp(-1.0, 1.0).acos();
        let caps = found.members.len() as f64 * std::f64::consts::PI * (half * radius).powi(2);
        2.0 * half <= COARSE
            || caps <= COMPACT * area && found.members.len() >= BALL[usize::from(edge.outer > 0.0)]
    }

    /// Whether facets on a sphere are those of something turned: a polygon of many corners that is much
    /// larger than the others is its end, or most of the surface is of long strips.
    fn has_flat_or_strips(&self, found: &Found) -> bool {
        let net = self.net;
        let mut shapes: Vec<(f64, f64, usize)> = found
            .members
            .iter()
            .map(|&facet| {
                let points: Vec<DVec3> = net.corners(facet).map(|x| net.point(x)).collect();
                (elongation(&points, net.normal(facet)), net.area(facet), points.len())
            })
            .collect();
        let mut areas: Vec<f64> = shapes.iter().map(|shape| shape.1).collect();
        areas.sort_by(f64::total_cmp);
        let middle = areas[areas.len() / 2];
        let wide = END.2 * found.surface.radius();
        let is_end = |&(_, area, corners): &(f64, f64, usize)| {
            corners >= END.0 && area > (END.1 * middle).max(std::f64::consts::PI * wide * wide)
        };
        if shapes.iter().any(is_end) {
            return true;
        }
        shapes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let by_area = shapes.iter().map(|&(elongation, area, _)| (elongation, area));
        middle_by_area(by_area, areas.iter().sum()).is_some_and(|elongation| elongation > STRIP)
    }

    /// Whether distances of the vertices from the surface are noise: neighbours along the rims of
    /// facets do not agree.
    fn is_random(&self, found: &Found) -> bool {
        let net = self.net;
        let (mut products, mut squares) = (0.0, 0.0);
        for pair in found.members.iter().flat_map(|&facet| net.rim(facet)) {
            let [a, b] = pair.map(|vertex| found.surface.distance(net.point(vertex)));
            products += a * b;
            squares += 0.5 * (a * a + b * b);
        }
        found.points.len() >= MANY && products < 0.2 * squares
    }
}

/// Of rising values with the areas that have them: the one up to which half of `area` lies.
fn middle_by_area(mut values: impl Iterator<Item = (f64, f64)>, area: f64) -> Option<f64> {
    let mut sum = 0.0;
    let most = values.find(|(_, own)| {
        sum += own;
        sum >= 0.5 * area
    });
    most.map(|(value, _)| value)
}

/// Length over width of a facet, from how its corners spread.
fn elongation(points: &[DVec3], normal: DVec3) -> f64 {
    let (u, v) = normal.any_orthonormal_pair();
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
    for point in points {
        let off = *point - middle;
        let (a, b) = (off.dot(u), off.dot(v));
        (uu, uv, vv) = (uu + a * a, uv + a * b, vv + b * b);
    }
    let (mean, apart) = (0.5 * (uu + vv), (0.25 * (uu - vv) * (uu - vv) + uv * uv).sqrt());
    ((mean + apart) / (mean - apart).max(f64::MIN_POSITIVE)).sqrt()
}

/// Whether it is unlikely that the corners of a short arc lie so near to a circle by chance: three of
/// them always do.
fn is_no_chance(found: &Found, turn: f64, strips: f64) -> bool {
    let height = found.surface.radius() * (1.0 - (turn / 2.0).cos());
    let more = (strips.round() - 2.0).max(1.0);
    more * (ELSEWHERE * height / found.residual).ln() > UNLIKELY
}

/// The arc that the face covers about its axis \[rad\].
pub(super) fn turn(found: &Found, step: f64) -> f64 {
    arc_of(found.surface.axis, found.points.iter().copied(), step)
}

/// The arc that points cover about an axis \[rad\]; `step`: the widest gap within.
pub(super) fn arc_of(axis: Axis, points: impl Iterator<Item = DVec3>, step: f64) -> f64 {
    let (u, v) = axis.direction.any_orthonormal_pair();
    let angle = |point: DVec3| {
        let from = point - axis.origin;
        from.dot(v).atan2(from.dot(u))
    };
    arc(points.map(angle), step)
}

/// The arcs that a torus covers about its tube and about its axis \[rad\].
fn torus_turns(found: &Found, step: f64) -> [f64; 2] {
    let Profile::Circle { major, .. } = found.surface.profile else { return [0.0; 2] };
    let axis = found.surface.axis;
    let tube =
        found.points.iter().map(|&point| axis.along(point).atan2(axis.distance(point) - major));
    [arc(tube, step), turn(found, step)]
}

/// The arc that angles cover: a turn less the widest gap, when that is wider than a facet.
fn arc(angles: impl Iterator<Item = f64>, step: f64) -> f64 {
    let mut angles: Vec<f64> = angles.collect();
    angles.sort_unstable_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return 0.0 };
    let around = first + TAU - last;
    let gap = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max);
    if gap < 1.75 * step { TAU } else { TAU - gap }
}

//! Crests of free form: where a flat pad touches such a face first, and the paraboloid that stands
//! for the face there.

use glam::{DMat2, DMat3, DVec2, DVec3};
use rustc_hash::FxHashSet;

use super::net::{Facing, Net};
use super::survey::{FACING, LEVEL};
use crate::geometry::Paraboloid;
use crate::geometry::polygon::{Bounds2, outer};
use crate::gripper::Layer;
use crate::model::Gap;
use crate::part::{CurvedFace, Mesh, Shape};

/// What the pads bring.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pad {
    pub(super) layer: Layer,
    /// Of one jaw \[N\].
    pub(super) force: f64,
    /// Distance of its farthest corner from the middle \[m\].
    pub(super) reach: f64,
}

/// Compressions up to which corners make the paraboloid.
const FITTED: f64 = 3.0;
/// Corners that make it at least, where there are as many.
const FEWEST: usize = 12;
/// Share of the compression, and of the gap besides, by which the paraboloid may miss a corner.
const OFF: [f64; 2] = [0.2, 0.1];
/// Compressions within which it may miss none.
const HELD: f64 = 2.0;
/// Share of the compression by which a crest may fall over the length of a pad and be straight.
const STRAIGHT: f64 = 0.1;
/// Share of the compression by which a straight one may lean over that length.
const LEANS: f64 = 0.5;
/// The part of a radius within which the parabola stands for the circle.
const PARABOLA: f64 = 0.9;
/// Share of an edge that one has which shows it to be straight, and the cosine of the angle between
/// them; and places on such an edge.
const SHORTER: f64 = 4.0;
const GOES_ON: f64 = 0.8;
const WITHIN: [f64; 3] = [0.25, 0.5, 0.75];
/// Determinant of the equations for a profile, over what it is for rings far apart, of a single ring.
const SINGULAR: f64 = 1e-12;
/// A crest may lie this far outside of a triangle, as a share of it.
const RIM: f64 = 1e-3;

/// A crest of a face of free form, in the axes of a closing direction.
#[derive(Debug, Clone)]
pub(super) struct FreeCrest {
    pub(super) face: u32,
    /// Of the pad's plane along the direction that the crest faces \[m\].
    pub(super) height: f64,
    /// How far corners of the face rise above it \[m\].
    pub(super) above: f64,
    /// Where pads touch first: a point, or the box of a line.
    pub(super) bounds: Bounds2,
    /// Of that line, or twice the point.
    pub(super) ends: [DVec2; 2],
    /// Least and greatest radius \[m\], infinite where it is straight, and the direction of the
    /// greatest.
    pub(super) radii: [f64; 2],
    pub(super) axis: DVec2,
    /// Compression of the layer there, about \[m\].
    pub(super) delta: f64,
    pub(super) smooth: Option<Smooth>,
}

/// Where a pad touches a face first.
struct Top {
    at: DVec2,
    height: f64,
    /// Least and greatest bend, zero where it is straight, and the direction of the least.
    bends: [f64; 2],
    first: DVec2,
}

/// What of a face a paraboloid stands for.
#[derive(Debug, Clone)]
pub(super) struct Smooth {
    pub(super) gap: Gap,
    pub(super) triangles: Vec<u32>,
    /// Gap up to which it does \[m\].
    pub(super) level: f64,
}

impl FreeCrest {
    /// How the touched place moves with the direction \[m\]; no more than `most`.
    pub(super) fn tensor(&self, most: f64) -> DMat2 {
        let [across, along] = self.radii.map(|radius| radius.min(most));
        let perp = self.axis.perp();
        outer(self.axis, self.axis) * along + outer(perp, perp) * across
    }
}

/// Compression of a layer by a crest of these radii under a pad \[m\]: a paraboloid of half the
/// greatest compression on an ellipse, no larger than the pad.
pub(super) fn compression(radii: [f64; 2], pad: Pad) -> f64 {
    let load = |delta: f64| {
        let [a, b] = radii.map(|radius| (2.0 * radius * delta).sqrt().min(pad.reach));
        0.5 * std::f64::consts::PI * a * b * pad.layer.stiffness * delta
    };
    let (mut low, mut high) = (0.0, pad.layer.reach());
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if load(middle) < pad.force { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// How much a corner counts at a gap: what is pressed most counts most.
fn weight(gap: f64, delta: f64) -> f64 {
    (1.0 + (2.0 * gap / delta).powi(2)).powi(-2)
}

/// Finds crests in the axes of one closing direction.
pub(super) struct Crests<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) net: &'a Net,
    pub(super) axes_from_part: DMat3,
    /// Heights of the mesh's corners along the direction \[m\].
    pub(super) heights: &'a [f64],
    pub(super) pad: Pad,
}

impl Crests<'_> {
    /// The crest of a face near a corner of its net, where it faces the closing direction (`side` 1)
    /// or its opposite (-1); `None` where the face has none there: it rises on to an edge or about a
    /// saddle.
    pub(super) fn find(
        &self,
        face: &CurvedFace,
        corner: u32,
        facing: &Facing,
        side: f64,
    ) -> Option<FreeCrest> {
        let place = |point: DVec3| {
            let point = self.axes_from_part * point;
            DVec3::new(point.x, point.y, side * point.z)
        };
        let start = place(facing.point);
        let straight = facing.straight.map(|straight| straight.is_some());
        let own = facing.radii.x_axis.x + facing.radii.y_axis.y + facing.radii.z_axis.z;
        let rough = match straight {
            [true, true] => [f64::INFINITY; 2],
            [false, false] => [0.5 * own; 2],
            _ => [own, f64::INFINITY],
        };
        let delta = compression(rough, self.pad);
        let points = self.around(corner, &place, start, delta);
        let highest = points.iter().map(|point| -point.z).fold(f64::NEG_INFINITY, f64::max);
        let above = start.z + highest;
        let turned = match face.shape {
            Shape::Revolution { axis, .. } => {
                let line = [place(axis.origin), place(axis.direction)];
                self.turned(line, &points, start, delta)
            }
            _ => None,
        };
        let top = match turned {
            Some(top) => top?,
            None => self.fitted(&points, start, delta)?,
        };
        let Top { at, height, bends, first } = top;
        let gap = match bends {
            [low, high] if low > 0.0 => Gap::Barrel {
                radius: high.recip(),
                meridian: low.recip(),
                axis: first,
                at,
                height: 0.0,
            },
            [_, high] if high > 0.0 => {
                Gap::Cylinder { radius: high.recip(), axis: first, at, height: 0.0 }
            }
            _ => Gap::Plane { height: 0.0, slope: DVec2::ZERO },
        };
        let value = |x: DVec2| {
            let x = x - at;
            let [along, across] = [first.dot(x), first.perp_dot(x)];
            0.5 * (bends[0] * along * along + bends[1] * across * across)
        };
        let mut crest = FreeCrest {
            face: face.id,
            height,
            above: (above - height).max(0.0),
            bounds: Bounds2 { min: at, max: at },
            ends: [at; 2],
            radii: [bends[1], bends[0]].map(f64::recip),
            axis: first,
            delta,
            smooth: None,
        };
        let found = self.cover(face, side, (height, at), delta, &value)?;
        let line = found.near.iter().map(|x| first.dot(*x - at));
        if bends[0] == 0.0 && !found.near.is_empty() {
            let [from, to] = [line.clone().fold(0.0, f64::min), line.fold(0.0, f64::max)];
            crest.ends = [from, to].map(|along| at + first * along);
            crest.bounds =
                if bends[1] == 0.0 { Bounds2::of(&found.near) } else { Bounds2::of(&crest.ends) };
        }
        let Cover { triangles, level, .. } = found;
        if level >= HELD * delta {
            crest.smooth = Some(Smooth { gap, triangles, level });
        } else {
            (crest.height, crest.above) = (above, 0.0);
        }
        crest.delta = delta.max(compression(crest.radii, self.pad));
        Some(crest)
    }

    /// The top of the paraboloid through corners behind a plane through `start`.
    fn fitted(&self, points: &[DVec3], start: DVec3, delta: f64) -> Option<Top> {
        let weighted = points.iter().map(|&point| (point, weight(point.z, delta)));
        let form = Paraboloid::fit(weighted)?;
        let ([low, high], first) = form.principal();
        let mut step = DVec2::ZERO;
        let mut bends = [0.0; 2];
        for (k, (bend, along)) in [low, high].into_iter().zip([first, first.perp()]).enumerate() {
            let (bend, by) = self.foremost(bend, along.dot(form.slope), delta)?;
            step -= along * by;
            bends[k] = bend;
        }
        let (at, height) = (start.truncate() + step, start.z - form.at(step));
        Some(Top { at, height, bends, first })
    }

    /// The same on a surface about an axis (a point of it and its direction), whose bend about that is known:
    /// corners tell its profile, wherever they lie on the round. `None` where the axis leaves the pads' plane,
    /// or they lie on one ring.
    #[allow(clippy::option_option, reason = "told apart by the caller at once")]
    fn turned(
        &self,
        [origin, direction]: [DVec3; 2],
        points: &[DVec3],
        start: DVec3,
        delta: f64,
    ) -> Option<Option<Top>> {
        if direction.z.abs() > LEVEL {
            return None;
        }
        let along = direction.truncate().normalize();
        let profile = |point: DVec3| {
            let from = point - origin;
            let across = along.perp_dot(from.truncate());
            DVec2::new(along.dot(from.truncate()), across.hypot(from.z))
        };
        let here = profile(start);
        // Least squares for the radius as a parabola.
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for point in points {
            let at = profile(start + DVec3::new(point.x, point.y, -point.z)) - here;
            let weight = weight(-at.y, delta);
            let row = DVec3::new(1.0, at.x / self.pad.reach, (at.x / self.pad.reach).powi(2));
            normal += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
            right += row * (at.y * weight);
        }
        if normal.determinant() <= SINGULAR * normal.x_axis.x.powi(3) {
            return None;
        }
        let [rise, slope, bend] = (normal.inverse() * right).to_array();
        let (slope, bend) = (slope / self.pad.reach, 2.0 * bend / self.pad.reach.powi(2));
        Some(self.foremost(-bend, -slope, delta).map(|(meridian, by)| {
            let step = -by;
            let radius = here.y + rise + slope * step - 0.5 * meridian * step * step;
            let at = origin.truncate() + along * (here.x + step);
            let (bends, first) = match meridian <= radius.recip() {
                true => ([meridian, radius.recip()], along),
                false => ([radius.recip(), meridian], along.perp()),
            };
            Top { at, height: origin.z + radius, bends, first }
        }))
    }

    /// Along one line: the bend of a gap, none where the crest is straight there, and how far back from here
    /// it is least; `None` where it has no such place.
    fn foremost(&self, bend: f64, slope: f64, delta: f64) -> Option<(f64, f64)> {
        let length = self.pad.reach;
        let fall = 0.5 * length * length;
        if bend * fall < -STRAIGHT * delta * FITTED {
            return None;
        }
        if bend * fall >= STRAIGHT * delta {
            return Some((bend, slope / bend));
        }
        (slope.abs() * length <= LEANS * delta).then_some((0.0, 0.0))
    }

    /// Corners about one, from a place there, their third coordinate the depth behind a plane through it.
    fn around(
        &self,
        corner: u32,
        place: &impl Fn(DVec3) -> DVec3,
        start: DVec3,
        delta: f64,
    ) -> Vec<DVec3> {
        let behind = |corner: u32| {
            let point = place(self.net.points[corner as usize]) - start;
            DVec3::new(point.x, point.y, -point.z)
        };
        let mut window = (FITTED * delta).min(self.pad.layer.reach());
        let mut points: Vec<DVec3> = Vec::new();
        for _ in 0..8 {
            let mut seen: FxHashSet<u32> = FxHashSet::from_iter([corner]);
            let mut queue = vec![corner];
            points.clear();
            while let Some(next) = queue.pop() {
                let point = behind(next);
                if next != corner
                    && (point.z > window || point.truncate().length() > 2.0 * self.pad.reach)
                {
                    continue;
                }
                points.push(point);
                for &other in self.net.beside(next) {
                    if self.is_straight(next, other) {
                        let end = behind(other);
                        let inner = WITHIN.iter().map(|share| point.lerp(end, *share));
                        points.extend(inner.filter(|at| at.z <= window));
                    }
                    if seen.insert(other) {
                        queue.push(other);
                    }
                }
            }
            if points.len() >= FEWEST {
                break;
            }
            window *= 2.0;
        }
        // The order of the corners must not tell.
        points.sort_by(|a, b| {
            a.z.total_cmp(&b.z).then(a.x.total_cmp(&b.x)).then(a.y.total_cmp(&b.y))
        });
        points
    }

    /// Whether the face has an edge of the mesh for a line: it goes on in a much shorter one, as long
    /// facets of a wall do in those of a round at its end. Edges of one length are chords of a curve.
    fn is_straight(&self, from: u32, to: u32) -> bool {
        let points = &self.net.points;
        let edge = points[to as usize] - points[from as usize];
        let length = edge.length();
        [(from, -1.0), (to, 1.0)].into_iter().any(|(end, sense)| {
            let beside = self.net.beside(end).iter();
            let mut on = beside.map(|&next| points[next as usize] - points[end as usize]);
            on.any(|next| {
                let further = next.length();
                SHORTER * further < length && sense * next.dot(edge) > GOES_ON * further * length
            })
        })
    }

    /// What of the face a gap stands for; `None` where the crest is none of its places.
    fn cover(
        &self,
        face: &CurvedFace,
        side: f64,
        (height, at): (f64, DVec2),
        delta: f64,
        value: &impl Fn(DVec2) -> f64,
    ) -> Option<Cover> {
        let mut cover =
            Cover { triangles: Vec::new(), near: Vec::new(), level: self.pad.layer.reach() };
        let mut is_of_face = false;
        let mut seen: Vec<(f64, u32)> = Vec::new();
        for &triangle in &face.triangles {
            let [a, b, c] = self.mesh.triangles[triangle as usize];
            let gaps = [a, b, c].map(|id| height - side * self.heights[id as usize]);
            let least = gaps[0].min(gaps[1]).min(gaps[2]);
            if least > cover.level {
                continue;
            }
            let corners = self.mesh.corners(triangle).map(|corner| self.axes_from_part * corner);
            let corners = corners.map(|point| DVec3::new(point.x, point.y, side * point.z));
            let flat = corners.map(DVec3::truncate);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a);
            // The mirror image of the other side has the corners the other way round.
            let up = side * normal.z / normal.length();
            // A needle of no area counts for nothing.
            if up.is_nan() || up <= 0.0 {
                continue;
            }
            is_of_face |= holds(flat, at);
            let is_near = flat.iter().any(|x| (*x - at).length() < 2.0 * self.pad.reach);
            if up < FACING && is_near {
                cover.level = cover.level.min(least);
            }
            for (x, gap) in flat.into_iter().zip(gaps) {
                let meant = value(x);
                let is_met = (gap - meant).abs() <= OFF[0] * delta + OFF[1] * meant;
                if is_met && gap <= delta {
                    cover.near.push(x);
                } else if !is_met && is_near {
                    cover.level = cover.level.min(gap.min(meant).max(0.0));
                }
            }
            if up >= FACING {
                seen.push((least, triangle));
            }
        }
        let within = seen.into_iter().filter(|(least, _)| *least < cover.level);
        cover.triangles.extend(within.map(|(_, triangle)| triangle));
        is_of_face.then_some(cover)
    }
}

/// Triangles that a gap stands for, their corners near the crest, and the gap from which on others
/// begin.
struct Cover {
    triangles: Vec<u32>,
    near: Vec<DVec2>,
    level: f64,
}

/// Half extents of what lies within `level` of a paraboloid's plane.
pub(super) fn half(radius: f64, level: f64) -> f64 {
    (2.0 * radius * level).sqrt().min(PARABOLA * radius)
}

/// Whether a triangle holds a point, or nearly.
fn holds([a, b, c]: [DVec2; 3], point: DVec2) -> bool {
    let area = (b - a).perp_dot(c - a);
    let parts = [(a, b), (b, c), (c, a)].map(|(a, b)| (b - a).perp_dot(point - a) / area);
    area != 0.0 && parts.iter().all(|part| *part > -RIM)
}

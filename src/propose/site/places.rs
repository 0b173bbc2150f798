//! Where pads are put at a site, and from which directions they come.

use glam::DVec2;

use super::super::options::ProposeOptions;
use super::super::patch::{PatchIndex, Scratch, Touch, TurnedPad};
use crate::geometry::contains;
use crate::geometry::polygon::{self, Bounds2, rings};
use crate::model::{Patch, Polygon, Ring};

/// Corners of the overlap that turn by less are points of a tessellated curve, not places of their
/// own.
const CORNER: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Corners that turn by less are points of one line \[rad\].
const COLLINEAR: f64 = 1e-3;
/// Chords of a tessellated curve turn by less than this: twelve make a circle.
const CHORD: f64 = 31.0 * std::f64::consts::PI / 180.0;
/// Chords of one curve are no shorter than this share of each other.
const SHORT: f64 = 0.5;
/// At most this many corners of one site become positions.
const MOST_CORNERS: usize = 200;
/// At most this many edge directions of one site become approach angles (four each).
const MOST_EDGE_DIRECTIONS: usize = 4;
/// Places at which what a pad covers of an overlap is looked at, over all angles.
const COVERED: usize = 120;

/// Directions of edges modulo a right angle, in `(-45, 45]` degrees, with the length that runs along
/// each, longest first.
fn edge_directions(edges: impl Iterator<Item = DVec2>) -> Vec<(f64, f64)> {
    let right_angle = std::f64::consts::FRAC_PI_2;
    let mut found: Vec<(f64, f64)> = edges
        .map(|edge| {
            // Rounding must not move an edge at 45 degrees to the other end of the interval.
            let mut angle = edge.to_angle().rem_euclid(right_angle);
            if angle > right_angle / 2.0 + 1e-6 {
                angle -= right_angle;
            }
            (angle, edge.length())
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut merged: Vec<(f64, f64)> = Vec::new();
    for (angle, length) in found {
        match merged.last_mut() {
            Some((known, sum)) if angle - *known < 1e-3 => {
                *known = (*known * *sum + angle * length) / (*sum + length).max(f64::MIN_POSITIVE);
                *sum += length;
            }
            _ => merged.push((angle, length)),
        }
    }
    // Equal lengths, and turns to either side, must not be told apart by rounding.
    merged.sort_by(|a, b| b.1.total_cmp(&a.1));
    let turn = |angle: f64| (angle.abs() * 1e5).round();
    for equal in merged.chunk_by_mut(|a, b| b.1 > a.1 * (1.0 - 1e-5)) {
        equal.sort_by(|a, b| turn(a.0).total_cmp(&turn(b.0)).then(b.0.total_cmp(&a.0)));
    }
    merged
}

/// A straight edge of a face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    /// Unit outward normal.
    pub(super) normal: DVec2,
    /// The edge lies where `normal . x = offset` \[m\].
    pub(super) offset: f64,
    /// Length \[m\].
    pub(super) length: f64,
}

/// The edges of a boundary that are straight in the part itself, longest first: no chords of
/// a tessellated curve.
pub(super) fn straight_edges(patch: &[Polygon]) -> Vec<Edge> {
    let mut found = Vec::new();
    for ring in patch.iter().flat_map(rings) {
        // Chords along one line are one edge.
        let turn = |a: DVec2, b: DVec2, c: DVec2| (b - a).angle_to(c - b);
        let corners: Vec<DVec2> = (0..ring.len())
            .filter(|&index| {
                let before = ring[(index + ring.len() - 1) % ring.len()];
                turn(before, ring[index], ring[(index + 1) % ring.len()]).abs() > COLLINEAR
            })
            .map(|index| ring[index])
            .collect();
        let count = corners.len();
        let corner = |index: usize| corners[index % count];
        let length = |index: usize| corner(index).distance(corner(index + 1));
        for index in 0..count {
            let (a, b) = (corner(index), corner(index + 1));
            // A chord of a curve turns little into a neighbour that is no shorter by much; a
            // straight edge ends in a corner, or in chords that are much shorter.
            let ends = [
                (turn(corner(index + count - 1), a, b), length(index + count - 1)),
                (turn(a, b, corner(index + 2)), length(index + 1)),
            ];
            let chord =
                ends.iter().any(|&(turn, next)| turn.abs() < CHORD && next > SHORT * length(index));
            if !chord && a != b {
                let normal = -(b - a).perp().normalize_or_zero();
                found.push(Edge { normal, offset: normal.dot(a), length: a.distance(b) });
            }
        }
    }
    // Equally long ones by where they lie, not by where the file begins a ring; to a micrometre, so
    // that rounding does not part them.
    let key = |edge: &Edge| {
        [-edge.length, edge.normal.x, edge.normal.y, edge.offset].map(|x| (x * 1e6).round() as i64)
    };
    found.sort_by_key(key);
    found
}

/// Angle of the site's `x` in the axes of the direction: along the boundary's main direction, when
/// it has one.
pub(super) fn main_direction(overlap: &[Polygon]) -> f64 {
    let segments = overlap
        .iter()
        .flat_map(rings)
        .flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)).map(|(&a, &b)| b - a));
    let directions = edge_directions(segments);
    let perimeter: f64 = directions.iter().map(|direction| direction.1).sum();
    match directions.first() {
        Some(&(angle, length)) if length > 0.15 * perimeter => angle,
        _ => 0.0,
    }
}

/// Approach angles: uniform, and along the site's straight edges, which the uniform ones may miss.
pub(super) fn angles(edges: &[Edge], options: &ProposeOptions, pad: f64) -> Vec<f64> {
    let turn = std::f64::consts::TAU;
    let count = (turn / options.angle_step).round().max(1.0) as usize;
    let mut angles: Vec<f64> = (0..count).map(|index| turn * index as f64 / count as f64).collect();
    if options.edge_angles {
        let long = edge_directions(edges.iter().map(|edge| edge.normal.perp() * edge.length))
            .into_iter()
            .filter(|direction| direction.1 > pad / 2.0);
        for (direction, _) in long.take(MOST_EDGE_DIRECTIONS) {
            for quarter in 0..4 {
                let angle = (direction + f64::from(quarter) * turn / 4.0).rem_euclid(turn);
                let near = |known: &f64| {
                    let apart = (angle - known).rem_euclid(turn);
                    apart.min(turn - apart) < 2e-3
                };
                if !angles.iter().any(near) {
                    angles.push(angle);
                }
            }
        }
    }
    angles
}

/// The grid of a site.
#[derive(Debug)]
pub(super) struct Grid {
    /// Of the faces' overlap.
    pub(super) bounds: Bounds2,
    /// Its step \[m\].
    pub(super) spacing: f64,
    /// Steps to either side of the middle.
    half: DVec2,
    /// Its places, the first of the site's positions.
    pub(super) count: usize,
}

impl Grid {
    /// Whether `point` lies within `near` of one of its places, or of one left out for being far
    /// from the faces.
    pub(super) fn is_near(&self, point: DVec2, near: f64) -> bool {
        let steps = (point - self.bounds.centre()) / self.spacing;
        (steps - steps.round()).length() * self.spacing < near
            && steps.abs().cmple(self.half + 1e-3).all()
    }
}

/// A grid over the overlap, its corners and centroids, and the point nearest the centre of mass.
/// `reach` is half the pad's longer side: where the overlap is lower than the pad, the grid goes on
/// beyond its edges until the pad leaves as much of it uncovered as it covers: a low wall is held
/// from above by pads that stand clear of the floor.
pub(super) fn positions(
    overlap: &[Polygon],
    spacing: f64,
    reach: f64,
    centre_of_mass: DVec2,
) -> (Vec<DVec2>, Grid) {
    let bounds = polygon::bounds(overlap);
    let index = PatchIndex::new(overlap.to_vec(), bounds.grown(1.6 * reach), reach / 2.0);
    let beyond = (DVec2::splat(2.0 * reach) - bounds.size()).max(DVec2::ZERO) / 2.0;
    // The site's origin is the middle of the bounds; rounding must not cost the outermost row.
    let half = ((bounds.size() / 2.0 + beyond) / spacing + 1e-6).floor();
    let mut positions = Vec::new();
    let mut y = -half.y;
    while y <= half.y {
        let mut x = -half.x;
        while x <= half.x {
            let point = bounds.centre() + spacing * DVec2::new(x, y);
            if !index.is_far(point, reach / 2.0) {
                positions.push(point);
            }
            x += 1.0;
        }
        y += 1.0;
    }
    let grid = Grid { bounds, spacing, half, count: positions.len() };
    let mut extra: Vec<DVec2> = Vec::new();
    extra.extend(nearest(overlap, centre_of_mass));
    extra.push(polygon::patch_moments(overlap).centroid);
    if overlap.len() > 1 {
        extra.extend(overlap.iter().map(|polygon| polygon::moments(polygon).centroid));
    }
    let mut corners = Vec::new();
    for ring in overlap.iter().flat_map(rings) {
        for index in 0..ring.len() {
            let [a, b, c] = [0, 1, 2].map(|step| ring[(index + step) % ring.len()]);
            if (b - a).angle_to(c - b).abs() > CORNER {
                corners.push(b);
            }
        }
    }
    if corners.len() <= MOST_CORNERS {
        extra.extend(corners);
    }
    let near = 1e-4 * spacing;
    for point in extra {
        let useful = point.is_finite() && !index.is_far(point, reach / 2.0);
        if useful
            && !grid.is_near(point, near)
            && !positions
                .iter()
                .rev()
                .take(2 * MOST_CORNERS + 8)
                .any(|known| known.distance(point) < near)
        {
            positions.push(point);
        }
    }
    (positions, grid)
}

/// The points of the patch nearest to `point`: several, where they are equally near to a micrometre,
/// in an order of their own.
fn nearest(patch: &[Polygon], point: DVec2) -> Vec<DVec2> {
    const EQUALLY: f64 = 1e-6;
    if patch.iter().any(|polygon| contains(polygon, point)) {
        return vec![point];
    }
    let mut feet = Vec::new();
    for ring in patch.iter().flat_map(rings) {
        for (&a, &b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let t = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            feet.push(a + (b - a) * t);
        }
    }
    let least = feet.iter().map(|foot| foot.distance(point)).fold(f64::INFINITY, f64::min);
    feet.retain(|foot| foot.distance(point) <= least + EQUALLY);
    feet.sort_by_key(|foot| (foot / EQUALLY).round().to_array().map(|x| x as i64));
    feet.dedup_by(|a, b| a.distance(*b) < EQUALLY);
    feet
}

/// The largest part of an area that one of the pads covers at some places [m^2].
pub(super) fn covered(area: &Patch, pads: &[Ring; 2], places: &[DVec2], angles: &[f64]) -> f64 {
    let reach = pads.iter().flatten().map(|point| point.length()).fold(0.0, f64::max);
    let region = Bounds2::of(places).grown(reach);
    let index = PatchIndex::new(area.clone(), region, reach / 4.0);
    let mut scratch = Scratch::default();
    let pads = if pads[0] == pads[1] { &pads[..1] } else { &pads[..] };
    let step = (places.len() * angles.len() * pads.len()).div_ceil(COVERED).max(1);
    let mut most = 0.0_f64;
    for pad in
        angles.iter().flat_map(|&angle| pads.iter().map(move |pad| TurnedPad::new(pad, angle)))
    {
        for &place in places.iter().step_by(step) {
            most = most.max(match index.touch(&pad, place, &mut scratch) {
                Touch::Empty => 0.0,
                Touch::Whole => pad.area(),
                Touch::Part(area) => area,
            });
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::rectangle;

    fn shape(ring: Vec<DVec2>) -> Polygon {
        Polygon { outer: ring, holes: Vec::new() }
    }

    #[test]
    fn positions_cover_a_rectangle_and_its_special_points() {
        let face = [shape(rectangle(DVec2::new(0.1, 0.04)))];
        let (found, _) = positions(&face, 0.01, 0.01, DVec2::new(0.2, 0.003));
        // 11 x 5 grid points, corners among them; the point nearest the centre of mass is not
        assert_eq!(found.len(), 56, "{found:?}");
        assert!(found.iter().any(|point| point.distance(DVec2::new(0.05, 0.003)) < 1e-12));
    }

    #[test]
    fn a_low_face_is_held_from_beyond_its_edges() {
        // 6 mm high, pads of 20 mm: their middles go on for 7 mm above and below.
        let face = [shape(rectangle(DVec2::new(0.1, 0.006)))];
        let (found, _) = positions(&face, 1e-3, 0.01, DVec2::ZERO);
        let highest = found.iter().map(|point| point.y).fold(0.0, f64::max);
        assert!((highest - 0.010).abs() < 1e-9, "{highest}");
        assert!(found.iter().all(|point| point.x.abs() < 0.05 + 1e-9));
    }

    #[test]
    fn positions_leave_out_what_no_pad_reaches() {
        let corners = [(-1., -1.), (1., -1.), (1., -0.9), (-0.9, -0.9), (-0.9, 1.), (-1., 1.)];
        let l_shape = [shape(corners.iter().map(|&(x, y)| DVec2::new(x, y)).collect())];
        let (found, _) = positions(&l_shape, 0.05, 0.1, DVec2::ZERO);
        assert!(found.len() > 200 && found.len() < 900, "{}", found.len());
        assert!(!found.iter().any(|point| point.min_element() > -0.5));
    }

    #[test]
    fn the_main_direction_is_that_of_the_edges() {
        for degrees in [-44.0_f64, -10.0, 0.0, 10.0, 44.0] {
            let angle = degrees.to_radians();
            let turned: Vec<DVec2> = rectangle(DVec2::new(3.0, 1.0))
                .iter()
                .map(|&point| DVec2::from_angle(angle).rotate(point))
                .collect();
            assert!((main_direction(&[shape(turned)]) - angle).abs() < 1e-9, "{degrees}");
        }
        let circle: Vec<DVec2> = (0..64)
            .map(|k| DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / 64.0))
            .collect();
        assert_eq!(main_direction(&[shape(circle)]), 0.0);
        let square = [shape(
            rectangle(DVec2::ONE)
                .iter()
                .map(|&point| DVec2::from_angle(0.2).rotate(point))
                .collect(),
        )];
        let options =
            ProposeOptions { angle_step: std::f64::consts::FRAC_PI_2, ..ProposeOptions::default() };
        let found = angles(&straight_edges(&square), &options, 0.5);
        assert_eq!(found.len(), 8, "{found:?}");
        // Edges along one direction count together, from half a pad.
        let small = [shape(square[0].outer.iter().map(|point| 0.01 * point).collect())];
        for (pad, count) in [(0.079, 8), (0.081, 4)] {
            assert_eq!(angles(&straight_edges(&small), &options, pad).len(), count, "{pad}");
        }
    }

    #[test]
    fn straight_edges_are_told_from_the_chords_of_fillets() {
        // A rectangle of 40 x 20 mm with rounded corners, by chords of 15 or 30 degrees.
        let rounded = |chords: u32| {
            let quarter = std::f64::consts::FRAC_PI_2;
            let mut ring = Vec::new();
            for (k, (x, y)) in
                [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].iter().enumerate()
            {
                for step in 0..=chords {
                    let angle = quarter * (k as f64 + f64::from(step) / f64::from(chords));
                    ring.push(DVec2::new(0.015 * x, 0.005 * y) + DVec2::from_angle(angle) * 0.005);
                }
            }
            [shape(ring)]
        };
        for chords in [3, 6, 24] {
            let edges = straight_edges(&rounded(chords));
            let lengths: Vec<f64> = edges.iter().map(|edge| (edge.length * 1e5).round()).collect();
            assert_eq!(lengths, [3000.0, 3000.0, 1000.0, 1000.0], "{chords}");
            assert!((edges[0].offset - 0.01).abs() < 1e-12 && edges[0].normal.y.abs() > 0.999);
        }
        // Circles have none, a hexagon has six; points along an edge do not divide it.
        let ring = |count: u32| {
            let step = std::f64::consts::TAU / f64::from(count);
            [shape((0..count).map(|k| DVec2::from_angle(f64::from(k) * step)).collect())]
        };
        assert!(straight_edges(&ring(12)).is_empty() && straight_edges(&ring(90)).is_empty());
        assert_eq!(straight_edges(&ring(6)).len(), 6);
        // Half a disc: the chords beside its corners are chords too.
        let half: Vec<DVec2> =
            (0..=12).map(|k| DVec2::from_angle(f64::from(k) * 15_f64.to_radians())).collect();
        let edges = straight_edges(&[shape(half)]);
        assert!(edges.len() == 1 && (edges[0].length - 2.0).abs() < 1e-12, "{edges:?}");
        let mut divided = rectangle(DVec2::new(4.0, 2.0));
        divided.insert(1, DVec2::new(1.3, -1.0));
        assert_eq!(straight_edges(&[shape(divided)]).len(), 4);
    }
}

//! The places that matter besides the grid's, at one angle: rows of pads flush with a straight edge
//! of the faces, just clear of what rises beyond such an edge, of the ground and of keep-out boxes.
//!
//! The grid only refines what these find: a plate on a table is held by pads just clear of the
//! table, wherever the grid's rows lie.

use glam::DVec2;

use super::places::{Edge, Grid};
use crate::clash::{Phase, Sweep};
use crate::geometry::Bounds2;
use crate::model::{Patch, Ring};
use crate::propose::environment::Border;
use crate::propose::patch::{PatchIndex, Scratch, Touch, TurnedPad};

/// Edges of pad and face whose directions differ by less are flush \[rad\].
const FLUSH: f64 = 2e-3;
/// At most this many lines of one kind at one angle, the longest edges first.
const MOST_LINES: usize = 8;
/// Lines whose directions differ by less have no crossing worth trying (sine of the angle).
const CROSSING: f64 = 0.2;
/// Clear of a border by this much, which rounding cannot take away \[m\].
const CLEAR: f64 = 1e-6;
/// A finger that stands out beyond the pad by more is tried by itself \[m\].
const STANDS_OUT: f64 = 1e-6;

/// What the special places of a site follow from.
#[derive(Debug)]
pub(super) struct Landmarks<'a> {
    /// The faces' overlap in the site's `(x, y)`.
    pub(super) overlap: &'a Patch,
    pub(super) grid: &'a Grid,
    /// The places tried at every angle.
    pub(super) positions: &'a [DVec2],
    /// Straight edges of the overlap, longest first.
    pub(super) edges: &'a [Edge],
    /// Places whose feet on the lines are tried: centre of mass, centroid, middle.
    pub(super) points: [DVec2; 3],
}

/// All places with `normal . place = offset`.
#[derive(Debug, Clone, Copy)]
struct Line {
    normal: DVec2,
    offset: f64,
    /// Whether places all along it are tried, a grid's step apart: where it is a border of what is
    /// free. A pad flush with an edge is not far from the grid's.
    row: bool,
}

impl Line {
    fn foot(self, point: DVec2) -> DVec2 {
        point + self.normal * (self.offset - self.normal.dot(point))
    }

    fn crossing(self, other: Self) -> Option<DVec2> {
        let sine = self.normal.perp_dot(other.normal);
        (sine.abs() > CROSSING).then(|| {
            DVec2::new(
                self.offset * other.normal.y - other.offset * self.normal.y,
                other.offset * self.normal.x - self.offset * other.normal.x,
            ) / sine
        })
    }
}

/// The gripper at one angle, one way round.
pub(super) struct Posture<'a> {
    pub(super) angle: f64,
    /// The pads' outlines, not turned; one where both are the same.
    pub(super) pads: &'a [Ring],
    /// What the fingers sweep while closing, grip frame.
    pub(super) sweeps: &'a [Sweep],
    /// Borders of ground and keep-out boxes for the grip origin.
    pub(super) borders: &'a [Border],
}

/// Keeps the index of the overlap from one angle to the next.
#[derive(Default)]
pub(super) struct Room {
    index: Option<PatchIndex>,
    scratch: Scratch,
}

impl Landmarks<'_> {
    /// Adds to `found` the special places of a posture at which the pad touches the overlap.
    pub(super) fn places(&self, posture: &Posture<'_>, room: &mut Room, found: &mut Vec<DVec2>) {
        let lines = self.lines(posture);
        if lines.is_empty() {
            return;
        }
        let pads: Vec<TurnedPad> =
            posture.pads.iter().map(|pad| TurnedPad::new(pad, posture.angle)).collect();
        let reach = posture.pads.iter().flatten().map(|point| point.length()).fold(0.0, f64::max);
        let region = self.grid.bounds.grown(1.01 * reach);
        let index = room.index.get_or_insert_with(|| {
            PatchIndex::new(self.overlap.clone(), region.grown(1.01 * reach), reach / 4.0)
        });
        let spacing = self.grid.spacing;
        let steps = (region.size().length() / 2.0 / spacing).ceil();
        let near = 1e-4 * spacing;
        let mut add = |place: DVec2, found: &mut Vec<DVec2>| {
            let known = |known: &DVec2| known.distance(place) < near;
            let others = if self.grid.is_near(place, near) { 0 } else { self.grid.count };
            if place.clamp(region.min, region.max) == place
                && !found.iter().any(known)
                && !self.positions[others..].iter().any(known)
                && pads.iter().all(|pad| index.touch(pad, place, &mut room.scratch) != Touch::Empty)
            {
                found.push(place);
            }
        };
        for (number, line) in lines.iter().enumerate() {
            for point in self.points {
                add(line.foot(point), found);
            }
            for other in &lines[number + 1..] {
                if let Some(place) = line.crossing(*other) {
                    add(place, found);
                }
            }
        }
        for line in lines.iter().filter(|line| line.row) {
            let (middle, along) = (line.foot(self.grid.bounds.centre()), line.normal.perp());
            let mut step = -steps;
            while step <= steps {
                add(middle + along * (step * spacing), found);
                step += 1.0;
            }
        }
    }

    fn lines(&self, posture: &Posture<'_>) -> Vec<Line> {
        let mut lines: Vec<Line> = posture
            .borders
            .iter()
            .map(|border| Line { normal: border.normal, offset: border.offset + CLEAR, row: true })
            .collect();
        for pad in posture.pads {
            self.lines_along_edges(posture, pad, &mut lines);
        }
        lines
    }

    /// Lines of places at which a pad lies flush with a straight edge, or its finger just clear of
    /// it.
    fn lines_along_edges(&self, posture: &Posture<'_>, ring: &[DVec2], lines: &mut Vec<Line>) {
        let turn = DVec2::from_angle(posture.angle);
        let sides: Vec<DVec2> = ring
            .iter()
            .zip(ring.iter().cycle().skip(1))
            .map(|(&a, &b)| turn.rotate(-(b - a).perp().normalize_or_zero()))
            .collect();
        let parallel = |normal: DVec2| {
            sides.iter().any(|side| side.dot(normal) > 0.0 && side.perp_dot(normal).abs() < FLUSH)
        };
        let (mut flush, mut clear) = (0, 0);
        for edge in self.edges.iter().filter(|edge| parallel(edge.normal)) {
            let direction = DVec2::from_angle(-posture.angle).rotate(edge.normal);
            let reach = ring.iter().map(|point| point.dot(direction)).fold(0.0, f64::max);
            if flush < MOST_LINES {
                lines.push(Line { normal: edge.normal, offset: edge.offset - reach, row: false });
                flush += 1;
            }
            // What rises beyond the edge: the fingers stay clear of it. From behind they come.
            let finger = posture
                .sweeps
                .iter()
                .filter(|sweep| sweep.phase == Phase::Grip && !sweep.jaw.is_empty())
                .map(|sweep| {
                    let direction = direction.extend(0.0);
                    sweep.support_point(direction).dot(direction)
                })
                .fold(0.0, f64::max);
            if direction.x > -0.5 && finger > reach + STANDS_OUT && clear < MOST_LINES {
                lines.push(Line {
                    normal: edge.normal,
                    offset: edge.offset - finger - CLEAR,
                    row: true,
                });
                clear += 1;
            }
        }
    }
}

/// Bounds of the places.
pub(super) fn bounds(places: &[Vec<DVec2>]) -> Option<Bounds2> {
    places
        .iter()
        .filter(|places| !places.is_empty())
        .map(Bounds2::of)
        .reduce(|sum, next| sum.union(next))
}

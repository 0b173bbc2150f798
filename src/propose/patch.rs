//! Where a pad touches a face: classification and exact clipping of a convex pad against the face's
//! boundary.
//!
//! Most pads of a dense set lie wholly inside a face or wholly beside it. A grid over the boundary
//! answers those with four look-ups, so that only pads over an edge are clipped, and those against
//! the few edges near them. The clipping follows the boundary in and out of the pad (Weiler and
//! Atherton 1977, for a convex window), which gives proper polygons with holes; where the geometry
//! is too nearly degenerate for that, the boolean operation of the library.

mod pad;
mod walk;

use glam::DVec2;

pub(super) use pad::TurnedPad;
use pad::{FLUSH, Piece, clip_edge};
use walk::outline;

use crate::geometry::overlay;
use crate::geometry::polygon::{self, Bounds2, rings};
use crate::model::{Patch, Ring};

/// Pieces with less area than this share of their bounding square are rounding (as in [`overlay`]).
const SLIVER: f64 = 1e-6;
/// Cells of the grid per axis, at most.
const MOST_CELLS: usize = 400;

/// How a pad meets a face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Touch {
    /// Not at all.
    Empty,
    /// The whole pad lies on the face.
    Whole,
    /// Part of it does, with this area [m^2]; [`PatchIndex::outline`] gives its shape.
    Part(f64),
}

/// Buffers of one thread.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    seen: Vec<u32>,
    epoch: u32,
    pieces: Vec<Piece>,
    piece_of_edge: Vec<u32>,
    events: Vec<Event>,
    visited: Vec<bool>,
    points: Vec<DVec2>,
    /// End of each loop in `points`.
    ends: Vec<usize>,
    /// Outline from the library, where the walk gave up.
    fallback: Option<Patch>,
}

/// A crossing of the window's outline, by position along it.
#[derive(Debug, Clone, Copy)]
struct Event {
    side: usize,
    along: f64,
    piece: u32,
    entry: bool,
}

/// A face, or coplanar faces, as boundary edges with a grid over them.
#[derive(Debug)]
pub(super) struct PatchIndex {
    polygons: Patch,
    /// Edge `i` runs from `start[i]` to `start[next[i]]`.
    start: Vec<DVec2>,
    next: Vec<u32>,
    grid: Grid,
    /// Edges of each cell: `edges[first[cell]..first[cell + 1]]`.
    first: Vec<u32>,
    edges: Vec<u32>,
    /// `sums[(y, x)]`: entries of all cells below `(x, y)`.
    sums: Vec<u32>,
    /// Whether a cell's centre lies inside (meant for cells without edges).
    inside: Vec<bool>,
    /// Edges that pass the height of each row, anywhere.
    row_first: Vec<u32>,
    row_edges: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Grid {
    origin: DVec2,
    cell: f64,
    nx: usize,
    ny: usize,
}

impl Grid {
    fn column(&self, x: f64) -> usize {
        (((x - self.origin.x) / self.cell).max(0.0) as usize).min(self.nx - 1)
    }

    fn row(&self, y: f64) -> usize {
        (((y - self.origin.y) / self.cell).max(0.0) as usize).min(self.ny - 1)
    }

    fn bounds(&self) -> Bounds2 {
        Bounds2 {
            min: self.origin,
            max: self.origin + self.cell * DVec2::new(self.nx as f64, self.ny as f64),
        }
    }

    /// Whether anything within `bounds` may lie in the grid.
    fn covers(&self, bounds: Bounds2) -> bool {
        bounds.min.cmplt(self.bounds().max).all() && bounds.max.cmpgt(self.origin).all()
    }

    /// Whether all of `bounds` lies in the grid.
    fn holds(&self, bounds: Bounds2) -> bool {
        bounds.min.cmpge(self.origin).all() && bounds.max.cmple(self.bounds().max).all()
    }
}

impl PatchIndex {
    /// Indexes normalised `polygons` for queries within `region`, with cells of about `cell` \[m\].
    pub(super) fn new(polygons: Patch, region: Bounds2, cell: f64) -> Self {
        let (mut start, mut next) = (Vec::new(), Vec::new());
        for ring in polygons.iter().flat_map(rings) {
            let base = start.len();
            start.extend_from_slice(ring);
            next.extend((0..ring.len()).map(|index| (base + (index + 1) % ring.len()) as u32));
        }
        let size = region.size().max(DVec2::splat(1e-9));
        let cell = cell.max(size.max_element() / MOST_CELLS as f64);
        let cells = |length: f64| ((length / cell).ceil() as usize).max(1);
        let grid = Grid { origin: region.min, cell, nx: cells(size.x), ny: cells(size.y) };

        let mut by_cell: Vec<(u32, u32)> = Vec::new();
        let mut by_row: Vec<(u32, u32)> = Vec::new();
        for (edge, (&a, &next)) in start.iter().zip(&next).enumerate() {
            let b = start[next as usize];
            let bounds = Bounds2 { min: a.min(b), max: a.max(b) };
            let height = Bounds2 {
                min: DVec2::new(grid.origin.x, bounds.min.y),
                max: DVec2::new(grid.origin.x + cell, bounds.max.y),
            };
            if !grid.covers(height) {
                continue;
            }
            let (low, high) = (grid.row(bounds.min.y), grid.row(bounds.max.y));
            by_row.extend((low..=high).map(|row| (row as u32, edge as u32)));
            if !grid.covers(bounds) {
                continue;
            }
            for row in low..=high {
                // The stretch of the edge within this row (with a hair of slack) bounds its
                // columns.
                let slack = 1e-6 * cell;
                let (y0, y1) = (
                    grid.origin.y + row as f64 * cell - slack,
                    grid.origin.y + (row + 1) as f64 * cell + slack,
                );
                let at = |y: f64| {
                    if (b.y - a.y).abs() < slack {
                        None
                    } else {
                        Some(a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0))
                    }
                };
                let (x0, x1) = match (at(y0), at(y1)) {
                    (Some(x0), Some(x1)) => (x0.min(x1), x0.max(x1)),
                    _ => (bounds.min.x, bounds.max.x),
                };
                by_cell.extend(
                    (grid.column(x0 - slack)..=grid.column(x1 + slack))
                        .map(|column| ((row * grid.nx + column) as u32, edge as u32)),
                );
            }
        }
        let (first, edges) = bucket(by_cell, grid.nx * grid.ny);
        let (row_first, row_edges) = bucket(by_row, grid.ny);
        let mut sums = vec![0_u32; (grid.nx + 1) * (grid.ny + 1)];
        for y in 0..grid.ny {
            let mut run = 0;
            for x in 0..grid.nx {
                let cell = y * grid.nx + x;
                run += first[cell + 1] - first[cell];
                sums[(y + 1) * (grid.nx + 1) + x + 1] = sums[y * (grid.nx + 1) + x + 1] + run;
            }
        }
        let mut index = Self {
            polygons,
            start,
            next,
            grid,
            first,
            edges,
            sums,
            inside: Vec::new(),
            row_first,
            row_edges,
        };
        index.inside = index.fill();
        index
    }

    /// Even-odd state of all cell centres, row by row.
    fn fill(&self) -> Vec<bool> {
        let mut inside = vec![false; self.grid.nx * self.grid.ny];
        let mut crossings = Vec::new();
        for row in 0..self.grid.ny {
            let y = self.grid.origin.y + (row as f64 + 0.5) * self.grid.cell;
            crossings.clear();
            for &edge in self.row(row) {
                let (a, b) = self.ends(edge);
                if (a.y > y) != (b.y > y) {
                    crossings.push(a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for column in 0..self.grid.nx {
                let x = self.grid.origin.x + (column as f64 + 0.5) * self.grid.cell;
                inside[row * self.grid.nx + column] =
                    crossings.partition_point(|&crossing| crossing < x) % 2 == 1;
            }
        }
        inside
    }

    fn row(&self, row: usize) -> &[u32] {
        &self.row_edges[self.row_first[row] as usize..self.row_first[row + 1] as usize]
    }

    fn ends(&self, edge: u32) -> (DVec2, DVec2) {
        (self.start[edge as usize], self.start[self.next[edge as usize] as usize])
    }

    /// Even-odd membership with exact predicates, by the edges of one row. `point` must lie in the
    /// region.
    pub(super) fn contains(&self, point: DVec2) -> bool {
        self.row(self.grid.row(point.y)).iter().fold(false, |inside, &edge| {
            let (a, b) = self.ends(edge);
            inside ^ polygon::crosses_right(a, b, point)
        })
    }

    /// Whether the square of half side `reach` about `point` certainly holds nothing of the patch.
    pub(super) fn is_far(&self, point: DVec2, reach: f64) -> bool {
        let [x0, x1, y0, y1] = self.cells(Bounds2 { min: point - reach, max: point + reach });
        self.edges_in(x0, x1, y0, y1) == 0 && !self.inside[y0 * self.grid.nx + x0]
    }

    fn cells(&self, bounds: Bounds2) -> [usize; 4] {
        [
            self.grid.column(bounds.min.x),
            self.grid.column(bounds.max.x),
            self.grid.row(bounds.min.y),
            self.grid.row(bounds.max.y),
        ]
    }

    fn edges_in(&self, x0: usize, x1: usize, y0: usize, y1: usize) -> u32 {
        let sum = |x: usize, y: usize| self.sums[y * (self.grid.nx + 1) + x];
        sum(x1 + 1, y1 + 1) + sum(x0, y0) - sum(x0, y1 + 1) - sum(x1 + 1, y0)
    }

    /// How the pad, its origin at `place`, meets the patch.
    pub(super) fn touch(&self, pad: &TurnedPad, place: DVec2, scratch: &mut Scratch) -> Touch {
        let bounds = Bounds2 { min: pad.bounds.min + place, max: pad.bounds.max + place };
        if !self.grid.holds(bounds) {
            return self.touch_outside(pad, place, scratch);
        }
        let [x0, x1, y0, y1] = self.cells(bounds);
        if self.edges_in(x0, x1, y0, y1) == 0 {
            return if self.inside[y0 * self.grid.nx + x0] { Touch::Whole } else { Touch::Empty };
        }
        self.collect_pieces(pad, place, [x0, x1, y0, y1], scratch);
        if scratch.pieces.is_empty() {
            // The middle of the pad is an inner point, so no edge passes through it.
            let middle = pad.ring.iter().sum::<DVec2>() / pad.ring.len() as f64 + place;
            return if self.contains(middle) { Touch::Whole } else { Touch::Empty };
        }
        scratch.fallback = None;
        let area = self.area(pad, place, scratch).unwrap_or_else(|| {
            let patch = self.clipped_by_library(&pad.window, place);
            polygon::patch_area(scratch.fallback.insert(patch))
        });
        if area <= SLIVER * pad.area { Touch::Empty } else { Touch::Part(area) }
    }

    /// The shape of the contact after [`Touch::Part`] with the same pad, place and scratch, as
    /// proper polygons relative to the pad's origin and turned by `-angle`, that is in the grip
    /// frame.
    pub(super) fn outline(
        &self,
        pad: &TurnedPad,
        place: DVec2,
        scratch: &mut Scratch,
        angle: f64,
    ) -> Patch {
        if scratch.fallback.is_none() && !self.walk(pad, place, scratch) {
            scratch.fallback = Some(self.clipped_by_library(&pad.window, place));
        }
        outline(scratch, angle)
    }

    /// The answer for a pad that reaches out of the region: a user's question, not one of a dense
    /// set.
    fn touch_outside(&self, pad: &TurnedPad, place: DVec2, scratch: &mut Scratch) -> Touch {
        let patch = self.clipped_by_library(&pad.ring, place);
        let area = polygon::patch_area(&patch);
        scratch.fallback = Some(patch);
        if area >= (1.0 - FLUSH) * pad.area {
            Touch::Whole
        } else if area > SLIVER * pad.area {
            Touch::Part(area)
        } else {
            Touch::Empty
        }
    }

    /// Intersection with `window` put at `place`, relative to `place`.
    fn clipped_by_library(&self, window: &[DVec2], place: DVec2) -> Patch {
        let ring: Ring = window.iter().map(|&point| point + place).collect();
        let back = glam::DAffine2::from_translation(-place);
        overlay::intersect_convex(&ring, &self.polygons)
            .iter()
            .map(|polygon| polygon::transform(polygon, &back))
            .collect()
    }

    /// Edges near the pad, each clipped to the window (Cyrus and Beck 1978), relative to `place`.
    fn collect_pieces(
        &self,
        pad: &TurnedPad,
        place: DVec2,
        [x0, x1, y0, y1]: [usize; 4],
        scratch: &mut Scratch,
    ) {
        if scratch.seen.len() < self.start.len() {
            scratch.seen.resize(self.start.len(), 0);
            scratch.piece_of_edge.resize(self.start.len(), 0);
        }
        if scratch.epoch == u32::MAX {
            scratch.seen.fill(0);
            scratch.epoch = 0;
        }
        scratch.epoch += 1;
        scratch.pieces.clear();
        for row in y0..=y1 {
            let cells = row * self.grid.nx;
            let span = self.first[cells + x0] as usize..self.first[cells + x1 + 1] as usize;
            for &edge in &self.edges[span] {
                if scratch.seen[edge as usize] == scratch.epoch {
                    continue;
                }
                scratch.seen[edge as usize] = scratch.epoch;
                let (a, b) = self.ends(edge);
                if let Some(piece) = clip_edge(edge, a - place, b - place, &pad.sides) {
                    scratch.piece_of_edge[edge as usize] = scratch.pieces.len() as u32;
                    scratch.pieces.push(piece);
                } else {
                    scratch.piece_of_edge[edge as usize] = u32::MAX;
                }
            }
        }
    }
}

/// Sorts `(bucket, value)` pairs into `count` buckets: offsets and values.
fn bucket(pairs: Vec<(u32, u32)>, count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0_u32; count + 1];
    for &(bucket, _) in &pairs {
        first[bucket as usize + 1] += 1;
    }
    for index in 0..count {
        first[index + 1] += first[index];
    }
    let mut fill = first.clone();
    let mut values = vec![0; pairs.len()];
    for (bucket, value) in pairs {
        let slot = &mut fill[bucket as usize];
        values[*slot as usize] = value;
        *slot += 1;
    }
    (first, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{intersect_convex, patch_area, ring_area};
    use crate::gripper::rectangle;
    use crate::model::Polygon;
    use proptest::prelude::*;

    fn index(polygons: Patch) -> PatchIndex {
        PatchIndex::new(polygons, Bounds2 { min: DVec2::splat(-3.0), max: DVec2::splat(3.0) }, 0.1)
    }

    fn touch(index: &PatchIndex, pad: &TurnedPad, place: DVec2) -> (f64, Patch) {
        let mut scratch = Scratch::default();
        match index.touch(pad, place, &mut scratch) {
            Touch::Empty => (0.0, Patch::new()),
            Touch::Whole => {
                (pad.area(), vec![Polygon { outer: pad.ring.clone(), holes: Vec::new() }])
            }
            Touch::Part(area) => (area, index.outline(pad, place, &mut scratch, 0.0)),
        }
    }

    #[test]
    fn flush_pads_touch_wholly() {
        let face =
            index(vec![Polygon { outer: rectangle(DVec2::new(4.0, 1.0)), holes: Vec::new() }]);
        let pad = TurnedPad::new(&rectangle(DVec2::new(1.0, 1.0)), 0.0);
        let mut scratch = Scratch::default();
        for x in [-1.5, -0.3, 0.0, 1.5] {
            assert_eq!(face.touch(&pad, DVec2::new(x, 0.0), &mut scratch), Touch::Whole);
        }
        assert_eq!(face.touch(&pad, DVec2::new(0.0, 1.0), &mut scratch), Touch::Empty);
        let (area, patch) = touch(&face, &pad, DVec2::new(1.75, 0.25));
        assert!(
            (area - 0.75 * 0.75).abs() < 1e-8 && patch.len() == 1 && patch[0].outer.len() == 4,
            "{patch:?}"
        );
    }

    #[test]
    fn holes_and_islands() {
        let hole: Ring = rectangle(DVec2::splat(0.4)).into_iter().rev().collect();
        let plate = Polygon { outer: rectangle(DVec2::splat(4.0)), holes: vec![hole] };
        let island = Polygon { outer: rectangle(DVec2::splat(0.2)), holes: Vec::new() };
        let face = index(vec![plate, island]);
        let pad = TurnedPad::new(&rectangle(DVec2::ONE), 0.3);
        let (area, patch) = touch(&face, &pad, DVec2::new(0.05, 0.0));
        assert!((area - (1.0 - 0.16 + 0.04)).abs() < 1e-8, "{area}");
        assert_eq!((patch.len(), patch.iter().map(|p| p.holes.len()).sum::<usize>()), (2, 1));
        assert!((patch_area(&patch) - area).abs() < 1e-12);
        // half over the hole: one polygon with a notch
        let (_, notch) = touch(&index(vec![face.polygons[0].clone()]), &pad, DVec2::new(0.5, 0.0));
        assert_eq!((notch.len(), notch[0].holes.len()), (1, 0));
    }

    #[test]
    fn a_pad_out_of_the_region_is_answered_too() {
        let face = PatchIndex::new(
            vec![Polygon { outer: rectangle(DVec2::splat(9.0)), holes: Vec::new() }],
            Bounds2 { min: DVec2::ZERO, max: DVec2::ONE },
            0.1,
        );
        let pad = TurnedPad::new(&rectangle(DVec2::ONE), 0.0);
        let mut scratch = Scratch::default();
        assert_eq!(face.touch(&pad, DVec2::splat(3.0), &mut scratch), Touch::Whole);
        assert_eq!(face.touch(&pad, DVec2::splat(30.0), &mut scratch), Touch::Empty);
        let Touch::Part(area) = face.touch(&pad, DVec2::new(-4.5, 0.0), &mut scratch) else {
            panic!("half of the pad")
        };
        assert!(
            (area - 0.5).abs() < 1e-12
                && (patch_area(&face.outline(&pad, DVec2::new(-4.5, 0.0), &mut scratch, 1.0))
                    - 0.5)
                    .abs()
                    < 1e-12
        );
    }

    fn star(count: std::ops::Range<usize>, low: f64, high: f64) -> impl Strategy<Value = Ring> {
        proptest::collection::vec(low..high, count).prop_map(|radii| {
            let step = std::f64::consts::TAU / radii.len() as f64;
            radii
                .iter()
                .enumerate()
                .map(|(index, radius)| DVec2::from_angle(index as f64 * step) * *radius)
                .collect()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        /// Edges, corners and pads all on one lattice: every kind of coincidence there is.
        #[test]
        fn coincident_edges_and_corners(boxes in proptest::collection::vec((-6..6_i32, -6..6_i32, 1..6_i32, 1..6_i32), 1..6), pad in (1..5_i32, 1..5_i32), place in (-8..8_i32, -8..8_i32), eighth in 0..8_i32) {
            let corner = |x: i32, y: i32| DVec2::new(f64::from(x), f64::from(y)) / 4.0;
            let rings: Vec<Ring> = boxes.iter().map(|&(x, y, w, h)| vec![corner(x, y), corner(x + w, y), corner(x + w, y + h), corner(x, y + h)]).collect();
            let mended = overlay::even_odd(&rings);
            let face = index(mended.clone());
            let pad = TurnedPad::new(&rectangle(corner(pad.0, pad.1)), f64::from(eighth) * std::f64::consts::FRAC_PI_4);
            let place = corner(place.0, place.1) / 2.0;
            let (area, patch) = touch(&face, &pad, place);
            let ring: Ring = pad.ring.iter().map(|&point| point + place).collect();
            let clipped: f64 = mended.iter().flat_map(rings_of).map(|r| ring_area(&crate::geometry::clip_ring_convex(r, &ring))).sum();
            prop_assert!((area - clipped).abs() < 1e-7, "{} {}", area, clipped);
            prop_assert!((area - patch_area(&patch)).abs() < 1e-7, "{} {:?}", area, patch);
            for polygon in &patch {
                prop_assert!(ring_area(&polygon.outer) > 0.0 && polygon.holes.iter().all(|hole| ring_area(hole) < 0.0));
            }
        }
    }

    fn rings_of(polygon: &Polygon) -> impl Iterator<Item = &[DVec2]> {
        rings(polygon)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]
        #[test]
        fn clipping_agrees_with_the_library(outer in star(3..30, 1.0, 2.0), hole in star(3..12, 0.1, 0.9), angle in 0.0..6.3f64, x in -2.0..2.0f64, y in -2.0..2.0f64, w in 0.05..2.0f64) {
            let mut polygon = Polygon { outer, holes: vec![hole] };
            // The star's chords may cut below the hole's radius: the common part of both is what
            // even-odd makes of them.
            let mended = overlay::even_odd(&[std::mem::take(&mut polygon.outer), polygon.holes.remove(0)]);
            let face = index(mended.clone());
            let pad = TurnedPad::new(&rectangle(DVec2::new(w, 0.7)), angle);
            let place = DVec2::new(x, y);
            let (area, patch) = touch(&face, &pad, place);
            let ring: Ring = pad.ring.iter().map(|&point| point + place).collect();
            let expected = intersect_convex(&ring, &mended);
            prop_assert!((area - patch_area(&expected)).abs() < 1e-5 * w, "{area} {}", patch_area(&expected));
            prop_assert!((area - patch_area(&patch)).abs() < 1e-5 * w, "{area} {}", patch_area(&patch));
            let clipped: f64 = mended.iter().flat_map(rings).map(|r| ring_area(&crate::geometry::clip_ring_convex(r, &ring))).sum();
            prop_assert!((area - clipped).abs() < 1e-5 * w);
            // What counts as a sliver differs a little between the two.
            let count = |patch: &Patch| patch.iter().filter(|polygon| polygon::area(polygon) > 1e-3 * w).count();
            prop_assert_eq!(count(&patch), count(&expected));
        }
    }
}

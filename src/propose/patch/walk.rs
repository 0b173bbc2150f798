//! From clipped edges to proper polygons: following the boundary in and out of the pad.

use glam::DVec2;

use super::pad::TurnedPad;
use super::{Event, PatchIndex, SLIVER, Scratch};
use crate::geometry::{Bounds2, contains, ring_area};
use crate::model::{Patch, Polygon, Ring};

impl PatchIndex {
    /// Area of the patch in the window from the collected pieces, by Green's theorem: the pieces,
    /// and the stretches of the window's outline between an exit and the next entry. `None` when
    /// the crossings do not alternate or two of them coincide, where rounding could have mixed them
    /// up.
    pub(super) fn area(&self, pad: &TurnedPad, place: DVec2, scratch: &mut Scratch) -> Option<f64> {
        scratch.events.clear();
        let along = |side: usize, point: DVec2| {
            let (a, b) = (pad.window[side], pad.window[(side + 1) % pad.window.len()]);
            (point - a).dot(b - a) / (b - a).length_squared()
        };
        for (index, piece) in scratch.pieces.iter().enumerate() {
            for (side, point, entry) in
                [(piece.entry, piece.start, true), (piece.exit, piece.end, false)]
            {
                if let Some(side) = side {
                    scratch.events.push(Event {
                        side,
                        along: along(side, point),
                        piece: index as u32,
                        entry,
                    });
                }
            }
        }
        scratch.events.sort_by(|a, b| a.side.cmp(&b.side).then(a.along.total_cmp(&b.along)));
        let count = scratch.events.len();
        for index in 0..count {
            let (event, following) = (scratch.events[index], scratch.events[(index + 1) % count]);
            let tied = count > 1
                && event.side == following.side
                && (event.along - following.along).abs() < 1e-12;
            if event.entry == following.entry || tied {
                return None;
            }
        }
        let mut twice: f64 =
            scratch.pieces.iter().map(|piece| piece.start.perp_dot(piece.end)).sum();
        for (index, from) in scratch.events.iter().enumerate().filter(|(_, event)| !event.entry) {
            let to = &scratch.events[(index + 1) % count];
            let mut at = scratch.pieces[from.piece as usize].end;
            for corner in corners_between(pad, from, to) {
                twice += at.perp_dot(corner);
                at = corner;
            }
            twice += at.perp_dot(scratch.pieces[to.piece as usize].start);
        }
        // Without a crossing, the outline itself bounds the contact when its corner lies on the
        // face.
        if count == 0 && self.contains(pad.window[0] + place) {
            twice += 2.0 * ring_area(&pad.window);
        }
        Some(twice / 2.0)
    }

    /// Joins the pieces that [`PatchIndex::area`] has sorted along the window's outline to closed
    /// loops; `false` where they do not join.
    pub(super) fn walk(&self, pad: &TurnedPad, place: DVec2, scratch: &mut Scratch) -> bool {
        scratch.points.clear();
        scratch.ends.clear();
        let count = scratch.events.len();
        scratch.visited.clear();
        scratch.visited.resize(scratch.pieces.len(), false);
        // Loops that cross the outline.
        for first in 0..count {
            let event = scratch.events[first];
            if !event.entry || scratch.visited[event.piece as usize] {
                continue;
            }
            let mut piece = event.piece;
            loop {
                // From a piece with an exit, on along the outline to the next entry.
                let Some(last) = self.follow(piece, scratch) else { return false };
                let Some(exit) =
                    scratch.events.iter().position(|event| !event.entry && event.piece == last)
                else {
                    return false;
                };
                let (from, to) = (scratch.events[exit], scratch.events[(exit + 1) % count]);
                scratch.points.extend(corners_between(pad, &from, &to));
                piece = to.piece;
                if piece == event.piece {
                    break;
                }
                if scratch.visited[piece as usize] {
                    return false;
                }
            }
            scratch.ends.push(scratch.points.len());
        }
        // Loops wholly inside the window.
        let crossed = count > 0;
        let mut has_inner = false;
        for index in 0..scratch.pieces.len() as u32 {
            if scratch.visited[index as usize] {
                continue;
            }
            if scratch.pieces[index as usize].entry.is_some() || !self.follow_closed(index, scratch)
            {
                return false;
            }
            scratch.ends.push(scratch.points.len());
            has_inner = true;
        }
        // Without a crossing, the outline itself bounds the contact when its corner lies on the
        // face.
        if !crossed && has_inner && self.contains(pad.window[0] + place) {
            scratch.points.extend_from_slice(&pad.window);
            scratch.ends.push(scratch.points.len());
        }
        true
    }

    /// Appends the chain of pieces that starts at `piece` up to its exit point; the last piece.
    fn follow(&self, mut piece: u32, scratch: &mut Scratch) -> Option<u32> {
        loop {
            let current = scratch.pieces[piece as usize];
            if std::mem::replace(&mut scratch.visited[piece as usize], true) {
                return None;
            }
            scratch.points.push(current.start);
            if current.exit.is_some() {
                scratch.points.push(current.end);
                return Some(piece);
            }
            piece = self.next_piece(current.edge, scratch)?;
        }
    }

    /// Appends the closed chain of whole edges through `first`.
    fn follow_closed(&self, first: u32, scratch: &mut Scratch) -> bool {
        let mut piece = first;
        loop {
            let current = scratch.pieces[piece as usize];
            if current.entry.is_some()
                || current.exit.is_some()
                || std::mem::replace(&mut scratch.visited[piece as usize], true)
            {
                return false;
            }
            scratch.points.push(current.start);
            match self.next_piece(current.edge, scratch) {
                Some(next) if next == first => return true,
                Some(next) => piece = next,
                None => return false,
            }
        }
    }

    /// The piece of the edge after `edge`, when it starts inside the window.
    fn next_piece(&self, edge: u32, scratch: &Scratch) -> Option<u32> {
        let next = self.next[edge as usize] as usize;
        let piece = (scratch.seen[next] == scratch.epoch).then(|| scratch.piece_of_edge[next])?;
        (piece != u32::MAX && scratch.pieces[piece as usize].entry.is_none()).then_some(piece)
    }
}

/// Corners of the window passed on the way along its outline from one crossing to another.
fn corners_between<'p>(
    pad: &'p TurnedPad,
    from: &Event,
    to: &Event,
) -> impl Iterator<Item = DVec2> + use<'p> {
    let sides = pad.window.len();
    let mut steps = (to.side + sides - from.side) % sides;
    if steps == 0 && to.along < from.along {
        steps = sides;
    }
    let first = from.side;
    (1..=steps).map(move |step| pad.window[(first + step) % sides])
}

/// The loops of the last walk, or the library's outline, as proper polygons, relative to the pad's
/// origin and turned by `-angle`, that is in the grip frame.
pub(super) fn outline(scratch: &Scratch, angle: f64) -> Patch {
    let turn = DVec2::from_angle(-angle);
    let turned =
        |ring: &[DVec2]| -> Ring { ring.iter().map(|&point| turn.rotate(point)).collect() };
    if let Some(patch) = &scratch.fallback {
        return patch
            .iter()
            .map(|polygon| Polygon {
                outer: turned(&polygon.outer),
                holes: polygon.holes.iter().map(|hole| turned(hole)).collect(),
            })
            .collect();
    }
    let solid = |ring: &&[DVec2]| {
        let size = Bounds2::of(*ring).size().max_element();
        ring_area(ring).abs() > SLIVER * size * size
    };
    let (outer, holes): (Vec<&[DVec2]>, Vec<&[DVec2]>) =
        loops(scratch).filter(solid).partition(|ring| ring_area(ring) > 0.0);
    let mut patch: Patch =
        outer.iter().map(|ring| Polygon { outer: ring.to_vec(), holes: Vec::new() }).collect();
    for hole in holes {
        // The smallest outer loop around it: islands may lie in holes.
        let around = (0..patch.len()).filter(|&index| {
            contains(&Polygon { outer: outer[index].to_vec(), holes: Vec::new() }, hole[0])
        });
        if let Some(index) =
            around.min_by(|&a, &b| ring_area(outer[a]).total_cmp(&ring_area(outer[b])))
        {
            patch[index].holes.push(hole.to_vec());
        }
    }
    for polygon in &mut patch {
        polygon.outer = turned(&polygon.outer);
        for hole in &mut polygon.holes {
            *hole = turned(hole);
        }
    }
    patch
}

/// The loops of the last walk.
pub(super) fn loops(scratch: &Scratch) -> impl Iterator<Item = &[DVec2]> {
    let starts = std::iter::once(0).chain(scratch.ends.iter().copied());
    starts.zip(&scratch.ends).map(|(start, &end)| &scratch.points[start..end])
}

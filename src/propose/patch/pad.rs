//! A pad outline turned to an approach angle, and boundary edges clipped to it.

use glam::DVec2;

use crate::geometry::{Bounds2, ring_area};
use crate::model::Ring;

/// Boundary within this share of the pad's size inside the pad's outline counts as flush with it:
/// above all rounding of the arithmetic, below anything that could be felt (0.02 nm on 20 mm).
pub(super) const FLUSH: f64 = 1e-9;

/// A pad outline turned to an approach angle, about the grip origin.
#[derive(Debug, Clone)]
pub(in crate::propose) struct TurnedPad {
    /// The outline, counter-clockwise.
    pub(super) ring: Ring,
    /// The outline drawn in by the flush tolerance: the clip window.
    pub(super) window: Ring,
    /// Unit outward normals and distances of the window's sides; side `k` runs from corner `k` to
    /// `k + 1`.
    pub(super) sides: Vec<(DVec2, f64)>,
    pub(super) bounds: Bounds2,
    pub(super) area: f64,
}

impl TurnedPad {
    /// The convex counter-clockwise outline `pad` turned by `angle`.
    pub(in crate::propose) fn new(pad: &[DVec2], angle: f64) -> Self {
        let turn = DVec2::from_angle(angle);
        let ring: Ring = pad.iter().map(|&point| turn.rotate(point)).collect();
        let bounds = Bounds2::of(&ring);
        let scale = bounds.size().max_element();
        let sides: Vec<(DVec2, f64)> = ring
            .iter()
            .zip(ring.iter().cycle().skip(1))
            .map(|(&a, &b)| {
                let normal = -(b - a).perp().normalize();
                (normal, normal.dot(a) - FLUSH * scale)
            })
            .collect();
        let corner = |k: usize| {
            let ((m, g), (n, h)) = (sides[(k + sides.len() - 1) % sides.len()], sides[k]);
            DVec2::new(g * n.y - h * m.y, h * m.x - g * n.x) / m.perp_dot(n)
        };
        let window = (0..sides.len()).map(corner).collect();
        Self { area: ring_area(&ring), window, sides, bounds, ring }
    }

    /// The outline with the middle of its bounds at the origin.
    pub(in crate::propose) fn centred(&self) -> Ring {
        self.ring.iter().map(|&point| point - self.bounds.centre()).collect()
    }

    /// The turned outline about the grip origin.
    pub(in crate::propose) fn ring(&self) -> &[DVec2] {
        &self.ring
    }

    pub(in crate::propose) fn area(&self) -> f64 {
        self.area
    }
}

/// The part of one boundary edge inside the window.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub(super) edge: u32,
    pub(super) start: DVec2,
    pub(super) end: DVec2,
    /// Window side crossed on the way in; `None` when the edge starts inside.
    pub(super) entry: Option<usize>,
    pub(super) exit: Option<usize>,
}

/// The part of the edge from `a` to `b` inside the window (Cyrus and Beck 1978).
#[inline(always)]
pub(super) fn clip_edge(edge: u32, a: DVec2, b: DVec2, sides: &[(DVec2, f64)]) -> Option<Piece> {
    let (mut low, mut high, mut entry, mut exit) = (0.0, 1.0, None, None);
    for (side, &(normal, height)) in sides.iter().enumerate() {
        let (value_a, value_b) = (normal.dot(a) - height, normal.dot(b) - height);
        match (value_a > 0.0, value_b > 0.0) {
            (true, true) => return None,
            (false, false) => {}
            (true, false) => {
                let t = value_a / (value_a - value_b);
                if t >= low {
                    (low, entry) = (t, Some(side));
                }
            }
            (false, true) => {
                let t = value_a / (value_a - value_b);
                if t <= high {
                    (high, exit) = (t, Some(side));
                }
            }
        }
        if low >= high {
            return None;
        }
    }
    let at = |t: f64| a + (b - a) * t;
    Some(Piece {
        edge,
        start: if entry.is_some() { at(low) } else { a },
        end: if exit.is_some() { at(high) } else { b },
        entry,
        exit,
    })
}

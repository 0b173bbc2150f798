//! How often the map of [`super::states`] turns along closed ways, and the zeros which that tells
//! of.
//!
//! Where a pad is about to lose its contact the map is steep: it may turn all round within a
//! hundredth of the mesh's finest cell. So the ways are followed between the mesh's points as
//! finely as it takes, and a patch along whose sides the map turns is halved until its zero is
//! found.

use super::equilibrium::{Node, State};
use super::states::{BEND, HALVINGS, Map, RINGS, depth, distance_from_zero};

/// A point between those of the mesh: ray and ring in its units.
type Spot = [f64; 2];

/// Shortest way, in units of the finest mesh, on which the map's turn is looked at from both ends,
/// and most points on a closed way besides its corners.
const FINEST: f64 = 1e-6;
const MOST_ALONG: usize = 2000;
/// Most halvings of a patch that holds a zero.
const MOST_CUTS: usize = 40;

impl Map<'_, '_> {
    /// Turns of the map along a ring; `None` where that cannot be told.
    pub(super) fn winding(&mut self, ring: u32) -> Option<i32> {
        let ray = |piece| f64::from(piece * (1_u32 << HALVINGS));
        let spots: Vec<Spot> =
            (0..=self.pieces.len() as u32).map(|piece| [ray(piece), f64::from(ring)]).collect();
        self.turns_along(&spots)
    }

    /// Adds the zeros that hide between rings along which the map turns differently: what it turns
    /// along the sides of a patch tells in which half of it a zero lies.
    pub(super) fn hidden(&mut self, states: &mut Vec<State>) {
        let whole = f64::from(1_u32 << HALVINGS);
        for ring in 1..RINGS {
            let rings = [ring, ring + 1].map(|ring| f64::from(ring) * whole);
            for piece in 0..self.pieces.len() {
                let rays = [piece, piece + 1].map(|piece| piece as f64 * whole);
                if self.around([rays, rings]).is_some_and(|turns| turns != 0) {
                    self.close_in([rays, rings], states);
                }
            }
        }
    }

    /// The zero of a patch along whose sides the map turns, by halves.
    fn close_in(&mut self, mut patch: [[f64; 2]; 2], states: &mut Vec<State>) {
        let before = states.len();
        self.starts = 0;
        for cut in 0..MOST_CUTS {
            let middle = patch.map(|[low, high]| f64::midpoint(low, high));
            if let Some(node) = self.spot(middle, None) {
                self.start(&node, states);
            }
            if states.len() > before {
                return;
            }
            let side = cut % 2;
            let mut half = patch;
            half[side][1] = middle[side];
            match self.around(half) {
                Some(0) => patch[side][0] = middle[side],
                Some(_) => patch = half,
                None => return,
            }
        }
    }

    /// Turns of the map along the sides of a patch between two rays and two rings.
    fn around(&mut self, [[a, b], [inner, outer]]: [[f64; 2]; 2]) -> Option<i32> {
        let start = [a, inner];
        self.turns_along(&[start, [a, outer], [b, outer], [b, inner], start])
    }

    /// Turns of the map along a way from spot to spot that ends where it began; `None` where that
    /// cannot be told.
    fn turns_along(&mut self, spots: &[Spot]) -> Option<i32> {
        let mut last = (spots[0], self.spot(spots[0], None)?);
        let (mut turned, mut left) = (0.0, MOST_ALONG);
        for &spot in &spots[1..] {
            let next = (spot, self.spot(spot, Some(&last.1))?);
            turned += self.turned([last, next], &mut left)?;
            last = next;
        }
        Some((turned / std::f64::consts::TAU).round() as i32)
    }

    /// By how much the map turns on the way between two spots, looked at in up to `left` places;
    /// `None` where that cannot be told.
    fn turned(&mut self, ends: [(Spot, Node); 2], left: &mut usize) -> Option<f64> {
        let mut turned = 0.0;
        let mut ways = vec![ends];
        while let Some([(from, one), (to, two)]) = ways.pop() {
            let turn = one.g.angle_to(two.g);
            let step = two.x - one.x;
            let bent = (two.g - one.g - one.slope * step)
                .length()
                .max((two.g - one.g - two.slope * step).length());
            // However little the ends differ, between them the map may have gone all round.
            let away = distance_from_zero(&[one, two]);
            if BEND * bent < away && turn.abs() < 3.0 {
                turned += turn;
                continue;
            }
            let apart = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
            if *left == 0 || apart < FINEST {
                return None;
            }
            *left -= 1;
            let middle = [0, 1].map(|i| f64::midpoint(from[i], to[i]));
            let node = self.spot(middle, Some(&one))?;
            ways.extend([[(from, one), (middle, node)], [(middle, node), (to, two)]]);
        }
        Some(turned)
    }

    /// The map at a spot; `near`: a neighbour whose pressure and slip are close.
    fn spot(&mut self, [ray, ring]: Spot, near: Option<&Node>) -> Option<Node> {
        if ray.fract() == 0.0 && ring.fract() == 0.0 {
            return self.node(ray as u32, ring as u32, near);
        }
        let x = self.place_at(ray, depth(ring));
        self.look(x, near).or_else(|| near.and_then(|_| self.look(x, None)))
    }
}

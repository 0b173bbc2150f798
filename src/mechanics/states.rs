//! All limit states of a load, found by looking at the whole region of contact moments.
//!
//! A contact moment `X = int_I x p_I - int_II x p_II` in the convex region `N_I conv A_I - N_II
//! conv A_II` fixes the pressure, that the slip, and (6)(7) then leave over `g(X) = X - X_0 - (d/2)
//! mu (T_I - T_II)`, with `X_0` the moment that the load asks for without friction. Limit states
//! are the zeros of this continuous map of the plane. Its derivative is known too, so a cell of the
//! region is set aside when the values at its corners stay farther from zero than the map's bend
//! over the cell could carry it, and cut smaller otherwise. The signs of the zeros found must add
//! up to the turns of `g` along the region's rim, which no zero inside can escape.

use glam::{DMat2, DVec2};
use rustc_hash::FxHashMap;

use super::equilibrium::{Matrix7, Node, Solver, State, same};
use super::pressure;

/// What [`Solver::limit_states`] found.
#[derive(Debug, Clone, Default)]
pub(crate) struct LimitStates {
    /// Distinct limit states by rising `mu`.
    pub states: Vec<State>,
    /// Whether the signs of the states add up to the map's turns along the rim; if not, there is
    /// another one.
    pub complete: bool,
}

/// Pieces of the rim at the start: at least.
const PIECES: usize = 8;
/// Corners of the rim up to which each gets a ray of its own.
const CORNERS: usize = 16;
/// Rings at the start.
pub(super) const RINGS: u32 = 4;
/// Halvings of a starting cell along each coordinate.
pub(super) const HALVINGS: u32 = 6;
/// The outermost ring, in the coordinate whose fourth power is the distance from the rim: 1e-4 of
/// the way to the middle. There a contact is down to about 3e-4 of its width; the map hardly
/// changes from there to the rim, where the pressure is left on an edge or a corner, and Newton's
/// method is started from every point of this ring with a small value.
const OUTERMOST: f64 = 0.9;
/// The innermost ring within which the zeros must be counted to call the search complete: 1 % of
/// the way from the rim.
const WITHIN: u32 = RINGS - 1;
/// A cell holds no zero when its corners' values stay this many times the bend away from zero.
/// Inside a cell a quadratic map strays by at most half the bend from the values between its
/// corners.
pub(super) const BEND: f64 = 0.75;
/// The same when the signs do not add up at first.
const BEND_AGAIN: f64 = 3.0;
/// Value on the outermost ring, in units of force times the pads' length, from which a zero beyond
/// it is sought.
const BEYOND: f64 = 0.05;
/// Newton's step on the outermost ring, in its distances from the rim, up to which the same.
const BEYOND_STEPS: f64 = 30.0;
/// The same, up to which there should be one.
const EXPECTED_STEPS: f64 = 5.0;
/// Points with the smallest values from which Newton's method starts in any case, and how far apart
/// they are, in units of force times the pads' length: two zeros of opposite sign close together
/// hide from cells and signs alike.
const LOWEST: usize = 6;
const LOWEST_APART: f64 = 0.03;
/// Points looked at to find where the value on the outermost ring is least, and the distances from
/// the rim, as shares of the way to the middle, at which a zero is sought there.
const ALONG: usize = 10;
const DEPTHS: [f64; 5] = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Most points looked at, and most starts of Newton's method.
const MOST_NODES: usize = 500;
const MOST_STARTS: usize = 60;

/// A cell of the mesh between two rays and two rings, in units of the finest mesh.
#[derive(Debug, Clone, Copy)]
struct Cell {
    rays: [u32; 2],
    rings: [u32; 2],
}

/// The map on the mesh: rays to the rim by rings about the middle.
pub(super) struct Map<'s, 'a> {
    solver: &'s mut Solver<'a>,
    middle: DVec2,
    /// The rim relative to the middle, cut into pieces; each piece goes through several corners
    /// when there are many.
    pub(super) pieces: Vec<Vec<DVec2>>,
    nodes: FxHashMap<(u32, u32), Option<Node>>,
    /// Starts of Newton's method so far.
    pub(super) starts: usize,
}

impl Solver<'_> {
    /// Looks for every limit state, `known` ones among them.
    pub(crate) fn limit_states(&mut self, known: &[State]) -> LimitStates {
        let mut states = known.to_vec();
        let complete = match Map::new(self) {
            Some(mut map) => map.search(&mut states),
            None => false,
        };
        states.sort_by(|a, b| a.mu_over_size.total_cmp(&b.mu_over_size));
        LimitStates { states, complete }
    }

    /// `1` or `-1`: how often `g` turns about the state.
    fn turns(&mut self, state: &State) -> i32 {
        let mut jacobian = Matrix7::zeros();
        self.evaluate(&state.z, 1.0, Some(&mut jacobian));
        // Without coupling the Jacobian's determinant is negative and the map is the identity but
        // for a constant.
        if jacobian.determinant() < 0.0 { 1 } else { -1 }
    }
}

impl<'s, 'a> Map<'s, 'a> {
    fn new(solver: &'s mut Solver<'a>) -> Option<Self> {
        let rim = pressure::region(solver.pads, solver.load.normal);
        if rim.len() < 3 {
            return None;
        }
        let middle = rim.iter().sum::<DVec2>() / rim.len() as f64;
        let corner = |i: usize| rim[i % rim.len()] - middle;
        let mut pieces = Vec::new();
        if rim.len() > CORNERS {
            let many = rim.len().div_ceil(CORNERS);
            pieces.extend(
                (0..rim.len())
                    .step_by(many)
                    .map(|i| (i..=(i + many).min(rim.len())).map(corner).collect()),
            );
        } else {
            let cuts = PIECES.div_ceil(rim.len());
            for i in 0..rim.len() {
                let at = |cut: usize| corner(i).lerp(corner(i + 1), cut as f64 / cuts as f64);
                pieces.extend((0..cuts).map(|cut| vec![at(cut), at(cut + 1)]));
            }
        }
        Some(Self { solver, middle, pieces, nodes: FxHashMap::default(), starts: 0 })
    }

    /// Contact moment of a mesh point.
    fn place(&self, ray: u32, ring: u32) -> DVec2 {
        self.place_at(f64::from(ray), depth(f64::from(ring)))
    }

    /// Contact moment on a ray between those of the mesh, at a distance from the rim as a share of
    /// the way to the middle.
    pub(super) fn place_at(&self, ray: f64, depth: f64) -> DVec2 {
        let pieces = ray.rem_euclid(f64::from(1 << HALVINGS) * self.pieces.len() as f64)
            / f64::from(1 << HALVINGS);
        let piece = &self.pieces[pieces as usize % self.pieces.len()];
        let along = pieces.fract() * (piece.len() - 1) as f64;
        let corner = (along as usize).min(piece.len() - 2);
        let end = piece[corner].lerp(piece[corner + 1], along - corner as f64);
        self.middle + (1.0 - depth) * end
    }

    /// The map at a mesh point; `near`: a neighbour whose pressure and slip are close.
    pub(super) fn node(&mut self, ray: u32, ring: u32, near: Option<&Node>) -> Option<Node> {
        let round = self.pieces.len() as u32 * (1 << HALVINGS);
        let key = if ring == 0 { (0, 0) } else { (ray % round, ring) };
        if let Some(known) = self.nodes.get(&key) {
            return *known;
        }
        let x = self.place(key.0, key.1);
        let node = self.look(x, near).or_else(|| near.and_then(|_| self.look(x, None)));
        self.nodes.insert(key, node);
        node
    }

    pub(super) fn look(&mut self, x: DVec2, near: Option<&Node>) -> Option<Node> {
        match near {
            Some(near) => self.solver.beside(near, x),
            None => self.solver.state_at(x, None).and_then(|z| self.solver.node(&z)),
        }
    }

    /// Adds the zeros found to `states`; whether their signs add up.
    fn search(&mut self, states: &mut Vec<State>) -> bool {
        self.cells(BEND, MOST_NODES, states);
        self.lowest(states);
        self.partners(states);
        let open = self.beyond(states);
        // On slivers the outermost points can be beyond what doubles resolve: then the next ring
        // in.
        let Some((ring, turns)) =
            (1..=RINGS).rev().find_map(|ring| Some((ring, self.winding(ring << HALVINGS)?)))
        else {
            return false;
        };
        if self.signs(states, ring) != turns {
            self.cells(BEND_AGAIN, 2 * MOST_NODES, states);
        }
        if states.is_empty() {
            self.valleys(states);
        }
        if self.signs(states, ring) != turns {
            self.hidden(states);
        }
        let open = open || ring < RINGS && self.leads_out(ring);
        ring >= WITHIN && !open && self.signs(states, ring) == turns
    }

    /// Adds the zeros beside those known on the other side of a fold.
    fn partners(&mut self, states: &mut Vec<State>) {
        for known in states.clone() {
            add(self.solver.partner(&known), states);
        }
    }

    /// Goes through the mesh, coarse cells first, so that the budget is spent evenly.
    fn cells(&mut self, bend: f64, most: usize, states: &mut Vec<State>) {
        let whole: u32 = 1 << HALVINGS;
        self.starts = 0;
        let mut cells = std::collections::VecDeque::new();
        for piece in 0..self.pieces.len() as u32 {
            let mut near = self.node(0, 0, None);
            for ring in 0..RINGS {
                near = self.node(piece * whole, (ring + 1) * whole, near.as_ref()).or(near);
                cells.push_back(Cell {
                    rays: [piece * whole, (piece + 1) * whole],
                    rings: [ring * whole, (ring + 1) * whole],
                });
            }
        }
        while let Some(cell) = cells.pop_front() {
            cells.extend(self.settle(cell, bend, most, states));
        }
    }

    /// Signs of the states inside a ring, added up.
    fn signs(&mut self, states: &[State], ring: u32) -> i32 {
        let share = 1.0 - (1.0 - OUTERMOST * f64::from(ring) / f64::from(RINGS)).powi(4);
        let mut sum = 0;
        for state in states {
            if self.share(state) < share {
                sum += self.solver.turns(state);
            }
        }
        sum
    }

    /// How far out a state's contact moment lies: 0 in the middle, 1 on the rim.
    fn share(&self, state: &State) -> f64 {
        let x = pressure::carried(&state.moments, &state.q()) - self.middle;
        let outward = |edge: &[DVec2]| {
            let normal = -(edge[1] - edge[0]).perp();
            normal.dot(x) / normal.dot(edge[0]).max(f64::MIN_POSITIVE)
        };
        self.pieces.iter().flat_map(|piece| piece.windows(2)).map(outward).fold(0.0, f64::max)
    }

    /// Newton's method from a point, unless enough have been tried: on all seven equations, and if
    /// that gets stuck on the map first.
    pub(super) fn start(&mut self, node: &Node, states: &mut Vec<State>) {
        self.starts += 1;
        if self.starts > MOST_STARTS {
            return;
        }
        let direct = self.solver.newton(node.z, 1.0, 15);
        add(direct.or_else(|| self.solver.settle_at(*node)), states);
    }

    /// Newton's method from the points with the smallest values.
    fn lowest(&mut self, states: &mut Vec<State>) {
        self.starts = 0;
        for node in self.lowest_nodes() {
            self.start(&node, states);
        }
    }

    /// Zeros in the valleys of the map's length, from the points with the smallest values down to
    /// the valleys' floors. A pair of zeros that was just born lies on one, and neither cells nor
    /// Newton's method, which stops at the fold beside them, need have seen it.
    fn valleys(&mut self, states: &mut Vec<State>) {
        for node in self.lowest_nodes() {
            let floor = self.solver.floor(node);
            self.starts = 0;
            self.start(&floor, states);
        }
        for known in states.clone() {
            add(self.solver.deflated(&known), states);
        }
    }

    /// Points with the smallest values, apart from each other.
    fn lowest_nodes(&self) -> Vec<Node> {
        let mut nodes: Vec<Node> = self.nodes.values().flatten().copied().collect();
        nodes.sort_by(|a, b| {
            let value = |node: &Node| node.g.length();
            value(a)
                .total_cmp(&value(b))
                .then(a.x.x.total_cmp(&b.x.x))
                .then(a.x.y.total_cmp(&b.x.y))
        });
        let mut chosen: Vec<Node> = Vec::new();
        for node in nodes {
            if chosen.iter().all(|other| other.x.distance(node.x) > LOWEST_APART) {
                chosen.push(node);
                if chosen.len() == LOWEST {
                    break;
                }
            }
        }
        chosen
    }

    /// Zeros where the value on the outermost ring is least, from there to the rim.
    fn along_the_rim(&mut self, states: &mut Vec<State>) {
        let ring = RINGS << HALVINGS;
        let mut rays: Vec<(u32, Node)> = self
            .nodes
            .iter()
            .filter(|(key, _)| key.1 == ring)
            .filter_map(|(key, node)| Some((key.0, (*node)?)))
            .collect();
        rays.sort_by_key(|(ray, _)| *ray);
        let round = f64::from(1 << HALVINGS) * self.pieces.len() as f64;
        let count = rays.len();
        let value = |index: usize| rays[index % count].1.g.length();
        let lows: Vec<usize> = (count..2 * count)
            .filter(|&i| value(i) <= value(i - 1) && value(i) < value(i + 1))
            .collect();
        for low in lows {
            let ray = |index: usize| f64::from(rays[index % count].0);
            let at = ray(low);
            let back = (at - ray(low - 1)).rem_euclid(round);
            let on = (ray(low + 1) - at).rem_euclid(round);
            let (ray, node) = self.least_along(at, [back, on], rays[low % count].1);
            if node.g.length() >= BEYOND {
                continue;
            }
            let mut near = node;
            for depth in DEPTHS {
                let x = self.place_at(ray, depth);
                let Some(node) = self.look(x, Some(&near)).or_else(|| self.look(x, None)) else {
                    break;
                };
                self.start(&node, states);
                near = node;
            }
        }
    }

    /// Where the value on the outermost ring is least about the ray `at`, between those so far
    /// before and after it.
    fn least_along(&mut self, mut at: f64, mut around: [f64; 2], mut least: Node) -> (f64, Node) {
        let depth = (1.0 - OUTERMOST).powi(4);
        for step in 0..ALONG {
            // The wider side is cut in turn.
            let side = usize::from(around[1] > around[0]);
            let way = 0.4 * around[side];
            let tried = if side == 1 { at + way } else { at - way };
            let Some(node) = self.look(self.place_at(tried, depth), Some(&least)) else {
                around[side] = way;
                continue;
            };
            if node.g.length() < least.g.length() {
                around = if side == 1 { [way, around[1] - way] } else { [around[0] - way, way] };
                (at, least) = (tried, node);
            } else {
                around[side] = way;
            }
            if step > 2 && around[0].max(around[1]) < 1e-6 {
                break;
            }
        }
        (at, least)
    }

    /// Zeros between the outermost ring and the rim: the value on the ring is small beside them.
    /// Whether there should be one, but none was found.
    fn beyond(&mut self, states: &mut Vec<State>) -> bool {
        let ring = RINGS << HALVINGS;
        let mut near: Vec<Node> = self
            .nodes
            .iter()
            .filter(|(key, _)| key.1 == ring)
            .filter_map(|(_, node)| *node)
            .collect();
        let step = |node: &Node| (node.slope.inverse() * node.g).length();
        let room = (1.0 - OUTERMOST).powi(4)
            * self.pieces.iter().flatten().map(|corner| corner.length()).fold(0.0, f64::max);
        near.retain(|node| node.g.length() < BEYOND || step(node) < BEYOND_STEPS * room);
        near.sort_by(|a, b| step(a).total_cmp(&step(b)));
        self.starts = 0;
        for node in near.iter().take(8) {
            self.start(node, states);
        }
        self.along_the_rim(states);
        let expected = near.first().is_some_and(|node| step(node) < EXPECTED_STEPS * room);
        let outermost = 1.0 - (1.0 - OUTERMOST).powi(4);
        expected && !states.iter().any(|state| self.share(state) > outermost)
    }

    /// Whether Newton's step from a point on the ring, or further out, is so short that a zero may lie
    /// beside it.
    fn leads_out(&self, ring: u32) -> bool {
        let longest =
            self.pieces.iter().flatten().map(|corner| corner.length()).fold(0.0, f64::max);
        self.nodes.iter().filter(|(key, _)| key.1 >= ring << HALVINGS).any(|(key, node)| {
            node.is_some_and(|node| {
                let step = (node.slope.inverse() * node.g).length();
                step < EXPECTED_STEPS * depth(f64::from(key.1)) * longest
            })
        })
    }

    /// Sets the cell aside, finds its zero, or cuts it.
    fn settle(
        &mut self,
        cell: Cell,
        bends: f64,
        budget: usize,
        states: &mut Vec<State>,
    ) -> Vec<Cell> {
        let [a, b] = cell.rays;
        let [inner, outer] = cell.rings;
        let mut corners: Vec<Node> = Vec::with_capacity(4);
        let mut ends = [[None; 2]; 2];
        for (i, ring) in [inner, outer].into_iter().enumerate() {
            for (j, ray) in [a, b].into_iter().enumerate() {
                let near = corners.last().copied();
                ends[i][j] = self.node(ray, ring, near.as_ref());
                if !(ring == 0 && j == 1) {
                    corners.extend(ends[i][j]);
                }
            }
        }
        // How far a corner's value is from what its neighbours' slopes say.
        let bend = |one: &Option<Node>, two: &Option<Node>| match (one, two) {
            (Some(one), Some(two)) => {
                let step = two.x - one.x;
                (two.g - one.g - one.slope * step)
                    .length()
                    .max((two.g - one.g - two.slope * step).length())
            }
            // A corner whose slip could not be found: judged by the others.
            _ => 0.0,
        };
        let across = bend(&ends[1][0], &ends[1][1]).max(if inner == 0 {
            0.0
        } else {
            bend(&ends[0][0], &ends[0][1])
        });
        let along = bend(&ends[0][0], &ends[1][0]).max(bend(&ends[0][1], &ends[1][1]));
        let most = across.max(along);
        if corners.len() < 3 || distance_from_zero(&corners) > bends * most {
            return Vec::new();
        }
        let size = corners
            .iter()
            .flat_map(|one| corners.iter().map(|two| one.x.distance(two.x)))
            .fold(0.0, f64::max);
        let stiff =
            corners.iter().map(|corner| least_stretch(corner.slope)).fold(f64::INFINITY, f64::min);
        let straight = most <= 0.2 * stiff * size
            && corners
                .windows(2)
                .all(|pair| pair[0].slope.determinant() * pair[1].slope.determinant() > 0.0);
        let finest = [b - a == 1, outer - inner == 1];
        let split = [across >= 0.5 * along && !finest[0], along >= 0.5 * across && !finest[1]];
        let split =
            if split == [false, false] && most > 0.0 { [!finest[0], !finest[1]] } else { split };
        if straight || split == [false, false] || self.nodes.len() >= budget {
            // At most one zero in a straight cell; in one that cannot be cut any more, what
            // Newton's method makes of it.
            corners.sort_by(|a, b| a.g.length().total_cmp(&b.g.length()));
            let starts = if straight { 1 } else { corners.len() };
            for corner in corners.iter().take(starts) {
                let reach = (corner.slope.inverse() * corner.g).length();
                if straight && reach > 2.0 * size {
                    continue;
                }
                self.start(corner, states);
            }
            return Vec::new();
        }
        let halves = |[low, high]: [u32; 2], cut: bool| {
            if cut {
                vec![[low, (low + high) / 2], [(low + high) / 2, high]]
            } else {
                vec![[low, high]]
            }
        };
        let rings = halves(cell.rings, split[1]);
        halves(cell.rays, split[0])
            .into_iter()
            .flat_map(|rays| rings.iter().map(move |&rings| Cell { rays, rings }))
            .collect()
    }
}

/// Adds a state that is not among them.
fn add(found: Option<State>, states: &mut Vec<State>) {
    states.extend(found.filter(|found| !states.iter().any(|known| same(known, found))));
}

/// Distance from the rim of a ring in units of the finest mesh, as a share of the way to the middle.
pub(super) fn depth(ring: f64) -> f64 {
    (1.0 - OUTERMOST * ring / f64::from(RINGS << HALVINGS)).powi(4)
}

/// Distance of zero from the hull of the values.
pub(super) fn distance_from_zero(corners: &[Node]) -> f64 {
    let g: Vec<DVec2> = corners.iter().map(|corner| corner.g).collect();
    let mut least = f64::INFINITY;
    for i in 0..g.len() {
        for j in 0..i {
            let edge = g[j] - g[i];
            let t =
                (-g[i].dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            least = least.min((g[i] + t * edge).length());
            for k in 0..j {
                let turns = [g[i].perp_dot(g[j]), g[j].perp_dot(g[k]), g[k].perp_dot(g[i])];
                if turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0) {
                    return 0.0;
                }
            }
        }
    }
    least
}

/// The smaller singular value.
fn least_stretch(matrix: DMat2) -> f64 {
    let (sum, product) = (
        matrix.x_axis.length_squared() + matrix.y_axis.length_squared(),
        matrix.determinant().abs(),
    );
    let large = (sum / 2.0 + ((sum / 2.0).powi(2) - product * product).max(0.0).sqrt()).sqrt();
    product / large.max(f64::MIN_POSITIVE)
}

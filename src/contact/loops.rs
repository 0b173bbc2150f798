//! Contact areas as flat loops of points, ready for the integrals.

use glam::DVec2;

use super::lanes::{Block, LANES, totals, widest};
use crate::model::Polygon;

/// The boundary loops of a contact area: outer loops counter-clockwise, holes clockwise. All
/// integrals are sums over directed edges, so which loop belongs to which does not matter.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loops {
    points: Vec<DVec2>,
    /// End index of each loop in `points`.
    ends: Vec<usize>,
    /// The edges again, as the sums over them want them.
    blocks: Vec<Block>,
    middle: DVec2,
    radius: f64,
    moments: [f64; 6],
}

/// Areas smaller than this share of the square of their radius are summed from strips after a cut.
const SMALL: f64 = 1e-3;

impl Loops {
    /// From polygons in any sense of rotation; loops of fewer than three points are dropped.
    pub fn new(patch: &[Polygon]) -> Self {
        Self::mapped(patch, |point| point)
    }

    /// As [`Loops::new`], every point passed through `map` (a similarity that keeps orientation).
    pub fn mapped(patch: &[Polygon], map: impl Fn(DVec2) -> DVec2) -> Self {
        let mut loops = Self::default();
        for polygon in patch {
            loops.push(&polygon.outer, 1.0, &map);
            for hole in &polygon.holes {
                loops.push(hole, -1.0, &map);
            }
        }
        loops.measure();
        loops
    }

    fn push(&mut self, ring: &[DVec2], sense: f64, map: &impl Fn(DVec2) -> DVec2) {
        if ring.len() < 3 {
            return;
        }
        let anchor = ring[0];
        let area: f64 =
            (1..ring.len() - 1).map(|i| (ring[i] - anchor).perp_dot(ring[i + 1] - anchor)).sum();
        let start = self.points.len();
        self.points.extend(ring.iter().map(|&point| map(point)));
        if area * sense < 0.0 {
            self.points[start..].reverse();
        }
        self.ends.push(self.points.len());
    }

    /// Number of points, which is the number of edges.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// All points, loop after loop.
    pub fn points(&self) -> &[DVec2] {
        &self.points
    }

    /// The loops.
    pub fn rings(&self) -> impl Iterator<Item = &[DVec2]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| {
            let ring = &self.points[start..end];
            start = end;
            ring
        })
    }

    /// Directed edges of all loops.
    pub fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> {
        self.rings().flat_map(|ring| {
            (0..ring.len())
                .map(move |i| (ring[if i == 0 { ring.len() - 1 } else { i - 1 }], ring[i]))
        })
    }

    /// A point in the middle of the loops' points.
    pub fn middle(&self) -> DVec2 {
        self.middle
    }

    /// Largest distance of a point from [`Loops::middle`].
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Edges side by side.
    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Everything that follows from the points.
    fn measure(&mut self) {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for &point in &self.points {
            low = low.min(point);
            high = high.max(point);
        }
        self.middle = if self.points.is_empty() { DVec2::ZERO } else { (low + high) / 2.0 };
        self.radius = self
            .points
            .iter()
            .map(|point| point.distance_squared(self.middle))
            .fold(0.0, f64::max)
            .sqrt();
        self.blocks.clear();
        self.blocks.reserve(self.points.len().div_ceil(LANES));
        let (mut count, mut start) = (0, 0);
        for &end in &self.ends {
            let mut a = self.points[end - 1];
            for &b in &self.points[start..end] {
                let lane = count % LANES;
                if lane == 0 {
                    self.blocks.push(Block::at(b));
                }
                let block = &mut self.blocks[count / LANES];
                (block.ax[lane], block.ay[lane], block.bx[lane], block.by[lane]) =
                    (a.x, a.y, b.x, b.y);
                (a, count) = (b, count + 1);
            }
            start = end;
        }
        self.moments = sums(&mut self.blocks, self.middle);
    }

    /// Writes into `out` the part of the area where `p0 + p1 x1 + p2 x2 >= 0` (equations (19)(20)):
    /// each loop cut by the line. Loops that fall apart stay joined by edges along the line, which
    /// cancel in every integral.
    pub fn clip_into(&self, p: [f64; 3], out: &mut Self) {
        out.points.clear();
        out.ends.clear();
        // A convex loop gets at most one point more.
        out.points.reserve(self.points.len() + 2);
        let value = |x: DVec2| p[0] + p[1] * x.x + p[2] * x.y;
        for ring in self.rings() {
            let start = out.points.len();
            let mut a = ring[ring.len() - 1];
            let mut pa = value(a);
            for &b in ring {
                let pb = value(b);
                if (pa >= 0.0) != (pb >= 0.0) {
                    out.points.push(a + (b - a) * (pa / (pa - pb)));
                }
                if pb >= 0.0 {
                    out.points.push(b);
                }
                (a, pa) = (b, pb);
            }
            if out.points.len() - start < 3 {
                out.points.truncate(start);
            } else {
                out.ends.push(out.points.len());
            }
        }
        out.measure();
        if out.moments[0] < SMALL * out.radius * out.radius {
            out.moments = out.moments_of_strips(p);
        }
    }

    /// [`Self::moments`] from the strips between the edges and the line where `p` is zero.
    /// Triangles from one point to every edge would be far larger than a thin contact, or than
    /// contacts far apart.
    fn moments_of_strips(&self, p: [f64; 3]) -> [f64; 6] {
        let slope = DVec2::new(p[1], p[2]);
        let down = slope / -slope.length_squared();
        let foot = |x: DVec2| x + (p[0] + slope.dot(x)) * down;
        let mut sum = [0.0; 6];
        for (a, b) in self.edges() {
            let strip = quadrangle_moments([a, b, foot(b), foot(a)]);
            sum = std::array::from_fn(|i| sum[i] + strip[i]);
        }
        sum
    }
}

/// `(int 1, int x1, int x2, int x1^2, int x1 x2, int x2^2)` over the area.
pub fn moments(area: &Loops) -> [f64; 6] {
    area.moments
}

widest! {
    /// Measures the edges; [`moments`] of the area within them. `o` is one of its points.
    fn sums(edges: &mut [Block], o: DVec2) -> [f64; 6] = sums_of
}

#[inline(always)]
fn sums_of(edges: &mut [Block], o: DVec2) -> [f64; 6] {
    let mut lanes = [[0.0; LANES]; 6];
    for edge in edges {
        edge.measure();
        for i in 0..LANES {
            let (ax, ay) = (edge.ax[i] - o.x, edge.ay[i] - o.y);
            let (bx, by) = (edge.bx[i] - o.x, edge.by[i] - o.y);
            let cross = ax * by - ay * bx;
            lanes[0][i] += cross;
            lanes[1][i] += cross * (ax + bx);
            lanes[2][i] += cross * (ay + by);
            lanes[3][i] += cross * (ax * ax + ax * bx + bx * bx);
            lanes[4][i] += cross * (2.0 * (ax * ay + bx * by) + (ax * by + bx * ay));
            lanes[5][i] += cross * (ay * ay + ay * by + by * by);
        }
    }
    // About a point of the area, then moved: a sliver far from the origin keeps its relative
    // accuracy.
    let sums = totals(&lanes);
    let m = [
        sums[0] / 2.0,
        sums[1] / 6.0,
        sums[2] / 6.0,
        sums[3] / 12.0,
        sums[4] / 24.0,
        sums[5] / 12.0,
    ];
    moved(m, o)
}

/// Moments about the origin from those about `o`.
#[inline(always)]
pub(super) fn moved(m: [f64; 6], o: DVec2) -> [f64; 6] {
    [
        m[0],
        m[1] + o.x * m[0],
        m[2] + o.y * m[0],
        m[3] + 2.0 * o.x * m[1] + o.x * o.x * m[0],
        m[4] + o.x * m[2] + o.y * m[1] + o.x * o.y * m[0],
        m[5] + 2.0 * o.y * m[2] + o.y * o.y * m[0],
    ]
}

/// [`moments`] of a quadrangle, from its triangles at the first corner.
fn quadrangle_moments([o, one, two, three]: [DVec2; 4]) -> [f64; 6] {
    let mut m = [0.0; 6];
    for [a, b] in [[one, two], [two, three]] {
        let (a, b) = (a - o, b - o);
        let cross = a.perp_dot(b);
        let sum = a + b;
        m[0] += cross / 2.0;
        m[1] += cross * sum.x / 6.0;
        m[2] += cross * sum.y / 6.0;
        m[3] += cross * (a.x * sum.x + b.x * b.x) / 12.0;
        m[4] += cross * (2.0 * (a.x * a.y + b.x * b.y) + (a.x * b.y + b.x * a.y)) / 24.0;
        m[5] += cross * (a.y * sum.y + b.y * b.y) / 12.0;
    }
    moved(m, o)
}

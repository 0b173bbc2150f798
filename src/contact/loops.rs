//! Contact areas as flat loops of points, ready for the integrals.

use glam::DVec2;

use crate::model::Polygon;

/// The boundary loops of a contact area: outer loops counter-clockwise, holes clockwise. All integrals are sums over
/// directed edges, so which loop belongs to which does not matter.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loops {
    points: Vec<DVec2>,
    /// End index of each loop in `points`.
    ends: Vec<usize>,
    middle: DVec2,
    radius: f64,
}

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
        let area: f64 = (1..ring.len() - 1).map(|i| (ring[i] - anchor).perp_dot(ring[i + 1] - anchor)).sum();
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
        self.rings().flat_map(|ring| (0..ring.len()).map(move |i| (ring[if i == 0 { ring.len() - 1 } else { i - 1 }], ring[i])))
    }

    /// A point in the middle of the loops' points.
    pub fn middle(&self) -> DVec2 {
        self.middle
    }

    /// Largest distance of a point from [`Loops::middle`].
    pub fn radius(&self) -> f64 {
        self.radius
    }

    fn measure(&mut self) {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for &point in &self.points {
            low = low.min(point);
            high = high.max(point);
        }
        self.middle = if self.points.is_empty() { DVec2::ZERO } else { (low + high) / 2.0 };
        self.radius = self.points.iter().map(|point| point.distance_squared(self.middle)).fold(0.0, f64::max).sqrt();
    }

    /// Writes into `out` the part of the area where `p0 + p1 x1 + p2 x2 >= 0` (equations (19)(20)): each loop cut by
    /// the line. Loops that fall apart stay joined by edges along the line, which cancel in every integral.
    pub fn clip_into(&self, p: [f64; 3], out: &mut Self) {
        out.points.clear();
        out.ends.clear();
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
    }
}

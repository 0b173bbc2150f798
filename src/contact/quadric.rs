//! The integrals over a contact area whose pressure is a quadratic of the place: what a cylinder, a
//! sphere or a barrel has on a soft flat layer, and a plane as the special case.
//!
//! The area is where the quadratic is positive within a polygon. Its boundary consists of straight
//! pieces of the polygon's edges and of arcs of the conic where the pressure ends. Every integral
//! is taken along these pieces by Gauss quadrature, on panels that shrink towards the slip centre:
//! the curve is the conic itself, no polygon put in its place.
//!
//! Near slip centres: for `f` homogeneous of degree `n` about the slip centre, `int f dA = oint f
//! (y x dy) / (n + 2)` (the fan of the paper's section 3.5 with curved edges allowed), applied to
//! each degree of `p |v|`. Other slip centres, translations among them: points of the area itself,
//! where nothing large cancels.

use std::sync::LazyLock;

use glam::DVec2;

pub(crate) use load::area_and_load;
use moments::{Rows, moments, second_moments, sums};

use super::far::RULES;
use super::lanes::{LANES, Lane};
use crate::geometry::polygon::ring_contains;
use crate::model::Ring;

/// Gauss points on a panel. With panels no longer than [`PANEL`] of their distance from the slip
/// centre the error is below 1e-15 of the panel's share.
const POINTS: usize = 12;
/// Longest panel over its middle's distance from the slip centre.
const PANEL: f64 = 0.8;
/// Distance of the slip centre from the area's box, over the box's smaller half side, from which on
/// the points of the area are taken.
const OUTSIDE: f64 = 3.0;
/// Half diagonal of the box around an area over the distance of the slip centre from its middle, up to
/// which a plane piece takes the points of triangles.
const FAR: f64 = 0.25;
/// The area is cut where the pressure is `-CUT` of its greatest value, so that an edge of the
/// polygon that lies exactly where the pressure ends is no tie. What it adds is of the order of
/// the square.
const CUT: f64 = 1e-9;
/// Change of the greatest pressure along a cylinder, as a share, up to which its edges are lines.
const LINE: f64 = 1e-8;
/// Gauss points on panels that are at most this long over their distance from the slip centre, with
/// the same error: it falls as `(4 / ratio)^(2 - 2n)` where the pressure bends. Second derivatives are of
/// two degrees more in the place and stay above that: Newton's steps need no more than some ten digits.
const FEWER: [(f64, usize); 7] =
    [(0.002, 3), (0.02, 4), (0.1, 5), (0.2, 6), (0.3, 7), (0.4, 8), (0.6, 10)];
/// Gauss points more along the boundary, where the distance from the foot changes too.
const MORE: usize = 1;
/// Turn over the shift, on the area, up to which a motion counts as a shift and a first correction:
/// the error is of the order of the square.
const SHIFT: f64 = 1e-8;
/// Turn of an arc's tangent up to which it is one element \[rad\].
const TURN: f64 = 0.4;
/// Length of a chord over the rings' farthest coordinate up to which it is rounding: where an edge
/// passes through the conic's tip, its crossing and the tip are one point, found twice.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// A chord's step along the axis through the tips over that across it, up to which it stands for its
/// arc.
const STEEP: f64 = 1e-5;

/// `c + g . x + (l1 x1^2 + l2 x2^2) / 2`: no mixed term, the axes are the surface's own.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Quadratic {
    /// Value at the origin.
    pub c: f64,
    /// Slope at the origin.
    pub g: DVec2,
    /// Second derivatives along both axes.
    pub l: DVec2,
}

impl Quadratic {
    /// Its value at `x`.
    pub fn value(&self, x: DVec2) -> f64 {
        self.c + self.g.dot(x) + 0.5 * self.l.dot(x * x)
    }

    /// Its slope at `x`.
    pub fn slope(&self, x: DVec2) -> DVec2 {
        self.g + self.l * x
    }

    /// Greatest value within rings.
    pub(crate) fn greatest(&self, rings: &[Ring]) -> f64 {
        let mut most = f64::NEG_INFINITY;
        for ring in rings {
            let Some(&last) = ring.last() else { continue };
            let mut a = last;
            for &b in ring {
                // Along an edge it may be greatest between its ends.
                let step = b - a;
                let bend = self.l.dot(step * step);
                let t = if bend < 0.0 { -self.slope(a).dot(step) / bend } else { 0.0 };
                most = most.max(self.value(b)).max(self.value(a + t.clamp(0.0, 1.0) * step));
                a = b;
            }
        }
        // Or at its own crest; one that is a line crosses an edge.
        if self.l.max_element() < 0.0 {
            let top = -self.g / self.l;
            let is_within = rings.iter().filter(|ring| ring_contains(ring, top)).count() % 2 == 1;
            most = if is_within { most.max(self.value(top)) } else { most };
        }
        most
    }

    /// Greatest value that it can have within the ring, or more.
    fn bound(&self, ring: &[DVec2]) -> f64 {
        let along = |g: f64, l: f64, x: f64| g * x + 0.5 * l * x * x;
        let most = |g: f64, l: f64, values: &mut dyn Iterator<Item = f64>| {
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            let crest = if l < 0.0 { (-g / l).clamp(low, high) } else { low };
            along(g, l, low).max(along(g, l, high)).max(along(g, l, crest))
        };
        self.c
            + most(self.g.x, self.l.x, &mut ring.iter().map(|p| p.x))
            + most(self.g.y, self.l.y, &mut ring.iter().map(|p| p.y))
    }
}

/// A piece of the boundary from `a` to `b`, the area on its left: straight, or an arc of the conic.
#[derive(Debug, Clone, Copy)]
struct Element {
    a: DVec2,
    b: DVec2,
    arc: Option<Arc>,
}

/// What an arc keeps of its chord.
#[derive(Debug, Clone, Copy)]
struct Arc {
    /// Unit vector across the chord.
    normal: DVec2,
    /// Bends of the quadratic along and across it.
    bend: f64,
    curve: f64,
    /// Slope across the chord at its start, and its change along it.
    slope: [f64; 2],
    /// Length of the chord over the distance from its middle at which the arc turns back, which
    /// counts as a slip centre's does.
    bent: f64,
}

impl Arc {
    /// Of no bend.
    const STRAIGHT: Self =
        Self { normal: DVec2::ZERO, bend: 0.0, curve: 0.0, slope: [1.0, 0.0], bent: 0.0 };
}

/// Gauss rules of four, eight and twelve nodes: nodes and weights by fours.
static BLOCKS: LazyLock<[Vec<[Lane; 2]>; POINTS / LANES + 1]> = LazyLock::new(|| {
    std::array::from_fn(|blocks| {
        let rule = &RULES[blocks * LANES][..];
        let lane = |nodes: &[(f64, f64)]| {
            [std::array::from_fn(|i| nodes[i].0), std::array::from_fn(|i| nodes[i].1)]
        };
        rule.chunks(LANES).map(lane).collect()
    })
});

/// Gauss points for a panel's length over its distance from the slip centre.
fn enough(ratio: f64) -> usize {
    FEWER.iter().find(|few| ratio <= few.0).map_or(POINTS, |few| few.1)
}

/// An area in its surface's own axes, with the quadratic that is positive in it.
#[derive(Debug, Clone)]
pub struct Region {
    elements: Vec<Element>,
    u: Quadratic,
    middle: DVec2,
    half: DVec2,
}

/// `int u |v| dA` with its first and second derivatives in the twist.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Dissipation {
    /// The integral.
    pub value: f64,
    /// Gradient in `(u1, u2, omega)`.
    pub gradient: [f64; 3],
    /// Second derivatives, symmetric.
    pub hessian: [[f64; 3]; 3],
}

impl Dissipation {
    /// The same after a small change of the twist.
    fn turned(&mut self, by: [f64; 3]) {
        for i in 0..3 {
            let bent: f64 = (0..3).map(|j| self.hessian[i][j] * by[j]).sum();
            self.value += (self.gradient[i] + 0.5 * bent) * by[i];
        }
        let bent = self.hessian.map(|row| (0..3).map(|j| row[j] * by[j]).sum::<f64>());
        for (gradient, bent) in self.gradient.iter_mut().zip(bent) {
            *gradient += bent;
        }
    }
}

impl Region {
    /// The part of the area within `rings` (even-odd) where `u` is positive. Outer rings
    /// counter-clockwise, holes clockwise.
    pub fn new(rings: &[Ring], u: Quadratic) -> Self {
        let mut region = Self { elements: Vec::new(), u, middle: DVec2::ZERO, half: DVec2::ZERO };
        let most = rings.iter().map(|ring| u.bound(ring)).fold(f64::NEG_INFINITY, f64::max);
        if most > 0.0 {
            let cut = Quadratic { c: u.c + CUT * most, ..u };
            let crossings = region.straight(rings, &cut);
            if u.l == DVec2::ZERO {
                region.along_line(rings, &cut, crossings);
            } else {
                region.arcs(rings, &cut, crossings);
            }
            region.measure();
        }
        region
    }

    /// Whether nothing is pressed.
    pub fn is_empty(&self) -> bool {
        self.elements.is_empty()
    }

    /// Middle and half sides of the box around the area.
    pub fn extent(&self) -> (DVec2, DVec2) {
        (self.middle, self.half)
    }

    /// The parts of the edges where `u` is positive; where they end at the conic is given back.
    fn straight(&mut self, rings: &[Ring], u: &Quadratic) -> Vec<DVec2> {
        let mut crossings = Vec::new();
        for ring in rings {
            let mut a = ring[ring.len() - 1];
            for &b in ring {
                let step = b - a;
                let bend = 0.5 * u.l.dot(step * step);
                let rise = u.value(b) - u.value(a) - bend;
                let (mut cuts, mut count) = ([0.0; 4], 1);
                let roots = roots(u.value(a), rise, bend).into_iter().flatten();
                for cut in roots.filter(|t| *t > 0.0 && *t < 1.0).chain([1.0]) {
                    cuts[count] = cut;
                    count += 1;
                }
                let cuts = &cuts[..count];
                for pair in cuts.windows(2) {
                    if u.value(a + 0.5 * (pair[0] + pair[1]) * step) > 0.0 {
                        let end = |t: f64| if t == 1.0 { b } else { a + t * step };
                        self.push(end(pair[0]), end(pair[1]), false);
                    }
                }
                crossings.extend(cuts[1..cuts.len() - 1].iter().map(|t| a + t * step));
                a = b;
            }
        }
        crossings
    }

    /// Closes the boundary along the line where a linear `u` is zero.
    fn along_line(&mut self, rings: &[Ring], u: &Quadratic, mut crossings: Vec<DVec2>) {
        // The area lies on the left of this direction.
        let along = DVec2::new(u.g.y, -u.g.x);
        crossings.sort_by(|a, b| along.dot(*a).total_cmp(&along.dot(*b)));
        for pair in crossings.windows(2) {
            if contains(rings, 0.5 * (pair[0] + pair[1])) {
                self.push(pair[0], pair[1], false);
            }
        }
    }

    /// Closes the boundary along the conic `u = 0`: on either branch `x2 = m +- w(x1)` the parts
    /// between edges that lie within the rings.
    fn arcs(&mut self, rings: &[Ring], u: &Quadratic, crossings: Vec<DVec2>) {
        // The axis of the stronger bend is taken for x2.
        let turned = u.l.x.abs() > u.l.y.abs();
        let swap = |x: DVec2| if turned { DVec2::new(x.y, x.x) } else { x };
        let (g, l) = (swap(u.g), swap(u.l));
        let m = -g.y / l.y;
        let rest = u.c - 0.5 * g.y * g.y / l.y;
        let width = |x: f64| -2.0 / l.y * (rest + g.x * x + 0.5 * l.x * x * x);
        let (low, high) = rings
            .iter()
            .flatten()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b): (f64, f64), &x| {
                (a.min(swap(x).x), b.max(swap(x).x))
            });
        let reach = |x: &f64| (low..=high).contains(x);
        let farthest = rings.iter().flatten().map(|x| x.abs().max_element()).fold(0.0, f64::max);
        // Both branches of a cylinder's conic are lines, but for the square of the slope.
        let straight = l.x == 0.0 && g.x.abs() * (high - low) <= LINE * rest.abs();
        let tips = roots(rest, g.x, 0.5 * l.x);
        // Beside a tip places are told apart by their distance from the axis.
        let opens = |x: f64| -(g.x + l.x * x) / l.y > 0.0;
        let along = |at: &DVec2| {
            let is_here = |tip: &f64| (at.x - tip).abs() <= ROUNDING * farthest;
            let x = tips.into_iter().flatten().find(is_here).unwrap_or(at.x);
            [x, if opens(x) { (at.y - m).abs() } else { -(at.y - m).abs() }]
        };
        for side in [-1.0, 1.0] {
            let mut events: Vec<DVec2> =
                crossings.iter().map(|&x| swap(x)).filter(|x| side * (x.y - m) >= 0.0).collect();
            events.extend(tips.into_iter().flatten().filter(reach).map(|x| DVec2::new(x, m)));
            let crest = -g.x / l.x;
            if reach(&crest) && width(crest) > 0.0 {
                events.push(DVec2::new(crest, m + side * width(crest).sqrt()));
            }
            events.sort_by(|a, b| {
                let ([x, y], [z, w]) = (along(a), along(b));
                x.total_cmp(&z).then(y.total_cmp(&w))
            });
            for pair in events.windows(2) {
                let step = (pair[1] - pair[0]).abs();
                if step.length() <= ROUNDING * farthest {
                    continue;
                }
                let chord = 0.5 * (pair[0] + pair[1]);
                let w = width(chord.x);
                // Beside a tip rounding leaves nothing of the width, and the chord is near enough.
                let steep = step.x < (STEEP * step.y).max(ROUNDING * farthest);
                let y = if steep { chord.y } else { m + side * w.max(0.0).sqrt() };
                let middle = swap(DVec2::new(chord.x, y));
                if (steep || w > 0.0) && contains(rings, middle) {
                    let (a, b) = (swap(pair[0]), swap(pair[1]));
                    let inward = (b - a).perp().dot(u.slope(middle)) > 0.0;
                    let (a, b) = if inward { (a, b) } else { (b, a) };
                    if straight {
                        self.push(a, b, false);
                    } else {
                        self.push_arc(a, b, 0);
                    }
                }
            }
        }
    }

    fn push(&mut self, a: DVec2, b: DVec2, arc: bool) {
        if a != b {
            let step = b - a;
            let arc = arc.then(|| {
                let (l, normal) = (self.u.l, step.perp() / step.length());
                let (bend, curve) = (0.5 * l.dot(step * step), 0.5 * l.dot(normal * normal));
                let slope = [self.u.slope(a).dot(normal), (l * step).dot(normal)];
                let least = slope[0].abs().min((slope[0] + slope[1]).abs());
                let bent = 2.0 * (bend * curve).abs().sqrt() / least;
                Arc { normal, bend, curve, slope, bent }
            });
            self.elements.push(Element { a, b, arc });
        }
    }

    /// An arc in pieces that turn little and are short beside the ellipse's narrower half.
    fn push_arc(&mut self, a: DVec2, b: DVec2, depth: u32) {
        let (one, two) = (self.u.slope(a), self.u.slope(b));
        self.push(a, b, true);
        let is_long = |element: &Element| {
            element.arc.is_some_and(|arc| arc.bent.is_nan() || arc.bent > PANEL)
        };
        if depth < 12
            && let Some(element) = self.elements.pop_if(|element| {
                (element.a, element.b) == (a, b)
                    && (one.angle_to(two).abs() > TURN || is_long(element))
            })
        {
            let (middle, _) = self.at(&element, 0.5);
            self.push_arc(a, middle, depth + 1);
            self.push_arc(middle, b, depth + 1);
        }
    }

    /// The point of an element at `t` of its chord, and its derivative. The arc stands off the
    /// chord by the smaller root of a quadratic whose constant term is exact: it is zero at both
    /// ends.
    #[inline(always)]
    fn at(&self, element: &Element, t: f64) -> (DVec2, DVec2) {
        let step = element.b - element.a;
        let on_chord = element.a + t * step;
        let Some(Arc { normal, bend, curve, slope, .. }) = element.arc else {
            return (on_chord, step);
        };
        let value = bend * t * (t - 1.0);
        let slope = slope[0] + t * slope[1];
        let root = (slope * slope - 4.0 * curve * value).max(0.0).sqrt();
        let off = -2.0 * value / (slope + root.copysign(slope));
        if !off.is_finite() {
            return (on_chord, step);
        }
        let point = on_chord + off * normal;
        let gradient = self.u.slope(point);
        (point, step - gradient.dot(step) / gradient.dot(normal) * normal)
    }

    fn measure(&mut self) {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for element in &self.elements {
            let middle = self.at(element, 0.5).0;
            for x in [element.a, element.b, middle] {
                low = low.min(x);
                high = high.max(x);
            }
        }
        if !self.elements.is_empty() {
            (self.middle, self.half) = ((low + high) / 2.0, (high - low) / 2.0);
        }
    }

    /// The foot of a point of the boundary on the line through the middle along the area's longer
    /// side, and the area's element for a step `dx` of the boundary: the area is what lies between
    /// boundary and line, counted with its sign.
    fn foot(&self, x: DVec2, dx: DVec2) -> (DVec2, f64) {
        if self.half.x >= self.half.y {
            (DVec2::new(x.x, self.middle.y), (self.middle.y - x.y) * dx.x)
        } else {
            (DVec2::new(self.middle.x, x.y), (x.x - self.middle.x) * dx.y)
        }
    }

    /// Calls `visit` with points of the area and their weights, right for polynomials of `x` besides `u`:
    /// up to the second degree where `u` is linear, else up to the fourth on straight pieces; weights may
    /// be negative where the area is not convex.
    pub fn points(&self, mut visit: impl FnMut(DVec2, f64)) {
        for [x, y, weights] in self.rows() {
            for i in 0..LANES {
                visit(DVec2::new(x[i], y[i]), weights[i]);
            }
        }
    }

    /// The same points by fours.
    #[inline(always)]
    fn rows(&self) -> Rows<'_> {
        Rows::new(self)
    }

    /// The quadratic at a point of the region's axes.
    pub fn compression(&self, x: DVec2) -> f64 {
        self.u.value(x)
    }

    /// Greatest value of the quadratic in the area.
    pub fn greatest(&self) -> f64 {
        let mut most: f64 = 0.0;
        for element in &self.elements {
            // Along a straight piece the quadratic may be greatest between its ends.
            let step = element.b - element.a;
            let bend = self.u.l.dot(step * step);
            let t = if bend < 0.0 { -self.u.slope(element.a).dot(step) / bend } else { 0.0 };
            let crest = element.a + t.clamp(0.0, 1.0) * step;
            most = most.max(self.u.value(element.a)).max(self.u.value(crest));
        }
        // Or at its own crest, if that lies in the area, or anywhere on the crest of a cylinder.
        let top = DVec2::new(
            if self.u.l.x < 0.0 { -self.u.g.x / self.u.l.x } else { self.middle.x },
            if self.u.l.y < 0.0 { -self.u.g.y / self.u.l.y } else { self.middle.y },
        );
        if self.winding(top) { most.max(self.u.value(top)) } else { most }
    }

    /// Whether a point lies in the area, arcs taken as their chords.
    fn winding(&self, x: DVec2) -> bool {
        self.elements.iter().fold(false, |inside, element| {
            let (a, b) = (element.a - x, element.b - x);
            inside ^ ((a.y > 0.0) != (b.y > 0.0) && (a.perp_dot(b) > 0.0) == (b.y > a.y))
        })
    }

    /// Points on the boundary: the ends of its pieces and the middles of its arcs.
    pub fn outline(&self) -> impl Iterator<Item = DVec2> + '_ {
        self.elements.iter().flat_map(|element| [element.a, self.at(element, 0.5).0])
    }

    /// Area and `int u dA`.
    pub fn area_and_load(&self) -> (f64, f64) {
        sums(self)
    }

    /// `int f q dA` for `f` of `u`, `1`, `x1`, `x2` (rows) and `q` of `1`, `x1`, `x2`, `x x grad gap`.
    pub fn moments(&self, gap: &Quadratic) -> [[f64; 4]; 4] {
        moments(self, gap)
    }

    /// `int u q dA` for `q` of `1`, `x1`, `x2`, `x x grad gap` and `|x|^2`.
    pub fn pressure_moments(&self, gap: &Quadratic) -> [f64; 5] {
        let [[load, x1, x2, x11, x12, x22], _] = second_moments(self);
        let turn = x1 * gap.g.y - x2 * gap.g.x + (gap.l.y - gap.l.x) * x12;
        [load, x1, x2, turn, x11 + x22]
    }

    /// `int u |v| dA` for the twist `(u1, u2, omega)` about the origin of the region's axes, any
    /// but zero.
    pub fn dissipation(&self, twist: [f64; 3]) -> Dissipation {
        self.integrals::<false>(twist).0
    }

    /// The same, and the gradients of what `1`, `x1` and `x2` in place of `u` would dissipate: how the
    /// gradient changes with `u`, which is zero where the area ends.
    pub fn dissipation_by_pressure(&self, twist: [f64; 3]) -> (Dissipation, [[f64; 3]; 3]) {
        self.integrals::<true>(twist)
    }

    fn integrals<const BY: bool>(&self, twist: [f64; 3]) -> (Dissipation, [[f64; 3]; 3]) {
        let [u1, u2, omega] = twist;
        let mut sum = (Dissipation::default(), [[0.0; 3]; 3]);
        // Of the area's middle.
        let shift = DVec2::new(u1 - omega * self.middle.y, u2 + omega * self.middle.x);
        if omega.abs() * (self.half.x + self.half.y) <= SHIFT * shift.length() {
            self.sliding::<BY>(shift, &mut sum);
            sum.0.turned([omega * self.middle.y, -omega * self.middle.x, omega]);
            return sum;
        }
        // Distance of the slip centre from the box, times omega.
        let off = DVec2::new(-u2, u1) - omega * self.middle;
        let outside = (off.abs() - omega.abs() * self.half).max(DVec2::ZERO);
        let near = OUTSIDE * omega.abs() * self.half.min_element();
        let centre = DVec2::new(-u2, u1) / omega;
        if outside.length_squared() > near * near {
            // Long sides near the centre take fewer points by strips, which are cut either way.
            let is_far = omega.abs() * self.half.length() <= FAR * off.length();
            if is_far && self.u.l == DVec2::ZERO {
                self.triangles::<BY>(twist, centre, &mut sum);
                return sum;
            }
            let whole = [[0.0, 1.0]; 2];
            for element in &self.elements {
                self.area_panel::<BY>(element, twist, centre, whole, 0, &mut sum);
            }
            return sum;
        }
        self.edges(centre, BY).assemble(centre, omega)
    }

    /// [`Self::dissipation`] of a translation: moments of the pressure, and of the area.
    fn sliding<const BY: bool>(&self, v: DVec2, sum: &mut (Dissipation, [[f64; 3]; 3])) {
        let speed = v.length();
        let e = v / speed;
        let [pressure, area] = second_moments(self);
        let [load, x1, x2, x11, x12, x22] = pressure;
        let (first, along) =
            (DVec2::new(x1, x2), DVec2::new(e.x * x11 + e.y * x12, e.x * x12 + e.y * x22));
        let found = &mut sum.0;
        found.value += load * speed;
        let tangent = [load * e.x, load * e.y, first.perp_dot(e)];
        found.gradient.iter_mut().zip(tangent).for_each(|(sum, more)| *sum += more);
        // Across the motion, of `(e2, -e1, -x . e)`.
        let (one, two) = (first.dot(e), along.dot(e));
        let bend = [
            [load * e.y * e.y, -load * e.y * e.x, -one * e.y],
            [-load * e.y * e.x, load * e.x * e.x, one * e.x],
            [-one * e.y, one * e.x, two],
        ];
        for (row, more) in found.hessian.iter_mut().zip(bend) {
            row.iter_mut().zip(more).for_each(|(sum, more)| *sum += more / speed);
        }
        if BY {
            let [one, x1, x2, x11, x12, x22] = area;
            for (row, [f, x, y]) in
                sum.1.iter_mut().zip([[one, x1, x2], [x1, x11, x12], [x2, x12, x22]])
            {
                let tangent = [f * e.x, f * e.y, x * e.y - y * e.x];
                row.iter_mut().zip(tangent).for_each(|(sum, more)| *sum += more);
            }
        }
    }
}

fn contains(rings: &[Ring], x: DVec2) -> bool {
    rings.iter().fold(false, |inside, ring| inside ^ ring_contains(ring, x))
}

/// Real roots of `c + b t + a t^2` in rising order, without cancellation.
fn roots(c: f64, b: f64, a: f64) -> [Option<f64>; 2] {
    let inside = b * b - 4.0 * a * c;
    if inside < 0.0 || (a == 0.0 && b == 0.0) {
        return [None, None];
    }
    let half = -0.5 * (b + inside.sqrt().copysign(b));
    let finite = |t: f64| t.is_finite().then_some(t);
    let (one, two) = (finite(half / a), finite(c / half));
    match (one, two) {
        (Some(x), Some(y)) if x > y => [two, one],
        _ => [one, two],
    }
}

mod area;
mod edge;
mod load;
mod moments;
#[cfg(test)]
mod tests;

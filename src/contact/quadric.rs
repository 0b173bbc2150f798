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

use glam::DVec2;

use super::far::RULES;
use crate::geometry::polygon::ring_contains;
use crate::model::Ring;

/// Gauss points on a panel. With panels no longer than [`PANEL`] of their distance from the slip
/// centre the error is below 1e-15 of the panel's share.
const POINTS: usize = 12;
/// Longest panel over its middle's distance from the slip centre.
const PANEL: f64 = 0.8;
/// Distance of the slip centre from the area's box, over the box's smaller half side, from which on
/// the points of the area are taken.
const OUTSIDE: f64 = 0.5;
/// The area is cut where the pressure is `-CUT` of its greatest value, so that an edge of the
/// polygon that lies exactly where the pressure ends is no tie. What it adds is of the order of
/// the square.
const CUT: f64 = 1e-9;
/// Change of the greatest pressure along a cylinder, as a share, up to which its edges are lines.
const LINE: f64 = 1e-8;
/// Gauss points on panels that are at most this long over their distance from the slip centre, with
/// the same error.
const FEWER: [(f64, usize); 2] = [(0.2, 6), (0.4, 8)];
/// Turn of an arc's tangent up to which it is one element \[rad\].
const TURN: f64 = 0.4;

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
    arc: bool,
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
                let mut cuts = vec![0.0];
                let roots = roots(u.value(a), rise, bend);
                cuts.extend(roots.into_iter().flatten().filter(|t| *t > 0.0 && *t < 1.0));
                cuts.push(1.0);
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
        // Both branches of a cylinder's conic are lines, but for the square of the slope.
        let straight = l.x == 0.0 && g.x.abs() * (high - low) <= LINE * rest.abs();
        let tips: Vec<f64> =
            roots(rest, g.x, 0.5 * l.x).into_iter().flatten().filter(reach).collect();
        for side in [-1.0, 1.0] {
            let mut events: Vec<DVec2> =
                crossings.iter().map(|&x| swap(x)).filter(|x| side * (x.y - m) >= 0.0).collect();
            events.extend(tips.iter().map(|&x| DVec2::new(x, m)));
            let crest = -g.x / l.x;
            if reach(&crest) && width(crest) > 0.0 {
                events.push(DVec2::new(crest, m + side * width(crest).sqrt()));
            }
            events.sort_by(|a, b| a.x.total_cmp(&b.x));
            for pair in events.windows(2) {
                let x = 0.5 * (pair[0].x + pair[1].x);
                let w = width(x);
                let middle = swap(DVec2::new(x, m + side * w.max(0.0).sqrt()));
                if w > 0.0 && contains(rings, middle) {
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
            self.elements.push(Element { a, b, arc });
        }
    }

    /// An arc in pieces that turn little.
    fn push_arc(&mut self, a: DVec2, b: DVec2, depth: u32) {
        let (one, two) = (self.u.slope(a), self.u.slope(b));
        let element = Element { a, b, arc: true };
        if depth < 12 && one.angle_to(two).abs() > TURN {
            let (middle, _) = self.at(&element, 0.5);
            self.push_arc(a, middle, depth + 1);
            self.push_arc(middle, b, depth + 1);
        } else {
            self.push(a, b, true);
        }
    }

    /// The point of an element at `t` of its chord, and its derivative. The arc stands off the
    /// chord by the smaller root of a quadratic whose constant term is exact: it is zero at both
    /// ends.
    fn at(&self, element: &Element, t: f64) -> (DVec2, DVec2) {
        let Element { a, b, arc } = *element;
        let step = b - a;
        let on_chord = a + t * step;
        if !arc {
            return (on_chord, step);
        }
        let l = self.u.l;
        let normal = step.perp() / step.length();
        let bend = 0.5 * l.dot(step * step);
        let value = bend * t * (t - 1.0);
        let slope = self.u.slope(on_chord).dot(normal);
        let curve = 0.5 * l.dot(normal * normal);
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

    /// Calls `visit` with points of the area and their weights, right for polynomials of `x` up to
    /// the fourth degree besides `u` on straight pieces; weights may be negative where the area is not convex.
    pub fn points(&self, mut visit: impl FnMut(DVec2, f64)) {
        for element in &self.elements {
            let rule = &RULES[if element.arc { POINTS } else { 5 }];
            for &(s, ws) in rule {
                let (x, dx) = self.at(element, s);
                let (foot, turn) = self.foot(x, dx);
                if turn == 0.0 {
                    continue;
                }
                for &(t, wt) in &RULES[4] {
                    visit(foot.lerp(x, t), turn * ws * wt);
                }
            }
        }
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
        let (mut area, mut load) = (0.0, 0.0);
        self.points(|x, weight| {
            area += weight;
            load += weight * self.u.value(x);
        });
        (area, load)
    }

    /// `int u |v| dA` for the twist `(u1, u2, omega)` about the origin of the region's axes, any
    /// but zero.
    pub fn dissipation(&self, twist: [f64; 3]) -> Dissipation {
        let [u1, u2, omega] = twist;
        if omega == 0.0 {
            return self.sliding(DVec2::new(u1, u2));
        }
        // Distance of the slip centre from the box, times omega.
        let off = DVec2::new(-u2, u1) - omega * self.middle;
        let outside = (off.abs() - omega.abs() * self.half).max(DVec2::ZERO);
        let near = OUTSIDE * omega.abs() * self.half.min_element();
        let mut sum = Dissipation::default();
        if outside.length_squared() > near * near {
            let centre = DVec2::new(-u2, u1) / omega;
            for element in &self.elements {
                self.area_panel(element, twist, centre, [0.0, 1.0], [0.0, 1.0], 0, &mut sum);
            }
        } else {
            let centre = DVec2::new(-u2, u1) / omega;
            let mut edge = EdgeSums::default();
            for element in &self.elements {
                self.edge_panel(element, centre, [0.0, 1.0], 0, &mut edge);
            }
            sum = edge.assemble(centre, omega);
        }
        sum
    }

    /// [`Self::dissipation`] of a translation: moments of the pressure.
    fn sliding(&self, v: DVec2) -> Dissipation {
        let mut sum = Dissipation::default();
        let speed = v.length();
        let e = v / speed;
        self.points(|x, weight| {
            let weight = weight * self.u.value(x);
            let tangent = [e.x, e.y, x.perp_dot(e)];
            let normal = [e.y, -e.x, -x.dot(e)];
            sum.value += weight * speed;
            for i in 0..3 {
                sum.gradient[i] += weight * tangent[i];
                for j in 0..3 {
                    sum.hessian[i][j] += weight / speed * normal[i] * normal[j];
                }
            }
        });
        sum
    }

    /// Points between a part of an element and the line of [`Self::foot`], cut until the slip centre
    /// is far from each part.
    #[allow(clippy::too_many_arguments, reason = "a recursion over a rectangle of two parameters")]
    fn area_panel(
        &self,
        element: &Element,
        twist: [f64; 3],
        centre: DVec2,
        s: [f64; 2],
        t: [f64; 2],
        depth: u32,
        sum: &mut Dissipation,
    ) {
        let middle = |r: [f64; 2]| 0.5 * (r[0] + r[1]);
        let mut points = POINTS;
        if centre.is_finite() && depth < 40 {
            let point = |s: f64, t: f64| {
                let (x, dx) = self.at(element, s);
                self.foot(x, dx).0.lerp(x, t)
            };
            let along = (point(s[1], t[1]) - point(s[0], t[1])).length();
            let across = (point(middle(s), t[1]) - point(middle(s), t[0])).length();
            let distance = (point(middle(s), middle(t)) - centre).length();
            if along.max(across) > PANEL * distance {
                let split = |r: [f64; 2]| [[r[0], middle(r)], [middle(r), r[1]]];
                for half in split(if along > across { s } else { t }) {
                    let (s, t) = if along > across { (half, t) } else { (s, half) };
                    self.area_panel(element, twist, centre, s, t, depth + 1, sum);
                }
                return;
            }
            let ratio = along.max(across) / distance;
            points = FEWER.iter().find(|few| ratio <= few.0).map_or(POINTS, |few| few.1);
        }
        let [u1, u2, omega] = twist;
        for &(ns, ws) in &RULES[if element.arc { POINTS } else { points }] {
            let (x, dx) = self.at(element, s[0] + ns * (s[1] - s[0]));
            let (foot, turn) = self.foot(x, dx);
            if turn == 0.0 {
                continue;
            }
            let turn = ws * (s[1] - s[0]) * turn;
            for &(nt, wt) in &RULES[points] {
                let x = foot.lerp(x, t[0] + nt * (t[1] - t[0]));
                let weight = turn * wt * (t[1] - t[0]) * self.u.value(x);
                let v = DVec2::new(u1 - omega * x.y, u2 + omega * x.x);
                let speed = v.length();
                let e = v / speed;
                sum.value += weight * speed;
                let tangent = [e.x, e.y, x.perp_dot(e)];
                let normal = [e.y, -e.x, -x.dot(e)];
                let bend = weight / speed;
                for i in 0..3 {
                    sum.gradient[i] += weight * tangent[i];
                    for j in 0..3 {
                        sum.hessian[i][j] += bend * normal[i] * normal[j];
                    }
                }
            }
        }
    }

    /// The boundary's part of the integrals about the slip centre, cut finer towards it.
    fn edge_panel(
        &self,
        element: &Element,
        centre: DVec2,
        s: [f64; 2],
        depth: u32,
        sum: &mut EdgeSums,
    ) {
        let middle = 0.5 * (s[0] + s[1]);
        let length = (self.at(element, s[1]).0 - self.at(element, s[0]).0).length();
        let distance = (self.at(element, middle).0 - centre).length();
        if length > PANEL * distance && depth < 48 {
            self.edge_panel(element, centre, [s[0], middle], depth + 1, sum);
            self.edge_panel(element, centre, [middle, s[1]], depth + 1, sum);
            return;
        }
        let here = self.u.value(centre);
        let slope = self.u.slope(centre);
        for &(node, weight) in &RULES[POINTS] {
            let (x, dx) = self.at(element, s[0] + node * (s[1] - s[0]));
            let y = x - centre;
            let r = y.length();
            if r == 0.0 {
                continue;
            }
            let turn = weight * (s[1] - s[0]) * y.perp_dot(dx);
            let e = y / r;
            let (one, two) = (slope.dot(y), 0.5 * self.u.l.dot(y * y));
            let moment = turn * r * (here / 3.0 + one / 4.0 + two / 5.0);
            let force = turn * (here / 2.0 + one / 3.0 + two / 4.0);
            let bend = turn / r * (here + one / 2.0 + two / 3.0);
            sum.r += moment;
            sum.e += force * e;
            sum.h[0] += bend * e.x * e.x;
            sum.h[1] += bend * e.x * e.y;
            sum.h[2] += bend * e.y * e.y;
        }
    }
}

/// `int u r`, `int u e` and `int u e e^T / r` about the slip centre, `e` the unit vector from it.
#[derive(Debug, Clone, Copy, Default)]
struct EdgeSums {
    r: f64,
    e: DVec2,
    h: [f64; 3],
}

impl EdgeSums {
    fn assemble(&self, c: DVec2, omega: f64) -> Dissipation {
        let sign = omega.signum();
        let force = sign * self.e.perp();
        let [h11, h12, h22] = self.h.map(|h| h / omega.abs());
        let h13 = -c.y * h11 + c.x * h12;
        let h23 = -c.y * h12 + c.x * h22;
        let h33 = -c.y * h13 + c.x * h23;
        Dissipation {
            value: omega.abs() * self.r,
            gradient: [force.x, force.y, sign * self.r + c.perp_dot(force)],
            hessian: [[h11, h12, h13], [h12, h22, h23], [h13, h23, h33]],
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

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(half: DVec2) -> Ring {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| half * DVec2::new(x, y))
            .to_vec()
    }

    fn shapes() -> Vec<(Vec<Ring>, Quadratic)> {
        let square = vec![rectangle(DVec2::new(2.0, 1.5))];
        let mut hollow = square.clone();
        hollow.push(rectangle(DVec2::new(0.3, 0.2)).into_iter().rev().collect());
        let kinds = [
            // Cylinder with and without tilt, parted; sphere; barrel cut by the ends; planes; bore.
            (1.0, (0.0, 0.0), (0.0, -4.0)),
            (1.0, (0.2, 0.1), (0.0, -4.0)),
            (0.3, (0.4, 0.0), (0.0, -4.0)),
            (0.5, (0.1, -0.2), (-1.5, -1.5)),
            (1.0, (0.1, 0.2), (-0.2, -3.0)),
            (1.0, (0.1, 0.2), (-3.0, -0.1)),
            (1.0, (0.2, -0.1), (0.0, 0.0)),
            (0.5, (0.6, -0.2), (0.0, 0.0)),
            (-0.5, (0.1, 0.05), (0.0, 2.0)),
        ];
        let quadratic = |(c, g, l): (f64, (f64, f64), (f64, f64))| Quadratic {
            c,
            g: DVec2::from(g),
            l: DVec2::from(l),
        };
        kinds
            .into_iter()
            .flat_map(|kind| [(square.clone(), quadratic(kind)), (hollow.clone(), quadratic(kind))])
            .collect()
    }

    /// The integrals as they are defined: lines of Gauss points between all places where something
    /// happens on the line.
    fn by_lines(rings: &[Ring], u: &Quadratic, f: impl Fn(DVec2) -> f64) -> f64 {
        let mut total = 0.0;
        let n = 3000;
        for i in 0..n {
            let x = -2.0 + 4.0 * (f64::from(i) + 0.5) / f64::from(n);
            let mut cuts = vec![-1.5, 1.5, -0.2, 0.2];
            let at = |y: f64| u.value(DVec2::new(x, y));
            let bend = 0.5 * u.l.y;
            cuts.extend(roots(at(0.0), u.g.y, bend).into_iter().flatten());
            cuts.retain(|y| y.abs() <= 1.5);
            cuts.sort_by(f64::total_cmp);
            for pair in cuts.windows(2) {
                let middle = DVec2::new(x, 0.5 * (pair[0] + pair[1]));
                if !contains(rings, middle) || u.value(middle) <= 0.0 {
                    continue;
                }
                for &(t, w) in &RULES[12] {
                    let y = DVec2::new(x, pair[0] + t * (pair[1] - pair[0]));
                    total += w * (pair[1] - pair[0]) * f(y) * u.value(y);
                }
            }
        }
        total * 4.0 / f64::from(n)
    }

    #[test]
    fn areas_and_dissipations_agree_with_lines_of_points() {
        for (rings, u) in shapes() {
            let region = Region::new(&rings, u);
            let (_, load) = region.area_and_load();
            let wanted = by_lines(&rings, &u, |_| 1.0);
            assert!((load / wanted - 1.0).abs() < 3e-5, "{u:?} {load} {wanted}");
            for twist in [[0.3, 0.2, 1.0], [1.0, -2.0, 0.3], [0.0, 0.1, -1.0], [1.0, 0.5, 0.0]] {
                let got = region.dissipation(twist).value;
                let [u1, u2, omega] = twist;
                let speed = |x: DVec2| DVec2::new(u1 - omega * x.y, u2 + omega * x.x).length();
                let wanted = by_lines(&rings, &u, speed);
                assert!((got / wanted - 1.0).abs() < 3e-5, "{u:?} {twist:?} {got} {wanted}");
            }
        }
    }

    /// Both ways to integrate agree where both apply, and the derivatives are those of the value.
    #[test]
    fn both_ways_agree_and_the_derivatives_are_those_of_the_value() {
        for (rings, u) in shapes() {
            let region = Region::new(&rings, u);
            for i in 0..40 {
                let angle = 0.7 * f64::from(i);
                let c = region.middle
                    + region.half * (0.1 + 0.05 * f64::from(i)) * DVec2::from_angle(angle);
                let twist = [c.y, -c.x, 1.0].map(|x| if i % 2 == 0 { x } else { -x });
                let got = region.dissipation(twist);
                // Points of the area serve at a slip centre inside too, on many panels.
                let (mut points, mut edge) = (Dissipation::default(), EdgeSums::default());
                for element in &region.elements {
                    region.area_panel(element, twist, c, [0.0, 1.0], [0.0, 1.0], 0, &mut points);
                    region.edge_panel(element, c, [0.0, 1.0], 0, &mut edge);
                }
                let edges = edge.assemble(c, twist[2]);
                assert!(
                    (points.value / edges.value - 1.0).abs() < 1e-11,
                    "{u:?} {twist:?} {points:?} {edges:?}"
                );
                let euler: f64 = (0..3).map(|k| got.gradient[k] * twist[k]).sum();
                assert!((euler / got.value - 1.0).abs() < 1e-13, "{u:?} {twist:?} {got:?}");
                let step = 1e-5;
                for k in 0..3 {
                    let moved = |by: f64| {
                        let mut twist = twist;
                        twist[k] += by;
                        region.dissipation(twist)
                    };
                    let (up, down) = (moved(step), moved(-step));
                    let slope = (up.value - down.value) / (2.0 * step);
                    assert!(
                        (slope - got.gradient[k]).abs() < 1e-7 * got.value,
                        "{u:?} {twist:?} {k}: {slope} {got:?}"
                    );
                    for j in 0..3 {
                        let bend = (up.gradient[j] - down.gradient[j]) / (2.0 * step);
                        assert!(
                            (bend - got.hessian[j][k]).abs() < 1e-5 * got.value,
                            "{u:?} {twist:?} {j}{k}: {bend} {got:?}"
                        );
                    }
                }
            }
        }
    }

    /// The sphere's closed form: pressure `1 - r^2` on the unit disc, slip centre at a distance.
    #[test]
    fn the_sphere_agrees_with_its_closed_form() {
        let u = Quadratic { c: 1.0, g: DVec2::ZERO, l: DVec2::splat(-2.0) };
        let region = Region::new(&[rectangle(DVec2::splat(3.0))], u);
        let (area, load) = region.area_and_load();
        let half = std::f64::consts::FRAC_PI_2;
        assert!((load / half - 1.0).abs() < 1e-14 && (area / half - 2.0).abs() < 1e-7);
        for (k, wanted) in [
            (0.0, 4.0 * std::f64::consts::PI / 15.0),
            (0.3, 0.930_427_403_020_475_5),
            (0.6, 1.190_088_973_586_390_5),
            (0.95, 1.636_037_182_195_247_7),
            (1.0, 128.0 / 75.0),
        ] {
            let got = region.dissipation([0.0, -k, 1.0]).value;
            assert!((got / wanted - 1.0).abs() < 1e-14, "{k}: {got} {wanted}");
        }
    }

    /// The planar integrals of this library, for the special case of a plane.
    #[test]
    fn a_plane_agrees_with_the_planar_closed_forms() {
        use crate::contact::{Field, Loops, Twist, friction};
        use crate::model::Polygon;
        let ring = rectangle(DVec2::new(2.0, 1.5));
        let area = Loops::new(&[Polygon { outer: ring.clone(), holes: Vec::new() }]);
        let p = [1.0, 0.3, -0.2];
        let u = Quadratic { c: p[0], g: DVec2::new(p[1], p[2]), l: DVec2::ZERO };
        let region = Region::new(&[ring], u);
        for i in 0..60 {
            let c = 0.1 * f64::from(i) * DVec2::from_angle(f64::from(i));
            let twist = [c.y, -c.x, 1.0];
            let wanted = friction(Field { area: &area, p }, Twist::about(c));
            let gradient = wanted.gradient(p);
            let got = region.dissipation(twist);
            for j in 0..3 {
                assert!((got.gradient[j] - gradient[j]).abs() < 1e-13 * 12.0 * (1.0 + c.length()));
                for k in 0..3 {
                    let off = (got.hessian[j][k] - wanted.hessian[j][k]).abs();
                    assert!(off < 1e-12 * (1.0 + c.length_squared()) * 12.0, "{c:?} {off:e}");
                }
            }
        }
    }
}

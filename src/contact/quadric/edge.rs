//! The rule for slip centres in the area or near it: its boundary.
//!
//! Along a straight piece at the distance `d` from the slip centre, `y = d n + s t`, all integrands
//! are `s^k r`, `s^k / r` and `s^k / r^3` with `r^2 = d^2 + s^2`: closed forms, where the slip
//! centre is so near that a rule would need many panels.

use glam::DVec2;

use super::{Arc, BLOCKS, Dissipation, Element, MORE, PANEL, POINTS, Region, enough};
use crate::contact::lanes::{LANES, Lane, totals, widest};

/// `int u r`, `int u e` and `int u e e^T / r` about the slip centre, `e` the unit vector from it; the
/// first two also for `1`, `y1`, `y2` in place of `u`, `y` the place as seen from the centre.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct EdgeSums {
    r: f64,
    e: DVec2,
    h: [f64; 3],
    by_r: [f64; 3],
    by_e: [DVec2; 3],
}

impl EdgeSums {
    pub(super) fn assemble(&self, c: DVec2, omega: f64) -> (Dissipation, [[f64; 3]; 3]) {
        let sign = omega.signum();
        let gradient = |r: f64, e: DVec2| {
            let force = sign * e.perp();
            [force.x, force.y, sign * r + c.perp_dot(force)]
        };
        let [h11, h12, h22] = self.h.map(|h| h / omega.abs());
        let h13 = -c.y * h11 + c.x * h12;
        let h23 = -c.y * h12 + c.x * h22;
        let h33 = -c.y * h13 + c.x * h23;
        // x = c + y.
        let by = [
            gradient(self.by_r[0], self.by_e[0]),
            gradient(c.x * self.by_r[0] + self.by_r[1], c.x * self.by_e[0] + self.by_e[1]),
            gradient(c.y * self.by_r[0] + self.by_r[2], c.y * self.by_e[0] + self.by_e[2]),
        ];
        let found = Dissipation {
            value: omega.abs() * self.r,
            gradient: gradient(self.r, self.e),
            hessian: [[h11, h12, h13], [h12, h22, h23], [h13, h23, h33]],
        };
        (found, by)
    }
}

/// Length of a straight piece over its middle's distance from the slip centre from which on the
/// closed forms are taken: below it they lose digits, and few points do.
const CLOSED: f64 = 0.4;

/// Integrals along a straight line at the distance `d` from the slip centre, `s` from its foot.
struct Along {
    /// `int s^k r ds`.
    r: [f64; 3],
    /// `int s^k / r ds`.
    over_r: [f64; 4],
    /// `int s^k / r^3 ds`, of which the first times `d^2`.
    over_r3: [f64; 5],
}

impl Along {
    /// From `from` to `to`; `d` must not be zero.
    fn new(d: f64, from: f64, to: f64) -> Self {
        let d2 = d * d;
        let [one, two] = [from, to].map(|s| (d2 + s * s).sqrt());
        // What grows from end to end, without differences of near numbers.
        let log = if from >= 0.0 {
            ((to + two) / (from + one)).ln()
        } else if to <= 0.0 {
            ((one - from) / (two - to)).ln()
        } else {
            ((to + two) / d.abs() * ((one - from) / d.abs())).ln()
        };
        let grown = |f: &dyn Fn(f64, f64) -> f64| f(to, two) - f(from, one);
        let mut over = [log, grown(&|_, r| r), 0.0, 0.0, 0.0];
        over[2] = 0.5 * (grown(&|s, r| s * r) - d2 * over[0]);
        over[3] = (grown(&|s, r| s * s * r) - 2.0 * d2 * over[1]) / 3.0;
        over[4] = (grown(&|s, r| s * s * s * r) - 3.0 * d2 * over[2]) / 4.0;
        let [inverse, turn] = [grown(&|_, r| r.recip()), grown(&|s, r| s / r)];
        let second = over[0] - turn;
        Self {
            r: [0, 1, 2].map(|k| d2 * over[k] + over[k + 2]),
            over_r: [over[0], over[1], over[2], over[3]],
            over_r3: [turn, -inverse, second, over[1] + d2 * inverse, over[2] - d2 * second],
        }
    }
}

/// A part of an element, with the blocks of nodes that it takes.
#[derive(Debug, Clone, Copy, Default)]
struct Panel {
    element: usize,
    from: f64,
    length: f64,
    blocks: usize,
}

/// Panels taken together, so that one call serves many.
const MOST: usize = 32;

/// What is still to be summed of a boundary.
struct Panels {
    list: [Panel; MOST],
    count: usize,
    by: bool,
    centre: DVec2,
    lanes: Lanes,
    sum: EdgeSums,
}

/// [`EdgeSums`] by lanes.
type Lanes = [Lane; 14];

/// What all nodes of a region have in common.
#[derive(Clone, Copy)]
struct About {
    centre: [f64; 2],
    /// The quadratic at the centre, its slope there, and its bends.
    here: f64,
    slope: [f64; 2],
    bend: [f64; 2],
    /// Its slope at the origin.
    origin: [f64; 2],
    by: bool,
}

widest! {
    /// Adds the panels to the lanes.
    fn add_panels(region: &Region, about: About, panels: &[Panel], lanes: &mut Lanes) -> () = add_panels_in
}

#[inline(always)]
fn add_panels_in(region: &Region, about: About, panels: &[Panel], lanes: &mut Lanes) {
    for panel in panels {
        let element = &region.elements[panel.element];
        let nodes = &BLOCKS[panel.blocks];
        match (about.by, element.arc.is_some()) {
            (true, true) => add_panel::<true, true>(element, about, panel, nodes, lanes),
            (true, false) => add_panel::<true, false>(element, about, panel, nodes, lanes),
            (false, true) => add_panel::<false, true>(element, about, panel, nodes, lanes),
            (false, false) => add_panel::<false, false>(element, about, panel, nodes, lanes),
        }
    }
}

#[inline(always)]
fn add_panel<const BY: bool, const ARC: bool>(
    element: &Element,
    about: About,
    panel: &Panel,
    nodes: &[[Lane; 2]],
    lanes: &mut Lanes,
) {
    let About { centre, here, slope, bend: [l1, l2], origin, .. } = about;
    let step = element.b - element.a;
    let arc = element.arc.unwrap_or(Arc::STRAIGHT);
    let [n1, n2] = arc.normal.to_array();
    for [node, weight] in nodes {
        for i in 0..LANES {
            let t = panel.from + node[i] * panel.length;
            let (mut x1, mut x2) = (element.a.x + t * step.x, element.a.y + t * step.y);
            let (mut d1, mut d2) = (step.x, step.y);
            if ARC {
                let value = arc.bend * t * (t - 1.0);
                let steep = arc.slope[0] + t * arc.slope[1];
                let root = (steep * steep - 4.0 * arc.curve * value).max(0.0).sqrt();
                let off = -2.0 * value / (steep + root.copysign(steep));
                let is_off = off.abs() < f64::INFINITY;
                let off = if is_off { off } else { 0.0 };
                (x1, x2) = (x1 + off * n1, x2 + off * n2);
                let (g1, g2) = (origin[0] + l1 * x1, origin[1] + l2 * x2);
                let ratio = (g1 * step.x + g2 * step.y) / (g1 * n1 + g2 * n2);
                let ratio = if is_off { ratio } else { 0.0 };
                (d1, d2) = (d1 - ratio * n1, d2 - ratio * n2);
            }
            let (y1, y2) = (x1 - centre[0], x2 - centre[1]);
            let r = (y1 * y1 + y2 * y2).sqrt();
            // A node at the slip centre itself adds nothing.
            let inverse = if r > 0.0 { 1.0 / r } else { 0.0 };
            let turn = weight[i] * panel.length * (y1 * d2 - y2 * d1);
            let (e1, e2) = (inverse * y1, inverse * y2);
            let one = slope[0] * y1 + slope[1] * y2;
            let two = 0.5 * (l1 * y1 * y1 + l2 * y2 * y2);
            let force = turn * (here * (1.0 / 2.0) + one * (1.0 / 3.0) + two * (1.0 / 4.0));
            let bend = turn * inverse * (here + one * (1.0 / 2.0) + two * (1.0 / 3.0));
            lanes[0][i] += turn * r * (here * (1.0 / 3.0) + one * (1.0 / 4.0) + two * (1.0 / 5.0));
            lanes[1][i] += force * e1;
            lanes[2][i] += force * e2;
            lanes[3][i] += bend * e1 * e1;
            lanes[4][i] += bend * e1 * e2;
            lanes[5][i] += bend * e2 * e2;
            if BY {
                lanes[6][i] += turn * r;
                lanes[7][i] += turn * r * y1;
                lanes[8][i] += turn * r * y2;
                lanes[9][i] += turn * e1;
                lanes[10][i] += turn * e2;
                lanes[11][i] += turn * y1 * e1;
                lanes[12][i] += turn * y1 * e2;
                lanes[13][i] += turn * y2 * e2;
            }
        }
    }
}

impl Panels {
    fn push(&mut self, region: &Region, panel: Panel) {
        if self.count == MOST {
            self.flush(region);
        }
        self.list[self.count] = panel;
        self.count += 1;
    }

    fn flush(&mut self, region: &Region) {
        let about = About {
            centre: self.centre.to_array(),
            here: region.u.value(self.centre),
            slope: region.u.slope(self.centre).to_array(),
            bend: region.u.l.to_array(),
            origin: region.u.g.to_array(),
            by: self.by,
        };
        add_panels(region, about, &self.list[..self.count], &mut self.lanes);
        self.count = 0;
    }

    fn finish(mut self, region: &Region) -> EdgeSums {
        self.flush(region);
        let s = totals(&self.lanes);
        let mut sum = self.sum;
        sum.r += s[0];
        sum.e += DVec2::new(s[1], s[2]);
        (0..3).for_each(|k| sum.h[k] += s[3 + k]);
        sum.by_r[0] += s[6] / 3.0;
        sum.by_r[1] += s[7] / 4.0;
        sum.by_r[2] += s[8] / 4.0;
        sum.by_e[0] += DVec2::new(s[9], s[10]) / 2.0;
        sum.by_e[1] += DVec2::new(s[11], s[12]) / 3.0;
        sum.by_e[2] += DVec2::new(s[12], s[13]) / 3.0;
        sum
    }
}

impl Region {
    /// The integrals about the slip centre along the whole boundary; `by`: those for `1`, `y1` and
    /// `y2` in place of `u` as well.
    pub(super) fn edges(&self, centre: DVec2, by: bool) -> EdgeSums {
        let list = [Panel::default(); MOST];
        let (lanes, sum) = (Lanes::default(), EdgeSums::default());
        let mut panels = Panels { list, count: 0, by, centre, lanes, sum };
        for (index, element) in self.elements.iter().enumerate() {
            // An edge on a line through the slip centre adds nothing.
            let across = (element.a - centre).perp_dot(element.b - element.a);
            if element.arc.is_some() || across != 0.0 {
                self.edge(index, [0.0, 1.0], [element.a, element.b], 0, &mut panels);
            }
        }
        panels.finish(self)
    }

    /// An element's part between two points of its chord, cut finer towards the slip centre.
    fn edge(&self, index: usize, s: [f64; 2], ends: [DVec2; 2], depth: u32, panels: &mut Panels) {
        let element = &self.elements[index];
        let middle = 0.5 * (s[0] + s[1]);
        let between = self.at(element, middle).0;
        let length = (ends[1] - ends[0]).length();
        let distance = (between - panels.centre).length();
        if element.arc.is_none() && length > CLOSED * distance {
            return self.straight_edge(element, panels);
        }
        if length > PANEL * distance && depth < 48 {
            self.edge(index, [s[0], middle], [ends[0], between], depth + 1, panels);
            self.edge(index, [middle, s[1]], [between, ends[1]], depth + 1, panels);
            return;
        }
        let bent = element.arc.map_or(0.0, |arc| arc.bent * (s[1] - s[0]));
        let points = (enough((length / distance).max(bent)) + MORE).min(POINTS);
        let blocks = points.div_ceil(LANES);
        panels.push(self, Panel { element: index, from: s[0], length: s[1] - s[0], blocks });
    }

    /// The share of a straight piece in closed form.
    fn straight_edge(&self, element: &Element, panels: &mut Panels) {
        let (centre, sum) = (panels.centre, &mut panels.sum);
        let step = element.b - element.a;
        let t = step / step.length();
        let n = DVec2::new(t.y, -t.x);
        let d = n.dot(element.a - centre);
        if d == 0.0 {
            return;
        }
        let along = Along::new(d, t.dot(element.a - centre), t.dot(element.b - centre));
        // The quadratic by degrees about the slip centre, and these by powers of `s`.
        let (here, slope, l) = (self.u.value(centre), self.u.slope(centre), self.u.l);
        let one = [d * slope.dot(n), slope.dot(t)];
        let two = [0.5 * d * d * l.dot(n * n), d * l.dot(n * t), 0.5 * l.dot(t * t)];
        let powers = |zeroth: f64, first: f64, second: f64| {
            [
                here / zeroth + one[0] / first + two[0] / second,
                one[1] / first + two[1] / second,
                two[2] / second,
            ]
        };
        let dot = |powers: &[f64; 3], from: &[f64]| {
            powers[0] * from[0] + powers[1] * from[1] + powers[2] * from[2]
        };
        let Along { r, over_r: i, over_r3: k } = &along;
        sum.r += d * dot(&powers(3.0, 4.0, 5.0), r);
        let force = powers(2.0, 3.0, 4.0);
        sum.e += d * (d * dot(&force, &i[..3]) * n + dot(&force, &i[1..]) * t);
        let bend = powers(1.0, 2.0, 3.0);
        let across = d * (bend[0] * k[0] + d * d * (bend[1] * k[1] + bend[2] * k[2]));
        let (mixed, beside) = (d * d * dot(&bend, &k[1..4]), d * dot(&bend, &k[2..]));
        sum.h[0] += across * n.x * n.x + 2.0 * mixed * n.x * t.x + beside * t.x * t.x;
        sum.h[1] += across * n.x * n.y + mixed * (n.x * t.y + n.y * t.x) + beside * t.x * t.y;
        sum.h[2] += across * n.y * n.y + 2.0 * mixed * n.y * t.y + beside * t.y * t.y;
        if panels.by {
            let e = d * n * i[0] + i[1] * t;
            let by_s = d * n * i[1] + i[2] * t;
            sum.by_e[0] += d / 2.0 * e;
            sum.by_e[1] += d / 3.0 * (d * n.x * e + t.x * by_s);
            sum.by_e[2] += d / 3.0 * (d * n.y * e + t.y * by_s);
            sum.by_r[0] += d / 3.0 * r[0];
            sum.by_r[1] += d / 4.0 * (d * n.x * r[0] + t.x * r[1]);
            sum.by_r[2] += d / 4.0 * (d * n.y * r[0] + t.y * r[1]);
        }
    }
}

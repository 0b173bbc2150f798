//! The rule for slip centres in the area or near it: its boundary.
//!
//! Along a straight piece at the distance `d` from the slip centre, `y = d n + s t`, all integrands
//! are `s^k r`, `s^k / r` and `s^k / r^3` with `r^2 = d^2 + s^2`: closed forms, where the slip
//! centre is so near that a rule would need many panels.

use glam::DVec2;

use super::{Dissipation, Element, MORE, PANEL, POINTS, Region, enough};
use crate::contact::far::RULES;

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

impl Region {
    /// The share of a straight piece in closed form.
    fn straight_edge<const BY: bool>(&self, element: &Element, centre: DVec2, sum: &mut EdgeSums) {
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
        if BY {
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

    /// The boundary's part of the integrals about the slip centre, cut finer towards it.
    pub(super) fn edge_panel<const BY: bool>(
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
        if element.arc.is_none() && length > CLOSED * distance {
            self.straight_edge::<BY>(element, centre, sum);
            return;
        }
        if length > PANEL * distance && depth < 48 {
            self.edge_panel::<BY>(element, centre, [s[0], middle], depth + 1, sum);
            self.edge_panel::<BY>(element, centre, [middle, s[1]], depth + 1, sum);
            return;
        }
        let bent = element.arc.map_or(0.0, |arc| arc.bent * (s[1] - s[0]));
        let points = (enough((length / distance).max(bent)) + MORE).min(POINTS);
        let here = self.u.value(centre);
        let slope = self.u.slope(centre);
        for &(node, weight) in &RULES[points] {
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
            if BY {
                let (of_one, of_y) = (turn / 2.0, turn / 3.0 * y);
                sum.by_e[0] += of_one * e;
                sum.by_e[1] += of_y.x * e;
                sum.by_e[2] += of_y.y * e;
                sum.by_r[0] += r * turn / 3.0;
                sum.by_r[1] += r * turn / 4.0 * y.x;
                sum.by_r[2] += r * turn / 4.0 * y.y;
            }
        }
    }
}

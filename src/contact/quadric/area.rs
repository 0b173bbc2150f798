//! The rule for slip centres off the area: points of the area itself.

use glam::DVec2;

use super::{Dissipation, Element, MORE, PANEL, POINTS, Region, by_pressure, enough};
use crate::contact::far::RULES;

impl Region {
    /// Points between a part of an element and the line of [`Self::foot`], `range` of both
    /// parameters, cut until the slip centre is far from each part.
    pub(super) fn area_panel<const BY: bool>(
        &self,
        element: &Element,
        twist: [f64; 3],
        centre: DVec2,
        range: [[f64; 2]; 2],
        depth: u32,
        sum: &mut (Dissipation, [[f64; 3]; 3]),
    ) {
        let [s, t] = range;
        let middle = |r: [f64; 2]| 0.5 * (r[0] + r[1]);
        let line = |s: f64| {
            let (x, dx) = self.at(element, s);
            (self.foot(x, dx).0, x)
        };
        let lines = [s[0], middle(s), s[1]].map(line);
        let point = |line: (DVec2, DVec2), t: f64| line.0.lerp(line.1, t);
        let along = (point(lines[2], t[1]) - point(lines[0], t[1])).length();
        let across = |line: (DVec2, DVec2)| (t[1] - t[0]) * (line.1 - line.0).length();
        let distance = (point(lines[1], middle(t)) - centre).length();
        let wide = across(lines[1]);
        if along.max(wide) > PANEL * distance && depth < 40 {
            let split = |r: [f64; 2]| [[r[0], middle(r)], [middle(r), r[1]]];
            for part in split(if along > wide { s } else { t }) {
                let range = if along > wide { [part, t] } else { [s, part] };
                self.area_panel::<BY>(element, twist, centre, range, depth + 1, sum);
            }
            return;
        }
        // As seen from the nearer end.
        let widest = lines.map(across).into_iter().fold(0.0, f64::max);
        let bent = element.arc.map_or(0.0, |arc| arc.bent * (s[1] - s[0]));
        let [of_along, of_wide] = [(along, widest), (widest, along)]
            .map(|(length, other)| length / (distance - 0.5 * other).max(0.5 * length));
        let counts = [(enough(of_along.max(bent)) + MORE).min(POINTS), enough(of_wide)];
        let rules = counts.map(|count| RULES[count].as_slice());
        self.area_sums::<BY>(element, twist, range, rules, sum);
    }

    /// Points of the part between an element and the line of [`Self::foot`] by Gauss rules along and
    /// across.
    pub(super) fn area_sums<const BY: bool>(
        &self,
        element: &Element,
        [u1, u2, omega]: [f64; 3],
        [s, t]: [[f64; 2]; 2],
        [along, across]: [&[(f64, f64)]; 2],
        (sum, by): &mut (Dissipation, [[f64; 3]; 3]),
    ) {
        // Upper half of the second derivatives by rows.
        let (mut value, mut gradient, mut bends) = (0.0, [0.0; 3], [0.0; 6]);
        for &(ns, ws) in along {
            let (x, dx) = self.at(element, s[0] + ns * (s[1] - s[0]));
            let (foot, turn) = self.foot(x, dx);
            if turn == 0.0 {
                continue;
            }
            let turn = ws * (s[1] - s[0]) * turn * (t[1] - t[0]);
            for &(nt, wt) in across {
                let x = foot.lerp(x, t[0] + nt * (t[1] - t[0]));
                let area = turn * wt;
                let weight = area * self.u.value(x);
                let v = DVec2::new(u1 - omega * x.y, u2 + omega * x.x);
                let speed = v.length();
                let inverse = speed.recip();
                let e = inverse * v;
                let (turned, along) = (x.perp_dot(e), x.dot(e));
                value += weight * speed;
                gradient[0] += weight * e.x;
                gradient[1] += weight * e.y;
                gradient[2] += weight * turned;
                let bend = weight * inverse;
                bends[0] += bend * e.y * e.y;
                bends[1] -= bend * e.y * e.x;
                bends[2] -= bend * e.y * along;
                bends[3] += bend * e.x * e.x;
                bends[4] += bend * e.x * along;
                bends[5] += bend * along * along;
                if BY {
                    by_pressure(by, area, x, [e.x, e.y, turned]);
                }
            }
        }
        sum.value += value;
        sum.gradient.iter_mut().zip(gradient).for_each(|(sum, more)| *sum += more);
        let [a, b, c, d, e, f] = bends;
        for (row, more) in sum.hessian.iter_mut().zip([[a, b, c], [b, d, e], [c, e, f]]) {
            row.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
    }
}

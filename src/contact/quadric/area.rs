//! The rule for slip centres off the area: points of the area itself.

use glam::DVec2;

use super::{BLOCKS, Dissipation, Element, MORE, PANEL, POINTS, Region, enough};
use crate::contact::far::RULES;
use crate::contact::lanes::{LANES, Lane, totals, widest};

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
        self.area_sums::<BY>(element, twist, range, counts, sum);
    }

    /// Points of the part between an element and the line of [`Region::foot`] by Gauss rules with at
    /// least as many nodes along and across.
    pub(super) fn area_sums<const BY: bool>(
        &self,
        element: &Element,
        twist: [f64; 3],
        range: [[f64; 2]; 2],
        counts: [usize; 2],
        (sum, by): &mut (Dissipation, [[f64; 3]; 3]),
    ) {
        let rules = (&RULES[counts[0]][..], &BLOCKS[counts[1].div_ceil(LANES)][..]);
        let lanes = add_nodes(self, element, twist, range, rules, BY);
        let s = totals(&lanes);
        sum.value += s[0];
        for i in 0..3 {
            sum.gradient[i] += s[1 + i];
        }
        let [a, b, c, d, e, f] = [s[4], s[5], s[6], s[7], s[8], s[9]];
        for (row, more) in sum.hessian.iter_mut().zip([[a, b, c], [b, d, e], [c, e, f]]) {
            row.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        for (sum, more) in by.iter_mut().flatten().zip(&s[10..]) {
            *sum += more;
        }
    }
}

/// The value, the gradient, the upper half of the second derivatives by rows, and the gradients for
/// `1`, `x1`, `x2` in place of the pressure; by lanes.
type Lanes = [Lane; 19];

/// Nodes along, and by fours across.
type Rules<'a> = (&'a [(f64, f64)], &'a [[Lane; 2]]);

widest! {
    /// What the points of a part add.
    fn add_nodes(region: &Region, element: &Element, twist: [f64; 3], range: [[f64; 2]; 2], rules: Rules<'_>, by: bool) -> Lanes = nodes_in
}

#[inline(always)]
fn nodes_in(
    region: &Region,
    element: &Element,
    twist: [f64; 3],
    range: [[f64; 2]; 2],
    rules: Rules<'_>,
    by: bool,
) -> Lanes {
    if by {
        nodes_of::<true>(region, element, twist, range, rules)
    } else {
        nodes_of::<false>(region, element, twist, range, rules)
    }
}

#[inline(always)]
fn nodes_of<const BY: bool>(
    region: &Region,
    element: &Element,
    [u1, u2, omega]: [f64; 3],
    [s, t]: [[f64; 2]; 2],
    (along, across): Rules<'_>,
) -> Lanes {
    let mut lanes = [[0.0; LANES]; 19];
    for &(node, weight) in along {
        let (x, dx) = region.at(element, s[0] + node * (s[1] - s[0]));
        let (foot, turn) = region.foot(x, dx);
        if turn == 0.0 {
            continue;
        }
        let turn = weight * (s[1] - s[0]) * turn * (t[1] - t[0]);
        let way = x - foot;
        for [nodes, weights] in across {
            for i in 0..LANES {
                let far = t[0] + nodes[i] * (t[1] - t[0]);
                let at = DVec2::new(foot.x + far * way.x, foot.y + far * way.y);
                let area = turn * weights[i];
                let weight = area * region.u.value(at);
                let (v1, v2) = (u1 - omega * at.y, u2 + omega * at.x);
                let speed = (v1 * v1 + v2 * v2).sqrt();
                let inverse = 1.0 / speed;
                let (e1, e2) = (inverse * v1, inverse * v2);
                let (turned, along) = (at.x * e2 - at.y * e1, at.x * e1 + at.y * e2);
                let bend = weight * inverse;
                lanes[0][i] += weight * speed;
                lanes[1][i] += weight * e1;
                lanes[2][i] += weight * e2;
                lanes[3][i] += weight * turned;
                lanes[4][i] += bend * e2 * e2;
                lanes[5][i] -= bend * e2 * e1;
                lanes[6][i] -= bend * e2 * along;
                lanes[7][i] += bend * e1 * e1;
                lanes[8][i] += bend * e1 * along;
                lanes[9][i] += bend * along * along;
                if BY {
                    let (first, second) = (area * at.x, area * at.y);
                    lanes[10][i] += area * e1;
                    lanes[11][i] += area * e2;
                    lanes[12][i] += area * turned;
                    lanes[13][i] += first * e1;
                    lanes[14][i] += first * e2;
                    lanes[15][i] += first * turned;
                    lanes[16][i] += second * e1;
                    lanes[17][i] += second * e2;
                    lanes[18][i] += second * turned;
                }
            }
        }
    }
    lanes
}

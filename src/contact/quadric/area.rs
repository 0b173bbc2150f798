//! The rule for slip centres off the area: points of the area itself.

use std::sync::LazyLock;

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
        sum: &mut (Dissipation, [[f64; 3]; 3]),
    ) {
        let rules = (&RULES[counts[0]][..], &BLOCKS[counts[1].div_ceil(LANES)][..]);
        add(&add_nodes(self, element, twist, range, rules, BY), sum);
    }

    /// Points of an area with straight sides, by triangles from one of its corners, about a slip centre
    /// as far away as [`super::FAR`] says.
    pub(super) fn triangles<const BY: bool>(
        &self,
        twist: [f64; 3],
        centre: DVec2,
        sum: &mut (Dissipation, [[f64; 3]; 3]),
    ) {
        let Some(first) = self.elements.first() else { return };
        let base = first.a;
        let (mut list, mut count) = ([Triangle::default(); MOST], 0);
        let mut lanes = [[0.0; LANES]; 19];
        for &Element { a, b, .. } in &self.elements {
            if a == base || b == base {
                continue;
            }
            if count == MOST {
                add_triangles(self, twist, &list, &mut lanes, BY);
                count = 0;
            }
            list[count] = Triangle::new([base, a, b], centre);
            count += 1;
        }
        add_triangles(self, twist, &list[..count], &mut lanes, BY);
        add(&lanes, sum);
    }
}

/// Adds the totals of lanes.
fn add(lanes: &Lanes, (sum, by): &mut (Dissipation, [[f64; 3]; 3])) {
    let s = totals(lanes);
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

/// A corner and the sides from it, with the points that it takes along each.
#[derive(Debug, Clone, Copy, Default)]
struct Triangle {
    a: DVec2,
    sides: [DVec2; 2],
    points: usize,
}

/// Triangles taken together, so that one call serves many.
const MOST: usize = 16;

impl Triangle {
    fn new([a, b, c]: [DVec2; 3], centre: DVec2) -> Self {
        let sides = [b - a, c - a];
        let longest = sides[0].length().max(sides[1].length()).max((c - b).length());
        let distance = ((a + b + c) / 3.0 - centre).length();
        // As seen from the nearer end.
        let points = enough(longest / (distance - 0.5 * longest).max(0.5 * longest));
        Self { a, sides, points }
    }
}

/// Gauss rules for triangles with as many nodes across as the index says, and one more from the corner,
/// where the width grows too: shares of the sides and weights over twice the area, by fours.
pub(super) static CORNERS: LazyLock<[Vec<[Lane; 3]>; POINTS + 1]> = LazyLock::new(|| {
    std::array::from_fn(|n| {
        let out = RULES[(n + MORE).min(POINTS)].iter();
        let nodes: Vec<[f64; 3]> = out
            .flat_map(|&(t, w)| {
                RULES[n].iter().map(move |&(s, v)| [t * (1.0 - s), t * s, t * w * v])
            })
            .collect();
        let lane = |nodes: &[[f64; 3]]| {
            // Those that are not there have no weight.
            let of = |k: usize| std::array::from_fn(|i| nodes.get(i).map_or(0.0, |node| node[k]));
            [of(0), of(1), of(2)]
        };
        nodes.chunks(LANES).map(lane).collect()
    })
});

widest! {
    /// What the points of triangles add.
    fn add_triangles(region: &Region, twist: [f64; 3], triangles: &[Triangle], lanes: &mut Lanes, by: bool) -> () = triangles_in
}

#[inline(always)]
fn triangles_in(
    region: &Region,
    twist: [f64; 3],
    triangles: &[Triangle],
    lanes: &mut Lanes,
    by: bool,
) {
    for triangle in triangles {
        let rule = &CORNERS[triangle.points];
        if by {
            triangle_of::<true>(region, twist, triangle, rule, lanes);
        } else {
            triangle_of::<false>(region, twist, triangle, rule, lanes);
        }
    }
}

#[inline(always)]
fn triangle_of<const BY: bool>(
    region: &Region,
    twist: [f64; 3],
    Triangle { a, sides: [one, two], .. }: &Triangle,
    rule: &[[Lane; 3]],
    lanes: &mut Lanes,
) {
    let twice = one.perp_dot(*two);
    for [first, second, weights] in rule {
        for i in 0..LANES {
            let at = DVec2::new(
                a.x + first[i] * one.x + second[i] * two.x,
                a.y + first[i] * one.y + second[i] * two.y,
            );
            add_point::<BY>(region, twist, at, twice * weights[i], lanes, i);
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
                add_point::<BY>(region, [u1, u2, omega], at, area, &mut lanes, i);
            }
        }
    }
    lanes
}

/// Adds a point with its share of the area to lane `i`.
#[inline(always)]
fn add_point<const BY: bool>(
    region: &Region,
    [u1, u2, omega]: [f64; 3],
    at: DVec2,
    area: f64,
    lanes: &mut Lanes,
    i: usize,
) {
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

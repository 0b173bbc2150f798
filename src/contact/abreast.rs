//! The closed forms for several twists side by side, each with a pressure of its own; where that falls
//! below zero, each on what its zero-pressure line leaves of the area.

use glam::DVec2;

use super::fan::of_edge;
use super::lanes::{LANES, widest};
use super::loops::{Loops, moved};

/// Twists side by side.
pub(crate) const ABREAST: usize = 8;

/// A number of each.
pub(crate) type Abreast = [f64; ABREAST];

const ZERO: Abreast = [0.0; ABREAST];

/// [`super::Friction`] of one area under several twists: `g` by weight and component, the Hessian's
/// 11, 12, 13, 22, 23, 33.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frictions {
    pub(crate) g: [[Abreast; 3]; 3],
    pub(crate) hessian: [Abreast; 6],
}

/// What pressures side by side leave of an area: edges from `(x, y)` to `(x, y)`, of each as many as of
/// the one with most; those that it has not are single points.
#[derive(Debug, Default)]
pub(crate) struct Cuts {
    edges: Vec<[Abreast; 4]>,
    middle: DVec2,
}

impl Cuts {
    /// Cuts the area by each of the pressures, as [`Loops::clip_into`] does by one.
    pub(crate) fn cut(&mut self, area: &Loops, p: &[Abreast; 3]) {
        self.edges.clear();
        self.middle = area.middle();
        for i in 0..ABREAST {
            let value = |x: DVec2| p[0][i] + p[1][i] * x.x + p[2][i] * x.y;
            let mut count = 0;
            for ring in area.rings() {
                let (mut first, mut last) = (None, DVec2::ZERO);
                let mut to = |cuts: &mut Self, x: DVec2| {
                    if first.is_some() {
                        cuts.put(i, count, last, x);
                        count += 1;
                    }
                    first = first.or(Some(x));
                    last = x;
                };
                let mut a = ring[ring.len() - 1];
                let mut pa = value(a);
                for &b in ring {
                    let pb = value(b);
                    if (pa >= 0.0) != (pb >= 0.0) {
                        to(self, a + (b - a) * (pa / (pa - pb)));
                    }
                    if pb >= 0.0 {
                        to(self, b);
                    }
                    (a, pa) = (b, pb);
                }
                if let Some(first) = first {
                    self.put(i, count, last, first);
                    count += 1;
                }
            }
        }
    }

    fn put(&mut self, i: usize, edge: usize, a: DVec2, b: DVec2) {
        if edge == self.edges.len() {
            let (x, y) = ([self.middle.x; ABREAST], [self.middle.y; ABREAST]);
            self.edges.push([x, y, x, y]);
        }
        let place = &mut self.edges[edge];
        (place[0][i], place[1][i], place[2][i], place[3][i]) = (a.x, a.y, b.x, b.y);
    }
}

/// Slip centres, and the pressures there.
struct Centres {
    c: [Abreast; 2],
    p: Abreast,
}

impl Centres {
    #[inline(always)]
    fn new(v: &[Abreast; 3], p: &[Abreast; 3]) -> Self {
        let mut at = Self { c: [ZERO; 2], p: ZERO };
        for i in 0..ABREAST {
            (at.c[0][i], at.c[1][i]) = (-v[1][i] / v[2][i], v[0][i] / v[2][i]);
            at.p[i] = p[0][i] + p[1][i] * at.c[0][i] + p[2][i] * at.c[1][i];
        }
        at
    }
}

widest! {
    /// The integrals of an area under some twists `v`, each with its own pressure `p`, by the closed
    /// forms: none may be a translation, and what cancels between the edges grows with the square of
    /// the slip centre's distance.
    pub(crate) fn frictions(area: &Loops, v: &[Abreast; 3], p: &[Abreast; 3]) -> Frictions = frictions_of
}

#[inline(always)]
fn frictions_of(area: &Loops, v: &[Abreast; 3], p: &[Abreast; 3]) -> Frictions {
    let at = Centres::new(v, p);
    let mut sums = [ZERO; 11];
    for block in area.blocks() {
        for e in 0..LANES {
            if block.length[e] == 0.0 {
                continue;
            }
            let along = [block.t1[e], block.t2[e], block.length[e]];
            for i in 0..ABREAST {
                let a = [block.ax[e] - at.c[0][i], block.ay[e] - at.c[1][i]];
                let b = [block.bx[e] - at.c[0][i], block.by[e] - at.c[1][i]];
                let terms = of_edge(along, a, b, [at.p[i], p[1][i], p[2][i]]);
                for (sum, term) in sums.iter_mut().zip(terms) {
                    sum[i] += term;
                }
            }
        }
    }
    assemble(&sums, &at, v)
}

widest! {
    /// [`frictions`] of what is left of an area, with its [`super::moments`].
    pub(crate) fn cut_frictions(cuts: &Cuts, v: &[Abreast; 3], p: &[Abreast; 3], moments: &mut [Abreast; 6]) -> Frictions = cut_frictions_of
}

#[inline(always)]
fn cut_frictions_of(
    cuts: &Cuts,
    v: &[Abreast; 3],
    p: &[Abreast; 3],
    out: &mut [Abreast; 6],
) -> Frictions {
    let at = Centres::new(v, p);
    let o = cuts.middle;
    let (mut sums, mut moments) = ([ZERO; 11], [ZERO; 6]);
    for [ax, ay, bx, by] in &cuts.edges {
        for i in 0..ABREAST {
            let (x, y) = (bx[i] - ax[i], by[i] - ay[i]);
            let length = (x * x + y * y).sqrt();
            let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
            let along = [x * inverse, y * inverse, length];
            let a = [ax[i] - at.c[0][i], ay[i] - at.c[1][i]];
            let b = [bx[i] - at.c[0][i], by[i] - at.c[1][i]];
            let terms = of_edge(along, a, b, [at.p[i], p[1][i], p[2][i]]);
            for (sum, term) in sums.iter_mut().zip(terms) {
                sum[i] += term;
            }
            let (ax, ay, bx, by) = (ax[i] - o.x, ay[i] - o.y, bx[i] - o.x, by[i] - o.y);
            let cross = ax * by - ay * bx;
            moments[0][i] += cross * (1.0 / 2.0);
            moments[1][i] += cross * (ax + bx) * (1.0 / 6.0);
            moments[2][i] += cross * (ay + by) * (1.0 / 6.0);
            moments[3][i] += cross * (ax * ax + ax * bx + bx * bx) * (1.0 / 12.0);
            moments[4][i] +=
                cross * (2.0 * (ax * ay + bx * by) + (ax * by + bx * ay)) * (1.0 / 24.0);
            moments[5][i] += cross * (ay * ay + ay * by + by * by) * (1.0 / 12.0);
        }
    }
    for i in 0..ABREAST {
        let mut m = [0.0; 6];
        for n in 0..6 {
            m[n] = moments[n][i];
        }
        let m = moved(m, o);
        for n in 0..6 {
            out[n][i] = m[n];
        }
    }
    assemble(&sums, &at, v)
}

/// From sums about the slip centres to integrals in the pad frame.
#[inline(always)]
fn assemble(sums: &[Abreast; 11], at: &Centres, v: &[Abreast; 3]) -> Frictions {
    let mut out = Frictions { g: [[ZERO; 3]; 3], hessian: [ZERO; 6] };
    for i in 0..ABREAST {
        let (c1, c2, omega) = (at.c[0][i], at.c[1][i], v[2][i]);
        let sign = 1.0_f64.copysign(omega);
        let s = |m: usize| sums[m][i];
        let row =
            |e1: f64, e2: f64, r: f64| [-sign * e2, sign * e1, sign * (c1 * e1 + c2 * e2 + r)];
        let g0 = row(s(0), s(1), s(5));
        let (g1, g2) = (row(s(2), s(3), s(6)), row(s(3), s(4), s(7)));
        for m in 0..3 {
            out.g[0][m][i] = g0[m];
            out.g[1][m][i] = c1 * g0[m] + g1[m];
            out.g[2][m][i] = c2 * g0[m] + g2[m];
        }
        let scale = 1.0 / omega.abs();
        let (h11, h12, h22) = (scale * s(8), scale * s(9), scale * s(10));
        let (h13, h23) = (-c2 * h11 + c1 * h12, -c2 * h12 + c1 * h22);
        let h33 = -c2 * h13 + c1 * h23;
        for (m, h) in [h11, h12, h13, h22, h23, h33].into_iter().enumerate() {
            out.hessian[m][i] = h;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Field, Twist, friction, moments};
    use crate::model::Polygon;

    fn ring(turn: f64, size: impl Fn(usize) -> f64) -> Vec<DVec2> {
        (0..8).map(|i| size(i) * DVec2::from_angle(turn + 0.785 * i as f64)).collect()
    }

    /// Each on its own part of an area with a hole and a notch as [`friction`] has it.
    #[test]
    fn cut_areas_side_by_side_are_those_cut_one_by_one() {
        let area = Loops::new(&[Polygon {
            outer: ring(0.1, |i| if i == 3 { 0.2 } else { 0.6 + 0.04 * (i % 3) as f64 }),
            holes: vec![ring(0.4, |_| 0.15)],
        }]);
        let (mut cuts, mut one) = (Cuts::default(), Loops::default());
        let (mut lifted, mut whole) = (0, 0);
        for round in 0..50 {
            let of = |i: usize| (8 * round + i) as f64;
            let p: [Abreast; 3] = [
                std::array::from_fn(|i| 1.0 + 0.3 * (1.3 * of(i)).sin()),
                std::array::from_fn(|i| 2.5 * (0.7 * of(i)).cos()),
                std::array::from_fn(|i| 2.5 * (1.9 * of(i)).sin()),
            ];
            let v: [Abreast; 3] = [
                std::array::from_fn(|i| 1.2 * (2.1 * of(i)).sin()),
                std::array::from_fn(|i| 1.2 * (0.3 * of(i)).cos()),
                std::array::from_fn(|i| if i % 2 == 0 { 0.8 } else { -1.1 }),
            ];
            cuts.cut(&area, &p);
            let mut m = [ZERO; 6];
            let found = cut_frictions(&cuts, &v, &p, &mut m);
            for i in 0..ABREAST {
                let p = p.map(|p| p[i]);
                area.clip_into(p, &mut one);
                let twist = Twist { u1: v[0][i], u2: v[1][i], omega: v[2][i] };
                let exact = friction(Field { area: &one, p }, twist);
                let at = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
                for k in 0..3 {
                    for n in 0..3 {
                        let (got, want) = (found.g[k][n][i], exact.g[k][n]);
                        assert!((got - want).abs() < 1e-13, "{got} {want}");
                    }
                }
                for (got, (row, column)) in found.hessian.iter().zip(at) {
                    let want = exact.hessian[row][column];
                    assert!((got[i] - want).abs() < 1e-12, "{} {want}", got[i]);
                }
                for (got, want) in m.iter().zip(moments(&one)) {
                    assert!((got[i] - want).abs() < 1e-14, "{} {want}", got[i]);
                }
                if one.len() == area.len() { whole += 1 } else { lifted += 1 }
            }
        }
        assert!(lifted > 100 && whole > 50, "{lifted} {whole}");
    }
}

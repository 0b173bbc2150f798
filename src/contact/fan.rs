//! Closed forms over the triangle fan from the slip centre (paper 3.5): every integral is a sum
//! over directed edges.
//!
//! For an edge `A -> B` seen from the slip centre: unit tangent `t`, normal `n = (t2, -t1)`, `h = A
//! x t` (distance of the line, signed), `s = t . y`, `r = |y|`, `[.]` the value at `B` minus that
//! at `A`, and `L = asinh(s2/|h|) - asinh(s1/|h|)`. With `e = y/r`:
//!
//! ```text
//! int e_i       = (h/2)(h n_i L + t_i dr)                       int r     = (h/3) R0
//! int y_i e_j   = (h/3)(h^2 nn L + h (nt + tn) dr + tt J2)       int y_i r = (h/4)(h n_i R0 + t_i R1)
//! int e e / r   = h (nn [s/r] - h (nt + tn)[1/r] + tt K2)
//! int e e e     = (h/2)(h nnn [s/r] - h^2 (nnt..)[1/r] + h (ntt..) K2 + ttt K3)
//! dr = [r], J2 = ([sr] - h^2 L)/2, R0 = ([sr] + h^2 L)/2, R1 = dr (r1^2 + r1 r2 + r2^2)/3, K2 = L - [s/r], K3 = dr + h^2 [1/r]
//! ```
//! One logarithm per edge. Measured error: 1e-14 of the natural scale up to three circumradii.

use glam::DVec2;

use super::field::Friction;
use super::lanes::{Block, LANES, totals, widest};
use super::loops::Loops;

/// Below this distance of the line from the slip centre (in the pad's length scale) an edge
/// contributes nothing: every term carries a factor `h`, and `h^2` in the logarithm must not
/// underflow.
const H_MIN: f64 = 1e-140;

/// Sums over the edges, all relative to the slip centre.
#[derive(Debug, PartialEq)]
struct Sums {
    e: [f64; 2],
    /// `int r e e` = `int y e`: 11, 12, 22.
    ye: [f64; 3],
    r: f64,
    yr: [f64; 2],
    /// `int p e e / r` for the pressure `p`: 11, 12, 22.
    q: [f64; 3],
}

/// Where the sums are taken: the slip centre, and the pressure there with its slopes.
#[derive(Clone, Copy)]
struct Centre {
    c: DVec2,
    p: [f64; 3],
}

widest! {
    /// The sums over all edges.
    fn sums(edges: &[Block], centre: Centre) -> Sums = sums_of
}

#[inline(always)]
fn sums_of(edges: &[Block], Centre { c, p }: Centre) -> Sums {
    let mut lanes = [[0.0; LANES]; 11];
    for edge in edges {
        for i in 0..LANES {
            let a = [edge.ax[i] - c.x, edge.ay[i] - c.y];
            let b = [edge.bx[i] - c.x, edge.by[i] - c.y];
            let terms = of_edge([edge.t1[i], edge.t2[i], edge.length[i]], a, b, p);
            for (sum, term) in lanes.iter_mut().zip(terms) {
                sum[i] += term;
            }
        }
    }
    let [e1, e2, ye11, ye12, ye22, r, yr1, yr2, q11, q12, q22] = totals(&lanes);
    Sums { e: [e1, e2], ye: [ye11, ye12, ye22], r, yr: [yr1, yr2], q: [q11, q12, q22] }
}

/// What an edge with unit tangent `t` and length `l` from `a` to `b`, seen from the slip centre, adds
/// to [`Sums`], in their order; the pressure is that of [`Centre`].
#[inline(always)]
pub(super) fn of_edge(
    [t1, t2, l]: [f64; 3],
    [ax, ay]: [f64; 2],
    [bx, by]: [f64; 2],
    [pc, p1, p2]: [f64; 3],
) -> [f64; 11] {
    let (r1, r2) = ((ax * ax + ay * ay).sqrt(), (bx * bx + by * by).sqrt());
    let h = ax * t2 - ay * t1;
    let (s1, s2) = (t1 * ax + t2 * ay, t1 * bx + t2 * by);
    // With a vertex at the slip centre `h` is zero but for rounding.
    let product = r1 * r2;
    let counts = !((h.abs() < H_MIN) | (product == 0.0));
    let h = if counts { h } else { 0.0 };
    let product = if counts { product } else { 1.0 };
    let hh = h * h;
    let dr = l * (s1 + s2) / if counts { r1 + r2 } else { 1.0 };
    // Both forms of the logarithm are free of cancellation on their side.
    let astride = (s1 < 0.0) & (s2 > 0.0);
    let (q1, q2) = (s1.abs() + r1, s2.abs() + r2);
    let nearer = if q1 < q2 { q1 } else { q2 };
    let numerator = if astride { q1 * q2 } else { nearer + (l + dr.abs()) };
    let denominator = if astride { hh } else { nearer };
    let log =
        ln_ratio(if counts { numerator } else { 1.0 }, if counts { denominator } else { 1.0 });
    let inverse = 1.0 / product;
    let inv = -dr * inverse;
    let ds = (s2 * r1 - s1 * r2) * inverse;
    let sr = s2 * r2 - s1 * r1;
    let (x, y, z) = (hh * log, h * dr, h * inv);
    let (j2, r0) = (0.5 * (sr - x), 0.5 * (sr + x));
    let big_r1 = dr * (r1 * r1 + product + r2 * r2) * (1.0 / 3.0);
    let (k2, k3) = (log - ds, dr + hh * inv);
    let (tt11, tt12, tt22) = (t1 * t1, t1 * t2, t2 * t2);
    let (half, third, quarter) = (0.5 * h, h * (1.0 / 3.0), 0.25 * h);

    let hl = h * log;
    let both = 2.0 * tt12 * y;
    let ye = [
        third * (x * tt22 + both + j2 * tt11),
        third * (tt12 * (j2 - x) + y * (tt22 - tt11)),
        third * (x * tt11 - both + j2 * tt22),
    ];
    let hr = h * r0;
    // The pressure's weight at once, along `n` and `t`: `nn`, `nt + tn`, `tt`.
    let (pn, pt) = (p1 * t2 - p2 * t1, p1 * t1 + p2 * t2);
    let nn = h * (pc * ds + half * (pn * ds - pt * z));
    let nt = h * (half * (pt * k2 - pn * z) - pc * z);
    let tt = h * pc * k2 + half * (h * pn * k2 + pt * k3);
    let both = 2.0 * tt12 * nt;
    [
        half * (hl * t2 + dr * t1),
        half * (dr * t2 - hl * t1),
        ye[0],
        ye[1],
        ye[2],
        third * r0,
        quarter * (hr * t2 + big_r1 * t1),
        quarter * (big_r1 * t2 - hr * t1),
        nn * tt22 + both + tt * tt11,
        tt12 * (tt - nn) + nt * (tt22 - tt11),
        nn * tt11 - both + tt * tt22,
    ]
}

/// Coefficients of `(atanh(s)/s - 1)/s^2` in powers of `s^2` up to `s = 1/3`: interpolated at the
/// Chebyshev nodes, so that twice the function times `s^3` is right to 4e-18.
const ATANH: [f64; 10] = [
    0.3333333333333333,
    0.20000000000007292,
    0.1428571428355438,
    0.11111111358713932,
    0.09090894718066429,
    0.07692785032479312,
    0.06657072104827468,
    0.06000536404795356,
    0.04400369243072337,
    0.08082022805971766,
];

/// `ln(a/b)` of positive normal numbers to 2e-16 or its last bit, without branches: the difference
/// of the exponents, and `2 atanh((m - n)/(m + n))` of the significands.
#[inline(always)]
fn ln_ratio(a: f64, b: f64) -> f64 {
    const FRACTION: u64 = (1 << 52) - 1;
    const ONE: u64 = 1.0_f64.to_bits();
    // Integers added to the last bits of this number are added to its value.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let (a, b) = (a.to_bits(), b.to_bits());
    let exponent =
        f64::from_bits((a >> 52).wrapping_sub(b >> 52).wrapping_add(WHOLE.to_bits())) - WHOLE;
    let (m, n) = (f64::from_bits(a & FRACTION | ONE), f64::from_bits(b & FRACTION | ONE));
    let s = (m - n) / (m + n);
    let z = s * s;
    let (z2, p) = (z * z, ATANH);
    let low = (p[0] + p[1] * z) + (p[2] + p[3] * z) * z2;
    let high = ((p[4] + p[5] * z) + (p[6] + p[7] * z) * z2) + (p[8] + p[9] * z) * (z2 * z2);
    exponent * std::f64::consts::LN_2 + 2.0 * (s + s * z * (low + high * (z2 * z2)))
}

/// See [`super::friction`]; `omega != 0` and the slip centre within reach.
pub(super) fn friction(area: &Loops, twist: [f64; 3], p: [f64; 3]) -> Friction {
    let [u1, u2, omega] = twist;
    if omega == 0.0 {
        // Only for an empty area or one that is a single point: nothing to integrate.
        return Friction::ZERO;
    }
    let c = DVec2::new(-u2 / omega, u1 / omega);
    let centre = Centre { c, p: [p[0] + p[1] * c.x + p[2] * c.y, p[1], p[2]] };
    assemble(&sums(area.blocks(), centre), c, omega)
}

/// From sums about the slip centre to integrals in the pad frame: `x = c + y`, `t = sgn(omega)
/// (-e2, e1)`.
fn assemble(sums: &Sums, c: DVec2, omega: f64) -> Friction {
    let sign = omega.signum();
    // int w t and int w (x cross t) for the weight w with moments (e1, e2) = int w e and r = int w
    // |y|.
    let row = |e1: f64, e2: f64, r: f64| [-sign * e2, sign * e1, sign * (c.x * e1 + c.y * e2 + r)];
    let g0 = row(sums.e[0], sums.e[1], sums.r);
    let gy1 = row(sums.ye[0], sums.ye[1], sums.yr[0]);
    let gy2 = row(sums.ye[1], sums.ye[2], sums.yr[1]);
    let g = [
        g0,
        [c.x * g0[0] + gy1[0], c.x * g0[1] + gy1[1], c.x * g0[2] + gy1[2]],
        [c.y * g0[0] + gy2[0], c.y * g0[1] + gy2[1], c.y * g0[2] + gy2[2]],
    ];
    let scale = 1.0 / omega.abs();
    let [h11, h12, h22] = [scale * sums.q[0], scale * sums.q[1], scale * sums.q[2]];
    // B H B^T with B = [[1, 0], [0, 1], [-c2, c1]]
    let h13 = -c.y * h11 + c.x * h12;
    let h23 = -c.y * h12 + c.x * h22;
    let h33 = -c.y * h13 + c.x * h23;
    Friction { g, hessian: [[h11, h12, h13], [h12, h22, h23], [h13, h23, h33]] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Polygon;

    #[test]
    fn vectors_of_any_width_give_the_same_bits() {
        let outer = (0..7)
            .map(|i| (1.0 + 0.3 * f64::from(i % 3)) * DVec2::from_angle(f64::from(i) * 0.9))
            .collect();
        let area = Loops::new(&[Polygon { outer, holes: Vec::new() }]);
        for i in 0..200 {
            let c = 0.01 * f64::from(i) * DVec2::from_angle(f64::from(i));
            let centre = Centre { c, p: [1.0, 0.3, -0.2] };
            assert_eq!(sums(area.blocks(), centre), sums_of(area.blocks(), centre));
        }
    }

    #[test]
    fn the_logarithm_is_right_to_its_last_bit_or_so() {
        let mut x = 1.0_f64;
        for i in 0..200_000 {
            x = (x * 1.000_137).rem_euclid(1e3) + 1e-3;
            let (a, b) = (x.powi(i % 40 - 20), 1.0 + 0.7 * (f64::from(i) * 0.1).sin());
            for (a, b) in [(a, b), (b * (1.0 + x * 1e-9), b), (b, b)] {
                let (got, want) = (ln_ratio(a, b), (a / b).ln());
                // The quotient's rounding is not in what is measured.
                let want = if (a / b - 1.0).abs() < 0.5 { ((a - b) / b).ln_1p() } else { want };
                assert!(
                    (got - want).abs() <= 3e-16 + 4e-16 * want.abs(),
                    "ln({a:e}/{b:e}): {got:e} {want:e}"
                );
            }
        }
    }
}

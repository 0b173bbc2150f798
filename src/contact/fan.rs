//! Closed forms over the triangle fan from the slip centre (paper 3.5): every integral is a sum over directed edges.
//!
//! For an edge `A -> B` seen from the slip centre: unit tangent `t`, normal `n = (t2, -t1)`, `h = A x t` (distance of the
//! line, signed), `s = t . y`, `r = |y|`, `[.]` the value at `B` minus that at `A`, and
//! `L = asinh(s2/|h|) - asinh(s1/|h|)`. With `e = y/r`:
//!
//! ```text
//! int e_i       = (h/2)(h n_i L + t_i dr)                       int r     = (h/3) R0
//! int y_i e_j   = (h/3)(h^2 nn L + h (nt + tn) dr + tt J2)       int y_i r = (h/4)(h n_i R0 + t_i R1)
//! int e e / r   = h (nn [s/r] - h (nt + tn)[1/r] + tt K2)
//! int e e e     = (h/2)(h nnn [s/r] - h^2 (nnt..)[1/r] + h (ntt..) K2 + ttt K3)
//! dr = [r], J2 = ([sr] - h^2 L)/2, R0 = ([sr] + h^2 L)/2, R1 = dr (r1^2 + r1 r2 + r2^2)/3, K2 = L - [s/r], K3 = dr + h^2 [1/r]
//! ```
//! One logarithm per edge, one square root per vertex. Measured error: 1e-14 of the natural scale up to three circumradii.

use glam::DVec2;

use super::{Friction, Loops};

/// Below this distance of the line from the slip centre (in the pad's length scale) an edge contributes nothing: every
/// term carries a factor `h`, and `h^2` in the logarithm must not underflow.
const H_MIN: f64 = 1e-140;

/// Sums over the edges, all relative to the slip centre.
#[derive(Default)]
struct Sums {
    e: [f64; 2],
    /// `int r e e` = `int y e`: 11, 12, 22.
    ye: [f64; 3],
    r: f64,
    yr: [f64; 2],
    /// `int e e / r`: 11, 12, 22.
    q: [f64; 3],
    /// `int e e e`: 111, 112, 122, 222.
    yq: [f64; 4],
}

impl Sums {
    #[inline]
    fn add_edge(&mut self, a: DVec2, r1: f64, b: DVec2, r2: f64) {
        let edge = b - a;
        let l = edge.length();
        if l == 0.0 {
            return;
        }
        let (t1, t2) = (edge.x / l, edge.y / l);
        let h = a.x * t2 - a.y * t1;
        // On a vertex or on the edge's line; with a vertex at the slip centre `h` is zero but for rounding.
        if h.abs() < H_MIN || r1 == 0.0 || r2 == 0.0 {
            return;
        }
        let (n1, n2) = (t2, -t1);
        let (s1, s2) = (t1 * a.x + t2 * a.y, t1 * b.x + t2 * b.y);
        let h2 = h * h;
        let dr = l * (s2 + s1) / (r1 + r2);
        // Both forms are free of cancellation on their side.
        let log = if s1 < 0.0 && s2 > 0.0 { ((s2 + r2) * (r1 - s1) / h2).ln() } else { ((l + dr.abs()) / (s1.abs() + r1).min(s2.abs() + r2)).ln_1p() };
        let inv = -dr / (r1 * r2);
        let ds = s2 / r2 - s1 / r1;
        let sr = s2 * r2 - s1 * r1;
        let j2 = 0.5 * (sr - h2 * log);
        let r0 = 0.5 * (sr + h2 * log);
        let big_r1 = dr * (r1 * r1 + r1 * r2 + r2 * r2) / 3.0;
        let k2 = log - ds;
        let k3 = dr + h2 * inv;
        let (nn11, nn12, nn22) = (n1 * n1, n1 * n2, n2 * n2);
        let (nt11, nt12, nt22) = (2.0 * n1 * t1, n1 * t2 + n2 * t1, 2.0 * n2 * t2);
        let (tt11, tt12, tt22) = (t1 * t1, t1 * t2, t2 * t2);

        let half = 0.5 * h;
        self.e[0] += half * (h * n1 * log + t1 * dr);
        self.e[1] += half * (h * n2 * log + t2 * dr);
        let third = h / 3.0;
        let (x, y) = (h2 * log, h * dr);
        self.ye[0] += third * (x * nn11 + y * nt11 + j2 * tt11);
        self.ye[1] += third * (x * nn12 + y * nt12 + j2 * tt12);
        self.ye[2] += third * (x * nn22 + y * nt22 + j2 * tt22);
        self.r += third * r0;
        let quarter = 0.25 * h;
        self.yr[0] += quarter * (h * n1 * r0 + t1 * big_r1);
        self.yr[1] += quarter * (h * n2 * r0 + t2 * big_r1);
        let z = h * inv;
        self.q[0] += h * (nn11 * ds - z * nt11 + tt11 * k2);
        self.q[1] += h * (nn12 * ds - z * nt12 + tt12 * k2);
        self.q[2] += h * (nn22 * ds - z * nt22 + tt22 * k2);
        let (p, q, r) = (h * ds, h2 * inv, h * k2);
        self.yq[0] += half * (p * nn11 * n1 - q * 3.0 * nn11 * t1 + r * 3.0 * tt11 * n1 + k3 * tt11 * t1);
        self.yq[1] += half * (p * nn11 * n2 - q * (nn11 * t2 + 2.0 * nn12 * t1) + r * (tt11 * n2 + 2.0 * tt12 * n1) + k3 * tt11 * t2);
        self.yq[2] += half * (p * nn22 * n1 - q * (nn22 * t1 + 2.0 * nn12 * t2) + r * (tt22 * n1 + 2.0 * tt12 * n2) + k3 * tt22 * t1);
        self.yq[3] += half * (p * nn22 * n2 - q * 3.0 * nn22 * t2 + r * 3.0 * tt22 * n2 + k3 * tt22 * t2);
    }
}

/// See [`super::friction`]; `omega != 0` and the slip centre within reach.
pub(super) fn friction(area: &Loops, twist: [f64; 3], p: [f64; 3]) -> Friction {
    let [u1, u2, omega] = twist;
    if omega == 0.0 {
        // Only for an empty area or one that is a single point: nothing to integrate.
        return Friction::ZERO;
    }
    let c = DVec2::new(-u2 / omega, u1 / omega);
    let mut sums = Sums::default();
    for ring in area.rings() {
        let mut a = ring[ring.len() - 1] - c;
        let mut r1 = a.length();
        for &point in ring {
            let b = point - c;
            let r2 = b.length();
            sums.add_edge(a, r1, b, r2);
            (a, r1) = (b, r2);
        }
    }
    assemble(&sums, c, omega, p)
}

/// From sums about the slip centre to integrals in the pad frame: `x = c + y`, `t = sgn(omega) (-e2, e1)`.
fn assemble(sums: &Sums, c: DVec2, omega: f64, p: [f64; 3]) -> Friction {
    let sign = omega.signum();
    // int w t and int w (x cross t) for the weight w with moments (e1, e2) = int w e and r = int w |y|.
    let row = |e1: f64, e2: f64, r: f64| [-sign * e2, sign * e1, sign * (c.x * e1 + c.y * e2 + r)];
    let g0 = row(sums.e[0], sums.e[1], sums.r);
    let gy1 = row(sums.ye[0], sums.ye[1], sums.yr[0]);
    let gy2 = row(sums.ye[1], sums.ye[2], sums.yr[1]);
    let g = [g0, std::array::from_fn(|i| c.x * g0[i] + gy1[i]), std::array::from_fn(|i| c.y * g0[i] + gy2[i])];
    let pc = p[0] + p[1] * c.x + p[2] * c.y;
    let scale = 1.0 / omega.abs();
    let h11 = scale * (pc * sums.q[0] + p[1] * sums.yq[0] + p[2] * sums.yq[1]);
    let h12 = scale * (pc * sums.q[1] + p[1] * sums.yq[1] + p[2] * sums.yq[2]);
    let h22 = scale * (pc * sums.q[2] + p[1] * sums.yq[2] + p[2] * sums.yq[3]);
    // B H B^T with B = [[1, 0], [0, 1], [-c2, c1]]
    let h13 = -c.y * h11 + c.x * h12;
    let h23 = -c.y * h12 + c.x * h22;
    let h33 = -c.y * h13 + c.x * h23;
    Friction { g, hessian: [[h11, h12, h13], [h12, h22, h23], [h13, h23, h33]] }
}

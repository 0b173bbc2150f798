//! The integrals for slip centres far from the area: exact along the rays from the slip centre,
//! Gauss quadrature along the edges; pure translation is a regular point.
//!
//! With `o` the area's middle at the distance `r0` from the slip centre, a point is `x = o + z`, `z
//! = q + s e`: `e` the unit vector of its ray, `s = r - r0`, `q = r0 (e - e0)`. Along a ray `e` and
//! `q` are constant and `z . e = q . e + s`, so every integrand is a polynomial in `s`. Integrated
//! from the arc `s = 0`, not from the slip centre, nothing large cancels between the edges:
//!
//! ```text
//! int s^k dA = oint (r0 s^(k+1)/(k+1) + s^(k+2)/(k+2)) dtheta,   int s^k / r dA = oint s^(k+1)/(k+1) dtheta
//! ```
//! Everything is written in `Y = |omega| y`, the velocity turned by a right angle, and `s = (2 Y0 .
//! z + |omega| z^2)/(|Y| + |Y0|)`.

use std::sync::LazyLock;

use super::field::Friction;
use super::lanes::{Block, LANES, totals, widest};
use super::loops::Loops;

/// Most points of a rule.
const MOST: usize = 12;

/// Gauss-Legendre rules on `[0, 1]`: nodes and weights of the rule with as many points as the index
/// says.
pub(super) static RULES: LazyLock<[Vec<(f64, f64)>; MOST + 1]> =
    LazyLock::new(|| std::array::from_fn(rule));

/// Roots of the Legendre polynomial of degree `n` by Newton's method.
fn rule(n: usize) -> Vec<(f64, f64)> {
    let legendre = |x: f64| {
        let (mut before, mut value) = (0.0, 1.0);
        for k in 1..=n {
            (before, value) =
                (value, ((2 * k - 1) as f64 * x * value - (k - 1) as f64 * before) / k as f64);
        }
        (value, n as f64 * (x * value - before) / (x * x - 1.0))
    };
    let node = |i: usize| {
        let mut x = -((i as f64 + 0.75) / (n as f64 + 0.5) * std::f64::consts::PI).cos();
        for _ in 0..8 {
            let (value, slope) = legendre(x);
            x -= value / slope;
        }
        let slope = legendre(x).1;
        ((1.0 + x) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).collect()
}

/// Points of a rule on an edge whose half-length goes `ratio` times into the distance of the slip
/// centre from its middle: the error falls with `rho^(-2n)`, `rho` the sum of the half-axes of the
/// largest ellipse around the edge in which the integrand is analytic.
pub(super) fn points(ratio: f64) -> usize {
    let rho = ratio + (ratio * ratio - 1.0).max(0.0).sqrt();
    // ln(1e-15)/2, and two points for the polynomial in front of the roots.
    (17.3 / rho.ln() + 2.0).ceil().clamp(3.0, MOST as f64) as usize
}

/// Slip centres farther from the area's middle than this many circumradii use quadrature along the
/// edges in twist form. The fan loses one digit per decade of the distance in `int e`, two in `int
/// r`, three in the moments; few Gauss points are at rounding level from here on.
pub const FAR: f64 = 3.0;

/// Whether the slip centre is beyond that.
pub(super) fn is_far(area: &Loops, twist: [f64; 3]) -> bool {
    let [u1, u2, omega] = twist;
    let (middle, reach) = (area.middle(), FAR * omega * area.radius());
    let (v1, v2) = (u1 - omega * middle.y, u2 + omega * middle.x);
    v1 * v1 + v2 * v2 > reach * reach
}

/// See [`super::friction`]: Gauss points on each edge, fewer the farther the slip centre. Error
/// below 1e-14 for slip centres beyond [`FAR`] circumradii.
pub(super) fn friction(area: &Loops, twist: [f64; 3], p: [f64; 3]) -> Friction {
    let [u1, u2, omega] = twist;
    let (o, radius) = (area.middle(), area.radius());
    let (v1, v2) = (u1 - omega * o.y, u2 + omega * o.x);
    // Distance of the slip centre in circumradii.
    let kappa = (v1 * v1 + v2 * v2).sqrt() / (omega.abs() * radius);
    let longest = area.blocks().iter().flat_map(|block| block.length).fold(0.0, f64::max);
    // Half an edge in circumradii, and the nearest that a slip centre can come to its middle.
    let q = longest / (2.0 * radius);
    let ratio = if q * q < 1.0 - 1.0 / (kappa * kappa) {
        (kappa - (1.0 - q * q).sqrt()) / q
    } else {
        (kappa * kappa - 1.0).sqrt()
    };
    let centre = Centre {
        o: [o.x, o.y],
        y: if omega < 0.0 { [-v2, v1] } else { [v2, -v1] },
        omega: omega.abs(),
        p: [p[0] + p[1] * o.x + p[2] * o.y, p[1], p[2]],
    };
    let sums = sums(area.blocks(), centre, &RULES[points(ratio)]);
    assemble(&sums, centre, if omega < 0.0 { -1.0 } else { 1.0 })
}

/// Where the sums are taken: the area's middle, `Y` there, `|omega|`, and the pressure there with
/// its slopes.
#[derive(Clone, Copy)]
struct Centre {
    o: [f64; 2],
    y: [f64; 2],
    omega: f64,
    p: [f64; 3],
}

/// Integrals about the middle; `z . e` is the moment of the unit slip velocity.
struct Sums {
    e: [f64; 2],
    ze: f64,
    /// `int z_i e_j`: 11, 12, 21, 22.
    z_e: [f64; 4],
    /// `int z_i (z . e)`.
    z_ze: [f64; 2],
    /// Hessian in the twist about the middle: 11, 12, 22, 13, 23, 33.
    h: [f64; 6],
}

widest! {
    /// The integrals about the middle.
    fn sums(edges: &[Block], centre: Centre, rule: &[(f64, f64)]) -> Sums = sums_of
}

#[inline(always)]
fn sums_of(
    edges: &[Block],
    Centre { o, y: [d1, d2], omega, p }: Centre,
    rule: &[(f64, f64)],
) -> Sums {
    let mut lanes = [[0.0; LANES]; 15];
    let r0 = (d1 * d1 + d2 * d2).sqrt();
    for edge in edges {
        for &(t, weight) in rule {
            for i in 0..LANES {
                let (ax, ay) = (edge.ax[i] - o[0], edge.ay[i] - o[1]);
                let along = t * edge.length[i];
                let (z1, z2) = (ax + along * edge.t1[i], ay + along * edge.t2[i]);
                let (y1, y2) = (d1 + omega * z1, d2 + omega * z2);
                let r = (y1 * y1 + y2 * y2).sqrt();
                let inverse = 1.0 / (r * (r + r0));
                let (e1, e2) = (y1 * ((r + r0) * inverse), y2 * ((r + r0) * inverse));
                let s = (2.0 * (d1 * z1 + d2 * z2) + omega * (z1 * z1 + z2 * z2)) * (r * inverse);
                let (q1, q2) = (z1 - s * e1, z2 - s * e2);
                let by_r = (r + r0) * inverse;
                let turn =
                    (y1 * edge.t2[i] - y2 * edge.t1[i]) * (edge.length[i] * weight) * (by_r * by_r);
                // turn times the integrals of 1, s, s^2 over the ray's part of the area.
                let a0 = turn * s * (r0 + 0.5 * omega * s);
                let a1 = turn * (s * s) * (0.5 * r0 + (1.0 / 3.0) * omega * s);
                let a2 = turn * (s * s * s) * ((1.0 / 3.0) * r0 + 0.25 * omega * s);
                let qe = q1 * e1 + q2 * e2;
                lanes[0][i] += e1 * a0;
                lanes[1][i] += e2 * a0;
                lanes[2][i] += qe * a0 + a1;
                let (w1, w2) = (q1 * a0 + e1 * a1, q2 * a0 + e2 * a1);
                lanes[3][i] += w1 * e1;
                lanes[4][i] += w1 * e2;
                lanes[5][i] += w2 * e1;
                lanes[6][i] += w2 * e2;
                lanes[7][i] += qe * w1 + (q1 * a1 + e1 * a2);
                lanes[8][i] += qe * w2 + (q2 * a1 + e2 * a2);
                let pressed =
                    turn * s * (p[0] + (p[1] * q1 + p[2] * q2) + 0.5 * s * (p[1] * e1 + p[2] * e2));
                let m3 = q1 * e2 - q2 * e1;
                let (h1, h2) = (pressed * e1, pressed * e2);
                lanes[9][i] += h1 * e1;
                lanes[10][i] += h1 * e2;
                lanes[11][i] += h2 * e2;
                lanes[12][i] += h1 * m3;
                lanes[13][i] += h2 * m3;
                lanes[14][i] += pressed * (m3 * m3);
            }
        }
    }
    let n = totals(&lanes);
    Sums {
        e: [n[0], n[1]],
        ze: n[2],
        z_e: [n[3], n[4], n[5], n[6]],
        z_ze: [n[7], n[8]],
        h: [n[9], n[10], n[11], n[12], n[13], n[14]],
    }
}

/// From integrals about the middle to the pad frame: `x = o + z`, `t = sgn(omega) (-e2, e1)`.
fn assemble(sums: &Sums, Centre { o, .. }: Centre, sign: f64) -> Friction {
    let row = |e1: f64, e2: f64, moment: f64| {
        [-sign * e2, sign * e1, sign * (o[0] * e1 + o[1] * e2 + moment)]
    };
    let g0 = row(sums.e[0], sums.e[1], sums.ze);
    let z1 = row(sums.z_e[0], sums.z_e[1], sums.z_ze[0]);
    let z2 = row(sums.z_e[2], sums.z_e[3], sums.z_ze[1]);
    let g = [
        g0,
        std::array::from_fn(|i| o[0] * g0[i] + z1[i]),
        std::array::from_fn(|i| o[1] * g0[i] + z2[i]),
    ];
    // The normal (e1, e2) of the velocity, lifted to the twist: its third part is that about the
    // middle and o1 e2 - o2 e1.
    let [h11, h12, h22, m13, m23, m33] = sums.h;
    let (l13, l23) = (o[0] * h12 - o[1] * h11, o[0] * h22 - o[1] * h12);
    let h33 = m33 + 2.0 * (o[0] * m23 - o[1] * m13) + (o[0] * l23 - o[1] * l13);
    let (h13, h23) = (m13 + l13, m23 + l23);
    Friction { g, hessian: [[h11, h12, h13], [h12, h22, h23], [h13, h23, h33]] }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::model::Polygon;

    #[test]
    fn rules_integrate_polynomials() {
        for n in 1..=MOST {
            for degree in 0..2 * n {
                let sum: f64 = RULES[n].iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
                assert!(
                    (sum * (degree + 1) as f64 - 1.0).abs() < 2e-14,
                    "{n} points, degree {degree}: {sum}"
                );
            }
        }
    }

    /// The integrals by Gauss points on each triangle (middle, A, B), as they are defined.
    fn pointwise(area: &Loops, [u1, u2, omega]: [f64; 3], p: [f64; 3], points: usize) -> Friction {
        let (o, rule) = (area.middle(), &RULES[points]);
        let mut out = Friction::ZERO;
        for (a, b) in area.edges() {
            let (a, b) = (a - o, b - o);
            for &(s, ws) in rule {
                for &(t, wt) in rule {
                    let x = o + s * (a + t * (b - a));
                    let (v1, v2) = (u1 - omega * x.y, u2 + omega * x.x);
                    let inverse = 1.0 / (v1 * v1 + v2 * v2).sqrt();
                    let (t1, t2) = (v1 * inverse, v2 * inverse);
                    let weight = ws * wt * s * a.perp_dot(b);
                    let along = [t1, t2, x.x * t2 - x.y * t1];
                    let normal = [t2, -t1, -(x.x * t1 + x.y * t2)];
                    let pressed = weight * (p[0] + p[1] * x.x + p[2] * x.y) * inverse;
                    for i in 0..3 {
                        for (m, phi) in [1.0, x.x, x.y].into_iter().enumerate() {
                            out.g[m][i] += weight * phi * along[i];
                        }
                        for j in 0..3 {
                            out.hessian[i][j] += pressed * normal[i] * normal[j];
                        }
                    }
                }
            }
        }
        out
    }

    /// Right at every distance, for edges short and long, and for both senses.
    #[test]
    fn enough_points_at_every_distance() {
        let bar = [(-1.0, -0.05), (1.0, -0.05), (1.0, 0.05), (-1.0, 0.05)];
        let star = [
            (-0.7, -0.5),
            (0.6, -0.6),
            (0.7, 0.5),
            (0.2, 0.5),
            (0.1, -0.1),
            (-0.2, 0.1),
            (-0.3, 0.6),
            (-0.8, 0.4),
        ];
        let p = [1.0, 0.3, -0.4];
        let mut worst: f64 = 0.0;
        for outer in [&bar[..], &star[..]] {
            let area = Loops::new(&[Polygon {
                outer: outer.iter().map(|&(x, y)| DVec2::new(x, y)).collect(),
                holes: Vec::new(),
            }]);
            let o = area.middle();
            for kappa in [3.001, 3.5, 4.5, 6.0, 9.0, 14.0, 30.0, 100.0, 1e3, 1e5, 1e9] {
                for angle in [0.0, 0.4, 1.2, 1.6, 2.9, 4.5] {
                    for sense in [1.0, -1.0] {
                        let c = o + kappa * area.radius() * DVec2::from_angle(angle);
                        let size = sense / c.length();
                        let twist = [c.y * size, -c.x * size, size];
                        let (got, want) =
                            (friction(&area, twist, p), pointwise(&area, twist, p, MOST));
                        let pairs = got
                            .g
                            .iter()
                            .chain(&got.hessian)
                            .flatten()
                            .zip(want.g.iter().chain(&want.hessian).flatten());
                        worst = pairs
                            .map(|(a, b)| (a - b).abs() / crate::contact::moments(&area)[0])
                            .fold(worst, f64::max);
                        assert!(worst < 2e-14, "{kappa} {angle}: {worst:e} {got:?} {want:?}");
                    }
                }
            }
        }
        println!("largest error {worst:.1e}");
    }
}

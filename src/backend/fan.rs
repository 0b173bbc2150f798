//! Gradient basis of one contact at one twist, in f32: the twin of `shaders/fan.wgsl`, same functions in the same order.
//!
//! For each weight `1, x1, x2` the integrals over a face of `weight * v(x)/|v(x)|` and of its moment about the origin,
//! where `v(x) = (u1 - omega x2, u2 + omega x1)`. Pressure times these is the gradient of the dissipation; pressure
//! times these times the twist is the dissipation itself (it is homogeneous of degree one).

use super::layout::{BASIS, EdgeRecord, GAUSS, NEAR_LIMIT, ON_LINE};

/// Integrals of weights `1, x1, x2` by components `g1, g2, torque`.
pub(crate) type Basis = [f32; BASIS];

/// Below this `l / (r1 + r2)` the logarithm is a series: its argument would be rounded to near 1.
/// Six terms leave 6e-9 there.
const SERIES_LIMIT: f32 = 0.25;

/// `asinh(s2/|h|) - asinh(s1/|h|)` of an edge at distance `h` from the apex, from `s1` to `s2` along it.
pub(crate) fn edge_log(h: f32, l: f32, s1: f32, s2: f32, r1: f32, r2: f32) -> f32 {
    if s1 < 0.0 && s2 > 0.0 {
        return (((s2 + r2) / h) * ((r1 - s1) / h)).ln();
    }
    let z = l / (r1 + r2);
    if z > SERIES_LIMIT {
        return if s1 >= 0.0 { ((s2 + r2) / (s1 + r1)).ln() } else { ((r1 - s1) / (r2 - s2)).ln() };
    }
    let q = z * z;
    2.0 * z * (1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0))))))
}

/// Fan integrals about the apex `c`: `int e` (2), `int r`, `int y e` (11, 12, 22), `int y r` (2).
pub(crate) fn fan(edges: &[EdgeRecord], c: [f32; 2]) -> [f32; 8] {
    let mut sum = [0.0_f32; 8];
    for edge in edges {
        let (ax, ay) = (edge[0] - c[0], edge[1] - c[1]);
        let (bx, by) = (edge[2] - c[0], edge[3] - c[1]);
        let (dx, dy) = (edge[2] - edge[0], edge[3] - edge[1]);
        let l = (dx * dx + dy * dy).sqrt();
        let (t1, t2) = (dx / l, dy / l);
        let (n1, n2) = (t2, -t1);
        let h = ax * t2 - ay * t1;
        if !(h.abs() > ON_LINE) {
            continue;
        }
        let (s1, s2) = (t1 * ax + t2 * ay, t1 * bx + t2 * by);
        let (r1, r2) = ((h * h + s1 * s1).sqrt(), (h * h + s2 * s2).sqrt());
        let log = edge_log(h, l, s1, s2, r1, r2);
        let dr = (s2 - s1) * (s2 + s1) / (r1 + r2);
        let sr = s2 * r2 - s1 * r1;
        let h2log = h * h * log;
        let j2 = 0.5 * (sr - h2log);
        let r0 = 0.5 * (sr + h2log);
        let m1 = dr * (r1 * r1 + r1 * r2 + r2 * r2) / 3.0;
        sum[0] += 0.5 * h * (h * n1 * log + t1 * dr);
        sum[1] += 0.5 * h * (h * n2 * log + t2 * dr);
        sum[2] += h / 3.0 * r0;
        sum[3] += h / 3.0 * (h2log * n1 * n1 + 2.0 * h * n1 * t1 * dr + t1 * t1 * j2);
        sum[4] += h / 3.0 * (h2log * n1 * n2 + h * (n1 * t2 + n2 * t1) * dr + t1 * t2 * j2);
        sum[5] += h / 3.0 * (h2log * n2 * n2 + 2.0 * h * n2 * t2 * dr + t2 * t2 * j2);
        sum[6] += h / 4.0 * (h * n1 * r0 + t1 * m1);
        sum[7] += h / 4.0 * (h * n2 * r0 + t2 * m1);
    }
    sum
}

/// The basis from the fan about the slip centre.
pub(crate) fn basis_near(edges: &[EdgeRecord], v: [f32; 3]) -> Basis {
    let c = [-v[1] / v[2], v[0] / v[2]];
    let [e1, e2, r, ye11, ye12, ye22, yr1, yr2] = fan(edges, c);
    let sense = v[2].signum();
    let torque = c[0] * e1 + c[1] * e2 + r;
    [
        -sense * e2,
        sense * e1,
        sense * torque,
        -sense * (c[0] * e2 + ye12),
        sense * (c[0] * e1 + ye11),
        sense * (c[0] * torque + c[0] * ye11 + c[1] * ye12 + yr1),
        -sense * (c[1] * e2 + ye22),
        sense * (c[1] * e1 + ye12),
        sense * (c[1] * torque + c[0] * ye12 + c[1] * ye22 + yr2),
    ]
}

/// The basis from Gauss points on the triangles (origin, A, B), the integrand in twist form: regular for translations.
pub(crate) fn basis_far(edges: &[EdgeRecord], v: [f32; 3]) -> Basis {
    let mut sum = [0.0_f32; BASIS];
    for edge in edges {
        let twice_area = edge[0] * edge[3] - edge[1] * edge[2];
        for across in GAUSS {
            let (px, py) = (edge[0] + across[0] * (edge[2] - edge[0]), edge[1] + across[0] * (edge[3] - edge[1]));
            for along in GAUSS {
                let (x1, x2) = (along[0] * px, along[0] * py);
                let (v1, v2) = (v[0] - v[2] * x2, v[1] + v[2] * x1);
                let weight = twice_area * across[1] * along[1] * along[0] / (v1 * v1 + v2 * v2).sqrt();
                let (g1, g2) = (weight * v1, weight * v2);
                let torque = x1 * g2 - x2 * g1;
                sum[0] += g1;
                sum[1] += g2;
                sum[2] += torque;
                sum[3] += x1 * g1;
                sum[4] += x1 * g2;
                sum[5] += x1 * torque;
                sum[6] += x2 * g1;
                sum[7] += x2 * g2;
                sum[8] += x2 * torque;
            }
        }
    }
    sum
}

/// The basis at any twist of one face whose vertices lie within `radius` of the origin.
pub(crate) fn basis(edges: &[EdgeRecord], radius: f32, v: [f32; 3]) -> Basis {
    let near = v[0] * v[0] + v[1] * v[1] <= NEAR_LIMIT * NEAR_LIMIT * radius * radius * v[2] * v[2];
    if near { basis_near(edges, v) } else { basis_far(edges, v) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::SeedSet;
    use crate::backend::layout::BASIS;
    use crate::backend::prepare::Prepared;
    use crate::model::{Contact, Polygon};
    use glam::DVec2;

    /// Gauss-Legendre on `[0, 1]` by Newton's method on the Legendre polynomial.
    fn gauss(n: usize) -> Vec<(f64, f64)> {
        (0..n)
            .map(|i| {
                let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
                let mut slope = 1.0;
                for _ in 0..100 {
                    let (mut before, mut here) = (1.0, x);
                    for k in 2..=n {
                        (before, here) = (here, ((2 * k - 1) as f64 * x * here - (k - 1) as f64 * before) / k as f64);
                    }
                    slope = n as f64 * (x * here - before) / (x * x - 1.0);
                    x -= here / slope;
                }
                (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
            })
            .collect()
    }

    /// The basis in f64 without closed forms: polar coordinates about a near slip centre, a product rule for a far one.
    fn quadrature(edges: &[EdgeRecord], v: [f32; 3]) -> [f64; BASIS] {
        let v = v.map(f64::from);
        let mut sum = [0.0; BASIS];
        let mut add = |weight: f64, x: DVec2| {
            let velocity = DVec2::new(v[0] - v[2] * x.y, v[1] + v[2] * x.x);
            let e = velocity / velocity.length();
            for (k, factor) in [1.0, x.x, x.y].into_iter().enumerate() {
                sum[3 * k] += weight * factor * e.x;
                sum[3 * k + 1] += weight * factor * e.y;
                sum[3 * k + 2] += weight * factor * x.perp_dot(e);
            }
        };
        let near = v[0].hypot(v[1]) < 8.0 * v[2].abs();
        let (few, many) = (gauss(6), gauss(40));
        for edge in edges.iter().map(|edge| edge.map(f64::from)) {
            let (a, b) = (DVec2::new(edge[0], edge[1]), DVec2::new(edge[2], edge[3]));
            let apex = if near { DVec2::new(-v[1], v[0]) / v[2] } else { DVec2::ZERO };
            let t = (b - a).normalize();
            let h = (a - apex).perp_dot(t);
            if h.abs() < 1e-14 {
                continue;
            }
            let (s1, s2) = (t.dot(a - apex), t.dot(b - apex));
            // s = |h| sinh u flattens the integrand where the edge passes close to the apex.
            let (u1, u2) = ((s1 / h.abs()).asinh(), (s2 / h.abs()).asinh());
            let parts = (u2 - u1).ceil().max(1.0);
            for part in 0..parts as usize {
                for &(node, weight) in &many {
                    let u = u1 + (u2 - u1) * (part as f64 + node) / parts;
                    let along = h.abs() * u.sinh();
                    let foot = apex + DVec2::new(t.y, -t.x) * h + t * along;
                    let step = h * h.abs() * u.cosh() * (u2 - u1) / parts * weight;
                    for &(radial, radial_weight) in &few {
                        if near {
                            add(step * radial * radial_weight, apex + (foot - apex) * radial);
                        }
                    }
                    if !near {
                        for &(radial, radial_weight) in &many {
                            add(step * radial * radial_weight, foot * radial);
                        }
                    }
                }
            }
        }
        sum
    }

    fn ring(points: &[(f64, f64)]) -> Vec<DVec2> {
        points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
    }

    fn shapes() -> Vec<(&'static str, Vec<EdgeRecord>, f32)> {
        let square = ring(&[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]);
        let outlines = vec![
            ("square", square.clone(), vec![]),
            ("bar", ring(&[(-5.0, -0.5), (5.0, -0.5), (5.0, 0.5), (-5.0, 0.5)]), vec![]),
            ("hollow", square.clone(), vec![ring(&[(-0.8, -0.8), (-0.8, 0.8), (0.8, 0.8), (0.8, -0.8)])]),
            ("L", ring(&[(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]), vec![]),
            ("disc", (0..96).map(|i| DVec2::from_angle(f64::from(i) * std::f64::consts::TAU / 96.0)).collect(), vec![]),
        ];
        outlines
            .into_iter()
            .map(|(name, outer, holes)| {
                let patch = vec![Polygon { outer, holes }];
                let contact = Contact { face_i: patch.clone(), face_ii: patch };
                let prepared = Prepared::new(&contact, name).unwrap().unwrap();
                assert_eq!(prepared.header.faces, 1, "{name}");
                (name, prepared.edges, prepared.header.radius)
            })
            .collect()
    }

    /// Largest error over the face's area, by weight.
    fn error(edges: &[EdgeRecord], radius: f32, v: [f32; 3]) -> f64 {
        let (found, exact) = (basis(edges, radius, v), quadrature(edges, v));
        let area: f64 = edges.iter().map(|e| 0.5 * f64::from(e[0] * e[3] - e[1] * e[2])).sum();
        found.iter().zip(exact).map(|(a, b)| (f64::from(*a) - b).abs() / area).fold(0.0, f64::max)
    }

    #[test]
    fn closed_forms_and_gauss_points_agree_with_quadrature() {
        for (name, edges, radius) in shapes() {
            let (mut worst, mut at) = (0.0, [0.0; 3]);
            for v in SeedSet::new(8).unwrap().twists() {
                let v = [v[0], v[1], v[2]];
                let e = error(&edges, radius, v);
                if e > worst {
                    (worst, at) = (e, v);
                }
            }
            println!("{name}: {worst:.2e} at {at:?}");
            assert!(worst < 3e-6, "{name}: {worst:.2e} at {at:?}");
        }
    }

    #[test]
    fn zz_scan() {
        for (name, edges, radius) in shapes() {
            let area: f64 = edges.iter().map(|e| 0.5 * f64::from(e[0] * e[3] - e[1] * e[2])).sum();
            for kappa in [0.1_f32, 0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0,6.0, 10.0] {
                let mut worst = [[0.0_f64; 3]; 2];
                for i in 0..200 {
                    let c = glam::Vec2::from_angle(i as f32 * 0.7) * kappa * radius;
                    let v = [c.y, -c.x, 1.0].map(|x| x / (1.0 + c.length_squared()).sqrt());
                    let q = quadrature(&edges, v);
                    for (m, b) in [basis_near(&edges, v), basis_far(&edges, v)].iter().enumerate() {
                        let d = |i: usize| (f64::from(b[i]) - q[i]).abs() / area;
                        worst[m][0] = worst[m][0].max(d(0)).max(d(1)).max(d(2));
                        worst[m][1] = worst[m][1].max((3..9).map(d).fold(0.0, f64::max));
                        let dd = (0..3).map(|i| (f64::from(b[i]) - q[i]) * f64::from(v[i])).sum::<f64>().abs() / (0..3).map(|i| q[i] * f64::from(v[i])).sum::<f64>();
                        worst[m][2] = worst[m][2].max(dd);
                    }
                }
                println!("{name:8} kappa {kappa:4}: near w1 {:.1e} wx {:.1e} D {:.1e}   far w1 {:.1e} wx {:.1e} D {:.1e}", worst[0][0], worst[0][1], worst[0][2], worst[1][0], worst[1][1], worst[1][2]);
            }
        }
    }

    #[test]
    fn slip_centres_on_vertices_edges_and_their_lines() {
        for (name, edges, radius) in shapes() {
            for edge in &edges {
                for (along, off) in [(0.0, 0.0), (0.5, 0.0), (0.25, 1e-6), (0.7, -1e-3), (1.0, 1e-7), (1.3, 0.0), (-0.2, 1e-5)] {
                    let (dx, dy) = (edge[2] - edge[0], edge[3] - edge[1]);
                    let c = [edge[0] + along * dx - off * dy, edge[1] + along * dy + off * dx];
                    let v = [c[1], -c[0], 1.0];
                    let length = (1.0 + c[0] * c[0] + c[1] * c[1]).sqrt();
                    let e = error(&edges, radius, v.map(|x| x / length));
                    assert!(e < 3e-6, "{name}: {e:.2e} at c = {c:?}");
                }
            }
        }
    }
}

//! Gradient basis of one contact at one twist, in f32: the twin of `shaders/fan.wgsl`, same
//! functions in the same order.
//!
//! For each weight `1, x1, x2` the integrals over a face of `weight * v(x)/|v(x)|` and of its
//! moment about the origin, where `v(x) = (u1 - omega x2, u2 + omega x1)`. Pressure times these is
//! the gradient of the dissipation; pressure times these times the twist is the dissipation itself
//! (it is homogeneous of degree one).

use super::lanes::pick_number;
use super::layout::{BASIS, ContactHeader, EdgeRecord, GAUSS, NEAR_LIMIT, ON_LINE, SERIES_LIMIT};

/// `asinh(s2/|h|) - asinh(s1/|h|)` of an edge of length `l` at distance `h` from the apex, from `s1` to
/// `s2` along it. Without branches: the logarithm of a quotient is that of the powers of two and twice
/// the inverse hyperbolic tangent of `(m - n)/(m + n)`, `m` and `n` the significands; for an edge seen
/// from far away of `l / (r1 + r2)` itself.
#[inline(always)]
pub(crate) fn edge_log(h: f32, l: f32, s1: f32, s2: f32, r1: f32, r2: f32) -> f32 {
    const FRACTION: u32 = (1 << 23) - 1;
    const ONE: u32 = 1.0_f32.to_bits();
    // Integers added to the last bits of this number are added to its value.
    const WHOLE: f32 = 12_582_912.0;
    let z = l / (r1 + r2);
    let astride = (s1 < 0.0) & (s2 > 0.0);
    let ahead = s1 >= 0.0;
    let far = pick_number(ahead, s2 + r2, r1 - s1);
    let near = pick_number(ahead, s1 + r1, r2 - s2);
    let a = pick_number(astride, (s2 + r2) * (r1 - s1), far).to_bits();
    let b = pick_number(astride, h * h, near).to_bits();
    let exponent =
        f32::from_bits((a >> 23).wrapping_sub(b >> 23).wrapping_add(WHOLE.to_bits())) - WHOLE;
    let (m, n) = (f32::from_bits(a & FRACTION | ONE), f32::from_bits(b & FRACTION | ONE));
    let series = (z <= SERIES_LIMIT) & !astride;
    let s = pick_number(series, z, (m - n) / (m + n));
    let exponent = pick_number(series, 0.0, exponent);
    let q = s * s;
    let high = 1.0 / 9.0 + q * (1.0 / 11.0 + q * (1.0 / 13.0 + q * (1.0 / 15.0)));
    let sum = 1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * high)));
    exponent * std::f32::consts::LN_2 + 2.0 * s * sum
}

/// Fan integrals about the apices `c` of some twists: `int e` (2), `int r`, `int y e` (11, 12, 22),
/// `int y r` (2).
#[inline(always)]
pub(crate) fn fan<const LANES: usize>(
    edges: &[EdgeRecord],
    c: &[[f32; LANES]; 2],
) -> [[f32; LANES]; 8] {
    let mut sum = [[0.0_f32; LANES]; 8];
    for edge in edges {
        let (dx, dy) = (edge[2] - edge[0], edge[3] - edge[1]);
        let l = (dx * dx + dy * dy).sqrt();
        let (t1, t2) = (dx / l, dy / l);
        let (n1, n2) = (t2, -t1);
        for lane in 0..LANES {
            let (ax, ay) = (edge[0] - c[0][lane], edge[1] - c[1][lane]);
            let (bx, by) = (edge[2] - c[0][lane], edge[3] - c[1][lane]);
            let h = ax * t2 - ay * t1;
            let (s1, s2) = (t1 * ax + t2 * ay, t1 * bx + t2 * by);
            let (r1, r2) = ((h * h + s1 * s1).sqrt(), (h * h + s2 * s2).sqrt());
            let counts = h.abs() > ON_LINE;
            let log = edge_log(h, l, s1, s2, r1, r2);
            let (h, log) = (pick_number(counts, h, 0.0), pick_number(counts, log, 0.0));
            let dr = (s2 - s1) * (s2 + s1) / (r1 + r2);
            let sr = s2 * r2 - s1 * r1;
            let h2log = h * h * log;
            let j2 = 0.5 * (sr - h2log);
            let r0 = 0.5 * (sr + h2log);
            let m1 = dr * (r1 * r1 + r1 * r2 + r2 * r2) / 3.0;
            sum[0][lane] += 0.5 * h * (h * n1 * log + t1 * dr);
            sum[1][lane] += 0.5 * h * (h * n2 * log + t2 * dr);
            sum[2][lane] += h / 3.0 * r0;
            sum[3][lane] += h / 3.0 * (h2log * n1 * n1 + 2.0 * h * n1 * t1 * dr + t1 * t1 * j2);
            sum[4][lane] +=
                h / 3.0 * (h2log * n1 * n2 + h * (n1 * t2 + n2 * t1) * dr + t1 * t2 * j2);
            sum[5][lane] += h / 3.0 * (h2log * n2 * n2 + 2.0 * h * n2 * t2 * dr + t2 * t2 * j2);
            sum[6][lane] += h / 4.0 * (h * n1 * r0 + t1 * m1);
            sum[7][lane] += h / 4.0 * (h * n2 * r0 + t2 * m1);
        }
    }
    sum
}

/// The basis from the fan about the slip centres of some twists, which must turn.
#[inline(always)]
pub(crate) fn basis_near<const LANES: usize>(
    edges: &[EdgeRecord],
    v: &[[f32; LANES]; 3],
) -> [[f32; LANES]; 9] {
    let mut c = [[0.0; LANES]; 2];
    for lane in 0..LANES {
        c[0][lane] = -v[1][lane] / v[2][lane];
        c[1][lane] = v[0][lane] / v[2][lane];
    }
    let sums = fan(edges, &c);
    let mut out = [[0.0; LANES]; 9];
    for lane in 0..LANES {
        let [e1, e2, r, ye11, ye12, ye22, yr1, yr2] = {
            let s = |m: usize| sums[m][lane];
            [s(0), s(1), s(2), s(3), s(4), s(5), s(6), s(7)]
        };
        let (c1, c2) = (c[0][lane], c[1][lane]);
        let sense = 1.0_f32.copysign(v[2][lane]);
        let torque = c1 * e1 + c2 * e2 + r;
        out[0][lane] = -sense * e2;
        out[1][lane] = sense * e1;
        out[2][lane] = sense * torque;
        out[3][lane] = -sense * (c1 * e2 + ye12);
        out[4][lane] = sense * (c1 * e1 + ye11);
        out[5][lane] = sense * (c1 * torque + c1 * ye11 + c2 * ye12 + yr1);
        out[6][lane] = -sense * (c2 * e2 + ye22);
        out[7][lane] = sense * (c2 * e1 + ye12);
        out[8][lane] = sense * (c2 * torque + c1 * ye12 + c2 * ye22 + yr2);
    }
    out
}

/// The basis from Gauss points on the triangles (origin, A, B), the integrand in twist form:
/// regular for translations. Takes the components of `LANES` twists and gives the nine numbers of
/// each, side by side.
#[inline(always)]
pub(crate) fn basis_far<const LANES: usize>(
    edges: &[EdgeRecord],
    v: &[[f32; LANES]; 3],
) -> [[f32; LANES]; 9] {
    let mut total = [[0.0_f32; LANES]; 9];
    for edge in edges {
        // One sum per edge: with all edges in one, rounding grows with the number of points.
        let mut sum = [[0.0_f32; LANES]; 9];
        let twice_area = edge[0] * edge[3] - edge[1] * edge[2];
        for across in GAUSS {
            let (px, py) = (
                edge[0] + across[0] * (edge[2] - edge[0]),
                edge[1] + across[0] * (edge[3] - edge[1]),
            );
            for along in GAUSS {
                let (x1, x2) = (along[0] * px, along[0] * py);
                let area = twice_area * across[1] * along[1] * along[0];
                for lane in 0..LANES {
                    let (v1, v2) = (v[0][lane] - v[2][lane] * x2, v[1][lane] + v[2][lane] * x1);
                    let weight = area / (v1 * v1 + v2 * v2).sqrt();
                    let (g1, g2) = (weight * v1, weight * v2);
                    let torque = x1 * g2 - x2 * g1;
                    sum[0][lane] += g1;
                    sum[1][lane] += g2;
                    sum[2][lane] += torque;
                    sum[3][lane] += x1 * g1;
                    sum[4][lane] += x1 * g2;
                    sum[5][lane] += x1 * torque;
                    sum[6][lane] += x2 * g1;
                    sum[7][lane] += x2 * g2;
                    sum[8][lane] += x2 * torque;
                }
            }
        }
        for (total, sum) in total.iter_mut().zip(sum) {
            for lane in 0..LANES {
                total[lane] += sum[lane];
            }
        }
    }
    total
}

/// The basis at some twists side by side, each by the form that serves it.
#[inline(always)]
pub(crate) fn basis<const LANES: usize>(
    edges: &[EdgeRecord],
    radius: f32,
    v: &[[f32; LANES]; 3],
) -> [[f32; LANES]; 9] {
    let near: [bool; LANES] = std::array::from_fn(|lane| {
        let across = v[0][lane] * v[0][lane] + v[1][lane] * v[1][lane];
        across <= NEAR_LIMIT * NEAR_LIMIT * radius * radius * v[2][lane] * v[2][lane]
    });
    if near == [false; LANES] {
        return basis_far(edges, v);
    }
    // A translation has no slip centre, and no use of what is put there.
    let turning: [[f32; LANES]; 3] = std::array::from_fn(|m| {
        std::array::from_fn(|lane| match (near[lane], m) {
            (true, _) => v[m][lane],
            (false, 2) => 1.0,
            (false, _) => 0.0,
        })
    });
    let mut all = basis_near(edges, &turning);
    if near != [true; LANES] {
        let far = basis_far(edges, v);
        for lane in 0..LANES {
            if !near[lane] {
                for m in 0..9 {
                    all[m][lane] = far[m][lane];
                }
            }
        }
    }
    all
}

/// Twists whose basis is computed side by side.
const LANES: usize = 8;

/// The gradient basis of one contact at every twist: `[face][twist][weight]`, and in each the
/// components `g1, g2, torque` and their product with the twist.
#[inline(always)]
pub(crate) fn fill_basis(
    header: &ContactHeader,
    edges: [&[EdgeRecord]; 2],
    twists: &[[f32; 4]],
) -> Vec<[f32; 4]> {
    let mut out = Vec::with_capacity(header.faces as usize * twists.len() * BASIS);
    for edges in &edges[..header.faces as usize] {
        for some in twists.chunks(LANES) {
            let v =
                [0, 1, 2].map(|m| std::array::from_fn(|lane| some[lane.min(some.len() - 1)][m]));
            let g = basis::<LANES>(edges, header.radius, &v);
            for (lane, v) in some.iter().enumerate() {
                for weight in 0..BASIS {
                    let g1 = g[3 * weight][lane];
                    let g2 = g[3 * weight + 1][lane];
                    let torque = g[3 * weight + 2][lane];
                    out.push([g1, g2, torque, v[0] * g1 + v[1] * g2 + v[2] * torque]);
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::SeedSet;
    use crate::backend::prepare::Prepared;
    use crate::contact::{Field, Loops, friction};
    use crate::model::{Contact, Patch, Polygon};
    use glam::DVec2;

    fn ring(points: &[(f64, f64)]) -> Vec<DVec2> {
        points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
    }

    /// Integrals of weights `1, x1, x2` by components `g1, g2, torque`.
    type Basis = [f32; 9];

    fn far(edges: &[EdgeRecord], v: [f32; 3]) -> Basis {
        basis_far(edges, &v.map(|x| [x])).map(|[x]| x)
    }

    fn near(edges: &[EdgeRecord], v: [f32; 3]) -> Basis {
        basis_near(edges, &v.map(|x| [x])).map(|[x]| x)
    }

    fn either(edges: &[EdgeRecord], radius: f32, v: [f32; 3]) -> Basis {
        basis(edges, radius, &v.map(|x| [x])).map(|[x]| x)
    }

    /// A scaled contact face in both precisions.
    struct Face {
        name: &'static str,
        edges: Vec<EdgeRecord>,
        radius: f32,
        exact: Loops,
        area: f64,
    }

    fn faces() -> Vec<Face> {
        let square = ring(&[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]);
        let outlines = vec![
            ("square", square.clone(), vec![]),
            ("bar", ring(&[(-5.0, -0.5), (5.0, -0.5), (5.0, 0.5), (-5.0, 0.5)]), vec![]),
            ("hollow", square, vec![ring(&[(-0.8, -0.8), (-0.8, 0.8), (0.8, 0.8), (0.8, -0.8)])]),
            (
                "L",
                ring(&[(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]),
                vec![],
            ),
            (
                "disc",
                (0..96)
                    .map(|i| DVec2::from_angle(f64::from(i) * std::f64::consts::TAU / 96.0))
                    .collect(),
                vec![],
            ),
        ];
        outlines
            .into_iter()
            .map(|(name, outer, holes)| {
                let patch: Patch = vec![Polygon { outer, holes }];
                let contact = Contact { face_i: patch.clone(), face_ii: patch.clone() };
                let prepared = Prepared::new(&contact).records.unwrap();
                assert_eq!(prepared.header.faces, 1, "{name}");
                let exact =
                    Loops::mapped(&patch, |point| (point - prepared.origin) / prepared.unit);
                Face {
                    name,
                    radius: prepared.header.radius,
                    area: f64::from(prepared.header.area_i),
                    edges: prepared.edges,
                    exact,
                }
            })
            .collect()
    }

    /// Errors over the area: of the dissipation (relative), of the weight 1, of the weights x.
    fn errors(face: &Face, found: &Basis, v: [f32; 3]) -> [f64; 3] {
        let v = v.map(f64::from);
        let exact = friction(Field { area: &face.exact, p: [1.0, 0.0, 0.0] }, v.into()).g.concat();
        let difference: Vec<f64> =
            found.iter().zip(&exact).map(|(a, b)| f64::from(*a) - b).collect();
        let largest =
            |part: &[f64]| part.iter().fold(0.0, |most: f64, x| most.max(x.abs())) / face.area;
        let along = |g: &[f64]| g[0] * v[0] + g[1] * v[1] + g[2] * v[2];
        [
            along(&difference).abs() / along(&exact),
            largest(&difference[..3]),
            largest(&difference[3..]),
        ]
    }

    fn worst(
        face: &Face,
        form: impl Fn([f32; 3]) -> Basis,
        twists: impl Iterator<Item = [f32; 3]>,
    ) -> [f64; 3] {
        twists
            .map(|v| errors(face, &form(v), v))
            .fold([0.0; 3], |most, e| [0, 1, 2].map(|i| most[i].max(e[i])))
    }

    fn assert_small(name: &str, errors: [f64; 3]) {
        println!(
            "{name}: dissipation {:.1e}, weight 1 {:.1e}, weights x {:.1e}",
            errors[0], errors[1], errors[2]
        );
        assert!(errors[0] < 2e-6 && errors[1] < 4e-6 && errors[2] < 1.2e-5, "{name}: {errors:?}");
    }

    fn about(c: glam::Vec2) -> [f32; 3] {
        [c.y, -c.x, 1.0].map(|x| x / (1.0 + c.length_squared()).sqrt())
    }

    #[test]
    fn single_precision_agrees_with_double_at_every_seed_twist() {
        for face in faces() {
            let set = SeedSet::new(16).unwrap();
            let twists = set.twists().iter().map(|v| [v[0], v[1], v[2]]);
            assert_small(face.name, worst(&face, |v| either(&face.edges, face.radius, v), twists));
        }
    }

    #[test]
    fn slip_centres_on_vertices_edges_and_their_lines() {
        for face in faces() {
            let offsets = [
                (0.0, 0.0),
                (0.5, 0.0),
                (0.25, 1e-6),
                (0.7, -1e-3),
                (1.0, 1e-7),
                (1.3, 0.0),
                (-0.2, 1e-5),
            ];
            let twists = face.edges.iter().flat_map(|edge| {
                let (a, b) = (glam::Vec2::new(edge[0], edge[1]), glam::Vec2::new(edge[2], edge[3]));
                offsets.map(|(along, off)| about(a + along * (b - a) + off * (b - a).perp()))
            });
            assert_small(face.name, worst(&face, |v| either(&face.edges, face.radius, v), twists));
        }
    }

    /// Prints the error of both forms by the slip centre's distance in circumradii: where
    /// [`NEAR_LIMIT`] comes from.
    #[test]
    fn near_and_far_forms_meet_where_both_are_good() {
        for face in faces() {
            for kappa in [0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 3.0, 10.0] {
                let twists = || {
                    (0..200).map(|i| {
                        about(glam::Vec2::from_angle(i as f32 * 0.7) * kappa * face.radius)
                    })
                };
                let close = worst(&face, |v| near(&face.edges, v), twists());
                let far = worst(&face, |v| far(&face.edges, v), twists());
                println!(
                    "{:8} {kappa:5}: near {:.1e} {:.1e} {:.1e}  far {:.1e} {:.1e} {:.1e}",
                    face.name, close[0], close[1], close[2], far[0], far[1], far[2]
                );
                if kappa == NEAR_LIMIT {
                    assert_small(face.name, close);
                    assert_small(face.name, far);
                }
            }
        }
    }
}

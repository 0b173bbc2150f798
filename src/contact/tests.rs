//! Closed forms against quadrature along the edges, for slip centres in every awkward place.

use glam::DVec2;

use super::surface::{Gap, Piece, pressed};
use super::*;
use crate::geometry::patch_area;
use crate::model::Polygon;

fn polygon(outer: &[(f64, f64)], holes: &[&[(f64, f64)]]) -> Loops {
    let ring = |points: &[(f64, f64)]| points.iter().map(|&(x, y)| DVec2::new(x, y)).collect();
    Loops::new(&[Polygon {
        outer: ring(outer),
        holes: holes.iter().map(|hole| ring(hole)).collect(),
    }])
}

fn notched() -> Loops {
    polygon(
        &[
            (-0.7, -0.5),
            (0.6, -0.6),
            (0.7, 0.5),
            (0.2, 0.5),
            (0.1, -0.1),
            (-0.2, 0.1),
            (-0.3, 0.6),
            (-0.8, 0.4),
        ],
        &[&[(-0.5, -0.3), (-0.2, -0.35), (-0.3, -0.1)]],
    )
}

/// 24-point Gauss on dyadic pieces that shrink towards `s = 0`: exact for the smooth and the nearly
/// singular integrand.
fn integrate(s1: f64, s2: f64, f: &dyn Fn(f64) -> [f64; 13]) -> [f64; 13] {
    const X: [f64; 6] = [
        0.125_233_408_511_468_92,
        0.367_831_498_998_180_2,
        0.587_317_954_286_617_4,
        0.769_902_674_194_304_7,
        0.904_117_256_370_474_9,
        0.981_560_634_246_719_3,
    ];
    const W: [f64; 6] = [
        0.249_147_045_813_402_8,
        0.233_492_536_538_354_8,
        0.203_167_426_723_065_92,
        0.160_078_328_543_346_23,
        0.106_939_325_995_318_43,
        0.047_175_336_386_511_83,
    ];
    let mut cuts = vec![s1, s2];
    if s1 < 0.0 && s2 > 0.0 {
        cuts.push(0.0);
    }
    for k in 0..60 {
        for sign in [-1.0, 1.0] {
            let cut = sign * 2f64.powi(3 - k);
            if cut > s1 && cut < s2 {
                cuts.push(cut);
            }
        }
    }
    cuts.sort_by(f64::total_cmp);
    let mut sum = [0.0; 13];
    for piece in cuts.windows(2) {
        let (mid, half) = ((piece[0] + piece[1]) / 2.0, (piece[1] - piece[0]) / 2.0);
        for i in 0..6 {
            for sign in [-1.0, 1.0] {
                let value = f(mid + sign * half * X[i]);
                for (total, v) in sum.iter_mut().zip(value) {
                    *total += half * W[i] * v;
                }
            }
        }
    }
    sum
}

/// Friction integrals by one-dimensional quadrature: with `x = c + lambda y`, `y` on the edge, the
/// radial integral of a homogeneous integrand of degree `k` is `1/(k + 2)` times its value on the
/// edge, and the area element is `h ds`.
fn oracle(area: &Loops, twist: [f64; 3], p: [f64; 3]) -> Friction {
    let [u1, u2, omega] = twist;
    let c = DVec2::new(-u2 / omega, u1 / omega);
    let sign = omega.signum();
    let mut out = Friction::ZERO;
    for (a, b) in area.edges() {
        let t = (b - a).normalize();
        let n = DVec2::new(t.y, -t.x);
        let h = (a - c).dot(n);
        if h == 0.0 {
            continue;
        }
        let sums = integrate((a - c).dot(t), (b - c).dot(t), &|s| {
            let y = h * n + s * t;
            let r = y.length();
            let e = y / r;
            let v = sign * DVec2::new(-e.y, e.x);
            let mut value = [0.0; 13];
            // weights 1, x1, x2 split in degree 0 (c) and degree 1 (y)
            for (m, (w0, w1)) in [(1.0, 0.0), (c.x, y.x), (c.y, y.y)].into_iter().enumerate() {
                let degree0 = [v.x, v.y, c.perp_dot(v)];
                let degree1 = [0.0, 0.0, y.perp_dot(v)];
                for i in 0..3 {
                    value[3 * m + i] = h
                        * (w0 * degree0[i] / 2.0
                            + (w1 * degree0[i] + w0 * degree1[i]) / 3.0
                            + w1 * degree1[i] / 4.0);
                }
            }
            let (p0, p1) = (p[0] + p[1] * c.x + p[2] * c.y, p[1] * y.x + p[2] * y.y);
            let w = h * (p0 + p1 / 2.0) / (r * omega.abs());
            value[9] = w * e.x * e.x;
            value[10] = w * e.x * e.y;
            value[11] = w * e.y * e.y;
            value
        });
        for m in 0..3 {
            for i in 0..3 {
                out.g[m][i] += sums[3 * m + i];
            }
        }
        let [h11, h12, h22] = [sums[9], sums[10], sums[11]];
        let lift = [[1.0, 0.0], [0.0, 1.0], [-c.y, c.x]];
        for i in 0..3 {
            for j in 0..3 {
                out.hessian[i][j] += lift[i][0] * (h11 * lift[j][0] + h12 * lift[j][1])
                    + lift[i][1] * (h12 * lift[j][0] + h22 * lift[j][1]);
            }
        }
    }
    out
}

fn worst_difference(a: &Friction, b: &Friction) -> (f64, f64) {
    let mut g: f64 = 0.0;
    let mut h: f64 = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            g = g.max((a.g[i][j] - b.g[i][j]).abs());
            h = h.max((a.hessian[i][j] - b.hessian[i][j]).abs());
        }
    }
    (g, h)
}

#[test]
fn closed_forms_match_quadrature_at_every_apex() {
    let area = notched();
    let p = [1.3, 0.4, -0.7];
    let apexes = [
        (0.05, -0.3),               // inside
        (-0.3, -0.25),              // in the hole
        (-0.7, -0.5),               // on a vertex
        (0.1, -0.1),                // on the re-entrant vertex
        (-0.2, -0.35),              // on a hole vertex
        (-0.05, -0.55),             // on an edge
        (-0.05, -0.55 + 1e-9),      // just off an edge
        (-0.7 + 1e-9, -0.5),        // just off a vertex
        (1.25, -0.65),              // on an edge's line, outside
        (0.0, 0.45),                // in the notch
        (0.9, 0.1),                 // near, outside
        (-1.9, 1.1),                // farther
        (0.45, 0.5),                // on another edge
        (1e-12, -1e-12),            //
        (-0.3 - 1e-9, -0.1 + 1e-9), // just off a hole vertex
    ];
    for (x, y) in apexes {
        for omega in [1.0, -0.37] {
            let twist = [y * omega, -x * omega, omega];
            let (got, want) =
                (friction(Field { area: &area, p }, twist.into()), oracle(&area, twist, p));
            let (g, h) = worst_difference(&got, &want);
            assert!(g < 2e-14 && h < 2e-13, "apex ({x}, {y}), omega {omega}: errors {g:e} {h:e}");
        }
    }
}

#[test]
fn far_field_joins_the_fan_and_runs_into_translation() {
    let area = notched();
    let p = [0.8, -0.2, 0.3];
    for angle in [0.1f64, 1.3, 2.9, 4.4] {
        let centre = area.middle() + 3.01 * area.radius() * DVec2::new(angle.cos(), angle.sin());
        let twist = [centre.y, -centre.x, 1.0];
        let (g, h) =
            worst_difference(&far::friction(&area, twist, p), &fan::friction(&area, twist, p));
        assert!(g < 5e-14 && h < 5e-14, "seam: {g:e} {h:e}");
    }
    let pure = friction(Field { area: &area, p }, [0.6, -0.8, 0.0].into());
    let nearly = friction(Field { area: &area, p }, [0.6, -0.8, 1e-12].into());
    let (g, h) = worst_difference(&pure, &nearly);
    assert!(g < 1e-11 && h < 1e-11, "{g:e} {h:e}");
    let m = moments(&area);
    assert!((pure.g[0][0] - 0.6 * m[0]).abs() < 1e-15 && (pure.g[2][1] + 0.8 * m[2]).abs() < 1e-15);
}

#[test]
fn hessian_is_the_derivative_of_the_gradient() {
    let area = notched();
    let p = [1.0, 0.3, 0.2];
    for twist in [[0.2, 0.1, 1.0], [-0.4, 0.7, -0.9], [3.0, -2.0, 0.4]] {
        let got = friction(Field { area: &area, p }, twist.into()).hessian;
        for j in 0..3 {
            let step = 1e-5;
            let at = |sign: f64| {
                let mut v = twist;
                v[j] += sign * step;
                friction(Field { area: &area, p }, v.into()).gradient(p)
            };
            let (plus, minus) = (at(1.0), at(-1.0));
            for i in 0..3 {
                let want = (plus[i] - minus[i]) / (2.0 * step);
                assert!(
                    (got[i][j] - want).abs() < 2e-9,
                    "{twist:?} [{i}][{j}]: {} {want}",
                    got[i][j]
                );
            }
        }
    }
}

/// Mean radius about the centroid under uniform pressure: torque of a pure rotation over the area.
fn mean_radius(area: &Loops) -> f64 {
    let m = moments(area);
    let c = DVec2::new(m[1] / m[0], m[2] / m[0]);
    let f = friction(Field { area, p: [1.0, 0.0, 0.0] }, Twist::about(c));
    (f.g[0][2] - c.x * f.g[0][1] + c.y * f.g[0][0]) / m[0]
}

fn rectangle(a: f64, b: f64) -> Vec<(f64, f64)> {
    vec![(-a / 2.0, -b / 2.0), (a / 2.0, -b / 2.0), (a / 2.0, b / 2.0), (-a / 2.0, b / 2.0)]
}

#[test]
fn exact_mean_radii() {
    let mut cases = vec![
        (polygon(&rectangle(1.0, 1.0), &[]), 0.382_597_858_232_106_346),
        (polygon(&rectangle(1.0, 2.0), &[]), 0.593_233_416_068_949_863),
        (polygon(&rectangle(1.0, 4.0), &[]), 1.060_779_397_733_900_97),
        (polygon(&rectangle(1.0, 10.0), &[]), 2.531_915_118_932_692_49),
        (polygon(&rectangle(1.0, 100.0), &[]), 25.005_109_715_166_456_2),
        (polygon(&rectangle(1.0, 1.0), &[&rectangle(0.25, 0.25)]), 0.401_727_751_143_711_663),
        (polygon(&rectangle(1.0, 1.0), &[&rectangle(0.5, 0.5)]), 0.446_364_167_937_457_403),
        (polygon(&rectangle(1.0, 1.0), &[&rectangle(0.8, 0.8)]), 0.518_632_652_270_188_602),
    ];
    for (n, want) in [
        (3usize, 0.460_057_666_050_157_725),
        (6, 0.607_986_405_500_360_756),
        (12, 0.651_575_216_783_683_405),
    ] {
        let ring: Vec<_> = (0..n)
            .map(|i| (std::f64::consts::TAU * i as f64 / n as f64).sin_cos())
            .map(|(s, c)| (c, s))
            .collect();
        cases.push((polygon(&ring, &[]), want));
    }
    for (arm, want) in [(1.0 / 3.0, 0.303_751_992_525_063_141), (0.5, 0.331_722_634_340_615_518)] {
        let (a, b) = (arm / 2.0, 0.5);
        let cross = [
            (a, -b),
            (a, -a),
            (b, -a),
            (b, a),
            (a, a),
            (a, b),
            (-a, b),
            (-a, a),
            (-b, a),
            (-b, -a),
            (-a, -a),
            (-a, -b),
        ];
        cases.push((polygon(&cross, &[]), want));
    }
    for (area, want) in cases {
        let got = mean_radius(&area);
        assert!((got / want - 1.0).abs() < 1e-13, "{got} {want}");
    }
}

#[test]
fn exact_wrenches_of_the_unit_square() {
    let area = polygon(&rectangle(1.0, 1.0), &[]);
    for ((x, y), want) in [
        (
            (-0.5, -0.5),
            [-0.647_793_574_696_319_037, 0.647_793_574_696_319_037, 0.117_402_141_767_893_654],
        ),
        ((-0.5, 0.0), [0.0, 0.790_228_819_434_550_872, 0.198_119_006_351_674_427]),
        ((-1.0, 0.0), [0.0, 0.953_435_465_727_766_812, 0.089_985_041_683_193_381_2]),
        ((-2.0, 0.0), [0.0, 0.989_235_815_005_028_667, 0.042_596_319_748_586_662_7]),
        ((-10.0, 0.0), [0.0, 0.999_582_761_024_177_656, 0.008_340_964_933_787_255_77]),
    ] {
        let got = friction(Field { area: &area, p: [1.0, 0.0, 0.0] }, [y, -x, 1.0].into()).g[0];
        for i in 0..3 {
            assert!((got[i] - want[i]).abs() < 2e-14, "({x}, {y}): {got:?} {want:?}");
        }
    }
}

#[test]
fn clipping_keeps_what_the_pressure_presses() {
    let area = notched();
    let mut kept = Loops::default();
    let (p, q) = ([0.1, 1.0, 0.5], [-0.1, -1.0, -0.5]);
    let mut rest = Loops::default();
    area.clip_into(p, &mut kept);
    area.clip_into(q, &mut rest);
    let (all, a, b) = (moments(&area), moments(&kept), moments(&rest));
    for i in 0..6 {
        assert!((all[i] - a[i] - b[i]).abs() < 1e-15);
    }
    area.clip_into([-9.0, 1.0, 0.0], &mut kept);
    assert!(kept.is_empty() && moments(&kept)[0] == 0.0 && !area.is_empty());
}

#[test]
fn what_is_pressed_is_where_the_layer_gives_more_than_the_gap() {
    let (low, high) = ([-0.011, -0.008], [0.009, 0.012]);
    let (at, axis) = (DVec2::new(0.001, -0.002), DVec2::new(0.6, 0.8));
    let height = 1e-5;
    let gaps = [
        Gap::Plane { height, slope: DVec2::new(0.03, -0.04) },
        Gap::Plane { height, slope: DVec2::new(-0.003, 0.001) },
        Gap::Cylinder { radius: 0.04, axis, at, height },
        Gap::Cylinder { radius: -0.04, axis, at, height: -1e-4 },
        Gap::Sphere { radius: 0.05, at, height },
        Gap::Barrel { radius: 0.03, meridian: 0.2, axis, at, height },
        Gap::Cone { radius: 0.03, slope: 0.05, axis, at, height },
        Gap::Cone { radius: 0.03, slope: -0.02, axis, at, height },
    ];
    let corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])];
    let outer: Vec<DVec2> = corners.map(DVec2::from).to_vec();
    for gap in gaps {
        let piece = Piece { outer: outer.clone(), holes: Vec::new(), gap };
        let over = |x: DVec2| {
            let (s, t) = (axis.dot(x - at), axis.perp_dot(x - at));
            match gap {
                Gap::Plane { height, slope } => height + slope.dot(x),
                Gap::Cylinder { radius, height, .. } => height + t * t / (2.0 * radius),
                Gap::Sphere { radius, height, .. } => height + (s * s + t * t) / (2.0 * radius),
                Gap::Barrel { radius, meridian, height, .. } => {
                    height + s * s / (2.0 * meridian) + t * t / (2.0 * radius)
                }
                Gap::Cone { radius, slope, height, .. } => {
                    height + slope * s + t * t / (2.0 * radius)
                }
            }
        };
        for delta in [5e-5, 2e-4, -2e-4] {
            let (count, size) = (400, [high[0] - low[0], high[1] - low[1]]);
            let place =
                |i: i32, k: usize| low[k] + size[k] * (f64::from(i) + 0.5) / f64::from(count);
            let inside = (0..count)
                .flat_map(|i| (0..count).map(move |j| DVec2::new(place(i, 0), place(j, 1))))
                .filter(|x| over(*x) < delta)
                .count();
            let wanted = inside as f64 / f64::from(count * count);
            let got = patch_area(&pressed(&piece, delta)) / (size[0] * size[1]);
            assert!((got - wanted).abs() < 3e-3, "{gap:?} {delta}: {got} {wanted}");
        }
    }
}

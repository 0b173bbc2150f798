//! Values known exactly: discs by elliptic integrals, bars, figure 6, shapes under a pure moment,
//! nearly pure translation.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};
use gripfast::contact::{Field, Loops, friction, moments};
use gripfast::mechanics::{Options, solve};
use gripfast::model::{Contact, Patch, Polygon, Score, Slip, Status, Wrench};

fn polygon(n: usize, radius: f64) -> Vec<DVec2> {
    (0..n).map(|i| radius * DVec2::from_angle(TAU * i as f64 / n as f64)).collect()
}

fn rectangle(a: f64, b: f64) -> Vec<DVec2> {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| DVec2::new(x * a / 2.0, y * b / 2.0))
        .to_vec()
}

fn patch(outer: Vec<DVec2>, holes: Vec<Vec<DVec2>>) -> Patch {
    vec![Polygon { outer, holes }]
}

/// The limit of values at `n, 2n, 4n, ..` corners, whose errors are even powers of `1/n`
/// (Richardson).
fn round(first: usize, value: impl Fn(usize) -> f64) -> f64 {
    let mut row: Vec<f64> = (0..5).map(|i| value(first << i)).collect();
    let mut power = 4.0;
    while row.len() > 1 {
        row = row.windows(2).map(|pair| pair[1] + (pair[1] - pair[0]) / (power - 1.0)).collect();
        power *= 4.0;
    }
    row[0]
}

/// Complete elliptic integrals `K`, `E` of parameter `m` by the arithmetic-geometric mean.
fn elliptic(m: f64) -> (f64, f64) {
    let (mut a, mut b, mut share, mut sum) = (1.0, (1.0 - m).sqrt(), 0.5, m / 2.0);
    for _ in 0..8 {
        let c = (a - b) / 2.0;
        (a, b) = ((a + b) / 2.0, (a * b).sqrt());
        share *= 2.0;
        sum += share * c * c;
    }
    let k = FRAC_PI_2 / a;
    (k, k * (1.0 - sum))
}

/// `int |v|` and the force over a disc of radius 1 that turns at unit rate about a point `k` from
/// its middle, `0 < k < 1`.
fn disc(k: f64) -> (f64, f64) {
    let (big_k, e) = elliptic(k * k);
    let d = 4.0 / 9.0 * ((7.0 + k * k) * e - 4.0 * (1.0 - k * k) * big_k);
    let f = 4.0 / (3.0 * k) * ((1.0 + k * k) * e - (1.0 - k * k) * big_k);
    (d, f)
}

/// `int |v|` and the force over a regular polygon.
fn polygonal_disc(n: usize, k: f64) -> (f64, f64) {
    let area = Loops::new(&patch(polygon(n, 1.0), vec![]));
    let g = friction(Field { area: &area, p: [1.0, 0.0, 0.0] }, [0.0, -k, 1.0].into()).g[0];
    (g[2] - k * g[1], -g[1])
}

#[test]
fn discs_by_elliptic_integrals() {
    for k in [0.1, 0.3, 0.6, 0.653001789205597639, 0.9] {
        let (d, f) = disc(k);
        let (got_d, got_f) =
            (round(128, |n| polygonal_disc(n, k).0), round(128, |n| polygonal_disc(n, k).1));
        assert!(
            (got_d / d - 1.0).abs() < 1e-12 && (got_f / f - 1.0).abs() < 1e-12,
            "{k}: {got_d} {d}, {got_f} {f}"
        );
    }
    // On the rim: the formulas' limits, and the closed forms with the slip centre on a vertex.
    let (d, f) = (32.0 / 9.0, 8.0 / 3.0);
    let (e_d, e_f) = disc(1.0 - 1e-9);
    assert!((e_d - d).abs() < 1e-8 && (e_f - f).abs() < 1e-7, "{e_d} {e_f}");
    let (got_d, got_f) = polygonal_disc(4096, 1.0);
    assert!((got_d - d).abs() < 1e-5 && (got_f - f).abs() < 1e-5, "{got_d} {got_f}");
}

#[test]
fn a_disc_that_slides_and_spins_ends_both_at_once() {
    // v'/v = w'/w with m v' = -F, (m/2) w' = -T at v/w = k: F/k = 2 T, T = D - k F.
    let excess = |force: f64, d: f64, k: f64| force / k - 2.0 * (d - k * force);
    let root = |value: &dyn Fn(f64) -> f64| {
        let (mut low, mut high) = (0.3, 0.95);
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if value(low) * value(middle) <= 0.0 { high = middle } else { low = middle }
        }
        (low + high) / 2.0
    };
    let exact = root(&|k| excess(disc(k).1, disc(k).0, k));
    assert!((exact - 0.653001789205597639).abs() < 1e-13, "{exact}");
    let got = round(64, |n| root(&|k| excess(polygonal_disc(n, k).1, polygonal_disc(n, k).0, k)));
    // A polygon's moment of inertia differs; that difference too goes with even powers of 1/n.
    assert!((got - exact).abs() < 1e-12, "{got} {exact}");
}

/// Torque over normal force of a pure turn about the middle under uniform pressure.
fn mean_radius(patch: &Patch) -> f64 {
    let area = Loops::new(patch);
    friction(Field { area: &area, p: [1.0, 0.0, 0.0] }, [0.0, 0.0, 1.0].into()).g[0][2]
        / moments(&area)[0]
}

#[test]
fn mean_radii_of_round_and_thin_shapes() {
    let disc = round(32, |n| mean_radius(&patch(polygon(n, 1.0), vec![])));
    assert!((disc - 2.0 / 3.0).abs() < 1e-13, "{disc}");
    for r in [0.2f64, 0.5, 0.9] {
        let got = round(32, |n| mean_radius(&patch(polygon(n, 1.0), vec![polygon(n, r)])));
        let want = 2.0 / 3.0 * (1.0 - r.powi(3)) / (1.0 - r * r);
        assert!((got / want - 1.0).abs() < 1e-12, "{r}: {got} {want}");
    }
    // b^2/(12 a) asinh(a/b) and the rest of the rectangle's formula vanish with the bar's width.
    let bar = mean_radius(&patch(rectangle(1.0, 1e-5), vec![]));
    assert!((bar - 0.25).abs() < 1e-9, "{bar}");
    for n in [3usize, 4, 5, 8, 17, 64] {
        let (h, s) = ((PI / n as f64).cos(), (PI / n as f64).sin());
        let want = (h.hypot(s) + h * h / s * (s / h).asinh()) / 3.0;
        let got = mean_radius(&patch(polygon(n, 1.0), vec![]));
        assert!((got / want - 1.0).abs() < 1e-13, "{n}: {got} {want}");
    }
    for (a, b) in [(1.0, 1.0), (1.0f64, 3.0f64), (0.2, 7.0), (1e-3, 1.0)] {
        let q = a.hypot(b);
        let want =
            q / 6.0 + a * a / (12.0 * b) * (b / a).asinh() + b * b / (12.0 * a) * (a / b).asinh();
        let got = mean_radius(&patch(rectangle(a, b), vec![]));
        assert!((got / want - 1.0).abs() < 1e-12, "{a} {b}: {got} {want}");
    }
}

/// Both faces alike, full contact: the whole solver.
fn solved(patch: &Patch, distance: f64, force: [f64; 3], moment: [f64; 3]) -> Score {
    let contact = Contact { face_i: patch.clone(), face_ii: patch.clone() };
    let wrench = Wrench { force: DVec3::from_array(force), moment: DVec3::from_array(moment) };
    let score = solve(&contact, distance, 1.0, &wrench, &Options::default()).unwrap();
    assert_eq!(score.status, Status::Ok, "{score:?}");
    score
}

#[test]
fn shapes_under_a_pure_moment() {
    let cross = |arm: f64| {
        let (a, b) = (arm / 2.0, 0.5);
        [
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
        ]
        .map(|(x, y)| DVec2::new(x, y))
        .to_vec()
    };
    for (name, shape, radius) in [
        ("square", patch(rectangle(1.0, 1.0), vec![]), 0.382597858232106346),
        ("1 x 4", patch(rectangle(1.0, 4.0), vec![]), 1.06077939773390097),
        ("1 x 100", patch(rectangle(1.0, 100.0), vec![]), 25.0051097151664562),
        ("triangle", patch(polygon(3, 1.0), vec![]), 0.460057666050157725),
        (
            "hollow by 1/4",
            patch(rectangle(1.0, 1.0), vec![rectangle(0.25, 0.25)]),
            0.401727751143711663,
        ),
        (
            "hollow by 1/2",
            patch(rectangle(1.0, 1.0), vec![rectangle(0.5, 0.5)]),
            0.446364167937457403,
        ),
        (
            "hollow by 4/5",
            patch(rectangle(1.0, 1.0), vec![rectangle(0.8, 0.8)]),
            0.518632652270188602,
        ),
        ("cross 1/3", patch(cross(1.0 / 3.0), vec![]), 0.303751992525063141),
        ("cross 1/2", patch(cross(0.5), vec![]), 0.331722634340615518),
    ] {
        // Neither the distance nor F3 nor a tilting moment that leaves the contact whole matters.
        for (distance, f3, m1) in [(0.0, 0.0, 0.0), (0.5, 0.3, 0.02), (-0.5, -0.3, 0.01)] {
            let score = solved(&shape, distance, [0.0, 0.0, f3], [m1, 0.0, -0.1]);
            assert!(
                (score.mu_s.unwrap() * 2.0 * radius / 0.1 - 1.0).abs() < 1e-10,
                "{name}: {score:?}"
            );
            let Some(Slip::Rotation { c, sense: -1 }) = score.slip else {
                panic!("{name}: {score:?}")
            };
            assert!(c[0].hypot(c[1]) < 1e-9, "{name}: {c:?}");
        }
    }
}

#[test]
fn a_bar_pushed_square_on_at_its_end() {
    // mu N = F/(sqrt 2 - 1), slip centre (sqrt 2 - 1)/2 lengths beyond the middle, for a bar
    // without width.
    let root = 2f64.sqrt() - 1.0;
    let score = solved(&patch(rectangle(1.0, 1e-6), vec![]), 0.0, [0.0, 0.2, 0.0], [0.0, 0.0, 0.1]);
    assert!((score.mu_s.unwrap() * 2.0 * root / 0.2 - 1.0).abs() < 1e-10, "{score:?}");
    let Some(Slip::Rotation { c, sense: 1 }) = score.slip else { panic!("{score:?}") };
    assert!((c[0] + root / 2.0).abs() < 1e-9 && c[1].abs() < 1e-9, "{c:?}");
}

#[test]
fn figure_6_to_the_last_printed_digit() {
    let square = patch(rectangle(1.0, 1.0), vec![]);
    for (arm, want) in [
        (0.0, 1.0),
        (0.05, 1.014566423333),
        (0.1, 1.054342806444),
        (0.2, 1.183693776665),
        (0.5, 1.740168179453),
        (1.0, 2.873173680110),
        (2.0, 5.365797468739),
        (5.0, 13.125051563729),
        (10.0, 26.165439852718),
    ] {
        let weight = 0.01;
        let score = solved(&square, 1.0, [-weight, 0.0, 0.0], [0.0, 0.0, weight * arm]);
        let got = score.mu_s.unwrap() * 2.0 / weight;
        assert!((got - want).abs() < 1e-12 * want + 6e-13, "{arm}: {got} {want}");
    }
}

#[test]
fn a_force_just_beside_the_middle_nearly_slides() {
    // |c| eps = <x^2> across the force, mu N/|F| = 1 + eps^2/(2 <x^2>), for a unit square <x^2> = 1/12.
    let square = patch(rectangle(1.0, 1.0), vec![]);
    for eps in [1e-2, 1e-3, 1e-4] {
        let score = solved(&square, 0.3, [0.0, 0.3, 0.0], [0.0, 0.0, 0.3 * eps]);
        assert!(
            (score.mu_s.unwrap() * 2.0 / 0.3 - 1.0 - 6.0 * eps * eps).abs()
                < 200.0 * eps.powi(4) + 1e-14,
            "{eps}: {score:?}"
        );
        let Some(Slip::Rotation { c, .. }) = score.slip else { panic!("{score:?}") };
        assert!((-c[0] * eps * 12.0 - 1.0).abs() < 100.0 * eps * eps + 1e-9, "{eps}: {c:?}");
    }
}

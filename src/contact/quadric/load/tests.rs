use super::*;
use crate::geometry::{HalfPlane, clip_rings_half_plane};
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

/// A star about `middle` with the given distances of its corners.
fn star(middle: DVec2, radii: &[f64], turn: f64) -> Ring {
    let step = TAU / radii.len() as f64;
    let corner =
        |(k, radius): (usize, &f64)| middle + *radius * DVec2::from_angle(turn + step * k as f64);
    radii.iter().enumerate().map(corner).collect()
}

fn rings() -> impl Strategy<Value = Vec<Ring>> {
    let radii = proptest::collection::vec(0.3..2.0, 3..12);
    let hole = (proptest::option::of(0.02..0.25), 0.0..TAU);
    (radii, -1.5..1.5, -1.5..1.5, 0.0..TAU, hole).prop_map(|(radii, x, y, turn, (hole, by))| {
        let middle = DVec2::new(x, y);
        let mut rings = vec![star(middle, &radii, turn)];
        if let Some(radius) = hole {
            let mut hole = star(middle, &[radius; 5], by);
            // Within the nearest edge of a star with three corners or more.
            let within = (PI / radii.len() as f64).cos() * 0.3 * 0.5;
            hole.iter_mut().for_each(|x| *x = middle + (*x - middle) * within / 0.25);
            hole.reverse();
            rings.push(hole);
        }
        rings
    })
}

fn quadratics() -> impl Strategy<Value = Quadratic> {
    let bends = prop_oneof![
        (-3.0..-0.05, -3.0..-0.05),
        (0.05..3.0).prop_map(|l: f64| (-l, -l)),
        (-3.0..-0.05).prop_map(|l| (0.0, l)),
        (-3.0..-0.05).prop_map(|l| (l, 0.0)),
        Just((0.0, 0.0)),
    ];
    let slope = prop_oneof![Just(0.0), -1.0..1.0];
    (-0.3..2.0, slope.clone(), slope, bends).prop_map(|(c, g1, g2, (l1, l2))| Quadratic {
        c,
        g: DVec2::new(g1, g2),
        l: DVec2::new(l1, l2),
    })
}

/// Nodes and weights of the double exponential rule on `(0, 1)`: ends at which a root bends do no
/// harm.
fn nodes() -> Vec<[f64; 3]> {
    let step = 1.0 / 24.0;
    let node = |k: i32| {
        let t = step * f64::from(k);
        let s = 0.5 * PI * t.sinh();
        let weight = 0.25 * PI * step * t.cosh() / s.cosh().powi(2);
        // From either end.
        [1.0 / (1.0 + (-2.0 * s).exp()), 1.0 / (1.0 + (2.0 * s).exp()), weight]
    };
    (-80..=80).map(node).collect()
}

/// Area and load line by line: on each line `x1 = x` the integrals are those of a polynomial.
fn by_lines(rings: &[Ring], u: &Quadratic) -> (f64, f64) {
    let edges = || rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
    // Where something happens on a line: corners, crossings of the conic, its ends.
    let mut places: Vec<f64> = Vec::new();
    for (&a, &b) in edges() {
        let step = b - a;
        let bend = 0.5 * u.l.dot(step * step);
        let ends = roots(u.value(a), u.value(b) - u.value(a) - bend, bend);
        let crossings = ends.into_iter().flatten().filter(|t| (0.0..1.0).contains(t));
        places.extend(crossings.map(|t| a.x + t * step.x));
        places.push(a.x);
    }
    let (low, high) = (
        places.iter().copied().fold(f64::INFINITY, f64::min),
        places.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    );
    if u.l.y != 0.0 {
        let rest = u.c - 0.5 * u.g.y * u.g.y / u.l.y;
        places.extend(roots(rest, u.g.x, 0.5 * u.l.x).into_iter().flatten());
    } else if u.g.y == 0.0 {
        places.extend(roots(u.c, u.g.x, 0.5 * u.l.x).into_iter().flatten());
    }
    places.retain(|x| (low..=high).contains(x));
    places.sort_by(f64::total_cmp);
    let (mut area, mut load) = (0.0, 0.0);
    let nodes = nodes();
    for pair in places.windows(2) {
        let length = pair[1] - pair[0];
        for [near, far, weight] in &nodes {
            let x = if near < far { pair[0] + near * length } else { pair[1] - far * length };
            let mut cuts: Vec<f64> = edges()
                .filter(|(a, b)| (a.x > x) != (b.x > x))
                .map(|(a, b)| a.y + (b.y - a.y) * ((x - a.x) / (b.x - a.x)))
                .collect();
            cuts.sort_by(f64::total_cmp);
            let at = |y: f64| u.value(DVec2::new(x, y));
            let ends: Vec<f64> = roots(at(0.0), u.g.y, 0.5 * u.l.y).into_iter().flatten().collect();
            for chord in cuts.chunks_exact(2) {
                let mut stops = chord.to_vec();
                stops.extend(ends.iter().filter(|y| (chord[0]..chord[1]).contains(*y)));
                stops.sort_by(f64::total_cmp);
                for part in stops.windows(2) {
                    let middle = at(0.5 * (part[0] + part[1]));
                    if middle > 0.0 {
                        let share = weight * length * (part[1] - part[0]);
                        area += share;
                        load += share * (at(part[0]) + 4.0 * middle + at(part[1])) / 6.0;
                    }
                }
            }
        }
    }
    (area, load)
}

/// Rounding of sums whose terms are at most that much larger than what they come to.
const ROUNDING: f64 = 20.0 * f64::EPSILON / SLIVER;

/// Equal loads, and equal areas but for what the points of a sliver count more.
fn agree((area, load): (f64, f64), (other, wanted): (f64, f64), is_closed: bool) -> bool {
    let within = if is_closed { ROUNDING } else { 1e-6 };
    (area - other).abs() <= within * (other + 1e-2)
        && (load - wanted).abs() <= ROUNDING * (wanted + 1e-2)
}

fn is_closed(rings: &[Ring], u: &Quadratic) -> bool {
    closed(rings, u).is_some()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn lines_agree(rings in rings(), u in quadratics()) {
        let (got, wanted) = (area_and_load(&rings, &u), by_lines(&rings, &u));
        prop_assert!(agree(got, wanted, is_closed(&rings, &u)), "{got:?} {wanted:?}");
    }

    /// Turned, grown, stretched along an axis, and in two parts it is what it was.
    #[test]
    fn what_changes_nothing_changes_nothing(
        rings in rings(),
        u in quadratics(),
        turn in 0.0..TAU,
        grown in 0.1..10.0_f64,
        cut in 0.0..TAU,
    ) {
        let (area, load) = area_and_load(&rings, &u);
        let known = is_closed(&rings, &u);
        let map = |f: &dyn Fn(DVec2) -> DVec2| -> Vec<Ring> {
            rings.iter().map(|ring| ring.iter().map(|x| f(*x)).collect()).collect()
        };
        // Half as wide and twice the slope along one axis; the compression in other units.
        let by = DVec2::new(grown, 1.0);
        let wide = map(&|x| x * by);
        let other = Quadratic { c: 3.0 * u.c, g: 3.0 * u.g / by, l: 3.0 * u.l / (by * by) };
        let (a, l) = area_and_load(&wide, &other);
        let got = (a / grown, l / (3.0 * grown));
        prop_assert!(agree(got, (area, load), known && is_closed(&wide, &other)));
        if u.l.x == u.l.y {
            let turned = map(&|x| DVec2::from_angle(turn).rotate(x));
            let other = Quadratic { g: DVec2::from_angle(turn).rotate(u.g), ..u };
            let got = area_and_load(&turned, &other);
            let known = known && is_closed(&turned, &other);
            prop_assert!(agree(got, (area, load), known), "{got:?} {area} {load}");
        }
        let normal = DVec2::from_angle(cut);
        let half = [1.0, -1.0].map(|side| HalfPlane { normal: side * normal, offset: 0.1 * side });
        let halves = half.map(|half| clip_rings_half_plane(&rings, &half));
        let known = known && halves.iter().all(|half| is_closed(half, &u));
        let halves = halves.map(|half| area_and_load(&half, &u));
        let sum = (halves[0].0 + halves[1].0, halves[0].1 + halves[1].1);
        prop_assert!(agree(sum, (area, load), known), "{sum:?} {area} {load}");
    }

    /// What the points of the pressed region give, to which the cut at a pressure just below nought
    /// adds a little area.
    #[test]
    fn points_of_the_region_agree(rings in rings(), u in quadratics()) {
        // The points are good to 1e-10, at the tip of a parabola to 1e-8.
        let straight = |l: f64, g: f64| l == 0.0 && g != 0.0;
        let is_parabola = straight(u.l.x, u.g.x) || straight(u.l.y, u.g.y);
        let within = if is_parabola { 1e-7 } else { 1e-10 };
        let (area, load) = area_and_load(&rings, &u);
        let (other, wanted) = Region::new(&rings, u).area_and_load();
        prop_assert!((load - wanted).abs() <= within * (wanted + 1e-2), "{load} {wanted}");
        prop_assert!((area - other).abs() <= 1e-5 * (other + 1e-2), "{area} {other}");
    }
}

#[test]
fn whole_and_half_spots() {
    let square = |half: f64| star(DVec2::ZERO, &[half * 2.0_f64.sqrt(); 4], 0.25 * PI);
    let u = Quadratic { c: 1.0, g: DVec2::ZERO, l: DVec2::splat(-2.0) };
    let near = |(area, load): (f64, f64), wanted: f64| {
        (area - wanted).abs() < 1e-14 && (load - 0.5 * wanted).abs() < 1e-14
    };
    assert!(near(area_and_load(&[square(2.0)], &u), PI));
    let right = square(2.0).into_iter().map(|x| x.max(DVec2::new(0.0, -9.0))).collect();
    assert!(near(area_and_load(&[right], &u), 0.5 * PI));
    // A hole as large as the disc leaves nothing, and so does a square beside it.
    let hole = square(1.5).into_iter().rev().collect();
    assert_eq!(area_and_load(&[square(2.0), hole], &u), (0.0, 0.0));
    let beside = square(0.2).into_iter().map(|x| x + DVec2::new(-1.3, 0.0)).collect();
    assert_eq!(area_and_load(&[beside], &u), (0.0, 0.0));
}

/// A sliver along the flat side of a slender ellipse: its arc turns little, but is long beside the
/// ellipse's narrower half.
#[test]
fn a_long_flat_arc_is_cut() {
    let ring = vec![
        DVec2::new(7.517, 0.4486290194871658),
        DVec2::new(-2.2613, -2.231434907556965),
        DVec2::new(8.8632, -1.4442071219433044),
    ];
    let u = Quadratic {
        c: 3.522021467356128,
        g: DVec2::new(-0.0581923, 2.754402094443526),
        l: DVec2::new(-0.1778, -7.708792951357613),
    };
    let rings = [ring];
    let (region, lines) = (Region::new(&rings, u).area_and_load(), by_lines(&rings, &u));
    assert!(closed(&rings, &u).is_none());
    assert!((region.1 / lines.1 - 1.0).abs() < 1e-12, "{region:?} {lines:?}");
}

/// A ring that leaves the disc at its last corner, which lies on the circle.
#[test]
fn a_corner_on_the_circle_is_in_or_out() {
    let ring = vec![DVec2::new(-1.0 + 1e-16, -1.0), DVec2::ZERO, DVec2::new(-1.0, 0.0)];
    let u = Quadratic { c: 0.5, g: DVec2::ZERO, l: DVec2::splat(-1.0) };
    for first in 0..3 {
        let mut ring = ring.clone();
        ring.rotate_left(first);
        let (area, load) = area_and_load(&[ring], &u);
        assert!(
            (area - PI / 8.0).abs() < 1e-12 && (load - PI / 32.0).abs() < 1e-12,
            "{area} {load}"
        );
    }
}

use std::f64::consts::TAU;

use proptest::collection::vec;
use proptest::prelude::*;

use super::*;

fn rectangle(half: DVec2) -> Ring {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| half * DVec2::new(x, y))
        .to_vec()
}

fn shapes() -> Vec<(Vec<Ring>, Quadratic)> {
    let square = vec![rectangle(DVec2::new(2.0, 1.5))];
    let mut hollow = square.clone();
    hollow.push(rectangle(DVec2::new(0.3, 0.2)).into_iter().rev().collect());
    let kinds = [
        // Cylinder with and without tilt, parted; sphere; barrel cut by the ends; planes; bore.
        (1.0, (0.0, 0.0), (0.0, -4.0)),
        (1.0, (0.2, 0.1), (0.0, -4.0)),
        (0.3, (0.4, 0.0), (0.0, -4.0)),
        (0.5, (0.1, -0.2), (-1.5, -1.5)),
        (1.0, (0.1, 0.2), (-0.2, -3.0)),
        (1.0, (0.1, 0.2), (-3.0, -0.1)),
        (1.0, (0.2, -0.1), (0.0, 0.0)),
        (0.5, (0.6, -0.2), (0.0, 0.0)),
        (-0.5, (0.1, 0.05), (0.0, 2.0)),
    ];
    let quadratic = |(c, g, l): (f64, (f64, f64), (f64, f64))| Quadratic {
        c,
        g: DVec2::from(g),
        l: DVec2::from(l),
    };
    kinds
        .into_iter()
        .flat_map(|kind| [(square.clone(), quadratic(kind)), (hollow.clone(), quadratic(kind))])
        .collect()
}

/// The integrals as they are defined: lines of Gauss points between all places where something
/// happens on the line.
fn by_lines(rings: &[Ring], u: &Quadratic, f: impl Fn(DVec2) -> f64) -> f64 {
    let mut total = 0.0;
    let n = 3000;
    for i in 0..n {
        let x = -2.0 + 4.0 * (f64::from(i) + 0.5) / f64::from(n);
        let mut cuts = vec![-1.5, 1.5, -0.2, 0.2];
        let at = |y: f64| u.value(DVec2::new(x, y));
        let bend = 0.5 * u.l.y;
        cuts.extend(roots(at(0.0), u.g.y, bend).into_iter().flatten());
        cuts.retain(|y| y.abs() <= 1.5);
        cuts.sort_by(f64::total_cmp);
        for pair in cuts.windows(2) {
            let middle = DVec2::new(x, 0.5 * (pair[0] + pair[1]));
            if !contains(rings, middle) || u.value(middle) <= 0.0 {
                continue;
            }
            for &(t, w) in &RULES[12] {
                let y = DVec2::new(x, pair[0] + t * (pair[1] - pair[0]));
                total += w * (pair[1] - pair[0]) * f(y) * u.value(y);
            }
        }
    }
    total * 4.0 / f64::from(n)
}

#[test]
fn areas_and_dissipations_agree_with_lines_of_points() {
    for (rings, u) in shapes() {
        let region = Region::new(&rings, u);
        let (_, load) = region.area_and_load();
        let wanted = by_lines(&rings, &u, |_| 1.0);
        assert!((load / wanted - 1.0).abs() < 3e-5, "{u:?} {load} {wanted}");
        for twist in [[0.3, 0.2, 1.0], [1.0, -2.0, 0.3], [0.0, 0.1, -1.0], [1.0, 0.5, 0.0]] {
            let got = region.dissipation(twist).value;
            let [u1, u2, omega] = twist;
            let speed = |x: DVec2| DVec2::new(u1 - omega * x.y, u2 + omega * x.x).length();
            let wanted = by_lines(&rings, &u, speed);
            assert!((got / wanted - 1.0).abs() < 3e-5, "{u:?} {twist:?} {got} {wanted}");
        }
    }
}

/// Both ways to integrate agree where both apply, and the derivatives are those of the value.
#[test]
fn both_ways_agree_and_the_derivatives_are_those_of_the_value() {
    for (rings, u) in shapes() {
        let region = Region::new(&rings, u);
        for i in 0..40 {
            let angle = 0.7 * f64::from(i);
            let c = region.middle
                + region.half * (0.1 + 0.05 * f64::from(i)) * DVec2::from_angle(angle);
            let twist = [c.y, -c.x, 1.0].map(|x| if i % 2 == 0 { x } else { -x });
            let got = region.dissipation(twist);
            // Points of the area serve at a slip centre inside too, on many panels.
            let mut points = Default::default();
            for element in &region.elements {
                let whole = [[0.0, 1.0]; 2];
                region.area_panel::<true>(element, twist, c, whole, 0, &mut points);
            }
            let (edges, by_edges) = region.edges(c, true).assemble(c, twist[2]);
            let (points, by_points) = points;
            for (a, b) in by_points.iter().flatten().zip(by_edges.iter().flatten()) {
                assert!((a - b).abs() < 1e-9, "{u:?} {twist:?} {by_points:?} {by_edges:?}");
            }
            assert!(
                (points.value / edges.value - 1.0).abs() < 1e-11,
                "{u:?} {twist:?} {points:?} {edges:?}"
            );
            let euler: f64 = (0..3).map(|k| got.gradient[k] * twist[k]).sum();
            assert!((euler / got.value - 1.0).abs() < 1e-13, "{u:?} {twist:?} {got:?}");
            let step = 1e-5;
            for k in 0..3 {
                let moved = |by: f64| {
                    let mut twist = twist;
                    twist[k] += by;
                    region.dissipation(twist)
                };
                let (up, down) = (moved(step), moved(-step));
                let slope = (up.value - down.value) / (2.0 * step);
                assert!(
                    (slope - got.gradient[k]).abs() < 1e-7 * got.value,
                    "{u:?} {twist:?} {k}: {slope} {got:?}"
                );
                for j in 0..3 {
                    let bend = (up.gradient[j] - down.gradient[j]) / (2.0 * step);
                    assert!(
                        (bend - got.hessian[j][k]).abs() < 1e-5 * got.value,
                        "{u:?} {twist:?} {j}{k}: {bend} {got:?}"
                    );
                }
            }
        }
    }
}

/// As many points as a panel needs give what four times as many on 64 parts of it give.
#[test]
fn fewer_points_far_away_are_as_good() {
    for (rings, u) in shapes() {
        let region = Region::new(&rings, u);
        for i in 0..24 {
            // Nearer than that the 64 parts are too long for their distance to be the measure.
            let away = 2.0 * 1.3_f64.powi(i);
            let c = region.middle + region.half * away * DVec2::from_angle(0.7 * f64::from(i));
            let twist = [c.y, -c.x, 1.0];
            let (mut few, mut many): (Sums, Sums) = Default::default();
            for element in &region.elements {
                region.area_panel::<true>(element, twist, c, [[0.0, 1.0]; 2], 0, &mut few);
                let part = |k: u32| [f64::from(k) / 8.0, f64::from(k + 1) / 8.0];
                for (s, t) in (0..64).map(|k| (part(k / 8), part(k % 8))) {
                    region.area_sums::<true>(element, twist, [s, t], [12; 2], &mut many);
                }
            }
            let ((few, few_by), (many, many_by)) = (few, many);
            let what = format!("{u:?} {away}");
            assert!((few.value / many.value - 1.0).abs() < 2e-14, "{what} {few:?} {many:?}");
            let size = many.value / (region.half.length() * (1.0 + away));
            for k in 0..2 {
                let off = (few.gradient[k] - many.gradient[k]).abs() / size;
                assert!(off < 3e-14, "{what} {k} {off:e}");
                let bend = (few.hessian[k][k] - many.hessian[k][k]).abs();
                assert!(bend < 1e-12 * size, "{what} {k} {bend:e}");
            }
            for (a, b) in few_by.iter().flatten().zip(many_by.iter().flatten()) {
                assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{what} {a} {b}");
            }
        }
    }
}

type Sums = (Dissipation, [[f64; 3]; 3]);

/// The sphere's closed form: pressure `1 - r^2` on the unit disc, slip centre at a distance.
#[test]
fn the_sphere_agrees_with_its_closed_form() {
    let u = Quadratic { c: 1.0, g: DVec2::ZERO, l: DVec2::splat(-2.0) };
    let region = Region::new(&[rectangle(DVec2::splat(3.0))], u);
    let (area, load) = region.area_and_load();
    let half = std::f64::consts::FRAC_PI_2;
    assert!((load / half - 1.0).abs() < 1e-14 && (area / half - 2.0).abs() < 1e-7);
    for (k, wanted) in [
        (0.0, 4.0 * std::f64::consts::PI / 15.0),
        (0.3, 0.930_427_403_020_475_5),
        (0.6, 1.190_088_973_586_390_5),
        (0.95, 1.636_037_182_195_247_7),
        (1.0, 128.0 / 75.0),
    ] {
        let got = region.dissipation([0.0, -k, 1.0]).value;
        assert!((got / wanted - 1.0).abs() < 1e-14, "{k}: {got} {wanted}");
    }
}

/// The planar integrals of this library, for the special case of a plane.
#[test]
fn a_plane_agrees_with_the_planar_closed_forms() {
    use crate::contact::{Field, Loops, Twist, friction};
    use crate::model::Polygon;
    let ring = rectangle(DVec2::new(2.0, 1.5));
    let area = Loops::new(&[Polygon { outer: ring.clone(), holes: Vec::new() }]);
    let p = [1.0, 0.3, -0.2];
    let u = Quadratic { c: p[0], g: DVec2::new(p[1], p[2]), l: DVec2::ZERO };
    let region = Region::new(&[ring], u);
    for i in 0..60 {
        let c = 0.1 * f64::from(i) * DVec2::from_angle(f64::from(i));
        let twist = [c.y, -c.x, 1.0];
        let wanted = friction(Field { area: &area, p }, Twist::about(c));
        let gradient = wanted.gradient(p);
        let got = region.dissipation(twist);
        for j in 0..3 {
            assert!((got.gradient[j] - gradient[j]).abs() < 1e-13 * 12.0 * (1.0 + c.length()));
            for k in 0..3 {
                let off = (got.hessian[j][k] - wanted.hessian[j][k]).abs();
                assert!(off < 1e-12 * (1.0 + c.length_squared()) * 12.0, "{c:?} {off:e}");
            }
        }
    }
}

/// An edge of the polygon through the crest, as a pad's edge on a sphere's pole: where the edge
/// meets the conic may be its tip too.
#[test]
fn edges_through_the_crest_leave_sectors() {
    let edges = [
        (0.5, vec![[-2.0, -2.0], [2.0, -2.0], [2.0, 0.0], [-2.0, 0.0]]),
        (0.5, vec![[0.0, -2.0], [2.0, -2.0], [2.0, 2.0], [0.0, 2.0]]),
        (0.5, vec![[-2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]]),
        (0.25, vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]),
        (0.125, vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]),
        (0.625, vec![[0.0, 0.0], [0.0, 2.0], [-2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]]),
    ];
    for (share, ring) in edges {
        let ring: Ring = ring.into_iter().map(DVec2::from).collect();
        for i in 0..100 {
            let (radius, l) = (0.3 + 0.009_1 * f64::from(i), 4.0);
            let u = Quadratic { c: 0.5 * l * radius * radius, g: DVec2::ZERO, l: DVec2::splat(-l) };
            let region = Region::new(std::slice::from_ref(&ring), u);
            let (area, load) = region.area_and_load();
            let wanted = share * std::f64::consts::PI * radius * radius;
            assert!((area / wanted - 1.0).abs() < 1e-8, "{radius} {area} {wanted}");
            assert!((load / (0.25 * l * radius * radius * wanted) - 1.0).abs() < 1e-12, "{radius}");
            for j in 0..6 {
                let c = radius * (0.2 + 0.3 * f64::from(j)) * DVec2::from_angle(0.9 * f64::from(j));
                let twist = [c.y, -c.x, 1.0];
                let mut points = Default::default();
                for element in &region.elements {
                    let whole = [[0.0, 1.0]; 2];
                    region.area_panel::<true>(element, twist, c, whole, 0, &mut points);
                }
                let (edges, by) = region.edges(c, true).assemble(c, 1.0);
                assert!((edges.value / points.0.value - 1.0).abs() < 1e-11, "{radius} {c}");
                let pairs = by.iter().flatten().zip(points.1.iter().flatten());
                assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-9), "{radius} {c}");
            }
        }
    }
}

/// A corner a rounding beyond the conic's tip, from which one edge goes in and one goes out.
#[test]
fn nothing_is_pressed_beside_a_tip() {
    let corners = [(-1.9260241374843337, 5.038072728429128), (0.01, 10.020000000001)];
    for last in [(-0.4004488883540869, 19.59429873596726), (-0.4, 12.0), (-2.0, 11.0)] {
        let rings = [[corners[0], corners[1], last].map(DVec2::from).to_vec()];
        let u = Quadratic { c: 0.499948, g: DVec2::new(0.01, 2e-4), l: DVec2::new(-1.0, -0.01) };
        let (found, wanted) = (Region::new(&rings, u).area_and_load(), area_and_load(&rings, &u));
        assert!((found.1 / wanted.1 - 1.0).abs() < 1e-10, "{found:?} {wanted:?}");
        let region = Region::new(&rings, u);
        // Its boundary ends where it begins.
        let ends: DVec2 = region.elements.iter().map(|element| element.b - element.a).sum();
        assert!(ends.length() < 1e-12, "{ends} {:?}", region.elements);
    }
}

/// Polygons with corners where something happens: on the conic, at its crest and tips, on tangents at
/// its tips, and a rounding beside these.
fn cornered() -> impl Strategy<Value = (Ring, Quadratic)> {
    let corner = (0..12_u32, 0.0..TAU, 0..6_u32);
    let bends = prop_oneof![
        Just((1.0, 1.0)),
        Just((0.3, 1.0)),
        Just((1.0, 0.01)),
        Just((0.0, 1.0)),
        Just((-0.3, 1.0)),
        Just((0.0, 0.0)),
    ];
    (vec(corner, 3..7), bends, prop_oneof![Just(DVec2::ZERO), Just(DVec2::new(0.01, 0.02))])
        .prop_map(|(corners, (l1, l2), at)| {
            let half = [l1, l2].map(|l: f64| if l == 0.0 { 1.0 } else { l.abs().sqrt().recip() });
            let half = DVec2::from(half);
            let place = |&(kind, angle, off): &(u32, f64, u32)| {
                let unit = match kind {
                    0 => DVec2::ZERO,
                    1 => DVec2::X,
                    2 => DVec2::Y,
                    3 => -DVec2::X,
                    4 => -DVec2::Y,
                    5 => DVec2::ONE,
                    6 => -DVec2::ONE,
                    7 => DVec2::new(1.0, -1.0),
                    8 => DVec2::new(-1.0, 1.0),
                    9 => DVec2::from_angle(angle),
                    10 => 2.0 * DVec2::from_angle(angle),
                    _ => DVec2::from_angle(angle) * 0.5,
                };
                let off = match off {
                    0 => DVec2::new(1e-16, -1e-16),
                    1 => DVec2::new(0.0, 1e-12),
                    _ => DVec2::ZERO,
                };
                at + unit * half + off
            };
            let mut ring: Ring = corners.iter().map(place).collect();
            let middle = ring.iter().sum::<DVec2>() / ring.len() as f64;
            ring.sort_by(|a, b| (a - middle).to_angle().total_cmp(&(b - middle).to_angle()));
            let l = -DVec2::new(l1, l2);
            let g = if l == DVec2::ZERO { DVec2::new(0.5, 0.0) } else { -l * at };
            (ring, Quadratic { c: 0.5 + 0.5 * l.dot(at * at), g, l })
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn both_ways_agree_at_corners(
        (ring, u) in cornered(),
        centres in vec((-2.0..2.0_f64, -2.0..2.0_f64), 4),
    ) {
        let rings = [ring];
        let region = Region::new(&rings, u);
        let (area, load) = region.area_and_load();
        prop_assume!(area > 1e-3);
        let wanted = area_and_load(&rings, &u);
        prop_assert!((load / wanted.1 - 1.0).abs() < 1e-9, "{load} {wanted:?}");
        for centre in centres {
            let c = DVec2::from(centre);
            let twist = [c.y, -c.x, 1.0];
            let mut points = Default::default();
            for element in &region.elements {
                region.area_panel::<true>(element, twist, c, [[0.0, 1.0]; 2], 0, &mut points);
            }
            let (edges, by) = region.edges(c, true).assemble(c, 1.0);
            let off = (edges.value / points.0.value - 1.0).abs();
            prop_assert!(off < 1e-9, "{c} {edges:?} {points:?}");
            let pairs = by.iter().flatten().zip(points.1.iter().flatten());
            prop_assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-7), "{c} {by:?} {points:?}");
        }
    }
}

/// On a grid of points, and where an area under pressure has it.
#[test]
fn the_greatest_value_is_that_of_points() {
    let ring = |shift: DVec2, size: f64| -> Ring {
        let step = std::f64::consts::TAU / 7.0;
        let corner = |k: u32| {
            shift + size * (1.0 + 0.3 * f64::from(k % 3)) * DVec2::from_angle(step * f64::from(k))
        };
        (0..7).map(corner).collect()
    };
    for k in 0..60_u32 {
        let part = |n: u32| (f64::from(k * n + n) * 0.618_034).fract() - 0.5;
        let outer = ring(DVec2::new(part(1), part(2)), 1.0);
        let mut hole = ring(DVec2::new(part(1), part(2)), 0.4);
        hole.reverse();
        let rings = if k % 2 == 0 { vec![outer] } else { vec![outer, hole] };
        let bends =
            [DVec2::new(-1.0, -2.0), DVec2::new(0.0, -1.0), DVec2::ZERO, DVec2::new(0.5, -1.0)];
        let g = 2.0 * DVec2::new(part(3), part(5));
        let u = Quadratic { c: 0.4, g, l: bends[k as usize % 4] };
        let found = u.greatest(&rings);
        let mut most = f64::NEG_INFINITY;
        for i in -500..=500 {
            for j in -500..=500 {
                let x = 0.004 * DVec2::new(f64::from(i), f64::from(j));
                if u.value(x) > most
                    && rings.iter().filter(|ring| ring_contains(ring, x)).count() == 1
                {
                    most = u.value(x);
                }
            }
        }
        assert!((-1e-12..0.03).contains(&(found - most)), "{k}: {found} {most}");
        let region = Region::new(&rings, u).greatest();
        assert!((found.max(0.0) - region).abs() < 1e-8, "{k}: {found} {region}");
    }
}

/// Points of a part of an element, by parts that are small beside their distance from the centre.
fn many(
    region: &Region,
    element: &Element,
    twist: [f64; 3],
    centre: DVec2,
    [s, t]: [[f64; 2]; 2],
    sum: &mut Sums,
) {
    let place = |s: f64, t: f64| {
        let (x, dx) = region.at(element, s);
        region.foot(x, dx).0.lerp(x, t)
    };
    let middle = |r: [f64; 2]| 0.5 * (r[0] + r[1]);
    let distance = (place(middle(s), middle(t)) - centre).length();
    let along = place(s[0], t[1]).distance(place(s[1], t[1]));
    let across = place(middle(s), t[0]).distance(place(middle(s), t[1]));
    if along.max(across) < 0.2 * distance {
        return region.area_sums::<true>(element, twist, [s, t], [12; 2], sum);
    }
    let halves = |r: [f64; 2]| [[r[0], middle(r)], [middle(r), r[1]]];
    for part in halves(if along > across { s } else { t }) {
        let range = if along > across { [part, t] } else { [s, part] };
        many(region, element, twist, centre, range, sum);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// What a facet's triangles give is what the strips along its sides give, each by many points:
    /// facets in any shape, slivers among them, whole or cut where the pressure ends.
    #[test]
    fn triangles_of_a_facet_are_its_strips(
        corners in vec(0.0..TAU, 3..8),
        narrow in 0.0..2.5_f64,
        (angle, slope, c) in (0.0..TAU, 0.0..2.0_f64, 0.0..1.5_f64),
        (away, towards) in (0.0..8.0_f64, 0.0..TAU),
    ) {
        let mut corners = corners;
        corners.sort_by(f64::total_cmp);
        let thin = DVec2::new(1.0, 10.0_f64.powf(-narrow));
        let ring: Ring = corners.iter().map(|&x| thin * DVec2::from_angle(x)).collect();
        let u = Quadratic { c, g: slope * DVec2::from_angle(angle) / thin, l: DVec2::ZERO };
        let region = Region::new(std::slice::from_ref(&ring), u);
        let (area, load) = region.area_and_load();
        prop_assume!(area > 1e-3 * thin.y && load > 1e-3 * thin.y);
        // From as near as triangles are taken for on.
        let c = region.middle
            + region.half.length() / FAR * away.exp2() * DVec2::from_angle(towards);
        for sign in [1.0, -1.0] {
            let twist = [c.y, -c.x, 1.0].map(|x| sign * x);
            let (mut got, mut wanted): (Sums, Sums) = Default::default();
            region.triangles::<true>(twist, c, &mut got);
            for element in &region.elements {
                many(&region, element, twist, c, [[0.0, 1.0]; 2], &mut wanted);
            }
            let mut values = Sums::default();
            region.triangles::<false>(twist, c, &mut values);
            prop_assert_eq!(values.0, got.0);
            let speed = wanted.0.value / load;
            // Slivers are small differences of strips in their box.
            let rounding = f64::EPSILON * 4.0 * region.half.element_product() / area;
            let within = 4e-14 + 8.0 * rounding;
            let near = |a: f64, b: f64, size: f64| (a - b).abs() <= within * size;
            let (found, other) = (got.0, wanted.0);
            prop_assert!(near(found.value, other.value, other.value), "{found:?} {other:?}");
            let far = 1.0 + region.middle.length() + region.half.length();
            // Of two degrees more in the place, by points that are enough for the value.
            let near_second = |a: f64, b: f64, size: f64| (a - b).abs() <= (1e-10 + within) * size;
            for i in 0..3 {
                prop_assert!(near(found.gradient[i], other.gradient[i], far * load), "{i} {} {} {}", found.gradient[i], other.gradient[i], far * load);
                for j in 0..3 {
                    let size = far * far * load / speed;
                    prop_assert!(near_second(found.hessian[i][j], other.hessian[i][j], size), "{i} {j} {} {} {size}", found.hessian[i][j], other.hessian[i][j]);
                    let size = far * far * area;
                    prop_assert!(near_second(got.1[i][j], wanted.1[i][j], size), "by {i} {j} {} {} {size}", got.1[i][j], wanted.1[i][j]);
                }
            }
        }
    }
}

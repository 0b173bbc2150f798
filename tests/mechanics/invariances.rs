//! What must not change the answer, or change it in a known way: units, axes, origin, the names of
//! the faces.

use glam::{DVec2, DVec3};
use gripfast::mechanics::{Options, solve};
use gripfast::model::{Contact, Patch, Polygon, Score, Slip, Status, Wrench};
use proptest::prelude::*;

#[derive(Debug, Clone)]
struct Case {
    contact: Contact,
    distance: f64,
    force: f64,
    wrench: Wrench,
}

fn answer(case: &Case) -> Score {
    solve(&case.contact, case.distance, case.force, &case.wrench, &Options::default()).unwrap()
}

/// A star-shaped polygon about a point, with any corners between convex and deeply notched.
fn patch(radii: &[f64], turn: f64, centre: DVec2) -> Patch {
    let corner = |(i, r): (usize, &f64)| {
        centre
            + *r * DVec2::from_angle(turn + std::f64::consts::TAU * i as f64 / radii.len() as f64)
    };
    vec![Polygon { outer: radii.iter().enumerate().map(corner).collect(), holes: Vec::new() }]
}

fn cases() -> impl Strategy<Value = Case> {
    let radii = || proptest::collection::vec(0.4..1.2f64, 3..9);
    let small = || -0.25..0.25f64;
    let wrench = [small(), small(), small(), small(), small(), small()];
    (radii(), radii(), 0.0..6.0f64, small(), small(), -0.8..1.2f64, wrench).prop_map(
        |(one, two, turn, x, y, distance, w)| Case {
            contact: Contact {
                face_i: patch(&one, turn, DVec2::ZERO),
                face_ii: patch(&two, -turn, DVec2::new(x, y)),
            },
            distance,
            force: 1.0,
            wrench: Wrench {
                force: DVec3::new(w[0], w[1], w[2]),
                moment: DVec3::new(w[3], w[4], w[5]),
            },
        },
    )
}

fn mapped(
    case: &Case,
    point: impl Fn(DVec2) -> DVec2,
    vector: impl Fn(DVec3) -> DVec3,
    pseudo: impl Fn(DVec3) -> DVec3,
) -> Case {
    let map = |patch: &Patch| {
        patch
            .iter()
            .map(|polygon| Polygon {
                outer: polygon.outer.iter().map(|&x| point(x)).collect(),
                holes: Vec::new(),
            })
            .collect()
    };
    Case {
        contact: Contact { face_i: map(&case.contact.face_i), face_ii: map(&case.contact.face_ii) },
        wrench: Wrench { force: vector(case.wrench.force), moment: pseudo(case.wrench.moment) },
        ..*case
    }
}

/// Both answers are the same kind, and `mu_s` agrees; only clear answers are compared beyond their
/// status.
fn agree(a: &Score, b: &Score) -> Result<(), TestCaseError> {
    prop_assert_eq!(a.status, b.status);
    if let (Status::Ok, Some(x), Some(y)) = (a.status, a.mu_s, b.mu_s) {
        prop_assert!((x - y).abs() <= 1e-9 * x.max(y), "{} {}", x, y);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn units_of_length_and_force(case in cases(), length in -5..6i32, force in -5..6i32) {
        let (l, f) = (10f64.powi(length), 10f64.powi(force));
        let mut scaled = mapped(&case, |x| x * l, |v| v * f, |m| m * (f * l));
        scaled.distance *= l;
        scaled.force *= f;
        agree(&answer(&case), &answer(&scaled))?;
    }

    #[test]
    fn axes_of_the_pad_plane(case in cases(), angle in 0.0..6.3f64) {
        let e = DVec2::from_angle(angle);
        let turn = |v: DVec3| e.rotate(v.truncate()).extend(v.z);
        let turned = mapped(&case, |x| e.rotate(x), turn, turn);
        let (a, b) = (answer(&case), answer(&turned));
        agree(&a, &b)?;
        if let (Status::Ok, Some(Slip::Rotation { c, .. }), Some(Slip::Rotation { c: d, .. })) = (a.status, a.slip, b.slip) {
            let c = e.rotate(DVec2::from_array(c));
            prop_assert!(c.distance(DVec2::from_array(d)) <= 1e-6 * (1.0 + c.length_squared()), "{:?} {:?}", c, d);
        }
    }

    #[test]
    fn a_mirror_turns_the_sense(case in cases()) {
        let point = |x: DVec2| DVec2::new(-x.x, x.y);
        let mirrored = mapped(&case, point, |v| DVec3::new(-v.x, v.y, v.z), |m| DVec3::new(m.x, -m.y, -m.z));
        let (a, b) = (answer(&case), answer(&mirrored));
        agree(&a, &b)?;
        if let (Status::Ok, Some(Slip::Rotation { sense, .. }), Some(Slip::Rotation { sense: other, .. })) = (a.status, a.slip, b.slip) {
            prop_assert_eq!(sense, -other);
        }
    }

    #[test]
    fn from_inside_with_the_in_plane_load_reversed(case in cases()) {
        // Friction reverses with the load, and so does its lever with `d`: the pressure knows no
        // difference.
        let mut inside = case.clone();
        inside.distance = -case.distance;
        inside.wrench.force = case.wrench.force * DVec3::new(-1.0, -1.0, 1.0);
        inside.wrench.moment.z = -case.wrench.moment.z;
        let (a, b) = (answer(&case), answer(&inside));
        agree(&a, &b)?;
        if let (Status::Ok, Some(Slip::Rotation { c, sense }), Some(Slip::Rotation { c: d, sense: other })) = (a.status, a.slip, b.slip) {
            let (c, d) = (DVec2::from_array(c), DVec2::from_array(d));
            prop_assert!(sense == -other && c.distance(d) <= 1e-6 * (1.0 + c.length_squared()), "{:?} {:?}", c, d);
            let (p, q) = (a.pressure.unwrap(), b.pressure.unwrap());
            let scale = p.a_i0.abs().max(p.a_ii0.abs());
            for (x, y) in [(p.a_i0, q.a_i0), (p.a_ii0, q.a_ii0), (p.a1, q.a1), (p.a2, q.a2)] {
                prop_assert!((x - y).abs() <= 1e-7 * scale, "{:?} {:?}", p, q);
            }
        }
    }

    #[test]
    fn the_names_of_the_faces(case in cases()) {
        // Half a turn about x1 exchanges the faces.
        let turn = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
        let mut turned = mapped(&case, |x| DVec2::new(x.x, -x.y), turn, turn);
        std::mem::swap(&mut turned.contact.face_i, &mut turned.contact.face_ii);
        agree(&answer(&case), &answer(&turned))?;
    }

    #[test]
    fn the_origin_in_the_pad_plane(case in cases(), x in -5.0..5.0f64, y in -5.0..5.0f64) {
        let shift = DVec3::new(x, y, 0.0);
        let mut moved = mapped(&case, |p| p + shift.truncate(), |v| v, |m| m);
        moved.wrench.moment += shift.cross(case.wrench.force);
        agree(&answer(&case), &answer(&moved))?;
    }

    #[test]
    fn congruent_faces_in_full_contact_know_neither_distance_nor_tilting_moments(case in cases(), m1 in -0.05..0.05f64, m2 in -0.05..0.05f64) {
        let mut plain = case.clone();
        plain.contact.face_ii = plain.contact.face_i.clone();
        plain.distance = 0.0;
        plain.wrench.force.z = 0.0;
        plain.wrench.moment = DVec3::new(0.0, 0.0, case.wrench.moment.z);
        let mut other = plain.clone();
        other.distance = 0.3 * case.distance;
        other.wrench.moment += DVec3::new(m1, m2, 0.0);
        let (a, b) = (answer(&plain), answer(&other));
        let whole = |score: &Score| score.contact_area_i.min(score.contact_area_ii);
        if a.status == Status::Ok && b.status == Status::Ok && (whole(&a) - whole(&b)).abs() < 1e-12 {
            let (x, y) = (a.mu_s.unwrap(), b.mu_s.unwrap());
            prop_assert!((x - y).abs() <= 1e-11 * x, "{} {}", x, y);
        }
    }
}

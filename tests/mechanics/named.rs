//! Whole solves in named corners: several limit states, slip centres in awkward places and far
//! away, contacts that shrink to nothing, grips from inside.

use crate::brute::cases::Case;
use crate::brute::{Problem, check};
use glam::{DVec2, DVec3};
use gripfast::contact::{Field, Loops, friction, moments};
use gripfast::mechanics::inverse::load_multiple;
use gripfast::mechanics::{Options, Pads, limit_states, solve, solve_pads};
use gripfast::model::{Contact, Patch, Polygon, Slip, Status, Wrench};

fn ring(points: &[(f64, f64)]) -> Vec<DVec2> {
    points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
}

fn plain(points: &[(f64, f64)]) -> Patch {
    vec![Polygon { outer: ring(points), holes: vec![] }]
}

fn rectangle(a: f64, b: f64) -> Patch {
    plain(&[(-a / 2.0, -b / 2.0), (a / 2.0, -b / 2.0), (a / 2.0, b / 2.0), (-a / 2.0, b / 2.0)])
}

/// A polygon with a notch and a hole.
fn notched() -> Patch {
    let outer = ring(&[
        (-0.7, -0.5),
        (0.6, -0.6),
        (0.7, 0.5),
        (0.2, 0.5),
        (0.1, -0.1),
        (-0.2, 0.1),
        (-0.3, 0.6),
        (-0.8, 0.4),
    ]);
    vec![Polygon { outer, holes: vec![ring(&[(-0.5, -0.3), (-0.2, -0.35), (-0.3, -0.1)])] }]
}

#[test]
fn three_limit_states_of_one_load() {
    let case = Case {
        contact: Contact {
            face_i: plain(&[(-0.08, -0.08), (0.92, -0.08), (0.92, 0.92), (-0.08, 0.92)]),
            face_ii: plain(&[(0.06, 0.07), (-1.0, 0.09), (-1.0, -0.35), (0.06, -0.37)]),
        },
        distance: 4.13,
        force: 1.0,
        wrench: Wrench {
            force: DVec3::new(-0.266, 0.026, 0.5),
            moment: DVec3::new(-0.747, -1.813, 0.561),
        },
    };
    let all =
        limit_states(&case.contact, case.distance, case.force, &case.wrench, &Options::default())
            .unwrap();
    let wanted = [
        (0.447141363587, [0.0666350155, -0.0289002340]),
        (0.499955631496, [0.0305310547, -0.0062404627]),
    ];
    assert_eq!(all.len(), 3, "{all:?}");
    for (state, (mu, centre)) in all.iter().zip(wanted) {
        let Some(Slip::Rotation { c, .. }) = state.slip else { panic!("{state:?}") };
        assert!((state.mu_s.unwrap() - mu).abs() < 1e-11, "{state:?}");
        assert!((c[0] - centre[0]).hypot(c[1] - centre[1]) < 1e-9, "{state:?}");
    }
    assert!((all[2].mu_s.unwrap() - 2.972487955196).abs() < 1e-11, "{:?}", all[2]);
    for state in &all {
        assert_eq!(state.status, Status::Ambiguous);
        let check = check(&case, state).unwrap();
        assert!(check.residual < 1e-10, "{check:?}");
    }
    // Without friction's help the contact twists out, so no branch starts at d = 0 and the least
    // friction is the answer.
    assert!(Problem::new(&case).unwrap().branch(10).is_none());
    let answer =
        solve(&case.contact, case.distance, case.force, &case.wrench, &Options::default()).unwrap();
    assert_eq!((answer.status, answer.mu_s), (Status::Ambiguous, all[0].mu_s));
}

/// The load that is at its limit under these pressure planes and this slip: (3)-(9) read the other
/// way round.
fn posed(patch: &Patch, distance: f64, p: [[f64; 3]; 2], twist: [f64; 3], mu: f64) -> Case {
    let area = Loops::new(patch);
    let m = moments(&area);
    let taken = p.map(|p| friction(Field { area: &area, p }, twist.into()).gradient(p));
    let normal = p.map(|p| p[0] * m[0] + p[1] * m[1] + p[2] * m[2]);
    let first = |p: [f64; 3]| {
        DVec2::new(p[0] * m[1] + p[1] * m[3] + p[2] * m[4], p[0] * m[2] + p[1] * m[4] + p[2] * m[5])
    };
    let x = first(p[0]) - first(p[1]);
    let sum: [f64; 3] = std::array::from_fn(|i| mu * (taken[0][i] + taken[1][i]));
    let lever: [f64; 2] =
        std::array::from_fn(|i| mu * distance / 2.0 * (taken[0][i] - taken[1][i]));
    Case {
        contact: Contact { face_i: patch.clone(), face_ii: patch.clone() },
        distance,
        force: (normal[0] + normal[1]) / 2.0,
        wrench: Wrench {
            force: DVec3::new(sum[0], sum[1], normal[0] - normal[1]),
            moment: DVec3::new(x.y - lever[1], lever[0] - x.x, sum[2]),
        },
    }
}

#[test]
fn slip_centres_in_every_awkward_place() {
    let p = [[1.3, 0.4, -0.7], [0.9, -0.4, 0.7]];
    for (name, x, y) in [
        ("inside", 0.05, -0.3),
        ("in the hole", -0.3, -0.25),
        ("on a vertex", -0.7, -0.5),
        ("1e-9 off a vertex", -0.7 + 1e-9, -0.5),
        ("on the re-entrant vertex", 0.1, -0.1),
        ("on a vertex of the hole", -0.2, -0.35),
        ("on an edge", -0.05, -0.55),
        ("1e-9 inside an edge", -0.05, -0.55 + 1e-9),
        ("1e-9 outside an edge", -0.05, -0.55 - 1e-9),
        ("on an edge's line", 1.25, -0.65),
        ("in the notch", 0.0, 0.45),
        ("outside", -1.9, 1.1),
        ("at ten sizes", -8.0, 6.0),
        ("at a thousand sizes", 600.0, -800.0),
        ("at 1e12 sizes", 8e11, 6e11),
    ] {
        for (sense, distance) in [(1.0, 0.3), (-1.0, -0.3)] {
            let case = posed(&notched(), distance, p, [sense * y, -sense * x, sense], 0.4);
            let score =
                solve(&case.contact, case.distance, case.force, &case.wrench, &Options::default())
                    .unwrap();
            assert_eq!(score.status, Status::Ok, "{name}: {score:?}");
            assert!((score.mu_s.unwrap() - 0.4).abs() < 4e-12, "{name}: {score:?}");
            let check = check(&case, &score).unwrap();
            assert!(check.residual < 1e-11, "{name}: {check:?}");
            let reach = x.hypot(y);
            match score.slip.unwrap() {
                // The moment's rounding alone moves a far centre by 1e-16 of its distance squared.
                Slip::Rotation { c, sense: got } => {
                    let error = (c[0] - x).hypot(c[1] - y);
                    assert!(
                        f64::from(got) == sense && error < 1e-11 + 1e-14 * reach * reach,
                        "{name}: {c:?} {error:e}"
                    );
                }
                Slip::Translation { direction } => {
                    assert!(
                        reach > 1e11
                            && (direction[0] - sense * y / reach)
                                .hypot(direction[1] + sense * x / reach)
                                < 1e-11,
                        "{name}: {direction:?}"
                    );
                }
                Slip::Spin { .. } | Slip::None => panic!("{name}"),
            }
            let q = score.pressure.unwrap();
            for (got, want) in [(q.a_i0, 1.3), (q.a_ii0, 0.9), (q.a1, 0.4), (q.a2, -0.7)] {
                assert!((got - want).abs() < 1e-9, "{name}: {q:?}");
            }
        }
    }
}

#[test]
fn contact_shrinks_to_an_edge() {
    // Two squares of side b under M1 alone beyond the kern: 3 (b/2 - M1/(2 Fn)) of the width is
    // left (section 3.6), and under M3 the two edges hold mu_s 2 Fn rbar with the mean distance of
    // an edge from the middle.
    let square = Contact { face_i: rectangle(1.0, 1.0), face_ii: rectangle(1.0, 1.0) };
    // int over the unit edge of sqrt(s^2 + 1/4)
    let radius = (2f64.sqrt() + 1f64.asinh()) / 4.0;
    for share in [0.3, 1e-2, 1e-4, 1e-5, 1e-6] {
        let m1 = 1.0 - 2.0 * share / 3.0;
        for distance in [0.0, 0.2, -0.2] {
            let wrench = Wrench { force: DVec3::ZERO, moment: DVec3::new(m1, 0.0, 0.1) };
            let case = Case { contact: square.clone(), distance, force: 1.0, wrench };
            let score = solve(&square, distance, 1.0, &wrench, &Options::default()).unwrap();
            assert_eq!(score.status, Status::Ok, "{share} {distance}: {score:?}");
            let check = check(&case, &score).unwrap();
            assert!(check.residual < 1e-10 + check.rounding, "{share} {distance}: {check:?}");
            let mu = score.mu_s.unwrap();
            if distance == 0.0 {
                // The moment comes within share/3 of its limit as the difference of numbers that
                // are 1/share times as large as the pressure.
                assert!(
                    (score.contact_area_i / share - 1.0).abs() < 1e-9 + 2e-15 / (share * share),
                    "{share}: {score:?}"
                );
                assert!(
                    (mu - 0.05 / radius).abs() < 0.2 * share + 1e-9,
                    "{share}: {mu} {}",
                    0.05 / radius
                );
            }
            let bounds = score.bounds.unwrap();
            let slack = 1e-9 + check.rounding / mu;
            assert!(
                bounds.lower <= mu * (1.0 + slack) && mu <= bounds.upper * (1.0 + slack),
                "{share} {distance}: {score:?}"
            );
        }
    }
    // A contact too small for doubles is never called none.
    for share in [1e-7, 1e-8, 1e-10] {
        let wrench =
            Wrench { force: DVec3::ZERO, moment: DVec3::new(1.0 - 2.0 * share / 3.0, 0.0, 0.1) };
        let status = solve(&square, 0.0, 1.0, &wrench, &Options::default()).unwrap().status;
        assert!(matches!(status, Status::Ok | Status::NotConverged), "{share}: {status:?}");
    }
    // At the limit and beyond it nothing is left, and without coupling nothing else holds.
    for m1 in [1.0, 1.0 + 1e-12, 1.5] {
        let wrench = Wrench { force: DVec3::ZERO, moment: DVec3::new(m1, 0.0, 0.1) };
        assert_eq!(
            solve(&square, 0.0, 1.0, &wrench, &Options::default()).unwrap().status,
            Status::TwistedOut,
            "{m1}"
        );
    }
}

#[test]
fn contact_shrinks_to_a_corner() {
    let square = Contact { face_i: rectangle(1.0, 1.0), face_ii: rectangle(1.0, 1.0) };
    for left in [1e-1, 1e-2, 1e-3, 1e-4] {
        // Towards both edges at once: a triangle at the corner, its centre of pressure a quarter of
        // its legs away.
        let m = 1.0 - 0.5 * left;
        let wrench = Wrench { force: DVec3::ZERO, moment: DVec3::new(m, -m, 0.05) };
        let case = Case { contact: square.clone(), distance: 0.0, force: 1.0, wrench };
        let score = solve(&square, 0.0, 1.0, &wrench, &Options::default()).unwrap();
        assert_eq!(score.status, Status::Ok, "{left}: {score:?}");
        // As for an edge: what is left of the moment's arm is the difference of numbers 1/left
        // times as large.
        assert!(
            (score.contact_area_i / (left * left / 2.0) - 1.0).abs() < 1e-9 + 4e-15 / (left * left),
            "{left}: {score:?}"
        );
        let check = check(&case, &score).unwrap();
        assert!(check.residual < 1e-10 + check.rounding, "{left}: {check:?}");
        // Two points at opposite corners, each with Fn at half the diagonal.
        assert!(
            (score.mu_s.unwrap() - 0.05 / 2f64.sqrt()).abs() < 0.05 * left,
            "{left}: {score:?}"
        );
    }
}

#[test]
fn a_slot_gripped_from_inside_tilts_the_other_way() {
    // F1 at the middle of equal squares: friction takes half of it on each face and no tilt
    // follows. With M3 and F3 the faces differ, and the tilt that friction's lever makes turns over
    // with the sign of d.
    let square = Contact { face_i: rectangle(1.0, 1.0), face_ii: rectangle(1.0, 1.0) };
    let wrench = Wrench { force: DVec3::new(0.2, 0.0, 0.4), moment: DVec3::ZERO };
    let tilt = |d: f64| {
        let score = solve(&square, d, 1.0, &wrench, &Options::default()).unwrap();
        assert_eq!(score.status, Status::Ok);
        (score.mu_s.unwrap(), score.pressure.unwrap().a1)
    };
    let (outside, inside) = (tilt(0.5), tilt(-0.5));
    assert!(
        (outside.0 - 0.1).abs() < 1e-12 && (inside.0 - 0.1).abs() < 1e-12,
        "{outside:?} {inside:?}"
    );
    // (7): int_I p x1 - int_II p x1 = a1/6 = (d/2) mu (N_I - N_II) = 0.25 * 0.1 * 0.4
    assert!(
        (outside.1 - 0.06).abs() < 1e-12 && (inside.1 + 0.06).abs() < 1e-12,
        "{outside:?} {inside:?}"
    );
}

#[test]
fn numbers_that_are_none_are_refused_by_name() {
    let square = Contact { face_i: rectangle(1.0, 1.0), face_ii: rectangle(1.0, 1.0) };
    let load = Wrench { force: DVec3::X, moment: DVec3::ZERO };
    for (distance, force, name) in
        [(f64::NAN, 1.0, "d"), (f64::INFINITY, 1.0, "d"), (1.0, 0.0, "Fn"), (1.0, f64::NAN, "Fn")]
    {
        let error =
            solve(&square, distance, force, &load, &Options::default()).unwrap_err().to_string();
        assert!(error.starts_with(name), "{error}");
    }
    let (one, none) = (DVec3::X, DVec3::new(0.0, f64::NAN, 0.0));
    for (force, moment) in [(none, one), (one, none), (DVec3::splat(f64::INFINITY), one)] {
        let load = Wrench { force, moment };
        let error = solve(&square, 1.0, 1.0, &load, &Options::default()).unwrap_err().to_string();
        assert!(error.starts_with("F, M"), "{error}");
    }
}

#[test]
fn the_limit_is_found_where_the_branch_cannot_be_followed() {
    // Faces far apart: the pads part before the load slips, the branch stops, and the load is held
    // on. Every smaller load is held, and one just above is not.
    let face_ii =
        plain(&[(-0.01495, -0.0187), (0.00925, -0.0187), (0.00925, 0.0187), (-0.01495, 0.0187)]);
    let pads = Pads::new(&Contact { face_i: rectangle(0.02, 0.012), face_ii }).unwrap();
    let load = Wrench {
        force: DVec3::new(-0.641, 0.416, 0.397),
        moment: DVec3::new(-0.0453, -0.0191, 0.00367),
    };
    let (distance, friction, options) = (0.307, 0.922, Options::default());
    let limit = load_multiple(&pads, distance, 1.0, &load, friction, &options);
    let held = |multiple: f64| {
        let score = solve_pads(&pads, distance, 1.0 / multiple, &load, &options);
        score.status.holds() && score.mu_s.is_some_and(|mu| mu <= friction)
    };
    for part in 1..=40 {
        assert!(held(limit * (1.0 - 1e-8) * f64::from(part) / 40.0), "{part}/40 of {limit}");
    }
    assert!(!held(limit * (1.0 + 2e-4)), "{limit}");
}

//! Contacts that are curved, drafted or stepped: reference cases, closed forms, invariances, and a
//! check on points of the surface that shares nothing with the solver.

use glam::{DVec2, DVec3};
use gripfast::case::{self, Case};
use gripfast::contact::surface::{Gap, Piece, Surfaces};
use gripfast::mechanics::curved::{Answer, Note, Pads, force_needed, solve};
use gripfast::mechanics::{self, Options};
use gripfast::model::{Contact, Face, Slip, Status, Wrench};
use serde_json::{Value, json};

use crate::curved_points::posed;
use crate::support::random::Random;

pub(crate) fn answer(value: &Value) -> Answer {
    let Case { surfaces, distance, force, wrench, .. } =
        case::parse("a case", value.clone()).unwrap();
    solve(&surfaces.unwrap(), distance, force, &wrench).unwrap()
}

/// A cylinder of the radius and length across pads this stiff.
fn cylinder(r: f64, l: f64, k: f64, force: [f64; 3], moment: [f64; 3]) -> Value {
    json!({"kind": "cylinder", "R": r, "L": l, "d": 2.0 * r, "k": [k, k], "Fn": 50.0,
           "F": force, "M": moment})
}

fn mu(value: &Value) -> f64 {
    let answer = answer(value);
    assert_eq!(answer.score.status, Status::Ok, "{value} {answer:?}");
    let bounds = answer.score.bounds.unwrap();
    let mu = answer.score.mu_s.unwrap();
    assert!(bounds.lower <= mu * (1.0 + 1e-13) && mu <= bounds.upper * (1.0 + 1e-13));
    assert!(bounds.upper <= bounds.lower * (1.0 + 1e-9) + 1e-300, "{value} {bounds:?}");
    mu
}

fn close(got: f64, wanted: f64, tolerance: f64, what: &dyn std::fmt::Debug) {
    assert!((got / wanted - 1.0).abs() < tolerance, "{what:?}: {got} wanted {wanted}");
}

pub(crate) fn rectangle(low: [f64; 2], high: [f64; 2], gap: Gap) -> Piece {
    let outer = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
        .map(DVec2::from)
        .to_vec();
    Piece { outer, holes: Vec::new(), gap }
}

/// Status, `mu_s`, slip where it is the only one, the face at rest, compression, tilt, half widths,
/// areas and the load on each face of all reference cases.
#[test]
fn all_reference_cases_of_curved_faces() {
    let Some(file) = crate::support::reference("cases/curved.json") else { return };
    let all: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    let cases = all["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 30);
    for case in cases {
        let id = case["id"].as_str().unwrap();
        let expected = &case["expected"];
        let got = answer(case);
        assert_eq!(got.score.status, Status::Ok, "{id} {got:?}");
        assert!(got.score.residual < 1e-11, "{id} {got:?}");
        let accuracy = expected["mu_s_accuracy"].as_f64().unwrap().max(1e-12);
        close(got.score.mu_s.unwrap(), expected["mu_s"].as_f64().unwrap(), accuracy, &id);
        let rolls_on = match got.score.slip.unwrap() {
            Slip::Spin { rolls_on, .. } => rolls_on,
            _ => None,
        };
        let at_rest = match expected["face_at_rest"].as_str() {
            Some("I") => Some(Face::I),
            Some("II") => Some(Face::II),
            _ => None,
        };
        assert_eq!(rolls_on, at_rest, "{id}");
        if expected["slip_unique"] == true {
            let motion = got.motion.unwrap();
            let names = ["u1", "u2", "omega3", "omega1", "omega2"];
            for (value, name) in motion.iter().zip(names) {
                let wanted = expected["slip"][name].as_f64().unwrap_or(0.0);
                assert!((value - wanted).abs() < 1e-8, "{id} {name}: {motion:?}");
            }
        }
        let tilt = got.tilt.unwrap();
        for (value, name) in tilt.iter().zip(["a1", "a2"]) {
            let wanted = expected["tilt"][name].as_f64().unwrap_or(0.0);
            assert!((value - wanted).abs() < 1e-10, "{id} {name}: {tilt:?}");
        }
        let areas = [got.score.contact_area_i, got.score.contact_area_ii];
        for (k, face) in got.faces.unwrap().iter().enumerate() {
            let give = expected["delta"][k].as_f64().unwrap();
            assert!((face.delta - give).abs() < 1e-9 * face.greatest_pressure / 1e9, "{id}");
            close(areas[k], expected["contact_area"][k].as_f64().unwrap(), 1e-8, &id);
            let share = &expected["load_on_face"][["I", "II"][k]];
            if expected["slip_unique"] == true || at_rest.is_some() {
                for i in 0..3 {
                    let off = (face.share[i] - share[i].as_f64().unwrap()).abs();
                    // As good as the slip, which is known to the root of the accuracy of mu_s.
                    assert!(off < 1e-8 + 1e2 * accuracy, "{id} share {i} {:?} {share}", face.share);
                }
            }
            let widths = expected["contact"][k]["half_width"].as_array().unwrap();
            let widest = widths.iter().map(|w| w.as_f64().unwrap()).fold(0.0, f64::max);
            let half = 0.5 * (face.extent[1][1] - face.extent[0][1]);
            // A flat that has parted presses on one side only: its width is that of a half.
            if case["kind"] != "dbar" {
                assert!((half / widest - 1.0).abs() < 1e-7, "{id} {half} {widest}");
            }
        }
    }
}

#[test]
fn closed_forms_of_a_cylinder_without_turning() {
    let (r, n) = (0.01, 50.0);
    for (l, k) in [(0.04, 6e9), (0.015, 1e9), (0.1, 1e12)] {
        let of = |force, moment| mu(&cylinder(r, l, k, force, moment));
        close(of([0.0; 3], [0.3, 0.0, 0.0]), 0.3 / (2.0 * n * r), 1e-12, &"M1");
        close(of([7.0, -11.0, 0.0], [0.0; 3]), 7f64.hypot(11.0) / (2.0 * n), 1e-12, &"F");
        close(of([12.0, 0.0, 0.0], [0.2, 0.0, 0.0]), 12f64.hypot(20.0) / 100.0, 1e-12, &"F1 M1");
        close(of([0.0, 9.0, 0.0], [-0.2, 0.0, 0.0]), 29.0 / 100.0, 1e-12, &"F2 M1");
        // With F1, F2 and M1 and the couple M2 that leaves the axis level.
        let (f1, f2, m1): (f64, f64, f64) = (30.0, 20.0, 0.15);
        let wanted = ((f1 * f1 + f2 * f2) * (f1 * f1 + m1 * m1 / (r * r))).sqrt() / (2.0 * n * f1);
        close(of([f1, f2, 0.0], [m1, f2 * m1 / f1, 0.0]), wanted, 1e-12, &"F1 F2 M1");
        close(wanted, 0.403_112_887_414_927_46, 1e-15, &"value");
        // Past |F2 M1| = R F1^2 as without F1.
        let rolling = of([3.0, 20.0, 0.0], [0.15, 0.0, 0.0]);
        assert!(rolling > 35.0 / 100.0 * (1.0 - 1e-12), "{rolling}");
        // Lifted: the less loaded face slips.
        let lifted = of([0.0, 0.0, 20.0], [0.2, 0.0, 0.0]);
        close(lifted, 0.2 / (2.0 * r * 40.0), 1e-12, &"F3 M1");
    }
}

#[test]
fn closed_forms_of_a_cylinder_that_turns() {
    // Finite width: rbar over L by the width over the length.
    let (r, l, n) = (0.01_f64, 0.04_f64, 50.0_f64);
    for (ratio, rbar) in [
        (0.01, 0.250_031_658_280_284_75),
        (0.05, 0.250_590_293_333_693_3),
        (0.1, 0.252_014_800_289_545_57),
        (0.25, 0.259_737_795_299_821_35),
        (0.5, 0.280_407_297_760_444_94),
        (1.0, 0.338_703_993_016_841_5),
        (2.0, 0.486_830_881_117_237_5),
    ] {
        let a = 0.5 * ratio * l;
        let k = 1.5 * n * r / (l * a.powi(3));
        let mut case = cylinder(r, l, k, [0.0; 3], [0.0, 0.0, 0.2]);
        // Of the pads only the parabola counts, however wide.
        case["b"] = json!(0.2);
        close(mu(&case), 0.2 / (2.0 * n * rbar * l), 1e-12, &ratio);
    }
    // Line contact: off by the square of the width over the length, 6e-8 here.
    let line = |force, moment| mu(&cylinder(r, l, 1.5 * n * r / (l * 1e-15), force, moment));
    close(line([0.0; 3], [0.0, 0.0, 0.2]), 2.0 * 0.2 / (n * l), 1e-6, &"M3");
    close(line([0.0; 3], [0.1, 0.0, 0.2]), 0.241_421_356_237_309_5, 1e-6, &"M1 M3");
    close(line([0.0, 10.0, 0.0], [0.1, 0.0, 0.2]), 0.273_205_080_756_887_7, 1e-6, &"F2 M1 M3");
}

#[test]
fn closed_forms_of_a_sphere() {
    let (r, n) = (0.01_f64, 50.0_f64);
    let a = 1e-3_f64;
    let k = 4.0 * n * r / (std::f64::consts::PI * a.powi(4));
    let sphere = |force: [f64; 3], moment: [f64; 3]| {
        mu(&json!({"kind": "sphere", "R": r, "L": 0.02, "d": 0.02, "k": [k, k], "Fn": n,
                   "F": force, "M": moment}))
    };
    close(sphere([0.0; 3], [0.0, 0.0, 0.015]), 15.0 * 0.015 / (16.0 * n * a), 1e-12, &"M3");
    // Without M3: the larger of the two faces' shares over their loads.
    let (f, m) = ([6.0, 8.0, 4.0], [0.08, -0.05, 0.0]);
    let half = [
        (0.5 * f[0] + m[1] / (2.0 * r)).hypot(0.5 * f[1] - m[0] / (2.0 * r)) / (n + 0.5 * f[2]),
        (0.5 * f[0] - m[1] / (2.0 * r)).hypot(0.5 * f[1] + m[0] / (2.0 * r)) / (n - 0.5 * f[2]),
    ];
    close(sphere(f, m), half[0].max(half[1]), 1e-12, &"F M");
    // Spin and turn together: both faces alike.
    let value = |k: f64| 0.01 + 0.15 * a / r * k;
    let best = [(0.3, 0.930_427_403_020_475_5), (0.6, 1.190_088_973_586_390_5)]
        .map(|(k, d)| value(k) / (2.0 * n * a * std::f64::consts::FRAC_2_PI * d))
        .into_iter()
        .fold(0.0, f64::max);
    assert!(sphere([0.0; 3], [0.15, 0.0, 0.01]) > best);
    // A barrel as round along as across is a sphere.
    let load = ([0.0, 8.0, 0.0], [0.08, 0.0, 0.01]);
    let barrel = mu(&json!({"kind": "barrel", "R": r, "R1": r, "L": 0.02, "d": 0.02, "k": [k, k],
                            "Fn": n, "F": load.0, "M": load.1}));
    close(barrel, sphere(load.0, load.1), 1e-12, &"barrel");
}

/// A wedge without load needs the tangent of its half angle, whatever its pads, and whether they
/// touch it all over or at an edge.
#[test]
fn a_wedge_needs_the_tangent_of_its_half_angle() {
    for (slope, k) in [(0.01, [1e9, 1e9]), (0.05, [1e9, 3e9]), (0.2, [1e10, 2e10])] {
        for angle in [0.0_f64, 0.7, 2.0] {
            let along = slope * DVec2::from_angle(angle);
            let face = vec![rectangle(
                [-0.005, -0.004],
                [0.005, 0.004],
                Gap::Plane { height: 0.005 * slope, slope: along },
            )];
            let surfaces =
                Surfaces { face_i: face.clone(), face_ii: face, stiffness: k, layer: None };
            let got = solve(&surfaces, 0.02, 50.0, &Wrench::default()).unwrap();
            close(got.score.mu_s.unwrap(), slope, 1e-11, &got);
            // It is pushed out towards the thick end.
            let Some(Slip::Translation { direction }) = got.score.slip else { panic!("{got:?}") };
            let off = DVec2::from(direction) + along.normalize();
            assert!(off.length() < 1e-6, "{got:?}");
        }
    }
    // One drafted face opposite a flat one whose pads are held parallel: half of it on each.
    let plane = |slope: f64| {
        vec![rectangle(
            [-0.005, -0.004],
            [0.005, 0.004],
            Gap::Plane { height: 0.005 * slope, slope: DVec2::new(slope, 0.0) },
        )]
    };
    let surfaces =
        Surfaces { face_i: plane(0.04), face_ii: plane(0.0), stiffness: [1e9; 2], layer: None };
    let got = solve(&surfaces, 0.02, 50.0, &Wrench::default()).unwrap();
    close(got.score.mu_s.unwrap(), 0.02, 1e-11, &got);
}

/// A radius that only rounding tells from none is none, on either face and wherever its crest lies.
#[test]
fn what_is_nearly_plane_is_plane() {
    let on = |gap: Gap| vec![rectangle([-0.01, -0.008], [0.01, 0.008], gap)];
    let wrench = Wrench { force: DVec3::new(5.0, 3.0, 2.0), moment: DVec3::new(0.05, 0.02, 0.03) };
    let mu = |face_i: Gap, face_ii: Gap| {
        let (face_i, face_ii) = (on(face_i), on(face_ii));
        let surfaces = Surfaces { face_i, face_ii, stiffness: [5e9; 2], layer: None };
        solve(&surfaces, 0.02, 60.0, &wrench).unwrap().score.mu_s.unwrap()
    };
    let plane = mu(Gap::default(), Gap::default());
    for radius in [1e3, 1e6, 1e9, 1e12, -1e4] {
        let (axis, height) = (DVec2::X, 0.0);
        let cylinder = Gap::Cylinder { radius, axis, at: DVec2::ZERO, height };
        let sphere = Gap::Sphere { radius, at: DVec2::ZERO, height };
        for (one, two) in [(cylinder, cylinder), (cylinder, Gap::default()), (sphere, sphere)] {
            close(mu(one, two), plane, 1e-12, &(one, two));
        }
        // Far from its crest it leans; much farther places have no digits left.
        if radius > 1e7 {
            continue;
        }
        let at = DVec2::new(0.0, 1e-3 * radius);
        let leans = Gap::Plane { height: 0.5e-6 * radius, slope: DVec2::new(0.0, -1e-3) };
        let aside = Gap::Cylinder { radius, axis, at, height };
        close(mu(aside, cylinder), mu(leans, Gap::default()), 1e-6, &aside);
    }
}

/// Planes: the planar solver's answers, also separated.
#[test]
fn the_flat_limit_is_the_planar_solver() {
    let mut random = Random::new(7);
    for _ in 0..60 {
        let mut piece = |shift: f64| {
            let low = [-0.01 - 0.01 * random.unit(), -0.01 - 0.005 * random.unit()];
            let high = [0.005 + 0.01 * random.unit(), 0.004 + 0.01 * random.unit()];
            rectangle([low[0] + shift, low[1]], [high[0] + shift, high[1]], Gap::default())
        };
        let (one, two) = (piece(0.0), piece(0.001));
        let contact = Contact { face_i: vec![one.polygon()], face_ii: vec![two.polygon()] };
        let size = 0.4 * random.unit();
        let wrench = Wrench {
            force: DVec3::new(random.signed(), random.signed(), 0.3 * random.signed())
                * (40.0 * size),
            moment: DVec3::new(random.signed(), random.signed(), random.signed()) * size,
        };
        let d = 0.01 + 0.02 * random.unit();
        let wanted = mechanics::solve(&contact, d, 50.0, &wrench, &Options::default()).unwrap();
        let surfaces =
            Surfaces { face_i: vec![one], face_ii: vec![two], stiffness: [2e9; 2], layer: None };
        let got = solve(&surfaces, d, 50.0, &wrench).unwrap();
        if wanted.status != Status::Ok {
            continue;
        }
        close(got.score.mu_s.unwrap(), wanted.mu_s.unwrap(), 1e-12, &(&wrench, &got, &wanted));
        let pressure = wanted.pressure.unwrap();
        let faces = got.faces.unwrap();
        for (face, offset) in faces.iter().zip([pressure.a_i0, pressure.a_ii0]) {
            let scale = face.greatest_pressure;
            assert!((face.delta * 2e9 - offset).abs() < 1e-8 * scale, "{got:?} {wanted:?}");
        }
        for (area, planar) in [
            (got.score.contact_area_i, wanted.contact_area_i),
            (got.score.contact_area_ii, wanted.contact_area_ii),
        ] {
            close(area, planar, 1e-7, &got);
        }
    }
}

/// Any units, the faces exchanged, mirrored, turned about the closing axis, another stiffness with
/// another force.
#[test]
fn the_answer_knows_no_units_and_no_sides() {
    let round = |axis: DVec2, at: DVec2| Gap::Cylinder { radius: 0.01, axis, at, height: 0.0 };
    let (x, y) = (DVec2::X, DVec2::new(0.0, 0.001));
    let faces = [
        vec![rectangle([-0.02, -0.01], [0.015, 0.01], round(x, y))],
        vec![rectangle([-0.018, -0.01], [0.02, 0.01], round(x, y))],
    ];
    let flat = vec![rectangle([-0.02, -0.006], [0.02, 0.006], Gap::default())];
    let wrench = Wrench { force: DVec3::new(10.0, 8.0, 6.0), moment: DVec3::new(0.1, 0.3, 0.12) };
    for face_i in [faces[0].clone(), flat] {
        let base =
            Surfaces { face_i, face_ii: faces[1].clone(), stiffness: [4e9, 6e9], layer: None };
        let wanted = solve(&base, 0.02, 50.0, &wrench).unwrap().score.mu_s.unwrap();
        let check = |surfaces: &Surfaces, d: f64, n: f64, wrench: Wrench, what: &str| {
            let got = solve(surfaces, d, n, &wrench).unwrap();
            close(got.score.mu_s.unwrap(), wanted, 1e-11, &(what, &got));
        };
        let mapped = |f: &dyn Fn(DVec2) -> DVec2, size: f64| {
            let map = |pieces: &[Piece]| -> Vec<Piece> {
                let gap = |gap: Gap| match gap {
                    Gap::Cylinder { radius, axis, at, height } => Gap::Cylinder {
                        radius: radius * size,
                        axis: f(axis),
                        at: f(at),
                        height: height * size,
                    },
                    other => other,
                };
                pieces
                    .iter()
                    .map(|piece| Piece {
                        outer: piece.outer.iter().map(|x| f(*x)).collect(),
                        holes: Vec::new(),
                        gap: gap(piece.gap),
                    })
                    .collect()
            };
            Surfaces { face_i: map(&base.face_i), face_ii: map(&base.face_ii), ..base.clone() }
        };
        // Lengths times 3, forces times 5: stiffness is force per length cubed.
        let mut scaled = mapped(&|x| 3.0 * x, 3.0);
        scaled.stiffness = base.stiffness.map(|k| k * 5.0 / 27.0);
        let load = Wrench { force: 5.0 * wrench.force, moment: 15.0 * wrench.moment };
        check(&scaled, 0.06, 250.0, load, "units");
        // Harder pads and as much more load.
        let harder = Surfaces { stiffness: base.stiffness.map(|k| 4.0 * k), ..base.clone() };
        let load = Wrench { force: 4.0 * wrench.force, moment: 4.0 * wrench.moment };
        check(&harder, 0.02, 200.0, load, "harder");
        // Turned about the closing axis.
        let e = DVec2::from_angle(0.6);
        let turn = |v: DVec3| e.rotate(v.truncate()).extend(v.z);
        let load = Wrench { force: turn(wrench.force), moment: turn(wrench.moment) };
        check(&mapped(&|x| e.rotate(x), 1.0), 0.02, 50.0, load, "turned");
        // Mirrored: x2 changes its sign, and the moments in its plane.
        let mirror = mapped(&|x| DVec2::new(x.x, -x.y), 1.0);
        let (f, m) = (wrench.force, wrench.moment);
        let load =
            Wrench { force: DVec3::new(f.x, -f.y, f.z), moment: DVec3::new(-m.x, m.y, -m.z) };
        check(&mirror, 0.02, 50.0, load, "mirrored");
        // Upside down: turned by half a turn about x1, so that the faces change places.
        let over = mapped(&|x| DVec2::new(x.x, -x.y), 1.0);
        let swapped = Surfaces {
            face_i: over.face_ii,
            face_ii: over.face_i,
            stiffness: [base.stiffness[1], base.stiffness[0]],
            layer: None,
        };
        let half = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
        let load = Wrench { force: half(f), moment: half(m) };
        check(&swapped, 0.02, 50.0, load, "upside down");
    }
    // Without M3 and tilt neither stiffness nor length counts.
    for (l, k) in [(0.01, 1e9), (0.04, 6e9), (0.2, 1e13)] {
        let got = mu(&cylinder(0.01, l, k, [12.0, 0.0, 0.0], [0.2, 0.0, 0.0]));
        close(got, 12f64.hypot(20.0) / 100.0, 1e-12, &(l, k));
    }
}

/// Sixteen strips of equal area for a cylinder: right to the fourth power of their width, and round
/// to the solver without being told so.
#[test]
fn strips_of_equal_area_stand_for_a_cylinder() {
    let (r, l, a, n) = (0.01_f64, 0.015, 0.0025_f64, 50.0);
    let k = 1.5 * n * r / (l * a.powi(3));
    let load = Wrench { force: DVec3::ZERO, moment: DVec3::new(0.0, 0.0, 0.1) };
    let smooth = mu(&cylinder(r, l, k, load.force.to_array(), load.moment.to_array()));
    let mut errors = Vec::new();
    for m in [8, 16] {
        let w = 2.0 * a / f64::from(m);
        let strips: Vec<Piece> = (0..m)
            .map(|i| {
                let low = -a + w * f64::from(i);
                let height = |x: f64| 0.5 * x * x / r - w * w / (12.0 * r);
                let slope = (height(low + w) - height(low)) / w;
                // The outer strips reach beyond their zero line.
                let out = [i == 0, i == m - 1].map(|end| if end { w } else { 0.0 });
                rectangle(
                    [-0.5 * l, low - out[0]],
                    [0.5 * l, low + w + out[1]],
                    Gap::Plane { height: height(low) - slope * low, slope: DVec2::new(0.0, slope) },
                )
            })
            .collect();
        let surfaces =
            Surfaces { face_i: strips.clone(), face_ii: strips, stiffness: [k; 2], layer: None };
        let got = solve(&surfaces, 2.0 * r, n, &load).unwrap();
        assert_eq!((got.score.status, got.dimensions), (Status::Ok, 4), "{got:?}");
        errors.push((got.score.mu_s.unwrap() / smooth - 1.0).abs());
    }
    assert!(errors[0] < 1.6e-5 && errors[1] < 1e-6 && errors[0] > 12.0 * errors[1], "{errors:?}");
}

/// Round faces that are not on one axis: they hold by their stiffness while the layers give enough,
/// else they spin, and past the balance they are unstable.
#[test]
fn faces_near_one_axis_hold_settle_or_roll_out() {
    let lens = |r: f64, d: f64, m1: f64| {
        answer(&json!({"kind": "cylinder", "R": r, "L": 0.04, "d": d, "k": [6e9, 6e9], "Fn": 50.0,
                       "F": [0.0, 0.0, 0.0], "M": [m1, 0.0, 0.0]}))
    };
    // Stiffness N (2 R - d) = 1.2 N m: 0.001 N m turns it by 0.83 mrad.
    let held = lens(0.02, 0.016, 0.001);
    assert_eq!((held.dimensions, held.score.mu_s), (3, Some(0.0)), "{held:?}");
    close(held.tilt.unwrap()[1], 0.001 / 1.2, 1e-9, &held);
    // 0.05 N m would turn it by 42 mrad: friction has to hold it.
    let settles = lens(0.02, 0.016, 0.05);
    assert_eq!(settles.dimensions, 4);
    close(settles.score.mu_s.unwrap(), 0.05 / (50.0 * 0.016), 1e-12, &settles);
    let [Note::SettlesBy { angle }] = settles.notes[..] else { panic!("{settles:?}") };
    close(angle, 0.05 / 1.2, 1e-9, &settles);
    // Farther apart than their radii.
    let out = lens(0.01, 0.0202, 0.02);
    close(out.score.mu_s.unwrap(), 0.02 / (50.0 * 0.0202), 1e-12, &out);
    let [Note::Unstable { stiffness }] = out.notes[..] else { panic!("{out:?}") };
    close(stiffness, -50.0 * 0.0002, 1e-6, &out);
}

/// Equal crests whose axes differ, by rounding or truly: nothing turns freely that did not, and the
/// answer moves as the axes do. A screw that slides far along the axes while it turns about them is no
/// rotation of its own.
#[test]
fn axes_askew_free_no_rotation() {
    let mut random = Random::new(11);
    for count in 0..20 {
        let radius = random.range(0.015, 0.05);
        let distance = 2.0 * radius * random.range(0.2, 0.6);
        let angle = if count % 2 == 0 { 0.0 } else { random.range(0.0, 3.0) };
        let turned = random.signed();
        let at = |skew: f64| {
            let pieces = |sign: f64| {
                let axis = DVec2::from_angle(angle + if sign > 0.0 { skew } else { turned * skew });
                let gap = Gap::Cylinder { radius, axis, at: DVec2::ZERO, height: 0.0 };
                vec![rectangle([-0.01, -0.01], [0.01, 0.01], gap)]
            };
            let (face_i, face_ii) = (pieces(1.0), pieces(-1.0));
            let surfaces = Surfaces { face_i, face_ii, stiffness: [7.6e9; 2], layer: Some(2e-3) };
            let wrench = Wrench {
                force: DVec3::new(-1.2, 0.5, 1.5),
                moment: DVec3::new(-0.03, 0.012, 0.016),
            };
            solve(&surfaces, distance, 150.0, &wrench).unwrap()
        };
        let wanted = at(0.0);
        assert_eq!(wanted.dimensions, 3, "{wanted:?}");
        for skew in [1e-17, 3e-16, 1e-14, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 1e-2, 0.1] {
            let got = at(skew);
            assert_eq!(got.dimensions, 3, "{skew} {got:?}");
            let [got, wanted] = [&got, &wanted].map(|answer| answer.score.mu_s.unwrap());
            assert!((got / wanted - 1.0).abs() < 1e-9 + 10.0 * skew, "{skew}: {got} {wanted}");
        }
    }
}

#[test]
fn loads_without_a_limit_state_are_refused_with_their_reason() {
    let of = |force: [f64; 3], moment: [f64; 3]| {
        answer(&cylinder(0.01, 0.04, 6e9, force, moment)).score.status
    };
    // No pressure within the strip carries more than N L about x2.
    assert_eq!(of([0.0; 3], [0.0, 2.001, 0.0]), Status::TwistedOut);
    assert_eq!(of([0.0, 0.0, 100.0], [0.0; 3]), Status::NoNormalForce);
    assert_eq!(of([0.0; 3], [0.0, 1.99, 0.0]), Status::Ok);
    let empty = Surfaces { stiffness: [1e9; 2], ..Surfaces::default() };
    let got = solve(&empty, 0.02, 50.0, &Wrench::default()).unwrap();
    assert_eq!(got.score.status, Status::NoContact);
    for (key, value) in [("R", json!(0.0)), ("k", json!([0.0, 1e9])), ("layer", json!(-1.0))] {
        let mut case = cylinder(0.01, 0.04, 6e9, [0.0; 3], [0.0; 3]);
        case[key] = value;
        let read = case::parse("a case", case).unwrap();
        assert!(solve(&read.surfaces.unwrap(), 0.02, 50.0, &read.wrench).is_err(), "{key}");
    }
}

#[test]
fn soft_pads_and_tilts_are_said() {
    let mut case = cylinder(0.01, 0.04, 6e7, [0.0; 3], [0.1, 0.0, 0.0]);
    case["layer"] = json!(0.001);
    let notes = answer(&case).notes;
    let soft = notes.iter().filter(|note| matches!(note, Note::TooSoft { .. })).count();
    assert!(soft >= 4, "{notes:?}");
    let tilted = answer(&cylinder(0.01, 0.04, 6e9, [5.0, 0.0, 0.0], [0.0, 1.3, 0.1])).notes;
    assert!(tilted.iter().any(|note| matches!(note, Note::TiltsFirst { .. })), "{tilted:?}");
    // The flat of a D-bar pushes along the pads when it tilts, and its round rolls; a cylinder does neither.
    let mut bar = json!({"kind": "dbar", "R": 0.01, "L": 0.04, "d": 0.018, "bflat": 0.006,
        "k": [18.75e9, 18.75e9], "Fn": 50.0, "F": [0.0, 15.0, 0.0], "M": [0.16, 0.0, 0.1]});
    let counted = |case: &serde_json::Value| {
        let read = case::parse("a case", case.clone()).unwrap();
        let pads = Pads::new(&read.surfaces.unwrap()).unwrap();
        pads.solve_pushed(read.distance, read.force, &read.wrench)
    };
    let (dbar, with) = (answer(&bar), counted(&bar));
    let push = dbar.notes.iter().find_map(|note| match note {
        Note::TiltPushes { force, mu_s } => Some((force[1], mu_s.unwrap())),
        _ => None,
    });
    let (force, told) = push.unwrap();
    close(told, with.score.mu_s.unwrap(), 1e-9, &dbar);
    close(force, 50.0 * with.tilt.unwrap()[1], 1e-9, &dbar);
    // A physics engine found 0.49 % more than the theory that leaves this out; it agrees within 0.1 %.
    close(told / dbar.score.mu_s.unwrap(), 1.0049, 1e-3, &dbar);
    assert!(!with.notes.iter().any(|note| matches!(note, Note::TiltPushesMuch { .. })));
    // On softer pads it is more, and told where it counts; the tilt follows the friction needed then. No
    // load turns the bar, so that it tilts about its axis alone.
    (bar["k"], bar["M"][2]) = (json!([3e9, 3e9]), json!(0.0));
    let (theory, found) = (answer(&bar), counted(&bar));
    let Some(Note::TiltPushesMuch { force, without: Some(without) }) =
        found.notes.iter().find(|note| matches!(note, Note::TiltPushesMuch { .. }))
    else {
        panic!("{found:?}")
    };
    close(*without, theory.score.mu_s.unwrap(), 1e-12, &found);
    let tilt = found.tilt.unwrap()[1];
    close(force[1], 50.0 * tilt, 1e-9, &found);
    // As a load: the push, and the moment by which the round face's axis moves under the grip origin.
    let mut loaded = bar.clone();
    loaded["F"][1] = json!(15.0 + force[1]);
    loaded["M"][0] = json!(0.16 - 50.0 * (0.01 - 0.009) * tilt);
    close(found.score.mu_s.unwrap(), answer(&loaded).score.mu_s.unwrap(), 1e-9, &found);
    assert!(found.score.mu_s.unwrap() > 1.01 * without, "{found:?}");
    let round = answer(&cylinder(0.01, 0.04, 6e9, [0.0, 15.0, 0.0], [0.16, 0.0, 0.1])).notes;
    assert!(!round.iter().any(|note| matches!(note, Note::TiltPushes { .. })), "{round:?}");
}

/// The force needed is where `mu_s` meets the friction, or the least at which the load is held at
/// all.
#[test]
fn the_force_needed_is_where_mu_meets_the_friction() {
    let (mut met, mut at_the_end, mut never) = (0, 0, 0);
    // Of the last one `mu_s` hardly falls with the force.
    for number in (0..24).chain([149]) {
        let posed = posed(number);
        let pads = Pads::new(&posed.surfaces).unwrap();
        let mu = |force: f64| {
            let score = pads.solve_pushed(posed.distance, force, &posed.wrench).score;
            score.mu_s.filter(|_| score.status.holds()).unwrap_or(f64::INFINITY)
        };
        for (friction, start) in [(0.15, posed.force), (0.6, 0.1 * posed.force)] {
            let needed = force_needed(&pads, posed.distance, &posed.wrench, friction, start);
            let what = format!("case {number}, {friction} from {start}: {needed:?}");
            let Some(needed) = needed else {
                assert!(mu(1e4 * posed.force) > friction, "{what}");
                never += 1;
                continue;
            };
            let (here, below) = (mu(needed), mu(needed * (1.0 - 1e-6)));
            if (here / friction - 1.0).abs() < 2e-9 {
                assert!(below > friction, "{what}");
                met += 1;
            } else {
                assert!(here < friction && below > friction, "{what}: {here}, {below}");
                at_the_end += 1;
            }
        }
    }
    println!("{met} met, {at_the_end} at the end, {never} never");
    assert!(met > 10, "{met} {at_the_end} {never}");
}

//! Grips on curved faces: where they are, what they touch, and the friction that they need.

use std::sync::atomic::AtomicBool;

use glam::{DMat3, DVec2, DVec3};
use gripfast::backend::{Backend, CurvedProblem, ScoreOptions, Scored, SeedSet, score_curved};
use gripfast::geometry::patch_area;
use gripfast::gripper;
use gripfast::load::{LoadSet, wrench_in_grip};
use gripfast::mechanics::curved::Pads;
use gripfast::model::{Frame, Gap, Grip, LoadCase, Slip, Status, Wrench};
use gripfast::part::Part;
use gripfast::plan::{Assessor, Plan, Settings};
use gripfast::poses::Pose;
use gripfast::propose::{ProposeOptions, Proposer};
use gripfast::request::{Choice, Polish, Request};
use gripfast::results::{GripSet, RankedGrip};
use gripfast::units::{Angle, Force, Length, Mass};

use crate::support::lathe::lathe;

const RADIUS: f64 = 0.010;
const LENGTH: f64 = 0.060;

/// A closed cylinder about `z` turned by `turn` about it, its facets chords.
pub(crate) fn cylinder(
    radius: f64,
    length: f64,
    facets: u32,
    turn: f64,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let step = std::f64::consts::TAU / f64::from(facets);
    let mut vertices = Vec::new();
    for k in 0..facets {
        let e = DVec2::from_angle(turn + step * f64::from(k)) * radius;
        vertices.extend([e.extend(-0.5 * length), e.extend(0.5 * length)]);
    }
    let (low, high) = (2 * facets, 2 * facets + 1);
    vertices.extend([DVec3::Z * (-0.5 * length), DVec3::Z * (0.5 * length)]);
    let mut triangles = Vec::new();
    for k in 0..facets {
        let (a, b) = (2 * k, 2 * ((k + 1) % facets));
        triangles.extend([[a, b, b + 1], [a, b + 1, a + 1], [b, a, low], [a + 1, b + 1, high]]);
    }
    (vertices, triangles)
}

fn shaft(turn: f64) -> Part {
    let (vertices, triangles) = cylinder(RADIUS, LENGTH, 72, turn);
    Part::from_triangles("shaft", &vertices, &triangles).unwrap()
}

fn load(name: &str, force: DVec3, moment: DVec3) -> LoadCase {
    LoadCase { name: name.into(), wrench: Wrench { force, moment } }
}

fn planned(part: Part, loads: Vec<LoadCase>) -> GripSet {
    plan(part, loads).run(&mut (), &AtomicBool::new(false)).unwrap().set
}

fn plan(part: Part, loads: Vec<LoadCase>) -> Plan {
    let mut request = Request::new("", "robotiq-2f85");
    request.mass = Some(Mass(0.2));
    request.force = Some(Force(60.0));
    request.candidates.spacing = Some(Length(0.010));
    request.candidates.curved = Some(true);
    request.candidates.angle_step = Angle(45_f64.to_radians());
    request.scoring.backend = Choice::Cpu;
    Plan::builder(request).part(part).loads(loads).build().unwrap()
}

/// A barrel can be gripped at any angle, not only in the directions that a plan tries.
#[test]
fn a_pose_on_a_barrel_is_met_at_any_angle() {
    let plan = plan(shaft(0.3), vec![load("along", DVec3::Z * 9.0, DVec3::ZERO)]);
    let set = plan.run(&mut (), &AtomicBool::new(false)).unwrap().set;
    let best = set.grips.iter().find(|ranked| barrel_axis(ranked).is_some()).unwrap();
    let angles = [0.0, 1.3, 4.0, 7.1, -5.3, 22.0];
    let turned = angles.map(|degrees: f64| {
        let rotation = DMat3::from_rotation_z(degrees.to_radians());
        let by = Frame { rotation, origin: DVec3::ZERO };
        Pose::of_grip("turned", by.compose(&best.grip.part_from_grip))
    });
    let assessed = plan.assess(&turned, 0.05).unwrap();
    for (degrees, pose) in angles.iter().zip(&assessed.poses) {
        let fit = pose.fit.unwrap();
        assert!(fit.turned < 1e-6 && pose.is_grip(), "{degrees}: {fit:?}");
        let mu_s = pose.ranked.as_ref().unwrap().worst.mu_s.unwrap();
        let wanted = best.worst.mu_s.unwrap();
        assert!((mu_s / wanted - 1.0).abs() < 1e-4, "{degrees}: {mu_s} {wanted}");
    }
}

/// Jaws that close over a shoulder meet the thicker step, whichever face is listed first.
#[test]
fn poses_on_a_stepped_shaft_are_on_the_step_that_is_met_first() {
    // The thick step in the middle, so that it is neither the first nor the last.
    let steps = [(0.008, 0.0), (0.008, 0.025), (0.012, 0.025), (0.012, 0.045), (0.006, 0.045)];
    let steps = [&steps[..], &[(0.006, 0.065)]].concat();
    let ends = [DVec3::ZERO, DVec3::Z * 0.065];
    let (vertices, triangles) = lathe(48, 6, ends, |turn, row| {
        let (radius, height) = steps[row as usize];
        (DVec2::from_angle(turn) * radius).extend(height)
    });
    let part = Part::from_triangles("stepped", &vertices, &triangles).unwrap();
    let plan = plan(part, vec![load("down", DVec3::NEG_Z, DVec3::ZERO)]);
    let grips = plan.run(&mut (), &AtomicBool::new(false)).unwrap().set.grips;
    let poses: Vec<Pose> =
        grips.iter().map(|it| Pose::of_grip("it", it.grip.part_from_grip)).collect();
    let assessed = plan.assess(&poses, 0.05).unwrap().poses;
    let mut shoulders = 0;
    for (ranked, pose) in grips.iter().zip(&assessed) {
        let (grip, found) = (&ranked.grip, pose.ranked.as_ref().unwrap());
        assert!((grip.width - found.grip.width).abs() < 1e-9, "{} {:?}", grip.width, pose.fit);
        assert!(pose.is_grip(), "{}: {:?}", grip.id, pose.rejection());
        let [wanted, got] = [ranked, found].map(|ranked| ranked.worst.mu_s.unwrap());
        assert!((got - wanted).abs() <= 1e-6 * wanted, "{}: {got} {wanted}", grip.id);
        // A pad that reaches over the thin steps beside the thick one.
        let beside = (grip.part_from_grip.origin.z - 0.035).abs();
        shoulders += usize::from((grip.width - 0.024).abs() < 1e-9 && beside > 0.005);
    }
    assert!(shoulders > 10, "{shoulders} of {}", grips.len());
}

/// Axis of the barrel in the grip frame.
fn barrel_axis(ranked: &RankedGrip) -> Option<DVec2> {
    match ranked.grip.surfaces.as_ref()?.face_i.first()?.gap {
        Gap::Cylinder { axis, .. } => Some(axis.normalize()),
        _ => None,
    }
}

#[test]
fn grips_on_a_barrel_need_the_friction_of_the_closed_forms() {
    let force = 60.0;
    let loads = vec![
        load("along", DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO),
        load("about", DVec3::ZERO, DVec3::new(0.0, 0.0, 0.05)),
        load("along and about", DVec3::new(0.0, 0.0, 6.0), DVec3::new(0.0, 0.0, 0.09)),
        load("across and about", DVec3::new(5.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.03)),
    ];
    let part = shaft(0.0);
    let centre = part.mass_properties(1.0).centre_of_mass;
    let set = planned(part, loads.clone());
    let mut checked = 0;
    for ranked in &set.grips {
        let Some(e) = barrel_axis(ranked) else { continue };
        assert!((ranked.grip.width - 2.0 * RADIUS).abs() < 1e-9, "{}", ranked.grip.width);
        if ranked.grip.part_from_grip.origin.distance(centre) > 1e-9 {
            continue;
        }
        let wrenches: Vec<Wrench> = loads
            .iter()
            .map(|load| wrench_in_grip(&load.wrench, centre, &ranked.grip.part_from_grip))
            .collect();
        // Those whose closing direction lies along a force have another formula.
        if wrenches.iter().any(|wrench| wrench.force.z.abs() > 1e-9) {
            continue;
        }
        let needed = |wrench: &Wrench| {
            let plane = |x: DVec3| DVec2::new(e.dot(x.truncate()), e.perp_dot(x.truncate()));
            let (f, m) = (plane(wrench.force), plane(wrench.moment).x / RADIUS);
            let (along, across) = (f.x.abs(), f.y.abs());
            assert!(along.min(across) < 1e-9, "{wrench:?}");
            if across > 1e-9 {
                (across + m.abs()) / (2.0 * force)
            } else {
                along.hypot(m) / (2.0 * force)
            }
        };
        let (worst, mu) =
            wrenches.iter().map(needed).enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        let found = ranked.worst.mu_s.unwrap();
        assert!((found / mu - 1.0).abs() < 1e-8, "{found} {mu} {:?}", ranked.worst);
        assert_eq!((ranked.worst.load as usize, ranked.worst.status), (worst, Status::Ok));
        assert!(matches!(ranked.worst.slip, Some(Slip::Spin { .. })), "{:?}", ranked.worst.slip);
        // Strip and pressure of Hertz's problem on a bed of springs: a^3 = 3 N R/(2 k L).
        let k = ranked.grip.surfaces.as_ref().unwrap().stiffness[0];
        let faces = ranked.faces.unwrap();
        let outline = &ranked.grip.contact.face_i;
        let length = patch_area(outline) / faces[0].area
            * (faces[0].extent[1][0] - faces[0].extent[0][0])
                .max(faces[0].extent[1][1] - faces[0].extent[0][1]);
        let half = (1.5 * force * RADIUS / (k * length)).cbrt();
        assert!((faces[0].area / (2.0 * half * length) - 1.0).abs() < 1e-6, "{faces:?}");
        let greatest = 0.75 * force / (half * length);
        assert!((faces[0].greatest_pressure / greatest - 1.0).abs() < 1e-6, "{faces:?}");
        checked += 1;
    }
    // One closing direction lies across all forces; four approaches.
    assert_eq!(checked, 4, "of {}", set.grips.len());
}

/// Values of all grips on the barrel, rounded.
fn values(set: &GripSet) -> Vec<[i64; 3]> {
    let value = |ranked: &RankedGrip| {
        let origin = ranked.grip.part_from_grip.origin;
        let off = origin.truncate().length();
        [ranked.worst.mu_s.unwrap() * 1e7, origin.z.abs() * 1e7, off * 1e7]
            .map(|x| x.round() as i64)
    };
    let mut values: Vec<[i64; 3]> =
        set.grips.iter().filter(|ranked| barrel_axis(ranked).is_some()).map(value).collect();
    values.sort_unstable();
    values
}

#[test]
fn turning_the_part_about_its_axis_gives_the_same_grips() {
    let loads = || {
        vec![
            load("along", DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO),
            load("about", DVec3::ZERO, DVec3::new(0.0, 0.0, 0.02)),
        ]
    };
    let (one, two) = (planned(shaft(0.0), loads()), planned(shaft(0.6), loads()));
    assert!(values(&one).len() > 50);
    assert_eq!(values(&one), values(&two));
    // And so does standing it elsewhere, but for which of its own directions come first.
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 1.1);
    let (vertices, triangles) = cylinder(RADIUS, LENGTH, 72, 0.0);
    let moved: Vec<DVec3> = vertices.iter().map(|v| turn * *v + DVec3::splat(0.1)).collect();
    let part = Part::from_triangles("moved", &moved, &triangles).unwrap();
    let turned = loads().into_iter().map(|load| LoadCase {
        wrench: Wrench { force: turn * load.wrench.force, moment: turn * load.wrench.moment },
        ..load
    });
    let three = planned(part, turned.collect());
    let mu = |set: &GripSet| values(set).iter().map(|value| value[0]).collect::<Vec<_>>();
    assert_eq!(mu(&one), mu(&three));
}

#[test]
fn a_grip_on_a_barrel_is_explained_as_it_was_proposed() {
    let (part, gripper) = (shaft(0.1), gripper::find("robotiq-2f85").unwrap());
    let options = ProposeOptions::default()
        .with_curved(Some(true))
        .with_spacing(Some(0.012))
        .with_angle_step(0.8)
        .with_force(Some(60.0));
    let mut proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let grips: Vec<_> = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    let curved: Vec<_> = grips.iter().filter(|grip| grip.surfaces.is_some()).collect();
    assert!(curved.len() > 20, "{}", curved.len());
    for grip in curved.iter().step_by(7) {
        let explained =
            proposer.explain_pose(grip.face_i, grip.face_ii, &grip.part_from_grip).unwrap();
        assert!(explained.rejection.is_none(), "{explained:?}");
        let areas = |contact: &gripfast::model::Contact| {
            [patch_area(&contact.face_i), patch_area(&contact.face_ii)]
        };
        for (a, b) in areas(&explained.contact).into_iter().zip(areas(&grip.contact)) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
    // Numbers of candidates on planes come first and stay what they are without curved faces.
    let plane = options.with_faces(Some((0..part.faces.len() as u32).collect()));
    let alone: Vec<_> =
        Proposer::new(&part, &gripper, &plane).unwrap().flat_map(|chunk| chunk.grips).collect();
    let first: Vec<_> = grips.iter().filter(|grip| grip.surfaces.is_none()).cloned().collect();
    assert_eq!(alone, first);
    let last = first.iter().map(|grip| grip.id).max().unwrap_or(0);
    assert!(curved.iter().all(|grip| grip.id > last));
}

#[test]
fn a_shaft_is_gripped_on_its_barrel() {
    for (file, width) in [("cyl_20x60", 0.020), ("ring", 0.040)] {
        let Some(path) = crate::support::reference(&format!("trials/curved/{file}.stl")) else {
            return;
        };
        let part = Part::read(&path, &Default::default()).unwrap();
        let weight = 0.2 * 9.80665;
        let gravity = DVec3::AXES
            .into_iter()
            .flat_map(|axis| [axis, -axis])
            .map(|axis| load("gravity", axis * weight, DVec3::ZERO));
        let set = planned(part, gravity.collect());
        let best = set.grips.iter().find(|ranked| barrel_axis(ranked).is_some()).unwrap();
        let mu = best.worst.mu_s.unwrap();
        assert!((best.grip.width - width).abs() < 2e-6, "{file}: {}", best.grip.width);
        // Both pads carry the weight.
        assert!((mu / (weight / 120.0) - 1.0).abs() < 1e-6, "{file}: {mu}");
        assert!(set.grips[0].grip.surfaces.is_some() || file != "cyl_20x60", "{file}");
    }
}

/// The worst loads of some curved grips of a part, from comparisons and from solving every load;
/// how many loads were solved, and all.
pub(crate) fn screened_as_solved(name: &str, part: &Part, count: usize) -> [usize; 2] {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let force = 40.0;
    let options = ProposeOptions::default()
        .with_curved(Some(true))
        .with_spacing(Some(0.008))
        .with_angle_step(0.8)
        .with_force(Some(force));
    let grips: Vec<_> = Proposer::new(part, &gripper, &options)
        .unwrap()
        .flat_map(|chunk| chunk.grips)
        .filter(|grip| grip.surfaces.is_some())
        .collect();
    assert!(!grips.is_empty(), "{name}");
    let step = (grips.len() / count).max(1);
    let mass = part.mass_properties(0.2 / part.mass_properties(1.0).volume);
    let centre = mass.centre_of_mass;
    let (mut solved, mut all) = (0, 0);
    for source in ["gravity", "gravity:26", "ball:40", "heavy"] {
        // Loads up to twisting out too.
        let (text, grown) = if source == "heavy" { ("ball:30", 15.0) } else { (source, 1.0) };
        let loads = LoadSet::parse("loads", text).unwrap().cases(&mass).unwrap();
        for grip in grips.iter().step_by(step) {
            let pads = Pads::new(grip.surfaces.as_ref().unwrap()).unwrap();
            let wrenches: Vec<Wrench> = loads
                .iter()
                .map(|load| {
                    let Wrench { force, moment } = load.wrench;
                    let wrench = Wrench { force: grown * force, moment: grown * moment };
                    wrench_in_grip(&wrench, centre, &grip.part_from_grip)
                })
                .collect();
            let (pads, distance) = (Some(&pads), grip.distance());
            let problem = CurvedProblem { pads, distance, force, wrenches: &wrenches };
            let worst =
                |polish| -> Scored { score_curved(&[problem], polish).into_iter().next().unwrap() };
            let (screened, every) = (worst(Polish::Worst), worst(Polish::All));
            assert_eq!(every.all.len(), wrenches.len());
            let ((load, score), (wanted, truth)) = (screened.worst.unwrap(), every.worst.unwrap());
            assert_eq!((load, score.status), (wanted, truth.status), "{name} {source} {}", grip.id);
            match (score.mu_s, truth.mu_s) {
                (Some(a), Some(b)) => {
                    assert!((a - b).abs() <= 1e-9 * b, "{name} {source} {}: {a} {b}", grip.id)
                }
                (a, b) => assert_eq!(a, b),
            }
            solved += screened.solved;
            all += wrenches.len();
        }
    }
    println!("{name}: {solved} of {all} loads solved");
    [solved, all]
}

#[test]
fn an_assessor_solves_every_load_of_a_barrel_where_that_is_asked() {
    let part = shaft(0.3);
    let options = ProposeOptions::default()
        .with_curved(Some(true))
        .with_spacing(Some(0.02))
        .with_angle_step(1.6);
    let grips: Vec<_> = proposals(&part, &options)
        .into_iter()
        .filter(|grip| grip.surfaces.is_some())
        .take(4)
        .collect();
    let mass = part.mass_properties(0.2 / part.mass_properties(1.0).volume);
    let loads = LoadSet::parse("loads", "gravity:26").unwrap().cases(&mass).unwrap();
    let assessed = |polish| {
        let score = ScoreOptions { polish, ..ScoreOptions::default() };
        let settings = &Settings::of_force(60.0).with_score(score);
        let (backend, seeds) = (&Backend::Cpu, &SeedSet::default());
        let assessor = Assessor { loads: &loads, mass, settings, backend, seeds };
        assessor.assess(grips.clone()).unwrap()
    };
    let (worst, all) = (assessed(Polish::Worst), assessed(Polish::All));
    assert_eq!((worst.len(), all.len()), (4, 4));
    for (worst, all) in worst.iter().zip(&all) {
        assert_eq!((worst.mu_by_load.len(), all.mu_by_load.len()), (0, loads.len()));
        assert_eq!(worst.worst.load, all.worst.load);
    }
}

#[test]
fn comparing_loads_gives_the_worst_one_that_solving_all_of_them_gives() {
    let mut sums = [0; 2];
    let mut add = |[solved, all]: [usize; 2]| sums = [sums[0] + solved, sums[1] + all];
    add(screened_as_solved("shaft", &shaft(0.3), 6));
    // Off its axis by the mass of a head, and short.
    let (mut vertices, mut triangles) = cylinder(0.006, 0.050, 48, 0.1);
    let (head, more) = cylinder(0.012, 0.016, 64, 0.0);
    let first = vertices.len() as u32;
    vertices.extend(head.iter().map(|v| *v + DVec3::Z * 0.040));
    triangles.extend(more.iter().map(|triangle| triangle.map(|corner| corner + first)));
    let part = Part::from_triangles("pin", &vertices, &triangles).unwrap();
    add(screened_as_solved("pin", &part, 6));
    for file in ["curved/cyl_20x60", "curved/sphere", "curved/dshaft", "draft/frustum1"] {
        if let Some(path) = crate::support::reference(&format!("trials/{file}.stl")) {
            let part = Part::read(&path, &Default::default()).unwrap();
            if part.curved.iter().any(|face| face.outside) {
                add(screened_as_solved(file, &part, 6));
            }
        }
    }
    let [solved, all] = sums;
    assert!(4 * solved < all, "{solved} of {all}");
}

fn proposals(part: &Part, options: &ProposeOptions) -> Vec<Grip> {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    Proposer::new(part, &gripper, options).unwrap().flat_map(|chunk| chunk.grips).collect()
}

/// A cap of a ball of 60 mm on a base of 20 mm shows a few degrees of directions.
#[test]
fn a_cap_is_gripped_however_it_lies_and_whatever_the_step() {
    let (radius, base) = (0.060, 0.020_f64);
    let (vertices, triangles) =
        lathe(64, 12, [DVec3::ZERO, DVec3::Z * (radius - 0.0565685)], |turn, row| {
            let angle = (base / radius).asin() * (1.0 - row / 12.0);
            let out = DVec2::from_angle(turn) * angle.sin() * radius;
            out.extend(angle.cos() * radius - 0.0565685)
        });
    for (index, step) in [30.0, 20.0, 45.0_f64].into_iter().enumerate() {
        let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.7 * index as f64, -0.4, 1.1);
        let moved: Vec<DVec3> = vertices.iter().map(|vertex| turn * *vertex).collect();
        let part = Part::from_triangles("cap", &moved, &triangles).unwrap();
        let options =
            ProposeOptions::default().with_spacing(Some(0.008)).with_angle_step(step.to_radians());
        let along = proposals(&part, &options)
            .iter()
            .filter(|grip| grip.part_from_grip.rotation.z_axis.cross(turn.z_axis).length() < 1e-3)
            .count();
        assert!(along > 10, "{step}: {along}");
    }
}

/// A torus about `z`.
fn ring(major: f64, minor: f64) -> Part {
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    let (around, about) = (96_u32, 48_u32);
    let step =
        |k: u32, of: u32| DVec2::from_angle(std::f64::consts::TAU * f64::from(k) / f64::from(of));
    for i in 0..around {
        for k in 0..about {
            let (turn, tube) = (step(i, around), step(k, about) * minor);
            vertices.push((turn * (major + tube.x)).extend(tube.y));
            let [a, b] = [i, (i + 1) % around].map(|i| i * about);
            let next = (k + 1) % about;
            triangles.extend([[a + k, b + k, b + next], [a + k, b + next, a + next]]);
        }
    }
    Part::from_triangles("ring", &vertices, &triangles).unwrap()
}

/// The far side of the hole faces the pad, too.
#[test]
fn a_ring_is_touched_at_its_outside_alone() {
    let (major, minor) = (0.020_f64, 0.012_f64);
    let part = ring(major, minor);
    let grips = proposals(&part, &ProposeOptions::default().with_spacing(Some(0.008)));
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let wide: Vec<_> = grips.iter().filter(|grip| (grip.width - 0.064).abs() < 1e-3).collect();
    assert!(wide.len() > 10, "{}", grips.len());
    for grip in wide.iter().filter(|grip| grip.part_from_grip.origin.length() < 1e-6) {
        // A paraboloid's load is half its area times its depth.
        let stiffness = gripper.layer().stiffness;
        let radii = (major + minor) * minor;
        let deep = (gripper.force[1] / (std::f64::consts::PI * stiffness * radii.sqrt())).sqrt();
        let expected = 2.0 * std::f64::consts::PI * radii.sqrt() * deep;
        let found = patch_area(&grip.contact.face_i);
        assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    }
}

/// The pressed area of a torus that lies flat under a pad, parabolas for its circles, by points of it.
fn pressed_of_ring(major: f64, minor: f64, grip: &Grip) -> f64 {
    const STEP: f64 = 1e-4;
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let half = 0.5 * gripper.pad_sizes()[0];
    let counts = (half / STEP).as_ivec2();
    let mut gaps = Vec::new();
    for (i, j) in (-counts.x..counts.x).flat_map(|i| (-counts.y..counts.y).map(move |j| (i, j))) {
        let place = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) * STEP;
        let off = grip.part_from_grip.point(place.extend(0.0)).truncate().length() - major;
        if off.abs() < minor {
            gaps.push(off * off / (2.0 * minor));
        }
    }
    gaps.sort_by(f64::total_cmp);
    // The layer's compression grows over point after point until these carry the force.
    let (mut sum, mut count) = (0.0, 0.0);
    for gap in &gaps {
        let carried = gripper.layer().stiffness * STEP * STEP * (count * gap - sum);
        if carried > gripper.force[1] {
            break;
        }
        (sum, count) = (sum + gap, count + 1.0);
    }
    count * STEP * STEP
}

/// Along its axis pads touch a circle.
#[test]
fn a_ring_is_gripped_across_its_tube() {
    for (major, minor) in [(0.020_f64, 0.005_f64), (0.060, 0.006)] {
        let part = ring(major, minor);
        let grips = proposals(&part, &ProposeOptions::default().with_spacing(Some(0.008)));
        let across = |grip: &&Grip| (grip.width - 2.0 * minor).abs() < 1e-6;
        let mut turns = [0; 8];
        let mut checked = 0;
        for grip in grips.iter().filter(across) {
            let at = grip.part_from_grip.origin;
            assert!(at.z.abs() < 1e-9 && at.truncate().length() < major + 0.02, "{at}");
            turns[((at.y.atan2(at.x) / std::f64::consts::FRAC_PI_4 + 8.0) as usize) % 8] += 1;
            let wanted = pressed_of_ring(major, minor, grip);
            for face in [&grip.contact.face_i, &grip.contact.face_ii] {
                let found = patch_area(face);
                assert!((found / wanted - 1.0).abs() < 0.01, "{at}: {found} {wanted}");
            }
            checked += 1;
        }
        assert!(checked > 100 && turns.iter().all(|&count| count > 10), "{turns:?}");
    }
}

/// A round bar of 20 mm, bent by a quarter turn with a radius of 40 mm, its ends straight for 25 mm.
fn elbow(around: u32) -> Part {
    let (radius, bend, leg) = (0.010, 0.040, 0.025);
    let quarter = std::f64::consts::FRAC_PI_2 * bend;
    let rows = around / 4 + 3;
    let bent = |at: DVec3| {
        let past = at.z - leg;
        let angle = (past / bend).clamp(0.0, std::f64::consts::FRAC_PI_2);
        let (sine, cosine) = angle.sin_cos();
        let straight = past - bend * angle;
        let out = bend + at.x;
        DVec3::new(out * cosine - straight * sine, at.y, out * sine + straight * cosine)
    };
    let length = 2.0 * leg + quarter;
    let along = |row: f64| match row {
        0.0 => 0.0,
        row if row >= f64::from(rows - 1) => length,
        row => leg + quarter * (row - 1.0) / f64::from(rows - 3),
    };
    let (vertices, triangles) =
        lathe(around, rows, [DVec3::ZERO, DVec3::Z * length].map(bent), |turn, row| {
            bent((radius * DVec2::from_angle(turn)).extend(along(row)))
        });
    Part::from_triangles("elbow", &vertices, &triangles).unwrap()
}

/// The crests of its legs and of the bend between them lie in no line.
#[test]
fn an_elbow_is_gripped_across_the_plane_of_its_bend() {
    for around in [24, 96] {
        let part = elbow(around);
        let grips = proposals(&part, &ProposeOptions::default().with_spacing(Some(0.008)));
        let (mut on_legs, mut on_bend) = (0, 0);
        for grip in &grips {
            let (at, closing) = (grip.part_from_grip.origin, grip.part_from_grip.rotation.z_axis);
            if closing.cross(DVec3::Y).length() > 1e-6 {
                continue;
            }
            assert!((grip.width - 0.020).abs() < 1e-6 && at.y.abs() < 1e-6, "{around}: {at}");
            *(if at.x < 0.0 || at.z < 0.025 { &mut on_legs } else { &mut on_bend }) += 1;
        }
        assert!(on_legs > 100 && on_bend > 100, "{around}: {on_legs} {on_bend}");
    }
}

/// Both readings of few facets are tried, each by itself.
#[test]
fn round_or_faceted_but_never_both_at_once() {
    for facets in [8, 9, 12, 14] {
        let (vertices, triangles) = cylinder(RADIUS, LENGTH, facets, 0.1);
        let part = Part::from_triangles("bar", &vertices, &triangles).unwrap();
        assert_eq!(part.curved.len(), 1);
        let options = ProposeOptions::default().with_spacing(Some(0.008)).with_curved(Some(true));
        let grips = proposals(&part, &options);
        let (round, flat): (Vec<_>, Vec<_>) =
            grips.iter().partition(|grip| grip.surfaces.is_some());
        assert!(round.len() > 20, "{facets}: {}", round.len());
        for grip in round {
            let surfaces = grip.surfaces.as_ref().unwrap();
            assert!((grip.width / (2.0 * RADIUS) - 1.0).abs() < 1e-5, "{facets}: {}", grip.width);
            for piece in surfaces.face_i.iter().chain(&surfaces.face_ii) {
                assert!(matches!(piece.gap, Gap::Cylinder { .. }), "{facets}: {:?}", piece.gap);
            }
        }
        let across = 2.0 * RADIUS * (std::f64::consts::PI / f64::from(facets)).cos();
        let between = |grip: &&&Grip| (grip.width - across).abs() < 1e-6;
        assert_eq!(flat.iter().any(|grip| between(&grip)), facets % 2 == 0, "{facets}");
    }
}

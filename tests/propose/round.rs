//! Round parts: the turns that map them to themselves, and the grips that these map to each other;
//! curved faces where planes give nothing.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use glam::{DMat3, DVec2, DVec3};
use gripfast::export::{self, Values, table};
use gripfast::gripper;
use gripfast::model::{Frame, Grip, Wrench};
use gripfast::part::{Part, ReadOptions, Symmetry, Unit};
use gripfast::plan::{Outcome, Plan};
use gripfast::propose::{ProposeOptions, Proposer};
use gripfast::rank::{self, Filter};
use gripfast::request::{Choice, Request};
use gripfast::results::LoadCase;
use gripfast::units::{Angle, Force, Length, Mass};

use crate::curved::cylinder;

/// A closed body whose outlines `low` and `high`, as many points in each, lie at two heights \[m\].
fn prism(low: &[DVec2], high: &[DVec2], length: f64) -> Part {
    let count = low.len() as u32;
    let mut vertices: Vec<DVec3> = low.iter().map(|p| p.extend(0.0)).collect();
    vertices.extend(high.iter().map(|p| p.extend(length)));
    let middle = |points: &[DVec2]| points.iter().sum::<DVec2>() / f64::from(count);
    vertices.extend([middle(low).extend(0.0), middle(high).extend(length)]);
    let (bottom, top) = (2 * count, 2 * count + 1);
    let triangles: Vec<[u32; 3]> = (0..count)
        .flat_map(|k| {
            let (a, b) = (k, (k + 1) % count);
            let (c, d) = (a + count, b + count);
            [[a, b, d], [a, d, c], [b, a, bottom], [c, d, top]]
        })
        .collect();
    Part::from_triangles("prism", &vertices, &triangles).unwrap()
}

fn circle(radius: f64, count: u32, at: DVec2) -> Vec<DVec2> {
    let step = std::f64::consts::TAU / f64::from(count);
    (0..count).map(|k| at + radius * DVec2::from_angle(step * f64::from(k))).collect()
}

#[test]
fn a_part_is_round_where_all_of_it_is() {
    let (vertices, triangles) = cylinder(0.01, 0.06, 72, 0.2);
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 1.1);
    let (axis, shift) = (turn * DVec3::Z, DVec3::new(0.1, -0.2, 0.05));
    let moved: Vec<DVec3> = vertices.iter().map(|vertex| turn * *vertex + shift).collect();
    let shaft = Part::from_triangles("shaft", &moved, &triangles).unwrap();
    let Some(Symmetry::Axis { axis: found }) = shaft.symmetry() else {
        panic!("{:?}", shaft.curved)
    };
    assert!(found.direction.cross(axis).length() < 1e-9, "{found:?}");
    assert!(found.origin.distance(shift) < 1e-9, "{found:?}");
    // One facet of its end is not there.
    let open = Part::from_triangles("open", &moved, &triangles[1..]).unwrap();
    assert_eq!(open.symmetry(), None);
    // A cone, and the same with its upper end beside the axis.
    let low = circle(0.012, 96, DVec2::ZERO);
    assert!(prism(&low, &circle(0.010, 96, DVec2::ZERO), 0.04).symmetry().is_some());
    assert_eq!(prism(&low, &circle(0.010, 96, DVec2::X * 1e-3), 0.04).symmetry(), None);
    // Few sides are sides.
    for sides in [4, 6, 8, 12] {
        let outline = circle(0.01, sides, DVec2::ZERO);
        assert_eq!(prism(&outline, &outline, 0.05).symmetry(), None, "{sides}");
    }
    // A flat a tenth of the radius deep.
    let flat: Vec<DVec2> = circle(0.01, 96, DVec2::ZERO)
        .into_iter()
        .map(|p| DVec2::new(p.x.min(0.009), p.y))
        .collect();
    assert_eq!(prism(&flat, &flat, 0.05).symmetry(), None);
}

#[test]
fn parts_of_the_reference_are_round_or_not() {
    let read = |file: &str| {
        let path = crate::support::reference(file)?;
        Some(Part::read(&path, &ReadOptions::default()).unwrap())
    };
    for file in ["cyl30", "cyl_20x60", "ring"] {
        let Some(part) = read(&format!("trials/curved/{file}.stl")) else { return };
        let symmetry = part.symmetry();
        assert!(matches!(symmetry, Some(Symmetry::Axis { .. })), "{file}: {symmetry:?}");
    }
    let Some(ball) = read("trials/curved/sphere.stl") else { return };
    assert!(matches!(ball.symmetry(), Some(Symmetry::Point { centre }) if centre.length() < 1e-6));
    // Twelve facets may be meant as such.
    for file in ["dshaft", "cyl_12"] {
        let Some(part) = read(&format!("trials/curved/{file}.stl")) else { return };
        assert_eq!(part.symmetry(), None, "{file}");
    }
}

#[test]
fn a_ball_is_gripped_from_every_side() {
    let Some(ball) = crate::support::reference("trials/curved/sphere.stl") else { return };
    let ball = Part::read(&ball, &ReadOptions::default()).unwrap();
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let step = 30_f64.to_radians();
    let options = ProposeOptions::default().with_curved(Some(true)).with_angle_step(step);
    let mut proposer = Proposer::new(&ball, &gripper, &options).unwrap();
    let mut closings: Vec<DVec3> = Vec::new();
    for grip in proposer.by_ref().flat_map(|chunk| chunk.grips) {
        let closing = grip.part_from_grip.rotation.z_axis;
        if !closings.iter().any(|known| known.cross(closing).length() < 1e-6) {
            closings.push(closing);
        }
    }
    // Directions evenly over a sphere, along a spiral.
    let furthest = (0..2000)
        .map(|k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 2000.0;
            let turn = DVec2::from_angle(2.399_963_229_728_653 * f64::from(k));
            let direction = (turn * (1.0 - z * z).sqrt()).extend(z);
            let near = closings.iter().map(|closing| closing.dot(direction).abs());
            near.fold(0.0, f64::max).min(1.0).acos()
        })
        .fold(0.0, f64::max);
    assert!(furthest < 0.75 * step, "{} {furthest}", closings.len());
}

fn plan(every_turn: bool, loads: Vec<LoadCase>) -> Plan {
    let mut request = Request::new("", "robotiq-2f85");
    request.mass = Some(Mass(0.2));
    request.force = Some(Force(60.0));
    request.candidates.spacing = Some(Length(0.012));
    request.candidates.angle_step = Angle(30_f64.to_radians());
    request.scoring.backend = Choice::Cpu;
    request.selection.top = 6;
    request.selection.every_turn = every_turn;
    let (vertices, triangles) = cylinder(0.01, 0.06, 72, 0.0);
    let part = Part::from_triangles("shaft", &vertices, &triangles).unwrap();
    Plan::builder(request).part(part).loads(loads).build().unwrap()
}

fn run(plan: &Plan) -> Outcome {
    plan.run(&mut (), &AtomicBool::new(false)).unwrap()
}

fn load(force: DVec3, moment: DVec3) -> LoadCase {
    LoadCase { name: "load".into(), wrench: Wrench { force, moment } }
}

/// The angle of a turn about `z` that maps one pose to another, either with the jaws exchanged or
/// not, and how far it misses \[m\] (directions as at a decimetre).
fn turn_between(from: &Frame, to: &Frame) -> (f64, f64) {
    let exchange = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let mut best = (0.0, f64::INFINITY);
    for jaws in [DMat3::IDENTITY, exchange] {
        let rotation = to.rotation * jaws * from.rotation.transpose();
        let angle =
            (rotation.x_axis.y - rotation.y_axis.x).atan2(rotation.x_axis.x + rotation.y_axis.y);
        let turn = DMat3::from_rotation_z(angle);
        let off = (turn * from.origin).distance(to.origin);
        let turned = turn * from.rotation;
        let aside = [0, 1, 2].map(|i| turned.col(i).distance((to.rotation * jaws).col(i)));
        let miss = off.max(0.1 * aside.into_iter().fold(0.0, f64::max));
        if miss < best.1 {
            best = (angle, miss);
        }
    }
    best
}

#[test]
fn turns_of_a_shaft_are_one_family() {
    let loads = || {
        vec![
            load(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO),
            load(DVec3::ZERO, DVec3::new(0.0, 0.0, 0.02)),
        ]
    };
    let outcome = run(&plan(false, loads()));
    let set = &outcome.set;
    let firsts = rank::turned(set);
    let find = |id: u64| set.grips.iter().find(|ranked| ranked.grip.id == id).unwrap();
    let mut angles: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    for (ranked, &first) in set.grips.iter().zip(&firsts) {
        let best = find(first);
        assert!(best.rank <= ranked.rank);
        let (angle, miss) = turn_between(&best.grip.part_from_grip, &ranked.grip.part_from_grip);
        assert!(miss < 3e-5, "{} {}: {miss:e}", best.grip.id, ranked.grip.id);
        // These loads do not change with the turn.
        let (a, b) = (best.worst.mu_s.unwrap(), ranked.worst.mu_s.unwrap());
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
        angles.entry(first).or_default().push(angle);
    }
    // Six closing directions and two sides to come from.
    assert!(angles.values().any(|turns| turns.len() == 12), "{angles:?}");
    // A table names the family of each grip.
    let table = table(set, &export::Options::default()).unwrap();
    let column = table.columns.iter().find(|column| column.name == "turn_of").unwrap();
    let expected = firsts.iter().map(|&id| Some(id as f64)).collect();
    assert_eq!(column.values, Values::Number(expected));
    // No two families are one: no turn maps their best grips to each other.
    let best: Vec<u64> = angles.keys().copied().collect();
    for (place, a) in best.iter().enumerate() {
        for b in &best[place + 1..] {
            let (a, b) = (&find(*a).grip, &find(*b).grip);
            let miss = turn_between(&a.part_from_grip, &b.part_from_grip).1;
            assert!(miss > 1e-5 || (a.width - b.width).abs() > 1e-5, "{} {}", a.id, b.id);
        }
    }
    // One of each is shown, best first, unless every turn is.
    let mut expected = best.clone();
    expected.sort_by_key(|id| find(*id).rank);
    assert_eq!(outcome.shown, expected[..6]);
    let every = run(&plan(true, loads()));
    assert_eq!(every.set.grips, set.grips);
    let first_six: Vec<u64> = set.grips[..6].iter().map(|ranked| ranked.grip.id).collect();
    assert_eq!(every.shown, first_six);
    // So does a choice from the file, which holds the axis.
    let text = serde_json::to_string(set).unwrap();
    let mut read: gripfast::results::GripSet = serde_json::from_str(&text).unwrap();
    let mut filter = Filter::default();
    filter.one_turn = true;
    filter.apply(&mut read).unwrap();
    let ids: Vec<u64> = read.grips.iter().map(|ranked| ranked.grip.id).collect();
    assert_eq!(ids, expected);
}

#[test]
fn a_turn_leaves_a_grip_in_its_family_whatever_it_scores() {
    // Across the shaft: the friction changes with the closing direction.
    let across = || vec![load(DVec3::new(5.0, 0.0, 0.0), DVec3::ZERO)];
    let plan = plan(false, across());
    let set = &run(&plan).set;
    let families = rank::families(set);
    let spread = set.grips.iter().zip(&families).filter(|(ranked, first)| {
        let best = set.grips.iter().find(|other| other.grip.id == **first).unwrap();
        let (a, b) = (best.worst.mu_s.unwrap(), ranked.worst.mu_s.unwrap());
        assert!(a <= b * (1.0 + 1e-9), "{a} {b}");
        b > 1.05 * a
    });
    assert!(spread.count() > 20);
    // Merged, the same families; each best one names the others.
    let mut request = plan.request().clone();
    request.selection.merge_symmetric = true;
    let (vertices, triangles) = cylinder(0.01, 0.06, 72, 0.0);
    let part = Part::from_triangles("shaft", &vertices, &triangles).unwrap();
    let merged = run(&Plan::builder(request).part(part).loads(across()).build().unwrap()).set;
    let mut counted: BTreeMap<u64, usize> = BTreeMap::new();
    families.iter().for_each(|first| *counted.entry(*first).or_default() += 1);
    let of: BTreeMap<u64, usize> =
        merged.grips.iter().map(|ranked| (ranked.grip.id, 1 + ranked.merged.len())).collect();
    assert_eq!(of, counted);
}

#[test]
fn curved_faces_are_tried_where_planes_give_nothing() {
    let Some(path) = crate::support::reference("parts/parts/ariac__regulator_collision.stl") else {
        return;
    };
    let gripper = gripper::find("robotiq-2f85").unwrap();
    // As the file is meant, planes give grips, and its many curved faces are left out on a fine grid; a
    // thousand times smaller the fingers touch what lies beside the planes.
    let cases = [(Unit::Metre, Some(0.002), false), (Unit::Millimetre, None, true)];
    for (unit, spacing, curved) in cases {
        let part = Part::read(&path, &ReadOptions::default().with_unit(Some(unit))).unwrap();
        let options = ProposeOptions::default().with_spacing(spacing);
        let proposer = Proposer::new(&part, &gripper, &options).unwrap();
        assert_eq!(proposer.tally().curved_left_out, !curved, "{unit:?}");
        assert_eq!(proposer.curved_candidates() > 0, curved, "{unit:?}");
        assert_eq!(proposer.tally().candidates, 0, "none was looked at yet");
        let asked = options.clone().with_curved(Some(curved));
        let asked = Proposer::new(&part, &gripper, &asked).unwrap();
        assert_eq!(proposer.candidates(), asked.candidates(), "{unit:?}");
        let first = |proposer: Proposer<'_>| -> Vec<Grip> {
            proposer.flat_map(|chunk| chunk.grips).take(500).collect()
        };
        assert!(first(proposer) == first(asked), "{unit:?}");
    }
}

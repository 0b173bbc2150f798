//! Grips on what leans against the pads: drafted planes, cones and bores.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use glam::{DMat3, DVec2, DVec3};
use gripfast::geometry::patch_area;
use gripfast::gripper::{self, Jaw, Travel};
use gripfast::load::wrench_in_grip;
use gripfast::mechanics::curved::Pads;
use gripfast::mechanics::squeeze_pressure;
use gripfast::model::{Frame, LoadCase, Status, Wrench};
use gripfast::part::{Part, Shape};
use gripfast::plan::{Observer, Plan};
use gripfast::propose::{ProposeOptions, Proposer, Rejection};
use gripfast::request::{Choice, Request, Side};
use gripfast::results::{GripSet, RankedGrip};
use gripfast::units::{Angle, Force, Length, Mass, Pressure};

const FORCE: f64 = 60.0;

/// A block of 40 x 20 x 30 mm whose faces at `-y` and `+y` are drafted by these angles \[rad\].
fn wedge(drafts: [f64; 2]) -> Part {
    let corner = |x: f64, z: f64| {
        let y = |draft: f64| 0.010 - z * draft.tan();
        [DVec3::new(x, -y(drafts[0]), z), DVec3::new(x, y(drafts[1]), z)]
    };
    let places = [(-0.02, 0.0), (0.02, 0.0), (-0.02, 0.03), (0.02, 0.03)];
    // Pairs of corners (-y, +y): 0 1, 2 3 below, 4 5, 6 7 above.
    let vertices: Vec<DVec3> = places.iter().flat_map(|&(x, z)| corner(x, z)).collect();
    let quads =
        [[0, 2, 6, 4], [3, 1, 5, 7], [0, 1, 3, 2], [4, 6, 7, 5], [1, 0, 4, 5], [2, 3, 7, 6]];
    let triangles: Vec<[u32; 3]> =
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let part = Part::from_triangles("wedge", &vertices, &triangles).unwrap();
    assert!(part.health.watertight && part.mass_properties(1.0).volume > 0.0);
    part
}

/// A solid between two circles about `z`, or a square block of 80 mm with such a hole. The number of
/// facets is 4 times an odd one, so that the square has its corners.
fn lathe(radii: [f64; 2], length: f64, facets: u32, hole: bool) -> Part {
    let ray = |k: u32| DVec2::from_angle(TAU * (f64::from(k) + 0.5) / f64::from(facets));
    let at = |e: DVec2, end: usize| e.extend([-0.5, 0.5][end] * length);
    let circle = |k: u32, end: usize| at(ray(k) * radii[end], end);
    let outer = |k: u32, end: usize| at(ray(k) * (0.04 / ray(k).abs().max_element()), end);
    let middle = |end: usize| at(DVec2::ZERO, end);
    let mut soup: Vec<DVec3> = Vec::new();
    for k in 0..facets {
        let n = (k + 1) % facets;
        let mut quad = |[a, b, c, d]: [DVec3; 4]| soup.extend([a, b, c, a, c, d]);
        if hole {
            quad([circle(n, 0), circle(k, 0), circle(k, 1), circle(n, 1)]);
            quad([outer(k, 0), outer(n, 0), outer(n, 1), outer(k, 1)]);
            quad([circle(k, 0), circle(n, 0), outer(n, 0), outer(k, 0)]);
            quad([circle(n, 1), circle(k, 1), outer(k, 1), outer(n, 1)]);
        } else {
            quad([circle(k, 0), circle(n, 0), circle(n, 1), circle(k, 1)]);
            soup.extend([circle(n, 0), circle(k, 0), middle(0)]);
            soup.extend([circle(k, 1), circle(n, 1), middle(1)]);
        }
    }
    let triangles: Vec<[u32; 3]> =
        (0..soup.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let part = Part::from_triangles("turned", &soup, &triangles).unwrap();
    assert!(part.health.watertight, "{:?}", part.health.lines());
    part
}

fn load(name: &str, force: DVec3, moment: DVec3) -> LoadCase {
    LoadCase { name: name.into(), wrench: Wrench { force, moment } }
}

/// Places a step of `spacing` apart, closing directions by `step` degrees.
fn planned(
    part: Part,
    gripper: &str,
    loads: Vec<LoadCase>,
    grips: Side,
    (spacing, step): (f64, f64),
) -> GripSet {
    let mut request = Request::new("", gripper);
    request.mass = Some(Mass(0.2));
    request.force = Some(Force(FORCE));
    request.candidates.spacing = Some(Length(spacing));
    request.candidates.curved = Some(true);
    request.candidates.grips = grips;
    request.candidates.angle_step = Angle(step.to_radians());
    request.scoring.backend = Choice::Cpu;
    let plan = Plan::builder(request).part(part).loads(loads).build().unwrap();
    plan.run(&mut (), &AtomicBool::new(false)).unwrap().set
}

/// Grips on what is not plane.
fn curved(set: &GripSet) -> Vec<&RankedGrip> {
    set.grips.iter().filter(|ranked| ranked.grip.surfaces.is_some()).collect()
}

#[test]
fn drafted_faces_need_the_tangent_of_the_draft() {
    for degrees in [[0.05, 0.05], [0.2, 0.2], [0.5, 0.5], [2.0, 2.0], [1.0, 2.0], [0.0, 3.0]] {
        let drafts = degrees.map(f64::to_radians);
        let none = vec![load("none", DVec3::ZERO, DVec3::ZERO)];
        let set = planned(wedge(drafts), "robotiq-2f85", none, Side::Outside, (0.008, 45.0));
        let half = 0.5 * (drafts[0] + drafts[1]);
        let found = curved(&set);
        assert!(found.len() > 20, "{degrees:?}: {}", found.len());
        // In the frame of the bisector, about the middle plane of the two faces.
        let lean = 0.5 * (drafts[1] - drafts[0]);
        let closing = DVec3::new(0.0, lean.cos(), lean.sin());
        for ranked in found {
            let frame = ranked.grip.part_from_grip;
            assert!(frame.rotation.z_axis.cross(closing).length() < 1e-9, "{degrees:?}");
            let mu = ranked.worst.mu_s.unwrap();
            assert!((mu / half.tan() - 1.0).abs() < 1e-9, "{degrees:?}: {mu}");
            assert_eq!(ranked.worst.status, Status::Ok);
            // The pads stand as far apart as the faces where the pads touch first: at the upper
            // edge of the pads, or of the faces.
            let up = closing.cross(DVec3::X);
            let up = if up.z > 0.0 { -up } else { up };
            let pad = DVec2::new(0.0335, 0.02) / 2.0;
            let along = [frame.rotation.x_axis, frame.rotation.y_axis].map(|e| e.dot(up).abs());
            let place = frame.origin + up * (pad.x * along[0] + pad.y * along[1]);
            let gap = |place: DVec3| {
                let distance = |side: f64, draft: f64| {
                    let normal = DVec3::new(0.0, side * draft.cos(), draft.sin());
                    (0.010 * draft.cos() - normal.dot(place)) / normal.dot(closing)
                };
                distance(1.0, drafts[1]) - distance(-1.0, drafts[0])
            };
            // Where the faces end: at z = 0 on the one that ends first.
            let ends = [(1.0, drafts[1]), (-1.0, drafts[0])]
                .map(|(side, _)| up.dot(DVec3::new(0.0, side * 0.010, 0.0)));
            let end = frame.origin + up * (ends[0].min(ends[1]) - up.dot(frame.origin));
            let expected = if up.dot(place) < up.dot(end) { gap(place) } else { gap(end) };
            assert!(
                (ranked.grip.width - expected).abs() < 1e-9,
                "{degrees:?}: {} {expected}",
                ranked.grip.width
            );
        }
    }
}

#[test]
fn parallel_faces_stay_as_they_are_beside_drafted_ones() {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let options = ProposeOptions::default().with_spacing(Some(0.006)).with_force(Some(FORCE));
    for degrees in [0.02_f64, 0.2, 1.0] {
        let part = wedge([degrees.to_radians(); 2]);
        let grips = |curved: bool| -> Vec<_> {
            let options = options.clone().with_curved(Some(curved));
            let proposer = Proposer::new(&part, &gripper, &options).unwrap();
            proposer.flat_map(|chunk| chunk.grips).collect()
        };
        let (without, with) = (grips(false), grips(true));
        let parallel = |grip: &gripfast::model::Grip| {
            part.faces[grip.face_i as usize].normal.dot(part.faces[grip.face_ii as usize].normal)
                < -1.0 + 1e-6
        };
        let plane: Vec<_> = with.iter().filter(|grip| grip.surfaces.is_none()).collect();
        let last = plane.iter().map(|grip| grip.id).max().unwrap();
        assert!(with.iter().all(|grip| grip.surfaces.is_none() || grip.id > last));
        // Up to 0.05 degrees in all they count as parallel, and without curved faces up to 0.5.
        assert_eq!(with.len() > plane.len(), degrees > 0.025, "{degrees}");
        assert_eq!(without.iter().all(parallel), degrees != 0.2, "{degrees}");
        let same = |a: &gripfast::model::Grip, b: &gripfast::model::Grip| {
            a.part_from_grip == b.part_from_grip && a.contact == b.contact && a.width == b.width
        };
        let without: Vec<_> = without.into_iter().filter(parallel).collect();
        assert!(without.len() > 50 && without.len() == plane.len());
        assert!(without.iter().zip(plane).all(|(a, b)| same(a, b)), "{degrees}");
    }
}

#[test]
fn what_the_layer_does_not_take_is_told_with_its_angle() {
    let part = wedge([14_f64.to_radians(); 2]);
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let options = ProposeOptions::default().with_curved(Some(true)).with_force(Some(235.0));
    let proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let tally = proposer.tally();
    assert_eq!(tally.rejections.get("face_pair_leans_too_much"), Some(&1), "{tally:?}");
    let remarks = tally.remarks(&gripper, &options);
    let remark = remarks.iter().find(|remark| remark.contains("14.00 deg")).unwrap();
    // A strip of the layer along the longer side, compressed by a third of 2 mm.
    let most = (5e9 * 0.0335 * (2e-3_f64 / 3.0).powi(2) / (2.0 * 235.0)).atan().to_degrees();
    assert!(remark.contains(&format!("{most:.2} deg at 235 N")), "{remark} {most}");
    // A little less than that is taken.
    let part = wedge([(most - 0.05).to_radians(); 2]);
    let proposer = Proposer::new(&part, &gripper, &options).unwrap();
    assert!(!proposer.tally().rejections.contains_key("face_pair_leans_too_much"));
    assert!(proposer.curved_candidates() > 0);
}

#[test]
fn a_grip_on_a_row_is_explained_as_it_was_proposed() {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let options = ProposeOptions::default()
        .with_curved(Some(true))
        .with_spacing(Some(0.004))
        .with_force(Some(FORCE));
    let part = wedge([2_f64.to_radians(); 2]);
    let mut proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let grips: Vec<_> = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    let leaning: Vec<_> = grips.iter().filter(|grip| grip.surfaces.is_some()).collect();
    assert!(leaning.len() > 100, "{}", leaning.len());
    for grip in leaning.iter().step_by(5) {
        let told = proposer.explain_pose(grip.face_i, grip.face_ii, &grip.part_from_grip).unwrap();
        assert!(told.rejection.is_none() && told.width == grip.width, "{told:?}");
        let sums = |contact: &gripfast::model::Contact| -> Vec<DVec2> {
            let rings = contact.face_i.iter().chain(&contact.face_ii);
            rings.map(|polygon| polygon.outer.iter().copied().sum()).collect()
        };
        for (a, b) in sums(&told.contact).into_iter().zip(sums(&grip.contact)) {
            assert!(a.distance(b) < 1e-12, "{a} {b}");
        }
        let fit = proposer.fit(&grip.part_from_grip, 0.01).unwrap();
        assert_eq!(proposer.grip_at(&fit, grip.id).width, grip.width);
    }
}

#[test]
fn a_bore_is_gripped_from_inside_about_its_axis() {
    let (radius, half): (f64, f64) = (0.03, 0.010);
    let part = lathe([radius; 2], 0.04, 68, true);
    let bore = part.curved.iter().find(|face| !face.outside).unwrap();
    assert!(matches!(bore.shape, Shape::Cylinder { .. }));
    let loads = vec![
        load("along", DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO),
        load("about", DVec3::ZERO, DVec3::new(0.0, 0.0, 0.2)),
        load("both", DVec3::new(0.0, 0.0, 7.0), DVec3::new(0.0, 0.0, 0.25)),
    ];
    let centre = part.mass_properties(1.0).centre_of_mass;
    let set = planned(part, "generic", loads.clone(), Side::Inside, (0.008, 45.0));
    let found = curved(&set);
    assert!(found.len() > 10, "{} {:?}", found.len(), set.summary.rejections);
    let mut checked = 0;
    for ranked in found {
        let frame = ranked.grip.part_from_grip;
        assert!(ranked.grip.inside && (ranked.grip.width - 2.0 * radius).abs() < 1e-6);
        assert!(frame.origin.truncate().length() < 1e-7, "on the axis: {}", frame.origin);
        // The pads slide along and about the axis, each with half of the load at the bore's radius.
        let wrench = wrench_in_grip(&loads[2].wrench, centre, &frame);
        let mu = 7.0_f64.hypot(wrench.moment.length() / radius) / (2.0 * FORCE);
        assert!((ranked.worst.mu_s.unwrap() / mu - 1.0).abs() < 1e-8, "{:?} {mu}", ranked.worst);
        assert_eq!(ranked.worst.load, 2);
        // Both edges of the pads touch: N = 2 k L int (y^2 - c^2)/(2 R) dy from c to the edge.
        let faces = ranked.faces.unwrap();
        let length = 0.010 + (0.02 - frame.origin.z.abs()).min(0.010);
        let k = ranked.grip.surfaces.as_ref().unwrap().stiffness[0];
        let carried =
            |c: f64| k * length / radius * ((half.powi(3) - c.powi(3)) / 3.0 - c * c * (half - c));
        let (mut low, mut high) = (0.0, half);
        for _ in 0..80 {
            let c = 0.5 * (low + high);
            if carried(c) > FORCE { low = c } else { high = c }
        }
        assert!((faces[0].area / (2.0 * length * (half - low)) - 1.0).abs() < 1e-6, "{faces:?}");
        let greatest = k * (half * half - low * low) / (2.0 * radius);
        assert!((faces[0].greatest_pressure / greatest - 1.0).abs() < 1e-6, "{faces:?}");
        checked += 1;
    }
    assert!(checked > 10, "{checked}");
    // Nothing but the wall counts, though the block's own sides lie beyond the pads.
    let surfaces = set.grips.iter().filter_map(|ranked| ranked.grip.surfaces.as_ref());
    assert!(surfaces.flat_map(|one| one.face_i.iter().chain(&one.face_ii)).all(|piece| {
        matches!(piece.gap, gripfast::model::Gap::Cylinder { radius, .. } if radius < 0.0)
    }));
    // Too narrow for the pads.
    let narrow = lathe([0.02; 2], 0.04, 68, true);
    let gripper = gripper::find("generic").unwrap();
    let options =
        ProposeOptions::default().with_outside(false).with_inside(true).with_curved(Some(true));
    let proposer = Proposer::new(&narrow, &gripper, &options).unwrap();
    assert_eq!(proposer.tally().rejections.get("bore_too_narrow_for_pads"), Some(&1));
    assert_eq!(proposer.curved_candidates(), 0);
}

#[test]
fn a_tapered_bore_is_gripped_from_inside_and_slides_towards_its_wide_end() {
    let (radii, length) = ([0.0305, 0.0295], 0.04);
    let tangent = (radii[0] - radii[1]) / length;
    let radius = |z: f64| 0.030 - tangent * z;
    let part = lathe(radii, length, 68, true);
    let kinds: Vec<_> = part.curved.iter().map(|face| (face.shape.name(), face.outside)).collect();
    assert_eq!(kinds, [("cone", false)]);
    // The walls push along the axis with the tangent of the force; a load adds to it or does not.
    let along = |name: &str, z: f64| load(name, DVec3::new(0.0, 0.0, z), DVec3::ZERO);
    for (loads, more) in
        [(vec![along("none", 0.0)], 0.0), (vec![along("up", 6.0), along("down", -6.0)], 6.0)]
    {
        let set = planned(part.clone(), "generic", loads, Side::Inside, (0.008, 45.0));
        let found = curved(&set);
        assert!(found.len() > 10, "{} {:?}", found.len(), set.summary.rejections);
        for ranked in found {
            let frame = ranked.grip.part_from_grip;
            assert!(ranked.grip.inside && frame.rotation.z_axis.z.abs() < 1e-9);
            assert!(frame.origin.truncate().length() < 1e-7, "on the axis: {}", frame.origin);
            // The narrowest place under the pads, of 20 by 20 mm.
            let top = (frame.origin.z + 0.010).min(0.5 * length);
            let width = 2.0 * radius(top);
            assert!((ranked.grip.width - width).abs() < 1e-6, "{} {width}", ranked.grip.width);
            let mu = tangent + more / (2.0 * FORCE);
            let found = ranked.worst.mu_s.unwrap();
            assert!((found / mu - 1.0).abs() < 1e-6, "{found} {mu} {:?}", ranked.worst);
            assert_eq!(ranked.worst.status, Status::Ok);
            // More of the pad is pressed where the bore is narrower.
            let surfaces = ranked.grip.surfaces.as_ref().unwrap();
            assert!(surfaces.face_i.iter().chain(&surfaces.face_ii).all(|piece| {
                matches!(piece.gap, gripfast::model::Gap::Cone { radius, .. } if radius < 0.0)
            }));
        }
    }
}

#[test]
fn fingers_in_a_bore_stay_above_its_shoulder() {
    // A bore that is narrower below z = 0.
    let (wide, narrow, facets) = (0.03, 0.02, 68);
    let ray = |k: u32| DVec2::from_angle(TAU * (f64::from(k) + 0.5) / f64::from(facets));
    let mut soup: Vec<DVec3> = Vec::new();
    for k in 0..facets {
        let (k, n) = (ray(k), ray((k + 1) % facets));
        let outer = |e: DVec2| e * (0.04 / e.abs().max_element());
        let outline = |e: DVec2| {
            let at = [(e * wide, 0.03), (e * wide, 0.0), (e * narrow, 0.0), (e * narrow, -0.03)];
            at.into_iter().chain([(outer(e), -0.03), (outer(e), 0.03)]).map(|(x, z)| x.extend(z))
        };
        let (one, two): (Vec<DVec3>, Vec<DVec3>) = (outline(k).collect(), outline(n).collect());
        for i in 0..6 {
            let j = (i + 1) % 6;
            soup.extend([one[i], two[i], two[j], one[i], two[j], one[j]]);
        }
    }
    let triangles: Vec<[u32; 3]> =
        (0..soup.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let part = Part::from_triangles("stepped", &soup, &triangles).unwrap();
    assert!(part.health.watertight && part.mass_properties(1.0).volume > 0.0);
    let gripper = gripper::find("generic").unwrap();
    let options = ProposeOptions::default()
        .with_outside(false)
        .with_inside(true)
        .with_curved(Some(true))
        .with_spacing(Some(0.004));
    let mut proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let grips: Vec<_> = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    let mut from_above = 0;
    for grip in grips.iter().filter(|grip| (grip.width - 2.0 * wide).abs() < 1e-3) {
        let frame = grip.part_from_grip;
        let bodies = [Jaw::I, Jaw::II].map(|jaw| gripper.finger(jaw, grip.width)).concat();
        let down = frame.rotation.transpose() * DVec3::NEG_Z;
        let lowest = bodies
            .iter()
            .map(|body| frame.point(body.support_point(down)).z)
            .fold(f64::INFINITY, f64::min);
        assert!(lowest > -1e-5, "{lowest} {grip:?}");
        from_above += usize::from(lowest < 0.01);
    }
    assert!(from_above > 0, "{} {:?}", grips.len(), proposer.tally());
}

#[test]
fn a_cone_needs_the_tangent_of_its_half_angle_and_more_to_be_turned() {
    let radii = [0.0150, 0.0140];
    let part = lathe(radii, 0.05, 68, false);
    let kinds: Vec<_> = part.curved.iter().map(|face| face.shape.name()).collect();
    assert_eq!(kinds, ["cone"]);
    let tangent = (radii[0] - radii[1]) / 0.05;
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let options = ProposeOptions::default()
        .with_curved(Some(true))
        .with_spacing(Some(0.008))
        .with_angle_step(std::f64::consts::FRAC_PI_2)
        .with_force(Some(FORCE));
    let proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let grips: Vec<_> = proposer.flat_map(|chunk| chunk.grips).collect();
    let found: Vec<_> = grips.iter().filter(|grip| grip.surfaces.is_some()).collect();
    assert!(found.len() > 20, "{}", found.len());
    let mut middle = 0;
    for grip in found {
        let r = 0.5 * grip.width;
        let (place, rotation) = (grip.part_from_grip.origin, grip.part_from_grip.rotation);
        // The widest place under the pads, or of the cone.
        let pad = DVec2::new(0.0335, 0.02) / 2.0;
        let reach = pad.x * rotation.x_axis.z.abs() + pad.y * rotation.y_axis.z.abs();
        let z = (place.z - reach).max(-0.025);
        let widest = radii[0] - tangent * (z + 0.025);
        assert!((r - widest).abs() < 2e-7, "{r} {widest} at {place}");
        if place.truncate().length() > 1e-7 {
            continue;
        }
        let pads = Pads::new(grip.surfaces.as_ref().unwrap()).unwrap();
        for moment in [0.0, 0.04] {
            let wrench = Wrench { force: DVec3::ZERO, moment: DVec3::Z * moment };
            let wrench = wrench_in_grip(&wrench, DVec3::ZERO, &grip.part_from_grip);
            let score = pads.solve(grip.distance(), FORCE, &wrench).score;
            let mu = tangent.hypot(moment / (2.0 * FORCE * r));
            assert_eq!(score.status, Status::Ok);
            assert!((score.mu_s.unwrap() / mu - 1.0).abs() < 2e-5, "{score:?} {mu}");
        }
        middle += 1;
    }
    assert!(middle > 5, "{middle}");
}

#[test]
fn grips_that_mark_the_part_are_rejected_and_counted() {
    let none = || vec![load("none", DVec3::ZERO, DVec3::ZERO)];
    // A plane block: the squeeze over the area, which for the whole pad is the least.
    let block = wedge([0.0; 2]);
    let least = FORCE / (0.020 * 0.020);
    let run = |part: &Part, gripper: &str, limit: Option<f64>| {
        let mut request = Request::new("", gripper);
        request.mass = Some(Mass(0.2));
        request.force = Some(Force(FORCE));
        request.candidates.spacing = Some(Length(0.006));
        request.candidates.curved = Some(true);
        request.candidates.angle_step = Angle(90_f64.to_radians());
        request.scoring.backend = Choice::Cpu;
        request.scoring.max_pressure = limit.map(Pressure);
        let plan = Plan::builder(request).part(part.clone()).loads(none()).build().unwrap();
        plan.run(&mut (), &AtomicBool::new(false)).unwrap().set
    };
    let all = run(&block, "generic", None);
    let some = run(&block, "generic", Some(1.5 * least));
    let pressure = |ranked: &RankedGrip| {
        let contact = &ranked.grip.contact;
        FORCE / patch_area(&contact.face_i).min(patch_area(&contact.face_ii))
    };
    let wanted = all.grips.iter().filter(|ranked| pressure(ranked) <= 1.5 * least).count();
    assert!(wanted > 10 && wanted < all.grips.len(), "{wanted} of {}", all.grips.len());
    assert_eq!(some.grips.len(), wanted);
    assert_eq!(
        some.summary.rejections["over_pressure:0.225_MPa"] as usize,
        all.grips.len() - wanted
    );
    // A wedge pressed over a strip at its thick end: u = sqrt(2 F s/(k W)).
    let slope = 2_f64.to_radians();
    let wedge = wedge([slope; 2]);
    let steep = run(&wedge, "robotiq-2f85", None);
    let k = curved(&steep)[0].grip.surfaces.as_ref().unwrap().stiffness[0];
    let strip = |width: f64| (2.0 * FORCE * slope.tan() * k / width).sqrt();
    let limit = 0.5 * (strip(0.020) + strip(0.0335));
    let left = run(&wedge, "robotiq-2f85", Some(limit));
    let width = |ranked: &RankedGrip| {
        let faces = ranked.faces.unwrap();
        faces[0].extent[1][0] - faces[0].extent[0][0]
    };
    assert!(!curved(&left).is_empty() && curved(&left).len() < curved(&steep).len());
    for ranked in curved(&left) {
        let pressure = squeeze_pressure(&ranked.grip, FORCE).unwrap();
        assert!(pressure <= limit * (1.0 + 1e-9), "{pressure} {limit}");
        // All that are left lie with the pads' long side along the rows.
        let along = ranked.grip.part_from_grip.rotation.x_axis.x.abs();
        assert!(along > 0.99 && width(ranked) > 0.0, "{along}");
    }
    for ranked in curved(&steep) {
        let pressure = squeeze_pressure(&ranked.grip, FORCE).unwrap();
        let whole = [0.020, 0.0335].iter().any(|w| (pressure / strip(*w) - 1.0).abs() < 1e-9);
        assert!(whole || pressure > strip(0.0335), "{pressure}");
    }
}

/// Notes of a run.
#[derive(Default)]
struct Heard(Vec<String>);

impl Observer for Heard {
    fn note(&mut self, text: &str) {
        self.0.push(text.to_owned());
    }
}

#[test]
fn no_grip_is_told_in_words_of_the_part() {
    let told = |part: Part, gripper: &str| {
        let mut request = Request::new("", gripper);
        request.mass = Some(Mass(0.2));
        request.candidates.spacing = Some(Length(0.02));
        request.candidates.angle_step = Angle(90_f64.to_radians());
        request.scoring.backend = Choice::Cpu;
        let plan = Plan::builder(request).part(part).build().unwrap();
        let mut heard = Heard::default();
        let set = plan.run(&mut heard, &AtomicBool::new(false)).unwrap().set;
        assert!(set.grips.is_empty(), "{}", set.grips.len());
        heard.0.join("\n")
    };
    // 120 mm thick, 250 mm long.
    let thick = told(lathe([0.06; 2], 0.25, 68, false), "robotiq-2f85");
    let barrel = "barrel 120 mm x 250 mm (face 2): the stroke of Robotiq 2F-85 ends at 85 mm; \
                  robotiq-2f140 of the catalogue reaches it";
    assert!(thick.contains(barrel), "{thick}");
    assert!(thick.contains("turned is 250 mm wide between opposite faces"), "{thick}");
    assert!(thick.contains("no gripper of the catalogue reaches it"), "{thick}");
}

/// A taper's width is that at the pose, not that of the nearest row of the grid.
#[test]
fn poses_beside_the_rows_of_a_taper_have_widths_of_their_own() {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let slope = 4_f64.to_radians().tan();
    let part = wedge([4_f64.to_radians(); 2]);
    // Approached along the rows: the pads, 20 mm wide, lie across them.
    let pose = |z: f64| Frame {
        rotation: DMat3::from_cols(DVec3::NEG_X, DVec3::Z, DVec3::Y),
        origin: DVec3::new(0.0, 0.0, z),
    };
    let heights = [0.0120, 0.0131, 0.0142, 0.0153, 0.0164];
    let options = ProposeOptions::default()
        .with_curved(Some(true))
        .with_force(Some(FORCE))
        .with_poses(heights.map(pose).to_vec());
    let proposer = Proposer::new(&part, &gripper, &options).unwrap();
    for z in heights {
        let fit = proposer.fit(&pose(z), 0.05).unwrap();
        // The draft is widest below, where the pads end or the part does.
        let wanted = 2.0 * (0.010 - slope * (z - 0.010_f64).max(0.0));
        assert!((fit.gap - wanted).abs() < 1e-7, "{z}: {} {wanted}", fit.gap);
    }
}

/// The way of the jaws along the approach while they open takes none of the places on a taper.
#[test]
fn jaws_on_an_arc_reach_as_much_of_a_taper_as_straight_ones() {
    let arc = gripper::find("robotiq-2f85").unwrap();
    let mut straight = arc.clone();
    assert_ne!(straight.travel, Travel::Parallel);
    straight.travel = Travel::Parallel;
    let parts = [
        ("wedge 2", wedge([2_f64.to_radians(); 2])),
        ("wedge 6", wedge([6_f64.to_radians(); 2])),
        ("cone", lathe([0.015, 0.012], 0.05, 68, false)),
        ("fine cone", lathe([0.015, 0.012], 0.05, 724, false)),
    ];
    let options = ProposeOptions::default()
        .with_curved(Some(true))
        .with_spacing(Some(0.008))
        .with_angle_step(std::f64::consts::FRAC_PI_4)
        .with_edge_angles(false)
        .with_force(Some(80.0));
    for (name, part) in parts {
        let [one, two] = [&arc, &straight].map(|gripper| {
            let mut proposer = Proposer::new(&part, gripper, &options).unwrap();
            let grips: Vec<_> = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
            let leaning = grips.iter().filter(|grip| grip.surfaces.is_some()).count();
            let met = Rejection::PartInterference { body: "fingertip".into() }.name();
            (leaning, proposer.tally().rejections.get(&met).copied().unwrap_or(0))
        });
        assert!(one.0 > 20 && one == two && one.1 == 0, "{name}: {one:?} {two:?}");
    }
}

//! What the options do, on small parts made here.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use gripfast::geometry::patch_area;
use gripfast::gripper::{self, Gripper, Jaw, Jaws};
use gripfast::model::Grip;
use gripfast::part::Part;
use gripfast::propose::{Cone, Ground, ProposeOptions, Proposer, Tally};

/// Prism over a polygon in `(x, y)` (given convexly cut into quads by index), from z = 0 to
/// `height`.
fn prism(outline: &[(f64, f64)], faces: &[[u32; 4]], height: f64) -> Part {
    let count = outline.len() as u32;
    let mut vertices: Vec<DVec3> = outline.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect();
    vertices.extend(outline.iter().map(|&(x, y)| DVec3::new(x, y, height)));
    let mut triangles = Vec::new();
    for &[a, b, c, d] in faces {
        triangles.extend([
            [a, c, b],
            [a, d, c],
            [a + count, b + count, c + count],
            [a + count, c + count, d + count],
        ]);
    }
    for i in 0..count {
        let j = (i + 1) % count;
        triangles.extend([[i, j, j + count], [i, j + count, i + count]]);
    }
    let part = Part::from_triangles("prism", &vertices, &triangles).unwrap();
    assert!(part.health.watertight, "{:?}", part.health);
    part
}

pub(crate) fn cuboid(x: f64, y: f64, z: f64) -> Part {
    prism(&[(0.0, 0.0), (x, 0.0), (x, y), (0.0, y)], &[[0, 1, 2, 3]], z)
}

/// A U: two walls 10 mm thick, 30 mm high above a 10 mm floor, 40 mm apart; 60 mm long in z.
fn channel() -> Part {
    let points = [
        (0.0, 0.0),
        (0.06, 0.0),
        (0.06, 0.04),
        (0.05, 0.04),
        (0.05, 0.01),
        (0.01, 0.01),
        (0.01, 0.04),
        (0.0, 0.04),
    ];
    // The floor's lower edge is divided where the walls meet it, so that the quads share whole
    // edges.
    let outline = [
        points[0],
        (0.01, 0.0),
        (0.05, 0.0),
        points[1],
        points[2],
        points[3],
        points[4],
        points[5],
        points[6],
        points[7],
    ];
    // left wall: 0 1 7 8 9; floor: 1 2 6 7; right wall: 2 3 4 5 6
    let count = outline.len() as u32;
    let mut vertices: Vec<DVec3> = outline.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect();
    vertices.extend(outline.iter().map(|&(x, y)| DVec3::new(x, y, 0.06)));
    let mut triangles = Vec::new();
    for [a, b, c] in
        [[0, 1, 7], [0, 7, 8], [0, 8, 9], [1, 2, 6], [1, 6, 7], [2, 3, 4], [2, 4, 5], [2, 5, 6]]
    {
        triangles.extend([[a, c, b], [a + count, b + count, c + count]]);
    }
    for i in 0..count {
        let j = (i + 1) % count;
        triangles.extend([[i, j, j + count], [i, j + count, i + count]]);
    }
    let part = Part::from_triangles("channel", &vertices, &triangles).unwrap();
    assert!(part.health.watertight, "{:?}", part.health);
    part
}

fn generic() -> Gripper {
    gripper::find("generic").unwrap()
}

fn run(part: &Part, gripper: &Gripper, options: &ProposeOptions) -> (Vec<Grip>, Tally) {
    let mut proposer = Proposer::new(part, gripper, options).unwrap();
    let grips = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    (grips, proposer.tally().clone())
}

#[test]
fn a_box_is_gripped_on_its_three_pairs_and_whole_pads_share_their_contact() {
    let part = cuboid(0.06, 0.04, 0.03);
    let (grips, tally) = run(&part, &generic(), &ProposeOptions::default());
    assert_eq!(tally.pairs, 3);
    for width in [0.06, 0.04, 0.03] {
        assert!(grips.iter().any(|grip| (grip.width - width).abs() < 1e-12), "{width}");
    }
    let whole: Vec<&Grip> = grips
        .iter()
        .filter(|grip| (patch_area(&grip.contact.face_i) - 4e-4).abs() < 1e-15)
        .collect();
    assert!(
        whole.len() > 10 && whole.iter().all(|grip| Arc::ptr_eq(&grip.contact, &whole[0].contact))
    );
    // along an edge the same cut pad is shared too
    let cut: std::collections::HashSet<*const gripfast::model::Contact> =
        grips.iter().map(|grip| Arc::as_ptr(&grip.contact)).collect();
    assert!(cut.len() * 2 < grips.len(), "{} contacts of {} grips", cut.len(), grips.len());
}

#[test]
fn the_answer_does_not_depend_on_threads_or_chunks() {
    let part = channel();
    let gripper = generic();
    let reference = run(&part, &gripper, &ProposeOptions::default());
    assert!(!reference.0.is_empty());
    for (threads, chunk) in [(1, 100), (3, 1), (2, 1_000_000)] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found =
            pool.install(|| run(&part, &gripper, &ProposeOptions::default().with_chunk(chunk)));
        assert_eq!(found.1, reference.1);
        assert_eq!(
            found.1.candidates,
            Proposer::new(&part, &gripper, &ProposeOptions::default()).unwrap().candidates()
        );
        assert!(found == reference, "{threads} threads, chunks of {chunk}");
    }
}

#[test]
fn flips_are_marked_and_not_counted() {
    let part = cuboid(0.06, 0.04, 0.03);
    let (plain, plain_tally) = run(&part, &generic(), &ProposeOptions::default());
    let (both, tally) = run(&part, &generic(), &ProposeOptions::default().with_flips(true));
    assert_eq!(
        (both.len(), tally.grips, tally.candidates),
        (2 * plain.len(), plain_tally.grips, plain_tally.candidates)
    );
    for pair in both.chunks(2) {
        let (grip, flip) = (&pair[0], &pair[1]);
        assert_eq!((grip.flip_of, flip.flip_of), (None, Some(grip.id)));
        assert_eq!((grip.face_i, grip.face_ii), (flip.face_ii, flip.face_i));
        assert_eq!(grip.part_from_grip.rotation.x_axis, flip.part_from_grip.rotation.x_axis);
        assert_eq!(grip.part_from_grip.rotation.z_axis, -flip.part_from_grip.rotation.z_axis);
        assert!(
            (patch_area(&grip.contact.face_i) - patch_area(&flip.contact.face_ii)).abs() < 1e-15
        );
        // The same point of the part lies in both contacts.
        for (polygon, mirrored) in grip.contact.face_i.iter().zip(&flip.contact.face_ii) {
            let part_point =
                |frame: &gripfast::model::Frame, point: DVec2, z: f64| frame.point(point.extend(z));
            let a = part_point(&grip.part_from_grip, polygon.outer[0], grip.width / 2.0);
            assert!(mirrored.outer.iter().any(|&point| {
                part_point(&flip.part_from_grip, point, -grip.width / 2.0).distance(a) < 1e-12
            }));
        }
    }
}

#[test]
fn an_unsymmetric_palm_makes_both_orientations_candidates() {
    let part = cuboid(0.06, 0.04, 0.03);
    let mut gripper = generic();
    // A camera beside the palm, as far forward as the fingertips, on the side of jaw I.
    let mut camera = gripper.palm[0].clone();
    camera.name = "camera".into();
    camera.shape = gripper::Shape::Box { half: DVec3::new(0.05, 0.01, 0.01) };
    camera.grip_from_body.origin = DVec3::new(-0.04, 0.0, 0.045);
    gripper.palm.push(camera);
    assert!(!gripper.is_symmetric());
    let (grips, tally) = run(&part, &gripper, &ProposeOptions::default());
    let (plain, plain_tally) = run(&part, &generic(), &ProposeOptions::default());
    assert_eq!(tally.candidates, 2 * plain_tally.candidates);
    assert!(tally.grips <= plain_tally.grips && grips.len() <= 2 * plain.len());
    assert!(grips.iter().any(|grip| grip.flip_of.is_some()));
    let flips_known = grips
        .iter()
        .filter_map(|grip| grip.flip_of)
        .all(|id| grips.iter().any(|grip| grip.id == id));
    assert!(flips_known);
}

#[test]
fn filters_reject_with_their_reason() {
    let part = cuboid(0.06, 0.04, 0.03);
    let gripper = generic();
    let with = |change: &dyn Fn(&mut ProposeOptions)| {
        let mut options = ProposeOptions::default();
        change(&mut options);
        run(&part, &gripper, &options)
    };
    let (all, all_tally) = with(&|_| {});
    // Approach from above only: towards -z within 20 degrees.
    let (grips, tally) = with(&|options| {
        options.approach_cone = Some(Cone { axis: DVec3::NEG_Z * 3.0, half_angle: 0.35 })
    });
    assert!(
        !grips.is_empty() && grips.iter().all(|grip| grip.part_from_grip.rotation.x_axis.z < -0.93)
    );
    assert!(tally.rejections["approach_outside_cone"] > 0);
    // Standing on the ground z = 0: the fingertips may not reach below it.
    let (grips, tally) =
        with(&|options| options.ground = Some(Ground { normal: DVec3::Z * 2.0, offset: 0.0 }));
    assert!(!grips.is_empty() && grips.len() < all.len());
    for grip in &grips {
        for body in
            gripper.finger(Jaw::I, grip.width).iter().chain(&gripper.finger(Jaw::II, grip.width))
        {
            let down = grip.part_from_grip.rotation.transpose() * DVec3::NEG_Z;
            assert!(grip.part_from_grip.point(body.support_point(down)).z > -1e-5);
        }
    }
    assert!(tally.rejections.keys().any(|name| name.starts_with("ground:")));
    // A wall on one side.
    let wall = [DVec3::new(-1.0, -1.0, -1.0), DVec3::new(-0.005, 1.0, 1.0)];
    let (grips, tally) = with(&|options| options.keep_out = vec![wall]);
    assert!(
        !grips.is_empty()
            && grips.len() < all.len()
            && tally.rejections.keys().any(|name| name.starts_with("keep_out:"))
    );
    assert!(
        grips.iter().all(|grip| grip.part_from_grip.rotation.x_axis.x < 0.5),
        "nothing comes through the wall"
    );
    // Near the centre of mass.
    let (grips, tally) = with(&|options| options.max_offset = Some(0.01));
    assert!(
        !grips.is_empty()
            && grips.iter().all(|grip| grip
                .part_from_grip
                .origin
                .distance(DVec3::new(0.03, 0.02, 0.015))
                <= 0.01)
    );
    assert!(tally.rejections["too_far_from_centre_of_mass"] > 0);
    // Chosen faces.
    let (grips, tally) = with(&|options| options.faces = Some(vec![0, 1]));
    assert!(!grips.is_empty() && grips.iter().all(|grip| grip.face_i.max(grip.face_ii) <= 1));
    assert_eq!((tally.pairs, tally.rejections["face_pair_not_chosen"]), (1, 2));
    // Chosen by a box: the three faces on the side of the origin are not wholly in it, the top and
    // the far ones are.
    let upper = [DVec3::new(0.0, 0.0, 0.03), DVec3::new(0.06, 0.04, 0.03)];
    let lower = [DVec3::new(0.0, 0.0, -0.01), DVec3::new(0.06, 0.04, 0.01)];
    let (grips, tally) = with(&|options| options.faces_in = vec![upper, lower]);
    assert!(
        !grips.is_empty()
            && grips.iter().all(|grip| grip.part_from_grip.rotation.z_axis.z.abs() > 0.999)
    );
    assert_eq!((tally.pairs, tally.rejections["face_pair_not_chosen"]), (1, 2));
    let top = part.faces.iter().find(|face| face.normal.z > 0.5).unwrap().id;
    let (by_both, _) =
        with(&|options| (options.faces, options.faces_in) = (Some(vec![top]), vec![lower]));
    assert_eq!(by_both, grips, "faces by number and faces by box add up");
    // A pair needs both.
    let (grips, tally_of_one) = with(&|options| options.faces = Some(vec![top]));
    assert_eq!((grips.len(), tally_of_one.pairs), (0, 0));
    assert_eq!(tally_of_one.rejections["face_pair_not_chosen"], 3);
    // Every candidate is accounted for.
    for tally in [tally, all_tally] {
        let rejected: u64 = tally
            .rejections
            .iter()
            .filter(|(name, _)| !name.starts_with("face_pair"))
            .map(|(_, count)| count)
            .sum();
        assert_eq!(rejected + tally.grips, tally.candidates);
    }
}

#[test]
fn a_part_beyond_the_stroke_says_so() {
    let part = cuboid(0.2, 0.3, 0.4);
    let (grips, tally) = run(&part, &generic(), &ProposeOptions::default());
    assert!(grips.is_empty());
    assert_eq!(
        (tally.pairs, tally.candidates, tally.rejections["face_pair_outside_stroke"]),
        (0, 0, 3)
    );
}

#[test]
fn a_part_too_near_the_end_of_the_stroke_says_so() {
    let (gripper, options) = (generic(), ProposeOptions::default());
    let remarks = |width: f64| {
        let (grips, tally) = run(&cuboid(width, 0.3, 0.4), &gripper, &options);
        (grips.len(), tally.remarks(&gripper, &options).concat())
    };
    let (grips, text) = remarks(gripper.stroke[1] - options.min_opening);
    assert!(grips == 0 && text.contains("opens by less than the least opening"), "{text}");
    let (grips, text) = remarks(gripper.stroke[1] - 3.0 * options.min_opening);
    assert!(grips > 0 && !text.contains("least opening"), "{text}");
}

#[test]
fn bad_options_are_refused() {
    let part = cuboid(0.06, 0.04, 0.03);
    let gripper = generic();
    let changes: [&dyn Fn(&mut ProposeOptions); 13] = [
        &|options| options.outside = false,
        &|options| options.faces_in = vec![[DVec3::splat(0.1), DVec3::splat(0.2)]],
        &|options| options.spacing = Some(1e-7),
        &|options| options.faces = Some(vec![0, 6]),
        &|options| options.spacing = Some(0.0),
        &|options| options.spacing = Some(f64::NAN),
        &|options| options.angle_step = 0.0,
        &|options| options.angle_step = 1e-9,
        &|options| options.min_contact = 1.5,
        &|options| options.clearance = -1.0,
        &|options| options.keep_out = vec![[DVec3::ONE, DVec3::ZERO]],
        &|options| options.ground = Some(Ground { normal: DVec3::ZERO, offset: 0.0 }),
        &|options| options.inside = true,
    ];
    for (number, change) in changes.iter().enumerate() {
        let mut options = ProposeOptions::default();
        change(&mut options);
        let mut gripper = gripper.clone();
        gripper.outer_pad = None;
        assert!(Proposer::new(&part, &gripper, &options).is_err(), "{number}");
    }
}

#[test]
fn inside_grips_open_into_the_channel() {
    let part = channel();
    let gripper = generic();
    let options = ProposeOptions::default().with_outside(false).with_inside(true);
    let (grips, tally) = run(&part, &gripper, &options);
    assert_eq!(tally.pairs, 1, "{tally:?}");
    assert!(!grips.is_empty(), "{tally:?}");
    let outer = gripper.outer_pad.unwrap();
    for grip in &grips {
        assert!(grip.inside && (grip.width - 0.04).abs() < 1e-9);
        let (face_i, face_ii) =
            (&part.faces[grip.face_i as usize], &part.faces[grip.face_ii as usize]);
        // The jaw pushes face I along -x3, so the face looks along +x3; it lies at x3 = -width/2.
        let z = grip.part_from_grip.rotation.z_axis;
        assert!(face_i.normal.dot(z) > 0.999_999 && face_ii.normal.dot(z) < -0.999_999);
        let height =
            |face: &gripfast::part::PlanarFace| grip.part_from_grip.point_inverse(face.centroid).z;
        assert!((height(face_i) + 0.02).abs() < 1e-9 && (height(face_ii) - 0.02).abs() < 1e-9);
        // No corner of a fingertip is in a wall or in the floor.
        for body in gripper
            .finger(Jaw::I, 0.04 - 2.0 * outer)
            .iter()
            .chain(&gripper.finger(Jaw::II, 0.04 - 2.0 * outer))
        {
            for k in 0..8 {
                let sign = |bit: i32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
                let point = grip.part_from_grip.point(body.support_point(DVec3::new(
                    sign(0),
                    sign(1),
                    sign(2),
                )));
                let in_z = (1e-5..0.06 - 1e-5).contains(&point.z);
                let in_wall = point.y > 1e-5
                    && point.y < 0.04 - 1e-5
                    && ((1e-5..0.01 - 1e-5).contains(&point.x)
                        || (0.05 + 1e-5..0.06 - 1e-5).contains(&point.x));
                let in_floor = point.y > 1e-5
                    && point.y < 0.01 - 1e-5
                    && (1e-5..0.06 - 1e-5).contains(&point.x);
                assert!(!(in_z && (in_wall || in_floor)), "{} at {point}", body.name);
            }
        }
    }
    // Outside grips of the same part are none of these.
    let (outside, _) = run(&part, &gripper, &ProposeOptions::default());
    assert!(outside.iter().all(|grip| !grip.inside));
}

#[test]
fn explanations_agree_with_the_run() {
    let part = channel();
    let gripper = generic();
    let options = ProposeOptions::default()
        .with_ground(Some(Ground { normal: DVec3::Y, offset: -0.02 }))
        .with_max_offset(Some(0.05));
    let mut proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let grips: std::collections::HashMap<u64, Grip> =
        proposer.by_ref().flat_map(|chunk| chunk.grips).map(|grip| (grip.id, grip)).collect();
    let mut counts = std::collections::BTreeMap::<String, u64>::new();
    let mut id = 0;
    // The places of all grids first, then the special ones.
    let sites = proposer.sites();
    let both = sites.iter().map(|site| (site, false)).chain(sites.iter().map(|site| (site, true)));
    for (site, special) in both {
        for (&angle, own) in site.angles.iter().zip(&site.special) {
            for &position in if special { own } else { &site.positions } {
                let explanation =
                    proposer.explain(site.site, position, angle, Jaws::Straight).unwrap();
                assert_eq!(
                    explanation.rejection.is_none(),
                    grips.contains_key(&id),
                    "{id}: {explanation:?}"
                );
                assert_eq!(
                    explanation.rejection.is_none(),
                    explanation.checks.iter().all(|check| check.passed)
                );
                if let Some(reason) = &explanation.rejection {
                    *counts.entry(reason.name()).or_default() += 1;
                    let met = explanation
                        .checks
                        .iter()
                        .any(|check| check.detail.contains("meets the part"));
                    assert_eq!(met, explanation.place.is_some());
                } else {
                    assert_eq!(explanation.part_from_grip, grips[&id].part_from_grip);
                    assert!(
                        (patch_area(&explanation.contact.face_i)
                            - patch_area(&grips[&id].contact.face_i))
                        .abs()
                            < 1e-15
                    );
                }
                id += 1;
            }
        }
    }
    assert_eq!(id, proposer.candidates());
    assert_eq!(
        counts,
        proposer
            .tally()
            .rejections
            .iter()
            .filter(|(name, _)| !name.starts_with("face_pair"))
            .map(|(name, count)| (name.clone(), *count))
            .collect()
    );
    // From a result: the pose itself.
    for grip in grips.values().take(50) {
        let explanation =
            proposer.explain_pose(grip.face_i, grip.face_ii, &grip.part_from_grip).unwrap();
        assert!(
            explanation.rejection.is_none()
                && (explanation.part_from_grip.origin - grip.part_from_grip.origin).length()
                    < 1e-12
        );
        let mut flipped = grip.part_from_grip;
        flipped.rotation *= gripper::half_turn();
        let explanation = proposer.explain_pose(grip.face_ii, grip.face_i, &flipped).unwrap();
        assert!(
            explanation.rejection.is_none()
                && (explanation.part_from_grip.rotation - flipped.rotation)
                    .to_cols_array()
                    .iter()
                    .all(|x| x.abs() < 1e-12)
        );
    }
    let beside = proposer.explain(0, DVec2::splat(1.0), 0.3, Jaws::Straight).unwrap();
    assert!(beside.rejection.is_some());
    assert!(
        !beside
            .checks
            .iter()
            .filter(|check| check.name.starts_with("contact"))
            .any(|check| check.passed)
    );
    assert!(proposer.explain(99, DVec2::ZERO, 0.0, Jaws::Straight).is_err());
    assert!(proposer.explain(0, DVec2::NAN, 0.0, Jaws::Straight).is_err());
    assert!(proposer.explain_pose(0, 0, &gripfast::model::Frame::IDENTITY).is_err());
}

//! Grips on faces of free form: ellipsoids, prisms over smooth outlines, bottles, blends.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use glam::{DMat3, DVec2, DVec3};
use gripfast::gripper;
use gripfast::model::{Gap, Grip, LoadCase, Wrench};
use gripfast::part::{Part, Shape};
use gripfast::plan::Plan;
use gripfast::propose::{ProposeOptions, Proposer};
use gripfast::request::{Choice, Request};
use gripfast::units::{Force, Length, Mass};

use crate::support::lathe::{Mesh, lathe};

fn ellipsoid(half: DVec3, around: u32, rows: u32) -> Mesh {
    let step = PI / f64::from(rows + 1);
    let ends = [DVec3::NEG_Z * half.z, DVec3::Z * half.z];
    lathe(around, rows, ends, |turn, row| {
        let rise = step * (row + 1.0) - 0.5 * PI;
        half * (DVec2::from_angle(turn) * rise.cos()).extend(rise.sin())
    })
}

fn prism(length: f64, around: u32, at: impl Fn(f64) -> DVec2) -> Mesh {
    let ends = [DVec3::ZERO, DVec3::Z * length];
    lathe(around, 2, ends, |turn, row| at(turn).extend(row * length))
}

fn part((vertices, triangles): &Mesh) -> Part {
    Part::from_triangles("part", vertices, triangles).unwrap()
}

fn turned((vertices, triangles): &Mesh, turn: DMat3, shift: DVec3) -> Part {
    let vertices: Vec<DVec3> = vertices.iter().map(|vertex| turn * *vertex + shift).collect();
    Part::from_triangles("part", &vertices, triangles).unwrap()
}

fn options() -> ProposeOptions {
    ProposeOptions::default().with_spacing(Some(0.008))
}

fn grips(part: &Part, options: &ProposeOptions) -> (Vec<Grip>, BTreeMap<String, u64>) {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let mut proposer = Proposer::new(part, &gripper, options).unwrap();
    let grips = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    (grips, proposer.tally().rejections.clone())
}

/// The closing direction in the part frame.
fn closing(grip: &Grip) -> DVec3 {
    grip.part_from_grip.rotation.z_axis
}

fn radii(grip: &Grip) -> Option<[f64; 2]> {
    match grip.surfaces.as_ref()?.face_i.first()?.gap {
        Gap::Barrel { radius, meridian, .. } => Some([radius, meridian]),
        Gap::Cylinder { radius, .. } => Some([radius, f64::INFINITY]),
        _ => None,
    }
}

const HALF: DVec3 = DVec3::new(0.010, 0.015, 0.022);

#[test]
fn an_ellipsoid_is_gripped_along_its_shortest_axis() {
    for (around, rows) in [(32, 19), (48, 31), (96, 63)] {
        let part = part(&ellipsoid(HALF, around, rows));
        assert_eq!((part.faces.len(), part.curved.len()), (0, 1));
        assert_eq!(part.curved[0].shape, Shape::Freeform);
        assert!(part.curved[0].outside && part.curved[0].id == 0);
        let (grips, _) = grips(&part, &options());
        assert!(grips.len() >= 20, "{around}: {}", grips.len());
        for grip in &grips {
            // About the others it is held in the narrow way round its ends, and rolls.
            assert!(closing(grip).cross(DVec3::X).length() < 1e-4, "{}", closing(grip));
            assert!((grip.width / (2.0 * HALF.x) - 1.0).abs() < 2e-3, "{}", grip.width);
            let [across, along] = radii(grip).unwrap();
            // Radii of the principal curvatures at the end of an axis: b^2/a and c^2/a.
            assert!((across / (HALF.y * HALF.y / HALF.x) - 1.0).abs() < 0.07, "{across}");
            assert!((along / (HALF.z * HALF.z / HALF.x) - 1.0).abs() < 0.07, "{along}");
            assert_eq!((grip.face_i, grip.face_ii), (0, 0));
        }
    }
}

/// A flat of 3 mm at one end of the long axis is smaller than what a pad presses there: the part rolls
/// over it.
#[test]
fn a_small_flat_on_an_ellipsoid_gives_no_grip_along_its_long_axis() {
    for cut in [2e-5, 1e-4, 4e-4] {
        let (mut vertices, triangles) = ellipsoid(HALF, 96, 95);
        vertices.iter_mut().for_each(|vertex| vertex.z = vertex.z.min(HALF.z - cut));
        let part = part(&(vertices, triangles));
        assert!(part.curved.len() == 1 && part.curved[0].shape == Shape::Freeform);
        let (grips, rejections) = grips(&part, &options());
        assert!(grips.len() >= 20, "{cut}: {}", grips.len());
        assert!(grips.iter().all(|grip| closing(grip).cross(DVec3::X).length() < 1e-4), "{cut}");
        let rolls = rejections.get("face_pair_rolls_apart");
        assert!(!part.faces.is_empty() && rolls.is_some(), "{cut}: {rejections:?}");
    }
}

#[test]
fn an_ellipsoid_that_only_its_longer_axes_fit_rolls() {
    // 100 mm across its shortest axis: the other two are longer still.
    let wide = part(&ellipsoid(5.0 * HALF, 48, 31));
    let (found, rejections) = grips(&wide, &options());
    assert!(found.is_empty());
    assert_eq!(rejections.keys().collect::<Vec<_>>(), ["face_pair_outside_stroke"]);
    let middle = part(&ellipsoid(DVec3::new(0.044, 0.0405, 0.038), 48, 31));
    assert!(grips(&middle, &options()).0.iter().all(|grip| (grip.width - 0.076).abs() < 2e-4));
}

#[test]
fn turned_in_space_it_has_the_same_grips() {
    let mesh = ellipsoid(HALF, 48, 31);
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 1.1);
    let shift = DVec3::new(0.1, -0.2, 0.05);
    let (one, _) = grips(&part(&mesh), &options());
    let (other, _) = grips(&turned(&mesh, turn, shift), &options());
    // Which of the outermost places are too far off is asked of a grid in the part's axes.
    let inner = |place: DVec3| place.length() < 0.012;
    let count = one.iter().filter(|grip| inner(grip.part_from_grip.origin)).count();
    let placed = other.iter().map(|grip| {
        let origin = turn.transpose() * (grip.part_from_grip.origin - shift);
        (grip, origin)
    });
    let placed: Vec<(&Grip, DVec3)> = placed.filter(|(_, origin)| inner(*origin)).collect();
    assert!(count >= 20 && placed.len() == count, "{count} {}", placed.len());
    for (grip, origin) in placed {
        let approach = turn.transpose() * grip.part_from_grip.rotation.x_axis;
        let same = one.iter().any(|known| {
            (known.part_from_grip.rotation.x_axis - approach).length() < 1e-3
                && known.part_from_grip.origin.distance(origin) < 2e-6
                && (known.width - grip.width).abs() < 1e-7
        });
        assert!(same, "{approach} {origin}");
    }
}

fn best(part: Part, loads: &[LoadCase]) -> f64 {
    let mut request = Request::new("", "robotiq-2f85");
    request.mass = Some(Mass(0.05));
    request.force = Some(Force(60.0));
    request.candidates.spacing = Some(Length(0.010));
    request.scoring.backend = Choice::Cpu;
    let plan = Plan::builder(request).part(part).loads(loads.to_vec()).build().unwrap();
    let set = plan.run(&mut (), &AtomicBool::new(false)).unwrap().set;
    // Off the middle an edge of a pad may cut the contact, and its pressure pushes sideways.
    let middle = set.grips.iter().filter(|one| one.grip.part_from_grip.origin.length() < 1e-6);
    middle.map(|one| one.worst.mu_s.unwrap()).reduce(f64::min).unwrap()
}

#[test]
fn a_finer_tessellation_needs_as_much_friction() {
    let wrench = |force: DVec3, moment: DVec3| LoadCase {
        name: "load".into(),
        wrench: Wrench { force, moment },
    };
    // Across the closing axis and through the middle: F/(2 N).
    let force = [wrench(DVec3::new(0.0, 5.0, 7.0), DVec3::ZERO)];
    let both = [wrench(DVec3::new(0.0, 5.0, 7.0), DVec3::new(0.03, 0.02, 0.0))];
    let mut found = Vec::new();
    for (around, rows) in [(32, 19), (48, 31), (96, 63)] {
        let mesh = ellipsoid(HALF, around, rows);
        let mu = best(part(&mesh), &force);
        assert!((mu / (74.0_f64.sqrt() / 120.0) - 1.0).abs() < 1e-6, "{around}: {mu}");
        found.push(best(part(&mesh), &both));
    }
    let finest = found[2];
    assert!(found.iter().all(|mu| (mu / finest - 1.0).abs() < 0.01), "{found:?}");
}

#[test]
fn an_oval_prism_is_gripped_across_its_thin_side() {
    let (a, b, length) = (0.020, 0.014, 0.050);
    let mesh = prism(length, 72, |turn| DVec2::new(a * turn.cos(), b * turn.sin()));
    let part = part(&mesh);
    let kinds: Vec<&str> = part.curved.iter().map(|face| face.shape.name()).collect();
    assert_eq!((part.faces.len(), &kinds[..]), (2, &["freeform"][..]));
    let (grips, _) = grips(&part, &options());
    let (round, plane): (Vec<&Grip>, Vec<&Grip>) =
        grips.iter().partition(|grip| grip.surfaces.is_some());
    assert!(!round.is_empty() && !plane.is_empty());
    for grip in &round {
        assert_eq!((grip.face_i, grip.face_ii), (2, 2));
        assert!(closing(grip).cross(DVec3::Y).length() < 1e-4, "{}", closing(grip));
        assert!((grip.width / (2.0 * b) - 1.0).abs() < 1e-3, "{}", grip.width);
        let [across, along] = radii(grip).unwrap();
        assert!((across / (a * a / b) - 1.0).abs() < 0.05 && along == f64::INFINITY, "{across}");
    }
    // From one end to the other: places beyond the middle by a third of the length.
    let along = round.iter().map(|grip| (grip.part_from_grip.origin.z - 0.5 * length).abs());
    assert!(along.fold(0.0, f64::max) > length / 3.0);
    // Those between the ends are what they are without it, numbers and all.
    let planes = options().with_curved(Some(false));
    let (without, _) = self::grips(&part, &planes);
    assert_eq!(without.len(), plane.len());
    assert!(without.iter().zip(plane).all(|(one, other)| one == other));
    // And asked for by its number.
    let (own, _) = self::grips(&part, &options().with_faces(Some(vec![2])));
    assert_eq!(own.len(), round.len());
    let (none, _) = self::grips(&part, &options().with_faces(Some(vec![0, 1])));
    assert!(none.iter().all(|grip| grip.surfaces.is_none()));
}

#[test]
fn a_prism_of_constant_width_is_gripped_all_round() {
    // The outline with the support function R + e cos 3t is 2 R wide in every direction.
    let (radius, lobe) = (0.015, 0.0008);
    let mesh = prism(0.05, 96, |turn| {
        let normal = DVec2::from_angle(turn);
        let (height, slope) =
            (radius + lobe * (3.0 * turn).cos(), -3.0 * lobe * (3.0 * turn).sin());
        normal * height + normal.perp() * slope
    });
    let (grips, _) = grips(&part(&mesh), &options());
    let mut turns: Vec<i64> = Vec::new();
    for grip in grips.iter().filter(|grip| grip.surfaces.is_some()) {
        assert!((grip.width / (2.0 * radius) - 1.0).abs() < 2e-3, "{}", grip.width);
        let axis = closing(grip);
        assert!(axis.z.abs() < 5e-4, "{axis}");
        turns.push(axis.y.atan2(axis.x).to_degrees().rem_euclid(180.0).round() as i64);
    }
    turns.sort_unstable();
    turns.dedup();
    assert!(turns.len() >= 9, "{turns:?}");
}

/// At the flat crest of a superellipse no paraboloid stands for the face: its facets do. The two of a
/// strip along the prism are one piece, so that pads along it touch the same.
#[test]
fn strips_of_a_flat_crest_are_one_piece_each() {
    let power = |x: f64| x.abs().powf(2.0 / 3.0).copysign(x);
    let mesh =
        prism(0.05, 96, |turn| DVec2::new(0.020 * power(turn.cos()), 0.014 * power(turn.sin())));
    let (grips, _) = grips(&part(&mesh), &options());
    let over: Vec<&Grip> = grips.iter().filter(|grip| grip.surfaces.is_some()).collect();
    assert!(over.len() >= 100, "{}", over.len());
    let mut most = 0;
    for grip in &over {
        let [across, along] = [DVec3::Y, DVec3::X].map(|axis| closing(grip).dot(axis).abs());
        assert!(across.max(along) > 0.9999, "{}", closing(grip));
        assert!((grip.width / if across > along { 0.028 } else { 0.040 } - 1.0).abs() < 1e-6);
        let surfaces = grip.surfaces.as_ref().unwrap();
        for pieces in [&surfaces.face_i, &surfaces.face_ii] {
            let slopes: Vec<DVec2> = pieces
                .iter()
                .map(|piece| match piece.gap {
                    Gap::Plane { slope, .. } => slope,
                    ref other => panic!("{other:?}"),
                })
                .collect();
            for (k, slope) in slopes.iter().enumerate() {
                assert!(slopes[..k].iter().all(|known| known.distance(*slope) > 1e-6));
            }
            assert!(pieces.iter().all(|piece| piece.holes.is_empty()));
            most = most.max(pieces.len());
        }
    }
    assert!(most >= 4, "{most}");
    // Whichever way strips are cut into triangles.
    let (vertices, mut triangles) = mesh;
    for index in (0..triangles.len() - 1).step_by(2) {
        let [[a, b, c], [_, _, d]] = [triangles[index], triangles[index + 1]];
        if a + 96 == d && b + 96 == c {
            (triangles[index], triangles[index + 1]) = ([a, b, d], [b, c, d]);
        }
    }
    let (others, _) = self::grips(&part(&(vertices, triangles)), &options());
    assert_eq!(others.len(), grips.len());
    let lie = |grip: &Grip| {
        let contact = &grip.contact;
        let area = |patch: &[gripfast::model::Polygon]| gripfast::geometry::patch_area(patch);
        [grip.width, area(&contact.face_i), area(&contact.face_ii)]
    };
    for one in &grips {
        let same = others.iter().any(|other| {
            let [pose, own] = [other, one].map(|grip| &grip.part_from_grip);
            let [a, b] = [lie(one), lie(other)];
            pose.origin.distance(own.origin) < 1e-6
                && (pose.rotation.x_axis - own.rotation.x_axis).length() < 1e-5
                && (0..3).all(|k| (a[k] / b[k] - 1.0).abs() < 1e-5)
        });
        assert!(same, "{:?}", one.part_from_grip);
    }
}

#[test]
fn an_oval_bottle_is_gripped_across_its_body() {
    let row = 0.002;
    let shoulder = |z: f64| {
        let t = ((z - 0.070) / 0.025).clamp(0.0, 1.0);
        1.0 - 0.6 * t * t * (3.0 - 2.0 * t)
    };
    let ends = [DVec3::ZERO, DVec3::Z * 60.0 * row];
    let mesh = lathe(72, 61, ends, |turn, k| {
        let wide = DVec2::new(0.030 * turn.cos(), 0.018 * turn.sin());
        (wide * shoulder(row * k)).extend(row * k)
    });
    let (grips, _) = grips(&part(&mesh), &options());
    let body: Vec<&Grip> = grips.iter().filter(|grip| (grip.width - 0.036).abs() < 1e-4).collect();
    assert!(body.len() >= 40, "{}", body.len());
    assert!(body.iter().all(|grip| closing(grip).cross(DVec3::Y).length() < 1e-3));
    let across = grips.iter().filter(|grip| closing(grip).cross(DVec3::X).length() < 0.1);
    assert_eq!(across.count(), 0, "it rolls about its axis");
}

#[test]
fn a_bulge_is_gripped_against_the_plane_below_it() {
    // A block with a bulge on top, not quite in its middle.
    let size = DVec3::new(0.06, 0.04, 0.02);
    let top = |x: f64, y: f64| {
        let s = (1.0 - (2.0 * x / size.x).powi(2)) * (1.0 - (2.0 * y / size.y).powi(2));
        size.z + 0.008 * s * s * (1.0 + 0.2 * x / 0.03)
    };
    let mesh = crate::support::block::block([36, 24], |level, at| {
        let DVec2 { x, y } = at * size.truncate();
        DVec3::new(x, y, if level == 0 { 0.0 } else { top(x, y) })
    });
    let part = part(&mesh);
    assert!(part.health.watertight, "{:?}", part.health);
    let free = part.curved.iter().find(|face| face.shape == Shape::Freeform).unwrap().id;
    let (found, _) = grips(&part, &options());
    let planes = options().with_curved(Some(false));
    let (without, _) = grips(&part, &planes);
    let (over, others): (Vec<&Grip>, Vec<&Grip>) =
        found.iter().partition(|grip| [grip.face_i, grip.face_ii].contains(&free));
    assert!(without.len() == others.len() && without.iter().zip(others).all(|(a, b)| a == b));
    assert!(!over.is_empty());
    let highest = (0..2000).map(|k| top(1e-6 * f64::from(k), 0.0)).fold(0.0, f64::max);
    for grip in over {
        assert!(closing(grip).cross(DVec3::Z).length() < 1e-9);
        assert!((grip.width - highest).abs() < 1e-4, "{} {highest}", grip.width);
        let plane = if grip.face_i == free { grip.face_ii } else { grip.face_i };
        assert!(part.faces[plane as usize].normal.z < -0.999);
    }
}

#[test]
fn an_egg_is_gripped_about_its_axis() {
    let part = part(&ellipsoid(DVec3::new(0.014, 0.014, 0.020), 48, 31));
    assert!(matches!(part.curved[0].shape, Shape::Revolution { .. }));
    let (grips, _) = grips(&part, &options());
    assert!(grips.len() >= 100, "{}", grips.len());
    for grip in &grips {
        assert!(closing(grip).z.abs() < 1e-3 && (grip.width / 0.028 - 1.0).abs() < 2e-3);
    }
}

/// Lenses between the pads are held about both axes by their roundness alone: loads on them are compared
/// as those on other contacts are.
#[test]
fn comparing_loads_on_lenses_gives_the_worst_one_that_solving_all_of_them_gives() {
    let lens = part(&ellipsoid(DVec3::new(0.010, 0.015, 0.022), 48, 24));
    let egg = part(&ellipsoid(DVec3::new(0.016, 0.022, 0.0225), 48, 24));
    let mut sums = [0; 2];
    for (name, part) in [("lens", &lens), ("nearly round", &egg)] {
        let [solved, all] = crate::curved::screened_as_solved(name, part, 8);
        sums = [sums[0] + solved, sums[1] + all];
    }
    let [solved, all] = sums;
    assert!(2 * solved < all, "{solved} of {all}");
}

/// An oval of 50 x 30 mm drawn up to 60 mm, its foot and shoulder rounded by 5 mm, and this many rings of
/// corners between the ends of the straight wall.
fn drawn(rings: u32) -> Mesh {
    let (radius, steps) = (0.005, 8);
    let arc = |k: u32| DVec2::from_angle(0.5 * PI * f64::from(k) / f64::from(steps)) * radius;
    // Inset of the outline, and height.
    let mut rows: Vec<DVec2> = (0..=steps).rev().map(|k| DVec2::splat(radius) - arc(k)).collect();
    let top: Vec<DVec2> = rows.iter().rev().map(|at| DVec2::new(at.x, 0.060 - at.y)).collect();
    let wall = (1..=rings).map(|k| f64::from(k) / f64::from(rings + 1));
    rows.extend(wall.map(|share| DVec2::new(0.0, radius + share * (0.060 - 2.0 * radius))));
    rows.extend(top);
    let count = rows.len() as u32;
    lathe(48, count, [DVec3::ZERO, DVec3::Z * 0.060], |turn, row| {
        let at = rows[row as usize];
        let e = DVec2::from_angle(turn);
        (e * DVec2::new(0.025 - at.x, 0.015 - at.x)).extend(at.y)
    })
}

/// Long facets are straight where they go on in short ones: no paraboloid bulges between their ends.
#[test]
fn a_drawn_oval_is_gripped_at_its_width_with_many_rings_and_with_none() {
    let mut counts = Vec::new();
    for rings in [0, 3, 9] {
        let part = part(&drawn(rings));
        let (grips, _) = grips(&part, &options().with_curved(Some(true)));
        let across: Vec<&Grip> = grips.iter().filter(|grip| closing(grip).y.abs() > 0.9).collect();
        for grip in &across {
            assert!((grip.width - 0.030).abs() < 1e-4, "{rings}: {}", grip.width);
        }
        assert!(across.len() > 50, "{rings}: {}", across.len());
        counts.push(across.len());
    }
    let [least, most] = [counts.iter().min().unwrap(), counts.iter().max().unwrap()];
    assert!(4 * least > 3 * most, "{counts:?}");
}

/// The bend about the axis of a surface of revolution is known, whatever its profile: a squeeze across it is
/// neutral.
#[test]
fn a_barrel_is_as_round_about_its_axis_as_it_is_wide() {
    for around in [24, 96] {
        // Radius 10 mm at its middle, its meridian of 60 mm.
        let (rows, half) = (13, 0.020);
        let ends = [DVec3::NEG_Z * half, DVec3::Z * half];
        let barrel = lathe(around, rows, ends, |turn, row| {
            let z = half * (2.0 * row / f64::from(rows - 1) - 1.0);
            let radius = 0.010 - 0.060 + (0.060_f64.powi(2) - z * z).sqrt();
            (DVec2::from_angle(turn) * radius).extend(z)
        });
        let part = part(&barrel);
        let (grips, _) = grips(&part, &options().with_curved(Some(true)));
        let across: Vec<&Grip> = grips.iter().filter(|grip| closing(grip).z.abs() < 0.1).collect();
        assert!(across.len() > 20, "{around}: {}", across.len());
        for grip in across {
            assert!((grip.width - 0.020).abs() < 2e-6, "{around}: {}", grip.width);
            let [radius, meridian] = radii(grip).unwrap();
            assert!((radius - 0.010).abs() < 1e-6, "{around}: {radius}");
            assert!((meridian / 0.060 - 1.0).abs() < 0.03, "{around}: {meridian}");
        }
    }
}

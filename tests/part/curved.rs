//! Curved faces of meshes whose truth is known.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};
use gripfast::part::{CurvedFace, Part, Shape};

use crate::solids::{Random, Solid, arc, pose};

fn cylinder(n: u32, radius: f64, length: f64) -> Solid {
    Solid::lathe(&[DVec2::new(0.0, radius), DVec2::new(length, radius)], n, |_| 0.0)
}

/// The only curved face of a part.
fn only(part: &Part, what: &str) -> CurvedFace {
    assert!(part.health.watertight, "{what}: {:?}", part.health.lines());
    let kinds: Vec<&str> = part.curved.iter().map(|face| face.shape.name()).collect();
    assert_eq!(part.curved.len(), 1, "{what}: {kinds:?}");
    assert_eq!(part.curved[0].id as usize, part.faces.len(), "{what}");
    part.curved[0].clone()
}

/// Axis of the lathe in the part frame, along `z`, in metres.
fn axis(seed: u64) -> (DVec3, DVec3) {
    let (turn, shift) = pose(seed);
    (shift * 1e-3, turn * DVec3::Z)
}

#[test]
fn cylinders_of_8_to_360_facets() {
    for n in [8, 9, 10, 12, 13, 14, 15, 16, 17, 20, 24, 36, 48, 64, 90, 128, 180, 360] {
        for radius in [1.0, 3.0, 10.0, 30.0, 100.0] {
            let what = format!("{n} facets, radius {radius}");
            let part = cylinder(n, radius, 1.5 * radius).part(u64::from(n), 0.0);
            let face = only(&part, &what);
            let Shape::Cylinder { axis: found, radius: of_fit, along, turn } = face.shape else {
                panic!("{what}: {:?}", face.shape)
            };
            // Rounding of 32-bit floats, not the chord error.
            assert!((of_fit * 1e3 - radius).abs() < 2e-5 * radius, "{what}: {of_fit}");
            let (point, direction) = axis(u64::from(n));
            assert!(found.direction.cross(direction).length() < 1e-5, "{what}");
            assert!(found.distance(point) < 2e-5 * radius * 1e-3, "{what}");
            assert!((along[1] - along[0] - 1.5e-3 * radius).abs() < 1e-5 * radius, "{what}");
            assert_eq!(turn, TAU, "{what}");
            let facets = face.facets.unwrap();
            assert!((facets - f64::from(n)).abs() < 0.05 + 1e-3 * f64::from(n), "{what}: {facets}");
            assert!(face.outside && face.reachable && face.is_doubtful() == (n <= 16), "{what}");
            // Facets under more than 25 degrees stay planes as well: both readings are there.
            let planes = if n <= 14 { n + 2 } else { 2 };
            assert_eq!(part.faces.len() as u32, planes, "{what}");
            assert!((part.face_area(face.id).unwrap() - face.area).abs() == 0.0, "{what}");
        }
    }
}

#[test]
fn a_subdivided_mesh_has_the_faces_of_its_coarse_one() {
    let solid = cylinder(32, 8.0, 30.0);
    let fine = solid.subdivided().subdivided().part(5, 0.0);
    let face = only(&fine, "subdivided");
    let Shape::Cylinder { radius, turn, .. } = face.shape else { panic!("{:?}", face.shape) };
    assert!((radius - 8e-3).abs() < 1e-7 && turn == TAU, "{radius} {turn}");
    assert_eq!(face.triangles.len(), 64 * 16);
}

#[test]
fn arcs_of_30_to_360_degrees_and_bores() {
    for n in [36_u32, 72, 180] {
        for degrees in (30..360).step_by(30) {
            let steps = n * degrees / 360;
            if steps < 4 {
                continue; // three facets between sharp edges may be a bent sheet
            }
            let span = f64::from(degrees).to_radians();
            for radius in [2.0, 40.0] {
                // A slice of a tube, about its middle; the inner arc is a bore.
                let what = format!("{degrees} degrees of {n}, radius {radius}");
                let inner = 0.6 * radius;
                let start = -span / 2.0;
                let mut outline = arc(DVec2::ZERO, radius, start, start + span, steps);
                outline.extend(arc(DVec2::ZERO, inner, start + span, start, steps));
                let part = slice(&outline, radius).part(9, 0.0);
                assert!(part.health.watertight, "{what}");
                assert_eq!(part.faces.len(), 4, "{what}");
                assert_eq!(part.curved.len(), 2, "{what}: {:?}", part.curved.len());
                for (face, (truth, outside)) in
                    part.curved.iter().zip([(radius, true), (inner, false)])
                {
                    let Shape::Cylinder { radius, turn, .. } = face.shape else {
                        panic!("{what}: {:?}", face.shape)
                    };
                    assert!((radius * 1e3 - truth).abs() < 1e-3 * truth, "{what}: {radius}");
                    assert!((turn - span).abs() < 1e-3, "{what}: {turn}");
                    assert_eq!(face.outside, outside, "{what}");
                }
                assert_eq!(part.coaxial_faces().len(), 1, "{what}: one body of revolution");
                assert!(!part.curved[0].is_same_surface(&part.curved[1]), "{what}");
            }
        }
    }
}

/// An outline of an inner and an outer arc with as many points each, between two planes.
fn slice(outline: &[DVec2], height: f64) -> Solid {
    let n = outline.len();
    let mut solid = Solid::default();
    for z in [0.0, height] {
        solid.vertices.extend(outline.iter().map(|point| point.extend(z)));
    }
    let count = n as u32;
    for k in 0..count {
        let next = (k + 1) % count;
        solid.triangles.extend([[k, next, count + next], [k, count + next, count + k]]);
    }
    // Strips across between the arcs.
    for k in 0..count / 2 - 1 {
        let (a, b) = (k, k + 1);
        let (c, d) = (count - 2 - k, count - 1 - k);
        solid.triangles.extend([[a, c, b], [a, d, c]]);
        let up = |k: u32| k + count;
        solid.triangles.extend([[up(a), up(b), up(c)], [up(a), up(c), up(d)]]);
    }
    solid
}

#[test]
fn patches_of_one_shaft_are_one_surface() {
    // Two flats leave two strips of one cylinder.
    let half = 50.0_f64.to_radians();
    let mut outline = arc(DVec2::ZERO, 10.0, -half, half, 20);
    outline.extend(arc(DVec2::ZERO, 10.0, PI - half, PI + half, 20));
    let part = Solid::extrude(&outline, 30.0).part(3, 0.0);
    assert_eq!((part.faces.len(), part.curved.len()), (4, 2));
    let [one, other] = [&part.curved[0], &part.curved[1]];
    assert!(one.is_same_surface(other) && one.is_coaxial(other));
    assert_eq!(part.coaxial_faces(), [[4, 5]]);
    let Shape::Cylinder { turn, .. } = one.shape else { panic!("{:?}", one.shape) };
    assert!((turn - 2.0 * half).abs() < 1e-4);
}

#[test]
fn noise_up_to_the_residual_is_borne_and_told() {
    for (n, noise) in [(24, 1e-4), (24, 5e-4), (48, 3e-4), (90, 1e-4), (90, 5e-4), (180, 2e-4)] {
        for radius in [5.0, 40.0] {
            let what = format!("{n} facets, radius {radius}, noise {noise}");
            let part = cylinder(n, radius, 2.0 * radius).part(11, noise * radius);
            let cylinders: Vec<&CurvedFace> = part
                .curved
                .iter()
                .filter(|face| matches!(face.shape, Shape::Cylinder { .. }))
                .collect();
            assert_eq!(cylinders.len(), 1, "{what}: {}", part.curved.len());
            let Shape::Cylinder { radius: of_fit, turn, .. } = cylinders[0].shape else { panic!() };
            assert!((of_fit * 1e3 - radius).abs() < noise * radius, "{what}: {of_fit}");
            assert_eq!(turn, TAU, "{what}");
            let told = cylinders[0].residual * 1e3 / radius;
            assert!(told > 0.5 * noise && told < 1.8 * noise, "{what}: {told}");
        }
    }
}

#[test]
fn irregular_triangles_of_a_cylinder_are_one_face() {
    // Points at random places of the surface, in a grid of neighbours.
    let (rows, n, radius, length) = (12, 40_u32, 12.0, 40.0);
    let mut random = Random(4);
    let mut solid = Solid::default();
    for row in 0..=rows {
        for k in 0..n {
            let inner = row > 0 && row < rows;
            let shift = if inner { 0.3 * random.next() } else { 0.0 };
            let rise = if inner { 0.3 * random.next() } else { 0.0 };
            let angle = TAU * (f64::from(k) + shift) / f64::from(n);
            let z = length * (f64::from(row) + rise) / f64::from(rows);
            solid.vertices.push((DVec2::from_angle(angle) * radius).extend(z));
        }
    }
    for row in 0..rows as u32 {
        for k in 0..n {
            let (a, b) = (row * n + k, row * n + (k + 1) % n);
            let (c, d) = (b + n, a + n);
            solid.triangles.extend(if random.next() > 0.0 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
        }
    }
    let top = rows as u32 * n;
    for k in 1..n - 1 {
        solid.triangles.extend([[0, k + 1, k], [top, top + k, top + k + 1]]);
    }
    let part = solid.part(8, 0.0);
    let face = only(&part, "irregular");
    let Shape::Cylinder { radius: of_fit, turn, .. } = face.shape else {
        panic!("{:?}", face.shape)
    };
    assert!((of_fit * 1e3 - radius).abs() < 1e-4 && turn == TAU, "{of_fit}");
    assert_eq!(part.faces.len(), 2);
}

#[test]
fn cones_and_stepped_shafts() {
    for (half, n) in [(2.0_f64, 36), (10.0, 24), (30.0, 48), (45.0, 90), (70.0, 64)] {
        let slope = half.to_radians().tan();
        let solid = Solid::lathe(
            &[DVec2::new(0.0, 20.0), DVec2::new(10.0, 20.0 - 10.0 * slope)],
            n,
            |_| 0.0,
        );
        let solid = if 10.0 * slope < 20.0 {
            solid
        } else {
            Solid::lathe(&[DVec2::new(0.0, 20.0), DVec2::new(20.0 / slope, 0.0)], n, |_| 0.0)
        };
        let part = solid.part(2, 0.0);
        let face = only(&part, &format!("half angle {half}"));
        let Shape::Cone { half_angle, along, .. } = face.shape else { panic!("{:?}", face.shape) };
        // One circle and a tip: tilting the axis moves them by its square only.
        let pointed = along[0] < 1e-4; // [m]
        let allowed = if pointed { 0.02 } else { 1e-3 };
        assert!((half_angle.to_degrees() - half).abs() < allowed, "{half}: {half_angle}");
        let allowed = if pointed { 2e-5 } else { 1e-6 };
        assert!((along[1] * half_angle.tan() - 20e-3).abs() < allowed, "{half}: {along:?}");
        assert!(face.outside && face.facets.unwrap().round() == f64::from(n), "{half} {face:?}");
    }
    // Cylinder, shoulder, cylinder, chamfer: all about one axis.
    let profile = [(0.0, 8.0), (20.0, 8.0), (20.0, 12.0), (45.0, 12.0), (47.0, 10.0)];
    let profile: Vec<DVec2> = profile.iter().map(|&(z, r)| DVec2::new(z, r)).collect();
    let part = Solid::lathe(&profile, 40, |_| 0.0).part(6, 0.0);
    let kinds: Vec<&str> = part.curved.iter().map(|face| face.shape.name()).collect();
    assert_eq!(kinds, ["cylinder", "cylinder", "cone"]);
    assert_eq!((part.faces.len(), part.coaxial_faces().len()), (3, 1));
}

/// Rings that fall away from a land, by less than a degree and more: cones, however flat.
#[test]
fn gentle_cones_beside_a_land() {
    for (fall, counts) in [(0.05, &[24, 48][..]), (0.2, &[24, 96]), (0.5, &[24, 96, 360])] {
        for &n in counts {
            let profile = [(0.0, 10.0), (8.0 - fall, 10.0), (8.0, 6.0)];
            let profile = profile.map(|(z, r)| DVec2::new(z, r));
            let part = Solid::lathe(&profile, n, |_| 0.0).part(3, 0.0);
            let what = format!("{fall} mm, {n}");
            let kinds: Vec<&str> = part.curved.iter().map(|face| face.shape.name()).collect();
            assert_eq!(kinds, ["cylinder", "cone"], "{what}");
            let Shape::Cone { half_angle, .. } = part.curved[1].shape else { panic!() };
            assert!((half_angle.tan() / (4.0 / fall) - 1.0).abs() < 1e-3, "{what}: {half_angle}");
            assert_eq!(part.faces.len(), 2, "{what}: {:?}", part.faces);
        }
    }
}

/// Profile of a sphere from pole to pole, or from a circle to a circle.
fn sphere(radius: f64, from: f64, to: f64, steps: u32) -> Vec<DVec2> {
    let mut points = arc(DVec2::ZERO, radius, PI - from, PI - to, steps);
    for point in &mut points {
        if point.y.abs() < 1e-9 * radius {
            point.y = 0.0;
        }
    }
    points
}

#[test]
fn spheres_in_several_tessellations() {
    let mut meshes: Vec<(String, Solid)> = Vec::new();
    for (n, rings) in [(16, 8), (24, 12), (36, 36), (64, 20)] {
        let name = format!("{n} x {rings}");
        meshes.push((name.clone(), Solid::lathe(&sphere(15.0, 0.0, PI, rings), n, |_| 0.0)));
        let twisted = Solid::lathe(&sphere(15.0, 0.0, PI, rings), n, |k| 0.37 * k as f64);
        meshes.push((format!("{name} twisted"), twisted));
        // Plane caps as wide as a ring are facets of the ball.
        let cut = PI / f64::from(rings) / 2.0;
        let capped = Solid::lathe(&sphere(15.0, cut, PI - cut, rings - 1), n, |_| 0.0);
        meshes.push((format!("{name} capped"), capped));
    }
    for (name, solid) in meshes {
        let part = solid.part(13, 0.0);
        let face = only(&part, &name);
        let Shape::Sphere { radius, centre } = face.shape else {
            panic!("{name} {:?}", face.shape)
        };
        assert!((radius - 15e-3).abs() < 1e-7 && centre.distance(axis(13).0) < 1e-7, "{name}");
        assert_eq!(face.triangles.len(), part.mesh.triangles.len(), "{name}");
        assert_eq!(part.faces.len(), 0, "{name}");
    }
    // A ball knob keeps its flat.
    let part = Solid::lathe(&sphere(15.0, 0.6, PI, 30), 48, |_| 0.0).part(1, 0.0);
    let face = only(&part, "knob");
    assert!(matches!(face.shape, Shape::Sphere { .. }) && part.faces.len() == 1);
}

#[test]
fn tori_have_no_plane_in_any_tessellation() {
    for (n, tube) in [(24, 12), (36, 24), (48, 16), (64, 48), (30, 15), (20, 20)] {
        for phase in [0.0, 0.5] {
            // Coarse turned rings are folded too sharply to be smooth.
            for twist in if n >= 36 { &[0.0, 0.5][..] } else { &[0.0] } {
                let what = format!("{n} x {tube}, phase {phase}, twist {twist}");
                let at = |k: u32| TAU * (f64::from(k) + phase) / f64::from(tube);
                let profile: Vec<DVec2> = (0..tube)
                    .map(|k| DVec2::new(0.0, 20.0) + DVec2::from_angle(-at(k)) * 6.0)
                    .collect();
                let profile: Vec<DVec2> = profile.into_iter().rev().collect();
                let part = Solid::ring(&profile, n, |k| *twist * (k % 2) as f64).part(21, 0.0);
                assert_eq!(part.faces.len(), 0, "{what}");
                let face = only(&part, &what);
                let Shape::Torus { major, minor, axis: found } = face.shape else {
                    panic!("{what}: {:?}", face.shape)
                };
                assert!((major - 20e-3).abs() < 1e-6 && (minor - 6e-3).abs() < 1e-6, "{what}");
                assert!(
                    found.direction.cross(axis(21).1).length() < 1e-5 && face.outside,
                    "{what}"
                );
                assert_eq!(face.triangles.len(), part.mesh.triangles.len(), "{what}");
            }
        }
    }
}

#[test]
fn fillets_are_tori_beside_their_cylinder_and_shoulder() {
    // Shaft, fillet in the corner, shoulder, rounded edge, rim.
    let mut profile = vec![DVec2::new(0.0, 8.0)];
    profile.extend(arc(DVec2::new(20.0, 11.0), 3.0, -FRAC_PI_2, 0.0, 8));
    profile.extend(arc(DVec2::new(25.0, 18.0), 2.0, PI, FRAC_PI_2, 6));
    profile.push(DVec2::new(40.0, 20.0));
    let part = Solid::lathe(&profile, 60, |_| 0.0).part(17, 0.0);
    let mut found: Vec<String> = part
        .curved
        .iter()
        .map(|face| match face.shape {
            Shape::Cylinder { radius, .. } => format!("cylinder {:.3}", radius * 1e3),
            Shape::Torus { major, minor, .. } => {
                format!("torus {:.3} {:.3} {}", major * 1e3, minor * 1e3, face.outside)
            }
            _ => face.shape.name().to_string(),
        })
        .collect();
    found.sort();
    let right = [
        "cylinder 20.000",
        "cylinder 8.000",
        "torus 11.000 3.000 false",
        "torus 18.000 2.000 true",
    ];
    assert_eq!(found, right);
    assert_eq!((part.faces.len(), part.coaxial_faces().len()), (3, 1));
}

#[test]
fn a_profile_of_its_own_is_a_surface_of_revolution() {
    // A barrel whose meridian is a parabola.
    let profile: Vec<DVec2> = (0..=24)
        .map(|k| {
            let z = f64::from(k) - 12.0;
            DVec2::new(z, 14.0 - 0.035 * z * z - 0.0012 * z * z * z)
        })
        .collect();
    let part = Solid::lathe(&profile, 50, |_| 0.0).part(19, 0.0);
    let face = only(&part, "barrel");
    let Shape::Revolution { axis: found, along } = face.shape else { panic!("{:?}", face.shape) };
    assert!(found.direction.cross(axis(19).1).length() < 1e-5);
    assert!(found.distance(axis(19).0) < 1e-7 && (along[1] - along[0] - 24e-3).abs() < 1e-6);
}

#[test]
fn the_flat_of_a_shaft_stays_a_plane() {
    for (n, depth) in [(36, 0.4), (64, 0.2), (64, 3.0), (180, 0.05)] {
        let half = (1.0_f64 - depth / 10.0).acos();
        let outline = arc(DVec2::ZERO, 10.0, half, TAU - half, n);
        let part = Solid::extrude(&outline, 40.0).part(7, 0.0);
        let what = format!("{n} {depth}");
        let face = only(&part, &what);
        let Shape::Cylinder { radius, turn, .. } = face.shape else { panic!("{:?}", face.shape) };
        assert!((radius - 10e-3).abs() < 1e-7, "{what}");
        assert!((turn - (TAU - 2.0 * half)).abs() < 1e-4, "{what}: {turn}");
        assert_eq!(part.faces.len(), 3, "{what}");
    }
}

/// What of a convex outline lies below `normal . x = offset`.
fn below(outline: &[DVec2], normal: DVec2, offset: f64) -> Vec<DVec2> {
    let mut kept = Vec::new();
    for (k, &a) in outline.iter().enumerate() {
        let b = outline[(k + 1) % outline.len()];
        let (over_a, over_b) = (normal.dot(a) - offset, normal.dot(b) - offset);
        if over_a <= 0.0 {
            kept.push(a);
        }
        if over_a * over_b < 0.0 {
            kept.push(a.lerp(b, over_a / (over_a - over_b)));
        }
    }
    kept
}

#[test]
fn strips_cut_off_beside_a_flat_belong_to_the_round_face() {
    // A flat cuts the facets of a prism, not the circle: the strips beside it end on chords.
    for (n, phase, offsets) in [
        (64, 0.0, vec![9.0, 9.0]),
        (24, 0.3, vec![8.0]),
        (32, 0.7, vec![9.3, 6.5]),
        (90, 0.45, vec![9.0, 9.9]),
        (48, 0.1, vec![4.0]),
        (200, 0.5, vec![9.5]),
    ] {
        let step = TAU / n as f64;
        let mut outline: Vec<DVec2> =
            (0..n).map(|k| 10.0 * DVec2::from_angle(step * (k as f64 + phase))).collect();
        for (side, offset) in offsets.iter().enumerate() {
            let normal = if side == 0 { DVec2::NEG_Y } else { DVec2::Y };
            outline = below(&outline, normal, *offset);
        }
        let part = Solid::extrude(&outline, 40.0).part(7, 0.0);
        let what = format!("{n} {phase}");
        assert_eq!(part.faces.len(), 2 + offsets.len(), "{what}");
        for face in &part.curved {
            let Shape::Cylinder { radius, .. } = face.shape else { panic!("{:?}", face.shape) };
            assert!((radius - 10e-3).abs() < 1e-7, "{what}");
            assert!(face.residual < 1e-7, "{what}: {}", face.residual);
        }
        let planar: f64 = part.faces.iter().map(|face| face.area).sum();
        let curved: f64 = part.curved.iter().map(|face| face.area).sum();
        let triangles = 0..part.mesh.triangles.len() as u32;
        let all: f64 = triangles
            .map(|triangle| {
                let [a, b, c] = part.mesh.corners(triangle);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum();
        assert!((planar + curved - all).abs() < 1e-9 * all, "{what}");
    }
    // A chamfer as narrow as a strip is none.
    let mut outline = arc(DVec2::ZERO, 10.0, 0.0, PI, 32);
    outline.extend([DVec2::new(-10.2, -0.9), DVec2::new(10.2, -0.9)]);
    let part = Solid::extrude(&outline, 40.0).part(3, 0.0);
    assert_eq!(part.faces.len(), 5);
}

/// A rectangle about the origin with arcs of `radius` about the corners of one of these half sides.
fn rounded_rectangle(half: DVec2, radius: f64, steps: u32) -> Vec<DVec2> {
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
    let arcs = corners.iter().enumerate().flat_map(|(k, &(x, y))| {
        let from = FRAC_PI_2 * k as f64;
        arc(half * DVec2::new(x, y), radius, from, from + FRAC_PI_2, steps)
    });
    arcs.collect()
}

#[test]
fn rounded_boxes_have_their_planes_and_fillets() {
    // Vertical edges rounded: four cylinders between six planes.
    for steps in [3, 4, 8, 16] {
        let outline = rounded_rectangle(DVec2::new(15.0, 9.0), 4.0, steps);
        let part = Solid::extrude(&outline, 20.0).part(23, 0.0);
        assert_eq!((part.curved.len(), part.curved[0].shape.name()), (4, "cylinder"), "{steps}");
        let own = 6 + if steps == 3 { part.faces.len() - 6 } else { 0 };
        assert_eq!(part.faces.len(), own, "{steps}");
        for face in &part.curved {
            let Shape::Cylinder { radius, turn, .. } = face.shape else { panic!() };
            assert!((radius - 4e-3).abs() < 1e-7 && (turn - FRAC_PI_2).abs() < 1e-4, "{steps}");
        }
    }
}

/// Beside the top of the bend a strip of a leg is nearly level with the bend's first row: the legs are whole
/// cylinders all the same.
#[test]
fn bent_tubes_have_their_legs() {
    let (bend, leg, quarter) = (30.0, 30.0, 30.0 * FRAC_PI_2);
    for (n, steps) in [(100, 100), (200, 50), (200, 200)] {
        let what = format!("{n} x {steps}");
        let rows = (0..=steps).map(|k| leg + quarter * f64::from(k) / f64::from(steps));
        let places = std::iter::once(0.0).chain(rows).chain([2.0 * leg + quarter]);
        let profile: Vec<DVec2> = places.map(|s| DVec2::new(s, 10.0)).collect();
        let mut tube = Solid::lathe(&profile, n, |_| 0.0);
        for vertex in &mut tube.vertices {
            let past = vertex.z - leg;
            let angle = (past / bend).clamp(0.0, FRAC_PI_2);
            let (sin, cos) = angle.sin_cos();
            let straight = past - bend * angle;
            let x = (bend + vertex.x) * cos - straight * sin;
            *vertex = DVec3::new(x, vertex.y, (bend + vertex.x) * sin + straight * cos);
        }
        let part = tube.part(31, 0.0);
        let kinds: Vec<&str> = part.curved.iter().map(|face| face.shape.name()).collect();
        assert_eq!(kinds, ["torus", "cylinder", "cylinder"], "{what}");
        assert_eq!(part.faces.len(), 2, "{what}");
        for face in &part.curved[1..] {
            let Shape::Cylinder { radius, turn, .. } = face.shape else { panic!("{what}") };
            assert!((radius - 10e-3).abs() < 1e-7 && turn == TAU, "{what}: {radius} {turn}");
            // Of the prism, and a few facets of the bend that are level with its strips.
            let side = f64::from(n) * 20.0 * (PI / f64::from(n)).sin() * leg;
            assert!((face.area * 1e6 / side - 1.0).abs() < 0.01, "{what}: {}", face.area * 1e6);
        }
    }
}

/// Rounding makes the flats of the plate rough, which says less of its corners than the step itself.
#[test]
fn corners_of_a_plate_are_found_in_coordinates_of_a_micrometre() {
    let outline = rounded_rectangle(DVec2::new(28.0, 18.0), 2.0, 12);
    for seed in [5, 23, 41] {
        let part = Solid::extrude(&outline, 3.0).rounded(seed, 0.0, 1e-3).unmoved();
        assert_eq!((part.faces.len(), part.curved.len()), (6, 4), "{seed}");
        for face in &part.curved {
            let Shape::Cylinder { radius, turn, .. } = face.shape else { panic!("{seed}") };
            assert!((radius - 2e-3).abs() < 5e-6, "{seed}: {radius}");
            assert!((turn - FRAC_PI_2).abs() < 1e-2, "{seed}: {turn}");
        }
    }
}

/// Curved faces of each kind in the exact part, and those that have to be found: the others are
/// narrower than 26 degrees (tips and roots of the gear, corners of the feature block) or pieces of
/// an irregular mesh (chamfers of the nut).
#[test]
fn real_parts_have_the_curved_faces_of_their_cad_models() {
    let Some(parts) = crate::support::reference("parts") else { return };
    let files = [
        ("gen/gen_bearing_608.truth.json", "gen/gen_bearing_608.stl", [4, 0, 12, 8]),
        (
            "gen/gen_flange_slipon_2in150.truth.json",
            "gen/gen_flange_slipon_2in150.stl",
            [11, 0, 0, 3],
        ),
        ("gen/gen_gantryplate_cbeam.truth.json", "gen/gen_gantryplate_cbeam.stl", [43, 0, 0, 0]),
        ("gen/gen_hexnut_M10_simple.truth.json", "gen/gen_hexnut_M10_simple.stl", [1, 0, 0, 0]),
        ("gen/gen_lbracket_openbuilds.truth.json", "gen/gen_lbracket_openbuilds.stl", [4, 0, 0, 0]),
        ("gen/gen_pillowblock_cq.truth.json", "gen/gen_pillowblock_cq.stl", [13, 0, 0, 0]),
        ("gen/gen_pipe_2in_sch40.truth.json", "gen/gen_pipe_2in_sch40.stl", [2, 0, 0, 0]),
        ("gen/gen_plainwasher_M12.truth.json", "gen/gen_plainwasher_M12.stl", [2, 0, 0, 0]),
        ("gen/gen_shaftkey_6x6x40.truth.json", "gen/gen_shaftkey_6x6x40.stl", [2, 0, 0, 0]),
        ("gen/gen_spurgear_m2_z24.truth.json", "gen/gen_spurgear_m2_z24.stl", [50, 0, 0, 0]),
        ("gen/gen_vslot_20x20_100.truth.json", "gen/gen_vslot_20x20_100.stl", [5, 0, 0, 0]),
        (
            "truth/o2ac__02-PANEL.step.truth.json",
            "derived/o2ac__02-PANEL.step__occt_lin0.05_ang0.3.stl",
            [10, 0, 0, 0],
        ),
        (
            "truth/trimesh__featuretype.STEP.truth.json",
            "derived/trimesh__featuretype.STEP__occt_lin0.05_ang0.3.stl",
            [28, 0, 0, 0],
        ),
    ];
    for (truth, mesh, least) in files {
        let truth: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(parts.join(truth)).unwrap()).unwrap();
        let part = Part::read(&parts.join(mesh), &gripfast::part::ReadOptions::default()).unwrap();
        for (kind, least) in ["cylinder", "cone", "sphere", "torus"].iter().zip(least) {
            let found = part.curved.iter().filter(|face| face.shape.name() == *kind).count();
            let exact = truth["surface_kinds"][kind].as_u64().unwrap_or(0) as usize;
            assert!((least..=exact).contains(&found), "{mesh}: {found} of {exact}, a {kind}");
        }
        let (low, high) = part.mesh.bounding_box();
        for face in &part.curved {
            // Exact meshes: nothing but the rounding of the file.
            assert!(face.residual < 2e-6 * (high - low).length(), "{mesh}: {:?}", face.shape);
        }
    }
}

/// All corners of a chamfered cylinder as long as it is wide lie on a sphere.
#[test]
fn a_chamfered_cylinder_is_no_ball() {
    let of = [
        (24, 10.0, 1.0),
        (32, 10.0, 2.0),
        (64, 15.0, 5.0),
        (360, 15.0, 5.0),
        (24, 15.0, 6.0),
        (24, 15.0, 11.0),
        (32, 15.0, 8.0),
        (32, 15.0, 10.0),
        (16, 15.0, 7.0),
        (16, 15.0, 11.0),
    ];
    for (n, radius, chamfer) in of {
        for longer in [0.0, 0.1] {
            let (end, small) = (2.0 * radius + longer, radius - chamfer);
            let profile = [(0.0, small), (chamfer, radius), (end - chamfer, radius), (end, small)];
            let part = Solid::lathe(&profile.map(DVec2::from), n, |_| 0.0).part(3, 0.0);
            let mut kinds: Vec<&str> = part.curved.iter().map(|face| face.shape.name()).collect();
            kinds.sort_unstable();
            let what = format!("{n} facets, chamfer {chamfer}, {longer} longer");
            assert_eq!(kinds, ["cone", "cone", "cylinder"], "{what}");
            assert_eq!(part.faces.len(), 2, "{what}: {:?}", part.faces);
        }
    }
}

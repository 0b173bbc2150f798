//! Proposals on the reference parts, which lie beside the checkout; without them these tests say
//! SKIPPED.

use crate::interference::clip_leaves;
use glam::{DVec2, DVec3};
use gripfast::backend::{Backend, SeedSet};
use gripfast::geometry::{Bounds2, contains, patch_area, ring_area};
use gripfast::gripper::{self, Gripper, Jaw, Shape};
use gripfast::load::LoadSet;
use gripfast::model::Grip;
use gripfast::part::{Part, ReadOptions};
use gripfast::plan::{Assessor, Settings};
use gripfast::propose::{ProposeOptions, Proposer, Tally};
use gripfast::rank::Weights;
use gripfast::results::RankedGrip;

fn shared(file: &str) -> Option<Part> {
    let path = crate::support::root().join("../shared/parts").join(file);
    if path.is_file() {
        return Some(Part::read(&path, &ReadOptions::default()).unwrap());
    }
    eprintln!("SKIPPED: {} is not there", path.display());
    None
}

fn propose(part: &Part, gripper: &Gripper, options: &ProposeOptions) -> (Vec<Grip>, Tally) {
    let mut proposer = Proposer::new(part, gripper, options).unwrap();
    let grips = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    (grips, proposer.tally().clone())
}

/// Winding number of the surface about a point: 1 in the material, 0 outside (Van Oosterom and
/// Strackee 1983).
fn winding(part: &Part, point: DVec3) -> f64 {
    let angle: f64 = (0..part.mesh.triangles.len() as u32)
        .map(|index| {
            let [a, b, c] = part.mesh.corners(index).map(|corner| corner - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            2.0 * a
                .dot(b.cross(c))
                .atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
        })
        .sum();
    angle / (4.0 * std::f64::consts::PI)
}

/// Opposite faces, pads on material all over the contact, nothing of the gripper in the part.
fn assert_sound(part: &Part, gripper: &Gripper, grip: &Grip) {
    let (face_i, face_ii) = (&part.faces[grip.face_i as usize], &part.faces[grip.face_ii as usize]);
    let z = grip.part_from_grip.rotation.z_axis;
    assert!(face_i.normal.dot(z) > 0.99999 && face_ii.normal.dot(z) < -0.99999);
    assert!((grip.part_from_grip.rotation.determinant() - 1.0).abs() < 1e-12);
    let height = |face: &gripfast::part::PlanarFace| {
        (face.offset - face.normal.dot(grip.part_from_grip.origin)).abs()
    };
    assert!(
        (height(face_i) - grip.width / 2.0).abs() < 1e-6
            && (height(face_ii) - grip.width / 2.0).abs() < 1e-6
    );
    let pad = Bounds2::of(&gripper.pad);
    for (patch, sign) in [(&grip.contact.face_i, 1.0), (&grip.contact.face_ii, -1.0)] {
        let area = patch_area(patch);
        assert!(
            area > 0.019 * ring_area(&gripper.pad) && area < ring_area(&gripper.pad) * (1.0 + 1e-9)
        );
        for polygon in patch {
            assert!(
                ring_area(&polygon.outer) > 0.0
                    && polygon.holes.iter().all(|hole| ring_area(hole) < 0.0)
            );
        }
        for index in 0..16 {
            let share = DVec2::new(f64::from(index % 4) + 0.53, f64::from(index / 4) + 0.47) / 4.0;
            let point = pad.min + pad.size() * share;
            let at = |height: f64| {
                grip.part_from_grip.point(point.extend(sign * (grip.width / 2.0 + height)))
            };
            let touched = patch.iter().any(|polygon| contains(polygon, point));
            if touched {
                assert!(winding(part, at(-2e-6)) > 0.5, "no material under the pad");
            }
            assert!(winding(part, at(2e-5)) < 0.5, "the pad is in the material");
        }
    }
    let triangles: Vec<[DVec3; 3]> = (0..part.mesh.triangles.len() as u32)
        .map(|index| {
            part.mesh.corners(index).map(|corner| grip.part_from_grip.point_inverse(corner))
        })
        .collect();
    let mut bodies = gripper.finger(Jaw::I, grip.width);
    bodies.extend(gripper.finger(Jaw::II, grip.width));
    bodies.extend(gripper.palm.iter().cloned());
    for body in bodies {
        assert!(matches!(body.shape, Shape::Box { .. }));
        let [low, high] = body.bounds();
        let margin = DVec3::splat(2e-5);
        assert!(
            !triangles.iter().any(|triangle| clip_leaves(low + margin, high - margin, *triangle)),
            "{} in the part",
            body.name
        );
    }
}

#[test]
fn grips_on_real_parts_look_right() {
    let cases = [
        ("parts/trimesh__plate_holes.STL", "generic", 10_000),
        ("parts/trimesh__plate_holes.STL", "robotiq-2f85", 10_000),
        ("gen/gen_lbracket_openbuilds.stl", "franka", 200),
        ("gen/gen_vslot_20x20_100.stl", "generic", 2000),
        ("gen/gen_hexnut_M10_simple.stl", "generic", 300),
        ("gen/gen_hexnut_M10_simple.stl", "robotiq-2f85", 300),
        ("gen/gen_flange_slipon_2in150.stl", "robotiq-2f140", 100),
    ];
    for (file, name, least) in cases {
        let Some(part) = shared(file) else { return };
        let gripper = gripper::find(name).unwrap();
        let (grips, tally) = propose(&part, &gripper, &ProposeOptions::default());
        println!("{file}, {name}: {} grips, {tally:?}", grips.len());
        assert!(grips.len() >= least, "{file} {name}: {}", grips.len());
        let plane: Vec<&Grip> = grips.iter().filter(|grip| grip.surfaces.is_none()).collect();
        for grip in plane.iter().step_by(1 + plane.len() / 60) {
            assert_sound(&part, &gripper, grip);
        }
        let mut ids: Vec<u64> = grips.iter().map(|grip| grip.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), grips.len());
    }
}

/// Splits every triangle in four at its edges' middles, rounded to 32-bit millimetres as a file
/// would.
fn refined(part: &Part, times: u32) -> Part {
    let mut triangles: Vec<[DVec3; 3]> =
        (0..part.mesh.triangles.len() as u32).map(|index| part.mesh.corners(index)).collect();
    let round = |point: DVec3| (point * 1e3).as_vec3().as_dvec3() * 1e-3;
    for _ in 0..times {
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0].map(round);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let vertices: Vec<DVec3> = triangles.iter().flatten().copied().collect();
    let indices: Vec<[u32; 3]> = (0..triangles.len() as u32)
        .map(|index| [3 * index, 3 * index + 1, 3 * index + 2])
        .collect();
    Part::from_triangles("refined", &vertices, &indices).unwrap()
}

/// Scores of some grips of a part of 300 g, under gravity in 26 directions.
fn scores(part: &Part, gripper: &Gripper, grips: Vec<Grip>) -> Vec<RankedGrip> {
    let mass = part.mass_properties(0.3 / part.mass_properties(1.0).volume);
    let loads = LoadSet::parse("loads", "gravity:26").unwrap().cases(&mass).unwrap();
    let settings =
        Settings::of_force(gripper.force[1] / 4.0).with_pad_friction(gripper.pad_friction);
    Assessor {
        loads: &loads,
        mass,
        settings: &settings,
        backend: &Backend::Cpu,
        seeds: &SeedSet::default(),
    }
    .assess(grips)
    .unwrap()
}

/// The same candidates and grips, positions to 1 um, scores to 1e-6.
fn assert_same_grips(coarse: &Part, fine: &Part) {
    let gripper = gripper::find("generic").unwrap();
    let ((a, tally_a), (b, tally_b)) = (
        propose(coarse, &gripper, &ProposeOptions::default()),
        propose(fine, &gripper, &ProposeOptions::default()),
    );
    let widths = |tally: &Tally| -> Vec<i64> {
        tally.widths_outside.iter().map(|width| (width * 1e12).round() as i64).collect()
    };
    assert_eq!(widths(&tally_a), widths(&tally_b));
    let counts = |tally: Tally| Tally { widths_outside: Vec::new(), ..tally };
    assert_eq!(counts(tally_a), counts(tally_b));
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(&b) {
        assert_eq!((a.id, a.face_i, a.face_ii), (b.id, b.face_i, b.face_ii));
        assert!(
            (a.part_from_grip.origin - b.part_from_grip.origin).length() < 1e-6
                && (a.width - b.width).abs() < 1e-6
        );
        assert!(
            (a.part_from_grip.rotation - b.part_from_grip.rotation)
                .to_cols_array()
                .iter()
                .all(|x| x.abs() < 1e-5)
        );
        assert!(
            (patch_area(&a.contact.face_i) - patch_area(&b.contact.face_i)).abs()
                < 1e-5 * patch_area(&a.contact.face_i)
        );
    }
    let every = |grips: Vec<Grip>| -> Vec<Grip> { grips.into_iter().step_by(17).collect() };
    let (a, b) = (scores(coarse, &gripper, every(a)), scores(fine, &gripper, every(b)));
    let mut held = 0;
    for (a, b) in a.iter().zip(&b) {
        assert_eq!(a.worst.status, b.worst.status, "{}", a.grip.id);
        // Corners of small facets are rounded to single precision: their slopes differ by 3e-5.
        let within = if a.grip.surfaces.is_some() { 1e-4 } else { 1e-6 };
        let near = |a: f64, b: f64| (a - b).abs() <= within * a.abs();
        let [one, other] = [a, b].map(|grip| [grip.alpha, grip.twist_margin]);
        assert!(
            near(one[0], other[0]) && near(one[1], other[1]),
            "{}: {one:?} {other:?}",
            a.grip.id
        );
        if let (Some(mu), Some(other)) = (a.worst.mu_s, b.worst.mu_s) {
            held += 1;
            assert!(
                near(mu, other),
                "grip {}: mu_s {mu} on the coarse mesh, {other} on the fine one",
                a.grip.id
            );
            assert!(near(
                Weights::default().score(mu, a.alpha),
                Weights::default().score(other, b.alpha)
            ));
        }
    }
    assert!(a.len() > 500 && held > a.len() / 2, "{held} of {}", a.len());
}

#[test]
fn a_plate_of_320_thousand_triangles_gives_the_same_grips() {
    let Some(plate) = shared("parts/trimesh__plate_holes.STL") else { return };
    let fine = refined(&plate, 4);
    assert_eq!((plate.mesh.triangles.len(), fine.mesh.triangles.len()), (1252, 320_512));
    assert_same_grips(&plate, &fine);
}

/// `cargo test -p gripfast --test propose parts -- --ignored --nocapture`
#[test]
#[ignore = "1.3 million triangles; run by hand"]
fn a_plate_of_a_million_triangles_gives_the_same_grips() {
    let Some(plate) = shared("parts/trimesh__plate_holes.STL") else { return };
    let fine = refined(&plate, 5);
    println!("{} triangles", fine.mesh.triangles.len());
    assert_same_grips(&plate, &fine);
}

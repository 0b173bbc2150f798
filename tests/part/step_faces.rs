//! Faces of STEP files are what the files state.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use glam::{DMat3, DVec2, DVec3};
use gripfast::part::{CurvedFace, FaceSource, Part, PlanarFace, ReadOptions, Shape};

use crate::solids::pose;
use crate::step_solids::{Outline, Piece, Step, circle, polygon};
use crate::support::reference;

const HERE: (DMat3, DVec3) = (DMat3::IDENTITY, DVec3::ZERO);

fn read(text: &str) -> Part {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("solid.step");
    std::fs::write(&path, text).unwrap();
    let part = Part::read(&path, &ReadOptions::default()).unwrap();
    assert!(part.health.watertight, "{:?}", part.health.lines());
    part
}

/// The part's mesh, written as an STL file in millimetres and read again.
fn through_stl(part: &Part) -> Part {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.stl");
    let mut bytes = vec![0; 80];
    bytes.extend((part.mesh.triangles.len() as u32).to_le_bytes());
    for triangle in 0..part.mesh.triangles.len() as u32 {
        bytes.extend([0; 12]);
        for corner in part.mesh.corners(triangle) {
            let floats = (corner * 1e3).as_vec3().to_array();
            floats.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    std::fs::write(&path, bytes).unwrap();
    Part::read(&path, &ReadOptions::default()).unwrap()
}

fn at(x: f64, y: f64) -> DVec2 {
    DVec2::new(x, y)
}

/// A profile (r, z) with a bore, a plane, a rounded edge, a shaft, a cone, a neck and a curve of its
/// own.
fn profile() -> Outline {
    vec![
        (at(4.0, 0.0), Piece::Line),
        (at(10.0, 0.0), Piece::Arc(at(10.0, 2.0), true)),
        (at(12.0, 2.0), Piece::Line),
        (at(12.0, 20.0), Piece::Line),
        (at(9.0, 26.0), Piece::Arc(at(9.0, 29.0), false)),
        (at(6.0, 29.0), Piece::Spline(at(5.0, 34.0))),
        (at(8.0, 38.0), Piece::Line),
        (at(4.0, 38.0), Piece::Line),
    ]
}

#[test]
fn each_face_has_its_surface_to_the_last_digits_and_split_ones_are_joined() {
    for sectors in [2, 3, 5] {
        for seed in 0..4 {
            let (turn, shift) = if seed == 0 { HERE } else { pose(seed) };
            let part = read(&Step::new((turn, shift)).revolved(&profile(), sectors).text());
            let what = format!("{sectors} sectors, pose {seed}");
            assert!(part.health.warnings.is_empty(), "{what}: {:?}", part.health.warnings);
            let (direction, origin) = (turn * DVec3::Z, shift * 1e-3);
            let one = |kind: &str, outside: bool| -> &CurvedFace {
                let of_kind =
                    |face: &&CurvedFace| face.shape.name() == kind && face.outside == outside;
                let found: Vec<_> = part.curved.iter().filter(of_kind).collect();
                assert_eq!(found.len(), 1, "{what}: {kind}");
                let face = found[0];
                assert_eq!(face.source, FaceSource::File, "{what}: {kind}");
                assert!(face.residual < 1e-11, "{what}: {kind} {}", face.residual);
                let axis = face.shape.axis().unwrap();
                assert!(axis.direction.cross(direction).length() < 1e-9, "{what}: {kind}");
                assert!(axis.distance(origin) < 1e-11, "{what}: {kind}");
                face
            };
            let near = |value: f64, millimetres: f64| {
                assert!((value * 1e3 - millimetres).abs() < 1e-9 * 40.0, "{what}: {value}");
            };
            for (outside, radius, length) in [(true, 12.0, 18.0), (false, 4.0, 38.0)] {
                let face = one("cylinder", outside);
                let Shape::Cylinder { radius: found, along, turn, .. } = face.shape else {
                    panic!()
                };
                near(found, radius);
                near(along[1] - along[0], length);
                assert_eq!(turn, TAU);
                assert!(!face.is_doubtful());
                // The triangles are chords: up to 0.2 rad of the round each.
                let exact = TAU * radius * length * 1e-6;
                assert!(face.area < exact && face.area > exact * 0.997, "{what}: {}", face.area);
            }
            let Shape::Cone { apex, half_angle, along, .. } = one("cone", true).shape else {
                panic!()
            };
            assert!((half_angle - 0.5_f64.atan()).abs() < 1e-9);
            near(apex.distance(origin + direction * 44e-3), 0.0);
            near(along[0], 18.0);
            near(along[1], 24.0);
            for (outside, radii, height) in [(true, [10.0, 2.0], 2.0), (false, [9.0, 3.0], 29.0)] {
                let Shape::Torus { axis, major, minor } = one("torus", outside).shape else {
                    panic!()
                };
                near(major, radii[0]);
                near(minor, radii[1]);
                near((axis.origin - origin).dot(direction), height);
            }
            one("revolution", true);
            assert_eq!(part.curved.len(), 6, "{what}");
            assert_eq!(part.faces.len(), 2, "{what}");
            for face in &part.faces {
                assert_eq!(face.source, FaceSource::File);
                assert!(face.normal.cross(direction).length() < 1e-9, "{what}");
            }
            assert!(part.symmetry().is_some(), "{what}");
        }
    }
}

#[test]
fn balls_cups_and_cones_to_their_tips() {
    // A ball on a cone, and a hollow in it.
    let profile: Outline = vec![
        (at(0.0, 0.0), Piece::Line),
        (at(8.0, 16.0), Piece::Arc(at(0.0, 16.0), true)),
        (at(4.8, 16.0 + 6.4), Piece::Line),
        (at(3.0, 22.4), Piece::Arc(at(0.0, 22.4), false)),
        (at(0.0, 19.4), Piece::Line),
    ];
    for seed in 0..3 {
        let (turn, shift) = pose(seed);
        let part = read(&Step::new((turn, shift)).revolved(&profile, 3).text());
        let place = |z: f64| (turn * (DVec3::Z * z) + shift) * 1e-3;
        let mut spheres = Vec::new();
        for face in &part.curved {
            match face.shape {
                Shape::Sphere { centre, radius } => spheres.push((centre, radius, face.outside)),
                Shape::Cone { apex, half_angle, along, .. } => {
                    assert!(apex.distance(place(0.0)) < 1e-11);
                    assert!((half_angle - 0.5_f64.atan()).abs() < 1e-9 && along[0].abs() < 1e-11);
                }
                _ => panic!("{:?}", face.shape),
            }
        }
        spheres.sort_by(|a, b| a.1.total_cmp(&b.1));
        assert_eq!((part.curved.len(), part.faces.len(), spheres.len()), (3, 1, 2), "{seed}");
        for ((centre, radius, outside), (z, r, out)) in
            spheres.into_iter().zip([(22.4, 3.0, false), (16.0, 8.0, true)])
        {
            assert!(centre.distance(place(z)) < 1e-11 && (radius - r * 1e-3).abs() < 1e-12);
            assert_eq!(outside, out);
        }
    }
}

/// A plate with rounded corners, a bore in three pieces and a slot.
fn plate() -> Vec<Outline> {
    let corner = |x: f64, y: f64| at(25.0 * x, 15.0 * y);
    let mut outer = Vec::new();
    for (k, (x, y)) in [(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)].into_iter().enumerate()
    {
        let from = DVec2::from_angle(-FRAC_PI_2 + FRAC_PI_2 * k as f64);
        outer.push((corner(x, y) + 5.0 * from, Piece::Arc(corner(x, y), true)));
        outer.push((corner(x, y) + 5.0 * from.perp(), Piece::Line));
    }
    let slot = vec![
        (at(8.0, 2.0), Piece::Arc(at(8.0, 0.0), false)),
        (at(8.0, -2.0), Piece::Line),
        (at(2.0, -2.0), Piece::Arc(at(2.0, 0.0), false)),
        (at(2.0, 2.0), Piece::Line),
    ];
    vec![outer, circle(at(-12.0, 0.0), 6.0, 3, false), slot]
}

#[test]
fn a_bore_is_inside_and_a_corner_outside() {
    let part = read(&Step::new(pose(3)).extruded(&plate(), 8.0).text());
    assert_eq!((part.faces.len(), part.curved.len()), (8, 7));
    let mut found = Vec::new();
    for face in &part.curved {
        let Shape::Cylinder { radius, turn, .. } = face.shape else { panic!("{:?}", face.shape) };
        found.push(((radius * 1e3 * 1e6).round() / 1e6, face.outside, turn.to_degrees().round()));
    }
    found.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let slot = (2.0, false, 180.0);
    let corner = (5.0, true, 90.0);
    assert_eq!(found, [slot, slot, corner, corner, corner, corner, (6.0, false, 360.0)]);
}

#[test]
fn the_mesh_alone_gives_the_same_faces_within_its_chords() {
    for text in [
        Step::new(pose(5)).extruded(&plate(), 8.0).text(),
        Step::new(pose(6)).revolved(&profile(), 3).text(),
    ] {
        let exact = read(&text);
        let mesh = through_stl(&exact);
        assert_eq!(exact.faces.len(), mesh.faces.len());
        for (one, other) in exact.faces.iter().zip(&mesh.faces) {
            assert_eq!(other.source, FaceSource::Mesh);
            assert!(one.normal.distance(other.normal) < 1e-5);
            assert!((one.offset - other.offset).abs() < 1e-7);
            assert!((one.area - other.area).abs() < 1e-5 * one.area);
        }
        for one in &exact.curved {
            let alike = |other: &&CurvedFace| {
                other.shape.name() == one.shape.name()
                    && other.outside == one.outside
                    && other.centroid.distance(one.centroid) < 1e-5
            };
            let found: Vec<_> = mesh.curved.iter().filter(alike).collect();
            if one.shape.name() == "revolution" {
                continue;
            }
            assert_eq!(found.len(), 1, "{:?}", one.shape);
            let radii = |face: &CurvedFace| match face.shape {
                Shape::Cylinder { radius, .. } => [radius, 0.0],
                Shape::Cone { half_angle, .. } => [half_angle, 0.0],
                Shape::Torus { major, minor, .. } => [major, minor],
                _ => [0.0; 2],
            };
            for (a, b) in radii(one).iter().zip(radii(found[0])) {
                assert!((a - b).abs() <= 1e-5 * a, "{:?} {:?}", one.shape, found[0].shape);
            }
        }
    }
}

#[test]
fn planes_stay_planes_between_gentle_bends_and_however_small() {
    // Twelve flats, each bent by 5 degrees to the last, and one 30 um wide beside a chamfer.
    let mut points = vec![at(0.0, 0.0)];
    for k in 0..12 {
        let along = DVec2::from_angle((5.0 * f64::from(k)).to_radians());
        points.push(points[points.len() - 1] + 3.0 * along);
    }
    let last = points[points.len() - 1];
    points.extend([last + at(-1.0, 0.03), at(-20.0, 20.03), at(-20.03, 20.03)]);
    let part = read(&Step::new(pose(8)).extruded(&[polygon(&points)], 10.0).text());
    assert_eq!((part.faces.len(), part.curved.len()), (points.len() + 2, 0));
    assert!(part.faces.iter().all(|face| face.source == FaceSource::File));
    let smallest = part.faces.last().unwrap();
    assert!((smallest.area - 0.3e-6).abs() < 1e-12, "{}", smallest.area);
    // The mesh alone shows a round and loses the smallest.
    let mesh = through_stl(&part);
    assert!(mesh.faces.len() < part.faces.len() && !mesh.curved.is_empty());
}

#[test]
fn curves_turned_and_moved_along_are_what_they_make() {
    static LINE: Piece = Piece::Line;
    static EDGE: Piece = Piece::Arc(DVec2::new(10.0, 2.0), true);
    static DOME: Piece = Piece::Arc(DVec2::new(0.0, 20.0), true);
    let swept = Piece::Swept;
    let profile: Outline = vec![
        (at(0.0, 0.0), swept(&LINE)),
        (at(10.0, 0.0), swept(&EDGE)),
        (at(12.0, 2.0), swept(&LINE)),
        (at(12.0, 11.0), swept(&LINE)),
        (at(10.0, 20.0), swept(&DOME)),
        (at(0.0, 30.0), Piece::Line),
    ];
    let part = read(&Step::new(pose(1)).revolved(&profile, 2).text());
    let kinds: Vec<&str> = part.curved.iter().map(|face| face.shape.name()).collect();
    let mut sorted = kinds.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, ["cone", "cylinder", "sphere", "torus"]);
    assert_eq!(part.faces.len(), 1);
    assert!(part.curved.iter().all(|face| face.source == FaceSource::File));

    static CORNER: Piece = Piece::Arc(DVec2::new(8.0, 8.0), true);
    let outline: Outline = vec![
        (at(0.0, 0.0), swept(&LINE)),
        (at(10.0, 0.0), swept(&LINE)),
        (at(10.0, 8.0), swept(&CORNER)),
        (at(8.0, 10.0), swept(&LINE)),
        (at(0.0, 10.0), Piece::Spline(at(-5.0, 5.0))),
    ];
    let part = read(&Step::new(pose(2)).extruded(&[outline], 30.0).text());
    let of_file = |face: &&PlanarFace| face.source == FaceSource::File;
    assert_eq!(part.faces.iter().filter(of_file).count(), 5);
    let rounds: Vec<_> =
        part.curved.iter().filter(|face| face.source == FaceSource::File).collect();
    assert_eq!(rounds.len(), 1);
    let Shape::Cylinder { radius, turn, .. } = rounds[0].shape else { panic!() };
    assert!((radius - 2e-3).abs() < 1e-12 && (turn - 2.0 * FRAC_PI_4).abs() < 1e-9);
}

#[test]
fn what_the_triangles_contradict_is_found_from_them() {
    let mut step = Step::new(HERE);
    step.wrong = 1.2;
    let part = read(&step.revolved(&profile(), 3).text());
    let warnings = part.health.warnings.join("\n");
    assert!(warnings.contains("the surfaces that the file states for 6 faces"), "{warnings}");
    let mut radii = Vec::new();
    for face in part.curved.iter().filter(|face| face.shape.name() == "cylinder") {
        let Shape::Cylinder { radius, .. } = face.shape else { panic!() };
        assert_eq!(face.source, FaceSource::Mesh);
        radii.push((radius * 1e6).round() / 1e3);
    }
    radii.sort_by(f64::total_cmp);
    assert_eq!(radii, [4.0, 12.0]);
}

#[test]
fn facets_meant_as_planes_are_planes_in_step_files_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plate.step");
    std::fs::write(&path, Step::new(HERE).extruded(&plate(), 8.0).text()).unwrap();
    let part = Part::read(&path, &ReadOptions::default().with_faceted(true)).unwrap();
    assert!(part.curved.is_empty() && part.faces.len() > 8 + 7 * 8, "{}", part.faces.len());
    let of_file = |face: &&PlanarFace| face.source == FaceSource::File;
    assert_eq!(part.faces.iter().filter(of_file).count(), 8);
}

#[test]
fn no_plane_and_no_round_of_the_exact_parts_is_lost() {
    let Some(parts) = reference("parts") else { return };
    let mut files = 0;
    for (truths, steps) in [("gen", "gen"), ("truth", "parts")] {
        for entry in std::fs::read_dir(parts.join(truths)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let Some(stem) = name.strip_suffix(".truth.json") else { continue };
            let file = if truths == "gen" { format!("{stem}.step") } else { stem.to_string() };
            let truth: serde_json::Value =
                serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
            let part = Part::read(&parts.join(steps).join(file), &ReadOptions::default()).unwrap();
            files += 1;
            for plane in truth["planar_faces"].as_array().unwrap() {
                if plane["stored_as_bspline"] == true {
                    continue;
                }
                let number = |value: &serde_json::Value| value.as_f64().unwrap();
                let vector = |value: &serde_json::Value| {
                    DVec3::from_array([0, 1, 2].map(|k| number(&value[k])))
                };
                let (normal, offset) = (vector(&plane["normal"]), number(&plane["offset"]));
                let is_it = |face: &&PlanarFace| {
                    face.source == FaceSource::File
                        && face.normal.distance(normal) < 1e-9
                        && (face.offset * 1e3 - offset).abs() < 1e-9 * 100.0
                };
                assert!(part.faces.iter().any(|face| is_it(&face)), "{name}: {plane}");
            }
            // As many kinds of surfaces as the file has; those of one surface are joined.
            for kind in ["cylinder", "cone", "sphere", "torus"] {
                let exact = truth["surface_kinds"][kind].as_u64().unwrap_or(0) as usize;
                let found = part
                    .curved
                    .iter()
                    .filter(|face| face.shape.name() == kind && face.source == FaceSource::File);
                let count = found.count();
                assert!(
                    count <= exact && (count > 0) == (exact > 0),
                    "{name}: {count} of {exact} {kind}"
                );
            }
        }
    }
    assert!(files >= 13, "{files}");
}

//! Planes and round faces fitted to noisy meshes.

use glam::{DVec2, DVec3};
use gripfast::part::{CurvedFace, FaceSource, Part, ReadOptions, Shape};

use crate::solids::{Random, Solid};
use crate::support::root;

fn options(tolerance: f64) -> ReadOptions {
    ReadOptions::default().with_fit(Some(tolerance * 1e-3))
}

/// The mesh of a part with each coordinate moved by up to `noise` [mm], fitted within `tolerance`.
fn noisy(mesh: &Part, noise: f64, tolerance: f64, seed: u64) -> Part {
    let mut random = Random(seed);
    let mut vertices = mesh.mesh.vertices.clone();
    for vertex in &mut vertices {
        *vertex += noise * 1e-3 * DVec3::new(random.next(), random.next(), random.next());
    }
    Part::from_triangles_with("noisy", &vertices, &mesh.mesh.triangles, &options(tolerance))
        .unwrap()
}

fn sample(name: &str) -> Part {
    Part::read(&root().join("data/parts").join(name), &ReadOptions::default()).unwrap()
}

/// Every edge in two, `times` times.
fn fine(part: &Part, times: u32) -> Part {
    let mut solid =
        Solid { vertices: part.mesh.vertices.clone(), triangles: part.mesh.triangles.clone() };
    for _ in 0..times {
        solid = solid.subdivided();
    }
    Part::from_triangles("fine", &solid.vertices, &solid.triangles).unwrap()
}

fn radius(face: &CurvedFace) -> f64 {
    match face.shape {
        Shape::Cylinder { radius, .. } | Shape::Sphere { radius, .. } => radius * 1e3,
        _ => panic!("{:?}", face.shape),
    }
}

/// Points of a face.
fn corners(part: &Part, face: &CurvedFace) -> usize {
    let mut vertices: Vec<u32> =
        face.triangles.iter().flat_map(|&t| part.mesh.triangles[t as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices.len()
}

#[test]
fn a_bracket_has_its_faces_at_any_noise() {
    let coarse = sample("l_bracket.stl");
    let dense = fine(&coarse, 2);
    for (mesh, what) in [(&coarse, "coarse"), (&dense, "dense")] {
        for (seed, noise) in [(1, 0.02), (2, 0.05), (3, 0.1)] {
            let part = noisy(mesh, noise, 3.0 * noise, seed);
            let what = format!("{what}, noise {noise}");
            assert_eq!((part.faces.len(), part.curved.len()), (10, 6), "{what}");
            for face in &part.faces {
                assert_eq!(face.source, FaceSource::Fit);
                // The clean part's plane, as near as noise over the root of the corners lets it be.
                let twin = coarse
                    .faces
                    .iter()
                    .max_by(|a, b| {
                        let near = |f: &gripfast::part::PlanarFace| {
                            f.normal.dot(face.normal) - 20.0 * (f.offset - face.offset).abs()
                        };
                        near(a).total_cmp(&near(b))
                    })
                    .unwrap();
                let at_centre = twin.normal.dot(face.centroid) - twin.offset;
                assert!(at_centre.abs() < 1e-3 * noise, "{what}: {at_centre}");
                assert!((face.area - twin.area).abs() < 0.03 * twin.area + 8e-6, "{what}");
                let fit = face.fit.unwrap();
                assert!(fit.rms < 0.75e-3 * noise && fit.greatest < 3.0e-3 * noise, "{what}");
            }
            let mut radii: Vec<f64> = part.curved.iter().map(radius).collect();
            radii.sort_by(f64::total_cmp);
            // Chords of 32 facets lie 0.5 % inside, and in the dense mesh corners lie on them.
            for (found, exact) in radii.iter().zip([2.75, 2.75, 3.25, 3.25, 3.25, 3.25]) {
                let chord = if mesh.mesh.vertices.len() > 1000 { 0.005 * exact } else { 0.0 };
                assert!((found - exact).abs() < 0.6 * noise + chord, "{what}: {found} of {exact}");
            }
            // What is left is clean: corners lie on the faces, but for those on the line where a plane
            // goes over into a round, which lie between both.
            for face in &part.faces {
                let corners = face.triangles.iter().flat_map(|&t| part.mesh.corners(t));
                let (on, off): (Vec<f64>, Vec<f64>) = corners
                    .map(|corner| (face.normal.dot(corner) - face.offset).abs())
                    .partition(|off| *off < 1e-9);
                assert!(on.len() > off.len() || face.area < 1e-4, "{what}");
                assert!(off.iter().all(|off| *off < 1e-3 * noise), "{what}");
            }
            let told = part.health.warnings.join("\n");
            assert!(told.contains("10 planes and 6 curved faces"), "{told}");
        }
    }
}

#[test]
fn a_radius_is_as_good_as_its_corners_are_many() {
    for (n, rows) in [(24, 1), (48, 4), (96, 10)] {
        let profile: Vec<DVec2> =
            (0..=rows).map(|k| DVec2::new(60.0 * f64::from(k) / f64::from(rows), 10.0)).collect();
        let clean = Solid::lathe(&profile, n, |_| 0.0).part(1, 0.0);
        for (seed, noise) in [(4, 0.02), (5, 0.05), (6, 0.1)] {
            let part = noisy(&clean, noise, 3.0 * noise, seed);
            let what = format!("{n} facets, {rows} rows, noise {noise}");
            assert_eq!((part.faces.len(), part.curved.len()), (2, 1), "{what}");
            let face = &part.curved[0];
            // Even noise has a deviation of noise / sqrt 3; four of the mean's are never met.
            let count = corners(&part, face) as f64;
            let allowed = 4.0 * noise / 3.0_f64.sqrt() / count.sqrt();
            assert!((radius(face) - 10.0).abs() < allowed, "{what}: {}", radius(face));
            let fit = face.fit.unwrap();
            assert!((fit.rms * 1e3 - noise / 3.0_f64.sqrt()).abs() < 0.2 * noise, "{what}");
            assert_eq!(face.residual, fit.greatest);
            // The two ends are a tenth as far off from across as the axis is long.
            let Shape::Cylinder { axis, turn, .. } = face.shape else { panic!() };
            assert_eq!(turn, std::f64::consts::TAU, "{what}");
            let direction = crate::solids::pose(1).0 * DVec3::Z;
            assert!(axis.direction.cross(direction).length() < noise / 10.0, "{what}");
        }
    }
}

#[test]
fn balls_and_bell_shaped_noise() {
    let ball: Vec<DVec2> = (0..=24)
        .map(|k| {
            let angle = std::f64::consts::PI * f64::from(k) / 24.0;
            DVec2::new(-20.0 * angle.cos(), if k % 24 == 0 { 0.0 } else { 20.0 * angle.sin() })
        })
        .collect();
    let part = noisy(&Solid::lathe(&ball, 48, |_| 0.0).part(1, 0.0), 0.05, 0.15, 9);
    assert_eq!((part.faces.len(), part.curved.len()), (0, 1));
    assert!((radius(&part.curved[0]) - 20.0).abs() < 0.01);

    // A third of the tolerance is the deviation: one corner in 370 lies farther off.
    let mut clean = fine(&sample("shaft_key.stl"), 4);
    let mut random = Random(11);
    for vertex in &mut clean.mesh.vertices {
        let mut bell = || (0..12).map(|_| random.next()).sum::<f64>() / 2.0;
        *vertex += 0.05e-3 * DVec3::new(bell(), bell(), bell());
    }
    let mesh = clean.mesh;
    let part =
        Part::from_triangles_with("key", &mesh.vertices, &mesh.triangles, &options(0.15)).unwrap();
    assert_eq!((part.faces.len(), part.curved.len()), (6, 0));
    let total: f64 = part.faces.iter().map(|face| face.area).sum();
    assert!((total - 1312e-6).abs() < 5e-6, "{total}");
    assert!(part.faces.iter().all(|face| face.polygons.len() == 1));
    assert!(part.faces.iter().all(|face| face.polygons[0].holes.is_empty()));
}

#[test]
fn clean_parts_keep_their_faces() {
    for name in ["hex_nut", "pocket_plate", "shaft_key", "spur_gear", "t_slot_bar", "l_bracket"] {
        let clean = sample(&format!("{name}.stl"));
        for tolerance in [0.005, 0.02] {
            let part = Part::read(&clean.file, &options(tolerance)).unwrap();
            let what = format!("{name} within {tolerance}");
            let kinds = |part: &Part| {
                let mut kinds: Vec<String> = part
                    .curved
                    .iter()
                    .map(|face| {
                        format!("{} {} {:.3}", face.shape.name(), face.outside, radius(face))
                    })
                    .collect();
                kinds.sort();
                kinds
            };
            assert_eq!(kinds(&part), kinds(&clean), "{what}");
            // Planes of the gear's flanks may join, larger ones stay.
            let large = |part: &Part| {
                let faces = part.faces.iter().filter(|face| face.area > 20e-6);
                faces.map(|face| (face.area * 1e7).round()).collect::<Vec<f64>>()
            };
            for (found, exact) in large(&part).iter().zip(large(&clean)) {
                assert!((found - exact).abs() <= 0.01 * exact, "{what}: {found} {exact}");
            }
            assert_eq!(large(&part).len(), large(&clean).len(), "{what}");
        }
    }
    let hexagon: Vec<DVec2> = (0..6)
        .map(|k| DVec2::from_angle(std::f64::consts::TAU * f64::from(k) / 6.0) * 8.0)
        .collect();
    let bar = Solid::extrude(&hexagon, 60.0).part(1, 0.0);
    for (noise, tolerance) in [(0.0, 0.01), (0.0, 0.3), (0.05, 0.15), (0.1, 0.3)] {
        let part = noisy(&bar, noise, tolerance, 12);
        assert_eq!((part.faces.len(), part.curved.len()), (8, 0), "{noise} {tolerance}");
    }
}

#[test]
fn a_flat_of_a_shaft_and_walls_of_slots_are_planes() {
    let mut outline: Vec<DVec2> = (0..=52)
        .map(|k| DVec2::from_angle((26.0 + 308.0 / 52.0 * f64::from(k)).to_radians()) * 10.0)
        .collect();
    outline.dedup();
    let clean = Solid::extrude(&outline, 80.0).part(2, 0.0);
    for (seed, noise) in [(7, 0.02), (8, 0.05)] {
        let part = noisy(&clean, noise, 3.0 * noise, seed);
        assert_eq!((part.faces.len(), part.curved.len()), (3, 1), "{noise}");
        assert!((radius(&part.curved[0]) - 10.0).abs() < noise);
    }
    let bar = fine(&sample("t_slot_bar.stl"), 2);
    let part = noisy(&bar, 0.03, 0.09, 5);
    assert_eq!((part.faces.len(), part.curved.len()), (46, 1));
}

#[test]
fn a_tolerance_that_is_none_is_refused() {
    let mesh = sample("shaft_key.stl").mesh;
    for tolerance in [0.0, -1.0, f64::NAN, 5.0] {
        let options = options(tolerance);
        let error = Part::from_triangles_with("key", &mesh.vertices, &mesh.triangles, &options)
            .unwrap_err();
        assert!(error.to_string().contains("2 % of this part's diagonal"), "{error}");
    }
}

#[test]
fn planes_that_crumble_are_told_wherever_they_do() {
    let clean = fine(&sample("l_bracket.stl"), 2);
    assert!(clean.health.warnings.is_empty());
    for share in [0.05, 0.3, 1.0] {
        for noise in [0.02, 0.1] {
            let mut places: Vec<f64> = clean.mesh.vertices.iter().map(|v| v.x).collect();
            places.sort_by(f64::total_cmp);
            let from = places[((1.0 - share) * (places.len() - 1) as f64) as usize];
            let mut random = Random(3);
            let mut vertices = clean.mesh.vertices.clone();
            for vertex in vertices.iter_mut().filter(|vertex| vertex.x >= from) {
                *vertex += noise * 1e-3 * DVec3::new(random.next(), random.next(), random.next());
            }
            let part = Part::from_triangles("half", &vertices, &clean.mesh.triangles).unwrap();
            let told = part.health.warnings.join("\n");
            assert!(told.contains("flat faces are noisy"), "{share} {noise}: {told}");
            // Three times the noise fits, and the one named does.
            let named = told.split("corners within ").nth(1).unwrap().split(' ').next().unwrap();
            let tolerance: f64 = named.parse().unwrap();
            assert!((2.0 * noise..6.0 * noise).contains(&tolerance), "{share} {noise}: {told}");
            let triangles = &clean.mesh.triangles;
            let part = Part::from_triangles_with("half", &vertices, triangles, &options(tolerance))
                .unwrap();
            assert_eq!((part.faces.len(), part.curved.len()), (10, 6), "{share} {noise}");
        }
    }
}

//! Parts whose exact faces, pairs and mass properties are known.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec2, DVec3};
use gripfast::part::{Part, PlanarFace, ReadOptions};
use serde_json::Value;

fn shared() -> Option<PathBuf> {
    let folder = crate::support::root().join("../shared/parts");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: {} is absent", folder.display());
    None
}

#[test]
fn every_mesh_reads() {
    let Some(folder) = shared() else { return };
    let mut read = 0;
    for sub in ["parts", "gen", "derived"] {
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder.join(sub))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        files.sort();
        for file in files {
            let suffix = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            if !["stl", "obj"].contains(&suffix.as_str()) {
                continue;
            }
            let start = std::time::Instant::now();
            let part = Part::read(&file, &ReadOptions::default()).unwrap();
            let pairs = part.pairs(0.0, 0.1);
            println!(
                "{:45} {:6} tri {:5} faces {:5} pairs {:?} {:?}",
                part.name,
                part.mesh.triangles.len(),
                part.faces.len(),
                pairs.len(),
                start.elapsed(),
                part.health.lines()
            );
            read += 1;
        }
    }
    assert!(read >= 30, "{read}");
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| value[axis].as_f64().unwrap()))
}

/// Truth files with the mesh made of the same B-rep; lengths in millimetres.
fn truths(folder: &Path) -> Vec<(Value, PathBuf)> {
    let mut found = Vec::new();
    for sub in ["gen", "truth"] {
        for entry in std::fs::read_dir(folder.join(sub)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let Some(stem) = name.strip_suffix(".truth.json") else { continue };
            let mesh = if sub == "gen" {
                path.with_file_name(format!("{stem}.stl"))
            } else {
                folder.join(format!("derived/{stem}__occt_lin0.05_ang0.3.stl"))
            };
            found.push((
                serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap(),
                mesh,
            ));
        }
    }
    found.sort_by(|a, b| a.1.cmp(&b.1));
    found
}

/// Whether a face lies in the plane: normals within 0.05 degrees, offsets within 2 um.
fn lies_in(face: &PlanarFace, normal: DVec3, offset: f64) -> bool {
    face.normal.dot(normal) > 1.0 - 4e-7 && (face.offset * 1e3 - offset).abs() < 2e-3
}

/// Deflection of the tessellation [mm]: the area between an arc and its chords is below this times
/// the boundary length.
fn deflection(truth: &Value) -> f64 {
    truth["stl"]["linear_tolerance"].as_f64().unwrap_or(0.05)
}

fn boundary_length(face: &PlanarFace) -> f64 {
    let ring = |ring: &Vec<DVec2>| {
        ring.iter().zip(ring.iter().cycle().skip(1)).map(|(a, b)| a.distance(*b)).sum::<f64>()
    };
    face.polygons
        .iter()
        .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes))
        .map(ring)
        .sum()
}

#[test]
fn planar_areas_are_those_of_the_exact_part() {
    let Some(folder) = shared() else { return };
    let mut planes = 0;
    for (truth, mesh) in truths(&folder) {
        let part = Part::read(&mesh, &ReadOptions::default()).unwrap();
        for group in truth["plane_groups"].as_array().unwrap() {
            let (normal, offset, area) = (
                vector(&group["normal"]),
                group["offset"].as_f64().unwrap(),
                group["area"].as_f64().unwrap(),
            );
            let faces: Vec<&PlanarFace> =
                part.faces.iter().filter(|face| lies_in(face, normal, offset)).collect();
            let found = faces.iter().map(|face| face.area * 1e6).sum::<f64>();
            let allowed = deflection(&truth)
                * faces.iter().map(|face| boundary_length(face) * 1e3).sum::<f64>();
            assert!(
                (found - area).abs() <= allowed + 1e-6 * area,
                "{}: plane {normal} {offset}: area {area}, found {found} +- {allowed}",
                part.name
            );
            planes += 1;
        }
    }
    assert!(planes >= 200, "{planes}");
}

#[test]
fn every_antiparallel_pair_is_found() {
    let Some(folder) = shared() else { return };
    let mut checked = 0;
    for (truth, mesh) in truths(&folder) {
        let part = Part::read(&mesh, &ReadOptions::default()).unwrap();
        for (kind, pairs) in
            [("external", part.pairs(0.0, 1.0)), ("internal", part.internal_pairs(0.0, 1.0))]
        {
            // The exact part may cut one plane into more faces than a mesh does: overlaps are
            // summed per pair of planes.
            let mut sums: Vec<(DVec3, f64, f64, f64)> = Vec::new(); // normal, offset, width, overlap
            for pair in
                truth["pairs"].as_array().unwrap().iter().filter(|pair| pair["kind"] == kind)
            {
                let face = &truth["planar_faces"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .find(|face| face["id"] == pair["a"])
                    .unwrap();
                let (mut normal, mut offset, width) = (
                    vector(&face["normal"]),
                    face["offset"].as_f64().unwrap(),
                    pair["width"].as_f64().unwrap(),
                );
                // Either face may be named first: the one whose normal points up in the first axis
                // that tells.
                if normal.to_array().into_iter().find(|x| x.abs() > 1e-6).unwrap() < 0.0 {
                    (normal, offset) = (
                        -normal,
                        if kind == "external" { width - offset } else { -width - offset },
                    );
                }
                let overlap = pair["overlap_area"].as_f64().unwrap();
                match sums.iter_mut().find(|sum| {
                    sum.0.dot(normal) > 1.0 - 4e-7
                        && (sum.1 - offset).abs() < 2e-3
                        && (sum.2 - width).abs() < 2e-3
                }) {
                    Some(sum) => sum.3 += overlap,
                    None => sums.push((normal, offset, width, overlap)),
                }
            }
            for (normal, offset, width, overlap) in sums {
                let (mut found, mut allowed) = (0.0, 1e-6 * overlap);
                for pair in &pairs {
                    let [a, b] = [pair.face_i, pair.face_ii].map(|id| &part.faces[id as usize]);
                    if (pair.width * 1e3 - width).abs() < 2e-3
                        && (lies_in(a, normal, offset) || lies_in(b, normal, offset))
                    {
                        found += pair.overlap_area * 1e6;
                        allowed +=
                            deflection(&truth) * (boundary_length(a) + boundary_length(b)) * 1e3;
                    }
                }
                assert!(
                    (found - overlap).abs() <= allowed,
                    "{} {kind}: {normal} {offset} width {width}: overlap {overlap}, found {found} +- {allowed}",
                    part.name
                );
                checked += 1;
            }
        }
    }
    assert!(checked >= 100, "{checked}");
}

#[test]
fn mass_properties_are_those_of_the_exact_part() {
    let Some(folder) = shared() else { return };
    let exact: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("massprops.json")).unwrap())
            .unwrap();
    let mut checked = 0;
    for (_, mesh) in truths(&folder) {
        let name = mesh.file_name().unwrap().to_string_lossy().into_owned();
        let Some(exact) = exact
            .as_array()
            .unwrap()
            .iter()
            .find(|exact| name.starts_with(exact["name"].as_str().unwrap()))
        else {
            continue;
        };
        let part = Part::read(&mesh, &ReadOptions::default()).unwrap();
        let mass = part.mass_properties(1.0);
        let [volume, of_mesh] = ["volume", "stl_signed_volume"].map(|key| exact[key].as_f64());
        let (volume, found) = (volume.unwrap(), mass.volume * 1e9);
        if let Some(of_mesh) = of_mesh {
            assert!(
                (found - of_mesh).abs() < 1e-6 * of_mesh,
                "{name}: {found}, the mesh's volume computed elsewhere is {of_mesh}"
            );
        }
        // The balls of the bearing are tessellated so coarsely that the mesh itself is 0.4 % too
        // small.
        let allowed = if name.contains("bearing") { 5e-3 } else { 1e-3 };
        assert!((found - volume).abs() < allowed * volume, "{name}: {found}, exact {volume}");
        assert!(
            mass.centre_of_mass.distance(vector(&exact["centre_of_mass"]) * 1e-3) < 1e-5,
            "{name}"
        );
        let inertia = DMat3::from_cols_array_2d(
            &[0, 1, 2].map(|row| vector(&exact["inertia_about_com_unit_density"][row]).to_array()),
        );
        let difference = (mass.inertia * 1e15 - inertia)
            .to_cols_array()
            .into_iter()
            .fold(0.0, |worst: f64, x| worst.max(x.abs()));
        assert!(
            difference < 2.0 * allowed * inertia.to_cols_array().into_iter().fold(0.0, f64::max),
            "{name}: {difference}"
        );
        checked += 1;
    }
    assert_eq!(checked, 14);
}

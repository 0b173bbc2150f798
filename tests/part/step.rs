//! STEP files, read by the CAD kernel: faces, pairs and mass properties are those of the exact
//! part.
use std::path::{Path, PathBuf};

use crate::support::reference;
use glam::DVec3;
use gripfast::part::{Part, PlanarFace, ReadOptions};
use serde_json::Value;

fn vector(value: &Value) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| value[axis].as_f64().unwrap()))
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// STEP files with their truth, lengths in millimetres.
fn truths(parts: &Path) -> Vec<(PathBuf, Value)> {
    let mut found = Vec::new();
    for (truth, step) in [("gen", "gen"), ("truth", "parts")] {
        for entry in std::fs::read_dir(parts.join(truth)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let Some(stem) = name.strip_suffix(".truth.json") else { continue };
            let file = if truth == "gen" { format!("{stem}.step") } else { stem.to_string() };
            found.push((parts.join(step).join(file), json(&path)));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}

/// Length of a face's boundary [m]: what the tessellation of its curved edges can take from its
/// area, times the deflection.
fn boundary(face: &PlanarFace) -> f64 {
    let rings = face
        .polygons
        .iter()
        .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes));
    rings
        .flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)))
        .map(|(a, b)| a.distance(*b))
        .sum()
}

#[test]
fn planes_pairs_and_volumes_are_those_of_the_exact_part() {
    let Some(parts) = reference("parts") else { return };
    let exact = json(&parts.join("massprops.json"));
    let (mut files, mut planes, mut pairs, mut volumes) = (0, 0, 0, 0);
    for (file, truth) in truths(&parts) {
        let part = Part::read(&file, &ReadOptions::default()).unwrap();
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        assert!(part.health.watertight && part.unit_m == 1e-3, "{name}: {:?}", part.health.lines());
        files += 1;
        for plane in truth["plane_groups"].as_array().unwrap() {
            let (normal, offset, area) = (
                vector(&plane["normal"]),
                plane["offset"].as_f64().unwrap(),
                plane["area"].as_f64().unwrap(),
            );
            let lies_in = |face: &&PlanarFace| {
                face.normal.dot(normal) > 1.0 - 4e-7 && (face.offset * 1e3 - offset).abs() < 2e-3
            };
            let faces: Vec<&PlanarFace> = part.faces.iter().filter(lies_in).collect();
            let found: f64 = faces.iter().map(|face| face.area * 1e6).sum();
            let allowed = 0.05 * faces.iter().map(|face| boundary(face) * 1e3).sum::<f64>();
            assert!(
                (found - area).abs() <= allowed + 1e-6 * area,
                "{name}: plane {normal} {offset}: area {area}, found {found} +- {allowed}"
            );
            planes += 1;
        }
        // Every width at which the exact part has an external pair occurs.
        let found = part.pairs(0.0, 1.0);
        for pair in
            truth["pairs"].as_array().unwrap().iter().filter(|pair| pair["kind"] == "external")
        {
            let (width, area) =
                (pair["width"].as_f64().unwrap(), pair["overlap_area"].as_f64().unwrap());
            if area > 1.0 {
                assert!(
                    found.iter().any(|pair| (pair.width * 1e3 - width).abs() < 2e-3),
                    "{name}: no pair {width} mm apart"
                );
                pairs += 1;
            }
        }
        if let Some(exact) = exact
            .as_array()
            .unwrap()
            .iter()
            .find(|exact| name.starts_with(exact["name"].as_str().unwrap()))
        {
            let (volume, mass) = (exact["volume"].as_f64().unwrap(), part.mass_properties(1.0));
            let allowed = if name.contains("bearing") { 5e-3 } else { 1e-3 };
            assert!(
                (mass.volume * 1e9 - volume).abs() < allowed * volume,
                "{name}: {} mm3, exact {volume}",
                mass.volume * 1e9
            );
            assert!(
                mass.centre_of_mass.distance(vector(&exact["centre_of_mass"]) * 1e-3) < 1e-5,
                "{name}"
            );
            volumes += 1;
        }
    }
    assert!(
        files >= 13 && planes >= 200 && pairs >= 50 && volumes >= 12,
        "{files} {planes} {pairs} {volumes}"
    );
}

#[test]
fn a_zipped_file_reads_and_a_bad_one_is_refused() {
    let scratch = tempfile::tempdir().unwrap();
    let refused = |name: &str, bytes: &[u8]| {
        let path = scratch.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let message = Part::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains("remedy"), "{message}");
        message
    };
    assert!(refused("letter.step", b"Dear Sir, no part.").contains("ISO-10303-21"));
    assert!(refused("cut.stp", b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((").contains("STEP"));
    assert!(
        refused(
            "empty.step",
            b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"
        )
        .contains("STEP")
    );
    let Some(parts) = reference("parts") else { return };
    let file = parts.join("gen/gen_shaftkey_6x6x40.step");
    let path = scratch.path().join("key.step.gz");
    let mut zip = flate2::write::GzEncoder::new(
        std::fs::File::create(&path).unwrap(),
        flate2::Compression::fast(),
    );
    std::io::Write::write_all(&mut zip, &std::fs::read(&file).unwrap()).unwrap();
    zip.finish().unwrap();
    let [plain, zipped] =
        [&file, &path].map(|path| Part::read(path, &ReadOptions::default()).unwrap());
    assert_eq!(plain.mesh, zipped.mesh);
}

//! Parts whose exact faces, pairs and mass properties are known.

use std::path::{Path, PathBuf};

use gripfast::part::{Part, ReadOptions};

fn shared() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/parts");
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
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder.join(sub)).unwrap().map(|entry| entry.unwrap().path()).collect();
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

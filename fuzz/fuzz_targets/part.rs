//! Part files: the first byte chooses the format.
#![no_main]

use gripfast::part::{Part, ReadOptions};
use libfuzzer_sys::fuzz_target;

const SUFFIXES: [&str; 8] = ["stl", "obj", "off", "ply", "gltf", "glb", "3mf", "off.gz"];

fuzz_target!(|data: &[u8]| {
    let Some((&first, bytes)) = data.split_first() else { return };
    let suffix = SUFFIXES[usize::from(first) % SUFFIXES.len()];
    let file = tempfile::Builder::new().suffix(&format!(".{suffix}")).tempfile();
    let Ok(file) = file else { return };
    if std::fs::write(file.path(), bytes).is_ok() {
        let options = ReadOptions { max_memory: Some(64 << 20), ..ReadOptions::default() };
        let _ = Part::read(file.path(), &options);
    }
});

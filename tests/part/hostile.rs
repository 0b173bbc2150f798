//! Damaged and malicious part files: an error that says where, never another shape, a panic, an
//! endless loop or the machine's memory.

use std::io::Write;
use std::path::Path;

use gripfast::error::{Error, ErrorKind};
use gripfast::part::{Part, ReadOptions};

use crate::support::reference;

fn refused(path: &Path, options: &ReadOptions) -> Error {
    match Part::read(path, options) {
        Err(error) => error,
        Ok(part) => panic!("{}: read as {} triangles", path.display(), part.mesh.triangles.len()),
    }
}

/// Writes `bytes` as `name` and reads it with little memory allowed.
fn bad(name: &str, bytes: &[u8]) -> Error {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let options = ReadOptions::default().with_max_memory(Some(64 << 20));
    let error = refused(&path, &options);
    assert!(error.to_string().contains(name), "{error}");
    error
}

/// A 3MF package with this model.
fn package(model: &str) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Deflated);
    zip.start_file("3D/3dmodel.model", options).unwrap();
    zip.write_all(model.as_bytes()).unwrap();
    zip.finish().unwrap().into_inner()
}

/// A tetrahedron as object 1, built once.
const TETRAHEDRON: &str = r#"<?xml version="1.0"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1" type="model"><mesh><vertices>
<vertex x="0" y="0" z="0"/><vertex x="9" y="0" z="0"/>
<vertex x="0" y="9" z="0"/><vertex x="0" y="0" z="9"/>
</vertices><triangles>
<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/>
<triangle v1="1" v2="2" v3="3"/><triangle v1="2" v2="0" v3="3"/>
</triangles></mesh></object></resources><build><item objectid="1"/></build></model>"#;

#[test]
fn every_number_of_a_3mf_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("good.3mf");
    std::fs::write(&path, package(TETRAHEDRON)).unwrap();
    let part = Part::read(&path, &ReadOptions::default()).unwrap();
    assert!((part.mass_properties(1.0).volume - 121.5e-9).abs() < 1e-15 && part.health.watertight);
    let twelve = |text: &str| format!(r#"objectid="1" transform="{text}"/></build>"#);
    let cases: [(&str, String, &[&str]); 14] = [
        (r#"x="9""#, r#"x="1o""#.into(), &["object 1, vertex 1", "x = '1o'"]),
        (r#"z="9""#, r#"z="nan""#.into(), &["vertex 3", "z = 'nan'"]),
        (r#"z="9""#, r#"z="1e400""#.into(), &["vertex 3", "1e400"]),
        (r#"z="9""#, r#"z="""#.into(), &["vertex 3", "z = ''"]),
        (r#"x="9" y="0""#, r#"x="9""#.into(), &["vertex 1", "lacks one of x, y, z"]),
        (r#"v2="2""#, r#"v2="2.0""#.into(), &["triangle 0", "v2 = '2.0'"]),
        (r#"v3="1""#, r#"v3="-1""#.into(), &["triangle 0", "v3 = '-1'"]),
        (r#"v3="1""#, r#"v3="4""#.into(), &["face 1", "vertex 4"]),
        (r#" v3="1""#, String::new(), &["triangle 0", "lacks 'v3'"]),
        (r#"objectid="1"/></build>"#, twelve("1 0 0 0 1 0 0 0 1 0 0"), &["not 12 finite numbers"]),
        (
            r#"objectid="1"/></build>"#,
            twelve("2 0 0 0 1 0 0 0 1 0 0 0 0"),
            &["object 1", "not 12 finite numbers"],
        ),
        (r#"objectid="1"/></build>"#, twelve("x 0 0 0 1 0 0 0 1 0 0 0"), &["transform 'x 0"]),
        (r#"objectid="1"/></build>"#, r#"objectid="7"/></build>"#.into(), &["object 7"]),
        (r#"unit="millimeter""#, r#"unit="parsec""#.into(), &["unit 'parsec'"]),
    ];
    for (from, to, says) in cases {
        let model = TETRAHEDRON.replacen(from, &to, 1);
        assert_ne!(model, TETRAHEDRON);
        let error = bad("bad.3mf", &package(&model));
        assert_eq!(error.kind(), ErrorKind::Format, "{error}");
        for text in says {
            assert!(error.to_string().contains(text), "{to}: {error}");
        }
    }
}

#[test]
fn a_3mf_that_is_no_model_or_needs_what_is_not_read_is_refused() {
    let cut = TETRAHEDRON.split("</resources>").next().unwrap();
    assert!(bad("cut.3mf", &package(cut)).to_string().contains("ends within"));
    let deep = format!("<model>{}", "<a>".repeat(100_000));
    assert_eq!(bad("deep.3mf", &package(&deep)).kind(), ErrorKind::Limit);
    let secure = TETRAHEDRON.replacen(
        "<model ",
        r#"<model requiredextensions="s" xmlns:s="http://schemas.example/secure" "#,
        1,
    );
    let error = bad("secure.3mf", &package(&secure));
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(error.to_string().contains("schemas.example/secure"), "{error}");
    let itself = TETRAHEDRON.replacen(
        "</object>",
        r#"</object><object id="2"><components><component objectid="2"/></components></object>"#,
        1,
    );
    let itself = itself.replace(r#"item objectid="1""#, r#"item objectid="2""#);
    assert!(bad("self.3mf", &package(&itself)).to_string().contains("nested without end"));
    let twice = TETRAHEDRON.replacen("</object>", r#"</object><object id="1"/>"#, 1);
    assert!(bad("twice.3mf", &package(&twice)).to_string().contains("is there twice"));
    let mesh = TETRAHEDRON.find("<mesh>").unwrap()..TETRAHEDRON.find("</object>").unwrap();
    let mut other = TETRAHEDRON.to_string();
    other.replace_range(mesh, "<volumedata/>");
    assert!(bad("other.3mf", &package(&other)).to_string().contains("volumedata"));
}

#[test]
fn copies_are_counted_before_they_are_placed() {
    // Ten levels of ten components each: 4e10 triangles from 3 kB.
    let mut objects = String::new();
    for level in 2..12 {
        let copies = format!(r#"<component objectid="{}"/>"#, level - 1).repeat(10);
        objects += &format!(r#"<object id="{level}"><components>{copies}</components></object>"#);
    }
    let model = TETRAHEDRON.replacen("</object>", &format!("</object>{objects}"), 1);
    let model = model.replace(r#"item objectid="1""#, r#"item objectid="11""#);
    let start = std::time::Instant::now();
    let error = bad("copies.3mf", &package(&model));
    assert_eq!((error.kind(), error.options()), (ErrorKind::Limit, ["max_memory"].as_slice()));
    assert!(start.elapsed().as_secs_f64() < 1.0);
}

#[test]
fn copies_of_nothing_are_counted_too() {
    // Ten levels of ten components each, of a mesh without a triangle.
    let empty = TETRAHEDRON.find("<triangle ").unwrap()..TETRAHEDRON.find("</triangles>").unwrap();
    let mut model = TETRAHEDRON.to_string();
    model.replace_range(empty, "");
    let mut objects = String::new();
    for level in 2..12 {
        let copies = format!(r#"<component objectid="{}"/>"#, level - 1).repeat(10);
        objects += &format!(r#"<object id="{level}"><components>{copies}</components></object>"#);
    }
    let model = model.replacen("</object>", &format!("</object>{objects}"), 1);
    let model = model.replace(r#"item objectid="1""#, r#"item objectid="11""#);
    let error = bad("nothing.3mf", &package(&model));
    assert_eq!(error.kind(), ErrorKind::Limit, "{error}");
    assert!(error.to_string().contains("nested without end"), "{error}");
}

#[test]
fn a_buffer_written_as_text_counts_as_memory() {
    // The file alone fits, the file and the bytes that it stands for do not.
    let text = gltf(&format!("data:application/octet-stream;base64,{}", "AAAA".repeat(150_000)))
        .replace(r#""byteLength":36,"uri""#, r#""byteLength":450000,"uri""#);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, &text).unwrap();
    let error = refused(&path, &ReadOptions::default().with_max_memory(Some(1_000_000)));
    assert_eq!((error.kind(), error.options()), (ErrorKind::Limit, ["max_memory"].as_slice()));
}

#[test]
fn a_small_file_that_unpacks_to_a_huge_one_is_refused() {
    let zipped = |bytes: &[u8], times: usize| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        (0..times).for_each(|_| encoder.write_all(bytes).unwrap());
        encoder.finish().unwrap()
    };
    let blank = vec![b' '; 1 << 20];
    for name in ["a.stl.gz", "a.obj.gz", "a.ply.gz", "a.off.gz", "a.gltf.gz", "a.3mf.gz"] {
        let start: &[u8] = match name {
            "a.stl.gz" => b"solid a\n",
            "a.ply.gz" => b"ply\nformat ascii 1.0\n",
            "a.off.gz" => b"OFF\n",
            "a.3mf.gz" => b"PK",
            _ => b"\n",
        };
        let mut bytes = zipped(start, 1);
        bytes.extend(zipped(&blank, 100));
        let error = bad(name, &bytes);
        assert_eq!(error.kind(), ErrorKind::Limit, "{error}");
    }
    let bomb = format!("<model>{}", " ".repeat(100 << 20));
    assert_eq!(bad("bomb.3mf", &package(&bomb)).kind(), ErrorKind::Limit);
}

#[test]
fn damaged_archives_are_bad_input() {
    let zipped = |bytes: &[u8]| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    };
    let whole = zipped(&b"OFF\n4 4 0\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n3 0 2 1\n"[..]);
    let mut wrong = whole.clone();
    // The check sum.
    let sum = wrong.len() - 8;
    wrong[sum] ^= 1;
    for bytes in [&whole[..whole.len() - 4], &wrong, b"no archive at all, whatever its name says"] {
        let error = bad("a.off.gz", bytes);
        assert_eq!(error.kind(), ErrorKind::Format, "{error}");
        assert!(error.to_string().contains("damaged"), "{error}");
    }
    // A whole archive with a cut file in it: its length is not known before.
    let mut stl = vec![0; 80];
    stl.extend(3_u32.to_le_bytes());
    stl.extend([0; 120]);
    let error = bad("a.stl.gz", &zipped(&stl)).to_string();
    assert!(error.contains("states 3 triangles but ends within triangle 3"), "{error}");
}

#[test]
fn a_corner_that_is_not_finite_is_told_with_its_byte() {
    let mut stl = vec![0; 80];
    stl.extend(3_u32.to_le_bytes());
    for triangle in 0..3 {
        let mut numbers = [0.0_f32; 12];
        (numbers[6], numbers[10]) = (1.0, if triangle == 2 { f32::NAN } else { 1.0 });
        stl.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        stl.extend([0; 2]);
    }
    let error = bad("a.stl", &stl).to_string();
    assert!(error.contains("triangle 3 (byte 184)") && error.contains("not finite"), "{error}");
}

#[test]
fn a_name_that_tells_no_format_is_refused() {
    for (name, says) in [("part", "has no suffix"), ("part.doc", "'.doc'"), ("a.stl", "is empty")] {
        let error = bad(name, if name == "a.stl" { b"" } else { b"solid a" });
        let kind = if name == "a.stl" { ErrorKind::Format } else { ErrorKind::Unsupported };
        assert_eq!(error.kind(), kind, "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn claims_take_no_memory() {
    let ply = |header: &str| format!("ply\nformat binary_little_endian 1.0\n{header}end_header\n");
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let face = "element face 1\nproperty list uchar int vertex_index\n";
    for header in [
        format!("element vertex 4000000000\n{xyz}{face}"),
        format!(
            "element vertex 3\n{xyz}element face 4000000000\nproperty list uchar int vertex_index\n"
        ),
        format!("element vertex 3\n{xyz}element odd 4000000000\n{face}"),
    ] {
        bad("claim.ply", ply(&header).as_bytes());
    }
    let missing = ply(&format!("element vertex 3\nproperty float x\nproperty float y\n{face}"));
    let error = bad("flat.ply", missing.as_bytes()).to_string();
    assert!(error.contains("lacks one of x, y, z"), "{error}");
    bad("claim.off", b"OFF\n4000000000 4000000000 0\n0 0 0\n");
    let mut stl = vec![0; 80];
    stl.extend(4_000_000_000_u32.to_le_bytes());
    bad("claim.stl", &stl);
    let long = format!("solid a\nvertex {}", "1".repeat(20 << 20));
    assert_eq!(bad("long.stl", long.as_bytes()).kind(), ErrorKind::Limit);
}

#[test]
fn words_that_are_no_numbers_are_refused_with_their_line() {
    let stl = |line: &str| format!("solid a\nfacet normal 0 0 1\nouter loop\n{line}\n");
    for line in
        ["vertex 1o 0 0", "vertex 0 nan 0", "vertex 0 0 1e400", "vertex 0 0", "vertex 1 5 2 3"]
    {
        let error = bad("a.stl", stl(line).as_bytes()).to_string();
        assert!(error.contains("line 4"), "{line}: {error}");
    }
    for vertex in ["1o 0 0", "0 nan 0", "0 0 1e400", "0 0"] {
        let off = format!("OFF\n3 1 0\n0 0 0\n{vertex}\n0 1 0\n3 0 1 2\n");
        let error = bad("a.off", off.as_bytes()).to_string();
        assert!(error.contains("line 4") || error.contains("vertex 2"), "{vertex}: {error}");
        let obj = format!("v 0 0 0\nv {vertex}\nv 0 1 0\nf 1 2 3\n");
        let error = bad("a.obj", obj.as_bytes()).to_string();
        assert!(error.contains("line 2") || error.contains("vertex 2"), "{vertex}: {error}");
        let ply = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n\
             0 0 0\n{vertex}\n0 1 0\n3 0 1 2\n"
        );
        let error = bad("a.ply", ply.as_bytes()).to_string();
        assert!(error.contains("line 11") || error.contains("vertex 2"), "{vertex}: {error}");
    }
    for face in ["3 0 1 3", "3 0 1 -1", "3 0 1 x", "3 0 1", "4000000000 0 1 2"] {
        bad("b.off", format!("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n{face}\n").as_bytes());
    }
    for face in ["1 2 4", "0 1 2", "1 2 x", "1 2 -9"] {
        bad("b.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {face}\n").as_bytes());
    }
}

#[test]
fn sizes_that_numbers_cannot_carry_are_refused() {
    for (size, says) in
        [("1e13", "the largest is"), ("1e300", "the largest is"), ("1e-30", "smallest part")]
    {
        let off = format!(
            "OFF\n4 4 0\n0 0 0\n{size} 0 0\n0 {size} 0\n0 0 {size}\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
        );
        let error = bad("a.off", off.as_bytes());
        assert_eq!(error.kind(), ErrorKind::Geometry);
        assert!(error.to_string().contains(says), "{error}");
    }
}

/// A triangle in glTF with its buffer at `uri`.
fn gltf(uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
"bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{uri}"}}]}}"#
    )
}

#[test]
fn gltf_buffers_stay_in_the_folder_of_the_part() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("part");
    std::fs::create_dir(&folder).unwrap();
    let corners = [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: Vec<u8> = corners.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(outer.path().join("secret.bin"), &bytes).unwrap();
    std::fs::write(folder.join("a b.bin"), &bytes).unwrap();
    let path = folder.join("part.gltf");
    let read = |uri: &str, options: &ReadOptions| {
        std::fs::write(&path, gltf(uri)).unwrap();
        Part::read(&path, options)
    };
    let usual = ReadOptions::default();
    assert_eq!(read("a%20b.bin", &usual).unwrap().mesh.triangles.len(), 1);
    let absolute = outer.path().join("secret.bin").display().to_string();
    let outside = ["../secret.bin", "%2e%2e/secret.bin", "http://a/b.bin", absolute.as_str()];
    for uri in outside {
        let error = read(uri, &usual).unwrap_err().to_string();
        assert!(error.contains("outside of the part's folder"), "{uri}: {error}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(outer.path().join("secret.bin"), folder.join("link")).unwrap();
        assert!(read("link", &usual).unwrap_err().to_string().contains("outside"));
        assert!(read("zero", &usual).is_err());
        std::os::unix::fs::symlink("/dev/zero", folder.join("zero")).unwrap();
        let open = ReadOptions::default().with_outside_buffers(true);
        assert!(read("zero", &open).unwrap_err().to_string().contains("no file"));
    }
    let open = ReadOptions::default().with_outside_buffers(true);
    assert!(read("../secret.bin", &open).is_ok());
    assert!(read("%zz", &usual).unwrap_err().to_string().contains("badly encoded"));
}

#[test]
fn gltf_of_another_version_or_with_a_bent_transform_is_refused() {
    let base64 = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let good = gltf(&format!("data:application/octet-stream;base64,{base64}"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("good.gltf");
    std::fs::write(&path, &good).unwrap();
    assert_eq!(Part::read(&path, &ReadOptions::default()).unwrap().mesh.triangles.len(), 1);
    for (from, to) in [
        (r#""version":"2.0""#, r#""version":"3.0""#),
        (r#""version":"2.0""#, r#""version":"2.1","minVersion":"2.1""#),
        (r#""version":"2.0""#, r#""version":"x""#),
        (r#""version":"2.0""#, r#""version":"2.""#),
        (r#""version":"2.0""#, r#""version":"2.x""#),
    ] {
        let error = bad("version.gltf", good.replace(from, to).as_bytes());
        assert_eq!(error.kind(), ErrorKind::Unsupported, "{error}");
    }
    for matrix in ["1,0,0,0.5,0,1,0,0,0,0,1,0,0,0,0,1", "1e39,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1"] {
        let bent = good.replace(r#"{"mesh":0}"#, &format!(r#"{{"mesh":0,"matrix":[{matrix}]}}"#));
        let error = bad("bent.gltf", bent.as_bytes()).to_string();
        assert!(error.contains("node 0") || matrix.starts_with("1e39"), "{error}");
    }
    let overlap = good
        .replace(r#""byteLength":36}],"buffers""#, r#""byteLength":36,"byteStride":4}],"buffers""#);
    assert_ne!(overlap, good);
    bad("overlap.gltf", overlap.as_bytes());
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_no_part_files() {
    let folder = tempfile::tempdir().unwrap();
    for target in ["/dev/zero", "/dev/null"] {
        let path = folder.path().join("device.stl");
        let _ = std::fs::remove_file(&path);
        std::os::unix::fs::symlink(target, &path).unwrap();
        let error = refused(&path, &ReadOptions::default()).to_string();
        assert!(error.contains("device"), "{error}");
    }
}

#[test]
fn the_samples_are_refused() {
    let cases: [(&str, ErrorKind, &[&str]); 5] = [
        ("c12.3mf", ErrorKind::Format, &["vertex", "x = '1o'"]),
        ("t_13.3mf", ErrorKind::Format, &["not 12 finite numbers"]),
        ("pos_index.gltf", ErrorKind::Format, &["pos_index.gltf"]),
        ("mult.3mf", ErrorKind::Limit, &["memory"]),
        ("esc.off", ErrorKind::Format, &["line 4"]),
    ];
    for (name, kind, says) in cases {
        let Some(path) = reference(&format!("trials/hostile/{name}")) else { return };
        let start = std::time::Instant::now();
        let error = refused(&path, &ReadOptions::default());
        assert_eq!(error.kind(), kind, "{error}");
        for text in says {
            assert!(error.to_string().contains(text), "{name}: {error}");
        }
        assert!(start.elapsed().as_secs() < 5, "{name}");
    }
}

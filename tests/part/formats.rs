//! The same solid in every format that is read, with the unit and the transforms that the format
//! carries.

use std::io::Write;

use glam::DVec3;
use gripfast::part::{Part, ReadOptions, Unit, UnitSource};

/// An L-shaped bar, 30 x 20 x 10: its ends are concave hexagons.
const OUTLINE: [(f64, f64); 6] =
    [(0.0, 0.0), (30.0, 0.0), (30.0, 5.0), (5.0, 5.0), (5.0, 20.0), (0.0, 20.0)];

fn vertices() -> Vec<[f64; 3]> {
    [0.0, 10.0].iter().flat_map(|&z| OUTLINE.map(|(x, y)| [x, y, z])).collect()
}

fn polygons() -> Vec<Vec<usize>> {
    let mut polygons = vec![(0..6).rev().collect(), (6..12).collect()];
    polygons.extend((0..6).map(|k| vec![k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6]));
    polygons
}

/// The solid in triangles.
fn triangles() -> Vec<[usize; 3]> {
    let ends = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    let mut triangles: Vec<[usize; 3]> = ends
        .iter()
        .map(|&[a, b, c]| [c, b, a])
        .chain(ends.iter().map(|t| t.map(|k| k + 6)))
        .collect();
    triangles.extend(
        (0..6).flat_map(|k| [[k, (k + 1) % 6, (k + 1) % 6 + 6], [k, (k + 1) % 6 + 6, k + 6]]),
    );
    triangles
}

fn join(numbers: impl IntoIterator<Item = impl ToString>) -> String {
    numbers.into_iter().map(|number| number.to_string()).collect::<Vec<_>>().join(" ")
}

fn check(part: &Part, unit: Unit, bodies: usize) {
    let scale = unit.metres();
    let lines = part.health.lines();
    assert!(part.health.watertight, "{}: {lines:?}", part.name);
    assert_eq!(part.unit_m, scale, "{}", part.name);
    assert_eq!(
        (part.health.shells, part.faces.len()),
        (bodies, 8 * bodies),
        "{}: {lines:?}",
        part.name
    );
    let volume = part.mass_properties(1.0).volume / scale.powi(3);
    assert!((volume - 2250.0 * bodies as f64).abs() < 1e-3, "{}: {volume}", part.name);
    let area: f64 = part.faces.iter().map(|face| face.area).sum::<f64>() / scale.powi(2);
    assert!((area - 1450.0 * bodies as f64).abs() < 1e-3, "{}: {area}", part.name);
}

struct Scratch(tempfile::TempDir);

impl Scratch {
    /// Writes the file plain and zipped, reads both, and returns the plain one's part.
    fn read(&self, name: &str, bytes: &[u8], unit: Option<Unit>) -> Part {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let part = Part::read(&path, &ReadOptions::default().with_unit(unit))
            .unwrap_or_else(|error| panic!("{error}"));
        let zipped = self.0.path().join(format!("{name}.gz"));
        let mut encoder = flate2::write::GzEncoder::new(
            std::fs::File::create(&zipped).unwrap(),
            flate2::Compression::fast(),
        );
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap();
        let unzipped = Part::read(&zipped, &ReadOptions::default().with_unit(unit))
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            (&unzipped.mesh, &unzipped.faces, &unzipped.name),
            (&part.mesh, &part.faces, &part.name),
            "{name}"
        );
        assert_eq!(part.name, name.split('.').next().unwrap());
        part
    }
}

#[test]
fn obj_with_polygons_negative_indices_and_materials() {
    let scratch = Scratch(tempfile::tempdir().unwrap());
    let lines: Vec<String> = vertices().iter().map(|v| format!("v {}\n", join(v))).collect();
    let faces: String = polygons()
        .iter()
        .map(|p| format!("f {}\n", join(p.iter().map(|k| format!("{}//1", k + 1)))))
        .collect();
    let text = format!(
        "# a comment\nmtllib missing.mtl\no bar\n{}vn 0 0 1\nusemtl steel\ns off\n{faces}",
        lines.concat()
    );
    check(&scratch.read("bar.obj", text.as_bytes(), None), Unit::Millimetre, 1);
    let faces: String =
        triangles().iter().map(|t| format!("f {}\n", join(t.map(|k| k as i64 - 12)))).collect();
    check(
        &scratch.read(
            "negative.obj",
            format!("{}{faces}", lines.concat()).replace('\n', "\r\n").as_bytes(),
            Some(Unit::Inch),
        ),
        Unit::Inch,
        1,
    );
}

#[test]
fn ply_in_three_encodings_with_further_elements() {
    let scratch = Scratch(tempfile::tempdir().unwrap());
    for (encoding, list) in [
        ("ascii", "vertex_index"),
        ("binary_little_endian", "vertex_indices"),
        ("binary_big_endian", "vertex_index"),
    ] {
        let mut bytes = format!(
            "ply\nformat {encoding} 1.0\ncomment made by hand\nelement vertex 12\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n\
             element camera 1\nproperty float fov\nelement face 8\nproperty list uchar uint {list}\nend_header\n"
        )
        .into_bytes();
        let little = encoding.contains("little");
        for v in vertices() {
            if encoding == "ascii" {
                bytes.extend(format!("{} 255\n", join(v)).bytes());
            } else {
                bytes.extend(
                    v.iter().flat_map(|x| if little { x.to_le_bytes() } else { x.to_be_bytes() }),
                );
                bytes.push(255);
            }
        }
        if encoding == "ascii" {
            bytes.extend(b"45\n")
        } else {
            bytes.extend(if little { 45_f32.to_le_bytes() } else { 45_f32.to_be_bytes() })
        }
        for p in polygons() {
            if encoding == "ascii" {
                bytes.extend(format!("{} {}\n", p.len(), join(&p)).bytes());
            } else {
                bytes.push(p.len() as u8);
                bytes.extend(p.iter().flat_map(|&k| {
                    if little { (k as u32).to_le_bytes() } else { (k as u32).to_be_bytes() }
                }));
            }
        }
        check(&scratch.read("bar.ply", &bytes, Some(Unit::Centimetre)), Unit::Centimetre, 1);
    }
}

#[test]
fn ply_with_numbers_of_every_type() {
    let scratch = Scratch(tempfile::tempdir().unwrap());
    // Coordinates and corners are small enough for one byte.
    type Bytes = fn(u8) -> Vec<u8>;
    let types: [(&str, Bytes); 8] = [
        ("char", |x| (x as i8).to_le_bytes().into()),
        ("uchar", |x| x.to_le_bytes().into()),
        ("short", |x| i16::from(x).to_le_bytes().into()),
        ("ushort", |x| u16::from(x).to_le_bytes().into()),
        ("int", |x| i32::from(x).to_le_bytes().into()),
        ("uint", |x| u32::from(x).to_le_bytes().into()),
        ("float", |x| f32::from(x).to_le_bytes().into()),
        ("double", |x| f64::from(x).to_le_bytes().into()),
    ];
    for (coordinate, number) in types {
        // Corners are never floats.
        let whole = !matches!(coordinate, "float" | "double");
        let (index, corner) = if whole { (coordinate, number) } else { types[5] };
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 12\nproperty {coordinate} x\n\
             property {coordinate} y\nproperty {coordinate} z\nelement face 8\n\
             property list uchar {index} vertex_indices\nend_header\n"
        )
        .into_bytes();
        bytes.extend(vertices().into_iter().flatten().flat_map(|x| number(x as u8)));
        for polygon in polygons() {
            bytes.push(polygon.len() as u8);
            bytes.extend(polygon.iter().flat_map(|&k| corner(k as u8)));
        }
        check(&scratch.read("bar.ply", &bytes, None), Unit::Millimetre, 1);
    }
}

#[test]
fn off_with_comments_colours_and_counts_on_one_line() {
    let scratch = Scratch(tempfile::tempdir().unwrap());
    let body: String =
        vertices().iter().map(|v| format!("{} 10 20 30 255 # grey\n", join(v))).collect::<String>()
            + &polygons()
                .iter()
                .map(|p| format!("{} {} 0.5 0.5 0.5\n\n", p.len(), join(p)))
                .collect::<String>();
    check(
        &scratch.read("bar.off", format!("COFF\n# counts follow\n12 8 0\n{body}").as_bytes(), None),
        Unit::Millimetre,
        1,
    );
    check(
        &scratch.read("bar.off", format!("OFF 12 8 0\n{body}").as_bytes(), None),
        Unit::Millimetre,
        1,
    );
    for (text, says) in [
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n", "line 4"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "face 1"),
        ("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "line 4"),
        ("OFF\n99999999999 1 0\n0 0 0\n", "ends"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n18446744073709551615 0 1 2\n", "line 6"),
        ("4OFF\n", "three dimensions"),
        ("OFF BINARY\n", "three dimensions"),
    ] {
        let path = scratch.0.path().join("bad.off");
        std::fs::write(&path, text).unwrap();
        let message = Part::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains(says) && message.contains("remedy"), "{text}: {message}");
    }
}

/// A glTF document of the solid, with `uri` as its buffer, and the buffer.
fn gltf(uri: Option<&str>) -> (String, Vec<u8>) {
    let mut buffer: Vec<u8> =
        vertices().iter().flatten().flat_map(|&x| (x as f32 * 1e-3).to_le_bytes()).collect();
    buffer.extend(triangles().iter().flatten().flat_map(|&k| (k as u16).to_le_bytes()));
    let mut header = serde_json::json!({ "byteLength": buffer.len() });
    if let Some(uri) = uri {
        header["uri"] = uri.into();
    }
    let json = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 2] }],
        "nodes": [
            { "children": [1], "translation": [1.0, 0.0, 0.0] },
            { "mesh": 0, "rotation": [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2] },
            { "mesh": 0, "scale": [-1.0, 1.0, 1.0] },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 12, "type": "VEC3", "min": [0.0, 0.0, 0.0], "max": [0.03, 0.02, 0.01] },
            { "bufferView": 1, "componentType": 5123, "count": 60, "type": "SCALAR" },
        ],
        "bufferViews": [{ "buffer": 0, "byteLength": 144 }, { "buffer": 0, "byteOffset": 144, "byteLength": 120 }],
        "buffers": [header],
    });
    (json.to_string(), buffer)
}

fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], fill: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), fill);
        bytes
    };
    let (json, buffer) = (pad(json.as_bytes(), b' '), pad(buffer, 0));
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + buffer.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}

#[test]
fn gltf_with_transforms_in_metres() {
    let scratch = Scratch(tempfile::tempdir().unwrap());
    let (json, buffer) = gltf(None);
    let part = scratch.read("bar.glb", &glb(&json, &buffer), None);
    assert_eq!(
        (part.unit_m, part.health.shells, part.faces.len(), part.health.watertight),
        (1.0, 2, 16, true)
    );
    assert!((part.mass_properties(1.0).volume - 2.0 * 2250e-9).abs() < 1e-12);
    // One bar is turned about z and moved to x = 1 m, the other one mirrored.
    let (low, high) = part.mesh.bounding_box();
    assert!(
        low.distance(DVec3::new(-0.03, 0.0, 0.0)) < 1e-7
            && high.distance(DVec3::new(1.0, 0.03, 0.01)) < 1e-7,
        "{low} {high}"
    );
    let (json, buffer) = gltf(Some("bar.bin"));
    std::fs::write(scratch.0.path().join("bar.bin"), &buffer).unwrap();
    assert_eq!(scratch.read("bar.gltf", json.as_bytes(), None).faces, part.faces);

    let refused = |bytes: Vec<u8>| {
        let path = scratch.0.path().join("bad.glb");
        std::fs::write(&path, bytes).unwrap();
        let message = Part::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains("bad.glb"), "{message}");
        message
    };
    let (json, buffer) = gltf(None);
    assert!(refused(glb(&json, &buffer[..100])).contains("bytes of"));
    assert!(refused(glb(&json, &buffer)[..200].to_vec()).contains("not a readable glTF"));
    assert!(
        refused(glb(&json.replace("\"count\":60", "\"count\":66"), &buffer))
            .contains("beyond its data")
    );
    assert!(
        refused(glb(&json.replace("\"count\":60", "\"count\":18446744073709551615"), &buffer))
            .contains("beyond its data")
    );
    assert!(refused(glb(&json.replace("5126", "5123"), &buffer)).contains("32-bit floats"));
    assert!(
        refused(glb(&json.replace("\"children\":[1]", "\"children\":[0]"), &buffer))
            .contains("nested without end")
    );
    let mut far = buffer.clone();
    far[144..146].copy_from_slice(&[255, 255]);
    assert!(refused(glb(&json, &far)).contains("vertex 65535"));
}

#[test]
fn gltf_with_strips_fans_and_interleaved_positions() {
    // A tetrahedron: a fan of three triangles about its apex, and its base as a list, or as one
    // strip about it.
    let scratch = Scratch(tempfile::tempdir().unwrap());
    // Each position is followed by a texture coordinate, as many programs write them.
    let corners = [
        [0.0, 0.0, 0.0, 0.5, 0.5],
        [0.03, 0.0, 0.0, 0.0, 1.0],
        [0.0, 0.03, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.03_f32, 0.25, 0.75],
    ];
    let read = |name: &str, primitives: &[(u8, &[u8])]| {
        let mut buffer: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let mut views =
            vec![serde_json::json!({ "buffer": 0, "byteLength": 80, "byteStride": 20 })];
        let mut accessors = vec![serde_json::json!({
            "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
            "min": [0.0, 0.0, 0.0], "max": [0.03, 0.03, 0.03]
        })];
        let mut listed = Vec::new();
        for (mode, indices) in primitives {
            let view = serde_json::json!({
                "buffer": 0, "byteOffset": buffer.len(), "byteLength": indices.len()
            });
            listed.push(serde_json::json!({
                "attributes": { "POSITION": 0 }, "indices": views.len(), "mode": mode
            }));
            accessors.push(serde_json::json!({
                "bufferView": views.len(), "componentType": 5121, "count": indices.len(),
                "type": "SCALAR"
            }));
            views.push(view);
            buffer.extend(*indices);
        }
        let json = serde_json::json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0 }], "meshes": [{ "primitives": listed }],
            "accessors": accessors, "bufferViews": views,
            "buffers": [{ "byteLength": buffer.len() }]
        });
        let part = scratch.read(name, &glb(&json.to_string(), &buffer), None);
        assert!(part.health.watertight, "{name}: {:?}", part.health.lines());
        assert_eq!((part.mesh.triangles.len(), part.faces.len()), (4, 4), "{name}");
        let volume = part.mass_properties(1.0).volume;
        assert!((volume - 4.5e-6).abs() < 1e-12, "{name}: {volume}");
        // Turned to one another as they stand in the file: nothing had to be turned round.
        assert!(part.health.warnings.is_empty(), "{name}: {:?}", part.health.warnings);
    };
    read("list.glb", &[(4, &[0, 2, 1, 3, 0, 1, 3, 1, 2, 3, 2, 0])]);
    read("fan.glb", &[(4, &[0, 2, 1]), (6, &[3, 0, 1, 2, 0])]);
    read("strip.glb", &[(5, &[0, 2, 1, 3, 0, 2])]);
}

#[test]
fn three_mf_with_components_transforms_and_unit() {
    use threemf2::model::builder::{ModelBuilder, ObjectType, Unit as FileUnit};
    let scratch = Scratch(tempfile::tempdir().unwrap());
    let mut builder = ModelBuilder::new(FileUnit::Inch, true);
    builder.add_build(None).unwrap();
    let points: Vec<[f64; 3]> = vertices();
    let mesh = builder
        .add_mesh_object(|object| {
            object.object_type(ObjectType::Model);
            object.add_vertices(&points);
            for t in triangles() {
                object.add_triangle(&t);
            }
            Ok(())
        })
        .unwrap();
    builder.add_build_item(mesh).unwrap();
    let mut package = threemf2::package::ThreemfPackageBuilder::new();
    package.set_root_model(builder.build().unwrap());
    let mut package = package.build().unwrap();
    // A second item: turned by 90 degrees about z, moved along x.
    let mut item = package.root.build.item[0].clone();
    item.transform = Some(threemf2::model::domain::transform::Transform([
        0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 100.0, 0.0, 0.0,
    ]));
    package.root.build.item.push(item);
    let mut bytes = Vec::new();
    package.write(std::io::Cursor::new(&mut bytes)).unwrap();
    let part = scratch.read("bar.3mf", &bytes, None);
    check(&part, Unit::Inch, 2);
    let (low, high) = part.mesh.bounding_box();
    assert!(
        low.distance(DVec3::ZERO) < 1e-9
            && high.distance(DVec3::new(100.0, 30.0, 10.0) * 0.0254) < 1e-9,
        "{low} {high}"
    );
    assert_eq!(part.unit_source, UnitSource::File);
    let told = scratch.read("bar.3mf", &bytes, Some(Unit::Millimetre));
    check(&told, Unit::Millimetre, 2);
    assert_eq!(told.unit_source, UnitSource::Given);
    let contradicted = "the file states the unit in; its numbers were read in mm, as asked";
    assert!(told.health.warnings.iter().any(|text| text == contradicted), "{:?}", told.health);
    let agreed = scratch.read("bar.3mf", &bytes, Some(Unit::Inch));
    assert_eq!((agreed.unit_source, agreed.health.warnings.len()), (UnitSource::Given, 0));
    let stl =
        Part::read(&crate::support::root().join("data/parts/hex_nut.stl"), &ReadOptions::default());
    assert_eq!(stl.unwrap().unit_source, UnitSource::Assumed);
    let path = scratch.0.path().join("bad.3mf");
    for bytes in [&bytes[..bytes.len() / 2], b"PK\x03\x04 and nothing else", b"no zip"] {
        std::fs::write(&path, bytes).unwrap();
        let message = Part::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains("3MF") && message.contains("remedy"), "{message}");
    }
}

#[test]
fn binary_stl_reads_as_the_library_reads_it() {
    let folder = crate::support::root().join("../shared/parts");
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is absent", folder.display());
        return;
    }
    let path = folder.join("parts/trimesh__1002_tray_bottom.STL"); // a text file
    let library = stl_io::read_stl(&mut std::fs::File::open(&path).unwrap()).unwrap();
    let part = Part::read(&path, &ReadOptions::default().with_unit(Some(Unit::Metre))).unwrap();
    assert_eq!(part.mesh.triangles.len(), library.faces.len());
    for (own, theirs) in part.mesh.triangles.iter().zip(&library.faces) {
        let mut own = own.map(|k| part.mesh.vertices[k as usize].to_array().map(|x| x as f32));
        let mut theirs = theirs.vertices.map(|k| library.vertices[k].0.map(|x| x + 0.0));
        own.sort_by(|a, b| a.partial_cmp(b).unwrap());
        theirs.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(own, theirs);
    }
}

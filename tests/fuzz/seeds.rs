//! Good inputs to start from: a box in every format, a case, a gripper, a scene.

use std::io::Write;

const VERTICES: [[f32; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [30.0, 0.0, 0.0],
    [30.0, 20.0, 0.0],
    [0.0, 20.0, 0.0],
    [0.0, 0.0, 10.0],
    [30.0, 0.0, 10.0],
    [30.0, 20.0, 10.0],
    [0.0, 20.0, 10.0],
];

const TRIANGLES: [[u32; 3]; 12] = [
    [0, 2, 1],
    [0, 3, 2],
    [4, 5, 6],
    [4, 6, 7],
    [0, 1, 5],
    [0, 5, 4],
    [1, 2, 6],
    [1, 6, 5],
    [2, 3, 7],
    [2, 7, 6],
    [3, 0, 4],
    [3, 4, 7],
];

fn words(numbers: &[impl ToString]) -> String {
    numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

pub(crate) fn stl_text() -> Vec<u8> {
    let mut text = "solid box\n".to_string();
    for triangle in TRIANGLES {
        text += "facet normal 0 0 1\nouter loop\n";
        for vertex in triangle {
            text += &format!("vertex {}\n", words(&VERTICES[vertex as usize]));
        }
        text += "endloop\nendfacet\n";
    }
    (text + "endsolid box\n").into_bytes()
}

pub(crate) fn stl_binary() -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((TRIANGLES.len() as u32).to_le_bytes());
    for triangle in TRIANGLES {
        bytes.extend([0; 12]);
        for vertex in triangle {
            bytes.extend(VERTICES[vertex as usize].iter().flat_map(|x| x.to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

pub(crate) fn obj() -> Vec<u8> {
    let mut text = "o box\n".to_string();
    for vertex in VERTICES {
        text += &format!("v {}\n", words(&vertex));
    }
    for triangle in TRIANGLES {
        text += &format!("f {}\n", words(&triangle.map(|k| k + 1)));
    }
    text.into_bytes()
}

pub(crate) fn off() -> Vec<u8> {
    let mut text = format!("OFF\n{} {} 0\n", VERTICES.len(), TRIANGLES.len());
    for vertex in VERTICES {
        text += &format!("{}\n", words(&vertex));
    }
    for triangle in TRIANGLES {
        text += &format!("3 {}\n", words(&triangle));
    }
    text.into_bytes()
}

fn ply_header(encoding: &str) -> String {
    format!(
        "ply\nformat {encoding} 1.0\nelement vertex 8\nproperty float x\nproperty float y\n\
         property float z\nelement face 12\nproperty list uchar int vertex_index\nend_header\n"
    )
}

pub(crate) fn ply_text() -> Vec<u8> {
    let off = String::from_utf8(off()).unwrap();
    (ply_header("ascii") + off.split_once(" 0\n").unwrap().1).into_bytes()
}

pub(crate) fn ply_binary() -> Vec<u8> {
    let mut bytes = ply_header("binary_little_endian").into_bytes();
    bytes.extend(VERTICES.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    for triangle in TRIANGLES {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|k| k.to_le_bytes()));
    }
    bytes
}

fn buffer() -> Vec<u8> {
    let mut bytes: Vec<u8> =
        VERTICES.as_flattened().iter().flat_map(|x| (x * 1e-3).to_le_bytes()).collect();
    bytes.extend(TRIANGLES.as_flattened().iter().flat_map(|k| k.to_le_bytes()));
    bytes
}

fn gltf_text(buffer: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
"nodes":[{{"children":[1],"translation":[1,0,0]}},{{"mesh":0,"scale":[1,1,1]}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":4}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
{{"bufferView":1,"componentType":5125,"count":36,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":144}}],
"buffers":[{{"byteLength":240{buffer}}}]}}"#
    )
}

pub(crate) fn gltf() -> Vec<u8> {
    use base64::Engine;
    let text = base64::engine::general_purpose::STANDARD.encode(buffer());
    gltf_text(&format!(r#","uri":"data:application/octet-stream;base64,{text}""#)).into_bytes()
}

pub(crate) fn glb() -> Vec<u8> {
    let mut text = gltf_text("").into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let buffer = buffer();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + text.len() as u32 + buffer.len() as u32).to_le_bytes());
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}

/// The model part of a 3MF package.
pub(crate) fn model() -> Vec<u8> {
    let mut text = r#"<?xml version="1.0"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1" type="model"><mesh><vertices>"#
        .to_string();
    for [x, y, z] in VERTICES {
        text += &format!(r#"<vertex x="{x}" y="{y}" z="{z}"/>"#);
    }
    text += "</vertices><triangles>";
    for [a, b, c] in TRIANGLES {
        text += &format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#);
    }
    text += r#"</triangles></mesh></object><object id="2"><components>
<component objectid="1" transform="1 0 0 0 1 0 0 0 1 50 0 0"/><component objectid="1"/>
</components></object></resources><build><item objectid="2"/></build></model>"#;
    text.into_bytes()
}

/// A 3MF package with this model part.
pub(crate) fn package(model: Vec<u8>) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    zip.start_file("3D/3dmodel.model", options).unwrap();
    zip.write_all(&model).unwrap();
    zip.finish().unwrap().into_inner()
}

pub(crate) fn zipped(bytes: Vec<u8>) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&bytes).unwrap();
    encoder.finish().unwrap()
}

pub(crate) fn case() -> Vec<u8> {
    br#"{"A_I":[{"outer":[[-0.01,-0.01],[0.01,-0.01],[0.01,0.01],[-0.01,0.01]],
"holes":[[[-0.002,-0.002],[0.002,-0.002],[0,0.003]]]}],
"A_II":[{"outer":[[-0.008,-0.01],[0.01,-0.012],[0.009,0.01]]}],
"d":0.02,"Fn":100,"F":[3,-2,5],"M":[0.1,-0.05,0.2]}"#
        .to_vec()
}

pub(crate) fn gripper() -> Vec<u8> {
    gripfast::gripper::catalogue::text("generic").unwrap().into_bytes()
}

pub(crate) fn scene() -> Vec<u8> {
    br#"[part]
position = ["0.5m", "0mm", "100mm"]
rpy = ["0deg", "0deg", "90deg"]

[[obstacle]]
name = "table"
plane = [0.0, 0.0, 1.0]
position = ["0mm", "0mm", "0mm"]

[[obstacle]]
name = "box"
box = ["100mm", "50mm", "80mm"]
position = ["300mm", "0mm", "40mm"]
"#
    .to_vec()
}

//! glTF and GLB, by `gltf`: all triangles of the default scene with their nodes' transforms, in
//! metres.

use std::io::Read;

use glam::{DAffine3, DMat4, DVec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Gltf, Semantic};

use super::Source;
use crate::error::{Error, Result};
use crate::part::unit::Unit;
use crate::part::weld::{Soup, Welder};

/// Most nodes placed: a damaged file may refer to itself.
const MOST_PLACED: usize = 1 << 20;
const REMEDY: &str = "repair the file or export it again";

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let mut bytes = Vec::new();
    source.reader.read_to_end(&mut bytes).map_err(|fault| source.fault(fault))?;
    let Gltf { document, blob } = Gltf::from_slice(&bytes).map_err(|fault| {
        source.bad(
            format!("is not a readable glTF file: {fault}"),
            "export it again, without compression of the meshes",
        )
    })?;
    drop(bytes);
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => blob.clone().unwrap_or_default(),
            gltf::buffer::Source::Uri(uri) => external(source, uri)?,
        };
        if data.len() < buffer.length() {
            let problem = format!("holds {} bytes of {} stated", data.len(), buffer.length());
            return Err(source.bad_at(
                format!("buffer {}", buffer.index()),
                problem,
                "export or copy the file again",
            ));
        }
        buffers.push(data);
    }
    let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
        return Err(source.bad("holds no scene", REMEDY));
    };
    let mut welder = Welder::default();
    let mut warnings = Vec::new();
    let mut placed = 0;
    let mut stack: Vec<(gltf::Node, DAffine3)> =
        scene.nodes().map(|node| (node, DAffine3::IDENTITY)).collect();
    stack.reverse(); // nodes in the file's order
    while let Some((node, outer)) = stack.pop() {
        placed += 1;
        if placed > MOST_PLACED {
            return Err(source.bad("its nodes are nested without end", REMEDY));
        }
        let matrix = node.transform().matrix().map(|column| column.map(f64::from));
        let place = outer * DAffine3::from_mat4(DMat4::from_cols_array_2d(&matrix));
        if let Some(mesh) = node.mesh() {
            if node.skin().is_some() {
                warnings.push(format!(
                    "mesh {} is moved by a skeleton: its rest shape was read",
                    mesh.index()
                ));
            }
            for primitive in mesh.primitives() {
                let at = || format!("mesh {}, primitive {}", mesh.index(), primitive.index());
                add(source, &primitive, &buffers, place, &mut welder).map_err(|problem| {
                    match problem {
                        Problem::Text(text) => source.bad_at(at(), text, REMEDY),
                        Problem::Error(error) => error,
                    }
                })?;
            }
        }
        stack.extend(node.children().map(|child| (child, place)));
    }
    Ok(welder.finish(Some(Unit::Metre), warnings))
}

enum Problem {
    Text(String),
    Error(Error),
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

fn add(
    source: &Source<'_>,
    primitive: &gltf::Primitive<'_>,
    buffers: &[Vec<u8>],
    place: DAffine3,
    welder: &mut Welder,
) -> std::result::Result<(), Problem> {
    if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
        return Ok(()); // bounds no material
    }
    let Some(accessor) = primitive.get(&Semantic::Positions) else { return Ok(()) };
    if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
        return Err(Problem::Text(
            "its positions are not 32-bit floats (compressed or quantised)".to_string(),
        ));
    }
    let mut vertices = Vec::new();
    for item in items(&accessor, buffers)? {
        let float = |k: usize| {
            f64::from(f32::from_le_bytes([
                item[4 * k],
                item[4 * k + 1],
                item[4 * k + 2],
                item[4 * k + 3],
            ]))
        };
        vertices.push(source.finite(
            place.transform_point3(DVec3::new(float(0), float(1), float(2))),
            vertices.len() + 1,
        )?);
    }
    let indices: Vec<u32> = match primitive.indices() {
        None => (0..vertices.len() as u32).collect(),
        Some(accessor) => {
            let wide = |item: &[u8]| {
                item.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte))
            };
            match (accessor.data_type(), accessor.dimensions()) {
                (DataType::U8 | DataType::U16 | DataType::U32, Dimensions::Scalar) => {
                    items(&accessor, buffers)?.map(wide).collect()
                }
                _ => return Err(Problem::Text("its indices are no unsigned integers".to_string())),
            }
        }
    };
    let corners = |k: usize| match primitive.mode() {
        Mode::TriangleStrip if k % 2 == 1 => [k + 1, k, k + 2],
        Mode::TriangleStrip => [k, k + 1, k + 2],
        Mode::TriangleFan => [0, k + 1, k + 2],
        _ => [3 * k, 3 * k + 1, 3 * k + 2],
    };
    let count = if primitive.mode() == Mode::Triangles {
        indices.len() / 3
    } else {
        indices.len().saturating_sub(2)
    };
    for triangle in 0..count {
        source.polygon(welder, &vertices, &corners(triangle).map(|k| indices[k]), triangle + 1)?;
    }
    Ok(())
}

/// The raw items of an accessor. The library's own iterator trusts offsets and counts; here they
/// are checked.
fn items<'a>(
    accessor: &Accessor<'_>,
    buffers: &'a [Vec<u8>],
) -> std::result::Result<impl Iterator<Item = &'a [u8]>, Problem> {
    let bad = || Problem::Text(format!("accessor {} reaches beyond its data", accessor.index()));
    if accessor.sparse().is_some() {
        return Err(Problem::Text("its data are sparse, which is not read".to_string()));
    }
    let view = accessor.view().ok_or_else(bad)?;
    let size = accessor.size();
    let stride = view.stride().unwrap_or(size).max(1);
    let end_of_view = view.offset().checked_add(view.length()).ok_or_else(bad)?;
    let data = buffers
        .get(view.buffer().index())
        .and_then(|data| data.get(view.offset()..end_of_view))
        .ok_or_else(bad)?;
    let count = accessor.count();
    let data = if count == 0 {
        &data[..0]
    } else {
        let length = stride
            .checked_mul(count - 1)
            .and_then(|length| length.checked_add(size))
            .ok_or_else(bad)?;
        let end = accessor.offset().checked_add(length).ok_or_else(bad)?;
        data.get(accessor.offset()..end).ok_or_else(bad)?
    };
    Ok(data.chunks(stride).take(count).map(move |item| &item[..size.min(item.len())]))
}

/// A buffer kept outside of the file: beside it, or written into the text.
fn external(source: &Source<'_>, uri: &str) -> Result<Vec<u8>> {
    if let Some((_, text)) = uri.strip_prefix("data:").and_then(|rest| rest.split_once(";base64,"))
    {
        return base64(text).ok_or_else(|| source.bad("a buffer in the text is damaged", REMEDY));
    }
    if uri.contains(':') {
        return Err(source
            .bad(format!("its buffer '{uri}' lies elsewhere"), "save the part as one .glb file"));
    }
    let path = source.path.with_file_name(uri);
    std::fs::read(&path).map_err(|error| Error::io(&path, "read", error))
}

fn base64(text: &str) -> Option<Vec<u8>> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0_u32, 0);
    for letter in text.trim_end_matches('=').bytes() {
        let value = LETTERS.iter().position(|&known| known == letter)?;
        bits = bits << 6 | value as u32;
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
            bits &= (1 << held) - 1;
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    #[test]
    fn base64_decodes() {
        assert_eq!(super::base64("TWFueSBoYW5kcw==").unwrap(), b"Many hands");
        assert!(super::base64("T*").is_none());
    }
}

//! glTF and GLB, by `gltf`: all triangles of the default scene with their nodes' transforms, in
//! metres.

use std::borrow::Cow;
use std::path::{Component, Path};

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use glam::{DAffine3, DMat4, DVec3, DVec4};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Gltf, Semantic};
use rustc_hash::FxHashMap;

use super::Source;
use crate::error::{Error, ErrorKind, Result};
use crate::part::weld::{Soup, Welder};
use crate::units::Unit;

/// Most nodes placed: a damaged file may refer to itself.
const MOST_PLACED: usize = 1 << 20;
const REMEDY: &str = "repair the file or export it again";

/// Base64 of buffers in the text, with or without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let bytes = source.bytes()?;
    let Gltf { document, blob } = Gltf::from_slice(&bytes).map_err(|fault| {
        source.bad(
            format!("is not a readable glTF file: {fault}"),
            "export it again, without compression of the meshes",
        )
    })?;
    drop(bytes);
    check_version(source, &document.as_json().asset)?;
    let mut buffers: Vec<Cow<'_, [u8]>> = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => Cow::Borrowed(blob.as_deref().unwrap_or_default()),
            gltf::buffer::Source::Uri(uri) => Cow::Owned(external(source, uri)?),
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
    let placed = placed(source, &scene)?;
    let meshes = || placed.iter().filter_map(|(node, _)| node.mesh());
    // Counted before one is placed; a claim beyond the data is refused when it is placed.
    let triangles = meshes().flat_map(|mesh| mesh.primitives()).map(|primitive| {
        let corners = primitive.indices().or_else(|| primitive.get(&Semantic::Positions));
        let there = corners.filter(|accessor| items(accessor, &buffers).is_ok());
        there.map_or(0, |accessor| count(primitive.mode(), accessor.count()) as u64)
    });
    source.room_for(triangles.fold(0, u64::saturating_add))?;
    let mut scene = Scene { source, buffers, positions: FxHashMap::default() };
    let mut welder = Welder::default();
    let mut warnings = Vec::new();
    for (node, place) in &placed {
        let Some(mesh) = node.mesh() else { continue };
        if node.skin().is_some() {
            warnings.push(format!(
                "mesh {} is moved by a skeleton: its rest shape was read",
                mesh.index()
            ));
        }
        for primitive in mesh.primitives() {
            let at = || format!("mesh {}, primitive {}", mesh.index(), primitive.index());
            scene.add(&primitive, *place, &mut welder).map_err(|problem| match problem {
                Problem::Text(text) => scene.source.bad_at(at(), text, REMEDY),
                Problem::Error(error) => error,
            })?;
        }
    }
    Ok(welder.finish(Some(Unit::Metre), warnings))
}

/// Refuses a version that a later format may have changed.
fn check_version(source: &Source<'_>, asset: &gltf::json::Asset) -> Result<()> {
    let newer = |text: &str| -> bool { text.trim() != "2.0" };
    let minimum = asset.min_version.as_deref();
    let unknown =
        if asset.version.trim().strip_prefix("2.").is_none_or(|minor| {
            minor.is_empty() || !minor.bytes().all(|digit| digit.is_ascii_digit())
        }) {
            Some(asset.version.as_str())
        } else {
            minimum.filter(|text| newer(text))
        };
    match unknown {
        None => Ok(()),
        Some(version) => Err(source
            .bad(
                format!("is glTF of version '{}'; 2.0 is read", version.escape_debug()),
                "export the part as glTF 2.0",
            )
            .with_kind(ErrorKind::Unsupported)),
    }
}

/// All nodes of a scene in the file's order with their places in it.
fn placed<'a>(
    source: &Source<'_>,
    scene: &gltf::Scene<'a>,
) -> Result<Vec<(gltf::Node<'a>, DAffine3)>> {
    let mut placed = Vec::new();
    let mut stack: Vec<(gltf::Node, DAffine3)> =
        scene.nodes().map(|node| (node, DAffine3::IDENTITY)).collect();
    stack.reverse();
    while let Some((node, outer)) = stack.pop() {
        if placed.len() >= MOST_PLACED {
            return Err(source
                .bad("its nodes are nested without end", REMEDY)
                .with_kind(ErrorKind::Limit));
        }
        let matrix = DMat4::from_cols_array_2d(
            &node.transform().matrix().map(|column| column.map(f64::from)),
        );
        if !matrix.is_finite() || matrix.row(3) != DVec4::W {
            let problem = "its transform is no finite motion of space (the last row is 0 0 0 1)";
            return Err(source.bad_at(format!("node {}", node.index()), problem, REMEDY));
        }
        let place = outer * DAffine3::from_mat4(matrix);
        stack.extend(node.children().map(|child| (child, place)));
        placed.push((node, place));
    }
    Ok(placed)
}

/// Triangles of `corners` corners drawn in this mode; points and lines bound no material.
fn count(mode: Mode, corners: usize) -> usize {
    match mode {
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => 0,
        Mode::Triangles => corners / 3,
        Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
    }
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

/// What placing meshes needs.
struct Scene<'a, 'b> {
    source: &'a Source<'b>,
    buffers: Vec<Cow<'a, [u8]>>,
    /// Positions by the number of their accessor, as read: many meshes may share them.
    positions: FxHashMap<usize, Vec<DVec3>>,
}

impl Scene<'_, '_> {
    fn add(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        place: DAffine3,
        welder: &mut Welder,
    ) -> std::result::Result<(), Problem> {
        let mode = primitive.mode();
        let Some(accessor) = primitive.get(&Semantic::Positions) else { return Ok(()) };
        let indices = primitive.indices();
        let corners = indices.as_ref().unwrap_or(&accessor).count();
        if count(mode, corners) == 0 {
            return Ok(());
        }
        if !self.positions.contains_key(&accessor.index()) {
            let vertices = self.vertices(&accessor)?;
            self.positions.insert(accessor.index(), vertices);
        }
        let vertices = &self.positions[&accessor.index()];
        let index = self.indices(indices.as_ref())?;
        for triangle in 0..count(mode, corners) {
            let numbers = match mode {
                Mode::TriangleStrip if triangle % 2 == 1 => [triangle + 1, triangle, triangle + 2],
                Mode::TriangleStrip => [triangle, triangle + 1, triangle + 2],
                Mode::TriangleFan => [0, triangle + 1, triangle + 2],
                _ => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
            };
            let numbers = numbers.map(&index);
            self.source.placed_triangle(welder, vertices, numbers, place, triangle + 1)?;
        }
        Ok(())
    }

    /// The positions of an accessor, not yet placed.
    fn vertices(&self, accessor: &Accessor<'_>) -> std::result::Result<Vec<DVec3>, Problem> {
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return Err(Problem::Text(
                "its positions are not 32-bit floats (compressed or quantised)".to_string(),
            ));
        }
        let items = items(accessor, &self.buffers)?;
        self.source.hold((items.len() * size_of::<DVec3>()) as u64)?;
        let mut vertices = Vec::with_capacity(items.len());
        for item in items {
            let float = |k: usize| {
                f64::from(f32::from_le_bytes([
                    item[4 * k],
                    item[4 * k + 1],
                    item[4 * k + 2],
                    item[4 * k + 3],
                ]))
            };
            let position = DVec3::new(float(0), float(1), float(2));
            vertices.push(self.source.finite(position, vertices.len() + 1)?);
        }
        Ok(vertices)
    }

    /// Vertex number by corner number: as listed, or the corner's own.
    fn indices<'a>(
        &'a self,
        accessor: Option<&Accessor<'_>>,
    ) -> std::result::Result<impl Fn(usize) -> u32 + 'a, Problem> {
        let listed = match accessor {
            None => None,
            Some(accessor) => match (accessor.data_type(), accessor.dimensions()) {
                (DataType::U8 | DataType::U16 | DataType::U32, Dimensions::Scalar) => {
                    Some(items(accessor, &self.buffers)?.collect::<Vec<_>>())
                }
                _ => return Err(Problem::Text("its indices are no unsigned integers".to_string())),
            },
        };
        Ok(move |corner: usize| match &listed {
            None => corner as u32, // no more corners than MAX_TRIANGLES
            Some(items) => {
                items[corner].iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte))
            }
        })
    }
}

/// The raw items of an accessor. The library's own iterator trusts offsets and counts; here they
/// are checked.
fn items<'a>(
    accessor: &Accessor<'_>,
    buffers: &'a [Cow<'_, [u8]>],
) -> std::result::Result<impl ExactSizeIterator<Item = &'a [u8]>, Problem> {
    let bad = || Problem::Text(format!("accessor {} reaches beyond its data", accessor.index()));
    if accessor.sparse().is_some() {
        return Err(Problem::Text("its data are sparse, which is not read".to_string()));
    }
    let view = accessor.view().ok_or_else(bad)?;
    let size = accessor.size();
    let stride = view.stride().unwrap_or(size);
    if stride < size.max(1) {
        return Err(Problem::Text(format!("accessor {}: its items overlap", accessor.index())));
    }
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
    let short: String = uri.chars().take(60).collect();
    let short = short.escape_debug();
    if let Some((_, text)) = uri.strip_prefix("data:").and_then(|rest| rest.split_once(";base64,"))
    {
        source.hold((text.len() / 4 * 3) as u64)?;
        return BASE64
            .decode(text)
            .map_err(|_| source.bad("a buffer in the text is damaged", REMEDY));
    }
    let remedy = "save the part as one .glb file";
    let elsewhere =
        || source.bad(format!("its buffer '{short}' lies outside of the part's folder"), remedy);
    let name = percent_decoded(uri).ok_or_else(|| {
        source.bad(format!("the name of its buffer '{short}' is badly encoded"), remedy)
    })?;
    if uri.contains("://") || name.contains('\0') {
        return Err(elsewhere());
    }
    let path = source.path.with_file_name(&name);
    if !source.options.outside_buffers {
        let within = Path::new(&name).components().all(|part| matches!(part, Component::Normal(_)));
        let folder = source.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let real = |path: &Path| std::fs::canonicalize(path);
        // A link inside of the folder may point out of it.
        let follows = match (real(&path), real(folder.unwrap_or(Path::new(".")))) {
            (Ok(path), Ok(folder)) => path.starts_with(folder),
            _ => true, // not there: opening it says so
        };
        if !within || !follows {
            return Err(elsewhere());
        }
    }
    let meta = std::fs::metadata(&path).map_err(|error| Error::io(&path, "read", error))?;
    if !meta.is_file() {
        return Err(source.bad(format!("its buffer '{short}' is no file"), remedy));
    }
    source.hold(meta.len())?;
    std::fs::read(&path).map_err(|error| Error::io(&path, "read", error))
}

/// `%20` and the like as the bytes they stand for; `None` when one is cut short or the bytes are no
/// text.
fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let mut digit = || char::from(rest.next()?).to_digit(16);
            bytes.push((digit()? * 16 + digit()?) as u8);
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_decoded() {
        assert_eq!(percent_decoded("a%20b%C3%A9.bin").unwrap(), "a b\u{e9}.bin");
        for bad in ["%", "%2", "%zz", "%ff"] {
            assert!(percent_decoded(bad).is_none(), "{bad}");
        }
    }
}

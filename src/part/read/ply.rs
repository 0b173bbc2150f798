//! PLY in its three encodings, by `ply-rs-bw`.

use glam::DVec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{Header, Property, PropertyAccess, PropertyAccessResult, PropertyType};

use super::Source;
use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::part::weld::{Soup, Welder};

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    if !source.peek()?.starts_with(b"ply") {
        return Err(
            source.bad("does not begin with 'ply': not a PLY file", "export the part as PLY again")
        );
    }
    let place = source.place.clone();
    let fault = |reader: &Reader<_>, fault: ParseError| {
        let line = fault.line().unwrap_or(reader.line());
        Error::format(
            format!("{place}, line {line}"),
            format!("not a readable PLY file: {}", first_line(&fault.to_string())),
            "repair the file or export it again",
        )
    };
    let mut reader = Reader::new(&mut source.reader);
    let header =
        Parser::<Skip>::new().read_header(&mut reader).map_err(|error| fault(&reader, error))?;
    check(&place, &source.budget, &header)?;
    let (mut points, mut faces, mut has_faces) = (Vec::new(), Vec::new(), false);
    for (_, element) in &header.elements {
        match element.name.as_str() {
            "vertex" => {
                points = Parser::<Point>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|error| fault(&reader, error))?
            }
            "face" | "tri" => {
                has_faces = true;
                faces = Parser::<Face>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|error| fault(&reader, error))?;
            }
            _ => {
                let skipped =
                    Parser::<Skip>::new().read_payload_for_element(&mut reader, element, &header);
                skipped.map_err(|error| fault(&reader, error))?;
            }
        }
    }
    if !has_faces {
        return Err(source.bad(
            "holds points but no 'face' element",
            "export a surface mesh, not a point cloud or triangle strips",
        ));
    }
    let mut vertices = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        vertices.push(source.finite(DVec3::from_array(point.0), index + 1)?);
    }
    let mut welder = Welder::default();
    for (index, face) in faces.iter().enumerate() {
        source.polygon(&mut welder, &vertices, &face.0, index + 1)?;
    }
    Ok(welder.finish(None, Vec::new()))
}

/// Refuses what the library would take for a surface without its coordinates or corners, and counts
/// beyond the memory allowed: the library keeps a value for each.
fn check(place: &str, budget: &Budget, header: &Header) -> Result<()> {
    let bad = |problem: String| {
        Err(Error::format(format!("{place}, header"), problem, "export the part as PLY again"))
    };
    for (name, element) in &header.elements {
        let scalar = |axis: &str| {
            element
                .properties
                .get(axis)
                .is_some_and(|property| matches!(property.data_type, PropertyType::Scalar(_)))
        };
        let corners = ["vertex_index", "vertex_indices"].iter().any(|list| {
            element
                .properties
                .get(*list)
                .is_some_and(|property| matches!(property.data_type, PropertyType::List(..)))
        });
        if element.properties.is_empty() && element.count > 0 {
            return bad(format!("element '{}' has no property", name.escape_debug()));
        }
        match name.as_str() {
            "vertex" if !["x", "y", "z"].into_iter().all(scalar) => {
                return bad("element 'vertex' lacks one of x, y, z".to_string());
            }
            "face" | "tri" if !corners => {
                return bad("its faces have no list 'vertex_index'".to_string());
            }
            _ => {}
        }
        let each = match name.as_str() {
            "vertex" => size_of::<Point>() + size_of::<DVec3>(),
            "face" | "tri" => size_of::<Face>() + 16, // a list of up to four corners
            _ => 0,
        };
        budget.hold(place, (element.count as u64).saturating_mul(each as u64))?;
    }
    Ok(())
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

struct Point([f64; 3]);

impl PropertyAccess for Point {
    fn new() -> Self {
        Self([0.0; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|&axis| axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.0[axis] = match property {
            Property::Float(value) => f64::from(value),
            Property::Double(value) => value,
            Property::Char(value) => f64::from(value),
            Property::UChar(value) => f64::from(value),
            Property::Short(value) => f64::from(value),
            Property::UShort(value) => f64::from(value),
            Property::Int(value) => f64::from(value),
            Property::UInt(value) => f64::from(value),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

struct Face(Vec<u32>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_index" | "vertex_indices") {
            return PropertyAccessResult::Ignored;
        }
        // A negative index becomes one that surely does not exist and is refused with the face's
        // number.
        let signed = |value: i64| u32::try_from(value).unwrap_or(u32::MAX);
        self.0 = match property {
            Property::ListChar(list) => {
                list.into_iter().map(|index| signed(index.into())).collect()
            }
            Property::ListUChar(list) => list.into_iter().map(u32::from).collect(),
            Property::ListShort(list) => {
                list.into_iter().map(|index| signed(index.into())).collect()
            }
            Property::ListUShort(list) => list.into_iter().map(u32::from).collect(),
            Property::ListInt(list) => list.into_iter().map(|index| signed(index.into())).collect(),
            Property::ListUInt(list) => list,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// An element that says nothing about the surface.
struct Skip;

impl PropertyAccess for Skip {
    fn new() -> Self {
        Self
    }
}

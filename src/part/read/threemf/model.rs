//! A model part of a 3MF package: its objects and what is built of them.

use std::io::BufRead;

use glam::DVec3;
use quick_xml::Reader;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use rustc_hash::FxHashMap;

use super::super::Source;
use super::REMEDY;
use crate::error::{Error, ErrorKind, Result};
use crate::units::Unit;

/// Deepest nesting of elements; the format needs six.
const DEEPEST: usize = 64;
/// Outermost names of an element's path that are looked at.
const NAMES: usize = 8;

/// Extensions that a file may require: they say nothing about the shape, or are read.
const KNOWN: [&str; 3] = [
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02", // said to be left out
];

/// One model part.
pub(super) struct Model {
    pub unit: Unit,
    pub objects: FxHashMap<u32, Object>,
    /// What is built, in the file's order.
    pub items: Vec<Placed>,
}

impl Model {
    /// Other model parts that this one names.
    pub(super) fn paths(&self) -> impl Iterator<Item = &str> {
        let components = self.objects.values().filter_map(|object| match &object.shape {
            Shape::Components(components) => Some(components),
            _ => None,
        });
        components.flatten().chain(&self.items).filter_map(|placed| placed.path.as_deref())
    }
}

/// One object.
pub(super) struct Object {
    /// A support or other aid of printing.
    pub aid: bool,
    pub shape: Shape,
}

pub(super) enum Shape {
    Mesh {
        vertices: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        /// It has a beam lattice beside its triangles.
        beams: bool,
    },
    Components(Vec<Placed>),
    /// A shape of an extension, by its name.
    Other(String),
    None,
}

/// An object that is referred to with a transform.
pub(super) struct Placed {
    pub object: u32,
    /// The model part it is defined in, where not this one.
    pub path: Option<String>,
    pub transform: Option<[f64; 12]>,
}

/// Reads the model part `name`.
pub(super) fn read(source: &Source<'_>, name: &str, input: &mut dyn BufRead) -> Result<Model> {
    let mut text = Text { source, name, object: None };
    let mut model = Model { unit: Unit::Millimetre, objects: FxHashMap::default(), items: vec![] };
    let mut open: Option<(u32, Object)> = None;
    let mut found = false;
    text.elements(input, |text, path, element| {
        let inner = || path.join("/");
        match path {
            ["model"] => {
                found = true;
                model.unit = text.model(element)?;
            }
            ["model", "resources", "object"] => {
                let id = text.index(element, "id", &inner)?;
                text.object = Some(id);
                let kind = text.attribute(element, "type")?;
                let aid = matches!(kind.as_deref(), Some("support" | "solidsupport" | "other"));
                if let Some((id, object)) = open.take() {
                    text.insert(&mut model, id, object)?;
                }
                open = Some((id, Object { aid, shape: Shape::None }));
            }
            ["model", "build", "item"] => {
                text.object = None;
                model.items.push(text.placed(element)?);
            }
            ["model", "resources", "object", rest @ ..] => {
                if let Some((_, object)) = &mut open {
                    text.part_of_object(object, rest, element)?;
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    if let Some((id, object)) = open {
        text.insert(&mut model, id, object)?;
    }
    if !found {
        return Err(text.bad("", "holds no model"));
    }
    Ok(model)
}

/// The target of the relationship that names the root model, in `_rels/.rels`.
pub(super) fn start_part(
    source: &Source<'_>,
    name: &str,
    input: &mut dyn BufRead,
) -> Result<Option<String>> {
    const KIND: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
    let mut found = None;
    Text { source, name, object: None }.elements(input, |text, path, element| {
        if path == ["Relationships", "Relationship"]
            && text.attribute(element, "Type")?.as_deref() == Some(KIND)
        {
            found = text.attribute(element, "Target")?.map(|target| in_archive(&target));
        }
        Ok(())
    })?;
    Ok(found)
}

/// The name in the archive of a part that the package names from its root.
fn in_archive(path: &str) -> String {
    path.trim_start_matches('/').to_string()
}

/// The text of one part, for reading and for messages.
struct Text<'a, 'b> {
    source: &'a Source<'b>,
    name: &'a str,
    /// The object being read.
    object: Option<u32>,
}

impl Text<'_, '_> {
    fn bad(&self, at: &str, problem: impl Into<String>) -> Error {
        let object = self.object.map_or(String::new(), |id| format!(", object {id}"));
        let at = if at.is_empty() { String::new() } else { format!(", {at}") };
        self.source.bad_at(format!("{}{object}{at}", self.name), problem, REMEDY)
    }

    /// Calls `take` with the path of local names and the start tag of every element.
    fn elements(
        &mut self,
        input: &mut dyn BufRead,
        mut take: impl FnMut(&mut Self, &[&str], &BytesStart<'_>) -> Result<()>,
    ) -> Result<()> {
        let mut reader = Reader::from_reader(input);
        reader.config_mut().expand_empty_elements = true;
        let mut buffer = Vec::new();
        let mut path: Vec<String> = Vec::new();
        loop {
            buffer.clear();
            let at = reader.buffer_position();
            let event = reader.read_event_into(&mut buffer).map_err(|fault| {
                self.bad(&format!("byte {at}"), format!("is no well-formed XML: {fault}"))
            })?;
            match event {
                Event::Start(element) => {
                    if path.len() >= DEEPEST {
                        return Err(self
                            .bad(&format!("byte {at}"), "its elements are nested too deeply")
                            .with_kind(ErrorKind::Limit));
                    }
                    path.push(element.local_name().as_ref().to_string());
                    let names: [&str; NAMES] =
                        std::array::from_fn(|k| path.get(k).map_or("", String::as_str));
                    take(self, &names[..path.len().min(NAMES)], &element)?;
                }
                Event::End(_) => {
                    path.pop();
                }
                Event::Eof if path.is_empty() => return Ok(()),
                Event::Eof => {
                    return Err(self.bad(&format!("byte {at}"), "the text ends within an element"));
                }
                _ => {}
            }
        }
    }

    /// The value of an attribute by its local name.
    fn attribute(&self, element: &BytesStart<'_>, name: &str) -> Result<Option<String>> {
        for attribute in element.attributes() {
            let attribute = attribute
                .map_err(|fault| self.bad("", format!("a tag is no well-formed XML: {fault}")))?;
            if attribute.key.local_name().as_ref() == name {
                let value = attribute.normalized_value(XmlVersion::Implicit1_0);
                return value.map(|value| Some(value.into_owned())).map_err(|fault| {
                    self.bad("", format!("attribute '{name}' cannot be read: {fault}"))
                });
            }
        }
        Ok(None)
    }

    /// The unit; refuses extensions that could change the shape.
    fn model(&self, element: &BytesStart<'_>) -> Result<Unit> {
        let required = self.attribute(element, "requiredextensions")?.unwrap_or_default();
        for prefix in required.split_ascii_whitespace() {
            let space = self.attribute(element, prefix)?.unwrap_or_default();
            if !KNOWN.contains(&space.as_str()) {
                let problem = format!(
                    "requires the extension '{}', which is not read",
                    if space.is_empty() { prefix } else { &space }.escape_debug()
                );
                return Err(self.bad("", problem).with_kind(ErrorKind::Unsupported));
            }
        }
        match self.attribute(element, "unit")?.as_deref() {
            Some("micron") => Ok(Unit::Micrometre),
            Some("centimeter") => Ok(Unit::Centimetre),
            Some("inch") => Ok(Unit::Inch),
            Some("foot") => Ok(Unit::Foot),
            Some("meter") => Ok(Unit::Metre),
            Some("millimeter") | None => Ok(Unit::Millimetre), // the format's own default
            Some(other) => {
                Err(self.bad("", format!("unit '{}' is none of the format's", shorten(other))))
            }
        }
    }

    /// What an element within an object adds to it.
    fn part_of_object(
        &self,
        object: &mut Object,
        path: &[&str],
        element: &BytesStart<'_>,
    ) -> Result<()> {
        match (path, &mut object.shape) {
            (["metadatagroup", ..], _) => {}
            (["mesh"], shape @ Shape::None) => {
                *shape = Shape::Mesh { vertices: vec![], triangles: vec![], beams: false };
            }
            (["components"], shape @ Shape::None) => *shape = Shape::Components(Vec::new()),
            (["mesh", "vertices", "vertex"], Shape::Mesh { vertices, .. }) => {
                self.source.hold(size_of::<DVec3>() as u64)?;
                vertices.push(self.vertex(element, vertices.len())?);
            }
            (["mesh", "triangles", "triangle"], Shape::Mesh { triangles, .. }) => {
                self.source.hold(size_of::<[u32; 3]>() as u64)?;
                let at = || format!("triangle {}", triangles.len());
                let [a, b, c] = ["v1", "v2", "v3"].map(|name| self.index(element, name, &at));
                let corners = [a?, b?, c?];
                triangles.push(corners);
            }
            (["mesh", "beamlattice"], Shape::Mesh { beams, .. }) => *beams = true,
            (["components", "component"], Shape::Components(components)) => {
                self.source.hold(size_of::<Placed>() as u64)?;
                components.push(self.placed(element)?);
            }
            (["mesh" | "components"], _) => return Err(self.bad("", "has two shapes")),
            ([other], shape) => *shape = Shape::Other(shorten(other)),
            _ => {}
        }
        Ok(())
    }

    /// Vertex `number` (from 0, as triangles count them).
    fn vertex(&self, element: &BytesStart<'_>, number: usize) -> Result<DVec3> {
        let mut position = [None; 3];
        for attribute in element.attributes() {
            let at = || format!("vertex {number}");
            let attribute = attribute
                .map_err(|fault| self.bad(&at(), format!("is no well-formed XML: {fault}")))?;
            let axis = match attribute.key.as_ref() {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => continue,
            };
            let value = number_of(&attribute.value).ok_or_else(|| {
                let name = ["x", "y", "z"][axis];
                let text = shorten(&attribute.value);
                self.bad(&at(), format!("{name} = '{text}' is not a finite number"))
            })?;
            position[axis] = Some(value);
        }
        match position {
            [Some(x), Some(y), Some(z)] => Ok(DVec3::new(x, y, z)),
            _ => Err(self.bad(&format!("vertex {number}"), "lacks one of x, y, z")),
        }
    }

    /// A whole number in an attribute.
    fn index(&self, element: &BytesStart<'_>, name: &str, at: &dyn Fn() -> String) -> Result<u32> {
        let attribute = element.attributes().find(|attribute| {
            attribute.as_ref().map_or(true, |attribute| attribute.key.as_ref() == name)
        });
        let attribute = match attribute {
            None => return Err(self.bad(&at(), format!("lacks '{name}'"))),
            Some(found) => {
                found.map_err(|fault| self.bad(&at(), format!("is no well-formed XML: {fault}")))?
            }
        };
        attribute.value.trim().parse().map_err(|_| {
            let text = shorten(&attribute.value);
            self.bad(&at(), format!("{name} = '{text}' is not a whole number"))
        })
    }

    /// An object referred to by an item or a component.
    fn placed(&self, element: &BytesStart<'_>) -> Result<Placed> {
        let object = self.index(element, "objectid", &|| "a build item or component".into())?;
        let path = self.attribute(element, "path")?.map(|path| in_archive(&path));
        let transform = match self.attribute(element, "transform")? {
            None => None,
            Some(text) => {
                let numbers: Option<Vec<f64>> =
                    text.split_ascii_whitespace().map(number_of).collect();
                let transform = numbers.and_then(|numbers| <[f64; 12]>::try_from(numbers).ok());
                Some(transform.ok_or_else(|| {
                    self.bad(
                        &format!("the place of object {object}"),
                        format!("transform '{}' is not 12 finite numbers", shorten(&text)),
                    )
                })?)
            }
        };
        Ok(Placed { object, path, transform })
    }

    fn insert(&self, model: &mut Model, id: u32, object: Object) -> Result<()> {
        match model.objects.insert(id, object) {
            None => Ok(()),
            Some(_) => Err(self.source.bad_at(
                format!("{}, object {id}", self.name),
                "is there twice",
                REMEDY,
            )),
        }
    }
}

/// A finite number.
fn number_of(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|value: &f64| value.is_finite())
}

/// The first characters of a text from the file, for a message.
fn shorten(text: &str) -> String {
    text.chars().take(60).collect::<String>().escape_debug().to_string()
}

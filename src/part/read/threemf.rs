//! 3MF, by `threemf2`: all build items with their transforms, in the package's unit.

use std::io::{Cursor, Read};

use glam::{DAffine3, DMat3, DVec3};
use threemf2::model::domain::component::Component;
use threemf2::model::domain::model::{Model, Unit as FileUnit};
use threemf2::model::domain::object::{ObjectKind, ObjectType};
use threemf2::model::domain::transform::Transform;
use threemf2::package::ThreemfPackage;

use super::Source;
use crate::error::Result;
use crate::part::unit::Unit;
use crate::part::weld::{Soup, Welder};

/// Deepest nesting of components; a file that goes deeper refers to itself.
const DEEPEST: usize = 32;
/// Most objects placed in all: nested components could multiply without end.
const MOST_PLACED: usize = 1 << 20;

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let mut bytes = Vec::new();
    source.reader.read_to_end(&mut bytes).map_err(|fault| source.fault(fault))?;
    if !bytes.starts_with(b"PK") {
        return Err(source.bad("is no 3MF package (a zip archive)", "export the part as 3MF again"));
    }
    let package =
        ThreemfPackage::from_reader_with_memory_optimized_deserializer(Cursor::new(bytes), true)
            .map_err(|fault| {
                source.bad(
                    format!("is not a readable 3MF package: {fault}"),
                    "export the part as 3MF again, or as STL",
                )
            })?;
    let unit = match package.root.unit {
        Some(FileUnit::Micron) => Unit::Micrometre,
        Some(FileUnit::Centimeter) => Unit::Centimetre,
        Some(FileUnit::Inch) => Unit::Inch,
        Some(FileUnit::Foot) => Unit::Foot,
        Some(FileUnit::Meter) => Unit::Metre,
        Some(FileUnit::Millimeter) | None => Unit::Millimetre, // the format's own default
    };
    let mut placing = Placing {
        source,
        package: &package,
        welder: Welder::default(),
        placed: 0,
        warnings: Vec::new(),
        triangle: 0,
    };
    for item in &package.root.build.item {
        let path = item.path.as_ref().map(ToString::to_string);
        placing.object(item.objectid, path.as_deref(), affine(item.transform.as_ref()), 0)?;
    }
    let Placing { welder, warnings, .. } = placing;
    Ok(welder.finish(Some(unit), warnings))
}

/// The format multiplies row vectors from the left: its rows are the images of the axes.
fn affine(transform: Option<&Transform>) -> DAffine3 {
    let Some(Transform(m)) = transform else { return DAffine3::IDENTITY };
    let axes = DMat3::from_cols(
        DVec3::new(m[0], m[1], m[2]),
        DVec3::new(m[3], m[4], m[5]),
        DVec3::new(m[6], m[7], m[8]),
    );
    DAffine3::from_mat3_translation(axes, DVec3::new(m[9], m[10], m[11]))
}

struct Placing<'a, 'b> {
    source: &'a Source<'b>,
    package: &'a ThreemfPackage,
    welder: Welder,
    placed: usize,
    warnings: Vec<String>,
    /// Triangles met, for messages.
    triangle: usize,
}

impl Placing<'_, '_> {
    /// Adds object `id` of the model at `path` (the root model without one) and all its components.
    fn object(&mut self, id: u32, path: Option<&str>, place: DAffine3, depth: usize) -> Result<()> {
        let package = self.package;
        let where_ = || format!("object {id}");
        self.placed += 1;
        if depth > DEEPEST || self.placed > MOST_PLACED {
            return Err(self.source.bad_at(
                where_(),
                "its components are nested without end",
                "repair the file or export it again",
            ));
        }
        let model: Option<&Model> = match path {
            None => Some(&package.root),
            Some(path) => package
                .sub_models
                .iter()
                .find(|(known, _)| known.to_string() == path)
                .map(|(_, model)| model),
        };
        let object =
            model.and_then(|model| model.resources.object.iter().find(|object| object.id == id));
        let Some(object) = object else {
            return Err(self.source.bad_at(
                where_(),
                "is referred to but does not exist",
                "repair the file or export it again",
            ));
        };
        if matches!(
            object.objecttype,
            Some(ObjectType::Support | ObjectType::SolidSupport | ObjectType::Other)
        ) {
            return Ok(()); // printing aids, no part of the part
        }
        match &object.kind {
            Some(ObjectKind::Mesh(mesh)) => {
                let mut vertices = Vec::with_capacity(mesh.vertices.vertex.len());
                for (index, vertex) in mesh.vertices.vertex.iter().enumerate() {
                    let position = DVec3::new(vertex.x.value(), vertex.y.value(), vertex.z.value());
                    vertices.push(self.source.finite(place.transform_point3(position), index + 1)?);
                }
                for triangle in &mesh.triangles.triangle {
                    self.triangle += 1;
                    self.source.polygon(
                        &mut self.welder,
                        &vertices,
                        &[triangle.v1, triangle.v2, triangle.v3],
                        self.triangle,
                    )?;
                }
                if mesh.beamlattice.is_some() {
                    self.warnings.push(format!(
                        "the beam lattice of object {id} was left out: only its triangles were read"
                    ));
                }
                Ok(())
            }
            Some(ObjectKind::Components(components)) => {
                for Component { objectid, transform, path: inner, .. } in &components.component {
                    let inner = inner.as_ref().map(ToString::to_string);
                    self.object(
                        *objectid,
                        inner.as_deref().or(path),
                        place * affine(transform.as_ref()),
                        depth + 1,
                    )?;
                }
                Ok(())
            }
            Some(_) => Err(self.source.bad_at(
                where_(),
                "is a boolean or displaced shape, not a plain mesh",
                "export the result as a plain mesh",
            )),
            None => Ok(()),
        }
    }
}

//! 3MF: all build items with their transforms, in the package's unit. The archive by `zip`, the
//! text by `quick-xml`; what the text means is read here, because every number must be one: a
//! library that takes a damaged coordinate for zero moves a corner without a word.

use std::io::{BufRead, BufReader, Cursor, Read};

use glam::{DAffine3, DMat3, DVec3};
use rustc_hash::{FxHashMap, FxHashSet};
use zip::ZipArchive;

use super::Source;
use crate::error::{ErrorKind, Result};
use crate::part::weld::{Soup, Welder};

mod model;

use model::{Model, Placed, Shape};

/// Deepest nesting of components; a file that goes deeper refers to itself.
const DEEPEST: usize = 32;
/// Most objects placed in all: nested components could multiply without end.
const MOST_PLACED: usize = 1 << 20;
const REMEDY: &str = "repair the file or export it again";

type Archive = ZipArchive<Cursor<Vec<u8>>>;

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let bytes = source.bytes()?;
    if !bytes.starts_with(b"PK") {
        return Err(source.bad("is no 3MF package (a zip archive)", "export the part as 3MF again"));
    }
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|fault| {
        source.bad(
            format!("is not a readable 3MF package: {fault}"),
            "export the part as 3MF again, or as STL",
        )
    })?;
    let root = root(source, &mut archive)?;
    let mut models = FxHashMap::default();
    let mut wanted = vec![root.clone()];
    while let Some(name) = wanted.pop() {
        if models.contains_key(&name) {
            continue;
        }
        let model = part_of(source, &mut archive, &name, model::read)?;
        wanted.extend(model.paths().map(str::to_string));
        models.insert(name, model);
    }
    let unit = models[&root].unit;
    let mut placing = Placing {
        source,
        models: &models,
        sizes: FxHashMap::default(),
        welder: Welder::default(),
        placed: 0,
        warnings: Vec::new(),
        beams: FxHashSet::default(),
        triangle: 0,
    };
    let items = &models[&root].items;
    let mut total = 0_u64;
    for item in items {
        total = total.saturating_add(placing.size(item, &root, 0)?);
    }
    source.room_for(total)?;
    for item in items {
        placing.object(item, &root, DAffine3::IDENTITY)?;
    }
    let Placing { welder, warnings, .. } = placing;
    Ok(welder.finish(Some(unit), warnings))
}

/// The name of the root model, as the package's relationships state it.
fn root(source: &Source<'_>, archive: &mut Archive) -> Result<String> {
    const RELATIONSHIPS: &str = "_rels/.rels";
    const USUAL: &str = "3D/3dmodel.model";
    let stated = match archive.index_for_name(RELATIONSHIPS) {
        None => None,
        Some(_) => part_of(source, archive, RELATIONSHIPS, model::start_part)?,
    };
    Ok(stated.unwrap_or_else(|| USUAL.to_string()))
}

/// Reads one part of the package.
fn part_of<T>(
    source: &Source<'_>,
    archive: &mut Archive,
    name: &str,
    read: impl FnOnce(&Source<'_>, &str, &mut dyn BufRead) -> Result<T>,
) -> Result<T> {
    let place = name.escape_debug().to_string();
    let entry = archive.by_name(name).map_err(|fault| {
        source.bad(format!("its part '{place}' cannot be read: {fault}"), REMEDY)
    })?;
    // The size in the archive's list is a claim: the stream itself is limited.
    let limit = source.budget.limit();
    let mut reader = BufReader::new(entry.take(limit.saturating_add(1)));
    let outcome = read(source, &place, &mut reader);
    if reader.get_ref().limit() == 0 {
        return Err(source.budget.exceeded(&source.place, limit));
    }
    outcome
}

struct Placing<'a, 'b> {
    source: &'a Source<'b>,
    models: &'a FxHashMap<String, Model>,
    /// Triangles of an object with all its components.
    sizes: FxHashMap<(&'a str, u32), u64>,
    welder: Welder,
    placed: usize,
    warnings: Vec<String>,
    /// Objects whose beams were already spoken of.
    beams: FxHashSet<u32>,
    /// Triangles met, for messages.
    triangle: usize,
}

impl<'a> Placing<'a, '_> {
    /// The object that `item`, standing in the model at `path`, names; with its model's path.
    fn find(&self, item: &'a Placed, path: &'a str) -> Result<(&'a str, &'a model::Object)> {
        let path = item.path.as_deref().unwrap_or(path);
        let object = self.models.get(path).and_then(|model| model.objects.get(&item.object));
        object.map(|object| (path, object)).ok_or_else(|| {
            self.source.bad_at(
                format!("object {}", item.object),
                "is referred to but does not exist",
                REMEDY,
            )
        })
    }

    fn without_end(&self, id: u32) -> crate::error::Error {
        self.source
            .bad_at(format!("object {id}"), "its components are nested without end", REMEDY)
            .with_kind(ErrorKind::Limit)
    }

    /// Triangles that `item` stands for, counted without placing one.
    fn size(&mut self, item: &'a Placed, path: &'a str, depth: usize) -> Result<u64> {
        if depth > DEEPEST {
            return Err(self.without_end(item.object));
        }
        let (path, object) = self.find(item, path)?;
        if let Some(&known) = self.sizes.get(&(path, item.object)) {
            return Ok(known);
        }
        let mut size = 0_u64;
        match &object.shape {
            Shape::Mesh { triangles, .. } => size = triangles.len() as u64,
            Shape::Components(components) => {
                for component in components {
                    size = size.saturating_add(self.size(component, path, depth + 1)?);
                }
            }
            Shape::Other(_) | Shape::None => {}
        }
        self.sizes.insert((path, item.object), size);
        Ok(size)
    }

    /// Adds the object of `item`, which stands in the model at `path`, and all its components.
    fn object(&mut self, item: &'a Placed, path: &'a str, outer: DAffine3) -> Result<()> {
        let id = item.object;
        self.placed += 1;
        if self.placed > MOST_PLACED {
            return Err(self.without_end(id));
        }
        let (path, object) = self.find(item, path)?;
        if object.aid {
            return Ok(()); // a printing aid, no part of the part
        }
        let place = outer * affine(item.transform.as_ref());
        match &object.shape {
            Shape::Mesh { vertices, triangles, beams } => {
                for &corners in triangles {
                    self.triangle += 1;
                    self.source.placed_triangle(
                        &mut self.welder,
                        vertices,
                        corners,
                        place,
                        self.triangle,
                    )?;
                }
                if *beams && self.beams.insert(id) {
                    self.warnings.push(format!(
                        "the beam lattice of object {id} was left out: only its triangles were read"
                    ));
                }
            }
            Shape::Components(components) => {
                for component in components {
                    self.object(component, path, place)?;
                }
            }
            Shape::Other(what) => {
                return Err(self
                    .source
                    .bad_at(
                        format!("object {id}"),
                        format!("is a '{what}', not a plain mesh"),
                        "export the result as a plain mesh",
                    )
                    .with_kind(ErrorKind::Unsupported));
            }
            Shape::None => {}
        }
        Ok(())
    }
}

/// The format multiplies row vectors from the left: its rows are the images of the axes.
fn affine(transform: Option<&[f64; 12]>) -> DAffine3 {
    let Some(m) = transform else { return DAffine3::IDENTITY };
    let axes = DMat3::from_cols(
        DVec3::new(m[0], m[1], m[2]),
        DVec3::new(m[3], m[4], m[5]),
        DVec3::new(m[6], m[7], m[8]),
    );
    DAffine3::from_mat3_translation(axes, DVec3::new(m[9], m[10], m[11]))
}

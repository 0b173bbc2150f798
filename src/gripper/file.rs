//! Reading the gripper file: commented TOML in which every quantity carries its unit.

mod motion;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec2, DVec3};
use serde::Deserialize;

use motion::Motion;

use super::{Body, Gripper, Jaw, Moving, Shape, Source, Travel, layer, mesh, rectangle};
use crate::error::{Error, Result};
use crate::geometry::{convex_hull, is_convex, polygon, ring_area};
use crate::model::Frame;
use crate::text::with_shape;
use crate::units::Quantity;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    stroke: [String; 2],
    force: [String; 2],
    payload: Option<String>,
    moment: Option<[String; 3]>,
    pad: Pad,
    #[serde(default)]
    finger: Vec<Solid>,
    #[serde(default)]
    palm: Vec<Solid>,
    motion: Option<Motion>,
    flange: Option<Axes>,
    tool: Option<Axes>,
    #[serde(default)]
    source: BTreeMap<String, String>,
    #[serde(default)]
    unverified: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pad {
    rectangle: Option<[String; 2]>,
    polygon: Option<Vec<[String; 2]>>,
    /// Of jaw II, where it has another outline.
    #[serde(rename = "II")]
    other: Option<Outline>,
    thickness: Option<String>,
    modulus: Option<String>,
    poisson: Option<f64>,
    stiffness: Option<String>,
    outer_face: Option<String>,
    friction: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Outline {
    rectangle: Option<[String; 2]>,
    polygon: Option<Vec<[String; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Solid {
    name: String,
    /// Of a finger's body that only one jaw has.
    jaw: Option<Jaw>,
    r#box: Option<[String; 3]>,
    cylinder: Option<Cylinder>,
    hull: Option<Vec<[String; 3]>>,
    mesh: Option<MeshFile>,
    at: Option<[String; 3]>,
    rotate: Option<Rotation>,
}

/// A mesh file, its path relative to the gripper file; the unit is the file's own or millimetres.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshFile {
    file: PathBuf,
    unit: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cylinder {
    radius: String,
    length: String,
    axis: Axis,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Rotation {
    axis: Axis,
    angle: String,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum Axis {
    X1,
    X2,
    X3,
}

impl Axis {
    fn vector(self) -> DVec3 {
        match self {
            Self::X1 => DVec3::X,
            Self::X2 => DVec3::Y,
            Self::X3 => DVec3::Z,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Axes {
    origin: [String; 3],
    y: Option<[f64; 3]>,
    z: Option<[f64; 3]>,
}

/// Reads a gripper file.
///
/// # Errors
/// When the file cannot be read, and as [`parse`].
pub fn read(path: &Path) -> Result<Gripper> {
    let bytes = crate::file::read(path)?;
    let place = path.display().to_string();
    let text = String::from_utf8(bytes).map_err(|_| {
        Error::format(
            &place,
            "not a text file",
            "give a gripper file in TOML; `gripfast gripper list` shows shipped ones",
        )
    })?;
    parse_in(&text, &place, path.parent())
}

/// What to write where TOML's reader finds another shape.
const SHAPES: [(&str, &str); 3] = [
    (
        "expected an array of length 2",
        "give two texts with units, e.g. stroke = [\"0mm\", \"85mm\"] or force = [\"20N\", \"235N\"]",
    ),
    (
        "expected an array of length 3",
        "give three texts with units along x1, x2, x3, e.g. [\"40mm\", \"20mm\", \"8mm\"]",
    ),
    (
        "expected a sequence",
        "bodies stand in double brackets, one table for each: [[finger]], [[palm]]",
    ),
];

/// Parses the text of a gripper file; `place` names it in messages. Such a text cannot name mesh
/// files.
///
/// # Errors
/// When it is not TOML, a field is unknown, missing or without unit, or a value makes no gripper:
/// stroke or force range not rising, pad not convex or without area, body without volume, mesh that
/// cannot be read, two bodies of one name, source of an unknown field.
pub fn parse(text: &str, place: &str) -> Result<Gripper> {
    parse_in(text, place, None)
}

/// [`parse`] with mesh files in `folder`.
fn parse_in(text: &str, place: &str, folder: Option<&Path>) -> Result<Gripper> {
    let file: File = toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(String::new(), |span| {
            format!(":{}", text[..span.start.min(text.len())].matches('\n').count() + 1)
        });
        Error::format(
            format!("{place}{line}"),
            with_shape(error.message(), &SHAPES),
            remedy(error.message()),
        )
    })?;
    let reader = Reader { place, folder };
    if file.name.trim().is_empty() {
        return Err(reader.bad("name", "is empty", "name the gripper"));
    }
    let stroke = reader.range("stroke", Quantity::Length, &file.stroke)?;
    let force = reader.range("force", Quantity::Force, &file.force)?;
    let pad = reader.pad("pad", file.pad.rectangle.as_ref(), file.pad.polygon.as_deref())?;
    let pad_ii = match &file.pad.other {
        None => None,
        Some(Outline { rectangle, polygon }) => {
            Some(reader.pad("pad.II", rectangle.as_ref(), polygon.as_deref())?)
        }
    };
    let pad_ii = pad_ii.filter(|other| *other != pad);
    let moment = match &file.moment {
        None => None,
        Some([x1, x2, x3]) => {
            let value = |text| reader.positive("moment", Quantity::Moment, text);
            Some([value(x1)?, value(x2)?, value(x3)?])
        }
    };
    let optional = |field: &str, quantity, text: &Option<String>| {
        text.as_deref().map(|text| reader.positive(field, quantity, text)).transpose()
    };
    let payload = optional("payload", Quantity::Mass, &file.payload)?;
    let pad_thickness = optional("pad.thickness", Quantity::Length, &file.pad.thickness)?;
    let pad_modulus = optional("pad.modulus", Quantity::Pressure, &file.pad.modulus)?;
    let pad_stiffness = match file.pad.stiffness.as_deref().map(str::trim) {
        Some("rigid") => Some(layer::RIGID),
        _ => optional("pad.stiffness", Quantity::Stiffness, &file.pad.stiffness)?,
    };
    if let Some(ratio) = file.pad.poisson.filter(|ratio| !(0.0..0.5).contains(ratio)) {
        return Err(reader.bad(
            "pad.poisson",
            format!("is {ratio}"),
            "give Poisson's ratio, from 0 to below 0.5: 0.45 for rubber with some room to the sides",
        ));
    }
    let outer_pad = optional("pad.outer_face", Quantity::Length, &file.pad.outer_face)?;
    if let Some(friction) = file.pad.friction.filter(|friction| !(0.0..=10.0).contains(friction)) {
        return Err(reader.bad(
            "pad.friction",
            format!("is {friction}"),
            "give a coefficient between 0 and 10, without unit",
        ));
    }
    if let Some(solid) = file.palm.iter().find(|solid| solid.jaw.is_some()) {
        return Err(reader.bad(
            &format!("palm.{}", solid.name),
            "names a jaw",
            "leave it out, or make the body a [[finger]]",
        ));
    }
    let fingers = reader.finger(&file.finger, Jaw::I)?;
    let fingers_ii = match file.finger.iter().any(|solid| solid.jaw.is_some()) {
        true => Some(reader.finger(&file.finger, Jaw::II)?).filter(|other| *other != fingers),
        false => None,
    };
    let palm = reader.bodies("palm", file.palm.iter())?;
    let (moving, travel) = match &file.motion {
        Some(motion) => reader.motion(motion, stroke)?,
        None => (Moving::Both, Travel::Parallel),
    };
    let axes = |field: &str, axes: &Option<Axes>| {
        axes.as_ref().map(|axes| reader.frame(field, axes)).transpose()
    };
    let grip_from_flange = axes("flange", &file.flange)?;
    let grip_from_tool = axes("tool", &file.tool)?;
    let mut known: Vec<String> = [
        "stroke",
        "force",
        "payload",
        "moment",
        "pad.size",
        "pad.thickness",
        "pad.modulus",
        "pad.poisson",
        "pad.stiffness",
        "pad.outer_face",
        "pad.friction",
        "motion",
        "flange",
        "tool",
    ]
    .map(String::from)
    .to_vec();
    known.extend(file.finger.iter().map(|solid| format!("finger.{}", solid.name)));
    known.extend(palm.iter().map(|body| format!("palm.{}", body.name)));
    let mut sources = BTreeMap::new();
    for (table, entries, verified) in
        [("source", &file.source, true), ("unverified", &file.unverified, false)]
    {
        for (key, text) in entries {
            if !known.contains(key) {
                return Err(reader.bad(
                    &format!("{table}.{key}"),
                    "names no dimension of this file",
                    &format!("use one of: {}", known.join(", ")),
                ));
            }
            if sources.insert(key.clone(), Source { text: text.clone(), verified }).is_some() {
                return Err(reader.bad(
                    &format!("unverified.{key}"),
                    "stands under [source] as well",
                    "keep one of the two",
                ));
            }
        }
    }
    Ok(Gripper {
        name: file.name,
        stroke,
        force,
        payload,
        moment,
        pad,
        pad_ii,
        pad_friction: file.pad.friction,
        pad_thickness,
        pad_modulus,
        pad_poisson: file.pad.poisson,
        pad_stiffness,
        outer_pad,
        fingers,
        fingers_ii,
        moving,
        travel,
        palm,
        grip_from_flange,
        grip_from_tool,
        sources,
    })
}

/// What to do about a text that is no gripper file.
fn remedy(problem: &str) -> &'static str {
    let unknown = |field: &&str| problem.contains(&format!("unknown field `{field}`"));
    if ["moving", "moves", "fixed", "jaw", "jaws", "pad_ii", "finger_ii"].iter().any(unknown) {
        "one jaw that is fixed: [motion] with moves = \"I\" (the jaw at x3 > 0 moves alone) or \
         \"II\"; a body that one jaw has alone: jaw = \"I\" or \"II\" in its [[finger]]; another pad \
         of jaw II: [pad.II]"
    } else {
        "compare with a shipped file: `gripfast gripper show generic`"
    }
}

struct Reader<'a> {
    place: &'a str,
    folder: Option<&'a Path>,
}

impl Reader<'_> {
    fn bad(&self, field: &str, problem: impl Into<String>, remedy: &str) -> Error {
        Error::input(format!("{}: {field}", self.place), problem, remedy)
    }

    fn value(&self, field: &str, quantity: Quantity, text: &str) -> Result<f64> {
        quantity.parse(&format!("{}: {field}", self.place), text)
    }

    fn positive(&self, field: &str, quantity: Quantity, text: &str) -> Result<f64> {
        let value = self.value(field, quantity, text)?;
        if value > 0.0 {
            Ok(value)
        } else {
            Err(self.bad(field, format!("is {text}"), "give a value above zero"))
        }
    }

    fn range(&self, field: &str, quantity: Quantity, texts: &[String; 2]) -> Result<[f64; 2]> {
        let range =
            [self.value(field, quantity, &texts[0])?, self.value(field, quantity, &texts[1])?];
        if range[0] < 0.0 || range[1] <= range[0] {
            return Err(self.bad(
                field,
                format!("runs from {} to {}", texts[0], texts[1]),
                "give the smallest value (zero or more), then the largest",
            ));
        }
        Ok(range)
    }

    fn vector<const N: usize>(&self, field: &str, texts: &[String; N]) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, text) in values.iter_mut().zip(texts) {
            *value = self.value(field, Quantity::Length, text)?;
        }
        Ok(values)
    }

    fn pad(
        &self,
        field: &str,
        rectangle_sizes: Option<&[String; 2]>,
        corners: Option<&[[String; 2]]>,
    ) -> Result<Vec<DVec2>> {
        let remedy = "give the pad's outline once: rectangle = [\"along x1\", \"along x2\"] or polygon = [[\"x1\", \"x2\"], ...], convex";
        match (rectangle_sizes, corners) {
            (Some(sizes), None) => {
                let field = format!("{field}.rectangle");
                let size = DVec2::from_array(self.vector(&field, sizes)?);
                if size.min_element() <= 0.0 {
                    return Err(self.bad(&field, "has no area", remedy));
                }
                Ok(rectangle(size))
            }
            (None, Some(points)) => {
                let field = format!("{field}.polygon");
                let ring = points
                    .iter()
                    .map(|point| self.vector(&field, point).map(DVec2::from_array))
                    .collect::<Result<Vec<_>>>()?;
                let mut shape = crate::model::Polygon { outer: ring, holes: Vec::new() };
                polygon::normalise(&mut shape);
                if !is_convex(&shape.outer) || ring_area(&shape.outer) <= 0.0 {
                    return Err(self.bad(&field, "is not a convex polygon with area", remedy));
                }
                Ok(convex_hull(&shape.outer))
            }
            (Some(_), Some(_)) => Err(self.bad(field, "has a rectangle and a polygon", remedy)),
            (None, None) => Err(self.bad(field, "has no outline", remedy)),
        }
    }

    /// The bodies of a jaw, those of jaw II as they lie before its half turn about `x1`.
    fn finger(&self, solids: &[Solid], jaw: Jaw) -> Result<Vec<Body>> {
        self.bodies("finger", solids.iter().filter(|solid| solid.jaw.is_none_or(|of| of == jaw)))
    }

    fn bodies<'s>(
        &self,
        table: &str,
        solids: impl Iterator<Item = &'s Solid>,
    ) -> Result<Vec<Body>> {
        let mut bodies: Vec<Body> = Vec::new();
        for solid in solids {
            let mut body = self.body(&format!("{table}.{}", solid.name), solid)?;
            if solid.jaw == Some(Jaw::II) {
                body = body.moved(&Jaw::II.at(0.0));
            }
            if body.name.trim().is_empty() || bodies.iter().any(|other| other.name == body.name) {
                return Err(self.bad(
                    table,
                    format!("name '{}' is empty or used twice", body.name),
                    "give each body of a jaw its own name",
                ));
            }
            match &solid.mesh {
                // All pieces have the name of their body.
                Some(mesh) => bodies.extend(
                    self.mesh(&format!("{table}.{}", solid.name), mesh)?
                        .into_iter()
                        .map(|shape| Body { shape, ..body.clone() }),
                ),
                None => bodies.push(body),
            }
        }
        Ok(bodies)
    }

    fn body(&self, field: &str, solid: &Solid) -> Result<Body> {
        let at = solid.at.as_ref().map_or(Ok([0.0; 3]), |at| self.vector(field, at))?;
        let mut rotation = match &solid.rotate {
            Some(turn) => DMat3::from_axis_angle(
                turn.axis.vector(),
                self.value(field, Quantity::Angle, &turn.angle)?,
            ),
            None => DMat3::IDENTITY,
        };
        let shape = match (&solid.r#box, &solid.cylinder, &solid.hull, &solid.mesh) {
            (Some(sizes), None, None, None) => {
                Shape::Box { half: DVec3::from_array(self.vector(field, sizes)?) / 2.0 }
            }
            (None, Some(cylinder), None, None) => {
                rotation *= match cylinder.axis {
                    Axis::X1 => DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X),
                    Axis::X2 => DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y),
                    Axis::X3 => DMat3::IDENTITY,
                };
                let half_height = self.positive(field, Quantity::Length, &cylinder.length)? / 2.0;
                Shape::Cylinder {
                    radius: self.positive(field, Quantity::Length, &cylinder.radius)?,
                    half_height,
                }
            }
            (None, None, Some(points), None) => Shape::Hull {
                points: points
                    .iter()
                    .map(|point| self.vector(field, point).map(DVec3::from_array))
                    .collect::<Result<_>>()?,
            },
            // [`Reader::bodies`] puts the mesh's pieces in its place.
            (None, None, None, Some(_)) => Shape::Box { half: DVec3::ONE },
            _ => {
                return Err(self.bad(
                    field,
                    "needs exactly one of box, cylinder, hull, mesh",
                    "e.g. box = [\"40mm\", \"20mm\", \"8mm\"] along x1, x2, x3",
                ));
            }
        };
        if !has_volume(&shape) {
            return Err(self.bad(
                field,
                "has no volume",
                "give sizes above zero, or four points that are not in one plane",
            ));
        }
        Ok(Body {
            name: solid.name.clone(),
            shape,
            grip_from_body: Frame { rotation, origin: DVec3::from_array(at) },
        })
    }

    /// Convex pieces that together contain a mesh.
    fn mesh(&self, field: &str, mesh: &MeshFile) -> Result<Vec<Shape>> {
        let Some(folder) = self.folder else {
            return Err(self.bad(
                field,
                "names a mesh file, but this gripper is not read from a file",
                "save it to a file beside the mesh",
            ));
        };
        let unit = mesh.unit.as_deref().map(str::parse).transpose().map_err(|error| {
            self.bad(field, format!("unit: {error}"), "use mm, cm, m, um, in or ft")
        })?;
        let shapes: Vec<Shape> = mesh::hulls(&folder.join(&mesh.file), unit)?
            .into_iter()
            .map(|points| Shape::Hull { points })
            .filter(has_volume)
            .collect();
        if shapes.is_empty() {
            return Err(self.bad(
                field,
                format!("{} encloses no volume", mesh.file.display()),
                "give the mesh of a solid",
            ));
        }
        Ok(shapes)
    }

    fn frame(&self, field: &str, axes: &Axes) -> Result<Frame> {
        let origin = DVec3::from_array(self.vector(field, &axes.origin)?);
        let z = axes.z.map_or(DVec3::X, DVec3::from_array);
        let y = axes.y.map_or(DVec3::Z, DVec3::from_array);
        let (Some(z), Some(x)) = (z.try_normalize(), y.cross(z).try_normalize()) else {
            return Err(self.bad(
                field,
                "axes y and z are parallel or zero",
                "leave them out for z = approach (x1), y = closing (x3)",
            ));
        };
        Ok(Frame { rotation: DMat3::from_cols(x, z.cross(x), z), origin })
    }
}

fn has_volume(shape: &Shape) -> bool {
    match shape {
        Shape::Box { half } => half.min_element() > 0.0,
        Shape::Cylinder { radius, half_height } => *radius > 0.0 && *half_height > 0.0,
        Shape::Hull { points } => {
            let Some((&base, others)) = points.split_first() else { return false };
            let size = others.iter().map(|point| point.distance(base)).fold(0.0, f64::max);
            // Largest tetrahedron on the base point, its farthest point, and any two others.
            let Some(&far) =
                others.iter().max_by(|a, b| a.distance(base).total_cmp(&b.distance(base)))
            else {
                return false;
            };
            let volume = |a: &DVec3| {
                others
                    .iter()
                    .map(|b| (far - base).cross(*a - base).dot(*b - base).abs())
                    .fold(0.0, f64::max)
            };
            others.iter().map(volume).fold(0.0, f64::max) > 1e-9 * size.powi(3)
        }
    }
}

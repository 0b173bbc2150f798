//! Contact-pair files: one case, a list, `{"cases": [..]}` or JSON Lines; in SI, about the origin
//! midway between the faces.

use std::path::Path;

use glam::{DVec2, DVec3};
use serde::Deserialize;

use crate::contact::surface::{Gap, Piece, Surfaces};
use crate::error::{Error, ErrorKind, Result};
use crate::file;
use crate::model::{Contact, LARGEST_LENGTH, Patch, Ring, Wrench};

/// One contact pair under one wrench.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The case's own name, if it has one.
    pub id: Option<String>,
    /// Both contact areas \[m\]: of curved faces their outlines.
    pub contact: Contact,
    /// The faces as they are and the pads' stiffness, where the case gives them.
    pub surfaces: Option<Surfaces>,
    /// Height of face I over face II \[m\], negative for a grip from inside.
    pub distance: f64,
    /// Gripping force \[N\].
    pub force: f64,
    /// External wrench about the origin midway between the faces.
    pub wrench: Wrench,
}

/// As written in a file; keys that are not ours are ignored so that files can carry notes and
/// expected answers.
#[derive(Deserialize)]
struct Raw {
    id: Option<serde_json::Value>,
    k: Option<[f64; 2]>,
    layer: Option<f64>,
    d: f64,
    #[serde(rename = "Fn")]
    force: f64,
    #[serde(rename = "F")]
    f: DVec3,
    #[serde(rename = "M")]
    m: DVec3,
}

/// The faces as pieces.
#[derive(Deserialize)]
struct Pieces {
    #[serde(rename = "A_I")]
    face_i: Vec<Piece>,
    #[serde(rename = "A_II")]
    face_ii: Vec<Piece>,
}

/// A body between wide pads, its axis along `x1` \[m\].
#[derive(Deserialize)]
struct Body {
    kind: Kind,
    /// Radius about the axis.
    #[serde(rename = "R")]
    radius: Option<f64>,
    /// Radius of a barrel's meridian.
    #[serde(rename = "R1")]
    meridian: Option<f64>,
    /// Length along `x1`.
    #[serde(rename = "L")]
    length: f64,
    /// Half width of the pads, or of a flat body.
    b: Option<f64>,
    /// Half width of the flat of a D-bar, which is face I.
    bflat: Option<f64>,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Cylinder,
    Sphere,
    Barrel,
    Dbar,
    Flat,
}

impl Body {
    /// Pieces under pad I and pad II; `place` for messages.
    fn pieces(&self, place: &str) -> Result<Pieces> {
        let given = |value: Option<f64>, name: &str| {
            value.ok_or_else(|| Error::format(place, format!("gives no \"{name}\""), CURVED))
        };
        let piece = |half: f64, gap: Gap| {
            let x = 0.5 * self.length;
            let outer: Ring =
                [(-x, -half), (x, -half), (x, half), (-x, half)].map(DVec2::from).to_vec();
            vec![Piece { outer, holes: Vec::new(), gap }]
        };
        let (axis, at, height) = (DVec2::X, DVec2::ZERO, 0.0);
        if self.kind == Kind::Flat {
            let flat = piece(given(self.b.or(self.bflat), "b")?, Gap::default());
            return Ok(Pieces { face_i: flat.clone(), face_ii: flat });
        }
        let radius = given(self.radius, "R")?;
        let width = self.b.unwrap_or(radius.abs());
        let gap = match self.kind {
            Kind::Sphere => Gap::Sphere { radius, at, height },
            Kind::Barrel => {
                let meridian = given(self.meridian, "R1")?;
                Gap::Barrel { radius, meridian, axis, at, height }
            }
            Kind::Cylinder | Kind::Dbar | Kind::Flat => Gap::Cylinder { radius, axis, at, height },
        };
        let round = piece(width, gap);
        let first = match self.kind {
            Kind::Dbar => piece(given(self.bflat, "bflat")?, Gap::default()),
            _ => round.clone(),
        };
        Ok(Pieces { face_i: first, face_ii: round })
    }
}

const SHAPE: &str = r#"a case is {"A_I":[{"outer":[[x,y],..],"holes":[..]}],"A_II":[..],"d":..,"Fn":..,"F":[f1,f2,f3],"M":[m1,m2,m3]} in m, N, N m"#;

/// The same for faces that are not plane.
const CURVED: &str = r#"a case with curved faces gives each piece a "gap" and the pads' stiffness "k":[kI,kII] in Pa/m, or "kind", "R", "L" and "k" instead of the pieces: docs/curved.md"#;

/// Reads all cases of a file, or of standard input for `-`, in order.
///
/// # Errors
/// When the file cannot be read or a case is not of the form; the message names the file and the
/// place in it.
pub fn read(path: &Path) -> Result<Vec<Case>> {
    let text = if path == Path::new("-") {
        file::text(file::read_from(std::io::stdin().lock(), path)?, path)?
    } else {
        file::read_text(path)?
    };
    let name = path.display().to_string();
    // A stream of JSON values covers one value as well as JSON Lines.
    let mut cases = Vec::new();
    let mut stream = serde_json::Deserializer::from_str(&text).into_iter::<serde_json::Value>();
    while let Some(value) = stream.next() {
        let line = text[..stream.byte_offset().min(text.len())].lines().count();
        let value =
            value.map_err(|error| Error::format(&name, format!("is not JSON: {error}"), SHAPE))?;
        let mut take = |place: String, value: serde_json::Value| -> Result<()> {
            cases.push(parse(&place, value)?);
            Ok(())
        };
        match value {
            serde_json::Value::Object(mut object) if object.contains_key("cases") => {
                match object.remove("cases") {
                    Some(serde_json::Value::Array(list)) => {
                        for (index, item) in list.into_iter().enumerate() {
                            take(format!("{name}: cases[{index}]"), item)?;
                        }
                    }
                    _ => return Err(Error::format(&name, "\"cases\" is not a list", SHAPE)),
                }
            }
            serde_json::Value::Array(list) => {
                for (index, item) in list.into_iter().enumerate() {
                    take(format!("{name}: [{index}]"), item)?;
                }
            }
            other => take(format!("{name}: line {line}"), other)?,
        }
    }
    if cases.is_empty() {
        return Err(Error::format(&name, "holds no case", SHAPE));
    }
    Ok(cases)
}

/// Keys of a case.
const KEYS: [&str; 6] = ["A_I", "A_II", "d", "Fn", "F", "M"];
/// Most times that the faces may be farther apart than the contact areas are wide.
const MOST_SLENDER: f64 = 500.0;

/// Refuses a key that is ours but for its case: `f` beside `F` would be taken for a note.
fn check_keys(place: &str, value: &serde_json::Value) -> Result<()> {
    for key in value.as_object().into_iter().flat_map(|object| object.keys()) {
        let meant = KEYS.iter().find(|known| known.eq_ignore_ascii_case(key));
        if let Some(meant) = meant.filter(|known| *known != key) {
            let problem = format!("key '{}' is none of a case", key.escape_debug());
            return Err(Error::format(place, problem, format!("write '{meant}'")));
        }
    }
    Ok(())
}

/// Refuses lengths that no part has, and a distance in another unit than the areas: `"d": 20` for
/// 20 mm.
fn check_distance(place: &str, contact: &Contact, distance: f64) -> Result<()> {
    let points = || {
        let polygons = contact.face_i.iter().chain(&contact.face_ii);
        polygons.flat_map(|polygon| polygon.outer.iter().copied())
    };
    let (low, high) = points()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let largest = low.abs().max(high.abs()).max_element().max(distance.abs());
    if largest.is_finite() && largest > LARGEST_LENGTH {
        return Err(Error::new(
            ErrorKind::Value,
            place,
            format!("a length is {largest:.3e} m; the largest is {LARGEST_LENGTH:.0e} m"),
            "give lengths in metres",
        ));
    }
    let width = (high - low).max_element();
    if width > 0.0 && distance.abs() > MOST_SLENDER * width {
        return Err(Error::new(
            ErrorKind::Value,
            place,
            format!("d is {distance} m, but the contact areas measure {width:.3e} m"),
            "give d in metres, as the areas",
        ));
    }
    Ok(())
}

/// One case from its JSON value; `place` is file and place for messages.
///
/// # Errors
/// When the value is not of the form.
pub fn parse(place: &str, value: serde_json::Value) -> Result<Case> {
    check_keys(place, &value)?;
    let wrong = |shape: &'static str| {
        move |error: serde_json::Error| Error::format(place, error.to_string(), shape)
    };
    let (pieces, shape) = if value.get("kind").is_some() {
        (Body::deserialize(&value).map_err(wrong(CURVED))?.pieces(place)?, CURVED)
    } else {
        (Pieces::deserialize(&value).map_err(wrong(SHAPE))?, SHAPE)
    };
    let Pieces { face_i, face_ii } = pieces;
    let raw: Raw = serde_json::from_value(value).map_err(wrong(shape))?;
    let id = raw.id.map(|id| id.as_str().map_or_else(|| id.to_string(), str::to_string));
    let outlines = |pieces: &[Piece]| -> Patch { pieces.iter().map(Piece::polygon).collect() };
    let contact = Contact { face_i: outlines(&face_i), face_ii: outlines(&face_ii) };
    check_distance(place, &contact, raw.d)?;
    let plane = [&face_i, &face_ii].into_iter().flatten().all(|piece| piece.gap == Gap::default());
    let surfaces = match raw.k {
        Some(stiffness) => Some(Surfaces { face_i, face_ii, stiffness, layer: raw.layer }),
        None if plane => None,
        None => return Err(Error::format(place, "has curved faces but no \"k\"", CURVED)),
    };
    Ok(Case {
        id,
        contact,
        surfaces,
        distance: raw.d,
        force: raw.force,
        wrench: Wrench { force: raw.f, moment: raw.m },
    })
}

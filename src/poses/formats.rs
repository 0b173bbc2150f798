//! One reader for each format.

use glam::{DMat3, DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde_json::Value;

use super::{Pose, Raw};
use crate::error::{Error, Result};
use crate::export::Dialect;
use crate::model::Frame;
use crate::results::GripSet;

/// What a file holds: its poses, and the frame that it states in words.
type Found = (Vec<Raw>, Option<String>);

/// Largest departure of a pose from a rotation that is taken for rounding.
const ROTATION: f64 = 1e-3;

fn wrong(place: &str, problem: impl Into<String>) -> Error {
    Error::format(place, problem, "docs/formats.md describes each format field by field")
}

/// A pose from a rotation that may be rounded.
fn frame(place: &str, rotation: DMat3, origin: DVec3) -> Result<Frame> {
    let drift = rotation * rotation.transpose() - DMat3::IDENTITY;
    let square = drift.to_cols_array().iter().all(|entry| entry.abs() <= ROTATION);
    if !(square && rotation.determinant() > 0.0 && origin.is_finite()) {
        return Err(wrong(place, "is not a rotation and an origin"));
    }
    // To full precision again.
    let z = rotation.z_axis.normalize();
    let x = (rotation.x_axis - z * z.dot(rotation.x_axis)).normalize();
    Ok(Frame { rotation: DMat3::from_cols(x, z.cross(x), z), origin })
}

fn from_quaternion(place: &str, xyzw: [f64; 4], origin: DVec3) -> Result<Frame> {
    let quaternion = DQuat::from_array(xyzw);
    if !matches!((quaternion.length() - 1.0).abs(), 0.0..=1e-3) {
        return Err(wrong(place, format!("a quaternion of length {}", quaternion.length())));
    }
    frame(place, DMat3::from_quat(quaternion.normalize()), origin)
}

fn from_rows(place: &str, rows: &[[f64; 4]; 4]) -> Result<Frame> {
    let matrix = DMat4::from_cols_array_2d(rows).transpose();
    let origin = matrix.w_axis.truncate();
    frame(place, DMat3::from_mat4(matrix), origin)
}

/// A result file of our own: its grip frames.
pub(super) fn native(place: &str, bytes: &[u8]) -> Result<Vec<Pose>> {
    let set = GripSet::parse(place, bytes)?;
    let pose = |grip: &crate::model::Grip| Pose::of_grip(&grip.id.to_string(), grip.part_from_grip);
    Ok(set.grips.iter().map(|ranked| pose(&ranked.grip)).collect())
}

/// A cell of a table.
enum Cell {
    /// Of a format that keeps numbers as such.
    #[cfg_attr(not(feature = "parquet"), expect(dead_code, reason = "CSV is text"))]
    Number(f64),
    /// As written; empty where there is nothing.
    Text(String),
}

/// A table of poses by its columns: place `x_m`, `y_m`, `z_m` or the same in `_mm`; orientation `qx`,
/// `qy`, `qz`, `qw` or the angles of a robot; and, where there are, `id` or `name`, `jaw_gap_m` (or
/// `_mm`), `tool_frame`.
struct Columns {
    names: Vec<String>,
    /// Metres per unit of the lengths.
    unit: f64,
    place: [usize; 3],
    turn: Vec<usize>,
    /// Whose angles; nobody's where it is a quaternion, scalar part last.
    dialect: Option<Dialect>,
    name: Option<usize>,
    gap: Option<usize>,
    words: Option<usize>,
}

impl Columns {
    fn new(place: &str, names: Vec<String>) -> Result<Self> {
        let column = |name: &str| names.iter().position(|known| known.trim() == name);
        let needed =
            |name: &str| column(name).ok_or_else(|| wrong(place, format!("has no column {name}")));
        let in_mm = ["x_mm", "y_mm", "z_mm"].into_iter().all(|name| column(name).is_some());
        let (suffix, unit) = match in_mm && column("x_m").is_none() {
            true => ("mm", 1e-3),
            false => ("m", 1.0),
        };
        let mut at = [0; 3];
        for (slot, axis) in at.iter_mut().zip(["x", "y", "z"]) {
            *slot = needed(&format!("{axis}_{suffix}"))?;
        }
        let dialect = Dialect::ALL
            .into_iter()
            .map(|known| known.0)
            .find(|dialect| column(dialect.columns()[0]).is_some() && column("qx").is_none());
        let turn = dialect.map_or(&["qx", "qy", "qz", "qw"][..], Dialect::columns);
        let turn = turn.iter().map(|name| needed(name)).collect::<Result<_>>()?;
        let (name, gap) = (column("id").or(column("name")), column(&format!("jaw_gap_{suffix}")));
        let words = column("tool_frame");
        Ok(Self { unit, place: at, turn, dialect, name, gap, words, names })
    }

    /// The pose of row `row`, and the frame that it states.
    fn read(
        &self,
        place: &str,
        row: usize,
        cell: impl Fn(usize) -> Cell,
    ) -> Result<(Raw, Option<String>)> {
        let number = |column: usize| match cell(column) {
            Cell::Number(number) => Ok(number),
            Cell::Text(text) => text.parse::<f64>().map_err(|_| {
                wrong(place, format!("'{text}' in {} is no number", self.names[column]))
            }),
        };
        let text = |column: usize| match cell(column) {
            Cell::Number(number) => number.to_string(),
            Cell::Text(text) => text,
        };
        let mut origin = DVec3::ZERO;
        for (axis, column) in self.place.into_iter().enumerate() {
            origin[axis] = number(column)? * self.unit;
        }
        let turn = self.turn.iter().map(|&column| number(column)).collect::<Result<Vec<_>>>()?;
        let frame = match (self.dialect, &turn[..]) {
            (None, &[x, y, z, w]) => from_quaternion(place, [x, y, z, w], origin)?,
            (dialect, angles) => {
                let rotation = dialect.and_then(|dialect| dialect.rotation(angles));
                let rotation = rotation.ok_or_else(|| wrong(place, "is not a rotation"))?;
                frame(place, rotation, origin)?
            }
        };
        let gap = self.gap.filter(|column| !text(*column).is_empty()).map(number).transpose()?;
        let raw = Raw {
            name: self.name.map_or_else(|| row.to_string(), text),
            frame,
            gap: gap.map(|gap| gap * self.unit),
        };
        Ok((raw, self.words.map(text)))
    }
}

/// A table in CSV.
pub(super) fn csv(place: &str, bytes: &[u8]) -> Result<Found> {
    let mut reader = csv::Reader::from_reader(bytes);
    let failed = |error: csv::Error| wrong(place, error.to_string());
    let names = reader.headers().map_err(failed)?.iter().map(str::to_owned).collect();
    let columns = Columns::new(place, names)?;
    let (mut found, mut stated) = (Vec::new(), None);
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(failed)?;
        let cell =
            |column: usize| Cell::Text(record.get(column).unwrap_or_default().trim().to_owned());
        let (raw, words) = columns.read(&format!("{place}:{}", row + 2), row, cell)?;
        stated = stated.or(words);
        found.push(raw);
    }
    Ok((found, stated))
}

/// The same table in Parquet, numbers in any precision.
#[cfg(feature = "parquet")]
pub(super) fn parquet(place: &str, path: &std::path::Path) -> Result<Found> {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    let failed = |error: parquet::errors::ParquetError| wrong(place, error.to_string());
    let file = std::fs::File::open(path).map_err(|error| Error::io(path, "read", error))?;
    let reader = SerializedFileReader::new(file).map_err(failed)?;
    let metadata = reader.metadata();
    let size = metadata.row_groups().iter().map(|group| group.total_byte_size().max(0) as u64);
    crate::memory::Budget::new(None).room(place, size.sum())?;
    let fields = metadata.file_metadata().schema().get_fields();
    let columns = Columns::new(place, fields.iter().map(|f| f.name().to_owned()).collect())?;
    let (mut found, mut stated) = (Vec::new(), None);
    for (index, row) in reader.get_row_iter(None).map_err(failed)?.enumerate() {
        let row: Vec<(String, Field)> = row.map_err(failed)?.into_columns();
        let cell = |column: usize| match row.get(column).map(|(_, field)| field) {
            Some(Field::Double(number)) => Cell::Number(*number),
            Some(Field::Float(number)) => Cell::Number(f64::from(*number)),
            Some(Field::Str(text)) => Cell::Text(text.trim().to_owned()),
            Some(Field::Null) | None => Cell::Text(String::new()),
            Some(other) => Cell::Text(other.to_string()),
        };
        let (raw, words) = columns.read(&format!("{place}, row {index}"), index, cell)?;
        stated = stated.or(words);
        found.push(raw);
    }
    Ok((found, stated))
}

#[cfg(not(feature = "parquet"))]
pub(super) fn parquet(place: &str, _path: &std::path::Path) -> Result<Found> {
    Err(unsupported(place, "Parquet"))
}

/// A format that this build leaves out.
#[cfg(not(all(feature = "parquet", feature = "hdf5")))]
fn unsupported(place: &str, format: &str) -> Error {
    Error::new(
        crate::error::ErrorKind::Unsupported,
        place,
        format!("this build has no {format}"),
        "build with `cargo build --release --features full`",
    )
}

/// A YAML file as plain values.
fn yaml<T: serde::de::DeserializeOwned>(place: &str, bytes: &[u8]) -> Result<T> {
    let text = std::str::from_utf8(bytes).map_err(|_| wrong(place, "not a text file"))?;
    serde_saphyr::from_str(text).map_err(|error| wrong(place, error.to_string()))
}

/// The frame that a comment of ours states.
fn comment(bytes: &[u8], start: &str) -> Option<String> {
    let text = std::str::from_utf8(bytes).ok()?;
    text.lines().find_map(|line| line.strip_prefix(start)).map(|rest| rest.trim().to_owned())
}

#[derive(Deserialize)]
struct IsaacFile {
    #[serde(deserialize_with = "in_order")]
    grasps: Vec<(String, IsaacGrasp)>,
}

/// The entries of a map in the order of the file.
fn in_order<'de, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<Vec<(String, IsaacGrasp)>, D::Error> {
    struct Entries;
    impl<'de> serde::de::Visitor<'de> for Entries {
        type Value = Vec<(String, IsaacGrasp)>;

        fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            formatter.write_str("grasps by name")
        }

        fn visit_map<A: serde::de::MapAccess<'de>>(
            self,
            mut map: A,
        ) -> std::result::Result<Self::Value, A::Error> {
            let mut entries = Vec::new();
            while let Some(entry) = map.next_entry()? {
                entries.push(entry);
            }
            Ok(entries)
        }
    }
    deserializer.deserialize_map(Entries)
}

#[derive(Deserialize)]
struct IsaacGrasp {
    position: [f64; 3],
    orientation: IsaacTurn,
}

#[derive(Deserialize)]
struct IsaacTurn {
    w: f64,
    xyz: [f64; 3],
}

/// `isaac_grasp`: `grasps` by name.
pub(super) fn isaac(place: &str, bytes: &[u8]) -> Result<Found> {
    let file: IsaacFile = yaml(place, bytes)?;
    let found = file.grasps.into_iter().map(|(name, grasp)| {
        let place = format!("{place}, {name}");
        let IsaacTurn { w, xyz: [x, y, z] } = grasp.orientation;
        let frame = from_quaternion(&place, [x, y, z, w], DVec3::from_array(grasp.position))?;
        Ok(Raw { name, frame, gap: None })
    });
    Ok((found.collect::<Result<_>>()?, comment(bytes, "# gripper frame:")))
}

#[derive(Deserialize)]
struct MoveItGrasp {
    #[serde(default)]
    id: Option<Value>,
    grasp_pose: MoveItStamped,
}

#[derive(Deserialize)]
struct MoveItStamped {
    pose: MoveItPose,
}

#[derive(Deserialize)]
struct MoveItPose {
    position: Xyz,
    orientation: Xyzw,
}

#[derive(Deserialize)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Deserialize)]
struct Xyzw {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// A list of `moveit_msgs/Grasp`.
pub(super) fn moveit(place: &str, bytes: &[u8]) -> Result<Found> {
    let grasps: Vec<MoveItGrasp> = yaml(place, bytes)?;
    let found = grasps.into_iter().enumerate().map(|(index, grasp)| {
        let name = match grasp.id {
            Some(Value::String(name)) if !name.is_empty() => name,
            Some(Value::Number(number)) => number.to_string(),
            _ => index.to_string(),
        };
        let MoveItPose { position: p, orientation: q } = grasp.grasp_pose.pose;
        let place = format!("{place}, grasp {name}");
        let frame = from_quaternion(&place, [q.x, q.y, q.z, q.w], DVec3::new(p.x, p.y, p.z))?;
        Ok(Raw { name, frame, gap: None })
    });
    Ok((found.collect::<Result<_>>()?, comment(bytes, "# Tool frame:")))
}

#[derive(Deserialize)]
struct GraspGenFile {
    grasps: GraspGenGrasps,
    gripfast: Option<GraspGenNotes>,
}

#[derive(Deserialize)]
struct GraspGenGrasps {
    transforms: Vec<[[f64; 4]; 4]>,
    #[serde(default)]
    width: Vec<f64>,
    #[serde(default)]
    id: Vec<u64>,
}

#[derive(Deserialize)]
struct GraspGenNotes {
    tool_frame: String,
}

/// GraspGen's JSON: `grasps.transforms`.
pub(super) fn graspgen(place: &str, bytes: &[u8]) -> Result<Found> {
    let file: GraspGenFile =
        serde_json::from_slice(bytes).map_err(|error| wrong(place, error.to_string()))?;
    let GraspGenGrasps { transforms, width, id } = file.grasps;
    let found = transforms.iter().enumerate().map(|(index, rows)| {
        Ok(Raw {
            name: id.get(index).map_or_else(|| index.to_string(), u64::to_string),
            frame: from_rows(&format!("{place}, transform {index}"), rows)?,
            gap: width.get(index).copied(),
        })
    });
    Ok((found.collect::<Result<_>>()?, file.gripfast.map(|notes| notes.tool_frame)))
}

/// GraspNet's rows of 17 numbers, alone (`.npy`) or as `grasps` (or the only array) of an archive.
pub(super) fn graspnet(place: &str, bytes: Vec<u8>) -> Result<Found> {
    let (mut rows, mut words, mut ids) = (None, None, Vec::new());
    if bytes.starts_with(b"\x93NUMPY") {
        rows = Some(npy(place, &bytes)?);
    } else {
        let failed = |error: zip::result::ZipError| wrong(place, error.to_string());
        let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).map_err(failed)?;
        let budget = crate::memory::Budget::new(None);
        for index in 0..archive.len() {
            let mut member = archive.by_index(index).map_err(failed)?;
            let name = member.name().trim_end_matches(".npy").to_owned();
            budget.room(place, member.size())?;
            if !matches!(name.as_str(), "grasps" | "tool_frame" | "ids" | "arr_0" | "preds") {
                continue;
            }
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut member, &mut bytes)
                .map_err(|error| wrong(place, error.to_string()))?;
            match name.as_str() {
                "tool_frame" => words = npy_text(&bytes),
                "ids" => ids = npy_ids(&bytes),
                _ => rows = Some(npy(&format!("{place}, {name}"), &bytes)?),
            }
        }
    }
    let rows = rows.ok_or_else(|| wrong(place, "holds no array of grasps"))?;
    let found = rows.chunks_exact(COLUMNS).enumerate().map(|(index, row)| {
        let rotation = DMat3::from_cols_slice(&row[4..13]).transpose();
        let place = format!("{place}, row {index}");
        Ok(Raw {
            name: ids.get(index).map_or_else(|| index.to_string(), u64::to_string),
            frame: frame(&place, rotation, DVec3::from_slice(&row[13..16]))?,
            gap: None,
        })
    });
    Ok((found.collect::<Result<_>>()?, words))
}

/// Columns of a row of GraspNet.
const COLUMNS: usize = 17;

/// Header and data of an array in NumPy's format 1 to 3.
fn npy_parts(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (version, rest) = (*bytes.get(6)?, bytes.get(8..)?);
    let (length, rest) = if version == 1 {
        (usize::from(u16::from_le_bytes(rest.get(..2)?.try_into().ok()?)), rest.get(2..)?)
    } else {
        (u32::from_le_bytes(rest.get(..4)?.try_into().ok()?) as usize, rest.get(4..)?)
    };
    Some((std::str::from_utf8(rest.get(..length)?).ok()?, rest.get(length..)?))
}

/// Whole numbers from an array in NumPy's format; none where it holds others.
fn npy_ids(bytes: &[u8]) -> Vec<u64> {
    let whole = |header: &str| header.contains("<u8") || header.contains("<i8");
    let data =
        npy_parts(bytes).filter(|(header, _)| whole(header)).map_or(&[][..], |parts| parts.1);
    data.as_chunks().0.iter().map(|&bytes| u64::from_le_bytes(bytes)).collect()
}

/// Rows of 17 numbers from an array in NumPy's format, in single or double precision.
fn npy(place: &str, bytes: &[u8]) -> Result<Vec<f64>> {
    let (header, data) = npy_parts(bytes).ok_or_else(|| wrong(place, "is no array of NumPy"))?;
    let header: String = header.split_whitespace().collect();
    let rows = [format!(",{COLUMNS})"), format!(",{COLUMNS},)")];
    let rows = rows.iter().any(|rows| header.contains(rows.as_str()));
    if !(header.contains("'fortran_order':False") && rows) {
        return Err(wrong(place, format!("is not rows of {COLUMNS} numbers: {header}")));
    }
    if header.contains("'<f8'") {
        Ok(data
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap_or_default()))
            .collect())
    } else if header.contains("'<f4'") {
        let number = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap_or_default());
        Ok(data.chunks_exact(4).map(|b| f64::from(number(b))).collect())
    } else {
        Err(wrong(place, format!("holds other numbers than '<f8' and '<f4': {header}")))
    }
}

/// A text from an array in NumPy's format.
fn npy_text(bytes: &[u8]) -> Option<String> {
    let (_, data) = npy_parts(bytes)?;
    let letter = |b: &[u8]| char::from_u32(u32::from_le_bytes(b.try_into().ok()?));
    data.chunks_exact(4).map(letter).collect()
}

/// ACRONYM's HDF5: `grasps/transforms`.
#[cfg(feature = "hdf5")]
pub(super) fn acronym(place: &str, bytes: Vec<u8>) -> Result<Found> {
    let failed = |error: hdf5_pure::Error| wrong(place, error.to_string());
    let file = hdf5_pure::File::from_bytes(bytes).map_err(failed)?;
    let transforms = file.dataset("grasps/transforms").map_err(failed)?;
    let words = match transforms.attrs().map_err(failed)?.get("tool_frame") {
        Some(hdf5_pure::AttrValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    let values = transforms.read_f64().map_err(failed)?;
    let found = values.chunks_exact(16).enumerate().map(|(index, values)| {
        let mut rows = [[0.0; 4]; 4];
        rows.iter_mut().flatten().zip(values).for_each(|(slot, value)| *slot = *value);
        Ok(Raw {
            name: index.to_string(),
            frame: from_rows(&format!("{place}, transform {index}"), &rows)?,
            gap: None,
        })
    });
    Ok((found.collect::<Result<_>>()?, words))
}

#[cfg(not(feature = "hdf5"))]
pub(super) fn acronym(place: &str, _bytes: Vec<u8>) -> Result<Found> {
    Err(unsupported(place, "HDF5"))
}

//! A CSV file of numbers whose header names each column and its unit: `fx[N]`, `t [ms]`, `wz
//! (deg/s)`; a bare name is SI.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::units::Quantity;

/// Names and factors to SI of the units accepted for a column.
pub(super) type Units = &'static [(&'static str, f64)];

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const TIME: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6)];
const VELOCITY: Units = &[("m/s", 1.0), ("mm/s", 1e-3)];
const ANGULAR_VELOCITY: Units =
    &[("rad/s", 1.0), ("deg/s", DEGREE), ("rpm", std::f64::consts::TAU / 60.0)];
const ANGULAR_ACCELERATION: Units =
    &[("rad/s2", 1.0), ("rad/s^2", 1.0), ("deg/s2", DEGREE), ("deg/s^2", DEGREE)];

/// Every numeric column that a list or a trajectory may have, with its units.
fn units(column: &str) -> Option<Units> {
    Some(match column {
        "fx" | "fy" | "fz" => Quantity::Force.units(),
        "mx" | "my" | "mz" => Quantity::Moment.units(),
        "px" | "py" | "pz" | "x" | "y" | "z" => Quantity::Length.units(),
        "t" => TIME,
        "vx" | "vy" | "vz" => VELOCITY,
        "ax" | "ay" | "az" => Quantity::Acceleration.units(),
        "wx" | "wy" | "wz" => ANGULAR_VELOCITY,
        "alx" | "aly" | "alz" => ANGULAR_ACCELERATION,
        "qx" | "qy" | "qz" | "qw" => &[],
        _ => return None,
    })
}

/// A parsed file: text cells by column, with the line of each row.
pub(super) struct Table {
    place: String,
    header: String,
    header_line: u64,
    /// Name and factor to SI; text columns (`name`, `frame`) have the factor 1.
    columns: Vec<(String, f64)>,
    rows: Vec<(u64, csv::StringRecord)>,
}

impl Table {
    /// Reads `text`; `place` is the file for messages. Lines that start with `#` are comments.
    ///
    /// # Errors
    /// When a line is not CSV or has another number of cells than the header, a column is unknown,
    /// comes twice or has an unknown unit, or there is no row.
    pub(super) fn parse(place: &str, text: &str) -> Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
        let broken = |error: csv::Error| {
            let line = error.position().map_or(1, csv::Position::line);
            Error::input(
                format!("{place}:{line}"),
                error.to_string(),
                "every line needs as many cells as the header, separated by commas",
            )
        };
        let header = reader.headers().map_err(broken)?.clone();
        let line = header.position().map_or(1, csv::Position::line);
        let mut columns: Vec<(String, f64)> = Vec::new();
        for cell in &header {
            let column = column(&format!("{place}:{line}"), cell)?;
            if columns.iter().any(|known| known.0 == column.0) {
                return Err(Error::input(
                    format!("{place}:{line}"),
                    format!("column '{}' comes twice", column.0),
                    "keep one of them",
                ));
            }
            columns.push(column);
        }
        let rows: Vec<_> = reader
            .records()
            .map(|record| {
                record.map(|record| (record.position().map_or(0, csv::Position::line), record))
            })
            .collect::<std::result::Result<_, _>>()
            .map_err(broken)?;
        if rows.is_empty() {
            return Err(Error::input(
                place,
                "no rows",
                "a header line and at least one line of numbers are needed",
            ));
        }
        Ok(Self {
            place: place.to_owned(),
            header: header.iter().collect::<Vec<_>>().join(","),
            header_line: line,
            columns,
            rows,
        })
    }

    /// The header line, for messages.
    pub(super) fn header(&self) -> &str {
        &self.header
    }

    /// Whether there is a column of this name.
    pub(super) fn has(&self, column: &str) -> bool {
        self.find(column).is_some()
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// `file:line` of the header.
    pub(super) fn header_place(&self) -> String {
        format!("{}:{}", self.place, self.header_line)
    }

    /// `file:line` of a row.
    pub(super) fn place(&self, row: usize) -> String {
        format!("{}:{}", self.place, self.rows[row].0)
    }

    /// The file, without its folder.
    pub(super) fn file_name(&self) -> &str {
        self.place.rsplit(['/', '\\']).next().unwrap_or(&self.place)
    }

    /// A text cell; `None` when the column is missing or the cell empty.
    pub(super) fn text(&self, row: usize, column: &str) -> Option<&str> {
        self.rows[row].1.get(self.find(column)?).filter(|cell| !cell.is_empty())
    }

    /// A number in SI.
    ///
    /// # Errors
    /// When the column is missing, or the cell is not a finite number.
    pub(super) fn number(&self, row: usize, column: &str) -> Result<f64> {
        let Some(index) = self.find(column) else {
            return Err(Error::input(
                self.header_place(),
                format!("no column '{column}'"),
                format!("the header is '{}'", self.header),
            ));
        };
        let cell = self.rows[row].1.get(index).unwrap_or_default();
        match cell.parse::<f64>().map(|value| value * self.columns[index].1) {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(Error::input(
                format!("{}, column {column}", self.place(row)),
                format!("'{cell}' is not a finite number"),
                "write a plain number; the unit belongs in the header, e.g. fx[N]",
            )),
        }
    }

    /// Whether the three columns are there; all or none of them must be.
    ///
    /// # Errors
    /// When one or two are missing.
    pub(super) fn has_vector(&self, columns: [&str; 3]) -> Result<bool> {
        match columns.iter().filter(|column| self.has(column)).count() {
            0 => Ok(false),
            3 => Ok(true),
            _ => Err(Error::input(
                self.header_place(),
                format!("the header '{}' has part of {}", self.header, columns.join(",")),
                "give all three or none",
            )),
        }
    }

    /// Three numbers in SI; see [`Self::number`].
    pub(super) fn vector(&self, row: usize, columns: [&str; 3]) -> Result<DVec3> {
        Ok(DVec3::new(
            self.number(row, columns[0])?,
            self.number(row, columns[1])?,
            self.number(row, columns[2])?,
        ))
    }

    fn find(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|known| known.0 == column)
    }
}

/// Splits `fx[N]` or `fx (N)` into the name and the factor to SI.
fn column(place: &str, cell: &str) -> Result<(String, f64)> {
    let open = cell.find(['[', '(']);
    let (name, unit) = match open {
        Some(open) => {
            (cell[..open].trim(), Some(cell[open + 1..].trim_end_matches([']', ')']).trim()))
        }
        None => (cell, None),
    };
    let name = match name.to_ascii_lowercase().as_str() {
        "time" => "t".to_owned(),
        other => other.to_owned(),
    };
    if matches!(name.as_str(), "name" | "frame") {
        return Ok((name, 1.0));
    }
    let Some(units) = units(&name) else {
        return Err(Error::input(
            place,
            format!("unknown column '{cell}'"),
            "lists have name,fx,fy,fz,mx,my,mz,px,py,pz,frame; trajectories t,x,y,z,qx,qy,qz,qw,vx,vy,vz,ax,ay,az,wx,wy,wz,alx,aly,alz,frame",
        ));
    };
    match unit {
        None => Ok((name, 1.0)),
        Some(unit) => match units.iter().find(|known| known.0 == unit) {
            Some(known) => Ok((name, known.1)),
            None => {
                let list = units.iter().map(|unit| unit.0).collect::<Vec<_>>().join(", ");
                let remedy = if list.is_empty() {
                    "this column has no unit".to_owned()
                } else {
                    format!("use one of: {list}")
                };
                Err(Error::input(place, format!("column '{cell}': unknown unit '{unit}'"), remedy))
            }
        },
    }
}

/// The axes in which a row's vectors are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axes {
    /// Those of the part frame.
    Part,
    /// Those of the world.
    World,
}

impl Axes {
    /// Parses `part` or `world`.
    pub(super) fn parse(place: &str, text: &str) -> Result<Self> {
        match text {
            "part" => Ok(Self::Part),
            "world" => Ok(Self::World),
            _ => Err(Error::input(place, format!("unknown frame '{text}'"), "use part or world")),
        }
    }
}

//! Explicit lists of wrenches: CSV or JSON.

use glam::DVec3;
use serde::Deserialize;

use super::table::{Axes, Table};
use crate::error::{Error, Result};
use crate::model::{Frame, LoadCase, Wrench};
use crate::part::MassProperties;
use crate::units::Quantity;

const FORCE: [&str; 3] = ["fx", "fy", "fz"];
const MOMENT: [&str; 3] = ["mx", "my", "mz"];
const POINT: [&str; 3] = ["px", "py", "pz"];

/// A wrench as a file states it.
struct Stated {
    force: DVec3,
    moment: DVec3,
    /// The centre of mass when absent.
    point: Option<DVec3>,
    axes: Axes,
}

impl Stated {
    /// In the part frame about the centre of mass.
    fn resolve(&self, mass: &MassProperties, world_from_part: &Frame) -> Wrench {
        let (force, moment, point) = match self.axes {
            Axes::Part => (self.force, self.moment, self.point),
            Axes::World => {
                let part_from_world = world_from_part.rotation.transpose();
                (
                    part_from_world * self.force,
                    part_from_world * self.moment,
                    self.point.map(|point| world_from_part.point_inverse(point)),
                )
            }
        };
        let arm = point.map_or(DVec3::ZERO, |point| point - mass.centre_of_mass);
        Wrench { force, moment: moment + arm.cross(force) }
    }
}

/// Reads a table with `fx,fy,fz` and/or `mx,my,mz`, optional `px,py,pz` (where the force acts and
/// about which the moment is meant; the centre of mass without), `frame` (`part`, the default, or
/// `world`) and `name`.
pub(super) fn from_table(
    table: &Table,
    mass: &MassProperties,
    world_from_part: &Frame,
) -> Result<Vec<LoadCase>> {
    let (force, moment, point) =
        (table.has_vector(FORCE)?, table.has_vector(MOMENT)?, table.has_vector(POINT)?);
    let read = |there: bool, row: usize, columns: [&str; 3]| {
        if there { table.vector(row, columns) } else { Ok(DVec3::ZERO) }
    };
    (0..table.len())
        .map(|row| {
            let stated = Stated {
                force: read(force, row, FORCE)?,
                moment: read(moment, row, MOMENT)?,
                point: if point { Some(table.vector(row, POINT)?) } else { None },
                axes: table
                    .text(row, "frame")
                    .map_or(Ok(Axes::Part), |text| Axes::parse(&table.place(row), text))?,
            };
            let name = table
                .text(row, "name")
                .map_or_else(|| format!("{} row {}", table.file_name(), row + 1), str::to_owned);
            finite(&table.place(row), name, stated.resolve(mass, world_from_part))
        })
        .collect()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonList {
    #[serde(default)]
    units: JsonUnits,
    loads: Vec<JsonLoad>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct JsonUnits {
    force: String,
    moment: String,
    length: String,
}

impl Default for JsonUnits {
    fn default() -> Self {
        Self { force: "N".into(), moment: "Nm".into(), length: "m".into() }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonLoad {
    name: Option<String>,
    #[serde(default)]
    force: DVec3,
    #[serde(default)]
    moment: DVec3,
    point: Option<DVec3>,
    frame: Option<String>,
}

/// Reads `{"units": {..}, "loads": [{"name", "force", "moment", "point", "frame"}, ..]}`; units
/// default to N, Nm and m.
pub(super) fn from_json(
    place: &str,
    text: &str,
    mass: &MassProperties,
    world_from_part: &Frame,
) -> Result<Vec<LoadCase>> {
    let list: JsonList =
        serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|error| {
            Error::input(
                format!("{place}:{}", error.line()),
                format!("not a list of loads: {error}"),
                r#"write {"loads": [{"name": "..", "force": [x,y,z], "moment": [x,y,z]}, ..]}"#,
            )
        })?;
    let factor = |quantity: Quantity, field: &str, unit: &str| {
        quantity.parse(&format!("{place}, units.{field}"), &format!("1{unit}"))
    };
    let force = factor(Quantity::Force, "force", &list.units.force)?;
    let moment = factor(Quantity::Moment, "moment", &list.units.moment)?;
    let length = factor(Quantity::Length, "length", &list.units.length)?;
    if list.loads.is_empty() {
        return Err(Error::input(place, "no loads", "give at least one"));
    }
    let load = |(index, load): (usize, JsonLoad)| {
        let place = format!("{place}, loads[{index}]");
        let stated = Stated {
            force: load.force * force,
            moment: load.moment * moment,
            point: load.point.map(|point| point * length),
            axes: load.frame.as_deref().map_or(Ok(Axes::Part), |text| Axes::parse(&place, text))?,
        };
        let name = load.name.unwrap_or_else(|| format!("load {}", index + 1));
        finite(&place, name, stated.resolve(mass, world_from_part))
    };
    list.loads.into_iter().enumerate().map(load).collect()
}

/// Huge but finite values may overflow when carried to the centre of mass.
pub(super) fn finite(place: &str, name: String, wrench: Wrench) -> Result<LoadCase> {
    if wrench.force.is_finite() && wrench.moment.is_finite() {
        return Ok(LoadCase { name, wrench });
    }
    Err(Error::input(
        place,
        format!(
            "the load about the centre of mass is not finite: force {}, moment {}",
            wrench.force, wrench.moment
        ),
        "check the size of the numbers",
    ))
}

//! One row per grip: the columns that CSV and Parquet share.

use std::io::Write;

use glam::{DQuat, DVec3};
use rustc_hash::FxHashMap;

use super::{Format, Options, View, tidy};
use crate::error::Result;
use crate::geometry::patch_area;
use crate::model::{Slip, Wrench};
use crate::rank;
use crate::results::{ForceRange, GripSet, PadFriction, RankedGrip};

/// A column with its name, which ends in the unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, e.g. `width_m`.
    pub name: &'static str,
    /// One value per grip.
    pub values: Values,
}

/// The values of a column; `None` where there is none.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Whole numbers.
    Integer(Vec<u64>),
    /// Numbers, never nan or infinite.
    Number(Vec<Option<f64>>),
    /// Words.
    Text(Vec<String>),
}

/// Columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// In the order in which they are written.
    pub columns: Vec<Column>,
    /// Number of grips.
    pub rows: usize,
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Integer(values) => values.len(),
            Self::Number(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }

    /// Adds the values of a column of this kind, and before and after them what stands for none.
    fn fill(&mut self, length: usize, more: Option<Self>) {
        match (self, more) {
            (Self::Integer(all), more) => {
                all.resize(length, 0);
                if let Some(Self::Integer(more)) = more {
                    all.extend(more);
                }
            }
            (Self::Number(all), more) => {
                all.resize(length, None);
                if let Some(Self::Number(more)) = more {
                    all.extend(more);
                }
            }
            (Self::Text(all), more) => {
                all.resize(length, String::new());
                if let Some(Self::Text(more)) = more {
                    all.extend(more);
                }
            }
        }
    }
}

impl Table {
    /// Adds the rows of another table below; a column that only one of them has is empty in the
    /// rows of the other.
    pub fn append(&mut self, other: Self) {
        let rows = self.rows;
        for column in other.columns {
            match self.columns.iter_mut().find(|known| known.name == column.name) {
                Some(known) => known.values.fill(rows, Some(column.values)),
                None => {
                    let mut values = match &column.values {
                        Values::Integer(_) => Values::Integer(Vec::new()),
                        Values::Number(_) => Values::Number(Vec::new()),
                        Values::Text(_) => Values::Text(Vec::new()),
                    };
                    values.fill(rows, Some(column.values));
                    self.columns.push(Column { name: column.name, values });
                }
            }
        }
        self.rows += other.rows;
        for column in &mut self.columns {
            if column.values.len() < self.rows {
                column.values.fill(self.rows, None);
            }
        }
    }
}

/// The table of a set.
///
/// # Errors
/// When the tool frame's origin is the flange and the gripper states none.
pub fn table(set: &GripSet, options: &Options) -> Result<Table> {
    Ok(from_view(&View::new(set, Format::Csv, options)?))
}

pub(super) fn from_view(view: &View<'_>) -> Table {
    let grips = view.grips();
    let integer = |name, value: &dyn Fn(&RankedGrip) -> u64| Column {
        name,
        values: Values::Integer(grips.iter().map(value).collect()),
    };
    let text = |name, value: &dyn Fn(&RankedGrip) -> String| Column {
        name,
        values: Values::Text(grips.iter().map(value).collect()),
    };
    let number = |name, value: &dyn Fn(&RankedGrip) -> Option<f64>| Column {
        name,
        values: Values::Number(
            grips.iter().map(|grip| value(grip).filter(|value| value.is_finite())).collect(),
        ),
    };
    let vector = |names: [&'static str; 3], value: &dyn Fn(&RankedGrip) -> DVec3| {
        names
            .into_iter()
            .enumerate()
            .map(move |(axis, name)| number(name, &|grip| Some(value(grip)[axis])))
            .collect::<Vec<_>>()
    };
    let quaternion =
        |grip: &RankedGrip| positive(DQuat::from_mat3(&view.pose(grip).rotation)).to_array();

    let mut columns = vec![
        integer("rank", &|grip| grip.rank),
        integer("id", &|grip| grip.grip.id),
        number("score", &|grip| grip.score),
        number("mu_s", &|grip| grip.worst.mu_s),
        text("status", &|grip| word(&grip.worst.status)),
        text("verdict", &|grip| view.verdict(grip).name().to_owned()),
        integer("load", &|grip| u64::from(grip.worst.load)),
        text("load_name", &|grip| {
            view.set
                .loads
                .get(grip.worst.load as usize)
                .map(|load| load.name.clone())
                .unwrap_or_default()
        }),
        number("width_m", &|grip| Some(grip.grip.width)),
        text("side", &|grip| if grip.grip.inside { "inside".into() } else { "outside".into() }),
        number("jaw_gap_m", &|grip| Some(view.gap(grip))),
        number("opened_gap_m", &|grip| Some(view.opened(grip))),
    ];
    columns.extend(vector(["x_m", "y_m", "z_m"], &|grip| view.pose(grip).origin));
    columns.extend(
        ["qx", "qy", "qz", "qw"]
            .into_iter()
            .enumerate()
            .map(|(index, name)| number(name, &|grip| Some(quaternion(grip)[index]))),
    );
    columns.extend(vector(["approach_x", "approach_y", "approach_z"], &|grip| {
        tidy(grip.grip.part_from_grip.rotation.x_axis)
    }));
    columns.extend(vector(["closing_x", "closing_y", "closing_z"], &|grip| {
        tidy(grip.grip.part_from_grip.rotation.z_axis)
    }));
    columns.extend([
        text("tool_frame", &|_| view.tool_frame()),
        integer("face_i", &|grip| u64::from(grip.grip.face_i)),
        integer("face_ii", &|grip| u64::from(grip.grip.face_ii)),
        number("angle_rad", &|grip| Some(grip.grip.angle)),
        number("area_i_m2", &|grip| Some(patch_area(&grip.grip.contact.face_i))),
        number("area_ii_m2", &|grip| Some(patch_area(&grip.grip.contact.face_ii))),
        number("pad_share", &|grip| {
            view.gripper.as_ref().map(|gripper| gripper.pad_share(&grip.grip.contact))
        }),
        number("contact_share", &|grip| Some(grip.contact_share)),
        number("twist_margin", &|grip| Some(grip.twist_margin)),
        number("alpha_rad", &|grip| Some(grip.alpha)),
        number("delta_d_m", &|grip| Some(grip.delta_d)),
        number("safety", &|grip| grip.safety),
        number("force_needed_n", &|grip| grip.force_needed),
        text("force_range", &|grip| {
            view.set.force_range(grip).map_or("", ForceRange::name).to_owned()
        }),
        number("load_multiple", &|grip| grip.load_multiple),
        text("slip", &|grip| match grip.worst.slip {
            Some(Slip::Rotation { .. }) => "rotation".into(),
            Some(Slip::Translation { .. }) => "translation".into(),
            Some(Slip::Spin { .. }) => "spin".into(),
            Some(Slip::None) => "none".into(),
            None => String::new(),
        }),
        number("slip_c1_m", &|grip| slip_centre(grip).map(|c| c[0])),
        number("slip_c2_m", &|grip| slip_centre(grip).map(|c| c[1])),
    ]);
    columns.extend(vector(["force_1_n", "force_2_n", "force_3_n"], &|grip| worst(grip).force));
    columns
        .extend(vector(["moment_1_nm", "moment_2_nm", "moment_3_nm"], &|grip| worst(grip).moment));
    columns.extend([
        number("mu_lower", &|grip| grip.worst.bounds.map(|bounds| bounds.lower)),
        number("mu_upper", &|grip| grip.worst.bounds.map(|bounds| bounds.upper)),
        number("residual", &|grip| Some(grip.worst.residual)),
    ]);
    // What the whole result is about, so that rows of several can stand in one table.
    let PadFriction { value: friction, safety } = view.pads();
    columns.extend([
        text("part", &|_| view.set.part.file.clone()),
        text("gripper", &|_| view.name().to_owned()),
        number("mass_kg", &|_| Some(view.set.part.mass.mass)),
        number("force_n", &|_| Some(view.set.provenance.resolved.force.0)),
        number("pad_friction", &|_| friction),
        number("safety_asked", &|_| Some(safety)),
    ]);
    // Only where they were asked for.
    if grips.iter().any(|grip| grip.pose_noise.is_some()) {
        columns.extend([
            number("noise_mu_s_95", &|grip| grip.pose_noise.and_then(|noise| noise.mu_s_95)),
            number("noise_mu_s_worst", &|grip| grip.pose_noise.and_then(|noise| noise.mu_s_worst)),
            number("noise_lost_share", &|grip| {
                grip.pose_noise.map(|noise| f64::from(noise.lost) / f64::from(noise.samples))
            }),
        ]);
    }
    if grips.iter().any(|grip| grip.earlier.is_some()) {
        columns.extend([
            number("earlier_evaluation", &|grip| {
                grip.earlier.as_ref().map(|earlier| earlier.evaluation)
            }),
            number("earlier_place", &|grip| grip.earlier.as_ref().map(|earlier| earlier.place)),
            number("earlier_mu_s", &|grip| grip.earlier.as_ref().map(|earlier| earlier.mu_s)),
        ]);
    }
    // Of round parts.
    if view.set.part.symmetry.is_some() {
        let ids = view.set.grips.iter().map(|grip| grip.grip.id);
        let firsts: FxHashMap<u64, u64> = ids.zip(rank::turned(view.set)).collect();
        columns.push(number("turn_of", &|grip| firsts.get(&grip.grip.id).map(|&id| id as f64)));
    }
    Table { columns, rows: grips.len() }
}

/// A scalar part below this is that of half a turn, but for rounding.
const HALF_TURN: f64 = 1e-9;

/// The quaternion with a scalar part that is not negative: one of the two that mean the same
/// rotation. Of half a turn, whose scalar part is zero, the one whose first other part is positive.
pub(super) fn positive(quaternion: DQuat) -> DQuat {
    let quaternion = quaternion.normalize();
    let [x, y, z, w] = quaternion.to_array();
    let first = [w, x, y, z].into_iter().find(|part| part.abs() > HALF_TURN);
    if first.is_some_and(|part| part < 0.0) { -quaternion } else { quaternion }
}

/// What rounding leaves of nothing, as a share of a force, and of it times a metre.
const ROUNDING: f64 = 1e-15;

/// The worst load without components that are rounding only.
fn worst(grip: &RankedGrip) -> Wrench {
    let Wrench { force, moment } = grip.worst.wrench;
    let size = force.length();
    let plain = |value: DVec3, least: f64| {
        DVec3::from_array(value.to_array().map(|v| if v.abs() <= least { 0.0 } else { v }))
    };
    let moment_size = size.max(moment.length());
    Wrench { force: plain(force, ROUNDING * size), moment: plain(moment, ROUNDING * moment_size) }
}

fn slip_centre(grip: &RankedGrip) -> Option<[f64; 2]> {
    match grip.worst.slip {
        Some(Slip::Rotation { c, .. }) => {
            Some(c.map(|value| if value.abs() <= ROUNDING { 0.0 } else { value }))
        }
        _ => None,
    }
}

/// A unit variant as the result file spells it.
fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value)
        .ok()
        .and_then(|value| value.as_str().map(str::to_owned))
        .unwrap_or_default()
}

/// A text that no spreadsheet takes for a formula.
fn unformulated(text: &str) -> String {
    if text.starts_with(['=', '+', '-', '@', '\t', '\r']) {
        format!("'{text}")
    } else {
        text.into()
    }
}

pub(super) fn write_csv(
    table: &Table,
    spreadsheet: bool,
    writer: &mut impl Write,
) -> std::io::Result<()> {
    let mut csv = csv::Writer::from_writer(writer);
    csv.write_record(table.columns.iter().map(|column| column.name)).map_err(plain)?;
    for row in 0..table.rows {
        csv.write_record(table.columns.iter().map(|column| match &column.values {
            Values::Integer(values) => values[row].to_string(),
            // The shortest text that reads back as the same number.
            Values::Number(values) => {
                values[row].map(|value| format!("{value:?}")).unwrap_or_default()
            }
            Values::Text(values) if spreadsheet => unformulated(&values[row]),
            Values::Text(values) => values[row].clone(),
        }))
        .map_err(plain)?;
    }
    csv.flush()
}

/// The error of the file below, so that its kind is seen: a pipe whose reader has gone, say.
fn plain(error: csv::Error) -> std::io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => std::io::Error::other(format!("{other:?}")),
    }
}

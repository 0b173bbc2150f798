//! Tables of several sets, and of what is no grip.

use glam::{DQuat, DVec3};

use super::table::{Column, Table, Values, positive};
use super::{Format, Options, View};
use crate::error::Result;
use crate::model::{Frame, Negative};
use crate::results::GripSet;

impl Table {
    /// The table with this column in front, the same text in every row, instead of another one of its name.
    #[must_use]
    pub fn with_text(self, name: &'static str, text: &str) -> Self {
        let values = Values::Text(vec![text.to_owned(); self.rows]);
        self.with(Column { name, values })
    }

    /// The table with this column of whole numbers in front, one for each row.
    #[must_use]
    pub fn with_integers(self, name: &'static str, values: Vec<u64>) -> Self {
        debug_assert_eq!(values.len(), self.rows);
        self.with(Column { name, values: Values::Integer(values) })
    }

    /// The table without a column.
    #[must_use]
    pub fn without(mut self, name: &str) -> Self {
        self.columns.retain(|column| column.name != name);
        self
    }

    fn with(self, column: Column) -> Self {
        let mut table = self.without(column.name);
        table.columns.insert(0, column);
        table
    }
}

/// One row for each of a set's candidates that are no grips: pose of the tool frame as in
/// [`super::table()`], faces, and the reason.
///
/// # Errors
/// As [`super::table()`].
pub fn negatives_table(set: &GripSet, options: &Options) -> Result<Table> {
    let view = View::new(set, Format::Csv, options)?;
    let poses: Vec<(&Negative, Frame)> =
        set.negatives.iter().map(|pose| (pose, view.negative_pose(pose))).collect();
    let number = |name, value: &dyn Fn(&Negative, &Frame) -> f64| Column {
        name,
        values: Values::Number(poses.iter().map(|(pose, tool)| Some(value(pose, tool))).collect()),
    };
    let integer = |name, value: &dyn Fn(&Negative) -> u64| Column {
        name,
        values: Values::Integer(poses.iter().map(|(pose, _)| value(pose)).collect()),
    };
    let text = |name, value: &dyn Fn(&Negative) -> String| Column {
        name,
        values: Values::Text(poses.iter().map(|(pose, _)| value(pose)).collect()),
    };
    let vector = |names: [&'static str; 3], value: &dyn Fn(&Negative, &Frame) -> DVec3| {
        [0, 1, 2].map(|axis: usize| number(names[axis], &|pose, tool| value(pose, tool)[axis]))
    };
    let mut columns = vec![
        integer("id", &|pose| pose.id),
        text("reason", &|pose| pose.reason.clone()),
        number("width_m", &|pose, _| pose.width),
        text("side", &|pose| if pose.inside { "inside".into() } else { "outside".into() }),
    ];
    columns.extend(vector(["x_m", "y_m", "z_m"], &|_, tool| tool.origin));
    let quaternion = |tool: &Frame| positive(DQuat::from_mat3(&tool.rotation)).to_array();
    columns.extend(
        ["qx", "qy", "qz", "qw"]
            .into_iter()
            .enumerate()
            .map(|(index, name)| number(name, &|_, tool| quaternion(tool)[index])),
    );
    columns.extend(vector(["approach_x", "approach_y", "approach_z"], &|pose, _| {
        pose.part_from_grip.rotation.x_axis
    }));
    columns.extend(vector(["closing_x", "closing_y", "closing_z"], &|pose, _| {
        pose.part_from_grip.rotation.z_axis
    }));
    columns.extend([
        text("tool_frame", &|_| view.tool_frame()),
        integer("face_i", &|pose| u64::from(pose.face_i)),
        integer("face_ii", &|pose| u64::from(pose.face_ii)),
        number("angle_rad", &|pose, _| pose.angle),
    ]);
    Ok(Table { columns, rows: poses.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: usize, names: &[&'static str]) -> Table {
        let column = |name: &&'static str| Column {
            name,
            values: Values::Number((0..rows).map(|row| Some(row as f64)).collect()),
        };
        Table { columns: names.iter().map(column).collect(), rows }
    }

    #[test]
    fn tables_of_different_columns_are_joined_with_gaps() {
        let mut joined = Table::default();
        joined.append(table(2, &["a", "b"]).with_text("part", "one"));
        joined.append(table(1, &["b", "c"]).with_text("part", "two"));
        let names: Vec<_> = joined.columns.iter().map(|column| column.name).collect();
        assert_eq!((joined.rows, names), (3, vec!["part", "a", "b", "c"]));
        let numbers = |index: usize| match &joined.columns[index].values {
            Values::Number(values) => values.clone(),
            other => panic!("{other:?}"),
        };
        assert_eq!(numbers(1), [Some(0.0), Some(1.0), None]);
        assert_eq!(numbers(2), [Some(0.0), Some(1.0), Some(0.0)]);
        assert_eq!(numbers(3), [None, None, Some(0.0)]);
    }
}

//! Poses as robot controllers take them: millimetres, and the angles of one maker.

use glam::{DMat3, DQuat};

use super::View;
use super::table::{Column, Table, Values, positive};
use crate::error::{Error, Result};
use crate::results::RankedGrip;

/// Largest departure of a quaternion's length from 1 that is taken for rounding.
const UNIT: f64 = 1e-3;

/// Whose angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dialect {
    /// Universal Robots: the rotation vector `rx, ry, rz` \[rad\].
    #[default]
    Ur,
    /// KUKA: `A, B, C` \[deg\], turns about `z`, then the new `y`, then the new `x`.
    Kuka,
    /// ABB: the quaternion `q1, q2, q3, q4`, scalar part first.
    Abb,
    /// Fanuc: `W, P, R` \[deg\], turns about the fixed `x`, `y`, `z` in this order.
    Fanuc,
}

impl Dialect {
    /// Every dialect with its name.
    pub const ALL: [(Self, &'static str); 4] =
        [(Self::Ur, "ur"), (Self::Kuka, "kuka"), (Self::Abb, "abb"), (Self::Fanuc, "fanuc")];

    /// The dialect of this name.
    ///
    /// # Errors
    /// When there is none; the message lists them.
    pub fn parse(place: &str, name: &str) -> Result<Self> {
        let wanted = name.to_ascii_lowercase();
        Self::ALL.iter().find(|known| known.1 == wanted).map(|known| known.0).ok_or_else(|| {
            let names = Self::ALL.map(|known| known.1).join(", ");
            Error::input(place, format!("'{name}' is no dialect"), format!("use one of: {names}"))
                .with_options(&["dialect"])
        })
    }

    /// Names of the columns of the orientation.
    pub fn columns(self) -> &'static [&'static str] {
        match self {
            Self::Ur => &["rx_rad", "ry_rad", "rz_rad"],
            Self::Kuka => &["a_deg", "b_deg", "c_deg"],
            Self::Abb => &["q1", "q2", "q3", "q4"],
            Self::Fanuc => &["w_deg", "p_deg", "r_deg"],
        }
    }

    /// An orientation in this dialect, in the order of [`Dialect::columns`].
    pub fn angles(self, rotation: &DMat3) -> Vec<f64> {
        match self {
            Self::Ur => positive(DQuat::from_mat3(rotation)).to_scaled_axis().to_array().to_vec(),
            Self::Kuka => zyx(rotation).map(f64::to_degrees).to_vec(),
            Self::Abb => {
                let [x, y, z, w] = positive(DQuat::from_mat3(rotation)).to_array();
                vec![w, x, y, z]
            }
            // The same three turns: about fixed axes they come in the opposite order.
            Self::Fanuc => {
                let [a, b, c] = zyx(rotation).map(f64::to_degrees);
                vec![c, b, a]
            }
        }
    }
    /// The rotation that angles of this dialect stand for, in the order of [`Dialect::columns`];
    /// nothing where they are not as many or make none.
    pub fn rotation(self, angles: &[f64]) -> Option<DMat3> {
        let quaternion = |xyzw| {
            let quaternion = DQuat::from_array(xyzw);
            let unit = (quaternion.length() - 1.0).abs() < UNIT;
            unit.then(|| DMat3::from_quat(quaternion.normalize()))
        };
        let turns = |[a, b, c]: [f64; 3]| {
            let [a, b, c] = [a, b, c].map(f64::to_radians);
            DMat3::from_rotation_z(a) * DMat3::from_rotation_y(b) * DMat3::from_rotation_x(c)
        };
        let rotation = match (self, angles) {
            (Self::Ur, &[x, y, z]) => {
                Some(DMat3::from_quat(DQuat::from_scaled_axis(glam::DVec3::new(x, y, z))))
            }
            (Self::Kuka, &[a, b, c]) | (Self::Fanuc, &[c, b, a]) => Some(turns([a, b, c])),
            (Self::Abb, &[w, x, y, z]) => quaternion([x, y, z, w]),
            _ => None,
        };
        rotation.filter(DMat3::is_finite)
    }
}

/// The turns `[about z, about the new y, about the new x]` \[rad\] that make a rotation; where the
/// second is a right angle, only the first and third together are known, and the third is zero.
fn zyx(rotation: &DMat3) -> [f64; 3] {
    let element = |row: usize, column: usize| rotation.col(column)[row];
    let across = element(0, 0).hypot(element(1, 0));
    let b = (-element(2, 0)).atan2(across);
    if across < 1e-9 {
        return [(-element(0, 1)).atan2(element(1, 1)), b, 0.0];
    }
    [element(1, 0).atan2(element(0, 0)), b, element(2, 1).atan2(element(2, 2))]
}

pub(super) fn table(view: &View<'_>) -> Table {
    let grips = view.grips();
    let dialect = view.options.dialect;
    let integers = |name, value: &dyn Fn(&RankedGrip) -> u64| Column {
        name,
        values: Values::Integer(grips.iter().map(value).collect()),
    };
    let numbers = |name, value: &dyn Fn(&RankedGrip) -> Option<f64>| Column {
        name,
        // No negative zeros.
        values: Values::Number(grips.iter().map(|grip| value(grip).map(|x| x + 0.0)).collect()),
    };
    let text = |name, text: &str| Column {
        name,
        values: Values::Text(vec![text.to_owned(); grips.len()]),
    };
    let angles: Vec<Vec<f64>> =
        grips.iter().map(|grip| dialect.angles(&view.pose(grip).rotation)).collect();
    let mut columns =
        vec![integers("rank", &|grip| grip.rank), integers("id", &|grip| grip.grip.id)];
    for (axis, name) in ["x_mm", "y_mm", "z_mm"].into_iter().enumerate() {
        columns.push(numbers(name, &|grip| Some(view.pose(grip).origin[axis] * 1e3)));
    }
    for (k, &name) in dialect.columns().iter().enumerate() {
        let values = angles.iter().map(|angles| Some(angles[k] + 0.0)).collect();
        columns.push(Column { name, values: Values::Number(values) });
    }
    columns.extend([
        numbers("jaw_gap_mm", &|grip| Some(view.gap(grip) * 1e3)),
        numbers("opened_gap_mm", &|grip| Some(view.opened(grip) * 1e3)),
        numbers("mu_s", &|grip| grip.worst.mu_s),
        Column {
            name: "verdict",
            values: Values::Text(
                grips.iter().map(|grip| view.verdict(grip).name().to_owned()).collect(),
            ),
        },
        text("part_file", &view.set.part.file),
        text("gripper_name", view.name()),
        text("tool_frame", &view.tool_frame()),
    ]);
    Table { columns, rows: grips.len() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn angles_make_the_rotation_again_also_at_the_pole() {
        let mut rotations = vec![DMat3::IDENTITY];
        for a in [-3.0, -1.0, 0.0, 0.4, PI] {
            for b in [-FRAC_PI_2, -0.7, 0.0, 1.2, FRAC_PI_2] {
                for c in [-2.5, 0.0, 0.9, PI] {
                    rotations.push(
                        DMat3::from_rotation_z(a)
                            * DMat3::from_rotation_y(b)
                            * DMat3::from_rotation_x(c),
                    );
                }
            }
        }
        for rotation in rotations {
            let same = |made: DMat3, name: &str| {
                assert!(made.abs_diff_eq(rotation, 1e-8), "{name}: {made} is not {rotation}");
            };
            let [rx, ry, rz] = Dialect::Ur.angles(&rotation)[..] else { panic!() };
            let vector = glam::DVec3::new(rx, ry, rz);
            assert!(vector.length() <= PI + 1e-12);
            same(DMat3::from_quat(DQuat::from_scaled_axis(vector)), "ur");
            let degrees = |dialect: Dialect| -> Vec<f64> {
                dialect.angles(&rotation).into_iter().map(f64::to_radians).collect()
            };
            let [a, b, c] = degrees(Dialect::Kuka)[..] else { panic!() };
            let kuka =
                DMat3::from_rotation_z(a) * DMat3::from_rotation_y(b) * DMat3::from_rotation_x(c);
            same(kuka, "kuka");
            let [w, p, r] = degrees(Dialect::Fanuc)[..] else { panic!() };
            // About fixed axes: the first turn stands at the right.
            let fanuc =
                DMat3::from_rotation_z(r) * (DMat3::from_rotation_y(p) * DMat3::from_rotation_x(w));
            same(fanuc, "fanuc");
            let [q1, q2, q3, q4] = Dialect::Abb.angles(&rotation)[..] else { panic!() };
            // Of half a turn it is zero but for rounding, on either side.
            assert!(q1 >= -1e-9);
            same(DMat3::from_quat(DQuat::from_xyzw(q2, q3, q4, q1)), "abb");
            for (dialect, name) in Dialect::ALL {
                same(dialect.rotation(&dialect.angles(&rotation)).unwrap(), name);
            }
        }
        assert_eq!(Dialect::Abb.rotation(&[0.0; 4]), None);
        assert_eq!(Dialect::Ur.rotation(&[f64::NAN, 0.0, 0.0]), None);
        assert!(Dialect::parse("dialect", "KUKA").is_ok());
        assert!(Dialect::parse("dialect", "denso").unwrap_err().to_string().contains("fanuc"));
    }
}

//! Trajectories: the motion of the part over time, turned into inertial wrenches.
//!
//! Rows hold a time and any of: the position `x,y,z` of the part frame's origin and the orientation
//! `qx,qy,qz,qw` of the part frame in the world, the origin's velocity `vx,vy,vz` or acceleration
//! `ax,ay,az`, the angular velocity `wx,wy,wz` or acceleration `alx,aly,alz`. The most direct
//! column is used and the rest differentiated: acceleration before velocity before position.

use glam::{DMat3, DQuat, DVec3};

use super::list::finite;
use super::table::{Axes, Table};
use super::{checked_mass, inertial_wrench};
use crate::error::{Error, Result};
use crate::model::{Frame, LoadCase};
use crate::part::MassProperties;

/// Rows that a derivative is taken from; fewer at hand, fewer used.
const WINDOW: usize = 5;
/// Largest turn between two rows of poses \[rad\]: five rows then stay below half a turn, where the
/// rotation vector is unique.
const LARGEST_TURN: f64 = std::f64::consts::FRAC_PI_4;

const POSITION: [&str; 3] = ["x", "y", "z"];
const QUATERNION: [&str; 4] = ["qx", "qy", "qz", "qw"];
const VELOCITY: [&str; 3] = ["vx", "vy", "vz"];
const ACCELERATION: [&str; 3] = ["ax", "ay", "az"];
const ANGULAR_VELOCITY: [&str; 3] = ["wx", "wy", "wz"];
const ANGULAR_ACCELERATION: [&str; 3] = ["alx", "aly", "alz"];

/// One load case per row: weight and inertial wrench in the part frame about the centre of mass.
///
/// `world_from_part` gives the first orientation when the file has no quaternions; the angular
/// velocity then carries it on.
pub(super) fn from_table(
    table: &Table,
    mass: &MassProperties,
    world_from_part: &Frame,
    world_gravity: DVec3,
) -> Result<Vec<LoadCase>> {
    checked_mass(mass)?;
    let times = times(table)?;
    let axes = axes(table)?;
    let column = |columns| -> Result<Option<Vec<DVec3>>> {
        if !table.has_vector(columns)? {
            return Ok(None);
        }
        (0..table.len()).map(|row| table.vector(row, columns)).collect::<Result<_>>().map(Some)
    };
    let position = column(POSITION)?;
    let velocity = column(VELOCITY)?;
    let acceleration = column(ACCELERATION)?;
    let stated_omega = column(ANGULAR_VELOCITY)?;
    let stated_alpha = column(ANGULAR_ACCELERATION)?;
    let quaternions = quaternions(table)?;
    if position.is_none()
        && velocity.is_none()
        && acceleration.is_none()
        && stated_omega.is_none()
        && quaternions.is_none()
    {
        let (problem, remedy) = if stated_alpha.is_some() {
            (
                "an angular acceleration without an angular velocity",
                "add wx,wy,wz or qx,qy,qz,qw: the gyroscopic moment needs them",
            )
        } else {
            ("no motion", "add one of ax,ay,az / vx,vy,vz / x,y,z / qx,qy,qz,qw / wx,wy,wz")
        };
        return Err(Error::input(table.header_place(), problem, remedy));
    }
    if stated_alpha.is_some() && stated_omega.is_none() && quaternions.is_none() {
        return Err(Error::input(
            table.header_place(),
            "an angular acceleration without an angular velocity",
            "add wx,wy,wz or qx,qy,qz,qw: the gyroscopic moment needs them",
        ));
    }

    let rotations: Vec<DMat3> = match &quaternions {
        Some(quaternions) => {
            quaternions.iter().map(|quaternion| DMat3::from_quat(*quaternion)).collect()
        }
        None => integrate(world_from_part.rotation, &times, stated_omega.as_deref(), axes),
    };
    let to_world = |vectors: Vec<DVec3>| -> Vec<DVec3> {
        match axes {
            Axes::World => vectors,
            Axes::Part => vectors
                .iter()
                .zip(&rotations)
                .map(|(vector, rotation)| *rotation * *vector)
                .collect(),
        }
    };

    let origin_acceleration = match (acceleration, velocity, position) {
        (Some(acceleration), _, _) => to_world(acceleration),
        (None, Some(velocity), _) => differentiate(table, &times, &to_world(velocity), 1)?,
        (None, None, Some(position)) => differentiate(table, &times, &position, 2)?,
        (None, None, None) => vec![DVec3::ZERO; times.len()],
    };
    let (omega, alpha) = match (stated_omega, &quaternions) {
        (Some(omega), _) => {
            let omega = to_world(omega);
            let alpha = match stated_alpha {
                Some(alpha) => to_world(alpha),
                None => differentiate(table, &times, &omega, 1)?,
            };
            (omega, alpha)
        }
        (None, Some(quaternions)) => {
            let (omega, alpha) = turn_rates(table, &times, quaternions)?;
            (omega, stated_alpha.map_or(alpha, to_world))
        }
        (None, None) => (vec![DVec3::ZERO; times.len()], vec![DVec3::ZERO; times.len()]),
    };

    (0..times.len())
        .map(|row| {
            let arm = rotations[row] * mass.centre_of_mass;
            let centre_acceleration = origin_acceleration[row]
                + alpha[row].cross(arm)
                + omega[row].cross(omega[row].cross(arm));
            let part_from_world = rotations[row].transpose();
            let turn = |vector: DVec3| part_from_world * vector;
            let wrench = inertial_wrench(
                mass,
                turn(world_gravity),
                turn(centre_acceleration),
                turn(omega[row]),
                turn(alpha[row]),
            );
            finite(&table.place(row), format!("{} t={:.6}s", table.file_name(), times[row]), wrench)
        })
        .collect()
}

fn times(table: &Table) -> Result<Vec<f64>> {
    let times: Vec<f64> =
        (0..table.len()).map(|row| table.number(row, "t")).collect::<Result<_>>()?;
    for row in 1..times.len() {
        if times[row] <= times[row - 1] {
            return Err(Error::input(
                table.place(row),
                format!("time {} s does not come after {} s", times[row], times[row - 1]),
                "sort the rows by time and drop repeated ones",
            ));
        }
    }
    Ok(times)
}

fn axes(table: &Table) -> Result<Axes> {
    let mut found = None;
    for row in 0..table.len() {
        let Some(text) = table.text(row, "frame") else { continue };
        let axes = Axes::parse(&table.place(row), text)?;
        if *found.get_or_insert(axes) != axes {
            return Err(Error::input(
                table.place(row),
                "the frame changes within the trajectory",
                "give all rows in the same axes",
            ));
        }
    }
    Ok(found.unwrap_or(Axes::World))
}

fn quaternions(table: &Table) -> Result<Option<Vec<DQuat>>> {
    match QUATERNION.iter().filter(|column| table.has(column)).count() {
        0 => return Ok(None),
        4 => {}
        _ => {
            return Err(Error::input(
                table.header_place(),
                "part of qx,qy,qz,qw is missing",
                "give all four or none",
            ));
        }
    }
    let read = |row: usize| {
        let [x, y, z, w] = [0, 1, 2, 3].map(|index| table.number(row, QUATERNION[index]));
        let quaternion = DQuat::from_xyzw(x?, y?, z?, w?);
        // Loose enough for four printed decimals, tight enough to catch angles or swapped columns.
        if (quaternion.length() - 1.0).abs() > 1e-3 {
            return Err(Error::input(
                table.place(row),
                format!("the quaternion has length {}", quaternion.length()),
                "give unit quaternions, scalar part last (qw)",
            ));
        }
        Ok(quaternion.normalize())
    };
    (0..table.len()).map(read).collect::<Result<_>>().map(Some)
}

/// Orientations carried on by the angular velocity; the mean of two rows turns from one to the next
/// (second order in the step).
fn integrate(first: DMat3, times: &[f64], omega: Option<&[DVec3]>, axes: Axes) -> Vec<DMat3> {
    let Some(omega) = omega else { return vec![first; times.len()] };
    let mut rotation = DQuat::from_mat3(&first);
    let mut found = vec![first];
    for row in 1..times.len() {
        let turn = DQuat::from_scaled_axis(
            (omega[row - 1] + omega[row]) * (0.5 * (times[row] - times[row - 1])),
        );
        rotation = match axes {
            Axes::World => turn * rotation,
            Axes::Part => rotation * turn,
        }
        .normalize();
        found.push(DMat3::from_quat(rotation));
    }
    found
}

/// The rows that the derivative at `row` is taken from: itself and its neighbours, one-sided at the
/// ends.
fn window(row: usize, rows: usize) -> std::ops::Range<usize> {
    let size = WINDOW.min(rows);
    let first = row.saturating_sub(size / 2).min(rows - size);
    first..first + size
}

/// First or second derivative of a sampled vector.
fn differentiate(
    table: &Table,
    times: &[f64],
    values: &[DVec3],
    order: usize,
) -> Result<Vec<DVec3>> {
    if times.len() <= order {
        return Err(Error::input(
            table.place(0),
            format!("{} row(s) are too few to differentiate", times.len()),
            format!("give at least {}", order + 1),
        ));
    }
    Ok((0..times.len())
        .map(|row| {
            let window = window(row, times.len());
            let weights = weights(times[row], &times[window.clone()]);
            values[window].iter().zip(&weights).map(|(value, weight)| *value * weight[order]).sum()
        })
        .collect())
}

/// Angular velocity and acceleration in world axes from orientations.
///
/// With `R(t) = R_i exp(phi(t))` and `phi(t_i) = 0`, the derivatives of `phi` at `t_i` ARE the
/// angular velocity and acceleration in part axes: the Jacobian of exp is `1 - phi/2 x ..`, whose
/// first-order term contributes `phi' x phi' = 0`.
fn turn_rates(
    table: &Table,
    times: &[f64],
    quaternions: &[DQuat],
) -> Result<(Vec<DVec3>, Vec<DVec3>)> {
    let rows = times.len();
    if rows < 3 {
        return Err(Error::input(
            table.place(0),
            format!("{rows} row(s) of orientations are too few to differentiate"),
            "give at least 3",
        ));
    }
    for row in 1..rows {
        let turn = rotation_vector(quaternions[row - 1].conjugate() * quaternions[row]).length();
        if turn > LARGEST_TURN {
            return Err(Error::input(
                table.place(row),
                format!("the part turns by {:.1} degrees since the row before", turn.to_degrees()),
                format!(
                    "sample the trajectory finer: at most {:.0} degrees between rows",
                    LARGEST_TURN.to_degrees()
                ),
            ));
        }
    }
    let rates = (0..rows).map(|row| {
        let window = window(row, rows);
        let weights = weights(times[row], &times[window.clone()]);
        let (mut omega, mut alpha) = (DVec3::ZERO, DVec3::ZERO);
        for (weight, quaternion) in weights.iter().zip(&quaternions[window]) {
            let phi = rotation_vector(quaternions[row].conjugate() * *quaternion);
            omega += phi * weight[1];
            alpha += phi * weight[2];
        }
        (quaternions[row] * omega, quaternions[row] * alpha)
    });
    Ok(rates.unzip())
}

/// Axis times angle, the shorter way round; exact for small turns, where an arc cosine is not.
fn rotation_vector(quaternion: DQuat) -> DVec3 {
    let quaternion = if quaternion.w < 0.0 { -quaternion } else { quaternion };
    let sine = quaternion.xyz().length();
    if sine < 1e-150 {
        return quaternion.xyz() * 2.0;
    }
    quaternion.xyz() * (2.0 * sine.atan2(quaternion.w) / sine)
}

/// Weights of the samples at `nodes` for the value and the first two derivatives at `at` (Fornberg
/// 1988).
fn weights(at: f64, nodes: &[f64]) -> Vec<[f64; 3]> {
    let mut weights = vec![[0.0; 3]; nodes.len()];
    weights[0][0] = 1.0;
    let mut c1 = 1.0;
    let mut c4 = nodes[0] - at;
    for i in 1..nodes.len() {
        let highest = i.min(2);
        let mut c2 = 1.0;
        let c5 = c4;
        c4 = nodes[i] - at;
        for j in 0..i {
            let c3 = nodes[i] - nodes[j];
            c2 *= c3;
            if j == i - 1 {
                let before = weights[i - 1];
                for k in (1..=highest).rev() {
                    weights[i][k] = c1 * (k as f64 * before[k - 1] - c5 * before[k]) / c2;
                }
                weights[i][0] = -c1 * c5 * before[0] / c2;
            }
            for k in (1..=highest).rev() {
                weights[j][k] = (c4 * weights[j][k] - k as f64 * weights[j][k - 1]) / c3;
            }
            weights[j][0] = c4 * weights[j][0] / c3;
        }
        c1 = c2;
    }
    weights
}

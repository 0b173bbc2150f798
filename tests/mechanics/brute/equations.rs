//! The seven equations (3)-(9) of an answer in SI, put together anew.

use glam::DVec2;
use gripfast::contact::{Field, friction};
use gripfast::model::{Score, Slip};

use super::cases::Case;
use super::{Rings, loops, moments, precise, pressed, rings};

/// What the equations say of an answer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Check {
    /// Largest residual over the largest force in the equations, `Fn` or the load's with its lever;
    /// moments over that times `sqrt(A)`.
    pub(crate) residual: f64,
    /// What rounding the answer's numbers to doubles may alone change in it: on a small contact the
    /// pressure is the small difference of large coefficients.
    pub(crate) rounding: f64,
    /// Areas in contact by the pressure planes [m^2].
    pub(crate) areas: [f64; 2],
    /// `mu |d| / sqrt(A)`.
    pub(crate) coupling: f64,
}

/// `None` for an answer without numbers. The contact is where the planes are positive, so the
/// pressure on it is.
pub(crate) fn check(case: &Case, score: &Score) -> Option<Check> {
    let (mu, slip, p) = (score.mu_s?, score.slip?, score.pressure?);
    let twist = match slip {
        Slip::Rotation { c, sense } => {
            [f64::from(sense) * c[1], -f64::from(sense) * c[0], f64::from(sense)]
        }
        Slip::Translation { direction } => [direction[0], direction[1], 0.0],
        // Planes do not spin.
        Slip::Spin { .. } => return None,
        Slip::None => [0.0; 3],
    };
    let planes = [[p.a_i0, p.a1, p.a2], [p.a_ii0, -p.a1, -p.a2]];
    let whole: [Rings; 2] = [rings(&case.contact.face_i), rings(&case.contact.face_ii)];
    let length = whole.each_ref().map(|area| moments(area)[0] / 2.0).iter().sum::<f64>().sqrt();
    let mut friction_on_body = [[0.0; 3]; 2];
    let (mut normal, mut x, mut rounding, mut areas) = ([0.0; 2], DVec2::ZERO, 0.0f64, [0.0; 2]);
    for k in 0..2 {
        let p = planes[k];
        let contact = pressed(&whole[k], p);
        let [area, force, x1, x2] = precise::pressed(&whole[k], p);
        areas[k] = area;
        normal[k] = force;
        let sign = [1.0, -1.0][k];
        x += sign * DVec2::new(x1, x2);
        let reach = contact
            .iter()
            .flatten()
            .map(|x| p[0].abs() + (p[1] * x.x).abs() + (p[2] * x.y).abs())
            .fold(0.0, f64::max);
        // In the moments each part counts with its lever.
        let lever = contact.iter().flatten().map(|x| x.length() / length).fold(1.0, f64::max);
        rounding += f64::EPSILON * reach * area * lever / case.force;
        if twist != [0.0; 3] {
            // Force -mu p t on the body, moment about the origin.
            friction_on_body[k] = friction(Field { area: &loops(&contact), p }, twist.into())
                .gradient(p)
                .map(|g| -mu * g);
        }
    }
    let (f, m, d) = (case.wrench.force, case.wrench.moment, case.distance);
    let [one, two] = friction_on_body;
    let arm = case.force * length;
    let residuals = [
        (f.x + one[0] + two[0]) / case.force,
        (f.y + one[1] + two[1]) / case.force,
        (m.z + one[2] + two[2]) / arm,
        (m.x - d / 2.0 * (one[1] - two[1]) - x.y) / arm,
        (m.y + d / 2.0 * (one[0] - two[0]) + x.x) / arm,
        (f.z - normal[0] + normal[1]) / case.force,
        (2.0 * case.force - normal[0] - normal[1]) / case.force,
    ];
    let coupling = mu * d.abs() / length;
    let residual = residuals
        .iter()
        .fold(0.0, |most: f64, r| if r.is_nan() { f64::NAN } else { most.max(r.abs()) });
    // Where the load is far larger than Fn, the equations' own terms are.
    let load = f.truncate().length().max(m.z.abs() / length) / case.force;
    let largest = 1.0 + load * (1.0 + d.abs() / length);
    // The pressures' rounding enters as it is, and as friction with its lever.
    let terms = 1.0 + mu * (1.0 + d.abs() / 2.0 / length);
    Some(Check {
        residual: residual / largest,
        rounding: 16.0 * rounding * terms / largest,
        areas,
        coupling,
    })
}

//! Which of the three ways takes the integrals: closed forms, Gauss points for far slip centres, or
//! strips along the zero-pressure line.

use super::field::{Field, Friction, Twist};
use super::{fan, far, thin};

/// Friction integrals of an area under `twist`, with the Hessian for its pressure (paper 3.5;
/// equations (3)-(7)).
///
/// Any twist but zero, `omega = 0` (pure translation) included. Error about 1e-14 of the natural
/// scale.
pub fn friction(Field { area, p }: Field<'_>, twist: Twist) -> Friction {
    let twist = twist.to_array();
    let middle = area.middle();
    let here = (p[0] + p[1] * middle.x + p[2] * middle.y).abs();
    let thin =
        (p[1] * p[1] + p[2] * p[2]) * area.radius() * area.radius() > STEEP * STEEP * here * here;
    match (thin, far::is_far(area, twist)) {
        (true, far) => thin::friction(area, twist, p, far),
        (false, true) => far::friction(area, twist, p),
        (false, false) => fan::friction(area, twist, p),
    }
}

/// Pressure that changes over the area's radius by this many times its value in the middle: the
/// area is a thin strip along its zero-pressure line. The fan's loss there, `1e-16 STEEP^2`, is
/// still unseen.
const STEEP: f64 = 100.0;

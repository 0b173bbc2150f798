//! The integrals over a contact area: closed forms over the triangle fan, Gauss quadrature for far
//! slip centres, polygon moments and the clipping of a polygon at its zero-pressure line. Pure
//! functions, the only integrals here.
//!
//! Everything is written in the **twist** `v = (u1, u2, omega)`: the velocity of the body in the
//! pad plane is `v(x) = (u1 - omega x2, u2 + omega x1)`, its unit vector `t(x)`. With the weights
//! `phi = (1, x1, x2)` the module gives
//!
//! * `g[m] = int phi_m (t1, t2, x1 t2 - x2 t1) dA`, the gradient of `D_m(v) = int phi_m |v(x)| dA`
//!   (so `D_m = v . g[m]`),
//! * the Hessian of `int p |v| dA` for a linear pressure `p = p0 + p1 x1 + p2 x2`,
//!
//! from which equations (3)-(7) follow: the friction wrench on the body is `-mu sum p_m g[m]`.

mod fan;
mod far;
mod lanes;
mod loops;
mod thin;

pub use loops::Loops;

/// Friction integrals of one area under one twist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// `g[m] = int phi_m (t1, t2, x1 t2 - x2 t1) dA` for `phi = (1, x1, x2)`.
    pub g: [[f64; 3]; 3],
    /// Hessian of `int p |v(x)| dA` in the twist, symmetric.
    pub hessian: [[f64; 3]; 3],
}

impl Friction {
    /// All zero.
    pub const ZERO: Self = Self { g: [[0.0; 3]; 3], hessian: [[0.0; 3]; 3] };

    /// `sum_m p_m g[m]`: gradient of `int p |v| dA`.
    pub fn gradient(&self, p: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| p[0] * self.g[0][i] + p[1] * self.g[1][i] + p[2] * self.g[2][i])
    }
}

/// Slip centres farther from the area's middle than this many circumradii use quadrature along the
/// edges in twist form. The fan loses one digit per decade of the distance in `int e`, two in `int
/// r`, three in the moments; few Gauss points are at rounding level from here on.
pub const FAR: f64 = 3.0;

/// Friction integrals of `area` under `twist`, with the Hessian for the pressure `p` (paper 3.5;
/// equations (3)-(7)).
///
/// Any twist but zero, `omega = 0` (pure translation) included. Error about 1e-14 of the natural
/// scale.
pub fn friction(area: &Loops, twist: [f64; 3], p: [f64; 3]) -> Friction {
    let middle = area.middle();
    let here = (p[0] + p[1] * middle.x + p[2] * middle.y).abs();
    let thin =
        (p[1] * p[1] + p[2] * p[2]) * area.radius() * area.radius() > STEEP * STEEP * here * here;
    match (thin, is_far(area, twist)) {
        (true, far) => thin::friction(area, twist, p, far),
        (false, true) => far::friction(area, twist, p),
        (false, false) => fan::friction(area, twist, p),
    }
}

/// Pressure that changes over the area's radius by this many times its value in the middle: the
/// area is a thin strip along its zero-pressure line. The fan's loss there, `1e-16 STEEP^2`, is
/// still unseen.
const STEEP: f64 = 100.0;

fn is_far(area: &Loops, twist: [f64; 3]) -> bool {
    let [u1, u2, omega] = twist;
    let (middle, reach) = (area.middle(), FAR * omega * area.radius());
    let (v1, v2) = (u1 - omega * middle.y, u2 + omega * middle.x);
    v1 * v1 + v2 * v2 > reach * reach
}

/// `(int 1, int x1, int x2, int x1^2, int x1 x2, int x2^2)` over the area.
pub fn moments(area: &Loops) -> [f64; 6] {
    area.moments()
}

#[cfg(test)]
mod tests;

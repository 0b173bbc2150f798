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

mod abreast;
mod fan;
mod far;
mod field;
mod friction;
mod lanes;
mod loops;
pub mod quadric;
pub mod surface;
mod thin;

pub(crate) use abreast::{ABREAST, Abreast, Cuts, cut_frictions, frictions};
pub use far::FAR;
pub use field::{Field, Friction, PlaneWrench, Twist};
pub use friction::friction;
pub(crate) use lanes::widest;
pub use loops::{Loops, moments};

#[cfg(test)]
mod tests;

//! What the integrals are asked for and what they give: plain numbers in any consistent units, with
//! the names that the rooms above share.

use glam::DVec2;
use nalgebra::Vector3;

use super::loops::Loops;

/// A motion of the body in the pad plane: the velocity at the origin and the rate of rotation. The
/// point `x` moves with `(u1 - omega x2, u2 + omega x1)`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Twist {
    /// Velocity along `x1`.
    pub u1: f64,
    /// Velocity along `x2`.
    pub u2: f64,
    /// Rotation about `x3`.
    pub omega: f64,
}

impl Twist {
    /// A turn about the point `c`, counter-clockwise.
    pub fn about(c: DVec2) -> Self {
        Self { u1: c.y, u2: -c.x, omega: 1.0 }
    }

    /// Velocity of the point `x`.
    pub fn velocity(self, x: DVec2) -> DVec2 {
        DVec2::new(self.u1 - self.omega * x.y, self.u2 + self.omega * x.x)
    }

    /// `[u1, u2, omega]`.
    pub fn to_array(self) -> [f64; 3] {
        [self.u1, self.u2, self.omega]
    }

    /// Whether all three numbers are finite.
    pub fn is_finite(self) -> bool {
        self.to_array().iter().all(|x| x.is_finite())
    }
}

impl From<[f64; 3]> for Twist {
    fn from([u1, u2, omega]: [f64; 3]) -> Self {
        Self { u1, u2, omega }
    }
}

impl From<Vector3<f64>> for Twist {
    fn from(v: Vector3<f64>) -> Self {
        Self { u1: v.x, u2: v.y, omega: v.z }
    }
}

impl From<Twist> for Vector3<f64> {
    fn from(v: Twist) -> Self {
        Self::new(v.u1, v.u2, v.omega)
    }
}

/// The part of a wrench that makes the body slip in the pad plane, `(F1, F2, M3)`; its power on a
/// [`Twist`] is the product of the two.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PlaneWrench {
    /// Force along `x1`.
    pub f1: f64,
    /// Force along `x2`.
    pub f2: f64,
    /// Moment about `x3`.
    pub m3: f64,
}

impl PlaneWrench {
    /// Power on a twist.
    pub fn power(self, v: Twist) -> f64 {
        self.f1 * v.u1 + self.f2 * v.u2 + self.m3 * v.omega
    }
}

impl From<Vector3<f64>> for PlaneWrench {
    fn from(w: Vector3<f64>) -> Self {
        Self { f1: w.x, f2: w.y, m3: w.z }
    }
}

impl From<PlaneWrench> for Vector3<f64> {
    fn from(w: PlaneWrench) -> Self {
        Self::new(w.f1, w.f2, w.m3)
    }
}

/// An area with its pressure `p0 + p1 x1 + p2 x2`, not negative on the area.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// The area.
    pub area: &'a Loops,
    /// The pressure coefficients.
    pub p: [f64; 3],
}

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
        let along = |i: usize| p[0] * self.g[0][i] + p[1] * self.g[1][i] + p[2] * self.g[2][i];
        [along(0), along(1), along(2)]
    }
}

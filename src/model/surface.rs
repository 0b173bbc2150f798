//! What a pad touches as it is: pieces of surface, each with its gap behind the pad plane.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::{Polygon, Ring};

/// How far a piece of surface lies behind the face's pad plane `x3 = +-d/2`, as a function of the
/// place in the pad plane. To leading order of the slope: a circle is its parabola.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Gap {
    /// `height + slope . x`: the pad plane itself, a step behind it, a drafted plane, a facet.
    Plane {
        /// Gap at the origin \[m\].
        #[serde(default)]
        height: f64,
        /// Slope along `x1`, `x2`.
        #[serde(default)]
        slope: DVec2,
    },
    /// `height + y^2 / (2 radius)`, `y` the distance from the line through `at` along `axis`.
    Cylinder {
        /// Radius \[m\], negative for a bore.
        radius: f64,
        /// Direction of the axis in the pad plane, of any length; along `x1` if not given.
        #[serde(default = "along_x1")]
        axis: DVec2,
        /// A point of the crest in the pad plane \[m\].
        #[serde(default)]
        at: DVec2,
        /// Gap at the crest \[m\].
        #[serde(default)]
        height: f64,
    },
    /// `height + r^2 / (2 radius)`, `r` the distance from `at`.
    Sphere {
        /// Radius \[m\], negative for a hollow.
        radius: f64,
        /// Where the sphere is highest \[m\].
        #[serde(default)]
        at: DVec2,
        /// Gap there \[m\].
        #[serde(default)]
        height: f64,
    },
    /// A surface of revolution about an axis along `axis` with a round meridian: `height + x^2 / (2
    /// meridian) + y^2 / (2 radius)`, `x` along the axis from `at`, `y` across it.
    Barrel {
        /// Radius about the axis \[m\].
        radius: f64,
        /// Radius of the meridian \[m\], negative for a waist.
        meridian: f64,
        /// Direction of the axis in the pad plane, of any length; along `x1` if not given.
        #[serde(default = "along_x1")]
        axis: DVec2,
        /// Where the barrel is highest \[m\].
        #[serde(default)]
        at: DVec2,
        /// Gap there \[m\].
        #[serde(default)]
        height: f64,
    },
    /// A cone, `height + slope x + y^2 / (2 radius)`, `x` along the axis from `at`, `y` across it.
    Cone {
        /// Radius at `at` \[m\].
        radius: f64,
        /// Slope along `axis`: the tangent of the half angle, negative where the cone grows wider
        /// that way.
        slope: f64,
        /// Direction of the axis in the pad plane, of any length; along `x1` if not given.
        #[serde(default = "along_x1")]
        axis: DVec2,
        /// A point of the crest in the pad plane \[m\].
        #[serde(default)]
        at: DVec2,
        /// Gap there \[m\].
        #[serde(default)]
        height: f64,
    },
}

fn along_x1() -> DVec2 {
    DVec2::X
}

impl Default for Gap {
    fn default() -> Self {
        Self::Plane { height: 0.0, slope: DVec2::ZERO }
    }
}

impl Gap {
    /// What is wrong with its numbers, if anything.
    pub fn fault(&self) -> Option<&'static str> {
        let (radii, axis, rest) = match *self {
            Self::Plane { height, slope } => ([1.0, 1.0], DVec2::X, [slope, DVec2::splat(height)]),
            Self::Cylinder { radius, axis, at, height } => {
                ([radius, 1.0], axis, [at, DVec2::splat(height)])
            }
            Self::Sphere { radius, at, height } => {
                ([radius, 1.0], DVec2::X, [at, DVec2::splat(height)])
            }
            Self::Barrel { radius, meridian, axis, at, height } => {
                ([radius, meridian], axis, [at, DVec2::splat(height)])
            }
            Self::Cone { radius, slope, axis, at, height } => {
                ([radius, 1.0], axis, [at, DVec2::new(slope, height)])
            }
        };
        if radii.iter().any(|r| !r.is_finite() || *r == 0.0) {
            Some("a radius that is zero or not finite")
        } else if axis.try_normalize().is_none() {
            Some("an axis without direction")
        } else if rest.iter().any(|x| !x.is_finite()) {
            Some("a number that is not finite")
        } else {
            None
        }
    }

    /// Radius across the axis, of a surface that has one \[m\].
    pub fn radius(&self) -> Option<f64> {
        match *self {
            Self::Plane { .. } => None,
            Self::Cylinder { radius, .. }
            | Self::Sphere { radius, .. }
            | Self::Barrel { radius, .. }
            | Self::Cone { radius, .. } => Some(radius),
        }
    }
}

/// A piece of a face: a polygon in the pad plane and the gap over it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Piece {
    /// Outer boundary \[m\].
    pub outer: Ring,
    /// Boundaries of the holes \[m\].
    #[serde(default)]
    pub holes: Vec<Ring>,
    /// The gap; none is the pad plane itself.
    #[serde(default)]
    pub gap: Gap,
}

impl Piece {
    /// Its outline.
    pub fn polygon(&self) -> Polygon {
        Polygon { outer: self.outer.clone(), holes: self.holes.clone() }
    }
}

/// What two pads touch, and how stiff they are.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Surfaces {
    /// Pieces under pad I.
    #[serde(rename = "A_I")]
    pub face_i: Vec<Piece>,
    /// Pieces under pad II.
    #[serde(rename = "A_II")]
    pub face_ii: Vec<Piece>,
    /// Pressure per compression of the pads' layers on face I and II [Pa/m]: confined modulus over
    /// thickness.
    #[serde(rename = "k")]
    pub stiffness: [f64; 2],
    /// Thickness of the layers \[m\], for notes only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layer: Option<f64>,
}

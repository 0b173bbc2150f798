//! Contacts as they are: pieces of surface under a pad, each with its gap above the pad plane.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::quadric::{Quadratic, Region};
use crate::model::{Polygon, Ring};

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
            | Self::Barrel { radius, .. } => Some(radius),
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

/// A piece made ready: in the surface's own axes.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    /// Origin of the surface's axes in the pad plane.
    pub(crate) origin: DVec2,
    /// Their first axis.
    pub(crate) axis: DVec2,
    rings: Vec<Ring>,
    /// The gap in these axes.
    pub(crate) gap: Quadratic,
}

impl Field {
    pub(crate) fn new(piece: &Piece) -> Self {
        let middle = piece.outer.iter().sum::<DVec2>() / piece.outer.len().max(1) as f64;
        let round =
            |l1: f64, l2: f64, c: f64| Quadratic { c, g: DVec2::ZERO, l: DVec2::new(l1, l2) };
        let (origin, axis, gap) = match piece.gap {
            Gap::Plane { height, slope } => (
                middle,
                DVec2::X,
                Quadratic { c: height + slope.dot(middle), g: slope, l: DVec2::ZERO },
            ),
            Gap::Cylinder { radius, axis, at, height } => {
                (at, axis, round(0.0, radius.recip(), height))
            }
            Gap::Sphere { radius, at, height } => {
                (at, DVec2::X, round(radius.recip(), radius.recip(), height))
            }
            Gap::Barrel { radius, meridian, axis, at, height } => {
                (at, axis, round(meridian.recip(), radius.recip(), height))
            }
        };
        let axis = axis.normalize();
        // Along the axis of a cylinder any origin serves: the nearest to the polygon.
        let origin = match piece.gap {
            Gap::Cylinder { .. } => origin + axis * axis.dot(middle - origin),
            _ => origin,
        };
        let mut rings = Vec::new();
        for (ring, sense) in
            std::iter::once((&piece.outer, 1.0)).chain(piece.holes.iter().map(|hole| (hole, -1.0)))
        {
            if ring.len() < 3 {
                continue;
            }
            let mut local: Ring = ring
                .iter()
                .map(|x| DVec2::new(axis.dot(*x - origin), axis.perp_dot(*x - origin)))
                .collect();
            let area: f64 = (1..local.len() - 1)
                .map(|i| (local[i] - local[0]).perp_dot(local[i + 1] - local[0]))
                .sum();
            if area * sense < 0.0 {
                local.reverse();
            }
            rings.push(local);
        }
        Self { origin, axis, rings, gap }
    }

    /// A vector of the pad plane in the surface's axes.
    pub(crate) fn inward(&self, x: DVec2) -> DVec2 {
        DVec2::new(self.axis.dot(x), self.axis.perp_dot(x))
    }

    /// A vector in the surface's axes in the pad plane.
    pub(crate) fn outward(&self, x: DVec2) -> DVec2 {
        x.x * self.axis + x.y * self.axis.perp()
    }

    /// Slope of the gap at a place of the surface's axes, in the pad plane.
    pub(crate) fn slope(&self, x: DVec2) -> DVec2 {
        self.outward(self.gap.slope(x))
    }

    /// The part of a tilt, in the pad plane, that turns the surface and not only rolls it: none
    /// across a curve.
    pub(crate) fn felt(&self, tilt: DVec2) -> DVec2 {
        let tilt = self.inward(tilt);
        let along = |l: f64, t: f64| if l == 0.0 { t } else { 0.0 };
        self.outward(DVec2::new(along(self.gap.l.x, tilt.x), along(self.gap.l.y, tilt.y)))
    }

    /// The part with compression `u = delta - gap + tilt . x > 0`. On a curve the tilt acts where
    /// the surface is highest; that the contact rolls away from there is left out.
    pub(crate) fn pressed(&self, delta: f64, tilt: DVec2) -> Region {
        let u = Quadratic {
            c: delta + tilt.dot(self.origin) - self.gap.c,
            g: self.inward(self.felt(tilt)) - self.gap.g,
            l: -self.gap.l,
        };
        Region::new(&self.rings, u)
    }

    /// Smallest gap less tilt over the polygon's corners and the axes' origin: about where contact
    /// begins.
    pub(crate) fn nearest(&self, tilt: DVec2) -> f64 {
        let felt = self.felt(tilt);
        let value =
            |x: DVec2| self.gap.value(x) - tilt.dot(self.origin) - felt.dot(self.outward(x));
        let corners = self.rings.iter().flatten().map(|x| value(*x));
        corners.fold(value(DVec2::ZERO), f64::min)
    }

    /// Area of the polygon [m^2].
    pub(crate) fn area(&self) -> f64 {
        let ring_area = |ring: &Ring| -> f64 {
            (1..ring.len() - 1)
                .map(|i| 0.5 * (ring[i] - ring[0]).perp_dot(ring[i + 1] - ring[0]))
                .sum()
        };
        self.rings.iter().map(ring_area).sum()
    }
}

//! Plane geometry: polygons with holes, their moments, clipping, convex hulls and support
//! functions; directions spread over the sphere; sets of things that belong together.
//!
//! Conventions: metres; outer rings counter-clockwise, holes clockwise once normalised; a ring's
//! last point joins its first and is not repeated. A flat list of rings (outer and holes alike,
//! each in its own sense) is enough wherever only integrals are wanted, since integrals over rings
//! add up with the sign of their sense.

pub mod clip;
pub mod hull;
pub mod overlay;
mod paraboloid;
pub mod polygon;
pub mod sphere;
mod union_find;
mod window;

pub use clip::{
    HalfPlane, clip_ring_axis, clip_ring_convex, clip_ring_half_plane, clip_ring_half_plane_into,
    clip_rings_half_plane,
};
pub(crate) use clip::{clip_convex, is_within};
pub use hull::{convex_hull, is_convex, support};
pub use overlay::{even_odd, intersect, intersect_convex, union};
pub(crate) use paraboloid::{Paraboloid, principal};
pub use polygon::{
    Bounds2, Moments, area, bounds, contains, moments, normalise, patch_area, patch_moments,
    ring_area, transform,
};
pub use union_find::UnionFind;
pub(crate) use window::within_window;

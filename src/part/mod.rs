//! A part: its mesh read, welded and checked, its mass properties and its planar faces.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::model::{Frame, Polygon};

/// A triangle mesh [m], welded, outward-oriented.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in the part frame [m].
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Mass properties of the solid at a uniform density.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MassProperties {
    /// Volume [m^3].
    pub volume: f64,
    /// Mass [kg].
    pub mass: f64,
    /// Centre of mass in the part frame [m].
    pub centre_of_mass: DVec3,
    /// Inertia about the centre of mass, part axes [kg m^2].
    pub inertia: DMat3,
}

/// One planar face of the part with its boundary.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarFace {
    /// Stable number: faces are sorted by falling area, then by position.
    pub id: u32,
    /// Unit normal pointing out of the material, part frame.
    pub normal: DVec3,
    /// `normal . x` for points of the face [m].
    pub offset: f64,
    /// Area [m^2].
    pub area: f64,
    /// Area centroid, part frame [m].
    pub centroid: DVec3,
    /// Face frame: `z` is the normal, the origin lies in the plane.
    pub part_from_face: Frame,
    /// The face in its own `(x, y)` [m]: disjoint polygons, outer rings counter-clockwise seen from outside.
    pub polygons: Vec<Polygon>,
    /// Indices of its triangles in the mesh.
    pub triangles: Vec<u32>,
}

/// Two antiparallel planar faces that can be gripped between the jaws.
#[derive(Debug, Clone, PartialEq)]
pub struct FacePair {
    /// [`PlanarFace::id`] of the face under pad I.
    pub face_i: u32,
    /// [`PlanarFace::id`] of the face under pad II.
    pub face_ii: u32,
    /// Distance of the planes [m].
    pub width: f64,
    /// Area in which the faces' projections overlap [m^2].
    pub overlap_area: f64,
}

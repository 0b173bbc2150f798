//! What both kernels read and write: plain 32-bit records and the constants that the shaders share.
//!
//! All numbers are scaled: lengths by the contact's radius of gyration, origin at its centroid,
//! forces by the gripping force, the in-plane wrench to unit length. `shaders/layout.wgsl` repeats
//! the structs; a test compares the offsets.

use bytemuck::{Pod, Zeroable};

/// Loads that share a contact and are searched together: the workgroup size of the search, and the
/// number of twists that one workgroup holds in its memory at a time.
pub const GROUP: usize = 64;

/// Workgroup size of the basis kernel: consecutive twists of one contact.
pub const BASIS_GROUP: usize = 64;

/// Vectors of four numbers per face and twist: weights `1, x1, x2`; in each the components `g1, g2,
/// torque` and their product with the twist.
pub const BASIS: usize = 3;

/// Slip centres nearer than this many circumradii from the origin use the fan's closed forms; the
/// others Gauss points. The fan loses digits with that distance; six Gauss points per direction are
/// at rounding level from 1.5 on (`fan::tests::near_and_far_forms_meet_where_both_are_good` prints
/// both).
pub const NEAR_LIMIT: f32 = 1.5;

/// An edge whose line passes the slip centre closer than this contributes nothing (its terms vanish
/// with the distance).
pub const ON_LINE: f32 = 1e-10;

/// Bounds are given only when the least pressure anywhere is at least this share of the face's mean
/// pressure ...
pub const CONTACT_MARGIN: f32 = 0.05;

/// ... and the friction coupling leaves at least this share of the tilt equations' determinant on
/// the whole way from no coupling: the found root then is the one on the branch that starts without
/// coupling.
pub const COUPLING_MARGIN: f32 = 0.25;

/// Largest share of the dissipation that the friction coupling may change where different faces get
/// bounds.
pub const COUPLED_SHARE: f32 = 0.25;

/// Least value of the integral of the faces' difference in pressure, in gripping forces: above the
/// rounding of [`ContactHeader::variation_first`].
pub const LEAST_VARIATION: f32 = 4e-3;

/// Share by which a tilt that would lift a pad is shortened beyond the point of first separation
/// (seeds only).
pub const TILT_LIMIT: f32 = 0.98;

/// The dissipation of a unit twist is not taken for less than this (it is of order one; rounding
/// can make that of a sliver negative).
pub const LEAST_DISSIPATION: f32 = 1e-6;

/// Triangles whose three supports span less than this volume give no bound.
pub const DEGENERATE: f32 = 1e-12;

/// Below this `l / (r1 + r2)` an edge's logarithm is a series: its argument would be rounded to
/// near 1.
pub const SERIES_LIMIT: f32 = 0.25;

/// [`SeedRecord::status`]: the kernel did not write this record. Anything left so after a run is an
/// error.
pub const UNWRITTEN: u32 = 0;
/// [`SeedRecord::status`]: twist, lower and upper bound.
pub const BOUNDED: u32 = 1;
/// [`SeedRecord::status`]: a twist to start from; the bounds hold only for the pressure without
/// friction coupling.
pub const UNBOUNDED: u32 = 2;
/// [`SeedRecord::status`]: different faces; twist and bounds that allow for the friction coupling.
pub const COUPLED: u32 = 3;

/// [`LoadRecord::distance`] of a load whose numbers leave the range in which bounds are computed:
/// above every distance within it.
pub const OUT_OF_RANGE: f32 = 2e6;

/// Gauss-Legendre nodes and weights on `[0, 1]`, six points: `(node, weight, 0, 0)`.
pub const GAUSS: [[f32; 4]; 6] = [
    [0.033_765_242_898_423_986, 0.085_662_246_189_585_17, 0.0, 0.0],
    [0.169_395_306_766_867_74, 0.180_380_786_524_069_3, 0.0, 0.0],
    [0.380_690_406_958_401_54, 0.233_956_967_286_345_52, 0.0, 0.0],
    [0.619_309_593_041_598_5, 0.233_956_967_286_345_52, 0.0, 0.0],
    [0.830_604_693_233_132_3, 0.180_380_786_524_069_3, 0.0, 0.0],
    [0.966_234_757_101_576, 0.085_662_246_189_585_17, 0.0, 0.0],
];

/// One contact.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct ContactHeader {
    /// First edge of face I.
    pub edges_i: u32,
    /// First edge of face II, the end of face I's.
    pub edges_ii: u32,
    /// End of face II's edges.
    pub edges_end: u32,
    /// First vector of this contact in the basis array.
    pub basis: u32,
    /// 1: the faces are congruent and only face I is integrated; 2: both are.
    pub faces: u32,
    /// Largest distance of a vertex from the origin.
    pub radius: f32,
    /// Area of face I.
    pub area_i: f32,
    /// Area of face II.
    pub area_ii: f32,
    /// Centroid of face I.
    pub centroid_i: [f32; 2],
    /// Centroid of face II.
    pub centroid_ii: [f32; 2],
    /// Inverse of the sum of both faces' second moments about their centroids: 11, 12, 22.
    pub compliance: [f32; 3],
    /// 1: f32 resolves the polygons well enough for bounds; 0: a sliver, seeds only.
    pub resolved: u32,
    /// Quadratic form of `(at_i, at_ii, slope)` above the square of the integral of the faces'
    /// difference in pressure: 11, 22, 12, 33 ...
    pub variation_first: [f32; 4],
    /// ... 13, 14, 23, 24 ...
    pub variation_second: [f32; 4],
    /// ... 34, 44.
    pub variation_slope: [f32; 2],
    /// Largest eigenvalue of `compliance`.
    pub softness: f32,
    /// Bound on the change of that integral per change of slope.
    pub spread: f32,
}

/// A directed edge from `(ax, ay)` to `(bx, by)`, material on its left.
pub type EdgeRecord = [f32; 4];

/// One load.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct LoadRecord {
    /// `(F1, F2, M3)` about the centroid, scaled to unit length.
    pub wrench: [f32; 3],
    /// Length of that vector before, over the gripping force.
    pub scale: f32,
    /// `F3` over the gripping force.
    pub f3: f32,
    /// `M1` about the centroid, over gripping force and length unit.
    pub m1: f32,
    /// `M2` likewise.
    pub m2: f32,
    /// Distance between the faces over the length unit (negative for grips from inside), or
    /// [`OUT_OF_RANGE`].
    pub distance: f32,
}

/// Up to [`GROUP`] consecutive loads on one contact.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct GroupRecord {
    /// Index of the contact.
    pub contact: u32,
    /// First load.
    pub first: u32,
    /// Number of loads.
    pub count: u32,
    /// Not used.
    pub padding: u32,
}

/// What the search found for one load.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct SeedRecord {
    /// Interpolated twist, unit length, in the sense that the load drives.
    pub twist: [f32; 3],
    /// Largest `w.v / D(v)` over the set, for the unit wrench.
    pub lower: f32,
    /// Bound from the supports of the triangles at the best twist, for the unit wrench.
    pub upper: f32,
    /// [`UNWRITTEN`], [`BOUNDED`], [`UNBOUNDED`] or [`COUPLED`].
    pub status: u32,
    /// Index of the best twist.
    pub best: u32,
    /// Not used.
    pub padding: u32,
}

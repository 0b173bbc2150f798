//! What both kernels read and write: plain 32-bit records and the constants that the shaders share.
//!
//! All numbers are scaled: lengths by the contact's radius of gyration, origin at its centroid,
//! forces by the gripping force, the in-plane wrench to unit length. `shaders/layout.wgsl` repeats
//! the structs; a test compares the offsets.

use bytemuck::{Pod, Zeroable};

/// Loads of a grip that are searched together: the workgroup size of the search, and the number of
/// twists that one workgroup holds in its memory at a time.
pub const GROUP: usize = 64;

/// Loads of a grip whose upper bounds a workgroup holds in its memory at a time (12 of the 16 KiB
/// that every implementation has): they are compared with the best lower bound of these and those
/// before.
pub const WINDOW: usize = 1024;

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

/// [`FoundRecord::kind`]: not a seed, but up to 128 loads for the processor, a bit for each.
pub const OPEN: u32 = 4;
/// [`FoundRecord::kind`], [`SeedRecord::status`]: a twist from Newton's method, and bounds that allow
/// for what single precision leaves of it.
pub const ESTIMATED: u32 = 5;
/// [`FoundRecord::kind`] is a status plus so many times the best twist.
pub const KINDS: u32 = 8;

/// [`GripRecord::wanted`]: every load comes back, not only those that can be the worst.
pub const EVERY: u32 = 1;
/// [`GripRecord::wanted`]: loads without bounds get estimates.
pub const ESTIMATES: u32 = 2;
/// [`GripRecord::wanted`] is a sum of these plus so many times the first window.
pub const MODES: u32 = 4;

/// Loads that one entry has a bit for.
pub const BITS: usize = 128;
/// Loads of a grip that Newton's method looks at together: 24 bytes of workgroup memory for each.
pub const PART: usize = 512;

/// Scaled numbers beyond this are not computed with: the load gets no bounds.
pub const RANGE: f32 = 1e6;
/// In-plane load over the gripping force below which a load is the processor's: its square is near
/// the end of the range of f32.
pub const LEAST_LOAD: f32 = 1e-15;
/// Normal force over the gripping force from which on a load is the processor's: at 2 a pad is
/// pulled off.
pub const MOST_PULL: f32 = 1.999;

/// Error of a load made in f32 from the list and the pose, over the sizes that it is made of:
/// `|w' - w| <= LOAD_ROUNDING (|F| (1 + |lever|) + |M|)`, all scaled, and the same for `f3, m1, m2`.
///
/// With `u = 2^-24`: numbers of list, pose and lever are rounded once (`u` each), three products and
/// their sum take `3 u`, the factors and a cross product `2 u` to `4 u`: `7 u` of each product for
/// the force, `10 u` for the moment of the force, `9 u` for the moment. The sums of the products'
/// sizes over three components are at most `3^(1/2)` and `6^(1/2)` times the vectors' lengths, which
/// makes `25 u`; a quotient and a root for the unit vector, which Vulkan allows `2.5` and `2` units
/// in the last place, `10 u`. That is `2.1e-6`.
pub const LOAD_ROUNDING: f32 = 2.5e-6;
/// [`super::LOAD_TOLERANCE`]: loads whose bounds would be widened by more are the processor's.
pub const LOAD_MARGIN: f32 = super::LOAD_TOLERANCE as f32;
/// Largest change of pressure by that error, over the mean: a fifth of [`CONTACT_MARGIN`] ...
pub const SWAY_CONGRUENT: f32 = 0.01;
/// ... and for different faces such that the integral of the change over both is an eighth of
/// [`LEAST_VARIATION`].
pub const SWAY_DIFFERENT: f32 = 2.5e-4;

/// Slip centres farther than this many circumradii from the origin are integrated along the edges by
/// Gauss points, nearer ones by the closed forms.
pub const FAR_LIMIT: f32 = 2.0;
/// Evaluations of the equations of a load at most, and those of the pressure without coupling.
pub const CORRECTIONS: u32 = 12;
pub const PRESSURE_STEPS: u32 = 14;
/// What the pressure without coupling may leave over, of the gripping force: it is a start.
pub const PRESSED: f32 = 1e-3;
/// A step must make what the equations leave over less by this share of its own; what is left of one
/// that does not; and what is left over that may be all rounding.
pub const FALL: f32 = 0.1;
pub const SHORTER: f32 = 0.4;
pub const QUIET: f32 = 1e-5;
/// As for the processor's comparison ([`crate::mechanics`]): ratio of two steps up to which Newton's
/// method converges for certain, and growth of the last one that bounds the way to the solution ...
pub const CONTRACTION: f32 = 0.25;
pub const WITHIN: f32 = 2.0;
/// ... which need be no shorter than this share of the dissipation.
pub const SHARP: f32 = 1e-4;
/// Share of a pad's contact that must be left at an estimate: with less there may be further limit
/// states.
pub const HARDLY: f32 = 0.1;
/// The same on the way there, and change of the pressure over the radius, in its mean on what is left, up
/// to which it is resolved.
pub const LEAST_LEFT: f32 = 0.02;
pub const STEEPEST: f32 = 40.0;
/// Rounding of an integral over what its terms are made of: some 16 roundings of `2^-24`.
pub const ROUNDING: f32 = 1e-6;
/// Estimates that may be off by more than this share are none.
pub const ESTIMATE_MARGIN: f32 = 1e-2;

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
    /// Largest change of pressure at a vertex per change of a scaled load, times the face's area.
    pub tilt: f32,
    /// The dissipation of a unit twist is at least this times the least pressure anywhere over that
    /// of the gripping force alone (congruent faces: at least this) ...
    pub slowest: f32,
    /// ... and at most this.
    pub quickest: f32,
    /// Not used.
    pub padding: u32,
}

/// A directed edge from `(ax, ay)` to `(bx, by)`, material on its left.
pub type EdgeRecord = [f32; 4];

/// A twist and its neighbours ([`super::SeedSet`]).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct TwistRecord {
    /// `(u1, u2, omega, 0)`.
    pub twist: [f32; 4],
    /// The ring.
    pub ring: [u32; 6],
    /// Not used.
    pub padding: [u32; 2],
}

/// A load as it is listed, in the frame of the list.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct CaseRecord {
    /// Force over the list's unit of force.
    pub force: [f32; 3],
    /// Its size, rounded up.
    pub force_size: f32,
    /// Moment over the list's unit of moment.
    pub moment: [f32; 3],
    /// Its size, rounded up.
    pub moment_size: f32,
}

/// A grip, or a part of its loads: what makes [`LoadRecord`]s of a list's [`CaseRecord`]s.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct GripRecord {
    /// First axis of the grip in the frame of the list.
    pub row_1: [f32; 3],
    /// The list's unit of force over the gripping force.
    pub force: f32,
    /// Second axis.
    pub row_2: [f32; 3],
    /// The list's unit of moment over gripping force and length unit.
    pub moment: f32,
    /// Third axis.
    pub row_3: [f32; 3],
    /// [`LoadRecord::distance`].
    pub distance: f32,
    /// From the contact's origin to the point that the moments are about, in the frame of the list,
    /// over the length unit.
    pub lever: [f32; 3],
    /// Its length, rounded up.
    pub arm: f32,
    /// Index of the contact.
    pub contact: u32,
    /// First load in the list.
    pub first: u32,
    /// Number of loads.
    pub count: u32,
    /// [`EVERY`], [`ESTIMATES`], and ([`MODES`]) the place of the entry that says which of its first
    /// [`BITS`] loads are open, those of the others behind it.
    pub wanted: u32,
}

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
    /// [`UNWRITTEN`], [`BOUNDED`], [`UNBOUNDED`], [`COUPLED`] or [`ESTIMATED`].
    pub status: u32,
    /// Index of the best twist.
    pub best: u32,
    /// Not used.
    pub padding: u32,
}

/// What the screen says of one grip.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct OutcomeRecord {
    /// Entries made for it, and one more; [`UNWRITTEN`] where it was not looked at.
    pub entries: u32,
    /// Some load's `mu_s` is at least this.
    pub floor: f32,
}

/// An entry that comes back: the seed of a load, or loads without bounds.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct FoundRecord {
    /// Twist and lower bound on `mu_s` as in [`SeedRecord`], but not of the unit wrench; or
    /// ([`OPEN`]) a bit for each load.
    pub words: [u32; 4],
    /// Upper bound on `mu_s`.
    pub upper: f32,
    /// Status plus [`KINDS`] times the best twist, or [`OPEN`].
    pub kind: u32,
    /// The load's place in the grip's part of the list, or that of the first bit.
    pub load: u32,
    /// Index of the grip.
    pub grip: u32,
}

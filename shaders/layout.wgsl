// Records and constants shared by the kernels. The structs repeat src/backend/layout.rs (a test compares offsets);
// every constant is set from there when the pipelines are built.

override GROUP: u32;
override BASIS_GROUP: u32;
override NEAR_LIMIT: f32;
override ON_LINE: f32;
override SERIES_LIMIT: f32;
override CONTACT_MARGIN: f32;
override COUPLING_MARGIN: f32;
override COUPLED_SHARE: f32;
override LEAST_VARIATION: f32;
override TILT_LIMIT: f32;
override LEAST_DISSIPATION: f32;
override DEGENERATE: f32;
override OUT_OF_RANGE: f32;
override BOUNDED: u32;
override UNBOUNDED: u32;
override COUPLED: u32;
override OPEN: u32;
override ESTIMATED: u32;
override KINDS: u32;
override EVERY: u32;
override ESTIMATES: u32;
override MODES: u32;
override F32_TOLERANCE: f32;
override RANGE: f32;
override LEAST_LOAD: f32;
override MOST_PULL: f32;
override LOAD_ROUNDING: f32;
override LOAD_MARGIN: f32;
override SWAY_CONGRUENT: f32;
override SWAY_DIFFERENT: f32;
override FAR_LIMIT: f32;
override CORRECTIONS: u32;
override PRESSURE_STEPS: u32;
override PRESSED: f32;
override FALL: f32;
override SHORTER: f32;
override QUIET: f32;
override CONTRACTION: f32;
override WITHIN: f32;
override SHARP: f32;
override HARDLY: f32;
override LEAST_LEFT: f32;
override STEEPEST: f32;
override ROUNDING: f32;
override ESTIMATE_MARGIN: f32;
// Dispatches are two-dimensional: a workgroup's number is x + GRID y.
override GRID: u32;

const BASIS = 3u;
const RING = 6u;
const GAUSS_POINTS = 6u;
const NEGATED = 0x80000000u;
// Loads of a grip that are compared at a time, and the words that hold a bit of each.
const WINDOW = 1024u;
const WORDS = 32u;
// The same for Newton's method, and the loads that one entry has a bit for.
const PART = 512u;
const PART_WORDS = 16u;
const BITS = 128u;
const LARGEST = 3.4028234e38;
const INFINITE = 0x7f800000u;

struct ContactHeader {
    edges_i: u32,
    edges_ii: u32,
    edges_end: u32,
    basis: u32,
    faces: u32,
    radius: f32,
    area_i: f32,
    area_ii: f32,
    centroid_i: vec2<f32>,
    centroid_ii: vec2<f32>,
    compliance: vec3<f32>,
    resolved: u32,
    variation_first: vec4<f32>,
    variation_second: vec4<f32>,
    variation_slope: vec2<f32>,
    softness: f32,
    spread: f32,
    tilt: f32,
    slowest: f32,
    quickest: f32,
    padding: u32,
}

struct TwistRecord {
    twist: vec4<f32>,
    ring: array<u32, RING>,
    padding: array<u32, 2>,
}

struct CaseRecord {
    force: vec3<f32>,
    force_size: f32,
    moment: vec3<f32>,
    moment_size: f32,
}

struct GripRecord {
    row_1: vec3<f32>,
    force: f32,
    row_2: vec3<f32>,
    moment: f32,
    row_3: vec3<f32>,
    distance: f32,
    lever: vec3<f32>,
    arm: f32,
    contact: u32,
    first: u32,
    count: u32,
    wanted: u32,
}

struct LoadRecord {
    wrench: vec3<f32>,
    scale: f32,
    f3: f32,
    m1: f32,
    m2: f32,
    distance: f32,
}

struct SeedRecord {
    twist: vec3<f32>,
    lower: f32,
    upper: f32,
    status: u32,
    best: u32,
    padding: u32,
}

struct OutcomeRecord {
    entries: u32,
    floor: f32,
}

struct FoundRecord {
    words: vec4<u32>,
    upper: f32,
    kind: u32,
    load: u32,
    grip: u32,
}

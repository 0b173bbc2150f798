//! Planar faces by region growing.
//!
//! A region starts at the largest triangle left and takes in neighbours whose corners lie within a distance of the
//! region's plane and whose normals agree within an angle; both tests are needed. The distance is scaled to the part.
//! The angle is widened for a narrow triangle by what the uncertainty of its corners can tilt it: refining a plane in
//! 32-bit floats leaves slivers whose normals point anywhere. The plane is refitted each time the region has doubled.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::Matrix3;
use rustc_hash::FxHashMap;

use super::orient::Role;
use super::repair::Repaired;
use super::topology::NONE;
use super::{Mesh, PlanarFace, boundary};
use crate::geometry::polygon::{Moments, patch_moments};
use crate::model::Frame;

/// Distance of a corner from its face's plane, as a share of the part's diagonal: 1 um on 100 mm.
const DISTANCE: f64 = 1e-5;
/// Angle between a wide triangle and its face: 0.2 degrees.
const ANGLE: f64 = 0.2 * std::f64::consts::PI / 180.0;
/// Uncertainty of a corner as a share of the diagonal, besides that of 32-bit floats; it widens [`ANGLE`] only.
const JITTER: f64 = 1e-6;
/// Width (twice area over half perimeter) below which a face is no place for a pad, as a share of the diagonal.
const NARROWEST: f64 = 5e-4;
/// Dihedral angle up to which two regions may be neighbouring facets of one curved surface: 25 degrees.
const SMOOTH: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// Side of a square, as a share of the diagonal, below whose area a region with one such neighbour is taken for a facet.
const SMALL: f64 = 0.02;
/// How much larger than a neighbour a facet of a curved surface may be.
const FACET_RATIO: f64 = 4.0;

#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: DVec3,
    offset: f64,
    /// How far the normal may be tilted by the uncertainty of the corners it was made of [rad].
    tilt: f64,
}

impl Plane {
    fn distance(&self, point: DVec3) -> f64 {
        (self.normal.dot(point) - self.offset).abs()
    }
}

/// Area-weighted sums over triangles: area, normal, first and second moments about a reference near the region.
#[derive(Debug, Clone, Copy)]
struct Sums {
    reference: DVec3,
    area: f64,
    vector: DVec3,
    first: DVec3,
    second: DMat3,
}

impl Sums {
    fn new(reference: DVec3) -> Self {
        Self { reference, area: 0.0, vector: DVec3::ZERO, first: DVec3::ZERO, second: DMat3::ZERO }
    }

    fn add(&mut self, corners: [DVec3; 3], twice_normal: DVec3) {
        let area = twice_normal.length() / 2.0;
        self.area += area;
        self.vector += twice_normal / 2.0;
        let [a, b, c] = corners.map(|corner| corner - self.reference);
        let sum = a + b + c;
        self.first += area / 3.0 * sum;
        // int x x^T over a triangle = A/12 (aa^T + bb^T + cc^T + ss^T), s the sum of the corners.
        let weight = area / 12.0;
        for v in [a, b, c, sum] {
            self.second += DMat3::from_cols(v * v.x, v * v.y, v * v.z) * weight;
        }
    }

    fn centre(&self) -> DVec3 {
        if self.area > 0.0 { self.reference + self.first / self.area } else { self.reference }
    }

    /// Least-squares plane, and how far `uncertainty` of the corners tilts it.
    fn fit(&self, uncertainty: f64) -> Option<Plane> {
        let outward = self.vector.try_normalize()?;
        let mean = self.first / self.area;
        let covariance = self.second * (1.0 / self.area) - DMat3::from_cols(mean * mean.x, mean * mean.y, mean * mean.z);
        let eigen = Matrix3::from_column_slice(&covariance.to_cols_array()).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let axis = eigen.eigenvectors.column(order[0]);
        let fitted = DVec3::new(axis[0], axis[1], axis[2]).normalize();
        let fitted = if fitted.dot(outward) < 0.0 { -fitted } else { fitted };
        // For a needle the third axis is as thin as the second: there the sum of the triangles' normals is better.
        let normal = if fitted.dot(outward) > 0.99 { fitted } else { outward };
        // A rectangle of width w has variance w^2/12 across.
        let width = (12.0 * eigen.eigenvalues[order[1]].max(0.0)).sqrt();
        Some(Plane { normal, offset: normal.dot(self.centre()), tilt: 2.0 * uncertainty / width.max(uncertainty) })
    }
}

/// A grown region: a range of the list of triangles.
struct Region {
    begin: usize,
    end: usize,
    plane: Plane,
    area: f64,
    centre: DVec3,
}

/// All planar faces of the part by falling area, facets of curved surfaces left out.
///
/// A region counts as a facet of a curved surface when along a quarter of its boundary or more it meets at least two
/// neighbours under less than 25 degrees, neither of them 4 times smaller: so do the strips of a tessellated cylinder,
/// cone or fillet. For a region smaller than a square of 2 % of the part's diagonal one such neighbour is enough. The
/// flat between two fillets is far larger than their strips and stays; nut flats and chamfers meet their neighbours under
/// larger angles and stay. Where a mesh leaves it open (the outermost strip of a gear's flank) the region stays: a flat
/// too many costs a few candidates, a flat too few loses grips. Regions narrower than 5e-4 of the part's diagonal are dropped.
pub(super) fn planar_faces(part: &Repaired) -> Vec<PlanarFace> {
    let (regions, order, region_of) = grow(part);
    let facets = Facets::new(part, &regions, &order, &region_of);
    let small = (SMALL * part.diagonal).powi(2);
    let tolerance = simplify_tolerance(part);
    let mut faces: Vec<PlanarFace> = Vec::new();
    for (index, region) in regions.iter().enumerate() {
        if facets.is_facet(&regions, index, small) || 4.0 * region.area < NARROWEST * part.diagonal * facets.perimeter[index] {
            continue;
        }
        let triangles = &order[region.begin..region.end];
        let mut frame = face_frame(region.plane.normal, region.centre);
        let rings = |frame: &Frame| boundary::polygons(&part.mesh, &part.edges.twin, triangles, |t| region_of[t as usize] == index as u32, frame, tolerance);
        let mut polygons = rings(&frame);
        let Moments { area, centroid, .. } = patch_moments(&polygons);
        if area <= 0.0 {
            continue;
        }
        frame.origin = frame.point(centroid.extend(0.0));
        let shift = |point: &mut DVec2| *point -= centroid;
        for polygon in &mut polygons {
            polygon.outer.iter_mut().for_each(shift);
            polygon.holes.iter_mut().flatten().for_each(shift);
        }
        let mut triangles = triangles.to_vec();
        triangles.sort_unstable();
        let shell = part.shell_of[triangles[0] as usize];
        faces.push(PlanarFace {
            id: 0,
            normal: region.plane.normal,
            offset: region.plane.normal.dot(frame.origin),
            area,
            centroid: frame.origin,
            part_from_face: frame,
            polygons,
            triangles,
            shell,
            reachable: part.shells[shell as usize].role == Role::Body,
        });
    }
    // Areas that agree to 1e-6 count as equal, so that rounding does not decide the order of a part's equal faces.
    let key = |face: &PlanarFace| (face.area.log2() * 1e5).round() as i64;
    let step = (part.diagonal * 1e-6).max(f64::MIN_POSITIVE);
    let place = |face: &PlanarFace| [face.centroid.x, face.centroid.y, face.centroid.z].map(|x| (x / step).round() as i64);
    faces.sort_by_cached_key(|face| (std::cmp::Reverse(key(face)), place(face)));
    for (face, id) in faces.iter_mut().zip(0..) {
        face.id = id;
    }
    faces
}

/// Collinear points are left out within this distance: the rounding of the coordinates, but never what a pad could feel.
fn simplify_tolerance(part: &Repaired) -> f64 {
    (4.0 * part.noise).max(1e-8 * part.diagonal)
}

/// Frame of a face: `z` is the normal, `x` the part axis most nearly in the plane (the first of equals) projected into it.
fn face_frame(normal: DVec3, origin: DVec3) -> Frame {
    let flat = normal.abs();
    // A margin lets rounding not choose between axes that lie equally in the plane.
    let axis = if flat.x <= flat.y.min(flat.z) + 1e-6 {
        DVec3::X
    } else if flat.y <= flat.z + 1e-6 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let x = (axis - normal * normal.dot(axis)).normalize();
    Frame { rotation: DMat3::from_cols(x, normal.cross(x), normal), origin }
}

fn twice_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Partitions the triangles into planar regions. Returns them, the triangles in order of regions, and each triangle's region.
fn grow(part: &Repaired) -> (Vec<Region>, Vec<u32>, Vec<u32>) {
    let mesh = &part.mesh;
    let count = mesh.triangles.len();
    let distance = (DISTANCE * part.diagonal).max(4.0 * part.noise);
    let uncertainty = part.noise.max(JITTER * part.diagonal);
    let mut order = Vec::with_capacity(count);
    let mut region_of = vec![NONE; count];
    let mut regions = Vec::new();
    let mut refused = Vec::new();
    for seed in seeds(mesh) {
        if region_of[seed as usize] != NONE {
            continue;
        }
        let number = regions.len() as u32;
        let begin = order.len();
        let corners = mesh.corners(seed);
        let cross = twice_normal(corners);
        let mut sums = Sums::new(corners[0]);
        sums.add(corners, cross);
        region_of[seed as usize] = number;
        order.push(seed);
        let Some(mut plane) = sums.fit(uncertainty) else {
            // Not even a direction: alone, without area.
            let plane = Plane { normal: DVec3::Z, offset: corners[0].z, tilt: 0.0 };
            regions.push(Region { begin, end: order.len(), plane, area: 0.0, centre: corners[0] });
            continue;
        };
        plane.normal = cross.normalize();
        plane.offset = plane.normal.dot(corners[0]);
        let mut refit_at = 2;
        let mut next = begin;
        refused.clear();
        loop {
            while next < order.len() {
                let triangle = order[next];
                next += 1;
                for half in triangle * 3..triangle * 3 + 3 {
                    let twin = part.edges.twin[half as usize];
                    if twin == NONE || region_of[(twin / 3) as usize] != NONE {
                        continue;
                    }
                    let other = twin / 3;
                    if take(mesh, other, &plane, distance, uncertainty, &mut sums) {
                        region_of[other as usize] = number;
                        order.push(other);
                    } else {
                        refused.push(other);
                    }
                }
                if order.len() - begin >= refit_at {
                    refit_at *= 2;
                    plane = sums.fit(uncertainty).unwrap_or(plane);
                }
            }
            // With the final plane the triangles refused by an earlier, poorer one get another chance.
            plane = sums.fit(uncertainty).unwrap_or(plane);
            let before = order.len();
            refused.retain(|&other| {
                if region_of[other as usize] != NONE {
                    return false;
                }
                let taken = take(mesh, other, &plane, distance, uncertainty, &mut sums);
                if taken {
                    region_of[other as usize] = number;
                    order.push(other);
                }
                !taken
            });
            if order.len() == before {
                break;
            }
        }
        regions.push(Region { begin, end: order.len(), plane, area: sums.area, centre: sums.centre() });
    }
    (regions, order, region_of)
}

/// Adds a triangle to the sums if it lies in the plane.
fn take(mesh: &Mesh, triangle: u32, plane: &Plane, distance: f64, uncertainty: f64, sums: &mut Sums) -> bool {
    let corners = mesh.corners(triangle);
    if corners.iter().any(|&corner| plane.distance(corner) > distance) {
        return false;
    }
    let cross = twice_normal(corners);
    let [a, b, c] = corners;
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared()).sqrt();
    let twice_area = cross.length();
    // Altitude over the longest edge: corners off by u tilt the triangle by up to 2 u / altitude.
    let allowed = ANGLE + plane.tilt + 2.0 * uncertainty * longest / twice_area.max(f64::MIN_POSITIVE);
    // A sliver narrower than the uncertainty has no direction: the distance alone decides.
    if allowed < 1.0 && cross.dot(plane.normal) < allowed.cos() * twice_area {
        return false;
    }
    sums.add(corners, cross);
    true
}

/// Triangles by falling area, in steps of a factor of two: a counting sort by the exponent, file order within a step.
fn seeds(mesh: &Mesh) -> Vec<u32> {
    let exponents: Vec<u16> = (0..mesh.triangles.len() as u32)
        .map(|triangle| {
            let squared = twice_normal(mesh.corners(triangle)).length_squared();
            // Exponent of the squared area; half of it is that of the area.
            (0x7ff - ((squared.to_bits() >> 52) as u16 & 0x7ff)) / 2
        })
        .collect();
    let mut starts = vec![0_u32; 0x402];
    for &exponent in &exponents {
        starts[exponent as usize + 1] += 1;
    }
    for index in 1..starts.len() {
        starts[index] += starts[index - 1];
    }
    let mut seeds = vec![0; exponents.len()];
    for (triangle, &exponent) in exponents.iter().enumerate() {
        let slot = &mut starts[exponent as usize];
        seeds[*slot as usize] = triangle as u32;
        *slot += 1;
    }
    seeds
}

/// Lengths of the boundaries between regions, to tell flats from facets of curved surfaces.
struct Facets {
    perimeter: Vec<f64>,
    /// Per region its neighbours and the length shared with each.
    shared: Vec<FxHashMap<u32, f64>>,
}

impl Facets {
    fn new(part: &Repaired, regions: &[Region], order: &[u32], region_of: &[u32]) -> Self {
        let mut perimeter = vec![0.0; regions.len()];
        let mut shared = vec![FxHashMap::default(); regions.len()];
        for (index, region) in regions.iter().enumerate() {
            for &triangle in &order[region.begin..region.end] {
                for k in 0..3 {
                    let half = triangle * 3 + k;
                    let twin = part.edges.twin[half as usize];
                    let other = if twin == NONE { NONE } else { region_of[(twin / 3) as usize] };
                    if other == index as u32 {
                        continue;
                    }
                    let corners = part.mesh.corners(triangle);
                    let length = corners[k as usize].distance(corners[(k as usize + 1) % 3]);
                    perimeter[index] += length;
                    if other != NONE {
                        *shared[index].entry(other).or_insert(0.0) += length;
                    }
                }
            }
        }
        Self { perimeter, shared }
    }

    /// Whether a region is a facet of a curved surface, see [`planar_faces`]. `small` is the area [m^2] below which one
    /// comparable neighbour is enough.
    fn is_facet(&self, regions: &[Region], index: usize, small: f64) -> bool {
        let region = &regions[index];
        let (mut count, mut smooth, mut comparable) = (0, 0.0, 0.0);
        for (&neighbour, &shared) in &self.shared[index] {
            let other = &regions[neighbour as usize];
            if region.plane.normal.angle_between(other.plane.normal) <= SMOOTH {
                smooth += shared;
                if region.area <= FACET_RATIO * other.area {
                    count += 1;
                    comparable += shared;
                }
            }
        }
        let long = 0.25 * self.perimeter[index];
        (count >= 2 && comparable >= long) || (count >= 1 && smooth >= long && region.area < small)
    }
}

//! Planar regions by growing.
//!
//! A region starts at the largest flat patch left and takes in neighbours whose corners lie within a
//! distance of the region's plane and whose normals agree within an angle; both tests are needed.
//! The distance is scaled to the part. The angle is widened for a narrow triangle by what the
//! uncertainty of its corners can tilt it: refining a plane in 32-bit floats leaves slivers whose
//! normals point anywhere. The plane is refitted each time the region's area has doubled, between
//! rings of neighbours.

use glam::DVec3;
use nalgebra::Matrix3;

use super::Mesh;
use super::given::{GivenFaces, Stated};
use super::patches::{Patches, area_step};
use super::repair::Repaired;
use super::topology::NONE;

/// Angle between a wide triangle and its face: 0.2 degrees.
const ANGLE: f64 = 0.2 * std::f64::consts::PI / 180.0;

/// Share of a facet's area in one flat piece from which on the rest of it are crumbs of others, and its
/// length over its width.
const MOSTLY: f64 = 0.8;
const LONG: f64 = 6.0;

/// Growth of a region's area after which its plane is fitted again: two, less rounding.
const REFIT: f64 = 2.0 - 1e-6;

/// How exactly a triangle must lie in a region's plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Flatness {
    /// Distance of a corner from the plane \[m\].
    pub distance: f64,
    /// Uncertainty of a corner \[m\]; it widens the angle allowed to narrow triangles.
    pub uncertainty: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub normal: DVec3,
    pub offset: f64,
    /// How far the normal may be tilted by the uncertainty of the corners it was made of \[rad\].
    tilt: f64,
}

impl Plane {
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        (self.normal.dot(point) - self.offset).abs()
    }
}

/// Area-weighted sums over triangles: area, normal, first and second moments about a reference near
/// the region.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    reference: DVec3,
    area: f64,
    pub vector: DVec3,
    first: DVec3,
    /// Second moments xx, yy, zz and yz, zx, xy.
    squares: DVec3,
    products: DVec3,
}

fn cyclic(v: DVec3) -> DVec3 {
    DVec3::new(v.y * v.z, v.z * v.x, v.x * v.y)
}

impl Sums {
    fn new(reference: DVec3) -> Self {
        Self {
            reference,
            area: 0.0,
            vector: DVec3::ZERO,
            first: DVec3::ZERO,
            squares: DVec3::ZERO,
            products: DVec3::ZERO,
        }
    }

    fn add(&mut self, corners: [DVec3; 3], twice_normal: DVec3, area: f64) {
        self.area += area;
        self.vector += twice_normal / 2.0;
        let [a, b, c] = corners.map(|corner| corner - self.reference);
        let sum = a + b + c;
        self.first += area / 3.0 * sum;
        // int x x^T over a triangle = A/12 (aa^T + bb^T + cc^T + ss^T), s the sum of the corners.
        let weight = area / 12.0;
        self.squares += weight * (a * a + b * b + c * c + sum * sum);
        self.products += weight * (cyclic(a) + cyclic(b) + cyclic(c) + cyclic(sum));
    }

    pub(super) fn add_all(&mut self, mesh: &Mesh, triangles: &[u32]) {
        for &triangle in triangles {
            let corners = mesh.corners(triangle);
            let cross = twice_normal(corners);
            self.add(corners, cross, cross.length() / 2.0);
        }
    }

    /// Of triangles, about a corner of the first.
    pub(super) fn of(mesh: &Mesh, triangles: &[u32]) -> Self {
        let mut sums = Self::new(mesh.corners(triangles[0])[0]);
        sums.add_all(mesh, triangles);
        sums
    }

    /// Adds the sums over others, about another reference.
    pub(super) fn join(&mut self, other: &Self) {
        let d = other.reference - self.reference;
        self.area += other.area;
        self.vector += other.vector;
        self.first += other.first + other.area * d;
        self.squares += other.squares + 2.0 * d * other.first + other.area * d * d;
        let mixed = DVec3::new(
            d.y * other.first.z + d.z * other.first.y,
            d.z * other.first.x + d.x * other.first.z,
            d.x * other.first.y + d.y * other.first.x,
        );
        self.products += other.products + mixed + other.area * cyclic(d);
    }

    fn centre(&self) -> DVec3 {
        if self.area > 0.0 { self.reference + self.first / self.area } else { self.reference }
    }

    /// Least-squares plane, and how far `uncertainty` of the corners tilts it.
    fn fit(&self, uncertainty: f64) -> Option<Plane> {
        let outward = self.vector.try_normalize()?;
        let mean = self.first / self.area;
        let squares = self.squares / self.area - mean * mean;
        let products = self.products / self.area - cyclic(mean);
        let covariance = Matrix3::new(
            squares.x, products.z, products.y, products.z, squares.y, products.x, products.y,
            products.x, squares.z,
        );
        let eigen = covariance.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let axis = eigen.eigenvectors.column(order[0]);
        let fitted = DVec3::new(axis[0], axis[1], axis[2]).normalize();
        let fitted = if fitted.dot(outward) < 0.0 { -fitted } else { fitted };
        // For a needle the third axis is as thin as the second: there the sum of the triangles'
        // normals is better.
        let normal = if fitted.dot(outward) > 0.99 { fitted } else { outward };
        // A rectangle of width w has variance w^2/12 across.
        let width = (12.0 * eigen.eigenvalues[order[1]].max(0.0)).sqrt();
        Some(Plane {
            normal,
            offset: normal.dot(self.centre()),
            tilt: 2.0 * uncertainty / width.max(uncertainty),
        })
    }
}

/// A grown region: a range of the list of triangles.
pub(super) struct Region {
    begin: usize,
    end: usize,
    pub plane: Plane,
    pub area: f64,
    pub centre: DVec3,
}

/// A partition of the triangles.
pub(super) struct Regions {
    pub all: Vec<Region>,
    /// Triangles in order of regions.
    pub order: Vec<u32>,
    /// Region of each triangle.
    pub of: Vec<u32>,
}

impl Regions {
    /// Triangles of region `index`.
    pub(super) fn triangles(&self, index: usize) -> &[u32] {
        &self.order[self.all[index].begin..self.all[index].end]
    }
}

#[inline]
pub(super) fn twice_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Partitions the triangles into planar regions. A plane that the file states is a region as it is;
/// others end where faces do that the file states.
pub(super) fn grow(part: &Repaired, given: &GivenFaces, flatness: Flatness) -> Regions {
    let patches = Patches::new(part, given, flatness);
    let seeds = patches.seeds(part);
    let starts = seeds.iter().map(|&seed| patches.triangles(seed));
    grow_from(part, given, flatness, &patches, |triangle| given.of(triangle), starts)
}

/// Parts the facets that have taken in a little of what lies beside them, such as strips of a cylinder
/// the first row of the ball that it ends in: nearly all of one is more exactly flat, within `distance`
/// \[m\], than the whole. `None` where there is no such facet.
pub(super) fn without_crumbs(
    part: &Repaired,
    given: &GivenFaces,
    regions: &Regions,
    is_facet: &[bool],
    distance: f64,
) -> Option<Regions> {
    let mesh = &part.mesh;
    let twice = |triangle: u32| twice_normal(mesh.corners(triangle)).length();
    let is_long = |index: usize| {
        let triangles = regions.triangles(index).iter();
        let largest = triangles.max_by(|a, b| twice(**a).total_cmp(&twice(**b)));
        largest.is_some_and(|&t| longest(mesh.corners(t)).powi(2) > LONG * twice(t))
    };
    let is_off = |index: usize| {
        let plane = &regions.all[index].plane;
        let corners = regions.triangles(index).iter().flat_map(|&t| mesh.corners(t));
        corners.into_iter().any(|corner| plane.distance(corner) > distance)
    };
    let tried: Vec<bool> =
        (0..regions.all.len()).map(|i| is_facet[i] && is_long(i) && is_off(i)).collect();
    if !tried.contains(&true) {
        return None;
    }
    let flatness = Flatness { distance, uncertainty: part.noise };
    let patches = Patches::new(part, given, flatness);
    let parted = |is_parted: &[bool]| {
        let mut starts: Vec<&[u32]> = Vec::with_capacity(regions.all.len());
        for (index, is_parted) in is_parted.iter().enumerate() {
            let triangles = regions.triangles(index);
            if *is_parted {
                let mut order = triangles.to_vec();
                order.sort_by(|a, b| twice(*b).total_cmp(&twice(*a)).then(a.cmp(b)));
                starts.extend(order.iter().map(|&t| patches.triangles(patches.of(t))));
            } else if !given.face(triangles[0]).is_some_and(|face| face.is_plane()) {
                starts.push(triangles);
            }
        }
        let of = |triangle: u32| regions.of[triangle as usize];
        grow_from(part, given, flatness, &patches, of, starts.into_iter())
    };
    let all = parted(&tried);
    let mut largest = vec![0.0_f64; regions.all.len()];
    for (index, piece) in all.all.iter().enumerate() {
        let whole = &mut largest[regions.of[all.triangles(index)[0] as usize] as usize];
        *whole = whole.max(piece.area);
    }
    let is_mostly = |index: usize| largest[index] > MOSTLY * regions.all[index].area;
    let kept: Vec<bool> = tried.iter().enumerate().map(|(i, t)| *t && is_mostly(i)).collect();
    match kept.contains(&true) {
        true if kept == tried => Some(all),
        true => Some(parted(&kept)),
        false => None,
    }
}

/// Grows regions once more, from the largest to the smallest: with its plane known, a large one takes
/// in the small ones that noise left beside it.
pub(super) fn grow_again(
    part: &Repaired,
    given: &GivenFaces,
    flatness: Flatness,
    first: &Regions,
) -> Regions {
    let mut order: Vec<usize> = (0..first.all.len()).collect();
    order.sort_by(|&a, &b| first.all[b].area.total_cmp(&first.all[a].area).then(a.cmp(&b)));
    let patches = Patches::new(part, given, flatness);
    let starts = order.into_iter().map(|index| first.triangles(index));
    grow_from(part, given, flatness, &patches, |triangle| given.of(triangle), starts)
}

/// Grows regions from groups of triangles, as far as those belong to no region yet and `own` is the same.
fn grow_from<'a>(
    part: &Repaired,
    given: &GivenFaces,
    flatness: Flatness,
    patches: &Patches,
    own: impl Fn(u32) -> u32,
    starts: impl Iterator<Item = &'a [u32]>,
) -> Regions {
    let mesh = &part.mesh;
    let count = mesh.triangles.len();
    let uncertainty = flatness.uncertainty;
    let mut order = Vec::with_capacity(count);
    let mut region_of = vec![NONE; count];
    let mut regions = Vec::new();
    let mut refused = Vec::new();
    for face in &given.all {
        let Stated::Plane { origin, normal } = face.surface else { continue };
        let mut sums = Sums::new(origin);
        sums.add_all(mesh, &face.triangles);
        let begin = order.len();
        order.extend(&face.triangles);
        let number = regions.len() as u32;
        face.triangles.iter().for_each(|&triangle| region_of[triangle as usize] = number);
        let plane = Plane { normal, offset: normal.dot(origin), tilt: 0.0 };
        let centre = sums.centre();
        let centre = centre - normal * normal.dot(centre - origin);
        regions.push(Region { begin, end: order.len(), plane, area: sums.area, centre });
    }
    for start in starts {
        let number = regions.len() as u32;
        let begin = order.len();
        order.extend(start.iter().copied().filter(|&t| region_of[t as usize] == NONE));
        let Some(&seed) = order.get(begin) else { continue };
        let within = own(seed);
        let corners = mesh.corners(seed);
        let mut sums = Sums::new(corners[0]);
        if std::ptr::eq(start, patches.triangles(patches.of(seed))) {
            patches.add_to(&mut sums, mesh, patches.of(seed));
        } else {
            sums.add_all(mesh, &order[begin..]);
        }
        order[begin..].iter().for_each(|&triangle| region_of[triangle as usize] = number);
        let Some(mut plane) = sums.fit(uncertainty) else {
            // Not even a direction: alone, without area.
            let plane = Plane { normal: DVec3::Z, offset: corners[0].z, tilt: 0.0 };
            regions.push(Region { begin, end: order.len(), plane, area: 0.0, centre: corners[0] });
            continue;
        };
        if order.len() == begin + 1 {
            plane.normal = twice_normal(corners).normalize();
            plane.offset = plane.normal.dot(corners[0]);
        }
        let mut refit_at = REFIT * sums.area;
        let mut next = begin;
        refused.clear();
        loop {
            while next < order.len() {
                // One ring of neighbours with one plane: their order does not matter.
                let ring = next..order.len();
                next = ring.end;
                for index in ring {
                    let triangle = order[index];
                    for half in triangle * 3..triangle * 3 + 3 {
                        let twin = part.edges.twin[half as usize];
                        if twin == NONE || region_of[(twin / 3) as usize] != NONE {
                            continue;
                        }
                        let other = twin / 3;
                        if own(other) != within {
                            continue;
                        }
                        let patch = patches.of(other);
                        let piece = patches.triangles(patch);
                        if lie_in(mesh, piece, &plane, flatness) {
                            patches.add_to(&mut sums, mesh, patch);
                            piece.iter().for_each(|&other| region_of[other as usize] = number);
                            order.extend(piece);
                        } else {
                            refused.push(other);
                        }
                    }
                }
                if sums.area >= refit_at {
                    refit_at = REFIT * sums.area;
                    plane = sums.fit(uncertainty).unwrap_or(plane);
                }
            }
            // With the final plane the triangles refused by an earlier, poorer one get another
            // chance.
            plane = sums.fit(uncertainty).unwrap_or(plane);
            let before = order.len();
            refused.retain(|&other| {
                if region_of[other as usize] != NONE {
                    return false;
                }
                let patch = patches.of(other);
                let piece = patches.triangles(patch);
                let taken = lie_in(mesh, piece, &plane, flatness);
                if taken {
                    patches.add_to(&mut sums, mesh, patch);
                    piece.iter().for_each(|&other| region_of[other as usize] = number);
                    order.extend(piece);
                }
                !taken
            });
            if order.len() == before {
                break;
            }
        }
        regions.push(Region {
            begin,
            end: order.len(),
            plane,
            area: sums.area,
            centre: sums.centre(),
        });
    }
    Regions { all: regions, order, of: region_of }
}

/// The triangles of a region in the order in which they are met going outwards from the first of the
/// largest, their plane and the middle of their area. They are those with the `number` in `of`.
pub(super) fn gathered(
    part: &Repaired,
    triangles: &[u32],
    number: u32,
    of: &mut [u32],
) -> Option<(Vec<u32>, Plane, DVec3)> {
    let step = |triangle: u32| area_step(twice_normal(part.mesh.corners(triangle)));
    let first = triangles.iter().copied().min_by_key(|&triangle| (step(triangle), triangle))?;
    let mut order = Vec::with_capacity(triangles.len());
    let mut is_met = |triangle: u32| {
        let of = &mut of[triangle as usize];
        *of != number || std::mem::replace(of, NONE) == NONE
    };
    let mut sums = Sums::new(part.mesh.corners(first)[0]);
    // One that hangs together has no other starts.
    for &start in std::iter::once(&first).chain(triangles) {
        if is_met(start) {
            continue;
        }
        let mut next = order.len();
        order.push(start);
        while next < order.len() {
            let triangle: u32 = order[next];
            next += 1;
            let corners = part.mesh.corners(triangle);
            let cross = twice_normal(corners);
            sums.add(corners, cross, cross.length() / 2.0);
            for half in triangle * 3..triangle * 3 + 3 {
                let twin = part.edges.twin[half as usize];
                if twin != NONE && !is_met(twin / 3) {
                    order.push(twin / 3);
                }
            }
        }
    }
    order.iter().for_each(|&triangle| of[triangle as usize] = number);
    Some((order, sums.fit(part.noise)?, sums.centre()))
}

/// The middle of the area of triangles in a plane through `origin` that is known.
pub(super) fn middle(mesh: &Mesh, triangles: &[u32], origin: DVec3, normal: DVec3) -> DVec3 {
    let mut sums = Sums::new(origin);
    sums.add_all(mesh, triangles);
    let centre = sums.centre();
    centre - normal * normal.dot(centre - origin)
}

/// Whether triangles that add up to `sums` lie in one plane.
pub(super) fn is_flat(part: &Repaired, triangles: &[u32], sums: &Sums, flatness: Flatness) -> bool {
    let plane = sums.fit(flatness.uncertainty);
    plane.is_some_and(|plane| lie_in(&part.mesh, triangles, &plane, flatness))
}

/// Length of the longest edge.
fn longest([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared()).sqrt()
}

fn lie_in(mesh: &Mesh, triangles: &[u32], plane: &Plane, flatness: Flatness) -> bool {
    triangles.iter().all(|&triangle| lies_in(mesh.corners(triangle), plane, flatness))
}

/// Whether a triangle lies in the plane.
fn lies_in(corners: [DVec3; 3], plane: &Plane, flatness: Flatness) -> bool {
    let Flatness { distance, uncertainty } = flatness;
    if corners.iter().any(|&corner| plane.distance(corner) > distance) {
        return false;
    }
    let cross = twice_normal(corners);
    let longest = longest(corners);
    let twice_area = cross.length();
    // Altitude over the longest edge: corners off by u tilt the triangle by up to 2 u / altitude.
    let allowed =
        ANGLE + plane.tilt + 2.0 * uncertainty * longest / twice_area.max(f64::MIN_POSITIVE);
    // A sliver narrower than the uncertainty has no direction: the distance alone decides.
    // 1 - x^2/2 is below the cosine by less than x^4/24: nothing at the angles in question.
    allowed >= 1.0 || cross.dot(plane.normal) >= (1.0 - allowed * allowed / 2.0) * twice_area
}

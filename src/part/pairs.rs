//! Antiparallel face pairs.

use glam::{DVec2, DVec3};
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use rustc_hash::FxHashMap;

use super::{FacePair, Mesh, PairKind, PlanarFace};
use crate::geometry::polygon::{self, Moments, patch_moments, rings_moments};
use crate::geometry::{clip_ring_convex, intersect, is_convex};
use crate::model::{Polygon, Ring};

/// Angle between one face and the reverse of the other up to which they count as antiparallel: 0.5
/// degrees, what the rubber of a pad takes up (0.2 mm over 20 mm).
pub(crate) const ANTIPARALLEL: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Share of all faces, one over this, up to which opposite ones are looked at one by one.
const FEW: usize = 16;

/// Overlaps smaller than this are rounding, not contact [m^2].
pub(super) fn area_floor(mesh: &Mesh) -> f64 {
    let (low, high) = mesh.bounding_box();
    1e-9 * (high - low).length_squared()
}

/// Pairs of the given kind with widths in `min_width..=max_width` and an overlap above `floor`, by
/// falling overlap.
pub(super) fn pairs(
    faces: &[PlanarFace],
    kind: PairKind,
    min_width: f64,
    max_width: f64,
    floor: f64,
) -> Vec<FacePair> {
    let boxes: Vec<Aabb> = faces.iter().map(bounding_box).collect();
    let Some(whole) = boxes.iter().copied().reduce(|sum, next| sum.merged(&next)) else {
        return Vec::new();
    };
    let (min_width, max_width) =
        (min_width.max(0.0), max_width.min(2.0 * whole.half_extents().length()));
    if min_width > max_width {
        return Vec::new();
    }
    let directions = Directions::new(faces);
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let convex: Vec<bool> = faces.iter().map(|face| matches!(face.polygons.as_slice(), [only] if only.holes.is_empty() && is_convex(&only.outer))).collect();
    let sign = if kind == PairKind::External { 1.0 } else { -1.0 };
    let antiparallel = ANTIPARALLEL.cos();
    let mut found = Vec::new();
    for face in faces.iter().filter(|face| face.reachable) {
        // Where a partner must lie: the face moved against its normal by the widths asked for, and
        // the tilt allowed for.
        let own = &boxes[face.id as usize];
        let slack =
            ANTIPARALLEL * (2.0 * own.half_extents().length() + max_width) + max_width * 1e-9;
        let (near, far) = (-sign * min_width * face.normal, -sign * max_width * face.normal);
        let reach = Aabb::new(own.mins + near.min(far) - slack, own.maxs + near.max(far) + slack);
        let opposite = directions.near(-face.normal);
        let within: Vec<u32> = if opposite.len() < faces.len() / FEW {
            opposite.into_iter().filter(|&id| boxes[id as usize].intersects(&reach)).collect()
        } else {
            tree.intersect_aabb(&reach).collect()
        };
        for other in within {
            let other = &faces[other as usize];
            if other.id <= face.id
                || !other.reachable
                || -face.normal.dot(other.normal) < antiparallel
            {
                continue;
            }
            let axis = (face.normal - other.normal).normalize();
            if let Some((width, overlap_area)) = overlap(face, other, axis, &convex)
                && overlap_area > floor
                && sign * width > 0.0
                && (min_width..=max_width).contains(&(sign * width))
            {
                found.push(FacePair {
                    face_i: face.id,
                    face_ii: other.id,
                    width: sign * width,
                    overlap_area,
                    kind,
                });
            }
        }
    }
    found.sort_by(|a, b| {
        b.overlap_area
            .total_cmp(&a.overlap_area)
            .then((a.face_i, a.face_ii).cmp(&(b.face_i, b.face_ii)))
    });
    found
}

/// Faces by the cell of their normals: of a rough part no two of tens of thousands are opposite.
struct Directions(FxHashMap<[i32; 3], Vec<u32>>);

impl Directions {
    fn new(faces: &[PlanarFace]) -> Self {
        let mut cells = FxHashMap::<_, Vec<u32>>::default();
        for face in faces {
            cells.entry(Self::cell(face.normal)).or_default().push(face.id);
        }
        Self(cells)
    }

    fn cell(normal: DVec3) -> [i32; 3] {
        (normal / (1.01 * ANTIPARALLEL)).floor().as_ivec3().to_array()
    }

    /// Faces of this normal to within [`ANTIPARALLEL`], and others.
    fn near(&self, normal: DVec3) -> Vec<u32> {
        let [x, y, z] = Self::cell(normal);
        let around = (0..27).map(|k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
        around.filter_map(|cell| self.0.get(&cell)).flatten().copied().collect()
    }
}

fn bounding_box(face: &PlanarFace) -> Aabb {
    let points = face
        .polygons
        .iter()
        .flat_map(|polygon| &polygon.outer)
        .map(|point| face.part_from_face.point(point.extend(0.0)));
    points
        .fold(Aabb::new_invalid(), |sum, point| Aabb::new(sum.mins.min(point), sum.maxs.max(point)))
}

/// Signed distance of the faces along `axis` at the middle of their overlap (positive: material
/// between), and its area.
fn overlap(
    face: &PlanarFace,
    other: &PlanarFace,
    axis: DVec3,
    convex: &[bool],
) -> Option<(f64, f64)> {
    let frame = face.part_from_face;
    let place = |point: &DVec2| {
        frame.point_inverse(other.part_from_face.point(point.extend(0.0))).truncate()
    };
    let ring = |ring: &Ring| ring.iter().map(place).collect::<Ring>();
    // Seen from the first face the second one's rings run the other way.
    let theirs: Vec<Polygon> = other
        .polygons
        .iter()
        .map(|polygon| Polygon {
            outer: ring(&polygon.outer),
            holes: polygon.holes.iter().map(ring).collect(),
        })
        .collect();
    let (own_box, their_box) = (polygon::bounds(&face.polygons), polygon::bounds(&theirs));
    if !own_box.meets(their_box) {
        return None;
    }
    // Clipping against a convex face is exact for integrals and far cheaper than the general case.
    let clipped = |rings: &[Polygon], window: &Ring| {
        let rings: Vec<Ring> = rings
            .iter()
            .flat_map(polygon::rings)
            .map(|ring| clip_ring_convex(ring, window))
            .collect();
        rings_moments(&rings.iter().map(Vec::as_slice).collect::<Vec<_>>())
    };
    let common = if convex[face.id as usize] {
        let moments = clipped(&theirs, &face.polygons[0].outer);
        Moments { area: -moments.area, ..moments } // their rings are reversed
    } else if convex[other.id as usize] {
        let mut window = theirs[0].outer.clone();
        window.reverse();
        clipped(&face.polygons, &window)
    } else {
        patch_moments(&intersect(&face.polygons, &theirs))
    };
    if common.area <= 0.0 {
        return None;
    }
    let middle = frame.point(common.centroid.extend(0.0));
    let on_plane =
        |plane: &PlanarFace| (plane.offset - plane.normal.dot(middle)) / plane.normal.dot(axis);
    Some((on_plane(face) - on_plane(other), common.area))
}

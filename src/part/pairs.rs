//! Antiparallel face pairs.

use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;

use super::{FacePair, Mesh, PairKind, PlanarFace};
use crate::geometry::overlay::intersect;
use crate::geometry::polygon::{self, patch_moments};
use crate::model::{Polygon, Ring};

/// Angle between one face and the reverse of the other up to which they count as antiparallel: 0.5 degrees, what the
/// rubber of a pad takes up (0.2 mm over 20 mm).
const ANTIPARALLEL: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Overlaps smaller than this are rounding, not contact [m^2].
pub(super) fn area_floor(mesh: &Mesh) -> f64 {
    let (low, high) = mesh.bounding_box();
    1e-9 * (high - low).length_squared()
}

/// Pairs of the given kind with widths in `min_width..=max_width` and an overlap above `floor`, by falling overlap.
pub(super) fn pairs(faces: &[PlanarFace], kind: PairKind, min_width: f64, max_width: f64, floor: f64) -> Vec<FacePair> {
    let index = NormalIndex::new(faces);
    let mut found = Vec::new();
    for face in faces.iter().filter(|face| face.reachable) {
        for other in index.near(-face.normal) {
            let other = &faces[other as usize];
            if other.id <= face.id || !other.reachable || face.normal.dot(-other.normal) < ANTIPARALLEL.cos() {
                continue;
            }
            // Cheap bound first: the width at the centroids, off by the tilt over the faces' size.
            let axis = (face.normal - other.normal).normalize();
            let slack = ANTIPARALLEL * (face.centroid - other.centroid).length();
            let sign = if kind == PairKind::External { 1.0 } else { -1.0 };
            let width = sign * axis.dot(face.centroid - other.centroid);
            if width < min_width - slack || width > max_width + slack {
                continue;
            }
            if let Some((width, overlap_area)) = overlap(face, other, axis)
                && overlap_area > floor
                && (min_width..=max_width).contains(&(sign * width))
                && sign * width > 0.0
            {
                found.push(FacePair { face_i: face.id, face_ii: other.id, width: sign * width, overlap_area, kind });
            }
        }
    }
    found.sort_by(|a, b| b.overlap_area.total_cmp(&a.overlap_area).then((a.face_i, a.face_ii).cmp(&(b.face_i, b.face_ii))));
    found
}

/// Signed distance of the faces along `axis` at the middle of their overlap (positive: material between), and its area.
fn overlap(face: &PlanarFace, other: &PlanarFace, axis: DVec3) -> Option<(f64, f64)> {
    let frame = face.part_from_face;
    let place = |point: &DVec2| frame.point_inverse(other.part_from_face.point(point.extend(0.0))).truncate();
    let ring = |ring: &Ring| ring.iter().map(place).collect::<Ring>();
    // Seen from the first face the second one's rings run the other way.
    let theirs: Vec<Polygon> =
        other.polygons.iter().map(|polygon| Polygon { outer: ring(&polygon.outer), holes: polygon.holes.iter().map(ring).collect() }).collect();
    let (own_box, their_box) = (polygon::bounds(&face.polygons), polygon::bounds(&theirs));
    if !own_box.meets(their_box) {
        return None;
    }
    let common = patch_moments(&intersect(&face.polygons, &theirs));
    if common.area <= 0.0 {
        return None;
    }
    let middle = frame.point(common.centroid.extend(0.0));
    let on_plane = |plane: &PlanarFace| (plane.offset - plane.normal.dot(middle)) / plane.normal.dot(axis);
    Some((on_plane(face) - on_plane(other), common.area))
}

/// Faces by direction: cells of the cube around the unit sphere, wide enough that near directions share a cell or are neighbours.
struct NormalIndex {
    cells: FxHashMap<[i32; 3], Vec<u32>>,
}

impl NormalIndex {
    const CELL: f64 = 2.0 * ANTIPARALLEL;

    fn new(faces: &[PlanarFace]) -> Self {
        let mut cells: FxHashMap<[i32; 3], Vec<u32>> = FxHashMap::default();
        for face in faces {
            cells.entry(Self::cell(face.normal)).or_default().push(face.id);
        }
        Self { cells }
    }

    fn cell(direction: DVec3) -> [i32; 3] {
        direction.to_array().map(|x| (x / Self::CELL).round() as i32)
    }

    /// Faces whose normals may be within [`ANTIPARALLEL`] of `direction`.
    fn near(&self, direction: DVec3) -> impl Iterator<Item = u32> + '_ {
        let [x, y, z] = Self::cell(direction);
        (0..27).filter_map(move |n| self.cells.get(&[x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1])).flatten().copied()
    }
}

//! Antiparallel face pairs.

use glam::{DVec2, DVec3};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::single::SingleFloatOverlay;
use rustc_hash::FxHashMap;

use super::boundary::twice_area;
use super::{FacePair, Mesh, PairKind, PlanarFace};

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
    let own = shapes(face, |point| point);
    let theirs = shapes(other, |point| frame.point_inverse(other.part_from_face.point(point.extend(0.0))).truncate());
    let ((low_a, high_a), (low_b, high_b)) = (bounds(&own)?, bounds(&theirs)?);
    if low_a.cmpge(high_b).any() || low_b.cmpge(high_a).any() {
        return None;
    }
    let common = own.overlay_as::<i64>(&theirs, OverlayRule::Intersect, FillRule::EvenOdd);
    let (mut area, mut first) = (0.0, DVec2::ZERO);
    for contour in common.iter().flatten() {
        let ring: Vec<DVec2> = contour.iter().copied().map(DVec2::from_array).collect();
        let part = twice_area(&ring) / 2.0;
        area += part;
        first += part * ring.iter().sum::<DVec2>() / ring.len() as f64;
    }
    if area <= 0.0 {
        return None;
    }
    // The planes are nearly parallel: a middle weighted by contour is near enough to measure their distance at.
    let middle = frame.point((first / area).extend(0.0));
    let on_plane = |plane: &PlanarFace| (plane.offset - plane.normal.dot(middle)) / plane.normal.dot(axis);
    Some((on_plane(face) - on_plane(other), area))
}

fn shapes(face: &PlanarFace, place: impl Fn(DVec2) -> DVec2) -> Vec<Vec<Vec<[f64; 2]>>> {
    let contour = |ring: &Vec<DVec2>| ring.iter().map(|&point| place(point).to_array()).collect();
    face.polygons.iter().map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes).map(contour).collect()).collect()
}

fn bounds(shapes: &[Vec<Vec<[f64; 2]>>]) -> Option<(DVec2, DVec2)> {
    let mut points = shapes.iter().flatten().flatten().copied().map(DVec2::from_array);
    let first = points.next()?;
    Some(points.fold((first, first), |(low, high), point| (low.min(point), high.max(point))))
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

//! Faces by the planes in which they lie, and the heights of two planes that face each other.

use glam::{DMat3, DVec2, DVec3};
use rustc_hash::FxHashMap;

use super::{Finder, Site};
use crate::geometry::polygon::Bounds2;
use crate::model::Polygon;
use crate::part::{Part, PlanarFace};

/// Faces sorted into planes.
pub(super) struct Planes {
    /// Plane number of each face.
    pub(super) of: Vec<usize>,
    /// Faces of each plane, by its number.
    pub(super) faces: FxHashMap<usize, Vec<u32>>,
}

impl Planes {
    pub(super) fn new(faces: &[PlanarFace], tolerance: f64) -> Self {
        let reach = faces.iter().map(|face| face.centroid.length()).fold(0.0, f64::max);
        // Sorted by offset, only a window can match: tilts of 1e-3 move the offset by that much of
        // the reach.
        let mut sorted: Vec<&PlanarFace> = faces.iter().collect();
        sorted.sort_by(|a, b| a.offset.total_cmp(&b.offset).then(a.id.cmp(&b.id)));
        let offsets: Vec<f64> = sorted.iter().map(|face| face.offset).collect();
        let mut of = vec![usize::MAX; faces.len()];
        for face in faces {
            if of[face.id as usize] != usize::MAX {
                continue;
            }
            of[face.id as usize] = face.id as usize;
            let slack = tolerance + 1e-3 * reach;
            let window = offsets.partition_point(|&offset| offset < face.offset - slack)
                ..offsets.partition_point(|&offset| offset <= face.offset + slack);
            for other in &sorted[window] {
                let same = other.normal.dot(face.normal) > 1.0 - 5e-7
                    && (face.normal.dot(other.centroid) - face.offset).abs() < tolerance;
                if of[other.id as usize] == usize::MAX && same {
                    of[other.id as usize] = face.id as usize;
                }
            }
        }
        let mut members: FxHashMap<usize, Vec<u32>> = Default::default();
        for face in faces.iter().filter(|face| face.reachable) {
            members.entry(of[face.id as usize]).or_default().push(face.id);
        }
        Self { of, faces: members }
    }
}

impl Finder<'_> {
    /// The faces that pads at a site may touch: those of its pairs, and others in the same planes
    /// within reach of a pad.
    pub(super) fn touched(&self, site: &Site, reach: f64) -> [Vec<u32>; 2] {
        let region = site.bounds.grown(reach);
        let near = |&id: &u32| {
            let face = &self.part.faces[id as usize];
            let place = |&point: &DVec2| {
                let point = face.part_from_face.point(point.extend(0.0));
                site.part_from_site.point_inverse(point).truncate()
            };
            let outline: Vec<DVec2> =
                face.polygons.iter().flat_map(|polygon| &polygon.outer).map(place).collect();
            self.chosen.is_none_or(|chosen| chosen[id as usize])
                && Bounds2::of(&outline).meets(region)
        };
        [0, 1].map(|side: usize| {
            let mut faces = site.faces[side].clone();
            let plane = self.planes.of[faces[0] as usize];
            let others = self.planes.faces.get(&plane).map_or(&[][..], Vec::as_slice);
            let others: Vec<u32> =
                others.iter().filter(|id| !faces.contains(id)).copied().filter(near).collect();
            faces.extend(others);
            faces.sort_unstable();
            faces
        })
    }
}

/// Heights of the planes of side I and II above `point` of the axes' `(x, y)`.
pub(super) fn heights(
    face_i: &PlanarFace,
    face_ii: &PlanarFace,
    axes_from_part: &DMat3,
    point: DVec2,
) -> [f64; 2] {
    [face_i, face_ii].map(|face| {
        let normal = *axes_from_part * face.normal;
        (face.offset - normal.truncate().dot(point)) / normal.z
    })
}

/// How far any of the faces rises above its pad's plane within the overlap.
pub(super) fn rise(
    sides: &[Vec<u32>; 2],
    part: &Part,
    axes_from_part: &DMat3,
    axis: DVec3,
    overlap: &[Polygon],
    heights: [f64; 2],
) -> f64 {
    let mut most = 0.0_f64;
    for side in 0..2 {
        for &id in &sides[side] {
            let face = &part.faces[id as usize];
            let normal = *axes_from_part * face.normal;
            let out = face.normal.dot(axis).signum();
            for point in overlap.iter().flat_map(|polygon| &polygon.outer) {
                let height = (face.offset - normal.truncate().dot(*point)) / normal.z;
                most = most.max(out * (height - heights[side]));
            }
        }
    }
    most
}

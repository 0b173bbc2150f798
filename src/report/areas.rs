//! What the pads touch, as columns of the page: contact areas, and surfaces that are not plane.

use std::sync::Arc;

use glam::{DMat2, DVec2};
use rustc_hash::FxHashMap;

use super::payload::Columns;
use crate::model::{Contact, Gap, Piece, Ring, Surfaces};
use crate::results::RankedGrip;

/// Corners of surfaces that a page carries; grips beyond them are drawn with their areas alone.
const MOST_CORNERS: usize = 1_000_000;

/// Contact areas, each written once: ring starts into the points, and per ring face (bit 0) and
/// hole (bit 1).
pub(super) fn contacts(columns: &mut Columns, grips: &[RankedGrip]) {
    let mut known: FxHashMap<Vec<u64>, u32> = FxHashMap::default();
    let (mut ring_of_contact, mut point_of_ring, mut kinds, mut points) =
        (vec![0u32], vec![0u32], Vec::<u8>::new(), Vec::<f32>::new());
    let numbers: Vec<u32> = grips
        .iter()
        .map(|grip| {
            let contact = &*grip.grip.contact;
            let next = known.len() as u32;
            *known.entry(key(contact)).or_insert_with(|| {
                for (face, patch) in [(0, &contact.face_i), (1, &contact.face_ii)] {
                    for polygon in patch {
                        for (hole, ring) in std::iter::once((0, &polygon.outer))
                            .chain(polygon.holes.iter().map(|ring| (2, ring)))
                        {
                            points.extend(ring.iter().flat_map(|p| [p.x as f32, p.y as f32]));
                            point_of_ring.push((points.len() / 2) as u32);
                            kinds.push(face | hole);
                        }
                    }
                }
                ring_of_contact.push(kinds.len() as u32);
                next
            })
        })
        .collect();
    columns.u32("contact", numbers);
    columns.add("contact_rings", "u32", &ring_of_contact);
    columns.add("ring_points", "u32", &point_of_ring);
    columns.add("ring_kind", "u8", &kinds);
    columns.add("points", "f32", &points);
}

/// The exact content of a contact as something that hashes.
fn key(contact: &Contact) -> Vec<u64> {
    let mut key = Vec::new();
    for (face, patch) in [(0, &contact.face_i), (1, &contact.face_ii)] {
        for polygon in patch {
            for (hole, ring) in std::iter::once((0, &polygon.outer))
                .chain(polygon.holes.iter().map(|ring| (2, ring)))
            {
                key.push((ring.len() as u64) << 2 | hole | face);
                key.extend(ring.iter().flat_map(|p| [p.x.to_bits(), p.y.to_bits()]));
            }
        }
    }
    key
}

/// Rings one after another: starts into the points, and per ring its face (bit 0), whether it is a
/// hole (bit 1), and whether a piece of surface begins with it (bit 2).
#[derive(Default)]
struct Rings {
    starts: Vec<u32>,
    kinds: Vec<u8>,
    points: Vec<f32>,
}

impl Rings {
    fn push(&mut self, ring: &Ring, kind: u8) {
        self.starts.push((self.points.len() / 2) as u32);
        self.kinds.push(kind);
        self.points.extend(ring.iter().flat_map(|p| [p.x as f32, p.y as f32]));
    }
}

/// Surfaces that are not plane, each written once: the number of each grip's (the largest number:
/// none), first ring and stiffness of each surface, and the gap of each piece as a polynomial
/// `c + g1 x1 + g2 x2 + (h11 x1^2 + 2 h12 x1 x2 + h22 x2^2) / 2` in SI.
pub(super) fn surfaces(columns: &mut Columns, grips: &[RankedGrip]) {
    let mut shared: FxHashMap<usize, u32> = FxHashMap::default();
    let mut known: FxHashMap<Vec<u64>, u32> = FxHashMap::default();
    let (mut rings, mut first, mut stiffness) = (Rings::default(), Vec::new(), Vec::new());
    let mut gaps: Vec<[f64; 6]> = Vec::new();
    let mut add = |surfaces: &Surfaces| {
        let next = known.len() as u32;
        *known.entry(surface_key(surfaces)).or_insert_with(|| {
            first.push(rings.starts.len() as u32);
            stiffness.extend(surfaces.stiffness);
            for (face, pieces) in [(0, &surfaces.face_i), (1, &surfaces.face_ii)] {
                for piece in pieces {
                    gaps.push(polynomial(&piece.gap));
                    rings.push(&piece.outer, face | 4);
                    piece.holes.iter().for_each(|hole| rings.push(hole, face | 2));
                }
            }
            next
        })
    };
    let mut corners = 0;
    let numbers: Vec<u32> = grips
        .iter()
        .map(|ranked| {
            let Some(surfaces) = &ranked.grip.surfaces else { return u32::MAX };
            *shared.entry(Arc::as_ptr(surfaces) as usize).or_insert_with(|| {
                let pieces = surfaces.face_i.iter().chain(&surfaces.face_ii);
                corners += pieces.map(|piece| piece.outer.len()).sum::<usize>();
                if corners > MOST_CORNERS { u32::MAX } else { add(surfaces) }
            })
        })
        .collect();
    first.push(rings.starts.len() as u32);
    rings.starts.push((rings.points.len() / 2) as u32);
    columns.u32("surface", numbers);
    columns.u32("surface_rings", first);
    columns.f64("surface_stiffness", stiffness);
    columns.f64("surface_gap", gaps.into_iter().flatten());
    columns.add("surface_ring_points", "u32", &rings.starts);
    columns.add("surface_ring_kind", "u8", &rings.kinds);
    columns.add("surface_points", "f32", &rings.points);
}

/// What each face carries under the worst load where it is not plane: pressed area [m^2] and the
/// sides of the box around it \[m\], NaN for other grips; and the notes of each grip by their places
/// in the list that is the answer.
pub(super) fn faces(columns: &mut Columns, grips: &[RankedGrip]) -> Vec<String> {
    let known = |ranked: &RankedGrip| ranked.faces;
    let area = |ranked| known(ranked).map_or([f64::NAN; 2], |faces| faces.map(|face| face.area));
    columns.f32("face_area", grips.iter().flat_map(area));
    let size = |ranked| {
        let [one, two] = known(ranked)?.map(|face| {
            let [low, high] = face.extent;
            [high[0] - low[0], high[1] - low[1]]
        });
        Some([one[0], one[1], two[0], two[1]])
    };
    columns.f32("face_size", grips.iter().flat_map(|ranked| size(ranked).unwrap_or([f64::NAN; 4])));
    let mut texts: Vec<String> = Vec::new();
    let mut numbers: FxHashMap<String, u32> = FxHashMap::default();
    let (mut rows, mut notes) = (vec![0_u32], Vec::new());
    for ranked in grips {
        notes.extend(ranked.notes.iter().map(|note| {
            let text = note.to_string();
            *numbers.entry(text.clone()).or_insert_with(|| {
                texts.push(text);
                texts.len() as u32 - 1
            })
        }));
        rows.push(notes.len() as u32);
    }
    columns.u32("note_rows", rows);
    columns.u32("note", notes);
    texts
}

/// The exact content of a surface as something that hashes.
fn surface_key(surfaces: &Surfaces) -> Vec<u64> {
    let mut key: Vec<u64> = surfaces.stiffness.map(f64::to_bits).to_vec();
    for (face, pieces) in [(0, &surfaces.face_i), (1, &surfaces.face_ii)] {
        for Piece { outer, holes, gap } in pieces {
            key.extend(polynomial(gap).map(f64::to_bits));
            for ring in std::iter::once(outer).chain(holes) {
                key.push((ring.len() as u64) << 1 | face);
                key.extend(ring.iter().flat_map(|p| [p.x.to_bits(), p.y.to_bits()]));
            }
        }
    }
    key
}

/// A gap as `[c, g1, g2, h11, h12, h22]`: see [`surfaces`].
fn polynomial(gap: &Gap) -> [f64; 6] {
    let round = |height: f64, at: DVec2, bend: DMat2| {
        let g = -(bend * at);
        let c = height + at.dot(bend * at) / 2.0;
        [c, g.x, g.y, bend.x_axis.x, bend.x_axis.y, bend.y_axis.y]
    };
    // A curvature along a unit vector.
    let along = |e: DVec2, curvature: f64| DMat2::from_cols(e * e.x, e * e.y) * curvature;
    match *gap {
        Gap::Plane { height, slope } => [height, slope.x, slope.y, 0.0, 0.0, 0.0],
        Gap::Cylinder { radius, axis, at, height } => {
            round(height, at, along(axis.normalize_or_zero().perp(), 1.0 / radius))
        }
        Gap::Sphere { radius, at, height } => round(height, at, DMat2::IDENTITY * (1.0 / radius)),
        Gap::Barrel { radius, meridian, axis, at, height } => {
            let e = axis.normalize_or_zero();
            round(height, at, along(e.perp(), 1.0 / radius) + along(e, 1.0 / meridian))
        }
        Gap::Cone { radius, slope, axis, at, height } => {
            let e = axis.normalize_or_zero();
            let (height, lean) = (height - slope * e.dot(at), slope * e);
            let [c, g1, g2, h11, h12, h22] = round(height, at, along(e.perp(), 1.0 / radius));
            [c, g1 + lean.x, g2 + lean.y, h11, h12, h22]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the definitions of the gaps, at places off every axis.
    #[test]
    fn a_polynomial_is_its_gap() {
        let (at, axis) = (DVec2::new(0.003, -0.002), DVec2::new(3.0, 4.0));
        let e = axis.normalize();
        let (radius, meridian, height) = (0.012, -0.05, 0.0004);
        for x in [DVec2::new(0.01, 0.004), DVec2::new(-0.006, 0.009)] {
            let (along, across) = ((x - at).dot(e), (x - at).perp_dot(e));
            let cylinder = height + across * across / (2.0 * radius);
            for (gap, expected) in [
                (
                    Gap::Plane { height, slope: DVec2::new(0.1, -0.2) },
                    height + 0.1 * x.x - 0.2 * x.y,
                ),
                (Gap::Cylinder { radius, axis, at, height }, cylinder),
                (
                    Gap::Sphere { radius, at, height },
                    height + (x - at).length_squared() / (2.0 * radius),
                ),
                (
                    Gap::Barrel { radius, meridian, axis, at, height },
                    cylinder + along * along / (2.0 * meridian),
                ),
                (Gap::Cone { radius, slope: 0.07, axis, at, height }, cylinder + 0.07 * along),
            ] {
                let [c, g1, g2, h11, h12, h22] = polynomial(&gap);
                let bend = (h11 * x.x * x.x + 2.0 * h12 * x.x * x.y + h22 * x.y * x.y) / 2.0;
                let value = c + g1 * x.x + g2 * x.y + bend;
                assert!((value - expected).abs() < 1e-15, "{gap:?}: {value}, {expected}");
            }
        }
    }
}

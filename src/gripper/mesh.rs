//! Gripper bodies from a mesh file: every connected piece cut into slices, each slice taken as its
//! convex hull.
//!
//! The hulls together contain the mesh, so a test against them never lets a collision pass; slices
//! keep a bent or hollowed finger from filling its own bays.

use std::path::Path;

use glam::DVec3;
use parry3d_f64::transformation::try_convex_hull;

use crate::error::Result;
use crate::geometry::{UnionFind, clip_ring_axis};
use crate::part::{Part, ReadOptions, Unit};

/// Slices of a piece along its longest side, before those are joined whose common hull fills no
/// more space.
const SLICES: usize = 16;
/// Space that joining two slices may add, as a share of the joined hull.
const FILLED: f64 = 2e-3;

/// Points of convex bodies that together contain the mesh in `path` \[m\].
///
/// # Errors
/// As [`Part::read`].
pub(super) fn hulls(path: &Path, unit: Option<Unit>) -> Result<Vec<Vec<DVec3>>> {
    let part = Part::read(path, &ReadOptions { unit, ..Default::default() })?;
    let triangles: Vec<[DVec3; 3]> =
        (0..part.mesh.triangles.len() as u32).map(|index| part.mesh.corners(index)).collect();
    Ok(pieces(&part)
        .into_iter()
        .flat_map(|piece| {
            slices(&piece.into_iter().map(|index| triangles[index]).collect::<Vec<_>>())
        })
        .collect())
}

/// Triangles of each connected piece, in the order of their first triangle.
fn pieces(part: &Part) -> Vec<Vec<usize>> {
    let mut sets = UnionFind::new(part.mesh.vertices.len());
    for &[a, b, c] in &part.mesh.triangles {
        sets.join(a as usize, b as usize);
        sets.join(a as usize, c as usize);
    }
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    let mut piece_of = std::collections::HashMap::new();
    for (index, triangle) in part.mesh.triangles.iter().enumerate() {
        let piece = *piece_of.entry(sets.root(triangle[0] as usize)).or_insert_with(|| {
            pieces.push(Vec::new());
            pieces.len() - 1
        });
        pieces[piece].push(index);
    }
    pieces
}

/// Convex hulls of slices of one piece.
fn slices(triangles: &[[DVec3; 3]]) -> Vec<Vec<DVec3>> {
    let corners = || triangles.iter().flatten().copied();
    let (low, high) = corners()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| {
            (low.min(corner), high.max(corner))
        });
    let axis = (high - low).max_position();
    let at = |share: usize| low[axis] + (high[axis] - low[axis]) * share as f64 / SLICES as f64;
    let mut found: Vec<(Vec<DVec3>, f64)> = Vec::new();
    for slice in 0..SLICES {
        // The cut through a closed surface lies within the hull of its outline, which the clipped
        // triangles leave.
        let points: Vec<DVec3> = triangles
            .iter()
            .flat_map(|&triangle| clip(triangle, axis, at(slice), at(slice + 1)))
            .collect();
        let next = hull(points);
        if let Some((before, volume)) = found.last_mut() {
            let joined = hull(before.iter().chain(&next.0).copied().collect());
            if joined.1 - *volume - next.1 <= FILLED * joined.1 {
                (*before, *volume) = joined;
                continue;
            }
        }
        found.push(next);
    }
    found
        .into_iter()
        .filter(|(points, volume)| points.len() >= 4 && *volume > 0.0)
        .map(|(points, _)| points)
        .collect()
}

/// Corners of the convex hull and its volume; all points, without volume, where they have none.
fn hull(points: Vec<DVec3>) -> (Vec<DVec3>, f64) {
    match try_convex_hull(&points) {
        Ok((corners, faces)) => {
            let volume = faces.iter().map(|face| {
                let [a, b, c] = face.map(|index| corners[index as usize] - corners[0]);
                a.dot(b.cross(c)) / 6.0
            });
            let volume = volume.sum::<f64>().abs();
            (corners, volume)
        }
        Err(_) => (points, 0.0),
    }
}

/// The part of a triangle between two values of a coordinate.
fn clip(triangle: [DVec3; 3], axis: usize, from: f64, to: f64) -> Vec<DVec3> {
    clip_ring_axis(&clip_ring_axis(&triangle, axis, 1.0, to), axis, -1.0, -from)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L of two legs 10 mm thick, 40 mm long, 8 mm deep, as a closed prism.
    fn angle_bracket() -> Vec<[DVec3; 3]> {
        let outline =
            [(0.0, 0.0), (40.0, 0.0), (40.0, 10.0), (10.0, 10.0), (10.0, 40.0), (0.0, 40.0)];
        let point = |k: usize, z: f64| DVec3::new(outline[k].0, outline[k].1, z);
        let mut triangles = Vec::new();
        for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]] {
            triangles.push([point(a, 8.0), point(b, 8.0), point(c, 8.0)]);
            triangles.push([point(a, 0.0), point(c, 0.0), point(b, 0.0)]);
        }
        for k in 0..6 {
            let next = (k + 1) % 6;
            triangles.push([point(k, 0.0), point(next, 0.0), point(next, 8.0)]);
            triangles.push([point(k, 0.0), point(next, 8.0), point(k, 8.0)]);
        }
        triangles
    }

    #[test]
    fn slices_contain_the_mesh_and_leave_its_bay_free() {
        let triangles = angle_bracket();
        let bodies = slices(&triangles);
        assert_eq!(bodies.len(), 2, "one for each leg: the slices end where they meet");
        let total: f64 = bodies.iter().map(|points| hull(points.clone()).1).sum();
        let exact = 8.0 * (400.0 + 300.0);
        assert!(total >= exact * (1.0 - 1e-9) && total < 1.12 * exact, "{total} {exact}");
        // Every point of the surface lies in one of them: no plane of any direction separates it
        // from all.
        let covered = |point: DVec3| {
            bodies.iter().any(|points| {
                (0..400).all(|k| {
                    let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / 400.0;
                    let turn = f64::from(k) * 2.399_963_229_728_653;
                    let direction = DVec3::new(
                        (1.0 - z * z).sqrt() * turn.cos(),
                        (1.0 - z * z).sqrt() * turn.sin(),
                        z,
                    );
                    points
                        .iter()
                        .map(|corner| corner.dot(direction))
                        .fold(f64::NEG_INFINITY, f64::max)
                        >= point.dot(direction) - 1e-9
                })
            })
        };
        for [a, b, c] in triangles {
            for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.3), (0.5, 0.5), (0.7, 0.1)] {
                assert!(covered(a + (b - a) * i + (c - a) * j));
            }
        }
        assert!(!covered(DVec3::new(25.0, 25.0, 4.0)), "the bay");
    }
}

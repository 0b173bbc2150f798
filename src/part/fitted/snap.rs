//! Corners moved onto the faces that they belong to.

use glam::DVec3;
use nalgebra::{Matrix3, Vector3};

use super::{Fitted, TAKEN};
use crate::part::curves::Kind;
use crate::part::given::Stated;
use crate::part::repair::Repaired;
use crate::part::topology::NONE;

/// Steps towards all faces of a corner at once.
const STEPS: usize = 4;
/// Square of the sine of the angle between faces below which a corner goes between them.
const FLAT: f64 = 0.02;
/// Distance in greatest residuals that a corner may be moved.
const FARTHEST: f64 = 5.0;

/// Signed distance from a surface, and its gradient.
fn level(surface: &Stated, point: DVec3) -> Option<(f64, DVec3)> {
    match *surface {
        Stated::Plane { origin, normal } => Some(((point - origin).dot(normal), normal)),
        Stated::Round { kind: Kind::Revolution, .. } | Stated::Other => None,
        Stated::Round { surface, .. } => Some(surface.distance_and_normal(point)),
    }
}

/// The shortest way that brings all levels to zero.
fn step(levels: &[(f64, DVec3)]) -> DVec3 {
    let (mut sum, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &(distance, normal) in levels {
        let normal = Vector3::new(normal.x, normal.y, normal.z);
        sum += normal * normal.transpose();
        right -= normal * distance;
    }
    let eigen = sum.symmetric_eigen();
    let mut step = Vector3::zeros();
    for k in 0..3 {
        let (value, direction) = (eigen.eigenvalues[k], eigen.eigenvectors.column(k));
        if value > FLAT {
            step += direction * (direction.dot(&right) / value);
        }
    }
    DVec3::new(step[0], step[1], step[2])
}

/// Moves the corners of fitted faces onto them: at an edge onto both, at a corner onto all. Those of
/// faces that the file states stay.
pub(super) fn snap(part: &mut Repaired, owner: &[u32], faces: &[Fitted]) {
    let mut of: Vec<(u32, u32)> = Vec::with_capacity(3 * owner.len());
    for (triangle, &face) in part.mesh.triangles.iter().zip(owner) {
        if face <= TAKEN {
            of.extend(triangle.iter().map(|&vertex| (vertex, face)));
        }
    }
    of.sort_unstable();
    of.dedup();
    for group in of.chunk_by(|a, b| a.0 == b.0) {
        if group.iter().any(|entry| entry.1 == TAKEN || entry.1 == NONE) {
            continue;
        }
        let start = part.mesh.vertices[group[0].0 as usize];
        let levels = |point: DVec3| -> Vec<(f64, DVec3)> {
            group
                .iter()
                .filter_map(|entry| level(&faces[entry.1 as usize].surface, point))
                .collect()
        };
        let farthest = levels(start).iter().map(|level| level.0.abs()).fold(0.0, f64::max);
        let mut point = start;
        for _ in 0..STEPS {
            point += step(&levels(point));
        }
        if point.distance(start) <= FARTHEST * farthest {
            part.mesh.vertices[group[0].0 as usize] = point;
        }
    }
}

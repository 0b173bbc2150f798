//! Closed surfaces over turns and rows.

use std::f64::consts::TAU;

use glam::DVec3;

/// Corners and triangles.
pub(crate) type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// A surface over turns and heights, `rows` of `around` corners, closed by a corner at either end.
pub(crate) fn lathe(
    around: u32,
    rows: u32,
    ends: [DVec3; 2],
    at: impl Fn(f64, f64) -> DVec3,
) -> Mesh {
    let mut vertices = Vec::new();
    for row in 0..rows {
        let turns = (0..around).map(|k| TAU * f64::from(k) / f64::from(around));
        vertices.extend(turns.map(|turn| at(turn, f64::from(row))));
    }
    let low = vertices.len() as u32;
    vertices.extend(ends);
    let mut triangles = Vec::new();
    for k in 0..around {
        let next = (k + 1) % around;
        for row in 0..rows - 1 {
            let [a, b] = [k, next].map(|k| row * around + k);
            triangles.extend([[a, b, b + around], [a, b + around, a + around]]);
        }
        let top = (rows - 1) * around;
        triangles.extend([[next, k, low], [top + k, top + next, low + 1]]);
    }
    (vertices, triangles)
}

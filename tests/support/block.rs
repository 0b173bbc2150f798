//! A block with a top of any form.

use glam::{DVec2, DVec3};

/// Corners and triangles of a block over a grid of cells: `place` puts the corner at the bottom (0) or
/// the top (1) over a spot of the grid, from -1/2 to 1/2 along both.
pub(crate) fn block(
    [nx, ny]: [u32; 2],
    mut place: impl FnMut(u32, DVec2) -> DVec3,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut vertices = Vec::new();
    for level in 0..2 {
        for j in 0..=ny {
            for i in 0..=nx {
                let [x, y] = [(i, nx), (j, ny)].map(|(i, n)| f64::from(i) / f64::from(n) - 0.5);
                vertices.push(place(level, DVec2::new(x, y)));
            }
        }
    }
    let layer = (nx + 1) * (ny + 1);
    let at = |i: u32, j: u32| j * (nx + 1) + i;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut quad = |a: u32, b: u32, c: u32, d: u32| triangles.extend([[a, b, c], [a, c, d]]);
    for j in 0..ny {
        for i in 0..nx {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            quad(a, d, c, b);
            quad(a + layer, b + layer, c + layer, d + layer);
        }
    }
    for i in 0..nx {
        let [a, b, c, d] = [at(i, 0), at(i + 1, 0), at(i, ny), at(i + 1, ny)];
        quad(a, b, b + layer, a + layer);
        quad(d, c, c + layer, d + layer);
    }
    for j in 0..ny {
        let [a, b, c, d] = [at(0, j), at(0, j + 1), at(nx, j), at(nx, j + 1)];
        quad(b, a, a + layer, b + layer);
        quad(c, d, d + layer, c + layer);
    }
    (vertices, triangles)
}

//! Guesses where a swept body meets the surfaces of a scene, from a grid that knows a point of the
//! surfaces near every place.
//!
//! Alternating projections: from a point of the body to a point of the surface near it, from there
//! to the nearest point of the body's box, and again. A few steps find most collisions in less time
//! than a tree takes to open its first nodes. A guess proves nothing: the caller tests the triangle
//! exactly, and only a search of the whole tree says that nothing is met.

use glam::{DVec3, UVec3, Vec3A};

/// Most cells of the grid: half a megabyte, which stays in the cache of a core.
const CELLS: u32 = 1 << 17;
/// Most cells along one direction.
const ALONG: f32 = 256.0;
/// Points that large triangles add to one for each triangle.
const EXTRA: f64 = 65536.0;
/// No point known yet.
const NONE: u32 = u32::MAX;

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seed {
    point: [f32; 3],
    /// Which surface.
    pub(crate) surface: u32,
    /// Which of its triangles.
    pub(crate) triangle: u32,
}

/// For every cell of a grid about some surfaces, a point of them near its middle.
#[derive(Debug)]
pub(crate) struct Nearby {
    low: Vec3A,
    /// Cells per metre.
    scale: f32,
    /// Largest index along each axis.
    last: Vec3A,
    stride: UVec3,
    /// Indices into `seeds`.
    cells: Vec<u32>,
    seeds: Vec<Seed>,
}

impl Nearby {
    /// Of triangles, each with its surface and its number there; `None` without any.
    pub(crate) fn new<I: Iterator<Item = (u32, u32, [DVec3; 3])>>(
        triangles: impl Fn() -> I,
    ) -> Option<Self> {
        let (mut low, mut high, mut area) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0);
        for (_, _, [a, b, c]) in triangles() {
            (low, high) = (low.min(a).min(b).min(c), high.max(a).max(b).max(c));
            area += (b - a).cross(c - a).length();
        }
        if !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let (origin, extent) = (low.as_vec3a(), (high - low).as_vec3a());
        let mut cell = (extent.max_element() / ALONG).max(f32::MIN_POSITIVE);
        let counts = |cell: f32| (extent / cell).floor().as_uvec3() + UVec3::ONE;
        while counts(cell).element_product() > CELLS {
            cell *= 1.05;
        }
        let counts = counts(cell);
        let mut grid = Self {
            low: origin,
            scale: cell.recip(),
            last: (counts - UVec3::ONE).as_vec3a(),
            stride: UVec3::new(1, counts.x, counts.x * counts.y),
            cells: vec![NONE; counts.element_product() as usize],
            seeds: Vec::new(),
        };
        let mut distances = vec![f32::INFINITY; grid.cells.len()];
        let per_piece = if area > 0.0 { EXTRA / area } else { 0.0 };
        for (surface, triangle, corners) in triangles() {
            let [a, b, c] = corners;
            // As many halvings as make a piece of each share of the area.
            let halvings = ((b - a).cross(c - a).length() * per_piece) as u32;
            pieces(
                corners,
                u32::BITS - halvings.leading_zeros(),
                f64::from(cell),
                &mut |middle: DVec3| {
                    let point = middle.as_vec3a();
                    let place = grid.place(point);
                    let (at, distance) = (
                        place.dot(grid.stride) as usize,
                        point.distance_squared(grid.middle(place)),
                    );
                    if distance < distances[at] {
                        let seed = Seed { point: point.to_array(), surface, triangle };
                        distances[at] = distance;
                        match grid.cells[at] {
                            NONE => {
                                grid.cells[at] = grid.seeds.len() as u32;
                                grid.seeds.push(seed);
                            }
                            known => grid.seeds[known as usize] = seed,
                        }
                    }
                },
            );
        }
        grid.spread(counts, &mut distances);
        Some(grid)
    }

    /// The cell of a point; the nearest one for a point outside.
    fn place(&self, point: Vec3A) -> UVec3 {
        ((point - self.low) * self.scale).clamp(Vec3A::ZERO, self.last).as_uvec3()
    }

    fn middle(&self, place: UVec3) -> Vec3A {
        self.low + (place.as_vec3a() + 0.5) / self.scale
    }

    /// Gives every cell the nearest of its neighbours' points, there and back (Danielsson 1980).
    fn spread(&mut self, counts: UVec3, distances: &mut [f32]) {
        let last = counts - UVec3::ONE;
        for back in [false, true] {
            let turned = |step: u32, last: u32| if back { last - step } else { step };
            for z in 0..counts.z {
                for y in 0..counts.y {
                    for x in 0..counts.x {
                        let place =
                            UVec3::new(turned(x, last.x), turned(y, last.y), turned(z, last.z));
                        let (at, middle) = (place.dot(self.stride) as usize, self.middle(place));
                        for (steps, stride) in
                            [(x, self.stride.x), (y, self.stride.y), (z, self.stride.z)]
                        {
                            if steps == 0 {
                                continue;
                            }
                            let seed = self.cells
                                [if back { at + stride as usize } else { at - stride as usize }];
                            if seed != NONE && seed != self.cells[at] {
                                let distance = Vec3A::from_array(self.seeds[seed as usize].point)
                                    .distance_squared(middle);
                                if distance < distances[at] {
                                    (distances[at], self.cells[at]) = (distance, seed);
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// A point of the surfaces near this one, and where it lies.
    pub(crate) fn nearest(&self, point: Vec3A) -> (&Seed, Vec3A) {
        let seed = &self.seeds[self.cells[self.place(point).dot(self.stride) as usize] as usize];
        (seed, Vec3A::from_array(seed.point))
    }

    /// Size of a cell \[m\].
    pub(crate) fn fineness(&self) -> f32 {
        self.scale.recip()
    }
}

/// Middles of the parts of a triangle whose longest edge is halved so often, or until it is as
/// short as `fine`.
fn pieces([a, b, c]: [DVec3; 3], halvings: u32, fine: f64, visit: &mut impl FnMut(DVec3)) {
    let edges = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
    let longest = edges[0].max(edges[1]).max(edges[2]);
    if halvings == 0 || longest <= fine * fine {
        return visit((a + b + c) / 3.0);
    }
    // Turned so that the longest edge is the first.
    let [a, b, c] = if longest == edges[0] {
        [a, b, c]
    } else if longest == edges[1] {
        [b, c, a]
    } else {
        [c, a, b]
    };
    let middle = (a + b) / 2.0;
    pieces([a, middle, c], halvings - 1, fine, visit);
    pieces([middle, b, c], halvings - 1, fine, visit);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(corners: &[[DVec3; 3]]) -> Option<Nearby> {
        Nearby::new(|| {
            corners.iter().enumerate().map(|(index, corners)| (7, index as u32, *corners))
        })
    }

    #[test]
    fn every_cell_knows_a_point_of_the_triangle_that_it_names() {
        let point =
            |k: f64| DVec3::new((k * 0.7).sin(), (k * 1.3).cos() * 0.4, (k * 2.1).sin() * 0.1);
        // A large triangle and many small ones; one alone; one without extent along an axis; one
        // that is a point.
        let many: Vec<[DVec3; 3]> = (0..500)
            .map(|k| [0.0, 0.1, 0.2].map(|step| point(f64::from(k) + step * f64::from(k % 9))))
            .collect();
        let sets = [
            many,
            vec![[DVec3::ZERO, DVec3::X, DVec3::new(0.3, 0.8, 0.1)]],
            vec![[DVec3::ZERO, DVec3::X, DVec3::Y]],
            vec![[DVec3::ONE; 3]],
        ];
        for corners in &sets {
            let grid = grid(corners).unwrap();
            for k in 0..2000 {
                let from = (point(f64::from(k) * 0.37) * 1.5).as_vec3a();
                let (seed, at) = grid.nearest(from);
                assert_eq!(seed.surface, 7);
                let [a, b, c] = corners[seed.triangle as usize];
                let normal = (b - a).cross(c - a);
                let off = (at.as_dvec3() - a).dot(normal.normalize_or_zero()).abs();
                assert!(
                    off < 1e-6 && at.as_dvec3().distance(a) < 3.0,
                    "{at} is {off} off triangle {}",
                    seed.triangle
                );
            }
        }
        assert!(grid(&[]).is_none());
    }

    #[test]
    fn points_on_the_surface_find_points_close_to_them() {
        let (a, b, c) =
            (DVec3::new(0.1, 0.0, 0.0), DVec3::new(0.9, 0.2, 0.3), DVec3::new(0.2, 0.7, 0.5));
        let grid = grid(&[[a, b, c]]).unwrap();
        for k in 0..1000 {
            let (u, v) = ((f64::from(k) * 0.618).fract(), (f64::from(k) * 0.414).fract());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let point = (a + (b - a) * u + (c - a) * v).as_vec3a();
            assert!(grid.nearest(point).1.distance(point) < 2.0 * grid.fineness(), "{point}");
        }
    }
}

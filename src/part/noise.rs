//! Noise that breaks planes up: a scan, or coordinates rounded coarsely. It is measured and told,
//! not smoothed away.

use glam::DVec3;
use nalgebra::{Matrix6, Vector6};
use rustc_hash::FxHashMap;

use super::given::GivenFaces;
use super::regions::{self, Flatness, Regions};
use super::repair::Repaired;
use super::topology::NONE;

/// Distance from a plane within which triangles are gathered again, as a share of the part's
/// diagonal; twice the uncertainty of a corner. Rougher surfaces crumble here too and are not told
/// from freely curved ones.
const WITHIN: f64 = 4e-3;
/// Share of the surface that must have crumbled. Measured: 42 clean parts up to 0.33 (a thread;
/// others 0.06); 13 with corners moved at random by 1e-3 of the diagonal 0.73 to 1.0. By 1e-5, for
/// which faces are grown with wider tolerances: up to 0.51.
const SHARE: f64 = 0.6;
/// Share of the surface that must have crumbled into what is noise for itself: where only a part of
/// the surface is noisy. Measured: 0 on 61 clean parts.
const PART: f64 = 0.01;
/// Correlation along edges of the corners' distances from the plane up to which they are noise: facets
/// of a curved surface lie off on the same side as their neighbours. Measured: noise up to 0.21, clean
/// parts with bends both ways 0.46 or more, but for threads.
const RANDOM: f64 = 0.3;
/// Root mean square of the distances as a share of what was gathered up to which they are noise: its
/// greatest distances are three times as large. Measured: threads 0.78 or more.
const GATHERED: f64 = 0.5;
/// Single triangles that show it.
const MANY: usize = 12;
/// Share of the bends that go the other way.
const BOTH: f64 = 0.2;
/// A tolerance that fits noise, in root mean squares: three times the greatest of even noise in all
/// coordinates.
const FITS: f64 = 5.0;
/// Triangles from which on the bend of what was gathered is taken off its distances: a strip of a round
/// face lies off its plane by more than its noise.
const BENT: usize = 60;
/// Share of the squared distances that rounding may leave.
const ROUNDING: f64 = 1e-9;
/// Angle up to which two triangles alone may be one broken plane: 2 degrees.
const BEND: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// What is seen of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// Share of the surface that lies in broken planes.
    pub share: f64,
    /// Root mean square distance of the surface's corners from those planes \[m\], the median over
    /// the area.
    pub distance: f64,
}

impl Noise {
    /// A tolerance with which planes can be fitted, rounded up to a plain number \[mm\].
    pub(super) fn tolerance(&self) -> f64 {
        let plain = FITS * self.distance * 1e3;
        let step = 10.0_f64.powf(plain.log10().floor());
        // A power of ten below one is no exact number, its inverse is.
        let rounded = (plain / step).ceil();
        if step < 1.0 { rounded / (1.0 / step).round() } else { rounded * step }
    }
}

/// Looks for planes that fell into single triangles when regions were grown as `fine` ones: patches
/// that a wide tolerance gathers, most of whose area lies in single triangles, bent both ways. A
/// tessellated cylinder falls into strips, and a sphere into triangles that are bent one way.
/// `is_smooth`: triangles of free form, which alone are not taken for noise.
pub(super) fn measure(
    part: &Repaired,
    given: &GivenFaces,
    fine: &Regions,
    is_smooth: &[bool],
) -> Option<Noise> {
    let single = |region: u32| fine.triangles(region as usize).len() == 1;
    let total: f64 = fine.all.iter().map(|region| region.area).sum();
    let alone: f64 = fine
        .all
        .iter()
        .zip(0..)
        .filter(|(_, index)| single(*index))
        .map(|(region, _)| region.area)
        .sum();
    if alone < PART * total {
        return None;
    }
    let coarse = regions::grow(
        part,
        given,
        Flatness { distance: WITHIN * part.diagonal, uncertainty: WITHIN / 2.0 * part.diagonal },
    );
    // Area and mean square distance of each broken plane, and of what is noise for itself.
    let mut broken: Vec<(f64, f64)> = Vec::new();
    let mut random: Vec<(f64, f64)> = Vec::new();
    for (index, region) in coarse.all.iter().enumerate() {
        let triangles = coarse.triangles(index);
        let (mut alone, mut squares, mut convex, mut concave, mut most) =
            (0.0, 0.0, 0.0, 0.0, 0.0_f64);
        let (mut singles, mut rough, mut products, mut own_squares) = (0, 0.0, 0.0, 0.0);
        let mut fragments: FxHashMap<u32, ()> = FxHashMap::default();
        for &triangle in triangles {
            let own = fine.of[triangle as usize];
            fragments.insert(own, ());
            let corners = part.mesh.corners(triangle);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a);
            let area = normal.length() / 2.0;
            let heights =
                corners.map(|corner| region.plane.normal.dot(corner) - region.plane.offset);
            if single(own) {
                alone += area;
            }
            if single(own) && !is_smooth[triangle as usize] {
                let [x, y, z] = heights;
                rough += area;
                singles += 1;
                products += x * y + y * z + z * x;
                own_squares += x * x + y * y + z * z;
            }
            squares += area * heights.iter().map(|height| height * height).sum::<f64>() / 3.0;
            for k in 0..3 {
                let twin = part.edges.twin[triangle as usize * 3 + k];
                if twin == NONE {
                    continue;
                }
                let other = twin / 3;
                // Each inner edge once, and only where the plane is broken.
                if other <= triangle
                    || coarse.of[other as usize] != index as u32
                    || fine.of[other as usize] == own
                {
                    continue;
                }
                let theirs = part.mesh.corners(other);
                let angle =
                    normal.angle_between((theirs[1] - theirs[0]).cross(theirs[2] - theirs[0]));
                let apex = theirs[(twin as usize % 3 + 2) % 3];
                let side = if normal.dot(apex - a) > 0.0 { &mut concave } else { &mut convex };
                *side += angle * corners[k].distance(corners[(k + 1) % 3]);
                most = most.max(angle);
            }
        }
        let both_ways = f64::min(convex, concave) > BOTH * (convex + concave);
        let is_broken = match fragments.len() {
            0 | 1 => false,
            // Of one edge nobody can tell which way it should bend.
            2 => triangles.len() == 2 && most < BEND,
            _ => both_ways && 2.0 * alone > region.area,
        };
        if is_broken {
            let straight = || {
                let mut bent = Bent::new(region.plane.normal, region.centre, region.area);
                let corners = triangles.iter().map(|&triangle| part.mesh.corners(triangle));
                corners.for_each(|corners| bent.add(corners));
                bent.left()
            };
            let left = if triangles.len() < BENT { None } else { straight() };
            broken.push((region.area, left.unwrap_or(squares) / region.area));
        }
        let square = own_squares / (3 * singles) as f64;
        if both_ways
            && singles >= MANY
            && products < RANDOM * own_squares
            && square.sqrt() < GATHERED * WITHIN * part.diagonal
        {
            random.push((rough, square));
        }
    }
    noise(&mut broken, SHARE * total, total).or_else(|| noise(&mut random, PART * total, total))
}

/// The surface of second degree over a region's plane that fits its corners by least squares.
struct Bent {
    origin: DVec3,
    /// Two in the plane and its normal.
    axes: [DVec3; 3],
    /// Unit of length \[m\].
    unit: f64,
    matrix: Matrix6<f64>,
    right: Vector6<f64>,
    squares: f64,
}

impl Bent {
    /// Over a plane with this normal, about a point, on some area.
    fn new(normal: DVec3, origin: DVec3, area: f64) -> Self {
        let (one, two) = normal.any_orthonormal_pair();
        Self {
            origin,
            axes: [one, two, normal],
            unit: area.sqrt(),
            matrix: Matrix6::zeros(),
            right: Vector6::zeros(),
            squares: 0.0,
        }
    }

    /// A triangle.
    fn add(&mut self, corners: [DVec3; 3]) {
        let [a, b, c] = corners;
        let weight = (b - a).cross(c - a).length() / 6.0;
        for corner in corners {
            let [x, y, height] = self.axes.map(|axis| axis.dot(corner - self.origin));
            let (x, y) = (x / self.unit, y / self.unit);
            let row = Vector6::new(1.0, x, y, x * x, x * y, y * y);
            self.matrix += weight * row * row.transpose();
            self.right += weight * height * row;
            self.squares += weight * height * height;
        }
    }

    /// What it leaves of the squared distances, summed over the area; `None` where the corners do not
    /// fix it.
    fn left(&self) -> Option<f64> {
        let found = self.matrix.cholesky()?.solve(&self.right);
        let left = self.squares - found.dot(&self.right);
        (left > ROUNDING * self.squares).then_some(left)
    }
}

/// Noise that shows on more than `least` of the area: areas with mean square distances.
fn noise(broken: &mut [(f64, f64)], least: f64, total: f64) -> Option<Noise> {
    let area: f64 = broken.iter().map(|plane| plane.0).sum();
    broken.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut below = 0.0;
    let median = broken.iter().find(|plane| {
        below += plane.0;
        2.0 * below >= area
    })?;
    (area > least).then(|| Noise { share: area / total, distance: median.1.sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of a cylinder leaves its noise, not its bend; a plain cylinder next to nothing.
    #[test]
    fn the_bend_of_a_strip_is_no_noise() {
        let (radius, half, long) = (0.02, 0.003, 0.05);
        let left = |noise: f64| {
            let height = |i: i32, j: i32| {
                let x = half * f64::from(i) / 8.0;
                // As random as it gets without a generator.
                let by = (f64::from(i * 31 + j * 17 + 5).sin() * 43_758.545_3).fract();
                let z = -0.5 * x * x / radius + noise * by;
                DVec3::new(x, long * f64::from(j) / 8.0, z)
            };
            let mut bent = Bent::new(DVec3::Z, DVec3::ZERO, 2.0 * half * long);
            for (i, j) in (-8..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
                let [a, b, c, d] =
                    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(k, l)| height(i + k, j + l));
                [[a, b, c], [a, c, d]].into_iter().for_each(|corners| bent.add(corners));
            }
            let area = 2.0 * half * long;
            (bent.left().map(|left| (left / area).sqrt()), (bent.squares / area).sqrt())
        };
        // Evenly between -1 and 1: the root of a third.
        let (found, plane) = left(1e-5);
        let share = found.unwrap() / (1e-5 / 3.0_f64.sqrt());
        assert!((0.85..1.1).contains(&share), "{share}");
        assert!(plane > 5.0 * found.unwrap(), "{plane} {found:?}");
        assert_eq!(left(0.0).0, None);
    }
}

//! Which planar regions are faces of their own, and which are facets of curved surfaces.

use super::borders::{Border, Borders};
use super::given::GivenFaces;
use super::regions::{Region, Regions};
use super::repair::Repaired;

/// Dihedral angle up to which two regions may be neighbouring facets of one curved surface: 25
/// degrees.
const SMOOTH: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// How much larger than a neighbour a facet of a curved surface may be.
const FACET_RATIO: f64 = 4.0;
/// Height of the arc over a facet, as a share of the part's diagonal, up to which it may belong to a
/// curved surface: more than a circle about the part has at 25 degrees a facet (0.8 %).
const ARC: f64 = 0.01;
/// Side of a square, as a share of the diagonal, below whose area a region with one such neighbour
/// is taken for a facet.
const SMALL: f64 = 0.02;
/// Share of the distance from a plane that corners may lie off it which those of the flattest spot
/// of a smooth surface use, at least: it ends where the tolerance does.
const SPOT: f64 = 0.25;
/// Angle between such a spot and the facets about it, at most: 1 degree.
const LEVEL: f64 = std::f64::consts::PI / 180.0;

/// Angle between the halves of a plane that noise has folded \[rad\]: 0.1 degrees.
const FOLD: f64 = 2e-3;
/// Share of the flat area that is folded from which on a mesh is rough.
const FOLDED: f64 = 0.01;

/// A neighbour under a small angle.
struct Smooth {
    region: usize,
    /// Length of the common boundary \[m\].
    shared: f64,
    /// Not 4 times smaller.
    comparable: bool,
}

/// Boundaries between regions and what follows from them.
pub(super) struct Facets {
    /// Common boundaries.
    pub borders: Borders,
    /// Whether each region is a facet of a curved surface.
    pub is_facet: Vec<bool>,
}

impl Facets {
    /// Sorts the regions. One counts as a facet of a curved surface when along a quarter of its
    /// boundary or more it meets at least two neighbours under less than 25 degrees, neither of
    /// them 4 times smaller: so do the strips of a tessellated cylinder, cone or fillet. For a
    /// region smaller than a square of 2 % of the part's diagonal one such neighbour is enough. The
    /// flat between two fillets is far larger than their strips and stays; nut flats and chamfers
    /// meet their neighbours under larger angles and stay, and so do the flats of a sheet bent by
    /// little: three of a kind in a row that goes no further, or so wide that the arc over one would
    /// rise by more than 1 % of the part's diagonal. Where a mesh leaves it open (the
    /// outermost strip of a gear's flank) the region stays: a flat too many costs a few candidates,
    /// a flat too few loses grips. What the file states is not asked.
    pub(super) fn new(part: &Repaired, given: &GivenFaces, regions: &Regions) -> Self {
        let count = regions.all.len();
        let borders = Borders::new(part, regions);
        let mut facets = Self { borders, is_facet: Vec::new() };
        let smooth: Vec<Vec<Smooth>> =
            (0..count).map(|index| facets.smooth(&regions.all, index, part.diagonal)).collect();
        let small = (SMALL * part.diagonal).powi(2);
        facets.is_facet = (0..count)
            .map(|index| {
                if let Some(face) = given.face(regions.triangles(index)[0]) {
                    return !face.is_plane();
                }
                let long = 0.25 * facets.borders.perimeter[index];
                let total: f64 = smooth[index].iter().map(|other| other.shared).sum();
                let comparable: Vec<&Smooth> =
                    smooth[index].iter().filter(|other| other.comparable).collect();
                let along: f64 = comparable.iter().map(|other| other.shared).sum();
                let is_small = regions.all[index].area < small;
                // The middle one of three.
                let ends = |other: &&Smooth| {
                    let mut beyond = smooth[other.region].iter().filter(|next| next.comparable);
                    beyond.all(|next| next.region == index)
                        && smooth[other.region].iter().any(|n| n.region == index && n.comparable)
                };
                let three = comparable.len() == 2 && !is_small && comparable.iter().all(ends);
                (comparable.len() >= 2 && along >= long && !three)
                    || (!comparable.is_empty() && total >= long && is_small)
            })
            .collect();
        facets
    }

    /// Whether a region lies among facets that are nearly level with it and ends only where its
    /// corners would lie more than `distance` \[m\] off its plane, as the flattest spot of a smooth
    /// surface does, which is no plane.
    pub(super) fn is_spot(
        &self,
        part: &Repaired,
        regions: &Regions,
        index: usize,
        distance: f64,
    ) -> bool {
        let plane = &regions.all[index].plane;
        let is_level = |border: &Border| {
            let other = &regions.all[border.other as usize].plane;
            plane.normal.angle_between(other.normal) < LEVEL
        };
        let is_off = |&triangle: &u32| {
            let corners = part.mesh.corners(triangle);
            corners.iter().any(|&corner| plane.distance(corner) > SPOT * distance)
        };
        self.borders.of(index).iter().all(is_level) && regions.triangles(index).iter().any(is_off)
    }

    /// Neighbours with which a region may lie on one curved surface.
    fn smooth(&self, regions: &[Region], index: usize, diagonal: f64) -> Vec<Smooth> {
        let region = &regions[index];
        let neighbours = self.borders.of(index).iter().filter_map(|border| {
            let (neighbour, shared) = (border.other, border.length);
            let other = &regions[neighbour as usize];
            let angle = region.plane.normal.angle_between(other.plane.normal);
            // Of a strip as wide as its area over the shared edge.
            let arc = region.area / shared / 2.0 * (angle / 4.0).tan();
            (angle <= SMOOTH && arc <= ARC * diagonal).then_some(Smooth {
                region: neighbour as usize,
                shared,
                comparable: region.area <= FACET_RATIO * other.area,
            })
        });
        neighbours.collect()
    }

    /// Whether flat faces have crumbled because the mesh is rougher than the growth allowed for:
    /// next to them lie fragments that a distance `within` \[m\] would take in, and these stick out
    /// on both sides. The first strips of a finely tessellated fillet lie on one side, and so do
    /// not count. Where `is_rounded` the file's own rounding is known to be as coarse: then halves of planes
    /// that all bend the same way count as well.
    pub(super) fn are_rough(
        &self,
        part: &Repaired,
        regions: &Regions,
        within: f64,
        is_rounded: bool,
    ) -> bool {
        let (mut flat, mut above, mut below) = (0.0, 0.0, 0.0);
        for (index, region) in regions.all.iter().enumerate() {
            if !self.is_facet[index] {
                flat += region.area;
            }
            // Sum of the deviations of the fragment's corners from the face, None where one is too
            // far.
            let deviation = |face: &Region| {
                let mut corners = regions
                    .triangles(index)
                    .iter()
                    .flat_map(|&triangle| part.mesh.corners(triangle));
                corners.try_fold(0.0, |sum, corner| {
                    let height = face.plane.normal.dot(corner) - face.plane.offset;
                    (height.abs() < within).then_some(sum + height)
                })
            };
            let near = self.borders.of(index).iter().find_map(|&Border { other, .. }| {
                let face = &regions.all[other as usize];
                let is_face = face.area >= 10.0 * region.area && !self.is_facet[other as usize];
                if is_face && region.plane.normal.angle_between(face.plane.normal) < 0.2 {
                    deviation(face)
                } else {
                    None
                }
            });
            match near {
                Some(height) if height > 0.0 => above += region.area,
                Some(_) => below += region.area,
                None => {}
            }
        }
        let [convex, concave] = self.folds(part, regions, within);
        let both_ways = convex.min(concave) > FOLDED / 10.0 * flat;
        if convex + concave > FOLDED * flat && (is_rounded || both_ways) {
            return true;
        }
        // Measured: clean tessellations stay below 3.0e-3 in all or have nothing on one side;
        // corners moved at random by 1e-5 of the diagonal give 3.5e-3 to 4e-2. A wrong guess only
        // widens tolerances that are narrow either way.
        above + below > 3.2e-3 * flat && above.min(below) > 2e-4 * flat
    }

    /// Area of flat regions of much the same size that `within` \[m\] would join, by the way in which
    /// they are folded: a plane of two triangles whose corners lie off it falls into halves, which
    /// no part has that bend both ways.
    fn folds(&self, part: &Repaired, regions: &Regions, within: f64) -> [f64; 2] {
        let mut folds = [0.0; 2];
        for (index, region) in regions.all.iter().enumerate() {
            if self.is_facet[index] {
                continue;
            }
            for &Border { other, .. } in self.borders.of(index) {
                let face = &regions.all[other as usize];
                let is_pair = (region.area, index) < (face.area, other as usize)
                    && face.area < 10.0 * region.area
                    && !self.is_facet[other as usize]
                    && region.plane.normal.angle_between(face.plane.normal) < FOLD;
                if !is_pair {
                    continue;
                }
                let heights = || {
                    let triangles = regions.triangles(index).iter();
                    triangles
                        .flat_map(|&triangle| part.mesh.corners(triangle))
                        .map(|corner| face.plane.normal.dot(corner) - face.plane.offset)
                };
                if heights().all(|height| height.abs() < within) {
                    folds[usize::from(heights().sum::<f64>() > 0.0)] += region.area;
                }
            }
        }
        folds
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use crate::part::Part;

    /// A sheet of 3 mm, 40 mm deep, of flats of 40 mm with a bend after each.
    fn sheet(flats: usize, bend: f64) -> Part {
        let directions: Vec<DVec2> =
            (0..flats).map(|k| DVec2::from_angle(bend * (k as f64 + 0.3))).collect();
        let mut inner = vec![DVec2::ZERO];
        for direction in &directions {
            inner.push(inner[inner.len() - 1] + *direction * 0.04);
        }
        let outer: Vec<DVec2> = (0..=flats)
            .map(|k| {
                let (a, b) = (directions[k.max(1) - 1], directions[k.min(flats - 1)]);
                let across = (a + b).normalize().perp();
                inner[k] - across * (0.003 / across.dot(a.perp()))
            })
            .collect();
        let count = (flats + 1) as u32;
        let mut vertices = Vec::new();
        for depth in [0.0, 0.04] {
            vertices.extend(inner.iter().chain(&outer).map(|point| point.extend(depth)));
        }
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        let mut quad = |a: u32, b: u32, c: u32, d: u32| triangles.extend([[a, b, c], [a, c, d]]);
        let back = 2 * count;
        for k in 0..flats as u32 {
            quad(k, k + 1, count + k + 1, count + k);
            quad(back + k, back + count + k, back + count + k + 1, back + k + 1);
            quad(k, back + k, back + k + 1, k + 1);
            quad(count + k, count + k + 1, back + count + k + 1, back + count + k);
        }
        quad(0, count, back + count, back);
        let last = flats as u32;
        quad(last, back + last, back + count + last, count + last);
        let part = Part::from_triangles("sheet", &vertices, &triangles).unwrap();
        assert!(part.health.watertight, "{:?}", part.health);
        part
    }

    #[test]
    fn flats_of_a_bent_sheet_are_faces_at_any_bend() {
        for degrees in [1.0_f64, 2.0, 5.0, 10.0, 20.0, 24.0, 26.0, 40.0] {
            let faces = sheet(3, degrees.to_radians()).faces.len();
            assert_eq!(faces, 10, "{degrees}");
        }
    }

    #[test]
    fn strips_of_cylinders_are_no_faces() {
        for count in [16_u32, 24, 36, 90] {
            let step = std::f64::consts::TAU / f64::from(count);
            let ring = |z: f64| {
                (0..count).map(move |k| (DVec2::from_angle(f64::from(k) * step) * 0.02).extend(z))
            };
            let vertices: Vec<DVec3> = ring(0.0).chain(ring(0.03)).collect();
            let mut triangles: Vec<[u32; 3]> = Vec::new();
            for k in 0..count {
                let next = (k + 1) % count;
                triangles.extend([[k, next, count + next], [k, count + next, count + k]]);
            }
            for k in 1..count - 1 {
                triangles.extend([[0, k + 1, k], [count, count + k, count + k + 1]]);
            }
            let part = Part::from_triangles("cylinder", &vertices, &triangles).unwrap();
            assert_eq!(part.faces.len(), 2, "{count}");
        }
    }

    /// A superellipsoid of the fourth degree, from an octahedron whose edges are cut into `count`.
    fn superellipsoid(count: u32) -> Part {
        let at = |a: DVec3, b: DVec3, c: DVec3, i: u32, j: u32| {
            let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(count));
            let ray =
                ((a + u * (b - a) + v * (c - a)).normalize()) / DVec3::new(0.014, 0.018, 0.025);
            let powers = (ray * ray) * (ray * ray);
            ray * DVec3::new(0.014, 0.018, 0.025) / powers.element_sum().powf(0.25)
        };
        let mut vertices: Vec<DVec3> = Vec::new();
        for signs in 0..8 {
            let sign = |bit: u32| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let (a, mut b, mut c) = (DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2));
            if sign(0) * sign(1) * sign(2) < 0.0 {
                std::mem::swap(&mut b, &mut c);
            }
            for i in 0..count {
                for j in 0..count - i {
                    vertices
                        .extend([(i, j), (i + 1, j), (i, j + 1)].map(|(i, j)| at(a, b, c, i, j)));
                    if i + j + 1 < count {
                        let corners = [(i + 1, j), (i + 1, j + 1), (i, j + 1)];
                        vertices.extend(corners.map(|(i, j)| at(a, b, c, i, j)));
                    }
                }
            }
        }
        let triangles: Vec<[u32; 3]> =
            (0..vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let part = Part::from_triangles("superellipsoid", &vertices, &triangles).unwrap();
        assert!(part.health.watertight, "{:?}", part.health);
        part
    }

    /// About the poles some facets lie in one plane within the tolerance.
    #[test]
    fn the_flattest_spots_of_free_form_are_no_planes() {
        for count in [24, 32, 40, 50] {
            let part = superellipsoid(count);
            let planes: Vec<f64> = part.faces.iter().map(|face| face.area).collect();
            assert_eq!((planes.len(), part.curved.len()), (0, 1), "{count} {planes:?}");
        }
    }
}

//! Which planar regions are faces of their own, and which are facets of curved surfaces.

use rustc_hash::FxHashMap;

use super::regions::{Region, Regions};
use super::repair::Repaired;
use super::topology::NONE;

/// Dihedral angle up to which two regions may be neighbouring facets of one curved surface: 25
/// degrees.
const SMOOTH: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// How much larger than a neighbour a facet of a curved surface may be.
const FACET_RATIO: f64 = 4.0;
/// Side of a square, as a share of the diagonal, below whose area a region with one such neighbour
/// is taken for a facet.
const SMALL: f64 = 0.02;

/// Boundaries between regions and what follows from them.
pub(super) struct Facets {
    /// Length of each region's boundary [m].
    pub perimeter: Vec<f64>,
    /// Whether each region is a facet of a curved surface.
    pub is_facet: Vec<bool>,
    /// Per region its neighbours and the length shared with each.
    shared: Vec<FxHashMap<u32, f64>>,
}

impl Facets {
    /// Sorts the regions. One counts as a facet of a curved surface when along a quarter of its
    /// boundary or more it meets at least two neighbours under less than 25 degrees, neither of
    /// them 4 times smaller: so do the strips of a tessellated cylinder, cone or fillet. For a
    /// region smaller than a square of 2 % of the part's diagonal one such neighbour is enough. The
    /// flat between two fillets is far larger than their strips and stays; nut flats and chamfers
    /// meet their neighbours under larger angles and stay. Where a mesh leaves it open (the
    /// outermost strip of a gear's flank) the region stays: a flat too many costs a few candidates,
    /// a flat too few loses grips.
    pub(super) fn new(part: &Repaired, regions: &Regions) -> Self {
        let count = regions.all.len();
        let mut perimeter = vec![0.0; count];
        let mut shared = vec![FxHashMap::default(); count];
        for index in 0..count {
            for &triangle in regions.triangles(index) {
                for k in 0..3 {
                    let twin = part.edges.twin[(triangle * 3 + k) as usize];
                    let other = if twin == NONE { NONE } else { regions.of[(twin / 3) as usize] };
                    if other == index as u32 {
                        continue;
                    }
                    let corners = part.mesh.corners(triangle);
                    let length = corners[k as usize].distance(corners[(k as usize + 1) % 3]);
                    perimeter[index] += length;
                    if other != NONE {
                        *shared[index].entry(other).or_insert(0.0) += length;
                    }
                }
            }
        }
        let small = (SMALL * part.diagonal).powi(2);
        let mut facets = Self { perimeter, is_facet: Vec::new(), shared };
        facets.is_facet =
            (0..count).map(|index| facets.curved(&regions.all, index, small)).collect();
        facets
    }

    fn curved(&self, regions: &[Region], index: usize, small: f64) -> bool {
        let region = &regions[index];
        let (mut count, mut smooth, mut comparable) = (0, 0.0, 0.0);
        for (&neighbour, &shared) in &self.shared[index] {
            let other = &regions[neighbour as usize];
            if region.plane.normal.angle_between(other.plane.normal) <= SMOOTH {
                smooth += shared;
                if region.area <= FACET_RATIO * other.area {
                    count += 1;
                    comparable += shared;
                }
            }
        }
        let long = 0.25 * self.perimeter[index];
        (count >= 2 && comparable >= long) || (count >= 1 && smooth >= long && region.area < small)
    }

    /// Whether flat faces have crumbled because the mesh is rougher than the growth allowed for:
    /// next to them lie fragments that a distance `within` [m] would take in, and these stick out
    /// on both sides. The first strips of a finely tessellated fillet lie on one side, and so do
    /// not count.
    pub(super) fn are_rough(&self, part: &Repaired, regions: &Regions, within: f64) -> bool {
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
            let near = self.shared[index].keys().find_map(|&other| {
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
        // Measured: clean tessellations stay below 3.0e-3 in all or have nothing on one side;
        // corners moved at random by 1e-5 of the diagonal give 3.5e-3 to 4e-2. A wrong guess only
        // widens tolerances that are narrow either way.
        above + below > 3.2e-3 * flat && above.min(below) > 2e-4 * flat
    }
}

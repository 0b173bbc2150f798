//! Common boundaries of planar regions.

use super::regions::Regions;
use super::repair::Repaired;
use super::topology::NONE;

/// What a region shares with a neighbour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Border {
    /// The neighbouring region.
    pub other: u32,
    /// Length of the common boundary \[m\].
    pub length: f64,
}

/// The borders of all regions.
pub(super) struct Borders {
    starts: Vec<usize>,
    all: Vec<Border>,
    /// Length of each region's boundary \[m\], open edges counted.
    pub perimeter: Vec<f64>,
}

impl Borders {
    pub(super) fn new(part: &Repaired, regions: &Regions) -> Self {
        let count = regions.all.len();
        let mut starts = Vec::with_capacity(count + 1);
        let mut all: Vec<Border> = Vec::with_capacity(4 * count);
        let mut perimeter = vec![0.0; count];
        let mut own: Vec<Border> = Vec::new();
        for (index, perimeter) in perimeter.iter_mut().enumerate() {
            starts.push(all.len());
            own.clear();
            for &triangle in regions.triangles(index) {
                for k in 0..3 {
                    let twin = part.edges.twin[(triangle * 3 + k) as usize];
                    let other = if twin == NONE { NONE } else { regions.of[(twin / 3) as usize] };
                    if other == index as u32 {
                        continue;
                    }
                    let corners = part.mesh.corners(triangle);
                    let length = corners[k as usize].distance(corners[(k as usize + 1) % 3]);
                    *perimeter += length;
                    if other != NONE {
                        own.push(Border { other, length });
                    }
                }
            }
            own.sort_by_key(|border| border.other);
            for group in own.chunk_by(|a, b| a.other == b.other) {
                let length = group.iter().fold(0.0, |sum, border| sum + border.length);
                all.push(Border { other: group[0].other, length });
            }
        }
        starts.push(all.len());
        Self { starts, all, perimeter }
    }

    /// The borders of a region, by their neighbours' numbers.
    pub(super) fn of(&self, index: usize) -> &[Border] {
        &self.all[self.starts[index]..self.starts[index + 1]]
    }
}

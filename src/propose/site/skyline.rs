//! What of the part stands above a place on which a pad is to come down.

use glam::{DMat3, DVec2, DVec3};
use rustc_hash::FxHashMap;

/// Cells across half a pad.
const CELLS: f64 = 4.0;
/// Sectors around a place.
const SECTORS: u32 = 12;

/// The highest and the lowest corner of the part's mesh in each cell of a grid across a direction.
pub(super) struct Skyline {
    cells: FxHashMap<[i32; 2], [DVec3; 2]>,
    /// Half of the pads' shorter side \[m\].
    half: f64,
}

impl Skyline {
    pub(super) fn new(vertices: &[DVec3], axes_from_part: &DMat3, half: f64) -> Self {
        let mut skyline = Self { cells: FxHashMap::default(), half };
        for &vertex in vertices {
            let point = *axes_from_part * vertex;
            let [top, bottom] =
                skyline.cells.entry(skyline.cell(point.truncate())).or_insert([point; 2]);
            if point.z > top.z {
                *top = point;
            }
            if point.z < bottom.z {
                *bottom = point;
            }
        }
        skyline
    }

    fn cell(&self, place: DVec2) -> [i32; 2] {
        (place * (CELLS / self.half)).floor().as_ivec2().to_array()
    }

    /// Whether corners of the part rise above the first of the `heights`, or lie below the second,
    /// wherever rectangular pads may lie that cover `at` (in the direction's axes). Such a pad holds
    /// a quarter of a disc about it with half its shorter side, and so two neighbouring sectors of
    /// twelve.
    pub(super) fn buries(&self, at: DVec2, [high, low]: [f64; 2]) -> bool {
        let ([left, near], [right, far]) = (self.cell(at - self.half), self.cell(at + self.half));
        let mut blocked = [false; SECTORS as usize];
        for x in left..=right {
            for y in near..=far {
                let Some([top, bottom]) = self.cells.get(&[x, y]) else { continue };
                let over = [top].into_iter().filter(|point| point.z > high);
                for point in over.chain([bottom].into_iter().filter(|point| point.z < low)) {
                    let away = point.truncate() - at;
                    if away.length() < self.half {
                        let turn = away.to_angle() / std::f64::consts::TAU + 0.5;
                        let sector = (turn * f64::from(SECTORS)) as usize;
                        blocked[sector.min(blocked.len() - 1)] = true;
                    }
                }
            }
        }
        (0..blocked.len()).all(|k| blocked[k] || blocked[(k + 1) % blocked.len()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_in_a_well_is_buried_and_one_beside_a_wall_is_not() {
        let wall = |from: f64, to: f64| -> Vec<DVec3> {
            (0..200)
                .map(|k| from + (to - from) * f64::from(k) / 200.0)
                .map(|turn| (0.6 * DVec2::from_angle(turn)).extend(1.0))
                .collect()
        };
        let turn = std::f64::consts::TAU;
        let buried = |vertices: &[DVec3]| {
            Skyline::new(vertices, &DMat3::IDENTITY, 1.0).buries(DVec2::ZERO, [0.01, -0.01])
        };
        assert!(buried(&wall(0.0, turn)));
        assert!(buried(&wall(0.0, 0.9 * turn)));
        assert!(!buried(&wall(0.0, 0.5 * turn)));
        // One half above, the other below.
        let mut both = wall(0.0, 0.5 * turn);
        both.extend(wall(0.5 * turn, turn).iter().map(|point| *point * DVec3::new(1.0, 1.0, -1.0)));
        assert!(buried(&both));
        let level: Vec<DVec3> = both.iter().map(|point| point.truncate().extend(0.0)).collect();
        assert!(!buried(&level));
        // Too far away for the pad.
        let far: Vec<DVec3> =
            wall(0.0, turn).iter().map(|p| *p * DVec3::new(2.0, 2.0, 1.0)).collect();
        assert!(!buried(&far));
    }
}

//! Grips that a turn of a round part maps to each other.

use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::part::Symmetry;
use crate::results::RankedGrip;

/// Lengths that differ by less are one \[m\]: what a tessellation makes of a round face differs from
/// angle to angle.
const SAME_LENGTH: f64 = 2e-5;
/// Directions that differ by less are one.
const SAME_DIRECTION: f64 = 1e-3;
/// Side of the cells in which grips look for their like \[m\].
const CELL: f64 = 4.0 * SAME_LENGTH;

/// What no turn changes: the axis as the gripper sees it.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// Negative from inside \[m\].
    width: f64,
    /// Along the axis, in the grip frame; zero for a ball.
    direction: DVec3,
    /// A fixed point of it in the grip frame \[m\].
    point: DVec3,
}

impl Seen {
    fn new(ranked: &RankedGrip, symmetry: &Symmetry) -> Self {
        let grip = &ranked.grip;
        let frame = &grip.part_from_grip;
        let (direction, point) = match *symmetry {
            Symmetry::Axis { axis } => {
                (frame.rotation.transpose() * axis.direction, frame.point_inverse(axis.origin))
            }
            Symmetry::Point { centre } => (DVec3::ZERO, frame.point_inverse(centre)),
        };
        let width = if grip.inside { -grip.width } else { grip.width };
        Self { width, direction, point }
    }

    /// With the jaws exchanged.
    fn exchanged(&self) -> Self {
        let turned = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
        Self { direction: turned(self.direction), point: turned(self.point), width: self.width }
    }

    fn is(&self, other: &Self) -> bool {
        (self.width - other.width).abs() <= SAME_LENGTH
            && (self.direction - other.direction).length() <= SAME_DIRECTION
            && (self.point - other.point).length() <= SAME_LENGTH
    }

    /// Neither exchanging the jaws nor a turn changes it.
    fn cell(&self) -> [i64; 2] {
        [self.width, self.point.x].map(|length| (length / CELL).floor() as i64)
    }
}

/// Sorts grips of a round part by what a turn leaves of them.
pub(super) struct Turns {
    symmetry: Symmetry,
    /// Whether exchanging the jaws changes nothing.
    alike: bool,
    cells: FxHashMap<[i64; 2], Vec<(Seen, usize)>>,
    count: usize,
}

impl Turns {
    pub(super) fn new(symmetry: Symmetry, alike: bool) -> Self {
        Self { symmetry, alike, cells: FxHashMap::default(), count: 0 }
    }

    /// The family of the next grip, by its number; a new one has the next number.
    pub(super) fn take(&mut self, grip: &RankedGrip) -> usize {
        let seen = Seen::new(grip, &self.symmetry);
        let exchanged = seen.exchanged();
        let [w, x] = seen.cell();
        let near = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [w + i, x + j]));
        for (other, family) in near.filter_map(|cell| self.cells.get(&cell)).flatten() {
            if seen.is(other) || self.alike && exchanged.is(other) {
                return *family;
            }
        }
        self.cells.entry([w, x]).or_default().push((seen, self.count));
        self.count += 1;
        self.count - 1
    }
}

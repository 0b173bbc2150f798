//! Which of many positions of a gripper, at one angle, are free of the part.
//!
//! Positions of one face pair at one angle differ by a shift in the pad plane only. They are split
//! into blocks, and a sweep is tested against the part for a whole block at once: where the union
//! of its shifted boxes holds nothing, all are free; where a vertex of the part lies in all of
//! them, all are blocked. Only blocks across the border between the two are split further, down to
//! single positions with exact tests, and each block hands its halves the few tree nodes that are
//! near. The cost follows the border, not the number of positions, and hardly the number of
//! triangles.

use glam::{DVec2, DVec3};

use crate::clash::{Sweep, Tree};

/// The part as seen from the grip axes at one angle: tree axes turned by the angle about the
/// closing axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a> {
    tree: &'a Tree,
    /// Direction of the grip's `x1` in the tree's `(x, y)`.
    direction: DVec2,
    /// Height of the grip's middle plane in tree axes.
    height: f64,
}

/// Shape of a query: a box in grip axes that all positions of a block lie in, and one that lies in
/// all.
struct Window {
    middle: DVec3,
    half: DVec3,
    inner_low: DVec3,
    inner_high: DVec3,
}

/// What the tree says about a block.
enum Found {
    Nothing,
    Blocked,
    /// These nodes are near.
    Near(usize),
}

impl<'a> View<'a> {
    pub(super) fn new(tree: &'a Tree, direction: DVec2, height: f64) -> Self {
        Self { tree, direction, height }
    }

    /// A point of the tree's `(x, y)` in grip axes (about the tree's origin).
    pub(super) fn turned(&self, point: DVec2) -> DVec2 {
        DVec2::new(self.direction.dot(point), self.direction.perp_dot(point))
    }

    fn grip_axes(&self, point: DVec3) -> DVec3 {
        self.turned(point.truncate()).extend(point.z - self.height)
    }

    /// Marks in `blocked` the positions, given in grip axes, at which the sweep meets the part.
    /// `chosen` lists the positions in question; it is reordered.
    pub(super) fn test(
        &self,
        sweep: &Sweep,
        positions: &[DVec2],
        chosen: &mut [u32],
        blocked: &mut [bool],
    ) {
        if chosen.is_empty() || self.tree.is_empty() {
            return;
        }
        let mut front = vec![0];
        self.block(sweep, positions, chosen, blocked, &mut front, 0);
    }

    fn block(
        &self,
        sweep: &Sweep,
        positions: &[DVec2],
        chosen: &mut [u32],
        blocked: &mut [bool],
        front: &mut Vec<u32>,
        start: usize,
    ) {
        let (low, high) =
            chosen.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &index| {
                let position = positions[index as usize];
                (low.min(position), high.max(position))
            });
        let end = front.len();
        if let [index] = chosen {
            let position = positions[*index as usize];
            let window = window(sweep, position, position);
            blocked[*index as usize] =
                (start..end).any(|node| self.meets(sweep, position, &window, front[node]));
            return;
        }
        let found = self.narrow(sweep, &window(sweep, low, high), front, start);
        match found {
            Found::Nothing => {}
            Found::Blocked => chosen.iter().for_each(|&index| blocked[index as usize] = true),
            Found::Near(count) => {
                let axis = usize::from(high.y - low.y > high.x - low.x);
                let half = chosen.len() / 2;
                chosen.select_nth_unstable_by(half, |&a, &b| {
                    positions[a as usize][axis]
                        .total_cmp(&positions[b as usize][axis])
                        .then(a.cmp(&b))
                });
                let (left, right) = chosen.split_at_mut(half);
                debug_assert_eq!(front.len(), end + count);
                self.block(sweep, positions, left, blocked, front, end);
                self.block(sweep, positions, right, blocked, front, end);
            }
        }
        front.truncate(end);
    }

    /// Appends to `front` the nodes under `front[start..]` that the outer box meets, split down to
    /// a size that suits it.
    fn narrow(&self, sweep: &Sweep, window: &Window, front: &mut Vec<u32>, start: usize) -> Found {
        let end = front.len();
        // Nodes much smaller than the window tell the halves nothing more.
        let fine = window.half.truncate().min_element() * 0.25;
        for index in start..end {
            let base = front.len();
            front.push(front[index]);
            // `front[base..]` serves as the stack; kept nodes are moved below `keep`.
            let mut keep = base;
            while front.len() > keep {
                let Some(node) = front.pop() else { break };
                let (middle, half) = self.tree.bounds(node);
                if !self.overlaps(window, middle, half) {
                    continue;
                }
                if sweep.is_box() && inside(window, self.grip_axes(self.tree.witness(node))) {
                    return Found::Blocked;
                }
                match self.tree.children(node) {
                    Some(children) if half.max_element() > fine => front.extend(children),
                    _ => {
                        front.push(node);
                        let last = front.len() - 1;
                        front.swap(keep, last);
                        keep += 1;
                    }
                }
            }
        }
        if front.len() == end { Found::Nothing } else { Found::Near(front.len() - end) }
    }

    /// Exact test of one position against the triangles under `node`.
    fn meets(&self, sweep: &Sweep, position: DVec2, window: &Window, node: u32) -> bool {
        let (middle, half) = self.tree.bounds(node);
        if !self.overlaps(window, middle, half) {
            return false;
        }
        if sweep.is_box() && inside(window, self.grip_axes(self.tree.witness(node))) {
            return true;
        }
        match self.tree.children(node) {
            Some([left, right]) => {
                self.meets(sweep, position, window, left)
                    || self.meets(sweep, position, window, right)
            }
            None => self
                .tree
                .triangles(node)
                .any(|(_, corners)| sweep.meets(self.local(corners, position))),
        }
    }

    /// Corners in the grip frame of the grip at `position`.
    fn local(&self, [a, b, c]: [DVec3; 3], position: DVec2) -> [DVec3; 3] {
        let position = position.extend(0.0);
        let [a, b, c] = [self.grip_axes(a), self.grip_axes(b), self.grip_axes(c)];
        [a - position, b - position, c - position]
    }

    /// The first triangle, by mesh index, that the sweep meets at `position`, with its corners in
    /// the grip frame.
    pub(super) fn first_met(&self, sweep: &Sweep, position: DVec2) -> Option<(u32, [DVec3; 3])> {
        let mut first: Option<(u32, [DVec3; 3])> = None;
        self.each_met(sweep, position, &mut |index, corners| {
            if first.is_none_or(|(best, _)| index < best) {
                first = Some((index, corners));
            }
        });
        first
    }

    /// Visits every triangle that the sweep meets at `position`: its mesh index, and its corners in
    /// the grip frame.
    pub(super) fn each_met(
        &self,
        sweep: &Sweep,
        position: DVec2,
        visit: &mut dyn FnMut(u32, [DVec3; 3]),
    ) {
        let window = window(sweep, position, position);
        let mut stack = if self.tree.is_empty() { Vec::new() } else { vec![0] };
        while let Some(node) = stack.pop() {
            let (middle, half) = self.tree.bounds(node);
            if !self.overlaps(&window, middle, half) {
                continue;
            }
            match self.tree.children(node) {
                Some(children) => stack.extend(children),
                None => {
                    for (index, corners) in self.tree.triangles(node) {
                        let corners = self.local(corners, position);
                        if sweep.meets(corners) {
                            visit(index, corners);
                        }
                    }
                }
            }
        }
    }

    /// Separating axes of a node's box (tree axes) and the window's outer box (grip axes); both
    /// share the third axis, so that these five are all there are.
    fn overlaps(&self, window: &Window, middle: DVec3, half: DVec3) -> bool {
        let height = middle.z - self.height - window.middle.z;
        if height.abs() > half.z + window.half.z {
            return false;
        }
        let (c, s) = (self.direction.x.abs(), self.direction.y.abs());
        let apart = self.turned(middle.truncate()) - window.middle.truncate();
        if apart.x.abs() > window.half.x + c * half.x + s * half.y
            || apart.y.abs() > window.half.y + s * half.x + c * half.y
        {
            return false;
        }
        // The same difference in tree axes.
        let apart = DVec2::new(
            self.direction.x * apart.x - self.direction.y * apart.y,
            self.direction.y * apart.x + self.direction.x * apart.y,
        );
        apart.x.abs() <= half.x + c * window.half.x + s * window.half.y
            && apart.y.abs() <= half.y + s * window.half.x + c * window.half.y
    }
}

fn window(sweep: &Sweep, low: DVec2, high: DVec2) -> Window {
    let (outer_low, outer_high) = (sweep.low + low.extend(0.0), sweep.high + high.extend(0.0));
    Window {
        middle: (outer_low + outer_high) / 2.0,
        half: (outer_high - outer_low) / 2.0,
        inner_low: sweep.low + high.extend(0.0),
        inner_high: sweep.high + low.extend(0.0),
    }
}

/// Whether the point lies in the boxes of all positions of the block.
fn inside(window: &Window, point: DVec3) -> bool {
    point.cmpgt(window.inner_low).all() && point.cmplt(window.inner_high).all()
}

//! Triangles as they come from a reader, joined at equal corners.

use glam::DVec3;
use rayon::prelude::*;

use super::given::Given;
#[cfg(feature = "step")]
use super::given::Stated;
use crate::units::Unit;

/// Triangles of a file in the file's own unit, corners with equal coordinates shared.
#[derive(Debug, Default)]
pub(super) struct Soup {
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Triangles of the file, counting those without area that were left out.
    pub read: usize,
    /// The file's own unit, where it states one.
    pub unit: Option<Unit>,
    /// What the reader noticed.
    pub warnings: Vec<String>,
    /// The faces that the file states; empty for a format of triangles.
    pub given: Given,
}

/// Most triangles that are taken: half-edge numbers (three a triangle) must fit 32 bits with room
/// for repairs.
pub(super) const MAX_TRIANGLES: usize = 1 << 30;

/// Triangles joined at a time, and by one thread: as many as a table of theirs fits a fast cache with.
const BLOCK: usize = 1 << 18;
const PIECE: usize = 1 << 14;

/// Joins corners with equal coordinates (`-0.0` equals `0.0`) while triangles stream in. Vertices are
/// numbered as they come.
///
/// An open-addressing table of vertex numbers: one probe costs one cache line of it and one of the
/// vertices, and neighbouring triangles hit the same ones.
pub(super) struct Welder {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Vertex number plus one; 0 is free. The length is a power of two, at most half full.
    table: Vec<u32>,
    /// Corners of the last triangles, oldest overwritten: files list neighbours one after the
    /// other, so that more than half of all corners are found here without a probe of the table.
    recent: [(DVec3, u32); 6],
    next_recent: usize,
    read: usize,
    /// The last triangles, not joined yet.
    pending: Vec<[DVec3; 3]>,
    given: Given,
}

impl Default for Welder {
    fn default() -> Self {
        // A vertex number that does not exist yet marks an empty place among the recent corners.
        Self {
            vertices: Vec::new(),
            triangles: Vec::new(),
            table: Vec::new(),
            recent: [(DVec3::ZERO, u32::MAX); 6],
            next_recent: 0,
            read: 0,
            pending: Vec::new(),
            given: Given::default(),
        }
    }
}

impl Welder {
    /// Adds a triangle; one with two equal corners is only counted.
    #[inline]
    pub(super) fn triangle(&mut self, corners: [DVec3; 3]) {
        self.pending.push(corners);
        if self.pending.len() == BLOCK {
            self.join_pending();
        }
    }

    /// Joins what is pending: pieces for themselves, on all threads, then one after the other.
    fn join_pending(&mut self) {
        let mut pending = std::mem::take(&mut self.pending);
        if pending.len() <= PIECE {
            pending.iter().for_each(|&corners| self.join(corners));
        } else {
            let joined = |piece: &[[DVec3; 3]]| {
                let mut own = Self::default();
                piece.iter().for_each(|&corners| own.join(corners));
                own
            };
            let pieces: Vec<Self> = pending.par_chunks(PIECE).map(joined).collect();
            pieces.into_iter().for_each(|piece| self.take(piece));
        }
        pending.clear();
        self.pending = pending;
    }

    fn join(&mut self, corners: [DVec3; 3]) {
        self.read += 1;
        let [a, b, c] = corners.map(|corner| self.vertex(corner));
        if a != b && b != c && c != a {
            self.triangles.push([a, b, c]);
            self.given.push();
        }
    }

    /// Takes what was joined for itself.
    fn take(&mut self, piece: Self) {
        self.read += piece.read;
        let numbers: Vec<u32> = piece.vertices.iter().map(|&vertex| self.probe(vertex)).collect();
        for triangle in piece.triangles {
            self.triangles.push(triangle.map(|vertex| numbers[vertex as usize]));
            self.given.push();
        }
    }

    /// The triangles that follow belong to a face of this surface.
    #[cfg(feature = "step")]
    pub(super) fn face(&mut self, surface: Stated) {
        self.join_pending();
        self.given.begin(surface);
    }

    /// Triangles taken so far.
    pub(super) fn count(&self) -> usize {
        self.read + self.pending.len()
    }

    #[inline]
    fn vertex(&mut self, position: DVec3) -> u32 {
        // Adding +0.0 turns -0.0 into 0.0, so equal values have equal bits.
        let position = position + DVec3::ZERO;
        if let Some(&(_, vertex)) = self.recent.iter().find(|(recent, vertex)| {
            *recent == position && (*vertex as usize) < self.vertices.len()
        }) {
            return vertex;
        }
        let vertex = self.probe(position);
        self.recent[self.next_recent] = (position, vertex);
        self.next_recent = (self.next_recent + 1) % self.recent.len();
        vertex
    }

    fn probe(&mut self, position: DVec3) -> u32 {
        if self.vertices.len() * 2 >= self.table.len() {
            self.grow();
        }
        let mask = self.table.len() - 1;
        let mut slot = hash(position) as usize & mask;
        loop {
            match self.table[slot] {
                0 => {
                    // Fits: MAX_TRIANGLES bounds the vertices below 2^32.
                    self.vertices.push(position);
                    self.table[slot] = self.vertices.len() as u32;
                    return self.vertices.len() as u32 - 1;
                }
                entry if self.vertices[entry as usize - 1] == position => return entry - 1,
                _ => slot = (slot + 1) & mask,
            }
        }
    }

    fn grow(&mut self) {
        let length = (self.table.len() * 4).max(1 << 10);
        self.table.clear();
        self.table.resize(length, 0);
        for (index, &vertex) in self.vertices.iter().enumerate() {
            let mut slot = hash(vertex) as usize & (length - 1);
            while self.table[slot] != 0 {
                slot = (slot + 1) & (length - 1);
            }
            self.table[slot] = index as u32 + 1;
        }
    }

    /// The joined triangles.
    pub(super) fn finish(mut self, unit: Option<Unit>, warnings: Vec<String>) -> Soup {
        self.join_pending();
        Soup {
            vertices: self.vertices,
            triangles: self.triangles,
            read: self.read,
            unit,
            warnings,
            given: self.given,
        }
    }
}

/// Mixes the bits of the coordinates. Values from 32-bit floats leave the low mantissa bits zero,
/// so the multiply must carry high bits down: the upper half of the products is folded in.
#[inline]
fn hash(position: DVec3) -> u64 {
    const K: u64 = 0x9e37_79b9_7f4a_7c15;
    let mut state = position.x.to_bits().wrapping_mul(K);
    state = (state.rotate_left(23) ^ position.y.to_bits()).wrapping_mul(K);
    state = (state.rotate_left(23) ^ position.z.to_bits()).wrapping_mul(K);
    state ^ (state >> 32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joins_equal_corners_and_folds_minus_zero() {
        let mut welder = Welder::default();
        welder.triangle([DVec3::ZERO, DVec3::X, DVec3::Y]);
        welder.triangle([DVec3::new(-0.0, 0.0, -0.0), DVec3::Y, DVec3::Z]);
        welder.triangle([DVec3::X, DVec3::X, DVec3::Z]);
        let soup = welder.finish(None, Vec::new());
        assert_eq!((soup.vertices.len(), soup.triangles.len(), soup.read), (4, 2, 3));
    }

    /// Pieces joined on threads give what one after the other gives, numbers too.
    #[test]
    fn many_triangles_are_joined_as_few_are() {
        let point = |i: u32| {
            let (x, y) = (i.wrapping_mul(0x9e37_79b9) >> 20, i % 61);
            DVec3::new(f64::from(x), f64::from(y) - 30.0, 0.0 * f64::from(y) - 0.0)
        };
        let triangles: Vec<[DVec3; 3]> = (0..BLOCK as u32 + 70_000)
            .map(|i| [point(i), point(i + 1), if i % 1000 == 0 { point(i) } else { point(i / 2) }])
            .collect();
        let (mut many, mut few) = (Welder::default(), Welder::default());
        for &corners in &triangles {
            many.triangle(corners);
            few.join(corners);
        }
        let [many, few] = [many, few].map(|welder| welder.finish(None, Vec::new()));
        assert_eq!(many.read, triangles.len());
        assert!(many.triangles.len() < many.read && many.vertices.len() < many.read);
        assert!(many.vertices == few.vertices && many.triangles == few.triangles);
    }

    #[test]
    fn survives_growth() {
        let mut welder = Welder::default();
        let point = |i: u32| DVec3::new(f64::from(i % 100), f64::from(i / 100), 0.5);
        for _ in 0..2 {
            for i in 0..20_000 {
                welder.triangle([point(i), point(i + 1), point(i + 2)]);
            }
        }
        assert_eq!(welder.finish(None, Vec::new()).vertices.len(), 20_002);
    }
}

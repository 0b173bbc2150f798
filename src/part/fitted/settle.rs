//! Whose each triangle is, where faces meet.

use rustc_hash::{FxHashMap, FxHashSet};

use super::{FREE, Fitted, Fitting, NARROWEST, TAKEN};
use crate::part::curves::Kind;
use crate::part::given::Stated;
use crate::part::topology::NONE;

/// Rounds of exchange and fit.
const ROUNDS: usize = 4;
/// How much nearer a face must be to take a triangle from another.
const NEARER: f64 = 0.98;
/// Distance in tolerances up to which a corner amid faces belongs to them: an outlier.
const OUTLIER: f64 = 2.0;
/// Share of a face below which a piece apart from it is none of it.
const ISLAND: f64 = 0.02;
/// Triangles of a spot of outliers.
const SPOT: usize = 60;
/// Share of the corners of two faces that one face must explain to take their place.
const MOST: f64 = 0.995;

impl Fitting<'_> {
    /// Joins faces that are one, and settles their borders.
    pub(super) fn settle(&mut self) {
        self.merge();
        for round in 0..ROUNDS {
            let changed = self.exchange();
            self.refit();
            if changed == 0 && round > 0 {
                break;
            }
        }
        self.merge();
        self.release();
        self.islands();
        self.spots();
        self.refit();
        self.part_pieces();
    }

    /// Distances squared of a triangle's corners, and what it would take to turn it into the surface.
    fn cost(&self, face: u32, triangle: u32) -> f64 {
        let Fitted { surface, sign, .. } = &self.faces[face as usize];
        let corners = self.part.mesh.corners(triangle);
        let distances: f64 = corners.iter().map(|&corner| surface.distance(corner).powi(2)).sum();
        let turn =
            self.altitudes[triangle as usize] * (1.0 - sign * self.facing(surface, triangle));
        distances + 0.75 * turn * turn
    }

    fn may_take(&self, face: u32, triangle: u32) -> bool {
        let Fitted { surface, sign, sag, .. } = &self.faces[face as usize];
        !matches!(surface, Stated::Round { kind: Kind::Revolution, .. })
            && self.accepts(surface, *sign, *sag, triangle)
    }

    /// Gives triangles to the nearest of the faces about them; how many changed hands.
    fn exchange(&mut self) -> usize {
        let mut queue: Vec<u32> = (0..self.owner.len() as u32).collect();
        let mut queued = vec![true; queue.len()];
        let (mut next, mut changed) = (0, 0);
        while next < queue.len() {
            let triangle = queue[next];
            next += 1;
            queued[triangle as usize] = false;
            let own = self.owner[triangle as usize];
            if own == TAKEN {
                continue;
            }
            let mut best =
                (own, if own == FREE { f64::INFINITY } else { self.cost(own, triangle) });
            for other in self.neighbours(triangle) {
                let face = self.owner[other as usize];
                if face >= TAKEN || face == best.0 || !self.may_take(face, triangle) {
                    continue;
                }
                let cost = self.cost(face, triangle);
                if cost < NEARER * best.1 {
                    best = (face, cost);
                }
            }
            if best.0 != own {
                self.owner[triangle as usize] = best.0;
                changed += 1;
                for other in self.neighbours(triangle) {
                    if !std::mem::replace(&mut queued[other as usize], true) {
                        queue.push(other);
                    }
                }
            }
        }
        self.gather();
        changed
    }

    /// The triangles of each face by their owners; narrow planes are none.
    fn gather(&mut self) {
        for face in &mut self.faces {
            face.triangles.clear();
        }
        for (triangle, &owner) in self.owner.iter().enumerate() {
            if owner < TAKEN {
                self.faces[owner as usize].triangles.push(triangle as u32);
            }
        }
        let least = NARROWEST[0] * self.tolerance;
        for number in 0..self.faces.len() {
            let face = &self.faces[number];
            let is_plane = matches!(face.surface, Stated::Plane { .. });
            let is_narrow = || {
                4.0 * self.area(&face.triangles) < least * self.perimeter(&face.triangles, number)
            };
            if is_plane && !face.triangles.is_empty() && is_narrow() {
                for triangle in std::mem::take(&mut self.faces[number].triangles) {
                    self.owner[triangle as usize] = FREE;
                }
            }
        }
        // Numbers follow.
        let mut numbers = vec![FREE; self.faces.len()];
        let mut kept = 0;
        for (number, face) in self.faces.iter().enumerate() {
            if !face.triangles.is_empty() {
                numbers[number] = kept;
                kept += 1;
            }
        }
        self.faces.retain(|face| !face.triangles.is_empty());
        for owner in self.owner.iter_mut().filter(|owner| **owner < TAKEN) {
            *owner = numbers[*owner as usize];
        }
    }

    fn perimeter(&self, triangles: &[u32], number: usize) -> f64 {
        let mut perimeter = 0.0;
        for &triangle in triangles {
            let corners = self.part.mesh.corners(triangle);
            for k in 0..3 {
                let twin = self.part.edges.twin[3 * triangle as usize + k];
                if twin == NONE || self.owner[(twin / 3) as usize] != number as u32 {
                    perimeter += corners[k].distance(corners[(k + 1) % 3]);
                }
            }
        }
        perimeter
    }

    fn refit(&mut self) {
        for number in 0..self.faces.len() {
            let triangles = std::mem::take(&mut self.faces[number].triangles);
            let surface = self.faces[number].surface;
            if !self.faces[number].is_exact {
                self.faces[number].surface = self.fitted(&surface, &triangles).unwrap_or(surface);
            }
            self.faces[number].triangles = triangles;
        }
    }

    /// Joins neighbours that one surface of their kind explains.
    fn merge(&mut self) {
        let mut pairs: FxHashSet<(u32, u32)> = FxHashSet::default();
        for triangle in 0..self.owner.len() as u32 {
            let own = self.owner[triangle as usize];
            for other in self.neighbours(triangle) {
                let theirs = self.owner[other as usize];
                if own < TAKEN && theirs < TAKEN && own < theirs {
                    pairs.insert((own, theirs));
                }
            }
        }
        let mut pairs: Vec<(f64, u32, u32)> = pairs
            .into_iter()
            .map(|(a, b)| {
                let area = |face: u32| self.area(&self.faces[face as usize].triangles);
                (area(a).min(area(b)), a, b)
            })
            .collect();
        pairs.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        let mut now: FxHashMap<u32, u32> = FxHashMap::default();
        for (_, a, b) in pairs {
            let root = |mut face: u32| {
                while let Some(&next) = now.get(&face) {
                    face = next;
                }
                face
            };
            let (a, b) = (root(a), root(b));
            if a == b {
                continue;
            }
            let (one, other) = (&self.faces[a as usize], &self.faces[b as usize]);
            let alike = match (&one.surface, &other.surface) {
                (Stated::Plane { normal, .. }, Stated::Plane { normal: theirs, .. }) => {
                    normal.dot(*theirs) > 0.9
                }
                (Stated::Round { kind, .. }, Stated::Round { kind: theirs, .. }) => {
                    kind == theirs && *kind != Kind::Revolution && one.sign == other.sign
                }
                _ => false,
            };
            if !alike {
                continue;
            }
            let larger =
                if self.area(&one.triangles) >= self.area(&other.triangles) { one } else { other };
            let surface = larger.surface;
            let triangles: Vec<u32> =
                one.triangles.iter().chain(&other.triangles).copied().collect();
            let Some(surface) = self.fitted(&surface, &triangles) else { continue };
            let far = triangles
                .iter()
                .filter(|&&t| {
                    let corners = self.part.mesh.corners(t);
                    corners.iter().any(|&corner| surface.distance(corner) > self.tolerance)
                })
                .count();
            if far as f64 > (1.0 - MOST) * triangles.len() as f64 {
                continue;
            }
            now.insert(b, a);
            let sag = self.faces[a as usize].sag.max(self.faces[b as usize].sag);
            self.faces[b as usize].triangles.clear();
            for &triangle in &triangles {
                self.owner[triangle as usize] = a;
            }
            let sign = self.faces[a as usize].sign;
            self.faces[a as usize] = Fitted { surface, sign, triangles, sag, is_exact: false };
        }
        self.gather();
    }

    /// Frees triangles that their face has left.
    fn release(&mut self) {
        for triangle in 0..self.owner.len() as u32 {
            let own = self.owner[triangle as usize];
            if own >= TAKEN {
                continue;
            }
            let surface = &self.faces[own as usize].surface;
            let corners = self.part.mesh.corners(triangle);
            if corners.iter().any(|&corner| surface.distance(corner) > self.tolerance) {
                self.owner[triangle as usize] = FREE;
            }
        }
        self.gather();
    }

    /// Frees small pieces of faces apart from the rest of them: noise beside an edge.
    fn islands(&mut self) {
        for number in 0..self.faces.len() {
            let pieces = self.pieces(number);
            let whole = self.area(&self.faces[number].triangles);
            for piece in pieces {
                if piece.len() <= SPOT && self.area(&piece) < ISLAND * whole {
                    piece.iter().for_each(|&triangle| self.owner[triangle as usize] = FREE);
                }
            }
        }
        self.gather();
    }

    /// Makes faces of their own of pieces that do not touch.
    fn part_pieces(&mut self) {
        for number in 0..self.faces.len() {
            for piece in self.pieces(number).into_iter().skip(1) {
                self.claim(Fitted { triangles: piece, ..self.faces[number].clone() });
            }
        }
        self.gather();
    }

    /// The connected pieces of a face, that of its first triangle first.
    fn pieces(&mut self, number: usize) -> Vec<Vec<u32>> {
        self.stamp += 1;
        let mut pieces: Vec<Vec<u32>> = Vec::new();
        for seed in self.faces[number].triangles.clone() {
            if self.triangle_mark[seed as usize] == self.stamp {
                continue;
            }
            self.triangle_mark[seed as usize] = self.stamp;
            let mut piece = vec![seed];
            let mut next = 0;
            while next < piece.len() {
                let triangle = piece[next];
                next += 1;
                for other in self.neighbours(triangle) {
                    let mark = &mut self.triangle_mark[other as usize];
                    if *mark != self.stamp && self.owner[other as usize] == number as u32 {
                        *mark = self.stamp;
                        piece.push(other);
                    }
                }
            }
            pieces.push(piece);
        }
        pieces
    }

    /// Gives small spots of free triangles amid faces, with corners not much farther off than the
    /// tolerance, to the nearest of those faces.
    fn spots(&mut self) {
        let mut seen = vec![false; self.owner.len()];
        for seed in 0..self.owner.len() as u32 {
            if self.owner[seed as usize] != FREE || seen[seed as usize] {
                continue;
            }
            seen[seed as usize] = true;
            let mut spot = vec![seed];
            let mut around: Vec<u32> = Vec::new();
            let mut next = 0;
            while next < spot.len() {
                let triangle = spot[next];
                next += 1;
                for other in self.neighbours(triangle) {
                    let owner = self.owner[other as usize];
                    if owner != FREE {
                        around.push(owner);
                    } else if !std::mem::replace(&mut seen[other as usize], true) {
                        spot.push(other);
                    }
                }
            }
            around.sort_unstable();
            around.dedup();
            if spot.len() > SPOT || around.is_empty() || around.contains(&TAKEN) {
                continue;
            }
            for &triangle in &spot {
                let corners = self.part.mesh.corners(triangle);
                let reach = OUTLIER * self.tolerance;
                let near = around.iter().copied().filter(|&face| {
                    let Fitted { surface, sag, .. } = &self.faces[face as usize];
                    corners.iter().all(|&corner| surface.distance(corner) <= reach)
                        && self.sag(surface, triangle) <= sag + reach
                        && !matches!(surface, Stated::Round { kind: Kind::Revolution, .. })
                });
                let best =
                    near.min_by(|&a, &b| self.cost(a, triangle).total_cmp(&self.cost(b, triangle)));
                if let Some(face) = best {
                    self.owner[triangle as usize] = face;
                }
            }
        }
        self.gather();
    }
}

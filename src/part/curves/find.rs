//! Which regions of the mesh make curved faces.

use glam::DVec3;

use super::fit::Kind;
use super::grow::{Exactness, FREE, Found, Growth};
use super::judge::{COARSE, Cut, turn};
use super::net::Net;
use super::seed::comparable;
use super::{CurvedFace, describe};
use crate::geometry::UnionFind;
use crate::part::borders::Borders;
use crate::part::given::GivenFaces;
use crate::part::regions::Regions;
use crate::part::repair::Repaired;
use crate::part::topology::NONE;

/// Side of a square, as a share of the part's diagonal, below whose area a curved face is none.
const LEAST: f64 = 5e-4;
/// Attempts that may fail before only half of the facets are tried, then a third, and so on: freely
/// curved surfaces; the second number where they have very many facets.
const PATIENCE: [usize; 2] = [150, 10];
/// Facets that a surface found in spite of noise has at least.
const MANY: usize = 24;
/// How much larger than its neighbour a facet of a noisy surface may be.
const NOISY_RATIO: f64 = 10.0;
/// Facets of a patch that a noisy surface is looked for in.
const NOISY_PATCH: usize = 120;
/// Groups and patches tried at most.
const NOISY_TRIES: usize = 60;
/// How much larger than a strip a flat may be that a look at its neighbours alone takes for one,
/// and how much larger it is at least.
const STRIPS_ALIKE: f64 = 4.0;
const WIDER: f64 = 1.6;
/// Facets of a ball that is no die.
const MANY_FACETS: usize = 60;
/// Facets whose coordinates are looked at for rounding.
const SAMPLE: usize = 300;
/// Distance of vertices from a cylinder as a share of its radius up to which it is no cone.
const STRAIGHT: f64 = 5e-4;
/// Distance of vertices from a cylinder, as a multiple of that from a cone, up to which the same.
const AS_NEAR: f64 = 1.1;
/// Bent facets of a part from which on only whole groups of them are looked at for noise.
const MANY_SEEDS: usize = 200_000;
/// Patches that may then be looked at in vain.
const FEW_PATCHES: usize = 300;
/// Strips of a cylinder or cone from which on its outermost ones, too, are no planes.
const STRIPS: f64 = 6.0;
/// Sag as a share of the diagonal up to which that holds.
const ARC: f64 = 0.01;

/// A surface with its facets, and how they cut it.
pub(super) struct Face {
    pub found: Found,
    pub cut: Cut,
    /// Corners of strips that are cut off, which lie on chords of the surface.
    pub rim: Vec<DVec3>,
}

/// Curved faces by falling area, not numbered yet, and what follows from them for the planes.
pub(in crate::part) struct Curves {
    pub faces: Vec<CurvedFace>,
    /// Whether each region belongs to a curved face and is no plane.
    pub is_curved: Vec<bool>,
    /// Regions that are planes, whatever their neighbours: flats beside the strips of a cylinder.
    pub flats: Vec<u32>,
}

/// All curved faces of the part. `floors`: uncertainty of its vertices \[m\], by [`rounding`] at least, and
/// what may be enough for smaller curves.
pub(in crate::part) fn curved_faces(
    part: &Repaired,
    regions: &Regions,
    borders: &Borders,
    given: &GivenFaces,
    floors: [f64; 2],
) -> Curves {
    let mut is_curved = vec![false; regions.all.len()];
    let seeds = bent(regions, borders, given);
    let mut described = given_faces(part, given);
    if seeds.is_empty() {
        return Curves { faces: described, is_curved, flats: Vec::new() };
    }
    let net = Net::new(part, regions, borders, given, floors[0]);
    let finer = (floors[1] < floors[0]).then(|| net.with_floor(floors[1]));
    let mut growth = Growth::new(&net);
    let mut faces: Vec<Face> = Vec::new();
    growth.exact(&seeds, &mut faces);
    if let Some(finer) = &finer {
        growth.net = finer;
        growth.exact(&seeds, &mut faces);
        growth.net = &net;
    }
    growth.join_rows(&mut faces);
    growth.noisy(&seeds, &mut faces);
    growth.join_same(&mut faces);
    growth.join_cut(&mut faces);
    let least = (LEAST * part.diagonal).powi(2);
    for face in faces.iter().filter(|face| !face.found.members.is_empty()) {
        if let Some(curved) =
            describe::found(part, regions, face).filter(|curved| curved.area > least)
        {
            if takes_planes(face, part.diagonal) {
                for &facet in &face.found.members {
                    is_curved[facet as usize] = true;
                }
            }
            described.push(curved);
        }
    }
    sort(&mut described, part.diagonal);
    let flats = seeds.iter().copied().filter(|&seed| growth.is_flat(seed, &faces)).collect();
    Curves { faces: described, is_curved, flats }
}

/// The curved ones of the faces that the file states or that were fitted, by falling area, not
/// numbered yet.
pub(in crate::part) fn given_faces(part: &Repaired, given: &GivenFaces) -> Vec<CurvedFace> {
    let mut described: Vec<CurvedFace> =
        given.all.iter().filter_map(|face| describe::given(part, face)).collect();
    sort(&mut described, part.diagonal);
    described
}

/// As planar faces: areas that agree to 1e-6 count as equal.
pub(super) fn sort(faces: &mut [CurvedFace], diagonal: f64) {
    let key = |face: &CurvedFace| (face.area.log2() * 1e5).round() as i64;
    let step = (diagonal * 1e-6).max(f64::MIN_POSITIVE);
    let place = |face: &CurvedFace| {
        [face.centroid.x, face.centroid.y, face.centroid.z].map(|x| (x / step).round() as i64)
    };
    faces.sort_by_cached_key(|face| (std::cmp::Reverse(key(face)), place(face)));
}

/// Regions that bend against two neighbours or more, of faces that the file does not state.
fn bent(regions: &Regions, borders: &Borders, given: &GivenFaces) -> Vec<u32> {
    let is_bent = |facet: &u32| {
        let bends = borders.of(*facet as usize).iter().filter(|border| {
            let [a, b] =
                [*facet, border.other].map(|index| regions.all[index as usize].plane.normal);
            (0.67..1.0 - 1.5e-7).contains(&a.dot(b))
        });
        bends.count() >= 2
    };
    let is_open =
        |facet: &u32| given.is_empty() || given.of(regions.triangles(*facet as usize)[0]) == NONE;
    (0..regions.all.len() as u32).filter(is_open).filter(is_bent).collect()
}

/// The step to which the file rounds coordinates of curved surfaces \[m\], decimal or binary, where
/// it is seen in all of them; 0 otherwise.
pub(in crate::part) fn rounding(
    part: &Repaired,
    regions: &Regions,
    borders: &Borders,
    given: &GivenFaces,
) -> f64 {
    let seeds = bent(regions, borders, given);
    if seeds.is_empty() {
        return 0.0;
    }
    let net = Net::new(part, regions, borders, given, 0.0);
    let stride = seeds.len().div_ceil(SAMPLE);
    // A program that cuts facets up may not round what it adds.
    let coordinates: Vec<f64> = seeds
        .iter()
        .step_by(stride)
        .flat_map(|&facet| net.corners(facet))
        .flat_map(|vertex| net.point(vertex).to_array())
        .collect();
    if coordinates.is_empty() {
        return 0.0;
    }
    let decimal = (0..12).map(|digits| 10.0_f64.powi(-digits));
    let binary = (0..40).map(|digits| 0.5_f64.powi(digits));
    let fits = |step: &f64| {
        coordinates.iter().all(|x| {
            let steps = x / step;
            (steps - steps.round()).abs() < 1e-3 + 4.0 * part.noise / step
        })
    };
    // Steps coarser than 1e-4 of the part are none: a part of whole millimetres.
    let possible = 40.0 * part.noise..1e-4 * part.diagonal;
    decimal
        .chain(binary)
        .map(|step| part.unit * step)
        .filter(|step| possible.contains(step) && fits(step))
        .fold(0.0, f64::max)
}

/// Whether a place in a list is among the one in `count` that are looked at. Their steps follow the
/// golden ratio: in steps of equal length the facets of one half of a part that mirrors the other
/// could all be passed over.
fn is_one_of(place: usize, count: usize) -> bool {
    let turned = (place as u32).wrapping_mul(0x9e37_79b9);
    (u64::from(turned) * count as u64) >> 32 == 0
}

/// Whether the facets of a face are no planes even where a look at their neighbours alone leaves it
/// open: a ring of facets on a torus, the cap of a sphere, the outermost strip of an arc.
fn takes_planes(face: &Face, diagonal: f64) -> bool {
    let strips = face.cut.turn * face.cut.facets / std::f64::consts::TAU;
    match face.found.kind {
        Kind::Torus => true,
        Kind::Sphere | Kind::Revolution => {
            face.cut.step <= COARSE || face.found.members.len() >= MANY_FACETS
        }
        Kind::Cylinder | Kind::Cone => {
            face.cut.step <= COARSE && strips > STRIPS - 0.3 && face.found.sag < ARC * diagonal
        }
    }
}

impl Growth<'_> {
    /// Whether a region lies between strips of cylinders, on none of them and wider than they are.
    fn is_flat(&self, region: u32, faces: &[Face]) -> bool {
        let net = self.net;
        let mut wider = None;
        for border in net.borders.of(region as usize) {
            let other = border.other;
            let comparable = net.area(region) <= STRIPS_ALIKE * net.area(other);
            if !comparable || net.normal(region).dot(net.normal(other)) < COARSE.cos() {
                continue;
            }
            let owner = self.owner[other as usize];
            let is_line = owner != FREE
                && matches!(faces[owner as usize].found.kind, Kind::Cylinder | Kind::Cone);
            let is_wider = is_line && net.area(region) > WIDER * net.area(other);
            wider = Some(wider.unwrap_or(true) && is_wider);
        }
        self.owner[region as usize] == FREE && wider == Some(true)
    }

    /// Adds a surface; what it takes over is taken from the others.
    pub(super) fn take(&mut self, faces: &mut Vec<Face>, found: Found, cut: Cut) {
        let mut losers: Vec<u32> =
            found.members.iter().map(|&facet| self.owner[facet as usize]).collect();
        losers.sort_unstable();
        losers.dedup();
        self.claim(&found);
        for loser in losers.into_iter().filter(|&loser| loser != FREE) {
            let Face { found: left, cut, .. } = &mut faces[loser as usize];
            let before = left.members.len();
            left.members.retain(|&facet| self.owner[facet as usize] == loser);
            // A rest is no surface any more.
            if 2 * left.members.len() < before {
                for facet in left.members.drain(..) {
                    self.owner[facet as usize] = FREE;
                }
            }
            left.points = self.points(&left.members);
            left.residual = left.surface.residual(&left.points);
            if matches!(left.kind, Kind::Cylinder | Kind::Cone) {
                cut.turn = turn(left, std::f64::consts::TAU / cut.facets);
            }
        }
        // Corners on chords, which say nothing of the surface but how far it goes.
        let all = self.points(&found.members);
        let rim = if all.len() > found.points.len() { all } else { Vec::new() };
        let mut face = Face { found, cut, rim };
        if !face.rim.is_empty() {
            face.turn_again();
        }
        faces.push(face);
    }

    /// Whether chords rise above the uncertainty of the vertices: of finer facets a few in a row lie
    /// on any surface.
    fn shows_curvature(&self, seed: u32) -> bool {
        let net = self.net;
        net.borders.of(seed as usize).iter().any(|border| {
            let width = net.area(seed) / border.length;
            net.is_smooth(seed, border.other)
                && width * net.bend(seed, border.other).abs() / 8.0 > 3.0 * net.floor
        })
    }

    /// Surfaces whose corners lie on them exactly.
    fn exact(&mut self, seeds: &[u32], faces: &mut Vec<Face>) {
        let mut patience = PATIENCE[0];
        if seeds.len() > MANY_SEEDS {
            (patience, self.patience) = (PATIENCE[1], FEW_PATCHES);
        }
        let is_first = self.firsts(seeds);
        let mut failed = 0;
        for (index, &seed) in seeds.iter().enumerate() {
            let is_tried = is_first[index] || is_one_of(index, 1 + failed / patience);
            if self.owner[seed as usize] != FREE || !is_tried {
                continue;
            }
            if !self.shows_curvature(seed) {
                continue;
            }
            let judged = |growth: &mut Self, found: Option<Found>| {
                let found = found?;
                let cut = growth.judge(&found, Exactness::Exact)?;
                Some((found, cut))
            };
            let sphere = self.sphere_at(seed);
            let sphere = judged(self, sphere);
            let row = self.by_row(seed);
            let row = judged(self, row).map(|row| self.straightened(row));
            let found = match (sphere, row) {
                // The two circles at the ends of a cylinder lie on a sphere, too.
                (Some(sphere), Some(row)) => {
                    let is_all = row.0.members.len() + 2 >= sphere.0.members.len();
                    Some(if is_all { row } else { sphere })
                }
                (Some(found), None) | (None, Some(found)) => Some(found),
                (None, None) => {
                    let found = self.by_creases(seed);
                    judged(self, found).or_else(|| {
                        let found = self.by_patch(seed);
                        judged(self, found).map(|found| self.straightened(found))
                    })
                }
            };
            match found {
                Some((found, cut)) => self.take(faces, found, cut),
                None => failed += 1,
            }
        }
    }

    /// A cone whose radius changes by less than vertices may lie off, or do, as a cylinder.
    fn straightened(&self, (mut found, cut): (Found, Cut)) -> (Found, Cut) {
        if found.kind == Kind::Cone
            && let Some(surface) = found.surface.as_cylinder(&found.points)
        {
            let residual = surface.residual(&found.points);
            let near = self.net.floor + STRAIGHT * surface.radius();
            if residual <= near.max(AS_NEAR * found.residual) {
                (found.surface, found.kind, found.residual) = (surface, Kind::Cylinder, residual);
            }
        }
        (found, cut)
    }

    /// Smooth pieces of surface: facets in sets with those of their neighbours among them that are of
    /// much the same size.
    fn pieces(&self, facets: &[u32]) -> UnionFind {
        let net = self.net;
        let mut sets = UnionFind::new(self.owner.len());
        let mut is_one = vec![false; self.owner.len()];
        facets.iter().for_each(|&facet| is_one[facet as usize] = true);
        for &facet in facets {
            for border in net.borders.of(facet as usize) {
                let other = border.other;
                if other < facet
                    && is_one[other as usize]
                    && net.is_smooth(facet, other)
                    && comparable(net, facet, other, NOISY_RATIO)
                {
                    sets.join(facet as usize, other as usize);
                }
            }
        }
        sets
    }

    /// Whether each seed is the first of its piece of surface.
    fn firsts(&self, seeds: &[u32]) -> Vec<bool> {
        let mut pieces = self.pieces(seeds);
        let mut is_met = vec![false; self.owner.len()];
        let first = |&seed: &u32| !std::mem::replace(&mut is_met[pieces.root(seed as usize)], true);
        seeds.iter().map(first).collect()
    }

    /// Surfaces whose corners lie off by more, in connected bent facets that are left.
    fn noisy(&mut self, seeds: &[u32], faces: &mut Vec<Face>) {
        let net = self.net;
        let left: Vec<u32> =
            seeds.iter().copied().filter(|&seed| self.owner[seed as usize] == FREE).collect();
        let mut sets = self.pieces(&left);
        let mut groups: Vec<(usize, u32)> =
            left.iter().map(|&seed| (sets.root(seed as usize), seed)).collect();
        groups.sort_unstable();
        let mut groups: Vec<(f64, Vec<u32>)> = groups
            .chunk_by(|a, b| a.0 == b.0)
            .filter(|group| group.len() >= MANY)
            .map(|group| {
                let facets: Vec<u32> = group.iter().map(|entry| entry.1).collect();
                (facets.iter().map(|&facet| net.area(facet)).sum(), facets)
            })
            .collect();
        groups.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        // Not over and over on a freely curved surface of a million facets.
        let mut tries = if seeds.len() < MANY_SEEDS { NOISY_TRIES } else { 0 };
        for (_, facets) in groups.iter().take(if tries > 0 { NOISY_TRIES } else { 3 }) {
            if self.noisy_surface(facets, faces) {
                continue;
            }
            let stride = facets.len().div_ceil(NOISY_TRIES / 4);
            for &seed in facets.iter().step_by(stride) {
                if tries > 0 && self.owner[seed as usize] == FREE {
                    tries -= 1;
                    let patch = self.patch(seed, NOISY_PATCH);
                    if patch.len() >= MANY {
                        self.noisy_surface(&patch, faces);
                    }
                }
            }
        }
    }

    /// Faces in sets with those of their neighbours that lie on the same surface.
    fn same(&self, faces: &[Face]) -> UnionFind {
        let mut pairs: Vec<(usize, usize)> = Vec::new();
        for (number, face) in faces.iter().enumerate() {
            for &facet in &face.found.members {
                for border in self.net.borders.of(facet as usize) {
                    let other = self.owner[border.other as usize];
                    if other != FREE && (other as usize) < number {
                        pairs.push((other as usize, number));
                    }
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let mut sets = UnionFind::new(faces.len());
        for &(a, b) in &pairs {
            let (one, other) = (&faces[a].found, &faces[b].found);
            let (large, small) =
                if self.area_of(one) >= self.area_of(other) { (one, other) } else { (other, one) };
            if large.kind == small.kind
                && large.sign == small.sign
                && large.surface.residual(&small.points) <= 2.0 * self.tolerance_of(large)
            {
                sets.join(a, b);
            }
        }
        sets
    }

    /// Joins neighbours that lie on one surface: pieces of different fineness, a helical strip whose
    /// windings were found one by one, and strips between what was cut off.
    pub(super) fn join_same(&mut self, faces: &mut [Face]) {
        let mut sets = self.same(faces);
        let mut grown: Vec<usize> = Vec::new();
        for number in 0..faces.len() {
            let root = sets.root(number);
            if root == number || faces[number].found.members.is_empty() {
                continue;
            }
            let Face { found, rim, .. } = &mut faces[number];
            let (surface, members) = (found.surface, std::mem::take(&mut found.members));
            let (points, rim) = (std::mem::take(&mut found.points), std::mem::take(rim));
            for &facet in &members {
                self.owner[facet as usize] = root as u32;
            }
            let face = &mut faces[root];
            if points.len() > face.found.points.len() {
                face.found.surface = surface;
            }
            face.found.members.extend(members);
            face.found.points.extend(points);
            face.rim.extend(rim);
            grown.push(root);
        }
        grown.sort_unstable();
        grown.dedup();
        for root in grown {
            let Face { found, .. } = &mut faces[root];
            let fitted = found.surface.fitted(found.kind, &found.points);
            found.surface = fitted.unwrap_or(found.surface);
            found.residual = found.surface.residual(&found.points);
            faces[root].turn_again();
        }
    }

    /// A surface near all of `facets`.
    fn noisy_surface(&mut self, facets: &[u32], faces: &mut Vec<Face>) -> bool {
        let points = self.points(facets);
        let attempts = [Self::line_of, Self::sphere_of, Self::torus_of];
        let found = attempts.iter().find_map(|attempt| {
            let found = attempt(self, facets, &points, Exactness::Noisy)?;
            let cut = self.judge(&found, Exactness::Noisy)?;
            Some(self.straightened((found, cut)))
        });
        let is_found = found.is_some();
        if let Some((found, cut)) = found {
            self.take(faces, found, cut);
        }
        is_found
    }
}

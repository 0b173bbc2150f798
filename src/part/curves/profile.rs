//! Rows of facets about one axis, joined to spheres, tori and other surfaces of revolution by
//! their profile.

use glam::DVec2;
use rustc_hash::FxHashMap;

use super::Axis;
use super::find::Face;
use super::fit::{Kind, Profile, Surface, circle};
use super::grow::{Exactness, FREE, Found, Growth};
use super::judge::COARSE;

/// How much longer than its neighbours a piece of a profile may be that is one curve with them.
const EVEN: f64 = 1.6;
/// Angle of two axes that count as one \[rad\].
const PARALLEL: f64 = 0.01;
/// ... and their distance as a share of the radius.
const SAME_AXIS: f64 = 1e-3;
/// Residual of a profile's corners on a circle as a share of the sag of its pieces.
const EXACT: f64 = 0.01;
/// Turn of a profile \[rad\] above which nothing but a circle fits a circle: 60 degrees.
const SURE: f64 = 1.05;

/// Places on the profile: along the axis, distance from it \[m\].
type Place = DVec2;

/// A row as a piece of a profile.
#[derive(Clone, Copy)]
struct Piece {
    /// Number of the surface.
    row: usize,
    ends: [Place; 2],
    /// The other row and its end at each end.
    next: [Option<(usize, usize)>; 2],
}

/// The rows of facets that share an axis, and how they are joined.
struct Chain {
    axis: Axis,
    /// Pieces in order, each turned so that its second end meets the next one's first.
    rows: Vec<usize>,
    places: Vec<Place>,
}

impl Growth<'_> {
    /// Joins rows among `faces`; surfaces that lose their facets to others are emptied.
    pub(super) fn join_rows(&mut self, faces: &mut Vec<Face>) {
        let chains = self.chains(faces);
        let mut curves: Vec<(f64, usize, std::ops::Range<usize>, DVec2, f64)> = Vec::new();
        for (index, chain) in chains.iter().enumerate() {
            for (run, centre, radius) in circles(&chain.places, self.net.floor) {
                let area: f64 = chain.rows[run.clone()]
                    .iter()
                    .map(|&row| self.area_of(&faces[row].found))
                    .sum();
                curves.push((area, index, run, centre, radius));
            }
        }
        curves.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for (_, index, run, centre, radius) in curves {
            let chain = &chains[index];
            let members: Vec<u32> = chain.rows[run]
                .iter()
                .flat_map(|&row| faces[row].found.members.iter().copied())
                .filter(|&facet| self.may_take(facet))
                .collect();
            if members.len() >= 6 {
                self.round(faces, chain.axis, &members, centre, radius);
            }
        }
        for chain in &chains {
            self.turned(faces, chain);
        }
    }

    pub(super) fn area_of(&self, found: &Found) -> f64 {
        found.members.iter().map(|&facet| self.net.area(facet)).sum()
    }

    fn may_take(&self, facet: u32) -> bool {
        let owner = self.owner[facet as usize];
        owner == FREE || self.yields[owner as usize]
    }

    /// A sphere or torus over rows whose profile is an arc about `centre`.
    fn round(
        &mut self,
        faces: &mut Vec<Face>,
        axis: Axis,
        members: &[u32],
        centre: Place,
        radius: f64,
    ) {
        let origin = axis.origin + axis.direction * centre.x;
        let mut surface = Surface {
            axis: Axis { origin, ..axis },
            profile: Profile::Circle { major: centre.y.max(0.0), minor: radius },
        };
        let kind = if centre.y.abs() < 0.02 * radius {
            surface.profile = Profile::Circle { major: 0.0, minor: radius };
            Kind::Sphere
        } else if centre.y > 0.0 {
            Kind::Torus
        } else {
            return;
        };
        let points = self.points(members);
        let Some(surface) = surface.fitted(kind, &points) else { return };
        let sign = self.sign(&surface, members);
        let Some(found) = self.grow(surface, kind, sign, members, Exactness::Exact) else {
            return;
        };
        if let Some(cut) = self.judge(&found, Exactness::Exact) {
            self.take(faces, found, cut);
        }
    }

    /// Rows of a chain that no circle took, three or more alike in a row: a surface of revolution
    /// with a profile of its own.
    fn turned(&mut self, faces: &mut Vec<Face>, chain: &Chain) {
        let length = |k: usize| chain.places[k].distance(chain.places[k + 1]);
        let bend = |k: usize| bend(&chain.places, k).abs();
        let is_left = |growth: &Self, faces: &[Face], row: usize| {
            let found = &faces[row].found;
            found.is_row && !found.members.is_empty() && growth.yields[row]
        };
        let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
        let mut start = 0;
        for k in 0..=chain.rows.len() {
            let goes_on = k > start
                && k < chain.rows.len()
                && is_left(self, faces, chain.rows[k])
                && bend(k) < COARSE
                && bend(k) > 1e-3
                && (1.0 / 3.0..3.0).contains(&(length(k) / length(k - 1)));
            if !goes_on {
                if k >= start + 3 {
                    runs.push(start..k);
                }
                start = if k < chain.rows.len() && !is_left(self, faces, chain.rows[k]) {
                    k + 1
                } else {
                    k
                };
            }
        }
        for run in runs {
            // The pieces bend from one to the next, each by no more than half again the last.
            let bends: Vec<f64> = (run.start + 1..run.end).map(bend).collect();
            let typical = bends.iter().sum::<f64>() / bends.len() as f64;
            if bends.iter().any(|&bend| bend > 2.5 * typical) {
                continue;
            }
            let members: Vec<u32> = chain.rows[run.clone()]
                .iter()
                .flat_map(|&row| faces[row].found.members.iter().copied())
                .collect();
            let points = self.points(&members);
            // Corners of one ring have one place on the profile.
            let places = &chain.places[run.start..=run.end];
            let residual = points
                .iter()
                .map(|&point| {
                    let place = DVec2::new(chain.axis.along(point), chain.axis.distance(point));
                    places.iter().map(|ring| ring.distance(place)).fold(f64::INFINITY, f64::min)
                })
                .fold(0.0, f64::max);
            let largest = &faces[chain.rows[run.start]].found;
            let found = Found {
                surface: Surface { axis: chain.axis, ..largest.surface },
                kind: Kind::Revolution,
                sign: largest.sign,
                members,
                points,
                residual,
                sag: largest.sag,
                is_row: false,
            };
            let reach = places.iter().map(|place| place.y).fold(0.0, f64::max);
            if residual <= self.net.floor + SAME_AXIS * reach {
                let cut = faces[chain.rows[run.start]].cut;
                self.take(faces, found, cut);
            }
        }
    }

    /// Chains of rows about one axis.
    fn chains(&mut self, faces: &[Face]) -> Vec<Chain> {
        let mut joints: FxHashMap<(usize, usize), f64> = FxHashMap::default();
        for (row, face) in faces.iter().enumerate() {
            if !matches!(face.found.surface.profile, Profile::Line { .. }) {
                continue;
            }
            for &facet in &face.found.members {
                for border in self.net.borders.of(facet as usize) {
                    let other = self.owner[border.other as usize];
                    if other != FREE
                        && other as usize > row
                        && self.net.is_smooth(facet, border.other)
                    {
                        *joints.entry((row, other as usize)).or_insert(0.0) += border.length;
                    }
                }
            }
        }
        let mut joints: Vec<((usize, usize), f64)> = joints.into_iter().collect();
        joints.retain(|&((a, b), _)| is_joined(&faces[a].found, &faces[b].found, self.net.floor));
        joints.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut sets = crate::geometry::UnionFind::new(faces.len());
        joints.iter().for_each(|&((a, b), _)| sets.join(a, b));
        let mut groups: FxHashMap<usize, Vec<usize>> = FxHashMap::default();
        for row in joints.iter().flat_map(|&((a, b), _)| [a, b]) {
            groups.entry(sets.root(row)).or_default().push(row);
        }
        let mut groups: Vec<Vec<usize>> = groups.into_values().collect();
        for group in &mut groups {
            group.sort_unstable();
            group.dedup();
        }
        groups.sort();
        groups.iter().flat_map(|group| self.walk(faces, group, &joints)).collect()
    }

    /// The chains of a group of rows about one axis: that of the largest.
    fn walk(
        &self,
        faces: &[Face],
        group: &[usize],
        joints: &[((usize, usize), f64)],
    ) -> Vec<Chain> {
        let Some(largest) = group.iter().copied().max_by(|&a, &b| {
            self.area_of(&faces[a].found).total_cmp(&self.area_of(&faces[b].found))
        }) else {
            return Vec::new();
        };
        let axis = faces[largest].found.surface.axis;
        let mut pieces: FxHashMap<usize, Piece> = group
            .iter()
            .map(|&row| (row, Piece { row, ends: ends(&faces[row].found, axis), next: [None; 2] }))
            .collect();
        for &((a, b), _) in joints {
            let (Some(one), Some(other)) = (pieces.get(&a), pieces.get(&b)) else { continue };
            let pairs = [(0, 0), (0, 1), (1, 0), (1, 1)];
            let distance = |&(i, k): &(usize, usize)| one.ends[i].distance(other.ends[k]);
            let Some(&(i, k)) = pairs.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
            else {
                continue;
            };
            let near =
                0.1 * one.ends[0].distance(one.ends[1]).min(other.ends[0].distance(other.ends[1]));
            if distance(&(i, k)) > near || one.next[i].is_some() || other.next[k].is_some() {
                continue;
            }
            if let Some(one) = pieces.get_mut(&a) {
                one.next[i] = Some((b, k));
            }
            if let Some(other) = pieces.get_mut(&b) {
                other.next[k] = Some((a, i));
            }
        }
        let mut chains = Vec::new();
        let mut used: rustc_hash::FxHashSet<usize> = rustc_hash::FxHashSet::default();
        // Chains with an end first, then rings.
        let is_end = |row: &usize| pieces[row].next.iter().any(Option::is_none);
        let starts = group.iter().filter(|row| is_end(row)).chain(group);
        for &start in starts {
            if used.contains(&start) {
                continue;
            }
            let mut from = usize::from(pieces[&start].next[0].is_some());
            let mut chain =
                Chain { axis, rows: Vec::new(), places: vec![pieces[&start].ends[from]] };
            let mut row = start;
            while used.insert(row) {
                let piece = &pieces[&row];
                chain.rows.push(piece.row);
                chain.places.push(piece.ends[1 - from]);
                let Some((other, end)) = piece.next[1 - from] else { break };
                (row, from) = (other, end);
            }
            chains.push(chain);
        }
        chains
    }
}

/// Ends of a row's profile about `axis`, which is its own but for rounding.
fn ends(found: &Found, axis: Axis) -> [Place; 2] {
    let own = found.surface.axis;
    let places = found.points.iter().map(|&point| own.along(point));
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
        (low.min(place), high.max(place))
    });
    let Profile::Line { radius, slope } = found.surface.profile else {
        return [DVec2::ZERO; 2];
    };
    [low, high].map(|s| {
        let point = own.origin + own.direction * s;
        DVec2::new(axis.along(point), radius + s * slope.tan())
    })
}

/// Whether two rows have one axis.
fn is_joined(a: &Found, b: &Found, floor: f64) -> bool {
    let (one, other) = (a.surface.axis, b.surface.axis);
    let near = SAME_AXIS * a.surface.radius().min(b.surface.radius()) + 10.0 * floor;
    one.direction.cross(other.direction).length() < PARALLEL
        && one.distance(other.origin).min(other.distance(one.origin)) < near
}

/// Angle by which the profile turns at place `k` \[rad\].
fn bend(places: &[Place], k: usize) -> f64 {
    (places[k] - places[k - 1]).angle_to(places[k + 1] - places[k])
}

/// Runs of three or more pieces with their corners on a circle, the longest first come: pieces,
/// centre, radius.
fn circles(places: &[Place], floor: f64) -> Vec<(std::ops::Range<usize>, Place, f64)> {
    let mut found = Vec::new();
    let mut start = 0;
    while start + 3 < places.len() {
        let mut best = None;
        let mut end = start + 3;
        while end < places.len() {
            let Some(fit) = arc(&places[start..=end], floor) else { break };
            best = Some((start..end, fit.0, fit.1));
            end += 1;
        }
        match best {
            Some(run) if !runs_on(places, &run.0) => {
                start = run.0.end;
                found.push(run);
            }
            _ => start += 1,
        }
    }
    found
}

/// Whether the profile goes on beyond a short run of pieces much as within: then it is no circle.
fn runs_on(places: &[Place], run: &std::ops::Range<usize>) -> bool {
    let bends = run.len() - 1;
    let turn: f64 = (run.start + 1..run.end).map(|k| bend(places, k)).sum();
    let length = |k: usize| places[k].distance(places[k + 1]);
    let alike = |joint: usize, outside: usize, inside: usize| {
        (0.5..2.0).contains(&(bend(places, joint) * bends as f64 / turn))
            && (0.4..2.5).contains(&(length(outside) / length(inside)))
    };
    let before = run.start > 0 && alike(run.start, run.start - 1, run.start);
    let after = run.end + 1 < places.len() && alike(run.end, run.end, run.end - 1);
    turn.abs() < SURE && (before || after)
}

/// The circle through corners of a profile that bends evenly.
fn arc(places: &[Place], floor: f64) -> Option<(Place, f64)> {
    let (s, r, radius) = circle(places.iter().map(|place| (place.x, place.y)))?;
    let centre = DVec2::new(s, r);
    let lengths = || places.windows(2).map(|pair| pair[0].distance(pair[1]));
    let (least, most) = lengths()
        .fold((f64::INFINITY, 0.0_f64), |(low, high), length| (low.min(length), high.max(length)));
    let bends = || (1..places.len() - 1).map(|k| bend(places, k));
    let way = bends().next()?.signum();
    let steepest = bends().map(f64::abs).fold(0.0, f64::max);
    let even = if steepest > COARSE { 1.02 } else { EVEN };
    let residual = 2.0 * floor + EXACT * most * most / (8.0 * radius);
    (most <= even * least
        && bends().all(|bend| bend * way > 1e-4)
        && places.iter().all(|place| (place.distance(centre) - radius).abs() <= residual))
    .then_some((centre, radius))
}

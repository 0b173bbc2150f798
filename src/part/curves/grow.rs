//! Growing a surface over the facets that belong to it.

use glam::DVec3;

use super::fit::{Kind, Profile, Surface};
use super::net::Net;

/// Distance of a vertex from its surface as a share of the radius.
pub(super) const RESIDUAL: f64 = 1e-3;
/// ... as a share of the sag of the facets: vertices lie on the surface, and a surface of changing
/// curvature leaves the best circle by more.
const EXACT: f64 = 0.05;
/// ... for a torus, which comes near to many a surface.
const EXACT_TORUS: f64 = 0.002;
/// Distance of a point from its surface as a multiple of the median from which on it lies off.
const USUAL: f64 = 8.0;
/// How much more sag a facet may have than those at which the growth began: 1.6 times wider.
pub(super) const SAG_RATIO: f64 = 2.56;
/// ... on a torus, whose facets are wider outside than inside.
const SAG_RATIO_TORUS: f64 = 5.0;
/// Patches that may be looked at in vain.
const PATCHES: usize = 4000;
/// No surface.
pub(super) const FREE: u32 = u32::MAX;

/// A surface and the facets on it.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub surface: Surface,
    pub kind: Kind,
    /// 1 where the material lies on the side of the axis (of the tube), else -1.
    pub sign: f64,
    pub members: Vec<u32>,
    /// Corners of the members, each once.
    pub points: Vec<DVec3>,
    /// Greatest distance of those \[m\].
    pub residual: f64,
    /// Typical sag of the facets at which the growth began \[m\].
    pub sag: f64,
    /// One row of facets about an axis.
    pub is_row: bool,
}

/// How exactly vertices must lie on a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Exactness {
    /// To a share of the facets' sag.
    Exact,
    /// To a share of the radius.
    Noisy,
}

/// Which facets belong to which surface, and marks of the growth under way.
pub(super) struct Growth<'a> {
    pub net: &'a Net<'a>,
    /// Number of the surface of each facet, or [`FREE`].
    pub owner: Vec<u32>,
    /// Whether each surface found so far may be taken over by one that is curved both ways.
    pub yields: Vec<bool>,
    /// Patches that may still be looked at in vain: their fits are the dearest.
    pub patience: usize,
    stamp: u32,
    member: Vec<u32>,
    refused: Vec<u32>,
    vertex: Vec<u32>,
}

impl<'a> Growth<'a> {
    pub(super) fn new(net: &'a Net<'a>) -> Self {
        let facets = net.regions.all.len();
        Self {
            net,
            owner: vec![FREE; facets],
            yields: Vec::new(),
            patience: PATCHES,
            stamp: 0,
            member: vec![0; facets],
            refused: vec![0; facets],
            vertex: vec![0; net.part.mesh.vertices.len()],
        }
    }

    /// Whether a surface may take the facet; one that is curved both ways also takes it from a row.
    fn is_free(&self, facet: u32, kind: Kind) -> bool {
        let owner = self.owner[facet as usize];
        owner == FREE || (matches!(kind, Kind::Sphere | Kind::Torus) && self.yields[owner as usize])
    }

    /// Marks facets for [`Self::is_marked`], until the next growth or mark.
    pub(super) fn mark(&mut self, facets: &[u32]) {
        self.stamp += 1;
        for &facet in facets {
            self.member[facet as usize] = self.stamp;
        }
    }

    pub(super) fn is_marked(&self, facet: u32) -> bool {
        self.member[facet as usize] == self.stamp
    }

    /// Corners of `facets`, each once.
    pub(super) fn points(&mut self, facets: &[u32]) -> Vec<DVec3> {
        self.stamp += 1;
        let mut points = Vec::new();
        facets.iter().for_each(|&facet| self.add_points(facet, &mut points));
        points
    }

    fn add_points(&mut self, facet: u32, points: &mut Vec<DVec3>) {
        for vertex in self.net.corners(facet) {
            if self.vertex[vertex as usize] != self.stamp {
                self.vertex[vertex as usize] = self.stamp;
                points.push(self.net.point(vertex));
            }
        }
    }

    /// The typical sag of `facets` on `surface` (exceeded by a fifth) when all lie on it.
    pub(super) fn fits(
        &self,
        surface: &Surface,
        facets: &[u32],
        sign: f64,
        exactness: Exactness,
    ) -> Option<f64> {
        let loose = self.net.floor + RESIDUAL * surface.radius();
        let mut sags = Vec::with_capacity(facets.len());
        for &facet in facets {
            sags.push(self.net.sag(surface, facet, sign, loose, f64::INFINITY)?);
        }
        sags.sort_unstable_by(f64::total_cmp);
        // Not the greatest: a flat beside the strips of a shaft may be among them.
        let sag = sags[sags.len() * 4 / 5];
        let tolerance = self.tolerance(surface, sag, exactness);
        facets
            .iter()
            .all(|&facet| self.net.sag(surface, facet, sign, tolerance, f64::INFINITY).is_some())
            .then_some(sag)
    }

    /// Sign of a surface: 1 where the material is on the inner side, by the facets' normals.
    pub(super) fn sign(&self, surface: &Surface, facets: &[u32]) -> f64 {
        let net = self.net;
        let outward: f64 = facets
            .iter()
            .map(|&facet| {
                let [a, b, c] = net.part.mesh.corners(net.triangles(facet)[0]);
                let (_, normal) = surface.distance_and_normal((a + b + c) / 3.0);
                normal.dot(net.normal(facet)) * net.area(facet)
            })
            .sum();
        outward.signum()
    }

    /// How far vertices may lie off \[m\].
    pub(super) fn tolerance(&self, surface: &Surface, sag: f64, exactness: Exactness) -> f64 {
        let share = RESIDUAL * surface.radius();
        self.net.floor
            + match exactness {
                Exactness::Exact if matches!(surface.profile, Profile::Circle { major, .. } if major > 0.0) => {
                    share.min(EXACT_TORUS * sag)
                }
                Exactness::Exact => share.min(EXACT * sag),
                Exactness::Noisy => share,
            }
    }

    /// How far vertices of a surface that was found may lie off \[m\].
    pub(super) fn tolerance_of(&self, found: &Found) -> f64 {
        self.tolerance(&found.surface, found.sag, Exactness::Exact).max(found.residual)
    }

    /// Grows `surface` from the facets `start`, which lie on it.
    pub(super) fn grow(
        &mut self,
        mut surface: Surface,
        kind: Kind,
        sign: f64,
        start: &[u32],
        exactness: Exactness,
    ) -> Option<Found> {
        let sag = self.fits(&surface, start, sign, exactness)?;
        let tolerance = self.tolerance(&surface, sag, exactness);
        let ratio = if kind == Kind::Torus { SAG_RATIO_TORUS } else { SAG_RATIO };
        let limit = ratio * sag + 2.0 * tolerance;
        self.stamp += 1;
        let stamp = self.stamp;
        let mut members = start.to_vec();
        members
            .retain(|&facet| self.net.sag(&surface, facet, sign, f64::INFINITY, limit).is_some());
        let mut points = Vec::new();
        for &facet in &members {
            self.member[facet as usize] = stamp;
            self.add_points(facet, &mut points);
        }
        let (mut next, mut refit) = (0, 2 * start.len());
        let mut again: Vec<u32> = Vec::new();
        loop {
            while next < members.len() {
                let facet = members[next];
                next += 1;
                for border in self.net.borders.of(facet as usize) {
                    let other = border.other;
                    let index = other as usize;
                    if self.member[index] == stamp
                        || self.refused[index] == stamp
                        || !self.is_free(other, kind)
                        || !self.net.is_smooth(facet, other)
                    {
                        continue;
                    }
                    if self.net.sag(&surface, other, sign, tolerance, limit).is_some() {
                        self.member[index] = stamp;
                        members.push(other);
                        self.add_points(other, &mut points);
                    } else {
                        self.refused[index] = stamp;
                        again.push(other);
                    }
                }
                if members.len() >= refit {
                    refit *= 2;
                    surface = self.refitted(surface, kind, &points)?;
                }
            }
            surface = self.refitted(surface, kind, &points)?;
            let before = members.len();
            again.retain(|&other| {
                let fits = self.net.sag(&surface, other, sign, tolerance, limit).is_some();
                if fits {
                    self.member[other as usize] = stamp;
                    members.push(other);
                }
                !fits
            });
            if members.len() == before {
                break;
            }
            for index in before..members.len() {
                self.add_points(members[index], &mut points);
            }
        }
        let mut tolerance = tolerance;
        for _ in 0..2 {
            // Where most lie far nearer than they must, the first facets of a tangent surface stand
            // out.
            let usual = self.net.floor + USUAL * median(&surface, &points);
            if usual < tolerance && surface.residual(&points) > usual {
                tolerance = usual;
                members.retain(|&facet| {
                    self.net.sag(&surface, facet, sign, tolerance, limit).is_some()
                });
                points = self.points(&members);
                surface = self.refitted(surface, kind, &points)?;
            }
        }
        let residual = surface.residual(&points);
        if residual > 1.5 * tolerance || members.is_empty() {
            return None;
        }
        let is_row = matches!(surface.profile, Profile::Line { .. }) && is_row(&surface, &points);
        Some(Found { surface, kind, sign, members, points, residual, sag, is_row })
    }

    /// The surface fitted to more points, unless it is as good as they are.
    fn refitted(&self, surface: Surface, kind: Kind, points: &[DVec3]) -> Option<Surface> {
        if surface.residual(points) <= 0.05 * self.net.floor {
            return Some(surface);
        }
        surface.fitted(kind, points)
    }

    /// Gives the members of a surface to it, under the next number.
    pub(super) fn claim(&mut self, found: &Found) {
        let number = self.yields.len() as u32;
        self.yields.push(matches!(found.kind, Kind::Cylinder | Kind::Cone));
        for &facet in &found.members {
            self.owner[facet as usize] = number;
        }
    }
}

/// Median distance of the points \[m\].
fn median(surface: &Surface, points: &[DVec3]) -> f64 {
    let mut distances: Vec<f64> =
        points.iter().map(|&point| surface.distance(point).abs()).collect();
    let middle = distances.len() / 2;
    if distances.is_empty() {
        0.0
    } else {
        *distances.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

/// Whether all points lie at two places along the axis.
fn is_row(surface: &Surface, points: &[DVec3]) -> bool {
    let places = || points.iter().map(|&point| surface.axis.along(point));
    let (low, high) = places().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
        (low.min(place), high.max(place))
    });
    let near = 0.05 * (high - low);
    places().all(|place| place - low < near || high - place < near)
}

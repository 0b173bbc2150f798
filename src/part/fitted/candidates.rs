//! Planes and round faces about some triangles.

use std::f64::consts::PI;

use glam::DVec3;
use nalgebra::Matrix3;
use rustc_hash::FxHashSet;

use super::{FREE, Fitted, Fitting};
use crate::part::CurvedFace;
use crate::part::borders::Borders;
use crate::part::curves::{
    Kind, Profile, Surface, arcs, cone_by_circles, cylinder_along, outer, smallest_direction,
    sphere_through,
};
use crate::part::given::Stated;
use crate::part::regions::Regions;

/// Cosine of the angle between neighbouring regions of one round face: 60 degrees.
const SMOOTH: f64 = 0.5;
/// Area of a connected piece, in areas of the region that it is looked at for.
const PIECE: f64 = 20.0;
/// Triangles of it.
const PIECE_TRIANGLES: usize = 20_000;
/// Triangles of a region that says by itself how it is curved.
const ALONE: usize = 8;
/// Share of a patch's corners that a fit must reach.
const REACHED: f64 = 0.7;
/// Facets of a round face may have this many times the sag of the usual one: 1.6 times its width.
const SAG_RATIO: f64 = 2.56;
/// Height of a face's arc in tolerances, at least: flatter ones are planes.
const HEIGHT: f64 = 2.5;
/// Turn above which nothing but a circle fits a circle \[rad\]: 100 degrees.
const SURE: f64 = 1.75;
/// Residual as a share of the arc's height up to which even a short arc is a circle's.
const EXACT: f64 = 0.002;
/// Correlation of residuals along edges up to which they are noise.
const RANDOM: f64 = 0.25;
/// ... of a face whose turn leaves little doubt: walls of a slot may come near a circle, too.
const RANDOM_SURE: f64 = 0.6;
/// Root mean square distance of its corners in tolerances, at most.
const NOISE: f64 = 0.4;
/// Corners that show it.
const MANY: usize = 12;
/// Corners of a sphere that have its triangles on all sides, at least.
const INNER: usize = 2;
/// How much more area a cone explains where it is no cylinder, and a sphere where it is neither.
const MORE: f64 = 1.3;

/// Residual of a recognised face, as a share of the tolerance, up to which a fit makes it no better.
const EXACTLY: f64 = 0.05;

/// Where a surface comes from that is grown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum From {
    /// Recognised, in a mesh as good as exact.
    Exact,
    /// Recognised in spite of noise.
    Mesh,
    /// Guessed.
    Guess,
}

impl Fitting<'_> {
    /// The plane nearest to the corners of triangles.
    pub(super) fn plane(&mut self, triangles: &[u32]) -> Option<Stated> {
        let points = self.points(triangles);
        let outward: DVec3 =
            triangles.iter().map(|&t| self.areas[t as usize] * self.normals[t as usize]).sum();
        let origin = points.iter().sum::<DVec3>() / points.len() as f64;
        let mut sum = Matrix3::zeros();
        points.iter().for_each(|&point| sum += outer(point - origin, 1.0));
        let (normal, [_, across, _]) = smallest_direction(&sum)?;
        let normal = if normal.dot(outward) < 0.0 { -normal } else { normal };
        // A needle has no plane of its own.
        let is_wide = across > 0.0 && normal.dot(outward) > 0.9 * outward.length();
        let normal = if is_wide { normal } else { outward.try_normalize()? };
        Some(Stated::Plane { origin, normal })
    }

    /// A face that was recognised, with the triangles about it that the tolerance takes in.
    pub(super) fn known(&mut self, face: &CurvedFace) -> Option<Fitted> {
        let (kind, surface) = face.shape.surface()?;
        let sign = if face.outside { 1.0 } else { -1.0 };
        let triangles = self.free(&face.triangles);
        if triangles.len() < face.triangles.len() {
            return None;
        }
        let surface = Stated::Round { kind, surface };
        if kind == Kind::Revolution {
            return Some(Fitted { surface, sign, triangles, sag: f64::INFINITY, is_exact: true });
        }
        let origin =
            if face.residual < EXACTLY * self.tolerance { From::Exact } else { From::Mesh };
        self.grown(surface, sign, &triangles, origin)
    }

    /// The round face about region `index` that explains most.
    pub(super) fn round_about(
        &mut self,
        regions: &Regions,
        borders: &Borders,
        index: usize,
        own: &[u32],
    ) -> Option<Fitted> {
        let normal = regions.all[index].plane.normal;
        let mut patch = own.to_vec();
        let mut axes: Vec<DVec3> = Vec::new();
        for border in borders.of(index) {
            let other = border.other as usize;
            let theirs = regions.all[other].plane.normal;
            let owner = self.owner[regions.triangles(other)[0] as usize];
            if owner == FREE && normal.dot(theirs) > SMOOTH {
                patch.extend(self.free(regions.triangles(other)));
            } else if let Some(Fitted { surface: Stated::Plane { normal, .. }, .. }) =
                self.faces.get(owner as usize)
                && axes.len() < 3
            {
                axes.push(*normal);
            }
        }
        let mut patches = Vec::new();
        if patch.len() > own.len() {
            patches.push(patch);
        }
        if own.len() >= ALONE {
            patches.push(own.to_vec());
        }
        patches.extend(self.piece(own));
        let mut best: Option<(f64, Fitted)> = None;
        for patch in patches {
            for (surface, weight) in self.guesses(&patch, &axes) {
                let Some(found) = self.tried(surface, &patch) else { continue };
                let area = self.area(&found.triangles) * weight;
                if best.as_ref().is_none_or(|best| area > best.0) {
                    best = Some((area, found));
                }
            }
        }
        best.map(|best| best.1)
    }

    /// The connected free triangles about a region, where they are few.
    fn piece(&mut self, own: &[u32]) -> Option<Vec<u32>> {
        let most = PIECE * self.area(own);
        self.stamp += 1;
        let stamp = self.stamp;
        let mut piece = own.to_vec();
        own.iter().for_each(|&t| self.triangle_mark[t as usize] = stamp);
        let (mut next, mut area) = (0, 0.0);
        while next < piece.len() {
            let triangle = piece[next];
            next += 1;
            area += self.areas[triangle as usize];
            if area > most || piece.len() > PIECE_TRIANGLES {
                return None;
            }
            for other in self.neighbours(triangle) {
                let mark = &mut self.triangle_mark[other as usize];
                if *mark != stamp && self.owner[other as usize] == FREE {
                    *mark = stamp;
                    piece.push(other);
                }
            }
        }
        (piece.len() > own.len()).then_some(piece)
    }

    /// First guesses, with weights that prefer the simpler.
    fn guesses(&mut self, patch: &[u32], axes: &[DVec3]) -> Vec<(Stated, f64)> {
        let points = self.points(patch);
        let (mut sum, mut mean, mut area) = (Matrix3::zeros(), DVec3::ZERO, 0.0);
        for &triangle in patch {
            let (normal, own) = (self.normals[triangle as usize], self.areas[triangle as usize]);
            sum += outer(normal, own);
            mean += own * normal;
            area += own;
        }
        let round = |kind, surface: Surface| Stated::Round { kind, surface };
        let mut found = Vec::new();
        let across = smallest_direction(&sum).map(|(direction, _)| direction);
        for direction in across.iter().chain(axes) {
            let guess = cylinder_along(*direction, &points);
            found.extend(guess.map(|surface| (round(Kind::Cylinder, surface), 1.0)));
        }
        if area > 0.0
            && let Some((direction, _)) = smallest_direction(&(sum - outer(mean / area, area)))
            && let Some(surface) = cone_by_circles(direction, &points)
        {
            found.push((round(Kind::Cone, surface), 1.0 / MORE));
        }
        found.extend(
            sphere_through(&points).map(|surface| (round(Kind::Sphere, surface), 1.0 / MORE)),
        );
        found
    }

    /// A guess fitted to a patch, robustly, and grown.
    fn tried(&mut self, guess: Stated, patch: &[u32]) -> Option<Fitted> {
        let Stated::Round { kind, mut surface } = guess else { return None };
        let points = self.points(patch);
        if points.len() < kind.freedoms() + 3 {
            return None;
        }
        let most = 2.0 * self.part.diagonal;
        let is_sound = |surface: &Surface| {
            let radius = surface.radius();
            radius.is_finite() && radius < most && radius > 2.0 * self.tolerance
        };
        let mut near = points.clone();
        for reach in [f64::INFINITY, 3.0, 1.0] {
            if !is_sound(&surface) {
                return None;
            }
            if reach.is_finite() {
                let within =
                    |point: &DVec3| surface.distance(*point).abs() <= reach * self.tolerance;
                near = points.iter().copied().filter(within).collect();
                if (near.len() as f64) < REACHED * points.len() as f64 && reach > 1.0
                    || near.len() < kind.freedoms() + 3
                {
                    return None;
                }
            }
            surface = surface.fitted(kind, &near)?;
        }
        if !is_sound(&surface) || (near.len() as f64) < REACHED * points.len() as f64 {
            return None;
        }
        let surface = Stated::Round { kind, surface };
        let facing: f64 =
            patch.iter().map(|&t| self.areas[t as usize] * self.facing(&surface, t)).sum();
        self.grown(surface, facing.signum(), patch, From::Guess)
    }

    pub(super) fn facing(&self, surface: &Stated, triangle: u32) -> f64 {
        let [a, b, c] = self.part.mesh.corners(triangle);
        surface.facing((a + b + c) / 3.0, self.normals[triangle as usize])
    }

    /// A surface over all connected free triangles that it explains, from those of `start`.
    fn grown(
        &mut self,
        mut surface: Stated,
        sign: f64,
        start: &[u32],
        from: From,
    ) -> Option<Fitted> {
        let again = |fitting: &mut Self, surface: &Stated, triangles: &[u32]| match from {
            From::Exact => Some(*surface),
            _ => fitting.fitted(surface, triangles),
        };
        let mut sags: Vec<f64> = start.iter().map(|&t| self.sag(&surface, t)).collect();
        let middle = sags.len() / 2;
        let usual = *sags.select_nth_unstable_by(middle, f64::total_cmp).1;
        let sag = SAG_RATIO * usual + self.tolerance;
        let mut triangles: Vec<u32> = Vec::new();
        // Once more with what the first growth has taught.
        for _ in 0..2 {
            triangles = start.to_vec();
            triangles.retain(|&t| from != From::Guess || self.accepts(&surface, sign, sag, t));
            self.stamp += 1;
            let mut stamp = self.stamp;
            triangles.iter().for_each(|&t| self.triangle_mark[t as usize] = stamp);
            let (mut next, mut refit) = (0, 2 * triangles.len().max(8));
            while next < triangles.len() {
                let triangle = triangles[next];
                next += 1;
                for other in self.neighbours(triangle) {
                    let index = other as usize;
                    if self.triangle_mark[index] != stamp
                        && self.owner[index] == FREE
                        && self.accepts(&surface, sign, sag, other)
                    {
                        self.triangle_mark[index] = stamp;
                        triangles.push(other);
                    }
                }
                if triangles.len() >= refit {
                    refit *= 2;
                    surface = again(self, &surface, &triangles)?;
                    // The fit has marks of its own.
                    self.stamp += 1;
                    stamp = self.stamp;
                    triangles.iter().for_each(|&t| self.triangle_mark[t as usize] = stamp);
                }
            }
            surface = again(self, &surface, &triangles)?;
        }
        triangles.retain(|&t| from != From::Guess || self.accepts(&surface, sign, sag, t));
        let found = Fitted { surface, sign, triangles, sag, is_exact: from == From::Exact };
        (from != From::Guess || self.is_round(&found)).then_some(found)
    }

    /// Whether triangles show that a surface is what they are meant for.
    fn is_round(&self, found: &Fitted) -> bool {
        let Stated::Round { kind, surface } = found.surface else { return false };
        if found.triangles.is_empty() {
            return false;
        }
        let radius = surface.radius();
        let turn = match surface.profile {
            Profile::Line { .. } => arcs(self.part, &found.triangles, surface.axis).0,
            Profile::Circle { .. } => self.cap(&found.triangles, surface.axis.origin),
        };
        // Two arcs always lie on a sphere.
        if matches!(surface.profile, Profile::Circle { .. }) && self.inner(&found.triangles) < INNER
        {
            return false;
        }
        let height = radius * (1.0 - (turn.min(PI) / 2.0).cos());
        if height.is_nan() || height < HEIGHT * self.tolerance {
            return false;
        }
        let sure = match kind {
            Kind::Cylinder => turn > SURE,
            _ => turn > 1.5 * SURE,
        };
        let (mut products, mut squares, mut count) = (0.0, 0.0, 0);
        for &triangle in &found.triangles {
            let [a, b, c] = self.part.mesh.corners(triangle).map(|point| surface.distance(point));
            products += a * b + b * c + c * a;
            squares += a * a + b * b + c * c;
            count += 1;
        }
        let rms = (squares / (3.0 * f64::from(count))).sqrt();
        let is_noise = |correlation: f64| products < correlation * squares;
        let sure = sure && rms < NOISE * self.tolerance && is_noise(RANDOM_SURE);
        sure || rms < EXACT * height || (count as usize >= MANY && is_noise(RANDOM))
    }

    /// Number of corners that have these triangles on all sides.
    fn inner(&self, triangles: &[u32]) -> usize {
        let own: FxHashSet<u32> = triangles.iter().copied().collect();
        let mesh = &self.part.mesh.triangles;
        let is_one = |triangle: u32| own.contains(&triangle);
        let rim = self.part.edges.rim(mesh, triangles.iter().copied(), is_one);
        let all: FxHashSet<u32> = triangles.iter().flat_map(|&t| mesh[t as usize]).collect();
        all.difference(&rim).count()
    }

    /// The angle that triangles cover of a sphere about its centre \[rad\].
    fn cap(&self, triangles: &[u32], centre: DVec3) -> f64 {
        let corners = || {
            triangles
                .iter()
                .flat_map(|&t| self.part.mesh.corners(t))
                .map(|corner| (corner - centre).normalize_or_zero())
        };
        let middle = corners().sum::<DVec3>().normalize_or_zero();
        2.0 * corners().map(|out| middle.angle_between(out)).fold(0.0, f64::max)
    }
}

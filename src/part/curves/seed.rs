//! First guesses of the surface about a facet.

use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, Vector3};

use super::Axis;
use super::fit::{Kind, Profile, Surface, circle};
use super::grow::{Exactness, Found, Growth, SAG_RATIO};
use super::net::Net;

/// Cosine of the angle under which neighbours count as bent: above 0.03 degrees. Regions of one
/// plane that rounding has parted are none.
const BENT: f64 = 1.0 - 1.5e-7;
/// How much larger or smaller a facet of the same surface may be than the first.
const COMPARABLE: f64 = 4.0;
/// ... in a patch of triangles of all shapes.
const PATCH_RATIO: f64 = 10.0;
/// Facets of a patch.
const PATCH: usize = 12;
/// Distance of corners from a first guess as a multiple of the facets' sag that a fit can mend.
const POOR: f64 = 2.0;
/// Sine of the angle between the strips of a cylinder and the direction about which they bend, at most.
pub(super) const STEEPEST: f64 = 0.1;
/// Sine of that angle above which strips are no cone's: a slope of a quarter of a degree.
const FLAT: f64 = 0.99999;
/// Points that a fit needs beyond its parameters, to be a test.
pub(super) const SPARE: usize = 2;
/// ... and as many again for a torus, which comes near to many a surface.
const SPARE_TORUS: usize = 7;

fn bent(net: &Net<'_>, a: u32, b: u32) -> bool {
    net.normal(a).dot(net.normal(b)) < BENT && net.is_smooth(a, b)
}

pub(super) fn comparable(net: &Net<'_>, a: u32, b: u32, ratio: f64) -> bool {
    let (a, b) = (net.area(a), net.area(b));
    a <= ratio * b && b <= ratio * a
}

/// Bent neighbours of a facet that may lie on one surface with it, longest border first.
fn neighbours(net: &Net<'_>, facet: u32, ratio: f64) -> Vec<u32> {
    let mut found: Vec<(f64, u32)> = net
        .borders
        .of(facet as usize)
        .iter()
        .filter(|border| {
            bent(net, facet, border.other) && comparable(net, facet, border.other, ratio)
        })
        .map(|border| (border.length, border.other))
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    found.into_iter().map(|(_, other)| other).collect()
}

pub(in crate::part) fn smallest_direction(sum: &Matrix3<f64>) -> Option<(DVec3, [f64; 3])> {
    let eigen = sum.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let column = eigen.eigenvectors.column(order[0]);
    let direction = DVec3::new(column[0], column[1], column[2]).try_normalize()?;
    Some((direction, order.map(|index| eigen.eigenvalues[index])))
}

pub(in crate::part) fn outer(v: DVec3, weight: f64) -> Matrix3<f64> {
    let v = Vector3::new(v.x, v.y, v.z);
    v * v.transpose() * weight
}

/// The cylinder along `direction` through points.
pub(in crate::part) fn cylinder_along(direction: DVec3, points: &[DVec3]) -> Option<Surface> {
    let (u, v) = direction.any_orthonormal_pair();
    let (x, y, radius) = circle(points.iter().map(|point| (point.dot(u), point.dot(v))))?;
    let along = points.iter().map(|point| point.dot(direction)).sum::<f64>() / points.len() as f64;
    Some(Surface {
        axis: Axis { origin: u * x + v * y + direction * along, direction },
        profile: Profile::Line { radius, slope: 0.0 },
    })
}

/// The cone about `direction` that touches the planes of three facets.
fn cone_along(net: &Net<'_>, direction: DVec3, row: [u32; 3], points: &[DVec3]) -> Option<Surface> {
    let normals = row.map(|facet| net.normal(facet));
    let offsets = row.map(|facet| net.normal(facet).dot(net.centre(facet)));
    let matrix = DMat3::from_cols(normals[0], normals[1], normals[2]).transpose();
    if matrix.determinant().abs() < 1e-12 {
        return None;
    }
    let apex = matrix.inverse() * DVec3::from_array(offsets);
    let along = points.iter().map(|&point| (point - apex).dot(direction)).sum::<f64>()
        / points.len() as f64;
    let radius = points.iter().map(|&point| (point - apex).cross(direction).length()).sum::<f64>()
        / points.len() as f64;
    let slope = (radius / along).atan();
    let axis = Axis { origin: apex + direction * along, direction };
    (radius.is_finite() && slope.is_finite())
        .then_some(Surface { axis, profile: Profile::Line { radius, slope } })
}

/// The sphere through points, by linear least squares.
pub(in crate::part) fn sphere_through(points: &[DVec3]) -> Option<Surface> {
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut matrix = Matrix3::zeros();
    let mut right = DVec3::ZERO;
    for &point in points {
        let point = point - mean;
        matrix += outer(point, 1.0);
        right += point * point.length_squared() / 2.0;
    }
    let centre = matrix.cholesky()?.solve(&Vector3::new(right.x, right.y, right.z));
    let centre = mean + DVec3::new(centre[0], centre[1], centre[2]);
    let radius =
        points.iter().map(|point| point.distance(centre)).sum::<f64>() / points.len() as f64;
    radius.is_finite().then_some(Surface {
        axis: Axis { origin: centre, direction: DVec3::Z },
        profile: Profile::Circle { major: 0.0, minor: radius },
    })
}

/// The axis that the normals of all facets meet, by Pottmann's line complex: `a . (c x n) + b . n`
/// is zero for each normal `n` at `c`, where `b = o x a`.
fn axis_of_normals(net: &Net<'_>, facets: &[u32], mean: DVec3) -> Option<Axis> {
    let (mut aa, mut ab, mut bb) = (Matrix3::zeros(), Matrix3::zeros(), Matrix3::zeros());
    for &facet in facets {
        let normal = net.normal(facet);
        let moment = (net.centre(facet) - mean).cross(normal);
        let weight = net.area(facet);
        let (n, m) = (
            Vector3::new(normal.x, normal.y, normal.z),
            Vector3::new(moment.x, moment.y, moment.z),
        );
        aa += m * m.transpose() * weight;
        ab += m * n.transpose() * weight;
        bb += n * n.transpose() * weight;
    }
    let inverse = (bb + Matrix3::identity() * (1e-13 * bb.trace())).try_inverse()?;
    let (direction, _) = smallest_direction(&(aa - ab * inverse * ab.transpose()))?;
    let moment = -inverse * ab.transpose() * Vector3::new(direction.x, direction.y, direction.z);
    let moment = DVec3::new(moment[0], moment[1], moment[2]);
    let moment = moment - direction * moment.dot(direction);
    Some(Axis { origin: mean + direction.cross(moment), direction })
}

/// The torus about `axis` through points.
fn torus_about(axis: Axis, points: &[DVec3]) -> Option<Surface> {
    let profile = points.iter().map(|&point| (axis.along(point), axis.distance(point)));
    let (s, r, minor) = circle(profile)?;
    (r > 0.0).then_some(Surface {
        axis: Axis { origin: axis.origin + axis.direction * s, ..axis },
        profile: Profile::Circle { major: r, minor },
    })
}

impl Growth<'_> {
    /// Greatest distance of the middles of some facets' chords from a surface \[m\].
    fn rough_sag(&self, surface: &Surface, facets: &[u32]) -> f64 {
        let middles = facets.iter().take(3).flat_map(|&facet| self.net.middles(facet));
        middles.map(|middle| surface.distance(middle).abs()).fold(0.0, f64::max)
    }

    /// Fits and grows from `facets`, where the points are enough to test a fit and the first guess
    /// is within reach of the answer.
    fn attempt(
        &mut self,
        guess: Option<Surface>,
        kind: Kind,
        facets: &[u32],
        points: &[DVec3],
        exactness: Exactness,
    ) -> Option<Found> {
        let guess = guess?;
        let spare = if kind == Kind::Torus { SPARE_TORUS } else { SPARE };
        if points.len() < kind.freedoms() + spare
            || !guess.radius().is_finite()
            || guess.radius() > 20.0 * self.net.part.diagonal
        {
            return None;
        }
        // The first guess of a sphere is as good as its fit but for noise.
        let poor = if kind == Kind::Sphere { 0.1 * POOR } else { POOR };
        // Out of reach: exact facets come near at once, whereas most facets of a freely curved
        // surface end here.
        let reach = match exactness {
            Exactness::Exact => poor * self.rough_sag(&guess, facets) + 4.0 * self.net.floor,
            Exactness::Noisy => f64::INFINITY,
        };
        if guess.residual(points) > reach.min(0.1 * guess.radius()) {
            return None;
        }
        let surface = guess.fitted(kind, points)?;
        let sign = self.sign(&surface, facets);
        self.grow(surface, kind, sign, facets, exactness)
    }

    /// Rows of three facets with `seed` in the middle, bent the same way, each with the direction about
    /// which it bends.
    pub(super) fn rows(&self, seed: u32) -> Vec<([u32; 3], DVec3)> {
        let net = self.net;
        let others = neighbours(net, seed, COMPARABLE);
        let centre = net.centre(seed);
        let mut rows = Vec::new();
        for (index, &one) in others.iter().enumerate().take(4) {
            for &other in others.iter().skip(index + 1).take(4) {
                let (a, b) = (net.centre(one) - centre, net.centre(other) - centre);
                // Both sides, bent the same way.
                if a.dot(b) > -0.3 * a.length() * b.length()
                    || net.bend(seed, one) * net.bend(seed, other) <= 0.0
                {
                    continue;
                }
                let row = [one, seed, other];
                let [first, middle, last] = row.map(|facet| net.normal(facet));
                let about = (middle - first).cross(last - middle).try_normalize();
                rows.extend(about.map(|direction| (row, direction)));
            }
        }
        rows
    }

    /// A cylinder or cone by a row of three facets with `seed` in the middle.
    pub(super) fn by_row(&mut self, seed: u32) -> Option<Found> {
        let net = self.net;
        let mut best: Option<Found> = None;
        for (row, direction) in self.rows(seed) {
            let points = self.points(&row);
            let rise = direction.dot(net.normal(seed)).abs();
            let mut guesses = Vec::new();
            if rise < STEEPEST {
                guesses.push((Kind::Cylinder, cylinder_along(direction, &points)));
            }
            if (1e-4..FLAT).contains(&rise) {
                guesses.push((Kind::Cone, cone_along(net, direction, row, &points)));
            }
            for (kind, guess) in guesses {
                let found = self.attempt(guess, kind, &row, &points, Exactness::Exact);
                // Of a row about the axis and one along the tube of a torus the first is larger.
                if let Some(found) = found
                    && self.is_even_row(&found, &row)
                    && best
                        .as_ref()
                        .is_none_or(|best| self.area_of(&found) > 1.02 * self.area_of(best))
                {
                    best = Some(found);
                }
            }
        }
        best
    }

    /// Whether the facets of a row are about as wide: a flat beside strips of a shaft is none of them.
    fn is_even_row(&self, found: &Found, row: &[u32]) -> bool {
        let sags = row.iter().filter_map(|&facet| {
            let infinite = f64::INFINITY;
            self.net.sag(&found.surface, facet, found.sign, infinite, infinite)
        });
        let (least, most) =
            sags.fold((f64::INFINITY, 0.0_f64), |(low, high), sag| (low.min(sag), high.max(sag)));
        most <= SAG_RATIO * least + 2.0 * self.net.floor
    }

    /// Facets about `seed` that may lie on one surface with it, nearest first.
    pub(super) fn patch(&self, seed: u32, most: usize) -> Vec<u32> {
        let mut patch = vec![seed];
        let mut next = 0;
        while next < patch.len() && patch.len() < most {
            for other in neighbours(self.net, patch[next], PATCH_RATIO) {
                if patch.len() < most
                    && comparable(self.net, seed, other, PATCH_RATIO)
                    && !patch.contains(&other)
                {
                    patch.push(other);
                }
            }
            next += 1;
        }
        patch
    }

    /// A sphere by the facets about `seed`.
    pub(super) fn sphere_at(&mut self, seed: u32) -> Option<Found> {
        let patch = self.patch(seed, PATCH);
        if patch.len() < 6 {
            return None;
        }
        let points = self.points(&patch);
        let found = self.sphere_of(&patch, &points, Exactness::Exact);
        if found.is_some() {
            return found;
        }
        // Others about it may be cut off: three that share a corner.
        let net = self.net;
        let beside = neighbours(net, seed, COMPARABLE);
        let beside = &beside[..beside.len().min(4)];
        let corner = |one: u32, other: u32| {
            let [a, b] = [one, other].map(|facet| net.centre(facet) - net.centre(seed));
            a.dot(b).abs() < 0.5 * a.length() * b.length()
        };
        for (index, &one) in beside.iter().enumerate() {
            for &other in beside[index + 1..].iter().filter(|&&other| corner(one, other)) {
                let three = [one, seed, other];
                let points = self.points(&three);
                let found = self.sphere_of(&three, &points, Exactness::Exact);
                if found.is_some() {
                    return found;
                }
            }
        }
        None
    }

    pub(super) fn sphere_of(
        &mut self,
        patch: &[u32],
        points: &[DVec3],
        exactness: Exactness,
    ) -> Option<Found> {
        self.attempt(sphere_through(points), Kind::Sphere, patch, points, exactness)
    }

    /// A cylinder, cone or torus by the facets about `seed`, for meshes without rows.
    pub(super) fn by_patch(&mut self, seed: u32) -> Option<Found> {
        let patch = self.patch(seed, 2 * PATCH);
        if patch.len() < PATCH || self.patience == 0 {
            return None;
        }
        let points = self.points(&patch);
        let line = self.line_of(&patch, &points, Exactness::Exact);
        if line.is_some() {
            return line;
        }
        let patch = self.patch(seed, 4 * PATCH);
        let points = self.points(&patch);
        let torus = self.torus_of(&patch, &points, Exactness::Exact);
        if torus.is_none() {
            self.patience -= 1;
        }
        torus
    }

    /// A cylinder or cone by the normals of `patch`.
    pub(super) fn line_of(
        &mut self,
        patch: &[u32],
        points: &[DVec3],
        exactness: Exactness,
    ) -> Option<Found> {
        let net = self.net;
        let mut sum = Matrix3::zeros();
        let (mut mean, mut area) = (DVec3::ZERO, 0.0);
        for &facet in patch {
            sum += outer(net.normal(facet), net.area(facet));
            mean += net.normal(facet) * net.area(facet);
            area += net.area(facet);
        }
        let (direction, values) = smallest_direction(&sum)?;
        if values[0] < 0.3 * values[1] {
            let guess = cylinder_along(direction, points);
            let found = self.attempt(guess, Kind::Cylinder, patch, points, exactness);
            if found.is_some() {
                return found;
            }
        }
        let (direction, values) = smallest_direction(&(sum - outer(mean / area, area)))?;
        if values[0] > 0.5 * values[1] || direction.dot(mean).abs() > 0.998 * area {
            return None;
        }
        let guess = cone_by_circles(direction, points)?;
        self.attempt(Some(guess), Kind::Cone, patch, points, exactness)
    }

    pub(super) fn torus_of(
        &mut self,
        patch: &[u32],
        points: &[DVec3],
        exactness: Exactness,
    ) -> Option<Found> {
        let mean = points.iter().sum::<DVec3>() / points.len() as f64;
        let axis = axis_of_normals(self.net, patch, mean)?;
        let found =
            self.attempt(torus_about(axis, points), Kind::Torus, patch, points, exactness)?;
        let Profile::Circle { major, minor } = found.surface.profile else { return None };
        // Nearly a cylinder, or nearly a sphere: it says nothing.
        (major < 100.0 * minor && major > 1e-3 * minor).then_some(found)
    }
}

/// A cone about `direction` through points: its axis by the circle through them all, which the fit
/// corrects, its slope by the distances' trend along it.
pub(in crate::part) fn cone_by_circles(direction: DVec3, points: &[DVec3]) -> Option<Surface> {
    let mut surface = cylinder_along(direction, points)?;
    let (mut ss, mut sr) = (0.0, 0.0);
    let Profile::Line { radius, .. } = surface.profile else { return None };
    for &point in points {
        let s = surface.axis.along(point);
        ss += s * s;
        sr += s * (surface.axis.distance(point) - radius);
    }
    surface.profile = Profile::Line { radius, slope: (sr / ss.max(f64::MIN_POSITIVE)).atan() };
    Some(surface)
}

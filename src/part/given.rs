//! Faces that the file itself states: a CAD kernel knows the surface of each.
//!
//! Readers number the triangles by face ([`Given`]); the numbers travel with the triangles through
//! the repairs. [`GivenFaces`] then checks the statements against the triangles and joins what
//! kernels split: neighbouring faces of one plane, cylinder and so on.

use glam::DVec3;
use rustc_hash::FxHashMap;

#[cfg(feature = "step")]
use super::curves::Axis;
use super::curves::{Kind, Profile, Surface};
use super::order::Places;
use super::repair::Repaired;
use super::topology::NONE;
use super::{FaceSource, Mesh, Residual};
use crate::geometry::UnionFind;
use crate::text::counted;

/// Distance of a corner from the surface of its face, as a share of the part's diagonal, up to which
/// the triangles agree with what the file states: what tessellation may leave.
const AGREES: f64 = 1e-4;
/// ... as a share of the surface's radius.
const AGREES_ROUND: f64 = 0.05;
/// Cosine of the angle between a triangle and its surface above which they disagree: 37 degrees.
const ASKEW: f64 = 0.8;
/// Share of a face's area that may be askew: needles.
const FEW: f64 = 0.05;
/// Distance within which surfaces of neighbouring faces are one, as a share of the diagonal.
const SAME: f64 = 1e-7;

/// The surface of a face as the file states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stated {
    /// A plane through a point; of its normal the direction alone counts.
    Plane { origin: DVec3, normal: DVec3 },
    /// A surface of revolution; the profile of [`Kind::Revolution`] is not known.
    Round { kind: Kind, surface: Surface },
    /// Something else, or nothing that makes sense.
    Other,
}

impl Stated {
    /// From the kernel's kind (1 to 6: plane, cylinder, cone, sphere, torus, revolution), a point of
    /// the plane or axis, its direction, and two sizes: the radius of a cylinder or sphere; of a
    /// cone the radius at the point, and the angle; of a torus both radii.
    #[cfg(feature = "step")]
    pub(super) fn from_kernel(kind: u8, numbers: [f64; 8]) -> Self {
        let [x, y, z, dx, dy, dz, first, second] = numbers;
        let (origin, direction) = (DVec3::new(x, y, z), DVec3::new(dx, dy, dz).try_normalize());
        let (Some(direction), true) = (direction, numbers.iter().all(|number| number.is_finite()))
        else {
            return Stated::Other;
        };
        let line = |slope| Profile::Line { radius: first, slope };
        let circle = |major, minor| Profile::Circle { major, minor };
        let (kind, profile, is_sound) = match kind {
            1 => return Stated::Plane { origin, normal: direction },
            2 => (Kind::Cylinder, line(0.0), first > 0.0),
            3 => (Kind::Cone, line(second), second != 0.0 && second.abs() < 1.57),
            4 => (Kind::Sphere, circle(0.0, first), first > 0.0),
            5 => (Kind::Torus, circle(first, second), first > 0.0 && second > 0.0),
            6 => (Kind::Revolution, line(0.0), true),
            _ => return Stated::Other,
        };
        let surface = Surface { axis: Axis { origin, direction }, profile };
        if is_sound { Stated::Round { kind, surface } } else { Stated::Other }
    }

    fn scaled(self, scale: f64) -> Self {
        match self {
            Stated::Plane { origin, normal } => Stated::Plane { origin: scale * origin, normal },
            Stated::Round { kind, surface } => {
                Stated::Round { kind, surface: surface.scaled(scale) }
            }
            Stated::Other => Stated::Other,
        }
    }

    /// Distance of a point \[m\]; 0 where the profile is not known.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        match self {
            Stated::Plane { origin, normal } => (point - *origin).dot(*normal).abs(),
            Stated::Round { kind: Kind::Revolution, .. } | Stated::Other => 0.0,
            Stated::Round { surface, .. } => surface.distance(point).abs(),
        }
    }

    /// Cosine of the angle between the surface's normal at a point, away from the axis or tube, and
    /// `direction`.
    pub(super) fn facing(&self, point: DVec3, direction: DVec3) -> f64 {
        match self {
            Stated::Plane { normal, .. } => normal.dot(direction),
            Stated::Round { kind: Kind::Revolution, surface } => {
                // What is known of the normal: it meets the axis.
                let away = (point - surface.axis.foot(point)).normalize_or_zero();
                let along = direction.dot(surface.axis.direction);
                let outward = direction.dot(away);
                outward.hypot(along).copysign(outward)
            }
            Stated::Round { surface, .. } => surface.distance_and_normal(point).1.dot(direction),
            Stated::Other => 0.0,
        }
    }

    /// How far corners may lie off \[m\].
    fn tolerance(&self, diagonal: f64, corners: &[DVec3]) -> f64 {
        let radius = match self {
            Stated::Round { kind: Kind::Cylinder | Kind::Cone, surface } => {
                corners.iter().map(|&corner| surface.axis.distance(corner)).fold(0.0, f64::max)
            }
            Stated::Round { surface, .. } => surface.radius(),
            _ => f64::INFINITY,
        };
        (AGREES * diagonal).min(AGREES_ROUND * radius)
    }

    /// The same surface, a cone with the half on which the corners lie.
    fn turned_to(self, corners: &[DVec3]) -> Self {
        let Stated::Round { kind: Kind::Cone, mut surface } = self else { return self };
        let Profile::Line { radius, slope } = surface.profile else { return self };
        let side: f64 =
            corners.iter().map(|&corner| radius + surface.axis.along(corner) * slope.tan()).sum();
        if side < 0.0 {
            surface.axis.direction = -surface.axis.direction;
            surface.profile = Profile::Line { radius: -radius, slope };
        }
        Stated::Round { kind: Kind::Cone, surface }
    }

    fn is_of_kind(&self, other: &Stated) -> bool {
        match (self, other) {
            (Stated::Plane { .. }, Stated::Plane { .. }) => true,
            // Two surfaces of revolution may have any profiles.
            (Stated::Round { kind: a, surface: one }, Stated::Round { kind: b, surface: two }) => {
                a == b && (*a != Kind::Revolution || one == two)
            }
            _ => false,
        }
    }
}

/// What is known of each triangle from the file: which face it belongs to (empty where the file
/// states none), and where it stands.
#[derive(Debug, Default)]
pub(super) struct Given {
    of: Vec<u32>,
    surfaces: Vec<Stated>,
    places: Places,
}

impl Given {
    /// The triangles that follow belong to a face of this surface.
    #[cfg(feature = "step")]
    pub(super) fn begin(&mut self, surface: Stated) {
        self.surfaces.push(surface);
    }

    /// A triangle of the last face.
    #[inline]
    pub(super) fn push(&mut self) {
        if !self.surfaces.is_empty() {
            self.of.push(self.surfaces.len() as u32 - 1);
        }
    }

    pub(super) fn scale(&mut self, scale: f64) {
        for surface in &mut self.surfaces {
            *surface = surface.scaled(scale);
        }
    }

    /// What belongs to the triangles follows them to other `places`.
    pub(super) fn set_places(&mut self, places: Places) {
        if !self.of.is_empty() {
            let origins = places.triangles.iter();
            self.of = origins.map(|&origin| self.of[origin as usize / 3]).collect();
        }
        self.places = places;
    }

    /// Where vertices and triangles stood in the file.
    pub(super) fn take_places(&mut self) -> Places {
        std::mem::take(&mut self.places)
    }

    /// Removes all triangles of `mesh` but those, by number and corners, that `keep` takes.
    pub(super) fn retain(&mut self, mesh: &mut Mesh, keep: impl Fn(usize, [u32; 3]) -> bool) {
        for of in [&mut self.of, &mut self.places.triangles].into_iter().filter(|of| !of.is_empty())
        {
            let mut triangles = mesh.triangles.iter().enumerate();
            of.retain(|_| triangles.next().is_none_or(|(index, &corners)| keep(index, corners)));
        }
        let mut index = 0;
        mesh.triangles.retain(|&corners| {
            index += 1;
            keep(index - 1, corners)
        });
    }

    /// As many triangles as `count` were added at the end, pieces of `triangle`.
    pub(super) fn repeat(&mut self, triangle: u32, count: usize) {
        for of in [&mut self.of, &mut self.places.triangles] {
            if let Some(&known) = of.get(triangle as usize) {
                of.resize(of.len() + count, known);
            }
        }
    }

    /// Whether the file is a mesh in another dress: all of its faces are planes, and most of them
    /// single triangles, so that it says nothing of the surfaces that they stand for.
    fn is_mesh(&self) -> bool {
        let mut triangles = vec![0_u32; self.surfaces.len()];
        self.of.iter().for_each(|&face| triangles[face as usize] += 1);
        let single = triangles.iter().filter(|count| **count == 1).count();
        2 * single > self.surfaces.len()
            && self.surfaces.iter().all(|surface| matches!(surface, Stated::Plane { .. }))
    }
}

/// Corners of triangles, each once.
pub(super) fn corners(mesh: &Mesh, triangles: &[u32]) -> Vec<DVec3> {
    let mut vertices: Vec<u32> =
        triangles.iter().flat_map(|&t| mesh.triangles[t as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices.into_iter().map(|vertex| mesh.vertices[vertex as usize]).collect()
}

/// A face that the file states, and its triangles agree.
pub(super) struct GivenFace {
    pub surface: Stated,
    /// 1 where the outward normal is that of the surface (away from the axis or tube), else -1.
    pub sign: f64,
    /// Ascending.
    pub triangles: Vec<u32>,
    /// Corners of its triangles, each once.
    pub corners: Vec<DVec3>,
    /// Greatest distance of those from the surface \[m\].
    pub residual: f64,
    /// Of a face that was fitted instead: how far corners lay off before they were moved onto it.
    pub fit: Option<Residual>,
}

/// All faces that the file states.
#[derive(Default)]
pub(super) struct GivenFaces {
    pub all: Vec<GivenFace>,
    /// Face of each triangle, or [`NONE`]; empty where the file states none.
    of: Vec<u32>,
}

impl GivenFaces {
    /// Checks what the file states, and joins neighbouring faces of one surface. Faces whose
    /// triangles contradict it are left out, with a warning.
    pub(super) fn new(part: &mut Repaired) -> Self {
        if part.given.of.is_empty() || part.given.is_mesh() {
            return Self::default();
        }
        let faces = part.given.surfaces.len();
        let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); faces];
        for (&face, triangle) in part.given.of.iter().zip(0..) {
            triangles[face as usize].push(triangle);
        }
        let (mut refused, mut farthest, mut place) = (0, 0.0_f64, DVec3::ZERO);
        let checked: Vec<Option<GivenFace>> = part
            .given
            .surfaces
            .iter()
            .zip(triangles)
            .map(|(&surface, triangles)| {
                if surface == Stated::Other || triangles.is_empty() {
                    return None;
                }
                let face = GivenFace::new(&part.mesh, surface, triangles);
                if face.agrees(part) {
                    return Some(face);
                }
                refused += 1;
                if face.residual >= farthest {
                    (farthest, place) = (face.residual, part.mesh.corners(face.triangles[0])[0]);
                }
                None
            })
            .collect();
        if refused > 0 {
            let faces = counted(refused, "face");
            let place = place * 1e3;
            part.health.warnings.push(format!(
                "the surfaces that the file states for {faces} are not where their triangles lie (up to {:.2} um off, near {:.3}, {:.3}, {:.3} mm): \
                 what they are was found from the triangles",
                farthest * 1e6,
                place.x,
                place.y,
                place.z
            ));
        }
        Self::joined(part, checked)
    }

    fn joined(part: &Repaired, faces: Vec<Option<GivenFace>>) -> Self {
        let mut sets = UnionFind::new(faces.len());
        let mut seen: FxHashMap<(u32, u32), ()> = FxHashMap::default();
        for (half, &twin) in part.edges.twin.iter().enumerate() {
            if twin == NONE {
                continue;
            }
            let [a, b] = [half / 3, (twin / 3) as usize].map(|t| part.given.of[t]);
            if a < b
                && seen.insert((a, b), ()).is_none()
                && let (Some(one), Some(other)) = (&faces[a as usize], &faces[b as usize])
                && one.is_same(other, SAME * part.diagonal)
            {
                sets.join(a as usize, b as usize);
            }
        }
        // The greatest of those that are one states it for all.
        let mut groups: FxHashMap<usize, Vec<GivenFace>> = FxHashMap::default();
        let mut order = Vec::new();
        for (number, face) in faces.into_iter().enumerate() {
            let root = sets.root(number);
            if let Some(face) = face {
                let group = groups.entry(root).or_default();
                if group.is_empty() {
                    order.push(root);
                }
                group.push(face);
            }
        }
        let mut found = Self { all: Vec::new(), of: vec![NONE; part.mesh.triangles.len()] };
        for root in order {
            let Some(group) = groups.remove(&root) else { continue };
            let face = GivenFace::merged(&part.mesh, group);
            for &triangle in &face.triangles {
                found.of[triangle as usize] = found.all.len() as u32;
            }
            found.all.push(face);
        }
        found
    }

    /// Adds a face that was fitted to triangles of none.
    pub(super) fn push(
        &mut self,
        mesh: &Mesh,
        surface: Stated,
        triangles: Vec<u32>,
        fit: Residual,
    ) {
        self.of.resize(mesh.triangles.len(), NONE);
        for &triangle in &triangles {
            self.of[triangle as usize] = self.all.len() as u32;
        }
        self.all.push(GivenFace { fit: Some(fit), ..GivenFace::new(mesh, surface, triangles) });
    }

    pub(super) fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Number of the face of a triangle, or [`NONE`].
    pub(super) fn of(&self, triangle: u32) -> u32 {
        self.of.get(triangle as usize).copied().unwrap_or(NONE)
    }

    /// The face of a triangle.
    pub(super) fn face(&self, triangle: u32) -> Option<&GivenFace> {
        self.all.get(self.of(triangle) as usize)
    }
}

impl GivenFace {
    fn new(mesh: &Mesh, surface: Stated, triangles: Vec<u32>) -> Self {
        let corners = corners(mesh, &triangles);
        let surface = surface.turned_to(&corners);
        let mut face = Self { surface, sign: 1.0, triangles, corners, residual: 0.0, fit: None };
        face.residual = face.off(&face.corners);
        let outward: f64 = face.facings(mesh).map(|(area, facing)| area * facing).sum();
        face.sign = outward.signum();
        if let Stated::Plane { normal, .. } = &mut face.surface {
            *normal *= std::mem::replace(&mut face.sign, 1.0);
        }
        face
    }

    pub(super) fn source(&self) -> FaceSource {
        if self.fit.is_some() { FaceSource::Fit } else { FaceSource::File }
    }

    pub(super) fn is_plane(&self) -> bool {
        matches!(self.surface, Stated::Plane { .. })
    }

    /// Several of one surface.
    fn merged(mesh: &Mesh, mut group: Vec<GivenFace>) -> Self {
        let area = |face: &GivenFace| face.facings(mesh).map(|(area, _)| area).sum::<f64>();
        let largest = (0..group.len()).max_by(|&a, &b| {
            // The first of equals.
            area(&group[a]).total_cmp(&area(&group[b])).then(b.cmp(&a))
        });
        if group.len() == 1 {
            return group.remove(0);
        }
        let surface = group[largest.unwrap_or(0)].surface;
        let mut triangles: Vec<u32> = group.into_iter().flat_map(|face| face.triangles).collect();
        triangles.sort_unstable();
        Self::new(mesh, surface, triangles)
    }

    /// Area of each triangle, and how it faces the surface's normal.
    fn facings(&self, mesh: &Mesh) -> impl Iterator<Item = (f64, f64)> {
        self.triangles.iter().map(|&triangle| {
            let [a, b, c] = mesh.corners(triangle);
            let cross = (b - a).cross(c - a);
            let normal = cross.normalize_or_zero();
            (cross.length() / 2.0, self.surface.facing((a + b + c) / 3.0, normal))
        })
    }

    /// Greatest distance of points \[m\].
    fn off(&self, points: &[DVec3]) -> f64 {
        points.iter().map(|&point| self.surface.distance(point)).fold(0.0, f64::max)
    }

    fn agrees(&self, part: &Repaired) -> bool {
        let (mut askew, mut total) = (0.0, 0.0);
        for (area, facing) in self.facings(&part.mesh) {
            total += area;
            askew += if self.sign * facing < ASKEW { area } else { 0.0 };
        }
        askew <= FEW * total
            && self.residual <= self.surface.tolerance(part.diagonal, &self.corners)
    }

    /// Whether two neighbours are one face.
    fn is_same(&self, other: &GivenFace, tolerance: f64) -> bool {
        self.surface.is_of_kind(&other.surface)
            && self.sign == other.sign
            && self.off(&other.corners) <= tolerance + other.residual
            && other.off(&self.corners) <= tolerance + self.residual
            && match (&self.surface, &other.surface) {
                (Stated::Plane { normal: a, .. }, Stated::Plane { normal: b, .. }) => {
                    a.dot(*b) > 0.0
                }
                _ => true,
            }
    }
}

//! Planes and round faces fitted to a noisy mesh within a tolerance.
//!
//! The largest faces come first: planes grown with the tolerance ([`crate::part::regions`]), unless
//! a cylinder, cone or sphere about the same triangles explains more ([`candidates`]). Neighbouring
//! faces then settle which triangle is whose ([`settle`]), and the corners are moved onto the faces
//! that they belong to ([`snap`]), so that everything after this sees a clean mesh.

use glam::DVec3;

use super::curves::Kind;
use super::facets::Facets;
use super::given::{self, GivenFaces, Stated};
use super::regions::{self, Flatness};
use super::repair::Repaired;
use super::topology::NONE;
use super::{CurvedFace, Residual};
use crate::error::{Error, Result};
use crate::text::counted;

mod candidates;
mod settle;
mod snap;

/// Share of the part's diagonal that a tolerance may have: beyond it the part is gone.
const MOST: f64 = 0.02;
/// Width of a plane in tolerances, at least; of one that is a single triangle.
const NARROWEST: [f64; 2] = [4.0, 10.0];
/// How much more area than a plane a round face explains where it is taken instead.
const BETTER: f64 = 1.3;
/// Share of a region that must be left when its turn comes.
const LEFT: f64 = 0.5;
/// Regions about which round faces are looked for.
const TRIES: usize = 2000;
/// Share of a face's area in one plane region from which on it is that plane.
const FLAT: f64 = 0.9;
/// Angle between a facet and a round face that it is a chord of \[rad\]: facets of up to 25.5 degrees.
const CHORD: f64 = 13.0 * std::f64::consts::PI / 180.0;
/// Angle between a triangle and its plane, besides that of noise \[rad\].
const PLANE: f64 = 0.2 * std::f64::consts::PI / 180.0;
/// A triangle of no face.
const FREE: u32 = u32::MAX;
/// A triangle of a face that the file states.
const TAKEN: u32 = u32::MAX - 1;

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tolerance {
    /// Distance of a corner from its face \[m\].
    pub distance: f64,
    /// Planes only.
    pub faceted: bool,
}

/// Refuses a tolerance with which nothing can be found in a part of this `diagonal` \[m\].
///
/// # Errors
/// When it is not above zero, or above 2 % of the diagonal.
pub(super) fn check(tolerance: f64, diagonal: f64) -> Result<()> {
    let most = MOST * diagonal;
    if tolerance > 0.0 && tolerance <= most {
        return Ok(());
    }
    Err(Error::input(
        "fit",
        format!("is {:.6} mm", tolerance * 1e3),
        format!(
            "give a tolerance above zero and up to {:.3} mm, 2 % of this part's diagonal; some three times the noise fits",
            most * 1e3
        ),
    )
    .with_options(&["fit"]))
}

/// A face that was fitted.
#[derive(Debug, Clone)]
struct Fitted {
    surface: Stated,
    /// 1 where the outward normal is that of the surface, else -1.
    sign: f64,
    triangles: Vec<u32>,
    /// Greatest sag of a facet that is a chord \[m\].
    sag: f64,
    /// The surface was recognised, so that a fit makes it no better.
    is_exact: bool,
}

/// The mesh, and whose each triangle is.
struct Fitting<'a> {
    part: &'a Repaired,
    tolerance: f64,
    normals: Vec<DVec3>,
    areas: Vec<f64>,
    /// Smallest altitude of each triangle \[m\].
    altitudes: Vec<f64>,
    /// Face of each triangle, [`FREE`] or [`TAKEN`].
    owner: Vec<u32>,
    faces: Vec<Fitted>,
    /// Marks of triangles and vertices, current where they equal the stamp.
    stamp: u32,
    triangle_mark: Vec<u32>,
    vertex_mark: Vec<u32>,
}

/// Fits faces to all triangles that the file states none for, moves the corners onto them, and adds
/// them to `given`. `known`: curved faces that were recognised already. Says what was done in the
/// part's warnings.
pub(super) fn fit(
    part: &mut Repaired,
    given: &mut GivenFaces,
    known: Vec<CurvedFace>,
    tolerance: Tolerance,
) {
    let Tolerance { distance, faceted } = tolerance;
    let (faces, owner, areas, planes) = {
        let mut fitting = Fitting::new(part, given, distance);
        fitting.find(given, known, faceted);
        fitting.settle();
        let is_plane = |face: &&Fitted| matches!(face.surface, Stated::Plane { .. });
        let planes = fitting.faces.iter().filter(is_plane).count();
        (fitting.faces, fitting.owner, fitting.areas, planes)
    };
    let residuals: Vec<Residual> = faces.iter().map(|face| residual(part, face)).collect();
    let loose = |triangle: &usize| owner[*triangle] == FREE;
    let total: f64 = areas.iter().sum();
    let left: Vec<usize> = (0..owner.len()).filter(loose).collect();
    let share = left.iter().map(|&triangle| areas[triangle]).sum::<f64>() / total;
    let weights: Vec<f64> = faces.iter().map(|face| face.triangles.len() as f64).collect();
    let square: f64 =
        residuals.iter().zip(&weights).map(|(r, weight)| weight * r.rms * r.rms).sum();
    let rms = (square / weights.iter().sum::<f64>().max(1.0)).sqrt();
    let most = residuals.iter().map(|residual| residual.greatest).fold(0.0, f64::max);
    let mut text = format!(
        "fitted within {} mm: {} and {}; corners lay {:.1} um (root mean square) and at most {:.1} um off and were moved onto them",
        (distance * 1e9).round() / 1e6,
        counted(planes as u64, "plane"),
        counted((faces.len() - planes) as u64, "curved face"),
        rms * 1e6,
        most * 1e6
    );
    if !left.is_empty() {
        text += &format!(
            "; {} ({:.1} % of the surface) {} no face: facets",
            counted(left.len() as u64, "triangle"),
            share * 100.0,
            if left.len() == 1 { "fits" } else { "fit" }
        );
    }
    part.health.warnings.push(text);
    snap::snap(part, &owner, &faces);
    part.measure_again();
    for (face, residual) in faces.into_iter().zip(residuals) {
        given.push(&part.mesh, face.surface, face.triangles, residual);
    }
}

/// How far corners lie off a face.
fn residual(part: &Repaired, face: &Fitted) -> Residual {
    let corners = given::corners(&part.mesh, &face.triangles);
    let (mut squares, mut greatest) = (0.0, 0.0_f64);
    for &corner in &corners {
        let distance = face.surface.distance(corner);
        squares += distance * distance;
        greatest = greatest.max(distance);
    }
    Residual { rms: (squares / corners.len().max(1) as f64).sqrt(), greatest }
}

impl<'a> Fitting<'a> {
    fn new(part: &'a Repaired, given: &GivenFaces, tolerance: f64) -> Self {
        let count = part.mesh.triangles.len();
        let (mut normals, mut areas, mut altitudes) =
            (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        for triangle in 0..count as u32 {
            let [a, b, c] = part.mesh.corners(triangle);
            let cross = (b - a).cross(c - a);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            normals.push(cross.normalize_or_zero());
            areas.push(cross.length() / 2.0);
            altitudes.push(cross.length() / longest.max(f64::MIN_POSITIVE));
        }
        let owner = (0..count as u32)
            .map(|triangle| if given.of(triangle) == NONE { FREE } else { TAKEN })
            .collect();
        Self {
            part,
            tolerance,
            normals,
            areas,
            altitudes,
            owner,
            faces: Vec::new(),
            stamp: 0,
            triangle_mark: vec![0; count],
            vertex_mark: vec![0; part.mesh.vertices.len()],
        }
    }

    /// Takes faces by falling area.
    fn find(&mut self, given: &GivenFaces, known: Vec<CurvedFace>, faceted: bool) {
        let distance = self.tolerance;
        let flatness = Flatness { distance, uncertainty: distance / 2.0 };
        let first = regions::grow(self.part, given, flatness);
        let regions = regions::grow_again(self.part, given, flatness, &first);
        let facets = Facets::new(self.part, given, &regions);
        for face in known {
            let mut inside: rustc_hash::FxHashMap<u32, f64> = rustc_hash::FxHashMap::default();
            for &triangle in &face.triangles {
                let region = regions.of[triangle as usize];
                *inside.entry(region).or_default() += self.areas[triangle as usize];
            }
            if inside.values().any(|area| *area > FLAT * face.area) {
                continue;
            }
            if let Some(found) = self.known(&face) {
                self.claim(found);
            }
        }
        let mut order: Vec<usize> = (0..regions.all.len()).collect();
        order.sort_by(|&a, &b| regions.all[b].area.total_cmp(&regions.all[a].area).then(a.cmp(&b)));
        let mut tries = if faceted { 0 } else { TRIES };
        for index in order {
            let region = &regions.all[index];
            let mut left = self.free(regions.triangles(index));
            let area = self.area(&left);
            if area < LEFT * region.area || area <= 0.0 {
                continue;
            }
            if tries > 0 {
                tries -= 1;
                let round = self.round_about(&regions, &facets.borders, index, &left);
                let better = |found: &Fitted| self.area(&found.triangles) > BETTER * area;
                if let Some(found) = round.filter(better) {
                    self.claim(found);
                    // A flat amid a round face is what it has left.
                    left = self.free(&left);
                    if self.area(&left) < LEFT * region.area {
                        continue;
                    }
                }
            }
            let width = 4.0 * region.area / facets.borders.perimeter[index];
            let least = NARROWEST[usize::from(left.len() == 1)] * distance;
            if facets.is_facet[index] && !faceted || width < least {
                continue;
            }
            if let Some(surface) = self.plane(&left) {
                self.claim(Fitted {
                    surface,
                    sign: 1.0,
                    triangles: left,
                    sag: distance,
                    is_exact: false,
                });
            }
        }
    }

    /// Those of `triangles` that belong to no face.
    fn free(&self, triangles: &[u32]) -> Vec<u32> {
        triangles.iter().copied().filter(|&t| self.owner[t as usize] == FREE).collect()
    }

    fn area(&self, triangles: &[u32]) -> f64 {
        triangles.iter().map(|&triangle| self.areas[triangle as usize]).sum()
    }

    /// Gives the triangles to a face.
    fn claim(&mut self, face: Fitted) {
        for &triangle in &face.triangles {
            self.owner[triangle as usize] = self.faces.len() as u32;
        }
        self.faces.push(face);
    }

    /// Neighbours of a triangle across its edges.
    fn neighbours(&self, triangle: u32) -> impl Iterator<Item = u32> + use<'a> {
        let part = self.part;
        (3 * triangle..3 * triangle + 3).filter_map(move |half| {
            let twin = part.edges.twin[half as usize];
            (twin != NONE).then_some(twin / 3)
        })
    }

    /// Corners of `triangles`, each once: those within, where they are half of them or more, as
    /// corners at an edge may be rounded off.
    fn points(&mut self, triangles: &[u32]) -> Vec<DVec3> {
        self.stamp += 1;
        for &triangle in triangles {
            self.triangle_mark[triangle as usize] = self.stamp;
        }
        let mut rim = rustc_hash::FxHashSet::default();
        let mut vertices = Vec::new();
        for &triangle in triangles {
            let corners = self.part.mesh.triangles[triangle as usize];
            for k in 0..3 {
                let twin = self.part.edges.twin[3 * triangle as usize + k];
                if twin == NONE || self.triangle_mark[(twin / 3) as usize] != self.stamp {
                    rim.extend([corners[k], corners[(k + 1) % 3]]);
                }
                if self.vertex_mark[corners[k] as usize] != self.stamp {
                    self.vertex_mark[corners[k] as usize] = self.stamp;
                    vertices.push(corners[k]);
                }
            }
        }
        let point = |&vertex: &u32| self.part.mesh.vertices[vertex as usize];
        let within: Vec<DVec3> =
            vertices.iter().filter(|vertex| !rim.contains(vertex)).map(point).collect();
        if within.len() >= 12 && 2 * within.len() >= vertices.len() {
            return within;
        }
        vertices.iter().map(point).collect()
    }

    /// Whether a triangle may belong to a face.
    fn accepts(&self, surface: &Stated, sign: f64, sag: f64, triangle: u32) -> bool {
        let corners = self.part.mesh.corners(triangle);
        if corners.iter().any(|&corner| surface.distance(corner) > self.tolerance) {
            return false;
        }
        // Corners off by half of the tolerance turn a triangle by this.
        let noise = self.tolerance / self.altitudes[triangle as usize].max(f64::MIN_POSITIVE);
        if noise > 1.0 {
            return self.sag(surface, triangle) <= sag;
        }
        let normal = sign * self.normals[triangle as usize];
        match surface {
            Stated::Plane { normal: plane, .. } => normal.dot(*plane) >= (PLANE + noise).cos(),
            Stated::Round { .. } => {
                let least = (CHORD + noise).cos();
                corners.iter().all(|&corner| surface.facing(corner, normal) >= least)
                    && self.sag(surface, triangle) <= sag
            }
            Stated::Other => false,
        }
    }

    /// Greatest distance of the middles of a triangle's edges \[m\].
    fn sag(&self, surface: &Stated, triangle: u32) -> f64 {
        let [a, b, c] = self.part.mesh.corners(triangle);
        [a + b, b + c, c + a].map(|sum| surface.distance(sum / 2.0)).into_iter().fold(0.0, f64::max)
    }

    /// The same kind of surface fitted to triangles (least squares).
    fn fitted(&mut self, surface: &Stated, triangles: &[u32]) -> Option<Stated> {
        match *surface {
            Stated::Plane { .. } => self.plane(triangles),
            Stated::Round { kind: Kind::Revolution, .. } | Stated::Other => Some(*surface),
            Stated::Round { kind, surface } => {
                let points = self.points(triangles);
                let surface = surface.fitted(kind, &points)?;
                Some(Stated::Round { kind, surface })
            }
        }
    }
}

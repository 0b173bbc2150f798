//! From contacts and wrenches in SI to the scaled 32-bit records of the kernels, and back. Everything that decides
//! whether a load can be searched at all happens here in f64, once for every backend.

use glam::{DMat2, DVec2};

use super::layout::{ContactHeader, EdgeRecord, GROUP, GroupRecord, LoadRecord, OUT_OF_RANGE};
use super::{Problem, Seed, SeedStatus};
use crate::error::{Error, Result};
use crate::model::{Contact, Patch, Wrench};

/// Vertices of two faces this close together, in radii of gyration, count as the same (congruent faces).
const CONGRUENT: f64 = 1e-9;

/// Bounds need `radius * perimeter / area` below this (a square has 3): f32 rounds vertices by 6e-8 of the radius, so
/// the integrals of a sliver are uncertain by that times this number.
const RESOLVED: f64 = 60.0;

/// Scaled numbers beyond this are not computed with: the load gets no bounds.
const RANGE: f64 = 1e6;

/// Area over the square of the perimeter below which a face counts as no contact: a line.
const NO_AREA: f64 = 1e-14;

/// A contact, oriented and scaled.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    /// Header whose edge and basis indices are relative to this contact.
    pub(crate) header: ContactHeader,
    pub(crate) edges: Vec<EdgeRecord>,
    /// Centroid of both faces together [m], origin of the scaled frame.
    origin: DVec2,
    /// Radius of gyration about it [m], unit of length.
    unit: f64,
}

/// Area, centroid and second moments about the centroid.
#[derive(Debug, Clone, Copy)]
struct Moments {
    area: f64,
    centroid: DVec2,
    second: DMat2,
    perimeter: f64,
}

/// Directed edges with the material on their left, whatever the sense of the rings.
fn directed_edges(patch: &Patch) -> Vec<(DVec2, DVec2)> {
    let mut edges = Vec::new();
    for polygon in patch {
        for (ring, outer) in std::iter::once((&polygon.outer, true)).chain(polygon.holes.iter().map(|hole| (hole, false))) {
            let Some(&base) = ring.first() else { continue };
            let pairs = || ring.iter().zip(ring.iter().cycle().skip(1)).filter(|(a, b)| a != b);
            let twice_area: f64 = pairs().map(|(a, b)| (*a - base).perp_dot(*b - base)).sum();
            if (twice_area > 0.0) == outer {
                edges.extend(pairs().map(|(a, b)| (*a, *b)));
            } else {
                edges.extend(pairs().map(|(a, b)| (*b, *a)));
            }
        }
    }
    edges
}

/// Moments by signed triangles about the mean of the vertices (near the material, so nothing large cancels).
fn moments(edges: &[(DVec2, DVec2)]) -> Moments {
    let base = edges.iter().map(|edge| edge.0).sum::<DVec2>() / edges.len().max(1) as f64;
    let (mut area, mut first, mut second, mut perimeter) = (0.0, DVec2::ZERO, DMat2::ZERO, 0.0);
    for (a, b) in edges.iter().map(|&(a, b)| (a - base, b - base)) {
        let twice = a.perp_dot(b);
        area += twice / 2.0;
        first += twice / 6.0 * (a + b);
        let sum = a + b;
        second += (outer(a, a) + outer(b, b) + outer(sum, sum)) * (twice / 24.0);
        perimeter += a.distance(b);
    }
    let centroid = first / area;
    Moments { area, centroid: base + centroid, second: second - outer(centroid, centroid) * area, perimeter }
}

fn outer(a: DVec2, b: DVec2) -> DMat2 {
    DMat2::from_cols(a * b.x, a * b.y)
}

/// Whether two faces have the same rings, each perhaps begun at another vertex, to within `tolerance` [m].
fn congruent(a: &[(DVec2, DVec2)], b: &[(DVec2, DVec2)], tolerance: f64) -> bool {
    let same = |a: &(DVec2, DVec2), b: &(DVec2, DVec2)| a.0.distance(b.0) <= tolerance && a.1.distance(b.1) <= tolerance;
    // Mostly the faces list their vertices in the same order: look there first.
    a.len() == b.len() && a.iter().zip(b).all(|(edge, other)| same(edge, other) || b.iter().any(|any| same(edge, any)))
}

impl Prepared {
    /// `None` when a face has no area.
    ///
    /// # Errors
    /// [`Error::Input`] when a coordinate is not finite.
    pub(crate) fn new(contact: &Contact, place: &str) -> Result<Option<Self>> {
        let (edges_i, edges_ii) = (directed_edges(&contact.face_i), directed_edges(&contact.face_ii));
        for (name, patch) in [("A_I", &contact.face_i), ("A_II", &contact.face_ii)] {
            for point in patch.iter().flat_map(|polygon| polygon.outer.iter().chain(polygon.holes.iter().flatten())) {
                if !point.is_finite() {
                    return Err(Error::input(place, format!("{name} has the vertex ({}, {})", point.x, point.y), "give finite coordinates"));
                }
            }
        }
        let (on_i, on_ii) = (moments(&edges_i), moments(&edges_ii));
        let has_area = |face: &Moments| face.area > NO_AREA * face.perimeter * face.perimeter && face.area.is_normal();
        if !(has_area(&on_i) && has_area(&on_ii)) {
            return Ok(None);
        }
        let area = on_i.area + on_ii.area;
        let origin = on_i.centroid + (on_ii.area / area) * (on_ii.centroid - on_i.centroid);
        let polar = |face: &Moments| face.second.x_axis.x + face.second.y_axis.y + face.area * face.centroid.distance_squared(origin);
        let unit = ((polar(&on_i) + polar(&on_ii)) / area).sqrt();
        if !unit.is_normal() {
            return Ok(None);
        }
        let same = congruent(&edges_i, &edges_ii, CONGRUENT * unit);
        let scaled = |p: DVec2| (p - origin) / unit;
        let edges: Vec<EdgeRecord> = edges_i
            .iter()
            .chain(if same { &[] } else { edges_ii.as_slice() })
            .map(|&(a, b)| (scaled(a), scaled(b)))
            .map(|(a, b)| [a.x as f32, a.y as f32, b.x as f32, b.y as f32])
            .collect();
        let radius = edges_i.iter().chain(&edges_ii).map(|edge| scaled(edge.0).length()).fold(0.0, f64::max);
        let stiffness = (on_i.second + on_ii.second) * unit.powi(-4);
        let compliance = stiffness.inverse();
        let resolved = |face: &Moments| radius * face.perimeter / face.area * unit <= RESOLVED;
        let header = ContactHeader {
            edges_i: 0,
            edges_ii: edges_i.len() as u32,
            edges_end: edges.len() as u32,
            basis: 0,
            faces: if same { 1 } else { 2 },
            radius: radius as f32,
            area_i: (on_i.area / (unit * unit)) as f32,
            area_ii: (on_ii.area / (unit * unit)) as f32,
            centroid_i: scaled(on_i.centroid).as_vec2().to_array(),
            centroid_ii: scaled(on_ii.centroid).as_vec2().to_array(),
            compliance: [compliance.x_axis.x as f32, compliance.y_axis.x as f32, compliance.y_axis.y as f32],
            resolved: u32::from(resolved(&on_i) && resolved(&on_ii)),
        };
        Ok(Some(Self { header, edges, origin, unit }))
    }

    /// The scaled record of a load, and the length of its in-plane wrench over the gripping force (by which `mu` of the
    /// unit wrench is multiplied); or the reason why there is nothing to search.
    pub(crate) fn load(&self, problem: &Problem<'_>, wrench: &Wrench) -> std::result::Result<(LoadRecord, f64), SeedStatus> {
        let (force, unit, o) = (problem.force, self.unit, self.origin);
        let f = wrench.force;
        if !(f.z.abs() < 2.0 * force) {
            return Err(SeedStatus::NoNormalForce);
        }
        // The moment about the centroid, in lengths of the unit.
        let m1 = wrench.moment.x / unit - o.y / unit * f.z;
        let m2 = wrench.moment.y / unit + o.x / unit * f.z;
        let m3 = wrench.moment.z / unit - (o.x / unit * f.y - o.y / unit * f.x);
        let in_plane = glam::DVec3::new(f.x, f.y, m3);
        let length = in_plane.length();
        let direction = in_plane / length;
        if !(length > 0.0 && length.is_normal() && direction.is_finite()) {
            return Err(SeedStatus::NoLoad);
        }
        let numbers = [length / force, f.z / force, m1 / force, m2 / force, problem.distance / unit];
        let usable = numbers.iter().all(|x| x.abs() <= RANGE);
        let [scale, f3, m1, m2, distance] = numbers.map(|x| x.clamp(-RANGE, RANGE) as f32);
        let distance = if usable { distance } else { OUT_OF_RANGE };
        Ok((LoadRecord { wrench: direction.as_vec3().to_array(), scale, f3, m1, m2, distance }, length / force))
    }

    /// The scaled twist in SI about the grip origin.
    pub(crate) fn twist(&self, scaled: [f32; 3]) -> [f64; 3] {
        let omega = f64::from(scaled[2]) / self.unit;
        [f64::from(scaled[0]) + omega * self.origin.y, f64::from(scaled[1]) - omega * self.origin.x, omega]
    }
}

/// What a kernel works on in one go.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chunk {
    pub(crate) contacts: Vec<ContactHeader>,
    pub(crate) edges: Vec<EdgeRecord>,
    pub(crate) loads: Vec<LoadRecord>,
    pub(crate) groups: Vec<GroupRecord>,
    /// Length of the basis array in numbers.
    pub(crate) basis: usize,
}

impl Chunk {
    /// Adds a contact with its loads, in groups.
    pub(crate) fn push(&mut self, prepared: &Prepared, loads: impl IntoIterator<Item = LoadRecord>, twists: usize) {
        let first_edge = self.edges.len() as u32;
        let mut header = prepared.header;
        header.edges_i += first_edge;
        header.edges_ii += first_edge;
        header.edges_end += first_edge;
        header.basis = self.basis as u32;
        let first = self.loads.len();
        self.loads.extend(loads);
        for start in (first..self.loads.len()).step_by(GROUP) {
            let count = GROUP.min(self.loads.len() - start) as u32;
            self.groups.push(GroupRecord { contact: self.contacts.len() as u32, first: start as u32, count, padding: 0 });
        }
        self.edges.extend_from_slice(&prepared.edges);
        self.basis += basis_length(&header, twists);
        self.contacts.push(header);
    }
}

/// Numbers that the basis of a contact takes.
pub(crate) fn basis_length(header: &ContactHeader, twists: usize) -> usize {
    header.faces as usize * super::layout::BASIS * twists
}

/// The answer for a load that is not searched.
pub(crate) fn not_searched(status: SeedStatus) -> Seed {
    Seed { status, twist: [0.0; 3], lower: 0.0, upper: f64::INFINITY }
}

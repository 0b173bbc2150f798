//! From contacts and wrenches in SI to the scaled 32-bit records of the kernels, and back.
//! Everything that decides whether a load can be searched at all happens here in f64, once for
//! every backend.

use glam::{DMat2, DVec2};

use super::layout::{
    BOUNDED, COUPLED, ContactHeader, EdgeRecord, GROUP, GroupRecord, LoadRecord, OUT_OF_RANGE,
    SeedRecord, UNBOUNDED,
};
use super::{F32_TOLERANCE, Problem, Seed, SeedStatus};
use crate::contact::Loops;
use crate::error::{Error, Result};
use crate::geometry::overlay;
use crate::geometry::polygon::{Moments, rings_moments};
use crate::model::{Contact, Wrench};

/// Faces count as congruent when their vertices agree to this over `perimeter / area`, in radii of
/// gyration: the answer then changes by less than a tenth of the tolerance of the bounds. Parts
/// come with single-precision coordinates.
const CONGRUENT: f64 = 2e-6;

/// Bounds need `radius * perimeter / area` below this (a square has 3): f32 rounds vertices by 6e-8
/// of the radius, so the integrals of a sliver are uncertain by that times this number.
const RESOLVED: f64 = 60.0;

/// Scaled numbers beyond this are not computed with: the load gets no bounds.
const RANGE: f64 = 1e6;

/// In-plane load over the gripping force below which there is no load: the square of less is not a
/// number of f64.
const NO_LOAD: f64 = 1e-150;

/// Area over the square of the perimeter below which a face counts as no contact: a line.
const NO_AREA: f64 = 1e-14;

/// A contact, oriented and scaled.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    /// Header whose edge and basis indices are relative to this contact.
    pub(crate) header: ContactHeader,
    pub(crate) edges: Vec<EdgeRecord>,
    /// Centroid of both faces together [m], origin of the scaled frame.
    pub(crate) origin: DVec2,
    /// Radius of gyration about it [m], unit of length.
    pub(crate) unit: f64,
}

/// Whether two faces have the same rings, each perhaps begun at another vertex, to within
/// `tolerance` [m].
fn congruent(a: &[(DVec2, DVec2)], b: &[(DVec2, DVec2)], tolerance: f64) -> bool {
    let same = |a: &(DVec2, DVec2), b: &(DVec2, DVec2)| {
        a.0.distance(b.0) <= tolerance && a.1.distance(b.1) <= tolerance
    };
    // Mostly the faces list their vertices in the same order: look there first.
    a.len() == b.len()
        && a.iter()
            .zip(b)
            .all(|(edge, other)| same(edge, other) || b.iter().any(|any| same(edge, any)))
}

/// The quadratic form of [`ContactHeader::variation_first`]: by Schwarz's inequality the integral
/// of the magnitude of `p_I` on face I less `p_II` on face II is at most the root of the joint area
/// times the integral of the square.
fn variation(
    contact: &Contact,
    loops: [&Loops; 2],
    scaled: &impl Fn(DVec2) -> DVec2,
) -> ([f32; 4], [f32; 4], [f32; 2]) {
    let overlap = Loops::mapped(&overlay::intersect(&contact.face_i, &contact.face_ii), scaled);
    let [i, ii] = loops.map(|loops| {
        let rings: Vec<Vec<DVec2>> =
            loops.rings().map(|ring| ring.iter().map(|&point| scaled(point)).collect()).collect();
        about_origin(&rings_moments(&rings.iter().map(Vec::as_slice).collect::<Vec<_>>()))
    });
    let both = about_origin(&rings_moments(&overlap.rings().collect::<Vec<_>>()));
    // Nothing is lost by a joint area that is too large.
    let joint = i.0 + ii.0 - both.0;
    let second = i.2 + ii.2 + both.2 * 2.0;
    let number = |x: f64| (x * joint) as f32;
    (
        [i.0, ii.0, -both.0, second.x_axis.x].map(number),
        [i.1.x + both.1.x, i.1.y + both.1.y, -ii.1.x - both.1.x, -ii.1.y - both.1.y].map(number),
        [second.y_axis.x, second.y_axis.y].map(number),
    )
}

/// Area, first and second moments about the origin.
fn about_origin(moments: &Moments) -> (f64, DVec2, DMat2) {
    let c = moments.centroid;
    (
        moments.area,
        c * moments.area,
        moments.second + DMat2::from_cols(c * c.x, c * c.y) * moments.area,
    )
}

impl Prepared {
    /// `None` when a face has no area.
    ///
    /// # Errors
    /// Bad geometry when a coordinate is not finite or beyond 1e9 m.
    pub(crate) fn new(contact: &Contact, place: &str) -> Result<Option<Self>> {
        contact.check(&format!("{place}, "))?;
        let [loops_i, loops_ii] =
            [&contact.face_i, &contact.face_ii].map(|patch| Loops::new(patch));
        let [edges_i, edges_ii] = [&loops_i, &loops_ii]
            .map(|loops| loops.edges().filter(|(a, b)| a != b).collect::<Vec<_>>());
        let [on_i, on_ii] =
            [&loops_i, &loops_ii].map(|loops| rings_moments(&loops.rings().collect::<Vec<_>>()));
        let perimeter =
            |edges: &[(DVec2, DVec2)]| edges.iter().map(|(a, b)| a.distance(*b)).sum::<f64>();
        let (length_i, length_ii) = (perimeter(&edges_i), perimeter(&edges_ii));
        let has_area = |face: &Moments, length: f64| {
            face.area > NO_AREA * length * length && face.area.is_normal()
        };
        if !(has_area(&on_i, length_i) && has_area(&on_ii, length_ii)) {
            return Ok(None);
        }
        let area = on_i.area + on_ii.area;
        let origin = on_i.centroid + (on_ii.area / area) * (on_ii.centroid - on_i.centroid);
        let polar = |face: &Moments| {
            face.second.x_axis.x
                + face.second.y_axis.y
                + face.area * face.centroid.distance_squared(origin)
        };
        let unit = ((polar(&on_i) + polar(&on_ii)) / area).sqrt();
        if !unit.is_normal() {
            return Ok(None);
        }
        let same = congruent(&edges_i, &edges_ii, CONGRUENT * on_i.area / length_i);
        let scaled = |p: DVec2| (p - origin) / unit;
        let records = |edges: &[(DVec2, DVec2)]| -> Vec<EdgeRecord> {
            let record = |&(a, b): &(DVec2, DVec2)| {
                [scaled(a).as_vec2().to_array(), scaled(b).as_vec2().to_array()]
            };
            edges
                .iter()
                .map(record)
                .filter(|[a, b]| a != b)
                .map(|[a, b]| [a[0], a[1], b[0], b[1]])
                .collect()
        };
        let mut edges = records(&edges_i);
        let end_of_i = edges.len() as u32;
        if !same {
            edges.extend(records(&edges_ii));
        }
        let radius =
            edges_i.iter().chain(&edges_ii).map(|edge| scaled(edge.0).length()).fold(0.0, f64::max);
        let stiffness = (on_i.second + on_ii.second) * unit.powi(-4);
        let compliance = stiffness.inverse();
        let (variation_first, variation_second, variation_slope) = if same {
            Default::default()
        } else {
            variation(contact, [&loops_i, &loops_ii], &scaled)
        };
        let (mean, half) = (
            (compliance.x_axis.x + compliance.y_axis.y) / 2.0,
            (compliance.x_axis.x - compliance.y_axis.y) / 2.0,
        );
        let softness = mean + half.hypot(compliance.y_axis.x);
        let reach = |edges: &[(DVec2, DVec2)], centre: DVec2| {
            edges.iter().map(|edge| edge.0.distance(centre) / unit).fold(0.0, f64::max)
        };
        let spread = (on_i.area * reach(&edges_i, on_i.centroid)
            + on_ii.area * reach(&edges_ii, on_ii.centroid))
            / (unit * unit);
        let resolved = |face: &Moments, length: f64| radius * unit * length / face.area <= RESOLVED;
        let header = ContactHeader {
            edges_i: 0,
            edges_ii: end_of_i,
            edges_end: edges.len() as u32,
            basis: 0,
            faces: if same { 1 } else { 2 },
            radius: radius as f32,
            area_i: (on_i.area / (unit * unit)) as f32,
            area_ii: (on_ii.area / (unit * unit)) as f32,
            centroid_i: scaled(on_i.centroid).as_vec2().to_array(),
            centroid_ii: scaled(on_ii.centroid).as_vec2().to_array(),
            compliance: [
                compliance.x_axis.x as f32,
                compliance.y_axis.x as f32,
                compliance.y_axis.y as f32,
            ],
            resolved: u32::from(resolved(&on_i, length_i) && resolved(&on_ii, length_ii)),
            variation_first,
            variation_second,
            variation_slope,
            softness: softness as f32,
            spread: spread as f32,
        };
        Ok(Some(Self { header, edges, origin, unit }))
    }

    /// The scaled record of a load, and the length of its in-plane wrench over the gripping force
    /// (by which `mu` of the unit wrench is multiplied); or the reason why there is nothing to
    /// search.
    pub(crate) fn load(
        &self,
        problem: &Problem<'_>,
        wrench: &Wrench,
    ) -> std::result::Result<(LoadRecord, f64), SeedStatus> {
        let (force, unit, o) = (problem.force, self.unit, self.origin);
        let f = wrench.force;
        if f.z.abs() >= 2.0 * force {
            return Err(SeedStatus::NoNormalForce);
        }
        // The moment about the centroid, in lengths of the unit.
        let m1 = wrench.moment.x / unit - o.y / unit * f.z;
        let m2 = wrench.moment.y / unit + o.x / unit * f.z;
        let m3 = wrench.moment.z / unit - (o.x / unit * f.y - o.y / unit * f.x);
        let in_plane = glam::DVec3::new(f.x, f.y, m3);
        // By its largest component first: the squares of huge and tiny loads leave the range of
        // f64.
        let most = in_plane.abs().max_element();
        if most / force < NO_LOAD {
            return Err(SeedStatus::NoLoad);
        }
        let length = most * (in_plane / most).length();
        let direction = in_plane / length;
        let numbers =
            [length / force, f.z / force, m1 / force, m2 / force, problem.distance / unit];
        let usable = numbers.iter().all(|x| x.abs() <= RANGE);
        let [scale, f3, m1, m2, distance] = numbers.map(|x| x.clamp(-RANGE, RANGE) as f32);
        let distance = if usable { distance } else { OUT_OF_RANGE };
        Ok((
            LoadRecord { wrench: direction.as_vec3().to_array(), scale, f3, m1, m2, distance },
            length / force,
        ))
    }

    /// The answer in SI about the grip origin from the search's record and the load's scale.
    ///
    /// # Errors
    /// A device error when the kernel did not write the record.
    pub(crate) fn answer(&self, record: &SeedRecord, scale: f64) -> Result<Seed> {
        let status = match record.status {
            BOUNDED => SeedStatus::Bounded,
            COUPLED => SeedStatus::Coupled,
            UNBOUNDED => SeedStatus::Unbounded,
            other => {
                return Err(Error::device(format!(
                    "a load came back with status {other}: the kernel did not write it"
                )));
            }
        };
        let [u1, u2, omega] = record.twist.map(f64::from);
        let omega = omega / self.unit;
        let twist = [u1 + omega * self.origin.y, u2 - omega * self.origin.x, omega];
        if status == SeedStatus::Unbounded {
            return Ok(Seed {
                status,
                twist,
                lower: 0.0,
                upper: f64::INFINITY,
                estimate: scale * f64::from(record.lower),
            });
        }
        let lower = scale * f64::from(record.lower) * (1.0 - F32_TOLERANCE);
        let upper = scale * f64::from(record.upper) * (1.0 + F32_TOLERANCE);
        Ok(Seed { status, twist, lower, upper, estimate: lower })
    }
}

/// What a kernel works on in one go.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chunk {
    pub(crate) contacts: Vec<ContactHeader>,
    pub(crate) edges: Vec<EdgeRecord>,
    pub(crate) loads: Vec<LoadRecord>,
    pub(crate) groups: Vec<GroupRecord>,
    /// Length of the basis array in vectors of four numbers.
    pub(crate) basis: usize,
}

impl Chunk {
    /// Adds a contact with its loads, in groups. A contact without loads is left out.
    pub(crate) fn push(
        &mut self,
        prepared: &Prepared,
        loads: impl IntoIterator<Item = Vec<LoadRecord>>,
        twists: usize,
    ) {
        let first = self.loads.len();
        for part in loads {
            self.loads.extend(part);
        }
        if self.loads.len() == first {
            return;
        }
        let first_edge = self.edges.len() as u32;
        let mut header = prepared.header;
        header.edges_i += first_edge;
        header.edges_ii += first_edge;
        header.edges_end += first_edge;
        header.basis = self.basis as u32;
        for start in (first..self.loads.len()).step_by(GROUP) {
            let count = GROUP.min(self.loads.len() - start) as u32;
            self.groups.push(GroupRecord {
                contact: self.contacts.len() as u32,
                first: start as u32,
                count,
                padding: 0,
            });
        }
        self.edges.extend_from_slice(&prepared.edges);
        self.basis += basis_length(&header, twists);
        self.contacts.push(header);
    }
}

/// Vectors that the basis of a contact takes.
pub(crate) fn basis_length(header: &ContactHeader, twists: usize) -> usize {
    header.faces as usize * super::layout::BASIS * twists
}

/// The answer for a load that is not searched.
pub(crate) fn not_searched(status: SeedStatus) -> Seed {
    Seed { status, twist: [0.0; 3], lower: 0.0, upper: f64::INFINITY, estimate: 0.0 }
}

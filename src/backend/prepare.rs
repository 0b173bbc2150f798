//! From contacts and wrenches in SI to the scaled 32-bit records of the kernels, and back.
//! Everything that decides whether a load can be searched at all happens here in f64, once for
//! every backend.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::layout::{
    BOUNDED, COUPLED, ContactHeader, ESTIMATED, EdgeRecord, LoadRecord, OUT_OF_RANGE, SeedRecord,
    UNBOUNDED,
};
use super::problem::{F32_TOLERANCE, Problem, Seed, SeedStatus};
use crate::contact::{Loops, Twist};
use crate::error::{Error, Result};
use crate::geometry::overlay;
use crate::geometry::polygon::{Moments, rings_moments};
use crate::mechanics::Pads;
use crate::mechanics::pads::{SINGLE_PRECISION, congruent};
use crate::model::{Contact, Wrench};

/// Bounds need `radius * perimeter / area` below this (a square has 3): f32 rounds vertices by 6e-8
/// of the radius, so the integrals of a sliver are uncertain by that times this number.
const RESOLVED: f64 = 60.0;

/// [`super::layout::RANGE`].
pub(super) const RANGE: f64 = super::layout::RANGE as f64;

/// In-plane load over the gripping force below which there is no load: the square of less is not a
/// number of f64.
const NO_LOAD: f64 = 1e-150;

/// Area over the square of the perimeter below which a face counts as no contact: a line.
const NO_AREA: f64 = 1e-14;

/// The distinct contacts of some problems, each made ready once, for the seeds and for the solver.
pub(crate) struct Contacts {
    /// In the order of first use.
    pub(crate) ready: Vec<Prepared>,
    /// Which of them each problem has.
    pub(crate) slots: Vec<usize>,
}

impl Contacts {
    /// Problems that share the `Arc` share the contact.
    ///
    /// # Errors
    /// Bad geometry when a coordinate is not finite or beyond 1e9 m.
    pub(crate) fn new(problems: &[Problem<'_>]) -> Result<Self> {
        let mut slot_of: HashMap<*const Contact, usize> = HashMap::new();
        let mut first_user: Vec<usize> = Vec::new();
        let mut slots = Vec::with_capacity(problems.len());
        for (index, problem) in problems.iter().enumerate() {
            slots.push(*slot_of.entry(Arc::as_ptr(problem.contact)).or_insert_with(|| {
                first_user.push(index);
                first_user.len() - 1
            }));
        }
        let ready = first_user
            .into_par_iter()
            .map(|user| {
                let contact = problems[user].contact;
                contact.check(&format!("contact of grip {user}, "))?;
                Ok(Prepared::new(contact))
            })
            .collect::<Result<_>>()?;
        Ok(Self { ready, slots })
    }
}

/// A contact made ready: for the solver, and from that for the kernels.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    /// `None` when a face has no area.
    pub(crate) pads: Option<Pads>,
    /// `None` when f32 cannot tell a face from a line; there are no seeds then.
    pub(crate) records: Option<Records>,
}

impl Prepared {
    pub(crate) fn new(contact: &Contact) -> Self {
        let pads = Pads::new(contact);
        let records = pads.as_ref().and_then(|pads| Records::new(pads, contact));
        Self { pads, records }
    }
}

/// A contact as the kernels read it, in units of its radius of gyration.
#[derive(Debug, Clone)]
pub(crate) struct Records {
    /// Header whose edge and basis indices are relative to this contact.
    pub(crate) header: ContactHeader,
    pub(crate) edges: Vec<EdgeRecord>,
    /// The pads' middle \[m\], origin of the scaled frame.
    pub(crate) origin: DVec2,
    /// Radius of gyration about it \[m\], unit of length.
    pub(crate) unit: f64,
}

/// The quadratic form of [`ContactHeader::variation_first`]: by Schwarz's inequality the integral
/// of the magnitude of `p_I` on face I less `p_II` on face II is at most the root of the joint area
/// times the integral of the square. `faces` are the moments of both in the frame that `scaled`
/// leads to.
fn variation(
    contact: &Contact,
    faces: &[Moments; 2],
    scaled: impl Fn(DVec2) -> DVec2,
) -> ([f32; 4], [f32; 4], [f32; 2]) {
    let overlap = Loops::mapped(&overlay::intersect(&contact.face_i, &contact.face_ii), scaled);
    let [i, ii] = faces.each_ref().map(about_origin);
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

impl Records {
    /// `None` when a face is a line but for rounding.
    fn new(pads: &Pads, contact: &Contact) -> Option<Self> {
        let perimeter = |area: &Loops| area.edges().map(|(a, b)| a.distance(b)).sum::<f64>();
        let lengths = pads.areas.each_ref().map(perimeter);
        let in_pads =
            pads.areas.each_ref().map(|area| rings_moments(&area.rings().collect::<Vec<_>>()));
        let areas = in_pads.each_ref().map(|face| face.area);
        let has_area = |k: usize| {
            areas[k] > NO_AREA * lengths[k] * lengths[k]
                && (areas[k] * pads.length * pads.length).is_normal()
        };
        if !(has_area(0) && has_area(1)) {
            return None;
        }
        // Lengths in units of the radius of gyration from here on.
        let polar = |face: &Moments| {
            face.second.x_axis.x + face.second.y_axis.y + face.area * face.centroid.length_squared()
        };
        let gyration = (in_pads.iter().map(polar).sum::<f64>() / (areas[0] + areas[1])).sqrt();
        let unit = pads.length * gyration;
        if !(gyration.is_normal() && unit.is_normal()) {
            return None;
        }
        let scaled = |p: DVec2| p / gyration;
        let faces = in_pads.map(|face| Moments {
            area: face.area / (gyration * gyration),
            centroid: scaled(face.centroid),
            second: face.second * gyration.powi(-4),
        });
        let same = congruent(&pads.areas, SINGLE_PRECISION);
        let record = |(a, b): (DVec2, DVec2)| {
            let [a, b] = [a, b].map(|p| scaled(p).as_vec2().to_array());
            (a != b).then_some([a[0], a[1], b[0], b[1]])
        };
        let mut edges: Vec<EdgeRecord> = pads.areas[0].edges().filter_map(record).collect();
        let end_of_i = edges.len() as u32;
        if !same {
            edges.extend(pads.areas[1].edges().filter_map(record));
        }
        let reach = |k: usize, centre: DVec2| {
            let points = pads.areas[k].points().iter();
            points.map(|&point| scaled(point).distance(centre)).fold(0.0, f64::max)
        };
        let radius = reach(0, DVec2::ZERO).max(reach(1, DVec2::ZERO));
        let compliance = (faces[0].second + faces[1].second).inverse();
        let (variation_first, variation_second, variation_slope) = if same {
            Default::default()
        } else {
            variation(contact, &faces, |p| (p - pads.origin) / unit)
        };
        let resolved = |k: usize| radius * lengths[k] / gyration / faces[k].area <= RESOLVED;
        let softness = largest_eigenvalue(compliance);
        let [slowest, quickest] = dissipation_range(&faces, radius, same);
        let spread: f64 = (0..2).map(|k| faces[k].area * reach(k, faces[k].centroid)).sum();
        let header = ContactHeader {
            edges_i: 0,
            edges_ii: end_of_i,
            edges_end: edges.len() as u32,
            basis: 0,
            faces: if same { 1 } else { 2 },
            radius: radius as f32,
            area_i: faces[0].area as f32,
            area_ii: faces[1].area as f32,
            centroid_i: faces[0].centroid.as_vec2().to_array(),
            centroid_ii: faces[1].centroid.as_vec2().to_array(),
            compliance: [
                compliance.x_axis.x as f32,
                compliance.y_axis.x as f32,
                compliance.y_axis.y as f32,
            ],
            resolved: u32::from(resolved(0) && resolved(1)),
            variation_first,
            variation_second,
            variation_slope,
            softness: softness as f32,
            spread: spread as f32,
            tilt: (2.0 * radius * (1.0 + radius) * softness * faces[0].area.max(faces[1].area))
                as f32,
            slowest: slowest as f32,
            quickest: quickest as f32,
            padding: 0,
        };
        Some(Self { header, edges, origin: pads.origin, unit })
    }

    /// Edges of face I and of face II (none where it is congruent).
    pub(super) fn faces(&self) -> [&[EdgeRecord]; 2] {
        let (i, ii) = self.edges.split_at(self.header.edges_ii as usize);
        [i, ii]
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
        let within = |x: f64| x.clamp(-RANGE, RANGE) as f32;
        let [scale, f3, m1, m2, distance] = numbers;
        let (scale, f3, m1, m2) = (within(scale), within(f3), within(m1), within(m2));
        let distance = if usable { within(distance) } else { OUT_OF_RANGE };
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
            ESTIMATED => SeedStatus::Estimated,
            UNBOUNDED => SeedStatus::Unbounded,
            other => {
                return Err(Error::device(format!(
                    "a load came back with status {other}: the kernel did not write it"
                )));
            }
        };
        let [u1, u2, omega] = record.twist;
        let (u1, u2, omega) = (f64::from(u1), f64::from(u2), f64::from(omega));
        let omega = omega / self.unit;
        let (u1, u2) = (u1 + omega * self.origin.y, u2 - omega * self.origin.x);
        let twist = Twist { u1, u2, omega };
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

/// Bounds on the dissipation of a unit twist, [`ContactHeader::slowest`] and
/// [`ContactHeader::quickest`]: no point moves faster than `q = (1 + radius^2)^(1/2)`, so the
/// integral of `p |v|` is at least that of `p v^2` over `q`, a quadratic form of the twist, and at
/// most twice `q`; for congruent faces, whose summed pressure is known, also at most the root of
/// twice that form (Schwarz).
fn dissipation_range(faces: &[Moments; 2], radius: f64, same: bool) -> [f64; 2] {
    let about = faces.each_ref().map(about_origin);
    let first = about.iter().map(|face| face.1 / face.0).sum::<DVec2>().length();
    let polar: f64 = about.iter().map(|face| (face.2.x_axis.x + face.2.y_axis.y) / face.0).sum();
    let (mean, apart) = ((2.0 + polar) / 2.0, ((2.0 - polar) / 2.0).hypot(first));
    let fastest = (1.0 + radius * radius).sqrt();
    let most = if same { (2.0 * (mean + apart).max(2.0)).sqrt() } else { 2.0 * fastest };
    [(mean - apart).min(2.0) / fastest, most]
}

/// Of a symmetric matrix.
fn largest_eigenvalue(m: DMat2) -> f64 {
    let (mean, half) = ((m.x_axis.x + m.y_axis.y) / 2.0, (m.x_axis.x - m.y_axis.y) / 2.0);
    mean + half.hypot(m.y_axis.x)
}

/// The answer for a load that is not searched.
pub(crate) fn not_searched(status: SeedStatus) -> Seed {
    Seed { status, twist: Twist::default(), lower: 0.0, upper: f64::INFINITY, estimate: 0.0 }
}

//! Grips to score: on pads wholly on the faces, each with a contact of its own, with different areas
//! on the two faces, or under loads that lift a pad.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use gripfast::backend::{Batch, Pose, Problem, Scored, Seed, SeedStatus};
use gripfast::geometry::sphere;
use gripfast::model::{Contact, Frame, Polygon, Wrench};

/// Largest relative difference between bounds of two backends: each is widened for single precision,
/// and that of a graphics processor for its loads too.
const BOUND_TOLERANCE: f64 =
    2.0 * gripfast::backend::F32_TOLERANCE + gripfast::backend::LOAD_TOLERANCE;

/// Largest relative difference between final answers of two backends.
pub(crate) const ANSWER_TOLERANCE: f64 = 1e-9;

/// What the contacts of a workload have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Contacts {
    /// All grips have the same: pads wholly on both faces.
    Shared,
    /// Each has its own, the same on both faces.
    Own,
    /// Each has its own, and its faces differ.
    Different,
    /// The same, held so loosely that most loads lift a pad.
    Lifting,
}

impl Contacts {
    pub(crate) const ALL: [Self; 4] = [Self::Shared, Self::Own, Self::Different, Self::Lifting];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Shared => "shared",
            Self::Own => "own",
            Self::Different => "different",
            Self::Lifting => "lifting",
        }
    }

    /// Faces that are integrated.
    pub(crate) fn faces(self) -> usize {
        if matches!(self, Self::Different | Self::Lifting) { 2 } else { 1 }
    }

    /// Edges of each of them.
    pub(crate) fn edges(self) -> usize {
        if self == Self::Shared { 4 } else { 5 }
    }
}

/// Grips under one list of loads.
pub(crate) struct Workload {
    pub(crate) contacts: Vec<Arc<Contact>>,
    list: Vec<Wrench>,
    /// Gripping force [N].
    force: f64,
    /// Where the centre of mass lies in each grip.
    points: Vec<DVec3>,
}

impl Workload {
    /// Each grip under `loads` unit forces spread over the sphere.
    pub(crate) fn new(kind: Contacts, grips: usize, loads: usize) -> Self {
        let directions = sphere::directions(loads).into_iter();
        let list = directions.map(|force| Wrench { force, moment: DVec3::ZERO }).collect();
        // Grips spread over a part: the centre of mass lies elsewhere in each.
        let point = |i: usize| {
            DVec3::new(
                0.02 * (i as f64 * 0.618).fract(),
                0.02 * (i as f64 * 0.755).fract(),
                0.004 * (i as f64 * 0.57).fract(),
            )
        };
        let own = |same: bool| -> Vec<Arc<Contact>> {
            let cut = |i: usize| 0.001 + 0.006 * (i as f64 * 0.618).fract();
            (0..grips)
                .map(|i| {
                    Arc::new(Contact {
                        face_i: vec![pad(DVec2::ZERO, cut(i))],
                        face_ii: vec![pad(DVec2::ZERO, cut(if same { i } else { i + 1 }))],
                    })
                })
                .collect()
        };
        let contacts = match kind {
            Contacts::Shared => {
                let face = vec![pad(DVec2::ZERO, 0.0)];
                let shared = Arc::new(Contact { face_i: face.clone(), face_ii: face });
                std::iter::repeat_n(shared, grips).collect()
            }
            Contacts::Own => own(true),
            Contacts::Different | Contacts::Lifting => own(false),
        };
        let force = if kind == Contacts::Lifting { 3.0 } else { 40.0 };
        Self { contacts, list, force, points: (0..grips).map(point).collect() }
    }

    pub(crate) fn batch(&self) -> Batch<'_> {
        let pairs = self.contacts.iter().zip(&self.points);
        Batch {
            problems: pairs
                .map(|(contact, &centre_of_mass)| Problem {
                    contact,
                    distance: 0.03,
                    force: self.force,
                    wrenches: &self.list,
                    pose: Some(Pose { centre_of_mass, part_from_grip: Frame::IDENTITY }),
                })
                .collect(),
        }
    }

    pub(crate) fn loads(&self) -> usize {
        self.contacts.len() * self.list.len()
    }
}

/// A rectangle's corners; `cut` takes one corner off, as the edge of a face does.
fn pad(centre: DVec2, cut: f64) -> Polygon {
    let (a, b) = (0.011, 0.01);
    let mut outer = vec![
        DVec2::new(-a, -b),
        DVec2::new(a, -b),
        DVec2::new(a, b - cut),
        DVec2::new(a - cut, b),
        DVec2::new(-a, b),
    ];
    if cut == 0.0 {
        outer.remove(3);
    }
    Polygon { outer: outer.into_iter().map(|point| centre + point).collect(), holes: Vec::new() }
}

fn relative(x: f64, y: f64) -> f64 {
    if x == y { 0.0 } else { (x - y).abs() / x.abs().max(y.abs()) }
}

/// Largest relative difference of lower bounds, or what differs beyond the tolerance.
pub(crate) fn same_seeds(a: &[Seed], b: &[Seed]) -> Result<f64, String> {
    if a.len() != b.len() {
        return Err(format!("{} and {} seeds", a.len(), b.len()));
    }
    let mut most: f64 = 0.0;
    for (i, (x, y)) in a.iter().zip(b).enumerate() {
        let bounded =
            |seed: &Seed| matches!(seed.status, SeedStatus::Bounded | SeedStatus::Coupled);
        if bounded(x) && bounded(y) {
            most = most.max(relative(x.lower, y.lower));
        }
        // A hair inside or outside full contact: one has bounds, the other none.
        let hair = x.status == SeedStatus::Unbounded || y.status == SeedStatus::Unbounded;
        if x.lower.is_nan() || y.lower.is_nan() || most > BOUND_TOLERANCE {
            return Err(format!("load {i}: {x:?} and {y:?}"));
        }
        if x.status != y.status && !hair {
            return Err(format!("load {i}: {x:?} and {y:?}"));
        }
    }
    Ok(most)
}

/// Largest relative difference of `mu_s`, or the first grip that differs in more than that.
pub(crate) fn same_answers(a: &[Scored], b: &[Scored]) -> Result<f64, String> {
    if a.len() != b.len() {
        return Err(format!("{} and {} answers", a.len(), b.len()));
    }
    let mut most: f64 = 0.0;
    for (i, (x, y)) in a.iter().zip(b).enumerate() {
        let (Some((load_x, x)), Some((load_y, y))) = (x.worst, y.worst) else { continue };
        let difference = x.mu_s.zip(y.mu_s).map_or(0.0, |(x, y)| relative(x, y));
        if load_x != load_y
            || x.status != y.status
            || difference.is_nan()
            || difference > ANSWER_TOLERANCE
        {
            return Err(format!(
                "grip {i}: load {load_x} {:?} and load {load_y} {:?}",
                x.mu_s, y.mu_s
            ));
        }
        most = most.max(difference);
    }
    Ok(most)
}

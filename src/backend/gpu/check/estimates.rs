//! How far the estimates of loads without bounds are from the solution in double precision, and whether
//! what is said of that holds.

use std::sync::Arc;

use super::super::super::layout::{ESTIMATED, ESTIMATES, FoundRecord, HARDLY, SeedRecord};
use super::super::super::prepare::Contacts;
use super::super::super::screen::Wanted;
use super::super::super::{Pose, Problem, SeedSet};
use super::super::chunk::{Chunk, Limits, Maker, Plan, plans};
use super::{Most, Random, by_load};
use crate::geometry::patch_area;
use crate::mechanics::{Options, Pads, Search, solve_pads};
use crate::model::{Contact, Patch, Polygon, Wrench};

/// A grip under loads of which most lift a pad or couple with the pressure.
pub(in super::super) struct LiftingGrip {
    contact: Arc<Contact>,
    distance: f64,
    pose: Pose,
    pub(in super::super) wrenches: Vec<Wrench>,
}

const FORCE: f64 = 40.0;

/// Share of an area by which it must be less to count as lifted.
const LIFTED: f64 = 1e-3;

impl Random {
    /// A bar, perhaps with a hole, as slots and rims leave of a pad.
    fn bar(&mut self) -> Patch {
        let (a, b) = (0.01 * self.within(0.5, 1.5), 0.01 * self.within(0.1, 0.8));
        let (x, y) = (self.within(-0.01, 0.01), self.within(-0.01, 0.01));
        let ring = |a: f64, b: f64, turn: f64| {
            let corners = [(-a, -b), (a, -b * turn), (a, b), (-a, b)];
            corners.map(|(u, v)| glam::DVec2::new(x + u, y + v)).to_vec()
        };
        let mut hole = ring(0.4 * a, 0.4 * b, 1.0);
        hole.reverse();
        let holes = if self.within(0.0, 1.0) < 0.4 { vec![hole] } else { Vec::new() };
        vec![Polygon { outer: ring(a, b, self.within(0.5, 1.0)), holes }]
    }

    /// Contacts of all kinds, each under so many loads.
    pub(in super::super) fn lifting_grips(
        &mut self,
        contacts: usize,
        loads: usize,
    ) -> Vec<LiftingGrip> {
        let one = |index: usize| {
            let contact = match index % 4 {
                0 => self.contact(true),
                1 => self.contact(false),
                2 => Contact { face_i: self.patch(), face_ii: self.patch() },
                _ => {
                    let face = self.bar();
                    let other = if index % 8 == 3 { face.clone() } else { self.bar() };
                    Contact { face_i: face, face_ii: other }
                }
            };
            let strength = FORCE * 10_f64.powf(self.within(-1.5, -0.2));
            let arm = self.within(0.0, 0.03);
            let mut pose = self.pose();
            pose.part_from_grip.origin = pose.centre_of_mass + self.vector() * 0.02;
            let wrench = |_| Wrench {
                force: self.vector() * strength,
                moment: self.vector() * strength * arm,
            };
            let wrenches = (0..loads).map(wrench).collect();
            let distance = self.within(-0.02, 0.05);
            LiftingGrip { contact: Arc::new(contact), distance, pose, wrenches }
        };
        (0..contacts).map(one).collect()
    }
}

impl LiftingGrip {
    pub(in super::super) fn problem(&self) -> Problem<'_> {
        Problem {
            contact: &self.contact,
            distance: self.distance,
            force: FORCE,
            wrenches: &self.wrenches,
            pose: Some(self.pose),
        }
    }
}

/// Every load of some problems, with estimates.
pub(in super::super) fn chunks(
    contacts: &Contacts,
    problems: &[Problem<'_>],
    (limits, seeds): (Limits, &SeedSet),
) -> Vec<(Chunk, Plan)> {
    let users = (0..problems.len()).map(|index| (contacts.slots[index], vec![index]));
    let plans = plans(contacts, problems, users.collect(), (limits, seeds.len()));
    let made = |plan: Plan| {
        let with = (seeds.len(), Wanted::All);
        let mut chunk = Maker::default().chunk((contacts, problems), &plan, with);
        chunk.grips.iter_mut().for_each(|grip| grip.wanted |= ESTIMATES);
        (chunk, plan)
    };
    plans.into_iter().map(made).collect()
}

/// What the estimates of some loads came to.
#[derive(Debug, Default)]
pub(in super::super) struct Estimates {
    /// Loads without bounds, and those of them that have an estimate: all, and those that lift a pad.
    pub(in super::super) open: usize,
    pub(in super::super) estimated: usize,
    pub(in super::super) lifted: usize,
    /// Loads without bounds that have no limit state in double precision, and those that are left to
    /// it: a pad hardly touches, or there may be further states.
    pub(in super::super) refused: usize,
    pub(in super::super) hard: usize,
    /// Largest error over the margin that is stated; infinite where there is no limit state.
    pub(in super::super) of_margin: f64,
    /// Each margin as a share of the estimate.
    pub(in super::super) margins: Vec<f64>,
    /// Loads with an estimate from adapter or twin only.
    pub(in super::super) by_one: usize,
    /// The estimate, and what it lies between at most.
    pub(super) value: Most,
    pub(super) margin: Most,
}

impl Estimates {
    /// The loads of a grip, of which the device and its twin say this.
    pub(in super::super) fn add(
        &mut self,
        pads: &Pads,
        problem: &Problem<'_>,
        [found, twin]: [&[FoundRecord]; 2],
        number: u32,
    ) {
        let [found, twin] = [found, twin].map(|entries| by_load(entries, number));
        let estimate = |seed: &Option<SeedRecord>| seed.filter(|seed| seed.status == ESTIMATED);
        for (load, seed) in &twin {
            let other = found.get(load).copied().flatten();
            if seed.is_some_and(|seed| seed.status != ESTIMATED)
                || other.is_some_and(|seed| seed.status != ESTIMATED)
            {
                continue;
            }
            self.open += 1;
            self.load((pads, problem, *load as usize), [estimate(&other), estimate(seed)]);
        }
    }

    fn load(
        &mut self,
        (pads, problem, load): (&Pads, &Problem<'_>, usize),
        [found, twin]: [Option<SeedRecord>; 2],
    ) {
        let options = Options { search: Search::Off, ..Options::default() };
        let wrench = problem.wrench(load);
        let exact = solve_pads(pads, problem.distance, problem.force, &wrench, &options);
        self.refused += usize::from(exact.mu_s.is_none());
        self.by_one += usize::from(found.is_some() != twin.is_some());
        let middle =
            |seed: &SeedRecord| (0.5 * (seed.lower + seed.upper), 0.5 * (seed.upper - seed.lower));
        let Some(mu) = exact.mu_s else {
            if found.or(twin).is_some() {
                self.of_margin = f64::INFINITY;
            }
            return;
        };
        let areas =
            [&problem.contact.face_i, &problem.contact.face_ii].map(|face| patch_area(face));
        let left = [exact.contact_area_i / areas[0], exact.contact_area_ii / areas[1]];
        let left = left[0].min(left[1]);
        let coupling = mu * problem.distance.abs() / (0.5 * (areas[0] + areas[1])).sqrt();
        let hard = left < f64::from(HARDLY) || coupling > 1.0;
        self.hard += usize::from(hard && twin.is_none());
        for (value, margin) in [found, twin].iter().flatten().map(middle) {
            let off = (f64::from(value) - mu).abs() / f64::from(margin);
            self.of_margin = self.of_margin.max(if off.is_nan() { f64::INFINITY } else { off });
        }
        if let (Some((found, margin)), Some((twin, twins))) =
            (found.as_ref().map(middle), twin.as_ref().map(middle))
        {
            self.estimated += 1;
            self.lifted += usize::from(left < 1.0 - LIFTED);
            self.margins.push(f64::from(margin / found));
            self.value.add(found, twin, mu, mu);
            self.margin.add(margin, twins, f64::from(twins), mu);
        }
    }
}

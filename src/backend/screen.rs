//! Which loads of a grip can be its worst, found on the processor without the rings of most of them.
//!
//! Let `R` be the largest ratio, for any load on a contact, of the bound from a triangle of twists
//! to the largest value over the set. Loads whose value times `R` is below the value of another one
//! are left out; only the others (some 5 to 20 of 500) get the bounds of [`super::search`]. Every
//! load lies between the gradients at the corners of some triangle, `w = sum x_j g_j` with `x_j` not
//! negative; its `mu` is at most `sum x_j`, and the values of the three twists are at least, in the
//! mean, `sum_j x_j sum_i (g_j . v_i / D(v_i)) / 3`. So `R` is at most the largest of `3 / sum_i (g_j
//! . v_i / D(v_i))` over corners and triangles ([`Screen::reaches`]). This holds for any set of twists
//! that goes round the sphere in triangles: a quarter of them leaves out most loads already, and the
//! others are compared by all.

use std::ops::Range;

use rayon::prelude::*;

use super::cpu::{Found, Searched};
use super::lanes::{LANES, Lanes, Loads, dot, larger, pick, pick_number, smaller};
use super::layout::{CONTACT_MARGIN, EdgeRecord, LEAST_DISSIPATION, OUT_OF_RANGE};
use super::prepare::{Contacts, RANGE, Records, not_searched};
use super::problem::{Batch, F32_TOLERANCE, Problem, Seed, SeedStatus, check, check_grip};
use super::search::{Field, Planes, sign_of};
use super::seeds::{NEGATED, RING, SeedSet};
use super::table::PARTS;
use crate::contact::widest;
use crate::error::Result;
use crate::model::Wrench;

/// Largest norm of the coupling in the tilt equations up to which full contact is told without the
/// ring: `(1 - 0.4)^2` is above [`super::layout::COUPLING_MARGIN`].
const LITTLE_COUPLING: f32 = 0.4;
/// Largest change of a pressure, as a share of that of the squeeze, for which `R` is bounded.
const NEAR_SQUEEZE: f32 = 0.5;
/// In-plane load over the gripping force, and normal force over it, beyond which a load is looked at
/// by itself.
const ORDINARY: (f64, f64) = (1e-30, 1.999);
/// Loads that one task looks at, at least.
const TASK: usize = 1 << 11;

/// Which loads of a grip come with their seeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// All.
    All,
    /// Those that can be the worst, by bounds.
    Worst,
    /// The same, by bounds and estimates: where those of loads without bounds cost the processor no time.
    Estimated,
}

/// The loads of each problem that are wanted, with their seeds.
///
/// # Errors
/// As [`super::Backend::seed`].
pub(super) fn survivors(
    contacts: &Contacts,
    batch: &Batch<'_>,
    seeds: &SeedSet,
    wanted: Wanted,
) -> Result<Vec<Found>> {
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); contacts.ready.len()];
    for (index, &slot) in contacts.slots.iter().enumerate() {
        check_grip(&batch.problems[index], index)?;
        users[slot].push(index);
    }
    let of_contact = |(slot, users): (usize, Vec<usize>)| -> Result<Vec<(usize, Found)>> {
        let Some(records) = &contacts.ready[slot].records else {
            let none = |index: usize| Ok((index, without_contact(&batch.problems[index], index)?));
            return users.into_iter().map(none).collect();
        };
        let loads = users.iter().map(|&index| batch.problems[index].wrenches.len()).sum();
        let least = (users.len() * TASK).div_ceil(usize::max(loads, 1));
        let users = users.par_iter().with_min_len(least);
        if wanted != Wanted::All {
            let screen = Screen::new(records, seeds);
            let one = |&index: &usize| {
                let problem = &batch.problems[index];
                Ok((index, screen.survivors(problem, index, 0..problem.wrenches.len())?.0))
            };
            return users.map(one).collect();
        }
        let searched = Searched::new(records, seeds);
        users.map(|&index| Ok((index, every(&searched, &batch.problems[index], index)?))).collect()
    };
    let found: Result<Vec<Vec<(usize, Found)>>> =
        users.into_par_iter().enumerate().map(of_contact).collect();
    let found = found.or_else(|error| {
        // Of several loads that are not finite the first one is told.
        let mut problems = batch.problems.iter().enumerate();
        problems.try_for_each(|(index, problem)| check(problem, index))?;
        Err(error)
    })?;
    let mut by_problem: Vec<Found> = vec![Vec::new(); batch.problems.len()];
    for (index, found) in found.into_iter().flatten() {
        by_problem[index] = found;
    }
    Ok(by_problem)
}

/// All loads of a problem, on several threads where they are many.
fn every(searched: &Searched<'_>, problem: &Problem<'_>, index: usize) -> Result<Found> {
    let count = problem.wrenches.len();
    let starts = (0..count).into_par_iter().step_by(TASK);
    let parts: Vec<Found> = starts
        .map(|start| searched.found(problem, index, start..count.min(start + TASK)))
        .collect::<Result<_>>()?;
    Ok(parts.concat())
}

/// The loads of a problem whose contact has no area.
///
/// # Errors
/// A bad value for a load that is not finite.
pub(super) fn without_contact(problem: &Problem<'_>, index: usize) -> Result<Found> {
    check(problem, index)?;
    let none = |load: u32| (load, not_searched(SeedStatus::NoContact));
    Ok((0..problem.wrenches.len() as u32).map(none).collect())
}

/// Whether a seed is that of a load which can be the worst where another one's `mu_s` is at least
/// `floor`.
pub(super) fn can_be_worst(seed: &Seed, floor: f64) -> bool {
    let bounded =
        matches!(seed.status, SeedStatus::Bounded | SeedStatus::Coupled | SeedStatus::Estimated);
    !(bounded && seed.upper < floor)
}

/// A contact on which loads are screened.
pub(super) struct Screen<'a> {
    pub(super) searched: Searched<'a>,
    /// A quarter of the twists ([`SeedSet::half`]), by which most loads are left out already.
    few: Twists,
    /// All of them.
    all: Twists,
    /// Different faces: one over the pressure of the squeeze at each vertex.
    squeezed: Vec<f32>,
}

/// Twists by which loads are compared.
struct Twists {
    /// Their [`Table::parts`].
    parts: Vec<[f32; PARTS]>,
    /// `R`; for different faces under the pressure of the squeeze. [`f32::MAX`]: not known.
    reach: f32,
}

impl<'a> Screen<'a> {
    pub(super) fn new(records: &'a Records, seeds: &'a SeedSet) -> Self {
        let searched = Searched::new(records, seeds);
        let none = || Twists { parts: Vec::new(), reach: f32::MAX };
        let mut screen = Self { searched, few: none(), all: none(), squeezed: Vec::new() };
        screen.all.parts = screen.searched.table.parts().to_vec();
        if records.header.resolved == 0 {
            return screen;
        }
        let field = screen.searched.field();
        let planes = field.planes(&Loads::new(&[]));
        let [at_i, at_ii] = [planes.at_i[0], planes.at_ii[0]];
        let slope = [planes.slope[0][0], planes.slope[1][0]];
        let (reaches, squeezed) = if records.header.faces == 1 {
            (screen.reaches([at_i + at_ii]), Vec::new())
        } else {
            let on = |at: f32, sign: f32| {
                move |edge: &EdgeRecord| {
                    1.0 / (at + sign * (slope[0] * edge[0] + slope[1] * edge[1]))
                }
            };
            let [i, ii] = field.edges;
            let squeezed: Vec<f32> =
                i.iter().map(on(at_i, 1.0)).chain(ii.iter().map(on(at_ii, -1.0))).collect();
            let pressed = planes.full[0] && squeezed.iter().all(|p| p.is_finite() && *p > 0.0);
            let pressures = [at_i, at_ii, slope[0], slope[1]];
            (if pressed { screen.reaches(pressures) } else { [f32::MAX; 2] }, squeezed)
        };
        [screen.few.reach, screen.all.reach] = reaches;
        if screen.few.reach < f32::MAX {
            let parts = screen.searched.table.parts();
            screen.few.parts = seeds.half().iter().map(|&(k, _)| parts[k as usize]).collect();
        }
        screen.squeezed = squeezed;
        screen
    }

    /// `R` of a quarter of the twists and of all under a pressure.
    fn reaches<const PRESSURES: usize>(&self, pressures: [f32; PRESSURES]) -> [f32; 2] {
        let Searched { records, seeds, table } = &self.searched;
        let support = |k: usize| table.support(k, pressures);
        let supports: Vec<[f32; 3]> = (0..seeds.len()).map(support).collect();
        // Twists over their dissipation.
        let congruent = records.header.faces == 1;
        let over = |n: &[f32; PARTS]| {
            let d: f32 = pressures.iter().zip(&n[3..]).map(|(p, n)| p * n).sum();
            let by = if congruent { 1.0 } else { 1.0 / larger(d, LEAST_DISSIPATION) };
            [n[0] * by, n[1] * by, n[2] * by]
        };
        let unit: Vec<[f32; 3]> = table.parts().iter().map(over).collect();
        let of = |(k, ring): (usize, &[u32; RING])| least_sum(supports[k], &unit, ring);
        let least = |sums: &mut dyn Iterator<Item = f32>| sums.fold(f32::MAX, smaller);
        let few = seeds.half().iter().map(|(k, ring)| (*k as usize, ring));
        let all = seeds.rings().iter().enumerate();
        // Nothing is known of no twists.
        [least(&mut few.map(of)), least(&mut all.map(of))]
            .map(|least| if least > 0.0 && least < f32::MAX { 3.0 / least } else { f32::MAX })
    }

    /// The loads of a range that can be the worst of it; the largest `mu_s` is at least the number
    /// that comes with them.
    pub(super) fn survivors(
        &self,
        problem: &Problem<'_>,
        index: usize,
        range: Range<usize>,
    ) -> Result<(Found, f64)> {
        let mut bounds = vec![0.0; range.len().next_multiple_of(LANES)];
        let floor = ceilings(self, problem, &range, &mut bounds);
        let left = range.clone().filter(|load| reaches(bounds[load - range.start], floor));
        // A number that is not finite leaves a load without a bound.
        let mut found = self.searched.found(problem, index, left)?;
        let floor = f64::from(floor) * (1.0 - F32_TOLERANCE);
        found.retain(|(_, seed)| can_be_worst(seed, floor));
        Ok((found, floor))
    }
}

widest! {
    /// Writes what each load's `mu_s` is at most, infinite where that is not known; what the largest
    /// is at least.
    fn ceilings(screen: &Screen<'_>, problem: &Problem<'_>, range: &Range<usize>, out: &mut [f32]) -> f32 = ceilings_all
}

/// Whether a load whose `mu_s` is at most `ceiling` may have that of another one, at least `floor`.
#[inline(always)]
fn reaches(ceiling: f32, floor: f32) -> bool {
    f64::from(ceiling) * (1.0 + F32_TOLERANCE) >= f64::from(floor) * (1.0 - F32_TOLERANCE)
}

#[inline(always)]
fn ceilings_all(
    screen: &Screen<'_>,
    problem: &Problem<'_>,
    range: &Range<usize>,
    out: &mut [f32],
) -> f32 {
    let field = screen.searched.field();
    let all = &problem.wrenches[range.clone()];
    let count = all.len();
    let mut blocks = Vec::with_capacity(count.div_ceil(LANES));
    let mut floor = 0.0;
    let mut left: Vec<u32> = Vec::with_capacity(count);
    for (wrenches, out) in all.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let (loads, ordinary) = side_by_side(screen.searched.records, problem, wrenches);
        let [low, high] = screen.range(&field, &loads, &screen.few);
        for lane in 0..LANES {
            let known = ordinary[lane] && high[lane] < f32::MAX;
            out[lane] = if known { loads.scale[lane] * high[lane] } else { f32::INFINITY };
            floor = larger(floor, if known { loads.scale[lane] * low[lane] } else { 0.0 });
        }
        for lane in 0..wrenches.len() {
            if ordinary[lane] {
                left.push((blocks.len() * LANES + lane) as u32);
            }
        }
        blocks.push(loads);
    }
    left.retain(|&load| reaches(out[load as usize], floor));
    for some in left.chunks(LANES) {
        let loads = Loads::gathered(&blocks, some);
        let [low, high] = screen.range(&field, &loads, &screen.all);
        for (lane, &load) in some.iter().enumerate() {
            if high[lane] < f32::MAX {
                let most = &mut out[load as usize];
                *most = smaller(loads.scale[lane] * high[lane], *most);
                floor = larger(floor, loads.scale[lane] * low[lane]);
            }
        }
    }
    floor
}

/// [`Records::load`] of loads side by side, and which of them can be told so: the others are looked
/// at by themselves.
#[inline(always)]
fn side_by_side(
    records: &Records,
    problem: &Problem<'_>,
    wrenches: &[Wrench],
) -> (Loads, [bool; LANES]) {
    let zero = [0.0_f64; LANES];
    let (mut force, mut moment) = ([zero; 3], [zero; 3]);
    for (lane, wrench) in wrenches.iter().enumerate().take(LANES) {
        let wrench = problem.seen(wrench);
        for m in 0..3 {
            force[m][lane] = wrench.force[m];
            moment[m][lane] = wrench.moment[m];
        }
    }
    let (by_force, by_unit, o) = (1.0 / problem.force, 1.0 / records.unit, records.origin);
    let by_moment = by_force * by_unit;
    let distance = problem.distance * by_unit;
    let mut loads = Loads::new(&[]);
    let mut ordinary = [false; LANES];
    for lane in 0..LANES {
        let [fx, fy, fz] = [force[0][lane], force[1][lane], force[2][lane]];
        let m1 = (moment[0][lane] - o.y * fz) * by_moment;
        let m2 = (moment[1][lane] + o.x * fz) * by_moment;
        let m3 = (moment[2][lane] - (o.x * fy - o.y * fx)) * by_moment;
        let [f1, f2, f3] = [fx * by_force, fy * by_force, fz * by_force];
        let length = (f1 * f1 + f2 * f2 + m3 * m3).sqrt();
        ordinary[lane] = (length > ORDINARY.0)
            & (length <= RANGE)
            & (f3.abs() < ORDINARY.1)
            & (m1.abs() <= RANGE)
            & (m2.abs() <= RANGE)
            & (distance.abs() <= RANGE);
        let inverse = 1.0 / length;
        loads.wrench[0][lane] = (f1 * inverse) as f32;
        loads.wrench[1][lane] = (f2 * inverse) as f32;
        loads.wrench[2][lane] = (m3 * inverse) as f32;
        loads.scale[lane] = length as f32;
        loads.f3[lane] = f3 as f32;
        loads.m1[lane] = m1 as f32;
        loads.m2[lane] = m2 as f32;
        loads.distance[lane] = distance as f32;
    }
    (loads, ordinary)
}

impl Screen<'_> {
    /// Bounds on the `mu_s` of unit wrenches without the ring; the upper one is [`f32::MAX`] where
    /// none is known.
    #[inline(always)]
    fn range(&self, field: &Field<'_>, loads: &Loads, twists: &Twists) -> [Lanes; 2] {
        if twists.reach == f32::MAX {
            return [[0.0; LANES], [f32::MAX; LANES]];
        }
        if field.header.faces == 1 {
            let low = highest(loads, &twists.parts);
            let (mut high, mut mu) = (low, low);
            for lane in 0..LANES {
                high[lane] *= twists.reach;
                mu[lane] = loads.scale[lane] * high[lane];
            }
            let pressed = field.surely_pressed(loads, &mu);
            for lane in 0..LANES {
                high[lane] = if pressed[lane] { high[lane] } else { f32::MAX };
            }
            return [low, high];
        }
        let planes = field.planes(loads);
        let mut low = strongest_of(loads, &planes, &twists.parts);
        let changes = field.changes(&planes, &self.squeezed);
        let mut high = low;
        for lane in 0..LANES {
            let s = changes[lane];
            high[lane] *= twists.reach * (1.0 + s) / (1.0 - s);
        }
        let shares = field.coupled_share(loads, &planes, &high);
        for lane in 0..LANES {
            let known = (changes[lane] < NEAR_SQUEEZE) & (shares[lane] >= 0.0);
            low[lane] /= 1.0 + shares[lane];
            high[lane] = if known { high[lane] / (1.0 - shares[lane]) } else { f32::MAX };
        }
        [low, high]
    }
}

/// Power of a load on a twist.
#[inline(always)]
fn power(loads: &Loads, n: &[f32; PARTS], lane: usize) -> f32 {
    let w = &loads.wrench;
    (w[0][lane] * n[0] + w[1][lane] * n[1] + w[2][lane] * n[2]).abs()
}

/// Dissipation of a twist under a load's pressure on different faces.
#[inline(always)]
fn dissipation(planes: &Planes, n: &[f32; PARTS], lane: usize) -> f32 {
    let d = planes.at_i[lane] * n[3]
        + planes.at_ii[lane] * n[4]
        + planes.slope[0][lane] * n[5]
        + planes.slope[1][lane] * n[6];
    larger(d, LEAST_DISSIPATION)
}

/// The largest value of each load on congruent faces.
#[inline(always)]
fn highest(loads: &Loads, parts: &[[f32; PARTS]]) -> Lanes {
    let mut value = [0.0_f32; LANES];
    for n in parts {
        for lane in 0..LANES {
            let mu = power(loads, n, lane);
            value[lane] = larger(mu, value[lane]);
        }
    }
    value
}

/// The largest value of each load on different faces.
#[inline(always)]
fn strongest_of(loads: &Loads, planes: &Planes, parts: &[[f32; PARTS]]) -> Lanes {
    // The largest of the quotients power / dissipation, without a division for each.
    let (mut value, mut least) = ([-1.0_f32; LANES], [1.0_f32; LANES]);
    for n in parts {
        for lane in 0..LANES {
            let power = power(loads, n, lane);
            let d = dissipation(planes, n, lane);
            let better = power * least[lane] > value[lane] * d;
            value[lane] = pick_number(better, power, value[lane]);
            least[lane] = pick_number(better, d, least[lane]);
        }
    }
    for lane in 0..LANES {
        value[lane] /= least[lane];
    }
    value
}

/// The least `sum_i (g . v_i / D(v_i))` over the triangles of a ring, `g` the support in its middle
/// and `unit` the twists over their dissipation; zero where a term is not positive.
fn least_sum(g: [f32; 3], unit: &[[f32; 3]], ring: &[u32; RING]) -> f32 {
    let along = ring.map(|entry| sign_of(entry) * dot(g, unit[(entry & !NEGATED) as usize]));
    let mut least = f32::MAX;
    for slot in 0..RING {
        // A corner of the icosahedron has one triangle less.
        let (one, other) = (along[slot], along[(slot + 1) % RING]);
        let sum = 1.0 + one + other;
        least = if one > 0.0 && other > 0.0 { smaller(least, sum) } else { 0.0 };
        if least == 0.0 {
            break;
        }
    }
    least
}

impl Field<'_> {
    /// The best twist of each load and its value.
    #[inline(always)]
    pub(super) fn strongest(&self, loads: &Loads, planes: &Planes) -> ([u32; LANES], Lanes) {
        let (mut best, mut value) = ([0_u32; LANES], [-1.0_f32; LANES]);
        if self.header.faces == 1 {
            for (k, n) in self.table.parts().iter().enumerate() {
                for lane in 0..LANES {
                    let mu = power(loads, n, lane);
                    let better = mu > value[lane];
                    best[lane] = pick(better, k as u32, best[lane]);
                    value[lane] = larger(mu, value[lane]);
                }
            }
            return (best, value);
        }
        // The largest of the quotients power / dissipation, without a division for each.
        let mut least = [1.0_f32; LANES];
        for (k, n) in self.table.parts().iter().enumerate() {
            for lane in 0..LANES {
                let power = power(loads, n, lane);
                let d = dissipation(planes, n, lane);
                let better = power * least[lane] > value[lane] * d;
                best[lane] = pick(better, k as u32, best[lane]);
                value[lane] = pick_number(better, power, value[lane]);
                least[lane] = pick_number(better, d, least[lane]);
            }
        }
        for lane in 0..LANES {
            value[lane] /= least[lane];
        }
        (best, value)
    }

    /// Whether congruent faces stay in full contact whatever the twist, with the margins of the
    /// search, for a friction of at most `mu`. The coupling changes the slope by at most `reach
    /// softness` times the area's first moment for each unit of it, and by `reach softness |F3|`.
    #[inline(always)]
    fn surely_pressed(&self, loads: &Loads, mu: &Lanes) -> [bool; LANES] {
        let header = self.header;
        let k = header.compliance;
        let zero = [0.0; LANES];
        let (mut slope, mut more) = ([zero; 2], zero);
        let (mut drop_i, mut drop_ii, mut held) = (zero, zero, [false; LANES]);
        for lane in 0..LANES {
            let (m1, m2, f3) = (loads.m1[lane], loads.m2[lane], loads.f3[lane]);
            let distance = loads.distance[lane].abs();
            let reach = 0.5 * distance * mu[lane] * header.softness;
            let coupling = reach * header.spread;
            let (s1, s2) = (-k[0] * m2 + k[1] * m1, -k[1] * m2 + k[2] * m1);
            held[lane] = (coupling <= LITTLE_COUPLING) & (distance < OUT_OF_RANGE);
            let change = reach * f3.abs() + coupling * (s1 * s1 + s2 * s2).sqrt();
            more[lane] = change / (1.0 - coupling) * header.radius;
            slope[0][lane] = s1;
            slope[1][lane] = s2;
            drop_i[lane] = (1.0 + 0.5 * f3 - CONTACT_MARGIN) / header.area_i;
            drop_ii[lane] = (1.0 - 0.5 * f3 - CONTACT_MARGIN) / header.area_i;
        }
        for edge in self.edges[0] {
            for lane in 0..LANES {
                let here = slope[0][lane] * edge[0] + slope[1][lane] * edge[1];
                held[lane] &=
                    (here + more[lane] <= drop_ii[lane]) & (more[lane] - here <= drop_i[lane]);
            }
        }
        held
    }

    /// Largest change of the pressure at a vertex from that of the squeeze, as a share of it.
    #[inline(always)]
    fn changes(&self, planes: &Planes, squeezed: &[f32]) -> Lanes {
        let mut most = [0.0; LANES];
        let faces = [(&planes.at_i, 1.0), (&planes.at_ii, -1.0)];
        let vertices = self.edges[0].iter().map(|edge| (0, edge));
        let vertices = vertices.chain(self.edges[1].iter().map(|edge| (1, edge)));
        for ((face, edge), inverse) in vertices.zip(squeezed) {
            let (at, sign) = faces[face];
            let (x, y) = (sign * edge[0], sign * edge[1]);
            for lane in 0..LANES {
                let here = at[lane] + planes.slope[0][lane] * x + planes.slope[1][lane] * y;
                most[lane] = larger(most[lane], (here * inverse - 1.0).abs());
            }
        }
        most
    }
}

//! What the pads do: pressure and incipient motion under the worst load and under others.

use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::payload::Columns;
use crate::load::wrench_in_grip;
use crate::mechanics::{Options, Pads, curved, solve_pads};
use crate::model::{Face, Pressure, Slip, Surfaces, Wrench};
use crate::results::{GripSet, RankedGrip};

/// Grips on surfaces that are not plane whose worst load is solved again for its tilt, which the
/// result does not hold.
const CURVED_GRIPS: usize = 5_000;
/// States under single loads that a page carries.
const STATES: usize = 20_000;
/// The same of contacts that are not plane, which take longer.
const CURVED_STATES: usize = 4_000;

/// The state of the pads under a load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pressed {
    /// `a_i0, a_ii0, a1, a2` of the pressure planes \[Pa\], [Pa/m]; of surfaces that are not plane
    /// compression at the origin of face I and II \[m\] and the tilt `a1, a2` \[rad\].
    pub(super) pressure: [f64; 4],
    /// Kind (0 unknown, 1 rotation, 2 translation, 3 none, 4 spin), then centre and sense, or
    /// direction, or angular velocity; of a spin then the velocity, and the face on which the part
    /// rolls (0: none).
    pub(super) slip: [f64; 7],
}

impl Pressed {
    /// Nothing is known.
    const UNKNOWN: Self = Self { pressure: [f64::NAN; 4], slip: slip(None) };

    fn plane(pressure: Option<Pressure>, motion: Option<Slip>) -> Self {
        let planes = pressure.map(|p| [p.a_i0, p.a_ii0, p.a1, p.a2]);
        Self { pressure: planes.unwrap_or([f64::NAN; 4]), slip: slip(motion) }
    }

    fn curved(answer: &curved::Answer) -> Self {
        let pressure = match (answer.faces, answer.tilt) {
            (Some([one, two]), Some([a1, a2])) => [one.delta, two.delta, a1, a2],
            _ => [f64::NAN; 4],
        };
        Self { pressure, slip: slip(answer.score.slip) }
    }
}

const fn slip(slip: Option<Slip>) -> [f64; 7] {
    let mut numbers = [f64::NAN; 7];
    numbers[0] = 0.0;
    match slip {
        None => {}
        Some(Slip::Rotation { c, sense }) => {
            [numbers[0], numbers[1], numbers[2], numbers[3]] = [1.0, c[0], c[1], sense as f64];
        }
        Some(Slip::Translation { direction }) => {
            [numbers[0], numbers[1], numbers[2]] = [2.0, direction[0], direction[1]];
        }
        Some(Slip::None) => numbers[0] = 3.0,
        Some(Slip::Spin { omega, velocity, rolls_on }) => {
            let rolls = match rolls_on {
                None => 0.0,
                Some(Face::I) => 1.0,
                Some(Face::II) => 2.0,
            };
            let [p, q, r] = omega;
            numbers = [4.0, p, q, r, velocity[0], velocity[1], rolls];
        }
    }
    numbers
}

/// Pads made ready, each surface once.
struct Ready(FxHashMap<usize, curved::Pads>);

impl Ready {
    fn new<'a>(grips: impl Iterator<Item = &'a RankedGrip>) -> Self {
        let mut found: FxHashMap<usize, &Surfaces> = FxHashMap::default();
        for surfaces in grips.filter_map(|ranked| ranked.grip.surfaces.as_ref()) {
            found.insert(Arc::as_ptr(surfaces) as usize, surfaces);
        }
        let ready = found.into_par_iter();
        Self(ready.filter_map(|(key, one)| Some((key, curved::Pads::new(one).ok()?))).collect())
    }

    fn of(&self, ranked: &RankedGrip) -> Option<&curved::Pads> {
        self.0.get(&(Arc::as_ptr(ranked.grip.surfaces.as_ref()?) as usize))
    }
}

/// The state of each grip's pads under its worst load.
pub(super) fn worst(set: &GripSet, grips: &[RankedGrip]) -> Vec<Pressed> {
    let force = set.provenance.resolved.force.0;
    let ready = Ready::new(grips.iter().take(CURVED_GRIPS).filter(|_| force > 0.0));
    let state = |(index, ranked): (usize, &RankedGrip)| match ready.of(ranked) {
        Some(pads) if index < CURVED_GRIPS => {
            Pressed::curved(&pads.solve(ranked.grip.distance(), force, &ranked.worst.wrench))
        }
        _ => Pressed::plane(ranked.worst.pressure, ranked.worst.slip),
    };
    grips.par_iter().enumerate().map(state).collect()
}

/// The pads' states under the hardest loads of the grips `rows` whose loads are all known: first
/// state of each row, and of each state its load, pressure and slip.
pub(super) fn by_load(columns: &mut Columns, set: &GripSet, grips: &[RankedGrip], rows: &[usize]) {
    let force = set.provenance.resolved.force.0;
    let solvable = force > 0.0;
    let chosen = || rows.iter().filter(|_| solvable).map(|&row| &grips[row]);
    let ready = Ready::new(chosen());
    let is_curved = |ranked: &&RankedGrip| ranked.grip.surfaces.is_some();
    let curved = chosen().filter(is_curved).count();
    let each = STATES / chosen().count().max(1);
    let each_curved = each.min(CURVED_STATES / curved.max(1));
    let request = &set.provenance.request.scoring;
    let (separation, refiner) = (request.separation, request.refiner);
    let options = Options { separation, refiner, ..Options::default() };
    let of_row = |ranked: &RankedGrip| -> Vec<(u32, Pressed)> {
        let (distance, pads) = (ranked.grip.distance(), Pads::new(&ranked.grip.contact));
        let seen = |load: u32| {
            let wrench = &set.loads[load as usize].wrench;
            wrench_in_grip(wrench, set.part.mass.centre_of_mass, &ranked.grip.part_from_grip)
        };
        let state = |wrench: &Wrench| match (ready.of(ranked), &pads) {
            (Some(pads), _) => Pressed::curved(&pads.solve(distance, force, wrench)),
            (None, Some(pads)) => {
                let score = solve_pads(pads, distance, force, wrench, &options);
                Pressed::plane(score.pressure, score.slip)
            }
            (None, None) => Pressed::UNKNOWN,
        };
        let most = if is_curved(&ranked) { each_curved } else { each };
        hardest(ranked, most).into_iter().map(|load| (load, state(&seen(load)))).collect()
    };
    let states: Vec<Vec<(u32, Pressed)>> =
        chosen().collect::<Vec<_>>().into_par_iter().map(of_row).collect();
    let mut next = 0;
    let ends = states.iter().map(|row| {
        next += row.len() as u32;
        next
    });
    columns.u32("state_rows", std::iter::once(0).chain(ends.collect::<Vec<_>>()));
    let all = || states.iter().flatten();
    columns.u32("state_load", all().map(|(load, _)| *load));
    columns.f32("state_pressure", all().flat_map(|(_, state)| state.pressure));
    columns.f32("state_slip", all().flat_map(|(_, state)| state.slip));
}

/// The loads of a grip that need most friction, those without a limit state first, `most` of them.
fn hardest(ranked: &RankedGrip, most: usize) -> Vec<u32> {
    let mu = |load: u32| ranked.mu_by_load[load as usize].unwrap_or(f64::INFINITY);
    let mut loads: Vec<u32> = (0..ranked.mu_by_load.len() as u32).collect();
    loads.sort_by(|a, b| mu(*b).total_cmp(&mu(*a)).then(a.cmp(b)));
    loads.truncate(most);
    loads
}

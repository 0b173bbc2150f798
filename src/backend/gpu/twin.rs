//! What the screen does, load by load, on the processor: the twin of `shaders/screen.wgsl`, same
//! functions in the same order, which the kernel is held against. No answer comes from here: where
//! the processor takes over, it makes its loads in double precision ([`super::super::screen`]).

use super::super::lanes::{LANES, Loads, cross, dot, larger, smaller};
use super::super::layout::{
    BITS, CaseRecord, EVERY, FoundRecord, GripRecord, KINDS, LEAST_LOAD, LOAD_MARGIN,
    LOAD_ROUNDING, LoadRecord, MOST_PULL, OPEN, OutcomeRecord, RANGE, SWAY_CONGRUENT,
    SWAY_DIFFERENT, SeedRecord, UNBOUNDED, WINDOW,
};
use super::super::problem::F32_TOLERANCE;
use super::super::search::{Field, Planes};

/// A listed load as the grip sees it, scaled.
pub(crate) fn make_load(grip: &GripRecord, listed: &CaseRecord) -> LoadRecord {
    let on_part = listed.force.map(|x| grip.force * x);
    let turned = cross(grip.lever, on_part);
    let about = [0, 1, 2].map(|m: usize| grip.moment * listed.moment[m] + turned[m]);
    let rows = [grip.row_1, grip.row_2, grip.row_3];
    let [force, moment] = [on_part, about].map(|x| rows.map(|row| dot(row, x)));
    let in_plane = [force[0], force[1], moment[2]];
    let size = larger(dot(in_plane, in_plane).sqrt(), LEAST_LOAD);
    LoadRecord {
        wrench: in_plane.map(|x| x / size),
        scale: size,
        f3: force[2],
        m1: moment[0],
        m2: moment[1],
        distance: grip.distance,
    }
}

/// How far that load is from the exact one at most ([`LOAD_ROUNDING`]).
pub(crate) fn load_error(grip: &GripRecord, listed: &CaseRecord) -> f32 {
    let size = grip.force * listed.force_size * (1.0 + grip.arm) + grip.moment * listed.moment_size;
    LOAD_ROUNDING * size + LEAST_LOAD
}

/// The least pressure at a vertex over that of the gripping force alone, which the area has.
pub(crate) fn least_pressure(field: &Field<'_>, planes: &Planes, lane: usize) -> f32 {
    let header = field.header;
    let slope = [planes.slope[0][lane], planes.slope[1][lane]];
    let mut least = f32::MAX;
    for edge in field.edges[0] {
        let here = planes.at_i[lane] + slope[0] * edge[0] + slope[1] * edge[1];
        least = smaller(header.area_i * here, least);
    }
    for edge in field.edges[1] {
        let here = planes.at_ii[lane] - (slope[0] * edge[0] + slope[1] * edge[1]);
        least = smaller(header.area_ii * here, least);
    }
    least
}

/// By which share the bounds of a load are to be widened for its `error`; [`f32::MAX`] where it is
/// not known that full contact and pressures of the load and the exact one are alike.
///
/// `mu` without coupling is a norm of the wrench: that of the error is at most `error` over the
/// least dissipation of a unit twist, that of the load at least its size over the largest. For
/// different faces the pressures change too, by `sway` over the mean pressure, and with them the
/// dissipation by that over the least (`1 / (1 - x)` is at most `1 + 4 x` up to three quarters); the
/// share of the coupling, at most a quarter, changes by less than twice as much.
pub(crate) fn doubt(
    field: &Field<'_>,
    load: &LoadRecord,
    (planes, lane): (&Planes, usize),
    error: f32,
    upper: f32,
) -> f32 {
    let header = field.header;
    let ordinary = load.scale > LEAST_LOAD
        && load.scale <= RANGE
        && load.f3.abs() < MOST_PULL
        && load.m1.abs() <= RANGE
        && load.m2.abs() <= RANGE;
    if !ordinary {
        return f32::MAX;
    }
    let mut share = f32::MAX;
    if header.faces == 1 {
        let coupling = 1.0 + load.distance.abs() * load.scale * upper;
        let sway = error * (0.5 + 4.0 * header.tilt * coupling);
        if sway <= SWAY_CONGRUENT {
            share = error / load.scale * (header.quickest / header.slowest);
        }
    } else {
        let sway = error * (0.5 + header.tilt);
        let least = least_pressure(field, planes, lane);
        if sway <= SWAY_DIFFERENT && 4.0 * sway <= least {
            share = 2.0 * error / load.scale * (header.quickest / (least * header.slowest))
                + 4.0 * sway / least;
        }
    }
    if share <= RANGE { share } else { f32::MAX }
}

/// The seed of a load, its bounds those of its `mu_s` and widened by the rounding of the load;
/// [`UNBOUNDED`] where that is not known to be small. With the share by which they are widened.
pub(crate) fn judge(
    field: &Field<'_>,
    load: &LoadRecord,
    planes: (&Planes, usize),
    error: f32,
    mut seed: SeedRecord,
) -> (SeedRecord, f32) {
    let mut share = f32::MAX;
    if seed.status != UNBOUNDED {
        share = doubt(field, load, planes, error, seed.upper);
    }
    if share < f32::MAX {
        seed.lower = load.scale * seed.lower * larger(1.0 - share, 0.0);
        seed.upper = load.scale * seed.upper * (1.0 + share);
    } else {
        seed.status = UNBOUNDED;
    }
    (seed, share)
}

/// Adds an entry; the processor has room for all.
pub(crate) fn append(entries: &mut Vec<FoundRecord>, entry: FoundRecord) {
    entries.push(entry);
}

/// The loads of the grip with this `number` that can be its worst, or every one: their seeds, or a bit
/// of a window for one left open.
pub(crate) fn screen(
    field: &Field<'_>,
    (grip, number): (&GripRecord, u32),
    cases: &[CaseRecord],
    (windows, found): (&mut Vec<FoundRecord>, &mut Vec<FoundRecord>),
) -> OutcomeRecord {
    let (before, tolerance) = (found.len(), F32_TOLERANCE as f32);
    let mut floor = 0.0;
    let listed = &cases[grip.first as usize..][..grip.count as usize];
    for (first, window) in (0..).step_by(WINDOW).zip(listed.chunks(WINDOW)) {
        let mut judged: Vec<(SeedRecord, f32)> = Vec::with_capacity(window.len());
        for some in window.chunks(LANES) {
            let made: Vec<LoadRecord> = some.iter().map(|listed| make_load(grip, listed)).collect();
            let loads = Loads::new(&made);
            let planes = field.planes(&loads);
            let (best, value) = field.strongest(&loads, &planes);
            let mut seeds = [SeedRecord::default(); LANES];
            field.finish(&loads, &planes, &best, &value, &mut seeds);
            for (lane, (load, listed)) in made.iter().zip(some).enumerate() {
                let error = load_error(grip, listed);
                judged.push(judge(field, load, (&planes, lane), error, seeds[lane]));
            }
        }
        for (seed, _) in judged.iter().filter(|(_, share)| *share < f32::MAX) {
            floor = larger(seed.lower * (1.0 - tolerance), floor);
        }
        let mut open = [[0_u32; 4]; WINDOW / BITS];
        for (slot, (seed, share)) in judged.iter().enumerate() {
            let bounded = *share < f32::MAX;
            if grip.wanted & EVERY == 0 && bounded && seed.upper * (1.0 + tolerance) < floor {
                continue;
            }
            if *share <= LOAD_MARGIN {
                let [x, y, z] = seed.twist;
                append(
                    found,
                    FoundRecord {
                        words: [x, y, z, seed.lower].map(f32::to_bits),
                        upper: seed.upper,
                        kind: seed.status + KINDS * seed.best,
                        load: first + slot as u32,
                        grip: number,
                    },
                );
            } else {
                open[slot / BITS][slot % BITS / 32] |= 1 << (slot % 32);
            }
        }
        for (part, words) in (0..).zip(open).take(window.len().div_ceil(BITS)) {
            let load = first + BITS as u32 * part;
            windows.push(FoundRecord { words, upper: 0.0, kind: OPEN, load, grip: number });
        }
    }
    OutcomeRecord { entries: (found.len() - before) as u32 + 1, floor }
}

//! What Newton's method in single precision says of loads without bounds: the twin of
//! `shaders/newton.wgsl`, same functions in the same order, which the kernel is held against. No answer
//! comes from here.
//!
//! The equations are those of [`crate::mechanics::abreast`]: twist and pressure together, on what the
//! zero-pressure lines leave of the areas ([`super::cut`]).
//!
//! An estimate has three parts: where Newton's method contracts, the solution lies within twice its last
//! step (see [`crate::mechanics::Comparer`]); what rounding leaves in each equation is bounded, and so
//! is the error of the load; and the derivatives of `mu_s` by the equations say how much of that it can
//! be off.

use super::super::lanes::{dot, larger};
use super::super::layout::{
    BITS, CONTRACTION, CORRECTIONS, CaseRecord, ContactHeader, ESTIMATE_MARGIN, ESTIMATED,
    ESTIMATES, EVERY, EdgeRecord, FALL, FoundRecord, GripRecord, HARDLY, LEAST_LEFT, LEAST_LOAD,
    LoadRecord, MOST_PULL, OPEN, OUT_OF_RANGE, OutcomeRecord, PART, PRESSED, PRESSURE_STEPS, QUIET,
    RANGE, ROUNDING, SHARP, SHORTER, STEEPEST, SeedRecord, WITHIN,
};
use super::super::problem::F32_TOLERANCE;
use super::super::search::Field;
use super::cut::{face_pressure, integrate, pressed_moments};
use super::twin::{append, load_error, make_load};

/// The seven equations at a state.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Equations {
    v: [f32; 3],
    q: [f32; 4],
    residual: [f32; 7],
    moments: [[f32; 6]; 2],
    g: [f32; 3],
    difference: [f32; 3],
    d: f32,
    sum: [f32; 6],
    less: [f32; 6],
    by_weight: [[[f32; 3]; 3]; 2],
    good: bool,
    /// Rounding of the friction's force and moment, and of the pressure's on face I, on face II and of
    /// its moments.
    friction_error: [f32; 2],
    pressure_error: [f32; 3],
}

/// Newton's step, and how much `mu_s` over the load's size changes with each equation.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Step {
    step: [f32; 7],
    by: [f32; 7],
}

/// A definite matrix, taken apart: `L D L^T`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Definite {
    d: [f32; 3],
    l21: f32,
    l31: f32,
    l32: f32,
}

/// What is known of a load's `mu_s`, and a twist near that of its slip.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) twist: [f32; 3],
    /// Larger than `upper` where nothing is known.
    pub(crate) lower: f32,
    pub(crate) upper: f32,
}

/// Normal forces and contact moment that `q` carries on areas with these moments.
pub(crate) fn carried(a: [f32; 6], b: [f32; 6], q: [f32; 4]) -> [f32; 4] {
    [
        a[0] * q[0] + a[1] * q[2] + a[2] * q[3],
        b[0] * q[1] - b[1] * q[2] - b[2] * q[3],
        a[1] * q[0] - b[1] * q[1] + (a[3] + b[3]) * q[2] + (a[4] + b[4]) * q[3],
        a[2] * q[0] - b[2] * q[1] + (a[4] + b[4]) * q[2] + (a[5] + b[5]) * q[3],
    ]
}

/// The pressure without friction coupling, about, by Newton's method on the areas cut at the
/// zero-pressure lines; not a number where there is none.
pub(crate) fn press(
    header: &ContactHeader,
    edges: &[&[EdgeRecord]; 2],
    load: &LoadRecord,
) -> [f32; 4] {
    let wanted = [1.0 + 0.5 * load.f3, 1.0 - 0.5 * load.f3, -load.m2, load.m1];
    let mut q = [wanted[0] / header.area_i, wanted[1] / header.area_ii, 0.0, 0.0];
    let mut step = [0.0; 4];
    let mut value = f32::MAX;
    let mut error = f32::MAX;
    let mut slope = 0.0;
    let mut share = 1.0;
    for _ in 0..PRESSURE_STEPS {
        let tried = [0, 1, 2, 3].map(|m: usize| q[m] + share * step[m]);
        let a = pressed_moments(header, edges, 0, face_pressure(tried, 0));
        let b = pressed_moments(header, edges, 1, face_pressure(tried, 1));
        let held = carried(a, b, tried);
        let left = [0, 1, 2, 3].map(|m: usize| held[m] - wanted[m]);
        let size =
            (left[0] * left[0] + left[1] * left[1] + left[2] * left[2] + left[3] * left[3]).sqrt();
        let energy = (0..4).map(|m| tried[m] * (0.5 * held[m] - wanted[m])).sum::<f32>();
        let pressed = a[0] > 0.0 && b[0] > 0.0;
        if !(pressed && (energy <= value + 1e-4 * share * slope || size < 0.5 * error)) {
            share *= 0.5;
            continue;
        }
        (q, value, error, share) = (tried, energy, size, 1.0);
        if error <= PRESSED {
            break;
        }
        let (a1, a2, b1, b2) = (a[1] / a[0], a[2] / a[0], b[1] / b[0], b[2] / b[0]);
        let s11 = a[3] + b[3] - a1 * a[1] - b1 * b[1];
        let s12 = a[4] + b[4] - a1 * a[2] - b1 * b[2];
        let s22 = a[5] + b[5] - a2 * a[2] - b2 * b[2];
        let x1 = -left[2] + a1 * left[0] - b1 * left[1];
        let x2 = -left[3] + a2 * left[0] - b2 * left[1];
        let det = s11 * s22 - s12 * s12;
        let tilt = [(x1 * s22 - s12 * x2) / det, (s11 * x2 - s12 * x1) / det];
        step = [
            -left[0] / a[0] - a1 * tilt[0] - a2 * tilt[1],
            -left[1] / b[0] + b1 * tilt[0] + b2 * tilt[1],
            tilt[0],
            tilt[1],
        ];
        slope = (0..4).map(|m| left[m] * step[m]).sum::<f32>();
    }
    q
}

/// From the entries 11, 12, 13, 22, 23, 33.
pub(crate) fn definite(a: [f32; 6]) -> Definite {
    let l21 = a[1] / a[0];
    let l31 = a[2] / a[0];
    let d2 = a[3] - l21 * a[1];
    let e32 = a[4] - l31 * a[1];
    let l32 = e32 / d2;
    Definite { d: [a[0], d2, a[5] - l31 * a[2] - l32 * e32], l21, l31, l32 }
}

pub(crate) fn solve(m: &Definite, b: [f32; 3]) -> [f32; 3] {
    let y2 = b[1] - m.l21 * b[0];
    let y3 = b[2] - m.l31 * b[0] - m.l32 * y2;
    let x3 = y3 / m.d[2];
    let x2 = y2 / m.d[1] - m.l32 * x3;
    [b[0] / m.d[0] - m.l21 * x2 - m.l31 * x3, x2, x3]
}

/// The equations at the twist and pressure of `at`, without the residuals.
pub(crate) fn put(header: &ContactHeader, edges: &[&[EdgeRecord]; 2], at: &mut Equations) {
    (at.g, at.difference) = ([0.0; 3], [0.0; 3]);
    (at.sum, at.less) = ([0.0; 6], [0.0; 6]);
    (at.friction_error, at.pressure_error) = ([0.0; 2], [0.0; 3]);
    at.good = true;
    let radius = header.radius;
    for face in 0..2 {
        let p = face_pressure(at.q, face);
        let part = integrate(header, edges, face, at.v, p);
        let area = if face == 0 { header.area_i } else { header.area_ii };
        let sign = if face == 0 { 1.0 } else { -1.0 };
        for n in 0..3 {
            let gradient = p[0] * part.g[0][n] + p[1] * part.g[1][n] + p[2] * part.g[2][n];
            at.g[n] += gradient;
            at.difference[n] += sign * gradient;
        }
        for n in 0..6 {
            at.sum[n] += part.hessian[n];
            at.less[n] += sign * part.hessian[n];
        }
        let m = part.moments;
        let normal = p[0] * m[0] + p[1] * m[1] + p[2] * m[2];
        let slope = (p[1] * p[1] + p[2] * p[2]).sqrt();
        // What is thin beside the pressure's slope loses too much.
        let left = m[0] >= LEAST_LEFT * area && slope * radius * m[0] <= STEEPEST * normal;
        at.good = at.good && (part.lowest >= 0.0 || left);
        let held = ROUNDING * (p[0].abs() + slope * radius) * part.length * radius;
        at.friction_error =
            [at.friction_error[0] + part.error[0], at.friction_error[1] + part.error[1]];
        at.pressure_error[face] = held;
        at.pressure_error[2] += held * radius;
        at.moments[face] = m;
        at.by_weight[face] = part.g;
    }
}

/// What the equations leave over under a load.
pub(crate) fn residuals(at: &mut Equations, load: &LoadRecord) {
    let held = carried(at.moments[0], at.moments[1], at.q);
    let d = dot(at.g, at.v);
    let friction = 0.5 * load.distance * load.scale * d;
    at.d = d;
    at.residual = [
        load.wrench[0] - d * at.g[0],
        load.wrench[1] - d * at.g[1],
        load.wrench[2] - d * at.g[2],
        1.0 + 0.5 * load.f3 - held[0],
        1.0 - 0.5 * load.f3 - held[1],
        load.m1 + friction * at.difference[1] - held[3],
        load.m2 - friction * at.difference[0] + held[2],
    ];
}

/// What a face's gradients change with one of the pressure's numbers: the sum of both, and face I's
/// less face II's.
pub(crate) fn by_pressure(at: &Equations, j: usize) -> [[f32; 3]; 2] {
    let [one, other] = &at.by_weight;
    match j {
        0 => [one[0], one[0]],
        1 => [other[0], other[0].map(|x| -x)],
        _ => [
            [0, 1, 2].map(|m: usize| one[j - 1][m] - other[j - 1][m]),
            [0, 1, 2].map(|m: usize| one[j - 1][m] + other[j - 1][m]),
        ],
    }
}

/// Newton's step: the slip's rows give the twist by the pressure, those of the normal forces the offsets
/// by the slopes; two unknowns are left.
pub(crate) fn newton_step(at: &Equations, load: &LoadRecord) -> Step {
    let (a, b, r, g, v, d) = (at.moments[0], at.moments[1], at.residual, at.g, at.v, at.d);
    let slip = definite([
        g[0] * g[0] + d * at.sum[0],
        g[0] * g[1] + d * at.sum[1],
        g[0] * g[2] + d * at.sum[2],
        g[1] * g[1] + d * at.sum[3],
        g[1] * g[2] + d * at.sum[4],
        g[2] * g[2] + d * at.sum[5],
    ]);
    let lever = 0.5 * load.distance * load.scale;
    let (x, y) = (at.difference[0], at.difference[1]);
    let less = at.less;
    let row_v1 = [
        lever * (g[0] * y + d * less[1]),
        lever * (g[1] * y + d * less[3]),
        lever * (g[2] * y + d * less[4]),
    ];
    let row_v2 = [
        -lever * (g[0] * x + d * less[0]),
        -lever * (g[1] * x + d * less[1]),
        -lever * (g[2] * x + d * less[2]),
    ];
    let k3 = [a[2], -b[2], a[4] + b[4], a[5] + b[5]];
    let k2 = [a[1], -b[1], a[3] + b[3], a[4] + b[4]];
    let mut c = [[0.0; 3]; 4];
    let (mut row_q1, mut row_q2, mut dd) = ([0.0; 4], [0.0; 4], [0.0; 4]);
    for j in 0..4 {
        let [by, less] = by_pressure(at, j);
        dd[j] = dot(by, v);
        c[j] = [0, 1, 2].map(|m: usize| -(dd[j] * g[m] + d * by[m]));
        row_q1[j] = lever * (dd[j] * y + d * less[1]) - k3[j];
        row_q2[j] = -lever * (dd[j] * x + d * less[0]) + k2[j];
    }
    let base = [r[3] / a[0], r[4] / b[0]];
    let slope_i = [-a[1] / a[0], -a[2] / a[0]];
    let slope_ii = [b[1] / b[0], b[2] / b[0]];
    let known =
        solve(&slip, [0, 1, 2].map(|m: usize| r[m] + c[0][m] * base[0] + c[1][m] * base[1]));
    let turned_1 = solve(
        &slip,
        [0, 1, 2].map(|m: usize| c[2][m] + c[0][m] * slope_i[0] + c[1][m] * slope_ii[0]),
    );
    let turned_2 = solve(
        &slip,
        [0, 1, 2].map(|m: usize| c[3][m] + c[0][m] * slope_i[1] + c[1][m] * slope_ii[1]),
    );
    let m11 = dot(row_v1, turned_1) + row_q1[2] + row_q1[0] * slope_i[0] + row_q1[1] * slope_ii[0];
    let m12 = dot(row_v1, turned_2) + row_q1[3] + row_q1[0] * slope_i[1] + row_q1[1] * slope_ii[1];
    let m21 = dot(row_v2, turned_1) + row_q2[2] + row_q2[0] * slope_i[0] + row_q2[1] * slope_ii[0];
    let m22 = dot(row_v2, turned_2) + row_q2[3] + row_q2[0] * slope_i[1] + row_q2[1] * slope_ii[1];
    let right_1 = -r[5] - dot(row_v1, known) - row_q1[0] * base[0] - row_q1[1] * base[1];
    let right_2 = -r[6] - dot(row_v2, known) - row_q2[0] * base[0] - row_q2[1] * base[1];
    let det = m11 * m22 - m12 * m21;
    let tilt = [(right_1 * m22 - m12 * right_2) / det, (m11 * right_2 - right_1 * m21) / det];
    let dv = [0, 1, 2].map(|m: usize| known[m] + turned_1[m] * tilt[0] + turned_2[m] * tilt[1]);
    let offset_i = base[0] + slope_i[0] * tilt[0] + slope_i[1] * tilt[1];
    let offset_ii = base[1] + slope_ii[0] * tilt[0] + slope_ii[1] * tilt[1];
    // The same backwards from the change of `d`, which is that of the slip's power less that of the
    // pressure's dissipation.
    let by_1 = -(dd[2] + dd[0] * slope_i[0] + dd[1] * slope_ii[0]);
    let by_2 = -(dd[3] + dd[0] * slope_i[1] + dd[1] * slope_ii[1]);
    let l1 = (by_1 * m22 - by_2 * m21) / det;
    let l2 = (by_2 * m11 - by_1 * m12) / det;
    let back_1 = solve(&slip, row_v1);
    let back_2 = solve(&slip, row_v2);
    let by_offset = |j: usize| {
        -(dd[j] + l1 * (dot(c[j], back_1) + row_q1[j]) + l2 * (dot(c[j], back_2) + row_q2[j]))
    };
    Step {
        step: [dv[0], dv[1], dv[2], offset_i, offset_ii, tilt[0], tilt[1]],
        by: [
            v[0] / d - l1 * back_1[0] - l2 * back_2[0],
            v[1] / d - l1 * back_1[1] - l2 * back_2[1],
            v[2] / d - l1 * back_1[2] - l2 * back_2[2],
            by_offset(0) / a[0],
            by_offset(1) / b[0],
            -l1,
            -l2,
        ],
    }
}

/// What a step can change of the dissipation at most: no point of the contact moves faster than the
/// fastest of the circle round it, and what is pressed changes by less than the pressure's plane.
pub(crate) fn change(header: &ContactHeader, at: &Equations, step: [f32; 7]) -> f32 {
    let radius = header.radius;
    let speed = (step[0] * step[0] + step[1] * step[1]).sqrt() + step[2].abs() * radius;
    let here = (at.v[0] * at.v[0] + at.v[1] * at.v[1]).sqrt() + at.v[2].abs() * radius;
    let tilt = (step[5] * step[5] + step[6] * step[6]).sqrt() * radius;
    let pressure = header.area_i * (step[3].abs() + tilt) + header.area_ii * (step[4].abs() + tilt);
    let held = carried(at.moments[0], at.moments[1], at.q);
    (held[0] + held[1]) * speed + pressure * (here + speed)
}

/// What rounding, and an `error` of the load's numbers, can change of `mu_s` over the load's size.
pub(crate) fn rounding(at: &Equations, load: &LoadRecord, by: [f32; 7], error: f32) -> f32 {
    let [force, moment] = at.friction_error;
    let speed = at.v.map(f32::abs);
    let d_error = (speed[0] + speed[1]) * force + speed[2] * moment;
    let lever = (0.5 * load.distance * load.scale).abs();
    let (d, g, less) = (at.d, at.g, at.difference);
    let wrench = error / load.scale + ROUNDING;
    let slip = |m: usize, own: f32| by[m].abs() * (wrench + d * own + d_error * g[m].abs());
    let tilt = |m: usize, x: f32| {
        let friction = lever * (d_error * x.abs() + d * (force + ROUNDING * x.abs()));
        by[m].abs() * (error + at.pressure_error[2] + friction)
    };
    d_error
        + slip(0, force)
        + slip(1, force)
        + slip(2, moment)
        + by[3].abs() * (0.5 * error + at.pressure_error[0])
        + by[4].abs() * (0.5 * error + at.pressure_error[1])
        + tilt(5, less[1])
        + tilt(6, less[0])
}

/// What Newton's method makes of a load, from a twist near its slip.
pub(crate) fn estimate(
    header: &ContactHeader,
    edges: &[&[EdgeRecord]; 2],
    load: &LoadRecord,
    error: f32,
    twist: [f32; 3],
) -> Estimate {
    let none = Estimate { twist, lower: f32::MAX, upper: 0.0 };
    let ordinary = load.scale > LEAST_LOAD
        && load.scale <= RANGE
        && load.f3.abs() < MOST_PULL
        && load.m1.abs() <= RANGE
        && load.m2.abs() <= RANGE
        && load.distance < OUT_OF_RANGE
        && header.resolved != 0;
    if !ordinary {
        return none;
    }
    let mut z = press(header, edges, load);
    let mut v = twist;
    let mut step = Step::default();
    let mut at = Equations::default();
    let mut left = f32::MAX;
    let mut share = 1.0;
    let mut found = none;
    for k in 0..CORRECTIONS {
        at.v = [0, 1, 2].map(|m: usize| v[m] + share * step.step[m]);
        at.q = [0, 1, 2, 3].map(|m: usize| z[m] + share * step.step[3 + m]);
        put(header, edges, &mut at);
        if k == 0 {
            // To the minimum along the ray.
            let d = dot(at.g, at.v);
            let by = dot(load.wrench, at.v) / (d * d);
            at.v = at.v.map(|x| by * x);
            at.sum = at.sum.map(|x| x / by);
            at.less = at.less.map(|x| x / by);
        }
        residuals(&mut at, load);
        let size = at.residual.iter().map(|x| x * x).sum::<f32>().sqrt();
        let pressed = at.good && at.moments[0][0] > 0.0 && at.moments[1][0] > 0.0 && at.d > 0.0;
        if !(pressed && size <= (1.0 - FALL * share) * left) {
            // Rounding is all that is left, or there is nothing to begin with.
            if k == 0 || left <= QUIET {
                break;
            }
            share *= SHORTER;
            found = none;
            continue;
        }
        let next = newton_step(&at, load);
        let before = share * change(header, &at, step.step);
        let after = change(header, &at, next.step);
        (v, z, left, step, share) = (at.v, at.q, size, next, 1.0);
        if k == 0 {
            continue;
        }
        let round = rounding(&at, load, step.by, error);
        let contracts = after <= CONTRACTION * before;
        if contracts || (left <= QUIET && after <= round) {
            found = none;
            let margin = WITHIN * after + round;
            let upper = load.scale * (at.d + margin);
            let half_area = 0.5 * (header.area_i + header.area_ii);
            let weak = upper * upper * load.distance * load.distance <= half_area;
            let touches = at.moments[0][0] >= HARDLY * header.area_i
                && at.moments[1][0] >= HARDLY * header.area_ii;
            if weak && touches && margin <= ESTIMATE_MARGIN * at.d {
                let length = dot(v, v).sqrt();
                found = Estimate {
                    twist: v.map(|x| x / length),
                    lower: load.scale * (at.d - margin),
                    upper,
                };
            }
            if after <= SHARP * at.d {
                break;
            }
        } else if left > QUIET {
            found = none;
        }
    }
    found
}

/// Whether a number is one, and above zero: by its bits, for what a shader's comparison says of what is
/// no number is the driver's choice.
pub(crate) fn is_positive(x: f32) -> bool {
    x.to_bits().wrapping_sub(1) < f32::INFINITY.to_bits() - 1
}

/// The open loads of the grip with this `number`, given by its `windows`, that can be its worst where
/// another one's `mu_s` is at least `floor`, or every one: their estimates, or bits for those that have none. The
/// entries are counted without one more.
pub(crate) fn newton(
    field: &Field<'_>,
    (grip, number): (&GripRecord, u32),
    cases: &[CaseRecord],
    (windows, mut floor): (&[FoundRecord], f32),
    found: &mut Vec<FoundRecord>,
) -> OutcomeRecord {
    let (before, tolerance) = (found.len(), F32_TOLERANCE as f32);
    let open = |window: &FoundRecord, bit: &u32| window.words[*bit as usize / 32] >> (bit % 32) & 1;
    for part in windows.chunks(PART / BITS) {
        let mut estimates = Vec::new();
        for window in part.iter().filter(|_| grip.wanted & ESTIMATES != 0) {
            for bit in (0..BITS as u32).filter(|bit| open(window, bit) == 1) {
                let load = window.load + bit;
                let listed = &cases[(grip.first + load) as usize];
                let (made, error) = (make_load(grip, listed), load_error(grip, listed));
                let mut seed = [SeedRecord::default()];
                field.search(&[made], &mut seed);
                let found = estimate(field.header, &field.edges, &made, error, seed[0].twist);
                let known = is_positive(found.lower) && is_positive(found.upper);
                if known && found.lower <= found.upper {
                    floor = larger(found.lower * (1.0 - tolerance), floor);
                    estimates.push((load, found));
                }
            }
        }
        for window in part {
            let mut words = window.words;
            for (load, found_here) in &estimates {
                let bit = load.wrapping_sub(window.load);
                if bit >= BITS as u32 {
                    continue;
                }
                words[bit as usize / 32] &= !(1 << (bit % 32));
                let Estimate { twist: [x, y, z], lower, upper } = *found_here;
                if grip.wanted & EVERY != 0 || upper * (1.0 + tolerance) >= floor {
                    let words = [x, y, z, lower].map(f32::to_bits);
                    let (kind, load) = (ESTIMATED, *load);
                    append(found, FoundRecord { words, upper, kind, load, grip: number });
                }
            }
            if words != [0; 4] {
                append(found, FoundRecord { words, kind: OPEN, ..*window });
            }
        }
    }
    OutcomeRecord { entries: (found.len() - before) as u32, floor }
}

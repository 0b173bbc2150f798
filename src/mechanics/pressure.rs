//! The pressure that carries given normal forces and out-of-plane moments, with separation where
//! the pads pull (equations (6)-(9) with given friction, (19)(20)).

use glam::DVec2;
use nalgebra::{Matrix4, Vector4};

use crate::contact::{Loops, moments};
use crate::model::Ring;

use super::pads::Pads;

/// Pressure coefficients of face `k` (0: I, 1: II) from `q = (a_i0, a_ii0, a1, a2)`.
pub(crate) fn face_pressure(q: &[f64; 4], k: usize) -> [f64; 3] {
    if k == 0 { [q[0], q[2], q[3]] } else { [q[1], -q[2], -q[3]] }
}

/// Whether the pressure plane is negative at a point of the area.
pub(crate) fn separates(area: &Loops, p: [f64; 3]) -> bool {
    area.points().iter().any(|x| p[0] + p[1] * x.x + p[2] * x.y < 0.0)
}

/// Moments of the pressed parts of both areas, using `scratch` where an area must be cut.
pub(crate) fn pressed_moments(pads: &Pads, q: &[f64; 4], scratch: &mut Loops) -> [[f64; 6]; 2] {
    std::array::from_fn(|k| {
        let p = face_pressure(q, k);
        if separates(&pads.areas[k], p) {
            pads.areas[k].clip_into(p, scratch);
            moments(scratch)
        } else {
            pads.moments[k]
        }
    })
}

/// The contact moment `(X1, X2)` that the pressure `q` carries on pressed areas with these moments.
pub(crate) fn carried([one, two]: &[[f64; 6]; 2], q: &[f64; 4]) -> DVec2 {
    first_moment(one, face_pressure(q, 0)) - first_moment(two, face_pressure(q, 1))
}

/// `int p x` over an area with these moments.
pub(crate) fn first_moment(m: &[f64; 6], p: [f64; 3]) -> DVec2 {
    DVec2::new(p[0] * m[1] + p[1] * m[3] + p[2] * m[4], p[0] * m[2] + p[1] * m[4] + p[2] * m[5])
}

/// Stiffness: `(N_I, N_II, X1, X2) = K q` with `X = int_I x p_I - int_II x p_II`.
pub(crate) fn stiffness(m: &[[f64; 6]; 2]) -> Matrix4<f64> {
    // Symmetric: rows are columns.
    Matrix4::from(stiffness_rows(m))
}

/// [`stiffness`] by rows.
#[inline(always)]
pub(super) fn stiffness_rows([a, b]: &[[f64; 6]; 2]) -> [[f64; 4]; 4] {
    [
        [a[0], 0.0, a[1], a[2]],
        [0.0, b[0], -b[1], -b[2]],
        [a[1], -b[1], a[3] + b[3], a[4] + b[4]],
        [a[2], -b[2], a[4] + b[4], a[5] + b[5]],
    ]
}

/// Distance of the contact moment `target = (X1, X2)` inside the region `N_I conv A_I - N_II conv
/// A_II` that pressing pads can carry, in units of force times length; not positive: the contact
/// twists out.
pub(crate) fn reach(pads: &Pads, normal: [f64; 2], target: DVec2) -> f64 {
    region_edges(pads, normal)
        .map(|(e, support)| support - e.dot(target))
        .fold(f64::INFINITY, f64::min)
}

/// Corners of the region of [`reach`], counter-clockwise: the hulls' edges one after the other by
/// their direction.
pub(crate) fn region(pads: &Pads, normal: [f64; 2]) -> Ring {
    let scaled =
        |k: usize, factor: f64| -> Ring { pads.hulls[k].iter().map(|x| factor * *x).collect() };
    let rings = [scaled(0, normal[0]), scaled(1, -normal[1])];
    // Both from their lowest corner on, of two the left one, from where directions rise from 0 to a
    // whole turn.
    let first = rings.each_ref().map(|ring| {
        (0..ring.len())
            .min_by(|&a, &b| ring[a].y.total_cmp(&ring[b].y).then(ring[a].x.total_cmp(&ring[b].x)))
            .unwrap_or(0)
    });
    let corner = |k: usize, i: usize| rings[k][(first[k] + i) % rings[k].len()];
    let mut done = [0, 0];
    let mut region = Ring::new();
    while done[0] < rings[0].len() || done[1] < rings[1].len() {
        region.push(corner(0, done[0]) + corner(1, done[1]));
        let [one, two] = [0, 1].map(|k| corner(k, done[k] + 1) - corner(k, done[k]));
        let turn = one.perp_dot(two);
        let (first_done, second_done) = (done[0] == rings[0].len(), done[1] == rings[1].len());
        // Parallel edges are taken together.
        // An overflown turn takes both, so that the walk ends.
        done[0] += usize::from(!first_done && (second_done || turn >= 0.0 || turn.is_nan()));
        done[1] += usize::from(!second_done && (first_done || turn <= 0.0 || turn.is_nan()));
    }
    region
}

/// Outward normals of the region's edges with the region's support in that direction.
fn region_edges(pads: &Pads, normal: [f64; 2]) -> impl Iterator<Item = (DVec2, f64)> {
    pads.supports.iter().map(move |&(e, [i, ii])| (e, normal[0] * i + normal[1] * ii))
}

/// Solves `K q = load` for the stiffness of [`stiffness`], of which `lift` times the diagonal is
/// added to the part that tilts the pressure; `None` where that part is not positive definite.
fn solve_stiffness(m: &[[f64; 6]; 2], load: &Vector4<f64>, lift: f64) -> Option<Vector4<f64>> {
    let [a, b] = m;
    // The offsets follow from the normal forces; what is left are the second moments about the
    // centroids.
    let (a1, a2, b1, b2) = (a[1] / a[0], a[2] / a[0], b[1] / b[0], b[2] / b[0]);
    let s11 = (a[3] + b[3]) * (1.0 + lift) - a1 * a[1] - b1 * b[1];
    let s12 = a[4] + b[4] - a1 * a[2] - b1 * b[2];
    let s22 = (a[5] + b[5]) * (1.0 + lift) - a2 * a[2] - b2 * b[2];
    let (x1, x2) = (load[2] - a1 * load[0] + b1 * load[1], load[3] - a2 * load[0] + b2 * load[1]);
    let l = s12 / s11;
    let d = s22 - l * s12;
    if !(s11 > 0.0 && d > 0.0) {
        return None;
    }
    let tilt2 = (x2 - l * x1) / d;
    let tilt1 = x1 / s11 - l * tilt2;
    Some(Vector4::new(
        load[0] / a[0] - a1 * tilt1 - a2 * tilt2,
        load[1] / b[0] + b1 * tilt1 + b2 * tilt2,
        tilt1,
        tilt2,
    ))
}

/// The pressure `q = (a_i0, a_ii0, a1, a2)` that carries the normal forces and the contact moment
/// `target`, from a `start` or from uniform pressure; `None` outside [`reach`] or at its very rim,
/// where the iteration ends unresolved.
///
/// It minimises the convex `1/2 sum int p^2 - f . q` by Newton's method; each step is one solve on
/// the areas cut at the current zero-pressure lines (paper 3.6), damped so that the function falls.
pub(crate) fn solve(
    pads: &Pads,
    normal: [f64; 2],
    target: DVec2,
    start: Option<[f64; 4]>,
    scratch: &mut Loops,
) -> Option<[f64; 4]> {
    let load = Vector4::new(normal[0], normal[1], target.x, target.y);
    if let Some(q) = whole(pads, &load) {
        return Some(q);
    }
    if reach(pads, normal, target) <= 0.0 {
        return None;
    }
    let (q, mut m) = match start {
        Some(q) => (q, pressed_moments(pads, &q, scratch)),
        None => (
            [normal[0] / pads.moments[0][0], normal[1] / pads.moments[1][0], 0.0, 0.0],
            pads.moments,
        ),
    };
    let mut q = Vector4::from(q);
    let k = stiffness(&m);
    let mut error = k * q - load;
    let scale = load.amax();
    let mut value = 0.5 * q.dot(&(k * q)) - load.dot(&q);
    for _ in 0..100 {
        if error.amax() <= 1e-15 * scale {
            break;
        }
        let step = -[0.0, 1e-14, 1e-10, 1e-6]
            .into_iter()
            .find_map(|lift| solve_stiffness(&m, &error, lift))?;
        let slope = error.dot(&step);
        let mut t = 1.0;
        let mut moved = false;
        for _ in 0..25 {
            let tried = q + t * step;
            let tried_m = pressed_moments(pads, &tried.into(), scratch);
            let stiff = stiffness(&tried_m);
            let tried_error = stiff * tried - load;
            let tried_value = 0.5 * tried.dot(&(stiff * tried)) - load.dot(&tried);
            if tried_m[0][0] > 0.0
                && tried_m[1][0] > 0.0
                && (tried_value <= value + 1e-4 * t * slope
                    || tried_error.norm() < 0.5 * error.norm())
            {
                moved = tried_error.norm() < error.norm() || error.amax() > 1e-10 * scale;
                if moved {
                    (q, m, error, value) = (tried, tried_m, tried_error, tried_value);
                }
                break;
            }
            t *= 0.5;
        }
        if !moved {
            break;
        }
    }
    // On a contact of relative width `e` the iteration ends at `1e-16/e`.
    let rounding = (0..2)
        .map(|k| (q[k].abs() + q[2].hypot(q[3]) * pads.areas[k].radius()) * m[k][0])
        .sum::<f64>();
    (error.amax() <= (1e-9 * scale).max(8.0 * f64::EPSILON * rounding)).then(|| q.into())
}

/// [`solve`] for a contact moment close to the rim, where Newton's method from afar gets lost: from
/// the middle of the region towards it in steps that leave a quarter of the way each, every one
/// from the pressure before.
pub(crate) fn solve_near_rim(
    pads: &Pads,
    normal: [f64; 2],
    target: DVec2,
    scratch: &mut Loops,
) -> Option<[f64; 4]> {
    let left = reach(pads, normal, target);
    if left <= 0.0 {
        return None;
    }
    let rim = region(pads, normal);
    let middle = rim.iter().sum::<DVec2>() / rim.len() as f64;
    let mut q = None;
    let mut away = 0.25;
    while away * middle.distance(target) > 0.5 * left {
        q = Some(solve(pads, normal, target.lerp(middle, away), q, scratch)?);
        away *= 0.25;
    }
    solve(pads, normal, target, q, scratch)
}

/// The pressure that carries `load` on the whole areas, if it presses everywhere.
fn whole(pads: &Pads, load: &Vector4<f64>) -> Option<[f64; 4]> {
    let q: [f64; 4] = solve_stiffness(&pads.moments, load, 0.0)?.into();
    let error = stiffness(&pads.moments) * Vector4::from(q) - load;
    let pressed = (0..2).all(|k| !separates(&pads.areas[k], face_pressure(&q, k)));
    (pressed && error.amax() <= 1e-14 * load.amax()).then_some(q)
}

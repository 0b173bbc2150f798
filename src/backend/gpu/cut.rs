//! Integrals over what a pressure leaves of a face, in single precision: the twin of
//! `shaders/cut.wgsl`, same functions in the same order.
//!
//! Nothing is listed: each edge adds its pressed part, and where it crosses the zero-pressure line what
//! closes the boundary from there to the first crossing. On one line these parts add up whichever
//! crossings they join.

use super::super::fan::edge_log;
use super::super::lanes::smaller;
use super::super::layout::{ContactHeader, EdgeRecord, FAR_LIMIT, GAUSS, ON_LINE, ROUNDING};

/// What the edges of what is left of a face add up to, seen from the slip centre (or, where that is far,
/// from the origin): integrals of `e` (the direction of a point), `|y|` or its like, `y e`, `y |y|`, and
/// of the pressure times `e e / |y|`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    e: [f32; 2],
    r: f32,
    /// 11, 12, 21, 22.
    ye: [f32; 4],
    yr: [f32; 2],
    /// 11, 12, 22; from afar of the Hessian in the twist, and then its 13, 23, 33.
    h: [f32; 6],
    length: f32,
}

/// Where they are seen from, and the pressure there with its slopes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Centre {
    c: [f32; 2],
    p: [f32; 3],
    near: bool,
    /// From afar: the turned velocity at the origin, and the size of the turn.
    y: [f32; 2],
    omega: f32,
}

/// The pressed part of an edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    a: [f32; 2],
    b: [f32; 2],
    /// Where it crosses the zero-pressure line, if it does.
    x: [f32; 2],
    crosses: bool,
    /// Whether its end is not pressed.
    leaves: bool,
}

/// Integrals over what is left of a face.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Part {
    pub(super) moments: [f32; 6],
    /// Of the weights `1, x1, x2`.
    pub(super) g: [[f32; 3]; 3],
    /// 11, 12, 13, 22, 23, 33.
    pub(super) hessian: [f32; 6],
    /// Rounding of a force and of a moment of the friction.
    pub(super) error: [f32; 2],
    pub(super) length: f32,
    pub(super) lowest: f32,
}

/// What an edge adds to an area's moments: of `1, x1, x2, x1^2, x1 x2, x2^2`.
pub(crate) fn add_moments(m: &mut [f32; 6], a: [f32; 2], b: [f32; 2]) {
    let cross = a[0] * b[1] - a[1] * b[0];
    m[0] += cross / 2.0;
    m[1] += cross * (a[0] + b[0]) / 6.0;
    m[2] += cross * (a[1] + b[1]) / 6.0;
    m[3] += cross * (a[0] * a[0] + a[0] * b[0] + b[0] * b[0]) / 12.0;
    m[4] += cross * (2.0 * (a[0] * a[1] + b[0] * b[1]) + (a[0] * b[1] + b[0] * a[1])) / 24.0;
    m[5] += cross * (a[1] * a[1] + a[1] * b[1] + b[1] * b[1]) / 12.0;
}

/// By the closed forms over the fan from the slip centre.
pub(crate) fn add_near(s: &mut Sums, a: [f32; 2], b: [f32; 2], t: [f32; 2], l: f32, p: [f32; 3]) {
    let n = [t[1], -t[0]];
    let h = a[0] * t[1] - a[1] * t[0];
    if h.abs() <= ON_LINE {
        return;
    }
    let s1 = t[0] * a[0] + t[1] * a[1];
    let s2 = t[0] * b[0] + t[1] * b[1];
    let r1 = (h * h + s1 * s1).sqrt();
    let r2 = (h * h + s2 * s2).sqrt();
    let log = edge_log(h, l, s1, s2, r1, r2);
    let dr = (s2 - s1) * (s2 + s1) / (r1 + r2);
    let inv = -dr / (r1 * r2);
    let ds = s2 / r2 - s1 / r1;
    let sr = s2 * r2 - s1 * r1;
    let x = h * h * log;
    let y = h * dr;
    let z = h * inv;
    let j2 = 0.5 * (sr - x);
    let r0 = 0.5 * (sr + x);
    let m1 = dr * (r1 * r1 + r1 * r2 + r2 * r2) / 3.0;
    let k2 = log - ds;
    let k3 = dr + h * z;
    s.e[0] += 0.5 * h * (h * n[0] * log + t[0] * dr);
    s.e[1] += 0.5 * h * (h * n[1] * log + t[1] * dr);
    s.r += h / 3.0 * r0;
    let ye11 = h / 3.0 * (x * n[0] * n[0] + 2.0 * y * n[0] * t[0] + t[0] * t[0] * j2);
    let ye12 = h / 3.0 * (x * n[0] * n[1] + y * (n[0] * t[1] + n[1] * t[0]) + t[0] * t[1] * j2);
    let ye22 = h / 3.0 * (x * n[1] * n[1] + 2.0 * y * n[1] * t[1] + t[1] * t[1] * j2);
    s.ye = [s.ye[0] + ye11, s.ye[1] + ye12, s.ye[2] + ye12, s.ye[3] + ye22];
    s.yr[0] += h / 4.0 * (h * n[0] * r0 + t[0] * m1);
    s.yr[1] += h / 4.0 * (h * n[1] * r0 + t[1] * m1);
    // The pressure along the normal and along the edge.
    let pn = p[1] * n[0] + p[2] * n[1];
    let pt = p[1] * t[0] + p[2] * t[1];
    let nn = h * (p[0] * ds + 0.5 * h * (pn * ds - pt * z));
    let nt = h * (0.5 * h * (pt * k2 - pn * z) - p[0] * z);
    let tt = h * p[0] * k2 + 0.5 * h * (h * pn * k2 + pt * k3);
    s.h[0] += nn * n[0] * n[0] + 2.0 * nt * n[0] * t[0] + tt * t[0] * t[0];
    s.h[1] += nn * n[0] * n[1] + nt * (n[0] * t[1] + n[1] * t[0]) + tt * t[0] * t[1];
    s.h[2] += nn * n[1] * n[1] + 2.0 * nt * n[1] * t[1] + tt * t[1] * t[1];
}

/// By a point on the edge with its weight, in twist form, which knows translations too.
pub(crate) fn add_far(s: &mut Sums, at: &Centre, z: [f32; 2], t: [f32; 2], weight: f32) {
    let d = at.y;
    let y = [d[0] + at.omega * z[0], d[1] + at.omega * z[1]];
    let r = (y[0] * y[0] + y[1] * y[1]).sqrt();
    let r0 = (d[0] * d[0] + d[1] * d[1]).sqrt();
    let e = [y[0] / r, y[1] / r];
    // Beyond the arc through the origin, and where the ray crosses that.
    let over =
        (2.0 * (d[0] * z[0] + d[1] * z[1]) + at.omega * (z[0] * z[0] + z[1] * z[1])) / (r + r0);
    let q = [z[0] - over * e[0], z[1] - over * e[1]];
    let turn = (y[0] * t[1] - y[1] * t[0]) * weight / (r * r);
    let a0 = turn * over * (r0 + 0.5 * at.omega * over);
    let a1 = turn * over * over * (0.5 * r0 + at.omega * over / 3.0);
    let a2 = turn * over * over * over * (r0 / 3.0 + 0.25 * at.omega * over);
    let qe = q[0] * e[0] + q[1] * e[1];
    s.e = [s.e[0] + e[0] * a0, s.e[1] + e[1] * a0];
    s.r += qe * a0 + a1;
    let w = [q[0] * a0 + e[0] * a1, q[1] * a0 + e[1] * a1];
    s.ye = [
        s.ye[0] + w[0] * e[0],
        s.ye[1] + w[0] * e[1],
        s.ye[2] + w[1] * e[0],
        s.ye[3] + w[1] * e[1],
    ];
    s.yr[0] += qe * w[0] + (q[0] * a1 + e[0] * a2);
    s.yr[1] += qe * w[1] + (q[1] * a1 + e[1] * a2);
    let along = at.p[1] * e[0] + at.p[2] * e[1];
    let pressed = turn * over * (at.p[0] + (at.p[1] * q[0] + at.p[2] * q[1]) + 0.5 * over * along);
    let m3 = q[0] * e[1] - q[1] * e[0];
    s.h[0] += pressed * e[0] * e[0];
    s.h[1] += pressed * e[0] * e[1];
    s.h[2] += pressed * e[1] * e[1];
    s.h[3] += pressed * e[0] * m3;
    s.h[4] += pressed * e[1] * m3;
    s.h[5] += pressed * m3 * m3;
}

/// What an edge of what is left adds.
pub(crate) fn add_edge(s: &mut Sums, m: &mut [f32; 6], at: &Centre, a: [f32; 2], b: [f32; 2]) {
    let d = [b[0] - a[0], b[1] - a[1]];
    let l = (d[0] * d[0] + d[1] * d[1]).sqrt();
    if l <= ON_LINE {
        return;
    }
    let t = [d[0] / l, d[1] / l];
    add_moments(m, a, b);
    s.length += l;
    if at.near {
        let from = [a[0] - at.c[0], a[1] - at.c[1]];
        let to = [b[0] - at.c[0], b[1] - at.c[1]];
        add_near(s, from, to, t, l, at.p);
    } else {
        for point in GAUSS {
            let z = [a[0] + point[0] * d[0], a[1] + point[0] * d[1]];
            add_far(s, at, z, t, l * point[1]);
        }
    }
}

/// Edges of a face; congruent faces have the same.
pub(crate) fn face_edges<'a>(
    header: &ContactHeader,
    edges: &[&'a [EdgeRecord]; 2],
    face: usize,
) -> &'a [EdgeRecord] {
    if face == 1 && header.faces == 2 { edges[1] } else { edges[0] }
}

/// The pressed part of an edge from `a` to `b` with the pressures `pa` and `pb`, of which one is not
/// negative.
pub(crate) fn cut_edge(a: [f32; 2], b: [f32; 2], pa: f32, pb: f32) -> Cut {
    let crosses = (pa < 0.0) != (pb < 0.0);
    let leaves = pb < 0.0;
    let share = pa / (pa - pb);
    let x = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
    let mut cut = Cut { a, b, x, crosses, leaves };
    if crosses && leaves {
        cut.b = x;
    } else if crosses {
        cut.a = x;
    }
    cut
}

/// The integrals over what the pressure `p` leaves of a face, at a twist.
pub(crate) fn integrate(
    header: &ContactHeader,
    edges: &[&[EdgeRecord]; 2],
    face: usize,
    v: [f32; 3],
    p: [f32; 3],
) -> Part {
    let speed = v[0] * v[0] + v[1] * v[1];
    let near = speed <= FAR_LIMIT * FAR_LIMIT * header.radius * header.radius * v[2] * v[2];
    let sense = if v[2] < 0.0 { -1.0 } else { 1.0 };
    let mut at = Centre { c: [0.0; 2], p, near, y: [0.0; 2], omega: v[2].abs() };
    if near {
        at.c = [-v[1] / v[2], v[0] / v[2]];
        at.p[0] = p[0] + p[1] * at.c[0] + p[2] * at.c[1];
    } else {
        at.y = [sense * v[1], -sense * v[0]];
    }
    let mut s = Sums::default();
    let mut part = Part { lowest: f32::MAX, ..Part::default() };
    let mut crossed = false;
    let mut first = [0.0; 2];
    for edge in face_edges(header, edges, face) {
        let (a, b) = ([edge[0], edge[1]], [edge[2], edge[3]]);
        let pa = p[0] + p[1] * a[0] + p[2] * a[1];
        let pb = p[0] + p[1] * b[0] + p[2] * b[1];
        part.lowest = smaller(pb, part.lowest);
        if pa < 0.0 && pb < 0.0 {
            continue;
        }
        let Cut { a, b, x, crosses, leaves } = cut_edge(a, b, pa, pb);
        add_edge(&mut s, &mut part.moments, &at, a, b);
        if crosses && crossed {
            let (from, to) = if leaves { (x, first) } else { (first, x) };
            add_edge(&mut s, &mut part.moments, &at, from, to);
        }
        if crosses && !crossed {
            crossed = true;
            first = x;
        }
    }
    let c = at.c;
    let torque = c[0] * s.e[0] + c[1] * s.e[1] + s.r;
    let own = [-s.e[1], s.e[0], torque];
    let by_x1 = [-s.ye[1], s.ye[0], c[0] * s.ye[0] + c[1] * s.ye[1] + s.yr[0]];
    let by_x2 = [-s.ye[3], s.ye[2], c[0] * s.ye[2] + c[1] * s.ye[3] + s.yr[1]];
    for m in 0..3 {
        part.g[0][m] = sense * own[m];
        part.g[1][m] = sense * (c[0] * own[m] + by_x1[m]);
        part.g[2][m] = sense * (c[1] * own[m] + by_x2[m]);
    }
    if near {
        let h11 = s.h[0] / at.omega;
        let h12 = s.h[1] / at.omega;
        let h22 = s.h[2] / at.omega;
        let h13 = -c[1] * h11 + c[0] * h12;
        let h23 = -c[1] * h12 + c[0] * h22;
        part.hessian = [h11, h12, h13, h22, h23, -c[1] * h13 + c[0] * h23];
    } else {
        part.hessian = [s.h[0], s.h[1], s.h[3], s.h[2], s.h[4], s.h[5]];
    }
    // Every term is no more than the edge's length times powers of the distance.
    let away = (c[0] * c[0] + c[1] * c[1]).sqrt();
    let reach = away + header.radius;
    let slope = (p[1] * p[1] + p[2] * p[2]).sqrt();
    let force = (at.p[0].abs() + slope * reach) * s.length * reach;
    part.error = [ROUNDING * force, ROUNDING * force * (away + reach)];
    part.length = s.length;
    part
}

/// Moments of what the pressure `p` leaves of a face.
pub(crate) fn pressed_moments(
    header: &ContactHeader,
    edges: &[&[EdgeRecord]; 2],
    face: usize,
    p: [f32; 3],
) -> [f32; 6] {
    let mut moments = [0.0; 6];
    let mut crossed = false;
    let mut first = [0.0; 2];
    for edge in face_edges(header, edges, face) {
        let (a, b) = ([edge[0], edge[1]], [edge[2], edge[3]]);
        let pa = p[0] + p[1] * a[0] + p[2] * a[1];
        let pb = p[0] + p[1] * b[0] + p[2] * b[1];
        if pa < 0.0 && pb < 0.0 {
            continue;
        }
        let Cut { a, b, x, crosses, leaves } = cut_edge(a, b, pa, pb);
        add_moments(&mut moments, a, b);
        if crosses && crossed {
            let (from, to) = if leaves { (x, first) } else { (first, x) };
            add_moments(&mut moments, from, to);
        }
        if crosses && !crossed {
            crossed = true;
            first = x;
        }
    }
    moments
}

/// Pressure of a face from `q = (at_i, at_ii, slope)`.
pub(crate) fn face_pressure(q: [f32; 4], face: usize) -> [f32; 3] {
    if face == 0 { [q[0], q[2], q[3]] } else { [q[1], -q[2], -q[3]] }
}

//! Friction on a contact that is thin beside the slope of its pressure: a pad about to lift off
//! along an edge.
//!
//! Over the fan each edge's triangle reaches to the slip centre, where the pressure plane is far
//! larger than on the contact, and what is left after the triangles cancel loses `1e-16
//! (reach/width)^2`. Here the integrals are taken over the strips between the edges and the
//! zero-pressure line, along it (`u`) and up from it (`y`), where the pressure is its slope times
//! `y`: over the area `int f = -oint (int_0^h f dy) du`. Seen from the slip centre a strip is thin,
//! so that four Gauss points across it are enough, and along it as many as its length in distances
//! asks for. Only beside the slip centre the fan is used. The loss left is `1e-16 reach/width`,
//! which the pressure's own coefficients have too.

use glam::DVec2;

use super::far::{RULES, points};
use super::field::Friction;
use super::lanes::{LANES, totals, widest};
use super::loops::Loops;
use super::{fan, far};

/// Half the length, in widths, of the piece beside the slip centre that is left to the fan, whose
/// loss on it, 4e-14, is not seen; from there on four points across the strip leave less than
/// 1e-15.
const NEAR: f64 = 20.0;
/// Half the length of the piece beside a slip centre off the strip, in distances from it.
const ABREAST: f64 = 0.4;
/// Ratio of the distances of a piece's ends from the slip centre.
const GROWTH: f64 = 2.5;
/// Heights below this many roundings of the coordinates are those of the zero-pressure line itself.
const ROUNDINGS: f64 = 8.0;

/// The edge above a strip: its ends along the zero-pressure line and up from it.
#[derive(Clone, Copy)]
struct Edge {
    u: [f64; 2],
    h: [f64; 2],
}

/// The zero-pressure line: where `u` begins on it, its direction and that of rising pressure; and
/// the slip on it.
#[derive(Clone, Copy)]
struct Line {
    origin: DVec2,
    along: DVec2,
    up: DVec2,
    /// Velocity at the origin.
    velocity: DVec2,
    omega: f64,
    /// Rise of the pressure with the height.
    steep: f64,
}

/// See [`super::friction`]; the pressure has a slope, and `far` says whether the slip centre is out
/// of reach.
pub(super) fn friction(area: &Loops, twist: [f64; 3], p: [f64; 3], far: bool) -> Friction {
    let [u1, u2, omega] = twist;
    let slope = DVec2::new(p[1], p[2]);
    let steep = slope.length();
    let up = slope / steep;
    let along = -up.perp();
    let height = |x: DVec2| (p[0] + slope.dot(x)) / steep;
    let width = area.points().iter().map(|&x| height(x)).fold(0.0, f64::max);
    if !(width > 0.0 && width.is_finite()) {
        return Friction::ZERO;
    }
    let from = if far { area.middle() } else { DVec2::new(-u2 / omega, u1 / omega) };
    let off = height(from);
    let origin = from - off * up;
    let velocity = if far {
        DVec2::new(u1 - omega * origin.y, u2 + omega * origin.x)
    } else {
        -omega * off * up.perp()
    };
    let line = Line { origin, along, up, velocity, omega, steep };
    let noise =
        ROUNDINGS * f64::EPSILON * (p[0].abs() / steep + area.radius() + area.middle().length());
    let mut edges = Vec::with_capacity(area.len());
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (a, b) in area.edges() {
        let edge =
            Edge { u: [along.dot(a - origin), along.dot(b - origin)], h: [height(a), height(b)] };
        if edge.h[0].abs().max(edge.h[1].abs()) > noise {
            (low, high) = (low.min(edge.u[0]).min(edge.u[1]), high.max(edge.u[0]).max(edge.u[1]));
            edges.push(edge);
        }
    }
    let mut lanes = [[0.0; LANES]; 15];
    if far {
        let distance = DVec2::new(u1 - omega * from.y, u2 + omega * from.x).length() / omega.abs();
        strips(&edges, line, [low, high], &RULES[points(distance / area.radius())], &mut lanes);
        return assemble(&lanes);
    }
    let mut sum = Friction::ZERO;
    let beside = (off - width).max(-off).max(0.0);
    let abreast = ABREAST * beside > NEAR * width;
    let start = if abreast { ABREAST * beside } else { NEAR * width };
    if low < start && high > -start {
        if abreast {
            let (from, to) = (low.max(-start), high.min(start));
            strips(
                &edges,
                line,
                [from, to],
                &RULES[points((1.0 + ABREAST * ABREAST).sqrt() / ABREAST)],
                &mut lanes,
            );
        } else {
            let (mut kept, mut piece) = (Loops::default(), Loops::default());
            let origin = along.dot(origin);
            area.clip_into([start - origin, along.x, along.y], &mut kept);
            kept.clip_into([start + origin, -along.x, -along.y], &mut piece);
            sum = if far::is_far(&piece, twist) {
                far::friction(&piece, twist, p)
            } else {
                fan::friction(&piece, twist, p)
            };
        }
    }
    let rule = &RULES[points((GROWTH + 1.0) / (GROWTH - 1.0))];
    let (mut from, most) = (start, high.max(-low));
    while from < most {
        let to = from * GROWTH;
        for [from, to] in [[from.max(low), to.min(high)], [(-to).max(low), (-from).min(high)]] {
            if from < to {
                strips(&edges, line, [from, to], rule, &mut lanes);
            }
        }
        from = to;
    }
    let strips = assemble(&lanes);
    for i in 0..3 {
        for j in 0..3 {
            sum.g[i][j] += strips.g[i][j];
            sum.hessian[i][j] += strips.hessian[i][j];
        }
    }
    sum
}

widest! {
    /// Adds the integrals over the strips under the edges between two places along the line, a
    /// Gauss point across in each lane: `t`, `x_i t_j`, `x cross t` with the weights `1, x1, x2`,
    /// and the Hessian.
    fn strips(edges: &[Edge], line: Line, between: [f64; 2], rule: &[(f64, f64)], lanes: &mut [[f64; LANES]; 15]) -> () = strips_of
}

#[inline(always)]
fn strips_of(
    edges: &[Edge],
    line: Line,
    [from, to]: [f64; 2],
    rule: &[(f64, f64)],
    lanes: &mut [[f64; LANES]; 15],
) {
    let across: [(f64, f64); LANES] = std::array::from_fn(|i| RULES[LANES][i]);
    let Line { origin, along, up, velocity, omega, steep } = line;
    for edge in edges {
        let [a, b] = edge.u;
        let length = b - a;
        // The part of the edge between the two places.
        let inside = |u: f64| u.clamp(from, to);
        let (ua, ub) = (inside(a), inside(b));
        if ua == ub {
            continue;
        }
        let at = |u: f64| edge.h[0] + (edge.h[1] - edge.h[0]) * ((u - a) / length);
        let (ha, hb) =
            (if ua == a { edge.h[0] } else { at(ua) }, if ub == b { edge.h[1] } else { at(ub) });
        for &(s, share) in rule {
            let (u, h) = (ua + s * (ub - ua), ha + s * (hb - ha));
            let weight = -share * (ub - ua) * h;
            let (x, v) = (origin + u * along, velocity + (omega * u) * along.perp());
            for i in 0..LANES {
                let (node, part) = across[i];
                let y = node * h;
                let (x1, x2) = (x.x + y * up.x, x.y + y * up.y);
                let (v1, v2) = (v.x - omega * y * up.y, v.y + omega * y * up.x);
                let inverse = 1.0 / (v1 * v1 + v2 * v2).sqrt();
                let (t1, t2) = (v1 * inverse, v2 * inverse);
                let area = weight * part;
                let (a1, a2) = (area * t1, area * t2);
                let (turn, slide) = (x1 * a2 - x2 * a1, x1 * t1 + x2 * t2);
                lanes[0][i] += a1;
                lanes[1][i] += a2;
                lanes[2][i] += turn;
                lanes[3][i] += x1 * a1;
                lanes[4][i] += x1 * a2;
                lanes[5][i] += x1 * turn;
                lanes[6][i] += x2 * a1;
                lanes[7][i] += x2 * a2;
                lanes[8][i] += x2 * turn;
                // The normal of the velocity, lifted to the twist: (t2, -t1, -x.t).
                let pressed = area * (steep * y * inverse);
                let (n1, n2, n3) = (pressed * t2, -pressed * t1, -pressed * slide);
                lanes[9][i] += n1 * t2;
                lanes[10][i] -= n1 * t1;
                lanes[11][i] -= n2 * t1;
                lanes[12][i] -= n1 * slide;
                lanes[13][i] -= n2 * slide;
                lanes[14][i] -= n3 * slide;
            }
        }
    }
}

fn assemble(lanes: &[[f64; LANES]; 15]) -> Friction {
    let n = totals(lanes);
    let [h11, h12, h22, h13, h23, h33] = [n[9], n[10], n[11], n[12], n[13], n[14]];
    Friction {
        g: [[n[0], n[1], n[2]], [n[3], n[4], n[5]], [n[6], n[7], n[8]]],
        hessian: [[h11, h12, h13], [h12, h22, h23], [h13, h23, h33]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Polygon;

    /// A strip of unit length with the pressure of a unit force that falls to zero across it,
    /// turned and moved.
    fn strip(width: f64) -> (Loops, [f64; 3], impl Fn(f64, f64) -> DVec2) {
        let (turn, corner) = (DVec2::from_angle(0.7), DVec2::new(0.2, -0.1));
        let place = move |s: f64, h: f64| corner + turn.rotate(DVec2::new(s, h));
        let outer = vec![place(0.0, 0.0), place(1.0, 0.0), place(1.0, width), place(0.0, width)];
        let steep = 2.0 / (width * width);
        let slope = -steep * turn.perp();
        (
            Loops::new(&[Polygon { outer, holes: vec![] }]),
            [steep * width - slope.dot(corner), slope.x, slope.y],
            place,
        )
    }

    fn gradient(area: &Loops, c: DVec2, p: [f64; 3]) -> [f64; 3] {
        let field = crate::contact::Field { area, p };
        crate::contact::friction(field, crate::contact::Twist::about(c)).gradient(p)
    }

    #[test]
    fn a_wide_strip_is_the_same_by_the_fan() {
        for (s, h) in [(0.3, 0.0), (0.3, 0.01), (0.7, 0.2), (0.0, 0.004), (1.2, -0.1)] {
            let (area, p, place) = strip(0.008);
            let c = place(s, h);
            let twist = [c.y, -c.x, 1.0];
            let (cut, whole) = (friction(&area, twist, p, false), fan::friction(&area, twist, p));
            for (a, b) in cut.gradient(p).into_iter().zip(whole.gradient(p)) {
                assert!((a - b).abs() < 1e-11, "{s} {h}: {a} {b}");
            }
            for (a, b) in cut.hessian.as_flattened().iter().zip(whole.hessian.as_flattened()) {
                assert!((a - b).abs() < 1e-9, "{s} {h}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_strip_runs_into_the_line() {
        // Force along and across an even line load of unit length, slip centre at (s, h) beside it.
        for (s, h) in [(0.3, 0.25), (0.5, 1e-3), (0.2, -0.1)] {
            let root = |x: f64| (x - s).hypot(h);
            let (across, along) = (
                root(1.0) - root(0.0),
                h * (((1.0 - s) / h.abs()).asinh() - (-s / h.abs()).asinh()),
            );
            for width in [1e-5, 1e-6, 1e-7] {
                let (area, p, place) = strip(width);
                let [x, y, _] = gradient(&area, place(s, h), p);
                // Slip velocity is a quarter turn ahead of the direction from the centre: (h, x -
                // s) over the distance.
                let got = DVec2::from_angle(-0.7).rotate(DVec2::new(x, y));
                let error = (got - DVec2::new(along, across)).length();
                // The strip's centre of pressure lies a third of its width off the line.
                assert!(
                    error < 3.0 * width * (1.0 + (0.1 / h).abs()),
                    "({s}, {h}), width {width}: {got} {along} {across}"
                );
            }
        }
    }
}

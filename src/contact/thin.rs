//! Friction on a contact that is thin beside the slope of its pressure: a pad about to lift off along an edge.
//!
//! Over the fan each edge's triangle reaches to the slip centre, where the pressure plane is far larger than on the
//! contact, and what is left after the triangles cancel loses `1e-16 (reach/width)^2`. Here the contact is cut across
//! into pieces whose length grows with their distance from the slip centre: the near one sees it at some
//! of its widths, far ones are smooth. The loss left is `1e-16 reach/width`, which the pressure's own coefficients have too.

use glam::DVec2;

use super::{Friction, Loops};

/// Half the length, in widths, of the piece beside the slip centre: the fan's loss on it, 3e-13, is still unseen.
const NEAR: f64 = 50.0;
/// Ratio of the distances of a piece's ends from the slip centre: small enough that [`super::FAR`] holds for it.
const GROWTH: f64 = 1.75;

/// Gauss points each way on a piece that is far from the slip centre.
const POINTS: usize = 8;

/// See [`super::friction`]; the pressure has a slope, and `far` says whether the slip centre is out of reach.
pub(super) fn friction(area: &Loops, twist: [f64; 3], p: [f64; 3], far: bool) -> Friction {
    let [u1, u2, omega] = twist;
    if far {
        return super::far::pointwise(area, twist, p, POINTS);
    }
    let c = DVec2::new(-u2 / omega, u1 / omega);
    let slope = DVec2::new(p[1], p[2]);
    let steep = slope.length();
    let along = slope.perp() / steep;
    // Width of the contact and distance of the slip centre from it, across the zero-pressure line.
    let height = |x: DVec2| (p[0] + slope.dot(x)) / steep;
    let (mut width, mut low, mut high) = (0.0f64, f64::INFINITY, f64::NEG_INFINITY);
    for &point in area.points() {
        width = width.max(height(point));
        let s = along.dot(point - c);
        (low, high) = (low.min(s), high.max(s));
    }
    let beside = (height(c) - width).max(-height(c)).max(0.0);
    // Beside a far centre the first piece, too, is far from it.
    let start = (NEAR * width).max(0.3 * beside);
    if !(width > 0.0 && start.is_finite()) {
        return Friction::ZERO;
    }
    let mut sum = Friction::ZERO;
    let (mut kept, mut piece) = (Loops::default(), Loops::default());
    let mut add = |from: f64, to: f64| {
        // Where along . (x - c) lies between.
        let origin = along.dot(c);
        area.clip_into([-origin - from, along.x, along.y], &mut kept);
        kept.clip_into([origin + to, -along.x, -along.y], &mut piece);
        if piece.is_empty() {
            return;
        }
        let part = if super::is_far(&piece, twist) { super::far::pointwise(&piece, twist, p, POINTS) } else { super::fan::friction(&piece, twist, p) };
        for i in 0..3 {
            for j in 0..3 {
                sum.g[i][j] += part.g[i][j];
                sum.hessian[i][j] += part.hessian[i][j];
            }
        }
    };
    if low < start && high > -start {
        add(-start, start);
    }
    for sign in [1.0, -1.0] {
        let (near, far) = if sign > 0.0 { (low, high) } else { (-high, -low) };
        let mut from = start;
        while from < far {
            let to = from * GROWTH;
            if to > near {
                if sign > 0.0 { add(from, to) } else { add(-to, -from) }
            }
            from = to;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Polygon;

    /// A strip of unit length with the pressure of a unit force that falls to zero across it, turned and moved.
    fn strip(width: f64) -> (Loops, [f64; 3], impl Fn(f64, f64) -> DVec2) {
        let (turn, corner) = (DVec2::from_angle(0.7), DVec2::new(0.2, -0.1));
        let place = move |s: f64, h: f64| corner + turn.rotate(DVec2::new(s, h));
        let outer = vec![place(0.0, 0.0), place(1.0, 0.0), place(1.0, width), place(0.0, width)];
        let steep = 2.0 / (width * width);
        let slope = -steep * turn.perp();
        (Loops::new(&[Polygon { outer, holes: vec![] }]), [steep * width - slope.dot(corner), slope.x, slope.y], place)
    }

    fn gradient(area: &Loops, c: DVec2, p: [f64; 3]) -> [f64; 3] {
        crate::contact::friction(area, [c.y, -c.x, 1.0], p).gradient(p)
    }

    #[test]
    fn a_wide_strip_is_the_same_by_the_fan() {
        for (s, h) in [(0.3, 0.0), (0.3, 0.01), (0.7, 0.2), (0.0, 0.004), (1.2, -0.1)] {
            let (area, p, place) = strip(0.008);
            let c = place(s, h);
            let twist = [c.y, -c.x, 1.0];
            let (cut, whole) = (friction(&area, twist, p, false), super::super::fan::friction(&area, twist, p));
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
            let (across, along) = (root(1.0) - root(0.0), h * (((1.0 - s) / h.abs()).asinh() - (-s / h.abs()).asinh()));
            for width in [1e-5, 1e-6, 1e-7] {
                let (area, p, place) = strip(width);
                let [x, y, _] = gradient(&area, place(s, h), p);
                // Slip velocity is a quarter turn ahead of the direction from the centre: (h, x - s) over the distance.
                let got = DVec2::from_angle(-0.7).rotate(DVec2::new(x, y));
                let error = (got - DVec2::new(along, across)).length();
                // The strip's centre of pressure lies a third of its width off the line.
                assert!(error < 3.0 * width * (1.0 + (0.1 / h).abs()), "({s}, {h}), width {width}: {got} {along} {across}");
            }
        }
    }
}

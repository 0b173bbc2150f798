//! Moments of the pressure and of the area: sums over points of a region, by fours.

use glam::DVec2;

use super::area::CORNERS;
use super::{Element, POINTS, Quadratic, Region, enough};
use crate::contact::far::RULES;
use crate::contact::lanes::{LANES, Lane, total, totals, widest};

/// Points of a region by fours: places along both axes, and weights.
pub(super) enum Rows<'a> {
    /// Between the boundary and the line of [`Region::foot`].
    Strips(Strips<'a>),
    /// Of an area with straight sides under a linear quadratic: right for what is of the second degree
    /// besides it.
    Corners(Corners<'a>),
}

impl<'a> Rows<'a> {
    #[inline(always)]
    pub(super) fn new(region: &'a Region) -> Self {
        match region.elements.first() {
            Some(first) if region.u.l == DVec2::ZERO => Self::Corners(Corners {
                base: first.a,
                elements: region.elements.iter(),
                at: ([DVec2::ZERO; 2], [].iter()),
            }),
            _ => Self::Strips(Strips {
                region,
                elements: region.elements.iter(),
                at: None,
                across: &RULES[LANES],
            }),
        }
    }
}

impl Iterator for Rows<'_> {
    type Item = [Lane; 3];

    #[inline(always)]
    fn next(&mut self) -> Option<[Lane; 3]> {
        match self {
            Self::Strips(strips) => strips.next(),
            Self::Corners(corners) => corners.next(),
        }
    }
}

/// Triangles from a corner.
pub(super) struct Corners<'a> {
    base: DVec2,
    elements: std::slice::Iter<'a, Element>,
    /// Both sides of the triangle at hand, and nodes that are still to come.
    at: ([DVec2; 2], std::slice::Iter<'static, [Lane; 3]>),
}

/// Nodes across for a third degree, that of the pressure's second moments.
const CUBIC: usize = 2;

impl Corners<'_> {
    #[inline(always)]
    fn next(&mut self) -> Option<[Lane; 3]> {
        loop {
            let ([one, two], nodes) = &mut self.at;
            if let Some([first, second, weights]) = nodes.next() {
                let (base, twice) = (self.base, one.perp_dot(*two));
                return Some([
                    std::array::from_fn(|i| base.x + first[i] * one.x + second[i] * two.x),
                    std::array::from_fn(|i| base.y + first[i] * one.y + second[i] * two.y),
                    std::array::from_fn(|i| twice * weights[i]),
                ]);
            }
            let Element { a, b, .. } = self.elements.next()?;
            if *a != self.base && *b != self.base {
                self.at = ([*a - self.base, *b - self.base], CORNERS[CUBIC].iter());
            }
        }
    }
}

/// Strips between the boundary and a line.
pub(super) struct Strips<'a> {
    region: &'a Region,
    elements: std::slice::Iter<'a, Element>,
    /// The element at hand, and nodes along it that are still to come.
    at: Option<(&'a Element, std::slice::Iter<'static, (f64, f64)>)>,
    across: &'static [(f64, f64)],
}

impl Strips<'_> {
    #[inline(always)]
    fn next(&mut self) -> Option<[Lane; 3]> {
        loop {
            let Some((element, nodes)) = &mut self.at else {
                let element = self.elements.next()?;
                let along = element.arc.map_or(5, |arc| (enough(arc.bent) + 2).min(POINTS));
                self.at = Some((element, RULES[along].iter()));
                continue;
            };
            let Some(&(s, weight)) = nodes.next() else {
                self.at = None;
                continue;
            };
            let (x, dx) = self.region.at(element, s);
            let (foot, turn) = self.region.foot(x, dx);
            if turn != 0.0 {
                let (turn, way) = (turn * weight, x - foot);
                return Some([
                    std::array::from_fn(|i| foot.x + self.across[i].0 * way.x),
                    std::array::from_fn(|i| foot.y + self.across[i].0 * way.y),
                    std::array::from_fn(|i| turn * self.across[i].1),
                ]);
            }
        }
    }
}

widest! {
    /// See [`Region::area_and_load`].
    pub(super) fn sums(region: &Region) -> (f64, f64) = sums_in
}

#[inline(always)]
fn sums_in(region: &Region) -> (f64, f64) {
    let (mut area, mut load) = ([0.0; LANES], [0.0; LANES]);
    for [x, y, weights] in region.rows() {
        for i in 0..LANES {
            area[i] += weights[i];
            load[i] += weights[i] * region.u.value(DVec2::new(x[i], y[i]));
        }
    }
    (total(&area), total(&load))
}

widest! {
    /// See [`Region::moments`].
    pub(super) fn moments(region: &Region, gap: &Quadratic) -> [[f64; 4]; 4] = moments_in
}

#[inline(always)]
fn moments_in(region: &Region, gap: &Quadratic) -> [[f64; 4]; 4] {
    let mut lanes = [[[0.0; LANES]; 4]; 4];
    for [x, y, weights] in region.rows() {
        for i in 0..LANES {
            let (at, weight) = (DVec2::new(x[i], y[i]), weights[i]);
            let values = [1.0, at.x, at.y, at.perp_dot(gap.slope(at))];
            let factors = [weight * region.u.value(at), weight, weight * at.x, weight * at.y];
            for row in 0..4 {
                for column in 0..4 {
                    lanes[row][column][i] += factors[row] * values[column];
                }
            }
        }
    }
    [totals(&lanes[0]), totals(&lanes[1]), totals(&lanes[2]), totals(&lanes[3])]
}

widest! {
    /// `int f q dA` for `f` of `u`, `1` and `q` of `1`, `x1`, `x2`, `x1^2`, `x1 x2`, `x2^2`.
    pub(super) fn second_moments(region: &Region) -> [[f64; 6]; 2] = second_moments_in
}

#[inline(always)]
fn second_moments_in(region: &Region) -> [[f64; 6]; 2] {
    let mut lanes = [[[0.0; LANES]; 6]; 2];
    for [x, y, weights] in region.rows() {
        for i in 0..LANES {
            let (x, y, weight) = (x[i], y[i], weights[i]);
            let pressure = weight * region.u.value(DVec2::new(x, y));
            let values = [1.0, x, y, x * x, x * y, y * y];
            for column in 0..6 {
                lanes[0][column][i] += pressure * values[column];
                lanes[1][column][i] += weight * values[column];
            }
        }
    }
    [totals(&lanes[0]), totals(&lanes[1])]
}

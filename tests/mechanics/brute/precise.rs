//! Pressed areas with twice the digits of doubles. On contacts of a millionth of the area, and far
//! apart, everything is a small difference of large numbers.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Rings;

/// A number as the sum of two doubles, the second below half the last place of the first.
#[derive(Clone, Copy)]
struct Double(f64, f64);

impl Double {
    fn sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let t = s - a;
        Self(s, (a - (s - t)) + (b - t))
    }
}

impl From<f64> for Double {
    fn from(x: f64) -> Self {
        Self(x, 0.0)
    }
}

impl Neg for Double {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl Add for Double {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.0, other.0), Self::sum(self.1, other.1));
        let first = Self::sum(high.0, high.1 + low.0);
        Self::sum(first.0, first.1 + low.1)
    }
}

impl Sub for Double {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Double {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = self.0 * other.0;
        let rest = self.0.mul_add(other.0, -product);
        Self::sum(product, rest + (self.0 * other.1 + self.1 * other.0))
    }
}

impl Div for Double {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.0 / other.0;
        let rest = self - Self::from(first) * other;
        let second = rest.0 / other.0;
        let rest = rest - Self::from(second) * other;
        Self::sum(first, second) + Self::from(rest.0 / other.0)
    }
}

/// Area, force and first moments of the pressure `p0 + p1 x1 + p2 x2` over where it is positive.
pub(super) fn pressed(area: &Rings, p: [f64; 3]) -> [f64; 4] {
    let p = p.map(Double::from);
    let value = |x: [Double; 2]| p[0] + p[1] * x[0] + p[2] * x[1];
    let third = Double::from(1.0) / Double::from(3.0);
    let half = Double::from(0.5);
    let mut sums = [Double::from(0.0); 4];
    for ring in area {
        let mut kept: Vec<[Double; 2]> = Vec::new();
        for i in 0..ring.len() {
            let [a, b] = [ring[i], ring[(i + 1) % ring.len()]]
                .map(|x| [Double::from(x.x), Double::from(x.y)]);
            let (pa, pb) = (value(a), value(b));
            if pa.0 > 0.0 {
                kept.push(a);
            }
            if (pa.0 > 0.0) != (pb.0 > 0.0) {
                let t = pa / (pa - pb);
                kept.push([0, 1].map(|i| a[i] + t * (b[i] - a[i])));
            }
        }
        for i in 1..kept.len().max(2) - 1 {
            let [a, b, c] = [kept[0], kept[i], kept[i + 1]];
            let part =
                third * half * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
            // Exact for the products by the middles of the sides.
            for [u, v] in [[a, b], [b, c], [c, a]] {
                let x = [0, 1].map(|i| half * (u[i] + v[i]));
                let force = part * value(x);
                for (sum, term) in sums.iter_mut().zip([part, force, force * x[0], force * x[1]]) {
                    *sum = *sum + term;
                }
            }
        }
    }
    sums.map(|sum| sum.0)
}

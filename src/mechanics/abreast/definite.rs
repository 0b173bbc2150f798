//! Definite equations in three unknowns, without branches.

/// A definite matrix, taken apart: `L D L^T`.
pub(super) struct Definite {
    d: [f64; 3],
    l21: f64,
    l31: f64,
    l32: f64,
}

impl Definite {
    /// From its entries 11, 21, 31, 22, 32, 33.
    #[inline(always)]
    pub(super) fn new([a11, a21, a31, a22, a32, a33]: [f64; 6]) -> Self {
        let (l21, l31) = (a21 / a11, a31 / a11);
        let d2 = a22 - l21 * a21;
        let e32 = a32 - l31 * a21;
        let l32 = e32 / d2;
        Self { d: [a11, d2, a33 - l31 * a31 - l32 * e32], l21, l31, l32 }
    }

    #[inline(always)]
    pub(super) fn solve(&self, b: [f64; 3]) -> [f64; 3] {
        let y2 = b[1] - self.l21 * b[0];
        let y3 = b[2] - self.l31 * b[0] - self.l32 * y2;
        let x3 = y3 / self.d[2];
        let x2 = y2 / self.d[1] - self.l32 * x3;
        [b[0] / self.d[0] - self.l21 * x2 - self.l31 * x3, x2, x3]
    }
}

#[inline(always)]
pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

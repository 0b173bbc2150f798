//! Gauss quadrature in twist form for slip centres far from the area; pure translation is a regular point.

use super::{Friction, Loops};

/// Nodes and weights of the 8-point Gauss-Legendre rule on `[0, 1]`.
const GAUSS: [(f64, f64); 8] = [
    (0.019_855_071_751_231_884, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_180_99),
    (0.591_717_321_247_824_9, 0.181_341_891_689_180_99),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_64),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];

/// See [`super::friction`]: 8 x 8 points on each triangle (middle, A, B) of the fan about the area's middle. Error below
/// 1e-14 for slip centres beyond [`super::FAR`] circumradii.
pub(super) fn friction(area: &Loops, twist: [f64; 3], p: [f64; 3]) -> Friction {
    let [u1, u2, omega] = twist;
    let o = area.middle();
    let mut out = Friction::ZERO;
    let mut h = [0.0; 6];
    for (a, b) in area.edges() {
        let (a, b) = (a - o, b - o);
        let cross = a.perp_dot(b);
        if cross == 0.0 {
            continue;
        }
        for &(s, ws) in &GAUSS {
            for &(t, wt) in &GAUSS {
                let x = o + s * (a + t * (b - a));
                let weight = ws * wt * s * cross;
                let (v1, v2) = (u1 - omega * x.y, u2 + omega * x.x);
                let inverse = 1.0 / (v1 * v1 + v2 * v2).sqrt();
                let (t1, t2) = (v1 * inverse, v2 * inverse);
                let torque = x.x * t2 - x.y * t1;
                for (m, phi) in [weight, weight * x.x, weight * x.y].into_iter().enumerate() {
                    out.g[m][0] += phi * t1;
                    out.g[m][1] += phi * t2;
                    out.g[m][2] += phi * torque;
                }
                let factor = weight * (p[0] + p[1] * x.x + p[2] * x.y) * inverse;
                // n = (t2, -t1), lifted to the twist space
                let n3 = -(x.x * t1 + x.y * t2);
                h[0] += factor * t2 * t2;
                h[1] -= factor * t1 * t2;
                h[2] += factor * t2 * n3;
                h[3] += factor * t1 * t1;
                h[4] -= factor * t1 * n3;
                h[5] += factor * n3 * n3;
            }
        }
    }
    out.hessian = [[h[0], h[1], h[2]], [h[1], h[3], h[4]], [h[2], h[4], h[5]]];
    out
}

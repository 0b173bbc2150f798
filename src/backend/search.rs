//! The search for the best twist of each load, in f32: the twin of `shaders/search.wgsl`, same
//! functions in the same order. There one invocation takes one load; here [`LANES`] loads go side
//! by side through plain loops, which the compiler turns into vector instructions. No product is
//! fused with a sum, so the instruction set changes no bit.

use super::lanes::{LANES, Lanes, Loads, cross, dot, larger, pick_number, smaller};
use super::layout::{
    BASIS, BOUNDED, CONTACT_MARGIN, COUPLED, COUPLED_SHARE, COUPLING_MARGIN, ContactHeader,
    DEGENERATE, EdgeRecord, LEAST_VARIATION, LoadRecord, OUT_OF_RANGE, SeedRecord, TILT_LIMIT,
    UNBOUNDED,
};
use super::seeds::{NEGATED, RING};
use super::table::{CORNER, SLOTS, Table};

/// One contact as the search sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Field<'a> {
    pub(crate) header: &'a ContactHeader,
    /// This contact's edges: face I's, then face II's.
    pub(crate) edges: [&'a [EdgeRecord]; 2],
    pub(crate) table: &'a Table<'a>,
    pub(crate) rings: &'a [[u32; RING]],
}

/// Pressures at the origin and their common slope: `p_I = at_i + slope.x`, `p_II = at_ii -
/// slope.x`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Planes {
    pub(crate) at_i: Lanes,
    pub(crate) at_ii: Lanes,
    pub(crate) slope: [Lanes; 2],
    /// Whether both pads stay in full contact under it.
    pub(crate) full: [bool; LANES],
}

/// What the ring round the best twist says of one load.
#[derive(Debug, Clone, Copy, Default)]
struct Corner {
    /// In the sense that the load drives, unit length.
    twist: [f32; 3],
    upper: f32,
    /// Integrals over face I of `v/|v|`, `x1 v/|v|`, `x2 v/|v|` at that twist, two components each.
    g: [f32; 6],
}

/// Gradient at a twist on a face for the weight 1, `x1` or `x2`, and its product with the twist, in
/// the basis of `count` twists.
#[inline(always)]
pub(crate) fn gradient(
    basis: &[[f32; 4]],
    count: usize,
    face: usize,
    weight: usize,
    twist: usize,
) -> [f32; 4] {
    basis[(face * count + twist) * BASIS + weight]
}

impl Field<'_> {
    /// Largest share of the slope, at most 1, that lifts neither pad. A pad lifts where the
    /// pressure drops by its mean.
    #[inline(always)]
    fn free_share(&self, mean_i: &Lanes, mean_ii: &Lanes, slope: &[Lanes; 2]) -> Lanes {
        let mut drop = [[0.0; LANES]; 2];
        for (face, (centroid, sign)) in
            [(self.header.centroid_i, -1.0), (self.header.centroid_ii, 1.0)].into_iter().enumerate()
        {
            for edge in self.edges[face] {
                let (x, y) = (sign * (edge[0] - centroid[0]), sign * (edge[1] - centroid[1]));
                for lane in 0..LANES {
                    drop[face][lane] =
                        larger(drop[face][lane], slope[0][lane] * x + slope[1][lane] * y);
                }
            }
        }
        let mut share = [1.0; LANES];
        for lane in 0..LANES {
            let on_i =
                if drop[0][lane] > mean_i[lane] { mean_i[lane] / drop[0][lane] } else { 1.0 };
            let on_ii =
                if drop[1][lane] > mean_ii[lane] { mean_ii[lane] / drop[1][lane] } else { 1.0 };
            share[lane] = smaller(on_i, on_ii);
        }
        share
    }

    /// Pressure from force and moment balance without friction in the tilt equations, shortened to
    /// full contact.
    #[inline(always)]
    pub(crate) fn planes(&self, loads: &Loads) -> Planes {
        let header = self.header;
        let (mut at_i, mut at_ii) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            at_i[lane] = (1.0 + 0.5 * loads.f3[lane]) / header.area_i;
            at_ii[lane] = (1.0 - 0.5 * loads.f3[lane]) / header.area_ii;
        }
        let mut slope = [[0.0; LANES]; 2];
        if header.faces == 1 {
            return Planes { at_i, at_ii, slope, full: [true; LANES] };
        }
        let (ci, cii, k) = (header.centroid_i, header.centroid_ii, header.compliance);
        for lane in 0..LANES {
            let (n_i, n_ii) = (1.0 + 0.5 * loads.f3[lane], 1.0 - 0.5 * loads.f3[lane]);
            let right1 = -loads.m2[lane] - n_i * ci[0] + n_ii * cii[0];
            let right2 = loads.m1[lane] - n_i * ci[1] + n_ii * cii[1];
            slope[0][lane] = k[0] * right1 + k[1] * right2;
            slope[1][lane] = k[1] * right1 + k[2] * right2;
        }
        let share = self.free_share(&at_i, &at_ii, &slope);
        let mut full = [true; LANES];
        for lane in 0..LANES {
            full[lane] = share[lane] >= 1.0;
            let share = if full[lane] { share[lane] } else { TILT_LIMIT * share[lane] };
            slope[0][lane] *= share;
            slope[1][lane] *= share;
            at_i[lane] = at_i[lane] - slope[0][lane] * ci[0] - slope[1][lane] * ci[1];
            at_ii[lane] = at_ii[lane] + slope[0][lane] * cii[0] + slope[1][lane] * cii[1];
        }
        Planes { at_i, at_ii, slope, full }
    }
}

/// Of a ring's entry.
#[inline(always)]
pub(crate) fn sign_of(entry: u32) -> f32 {
    if entry & NEGATED != 0 { -1.0 } else { 1.0 }
}

impl Field<'_> {
    /// Gradients of the dissipation at the twists of a ring ([`Table::ring`]), by component.
    #[inline(always)]
    fn support<const PRESSURES: usize>(
        &self,
        pressures: [f32; PRESSURES],
        twist: usize,
    ) -> [[f32; SLOTS]; 3] {
        let mut g = [[0.0_f32; SLOTS]; 3];
        let supports = self.table.ring(twist).chunks_exact(3 * SLOTS);
        for (of_pressure, pressure) in supports.zip(pressures) {
            for m in 0..3 {
                for slot in 0..SLOTS {
                    g[m][slot] += pressure * of_pressure[m * SLOTS + slot];
                }
            }
        }
        g
    }

    /// Whether congruent faces stay in full contact, with a margin, when the body slips with
    /// friction `mu` and the integrals `g` of a [`Corner`].
    #[inline(always)]
    fn full_contact(&self, loads: &Loads, mu: &Lanes, g: &[Lanes; 6]) -> [bool; LANES] {
        let header = self.header;
        let k = header.compliance;
        let zero = [0.0; LANES];
        let (mut slope, mut without, mut drop_i, mut drop_ii) = ([zero; 2], [zero; 2], zero, zero);
        let mut held = [false; LANES];
        for lane in 0..LANES {
            // Tilt equations (6)(7) about the common centroid: slope = compliance * (moments +
            // coupling * slope).
            let reach = 0.5 * loads.distance[lane] * mu[lane];
            let x11 = 2.0 * reach * (k[0] * g[2][lane] + k[1] * g[3][lane]);
            let x12 = 2.0 * reach * (k[0] * g[4][lane] + k[1] * g[5][lane]);
            let x21 = 2.0 * reach * (k[1] * g[2][lane] + k[2] * g[3][lane]);
            let x22 = 2.0 * reach * (k[1] * g[4][lane] + k[2] * g[5][lane]);
            let (trace, det) = (x11 + x22, x11 * x22 - x12 * x21);
            // 1 - s trace + s^2 det stays above the margin for s in [0, 1].
            let whole = 1.0 - trace + det;
            let between = det > 0.0 && trace > 0.0 && trace < 2.0 * det;
            let lowest = if between { 1.0 - 0.25 * trace * trace / det } else { whole };
            held[lane] = lowest >= COUPLING_MARGIN && loads.distance[lane] < OUT_OF_RANGE;
            let right1 = -loads.m2[lane] + reach * loads.f3[lane] / header.area_i * g[0][lane];
            let right2 = loads.m1[lane] + reach * loads.f3[lane] / header.area_i * g[1][lane];
            let b1 = k[0] * right1 + k[1] * right2;
            let b2 = k[1] * right1 + k[2] * right2;
            slope[0][lane] = ((1.0 - x22) * b1 + x12 * b2) / whole;
            slope[1][lane] = (x21 * b1 + (1.0 - x11) * b2) / whole;
            without[0][lane] = -k[0] * loads.m2[lane] + k[1] * loads.m1[lane];
            without[1][lane] = -k[1] * loads.m2[lane] + k[2] * loads.m1[lane];
            drop_i[lane] = (1.0 + 0.5 * loads.f3[lane] - CONTACT_MARGIN) / header.area_i;
            drop_ii[lane] = (1.0 - 0.5 * loads.f3[lane] - CONTACT_MARGIN) / header.area_i;
        }
        for edge in self.edges[0] {
            for lane in 0..LANES {
                let with = slope[0][lane] * edge[0] + slope[1][lane] * edge[1];
                let from = without[0][lane] * edge[0] + without[1][lane] * edge[1];
                held[lane] &=
                    larger(with, from) <= drop_ii[lane] && -smaller(with, from) <= drop_i[lane];
            }
        }
        held
    }

    /// For different faces: the largest share by which the friction coupling can change the
    /// dissipation at any twist, or a negative number where that is not known to be small. `upper`
    /// bounds `mu_s` without coupling.
    ///
    /// Friction moves the slope by at most `softness |d|/2 mu V`, where `V`, the integral of the
    /// difference of the two pressures over both areas, bounds the difference of the two friction
    /// forces over `mu`. `V` is at most its value without coupling plus `spread` times the change
    /// of slope, and `mu` at most `upper` over 1 less the share. The three together are a quadratic
    /// equation for the share; its smaller root cannot be left on the way from no coupling to all
    /// of it.
    #[inline(always)]
    pub(crate) fn coupled_share(&self, loads: &Loads, planes: &Planes, upper: &Lanes) -> Lanes {
        let header = self.header;
        let zero = [0.0; LANES];
        // Largest relative change of pressure at a vertex per change of slope, as the squares of
        // distance and pressure; and whether every vertex is pressed.
        let (mut far, mut pressure, mut pressed) = (zero, [1.0; LANES], planes.full);
        for (face, (centroid, sign)) in
            [(header.centroid_i, 1.0), (header.centroid_ii, -1.0)].into_iter().enumerate()
        {
            let at = if face == 0 { &planes.at_i } else { &planes.at_ii };
            for edge in self.edges[face] {
                let (x, y) = (edge[0] - centroid[0], edge[1] - centroid[1]);
                let distance = x * x + y * y;
                for lane in 0..LANES {
                    let here = at[lane]
                        + sign
                            * (planes.slope[0][lane] * edge[0] + planes.slope[1][lane] * edge[1]);
                    pressed[lane] &= here > CONTACT_MARGIN * at[lane].abs();
                    let square = here * here;
                    let worse = distance * pressure[lane] > far[lane] * square;
                    far[lane] = pick_number(worse, distance, far[lane]);
                    pressure[lane] = pick_number(worse, square, pressure[lane]);
                }
            }
        }
        let ([q11, q22, q12, q33], [q13, q14, q23, q24]) =
            (header.variation_first, header.variation_second);
        let [q34, q44] = header.variation_slope;
        let half_area = 0.5 * (header.area_i + header.area_ii);
        let mut shares = [-1.0; LANES];
        for lane in 0..LANES {
            let mu = loads.scale[lane] * upper[lane];
            let distance = loads.distance[lane];
            let weak = mu * mu * distance * distance <= half_area && distance < OUT_OF_RANGE;
            let (z1, z2, z3, z4) = (
                planes.at_i[lane],
                planes.at_ii[lane],
                planes.slope[0][lane],
                planes.slope[1][lane],
            );
            let square = q11 * z1 * z1 + q22 * z2 * z2 + q33 * z3 * z3 + q44 * z4 * z4;
            let mixed =
                z1 * (q12 * z2 + q13 * z3 + q14 * z4) + z2 * (q23 * z3 + q24 * z4) + q34 * z3 * z4;
            let variation = larger(square + 2.0 * mixed, 0.0).sqrt() + LEAST_VARIATION;
            let reach = 0.5 * header.softness * distance.abs() * mu;
            let c = 1.0 - reach * header.spread;
            let b = reach * variation * (far[lane] / pressure[lane]).sqrt();
            let room = c * c - 4.0 * b;
            let share = 2.0 * b / (c + larger(room, 0.0).sqrt());
            let known = weak && pressed[lane] && c > 0.0 && room > 0.0 && share <= COUPLED_SHARE;
            shares[lane] = if known { share } else { -1.0 };
        }
        shares
    }

    /// Bound and interpolated twist of one load from the triangles round its best twist.
    ///
    /// In each triangle `w = a ga + b gb + c gc` by Cramer's rule; two of its numerators are
    /// products with `ga x w`.
    #[inline(always)]
    fn corner<const PRESSURES: usize>(
        &self,
        wrench: [f32; 3],
        pressures: [f32; PRESSURES],
        best: usize,
    ) -> Corner {
        let own = self.table.corner(best);
        let sense = if dot(wrench, [own[0], own[1], own[2]]) < 0.0 { -1.0 } else { 1.0 };
        let w = wrench.map(|x| sense * x);
        let g = self.support(pressures, best);
        let ga = [g[0][SLOTS - 1], g[1][SLOTS - 1], g[2][SLOTS - 1]];
        let u = cross(ga, w);
        let mut next = [[0.0_f32; SLOTS]; 3];
        for m in 0..3 {
            next[m][..SLOTS - 1].copy_from_slice(&g[m][1..]);
        }
        let zero = [0.0_f32; SLOTS];
        let (mut a, mut b, mut c, mut total) = (zero, zero, zero, zero);
        for slot in 0..SLOTS {
            let gb = [g[0][slot], g[1][slot], g[2][slot]];
            let gc = [next[0][slot], next[1][slot], next[2][slot]];
            let normal = cross(gb, gc);
            let det = dot(ga, normal);
            let sign = if det < 0.0 { -1.0 } else { 1.0 };
            a[slot] = sign * dot(w, normal);
            b[slot] = sign * dot(u, gc);
            c[slot] = -sign * dot(u, gb);
            let bound = (a[slot].abs() + b[slot].abs() + c[slot].abs()) / det.abs();
            total[slot] = if det.abs() > DEGENERATE { bound } else { f32::MAX };
        }
        let mut chosen = 0;
        for slot in 1..RING {
            if total[slot] < total[chosen] {
                chosen = slot;
            }
        }
        let upper = total[chosen];
        let mut mix = [0.0_f32; CORNER];
        let sum = a[chosen].abs() + b[chosen].abs() + c[chosen].abs();
        if upper < f32::MAX && sum > 0.0 {
            let ring = &self.rings[best];
            let corners = [
                (best as u32, a[chosen]),
                (ring[chosen], b[chosen]),
                (ring[(chosen + 1) % RING], c[chosen]),
            ];
            for (entry, share) in corners {
                let share = sense * sign_of(entry) * share / sum;
                let corner = self.table.corner((entry & !NEGATED) as usize);
                for m in 0..CORNER {
                    mix[m] += share * corner[m];
                }
            }
        }
        let length = dot([mix[0], mix[1], mix[2]], [mix[0], mix[1], mix[2]]).sqrt();
        // Shares of opposite signs can cancel; the best twist itself always is a seed.
        let twist = if length > 0.5 {
            [mix[0] / length, mix[1] / length, mix[2] / length]
        } else {
            [sense * own[0], sense * own[1], sense * own[2]]
        };
        Corner { twist, upper, g: [mix[3], mix[4], mix[5], mix[6], mix[7], mix[8]] }
    }

    /// Records of the loads whose best twists are `best` with the values `value`.
    #[inline(always)]
    pub(crate) fn finish(
        &self,
        loads: &Loads,
        planes: &Planes,
        best: &[u32; LANES],
        value: &Lanes,
        out: &mut [SeedRecord],
    ) {
        let congruent = self.header.faces == 1;
        let mut corners = [Corner::default(); LANES];
        for lane in 0..out.len().min(LANES) {
            let w = [loads.wrench[0][lane], loads.wrench[1][lane], loads.wrench[2][lane]];
            let best = best[lane] as usize;
            corners[lane] = if congruent {
                self.corner(w, [planes.at_i[lane] + planes.at_ii[lane]], best)
            } else {
                self.corner(
                    w,
                    [
                        planes.at_i[lane],
                        planes.at_ii[lane],
                        planes.slope[0][lane],
                        planes.slope[1][lane],
                    ],
                    best,
                )
            };
        }
        let (mut upper, mut lower, mut status) = ([0.0; LANES], *value, [UNBOUNDED; LANES]);
        for lane in 0..LANES {
            upper[lane] = corners[lane].upper;
        }
        if self.header.resolved == 0 {
            // A sliver: seeds only.
        } else if congruent {
            let (mut mu, mut g) = ([0.0; LANES], [[0.0; LANES]; 6]);
            for lane in 0..LANES {
                mu[lane] = loads.scale[lane] * upper[lane];
                for m in 0..6 {
                    g[m][lane] = corners[lane].g[m];
                }
            }
            let held = self.full_contact(loads, &mu, &g);
            for lane in 0..LANES {
                status[lane] =
                    if held[lane] && upper[lane] < f32::MAX { BOUNDED } else { UNBOUNDED };
            }
        } else {
            let shares = self.coupled_share(loads, planes, &upper);
            for lane in 0..LANES {
                let known = shares[lane] >= 0.0 && upper[lane] < f32::MAX;
                status[lane] = if known { COUPLED } else { UNBOUNDED };
                lower[lane] = if known { lower[lane] / (1.0 + shares[lane]) } else { lower[lane] };
                upper[lane] = if known { upper[lane] / (1.0 - shares[lane]) } else { upper[lane] };
            }
        }
        for (lane, record) in out.iter_mut().enumerate().take(LANES) {
            *record = SeedRecord {
                twist: corners[lane].twist,
                lower: lower[lane],
                upper: upper[lane],
                status: status[lane],
                best: best[lane],
                padding: 0,
            };
        }
    }

    /// Records of up to [`LANES`] loads.
    #[inline(always)]
    pub(crate) fn search(&self, loads: &[LoadRecord], out: &mut [SeedRecord]) {
        let loads = Loads::new(loads);
        let planes = self.planes(&loads);
        let (best, value) = self.strongest(&loads, &planes);
        self.finish(&loads, &planes, &best, &value, out);
    }
}

//! The search for the best twist of one load, in f32: the twin of `shaders/search.wgsl`, same functions in the same
//! order.

use super::layout::{
    BASIS, BOUNDED, CONTACT_MARGIN, COUPLED, COUPLED_SHARE, COUPLING_MARGIN, ContactHeader, DEGENERATE, EdgeRecord, LEAST_VARIATION, LoadRecord, OUT_OF_RANGE,
    SeedRecord, TILT_LIMIT, UNBOUNDED,
};
use super::seeds::{NEGATED, RING};

/// One contact as the search sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Field<'a> {
    pub(crate) header: &'a ContactHeader,
    /// All edges of the chunk.
    pub(crate) edges: &'a [EdgeRecord],
    /// This contact's part of the basis array: `[face][component][twist]`.
    pub(crate) basis: &'a [f32],
    pub(crate) twists: &'a [[f32; 4]],
    pub(crate) rings: &'a [[u32; RING]],
}

/// Pressures at the origin and their common slope: `p_I = at_i + slope.x`, `p_II = at_ii - slope.x`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Planes {
    pub(crate) at_i: f32,
    pub(crate) at_ii: f32,
    pub(crate) slope: [f32; 2],
    /// Whether both pads stay in full contact under it.
    pub(crate) full: bool,
}

impl Field<'_> {
    fn component(&self, face: usize, component: usize, twist: usize) -> f32 {
        self.basis[(face * BASIS + component) * self.twists.len() + twist]
    }

    /// Largest share of `slope`, at most 1, that lifts neither pad.
    pub(crate) fn free_share(&self, mean_i: f32, mean_ii: f32, slope: [f32; 2]) -> f32 {
        let mut share = 1.0_f32;
        for (index, edge) in self.edges[self.header.edges_i as usize..self.header.edges_end as usize].iter().enumerate() {
            let on_i = index < (self.header.edges_ii - self.header.edges_i) as usize;
            let (centroid, mean, sign) = if on_i { (self.header.centroid_i, mean_i, 1.0) } else { (self.header.centroid_ii, mean_ii, -1.0) };
            let drop = -sign * (slope[0] * (edge[0] - centroid[0]) + slope[1] * (edge[1] - centroid[1]));
            if drop * share > mean {
                share = mean / drop;
            }
        }
        share
    }

    /// Pressure from force and moment balance without friction in the tilt equations, shortened to full contact.
    pub(crate) fn planes(&self, load: &LoadRecord) -> Planes {
        let header = self.header;
        let (n_i, n_ii) = (1.0 + 0.5 * load.f3, 1.0 - 0.5 * load.f3);
        let (mean_i, mean_ii) = (n_i / header.area_i, n_ii / header.area_ii);
        if header.faces == 1 {
            return Planes { at_i: mean_i, at_ii: mean_ii, slope: [0.0, 0.0], full: true };
        }
        let [ci, cii, k] = [[header.centroid_i[0], header.centroid_i[1], 0.0], [header.centroid_ii[0], header.centroid_ii[1], 0.0], header.compliance];
        let right1 = -load.m2 - n_i * ci[0] + n_ii * cii[0];
        let right2 = load.m1 - n_i * ci[1] + n_ii * cii[1];
        let full = [k[0] * right1 + k[1] * right2, k[1] * right1 + k[2] * right2];
        let share = self.free_share(mean_i, mean_ii, full);
        let full_contact = share >= 1.0;
        let share = if full_contact { share } else { TILT_LIMIT * share };
        let slope = [share * full[0], share * full[1]];
        Planes { at_i: mean_i - slope[0] * ci[0] - slope[1] * ci[1], at_ii: mean_ii + slope[0] * cii[0] + slope[1] * cii[1], slope, full: full_contact }
    }

    /// Gradient of the dissipation at twist `entry` (a ring entry) under `planes`.
    pub(crate) fn support(&self, planes: Planes, entry: u32) -> [f32; 3] {
        let twist = (entry & !NEGATED) as usize;
        let sign = if entry & NEGATED != 0 { -1.0 } else { 1.0 };
        let g = |face: usize, component: usize| self.component(face, component, twist);
        let other = self.header.faces as usize - 1;
        [0, 1, 2].map(|m| {
            if other == 0 {
                sign * (planes.at_i + planes.at_ii) * g(0, m)
            } else {
                sign * (planes.at_i * g(0, m)
                    + planes.at_ii * g(1, m)
                    + planes.slope[0] * (g(0, 3 + m) - g(1, 3 + m))
                    + planes.slope[1] * (g(0, 6 + m) - g(1, 6 + m)))
            }
        })
    }

    /// Whether congruent faces stay in full contact, with a margin, when the body slips with friction `mu` and the
    /// weighted integrals `x1 v/|v|` = `g1`, `x2 v/|v|` = `g2`, `v/|v|` = `g0` (two components each).
    pub(crate) fn full_contact(&self, load: &LoadRecord, mu: f32, g0: [f32; 2], g1: [f32; 2], g2: [f32; 2]) -> bool {
        let header = self.header;
        if load.distance >= OUT_OF_RANGE || header.resolved == 0 {
            return false;
        }
        // Tilt equations (6)(7) about the common centroid: slope = compliance * (moments + coupling * slope).
        let reach = 0.5 * load.distance * mu;
        let k = header.compliance;
        let x11 = 2.0 * reach * (k[0] * g1[0] + k[1] * g1[1]);
        let x12 = 2.0 * reach * (k[0] * g2[0] + k[1] * g2[1]);
        let x21 = 2.0 * reach * (k[1] * g1[0] + k[2] * g1[1]);
        let x22 = 2.0 * reach * (k[1] * g2[0] + k[2] * g2[1]);
        let (trace, det) = (x11 + x22, x11 * x22 - x12 * x21);
        // 1 - s trace + s^2 det stays above the margin for s in [0, 1].
        let lowest = if det > 0.0 && trace > 0.0 && trace < 2.0 * det { 1.0 - 0.25 * trace * trace / det } else { 1.0 - trace + det };
        if lowest.is_nan() || lowest < COUPLING_MARGIN {
            return false;
        }
        let right1 = -load.m2 + reach * load.f3 / header.area_i * g0[0];
        let right2 = load.m1 + reach * load.f3 / header.area_i * g0[1];
        let b1 = k[0] * right1 + k[1] * right2;
        let b2 = k[1] * right1 + k[2] * right2;
        let whole = 1.0 - trace + det;
        let slope = [((1.0 - x22) * b1 + x12 * b2) / whole, (x21 * b1 + (1.0 - x11) * b2) / whole];
        let without = [-k[0] * load.m2 + k[1] * load.m1, -k[1] * load.m2 + k[2] * load.m1];
        let drop_i = (1.0 + 0.5 * load.f3 - CONTACT_MARGIN) / header.area_i;
        let drop_ii = (1.0 - 0.5 * load.f3 - CONTACT_MARGIN) / header.area_i;
        for edge in &self.edges[header.edges_i as usize..header.edges_ii as usize] {
            let with = slope[0] * edge[0] + slope[1] * edge[1];
            let from = without[0] * edge[0] + without[1] * edge[1];
            if !(with.max(from) <= drop_ii && -with.min(from) <= drop_i) {
                return false;
            }
        }
        true
    }

    /// For different faces: the largest share by which the friction coupling can change the dissipation at any twist,
    /// or a negative number where that is not known to be small. `upper` bounds `mu_s` without coupling.
    ///
    /// Friction moves the slope by at most `softness |d|/2 mu V`, where `V`, the integral of the difference of the two
    /// pressures over both areas, bounds the difference of the two friction forces over `mu`. `V` is at most its value
    /// without coupling plus `spread` times the change of slope, and `mu` at most `upper` over 1 less the share. The
    /// three together are a quadratic equation for the share; its smaller root cannot be left on the way from no
    /// coupling to all of it.
    pub(crate) fn coupled_share(&self, load: &LoadRecord, planes: Planes, upper: f32) -> f32 {
        let header = self.header;
        let mu = load.scale * upper;
        if load.distance >= OUT_OF_RANGE
            || header.resolved == 0
            || !planes.full
            || mu * mu * load.distance * load.distance > 0.5 * (header.area_i + header.area_ii)
        {
            return -1.0;
        }
        let ([q11, q22, q12, q33], [q13, q14, q23, q24]) = (header.variation_first, header.variation_second);
        let [q34, q44] = header.variation_slope;
        let (z1, z2, [z3, z4]) = (planes.at_i, planes.at_ii, planes.slope);
        let square = q11 * z1 * z1 + q22 * z2 * z2 + q33 * z3 * z3 + q44 * z4 * z4;
        let mixed = z1 * (q12 * z2 + q13 * z3 + q14 * z4) + z2 * (q23 * z3 + q24 * z4) + q34 * z3 * z4;
        let variation = (square + 2.0 * mixed).max(0.0).sqrt() + LEAST_VARIATION;
        // Largest relative change of pressure at a vertex per change of slope.
        let mut steepest = 0.0_f32;
        for (index, edge) in self.edges[header.edges_i as usize..header.edges_end as usize].iter().enumerate() {
            let on_i = index < (header.edges_ii - header.edges_i) as usize;
            let along = planes.slope[0] * edge[0] + planes.slope[1] * edge[1];
            let (centroid, pressure) = if on_i { (header.centroid_i, planes.at_i + along) } else { (header.centroid_ii, planes.at_ii - along) };
            let (x, y) = (edge[0] - centroid[0], edge[1] - centroid[1]);
            let least = CONTACT_MARGIN * if on_i { planes.at_i.abs() } else { planes.at_ii.abs() };
            if pressure <= least {
                return -1.0;
            }
            steepest = steepest.max((x * x + y * y) / (pressure * pressure));
        }
        let reach = 0.5 * header.softness * load.distance.abs() * mu;
        let c = 1.0 - reach * header.spread;
        let b = reach * variation * steepest.sqrt();
        if c <= 0.0 || c * c <= 4.0 * b {
            return -1.0;
        }
        let share = 2.0 * b / (c + (c * c - 4.0 * b).sqrt());
        if share <= COUPLED_SHARE { share } else { -1.0 }
    }

    /// Bounds and interpolated twist from the triangles round the best twist `best`, whose value is `value`.
    pub(crate) fn finish(&self, load: &LoadRecord, planes: Planes, best: u32, value: f32) -> SeedRecord {
        let w = load.wrench;
        let twist_of = |entry: u32| {
            let v = self.twists[(entry & !NEGATED) as usize];
            let sign = if entry & NEGATED != 0 { -1.0 } else { 1.0 };
            [sign * v[0], sign * v[1], sign * v[2]]
        };
        let at_best = twist_of(best);
        let best = if dot(w, at_best) < 0.0 { best ^ NEGATED } else { best };
        let ring = self.rings[(best & !NEGATED) as usize].map(|entry| entry ^ (best & NEGATED));
        let ga = self.support(planes, best);
        let mut upper = f32::MAX;
        let mut triangle = [best; 3];
        let mut share = [1.0_f32, 0.0, 0.0];
        let mut gb = self.support(planes, ring[0]);
        for i in 0..RING {
            let next = ring[(i + 1) % RING];
            let gc = self.support(planes, next);
            let normal = cross(gb, gc);
            let det = dot(ga, normal);
            if det.abs() > DEGENERATE {
                let a = dot(w, normal) / det;
                let b = dot(w, cross(gc, ga)) / det;
                let c = dot(w, cross(ga, gb)) / det;
                let total = a.abs() + b.abs() + c.abs();
                if total < upper {
                    upper = total;
                    triangle = [best, ring[i], next];
                    share = [a / total, b / total, c / total];
                }
            }
            gb = gc;
        }
        let corners = triangle.map(twist_of);
        let mut twist = [0, 1, 2].map(|m| share[0] * corners[0][m] + share[1] * corners[1][m] + share[2] * corners[2][m]);
        let length = dot(twist, twist).sqrt();
        // Shares of opposite signs can cancel; the best twist itself always is a seed.
        twist = if length > 0.5 { twist.map(|x| x / length) } else { twist_of(best) };
        let mut status = UNBOUNDED;
        if self.header.faces == 1 && upper < f32::MAX {
            let mix = |component: usize| {
                let mut sum = 0.0;
                for m in 0..3 {
                    let sign = if triangle[m] & NEGATED != 0 { -1.0 } else { 1.0 };
                    sum += sign * share[m] * self.component(0, component, (triangle[m] & !NEGATED) as usize);
                }
                sum
            };
            let (g0, g1, g2) = ([mix(0), mix(1)], [mix(3), mix(4)], [mix(6), mix(7)]);
            if self.full_contact(load, load.scale * upper, g0, g1, g2) {
                status = BOUNDED;
            }
        }
        let mut lower = value;
        if self.header.faces == 2 && upper < f32::MAX {
            let share = self.coupled_share(load, planes, upper);
            if share >= 0.0 {
                status = COUPLED;
                lower /= 1.0 + share;
                upper /= 1.0 - share;
            }
        }
        SeedRecord { twist, lower, upper, status, best: best & !NEGATED, padding: 0 }
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

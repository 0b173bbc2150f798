//! Limit states looked for without `mechanics::`: a scan of all contact moments that pressing pads
//! can carry.
//!
//! Every solution of the seven equations is a zero of a map of the plane: from the contact moment
//! `X = int_I x p_I - int_II x p_II`, which lies in the convex region `N_I conv A_I - N_II conv
//! A_II` and fixes the pressure, through the slip under that pressure, to what (6) and (7) leave
//! over. The map is continuous, so its zeros are found by looking at it everywhere: on rays from
//! the middle to the region's rim, denser towards the rim. Everything is in units of `Fn` and of a
//! length of the pads' size.

#![allow(dead_code, reason = "each suite uses a part of it")]

pub(crate) mod cases;
mod equations;
mod precise;

use glam::DVec2;
use gripfast::contact::{Field, Loops, friction};
use gripfast::model::{Patch, Polygon};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

use cases::Case;
pub(crate) use equations::check;

/// Directed rings of an area: outer ones counter-clockwise, holes clockwise.
type Rings = Vec<Vec<DVec2>>;

/// A contact pair under a load, `Fn = 1`.
pub(crate) struct Problem {
    areas: [Rings; 2],
    normal: [f64; 2],
    /// `(F1, F2, M3)`.
    load: Vector3<f64>,
    /// The contact moment without friction.
    uncoupled: DVec2,
    half_distance: f64,
    /// Corners of the region of contact moments, counter-clockwise, and a point inside.
    rim: Vec<DVec2>,
    middle: DVec2,
}

/// One point of the scanned map.
#[derive(Clone, Copy)]
pub(crate) struct Sample {
    /// Contact moment.
    pub(crate) x: DVec2,
    /// What (6)(7) leave over there: `x` minus what the load and the friction ask for.
    pub(crate) g: DVec2,
    pub(crate) mu: f64,
    q: Vector4<f64>,
    v: Vector3<f64>,
}

/// What a scan saw.
pub(crate) struct Scan {
    /// Distinct zeros, by rising `mu`.
    pub(crate) zeros: Vec<Sample>,
    /// Turns of the map's value along the outermost ring: the zeros inside it, counted with their
    /// signs.
    pub(crate) winding: Option<i32>,
    /// Points at which the pressure or the slip could not be found.
    pub(crate) blind: usize,
    pub(crate) points: usize,
}

fn rings(patch: &Patch) -> Rings {
    let turned = |ring: &[DVec2], sense: f64| {
        let mut ring = ring.to_vec();
        if sense * signed_area(&ring) < 0.0 {
            ring.reverse();
        }
        ring
    };
    patch
        .iter()
        .flat_map(|polygon| {
            std::iter::once(turned(&polygon.outer, 1.0))
                .chain(polygon.holes.iter().map(|hole| turned(hole, -1.0)))
        })
        .collect()
}

fn signed_area(ring: &[DVec2]) -> f64 {
    (0..ring.len())
        .map(|i| (ring[i] - ring[0]).perp_dot(ring[(i + 1) % ring.len()] - ring[0]))
        .sum::<f64>()
        / 2.0
}

/// The part of every ring where `p0 + p1 x1 + p2 x2 > 0`.
fn pressed(area: &Rings, p: [f64; 3]) -> Rings {
    let value = |x: DVec2| p[0] + p[1] * x.x + p[2] * x.y;
    let cut = |ring: &Vec<DVec2>| {
        let mut kept = Vec::with_capacity(ring.len() + 2);
        for i in 0..ring.len() {
            let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
            let (pa, pb) = (value(a), value(b));
            if pa > 0.0 {
                kept.push(a);
            }
            if (pa > 0.0) != (pb > 0.0) {
                kept.push((a * pb - b * pa) / (pb - pa));
            }
        }
        kept
    };
    area.iter().map(cut).filter(|ring| ring.len() >= 3).collect()
}

/// `int (1, x1, x2, x1 x1, x1 x2, x2 x2)`.
fn moments(area: &Rings) -> [f64; 6] {
    let mut m = [0.0; 6];
    for ring in area {
        // Triangles from the ring's first point: nothing cancels for a thin ring away from the
        // origin.
        for i in 1..ring.len() - 1 {
            let (a, b, c) = (ring[0], ring[i], ring[i + 1]);
            let area = (b - a).perp_dot(c - a) / 2.0;
            let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
            for x in [ab, bc, ca] {
                for (sum, value) in
                    m.iter_mut().zip([1.0, x.x, x.y, x.x * x.x, x.x * x.y, x.y * x.y])
                {
                    *sum += area / 3.0 * value;
                }
            }
        }
    }
    m
}

fn loops(area: &Rings) -> Loops {
    let polygons: Vec<Polygon> = area
        .iter()
        .map(|ring| {
            if signed_area(ring) > 0.0 {
                Polygon { outer: ring.clone(), holes: vec![] }
            } else {
                Polygon { outer: vec![], holes: vec![ring.clone()] }
            }
        })
        .collect();
    Loops::new(&polygons)
}

fn planes(q: &Vector4<f64>) -> [[f64; 3]; 2] {
    [[q[0], q[2], q[3]], [q[1], -q[2], -q[3]]]
}

impl Problem {
    /// `None` without normal force on both pads or without a load in the pad plane.
    pub(crate) fn new(case: &Case) -> Option<Self> {
        let areas = [rings(&case.contact.face_i), rings(&case.contact.face_ii)];
        let (f, m) = (case.wrench.force, case.wrench.moment);
        let normal = [1.0 + f.z / 2.0, 1.0 - f.z / 2.0];
        let load = Vector3::new(f.x, f.y, m.z);
        if normal[0] <= 0.0 || normal[1] <= 0.0 || load.norm() == 0.0 {
            return None;
        }
        let uncoupled = DVec2::new(-m.y, m.x);
        // All sums of corners: their hull is the region.
        let mut corners = Vec::new();
        for a in areas[0].iter().flatten() {
            corners.extend(areas[1].iter().flatten().map(|b| *a * normal[0] - *b * normal[1]));
        }
        let rim = gripfast::geometry::hull::convex_hull(&corners);
        let middle = rim.iter().sum::<DVec2>() / rim.len() as f64;
        Some(Self {
            areas,
            normal,
            load,
            uncoupled,
            half_distance: case.distance / 2.0,
            rim,
            middle,
        })
    }

    /// Pressure, slip and what is left over at the contact moment `x`, from a neighbour's.
    pub(crate) fn sample(&self, x: DVec2, near: Option<&Sample>) -> Option<Sample> {
        let q = self
            .pressure(x, near.map(|near| near.q))
            .or_else(|| near.and_then(|_| self.pressure(x, None)))?;
        let p = planes(&q);
        let pressed = [0, 1].map(|k| loops(&pressed(&self.areas[k], p[k])));
        let v = self.slip(&pressed, &p, near.map(|near| near.v))?;
        let [one, two] = [0, 1].map(|k| {
            Vector3::from(friction(Field { area: &pressed[k], p: p[k] }, v.into()).gradient(p[k]))
        });
        let mu = self.load.dot(&v) / (one + two).dot(&v);
        let difference = self.half_distance * mu * (one - two);
        let g = x - self.uncoupled - DVec2::new(difference.x, difference.y);
        (mu.is_finite() && g.is_finite()).then_some(Sample { x, g, mu, q, v })
    }

    /// Minimises `1/2 sum int p^2 - f.q` over the four coefficients.
    fn pressure(&self, x: DVec2, start: Option<Vector4<f64>>) -> Option<Vector4<f64>> {
        let f = Vector4::new(self.normal[0], self.normal[1], x.x, x.y);
        let at = |q: &Vector4<f64>| {
            let p = planes(q);
            let [a, b] = [0, 1].map(|k| moments(&pressed(&self.areas[k], p[k])));
            let k = Matrix4::new(
                a[0],
                0.0,
                a[1],
                a[2], //
                0.0,
                b[0],
                -b[1],
                -b[2], //
                a[1],
                -b[1],
                a[3] + b[3],
                a[4] + b[4], //
                a[2],
                -b[2],
                a[4] + b[4],
                a[5] + b[5],
            );
            let error = k * q - f;
            (0.5 * q.dot(&(k * q)) - f.dot(q), error, k, a[0] > 0.0 && b[0] > 0.0)
        };
        let whole = self.areas.each_ref().map(|area| moments(area)[0]);
        let mut q =
            start.unwrap_or_else(|| Vector4::new(f[0] / whole[0], f[1] / whole[1], 0.0, 0.0));
        let (mut value, mut error, mut k, _) = at(&q);
        for _ in 0..80 {
            if error.amax() < 1e-14 {
                break;
            }
            // Scaled to a unit diagonal, then lifted until it factors.
            let scale = k.diagonal().map(|d| 1.0 / d.max(1e-300).sqrt());
            let unit = Matrix4::from_fn(|i, j| k[(i, j)] * scale[i] * scale[j]);
            let factor = [0.0, 1e-14, 1e-11, 1e-8, 1e-4]
                .iter()
                .find_map(|lift| (unit + Matrix4::identity() * *lift).cholesky())?;
            let step = -factor.solve(&error.component_mul(&scale)).component_mul(&scale);
            let slope = error.dot(&step);
            let found = (0..25).map(|i| 0.5f64.powi(i)).find_map(|t| {
                let next = at(&(q + t * step));
                let falls =
                    next.0 <= value + 1e-4 * t * slope || next.1.norm() < 0.3 * error.norm();
                (next.3 && falls).then_some((q + t * step, next))
            });
            let Some((next_q, next)) = found else { break };
            if next.1.norm() >= error.norm() && error.amax() < 1e-9 {
                break;
            }
            q = next_q;
            (value, error, k, _) = next;
        }
        (error.amax() < 1e-9).then_some(q)
    }

    /// Minimises `D^2/2 - w.v`.
    fn slip(
        &self,
        areas: &[Loops; 2],
        p: &[[f64; 3]; 2],
        start: Option<Vector3<f64>>,
    ) -> Option<Vector3<f64>> {
        let size = self.load.norm();
        let w = self.load / size;
        let at = |v: &Vector3<f64>| {
            let (mut g, mut h) = (Vector3::zeros(), Matrix3::zeros());
            for k in 0..2 {
                let f = friction(Field { area: &areas[k], p: p[k] }, (*v).into());
                g += Vector3::from(f.gradient(p[k]));
                h += Matrix3::from_fn(|i, j| f.hessian[i][j]);
            }
            let d = g.dot(v);
            (0.5 * d * d - w.dot(v), d * g - w, g * g.transpose() + d * h)
        };
        let mut v = start.filter(|v| w.dot(v) > 0.0).unwrap_or(w);
        let first = at(&v);
        let d = (2.0 * (first.0 + w.dot(&v))).sqrt();
        v *= w.dot(&v) / (d * d);
        let (mut value, mut error, mut matrix) = at(&v);
        for _ in 0..60 {
            if error.amax() < 1e-13 {
                break;
            }
            let lift = matrix.trace();
            let factor = [0.0, 1e-14, 1e-11, 1e-8, 1e-4, 1.0]
                .iter()
                .find_map(|share| (matrix + Matrix3::identity() * (share * lift)).cholesky())?;
            let step = -factor.solve(&error);
            let slope = error.dot(&step);
            let found = (0..25).map(|i| 0.5f64.powi(i)).find_map(|t| {
                let next = at(&(v + t * step));
                (next.0 <= value + 1e-4 * t * slope || next.1.norm() < 0.3 * error.norm())
                    .then_some((v + t * step, next))
            });
            let Some((next_v, next)) = found else { break };
            if next.1.norm() >= error.norm() && error.amax() < 1e-9 {
                break;
            }
            v = next_v;
            (value, error, matrix) = next;
        }
        (error.amax() < 1e-7).then_some(v)
    }

    /// How far the rim is from the middle along `direction`.
    fn reach(&self, from: DVec2, direction: DVec2) -> f64 {
        let mut reach = f64::INFINITY;
        for (a, b) in self.rim.iter().zip(self.rim.iter().cycle().skip(1)) {
            let normal = DVec2::new(b.y - a.y, a.x - b.x);
            let toward = normal.dot(direction);
            if toward > 0.0 {
                reach = reach.min(normal.dot(*a - from) / toward);
            }
        }
        reach
    }

    /// Rays to all corners of the rim and between them, none wider apart than a `1/rays` turn.
    fn rays(&self, rays: usize) -> Vec<DVec2> {
        let mut ends = Vec::new();
        for (a, b) in self.rim.iter().zip(self.rim.iter().cycle().skip(1)) {
            let (a, b) = (*a - self.middle, *b - self.middle);
            let pieces = (a.angle_to(b).abs() / std::f64::consts::TAU * rays as f64).ceil().max(2.0)
                as usize;
            ends.extend((0..pieces).map(|i| a.lerp(b, i as f64 / pieces as f64)));
        }
        ends
    }

    /// Looks at the map on `rays` times `rings` points and polishes what looks like a zero.
    pub(crate) fn scan(&self, rays: usize, rings: usize) -> Scan {
        let share = |j: usize| 1.0 - (1.0 - 0.85 * j as f64 / rings as f64).powi(4);
        self.scan_at(rays, &(1..=rings).map(share).collect::<Vec<_>>())
    }

    /// The same with more rings close to the rim, where the last of a contact is: from 1e-4 to 1e-7 of
    /// the way from the middle.
    pub(crate) fn scan_to_the_rim(&self, rays: usize, rings: usize) -> Scan {
        let share = |j: usize| 1.0 - (1.0 - 0.85 * j as f64 / rings as f64).powi(4);
        let near = (8..=14).map(|half| 1.0 - 10f64.powf(-0.5 * f64::from(half)));
        self.scan_at(rays, &(1..=rings).map(share).chain(near).collect::<Vec<_>>())
    }

    /// On rings at these shares of the way to the rim, rising.
    fn scan_at(&self, rays: usize, shares: &[f64]) -> Scan {
        let ends = self.rays(rays);
        let rings = shares.len();
        let (mut blind, mut points) = (0, 1);
        let Some(centre) = self.sample(self.middle, None) else {
            return Scan { zeros: vec![], winding: None, blind: 1, points };
        };
        // grid[i][j]: ray i, ring j; ring 0 is the middle.
        let mut grid: Vec<Vec<Option<Sample>>> = Vec::with_capacity(ends.len());
        for end in &ends {
            let mut ray = vec![Some(centre)];
            for j in 1..=rings {
                let near = ray.iter().rev().flatten().next().copied();
                let sample = self.sample(self.middle + shares[j - 1] * *end, near.as_ref());
                points += 1;
                blind += usize::from(sample.is_none());
                ray.push(sample);
            }
            grid.push(ray);
        }
        let n = ends.len();
        let mut starts: Vec<Sample> = Vec::new();
        for i in 0..n {
            for j in 0..rings {
                let cell =
                    [grid[i][j], grid[(i + 1) % n][j], grid[(i + 1) % n][j + 1], grid[i][j + 1]];
                let corners: Vec<Sample> = cell.iter().flatten().copied().collect();
                if corners.len() >= 3
                    && (encloses(&corners[0..3])
                        || (corners.len() == 4 && encloses(&[corners[0], corners[2], corners[3]])))
                {
                    starts.extend(
                        corners
                            .iter()
                            .copied()
                            .min_by(|a, b| a.g.length().total_cmp(&b.g.length())),
                    );
                }
                // A pair of zeros between the grid's lines turns nothing, but the value is small
                // beside them.
                let Some(here) = grid[i][j] else { continue };
                let around = [-1i32, 0, 1]
                    .iter()
                    .flat_map(|&di| [-1i32, 0, 1].map(|dj| (di, dj)))
                    .filter_map(|(di, dj)| {
                        let column = &grid[(i as i32 + di).rem_euclid(n as i32) as usize];
                        column.get(usize::try_from(j as i32 + dj).ok()?).copied().flatten()
                    });
                if (j > 0 || i == 0)
                    && around.clone().all(|other| other.g.length() >= here.g.length())
                {
                    starts.push(here);
                }
            }
        }
        for column in &grid {
            starts.extend(
                column[rings]
                    .filter(|last| {
                        column[rings - 1].is_none_or(|before| last.g.length() < before.g.length())
                    })
                    .filter(|last| last.g.length() < 0.05),
            );
        }
        let mut zeros: Vec<Sample> = Vec::new();
        for start in starts {
            if zeros.iter().any(|zero| zero.x.distance(start.x) < 1e-9) {
                continue;
            }
            if let Some(zero) = self.polish(start)
                && !zeros.iter().any(|known| {
                    (known.mu / zero.mu - 1.0).abs() < 1e-6 && known.x.distance(zero.x) < 1e-5
                })
            {
                zeros.push(zero);
            }
        }
        zeros.sort_by(|a, b| a.mu.total_cmp(&b.mu));
        let last: Option<Vec<DVec2>> =
            grid.iter().map(|ray| ray[rings].map(|sample| sample.g)).collect();
        let winding = last.and_then(|ring| {
            let turns: Vec<f64> = (0..n).map(|i| ring[i].angle_to(ring[(i + 1) % n])).collect();
            turns
                .iter()
                .all(|turn| turn.abs() < 2.5)
                .then(|| (turns.iter().sum::<f64>() / std::f64::consts::TAU).round() as i32)
        });
        Scan { zeros, winding, blind, points }
    }

    /// Newton's method on the map with differences for its derivative, kept inside the region.
    pub(crate) fn polish(&self, start: Sample) -> Option<Sample> {
        let mut at = start;
        for _ in 0..25 {
            if at.g.length() < 1e-11 {
                break;
            }
            let room = |x: DVec2| {
                self.rim
                    .iter()
                    .zip(self.rim.iter().cycle().skip(1))
                    .map(|(a, b)| {
                        let edge = (*b - *a).normalize();
                        edge.perp_dot(x - *a)
                    })
                    .fold(f64::INFINITY, f64::min)
            };
            let step = 1e-5 * room(at.x).min(0.1);
            if step <= 0.0 {
                return None;
            }
            let difference = |e: DVec2| {
                let (plus, minus) = (
                    self.sample(at.x + step * e, Some(&at))?,
                    self.sample(at.x - step * e, Some(&at))?,
                );
                Some((plus.g - minus.g) / (2.0 * step))
            };
            let (gx, gy) = (difference(DVec2::X)?, difference(DVec2::Y)?);
            let det = gx.perp_dot(gy);
            let newton = -DVec2::new(at.g.perp_dot(gy), gx.perp_dot(at.g)) / det;
            if !newton.is_finite() {
                return None;
            }
            let next = (0..14).map(|i| 0.5f64.powi(i)).find_map(|t| {
                let x = at.x + t * newton;
                if room(x) <= 0.0 {
                    return None;
                }
                self.sample(x, Some(&at))
                    .filter(|next| next.g.length() < (1.0 - 0.1 * t) * at.g.length())
            });
            let Some(next) = next else { break };
            at = next;
        }
        (at.g.length() < 1e-8).then_some(at)
    }

    /// The zero on the branch that starts at `d = 0`, followed in small steps of `d` (Newton's
    /// method from the step before), the first of which changes nothing much, each longer than the
    /// one before by the same factor; `None` where the branch ends before the real `d`.
    pub(crate) fn branch(&self, steps: usize) -> Option<Sample> {
        let with = |share: f64| Self {
            half_distance: share * self.half_distance,
            areas: self.areas.clone(),
            rim: self.rim.clone(),
            ..*self
        };
        let mut at = with(0.0).sample(self.uncoupled, None)?;
        let first = 0.01 / (1.0 + 2.0 * at.mu * self.half_distance.abs());
        for step in 0..=steps {
            let problem = with(first.powf(1.0 - step as f64 / steps as f64));
            let here = problem.sample(at.x, Some(&at))?;
            let next = problem.polish(here)?;
            if next.x.distance(at.x) > 40.0 / steps as f64 {
                return None;
            }
            at = next;
        }
        Some(at)
    }
}

/// Whether the triangle of three values encloses zero, its sides included.
fn encloses(corners: &[Sample]) -> bool {
    let turns = [0, 1, 2].map(|i| corners[i].g.perp_dot(corners[(i + 1) % 3].g));
    turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0)
}

//! Solids with known curved faces, tessellated as asked.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};
use gripfast::part::Part;

/// Deterministic numbers in -1..1 (a 64-bit linear congruential generator, upper bits).
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A mesh under construction [mm].
#[derive(Default, Clone)]
pub(crate) struct Solid {
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// A pose that is along no axis.
pub(crate) fn pose(seed: u64) -> (DMat3, DVec3) {
    let mut random = Random(seed.wrapping_add(77));
    let mut vector = || DVec3::new(random.next(), random.next(), random.next());
    let turn = DQuat::from_scaled_axis(vector() * 3.0);
    (DMat3::from_quat(turn), vector() * 20.0)
}

impl Solid {
    /// Rings of `n` points about `z`, from bottom to top; ring `k` at place `profile[k] = (z, r)`
    /// turned by `turn(k)` steps. A radius of zero is one point. Ends that are not points are
    /// closed by plane caps.
    pub(crate) fn lathe(profile: &[DVec2], n: u32, turn: impl Fn(usize) -> f64) -> Self {
        let mut solid = Self::default();
        let rings: Vec<Vec<u32>> = profile
            .iter()
            .enumerate()
            .map(|(k, place)| {
                let count = if place.y > 0.0 { n } else { 1 };
                (0..count)
                    .map(|i| {
                        let angle = TAU * (f64::from(i) + turn(k)) / f64::from(n);
                        solid.vertex((DVec2::from_angle(angle) * place.y).extend(place.x))
                    })
                    .collect()
            })
            .collect();
        for pair in rings.windows(2) {
            solid.band(&pair[0], &pair[1]);
        }
        solid.cap(&rings[0], true);
        solid.cap(&rings[rings.len() - 1], false);
        solid
    }

    /// As [`Self::lathe`], the profile closed to a ring: no caps.
    pub(crate) fn ring(profile: &[DVec2], n: u32, turn: impl Fn(usize) -> f64) -> Self {
        let mut solid = Self::default();
        let rings: Vec<Vec<u32>> = profile
            .iter()
            .enumerate()
            .map(|(k, place)| {
                (0..n)
                    .map(|i| {
                        let angle = TAU * (f64::from(i) + turn(k)) / f64::from(n);
                        solid.vertex((DVec2::from_angle(angle) * place.y).extend(place.x))
                    })
                    .collect()
            })
            .collect();
        for k in 0..rings.len() {
            solid.band(&rings[k], &rings[(k + 1) % rings.len()]);
        }
        solid
    }

    /// A star-shaped outline about the origin, counter-clockwise, from `z = 0` to `height`.
    pub(crate) fn extrude(outline: &[DVec2], height: f64) -> Self {
        let mut solid = Self::default();
        let rings: Vec<Vec<u32>> = [0.0, height]
            .iter()
            .map(|&z| outline.iter().map(|point| solid.vertex(point.extend(z))).collect())
            .collect();
        solid.band(&rings[0], &rings[1]);
        for (ring, z, down) in [(&rings[0], 0.0, true), (&rings[1], height, false)] {
            let centre = solid.vertex(DVec3::new(0.0, 0.0, z));
            for k in 0..ring.len() {
                let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
                solid.triangles.push(if down { [centre, b, a] } else { [centre, a, b] });
            }
        }
        solid
    }

    fn vertex(&mut self, point: DVec3) -> u32 {
        self.vertices.push(point);
        self.vertices.len() as u32 - 1
    }

    /// Between two rings counter-clockwise about `z`, the second above or inside.
    fn band(&mut self, low: &[u32], high: &[u32]) {
        let n = low.len().max(high.len());
        for k in 0..n {
            let next = (k + 1) % n;
            if high.len() == 1 {
                self.triangles.push([low[k], low[next], high[0]]);
            } else if low.len() == 1 {
                self.triangles.push([low[0], high[next], high[k]]);
            } else {
                self.triangles.push([low[k], low[next], high[next]]);
                self.triangles.push([low[k], high[next], high[k]]);
            }
        }
    }

    fn cap(&mut self, ring: &[u32], down: bool) {
        for k in 1..ring.len().saturating_sub(1) {
            let (a, b) = (ring[k], ring[k + 1]);
            self.triangles.push(if down { [ring[0], b, a] } else { [ring[0], a, b] });
        }
    }

    /// In a pose along no axis, with coordinates moved by up to `noise` and rounded to `step` [mm].
    pub(crate) fn rounded(mut self, seed: u64, noise: f64, step: f64) -> Self {
        let (turn, shift) = pose(seed);
        let mut random = Random(11);
        for vertex in &mut self.vertices {
            let moved = noise * DVec3::new(random.next(), random.next(), random.next());
            *vertex = ((turn * *vertex + shift + moved) / step).round() * step;
        }
        self
    }

    /// As it stands.
    pub(crate) fn unmoved(&self) -> Part {
        let vertices: Vec<DVec3> = self.vertices.iter().map(|vertex| *vertex * 1e-3).collect();
        Part::from_triangles("solid", &vertices, &self.triangles).unwrap()
    }

    /// Moved by a pose, each coordinate by up to `noise` [mm], and rounded to 32-bit floats as in an
    /// STL file.
    pub(crate) fn part(mut self, seed: u64, noise: f64) -> Part {
        let (turn, shift) = pose(seed);
        let mut random = Random(seed);
        for vertex in &mut self.vertices {
            let mut moved = turn * *vertex + shift;
            if noise > 0.0 {
                moved += noise * DVec3::new(random.next(), random.next(), random.next());
            }
            *vertex = moved.as_vec3().as_dvec3() * 1e-3;
        }
        Part::from_triangles("solid", &self.vertices, &self.triangles).unwrap()
    }

    /// Every triangle cut in four at the middles of its edges.
    pub(crate) fn subdivided(&self) -> Self {
        let mut solid = Self { vertices: self.vertices.clone(), triangles: Vec::new() };
        let mut middles = std::collections::BTreeMap::new();
        for &[a, b, c] in &self.triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let point = (solid.vertices[a as usize] + solid.vertices[b as usize]) / 2.0;
                    solid.vertices.push(point);
                    solid.vertices.len() as u32 - 1
                })
            };
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            solid.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        solid
    }
}

/// Points of an arc about `centre`, from one angle to the other, both ends included.
pub(crate) fn arc(centre: DVec2, radius: f64, from: f64, to: f64, steps: u32) -> Vec<DVec2> {
    let at = |k: u32| from + (to - from) * f64::from(k) / f64::from(steps);
    (0..=steps).map(|k| centre + DVec2::from_angle(at(k)) * radius).collect()
}

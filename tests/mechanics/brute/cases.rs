//! Random contact pairs and loads of every kind, each made from its number alone.

use glam::{DVec2, DVec3};
use gripfast::model::{Contact, Patch, Polygon, Wrench};

use crate::support::random::Random;

/// One contact pair under a load.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) contact: Contact,
    pub(crate) distance: f64,
    pub(crate) force: f64,
    pub(crate) wrench: Wrench,
}

fn plain(outer: Vec<DVec2>) -> Patch {
    vec![Polygon { outer, holes: vec![] }]
}

fn ring(random: &mut Random, corners: usize, radius: impl Fn(&mut Random) -> f64) -> Vec<DVec2> {
    let turn = random.range(0.0, std::f64::consts::TAU);
    (0..corners)
        .map(|i| {
            radius(random)
                * DVec2::from_angle(turn + std::f64::consts::TAU * i as f64 / corners as f64)
        })
        .collect()
}

fn rectangle(a: f64, b: f64) -> Vec<DVec2> {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| DVec2::new(x * a / 2.0, y * b / 2.0))
        .to_vec()
}

fn mapped(patch: Patch, map: impl Fn(DVec2) -> DVec2) -> Patch {
    let ring = |ring: Vec<DVec2>| ring.into_iter().map(&map).collect::<Vec<_>>();
    patch
        .into_iter()
        .map(|polygon| Polygon {
            outer: ring(polygon.outer),
            holes: polygon.holes.into_iter().map(ring).collect(),
        })
        .collect()
}

/// An area of about unit size near the origin.
fn patch(random: &mut Random) -> Patch {
    let shape = match random.below(8) {
        0 => plain(rectangle(1.0, 1.0)),
        1 => {
            let corners = 3 + random.below(6);
            plain(ring(random, corners, |_| 0.7)) // convex
        }
        2 => {
            let corners = 5 + random.below(8);
            plain(ring(random, corners, |random| random.range(0.2, 1.0))) // notched
        }
        3 => {
            let corners = 3 + random.below(4);
            let outer = ring(random, corners + 2, |random| random.range(0.6, 0.9));
            let hole = ring(random, corners, |random| random.range(0.1, 0.25));
            vec![Polygon { outer, holes: vec![hole] }]
        }
        4 => {
            let thin = if random.chance(0.1) {
                random.power(-4.0, -2.0)
            } else {
                random.power(-2.0, -0.5)
            };
            plain(rectangle(1.0, thin)) // sliver
        }
        5 => {
            let corners = 4 + random.below(3);
            let mut both = plain(ring(random, corners, |random| random.range(0.2, 0.4)));
            let other = plain(ring(random, corners, |random| random.range(0.15, 0.35)));
            let apart = DVec2::new(random.range(0.9, 1.4), random.range(-0.4, 0.4));
            both.extend(mapped(other, |x| x + apart));
            both
        }
        6 => {
            let (a, b) = (random.range(0.1, 0.3), 0.5); // a cross
            plain(
                [
                    (a, -b),
                    (a, -a),
                    (b, -a),
                    (b, a),
                    (a, a),
                    (a, b),
                    (-a, b),
                    (-a, a),
                    (-b, a),
                    (-b, -a),
                    (-a, -a),
                    (-a, -b),
                ]
                .map(|(x, y)| DVec2::new(x, y))
                .to_vec(),
            )
        }
        _ => {
            let (a, b) = (random.range(0.3, 1.5), random.range(0.3, 1.5));
            plain(rectangle(a, b))
        }
    };
    let turn = if random.chance(0.4) {
        DVec2::X
    } else {
        DVec2::from_angle(random.range(0.0, std::f64::consts::TAU))
    };
    let size = random.power(-0.3, 0.3);
    mapped(shape, |x| size * turn.rotate(x))
}

/// The case of a number, with `Fn = 1` and areas of about unit size.
pub(crate) fn case(number: u64) -> Case {
    let random = &mut Random::new(number);
    let face_i = patch(random);
    let face_ii = match random.below(4) {
        0 => face_i.clone(),
        1 => {
            let shift = random.point(0.4);
            mapped(face_i.clone(), |x| x + shift)
        }
        _ => {
            let shift = random.point(0.3);
            mapped(patch(random), |x| x + shift)
        }
    };
    let away = if random.chance(0.3) { random.point(3.0) } else { DVec2::ZERO };
    let contact =
        Contact { face_i: mapped(face_i, |x| x + away), face_ii: mapped(face_ii, |x| x + away) };
    let size = if random.chance(0.1) { random.power(-6.0, 6.0) } else { random.power(-1.5, 0.2) };
    let mut in_plane = [random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(-1.0, 1.0)];
    if random.chance(0.3) {
        // As in gravity along an axis: some components are exactly zero.
        let kept = random.below(3);
        in_plane = std::array::from_fn(|i| if i == kept { in_plane[i] } else { 0.0 });
    }
    let f3 = if random.chance(0.3) { random.range(-2.2, 2.2) } else { random.range(-0.5, 0.5) };
    let tilting = if random.chance(0.3) {
        DVec2::ZERO
    } else {
        random.point(1.0) * if random.chance(0.15) { 1.2 } else { 0.4 }
    };
    let force = DVec3::new(size * in_plane[0], size * in_plane[1], f3);
    // The moment about the pads' middle, carried to the origin.
    let moment =
        DVec3::new(tilting.x, tilting.y, size * in_plane[2]) + away.extend(0.0).cross(force);
    let distance = match random.below(20) {
        0 => 0.0,
        1 => random.power(-6.0, 6.0),
        2..=7 => random.power(-1.0, 0.3),
        8 | 9 => -random.power(-1.0, 0.8),
        _ => random.power(-0.5, 1.0),
    };
    Case { contact, distance, force: 1.0, wrench: Wrench { force, moment } }
}

impl Case {
    /// In other units of length and force.
    pub(crate) fn scaled(&self, length: f64, force: f64) -> Self {
        let patch = |patch: &Patch| mapped(patch.clone(), |x| x * length);
        Self {
            contact: Contact {
                face_i: patch(&self.contact.face_i),
                face_ii: patch(&self.contact.face_ii),
            },
            distance: self.distance * length,
            force: self.force * force,
            wrench: Wrench {
                force: self.wrench.force * force,
                moment: self.wrench.moment * (force * length),
            },
        }
    }

    /// The units in which case `number` is posed, over six decades up and down.
    pub(crate) fn units(number: u64) -> (f64, f64) {
        let random = &mut Random::new(!number);
        (random.power(-6.0, 6.0), random.power(-6.0, 6.0))
    }

    /// The case as a file that `gripfast solve` reads.
    pub(crate) fn json(&self) -> String {
        let (f, m) = (self.wrench.force.to_array(), self.wrench.moment.to_array());
        serde_json::json!({"A_I": self.contact.face_i, "A_II": self.contact.face_ii, "d": self.distance, "Fn": self.force, "F": f, "M": m}).to_string()
    }
}

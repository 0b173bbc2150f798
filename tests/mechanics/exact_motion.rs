//! A cylinder with a flat under its exact rigid motion, against the equations for small tilts: the points
//! of its surface are turned with the body, pressed where they are then, and pushed along their normals.

use glam::{DMat3, DVec2, DVec3};
use gripfast::contact::surface::{Gap, Surfaces};
use gripfast::mechanics::curved::{Answer, Pads};
use gripfast::model::Wrench;

use crate::curved::rectangle;

/// A part of the surface: place, outward normal, area.
type Patch = (DVec3, DVec3, f64);

const RADIUS: f64 = 0.025;
const DISTANCE: f64 = 0.025;
const STIFFNESS: f64 = 5e9;
const FORCE: f64 = 40.0;
/// Extent of both faces along the axis, and of the flat across it to either side \[m\].
const ALONG: [f64; 2] = [-0.004, 0.017];
const ACROSS: f64 = 0.01;
const STEPS: u32 = 400;

/// Middles of equal shares of a range, and their length.
fn shares([from, to]: [f64; 2], count: u32) -> (impl Iterator<Item = f64>, f64) {
    let step = (to - from) / f64::from(count);
    ((0..count).map(move |i| from + step * (f64::from(i) + 0.5)), step)
}

/// The flat above, the round below, about the grip origin.
fn body() -> [Vec<Patch>; 2] {
    let (mut flat, mut round) = (Vec::new(), Vec::new());
    let reach = (ACROSS / RADIUS).asin();
    let axis = RADIUS - 0.5 * DISTANCE;
    let (along, step) = shares(ALONG, STEPS / 4);
    for x in along {
        let (across, width) = shares([-ACROSS, ACROSS], STEPS);
        flat.extend(across.map(|y| (DVec3::new(x, y, 0.5 * DISTANCE), DVec3::Z, step * width)));
        let (turns, arc) = shares([-reach, reach], STEPS);
        round.extend(turns.map(|turn| {
            let normal = DVec3::new(0.0, turn.sin(), -turn.cos());
            (DVec3::new(x, 0.0, axis) + RADIUS * normal, normal, step * RADIUS * arc)
        }));
    }
    [flat, round]
}

/// What the pressures of a turned body leave over with the load and the friction of an answer: force
/// along the pads, and all moments.
fn left_over(wrench: &Wrench, answer: &Answer) -> (DVec2, DVec3) {
    let [a1, a2] = answer.tilt.unwrap();
    let axis = DVec3::new(a2, -a1, 0.0);
    let turn = DMat3::from_axis_angle(axis.normalize(), axis.length());
    let (mut force, mut moment) = (wrench.force, wrench.moment);
    let halves = [0.5, -0.5];
    for ((k, patches), half) in body().iter().enumerate().zip(halves) {
        let pad = half * DISTANCE;
        let turned: Vec<Patch> =
            patches.iter().map(|(x, n, da)| (turn * *x, turn * *n, *da)).collect();
        let gap = |x: &DVec3| (pad - x.z) * half.signum();
        let push = |delta: f64| {
            let pressed = turned.iter().filter(move |(x, ..)| delta > gap(x));
            pressed.map(move |(x, n, da)| (*x, -STIFFNESS * (delta - gap(x)) * *da * *n))
        };
        let normal = FORCE + half * wrench.force.z;
        let (mut low, mut high) = (-1e-3, 2e-3);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let carried: f64 = push(middle).map(|(_, f)| f.z.abs()).sum();
            *(if carried < normal { &mut low } else { &mut high }) = middle;
        }
        for (x, f) in push(high) {
            force += f;
            moment += x.cross(f);
        }
        let [s1, s2, turned] = answer.faces.unwrap()[k].share;
        let friction = -DVec3::new(s1, s2, 0.0);
        force += friction;
        moment += DVec3::new(0.0, 0.0, pad).cross(friction) - DVec3::new(0.0, 0.0, turned);
    }
    (force.truncate(), moment)
}

/// What the equations leave out is of second order: a small share of what the tilt does to first order, the
/// force `N phi` and its lever.
#[test]
fn tilts_are_right_to_first_order() {
    let outer = |gap| vec![rectangle([ALONG[0], -ACROSS], [ALONG[1], ACROSS], gap)];
    let (axis, at, height) = (DVec2::X, DVec2::ZERO, 0.0);
    let surfaces = Surfaces {
        face_i: outer(Gap::default()),
        face_ii: outer(Gap::Cylinder { radius: RADIUS, axis, at, height }),
        stiffness: [STIFFNESS; 2],
        layer: None,
    };
    let pads = Pads::new(&surfaces).unwrap();
    let mut most = 0.0;
    for (f, m) in [
        ([-4.0, -3.0, -6.0], [0.10, 0.05, 0.084]),
        ([2.0, 5.0, 1.0], [0.16, 0.02, -0.03]),
        ([0.0, -6.0, 3.0], [-0.18, -0.06, 0.05]),
        ([3.0, 0.0, 0.0], [0.22, 0.0, 0.02]),
    ] {
        let wrench = Wrench { force: DVec3::from(f), moment: DVec3::from(m) };
        let answer = pads.solve_pushed(DISTANCE, FORCE, &wrench);
        let tilt = DVec2::from(answer.tilt.unwrap()).length();
        let (force, moment) = left_over(&wrench, &answer);
        let first = FORCE * tilt;
        let share = [force.length() / first, moment.length() / (first * 0.5 * DISTANCE)];
        println!("tilt {tilt:.5} mu_s {:.4}: {share:.4?}", answer.score.mu_s.unwrap());
        most = share.into_iter().fold(most, f64::max);
        // Without what the tilt moves, that is left over.
        let (force, moment) = left_over(&wrench, &pads.solve(DISTANCE, FORCE, &wrench));
        let theory = [force.length() / first, moment.length() / (first * 0.5 * DISTANCE)];
        assert!(theory.iter().all(|share| *share > 0.5), "{theory:?}");
    }
    assert!(most < 0.05, "{most}");
}

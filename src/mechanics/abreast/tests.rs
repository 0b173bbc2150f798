//! Bounds of loads side by side against their solutions.

use super::*;
use crate::mechanics::{Comparer, Neighbour, Options, solve_next, solve_pads};
use crate::model::{Contact, Polygon, Status, Wrench};
use glam::{DVec2, DVec3};

fn octagon(turn: f64, size: impl Fn(usize) -> f64) -> Vec<Polygon> {
    let corner =
        |i: usize| size(i) * DVec2::from_angle(turn + std::f64::consts::FRAC_PI_4 * i as f64);
    vec![Polygon { outer: (0..8).map(corner).collect(), holes: Vec::new() }]
}

/// The solution of each load lies within its bounds, where it has some, from starts far away.
#[test]
fn solutions_lie_within_the_bounds() {
    let contact = Contact {
        face_i: octagon(0.1, |i| 0.01 + 0.001 * (i % 3) as f64),
        face_ii: octagon(0.4, |i| 0.011 - 0.0013 * (i % 2) as f64),
    };
    let (pads, force, distance) = (Pads::new(&contact).unwrap(), 40.0, 0.02);
    let wrench = |i: usize| {
        let t = 0.37 * i as f64;
        Wrench {
            force: 8.0 * DVec3::new(t.cos(), (1.7 * t).sin(), 0.4 * (2.3 * t).sin()),
            moment: DVec3::new(0.02 * t.sin(), 0.02 * (0.6 * t).cos(), 0.08 * (2.0 * t).sin()),
        }
    };
    let mut given = Vec::new();
    let mut exact = Vec::new();
    for i in 0..61 {
        let score = solve_pads(&pads, distance, force, &wrench(i), &Options::default());
        assert_eq!(score.status, Status::Ok);
        // Away from the solution: by the load alone.
        let load = pads.load(distance, force, &wrench(i));
        let w = load.direction;
        given.push((load, Twist { u1: w.f1, u2: w.f2, omega: 3.0 * w.m3 }));
        exact.push((score.mu_s.unwrap(), score.bounds.unwrap()));
    }
    let found = bounds(&pads, &given);
    let mut close = 0;
    for (found, (mu, certain)) in found.iter().zip(&exact) {
        let Some([least, most]) = found else { continue };
        assert!(*least <= certain.upper && certain.lower <= *most, "{found:?} {mu}");
        close += usize::from(most - least <= 0.05 * mu);
    }
    // Newton's method contracts at once from a third of these far starts.
    assert!(close > 20, "{close} of 61 loads have close bounds");
}
/// The solutions of loads that lift a pad somewhere lie within their bounds, from the states of loads
/// like them and of others; with patience more of them have some.
#[test]
fn solutions_of_loads_that_lift_a_pad_lie_within_the_bounds() {
    // As far as the areas lie over each other, and beside each other by half their size, where the
    // squeeze alone lifts both.
    let mut found = [[0; 3]; 2];
    for (aside, counts) in [0.0, 0.01].into_iter().zip(&mut found) {
        let mut contact = Contact {
            face_i: octagon(0.1, |i| 0.01 + 0.001 * (i % 3) as f64),
            face_ii: octagon(0.4, |i| 0.011 - 0.0013 * (i % 2) as f64),
        };
        contact.face_ii[0].outer.iter_mut().for_each(|x| x.x += aside);
        *counts = lifting_loads(&contact);
    }
    assert!(found[0][0] > 100 && found[0][2] > 50, "{found:?}");
    assert!(found[1][0] > 100 && found[1][1] > found[1][0] + 50, "{found:?}");
}

/// Loads that lift a pad with bounds found quickly, found patiently, and of these those that lift
/// both; none may be wrong.
fn lifting_loads(contact: &Contact) -> [usize; 3] {
    let (pads, force, distance) = (Pads::new(contact).unwrap(), 40.0, 0.02);
    let areas = [&contact.face_i, &contact.face_ii].map(|face| crate::geometry::patch_area(face));
    let options = Options::default();
    let wrench = |i: usize| {
        let t = 0.37 * i as f64;
        let size = 0.01 * (1 + i % 23) as f64;
        Wrench {
            force: 4.0 * DVec3::new(t.cos(), (1.7 * t).sin(), 0.5 * (0.9 * t).cos()),
            moment: DVec3::new(size * t.sin(), size * t.cos(), 0.05),
        }
    };
    let mut solved = Vec::new();
    for i in 0..230 {
        let mut start = None;
        let score = solve_next(&pads, distance, force, &wrench(i), &options, &mut start);
        let load = pads.load(distance, force, &wrench(i));
        let near = start.and_then(|start| Neighbour::at(&pads, &load, start));
        if let (Some(mu), Some(near), Status::Ok) = (score.mu_s, near, score.status) {
            let left = [score.contact_area_i, score.contact_area_ii];
            let lifts = left.iter().zip(areas).filter(|(left, whole)| **left < *whole * 0.999);
            solved.push((load, mu, near, lifts.count()));
        }
    }
    let mut comparer = Comparer::new(&pads, force);
    let [mut bounded, mut patiently, mut both] = [0; 3];
    for (begin, some) in solved.chunks(ABREAST).enumerate() {
        let loads: Vec<Load> = some.iter().map(|(load, ..)| *load).collect();
        for shift in [1, 5, 11, 17, 40] {
            let near = |i: usize| &solved[(ABREAST * begin + i + shift) % solved.len()].2;
            let question = Question::of(0.0, 2e-4);
            let quick = comparer.several(&loads, near, &options, (question, false));
            let found = comparer.several(&loads, near, &options, (question, true));
            for (i, (_, mu, _, lifts)) in some.iter().enumerate() {
                for [least, most] in [quick[i], found[i]].into_iter().flatten() {
                    assert!(least <= *mu && *mu <= most, "{least} {mu} {most}");
                }
                if *lifts > 0 {
                    bounded += usize::from(quick[i].is_some());
                    patiently += usize::from(found[i].is_some());
                    both += usize::from(found[i].is_some() && *lifts == 2);
                }
            }
        }
    }
    [bounded, patiently, both]
}

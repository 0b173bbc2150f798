//! What looks like a curved face and is none: bars, gears, ellipses, and noise on them.

use std::f64::consts::{PI, TAU};

use glam::DVec2;
use gripfast::part::Shape;

use crate::solids::{Solid, arc};

/// Flank of an involute from its base circle outwards, mirrored on request.
fn involute(base: f64, from: f64, to: f64, steps: u32) -> Vec<DVec2> {
    let at = |k: u32| from + (to - from) * f64::from(k) / f64::from(steps);
    (0..=steps)
        .map(|k| {
            let roll = at(k);
            DVec2::from_angle(roll) * base - DVec2::from_angle(roll).perp() * base * roll
        })
        .collect()
}

#[test]
fn what_is_no_curve_is_taken_for_none() {
    let regular = |n: u32, radius: f64| arc(DVec2::ZERO, radius, 0.0, TAU, n)[1..].to_vec();
    // Hexagonal and square bars, and a square bar whose chamfers have their corners on a circle.
    for outline in [regular(6, 10.0), regular(4, 10.0)] {
        let part = Solid::extrude(&outline, 30.0).part(1, 0.0);
        assert_eq!((part.curved.len(), part.faces.len()), (0, outline.len() + 2));
    }
    for chamfer in [0.5, 2.0, 4.0] {
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
        let outline: Vec<DVec2> = corners
            .iter()
            .flat_map(|&(x, y)| {
                let corner = DVec2::new(10.0 * x, 10.0 * y);
                let (along, across) = (DVec2::new(x, 0.0) * chamfer, DVec2::new(0.0, y) * chamfer);
                if x * y > 0.0 {
                    [corner - across, corner - along]
                } else {
                    [corner - along, corner - across]
                }
            })
            .collect();
        let part = Solid::extrude(&outline, 30.0).part(1, 0.0);
        assert!(part.health.watertight);
        assert_eq!((part.curved.len(), part.faces.len()), (0, 10), "chamfer {chamfer}");
    }
    // A gear of 18 involute teeth: the flanks' curvature changes.
    for steps in [3, 5, 9, 20, 60] {
        let base = 16.9_f64;
        let (root, tip) = (17.0 / base, 20.0 / base);
        let [from, to] = [root, tip].map(|share| (share * share - 1.0).sqrt());
        let mut outline = Vec::new();
        for tooth in 0..18 {
            let turn = DVec2::from_angle(TAU * f64::from(tooth) / 18.0);
            let half = DVec2::from_angle(-0.1);
            let flank: Vec<DVec2> =
                involute(base, from, to, steps).iter().map(|point| half.rotate(*point)).collect();
            outline.extend(flank.iter().map(|point| turn.rotate(*point)));
            outline.extend(flank.iter().rev().map(|p| turn.rotate(DVec2::new(p.x, -p.y))));
        }
        let part = Solid::extrude(&outline, 12.0).part(1, 0.0);
        assert!(part.health.watertight, "{steps}: {:?}", part.health.lines());
        let found: Vec<&Shape> = part.curved.iter().map(|face| &face.shape).collect();
        assert!(found.is_empty(), "{steps} strips to the flank: {} {:?}", found.len(), found[0]);
    }
    // An elliptic bar: no part of it is a circle.
    for n in [36, 90, 240] {
        let outline: Vec<DVec2> =
            regular(n, 1.0).iter().map(|point| *point * DVec2::new(20.0, 11.0)).collect();
        let part = Solid::extrude(&outline, 30.0).part(1, 0.0);
        let found: Vec<&Shape> = part.curved.iter().map(|face| &face.shape).collect();
        assert_eq!(found, [&Shape::Freeform], "{n}");
    }
}

/// A gear of module 2 and 24 teeth: flanks of so many strips from the base circle, on straight feet.
fn gear(strips: u32) -> Vec<DVec2> {
    let (root, base, tip) = (21.5, 24.0 * 20.0_f64.to_radians().cos(), 26.0);
    // Half the angle of a tooth at a radius.
    let half = |radius: f64| {
        let involute = |angle: f64| angle.tan() - angle;
        PI / 48.0 + involute(20.0_f64.to_radians()) - involute((base / radius).min(1.0).acos())
    };
    let radii = (0..=strips).map(|k| base + (tip - base) * f64::from(k) / f64::from(strips));
    let flank: Vec<(f64, f64)> = radii.map(|radius| (radius, half(radius))).collect();
    let mut outline = Vec::new();
    for tooth in 0..24 {
        let middle = TAU * f64::from(tooth) / 24.0;
        let mut at =
            |radius: f64, turn: f64| outline.push(radius * DVec2::from_angle(middle + turn));
        at(root, -half(base));
        flank.iter().for_each(|&(radius, half)| at(radius, -half));
        (1..6).for_each(|k| at(tip, (f64::from(k) / 3.0 - 1.0) * half(tip)));
        flank.iter().rev().for_each(|&(radius, half)| at(radius, half));
        at(root, half(base));
        let gap = TAU / 24.0 - 2.0 * half(base);
        (1..8).for_each(|k| at(root, half(base) + gap * f64::from(k) / 8.0));
    }
    outline
}

/// Some corners of a flank and its foot lie near a circle by chance: nearer than noise can tell.
#[test]
fn noise_makes_no_flank_of_a_gear_round() {
    for strips in [4, 5, 8, 16] {
        for noise in [0.0, 2e-4, 5e-4, 2e-3] {
            let part = Solid::extrude(&gear(strips), 12.0).part(1, noise);
            assert!(part.health.watertight, "{strips}: {:?}", part.health.lines());
            let round = part.curved.iter().filter(|face| face.shape != Shape::Freeform);
            let found: Vec<&Shape> = round.map(|face| &face.shape).collect();
            assert!(found.is_empty(), "{strips} strips, noise {noise}: {} {found:?}", found.len());
        }
    }
}

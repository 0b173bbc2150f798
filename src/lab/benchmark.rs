//! A benchmark for simulators: grips whose smallest friction is known exactly, with geometry and
//! loads that any engine can be given.
//!
//! Every answer is a closed form of the integrals of a rigid body about to turn or slide between two
//! flat faces under uniform pressure, worked out here without the solver; [`Case::solved`] is what the
//! solver says.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use serde::Serialize;

use crate::error::Result;
use crate::mechanics::{Options, solve};
use crate::model::{Contact, Polygon, Ring, Wrench};

/// Marks the file.
pub const FORMAT: &str = "gripfast-benchmark";
/// Version of its layout.
pub const VERSION: u32 = 1;

/// Side of the square \[m\], and distance of the faces.
const SIDE: f64 = 0.02;
/// Gripping force of one jaw \[N\].
const FORCE: f64 = 50.0;

/// One grip.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Case {
    /// Short name.
    pub id: &'static str,
    /// What it is.
    pub text: &'static str,
    /// The part between the pads: convex rings in the pad plane `(x1, x2)` \[m\], side by side, each
    /// the base of a prism from `x3 = -distance/2` to `distance/2`. The pads cover all of them.
    pub pieces: Vec<Ring>,
    /// Distance of the faces \[m\].
    pub distance: f64,
    /// Gripping force of one jaw \[N\].
    pub force: f64,
    /// Load on the part about the origin, which lies midway between the pads.
    pub load: Wrench,
    /// Smallest friction coefficient that holds it.
    pub mu_s: f64,
    /// How that is known.
    pub formula: &'static str,
    /// What [`solve`] says.
    pub solved: Option<f64>,
}

/// The file: all cases with what they have in common.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Benchmark {
    /// Always [`FORMAT`].
    pub format: &'static str,
    /// Always [`VERSION`].
    pub version: u32,
    /// Units and frames.
    pub conventions: &'static str,
    /// The cases.
    pub cases: Vec<Case>,
}

/// The benchmark, solved.
///
/// # Errors
/// Never for these cases; passed on from the solver.
pub fn benchmark() -> Result<Benchmark> {
    let mut cases = cases();
    for case in &mut cases {
        let patch: Vec<Polygon> = case
            .pieces
            .iter()
            .map(|outer| Polygon { outer: outer.clone(), holes: Vec::new() })
            .collect();
        let contact = Contact { face_i: patch.clone(), face_ii: patch };
        let score = solve(&contact, case.distance, case.force, &case.load, &Options::default())?;
        case.solved = score.mu_s;
    }
    Ok(Benchmark {
        format: FORMAT,
        version: VERSION,
        conventions: "SI units; right-handed; x3 closes the jaws, x1 and x2 lie in the pad planes at \
                      x3 = +-distance/2; each pad is a rigid plane pressed on with `force` along x3, \
                      with uniform pressure; `load` acts on the part about the origin; gravity is off",
        cases,
    })
}

fn cases() -> Vec<Case> {
    let square = rectangle(DVec2::ZERO, DVec2::splat(SIDE));
    let turn = |moment: f64| wrench([0.0; 3], [0.0, 0.0, moment]);
    let case = |id, text, pieces, load, mu_s, formula| Case {
        id,
        text,
        pieces,
        distance: SIDE,
        force: FORCE,
        load,
        mu_s,
        formula,
        solved: None,
    };
    // mu_s of a moment about the middle, by the mean distance from there.
    let by_radius = |moment: f64, radius: f64| moment / (2.0 * FORCE * radius);
    let of_square = 4.0 * corner(SIDE / 2.0, SIDE / 2.0) / (SIDE * SIDE);
    let of_bar = 4.0 * corner(0.02, 0.005) / (0.04 * 0.01);
    let hole = SIDE / 2.0;
    let of_hollow = 4.0 * (corner(SIDE / 2.0, SIDE / 2.0) - corner(hole / 2.0, hole / 2.0))
        / (SIDE * SIDE - hole * hole);
    let of_two = 4.0 * (corner(0.02, 0.005) - corner(0.01, 0.005)) / (2.0 * 0.01 * 0.01);
    // Of a regular octagon with this distance of the sides from the middle.
    let (apothem, half) = (0.01, PI / 8.0);
    let of_octagon = apothem / (3.0 * half.tan()) * (half.tan() / half.cos() + half.tan().asinh());
    let octagon: Ring = (0..8)
        .map(|k| apothem / half.cos() * DVec2::from_angle(half * f64::from(2 * k + 1)))
        .collect();
    let mu = 0.25;
    vec![
        case(
            "square_turn",
            "a square turned about the closing axis",
            vec![square.clone()],
            turn(0.2),
            by_radius(0.2, of_square),
            "M / (2 Fn r), r = a (sqrt 2 + asinh 1) / 6",
        ),
        case(
            "square_slide",
            "a square pulled along the pads",
            vec![square.clone()],
            wrench([9.0, 12.0, 0.0], [0.0; 3]),
            15.0 / (2.0 * FORCE),
            "|F| / (2 Fn)",
        ),
        case(
            "square_pushed",
            "a square turned while a force along the closing axis loads one pad more",
            vec![square.clone()],
            wrench([0.0, 0.0, 40.0], [0.0, 0.0, 0.2]),
            by_radius(0.2, of_square),
            "as square_turn: the normal forces Fn + F3/2 and Fn - F3/2 add up to 2 Fn",
        ),
        case(
            "square_tilted",
            "a square turned while a moment tilts the pressure, both pads in full contact",
            vec![square.clone()],
            wrench([0.0; 3], [0.1, 0.0, 0.2]),
            by_radius(0.2, of_square),
            "as square_turn: the slopes of the two pressures cancel",
        ),
        case(
            "bar_turn",
            "a bar of 40 x 10 mm turned about the closing axis",
            vec![rectangle(DVec2::ZERO, DVec2::new(0.04, 0.01))],
            turn(0.2),
            by_radius(0.2, of_bar),
            "M / (2 Fn r), r = q/6 + a^2/(12 b) asinh(b/a) + b^2/(12 a) asinh(a/b), q^2 = a^2 + b^2",
        ),
        case(
            "octagon_turn",
            "a regular octagon, 20 mm across its sides, turned about the closing axis",
            vec![octagon],
            turn(0.2),
            by_radius(0.2, of_octagon),
            "M / (2 Fn r), r = h/3 (1/cos t + asinh(tan t)/tan t), t = pi/8",
        ),
        case(
            "hollow_turn",
            "a square with a square hole of half its side, turned about the closing axis",
            frame(SIDE, hole),
            turn(0.2),
            by_radius(0.2, of_hollow),
            "M / (2 Fn r), r of the square less that of the hole, by area",
        ),
        case(
            "separated_turn",
            "two squares of 10 mm, 30 mm apart from middle to middle, turned about the middle",
            vec![
                rectangle(DVec2::new(-0.015, 0.0), DVec2::splat(0.01)),
                rectangle(DVec2::new(0.015, 0.0), DVec2::splat(0.01)),
            ],
            turn(0.2),
            by_radius(0.2, of_two),
            "M / (2 Fn r), r of the outer less that of the inner rectangle, by area",
        ),
        case(
            "square_corner",
            "a square about to turn about its corner: a force and a moment together",
            vec![square.clone()],
            about_corner(mu),
            mu,
            "the integrals of the slip direction about a corner",
        ),
        case(
            "square_edge",
            "a square about to turn about the middle of an edge",
            vec![square],
            about_edge(mu),
            mu,
            "the integrals of the slip direction about the middle of an edge",
        ),
    ]
}

/// `int r dA` over the rectangle from the origin to `(x, y)`.
fn corner(x: f64, y: f64) -> f64 {
    x * y * x.hypot(y) / 3.0 + x.powi(3) / 6.0 * (y / x).asinh() + y.powi(3) / 6.0 * (x / y).asinh()
}

/// `int x/r dA` over the rectangle from the origin to `(x, y)`.
fn pull(x: f64, y: f64) -> f64 {
    (y * x.hypot(y) + x * x * (y / x).asinh() - y * y) / 2.0
}

/// The load under which the square turns about its corner `(a/2, a/2)` at this friction.
fn about_corner(mu: f64) -> Wrench {
    let (a, h) = (SIDE, SIDE / 2.0);
    let along = pull(a, a);
    let scale = 2.0 * mu * FORCE / (a * a);
    // About the corner the slip direction is (-y, x)/r with x, y in -a..0.
    let force = [along, -along, 0.0].map(|value| value * scale);
    wrench(force, [0.0, 0.0, scale * (corner(a, a) - 2.0 * h * along)])
}

/// The load under which the square turns about the middle `(a/2, 0)` of an edge at this friction.
fn about_edge(mu: f64) -> Wrench {
    let (a, h) = (SIDE, SIDE / 2.0);
    let across = -2.0 * pull(a, h);
    let scale = 2.0 * mu * FORCE / (a * a);
    wrench([0.0, scale * across, 0.0], [0.0, 0.0, scale * (2.0 * corner(a, h) + h * across)])
}

fn wrench(force: [f64; 3], moment: [f64; 3]) -> Wrench {
    Wrench { force: DVec3::from_array(force), moment: DVec3::from_array(moment) }
}

fn rectangle(middle: DVec2, size: DVec2) -> Ring {
    [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
        .map(|(x, y)| middle + size * DVec2::new(x, y))
        .to_vec()
}

/// A square with a square hole, in four rectangles.
fn frame(side: f64, hole: f64) -> Vec<Ring> {
    let wall = (side - hole) / 2.0;
    let off = (side + hole) / 4.0;
    vec![
        rectangle(DVec2::new(0.0, -off), DVec2::new(side, wall)),
        rectangle(DVec2::new(0.0, off), DVec2::new(side, wall)),
        rectangle(DVec2::new(-off, 0.0), DVec2::new(wall, hole)),
        rectangle(DVec2::new(off, 0.0), DVec2::new(wall, hole)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solver_agrees_with_every_closed_form() {
        let benchmark = benchmark().unwrap();
        assert_eq!(benchmark.cases.len(), 10);
        for case in &benchmark.cases {
            let solved = case.solved.unwrap_or(f64::NAN);
            assert!((solved / case.mu_s - 1.0).abs() < 1e-9, "{}: {solved} {}", case.id, case.mu_s);
        }
    }

    /// Against midpoint sums, which know nothing of the closed forms.
    #[test]
    fn the_closed_forms_are_their_integrals() {
        let sum = |x: f64, y: f64, value: &dyn Fn(DVec2) -> f64| {
            let n = 400;
            let step = DVec2::new(x, y) / f64::from(n);
            let cells = (0..n * n).map(|cell| {
                value(step * (DVec2::new(f64::from(cell % n), f64::from(cell / n)) + 0.5))
            });
            cells.sum::<f64>() * step.x * step.y
        };
        for (x, y) in [(0.02, 0.02), (0.02, 0.005), (0.01, 0.03)] {
            let radius = sum(x, y, &|at| at.length());
            assert!((corner(x, y) / radius - 1.0).abs() < 1e-5, "{x} {y}");
            let share = sum(x, y, &|at| at.x / at.length());
            assert!((pull(x, y) / share - 1.0).abs() < 1e-5, "{x} {y}");
        }
    }
}

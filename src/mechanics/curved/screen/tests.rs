use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::contact::surface::{Piece, Surfaces};
use crate::model::{Gap, Status, Wrench};

/// A ball by its facets, of which each touches it in its middle.
fn facets(radius: f64, [x, y]: [f64; 2], off: f64) -> Vec<Piece> {
    let side = |k: i32, half: f64| half * (f64::from(k) / 6.0);
    let cells = (-6..6).flat_map(|i| (-6..6).map(move |j| (i, j)));
    let cell = |(i, j): (i32, i32)| {
        let outer: Vec<DVec2> = [(0, 0), (1, 0), (1, 1), (0, 1)]
            .map(|(a, b)| DVec2::new(side(i + a, x) + off, side(j + b, y)))
            .to_vec();
        let at = 0.25 * outer.iter().sum::<DVec2>();
        let gap = Gap::Plane { height: -0.5 * at.length_squared() / radius, slope: at / radius };
        Piece { outer, holes: Vec::new(), gap }
    };
    cells.map(cell).collect()
}

/// Both faces alike, of a cylinder, a ball, a cone, planes or a ball's facets, or a plane opposite a
/// cylinder or a ball, with their distance.
fn surfaces(kind: u32, half: [f64; 2], off: f64) -> (Surfaces, f64) {
    let radius = 0.01;
    let (axis, at, height) = (DVec2::X, DVec2::ZERO, 0.0);
    let gap = match kind {
        0 | 5 => Gap::Cylinder { radius, axis, at, height },
        1 | 6 => Gap::Sphere { radius, at, height },
        2 => Gap::Cone { radius, slope: 2e-3, axis, at, height },
        _ => Gap::default(),
    };
    let [x, y] = half;
    let outer = [(-x, -y), (x, -y), (x, y), (-x, y)].map(|(a, b)| DVec2::new(a + off, b)).to_vec();
    let piece = Piece { outer, holes: Vec::new(), gap };
    let pieces = if kind == 4 { facets(radius, half, off) } else { vec![piece] };
    let (face_i, mut face_ii) = (pieces.clone(), pieces);
    if kind > 4 {
        face_ii[0].gap = Gap::default();
    }
    (Surfaces { face_i, face_ii, stiffness: [5e9, 3e9], layer: None }, 2.0 * radius)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// What the floors leave out is held at less, and what they say rolls has that friction.
    #[test]
    fn what_is_below_is_below(
        kind in 0..7_u32,
        half in [0.004..0.012_f64, 0.006..0.01_f64],
        off in -0.004..0.004_f64,
        loads in prop::collection::vec(
            (prop::array::uniform3(-1.0..1.0_f64), prop::array::uniform3(-1.0..1.0_f64)), MANY,
        ),
        size in 0.5..40.0_f64,
        share in 0.2..3.0_f64,
    ) {
        let (surfaces, distance) = surfaces(kind, half, off);
        let pads = Pads::new(&surfaces).unwrap();
        let force = 200.0;
        let wrenches: Vec<Wrench> = loads
            .into_iter()
            .map(|(f, m)| Wrench {
                force: size * DVec3::from(f),
                moment: 0.01 * size * DVec3::from(m),
            })
            .collect();
        let screen = pads.screen(distance, force, &wrenches);
        prop_assert!(screen.is_some() || kind > 4);
        let Some(mut screen) = screen else { return Ok(()) };
        for wrench in &wrenches {
            let Some(mu) = pads.score(distance, force, wrench).mu_s else { continue };
            match screen.compare(wrench, share * mu) {
                Compared::Below => prop_assert!(share > 1.0, "{mu} is not below {}", share * mu),
                Compared::At(found) => prop_assert!((found / mu - 1.0).abs() < 1e-9, "{found} {mu}"),
                Compared::Open => {}
            }
        }
    }
}

/// Loads with forces and moments along all axes.
fn loads(count: u32) -> Vec<Wrench> {
    let load = |i| {
        let turn = |by: f64| (by * f64::from(i)).sin();
        let force = 4.0 * DVec3::new(turn(1.3), turn(2.1), turn(0.7));
        Wrench { force, moment: 0.02 * DVec3::new(turn(3.1), turn(1.9), turn(2.7)) }
    };
    (0..count).map(load).collect()
}

/// On a shaft with a round end, gripped where it ends, no axis is held by more than the roundness, and the
/// stiffness about one is no line in the pull: loads are compared all the same.
#[test]
fn loads_on_a_round_end_are_compared() {
    let radius = 0.008;
    let strip = |[low, high]: [f64; 2], gap: Gap| {
        let outer = [(low, -0.004), (high, -0.004), (high, 0.004), (low, 0.004)];
        Piece { outer: outer.map(DVec2::from).to_vec(), holes: Vec::new(), gap }
    };
    let at = DVec2::new(0.003, 0.0);
    let side = vec![
        strip([-0.01, at.x], Gap::Cylinder { radius, axis: DVec2::X, at, height: 0.0 }),
        strip([at.x, 0.008], Gap::Sphere { radius, at, height: 0.0 }),
    ];
    let (face_i, face_ii) = (side.clone(), side);
    let (stiffness, distance, force) = ([5e9; 2], 2.0 * radius, 200.0);
    let pads = Pads::new(&Surfaces { face_i, face_ii, stiffness, layer: None }).unwrap();
    let wrenches = loads(100);
    let mut screen = pads.screen(distance, force, &wrenches).unwrap();
    assert_eq!(screen.rolling.len(), 1);
    let (_, stiffness) = &screen.rolling[0];
    let bend = stiffness.at(4.0) + stiffness.at(-4.0) - 2.0 * stiffness.at(0.0);
    assert!(bend.abs() > 1e-6 * stiffness.at(0.0), "{bend:e}");
    let mut compared = 0;
    for wrench in &wrenches {
        let mu = pads.score(distance, force, wrench).mu_s.unwrap();
        if let Compared::At(found) = screen.compare(wrench, 0.0) {
            assert!((found / mu - 1.0).abs() < 1e-9, "{found} {mu}");
            compared += 1;
        }
        assert_ne!(screen.compare(wrench, 0.999 * mu), Compared::Below);
    }
    assert!(compared > 90, "{compared}");
}

/// Most loads far below the value never reach Newton's method.
#[test]
fn floors_take_most_loads() {
    for (kind, off) in [(0, 0.0), (1, 0.0), (4, 0.0), (4, 0.001)] {
        let (surfaces, distance) = surfaces(kind, [0.01, 0.008], off);
        let pads = Pads::new(&surfaces).unwrap();
        let wrenches = loads(200);
        let mut screen = pads.screen(distance, 200.0, &wrenches).unwrap();
        let mut taken = 0;
        for wrench in &wrenches {
            let mu = pads.score(distance, 200.0, wrench).mu_s.unwrap();
            let normal = [200.0 + 0.5 * wrench.force.z, 200.0 - 0.5 * wrench.force.z];
            (screen.problem.normal, screen.problem.wrench) = (normal, *wrench);
            let below =
                screen.floors.as_ref().and_then(|floors| floors.below(&screen.problem, 2.0 * mu));
            assert!(below.is_none_or(|below| below >= mu));
            taken += usize::from(below.is_some());
        }
        assert!(taken > 150, "{kind}: {taken}");
    }
}

/// Where a plane opposite something round is moved by its tilt, most loads are compared too, many of them
/// with another `mu_s` for it.
#[test]
fn loads_on_what_rolls_are_compared() {
    let (mut compared, mut moved, mut below) = (0, 0, 0);
    for (kind, off) in [(5, 0.0), (5, 0.003), (6, 0.0), (6, 0.003)] {
        let (surfaces, distance) = surfaces(kind, [0.01, 0.008], off);
        let pads = Pads::new(&surfaces).unwrap();
        let wrenches = loads(100);
        let mut screen = pads.screen(distance, 200.0, &wrenches).unwrap();
        for wrench in &wrenches {
            let answer = pads.solve_pushed(distance, 200.0, wrench);
            let mu = answer.score.mu_s.unwrap();
            let without = pads.solve(distance, 200.0, wrench).score.mu_s.unwrap();
            moved += usize::from((mu / without - 1.0).abs() > 0.01);
            if let Compared::At(found) = screen.compare(wrench, 0.0) {
                assert!((found / mu - 1.0).abs() < 1e-9, "{kind} {off}: {found} {mu}");
                compared += 1;
            }
            below += usize::from(screen.compare(wrench, 1.5 * mu) == Compared::Below);
            assert_ne!(screen.compare(wrench, 0.999 * mu), Compared::Below);
        }
    }
    println!("{compared} compared, {moved} moved, {below} below");
    assert!(compared > 300 && moved > 50 && below > 200);
}

/// A load that tilts a plane far over a ball has several limit states: the one that it comes to as it grows
/// counts, compared or solved, until there is none next to it.
#[test]
fn a_load_that_grows_stays_on_its_branch() {
    let (surfaces, distance) = surfaces(6, [0.004, 0.0085], -0.002);
    let pads = Pads::new(&surfaces).unwrap();
    let load = |share: f64| Wrench {
        force: share * DVec3::new(-5.9, -32.4, -33.0),
        moment: share * DVec3::new(-0.26, 0.183, -0.154),
    };
    let mut known = pads.screen(distance, 200.0, &[load(1.0)]).unwrap();
    let mut before: Option<f64> = None;
    let mut tilt = 0.0;
    for i in 8..=38 {
        let wrench = load(f64::from(i) / 40.0);
        let answer = pads.solve_pushed(distance, 200.0, &wrench);
        let mu = answer.score.mu_s.unwrap();
        assert!(before.is_none_or(|before| mu > before && mu < 1.06 * before), "{before:?} {mu}");
        if let Compared::At(found) = known.compare(&wrench, 1e-3) {
            assert!((found / mu - 1.0).abs() < 1e-9, "{found} {mu}");
        }
        (before, tilt) = (Some(mu), DVec2::from(answer.tilt.unwrap()).length());
    }
    assert!(tilt > 0.4, "{tilt}");
    assert_eq!(pads.score(distance, 200.0, &load(1.0)).status, Status::TwistedOut);
}

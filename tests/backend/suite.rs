//! One suite for both backends: bounds against the exact solver, degenerate input, batch sizes,
//! order, repeatability.
//!
//! The GPU half runs on any adapter, software included; without one it says SKIPPED, or fails under
//! `GRIPFAST_GPU=require`.

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use gripfast::backend::{
    Backend, Batch, Best, F32_TOLERANCE, LOAD_TOLERANCE, Polish, Pose, Problem, ScoreOptions,
    Scored, Seed, SeedSet, SeedStatus,
};
use gripfast::contact::{Field, Loops};
use gripfast::geometry::patch_area;
use gripfast::load::wrench_in_grip;
use gripfast::mechanics::{self, Options, slip};
use gripfast::model::{Contact, Frame, Patch, Polygon, Wrench};

use crate::support::random::Random;

/// Largest relative difference allowed between the bounds of two backends: each widens them for single
/// precision, and a graphics processor for its loads too.
const TOLERANCE: f64 = 2.0 * F32_TOLERANCE + LOAD_TOLERANCE;

pub(crate) fn gpu() -> Option<Backend> {
    #[cfg(feature = "gpu")]
    {
        use gripfast::backend::{ADAPTER_VARIABLE, Choice, list_adapters, select};
        let required = std::env::var("GRIPFAST_GPU").as_deref() == Ok("require");
        let named = std::env::var(ADAPTER_VARIABLE).ok();
        match list_adapters().first() {
            Some(_) => {
                let selection = select(Choice::Gpu, Some(named.as_deref().unwrap_or("0"))).unwrap();
                crate::support::say(&selection.reason);
                return Some(selection.backend);
            }
            None => assert!(!required, "GRIPFAST_GPU=require, but there is no graphics adapter"),
        }
    }
    crate::support::say("SKIPPED: no graphics adapter, not even a software one");
    None
}

impl Random {
    fn wrench(&mut self, force: f64, arm: f64) -> Wrench {
        let size = force * 10_f64.powf(self.range(-2.0, 0.0));
        Wrench { force: self.vector() * size, moment: self.vector() * size * arm }
    }

    /// A star-shaped polygon, sometimes with a hole, perhaps stretched.
    fn patch(&mut self, size: f64) -> Patch {
        let corners = 3 + (self.unit() * 8.0) as usize;
        let (centre, turn, flat) = (
            DVec2::new(self.range(-1.0, 1.0), self.range(-1.0, 1.0)) * size,
            self.unit(),
            self.range(0.15, 1.0),
        );
        let mut ring = |low: f64, high: f64| -> Vec<DVec2> {
            (0..corners)
                .map(|i| {
                    let angle = (i as f64 + turn + self.range(-0.2, 0.2)) / corners as f64
                        * std::f64::consts::TAU;
                    centre
                        + DVec2::from_angle(angle)
                            * size
                            * self.range(low, high)
                            * DVec2::new(1.0, flat)
                })
                .collect()
        };
        let outer = ring(0.5, 1.0);
        let hole = ring(0.1, 0.2);
        let holes = if corners > 5 { vec![hole] } else { vec![] };
        vec![Polygon { outer, holes }]
    }

    /// Two rectangles of which one hangs over an edge.
    fn similar(&mut self, size: f64) -> Arc<Contact> {
        let (a, b) = (size, size * self.range(0.3, 1.0));
        let cut = a * self.range(0.0, 0.5);
        Arc::new(Contact {
            face_i: rectangle(a, b, DVec2::ZERO),
            face_ii: rectangle(a - cut, b, DVec2::new(-cut / 2.0, 0.0)),
        })
    }

    fn congruent(&mut self, size: f64) -> Arc<Contact> {
        let face = self.patch(size);
        Arc::new(Contact { face_i: face.clone(), face_ii: face })
    }
}

fn rectangle(a: f64, b: f64, centre: DVec2) -> Patch {
    let corners =
        [(-a, -b), (a, -b), (a, b), (-a, b)].map(|(x, y)| centre + DVec2::new(x, y) / 2.0);
    vec![Polygon { outer: corners.to_vec(), holes: vec![] }]
}

fn congruent(patch: Patch) -> Arc<Contact> {
    Arc::new(Contact { face_i: patch.clone(), face_ii: patch })
}

/// Unit forces spread over the sphere, acting at `point`.
fn ball(count: usize, point: DVec3) -> Vec<Wrench> {
    gripfast::geometry::sphere::directions(count)
        .into_iter()
        .map(|force| Wrench { force, moment: point.cross(force) })
        .collect()
}

fn seed(backend: &Backend, problems: Vec<Problem<'_>>, set: &SeedSet) -> Vec<Seed> {
    backend.seed(&Batch { problems }, set).unwrap()
}

fn assert_agrees(found: &[Seed], expected: &[Seed]) {
    if let Err(why) = agrees(found, expected) {
        panic!("{why}");
    }
}

fn agrees(found: &[Seed], expected: &[Seed]) -> Result<(), String> {
    if found.len() != expected.len() {
        return Err(format!("{} seeds instead of {}", found.len(), expected.len()));
    }
    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
        let close = |x: f64, y: f64| x == y || (x - y).abs() <= TOLERANCE * x.abs().max(y.abs());
        // Whether a load is a hair inside full contact may differ; the numbers may not.
        let same = a.status == b.status
            && close(a.lower, b.lower)
            && (close(a.upper, b.upper) || (a.upper / b.upper - 1.0).abs() < 0.1);
        let hair = a.status != b.status
            && (a.status == SeedStatus::Unbounded || b.status == SeedStatus::Unbounded);
        let finite = a.twist.is_finite()
            && a.lower.is_finite()
            && a.estimate.is_finite()
            && !a.upper.is_nan();
        if !(same || hair) || !finite {
            return Err(format!("load {i}: {a:?} instead of {b:?}"));
        }
    }
    Ok(())
}

#[test]
fn the_comparer_sees_one_wrong_number() {
    let right = Seed {
        status: SeedStatus::Bounded,
        twist: [0.1, 0.2, 3.0].into(),
        lower: 0.5,
        upper: 0.51,
        estimate: 0.5,
    };
    assert!(agrees(&[right; 3], &[right; 3]).is_ok());
    let wrong = [
        Seed { lower: 0.5004, ..right },
        Seed { upper: 0.6, ..right },
        Seed { upper: f64::NAN, ..right },
        Seed { twist: [0.1, f64::NAN, 3.0].into(), ..right },
        Seed { status: SeedStatus::NoContact, ..right },
    ];
    for wrong in wrong {
        assert!(agrees(&[right, wrong, right], &[right; 3]).is_err(), "{wrong:?}");
    }
    assert!(agrees(&[right; 2], &[right; 3]).is_err());
}

/// The bounds enclose the exact answer; counts the loads with bounds on congruent and on different
/// faces, and all loads.
fn assert_bounds(seeds: &[Seed], problem: &Problem<'_>) -> [usize; 3] {
    let mut count = [0; 3];
    for (seed, wrench) in seeds.iter().zip(problem.wrenches) {
        if !matches!(seed.status, SeedStatus::Bounded | SeedStatus::Coupled) {
            assert!(seed.lower == 0.0 && seed.upper == f64::INFINITY, "{seed:?}");
            continue;
        }
        let score = mechanics::solve(
            problem.contact,
            problem.distance,
            problem.force,
            wrench,
            &Options::default(),
        )
        .unwrap();
        let mu = score.mu_s.unwrap_or(f64::NAN);
        assert!(
            score.status.holds() && seed.lower <= mu && mu <= seed.upper,
            "{seed:?}\n{score:?}\n{problem:?}\n{wrench:?}"
        );
        count[usize::from(seed.status == SeedStatus::Coupled)] += 1;
    }
    count[2] = seeds.len();
    count
}

fn bounds_enclose_the_answer(backend: &Backend) {
    let mut random = Random::new(3);
    // GRIPFAST_LONG=100 tries a million loads.
    let times = std::env::var("GRIPFAST_LONG")
        .ok()
        .and_then(|text| text.parse::<usize>().ok())
        .unwrap_or(1);
    for (frequency, grips) in [(4, 400 * times), (8, 100 * times)] {
        let set = SeedSet::new(frequency).unwrap();
        let mut counts = [0; 3];
        for _ in 0..grips {
            let size = 10_f64.powf(random.range(-3.0, 1.0));
            let contact = match (random.unit() * 4.0) as usize {
                0 | 1 => random.congruent(size),
                2 => random.similar(size),
                _ => Arc::new(Contact { face_i: random.patch(size), face_ii: random.patch(size) }),
            };
            // From outside and, less often, from inside.
            let (distance, force) =
                (size * random.range(-3.0, 6.0), 10_f64.powf(random.range(-2.0, 3.0)));
            let strength = 10_f64.powf(random.range(-2.0, 0.0));
            let wrenches: Vec<Wrench> =
                (0..20).map(|_| random.wrench(force * strength, size)).collect();
            let problem =
                Problem { contact: &contact, distance, force, wrenches: &wrenches, pose: None };
            let seeds = seed(backend, vec![problem], &set);
            for (sum, count) in counts.iter_mut().zip(assert_bounds(&seeds, &problem)) {
                *sum += count;
            }
        }
        println!(
            "{} twists: bounds for {} random loads on congruent faces, {} on different ones, of {}",
            set.len(),
            counts[0],
            counts[1],
            counts[2]
        );
        assert!(counts[0] > counts[2] / 5 && counts[1] > counts[2] / 20);
    }
}

/// A load that is left out has an answer, and one below that of a load that is not.
fn survivors_are_the_loads_that_can_be_the_worst(backend: &Backend) {
    let mut random = Random::new(47);
    let set = SeedSet::default();
    let (mut left_out, mut loads) = ([0; 2], 0);
    for index in 0..90 {
        let size = 10_f64.powf(random.range(-2.0, 0.0));
        let contact = if index % 3 == 0 { random.similar(size) } else { random.congruent(size) };
        let force = 10_f64.powf(random.range(0.0, 3.0));
        let strength = force * 10_f64.powf(random.range(-2.0, -0.3));
        let point = random.vector() * size * random.range(0.1, 1.5);
        let mut wrenches = ball(60, point);
        for wrench in &mut wrenches {
            *wrench = Wrench { force: wrench.force * strength, moment: wrench.moment * strength };
        }
        // No load, and one that pulls a pad off.
        wrenches.push(Wrench::default());
        wrenches.push(Wrench { force: DVec3::Z * 3.0 * force, ..Wrench::default() });
        let distance = size * random.range(-2.0, 5.0);
        let problem =
            Problem { contact: &contact, distance, force, wrenches: &wrenches, pose: None };
        let seeds = seed(backend, vec![problem], &set);
        let batch = Batch { problems: vec![problem] };
        let found = backend.survivors(&batch, &set).unwrap().remove(0);
        assert!(found.iter().all(|&(load, ref seed)| *seed == seeds[load]), "{problem:?}");
        assert!(found.is_sorted_by(|a, b| a.0 < b.0) && found.len() >= 3, "{problem:?}");
        let mu = |load: usize| {
            let wrench = &wrenches[load];
            mechanics::solve(&contact, distance, force, wrench, &Options::default()).unwrap()
        };
        let largest = found.iter().filter_map(|&(load, _)| mu(load).mu_s).fold(0.0, f64::max);
        for load in 0..wrenches.len() {
            if found.iter().all(|&(other, _)| other != load) {
                let score = mu(load);
                let below = score.mu_s.is_some_and(|mu| mu < largest);
                assert!(score.status.holds() && below, "{load}: {score:?} {largest} {problem:?}");
                left_out[usize::from(index % 3 == 0)] += 1;
            }
        }
        loads += wrenches.len();
    }
    println!("left out: {left_out:?} of {loads}");
    assert!(left_out[0] > loads / 8 && left_out[1] > loads / 50, "{left_out:?}");
}

/// Where loads lift a pad: an estimate encloses the answer, and a load that is left out has one, below
/// that of a load that is not.
fn survivors_of_loads_that_lift_a_pad(backend: &Backend) {
    let mut random = Random::new(53);
    let (set, options) = (SeedSet::default(), ScoreOptions::default());
    let [mut estimated, mut lifted, mut left_out, mut loads] = [0; 4];
    for index in 0..60 {
        let size = 10_f64.powf(random.range(-2.0, 0.0));
        let contact = match index % 3 {
            0 => random.similar(size),
            1 => random.congruent(size),
            _ => Arc::new(Contact { face_i: random.patch(size), face_ii: random.patch(size) }),
        };
        let force = 10_f64.powf(random.range(0.0, 3.0));
        let strength = force * random.range(0.05, 0.4);
        let point = random.vector() * size * random.range(0.3, 1.5);
        let mut wrenches = ball(80, point);
        for wrench in &mut wrenches {
            *wrench = Wrench { force: wrench.force * strength, moment: wrench.moment * strength };
        }
        let distance = size * random.range(-1.0, 2.0);
        let problem =
            Problem { contact: &contact, distance, force, wrenches: &wrenches, pose: None };
        let batch = Batch { problems: vec![problem] };
        let found = backend.survivors_for(&batch, &set, &options).unwrap().remove(0);
        let areas = [&contact.face_i, &contact.face_ii].map(|face| patch_area(face));
        let scores: Vec<_> = wrenches
            .iter()
            .map(|wrench| {
                mechanics::solve(&contact, distance, force, wrench, &Options::default()).unwrap()
            })
            .collect();
        let mu = |load: usize| scores[load].mu_s.filter(|_| scores[load].status.holds());
        for (load, seed) in found.iter().filter(|(_, seed)| seed.status == SeedStatus::Estimated) {
            let known = mu(*load).is_some_and(|mu| seed.lower <= mu && mu <= seed.upper);
            assert!(known && seed.upper <= seed.lower * 1.03, "{seed:?} {:?}", scores[*load]);
            estimated += 1;
        }
        let largest = found.iter().filter_map(|&(load, _)| mu(load)).fold(0.0, f64::max);
        for load in 0..wrenches.len() {
            let score = &scores[load];
            let lifts =
                score.contact_area_i < 0.999 * areas[0] || score.contact_area_ii < 0.999 * areas[1];
            lifted += usize::from(lifts && score.mu_s.is_some());
            if found.iter().all(|&(other, _)| other != load) {
                assert!(mu(load).is_some_and(|mu| mu < largest), "{load}: {score:?} {largest}");
                left_out += usize::from(lifts);
            }
        }
        loads += wrenches.len();
    }
    println!("{estimated} estimates; {left_out} of {lifted} lifting loads left out, {loads} loads");
    assert!(lifted > loads / 4);
    match backend {
        Backend::Cpu => assert!(estimated == 0),
        #[cfg(feature = "gpu")]
        Backend::Gpu(_) => assert!(estimated > 40 && left_out * 2 > lifted),
    }
}

fn seeds_start_the_solver_close(backend: &Backend) {
    let mut random = Random::new(5);
    let (set, dense) = (SeedSet::default(), SeedSet::with_at_least(10_000).unwrap());
    let (mut iterations, mut worse) = (Vec::new(), 0.0_f64);
    for _ in 0..12 {
        let contact = random.congruent(0.02);
        let wrenches: Vec<Wrench> = (0..40).map(|_| random.wrench(20.0, 0.02)).collect();
        let problem = Problem {
            contact: &contact,
            distance: 0.03,
            force: 20.0,
            wrenches: &wrenches,
            pose: None,
        };
        let [few, many] = [&set, &dense].map(|set| seed(backend, vec![problem], set));
        let area = Loops::new(&contact.face_i);
        let p = [1.0 / gripfast::contact::moments(&area)[0], 0.0, 0.0];
        let fields = [Field { area: &area, p }];
        for (i, wrench) in wrenches.iter().enumerate() {
            let w = nalgebra::Vector3::new(wrench.force.x, wrench.force.y, wrench.moment.z);
            let [from_few, from_many] = [&few, &many].map(|seeds| {
                slip::solve(
                    &fields,
                    w.into(),
                    Some(seeds[i].twist),
                    gripfast::mechanics::Refiner::Newton,
                )
            });
            assert!(
                from_few.residual < 1e-12 && from_many.residual < 1e-12,
                "{from_few:?} {from_many:?}"
            );
            worse = worse.max((from_few.mu / from_many.mu - 1.0).abs());
            iterations.push(from_few.iterations);
        }
    }
    iterations.sort_unstable();
    println!(
        "Newton iterations from the seed: median {}, most {}; against 10,000 seeds {worse:.1e}",
        iterations[iterations.len() / 2],
        iterations[iterations.len() - 1]
    );
    assert!(iterations[iterations.len() / 2] <= 3 && worse < 1e-12);
}

fn few_loads_of_a_ball_are_solved(backend: &Backend) {
    let contact = congruent(rectangle(0.022, 0.02, DVec2::new(0.002, -0.001)));
    let (mut solved, mut loads) = (0, 0);
    for (i, point) in [
        DVec3::ZERO,
        DVec3::new(0.01, 0.0, 0.0),
        DVec3::new(0.02, 0.013, 0.004),
        DVec3::new(-0.005, 0.04, 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        let wrenches = ball(500, point);
        let problem = Problem {
            contact: &contact,
            distance: 0.03,
            force: 40.0,
            wrenches: &wrenches,
            pose: None,
        };
        let batch = Batch { problems: vec![problem] };
        let answer = backend.score(&batch, &SeedSet::default(), &ScoreOptions::default()).unwrap();
        let all = backend
            .score(
                &batch,
                &SeedSet::default(),
                &ScoreOptions { polish: Polish::All, ..Default::default() },
            )
            .unwrap();
        let (a, b) = (answer[0].worst.unwrap(), all[0].worst.unwrap());
        assert!(
            a.0 == b.0 && (a.1.mu_s.unwrap() / b.1.mu_s.unwrap() - 1.0).abs() < 1e-9,
            "{a:?} instead of {b:?}"
        );
        assert_eq!(all[0].all.len(), 500);
        println!(
            "ball {i}: {} of 500 loads compared, {} solved",
            answer[0].compared, answer[0].solved
        );
        solved += answer[0].compared + answer[0].solved;
        loads += wrenches.len();
    }
    assert!(solved * 20 < loads, "{solved} of {loads}");
}

/// Different areas in full contact: bounds that allow for the friction coupling are still tight
/// enough.
fn few_loads_of_a_ball_are_solved_on_different_faces(backend: &Backend) {
    let mut random = Random::new(41);
    let points: Vec<DVec3> = (0..24)
        .map(|_| {
            DVec3::new(random.range(0.0, 0.02), random.range(0.0, 0.02), random.range(0.0, 0.004))
        })
        .collect();
    let (mut solved, mut loads) = (0, 0);
    for point in points {
        let mut corner = || {
            let cut = random.range(0.001, 0.007);
            let ring = [
                (-0.011, -0.01),
                (0.011, -0.01),
                (0.011, 0.01 - cut),
                (0.011 - cut, 0.01),
                (-0.011, 0.01),
            ];
            vec![Polygon { outer: ring.map(|(x, y)| DVec2::new(x, y)).to_vec(), holes: vec![] }]
        };
        let contact = Arc::new(Contact { face_i: corner(), face_ii: corner() });
        let wrenches = ball(500, point);
        let batch = Batch {
            problems: vec![Problem {
                contact: &contact,
                distance: 0.03,
                force: 40.0,
                wrenches: &wrenches,
                pose: None,
            }],
        };
        let answer =
            backend.score(&batch, &SeedSet::default(), &ScoreOptions::default()).unwrap().remove(0);
        assert!(answer.worst.unwrap().1.status.holds());
        solved += answer.solved;
        loads += wrenches.len();
    }
    println!("different faces: {solved} of {loads} loads solved");
    assert!(solved * 20 < loads, "{solved} of {loads}");
}

/// The race for the best: the same first grips with the same numbers as without it, and others left
/// unsolved. Depends neither on the number of threads nor, but for how many are left, on how the
/// grips are cut into batches.
fn the_best_grips_are_those_of_the_whole_list(backend: &Backend) {
    let mut random = Random::new(43);
    let set = SeedSet::default();
    let grips: Vec<(Arc<Contact>, Vec<Wrench>, f64)> = (0..150)
        .map(|i| {
            let contact = if i % 4 == 3 {
                Arc::new(Contact { face_i: random.patch(0.02), face_ii: random.patch(0.02) })
            } else {
                random.congruent(0.02)
            };
            let reach = random.range(0.005, 0.03);
            (contact, ball(24, random.vector() * reach), random.range(0.1, 1.2))
        })
        .collect();
    // Some of them twice: ties.
    let grips: Vec<&(Arc<Contact>, Vec<Wrench>, f64)> = grips
        .iter()
        .flat_map(|grip| std::iter::repeat_n(grip, if grip.2 > 1.0 { 2 } else { 1 }))
        .collect();
    let problems: Vec<Problem<'_>> = grips
        .iter()
        .map(|(contact, wrenches, _)| Problem {
            contact,
            distance: 0.02,
            force: 15.0,
            wrenches,
            pose: None,
        })
        .collect();
    let merit = |index: usize, mu: f64| 1.0 / mu + grips[index].2;
    let held = |scored: &Scored| {
        scored
            .worst
            .and_then(|(load, score)| Some((load, score.mu_s.filter(|_| score.status.holds())?)))
    };
    let order = |scored: &[Scored]| -> Vec<(usize, usize, f64)> {
        let mut held: Vec<(usize, usize, f64)> = scored
            .iter()
            .enumerate()
            .filter_map(|(i, scored)| held(scored).map(|(load, mu)| (i, load, mu)))
            .collect();
        held.sort_by(|a, b| merit(b.0, b.2).total_cmp(&merit(a.0, a.2)).then(a.0.cmp(&b.0)));
        held
    };
    let whole = order(
        &backend
            .score(&Batch { problems: problems.clone() }, &set, &ScoreOptions::default())
            .unwrap(),
    );
    let race = |keep: usize, cut: usize| -> Vec<Scored> {
        let mut best = Best::new(keep);
        let mut scored = Vec::new();
        for (start, part) in problems.chunks(cut).enumerate() {
            let merit = |index: usize, mu: f64| merit(start * cut + index, mu);
            scored.extend(
                backend
                    .score_best(
                        &Batch { problems: part.to_vec() },
                        &set,
                        &ScoreOptions::default(),
                        &mut best,
                        &merit,
                    )
                    .unwrap(),
            );
        }
        scored
    };
    assert!(whole.len() > 100, "{} grips hold", whole.len());
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for keep in [1, 10] {
        for cut in [problems.len(), 50, 7] {
            let scored = race(keep, cut);
            assert_eq!(order(&scored)[..keep], whole[..keep], "best {keep}, batches of {cut}");
            if cut == 50 {
                assert_eq!(scored, single.install(|| race(keep, cut)));
            }
            let left = scored.iter().filter(|scored| scored.outranked).count();
            println!("best {keep}, batches of {cut}: {left} of {} left unsolved", scored.len());
            assert!(
                scored.iter().all(|scored| scored.outranked == scored.worst.is_none())
                    && left > (problems.len() - keep) / 4
            );
        }
    }
    // All wanted: nothing is left out.
    assert!(race(problems.len(), 50).iter().all(|scored| !scored.outranked));
}

/// A list of loads on the part and poses of grips give what the loads give as each grip sees them.
fn grips_as_poses_are_grips_with_loads_of_their_own(backend: &Backend) {
    let mut random = Random::new(83);
    let set = SeedSet::default();
    let list: Vec<Wrench> = (0..130).map(|_| random.wrench(3.0, 0.03)).collect();
    let grips: Vec<(Arc<Contact>, Pose)> = (0..60)
        .map(|i| {
            let contact = match i % 3 {
                0 => random.similar(0.02),
                1 => random.congruent(0.02),
                _ => Arc::new(Contact { face_i: random.patch(0.02), face_ii: random.patch(0.02) }),
            };
            let axis = random.vector().normalize();
            let rotation = DMat3::from_axis_angle(axis, random.range(-3.0, 3.0));
            let centre_of_mass = random.vector();
            let origin = centre_of_mass + random.vector() * 0.03;
            (contact, Pose { centre_of_mass, part_from_grip: Frame { rotation, origin } })
        })
        .collect();
    let seen: Vec<Vec<Wrench>> = grips
        .iter()
        .map(|(_, Pose { centre_of_mass, part_from_grip })| {
            list.iter().map(|w| wrench_in_grip(w, *centre_of_mass, part_from_grip)).collect()
        })
        .collect();
    let problem = |i: usize, pose, wrenches| {
        let distance = 0.001 * (i % 40) as f64;
        Problem { contact: &grips[i].0, distance, force: 40.0, wrenches, pose }
    };
    let poses = (0..grips.len()).map(|i| problem(i, Some(grips[i].1), &list)).collect();
    let own = (0..grips.len()).map(|i| problem(i, None, &seen[i])).collect();
    let score = |backend: &Backend, problems| {
        let batch = Batch { problems };
        backend.score(&batch, &set, &ScoreOptions::default()).unwrap()
    };
    let expected = score(&Backend::Cpu, own);
    let found = score(backend, poses);
    if matches!(backend, Backend::Cpu) {
        assert_eq!(found, expected);
    }
    let mut held = 0;
    for (a, b) in found.iter().zip(&expected) {
        let ((load, a), (other, b)) = (a.worst.unwrap(), b.worst.unwrap());
        assert!(load == other && a.status == b.status, "{a:?} instead of {b:?}");
        let same = a.mu_s.zip(b.mu_s).is_none_or(|(a, b)| (a / b - 1.0).abs() < 1e-9);
        assert!(same && a.mu_s.is_some() == b.mu_s.is_some(), "{a:?} instead of {b:?}");
        held += usize::from(a.status.holds());
    }
    assert!(held > 20, "{held}");
}

fn degenerate_contacts_and_loads(backend: &Backend) {
    let set = SeedSet::default();
    let square = congruent(rectangle(0.02, 0.02, DVec2::ZERO));
    let wrench = |f: [f64; 3], m: [f64; 3]| Wrench { force: f.into(), moment: m.into() };
    let wrenches = [
        wrench([0.0; 3], [0.0; 3]),
        wrench([0.0, 0.0, 5.0], [0.01, 0.0, 0.0]),
        wrench([1.0, 0.0, 80.0], [0.0; 3]),
        wrench([1.0, 0.0, -1e300], [0.0; 3]),
        wrench([1.0, 0.0, 0.0], [0.0; 3]),
        wrench([0.0, 0.0, 0.0], [0.0, 0.0, 0.1]),
        wrench([1e-200, 0.0, 0.0], [0.0; 3]),
        wrench([1e-100, 0.0, 0.0], [0.0; 3]),
        wrench([1e200, 1e200, 0.0], [0.0; 3]),
        wrench([1.0, 1.0, 1.0], [10.0, 0.0, 0.0]),
    ];
    let problem =
        Problem { contact: &square, distance: 0.03, force: 40.0, wrenches: &wrenches, pose: None };
    let seeds = seed(backend, vec![problem], &set);
    let status: Vec<SeedStatus> = seeds.iter().map(|seed| seed.status).collect();
    use SeedStatus::{Bounded, NoLoad, NoNormalForce, Unbounded};
    assert_eq!(
        status,
        [
            NoLoad,
            NoLoad,
            NoNormalForce,
            NoNormalForce,
            Bounded,
            Bounded,
            NoLoad,
            Bounded,
            Unbounded,
            Unbounded
        ]
    );
    let (translation, rotation) = (&seeds[4], &seeds[5]);
    // Exact values: mu = F/(2 Fn), and M3/(2 Fn rbar) with rbar = .38259785823 of the side.
    assert!(
        translation.lower <= 1.0 / 80.0
            && 1.0 / 80.0 <= translation.upper
            && translation.upper < 1.001 / 80.0,
        "{translation:?}"
    );
    let mu = 0.1 / (80.0 * 0.382_597_858_232_106_35 * 0.02);
    assert!(
        rotation.lower <= mu && mu <= rotation.upper && rotation.upper < 1.0001 * rotation.lower,
        "{rotation:?} {mu}"
    );
    assert!((rotation.twist.u1 / rotation.twist.omega).abs() < 1e-4 * 0.02);

    let line = vec![Polygon { outer: vec![DVec2::ZERO, DVec2::X, DVec2::X * 0.5], holes: vec![] }];
    for (name, contact) in [
        ("empty", Contact::default()),
        ("one side", Contact { face_i: rectangle(0.01, 0.01, DVec2::ZERO), face_ii: vec![] }),
        ("line", Contact { face_i: line.clone(), face_ii: line }),
        (
            "points",
            Contact {
                face_i: rectangle(0.0, 0.0, DVec2::ZERO),
                face_ii: rectangle(0.0, 0.0, DVec2::ZERO),
            },
        ),
    ] {
        let contact = Arc::new(contact);
        let found = seed(backend, vec![Problem { contact: &contact, ..problem }], &set);
        assert!(found.iter().all(|seed| seed.status == SeedStatus::NoContact), "{name}: {found:?}");
    }
    for (name, patch) in [
        ("needle", rectangle(0.02, 2e-7, DVec2::ZERO)),
        ("far from the origin", rectangle(0.02, 0.02, DVec2::new(1e4, -3e3))),
        ("tiny", rectangle(1e-12, 2e-12, DVec2::ZERO)),
        ("huge", rectangle(1e12, 2e12, DVec2::ZERO)),
    ] {
        let contact = congruent(patch);
        let problem = Problem { contact: &contact, ..problem };
        let found = seed(backend, vec![problem], &set);
        assert!(found.iter().all(|seed| seed.twist.is_finite()), "{name}: {found:?}");
        assert_bounds(&found, &problem);
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let contact = congruent(rectangle(0.02, bad, DVec2::ZERO));
        let bad_wrench = [wrench([bad, 0.0, 0.0], [0.0; 3])];
        for problem in [
            Problem { contact: &contact, ..problem },
            Problem { wrenches: &bad_wrench, ..problem },
            Problem { force: bad, ..problem },
            Problem { distance: bad, ..problem },
        ] {
            assert!(backend.seed(&Batch { problems: vec![problem] }, &set).is_err());
        }
    }
    assert!(
        backend.seed(&Batch { problems: vec![Problem { force: 0.0, ..problem }] }, &set).is_err()
    );
}

fn batch_sizes(backend: &Backend) {
    let mut random = Random::new(17);
    let set = SeedSet::new(2).unwrap();
    let contact = random.congruent(0.02);
    let wrenches: Vec<Wrench> = (0..100_000).map(|_| random.wrench(20.0, 0.02)).collect();
    let problem = |count: usize| Problem {
        contact: &contact,
        distance: 0.03,
        force: 20.0,
        wrenches: &wrenches[..count],
        pose: None,
    };
    let whole = seed(backend, vec![problem(100_000)], &set);
    for count in [0, 1, 63, 64, 65] {
        assert_eq!(seed(backend, vec![problem(count)], &set), whole[..count], "{count} loads");
    }
    assert_eq!(seed(backend, vec![], &set), []);
    // As many grips of one load each, in contacts of their own or not.
    let one_by_one: Vec<Problem<'_>> =
        wrenches.chunks(1).map(|wrenches| Problem { wrenches, ..problem(0) }).collect();
    assert_eq!(seed(backend, one_by_one, &set), whole);
    for count in [1, 63, 64, 65, 3000] {
        let contacts: Vec<Arc<Contact>> =
            (0..count).map(|_| Arc::new((*contact).clone())).collect();
        let own: Vec<Problem<'_>> = contacts
            .iter()
            .zip(wrenches.chunks(1))
            .map(|(contact, wrenches)| Problem { contact, wrenches, ..problem(0) })
            .collect();
        assert_eq!(seed(backend, own, &set), whole[..count], "{count} contacts");
    }
    assert_agrees(&whole, &seed(&Backend::Cpu, vec![problem(100_000)], &set));
}

fn same_bytes_twice_and_permuted_answers_for_a_permuted_batch(backend: &Backend) {
    let mut random = Random::new(23);
    let set = SeedSet::default();
    let shared = random.congruent(0.02);
    let grips: Vec<(Arc<Contact>, Vec<Wrench>)> = (0..200)
        .map(|i| {
            let contact = if i % 3 == 0 {
                Arc::clone(&shared)
            } else {
                Arc::new(Contact { face_i: random.patch(0.02), face_ii: random.patch(0.02) })
            };
            (
                contact,
                (0..(random.unit() * 100.0) as usize).map(|_| random.wrench(20.0, 0.02)).collect(),
            )
        })
        .collect();
    let problem = |i: usize| Problem {
        contact: &grips[i].0,
        distance: 0.01 * i as f64,
        force: 20.0,
        wrenches: &grips[i].1,
        pose: None,
    };
    let order: Vec<usize> = (0..grips.len()).map(|i| (i * 77) % grips.len()).collect();
    let first = seed(backend, (0..grips.len()).map(problem).collect(), &set);
    let bytes = |seeds: &[Seed]| -> Vec<[u64; 5]> {
        seeds
            .iter()
            .map(|s| [s.twist.u1, s.twist.u2, s.twist.omega, s.lower, s.upper].map(f64::to_bits))
            .collect()
    };
    assert_eq!(bytes(&first), bytes(&seed(backend, (0..grips.len()).map(problem).collect(), &set)));
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(
        bytes(&first),
        bytes(&single.install(|| seed(backend, (0..grips.len()).map(problem).collect(), &set)))
    );
    let permuted = seed(backend, order.iter().map(|&i| problem(i)).collect(), &set);
    let starts: Vec<usize> = grips
        .iter()
        .scan(0, |sum, grip| Some(std::mem::replace(sum, *sum + grip.1.len())))
        .collect();
    let expected: Vec<Seed> = order
        .iter()
        .flat_map(|&i| first[starts[i]..starts[i] + grips[i].1.len()].to_vec())
        .collect();
    assert_eq!(bytes(&permuted), bytes(&expected));
    assert_agrees(&first, &seed(&Backend::Cpu, (0..grips.len()).map(problem).collect(), &set));
}

fn final_answers_are_those_of_the_processor(backend: &Backend) {
    let mut random = Random::new(29);
    let set = SeedSet::default();
    let grips: Vec<(Arc<Contact>, Vec<Wrench>)> = (0..60)
        .map(|i| {
            let contact = if i % 2 == 0 {
                random.congruent(0.02)
            } else {
                Arc::new(Contact { face_i: random.patch(0.02), face_ii: random.patch(0.02) })
            };
            (contact, ball(30, random.vector() * 0.03))
        })
        .collect();
    let problems = || Batch {
        problems: grips
            .iter()
            .map(|(contact, wrenches)| Problem {
                contact,
                distance: 0.02,
                force: 15.0,
                wrenches,
                pose: None,
            })
            .collect(),
    };
    let found = backend.score(&problems(), &set, &ScoreOptions::default()).unwrap();
    let expected = Backend::Cpu
        .score(&problems(), &set, &ScoreOptions { polish: Polish::All, ..Default::default() })
        .unwrap();
    for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
        let ((load_a, a), (load_b, b)) = (a.worst.unwrap(), b.worst.unwrap());
        assert!(
            load_a == load_b && a.status == b.status,
            "grip {i}: load {load_a} {a:?} instead of load {load_b} {b:?}"
        );
        if let (Some(a), Some(b)) = (a.mu_s, b.mu_s) {
            assert!((a / b - 1.0).abs() < 1e-9, "grip {i}: {a} instead of {b}");
        }
    }
}

fn reference_cases(backend: &Backend) {
    let Some(path) = crate::support::reference("cases/reference.json") else { return };
    let text = std::fs::read_to_string(&path).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut bounded = 0;
    for (case, expected) in
        gripfast::case::read(&path).unwrap().iter().zip(expected["cases"].as_array().unwrap())
    {
        let contact = Arc::new(case.contact.clone());
        let wrenches = [case.wrench];
        let problem = Problem {
            contact: &contact,
            distance: case.distance,
            force: case.force,
            wrenches: &wrenches,
            pose: None,
        };
        let id = case.id.as_deref().unwrap_or("?");
        let found = seed(backend, vec![problem], &SeedSet::default())[0];
        let answer = backend
            .score(
                &Batch { problems: vec![problem] },
                &SeedSet::default(),
                &ScoreOptions::default(),
            )
            .unwrap();
        let (_, score) = answer[0].worst.unwrap();
        match expected["expected"]["solution"]["mu_s"].as_f64() {
            Some(mu) => {
                assert!(found.lower <= mu && mu <= found.upper, "{id}: {found:?}, mu_s {mu}");
                assert!(
                    score.mu_s.is_some_and(|found| (found - mu).abs() <= 1e-9 * mu.max(1e-300)),
                    "{id}: {score:?} instead of {mu}"
                );
            }
            None => assert!(
                score.mu_s.is_none() && found.status != SeedStatus::Bounded,
                "{id}: {found:?} {score:?}"
            ),
        }
        bounded += usize::from(found.status == SeedStatus::Bounded);
    }
    println!("{bounded} reference cases with bounds");
    assert!(bounded > 10);
}

/// A device that goes before its third chunk of 500 loads: under `auto` the processor computes what
/// is missing, under `gpu` it is an error that says so.
#[cfg(feature = "gpu")]
#[test]
fn gpu_that_is_lost_in_mid_batch() {
    use gripfast::backend::{ADAPTER_VARIABLE, Gpu};
    if gpu().is_none() {
        return;
    }
    let named = std::env::var(ADAPTER_VARIABLE).unwrap_or_else(|_| "0".to_owned());
    let mut random = Random::new(47);
    let contact = random.congruent(0.02);
    let wrenches: Vec<Wrench> = (0..2300).map(|_| random.wrench(20.0, 0.02)).collect();
    let problem =
        Problem { contact: &contact, distance: 0.03, force: 20.0, wrenches: &wrenches, pose: None };
    let batch = Batch { problems: vec![problem] };
    let set = SeedSet::default();
    let expected = Backend::Cpu.seed(&batch, &set).unwrap();
    for strict in [false, true] {
        let mut gpu = Gpu::open(Some(&named), strict).unwrap();
        gpu.lose_before(3, 500);
        let backend = Backend::Gpu(Box::new(gpu));
        match backend.seed(&batch, &set) {
            Ok(found) => {
                assert!(!strict);
                assert_agrees(&found, &expected);
                let Backend::Gpu(gpu) = &backend else { panic!("the backend changed") };
                assert!(gpu.chunks_redone() >= 2, "{} redone", gpu.chunks_redone());
            }
            Err(error) => assert!(strict && error.to_string().contains("lost"), "{error}"),
        }
    }
}

macro_rules! suite {
    ($($name:ident),+ $(,)?) => {
        mod cpu {
            $(#[test] fn $name() { super::$name(&super::Backend::Cpu); })+
        }
        mod gpu {
            $(#[test] fn $name() { if let Some(backend) = super::gpu() { super::$name(&backend); } })+
        }
    };
}

suite!(
    bounds_enclose_the_answer,
    survivors_are_the_loads_that_can_be_the_worst,
    survivors_of_loads_that_lift_a_pad,
    seeds_start_the_solver_close,
    few_loads_of_a_ball_are_solved,
    few_loads_of_a_ball_are_solved_on_different_faces,
    the_best_grips_are_those_of_the_whole_list,
    grips_as_poses_are_grips_with_loads_of_their_own,
    degenerate_contacts_and_loads,
    batch_sizes,
    same_bytes_twice_and_permuted_answers_for_a_permuted_batch,
    final_answers_are_those_of_the_processor,
    reference_cases,
);

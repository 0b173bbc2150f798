//! The mechanics on one thread: the slip problem alone, all seven equations in every kind of
//! contact, loads of a grip that lift its pads, and the methods side by side on the same cases.
//! `cargo bench --bench mechanics`; names after `--` choose groups.

#![allow(clippy::unwrap_used, reason = "a bench stops by panicking")]
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use gripfast::backend::{Backend, Batch, Problem, ScoreOptions, SeedSet};
use gripfast::contact::{Field, Loops};
use gripfast::lab::{earlier, paper};
use gripfast::mechanics::slip;
use gripfast::mechanics::{Options, Pads, Refiner, solve, solve_pads};
use gripfast::model::{Contact, Patch, Polygon, Score, Status, Wrench};
use nalgebra::Vector3;

/// The same cases on every machine: SplitMix64.
struct Random(u64);

impl Random {
    /// Uniform in `-1..1`.
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.signed() + 1.0) / 2.0
    }

    fn vector(&mut self, size: f64) -> DVec3 {
        size * DVec3::new(self.signed(), self.signed(), self.signed())
    }

    /// Eight corners about the origin, 10 mm out and more or less: convex and notched.
    fn patch(&mut self) -> Patch {
        let turn = self.signed();
        let corner =
            |i: usize, r: f64| r * DVec2::from_angle(turn + std::f64::consts::TAU * i as f64 / 8.0);
        vec![Polygon {
            outer: (0..8).map(|i| corner(i, self.between(0.007, 0.013))).collect(),
            holes: Vec::new(),
        }]
    }
}

/// Slip problems on one 8-edge area each: pressure planes from level to zero at a corner, loads in
/// all directions.
fn slip_problems(count: usize) -> Vec<(Loops, [f64; 3], Vector3<f64>)> {
    let mut random = Random(1);
    let problem = |_| {
        let area = Loops::mapped(&random.patch(), |point| point * 100.0);
        let tilt = [random.signed(), random.signed()];
        let lowest = area
            .points()
            .iter()
            .map(|x| tilt[0] * x.x + tilt[1] * x.y)
            .fold(f64::INFINITY, f64::min);
        let p = [random.between(0.0, 1.0) - lowest, tilt[0], tilt[1]];
        (area, p, Vector3::new(random.signed(), random.signed(), random.signed()))
    };
    (0..count).map(problem).collect()
}

fn slips(criterion: &mut Criterion) {
    let problems = slip_problems(256);
    let solve = |(area, p, w): &(Loops, [f64; 3], Vector3<f64>), refiner| {
        slip::solve(&[Field { area, p: *p }], (*w).into(), None, refiner)
    };
    let mut group = criterion.benchmark_group("slip, 8 edges");
    group
        .throughput(Throughput::Elements(problems.len() as u64))
        .measurement_time(Duration::from_secs(3))
        .warm_up_time(Duration::from_secs(1));
    for (name, refiner) in [("newton", Refiner::Newton), ("shanno", Refiner::Shanno)] {
        let answers = problems.iter().map(|problem| solve(problem, refiner));
        let (evaluations, worst) = answers.fold((0, 0.0_f64), |(sum, worst), slip| {
            (sum + slip.evaluations, worst.max(slip.residual))
        });
        println!(
            "slip, {name}: {:.2} evaluations a solve, largest residual {worst:.1e}",
            f64::from(evaluations) / problems.len() as f64
        );
        group.bench_function(name, |bench| {
            bench.iter(|| {
                problems.iter().map(|problem| solve(black_box(problem), refiner).mu).sum::<f64>()
            })
        });
    }
    group.finish();
}

/// One contact pair with one load, lengths near 10 mm, 40 N on each pad.
struct Case {
    contact: Contact,
    pads: Pads,
    distance: f64,
    wrench: Wrench,
}

const FORCE: f64 = 40.0;

impl Case {
    fn new(contact: Contact, distance: f64, wrench: Wrench) -> Self {
        Self { pads: Pads::new(&contact).unwrap(), contact, distance, wrench }
    }

    fn solve(&self, options: &Options) -> Score {
        solve_pads(&self.pads, self.distance, FORCE, &self.wrench, options)
    }

    /// Faces that the answer says are pressed in part only.
    fn separated(&self, score: &Score) -> usize {
        let unit = self.pads.length * self.pads.length;
        let part = |left: f64, m: &[f64; 6]| left < m[0] * unit * (1.0 - 1e-9);
        usize::from(part(score.contact_area_i, &self.pads.moments[0]))
            + usize::from(part(score.contact_area_ii, &self.pads.moments[1]))
    }
}

/// A kind of contact: how its cases are made and which of them belong to it.
struct Kind {
    name: &'static str,
    congruent: bool,
    /// Distance of the faces [m].
    distance: f64,
    /// Sizes of in-plane force [N], force along the closing axis [N], moment about it and moments
    /// across it [N m].
    load: [f64; 4],
    /// Faces that separate.
    separated: usize,
}

impl Kind {
    fn wrench(&self, random: &mut Random) -> Wrench {
        let (force, moment) = (random.vector(1.0), random.vector(1.0));
        let [in_plane, along, about, across] = self.load;
        Wrench {
            force: DVec3::new(force.x * in_plane, force.y * in_plane, force.z * along),
            moment: DVec3::new(moment.x * across, moment.y * across, moment.z * about),
        }
    }
}

const KINDS: [Kind; 6] = [
    Kind {
        name: "full contact, congruent faces",
        congruent: true,
        distance: 0.02,
        load: [10.0, 0.0, 0.1, 0.02],
        separated: 0,
    },
    Kind {
        name: "full contact, different faces",
        congruent: false,
        distance: 0.02,
        load: [10.0, 0.0, 0.1, 0.02],
        separated: 0,
    },
    Kind {
        name: "with F3, different faces",
        congruent: false,
        distance: 0.02,
        load: [10.0, 40.0, 0.1, 0.02],
        separated: 0,
    },
    Kind {
        name: "one face separates",
        congruent: false,
        distance: 0.02,
        load: [10.0, 10.0, 0.1, 0.2],
        separated: 1,
    },
    Kind {
        name: "both faces separate",
        congruent: false,
        distance: 0.02,
        load: [10.0, 10.0, 0.1, 0.4],
        separated: 2,
    },
    Kind {
        name: "strong coupling (other solutions searched)",
        congruent: false,
        distance: 0.06,
        load: [20.0, 0.0, 0.4, 0.02],
        separated: 0,
    },
];

fn cases(kind: &Kind, count: usize) -> Vec<Case> {
    let mut random = Random(2);
    let mut cases = Vec::with_capacity(count);
    while cases.len() < count {
        let face_i = random.patch();
        let face_ii = if kind.congruent { face_i.clone() } else { random.patch() };
        let wrench = kind.wrench(&mut random);
        let case = Case::new(Contact { face_i, face_ii }, kind.distance, wrench);
        let score = case.solve(&Options::default());
        let coupling = score.mu_s.unwrap_or(0.0) * kind.distance / case.pads.length;
        if score.status.holds()
            && case.separated(&score) == kind.separated
            && (kind.distance < 0.05 || coupling > 1.2)
        {
            cases.push(case);
        }
    }
    cases
}

fn full(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("seven equations, 8 edges a face");
    group.measurement_time(Duration::from_secs(3)).warm_up_time(Duration::from_secs(1));
    for kind in &KINDS {
        let cases = cases(kind, 64);
        group.throughput(Throughput::Elements(cases.len() as u64));
        let evaluations: u32 =
            cases.iter().map(|case| case.solve(&Options::default()).evaluations).sum();
        println!(
            "{}: {:.1} evaluations a solve",
            kind.name,
            f64::from(evaluations) / cases.len() as f64
        );
        group.bench_function(kind.name, |bench| {
            bench.iter(|| {
                cases
                    .iter()
                    .map(|case| black_box(case).solve(&Options::default()).evaluations)
                    .sum::<u32>()
            })
        });
    }
    group.finish();
}

/// Grips of 500 loads, each of which lifts one pad or both: the worst of them. Elements: loads.
fn lifted(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("loads of a grip");
    group.measurement_time(Duration::from_secs(3)).warm_up_time(Duration::from_secs(1));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for kind in KINDS.iter().filter(|kind| kind.separated > 0) {
        let mut random = Random(4);
        let grips: Vec<(Arc<Contact>, Vec<Wrench>)> = cases(kind, 8)
            .into_iter()
            .map(|mut case| {
                let mut loads = Vec::with_capacity(500);
                while loads.len() < 500 {
                    case.wrench = kind.wrench(&mut random);
                    let score = case.solve(&Options::default());
                    if score.status.holds() && case.separated(&score) == kind.separated {
                        loads.push(case.wrench);
                    }
                }
                (Arc::new(case.contact), loads)
            })
            .collect();
        let problems = grips.iter().map(|(contact, loads)| Problem {
            contact,
            distance: kind.distance,
            force: FORCE,
            wrenches: loads,
            pose: None,
        });
        let batch = Batch { problems: problems.collect() };
        let seeds = SeedSet::default();
        group.throughput(Throughput::Elements(500 * grips.len() as u64));
        group.bench_function(kind.name, |bench| {
            let score = || Backend::Cpu.score(&batch, &seeds, &ScoreOptions::default());
            one.install(|| bench.iter(score));
        });
    }
    group.finish();
}

/// Cases for all methods: loads off the axes, along an axis, and turning about the closing axis
/// alone.
fn shared_cases() -> Vec<Case> {
    let mut random = Random(3);
    let case = |i: usize| {
        let face_i = random.patch();
        let face_ii = if i.is_multiple_of(2) { face_i.clone() } else { random.patch() };
        let (force, moment) = (random.vector(10.0), random.vector(0.1));
        let wrench = match i % 4 {
            0 | 1 => Wrench {
                force: DVec3::new(force.x, force.y, 0.0),
                moment: DVec3::new(0.2 * moment.x, 0.2 * moment.y, moment.z),
            },
            2 => Wrench {
                force: DVec3::new(0.0, force.y, 0.0),
                moment: DVec3::new(0.0, 0.0, moment.z),
            },
            _ => Wrench { force: DVec3::ZERO, moment: DVec3::new(0.0, 0.0, moment.z) },
        };
        Case::new(Contact { face_i, face_ii }, 0.02, wrench)
    };
    (0..24).map(case).collect()
}

fn methods(criterion: &mut Criterion) {
    let cases = shared_cases();
    let default = |case: &Case, refiner| {
        solve(
            &case.contact,
            case.distance,
            FORCE,
            &case.wrench,
            &Options { refiner, ..Options::default() },
        )
        .unwrap()
    };
    type Method<'a> = (&'static str, Box<dyn Fn(&Case) -> Score + 'a>);
    let all: [Method<'_>; 4] = [
        ("default (Newton)", Box::new(|case| default(case, Refiner::Newton))),
        ("Shanno refiner", Box::new(|case| default(case, Refiner::Shanno))),
        (
            "the paper's E (17) and Shanno",
            Box::new(|case| {
                paper::solve(
                    &case.contact,
                    case.distance,
                    FORCE,
                    &case.wrench,
                    &paper::Options::default(),
                )
                .unwrap()
                .score
            }),
        ),
        (
            "centroid method",
            Box::new(|case| {
                earlier::solve(&case.contact, case.distance, FORCE, &case.wrench).unwrap()
            }),
        ),
    ];
    for (name, method) in &all {
        let right = |case: &&Case| {
            let (truth, score) = (default(case, Refiner::Newton).mu_s.unwrap(), method(case));
            score.status == Status::Ok
                && score.mu_s.is_some_and(|mu| (mu / truth - 1.0).abs() <= 1e-6)
        };
        println!(
            "{name}: right in {} of {} cases",
            cases.iter().filter(right).count(),
            cases.len()
        );
    }
    let mut group = criterion.benchmark_group("methods, same cases");
    group
        .throughput(Throughput::Elements(cases.len() as u64))
        .sample_size(10)
        .measurement_time(Duration::from_secs(4))
        .warm_up_time(Duration::from_secs(1));
    for (name, method) in &all {
        group.bench_function(*name, |bench| {
            bench.iter(|| cases.iter().map(|case| method(black_box(case)).evaluations).sum::<u32>())
        });
    }
    group.finish();
}

criterion_group!(benches, slips, full, lifted, methods);
criterion_main!(benches);

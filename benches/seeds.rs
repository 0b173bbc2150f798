//! The seed stage on the processor and, where there is one, the graphics processor, over batch
//! sizes; the way there and back included. A software adapter is left out unless `GRIPFAST_ADAPTER`
//! names it; it is then marked so, its times mean nothing, and the sizes that would take it minutes
//! are skipped. All of it takes about two minutes.

#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use std::sync::Arc;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
};
use glam::{DVec2, DVec3};
use gripfast::backend::{
    Backend, Batch, Choice, Problem, ScoreOptions, SeedSet, Selection, select,
};
use gripfast::geometry::sphere;
use gripfast::model::{Contact, Polygon, Wrench};

/// A rectangular pad with one corner cut off by `cut`.
fn contact(cut: f64) -> Arc<Contact> {
    let (a, b) = (0.011, 0.01);
    let outer = [(-a, -b), (a, -b), (a, b - cut), (a - cut, b), (-a, b)]
        .map(|(x, y)| DVec2::new(x, y))
        .to_vec();
    let face = vec![Polygon { outer, holes: Vec::new() }];
    Arc::new(Contact { face_i: face.clone(), face_ii: face })
}

fn wrenches(count: usize) -> Vec<Wrench> {
    let point = DVec3::new(0.01, 0.02, 0.004);
    sphere::directions(count.max(4))
        .into_iter()
        .take(count)
        .map(|force| Wrench { force, moment: point.cross(force) })
        .collect()
}

/// A place where seeds are computed.
struct Place {
    name: String,
    backend: Backend,
    /// Largest batch that takes it seconds, in loads.
    most: usize,
}

fn places() -> Vec<Place> {
    let mut places = vec![Place {
        name: format!("cpu, {} threads", rayon::current_num_threads()),
        backend: Backend::Cpu,
        most: usize::MAX,
    }];
    match select(Choice::Gpu, None) {
        Ok(Selection { backend, reason, .. }) => {
            eprintln!("{reason}");
            // Criterion makes folders of names.
            let name = backend.name().replace('/', " ");
            let software = is_software(&backend);
            places.push(if software {
                Place { name: format!("SOFTWARE {name}"), backend, most: 20_000 }
            } else {
                Place { name, backend, most: usize::MAX }
            });
        }
        Err(error) => eprintln!("SKIPPED: {error}"),
    }
    places
}

#[cfg(feature = "gpu")]
fn is_software(backend: &Backend) -> bool {
    matches!(backend, Backend::Gpu(gpu) if gpu.is_software())
}

#[cfg(not(feature = "gpu"))]
fn is_software(_: &Backend) -> bool {
    false
}

/// Short runs: the differences looked for are factors, not percents.
fn group<'a>(criterion: &'a mut Criterion, name: &str) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    group
}

impl Place {
    /// Whether a batch of so many loads is worth the time here; says so where it is not.
    fn takes(&self, loads: usize) -> bool {
        if loads > self.most {
            eprintln!("SKIPPED: {loads} loads on {}", self.name);
        }
        loads <= self.most
    }
}

/// Loads on one shared contact, 1 to 1e6. Elements: loads.
fn loads(criterion: &mut Criterion) {
    let mut group = group(criterion, "seeds by batch size, loads on one contact");
    let (contact, all, set) = (contact(0.003), wrenches(1_000_000), SeedSet::default());
    for place in places() {
        for count in [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000]
            .into_iter()
            .filter(|&count| place.takes(count))
        {
            let batch = Batch {
                problems: vec![Problem {
                    contact: &contact,
                    distance: 0.03,
                    force: 40.0,
                    wrenches: &all[..count],
                    pose: None,
                }],
            };
            group.throughput(Throughput::Elements(count as u64));
            group.bench_function(BenchmarkId::new(&place.name, count), |bencher| {
                bencher.iter(|| place.backend.seed(&batch, &set))
            });
        }
    }
    group.finish();
}

/// Grips with a contact each and 500 loads: seeds of what can be the worst, and that solved. Elements: grips.
fn grips(criterion: &mut Criterion) {
    let mut group = group(criterion, "grips of 500 loads, a contact each");
    let (loads, set) = (wrenches(500), SeedSet::default());
    let contacts: Vec<Arc<Contact>> =
        (0..1000).map(|i| contact(0.001 + 8e-6 * f64::from(i))).collect();
    for place in places() {
        for count in [1, 30, 1000].into_iter().filter(|&count| place.takes(count * loads.len())) {
            let problems = contacts[..count].iter().map(|contact| Problem {
                contact,
                distance: 0.03,
                force: 40.0,
                wrenches: &loads,
                pose: None,
            });
            let batch = Batch { problems: problems.collect() };
            group.throughput(Throughput::Elements(count as u64));
            group.bench_function(
                BenchmarkId::new(format!("seed, {}", place.name), count),
                |bencher| bencher.iter(|| place.backend.survivors(&batch, &set)),
            );
            group.bench_function(
                BenchmarkId::new(format!("score, {}", place.name), count),
                |bencher| {
                    bencher.iter(|| place.backend.score(&batch, &set, &ScoreOptions::default()));
                },
            );
        }
    }
    group.finish();
}

/// What finer sets of twists cost and save, on the processor.
fn set_sizes(criterion: &mut Criterion) {
    let mut group = group(criterion, "score by twists, on the processor");
    let loads = wrenches(500);
    let contacts: Vec<Arc<Contact>> =
        (0..200).map(|i| contact(0.001 + 4e-5 * f64::from(i))).collect();
    let problems = contacts.iter().map(|contact| Problem {
        contact,
        distance: 0.03,
        force: 40.0,
        wrenches: &loads,
        pose: None,
    });
    let batch = Batch { problems: problems.collect() };
    for frequency in [2, 3, 4, 6, 8, 12] {
        if let Ok(set) = SeedSet::new(frequency) {
            group.throughput(Throughput::Elements(contacts.len() as u64));
            group.bench_function(BenchmarkId::from_parameter(set.len()), |bencher| {
                bencher.iter(|| Backend::Cpu.score(&batch, &set, &ScoreOptions::default()))
            });
        }
    }
    group.finish();
}

criterion_group!(benches, loads, grips, set_sizes);
criterion_main!(benches);

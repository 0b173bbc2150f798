//! The seed stage on the processor and, where there is one, the graphics processor, over batch sizes; the way there and
//! back included. A software adapter is left out unless `GRIPFAST_ADAPTER` names it, and its times mean nothing.

#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use gripfast::backend::{Backend, Batch, Choice, Problem, ScoreOptions, SeedSet, select};
use gripfast::load::sphere;
use gripfast::model::{Contact, Polygon, Wrench};

/// A rectangular pad with one corner cut off by `cut`.
fn contact(cut: f64) -> Arc<Contact> {
    let (a, b) = (0.011, 0.01);
    let outer = [(-a, -b), (a, -b), (a, b - cut), (a - cut, b), (-a, b)].map(|(x, y)| DVec2::new(x, y)).to_vec();
    let face = vec![Polygon { outer, holes: Vec::new() }];
    Arc::new(Contact { face_i: face.clone(), face_ii: face })
}

fn wrenches(count: usize) -> Vec<Wrench> {
    let point = DVec3::new(0.01, 0.02, 0.004);
    sphere::directions(count.max(4)).into_iter().take(count).map(|force| Wrench { force, moment: point.cross(force) }).collect()
}

fn backends() -> Vec<(String, Backend)> {
    let mut backends = vec![("cpu".to_owned(), Backend::Cpu)];
    match select(Choice::Gpu, None) {
        Ok(selection) => {
            eprintln!("{}", selection.reason);
            backends.push((selection.backend.name(), selection.backend));
        }
        Err(error) => eprintln!("SKIPPED: {error}"),
    }
    backends
}

/// Loads on one shared contact, 1 to 1e6.
fn loads(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("seed, one contact");
    let (contact, all, set) = (contact(0.003), wrenches(1_000_000), SeedSet::default());
    for (name, backend) in &backends() {
        for count in [1, 100, 10_000, 1_000_000] {
            let batch = Batch { problems: vec![Problem { contact: &contact, distance: 0.03, force: 40.0, wrenches: &all[..count] }] };
            group.throughput(Throughput::Elements(count as u64)).sample_size(10);
            group.bench_function(BenchmarkId::new(name, count), |bencher| bencher.iter(|| backend.seed(&batch, &set)));
        }
    }
    group.finish();
}

/// Grips with a contact each and 500 loads: seeds, and the worst load solved.
fn grips(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("grips of 500 loads");
    let (loads, set) = (wrenches(500), SeedSet::default());
    let contacts: Vec<Arc<Contact>> = (0..1000).map(|i| contact(0.001 + 8e-6 * f64::from(i))).collect();
    for (name, backend) in &backends() {
        for count in [1, 30, 1000] {
            let problems = contacts[..count].iter().map(|contact| Problem { contact, distance: 0.03, force: 40.0, wrenches: &loads });
            let batch = Batch { problems: problems.collect() };
            group.throughput(Throughput::Elements(count as u64)).sample_size(10);
            group.bench_function(BenchmarkId::new(format!("seed, {name}"), count), |bencher| bencher.iter(|| backend.seed(&batch, &set)));
            group.bench_function(BenchmarkId::new(format!("score, {name}"), count), |bencher| {
                bencher.iter(|| backend.score(&batch, &set, &ScoreOptions::default()));
            });
        }
    }
    group.finish();
}

/// What finer sets of twists cost and save, on the processor.
fn set_sizes(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("score by twists");
    let loads = wrenches(500);
    let contacts: Vec<Arc<Contact>> = (0..200).map(|i| contact(0.001 + 4e-5 * f64::from(i))).collect();
    let problems = contacts.iter().map(|contact| Problem { contact, distance: 0.03, force: 40.0, wrenches: &loads });
    let batch = Batch { problems: problems.collect() };
    for frequency in [2, 3, 4, 6, 8, 12] {
        if let Ok(set) = SeedSet::new(frequency) {
            group.throughput(Throughput::Elements(contacts.len() as u64)).sample_size(10);
            group.bench_function(BenchmarkId::from_parameter(set.len()), |bencher| bencher.iter(|| Backend::Cpu.score(&batch, &set, &ScoreOptions::default())));
        }
    }
    group.finish();
}

criterion_group!(benches, loads, grips, set_sizes);
criterion_main!(benches);

//! Picking from 10,000 grips in a scene of 100,000 triangles, after loading: the first grip free,
//! only the last one free, and none.

#![allow(clippy::unwrap_used, reason = "a bench stops by panicking")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DMat3, DQuat, DVec3};
use gripfast::model::Frame;
use gripfast::part::Mesh;
use gripfast::pick::{Obstacle, Picker, Reference, Scene, Solid};
use gripfast::results::GripSet;

#[path = "../tests/support/grips.rs"]
mod grips;

/// A bin with a bumpy floor, 0.6 m wide: 2 n^2 triangles.
fn bin(n: usize) -> Mesh {
    let height = |i: usize, j: usize| {
        let (x, y) = (i as f64 / n as f64 - 0.5, j as f64 / n as f64 - 0.5);
        0.03 * (31.0 * x).sin() * (27.0 * y).cos() + 1.5 * (x.abs().max(y.abs()) - 0.4).max(0.0)
    };
    let point = |i: usize, j: usize| {
        DVec3::new(
            0.6 * (i as f64 / n as f64 - 0.5),
            0.6 * (j as f64 / n as f64 - 0.5),
            height(i, j),
        )
    };
    let vertices = (0..=n).flat_map(|i| (0..=n).map(move |j| point(i, j))).collect();
    let at = |i: usize, j: usize| u32::try_from(i * (n + 1) + j).unwrap();
    let triangles = (0..n)
        .flat_map(|i| {
            (0..n).flat_map(move |j| {
                [
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                    [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                ]
            })
        })
        .collect();
    Mesh { vertices, triangles }
}

/// Grips about a part of 60 mm, approaching from all around, in an order that jumps about.
fn list(count: u64) -> GripSet {
    let mut set = grips::grip_set(0);
    set.grips = (0..count)
        .map(|id| {
            let turn = |step: f64| (id as f64 * step).fract();
            let spin = DQuat::from_rotation_z(std::f64::consts::TAU * turn(0.618_033_988_749_895))
                * DQuat::from_rotation_y(3.0 * turn(0.754_877_666_246_693));
            let origin = DVec3::new(
                turn(0.569_840_290_998_053) - 0.5,
                turn(0.324_717_957_244_746) - 0.5,
                turn(0.819_172_513_396_164) - 0.5,
            ) * 0.06;
            let mut grip = grips::grip(id, Frame { rotation: DMat3::from_quat(spin), origin }, 0.1);
            grip.grip.width = 0.02 + 0.001 * (id % 20) as f64;
            grip
        })
        .collect();
    set
}

fn pick(criterion: &mut Criterion) {
    let mesh = bin(224);
    let triangles = mesh.triangles.len();
    let table = Obstacle {
        name: "table".into(),
        solid: Solid::HalfSpace,
        frame: Reference::World,
        world_from_obstacle: Frame {
            rotation: DMat3::IDENTITY,
            origin: DVec3::new(0.0, 0.0, -0.05),
        },
    };
    let bin = Obstacle {
        name: "bin".into(),
        solid: Solid::Mesh { mesh, closed: false },
        frame: Reference::World,
        world_from_obstacle: Frame::IDENTITY,
    };
    let scene = Scene { obstacles: vec![table, bin], ..Scene::default() };
    let mut group =
        criterion.benchmark_group(format!("pick from 10000 grips, {triangles} triangles"));
    group.throughput(Throughput::Elements(10_000));
    let at = |z: f64| Frame { rotation: DMat3::IDENTITY, origin: DVec3::new(0.05, -0.02, z) };

    // A part on the floor of the bin: as many as are blocked before the first free one, then a list
    // of blocked ones only.
    let set = list(40_000);
    let picker = Picker::new(&set, &scene).unwrap();
    let (mut blocked, mut free) = (list(0), None);
    for (index, grip) in set.grips.iter().enumerate() {
        if picker.check(index, &at(0.02)).is_some() {
            blocked.grips.push(grip.clone());
        } else {
            free.get_or_insert_with(|| grip.clone());
        }
    }
    blocked.grips.truncate(10_000);
    assert_eq!(blocked.grips.len(), 10_000);
    let first = picker.pick(&at(0.02));
    println!(
        "{} blocked grips; in the mixed list the first free one is number {:?}",
        blocked.grips.len(),
        first.chosen.map(|index| index + 1)
    );
    group.bench_function("part in the bin, good and bad grips mixed", |bench| {
        bench.iter(|| black_box(picker.pick(&at(0.02))))
    });
    let none = Picker::new(&blocked, &scene).unwrap();
    group.bench_function("none free", |bench| {
        bench.iter(|| {
            let pick = none.pick(&at(0.02));
            assert!(pick.chosen.is_none() && pick.passed.len() == 10_000);
            black_box(pick)
        });
    });
    let mut last = blocked.clone();
    *last.grips.last_mut().unwrap() = free.unwrap();
    let last = Picker::new(&last, &scene).unwrap();
    group.bench_function("only the last one free", |bench| {
        bench.iter(|| {
            let pick = last.pick(&at(0.02));
            assert_eq!(pick.chosen, Some(9_999));
            black_box(pick)
        });
    });
    group.finish();
    criterion.bench_function("prepare 10000 grips and 100000 triangles", |bench| {
        bench.iter(|| black_box(Picker::new(&blocked, &scene).is_ok()))
    });
}

criterion_group!(benches, pick);
criterion_main!(benches);

//! What a part is does not depend on the order of its triangles, on the corner that comes first in
//! each, or on how its vertices are numbered.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use gripfast::part::{Part, ReadOptions};

use crate::solids::{Random, Solid};
use crate::support::{self, reference, root};

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

fn shuffle<T>(list: &mut [T], random: &mut Random) {
    for last in (1..list.len()).rev() {
        let other = (0.5 * (random.next() + 1.0) * (last + 1) as f64) as usize;
        list.swap(last, other.min(last));
    }
}

/// The same mesh otherwise listed, and the old number of each triangle.
fn shuffled((vertices, triangles): &Mesh, seed: u64) -> (Mesh, Vec<u32>) {
    let mut random = Random(seed);
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    shuffle(&mut order, &mut random);
    let mut points: Vec<u32> = (0..vertices.len() as u32).collect();
    shuffle(&mut points, &mut random);
    let mut number = vec![0; points.len()];
    points.iter().zip(0..).for_each(|(&old, new)| number[old as usize] = new);
    let turned = order.iter().map(|&old| {
        let mut triangle = triangles[old as usize].map(|vertex| number[vertex as usize]);
        triangle.rotate_left((1.5 * (random.next() + 1.0)) as usize % 3);
        triangle
    });
    let triangles = turned.collect();
    ((points.iter().map(|&old| vertices[old as usize]).collect(), triangles), order)
}

/// Faces as kinds with areas \[um^2\] and triangles by their numbers in `order`, and which of them are
/// opposite, at which width \[um\].
type Seen = (Vec<(String, i64, Vec<u32>)>, Vec<(u32, u32, i64)>, Vec<String>);

fn seen(part: &Part, order: &[u32]) -> Seen {
    let known = |triangles: &[u32]| {
        let mut known: Vec<u32> = triangles.iter().map(|&new| order[new as usize]).collect();
        known.sort_unstable();
        known
    };
    let round = |area: f64| (area * 1e12).round() as i64;
    let planes = part
        .faces
        .iter()
        .map(|face| ("plane".to_string(), round(face.area), known(&face.triangles)));
    let curved = part
        .curved
        .iter()
        .map(|face| (face.shape.name().to_string(), round(face.area), known(&face.triangles)));
    // Equal overlaps have no order.
    let mut pairs: Vec<(u32, u32, i64)> = part
        .pairs(0.0, 1.0)
        .iter()
        .map(|pair| (pair.face_i, pair.face_ii, (pair.width * 1e6).round() as i64))
        .collect();
    pairs.sort_unstable();
    (planes.chain(curved).collect(), pairs, part.health.warnings.clone())
}

fn check(name: &str, mesh: &Mesh, options: &ReadOptions) {
    let read = |(vertices, triangles): &Mesh| {
        Part::from_triangles_with(name, vertices, triangles, options).unwrap()
    };
    let unshuffled: Vec<u32> = (0..mesh.1.len() as u32).collect();
    let first = seen(&read(mesh), &unshuffled);
    assert!(!first.0.is_empty() || !first.2.is_empty(), "{name} has neither face nor warning");
    for seed in 1..3 {
        let (other, order) = shuffled(mesh, seed);
        assert_eq!(seen(&read(&other), &order), first, "{name}, order {seed}");
    }
}

fn noisy((vertices, triangles): &Mesh, noise: f64) -> Mesh {
    let mut random = Random(7);
    let moved = vertices
        .iter()
        .map(|vertex| *vertex + noise * DVec3::new(random.next(), random.next(), random.next()));
    (moved.collect(), triangles.clone())
}

/// A block of 60 x 40 x 20 mm with this top.
fn block(top: impl Fn(DVec2) -> f64) -> Mesh {
    support::block::block([48, 32], |level, at| {
        let at = at * DVec2::new(0.06, 0.04);
        at.extend(if level == 0 { 0.0 } else { 0.02 + top(at) })
    })
}

fn bump(at: DVec2) -> f64 {
    0.005 * (-(at.x / 0.012).powi(2) - (at.y / 0.009).powi(2)).exp()
}

/// A lathed part [m], its profile a function of the place along the axis from 0 to 1.
fn lathed(rows: u32, around: u32, profile: impl Fn(f64) -> DVec2) -> Mesh {
    let profile: Vec<DVec2> =
        (0..=rows).map(|row| profile(f64::from(row) / f64::from(rows))).collect();
    let solid = Solid::lathe(&profile, around, |row| 0.5 * (row % 2) as f64);
    (solid.vertices.iter().map(|vertex| *vertex * 1e-3).collect(), solid.triangles)
}

fn ellipsoid() -> Mesh {
    let (vertices, triangles) = lathed(40, 60, |t| {
        let turn = DVec2::from_angle(0.5 * TAU * t);
        let radius = if t == 0.0 || t == 1.0 { 0.0 } else { turn.y };
        DVec2::new(-turn.x, radius)
    });
    (vertices.iter().map(|v| *v * DVec3::new(10.0, 15.0, 22.0)).collect(), triangles)
}

#[test]
fn gently_curved_tops_have_the_same_faces_in_any_order() {
    let plain = ReadOptions::default();
    for (name, mesh) in [
        ("bump", block(bump)),
        ("wave", block(|at| 0.0004 * (at.x * 200.0).sin() * (at.y * 150.0).cos())),
        ("saddle", block(|at| 2.0 * (at.x * at.x - at.y * at.y))),
        ("ellipsoid", ellipsoid()),
        ("vase", lathed(30, 48, |t| DVec2::new(50.0 * t, 14.0 + 3.0 * (5.0 * t).sin()))),
        ("cone", lathed(8, 40, |t| DVec2::new(30.0 * t, 12.0 + 4.0 * t))),
    ] {
        check(name, &mesh, &plain);
        for noise in [1e-6, 5e-6, 2e-5] {
            check(&format!("{name} with noise of {noise}"), &noisy(&mesh, noise), &plain);
        }
        check(name, &noisy(&mesh, 5e-6), &plain.clone().with_fit(Some(3e-5)));
    }
}

#[test]
fn sample_parts_have_the_same_faces_in_any_order() {
    let mut files: Vec<_> =
        std::fs::read_dir(root().join("data/parts")).unwrap().map(|e| e.unwrap().path()).collect();
    for name in ["gen/gen_hexbolt_M8x30_thread.stl", "gen/gen_bearing_608.stl"] {
        files.extend(reference(&format!("parts/{name}")));
    }
    files.extend(reference("parts/parts/isaac__factory_gear_medium_space_5e-4.obj"));
    files.retain(|file| file.extension().is_some_and(|suffix| suffix != "json"));
    assert!(files.len() >= 6);
    for file in files {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let mesh = Part::read(&file, &ReadOptions::default()).unwrap().mesh;
        let mesh = (mesh.vertices, mesh.triangles);
        check(&name, &mesh, &ReadOptions::default());
        let (low, high) = mesh.0.iter().fold((mesh.0[0], mesh.0[0]), |(low, high), &vertex| {
            (low.min(vertex), high.max(vertex))
        });
        let size = low.distance(high);
        let noise = noisy(&mesh, 1e-4 * size);
        check(&format!("noisy {name}"), &noise, &ReadOptions::default());
        check(
            &format!("fitted {name}"),
            &noise,
            &ReadOptions::default().with_fit(Some(4e-4 * size)),
        );
    }
}

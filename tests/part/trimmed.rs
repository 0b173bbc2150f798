//! Facets of round faces that others cut off: in meshes made by operations on meshes, corners along a rim
//! lie on chords of the faces on both sides.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use gripfast::part::{Part, Shape};

use crate::solids::Solid;

/// The side of a plane on which `normal . x < offset`.
type Half = (DVec3, f64);

/// What of a flat polygon lies within a half space.
fn clipped(ring: &[DVec3], (normal, offset): Half) -> Vec<DVec3> {
    let mut kept = Vec::new();
    for (k, &a) in ring.iter().enumerate() {
        let b = ring[(k + 1) % ring.len()];
        let [over_a, over_b] = [a, b].map(|x| normal.dot(x) - offset);
        if over_a <= 0.0 {
            kept.push(a);
        }
        if over_a * over_b < 0.0 {
            kept.push(a.lerp(b, over_a / (over_a - over_b)));
        }
    }
    kept
}

/// The solid that lies in all half spaces [mm].
fn common(halves: &[Half]) -> Solid {
    let mut solid = Solid { vertices: Vec::new(), triangles: Vec::new() };
    for (index, &(normal, offset)) in halves.iter().enumerate() {
        let (u, v) = normal.any_orthonormal_pair();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let sense = u.cross(v).dot(normal).signum();
        let corner = |(x, y): (f64, f64)| normal * offset + 100.0 * (x * u + sense * y * v);
        let mut ring: Vec<DVec3> = corners.map(corner).to_vec();
        for (other, &half) in halves.iter().enumerate() {
            if other != index {
                ring = clipped(&ring, half);
            }
        }
        let mut place = |x: DVec3| {
            let known = solid.vertices.iter().position(|&known| known.distance(x) < 1e-7);
            known.unwrap_or_else(|| {
                solid.vertices.push(x);
                solid.vertices.len() - 1
            }) as u32
        };
        let mut ids: Vec<u32> = ring.iter().map(|&x| place(x)).collect();
        ids.dedup();
        if ids.len() > 1 && ids.first() == ids.last() {
            ids.pop();
        }
        solid.triangles.extend((2..ids.len()).map(|k| [ids[0], ids[k - 1], ids[k]]));
    }
    solid
}

/// The facets of a prism of `n` sides whose corners lie on a cylinder about an axis through nought.
fn round(n: u32, radius: f64, axis: DVec3, phase: f64) -> Vec<Half> {
    let (u, v) = axis.any_orthonormal_pair();
    let step = TAU / f64::from(n);
    let about = |k: u32| DVec2::from_angle(step * (f64::from(k) + phase));
    (0..n).map(|k| (about(k).x * u + about(k).y * v, radius * (0.5 * step).cos())).collect()
}

/// The facets of a ball, `n` around and half as many from pole to pole.
fn ball(n: u32, radius: f64) -> Vec<Half> {
    let (rows, step) = (n / 2, TAU / f64::from(n));
    let mut halves = Vec::new();
    for row in 0..rows {
        let [low, high] = [row, row + 1].map(|k| PI * f64::from(k) / f64::from(rows) - 0.5 * PI);
        for k in 0..n {
            let at = |latitude: f64, turn: f64| {
                let way = DVec2::from_angle(step * turn) * latitude.cos();
                radius * way.extend(latitude.sin())
            };
            // Three corners of the facet: at a pole one is the other of its row.
            let k = f64::from(k);
            let corners = match row {
                0 => [at(low, k), at(high, k + 1.0), at(high, k)],
                _ => [at(low, k), at(low, k + 1.0), at(high, k)],
            };
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize();
            let normal = normal * normal.dot(a).signum();
            halves.push((normal, normal.dot(a)));
        }
    }
    halves
}

fn flats(offset: f64) -> [Half; 6] {
    [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z].map(|normal| (normal, offset))
}

/// Kinds and radii [mm] of the curved faces, sorted; all of the surface belongs to some face.
fn told(what: &str, part: &Part) -> Vec<(&'static str, f64)> {
    assert!(part.health.watertight, "{what}: {:?}", part.health.lines());
    let of_faces: f64 = part.faces.iter().map(|face| face.area).sum::<f64>()
        + part.curved.iter().map(|face| face.area).sum::<f64>();
    let area = |triangle: u32| {
        let [a, b, c] = part.mesh.corners(triangle);
        0.5 * (b - a).cross(c - a).length()
    };
    let all: f64 = (0..part.mesh.triangles.len() as u32).map(area).sum();
    assert!((of_faces / all - 1.0).abs() < 1e-6, "{what}: {of_faces:e} of {all:e}");
    let mut told: Vec<(&'static str, f64)> = part
        .curved
        .iter()
        .map(|face| {
            let radius = match face.shape {
                Shape::Cylinder { radius, .. } | Shape::Sphere { radius, .. } => 1e3 * radius,
                _ => f64::NAN,
            };
            // A corner on a chord within a twentieth of the sag counts as one on the surface.
            assert!(face.residual < 1e-5, "{what}: {:e}", face.residual);
            (face.shape.name(), radius)
        })
        .collect();
    told.sort_by(|a, b| a.1.total_cmp(&b.1));
    told
}

fn assert_told(what: &str, part: &Part, wanted: &[(&'static str, f64)]) {
    let found = told(what, part);
    let is_same = |(one, other): (&(&str, f64), &(&str, f64))| {
        one.0 == other.0 && (one.1 - other.1).abs() < 1e-4 * other.1
    };
    let same = found.len() == wanted.len() && found.iter().zip(wanted).all(is_same);
    assert!(same, "{what}: {found:?}");
}

#[test]
fn balls_with_flats_are_balls() {
    for n in [24, 32, 48] {
        for share in [0.8, 10.0 / 12.0, 0.9, 0.96] {
            // Hardly a facet is left whole.
            if share * f64::from(n) < 26.0 && share < 0.9 {
                continue;
            }
            let halves = [ball(n, 12.0), flats(12.0 * share).to_vec()].concat();
            let what = format!("{n} {share}");
            let part = common(&halves).part(u64::from(n), 0.0);
            assert_told(&what, &part, &[("sphere", 12.0)]);
            assert_eq!(part.faces.len(), 6, "{what}");
        }
    }
}

/// A rod whose ends a larger round face cuts off: corners on chords of either.
#[test]
fn rods_with_ends_cut_off_round_are_cylinders() {
    for (n, m) in [(24, 48), (16, 96), (48, 64), (64, 90), (36, 200)] {
        for (phase, radius) in [(0.0, 15.0), (0.31, 15.0), (0.7, 11.0)] {
            let halves =
                [round(n, 8.0, DVec3::Z, phase), round(m, radius, DVec3::X, 0.5 * phase)].concat();
            let what = format!("{n} {m} {phase} {radius}");
            let part = common(&halves).part(u64::from(n + m), 0.0);
            let ends = ("cylinder", radius);
            assert_told(&what, &part, &[("cylinder", 8.0), ends, ends]);
        }
    }
}

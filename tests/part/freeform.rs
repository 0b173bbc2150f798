//! Which smooth surface is a face of free form.

use std::path::Path;

use glam::{DVec2, DVec3};
use gripfast::part::{Part, ReadOptions, Shape};

use crate::solids::Solid;
use crate::support;

fn free(part: &Part) -> usize {
    part.curved.iter().filter(|face| face.shape == Shape::Freeform).count()
}

/// A block of 60 x 40 x 20 mm whose top is the given height over a grid; its corners moved by noise
/// \[m\].
fn block(cells: u32, noise: f64, top: impl Fn(DVec2) -> f64) -> Part {
    let mut state = 1_u64;
    let mut random = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let (vertices, triangles) = support::block::block([cells; 2], |level, at| {
        let at = at * DVec2::new(0.06, 0.04);
        let z = if level == 0 { 0.0 } else { 0.02 + top(at) };
        at.extend(z) + DVec3::new(random(), random(), random()) * noise
    });
    Part::from_triangles("block", &vertices, &triangles).unwrap()
}

fn bulge(at: DVec2) -> f64 {
    let s = (1.0 - (at.x / 0.03).powi(2)) * (1.0 - (at.y / 0.02).powi(2));
    0.008 * s * s
}

#[test]
fn a_bulge_is_and_noise_is_not() {
    let smooth = block(32, 0.0, bulge);
    assert_eq!(free(&smooth), 1);
    let face = smooth.curved.iter().find(|face| face.shape == Shape::Freeform).unwrap();
    assert_eq!(face.id as usize, smooth.faces.len() + smooth.curved.len() - 1);
    assert!(face.reachable && face.area > 2e-3 && face.area < 3e-3, "{}", face.area);
    for noise in [1e-5, 3e-5, 1e-4, 3e-4, 1e-3] {
        let noisy = block(32, noise, |_| 0.0);
        assert_eq!(free(&noisy), 0, "{noise}");
    }
}

#[test]
fn faceted_parts_have_none() {
    let flat = |at: DVec2| if (at.x * 100.0).round() as i64 % 2 == 0 { 0.002 } else { 0.0 };
    assert_eq!(free(&block(32, 0.0, flat)), 0);
    // Too few facets to show a form.
    assert_eq!(free(&block(3, 0.0, bulge)), 0);
}

#[test]
fn all_facets_are_planes_where_they_are_meant_so() {
    let mesh = block(32, 0.0, bulge).mesh;
    let options = ReadOptions::default().with_faceted(true);
    let part =
        Part::from_triangles_with("block", &mesh.vertices, &mesh.triangles, &options).unwrap();
    assert!(part.curved.is_empty());
}

#[test]
fn sample_parts_of_planes_and_round_faces_have_none() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/parts");
    for name in ["l_bracket", "hex_nut", "pocket_plate", "t_slot_bar", "spur_gear", "shaft_key"] {
        let part =
            Part::read(&folder.join(format!("{name}.stl")), &ReadOptions::default()).unwrap();
        assert_eq!(free(&part), 0, "{name}");
    }
}

/// A plate with an arched top of some strips, 40 mm wide, 15 mm high and 40 mm deep \[mm\].
fn arched(radius: f64, strips: u32) -> Part {
    let half = 20.0_f64;
    let height =
        |x: f64| 15.0 + (radius * radius - x * x).sqrt() - (radius * radius - half * half).sqrt();
    let mut outline = vec![DVec2::new(-half, 0.0), DVec2::new(half, 0.0)];
    outline.extend((0..=strips).map(|k| {
        let x = half - 2.0 * half * f64::from(k) / f64::from(strips);
        DVec2::new(x, height(x))
    }));
    Solid::extrude(&outline, 40.0).part(2, 0.0)
}

#[test]
fn gentle_domes_and_arches_are() {
    for rise in [2e-5, 1e-4, 5e-4] {
        let dome = block(24, 0.0, |at| {
            let [x, y] = [at.x / 0.03, at.y / 0.02].map(|x| 1.0 - x.powi(4));
            rise * x * y
        });
        assert_eq!(free(&dome), 1, "{rise}");
    }
    for (radius, strips) in [(100.0, 16), (200.0, 6), (200.0, 12), (200.0, 40), (1000.0, 8)] {
        let part = arched(radius, strips);
        assert_eq!(free(&part), 1, "{radius}, {strips}");
        assert!(part.curved[0].outside, "{radius}, {strips}");
    }
}

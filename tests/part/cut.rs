//! How finely a program cuts flat pieces says nothing of the part: a mesh whose triangles are cut up
//! has the same planes and the same round faces.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use gripfast::part::{Part, Shape};

use crate::solids::{Solid, arc};
use crate::support::reference;

/// Kind, sizes that matter, area and middle of each face.
type Faces = Vec<(&'static str, Vec<f64>, f64, DVec3)>;

/// Every triangle cut in three at its middle.
fn in_three(solid: &Solid) -> Solid {
    let mut cut = Solid { vertices: solid.vertices.clone(), triangles: Vec::new() };
    for &[a, b, c] in &solid.triangles {
        let sum: DVec3 = [a, b, c].iter().map(|&vertex| solid.vertices[vertex as usize]).sum();
        let middle = cut.vertices.len() as u32;
        cut.vertices.push(sum / 3.0);
        cut.triangles.extend([[a, b, middle], [b, c, middle], [c, a, middle]]);
    }
    cut
}

/// The ways in which a mesh is cut up.
fn cuts(solid: &Solid) -> [(&'static str, Solid); 4] {
    [
        ("in three", in_three(solid)),
        ("in nine", in_three(&in_three(solid))),
        ("in four", solid.subdivided()),
        ("in 16", solid.subdivided().subdivided()),
    ]
}

/// The faces of a part but those of free form, which are told by all vertices.
fn told(part: &Part) -> Faces {
    assert!(part.health.watertight, "{:?}", part.health.lines());
    let planes = part.faces.iter().map(|face| {
        let holes = face.polygons.iter().map(|polygon| polygon.holes.len()).sum::<usize>();
        ("plane", vec![holes as f64, face.normal.z], face.area, face.centroid)
    });
    let round = part.curved.iter().filter(|face| face.shape != Shape::Freeform);
    let round = round.map(|face| {
        let sizes = match face.shape {
            Shape::Cylinder { radius, turn, .. } => vec![radius, turn],
            Shape::Cone { half_angle, .. } => vec![half_angle],
            Shape::Sphere { radius, .. } => vec![radius],
            Shape::Torus { major, minor, .. } => vec![major, minor],
            _ => Vec::new(),
        };
        (face.shape.name(), sizes, face.area, face.centroid)
    });
    planes.chain(round).collect()
}

/// Whether two parts have the same faces, to `tolerance` of the size.
fn assert_same(what: &str, whole: &Part, cut: &Part, tolerance: f64) {
    assert_eq!(whole.health.warnings, cut.health.warnings, "{what}");
    assert_same_of(what, whole, (told(whole), told(cut)), tolerance);
}

fn assert_same_of(what: &str, whole: &Part, (first, mut left): (Faces, Faces), tolerance: f64) {
    let (low, high) = whole.mesh.bounding_box();
    let near = tolerance * low.distance(high);
    for (kind, sizes, area, middle) in &first {
        let twin = left.iter().position(|other| {
            let is_near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-3 * (1e-3 + a.abs());
            other.0 == *kind
                && sizes.iter().zip(&other.1).all(is_near)
                && (other.2 - area).abs() < 100.0 * tolerance * area
                && other.3.distance(*middle) < near
        });
        let Some(twin) = twin else {
            panic!("{what}: no {kind} {sizes:?} of {area} at {middle} among {left:?}")
        };
        left.remove(twin);
    }
    assert!(left.is_empty(), "{what}: {left:?}");
}

fn check(name: &str, solid: &Solid, tolerance: f64) -> Part {
    let whole = solid.unmoved();
    for (how, cut) in cuts(solid) {
        assert_same(&format!("{name} cut {how}"), &whole, &cut.unmoved(), tolerance);
    }
    whole
}

/// A shaft with cylinders of 1 to 30 mm, a cone between two, and a ball at its end.
fn shaft(around: u32) -> Solid {
    let mut profile: Vec<DVec2> = [
        (0.0, 1.0),
        (3.0, 1.0),
        (3.0, 4.0),
        (10.0, 4.0),
        (10.0, 12.0),
        (25.0, 12.0),
        (30.0, 18.0),
        (50.0, 18.0),
        (50.0, 30.0),
        (70.0, 30.0),
    ]
    .map(|(z, r)| DVec2::new(z, r))
    .into();
    profile.extend(arc(DVec2::new(70.0, 0.0), 15.0, 0.5 * PI, 0.0, around / 4));
    let last = profile.len() - 1;
    profile[last].y = 0.0;
    Solid::lathe(&profile, around, |_| 0.0)
}

/// A disc with a round edge.
fn disc(around: u32) -> Solid {
    let mut profile = vec![DVec2::new(-4.0, 12.0)];
    profile.extend(arc(DVec2::new(0.0, 16.0), 4.0, PI, 0.0, 16).iter().map(|place| {
        let turned = *place - DVec2::new(0.0, 16.0);
        DVec2::new(turned.x, 16.0 + turned.y)
    }));
    profile.push(DVec2::new(4.0, 12.0));
    Solid::lathe(&profile, around, |_| 0.0)
}

/// A cam: two opposite arcs of 10 mm, mirrored, and between them lobes of a curve that is no circle.
fn cam(strips: u32, lobes: u32) -> Solid {
    let mut outline = Vec::new();
    for start in [PI / 6.0, 7.0 * PI / 6.0] {
        outline.extend(arc(DVec2::ZERO, 10.0, start, start + 2.0 * PI / 3.0, strips));
        let from = start + 2.0 * PI / 3.0;
        outline.extend((1..lobes).map(|k| {
            let t = f64::from(k) / f64::from(lobes);
            let radius = 14.0 + 22.0 * (PI * t).sin().powi(2);
            DVec2::from_angle(from + t * PI / 3.0) * radius
        }));
    }
    // Corners that mirror each other have the same digits.
    for point in &mut outline {
        *point = (*point * 1e9).round() / 1e9;
    }
    Solid::extrude(&outline, 12.0)
}

#[test]
fn cylinders_of_any_size_are_found_however_strips_are_cut() {
    for around in [24, 40, 72] {
        let whole = check(&format!("shaft of {around}"), &shaft(around), 1e-7);
        let count =
            |name: &str| whole.curved.iter().filter(|face| face.shape.name() == name).count();
        assert_eq!([count("cylinder"), count("cone"), count("sphere")], [5, 1, 1], "{around}");
        let posed = shaft(around).rounded(3, 0.0, 1e-6);
        check(&format!("posed shaft of {around}"), &posed, 1e-6);
        let whole = check(&format!("disc of {around}"), &disc(around), 1e-7);
        assert!(whole.curved.iter().any(|face| face.shape.name() == "torus"), "{around}");
    }
}

/// Lobes on which no circle is found in 150 attempts leave half of the facets untried.
#[test]
fn both_of_two_mirrored_arcs_are_found_beside_curves_that_are_none() {
    for lobes in [60, 85, 110, 140, 200] {
        let whole = check(&format!("cam with lobes of {lobes}"), &cam(90, lobes), 1e-7);
        let arcs = whole.curved.iter().filter(|face| match face.shape {
            Shape::Cylinder { radius, turn, .. } => {
                (radius - 0.010).abs() < 1e-6 && (turn - 2.0 * PI / 3.0).abs() < 0.05
            }
            _ => false,
        });
        assert_eq!(arcs.count(), 2, "{lobes}");
    }
}

/// What a program adds when it cuts facets up is not rounded as the file's coordinates were. Planes so
/// rough may lose slivers.
#[test]
fn rounded_and_noisy_round_faces_are_found_however_facets_are_cut() {
    let round = |part: &Part| told(part).into_iter().filter(|face| face.0 != "plane").collect();
    for (name, noise, step) in [("rounded", 0.0, 1e-3), ("noisy", 2e-3, 1e-6)] {
        for strips in [48, 80, 120] {
            let third = 2.0 * PI / 3.0;
            let solid = Solid::extrude(&arc(DVec2::ZERO, 20.0, -third, third, strips), 130.0);
            let solid = solid.rounded(3, noise, step);
            let whole = solid.unmoved();
            let first: Faces = round(&whole);
            let kinds: Vec<&str> = first.iter().map(|face| face.0).collect();
            assert_eq!(kinds, ["cylinder"], "{name} {strips}");
            for (how, cut) in cuts(&solid) {
                let what = format!("{name} {strips} cut {how}");
                assert_same_of(&what, &whole, (first.clone(), round(&cut.unmoved())), 1e-4);
            }
        }
    }
}

/// Too few corners to show noise: only the step of the coordinates tells how far they may lie off.
#[test]
fn short_arcs_of_rounded_coordinates_are_found_however_strips_are_cut() {
    for strips in [11, 12, 13] {
        let mut outline = arc(DVec2::ZERO, 20.0, -PI / 12.0, PI / 12.0, strips);
        outline.extend([DVec2::new(10.0, 14.0), DVec2::new(-15.0, 14.0)]);
        outline.extend([DVec2::new(-15.0, -14.0), DVec2::new(10.0, -14.0)]);
        let solid = Solid::extrude(&outline, 130.0).rounded(3, 0.0, 1e-3);
        let round = |part: &Part| -> Faces {
            told(part).into_iter().filter(|face| face.0 != "plane").collect()
        };
        let whole = solid.unmoved();
        let first = round(&whole);
        assert!(first.len() == 1 && first[0].0 == "cylinder", "{strips}: {first:?}");
        for (how, cut) in cuts(&solid) {
            let what = format!("{strips} strips cut {how}");
            assert_same_of(&what, &whole, (first.clone(), round(&cut.unmoved())), 1e-4);
        }
    }
}

#[test]
fn a_gear_with_a_keyed_bore_is_the_same_however_it_is_cut() {
    let Some(file) = reference("parts/gen/gen_spurgear_m2_z24.stl") else { return };
    let mesh = Part::read(&file, &Default::default()).unwrap().mesh;
    let vertices = mesh.vertices.iter().map(|vertex| *vertex * 1e3).collect();
    let whole = check("gear", &Solid { vertices, triangles: mesh.triangles }, 1e-6);
    let bores = whole.curved.iter().filter(|face| !face.outside && face.area > 1e-4);
    assert_eq!(bores.count(), 2);
}

//! The contact shapes of the studies, all inscribed in a square of the given side about the origin.

use glam::DVec2;

use crate::model::{Contact, Patch, Polygon, Ring};

fn ring(points: &[(f64, f64)]) -> Ring {
    points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
}

fn rectangle_ring(a: f64, b: f64) -> Ring {
    ring(&[(-a / 2.0, -b / 2.0), (a / 2.0, -b / 2.0), (a / 2.0, b / 2.0), (-a / 2.0, b / 2.0)])
}

/// A rectangle `a x b`.
pub fn rectangle(a: f64, b: f64) -> Patch {
    vec![Polygon { outer: rectangle_ring(a, b), holes: vec![] }]
}

/// A square.
pub fn square(side: f64) -> Patch {
    rectangle(side, side)
}

/// A square with a square hole whose side is `share` of its own.
pub fn hollow(side: f64, share: f64) -> Patch {
    let hole = rectangle_ring(share * side, share * side);
    vec![Polygon {
        outer: rectangle_ring(side, side),
        holes: vec![hole.into_iter().rev().collect()],
    }]
}

/// A cross of two bars of width `share` of the side: the square with its corners removed.
pub fn cross(side: f64, share: f64) -> Patch {
    let (a, b) = (share * side / 2.0, side / 2.0);
    let outer = ring(&[
        (a, -b),
        (a, -a),
        (b, -a),
        (b, a),
        (a, a),
        (a, b),
        (-a, b),
        (-a, a),
        (-b, a),
        (-b, -a),
        (-a, -a),
        (-a, -b),
    ]);
    vec![Polygon { outer, holes: vec![] }]
}

/// An L: the square without its upper right quarter.
pub fn ell(side: f64) -> Patch {
    let h = side / 2.0;
    vec![Polygon {
        outer: ring(&[(-h, -h), (h, -h), (h, 0.0), (0.0, 0.0), (0.0, h), (-h, h)]),
        holes: vec![],
    }]
}

/// A triangle on the square's lower side, its apex off the middle.
pub fn triangle(side: f64) -> Patch {
    let h = side / 2.0;
    vec![Polygon { outer: ring(&[(-h, -h), (h, -h), (-h / 3.0, h)]), holes: vec![] }]
}

/// The six shapes of the sweeps, by name.
pub fn all(side: f64) -> [(&'static str, Patch); 6] {
    [
        ("square", square(side)),
        ("bar 2:1", rectangle(side, side / 2.0)),
        ("hollow square 1/2", hollow(side, 0.5)),
        ("cross 1/3", cross(side, 1.0 / 3.0)),
        ("L", ell(side)),
        ("triangle", triangle(side)),
    ]
}

/// The same area on both faces.
pub fn both(patch: &Patch) -> Contact {
    Contact { face_i: patch.clone(), face_ii: patch.clone() }
}

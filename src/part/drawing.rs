//! A drawing of a part: three views with its planar faces numbered, coloured by how jaws can grip
//! them, and its curved faces numbered.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::{Part, PlanarFace};
use crate::geometry::Bounds2;
use crate::geometry::polygon::{contains, rings};
use crate::model::Polygon;
use crate::svg;

/// Longest extent of the part in a view, and margins [px].
const SIZE: f64 = 380.0;
const MARGIN: f64 = 48.0;
/// Triangles of curved surfaces drawn in one view, at most: more only blacken the picture.
const MOST_CURVED: usize = 20_000;
/// Faces and triangles seen flatter than this (cosine to the line of sight) are not drawn.
const EDGE_ON: f64 = 1e-3;
/// Faces seen flatter than this carry no number.
const READABLE: f64 = 0.3;
/// Points tried along each side of a face for the place of its number.
const TRIES: usize = 24;

/// One view: axes of the picture to the right, up, and towards the eye.
struct View {
    name: &'static str,
    right: DVec3,
    up: DVec3,
    eye: DVec3,
}

const VIEWS: [View; 3] = [
    View { name: "front (x to the right, z up)", right: DVec3::X, up: DVec3::Z, eye: DVec3::NEG_Y },
    View {
        name: "right side (y to the right, z up)",
        right: DVec3::Y,
        up: DVec3::Z,
        eye: DVec3::X,
    },
    View { name: "top (x to the right, y up)", right: DVec3::X, up: DVec3::Y, eye: DVec3::Z },
];

/// A face or triangle as a view shows it.
struct Shape {
    depth: f64,
    class: &'static str,
    polygons: Vec<Polygon>,
    face: Option<usize>,
}

/// The drawing as a complete SVG document: front, right side and top, equally scaled; lengths in
/// its text are millimetres.
pub fn svg(part: &Part) -> String {
    let (low, high) = part.mesh.bounding_box();
    let size = high - low;
    let scale = SIZE / size.max_element().max(f64::MIN_POSITIVE);
    let class = classes(part);
    let width = scale * (size.x + size.y + size.x) + 4.0 * MARGIN;
    let height = scale * size.z.max(size.y) + 2.6 * MARGIN;
    // Writing to a String cannot fail.
    let mut text = String::new();
    let _ = writeln!(
        text,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <style>path{{stroke:#333;stroke-width:.8;stroke-linejoin:round;fill-rule:evenodd}}.outside{{fill:#a9c7e8}}.inside{{fill:#f2c48d}}.both{{fill:#c9b6e4}}.none{{fill:#d9dde1}}.curved{{fill:#eceff1;stroke:#c5ccd2;stroke-width:.3}}.round{{fill:#dcebdc}}.number{{text-anchor:middle;dominant-baseline:central;font-weight:600;fill:#013;stroke:#fff;stroke-width:3px;paint-order:stroke}}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n<text x=\"{MARGIN:.0}\" y=\"22\" font-size=\"15\">{}: {:.1} x {:.1} x {:.1} mm, {} planar faces, {} curved</text>",
        svg::escape(&part.name),
        size.x * 1e3,
        size.y * 1e3,
        size.z * 1e3,
        part.faces.len(),
        part.curved.len()
    );
    let mut left = MARGIN;
    let mut left_out = 0;
    for view in &VIEWS {
        let flat = |point: DVec3| DVec2::new(view.right.dot(point), view.up.dot(point));
        let corner = flat(low).min(flat(high));
        let extent = (flat(high) - flat(low)).abs();
        let place = |point: DVec2| {
            DVec2::new(
                left + (point.x - corner.x) * scale,
                1.8 * MARGIN + (corner.y + extent.y - point.y) * scale,
            )
        };
        let (shapes, skipped) = shapes(part, view, &class);
        left_out += skipped;
        let _ = writeln!(
            text,
            "<g><text x=\"{left:.1}\" y=\"{:.1}\" fill=\"#456\">{}</text>",
            1.8 * MARGIN - 14.0,
            view.name
        );
        for shape in &shapes {
            let mut path = String::new();
            for ring in shape.polygons.iter().flat_map(rings) {
                svg::ring(&mut path, ring, place);
            }
            let _ = writeln!(text, "<path class=\"{}\" d=\"{path}\"/>", shape.class);
        }
        for (number, at) in numbers(part, view, &shapes) {
            let at = place(at);
            let _ = writeln!(
                text,
                "<text class=\"number\" x=\"{:.1}\" y=\"{:.1}\">{number}</text>",
                at.x, at.y
            );
        }
        for (number, at) in round_numbers(part, view, &shapes) {
            let at = place(at);
            let _ = writeln!(
                text,
                "<text class=\"number round\" x=\"{:.1}\" y=\"{:.1}\">{number}</text>",
                at.x, at.y
            );
        }
        text.push_str("</g>\n");
        left += extent.x * scale + MARGIN;
    }
    let mut x = MARGIN;
    for (class, meaning) in [
        ("outside", "gripped from outside"),
        ("inside", "from inside"),
        ("both", "either"),
        ("none", "no opposite face"),
        ("round", "cylinder, cone, sphere ..."),
    ] {
        let y = height - 22.0;
        let _ = writeln!(
            text,
            "<path class=\"{class}\" d=\"M{x:.0} {y:.0}h12v12h-12Z\"/><text x=\"{:.0}\" y=\"{:.0}\">{meaning}</text>",
            x + 18.0,
            y + 10.0
        );
        x += 34.0 + 6.6 * meaning.len() as f64;
    }
    if left_out > 0 {
        let _ = writeln!(
            text,
            "<text x=\"{x:.0}\" y=\"{:.0}\" fill=\"#456\">{left_out} triangles of curved surfaces not drawn</text>",
            height - 12.0
        );
    }
    text.push_str("</svg>\n");
    text
}

/// How each face can be gripped.
fn classes(part: &Part) -> Vec<&'static str> {
    let mut gripped = vec![[false; 2]; part.faces.len()];
    for (side, pairs) in
        [part.pairs(0.0, f64::INFINITY), part.internal_pairs(0.0, f64::INFINITY)].iter().enumerate()
    {
        for face in pairs.iter().flat_map(|pair| [pair.face_i, pair.face_ii]) {
            gripped[face as usize][side] = true;
        }
    }
    let name = |sides: [bool; 2]| match sides {
        [true, true] => "both",
        [true, false] => "outside",
        [false, true] => "inside",
        _ => "none",
    };
    gripped.into_iter().map(name).collect()
}

/// What the view shows, farthest first, and the number of triangles left out.
fn shapes(part: &Part, view: &View, class: &[&'static str]) -> (Vec<Shape>, usize) {
    let flat = |point: DVec3| DVec2::new(view.right.dot(point), view.up.dot(point));
    let mut shapes = Vec::new();
    let mut planar = vec![false; part.mesh.triangles.len()];
    for (index, face) in part.faces.iter().enumerate() {
        face.triangles.iter().for_each(|&triangle| planar[triangle as usize] = true);
        if face.normal.dot(view.eye) < EDGE_ON {
            continue;
        }
        let place = |&point: &DVec2| flat(face.part_from_face.point(point.extend(0.0)));
        let polygon = |shape: &Polygon| Polygon {
            outer: shape.outer.iter().map(place).collect(),
            holes: shape.holes.iter().map(|hole| hole.iter().map(place).collect()).collect(),
        };
        shapes.push(Shape {
            depth: face.centroid.dot(view.eye),
            class: class[index],
            polygons: face.polygons.iter().map(polygon).collect(),
            face: Some(index),
        });
    }
    let mut curved: Vec<Shape> = Vec::new();
    let mut is_round = vec![false; part.mesh.triangles.len()];
    for &triangle in part.curved.iter().flat_map(|face| &face.triangles) {
        is_round[triangle as usize] = true;
    }
    for triangle in
        (0..part.mesh.triangles.len() as u32).filter(|&triangle| !planar[triangle as usize])
    {
        let [a, b, c] = part.mesh.corners(triangle);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal.dot(view.eye) >= EDGE_ON {
            let outer = [a, b, c].map(flat).to_vec();
            curved.push(Shape {
                depth: (a + b + c).dot(view.eye) / 3.0,
                class: if is_round[triangle as usize] { "curved round" } else { "curved" },
                polygons: vec![Polygon { outer, holes: Vec::new() }],
                face: None,
            });
        }
    }
    let left_out = if curved.len() > MOST_CURVED { curved.len() } else { 0 };
    if left_out == 0 {
        shapes.append(&mut curved);
    }
    shapes.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    (shapes, left_out)
}

/// Numbers of the curved faces, each on the triangle nearest to the eye of those that look at it,
/// where nothing lies in front.
fn round_numbers(part: &Part, view: &View, shapes: &[Shape]) -> Vec<(u32, DVec2)> {
    let mut found = Vec::new();
    for face in &part.curved {
        let seen = face.triangles.iter().filter_map(|&triangle| {
            let [a, b, c] = part.mesh.corners(triangle);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let middle = (a + b + c) / 3.0;
            (normal.dot(view.eye) > READABLE).then(|| (middle.dot(view.eye), middle))
        });
        let Some((depth, middle)) = seen.max_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        let point = DVec2::new(view.right.dot(middle), view.up.dot(middle));
        let hidden = shapes.iter().any(|cover| {
            cover.depth > depth + 1e-9 && cover.polygons.iter().any(|p| contains(p, point))
        });
        if !hidden {
            found.push((face.id, point));
        }
    }
    found
}

/// Numbers of the faces that can be seen, with a place on each where nothing lies in front.
fn numbers(part: &Part, view: &View, shapes: &[Shape]) -> Vec<(u32, DVec2)> {
    // Height of a face's plane above a point of the picture, towards the eye.
    let height = |face: &PlanarFace, point: DVec2| {
        let on_picture = view.right * point.x + view.up * point.y;
        (face.offset - face.normal.dot(on_picture)) / face.normal.dot(view.eye)
    };
    let boxes: Vec<Bounds2> = shapes
        .iter()
        .map(|shape| {
            Bounds2::of(
                &shape.polygons.iter().flat_map(|p| p.outer.iter().copied()).collect::<Vec<_>>(),
            )
        })
        .collect();
    let mut found = Vec::new();
    for (index, shape) in shapes.iter().enumerate() {
        let Some(face) = shape.face.map(|face| &part.faces[face]) else { continue };
        if face.normal.dot(view.eye) < READABLE {
            continue;
        }
        let hidden = |point: DVec2| {
            shapes.iter().enumerate().any(|(other, cover)| {
                let in_front = match cover.face {
                    Some(cover) => height(&part.faces[cover], point) > height(face, point) + 1e-9,
                    None => cover.depth > height(face, point),
                };
                other != index
                    && in_front
                    && point.clamp(boxes[other].min, boxes[other].max) == point
                    && cover.polygons.iter().any(|p| contains(p, point))
            })
        };
        let size = boxes[index].size();
        let tries = (0..TRIES * TRIES).map(|k| {
            boxes[index].min
                + size * DVec2::new((k % TRIES) as f64 + 0.5, (k / TRIES) as f64 + 0.5)
                    / TRIES as f64
        });
        let room = |point: DVec2| {
            let edges = shape
                .polygons
                .iter()
                .flat_map(rings)
                .flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
            edges
                .map(|(&a, &b)| {
                    a + (b - a)
                        * ((point - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE))
                            .clamp(0.0, 1.0)
                })
                .map(|on_edge| on_edge.distance(point))
                .fold(f64::INFINITY, f64::min)
        };
        let inside =
            tries.filter(|&point| shape.polygons.iter().any(|polygon| contains(polygon, point)));
        let mut places: Vec<(f64, DVec2)> = inside.map(|point| (room(point), point)).collect();
        places.sort_by(|a, b| b.0.total_cmp(&a.0));
        if let Some(&(_, point)) = places.iter().find(|(_, point)| !hidden(*point)) {
            found.push((face.id, point));
        }
    }
    found
}

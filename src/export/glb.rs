//! Binary glTF 2.0: the part with grippers in place.
//!
//! Metres, in the axes of the part frame (no turn to glTF's y-up: a pose read from the file is a
//! pose on the part).

use std::io::Write;

use glam::{DQuat, DVec2, DVec3};
use serde_json::{Value, json};

use super::View;
use crate::gripper::{Body, Jaw, Shape};
use crate::model::{Frame, Ring};
use crate::part::Mesh;

/// Sides of a drawn cylinder.
const SIDES: u32 = 32;
/// Thickness of a drawn pad \[m\].
const PAD_THICKNESS: f64 = 1e-3;

/// Indices into the list of materials in [`write`].
const PART: usize = 0;
const BEST: usize = 1;
const OTHER: usize = 2;
const PAD: usize = 3;

/// The growing file.
#[derive(Default)]
struct Scene {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl Scene {
    /// Adds triangles and returns the number of the mesh. Positions are f32 as glTF has no others;
    /// offsets of large parts are not taken off, so 1 m keeps 0.1 um.
    fn mesh(
        &mut self,
        name: &str,
        vertices: &[DVec3],
        triangles: &[[u32; 3]],
        material: usize,
    ) -> usize {
        let start = self.bytes.len();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for vertex in vertices {
            for (axis, value) in vertex.as_vec3().to_array().into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(value), high[axis].max(value));
                self.bytes.extend(value.to_le_bytes());
            }
        }
        let middle = self.bytes.len();
        self.bytes.extend(triangles.iter().flatten().flat_map(|index| index.to_le_bytes()));
        // 34962: vertices, 34963: indices; 5126: f32, 5125: u32 (glTF 2.0, section 3.6).
        self.views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": middle - start, "target": 34962}));
        self.views.push(json!({"buffer": 0, "byteOffset": middle, "byteLength": self.bytes.len() - middle, "target": 34963}));
        let view = self.views.len();
        self.accessors.push(json!({"bufferView": view - 2, "componentType": 5126, "count": vertices.len(), "type": "VEC3", "min": low, "max": high}));
        self.accessors.push(json!({"bufferView": view - 1, "componentType": 5125, "count": triangles.len() * 3, "type": "SCALAR"}));
        let accessor = self.accessors.len();
        self.meshes.push(json!({"name": name, "primitives": [{"attributes": {"POSITION": accessor - 2}, "indices": accessor - 1, "material": material}]}));
        self.meshes.len() - 1
    }

    fn node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }
}

/// A drawn body: its mesh for the best grip and for the others, and its place in the grip frame.
struct Drawn {
    name: String,
    meshes: [usize; 2],
    frame: Frame,
}

pub(super) fn write(
    view: &View<'_>,
    writer: &mut impl Write,
    part: Option<&Mesh>,
) -> std::io::Result<()> {
    let mut scene = Scene::default();
    let mut roots = Vec::new();
    if let Some(part) = part.filter(|part| !part.triangles.is_empty()) {
        let mesh = scene.mesh("part", &part.vertices, &part.triangles, PART);
        roots.push(scene.node(json!({"name": "part", "mesh": mesh})));
    }
    let (fingers, palm, pads) = match &view.gripper {
        None => ([Vec::new(), Vec::new()], Vec::new(), [None; 2]),
        Some(gripper) => {
            // In the frames of the jaws, which are half a turn apart.
            let mut pad = |ring: &Ring| {
                let (vertices, triangles) = prism(ring);
                (!triangles.is_empty()).then(|| scene.mesh("pad", &vertices, &triangles, PAD))
            };
            let first = pad(&gripper.pad);
            let pads = [
                first,
                gripper.pad_ii.as_ref().map_or(first, |ring| {
                    pad(&ring.iter().rev().map(|p| DVec2::new(p.x, -p.y)).collect())
                }),
            ];
            let fingers = Jaw::BOTH.map(|jaw| draw(&mut scene, gripper.bodies(jaw)));
            (fingers, draw(&mut scene, &gripper.palm), pads)
        }
    };
    for (index, grip) in view.grips().iter().enumerate() {
        let variant = usize::from(index > 0);
        // Readers tell nodes apart by their names.
        let id = format!("grip_{}", grip.grip.id);
        let place = |scene: &mut Scene, bodies: &[Drawn], jaw: &str, at: &Frame| -> Vec<usize> {
            let node = |body: &Drawn| json!({"name": format!("{id}/{jaw}{}", body.name), "mesh": body.meshes[variant], "matrix": columns(&at.compose(&body.frame))});
            bodies.iter().map(|body| scene.node(node(body))).collect()
        };
        let palm_place = view
            .gripper
            .as_ref()
            .map_or(Frame::IDENTITY, |gripper| gripper.palm_place(view.gap(grip)));
        let mut jaws = place(&mut scene, &palm, "", &palm_place);
        for (index, (jaw, name)) in Jaw::BOTH.into_iter().zip(["jaw_i", "jaw_ii"]).enumerate() {
            let mut children =
                place(&mut scene, &fingers[index], &format!("{name}/"), &Frame::IDENTITY);
            children.extend(
                pads[index].map(|pad| {
                    scene.node(json!({"name": format!("{id}/{name}/pad"), "mesh": pad}))
                }),
            );
            let gap = view.gap(grip);
            let place = view
                .gripper
                .as_ref()
                .map_or(jaw.at(gap / 2.0), |gripper| gripper.jaw_at(jaw, gap, 0.0));
            let rotation = DQuat::from_mat3(&place.rotation).to_array();
            let mut jaw = json!({"name": format!("{id}/{name}"), "translation": place.origin, "rotation": rotation});
            if !children.is_empty() {
                jaw["children"] = json!(children);
            }
            jaws.push(scene.node(jaw));
        }
        let gripper = scene.node(json!({"name": format!("{id}/gripper"), "matrix": columns(&view.grip_from_tool(grip).inverse()), "children": jaws}));
        roots.push(scene.node(json!({
            "name": id,
            "matrix": columns(&view.pose(grip)),
            "children": [gripper],
            "extras": {"rank": grip.rank, "id": grip.grip.id, "width_m": grip.grip.width, "mu_s": grip.worst.mu_s, "score": grip.score, "verdict": view.verdict(grip).name(), "tool_frame": view.tool_frame()},
        })));
    }
    let material = |name: &str, colour: [f64; 4]| {
        let mode = if colour[3] < 1.0 { "BLEND" } else { "OPAQUE" };
        json!({"name": name, "doubleSided": true, "alphaMode": mode,
            "pbrMetallicRoughness": {"baseColorFactor": colour, "metallicFactor": 0.1, "roughnessFactor": 0.7}})
    };
    let mut document = json!({
        "asset": {"version": "2.0", "generator": format!("gripfast {}", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"name": "grips", "extras": {"warnings": view.set.provenance.warnings}}],
        "materials": [
            material("part", [0.62, 0.66, 0.70, 1.0]),
            material("best grip", [0.10, 0.60, 0.30, 1.0]),
            material("grip", [0.20, 0.45, 0.80, 0.25]),
            material("pad", [0.95, 0.55, 0.10, 1.0]),
        ],
    });
    // glTF forbids empty lists.
    let length = scene.bytes.len();
    for (name, list) in [
        ("nodes", scene.nodes),
        ("meshes", scene.meshes),
        ("accessors", scene.accessors),
        ("bufferViews", scene.views),
    ] {
        if !list.is_empty() {
            document[name] = Value::Array(list);
        }
    }
    if !roots.is_empty() {
        document["scenes"][0]["nodes"] = json!(roots);
    }
    if length > 0 {
        document["buffers"] = json!([{"byteLength": length}]);
    }
    container(writer, &document, scene.bytes)
}

/// The file. The document is JSON, not the types of `gltf::json`: these keep matrices in single
/// precision, and a pose read from the file shall be that of the result file.
fn container(writer: &mut impl Write, document: &Value, binary: Vec<u8>) -> std::io::Result<()> {
    let text = serde_json::to_vec(document)?;
    // Headers and padding (glTF 2.0, section 4.4) take 32 bytes at most; the library does not look
    // for an overflow.
    if u32::try_from(text.len() + binary.len() + 32).is_err() {
        return Err(std::io::Error::other(
            "the scene passes glTF's limit of 4 GiB; export fewer grips",
        ));
    }
    let file = gltf::Glb {
        // Its length is counted while writing.
        header: gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 },
        json: text.into(),
        bin: (!binary.is_empty()).then(|| binary.into()),
    };
    file.to_writer(writer).map_err(std::io::Error::other)
}

/// A 4x4 matrix in glTF's order, column by column.
fn columns(frame: &Frame) -> [f64; 16] {
    let rows = super::matrix(frame);
    std::array::from_fn(|index| rows[index % 4][index / 4])
}

fn draw(scene: &mut Scene, bodies: &[Body]) -> Vec<Drawn> {
    bodies
        .iter()
        .filter_map(|body| {
            let (vertices, triangles) = surface(&body.shape);
            // A flat hull has no surface to draw.
            (!triangles.is_empty()).then(|| Drawn {
                name: body.name.clone(),
                meshes: [
                    scene.mesh(&body.name, &vertices, &triangles, BEST),
                    scene.mesh(&body.name, &vertices, &triangles, OTHER),
                ],
                frame: body.grip_from_body,
            })
        })
        .collect()
}

fn surface(shape: &Shape) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    match shape {
        Shape::Box { half } => {
            let vertices = (0..8)
                .map(|corner| {
                    half * DVec3::new(
                        sign(corner & 1),
                        sign(corner >> 1 & 1),
                        sign(corner >> 2 & 1),
                    )
                })
                .collect();
            // Each face as two triangles, counter-clockwise from outside; corner bits are x, y, z.
            let faces = [
                [0, 2, 3, 1],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 6, 7, 3],
                [0, 4, 6, 2],
                [1, 3, 7, 5],
            ];
            (vertices, faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
        }
        Shape::Cylinder { radius, half_height } => {
            let ring: Ring = (0..SIDES)
                .map(|side| {
                    glam::DVec2::from_angle(
                        std::f64::consts::TAU * f64::from(side) / f64::from(SIDES),
                    ) * *radius
                })
                .collect();
            extrude(&ring, -half_height, *half_height)
        }
        Shape::Hull { points } => {
            parry3d_f64::transformation::try_convex_hull(points).unwrap_or_default()
        }
    }
}

fn sign(bit: u32) -> f64 {
    if bit == 0 { -1.0 } else { 1.0 }
}

/// The pad of the jaw at `x3 > 0`: its face at `x3 = 0`, its thickness towards the jaw.
fn prism(ring: &Ring) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    extrude(ring, 0.0, PAD_THICKNESS)
}

/// A convex ring between two heights.
fn extrude(ring: &Ring, low: f64, high: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let count = u32::try_from(ring.len()).unwrap_or(0);
    if count < 3 {
        return (Vec::new(), Vec::new());
    }
    let vertices = ring
        .iter()
        .map(|point| point.extend(low))
        .chain(ring.iter().map(|point| point.extend(high)))
        .collect();
    let mut triangles = Vec::new();
    for side in 0..count {
        let next = (side + 1) % count;
        triangles.extend([[side, next, count + next], [side, count + next, count + side]]);
    }
    for corner in 1..count - 1 {
        triangles.extend([[0, corner + 1, corner], [count, count + corner, count + corner + 1]]);
    }
    (vertices, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive only when every triangle is counter-clockwise
    /// from outside.
    fn volume((vertices, triangles): &(Vec<DVec3>, Vec<[u32; 3]>)) -> f64 {
        triangles
            .iter()
            .map(|corners| corners.map(|corner| vertices[corner as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum()
    }

    #[test]
    fn drawn_shapes_have_their_volume_and_face_outwards() {
        let half = DVec3::new(1.0, 2.0, 3.0);
        assert!((volume(&surface(&Shape::Box { half })) - 48.0).abs() < 1e-12);
        let cylinder = volume(&surface(&Shape::Cylinder { radius: 2.0, half_height: 1.5 }));
        assert!((cylinder / (std::f64::consts::PI * 12.0) - 1.0).abs() < 0.01);
        let points = (0..8)
            .map(|corner| {
                half * DVec3::new(sign(corner & 1), sign(corner >> 1 & 1), sign(corner >> 2 & 1))
            })
            .collect();
        assert!((volume(&surface(&Shape::Hull { points })) - 48.0).abs() < 1e-12);
        assert!(
            (volume(&prism(&crate::gripper::rectangle(glam::DVec2::new(2.0, 3.0))))
                - 6.0 * PAD_THICKNESS)
                .abs()
                < 1e-12
        );
    }
}

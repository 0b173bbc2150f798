//! Binary glTF 2.0: the part with grippers in place.
//!
//! Metres, in the axes of the part frame (no turn to glTF's y-up: a pose read from the file is a
//! pose on the part). glTF's numbers are in single precision; `extras.pose` of a grip's node has
//! its pose in double.

use std::io::Write;

use glam::{DQuat, DVec2, DVec3};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{self, Index, accessor, buffer, material, mesh, scene};
use serde_json::value::RawValue;

use super::View;
use crate::gripper::{Body, Jaw, Shape};
use crate::model::{Frame, Ring};
use crate::part::Mesh;
use crate::results::RankedGrip;

/// Sides of a drawn cylinder.
const SIDES: u32 = 32;
/// Thickness of a drawn pad \[m\].
const PAD_THICKNESS: f64 = 1e-3;

/// A colour of the scene.
#[derive(Clone, Copy)]
enum Colour {
    Part,
    Best,
    Other,
    Pad,
}

impl Colour {
    /// All, in the order of the list of materials.
    const ALL: [Self; 4] = [Self::Part, Self::Best, Self::Other, Self::Pad];

    fn material(self) -> json::Material {
        let (name, colour) = match self {
            Self::Part => ("part", [0.62, 0.66, 0.70, 1.0]),
            Self::Best => ("best grip", [0.10, 0.60, 0.30, 1.0]),
            Self::Other => ("grip", [0.20, 0.45, 0.80, 0.25]),
            Self::Pad => ("pad", [0.95, 0.55, 0.10, 1.0]),
        };
        let blended = colour[3] < 1.0;
        json::Material {
            name: Some(name.to_owned()),
            double_sided: true,
            alpha_mode: Checked::Valid(if blended {
                material::AlphaMode::Blend
            } else {
                material::AlphaMode::Opaque
            }),
            pbr_metallic_roughness: material::PbrMetallicRoughness {
                base_color_factor: material::PbrBaseColorFactor(colour),
                metallic_factor: material::StrengthFactor(0.1),
                roughness_factor: material::StrengthFactor(0.7),
                ..Default::default()
            },
            ..Default::default()
        }
    }
}

/// The growing file.
struct Scene {
    root: json::Root,
    /// The one buffer.
    bytes: Vec<u8>,
}

impl Scene {
    fn new() -> Self {
        let mut root = json::Root::default();
        root.asset.generator = Some(format!("gripfast {}", env!("CARGO_PKG_VERSION")));
        root.materials = Colour::ALL.map(Colour::material).into();
        Self { root, bytes: Vec::new() }
    }

    /// A piece of the buffer, from this byte to its end.
    fn view(&mut self, start: usize, target: buffer::Target) -> Index<buffer::View> {
        self.root.push(buffer::View {
            buffer: Index::new(0),
            byte_length: USize64::from(self.bytes.len() - start),
            byte_offset: Some(USize64::from(start)),
            byte_stride: None,
            name: None,
            target: Some(Checked::Valid(target)),
            extensions: None,
            extras: None,
        })
    }

    /// Adds triangles. Positions are f32 as glTF has no others; offsets of large parts are not
    /// taken off, so 1 m keeps 0.1 um.
    fn mesh(
        &mut self,
        name: &str,
        vertices: &[DVec3],
        triangles: &[[u32; 3]],
        colour: Colour,
    ) -> Index<json::Mesh> {
        let start = self.bytes.len();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for vertex in vertices {
            for (axis, value) in vertex.as_vec3().to_array().into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(value), high[axis].max(value));
                self.bytes.extend(value.to_le_bytes());
            }
        }
        let points = self.view(start, buffer::Target::ArrayBuffer);
        let start = self.bytes.len();
        self.bytes.extend(triangles.iter().flatten().flat_map(|index| index.to_le_bytes()));
        let corners = self.view(start, buffer::Target::ElementArrayBuffer);
        let list = |view, count, component, kind| json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Checked::Valid(accessor::GenericComponentType(component)),
            type_: Checked::Valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: None,
        };
        let points = self.root.push(json::Accessor {
            min: Some(low.to_vec().into()),
            max: Some(high.to_vec().into()),
            ..list(points, vertices.len(), accessor::ComponentType::F32, accessor::Type::Vec3)
        });
        let corners = self.root.push(list(
            corners,
            3 * triangles.len(),
            accessor::ComponentType::U32,
            accessor::Type::Scalar,
        ));
        self.root.push(json::Mesh {
            name: Some(name.to_owned()),
            primitives: vec![mesh::Primitive {
                attributes: [(Checked::Valid(mesh::Semantic::Positions), points)].into(),
                indices: Some(corners),
                material: Some(Index::new(colour as u32)),
                mode: Checked::Valid(mesh::Mode::Triangles),
                targets: None,
                extensions: None,
                extras: None,
            }],
            weights: None,
            extensions: None,
            extras: None,
        })
    }
}

/// A node in this place.
fn node(name: String, at: &Frame) -> json::Node {
    json::Node { name: Some(name), matrix: Some(columns(at)), ..Default::default() }
}

/// A drawn body: its mesh for the best grip and for the others, and its place in the grip frame.
struct Drawn {
    name: String,
    meshes: [Index<json::Mesh>; 2],
    frame: Frame,
}

/// A gripper's bodies, in the frames of its jaws, which are half a turn apart, and of its palm.
struct Bodies {
    fingers: [Vec<Drawn>; 2],
    palm: Vec<Drawn>,
    pads: [Option<Index<json::Mesh>>; 2],
}

impl Bodies {
    fn of(view: &View<'_>, scene: &mut Scene) -> Self {
        let Some(gripper) = &view.gripper else {
            return Self { fingers: [Vec::new(), Vec::new()], palm: Vec::new(), pads: [None; 2] };
        };
        let mut pad = |ring: &Ring| {
            let (vertices, triangles) = prism(ring);
            (!triangles.is_empty()).then(|| scene.mesh("pad", &vertices, &triangles, Colour::Pad))
        };
        let first = pad(&gripper.pad);
        let second = gripper
            .pad_ii
            .as_ref()
            .map_or(first, |ring| pad(&ring.iter().rev().map(|p| DVec2::new(p.x, -p.y)).collect()));
        Self {
            fingers: Jaw::BOTH.map(|jaw| draw(scene, gripper.bodies(jaw))),
            palm: draw(scene, &gripper.palm),
            pads: [first, second],
        }
    }

    /// The gripper of one grip: its node. `variant`: which of the colours.
    fn place(
        &self,
        view: &View<'_>,
        scene: &mut Scene,
        grip: &RankedGrip,
        variant: usize,
    ) -> Index<json::Node> {
        // Readers tell nodes apart by their names.
        let id = format!("grip_{}", grip.grip.id);
        let gap = view.gap(grip);
        let gripper = view.gripper.as_ref();
        let put = |scene: &mut Scene, bodies: &[Drawn], jaw: &str, at: &Frame| -> Vec<_> {
            let node = |body: &Drawn| json::Node {
                mesh: Some(body.meshes[variant]),
                ..node(format!("{id}/{jaw}{}", body.name), &at.compose(&body.frame))
            };
            bodies.iter().map(|body| scene.root.push(node(body))).collect()
        };
        let at = gripper.map_or(Frame::IDENTITY, |gripper| gripper.palm_place(gap));
        let mut jaws = put(scene, &self.palm, "", &at);
        for (index, (jaw, name)) in Jaw::BOTH.into_iter().zip(["jaw_i", "jaw_ii"]).enumerate() {
            let mut children =
                put(scene, &self.fingers[index], &format!("{name}/"), &Frame::IDENTITY);
            children.extend(self.pads[index].map(|pad| {
                scene.root.push(json::Node {
                    mesh: Some(pad),
                    name: Some(format!("{id}/{name}/pad")),
                    ..Default::default()
                })
            }));
            let at = gripper.map_or(jaw.at(gap / 2.0), |gripper| gripper.jaw_at(jaw, gap, 0.0));
            let rotation = DQuat::from_mat3(&at.rotation).as_quat().to_array();
            jaws.push(scene.root.push(json::Node {
                name: Some(format!("{id}/{name}")),
                translation: Some(at.origin.as_vec3().to_array()),
                rotation: Some(scene::UnitQuaternion(rotation)),
                children: (!children.is_empty()).then_some(children),
                ..Default::default()
            }));
        }
        scene.root.push(json::Node {
            children: Some(jaws),
            ..node(format!("{id}/gripper"), &view.grip_from_tool(grip).inverse())
        })
    }
}

pub(super) fn write(
    view: &View<'_>,
    writer: &mut impl Write,
    part: Option<&Mesh>,
) -> std::io::Result<()> {
    let mut scene = Scene::new();
    let mut nodes = Vec::new();
    if let Some(part) = part.filter(|part| !part.triangles.is_empty()) {
        let mesh = scene.mesh("part", &part.vertices, &part.triangles, Colour::Part);
        nodes.push(scene.root.push(json::Node {
            name: Some("part".to_owned()),
            mesh: Some(mesh),
            ..Default::default()
        }));
    }
    let bodies = Bodies::of(view, &mut scene);
    for (index, grip) in view.grips().iter().enumerate() {
        let gripper = bodies.place(view, &mut scene, grip, usize::from(index > 0));
        let pose = view.pose(grip);
        let about = serde_json::json!({
            "rank": grip.rank,
            "id": grip.grip.id,
            "width_m": grip.grip.width,
            "mu_s": grip.worst.mu_s,
            "score": grip.score,
            "verdict": view.verdict(grip).name(),
            "tool_frame": view.tool_frame(),
            "pose": super::matrix(&pose),
        });
        nodes.push(scene.root.push(json::Node {
            children: Some(vec![gripper]),
            extras: extras(&about)?,
            ..node(format!("grip_{}", grip.grip.id), &pose)
        }));
    }
    let about = serde_json::json!({"warnings": view.set.provenance.warnings});
    let scenes = json::Scene {
        name: Some("grips".to_owned()),
        nodes,
        extras: extras(&about)?,
        extensions: None,
    };
    scene.root.scene = Some(scene.root.push(scenes));
    if !scene.bytes.is_empty() {
        scene.root.push(json::Buffer {
            byte_length: USize64::from(scene.bytes.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        });
    }
    container(writer, &scene.root, scene.bytes)
}

fn extras(value: &serde_json::Value) -> std::io::Result<Option<Box<RawValue>>> {
    Ok(Some(serde_json::value::to_raw_value(value)?))
}

fn container(
    writer: &mut impl Write,
    document: &json::Root,
    binary: Vec<u8>,
) -> std::io::Result<()> {
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

/// A 4x4 matrix in glTF's order, column by column, in its single precision.
fn columns(frame: &Frame) -> [f32; 16] {
    let rows = super::matrix(frame);
    std::array::from_fn(|index| rows[index % 4][index / 4] as f32)
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
                    scene.mesh(&body.name, &vertices, &triangles, Colour::Best),
                    scene.mesh(&body.name, &vertices, &triangles, Colour::Other),
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

//! What stands around the part, as the page draws it.

use glam::DVec3;
use serde_json::{Value, json};

use super::decimate::decimate;
use super::payload::{Columns, matrix};
use crate::model::Frame;
use crate::part::Mesh;
use crate::results::GripSet;
use crate::scene::{Reference, Scene, Solid};

/// Triangles drawn of one obstacle.
const TRIANGLES: usize = 20_000;

/// The obstacles of the run's scene in the part frame: name, placement as a column-major 4x4
/// matrix, and shape, of which surfaces lie in columns of their own. With them, why the scene could
/// not be read, if so.
pub(super) fn obstacles(columns: &mut Columns, set: &GripSet) -> Value {
    let mut surfaces = Surfaces::default();
    let scene = set.provenance.request.candidates.scene.as_deref().map(Scene::read);
    let (list, problem) = match scene {
        None => (Vec::new(), None),
        Some(Err(error)) => (Vec::new(), Some(error.to_string())),
        Some(Ok(scene)) => {
            let part_from_world = scene.world_from_part.inverse();
            let placed = |frame: &Frame, reference| match reference {
                Reference::World => part_from_world.compose(frame),
                Reference::Part => *frame,
            };
            let one = |obstacle: &crate::scene::Obstacle| {
                let part_from_obstacle = placed(&obstacle.world_from_obstacle, obstacle.frame);
                let shape = match &obstacle.solid {
                    Solid::Box { half } => json!({ "type": "box", "half": half }),
                    Solid::HalfSpace => json!({ "type": "plane" }),
                    Solid::Mesh { mesh, .. } => surfaces.add(mesh),
                };
                json!({
                    "name": obstacle.name, "matrix": matrix(&part_from_obstacle), "shape": shape,
                })
            };
            (scene.obstacles.iter().map(one).collect(), None)
        }
    };
    columns.f32("obstacle_points", surfaces.points);
    columns.u32("obstacle_triangles", surfaces.triangles);
    json!({ "list": list, "problem": problem })
}

/// Surfaces one after another.
#[derive(Default)]
struct Surfaces {
    points: Vec<f64>,
    triangles: Vec<u32>,
}

impl Surfaces {
    /// Adds a surface; answers with its places in the columns: first number and how many.
    fn add(&mut self, mesh: &Mesh) -> Value {
        let vertex = |i: u32| mesh.vertices.get(i as usize).is_some_and(|v| v.is_finite());
        let usable = |t: &&[u32; 3]| t.iter().all(|&i| vertex(i));
        let whole: Vec<[u32; 3]> = mesh.triangles.iter().filter(usable).copied().collect();
        let finite = |v: &DVec3| if v.is_finite() { *v } else { DVec3::ZERO };
        let vertices: Vec<DVec3> = mesh.vertices.iter().map(finite).collect();
        let shown =
            if whole.len() > TRIANGLES { decimate(&vertices, &whole, TRIANGLES) } else { whole };
        // Only the vertices in use.
        let mut number = vec![u32::MAX; vertices.len()];
        let (first_point, first_corner) = (self.points.len(), self.triangles.len());
        let mut next = 0;
        for corner in shown.into_iter().flatten() {
            let known = &mut number[corner as usize];
            if *known == u32::MAX {
                *known = next;
                next += 1;
                self.points.extend(vertices[corner as usize].to_array());
            }
            self.triangles.push(*known);
        }
        json!({
            "type": "mesh",
            "points": [first_point, self.points.len() - first_point],
            "triangles": [first_corner, self.triangles.len() - first_corner],
        })
    }
}

//! A scene as a gripper meets it: its limits, and what stands in it ready for tests. Proposals and
//! the choice at run time ask the same questions of it.

use std::collections::HashMap;

use glam::DVec3;

use super::nearby::Nearby;
use super::obstacle::{Course, MeshObstacle, Room, Volumes};
use super::sweep::Phase;
use crate::gripper::{Gripper, Jaw};
use crate::model::Frame;
use crate::part::Mesh;
use crate::scene::{Obstacle, Opening, Reach, Reference, Retreat, Scene, Solid};

/// Planes of a mesh that count as walls, the largest first.
const MOST_WALLS: usize = 8;
/// Triangles whose unit normals, and distances over the mesh's size, round to the same multiple of
/// this lie in one wall.
const SAME_WALL: f64 = 1e-3;

/// Why a grip is not free in a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// The pads do not hold it; their friction over that needed with the safety asked for.
    Slips(f64),
    /// Its approach lies outside the cone, by its angle to the axis \[rad\].
    Cone(f64),
    /// The flange (or, without one, the grip) is this far from the robot's base \[m\].
    Reach(f64),
    /// It needs jaws opened this far, less than the smallest or more than the largest distance of
    /// the pads \[m\].
    Stroke(f64),
    /// A body of the gripper meets an obstacle.
    Collision {
        /// Index into [`Scene::obstacles`].
        obstacle: usize,
        /// When.
        phase: Phase,
        /// `I` or `II` for a finger body, nothing for the palm.
        jaw: &'static str,
        /// Index into the gripper's finger or palm bodies.
        body: usize,
    },
}

/// An obstacle ready for tests.
enum Ready {
    Mesh { tree: MeshObstacle, closed: bool },
    Box { outer_from_box: Frame, half: DVec3 },
    HalfSpace { normal: DVec3, offset: f64 },
}

/// The obstacles of one frame, with their places in the scene's list.
struct Obstacles {
    list: Vec<(usize, Ready)>,
    /// Of the meshes among them.
    nearby: Option<Nearby>,
}

/// A scene ready for tests.
pub(crate) struct Cell {
    world: Obstacles,
    part: Obstacles,
    names: Vec<String>,
    opening: Opening,
    approach: f64,
    retreat: Retreat,
    cone: Option<(DVec3, f64)>,
    reach: Option<Reach>,
    clearance: f64,
}

impl Cell {
    pub(crate) fn new(scene: &Scene) -> Self {
        Self {
            world: Obstacles::new(scene, Reference::World),
            part: Obstacles::new(scene, Reference::Part),
            names: scene.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect(),
            opening: scene.opening,
            approach: scene.approach,
            retreat: scene.retreat,
            cone: scene.cone,
            reach: scene.reach,
            clearance: scene.clearance,
        }
    }

    /// Distance of the pads before closing on a grip with the pads `gap` apart \[m\]; `planned` is
    /// the way of each jaw that holds where the scene names none.
    pub(crate) fn opened(&self, gripper: &Gripper, gap: f64, inside: bool, planned: f64) -> f64 {
        let opening = match self.opening {
            Opening::Full => f64::INFINITY,
            Opening::Jaw(way) => way,
            Opening::Planned => planned,
        };
        gripper.opened(gap, inside, opening)
    }

    /// The gripper's motion for a grip with the pads `gap` apart, or this distance where the stroke
    /// does not reach it.
    pub(crate) fn course(
        &self,
        gripper: &Gripper,
        gap: f64,
        inside: bool,
        planned: f64,
    ) -> Result<Course, f64> {
        let [least, most] = gripper.stroke;
        // Touching the end of the stroke is allowed, beyond rounding it is not.
        let slack = 1e-9;
        if !(least - slack..=most + slack).contains(&gap) {
            return Err(gap);
        }
        let retreat = match self.retreat {
            Retreat::Back(distance) => DVec3::NEG_X * distance,
            // Depends on each grip's pose: tested apart.
            Retreat::Along(_) => DVec3::ZERO,
        };
        Ok(Course {
            gap,
            opening: (self.opened(gripper, gap, inside, planned) - gap) / 2.0,
            approach: self.approach,
            retreat,
            clearance: self.clearance,
        })
    }

    /// Why the robot does not come to a pose, whatever stands around.
    pub(crate) fn beyond(
        &self,
        gripper: &Gripper,
        gap: f64,
        world_from_grip: &Frame,
    ) -> Option<Reason> {
        let approach = world_from_grip.rotation.x_axis;
        if let Some((axis, half_angle)) = self.cone {
            let angle = axis.dot(approach).clamp(-1.0, 1.0).acos();
            if angle > half_angle + 1e-9 {
                return Some(Reason::Cone(angle));
            }
        }
        let reach = self.reach.as_ref()?;
        let place = gripper.palm_place(gap);
        let flange =
            gripper.grip_from_flange.map_or(DVec3::ZERO, |flange| place.point(flange.origin));
        let distance = world_from_grip.point(flange).distance(reach.base);
        (!(reach.least..=reach.most).contains(&distance)).then_some(Reason::Reach(distance))
    }

    /// What the gripper meets on a course, whose volumes are given, or on the retreat after it.
    pub(crate) fn meets(
        &self,
        gripper: &Gripper,
        (course, volumes): (&Course, &Volumes),
        world_from_part: &Frame,
        part_from_grip: &Frame,
        room: &mut Room,
    ) -> Option<Reason> {
        let world_from_grip = world_from_part.compose(part_from_grip);
        let poses = [&world_from_grip, part_from_grip];
        if let Some(reason) = self.collision(volumes, poses, room) {
            return Some(reason);
        }
        let Retreat::Along(way) = self.retreat else { return None };
        let retreat = world_from_grip.rotation.transpose() * way;
        let back = Course { approach: 0.0, opening: 0.0, retreat, ..*course };
        self.collision(&Volumes::new(gripper, &back), poses, room)
    }

    fn collision(
        &self,
        volumes: &Volumes,
        [world_from_grip, part_from_grip]: [&Frame; 2],
        room: &mut Room,
    ) -> Option<Reason> {
        let found = self
            .world
            .collision(volumes, world_from_grip, room)
            .or_else(|| self.part.collision(volumes, part_from_grip, room));
        found.map(|(obstacle, volume)| {
            let (phase, jaw, body) = volumes.name(volume);
            Reason::Collision { obstacle, phase, jaw, body }
        })
    }

    /// A reason in words.
    pub(crate) fn describe(&self, reason: &Reason, gripper: &Gripper) -> String {
        match *reason {
            Reason::Slips(margin) => format!(
                "slips: the pads have {:.0} % of the friction it needs",
                (margin * 100.0).floor()
            ),
            Reason::Cone(angle) => {
                format!("approach {:.1} deg off the cone's axis", angle.to_degrees())
            }
            Reason::Reach(distance) => {
                format!("out of reach: {:.1} mm from the base", distance * 1e3)
            }
            Reason::Stroke(gap) => format!("outside the stroke: pads {:.2} mm apart", gap * 1e3),
            Reason::Collision { obstacle, phase, jaw, body } => {
                let bodies = match jaw {
                    "I" => gripper.bodies(Jaw::I),
                    "II" => gripper.bodies(Jaw::II),
                    _ => &gripper.palm,
                };
                let body = bodies.get(body).map_or("gripper", |body| body.name.as_str());
                let jaw = if jaw.is_empty() { String::new() } else { format!(" of jaw {jaw}") };
                let phase = match phase {
                    Phase::Grip => "in the grip",
                    Phase::Approach => "on the approach",
                    Phase::Retreat => "on the retreat",
                };
                format!("{body}{jaw} meets '{}' {phase}", self.names[obstacle])
            }
        }
    }

    /// What stops a grip: the name of the obstacle, or of the limit.
    pub(crate) fn stop(&self, reason: &Reason) -> &str {
        match *reason {
            Reason::Slips(_) => "slips",
            Reason::Cone(_) => "approach cone",
            Reason::Reach(_) => "reach",
            Reason::Stroke(_) => "stroke",
            Reason::Collision { obstacle, .. } => &self.names[obstacle],
        }
    }

    /// Planes beyond which obstacles begin, in the part frame: outward normals and offsets.
    pub(crate) fn walls(scene: &Scene) -> Vec<(DVec3, f64)> {
        let part_from_world = scene.world_from_part.inverse();
        let walls = |obstacle: &Obstacle| {
            let part_from_obstacle = match obstacle.frame {
                Reference::World => part_from_world.compose(&obstacle.world_from_obstacle),
                Reference::Part => obstacle.world_from_obstacle,
            };
            let planes = match &obstacle.solid {
                Solid::HalfSpace => vec![(DVec3::Z, 0.0)],
                Solid::Box { half } => (0..3)
                    .flat_map(|axis| {
                        let normal = DVec3::AXES[axis];
                        [(normal, half[axis]), (-normal, half[axis])]
                    })
                    .collect(),
                Solid::Mesh { mesh, .. } => planes(mesh),
            };
            planes.into_iter().map(move |(normal, offset): (DVec3, f64)| {
                let normal_in_part = part_from_obstacle.rotation * normal;
                let offset = offset + normal_in_part.dot(part_from_obstacle.origin);
                (normal_in_part, offset + scene.clearance)
            })
        };
        scene.obstacles.iter().flat_map(walls).collect()
    }
}

/// The largest planes of a surface, with their outward normals.
fn planes(mesh: &Mesh) -> Vec<(DVec3, f64)> {
    let (low, high) = mesh.bounding_box();
    let size = (high - low).length();
    let mut found: HashMap<[i64; 4], (f64, DVec3, f64)> = HashMap::new();
    for index in 0..mesh.triangles.len() as u32 {
        let [a, b, c] = mesh.corners(index);
        let normal = (b - a).cross(c - a);
        let area = normal.length();
        let Some(normal) = normal.try_normalize() else { continue };
        let offset = normal.dot(a);
        let steps = |value: f64| (value / SAME_WALL).round() as i64;
        let key = [steps(normal.x), steps(normal.y), steps(normal.z), steps(offset / size)];
        found.entry(key).or_insert((0.0, normal, offset)).0 += area;
    }
    let mut found: Vec<([i64; 4], (f64, DVec3, f64))> = found.into_iter().collect();
    found.sort_by(|a, b| b.1.0.total_cmp(&a.1.0).then(a.0.cmp(&b.0)));
    found.truncate(MOST_WALLS);
    found.into_iter().map(|(_, (_, normal, offset))| (normal, offset)).collect()
}

impl Obstacles {
    fn new(scene: &Scene, frame: Reference) -> Self {
        let of_frame = scene.obstacles.iter().enumerate().filter(|(_, one)| one.frame == frame);
        let list: Vec<(usize, Ready)> =
            of_frame.map(|(index, obstacle)| (index, ready(obstacle))).collect();
        let nearby = Nearby::new(|| {
            list.iter().enumerate().flat_map(|(place, (_, ready))| {
                let mesh = if let Ready::Mesh { tree, .. } = ready { Some(tree) } else { None };
                mesh.into_iter()
                    .flat_map(MeshObstacle::triangles)
                    .map(move |(triangle, corners)| (place as u32, triangle, corners))
            })
        });
        Self { list, nearby }
    }

    /// The place of an obstacle in the scene's list, and the first volume that meets it.
    fn collision(
        &self,
        volumes: &Volumes,
        outer_from_grip: &Frame,
        room: &mut Room,
    ) -> Option<(usize, usize)> {
        for (obstacle, ready) in &self.list {
            let volume = match ready {
                Ready::HalfSpace { normal, offset } => {
                    volumes.below(outer_from_grip, *normal, *offset)
                }
                Ready::Box { outer_from_box, half } => {
                    volumes.meets_box(outer_from_grip, outer_from_box, *half)
                }
                Ready::Mesh { .. } => None,
            };
            if let Some(volume) = volume {
                return Some((*obstacle, volume));
            }
        }
        let triangle = |place: u32, triangle: u32| match &self.list[place as usize].1 {
            Ready::Mesh { tree, .. } => Some(tree.triangle(triangle)),
            _ => None,
        };
        // Most collisions are guessed; that there is none only the whole search says.
        if let Some((place, volume)) = self
            .nearby
            .as_ref()
            .and_then(|nearby| volumes.guess(nearby, triangle, outer_from_grip, room))
        {
            return Some((self.list[place].0, volume));
        }
        for (obstacle, ready) in &self.list {
            let Ready::Mesh { tree, .. } = ready else { continue };
            if let Some(volume) = tree.first_met(volumes, outer_from_grip, room) {
                return Some((*obstacle, volume));
            }
        }
        self.list.iter().find_map(|(obstacle, ready)| match ready {
            Ready::Mesh { tree, closed: true } => {
                tree.contains(volumes, outer_from_grip).map(|volume| (*obstacle, volume))
            }
            _ => None,
        })
    }
}

fn ready(obstacle: &Obstacle) -> Ready {
    let pose = obstacle.world_from_obstacle;
    match &obstacle.solid {
        Solid::Mesh { mesh, closed } => {
            let placed = Mesh {
                vertices: mesh.vertices.iter().map(|vertex| pose.point(*vertex)).collect(),
                triangles: mesh.triangles.clone(),
            };
            Ready::Mesh { tree: MeshObstacle::new(&placed), closed: *closed }
        }
        Solid::Box { half } => Ready::Box { outer_from_box: pose, half: *half },
        Solid::HalfSpace => {
            let normal = pose.rotation.z_axis;
            Ready::HalfSpace { normal, offset: normal.dot(pose.origin) }
        }
    }
}

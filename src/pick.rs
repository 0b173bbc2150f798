//! The run-time choice: the first grip of a ranked list that is free in a scene, and why each one
//! before it was passed over.
//!
//! A [`Picker`] holds what does not change between picks (obstacles in a tree, swept gripper
//! bodies); [`Picker::pick`] takes the part's pose.

mod scene;

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use crate::clash::{Course, MeshObstacle, Nearby, Room, Volumes};
use crate::error::{Error, Result};
use crate::gripper::{Gripper, Jaw};
use crate::model::{Frame, Grip};
use crate::results::{GripSet, Verdict};

pub use crate::clash::Phase;
pub use scene::{Obstacle, Opening, Reach, Retreat, Scene, Solid};

/// Grips that one thread tests after each other. What a piece remembers of the last collision stays
/// within it, so that reasons do not depend on the number of threads.
const PIECE: usize = 64;

/// Why a grip was passed over.
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

/// The outcome of a pick.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Pick {
    /// Index into the list of the first free grip.
    pub chosen: Option<usize>,
    /// Why each grip before it (or every grip) was passed over, in order.
    pub passed: Vec<Reason>,
}

/// An obstacle ready for tests.
enum Ready {
    Mesh { tree: MeshObstacle, closed: bool },
    Box { world_from_box: Frame, half: DVec3 },
    HalfSpace { normal: DVec3, offset: f64 },
}

/// A list of grips and a scene, ready to pick.
pub struct Picker<'a> {
    set: &'a GripSet,
    scene: &'a Scene,
    allow_slip: bool,
    gripper: Gripper,
    obstacles: Vec<Ready>,
    /// Of the meshes among them.
    nearby: Option<Nearby>,
    /// Swept bodies for each width that occurs, and the number of those of each grip; without them
    /// the stroke does not suffice.
    volumes: Vec<Volumes>,
    volumes_of: Vec<std::result::Result<u32, f64>>,
}

impl<'a> Picker<'a> {
    /// Prepares to pick from `set` in `scene`.
    ///
    /// # Errors
    /// When the gripper in `set` cannot be read.
    pub fn new(set: &'a GripSet, scene: &'a Scene) -> Result<Self> {
        let gripper: Gripper = serde_json::from_value(set.gripper.clone()).map_err(|error| {
            Error::input(
                "gripper in the result file",
                format!("cannot be read: {error}"),
                "write the result again with `gripfast plan`",
            )
        })?;
        let obstacles: Vec<Ready> = scene.obstacles.iter().map(ready).collect();
        let nearby = Nearby::new(|| {
            obstacles.iter().enumerate().flat_map(|(obstacle, ready)| {
                let mesh = if let Ready::Mesh { tree, .. } = ready { Some(tree) } else { None };
                mesh.into_iter()
                    .flat_map(MeshObstacle::triangles)
                    .map(move |(triangle, corners)| (obstacle as u32, triangle, corners))
            })
        });
        let mut picker = Self {
            set,
            scene,
            allow_slip: false,
            gripper,
            obstacles,
            nearby,
            volumes: Vec::new(),
            volumes_of: Vec::with_capacity(set.grips.len()),
        };
        let mut known: HashMap<(u64, bool), std::result::Result<u32, f64>> = HashMap::new();
        for ranked in &set.grips {
            let entry = known
                .entry((ranked.grip.width.to_bits(), ranked.grip.inside))
                .or_insert_with(|| {
                    let course = picker.course(&ranked.grip)?;
                    picker.volumes.push(Volumes::new(&picker.gripper, &course));
                    Ok(picker.volumes.len() as u32 - 1)
                });
            picker.volumes_of.push(*entry);
        }
        Ok(picker)
    }

    /// Takes grips too that slip, see [`GripSet::verdict`]; they are passed over otherwise.
    #[must_use]
    pub fn allow_slip(mut self, allow: bool) -> Self {
        self.allow_slip = allow;
        self
    }

    /// The gripper's motion for a grip, or the distance of the pads that its stroke does not reach.
    fn course(&self, grip: &Grip) -> std::result::Result<Course, f64> {
        let [least, most] = self.gripper.stroke;
        let gap = self.gripper.jaw_gap(grip);
        // Touching the end of the stroke is allowed, beyond rounding it is not.
        let slack = 1e-9;
        if !(least - slack..=most + slack).contains(&gap) {
            return Err(gap);
        }
        let retreat = match self.scene.retreat {
            Retreat::Back(distance) => DVec3::NEG_X * distance,
            // Depends on each grip's pose: tested apart.
            Retreat::Along(_) => DVec3::ZERO,
        };
        Ok(Course {
            gap,
            opening: (self.opened(grip) - gap) / 2.0,
            approach: self.scene.approach,
            retreat,
            clearance: self.scene.clearance,
        })
    }

    /// The first free grip with the part at `world_from_part`.
    ///
    /// The answer, reasons included, is the same for any number of threads.
    pub fn pick(&self, world_from_part: &Frame) -> Pick {
        let mut pick = Pick::default();
        // Small groups first: most often one of the first grips is free, and a group is tested
        // whole.
        let mut size = PIECE;
        while pick.chosen.is_none() && pick.passed.len() < self.set.grips.len() {
            let start = pick.passed.len();
            let end = (start + size).min(self.set.grips.len());
            let piece = |first: usize| self.piece(first..(first + PIECE).min(end), world_from_part);
            // One piece is not worth waking the threads.
            let pieces: Vec<(Vec<Reason>, bool)> = if end - start <= PIECE {
                vec![piece(start)]
            } else {
                (start..end).into_par_iter().step_by(PIECE).map(piece).collect()
            };
            for (reasons, free) in pieces {
                pick.passed.extend(reasons);
                if free {
                    pick.chosen = Some(pick.passed.len());
                    break;
                }
            }
            size = (size * 4).min(1 << 14);
        }
        pick
    }

    /// Why the grip of this index is not free with the part at `world_from_part`; `None` when it
    /// is, or when there is no such grip.
    ///
    /// Of several collisions any may be named; [`Self::pick`] may name another one than this.
    pub fn check(&self, index: usize, world_from_part: &Frame) -> Option<Reason> {
        if index >= self.set.grips.len() {
            return None;
        }
        self.reason(index, world_from_part, &mut Room::default())
    }

    /// Reasons of a run of grips up to the first free one, and whether there is one.
    fn piece(&self, grips: std::ops::Range<usize>, world_from_part: &Frame) -> (Vec<Reason>, bool) {
        let mut reasons = Vec::with_capacity(grips.len());
        let mut room = Room::default();
        for index in grips {
            match self.reason(index, world_from_part, &mut room) {
                Some(reason) => reasons.push(reason),
                None => return (reasons, true),
            }
        }
        (reasons, false)
    }

    /// Why a grip is not free, cheapest questions first.
    fn reason(&self, index: usize, world_from_part: &Frame, room: &mut Room) -> Option<Reason> {
        if !self.allow_slip
            && let Verdict::Slips { margin } = self.set.verdict(&self.set.grips[index])
        {
            return Some(Reason::Slips(margin));
        }
        let world_from_grip = world_from_part.compose(&self.set.grips[index].grip.part_from_grip);
        let approach = world_from_grip.rotation.x_axis;
        if let Some((axis, half_angle)) = self.scene.cone {
            let angle = axis.dot(approach).clamp(-1.0, 1.0).acos();
            if angle > half_angle + 1e-9 {
                return Some(Reason::Cone(angle));
            }
        }
        if let Some(reach) = &self.scene.reach {
            let place = self.gripper.palm_place(self.gripper.jaw_gap(&self.set.grips[index].grip));
            let flange = self.gripper.grip_from_flange;
            let flange = flange.map_or(DVec3::ZERO, |flange| place.point(flange.origin));
            let distance = world_from_grip.point(flange).distance(reach.base);
            if !(reach.least..=reach.most).contains(&distance) {
                return Some(Reason::Reach(distance));
            }
        }
        let volumes = match self.volumes_of[index] {
            Ok(volumes) => &self.volumes[volumes as usize],
            Err(gap) => return Some(Reason::Stroke(gap)),
        };
        if let Some((obstacle, volume)) = self.collision(volumes, &world_from_grip, room) {
            return Some(explain(obstacle, volumes, volume));
        }
        let Retreat::Along(way) = self.scene.retreat else { return None };
        let grip = &self.set.grips[index].grip;
        let course = self.course(grip).ok()?;
        let retreat = world_from_grip.rotation.transpose() * way;
        let volumes =
            Volumes::new(&self.gripper, &Course { approach: 0.0, opening: 0.0, retreat, ..course });
        self.collision(&volumes, &world_from_grip, room)
            .map(|(obstacle, volume)| explain(obstacle, &volumes, volume))
    }

    /// An obstacle and the first volume that meets it.
    fn collision(
        &self,
        volumes: &Volumes,
        world_from_grip: &Frame,
        room: &mut Room,
    ) -> Option<(usize, usize)> {
        for (obstacle, ready) in self.obstacles.iter().enumerate() {
            let volume = match ready {
                Ready::HalfSpace { normal, offset } => {
                    volumes.below(world_from_grip, *normal, *offset)
                }
                Ready::Box { world_from_box, half } => {
                    volumes.meets_box(world_from_grip, world_from_box, *half)
                }
                Ready::Mesh { .. } => None,
            };
            if let Some(volume) = volume {
                return Some((obstacle, volume));
            }
        }
        let triangle = |obstacle: u32, triangle: u32| match &self.obstacles[obstacle as usize] {
            Ready::Mesh { tree, .. } => Some(tree.triangle(triangle)),
            _ => None,
        };
        // Most collisions are guessed; that there is none only the whole search says.
        if let Some(found) = self
            .nearby
            .as_ref()
            .and_then(|nearby| volumes.guess(nearby, triangle, world_from_grip, room))
        {
            return Some(found);
        }
        for (obstacle, ready) in self.obstacles.iter().enumerate() {
            let Ready::Mesh { tree, .. } = ready else { continue };
            if let Some(volume) = tree.first_met(volumes, world_from_grip, room) {
                return Some((obstacle, volume));
            }
        }
        self.obstacles.iter().enumerate().find_map(|(obstacle, ready)| match ready {
            Ready::Mesh { tree, closed: true } => {
                tree.contains(volumes, world_from_grip).map(|volume| (obstacle, volume))
            }
            _ => None,
        })
    }

    /// A reason in words.
    pub fn describe(&self, reason: &Reason) -> String {
        match *reason {
            Reason::Slips(margin) => {
                format!(
                    "slips: the pads have {:.0} % of the friction it needs at {} N per jaw",
                    (margin * 100.0).floor(),
                    self.set.provenance.resolved.force.0
                )
            }
            Reason::Cone(angle) => {
                format!("approach {:.1} deg off the cone's axis", angle.to_degrees())
            }
            Reason::Reach(distance) => {
                format!("out of reach: {:.1} mm from the base", distance * 1e3)
            }
            Reason::Stroke(gap) => format!("outside the stroke: pads {:.2} mm apart", gap * 1e3),
            Reason::Collision { obstacle, phase, jaw, body } => {
                let bodies = match jaw {
                    "I" => self.gripper.bodies(Jaw::I),
                    "II" => self.gripper.bodies(Jaw::II),
                    _ => &self.gripper.palm,
                };
                let body = bodies.get(body).map_or("gripper", |body| body.name.as_str());
                let jaw = if jaw.is_empty() { String::new() } else { format!(" of jaw {jaw}") };
                let phase = match phase {
                    Phase::Grip => "in the grip",
                    Phase::Approach => "on the approach",
                    Phase::Retreat => "on the retreat",
                };
                format!("{body}{jaw} meets '{}' {phase}", self.scene.obstacles[obstacle].name)
            }
        }
    }

    /// A reason in one or two words, for counting.
    pub fn category(&self, reason: &Reason) -> String {
        match *reason {
            Reason::Slips(_) => "slips".into(),
            Reason::Cone(_) => "approach cone".into(),
            Reason::Reach(_) => "reach".into(),
            Reason::Stroke(_) => "stroke".into(),
            Reason::Collision { obstacle, .. } => {
                format!("collision with '{}'", self.scene.obstacles[obstacle].name)
            }
        }
    }

    /// Distance of the pads before closing on a grip \[m\].
    pub fn opened(&self, grip: &Grip) -> f64 {
        let opening = match self.scene.opening {
            Opening::Full => f64::INFINITY,
            Opening::Jaw(way) => way,
            // As the interference of the list was checked.
            Opening::Planned => self.set.provenance.request.candidates.opening.0,
        };
        self.gripper.opened_gap(grip, opening)
    }

    /// The gripper of the list.
    pub fn gripper(&self) -> &Gripper {
        &self.gripper
    }
}

fn explain(obstacle: usize, volumes: &Volumes, volume: usize) -> Reason {
    let (phase, jaw, body) = volumes.name(volume);
    Reason::Collision { obstacle, phase, jaw, body }
}

fn ready(obstacle: &Obstacle) -> Ready {
    let pose = obstacle.world_from_obstacle;
    match &obstacle.solid {
        Solid::Mesh { mesh, closed } => {
            let placed = crate::part::Mesh {
                vertices: mesh.vertices.iter().map(|vertex| pose.point(*vertex)).collect(),
                triangles: mesh.triangles.clone(),
            };
            Ready::Mesh { tree: MeshObstacle::new(&placed), closed: *closed }
        }
        Solid::Box { half } => Ready::Box { world_from_box: pose, half: *half },
        Solid::HalfSpace => {
            let normal = pose.rotation.z_axis;
            Ready::HalfSpace { normal, offset: normal.dot(pose.origin) }
        }
    }
}

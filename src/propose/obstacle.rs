//! A gripper among the obstacles of a scene: the volumes that its bodies sweep, tested against meshes, boxes and half-spaces.
//!
//! The same swept bodies and the same tree of triangles as for the part, but for any pose: a swept body is a box in the grip
//! frame, a node of the tree a box in the world, and six of their fifteen separating axes decide which nodes to open.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::sweep::{Stage, Sweep};
use super::tree::{Topology, Tree};
use crate::gripper::{Body, Gripper, half_turn};
use crate::model::Frame;
use crate::part::Mesh;

/// Nodes smaller than this share of a query's smallest half size are handed on to the single bodies unopened.
const FINE: f64 = 0.5;
/// Direction of the rays of [`MeshObstacle::contains`]: along no edge or face that a person would draw.
const RAY: DVec3 = DVec3::new(0.267_261_241_912_424_4, 0.534_522_483_824_848_8, 0.801_783_725_737_273_2);

/// How a gripper moves on to a grip and away from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Course {
    /// Distance of the pads in the grip [m].
    pub(crate) gap: f64,
    /// Way of each jaw from contact to the opening for the approach [m], outwards positive.
    pub(crate) opening: f64,
    /// Length of the approach along `x1` [m].
    pub(crate) approach: f64,
    /// Way of the retreat with closed jaws, grip frame [m].
    pub(crate) retreat: DVec3,
    /// Distance kept from obstacles [m].
    pub(crate) clearance: f64,
}

/// When a body meets an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Phase {
    /// In the grip, or while the jaws close.
    Grip,
    /// On the straight way to the grip with opened jaws.
    Approach,
    /// On the way back with closed jaws.
    Retreat,
}

/// One swept body.
#[derive(Debug, Clone)]
struct Volume {
    phase: Phase,
    body: usize,
    sweep: Sweep,
}

/// The volumes of one course, in the grip frame.
#[derive(Debug, Clone)]
pub(crate) struct Volumes {
    list: Vec<Volume>,
    low: DVec3,
    high: DVec3,
}

impl Volumes {
    /// Fingers, then palm, phase by phase.
    pub(crate) fn new(gripper: &Gripper, course: &Course) -> Self {
        let grown = DVec3::splat(course.clearance);
        let mut list = Vec::new();
        let mut add = |phase, body: usize, placed: Body, jaw, path| {
            list.push(Volume { phase, body, sweep: Sweep::grown(placed, jaw, Stage::Grip, path, grown) });
        };
        let mut fingers = |phase, offset: f64, path: &dyn Fn(DVec3) -> DVec3| {
            for (side, jaw) in [(1.0, "I"), (-1.0, "II")] {
                let rotation = if side > 0.0 { DMat3::IDENTITY } else { half_turn() };
                let place = Frame { rotation, origin: DVec3::Z * side * offset };
                for (index, body) in gripper.fingers.iter().enumerate() {
                    add(phase, index, body.moved(&place), jaw, path(DVec3::Z * side));
                }
            }
        };
        let back = DVec3::NEG_X * course.approach;
        fingers(Phase::Grip, course.gap / 2.0, &|outwards| outwards * course.opening);
        fingers(Phase::Approach, course.gap / 2.0 + course.opening, &|_| back);
        if course.retreat != DVec3::ZERO {
            fingers(Phase::Retreat, course.gap / 2.0, &|_| course.retreat);
        }
        // Straight back the palm passes where it came from.
        let known = course.retreat.y == 0.0 && course.retreat.z == 0.0 && course.retreat.x <= 0.0 && -course.retreat.x <= course.approach;
        for (index, body) in gripper.palm.iter().enumerate() {
            add(Phase::Approach, index, body.clone(), "", back);
            if !known {
                add(Phase::Retreat, index, body.clone(), "", course.retreat);
            }
        }
        // The palm's place in the grip is a part of its approach; it is listed so that messages tell the two apart.
        for (index, body) in gripper.palm.iter().enumerate() {
            add(Phase::Grip, index, body.clone(), "", DVec3::ZERO);
        }
        list.sort_by_key(|volume| (volume.phase, volume.sweep.jaw.is_empty()));
        let (low, high) =
            list.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), volume| (low.min(volume.sweep.low), high.max(volume.sweep.high)));
        Self { list, low, high }
    }

    /// Phase, jaw (`I`, `II`, or nothing for the palm) and the body's index among the gripper's fingers or palm bodies.
    pub(crate) fn name(&self, volume: usize) -> (Phase, &'static str, usize) {
        let volume = &self.list[volume];
        (volume.phase, volume.sweep.jaw, volume.body)
    }

    /// The first volume that reaches below the plane `normal . x = offset` (world).
    pub(crate) fn below(&self, world_from_grip: &Frame, normal: DVec3, offset: f64) -> Option<usize> {
        let height = normal.dot(world_from_grip.origin) - offset;
        let down = world_from_grip.rotation.transpose() * -normal;
        self.list.iter().position(|volume| height - volume.sweep.support_point(down).dot(down) < 0.0)
    }

    /// The first volume that meets the box of these half sizes about the origin of `world_from_box`.
    pub(crate) fn meets_box(&self, world_from_grip: &Frame, world_from_box: &Frame, half: DVec3) -> Option<usize> {
        let box_from_grip = world_from_box.inverse().compose(world_from_grip);
        if self.list.is_empty() || !Query::new(&box_from_grip, self.low, self.high).overlaps(DVec3::ZERO, half) {
            return None;
        }
        self.list.iter().position(|Volume { sweep, .. }| {
            Query::new(&box_from_grip, sweep.low, sweep.high).overlaps(DVec3::ZERO, half) && sweep.meets_box(&box_from_grip, -half, half)
        })
    }

    /// Whether a volume meets a triangle of the world.
    pub(crate) fn meets(&self, volume: usize, world_from_grip: &Frame, corners: [DVec3; 3]) -> bool {
        let turn = world_from_grip.rotation.transpose();
        self.list.get(volume).is_some_and(|volume| volume.sweep.meets(corners.map(|corner| turn * (corner - world_from_grip.origin))))
    }
}

/// A box of the grip frame as seen from the world.
struct Query {
    turn: DMat3,
    absolute: DMat3,
    middle: DVec3,
    half: DVec3,
    /// Half sizes of the box around it along the world's axes.
    reach: DVec3,
}

impl Query {
    fn new(world_from_grip: &Frame, low: DVec3, high: DVec3) -> Self {
        let half = (high - low) / 2.0;
        let rotation = world_from_grip.rotation;
        let absolute = DMat3::from_cols(rotation.x_axis.abs(), rotation.y_axis.abs(), rotation.z_axis.abs());
        Self { turn: rotation.transpose(), absolute: absolute.transpose(), middle: world_from_grip.point((low + high) / 2.0), half, reach: absolute * half }
    }

    /// Whether no face direction of either box separates them; the nine edge directions are left to the exact tests.
    fn overlaps(&self, middle: DVec3, half: DVec3) -> bool {
        let apart = middle - self.middle;
        apart.abs().cmple(self.reach + half).all() && (self.turn * apart).abs().cmple(self.half + self.absolute * half).all()
    }
}

/// A triangle mesh in the world.
#[derive(Debug)]
pub(crate) struct MeshObstacle {
    tree: Tree,
}

impl MeshObstacle {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        Self { tree: Tree::new(&Arc::new(Topology::new(mesh)), DMat3::IDENTITY) }
    }

    /// The first volume that meets the surface, with a triangle that it meets. `near` is room for the search.
    pub(crate) fn first_met(&self, volumes: &Volumes, world_from_grip: &Frame, near: &mut Vec<u32>) -> Option<(usize, [DVec3; 3])> {
        near.clear();
        if self.tree.is_empty() || volumes.list.is_empty() {
            return None;
        }
        // The nodes near the whole gripper, once for all volumes.
        let query = Query::new(world_from_grip, volumes.low, volumes.high);
        let fine = query.half.min_element() * FINE;
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            let (middle, half) = self.tree.bounds(node);
            if !query.overlaps(middle, half) {
                continue;
            }
            match self.tree.children(node) {
                Some(children) if half.max_element() > fine => stack.extend(children),
                _ => near.push(node),
            }
        }
        if near.is_empty() {
            return None;
        }
        let turn = world_from_grip.rotation.transpose();
        volumes.list.iter().enumerate().find_map(|(volume, Volume { sweep, .. })| {
            let query = Query::new(world_from_grip, sweep.low, sweep.high);
            stack.extend_from_slice(near);
            while let Some(node) = stack.pop() {
                let (middle, half) = self.tree.bounds(node);
                if !query.overlaps(middle, half) {
                    continue;
                }
                match self.tree.children(node) {
                    Some(children) => stack.extend(children),
                    None => {
                        let met = self
                            .tree
                            .triangles(node)
                            .map(|(_, corners)| corners)
                            .find(|corners| sweep.meets(corners.map(|corner| turn * (corner - world_from_grip.origin))));
                        if let Some(corners) = met {
                            stack.clear();
                            return Some((volume, corners));
                        }
                    }
                }
            }
            None
        })
    }

    /// The first volume of the grip itself whose middle lies inside the closed surface: a body that meets no triangle is either
    /// wholly outside or wholly inside.
    pub(crate) fn contains(&self, volumes: &Volumes, world_from_grip: &Frame) -> Option<usize> {
        volumes
            .list
            .iter()
            .position(|Volume { phase, sweep, .. }| *phase == Phase::Grip && self.crossings(world_from_grip.point((sweep.low + sweep.high) / 2.0)) % 2 == 1)
    }

    /// Triangles that a ray from `start` crosses.
    fn crossings(&self, start: DVec3) -> usize {
        let mut count = 0;
        let mut stack = if self.tree.is_empty() { Vec::new() } else { vec![0] };
        while let Some(node) = stack.pop() {
            let (middle, half) = self.tree.bounds(node);
            let (near, far) = ((middle - half - start) / RAY, (middle + half - start) / RAY);
            if near.max_element().max(0.0) > far.min_element() {
                continue;
            }
            match self.tree.children(node) {
                Some(children) => stack.extend(children),
                None => count += self.tree.triangles(node).filter(|(_, corners)| crosses(start, *corners)).count(),
            }
        }
        count
    }
}

/// Whether the ray crosses the triangle (Moeller and Trumbore 1997). A ray through an edge counts for one side of it only.
fn crosses(start: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    let side = RAY.cross(ac);
    let determinant = ab.dot(side);
    if determinant == 0.0 {
        return false;
    }
    let from = start - a;
    let u = from.dot(side) / determinant;
    let q = from.cross(ab);
    let v = RAY.dot(q) / determinant;
    (0.0..1.0).contains(&u) && v >= 0.0 && u + v < 1.0 && ac.dot(q) / determinant > 0.0
}

//! A gripper among the obstacles of a scene: the volumes that its bodies sweep, tested against
//! meshes, boxes and half-spaces.
//!
//! The same swept bodies and the same tree of triangles as for the part, but for any pose: a swept
//! body is a box in the grip frame, a node of the tree a box in the world, and six of their fifteen
//! separating axes decide which nodes to open. Boxes are compared in single precision with slack;
//! bodies and triangles meet in double precision.

use std::sync::Arc;

use glam::{DMat3, DVec3, Mat3A, Vec3A};

use super::nearby::Nearby;
use super::sweep::{Phase, Sweep};
use super::tree::{Topology, Tree};
use crate::gripper::{Body, Gripper, Jaw};
use crate::model::Frame;
use crate::part::Mesh;

/// Nodes smaller than this share of a query's smallest half size are handed on to the single bodies
/// unopened.
const FINE: f32 = 0.5;
/// Steps of [`Volumes::guess`] for each volume.
const STEPS: usize = 4;
/// Direction of the rays of [`MeshObstacle::contains`]: along no edge or face that a person would
/// draw.
const RAY: DVec3 =
    DVec3::new(0.267_261_241_912_424_4, 0.534_522_483_824_848_8, 0.801_783_725_737_273_2);

/// How a gripper moves on to a grip and away from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Course {
    /// Distance of the pads in the grip \[m\].
    pub(crate) gap: f64,
    /// Half of the way by which the pads go apart from contact to the opening for the approach
    /// \[m\], outwards positive.
    pub(crate) opening: f64,
    /// Length of the approach along `x1` \[m\].
    pub(crate) approach: f64,
    /// Way of the retreat with closed jaws, grip frame \[m\].
    pub(crate) retreat: DVec3,
    /// Distance kept from obstacles \[m\].
    pub(crate) clearance: f64,
}

/// One swept body.
#[derive(Debug, Clone)]
struct Volume {
    /// Its place among the fingers' or the palm's bodies.
    body: usize,
    sweep: Sweep,
    /// Smallest and largest coordinates, grip frame.
    bounds: [Vec3A; 2],
}

/// The volumes of one course, in the grip frame.
#[derive(Debug, Clone)]
pub(crate) struct Volumes {
    list: Vec<Volume>,
    /// Smallest and largest coordinates of all together.
    bounds: [Vec3A; 2],
}

impl Volumes {
    /// Fingers, then palm, phase by phase.
    pub(crate) fn new(gripper: &Gripper, course: &Course) -> Self {
        let grown = DVec3::splat(course.clearance);
        let palm = gripper.palm_at(course.gap);
        let mut list = Vec::new();
        let mut add = |phase, body: usize, placed: Body, jaw, path, grown| {
            let sweep = Sweep::grown(placed, jaw, phase, path, grown);
            let bounds = [sweep.low.as_vec3a(), sweep.high.as_vec3a()];
            list.push(Volume { body, sweep, bounds });
        };
        let back = DVec3::NEG_X * course.approach;
        for jaw in Jaw::BOTH {
            let outs = [0.0, gripper.way(jaw, course.opening)];
            let bulge = gripper.bulge(jaw, course.gap, outs);
            let [at_grip, away] = outs.map(|out| gripper.jaw_at(jaw, course.gap, out));
            let closing = away.origin - at_grip.origin;
            for (index, body) in gripper.bodies(jaw).iter().enumerate() {
                let mut finger = |phase, place: &Frame, path, grown| {
                    add(phase, index, body.moved(place), jaw.name(), path, grown);
                };
                finger(Phase::Grip, &at_grip, closing, grown + DVec3::X * bulge);
                finger(Phase::Approach, &away, back, grown);
                if course.retreat != DVec3::ZERO {
                    finger(Phase::Retreat, &at_grip, course.retreat, grown);
                }
            }
        }
        // Straight back the palm passes where it came from.
        let known = course.retreat.y == 0.0
            && course.retreat.z == 0.0
            && course.retreat.x <= 0.0
            && -course.retreat.x <= course.approach;
        for (index, body) in palm.iter().enumerate() {
            add(Phase::Approach, index, body.clone(), "", back, grown);
            if !known {
                add(Phase::Retreat, index, body.clone(), "", course.retreat, grown);
            }
        }
        // The palm's place in the grip is a part of its approach; it is listed so that messages
        // tell the two apart.
        for (index, body) in palm.iter().enumerate() {
            add(Phase::Grip, index, body.clone(), "", DVec3::ZERO, grown);
        }
        list.sort_by_key(|volume| (volume.sweep.phase, volume.sweep.jaw.is_empty()));
        let bounds = list
            .iter()
            .fold([Vec3A::INFINITY, Vec3A::NEG_INFINITY], |[low, high], Volume { bounds, .. }| {
                [low.min(bounds[0]), high.max(bounds[1])]
            });
        Self { list, bounds }
    }

    /// Phase, jaw (`I`, `II`, or nothing for the palm) and the body's index among the gripper's
    /// fingers or palm bodies.
    pub(crate) fn name(&self, volume: usize) -> (Phase, &'static str, usize) {
        let volume = &self.list[volume];
        (volume.sweep.phase, volume.sweep.jaw, volume.body)
    }

    /// The first volume that reaches below the plane `normal . x = offset` (world).
    pub(crate) fn below(
        &self,
        world_from_grip: &Frame,
        normal: DVec3,
        offset: f64,
    ) -> Option<usize> {
        let height = normal.dot(world_from_grip.origin) - offset;
        let down = world_from_grip.rotation.transpose() * -normal;
        // The box around all of them first, with slack for its rounding to single precision.
        let [low, high] = self.bounds.map(|corner| corner.as_dvec3());
        if height - DVec3::select(down.cmpge(DVec3::ZERO), high, low).dot(down)
            > 1e-6 * low.abs().max(high.abs()).element_sum()
        {
            return None;
        }
        self.list
            .iter()
            .position(|volume| height - volume.sweep.support_point(down).dot(down) < 0.0)
    }

    /// The first volume that meets the box of these half sizes about the origin of
    /// `world_from_box`.
    pub(crate) fn meets_box(
        &self,
        world_from_grip: &Frame,
        world_from_box: &Frame,
        half: DVec3,
    ) -> Option<usize> {
        let box_from_grip = world_from_box.inverse().compose(world_from_grip);
        let pose = Pose::new(&box_from_grip);
        let (extent, solid) = (half.max_element() as f32, [-half.as_vec3a(), half.as_vec3a()]);
        if self.list.is_empty() || !pose.query(self.bounds, extent).overlaps(solid) {
            return None;
        }
        self.list.iter().position(|Volume { sweep, bounds, .. }| {
            pose.query(*bounds, extent).overlaps(solid)
                && sweep.meets_box(&box_from_grip, -half, half)
        })
    }

    /// A volume that meets a triangle among those of `nearby`, `triangle` giving their corners in
    /// the world: most of those that meet are found, and what is found is true. Returns the
    /// triangle's surface and the volume.
    pub(crate) fn guess(
        &self,
        nearby: &Nearby,
        triangle: impl Fn(u32, u32) -> Option<[DVec3; 3]>,
        world_from_grip: &Frame,
        room: &mut Room,
    ) -> Option<(usize, usize)> {
        let pose = Pose::new(world_from_grip);
        let close = nearby.fineness().powi(2);
        // What met last meets next.
        let first = room.last.min(self.list.len());
        for volume in self
            .list
            .get(first)
            .map(|_| first)
            .into_iter()
            .chain((0..self.list.len()).filter(|volume| *volume != first))
        {
            let [low, high] = self.list[volume].bounds;
            let mut at = (low + high) * 0.5;
            let mut tested = None;
            for _ in 0..STEPS {
                let (seed, point) = nearby.nearest(pose.to_world(at));
                if tested == Some(seed) {
                    break;
                }
                let point = pose.to_grip(point);
                let next = point.clamp(low, high);
                if next.distance_squared(point) <= close
                    && let Some(corners) = triangle(seed.surface, seed.triangle)
                {
                    let corners = corners.map(|corner| world_from_grip.point_inverse(corner));
                    if self.list[volume].sweep.meets(corners) {
                        room.last = volume;
                        // The same triangle may stop an earlier motion.
                        let volume = self.list[..volume]
                            .iter()
                            .position(|volume| volume.sweep.meets(corners))
                            .unwrap_or(volume);
                        return Some((seed.surface as usize, volume));
                    }
                }
                (tested, at) = (Some(seed), next);
            }
        }
        None
    }
}

/// A gripper's pose in single precision, for the tests that come before the exact ones.
struct Pose {
    world_from_grip: Mat3A,
    grip_from_world: Mat3A,
    absolute: Mat3A,
    origin: Vec3A,
}

impl Pose {
    fn new(world_from_grip: &Frame) -> Self {
        let rotation = Mat3A::from_cols_array(
            &world_from_grip.rotation.to_cols_array().map(|value| value as f32),
        );
        let turn = rotation.transpose();
        let absolute = Mat3A::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
        Self {
            world_from_grip: rotation,
            grip_from_world: turn,
            absolute,
            origin: world_from_grip.origin.as_vec3a(),
        }
    }

    fn to_world(&self, point: Vec3A) -> Vec3A {
        self.world_from_grip * point + self.origin
    }

    fn to_grip(&self, point: Vec3A) -> Vec3A {
        self.grip_from_world * (point - self.origin)
    }

    /// A box of the grip frame among boxes that reach `extent` from the world's origin.
    fn query(&self, [low, high]: [Vec3A; 2], extent: f32) -> Query {
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        // Coordinates, products and sums are rounded to 2^-24 of their size, about twenty times in
        // a row.
        let size = self.origin.abs().max_element()
            + middle.abs().max_element()
            + half.max_element()
            + extent;
        let slack = Vec3A::splat(size * 2.0_f32.powi(-18));
        // Absolute values of the inverse: rows and columns exchanged.
        let reach = self.absolute.transpose() * half;
        Query {
            turn: self.grip_from_world,
            absolute: self.absolute,
            middle: self.to_world(middle),
            half: half + slack,
            reach: reach + slack,
        }
    }
}

/// A box of the grip frame as seen from the world.
struct Query {
    turn: Mat3A,
    absolute: Mat3A,
    middle: Vec3A,
    half: Vec3A,
    /// Half sizes of the box around it along the world's axes.
    reach: Vec3A,
}

impl Query {
    /// Whether no face direction of either box separates them, or hardly does; the nine edge
    /// directions are left to the exact tests.
    fn overlaps(&self, [low, high]: [Vec3A; 2]) -> bool {
        let half = (high - low) * 0.5;
        let apart = (low + high) * 0.5 - self.middle;
        apart.abs().cmple(self.reach + half).all()
            && (self.turn * apart).abs().cmple(self.half + self.absolute * half).all()
    }
}

/// Room for searches, kept from one to the next.
#[derive(Debug, Default)]
pub(crate) struct Room {
    near: Vec<u32>,
    stack: Vec<u32>,
    /// The volume that met last.
    last: usize,
}

/// A triangle mesh in the world.
#[derive(Debug)]
pub(crate) struct MeshObstacle {
    tree: Tree,
    extent: f32,
}

impl MeshObstacle {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let tree = Tree::new(&Arc::new(Topology::new(mesh)), DMat3::IDENTITY);
        let extent = if tree.is_empty() {
            0.0
        } else {
            tree.corners(0).map(|corner| corner.abs().max_element()).into_iter().fold(0.0, f32::max)
        };
        Self { tree, extent }
    }

    /// All triangles, by their number.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = (u32, [DVec3; 3])> + '_ {
        (0..self.tree.len() as u32).map(|triangle| (triangle, self.triangle(triangle)))
    }

    /// Corners of a triangle by its number.
    pub(crate) fn triangle(&self, triangle: u32) -> [DVec3; 3] {
        self.tree.triangle(triangle)
    }

    /// The first volume that meets the surface.
    pub(crate) fn first_met(
        &self,
        volumes: &Volumes,
        world_from_grip: &Frame,
        room: &mut Room,
    ) -> Option<usize> {
        let Room { near, stack, last } = room;
        near.clear();
        stack.clear();
        if self.tree.is_empty() || volumes.list.is_empty() {
            return None;
        }
        // The nodes near the whole gripper, once for all volumes.
        let pose = Pose::new(world_from_grip);
        let query = pose.query(volumes.bounds, self.extent);
        let fine = query.half.min_element() * FINE;
        stack.push(0);
        while let Some(node) = stack.pop() {
            let bounds = self.tree.corners(node);
            if !query.overlaps(bounds) {
                continue;
            }
            match self.tree.children(node) {
                Some(children) if (bounds[1] - bounds[0]).max_element() > 2.0 * fine => {
                    stack.extend(children)
                }
                _ => near.push(node),
            }
        }
        if near.is_empty() {
            return None;
        }
        volumes.list.iter().enumerate().find_map(|(volume, Volume { sweep, bounds, .. })| {
            let query = pose.query(*bounds, self.extent);
            stack.clear();
            stack.extend_from_slice(near);
            while let Some(node) = stack.pop() {
                if !query.overlaps(self.tree.corners(node)) {
                    continue;
                }
                match self.tree.children(node) {
                    Some(children) => stack.extend(children),
                    None => {
                        let mut triangles = self.tree.triangles(node).map(|(_, corners)| corners);
                        if triangles.any(|corners| {
                            sweep.meets(corners.map(|corner| world_from_grip.point_inverse(corner)))
                        }) {
                            *last = volume;
                            return Some(volume);
                        }
                    }
                }
            }
            None
        })
    }

    /// The first volume of the grip itself whose middle lies inside the closed surface: a body that
    /// meets no triangle is either wholly outside or wholly inside.
    pub(crate) fn contains(&self, volumes: &Volumes, world_from_grip: &Frame) -> Option<usize> {
        volumes.list.iter().position(|Volume { sweep, .. }| {
            sweep.phase == Phase::Grip
                && self.crossings(world_from_grip.point((sweep.low + sweep.high) / 2.0)) % 2 == 1
        })
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
                None => {
                    count += self
                        .tree
                        .triangles(node)
                        .filter(|(_, corners)| crosses(start, *corners))
                        .count()
                }
            }
        }
        count
    }
}

/// Whether the ray crosses the triangle (Moeller and Trumbore 1997). A ray through an edge counts
/// for one side of it only.
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

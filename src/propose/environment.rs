//! What surrounds the part: the ground it stands on, boxes to stay out of, and a scene.

use glam::{DVec2, DVec3};

use super::options::{Cone, Ground, ProposeOptions};
use super::site::Site;
use super::work;
use crate::clash::{Cell, Course, Reason, Room, Sweep, Volumes};
use crate::gripper::Gripper;
use crate::model::Frame;
use crate::scene::Scene;

/// A line in a site's plane: the gripper is clear of something for all grip origins with
/// `normal . place >= offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Border {
    /// Unit vector in the site's `(x, y)`.
    pub(super) normal: DVec2,
    /// \[m\].
    pub(super) offset: f64,
}

/// Planes that lean less over a site's plane have no border in it (sine of the angle).
const LEANING: f64 = 0.1;

/// The surroundings, with unit vectors.
pub(super) struct Environment {
    cone: Option<Cone>,
    ground: Option<Ground>,
    keep_out: Vec<[DVec3; 2]>,
    scene: Option<Surroundings>,
}

/// A scene with the part at its place.
struct Surroundings {
    cell: Cell,
    world_from_part: Frame,
    /// Planes beyond which obstacles begin, part frame.
    walls: Vec<(DVec3, f64)>,
}

impl Surroundings {
    fn new(scene: &Scene) -> Self {
        Self {
            cell: Cell::new(scene),
            world_from_part: scene.world_from_part,
            walls: Cell::walls(scene),
        }
    }
}

/// How a gripper moves on to the grips of a site in a scene, and what it sweeps.
pub(super) struct Way {
    gap: f64,
    /// Without one the stroke does not suffice.
    course: Option<(Course, Volumes)>,
}

impl Environment {
    pub(super) fn new(options: &ProposeOptions) -> Self {
        Self {
            cone: options.approach_cone.map(|cone| Cone { axis: cone.axis.normalize(), ..cone }),
            ground: options
                .ground
                .map(|ground| Ground { normal: ground.normal.normalize(), ..ground }),
            keep_out: options.keep_out.clone(),
            scene: options.scene.as_deref().map(Surroundings::new),
        }
    }

    /// The gripper's way to grips with the pads `gap` apart in the scene; `None` without one.
    pub(super) fn way(
        &self,
        gripper: &Gripper,
        gap: f64,
        inside: bool,
        opening: f64,
    ) -> Option<Way> {
        let course = self.scene.as_ref()?.cell.course(gripper, gap, inside, opening).ok();
        let course = course.map(|course| (course, Volumes::new(gripper, &course)));
        Some(Way { gap, course })
    }

    /// Why a pose is not free in the scene: the name of what stops it, and a sentence.
    pub(super) fn stopped(
        &self,
        gripper: &Gripper,
        way: &Way,
        part_from_grip: &Frame,
        room: &mut Room,
    ) -> Option<(String, String)> {
        let Surroundings { cell, world_from_part, .. } = self.scene.as_ref()?;
        let world_from_grip = world_from_part.compose(part_from_grip);
        let reason =
            cell.beyond(gripper, way.gap, &world_from_grip).or_else(|| match &way.course {
                None => Some(Reason::Stroke(way.gap)),
                Some((course, volumes)) => {
                    cell.meets(gripper, (course, volumes), world_from_part, part_from_grip, room)
                }
            })?;
        Some((cell.stop(&reason).to_owned(), cell.describe(&reason, gripper)))
    }

    /// Whether nothing depends on the position.
    pub(super) fn is_empty(&self) -> bool {
        self.ground.is_none() && self.keep_out.is_empty()
    }

    /// Whether the approach direction (part frame) is allowed.
    pub(super) fn allows(&self, approach: DVec3) -> bool {
        self.cone.is_none_or(|cone| cone.axis.angle_between(approach) <= cone.half_angle + 1e-9)
    }

    /// How far an approach (part frame) lies outside the cone \[rad\].
    pub(super) fn outside_cone(&self, approach: DVec3) -> Option<f64> {
        self.cone.map(|cone| cone.axis.angle_between(approach) - cone.half_angle)
    }

    /// How deep sweeps lie below the ground \[m\], and the lowest point of the first that does
    /// \[m\]; `None` where none does.
    pub(super) fn below(&self, sweeps: &[Sweep], part_from_grip: &Frame) -> Option<(f64, DVec3)> {
        let ground = self.ground?;
        let depths = self.depths(sweeps, part_from_grip);
        let first = self.grounded(&depths, part_from_grip.origin)?;
        let height = ground.normal.dot(part_from_grip.origin) - ground.offset;
        let lowest = depths.iter().copied().fold(f64::INFINITY, f64::min);
        let down = part_from_grip.rotation.transpose() * -ground.normal;
        Some((-(height + lowest), part_from_grip.point(sweeps[first].support_point(down))))
    }

    /// Smallest angle between the cone's axis and the approaches of all sites \[rad\].
    pub(super) fn nearest_approach(&self, sites: &[Site]) -> Option<f64> {
        let cone = self.cone?;
        let approaches = sites.iter().flat_map(|site| {
            site.angles.iter().map(|&angle| work::approach(&work::frame(site, DVec2::ZERO, angle)))
        });
        approaches.map(|approach| cone.axis.angle_between(approach)).reduce(f64::min)
    }

    /// Lowest height of each sweep over the ground, for a grip origin at height zero.
    pub(super) fn depths(&self, sweeps: &[Sweep], part_from_grip: &Frame) -> Vec<f64> {
        let Some(ground) = self.ground else { return Vec::new() };
        let down = part_from_grip.rotation.transpose() * -ground.normal;
        sweeps.iter().map(|sweep| -sweep.support_point(down).dot(down)).collect()
    }

    /// Where the sweeps of a gripper, given with its frames at the origin of a site, pass the ground
    /// and the planes of the faces of keep-out boxes and of the scene's obstacles. `flush`: how far
    /// the sweeps are drawn in \[m\].
    pub(super) fn borders(
        &self,
        sweeps: &[Sweep],
        part_from_site: &Frame,
        part_from_grip: &Frame,
        flush: f64,
    ) -> Vec<Border> {
        let ground = self.ground.map(|ground| (ground.normal, ground.offset));
        let faces = self.keep_out.iter().flat_map(|[low, high]| {
            (0..3).flat_map(move |axis| {
                let normal = DVec3::AXES[axis];
                [(normal, high[axis]), (-normal, -low[axis])]
            })
        });
        let border = |(normal, offset): (DVec3, f64)| {
            let down = part_from_grip.rotation.transpose() * -normal;
            let lowest = sweeps
                .iter()
                .map(|sweep| -sweep.support_point(down).dot(down))
                .fold(f64::INFINITY, f64::min);
            let along = (part_from_site.rotation.transpose() * normal).truncate();
            let length = along.length();
            let offset = offset - normal.dot(part_from_site.origin) - lowest;
            (length > LEANING && offset.is_finite())
                .then(|| Border { normal: along / length, offset: offset / length })
        };
        // The sweeps are drawn in by what counts as flush with the part; a scene is met exactly.
        let walls = self.scene.iter().flat_map(|scene| &scene.walls);
        let walls = walls.map(|&(normal, offset)| (normal, offset + flush));
        ground.into_iter().chain(faces).chain(walls).filter_map(border).collect()
    }

    /// The first sweep below the ground, for a grip origin at `origin`.
    pub(super) fn grounded(&self, depths: &[f64], origin: DVec3) -> Option<usize> {
        let ground = self.ground?;
        let height = ground.normal.dot(origin) - ground.offset;
        depths.iter().position(|depth| height + depth < 0.0)
    }

    /// How far the sweeps in a keep-out box would have to move along one of its axes so that none
    /// is in it \[m\], and the middle of what the first of them has in common with it, by its
    /// bounds, part frame \[m\]; `None` where none is in one. Of several boxes the first counts.
    pub(super) fn kept_out_by(
        &self,
        sweeps: &[Sweep],
        part_from_grip: &Frame,
    ) -> Option<(f64, DVec3)> {
        let (first, number) = self.kept_out(sweeps, part_from_grip)?;
        let [low, high] = self.keep_out[number];
        let extent = |sweep: &Sweep| {
            let reach = |direction: DVec3| {
                let local = part_from_grip.rotation.transpose() * direction;
                part_from_grip.point(sweep.support_point(local)).dot(direction)
            };
            [DVec3::from(DVec3::AXES.map(|axis| -reach(-axis))), DVec3::AXES.map(reach).into()]
        };
        let inside = sweeps.iter().filter(|sweep| sweep.meets_box(part_from_grip, low, high));
        let (mut up, mut down) = (DVec3::ZERO, DVec3::ZERO);
        for [from, to] in inside.map(extent) {
            (up, down) = (up.max(high - from), down.max(to - low));
        }
        let [from, to] = extent(&sweeps[first]);
        Some((up.min(down).min_element(), (from.max(low) + to.min(high)) / 2.0))
    }

    /// The first sweep in a keep-out box, and the box's number.
    pub(super) fn kept_out(
        &self,
        sweeps: &[Sweep],
        part_from_grip: &Frame,
    ) -> Option<(usize, usize)> {
        self.keep_out.iter().enumerate().find_map(|(number, [low, high])| {
            sweeps
                .iter()
                .position(|sweep| sweep.meets_box(part_from_grip, *low, *high))
                .map(|sweep| (sweep, number))
        })
    }
}

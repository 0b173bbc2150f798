//! A robot model: links, joints, and where they stand.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use urdf_rs::{Geometry, Joint, JointType, Pose, Robot};

use crate::error::{Error, Result};
use crate::gripper::mesh;
use crate::model::Frame;
use crate::part::Unit;

/// Steps of a mimic that leads to another one.
const DEEP: usize = 16;
/// Points on the rim of a round shape.
const RIM: u32 = 24;

/// A URDF file.
pub(super) struct Model {
    place: String,
    folder: PathBuf,
    robot: Robot,
    /// The joint above each link.
    above: Vec<Option<usize>>,
}

/// The text with the prefixes of its elements declared: models carry elements of simulators
/// (`drake:..`) without.
fn bound(text: &str) -> String {
    let mut known: Vec<&str> = Vec::new();
    for piece in text.split('<').skip(1) {
        let name = piece.split([' ', '>', '/', '\n', '\t', '\r']).next().unwrap_or_default();
        if let Some((prefix, _)) = name.split_once(':')
            && !known.contains(&prefix)
            && !text.contains(&format!("xmlns:{prefix}="))
        {
            known.push(prefix);
        }
    }
    let declared: String = known
        .iter()
        .filter(|prefix| prefix.chars().all(|letter| letter.is_ascii_alphanumeric()))
        .map(|prefix| format!(" xmlns:{prefix}=\"urn:{prefix}\""))
        .collect();
    text.replacen("<robot", &format!("<robot{declared}"), 1)
}

fn frame(pose: &Pose) -> Frame {
    let [roll, pitch, yaw] = *pose.rpy;
    let rotation =
        DMat3::from_rotation_z(yaw) * DMat3::from_rotation_y(pitch) * DMat3::from_rotation_x(roll);
    Frame { rotation, origin: DVec3::from_array(*pose.xyz) }
}

impl Model {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = bound(&crate::file::read_text(path)?);
        let robot = urdf_rs::read_from_string(&text).map_err(|error| {
            Error::format(
                &place,
                format!("is no URDF: {error}"),
                "give a URDF file; expand xacro first",
            )
        })?;
        let number = |name: &str| robot.links.iter().position(|link| link.name == name);
        let mut above = vec![None; robot.links.len()];
        for (index, joint) in robot.joints.iter().enumerate() {
            let (Some(child), Some(_)) = (number(&joint.child.link), number(&joint.parent.link))
            else {
                return Err(Error::format(
                    &place,
                    format!("joint '{}' joins links that are not there", joint.name),
                    "correct the model",
                ));
            };
            above[child] = Some(index);
        }
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Ok(Self { place, folder, robot, above })
    }

    pub(super) fn wrong(&self, problem: impl Into<String>, remedy: &str) -> Error {
        Error::input(&self.place, problem, remedy)
    }

    pub(super) fn robot_name(&self) -> &str {
        &self.robot.name
    }

    pub(super) fn file(&self) -> &str {
        &self.place
    }

    pub(super) fn name(&self, link: usize) -> &str {
        &self.robot.links[link].name
    }

    pub(super) fn joint_name(&self, joint: usize) -> &str {
        &self.robot.joints[joint].name
    }

    pub(super) fn effort(&self, joint: usize) -> f64 {
        self.robot.joints[joint].limit.effort
    }

    pub(super) fn is_prismatic(&self, joint: usize) -> bool {
        self.robot.joints[joint].joint_type == JointType::Prismatic
    }

    /// The number of a link.
    pub(super) fn link(&self, name: &str) -> Result<usize> {
        self.robot.links.iter().position(|link| link.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.robot.links.iter().map(|link| link.name.as_str()).collect();
            self.wrong(
                format!("has no link '{name}'"),
                &format!("use one of: {}", names.join(", ")),
            )
        })
    }

    fn joint_number(&self, name: &str) -> Option<usize> {
        self.robot.joints.iter().position(|joint| joint.name == name)
    }

    fn parent(&self, link: usize) -> Option<usize> {
        let joint = &self.robot.joints[self.above[link]?];
        self.robot.links.iter().position(|other| other.name == joint.parent.link)
    }

    /// Links from this one up to the root; a model with a ring ends somewhere.
    fn ancestors(&self, link: usize) -> Vec<usize> {
        let mut chain = vec![link];
        while let Some(next) = self.parent(chain[chain.len() - 1]) {
            if chain.contains(&next) {
                break;
            }
            chain.push(next);
        }
        chain
    }

    /// The link from which both hang.
    pub(super) fn common(&self, [one, other]: [usize; 2]) -> Result<usize> {
        let chain = self.ancestors(other);
        self.ancestors(one).into_iter().find(|link| chain.contains(link)).ok_or_else(|| {
            self.wrong("the two links hang from nothing in common", "name links of one hand")
        })
    }

    /// Joints that move the links against the palm, those that others mimic for these.
    pub(super) fn drives(&self, links: [usize; 2], palm: usize) -> Result<Vec<usize>> {
        let mut drives = Vec::new();
        for link in links {
            for step in self.ancestors(link).into_iter().take_while(|&step| step != palm) {
                let Some(mut joint) = self.above[step] else { break };
                if self.robot.joints[joint].joint_type == JointType::Fixed {
                    continue;
                }
                for _ in 0..DEEP {
                    let Some(mimic) = &self.robot.joints[joint].mimic else { break };
                    joint = self.joint_number(&mimic.joint).ok_or_else(|| {
                        self.wrong(
                            format!("mimics '{}', which is not there", mimic.joint),
                            "correct the model",
                        )
                    })?;
                }
                if !drives.contains(&joint) {
                    drives.push(joint);
                }
            }
        }
        for &drive in &drives {
            let limit = &self.robot.joints[drive].limit;
            if !(limit.lower.is_finite() && limit.upper.is_finite() && limit.lower < limit.upper) {
                return Err(self.wrong(
                    format!(
                        "joint '{}' has no limits, so how far the jaws open is not said",
                        self.robot.joints[drive].name
                    ),
                    "state its lower and upper limit in the model, as \
                     <limit lower=\"..\" upper=\"..\"/>, and its type as revolute or prismatic",
                ));
            }
        }
        if drives.is_empty() {
            return Err(self.wrong(
                "no joint moves the two links against each other",
                "name the links that touch the part, one of each jaw",
            ));
        }
        Ok(drives)
    }

    /// What the model leaves open about how the jaws move.
    pub(super) fn doubts(&self, links: [usize; 2], palm: usize, drives: &[usize]) -> Vec<String> {
        let mut doubts = Vec::new();
        if let [one, other, ..] = drives {
            doubts.push(format!(
                "joints '{}' and '{}' both drive the jaws, and neither follows the other: they are taken as moving together, each from its lower to its upper limit",
                self.joint_name(*one),
                self.joint_name(*other)
            ));
        }
        let ends = [self.positions(drives, 0.0), self.positions(drives, 1.0)];
        for link in links {
            for step in self.ancestors(link).into_iter().take_while(|&step| step != palm) {
                let Some(joint) = self.above[step] else { break };
                let limit = &self.robot.joints[joint].limit;
                let slack = 1e-3 * (limit.upper - limit.lower);
                let within = |position: f64| {
                    position >= limit.lower - slack && position <= limit.upper + slack
                };
                if self.robot.joints[joint].mimic.is_some()
                    && slack > 0.0
                    && !ends.iter().all(|positions| within(positions[joint]))
                {
                    doubts.push(format!(
                        "joint '{}' leaves its own limits where it follows another over the whole of that one's range: the stroke may be less",
                        self.joint_name(joint)
                    ));
                }
            }
        }
        doubts
    }

    /// Position of every joint with the drives at this share of their ranges; joints that do not
    /// belong to the hand stand at zero.
    pub(super) fn positions(&self, drives: &[usize], t: f64) -> Vec<f64> {
        let own = |joint: usize| {
            let limit = &self.robot.joints[joint].limit;
            if drives.contains(&joint) {
                limit.lower + t * (limit.upper - limit.lower)
            } else {
                0.0
            }
        };
        (0..self.robot.joints.len())
            .map(|joint| {
                let (mut at, mut factor, mut offset) = (joint, 1.0, 0.0);
                for _ in 0..DEEP {
                    let Some(mimic) = &self.robot.joints[at].mimic else { break };
                    let Some(next) = self.joint_number(&mimic.joint) else { break };
                    offset += factor * mimic.offset.unwrap_or(0.0);
                    factor *= mimic.multiplier.unwrap_or(1.0);
                    at = next;
                }
                factor * own(at) + offset
            })
            .collect()
    }

    /// A link's frame in that of the root.
    pub(super) fn place(&self, link: usize, positions: &[f64]) -> Frame {
        let chain = self.ancestors(link);
        chain.iter().rev().fold(Frame::IDENTITY, |outer, &step| match self.above[step] {
            Some(joint) => outer.compose(&self.step(&self.robot.joints[joint], positions[joint])),
            None => outer,
        })
    }

    fn step(&self, joint: &Joint, position: f64) -> Frame {
        let axis = DVec3::from_array(*joint.axis.xyz).normalize_or(DVec3::X);
        let moved = match joint.joint_type {
            JointType::Revolute | JointType::Continuous => {
                Frame { rotation: DMat3::from_axis_angle(axis, position), origin: DVec3::ZERO }
            }
            JointType::Prismatic => Frame { rotation: DMat3::IDENTITY, origin: axis * position },
            _ => Frame::IDENTITY,
        };
        frame(&joint.origin).compose(&moved)
    }

    /// The links that fixed joints join with this one, downwards only or both ways.
    pub(super) fn rigid(&self, link: usize, down_only: bool) -> Vec<usize> {
        let mut group = vec![link];
        let mut next = 0;
        while next < group.len() {
            let at = group[next];
            next += 1;
            let fixed = |joint: Option<usize>| {
                joint.is_some_and(|joint| self.robot.joints[joint].joint_type == JointType::Fixed)
            };
            let children = (0..self.robot.links.len())
                .filter(|&child| self.parent(child) == Some(at) && fixed(self.above[child]));
            let up = self.parent(at).filter(|_| !down_only && fixed(self.above[at]));
            for other in children.chain(up) {
                if !group.contains(&other) {
                    group.push(other);
                }
            }
        }
        group
    }

    /// The links of a finger: what moves with this one. Of a jaw that is fixed to the palm these are
    /// the link and what hangs from it.
    pub(super) fn finger(&self, link: usize, palm: usize) -> Vec<usize> {
        let group = self.rigid(link, false);
        if group.contains(&palm) { self.rigid(link, true) } else { group }
    }

    /// The uppermost link of a group.
    pub(super) fn top(&self, group: &[usize]) -> usize {
        group.iter().copied().min_by_key(|&link| self.ancestors(link).len()).unwrap_or(0)
    }

    /// Links that hang from the palm and belong neither to it nor to the jaws.
    pub(super) fn below(&self, palm: usize, fixed: &[usize], jaws: &[Vec<usize>; 2]) -> Vec<usize> {
        (0..self.robot.links.len())
            .filter(|link| self.ancestors(*link).contains(&palm))
            .filter(|link| !fixed.contains(link) && !jaws.iter().any(|jaw| jaw.contains(link)))
            .collect()
    }

    /// Names and corner points of the shapes of a group of links joined by fixed joints, in the
    /// frame of `link`. Collision shapes where a link has any, else visual ones.
    pub(super) fn points(&self, link: usize, group: &[usize]) -> Vec<(String, Vec<DVec3>)> {
        let still = vec![0.0; self.robot.joints.len()];
        let base = self.place(link, &still).inverse();
        let mut found = Vec::new();
        for &member in group {
            let to_link = base.compose(&self.place(member, &still));
            let name = &self.robot.links[member].name;
            let shapes = self.shapes(member);
            let many =
                shapes.iter().map(|(_, geometry)| self.pieces(geometry).len()).sum::<usize>() > 1;
            let mut count = 0;
            for (origin, geometry) in shapes {
                let to_link = to_link.compose(&frame(origin));
                for piece in self.pieces(geometry) {
                    count += 1;
                    let name = if many { format!("{name} {count}") } else { name.clone() };
                    found.push((name, piece.into_iter().map(|p| to_link.point(p)).collect()));
                }
            }
        }
        found
    }

    fn shapes(&self, link: usize) -> Vec<(&Pose, &Geometry)> {
        let link = &self.robot.links[link];
        if link.collision.is_empty() {
            link.visual.iter().map(|shape| (&shape.origin, &shape.geometry)).collect()
        } else {
            link.collision.iter().map(|shape| (&shape.origin, &shape.geometry)).collect()
        }
    }

    /// Points whose hulls together hold a shape; none for a mesh that is not there.
    fn pieces(&self, geometry: &Geometry) -> Vec<Vec<DVec3>> {
        let corners = |half: DVec3| -> Vec<DVec3> {
            let sign = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
            (0..8_u32)
                .map(|k| half * DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2 & 1)))
                .collect()
        };
        // Circumscribed, so that nothing of the round shape is lost.
        let round = |radius: f64, half: f64| -> Vec<DVec3> {
            let radius = radius / (std::f64::consts::PI / f64::from(RIM)).cos();
            (0..RIM)
                .flat_map(|k| {
                    let angle = std::f64::consts::TAU * f64::from(k) / f64::from(RIM);
                    let rim = DVec3::new(angle.cos(), angle.sin(), 0.0) * radius;
                    [rim.with_z(-half), rim.with_z(half)]
                })
                .collect()
        };
        match geometry {
            Geometry::Box { size } => vec![corners(DVec3::from_array(**size) / 2.0)],
            Geometry::Cylinder { radius, length } => vec![round(*radius, length / 2.0)],
            Geometry::Capsule { radius, length } => vec![round(*radius, length / 2.0 + radius)],
            Geometry::Sphere { radius } => vec![corners(DVec3::splat(*radius))],
            Geometry::Mesh { filename, scale } => {
                let scale = scale.map_or(DVec3::ONE, |scale| DVec3::from_array(*scale));
                let path = self.mesh_file(filename);
                let hulls = path.and_then(|path| mesh::hulls(&path, Some(Unit::Metre)).ok());
                let scaled = |hull: Vec<DVec3>| hull.into_iter().map(|p| p * scale).collect();
                hulls.unwrap_or_default().into_iter().map(scaled).collect()
            }
        }
    }

    /// Where a mesh lies: beside the model, or, for `package://NAME/REST`, under a folder above it
    /// that holds `REST` or `NAME/REST`.
    fn mesh_file(&self, name: &str) -> Option<PathBuf> {
        let rest = name.strip_prefix("package://");
        let Some(rest) = rest else {
            let path = self.folder.join(name.strip_prefix("file://").unwrap_or(name));
            return path.is_file().then_some(path);
        };
        let inner = rest.split_once('/').map_or(rest, |(_, inner)| inner);
        let folder = std::path::absolute(&self.folder).ok()?;
        folder
            .ancestors()
            .flat_map(|folder| [folder.join(rest), folder.join(inner)])
            .find(|path| path.is_file())
    }

    /// Meshes that are not there or cannot be read.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for link in 0..self.robot.links.len() {
            for (_, geometry) in self.shapes(link) {
                if let Geometry::Mesh { filename, .. } = geometry
                    && self.pieces(geometry).is_empty()
                {
                    notes.push(format!(
                        "link '{}': the mesh {filename} is not found or cannot be read; its shape is missing",
                        self.name(link)
                    ));
                }
            }
        }
        notes
    }
}

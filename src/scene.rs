//! The scene file: where the part lies, what stands around it, and what the robot can do. TOML with
//! units. Planning and picking read the same one.

use std::fmt::Write;
use std::path::Path;

use flate2::Crc;
use glam::{DMat3, DQuat, DVec3};
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::model::Frame;
use crate::part::{Mesh, Part, ReadOptions, Unit};
use crate::request::Candidates;
use crate::text::with_shape;
use crate::units::Quantity;

/// A scene in SI units, in the world frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The part's pose.
    pub world_from_part: Frame,
    /// What stands around.
    pub obstacles: Vec<Obstacle>,
    /// How far the jaws open for the approach.
    pub opening: Opening,
    /// Length of the straight approach \[m\].
    pub approach: f64,
    /// The way back with closed jaws.
    pub retreat: Retreat,
    /// Unit axis and half angle \[rad\] that the approach must keep to.
    pub cone: Option<(DVec3, f64)>,
    /// How far the robot reaches.
    pub reach: Option<Reach>,
    /// Distance kept from obstacles \[m\].
    pub clearance: f64,
}

/// A solid at a place.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// For messages.
    pub name: String,
    /// Its shape, in its own frame.
    pub solid: Solid,
    /// Its pose in the frame that `frame` names.
    pub world_from_obstacle: Frame,
    /// Whether it stands in the world, or goes with the part.
    pub frame: Reference,
}

/// The frame that an obstacle keeps to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// It stands in the world.
    #[default]
    World,
    /// It goes with the part, as its fixture or packaging does.
    Part,
}

/// Shapes of obstacles.
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// A surface of triangles \[m\].
    Mesh {
        /// The surface.
        mesh: Mesh,
        /// It bounds a solid, so that what lies wholly inside collides too.
        closed: bool,
    },
    /// A box about the origin.
    Box {
        /// Half sizes \[m\].
        half: DVec3,
    },
    /// Everything below the plane `z = 0` of its own frame.
    HalfSpace,
}

/// How far the jaws open for the approach, within the stroke.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Opening {
    /// As the list was planned.
    Planned,
    /// As far as the stroke allows.
    Full,
    /// Each jaw this far from contact \[m\].
    Jaw(f64),
}

/// The way back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Retreat {
    /// Against the approach, this far \[m\].
    Back(f64),
    /// Along this way in the world \[m\].
    Along(DVec3),
}

/// Distances from the robot's base at which the flange may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Position of the base \[m\].
    pub base: DVec3,
    /// Smallest distance \[m\].
    pub least: f64,
    /// Largest distance \[m\].
    pub most: f64,
}

impl Default for Scene {
    /// Nothing around, jaws opened as planned, 100 mm of approach and retreat.
    fn default() -> Self {
        Self {
            world_from_part: Frame::IDENTITY,
            obstacles: Vec::new(),
            opening: Opening::Planned,
            approach: Candidates::default().approach_distance.0,
            retreat: Retreat::Back(Candidates::default().approach_distance.0),
            cone: None,
            reach: None,
            clearance: 0.0,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    part: Pose,
    #[serde(default)]
    gripper: GripperTable,
    robot: Option<RobotTable>,
    #[serde(default)]
    obstacle: Vec<ObstacleTable>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct Pose {
    position: Option<[String; 3]>,
    rpy: Option<[String; 3]>,
    quaternion: Option<[f64; 4]>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct GripperTable {
    opening: Option<String>,
    clearance: Option<String>,
    approach: Option<String>,
    cone: Option<ConeTable>,
    retreat: Option<String>,
    retreat_direction: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConeTable {
    axis: [f64; 3],
    angle: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotTable {
    base: Option<[String; 3]>,
    reach: [String; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObstacleTable {
    name: Option<String>,
    #[serde(default)]
    frame: Reference,
    mesh: Option<String>,
    unit: Option<String>,
    #[serde(rename = "box")]
    size: Option<[String; 3]>,
    /// Normal of a plane; what lies behind it is solid.
    plane: Option<[f64; 3]>,
    position: Option<[String; 3]>,
    rpy: Option<[String; 3]>,
    quaternion: Option<[f64; 4]>,
}

impl Scene {
    /// All that it holds, meshes too, as a checksum.
    pub(crate) fn checksum(&self) -> String {
        struct Sum(Crc);
        impl std::fmt::Write for Sum {
            fn write_str(&mut self, text: &str) -> std::fmt::Result {
                self.0.update(text.as_bytes());
                Ok(())
            }
        }
        let mut sum = Sum(Crc::new());
        // Numbers are written so that they read back as the same.
        let _ = write!(sum, "{self:?}");
        format!("{} obstacles, checksum {:08x}", self.obstacles.len(), sum.0.sum())
    }

    /// Reads a scene file and the meshes that it names, which are sought beside it.
    ///
    /// # Errors
    /// When the file or a mesh cannot be read, a field is unknown, or a value has no unit or makes
    /// no sense; the message names the place.
    pub fn read(path: &Path) -> Result<Self> {
        let text = crate::file::read_text(path)?;
        Self::parse(&path.display().to_string(), &text, path.parent().unwrap_or(Path::new("")))
    }

    /// Parses the text of a scene file; meshes are sought in `folder`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(place: &str, text: &str, folder: &Path) -> Result<Self> {
        const SHAPES: [(&str, &str); 1] = [(
            "expected a sequence",
            "obstacles stand in double brackets, one table for each: [[obstacle]]",
        )];
        let file: File = toml::from_str(text).map_err(|error| {
            let line = error
                .span()
                .map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count());
            Error::format(
                format!("{place}:{line}"),
                with_shape(error.message(), &SHAPES),
                "docs/formats.md shows a scene file with all its fields",
            )
        })?;
        let standard = Self::default();
        let field = |name: &str| format!("{place}, {name}");
        let gripper = &file.gripper;
        let distance = |name: &str, text: &Option<String>, otherwise: f64| match text {
            None => Ok(otherwise),
            Some(text) => positive(&field(name), Quantity::Length, text),
        };
        let opening = match gripper.opening.as_deref() {
            None => standard.opening,
            Some("full") => Opening::Full,
            Some(text) => {
                Opening::Jaw(positive(&field("gripper.opening"), Quantity::Length, text)?)
            }
        };
        let approach = distance("gripper.approach", &gripper.approach, standard.approach)?;
        let back = distance("gripper.retreat", &gripper.retreat, approach)?;
        let retreat = match gripper.retreat_direction {
            None => Retreat::Back(back),
            Some(direction) => {
                Retreat::Along(unit(&field("gripper.retreat_direction"), direction)? * back)
            }
        };
        let cone = match &gripper.cone {
            None => None,
            Some(cone) => Some((
                unit(&field("gripper.cone.axis"), cone.axis)?,
                positive(&field("gripper.cone.angle"), Quantity::Angle, &cone.angle)?,
            )),
        };
        let reach = match &file.robot {
            None => None,
            Some(robot) => {
                let [least, most] = [0, 1].map(|index| {
                    positive(&field("robot.reach"), Quantity::Length, &robot.reach[index])
                });
                let base = robot.base.as_ref().map(|base| vector(&field("robot.base"), base));
                let reach = Reach {
                    base: base.transpose()?.unwrap_or(DVec3::ZERO),
                    least: least?,
                    most: most?,
                };
                if reach.least > reach.most {
                    return Err(Error::input(
                        field("robot.reach"),
                        format!("{} to {} is empty", robot.reach[0], robot.reach[1]),
                        "give the smallest, then the largest distance",
                    ));
                }
                Some(reach)
            }
        };
        let obstacles = file
            .obstacle
            .iter()
            .enumerate()
            .map(|(index, table)| obstacle(place, index, table, folder))
            .collect::<Result<_>>()?;
        Ok(Self {
            world_from_part: pose(
                &field("part"),
                file.part.position.as_ref(),
                file.part.rpy.as_ref(),
                file.part.quaternion,
            )?,
            obstacles,
            opening,
            approach,
            retreat,
            cone,
            reach,
            clearance: distance("gripper.clearance", &gripper.clearance, standard.clearance)?,
        })
    }
}

fn obstacle(place: &str, index: usize, table: &ObstacleTable, folder: &Path) -> Result<Obstacle> {
    let name = table.name.clone().unwrap_or_else(|| format!("obstacle {}", index + 1));
    let place = format!("{place}, obstacle '{name}'");
    let mut world_from_obstacle =
        pose(&place, table.position.as_ref(), table.rpy.as_ref(), table.quaternion)?;
    let solid = match (&table.mesh, &table.size, &table.plane) {
        (Some(mesh), None, None) => {
            let unit = table.unit.as_deref().map(str::parse::<Unit>).transpose()?;
            let part = Part::read(&folder.join(mesh), &ReadOptions { unit, ..Default::default() })?;
            Solid::Mesh { closed: part.health.watertight, mesh: part.mesh }
        }
        (None, Some(size), None) => {
            let size = vector(&place, size)?;
            if size.min_element() <= 0.0 {
                return Err(Error::input(
                    place,
                    format!("a box of {size} m"),
                    "give three positive sizes",
                ));
            }
            Solid::Box { half: size / 2.0 }
        }
        (None, None, Some(normal)) => {
            if table.rpy.is_some() || table.quaternion.is_some() {
                return Err(Error::input(
                    place,
                    "a plane is turned by its normal",
                    "leave out rpy and quaternion",
                ));
            }
            let normal = unit(&place, *normal)?;
            let (side, other) = normal.any_orthonormal_pair();
            world_from_obstacle.rotation = DMat3::from_cols(side, other, normal);
            Solid::HalfSpace
        }
        _ => {
            return Err(Error::input(
                place,
                "an obstacle needs one shape",
                "give one of mesh = \"FILE\", box = [sizes], plane = [normal]",
            ));
        }
    };
    if table.unit.is_some() && table.mesh.is_none() {
        return Err(Error::input(place, "unit is for meshes only", "leave it out"));
    }
    Ok(Obstacle { name, solid, world_from_obstacle, frame: table.frame })
}

fn pose(
    place: &str,
    position: Option<&[String; 3]>,
    rpy: Option<&[String; 3]>,
    quaternion: Option<[f64; 4]>,
) -> Result<Frame> {
    let origin = position
        .map_or(Ok(DVec3::ZERO), |position| vector(&format!("{place}, position"), position))?;
    let rotation = match (rpy, quaternion) {
        (None, None) => DMat3::IDENTITY,
        (Some(rpy), None) => {
            let place = format!("{place}, rpy");
            let [roll, pitch, yaw] =
                [0, 1, 2].map(|index| Quantity::Angle.parse(&place, &rpy[index]));
            DMat3::from_rotation_z(yaw?)
                * DMat3::from_rotation_y(pitch?)
                * DMat3::from_rotation_x(roll?)
        }
        (None, Some(quaternion)) => {
            let quaternion = DQuat::from_array(quaternion);
            if !matches!((quaternion.length() - 1.0).abs(), 0.0..=1e-3) {
                return Err(Error::input(
                    format!("{place}, quaternion"),
                    format!("its length is {}", quaternion.length()),
                    "give a unit quaternion [x, y, z, w]",
                ));
            }
            DMat3::from_quat(quaternion.normalize())
        }
        (Some(_), Some(_)) => {
            return Err(Error::input(
                place,
                "both rpy and quaternion are given",
                "give one of them",
            ));
        }
    };
    Ok(Frame { rotation, origin })
}

fn vector(place: &str, texts: &[String; 3]) -> Result<DVec3> {
    let [x, y, z] = [0, 1, 2].map(|index| Quantity::Length.parse(place, &texts[index]));
    Ok(DVec3::new(x?, y?, z?))
}

fn unit(place: &str, direction: [f64; 3]) -> Result<DVec3> {
    let direction = DVec3::from_array(direction);
    let length = direction.length();
    if !(length.is_finite() && length > 0.0) {
        return Err(Error::input(
            place,
            format!("{direction} is not a direction"),
            "give three finite numbers, not all zero",
        ));
    }
    Ok(direction / length)
}

fn positive(place: &str, quantity: Quantity, text: &str) -> Result<f64> {
    let value = quantity.parse(place, text)?;
    if value < 0.0 {
        return Err(Error::input(
            place,
            format!("'{text}' is negative"),
            "give a value of zero or more",
        ));
    }
    Ok(value)
}

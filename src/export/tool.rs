//! The tool frame of a file: which axes it has, where its origin lies, and the joints that hold the
//! opening.

use std::fmt;

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::gripper::Gripper;
use crate::model::Frame;
use crate::units::Quantity;

/// Which tool axis approaches and which one closes; the third makes a right-handed frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convention {
    /// z approach, y closing.
    Standard,
    /// z approach, x closing (GraspGen, ACRONYM).
    GraspGen,
    /// x approach, y closing (GraspNet).
    GraspNet,
    /// x approach, y closing (Dex-Net).
    DexNet,
    /// z approach, y closing (MoveIt).
    MoveIt,
    /// The axes of a frame that the gripper file states.
    Stated(Stated),
}

/// A frame that a gripper file may state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stated {
    /// The robot's mounting face, `[flange]`.
    Flange,
    /// The user's own tool frame, `[tool]`.
    Tool,
}

impl Stated {
    /// Both with their names.
    const ALL: [(Self, &'static str); 2] = [(Self::Flange, "flange"), (Self::Tool, "tool")];

    fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|known| known.1.eq_ignore_ascii_case(name)).map(|known| known.0)
    }

    fn name(self) -> &'static str {
        match self {
            Self::Flange => "flange",
            Self::Tool => "tool",
        }
    }

    /// The frame in the grip frame; `option` is what asked for it.
    fn frame(self, option: &'static str, gripper: Option<&Gripper>) -> Result<Frame> {
        let stated = gripper.and_then(|gripper| match self {
            Self::Flange => gripper.grip_from_flange,
            Self::Tool => gripper.grip_from_tool,
        });
        let name = self.name();
        stated.ok_or_else(|| {
            Error::input(
                format!("{option} {name}"),
                format!("the gripper of this result states no {name}"),
                format!(
                    "add [{name}] to the gripper file and plan again, or give as origin the \
                     distance behind the pads, e.g. 103.4mm"
                ),
            )
            .with_options(&["origin"])
        })
    }
}

impl Convention {
    /// Every convention with its name, but for the frames that a gripper file states.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Standard, "standard"),
        (Self::GraspGen, "graspgen"),
        (Self::GraspNet, "graspnet"),
        (Self::DexNet, "dexnet"),
        (Self::MoveIt, "moveit"),
    ];

    /// The convention of this name.
    ///
    /// # Errors
    /// When there is none; the message lists them.
    pub fn parse(place: &str, name: &str) -> Result<Self> {
        let known =
            Self::ALL.iter().find(|known| known.1.eq_ignore_ascii_case(name)).map(|known| known.0);
        known.or(Stated::parse(name).map(Self::Stated)).ok_or_else(|| {
            let names = Self::ALL
                .map(|(convention, name)| format!("{name} ({})", convention.axes()))
                .join(", ");
            Error::input(
                place,
                format!("'{name}' is not a convention"),
                format!("use one of: {names}, flange, tool (as the gripper file states them)"),
            )
        })
    }

    /// The axes in words.
    pub fn axes(self) -> &'static str {
        match self {
            Self::Standard | Self::MoveIt => "z approach, y closing",
            Self::GraspGen => "z approach, x closing",
            Self::GraspNet | Self::DexNet => "x approach, y closing",
            Self::Stated(Stated::Flange) => "axes of the gripper's flange",
            Self::Stated(Stated::Tool) => "axes of the gripper's tool frame",
        }
    }

    /// Tool axes in the grip frame (x1 approach, x3 closing), as columns.
    ///
    /// # Errors
    /// When the axes are those of a frame that the gripper does not state.
    pub fn rotation(self, gripper: Option<&Gripper>) -> Result<DMat3> {
        let (approach, closing) = (DVec3::X, DVec3::Z);
        Ok(match self {
            Self::Standard | Self::MoveIt => {
                DMat3::from_cols(closing.cross(approach), closing, approach)
            }
            Self::GraspGen => DMat3::from_cols(closing, approach.cross(closing), approach),
            Self::GraspNet | Self::DexNet => {
                DMat3::from_cols(approach, closing, approach.cross(closing))
            }
            Self::Stated(stated) => stated.frame("convention", gripper)?.rotation,
        })
    }
}

/// Where the tool frame's origin lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Origin {
    /// Midway between the pads, at the grip frame's origin.
    Pads,
    /// At that of a frame that the gripper file states.
    Stated(Stated),
    /// This far behind the pads, against the approach \[m\].
    Behind(f64),
}

impl Origin {
    /// Parses `pads`, `flange`, `tool` or a length.
    ///
    /// # Errors
    /// When the text is none of these.
    pub fn parse(place: &str, text: &str) -> Result<Self> {
        match text {
            "pads" => Ok(Self::Pads),
            _ => match (Stated::parse(text), Quantity::Length.parse(place, text)) {
                (Some(stated), _) => Ok(Self::Stated(stated)),
                (None, Ok(distance)) => Ok(Self::Behind(distance)),
                (None, Err(_)) => Err(Error::input(
                    place,
                    format!("'{text}' is not an origin"),
                    "use pads, flange, tool, or a distance behind the pads, e.g. 103.4mm",
                )),
            },
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pads => f.write_str("midway between the pads"),
            Self::Stated(Stated::Flange) => f.write_str("at the flange"),
            Self::Stated(Stated::Tool) => f.write_str("at the gripper's tool frame"),
            Self::Behind(distance) => write!(f, "{} mm behind the pads", distance * 1e3),
        }
    }
}

/// A joint of the gripper: `position = scale * width + offset`, width the distance of the pads \[m\].
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name in the robot model.
    pub name: String,
    /// Joint units per metre.
    pub scale: f64,
    /// Joint units.
    pub offset: f64,
    /// Follows the gripper file's `motion` where that states the joint, not the straight line.
    pub by_motion: bool,
}

impl Default for Joint {
    /// A joint called `width` that is the distance of the pads.
    fn default() -> Self {
        Self { name: "width".into(), scale: 1.0, offset: 0.0, by_motion: false }
    }
}

impl Joint {
    /// Parses `NAME`, `NAME:SCALE`, `NAME:SCALE:OFFSET` or `NAME:motion` (as the gripper file's
    /// `motion` states it).
    ///
    /// # Errors
    /// When the name is empty, or scale or offset is not a finite number.
    pub fn parse(place: &str, text: &str) -> Result<Self> {
        let wrong = |problem: String| {
            Error::input(
                place,
                problem,
                "write NAME:SCALE:OFFSET, e.g. panda_finger_joint1:0.5 or finger_joint:-9.41:0.8",
            )
        };
        let mut pieces = text.split(':');
        let name = pieces.next().unwrap_or_default().trim().to_owned();
        if let Some((name, "motion")) = text.split_once(':') {
            let name = name.trim().to_owned();
            return match name.is_empty() {
                true => Err(wrong(format!("'{text}' is not a joint"))),
                false => Ok(Self { name, by_motion: true, ..Self::default() }),
            };
        }
        let mut number = |default: f64| match pieces.next() {
            None => Ok(default),
            Some(piece) => piece
                .trim()
                .parse::<f64>()
                .ok()
                .filter(|value| value.is_finite())
                .ok_or_else(|| wrong(format!("'{text}': '{piece}' is not a number"))),
        };
        let (scale, offset) = (number(1.0)?, number(0.0)?);
        if name.is_empty() || pieces.next().is_some() {
            return Err(wrong(format!("'{text}' is not a joint")));
        }
        Ok(Self { name, scale, offset, by_motion: false })
    }

    /// Position at this distance of the pads \[m\] of a gripper.
    pub fn position(&self, width: f64, gripper: Option<&Gripper>) -> f64 {
        let stated = gripper
            .filter(|_| self.by_motion)
            .and_then(|gripper| gripper.travel.joint(width, gripper.stroke));
        stated.unwrap_or(self.scale * width + self.offset)
    }
}

/// The tool frame in the grip frame.
///
/// # Errors
/// When the flange or the tool frame is asked for and the gripper states none.
pub fn grip_from_tool(
    convention: Convention,
    origin: Origin,
    gripper: Option<&Gripper>,
) -> Result<Frame> {
    let origin = match origin {
        Origin::Pads => DVec3::ZERO,
        Origin::Behind(distance) => DVec3::X * -distance,
        Origin::Stated(stated) => stated.frame("origin", gripper)?.origin,
    };
    Ok(Frame { rotation: convention.rotation(gripper)?, origin })
}

/// The tool frame in the frame of a grip with the pads `gap` apart \[m\]: what is fixed to the palm
/// stands by how far the jaws close.
///
/// # Errors
/// As [`grip_from_tool`].
pub fn tool_in_grip(
    convention: Convention,
    origin: Origin,
    gripper: Option<&Gripper>,
    gap: f64,
) -> Result<Frame> {
    let tool = grip_from_tool(convention, origin, gripper)?;
    Ok(match (origin, gripper) {
        (Origin::Stated(_), Some(gripper)) => gripper.palm_place(gap).compose(&tool),
        _ => tool,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_convention_is_right_handed_with_its_axes_where_it_says() {
        for (convention, name) in Convention::ALL {
            let rotation = convention.rotation(None).unwrap();
            assert!((rotation.determinant() - 1.0).abs() < 1e-15, "{name}");
            let axis = |letter: &str| match letter {
                "x" => rotation.x_axis,
                "y" => rotation.y_axis,
                _ => rotation.z_axis,
            };
            let words: Vec<&str> = convention.axes().split([' ', ',']).collect();
            assert_eq!((words[1], words[4]), ("approach", "closing"));
            assert_eq!((axis(words[0]), axis(words[3])), (DVec3::X, DVec3::Z), "{name}");
            assert_eq!(Convention::parse("convention", name).unwrap(), convention);
        }
        assert!(
            Convention::parse("convention", "other")
                .unwrap_err()
                .to_string()
                .contains("graspgen (z approach, x closing)")
        );
    }

    #[test]
    fn frames_of_the_gripper_file() {
        let text = crate::gripper::catalogue::text("generic").unwrap()
            + "\n[tool]\norigin = [\"5mm\", \"0mm\", \"0mm\"]\nz = [1, 0, 0]\ny = [0, 1, 1]\n";
        let gripper = crate::gripper::parse(&text, "test").unwrap();
        let [convention, origin] = [
            Convention::parse("convention", "tool").unwrap(),
            Convention::parse("convention", "flange").unwrap(),
        ];
        let tool =
            grip_from_tool(convention, Origin::parse("origin", "tool").unwrap(), Some(&gripper))
                .unwrap();
        assert_eq!(tool, gripper.grip_from_tool.unwrap());
        assert!((tool.rotation.y_axis - DVec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-15);
        let flange =
            grip_from_tool(origin, Origin::parse("origin", "flange").unwrap(), Some(&gripper))
                .unwrap();
        assert_eq!(flange, gripper.grip_from_flange.unwrap());
        let franka = crate::gripper::find("franka-hand").unwrap();
        for (convention, origin) in
            [(convention, Origin::Pads), (Convention::Standard, Origin::Stated(Stated::Tool))]
        {
            let message =
                grip_from_tool(convention, origin, Some(&franka)).unwrap_err().to_string();
            assert!(message.contains("states no tool") && message.contains("[tool]"), "{message}");
        }
    }

    #[test]
    fn origins_and_joints_from_text() {
        assert_eq!(Origin::parse("origin", "103.4mm").unwrap(), Origin::Behind(0.1034));
        assert!(Origin::parse("origin", "103.4").is_err());
        let joint = Joint::parse("joint", "finger_joint:-9.41:0.8").unwrap();
        assert!((joint.position(0.085, None) - 0.00015).abs() < 1e-12);
        assert_eq!(
            Joint::parse("joint", "a:0.5").unwrap(),
            Joint { name: "a".into(), scale: 0.5, offset: 0.0, by_motion: false }
        );
        let joint = Joint::parse("joint", "finger_joint:motion").unwrap();
        let gripper = crate::gripper::find("robotiq-2f85").unwrap();
        assert!(joint.by_motion && (joint.position(0.0, Some(&gripper)) - 0.8133).abs() < 1e-12);
        for bad in ["", ":1", "a:x", "a:1:2:3", "a:nan", ":motion"] {
            assert!(Joint::parse("joint", bad).is_err(), "{bad}");
        }
    }
}

//! Flags that say which grips to propose.

use std::collections::BTreeMap;

use clap::Args;
use glam::DVec3;
use gripfast::error::{Error, Result};
use gripfast::gripper::Gripper;
use gripfast::propose::{Cone, Ground, ProposeOptions};
use gripfast::request::Side;
use gripfast::units::{Quantity, direction};
use serde_json::{Value, json};

#[derive(Debug, Args)]
pub(crate) struct CandidateArgs {
    /// Step of the position grid [default: a fifth of the pad's shorter side].
    #[arg(long)]
    spacing: Option<String>,
    /// Step of the approach angle.
    #[arg(long, default_value = "15deg")]
    angle_step: String,
    /// Smallest contact area on either face, as a share of the most that the face pair allows (pad
    /// or overlap).
    #[arg(long, default_value_t = 0.25, value_name = "SHARE")]
    min_contact: f64,
    /// Largest distance of the grip from the centre of mass.
    #[arg(long, value_name = "LENGTH")]
    max_offset: Option<String>,
    /// Only approaches within a cone, e.g. -z:45deg or 0/0/-1:45deg (part frame).
    #[arg(long, value_name = "DIR:ANGLE", allow_hyphen_values = true)]
    approach: Option<String>,
    /// The gripper must stay above this plane, e.g. +z:0mm (normal and height, part frame).
    #[arg(long, value_name = "DIR:HEIGHT", allow_hyphen_values = true)]
    ground: Option<String>,
    /// Box that the gripper must not enter: x,y,z:x,y,z with units, e.g. 0mm,0mm,0mm:10mm,20mm,5mm;
    /// may be repeated.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    keep_out: Vec<String>,
    /// Only these planar faces, e.g. 0,1,4 (see `gripfast part`).
    #[arg(long, value_delimiter = ',', value_name = "FACES")]
    faces: Option<Vec<u32>>,
    /// Only planar faces that lie wholly in this box, and those of --faces: x,y,z:x,y,z with units;
    /// may be repeated.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    faces_in: Vec<String>,
    /// Grips that close on the part from outside, that open in a slot or bore (needs a gripper with
    /// outer pads), or both.
    #[arg(long, value_parser = words!(Side), default_value_t)]
    grips: Side,
    /// List each grip with exchanged jaws as well.
    #[arg(long)]
    flips: bool,
    /// Way by which each jaw opens beyond contact for the approach.
    #[arg(long, default_value = "5mm")]
    opening: String,
    /// Distance kept between gripper and part, but for the pads.
    #[arg(long, default_value = "0mm")]
    clearance: String,
}

impl CandidateArgs {
    pub(crate) fn options(&self) -> Result<ProposeOptions> {
        let length = |flag: &str, text: &str| Quantity::Length.parse(flag, text);
        Ok(ProposeOptions {
            spacing: self.spacing.as_deref().map(|text| length("--spacing", text)).transpose()?,
            angle_step: Quantity::Angle.parse("--angle-step", &self.angle_step)?,
            min_contact: self.min_contact,
            max_offset: self
                .max_offset
                .as_deref()
                .map(|text| length("--max-offset", text))
                .transpose()?,
            approach_cone: self.approach.as_deref().map(cone).transpose()?,
            ground: self.ground.as_deref().map(ground).transpose()?,
            keep_out: self
                .keep_out
                .iter()
                .map(|text| corners("--keep-out", text))
                .collect::<Result<_>>()?,
            faces: self.faces.clone(),
            faces_in: self
                .faces_in
                .iter()
                .map(|text| corners("--faces-in", text))
                .collect::<Result<_>>()?,
            outside: self.grips != Side::Inside,
            inside: self.grips != Side::Outside,
            flips: self.flips,
            opening: length("--opening", &self.opening)?,
            clearance: length("--clearance", &self.clearance)?,
            ..ProposeOptions::default()
        })
    }

    /// Whether grips with exchanged jaws are listed.
    pub(crate) fn flips(&self) -> bool {
        self.flips
    }

    /// The settings that decide what is proposed, for the result file.
    pub(crate) fn settings(
        options: &ProposeOptions,
        gripper: &Gripper,
    ) -> Vec<(&'static str, serde_json::Value)> {
        vec![
            ("spacing_m", options.spacing(gripper).into()),
            ("angle_step_rad", options.angle_step.into()),
            ("min_contact_share", options.min_contact.into()),
            ("max_offset_m", options.max_offset.into()),
            ("opening_m", options.opening.into()),
            ("clearance_m", options.clearance.into()),
            ("flips", options.flips.into()),
            ("outside", options.outside.into()),
            ("inside", options.inside.into()),
            (
                "approach_cone",
                options
                    .approach_cone
                    .map(|cone| json!({"axis": cone.axis, "half_angle_rad": cone.half_angle}))
                    .into(),
            ),
            (
                "ground",
                options
                    .ground
                    .map(|ground| json!({"normal": ground.normal, "height_m": ground.offset}))
                    .into(),
            ),
            ("keep_out_m", json!(options.keep_out)),
            ("faces", json!(options.faces)),
            ("faces_in_m", json!(options.faces_in)),
        ]
    }

    /// The options that [`CandidateArgs::settings`] wrote; what is missing has its default.
    pub(crate) fn from_settings(settings: &BTreeMap<String, Value>) -> ProposeOptions {
        let value = |name: &str| settings.get(name).unwrap_or(&Value::Null);
        let number = |name: &str| value(name).as_f64();
        let vector = |value: &Value| serde_json::from_value::<DVec3>(value.clone()).ok();
        let boxes = |name: &str| serde_json::from_value(value(name).clone()).unwrap_or_default();
        let (cone, ground) = (value("approach_cone"), value("ground"));
        let defaults = ProposeOptions::default();
        ProposeOptions {
            spacing: number("spacing_m"),
            angle_step: number("angle_step_rad").unwrap_or(defaults.angle_step),
            min_contact: number("min_contact_share").unwrap_or(defaults.min_contact),
            max_offset: number("max_offset_m"),
            opening: number("opening_m").unwrap_or(defaults.opening),
            clearance: number("clearance_m").unwrap_or(defaults.clearance),
            outside: value("outside").as_bool().unwrap_or(defaults.outside),
            inside: value("inside").as_bool().unwrap_or(defaults.inside),
            approach_cone: vector(&cone["axis"])
                .zip(cone["half_angle_rad"].as_f64())
                .map(|(axis, half_angle)| Cone { axis, half_angle }),
            ground: vector(&ground["normal"])
                .zip(ground["height_m"].as_f64())
                .map(|(normal, offset)| Ground { normal, offset }),
            keep_out: boxes("keep_out_m"),
            faces: serde_json::from_value(value("faces").clone()).unwrap_or_default(),
            faces_in: boxes("faces_in_m"),
            ..defaults
        }
    }
}

fn two<'a>(flag: &str, text: &'a str, shape: &str) -> Result<(&'a str, &'a str)> {
    text.split_once(':').ok_or_else(|| {
        Error::input(flag, format!("'{text}' has no colon"), format!("give {shape}"))
    })
}

fn cone(text: &str) -> Result<Cone> {
    let (axis, angle) = two("--approach", text, "DIR:ANGLE, e.g. -z:45deg")?;
    Ok(Cone {
        axis: direction("--approach", axis)?,
        half_angle: Quantity::Angle.parse("--approach", angle)?,
    })
}

fn ground(text: &str) -> Result<Ground> {
    let (normal, height) = two("--ground", text, "DIR:HEIGHT, e.g. +z:0mm")?;
    Ok(Ground {
        normal: direction("--ground", normal)?,
        offset: Quantity::Length.parse("--ground", height)?,
    })
}

/// Smallest and largest corner of a box.
fn corners(flag: &str, text: &str) -> Result<[DVec3; 2]> {
    let (low, high) = two(flag, text, "LOW:HIGH, e.g. 0mm,0mm,0mm:10mm,20mm,5mm")?;
    let corner = |text: &str| -> Result<DVec3> {
        let values: Vec<f64> = text
            .split(',')
            .map(|value| Quantity::Length.parse(flag, value))
            .collect::<Result<_>>()?;
        let values: [f64; 3] = values.try_into().map_err(|_| {
            Error::input(flag, format!("'{text}' is not three lengths"), "give x,y,z with units")
        })?;
        Ok(DVec3::from_array(values))
    };
    Ok([corner(low)?, corner(high)?])
}

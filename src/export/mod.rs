//! Result files for other programs. Each format is described field by field in `docs/formats.md`.
//!
//! Every pose is that of a tool frame in the part frame: axes by [`Convention`], origin by
//! [`Origin`], metres, right-handed.

mod acronym;
mod columns;
mod glb;
mod graspgen;
mod graspnet;
mod intrinsic;
mod isaac;
mod moveit;
mod parquet;
mod robot;
mod table;
mod tool;
mod usd;
mod yaml;

use std::io::Write;
use std::path::Path;

use glam::{DVec2, DVec3};

use crate::error::{Error, ErrorKind, Result};
use crate::gripper::Gripper;
use crate::model::{Frame, Grip, Negative};
use crate::part::Mesh;
use crate::results::{GripSet, PadFriction, RankedGrip, Verdict};

pub use columns::negatives_table;
pub use robot::Dialect;
pub use table::{Column, Table, Values, table};
pub use tool::{Convention, Joint, Origin, Stated, grip_from_tool, tool_in_grip};

/// Coordinates \[m\] and components of unit vectors below this are rounding.
const ROUNDING: f64 = 1e-15;

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Native JSON, read by every subcommand.
    Json,
    /// Native JSON Lines: the set without grips, then a grip a line.
    JsonLines,
    /// A table of comma-separated values.
    Csv,
    /// The same table as Apache Parquet.
    Parquet,
    /// NVIDIA Isaac's `isaac_grasp` YAML.
    IsaacGrasp,
    /// GraspGen's JSON.
    GraspGen,
    /// A list of `moveit_msgs/Grasp` as YAML.
    MoveIt,
    /// GraspNet's rows of 17 numbers in a NumPy archive.
    GraspNet,
    /// ACRONYM's layout in HDF5.
    Acronym,
    /// Binary glTF: the part with grippers in place.
    Glb,
    /// OpenUSD text: the part with SimReady's grasp identifiers.
    Usd,
    /// Intrinsic's `ManualGraspAnnotations` as JSON.
    Intrinsic,
    /// Poses in millimetres with the angles of a robot maker, see [`Dialect`].
    Robot,
}

impl Format {
    /// Every format with its name on the command line and the file endings that stand for it.
    pub const ALL: [(Self, &'static str, &'static [&'static str]); 13] = [
        (Self::Json, "json", &[".json"]),
        (Self::JsonLines, "jsonl", &[".jsonl", ".ndjson"]),
        (Self::Csv, "csv", &[".csv"]),
        (Self::Parquet, "parquet", &[".parquet"]),
        (Self::IsaacGrasp, "isaac_grasp", &[".isaac_grasp.yaml", ".isaac_grasp.yml"]),
        (Self::GraspGen, "graspgen", &[".graspgen.json"]),
        (Self::MoveIt, "moveit", &[".moveit.yaml", ".moveit.yml"]),
        (Self::GraspNet, "graspnet", &[".npz"]),
        (Self::Acronym, "acronym", &[".h5", ".hdf5"]),
        (Self::Glb, "glb", &[".glb"]),
        (Self::Usd, "usd", &[".usda"]),
        (Self::Intrinsic, "intrinsic", &[".intrinsic.json"]),
        (Self::Robot, "robot", &[".robot.csv"]),
    ];

    /// The format of this name.
    ///
    /// # Errors
    /// When there is none; the message lists them.
    pub fn parse(place: &str, name: &str) -> Result<Self> {
        let wanted = name.to_ascii_lowercase().replace('-', "_");
        Self::ALL.iter().find(|known| known.1 == wanted).map(|known| known.0).ok_or_else(|| {
            let names = Self::ALL.map(|known| known.1);
            let meant = names.iter().find(|known| wanted.len() > 2 && known.starts_with(&wanted));
            let dialect = Dialect::ALL.iter().any(|known| known.1 == wanted);
            let meant = if dialect {
                format!("'{wanted}' is a dialect of the format robot; ")
            } else {
                meant.map_or(String::new(), |known| format!("did you mean '{known}'? "))
            };
            let remedy = format!("{meant}use one of: {}", names.join(", "));
            Error::input(place, format!("'{name}' is not a format"), remedy)
        })
    }

    /// The format that the ending of a file name stands for; the longest ending wins.
    ///
    /// # Errors
    /// When none does, or the ending is used by several formats.
    pub fn from_path(path: &Path) -> Result<Self> {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().to_ascii_lowercase())
            .unwrap_or_default();
        let place = path.display().to_string();
        if [".yaml", ".yml"].iter().any(|ending| name.ends_with(ending))
            && !Self::ALL.iter().any(|known| known.2.iter().any(|ending| name.ends_with(ending)))
        {
            return Err(Error::input(
                place,
                "YAML is used by isaac_grasp and by moveit",
                "name the format: isaac_grasp or moveit",
            )
            .with_options(&["format"]));
        }
        let endings =
            Self::ALL.iter().flat_map(|known| known.2.iter().map(move |ending| (known.0, *ending)));
        endings
            .filter(|(_, ending)| name.ends_with(ending))
            .max_by_key(|(_, ending)| ending.len())
            .map(|known| known.0)
            .ok_or_else(|| {
                let names = Self::ALL.map(|known| known.1).join(", ");
                Error::input(
                    place,
                    "the file's ending names no format",
                    format!("name the format, one of: {names}"),
                )
                .with_options(&["format"])
            })
    }

    /// Whether this format draws the part: [`write()`] wants its mesh.
    pub fn draws(self) -> bool {
        matches!(self, Self::Glb | Self::Usd)
    }

    /// Tool axes that readers of this format expect.
    pub fn convention(self) -> Convention {
        match self {
            Self::GraspGen | Self::Acronym => Convention::GraspGen,
            Self::GraspNet => Convention::GraspNet,
            Self::MoveIt => Convention::MoveIt,
            _ => Convention::Standard,
        }
    }

    /// Origin of the tool frame that readers of this format expect: the flange where they mount the
    /// gripper on it and the gripper states one, else midway between the pads.
    pub fn origin(self, gripper: Option<&Gripper>) -> Origin {
        match self {
            Self::MoveIt if gripper.is_some_and(|gripper| gripper.grip_from_flange.is_some()) => {
                Origin::Stated(Stated::Flange)
            }
            _ => Origin::Pads,
        }
    }
}

/// How to export.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Axes of the tool frame; the format's own when absent.
    pub convention: Option<Convention>,
    /// Origin of the tool frame; the format's own ([`Format::origin`]) when absent.
    pub origin: Option<Origin>,
    /// Writes only this many, best first.
    pub top: Option<usize>,
    /// Distance of the opened pads \[m\]; as planned, or as far as the stroke allows, when absent.
    pub opening: Option<f64>,
    /// Joints of the gripper as functions of the pads' distance.
    pub joints: Vec<Joint>,
    /// Pad friction for what holds and how well; the result's when absent.
    pub pad_friction: Option<f64>,
    /// Safety asked of it; the result's when absent.
    pub safety: Option<f64>,
    /// Straight way of the approach and the retreat \[m\].
    pub approach: f64,
    /// Name of the part frame (moveit, isaac_grasp).
    pub part_frame: String,
    /// Texts of a CSV table that a spreadsheet would take for a formula get an apostrophe first.
    pub spreadsheet: bool,
    /// Angles of the robot (robot).
    pub dialect: Dialect,
}

setters!(Options {
    with_convention: convention: Option<Convention>,
    with_origin: origin: Option<Origin>,
    with_top: top: Option<usize>,
    with_opening: opening: Option<f64>,
    with_joints: joints: Vec<Joint>,
    with_pad_friction: pad_friction: Option<f64>,
    with_safety: safety: Option<f64>,
    with_approach: approach: f64,
    with_part_frame: part_frame: String,
    with_spreadsheet: spreadsheet: bool,
    with_dialect: dialect: Dialect,
});

impl Default for Options {
    fn default() -> Self {
        Self {
            convention: None,
            origin: None,
            top: None,
            opening: None,
            joints: vec![Joint::default()],
            pad_friction: None,
            safety: None,
            approach: 0.1,
            part_frame: "part".into(),
            spreadsheet: false,
            dialect: Dialect::default(),
        }
    }
}

/// A set with what an exporter asks of it.
struct View<'a> {
    set: &'a GripSet,
    gripper: Option<Gripper>,
    options: &'a Options,
    grip_from_tool: Frame,
    convention: Convention,
    origin: Origin,
}

impl<'a> View<'a> {
    fn new(set: &'a GripSet, format: Format, options: &'a Options) -> Result<Self> {
        let convention = options.convention.unwrap_or_else(|| format.convention());
        let gripper = set.read_gripper();
        let origin = options.origin.unwrap_or_else(|| format.origin(gripper.as_ref().ok()));
        let grip_from_tool = tool::grip_from_tool(convention, origin, gripper.as_ref().ok())?;
        // What the format cannot do without.
        let gripper = match gripper {
            Err(error) if matches!(format, Format::GraspNet | Format::Glb) => return Err(error),
            gripper => gripper.ok(),
        };
        let unknown = |gripper: &Gripper| gripper.travel.joint(0.0, gripper.stroke).is_none();
        let by_motion = options.joints.iter().find(|joint| joint.by_motion);
        if let Some(joint) = by_motion
            && gripper.as_ref().is_none_or(unknown)
        {
            return Err(Error::input(
                format!("joint {}", joint.name),
                "the gripper of this result does not say how its joint follows the pads",
                "state motion with its joint in the gripper file and plan again, or give scale and offset",
            ));
        }
        Ok(Self { set, gripper, options, grip_from_tool, convention, origin })
    }

    fn grips(&self) -> &'a [RankedGrip] {
        let grips = &self.set.grips;
        &grips[..self.options.top.unwrap_or(grips.len()).min(grips.len())]
    }

    /// The tool frame in the grip frame: what is fixed to the palm stands by how far the jaws close.
    fn grip_from_tool(&self, grip: &RankedGrip) -> Frame {
        match (self.origin, &self.gripper) {
            (Origin::Stated(_), Some(gripper)) => {
                gripper.palm_place(self.gap(grip)).compose(&self.grip_from_tool)
            }
            _ => self.grip_from_tool,
        }
    }

    /// The tool frame in the part frame.
    fn pose(&self, grip: &RankedGrip) -> Frame {
        tidied(grip.grip.part_from_grip.compose(&self.grip_from_tool(grip)))
    }

    /// The tool frame in the part frame of a candidate that is no grip.
    fn negative_pose(&self, pose: &Negative) -> Frame {
        let tool = match (self.origin, &self.gripper) {
            (Origin::Stated(_), Some(gripper)) => {
                gripper.palm_place(gripper.jaw_gap(&pose.grip())).compose(&self.grip_from_tool)
            }
            _ => self.grip_from_tool,
        };
        tidied(pose.part_from_grip.compose(&tool))
    }

    /// Distance of the pads in the grip \[m\].
    fn gap(&self, grip: &RankedGrip) -> f64 {
        self.gap_at(&grip.grip)
    }

    /// As [`View::gap`], of any pose.
    fn gap_at(&self, grip: &Grip) -> f64 {
        self.gripper.as_ref().map_or(grip.width, |gripper| gripper.jaw_gap(grip))
    }

    /// Distance of the pads before closing \[m\]: as asked for, as planned, or as far as the stroke
    /// allows.
    fn opened(&self, grip: &RankedGrip) -> f64 {
        self.opened_at(&grip.grip)
    }

    /// As [`View::opened`], of any pose.
    fn opened_at(&self, grip: &Grip) -> f64 {
        let gap = self.gap_at(grip);
        match (self.options.opening, &self.gripper) {
            (Some(opened), _) if grip.inside => opened.min(gap),
            (Some(opened), _) => opened.max(gap),
            (None, Some(gripper)) => {
                let planned = self.set.provenance.request.candidates.opening;
                gripper.opened_gap(grip, planned.0)
            }
            (None, None) => gap,
        }
    }

    /// Whether half a turn about the tool's z axis exchanges the jaws: it is the approach, through
    /// the middle of the pads.
    fn turns_about_the_tool_axis(&self) -> bool {
        let tool = &self.grip_from_tool;
        (tool.rotation.z_axis - DVec3::X).length() < 1e-9
            && DVec2::new(tool.origin.y, tool.origin.z).length() < 1e-9
    }

    /// What the pads give and what is asked of them.
    fn pads(&self) -> PadFriction {
        let PadFriction { value, safety } = self.set.pads();
        PadFriction {
            value: self.options.pad_friction.or(value),
            safety: self.options.safety.unwrap_or(safety),
        }
    }

    fn verdict(&self, grip: &RankedGrip) -> Verdict {
        self.pads().verdict(grip.friction_needed())
    }

    /// Whether it holds; without a known friction, whether any friction would do.
    fn holds(&self, grip: &RankedGrip) -> bool {
        self.verdict(grip).holds() != Some(false)
    }

    /// See [`PadFriction::quality`].
    fn quality(&self, grip: &RankedGrip) -> f64 {
        self.pads().quality(grip.friction_needed())
    }

    /// What a user should know before relying on the numbers, a line each.
    fn warnings(&self) -> impl Iterator<Item = String> {
        let one_line = |text: &String| text.split_whitespace().collect::<Vec<_>>().join(" ");
        self.set.provenance.warnings.iter().map(one_line)
    }

    /// The gripper's name; empty where the result states none.
    fn name(&self) -> &str {
        self.set.gripper.get("name").and_then(serde_json::Value::as_str).unwrap_or_default()
    }

    /// What a table's file says beside the rows.
    fn notes(&self) -> serde_json::Value {
        serde_json::json!({
            "tool_frame": self.tool_frame(),
            "part": self.set.part,
            "provenance": self.set.provenance,
            "loads": self.set.loads,
        })
    }

    /// The tool frame in words.
    fn tool_frame(&self) -> String {
        format!("{}, origin {}", self.convention.axes(), self.origin)
    }
}

/// Components that are nothing but rounding are zeros.
fn tidy(vector: DVec3) -> DVec3 {
    vector.map(|value| if value.abs() < ROUNDING { 0.0 } else { value })
}

/// A frame whose numbers are tidy.
fn tidied(mut pose: Frame) -> Frame {
    let axes = [
        &mut pose.rotation.x_axis,
        &mut pose.rotation.y_axis,
        &mut pose.rotation.z_axis,
        &mut pose.origin,
    ];
    axes.into_iter().for_each(|vector| *vector = tidy(*vector));
    pose
}

/// Rows of the homogeneous matrix of a frame.
fn matrix(frame: &Frame) -> [[f64; 4]; 4] {
    let r = frame.rotation.transpose();
    let t = frame.origin;
    [
        [r.x_axis.x, r.x_axis.y, r.x_axis.z, t.x],
        [r.y_axis.x, r.y_axis.y, r.y_axis.z, t.y],
        [r.z_axis.x, r.z_axis.y, r.z_axis.z, t.z],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Writes `set` to `path`, whole or not at all. `part` is the part's mesh, which only
/// formats that draw it need ([`Format::draws`]).
///
/// # Errors
/// When the format is not built in, needs something that the set lacks (a gripper that can be read,
/// its flange), or the file cannot be written.
pub fn write(
    set: &GripSet,
    format: Format,
    path: &Path,
    options: &Options,
    part: Option<&Mesh>,
) -> Result<()> {
    check(format)?;
    let view = View::new(set, format, options)?;
    crate::file::write(path, |writer| write_view(&view, format, writer, part))
}

/// Writes `set` to a writer; see [`write()`].
///
/// # Errors
/// As [`write()`].
pub fn write_to(
    set: &GripSet,
    format: Format,
    writer: &mut (impl Write + Send),
    options: &Options,
    part: Option<&Mesh>,
) -> Result<()> {
    check(format)?;
    let view = View::new(set, format, options)?;
    write_view(&view, format, writer, part)
        .map_err(|error| Error::io(Path::new("standard output"), "write", error))
}

/// Writes the grips of several results into one table, CSV or Parquet: the rows of the first, then
/// those of the next; whole or not at all.
///
/// # Errors
/// When the format is no table, and as [`write()`].
pub fn write_tables(
    sets: &[GripSet],
    format: Format,
    path: &Path,
    options: &Options,
) -> Result<()> {
    let tables = joined(sets, format, options)?;
    crate::file::write(path, |writer| write_table(&tables, format, options.spreadsheet, writer))
}

/// As [`write_tables`], to a writer.
///
/// # Errors
/// As [`write_tables`].
pub fn write_tables_to(
    sets: &[GripSet],
    format: Format,
    writer: &mut (impl Write + Send),
    options: &Options,
) -> Result<()> {
    write_table(&joined(sets, format, options)?, format, options.spreadsheet, writer)
        .map_err(|error| Error::io(Path::new("standard output"), "write", error))
}

/// The table of several results with what a file says of them.
fn joined(
    sets: &[GripSet],
    format: Format,
    options: &Options,
) -> Result<(Table, serde_json::Value)> {
    check(format)?;
    if !matches!(format, Format::Csv | Format::Parquet) {
        return Err(Error::input(
            "results",
            format!("{} of them do not go into one file of this format", sets.len()),
            "write csv or parquet, or a file for each",
        ));
    }
    let mut all = Table::default();
    let mut notes = Vec::new();
    for set in sets {
        let view = View::new(set, format, options)?;
        all.append(table::from_view(&view));
        notes.push(view.notes());
    }
    Ok((all, serde_json::json!({ "results": notes })))
}

fn write_table(
    (table, notes): &(Table, serde_json::Value),
    format: Format,
    spreadsheet: bool,
    writer: &mut (impl Write + Send),
) -> std::io::Result<()> {
    match format {
        Format::Parquet => parquet::write(table, notes, writer),
        _ => table::write_csv(table, spreadsheet, writer),
    }
}

/// The frame whose poses a file holds, in words; `None` for the native ones, which hold the grip
/// frame.
///
/// # Errors
/// As [`write()`], but for the file.
pub fn tool_frame(set: &GripSet, format: Format, options: &Options) -> Result<Option<String>> {
    match format {
        Format::Json | Format::JsonLines => Ok(None),
        _ => Ok(Some(View::new(set, format, options)?.tool_frame())),
    }
}

/// The content of a Parquet file (Zstandard) with these columns.
///
/// # Errors
/// When Parquet is not built in.
pub fn parquet_file(table: &Table) -> Result<Vec<u8>> {
    check(Format::Parquet)?;
    let mut content = Vec::new();
    parquet::write(table, &serde_json::Value::Null, &mut content)
        .map_err(|error| Error::io(Path::new("parquet"), "write", error))?;
    Ok(content)
}

/// Refuses a format that this build lacks, before anything is computed or written.
///
/// # Errors
/// When the format is not built in.
pub fn check(format: Format) -> Result<()> {
    match format {
        Format::Parquet if !cfg!(feature = "parquet") => Err(Error::new(
            ErrorKind::Unsupported,
            "format parquet",
            "this build has no Parquet",
            "build with `cargo build --release --features full`; csv holds the same columns",
        )),
        Format::Acronym if !cfg!(feature = "hdf5") => Err(Error::new(
            ErrorKind::Unsupported,
            "format acronym",
            "this build has no HDF5",
            "build with `cargo build --release --features full`; graspgen holds the same poses as \
             JSON",
        )),
        _ => Ok(()),
    }
}

fn write_view(
    view: &View<'_>,
    format: Format,
    writer: &mut (impl Write + Send),
    part: Option<&Mesh>,
) -> std::io::Result<()> {
    match format {
        Format::Json | Format::JsonLines => {
            let set = GripSet { grips: view.grips().to_vec(), ..view.set.clone() };
            if format == Format::Json {
                set.write_json(writer)
            } else {
                set.write_json_lines(writer)
            }
        }
        Format::Csv => table::write_csv(&table::from_view(view), view.options.spreadsheet, writer),
        Format::Parquet => parquet::write(&table::from_view(view), &view.notes(), writer),
        Format::IsaacGrasp => isaac::write(view, writer),
        Format::GraspGen => graspgen::write(view, writer),
        Format::MoveIt => moveit::write(view, writer),
        Format::GraspNet => graspnet::write(view, writer),
        Format::Acronym => acronym::write(view, writer),
        Format::Glb => glb::write(view, writer, part),
        Format::Usd => usd::write(view, writer, part),
        Format::Intrinsic => intrinsic::write(view, writer),
        Format::Robot => table::write_csv(&robot::table(view), view.options.spreadsheet, writer),
    }
}

//! Ranked grips as arrays, buffers of Arrow, and JSON.

use std::path::{Path, PathBuf};

use gripfast::error::Error;
use gripfast::export::{self, Convention, Dialect, Format, Joint, Options, Origin, Values};
use gripfast::geometry::patch_area;
use gripfast::model::{Patch, Wrench};
use gripfast::pick::Picker;
use gripfast::plan::Outcome;
use gripfast::rank;
use gripfast::results::{GripSet, RankedGrip};
use gripfast::scene::Scene;
use numpy::ndarray::ArrayView2;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;

use crate::errors::{OrRaise, from_json, json as text};
use crate::parts::Part;

/// What a run found.
#[pyclass(frozen, module = "gripfast._gripfast")]
pub(crate) struct Result {
    set: GripSet,
    shown: Vec<u64>,
    checkpoint: Option<PathBuf>,
    written: Vec<PathBuf>,
}

impl Result {
    pub(crate) fn new(outcome: Outcome) -> Self {
        let Outcome { set, shown, checkpoint, written, .. } = outcome;
        Self { set, shown, checkpoint, written }
    }

    /// A set that no run has written.
    pub(crate) fn of_set(set: GripSet) -> Self {
        let shown = set.grips.iter().map(|ranked| ranked.grip.id).collect();
        Self { set, shown, checkpoint: None, written: Vec::new() }
    }

    fn grip(&self, index: usize) -> PyResult<&RankedGrip> {
        self.set.grips.get(index).ok_or_else(|| {
            PyIndexError::new_err(format!("grip {index} of {}", self.set.grips.len()))
        })
    }
}

#[pymethods]
impl Result {
    /// Reads a native result file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self::of_set(py.detach(|| GripSet::read(&path)).or_raise()?))
    }

    fn __len__(&self) -> usize {
        self.set.grips.len()
    }

    /// Ids of the grips to show, best first.
    #[getter]
    fn shown(&self) -> Vec<u64> {
        self.shown.clone()
    }

    /// The file from which an interrupted run can be resumed.
    #[getter]
    fn checkpoint(&self) -> Option<PathBuf> {
        self.checkpoint.clone()
    }

    /// The files written.
    #[getter]
    fn written(&self) -> Vec<PathBuf> {
        self.written.clone()
    }

    /// All but the grips, as JSON.
    fn head(&self) -> PyResult<String> {
        text(&json!({
            "provenance": self.set.provenance,
            "part": self.set.part,
            "gripper": self.set.gripper,
            "loads": self.set.loads,
            "summary": self.set.summary,
            "negatives": self.set.negatives,
        }))
    }

    /// The native result file's text.
    fn json(&self) -> PyResult<String> {
        let mut bytes = Vec::new();
        self.set.write_json(&mut bytes)?;
        Ok(String::from_utf8(bytes)?)
    }

    /// One grip, as JSON.
    fn grip_json(&self, index: usize) -> PyResult<String> {
        text(self.grip(index)?)
    }

    /// The gripper of the run.
    fn gripper_json(&self) -> PyResult<String> {
        text(&self.set.gripper)
    }

    /// Grip frames in the part frame, (n, 4, 4): the columns are `x1`, `x2`, `x3` and the origin; or
    /// the tool frame of an export, the columns then are its axes.
    #[pyo3(signature = (convention=None, origin="pads"))]
    fn poses<'py>(
        &self,
        py: Python<'py>,
        convention: Option<&str>,
        origin: &str,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let tool = match convention {
            None => None,
            Some(name) => {
                let convention = Convention::parse("convention", name).or_raise()?;
                let origin = Origin::parse("origin", origin).or_raise()?;
                let gripper = self.set.read_gripper().or_raise()?;
                let frame =
                    export::grip_from_tool(convention, origin, Some(&gripper)).or_raise()?;
                Some((frame, matches!(origin, Origin::Stated(_)).then_some(gripper)))
            }
        };
        let mut flat = Vec::with_capacity(16 * self.set.grips.len());
        for ranked in &self.set.grips {
            let mut frame = ranked.grip.part_from_grip;
            if let Some((tool, gripper)) = &tool {
                if let Some(gripper) = gripper {
                    let gap = gripper.jaw_gap(&ranked.grip);
                    frame = frame.compose(&gripper.palm_place(gap));
                }
                frame = frame.compose(tool);
            }
            for row in 0..3 {
                flat.extend(frame.rotation.row(row).to_array());
                flat.push(frame.origin[row]);
            }
            flat.extend([0.0, 0.0, 0.0, 1.0]);
        }
        PyArray1::from_vec(py, flat).reshape([self.set.grips.len(), 4, 4])
    }

    /// A number of each grip; nan where there is none.
    fn numbers<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let value: fn(&RankedGrip) -> f64 = match name {
            "width" => |ranked| ranked.grip.width,
            "angle" => |ranked| ranked.grip.angle,
            "mu_s" => |ranked| ranked.worst.mu_s.unwrap_or(f64::NAN),
            "mu_lower" => |ranked| ranked.worst.bounds.map_or(f64::NAN, |bounds| bounds.lower),
            "mu_upper" => |ranked| ranked.worst.bounds.map_or(f64::NAN, |bounds| bounds.upper),
            "safety" => |ranked| ranked.safety.unwrap_or(f64::NAN),
            "score" => |ranked| ranked.score.unwrap_or(f64::INFINITY),
            "alpha" => |ranked| ranked.alpha,
            "contact_share" => |ranked| ranked.contact_share,
            "force_needed" => |ranked| ranked.force_needed.unwrap_or(f64::NAN),
            "load_multiple" => |ranked| ranked.load_multiple.unwrap_or(f64::NAN),
            _ => return Err(PyKeyError::new_err(name.to_owned())),
        };
        Ok(PyArray1::from_vec(py, self.set.grips.iter().map(value).collect()))
    }

    /// A whole number of each grip.
    fn integers<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let grips = &self.set.grips;
        let values = match name {
            "id" => grips.iter().map(|ranked| ranked.grip.id).collect(),
            "rank" => grips.iter().map(|ranked| ranked.rank).collect(),
            "face_i" => grips.iter().map(|ranked| u64::from(ranked.grip.face_i)).collect(),
            "face_ii" => grips.iter().map(|ranked| u64::from(ranked.grip.face_ii)).collect(),
            "load" => grips.iter().map(|ranked| u64::from(ranked.worst.load)).collect(),
            "family" => rank::families(&self.set),
            _ => return Err(PyKeyError::new_err(name.to_owned())),
        };
        Ok(PyArray1::from_vec(py, values))
    }

    /// Statuses under the worst load.
    fn statuses(&self) -> Vec<String> {
        self.set.grips.iter().map(|ranked| rank::status_name(ranked.worst.status)).collect()
    }

    /// Nominal contact areas of face I and II, (n, 2).
    fn contact_areas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let areas = |ranked: &RankedGrip| {
            let contact = &ranked.grip.contact;
            [&contact.face_i, &contact.face_ii].map(|patch: &Patch| patch_area(patch))
        };
        let flat = self.set.grips.iter().flat_map(areas).collect();
        PyArray1::from_vec(py, flat).reshape([self.set.grips.len(), 2])
    }

    /// The worst loads in the grip frame about its origin: force and moment, (n, 6).
    fn worst_loads<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let row = |ranked: &RankedGrip| {
            let Wrench { force, moment } = ranked.worst.wrench;
            [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        };
        let flat = self.set.grips.iter().flat_map(row).collect();
        PyArray1::from_vec(py, flat).reshape([self.set.grips.len(), 6])
    }

    /// The table of CSV and Parquet as buffers of Arrow: name, type, data, offsets or validity, and
    /// rows without a value of each column.
    #[pyo3(signature = (negatives=false, options="{}"))]
    fn columns<'py>(
        &self,
        py: Python<'py>,
        negatives: bool,
        options: &str,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let options = export_options(options)?;
        let table = if negatives {
            export::negatives_table(&self.set, &options)
        } else {
            export::table(&self.set, &options)
        };
        table.or_raise()?.columns.into_iter().map(|column| buffers(py, column)).collect()
    }

    /// Writes the set in the format of a file's ending, or in the one named.
    #[pyo3(signature = (path, format=None, part=None, options="{}"))]
    fn export(
        &self,
        py: Python<'_>,
        path: PathBuf,
        format: Option<&str>,
        part: Option<&Part>,
        options: &str,
    ) -> PyResult<()> {
        let format = match format {
            Some(name) => Format::parse("format", name),
            None => Format::from_path(&path),
        };
        let (format, options) = (format.or_raise()?, export_options(options)?);
        py.detach(|| {
            let mesh = part.map(|part| &part.inner.mesh);
            export::write(&self.set, format, &path, &options, mesh)
        })
        .or_raise()
    }

    /// The page to look at.
    #[pyo3(signature = (part=None))]
    fn report(&self, py: Python<'_>, part: Option<&Part>) -> PyResult<String> {
        py.detach(|| {
            let mut set = self.set.clone();
            let whole = gripfast::plan::WHOLE.min(set.grips.len());
            gripfast::plan::solve_every_load(&mut set, whole)?;
            // A scene that is gone costs the rejected candidates, not the page, which says so.
            let misses = part.and_then(|part| gripfast::plan::near_misses(&set, &part.inner).ok());
            let misses = misses.unwrap_or_default();
            gripfast::report::render(&set, part.map(|part| &part.inner.mesh), &misses)
        })
        .or_raise()
    }

    /// The part that the set names: from `path`, or from where the set says.
    #[pyo3(signature = (path=None))]
    fn read_part(&self, py: Python<'_>, path: Option<PathBuf>) -> PyResult<Part> {
        let path = path.unwrap_or_else(|| PathBuf::from(&self.set.part.file));
        let part = py.detach(|| self.set.read_part(&path)).or_raise()?;
        Ok(Part { inner: part.into() })
    }

    /// Every test of a grip, as JSON.
    fn why(&self, py: Python<'_>, index: usize, part: &Part) -> PyResult<String> {
        let ranked = self.grip(index)?;
        let explained = py.detach(|| gripfast::plan::explain(&self.set, ranked, &part.inner));
        let explained = explained.or_raise()?;
        let checks = explained.checks.iter().map(
            |check| json!({"name": check.name, "passed": check.passed, "detail": check.detail}),
        );
        text(&json!({
            "checks": checks.collect::<Vec<_>>(),
            "rejection": explained.rejection.map(|reason| reason.name()),
            "place": explained.place,
            "width": explained.width,
        }))
    }

    /// The first grip that is free in a scene: its index, and why each one before it is not.
    #[pyo3(signature = (scene, folder, world_from_part=None))]
    fn pick(
        &self,
        py: Python<'_>,
        scene: &str,
        folder: PathBuf,
        world_from_part: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<(Option<usize>, Vec<String>)> {
        let pose = world_from_part.map(|matrix| frame(matrix.as_array())).transpose()?;
        py.detach(|| {
            let scene = Scene::parse("scene", scene, Path::new(&folder))?;
            let picker = Picker::new(&self.set, &scene)?;
            let pick = picker.pick(&pose.unwrap_or(scene.world_from_part));
            let passed = pick.passed.iter().map(|reason| picker.describe(reason)).collect();
            Ok((pick.chosen, passed))
        })
        .or_raise()
    }
}

/// A pose given as a 4 x 4 matrix.
pub(crate) fn frame(rows: ArrayView2<'_, f64>) -> PyResult<gripfast::model::Frame> {
    use gripfast::glam::{DMat3, DVec3};
    if rows.dim() != (4, 4) {
        let problem = format!("is {:?}", rows.shape());
        return Err(Error::input("pose", problem, "give a 4 x 4 matrix")).or_raise();
    }
    let column = |k: usize| DVec3::new(rows[[0, k]], rows[[1, k]], rows[[2, k]]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let drift = rotation * rotation.transpose() - DMat3::IDENTITY;
    if !drift.to_cols_array().iter().all(|entry| entry.abs() < 1e-6) || rotation.determinant() < 0.0
    {
        let remedy = "give a rotation in the upper left and an origin in metres on the right";
        return Err(Error::input("pose", "is no rotation", remedy)).or_raise();
    }
    Ok(gripfast::model::Frame { rotation, origin: column(3) })
}

/// A column of a table as buffers in Arrow's layout.
fn buffers<'py>(py: Python<'py>, column: export::Column) -> PyResult<Bound<'py, PyDict>> {
    let buffers = PyDict::new(py);
    buffers.set_item("name", column.name)?;
    match column.values {
        Values::Integer(values) => {
            buffers.set_item("type", "uint64")?;
            buffers.set_item("rows", values.len())?;
            buffers.set_item("data", PyArray1::from_vec(py, values))?;
        }
        Values::Number(values) => {
            let mut valid = vec![0_u8; values.len().div_ceil(8)];
            for (row, value) in values.iter().enumerate() {
                valid[row / 8] |= u8::from(value.is_some()) << (row % 8);
            }
            let missing = values.iter().filter(|value| value.is_none()).count();
            buffers.set_item("type", "float64")?;
            buffers.set_item("rows", values.len())?;
            buffers.set_item("missing", missing)?;
            buffers.set_item("valid", PyArray1::from_vec(py, valid))?;
            let data = values.into_iter().map(Option::unwrap_or_default).collect();
            buffers.set_item("data", PyArray1::<f64>::from_vec(py, data))?;
        }
        Values::Text(values) => {
            let mut offsets = vec![0_i32];
            let mut bytes = Vec::new();
            for value in &values {
                bytes.extend_from_slice(value.as_bytes());
                offsets.push(i32::try_from(bytes.len()).unwrap_or(i32::MAX));
            }
            buffers.set_item("type", "string")?;
            buffers.set_item("rows", values.len())?;
            buffers.set_item("offsets", PyArray1::from_vec(py, offsets))?;
            buffers.set_item("data", PyArray1::from_vec(py, bytes))?;
        }
    }
    Ok(buffers)
}

/// Options of an export from JSON, named as the flags of `gripfast export`.
fn export_options(text: &str) -> PyResult<Options> {
    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields, default)]
    struct Given {
        convention: Option<String>,
        origin: Option<String>,
        top: Option<usize>,
        opening: Option<f64>,
        joint: Vec<String>,
        pad_friction: Option<f64>,
        approach: f64,
        part_frame: String,
        dialect: Option<String>,
        spreadsheet: bool,
    }
    impl Default for Given {
        fn default() -> Self {
            let Options { approach, part_frame, .. } = Options::default();
            Self {
                convention: None,
                origin: None,
                top: None,
                opening: None,
                joint: Vec::new(),
                pad_friction: None,
                approach,
                part_frame,
                dialect: None,
                spreadsheet: false,
            }
        }
    }
    let given: Given = from_json("export options", text)?;
    let convention = given.convention.map(|name| Convention::parse("convention", &name));
    let joints = given.joint.iter().map(|joint| Joint::parse("joint", joint));
    let joints = joints.collect::<gripfast::error::Result<Vec<_>>>().or_raise()?;
    let mut options = Options::default();
    options.convention = convention.transpose().or_raise()?;
    let origin = given.origin.map(|text| Origin::parse("origin", &text));
    options.origin = origin.transpose().or_raise()?;
    (options.top, options.opening) = (given.top, given.opening);
    options.pad_friction = given.pad_friction;
    (options.approach, options.part_frame) = (given.approach, given.part_frame);
    options.spreadsheet = given.spreadsheet;
    if let Some(name) = given.dialect {
        options.dialect = Dialect::parse("dialect", &name).or_raise()?;
    }
    if !joints.is_empty() {
        options.joints = joints;
    }
    Ok(options)
}

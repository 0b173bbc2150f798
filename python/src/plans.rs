//! The main job.

use std::path::PathBuf;

use gripfast::error::Result as Checked;
use gripfast::export::{Convention, Format, Origin};
use gripfast::glam::DVec3;
use gripfast::model::{LoadCase, Wrench};
use gripfast::plan::{Observer, Plan, PlanBuilder};
use gripfast::poses::{self, Pose};
use gripfast::units::Quantity;
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors::{OrRaise, json};
use crate::grippers::Gripper;
use crate::parts::Part;
use crate::requests;
use crate::results::{Result, frame};
use crate::watch::watched;

/// Names and (n, 6) forces and moments in the part frame about the centre of mass.
type Wrenches<'py> = (Vec<String>, PyReadonlyArray2<'py, f64>);

/// Runs a request, on a part, gripper and loads in memory where they are given.
#[pyfunction]
#[pyo3(signature = (request, part=None, gripper=None, loads=None, listener=None))]
pub(crate) fn plan(
    py: Python<'_>,
    request: &str,
    part: Option<&Part>,
    gripper: Option<&Gripper>,
    loads: Option<Wrenches<'_>>,
    listener: Option<Py<PyAny>>,
) -> PyResult<(Result, Part)> {
    let builder = builder(request, part, gripper, loads)?;
    let done = watched(py, listener.as_ref(), move |mut teller, stop| {
        let plan = builder.build()?;
        let outcome = plan.run(&mut teller, stop)?;
        Ok((plan.part().clone(), outcome))
    })?;
    let (part, outcome) = done.or_raise()?;
    Ok((Result::new(outcome), Part { inner: part.into() }))
}

/// Poses to assess: (n, 4, 4) in the part frame, or those of a file.
#[derive(FromPyObject)]
pub(crate) enum Poses<'py> {
    Array(PyReadonlyArray3<'py, f64>),
    File(PathBuf),
}

/// Assesses poses: what became of each, as JSON, and those that are grips. `axes` are the names of
/// format (of a file), convention and origin.
#[pyfunction]
#[pyo3(signature = (request, poses, axes, tilt, part=None, gripper=None, loads=None, listener=None))]
#[expect(clippy::too_many_arguments, reason = "each is an argument in Python")]
pub(crate) fn assess(
    py: Python<'_>,
    request: &str,
    poses: Poses<'_>,
    axes: [Option<String>; 3],
    tilt: &str,
    part: Option<&Part>,
    gripper: Option<&Gripper>,
    loads: Option<Wrenches<'_>>,
    listener: Option<Py<PyAny>>,
) -> PyResult<(Vec<String>, Result, Part)> {
    let builder = builder(request, part, gripper, loads)?;
    let tilt = Quantity::Angle.parse("tilt", tilt).or_raise()?;
    let options = options(&axes).or_raise()?;
    let given = match poses {
        Poses::File(path) => Err(path),
        Poses::Array(array) => Ok(rows(&array, options)?),
    };
    let done = watched(py, listener.as_ref(), move |mut teller, _| {
        let plan = builder.build()?;
        plan.warnings().iter().for_each(|text| teller.warning(text));
        let list = given.or_else(|path| poses::read(&path, &options, plan.gripper()))?;
        Ok((plan.assess(&list, tilt)?, plan.part().clone()))
    })?;
    let (assessment, part) = done.or_raise()?;
    let told = assessment.poses.iter().map(|pose| json(&pose.to_json(&assessment.set)));
    let told = told.collect::<PyResult<_>>()?;
    Ok((told, Result::of_set(assessment.set), Part { inner: part.into() }))
}

fn options([format, convention, origin]: &[Option<String>; 3]) -> Checked<poses::Options> {
    let format = format.as_deref().map(|name| Format::parse("format", name)).transpose()?;
    let convention =
        convention.as_deref().map(|name| Convention::parse("convention", name)).transpose()?;
    let origin = origin.as_deref().map(|text| Origin::parse("origin", text)).transpose()?;
    Ok(poses::Options { format, convention, origin })
}

/// Grip frames, or tool frames where a convention is named; their names are their places.
fn rows(array: &PyReadonlyArray3<'_, f64>, options: poses::Options) -> PyResult<Vec<Pose>> {
    let matrices = array.as_array();
    let pose = |(place, matrix)| {
        let part_from_tool = frame(matrix)?;
        let name = format!("{place}");
        Ok(match options.convention {
            None => Pose::of_grip(&name, part_from_tool),
            Some(convention) => {
                let origin = options.origin.unwrap_or(Origin::Pads);
                Pose { name, part_from_tool, convention, origin, gap: None }
            }
        })
    };
    matrices.outer_iter().enumerate().map(pose).collect()
}

fn builder(
    request: &str,
    part: Option<&Part>,
    gripper: Option<&Gripper>,
    loads: Option<Wrenches<'_>>,
) -> PyResult<PlanBuilder> {
    let mut builder = Plan::builder(requests::read(request)?);
    if let Some(part) = part {
        builder = builder.part((*part.inner).clone());
    }
    if let Some(gripper) = gripper {
        builder = builder.gripper((*gripper.inner).clone());
    }
    if let Some((names, wrenches)) = loads {
        builder = builder.loads(cases(names, &wrenches)?);
    }
    Ok(builder)
}

fn cases(names: Vec<String>, wrenches: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<LoadCase>> {
    let rows = wrenches.as_array();
    if rows.ncols() != 6 || rows.nrows() != names.len() {
        return Err(PyValueError::new_err(format!(
            "wrenches are (n, 6), one for each name; these are {:?} for {} names",
            rows.shape(),
            names.len()
        )));
    }
    let case = |(name, row): (String, usize)| {
        let value = |k: usize| rows[[row, k]];
        let force = DVec3::new(value(0), value(1), value(2));
        let moment = DVec3::new(value(3), value(4), value(5));
        LoadCase { name, wrench: Wrench { force, moment } }
    };
    Ok(names.into_iter().zip(0..).map(case).collect())
}

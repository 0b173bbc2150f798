//! The main job.

use gripfast::glam::DVec3;
use gripfast::model::{LoadCase, Wrench};
use gripfast::plan::Plan;
use numpy::PyReadonlyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors::OrRaise;
use crate::grippers::Gripper;
use crate::parts::Part;
use crate::requests;
use crate::results::Result;
use crate::watch::watched;

/// Runs a request, on a part, gripper and loads in memory where they are given: names and (n, 6)
/// forces and moments in the part frame about the centre of mass.
#[pyfunction]
#[pyo3(signature = (request, part=None, gripper=None, loads=None, listener=None))]
pub(crate) fn plan(
    py: Python<'_>,
    request: &str,
    part: Option<&Part>,
    gripper: Option<&Gripper>,
    loads: Option<(Vec<String>, PyReadonlyArray2<'_, f64>)>,
    listener: Option<Py<PyAny>>,
) -> PyResult<(Result, Part)> {
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
    let done = watched(py, listener.as_ref(), move |mut teller, stop| {
        let plan = builder.build()?;
        let outcome = plan.run(&mut teller, stop)?;
        Ok((plan.part().clone(), outcome))
    })?;
    let (part, outcome) = done.or_raise()?;
    Ok((Result::new(outcome), Part { inner: part.into() }))
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

//! Contacts and loads of one's own.

use std::sync::Arc;

use gripfast::backend::{Batch, Problem, ScoreOptions, SeedSet, select};
use gripfast::glam::DVec3;
use gripfast::model::{Contact, Wrench};
use gripfast::rank::status_name;
use gripfast::request::{Choice, Polish};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors::{OrRaise, from_json};
use crate::watch::watched;

/// Numbers and statuses, a row for each contact.
type Scores<'py> = (Bound<'py, PyArray2<f64>>, Vec<Vec<String>>);

/// The smallest friction of each contact under each load, (n, m), nan where none holds; and the
/// statuses. `contacts` is JSON, `wrenches` (n, m, 6) in the grip frame about its origin.
#[pyfunction]
pub(crate) fn score<'py>(
    py: Python<'py>,
    contacts: &str,
    distances: PyReadonlyArray1<'py, f64>,
    forces: PyReadonlyArray1<'py, f64>,
    wrenches: PyReadonlyArray3<'py, f64>,
    backend: &str,
) -> PyResult<Scores<'py>> {
    let contacts: Vec<Arc<Contact>> =
        from_json::<Vec<Contact>>("contacts", contacts)?.into_iter().map(Arc::new).collect();
    let (distances, forces, rows) = (distances.as_array(), forces.as_array(), wrenches.as_array());
    let (count, loads, six) = rows.dim();
    if six != 6 || [contacts.len(), distances.len(), forces.len()] != [count; 3] {
        return Err(PyValueError::new_err(format!(
            "wrenches are (n, m, 6) for n contacts, distances and forces; these are {:?} for {}, {} and {}",
            rows.shape(),
            contacts.len(),
            distances.len(),
            forces.len()
        )));
    }
    let wrench = |grip: usize, load: usize| {
        let value = |k: usize| rows[[grip, load, k]];
        Wrench {
            force: DVec3::new(value(0), value(1), value(2)),
            moment: DVec3::new(value(3), value(4), value(5)),
        }
    };
    let wrenches: Vec<Vec<Wrench>> =
        (0..count).map(|grip| (0..loads).map(|load| wrench(grip, load)).collect()).collect();
    let scales: Vec<(f64, f64)> = distances.iter().copied().zip(forces.iter().copied()).collect();
    let choice: Choice = backend.parse().or_raise()?;
    let scored = watched(py, None, move |_, _| {
        let problem = |grip: usize| Problem {
            contact: &contacts[grip],
            distance: scales[grip].0,
            force: scales[grip].1,
            wrenches: &wrenches[grip],
            pose: None,
        };
        let batch = Batch { problems: (0..count).map(problem).collect() };
        let options = ScoreOptions { polish: Polish::All, ..ScoreOptions::default() };
        select(choice, None)?.backend.score(&batch, &SeedSet::default(), &options)
    })?
    .or_raise()?;
    let mut mu = Vec::with_capacity(count * loads);
    let mut statuses = Vec::with_capacity(count);
    for answer in &scored {
        mu.extend(answer.all.iter().map(|score| score.mu_s.unwrap_or(f64::NAN)));
        statuses.push(answer.all.iter().map(|score| status_name(score.status)).collect());
    }
    Ok((PyArray1::from_vec(py, mu).reshape([count, loads])?, statuses))
}

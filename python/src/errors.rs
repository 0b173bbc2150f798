//! Errors of the library as exceptions of the package, one class for each kind.

use gripfast::error::Error;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// The exception for an error.
pub(crate) fn exception(error: &Error) -> PyErr {
    let remedy = error.remedy();
    raised(
        error.kind().name(),
        error.to_string(),
        [error.place(), error.problem(), remedy],
        error.options().to_vec(),
    )
}

/// The exception for a fault of the library.
pub(crate) fn fault(panic: &(dyn std::any::Any + Send)) -> PyErr {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    let problem = format!("a fault of the program: {text}");
    raised("panic", problem.clone(), ["", &problem, "please report it"], Vec::new())
}

fn raised(kind: &str, text: String, parts: [&str; 3], options: Vec<&str>) -> PyErr {
    Python::attach(|py| {
        let make = || -> PyResult<PyErr> {
            let make = py.import("gripfast._errors")?.getattr("make")?;
            let [place, problem, remedy] = parts;
            Ok(PyErr::from_value(make.call1((kind, &text, place, problem, remedy, options))?))
        };
        make().unwrap_or_else(|_| PyRuntimeError::new_err(text.clone()))
    })
}

/// Turns errors of the library into exceptions.
pub(crate) trait OrRaise<T> {
    /// The value, or the exception for the error.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> OrRaise<T> for gripfast::error::Result<T> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| exception(&error))
    }
}

/// A value as JSON.
pub(crate) fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| PyRuntimeError::new_err(error.to_string()))
}

/// What a JSON text stands for.
pub(crate) fn from_json<T: serde::de::DeserializeOwned>(place: &str, text: &str) -> PyResult<T> {
    serde_json::from_str(text)
        .map_err(|error| Error::format(place, error.to_string(), ""))
        .or_raise()
}

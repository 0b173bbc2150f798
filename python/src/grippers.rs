//! Grippers of the catalogue and of files.

use std::sync::Arc;

use gripfast::gripper;
use pyo3::prelude::*;

use crate::errors::{OrRaise, from_json, json};

/// A two-finger gripper.
#[pyclass(frozen, module = "gripfast._gripfast")]
pub(crate) struct Gripper {
    pub(crate) inner: Arc<gripper::Gripper>,
}

#[pymethods]
impl Gripper {
    /// One of the catalogue by its name, or that of a file.
    #[staticmethod]
    fn find(name_or_path: &str) -> PyResult<Self> {
        Ok(Self { inner: Arc::new(gripper::find(name_or_path).or_raise()?) })
    }

    /// That of a gripper file's text.
    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        Ok(Self { inner: Arc::new(gripper::parse(text, "gripper").or_raise()?) })
    }

    /// One as result files hold it.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        Ok(Self { inner: Arc::new(from_json("gripper", text)?) })
    }

    /// Names in the catalogue.
    #[staticmethod]
    fn catalogue() -> Vec<&'static str> {
        gripper::catalogue::CATALOGUE.iter().map(|(name, _)| *name).collect()
    }

    /// As result files hold it.
    fn json(&self) -> PyResult<String> {
        json(&*self.inner)
    }
}

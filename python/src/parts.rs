//! Parts: read from a file or made of arrays.

use std::path::PathBuf;
use std::sync::Arc;

use gripfast::glam::DVec3;
use gripfast::part::{self, ReadOptions};
use gripfast::units::{Quantity, Unit};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors::{OrRaise, json};

/// Areas (n), normals (n, 3), centroids (n, 3).
type FaceArrays<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// A part, read and checked.
#[pyclass(frozen, module = "gripfast._gripfast")]
pub(crate) struct Part {
    pub(crate) inner: Arc<part::Part>,
}

#[pymethods]
impl Part {
    /// Reads a file; `known_as` is the name of it that results carry, where that is another.
    #[staticmethod]
    #[pyo3(signature = (path, unit=None, max_memory=None, outside_buffers=false, faceted=false, fit=None, known_as=None))]
    #[allow(clippy::too_many_arguments, reason = "one for each argument of the Python call")]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        unit: Option<&str>,
        max_memory: Option<&str>,
        outside_buffers: bool,
        faceted: bool,
        fit: Option<&str>,
        known_as: Option<PathBuf>,
    ) -> PyResult<Self> {
        let unit = unit.map(|text| text.parse::<Unit>()).transpose().or_raise()?;
        let max_memory = max_memory
            .map(|text| Quantity::Memory.parse("max_memory", text))
            .transpose()
            .or_raise()?
            .map(|bytes| bytes as u64);
        let mut options = ReadOptions::default();
        (options.unit, options.max_memory) = (unit, max_memory);
        (options.outside_buffers, options.faceted) = (outside_buffers, faceted);
        options.fit = fit.map(|text| Quantity::Length.parse("fit", text)).transpose().or_raise()?;
        let mut part = py.detach(|| part::Part::read(&path, &options)).or_raise()?;
        if let Some(name) = known_as {
            part.file = name;
        }
        Ok(Self { inner: Arc::new(part) })
    }

    /// A part of triangles: vertices (n, 3) times `scale` in metres, corner numbers (m, 3).
    #[staticmethod]
    #[pyo3(signature = (name, vertices, triangles, scale, faceted=false, fit=None))]
    fn from_arrays(
        py: Python<'_>,
        name: &str,
        vertices: PyReadonlyArray2<'_, f64>,
        triangles: PyReadonlyArray2<'_, i64>,
        scale: f64,
        faceted: bool,
        fit: Option<&str>,
    ) -> PyResult<Self> {
        let (vertices, triangles) = (vertices.as_array(), triangles.as_array());
        if vertices.ncols() != 3 || triangles.ncols() != 3 {
            return Err(PyValueError::new_err(format!(
                "vertices are (n, 3) and faces (m, 3); these are {:?} and {:?}",
                vertices.shape(),
                triangles.shape()
            )));
        }
        let points: Vec<DVec3> = vertices
            .rows()
            .into_iter()
            .map(|row| DVec3::new(row[0], row[1], row[2]) * scale)
            .collect();
        // A number that is no vertex is refused with its place by the library.
        let corner = |index: i64| u32::try_from(index).unwrap_or(u32::MAX);
        let corners: Vec<[u32; 3]> =
            triangles.rows().into_iter().map(|row| [0, 1, 2].map(|k| corner(row[k]))).collect();
        let name = name.to_owned();
        let fit = fit.map(|text| Quantity::Length.parse("fit", text)).transpose().or_raise()?;
        let options = ReadOptions::default().with_faceted(faceted).with_fit(fit);
        let part = py
            .detach(|| part::Part::from_triangles_with(&name, &points, &corners, &options))
            .or_raise()?;
        Ok(Self { inner: Arc::new(part) })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    #[getter]
    fn file(&self) -> String {
        self.inner.file.display().to_string()
    }

    /// Metres in a unit of the file.
    #[getter]
    fn unit_m(&self) -> f64 {
        self.inner.unit_m
    }

    /// (n, 3), in metres.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let vertices = &self.inner.mesh.vertices;
        let flat = vertices.iter().flat_map(|vertex| vertex.to_array()).collect();
        PyArray1::from_vec(py, flat).reshape([vertices.len(), 3])
    }

    /// (m, 3).
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let triangles = &self.inner.mesh.triangles;
        let flat = triangles.iter().flatten().copied().collect();
        PyArray1::from_vec(py, flat).reshape([triangles.len(), 3])
    }

    /// Findings and repairs, as JSON.
    #[getter]
    fn health(&self) -> PyResult<String> {
        json(&self.inner.health)
    }

    /// Mass properties at a density in kg/m3, as JSON.
    fn mass_properties(&self, density: f64) -> PyResult<String> {
        json(&self.inner.mass_properties(density))
    }

    /// Planar faces: areas (n), normals (n, 3), centroids (n, 3).
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<FaceArrays<'py>> {
        let faces = &self.inner.faces;
        let vectors = |value: &dyn Fn(&part::PlanarFace) -> DVec3| {
            let flat = faces.iter().flat_map(|face| value(face).to_array()).collect();
            PyArray1::from_vec(py, flat).reshape([faces.len(), 3])
        };
        Ok((
            PyArray1::from_vec(py, faces.iter().map(|face| face.area).collect()),
            vectors(&|face| face.normal)?,
            vectors(&|face| face.centroid)?,
        ))
    }
}

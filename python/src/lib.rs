//! The extension module of the Python package `gripfast`: arrays, bytes and JSON texts in and out.
//! The package beside it dresses them; see `gripfast/__init__.py`.

mod batch;
mod errors;
mod grippers;
mod parts;
mod plans;
mod requests;
mod results;
mod scores;
mod watch;

use pyo3::prelude::*;

/// What the package is made of.
#[pymodule(gil_used = true)]
fn _gripfast(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("parquet", cfg!(feature = "parquet"))?;
    module.add_class::<parts::Part>()?;
    module.add_class::<grippers::Gripper>()?;
    module.add_class::<results::Result>()?;
    module.add_class::<batch::Store>()?;
    for function in [
        wrap_pyfunction!(plans::plan, module)?,
        wrap_pyfunction!(plans::assess, module)?,
        wrap_pyfunction!(requests::request_default, module)?,
        wrap_pyfunction!(requests::request_check, module)?,
        wrap_pyfunction!(requests::request_set, module)?,
        wrap_pyfunction!(requests::request_from_toml, module)?,
        wrap_pyfunction!(requests::request_to_toml, module)?,
        wrap_pyfunction!(scores::score, module)?,
        wrap_pyfunction!(batch::batch_jobs, module)?,
        wrap_pyfunction!(batch::batch_run, module)?,
        wrap_pyfunction!(batch::run_job, module)?,
        wrap_pyfunction!(batch::run_share, module)?,
        wrap_pyfunction!(batch::gather_job, module)?,
        wrap_pyfunction!(batch::lost_job, module)?,
    ] {
        module.add_function(function)?;
    }
    Ok(())
}

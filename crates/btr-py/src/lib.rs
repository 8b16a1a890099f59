//! Python bindings of btr: `import btr`. Results are passed as JSON text, logs as NumPy arrays. Convenience functions
//! are written in Python, in the package around this module.

#![allow(clippy::needless_pass_by_value, reason = "what Python hands over is owned here")]

mod coevolve;
mod distance;
mod error;
mod laws;
mod log;
mod model;
mod overlay;
mod page;
mod search;
mod settings;
mod verbs;
mod work;

use pyo3::prelude::*;

/// The compiled half of the `btr` package.
#[pymodule]
fn _btr(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("BtrError", module.py().get_type::<error::BtrError>())?;
    module.add("TestFailed", module.py().get_type::<error::TestFailed>())?;
    module.add_class::<log::Log>()?;
    module.add_class::<model::Model>()?;
    module.add_class::<overlay::Overlay>()?;
    module.add_class::<page::Page>()?;
    module.add_class::<search::Search>()?;
    module.add_function(wrap_pyfunction!(model::new_model, module)?)?;
    module.add_function(wrap_pyfunction!(search::searches, module)?)?;
    module.add_function(wrap_pyfunction!(distance::distance, module)?)?;
    module.add_function(wrap_pyfunction!(distance::distances, module)?)?;
    module.add_function(wrap_pyfunction!(distance::fitness_distance, module)?)?;
    module.add_function(wrap_pyfunction!(distance::measured, module)?)?;
    module.add_function(wrap_pyfunction!(log::log_of_columns, module)?)?;
    module.add_function(wrap_pyfunction!(log::log_of_messages, module)?)?;
    module.add_function(wrap_pyfunction!(log::renamed, module)?)?;
    module.add_function(wrap_pyfunction!(log::time_of, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::check, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::compare, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::effects, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::fit, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::unusable, module)?)?;
    module.add_class::<work::Payload>()?;
    module.add_function(wrap_pyfunction!(coevolve::coevolve, module)?)?;
    module.add_function(wrap_pyfunction!(coevolve::snapshot, module)?)?;
    module.add_function(wrap_pyfunction!(work::forked, module)?)?;
    module.add_function(wrap_pyfunction!(work::serve, module)?)?;
    module.add_function(wrap_pyfunction!(page::write_report, module)?)?;
    #[cfg(feature = "command")]
    module.add_function(wrap_pyfunction!(command, module)?)?;
    Ok(())
}

/// The command `btr`: takes its arguments, its own name first, and returns its exit code.
#[cfg(feature = "command")]
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| btr_cli::run(arguments))
}

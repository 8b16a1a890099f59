//! Python bindings of btr: `import btr`. Answers cross over as JSON text, logs as NumPy arrays; what is nice to have in Python is
//! written in Python, in the package around this module.

#![allow(clippy::needless_pass_by_value, reason = "what Python hands over is owned here")]

mod error;
mod log;
mod model;
mod verbs;

use pyo3::prelude::*;
use std::ffi::OsString;

/// The compiled half of the `btr` package.
#[pymodule]
fn _btr(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("BtrError", module.py().get_type::<error::BtrError>())?;
    module.add_class::<log::Log>()?;
    module.add_class::<model::Model>()?;
    module.add_function(wrap_pyfunction!(log::log_of_messages, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::check, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::compare, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::fit, module)?)?;
    module.add_function(wrap_pyfunction!(command, module)?)
}

/// The command `btr`: takes its arguments, its own name first, and gives back its exit code.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| btr_cli::run(arguments))
}

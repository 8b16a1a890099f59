//! Python bindings of btr: `import btr`.
use pyo3::prelude::*;

/// The compiled half of the `btr` package.
#[pymodule]
fn _btr(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}

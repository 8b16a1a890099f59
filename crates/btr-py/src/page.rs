//! HTML reports, as the command line writes them.

use crate::error::{Raise, raised};
use crate::work::at_once;
use btr_lab::experiment::Source;
use btr_report::html;
use pyo3::prelude::*;
use std::path::PathBuf;

/// A report that is rendered on demand: rendering can take as long as the comparison.
#[pyclass(frozen, module = "btr._btr", name = "Page")]
pub(crate) struct Page {
    /// Of the model that is simulated for it.
    source: Source,
    make: Box<dyn Fn() -> String + Send + Sync>,
}

impl Page {
    pub(crate) fn new(source: &Source, make: impl Fn() -> String + Send + Sync + 'static) -> Self {
        Page { source: source.clone(), make: Box::new(make) }
    }
}

#[pymethods]
impl Page {
    /// The whole page, HTML that needs no other file.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        at_once(py, &self.source, || Ok((self.make)()))
    }
}

/// Writes a page, whole or not at all. Its name ends in .html, so that no recording is written over.
#[pyfunction]
pub(crate) fn write_report(path: PathBuf, html: &str) -> PyResult<()> {
    if path.extension().is_none_or(|ending| ending != "html") {
        let help = "give the report another name".into();
        return Err(raised(format!("{}: the name of a report must end in .html", path.display()), Some(help)));
    }
    html::write(&path, html).map_err(Raise::raise)
}

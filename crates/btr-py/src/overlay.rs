//! Both robots of a comparison for robot viewers, as the command line writes them.

use crate::error::Raise;
use crate::work::at_once;
use btr_core::world::WorldError;
use btr_lab::experiment::Source;
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, guard, inputs, unwritable};
use btr_lab::verbs::CompareReport;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// The measured and the simulated robot of a comparison, which are written on demand.
#[pyclass(frozen, module = "btr._btr", name = "Overlay")]
pub(crate) struct Overlay {
    source: Source,
    outcome: Arc<CompareReport>,
}

impl Overlay {
    pub(crate) fn new(source: &Source, outcome: Arc<CompareReport>) -> Self {
        Overlay { source: source.clone(), outcome }
    }
}

#[pymethods]
impl Overlay {
    /// Writes an MCAP file, whole or not at all. It replaces no recording.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        at_once(py, &self.source, || {
            guard(OutputKind::Overlay.at(Some(&path)), inputs(&self.source, [])).map_err(Raise::raise)?;
            let overlay = self.outcome.overlay().map_err(|error| Failure::from(WorldError::from(error)).raise())?;
            btr_io::write_overlay(&path, &overlay).map_err(|error| unwritable(&error).raise())
        })
    }
}

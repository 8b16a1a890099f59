//! Files that people look at.

use crate::failure::Failure;
use btr_physics::experiment::Experiment;
use btr_physics::report::Report;
use btr_physics::run::Run;
use std::path::PathBuf;

pub(crate) fn write(_: &Experiment, _: &Run, _: &Report) -> Result<Vec<PathBuf>, Failure> {
    Ok(Vec::new())
}

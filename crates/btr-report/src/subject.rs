//! The model and the logs that a report is about.

use btr_lab::verbs::VerbInput;
use std::path::PathBuf;

/// The input of `diagnose` or `fit` that a report is about.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The model and the logs as they were read.
    pub input: &'a VerbInput,
    /// The training logs: files, or names.
    pub logs: &'a [PathBuf],
    /// The held-out logs: files, or names.
    pub held_out: &'a [PathBuf],
}

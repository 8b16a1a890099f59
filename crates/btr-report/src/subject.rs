//! The question that an answer belongs to: a model and its logs.

use btr_lab::verbs::VerbInput;
use std::path::PathBuf;

/// What a page is about: a question to `diagnose` or `fit`.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The model beside the logs.
    pub input: &'a VerbInput,
    /// The logs to learn from: files, or what they are called.
    pub logs: &'a [PathBuf],
    /// The logs to judge on.
    pub held_out: &'a [PathBuf],
}

//! What a verb may write, asked before it computes anything: a file in a folder that is there, over nothing but an
//! earlier output of its own kind. A recording exists once.

use crate::experiment::Source;
use crate::failure::Failure;
use crate::model_text::named_files;
use btr_core::log::Role;
use btr_io::{IoError, Mapping};
use std::path::{Path, PathBuf};

/// What is written.
#[derive(Clone, Copy)]
pub enum OutputKind {
    /// A model's TOML.
    Model,
    /// An HTML report.
    Report,
    /// A log.
    Log {
        /// Whether it may take the place of one that holds more than commands.
        over_measurements: bool,
    },
}

/// A file that a verb is to write.
pub struct OutputFile<'a> {
    /// Where.
    pub path: &'a Path,
    /// What.
    pub kind: OutputKind,
}

impl OutputKind {
    /// This kind of output at a path, if one is given.
    pub fn at(self, path: Option<&Path>) -> Option<OutputFile<'_>> {
        path.map(|path| OutputFile { path, kind: self })
    }
}

/// Every file that a verb reads: the model, what it names, and these.
pub fn inputs(source: &Source, further: impl IntoIterator<Item = PathBuf>) -> Vec<PathBuf> {
    std::iter::once(source.path.clone()).chain(named_files(source)).chain(further).collect()
}

/// Refuses a log that cannot be written, or that would take the place of one with more than commands in it.
///
/// # Errors
/// See [`guard`].
pub fn may_write_log(path: &Path, over_measurements: bool) -> Result<(), Failure> {
    guard(OutputKind::Log { over_measurements }.at(Some(path)), [])
}

/// Refuses outputs that cannot be written or would take the place of what is not theirs to replace.
///
/// # Errors
/// An output that is one of the inputs, by whatever name; one whose name is not of its kind; a log in the place of
/// measurements; a folder that is not there or cannot be written into.
pub fn guard<'a>(
    outputs: impl IntoIterator<Item = OutputFile<'a>>,
    inputs: impl IntoIterator<Item = PathBuf>,
) -> Result<(), Failure> {
    let inputs: Vec<PathBuf> = inputs.into_iter().filter_map(|input| input.canonicalize().ok()).collect();
    outputs.into_iter().try_for_each(|output| output.check(&inputs))
}

impl OutputFile<'_> {
    fn check(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        let name = self.path.display();
        if self.path.canonicalize().is_ok_and(|there| inputs.contains(&there)) {
            return Err(refused(format!("{name} is read here and would be written over")));
        }
        match self.kind {
            OutputKind::Model => self.ends_in("toml", "a model"),
            OutputKind::Report => self.ends_in("html", "a report"),
            OutputKind::Log { over_measurements } => {
                btr_io::can_write_log(self.path).map_err(|error| unwritable(&error))?;
                if !over_measurements && self.path.exists() && !holds_commands_alone(self.path) {
                    return Err(refused(format!("{name} is there and holds more than commands: it would be lost")));
                }
                Ok(())
            }
        }
    }

    fn ends_in(&self, ending: &str, what: &str) -> Result<(), Failure> {
        if self.path.extension().is_none_or(|extension| extension != ending) {
            return Err(refused(format!("{}: the name of {what} ends in .{ending}", self.path.display())));
        }
        let written = btr_io::can_write(self.path);
        written.map_err(|source| unwritable(&IoError::File { path: self.path.to_owned(), source }))
    }
}

/// Whether nothing would be lost with this file that a simulation or a robot has answered. What cannot be read may be
/// anything, and so may a column whose name says nothing.
fn holds_commands_alone(path: &Path) -> bool {
    btr_io::read_log(path, &Mapping::default())
        .is_ok_and(|(log, _)| log.channels().all(|(_, channel)| channel.role == Role::Command))
}

fn refused(message: String) -> Failure {
    Failure::new("output", message, Some("give the output another name".to_owned()))
}

/// Why a file cannot be written.
pub fn unwritable(error: &IoError) -> Failure {
    Failure::new("output", error.to_string(), Some(error.help()))
}

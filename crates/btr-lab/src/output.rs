//! Checks of a verb's outputs before it computes anything: the folder must exist, and only an earlier output of the
//! same kind may be overwritten. A recording is never overwritten.

use crate::experiment::Source;
use crate::failure::Failure;
use crate::model_text::named_files;
use btr_core::log::Role;
use btr_core::text::Mention;
use btr_io::{IoError, Mapping};
use std::path::{Path, PathBuf};

/// Begins model files that btr has written, so that a later output may replace them.
const MARK: &str = "# Written by btr: another output may replace this file.";
/// Begins the schema's line, which editors want first.
const SCHEMA: &str = "#:schema";

/// Kind of an output.
#[derive(Clone, Copy)]
pub enum OutputKind {
    /// A model's TOML.
    Model,
    /// The same with fitted values: it replaces no file that people have written.
    FittedModel,
    /// An HTML report.
    Report,
    /// The measured and a simulated robot, for viewers.
    Overlay,
    /// A log.
    Log(Overwrite),
    /// A file of another program, whose name ends in one of these.
    Foreign(&'static [&'static str]),
}

/// Which logs another one may overwrite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overwrite {
    /// Those that hold nothing but commands.
    Commands,
    /// All, measurements included.
    Measurements,
}

/// A file that a verb is to write.
pub struct OutputFile<'a> {
    /// The path.
    pub path: &'a Path,
    /// Its kind.
    pub kind: OutputKind,
}

impl OutputKind {
    /// This kind of output at a path, if one is given.
    pub fn at(self, path: Option<&Path>) -> Option<OutputFile<'_>> {
        path.map(|path| OutputFile { path, kind: self })
    }
}

/// Every file that a verb reads: the model, the files that it names, and `further`.
pub fn inputs(source: &Source, further: impl IntoIterator<Item = PathBuf>) -> Vec<PathBuf> {
    std::iter::once(source.path.clone()).chain(named_files(source)).chain(further).collect()
}

/// Rejects a log that cannot be written, or that would overwrite a log that it may not.
///
/// # Errors
/// See [`guard`].
pub fn may_write_log(path: &Path, overwrite: Overwrite) -> Result<(), Failure> {
    guard(OutputKind::Log(overwrite).at(Some(path)), [])
}

/// Rejects outputs that cannot be written or would overwrite other files.
///
/// # Errors
/// An output that is also an input under any name; an extension that does not match the kind; a log that would
/// overwrite measurements; a folder that does not exist or is not writable.
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
        if self.path.canonicalize().is_ok_and(|path| inputs.contains(&path)) {
            return Err(refused(format!("{name} is an input and would be overwritten")));
        }
        match self.kind {
            OutputKind::Model => self.ends_in(&["toml"], "a model"),
            OutputKind::FittedModel => {
                self.ends_in(&["toml"], "a model")?;
                match std::fs::read_to_string(self.path) {
                    Ok(text) if !is_by_btr(&text) => {
                        Err(refused(format!("{name} exists and was not written by btr: it would be lost")))
                    }
                    _ => Ok(()),
                }
            }
            OutputKind::Foreign(endings) => self.ends_in(endings, "the output"),
            OutputKind::Overlay => {
                self.ends_in(&["mcap"], "this output")?;
                if self.path.exists() && !btr_io::is_overlay(self.path) {
                    return Err(refused(format!("{name} exists and may be a recording, which would be lost")));
                }
                Ok(())
            }
            OutputKind::Report => self.ends_in(&["html"], "a report"),
            OutputKind::Log(overwrite) => {
                btr_io::can_write_log(self.path).map_err(|error| unwritable(&error))?;
                if overwrite == Overwrite::Commands && self.path.exists() && !holds_commands_alone(self.path) {
                    return Err(refused(format!("{name} exists and contains more than commands, which would be lost")));
                }
                Ok(())
            }
        }
    }

    fn ends_in(&self, endings: &[&str], what: &str) -> Result<(), Failure> {
        if !endings.iter().any(|ending| self.path.extension().is_some_and(|extension| extension == *ending)) {
            let endings = endings.join(" or .");
            return Err(refused(format!("{}: the name of {what} must end in .{endings}", self.path.display())));
        }
        let written = btr_io::can_write(self.path);
        written.map_err(|source| unwritable(&IoError::File { path: self.path.to_owned(), source }))
    }
}

/// Whether a file holds only commands, so that overwriting it loses no measurement. Files that cannot be read and
/// columns with unknown names count as measurements.
fn holds_commands_alone(path: &Path) -> bool {
    btr_io::read_log(path, &Mapping::default())
        .is_ok_and(|(log, _)| log.channels().all(|(_, channel)| channel.role == Role::Command))
}

fn refused(message: String) -> Failure {
    Failure::new("output", message, Some(Mention::OtherName.into()))
}

/// Why a file cannot be written.
pub fn unwritable(error: &IoError) -> Failure {
    Failure::new("output", error.to_string(), Some(error.help()))
}

/// The text of a model with the comment.
pub fn written_by_btr(text: &str) -> String {
    if is_by_btr(text) {
        return text.to_owned();
    }
    match text.split_once('\n') {
        Some((first, rest)) if first.starts_with(SCHEMA) => format!("{first}\n{MARK}\n{rest}"),
        _ => format!("{MARK}\n{text}"),
    }
}

/// Whether the text of a model has the comment.
pub fn is_by_btr(text: &str) -> bool {
    text.lines().take(2).any(|line| line == MARK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mark_comes_after_the_schema_and_only_once() {
        let model = "#:schema ../btr.schema.json\n# An arm.\nname = \"arm\"\n";
        let written = written_by_btr(model);
        assert_eq!(written, format!("#:schema ../btr.schema.json\n{MARK}\n# An arm.\nname = \"arm\"\n"));
        assert_eq!(written_by_btr(&written), written);
        assert!(is_by_btr(&written) && !is_by_btr(model) && !is_by_btr(&format!("\n\n{MARK}")));
        assert_eq!(written_by_btr("name = \"arm\"\n"), format!("{MARK}\nname = \"arm\"\n"));
    }
}

//! HTML reports: self-contained files that load nothing from the network.
//!
//! A report is a list of sections, and a section a list of blocks. Each verb has a function that returns the whole page
//! as text, for the command line and for Python. Above the plots it has a player, by a script; all else needs none.

mod candidates;
mod clues;
mod compare;
mod diagnose;
mod fit;
mod joints;
mod ladder;
mod page;
mod player;
mod run;
mod stages;
mod views;

pub use compare::compare;
pub use diagnose::diagnose;
pub use fit::fit;
pub(crate) use run::run;

use btr_io::IoError;
use std::io::Write;
use std::path::Path;

/// Writes a report, whole or not at all.
///
/// # Errors
/// [`IoError::File`] where the file cannot be written.
pub fn write(path: &Path, page: &str) -> Result<(), IoError> {
    let written = btr_io::write_whole(path, |out| out.write_all(page.as_bytes()));
    written.map_err(|source| IoError::File { path: path.to_owned(), source })
}

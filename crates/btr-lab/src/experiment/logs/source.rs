//! Where a log that is asked about comes from.

use btr_core::log::Log;
use std::path::{Path, PathBuf};

/// A log to read, or one that is in memory already.
#[derive(Clone, Debug)]
pub enum LogSource {
    /// A file.
    File(PathBuf),
    /// A log in btr's units, with a name of its own for reports; the model's `[channels]` are heeded where it has foreign names.
    Made {
        /// What it is called; no two logs may be called the same.
        name: PathBuf,
        /// What it holds.
        log: Log,
    },
}

impl LogSource {
    /// The file's path, or the log's name.
    pub fn path(&self) -> &Path {
        match self {
            LogSource::File(path) | LogSource::Made { name: path, .. } => path,
        }
    }
}

impl From<PathBuf> for LogSource {
    fn from(path: PathBuf) -> Self {
        LogSource::File(path)
    }
}

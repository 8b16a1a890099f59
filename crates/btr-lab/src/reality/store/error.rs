//! Errors of keeping real tests.

use btr_core::text::{Mention, Text};
use btr_io::IoError;
use std::path::{Path, PathBuf};

/// Why a real test could not be saved or read back.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// The underlying error.
        source: std::io::Error,
    },
    /// A log that cannot be read or written.
    #[error(transparent)]
    Log(#[from] btr_io::IoError),
    /// An incomplete log: it may still be being written.
    #[error("{}: {why}", path.display())]
    Half {
        /// The log.
        path: PathBuf,
        /// What is missing.
        why: String,
    },
    /// A file that is not as it was when the test was accepted.
    #[error("{}: it does not match its checksum in checksums.sfv, so it is damaged or was changed", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// A damaged record of a running program.
    #[error("{}: it is damaged; see that nothing of the test's program runs any more, then remove it", path.display())]
    Record {
        /// The file.
        path: PathBuf,
    },
    /// A log that is kept in another place than its own.
    #[error("{why}; the log is kept as {}: put it back as {}", aside.display(), path.display())]
    Aside {
        /// Why it is not in its place.
        why: String,
        /// Where it is.
        aside: PathBuf,
        /// Its place.
        path: PathBuf,
    },
    /// A folder with the result of another trial.
    #[error("{}", another_trial(path))]
    OtherTrial {
        /// The folder.
        path: PathBuf,
    },
}

impl StoreError {
    /// The error as a text.
    pub fn text(&self) -> Text {
        match self {
            StoreError::OtherTrial { path } => another_trial(path),
            other => other.to_string().into(),
        }
    }

    /// Whether a log may still be coming: another try may find all of it.
    pub(super) fn is_passing(&self) -> bool {
        match self {
            StoreError::Half { .. } => true,
            StoreError::Log(error) => !matches!(error, IoError::File { .. } | IoError::Damaged { .. }),
            StoreError::Io { .. }
            | StoreError::Damaged { .. }
            | StoreError::Record { .. }
            | StoreError::Aside { .. }
            | StoreError::OtherTrial { .. } => false,
        }
    }
}

fn another_trial(path: &Path) -> Text {
    let holds = format!("{} holds the result of another trial; start with an empty ", path.display());
    Text::from(holds) + Mention::Out
}

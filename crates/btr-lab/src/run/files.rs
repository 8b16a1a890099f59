//! The files of a run's folder: one process at a time writes them, each whole or not at all.

use super::lock::FolderLock;
use super::run_error::RunError;
use std::io::Write;
use std::path::{Path, PathBuf};

pub(super) const CHECKPOINT: &str = "checkpoint.bin";
pub(super) const EXPERIMENT: &str = "experiment.toml";

/// The stamp of the experiment that the run in this folder began with; empty if there is none.
pub(super) fn stamp_of(folder: &Path) -> String {
    std::fs::read_to_string(folder.join(EXPERIMENT)).unwrap_or_default()
}

/// Writes a file in a run's folder.
pub(super) fn write_in(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
    let path = folder.join(name);
    let written = btr_io::write_whole(&path, |file| file.write_all(bytes));
    written.map(|()| path.clone()).map_err(|source| RunError::Io { path, source })
}

/// The folder for this process alone, without what killed ones left half written.
pub(super) fn locked(folder: &Path) -> Result<FolderLock, RunError> {
    let lock = FolderLock::of(folder)?;
    sweep(folder)?;
    Ok(lock)
}

/// Removes the temporary files that killed runs left in the folder and in those of its real tests.
fn sweep(folder: &Path) -> Result<(), RunError> {
    let swept =
        |path: &Path| btr_io::sweep_temporary(path).map_err(|source| RunError::Io { path: path.to_owned(), source });
    swept(folder)?;
    let tests = std::fs::read_dir(folder.join("transfers")).into_iter().flatten().flatten();
    tests.map(|entry| entry.path()).filter(|path| path.is_dir()).try_for_each(|path| swept(&path))
}

pub(super) fn checkpoint_path(folder: &Path) -> PathBuf {
    folder.join(CHECKPOINT)
}

//! The lock of a run's folder: one process at a time works in it.

use super::run_error::RunError;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// The name of the locked file. It stays in the folder; the lock ends with the process that holds it, however that
/// ends.
const NAME: &str = ".lock";

/// A folder that no other process works in.
pub(super) struct FolderLock {
    file: File,
    path: PathBuf,
}

impl FolderLock {
    /// Locks the folder, which must be there.
    ///
    /// # Errors
    /// Another process that works in the folder; a failed write. A file system without locks is no error.
    pub(super) fn of(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(NAME);
        let opened = OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&path);
        let mut file = opened.map_err(|source| RunError::Io { path: path.clone(), source })?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut pid = String::new();
                // Some systems lock the content as well.
                let _ = file.read_to_string(&mut pid);
                return Err(RunError::InUse { folder: folder.to_owned(), pid: pid.trim().parse().ok() });
            }
            Err(TryLockError::Error(why)) if why.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(source)) => return Err(RunError::Io { path, source }),
        }
        // Only for the message to another process.
        let _ = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
        Ok(FolderLock { file, path })
    }

    /// Whether the folder is still where it was.
    pub(super) fn is_in_place(&self) -> bool {
        is_same(&self.file, &self.path)
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // Finished runs of the same file and seed have the same bytes.
        let _ = self.file.set_len(0);
    }
}

#[cfg(unix)]
fn is_same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (Ok(held), Ok(there)) = (file.metadata(), std::fs::metadata(path)) else { return false };
    (held.dev(), held.ino()) == (there.dev(), there.ino())
}

#[cfg(not(unix))]
fn is_same(_file: &File, path: &Path) -> bool {
    path.exists()
}

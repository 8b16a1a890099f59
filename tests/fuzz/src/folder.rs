//! A folder for the files of an input.

use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Temporary, and empty at its beginning; in memory where that is known.
pub(crate) struct Folder(TempDir);

impl Folder {
    /// A new folder.
    ///
    /// # Panics
    /// Where there can be none: nothing could be tried.
    #[allow(clippy::expect_used)]
    pub(crate) fn new() -> Self {
        let in_memory = Path::new("/dev/shm");
        let place = if in_memory.is_dir() { in_memory.to_owned() } else { std::env::temp_dir() };
        Folder(tempfile::tempdir_in(place).expect("a temporary folder"))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file, in folders below this one where its name has some.
    ///
    /// # Panics
    /// Where it cannot be written.
    #[allow(clippy::expect_used)]
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path().join(name);
        path.parent().map_or(Ok(()), std::fs::create_dir_all).expect("a folder for an input's files");
        std::fs::write(&path, bytes).expect("an input's file");
        path
    }
}

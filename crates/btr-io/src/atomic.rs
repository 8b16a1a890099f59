//! Atomic writes: a file is written whole or not at all.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// The ending of temporary files. No other program's are swept by it.
const SUFFIX: &str = ".btr.tmp";
/// Random characters in the name of a temporary file.
const RANDOM: usize = 6;

/// Writes a file through a temporary one in the same folder, which is synced to disk and then renamed. Readers of
/// `path` see the old content or the new one; a crash, a full disk or an error of `write` leaves the old one.
///
/// # Errors
/// Errors of the operating system and of `write`; a `path` that is not a regular file (a device, a folder).
pub fn write_whole(path: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> io::Result<()> {
    let target = target(path)?;
    let temporary = create_beside(&target)?;
    let mut writer = BufWriter::new(temporary.as_file());
    write(&mut writer)?;
    writer.flush()?;
    drop(writer);
    temporary.as_file().sync_all()?;
    temporary.persist(&target).map_err(|e| e.error)?;
    sync_folder(&target)
}

/// Checks that [`write_whole`] could write the file: creates a temporary one in the folder and removes it.
///
/// # Errors
/// See [`write_whole`].
pub fn can_write(path: &Path) -> io::Result<()> {
    create_beside(&target(path)?)?.close()
}

/// Creates a folder, if there is none, in one that must be there. (`create_dir_all` would also create that one anew if
/// somebody had just moved it away.)
///
/// # Errors
/// Errors of the operating system: a folder above that is gone, a file in its place.
pub fn create_dir(path: &Path) -> io::Result<()> {
    match fs::create_dir(path) {
        Err(why) if why.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
        created => created,
    }
}

/// Removes what killed processes left of [`write_whole`] in a folder: its temporary files. Nobody may be writing there.
///
/// # Errors
/// A folder that cannot be read, a file that cannot be removed.
pub fn sweep_temporary(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if is_temporary(&entry.file_name().to_string_lossy()) && entry.file_type()?.is_file() {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Whether [`create_beside`] names its files so: `.log.csv.Ab3dEf.btr.tmp`.
fn is_temporary(name: &str) -> bool {
    let inner = name.strip_prefix('.').and_then(|name| name.strip_suffix(SUFFIX));
    let parts = inner.and_then(|inner| inner.rsplit_once('.'));
    parts.is_some_and(|(name, random)| {
        !name.is_empty() && random.len() == RANDOM && random.chars().all(|c| c.is_ascii_alphanumeric())
    })
}

/// The file to replace. Links are followed, so that a link stays a link.
fn target(path: &Path) -> io::Result<PathBuf> {
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if fs::metadata(&target).is_ok_and(|m| !m.is_file()) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file, so it cannot be replaced whole"));
    }
    Ok(target)
}

/// A temporary file in the target's folder, removed when dropped. Opened here rather than by `tempfile`, whose files
/// are readable by their owner alone: the result gets the mode of the umask.
fn create_beside(target: &Path) -> io::Result<NamedTempFile> {
    let name = target.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    let prefix = [OsStr::new("."), name, OsStr::new(".")].join(OsStr::new(""));
    let create = |path: &Path| OpenOptions::new().write(true).create_new(true).open(path);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM).make_in(folder(target), create)
}

/// The folder of a file; `.` for a bare name.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Syncs the folder: without that, the rename may not survive a power cut.
#[cfg(unix)]
fn sync_folder(target: &Path) -> io::Result<()> {
    File::open(folder(target))?.sync_all()
}

#[cfg(not(unix))]
fn sync_folder(_target: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn an_error_leaves_the_old_content_and_no_litter() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        write_whole(&path, |w| w.write_all(b"old")).unwrap();
        let error = write_whole(&path, |w| {
            w.write_all(b"half of the n")?;
            Err(io::Error::other("disk full"))
        });
        assert_eq!(error.unwrap_err().to_string(), "disk full");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_temporary_files_are_swept() {
        let folder = tempfile::tempdir().unwrap();
        let kept =
            [".hidden.btr.tmp", "log.csv.Ab3dEf.btr.tmp", ".log.csv.Ab3d.btr.tmp", ".log.csv.Ab3dEf.tmp", "log.csv"];
        kept.iter().for_each(|name| fs::write(folder.path().join(name), b"").unwrap());
        let (_, killed) = create_beside(&folder.path().join("log.csv")).unwrap().keep().unwrap();
        assert!(killed.is_file());
        sweep_temporary(folder.path()).unwrap();
        assert!(!killed.exists() && kept.iter().all(|name| folder.path().join(name).exists()));
    }

    #[test]
    fn new_content_replaces_old() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        write_whole(&path, |w| w.write_all(b"a long old text")).unwrap();
        write_whole(&path, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn devices_and_folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_whole(folder.path(), |w| w.write_all(b"x")).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        assert_eq!(can_write(folder.path()).unwrap_err().kind(), io::ErrorKind::InvalidInput);
    }

    #[test]
    fn checking_whether_a_file_can_be_written_leaves_no_trace() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        can_write(&path).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(can_write(&folder.path().join("no/log.csv")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn files_have_the_mode_of_the_umask() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (usual, whole) = (folder.path().join("usual"), folder.path().join("whole"));
        fs::write(&usual, "x").unwrap();
        write_whole(&whole, |w| w.write_all(b"x")).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&whole), mode(&usual));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_whole(&link, |w| w.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
    }
}

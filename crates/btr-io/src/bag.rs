//! ROS 2 bags: folders with a `metadata.yaml` and the recorded files.

use super::error::IoError;
use std::path::{Path, PathBuf};

/// The MCAP file of a bag if `path` is a bag's folder, else `path` itself.
///
/// # Errors
/// [`IoError::Db3`] and [`IoError::SplitBag`], for bags that are not one MCAP file.
pub(crate) fn file(path: &Path) -> Result<PathBuf, IoError> {
    if !path.join("metadata.yaml").is_file() {
        return Ok(path.to_owned());
    }
    let entries = path.read_dir().map_err(|source| IoError::File { path: path.to_owned(), source })?;
    let files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    let ending = |ending: &str| files.iter().filter(|file| file.extension().is_some_and(|e| e == ending)).collect();
    let (mcaps, databases): (Vec<&PathBuf>, Vec<&PathBuf>) = (ending("mcap"), ending("db3"));
    match (mcaps.as_slice(), databases.as_slice()) {
        ([only], []) => Ok(PathBuf::from(only)),
        (_, [database, ..]) => Err(IoError::Db3 { path: PathBuf::from(database) }),
        (several, []) => Err(IoError::SplitBag { path: path.to_owned(), files: several.len() }),
    }
}

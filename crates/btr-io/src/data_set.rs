//! Paths of LeRobot data sets: `FOLDER` or `FOLDER#3`.

use std::path::{Path, PathBuf};

/// The folder of the data set that a path names, and the episode after `#`. `None` where there is no data set.
pub(crate) fn place(path: &Path) -> Option<(PathBuf, Option<String>)> {
    let is_set = |folder: &Path| folder.join("meta/info.json").is_file();
    if is_set(path) {
        return Some((path.to_owned(), None));
    }
    let (folder, episode) = path.to_str()?.rsplit_once('#')?;
    is_set(Path::new(folder)).then(|| (PathBuf::from(folder), Some(episode.to_owned())))
}

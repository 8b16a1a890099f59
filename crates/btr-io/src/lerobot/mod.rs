//! Episodes of LeRobot data sets: folders with `meta/info.json`, and in `data/` Parquet files of one row per frame, one
//! file per episode (format v2) or several episodes in a file (v3). Source: huggingface/lerobot,
//! `src/lerobot/datasets`.
//!
//! Data sets do not specify the units of joints. Values are read unchanged; a model's `[channels]` can scale them.

mod names;
mod table;

use super::data_set::place;
use super::error::{IoError, Warning};
use super::regular::read_text;
use crate::channels::mapping::Mapping;
use crate::channels::series::assemble;
use btr_core::log::Log;
use indexmap::IndexMap;
use names::{COLUMNS, channels};
use serde::Deserialize;
use serde_json::Value;
use std::fs;
use std::path::{Component, Path, PathBuf};
use table::episode_in;

/// One episode of a data set.
pub(crate) struct Episode {
    /// The given path, for messages.
    path: PathBuf,
    folder: PathBuf,
    info: Info,
    index: usize,
}

/// The content of `meta/info.json`.
#[derive(Deserialize)]
struct Info {
    codebase_version: String,
    total_episodes: usize,
    /// Files per folder; format v2 only.
    #[serde(default = "usual_chunk")]
    chunks_size: usize,
    /// A pattern in Python's format language.
    data_path: String,
    features: IndexMap<String, Feature>,
}

#[derive(Deserialize)]
struct Feature {
    #[serde(default)]
    names: Value,
}

fn usual_chunk() -> usize {
    1000
}

/// The path of the first episode of a data set, and how many it has; `None` where there is no data set, or an episode
/// is named.
///
/// # Errors
/// A malformed data set.
pub(crate) fn first_episode(path: &Path) -> Result<Option<(PathBuf, usize)>, IoError> {
    let Some((folder, None)) = place(path) else { return Ok(None) };
    let episodes = Info::read(&folder.join("meta/info.json"))?.total_episodes;
    let first = PathBuf::from(format!("{}#0", folder.display()));
    Ok(Some((first, episodes)))
}

impl Episode {
    /// The episode at a path: `FOLDER#3`, or the folder of a data set with one episode. `None` where there is no data
    /// set.
    ///
    /// # Errors
    /// A missing or unknown episode number; a malformed data set.
    pub(crate) fn at(path: &Path) -> Result<Option<Self>, IoError> {
        let Some((folder, requested)) = place(path) else { return Ok(None) };
        let info = Info::read(&folder.join("meta/info.json"))?;
        let episodes = info.total_episodes;
        let index = match &requested {
            Some(text) => text.parse().ok(),
            None => (episodes == 1).then_some(0),
        };
        let unknown = || IoError::Episode { path: folder.clone(), wanted: requested, episodes };
        let index = index.filter(|index| *index < episodes).ok_or_else(unknown)?;
        Ok(Some(Episode { path: path.to_owned(), folder, info, index }))
    }

    /// The episode as a log: `action` as `cmd_<joint>`, `observation.state` as `q_<joint>`, on the clock `timestamp`.
    pub(crate) fn read(&self, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
        let known: Vec<&str> = COLUMNS.into_iter().filter(|column| self.info.features.contains_key(*column)).collect();
        let requested = [&["timestamp"], known.as_slice()].concat();
        let mut columns = self.columns(&requested)?.into_iter();
        let clock_s = columns.next().and_then(|mut column| column.pop()).unwrap_or_default();
        let mut series = Vec::new();
        for (column, values) in known.into_iter().zip(columns) {
            let names = channels(column, &self.info.features[column].names, values.len());
            series.extend(names.into_iter().zip(values).map(|(name, values)| mapping.series(name, values)));
        }
        assemble(&self.path, clock_s, series, mapping)
    }

    /// The columns of some names, each as a series per number that a frame has.
    fn columns(&self, requested: &[&str]) -> Result<Vec<Vec<Vec<f64>>>, IoError> {
        let files = self.files()?;
        for file in &files {
            if let Some(columns) = episode_in(file, self.index, requested)? {
                return Ok(columns);
            }
        }
        let what = format!("no frame of episode {} in the data", self.index);
        let path = if let [only] = files.as_slice() { only.clone() } else { self.folder.join("data") };
        Err(IoError::DataSet { path, what })
    }

    /// Files that may hold the episode's frames. Format v3 also names the file in `meta/episodes`, but not always
    /// correctly; the statistics in the files are reliable.
    fn files(&self) -> Result<Vec<PathBuf>, IoError> {
        if self.info.codebase_version.starts_with("v2.") {
            return Ok(vec![self.folder.join(self.info.data_file(self.index))]);
        }
        let mut files = Vec::new();
        for chunk in entries(&self.folder.join("data"))? {
            if chunk.is_dir() {
                files.extend(
                    entries(&chunk)?.into_iter().filter(|file| file.extension().is_some_and(|e| e == "parquet")),
                );
            }
        }
        Ok(files)
    }
}

/// The entries of a folder, sorted by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let unread = |source| IoError::File { path: folder.to_owned(), source };
    let mut entries: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder).map_err(unread)? {
        entries.push(entry.map_err(unread)?.path());
    }
    entries.sort();
    Ok(entries)
}

impl Info {
    fn read(path: &Path) -> Result<Self, IoError> {
        let text = read_text(path).map_err(|source| IoError::File { path: path.to_owned(), source })?;
        let odd = |what: String| IoError::DataSet { path: path.to_owned(), what };
        let info: Info = serde_json::from_str(&text).map_err(|e| odd(e.to_string()))?;
        let version = info.codebase_version.as_str();
        if !version.starts_with("v2.") && !version.starts_with("v3.") {
            return Err(odd(format!("a data set in format {version}")));
        }
        if !Path::new(&info.data_path).components().all(|part| matches!(part, Component::Normal(_))) {
            return Err(odd(format!("the data path {:?} leads out of the data set", info.data_path)));
        }
        Ok(info)
    }

    /// The file of an episode in format v2, below the data set's folder.
    fn data_file(&self, episode: usize) -> String {
        let chunk = episode / self.chunks_size.max(1);
        let numbers = [("episode_chunk", chunk), ("episode_index", episode), ("total_episodes", self.total_episodes)];
        numbers.into_iter().fold(self.data_path.clone(), |text, (key, number)| filled(&text, key, number))
    }
}

/// Maximum width of a number in a file name.
const WIDEST: usize = 32;

/// Replaces `{key}` and `{key:06d}` in a pattern by a number.
fn filled(pattern: &str, key: &str, number: usize) -> String {
    let opening = format!("{{{key}");
    let mut parts = pattern.split(&opening);
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (form, rest) = part.split_once('}').unwrap_or((part, ""));
        let width = form.trim_start_matches(':').trim_end_matches('d').parse().unwrap_or(0).min(WIDEST);
        text += &format!("{number:0width$}{rest}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_those_of_python() {
        let text = "data/chunk-{episode_chunk:03d}/train-{episode_index:05d}-of-{n}-{episode_index}.parquet";
        let text = filled(&filled(text, "episode_chunk", 2), "episode_index", 2417);
        assert_eq!(text, "data/chunk-002/train-02417-of-{n}-2417.parquet");
    }
}

//! A model file bundled with the files that it names, for use on another machine.

use super::error::DistributedError;
use crate::experiment::Source;
use crate::model_text::each_named_file;
use btr_physics::effects::Laws;
use serde::{Deserialize, Serialize};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Component, Path, PathBuf};
use toml_edit::DocumentMut;

/// A model file's text with its files; in the text they have their names in the bundle.
#[derive(Serialize, Deserialize)]
pub(super) struct Bundle {
    name: PathBuf,
    text: String,
    files: Vec<(String, Vec<u8>)>,
    /// The functions that its laws name, packed by the executor.
    functions: Vec<u8>,
}

/// Unpacks the functions of laws.
pub(super) type Functions<'a> = &'a dyn Fn(&[u8]) -> Result<Laws, DistributedError>;

/// Whether the logs of `[reality]` go into the bundle.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum RecordedLogs {
    Include,
    Omit,
}

impl Bundle {
    /// Packs a model file, with or without the logs of its `[reality]`. What names further files (an index of logs, a
    /// folder, a data set's episode) is referred to by its absolute path.
    pub(super) fn pack(source: &Source, logs: RecordedLogs, functions: &[u8]) -> Result<Self, DistributedError> {
        let mut document = source.text.parse::<DocumentMut>()?;
        if let Some(reality) =
            document.get_mut("reality").filter(|_| logs == RecordedLogs::Omit).and_then(|r| r.as_table_like_mut())
        {
            for key in ["files", "held_out"] {
                reality.remove(key);
            }
        }
        let mut files = Vec::new();
        let mut failed = None;
        each_named_file(&mut document, |key, value| {
            let Some(path) = value.as_str().map(|path| source.folder().join(path)) else { return };
            let episode = path.to_string_lossy().contains('#') && !path.is_file();
            if key == "index" || key == "package_paths" || episode || path.is_dir() {
                *value = std::path::absolute(&path).unwrap_or(path).to_string_lossy().into_owned().into();
                return;
            }
            match std::fs::read(&path) {
                Ok(bytes) => {
                    let file_name = path.file_name().unwrap_or_default().to_string_lossy();
                    // Files in different folders may have the same name.
                    let name = format!("{}/{file_name}", files.len());
                    *value = name.as_str().into();
                    files.push((name, bytes));
                }
                Err(source) => failed = Some(DistributedError::File { path, source }),
            }
        });
        let name = PathBuf::from(source.path.file_name().unwrap_or("model.toml".as_ref()));
        let functions = functions.to_vec();
        failed.map_or(Ok(Bundle { name, text: document.to_string(), files, functions }), Err)
    }

    /// Writes the files into a temporary folder while `open` runs.
    pub(super) fn unpacked<T>(
        &self,
        functions: Functions,
        open: impl FnOnce(Source) -> Result<T, DistributedError>,
    ) -> Result<T, DistributedError> {
        let laws = if self.functions.is_empty() { Laws::default() } else { functions(&self.functions)? };
        // A random name: machines that share a temporary folder may use the same process numbers.
        let folder = std::env::temp_dir().join(format!("btr-{:016x}", RandomState::new().build_hasher().finish()));
        let opened =
            self.write_files(&folder).map_err(|source| DistributedError::File { path: folder.clone(), source });
        let opened = opened.and_then(|()| open(Source { laws, ..Source::new(folder.join(&self.name), &self.text) }));
        // A folder that cannot be removed is left to the cleaning of temporary folders.
        let _ = std::fs::remove_dir_all(&folder);
        opened
    }

    fn write_files(&self, folder: &Path) -> std::io::Result<()> {
        if let Some((name, _)) = self.files.iter().find(|(name, _)| !stays_inside(Path::new(name))) {
            let what = format!("a bundle names `{}`, which is outside of its folder", name.escape_debug());
            return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, what));
        }
        std::fs::create_dir(folder)?;
        for (name, bytes) in &self.files {
            let path = folder.join(name);
            path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            std::fs::write(path, bytes)?;
        }
        Ok(())
    }
}

/// Whether a relative name leads to a file in the folder to which it is relative: a payload comes from another machine.
fn stays_inside(name: &Path) -> bool {
    name.file_name().is_some() && name.components().all(|part| matches!(part, Component::Normal(_)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_bundle_writes_into_its_own_folder_alone() {
        let outside = tempfile::tempdir().unwrap();
        let victim = outside.path().join("victim");
        let up = format!("../{}/victim", outside.path().file_name().unwrap().to_str().unwrap());
        let holding = |name: &str, content: &[u8]| {
            let files = vec![(name.to_owned(), content.to_vec())];
            Bundle { name: "model.toml".into(), text: String::new(), files, functions: Vec::new() }
        };
        for name in [victim.to_str().unwrap(), &up, "0/../../x", "", "."] {
            let bundle = holding(name, b"overwritten");
            let opened = bundle.unpacked(&|_| Ok(Laws::default()), |_| Ok(()));
            assert!(opened.unwrap_err().to_string().contains("outside of its folder"), "{name}");
        }
        assert!(!victim.exists());
        let bundle = holding("0/arm.urdf", b"robot");
        let read = |source: Source| Ok(std::fs::read(source.folder().join("0/arm.urdf")).unwrap());
        assert_eq!(bundle.unpacked(&|_| Ok(Laws::default()), read).unwrap(), b"robot");
    }
}

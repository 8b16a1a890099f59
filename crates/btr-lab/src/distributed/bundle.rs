//! A model file with the files that it names, to be opened elsewhere.

use crate::experiment::Source;
use crate::experiment::adapt::each_named_file;
use btr_physics::effects::Laws;
use serde::{Deserialize, Serialize};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};
use toml_edit::DocumentMut;

/// A model file's text, in which the files that it names have names of the folder's own.
#[derive(Serialize, Deserialize)]
pub(super) struct Folder {
    name: PathBuf,
    text: String,
    files: Vec<(String, Vec<u8>)>,
    /// The functions that its laws name, as an executor packed them.
    functions: Vec<u8>,
}

/// Makes laws of packed functions.
pub(super) type Functions<'a> = &'a dyn Fn(&[u8]) -> Result<Laws, String>;

impl Folder {
    /// Packs a model file, with the logs of its `[reality]` if they are wanted. What names further files (an index of logs, a
    /// folder, a data set's episode) stays where it is, by its absolute path.
    pub(super) fn pack(source: &Source, with_logs: bool, functions: &[u8]) -> Result<Self, String> {
        let mut document = source.text.parse::<DocumentMut>().map_err(|e| e.to_string())?;
        if let Some(reality) = document.get_mut("reality").filter(|_| !with_logs).and_then(|r| r.as_table_like_mut()) {
            for key in ["files", "held_out"] {
                reality.remove(key);
            }
        }
        let mut files = Vec::new();
        let mut failed = None;
        each_named_file(&mut document, |key, value| {
            let Some(path) = value.as_str().map(|path| source.folder().join(path)) else { return };
            let episode = path.to_string_lossy().contains('#') && !path.is_file();
            if key == "index" || episode || path.is_dir() {
                *value = std::path::absolute(&path).unwrap_or(path).to_string_lossy().into_owned().into();
                return;
            }
            match std::fs::read(&path) {
                Ok(bytes) => {
                    let own = path.file_name().unwrap_or_default().to_string_lossy();
                    // Files of one name may lie in several folders.
                    let name = format!("{}/{own}", files.len());
                    *value = name.as_str().into();
                    files.push((name, bytes));
                }
                Err(e) => failed = Some(format!("{}: {e}", path.display())),
            }
        });
        let name = PathBuf::from(source.path.file_name().unwrap_or("model.toml".as_ref()));
        let functions = functions.to_vec();
        failed.map_or(Ok(Folder { name, text: document.to_string(), files, functions }), Err)
    }

    /// Lays the files out for as long as `open` takes.
    pub(super) fn unpacked<T>(
        &self,
        functions: Functions,
        open: impl FnOnce(Source) -> Result<T, String>,
    ) -> Result<T, String> {
        let laws = if self.functions.is_empty() { Laws::default() } else { functions(&self.functions)? };
        // Nobody else's: who shares a temporary folder may share process numbers, too.
        let folder = std::env::temp_dir().join(format!("btr-{:016x}", RandomState::new().build_hasher().finish()));
        let opened = self.lay_out(&folder).map_err(|e| format!("{}: {e}", folder.display()));
        let opened = opened.and_then(|()| open(Source { laws, ..Source::new(folder.join(&self.name), &self.text) }));
        // What cannot be removed is left to who cleans temporary folders.
        let _ = std::fs::remove_dir_all(&folder);
        opened
    }

    fn lay_out(&self, folder: &Path) -> std::io::Result<()> {
        std::fs::create_dir(folder)?;
        for (name, bytes) in &self.files {
            let path = folder.join(name);
            path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            std::fs::write(path, bytes)?;
        }
        Ok(())
    }
}

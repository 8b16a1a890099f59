//! A model file with the files that it names, to be opened elsewhere.

use crate::adapt::each_named_file;
use crate::experiment::Source;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use toml_edit::DocumentMut;

/// A model file's text, in which the files that it names have names of the folder's own.
#[derive(Serialize, Deserialize)]
pub(super) struct Folder {
    name: PathBuf,
    text: String,
    files: Vec<(String, Vec<u8>)>,
}

impl Folder {
    /// Packs a model file. An index of logs stays where it is, by its absolute path: it names further files.
    pub(super) fn pack(source: &Source) -> Result<Self, String> {
        let mut document = source.text.parse::<DocumentMut>().map_err(|e| e.to_string())?;
        let mut files = Vec::new();
        let mut failed = None;
        each_named_file(&mut document, |(_, key), value| {
            let Some(path) = value.as_str().map(|path| source.folder().join(path)) else { return };
            if key == "index" {
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
        failed.map_or(Ok(Folder { name, text: document.to_string(), files }), Err)
    }

    /// Lays the files out for as long as `open` takes.
    pub(super) fn unpacked<T>(&self, open: impl FnOnce(Source) -> Result<T, String>) -> Result<T, String> {
        static OPENED: AtomicUsize = AtomicUsize::new(0);
        let number = OPENED.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("btr-{}-{number}", std::process::id()));
        let opened = self.lay_out(&folder).map_err(|e| format!("{}: {e}", folder.display()));
        let opened = opened.and_then(|()| open(Source::new(folder.join(&self.name), &self.text)));
        // What cannot be removed is left to who cleans temporary folders.
        let _ = std::fs::remove_dir_all(&folder);
        opened
    }

    fn lay_out(&self, folder: &Path) -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        for (name, bytes) in &self.files {
            let path = folder.join(name);
            path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            std::fs::write(path, bytes)?;
        }
        Ok(())
    }
}

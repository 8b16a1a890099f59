//! The record of a running program, `running.toml` in the folder of its test: a run that is resumed after it was killed
//! finds the program by it.

use super::group::{Group, listed};
use super::system;
use crate::reality::store::{StoreError, write_text};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A program that was started for a test and is not known to have ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::reality) struct Record {
    /// Name of the try, for instance `try-1`.
    pub name: String,
    /// Its group; none if the run was killed as it started the program.
    pub group: Option<Group>,
}

impl Record {
    /// The record in a folder.
    pub(in crate::reality) fn read(folder: &Path) -> Result<Option<Self>, StoreError> {
        let path = path_in(folder);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(why) if why.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(StoreError::Io { path, source }),
        };
        let (line, record) = text.split_once('\n').unwrap_or_default();
        let record = if line == checksum_line(record) { toml::from_str(record).ok() } else { None };
        record.map(Some).ok_or(StoreError::Record { path })
    }

    /// Writes the record.
    pub(in crate::reality) fn write(&self, folder: &Path) -> Result<(), StoreError> {
        let path = path_in(folder);
        let text = match toml::to_string(self) {
            Ok(text) => text,
            Err(why) => return Err(StoreError::Io { path, source: std::io::Error::other(why) }),
        };
        write_text(&path, &format!("{}\n{text}", checksum_line(&text)))
    }

    /// Removes the record, once nothing of the program is left.
    pub(in crate::reality) fn remove(folder: &Path) -> Result<(), StoreError> {
        let path = path_in(folder);
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(StoreError::Io { path, source }),
            _ => Ok(()),
        }
    }

    /// How long ago the program was started.
    pub(in crate::reality) fn age(folder: &Path) -> Duration {
        let written = std::fs::metadata(path_in(folder)).and_then(|meta| meta.modified());
        written.ok().and_then(|written| written.elapsed().ok()).unwrap_or_default()
    }

    /// What still lives of the program, or writes to one of its outputs, and how to end it; none if nothing does.
    pub(in crate::reality) fn living(&self, outputs: &[PathBuf]) -> Option<String> {
        let living = self.group.as_ref().map(Group::living).unwrap_or_default();
        if let Some(group) = self.group.as_ref().filter(|_| !living.is_empty()) {
            let by = if group.began.is_some() { "" } else { ", recognised by its number alone" };
            return Some(format!("{}{by} ({} ends it)", listed(&living), how_to_end(group.pid)));
        }
        let output = outputs.iter().find(|output| system::has_heirs(output))?;
        Some(format!("a process that writes to {0} (`fuser -k {0}` ends it)", output.display()))
    }
}

/// The line above the record: a damaged one must not lead to another process, or to none.
fn checksum_line(record: &str) -> String {
    format!("# The program of this test, while it runs; CRC-32 {:08X}", crc32fast::hash(record.as_bytes()))
}

fn how_to_end(pid: u32) -> String {
    if cfg!(unix) { format!("`kill -- -{pid}`") } else { format!("`taskkill /T /F /PID {pid}`") }
}

fn path_in(folder: &Path) -> PathBuf {
    folder.join("running.toml")
}

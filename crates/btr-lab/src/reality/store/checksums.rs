//! `checksums.sfv` in a real test's folder: the CRC-32 of its files as they were when the test was accepted, in the
//! format that `cksfv -f` and `rhash -c` check.

use super::error::StoreError;
use super::files::write_text;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

const NAME: &str = "checksums.sfv";
/// The files of a test that a run reads again, and those that say what was asked.
const FILES: [&str; 5] = ["trial.toml", "references.csv", "log.mcap", "log.csv", "failed.txt"];

/// Records the files in a test's folder.
pub(in crate::reality) fn record(folder: &Path) -> Result<(), StoreError> {
    write_text(&folder.join(NAME), &lines(folder)?.concat())
}

/// Checks that the files are those that were recorded. False if none were: the test was not accepted yet.
///
/// # Errors
/// [`StoreError::Damaged`] names a file that has changed, is gone or was added.
pub(in crate::reality) fn check(folder: &Path) -> Result<bool, StoreError> {
    let path = folder.join(NAME);
    let recorded = match fs::read(&path) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(why) if why.kind() == ErrorKind::NotFound => return Ok(false),
        Err(source) => return Err(StoreError::Io { path, source }),
    };
    let present = lines(folder)?;
    if recorded == present.concat() {
        return Ok(true);
    }
    let of = |name: &str, lines: &[String]| lines.iter().find(|line| line.starts_with(&format!("{name} "))).cloned();
    let recorded: Vec<String> = recorded.split_inclusive('\n').map(str::to_owned).collect();
    let changed = FILES.into_iter().find(|name| of(name, &recorded) != of(name, &present));
    Err(StoreError::Damaged { path: folder.join(changed.unwrap_or(NAME)) })
}

/// A line for each file that is there.
fn lines(folder: &Path) -> Result<Vec<String>, StoreError> {
    let line = |name: &str| {
        let path = folder.join(name);
        match fs::read(&path) {
            Ok(bytes) => Some(Ok(format!("{name} {:08X}\n", crc32fast::hash(&bytes)))),
            Err(why) if why.kind() == ErrorKind::NotFound => None,
            Err(source) => Some(Err(StoreError::Io { path, source })),
        }
    };
    FILES.into_iter().filter_map(line).collect()
}

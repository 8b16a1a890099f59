//! Single files of a real test.

use super::error::StoreError;
use std::io::Write;
use std::path::Path;

/// Writes a text, whole or not at all.
pub(in crate::reality) fn write_text(path: &Path, text: &str) -> Result<(), StoreError> {
    btr_io::write_whole(path, |file| file.write_all(text.as_bytes()))
        .map_err(|source| StoreError::Io { path: path.to_owned(), source })
}

/// Whether a CSV file ends within a line: a truncated number would still parse.
pub(super) fn is_open_ended(path: &Path) -> bool {
    let is_csv = path.extension().is_some_and(|ending| ending == "csv");
    is_csv && std::fs::read(path).is_ok_and(|bytes| bytes.last() != Some(&b'\n'))
}

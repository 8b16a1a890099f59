//! Opens files that are read: regular ones alone, as a pipe or a device may never end.

use btr_core::limits::LONGEST_TEXT;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// Opens a regular file, under any name that links to it.
///
/// # Errors
/// A file that does not exist; a folder, a pipe or a device.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let kind = fs::metadata(path)?;
    if kind.is_dir() {
        return Err(io::Error::new(ErrorKind::IsADirectory, "a folder, where a file is read"));
    }
    if !kind.is_file() {
        let what = "a pipe or a device, where a regular file is read; save its data to a file first";
        return Err(io::Error::new(ErrorKind::InvalidInput, what));
    }
    File::open(path)
}

/// Reads a text file as a whole.
///
/// # Errors
/// A file that does not exist, is no regular file, is no UTF-8, or is longer than [`LONGEST_TEXT`].
pub fn read_text(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    open(path)?.take(LONGEST_TEXT + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST_TEXT {
        let what = format!("larger than {} MB, the most that is read", LONGEST_TEXT >> 20);
        return Err(io::Error::new(ErrorKind::FileTooLarge, what));
    }
    Ok(text)
}

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
    check_no_stream(path)?;
    if fs::metadata(path)?.is_dir() {
        return Err(io::Error::new(ErrorKind::IsADirectory, "a folder, where a file is read"));
    }
    File::open(path)
}

/// Refuses a pipe and a device, whatever its name ends in: that of a shell (`<(...)`) ends in a number.
///
/// # Errors
/// What is there and is neither a file nor a folder.
pub(crate) fn check_no_stream(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(kind) if !kind.is_file() && !kind.is_dir() => {
            Err(io::Error::new(ErrorKind::InvalidInput, "a pipe or a device, where a regular file is read"))
        }
        _ => Ok(()),
    }
}

/// Reads a text file as a whole.
///
/// # Errors
/// A file that does not exist, is no regular file, is no UTF-8, or is longer than [`LONGEST_TEXT`].
pub fn read_text(path: &Path) -> io::Result<String> {
    read_text_from(open(path)?)
}

/// Reads a file of at most so many bytes as a whole.
///
/// # Errors
/// A file that does not exist, is no regular file, or is larger.
pub fn read_bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let bytes = read_beginning(path, most + 1)?;
    if bytes.len() as u64 > most {
        let what = format!("larger than {} MB, the most that is read", most >> 20);
        return Err(io::Error::new(ErrorKind::FileTooLarge, what));
    }
    Ok(bytes)
}

/// Reads at most so many bytes from the beginning of a file.
///
/// # Errors
/// A file that does not exist or is no regular file.
pub fn read_beginning(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a text as a whole, from where it comes.
///
/// # Errors
/// A text that is no UTF-8, or is longer than [`LONGEST_TEXT`].
pub fn read_text_from(bytes: impl Read) -> io::Result<String> {
    let mut text = String::new();
    bytes.take(LONGEST_TEXT + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST_TEXT {
        let what = format!("larger than {} MB, the most that is read", LONGEST_TEXT >> 20);
        return Err(io::Error::new(ErrorKind::FileTooLarge, what));
    }
    Ok(text)
}

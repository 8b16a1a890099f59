//! Bounds what a program prints: the end of it is kept. A file and not a pipe, which would break a program that goes on
//! after its run was killed.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Size that is kept, in bytes.
const KEPT: u64 = 1 << 20;
/// Size at which a growing file is cut, in bytes.
const MOST: u64 = 4 * KEPT;
const MARK: &[u8] = b"[btr keeps the last 1 MB of this]\n";

/// Cuts a file that has become large while its program runs. What is printed within that moment is lost.
pub(super) fn bound(path: &Path) -> io::Result<()> {
    if std::fs::metadata(path)?.len() > MOST { cut(path) } else { Ok(()) }
}

/// Cuts a file to its last megabyte. Its program appends to it.
pub(super) fn cut(path: &Path) -> io::Result<()> {
    let mut file = File::open(path)?;
    let size = file.metadata()?.len();
    if size <= KEPT + MARK.len() as u64 {
        return Ok(());
    }
    let mut tail = MARK.to_vec();
    file.seek(SeekFrom::Start(size - KEPT))?;
    file.take(KEPT).read_to_end(&mut tail)?;
    OpenOptions::new().write(true).open(path)?.set_len(0)?;
    OpenOptions::new().append(true).open(path)?.write_all(&tail)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_end_is_kept_and_the_program_goes_on_appending() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("try-1.out");
        let mut program = OpenOptions::new().create(true).append(true).open(&path).unwrap();
        let line = |k: usize| format!("line {k:09}\n");
        // 15 bytes a line: not too large yet.
        (0..MOST as usize / 15).for_each(|k| program.write_all(line(k).as_bytes()).unwrap());
        bound(&path).unwrap();
        assert!(std::fs::metadata(&path).unwrap().len() > MOST - 15);
        (0..200_000).for_each(|k| program.write_all(line(k).as_bytes()).unwrap());
        bound(&path).unwrap();
        program.write_all(b"the last line\n").unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.len() as u64 <= KEPT + 100 && text.starts_with("[btr keeps the last 1 MB of this]\n"));
        assert!(text.ends_with("line 000199999\nthe last line\n"));
        cut(&path).unwrap();
        assert!(std::fs::metadata(&path).unwrap().len() <= KEPT + MARK.len() as u64);
    }
}

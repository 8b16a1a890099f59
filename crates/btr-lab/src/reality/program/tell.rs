//! What cannot wait for the end of the test.

use std::io::{IsTerminal, Write};

/// Writes a line to stderr at once.
pub(in crate::reality) fn tell(line: &str) {
    let mut stderr = std::io::stderr().lock();
    let clear = if stderr.is_terminal() { "\r\x1b[2K" } else { "" };
    // The terminal may be gone.
    let _ = writeln!(stderr, "{clear}{line}");
}

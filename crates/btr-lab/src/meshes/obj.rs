//! OBJ: lines of text, of which those that begin with `v` are vertices.

use super::bounds::{Bounds, point};

/// The box of an OBJ file.
///
/// # Errors
/// A file without vertices.
pub(super) fn bounds(bytes: &[u8]) -> Result<Bounds, String> {
    let mut bounds = Bounds::none();
    for line in String::from_utf8_lossy(bytes).lines() {
        let mut words = line.split_ascii_whitespace();
        if words.next() == Some("v") {
            bounds.include(&point(words)?)?;
        }
    }
    bounds.known()
}

//! STL: triangles in binary, or as text.

use super::bounds::{Bounds, point};
use nalgebra::Point3;

/// Bytes before the triangles: a remark, and their number.
const HEAD: usize = 84;
/// Bytes of a triangle: a normal, three vertices, and two bytes without a meaning.
const TRIANGLE: usize = 50;

/// The box of an STL file.
///
/// # Errors
/// A file that is cut off or has no triangles.
pub(super) fn bounds(bytes: &[u8]) -> Result<Bounds, String> {
    let count = bytes.get(HEAD - 4..HEAD).map(|count| u32::from_le_bytes([count[0], count[1], count[2], count[3]]));
    let length = count.map(|count| HEAD as u64 + TRIANGLE as u64 * u64::from(count));
    // Binary files may begin with the word that text files begin with.
    let is_text = bytes.trim_ascii_start().starts_with(b"solid");
    match length {
        Some(length) if length == bytes.len() as u64 => binary(&bytes[HEAD..]),
        _ if is_text => text(bytes),
        Some(length) if length < bytes.len() as u64 => binary(&bytes[HEAD..length as usize]),
        _ => Err("it is no STL file, or cut off".to_owned()),
    }
}

fn binary(triangles: &[u8]) -> Result<Bounds, String> {
    let mut bounds = Bounds::none();
    for vertex in triangles.chunks_exact(TRIANGLE).flat_map(|triangle| triangle[12..48].chunks_exact(12)) {
        let number = |k: usize| f64::from(f32::from_le_bytes([vertex[k], vertex[k + 1], vertex[k + 2], vertex[k + 3]]));
        bounds.include(&Point3::new(number(0), number(4), number(8)))?;
    }
    bounds.known()
}

fn text(bytes: &[u8]) -> Result<Bounds, String> {
    let mut bounds = Bounds::none();
    for line in String::from_utf8_lossy(bytes).lines() {
        if let Some(numbers) = line.trim_start().strip_prefix("vertex") {
            bounds.include(&point(numbers.split_ascii_whitespace())?)?;
        }
    }
    bounds.known()
}

//! Reads a log from a stream, whose name does not tell its format.

use crate::channels::mapping::Mapping;
use crate::csv;
use crate::error::{IoError, Warning};
use btr_core::limits::MOST_STREAMED;
use btr_core::log::Log;
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// The first bytes of an MCAP file.
const MCAP: [u8; 4] = [0x89, b'M', b'C', b'A'];
/// The first bytes of a gzip file.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads a log from a stream: MCAP, CSV or compressed CSV, told by its first bytes. `name` is used in messages only.
///
/// # Errors
/// [`IoError`], as for a file; a stream of more than [`MOST_STREAMED`] bytes.
pub fn read_stream(name: &Path, stream: impl Read, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    let mut stream = Bounded { stream, left: MOST_STREAMED };
    let first = first_bytes(&mut stream).map_err(|source| IoError::File { path: name.to_owned(), source })?;
    let (is_mcap, is_gzip) = (first.starts_with(&MCAP), first.starts_with(&GZIP));
    let whole = first.as_slice().chain(stream);
    match () {
        () if is_mcap => mcap_of(name, whole, mapping),
        () if is_gzip => csv::read(name, flate2::read::MultiGzDecoder::new(whole), mapping),
        () => csv::read(name, whole, mapping),
    }
}

#[cfg(feature = "mcap")]
fn mcap_of(name: &Path, bytes: impl Read, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    crate::mcap::read(name, io::BufReader::new(bytes), mapping)
}

#[cfg(not(feature = "mcap"))]
fn mcap_of(name: &Path, _: impl Read, _: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    Err(IoError::Disabled { path: name.to_owned(), format: "MCAP", feature: "mcap" })
}

/// As many bytes as tell the format; fewer where the stream has no more.
fn first_bytes(stream: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut first = Vec::new();
    stream.take(MCAP.len() as u64).read_to_end(&mut first)?;
    Ok(first)
}

/// A stream that ends in an error where it has more bytes than are read.
struct Bounded<R> {
    stream: R,
    left: u64,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.stream.read(buffer)?;
        let too_many = || {
            let what = format!("more than {} GB, the most that is read from a stream", MOST_STREAMED >> 30);
            io::Error::new(ErrorKind::FileTooLarge, what)
        };
        self.left = self.left.checked_sub(count as u64).ok_or_else(too_many)?;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_stream_without_end_ends_in_an_error() {
        let mut stream = Bounded { stream: io::repeat(b'\n'), left: 1000 };
        let error = io::copy(&mut stream, &mut io::sink()).unwrap_err();
        assert_eq!(error.to_string(), "more than 4 GB, the most that is read from a stream");
    }
}

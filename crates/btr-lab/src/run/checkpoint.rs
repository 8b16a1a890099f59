//! The file of a checkpoint: a header with the format's version and two checksums, then the state of the run.

/// First bytes of a checkpoint, before the version of its format.
const NAME: &[u8; 7] = b"btr-cp\x00";
/// Version of the format: another order of fields is another one.
const VERSION: u8 = 7;

/// Why a file is no checkpoint of this version.
#[derive(Debug, PartialEq)]
pub(super) enum Unusable {
    /// It has this other version.
    Version(u8),
    /// It is damaged, or something else.
    Damaged(&'static str),
}

/// The content of a checkpoint, with the checksum of the stamp of the experiment that it belongs to.
#[derive(Debug, PartialEq)]
pub(super) struct Checkpoint<'a> {
    stamp: u32,
    pub(super) state: &'a [u8],
}

impl<'a> Checkpoint<'a> {
    /// Reads a checkpoint whose content is as it was written.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, Unusable> {
        let rest = bytes.strip_prefix(NAME).ok_or(Unusable::Damaged("it does not begin as a checkpoint"))?;
        let (&version, rest) = rest.split_first().ok_or(CUT)?;
        if version != VERSION {
            return Err(Unusable::Version(version));
        }
        let (stamp, rest) = number(rest).ok_or(CUT)?;
        let (checksum, state) = number(rest).ok_or(CUT)?;
        if crc32fast::hash(state) != checksum {
            return Err(Unusable::Damaged("its checksum does not match"));
        }
        Ok(Checkpoint { stamp, state })
    }

    /// Whether it was written for the experiment with this stamp.
    pub(super) fn is_of(&self, stamp: &str) -> bool {
        self.stamp == crc32fast::hash(stamp.as_bytes())
    }
}

const CUT: Unusable = Unusable::Damaged("it is cut off");

fn number(bytes: &[u8]) -> Option<(u32, &[u8])> {
    bytes.split_first_chunk().map(|(number, rest)| (u32::from_le_bytes(*number), rest))
}

/// The bytes of a checkpoint of the run that began with the experiment of this stamp.
pub(super) fn bytes(stamp: &str, state: &[u8]) -> Vec<u8> {
    let checksums = [stamp.as_bytes(), state].map(|part| crc32fast::hash(part).to_le_bytes());
    [NAME.as_slice(), &[VERSION], checksums.as_flattened(), state].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_flipped_bit_and_no_cut_gives_another_state() {
        let whole = bytes("seed 1", b"all that a run knows");
        let read = Checkpoint::read(&whole);
        assert!(read.is_ok_and(|read| read.state == b"all that a run knows" && read.is_of("seed 1")));
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            // A flipped checksum of the stamp makes it another run's.
            assert!(!Checkpoint::read(&flipped).is_ok_and(|read| read.is_of("seed 1")), "bit {bit}");
        }
        assert!((0..whole.len()).all(|cut| Checkpoint::read(&whole[..cut]).is_err()));
        assert_eq!(Checkpoint::read(b"btr-cp\x00\x06state"), Err(Unusable::Version(6)));
    }
}

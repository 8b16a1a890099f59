//! Reads MCAP: from `/btr/channels` if present, else from the standard topics.

use super::recording::Recording;
use crate::error::{IoError, Warning};
use crate::mapping::Mapping;
use btr_core::log::Log;
use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use std::io::Read;
use std::path::Path;

/// Maximum length of a record, in bytes. A longer one is damaged: without a limit, one flipped bit in a length exhausts
/// memory.
const LONGEST_RECORD: usize = 1 << 28;

/// Reads a log. `path` is used in messages only. Checksums are compared where the file has them, nothing of a file that
/// does not match them is used.
pub(crate) fn read(path: &Path, bytes: impl Read, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    let bytes = with_magic(path, bytes)?;
    let options = LinearReaderOptions::default()
        .with_record_length_limit(LONGEST_RECORD)
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut recording = Recording::new(mapping);
    for message in MessageReader::new_with_options(bytes, options) {
        match message {
            Ok(message) => {
                let channel = &message.channel;
                let schema = channel.schema.as_ref().map_or("", |s| s.name.as_str());
                recording.topic(channel.id, &channel.topic, schema, &channel.message_encoding, &channel.metadata);
                recording.take(channel.id, message.log_time, &message.data);
            }
            Err(error) if is_damage(&error) => {
                return Err(IoError::Damaged { path: path.to_owned(), what: error.to_string() });
            }
            Err(error) => {
                recording.breaks_off(error.to_string());
                break;
            }
        }
    }
    recording.into_log(path)
}

/// Whether the bytes are not those that were written. Any other error is one of a file that was cut.
fn is_damage(error: &McapError) -> bool {
    matches!(
        error,
        McapError::BadChunkCrc { .. }
            | McapError::BadDataCrc { .. }
            | McapError::BadSummaryCrc { .. }
            | McapError::BadAttachmentCrc { .. }
            | McapError::DecompressionError(_)
    )
}

/// The bytes, after a look at the eight magic bytes of MCAP. These belong to the checksum of the data.
fn with_magic(path: &Path, mut bytes: impl Read) -> Result<impl Read, IoError> {
    let mut magic = Vec::new();
    let start = bytes.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut magic);
    start.map_err(|source| IoError::File { path: path.to_owned(), source })?;
    match magic.as_slice() {
        [] => Err(IoError::Empty { path: path.to_owned() }),
        found if found == mcap::MAGIC => Ok(mcap::MAGIC.chain(bytes)),
        _ => Err(IoError::NotMcap { path: path.to_owned() }),
    }
}

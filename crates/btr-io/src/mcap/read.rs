//! Reads MCAP: from `/btr/channels` if present, else from the standard topics.

use super::recording::Recording;
use crate::error::{IoError, Warning};
use crate::mapping::Mapping;
use btr_core::log::Log;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use std::io::Read;
use std::path::Path;

/// Maximum length of a record, in bytes. A longer one is damaged: without a limit, one flipped bit in a length exhausts
/// memory.
const LONGEST_RECORD: usize = 1 << 28;

/// Reads a log. `path` is used in messages only.
pub(crate) fn read(path: &Path, bytes: impl Read, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    let bytes = after_magic(path, bytes)?;
    let options = LinearReaderOptions::default().with_skip_start_magic(true).with_record_length_limit(LONGEST_RECORD);
    let mut recording = Recording::new(mapping);
    for message in MessageReader::new_with_options(bytes, options) {
        match message {
            Ok(message) => {
                let channel = &message.channel;
                let schema = channel.schema.as_ref().map_or("", |s| s.name.as_str());
                recording.topic(channel.id, &channel.topic, schema, &channel.message_encoding, &channel.metadata);
                recording.take(channel.id, message.log_time, &message.data);
            }
            Err(error) => {
                recording.breaks_off(error.to_string());
                break;
            }
        }
    }
    recording.into_log(path)
}

/// The bytes after the eight magic bytes of MCAP.
fn after_magic<R: Read>(path: &Path, mut bytes: R) -> Result<R, IoError> {
    let mut magic = Vec::new();
    let start = bytes.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut magic);
    start.map_err(|source| IoError::File { path: path.to_owned(), source })?;
    match magic.as_slice() {
        [] => Err(IoError::Empty { path: path.to_owned() }),
        magic if magic == mcap::MAGIC => Ok(bytes),
        _ => Err(IoError::NotMcap { path: path.to_owned() }),
    }
}

//! Reads MCAP: from `/btr/channels` if present, else from the standard topics.

use super::recording::Recording;
use crate::channels::mapping::Mapping;
use crate::error::{IoError, Warning};
use btr_core::log::Log;
use mcap::McapError;
use mcap::parse_record;
use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::borrow::Cow;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// Maximum length of a record, in bytes. A longer one is damaged: without a limit, one flipped bit in a length exhausts
/// memory.
const LONGEST_RECORD: usize = 1 << 28;

/// Reads a log. `path` is used in messages only. Checksums are compared where the file has them, nothing of a file that
/// does not match them is used.
pub(crate) fn read(path: &Path, bytes: impl Read, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    let mut bytes = with_magic(path, bytes)?;
    let options = LinearReaderOptions::default()
        .with_record_length_limit(LONGEST_RECORD)
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = LinearReader::new_with_options(options);
    let (mut recording, mut records) = (Recording::new(mapping), Records::default());
    while let Some(event) = reader.next_event().filter(|_| !recording.is_full()) {
        let taken = match event {
            Ok(LinearReadEvent::ReadRequest(count)) => {
                fill(&mut bytes, reader.insert(count)).map(|filled| reader.notify_read(filled))
            }
            Ok(LinearReadEvent::Record { opcode, data }) => records.take(opcode, data, &mut recording),
            Err(error) if is_damage(&error) => {
                return Err(IoError::Damaged { path: path.to_owned(), what: error.to_string() });
            }
            Err(error) => Err(error.to_string()),
        };
        if let Err(why) = taken {
            recording.breaks_off(why);
            break;
        }
    }
    recording.into_log(path)
}

/// Fills the buffer with the bytes that are there; 0 at their end.
fn fill(bytes: &mut impl Read, buffer: &mut [u8]) -> Result<usize, String> {
    loop {
        match bytes.read(buffer) {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            filled => return filled.map_err(|e| e.to_string()),
        }
    }
}

/// The topics so far, and whether the data has ended: after it, a summary repeats them.
#[derive(Default)]
struct Records {
    channels: ChannelAccumulator<'static>,
    ended: bool,
}

impl Records {
    /// Adds a record to the recording. Those that are no data are not parsed. The text says what is wrong.
    fn take(&mut self, opcode: u8, data: &[u8], recording: &mut Recording) -> Result<(), String> {
        self.ended |= opcode == op::DATA_END;
        if self.ended || ![op::SCHEMA, op::CHANNEL, op::MESSAGE].contains(&opcode) {
            return Ok(());
        }
        if !holds_its_texts(opcode, data) {
            return Err("a text is longer than the record that holds it".to_owned());
        }
        match parse_record(opcode, data).map_err(|e| e.to_string())? {
            Record::Schema { header, data } => {
                self.channels.add_schema(header, Cow::Owned(data.into_owned())).map_err(|e| e.to_string())
            }
            Record::Channel(channel) => self.channels.add_channel(channel).map_err(|e| e.to_string()),
            Record::Message { header, data } => {
                let unknown = || format!("a message of the unknown channel {}", header.channel_id);
                let channel = self.channels.get(header.channel_id).ok_or_else(unknown)?;
                let schema = channel.schema.as_ref().map_or("", |s| s.name.as_str());
                recording.topic(channel.id, &channel.topic, schema, &channel.message_encoding, &channel.metadata);
                recording.take(channel.id, header.log_time, &data);
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

/// Whether a record is as long as the lengths of its texts claim: the parser takes memory for what they claim.
fn holds_its_texts(opcode: u8, data: &[u8]) -> bool {
    match opcode {
        // A number, the name, the encoding; the parser checks the rest.
        op::SCHEMA => data.get(2..).and_then(after_text).and_then(after_text).is_some(),
        // Two numbers, the topic, the encoding, and the length of the metadata, which are texts.
        op::CHANNEL => {
            let metadata = data.get(4..).and_then(after_text).and_then(after_text).and_then(|data| data.get(4..));
            let mut rest = metadata;
            while let Some(texts) = rest.filter(|texts| !texts.is_empty()) {
                rest = after_text(texts);
            }
            rest.is_some()
        }
        _ => true,
    }
}

/// What follows a text: its length in four bytes, and as many bytes.
fn after_text(data: &[u8]) -> Option<&[u8]> {
    let (length, rest) = data.split_first_chunk()?;
    rest.get(u32::from_le_bytes(*length) as usize..)
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

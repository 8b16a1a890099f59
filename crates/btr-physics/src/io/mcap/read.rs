//! MCAP to a log: from `/btr/channels` where there is one, else from the standard topics.

use super::other::{Kind, kind, samples};
use super::{merge, own};
use crate::io::error::{IoError, Warning};
use crate::io::names::Mapping;
use btr_core::log::Log;
use indexmap::IndexMap;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use mcap::{Channel, Message};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// A record that claims to be longer is damaged (in bytes): without a limit, one flipped bit in a length takes all
/// memory.
const LONGEST_RECORD: usize = 1 << 28;

/// Reads a log. `path` is only for messages.
pub(crate) fn read(path: &Path, bytes: impl Read, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    let bytes = after_magic(path, bytes)?;
    let options = LinearReaderOptions::default().with_skip_start_magic(true).with_record_length_limit(LONGEST_RECORD);
    let mut recording = Recording::new(mapping);
    for message in MessageReader::new_with_options(bytes, options) {
        match message {
            Ok(message) => recording.take(&message),
            Err(error) => {
                let (messages, why) = (recording.messages, error.to_string());
                recording.warnings.push(Warning::Truncated { messages, why });
                break;
            }
        }
    }
    recording.into_log(path)
}

/// What follows the eight bytes with which every MCAP file begins.
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

/// What to do with a topic's messages.
enum Plan {
    Own,
    Read { kind: Kind, json: bool },
    Skip,
}

/// A file as it is read through.
struct Recording<'a> {
    mapping: &'a Mapping,
    plans: BTreeMap<u16, Plan>,
    /// Topics with their types, for the message when nothing useful is found.
    topics: BTreeMap<String, String>,
    own: Option<own::Rows>,
    samples: Vec<(Kind, super::other::Sample)>,
    messages: usize,
    /// Per topic: how many messages could not be decoded, and why the first could not.
    undecodable: IndexMap<String, (usize, String)>,
    warnings: Vec<Warning>,
}

impl<'a> Recording<'a> {
    fn new(mapping: &'a Mapping) -> Self {
        Recording {
            mapping,
            plans: BTreeMap::new(),
            topics: BTreeMap::new(),
            own: None,
            samples: Vec::new(),
            messages: 0,
            undecodable: IndexMap::new(),
            warnings: Vec::new(),
        }
    }

    fn take(&mut self, message: &Message) {
        self.messages += 1;
        let channel = &message.channel;
        if !self.plans.contains_key(&channel.id) {
            let plan = self.plan(channel);
            self.plans.insert(channel.id, plan);
        }
        let taken = match self.plans.get(&channel.id) {
            Some(Plan::Own) => self.own.as_mut().map_or(Ok(()), |rows| rows.push(&message.data)),
            Some(&Plan::Read { kind, json }) => self.sample(message, kind, json),
            Some(Plan::Skip) | None => Ok(()),
        };
        if let Err(why) = taken {
            self.undecodable.entry(channel.topic.clone()).or_insert((0, why)).0 += 1;
        }
    }

    fn plan(&mut self, channel: &Channel) -> Plan {
        let schema = channel.schema.as_ref().map_or("", |s| s.name.as_str());
        self.topics.insert(channel.topic.clone(), schema.to_owned());
        let plan = if channel.topic == own::TOPIC && schema == own::TYPE {
            let rows = own::Rows::new(&channel.metadata);
            rows.map(|rows| {
                self.own = Some(rows);
                Plan::Own
            })
        } else {
            let encoding = channel.message_encoding.as_str();
            let kind = kind(&self.mapping.topics, &channel.topic, schema, encoding).transpose();
            kind.map(|kind| kind.map_or(Plan::Skip, |kind| Plan::Read { kind, json: encoding == "json" }))
        };
        plan.unwrap_or_else(|why| {
            self.warnings.push(Warning::TopicSkipped { topic: channel.topic.clone(), why });
            Plan::Skip
        })
    }

    fn sample(&mut self, message: &Message, kind: Kind, json: bool) -> Result<(), String> {
        let names = self.mapping.topics.arrays.get(&message.channel.topic).map_or(&[][..], Vec::as_slice);
        let samples = samples(kind, names, json, &message.data, message.log_time)?;
        self.samples.extend(samples.into_iter().map(|sample| (kind, sample)));
        Ok(())
    }

    fn into_log(mut self, path: &Path) -> Result<(Log, Vec<Warning>), IoError> {
        let undecodable = self.undecodable.into_iter();
        self.warnings.extend(undecodable.map(|(topic, (count, why))| Warning::Undecodable { topic, count, why }));
        if let Some(rows) = self.own.filter(|rows| !rows.is_empty()) {
            let log = rows.into_log().map_err(|source| IoError::Log { path: path.to_owned(), source })?;
            return Ok((log, self.warnings));
        }
        let Some(merged) = merge::merge(self.samples) else {
            let topics = self.topics.iter().map(|(topic, schema)| format!("{topic} ({schema})")).collect();
            return Err(IoError::NoStates {
                path: path.to_owned(),
                wanted: self.mapping.topics.states.clone(),
                topics,
            });
        };
        self.warnings.extend(merged.warnings);
        let (log, more) = crate::io::series::assemble(
            path,
            merged.clock_s,
            merged.series.into_iter().map(|(name, values)| self.mapping.series(name, values)).collect(),
            self.mapping,
        )?;
        self.warnings.extend(more);
        Ok((log, self.warnings))
    }
}

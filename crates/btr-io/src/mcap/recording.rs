//! Collects ROS 2 messages and converts them to a log.

use super::other::{Names, Sample, TopicFormat, TopicKind, format, samples};
use super::{merge, own};
use crate::channels::mapping::Mapping;
use crate::channels::series::check_size;
use crate::error::{IoError, Warning};
use btr_core::limits::{MOST_COLUMNS, MOST_VALUES};
use btr_core::log::Log;
use indexmap::IndexMap;
use std::collections::BTreeMap;
use std::path::Path;

/// What to do with a topic's messages.
enum TopicPlan {
    Own,
    Read(TopicFormat),
    Skip,
}

struct McapTopic {
    name: String,
    plan: TopicPlan,
}

/// A recording under construction: topics and messages are added one after the other.
pub struct Recording<'a> {
    mapping: &'a Mapping,
    topics: BTreeMap<u16, McapTopic>,
    /// Topics with their types, for the error when there are no joint states.
    types: BTreeMap<String, String>,
    own: Option<own::LogRows>,
    samples: Vec<(TopicKind, Sample)>,
    /// Values so far; a sample counts as one more.
    kept: usize,
    names: Names,
    messages: usize,
    /// Why the rest cannot be read, if so.
    broken: Option<String>,
    /// Per topic: how many messages could not be decoded, and why the first could not.
    undecodable: IndexMap<String, (usize, String)>,
    warnings: Vec<Warning>,
}

impl<'a> Recording<'a> {
    /// An empty recording; the mapping selects topics and translates names.
    pub fn new(mapping: &'a Mapping) -> Self {
        Recording {
            mapping,
            topics: BTreeMap::new(),
            types: BTreeMap::new(),
            own: None,
            samples: Vec::new(),
            kept: 0,
            names: Names::default(),
            messages: 0,
            broken: None,
            undecodable: IndexMap::new(),
            warnings: Vec::new(),
        }
    }

    /// Adds a topic with its type (`sensor_msgs/msg/JointState`), its messages' encoding (`cdr`, `json`) and its
    /// metadata. A known id is ignored.
    pub fn topic(&mut self, id: u16, name: &str, schema: &str, encoding: &str, metadata: &BTreeMap<String, String>) {
        if self.topics.contains_key(&id) {
            return;
        }
        self.types.insert(name.to_owned(), schema.to_owned());
        let plan = self.plan(name, schema, encoding, metadata).unwrap_or_else(|why| {
            self.warnings.push(Warning::TopicSkipped { topic: name.to_owned(), why });
            TopicPlan::Skip
        });
        self.topics.insert(id, McapTopic { name: name.to_owned(), plan });
    }

    fn plan(
        &mut self,
        name: &str,
        schema: &str,
        encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<TopicPlan, String> {
        if name == own::TOPIC && schema == own::TYPE {
            self.own = Some(own::LogRows::new(metadata)?);
            return Ok(TopicPlan::Own);
        }
        let format = format(&self.mapping.topics, name, schema, encoding).transpose()?;
        Ok(format.map_or(TopicPlan::Skip, TopicPlan::Read))
    }

    /// Adds a message of a topic, recorded at `log_ns`.
    pub fn take(&mut self, id: u16, log_ns: u64, data: &[u8]) {
        self.messages += 1;
        let Some(topic) = self.topics.get(&id).filter(|_| !self.is_full()) else { return };
        let taken = match (&topic.plan, &mut self.own) {
            (TopicPlan::Own, Some(rows)) => rows.push(data).map(|values| self.kept += values),
            // The log itself is present, so its views are not needed.
            (TopicPlan::Read(_), Some(rows)) if !rows.is_empty() => Ok(()),
            (&TopicPlan::Read(format), _) => {
                let elements = self.mapping.topics.arrays.get(&topic.name).map_or(&[][..], Vec::as_slice);
                samples(format, elements, data, log_ns, &mut self.names).map(|samples| {
                    self.kept += samples.iter().map(|sample| 1 + sample.values.len()).sum::<usize>();
                    self.samples.extend(samples.into_iter().map(|sample| (format.kind, sample)));
                })
            }
            (TopicPlan::Skip | TopicPlan::Own, _) => Ok(()),
        };
        if let Err(why) = taken {
            self.undecodable.entry(topic.name.clone()).or_insert((0, why)).0 += 1;
        }
    }

    /// Whether it holds more than a log may hold: no message is added any more.
    pub(crate) fn is_full(&self) -> bool {
        self.kept > MOST_VALUES || self.names.iter().len() > MOST_COLUMNS
    }

    /// Records that the rest of the file cannot be read.
    pub(crate) fn breaks_off(&mut self, why: String) {
        self.broken = Some(why.clone());
        self.warnings.push(Warning::Truncated { messages: self.messages, why });
    }

    /// The log of all messages. `path` is used in error messages only.
    ///
    /// # Errors
    /// [`IoError::NoStates`] without any joint states; samples that do not form a log.
    pub fn into_log(mut self, path: &Path) -> Result<(Log, Vec<Warning>), IoError> {
        check_size(path, self.kept, 1)?;
        check_size(path, 1, self.names.iter().len())?;
        let undecodable = self.undecodable.into_iter();
        self.warnings.extend(undecodable.map(|(topic, (count, why))| Warning::Undecodable { topic, count, why }));
        if let Some(rows) = self.own.filter(|rows| !rows.is_empty()) {
            let log = rows.into_log().map_err(|source| IoError::Log { path: path.to_owned(), source })?;
            return Ok((log, self.warnings));
        }
        let Some(merged) = merge::merge(path, self.samples, &self.names)? else {
            if let (0, Some(why)) = (self.messages, self.broken) {
                let what = format!("before the first message: {why}");
                return Err(IoError::Damaged { path: path.to_owned(), what });
            }
            let topics = self.types.iter().map(|(topic, schema)| format!("{topic} ({schema})")).collect();
            return Err(IoError::NoStates {
                path: path.to_owned(),
                wanted: self.mapping.topics.states.clone(),
                topics,
            });
        };
        self.warnings.extend(merged.warnings);
        let (log, more) = crate::channels::series::assemble(
            path,
            merged.clock_s,
            merged.series.into_iter().map(|(name, values)| self.mapping.series(name, values)).collect(),
            self.mapping,
        )?;
        self.warnings.extend(more);
        Ok((log, self.warnings))
    }
}

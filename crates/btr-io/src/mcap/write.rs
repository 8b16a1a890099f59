//! Writes a log as MCAP: the log itself, and views of it for other tools.

use super::own;
use super::ros::{Imu, JointState, Ros, Text, TfMessage, encode};
use super::views::{BaseView, ImuView, Joints};
use crate::meta::Meta;
use btr_core::log::Log;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, WriteOptions, Writer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

/// Time between two poses of the base in `/tf`: viewers draw about 30 frames a second.
pub(super) const TF_PERIOD_S: f64 = 1.0 / 30.0;

/// Writes the log, without wall time or thread counts: equal logs give equal bytes.
pub(crate) fn write(log: &Log, meta: &Meta, out: impl Write + Seek) -> io::Result<()> {
    let mut recorder = McapWriter::new(out)?;
    recorder.describe(meta)?;
    let topics = TopicNumbers::new(log, meta, &mut recorder)?;
    let start_ns = ns_after(log, 0);
    if let (Some(channel), Some(urdf)) = (topics.description, &meta.urdf) {
        recorder.send(channel, start_ns, &Text { data: urdf.clone() })?;
    }
    let mut next_tf_s = f64::NEG_INFINITY;
    for (i, &t) in log.clock_s().iter().enumerate() {
        let ns = ns_after(log, i);
        recorder.send_raw(topics.own, ns, |message| {
            own::encode(t, log.channels().map(|(_, channel)| channel.values[i]), message);
        })?;
        topics.send_views(i, ns, &mut recorder)?;
        if let Some((channel, base)) = topics.base.as_ref().filter(|_| t >= next_tf_s) {
            next_tf_s = t + TF_PERIOD_S;
            recorder.send(*channel, ns, &base.message(i, ns))?;
        }
    }
    recorder.finish()
}

/// The system's own error where there is one: it tells of a full disk.
fn why(error: McapError) -> io::Error {
    match error {
        McapError::Io(source) => source,
        other => io::Error::other(other),
    }
}

/// Nanoseconds of a tick as MCAP counts them: from 0, or from the first tick where that is negative.
pub(super) fn ns_after(log: &Log, tick: usize) -> u64 {
    let clock = log.clock_s();
    let zero_s = clock.first().copied().unwrap_or(0.0).min(0.0);
    clock.get(tick).map_or(0, |t| ((t - zero_s) * 1e9).round() as u64)
}

/// An MCAP writer of CDR messages.
pub(super) struct McapWriter<W: Write + Seek> {
    writer: Writer<W>,
    message: Vec<u8>,
}

impl<W: Write + Seek> McapWriter<W> {
    pub(super) fn new(out: W) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("btr ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(256 * 1024))
            .compression_threads(0);
        Ok(McapWriter { writer: options.create(out).map_err(why)?, message: Vec::new() })
    }

    /// Ends the file.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.writer.finish().map(|_| ()).map_err(why)
    }

    pub(super) fn describe(&mut self, meta: &Meta) -> io::Result<()> {
        let mut notes = meta.notes.clone();
        notes.insert("version".into(), env!("CARGO_PKG_VERSION").into());
        self.writer.write_metadata(&Metadata { name: "btr".into(), metadata: notes }).map_err(why)?;
        let Some(toml) = &meta.model_toml else { return Ok(()) };
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: "model.toml".into(),
            media_type: "application/toml".into(),
            data: Cow::Borrowed(toml.as_bytes()),
        };
        self.writer.attach(&attachment).map_err(why)
    }

    /// Adds a topic if it has a view.
    pub(super) fn topic<T: Ros, V>(&mut self, topic: &str, view: Option<V>) -> io::Result<Option<(u16, V)>> {
        let Some(view) = view else { return Ok(None) };
        Ok(Some((self.raw_topic(topic, T::NAME, T::DEFINITION, &BTreeMap::new())?, view)))
    }

    fn raw_topic(
        &mut self,
        topic: &str,
        name: &str,
        definition: &str,
        metadata: &BTreeMap<String, String>,
    ) -> io::Result<u16> {
        let schema = self.writer.add_schema(name, "ros2msg", definition.as_bytes()).map_err(why)?;
        self.writer.add_channel(schema, topic, "cdr", metadata).map_err(why)
    }

    pub(super) fn send<T: Ros>(&mut self, channel_id: u16, ns: u64, message: &T) -> io::Result<()> {
        let data = encode(message)?;
        self.write(channel_id, ns, &data)
    }

    fn send_raw(&mut self, channel_id: u16, ns: u64, fill: impl FnOnce(&mut Vec<u8>)) -> io::Result<()> {
        let mut message = std::mem::take(&mut self.message);
        fill(&mut message);
        let written = self.write(channel_id, ns, &message);
        self.message = message;
        written
    }

    fn write(&mut self, channel_id: u16, ns: u64, data: &[u8]) -> io::Result<()> {
        let header = MessageHeader { channel_id, sequence: 0, log_time: ns, publish_time: ns };
        self.writer.write_to_known_channel(&header, data).map_err(why)
    }
}

/// The topics of a log with their MCAP channel ids.
struct TopicNumbers<'a> {
    own: u16,
    description: Option<u16>,
    joints: Vec<(u16, Joints<'a>)>,
    imu: Option<(u16, ImuView<'a>)>,
    base: Option<(u16, BaseView<'a>)>,
}

impl<'a> TopicNumbers<'a> {
    fn new<W: Write + Seek>(log: &'a Log, meta: &'a Meta, recorder: &mut McapWriter<W>) -> io::Result<Self> {
        let metadata = own::metadata(log).map_err(io::Error::other)?;
        let own = recorder.raw_topic(own::TOPIC, own::TYPE, &own::definition(log), &metadata)?;
        let base_link = meta.base_link.as_deref().unwrap_or("base_link");
        let description = recorder.topic::<Text, _>("/robot_description", meta.urdf.as_ref())?;
        let states = recorder.topic::<JointState, _>("/joint_states", Joints::states(log))?;
        let commands = recorder.topic::<JointState, _>("/joint_commands", Joints::commands(log))?;
        Ok(TopicNumbers {
            own,
            description: description.map(|(channel, _)| channel),
            joints: states.into_iter().chain(commands).collect(),
            imu: recorder.topic::<Imu, _>("/imu", ImuView::new(log))?,
            base: recorder.topic::<TfMessage, _>("/tf", BaseView::new(log, base_link))?,
        })
    }

    fn send_views<W: Write + Seek>(&self, tick: usize, ns: u64, recorder: &mut McapWriter<W>) -> io::Result<()> {
        for (channel, joints) in &self.joints {
            recorder.send(*channel, ns, &joints.message(tick, ns))?;
        }
        match &self.imu {
            Some((channel, imu)) => recorder.send(*channel, ns, &imu.message(tick, ns)),
            None => Ok(()),
        }
    }
}

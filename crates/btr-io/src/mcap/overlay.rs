//! Robots that move beside each other in one MCAP file, for viewers.

use super::ros::{JointState, Text, TfMessage, Transform, TransformStamped};
use super::views::{Joints, header, quaternion_of, vector_of};
use super::write::{McapWriter, TF_PERIOD_S, ns_after};
use crate::meta::Meta;
use btr_core::log::Log;
use mcap::Summary;
use mcap::read::metadata;
use std::io::{self, Seek, Write};

/// The note by which an overlay is told from a recording.
const KIND: (&str, &str) = ("kind", "overlay");

/// Robots that move at the same times.
#[derive(Clone, Debug)]
pub struct Overlay {
    /// Their motion; all have the clock of the first.
    pub robots: Vec<OverlaidRobot>,
}

/// A robot of an overlay.
#[derive(Clone, Debug)]
pub struct OverlaidRobot {
    /// Its topics are below `/<name>/`, its frames below `<name>/`.
    pub name: String,
    /// Its joints: `q_`, `dq_`, `tau_` and `cmd_` with their names.
    pub log: Log,
    /// Its description, as URDF whose links have the names of their frames ([`frame_of`]).
    pub urdf: Option<String>,
    /// The frames of its links.
    pub frames: Vec<MovingFrame>,
}

/// The motion of a link's frame.
#[derive(Clone, Debug)]
pub struct MovingFrame {
    /// The link.
    pub link: String,
    /// The link that carries it; `None` for the world.
    pub parent: Option<String>,
    /// Its pose in the parent's frame at each time, or a single one if it does not move: m, then a quaternion x, y, z,
    /// w.
    pub poses: Vec<[f64; 7]>,
}

/// Writes an overlay: joint states and commands of each robot at every time, its description at the beginning, and the
/// frames of all robots in `/tf` and `/tf_static`.
pub(crate) fn write(overlay: &Overlay, out: impl Write + Seek) -> io::Result<()> {
    let mut recorder = McapWriter::new(out)?;
    let (key, kind) = KIND;
    recorder.describe(&Meta { notes: [(key.to_owned(), kind.to_owned())].into(), ..Meta::default() })?;
    let mut joints: Vec<(u16, Joints)> = Vec::new();
    for OverlaidRobot { name, log, urdf, .. } in &overlay.robots {
        let description = recorder.topic::<Text, _>(&format!("/{name}/robot_description"), urdf.clone())?;
        if let Some((channel, data)) = description {
            recorder.send(channel, 0, &Text { data })?;
        }
        let states = recorder.topic::<JointState, _>(&format!("/{name}/joint_states"), Joints::states(log))?;
        let commands = recorder.topic::<JointState, _>(&format!("/{name}/joint_commands"), Joints::commands(log))?;
        joints.extend(states.into_iter().chain(commands));
    }
    let (still, moving) =
        (overlay.frames(|frame| frame.poses.len() == 1), overlay.frames(|frame| frame.poses.len() > 1));
    if let Some((channel, frames)) = recorder.topic::<TfMessage, _>("/tf_static", some(still))? {
        recorder.send(channel, 0, &message(&frames, 0, 0))?;
    }
    let moving = recorder.topic::<TfMessage, _>("/tf", some(moving))?;
    let Some(first) = overlay.robots.first() else { return recorder.finish() };
    let mut next_tf_s = f64::NEG_INFINITY;
    for (tick, &t) in first.log.clock_s().iter().enumerate() {
        let ns = ns_after(&first.log, tick);
        for (channel, joints) in &joints {
            recorder.send(*channel, ns, &joints.message(tick, ns))?;
        }
        if let Some((channel, frames)) = moving.as_ref().filter(|_| t >= next_tf_s) {
            next_tf_s = t + TF_PERIOD_S;
            recorder.send(*channel, ns, &message(frames, tick, ns))?;
        }
    }
    recorder.finish()
}

/// Whether an MCAP file is an overlay.
pub(crate) fn is_overlay(file: &[u8]) -> bool {
    let (key, kind) = KIND;
    let Ok(Some(summary)) = Summary::read(file) else { return false };
    let notes = summary.metadata_indexes.iter().filter_map(|index| metadata(file, index).ok());
    notes.into_iter().any(|record| record.name == "btr" && record.metadata.get(key).is_some_and(|note| note == kind))
}

/// The name of a link's frame.
pub fn frame_of(robot: &str, link: &str) -> String {
    format!("{robot}/{link}")
}

/// A frame and the name of its robot.
type NamedFrame<'a> = (&'a str, &'a MovingFrame);

impl Overlay {
    fn frames(&self, which: impl Fn(&MovingFrame) -> bool) -> Vec<NamedFrame<'_>> {
        let all = self.robots.iter().flat_map(|robot| robot.frames.iter().map(|frame| (&*robot.name, frame)));
        all.filter(|(_, frame)| which(frame)).collect()
    }
}

fn some(frames: Vec<NamedFrame>) -> Option<Vec<NamedFrame>> {
    (!frames.is_empty()).then_some(frames)
}

/// The frames at a tick.
fn message(frames: &[NamedFrame], tick: usize, ns: u64) -> TfMessage {
    let transform = |(robot, frame): &NamedFrame| {
        let [x, y, z, qx, qy, qz, qw] = frame.poses[tick.min(frame.poses.len() - 1)];
        let parent = frame.parent.as_ref().map_or_else(|| "world".to_owned(), |link| frame_of(robot, link));
        TransformStamped {
            header: header(ns, &parent),
            child_frame_id: frame_of(robot, &frame.link),
            transform: Transform { translation: vector_of([x, y, z]), rotation: quaternion_of([qx, qy, qz, qw]) },
        }
    };
    TfMessage { transforms: frames.iter().map(transform).collect() }
}

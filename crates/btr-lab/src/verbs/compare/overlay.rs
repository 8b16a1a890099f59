//! The measured robot and the model's, to be written into one file for viewers.

use super::CompareReport;
use crate::motion::{BasePose, base, positions, readings};
use btr_core::log::{Log, LogError, Role};
use btr_io::{MovingFrame, OverlaidRobot, Overlay, frame_of};
use btr_physics::robot::urdf::to_coloured_urdf;
use btr_physics::robot::{Base, Robot};
use indexmap::IndexMap;
use nalgebra::Isometry3;

/// Time between the end of a log and the beginning of the next one.
const BETWEEN_LOGS_S: f64 = 1.0;
/// The robots' names and colours: red, green, blue and opacity.
const MEASURED: (&str, [f64; 4]) = ("measured", [0.74, 0.77, 0.81, 1.0]);
const MODEL: (&str, [f64; 4]) = ("model", [0.13, 0.48, 0.9, 0.5]);
/// The size of what is drawn of the model, as a share of the measured robot's: equal surfaces would flicker.
const MODEL_SIZE: f64 = 0.97;
/// What the differences of their joints are called.
const DIFFERENCE: &str = "difference";

/// A log and its simulation at the same times, which follow those of the log before.
struct LogAndReplay {
    real: Log,
    simulated: Log,
}

/// The motion of a robot.
#[derive(Default)]
struct Motion {
    /// Positions of each joint that moves.
    joints: Vec<Vec<f64>>,
    /// Poses of a floating base.
    base: Vec<BasePose>,
}

impl CompareReport {
    /// The measured and the simulated robot of all logs, one log after the other, with the differences of their joints:
    /// measured minus simulated. What was not measured moves as the model does.
    ///
    /// # Errors
    /// A simulation on another clock than its log's, which does not happen.
    pub fn overlay(&self) -> Result<Overlay, LogError> {
        let robot = &self.replays.model.robot;
        let logs = self.in_sequence()?;
        let (mut measured, mut of_model) = (Motion::default(), Motion::default());
        for LogAndReplay { real, simulated } in &logs {
            let replayed = Motion::of(robot, simulated, None);
            measured.append(Motion::of(robot, real, Some(&replayed)));
            of_model.append(replayed);
        }
        let real = joined(&logs.iter().map(|log| &log.real).collect::<Vec<_>>())?;
        let mut simulated = joined(&logs.iter().map(|log| &log.simulated).collect::<Vec<_>>())?;
        simulated.retain(|_, channel| channel.role != Role::Command);
        let differences = differences(&real, &simulated)?;
        let difference =
            OverlaidRobot { name: DIFFERENCE.to_owned(), log: differences, urdf: None, frames: Vec::new() };
        let drawn = robot.with_drawn_links();
        let smaller = drawn.clone().with_scaled_shapes(MODEL_SIZE);
        let measured = moving(drawn, MEASURED, real, measured.frames(robot));
        let of_model = moving(smaller, MODEL, simulated, of_model.frames(robot));
        Ok(Overlay { robots: vec![measured, of_model, difference] })
    }

    fn in_sequence(&self) -> Result<Vec<LogAndReplay>, LogError> {
        let mut from_s = 0.0;
        let mut logs = Vec::new();
        for (real, simulated) in self.replays.logs.iter().zip(&self.simulated).filter(|(real, _)| !real.is_empty()) {
            let simulated = simulated.resample(real.clock_s())?;
            logs.push(LogAndReplay { real: later(real, from_s)?, simulated: later(&simulated, from_s)? });
            from_s += real.clock_s().last().copied().unwrap_or(0.0) + BETWEEN_LOGS_S;
        }
        Ok(logs)
    }
}

/// A robot as it is drawn. Its links have the names of their frames, so that viewers find these.
fn moving(drawn: Robot, (name, colour): (&str, [f64; 4]), log: Log, frames: Vec<MovingFrame>) -> OverlaidRobot {
    let mut drawn = Robot { name: name.to_owned(), ..drawn };
    drawn.links.iter_mut().for_each(|link| link.name = frame_of(name, &link.name));
    OverlaidRobot { name: name.to_owned(), log, urdf: Some(to_coloured_urdf(&drawn, colour)), frames }
}

/// The same log at later times.
fn later(log: &Log, by_s: f64) -> Result<Log, LogError> {
    let mut same = Log::new(log.clock_s().iter().map(|t| t + by_s).collect())?;
    for (name, channel) in log.channels() {
        same.insert(name, &*channel.unit, channel.role, channel.values.clone())?;
    }
    Ok(same)
}

/// Logs as one, without values where a log lacks a channel.
fn joined(logs: &[&Log]) -> Result<Log, LogError> {
    let mut channels: IndexMap<&str, (&str, Role)> = IndexMap::new();
    for (name, channel) in logs.iter().flat_map(|log| log.channels()) {
        channels.entry(name).or_insert((&channel.unit, channel.role));
    }
    let mut all = Log::new(logs.iter().flat_map(|log| log.clock_s().iter().copied()).collect())?;
    for (name, (unit, role)) in channels {
        let values = |log: &&Log| log.channel(name).map_or_else(|| vec![f64::NAN; log.len()], |c| c.values.clone());
        all.insert(name, unit, role, logs.iter().flat_map(values).collect())?;
    }
    Ok(all)
}

/// Measured minus simulated, in the channels that both have.
fn differences(real: &Log, simulated: &Log) -> Result<Log, LogError> {
    let mut differences = Log::new(real.clock_s().to_vec())?;
    for (name, channel) in real.channels() {
        let Some(other) = simulated.channel(name) else { continue };
        let values = channel.values.iter().zip(&other.values).map(|(a, b)| a - b).collect();
        differences.insert(name, &*channel.unit, channel.role, values)?;
    }
    Ok(differences)
}

impl Motion {
    /// The motion of a robot in a log; what the log lacks is as in the other motion, or at the start.
    fn of(robot: &Robot, log: &Log, other: Option<&Motion>) -> Self {
        let starts = robot.movable().map(|(_, link)| link.joint.start);
        let lacking = |joint: usize, start: f64| {
            other.map_or_else(|| vec![start; log.len()], |other| other.joints[joint].clone())
        };
        let joints = positions(robot, log).into_iter().zip(starts).enumerate();
        let joints = joints.map(|(joint, (q, start))| q.unwrap_or_else(|| lacking(joint, start))).collect();
        let of_base = || base(|name| readings(log, name)).or_else(|| Some(other?.base.clone()));
        let floats = robot.base == Base::Floating;
        Motion { joints, base: floats.then(of_base).flatten().unwrap_or_default() }
    }

    fn append(&mut self, later: Motion) {
        self.joints.resize_with(later.joints.len(), Vec::new);
        self.joints.iter_mut().zip(later.joints).for_each(|(joint, more)| joint.extend(more));
        self.base.extend(later.base);
    }

    /// The frames of the links.
    fn frames(&self, robot: &Robot) -> Vec<MovingFrame> {
        let mut moving = self.joints.iter();
        let poses = |index: usize, moving: &mut std::slice::Iter<Vec<f64>>| {
            let joint = &robot.links[index].joint;
            match index {
                0 if self.base.is_empty() => vec![pose(&robot.start)],
                0 => self.base.clone(),
                _ if !joint.moves() => vec![pose(&joint.origin)],
                _ => moving.next().map_or_else(Vec::new, |q| q.iter().map(|q| pose(&joint.pose(*q))).collect()),
            }
        };
        let frame = |index: usize| MovingFrame {
            link: robot.links[index].name.clone(),
            parent: robot.links[index].parent.map(|parent| robot.links[parent].name.clone()),
            poses: poses(index, &mut moving),
        };
        (0..robot.links.len()).map(frame).filter(|frame| !frame.poses.is_empty()).collect()
    }
}

fn pose(at: &Isometry3<f64>) -> BasePose {
    let (p, q) = (at.translation.vector, at.rotation);
    [p.x, p.y, p.z, q.i, q.j, q.k, q.w]
}

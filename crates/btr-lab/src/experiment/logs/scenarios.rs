//! Recorded logs as scenarios: each has the log's commands, its initial state and its settings from the index.

use super::pieces;
use super::pieces::LogPiece;
use super::read::about;
use super::source::ReadLog;
use super::start::starts;
use crate::experiment::file::File;
use crate::experiment::source::{FileError, Source};
use crate::log_quality::usable;
use btr_core::log::{Log, LogError, interpolate};
use btr_core::signal::smooth;
use btr_core::signal::standstill::standing;
use btr_physics::drive::Replay;
use btr_physics::model::Scenario;
use btr_physics::model::parameter::Target;
use btr_physics::robot::{Joint, Robot};
use std::path::Path;
use std::sync::Arc;

/// A log in which each joint stands still for a larger share shows postures, not motion.
const MOST_STANDING: f64 = 0.9;
/// A joint that stands still for a larger share does not move: the rest is noise that looks like motion.
const ALL_STANDING: f64 = 0.99;

/// The scenarios of an experiment; the first `learn` are for training.
pub(crate) struct ScenarioSet {
    pub scenarios: Vec<Scenario>,
    pub learn: usize,
    pub logs: Vec<Log>,
    /// Warnings of their readers.
    pub warnings: Vec<String>,
}

/// What a log is used for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum LogPurpose {
    /// The search uses it.
    Training,
    /// Results are validated on it.
    HeldOut,
}

impl ScenarioSet {
    /// The usual case: one scenario without a log.
    pub(crate) fn single(duration_s: f64) -> Self {
        let scenario = Scenario { name: "default".to_owned(), duration_s, ..Scenario::default() };
        ScenarioSet { scenarios: vec![scenario], learn: 1, logs: Vec::new(), warnings: Vec::new() }
    }
}

/// Turns logs into scenarios.
pub(crate) struct ScenarioReader<'a> {
    pub file: &'a File,
    pub source: &'a Source,
    pub robot: &'a Robot,
}

impl ScenarioSet {
    pub(crate) fn none() -> Self {
        ScenarioSet { scenarios: Vec::new(), learn: 0, logs: Vec::new(), warnings: Vec::new() }
    }

    pub(crate) fn notice(&mut self, path: &Path, noticed: impl IntoIterator<Item = String>) {
        self.warnings.extend(noticed.into_iter().map(|warning| format!("{}: {warning}", path.display())));
    }

    /// Adds a log, in pieces if it has gaps; training logs must be added first.
    pub(crate) fn add(
        &mut self,
        log: &ReadLog,
        purpose: LogPurpose,
        settings: &[(Target, f64)],
        reader: &ScenarioReader,
    ) -> Result<(), FileError> {
        let path = &log.path;
        let (pieces, noticed) = pieces::pieces(path, &log.log)?;
        let scenario = |piece| {
            let compared = reader.compared(piece)?;
            let replay = compared.replay.map(|replay| Arc::new(Arc::unwrap_or_clone(replay).of_means(log.mean_s)));
            Ok(Scenario { settings: settings.to_vec(), replay, ..compared })
        };
        // All or nothing: a log that is refused leaves no trace.
        let scenarios = pieces.iter().map(scenario).collect::<Result<Vec<_>, FileError>>()?;
        self.notice(path, log.warnings.iter().cloned());
        let simulation = &reader.file.simulation;
        let dt_s =
            simulation.control_s.map(|control_s| control_s / f64::from(simulation.steps(control_s, reader.robot)));
        self.notice(path, usable::warnings(&log.log, dt_s));
        self.notice(path, noticed);
        self.scenarios.extend(scenarios);
        for mut piece in pieces {
            smooth_needed(&mut piece.log, reader.robot);
            if !reader.file.channels.keep_standstill {
                let told = leave_out_standstill(&mut piece.log, reader.robot);
                self.notice(&piece.path, told);
            }
            self.logs.push(piece.log);
        }
        if purpose == LogPurpose::Training {
            self.learn = self.scenarios.len();
        }
        Ok(())
    }
}

/// Smooths the measured torques of joints that follow their measured motion in the same way as the required torques, so
/// that both have the same bandwidth. At the ends of a log, where the motion is known from one side only, it leaves
/// them out.
fn smooth_needed(log: &mut Log, robot: &Robot) {
    let clock_s = log.clock_s().to_vec();
    for joint in robot.prescribed() {
        if let Some(torques) = log.values_mut(&joint.compared()) {
            if let Some(sampling) = &joint.sampling {
                // A torque that is held from its instant acts half a period later on average.
                let acted_s: Vec<f64> = clock_s.iter().map(|t| t + 0.5 * sampling.period_s).collect();
                let acted = interpolate(&acted_s, torques, &clock_s);
                torques.copy_from_slice(&acted);
            }
            smooth::in_place(&clock_s, torques);
            let clear = smooth::clear_of_ends(&clock_s);
            torques[..clear.start].fill(f64::NAN);
            torques[clear.end..].fill(f64::NAN);
        }
    }
}

/// Leaves out the torques of prescribed joints that stand still, and tells it: dry friction takes whatever torque is
/// left there, up to its size, so that the motion does not say which. Where no joint moves for a tenth of a log, it
/// keeps them: its postures are all that it shows.
fn leave_out_standstill(log: &mut Log, robot: &Robot) -> Option<String> {
    let clock_s = log.clock_s().to_vec();
    let positions = |joint: &Joint| log.channel(&format!("q_{}", joint.name)).map(|channel| &channel.values);
    let measured = robot.prescribed().filter_map(|joint| Some((joint, positions(joint)?)));
    let all: Vec<(&Joint, Vec<bool>)> = measured.map(|(joint, q)| (joint, standing(&clock_s, q))).collect();
    let share = |stands: &[bool]| stands.iter().filter(|stands| **stands).count() as f64 / clock_s.len() as f64;
    if all.iter().all(|(_, stands)| share(stands) > MOST_STANDING) {
        return None;
    }
    let long_s = log.duration_s();
    let mut left_out: Vec<String> = Vec::new();
    for (joint, stands) in all.iter().filter(|(_, stands)| stands.contains(&true)) {
        if let Some(torques) = log.values_mut(&joint.compared()) {
            let all = share(stands) > ALL_STANDING;
            let held = torques.iter_mut().zip(stands).filter(|(_, stands)| all || **stands);
            held.for_each(|(torque, _)| *torque = f64::NAN);
            left_out.push(format!("{} ({:.1} s)", joint.name, long_s * share(stands)));
        }
    }
    let told = || {
        format!(
            "torques are left out where a joint stands still, as friction may hold any of them: {}; [channels] \
             keep_standstill = true keeps them",
            left_out.join(", ")
        )
    };
    (!left_out.is_empty()).then(told)
}

impl ScenarioReader<'_> {
    /// The scenario of a log for a comparison with simulations, without the settings from the index.
    fn compared(&self, piece: &LogPiece) -> Result<Scenario, FileError> {
        let replaying = self.replaying(piece)?;
        self.check_positions(&piece.path, &piece.log)?;
        Ok(replaying)
    }

    /// Rejects a log without the positions that a comparison needs.
    pub(crate) fn check_positions(&self, path: &Path, log: &Log) -> Result<(), FileError> {
        let checked = usable::check_positions(log, self.robot, &self.file.channels);
        checked.map_err(|e| self.lacking(path, &e))
    }

    /// The scenario of a log: its commands, its duration, its initial state.
    pub(crate) fn replaying(&self, piece: &LogPiece) -> Result<Scenario, FileError> {
        Ok(Scenario {
            name: piece.name.clone(),
            replay: Some(Arc::new(Replay::new(&piece.log, self.robot))),
            duration_s: piece.log.duration_s(),
            begins_s: piece.begins_s,
            start: starts(&piece.log, self.robot).map_err(|e| self.lacking(&piece.path, &e))?,
            ..Scenario::default()
        })
    }

    /// The error for a missing channel, with the available ones; at its line if the file maps the channel.
    fn lacking(&self, path: &Path, error: &LogError) -> FileError {
        let LogError::Missing { channel, available } = error else { return about(path, &error.to_string(), None) };
        let has = format!("it has: {}", available.join(", "));
        match self.file.channels.theirs(channel) {
            Some((key, theirs)) => {
                let message = format!("{} has no column `{theirs}`, which is mapped to `{channel}`", path.display());
                self.source.error(&["channels", "channels", key], &message, Some(has.into()))
            }
            None => {
                let help = format!("{has}; [channels.channels] in the model file maps foreign names");
                about(path, &error.to_string(), Some(help.into()))
            }
        }
    }
}

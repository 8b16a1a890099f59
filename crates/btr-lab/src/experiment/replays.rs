//! A model with the logs that are named on the command line: each log is a scenario.

use super::build::Builder;
use super::logs::batch::{BatchReader, DamagedLogs, LeftOutLog, LogBatch};
use super::logs::index::IndexEntries;
use super::logs::scenarios::ScenarioReader;
use super::logs::source::{LogSource, ReadLog, Recordings};
use super::source::{FileError, Source};
use crate::log_quality::repeats::Repeats;
use crate::log_quality::{at_limit, beside_model, coverage, quality, stated_noise, torque_noise};
use btr_core::limits::MOST_LOGS;
use btr_core::log::Log;
use btr_identify::quality::Quality;
use btr_physics::model::Model;
use std::path::Path;

/// Rounding of times, in s.
const ROUNDED_S: f64 = 1e-9;

/// A model, the logs that it replays, and the findings about them.
pub struct Replays {
    /// The model with one scenario per log, or several for a log with gaps, in order; those from `learn` on are held
    /// out.
    pub model: Model,
    /// The recorded logs from time zero; one per scenario.
    pub logs: Vec<Log>,
    /// Warnings about usable logs.
    pub warnings: Vec<String>,
    /// The quality of the logs, one per file.
    pub checked: Vec<CheckedLog>,
    /// Logs that could not be used.
    pub left_out: Vec<LeftOutLog>,
    /// The logs as they were read.
    pub recordings: Recordings,
    /// Runs of the same command.
    pub(crate) repeats: Repeats,
    /// Where each scenario's log is in its file.
    pub(crate) places: Vec<LogPlace>,
    /// Whether glitches stay in the logs.
    pub(crate) keeps_glitches: bool,
}

/// Where a scenario's log is in a file.
#[derive(Clone, Debug)]
pub(crate) struct LogPlace {
    /// The file's path.
    pub file: String,
    /// Number of samples of the file, ...
    pub samples: usize,
    /// ... the first one of the log, ...
    pub first: usize,
    /// ... and its time in s.
    pub begins_s: f64,
}

/// The quality of a log.
#[derive(Clone, Debug)]
pub struct CheckedLog {
    /// Its path.
    pub log: String,
    /// The findings about it.
    pub quality: Quality,
}

impl Replays {
    /// Joints for which no log has a comparable reading.
    pub fn not_judged(&self) -> Vec<String> {
        coverage::unmeasured_joints(&self.model.robot, &self.logs)
    }

    /// Whether any comparable reading changes by more than its noise in a training log.
    pub fn is_moving(&self) -> bool {
        let training = &self.logs[..self.model.learn.min(self.logs.len())];
        coverage::is_moving(&self.model.robot, &self.model.setup.noise, training)
    }
}

/// The model of a file with logs as scenarios: the commands of each log from its initial state; a log with gaps in
/// pieces. An index of logs in the file (`[logs]`, or that of `[reality]`) has the settings of each.
///
/// # Errors
/// An invalid file; a log that cannot be read, lacks the robot's joints, or is both a training log and held out.
pub fn replays<L>(source: &Source, learn: &[L], held_out: &[L]) -> Result<Replays, FileError>
where
    L: Clone + Into<LogSource>,
{
    replays_of(source, learn, held_out, DamagedLogs::Refuse, &|_| {})
}

/// The same, with a choice for logs whose content cannot be used; `on_log` is called with the path of each log before
/// it is read.
///
/// # Errors
/// See [`replays`]; a damaged log is none where it is left out and another one of its purpose remains.
pub fn replays_of<L>(
    source: &Source,
    learn: &[L],
    held_out: &[L],
    damaged: DamagedLogs,
    on_log: &dyn Fn(&Path),
) -> Result<Replays, FileError>
where
    L: Clone + Into<LogSource>,
{
    let given = |logs: &[L]| logs.iter().cloned().map(Into::into).collect::<Vec<LogSource>>();
    let (learn, held_out) = (given(learn), given(held_out));
    let file = source.parse()?;
    let builder = Builder::new(&file, source);
    let (robot, mut warnings) = builder.robot_with_warnings()?;
    if let Some(both) = learn.iter().find(|log| held_out.iter().any(|other| other.path() == log.path())) {
        let message = format!("{} is both a training log and held out", both.path().display());
        return Err(source.error(&[], &message, None));
    }
    if learn.len() + held_out.len() > MOST_LOGS {
        let message = format!("{} logs; at most {MOST_LOGS} are read at once", learn.len() + held_out.len());
        return Err(source.error(&[], &message, None));
    }
    if learn.is_empty() {
        let help = "name a log of what the robot did: a CSV, an MCAP, a LeRobot episode".into();
        return Err(source.error(&[], "no training log", Some(help)));
    }
    let reader = ScenarioReader { file: &file, source, robot: &robot };
    let batch =
        BatchReader { reader, index: IndexEntries::of(&file, source)?, noise: builder.noise(), damaged, on_log };
    let LogBatch { set, recordings, scenarios, declared, left_out, .. } = batch.read(&learn, &held_out)?;
    check_separate(&recordings, source)?;
    let mut logs = set.logs.clone();
    warnings.extend(set.warnings.iter().cloned());
    let mut model = builder.model(set)?;
    // Smoothed torques do not show their noise any more.
    let sensors: Vec<_> = recordings.learn.iter().map(|read| &read.torque_noise).collect();
    let means_of = recordings.learn.iter().map(|read| read.means_of).max().unwrap_or(1);
    let floors = torque_noise::floors(&model, (&sensors, means_of), &logs);
    model.setup.noise.channels.extend(floors);
    let simulated = beside_model::simulated(&model);
    let beside = match file.channels.keep_glitches {
        true => vec![Vec::new(); logs.len()],
        false => beside_model::leave_out(&model, &mut logs, &simulated),
    };
    warnings.extend(stated_noise::warning(&model, &logs, &simulated));
    warnings.extend(at_limit::warnings(&model, &simulated));
    let repeats = Repeats::of(&model, &logs, &declared);
    model.setup.noise.unpredictable.channels = repeats.noise();
    let all = recordings.learn.iter().chain(&recordings.held_out);
    let place = |read: &ReadLog, k: usize| {
        let begins_s = model.scenarios[k].begins_s;
        let first = read.log.clock_s().partition_point(|t| *t < begins_s - ROUNDED_S);
        LogPlace { file: read.path.display().to_string(), samples: read.log.len(), first, begins_s }
    };
    let placed = all.clone().zip(&scenarios).flat_map(|(read, of)| of.clone().map(|k| place(read, k)));
    let places: Vec<LogPlace> = placed.collect();
    let checked = all.zip(scenarios).map(|(read, scenarios)| {
        let in_file = |k: usize| beside[k].iter().cloned().map(move |glitch| (k, glitch));
        let beside = scenarios.flat_map(in_file).map(|(k, glitch)| glitch.later(places[k].first, places[k].begins_s));
        let glitches = read.glitches.iter().cloned().chain(beside).collect();
        CheckedLog {
            log: read.path.display().to_string(),
            quality: quality(&read.log, glitches, &model.robot, &model.setup.noise),
        }
    });
    let checked = checked.collect();
    let keeps_glitches = file.channels.keep_glitches;
    Ok(Replays { logs, warnings, checked, left_out, model, recordings, repeats, places, keeps_glitches })
}

/// Rejects measurements that are for training and held out at once.
fn check_separate(recordings: &Recordings, source: &Source) -> Result<(), FileError> {
    let Recordings { learn, held_out } = recordings;
    let mut pairs = learn.iter().flat_map(|training| held_out.iter().map(move |held_out| (training, held_out)));
    let Some((training, held_out)) = pairs.find(|(a, b)| a.log.is_same(&b.log)) else { return Ok(()) };
    let (training, held_out) = (training.path.display(), held_out.path.display());
    let message = format!("{training} and {held_out} hold the same measurements, for training and held out at once");
    let help = "hold out another recording; without any, the last part of each log is held out".into();
    Err(source.error(&[], &message, Some(help)))
}

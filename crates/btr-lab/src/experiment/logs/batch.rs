//! The logs of a command: those that can be used, and those that were left out.

use super::index::IndexEntries;
use super::read::{RefusedLog, about, read};
use super::scenarios::{LogPurpose, ScenarioReader, ScenarioSet};
use super::source::{LogSource, ReadLog, Recordings};
use crate::experiment::source::FileError;
use crate::log_quality::coverage;
use btr_core::text::Text;
use btr_physics::sensor::SensorNoise;
use serde::Serialize;
use std::ops::Range;
use std::path::Path;

/// What to do about a log whose content cannot be used, among others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DamagedLogs {
    /// It is left out, as long as another log of its purpose remains.
    LeaveOut,
    /// It is an error.
    Refuse,
}

/// A log that was left out because its content cannot be used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOutLog {
    /// Its path.
    pub log: String,
    /// Why, with the place in the file.
    pub reason: String,
    /// The remedy.
    #[serde(skip)]
    pub help: Option<Text>,
}

impl LeftOutLog {
    fn new((log, error): (&LogSource, FileError)) -> Self {
        LeftOutLog { log: log.path().display().to_string(), reason: error.to_string(), help: error.help }
    }
}

/// Logs as scenarios.
pub(crate) struct LogBatch {
    pub set: ScenarioSet,
    pub recordings: Recordings,
    /// The scenarios of each log.
    pub scenarios: Vec<Range<usize>>,
    /// For each scenario, what the index calls its command.
    pub declared: Vec<Option<String>>,
    pub left_out: Vec<LeftOutLog>,
    /// The period at which prescribed motions are followed, in s, as the first log decided.
    followed_s: Option<f64>,
}

/// Reads the logs of a command.
pub(crate) struct BatchReader<'a> {
    pub reader: ScenarioReader<'a>,
    pub index: IndexEntries<'a>,
    pub noise: SensorNoise,
    pub damaged: DamagedLogs,
    /// Told the path of each log before it is read.
    pub on_log: &'a dyn Fn(&Path),
}

impl BatchReader<'_> {
    /// Reads training logs and held-out logs.
    pub(crate) fn read(&self, learn: &[LogSource], held_out: &[LogSource]) -> Result<LogBatch, FileError> {
        let mut batch = LogBatch {
            set: ScenarioSet::none(),
            recordings: Recordings::default(),
            scenarios: Vec::new(),
            declared: Vec::new(),
            left_out: Vec::new(),
            followed_s: None,
        };
        self.add_all(learn, LogPurpose::Training, &mut batch)?;
        self.add_all(held_out, LogPurpose::HeldOut, &mut batch)?;
        Ok(batch)
    }

    /// Adds the logs of one purpose. If none can be used, the error is that of the first.
    fn add_all(&self, given: &[LogSource], purpose: LogPurpose, batch: &mut LogBatch) -> Result<(), FileError> {
        let leaves_out = self.damaged == DamagedLogs::LeaveOut && given.len() > 1;
        let mut refused = Vec::new();
        for source in given {
            (self.on_log)(source.path());
            match self.add(source, purpose, batch, leaves_out) {
                Err(log) if leaves_out && log.by_content => refused.push((source, log.error)),
                other => other?,
            }
        }
        let none_remains = refused.len() == given.len();
        match refused.first() {
            Some((_, first)) if none_remains => Err(first.clone()),
            _ => {
                batch.left_out.extend(refused.into_iter().map(LeftOutLog::new));
                Ok(())
            }
        }
    }

    /// Rejects a log of which nothing can be compared. Where no log can, other messages say so.
    fn check_comparable(&self, log: &ReadLog) -> Result<(), FileError> {
        self.reader.check_positions(&log.path, &log.log)?;
        if coverage::measures_a_joint(self.reader.robot, &self.noise, &log.log) {
            return Ok(());
        }
        let help = "it needs a position q_<joint>, or the torques of prescribed joints".into();
        Err(about(&log.path, "nothing to compare with the model", Some(help)))
    }

    fn add(
        &self,
        source: &LogSource,
        purpose: LogPurpose,
        batch: &mut LogBatch,
        among_others: bool,
    ) -> Result<(), RefusedLog> {
        let ScenarioReader { file, robot, source: model } = self.reader;
        let log = read(source, file, robot, &mut batch.followed_s)?;
        if among_others {
            self.check_comparable(&log).map_err(RefusedLog::by_content)?;
        }
        let settings = self.index.settings(&log.path, robot, model).map_err(RefusedLog::by_request)?;
        let declared = self.index.repeats(&log.path, model).map_err(RefusedLog::by_request)?;
        let first = batch.set.scenarios.len();
        batch.set.add(&log, purpose, &settings, &self.reader).map_err(RefusedLog::by_content)?;
        batch.set.notice(&log.path, self.index.misses(&log.path));
        batch.scenarios.push(first..batch.set.scenarios.len());
        batch.declared.resize(batch.set.scenarios.len(), declared);
        match purpose {
            LogPurpose::Training => batch.recordings.learn.push(log),
            LogPurpose::HeldOut => batch.recordings.held_out.push(log),
        }
        Ok(())
    }
}

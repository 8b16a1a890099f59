//! A model beside the logs that somebody names on the command line: each log is a situation of its own.

use super::pieces;
use super::quality;
use super::scenarios;
use super::scenarios::{IndexRow, ScenarioReader, ScenarioSet};
use super::source::LogSource;
use crate::experiment::build::Builder;
use crate::experiment::file::{ColumnSection, File, RealitySection};
use crate::experiment::parse::{FileError, Source};
use btr_core::log::Log;
use btr_identify::quality::Quality;
use btr_physics::model::Model;
use btr_physics::model::parameter::Target;
use btr_physics::robot::Robot;
use indexmap::IndexMap;
use std::path::{Path, PathBuf};

/// Readings that stay within so many noise floors do not move.
const DEAD: f64 = 10.0;

/// A model, the logs that it is to repeat, and what was noticed while they were read.
pub struct Replays {
    /// With one scenario per log, or several for a log with gaps, in their order; those from `learn` on are held out.
    pub model: Model,
    /// What was recorded, from time zero; one per scenario.
    pub logs: Vec<Log>,
    /// What is odd about the logs, though they can be used.
    pub warnings: Vec<String>,
    /// What the logs are worth, one per file.
    pub checked: Vec<CheckedLog>,
}

/// What a log is worth.
#[derive(Clone, Debug)]
pub struct CheckedLog {
    /// Its path.
    pub log: String,
    /// All that was found in it.
    pub quality: Quality,
}

impl Replays {
    /// Joints of which no log has a reading that could be compared.
    pub fn not_judged(&self) -> Vec<String> {
        let read = |log: &Log, name: &str| log.channel(name).is_some_and(|c| c.values.iter().any(|x| x.is_finite()));
        let joints = self.model.robot.movable().map(|(_, link)| &link.joint);
        let blind = joints.filter(|joint| !self.logs.iter().any(|log| read(log, &joint.compared())));
        blind.map(|joint| joint.name.clone()).collect()
    }

    /// Whether any reading that could be compared changes by more than its noise in a log to learn from.
    pub fn is_moving(&self) -> bool {
        let noise = &self.model.setup.noise;
        let moves = |log: &Log, name: &str| {
            let Some(channel) = log.channel(name) else { return false };
            let there = channel.values.iter().filter(|x| x.is_finite());
            let (low, high) = there.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
            noise.floor(name, &channel.values).is_some_and(|sigma| high - low > DEAD * sigma)
        };
        let joints = || self.model.robot.movable().map(|(_, link)| &link.joint);
        self.logs.iter().take(self.model.learn).any(|log| joints().any(|joint| moves(log, &joint.compared())))
    }
}

/// The model of a file beside logs: what each log says the robot was told, from where it starts; a log with gaps in pieces. An
/// index of logs in the file (`[logs]`, or that of `[reality]`) sets what is known of each.
///
/// # Errors
/// Whatever does not make sense in the file; a log that cannot be read, lacks the robot's joints, or is both learnt from and
/// held out.
pub fn replays<L>(source: &Source, learn: &[L], held_out: &[L]) -> Result<Replays, FileError>
where
    L: Clone + Into<LogSource>,
{
    let given = |logs: &[L]| logs.iter().cloned().map(Into::into).collect::<Vec<LogSource>>();
    let (learn, held_out) = (given(learn), given(held_out));
    let file = source.parse()?;
    let builder = Builder { file: &file, source };
    let robot = builder.robot()?;
    if let Some(both) = learn.iter().find(|log| held_out.iter().any(|other| other.path() == log.path())) {
        let message = format!("{} is to be learnt from and held out at once", both.path().display());
        return Err(source.error(&[], &message, None));
    }
    if learn.is_empty() {
        let help = "name a log of what the robot did: a CSV, an MCAP, a LeRobot episode".to_owned();
        return Err(source.error(&[], "no log to learn from", Some(help)));
    }
    let known = IndexEntries::of(&file, source)?;
    let reader = ScenarioReader { file: &file, source, robot: &robot };
    let (mut all, mut wholes) = (ScenarioSet::none(), Vec::new());
    let mut floor = 0.0f64;
    for (k, given) in learn.iter().chain(&held_out).enumerate() {
        let (path, (log, noticed)) = (given.path(), pieces::read(given, &file)?);
        all.notice(path, noticed.into_iter().chain(known.misses(path)));
        let settings = known.settings(path, &robot, source)?;
        floor = all.add(path, &log, k < learn.len(), &settings, &reader)?.into_iter().fold(floor, f64::max);
        wholes.push((path.display().to_string(), log));
    }
    let (learnt, judged) = wholes.split_at(learn.len());
    let mut pairs = learnt.iter().flat_map(|learnt| judged.iter().map(move |judged| (learnt, judged)));
    if let Some(((learnt, _), (judged, _))) = pairs.find(|((_, a), (_, b))| a.is_same(b)) {
        let message = format!("{learnt} and {judged} hold the same measurements: learnt from and held out at once");
        let help = "hold out another recording; without any, the last part of each log is held out".to_owned();
        return Err(source.error(&[], &message, Some(help)));
    }
    let (logs, warnings) = (all.logs.clone(), all.warnings.clone());
    let mut model = builder.model(all)?;
    if model.setup.noise.torque <= 0.0 {
        // A torque that was smoothed does not show its sensor's noise any more.
        model.setup.noise.torque = floor;
    }
    let quality = |log: &Log| quality::quality(log, &model.robot, &model.setup.noise);
    let checked = wholes.into_iter().map(|(name, log)| CheckedLog { quality: quality(&log), log: name }).collect();
    Ok(Replays { logs, warnings, checked, model })
}

/// What an index says about logs.
pub(super) struct IndexEntries<'a> {
    section: &'static str,
    rows: Vec<(PathBuf, IndexRow)>,
    columns: Option<&'a IndexMap<String, ColumnSection>>,
}

impl<'a> IndexEntries<'a> {
    pub(super) fn of(file: &'a File, source: &Source) -> Result<Self, FileError> {
        let (section, index, columns) = match (&file.logs, &file.reality) {
            (Some(logs), _) => ("logs", Some(&logs.index), &logs.columns),
            (None, Some(RealitySection::Logs(logs))) => ("reality", logs.index.as_ref(), &logs.columns),
            _ => return Ok(IndexEntries { section: "logs", rows: Vec::new(), columns: None }),
        };
        // Without columns the index only says which logs there are, and these have been named.
        let Some(index) = index.filter(|_| !columns.is_empty()) else {
            return Ok(IndexEntries { section, rows: Vec::new(), columns: None });
        };
        let index = source.folder().join(index);
        let folder = index.parent().unwrap_or(Path::new(""));
        let mut rows = Vec::new();
        for (line, row) in scenarios::read_index(&index, source, section)? {
            let name = row.get("file").ok_or_else(|| scenarios::no_file_column(&index, line))?;
            rows.push((folder.join(name), row));
        }
        Ok(IndexEntries { section, rows, columns: Some(columns) })
    }

    /// The row of a log: that of its path, or else that of its name, for logs that were copied elsewhere.
    fn row(&self, log: &Path) -> Option<&IndexRow> {
        let same = |path: &Path| path.canonicalize().ok().is_some_and(|p| log.canonicalize().is_ok_and(|l| l == p));
        let by_path = self.rows.iter().find(|(path, _)| same(path));
        by_path.or_else(|| self.rows.iter().find(|(path, _)| path.file_name() == log.file_name())).map(|(_, row)| row)
    }

    fn misses(&self, log: &Path) -> Option<String> {
        let unknown = self.columns.is_some() && self.row(log).is_none();
        unknown.then(|| "the index does not know it; what its columns set keeps the model's own value".to_owned())
    }

    /// The parameters that the log's row sets; none where the index does not know it.
    pub(super) fn settings(&self, log: &Path, robot: &Robot, source: &Source) -> Result<Vec<(Target, f64)>, FileError> {
        match (self.row(log), self.columns) {
            (Some(row), Some(columns)) => scenarios::settings((self.section, columns), row, source, robot),
            _ => Ok(Vec::new()),
        }
    }
}

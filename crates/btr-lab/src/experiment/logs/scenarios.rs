//! Recorded logs as scenarios: each log brings its commands, its start and whatever the index knows of it.

use super::pieces;
use super::pieces::{LogPiece, about};
use super::source::LogSource;
use super::start::starts;
use crate::experiment::file::{Choice, ColumnSection, File, LogsSection};
use crate::experiment::parse::{FileError, Source, nearest};
use btr_core::log::{Log, LogError, interpolate};
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth;
use btr_physics::drive::Replay;
use btr_physics::model::Scenario;
use btr_physics::model::parameter::Target;
use btr_physics::robot::{Actuator, Robot};
use indexmap::IndexMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The situations of an experiment; the first `learn` are there to learn from.
pub(crate) struct ScenarioSet {
    pub scenarios: Vec<Scenario>,
    pub learn: usize,
    pub logs: Vec<Log>,
    /// What their readers noticed and could live with.
    pub warnings: Vec<String>,
}

impl ScenarioSet {
    /// The usual case: one situation, whatever the controller.
    pub(crate) fn single(duration_s: f64) -> Self {
        let scenario = Scenario { name: "default".to_owned(), duration_s, ..Scenario::default() };
        ScenarioSet { scenarios: vec![scenario], learn: 1, logs: Vec::new(), warnings: Vec::new() }
    }
}

/// A log to be read, with its row of the index.
struct LogRequest {
    path: PathBuf,
    row: IndexRow,
    held_out: bool,
}

pub(crate) fn from_logs(
    section: &LogsSection,
    file: &File,
    source: &Source,
    robot: &Robot,
) -> Result<ScenarioSet, FileError> {
    let mut wanted = listed(section, source);
    if let Some(index) = &section.index {
        wanted.extend(indexed(section, &source.folder().join(index), source)?);
    }
    wanted.sort_by_key(|w| w.held_out);
    if let Some(both) = wanted.iter().find(|w| w.held_out && wanted.iter().any(|o| !o.held_out && o.path == w.path)) {
        let message = format!("{} is to be learnt from and held out at once", both.path.display());
        return Err(source.error(&["reality"], &message, None));
    }
    if wanted.iter().all(|w| w.held_out) {
        let help = "name files, or an index with learn = { column = value }".to_owned();
        return Err(source.error(&["reality"], "no log to learn from", Some(help)));
    }
    let mut all = ScenarioSet::none();
    for one in &wanted {
        let (log, noticed) = pieces::read(&LogSource::File(one.path.clone()), file)?;
        all.notice(&one.path, noticed);
        let settings = settings(("reality", &section.columns), &one.row, source, robot)?;
        all.add(&one.path, &log, !one.held_out, &settings, &ScenarioReader { file, source, robot })?;
    }
    Ok(all)
}

/// What it takes to make a situation of a log.
pub(super) struct ScenarioReader<'a> {
    pub file: &'a File,
    pub source: &'a Source,
    pub robot: &'a Robot,
}

impl ScenarioSet {
    pub(super) fn none() -> Self {
        ScenarioSet { scenarios: Vec::new(), learn: 0, logs: Vec::new(), warnings: Vec::new() }
    }

    pub(super) fn notice(&mut self, path: &Path, noticed: impl IntoIterator<Item = String>) {
        self.warnings.extend(noticed.into_iter().map(|warning| format!("{}: {warning}", path.display())));
    }

    /// Adds a log, in pieces where it has gaps; those to learn from have to be added first. The largest noise floor of torques
    /// that were smoothed, if there are any.
    pub(super) fn add(
        &mut self,
        path: &Path,
        log: &Log,
        learn: bool,
        settings: &[(Target, f64)],
        reader: &ScenarioReader,
    ) -> Result<Option<f64>, FileError> {
        self.notice(path, doubts(log, reader.file));
        let (pieces, noticed) = pieces::pieces(path, log)?;
        self.notice(path, noticed);
        let mut floor = None;
        for mut piece in pieces {
            self.scenarios.push(Scenario { settings: settings.to_vec(), ..reader.compared(&piece)? });
            floor = smooth_needed(&mut piece.log, reader.robot).into_iter().chain(floor).reduce(f64::max);
            self.logs.push(piece.log);
        }
        if learn {
            self.learn = self.scenarios.len();
        }
        Ok(floor)
    }
}

/// Smooths the measured torques of joints that follow their measured motion, as those that the motion needs are: what is
/// left to compare is of the same bandwidth. The largest noise floor that they had, if there are any.
fn smooth_needed(log: &mut Log, robot: &Robot) -> Option<f64> {
    let clock_s = log.clock_s().to_vec();
    let mut floor = None;
    let joints = robot.movable().map(|(_, link)| &link.joint);
    for joint in joints.filter(|joint| joint.actuator == Actuator::Prescribed) {
        if let Some(torques) = log.values_mut(&format!("tau_{}", joint.name)) {
            let sigma = NoiseEstimate::of(torques).map_or(0.0, |noise| noise.sigma());
            floor = Some(sigma.max(floor.unwrap_or(0.0)));
            if let Some(sampling) = &joint.sampling {
                // What is held from its instant on acts half a period later on average.
                let acted_s: Vec<f64> = clock_s.iter().map(|t| t + 0.5 * sampling.period_s).collect();
                let acted = interpolate(&acted_s, torques, &clock_s);
                torques.copy_from_slice(&acted);
            }
            smooth::in_place(&clock_s, torques);
        }
    }
    floor
}

/// What is odd about a log, though it can be used.
fn doubts(log: &Log, file: &File) -> Vec<String> {
    let mut doubts = Vec::new();
    let silent = log.channels().filter(|(_, channel)| channel.values.iter().all(|x| x.is_nan()));
    doubts.extend(silent.map(|(name, _)| format!("`{name}` has no value at all")));
    let simulation = &file.simulation;
    let dt_s = simulation.control_s.map(|control_s| control_s / f64::from(simulation.steps_per_control));
    if let Some((step_s, dt_s)) = log.usual_step_s().zip(dt_s).filter(|(step_s, dt_s)| rarer(*dt_s, *step_s)) {
        doubts.push(format!(
            "a command every {step_s:.4} s, but the model takes one step in {dt_s:.4} s (simulation.control_s / steps_per_control)"
        ));
    }
    doubts
}

/// Whether what has this period misses some of what happens once in another one.
pub(crate) fn rarer(period_s: f64, other_s: f64) -> bool {
    period_s > 1.5 * other_s
}

fn listed(section: &LogsSection, source: &Source) -> Vec<LogRequest> {
    let wanted = |held_out: bool| {
        move |path: &PathBuf| LogRequest { path: source.folder().join(path), row: IndexMap::new(), held_out }
    };
    section.files.iter().map(wanted(false)).chain(section.held_out.iter().map(wanted(true))).collect()
}

/// The rows of the index that `learn` or `judge` choose. A log that both choose would be judged on what it was learnt from.
fn indexed(section: &LogsSection, index: &Path, source: &Source) -> Result<Vec<LogRequest>, FileError> {
    let rows = read_index(index, source, "reality")?;
    let folder = index.parent().unwrap_or(Path::new(""));
    let mut wanted = Vec::new();
    for (line, row) in rows {
        let name = row.get("file").ok_or_else(|| no_file_column(index, line))?;
        let no_column = |key: &str, column: &str| no_column(source, ("reality", key), column, &row);
        let learn = chosen(&row, &section.learn).map_err(|column| no_column("learn", &column))?;
        let judge = chosen(&row, &section.judge).map_err(|column| no_column("judge", &column))?;
        let judge = judge && !section.judge.is_empty();
        if learn && judge {
            return Err(at_line(index, line, "both `learn` and `judge` choose this log"));
        }
        if learn || judge {
            wanted.push(LogRequest { path: folder.join(name), row, held_out: judge });
        }
    }
    Ok(wanted)
}

fn at_line(index: &Path, line: usize, message: &str) -> FileError {
    FileError { path: index.to_owned(), line, column: 0, message: message.to_owned(), help: None }
}

pub(super) fn no_file_column(index: &Path, line: usize) -> FileError {
    at_line(index, line, "the index has no column `file`")
}

/// A row of an index: cell by column.
pub(super) type IndexRow = IndexMap<String, String>;

/// The rows of the index of `section`, with their lines.
pub(super) fn read_index(index: &Path, source: &Source, section: &str) -> Result<Vec<(usize, IndexRow)>, FileError> {
    let unreadable = |e: csv::Error| {
        let message = format!("{}: {e}", index.display());
        let help = format!(
            "{section}.index is taken from the experiment file's folder; point it to where the data is, or use --set \
             {section}.index=PATH"
        );
        source.error(&[section, "index"], &message, Some(help))
    };
    let mut reader = csv::Reader::from_path(index).map_err(unreadable)?;
    let columns: Vec<String> = reader.headers().map_err(unreadable)?.iter().map(str::to_owned).collect();
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(unreadable)?;
        let line = record.position().map_or(0, |p| p.line() as usize);
        rows.push((line, columns.iter().cloned().zip(record.iter().map(str::to_owned)).collect()));
    }
    Ok(rows)
}

/// Whether a row meets all conditions; the name of a column that is not there.
fn chosen(row: &IndexRow, conditions: &IndexMap<String, Choice>) -> Result<bool, String> {
    for (column, choice) in conditions {
        let cell = row.get(column).ok_or_else(|| column.clone())?;
        let number: Option<f64> = cell.trim().parse().ok();
        let same = |x: &f64| number.is_some_and(|n| (n - x).abs() <= 1e-9 * x.abs().max(1.0));
        let met = match choice {
            Choice::Text(text) => cell == text,
            Choice::Texts(texts) => texts.contains(cell),
            Choice::Number(x) => same(x),
            Choice::Numbers(numbers) => numbers.iter().any(same),
        };
        if !met {
            return Ok(false);
        }
    }
    Ok(true)
}

fn no_column(source: &Source, (section, key): (&str, &str), column: &str, row: &IndexRow) -> FileError {
    let help = match nearest(column, row.keys().map(String::as_str)) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("it has: {}", row.keys().cloned().collect::<Vec<_>>().join(", ")),
    };
    source.error(&[section, key, column], &format!("the index has no column `{column}`"), Some(help))
}

/// What the columns of a row set.
pub(super) fn settings(
    (section, columns): (&str, &IndexMap<String, ColumnSection>),
    row: &IndexRow,
    source: &Source,
    robot: &Robot,
) -> Result<Vec<(Target, f64)>, FileError> {
    columns.iter().map(|(target, column)| setting((section, target), column, row, source, robot)).collect()
}

impl ScenarioReader<'_> {
    /// The situation of a log that a simulation is to be compared with; what is known of the log beside that is yet to be set.
    fn compared(&self, piece: &LogPiece) -> Result<Scenario, FileError> {
        let replaying = self.replaying(piece)?;
        match self.missing_position(&piece.log) {
            Some(e) => Err(self.lacking(&piece.path, &e)),
            None => Ok(replaying),
        }
    }

    /// The situation of a log: its commands, its duration, its start.
    pub(super) fn replaying(&self, piece: &LogPiece) -> Result<Scenario, FileError> {
        Ok(Scenario {
            name: piece.name.clone(),
            replay: Some(Arc::new(Replay::new(&piece.log, self.robot))),
            duration_s: piece.log.duration_s(),
            begins_s: piece.begins_s,
            start: starts(&piece.log, self.robot).map_err(|e| self.lacking(&piece.path, &e))?,
            ..Scenario::default()
        })
    }

    /// What a log needs beside its commands, if a simulation is to be compared with it: a position of some joint, and
    /// those that the file says where to find.
    fn missing_position(&self, log: &Log) -> Option<LogError> {
        let position = |joint: &str| log.values(&format!("q_{joint}"));
        let joints = || self.robot.movable().map(|(_, link)| link.joint.name.as_str());
        let blind = joints().all(|joint| position(joint).is_err());
        let promised = |joint: &&str| self.file.channels.channels.contains_key(&format!("q_{joint}"));
        joints().filter(|joint| blind || promised(joint)).find_map(|joint| position(joint).err())
    }

    /// A channel that the log does not have, with what it has: at its line where the file says where to find it.
    fn lacking(&self, path: &Path, error: &LogError) -> FileError {
        let LogError::Missing { channel, available } = error else { return about(path, &error.to_string(), None) };
        let has = format!("it has: {}", available.join(", "));
        match self.file.channels.theirs(channel) {
            Some((key, theirs)) => {
                let message = format!("{} has no column `{theirs}`, which is to be `{channel}`", path.display());
                self.source.error(&["channels", "channels", key], &message, Some(has))
            }
            None => {
                let help = format!("{has}; [channels.channels] in the model file maps foreign names");
                about(path, &error.to_string(), Some(help))
            }
        }
    }
}

fn setting(
    (section, name): (&str, &str),
    column: &ColumnSection,
    row: &IndexRow,
    source: &Source,
    robot: &Robot,
) -> Result<(Target, f64), FileError> {
    let keys = [section, "columns", name];
    let target = Target::parse(name, robot).map_err(|e| source.error(&keys, &e.to_string(), None))?;
    let cell = row.get(&column.column).ok_or_else(|| no_column(source, (section, "columns"), &column.column, row))?;
    let value: f64 = cell.trim().parse().map_err(|_| {
        source.error(&keys, &format!("column `{}` holds `{cell}`, which is not a number", column.column), None)
    })?;
    Ok((target, value * column.factor))
}

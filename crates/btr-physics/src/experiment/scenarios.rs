//! Recorded logs as scenarios: each log brings its commands, its start and whatever the index knows of it.

use super::file::{Choice, ColumnSection, File, LogsSection};
use super::parse::{FileError, Source, nearest};
use crate::drive::Replay;
use crate::io;
use crate::model::Scenario;
use crate::parameter::Target;
use crate::robot::{Actuator, Robot};
use btr_core::log::{Log, LogError, interpolate};
use btr_core::noise::Noise;
use btr_core::smooth;
use indexmap::IndexMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The situations of an experiment; the first `learn` are there to learn from.
pub(super) struct Situations {
    pub scenarios: Vec<Scenario>,
    pub learn: usize,
    pub logs: Vec<Log>,
    /// What their readers noticed and could live with.
    pub warnings: Vec<String>,
}

impl Situations {
    /// The usual case: one situation, whatever the controller.
    pub(super) fn single(duration_s: f64) -> Self {
        let scenario = Scenario { name: "default".to_owned(), duration_s, ..Scenario::default() };
        Situations { scenarios: vec![scenario], learn: 1, logs: Vec::new(), warnings: Vec::new() }
    }
}

/// A log to be read, with its row of the index.
struct Wanted {
    path: PathBuf,
    row: Row,
    held_out: bool,
}

pub(super) fn from_logs(
    section: &LogsSection,
    file: &File,
    source: &Source,
    robot: &Robot,
) -> Result<Situations, FileError> {
    let mut wanted = listed(section, source);
    if let Some(index) = &section.index {
        wanted.extend(indexed(section, &source.folder().join(index), source)?);
    }
    wanted.sort_by_key(|w| w.held_out);
    if let Some(both) = wanted.iter().find(|w| w.held_out && wanted.iter().any(|o| !o.held_out && o.path == w.path)) {
        let message = format!("{} is to be learnt from and held out at once", both.path.display());
        return Err(source.error(&["reality"], &message, None));
    }
    let learn = wanted.iter().filter(|w| !w.held_out).count();
    if learn == 0 {
        let help = "name files, or an index with learn = { column = value }".to_owned();
        return Err(source.error(&["reality"], "no log to learn from", Some(help)));
    }
    let (mut scenarios, mut logs, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for one in &wanted {
        let (mut log, noticed) = io::read_recorded(&one.path, &file.channels).map_err(|e| unreadable(source, &e))?;
        let noticed = noticed.iter().map(ToString::to_string).chain(doubts(&log, file));
        warnings.extend(noticed.map(|warning| format!("{}: {warning}", one.path.display())));
        let settings = settings(("reality", &section.columns), &one.row, source, robot)?;
        scenarios.push(Scenario { settings, ..compared(&one.path, &log, robot, source)? });
        smooth_needed(&mut log, robot);
        logs.push(log);
    }
    Ok(Situations { scenarios, learn, logs, warnings })
}

/// Smooths the measured torques of joints that follow their measured motion, as those that the motion needs are: what is
/// left to compare is of the same bandwidth. The largest noise floor that they had, if there are any.
pub(super) fn smooth_needed(log: &mut Log, robot: &Robot) -> Option<f64> {
    let clock_s = log.clock_s().to_vec();
    let mut floor = None;
    let joints = robot.movable().map(|(_, link)| &link.joint);
    for joint in joints.filter(|joint| joint.actuator == Actuator::Prescribed) {
        if let Some(torques) = log.values_mut(&format!("tau_{}", joint.name)) {
            let sigma = Noise::of(torques).map_or(0.0, |noise| noise.sigma());
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
pub(super) fn doubts(log: &Log, file: &File) -> Vec<String> {
    const LONG_STEP_S: f64 = 0.5;
    const GAP: f64 = 10.0;
    let mut doubts = Vec::new();
    let silent = log.channels().filter(|(_, channel)| channel.values.iter().all(|x| x.is_nan()));
    doubts.extend(silent.map(|(name, _)| format!("`{name}` has no value at all")));
    let Some(step) = log.usual_step_s() else { return doubts };
    let widest = log.clock_s().windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    if widest > GAP * step {
        doubts.push(format!("a gap of {widest:.3} s between samples that are usually {step:.4} s apart"));
    }
    if step > LONG_STEP_S {
        doubts.push(format!("{step:.3} s between samples: is its time in seconds?"));
    }
    if let Some(control_s) = file.simulation.control_s.filter(|control_s| *control_s > 1.5 * step) {
        doubts.push(format!(
            "a command every {step:.4} s, but the model takes one every {control_s} s (simulation.control_s)"
        ));
    }
    doubts
}

pub(super) fn unreadable(source: &Source, error: &io::IoError) -> FileError {
    source.error(&["reality"], &error.to_string(), Some(error.help()))
}

fn listed(section: &LogsSection, source: &Source) -> Vec<Wanted> {
    let wanted = |held_out: bool| {
        move |path: &PathBuf| Wanted { path: source.folder().join(path), row: IndexMap::new(), held_out }
    };
    section.files.iter().map(wanted(false)).chain(section.held_out.iter().map(wanted(true))).collect()
}

/// The rows of the index that `learn` or `judge` choose. A log that both choose would be judged on what it was learnt from.
fn indexed(section: &LogsSection, index: &Path, source: &Source) -> Result<Vec<Wanted>, FileError> {
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
            wanted.push(Wanted { path: folder.join(name), row, held_out: judge });
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
pub(super) type Row = IndexMap<String, String>;

/// The rows of the index of `section`, with their lines.
pub(super) fn read_index(index: &Path, source: &Source, section: &str) -> Result<Vec<(usize, Row)>, FileError> {
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
fn chosen(row: &Row, conditions: &IndexMap<String, Choice>) -> Result<bool, String> {
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

fn no_column(source: &Source, (section, key): (&str, &str), column: &str, row: &Row) -> FileError {
    let help = match nearest(column, row.keys().map(String::as_str)) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("it has: {}", row.keys().cloned().collect::<Vec<_>>().join(", ")),
    };
    source.error(&[section, key, column], &format!("the index has no column `{column}`"), Some(help))
}

/// The situation of a log that a simulation is to be compared with; what is known of the log beside that is yet to be set.
pub(super) fn compared(path: &Path, log: &Log, robot: &Robot, source: &Source) -> Result<Scenario, FileError> {
    let replaying = replaying(path, log, robot, source)?;
    match missing_position(log, robot) {
        Some(e) => Err(lacking(path, source, &e)),
        None => Ok(replaying),
    }
}

/// What the columns of a row set.
pub(super) fn settings(
    (section, columns): (&str, &IndexMap<String, ColumnSection>),
    row: &Row,
    source: &Source,
    robot: &Robot,
) -> Result<Vec<(Target, f64)>, FileError> {
    columns.iter().map(|(target, column)| setting((section, target), column, row, source, robot)).collect()
}

/// The situation of a log: its commands, its duration, its start.
pub(super) fn replaying(path: &Path, log: &Log, robot: &Robot, source: &Source) -> Result<Scenario, FileError> {
    if log.len() < 2 {
        let message = format!("{}: a log needs at least two samples", path.display());
        return Err(source.error(&["reality"], &message, None));
    }
    Ok(Scenario {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        replay: Some(Arc::new(Replay::new(log, robot))),
        duration_s: log.duration_s(),
        settings: Vec::new(),
        start: start(log, robot).map_err(|e| lacking(path, source, &e))?,
        ..Scenario::default()
    })
}

fn setting(
    (section, name): (&str, &str),
    column: &ColumnSection,
    row: &Row,
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

/// A channel that the log does not have, with what it has.
fn lacking(path: &Path, source: &Source, error: &LogError) -> FileError {
    let available = match error {
        LogError::Missing { available, .. } => {
            Some(format!("it has: {}; [channels] in the experiment file maps foreign names", available.join(", ")))
        }
        _ => None,
    };
    source.error(&["reality"], &format!("{}: {error}", path.display()), available)
}

/// What a log needs beside its commands, if a simulation is to be compared with it.
fn missing_position(log: &Log, robot: &Robot) -> Option<LogError> {
    robot.movable().find_map(|(_, link)| log.values(&format!("q_{}", link.joint.name)).err())
}

/// Position and velocity of every joint at the start; the robot's own where the log does not have them. A log that does not
/// say what a joint was told cannot be replayed.
fn start(log: &Log, robot: &Robot) -> Result<Vec<(f64, f64)>, LogError> {
    robot
        .movable()
        .map(|(_, link)| {
            let joint = &link.joint;
            if joint.actuator != Actuator::Prescribed {
                log.values(&format!("cmd_{}", joint.name))?;
            }
            Ok(start_of(log, &joint.name).unwrap_or((joint.start, 0.0)))
        })
        .collect()
}

/// Where a joint is when the log begins, and how fast it moves: as the first positions together tell: a single
/// reading errs by the sensor's noise, and a difference of two by far more. A log without noise is taken at its word.
fn start_of(log: &Log, joint: &str) -> Option<(f64, f64)> {
    let first = |prefix: &str| {
        let channel = log.channel(&format!("{prefix}_{joint}"))?;
        channel.values.iter().copied().find(|x| x.is_finite())
    };
    let reading = (first("q")?, first("dq").unwrap_or(0.0));
    let positions = &log.channel(&format!("q_{joint}"))?.values;
    let Some(noise) = Noise::of(positions).filter(|noise| !noise.is_negligible()) else { return Some(reading) };
    let begin = smooth::start(log.clock_s(), positions, noise.sigma());
    Some(begin.map_or(reading, |motion| (motion.value, motion.velocity)))
}

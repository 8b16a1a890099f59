//! Which columns of logs are the joints' channels.

use super::column::{Column, Unit};
use super::noise::ShownNoise;
use super::units;
use super::words::{Kind, distinctive, is_time, kind_of, words};
use crate::failure::Failure;
use btr_core::log::Log;
use btr_io::{ForeignName, IoError, Mapping, TimeUnit};
use btr_physics::robot::Robot;
use indexmap::IndexSet;
use std::path::{Path, PathBuf};

/// Names of time columns that need no mapping.
const KNOWN_TIMES: [&str; 4] = ["t", "t_s", "time", "time_s"];

/// The columns of logs that are the joints' channels.
#[derive(Default)]
pub struct LogColumns {
    /// The time column, where it needs a mapping.
    pub(super) time: Option<String>,
    /// Its unit, where that is guessed from its steps.
    pub(super) time_unit: Option<TimeUnit>,
    pub(super) columns: Vec<Column>,
    /// Columns that are no channel of a joint.
    pub(super) unmatched: Vec<String>,
    /// Guesses, in words.
    pub(super) told: Vec<String>,
    /// The noise of its columns.
    pub(super) noise: ShownNoise,
    /// What logs lack, in words.
    pub(super) lacking: Vec<String>,
}

/// A log, and what its columns are called.
struct NamedLog {
    path: PathBuf,
    names: Vec<String>,
}

impl LogColumns {
    /// The columns of all logs. Units are those of the log that has most of the columns.
    ///
    /// # Errors
    /// A log that cannot be read; one in which no joint is found.
    pub fn matched(logs: &[PathBuf], robot: &Robot) -> Result<Self, Failure> {
        let mut told = Vec::new();
        let mut read = |path: &PathBuf| match btr_io::first_episode(path).map_err(unreadable)? {
            Some((first, episodes)) => {
                let set = path.display();
                told.push(format!(
                    "{set} has {episodes} episodes: columns and units are those of the first; a log of it is called {set}#0"
                ));
                NamedLog::read(first)
            }
            None => NamedLog::read(path.clone()),
        };
        let logs = logs.iter().map(&mut read).collect::<Result<Vec<_>, _>>()?;
        let Some(first) = logs.first() else { return Ok(LogColumns::default()) };
        for log in &logs {
            let mut alone = LogColumns { time: time_of(&log.names), ..LogColumns::default() };
            alone.match_names(&log.names, robot);
            if alone.columns.is_empty() {
                return Err(nothing_found(&log.path, &log.names, robot));
            }
        }
        let all: IndexSet<&String> = logs.iter().flat_map(|log| &log.names).collect();
        let all: Vec<String> = all.into_iter().cloned().collect();
        let mut found = LogColumns { time: time_of(&first.names), told, ..LogColumns::default() };
        if found.time.is_none() && !KNOWN_TIMES.iter().any(|t| first.names.iter().any(|name| name == t)) {
            found.time = first.only_clock();
            found.told.extend(found.time.iter().map(|name| format!("{name} is the clock: no other column only grows")));
        }
        found.match_names(&all, robot);
        found.lacking = logs.iter().filter_map(|log| found.lacking_in(log)).collect();
        let without = |kind: Kind| found.joints_without(kind, robot);
        let without: Vec<String> = [Kind::Command, Kind::Position].into_iter().filter_map(without).collect();
        found.lacking.extend(without);
        found.lacking.extend(found.without_commands());
        let has = |log: &NamedLog| found.columns.iter().filter(|column| log.names.contains(&column.name)).count();
        // The first of those with most.
        let fullest = logs.iter().rev().max_by_key(|log| has(log)).unwrap_or(first);
        let log = found.read(fullest)?;
        if let Some(unit) = found.time_unit {
            found.told.push(format!("the clock counts {}, by its steps", unit.name()));
        }
        found.told.extend(units::guess(&mut found.columns, &log, robot));
        found.noise = ShownNoise::of(&found.columns, &log);
        Ok(found)
    }

    /// What a log lacks of the columns, in words.
    fn lacking_in(&self, log: &NamedLog) -> Option<String> {
        let used = self.columns.iter().map(|column| &column.name).chain(&self.time);
        let lacking: Vec<&str> = used.filter(|name| !log.names.contains(name)).map(String::as_str).collect();
        (!lacking.is_empty()).then(|| format!("{} lacks the columns {}", log.path.display(), lacking.join(", ")))
    }

    /// The joints without a column of a kind that others have, in words.
    fn joints_without(&self, kind: Kind, robot: &Robot) -> Option<String> {
        let has = |joint: usize| self.columns.iter().any(|column| column.joint == joint && column.kind == kind);
        let joints = robot.movable().enumerate().filter(|(joint, _)| !has(*joint));
        let without: Vec<&str> = joints.map(|(_, (_, link))| link.joint.name.as_str()).collect();
        let some = self.has(kind) && !without.is_empty();
        some.then(|| format!("no column has {} of {}", kind.what(), without.join(", ")))
    }

    /// What to do where joints would not move: neither commands nor torques are found.
    fn without_commands(&self) -> Option<String> {
        let moves = [Kind::Command, Kind::TorqueCommand, Kind::Torque].into_iter().any(|kind| self.has(kind));
        let example = self.columns.iter().find(|column| column.kind == Kind::Position).filter(|_| !moves)?;
        Some(format!(
            "no column has commands: write them into [channels.channels] as the positions are, cmd_<joint> instead of \
             q_<joint>; {} is taken as a measured position",
            example.name
        ))
    }

    /// Whether there is a column of this kind.
    pub(super) fn has(&self, kind: Kind) -> bool {
        self.columns.iter().any(|column| column.kind == kind)
    }

    /// Whether there are torques and no commands: joints then follow their measured motion.
    pub(super) fn lead_without_commands(&self) -> bool {
        self.has(Kind::Torque) && !self.has(Kind::Command) && !self.has(Kind::TorqueCommand)
    }

    /// The log with its raw numbers, each column under its own number: `x0`, `x1`, ...
    fn read(&mut self, NamedLog { path, names }: &NamedLog) -> Result<Log, Failure> {
        let raw = |(i, column): (usize, &Column)| {
            (format!("x{i}"), ForeignName::Scaled { column: column.name.clone(), factor: 1.0 })
        };
        let channels =
            self.columns.iter().enumerate().filter(|(_, column)| names.contains(&column.name)).map(raw).collect();
        let mut mapping = Mapping { time: self.time.clone(), channels, ..Mapping::default() };
        let read = |mapping: &Mapping| btr_io::read_log(path, mapping).map(|(log, _)| log).map_err(unreadable);
        let log = read(&mapping)?;
        self.time_unit = self.time.as_deref().or(Some("t")).and_then(|name| units::of_clock(name, &log));
        match self.time_unit {
            None => Ok(log),
            Some(_) => {
                mapping.time_unit = self.time_unit;
                read(&mapping)
            }
        }
    }

    fn match_names(&mut self, names: &[String], robot: &Robot) {
        let joints: Vec<&str> = robot.movable().map(|(_, link)| link.joint.name.as_str()).collect();
        let own = distinctive(&joints);
        let time =
            self.time.as_deref().or_else(|| KNOWN_TIMES.into_iter().find(|t| names.iter().any(|name| name == t)));
        let columns: Vec<&String> = names.iter().filter(|name| Some(name.as_str()) != time).collect();
        // What says least beside joint and quantity is meant.
        let mut matches: Vec<(&String, Match)> =
            columns.iter().filter_map(|name| Some((*name, by_name(&words(name), &joints, &own)?))).collect();
        matches.sort_by_key(|(_, matched)| matched.further_words);
        for (name, Match { joint, kind, .. }) in matches {
            if !self.columns.iter().any(|known| known.joint == joint && known.kind.prefix() == kind.prefix()) {
                self.columns.push(Column { name: (*name).clone(), joint, kind, unit: Unit::Native });
            }
        }
        if self.columns.is_empty() {
            self.match_in_order(&columns, &joints);
        }
        let is_matched = |name: &String| self.columns.iter().any(|column| column.name == *name);
        self.unmatched = columns.into_iter().filter(|name| !is_matched(name)).cloned().collect();
    }

    /// Columns that are numbered as the joints are: the first is the first joint's.
    fn match_in_order(&mut self, columns: &[&String], joints: &[&str]) {
        for NumberedColumns { kind, mut columns, .. } in numbered(columns) {
            if columns.len() != joints.len() {
                continue;
            }
            if self.has(kind) {
                let (first, what) = (&columns[0].1, kind.what());
                self.told.push(format!("{first} and those like it look like {what} as well, and are left out"));
                continue;
            }
            columns.sort_by_key(|(number, _)| *number);
            let names = || columns.iter().map(|(_, name)| name.clone());
            let column = |(joint, name)| Column { name, joint, kind, unit: Unit::Native };
            self.columns.extend(names().enumerate().map(column));
            let pairs: Vec<String> = names().zip(joints).map(|(name, joint)| format!("{name} = {joint}")).collect();
            self.told.push(format!("{} in the order of the joints: {}", kind.what(), pairs.join(", ")));
        }
    }
}

impl NamedLog {
    fn read(path: PathBuf) -> Result<Self, Failure> {
        let names = match btr_io::column_names(&path).map_err(unreadable)? {
            Some(names) => names,
            None => {
                let (log, _) = btr_io::read_log(&path, &Mapping::default()).map_err(unreadable)?;
                log.channels().map(|(name, _)| name.to_owned()).collect()
            }
        };
        Ok(NamedLog { path, names })
    }
}

impl NamedLog {
    /// The only column that can be a clock: its numbers only grow.
    fn only_clock(&self) -> Option<String> {
        let grows = |name: &&String| {
            let mapping = Mapping { time: Some((*name).clone()), ..Mapping::default() };
            btr_io::read_log(&self.path, &mapping).is_ok()
        };
        let mut clocks = self.names.iter().filter(grows);
        let first = clocks.next()?;
        clocks.next().is_none().then(|| first.clone())
    }
}

/// Columns whose names differ in a number alone.
struct NumberedColumns {
    stem: Vec<String>,
    kind: Kind,
    /// Numbers and names.
    columns: Vec<(u32, String)>,
}

/// Groups columns by what their names have beside a last number.
fn numbered(columns: &[&String]) -> Vec<NumberedColumns> {
    let mut groups: Vec<NumberedColumns> = Vec::new();
    for name in columns {
        let mut stem = words(name);
        let Some(at) = stem.iter().rposition(|word| word.parse::<u32>().is_ok()) else { continue };
        let (Ok(number), Some((kind, _))) = (stem.remove(at).parse(), kind_of(&stem)) else { continue };
        let column = (number, (*name).clone());
        match groups.iter_mut().find(|group| group.stem == stem) {
            Some(group) => group.columns.push(column),
            None => groups.push(NumberedColumns { stem, kind, columns: vec![column] }),
        }
    }
    groups
}

/// What the name of a column says.
struct Match {
    joint: usize,
    kind: Kind,
    /// The number of words that are neither the joint's nor a quantity's.
    further_words: usize,
}

/// The joint and the kind of a column, by the words of its name.
fn by_name(column: &[String], joints: &[&str], own: &[Vec<String>]) -> Option<Match> {
    let contains = |words: &[String], part: &[String]| words.windows(part.len().max(1)).any(|window| window == part);
    let full: Vec<Vec<String>> = joints.iter().map(|joint| words(joint)).collect();
    let longest = |found: Vec<usize>, names: &[Vec<String>]| found.into_iter().max_by_key(|&i| names[i].len());
    let exact = (0..joints.len()).filter(|&i| contains(column, &full[i])).collect();
    if let Some(joint) = longest(exact, &full) {
        let at = column.windows(full[joint].len()).position(|window| window == full[joint])?;
        let rest: Vec<String> = [&column[..at], &column[at + full[joint].len()..]].concat();
        let (kind, further) = kind_of(&rest)?;
        return Some(Match { joint, kind, further_words: further.len() });
    }
    let (kind, rest) = kind_of(column)?;
    if let ([_], []) = (joints, &rest[..]) {
        return Some(Match { joint: 0, kind, further_words: 0 });
    }
    // A number alone may be counted from 0 or from 1.
    let is_name = |words: &[String]| words.iter().any(|word| word.parse::<u32>().is_err());
    let similar = (0..joints.len()).filter(|&i| is_name(&own[i]) && contains(&rest, &own[i])).collect();
    longest(similar, own).map(|joint| Match { joint, kind, further_words: rest.len() - own[joint].len() })
}

/// The time column that needs a mapping, if there is one.
fn time_of(names: &[String]) -> Option<String> {
    if names.iter().any(|name| KNOWN_TIMES.contains(&name.as_str())) {
        return None;
    }
    names.iter().find(|name| is_time(name)).cloned()
}

fn unreadable(error: IoError) -> Failure {
    error.into()
}

fn nothing_found(path: &Path, names: &[String], robot: &Robot) -> Failure {
    let joints: Vec<&str> = robot.movable().map(|(_, link)| link.joint.name.as_str()).collect();
    let message = format!(
        "{}: none of its columns ({}) is one of the joints {}",
        path.display(),
        names.join(", "),
        joints.join(", ")
    );
    let help = "make the model without the log, and state in its [channels] which column is which";
    Failure::new("log", message, Some(help.into()))
}

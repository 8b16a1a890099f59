//! The logs that an experiment's `[reality]` lists, as scenarios.

use super::index::{IndexRow, at_line, no_column, no_file_column, read_index, settings};
use super::read::read;
use super::scenarios::{LogPurpose, ScenarioReader, ScenarioSet};
use super::source::LogSource;
use crate::experiment::file::{Choice, File, LogsSection};
use crate::experiment::source::{FileError, Source};
use btr_physics::robot::Robot;
use indexmap::IndexMap;
use std::path::{Path, PathBuf};

/// A log to read, with its row of the index.
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
    let mut requests = listed(section, source);
    if let Some(index) = &section.index {
        requests.extend(indexed(section, &source.folder().join(index), source)?);
    }
    requests.sort_by_key(|w| w.held_out);
    if let Some(both) = requests.iter().find(|w| w.held_out && requests.iter().any(|o| !o.held_out && o.path == w.path))
    {
        let message = format!("{} is both a training log and held out", both.path.display());
        return Err(source.error(&["reality"], &message, None));
    }
    if requests.iter().all(|w| w.held_out) {
        let help = "name files, or an index with learn = { column = value }".into();
        return Err(source.error(&["reality"], "no training log", Some(help)));
    }
    let (mut all, mut followed_s) = (ScenarioSet::none(), None);
    for one in &requests {
        let log = read(&LogSource::File(one.path.clone()), file, robot, &mut followed_s)?;
        let settings = settings("reality", &section.columns, &one.row, source, robot)?;
        let purpose = if one.held_out { LogPurpose::HeldOut } else { LogPurpose::Training };
        all.add(&log, purpose, &settings, &ScenarioReader { file, source, robot })?;
    }
    Ok(all)
}

fn listed(section: &LogsSection, source: &Source) -> Vec<LogRequest> {
    let requests = |held_out: bool| {
        move |path: &PathBuf| LogRequest { path: source.folder().join(path), row: IndexMap::new(), held_out }
    };
    section.files.iter().map(requests(false)).chain(section.held_out.iter().map(requests(true))).collect()
}

/// The rows of the index that `learn` or `judge` select. A log that both select is an error: it cannot be training and
/// held out.
fn indexed(section: &LogsSection, index: &Path, source: &Source) -> Result<Vec<LogRequest>, FileError> {
    let rows = read_index(index, source, "reality")?;
    let folder = index.parent().unwrap_or(Path::new(""));
    let mut requests = Vec::new();
    for (line, row) in rows {
        let name = row.get("file").ok_or_else(|| no_file_column(index, line))?;
        let no_column = |key: &str, column: &str| no_column(source, "reality", key, column, &row);
        let learn = chosen(&row, &section.learn).map_err(|column| no_column("learn", &column))?;
        let judge = chosen(&row, &section.judge).map_err(|column| no_column("judge", &column))?;
        let judge = judge && !section.judge.is_empty();
        if learn && judge {
            return Err(at_line(index, line, "both `learn` and `judge` choose this log"));
        }
        if learn || judge {
            requests.push(LogRequest { path: folder.join(name), row, held_out: judge });
        }
    }
    Ok(requests)
}

/// Whether a row meets all conditions; on error the name of the missing column.
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

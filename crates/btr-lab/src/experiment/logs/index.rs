//! An index of logs: a table with one log per row, and what its columns set.

use crate::experiment::file::{ColumnSection, File, RealitySection};
use crate::experiment::source::{FileError, Source};
use crate::suggest::nearest;
use btr_core::limits::MOST_CELLS;
use btr_core::text::{Mention, Text};
use btr_physics::model::parameter::Target;
use btr_physics::robot::Robot;
use indexmap::IndexMap;
use std::path::{Path, PathBuf};

/// The rows of an index of logs.
pub(crate) struct IndexEntries<'a> {
    section: &'static str,
    rows: Vec<(PathBuf, IndexRow)>,
    columns: Option<&'a IndexMap<String, ColumnSection>>,
    /// The column that says which logs are runs of the same command.
    repeats: Option<&'a str>,
}

impl<'a> IndexEntries<'a> {
    pub(crate) fn of(file: &'a File, source: &Source) -> Result<Self, FileError> {
        let (section, index, columns) = match (&file.logs, &file.reality) {
            (Some(logs), _) => ("logs", Some(&logs.index), &logs.columns),
            (None, Some(RealitySection::Logs(logs))) => ("reality", logs.index.as_ref(), &logs.columns),
            _ => return Ok(IndexEntries { section: "logs", rows: Vec::new(), columns: None, repeats: None }),
        };
        let repeats = file.logs.as_ref().and_then(|logs| logs.repeats.as_deref());
        // Without columns the index only lists the logs, and these have been named.
        let Some(index) = index.filter(|_| !columns.is_empty() || repeats.is_some()) else {
            return Ok(IndexEntries { section, rows: Vec::new(), columns: None, repeats });
        };
        let index = source.folder().join(index);
        let folder = index.parent().unwrap_or(Path::new(""));
        let mut rows = Vec::new();
        for (line, row) in read_index(&index, source, section)? {
            let name = row.get("file").ok_or_else(|| no_file_column(&index, line))?;
            rows.push((folder.join(name), row));
        }
        Ok(IndexEntries { section, rows, columns: Some(columns), repeats })
    }

    /// The cell that the log shares with other runs of its command, if the index has such a column.
    pub(crate) fn repeats(&self, log: &Path, source: &Source) -> Result<Option<String>, FileError> {
        let (Some(column), Some(row)) = (self.repeats, self.row(log)) else { return Ok(None) };
        let cell = row.get(column).ok_or_else(|| no_repeats_column(source, column, row))?;
        Ok(Some(cell.trim().to_owned()).filter(|cell| !cell.is_empty()))
    }

    /// The row of a log by its path, or else by its file name, for logs that were copied to another folder.
    fn row(&self, log: &Path) -> Option<&IndexRow> {
        let same = |path: &Path| path.canonicalize().ok().is_some_and(|p| log.canonicalize().is_ok_and(|l| l == p));
        let by_path = self.rows.iter().find(|(path, _)| same(path));
        by_path.or_else(|| self.rows.iter().find(|(path, _)| path.file_name() == log.file_name())).map(|(_, row)| row)
    }

    pub(crate) fn misses(&self, log: &Path) -> Option<String> {
        let unknown = self.columns.is_some() && self.row(log).is_none();
        unknown.then(|| "it is not in the index; the parameters that the index sets keep the model's values".to_owned())
    }

    /// The parameters that the log's row sets; none if the index has no row for it.
    pub(crate) fn settings(&self, log: &Path, robot: &Robot, source: &Source) -> Result<Vec<(Target, f64)>, FileError> {
        match (self.row(log), self.columns) {
            (Some(row), Some(columns)) => settings(self.section, columns, row, source, robot),
            _ => Ok(Vec::new()),
        }
    }
}

pub(super) fn at_line(index: &Path, line: usize, message: &str) -> FileError {
    FileError { path: index.to_owned(), line, column: 0, message: message.into(), help: None }
}

pub(super) fn no_file_column(index: &Path, line: usize) -> FileError {
    at_line(index, line, "the index has no column `file`")
}

/// A row of an index: cell by column.
pub(super) type IndexRow = IndexMap<String, String>;

/// The rows of the index of `section`, with their lines.
pub(super) fn read_index(index: &Path, source: &Source, section: &str) -> Result<Vec<(usize, IndexRow)>, FileError> {
    let unreadable = |e: &dyn std::fmt::Display| {
        let message = format!("{}: {e}", index.display());
        let key = format!("{section}.index");
        let from = format!("{key} is taken from the experiment file's folder; point it to where the data is, or ");
        let help = Text::from(from) + Mention::Set { key, value: "PATH" };
        source.error(&[section, "index"], &message, Some(help))
    };
    let text = btr_io::read_text(index).map_err(|e| unreadable(&e))?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let columns: Vec<String> = reader.headers().map_err(|e| unreadable(&e))?.iter().map(str::to_owned).collect();
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| unreadable(&e))?;
        if (rows.len() + 1).saturating_mul(columns.len()) > MOST_CELLS {
            return Err(unreadable(&format!("more than {MOST_CELLS} cells, the most that is read")));
        }
        let line = record.position().map_or(0, |p| p.line() as usize);
        rows.push((line, columns.iter().cloned().zip(record.iter().map(str::to_owned)).collect()));
    }
    Ok(rows)
}

fn no_repeats_column(source: &Source, column: &str, row: &IndexRow) -> FileError {
    let has = format!("it has: {}", row.keys().cloned().collect::<Vec<_>>().join(", "));
    source.error(&["logs", "repeats"], &format!("the index has no column `{column}`"), Some(has.into()))
}

pub(super) fn no_column(source: &Source, section: &str, key: &str, column: &str, row: &IndexRow) -> FileError {
    let help = match nearest(column, row.keys().map(String::as_str)) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("it has: {}", row.keys().cloned().collect::<Vec<_>>().join(", ")),
    };
    source.error(&[section, key, column], &format!("the index has no column `{column}`"), Some(help.into()))
}

/// The parameters that the columns of a row set.
pub(super) fn settings(
    section: &str,
    columns: &IndexMap<String, ColumnSection>,
    row: &IndexRow,
    source: &Source,
    robot: &Robot,
) -> Result<Vec<(Target, f64)>, FileError> {
    columns.iter().map(|(target, column)| setting(section, target, column, row, source, robot)).collect()
}

fn setting(
    section: &str,
    name: &str,
    column: &ColumnSection,
    row: &IndexRow,
    source: &Source,
    robot: &Robot,
) -> Result<(Target, f64), FileError> {
    let keys = [section, "columns", name];
    let target = Target::parse(name, robot).map_err(|e| source.error(&keys, &e.to_string(), None))?;
    let cell = row.get(&column.column).ok_or_else(|| no_column(source, section, "columns", &column.column, row))?;
    let value: f64 = cell.trim().parse().map_err(|_| {
        source.error(&keys, &format!("column `{}` holds `{cell}`, which is not a number", column.column), None)
    })?;
    Ok((target, value * column.factor))
}

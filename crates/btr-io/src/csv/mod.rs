//! Logs as CSV: a header, a column `t` in seconds, one column per channel; empty cells are missing samples. The meaning
//! of a missing command is decided by the simulation.
//!
//! Cells are separated by commas, semicolons or tabs; with the latter two, numbers may have commas ([`style`]).
//! Limitations: UTF-8. Headers are written without units, so a channel whose
//! unit is not the usual one of its name (a slide's `q_slider` in m) reads back with the usual one; MCAP keeps units.

mod style;

use self::style::Style;
use super::error::{IoError, Warning};
use crate::channels::mapping::Mapping;
use crate::channels::names::{Meaning, header};
use crate::channels::series::{NamedSeries, assemble, check_size};
use btr_core::limits::LONGEST_LINE;
use btr_core::log::{Log, Role};
use csv::StringRecord;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

/// Names of the time column that are recognised without a mapping.
pub(super) const TIME: [&str; 4] = ["t", "t_s", "time", "time_s"];

/// Bytes of a file's beginning that show its style.
const BEGINNING: usize = 1 << 16;

/// Reads a log. `path` is used in messages only.
pub(crate) fn read(path: &Path, bytes: impl Read, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    let broken = |e: csv::Error| broken(path, e);
    let (style, mut reader) = reader(path, bytes)?;
    let mut table = CsvColumns::new(path, reader.headers().map_err(broken)?, mapping, style)?;
    let expected = table.columns.len();
    let mut row = StringRecord::new();
    let mut short = None;
    while reader.read_record(&mut row).map_err(broken)? {
        // A record's position lies before the empty lines that were skipped to reach it.
        let line = row.position().map_or(0, csv::Position::line).max(reader.position().line() - 1);
        let got = row.len();
        let misfit = short.or((got > expected).then_some((line, got)));
        if let Some((line, got)) = misfit {
            return Err(IoError::Cells { path: path.to_owned(), line, expected, got });
        }
        if got < expected {
            // A killed logger leaves an incomplete last line, which is accepted; anything after it is an error.
            short = Some((line, got));
        } else {
            table.push(line, &row)?;
            check_size(path, table.clock_s.len(), expected)?;
        }
    }
    table.into_log(mapping, short.map(|(line, _)| Warning::LastLineCut { line }))
}

/// The names in the header.
pub(crate) fn columns(path: &Path, bytes: impl Read) -> Result<Vec<String>, IoError> {
    let (_, mut reader) = reader(path, bytes)?;
    let header = reader.headers().map_err(|e| broken(path, e))?;
    if header.is_empty() {
        return Err(IoError::Empty { path: path.to_owned() });
    }
    Ok(header.iter().map(str::to_owned).collect())
}

/// The rows of a file.
type Rows<R> = csv::Reader<BufReader<Lines<R>>>;

/// A reader of rows, and how their cells are written.
fn reader<R: Read>(path: &Path, bytes: R) -> Result<(Style, Rows<R>), IoError> {
    let mut bytes = BufReader::with_capacity(BEGINNING, Lines { bytes, length: 0 });
    let style = Style::of(&mut bytes).map_err(|source| IoError::File { path: path.to_owned(), source })?;
    // Cells are trimmed on demand: trimming in csv would allocate a record per row.
    let mut builder = csv::ReaderBuilder::new();
    builder.delimiter(style.separator).trim(csv::Trim::Headers).flexible(true);
    Ok((style, builder.from_reader(bytes)))
}

/// An error of the file that is read, or of its text.
fn broken(path: &Path, error: csv::Error) -> IoError {
    let (path, what) = (path.to_owned(), error.to_string());
    match error.into_kind() {
        csv::ErrorKind::Io(source) => IoError::File { path, source },
        _ => IoError::Csv { path, what },
    }
}

/// Bytes whose lines are not too long: a line is kept as a whole.
struct Lines<R> {
    bytes: R,
    /// Length of the present line so far.
    length: usize,
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.bytes.read(buffer)?;
        let last = buffer[..count].iter().rposition(|byte| *byte == b'\n');
        self.length = last.map_or(self.length + count, |end| count - end - 1);
        if self.length > LONGEST_LINE {
            let what = format!("a line is longer than {} MB, the most that is read", LONGEST_LINE >> 20);
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        Ok(count)
    }
}

/// The columns read so far.
struct CsvColumns<'a> {
    path: &'a Path,
    time: usize,
    seconds_per_unit: f64,
    clock_s: Vec<f64>,
    columns: Vec<CsvColumn>,
    style: Style,
}

struct CsvColumn {
    source: String,
    meaning: Meaning,
    /// Whether the column is needed: mapped, or one of btr's names.
    required: bool,
    values: Vec<f64>,
    /// Line and text of the first cell that is not a number.
    text: Option<(u64, String)>,
}

impl CsvColumn {
    fn new(source: &str, mapping: &Mapping) -> Self {
        let mapped = mapping.meaning(source);
        let switch = mapping.switch_names().any(|(_, name)| name == source);
        let mapped_name = mapped.is_some() || switch;
        let meaning = mapped.unwrap_or_else(|| Meaning::of_header(source));
        let required = mapped_name || meaning.role != Role::Truth;
        CsvColumn { source: source.to_owned(), meaning, required, values: Vec::new(), text: None }
    }
}

impl<'a> CsvColumns<'a> {
    fn new(path: &'a Path, header: &StringRecord, mapping: &Mapping, style: Style) -> Result<Self, IoError> {
        if header.is_empty() {
            return Err(IoError::Empty { path: path.to_owned() });
        }
        check_size(path, 0, header.len())?;
        let mapped = mapping.time.as_deref().and_then(|name| header.iter().position(|h| h == name));
        let time = mapped.or_else(|| TIME.iter().find_map(|name| header.iter().position(|h| h == *name)));
        let time = time.ok_or_else(|| IoError::NoTime {
            path: path.to_owned(),
            wanted: mapping.time.clone().unwrap_or_else(|| "t".into()),
            columns: header.iter().map(str::to_owned).collect(),
        })?;
        let columns = header.iter().map(|name| CsvColumn::new(name, mapping)).collect();
        Ok(CsvColumns {
            path,
            time,
            seconds_per_unit: mapping.seconds_per_unit(&header[time]),
            clock_s: Vec::new(),
            columns,
            style,
        })
    }

    fn push(&mut self, line: u64, row: &StringRecord) -> Result<(), IoError> {
        self.tick(line, &row[self.time])?;
        for (i, (column, text)) in self.columns.iter_mut().zip(row).enumerate() {
            if i == self.time || column.text.is_some() {
                continue;
            }
            match self.style.number(text) {
                Some(value) => column.values.push(value),
                None if column.required => return Err(not_a_number(self.path, line, &column.source, text)),
                None => column.text = Some((line, text.trim().to_owned())),
            }
        }
        Ok(())
    }

    fn tick(&mut self, line: u64, text: &str) -> Result<(), IoError> {
        let time = self.style.number(text).filter(|t| t.is_finite());
        let Some(time) = time else {
            return Err(not_a_number(self.path, line, &self.columns[self.time].source, text));
        };
        let after_s = time * self.seconds_per_unit;
        if let Some(&before_s) = self.clock_s.last()
            && after_s <= before_s
        {
            return Err(IoError::Clock { path: self.path.to_owned(), line, before_s, after_s });
        }
        self.clock_s.push(after_s);
        Ok(())
    }

    fn into_log(self, mapping: &Mapping, cut: Option<Warning>) -> Result<(Log, Vec<Warning>), IoError> {
        if self.clock_s.is_empty() {
            return Err(IoError::NoSamples { path: self.path.to_owned() });
        }
        let mut warnings: Vec<Warning> = cut.into_iter().collect();
        let mut series = Vec::new();
        for (i, CsvColumn { source, meaning, values, text, .. }) in self.columns.into_iter().enumerate() {
            match text {
                _ if i == self.time => {}
                Some((line, text)) => warnings.push(Warning::ColumnIgnored { column: source, line, text }),
                None => series.push(NamedSeries { source, meaning, values }),
            }
        }
        let (log, more) = assemble(self.path, self.clock_s, series, mapping)?;
        warnings.extend(more);
        Ok((log, warnings))
    }
}

fn not_a_number(path: &Path, line: u64, column: &str, text: &str) -> IoError {
    IoError::NotANumber { path: path.to_owned(), line, column: column.to_owned(), text: text.trim().to_owned() }
}

/// The header of a log: the time, then every channel under a name that reads back as itself.
pub(crate) fn headers(path: &Path, log: &Log) -> Result<Vec<String>, IoError> {
    let unwritable = |name: &str| IoError::Unwritable { path: path.to_owned(), channel: name.to_owned() };
    let names = log.channels().map(|(name, _)| {
        // The reader trims its cells, and takes the first column with one of these names as the time.
        let readable = name.trim() == name && !TIME.contains(&name);
        header(name).filter(|_| readable).ok_or_else(|| unwritable(name))
    });
    std::iter::once(Ok("t".to_owned())).chain(names).collect()
}

/// Writes a log under [`headers`]. Numbers are the shortest decimals that read back to the same bits.
pub(crate) fn write(headers: &[String], log: &Log, out: impl Write) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(headers)?;
    let channels: Vec<&[f64]> = log.channels().map(|(_, channel)| channel.values.as_slice()).collect();
    for (i, t) in log.clock_s().iter().enumerate() {
        writer.write_field(cell(*t))?;
        for values in &channels {
            writer.write_field(cell(values[i]))?;
        }
        writer.write_record(None::<&[u8]>)?;
    }
    writer.flush()
}

fn cell(x: f64) -> String {
    if x.is_nan() { String::new() } else { format!("{x:?}") }
}

//! The frames of an episode in a Parquet file, as numbers.

use crate::error::IoError;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::file::statistics::Statistics;
use parquet::schema::types::ColumnDescPtr;
use std::fs::File;
use std::path::{Path, PathBuf};

/// The column that says to which episode a frame belongs.
const EPISODE: &str = "episode_index";

/// A file of frames.
pub(super) struct FrameTable {
    path: PathBuf,
    reader: SerializedFileReader<File>,
}

impl FrameTable {
    /// # Errors
    /// A file that is not there, or that is no Parquet file.
    pub(super) fn open(path: &Path) -> Result<Self, IoError> {
        let file = File::open(path).map_err(|source| IoError::File { path: path.to_owned(), source })?;
        let reader = SerializedFileReader::new(file).map_err(|e| odd(path, e.to_string()))?;
        Ok(FrameTable { path: path.to_owned(), reader })
    }

    /// The columns of some names in an episode, each as a series per number that a frame has; `None` where the file has
    /// no frame of it.
    ///
    /// # Errors
    /// Columns that are not there, are no numbers, or have not the same count of them in each frame.
    pub(super) fn episode(&self, episode: usize, names: &[&str]) -> Result<Option<Vec<Vec<Vec<f64>>>>, IoError> {
        let mine = self.column(EPISODE)?;
        let wanted = names.iter().map(|name| self.column(name)).collect::<Result<Vec<usize>, _>>()?;
        let mut found: Vec<Vec<Vec<f64>>> = vec![Vec::new(); names.len()];
        for index in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(index).map_err(|e| self.odd(e.to_string()))?;
            if !may_hold(&*group, mine, episode) {
                continue;
            }
            let owners = self.numbers(&*group, mine)?.values;
            let is_mine = |owner: f64| (owner - episode as f64).abs() < 0.5;
            let frames: Vec<usize> = (0..owners.len()).filter(|&frame| is_mine(owners[frame])).collect();
            for (series, &column) in found.iter_mut().zip(&wanted).filter(|_| !frames.is_empty()) {
                let numbers = self.numbers(&*group, column)?;
                series.resize(series.len().max(numbers.width), Vec::new());
                for (k, one) in series.iter_mut().enumerate().take(numbers.width) {
                    one.extend(frames.iter().map(|frame| numbers.values[frame * numbers.width + k]));
                }
            }
        }
        Ok(found.iter().any(|series| !series.is_empty()).then_some(found))
    }

    /// Where a column is among those that the file has.
    fn column(&self, name: &str) -> Result<usize, IoError> {
        let columns = self.reader.metadata().file_metadata().schema_descr().columns();
        let named = |column: &ColumnDescPtr| column.path().parts().first().is_some_and(|first| first == name);
        columns.iter().position(named).ok_or_else(|| self.odd(format!("no column `{name}`")))
    }

    /// All numbers of a column in a group of frames.
    fn numbers(&self, group: &dyn RowGroupReader, column: usize) -> Result<Numbers, IoError> {
        let frames = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        let name = || group.metadata().column(column).column_path().parts()[0].clone();
        let numbers = match group.get_column_reader(column).map_err(|e| self.odd(e.to_string()))? {
            ColumnReader::FloatColumnReader(reader) => numbers(reader, group, column, f64::from),
            ColumnReader::DoubleColumnReader(reader) => numbers(reader, group, column, f64::from),
            ColumnReader::Int32ColumnReader(reader) => numbers(reader, group, column, f64::from),
            ColumnReader::Int64ColumnReader(reader) => numbers(reader, group, column, |x| x as f64),
            _ => return Err(self.odd(format!("the column `{}` holds no numbers", name()))),
        };
        let numbers = numbers.map_err(|e| self.odd(e.to_string()))?;
        numbers
            .filter(|numbers| numbers.values.len() == frames * numbers.width)
            .ok_or_else(|| self.odd(format!("the column `{}` has not the same count of numbers in each frame", name())))
    }

    fn odd(&self, what: String) -> IoError {
        odd(&self.path, what)
    }
}

fn odd(path: &Path, what: String) -> IoError {
    IoError::DataSet { path: path.to_owned(), what }
}

/// Whether a group of frames may have some of an episode, as far as its statistics tell.
fn may_hold(group: &dyn RowGroupReader, column: usize, episode: usize) -> bool {
    match group.metadata().column(column).statistics() {
        Some(Statistics::Int64(range)) => {
            let (low, high) = (range.min_opt().copied(), range.max_opt().copied());
            let episode = i64::try_from(episode).unwrap_or(i64::MAX);
            low.is_none_or(|low| low <= episode) && high.is_none_or(|high| episode <= high)
        }
        _ => true,
    }
}

/// So many numbers for each frame, frame after frame; NaN where one is missing.
struct Numbers {
    values: Vec<f64>,
    width: usize,
}

/// The numbers of a column; `None` where frames differ in how many they have.
fn numbers<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    group: &dyn RowGroupReader,
    column: usize,
    number: impl Fn(T::T) -> f64,
) -> Result<Option<Numbers>, ParquetError> {
    let (mut there, mut again, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let frames = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    reader.read_records(frames, Some(&mut there), Some(&mut again), &mut values)?;
    let mut values = values.into_iter().map(number);
    let full = group.metadata().column(column).column_descr().max_def_level();
    let values: Vec<f64> = match full {
        0 => values.collect(),
        _ => there
            .iter()
            .map(|level| if *level == full { values.next().unwrap_or(f64::NAN) } else { f64::NAN })
            .collect(),
    };
    // The level of repetition is 0 where a frame begins.
    let width = again.iter().skip(1).position(|level| *level == 0).map_or(again.len().max(1), |last| last + 1);
    let even = again.iter().enumerate().all(|(k, level)| (*level == 0) == (k % width == 0));
    Ok(even.then_some(Numbers { values, width }))
}

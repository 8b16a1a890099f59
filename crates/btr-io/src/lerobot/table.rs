//! Reads the frames of an episode from a Parquet file.

use crate::error::IoError;
use crate::regular;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::file::statistics::Statistics;
use parquet::schema::types::ColumnDescPtr;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// The column with the episode of a frame.
const EPISODE: &str = "episode_index";

/// The named columns of an episode in a file, see [`FrameTable::episode`]. At some damage, the reader panics:
/// metadata with negative places, indices without their dictionary, numbers of too many bits.
///
/// # Errors
/// See [`FrameTable`]; a damaged file.
pub(super) fn episode_in(path: &Path, episode: usize, names: &[&str]) -> Result<Option<Vec<Vec<Vec<f64>>>>, IoError> {
    let read = || FrameTable::open(path)?.episode(episode, names);
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(odd(path, "the Parquet file is damaged".to_owned())))
}

/// A file of frames.
struct FrameTable {
    path: PathBuf,
    reader: SerializedFileReader<File>,
}

impl FrameTable {
    /// # Errors
    /// A missing file, or one that is not Parquet.
    fn open(path: &Path) -> Result<Self, IoError> {
        let file = regular::open(path).map_err(|source| IoError::File { path: path.to_owned(), source })?;
        let reader = SerializedFileReader::new(file).map_err(|e| odd(path, e.to_string()))?;
        Ok(FrameTable { path: path.to_owned(), reader })
    }

    /// The named columns of an episode, each as one series per value of a frame (columns x values x frames); `None` if
    /// the file holds no frame of the episode.
    ///
    /// # Errors
    /// Columns that are missing, are not numeric, or differ in their number of values between frames.
    fn episode(&self, episode: usize, names: &[&str]) -> Result<Option<Vec<Vec<Vec<f64>>>>, IoError> {
        let episode_column = self.column(EPISODE)?;
        let columns = names.iter().map(|name| self.column(name)).collect::<Result<Vec<usize>, _>>()?;
        let mut found: Vec<Vec<Vec<f64>>> = vec![Vec::new(); names.len()];
        for index in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(index).map_err(|e| self.odd(e.to_string()))?;
            if !may_hold(&*group, episode_column, episode) {
                continue;
            }
            let owners = self.numbers(&*group, episode_column)?.values;
            let is_mine = |owner: f64| (owner - episode as f64).abs() < 0.5;
            let frames: Vec<usize> = (0..owners.len()).filter(|&frame| is_mine(owners[frame])).collect();
            for (series, &column) in found.iter_mut().zip(&columns).filter(|_| !frames.is_empty()) {
                let numbers = self.numbers(&*group, column)?;
                series.resize(series.len().max(numbers.width), Vec::new());
                for (k, one) in series.iter_mut().enumerate().take(numbers.width) {
                    one.extend(frames.iter().map(|frame| numbers.values[frame * numbers.width + k]));
                }
            }
        }
        Ok(found.iter().any(|series| !series.is_empty()).then_some(found))
    }

    /// Index of a column.
    fn column(&self, name: &str) -> Result<usize, IoError> {
        let columns = self.reader.metadata().file_metadata().schema_descr().columns();
        let named = |column: &ColumnDescPtr| column.path().parts().first().is_some_and(|first| first == name);
        columns.iter().position(named).ok_or_else(|| self.odd(format!("no column `{name}`")))
    }

    /// All values of a column in a row group.
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

/// Whether a row group may hold frames of an episode, by its statistics.
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

/// `width` values per frame, frame after frame; NaN where one is missing.
struct Numbers {
    values: Vec<f64>,
    width: usize,
}

/// The values of a column; `None` where frames differ in their number of values.
fn numbers<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    group: &dyn RowGroupReader,
    column: usize,
    number: impl Fn(T::T) -> f64,
) -> Result<Option<Numbers>, ParquetError> {
    let (mut definition_levels, mut repetition_levels, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let frames = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    reader.read_records(frames, Some(&mut definition_levels), Some(&mut repetition_levels), &mut values)?;
    let mut values = values.into_iter().map(number);
    let full = group.metadata().column(column).column_descr().max_def_level();
    let values: Vec<f64> = match full {
        0 => values.collect(),
        _ => definition_levels
            .iter()
            .map(|level| if *level == full { values.next().unwrap_or(f64::NAN) } else { f64::NAN })
            .collect(),
    };
    // The repetition level is 0 at the first value of a frame.
    let width = repetition_levels
        .iter()
        .skip(1)
        .position(|level| *level == 0)
        .map_or(repetition_levels.len().max(1), |last| last + 1);
    let even = repetition_levels.iter().enumerate().all(|(k, level)| (*level == 0) == (k % width == 0));
    Ok(even.then_some(Numbers { values, width }))
}

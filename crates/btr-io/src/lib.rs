//! Logs and files: CSV for people, MCAP for robots and their viewers; other people's bags and data sets are read.

mod atomic;
mod bag;
mod csv;
mod error;
mod lerobot;
mod mapping;
mod mcap;
mod names;
mod renamed;
mod series;
#[cfg(test)]
mod tests;

pub use crate::atomic::{can_write, write_whole};
pub use error::{IoError, Warning};
pub use mapping::{ForeignName, Mapping, Topics};
pub use mcap::{Meta, Recording};
pub use renamed::renamed;

use btr_core::log::Log;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// The formats, by the end of the file's name.
enum Format {
    Csv,
    CsvGz,
    Mcap,
}

fn format(path: &Path) -> Result<Format, IoError> {
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let ends = |ending: &str| name.ends_with(ending);
    match () {
        () if ends(".csv") => Ok(Format::Csv),
        () if ends(".csv.gz") => Ok(Format::CsvGz),
        () if ends(".mcap") => Ok(Format::Mcap),
        () if ends(".db3") => Err(IoError::Db3 { path: path.to_owned() }),
        () => Err(IoError::Format { path: path.to_owned() }),
    }
}

/// Reads a log: a `.csv`, `.csv.gz` or `.mcap`, the folder of a ROS 2 bag, or an episode of a LeRobot data set (`FOLDER#3`, or
/// the folder alone where there is but one). Channels come under btr's names; the mapping says which foreign names mean them.
///
/// # Errors
/// [`IoError`], with the place in the file and a remedy.
pub fn read_log(path: &Path, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    if let Some(episode) = lerobot::Episode::at(path)? {
        return episode.read(mapping);
    }
    let path = &bag::file(path)?;
    let format = format(path)?;
    let file = File::open(path).map_err(|source| IoError::File { path: path.to_owned(), source })?;
    match format {
        Format::Csv => csv::read(path, file, mapping),
        Format::CsvGz => csv::read(path, flate2::read::MultiGzDecoder::new(file), mapping),
        Format::Mcap => mcap::read(path, BufReader::new(file), mapping),
    }
}

/// The same for logs that are compared with simulations: their first sample is at time zero.
///
/// # Errors
/// See [`read_log`].
pub fn read_recorded(path: &Path, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    read_log(path, mapping).map(|(log, warnings)| (log.from_zero(), warnings))
}

/// Which of these columns is the time, as in a CSV, and how many seconds its unit has.
pub fn time_of<'a>(columns: &'a [String], mapping: &Mapping) -> Option<(&'a str, f64)> {
    let mut names = mapping.time.as_deref().into_iter().chain(csv::TIME);
    let found = names.find_map(|name| columns.iter().find(|column| *column == name))?;
    Some((found, names::seconds_per_unit(found)))
}

/// A log of columns in memory, with what was noticed. Their names mean what a CSV's headers mean: `q_knee_deg` is the knee's
/// position in degrees, and the mapping says which foreign names mean btr's.
///
/// # Errors
/// [`IoError`] for a clock that does not increase, columns of another length than the clock, and two of one meaning.
pub fn log_of(
    name: &Path,
    clock_s: Vec<f64>,
    columns: Vec<(String, Vec<f64>)>,
    mapping: &Mapping,
) -> Result<(Log, Vec<Warning>), IoError> {
    let series = |(source, values): (String, Vec<f64>)| series::NamedSeries {
        meaning: mapping.meaning(&source).unwrap_or_else(|| names::Meaning::of_header(&source)),
        source,
        values,
    };
    series::assemble(name, clock_s, columns.into_iter().map(series).collect(), mapping)
}

/// How a column has to be called to mean this channel; `None` where no name can.
pub fn column_of(channel: &str) -> Option<String> {
    names::header(channel)
}

/// Whether a log could be written there.
///
/// # Errors
/// [`IoError::File`], or an unknown extension.
pub fn can_write_log(path: &Path) -> Result<(), IoError> {
    format(path)?;
    can_write(path).map_err(|source| IoError::File { path: path.to_owned(), source })
}

/// Writes a log (`.csv`, `.csv.gz`, `.mcap`), whole or not at all. Equal logs give equal bytes. `meta` goes into MCAP only.
///
/// # Errors
/// [`IoError::File`], an unknown extension, or a channel name that CSV cannot carry.
pub fn write_log(path: &Path, log: &Log, meta: &Meta) -> Result<(), IoError> {
    let written = match format(path)? {
        Format::Csv => {
            let headers = csv::headers(path, log)?;
            atomic::write_whole(path, |out| csv::write(&headers, log, out))
        }
        Format::CsvGz => {
            let headers = csv::headers(path, log)?;
            atomic::write_whole(path, |out| {
                let mut gz = flate2::write::GzEncoder::new(out, flate2::Compression::default());
                csv::write(&headers, log, &mut gz)?;
                gz.finish().map(|_| ())
            })
        }
        Format::Mcap => atomic::write_whole(path, |out| mcap::write(log, meta, out)),
    };
    written.map_err(|source| IoError::File { path: path.to_owned(), source })
}

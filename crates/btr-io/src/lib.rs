//! Logs and files: CSV, MCAP, ROS 2 bags and LeRobot data sets. Files are written whole or not at all.
//!
//! [`read_log`] and [`write_log`] choose the format by the name of the file. A [`Mapping`] translates foreign channel
//! names into btr's: `cmd_<joint>` for commands, `q_`, `dq_` and `tau_` for measured positions, velocities and torques,
//! in SI units.
//!
//! ```
//! use btr_core::log::{Log, Role};
//! use btr_io::{Mapping, Meta, read_log, write_log};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut log = Log::new(vec![0.0, 0.01, 0.02])?;
//! log.insert("cmd_knee", "rad", Role::Command, vec![0.0, 0.1, 0.2])?;
//! log.insert("q_knee", "rad", Role::Measured, vec![0.0, 0.04, 0.13])?;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("walk.csv");
//! write_log(&path, &log, &Meta::default())?;
//!
//! let (read, warnings) = read_log(&path, &Mapping::default())?;
//! assert_eq!(read, log);
//! assert!(warnings.is_empty());
//! # Ok(())
//! # }
//! ```
//!
//! Features, both on by default: `mcap` (MCAP files and ROS 2 bags) and `parquet` (LeRobot data sets). Without a
//! feature, its formats end in [`IoError::Disabled`].

mod atomic;
mod bag;
mod channels;
mod csv;
mod data_set;
mod error;
#[cfg(feature = "parquet")]
mod lerobot;
#[cfg(feature = "mcap")]
mod mcap;
mod meta;
mod regular;
mod stream;
#[cfg(test)]
mod tests;

use channels::{names, series};

pub use crate::atomic::{can_write, create_dir, sweep_temporary, write_whole};
pub use channels::mapping::{ForeignName, Mapping, TimeUnit, Topics};
pub use channels::renamed::renamed;
pub use error::{IoError, Warning};
#[cfg(feature = "mcap")]
pub use mcap::{MovingFrame, OverlaidRobot, Overlay, Recording, frame_of};
pub use meta::Meta;
pub use regular::{read_beginning, read_bytes, read_text, read_text_from};
pub use stream::read_stream;

use btr_core::log::{Log, LogError};
use std::path::{Path, PathBuf};

/// The formats, by the end of the file's name.
enum Format {
    Csv,
    CsvGz,
    #[cfg(feature = "mcap")]
    Mcap,
}

fn format(path: &Path) -> Result<Format, IoError> {
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let ends = |ending: &str| name.ends_with(ending);
    match () {
        () if ends(".csv") => Ok(Format::Csv),
        () if ends(".csv.gz") => Ok(Format::CsvGz),
        #[cfg(not(feature = "mcap"))]
        () if ends(".mcap") => Err(IoError::Disabled { path: path.to_owned(), format: "MCAP", feature: "mcap" }),
        #[cfg(feature = "mcap")]
        () if ends(".mcap") => Ok(Format::Mcap),
        () if ends(".db3") => Err(IoError::Db3 { path: path.to_owned() }),
        () => Err(IoError::Format { path: path.to_owned() }),
    }
}

/// Reads a log: a `.csv`, `.csv.gz` or `.mcap`, the folder of a ROS 2 bag, or an episode of a LeRobot data set
/// (`FOLDER#3`, or the folder alone if it has a single episode). Channels get btr's names; the mapping translates
/// foreign ones.
///
/// # Errors
/// [`IoError`], with the place in the file and a remedy.
pub fn read_log(path: &Path, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    #[cfg(feature = "parquet")]
    if let Some(episode) = lerobot::Episode::at(path)? {
        return episode.read(mapping);
    }
    #[cfg(not(feature = "parquet"))]
    if data_set::place(path).is_some() {
        return Err(IoError::Disabled { path: path.to_owned(), format: "LeRobot data sets", feature: "parquet" });
    }
    let path = &bag::file(path)?;
    let refused = |source| IoError::File { path: path.to_owned(), source };
    regular::check_no_stream(path).map_err(refused)?;
    let format = format(path)?;
    let file = regular::open(path).map_err(refused)?;
    match format {
        Format::Csv => csv::read(path, file, mapping),
        Format::CsvGz => csv::read(path, flate2::read::MultiGzDecoder::new(file), mapping),
        #[cfg(feature = "mcap")]
        Format::Mcap => mcap::read(path, std::io::BufReader::new(file), mapping),
    }
}

/// Reads a log that is compared with simulations: as [`read_log`], with the first sample at time zero.
///
/// # Errors
/// See [`read_log`].
pub fn read_recorded(path: &Path, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    read_log(path, mapping).map(|(log, warnings)| (log.from_zero(), warnings))
}

/// A path with which the first episode of a LeRobot data set is read, and how many there are; `None` where the path is
/// none of a data set, or names an episode.
///
/// # Errors
/// A malformed data set.
#[cfg_attr(not(feature = "parquet"), allow(unused_variables, clippy::unnecessary_wraps, reason = "no data sets"))]
pub fn first_episode(path: &Path) -> Result<Option<(PathBuf, usize)>, IoError> {
    #[cfg(feature = "parquet")]
    return lerobot::first_episode(path);
    #[cfg(not(feature = "parquet"))]
    Ok(None)
}

/// The names of a CSV file's columns; of other formats, which name channels as btr does, none.
///
/// # Errors
/// A file that cannot be read, or has no header.
pub fn column_names(path: &Path) -> Result<Option<Vec<String>>, IoError> {
    #[cfg(feature = "parquet")]
    if lerobot::Episode::at(path)?.is_some() {
        return Ok(None);
    }
    let refused = |source| IoError::File { path: path.to_owned(), source };
    regular::check_no_stream(path).map_err(refused)?;
    if path.is_dir() {
        return Ok(None);
    }
    match format(path)? {
        Format::Csv => csv::columns(path, regular::open(path).map_err(refused)?).map(Some),
        Format::CsvGz => {
            let bytes = flate2::read::MultiGzDecoder::new(regular::open(path).map_err(refused)?);
            csv::columns(path, bytes).map(Some)
        }
        #[cfg(feature = "mcap")]
        Format::Mcap => Ok(None),
    }
}

/// The time column among these columns, as in a CSV file, and the seconds per unit of its values.
pub fn time_of<'a>(columns: &'a [String], mapping: &Mapping) -> Option<(&'a str, f64)> {
    let mut names = mapping.time.as_deref().into_iter().chain(csv::TIME);
    let found = names.find_map(|name| columns.iter().find(|column| *column == name))?;
    Some((found, mapping.seconds_per_unit(found)))
}

/// A log of columns in memory, with warnings. Names mean what CSV headers mean: `q_knee_deg` is the knee's position in
/// degrees, and the mapping translates foreign names.
///
/// # Errors
/// [`IoError`] for a clock that does not increase, columns of another length than the clock, and two columns of the
/// same meaning.
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

/// The column name that means this channel; `None` where no name does.
pub fn column_of(channel: &str) -> Option<String> {
    names::header(channel)
}

/// The log as it is written to this path for a model with this mapping: read by it, it is this log again, and its
/// columns have the mapping's names and units where the file can carry them.
///
/// # Errors
/// Two channels of one foreign name.
pub fn as_mapped(path: &Path, log: &Log, mapping: &Mapping) -> Result<Log, LogError> {
    match format(path) {
        Ok(Format::Csv | Format::CsvGz) => channels::foreign::foreign(log, mapping),
        // btr's own messages are read as they are.
        _ => Ok(log.clone()),
    }
}

/// Checks that a log could be written to the path.
///
/// # Errors
/// [`IoError::File`], or an unknown extension.
pub fn can_write_log(path: &Path) -> Result<(), IoError> {
    format(path)?;
    can_write(path).map_err(|source| IoError::File { path: path.to_owned(), source })
}

/// Writes robots that move beside each other into an MCAP file, for Foxglove and Rerun.
///
/// # Errors
/// [`IoError::File`].
#[cfg(feature = "mcap")]
pub fn write_overlay(path: &Path, overlay: &Overlay) -> Result<(), IoError> {
    let written = atomic::write_whole(path, |out| mcap::write_overlay(overlay, out));
    written.map_err(|source| IoError::File { path: path.to_owned(), source })
}

/// Whether a file is one that [`write_overlay`] has written.
#[cfg(feature = "mcap")]
pub fn is_overlay(path: &Path) -> bool {
    std::fs::read(path).is_ok_and(|file| mcap::is_overlay(&file))
}

/// Writes a log (`.csv`, `.csv.gz`, `.mcap`), whole or not at all. Equal logs give equal bytes. `meta` goes into MCAP
/// only.
///
/// # Errors
/// [`IoError::File`], an unknown extension, or a channel name that CSV cannot carry.
#[cfg_attr(not(feature = "mcap"), allow(unused_variables, reason = "CSV holds no description"))]
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
        #[cfg(feature = "mcap")]
        Format::Mcap => atomic::write_whole(path, |out| mcap::write(log, meta, out)),
    };
    written.map_err(|source| IoError::File { path: path.to_owned(), source })
}

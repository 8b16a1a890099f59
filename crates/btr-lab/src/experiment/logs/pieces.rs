//! Logs on their way to a comparison: read, refused where no sense can come of them, and cut at their gaps.

use super::source::LogSource;
use crate::experiment::file::File;
use crate::experiment::parse::FileError;
use btr_core::log::Log;
use btr_core::signal::missing;
use std::path::{Path, PathBuf};

/// No robot is sampled so rarely, in s.
const LONGEST_STEP_S: f64 = 0.5;
/// What is left between two gaps has to last so long, in s, and to have so many samples.
const SHORTEST: (f64, usize) = (0.5, 20);

/// A log, or what there is of it between two gaps, from time zero.
pub(super) struct LogPiece {
    pub path: PathBuf,
    /// For reports.
    pub name: String,
    pub log: Log,
    /// When it begins in the file, in s after the file's first sample.
    pub begins_s: f64,
}

/// Reads a log that simulations are to be compared with, from time zero, with what was noticed.
pub(super) fn read(source: &LogSource, file: &File) -> Result<(Log, Vec<String>), FileError> {
    let (log, warnings) = match source {
        LogSource::File(path) => btr_io::read_recorded(path, &file.channels).map_err(|e| unreadable(&e))?,
        LogSource::Made { name, log } => {
            let renamed = btr_io::renamed(name, log.clone(), &file.channels).map_err(|e| unreadable(&e))?;
            (renamed.0.from_zero(), renamed.1)
        }
    };
    timely(source.path(), &log)?;
    Ok((log, warnings.iter().map(ToString::to_string).collect()))
}

/// Refuses a log that is too short, or whose clock cannot be in seconds.
pub(crate) fn timely(path: &Path, log: &Log) -> Result<(), FileError> {
    if log.len() < 2 {
        return Err(about(path, "a log needs at least two samples", None));
    }
    let step_s = log.usual_step_s().unwrap_or(0.0);
    if step_s > LONGEST_STEP_S { Err(slow(path, step_s)) } else { Ok(()) }
}

/// A clock that is not in seconds.
fn slow(path: &Path, step_s: f64) -> FileError {
    let (unit, ending) = match step_s {
        ..500.0 => ("milliseconds", "ms"),
        500.0..5e5 => ("microseconds", "us"),
        _ => ("nanoseconds", "ns"),
    };
    let message = format!("{step_s} s between two samples: is its time in {unit}?");
    let help = format!(
        "btr wants seconds; or call the time column t_{ending} and say so in the model file: [channels] time = \"t_{ending}\" \
         (_ms, _us and _ns at the end of its name are heeded)"
    );
    about(path, &message, Some(help))
}

/// Cuts a log at its gaps: nobody knows what the robot was told in one, nor where it is after it. What is too short to tell
/// anything is left out, which is noticed.
pub(super) fn pieces(path: &Path, log: &Log) -> Result<(Vec<LogPiece>, Vec<String>), FileError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let runs = missing::pieces(log);
    if runs.len() < 2 {
        return Ok((vec![LogPiece::whole(path, log.clone())], Vec::new()));
    }
    let (mut pieces, mut noticed) = (Vec::new(), Vec::new());
    for run in runs {
        let part = log.part(run);
        let begins_s = part.clock_s().first().copied().unwrap_or(0.0);
        if part.duration_s() < SHORTEST.0 || part.len() < SHORTEST.1 {
            let (samples, s) = (part.len(), if part.len() == 1 { "" } else { "s" });
            noticed.push(format!("{samples} sample{s} between gaps from {begins_s:.3} s on: too short, left out"));
            continue;
        }
        let name = format!("{stem} from {begins_s:.1} s");
        pieces.push(LogPiece { path: path.to_owned(), name, log: part.from_zero(), begins_s });
    }
    if pieces.is_empty() {
        let message = format!("nothing but gaps: no {} s without one", SHORTEST.0);
        let help = "record again, without losing samples".to_owned();
        return Err(about(path, &message, Some(help)));
    }
    Ok((pieces, noticed))
}

impl LogPiece {
    pub(super) fn whole(path: &Path, log: Log) -> Self {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        LogPiece { path: path.to_owned(), name, log, begins_s: 0.0 }
    }
}

/// An error about a log, which the model file has no part in.
pub(super) fn about(path: &Path, message: &str, help: Option<String>) -> FileError {
    FileError { path: path.to_owned(), line: 0, column: 0, message: message.to_owned(), help }
}

/// What a reader of logs says names the log itself.
pub(super) fn unreadable(error: &btr_io::IoError) -> FileError {
    about(Path::new(""), &error.to_string(), Some(error.help()))
}

//! Cuts logs at their gaps.

use super::read::about;
use crate::experiment::source::FileError;
use btr_core::log::Log;
use btr_core::signal::missing;
use std::path::{Path, PathBuf};

/// Shortest duration in s and fewest samples of a piece between two gaps.
const SHORTEST: (f64, usize) = (0.5, 20);

/// A log, or a piece of it between two gaps, from time zero.
pub(crate) struct LogPiece {
    pub path: PathBuf,
    /// Name for reports.
    pub name: String,
    pub log: Log,
    /// Start in the file, in s after the file's first sample.
    pub begins_s: f64,
}

/// Cuts a log at its gaps: the commands during a gap and the state after it are unknown. Pieces that are too short are
/// left out with a warning.
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
        let message = format!("no {} s without a gap", SHORTEST.0);
        let help = "record again, without losing samples".into();
        return Err(about(path, &message, Some(help)));
    }
    Ok((pieces, noticed))
}

impl LogPiece {
    pub(crate) fn whole(path: &Path, log: Log) -> Self {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        LogPiece { path: path.to_owned(), name, log, begins_s: 0.0 }
    }
}

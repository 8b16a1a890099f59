//! Residuals of several logs, one after the other.

use crate::residual_model::RecordedLog;
use std::ops::Range;

/// Residuals of all logs of a set, one after the other. A missing sample counts as no error.
pub type ResidualVector = Vec<f64>;

/// Adds a step error to a residual.
pub fn corrected(mut residual: ResidualVector, step_error: &[f64]) -> ResidualVector {
    residual.iter_mut().zip(step_error).for_each(|(r, e)| *r += e);
    residual
}

/// Sum of squares.
pub fn squares(residual: &[f64]) -> f64 {
    residual.iter().map(|r| r * r).sum()
}

/// The rows of each channel of some logs in their residual.
pub(super) fn channels<'a>(logs: impl Iterator<Item = &'a RecordedLog>) -> Vec<Range<usize>> {
    let (mut start, mut rows) = (0, Vec::new());
    for log in logs {
        rows.extend(log.channels.iter().map(|channel| start + channel.samples.start..start + channel.samples.end));
        start += log.rows();
    }
    rows
}

/// Root mean square of a residual whose missing samples are zero.
pub(crate) fn chi(squares: f64, samples: usize) -> f64 {
    (squares / samples.max(1) as f64).sqrt()
}

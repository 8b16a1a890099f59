//! Which samples of which logs are learnt from, and which are judged on.

use btr_core::log::Log;
use btr_physics::model::Model;
use std::ops::Range;

/// Where nothing is held out, this last share of every log is; `btr diagnose --help` says so.
const JUDGED_TAIL: f64 = 0.3;

/// Some samples of a log that are learnt from or judged on together.
#[derive(Clone)]
pub(super) struct LogPart {
    pub scenario: usize,
    pub samples: Range<usize>,
    pub held_out: bool,
    /// The same, window by window; none where all follows from the log's start.
    pub windows: Vec<Range<usize>>,
    /// With windows: the noise of every joint's reading; 0 where there is none.
    pub noise: Vec<f64>,
}

impl LogPart {
    pub(super) fn new(scenario: usize, samples: Range<usize>, held_out: bool) -> Self {
        LogPart { scenario, samples, held_out, windows: Vec::new(), noise: Vec::new() }
    }

    /// Whether a sample counts.
    pub(super) fn has(&self, sample: usize) -> bool {
        let windows = || self.windows.iter().any(|window| window.contains(&sample));
        self.samples.contains(&sample) && (self.windows.is_empty() || windows())
    }
}

/// The logs as they are, to learn from.
pub(super) fn whole(recorded: &[Log]) -> Vec<LogPart> {
    recorded.iter().enumerate().map(|(scenario, log)| LogPart::new(scenario, 0..log.len(), false)).collect()
}

/// The logs as they are; each cut in two where none is held out.
pub(super) fn parts(model: &Model, recorded: &[Log]) -> Vec<LogPart> {
    let cut = |scenario: usize| (recorded[scenario].len() as f64 * (1.0 - JUDGED_TAIL)) as usize;
    let whole = |scenario: usize| LogPart::new(scenario, 0..recorded[scenario].len(), scenario >= model.learn);
    if model.learn < recorded.len() {
        return (0..recorded.len()).map(whole).collect();
    }
    let first = (0..recorded.len()).map(|scenario| LogPart::new(scenario, 0..cut(scenario), false));
    let last =
        (0..recorded.len()).map(|scenario| LogPart::new(scenario, cut(scenario)..recorded[scenario].len(), true));
    first.chain(last).collect()
}

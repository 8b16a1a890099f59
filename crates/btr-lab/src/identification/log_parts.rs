//! The split of logs into training and held-out samples.

use btr_core::log::Log;
use btr_physics::model::Model;
use std::ops::Range;

/// Share at the end of every log that is held out if no log is; documented in `btr diagnose --help`.
const JUDGED_TAIL: f64 = 0.3;

/// A range of a log's samples that is used for training or held out.
#[derive(Clone)]
pub(super) struct LogPart {
    pub scenario: usize,
    pub samples: Range<usize>,
    pub held_out: bool,
    /// The samples by window; empty if the log is simulated as a whole.
    pub windows: Vec<Range<usize>>,
    /// With windows: the noise of every joint's reading; 0 if there is none.
    pub noise: Vec<f64>,
}

impl LogPart {
    pub(super) fn new(scenario: usize, samples: Range<usize>, held_out: bool) -> Self {
        LogPart { scenario, samples, held_out, windows: Vec::new(), noise: Vec::new() }
    }

    /// Whether a sample is compared.
    pub(super) fn has(&self, sample: usize) -> bool {
        let windows = || self.windows.iter().any(|window| window.contains(&sample));
        self.samples.contains(&sample) && (self.windows.is_empty() || windows())
    }
}

/// All logs as whole training logs.
pub(super) fn whole(recorded: &[Log]) -> Vec<LogPart> {
    recorded.iter().enumerate().map(|(scenario, log)| LogPart::new(scenario, 0..log.len(), false)).collect()
}

/// The logs as a whole; each cut in two if none is held out.
pub(super) fn parts(model: &Model, recorded: &[Log]) -> Vec<LogPart> {
    let cut = |scenario: usize| cut(model, &recorded[scenario]);
    let whole = |scenario: usize| LogPart::new(scenario, 0..recorded[scenario].len(), scenario >= model.learn);
    if model.learn < recorded.len() {
        return (0..recorded.len()).map(whole).collect();
    }
    let first = (0..recorded.len()).map(|scenario| LogPart::new(scenario, 0..cut(scenario), false));
    let last =
        (0..recorded.len()).map(|scenario| LogPart::new(scenario, cut(scenario)..recorded[scenario].len(), true));
    first.chain(last).collect()
}

/// The first held-out sample of a log without another one. Where all motion is prescribed, only samples with a torque
/// count: a log may end while the robot stands.
fn cut(model: &Model, log: &Log) -> usize {
    let learnt = |samples: usize| (samples as f64 * (1.0 - JUDGED_TAIL)) as usize;
    if !model.robot.is_prescribed() {
        return learnt(log.len());
    }
    let torques: Vec<&[f64]> =
        model.robot.prescribed().filter_map(|joint| Some(&*log.channel(&joint.compared())?.values)).collect();
    let is_present = |i: &usize| torques.iter().any(|torques| torques[*i].is_finite());
    let present: Vec<usize> = (0..log.len()).filter(is_present).collect();
    present.get(learnt(present.len())).copied().unwrap_or_else(|| learnt(log.len()))
}

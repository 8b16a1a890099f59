//! The measurements that a model is compared with.

use std::ops::Range;
use std::sync::Arc;

/// A measured channel of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredChannel {
    /// The channel's name in the log.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Standard deviation of the readings from what the best model can predict, in the channel's unit: the noise floor,
    /// or how far runs of the same command differ where that is known and more.
    pub sigma: f64,
    /// Standard deviation of the sensor's error alone, quantisation included: the noise floor.
    pub sensor: f64,
    /// Standard deviation of what single samples have beside `sigma`, in the channel's unit, or empty: torques are less
    /// certain where noise decides the sign of dry friction.
    pub beside: Arc<[f64]>,
    /// Whether a whole run has an offset of its own, which then says nothing about the model.
    pub offset_differs: bool,
    /// Its samples in the log's residual.
    pub samples: Range<usize>,
    /// How many of them are present and count.
    pub present: usize,
}

impl MeasuredChannel {
    /// Whether what differs from run to run is part of its `sigma`.
    pub fn is_of_runs(&self) -> bool {
        self.sigma > self.sensor || self.offset_differs
    }

    /// The standard deviation of one of its samples.
    pub fn sigma_at(&self, sample: usize) -> f64 {
        self.beside.get(sample).map_or(self.sigma, |beside| self.sigma.hypot(*beside))
    }
}

/// A training or held-out log.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedLog {
    /// Its name in reports.
    pub name: String,
    /// Whether it is held out: nothing is fitted to it.
    pub held_out: bool,
    /// The measured channels.
    pub channels: Vec<MeasuredChannel>,
    /// Number of present samples of all channels that count.
    pub present: usize,
}

impl RecordedLog {
    /// Length of its residual.
    pub fn rows(&self) -> usize {
        self.channels.last().map_or(0, |channel| channel.samples.end)
    }
}

/// One number of the state in which a log begins that is not known for certain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartNumber {
    /// Names of the channels that it affects; empty where it affects all.
    pub channels: Vec<String>,
    /// Standard deviation within which the number is searched, in units of [`ResidualRequest::moved`]; `None` where it
    /// is not searched.
    ///
    /// [`ResidualRequest::moved`]: super::ResidualRequest::moved
    pub search_sd: Option<f64>,
}

/// How a log begins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogStart {
    /// The numbers of the start state that are not known for certain.
    pub numbers: Vec<StartNumber>,
    /// Samples of every channel that follow from one start state (multiple shooting); empty where the whole log follows
    /// from one. Samples in no window do not count.
    pub windows: Vec<Range<usize>>,
    /// The log that determines where this one begins: an earlier part of the same recording, or the log itself.
    pub begins_with: usize,
}

impl LogStart {
    /// The standard deviations of the numbers that are searched.
    pub fn search_sds(&self) -> Vec<f64> {
        self.numbers.iter().filter_map(|number| number.search_sd).collect()
    }
}

//! What errors are measured in: the noise floor of each channel, or how far runs of the same command differ.

use super::VerbInput;
use btr_identify::residual_model::{MeasuredChannel, RecordedLog};
use indexmap::IndexMap;
use serde::Serialize;

/// The noise floor of each measured channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseFloor {
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation of the errors of its readings.
    pub sigma: f64,
    /// Standard deviation of a run from what the robot does on average, where runs of the same command show that it is
    /// more; errors of the channel are in multiples of it then.
    pub repeatability: Option<f64>,
    /// Standard deviation of the offset of a whole run, where it is a good part of what differs: offsets are then left
    /// open in every log, and `repeatability` is the rest.
    pub run_offset: Option<f64>,
    /// Whether it is assumed because the readings have no noise.
    pub assumed: bool,
}

/// What errors are measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorUnit {
    /// The noise floors of the sensors.
    NoiseFloor,
    /// How far runs of the same command differ, in the channels where that is known and more.
    Repeatability,
}

impl ErrorUnit {
    /// That of errors of channels with these floors.
    pub fn of(floors: &[NoiseFloor]) -> Self {
        let of_runs = floors.iter().any(|floor| floor.repeatability.is_some());
        if of_runs { ErrorUnit::Repeatability } else { ErrorUnit::NoiseFloor }
    }

    /// As in "error (x noise floor)".
    pub fn name(self) -> &'static str {
        match self {
            ErrorUnit::NoiseFloor => "noise floor",
            ErrorUnit::Repeatability => "repeatability",
        }
    }

    /// As in "an error of 2 noise floors".
    pub fn times(self) -> &'static str {
        match self {
            ErrorUnit::NoiseFloor => "noise floors",
            ErrorUnit::Repeatability => "times the repeatability",
        }
    }
}

impl VerbInput {
    /// What errors of these logs are measured in.
    pub fn error_unit(&self) -> ErrorUnit {
        ErrorUnit::of(&self.floors())
    }

    /// The noise floor of each channel, as a root mean square over the samples of all logs.
    pub fn floors(&self) -> Vec<NoiseFloor> {
        self.floors_in(self.problem.logs())
    }

    /// The same in logs whose floors are those of a fitted model.
    pub(crate) fn floors_in(&self, logs: &[RecordedLog]) -> Vec<NoiseFloor> {
        let mut channels: IndexMap<&str, Vec<&MeasuredChannel>> = IndexMap::new();
        for channel in logs.iter().flat_map(|log| &log.channels) {
            channels.entry(&channel.name).or_default().push(channel);
        }
        channels.values().map(|of| self.floor(of)).collect()
    }

    /// That of a channel in the logs that have it.
    fn floor(&self, of: &[&MeasuredChannel]) -> NoiseFloor {
        let MeasuredChannel { name, unit, offset_differs, .. } = of[0];
        let runs = self.problem.model().setup.noise.unpredictable.channels.get(name);
        NoiseFloor {
            channel: name.clone(),
            unit: unit.clone(),
            sigma: over_logs(of, |channel| channel.sensor),
            repeatability: of[0].is_of_runs().then(|| over_logs(of, |channel| channel.sigma)),
            run_offset: runs.and_then(|runs| runs.offset).filter(|_| *offset_differs),
            assumed: self.problem.is_assumed(name),
        }
    }
}

/// A deviation of a channel over logs, weighted by their samples.
fn over_logs(of: &[&MeasuredChannel], deviation: impl Fn(&MeasuredChannel) -> f64) -> f64 {
    let first = deviation(of[0]);
    if of.iter().all(|channel| deviation(channel).to_bits() == first.to_bits()) {
        return first;
    }
    let samples = |channel: &MeasuredChannel| channel.samples.len() as f64;
    let squares = of.iter().map(|channel| samples(channel) * deviation(channel).powi(2)).sum::<f64>();
    (squares / of.iter().map(|channel| samples(channel)).sum::<f64>()).sqrt()
}

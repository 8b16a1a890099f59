//! What errors are measured in: the noise floor of each channel, or how far runs of the same command differ.

use super::VerbInput;
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

    /// The noise floor of each channel, in the first log that has it.
    pub fn floors(&self) -> Vec<NoiseFloor> {
        let mut floors: Vec<NoiseFloor> = Vec::new();
        for channel in self.problem.logs().iter().flat_map(|log| &log.channels) {
            if floors.iter().all(|floor| floor.channel != channel.name) {
                let (name, unit) = (channel.name.clone(), channel.unit.clone());
                let assumed = self.problem.is_assumed(&name);
                let repeatability = channel.is_of_runs().then_some(channel.sigma);
                let runs = self.problem.model().setup.noise.unpredictable.channels.get(&name);
                let run_offset = runs.and_then(|runs| runs.offset).filter(|_| channel.offset_differs);
                let sigma = channel.sensor;
                floors.push(NoiseFloor { channel: name, unit, sigma, repeatability, run_offset, assumed });
            }
        }
        floors
    }
}

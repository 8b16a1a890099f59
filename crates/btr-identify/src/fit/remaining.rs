//! The error that is left, channel by channel: in units, in noise floors, and in repeatability.

use super::measure::without_step_error;
use super::objective::{LogSet, Objective};
use super::residual_vector::{channels, squares};
use crate::residual_model::NOISE;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// How far an error is explained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Degree {
    /// What remains is the sensors' noise.
    Explained,
    /// What remains is more than the sensors' noise, and no more than runs of the same command differ by.
    ExplainedToRepeatability,
    /// Most is explained, and something else is missing.
    PartlyExplained,
    /// An error is left.
    Unexplained,
}

/// What is left in a channel, on the held-out logs if there are any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RemainingError {
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Root mean square error, in the unit.
    pub rmse: f64,
    /// The same in multiples of the sensor's noise floor.
    pub x_noise_floor: f64,
    /// The same in multiples of what runs of the same command differ by; none where that is not known, or no more than
    /// the sensor's noise.
    pub x_repeatability: Option<f64>,
}

/// What is left of a channel, in percent of the root mean square of its readings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RelativeError {
    /// The channel.
    pub channel: String,
    /// On the training logs.
    pub train_percent: Option<f64>,
    /// On the held-out logs.
    pub held_out_percent: Option<f64>,
}

/// The sums of a channel over logs.
#[derive(Default)]
struct ChannelSum {
    unit: String,
    samples: f64,
    squares: f64,
    in_sensor_noise: f64,
    in_runs: Option<f64>,
}

/// The remaining error of each channel at a point; empty where that cannot be simulated.
pub(crate) fn remaining(objective: &Objective, u: &[f64]) -> Vec<RemainingError> {
    let set = if objective.logs(LogSet::HeldOut).is_empty() { LogSet::Learn } else { LogSet::HeldOut };
    let Some(residual) = without_step_error(objective, &[u], set).pop().flatten() else { return Vec::new() };
    let logs = || objective.logs(set).iter().map(|&log| &objective.description.logs[log]);
    let mut sums: IndexMap<&str, ChannelSum> = IndexMap::new();
    for (rows, channel) in channels(logs()).into_iter().zip(logs().flat_map(|log| &log.channels)) {
        // Rows that are not compared are zero.
        let residual = &residual[rows];
        let (present, square) = (residual.iter().filter(|r| **r != 0.0).count(), squares(residual));
        let sum = sums.entry(&channel.name).or_default();
        sum.unit.clone_from(&channel.unit);
        sum.samples += present as f64;
        sum.squares += residual.iter().enumerate().map(|(i, r)| (r * channel.sigma_at(i)).powi(2)).sum::<f64>();
        sum.in_sensor_noise += square * (channel.sigma / channel.sensor).powi(2);
        if channel.is_of_runs() {
            *sum.in_runs.get_or_insert_default() += square;
        }
    }
    let error = |(name, sum): (&str, ChannelSum)| {
        let root = |squares: f64| (squares / sum.samples).sqrt();
        RemainingError {
            channel: name.to_owned(),
            rmse: root(sum.squares),
            x_noise_floor: root(sum.in_sensor_noise),
            x_repeatability: sum.in_runs.map(root),
            unit: sum.unit,
        }
    };
    sums.into_iter().filter(|(_, sum)| sum.samples > 0.0).map(error).collect()
}

/// What is left of each channel at a point; empty where the model does not know the measured values.
pub(crate) fn relative_errors(objective: &Objective, u: &[f64]) -> Vec<RelativeError> {
    let of_set = |set: LogSet| percents(objective, u, set).unwrap_or_default();
    let (train, held_out) = (of_set(LogSet::Learn), of_set(LogSet::HeldOut));
    let error = |(channel, percent): (&String, &f64)| RelativeError {
        channel: channel.clone(),
        train_percent: Some(*percent).filter(|percent| percent.is_finite()),
        held_out_percent: held_out.get(channel).copied().filter(|percent| percent.is_finite()),
    };
    train.iter().map(error).collect()
}

/// For each channel of a set of logs, the root mean square of its residual in percent of that of its readings.
fn percents(objective: &Objective, u: &[f64], set: LogSet) -> Option<IndexMap<String, f64>> {
    let residual = objective.residual(u, set).ok()?;
    let (mut sums, mut first): (IndexMap<String, [f64; 2]>, usize) = (IndexMap::new(), 0);
    for &log in objective.logs(set) {
        let (recorded, measured) = (&objective.description.logs[log], &objective.description.measured[log]);
        for channel in &recorded.channels {
            let of_log = residual.get(first..first + recorded.rows())?.get(channel.samples.clone())?;
            let [left, whole] = sums.entry(channel.name.clone()).or_default();
            // Rows that are not compared are zero.
            let pairs = of_log.iter().zip(measured.get(channel.samples.clone())?).enumerate();
            for (i, (r, y)) in pairs.filter(|(_, (r, _))| **r != 0.0) {
                *left += (r * channel.sigma_at(i)).powi(2);
                *whole += y * y;
            }
        }
        first += recorded.rows();
    }
    Some(sums.into_iter().map(|(name, [left, whole])| (name, 100.0 * (left / whole).sqrt())).collect())
}

impl Degree {
    /// That of an error which counts as noise, by what is left in the channels.
    pub(crate) fn of_noise(left: &[RemainingError]) -> Self {
        match left.iter().any(|channel| channel.x_repeatability.is_some() && channel.x_noise_floor > NOISE) {
            true => Degree::ExplainedToRepeatability,
            false => Degree::Explained,
        }
    }
}

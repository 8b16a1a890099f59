//! The result of a comparison.

use super::failure::RegimeCell;
use super::pair::ChannelResidual;
use super::track::JointTrack;

/// Errors of a model on its logs, per channel and per joint and regime.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// One per measured channel that is in the recorded and the simulated logs, in their order.
    pub channels: Vec<ChannelError>,
    /// Every joint in every regime that occurs.
    pub cells: Vec<RegimeCell>,
    /// One per log and measured channel: the residuals that the errors above summarise.
    pub residuals: Vec<ChannelResidual>,
    /// One per log and joint: its motion and its residual.
    pub tracks: Vec<JointTrack>,
}

/// How far a channel is off, over all logs.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelError {
    /// Its name.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Samples that are both measured and simulated.
    pub samples: usize,
    /// Root mean square of the error, in the unit.
    pub rmse: f64,
    /// The root mean square of the error in percent of that of the readings; `None` for a channel of zeros.
    pub error_percent: Option<f64>,
    /// 100·(1 - |e|/|y - mean|), with the mean of each log; `None` for a channel that does not change.
    pub fit_percent: Option<f64>,
    /// Mean error, in the unit.
    pub bias: f64,
    /// Lag of the measured channel behind the simulated one, in s; `None` where they do not correlate at any shift.
    pub lag_s: Option<f64>,
    /// The error that the sensor's noise alone would leave, in the unit.
    pub noise_floor: f64,
    /// The error in multiples of the noise floor.
    pub chi: f64,
    /// Whether the error looks like noise.
    pub white: bool,
    /// Whether the error is independent of the commands.
    pub independent: bool,
}

impl Comparison {
    /// Where the model fails: cells whose error is above the noise. Sorted by how much their share of the squared error
    /// exceeds their share of the time, largest first.
    pub fn failures(&self) -> Vec<&RegimeCell> {
        let mut failures: Vec<&RegimeCell> = self.cells.iter().filter(|cell| cell.is_failure()).collect();
        failures.sort_by(|a, b| b.excess.total_cmp(&a.excess));
        failures
    }

    /// The channel that is furthest off, in multiples of its noise floor.
    pub fn worst(&self) -> Option<&ChannelError> {
        self.channels.iter().max_by(|a, b| a.chi.total_cmp(&b.chi))
    }
}

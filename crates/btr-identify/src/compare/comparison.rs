//! The result of a comparison.

use super::failure::RegimeCell;
use super::pair::ChannelResidual;
use super::track::JointTrack;

/// What was found.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// One per measured channel that is in the recorded and the simulated logs, in their order.
    pub channels: Vec<ChannelError>,
    /// Every joint in every regime that it was in.
    pub cells: Vec<RegimeCell>,
    /// One per log and measured channel: what the numbers above are made of.
    pub residuals: Vec<ChannelResidual>,
    /// One per log and joint: its motion beside its residual.
    pub tracks: Vec<JointTrack>,
}

/// How far a channel is off, over all logs.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelError {
    /// Its name.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Samples that are there on both sides.
    pub samples: usize,
    /// Root mean square of the error, in the unit.
    pub rmse: f64,
    /// 100·(1 - |e|/|y - mean|), the mean being each log's own; `None` for a channel that does not change.
    pub fit_percent: Option<f64>,
    /// Mean error, in the unit.
    pub bias: f64,
    /// How much later than simulated the channel was measured, in s; `None` where no shift makes the two alike.
    pub lag_s: Option<f64>,
    /// What the sensor's errors alone would leave, in the unit.
    pub noise_floor: f64,
    /// The error in multiples of the noise floor.
    pub chi: f64,
    /// Whether the error looks like noise.
    pub white: bool,
    /// Whether the error is independent of the commands.
    pub independent: bool,
}

impl Comparison {
    /// Where the model fails: cells whose error is above the noise, those first that hold most of the squared error beyond
    /// their share of the time.
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

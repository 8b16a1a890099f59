//! Where a simulation differs from what was measured: per channel, and per joint and regime of motion.
//!
//! Works on logs alone and knows nothing of robots: a joint is whatever has a channel `q_<joint>`. Errors are measured minus
//! simulated. Samples that are missing on either side are skipped, never interpolated over.

mod clue;
mod failure;
mod regime;
mod spectrum;
mod track;

pub use clue::Clue;
pub use failure::{FoundClue, RegimeCell};
pub use regime::Regime;
pub use spectrum::spectrum;
pub use track::JointTrack;

use btr_core::log::{Log, Role, interpolate};
use btr_core::signal::lag::lag;
use btr_core::signal::stats::{Whiteness, dependence};
use indexmap::IndexMap;

/// How far a time shift is looked for, in s.
const MOST_LAG_S: f64 = 0.25;
/// A lag between series that are less alike than this is none.
const LEAST_LIKENESS: f64 = 0.5;
/// Standard deviations that a correlation of the residual with an input has to exceed; with a few dozen of them looked at.
const DEPENDENT: f64 = 4.0;

/// A recorded log beside its simulation.
#[derive(Clone, Copy, Debug)]
pub struct LogPair<'a> {
    /// What the log is called.
    pub name: &'a str,
    /// What was measured.
    pub real: &'a Log,
    /// What the model says instead, to the same commands.
    pub simulated: &'a Log,
}

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
    /// Whether the error has nothing to do with what the robot was told.
    pub independent: bool,
}

/// The error of one channel in one log.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelResidual {
    /// The log, counted from 0.
    pub log: usize,
    /// The channel.
    pub channel: String,
    /// SI unit as text.
    pub unit: String,
    /// The simulated channel on the recorded clock; NaN beyond the simulation's ends.
    pub simulated: Vec<f64>,
    /// Measured minus simulated; NaN where one is missing.
    pub error: Vec<f64>,
    /// Standard deviation of the sensor's error.
    pub floor: f64,
}

/// Compares logs with their simulations. `floor` tells a channel's noise floor from its name and its readings; channels for
/// which it tells none are left out.
pub fn compare(episodes: &[LogPair], floor: impl Fn(&str, &[f64]) -> Option<f64>) -> Comparison {
    let mut residuals = Vec::new();
    for (log, episode) in episodes.iter().enumerate() {
        let channels = episode.real.channels().filter(|(_, channel)| channel.role == Role::Measured);
        residuals.extend(channels.filter_map(|(name, channel)| {
            let simulated = on_clock(episode.simulated, name, episode.real.clock_s())?;
            let floor = floor(name, &channel.values).filter(|floor| *floor > 0.0)?;
            let error: Vec<f64> = channel.values.iter().zip(&simulated).map(|(real, sim)| real - sim).collect();
            let there = error.iter().any(|e| e.is_finite());
            let (channel, unit) = (name.to_owned(), channel.unit.clone());
            there.then_some(ChannelResidual { log, channel, unit, simulated, error, floor })
        }));
    }
    let tracks: Vec<JointTrack> = residuals.iter().filter_map(|r| JointTrack::new(r, &episodes[r.log])).collect();
    let mut by_channel: IndexMap<&str, Vec<&ChannelResidual>> = IndexMap::new();
    residuals.iter().for_each(|r| by_channel.entry(&r.channel).or_default().push(r));
    let channels = by_channel.values().map(|all| channel_error(all, episodes)).collect();
    let cells = failure::cells(&tracks, episodes);
    Comparison { channels, cells, residuals, tracks }
}

/// A channel of a simulation on another clock: linear between its samples, NaN beyond its ends.
fn on_clock(simulated: &Log, name: &str, clock_s: &[f64]) -> Option<Vec<f64>> {
    let own = simulated.clock_s();
    let (first, last) = (*own.first()?, *own.last()?);
    let mut values = interpolate(own, &simulated.channel(name)?.values, clock_s);
    // A stamp that was rounded is not beyond the end.
    let slack = 0.1 * simulated.usual_step_s().unwrap_or(0.0);
    let beyond = |t: f64| t < first - slack || t > last + slack;
    values.iter_mut().zip(clock_s).filter(|(_, t)| beyond(**t)).for_each(|(value, _)| *value = f64::NAN);
    Some(values)
}

/// A channel over all logs.
fn channel_error(residuals: &[&ChannelResidual], episodes: &[LogPair]) -> ChannelError {
    let real =
        |r: &ChannelResidual| episodes[r.log].real.channel(&r.channel).map_or(&[][..], |channel| &channel.values);
    let (mut n, mut sum, mut squares, mut spread, mut floors) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for residual in residuals {
        let there = || real(residual).iter().zip(&residual.error).filter(|(_, e)| e.is_finite());
        let count = there().count() as f64;
        let mean = there().map(|(y, _)| y).sum::<f64>() / count;
        n += count;
        sum += there().map(|(_, e)| e).sum::<f64>();
        squares += there().map(|(_, e)| e * e).sum::<f64>();
        spread += there().map(|(y, _)| (y - mean).powi(2)).sum::<f64>();
        floors += count * residual.floor.powi(2);
    }
    let (rmse, noise_floor) = ((squares / n).sqrt(), (floors / n).sqrt());
    let whiteness = residuals.iter().map(|r| Whiteness::of(&r.error)).fold(Whiteness::default(), Whiteness::and);
    ChannelError {
        name: residuals[0].channel.clone(),
        unit: residuals[0].unit.clone(),
        samples: n as usize,
        rmse,
        fit_percent: (spread > 0.0).then(|| 100.0 * (1.0 - (squares / spread).sqrt())),
        bias: sum / n,
        lag_s: common_lag(residuals.iter().map(|r| (&episodes[r.log], *r, real(r)))),
        noise_floor,
        chi: rmse / noise_floor,
        white: whiteness.is_white(),
        independent: residuals.iter().all(|r| independent(r, episodes[r.log].real)),
    }
}

/// The lag that all logs tell, each by its certainty.
fn common_lag<'a>(channels: impl Iterator<Item = (&'a LogPair<'a>, &'a ChannelResidual, &'a [f64])>) -> Option<f64> {
    let (mut weights, mut sum) = (0.0, 0.0);
    for (episode, residual, real) in channels {
        let found = lag(episode.real.clock_s(), &residual.simulated, real, MOST_LAG_S);
        if let Some(lag) = found.filter(|lag| lag.correlation >= LEAST_LIKENESS) {
            // No shift is known to better than a microsecond: without a floor one log would outweigh all.
            let weight = lag.sd_s.max(1e-6).powi(-2);
            weights += weight;
            sum += weight * lag.seconds;
        }
    }
    (weights > 0.0).then(|| sum / weights)
}

/// Whether a residual has nothing to do with the commands: that of its own joint, or else any.
fn independent(residual: &ChannelResidual, real: &Log) -> bool {
    const LAGS: usize = 20;
    let joint = residual.channel.split_once('_').map_or("", |(_, joint)| joint);
    let own = real.channel(&format!("cmd_{joint}"));
    let all = real.channels().filter(|(_, channel)| channel.role == Role::Command).map(|(_, channel)| channel);
    let inputs: Vec<_> = own.map_or_else(|| all.collect(), |own| vec![own]);
    inputs.iter().all(|input| dependence(&residual.error, &input.values, LAGS) < DEPENDENT)
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

#[cfg(test)]
mod tests;

//! Differences between simulation and measurement: per channel, and per joint and regime of motion.
//!
//! Works on logs alone and knows nothing of robots: a joint is whatever has a channel `q_<joint>`. It is judged by its
//! position, or by its torque where positions are not compared. Errors are measured minus simulated. Samples that are
//! missing on either side are skipped, never interpolated over.

mod clue;
mod clue_series;
mod comparison;
mod failure;
mod pair;
mod quantile;
mod regime;
mod regime_masks;
mod spectrum;
mod track;

pub use clue::Clue;
pub use comparison::{ChannelError, Comparison};
pub use failure::{FoundClue, RegimeCell};
pub use pair::{ChannelResidual, LogPair};
pub use regime::Regime;
pub use spectrum::spectrum;
pub use track::JointTrack;

use btr_core::log::{Log, Role};
use btr_core::signal::lag::lag;
use btr_core::signal::stats::{Whiteness, dependence};
use indexmap::IndexMap;
use pair::on_clock;

/// Largest time shift that is searched, in s.
const MOST_LAG_S: f64 = 0.25;
/// Smallest correlation of two series for their lag to count.
const LEAST_CORRELATION: f64 = 0.5;
/// Standard deviations that a correlation of the residual with an input has to exceed, given that a few dozen are
/// tested.
const DEPENDENT: f64 = 4.0;

/// Compares logs with their simulations. `floor` gives a channel's noise floor from its name, its readings and their
/// simulation; channels for which it gives none are left out.
pub fn compare(episodes: &[LogPair], floor: impl Fn(&str, &[f64], &[f64]) -> Option<f64>) -> Comparison {
    let mut residuals = Vec::new();
    for (log, episode) in episodes.iter().enumerate() {
        let channels = episode.real.channels().filter(|(_, channel)| channel.role == Role::Measured);
        residuals.extend(channels.filter_map(|(name, channel)| {
            let simulated = on_clock(episode.simulated, name, episode.real.clock_s())?;
            let floor = floor(name, &channel.values, &simulated).filter(|floor| *floor > 0.0)?;
            let error: Vec<f64> = channel.values.iter().zip(&simulated).map(|(real, sim)| real - sim).collect();
            let has_values = error.iter().any(|e| e.is_finite());
            let (channel, unit) = (name.to_owned(), channel.unit.clone());
            has_values.then_some(ChannelResidual { log, channel, unit, simulated, error, floor })
        }));
    }
    let judges_its_joint = |r: &ChannelResidual| match r.channel.strip_prefix("tau_") {
        Some(joint) => residuals.iter().all(|other| other.channel.strip_prefix("q_") != Some(joint)),
        None => true,
    };
    let judged = residuals.iter().filter(|r| judges_its_joint(r));
    let tracks: Vec<JointTrack> = judged.filter_map(|r| track(r, &episodes[r.log])).collect();
    let mut by_channel: IndexMap<&str, Vec<&ChannelResidual>> = IndexMap::new();
    residuals.iter().for_each(|r| by_channel.entry(&r.channel).or_default().push(r));
    let channels = by_channel.values().map(|all| channel_error(all, episodes)).collect();
    let cells = failure::cells(&tracks, episodes);
    Comparison { channels, cells, residuals, tracks }
}

/// A joint's track with its regimes and clues; `None` for residuals of anything but positions and torques.
fn track(residual: &ChannelResidual, pair: &LogPair) -> Option<JointTrack> {
    let mut track = JointTrack::new(residual, pair)?;
    track.regimes = regime_masks::regimes(&track);
    track.clues = clue_series::clues(&track);
    Some(track)
}

/// A channel over all logs.
fn channel_error(residuals: &[&ChannelResidual], episodes: &[LogPair]) -> ChannelError {
    let real =
        |r: &ChannelResidual| episodes[r.log].real.channel(&r.channel).map_or(&[][..], |channel| &channel.values);
    let (mut n, mut sum, mut squares, mut spread, mut whole, mut floors) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for residual in residuals {
        let present = || real(residual).iter().zip(&residual.error).filter(|(_, e)| e.is_finite());
        let count = present().count() as f64;
        let mean = present().map(|(y, _)| y).sum::<f64>() / count;
        n += count;
        sum += present().map(|(_, e)| e).sum::<f64>();
        squares += present().map(|(_, e)| e * e).sum::<f64>();
        spread += present().map(|(y, _)| (y - mean).powi(2)).sum::<f64>();
        whole += present().map(|(y, _)| y * y).sum::<f64>();
        floors += count * residual.floor.powi(2);
    }
    let (rmse, noise_floor) = ((squares / n).sqrt(), (floors / n).sqrt());
    let whiteness = residuals.iter().map(|r| Whiteness::of(&r.error)).fold(Whiteness::default(), Whiteness::and);
    ChannelError {
        name: residuals[0].channel.clone(),
        unit: residuals[0].unit.clone(),
        samples: n as usize,
        rmse,
        error_percent: (whole > 0.0).then(|| 100.0 * (squares / whole).sqrt()),
        fit_percent: (spread > 0.0).then(|| 100.0 * (1.0 - (squares / spread).sqrt())),
        bias: sum / n,
        lag_s: common_lag(residuals.iter().map(|r| (&episodes[r.log], *r, real(r)))),
        noise_floor,
        chi: rmse / noise_floor,
        white: whiteness.is_white(),
        independent: residuals.iter().all(|r| independent(r, episodes[r.log].real)),
    }
}

/// The mean lag over all logs, weighted by its certainty.
fn common_lag<'a>(channels: impl Iterator<Item = (&'a LogPair<'a>, &'a ChannelResidual, &'a [f64])>) -> Option<f64> {
    let (mut weights, mut sum) = (0.0, 0.0);
    for (episode, residual, real) in channels {
        let found = lag(episode.real.clock_s(), &residual.simulated, real, MOST_LAG_S);
        if let Some(lag) = found.filter(|lag| lag.correlation >= LEAST_CORRELATION) {
            // No shift is known to better than a microsecond: without a floor one log would outweigh all.
            let weight = lag.sd_s.max(1e-6).powi(-2);
            weights += weight;
            sum += weight * lag.seconds;
        }
    }
    (weights > 0.0).then(|| sum / weights)
}

/// Whether a residual is uncorrelated with the command of its joint or, without one, with all commands.
fn independent(residual: &ChannelResidual, real: &Log) -> bool {
    const LAGS: usize = 20;
    let joint = residual.channel.split_once('_').map_or("", |(_, joint)| joint);
    let of_joint = real.channel(&format!("cmd_{joint}"));
    let all = real.channels().filter(|(_, channel)| channel.role == Role::Command).map(|(_, channel)| channel);
    let inputs: Vec<_> = of_joint.map_or_else(|| all.collect(), |command| vec![command]);
    inputs.iter().all(|input| dependence(&residual.error, &input.values, LAGS) < DEPENDENT)
}

#[cfg(test)]
mod tests;

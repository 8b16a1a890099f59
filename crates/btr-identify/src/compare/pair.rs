//! A log paired with its simulation, and the error of each of its channels.

use btr_core::log::{Log, interpolate};

/// A recorded log paired with its simulation.
#[derive(Clone, Copy, Debug)]
pub struct LogPair<'a> {
    /// Name of the log.
    pub name: &'a str,
    /// The recorded log.
    pub real: &'a Log,
    /// The model's simulation of the same commands.
    pub simulated: &'a Log,
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

/// A channel of a simulation on another clock: linear between its samples, NaN beyond its ends.
pub(super) fn on_clock(simulated: &Log, name: &str, clock_s: &[f64]) -> Option<Vec<f64>> {
    let simulated_s = simulated.clock_s();
    let (first, last) = (*simulated_s.first()?, *simulated_s.last()?);
    let mut values = interpolate(simulated_s, &simulated.channel(name)?.values, clock_s);
    // Rounded time stamps do not count as beyond the end.
    let slack = 0.1 * simulated.usual_step_s().unwrap_or(0.0);
    let beyond = |t: f64| t < first - slack || t > last + slack;
    values.iter_mut().zip(clock_s).filter(|(_, t)| beyond(**t)).for_each(|(value, _)| *value = f64::NAN);
    Some(values)
}

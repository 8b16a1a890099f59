//! Logs: a robot's commands and its sensors' readings on one clock.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// Role of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// A command to the robot (the paper's motor history O).
    Command,
    /// A sensor's reading (the paper's sensor history I).
    Measured,
    /// A quantity that no sensor of the robot measures, but a tracker or the simulator knows (base pose, ball, true
    /// torque).
    Truth,
}

/// One time series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// SI unit as text.
    pub unit: String,
    /// Command, sensor or outside knowledge.
    pub role: Role,
    /// One value for each tick of the log's clock; NaN where the sample is missing.
    pub values: Vec<f64>,
}

/// Channels that share a clock. Names follow the convention `cmd_<joint>`, `q_<joint>`, `dq_<joint>`, `tau_<joint>`,
/// `imu_*`, `foot_*`, `base_*`, `ball_*`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredLog")]
pub struct Log {
    clock_s: Vec<f64>,
    channels: IndexMap<String, Channel>,
}

/// A log as it is stored and sent: what is read is checked as what is made.
#[derive(Deserialize)]
struct StoredLog {
    clock_s: Vec<f64>,
    channels: IndexMap<String, Channel>,
}

impl TryFrom<StoredLog> for Log {
    type Error = LogError;

    fn try_from(StoredLog { clock_s, channels }: StoredLog) -> Result<Self, LogError> {
        let mut log = Log::new(clock_s)?;
        for (name, Channel { unit, role, values }) in channels {
            log.insert(name, unit, role, values)?;
        }
        Ok(log)
    }
}

/// Error of a log.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The clock stands still, runs backwards or is not a number.
    #[error("the clock does not increase at sample {index}: {before} s, then {after} s")]
    Clock {
        /// The later sample.
        index: usize,
        /// Time before it.
        before: f64,
        /// Its time.
        after: f64,
    },
    /// A channel with more or fewer values than the clock.
    #[error("channel `{channel}` has {got} values, but the clock has {expected}")]
    Length {
        /// The channel.
        channel: String,
        /// Ticks of the clock.
        expected: usize,
        /// Values of the channel.
        got: usize,
    },
    /// A required channel that the log does not have.
    #[error("the log has no channel `{channel}`")]
    Missing {
        /// The channel.
        channel: String,
        /// The channels of the log.
        available: Vec<String>,
    },
}

impl Log {
    /// A log without channels on the given clock (seconds, strictly increasing).
    ///
    /// # Errors
    /// [`LogError::Clock`] at the first sample that does not come after its predecessor.
    pub fn new(clock_s: Vec<f64>) -> Result<Self, LogError> {
        if let Some(first) = clock_s.first().filter(|t| !t.is_finite()) {
            return Err(LogError::Clock { index: 0, before: f64::NEG_INFINITY, after: *first });
        }
        for (i, pair) in clock_s.windows(2).enumerate() {
            if !(pair[1] > pair[0] && pair[1].is_finite()) {
                return Err(LogError::Clock { index: i + 1, before: pair[0], after: pair[1] });
            }
        }
        Ok(Log { clock_s, channels: IndexMap::new() })
    }

    /// Adds a channel (or replaces the one of that name).
    ///
    /// # Errors
    /// [`LogError::Length`] unless there is one value per tick.
    pub fn insert(
        &mut self,
        name: impl Into<String>,
        unit: impl Into<String>,
        role: Role,
        values: Vec<f64>,
    ) -> Result<(), LogError> {
        let name = name.into();
        if values.len() != self.clock_s.len() {
            return Err(LogError::Length { channel: name, expected: self.clock_s.len(), got: values.len() });
        }
        self.channels.insert(name, Channel { unit: unit.into(), role, values });
        Ok(())
    }

    /// The clock in seconds.
    pub fn clock_s(&self) -> &[f64] {
        &self.clock_s
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.clock_s.len()
    }

    /// True when there is no sample.
    pub fn is_empty(&self) -> bool {
        self.clock_s.is_empty()
    }

    /// Time from the first to the last sample, in seconds.
    pub fn duration_s(&self) -> f64 {
        match (self.clock_s.first(), self.clock_s.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// The same log with its first sample at time zero, as simulations have it; recorders count from any epoch.
    #[must_use]
    pub fn from_zero(mut self) -> Self {
        if let Some(start) = self.clock_s.first().copied() {
            self.clock_s.iter_mut().for_each(|t| *t -= start);
        }
        self
    }

    /// Some samples of the log, at their times.
    #[must_use]
    pub fn part(&self, samples: std::ops::Range<usize>) -> Log {
        let cut = |channel: &Channel| Channel {
            unit: channel.unit.clone(),
            role: channel.role,
            values: channel.values[samples.clone()].to_vec(),
        };
        let channels = self.channels.iter().map(|(name, channel)| (name.clone(), cut(channel))).collect();
        Log { clock_s: self.clock_s[samples.clone()].to_vec(), channels }
    }

    /// Means over `count` samples in a row, at the mean of their times: a log of a lower rate, into which no noise is
    /// folded. A mean with a missing sample is missing, and no mean reaches over a gap in the clock.
    #[must_use]
    pub fn means(&self, count: usize) -> Log {
        let longest = 1.5 * self.usual_step_s().unwrap_or(f64::INFINITY);
        let (mut groups, mut first) = (Vec::new(), 0);
        for next in 1..=self.len() {
            let is_gap = self.clock_s.get(next).is_some_and(|t| t - self.clock_s[next - 1] > longest);
            if next - first == count.max(1) {
                groups.push(first..next);
                first = next;
            } else if is_gap {
                first = next;
            }
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let means = |values: &[f64]| groups.iter().map(|group| mean(&values[group.clone()])).collect();
        let of = |channel: &Channel| Channel { values: means(&channel.values), unit: channel.unit.clone(), ..*channel };
        let channels = self.channels.iter().map(|(name, channel)| (name.clone(), of(channel))).collect();
        Log { clock_s: means(&self.clock_s), channels }
    }

    /// The usual time between two samples, in seconds: the mean, in which jitter cancels, over all steps that are no
    /// gaps (longer than one and a half medians). `None` with fewer than two samples.
    pub fn usual_step_s(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.clock_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let middle = steps.len() / 2;
        if steps.is_empty() {
            return None;
        }
        let longest = 1.5 * *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        let (sum, count) = steps
            .iter()
            .filter(|step| **step <= longest)
            .fold((0.0, 0.0), |(sum, count), step| (sum + step, count + 1.0));
        Some(sum / count)
    }

    /// The channels with their names, in the order in which they were added.
    pub fn channels(&self) -> impl ExactSizeIterator<Item = (&str, &Channel)> {
        self.channels.iter().map(|(name, channel)| (name.as_str(), channel))
    }

    /// Whether both hold the same samples at the same times, missing ones included.
    pub fn is_same(&self, other: &Log) -> bool {
        let same = |a: &[f64], b: &[f64]| a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()));
        let channel =
            |(name, channel): (&str, &Channel)| other.channel(name).is_some_and(|o| same(&channel.values, &o.values));
        same(&self.clock_s, &other.clock_s)
            && self.channels.len() == other.channels.len()
            && self.channels().all(channel)
    }

    /// The channel of that name.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.get(name)
    }

    /// Mutable values of a channel.
    pub fn values_mut(&mut self, name: &str) -> Option<&mut [f64]> {
        self.channels.get_mut(name).map(|channel| channel.values.as_mut_slice())
    }

    /// Drops the channels for which `keep` is false.
    pub fn retain(&mut self, mut keep: impl FnMut(&str, &Channel) -> bool) {
        self.channels.retain(|name, channel| keep(name, channel));
    }

    /// The values of a required channel.
    ///
    /// # Errors
    /// [`LogError::Missing`] with the names of the log's channels.
    pub fn values(&self, name: &str) -> Result<&[f64], LogError> {
        self.channels.get(name).map(|c| c.values.as_slice()).ok_or_else(|| LogError::Missing {
            channel: name.to_owned(),
            available: self.channels.keys().cloned().collect(),
        })
    }

    /// Every channel resampled to another clock: linear between samples, held at the ends. Commands keep the value of
    /// the last sample before the tick, as servos do. A NaN neighbour gives NaN.
    ///
    /// # Errors
    /// [`LogError::Clock`] when the new clock does not increase.
    pub fn resample(&self, clock_s: &[f64]) -> Result<Log, LogError> {
        let mut resampled = Log::new(clock_s.to_vec())?;
        for (name, channel) in &self.channels {
            let values = match channel.role {
                Role::Command => hold(&self.clock_s, &channel.values, clock_s),
                Role::Measured | Role::Truth => interpolate(&self.clock_s, &channel.values, clock_s),
            };
            resampled.insert(name.clone(), channel.unit.clone(), channel.role, values)?;
        }
        Ok(resampled)
    }
}

/// Linear interpolation of `(x, y)` at increasing `at`; held beyond the ends.
pub fn interpolate(x: &[f64], y: &[f64], at: &[f64]) -> Vec<f64> {
    sweep(x, y, at, |i, t| {
        let share = (t - x[i]) / (x[i + 1] - x[i]);
        y[i] + share * (y[i + 1] - y[i])
    })
}

/// Interpolation of `(x, y)` at increasing `at` by the cubics that have these slopes at the samples (C. Hermite); held
/// beyond the ends.
pub fn interpolate_smoothly(x: &[f64], y: &[f64], slopes: &[f64], at: &[f64]) -> Vec<f64> {
    sweep(x, y, at, |i, t| {
        let long = x[i + 1] - x[i];
        let (share, rise) = ((t - x[i]) / long, y[i + 1] - y[i]);
        let (before, after) = (slopes[i] * long - rise, slopes[i + 1] * long - rise);
        let rest = 1.0 - share;
        y[i] + share * (rise + rest * (rest * before - share * after))
    })
}

/// Zero-order hold of `(x, y)` at increasing `at`: the last value at or before each tick.
pub fn hold(x: &[f64], y: &[f64], at: &[f64]) -> Vec<f64> {
    sweep(x, y, at, |i, _| y[i])
}

/// Walks once through `at` and calls `between(i, t)` for ticks with `x[i] <= t < x[i + 1]`.
fn sweep(x: &[f64], y: &[f64], at: &[f64], between: impl Fn(usize, f64) -> f64) -> Vec<f64> {
    let Some(last) = x.len().checked_sub(1) else { return vec![f64::NAN; at.len()] };
    let mut i = 0;
    at.iter()
        .map(|&t| {
            while i < last && x[i + 1] <= t {
                i += 1;
            }
            if i == last || t < x[0] { y[i] } else { between(i, t) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn cubics_with_their_slopes_are_met_between_samples() {
        let (y, slope) = (|x: f64| x.powi(3) - 2.0 * x * x + 0.5, |x: f64| 3.0 * x * x - 4.0 * x);
        let x = [0.0, 0.7, 1.0, 2.5];
        let at = [-1.0, 0.0, 0.2, 0.69, 0.7, 1.3, 2.2, 2.5, 4.0];
        let found = interpolate_smoothly(&x, &x.map(y), &x.map(slope), &at);
        for (at, found) in at.iter().zip(found) {
            assert!((found - y(at.clamp(0.0, 2.5))).abs() < 1e-12, "{found} at {at}");
        }
    }

    #[test]
    fn means_keep_straight_lines_and_stop_at_gaps_and_missing_samples() {
        let clock: Vec<f64> = (0..23).map(|i| 0.001 * f64::from(i) + if i > 11 { 1.0 } else { 0.0 }).collect();
        let line = |t: &f64| 3.0 - 2.0 * t;
        let mut values: Vec<f64> = clock.iter().map(line).collect();
        values[1] = f64::NAN;
        let mut log = Log::new(clock).unwrap();
        log.insert("q_hip", "rad", Role::Measured, values).unwrap();
        let means = log.means(5);
        let times: Vec<f64> = means.clock_s().iter().map(|t| (t * 1e6).round() / 1e6).collect();
        assert_eq!(times, [0.002, 0.007, 1.014, 1.019]);
        let values = means.values("q_hip").unwrap();
        assert!(values[0].is_nan());
        means.clock_s().iter().zip(values).skip(1).for_each(|(t, q)| assert!((q - line(t)).abs() < 1e-12));
    }

    #[test]
    fn the_usual_step_is_free_of_jitter_and_gaps() {
        // A hundredth with jitter of a tenth of it, and one hole, counted from an epoch.
        let jitter = |i: u32| 1e-3 * (f64::from(i) * 12.9898).sin();
        let clock = (0..1000).map(|i| 1.7e9 + 0.01 * f64::from(i) + jitter(i) + if i > 500 { 3.0 } else { 0.0 });
        let log = Log::new(clock.collect()).unwrap();
        assert!((log.usual_step_s().unwrap() - 0.01).abs() < 5e-6, "{:?}", log.usual_step_s());
        let moved = log.clone().from_zero();
        assert!(moved.clock_s()[0].to_bits() == 0 && (moved.duration_s() - log.duration_s()).abs() < 1e-9);
        assert!(Log::new(vec![4.0]).unwrap().usual_step_s().is_none());
    }

    #[test]
    fn a_damaged_log_is_no_log() {
        let mut log = Log::new(vec![0.0, 0.5]).unwrap();
        log.insert("q_knee", "rad", Role::Measured, vec![0.25, 0.75]).unwrap();
        let text = toml::to_string(&log).unwrap();
        assert_eq!(toml::from_str::<Log>(&text).unwrap(), log);
        for (whole, damaged) in [("[0.25, 0.75]", "[0.25]"), ("[0.0, 0.5]", "[0.5, 0.0]")] {
            assert!(text.contains(whole), "{text}");
            assert!(toml::from_str::<Log>(&text.replace(whole, damaged)).is_err(), "{damaged}");
        }
    }
}

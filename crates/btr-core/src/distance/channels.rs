//! Which channels are compared, on which clock, and in which unit.

use crate::log::{Log, Role, hold, interpolate};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// The channels that a distance compares, by name; `*` stands for any characters (`q_*`, `*_knee`), once per pattern.
/// No pattern at all means every channel.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(transparent)]
pub struct Channels(pub Vec<String>);

impl Channels {
    /// True when the channel of that name is compared.
    pub fn contains(&self, name: &str) -> bool {
        self.0.is_empty() || self.0.iter().any(|pattern| matches(pattern, name))
    }

    /// The patterns that match no channel of the log: most likely misspelt.
    pub fn unmatched(&self, log: &Log) -> Vec<&str> {
        let idle = |pattern: &&String| !log.channels().any(|(name, _)| matches(pattern, name));
        self.0.iter().filter(idle).map(String::as_str).collect()
    }

    /// The channels both logs have, in the real log's order, the simulated ones on the real clock (commands held,
    /// measurements interpolated, both held beyond the ends). [`Role::Truth`] is left out: no robot measures it.
    pub(super) fn pairs<'a>(&'a self, real: &'a Log, sim: &'a Log) -> impl Iterator<Item = ChannelPair<'a>> {
        let same_clock = real.clock_s() == sim.clock_s();
        real.channels().filter_map(move |(name, channel)| {
            if channel.role == Role::Truth || !self.contains(name) {
                return None;
            }
            let other = &sim.channel(name)?.values;
            let sim = match channel.role {
                _ if same_clock => Cow::Borrowed(other.as_slice()),
                Role::Command => Cow::Owned(hold(sim.clock_s(), other, real.clock_s())),
                _ => Cow::Owned(interpolate(sim.clock_s(), other, real.clock_s())),
            };
            Some(ChannelPair { name, unit: &channel.unit, role: channel.role, real: &channel.values, sim })
        })
    }

    /// One error per measured channel, each as a share of the channel's [scale](scales). `error` gives the error in the
    /// channel's own unit, or `None` for a channel that cannot be compared, which is then left out.
    pub(super) fn scaled_errors(
        &self,
        real: &Log,
        sim: &Log,
        mut error: impl FnMut(&[f64], &[f64]) -> Option<f64>,
    ) -> Vec<f64> {
        let pairs: Vec<ChannelPair> = self.pairs(real, sim).filter(|pair| pair.role == Role::Measured).collect();
        let errors = pairs.iter().zip(scales(&pairs));
        errors.filter_map(|(pair, scale)| error(pair.real, &pair.sim).map(|e| e / scale)).collect()
    }

    /// The errors of every sample of every measured channel, scaled so that the sum of their squares is the mean over
    /// the channels of the squared error, each as a share of its channel's [scale](scales). NaN where a sample is
    /// missing.
    pub(super) fn scaled_residuals(&self, real: &Log, sim: &Log) -> Vec<Vec<f64>> {
        let pairs: Vec<ChannelPair> = self.pairs(real, sim).filter(|pair| pair.role == Role::Measured).collect();
        let counts: Vec<f64> = pairs.iter().map(|pair| sum_pairs(pair.real, &pair.sim, |a, b| a - b).1).collect();
        let channels = counts.iter().filter(|count| **count > 0.0).count() as f64;
        let block = |((pair, scale), count): ((&ChannelPair, f64), &f64)| {
            let share = (scale * (count * channels).sqrt()).recip();
            pair.real.iter().zip(pair.sim.iter()).map(|(real, sim)| (sim - real) * share).collect()
        };
        pairs.iter().zip(scales(&pairs)).zip(&counts).map(block).collect()
    }
}

/// One channel of both logs on the same clock.
pub(super) struct ChannelPair<'a> {
    pub(super) name: &'a str,
    unit: &'a str,
    pub(super) role: Role,
    pub(super) real: &'a [f64],
    pub(super) sim: Cow<'a, [f64]>,
}

/// The scale of each channel's errors, so that units mix: the standard deviation of the real channel.
///
/// The noise of a channel that hardly moves (a held joint) would dominate. Its scale is therefore at least a tenth of
/// that of the compared channel of the same unit that moves most; where none of them moves it is 1 SI unit.
fn scales(pairs: &[ChannelPair]) -> Vec<f64> {
    const FLOOR: f64 = 0.1;
    const STANDSTILL: f64 = 1e-9;
    let spreads: Vec<f64> = pairs.iter().map(|pair| spread(pair.real)).collect();
    let liveliest = |unit: &str| {
        let family = pairs.iter().zip(&spreads).filter(|(pair, _)| pair.unit == unit);
        family.map(|(_, spread)| *spread).fold(0.0, f64::max)
    };
    let scale = |(pair, spread): (&ChannelPair, &f64)| match liveliest(pair.unit) {
        most if most > STANDSTILL => spread.max(FLOOR * most),
        _ => 1.0,
    };
    pairs.iter().zip(&spreads).map(scale).collect()
}

/// Standard deviation of the present samples; NaN without any.
fn spread(x: &[f64]) -> f64 {
    let (sum, count) = sum_pairs(x, x, |v, _| v);
    let mean = sum / count;
    let (squares, count) = sum_pairs(x, x, |v, _| (v - mean).powi(2));
    (squares / count).sqrt()
}

/// The sum of `f` over all pairs for which it is a number, and the number of these pairs.
///
/// Eight sums side by side, because one alone would wait for every addition to finish before it starts the next.
pub(super) fn sum_pairs(x: &[f64], y: &[f64], f: impl Fn(f64, f64) -> f64) -> (f64, f64) {
    const LANES: usize = 8;
    let value = |a: f64, b: f64| {
        let value = f(a, b);
        if value.is_nan() { (0.0, 0.0) } else { (value, 1.0) }
    };
    let (mut sums, mut counts) = ([0.0; LANES], [0.0; LANES]);
    let ((xs, x_rest), (ys, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for (a, b) in xs.iter().zip(ys) {
        for lane in 0..LANES {
            let (value, count) = value(a[lane], b[lane]);
            sums[lane] += value;
            counts[lane] += count;
        }
    }
    let rest = x_rest.iter().zip(y_rest).map(|(a, b)| value(*a, *b));
    rest.fold((sums.iter().sum(), counts.iter().sum()), |total, (value, count)| (total.0 + value, total.1 + count))
}

/// Root mean square of some errors; NaN of none.
pub(super) fn root_mean_square(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Whether a name matches a pattern, in which `*` stands for any characters once.
pub(crate) fn matches(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((head, tail)) => name.len() >= head.len() + tail.len() && name.starts_with(head) && name.ends_with(tail),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn measured(channels: &[(&str, &str, &[f64])]) -> Log {
        let mut log = Log::new((0..channels[0].2.len()).map(|i| i as f64).collect()).unwrap();
        for (name, unit, values) in channels {
            log.insert(*name, *unit, Role::Measured, values.to_vec()).unwrap();
        }
        log
    }

    #[test]
    fn patterns_choose_channels() {
        let channels = Channels(vec!["q_*".into(), "*_knee".into(), "imu".into()]);
        for (name, wanted) in [("q_hip", true), ("dq_hip", false), ("tau_knee", true), ("imu", true), ("imu_x", false)]
        {
            assert_eq!(channels.contains(name), wanted, "{name}");
        }
        assert!(!Channels(vec!["ab*ba".into()]).contains("aba") && Channels::default().contains("anything"));
        let log = measured(&[("q_hip", "rad", &[0.0])]);
        assert_eq!(channels.unmatched(&log), ["*_knee", "imu"]);
    }

    #[test]
    fn a_held_joint_has_the_scale_of_joints_that_move() {
        let real = measured(&[
            ("q_a", "rad", &[-1.0, 1.0, -1.0, 1.0]),
            ("q_held", "rad", &[0.3, 0.3, 0.3, 0.3]),
            ("foot", "N", &[5.0, 5.0, 5.0, f64::NAN]),
            ("imu", "m/s^2", &[-0.02, f64::NAN, 0.02, f64::NAN]),
        ]);
        let all = Channels::default();
        let pairs: Vec<ChannelPair> = all.pairs(&real, &real).collect();
        assert_eq!(scales(&pairs), [1.0, 0.1, 1.0, 0.02]);
    }

    #[test]
    fn sums_skip_what_is_missing() {
        let x: Vec<f64> = (0..21).map(|i| if i == 3 || i == 20 { f64::NAN } else { f64::from(i) }).collect();
        assert_eq!(sum_pairs(&x, &[1.0; 21], |a, b| a * b), (210.0 - 23.0, 19.0));
    }
}

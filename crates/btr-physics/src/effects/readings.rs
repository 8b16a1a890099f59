//! Resampling of logged readings at other times.

use btr_core::log::{Log, Role, interpolate, interpolate_smoothly};

/// Replaces each sample of all measured channels by its value at the given increasing times, as [`resample`] does.
pub(super) fn resample_measured(log: &mut Log, taken_s: &[f64]) {
    let measured = log.channels().filter(|(_, channel)| channel.role == Role::Measured);
    let names: Vec<String> = measured.map(|(name, _)| name.to_owned()).collect();
    // Positions first: their interpolation uses the original velocities.
    let (positions, others): (Vec<&String>, Vec<&String>) = names.iter().partition(|name| name.starts_with("q_"));
    positions.into_iter().chain(others).for_each(|name| resample(log, name, taken_s));
}

/// Replaces each sample of a channel by its value at the given increasing times; the channel is held beyond its ends. A
/// position is interpolated with its velocity where the log has one: linear interpolation is off by an eighth of the
/// acceleration times the squared sample time. Beyond the ends it goes on at its first and last velocities, since a log
/// may begin and end while the robot moves.
pub(super) fn resample(log: &mut Log, channel: &str, taken_s: &[f64]) {
    let Ok(values) = log.values(channel) else { return };
    let rates = channel.strip_prefix("q_").and_then(|joint| log.values(&format!("dq_{joint}")).ok());
    let resampled = match rates {
        Some(rates) => {
            let mut resampled = interpolate_smoothly(log.clock_s(), values, rates, taken_s);
            let clock = log.clock_s().first().zip(log.clock_s().last());
            if let (Some((start_s, end_s)), Some((first, last))) = (clock, rates.first().zip(rates.last())) {
                for (q, t) in resampled.iter_mut().zip(taken_s) {
                    *q += first * (t - start_s).min(0.0) + last * (t - end_s).max(0.0);
                }
            }
            resampled
        }
        None => interpolate(log.clock_s(), values, taken_s),
    };
    if let Some(values) = log.values_mut(channel) {
        values.copy_from_slice(&resampled);
    }
}

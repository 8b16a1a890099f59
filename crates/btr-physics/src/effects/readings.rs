//! Resampling of logged readings at other times.

use btr_core::log::{Log, interpolate, interpolate_smoothly};

/// Replaces each sample of a channel by its value at the given increasing times; the channel is held beyond its ends. A
/// position is interpolated with its velocity where the log has one: linear interpolation is off by an eighth of the
/// acceleration times the squared sample time.
pub(super) fn resample(log: &mut Log, channel: &str, taken_s: &[f64]) {
    let Ok(values) = log.values(channel) else { return };
    let rates = channel.strip_prefix("q_").and_then(|joint| log.values(&format!("dq_{joint}")).ok());
    let resampled = match rates {
        Some(rates) => interpolate_smoothly(log.clock_s(), values, rates, taken_s),
        None => interpolate(log.clock_s(), values, taken_s),
    };
    if let Some(values) = log.values_mut(channel) {
        values.copy_from_slice(&resampled);
    }
}

//! Readings at other times than those of their log.

use btr_core::log::{Log, interpolate, interpolate_smoothly};

/// Has a channel show at each sample what it had at these increasing times; it is held beyond the ends. A position
/// moves between samples as its velocity says, where the log has that: a straight line is off by an eighth of the
/// acceleration times the squared sample time.
pub(super) fn taken_at(log: &mut Log, channel: &str, taken_s: &[f64]) {
    let Ok(values) = log.values(channel) else { return };
    let rates = channel.strip_prefix("q_").and_then(|joint| log.values(&format!("dq_{joint}")).ok());
    let found = match rates {
        Some(rates) => interpolate_smoothly(log.clock_s(), values, rates, taken_s),
        None => interpolate(log.clock_s(), values, taken_s),
    };
    if let Some(values) = log.values_mut(channel) {
        values.copy_from_slice(&found);
    }
}

//! Resampling of logged readings at other times.

use btr_core::log::{Log, Role, interpolate, interpolate_smoothly};
use std::f64::consts::PI;

/// How many samples on either side a torque is interpolated from.
const REACH: usize = 5;
/// Largest share by which their intervals may differ.
const UNEVEN: f64 = 0.1;

/// Replaces each sample of all measured channels by its value at the given increasing times, as [`resample`] does.
pub(super) fn resample_measured(log: &mut Log, taken_s: &[f64]) {
    let measured = log.channels().filter(|(_, channel)| channel.role == Role::Measured);
    let names: Vec<String> = measured.map(|(name, _)| name.to_owned()).collect();
    // Positions first: their interpolation uses the original velocities.
    let (positions, others): (Vec<&String>, Vec<&String>) = names.iter().partition(|name| name.starts_with("q_"));
    positions.into_iter().chain(others).for_each(|name| resample(log, name, taken_s));
}

/// Replaces each sample of a channel by its value at the given increasing times; the channel is held beyond its ends. A
/// torque is interpolated with all frequencies that its samples hold: a mean of two neighbours would smooth its noise,
/// and any shift would seem to explain something. A position is interpolated with its velocity where the log has one:
/// linear interpolation is off by an eighth of the acceleration times the squared sample time. Beyond the ends it goes
/// on at its first and last velocities, since a log may begin and end while the robot moves.
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
        None if channel.starts_with("tau_") => in_band(log.clock_s(), values, taken_s),
        None => interpolate(log.clock_s(), values, taken_s),
    };
    if let Some(values) = log.values_mut(channel) {
        values.copy_from_slice(&resampled);
    }
}

/// Values at the given increasing times by Lanczos' windowed sinc; near the ends, where the clock is uneven, and
/// beside what is missing, linearly.
fn in_band(clock_s: &[f64], values: &[f64], taken_s: &[f64]) -> Vec<f64> {
    let lines = interpolate(clock_s, values, taken_s);
    let at = |(t, line): (&f64, f64)| {
        let after = clock_s.partition_point(|clock| clock <= t);
        let within = (REACH..=clock_s.len().saturating_sub(REACH)).contains(&after);
        let nearby = within.then(|| &values[after - REACH..after + REACH]);
        let Some(nearby) = nearby.filter(|nearby| nearby.iter().all(|value| value.is_finite())) else { return line };
        let (before_s, after_s) = (clock_s[after - 1], clock_s[after]);
        let share = (t - before_s) / (after_s - before_s);
        let is_even = |pair: &[f64]| ((pair[1] - pair[0]) / (after_s - before_s) - 1.0).abs() < UNEVEN;
        if !clock_s[after - REACH..after + REACH].windows(2).all(is_even) {
            return line;
        }
        let weights = (0..2 * REACH).map(|k| lanczos(share + (REACH - 1) as f64 - k as f64));
        let (mut sum, mut total) = (0.0, 0.0);
        for (weight, value) in weights.zip(nearby) {
            sum += weight * value;
            total += weight;
        }
        sum / total
    };
    taken_s.iter().zip(lines).map(at).collect()
}

/// Lanczos' kernel at a distance in samples.
fn lanczos(x: f64) -> f64 {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
    sinc(x) * sinc(x / REACH as f64)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use btr_core::random::stream;
    use rand::RngExt;

    fn clock(samples: usize) -> Vec<f64> {
        (0..samples).map(|i| 0.01 * i as f64).collect()
    }

    #[test]
    fn a_torque_is_shifted_without_being_smoothed() {
        let clock_s = clock(4000);
        let mut rng = stream(1, &[]);
        // Noise as smoothing over a few samples leaves it.
        let white: Vec<f64> = (0..4004).map(|_| rng.random::<f64>() - 0.5).collect();
        let noise: Vec<f64> = white.windows(5).map(|w| w.iter().sum::<f64>() / 5.0).take(4000).collect();
        let mean_square = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64;
        for share in [0.25, 0.5] {
            let taken_s: Vec<f64> = clock_s.iter().map(|t| t + 0.01 * share).collect();
            let left = |shifted: Vec<f64>| mean_square(&shifted) / mean_square(&noise);
            assert!(left(in_band(&clock_s, &noise, &taken_s)) > 0.97);
            assert!(left(interpolate(&clock_s, &noise, &taken_s)) < 0.93);
        }
    }

    #[test]
    fn a_torque_keeps_its_samples_and_follows_a_sine_between_them() {
        let clock_s = clock(200);
        let wave = |t: f64| (40.0 * t).sin();
        let values: Vec<f64> = clock_s.iter().map(|t| wave(*t)).collect();
        let same = in_band(&clock_s, &values, &clock_s);
        assert!(same.iter().zip(&values).all(|(a, b)| (a - b).abs() < 1e-12));
        let taken_s: Vec<f64> = clock_s[..190].iter().map(|t| t + 0.003).collect();
        let shifted = in_band(&clock_s, &values, &taken_s);
        for (x, t) in shifted.iter().zip(&taken_s).skip(REACH) {
            assert!((x - wave(*t)).abs() < 2e-3, "{x} at {t}");
        }
        let mut uneven = clock_s.clone();
        uneven.remove(100);
        let fewer: Vec<f64> = uneven.iter().map(|t| wave(*t)).collect();
        let between = in_band(&uneven, &fewer, &[1.005])[0];
        assert!((between - 0.5 * (wave(0.99) + wave(1.01))).abs() < 0.2 * wave(1.0).abs(), "{between}");
        // What is missing does not spread beyond its neighbours.
        let mut gap = values;
        gap[100] = f64::NAN;
        let missing = in_band(&clock_s, &gap, &taken_s).iter().filter(|x| x.is_nan()).count();
        assert!(missing <= 2, "{missing}");
    }
}

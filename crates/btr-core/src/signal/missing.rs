//! Missing samples of a log: lost messages, torque that was off, gaps.
//!
//! A command that is missing for a moment was lost on its way to the log: servos do not release a joint and engage it
//! again within 50 ms, while messages get lost one by one or a few in a row. The last command is held over such a loss.
//! A command that is missing for longer was not sent. Where whole samples are missing for longer, both commands and
//! motion are unknown: the log is split there.

use super::smooth::parabola;
use crate::log::Log;
use std::ops::Range;

/// Fewest samples to each side of a short loss that is filled.
const SIDE: usize = 2;

/// Longest loss of a command, in s, or in samples of a slow log.
const LOST: (f64, f64) = (0.05, 3.0);
/// Least distance of samples that counts as a gap, in s, or in usual steps of a slow log.
const GAP: (f64, f64) = (0.1, 5.0);

/// A run of missing values.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// Which samples.
    pub samples: Range<usize>,
    /// From the first missing sample, by the log's clock in s.
    pub start_s: f64,
    /// Until the next value, by the log's clock in s.
    pub end_s: f64,
    /// Whether it is short enough to be a loss; otherwise nothing was commanded.
    pub lost: bool,
}

/// The runs of missing values in a log's commands.
pub fn spells(log: &Log, values: &[f64]) -> Vec<Gap> {
    let clock_s = log.clock_s();
    let usual_s = log.usual_step_s().unwrap_or(0.0);
    let most_s = longest_s(LOST, usual_s);
    let mut spells = Vec::new();
    let mut from = 0;
    for run in values.chunk_by(|a, b| a.is_nan() == b.is_nan()) {
        let samples = from..from + run.len();
        from = samples.end;
        if run[0].is_nan() {
            let start_s = clock_s[samples.start];
            let end_s = clock_s.get(samples.end).copied().unwrap_or(clock_s[samples.end - 1] + usual_s);
            let lost = end_s - start_s <= most_s && run.len() < values.len();
            spells.push(Gap { samples, start_s, end_s, lost });
        }
    }
    spells
}

/// Commands with losses filled: the last value is held, and the first one before it.
pub fn held(log: &Log, values: &[f64]) -> Vec<f64> {
    let mut held = values.to_vec();
    for Gap { samples, .. } in spells(log, values).into_iter().filter(|spell| spell.lost) {
        let known = samples.start.checked_sub(1).unwrap_or(samples.end);
        held[samples].fill(values[known]);
    }
    held
}

/// A series with its short losses filled: runs of at most `longest` missing samples, by the parabola that fits as many
/// samples on either side best. Without at least two on both, they stay missing.
pub fn bridged(clock_s: &[f64], values: &[f64], longest: usize) -> Vec<f64> {
    let mut bridged = values.to_vec();
    let mut from = 0;
    for run in values.chunk_by(|a, b| a.is_nan() == b.is_nan()) {
        let lost = from..from + run.len();
        from = lost.end;
        if !run[0].is_nan() || run.len() > longest {
            continue;
        }
        let around = lost.start.saturating_sub(longest)..(lost.end + longest).min(values.len());
        let present = |samples: Range<usize>| values[samples].iter().filter(|x| x.is_finite()).count();
        if present(around.start..lost.start) < SIDE || present(lost.end..around.end) < SIDE {
            continue;
        }
        for i in lost {
            bridged[i] = parabola(clock_s, values, around.clone(), clock_s[i]).map_or(f64::NAN, |fit| fit.value);
        }
    }
    bridged
}

/// The runs of samples without gaps between them.
pub fn pieces(log: &Log) -> Vec<Range<usize>> {
    let clock_s = log.clock_s();
    let most_s = longest_s(GAP, log.usual_step_s().unwrap_or(0.0));
    let ends = (1..clock_s.len()).filter(|&i| clock_s[i] - clock_s[i - 1] > most_s).chain([clock_s.len()]);
    let mut from = 0;
    ends.map(|end| std::mem::replace(&mut from, end)..end).collect()
}

/// The longer of both; stamps may be rounded.
fn longest_s((seconds, steps): (f64, f64), usual_s: f64) -> f64 {
    seconds.max(steps * usual_s) + 0.01 * usual_s
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn log(step_s: f64, n: u32, gap_after: u32, gap_s: f64) -> Log {
        Log::new((0..n).map(|i| step_s * f64::from(i) + if i > gap_after { gap_s } else { 0.0 }).collect()).unwrap()
    }

    #[test]
    fn what_is_missing_for_a_moment_is_held_and_for_longer_is_not() {
        for (step_s, most) in [(0.001, 50), (0.01, 5), (0.02, 3), (0.05, 3)] {
            let log = log(step_s, 200, 200, 0.0);
            let missing = |count: usize| {
                let mut values = vec![0.5; 200];
                values[100..].fill(0.7);
                values[100..100 + count].fill(f64::NAN);
                (spells(&log, &values), held(&log, &values))
            };
            let (short, long) = (missing(most), missing(most + 1));
            assert!(short.0.len() == 1 && short.0[0].lost, "{step_s}: {:?}", short.0);
            assert!((short.1[99 + most] - 0.5).abs() < 1e-12 && short.1.iter().all(|x| x.is_finite()));
            assert!(!long.0[0].lost && long.1[100..=100 + most].iter().all(|x| x.is_nan()), "{step_s}");
            assert!((long.0[0].end_s - long.0[0].start_s - step_s * (most + 1) as f64).abs() < 1e-9);
        }
    }

    #[test]
    fn the_first_command_holds_before_it_and_none_at_all_stays_none() {
        let log = log(0.01, 10, 10, 0.0);
        let mut values = vec![0.5; 10];
        values[..2].fill(f64::NAN);
        values[9] = f64::NAN;
        assert_eq!(held(&log, &values), vec![0.5; 10]);
        let short = Log::new(vec![0.0, 0.01]).unwrap();
        assert!(held(&short, &[f64::NAN; 2]).iter().all(|x| x.is_nan()));
    }

    #[test]
    fn short_losses_of_a_parabola_are_filled_exactly_and_long_ones_stay() {
        let clock_s: Vec<f64> = (0..60).map(|i| 0.01 * f64::from(i) + 0.002 * f64::from(i % 3)).collect();
        let parabola = |t: f64| 0.3 - 2.0 * t + 5.0 * t * t;
        let mut values: Vec<f64> = clock_s.iter().map(|t| parabola(*t)).collect();
        for lost in [10..13, 15..16, 30..34, 0..1, 58..59] {
            values[lost].fill(f64::NAN);
        }
        let bridged = bridged(&clock_s, &values, 3);
        for (i, value) in bridged.iter().enumerate() {
            let is_left = (30..34).contains(&i) || i == 0 || i == 58;
            assert!(
                if is_left { value.is_nan() } else { (value - parabola(clock_s[i])).abs() < 1e-12 },
                "{i}: {value}"
            );
        }
    }

    #[test]
    fn a_log_falls_apart_at_its_gaps() {
        assert_eq!(pieces(&log(0.01, 100, 39, 0.5)), [0..40, 40..100]);
        assert_eq!(pieces(&log(0.01, 100, 39, 0.08)).len(), 1);
        // A slow log has no gap where one sample is missing.
        assert_eq!(pieces(&log(0.05, 100, 39, 0.1)).len(), 1);
        assert_eq!(pieces(&Log::default()), std::iter::once(0..0).collect::<Vec<_>>());
    }
}

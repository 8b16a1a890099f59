//! Readings that stay constant bit by bit while the joint's command moves.

use super::report::{Finding, Severity, Topic};
use btr_core::log::{Channel, Log};
use btr_core::signal::noise::NoiseEstimate;
use std::ops::Range;

/// Shortest standstill: duration in s, and number of samples.
const SHORTEST: (f64, usize) = (0.25, 10);
/// Longest time, in s, by which a joint may lag its command.
const LATE_S: f64 = 0.15;
/// Range of the command during the standstill, as a share of its range in the whole log: from the first a finding is
/// doubtful, from the second it is certain for any joint.
const COMMANDED: (f64, f64) = (0.25, 0.5);
/// Smallest command range, in rad or m, for which a joint that never moves is reported.
const LEAST: f64 = 0.02;

/// A joint whose position stands still in every bit while its command moves.
pub(super) fn frozen(log: &Log, joint: &str, command: &Channel, position: &Channel) -> Option<Finding> {
    if command.unit != position.unit {
        return None;
    }
    let (commands, positions) = (ends(&command.values)?, ends(&position.values)?);
    let (commanded, name) = (commands.1 - commands.0, format!("q_{joint}"));
    let say = |severity, sentence| Some(Finding::new(Topic::Dead, severity, &name, sentence));
    if positions.0 >= positions.1 {
        let sentence = format!(
            "{name} never changes while its command does by {commanded:.2} {}: is its encoder dead, or its motor off?",
            command.unit
        );
        return if commanded > LEAST { say(Severity::Bad, sentence) } else { None };
    }
    let noise = NoiseEstimate::of(&position.values)?;
    // The readings of a live sensor with white noise change even while the joint rests.
    let is_noisy = !noise.is_negligible() && noise.white > 0.3 * noise.quantum;
    let commanded_during = |run: &Range<usize>| {
        let last_s = log.clock_s()[run.end - 1] - LATE_S;
        let until = run.start + log.clock_s()[run.clone()].partition_point(|t| *t <= last_s);
        let moved_by = ends(&command.values[run.start..until]).map_or(0.0, |(low, high)| high - low);
        // A small motion may stay within one step of the encoder.
        if moved_by > 10.0 * noise.quantum { moved_by } else { 0.0 }
    };
    // A joint at an end of its range may be at its mechanical stop.
    let at_a_stop = |run: &Range<usize>| {
        let held = position.values[run.start];
        (held <= positions.0 || held >= positions.1) && !is_noisy
    };
    let runs = standstills(log, &position.values).into_iter().filter(|run| !at_a_stop(run));
    let (run, moved_by) = runs
        .map(|run| (run.clone(), commanded_during(&run)))
        .max_by(|(_, a), (_, b)| a.total_cmp(b))
        .filter(|(_, moved_by)| *moved_by > COMMANDED.0 * commanded)?;
    let (from_s, to_s) = (log.clock_s()[run.start], log.clock_s()[run.end - 1]);
    let sentence = format!(
        "{name} stands still in every bit from {from_s:.2} to {to_s:.2} s, while its command \
         changes by {moved_by:.2} {}: did its readings freeze?",
        command.unit
    );
    let sure = is_noisy || moved_by > COMMANDED.1 * commanded;
    say(if sure { Severity::Bad } else { Severity::Doubtful }, sentence)
}

/// Long runs of identical readings.
fn standstills(log: &Log, values: &[f64]) -> Vec<Range<usize>> {
    let (mut runs, mut start) = (Vec::new(), 0);
    for k in 1..=values.len() {
        if values.get(k).is_some_and(|x| x.to_bits() == values[start].to_bits()) {
            continue;
        }
        let long_s = log.clock_s()[k - 1] - log.clock_s()[start];
        if values[start].is_finite() && long_s >= SHORTEST.0 && k - start >= SHORTEST.1 {
            runs.push(start..k);
        }
        start = k;
    }
    runs
}

/// Least and greatest of the values that are present.
fn ends(values: &[f64]) -> Option<(f64, f64)> {
    let present = values.iter().copied().filter(|x| x.is_finite());
    present.fold(None, |ends, x| Some(ends.map_or((x, x), |(low, high): (f64, f64)| (low.min(x), high.max(x)))))
}

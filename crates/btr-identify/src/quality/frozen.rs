//! Readings that stay constant bit by bit while the joint's command moves.

use super::report::{Finding, Severity, Topic};
use btr_core::log::{Channel, Log};
use btr_core::signal::noise::NoiseEstimate;
use std::ops::Range;

/// What lasts shorter than this, in s, or has fewer samples, is no standstill.
const SHORTEST: (f64, usize) = (0.25, 10);
/// A joint may take so long, in s, until it does what it is told.
const LATE_S: f64 = 0.15;
/// What a joint is told meanwhile, as a share of all that it is told: enough to doubt, and enough to be sure of any joint.
const TOLD: (f64, f64) = (0.25, 0.5);
/// Commands that change by less, in rad or m, need not move a joint that never moves.
const LEAST: f64 = 0.02;

/// A joint whose position stands still in every bit while its command moves.
pub(super) fn frozen(log: &Log, joint: &str, command: &Channel, position: &Channel) -> Option<Finding> {
    if command.unit != position.unit {
        return None;
    }
    let (told, moved) = (ends(&command.values)?, ends(&position.values)?);
    let (asked, name) = (told.1 - told.0, format!("q_{joint}"));
    let say = |severity, sentence| Some(Finding::new(Topic::Dead, severity, &name, sentence));
    if moved.0 >= moved.1 {
        let sentence = format!(
            "{name} never changes while its command does by {asked:.2} {}: is its encoder dead, or its motor off?",
            command.unit
        );
        return if asked > LEAST { say(Severity::Bad, sentence) } else { None };
    }
    let noise = NoiseEstimate::of(&position.values)?;
    // Where a live sensor's readings would tremble, a standstill is none of the joint's.
    let trembles = !noise.is_negligible() && noise.white > 0.3 * noise.quantum;
    let meanwhile = |run: &Range<usize>| {
        let last_s = log.clock_s()[run.end - 1] - LATE_S;
        let until = run.start + log.clock_s()[run.clone()].partition_point(|t| *t <= last_s);
        let told = ends(&command.values[run.start..until]).map_or(0.0, |(low, high)| high - low);
        // Steps of the encoder are not left by small motions.
        if told > 10.0 * noise.quantum { told } else { 0.0 }
    };
    // What stands at an end of its range may stand at its stop.
    let at_a_stop = |run: &Range<usize>| {
        let held = position.values[run.start];
        (held <= moved.0 || held >= moved.1) && !trembles
    };
    let runs = standstills(log, &position.values).into_iter().filter(|run| !at_a_stop(run));
    let (run, told) = runs
        .map(|run| (run.clone(), meanwhile(&run)))
        .max_by(|(_, a), (_, b)| a.total_cmp(b))
        .filter(|(_, told)| *told > TOLD.0 * asked)?;
    let (from_s, to_s) = (log.clock_s()[run.start], log.clock_s()[run.end - 1]);
    let sentence = format!(
        "{name} stands still in every bit from {from_s:.2} to {to_s:.2} s, while its command changes by {told:.2} {}: did its \
         readings freeze?",
        command.unit
    );
    let sure = trembles || told > TOLD.1 * asked;
    say(if sure { Severity::Bad } else { Severity::Doubtful }, sentence)
}

/// Where readings are the same for long.
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

/// Least and greatest of what is there.
fn ends(values: &[f64]) -> Option<(f64, f64)> {
    let there = values.iter().copied().filter(|x| x.is_finite());
    there.fold(None, |ends, x| Some(ends.map_or((x, x), |(low, high): (f64, f64)| (low.min(x), high.max(x)))))
}

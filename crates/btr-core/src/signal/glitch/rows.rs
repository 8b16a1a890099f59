//! Rows of a log that repeat the row before in every channel: a message that was lost.

use super::prediction::{deviation, is_same, longest, median_step_s, resolution};
use std::ops::Range;

/// Least departure of a channel in a repeated row from the line between its neighbours, in deviations of its noise.
const DEPARTS: f64 = 5.0;
/// Least number of channels that depart: one joint alone may stick while the others rest.
const FEWEST: usize = 2;
/// Least step before the row of one of them, in deviations of its noise, ...
const MOVED: f64 = 3.0;
/// ... and in the steps that the row lacks: where none has moved, a motion begins.
const MOVED_SHARE: f64 = 0.2;

/// Runs of samples in which every channel repeats, bit by bit, its reading before the run, although several of them
/// should have moved.
pub fn repeated_rows(clock_s: &[f64], channels: &[&[f64]]) -> Vec<Range<usize>> {
    let Some(step_s) = median_step_s(clock_s).filter(|_| channels.len() >= FEWEST) else { return Vec::new() };
    let sigmas: Vec<Option<f64>> =
        channels.iter().map(|values| deviation(clock_s, values, resolution(values)?)).collect();
    let repeats = |i: usize| channels.iter().all(|values| values[i].is_finite() && is_same(values[i], values[i - 1]));
    let is_lost = |run: &Range<usize>| {
        let (before, after) = (run.start - 1, run.end);
        if after >= clock_s.len() || clock_s[after] - clock_s[before] > (run.len() as f64 + 2.5) * step_s {
            return false;
        }
        // By a straight line: a joint that starts from rest is not late.
        let share = (clock_s[after - 1] - clock_s[before]) / (clock_s[after] - clock_s[before]);
        let departs = |(values, sigma): &(&&[f64], &Option<f64>)| {
            let moved = share * (values[after] - values[before]).abs();
            sigma.is_some_and(|sigma| moved > DEPARTS * sigma)
        };
        let moves = |(values, sigma): (&&[f64], &Option<f64>)| {
            let step = before.checked_sub(1).map_or(0.0, |earlier| values[before] - values[earlier]);
            let lacks = (values[after] - values[before]) / (run.len() + 1) as f64;
            sigma.is_some_and(|sigma| step.abs() > MOVED * sigma) && step / lacks > MOVED_SHARE
        };
        let departing = || channels.iter().zip(&sigmas).filter(departs);
        departing().count() >= FEWEST && departing().any(moves)
    };
    let (mut found, mut i) = (Vec::new(), 1);
    while i < clock_s.len() {
        let end = (i..clock_s.len()).find(|&k| !repeats(k)).unwrap_or(clock_s.len());
        let run = i..end;
        if !run.is_empty() && run.len() <= longest(step_s) && is_lost(&run) {
            found.push(run);
        }
        i = end + 1;
    }
    found
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn rows_that_repeat_while_a_joint_moves_are_found() {
        let clock: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
        let step = 1.5e-3;
        let joint = |speed: f64| clock.iter().map(|t| ((speed * t).sin() / step).round() * step).collect::<Vec<f64>>();
        let (mut fast, mut slow) = (joint(3.0), joint(1.0));
        for values in [&mut fast, &mut slow] {
            let last = values[99];
            values[100..103].fill(last);
        }
        assert_eq!(repeated_rows(&clock, &[&fast, &slow]), vec![Range { start: 100, end: 103 }]);
        assert!(repeated_rows(&clock, &[&fast, &[0.5; 400]]).is_empty(), "a single joint may stick");
        let starting = |speed: f64| -> Vec<f64> {
            let at = |i: usize| if i < 103 { 0.4 } else { 0.4 + (speed * (i - 102) as f64).round() * step };
            (0..400).map(at).collect()
        };
        let mut flickers = starting(9.0);
        (0..100).step_by(2).for_each(|i| flickers[i] += step);
        assert!(repeated_rows(&clock, &[&flickers, &starting(7.0)]).is_empty(), "both joints begin to move");
        // Where nothing moves, nothing is lost.
        assert!(repeated_rows(&clock, &[&joint(0.05), &joint(0.04)]).is_empty());
    }
}

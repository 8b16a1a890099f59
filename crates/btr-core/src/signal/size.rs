//! Sizes of laws that repeat themselves, such as the steps of a quantised command: an error shows them although small
//! changes of the size explain nothing. A step that is wrong by a percent is wrong by whole steps further on.

use rayon::prelude::*;

/// First-order lag from a change of the command to the position, in s: about that of a servo. Only its shape counts.
const LAG_S: f64 = 0.1;
/// Lags of the command that other causes of the error may add or lack: gains, dampings, delays.
const OTHER_LAGS_S: [f64; 4] = [0.02, 0.05, 0.1, 0.2];
/// Sizes are tried at equal distances of their inverse: over the range of the command, one has this share of a period
/// more than the next.
const TURN: f64 = 0.25;
/// Most sizes that are tried.
const MOST: usize = 4000;
/// How many of the best sizes are tried more finely, and at how many sizes up to the next ones on either side: where a
/// command has few values, a size that is wrong by a tenth of a percent rounds some of them to other steps.
const FINER: (usize, i32) = (24, 16);
/// Least share of an error that a size must explain.
const SHARE: f64 = 0.1;

/// The error of a position beside its command, without what other causes may explain of it.
pub struct ErrorOfCommand {
    step_s: f64,
    range: f64,
    present: Vec<bool>,
    error: Vec<f64>,
    /// What other causes may explain: orthonormal.
    others: Vec<Vec<f64>>,
}

impl ErrorOfCommand {
    /// From samples `step_s` apart; an error that is not finite is unknown. `None` where the command is not known
    /// throughout, or does not move.
    pub fn new(error: &[f64], command: &[f64], step_s: f64) -> Option<Self> {
        let low = command.iter().copied().fold(f64::INFINITY, f64::min);
        let range = command.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
        let known = command.len() == error.len() && command.iter().all(|x| x.is_finite());
        if !(known && range > 0.0 && step_s > 0.0) {
            return None;
        }
        let present = error.iter().map(|x| x.is_finite()).collect();
        let mut series = ErrorOfCommand { step_s, range, present, error: Vec::new(), others: Vec::new() };
        let lags = OTHER_LAGS_S.iter().map(|&lag_s| lagged(command, lag_s, step_s));
        for other in [vec![1.0; command.len()], command.to_vec()].into_iter().chain(lags) {
            let rest = series.rest(&other);
            let norm = dot(&rest, &rest).sqrt();
            if norm > 1e-9 * dot(&other, &other).sqrt() {
                series.others.push(rest.iter().map(|x| x / norm).collect());
            }
        }
        series.error = series.rest(error);
        Some(series)
    }

    /// A value where the error is known, without what other causes may explain of it.
    fn rest(&self, value: &[f64]) -> Vec<f64> {
        let present = value.iter().zip(&self.present);
        let mut rest: Vec<f64> = present.map(|(x, present)| if *present { *x } else { 0.0 }).collect();
        for other in &self.others {
            let share = dot(&rest, other);
            rest.iter_mut().zip(other).for_each(|(x, o)| *x -= share * o);
        }
        rest
    }

    /// The product of the error with what a change of the command does, and the square of that.
    fn overlap(&self, change: &[f64]) -> (f64, f64) {
        let rest = self.rest(&lagged(change, LAG_S, self.step_s));
        (dot(&self.error, &rest), dot(&rest, &rest))
    }
}

/// The sizes, from `least` to the range of the commands, by which a law explains most of the errors; best first, at
/// most `count`, each with the sum of squares that it explains. `change` is what the law of a size adds to the command
/// of one of the errors.
pub fn sizes(
    errors: &[ErrorOfCommand],
    least: f64,
    count: usize,
    change: impl Fn(f64, usize) -> Vec<f64> + Sync,
) -> Vec<(f64, f64)> {
    let range = errors.iter().map(|error| error.range).fold(0.0, f64::max);
    let turn = TURN / range;
    let periods = (1.0 / (least * turn)).min(MOST as f64);
    // Without errors there is no range either.
    if range <= 0.0 || periods < 1.0 {
        return Vec::new();
    }
    let first = (1.0 / (range * turn)) as usize;
    let tried: Vec<f64> = (first.max(1)..=first + periods as usize).map(|k| k as f64 * turn).collect();
    let explained = |&inverse: &f64| {
        let size = 1.0 / inverse;
        let overlaps = errors.iter().enumerate().map(|(i, error)| error.overlap(&change(size, i)));
        let (product, square) = overlaps.fold((0.0, 0.0), |(a, b), (product, square)| (a + product, b + square));
        if product > 0.0 { product * product / square } else { 0.0 }
    };
    let of_tried: Vec<f64> = tried.par_iter().map(explained).collect();
    let all: f64 = errors.iter().map(|error| dot(&error.error, &error.error)).sum();
    let at = |k: Option<usize>| k.and_then(|k| of_tried.get(k)).copied().unwrap_or(0.0);
    let is_peak = |&k: &usize| of_tried[k] >= at(k.checked_sub(1)) && of_tried[k] > at(Some(k + 1));
    let peaks = (0..tried.len()).filter(is_peak).filter(|&k| of_tried[k] > SHARE * all);
    let peaks = best(peaks.map(|k| (tried[k], of_tried[k])).collect(), FINER.0);
    let finer = |&(inverse, share): &(f64, f64)| {
        let beside = (-FINER.1..=FINER.1).map(|k| inverse + turn * f64::from(k) / f64::from(FINER.1 + 1));
        let beside = beside.map(|inverse| (inverse, explained(&inverse))).filter(|(_, explained)| *explained > share);
        beside.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((inverse, share))
    };
    let peaks = best(peaks.par_iter().map(finer).collect(), count);
    peaks.into_iter().map(|(inverse, explained)| (1.0 / inverse, explained)).collect()
}

/// Those that explain most, best first.
fn best(mut all: Vec<(f64, f64)>, count: usize) -> Vec<(f64, f64)> {
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(count);
    all
}

/// A value behind a first-order lag that begins at its first value.
fn lagged(value: &[f64], lag_s: f64, step_s: f64) -> Vec<f64> {
    let share = -(-step_s / lag_s).exp_m1();
    let mut behind = value.first().copied().unwrap_or(0.0);
    let follow = |x: &f64| {
        behind += share * (x - behind);
        behind
    };
    value.iter().map(follow).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::stream;
    use rand::RngExt;

    const STEP_S: f64 = 0.01;

    fn rounded(command: &[f64], size: f64) -> Vec<f64> {
        command.iter().map(|x| size * (x / size).round() - x).collect()
    }

    /// A command, and the error of a servo with a lag of 40 ms that also rounds it to steps, or does not.
    fn recorded(size: Option<f64>) -> (Vec<f64>, Vec<f64>) {
        let mut rng = stream(3, &[1]);
        let told: Vec<f64> =
            (0..800).map(|i| f64::from(i) * STEP_S).map(|t| 0.5 * (1.1 * t).sin() + 0.2 * (3.7 * t).sin()).collect();
        let change = size.map_or(vec![0.0; told.len()], |size| rounded(&told, size));
        let mut noise = || 4e-4 * (rng.random::<f64>() - 0.5);
        let error = lagged(&change, 0.04, STEP_S).iter().zip(&told).map(|(e, u)| e + 0.01 * u + noise()).collect();
        (told, error)
    }

    #[test]
    fn the_step_of_a_rounded_command_is_found() {
        for size in [0.0051, 0.012, 0.05] {
            let (told, mut error) = recorded(Some(size));
            error[100..120].fill(f64::NAN);
            let errors = [ErrorOfCommand::new(&error, &told, STEP_S).unwrap()];
            let (found, _) = sizes(&errors, 1e-3, 2, |size, _| rounded(&told, size))[0];
            assert!((found / size - 1.0).abs() < 0.01, "{found} instead of {size}");
        }
    }

    #[test]
    fn a_step_is_found_where_the_command_has_few_values() {
        let goals = [0.2013, 0.3026, 0.3284, 0.3414, 0.385, 0.4472, 0.533, 0.5929, 0.6056, 0.6736, 0.7233, 0.925];
        let told: Vec<f64> = (0..720).map(|i| goals[(7 * (i / 60)) % goals.len()]).collect();
        let size = 0.022_282_559;
        let error = lagged(&rounded(&told, size), 0.06, STEP_S);
        let errors = [ErrorOfCommand::new(&error, &told, STEP_S).unwrap()];
        let (found, explained) = sizes(&errors, 1e-3, 2, |size, _| rounded(&told, size))[0];
        assert!((found / size - 1.0).abs() < 5e-4, "{found} instead of {size}");
        assert!(explained > 0.9 * dot(&errors[0].error, &errors[0].error), "{explained}");
    }

    #[test]
    fn what_a_servo_may_do_to_a_command_has_no_size() {
        let (told, error) = recorded(None);
        let errors = [ErrorOfCommand::new(&error, &told, STEP_S).unwrap()];
        assert_eq!(sizes(&errors, 1e-3, 2, |size, _| rounded(&told, size)), []);
        assert!(ErrorOfCommand::new(&error, &vec![0.3; told.len()], STEP_S).is_none());
    }
}

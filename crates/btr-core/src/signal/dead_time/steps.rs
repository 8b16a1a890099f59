//! Where a joint stands, its command steps, and the joint moves.

use crate::signal::noise::NoiseEstimate;
use std::ops::Range;

/// Least time, in s, and number of samples, that command and joint rest before a step.
const REST: (f64, usize) = (0.1, 6);
/// Least number of samples from the first one that has clearly moved to the next change of the command.
const FEWEST_MOVED: usize = 8;
/// The response is fitted until it has gone this share of its way: friction and limits shape the rest.
const SHARE: f64 = 0.8;
/// The response is looked at for this long, in s.
const LONGEST_S: f64 = 1.0;
/// Least response, in standard deviations of the readings' noise.
const LEAST: f64 = 20.0;
/// A reading this many standard deviations from rest has moved.
const MOVED: f64 = 5.0;
/// A joint rests if it departs from standstill by at most this many standard deviations in the root mean square, ...
const CALM: f64 = 2.0;
/// ... or this share of the response: the fit allows for a steady drift.
const CALM_SHARE: f64 = 0.003;
/// A step of the clock that is longer than this many usual ones is a gap.
const GAP: f64 = 2.5;

/// The readings around one step of the command.
#[derive(Clone, Debug)]
pub(super) struct Response {
    /// Times of the readings after the command's step, in s; negative while the joint rests.
    pub t: Vec<f64>,
    /// Departure of the readings from rest, positive in the direction of the step.
    pub moved: Vec<f64>,
    /// When the joint has certainly begun to move, in s after the command's step.
    pub latest_s: f64,
    /// How far the joint moved in the direction of the step.
    pub size: f64,
}

/// All responses to steps from rest; NaN are missing.
pub(super) fn responses(clock_s: &[f64], command: &[f64], position: &[f64], step_s: f64) -> Vec<Response> {
    let Some(noise) = NoiseEstimate::of(position) else { return Vec::new() };
    let plateaus = plateaus(command);
    let response = |pair: &[Range<usize>]| {
        let (rest, held) = (&pair[0], &pair[1]);
        let begins_s = clock_s[held.start];
        // Half a step less, so that jitter costs no sample.
        let rested_s = begins_s - REST.0.max((REST.1 as f64 - 0.5) * step_s);
        let from = rest.start + clock_s[rest.clone()].partition_point(|t| *t < rested_s);
        let until = held.start + clock_s[held.clone()].partition_point(|t| *t <= begins_s + LONGEST_S);
        let is_whole = clock_s[from..until].windows(2).all(|pair| pair[1] - pair[0] <= GAP * step_s);
        let rests_long = clock_s[rest.start] <= rested_s;
        let sign = (command[held.start] - command[rest.start]).signum();
        (rest.end == held.start && is_whole && rests_long).then(|| {
            let present = (from..until).filter(|i| position[*i].is_finite());
            let (t, signed) = present.map(|i| (clock_s[i] - begins_s, sign * position[i])).unzip();
            of_step(t, signed, noise.sigma())
        })?
    };
    plateaus.windows(2).filter_map(response).collect()
}

/// The response in readings around a step at time zero.
fn of_step(mut t: Vec<f64>, mut moved: Vec<f64>, sigma: f64) -> Option<Response> {
    let standing = t.partition_point(|t| *t < 0.0);
    if standing < REST.1 - 1 {
        return None;
    }
    let mean = moved[..standing].iter().sum::<f64>() / standing as f64;
    moved.iter_mut().for_each(|x| *x -= mean);
    let size = moved[standing..].iter().copied().fold(0.0, f64::max);
    let least = |x: f64| moved[standing..].iter().position(|moved| *moved > x).map(|i| standing + i);
    let calm = (CALM * sigma).max(CALM_SHARE * size);
    let first = least(MOVED * sigma)?;
    let last = least(SHARE * size)?.max(first + FEWEST_MOVED);
    let rests = moved[..standing].iter().map(|x| x * x).sum::<f64>() <= calm * calm * standing as f64;
    if size < LEAST * sigma || !rests || last >= moved.len() {
        return None;
    }
    let latest_s = t[first];
    t.truncate(last + 1);
    moved.truncate(last + 1);
    Some(Response { t, moved, latest_s, size })
}

/// The stretches in which a command is constant, whatever their length.
fn plateaus(command: &[f64]) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    for (i, value) in command.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        match found.last_mut() {
            #[allow(clippy::float_cmp)]
            Some(last) if last.end == i && command[last.start] == *value => last.end = i + 1,
            _ => found.push(i..i + 1),
        }
    }
    found
}

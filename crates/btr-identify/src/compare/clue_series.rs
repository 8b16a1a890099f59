//! The value of every clue at every sample of a joint's track.
//!
//! A torque that is missing in the model moves the position only as fast as the servo permits. Each clue is therefore
//! also tried behind a first-order filter, with the same time constants for all clues.

use super::clue::Clue;
use super::track::JointTrack;
use btr_core::signal::smooth::smooth;

/// Time constants of the filter, in s.
const TIME_CONSTANTS_S: [f64; 3] = [0.0, 0.03, 0.1];

/// All clues of a joint with every time constant, sample by sample; NaN where unknown.
pub(super) fn clues(track: &JointTrack) -> Vec<(Clue, Vec<f64>)> {
    let filtered = |(clue, series): (Clue, Vec<f64>)| {
        TIME_CONSTANTS_S.map(|constant_s| (clue, low_pass(&track.clock_s, &series, constant_s)))
    };
    unfiltered(track).into_iter().flat_map(filtered).collect()
}

/// A series behind a first-order low-pass filter, which restarts after missing samples.
fn low_pass(clock_s: &[f64], series: &[f64], constant_s: f64) -> Vec<f64> {
    let mut y = f64::NAN;
    let mut before_s = f64::NEG_INFINITY;
    let mut follow = |(t, x): (&f64, &f64)| {
        let share = if y.is_nan() { 1.0 } else { 1.0 - (-(t - before_s) / constant_s).exp() };
        y = if y.is_nan() || constant_s <= 0.0 { *x } else { y + share * (x - y) };
        before_s = *t;
        y
    };
    clock_s.iter().zip(series).map(&mut follow).collect()
}

/// All clues without a filter.
fn unfiltered(track: &JointTrack) -> Vec<(Clue, Vec<f64>)> {
    let directions = track.directions();
    let of_motion = |f: fn(&btr_core::signal::smooth::Motion) -> f64| track.motion.iter().map(f).collect::<Vec<_>>();
    let against = track.load.iter().zip(&directions).map(|(load, direction)| load.abs() * direction).collect();
    let mut clues = vec![
        (Clue::SignOfVelocity, directions),
        (Clue::Velocity, of_motion(|m| m.velocity)),
        (Clue::Acceleration, of_motion(|m| m.acceleration)),
        (Clue::SineOfPosition, of_motion(|m| m.value.sin())),
        (Clue::CosineOfPosition, of_motion(|m| m.value.cos())),
        (Clue::LoadAgainstMotion, against),
        (Clue::Load, track.load.clone()),
        (Clue::Time, track.clock_s.clone()),
    ];
    if !track.command.is_empty() {
        let rate = smooth(&track.clock_s, &track.command).iter().map(|m| m.velocity).collect();
        clues.push((Clue::RateOfCommand, rate));
    }
    clues
}

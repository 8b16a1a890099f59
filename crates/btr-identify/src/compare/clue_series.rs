//! The value of every clue at every sample of a joint's track.
//!
//! A torque that is missing in the model moves the position only as fast as the servo lets it. So each clue is also tried
//! behind a first-order filter with several time constants, the same for all clues.

use super::clue::Clue;
use super::track::JointTrack;
use btr_core::signal::smooth::smooth;

/// How slowly a servo may give way, in s.
const SLOWNESS_S: [f64; 3] = [0.0, 0.03, 0.1];

/// All clues of a joint at every slowness, sample by sample; NaN where unknown.
pub(super) fn clues(track: &JointTrack) -> Vec<(Clue, Vec<f64>)> {
    let slowed = |(clue, series): (Clue, Vec<f64>)| {
        SLOWNESS_S.map(|slowness_s| (clue, behind_filter(&track.clock_s, &series, slowness_s)))
    };
    prompt(track).into_iter().flat_map(slowed).collect()
}

/// A series behind a filter of first order, which starts anew after whatever is missing.
fn behind_filter(clock_s: &[f64], series: &[f64], slowness_s: f64) -> Vec<f64> {
    let mut y = f64::NAN;
    let mut before_s = f64::NEG_INFINITY;
    let mut follow = |(t, x): (&f64, &f64)| {
        let share = if y.is_nan() { 1.0 } else { 1.0 - (-(t - before_s) / slowness_s).exp() };
        y = if y.is_nan() || slowness_s <= 0.0 { *x } else { y + share * (x - y) };
        before_s = *t;
        y
    };
    clock_s.iter().zip(series).map(&mut follow).collect()
}

/// All clues without delay.
fn prompt(track: &JointTrack) -> Vec<(Clue, Vec<f64>)> {
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

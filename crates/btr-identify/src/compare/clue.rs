//! Clues: quantities that a residual may follow, each the shadow of some physical effects.
//!
//! A torque that is missing in the model moves the position only as fast as the servo lets it. So every clue is also tried as
//! it looks behind a filter of first order, the same for all.

use super::JointTrack;
use btr_core::signal::smooth::smooth;
use serde::{Deserialize, Serialize};

/// What a residual follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Clue {
    /// The same everywhere.
    Constant,
    /// The direction of the motion: dry friction, backlash.
    SignOfVelocity,
    /// The velocity: viscous friction, delays of the sensor.
    Velocity,
    /// The acceleration: inertia.
    Acceleration,
    /// sin(q): gravity.
    SineOfPosition,
    /// cos(q): gravity, of a joint mounted at an angle.
    CosineOfPosition,
    /// |load|·sign(v): friction that grows with the load.
    LoadAgainstMotion,
    /// The load: elasticity, gains.
    Load,
    /// How fast the command changes: delays and lags of the command.
    RateOfCommand,
    /// The time: drift, clocks.
    Time,
}

impl Clue {
    /// What it is, after "the residual follows ".
    pub fn words(self) -> &'static str {
        match self {
            Clue::Constant => "nothing: it is an offset",
            Clue::SignOfVelocity => "the sign of the velocity",
            Clue::Velocity => "the velocity",
            Clue::Acceleration => "the acceleration",
            Clue::SineOfPosition => "the sine of the position",
            Clue::CosineOfPosition => "the cosine of the position",
            Clue::LoadAgainstMotion => "the load times the sign of the velocity",
            Clue::Load => "the load",
            Clue::RateOfCommand => "how fast the command changes",
            Clue::Time => "the time",
        }
    }
}

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

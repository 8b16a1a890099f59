//! Clues: quantities that a residual may follow, each the shadow of some physical effects.

use super::Track;
use crate::smooth::smooth;
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

/// All clues of a joint, sample by sample; NaN where unknown.
pub(super) fn clues(track: &Track) -> Vec<(Clue, Vec<f64>)> {
    let directions = track.directions();
    let of_motion = |f: fn(&crate::smooth::Motion) -> f64| track.motion.iter().map(f).collect::<Vec<_>>();
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

//! Clues: quantities that a residual may correlate with, each typical of some physical effects.

use serde::{Deserialize, Serialize};

/// A quantity that a residual correlates with.
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
    /// Its name as it completes the sentence "the residual follows …".
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

//! Regimes: what a joint is doing at a sample. A sample may be in several.

use serde::{Deserialize, Serialize};

/// What a joint is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// All samples.
    Throughout,
    /// Moving in its positive direction.
    Forward,
    /// Moving in its negative direction.
    Backward,
    /// A fifth of a second after the direction changed.
    AfterReversal,
    /// Standing still.
    Hold,
    /// Moving at less than a quarter of its usual top speed.
    Slow,
    /// Moving at more than six tenths of it.
    Fast,
    /// The load is more than six tenths of its usual maximum.
    HighLoad,
    /// The load stays at its maximum for several samples.
    Saturated,
    /// A third of a second after the command jumped.
    AfterStep,
    /// The first second.
    StartUp,
    /// The first third of the log.
    Early,
    /// The last third of the log.
    Late,
    /// The lowest third of the range of positions.
    Low,
    /// The middle third.
    Middle,
    /// The highest third.
    High,
    /// Without torque: no command.
    TorqueOff,
}

impl Regime {
    /// All of them, in the order of reports.
    pub const ALL: [Regime; 17] = [
        Regime::Throughout,
        Regime::Forward,
        Regime::Backward,
        Regime::AfterReversal,
        Regime::Hold,
        Regime::Slow,
        Regime::Fast,
        Regime::HighLoad,
        Regime::Saturated,
        Regime::AfterStep,
        Regime::StartUp,
        Regime::Early,
        Regime::Late,
        Regime::Low,
        Regime::Middle,
        Regime::High,
        Regime::TorqueOff,
    ];

    /// Its name in documents: `after_reversal`.
    pub fn name(self) -> &'static str {
        self.names().0
    }

    /// Its name in sentences: "after reversals".
    pub fn words(self) -> &'static str {
        self.names().1
    }

    fn names(self) -> (&'static str, &'static str) {
        match self {
            Regime::Throughout => ("throughout", "throughout"),
            Regime::Forward => ("forward", "moving forward"),
            Regime::Backward => ("backward", "moving backward"),
            Regime::AfterReversal => ("after_reversal", "after reversals"),
            Regime::Hold => ("hold", "standing still"),
            Regime::Slow => ("slow", "moving slowly"),
            Regime::Fast => ("fast", "moving fast"),
            Regime::HighLoad => ("high_load", "under high load"),
            Regime::Saturated => ("saturated", "at the motor's limit"),
            Regime::AfterStep => ("after_step", "after steps of the command"),
            Regime::StartUp => ("start_up", "in the first second"),
            Regime::Early => ("early", "in the first third"),
            Regime::Late => ("late", "in the last third"),
            Regime::Low => ("low", "in the lowest third of its range"),
            Regime::Middle => ("middle", "in the middle of its range"),
            Regime::High => ("high", "in the highest third of its range"),
            Regime::TorqueOff => ("torque_off", "without torque"),
        }
    }
}

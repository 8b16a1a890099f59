//! Which regimes of motion are worth telling.

use super::joint::JointVerdict;
use btr_identify::compare::{Comparison, Regime, RegimeCell};

/// The failures that say most of each joint, the worst joint first.
pub(super) fn most_telling<'a>(
    comparison: &'a Comparison,
    joints: &[JointVerdict],
    most: usize,
) -> Vec<&'a RegimeCell> {
    let failures = comparison.failures();
    let mut shown = Vec::new();
    for joint in joints {
        let of_joint = failures.iter().copied().filter(|cell| cell.joint == joint.joint);
        let mut kinds = Vec::new();
        for cell in of_joint.filter(|cell| cell.regime != Regime::Throughout) {
            if kinds.len() < most && !kinds.contains(&kind(cell.regime)) {
                kinds.push(kind(cell.regime));
                shown.push(cell);
            }
        }
    }
    shown
}

/// Regimes of one kind overlap, or exclude each other.
fn kind(regime: Regime) -> &'static str {
    match regime {
        Regime::Throughout => "all",
        Regime::Forward | Regime::Backward => "direction",
        Regime::AfterReversal | Regime::Hold | Regime::Slow | Regime::Fast => "speed",
        Regime::HighLoad | Regime::Saturated => "load",
        Regime::AfterStep => "command",
        Regime::StartUp | Regime::Early | Regime::Late => "time",
        Regime::Low | Regime::Middle | Regime::High => "position",
        Regime::TorqueOff => "torque",
    }
}

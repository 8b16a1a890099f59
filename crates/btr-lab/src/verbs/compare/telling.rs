//! Which regimes of motion are worth telling.

use super::joint::{JointVerdict, largest};
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
        let cells = || comparison.cells.iter().filter(|cell| cell.joint == joint.joint);
        let whole = cells().find(|cell| cell.regime == Regime::Throughout);
        // What the joint's sentence says comes first.
        let first = largest(whole, cells()).filter(|_| joint.sentence.is_some());
        let others = failures.iter().copied().filter(|cell| cell.joint == joint.joint);
        let mut kinds = Vec::new();
        for cell in first.into_iter().chain(others.filter(|cell| cell.regime != Regime::Throughout)) {
            if kinds.len() < most && !kinds.contains(&kind(cell.regime)) {
                kinds.push(kind(cell.regime));
                shown.push(cell);
            }
        }
        // No joint that has a sentence is missing, however small its share of the error of all is.
        shown.extend(whole.filter(|_| kinds.is_empty() && joint.sentence.is_some()));
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

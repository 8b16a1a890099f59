//! What a log says of the dead times between commands and motion.

use super::report::{CommandResponse, Finding, Severity, Topic};
use btr_core::log::{Channel, Log};
use btr_core::signal::dead_time::{DeadTime, dead_time};

/// The dead time of a joint; `None` where it is not commanded in positions.
pub(super) fn of(log: &Log, command: &Channel, position: &Channel) -> Option<DeadTime> {
    if command.unit != position.unit {
        return None;
    }
    // A motor that is off does not respond.
    let is_off = |i: usize| log.channel("torque_on").is_some_and(|on| on.values[i].is_nan() || on.values[i] < 0.5);
    let acting = |(i, command): (usize, &f64)| if is_off(i) { f64::NAN } else { *command };
    let commands: Vec<f64> = command.values.iter().enumerate().map(acting).collect();
    Some(dead_time(log.clock_s(), &commands, &position.values))
}

/// One finding per joint whose steps tell something, and one for all others that follow their commands.
pub(super) fn findings(joints: &[CommandResponse]) -> Vec<Finding> {
    let follow = || joints.iter().filter(|joint| joint.lag.is_some());
    let told = |of: &CommandResponse| Some(Finding::new(Topic::DeadTime, Severity::Fine, &of.joint, sentence(of)?));
    let untold = |of: &&CommandResponse| matches!(of.dead_time, Some(DeadTime::TooFew { .. }));
    let without: Vec<&str> = follow().filter(untold).map(|of| of.joint.as_str()).collect();
    let mut findings: Vec<Finding> = follow().filter_map(told).collect();
    if !without.is_empty() {
        let sentence = format!(
            "the dead time of {} is not known: record at least three steps of the command, of 0.2 rad or more, each \
             from rest and held until the joint stands, at least 0.5 s",
            without.join(", ")
        );
        findings.push(Finding::new(Topic::DeadTime, Severity::Fine, without[0], sentence));
    }
    findings
}

/// What a joint's steps tell.
fn sentence(CommandResponse { joint, dead_time, .. }: &CommandResponse) -> Option<String> {
    let ms = |seconds: f64| 1e3 * seconds;
    Some(match dead_time.as_ref()? {
        DeadTime::Known { seconds, ci95_s: [low, high], onsets } if *low > 0.0 => format!(
            "{joint} begins to move {:.1} ms after its command ({:.1} to {:.1} ms, from {onsets} steps): that part of \
             its lag is dead time",
            ms(*seconds),
            ms(*low),
            ms(*high)
        ),
        DeadTime::Known { ci95_s: [_, high], onsets, .. } => format!(
            "{joint} begins to move with its command, or less than {:.1} ms later (from {onsets} steps): no dead time \
             is seen",
            ms(*high)
        ),
        DeadTime::Scattered { range_s: [low, high], small_late, onsets } => {
            let [earliest, latest] = [ms(*low), ms(*high)];
            let when = if *small_late { ", later after small steps, as friction can cause" } else { "" };
            format!(
                "{joint} begins to move between {earliest:.1} and {latest:.1} ms after its command (from {onsets} \
                 steps{when}): its dead time is not constant"
            )
        }
        DeadTime::TooFew { .. } => return None,
    })
}

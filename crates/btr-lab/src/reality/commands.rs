//! The commands in the log of a real test.

use btr_core::log::{Log, Role};

/// Prepends rows for the lost beginning of a test to its log: with commands, without readings.
pub(crate) fn with_lost_rows(log: &Log, references: &Log) -> Log {
    let (Some(&first_s), Some(step_s)) = (log.clock_s().first(), log.usual_step_s()) else { return log.clone() };
    let rows = (first_s / step_s - 0.5).ceil().max(0.0) as usize;
    let lost_s: Vec<f64> = (0..rows).map(|k| first_s * k as f64 / rows as f64).collect();
    let Ok(mut output) = Log::new(lost_s.iter().chain(log.clock_s()).copied().collect()) else { return log.clone() };
    for (name, channel) in log.channels() {
        let commands = references.channel(name).filter(|_| channel.role == Role::Command);
        let lost = commands.map_or_else(
            || vec![f64::NAN; rows],
            |commands| lost_s.iter().map(|t| commands.values[held(references, *t)]).collect(),
        );
        // Cannot fail: the length matches the clock.
        let _ = output.insert(name, &channel.unit, channel.role, [lost, channel.values.clone()].concat());
    }
    output
}

/// The row of `references` that is held at a time.
fn held(references: &Log, time_s: f64) -> usize {
    references.clock_s().partition_point(|r| *r <= time_s + 1e-9).saturating_sub(1)
}

/// Adds the controller's references as commands where the log has none.
pub(crate) fn with_commands(log: &Log, references: &Log) -> Log {
    let mut output = log.clone();
    for (name, channel) in references.channels().filter(|(name, _)| log.channel(name).is_none()) {
        // Each reference holds until the next one.
        let values = log.clock_s().iter().map(|t| channel.values[held(references, *t)]).collect();
        // Cannot fail: the length matches the clock.
        let _ = output.insert(name, &channel.unit, Role::Command, values);
    }
    output
}

/// References as corrected by a policy: the commands of a log at the control ticks.
pub(crate) fn corrected_references(references: &Log, log: &Log) -> Log {
    let mut corrected = references.clone();
    let ticks_s = references.clock_s();
    for (name, channel) in references.channels() {
        let Some(logged) = log.channel(name) else { continue };
        let values = btr_core::log::interpolate(log.clock_s(), &logged.values, ticks_s);
        // Cannot fail: the length matches the clock.
        let _ = corrected.insert(name, &channel.unit, Role::Command, values);
    }
    corrected
}

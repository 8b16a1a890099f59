//! Quality checks of a log before anything is fitted to it: clock, sensors, and how the joints follow their commands.

mod channel;
mod clock;
mod frozen;
mod influence;
mod joint;
pub mod references;
mod report;
#[cfg(test)]
mod tests;

pub use clock::FEWEST_SAMPLES;
pub use references::check_references;
pub use report::{ClockReport, CommandResponse, Finding, Quality, SensorReport, Severity, Topic};

use btr_core::log::{Log, Role};

/// Checks a log.
pub fn check(log: &Log) -> Quality {
    let known = || log.channels().filter(|(_, channel)| channel.role != Role::Truth);
    let mut quality = Quality { clock: clock::of(log), sensors: Vec::new(), joints: Vec::new(), findings: Vec::new() };
    let mut findings = clock::findings(&quality.clock, log);
    for (name, channel) in known() {
        let sensor = channel::sensor(name, channel);
        findings.extend(channel::findings(&sensor, channel));
        if channel.role == Role::Command {
            findings.extend(channel::silences(log, name, &channel.values));
        }
        quality.sensors.push(sensor);
    }
    for joint in known().filter_map(|(name, _)| name.strip_prefix("q_")) {
        findings.extend(joint::velocity(log, joint));
        let Some((follows, found)) = joint::follows(log, joint) else { continue };
        findings.extend(found);
        quality.joints.push(follows);
    }
    quality.add(findings);
    quality
}

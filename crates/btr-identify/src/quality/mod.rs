//! Quality checks of a log before anything is fitted to it: clock, sensors, and how the joints follow their commands.

mod channel;
mod clock;
mod dead_time;
mod frozen;
mod glitch_findings;
mod glitches;
mod influence;
mod joint;
pub mod references;
mod report;
#[cfg(test)]
mod tests;

pub use clock::FEWEST_SAMPLES;
pub use glitch_findings::glitch_findings;
pub use glitches::{find_glitches, leave_out_glitches, leave_out_glitches_beside};
pub use references::check_references;
pub use report::{
    ClockReport, CommandResponse, Finding, FindingCause, GlitchReport, Quality, SensorReport, Severity, Topic,
};

use btr_core::log::{Log, Role};

/// Checks a log; `glitches` are those of its joints' positions, whether they are still in it or left out.
pub fn check(log: &Log, glitches: Vec<GlitchReport>) -> Quality {
    let known = || log.channels().filter(|(_, channel)| channel.role != Role::Truth);
    let (sensors, joints, findings) = (Vec::new(), Vec::new(), Vec::new());
    let mut quality = Quality { clock: clock::of(log), glitches, sensors, joints, findings };
    let mut findings = clock::findings(&quality.clock, log);
    findings.extend(glitch_findings(&quality.glitches, log.len(), ""));
    for (name, channel) in known() {
        let sensor = channel::sensor(name, channel, glitches::left_out_of(&quality.glitches, name));
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
    findings.extend(dead_time::findings(&quality.joints));
    quality.add(findings);
    quality
}

//! Quality of a log for a robot: the findings about the log alone, and whether its joints match the robot's.

use crate::suggest::nearest;
use btr_core::log::{Channel, Log, Role};
use btr_identify::quality::{Finding, FindingCause, GlitchReport, Quality, Severity, Topic, check};
use btr_physics::robot::{Actuator, Joint, JointKind, Robot};
use btr_physics::sensor::SensorNoise;

/// A position beyond the joint's limits by this many ranges is in another unit.
const FAR: f64 = 1.0;
/// Tolerance of a limit, as a share of the range.
const SLACK: f64 = 0.05;

/// All findings about a log with these glitches that is compared with this robot, whose sensors have this noise.
pub(crate) fn quality(log: &Log, glitches: Vec<GlitchReport>, robot: &Robot, noise: &SensorNoise) -> Quality {
    let mut quality = check(log, glitches);
    let mut found = Vec::new();
    for joint in robot.movable().map(|(_, link)| &link.joint) {
        let beyond = ["q", "cmd"].into_iter().filter_map(|kind| beyond(log, kind, joint));
        found.extend(
            beyond.chain(idle(log, joint)).chain(unmeasured(log, joint, robot)).chain(noiseless(log, joint, noise)),
        );
    }
    // A finding from the joint limits replaces a guess from the size of the values.
    let tells = |limits: &Finding, of: &Finding| match limits.topic {
        Topic::Unit => limits.channel == of.channel,
        Topic::Limits => limits.channel == of.channel && of.severity < Severity::Bad,
        _ => false,
    };
    let is_covered =
        |finding: &Finding| finding.topic == Topic::Unit && found.iter().any(|limits| tells(limits, finding));
    // The commands of a joint that follows another one say nothing about it.
    let follows =
        |finding: &Finding| robot.movable().any(|(_, l)| l.joint.mimic.is_some() && l.joint.name == finding.channel);
    quality.findings.retain(|finding| !is_covered(finding) && !follows(finding));
    quality.add(found);
    quality
}

/// Finding for positions, or commands of a servo, beyond the joint's limits.
fn beyond(log: &Log, kind: &str, joint: &Joint) -> Option<Finding> {
    let name = format!("{kind}_{}", joint.name);
    let channel = log.channel(&name).filter(|channel| channel.unit == joint.position_unit())?;
    if kind == "cmd" && joint.command_unit() != joint.position_unit() {
        return None;
    }
    let (low, high) = joint.limits;
    let (least, most) = ends(channel)?;
    let over = (most - high).max(low - least);
    let range = high - low;
    if !(range.is_finite() && over > SLACK * range) {
        return None;
    }
    let reach = if most - high >= low - least { most } else { least };
    let sentence = format!("{name} reaches {reach:.2} {}, but {} ends at {low} and {high}", channel.unit, joint.name);
    if over < FAR * range {
        // A servo command may well lie beyond the joint's limits.
        let severity = if kind == "cmd" { Severity::Fine } else { Severity::Doubtful };
        return Some(Finding::new(Topic::Limits, severity, &name, sentence));
    }
    let unit = if joint.kind == JointKind::Prismatic { "mm" } else { "degrees" };
    let cause = (joint.kind != JointKind::Prismatic).then_some(FindingCause::Degrees);
    let sentence = format!("{sentence}: is it in {unit}?");
    Some(Finding { cause, ..Finding::new(Topic::Unit, Severity::Bad, &name, sentence) })
}

/// Finding for a joint that has commands but no actuator.
fn idle(log: &Log, joint: &Joint) -> Option<Finding> {
    let name = format!("cmd_{}", joint.name);
    let idle = joint.actuator == Actuator::Passive && joint.mimic.is_none();
    let has_commands = idle && ends(log.channel(&name)?).is_some();
    has_commands.then(|| {
        let joint = &joint.name;
        let sentence =
            format!("{name} is in the log, but {joint} has no actuator: give it one in [actuators.\"{joint}\"]");
        Finding::new(Topic::Actuator, Severity::Doubtful, joint, sentence)
    })
}

/// Finding for a joint whose position is not in the log; an empty channel is another finding.
fn unmeasured(log: &Log, joint: &Joint, robot: &Robot) -> Option<Finding> {
    let name = format!("q_{}", joint.name);
    if log.channel(&name).is_some() {
        return None;
    }
    let help = match candidates(log, joint, robot).as_slice() {
        [] => String::new(),
        all @ [first, ..] => format!(
            "; is it `{}`? Say so in the model file: [channels.channels] {name} = \"{first}\"",
            all.join("` or `")
        ),
    };
    let sentence = format!("{name} is not in the log: {} cannot be judged{help}", joint.name);
    Some(Finding::new(Topic::Missing, Severity::Doubtful, &name, sentence))
}

/// Unused columns that may be a joint's position: the one with the most similar name, or else those that contain the
/// joint's name.
fn candidates<'a>(log: &'a Log, joint: &Joint, robot: &Robot) -> Vec<&'a str> {
    let known = |joint: &str| robot.movable().any(|(_, link)| link.joint.name == joint);
    let unknown = |other: &&str| other.strip_prefix("q_").is_some_and(|joint| !known(joint));
    let names = || log.channels().map(|(name, _)| name);
    if let Some(like) = nearest(&format!("q_{}", joint.name), names().filter(unknown)) {
        return vec![like];
    }
    // A column of `left_knee` does not belong to `knee`.
    let longest = |column: &str| {
        let inside = robot.movable().map(|(_, link)| &link.joint.name).filter(|name| column.contains(name.as_str()));
        inside.max_by_key(|name| name.len()).cloned()
    };
    let unused = log.channels().filter(|(_, channel)| channel.role == Role::Truth).map(|(name, _)| name);
    unused.filter(|column| longest(column).as_ref() == Some(&joint.name)).collect()
}

/// Finding for readings without any noise, as in a simulation.
fn noiseless(log: &Log, joint: &Joint, noise: &SensorNoise) -> Option<Finding> {
    let name = format!("q_{}", joint.name);
    let channel = log.channel(&name)?;
    let (least, most) = ends(channel)?;
    let floor = noise.floor(&name, &channel.values)?;
    (least < most && noise.is_assumed(&name, &channel.values)).then(|| {
        let sentence = format!(
            "{name} shows no noise, as if simulated: errors are measured in {floor:.1e} {}; [noise] sets the sensor's noise",
            channel.unit
        );
        Finding::new(Topic::Noise, Severity::Fine, &name, sentence)
    })
}

/// Least and greatest finite value; `None` if there is none.
fn ends(channel: &Channel) -> Option<(f64, f64)> {
    let finite = channel.values.iter().copied().filter(|x| x.is_finite());
    finite.fold(None, |ends, x| Some(ends.map_or((x, x), |(low, high): (f64, f64)| (low.min(x), high.max(x)))))
}

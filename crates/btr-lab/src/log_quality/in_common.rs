//! Findings that several joints have in common, for one cause: told once, with the lines that mend it.

use btr_identify::quality::{Finding, FindingCause, Severity, Topic};
use indexmap::IndexSet;
use serde::Serialize;

/// Joints from which a cause is told once for all.
const MANY: usize = 2;
/// Radians of a degree, as it is written into a model file.
const DEGREE: &str = "0.017453292519943295";

/// A finding that several joints have in common.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CommonFinding {
    /// Its topic.
    pub topic: Topic,
    /// Its severity.
    pub severity: Severity,
    /// The joints.
    pub joints: Vec<String>,
    /// Its description, one sentence.
    pub sentence: String,
    /// What to add to the model file.
    pub fix: String,
}

/// The cause of a finding that several joints can have in common, the kind of channel (`q`, `cmd`, `dq`) that is to be
/// mended, and the joint.
fn cause(finding: &Finding) -> Option<(FindingCause, &str, &str)> {
    let named = || finding.channel.split_once('_').filter(|(kind, _)| ["q", "cmd", "dq"].contains(kind));
    match finding.cause? {
        FindingCause::Degrees => named().map(|(kind, joint)| (FindingCause::Degrees, kind, joint)),
        FindingCause::Reversed => {
            let (kind, joint) = named().filter(|(kind, _)| *kind == "dq").unwrap_or(("cmd", &finding.channel));
            Some((FindingCause::Reversed, kind, joint))
        }
        FindingCause::Late => None,
    }
}

/// The causes that many joints have in common. `joints` is the number of all joints.
pub fn in_common(findings: &[&Finding], joints: usize) -> Vec<CommonFinding> {
    let of = |wanted: FindingCause| {
        let found = findings.iter().filter_map(|finding| cause(finding)).filter(|(cause, ..)| *cause == wanted);
        let channels: IndexSet<(&str, &str)> = found.map(|(_, kind, joint)| (kind, joint)).collect();
        told(wanted, &channels, joints)
    };
    [FindingCause::Degrees, FindingCause::Reversed].into_iter().filter_map(of).collect()
}

impl CommonFinding {
    /// Whether it tells what a finding says.
    pub fn covers(&self, finding: &Finding) -> bool {
        cause(finding).is_some_and(|(_, _, joint)| {
            finding.topic == self.topic && self.joints.iter().any(|covered| covered == joint)
        })
    }
}

fn told(cause: FindingCause, channels: &IndexSet<(&str, &str)>, of: usize) -> Option<CommonFinding> {
    let joints: IndexSet<&str> = channels.iter().map(|(_, joint)| *joint).collect();
    let kinds: IndexSet<&str> = channels.iter().map(|(kind, _)| *kind).collect();
    if joints.len() < MANY {
        return None;
    }
    let all = joints.len() == of;
    let names = joints.iter().copied().collect::<Vec<_>>().join(", ");
    let who = if all { format!("all {of} joints") } else { format!("{} of {of} joints ({names})", joints.len()) };
    let prefixes = kinds.iter().map(|kind| format!("{kind}_")).collect::<Vec<_>>().join(", ");
    let (topic, factor, what) = match cause {
        FindingCause::Degrees => {
            (Topic::Unit, DEGREE, format!("{who} look like degrees ({prefixes}): add to the model file"))
        }
        FindingCause::Reversed => {
            let opposite = "move opposite to their commands or velocities";
            (Topic::Sign, "-1.0", format!("{who} {opposite}: if it is so on the robot, add to the model file"))
        }
        FindingCause::Late => return None,
    };
    let line = |name: String| format!("\"{name}\" = {{ column = \"{name}\", factor = {factor} }}");
    let lines: Vec<String> = if all && channels.len() == kinds.len() * of {
        kinds.iter().map(|kind| line(format!("{kind}_{{joint}}"))).collect()
    } else {
        channels.iter().map(|(kind, joint)| line(format!("{kind}_{joint}"))).collect()
    };
    let fix = format!("[channels.channels]\n{}", lines.join("\n"));
    let joints = joints.into_iter().map(str::to_owned).collect();
    Some(CommonFinding { topic, severity: Severity::Bad, joints, sentence: what, fix })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_all_joints_have_is_told_once_with_its_lines() {
        let of = |channel: &str| {
            let sentence = format!("{channel} reaches 90 rad, but it ends at 1 and 2: is it in degrees?");
            Finding::new(Topic::Unit, Severity::Bad, channel, sentence).because(FindingCause::Degrees)
        };
        let found = ["q_a", "cmd_a", "q_b", "cmd_b", "q_b"].map(of);
        let all: Vec<&Finding> = found.iter().collect();
        let told = in_common(&all, 2);
        assert_eq!(told.len(), 1);
        assert_eq!(told[0].sentence, "all 2 joints look like degrees (q_, cmd_): add to the model file");
        assert!(
            told[0].fix.ends_with("\n\"cmd_{joint}\" = { column = \"cmd_{joint}\", factor = 0.017453292519943295 }")
        );
        assert!(found.iter().all(|finding| told[0].covers(finding)));
        // Not where it is one joint, and joint by joint where it is not all.
        assert!(in_common(&all[..2], 2).is_empty());
        let some = &in_common(&all, 3)[0];
        assert!(some.sentence.starts_with("2 of 3 joints (a, b) look like degrees"), "{}", some.sentence);
        assert!(some.fix.contains("\"q_a\" = { column = \"q_a\","), "{}", some.fix);
        // The cause counts, not how the sentence ends.
        let other = found.map(|finding| Finding { cause: None, ..finding });
        assert!(in_common(&other.iter().collect::<Vec<_>>(), 2).is_empty());
    }
}

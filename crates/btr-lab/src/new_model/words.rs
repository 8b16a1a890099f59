//! What the name of a column says: which joint, and which of its quantities.

/// What a column of a joint holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    /// A position that was commanded.
    Command,
    /// A torque that was commanded.
    TorqueCommand,
    /// A measured position.
    Position,
    /// A measured velocity.
    Velocity,
    /// A measured torque.
    Torque,
}

const COMMAND: [&str; 24] = [
    "cmd",
    "command",
    "commanded",
    "commands",
    "target",
    "goal",
    "ref",
    "reference",
    "desired",
    "des",
    "setpoint",
    "sp",
    "action",
    "ctrl",
    "control",
    "wanted",
    "demand",
    "soll",
    "sollwert",
    "ziel",
    "zielwert",
    "vorgabe",
    "consigne",
    "consigna",
];
const VELOCITY: [&str; 8] = ["dq", "qd", "vel", "velocity", "velocities", "speed", "qvel", "rate"];
const TORQUE: [&str; 7] = ["tau", "torque", "torques", "effort", "trq", "moment", "nm"];
const POSITION: [&str; 22] = [
    "q",
    "pos",
    "position",
    "positions",
    "angle",
    "actual",
    "measured",
    "meas",
    "state",
    "present",
    "current",
    "qpos",
    "encoder",
    "enc",
    "feedback",
    "fb",
    "observation",
    "joint",
    "motor",
    "ist",
    "istwert",
    "mesure",
];
/// Quantities of joints that btr has no channel for.
const OTHER: [&str; 27] = [
    "temperature",
    "temp",
    "voltage",
    "volt",
    "volts",
    "amps",
    "ampere",
    "pwm",
    "error",
    "err",
    "status",
    "load",
    "limit",
    "min",
    "max",
    "std",
    "acc",
    "accel",
    "acceleration",
    "ddq",
    "flag",
    "valid",
    "ok",
    "enabled",
    "id",
    "power",
    "energy",
];
const UNITS: [&str; 6] = ["deg", "rad", "mm", "m", "s", "n"];
const QUANTITIES: [&[&str]; 4] = [&COMMAND, &VELOCITY, &TORQUE, &POSITION];
const TIME: [&str; 11] =
    ["t", "time", "timestamp", "timestamps", "stamp", "clock", "secs", "sec", "elapsed", "zeit", "temps"];

impl Kind {
    /// Prefix of btr's channels of this kind.
    pub(super) fn prefix(self) -> &'static str {
        match self {
            Kind::Command | Kind::TorqueCommand => "cmd_",
            Kind::Position => "q_",
            Kind::Velocity => "dq_",
            Kind::Torque => "tau_",
        }
    }

    /// What columns of this kind hold.
    pub(super) fn what(self) -> &'static str {
        match self {
            Kind::Command => "commands",
            Kind::TorqueCommand => "commanded torques",
            Kind::Position => "measured positions",
            Kind::Velocity => "measured velocities",
            Kind::Torque => "measured torques",
        }
    }
}

/// A name in lower-case words and numbers: `LeftKnee_pos2` is left, knee, pos, 2.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for c in name.chars() {
        let begins = !before.is_alphanumeric()
            || (before.is_lowercase() && c.is_uppercase())
            || before.is_ascii_digit() != c.is_ascii_digit();
        if c.is_alphanumeric() {
            match words.last_mut() {
                Some(word) if !begins => word.extend(c.to_lowercase()),
                _ => words.push(c.to_lowercase().collect()),
            }
        }
        before = c;
    }
    words
}

/// The kind of a column by its words, and the words that remain for the joint's name; `None` for a kind that btr has no
/// channel for.
pub(super) fn kind_of(words: &[String]) -> Option<(Kind, Vec<String>)> {
    let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
    // `elbow_current` is in A, and `elbow_current_position` is a position.
    let current_alone = words.iter().any(|word| word == "current")
        && !words.iter().any(|word| word != "current" && QUANTITIES.iter().any(|list| list.contains(&word.as_str())));
    if has(&OTHER) || current_alone {
        return None;
    }
    let kind = match (has(&COMMAND), has(&VELOCITY), has(&TORQUE)) {
        (true, true, _) => return None,
        (true, false, true) => Kind::TorqueCommand,
        (true, false, false) => Kind::Command,
        (false, true, _) => Kind::Velocity,
        (false, false, true) => Kind::Torque,
        (false, false, false) => Kind::Position,
    };
    let known = |word: &&String| QUANTITIES.iter().chain([&UNITS[..]].iter()).any(|list| list.contains(&word.as_str()));
    let rest = words.iter().filter(|word| !known(word));
    Some((kind, rest.cloned().collect()))
}

/// The words of a joint's name that tell it from other joints: without what all names share, and without `joint`.
pub(super) fn distinctive(joints: &[&str]) -> Vec<Vec<String>> {
    let all: Vec<Vec<String>> = joints.iter().map(|joint| words(joint)).collect();
    let shared = |word: &String| all.len() > 1 && all.iter().all(|words| words.contains(word));
    let own = |words: &Vec<String>| -> Vec<String> {
        words.iter().filter(|word| !shared(word) && !["joint", "motor"].contains(&word.as_str())).cloned().collect()
    };
    all.iter().map(|words| if own(words).is_empty() { words.clone() } else { own(words) }).collect()
}

/// Whether a column's name can be that of a clock.
pub(super) fn is_time(name: &str) -> bool {
    let words = words(name);
    words.first().is_some_and(|first| TIME.contains(&first.as_str()))
        && words.iter().all(|word| TIME.contains(&word.as_str()) || ["s", "ms", "us", "ns"].contains(&word.as_str()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn kind(name: &str) -> (Kind, String) {
        let (kind, rest) = kind_of(&words(name)).unwrap();
        (kind, rest.join(" "))
    }

    #[test]
    fn names_say_kind_and_joint() {
        assert_eq!(kind("ElbowPosition"), (Kind::Position, "elbow".into()));
        assert_eq!(kind("goal_pos.left-knee [deg]"), (Kind::Command, "left knee".into()));
        assert_eq!(kind("target_q_3"), (Kind::Command, "3".into()));
        assert_eq!(kind("desired_torque_hip"), (Kind::TorqueCommand, "hip".into()));
        assert_eq!(kind("joint2_vel"), (Kind::Velocity, "2".into()));
        assert_eq!(kind("effort_wrist"), (Kind::Torque, "wrist".into()));
        assert_eq!(kind("elbow_current_position"), (Kind::Position, "elbow".into()));
        assert_eq!(kind("Soll A2 [deg]"), (Kind::Command, "a 2".into()));
        assert_eq!(kind("Ziel A2 [deg]"), (Kind::Command, "a 2".into()));
        assert_eq!(kind("Ist A2 [deg]"), (Kind::Position, "a 2".into()));
        for other in ["target_velocity_hip", "elbow_temperature", "elbow_current", "q_error_hip"] {
            assert_eq!(kind_of(&words(other)), None, "{other}");
        }
    }

    #[test]
    fn joints_are_told_by_what_they_do_not_share() {
        let names = distinctive(&["panda_joint1", "panda_joint2"]);
        assert_eq!(names, [["1"], ["2"]]);
        assert_eq!(distinctive(&["shoulder_pan_joint", "shoulder_lift_joint"]), [["pan"], ["lift"]]);
    }

    #[test]
    fn clocks_are_known_by_their_names() {
        assert!(["t", "Time", "timestamp_ms", "elapsed time", "Zeit_ms"].iter().all(|name| is_time(name)));
        assert!(!["q_t", "torque", "temperature", "time_to_goal"].iter().any(|name| is_time(name)));
    }
}

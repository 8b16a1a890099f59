//! What channels are called: btr's own names, the names of other people's logs, and the units that hide in both.

use btr_core::log::Role;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// Where a log's channels are: the `[channels]` table of a model or experiment file.
///
/// btr's own names (`t`, `cmd_<joint>`, `q_<joint>`, ...) are always understood; the mapping adds foreign ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// The CSV column that holds the time in seconds (`_ms`, `_us` and `_ns` at the end of its name are heeded).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// btr's name = the log's name, with a factor where its unit is another: `q_elbow = { column = "elbow", factor = 0.0175 }`.
    /// `{joint}` on both sides stands for any joint: `"cmd_{joint}" = "q_cmd_{joint}"`.
    #[serde(skip_serializing_if = "IndexMap::is_empty")]
    pub channels: IndexMap<String, Theirs>,
    /// A channel of 0 and 1; where it is 0, commands are NaN (nothing is driven, but for losses up to 50 ms). `{joint}` makes it
    /// one per joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_on: Option<String>,
    /// Where things are in an MCAP file.
    #[serde(skip_serializing_if = "is_default")]
    pub topics: Topics,
}

/// What a log calls a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
pub enum Theirs {
    /// A name; a unit at its end (`_deg`) is heeded.
    Name(String),
    /// A name whose values are not in btr's unit.
    Scaled {
        /// The name.
        column: String,
        /// Times this, its values are in btr's unit; the name's end is not asked.
        factor: f64,
    },
}

impl Theirs {
    /// The log's name.
    pub(crate) fn name(&self) -> &str {
        match self {
            Theirs::Name(name) | Theirs::Scaled { column: name, .. } => name,
        }
    }
}

/// The topics of an MCAP file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Topics {
    /// What the joints did: `sensor_msgs/msg/JointState`.
    pub states: String,
    /// What the joints were told: `JointState` or `trajectory_msgs/msg/JointTrajectory`.
    pub commands: String,
    /// `sensor_msgs/msg/Imu`.
    pub imu: String,
    /// Topics of bare numbers (`std_msgs/msg/Float64MultiArray`) and what each number is.
    #[serde(skip_serializing_if = "IndexMap::is_empty")]
    pub arrays: IndexMap<String, Vec<String>>,
}

impl Default for Topics {
    fn default() -> Self {
        Topics {
            states: "/joint_states".into(),
            commands: "/joint_commands".into(),
            imu: "/imu".into(),
            arrays: IndexMap::new(),
        }
    }
}

fn is_default(topics: &Topics) -> bool {
    *topics == Topics::default()
}

/// What a name stands for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Meaning {
    /// btr's name.
    pub(crate) name: String,
    /// SI unit.
    pub(crate) unit: &'static str,
    /// Command, sensor or outside knowledge.
    pub(crate) role: Role,
    /// Times this, a value is in `unit`.
    pub(crate) factor: f64,
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// How headers end, which unit that is, and the factor to it. Longer endings first, and
/// for each unit the SI one.
const SUFFIXES: [(&str, &str, f64); 9] = [
    ("_rad_s", "rad/s", 1.0),
    ("_deg_s", "rad/s", DEGREE),
    ("_m_s", "m/s", 1.0),
    ("_rad", "rad", 1.0),
    ("_deg", "rad", DEGREE),
    ("_nm", "N·m", 1.0),
    ("_m", "m", 1.0),
    ("_n", "N", 1.0),
    ("_v", "V", 1.0),
];

/// The units that may end the header of a joint's channel, by the channel's prefix, the usual one first.
const FAMILIES: [(&str, &[&str]); 4] =
    [("cmd_", &["rad", "m", "N·m", "V"]), ("q_", &["rad", "m"]), ("dq_", &["rad/s", "m/s"]), ("tau_", &["N·m", "N"])];

impl Mapping {
    /// What the mapping says a foreign name is; `None` when it says nothing.
    pub(crate) fn meaning(&self, theirs: &str) -> Option<Meaning> {
        let exact = self.channels.iter().find(|(_, t)| t.name() == theirs).map(|(ours, t)| (ours.clone(), t));
        let by_pattern = || self.channels.iter().find_map(|(ours, t)| Some((fill(t.name(), ours, theirs)?, t)));
        let (name, said) = exact.or_else(by_pattern)?;
        let plain = Meaning::of(name);
        Some(match (said, suffix(theirs)) {
            (Theirs::Scaled { factor, .. }, _) => Meaning { factor: *factor, ..plain },
            (Theirs::Name(_), Some((_, unit, factor))) => Meaning { unit, factor, ..plain },
            (Theirs::Name(_), None) => plain,
        })
    }

    /// What a log has to call one of btr's channels, and the key that says so.
    pub(crate) fn theirs(&self, ours: &str) -> Option<(&str, String)> {
        let exact = self.channels.get_key_value(ours).map(|(key, t)| (key.as_str(), t.name().to_owned()));
        let by_pattern = |(key, theirs): (&'_ String, &Theirs)| fill(key, theirs.name(), ours);
        exact
            .or_else(|| self.channels.iter().find_map(|(key, theirs)| Some((key.as_str(), by_pattern((key, theirs))?))))
    }

    /// The name of the 0/1 channel that switches the given command.
    pub(crate) fn torque_on_for(&self, command: &str) -> Option<String> {
        let joint = command.strip_prefix("cmd_")?;
        self.torque_on.as_ref().map(|name| name.replace("{joint}", joint))
    }
}

/// When `theirs` fits the pattern `from`, the pattern `to` with the same joint.
fn fill(from: &str, to: &str, theirs: &str) -> Option<String> {
    let (head, tail) = from.split_once("{joint}")?;
    let joint = theirs.strip_prefix(head)?.strip_suffix(tail)?;
    (!joint.is_empty()).then(|| to.replace("{joint}", joint))
}

impl Meaning {
    /// btr's own name, with the unit and the role that its beginning tells.
    pub(crate) fn of(name: String) -> Self {
        let (unit, role) = (usual_unit(&name), role(&name));
        Meaning { name, unit, role, factor: 1.0 }
    }

    /// What a CSV header means without a mapping: `q_cmd_` is `cmd_`, and a unit may stand at the end.
    pub(crate) fn of_header(header: &str) -> Self {
        let name = match header.strip_prefix("q_cmd_") {
            Some(joint) => format!("cmd_{joint}"),
            None => header.to_owned(),
        };
        let units =
            FAMILIES.iter().find(|(prefix, _)| name.starts_with(prefix)).map(|(prefix, units)| (*prefix, *units));
        if let (Some((prefix, units)), Some((stem, unit, factor))) = (units, suffix(&name))
            && units.contains(&unit)
            && stem.len() > prefix.len()
        {
            return Meaning { name: stem.to_owned(), unit, role: role(&name), factor };
        }
        Meaning::of(name)
    }
}

/// The header under which a channel is read back from CSV as what it is; `None` when there is none.
pub(crate) fn header(name: &str) -> Option<String> {
    if Meaning::of_header(name).name == name {
        return Some(name.to_owned());
    }
    // A joint called `arm_m` needs its unit spelt out, or `_m` would be taken for one.
    let ending = SUFFIXES.iter().find(|(_, unit, _)| *unit == usual_unit(name))?;
    let header = format!("{name}{}", ending.0);
    (Meaning::of_header(&header).name == name).then_some(header)
}

/// Splits a unit off the end of a name, whatever its case.
fn suffix(name: &str) -> Option<(&str, &'static str, f64)> {
    SUFFIXES.iter().find_map(|&(ending, unit, factor)| {
        let at = name.len().checked_sub(ending.len())?;
        let (stem, tail) = name.split_at_checked(at)?;
        tail.eq_ignore_ascii_case(ending).then_some((stem, unit, factor))
    })
}

/// Seconds per unit of a time column.
pub(crate) fn seconds_per_unit(column: &str) -> f64 {
    match column.rsplit_once('_').map(|(_, unit)| unit) {
        Some("ms") => 1e-3,
        Some("us") => 1e-6,
        Some("ns") => 1e-9,
        _ => 1.0,
    }
}

fn role(name: &str) -> Role {
    let starts = |prefixes: &[&str]| prefixes.iter().any(|p| name.starts_with(p));
    if starts(&["cmd_"]) {
        Role::Command
    } else if starts(&["q_", "dq_", "tau_", "imu_", "foot_"]) {
        Role::Measured
    } else {
        Role::Truth
    }
}

/// The SI unit of a name when nothing else is said: angles for joints, and by what follows the prefix for bodies
/// (`imu_acc_x` is an acceleration, `imu_gyro_x` and `base_wx` are rates of turn, `base_vx` a velocity, `base_qw` a number).
fn usual_unit(name: &str) -> &'static str {
    if let Some((_, units)) = FAMILIES.iter().find(|(prefix, _)| name.starts_with(prefix)) {
        return units[0];
    }
    if name.starts_with("foot_") {
        return "N";
    }
    let Some(rest) = ["imu_", "base_", "ball_"].iter().find_map(|p| name.strip_prefix(p)) else { return "1" };
    match rest {
        "roll" | "pitch" | "yaw" => "rad",
        "x" | "y" | "z" => "m",
        "vx" | "vy" | "vz" => "m/s",
        "wx" | "wy" | "wz" | "gyro_x" | "gyro_y" | "gyro_z" => "rad/s",
        "ax" | "ay" | "az" | "acc_x" | "acc_y" | "acc_z" => "m/s²",
        _ => "1",
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use proptest::prelude::*;

    fn read(header: &str) -> (String, &'static str) {
        let meaning = Meaning::of_header(header);
        (meaning.name, meaning.unit)
    }

    #[test]
    fn headers_carry_units() {
        assert_eq!(read("q_cmd_knee_rad"), ("cmd_knee".into(), "rad"));
        assert_eq!(read("dq_knee_rad_s"), ("dq_knee".into(), "rad/s"));
        assert_eq!(read("q_slider_m"), ("q_slider".into(), "m"));
        assert_eq!(read("tau_knee_Nm"), ("tau_knee".into(), "N·m"));
        assert_eq!(read("q_left_knee"), ("q_left_knee".into(), "rad"));
        // A joint called `rad` is a joint, and a velocity is no position.
        assert_eq!(read("q_rad"), ("q_rad".into(), "rad"));
        assert_eq!(read("q_knee_n"), ("q_knee_n".into(), "rad"));
        assert_eq!(Meaning::of_header("q_knee_deg").factor.to_bits(), DEGREE.to_bits());
    }

    #[test]
    fn mappings_rename_one_by_one_and_by_pattern() {
        let mapping: Mapping = toml::from_str(
            r#"channels = { "cmd_{joint}" = "q_cmd_{joint}", q_motor = "encoder_deg", "q_{joint}" = "{joint}_pos_rad" }"#,
        )
        .unwrap();
        let name = |theirs: &str| mapping.meaning(theirs).map(|m| m.name);
        assert_eq!(name("q_cmd_hip"), Some("cmd_hip".into()));
        assert_eq!(name("encoder_deg"), Some("q_motor".into()));
        assert_eq!(name("hip_pos_rad"), Some("q_hip".into()));
        assert_eq!(name("_pos_rad"), None);
        assert_eq!(name("load"), None);
        assert_eq!(mapping.meaning("encoder_deg").unwrap().factor.to_bits(), DEGREE.to_bits());
    }

    #[test]
    fn a_factor_says_what_the_name_does_not() {
        let text = r#"channels = { "q_{joint}" = { column = "{joint}_deg", factor = -2.0 }, cmd_hip = "hip_goal" }"#;
        let mapping: Mapping = toml::from_str(text).unwrap();
        let meaning = mapping.meaning("hip_deg").unwrap();
        assert_eq!((meaning.name.as_str(), meaning.unit, meaning.factor), ("q_hip", "rad", -2.0));
        assert_eq!(mapping.theirs("q_hip"), Some(("q_{joint}", "hip_deg".to_owned())));
        assert_eq!(toml::from_str::<Mapping>(&toml::to_string(&mapping).unwrap()).unwrap(), mapping);
    }

    #[test]
    fn a_misspelt_key_is_refused() {
        assert!(toml::from_str::<Mapping>("tme = \"t\"").is_err());
        assert!(toml::from_str::<Mapping>(r#"channels.q_hip = { column = "hip", facto = 2.0 }"#).is_err());
    }

    proptest! {
        #[test]
        fn what_is_written_as_a_header_is_read_back_as_the_same_name(
            prefix in "cmd_|q_|dq_|tau_|foot_|base_|", joint in "[a-z_éN]{1,6}(_m|_rad|_rad_s|_V|_nm|_n)?",
        ) {
            let name = format!("{prefix}{joint}");
            if let Some(header) = header(&name) {
                prop_assert_eq!(Meaning::of_header(&header).name, name);
            } else {
                prop_assert!(name.starts_with("q_cmd_"), "{} has no header", name);
            }
        }
    }
}

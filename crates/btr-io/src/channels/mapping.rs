//! The `[channels]` table of a model file: names and units of foreign logs.

use super::names::{Meaning, seconds_per_unit, suffix};
use btr_core::log::Role;
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

/// Where a log's channels are: the `[channels]` table of a model or experiment file.
///
/// btr's own names (`t`, `cmd_<joint>`, `q_<joint>`, ...) are always understood; the mapping adds foreign ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// The CSV column that holds the time in seconds (`_ms`, `_us` and `_ns` at the end of its name are recognised).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// The unit of that column where its name does not say it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<TimeUnit>,
    /// btr's name = the log's name, with a factor where its unit is another: `q_elbow = { column = "elbow", factor =
    /// 0.0175 }`.
    /// `{joint}` on both sides stands for any joint: `"cmd_{joint}" = "q_cmd_{joint}"`.
    #[serde(skip_serializing_if = "IndexMap::is_empty")]
    pub channels: IndexMap<String, ForeignName>,
    /// A channel of 0 and 1; where it is 0, commands are NaN (nothing is driven, but for losses up to 50 ms). `{joint}`
    /// makes it one per joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_on: Option<String>,
    /// A channel of 0 and 1; where it is 0, readings are left out. `{joint}` makes it one per joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valid: Option<String>,
    /// The opposite of `valid`: where it is 1, readings are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suspect: Option<String>,
    /// Whether readings that no motion explains are kept; they are left out by default.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub keep_glitches: bool,
    /// Whether torques of a prescribed motion are compared where the joint stands still; they are left out by default.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub keep_standstill: bool,
    /// Where things are in an MCAP file.
    #[serde(skip_serializing_if = "is_default")]
    pub topics: Topics,
}

/// A unit of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl TimeUnit {
    /// Its symbol.
    pub fn name(self) -> &'static str {
        match self {
            TimeUnit::S => "s",
            TimeUnit::Ms => "ms",
            TimeUnit::Us => "us",
            TimeUnit::Ns => "ns",
        }
    }

    /// Its length in s.
    pub fn seconds(self) -> f64 {
        match self {
            TimeUnit::S => 1.0,
            TimeUnit::Ms => 1e-3,
            TimeUnit::Us => 1e-6,
            TimeUnit::Ns => 1e-9,
        }
    }
}

/// What a log calls a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged, deny_unknown_fields)]
pub enum ForeignName {
    /// A name; a unit at its end (`_deg`) is recognised.
    Name(String),
    /// A name whose values are not in btr's unit.
    Scaled {
        /// The name.
        column: String,
        /// Times this, its values are in btr's unit; the name's end is not asked.
        factor: f64,
    },
}

impl ForeignName {
    /// The log's name.
    pub(crate) fn name(&self) -> &str {
        match self {
            ForeignName::Name(name) | ForeignName::Scaled { column: name, .. } => name,
        }
    }
}

/// A 0/1 channel that lets the samples of another one pass.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Switch {
    /// The log's name.
    pub(crate) name: String,
    /// The value with which they pass: 1 or 0.
    pub(crate) passes: bool,
}

impl Switch {
    /// Whether samples pass; a missing value counts as 0.
    pub(crate) fn lets_pass(&self, value: f64) -> bool {
        (value > 0.5) == self.passes
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

impl Mapping {
    /// Seconds per unit of a time column: as stated of the one that is named, or by the end of its name. What btr
    /// writes has seconds in `t`, whatever other logs have in their column.
    pub(crate) fn seconds_per_unit(&self, column: &str) -> f64 {
        let is_meant = self.time.as_deref().is_none_or(|time| time == column);
        self.time_unit.filter(|_| is_meant).map_or_else(|| seconds_per_unit(column), TimeUnit::seconds)
    }

    /// The meaning of a foreign name; `None` when the mapping does not know it.
    pub(crate) fn meaning(&self, theirs: &str) -> Option<Meaning> {
        let exact = self.channels.iter().find(|(_, t)| t.name() == theirs).map(|(ours, t)| (ours.clone(), t));
        let by_pattern = || self.channels.iter().find_map(|(ours, t)| Some((fill(t.name(), ours, theirs)?, t)));
        let (name, said) = exact.or_else(by_pattern)?;
        let plain = Meaning::of(name);
        Some(match (said, suffix(theirs)) {
            (ForeignName::Scaled { factor, .. }, _) => Meaning { factor: *factor, ..plain },
            (ForeignName::Name(_), Some((_, unit, factor))) => Meaning { unit: unit.into(), factor, ..plain },
            (ForeignName::Name(_), None) => plain,
        })
    }

    /// The foreign name of one of btr's channels, and the key of the mapping that defines it.
    pub fn theirs(&self, ours: &str) -> Option<(&str, String)> {
        let exact = self.channels.get_key_value(ours).map(|(key, t)| (key.as_str(), t.name().to_owned()));
        let by_pattern = |(key, theirs): (&'_ String, &ForeignName)| fill(key, theirs.name(), ours);
        exact
            .or_else(|| self.channels.iter().find_map(|(key, theirs)| Some((key.as_str(), by_pattern((key, theirs))?))))
    }

    /// The 0/1 channels without which samples of a channel are missing.
    pub(crate) fn switches_of(&self, channel: &str, role: Role) -> Vec<Switch> {
        let joint = channel.split_once('_').map_or("", |(_, joint)| joint);
        let named = |name: &Option<String>, passes| {
            let name = name.as_ref()?.replace("{joint}", joint);
            Some(Switch { name, passes })
        };
        let all = match role {
            Role::Command => [named(&self.torque_on, true), None],
            Role::Measured => [named(&self.valid, true), named(&self.suspect, false)],
            Role::Truth => [None, None],
        };
        all.into_iter().flatten().collect()
    }

    /// The names of 0/1 channels, by their keys.
    pub(crate) fn switch_names(&self) -> impl Iterator<Item = (&str, &str)> {
        let keys = [("torque_on", &self.torque_on), ("valid", &self.valid), ("suspect", &self.suspect)];
        keys.into_iter().filter_map(|(key, name)| Some((key, name.as_deref()?)))
    }
}

/// The pattern `to` with the joint of `theirs`, if that matches the pattern `from`.
fn fill(from: &str, to: &str, theirs: &str) -> Option<String> {
    let (head, tail) = from.split_once("{joint}")?;
    let joint = theirs.strip_prefix(head)?.strip_suffix(tail)?;
    (!joint.is_empty()).then(|| to.replace("{joint}", joint))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::names::DEGREE;
    use super::*;

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
    fn a_factor_overrides_the_unit_of_the_name() {
        let text = r#"channels = { "q_{joint}" = { column = "{joint}_deg", factor = -2.0 }, cmd_hip = "hip_goal" }"#;
        let mapping: Mapping = toml::from_str(text).unwrap();
        let meaning = mapping.meaning("hip_deg").unwrap();
        assert_eq!((meaning.name.as_str(), &*meaning.unit, meaning.factor), ("q_hip", "rad", -2.0));
        assert_eq!(mapping.theirs("q_hip"), Some(("q_{joint}", "hip_deg".to_owned())));
        assert_eq!(toml::from_str::<Mapping>(&toml::to_string(&mapping).unwrap()).unwrap(), mapping);
    }

    #[test]
    fn a_misspelt_key_is_refused() {
        assert!(toml::from_str::<Mapping>("tme = \"t\"").is_err());
        assert!(toml::from_str::<Mapping>(r#"channels.q_hip = { column = "hip", facto = 2.0 }"#).is_err());
    }
}

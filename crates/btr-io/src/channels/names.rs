//! Channel names: btr's own names, and units at their ends.

use btr_core::log::Role;
use std::borrow::Cow;

/// The meaning of a name: channel, unit, role and factor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Meaning {
    /// btr's name.
    pub(crate) name: String,
    /// SI unit.
    pub(crate) unit: Cow<'static, str>,
    /// Command, measurement or external truth.
    pub(crate) role: Role,
    /// Factor from the value's unit to `unit`.
    pub(crate) factor: f64,
}

pub(super) const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Suffixes of headers, their SI units, and the factors to them. Longer suffixes first, and for each unit the SI one
/// first.
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

impl Meaning {
    /// One of btr's own names, with unit and role by its prefix.
    pub(crate) fn of(name: String) -> Self {
        let (unit, role) = (usual_unit(&name), role(&name));
        Meaning { name, unit: unit.into(), role, factor: 1.0 }
    }

    /// The meaning of a CSV header without a mapping: `q_cmd_` is `cmd_`, and a unit may follow.
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
            return Meaning { name: stem.to_owned(), unit: unit.into(), role: role(&name), factor };
        }
        Meaning::of(name)
    }
}

/// The header under which a channel reads back from CSV unchanged; `None` when there is none.
pub(crate) fn header(name: &str) -> Option<String> {
    if Meaning::of_header(name).name == name {
        return Some(name.to_owned());
    }
    // A joint called `arm_m` needs an explicit unit, or `_m` would be read as one.
    let ending = SUFFIXES.iter().find(|(_, unit, _)| *unit == usual_unit(name))?;
    let header = format!("{name}{}", ending.0);
    (Meaning::of_header(&header).name == name).then_some(header)
}

/// Splits a unit off the end of a name, ignoring case.
pub(super) fn suffix(name: &str) -> Option<(&str, &'static str, f64)> {
    SUFFIXES.iter().find_map(|&(ending, unit, factor)| {
        let at = name.len().checked_sub(ending.len())?;
        let (stem, tail) = name.split_at_checked(at)?;
        tail.eq_ignore_ascii_case(ending).then_some((stem, unit, factor))
    })
}

/// Whether a name has two of btr's prefixes (`q_q_knee`): its foreign name was one of btr's own.
pub(super) fn is_doubled(name: &str) -> bool {
    let joint_of = |name: &'_ str| FAMILIES.iter().find_map(|(prefix, _)| name.strip_prefix(prefix).map(str::len));
    joint_of(name).is_some_and(|joint| joint_of(&name[name.len() - joint..]).is_some())
}

/// Seconds per unit of a time column.
pub(super) fn seconds_per_unit(column: &str) -> f64 {
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

/// The SI unit of a name without an explicit one: angles for joints, and by what follows the prefix for bodies
/// (`imu_acc_x` is an acceleration, `imu_gyro_x` and `base_wx` are rates of turn, `base_vx` a velocity, `base_qw` a
/// number).
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

    fn read(header: &str) -> (String, Cow<'static, str>) {
        let meaning = Meaning::of_header(header);
        (meaning.name, meaning.unit)
    }

    #[test]
    fn headers_carry_units() {
        assert_eq!(read("q_cmd_knee_rad"), ("cmd_knee".into(), "rad".into()));
        assert_eq!(read("dq_knee_rad_s"), ("dq_knee".into(), "rad/s".into()));
        assert_eq!(read("q_slider_m"), ("q_slider".into(), "m".into()));
        assert_eq!(read("tau_knee_Nm"), ("tau_knee".into(), "N·m".into()));
        assert_eq!(read("q_left_knee"), ("q_left_knee".into(), "rad".into()));
        // A joint called `rad` is a joint, and a velocity is no position.
        assert_eq!(read("q_rad"), ("q_rad".into(), "rad".into()));
        assert_eq!(read("q_knee_n"), ("q_knee_n".into(), "rad".into()));
        assert_eq!(Meaning::of_header("q_knee_deg").factor.to_bits(), DEGREE.to_bits());
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

//! Checks that reject a log.

use btr_core::log::{Log, LogError};
use btr_io::Mapping;
use btr_physics::robot::Robot;

/// Largest time between two samples, in s.
const LONGEST_STEP_S: f64 = 0.5;

/// Why a log is rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub(crate) struct UnusableLog {
    pub message: String,
    pub help: Option<String>,
}

/// Rejects a log that is too short, or whose clock cannot be in seconds.
pub(crate) fn check_clock(log: &Log) -> Result<(), UnusableLog> {
    if log.len() < 2 {
        return Err(UnusableLog { message: "a log needs at least two samples".to_owned(), help: None });
    }
    let step_s = log.usual_step_s().unwrap_or(0.0);
    if step_s > LONGEST_STEP_S { Err(not_in_seconds(step_s)) } else { Ok(()) }
}

fn not_in_seconds(step_s: f64) -> UnusableLog {
    let (unit, ending) = match step_s {
        ..500.0 => ("milliseconds", "ms"),
        500.0..5e5 => ("microseconds", "us"),
        _ => ("nanoseconds", "ns"),
    };
    let help = format!(
        "btr expects seconds; or call the time column t_{ending} and say so in the model file: [channels] time = \"t_{ending}\" \
         (_ms, _us and _ns at the end of its name are recognised)"
    );
    UnusableLog { message: format!("{step_s} s between two samples: is its time in {unit}?"), help: Some(help) }
}

/// Rejects the log of a real test that measures nothing of the robot.
pub(crate) fn check_measures_robot(log: &Log, robot: &Robot) -> Result<(), UnusableLog> {
    let joints = robot.movable().map(|(_, link)| link.joint.name.as_str());
    let of_joints: Vec<String> =
        joints.flat_map(|joint| ["q", "dq", "tau"].map(|kind| format!("{kind}_{joint}"))).collect();
    let is_known = |channel: &str| {
        let of_base = ["imu_", "foot_", "base_", "ball_"].iter().any(|kind| channel.starts_with(kind));
        of_base || of_joints.iter().any(|name| name == channel)
    };
    if log.channels().any(|(channel, c)| is_known(channel) && c.values.iter().any(|x| x.is_finite())) {
        return Ok(());
    }
    let available = log.channels().map(|(channel, _)| channel).collect::<Vec<_>>().join(", ");
    let help =
        format!("return {}, ..., or map its names in the experiment's [channels.channels]", of_joints.join(", "));
    Err(UnusableLog { message: format!("contains no channel of this robot: it has {available}"), help: Some(help) })
}

/// Rejects a log without a position of any joint, or without one that the mapping names.
pub(crate) fn check_positions(log: &Log, robot: &Robot, mapping: &Mapping) -> Result<(), LogError> {
    let position = |joint: &str| log.values(&format!("q_{joint}"));
    let joints = || robot.movable().map(|(_, link)| link.joint.name.as_str());
    let has_none = joints().all(|joint| position(joint).is_err());
    let mapped = |joint: &&str| mapping.channels.contains_key(&format!("q_{joint}"));
    let missing = joints().filter(|joint| has_none || mapped(joint)).find_map(|joint| position(joint).err());
    missing.map_or(Ok(()), Err)
}

/// Warnings about a usable log: channels without a value, and commands that change more often than the model takes
/// steps of `dt_s`.
pub(crate) fn warnings(log: &Log, dt_s: Option<f64>) -> Vec<String> {
    let mut warnings = Vec::new();
    let empty = log.channels().filter(|(_, channel)| channel.values.iter().all(|x| x.is_nan()));
    warnings.extend(empty.map(|(name, _)| format!("`{name}` has no values")));
    if let Some((step_s, dt_s)) = log.usual_step_s().zip(dt_s).filter(|(step_s, dt_s)| is_coarser(*dt_s, *step_s)) {
        warnings.push(format!(
            "a command every {step_s:.4} s, but the model takes one step in {dt_s:.4} s (simulation.control_s / steps_per_control)"
        ));
    }
    warnings
}

/// Whether sampling with this period misses events of another period.
pub(crate) fn is_coarser(period_s: f64, other_s: f64) -> bool {
    period_s > 1.5 * other_s
}

//! Initial state of a robot in a log.

use btr_core::log::{Log, LogError};
use btr_core::signal::noise::NoiseEstimate;
use btr_core::signal::smooth;
use btr_physics::robot::{Actuator, Robot};

/// Initial position and velocity of every joint; the robot's start if the log does not have them. A log without the
/// commands of a joint with a motor cannot be replayed.
///
/// # Errors
/// Commands that are missing.
pub fn starts(log: &Log, robot: &Robot) -> Result<Vec<(f64, f64)>, LogError> {
    robot
        .movable()
        .map(|(_, link)| {
            let joint = &link.joint;
            if !matches!(joint.actuator, Actuator::Prescribed | Actuator::Passive) {
                log.values(&format!("cmd_{}", joint.name))?;
            }
            Ok(start_of(log, &joint.name).unwrap_or((joint.start, 0.0)))
        })
        .collect()
}

/// Initial position and velocity of a joint, estimated from the first positions together: a single reading has the
/// sensor's noise, and a difference of two has far more. The first reading of a log without noise is used directly.
fn start_of(log: &Log, joint: &str) -> Option<(f64, f64)> {
    let first = |prefix: &str| {
        let channel = log.channel(&format!("{prefix}_{joint}"))?;
        channel.values.iter().copied().find(|x| x.is_finite())
    };
    let reading = (first("q")?, first("dq").unwrap_or(0.0));
    let positions = &log.channel(&format!("q_{joint}"))?.values;
    let Some(noise) = NoiseEstimate::of(positions).filter(|noise| !noise.is_negligible()) else { return Some(reading) };
    let begin = smooth::start(log.clock_s(), positions, noise.sigma(), first("dq"));
    Some(begin.map_or(reading, |motion| (motion.value, motion.velocity)))
}

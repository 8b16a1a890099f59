//! What a set of logs covers of a robot.

use btr_core::log::Log;
use btr_physics::robot::Robot;
use btr_physics::sensor::SensorNoise;

/// Readings whose range is within this many noise floors do not move.
const DEAD: f64 = 10.0;

/// Joints for which no log has a comparable reading.
pub(crate) fn unmeasured_joints(robot: &Robot, logs: &[Log]) -> Vec<String> {
    let has = |log: &Log, name: &str| log.channel(name).is_some_and(|c| c.values.iter().any(|x| x.is_finite()));
    let joints = robot.movable().map(|(_, link)| &link.joint);
    let unmeasured = joints.filter(|joint| !logs.iter().any(|log| has(log, &joint.compared())));
    unmeasured.map(|joint| joint.name.clone()).collect()
}

/// Whether a log has a reading that can be compared with a simulation.
pub(crate) fn measures_a_joint(robot: &Robot, noise: &SensorNoise, log: &Log) -> bool {
    let compared = |name: &str| {
        let values = log.channel(name).map_or(&[][..], |channel| &channel.values);
        values.iter().any(|x| x.is_finite()) && noise.floor(name, values).is_some()
    };
    robot.movable().any(|(_, link)| compared(&link.joint.compared()))
}

/// Whether any comparable reading changes by more than its noise.
pub(crate) fn is_moving(robot: &Robot, noise: &SensorNoise, logs: &[Log]) -> bool {
    let moves = |log: &Log, name: &str| {
        let Some(channel) = log.channel(name) else { return false };
        let finite = channel.values.iter().filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        noise.floor(name, &channel.values).is_some_and(|sigma| high - low > DEAD * sigma)
    };
    let joints = || robot.movable().map(|(_, link)| &link.joint);
    logs.iter().any(|log| joints().any(|joint| moves(log, &joint.compared())))
}

//! The motion of a robot in a log: the positions of its joints and the poses of its base, for pictures of it.

use btr_core::log::Log;
use btr_physics::robot::{Follower, Joint, Robot};

/// A place in m and a rotation as a quaternion x, y, z, w.
pub type BasePose = [f64; 7];

/// Channels of the pose of a floating base, in the order of [`BasePose`].
const BASE: [&str; 7] = ["base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw"];

/// A channel's readings, the last one held where one is missing, and the first one before it; none without any.
pub fn readings(log: &Log, channel: &str) -> Option<Vec<f64>> {
    let values = &log.channel(channel)?.values;
    let mut held = *values.iter().find(|x| x.is_finite())?;
    let hold = |x: &f64| {
        held = if x.is_finite() { *x } else { held };
        held
    };
    Some(values.iter().map(hold).collect())
}

/// Positions of the joints that move, in the order of [`Robot::movable`]: readings of each, or of the joint that it
/// follows; none where there are none.
pub fn positions(robot: &Robot, log: &Log) -> Vec<Option<Vec<f64>>> {
    let joints: Vec<&Joint> = robot.movable().map(|(_, link)| &link.joint).collect();
    let own = |joint: &&Joint| readings(log, &format!("q_{}", joint.name));
    let mut positions: Vec<Option<Vec<f64>>> = joints.iter().map(own).collect();
    for Follower { joint, leader, ratio, offset } in robot.followers() {
        if positions[joint].is_none() {
            let of_leader = positions[leader].as_ref();
            positions[joint] = of_leader.map(|q| q.iter().map(|q| ratio * q + offset).collect());
        }
    }
    positions
}

/// Whether a log has the poses of a floating base.
pub fn has_base(log: &Log) -> bool {
    BASE.iter().all(|name| readings(log, name).is_some())
}

/// Poses of a floating base, of whose channels `values` gives the values at the wanted times; none if one is missing.
pub fn base(values: impl Fn(&str) -> Option<Vec<f64>>) -> Option<Vec<BasePose>> {
    let channels: Vec<Vec<f64>> = BASE.iter().map(|name| values(name)).collect::<Option<_>>()?;
    let times = channels.iter().map(Vec::len).min()?;
    Some((0..times).map(|k| std::array::from_fn(|i| channels[i][k])).collect())
}

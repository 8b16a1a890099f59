//! First gains of servos of which nothing is known.

use btr_physics::robot::Robot;
use btr_physics::robot::kinematics::link_poses;
use nalgebra::Vector3;

/// Deflection in rad (m) at which a servo gives all its torque...
const AT_EFFORT: f64 = 0.2;
/// ... and at which it carries what hangs on it.
const UNDER_LOAD: f64 = 0.05;
/// Damping per stiffness, in s.
const DAMPING_S: f64 = 0.03;

/// kp and kd of a joint's servo as a starting point of a fit: as stiff as the weight that it carries requires, but not
/// stiffer than its limit of torque suggests, which is often a placeholder.
pub(super) fn guessed(robot: &Robot, link: usize, effort: Option<f64>) -> (f64, f64) {
    let kp = (weight(robot, link) / UNDER_LOAD).min(effort.unwrap_or(f64::INFINITY) / AT_EFFORT);
    (rounded(kp.max(0.1)), rounded(DAMPING_S * kp.max(0.1)))
}

/// The largest torque that the carried weight can have about a joint, in N·m, at the pose with all joints at 0.
fn weight(robot: &Robot, link: usize) -> f64 {
    let mut poses = Vec::new();
    link_poses(robot, &robot.start, &[], &mut poses);
    let anchor: Vector3<f64> = poses[link].translation.vector;
    let carried = |mut other: usize| loop {
        match robot.links[other].parent {
            _ if other == link => break true,
            None => break false,
            Some(parent) => other = parent,
        }
    };
    let moment = |i: usize| {
        let body = &robot.links[i];
        9.81 * body.mass_kg * ((poses[i] * body.com_m).coords - anchor).norm()
    };
    (0..robot.links.len()).filter(|i| carried(*i)).map(moment).sum()
}

/// Two significant digits: a guess should look like one.
pub(super) fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

//! A motor that turns with two joints, as in the wrists of many industrial arms: the motor of the last joint is carried
//! through the one before, and turns with both. Its friction and its rotor act on both joints.

use super::effect::Param;
use crate::actuation::{JointInput, NeighbourQuantity};
use crate::engine::{Dof, mean_sign};
use crate::robot::{Actuator, Robot, Side};

/// Speed in rad/s at which dry friction is about three quarters of its own: a step at the reversal of a sum of two
/// speeds would make a light joint chatter.
const SMOOTH: f64 = 0.005;

pub(super) const CITE: &str = "Guedelha, Traversaro and Pucci, Identification of Motor Parameters on Coupled Joints, \
                               arXiv:1906.05070";

/// Parameters of the motor's law.
pub(super) const PARAMS: &[Param] = &[
    Param::new("coulomb", "N·m", (0.0, 5.0), 0.1),
    Param::new("viscous", "N·m·s/rad", (-5.0, 5.0), 0.05),
    Param::new("inertia", "kg·m^2", (-1.0, 1.0), 0.01),
    Param::shape("ratio", "1", (-3.0, 3.0), 1.0),
];

/// Signs of the ratio: by how many turns of the joint the motor turns for one of the neighbour.
pub(super) const STARTS: &[&[f64]] = &[&[1.0], &[-1.0]];

/// Whether the joint that carries a link can have such a motor. Where a motion is simulated, the two joints would have
/// to be solved for together: it is for prescribed motions.
pub(super) fn acts_on(robot: &Robot, link: usize, side: Side) -> bool {
    let prescribed = robot.links.get(link).is_some_and(|link| link.joint.actuator == Actuator::Prescribed);
    prescribed && robot.has_neighbour(link, side)
}

/// Adds the motor's torque on a joint; velocity and acceleration are those of the neighbour. What viscous friction and
/// rotor do by the joint's own motion is part of what the joint has.
pub(super) fn act(p: &[f64], dof: &mut Dof, state: &JointInput, neighbour: [NeighbourQuantity; 2]) {
    let &[coulomb, viscous, inertia, ratio] = p else { return };
    let Some(inputs) = state.neighbours else { return };
    let [velocity, acceleration] = neighbour.map(|quantity| inputs[quantity as usize]);
    let (whole, accelerates) = (state.dq + ratio * velocity, state.acceleration + ratio * acceleration);
    let sign = if state.mean_s > 0.0 { mean_sign(whole, accelerates, state.mean_s) } else { (whole / SMOOTH).tanh() };
    let dry = coulomb * sign;
    dof.torque.constant -= dry + viscous * velocity + inertia * acceleration;
}

//! Forward dynamics of a model in a given state.

use super::Model;
use crate::effects::in_force;
use crate::engine::{Dof, RobotState, forward_dynamics};
use crate::rollout::apply_static_effects;
use crate::setup::setup_error;
use btr_core::world::WorldError;
use std::borrow::Cow;

impl Model {
    /// Accelerations of simulation `s` in a state, with these joint torques (N·m; N for slides, in the order of
    /// [`movable`](crate::robot::Robot::movable)): those of a floating root, angular (rad/s²) and linear (m/s²), both
    /// in the world's axes, then those of the joints in rad/s² (m/s²). What is linear in a joint's state and constant
    /// in time counts: springs, damping, rotors; so do changed links and gravity. Motors, dry friction, further laws of
    /// torque, limits and contacts do not.
    ///
    /// # Errors
    /// A point outside S; a state or torques of another number of joints; an effect that the robot cannot have.
    pub fn accelerations(&self, s: &[f64], state: &RobotState, torques: &[f64]) -> Result<Vec<f64>, WorldError> {
        self.simulations.check(s)?;
        let (robot, effects, setup) = self.at(s, 0);
        let effects = in_force(&effects)?;
        let (robot, setup) = apply_static_effects(&robot, &effects, Cow::Borrowed(&setup))?;
        let mut robot = robot.into_owned();
        let movable: Vec<usize> = robot.movable().map(|(link, _)| link).collect();
        if [state.joints.len(), torques.len()].iter().any(|given| *given != movable.len()) {
            let message = format!("the robot has {} joints: give as many positions and torques", movable.len());
            return Err(setup_error(message));
        }
        let mut torques = torques.to_vec();
        for (i, link) in movable.into_iter().enumerate() {
            let mut dof = Dof::passive(&robot.links[link].joint);
            for placed in &effects {
                if placed.joints(&robot)?.contains(&i) {
                    placed.effect.joint(&placed.values, &mut dof);
                }
            }
            let (q, dq) = state.joints[i];
            robot.links[link].joint.armature = dof.armature;
            torques[i] += dof.torque.at(q, dq);
        }
        Ok(forward_dynamics(&robot, setup.gravity_m_s2, state, &torques))
    }
}

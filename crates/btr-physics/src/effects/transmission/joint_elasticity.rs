//! Elastic joint: belts, harmonic drives, printed gears, springs in series.
//!
//! The servo and its encoder are on the motor's side; the logged position is the link's. The rotor's inertia is the
//! joint's armature, or a hundredth of the inertia that the joint carries where the model has none. The rotor starts
//! where spring and servo are in equilibrium.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::effects::rotor;
use crate::effects::rotor::Spring;
use crate::engine::{Affine, Dof};

pub(in crate::effects) struct JointElasticity;

static SPEC: EffectSpec = EffectSpec {
    name: "joint_elasticity",
    law: "motor and link are joined by stiffness·(theta - q) + damping·(dtheta - dq)",
    site: SiteKind::Joint,
    cite: "De Luca and Book, Robots with Flexible Elements, Springer Handbook of Robotics, 2008, chapter 13",
    symptom: "the link oscillates after stops while the motor stands still, and deflects in proportion to the torque",
    params: &[
        Param::stiffness("stiffness", "N·m/rad", (0.5, 1e5), 15.0),
        Param::shape("damping", "N·m·s/rad", (0.0, 10.0), 0.02),
    ],
    starts: &[&[0.0], &[0.05]],
    similar: &["backlash", "command_delay", "motor_lag"],
    nested: &[],
};

impl Effect for JointElasticity {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_of_motor(&self) -> bool {
        true
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        rotor::MEMORY
    }

    fn encoder(&self, _p: &[f64], memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        rotor::arrive(memory, state)
    }

    fn transmit(&self, p: &[f64], memory: &mut [f64], motor: Affine, dof: &mut Dof, state: &JointInput) -> Affine {
        let inertia = rotor::take_inertia(dof, state);
        rotor::load(memory, &motor, |push, servo| (push + p[0] * state.q) / (servo + p[0]));
        let spring = Spring { stiffness: p[0], damping: p[1], stretch: memory[1] - state.q };
        rotor::transmit(memory, &motor, inertia, &spring, state)
    }

    fn motor_side(&self, memory: &[f64], dq: f64) -> Option<(f64, f64)> {
        rotor::motor_side(memory, dq)
    }
}

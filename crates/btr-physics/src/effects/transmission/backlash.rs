//! Play between motor and link: gears with clearance.
//!
//! The servo and its encoder sit on the motor's side, the logged position is the link's. Within the gap nothing is
//! transmitted; at its ends the flanks meet without bouncing. Whether they will touch at the step's end is foreseen
//! from the velocities, so that they neither miss each other nor chatter. The rotor's inertia is the joint's armature,
//! or a hundredth of what the joint carries where the model has none; it starts where the servo pushes it.

use crate::effects::rotor;
use crate::effects::rotor::Spring;
use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::engine::{Affine, Dof};
use crate::actuation::JointInput;

pub(in crate::effects) struct Backlash;

static SPEC: EffectSpec = EffectSpec {
    name: "backlash",
    law: "nothing is transmitted while |theta - q| < gap/2; the motor's side of the joint drives the link at either end",
    site: SiteKind::Joint,
    cite: "Nordin, Galic and Gutman, New Models for Backlash and Gear Play, Int. J. of Adaptive Control and Signal Processing 11, 1997",
    symptom: "the link stays behind by the gap after every reversal of the torque, and is loose where it carries nothing",
    params: &[Param::new("gap", "rad", (0.0, 0.5), 0.03)],
    starts: &[],
    similar: &["joint_elasticity", "command_deadband"],
    nested: &[],
};

/// How much stiffer than inertia/dt² the flanks are: they give way by this fraction of what a step would move the link.
const FLANK: f64 = 100.0;

/// Where a servo that pushes so hard at angle 0 would go if nothing held it.
fn resting(push: f64, servo: f64) -> f64 {
    if servo > 0.0 { push / servo } else { f64::INFINITY.copysign(push) }
}

impl Effect for Backlash {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn memory(&self, _p: &[f64], _dt_s: f64) -> usize {
        rotor::MEMORY
    }

    fn encoder(&self, _p: &[f64], memory: &mut [f64], state: &JointInput) -> (f64, f64) {
        rotor::arrive(memory, state)
    }

    fn transmit(&self, p: &[f64], memory: &mut [f64], motor: Affine, dof: &mut Dof, state: &JointInput) -> Affine {
        let inertia = rotor::take_inertia(dof, state);
        let (dt_s, play) = (state.dt_s, 0.5 * p[0]);
        rotor::load(memory, &motor, |push, servo| resting(push, servo).clamp(state.q - play, state.q + play));
        let ahead = rotor::loose(memory, &motor, inertia, dt_s).0 - (state.q + dt_s * state.dq);
        let touches = ahead.abs() > play;
        // Flanks that touch are all but one; what they overlapped at first they give back within a step.
        let stiffness = if touches { FLANK * (inertia + state.inertia) / (dt_s * dt_s) } else { 0.0 };
        let stretch = memory[1] - state.q - play.copysign(ahead);
        rotor::transmit(memory, &motor, inertia, &Spring { stiffness, damping: dt_s * stiffness, stretch }, state)
    }

    fn motor_side(&self, memory: &[f64], dq: f64) -> Option<(f64, f64)> {
        rotor::motor_side(memory, dq)
    }
}

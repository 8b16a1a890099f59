//! Play between motor and link: gears with clearance.
//!
//! The servo and its encoder are on the motor's side; the logged position is the link's. Within the gap nothing is
//! transmitted; at its ends the flanks meet without bouncing. Contact at the end of the step is predicted from the
//! velocities, so that the flanks neither miss each other nor chatter. The rotor's inertia is the joint's armature, or
//! a hundredth of the inertia that the joint carries where the model has none. The rotor starts where the servo pushes
//! it.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::effects::rotor;
use crate::effects::rotor::Spring;
use crate::engine::{Affine, Dof};

pub(in crate::effects) struct Backlash;

static SPEC: EffectSpec = EffectSpec {
    name: "backlash",
    law: "nothing is transmitted while |theta - q| < gap/2; the motor's side of the joint drives the link at either \
          end",
    site: SiteKind::Joint,
    cite: "Nordin, Galic and Gutman, New Models for Backlash and Gear Play, Int. J. of Adaptive Control and Signal \
           Processing 11, 1997",
    symptom: "the link lags by the gap after every reversal of the torque, and is loose where it carries no load",
    params: &[Param::new("gap", "rad", (0.0, 0.5), 0.03)],
    starts: &[],
    similar: &["joint_elasticity", "command_deadband", "command_offset"],
    nested: &[],
};

/// Stiffness of the flanks relative to inertia/dt²: they deflect by the inverse of this times the link's motion in a
/// step.
const FLANK: f64 = 100.0;

/// Angle at which a servo with torque `push` at angle 0 and stiffness `servo` comes to rest if nothing holds it.
fn resting(push: f64, servo: f64) -> f64 {
    if servo > 0.0 { push / servo } else { f64::INFINITY.copysign(push) }
}

impl Effect for Backlash {
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
        let (dt_s, play) = (state.dt_s, 0.5 * p[0]);
        rotor::load(memory, &motor, |push, servo| resting(push, servo).clamp(state.q - play, state.q + play));
        let predicted_gap = rotor::loose(memory, &motor, inertia, dt_s).0 - (state.q + dt_s * state.dq);
        let touches = predicted_gap.abs() > play;
        // Flanks in contact move almost as one; an initial overlap is resolved within a step.
        let stiffness = if touches { FLANK * (inertia + state.inertia) / (dt_s * dt_s) } else { 0.0 };
        let stretch = memory[1] - state.q - play.copysign(predicted_gap);
        rotor::transmit(memory, &motor, inertia, &Spring { stiffness, damping: dt_s * stiffness, stretch }, state)
    }

    fn motor_side(&self, memory: &[f64], dq: f64) -> Option<(f64, f64)> {
        rotor::motor_side(memory, dq)
    }
}

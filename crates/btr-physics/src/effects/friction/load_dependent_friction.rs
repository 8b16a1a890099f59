//! Friction in the teeth of a gear: the harder they are pressed together, the more they rub.
//!
//! The load is the motor's torque in the last step.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::engine::Dof;
use crate::actuation::JointInput;

pub(in crate::effects) struct LoadDependentFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "load_dependent_friction",
    law: "-ratio·|transmitted torque|·sign(dq); holds at rest",
    site: SiteKind::Joint,
    cite: "Duclusaud, Passault, Padois and Ly, Extended Friction Models for the Physics Simulation of Servo Actuators, arXiv:2410.08650",
    symptom: "dry friction that grows with the torque: little where the joint hangs, much where it lifts",
    params: &[Param::new("ratio", "1", (0.0, 0.95), 0.15)],
    starts: &[],
    similar: &["coulomb_friction"],
    nested: &[],
};

impl Effect for LoadDependentFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        dof.dry_friction += p[0] * state.torque.abs();
    }
}

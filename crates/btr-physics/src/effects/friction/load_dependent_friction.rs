//! Gear friction that grows with the transmitted torque.
//!
//! The transmitted torque is the motor's torque in the last step.

use crate::actuation::JointInput;
use crate::effects::effect::{DryFriction, Effect, EffectSpec, Param, SiteKind};
use crate::engine::Dof;

pub(in crate::effects) struct LoadDependentFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "load_dependent_friction",
    law: "-ratio·|transmitted torque|·sign(dq); holds at rest",
    site: SiteKind::Joint,
    cite: "Duclusaud, Passault, Padois and Ly, Extended Friction Models for the Physics Simulation of Servo Actuators, \
           arXiv:2410.08650",
    symptom: "dry friction that grows with the torque: small where the joint hangs, large where it lifts",
    params: &[Param::new("ratio", "1", (0.0, 0.95), 0.15)],
    starts: &[],
    similar: &["coulomb_friction", "stribeck_friction", "asymmetric_friction"],
    nested: &[],
};

impl Effect for LoadDependentFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn dry_friction(&self) -> DryFriction {
        DryFriction::Adds
    }

    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        dof.dry_friction += p[0] * state.torque.abs();
    }
}

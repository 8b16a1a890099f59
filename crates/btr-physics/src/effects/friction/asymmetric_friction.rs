//! Friction that differs between the two directions: a worn gear, a seal, a cable that pulls.
//!
//! Dry friction between -forward and +backward equals a symmetric one plus a constant: the engine holds the joint with
//! the mean of the two, and half their difference acts as a constant torque.

use crate::actuation::JointInput;
use crate::effects::effect::{DryFriction, Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;

pub(in crate::effects) struct AsymmetricFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "asymmetric_friction",
    law: "-coulomb_forward - viscous_forward·dq while dq > 0, coulomb_backward - viscous_backward·dq while dq < 0",
    site: SiteKind::Joint,
    cite: "Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994",
    symptom: "the torque residual flips with the sign of the velocity, but not about zero; one direction is slower",
    params: &[
        Param::new("coulomb_forward", "N·m", (0.0, 5.0), 0.2),
        Param::new("coulomb_backward", "N·m", (0.0, 5.0), 0.05),
        Param::new("viscous_forward", "N·m·s/rad", (0.0, 5.0), 0.05),
        Param::new("viscous_backward", "N·m·s/rad", (0.0, 5.0), 0.02),
    ],
    starts: &[],
    similar: &["coulomb_friction", "viscous_friction"],
    nested: &[("coulomb_friction", &[0.1, 0.1, 0.0, 0.0]), ("viscous_friction", &[0.0, 0.0, 0.1, 0.1])],
};

impl Effect for AsymmetricFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    fn dry_friction(&self) -> DryFriction {
        DryFriction::Adds
    }

    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        let (forward, backward) = (p[0], p[1]);
        dof.dry_friction += 0.5 * (forward + backward);
        dof.torque.constant -= 0.5 * (forward - backward);
        dof.torque.damping += if state.dq > 0.0 { p[2] } else { p[3] };
    }
}

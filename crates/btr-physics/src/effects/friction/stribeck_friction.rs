//! Stribeck friction: dry friction that is larger at rest than in motion, as lubricant is drawn in with speed.
//!
//! The friction torque is evaluated once per step; the engine then holds or brakes the joint with it, so nothing creeps
//! below the breakaway torque.

use crate::actuation::JointInput;
use crate::effects::effect::{DryFriction, Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;

pub(in crate::effects) struct StribeckFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "stribeck_friction",
    law: "-(coulomb + (static - coulomb)·exp(-(dq/velocity)^2))·sign(dq); holds at rest up to static, at least coulomb",
    site: SiteKind::Joint,
    cite: "Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994",
    symptom: "the torque residual is largest just after a reversal and falls with speed; slow ramps show stick-slip",
    params: &[
        Param::new("coulomb", "N·m", (0.0, 5.0), 0.1),
        Param::new("static", "N·m", (0.0, 5.0), 0.25),
        Param::shape("velocity", "rad/s", (0.005, 5.0), 0.2),
    ],
    starts: &[&[0.05], &[0.2], &[1.0]],
    similar: &["coulomb_friction", "presliding_friction"],
    nested: &[("coulomb_friction", &[0.1, 0.1, 0.2])],
};

impl Effect for StribeckFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::OfMotion
    }

    fn dry_friction(&self) -> DryFriction {
        DryFriction::Adds
    }

    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        // The curve falls: below Coulomb's torque, the static one has no meaning, and the law is Coulomb's.
        let (coulomb, stiction, velocity) = (p[0], p[1].max(p[0]), p[2]);
        dof.dry_friction += coulomb + (stiction - coulomb) * (-(state.dq_midpoint() / velocity).powi(2)).exp();
    }
}

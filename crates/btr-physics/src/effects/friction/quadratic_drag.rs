//! Drag that grows with the square of the speed: air, water, churned grease.

use crate::actuation::JointInput;
use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;

pub(in crate::effects) struct QuadraticDrag;

static SPEC: EffectSpec = EffectSpec {
    name: "quadratic_drag",
    law: "-coefficient·|dq|·dq",
    site: SiteKind::Joint,
    cite: "Newton's law of resistance, Principia, book II",
    symptom: "a torque residual against the motion in fast sections, absent in slow ones",
    params: &[Param::new("coefficient", "N·m·s^2/rad^2", (0.0, 1.0), 0.03)],
    starts: &[],
    similar: &["viscous_friction"],
    nested: &[],
};

impl Effect for QuadraticDrag {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        dof.torque.damping += p[0] * state.dq_midpoint().abs();
    }
}

//! Viscous friction: a torque against the motion, proportional to its speed.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;

pub(in crate::effects) struct ViscousFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "viscous_friction",
    law: "-coefficient·dq",
    site: SiteKind::Joint,
    cite: "Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994",
    symptom: "a torque residual proportional to the velocity; free swings decay exponentially",
    params: &[Param::new("coefficient", "N·m·s/rad", (0.0, 5.0), 0.1)],
    starts: &[],
    similar: &["quadratic_drag"],
    nested: &[],
};

impl Effect for ViscousFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_usual(&self) -> bool {
        true
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    fn is_constant(&self) -> bool {
        true
    }

    fn joint(&self, p: &[f64], dof: &mut Dof) {
        dof.torque.damping += p[0];
    }
}

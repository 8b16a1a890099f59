//! Coulomb friction: a constant torque against the motion, and up to that torque at rest.

use crate::effects::effect::{DryFriction, Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;

pub(in crate::effects) struct CoulombFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "coulomb_friction",
    law: "-torque·sign(dq); holds at rest",
    site: SiteKind::Joint,
    cite: "Coulomb, Théorie des machines simples, 1785",
    symptom: "a square wave in the torque residual that flips with the sign of the velocity; the joint sticks at \
              reversals",
    params: &[Param::new("torque", "N·m", (0.0, 5.0), 0.1)],
    starts: &[],
    similar: &["stribeck_friction", "asymmetric_friction"],
    nested: &[],
};

impl Effect for CoulombFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn is_usual(&self) -> bool {
        true
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    fn dry_friction(&self) -> DryFriction {
        DryFriction::Adds
    }

    fn is_constant(&self) -> bool {
        true
    }

    fn joint(&self, p: &[f64], dof: &mut Dof) {
        dof.dry_friction += p[0];
    }
}

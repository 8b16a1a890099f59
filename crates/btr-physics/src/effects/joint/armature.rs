//! Rotor inertia reflected to the joint: the geared rotor's inertia times the squared ratio.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;

pub(in crate::effects) struct Armature;

static SPEC: EffectSpec = EffectSpec {
    name: "armature",
    law: "adds inertia·ddq to what the motor has to move",
    site: SiteKind::Joint,
    cite: "Featherstone, Rigid Body Dynamics Algorithms, 2008, section 9.6",
    symptom: "a torque residual proportional to the acceleration, the same in every posture; the joint responds \
              sluggishly",
    params: &[Param::new("inertia", "kg·m^2", (0.0, 1.0), 0.01)],
    starts: &[],
    similar: &["link_inertia"],
    nested: &[],
};

impl Effect for Armature {
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
        dof.armature += p[0];
    }
}

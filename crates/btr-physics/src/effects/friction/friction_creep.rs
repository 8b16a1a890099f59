//! Creep of dry friction: a joint that friction holds gives way slowly. Simulators soften dry friction like this, so
//! that it can be solved without switching; without a time constant, friction grows linearly with speed over a
//! transition width of creep·torque.
//!
//! It acts on all dry friction of the joint, whichever effects it comes from. MuJoCo's dry friction with default
//! settings has the time constant 9.5 ms, and creeps at 1.06 ms over the joint's inertia.

use crate::effects::effect::{DryFriction, Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::{Creep, Dof};

pub(in crate::effects) struct FrictionCreep;

static SPEC: EffectSpec = EffectSpec {
    name: "friction_creep",
    law: "where dry friction holds a torque, up to its own: dq + time_constant·ddq = creep·torque",
    site: SiteKind::Joint,
    cite: "MuJoCo documentation, chapter Computation: friction loss as a soft constraint",
    symptom: "a joint that dry friction holds drifts under its load, and comes to rest gradually",
    params: &[
        Param::new("creep", "rad/(s·N·m)", (0.0, 10.0), 0.05),
        Param::shape("time_constant", "s", (0.0, 0.1), 0.01),
    ],
    starts: &[&[0.0], &[0.01]],
    similar: &[],
    nested: &[],
};

impl Effect for FrictionCreep {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::OfMotion
    }

    fn dry_friction(&self) -> DryFriction {
        DryFriction::Changes
    }

    fn is_constant(&self) -> bool {
        true
    }

    fn joint(&self, p: &[f64], dof: &mut Dof) {
        dof.creep = Creep { rate: p[0], time_s: p[1] };
    }
}

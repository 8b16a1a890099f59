//! Spring in parallel with the motor: a balancing spring, a bent cable bundle.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::engine::Dof;

pub(in crate::effects) struct ParallelSpring;

static SPEC: EffectSpec = EffectSpec {
    name: "parallel_spring",
    law: "-stiffness·(q - rest)",
    site: SiteKind::Joint,
    cite: "Hooke's law",
    symptom: "a torque residual that is linear in the position, independent of gravity",
    params: &[Param::new("stiffness", "N·m/rad", (0.0, 50.0), 0.5), Param::shape("rest", "rad", (-3.2, 3.2), 0.0)],
    starts: &[&[0.0], &[-1.0], &[1.0]],
    similar: &["com_offset", "gravity_tilt"],
    nested: &[],
};

impl Effect for ParallelSpring {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    fn is_constant(&self) -> bool {
        true
    }

    fn joint(&self, p: &[f64], dof: &mut Dof) {
        dof.torque.stiffness += p[0];
        dof.torque.constant += p[0] * p[1];
    }
}

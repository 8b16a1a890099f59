//! A spring beside the motor: a balancing spring, a cable bundle that is bent.

use crate::effects::effect::{EffectSpec, Effect, Param, SiteKind};
use crate::engine::Dof;

pub(in crate::effects) struct ParallelSpring;

static SPEC: EffectSpec = EffectSpec {
    name: "parallel_spring",
    law: "-stiffness·(q - rest)",
    site: SiteKind::Joint,
    cite: "Hooke's law",
    symptom: "a torque residual that is a straight line over the position, whatever gravity does",
    params: &[Param::new("stiffness", "N·m/rad", (0.0, 50.0), 0.5), Param::shape("rest", "rad", (-3.2, 3.2), 0.0)],
    starts: &[&[0.0], &[-1.0], &[1.0]],
    similar: &["com_offset", "gravity_tilt"],
    nested: &[],
};

impl Effect for ParallelSpring {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn joint(&self, p: &[f64], dof: &mut Dof) {
        dof.torque.stiffness += p[0];
        dof.torque.constant += p[0] * p[1];
    }
}

//! Additional rotational inertia of a link, the same about every axis.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::Robot;
use nalgebra::Matrix3;

pub(in crate::effects) struct LinkInertia;

static SPEC: EffectSpec = EffectSpec {
    name: "link_inertia",
    law: "adds inertia to the link's about every axis through its centre of mass",
    site: SiteKind::Link,
    cite: "Euler, Theoria motus corporum solidorum, 1765",
    symptom: "a torque residual proportional to the acceleration, on this joint and on those that carry it",
    params: &[Param::new("inertia", "kg·m^2", (0.0, 1.0), 0.01)],
    starts: &[],
    similar: &["armature"],
    nested: &[],
};

impl Effect for LinkInertia {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn link(&self, p: &[f64], robot: &mut Robot, link: usize) {
        robot.links[link].inertia_kg_m2 += Matrix3::identity() * p[0];
    }
}

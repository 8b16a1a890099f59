//! Offset of a link's centre of mass from the model's: cables, screws, a battery that was left out.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::Robot;
use nalgebra::Vector3;

pub(in crate::effects) struct ComOffset;

static SPEC: EffectSpec = EffectSpec {
    name: "com_offset",
    law: "the link's centre of mass is (x, y, z) away from the model's, in the link's axes",
    site: SiteKind::Link,
    cite: "Newton",
    symptom: "static errors that follow the posture like a payload's, but in another direction",
    params: &[
        Param::new("x", "m", (-0.2, 0.2), 0.02),
        Param::new("y", "m", (-0.2, 0.2), 0.02),
        Param::new("z", "m", (-0.2, 0.2), 0.02),
    ],
    starts: &[],
    similar: &["encoder_offset", "gravity_tilt", "payload", "link_inertia", "armature"],
    nested: &[],
};

impl Effect for ComOffset {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn link(&self, p: &[f64], robot: &mut Robot, link: usize) {
        robot.links[link].com_m += Vector3::new(p[0], p[1], p[2]);
    }
}

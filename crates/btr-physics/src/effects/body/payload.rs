//! Additional mass on a link.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::Robot;

pub(in crate::effects) struct Payload;

static SPEC: EffectSpec = EffectSpec {
    name: "payload",
    law: "a point mass at the link's centre of mass",
    site: SiteKind::Link,
    cite: "Newton",
    symptom: "static errors that follow the posture, on this joint and on all that carry it",
    params: &[Param::new("mass", "kg", (0.0, 5.0), 0.1)],
    starts: &[],
    similar: &["com_offset", "end_payload"],
    nested: &[],
};

impl Effect for Payload {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn link(&self, p: &[f64], robot: &mut Robot, link: usize) {
        robot.links[link].mass_kg += p[0];
    }
}

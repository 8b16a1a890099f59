//! Additional mass at the end of a link: in a gripper, on a flange.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::Robot;
use crate::robot::stretch::end;

pub(in crate::effects) struct EndPayload;

static SPEC: EffectSpec = EffectSpec {
    name: "end_payload",
    law: "a point mass at the link's end: at the farthest joint that it carries, or else twice as far as its centre of mass",
    site: SiteKind::Link,
    cite: "Newton",
    symptom: "static errors that follow the posture, on this joint and on all that carry it; they grow with the reach",
    params: &[Param::new("mass", "kg", (0.0, 5.0), 0.1)],
    starts: &[],
    similar: &["payload", "com_offset", "link_inertia"],
    nested: &[],
};

impl Effect for EndPayload {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn acts_at_end(&self) -> bool {
        true
    }

    fn link(&self, p: &[f64], robot: &mut Robot, link: usize) {
        let end = end(robot, link).into();
        robot.links[link].add_point_mass(p[0], &end);
    }
}

//! Additional mass at the end of a link: in a gripper, on a flange.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::robot::Robot;
use crate::robot::stretch::end;
use nalgebra::{Matrix3, Vector3};

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

    fn link(&self, p: &[f64], robot: &mut Robot, link: usize) {
        let end = end(robot, link);
        let link = &mut robot.links[link];
        let mass_kg = link.mass_kg + p[0];
        if mass_kg <= 0.0 {
            return;
        }
        let shift = (end - link.com_m.coords) * (p[0] / mass_kg);
        let to_end = end - link.com_m.coords - shift;
        link.inertia_kg_m2 += of_point(link.mass_kg, &shift) + of_point(p[0], &to_end);
        link.com_m += shift;
        link.mass_kg = mass_kg;
    }
}

/// Inertia of a point mass about an origin (Steiner).
fn of_point(mass_kg: f64, at: &Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * at.norm_squared() - at * at.transpose()) * mass_kg
}

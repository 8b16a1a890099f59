//! Compliant floor (or soles): rubber, carpet, a bending foot.
//!
//! Every contact point with the floor is a spring and a damper of these values: a box on its side has four points, a
//! sphere has one, and a robot sinks by its weight divided by the sum of the stiffnesses.
//!
//! Rapier has no such springs. It gives every contact the frequency and the damping ratio that they would have under
//! the robot's whole mass, sqrt(stiffness/mass)/2pi and damping/(2·sqrt(stiffness·mass)), so a contact that only
//! carries a fraction of the mass, as at the end of a leg, is softer by that fraction.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::setup::{Compliance, Setup};

pub(in crate::effects) struct ContactCompliance;

static SPEC: EffectSpec = EffectSpec {
    name: "contact_compliance",
    law: "every contact with the floor is a spring and a damper: -stiffness·depth - damping·speed",
    site: SiteKind::Ground,
    cite: "Hooke's law; Catto, Soft Constraints, Game Developers Conference 2011",
    symptom: "the body sinks and bounces where it should stand; contact forces rise and fall slowly",
    params: &[
        Param::limit("stiffness", "N/m", (200.0, 1e6), 3000.0),
        Param::shape("damping", "N·s/m", (0.0, 1000.0), 30.0),
    ],
    starts: &[&[5.0], &[50.0]],
    similar: &["ground_friction"],
    nested: &[],
};

impl Effect for ContactCompliance {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn world(&self, p: &[f64], setup: &mut Setup) {
        if let Some(ground) = &mut setup.ground {
            ground.compliance = Some(Compliance { stiffness: p[0], damping: p[1] });
        }
    }
}

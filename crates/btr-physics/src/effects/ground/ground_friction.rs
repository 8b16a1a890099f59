//! Friction coefficient of the floor that differs from the model's.

use crate::effects::effect::{Effect, EffectSpec, Param, SiteKind};
use crate::setup::Setup;

pub(in crate::effects) struct GroundFriction;

static SPEC: EffectSpec = EffectSpec {
    name: "ground_friction",
    law: "the floor's Coulomb coefficient is this instead of the model's",
    site: SiteKind::Ground,
    cite: "Coulomb, Théorie des machines simples, 1785",
    symptom: "feet slip or grip where the model's do not; the distance walked is wrong while the joints follow",
    params: &[Param::replacement("coefficient", "1", (0.0, 2.0), 0.5)],
    starts: &[],
    similar: &["contact_compliance"],
    nested: &[],
};

impl Effect for GroundFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn world(&self, p: &[f64], setup: &mut Setup) {
        if let Some(ground) = &mut setup.ground {
            ground.friction = p[0];
        }
    }
}
